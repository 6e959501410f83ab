"""The wake's memory: held to AeroDyn's, to SciPy, and in steady flow to direct BEM."""

import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hkt_mdo.dynamics import simulation
from hkt_mdo.dynamics.flows import ConstantInflow, Inflow, SineInflow
from hkt_mdo.dynamics.laws import QuadraticFeedback
from hkt_mdo.dynamics.radau import MATRIX, StageSystem
from hkt_mdo.dynamics.simulation import FeedbackTorque, Plant, RecordedTorque, simulate
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.dynamics.wake import AT_ONCE, Wake
from hkt_mdo.rotor import bem
from tests.dynamics.aerodyn_runs import RUNS, aerodyn, design_of, kept

PROGRAM = shutil.which("aerodyn_driver")
HEAVY = 1e15  # kg m²: what turns so follows no torque but that of the ramps


class RampedInflow(Inflow):
    """A flow that is linear between some times."""

    profile: str = "ramped"
    times: tuple[float, ...]
    speeds: tuple[float, ...]

    def speed_at(self, time):
        return np.interp(time, self.times, self.speeds)

    @property
    def features(self):
        pairs = zip(self.times[:-1], self.times[1:], strict=True)
        return tuple((begin, end, end - begin) for begin, end in pairs)


class Driven:
    """The torque that makes a heavy rotor follow speeds that are linear between some times."""

    def __init__(self, times, speeds):
        self.ends, self._slopes = times, np.diff(speeds) / np.diff(times)

    def __call__(self, time, speed):
        piece = np.searchsorted(self.ends, time, side="right") - 1
        return -HEAVY * self._slopes[np.clip(piece, 0, self._slopes.size - 1)]


def plant_of(run, inertia=HEAVY):
    """Return the rotor of a run, with memory of the wake."""
    design = design_of(run.blade)
    polar = design.physics.rotor.polar
    properties = inertia, design.physics.density, bem.rotor_coefficients
    return Plant(design.blade, polar, *properties).with_memory(run.tau1)


def simulated(run, time):
    """Return torque (N*m) and thrust (N) of a prescribed run, summed over the span as AeroDyn does.

    Loads are linear between the stations, and nothing at hub and tip.
    """
    plant, (times, _) = plant_of(run), run.corners
    blade = plant.blade
    speeds, flows = run.speeds(times, blade.rotor_radius)
    inflow = RampedInflow(times=tuple(times), speeds=tuple(flows))
    motion = Driven(times, speeds), speeds[0], np.union1d(time, [0.0, run.duration])
    result = simulate(plant, inflow, *motion, max_step=0.5)
    speed, flow = run.speeds(time, blade.rotor_radius)
    np.testing.assert_allclose(result.speed_at(time), speed, rtol=1e-7)
    sections = plant.wake.sections(speed, flow, result.filters[np.searchsorted(motion[2], time)])
    pressure = 0.5 * plant.density * flow * flow * blade.blade_count
    r = blade.edges
    loads = sections.tangential_load, sections.normal_load
    around, along = (np.pad(each, ((0, 0), (1, 1))) for each in loads)
    inner = around[:, :-1] * (2.0 * r[:-1] + r[1:]) + around[:, 1:] * (r[:-1] + 2.0 * r[1:])
    thrust = 0.5 * (along[:, :-1] + along[:, 1:]) @ np.diff(r)
    return pressure * (inner @ np.diff(r) / 6.0), pressure * thrust


def check(run, rows):
    """Hold torque and thrust of a run to AeroDyn's: within 0.3 % of their swing."""
    time, _, _, *theirs = rows.T
    for load, other in zip(simulated(run, time), theirs, strict=True):
        assert np.max(np.abs(load - other)) < 3e-3 * np.ptp(other)


@pytest.mark.parametrize("run", RUNS, ids=lambda run: f"{run.blade}-{run.name}")
def test_ramps_have_the_torque_and_thrust_of_aerodyn(run):
    check(run, np.loadtxt(kept(run), delimiter=",", skiprows=1))


@pytest.mark.slow
def test_a_vortex_wake_answers_a_step_of_the_speed_with_the_same_signs():
    """Another model of the wake: the torque rises at once, and falls within seconds."""
    from tests.dynamics import olaf_step  # which takes its rotor from here

    rows = np.loadtxt(olaf_step.KEPT, delimiter=",", skiprows=1)
    time, constant, varying, olaf = olaf_step.table(rows).T
    for change in (constant, varying, olaf):
        assert change[0] > 0.0 > change[-1]
        assert np.all(np.diff(change) < 0.0)
    assert np.all(olaf > varying)
    assert np.interp(0.0, -olaf, time) == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.skipif(not PROGRAM, reason="aerodyn_driver is not on PATH (docs/exports.md)")
@pytest.mark.parametrize("run", RUNS, ids=lambda run: f"{run.blade}-{run.name}")
def test_aerodyn_itself_has_them(run, tmp_path):
    rows = aerodyn(run, PROGRAM, tmp_path)
    np.testing.assert_allclose(rows, np.loadtxt(kept(run), delimiter=",", skiprows=1), rtol=1e-6)
    check(run, rows)


@pytest.fixture(scope="module")
def paper():
    """Return the paper's blade with memory, and its law."""
    design = design_of("paper")
    law = QuadraticFeedback(torque_limit=700.0)
    return plant_of(RUNS[0], design.inertia), FeedbackTorque(law, design.gains)


@pytest.mark.parametrize("blade", ["paper", "rm1", "river"])
@pytest.mark.parametrize("tau1", [2.0, None])
def test_a_wake_in_equilibrium_has_the_torque_and_loads_of_direct_bem(blade, tau1):
    (run, *_) = (each for each in RUNS if each.blade == blade)
    plant = plant_of(run).with_memory(tau1)
    flow = np.linspace(0.8, 2.0, 9)
    speed = np.linspace(2.0, 12.0, 9) * flow / plant.blade.rotor_radius
    state = plant.wake.at_rest(speed, flow)
    torque = np.sum(plant.station_torques(speed, flow, state), axis=1)
    np.testing.assert_allclose(torque, plant.torque(speed, flow), rtol=1e-10)
    assert np.max(np.abs(plant.wake.rates(state, flow, plant.wake.balanced(speed, flow)))) < 1e-12
    model = design_of(blade).physics.rotor
    ratio = speed * plant.blade.rotor_radius / flow
    options = {"tip_speed_ratio": ratio, "names": ("thrust", "root_moment")}
    sections = plant.wake.sections(speed, flow, state)
    loads = model.loads(plant.blade, **options, flow=sections)
    for name, load in model.loads(plant.blade, **options).items():
        np.testing.assert_allclose(loads[name].largest, load.largest, rtol=1e-10)


def rates_of_all(time, values, plant, inflow, controller, n_states):
    """Return the rates of the speed, the law's states and the filters of all stations."""
    flow, (speed, *states) = np.atleast_1d(inflow.speed_at(time)), values[: 1 + n_states, None]
    filters = values[None, 1 + n_states :]
    torque = np.sum(plant.station_torques(speed, flow, filters))
    acceleration = (torque - controller(time, speed, *states)) / plant.inertia
    of_law = controller.rates(speed, flow, acceleration, *states)
    of_wake = plant.wake.rates(filters, flow, plant.wake.balanced(speed, flow))[0]
    return np.concatenate((acceleration, *of_law, of_wake))


@pytest.mark.parametrize(("tau1", "tracks"), [(1.0, False), (None, False), (1.0, True)])
def test_a_run_with_memory_is_that_of_an_integrator_without_elimination(paper, tau1, tracks):
    """SciPy's Radau over all states at once, in a flow that the torque limit does not bend.

    Tracking has states, which are dense values beside the rotor's speed.
    """
    plant, controller = paper
    plant, inflow = plant.with_memory(tau1), SineInflow(mean=1.3, angular_frequency=1.0)
    flow, speed, rest = np.atleast_1d(inflow.speed_at(0.0)), np.array([7.6]), []
    if tracks:
        law = Tracking(knots=3, flow_range=(1.0, 1.6))
        speeds = 8.0 * np.linspace(1.0, 1.6, 3) / plant.blade.rotor_radius
        controller = FeedbackTorque(law, np.array([*speeds, 150.0, 600.0]))
        rest = [float(x[0]) for x in law.at_rest(plant.torque(speed, flow), flow)]
    first = np.concatenate((speed, rest, plant.wake.at_rest(speed, flow)[0]))
    times, options = np.array([0.0, 2.5, 5.0]), {"rtol": 1e-8, "atol": 1e-10}
    options["args"] = plant, inflow, controller, len(rest)
    other = solve_ivp(rates_of_all, (0.0, 5.0), first, "Radau", times, **options)
    run = simulate(plant, inflow, controller, [7.6, *rest], times)
    np.testing.assert_allclose(run.rotor_speed, other.y[0], rtol=1e-6)
    states, filters = np.split(other.y[1:], [len(rest)])
    np.testing.assert_allclose(run.states.reshape(states.shape), states, rtol=1e-5)
    np.testing.assert_allclose(run.filters, filters.T, rtol=1e-5, atol=1e-7)


def test_filters_answer_a_step_as_their_closed_form():
    """x and z of a step of q by one, from rest: two exponentials, the share k at once in z."""
    (run, *_) = RUNS
    wake = plant_of(run).wake
    slow, fast = 1.0, wake.times(np.ones(1), np.ones(1))[1][0]
    time, fast = 0.7, np.tile(fast, 2)

    def rates(_, state):
        return wake.rates(state[None], np.ones(1), (np.ones((1, 18)), np.ones(1)))[0]

    state = solve_ivp(rates, (0.0, time), np.zeros(36), rtol=1e-10, atol=1e-12).y[:, -1]
    late, soon = np.exp(-time / slow), np.exp(-time / fast)
    np.testing.assert_allclose(state[:18], (1.0 - AT_ONCE) * (1.0 - late), rtol=1e-8)
    behind = (1.0 - AT_ONCE) * slow / (slow - fast) * (late - soon)
    np.testing.assert_allclose(state[18:], 1.0 - soon - behind, rtol=1e-8)


def test_time_constant_follows_the_induction_at_seven_tenths(paper):
    """1.1 R / ((1 - 1.3 a) V), with a held at 0.5 where it is larger."""
    plant, _ = paper
    wake = Wake(plant.blade, plant.polar)
    for axial, kept_induction in ((0.3, 0.3), (0.9, 0.5)):
        slow, fast = wake.times(np.array([1.5]), np.array([1.5 * axial]))
        assert slow[0, 0] == pytest.approx(1.1 * 1.4 / ((1.0 - 1.3 * kept_induction) * 1.5))
        span = plant.blade.r / plant.blade.tip_radius
        np.testing.assert_allclose(fast[0], (0.39 - 0.26 * span**2) * slow[0, 0])


@pytest.mark.parametrize("n", [1, 3])
def test_eliminated_filters_are_those_of_the_full_system(n):
    """The whole matrix of the same slopes, inverted: corrections and filtered errors are equal."""
    random, steps, m = np.random.default_rng(n), 4, 6
    dense, by_last = random.normal(size=(steps, 5, n, n)), random.normal(size=(steps, 5, n, m))
    chain, by_first = random.normal(size=(steps, 5, 2, 2, m)), random.normal(size=(steps, 5, 2, m))
    full = np.zeros((steps, 5, n + 2 * m, n + 2 * m))
    full[..., :n, :n], full[..., :n, n + m :], index = dense, by_last, np.arange(n, n + 2 * m)
    full[..., index, 0], index = by_first.reshape(steps, 5, -1), index.reshape(2, m)
    full[..., index[:, None], index] = chain
    step = random.uniform(0.1, 0.5, (steps, 1))
    whole = StageSystem(step, full)
    parts = StageSystem(step, dense, (by_last, chain, by_first))
    miss = random.normal(size=(steps, 5, n + 2 * m))
    np.testing.assert_allclose(parts.correction(miss), whole.correction(miss), atol=1e-11)
    np.testing.assert_allclose(parts.filtered(miss[:, 0]), whole.filtered(miss[:, 0]), atol=1e-12)


def test_newtons_method_is_given_up_before_it_leaves_every_real_speed():
    """The slope by which the system of a step is singular: what makes up for a miss is endless."""
    inverse = np.linalg.eigvals(np.linalg.inv(MATRIX))
    slope, step, speeds = inverse[np.isreal(inverse)].real[0], np.ones((1, 1)), []

    def rates(_time, _flow, stages):
        speeds.append(np.max(np.abs(stages)))
        return slope * stages, None

    system = StageSystem(step, np.full((1, 5, 1, 1), slope))
    motion = SimpleNamespace(dense=1, tolerance=1e-7, plant=SimpleNamespace(wake=None))
    motion._rates, motion._system = rates, lambda *_: system
    solved = simulation._Motion._stages(motion, np.ones(1), step, None, None, np.ones((1, 5, 1)))
    assert solved is None
    assert max(speeds) < simulation.LOST


def test_torque_rises_with_the_speed_while_the_wake_stays(paper):
    """What AeroDyn's wake of 1 s gave for 2 % more speed: 4.1 N m at once, -12.0 in the end."""
    plant, _ = paper
    flow = np.array([1.5])
    speed = 8.06 * flow / 1.4
    state = plant.wake.at_rest(speed, flow)
    before = np.sum(plant.station_torques(speed, flow, state))
    at_once = np.sum(plant.station_torques(1.02 * speed, flow, state)) - before
    assert at_once == pytest.approx(4.1, abs=0.05)
    assert plant.torque(1.02 * speed, flow)[0] - before == pytest.approx(-11.99, abs=0.02)
    assert plant.torque_slope(speed, flow)[0] > 0.0


def test_open_loop_is_held_by_the_slope_of_a_wake_that_stays(paper):
    """In equilibrium the rotor is stable by itself; in an unchanged wake it needs a controller."""
    plant, _ = paper
    quiet = Plant(plant.blade, plant.polar, plant.inertia, plant.density, bem.rotor_coefficients)
    time = np.linspace(0.0, 20.0, 21)
    nodes = {"time": time, "inflow_speed": np.full(21, 1.5), "rotor_speed": np.full(21, 8.636)}
    nodes["control_torque"] = quiet.torque(nodes["rotor_speed"], nodes["inflow_speed"])
    held, free = (RecordedTorque.of(each, nodes) for each in (plant, quiet))
    assert free.stiffness == 0.0
    slope = plant.torque_slope(np.array([8.636]), np.array([1.5]))[0]
    assert held.stiffness == pytest.approx(2.0 * slope)
    steady = ConstantInflow(speed=1.5)
    ends = [simulate(plant, steady, each, 8.65, time).rotor_speed[-1] for each in (held, free)]
    assert ends[0] == pytest.approx(8.636, abs=1e-3)
    assert abs(ends[1] - 8.636) > 0.5
