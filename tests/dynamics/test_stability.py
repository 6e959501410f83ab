"""The linearized loop of rotor, wake and controller."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.dynamics.flows import ConstantInflow
from hkt_mdo.dynamics.laws import QuadraticFeedback
from hkt_mdo.dynamics.simulation import FeedbackTorque, simulate
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.dynamics.tracking import Tracking
from tests.dynamics.aerodyn_runs import RUNS, design_of
from tests.dynamics.test_wake import plant_of, rates_of_all

FLOW = np.array([1.5])
SPEED = 8.06 * FLOW / 1.4


class Held:
    """The torque of equilibrium, and a slope over the speed on top."""

    def __init__(self, stiffness, torque=0.0):
        self.stiffness, self.torque = stiffness, torque

    def __call__(self, _time, speed):
        return self.torque + self.stiffness * (speed - SPEED[0])


@pytest.fixture(scope="module")
def plant():
    """Return the rotor of `sine_limited_quadratic` with a wake of 1 s."""
    return plant_of(RUNS[0], design_of("paper").inertia).with_memory(1.0)


@pytest.mark.parametrize(
    ("tau1", "power", "least"), [(1.0, False, 8.6), (1.0, True, 59.0), (1.8, True, 106.0)]
)
def test_least_inertia_is_that_of_another_program(plant, tau1, power, least):
    """Numbers of an earlier linearization with filters at all stations, written elsewhere."""
    plant = plant.with_memory(tau1)
    torque = plant.torque(SPEED, FLOW)[0]
    loop = Loop.of(plant, Held(-torque / SPEED[0] if power else 0.0), SPEED, FLOW)
    assert loop.least_inertia[0] == pytest.approx(least, rel=0.01)
    assert loop.growth[0] > 0.0
    for factor, stable in ((0.98, False), (1.02, True), (100.0, True)):
        assert (replace(loop, inertia=factor * loop.least_inertia[0]).growth[0] < 0.0) == stable


def law_and_rest(plant, name):
    """Return a law that balances the rotor at the point above, and its states there."""
    torque = plant.torque(SPEED, FLOW)[0]
    if name == "quadratic":
        return FeedbackTorque(QuadraticFeedback(), np.array([torque / SPEED[0] ** 2])), ()
    law = Tracking(knots=3, flow_range=(1.0, 2.0))
    gains = np.array([*(SPEED[0] * np.linspace(1.0, 2.0, 3) / 1.5), 40.0, 200.0])
    return FeedbackTorque(law, gains), (np.array([torque]), FLOW.copy())


@pytest.mark.parametrize("name", ["quadratic", "tracking"])
def test_growth_is_that_of_the_whole_system(plant, name):
    """All filters of all stations, two velocities each, by differences of the motion's rates."""
    controller, rest = law_and_rest(plant, name)
    system = plant, ConstantInflow(speed=FLOW[0]), controller, len(rest)
    at = np.concatenate((SPEED, *rest, plant.wake.at_rest(SPEED, FLOW)[0]))
    steps = 1e-5 * np.maximum(np.abs(at), 0.1)
    whole = [
        (rates_of_all(0.0, at + x, *system) - rates_of_all(0.0, at - x, *system)) / (2.0 * step)
        for x, step in zip(np.diag(steps), steps, strict=True)
    ]
    values = np.linalg.eigvals(np.array(whole).T)
    loop = Loop.of(plant, controller, SPEED, FLOW, *rest)
    loop_values = np.linalg.eigvals(loop.matrix[0])
    off = np.min(np.abs(loop_values[:, None] - values), axis=1) / np.abs(loop_values)
    assert np.max(off) < 1e-3  # the loop has those of the whole system but for pure filters
    slowest = -1.0 / plant.wake.tau1
    assert max(loop.growth[0], slowest) == pytest.approx(np.max(values.real), abs=1e-3)


@pytest.mark.parametrize("factor", [0.8, 1.3])
def test_a_simulation_is_stable_where_the_loop_is(plant, factor):
    """At constant torque, from a speed that is a tenth of a per cent too high."""
    torque = plant.torque(SPEED, FLOW)[0]
    loop = Loop.of(plant, Held(0.0), SPEED, FLOW)
    heavy = replace(plant, inertia=factor * loop.least_inertia[0])
    motion = Held(0.0, torque), 1.001 * SPEED[0], np.linspace(0.0, 8.0, 601)
    run = simulate(heavy, ConstantInflow(speed=1.5), *motion)
    off, end = np.abs(run.rotor_speed / SPEED[0] - 1.0), run.time[-1]
    first, last = (np.max(off[x]) for x in (run.time < 0.3 * end, run.time > 0.7 * end))
    assert (last < first) == (factor > 1.0)


def test_no_inertia_helps_a_stalled_rotor(plant):
    """Below the speed of its largest torque, the torque of equilibrium rises with the speed."""
    speed = 4.0 * FLOW / 1.4
    assert np.isinf(Loop.of(plant, Held(0.0), speed, FLOW).least_inertia[0])
    assert Loop.of(plant, Held(500.0), speed, FLOW).least_inertia[0] == 0.0
