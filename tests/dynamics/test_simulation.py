"""The independent integration: closed forms, energy balance, order, standstill; then SciPy's."""

import pickle
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hkt_mdo.dynamics.flows import ConstantInflow, GustInflow, Inflow, SineInflow, StepInflow
from hkt_mdo.dynamics.generator import Generator
from hkt_mdo.dynamics.laws import LinearFeedback, QuadraticFeedback
from hkt_mdo.dynamics.sampled import TurbulentInflow
from hkt_mdo.dynamics.simulation import (
    SLOWEST_RATIO,
    FeedbackTorque,
    IntegrationError,
    Plant,
    RecordedTorque,
    _Motion,
    simulate,
)
from hkt_mdo.errors import InputError
from hkt_mdo.rotor.bem import Coefficients, Table
from hkt_mdo.run.verification import TABULATED

DENSITY = 1000.0
TIME = np.linspace(0.0, 20.0, 2001)


def constant_torque_coefficient(value):
    def coefficients(blade, polar, ratio, derivatives=False):
        ratio = np.atleast_1d(ratio)
        return Coefficients(Table(np.full(ratio.shape, value)), ratio * value, np.empty(0))

    return coefficients


def test_friction_slows_the_rotor_as_in_closed_form(blade, polar):
    """J w' = Q - u - F - c w with Q and u constant: w approaches (Q - u - F) / c like e^(-ct/J)."""
    inertia, control, rubs = 40.0, 300.0, Generator(shaft_friction=50.0, shaft_friction_slope=8.0)
    plant = Plant(blade, polar, inertia, DENSITY, constant_torque_coefficient(0.05), rubs)
    torque = 0.5 * DENSITY * 1.5**2 * np.pi * 1.4**3 * 0.05
    run = simulate(plant, ConstantInflow(speed=1.5), lambda t, w: control, 6.0, TIME)
    end, decay = (torque - control - 50.0) / 8.0, np.exp(-8.0 * run.time / inertia)
    np.testing.assert_allclose(run.rotor_speed, end + (6.0 - end) * decay, rtol=1e-8)
    parts = run.generator_energy, run.friction_energy, run.kinetic_energy_change
    assert run.energy == pytest.approx(sum(parts), rel=1e-9)
    assert run.friction_energy > 50.0 * run.energy / torque
    # a standing rotor has the torque of its flow alone
    assert plant.starting_flow == pytest.approx(1.5 * np.sqrt(50.0 / torque))


def test_an_integration_error_passes_between_processes():
    """A run in a pool of processes hands its error on by pickling."""
    for arguments in ((7.5,), (7.5, (3.0, 30.0))):
        error = pickle.loads(pickle.dumps(IntegrationError(*arguments)))
        assert (error.time, str(error)) == (7.5, str(IntegrationError(*arguments)))


def relaxing(blade, polar, rate):
    """Return plant and controller with w' = rate (5 + cos t - w) - sin t (Prothero, Robinson)."""
    plant = Plant(blade, polar, 4.0, DENSITY, constant_torque_coefficient(0.05))
    torque = float(plant.torque(np.array([6.0]), np.array([1.5]))[0])

    def control(time, speed):
        return torque + 4.0 * (rate * (speed - 5.0 - np.cos(time)) + np.sin(time))

    return plant, control


def test_method_is_of_order_nine(blade, polar):
    """Radau IIA with five stages; a large tolerance keeps the steps as long as they are given."""
    plant, control = relaxing(blade, polar, 1.0)

    def error(step):
        run = simulate(plant, ConstantInflow(speed=1.5), control, 7.0, TIME[:801], step, 1e3)
        return abs(run.rotor_speed[-1] - 5.0 - np.cos(8.0) - np.exp(-8.0))

    assert np.log2(error(2.0) / error(1.0)) == pytest.approx(9.0, abs=0.5)


@pytest.mark.parametrize("rate", [1e3, 1e6, 1e9])
def test_stiff_limit_follows_the_slow_solution(blade, polar, rate):
    """However fast the rotor answers, w = 5 + cos t is followed by steps of a second."""
    plant, control = relaxing(blade, polar, rate)
    run = simulate(plant, ConstantInflow(speed=1.5), control, 6.0, TIME[::5], 1.0)
    np.testing.assert_allclose(run.rotor_speed, 5.0 + np.cos(run.time), rtol=1e-7)


def test_a_tabulated_torque_is_that_of_bem(plant):
    quick = plant.tabulated(TABULATED)
    speed = np.linspace(2.0, 14.0, 101)
    flow = 1.5 + 0.2 * np.sin(speed)
    exact = plant.torque(speed, flow)
    error = np.abs(quick.torque(speed, flow) - exact) / np.max(exact)
    assert np.max(error) < 1e-4  # where a station stalls, the curve has a kink
    assert np.median(error) < 1e-7


def test_a_motion_is_found_from_one_that_is_near(plant):
    """It is the same as without that, for less than half of the evaluations of BEM."""
    flow, control, count = SineInflow(), FeedbackTorque(QuadraticFeedback(), [60.0]), []

    def coefficients(blade, polar, ratio, *others):
        count[-1] += ratio.size
        return plant.coefficients(blade, polar, ratio, *others)

    near = simulate(plant.tabulated(TABULATED), flow, control, 6.0, TIME)
    exact, runs = replace(plant, coefficients=coefficients), []
    for guess in (None, near.path):
        count.append(0)
        runs.append(simulate(exact, flow, control, 6.0, TIME, guess=guess))
    alone, after = (each.rotor_speed for each in runs)
    np.testing.assert_allclose(after, alone, rtol=1e-9)
    assert runs[1].energy == pytest.approx(runs[0].energy, rel=1e-9)
    assert count[1] - TIME.size < 0.5 * (count[0] - TIME.size)


@pytest.mark.parametrize("refused", [1, np.inf])
def test_stopping_time_is_solved_for_or_not_reported(plant, monkeypatch, refused):
    """Where the steps up to the standstill are refused, shorter windows are tried."""

    def brake():
        return simulate(plant, ConstantInflow(speed=1.5), lambda t, w: 5000.0, 6.0, TIME)

    stopped, solve, refusals = brake().stopped_at, _Motion._solve, []

    def stubborn(motion, edges, *state):
        if edges[-1] == pytest.approx(stopped, rel=1e-6) and len(refusals) < refused:
            return refusals.append(edges)
        return solve(motion, edges, *state)

    monkeypatch.setattr(_Motion, "_solve", stubborn)
    if refused == 1:
        assert brake().stopped_at == pytest.approx(stopped, rel=1e-9)
    else:
        with pytest.raises(InputError, match="integration fails at t ="):
            brake()
    assert refusals


def test_work_of_a_constant_brake_is_torque_times_angle(plant):
    """Up to the moment at which the rotor stands still, neither before nor after it."""
    run = simulate(plant, ConstantInflow(speed=1.5), lambda t, w: 5000.0, 6.0, TIME)
    ratio = run.rotor_speed[-1] * plant.blade.rotor_radius / 1.5
    assert ratio == pytest.approx(SLOWEST_RATIO, rel=1e-9)
    angle = np.trapezoid(run.rotor_speed, run.time)
    assert run.generator_energy == pytest.approx(5000.0 * angle, rel=1e-6)
    assert run.energy - run.generator_energy == pytest.approx(run.kinetic_energy_change, rel=1e-10)


def test_failed_integration_is_no_rotor_that_stops(plant):
    """A torque that jumps with the speed has no solution that any step could follow."""
    with pytest.raises(InputError, match="integration fails at t ="):
        simulate(plant, SineInflow(), lambda t, w: np.where(w < 7.6, 300.0, 600.0), 7.5, TIME)


def test_a_failed_integration_says_that_the_rotor_has_run_away(plant):
    """Without a torque it comes to 12 rad/s, where a brake has no solution."""
    away = r"runs away, to 12 rad/s at t = (\S+) s; .* integration fails at t = (\S+) s"
    with pytest.raises(InputError, match=away) as error:
        simulate(plant, SineInflow(), lambda t, w: np.where(w < 12.0, 0.0, 5000.0), 6.0, TIME)
    when, fails = map(float, re.search(away, str(error.value)).groups())
    assert 0.0 < when <= fails < 9.0


class _Ripple(Inflow):
    """A flow of one's own that tells nothing of itself: a bump of a fiftieth of a second."""

    profile: str = "ripple"

    def speed_at(self, time):
        return 1.5 + 0.3 * np.exp(-(((np.asarray(time) - 20.37) / 0.02) ** 2))


@pytest.mark.parametrize("flow", [GustInflow(time=20.3, width=0.05), _Ripple()])
def test_gust_much_shorter_than_a_step_is_seen(plant, flow):
    controller = FeedbackTorque(QuadraticFeedback(), np.array([11.0]))

    def energy(step, flow=flow):
        return simulate(plant, flow, controller, 7.5, np.array([0.0, 30.0]), step).energy

    assert energy(1.0) / energy(0.005) - 1.0 == pytest.approx(0.0, abs=1e-10)
    assert energy(1.0) > 1.0001 * energy(1.0, ConstantInflow(speed=1.5))


def test_a_recorded_torque_and_its_rate_are_those_of_parabolas_and_of_what_holds_the_speed():
    """Three nodes a segment reproduce a parabola."""
    time = np.array([0.0, 1.0, 2.0, 2.0, 3.0, 4.0])
    dense = np.linspace(0.05, 3.95, 40)
    free = RecordedTorque(time, time**2)
    np.testing.assert_allclose(free(dense), dense**2, atol=1e-13)
    np.testing.assert_allclose(free.rate(dense, 9.0, 5.0), 2.0 * dense, atol=1e-12)
    held = RecordedTorque(time, time**2, speed=9.0 + 0.5 * time, stiffness=20.0)
    rate = held.rate(dense, 9.0, 0.6)
    np.testing.assert_allclose(rate, 2.0 * dense + 20.0 * (0.6 - 0.5), atol=1e-11)


@pytest.mark.parametrize("limit", [None, 700.0])
def test_rate_of_a_feedback_torque_is_by_the_chain_rule(limit):
    law = FeedbackTorque(QuadraticFeedback(torque_limit=limit), np.array([7.0]))
    time, step = np.linspace(0.0, 3.0, 31), 1e-6
    speed, acceleration = 9.0 + np.sin(time), np.cos(time)
    before, after = (law(time, 9.0 + np.sin(time + move)) for move in (-step, step))
    rate = law.rate(time, speed, acceleration)
    np.testing.assert_allclose(rate, (after - before) / (2.0 * step), rtol=1e-6, atol=1e-4)
    if limit is None:
        np.testing.assert_allclose(rate, 14.0 * speed * acceleration, rtol=1e-13)


def test_recorded_torque_stays_in_the_generators_range():
    time = np.array([0.0, 1.0, 2.0])
    recorded = RecordedTorque(time, np.array([500.0, 700.0, 700.0]), limit=700.0)
    dense = np.linspace(0.0, 2.0, 101)
    assert np.max(recorded.unlimited(dense)) > 700.0
    assert np.max(recorded(dense)) == 700.0


SINE = SineInflow()
TURBULENCE = TurbulentInflow(spectrum="kaimal", length_scale=20.0, duration=180.0, cutoff=1.0)


def recorded(limit):
    """Return a torque history near the optimum's, cut at a limit within many segments."""
    time = np.concatenate([np.array([0.0, 0.5, 1.0]) + second for second in range(20)])
    torque = 640.0 + 180.0 * np.sin(0.25 * time) - 20.0 * (time % 1.0)
    return RecordedTorque(time, torque, limit)


def quadratic(time, speed):
    return QuadraticFeedback(torque_limit=700.0).torque(speed, np.array([11.0]))


@pytest.mark.parametrize(
    ("inertia", "flow", "control"),
    [
        (4.0, SINE, quadratic),
        (4.0, SINE, lambda t, w: LinearFeedback(torque_limit=700.0).torque(w, np.array([68.0]))),
        (0.1, SINE, quadratic),
        (4000.0, SINE, quadratic),
        (4.0, SINE, recorded(620.0)),
        (4.0, StepInflow(before=1.3, after=1.7, time=10.0, width=0.1), quadratic),
        (4.0, GustInflow(shape="mexican_hat", time=10.0, width=2.0), quadratic),
        (4.0, TURBULENCE, quadratic),
    ],
    ids=["quadratic", "linear", "light", "heavy", "recorded", "step", "gust", "turbulence"],
)
def test_energies_and_speeds_are_those_of_scipy(plant, inertia, flow, control):
    plant = replace(plant, inertia=inertia)
    run = simulate(plant, flow, control, 7.5, TIME[::5], 1.0)

    def rates(time, state):
        driving = plant.torque(state[:1], np.array([flow.speed_at(time)]))[0]
        brake = float(control(time, state[0]))
        return [(driving - brake) / inertia, driving * state[0] / 1e4, brake * state[0] / 1e4]

    solution = solve_ivp(
        rates, (0.0, 20.0), [7.5, 0.0, 0.0], "LSODA", run.time, rtol=1e-12, atol=1e-13, max_step=0.2
    )
    assert run.energy == pytest.approx(1e4 * solution.y[1, -1], rel=1e-8)
    assert run.generator_energy == pytest.approx(1e4 * solution.y[2, -1], rel=1e-8)
    np.testing.assert_allclose(run.rotor_speed, solution.y[0], rtol=1e-7)


@pytest.mark.parametrize("law", [QuadraticFeedback(), None], ids=["feedback", "recorded"])
def test_a_run_may_begin_at_any_time_of_the_flow(plant, law):
    """From t = 7 s on, it is the run from 0 in a sine whose phase is 7 s later."""
    begin, duration = 7.0, 10.0
    later = SineInflow(phase=SineInflow().angular_frequency * begin)
    time = np.repeat(np.linspace(0.0, duration, 21), 2)[1:-1]
    recorded = 600.0 + 20.0 * np.sin(time)

    def controller(shift):
        if law is not None:
            return FeedbackTorque(law, np.array([10.0]))
        return RecordedTorque(time + shift, recorded)

    samples = np.linspace(0.0, duration, 31)
    options = {"max_step": 0.5}
    there = simulate(plant, later, controller(0.0), 8.0, samples, **options)
    at = begin + samples
    here = simulate(plant, SineInflow(), controller(begin), 8.0, at, **options)
    np.testing.assert_allclose(here.time, at, rtol=1e-14)
    for name in ("rotor_speed", "inflow_speed", "control_torque", "hydrodynamic_torque"):
        np.testing.assert_allclose(getattr(here, name), getattr(there, name), rtol=1e-8)
    assert here.energy == pytest.approx(there.energy, rel=1e-9)
    assert here.stopped_at is None
