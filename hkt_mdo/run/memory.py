"""Whether the loop of a result is stable if the wake has memory, linearized along it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hkt_mdo.dynamics.simulation import IntegrationError, RecordedTorque, simulate
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.errors import InputError
from hkt_mdo.problem.evaluation import on_start
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.results.summary import MemoryEntry
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.run.verification import HeldSpeeds, Optimized, Verification, controller_of, plant_of

HOPELESS = 0.5
"""Share of the least stable inertia below which a case with memory is not optimized."""
SAFE = 2.0
"""The same of the inertia that is recommended: an optimum is nearer to instability than a start."""
MARGIN = 1.05
"""The same of the inertia to which that of a designed hub is raised."""
FAR = 0.1
"""Relative change of the rotor's speed by its inertia and its wake from which a start has it."""
INSTANTS = 50
"""Instants of all integrations at which the loop is linearized."""
LEAST_RATIO = 2.0
"""Tip speed ratio below which the filters do not hold (docs/dynamic_inflow.md)."""


def stability(verifications: Sequence[Verification]) -> MemoryEntry | None:
    """Return how stable the loops of some integrations are with Oye's filters of the wake.

    Parameters
    ----------
    verifications
        Integrations of one design without memory. Only instants with a tip speed ratio of at least
        `LEAST_RATIO` count.

    Returns
    -------
    MemoryEntry or None
        Of the instant at which the loop is least stable; None where the rotor does not turn.
    """
    along = [
        (run.scenario, run.plant.with_memory(), run.controller, run.integrated)
        for run in verifications
        if not isinstance(run.controller, HeldSpeeds)  # of an open loop in steady flows
    ]
    return _verdict(verifications[0].physics, along)


def stability_of(result: Optimized) -> MemoryEntry | None:
    """Return the same along the trajectories of an optimization whose case asks for memory."""
    return _verdict(result.physics, _along(result.physics, result.point, result.trajectories))


def with_memory(physics: Physics, start: StartingPoint) -> StartingPoint:
    """Return a quasi-steady start with the operation in which its rotor and wake follow the flow.

    Under feedback in a case with memory it is integrated, with the rotor's inertia, where the loop
    is stable; a designed hub is made heavy enough for that. The start is unchanged without memory,
    in open loop, where the rotor stops, and where its speed is that of the quasi-steady start but
    for `FAR`: that start then needs fewer iterations.

    Raises
    ------
    InputError
        If the rotor has less than `HOPELESS` of the inertia from which the loop would be stable,
        linearized along the quasi-steady operation. Nearer to that, another blade may help.
    """
    if not (physics.remembers and physics.law.is_feedback and start.operation.running):
        return start
    along = _along(physics, start, on_start(physics, start))
    verdict = _verdict(physics, along)
    if verdict is None or verdict.stable:
        return _followed(physics, start, along)
    heavier = stable_hub(physics, start.blade, verdict, SAFE)
    if heavier is not None:
        return with_memory(physics, replace(start, blade=replace(start.blade, hub_inertia=heavier)))
    inertia, least = physics.rotor.mass_and_inertia(start.blade)[1], verdict.least_inertia_kg_m2
    if least is not None and inertia >= HOPELESS * least:
        return start
    remedy = "give another control.law, or inflow_dynamics: quasi_steady"
    if least is not None:
        more, key = physics.rotor.hub_of(start.blade) + SAFE * least - inertia, "rotor.hub_inertia"
        key = "an upper bound in design.hub_inertia_bounds" if physics.designs_hub else key
        remedy = f"give {key} of about {more:.3g} kg*m**2 or more, {remedy[5:]}"
    problem = f"has a start whose loop with memory is {verdict.text}"
    value = physics.case.inflow_dynamics.model
    raise InputError(problem, remedy, key="inflow_dynamics", value=value)


def stable_hub(
    physics: Physics, blade: Blade, verdict: MemoryEntry | None, margin: float = MARGIN
) -> float | None:
    """Return the designed `hub_inertia` with which a loop is stable, kg*m**2, by a margin.

    That is `margin` times the least inertia of the rotor, less that of its blades, within the
    case's bounds. None where the hub is not designed, where no inertia makes the loop stable, and
    where even `MARGIN` needs more than the upper bound.
    """
    if not physics.designs_hub or verdict is None or verdict.least_inertia_kg_m2 is None:
        return None
    least, rotor = verdict.least_inertia_kg_m2, physics.rotor
    blades = float(rotor.mass_and_inertia(replace(blade, hub_inertia=0.0)).inertia)
    hub, needed = ((x * least - blades) / rotor.inertia_factor for x in (margin, MARGIN))
    low, high = physics.case.design.hub_inertia_bounds
    return float(np.clip(hub, low, high)) if needed <= high else None


def first_hub(physics: Physics, start: StartingPoint) -> float:
    """Return the lower bound on a designed `hub_inertia` in the first optimization, kg*m**2."""
    if not (physics.designs_hub and physics.remembers and physics.law.is_feedback):
        return 0.0
    verdict = _verdict(physics, _along(physics, start, on_start(physics, start)))
    return stable_hub(physics, start.blade, verdict, SAFE) or 0.0


def _along(physics, point, trajectories):
    """Return each scenario with a point's plant, controller and trajectory.

    An open loop needs time.
    """
    along = []
    for scenario, trajectory in zip(physics.scenarios, trajectories, strict=True):
        if physics.law.is_feedback or not scenario.steady:
            plant = plant_of(physics, scenario, point.blade)
            controller = controller_of(physics, scenario, plant, point.gains, trajectory)
            along.append((scenario, plant, controller, trajectory))
    return along


def _followed(physics, start, along) -> StartingPoint:
    """Return a start with the operation of its integration, where `with_memory` takes that."""
    if any(scenario.steady for scenario in physics.scenarios):
        return start
    runs = []
    for scenario, plant, controller, trajectory in along:
        begin = [trajectory[name][0] for name in ("rotor_speed", *physics.law.states)]
        step = float(np.max(np.diff(scenario.edges)))
        try:
            runs.append(simulate(plant, scenario.inflow, controller, begin, scenario.samples, step))
        except IntegrationError:
            return start
    if any(run.stopped_at is not None for run in runs):
        return start
    names = "rotor_speed", "hydrodynamic_torque"
    followed = {name: np.concatenate([getattr(run, name) for run in runs]) for name in names}
    if np.max(np.abs(followed["rotor_speed"] / start.operation.rotor_speed - 1.0)) < FAR:
        return start
    return replace(start, operation=replace(start.operation, **followed))


def _verdict(physics, along):
    """Return the verdict along the trajectories of `_along`.

    An instant of a steady scenario counts by the time for which its flow lasts.
    """
    parts, count = [], max(INSTANTS // max(len(along), 1), 5)
    for scenario, plant, controller, trajectory in along:
        speed, flow = trajectory["rotor_speed"], trajectory["inflow_speed"]
        turning = np.flatnonzero(speed * plant.blade.rotor_radius >= LEAST_RATIO * flow)
        if turning.size:
            at = np.linspace(0, turning.size - 1, count).round().astype(int)
            ends = np.argmax(flow[turning]), np.argmin(flow[turning])
            at = turning[np.unique([*at, *ends])]
            states = (trajectory[name][at] for name in physics.law.states)
            loop = Loop.of(plant, controller, speed[at], flow[at], *states)
            slopes = loop.growth, loop.frozen_growth, loop.least_inertia, loop.slow[:, 0]
            lasts = scenario.node_weights[at] if scenario.steady else np.ones(at.size)
            share = lasts / np.sum(lasts)
            parts.append((trajectory["time"][at], flow[at], share, *slopes, loop.frozen))
    if not parts:
        return None
    time, flow, share, growth, frozen, least, slow, answer = np.concatenate(parts, axis=1)
    unstable, inertia = growth >= 0.0, float(np.max(least))
    replayed = isinstance(along[0][2], RecordedTorque)
    first = int(np.argmax(unstable if np.any(unstable) else growth))
    return MemoryEntry(
        stable=not np.any(unstable),
        growth=float(np.max(growth)),
        frozen_growth=float(np.max(frozen)),
        stiffness=max(float(np.max(answer)), 0.0) if replayed else None,
        tau1_s=float(slow[np.argmax(growth)]),
        time_s=None if all(x.steady for x in physics.scenarios) else float(time[first]),
        inflow_speed=float(flow[first]),
        share_of_instants=float(np.average(unstable, weights=share)),
        inertia_kg_m2=along[0][1].inertia,
        least_inertia_kg_m2=inertia if np.isfinite(inertia) else None,
    )
