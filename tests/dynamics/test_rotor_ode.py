"""The rotor's ODE: its physics at hand-computed points, and partials of all its parts."""

import numpy as np
import openmdao.api as om
import pytest
from openmdao.utils.assert_utils import assert_check_partials

from hkt_mdo.case import Fluid, Rotor
from hkt_mdo.dynamics.flows import SineInflow
from hkt_mdo.dynamics.generator import Generator
from hkt_mdo.dynamics.laws import OpenLoop, QuadraticFeedback
from hkt_mdo.dynamics.rotor_ode import RotorODE, hydrodynamics_group
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.torque_curve import TorqueSpline

N, RADIUS = 5, 1.4
RUBS = Generator(shaft_friction=20.0, shaft_friction_slope=3.0)
NODES = np.linspace(3.0, 11.0, 33)
TABLE = 0.09 * np.exp(-((NODES - 6.0) ** 2) / 20.0)


def spline_hydrodynamics(num_nodes):
    return hydrodynamics_group(num_nodes=num_nodes, spline=TorqueSpline(NODES))


def problem_of(**options):
    problem = om.Problem(reports=False)
    ode = RotorODE(num_nodes=N, inflow=SineInflow(), **options)
    problem.model.add_subsystem("ode", ode, promotes=["*"])
    problem.setup(force_alloc_complex=True)
    problem.set_val("time", np.linspace(0.0, 20.0, N))
    problem.set_val("rotor_speed", np.linspace(6.0, 9.0, N))
    problem.set_val("density", 998.0)
    problem.set_val("rotor_radius", RADIUS)
    problem.set_val("inertia", 3.5)
    return problem


@pytest.fixture
def closed_loop():
    problem = problem_of(
        hydrodynamics=spline_hydrodynamics, law=QuadraticFeedback(torque_limit=700.0)
    )
    problem.set_val("torque_coefficient_table", TABLE)
    problem.set_val("gain_0", 7.2)
    problem.run_model()
    return problem


def test_friction_brakes_the_shaft_and_takes_its_power(closed_loop):
    """J dw/dt = Q - u - F: the same in the inverse shaft, whose torque is what is left."""
    problem = problem_of(hydrodynamics=spline_hydrodynamics, law=OpenLoop(), generator=RUBS)
    problem.set_val("torque_coefficient_table", TABLE)
    acceleration = closed_loop.get_val("rotor_acceleration")
    problem.set_val("rotor_acceleration", acceleration)
    problem.run_model()
    speed, less = closed_loop.get_val("rotor_speed"), closed_loop.get_val("control_torque")
    less = less - (20.0 + 3.0 * speed)
    np.testing.assert_allclose(problem.get_val("control_torque"), less, rtol=1e-12)
    np.testing.assert_allclose(problem.get_val("generator_power"), less * speed, rtol=1e-12)


def test_acceleration_is_equation_6(closed_loop):
    torque, control = (
        closed_loop.get_val("hydrodynamic_torque"),
        closed_loop.get_val("control_torque"),
    )
    np.testing.assert_allclose(closed_loop.get_val("rotor_acceleration"), (torque - control) / 3.5)


def test_power_is_equation_5_and_scales_with_the_swept_area(closed_loop):
    v, w = closed_loop.get_val("inflow_speed"), closed_loop.get_val("rotor_speed")
    ratio = closed_loop.get_val("tip_speed_ratio")
    np.testing.assert_allclose(ratio, w * RADIUS / v)
    coefficient = closed_loop.get_val("torque_coefficient")
    expected = 0.5 * 998.0 * np.pi * RADIUS**2 * v**3 * ratio * coefficient
    np.testing.assert_allclose(closed_loop.get_val("hydrodynamic_power"), expected, rtol=1e-12)


@pytest.mark.parametrize(
    "options",
    [
        {"law": QuadraticFeedback(torque_limit=700.0)},
        {"law": QuadraticFeedback()},
        {"law": OpenLoop(unknown="speed")},
        {"law": OpenLoop(unknown="torque")},
        {"law": OpenLoop(unknown="speed"), "generator": RUBS},
        {"law": QuadraticFeedback(), "generator": RUBS},
    ],
    ids=["saturated", "unlimited", "speed", "torque", "friction", "friction and law"],
)
def test_partials_by_complex_step(options):
    problem = problem_of(hydrodynamics=spline_hydrodynamics, **options)
    problem.set_val("torque_coefficient_table", TABLE)
    if options["law"].is_feedback:
        problem.set_val("gain_0", 7.2)
    elif options["law"].chooses_torque:
        problem.set_val("control_torque", np.linspace(300.0, 700.0, N))
    else:
        problem.set_val("rotor_acceleration", np.linspace(-1.0, 1.0, N))
    problem.run_model()
    data = problem.check_partials(method="cs", compact_print=True, out_stream=None)
    assert_check_partials(data, atol=1e-9, rtol=1e-12)


@pytest.mark.parametrize("reynolds", ["invariant", "local"])
def test_partials_of_direct_bem_by_central_difference(reynolds):
    """Compiled BEM is not complex-safe, so this one is held to 1e-6 by differences."""
    polars = "naca63815_Re2e5" if reynolds == "invariant" else "naca63815"
    turbine = build_turbine(Rotor(polar=polars, reynolds=reynolds), Fluid(), 1.5)
    blade, polar = turbine.blade, turbine.polar

    def direct(num_nodes):
        return hydrodynamics_group(
            num_nodes=num_nodes, blade=blade, polar=polar, coefficients=bem.rotor_coefficients
        )

    problem = problem_of(hydrodynamics=direct, law=QuadraticFeedback(torque_limit=700.0))
    problem.set_val("gain_0", 7.2)
    problem.run_model()
    data = problem.check_partials(
        method="fd", form="central", step=1e-6, includes="ode.hydrodynamics", out_stream=None
    )
    assert_check_partials(data, atol=1e-3, rtol=1e-6)
