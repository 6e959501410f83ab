"""The end of a run, measured by its start; if it failed, the best that it has, and why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hkt_mdo.problem.build import assemble
from hkt_mdo.problem.evaluation import excesses
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import START_EXCESS, StartingPoint
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.quantities import RATES
from hkt_mdo.results.summary import CheckEntry
from hkt_mdo.run.checks import BELOW_START, Checked, recovery
from hkt_mdo.run.optimization import collect
from hkt_mdo.run.state import RunState
from hkt_mdo.run.verification import Optimized, Verification, simulated_objective, verify
from hkt_mdo.start.find import bounding_optimum

NOT_RUNNING = (
    "no blade and gain were found on which the rotor runs unstalled throughout this flow, "
    "from {starts}: the problem may have no solution (try a larger control.torque_limit, or "
    "another control.law{wider})"
)
PARTS = "at_nodes", "between_nodes", "in_equilibrium", "bounds"  # of the checks of a limit
NONE_FOUND = (
    "no design that keeps the limits was found from {starts}: the smallest violation was "
    "{share:.3g} % of {key}, {where}; this does not prove that there is none (try {law}a looser "
    "{key}{wider})"
)


def checked(
    state: RunState,
    start: StartingPoint,
    result: Optimized,
    verifications: tuple[Verification, ...],
) -> Checked:
    """Return a result, of a run that began at a start, with its integrations."""
    if result.objective < (1.0 - BELOW_START) * start.reference:
        moving = _moving_reference(state, start, result)
        start = replace(start, reference=min(start.reference, moving))
    optimum = bounding_optimum(result.physics, state.optimum, result.point.blade)
    return Checked(start, result, verifications, optimum)


def measured(physics: Physics, start: StartingPoint) -> StartingPoint:
    """Return a start with its objective as the measure of the optimum, where it is one.

    A start that breaks a limit may be better than the best design that keeps it.

    Parameters
    ----------
    physics
        On the mesh of the start.
    start
        Found by quasi-steady co-design.
    """
    # a start may maximize another quantity; it operates in the case's own water and condition
    alike = physics.start_objective is physics.objective and len(physics.rotors) == 1
    keeps = start.operation.running and start.excess <= START_EXCESS
    if not alike or not keeps or np.isnan(start.objective):
        return start
    return replace(start, reference=start.objective - physics.price_of(start.blade))


def _moving_reference(state, start, result) -> float:
    """Return the objective of a start with the rotor's inertia, J; 0 if it breaks a limit.

    A quasi-steady start follows every gust at once, which a rotor with inertia cannot; nor may that
    come nearer to stall than a law may.
    """
    physics = state.first
    verifications = verify(as_it_stands(state, physics, start, result))
    near = recovery(physics, verifications) if physics.law.is_feedback else ()
    if any(value > most for _, value, most, _ in near):
        return 0.0
    for verification in verifications:
        limits = verification.scenario.limits
        # a law with states has other states over time than in equilibrium
        over = [
            np.max(x.excess(at))
            for x in limits
            for at in (verification.at_nodes, verification.simulated)
        ]
        if verification.simulation.stopped_at is not None or max(over) > START_EXCESS:
            return 0.0
    return simulated_objective(verifications)


def as_it_stands(
    state: RunState, physics: Physics, point: StartingPoint, ended: Optimized
) -> Optimized:
    """Return a point as the result of an optimization without success.

    Parameters
    ----------
    state
        State of the run.
    physics, point
        A start or an iterate, and the physics on its mesh.
    ended
        The optimization whose outcome it takes.
    """
    message = "its result was refused" if ended.outcome.success else ended.outcome.message
    outcome = replace(ended.outcome, success=False, message=message)
    setup = Setup(point, curve_nodes(physics, point))
    problem = assemble(physics, setup, work_dir=state.scratch)
    problem.run_model()
    problem.cleanup()
    return collect(physics, setup, problem, outcome)


def best_of(state: RunState, end: Checked) -> tuple[Checked, str]:
    """Return the best of a failed run's end, its best iterate and its start, each checked.

    Parameters
    ----------
    state
        What the run knows.
    end
        What its last optimization ended with.

    Returns
    -------
    tuple of Checked and str
        The best one, on its own mesh, and its description; empty for the end.
    """
    best, held = end, ""
    iterate = (*state.best, "the best iterate") if state.best else None
    for other in (iterate, (state.first, end.start, "the start")):
        if other is None or not other[1].operation.running:
            continue
        physics, point, words = other
        stands = as_it_stands(state, physics, point, end.result)
        known = checked(state, end.start, stands, verify(stands))
        if known.rank > best.rank:
            best, held = known, words
    return best, held


def none_found(physics: Physics, start: StartingPoint, checks: list[CheckEntry]) -> str:
    """Return why a run that failed may have no solution; empty where that is not known.

    That the rotor does not turn, or that no design keeps the limits: if neither start nor end keep
    them. `physics` is on the mesh of the start; `checks` are those of the end.
    """
    tried = max(len(start.starts), 1)
    starts, shape, design = f"{tried} start{'s' * (tried != 1)}", physics.shape, physics.case.design
    bounded = shape.bounds or shape.radius_bounds or physics.designs_hub or design.gain_bounds
    wider = ", or wider design bounds" if bounded else ""
    if not start.operation.running:
        return NOT_RUNNING.format(starts=starts, wider=wider)
    rates = {limit.name for limit in physics.all_limits if limit.is_of(RATES)}
    found = excesses(physics, start)
    over = {name: share for name, (share, _) in found.items()}
    if not np.isnan(start.objective):  # optimized at some speeds; between these it exceeds more
        over = {x: y if x in rates else min(y, start.excess) for x, y in over.items()}
    begun = max((share, name) for name, share in over.items())
    refused = [(each.value, each.name.partition(" (")[0]) for each in checks if not each.passed]
    broken = [(x, n) for x, check in refused for n in over if check.removeprefix(f"{n}_") in PARTS]
    ended = max(broken, default=(0.0, ""))
    if begun[0] <= START_EXCESS or ended[0] <= 0.0:
        return ""
    flow = found[begun[1]][1]
    in_flow = "any flow" if flow is None else f"a flow of {flow:.4g} m/s"
    at_start = f"by the best of them, in {in_flow}"
    share, name, where = min((*begun, at_start), (*ended, "at the end of the optimization"))
    key = next(limit.key for limit in physics.all_limits if limit.name == name)
    law = "control.law: curve, which can keep more limits, or " * (len(physics.law.gain_units) == 1)
    about = {"share": 100.0 * share, "key": key, "where": where, "law": law, "wider": wider}
    return NONE_FOUND.format(starts=starts, **about)
