"""Designs in other flows under a noisy sensor: known limits first, then the paper's."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.flows import ConstantInflow, SineInflow
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics
from hkt_mdo.studies.uncertainty import Sensor, _advanced, flow_given, noisy_runs
from studies.robust_study import replace_turbine
from studies.verification.study import _fly


@pytest.fixture(scope="module")
def tracking(solve):
    control = "control={law: tracking, torque_limit: 700}"
    short = "phase.duration=12", "phase.segments=12"
    return solve("sine_limited_oloc", "driver.optimizer=IPOPT", control, *short).design()


def lasting(design, seconds):
    """Return a design that is simulated over some seconds."""
    case = design.physics.case.with_overrides(f"phase.duration={seconds}")
    return replace(design, physics=replace(design.physics, case=case))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "cutoff"), [("quadratic", 100.0), ("tracking", None)])
def test_a_fast_quiet_sensor_is_no_sensor(name, cutoff, request):
    """Without noise and with a filter far above the flow's frequency, the loop is ideal."""
    design = lasting(request.getfixturevalue(name), 12)
    flow = flow_given("A", design.physics.case)
    sensor = Sensor(snr=np.inf, rate=400.0, cutoff=cutoff)
    noisy = noisy_runs(design, flow, sensor, repeats=1, seed=0)
    assert noisy.noise_deviation == 0.0
    assert noisy.energy[0] == pytest.approx(design.simulate(flow).energy, rel=1e-5)
    _, inflow_speed, speed, driving, _ = noisy.samples
    np.testing.assert_allclose(driving, design.plant.torque(speed, inflow_speed), rtol=1e-6)


@pytest.mark.slow
def test_the_studies_fly_designs_of_open_loop_and_by_a_table(quadratic, open_loop):
    for design in (quadratic, open_loop):
        assert _fly(design).energy == pytest.approx(design.solution.summary.energy_J, rel=2e-4)
    quick = replace_turbine(quadratic.solution, "as new").simulate(quadratic.physics.inflow)
    assert quick.energy == pytest.approx(quadratic.solution.summary.energy_J, rel=2e-4)


@pytest.mark.slow
def test_a_law_with_states_is_sampled_too(tracking):
    """A held torque makes the loop unstable where kp T / J > 2."""
    flow = flow_given("B", tracking.physics.case)
    sampled = noisy_runs(tracking, flow, Sensor(np.inf, rate=100.0, cutoff=None), 1, 0)
    assert tracking.gains[-2] / tracking.plant.inertia / 100.0 < 1.5
    assert sampled.energy[0] == pytest.approx(tracking.simulate(flow).energy, rel=1e-3)
    assert tracking.gains[-2] / tracking.plant.inertia / 50.0 > 2.0
    slow = noisy_runs(tracking, flow, Sensor(np.inf, rate=50.0, cutoff=None), 1, 0)
    assert np.std(np.diff(slow.samples[4])) > 100.0 * np.std(np.diff(sampled.samples[4]))


@pytest.mark.slow
def test_the_flow_is_estimated_from_speeds_and_torques_that_were_read(tracking):
    """At fast samples as well as an exact sensor tells it; noise of the speed reaches it, too."""
    law = tracking.law.model_copy(update={"flow": "estimated"})
    estimating = replace(tracking, physics=replace(tracking.physics, law=law))
    flow, sensor = flow_given("B", tracking.physics.case), Sensor(np.inf, rate=500.0, cutoff=None)
    exact = estimating.simulate(flow)
    assert exact.energy == pytest.approx(tracking.simulate(flow).energy, rel=1e-6)
    quiet = noisy_runs(estimating, flow, sensor, 1, 0).energy[0]
    assert quiet == pytest.approx(exact.energy, rel=1e-4)
    loud = replace(sensor, snr=30.0, reference="total")
    sensed, estimated = (noisy_runs(x, flow, loud, 2, 1).energy for x in (tracking, estimating))
    assert np.all(estimated < sensed)


def test_noise_of_the_flows_sensor_passes_its_lag():
    """A first-order lag at samples T apart lets sqrt(T / (2 lag + T)) of white noise through."""
    law, period, count = Tracking(flow_range=(1.0, 2.0), lag=0.2, noise=0.1), 0.01, 20_000
    random, flow = np.random.default_rng(1), np.full(count, 1.5)
    gains, states = np.array([*np.linspace(5.0, 10.0, 8), 150.0, 600.0]), [0.0 * flow, flow]
    for _ in range(200):
        reading = law.sensed(flow, random)
        states = _advanced(law, 5.0 * flow, reading, gains, states, period)
    expected = law.noise * np.sqrt(period / (2.0 * law.lag + period))
    assert np.std(states[1]) == pytest.approx(expected, rel=0.02)
    assert np.mean(states[1]) == pytest.approx(1.5, abs=1e-3)


def test_a_steady_rotor_stays_steady(quadratic):
    """The filter starts in steady state at w(0): in a constant flow it brings no transient."""
    flow = ConstantInflow(speed=float(quadratic.physics.inflow.speed_at(0.0)))
    start = quadratic.simulate(flow)
    noisy = noisy_runs(quadratic, flow, Sensor(snr=np.inf), repeats=1, seed=0)
    np.testing.assert_allclose(noisy.samples[2], start.rotor_speed[-1], rtol=2e-3)


def test_deviation_is_20_dB_below_the_signal():
    speed = 8.0 + np.sqrt(2.0) * np.sin(np.linspace(0.0, 2.0 * np.pi, 10001)[:-1])
    assert Sensor(20.0, "fluctuation").deviation(speed) == pytest.approx(0.1, rel=1e-6)
    assert Sensor(20.0, "total").deviation(speed) == pytest.approx(0.1 * np.sqrt(65.0), rel=1e-6)


def test_the_seed_decides_the_noise(quadratic):
    quadratic, inflow = lasting(quadratic, 10), SineInflow(scale=1.1)
    sensor = Sensor(rate=20.0)
    one, same, other = (noisy_runs(quadratic, inflow, sensor, 3, seed).energy for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.all(one != other)
    assert np.ptp(one) > 0.0


def test_stalled_repeats_are_counted_apart(quadratic):
    """A tenth of the whole speed as noise at 10 Hz stalls this design in every repeat."""
    run = noisy_runs(quadratic, quadratic.physics.inflow, Sensor(20.0, "total", 10.0), 4, seed=1)
    assert np.all(np.isnan(run.energy))
    assert np.all((run.stopped_at > 0.0) & (run.stopped_at <= 60.0))


def test_replayed_open_loop_stops_in_flows_b_and_c_but_not_in_a(open_loop):
    """The paper's finding: torque that fits one flow stalls the rotor in a slower one."""
    assert open_loop.simulate(flow_given("A", open_loop.physics.case)).stopped_at is None
    for name in ("B", "C"):
        assert open_loop.simulate(flow_given(name, open_loop.physics.case)).stopped_at is not None


def test_wrong_questions_are_refused(quadratic, open_loop):
    with pytest.raises(InputError, match="reads no sensor"):
        noisy_runs(open_loop, open_loop.physics.inflow, Sensor(), 1, 0)
    case = quadratic.solution.case.with_overrides("inflow={profile: constant, speed: 1.3}")
    with pytest.raises(InputError, match=r"^--flow A: changes a sine, .* is constant; give"):
        flow_given("A", case)
    with pytest.raises(InputError, match="unknown"):
        flow_given("D", case)


def test_a_law_of_constant_power_stalls_under_noise_too(quadratic):
    """What it asks for grows without bound as the rotor comes to rest; the sensor may tell zero."""
    case = load_case({"inflow": "sine", "control": {"law": "power_law", "torque_limit": 700}})
    asked = replace(quadratic, physics=physics(case), gains=np.array([5000.0, -1.0]))
    flow = asked.physics.inflow
    assert asked.simulate(flow).stopped_at is not None
    noisy = noisy_runs(asked, flow, Sensor(snr=20.0, reference="total", cutoff=None), 3, seed=1)
    assert np.all(noisy.stopped_at < 60.0)
