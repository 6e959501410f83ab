"""Whether the loop of a result is stable if the wake has memory, linearized along it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hkt_mdo.dynamics.simulation import RecordedTorque
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.problem.physics import Physics
from hkt_mdo.results.summary import MemoryEntry
from hkt_mdo.run.flight import Flown, HeldSpeeds, Optimized, controller_of, plant_of

INSTANTS = 50
"""Instants of all integrations at which the loop is linearized."""
LEAST_RATIO = 2.0
"""Tip speed ratio below which the filters do not hold (docs/theory.md)."""


def stability(flights: Sequence[Flown], tau1: float | None = None) -> MemoryEntry | None:
    """Return how stable the loops of some integrations are with Oye's filters of the wake.

    Parameters
    ----------
    flights
        Integrations of one design without memory. Only instants with a tip speed ratio of at least
        `LEAST_RATIO` count.
    tau1
        Time constant of the slow filters, s; None: by the induction.

    Returns
    -------
    MemoryEntry or None
        Of the instant at which the loop is least stable; None where the rotor does not turn.
    """
    along = []
    for flight in flights:
        run = flight.simulation
        if isinstance(flight.controller, HeldSpeeds):  # of an open loop in steady flows
            continue
        series = run.time, run.rotor_speed, run.inflow_speed, *run.states
        along.append((flight.plant.with_memory(tau1), flight.controller, series))
    return _verdict(along)


def stability_of(physics: Physics, result: Optimized) -> MemoryEntry | None:
    """Return the same along the trajectories of an optimization whose case asks for memory."""
    plant, along = plant_of(physics, result.point.blade, result.inertia), []
    for nodes in result.trajectories:
        names = "time", "rotor_speed", "inflow_speed", *physics.states
        controller = controller_of(physics, result, plant, nodes)
        along.append((plant, controller, [nodes[name] for name in names]))
    return _verdict(along)


def _verdict(along):
    """Return the verdict along some series of time, rotor speed, flow and the law's states."""
    parts, share = [], max(INSTANTS // max(len(along), 1), 5)
    for plant, controller, (time, speed, flow, *states) in along:
        turning = np.flatnonzero(speed * plant.blade.rotor_radius >= LEAST_RATIO * flow)
        if turning.size:
            at = np.linspace(0, turning.size - 1, share).round().astype(int)
            ends = np.argmax(flow[turning]), np.argmin(flow[turning])
            at = turning[np.unique([*at, *ends])]
            known = (each[at] for each in (speed, flow, *states))
            parts.append((Loop.of(plant, controller, *known), time[at], flow[at]))
    if not parts:
        return None
    growth, frozen, least, slow, answer = (
        np.concatenate([getattr(loop, name).reshape(at.size, -1)[:, 0] for loop, at, _ in parts])
        for name in ("growth", "frozen_growth", "least_inertia", "slow", "frozen")
    )
    time, flow = (np.concatenate([each[place] for each in parts]) for place in (1, 2))
    unstable, inertia = growth >= 0.0, float(np.max(least))
    replayed = isinstance(along[0][1], RecordedTorque)
    first = int(np.argmax(unstable if np.any(unstable) else growth))
    return MemoryEntry(
        stable=not np.any(unstable),
        growth=float(np.max(growth)),
        frozen_growth=float(np.max(frozen)),
        stiffness=max(float(np.max(answer)), 0.0) if replayed else None,
        tau1_s=float(slow[np.argmax(growth)]),
        time_s=float(time[first]),
        inflow_speed=float(flow[first]),
        share_of_instants=float(np.mean(unstable)),
        inertia_kg_m2=parts[0][0].inertia,
        least_inertia_kg_m2=inertia if np.isfinite(inertia) else None,
    )
