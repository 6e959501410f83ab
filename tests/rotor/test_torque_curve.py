"""The spline over tip speed ratio and the component that fills its table."""

import numpy as np
import openmdao.api as om
import pytest
from openmdao.utils.assert_utils import assert_check_partials

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.components import TablesComp
from hkt_mdo.rotor.hydrodynamics import Hydrodynamics
from hkt_mdo.rotor.torque_curve import TorqueSpline

NODES = np.unique(
    np.concatenate((np.arange(1.0, 4.0, 0.5), np.arange(4.0, 11.0, 0.25), [12.0, 14.0]))
)


@pytest.fixture(scope="module")
def spline():
    return TorqueSpline(NODES)


# Theory


def test_straight_line_is_reproduced_inside_and_beyond(spline):
    points = np.linspace(-1.0, 20.0, 97)
    assert np.allclose(spline.basis(points) @ (2.0 - 0.3 * NODES), 2.0 - 0.3 * points, atol=1e-12)
    assert np.allclose(spline.basis(points, 1) @ (2.0 - 0.3 * NODES), -0.3, atol=1e-12)
    assert np.allclose(spline.basis(points, 2) @ (2.0 - 0.3 * NODES), 0.0, atol=1e-11)


def test_nodes_are_interpolated_and_weights_sum_to_one(spline):
    assert np.allclose(spline.basis(NODES), np.eye(NODES.size), atol=1e-13)
    assert np.allclose(spline.basis(np.linspace(0.0, 20.0, 50)).sum(axis=1), 1.0, atol=1e-12)


def test_cubic_is_reproduced_away_from_the_ends():
    """The natural end condition is felt over a few nodes only: it fades by about 0.27 a node."""
    nodes = np.linspace(0.0, 10.0, 81)
    inside = np.linspace(4.0, 6.0, 31)

    def cubic(x):
        return 1.0 + x * (0.5 + x * (-0.2 + 0.01 * x))

    assert np.allclose(TorqueSpline(nodes).basis(inside) @ cubic(nodes), cubic(inside), atol=1e-12)


def test_derivatives_are_exact(spline):
    points = np.linspace(0.2, 16.0, 201)
    values = spline.basis(points + 1e-30j)
    assert np.allclose(values.imag / 1e-30, spline.basis(points, 1), atol=1e-12)
    step = 1e-5
    inside = points[(points > 1.1) & (points < 13.9)]
    second = (spline.basis(inside + step, 1) - spline.basis(inside - step, 1)) / (2.0 * step)
    assert np.allclose(second, spline.basis(inside, 2), atol=1e-4)


def test_spline_is_smooth_at_its_ends(spline):
    table = np.sin(NODES)
    for end in NODES[[0, -1]]:
        around = spline.basis(np.array([end - 1e-9, end + 1e-9])) @ table
        slopes = spline.basis(np.array([end - 1e-9, end + 1e-9]), 1) @ table
        assert abs(around[1] - around[0]) < 1e-8
        assert abs(slopes[1] - slopes[0]) < 1e-7


# The component


def test_table_is_the_torque_coefficient_and_its_partials_are_right(blade, polar):
    problem = om.Problem()
    component = TablesComp(blade=blade, rotor=Hydrodynamics(polar), nodes=NODES)
    problem.model.add_subsystem("table", component, promotes=["*"])
    problem.setup()
    problem.run_model()
    assert np.array_equal(
        problem["torque_coefficient_table"], bem.rotor_coefficients(blade, polar, NODES).torque
    )
    found = problem.check_partials(method="fd", form="central", step=1e-6, out_stream=None)
    assert_check_partials(found, atol=1e-6, rtol=1e-6)


def test_the_table_depends_on_lengths_through_their_ratios_alone(blade, polar):
    """A rotor of another radius with a chord in proportion has the same curve."""
    problem = om.Problem()
    component = TablesComp(blade=blade, rotor=Hydrodynamics(polar), nodes=NODES)
    problem.model.add_subsystem("table", component, promotes=["*"])
    problem.setup()
    problem.set_val("chord", 1.5 * blade.chord)
    problem.set_val("rotor_radius", 1.5 * blade.rotor_radius)
    problem.run_model()
    np.testing.assert_allclose(
        problem["torque_coefficient_table"],
        bem.rotor_coefficients(blade, polar, NODES).torque,
        rtol=1e-12,
        atol=1e-15,
    )
