"""The rotor as one object and as a Group that runs without a turbine's other parts."""

import numpy as np
import openmdao.api as om
import pytest
from openmdao.utils.assert_utils import assert_check_partials

from hkt_mdo.rotor.airfoil import PolarFamily
from hkt_mdo.rotor.components import BladeGroup
from hkt_mdo.rotor.model import RotorModel
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.shape import Shape
from hkt_mdo.rotor.steady_optimum import best_blade, best_operation
from hkt_mdo.rotor.strength import Structure
from tests.rotor.test_bem import root_changes

RATIOS = np.array([3.0, 5.0, 6.5, 9.0])
BOUNDS, FREE = {"chord": (0.05, 0.4), "twist": (-0.1, 0.6)}, {"chord": None, "twist": None}


@pytest.fixture(scope="module")
def rotor():
    polar = PolarFamily.from_file("naca63815_Re2e5").polars[0]
    structure = Structure.of(Outline.from_file("naca63815"), 2700.0)
    return RotorModel(polar=polar, hub_inertia=0.5, structure=structure, depth=3.0)


# The object


def test_its_best_blade_is_that_of_the_shape(rotor, blade):
    shape = Shape.designed(blade, FREE, BOUNDS)
    best = rotor.best_of_shape(shape, blade)
    again = best_blade(shape.blade, rotor.polar, best.tip_speed_ratio, BOUNDS)
    assert again.power_coefficient == pytest.approx(best.power_coefficient, rel=1e-9)
    fixed = rotor.best_of_shape(Shape.fixed(blade), blade)
    assert fixed.power_coefficient == rotor.best_operation(blade).power_coefficient
    turned = rotor.best_of_shape(Shape.fixed(blade, 0.0, (-0.1, 0.1)), blade)
    assert fixed.power_coefficient < turned.power_coefficient < best.power_coefficient
    assert best_operation(blade, rotor.polar).tip_speed_ratio == fixed.tip_speed_ratio


# The group


def test_the_torque_jumps_where_a_root_vanishes(rotor, blade):
    changes = [ratio for _, ratio in root_changes(blade, rotor.polar, 0.5, 15.0)]
    assert len(changes) == 2
    for change in changes:
        assert rotor.torque_jump(blade, [change], near=0.1) in blade.r
    for ends in (1.01 * changes[0], 0.99 * changes[1]), (1.01 * changes[1], 15.0):
        assert rotor.torque_jump(blade, ends) is None


@pytest.mark.parametrize("family", ["stations", "spline", "set angle", "none"])
def test_the_group_runs_alone_with_exact_partials(rotor, blade, family):
    shape = {
        "stations": Shape.designed(blade, FREE, BOUNDS),
        "spline": Shape.designed(blade, {"chord": 4, "twist": 3}, BOUNDS),
        "set angle": Shape.fixed(blade, 0.0, (-0.1, 0.1)),
        "none": None,
    }[family]
    names = "torque_coefficient", "root_moment", "stress", "cavitation"
    options = {"nodes": RATIOS, "shape": shape, "names": names}
    problem = om.Problem(BladeGroup(rotor=rotor, blade=blade, **options), reports=False)
    blade = blade if shape is None else shape.nearest(blade)
    problem.setup()
    problem.run_model()
    expected = rotor.coefficients(blade, RATIOS)
    np.testing.assert_allclose(problem["torque_coefficient_table"], expected.torque, rtol=1e-9)
    stress = rotor.loads(blade, RATIOS)["stress"].largest
    np.testing.assert_allclose(problem["stress_table"], stress, rtol=0.02)
    mass = rotor.mass_and_inertia(blade)
    assert (problem["mass"][0], problem["inertia"][0]) == pytest.approx(mass[:2], rel=1e-9)
    partials = problem.check_partials(method="fd", form="central", step=1e-6, out_stream=None)
    assert_check_partials(partials, atol=1e-3, rtol=1e-5)
