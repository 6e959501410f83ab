"""Control of the speed to a schedule: linear theory, then the motion, then derivatives."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.flows import ConstantInflow, SineInflow
from hkt_mdo.dynamics.laws import OpenLoop, smooth_saturation
from hkt_mdo.dynamics.rotor_ode import FeedbackComp
from hkt_mdo.dynamics.simulation import FeedbackTorque, Plant, simulate
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor import bem
from hkt_mdo.start.find import find_start
from tests.conftest import CASES, NINE, checked

KNOTS, INERTIA, TIME = 5, 4.0, np.linspace(0.0, 20.0, 201)
LAW = Tracking(knots=KNOTS, flow_range=(1.2, 1.8))
SPEEDS = np.linspace(6.0, 9.0, KNOTS)
GAINS = np.array([*SPEEDS, 150.0, 600.0])


def model_of(*overrides):
    return physics(load_case(CASES / "sine_oloc.yaml", overrides))


def plant_of(model):
    return Plant(model.blade, model.rotor.polar, INERTIA, model.density, bem.rotor_coefficients)


def following(*overrides):
    """Return physics, run and start of a blade as it is that follows its open loop's schedule."""
    model = model_of(*overrides)
    start = find_start(model, model.rotor.best_operation(model.blade), improve=False)
    speed, torque = start.operation.rotor_speed[0], start.operation.hydrodynamic_torque[0]
    states = model.law.at_rest(torque, float(model.inflow.speed_at(0.0)))
    loop, time = FeedbackTorque(model.law, start.gains), model.scenarios[0].dense
    run = simulate(plant_of(model), model.inflow, loop, [speed, *states], time)
    return model, run, start


# Linear theory ------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [4.0, 7.0, 9.0])
def test_eigenvalues_are_those_of_a_proportional_integral_loop(plant, ratio):
    """J s² + (kp - dQ/dw) s + ki = 0, and the sensor's -1/lag (no torque limit)."""
    radius, flow, h = plant.blade.rotor_radius, np.array([1.5]), 1e-4
    speed, speeds = ratio * flow / radius, ratio * np.linspace(*LAW.flow_range, KNOTS) / radius
    torque, faster, slower = (plant.torque(speed + move, flow) for move in (0.0, h, -h))
    gains, slope = np.array([*speeds, 150.0, 600.0]), (faster[0] - slower[0]) / (2.0 * h)
    loop, states = FeedbackTorque(LAW, gains), LAW.at_rest(torque, flow)
    values = np.linalg.eigvals(Loop.of(plant, loop, speed, flow, *states).rotor[0])
    expected = np.r_[np.roots([INERTIA, gains[-2] - slope, gains[-1]]), -1.0 / LAW.lag]
    np.testing.assert_allclose(np.sort_complex(values), np.sort_complex(expected), rtol=1e-5)


def test_with_anti_windup_the_loop_is_stable_where_the_proportional_part_exceeds_the_flows_slope():
    """With x saturated to u: where kp du/dx > dQ/dw, for every ki > 0; beyond it, as far as

    kp du/dx > dQ/dw - J (1 - du/dx) ki / kp  and  kp du/dx > (1 - du/dx) dQ/dw.
    """
    limit, rng = 700.0, np.random.default_rng(1)
    law, count = LAW.model_copy(update={"torque_limit": limit}), 400
    wanted, integral = rng.uniform(0.0, 1.2 * limit, count), rng.uniform(0.0, 700.0, count)
    reference, slope = law.reference(np.full(count, 1.5), GAINS), rng.uniform(-200.0, 200.0, count)
    speed = reference + (wanted - integral) / GAINS[-2]
    matrix = law.slopes(speed, 1.5, GAINS, integral, np.full(count, 1.5))
    matrix[0] *= -1.0 / INERTIA
    matrix[0, 0] += slope / INERTIA
    growth = np.linalg.eigvals(np.moveaxis(matrix, -1, 0)).real.max(axis=1)
    passed = np.imag(smooth_saturation(wanted + 1e-40j, limit, law.smoothing)) / 1e-40
    gain, lost = GAINS[-2] * passed, 1.0 - passed
    stable = (gain > slope - INERTIA * lost * GAINS[-1] / GAINS[-2]) & (gain > lost * slope)
    assert 50 < np.sum(stable) < 350
    np.testing.assert_array_equal(growth < 0.0, stable)
    assert np.all(growth[gain > slope] < 0.0)


def test_in_equilibrium_nothing_changes():
    for law in (LAW, LAW.applied(0.9), LAW.model_copy(update={"bias": 0.1})):
        speed = law.speed_at_rest(np.array([1.3, 1.6]), GAINS)
        np.testing.assert_allclose(speed, law.reference(np.array([1.3, 1.6]) + law.bias, GAINS))
        torque = np.array([400.0, 500.0])
        states = law.at_rest(torque, np.array([1.3, 1.6]))
        np.testing.assert_allclose(law.torque(speed, GAINS, *states), torque, rtol=1e-14)
        rates = law.rates(speed, np.array([1.3, 1.6]), GAINS, *states)
        np.testing.assert_allclose(rates, 0.0, atol=1e-10)


def test_schedule_is_its_knots_and_a_straight_line_where_they_are():
    knots = np.linspace(1.2, 1.8, KNOTS)
    np.testing.assert_allclose(LAW.reference(knots, GAINS), SPEEDS, rtol=1e-13)
    beyond = np.array([1.0, 1.41, 2.0])
    np.testing.assert_allclose(LAW.reference(beyond, GAINS), 5.0 * beyond, rtol=1e-12)


# Motion -------------------------------------------------------------------------------------------


def test_slow_sine_and_a_quick_sensor_give_the_open_loops_energy():
    """Of the same blade, kept, in quasi-steady operation."""
    overrides = ["design.blade=fixed", "inflow.angular_frequency=0.05", "phase.duration=125.66"]
    model = model_of(*overrides)
    ideal = find_start(model, model.rotor.best_operation(model.blade), improve=False).operation
    _, run, _ = following(*overrides, "control={law: tracking, lag: 0.01}")
    assert run.energy == pytest.approx(ideal.energy, rel=1e-4)


@pytest.mark.slow
def test_underspeed_is_held_where_a_static_law_is_unstable():
    """The blade keeps 4 kW by turning slower as the flow quickens, so its torque rises.

    A law of the speed alone that does so has u = P / w and falls where Q rises.
    """
    limited = f"rotor.stations={NINE}", "limits.power=4 kW", "start.branch=underspeed"
    fixed = "design.blade=fixed"
    model, run, start = following(*limited, fixed, "control={law: tracking, knots: 20, lag: 0.02}")
    assert start.branch == "underspeed"
    assert np.max(run.control_torque * run.rotor_speed) < 4100.0
    quick = run.inflow_speed > 1.6
    assert np.corrcoef(run.inflow_speed[quick], run.rotor_speed[quick])[0, 1] < -0.9
    assert run.energy == pytest.approx(start.operation.energy, rel=2e-3)
    plant, loop = plant_of(model), FeedbackTorque(model.law, start.gains)
    matrix = Loop.of(plant, loop, run.rotor_speed, run.inflow_speed, *run.states).rotor
    assert np.max(np.linalg.eigvals(matrix).real) < 0.0
    fast = np.argmax(run.inflow_speed)
    flow, w, u = run.inflow_speed[fast], run.rotor_speed[fast], run.hydrodynamic_torque[fast]

    def static(_, speed):
        return np.minimum(u * w / speed, 1.5 * u)

    for begin, end in ((0.99, 0.8), (1.01, 1.2)):  # away from the equilibrium, on both sides
        lost = simulate(plant, ConstantInflow(speed=flow), static, begin * w, TIME)
        assert (lost.rotor_speed[-1] / w < end) == (end < 1.0)
        assert abs(lost.rotor_speed[-1] / w - 1.0) > 0.2


def test_motion_is_that_of_scipys_radau(plant):
    law = LAW.model_copy(update={"torque_limit": 600.0, "bias": 0.03})
    loop, flow, start = FeedbackTorque(law, GAINS), SineInflow(), [7.0, 300.0, 1.4]
    run = simulate(plant, flow, loop, start, TIME, 1.0)

    def rates(time, values):
        w, v = np.array([values[0]]), np.atleast_1d(flow.speed_at(time))
        u = law.torque(w, GAINS, *values[1:, None])
        driving = plant.torque(w, v)
        others = law.rates(w, v, GAINS, *values[1:, None])
        return np.concatenate([(driving - u) / INERTIA, *others])

    exact = solve_ivp(rates, (0.0, 20.0), start, "Radau", run.time, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(run.rotor_speed, exact.y[0], rtol=1e-7)
    np.testing.assert_allclose(run.states, exact.y[1:], rtol=1e-7)


# Derivatives, and the case ------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [None, 500.0])
def test_partials_by_complex_step(limit):
    law, n = LAW.model_copy(update={"torque_limit": limit}), 7
    rng = np.random.default_rng(2)
    values = {
        "rotor_speed": rng.uniform(6.0, 9.0, n),
        "inflow_speed": rng.uniform(1.1, 1.9, n),
        "integral_torque": rng.uniform(200.0, 600.0, n),
        "sensed_flow": rng.uniform(1.1, 1.9, n),
    }
    gains = {f"gain_{i}": gain for i, gain in enumerate(GAINS)}
    problem = checked(FeedbackComp(num_nodes=n, law=law), 1e-9, 1e-9, **values, **gains)
    expected = law.torque(values["rotor_speed"], GAINS, *list(values.values())[2:])
    np.testing.assert_allclose(problem.get_val("control_torque"), expected, rtol=1e-14)


def test_rate_of_the_torque_is_along_the_motion(plant):
    loop = FeedbackTorque(LAW, GAINS)
    run = simulate(plant, SineInflow(), loop, [7.0, 300.0, 1.4], np.linspace(0.0, 5.0, 5001))
    acceleration = (run.hydrodynamic_torque - run.control_torque) / INERTIA
    rate = loop.rate(run.time, run.rotor_speed, acceleration, run.inflow_speed, *run.states)
    expected = np.gradient(run.control_torque, run.time)
    np.testing.assert_allclose(rate[5:-5], expected[5:-5], rtol=1e-3, atol=1.0)


def test_knots_span_the_design_flow():
    model = model_of("control=tracking")
    np.testing.assert_allclose(model.law.flow_range, (1.3, 1.7), rtol=1e-4)
    assert physics(model.case).law == model.law
    still = model_of("control=tracking", "inflow={profile: constant, speed: 1.5}")
    assert still.law.flow_range[0] < still.law.flow_range[1]
    assert OpenLoop().states == {}
