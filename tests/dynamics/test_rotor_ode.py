"""The rotor's ODE: its physics at hand-computed points, and partials of all its parts."""

import numpy as np
import openmdao.api as om
import pytest
from openmdao.utils.assert_utils import assert_check_partials

from hkt_mdo.case import Fluid, Rotor
from hkt_mdo.dynamics.flows import SineInflow
from hkt_mdo.dynamics.generator import LOSSLESS, Generator
from hkt_mdo.dynamics.laws import OpenLoop, QuadraticFeedback
from hkt_mdo.dynamics.rotor_ode import RotorODE
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.torque_curve import TorqueSpline
from tests.conftest import checked

N, RADIUS = 5, 1.4
RUBS = Generator(shaft_friction=20.0, shaft_friction_slope=3.0)
NODES = np.linspace(3.0, 11.0, 33)
TABLE = 0.09 * np.exp(-((NODES - 6.0) ** 2) / 20.0)
LIMITED = QuadraticFeedback(torque_limit=700.0)
KNOWN = {
    "time": np.linspace(0.0, 20.0, N),
    "rotor_speed": np.linspace(6.0, 9.0, N),
    **{"density": 998.0, "rotor_radius": RADIUS, "inertia": 3.5},
}


def ode_of(law, generator=LOSSLESS, **values):
    """Return the problem of an ODE that was run, after a check of the partials of all its parts."""
    ode = RotorODE(N, SineInflow(), {"spline": TorqueSpline(NODES)}, law, generator)
    return checked(ode, 1e-9, 1e-12, **KNOWN, torque_coefficient_table=TABLE, **values)


@pytest.fixture(scope="module")
def closed_loop():
    return ode_of(LIMITED, gain_0=7.2)


def test_friction_brakes_the_shaft_and_takes_its_power(closed_loop):
    """J dw/dt = Q - u - F: the same in the inverse shaft, whose torque is what is left."""
    problem = ode_of(OpenLoop(), RUBS, rotor_acceleration=closed_loop.get_val("rotor_acceleration"))
    speed, less = closed_loop.get_val("rotor_speed"), closed_loop.get_val("control_torque")
    less = less - (20.0 + 3.0 * speed)
    np.testing.assert_allclose(problem.get_val("control_torque"), less, rtol=1e-12)
    np.testing.assert_allclose(problem.get_val("generator_power"), less * speed, rtol=1e-12)


def test_acceleration_is_equation_6(closed_loop):
    left = closed_loop.get_val("hydrodynamic_torque") - closed_loop.get_val("control_torque")
    np.testing.assert_allclose(closed_loop.get_val("rotor_acceleration"), left / 3.5)


def test_power_is_equation_5_and_scales_with_the_swept_area(closed_loop):
    v, w = closed_loop.get_val("inflow_speed"), closed_loop.get_val("rotor_speed")
    ratio = closed_loop.get_val("tip_speed_ratio")
    np.testing.assert_allclose(ratio, w * RADIUS / v)
    coefficient = closed_loop.get_val("torque_coefficient")
    expected = 0.5 * 998.0 * np.pi * RADIUS**2 * v**3 * ratio * coefficient
    np.testing.assert_allclose(closed_loop.get_val("hydrodynamic_power"), expected, rtol=1e-12)


@pytest.mark.parametrize("generator", [LOSSLESS, RUBS], ids=["lossless", "friction"])
@pytest.mark.parametrize(
    ("law", "values"),
    [
        (LIMITED, {"gain_0": 7.2}),
        (QuadraticFeedback(), {"gain_0": 7.2}),
        (OpenLoop(unknown="speed"), {"rotor_acceleration": np.linspace(-1.0, 1.0, N)}),
        (OpenLoop(unknown="torque"), {"control_torque": np.linspace(300.0, 700.0, N)}),
    ],
    ids=["saturated", "unlimited", "speed", "torque"],
)
def test_partials_by_complex_step(law, values, generator):
    ode_of(law, generator, **values)


@pytest.mark.parametrize("reynolds", ["invariant", "local"])
def test_partials_of_direct_bem_by_central_difference(reynolds):
    """Compiled BEM is not complex-safe, so this one is held to 1e-6 by differences."""
    polars = "naca63815_Re2e5" if reynolds == "invariant" else "naca63815"
    turbine = build_turbine(Rotor(polar=polars, reynolds=reynolds), Fluid(), 1.5)
    direct = {"blade": turbine.blade, "polar": turbine.polar}
    direct["coefficients"] = bem.rotor_coefficients
    problem = om.Problem(RotorODE(N, SineInflow(), direct, LIMITED, LOSSLESS), reports=False)
    problem.setup()
    for name, value in (KNOWN | {"gain_0": 7.2}).items():
        problem.set_val(name, value)
    problem.run_model()
    options = {"includes": "coefficient", "out_stream": None, "form": "central", "step": 1e-6}
    data = problem.check_partials(method="fd", **options)
    assert set(data) == {"coefficient"}
    assert_check_partials(data, atol=1e-8, rtol=1e-6)
