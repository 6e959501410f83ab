"""The law as code: C compiled here and Python, held to the law, to a discrete law and to theory."""

import ctypes
import subprocess
import types
from functools import partial
from math import exp

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from hkt_mdo.dynamics.estimate import FlowEstimate
from hkt_mdo.dynamics.simulation import Plant
from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import export
from hkt_mdo.rotor.model import SOLVERS
from tests.exports.made import made

LAWS = {
    "linear": ("{law: linear, torque_limit: 700}", [95.0]),
    "quadratic": ("{law: quadratic, torque_limit: 700, smoothing: 0.02}", [11.0]),
    "unlimited": ("{law: quadratic}", [11.0]),
    "power_law": ("{law: power_law, torque_limit: 700}", [7.5, 2.3]),
    "exponent": ("{law: power_law, exponent: 2.5}", [4.5]),
    "rated": ("{law: rated, torque_limit: 700}", [11.0, 5000.0]),
    "rated_power": ("{law: rated, power: 5 kW, smoothing: 0.01, cut_out: 2.5}", [11.0]),
    "curve": (
        "{law: curve, knots: 6, torque_limit: 700}",
        [4.0, 5.5, 6.5, 7.5, 8.5, 11.0, 180.0, 320.0, 520.0, 600.0, 590.0, 480.0],
    ),
    "two_knots": ("{law: curve, knots: 2}", [4.0, 9.0, 200.0, 650.0]),
}
"""Section `control` of each static law and its gains, by a name."""

SPEEDS = np.concatenate(([-1.0, 0.0, 1e-4, 1e-3], np.linspace(0.01, 40.0, 401)))

TRACKING = "{law: tracking, torque_limit: 600, knots: 5, lag: 0.15, flow_range: [1.3, 1.7]"
SCHEDULE = [6.5, 7.0, 7.6, 8.0, 8.2]
KP, KI = 150.0, 700.0


def result(folder, control, gains, **more):
    text = f"inflow: sine\ncontrol: {control}\nlimits: {{power: 6 kW}}\n"
    return made(folder, text, gains, **more)


def module_of(folder):
    """Return the exported Python module."""
    module = types.ModuleType("controller")
    exec((folder / "controller.py").read_text(), module.__dict__)
    return module


def library_of(folder):
    """Compile the exported C with every warning an error, and load it."""
    library = folder / "controller.so"
    strict = "-std=c99 -pedantic -Wall -Wextra -Wconversion -Werror -O2 -shared -fPIC".split()
    command = ["cc", *strict, str(folder / "controller.c"), "-o", str(library), "-lm"]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return ctypes.CDLL(str(library))


def function_of(folder, language, name, count=1):
    """Return a function of some numbers of the exported code."""
    if language == "Python":
        return getattr(module_of(folder), name)
    function = getattr(library_of(folder), f"hkt_{name}")
    function.argtypes, function.restype = count * [ctypes.c_double], ctypes.c_double
    return function


class State(ctypes.Structure):
    """The struct hkt_state."""

    _fields_ = (("integral", ctypes.c_double), ("flow", ctypes.c_double))


def step_in_c(library, torque, flow):
    """Return the step of the compiled controller, which goes on from a torque and a flow."""
    state = ctypes.byref(State())
    library.hkt_start.argtypes = [ctypes.POINTER(State), ctypes.c_double, ctypes.c_double]
    library.hkt_step.argtypes = library.hkt_start.argtypes
    library.hkt_step.restype = ctypes.c_double
    library.hkt_start(state, torque, flow)
    return partial(library.hkt_step, state)


IN_C = pytest.param("C", marks=pytest.mark.slow)
LANGUAGES = pytest.mark.parametrize("language", ["Python", IN_C])


@pytest.mark.parametrize("name", LAWS)
@LANGUAGES
def test_code_is_the_static_law(name, language, tmp_path):
    solution = result(tmp_path / "result", *LAWS[name])
    export(solution, ["controller"], tmp_path)
    torque, design = function_of(tmp_path, language, "torque"), solution.design()
    wanted = design.law.torque(SPEEDS, design.gains)
    torques = [torque(speed) for speed in SPEEDS.tolist()]
    np.testing.assert_allclose(torques, wanted, rtol=1e-12, atol=1e-12 * np.max(np.abs(wanted)))


@pytest.fixture
def tracking(tmp_path):
    return result(tmp_path / "result", f"{TRACKING}}}", [*SCHEDULE, KP, KI])


def operation(time):
    """Return speeds of rotor and flow in which the torque meets its limit, and leaves it."""
    flow = 1.5 + 0.2 * np.sin(0.6 * time)
    return 7.5 + 0.9 * np.sin(0.6 * time) + 0.8 * np.sin(0.9 * time), flow


def readings(period, duration=20.0):
    """Return times and what the sensors tell then."""
    time = np.arange(0.0, duration, period)
    return time, *operation(time)


def discrete(period, speeds, flows, limit=600.0, lag=0.15):
    """Return the torques of the law with what it senses held over each step, written out."""
    schedule = CubicSpline(np.linspace(1.3, 1.7, 5), SCHEDULE, bc_type="natural")
    integral, sensed, torques = 400.0, flows[0], []
    for speed, flow in zip(speeds, flows, strict=True):
        inside = min(max(sensed, 1.3), 1.7)
        wanted = schedule(inside) + schedule(inside, 1) * (sensed - inside)
        ratio = 2.0 * (KP * (speed - wanted) + integral) / limit
        roots = np.sqrt(0.001 + ratio**2) - np.sqrt(0.001 + (ratio - 2.0) ** 2)
        torques.append(0.25 * limit * (2.0 + roots))
        integral = torques[-1] + (integral - torques[-1]) * exp(-period * KI / KP)
        sensed = flow + (sensed - flow) * exp(-period / lag)
    return np.array(torques)


@LANGUAGES
def test_steps_of_tracking_are_the_discrete_law(tracking, tmp_path, language):
    export(tracking, ["controller"], tmp_path, options=["controller.sample_time=2 ms"])
    _, speeds, flows = readings(0.002)
    if language == "C":
        step = step_in_c(library_of(tmp_path), 400.0, flows[0])
    else:
        module = module_of(tmp_path)
        assert module.SAMPLE_TIME == 0.002
        step = module.Controller(400.0, flows[0]).step
    torques = [step(*each) for each in zip(speeds.tolist(), flows.tolist(), strict=True)]
    wanted = discrete(0.002, speeds, flows)
    np.testing.assert_allclose(torques, wanted, rtol=2e-12)
    assert np.max(wanted) > 595.0  # saturated
    assert np.min(wanted) < 450.0


def test_steps_of_tracking_converge_to_the_continuous_law(tracking, tmp_path):
    design = tracking.design()
    law, gains = design.law, design.gains

    def rates(time, states):
        return law.rates(*operation(time), gains, *states)

    begin = [400.0, 1.5]
    solution = solve_ivp(rates, (0.0, 20.0), begin, rtol=1e-10, atol=1e-8, dense_output=True).sol
    errors = []
    for period in (0.008, 0.004, 0.002, 0.001):
        folder = tmp_path / f"{period}"
        export(tracking, ["controller"], folder, options=[f"controller.sample_time={period} s"])
        time, speeds, flows = readings(period)
        controller = module_of(folder).Controller(*begin)
        torques = [controller.step(*x) for x in zip(speeds.tolist(), flows.tolist(), strict=True)]
        errors.append(np.max(np.abs(torques - law.torque(speeds, gains, *solution(time)))))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 1.0, atol=0.1)  # what is sensed is held over a step
    assert errors[-1] < 2.0


def test_the_sample_time_follows_the_loop(tracking, tmp_path):
    answers = tracking.design().inertia / KP
    export(tracking, ["controller"], tmp_path)
    period = module_of(tmp_path).SAMPLE_TIME
    assert 0.1 * answers < period <= 0.2 * answers
    assert float(f"{period:.1g}") == period
    options = [f"controller.sample_time={2.01 * answers} s"]
    with pytest.raises(InputError, match=r"makes the loop unstable.*less than 2 J / kp"):
        export(tracking, ["controller"], tmp_path / "slow", options=options)


@LANGUAGES
def test_an_estimated_flow_is_that_of_the_program(tmp_path, language):
    control = f"{TRACKING}, flow: estimated}}\ngenerator: {{shaft_friction: 20}}"
    solution = result(tmp_path / "result", control, [*SCHEDULE, KP, KI])
    export(solution, ["controller"], tmp_path)
    design, flow = solution.design(), function_of(tmp_path, language, "flow", 3)
    model = design.physics
    rotor = design.blade, design.plant.polar, design.inertia, model.density, SOLVERS["vectorized"]
    plant = Plant(*rotor, model.case.generator)
    estimate, random = FlowEstimate(plant), np.random.default_rng(1)
    speed, torque = random.uniform(3.0, 12.0, 500), random.uniform(0.0, 900.0, 500)
    acceleration = random.uniform(-2.0, 2.0, 500)
    wanted = estimate(speed, torque, acceleration)
    rows = np.column_stack((speed, torque, acceleration)).tolist()
    np.testing.assert_allclose([flow(*row) for row in rows], wanted, rtol=1e-12)
    steady = plant.torque(np.array([7.5]), np.array([1.5]))
    assert flow(7.5, float(steady[0]) - 20.0, 0.0) == pytest.approx(1.5, rel=1e-6)
    comment = "friction, not part of the law: 20 N m and 0 N m s/rad on the shaft"
    assert comment in (tmp_path / "controller.py").read_text()


def test_a_law_of_an_extension_is_refused_with_the_reason(tmp_path):
    extension = "tests/data/extension.py"
    solution = result(tmp_path / "result", "{law: mixed}", [1.0, 10.0], extensions=[extension])
    with pytest.raises(InputError, match=r"no code for mixed.*known as Python"):
        export(solution, ["controller"], tmp_path / "out")


def test_a_comment_never_continues_in_the_code(tmp_path):
    message = "ends in a backslash \\ or ??/"
    solution = result(tmp_path / "result", *LAWS["linear"], success=False, message=message)
    export(solution, ["controller"], tmp_path, force=True)
    for name in ("controller.c", "controller.h"):
        text = (tmp_path / name).read_text()
        assert "THE RUN WAS NO SUCCESS" in text
        assert "\\" not in text
        assert "??/" not in text
