"""What of a blade is designed: splines, scaling, set angle, and the component's partials."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.components import ShapeComp
from hkt_mdo.rotor.shape import Shape, spline_basis
from tests.conftest import checked

BOUNDS = {"chord": (0.01, 1.0), "twist": (-0.5, 0.5), "thickness": (0.12, 0.24)}


def designed(blade, chord, twist, radius_bounds=None, **thickness):
    return Shape.designed(
        blade, {"chord": chord, "twist": twist, **thickness}, BOUNDS, radius_bounds
    )


@pytest.mark.parametrize("points", [2, 3, 4, 7, 12])
def test_spline_basis_is_a_partition_of_unity_and_reproduces_straight_lines(points):
    """A clamped B-spline is a straight line where its control points are one over their places."""
    position = np.linspace(0.2, 1.4, 57)
    basis = spline_basis(points, position, 0.2, 1.4)
    assert np.all(basis >= 0.0)
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, rtol=1e-14)
    degree = min(3, points - 1)
    knots = np.r_[[0.2] * degree, np.linspace(0.2, 1.4, points - degree + 1), [1.4] * degree]
    greville = np.array([knots[i + 1 : i + degree + 1].mean() for i in range(points)])
    np.testing.assert_allclose(basis @ greville, position, rtol=1e-13)


def test_many_stations_are_a_spline_unless_given_otherwise(blade):
    r = np.linspace(0.2, 1.38, 30)
    many = replace(blade, r=r, chord=0.2 - 0.1 * r, twist=0.3 - 0.2 * r)
    assert designed(many, None, None).bases["chord"].shape == (30, 8)
    free = designed(many, 30, 40)
    assert free.blade is many
    np.testing.assert_array_equal(free.bases["twist"], np.eye(30))


def test_nearest_blade_of_the_family_is_found_again(blade):
    shape = designed(blade, 4, 5)
    once = shape.nearest(blade)
    twice = shape.nearest(once)
    np.testing.assert_allclose(twice.chord, once.chord, rtol=1e-13)
    np.testing.assert_allclose(twice.twist, once.twist, rtol=1e-12)


def test_a_fixed_blade_is_scaled_with_its_radius_and_keeps_its_power(blade, polar):
    """Power coefficients depend on the ratios of lengths alone."""
    shape = Shape.fixed(blade, radius_bounds=(1.0, 2.0))
    large = shape.at(shape.control(blade), 1.7)
    np.testing.assert_allclose(large.chord / blade.chord, 1.7 / 1.4, rtol=1e-14)
    assert large.rotor_radius == pytest.approx(1.7, rel=1e-15)
    assert large.hub_radius / large.tip_radius == pytest.approx(0.125, rel=1e-14)
    ratio = np.linspace(3.0, 10.0, 9)
    scaled, power = (bem.rotor_coefficients(each, polar, ratio).power for each in (large, blade))
    np.testing.assert_allclose(scaled, power, rtol=1e-11)


def thick(blade):
    return replace(blade, thickness=np.linspace(0.26, 0.15, blade.r.size))


def test_thickness_begins_within_its_bounds(blade):
    assert designed(thick(blade), 5, 5, thickness=3).blade.thickness.max() <= 0.24
    free = designed(thick(blade), None, None, thickness=99)
    assert free.points == dict.fromkeys(("chord", "twist", "thickness"), blade.r.size)


@pytest.mark.parametrize(
    "make",
    [
        lambda blade: designed(blade, None, None),
        lambda blade: designed(blade, 5, 4, (1.0, 2.0)),
        lambda blade: designed(blade, 5, None),
        lambda blade: designed(thick(blade), 5, None, thickness=4),
        lambda blade: Shape.fixed(blade),
        lambda blade: Shape.fixed(blade, 0.1, (-0.2, 0.3), (1.0, 2.0)),
    ],
    ids=["stations", "splines and radius", "chord spline", "thickness", "fixed", "set angle"],
)
def test_component_is_the_shape_with_exact_partials(blade, make):
    shape = make(blade)
    control = {name: 1.1 * values + 0.01 for name, values in shape.control(shape.blade).items()}
    inputs = {f"{name}_control": values for name, values in control.items()}
    radius = blade.rotor_radius
    if not shape.designs_chord:
        inputs["rotor_radius"] = radius = 1.2 * radius
    problem = checked(ShapeComp(shape=shape), 1e-12, 1e-12, **inputs)
    made = shape.at(control, radius)
    np.testing.assert_allclose(problem.get_val("chord"), made.chord, rtol=1e-14)
    np.testing.assert_allclose(problem.get_val("twist"), made.twist, rtol=1e-14)
    if "thickness" in shape.bases:
        np.testing.assert_allclose(problem.get_val("thickness"), made.thickness, rtol=1e-14)
