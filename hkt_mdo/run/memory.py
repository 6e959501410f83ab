"""Whether the loop of a result is stable in water whose wake has memory, linearized along it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hkt_mdo.dynamics.simulation import RecordedTorque
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.results.summary import MemoryEntry
from hkt_mdo.run.flight import Flown

INSTANTS = 50
"""Instants of an integration at which the loop is linearized."""
LEAST_RATIO = 2.0
"""Tip speed ratio below which the filters do not hold (docs/theory.md)."""


def stability(flights: Sequence[Flown], tau1: float | None = None) -> MemoryEntry | None:
    """Return how stable the loops of some integrations are with Oye's filters of the wake.

    Parameters
    ----------
    flights
        Integrations of one design, with or without memory. It is looked at where their rotor turns
        at a tip speed ratio of `LEAST_RATIO` or more.
    tau1
        Time constant of the slow filters, s; None: by the induction.

    Returns
    -------
    MemoryEntry or None
        Of the instant at which the loop is least stable; None where the rotor does not turn.
    """
    parts, share = [], max(INSTANTS // len(flights), 5)
    for flight in flights:
        run, plant = flight.simulation, flight.plant.with_memory(tau1)
        ratio = run.rotor_speed * plant.blade.rotor_radius / run.inflow_speed
        turning = np.flatnonzero(ratio >= LEAST_RATIO)
        if turning.size:
            flow = run.inflow_speed[turning]
            at = np.linspace(0, turning.size - 1, share).round().astype(int)
            at = turning[np.unique([*at, np.argmax(flow), np.argmin(flow)])]
            known = run.rotor_speed[at], run.inflow_speed[at], *(each[at] for each in run.states)
            parts.append((Loop.of(plant, flight.controller, *known), run.time[at], known[1]))
    if not parts:
        return None
    growth, frozen, least, slow, answer = (
        np.concatenate(
            [getattr(loop, name).reshape(time.size, -1)[:, 0] for loop, time, _ in parts]
        )
        for name in ("growth", "frozen_growth", "least_inertia", "slow", "frozen")
    )
    time, flow = (np.concatenate([each[place] for each in parts]) for place in (1, 2))
    unstable, inertia = growth >= 0.0, float(np.max(least))
    replayed = isinstance(flights[0].controller, RecordedTorque)
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
