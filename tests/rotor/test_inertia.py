"""Mass and inertia of solid blades: closed forms and partials."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.components import InertiaComp
from hkt_mdo.rotor.inertia import mass_and_inertia, water_inertia
from hkt_mdo.rotor.model import RotorModel
from tests.conftest import checked

AREA, DENSITY, HUB, TIP, COUNT = 0.094, 2700.0, 0.2, 1.4, 3
R = np.array([0.3, 0.55, 0.9, 1.2, 1.38])


def blade(chord, cone=0.0):
    return Blade(R, chord, np.zeros(5), HUB, TIP, COUNT, cone)


# Theory


def test_tapered_blade_has_the_closed_form():
    """For chord = a + b r between first and last station, m and J are integrals of a polynomial."""
    a, b = 0.3, -0.12
    chord = a + b * R
    mass, inertia = mass_and_inertia(blade(chord), AREA, DENSITY)
    square = np.polynomial.Polynomial([a, b]) ** 2

    def integral(power):
        one = np.polynomial.Polynomial([0.0] * power + [1.0])
        whole, outside = (square * one).integ(), one.integ()
        root = chord[0] ** 2 * (outside(R[0]) - outside(HUB))
        tip = chord[-1] ** 2 * (outside(TIP) - outside(R[-1]))
        return COUNT * DENSITY * AREA * (root + whole(R[-1]) - whole(R[0]) + tip)

    assert mass == pytest.approx(integral(0), rel=1e-13)
    assert inertia == pytest.approx(integral(2), rel=1e-13)


def test_coned_blades_have_the_mass_of_plane_ones_and_cosine_squared_of_their_inertia():
    chord = np.array([0.2, 0.18, 0.15, 0.1, 0.08])
    plane = mass_and_inertia(blade(chord), AREA, DENSITY)
    coned = mass_and_inertia(blade(chord, 0.3), AREA, DENSITY)
    assert coned[0] == pytest.approx(plane[0], rel=1e-14)
    assert coned[1] == pytest.approx(plane[1] * np.cos(0.3) ** 2, rel=1e-14)


def test_water_of_a_plate_turning_like_a_paddle():
    """A cylinder of water about each blade across the flow, and none about one along it."""
    chord = np.full(5, 0.2)
    for cone in (0.0, 0.3):
        paddle = blade(chord, cone).with_shape(chord, np.full(5, 0.5 * np.pi))
        cylinder = 1000.0 * np.pi * 0.1**2 * (TIP**3 - HUB**3) / 3.0 * np.cos(cone) ** 2
        inertia = water_inertia(paddle, 1000.0)
        assert inertia == pytest.approx(paddle.blade_count * cylinder, rel=1e-12)
        flat = paddle.with_shape(chord, np.zeros(5))
        assert water_inertia(flat, 1000.0) == 0.0
        assert water_inertia(flat, 1000.0, 0.3) == pytest.approx(0.09 * inertia, rel=1e-12)


def test_the_planform_is_the_integral_of_the_chord():
    """Of a trapezoid: (root + tip) / 2 times span; it grows with the radius of stations too."""
    r = np.linspace(0.2, 1.4, 7)
    trapezoid = Blade(r, 0.3 - 0.1 * r, np.zeros(7), 0.2, 1.4, 3)
    area = trapezoid.area_weights @ trapezoid.chord
    assert area == pytest.approx(3 * 0.5 * (0.28 + 0.16) * 1.2, rel=1e-12)
    rotor = RotorModel(None, SimpleNamespace(density=DENSITY, section_area=AREA))
    problem = checked(InertiaComp(rotor, trapezoid), 1e-10, 1e-12, rotor_radius=2.8)
    np.testing.assert_allclose(problem.get_val("blade_area"), 2.0 * area, rtol=1e-14)


# Partials


@pytest.mark.parametrize("water", ["none", "plate", "ellipse"])
def test_partials_are_exact(water):
    chord = np.array([0.2, 0.18, 0.15, 0.1, 0.08])
    options = {"hub_inertia": 0.5, "added_inertia": water, "thickness": 0.2}
    rotor = RotorModel(None, SimpleNamespace(density=DENSITY, section_area=AREA), **options)
    twisted = blade(chord, 0.1).with_shape(chord, np.linspace(0.5, 0.1, 5))
    twisted = replace(twisted, hub_inertia=0.5 if water == "plate" else None)  # designed
    values = {"rotor_radius": 1.1 * TIP} | ({"hub_inertia": 0.6} if water == "plate" else {})
    problem = checked(InertiaComp(blade=twisted, rotor=rotor), 1e-10, 1e-12, **values)
    assert problem["inertia"][0] > 0.5
