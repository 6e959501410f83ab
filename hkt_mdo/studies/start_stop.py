"""A finished feedback design from standstill into operation, and out of it again."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO, Simulation, simulate
from hkt_mdo.errors import InputError
from hkt_mdo.results.design import Design, in_flow
from hkt_mdo.results.words import measured

SAMPLES = 4001
FIRST = 2.0 * SLOWEST_RATIO  # tip speed ratio of the rotor at the begin of the run-up


@dataclass(frozen=True, eq=False)
class StartStop:
    """A start-up from standstill, the operation after it and the shut-down.

    `run_up`: without torque, from t = 0 until `started_at` (s), when the rotor reaches the tip
    speed ratio at which its design begins; `started_at` is None if it never does. `operation`:
    under the law, from then on. `shut_down`: with the torque at its limit, after the operation.
    Parts that do not take place are None. `diameter` (m) is that of the disc: a run-up in which the
    water moves less has no wake, and its computed time means nothing.
    """

    run_up: Simulation
    started_at: float | None
    operation: Simulation | None
    shut_down: Simulation | None
    diameter: float

    def lines(self) -> Iterator[str]:
        """Describe each part in a line.

        Yields
        ------
        str
            Such as ``run-up: without torque to 4.2 rad/s in 8.10 s``.
        """
        up, down, speed = self.run_up, self.shut_down, self.run_up.rotor_speed
        if self.started_at is None:
            what = "the rotor does not start by itself: without torque it comes to"
            yield f"{what} {measured(speed[-1], 'rad/s', 4)} in {up.time[-1]:.1f} s"
            return
        reached = measured(up.speed_at(self.started_at), "rad/s", 4)
        yield f"run-up: without torque to {reached} {self._lasting(up, self.started_at)}"
        if self.operation is None:
            yield "operation: none, the shut-down begins before the run-up ends"
            return
        run, end = self.operation, float(self.operation.time[-1])
        if run.stopped_at is not None:
            yield f"operation: rotor stops at t = {run.stopped_at:.2f} s, not generating"
            return
        extremes = measured(run.rotor_speed, "rad/s", 4)
        energy = measured(run.energy, "J", 6)
        yield f"operation: until t = {end:.2f} s at {extremes}, {energy} captured"
        if down is None:
            return
        limit = f"{down.control_torque[0]:.4g} N m"
        if down.stopped_at is not None:
            yield f"shut-down: {limit} stop the rotor {self._lasting(down, down.stopped_at - end)}"
        else:
            word = "do not stop the rotor, which needs a brake: it comes to"
            yield f"shut-down: {limit} {word} {measured(down.rotor_speed[-1], 'rad/s', 4)}"

    def _lasting(self, run, seconds):
        """Return how long a part lasts (s), as text: only if its wake has the time to change."""
        moved = seconds * float(run.inflow_speed[0])
        if moved >= self.diameter:
            return f"in {seconds:.2f} s"
        return f"while the water moves {moved:.2g} m, too little for a wake: the time is not known"


def start_and_stop(design: Design, inflow: Inflow, stop: float | None = None) -> StartStop:
    """Start a design from standstill in a flow and, at the time `stop` (s), shut it down.

    The run ends with the time span of the design's case.

    Parameters
    ----------
    design : Design
        A finished design with a feedback law.
    inflow : Inflow
        The flow.
    stop : float or None
        Time from which the torque is at its limit, s; None: there is no shut-down.

    Returns
    -------
    StartStop
        The parts of the run.

    Raises
    ------
    InputError
        For an open loop, whose start-up cannot be simulated, for a stop beyond the run,
        and for one without a torque limit.
    """
    plant, phase = design.plant, in_flow(design.physics.case, inflow).phase
    duration = phase.duration
    _check(design, duration, stop)
    design.refuse_standstill(inflow)
    radius = plant.blade.rotor_radius

    def integrated(controller, values, *ends):
        time, step = np.linspace(*ends, SAMPLES), duration / phase.segments
        return simulate(plant, inflow, controller, values, time, step)

    def missing(time):
        return run_up.speed_at(time) - design.initial_speed(inflow, time)

    first = FIRST * float(inflow.speed_at(0.0)) / radius
    run_up = integrated(lambda _, speed: 0.0 * speed, first, 0.0, duration)
    fast = np.flatnonzero(missing(run_up.time) >= 0.0)
    if not fast.size:
        return StartStop(run_up, None, None, None, 2.0 * radius)
    start = brentq(missing, *run_up.time[fast[0] - 1 : fast[0] + 1]) if fast[0] else 0.0
    end = duration if stop is None else stop
    if start >= end:
        return StartStop(run_up, start, None, None, 2.0 * radius)
    speed = float(run_up.speed_at(start))
    operation = integrated(design.controller, design.start(inflow, speed, start), start, end)
    shut_down = None
    if stop is not None and operation.stopped_at is None:
        most = design.law.torque_limit
        last = operation.rotor_speed[-1]
        shut_down = integrated(lambda _, speed: most + 0.0 * speed, last, stop, duration)
    return StartStop(run_up, start, operation, shut_down, 2.0 * radius)


def _check(design, duration, stop):
    """Refuse what cannot be started or shut down."""
    if not design.law.is_feedback:
        problem, remedy = "open loop cannot start up", "use a result with a feedback law"
        raise InputError(problem, remedy, key="--start-up", file=design.solution.folder)
    if stop is None:
        return
    if not 0.0 < stop < duration:
        remedy = f"give a time before the end of the run, {duration:g} s"
        raise InputError("is out of range", remedy, key="--shut-down", value=stop)
    if design.law.torque_limit is None:
        problem = "there is no limit of the torque that could stop the rotor"
        raise InputError(problem, "use a result with control.torque_limit", key="--shut-down")
