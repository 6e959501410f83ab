"""The passes of a run: optimize, and again as long as a remedy applies.

A remedy takes an `Attempt` and returns the start of the next optimization, or None if it does not
apply. `REMEDIES` are tried in order, and the first that applies decides.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hkt_mdo.problem.build import point_of
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.problem.setup import NARROW, Setup, curve_nodes
from hkt_mdo.results.words import joined, per_cent
from hkt_mdo.run.attempt import FALLEN, Attempt, Before, Begin, Judged, quasi_steady_reference
from hkt_mdo.run.judge import most_between
from hkt_mdo.run.memory import first_hub, stable_hub
from hkt_mdo.run.mesh import held
from hkt_mdo.run.optimization import solve
from hkt_mdo.run.state import RunState
from hkt_mdo.start.find import other_branch as start_on_other_branch

MAX_PASSES = 24
"""Optimizations from one start; runs that end well need at most ten."""
FIRST_ITERATIONS, SECOND_ITERATIONS = 300, 120
"""Iterations after which an optimization within wide move limits counts as failed; the latter on a
second branch where the first one has led to a result that passes."""
FAR = 0.05
"""Relative excess of a limit from which a start is far from any optimum."""
TIE = 2e-4
"""Share of the objective by which another branch has to be better without time to be tried."""
SETTLED = 0.05
"""Share of the rotor's inertia by which the lower bound of a designed hub may be too high."""
MOST_LOWERED = 5e-3
"""Largest relative amount by which a limit is lowered at the nodes, since that costs energy."""
MOST_EXCEEDED = 0.02
"""Relative excess beyond which lowering a limit at the nodes does not help.

With memory of the wake limits may be lowered by as much, since the filters of all stations, by
which they are judged, give other loads than the two of the optimization.
"""


def smaller_moves(attempt: Attempt) -> Begin | None:
    """Begin again with narrow move limits after an optimization that failed."""
    setup, last = attempt.setup, attempt.state.last
    if attempt.fallen > FALLEN and setup.moves != NARROW:
        why = f"the optimum is {100.0 * attempt.fallen:.2g} % below that of the pass before"
        return attempt.begin_again(why, moves=NARROW)
    if attempt.converged or attempt.lost:
        return None
    why = f"the optimizer did not converge in {attempt.result.outcome.iterations} iterations"
    if last.operation.energy > setup.start.operation.energy:
        nodes = curve_nodes(attempt.physics, last)
        return attempt.begin_again(why, moves=NARROW, start=last, nodes=nodes)
    return attempt.begin_again(why, moves=NARROW)


def finer_torque_curve(attempt: Attempt) -> Begin | None:
    """Halve the intervals of a torque curve that is too coarse for the optimized blade.

    Segments that are too coarse are divided at once.
    """
    physics = attempt.physics
    most = physics.case.hydrodynamics.tolerance
    if not (attempt.converged and physics.has_curve) or attempt.curve_error <= most:
        return None
    why = f"error of the torque curve {attempt.curve_error:.2g}, allowed {most:.2g}"
    begin = finer_mesh(attempt)
    if begin is None:
        return attempt.from_end(why, finer=True)
    nodes = curve_nodes(begin.physics, begin.setup.start, finer=True)
    return replace(begin, setup=replace(begin.setup, nodes=nodes), why=f"{why}; {begin.why}")


def recentred_moves(attempt: Attempt) -> Begin | None:
    """Continue from an end at a move limit."""
    if not attempt.at_limit or attempt.lost:
        return None
    before = attempt.before.objective
    change = per_cent(attempt.result.objective - before, before)
    return attempt.from_end(joined("at a move limit", change and f"objective changed by {change}"))


def finer_mesh(attempt: Attempt) -> Begin | None:
    """Divide the segments that are too coarse; not where that would let the rotor pulse faster."""
    physics = attempt.physics
    if not attempt.converged or attempt.lost or physics.may_pulse:
        return None
    division = attempt.division
    if not division.allowed(physics.case.driver.optimizer):
        return None
    parts, order, meshes = division.parts, division.order, [each.mesh for each in physics.scenarios]
    why = f", error of the mesh {division.error:.2g}" if division.error else ""
    if order:
        meshes = [mesh.model_copy(update={"order": order}) for mesh in meshes]
        why = f"polynomials of order {order} for nearly all segments are too coarse{why}"
    else:
        count = sum(np.sum(own > 1) for own in parts)
        why = f"{count} segment{' is' if count == 1 else 's are'} too coarse{why}"
    scenarios = [
        replace(each.divided(own), mesh=mesh)
        for each, own, mesh in zip(physics.scenarios, parts, meshes, strict=True)
    ]
    by_name = {each.name: own for each, own in zip(scenarios, parts, strict=True)}
    lowered, worst = attempt.setup.shares, 0.0
    if not order and attempt.few_divided:  # lower the limits of the other segments at once
        lowered, worst = _lowered(physics, attempt.setup, attempt.flights)
    if worst:
        why += f"; {_exceeded(worst)}"
    physics = replace(physics, scenarios=tuple(scenarios))
    shares = {  # a finer mesh may need no lower limit
        (limit, scenario): np.repeat(np.where(by_name[scenario] > 1, 1.0, share), by_name[scenario])
        for (limit, scenario), share in lowered.items()
    }
    point = point_of(physics, attempt.result.problem)
    return attempt.begin_again(why, physics=physics, start=point, shares=shares)


def lowered_limits(attempt: Attempt) -> Begin | None:
    """Lower the limits that are exceeded between nodes, in the segments that need it.

    Elsewhere a lower limit would only cost energy. If an optimization on a finer mesh fails, the
    limits of the last optimum are lowered on its mesh.
    """
    if attempt.converged and not attempt.lost:
        physics, setup, flights = attempt.physics, attempt.setup, attempt.flights
        point = attempt.result.point
    elif attempt.lost and attempt.before.optimum and attempt.begin.remedy == "finer mesh":
        physics, result, flights = attempt.before.optimum
        setup, point = result.setup, result.point
    else:
        return None
    shares, worst = _lowered(physics, setup, flights)
    if not worst:
        return None
    why = _exceeded(worst)
    setup = replace(setup, start=point, nodes=curve_nodes(physics, point), shares=shares)
    return replace(attempt.begin, physics=physics, setup=setup, why=why)


def _exceeded(worst):
    return f"a limit is exceeded between the nodes by {100.0 * worst:.2g} %"


def _lowered(physics, setup, flights):
    """Return the shares of lowered limits, and the largest excess; 0 where none is lowered."""
    shares, worst = dict(setup.shares), 0.0
    lowest = 1.0 - (MOST_EXCEEDED if physics.remembers else MOST_LOWERED)
    for flight in flights:
        for limit in held(physics, flight.scenario):
            if not np.isfinite(limit.upper):
                continue
            most = most_between(limit)
            over, _ = flight.between_nodes(limit)
            share = reached = setup.share(limit, flight.scenario)
            if flight.two_filters is not None:
                # all stations may exceed a limit that the two filters of the nodes do not reach
                own = 1.0 + limit.excess(flight.at_nodes)
                reached = np.minimum(share, own.reshape(share.size, -1).max(axis=1))
            # if it has not helped, or the limit is exceeded by much, a lower limit does not help
            helps = (share > lowest) & (over < MOST_EXCEEDED)
            over = np.where(helps, over, 0.0)
            if np.max(over) > most:
                worst = max(worst, float(np.max(over)))
                lower = np.where(over > 0.5 * most, reached * (1.0 - over), share)
                shares[limit.name, flight.scenario.name] = lower
    return shares, worst


def stable_shaft(attempt: Attempt) -> Begin | None:
    """Bound a designed hub from below by the inertia from which the loop with memory is stable.

    The optimization does not see an instability whose growth is faster than its segments. A bound
    that is too high is lowered again.
    """
    point, bound = attempt.result.point, attempt.setup.least_hub
    hub = stable_hub(attempt.physics, point.blade, attempt.memory)
    if hub is None or not (attempt.runs_away or hub < bound - SETTLED * attempt.result.inertia):
        return None
    why = f"the loop with memory is stable from {hub:.4g} kg m^2 besides the blades"
    heavier = replace(point.blade, hub_inertia=max(hub, point.blade.hub_inertia))
    start, nodes = replace(point, blade=heavier), curve_nodes(attempt.physics, point)
    return attempt.begin_again(why, start=start, nodes=nodes, least_hub=hub)


def other_branch(attempt: Attempt) -> Begin | None:
    """Begin on the start's other branch where that is better, or a judge refuses the end."""
    physics, first = attempt.state.first, attempt.begin.start
    start = start_on_other_branch(first)
    if start is None:
        return None
    refused = [check.name for check in attempt.end.checks if not check.passed]
    if set(refused) - {"loads_resolved"}:  # for which another start does not help
        why = f"{len(refused)} checks refuse the result on branch {first.branch}"
    elif start.objective > (1.0 + TIE) * first.objective:
        gain = per_cent(start.objective - first.objective, first.objective)
        why = f"without time branch {start.branch} is better by {gain}"
    else:
        return None
    reference = quasi_steady_reference(physics, start)
    return Begin(start, physics, _first_setup(physics, start), reference, why=why)


def _first_setup(physics, start) -> Setup:
    """Return the first setup, in which a designed hub makes the loop with memory stable."""
    return Setup(start, curve_nodes(physics, start), least_hub=first_hub(physics, start))


REMEDIES: tuple[Callable[[Attempt], Begin | None], ...] = (
    smaller_moves,
    stable_shaft,
    finer_torque_curve,
    recentred_moves,
    finer_mesh,
    lowered_limits,
    other_branch,
)


def next_begin(attempt: Attempt) -> Begin | None:
    """Return the start of the next optimization by the first remedy that applies.

    After `MAX_PASSES` from one start, only another start is left. A loop that is unstable with
    memory of the wake is refused unless its shaft is designed: no mesh helps, and its integration
    runs away.
    """
    *others, another_start = REMEDIES
    if attempt.before.verified:  # what fails on a second branch then is not tried again
        others.remove(smaller_moves)
    second = attempt.before.verified is not None
    last = () if attempt.approximate or second else (another_start,)  # for which the judges decide
    if attempt.runs_away:
        others, last = (stable_shaft,), ()
    for remedy in (*(others if attempt.before.passes + 1 < MAX_PASSES else ()), *last):
        begin = remedy(attempt)
        if begin is not None:
            return replace(begin, remedy=remedy.__name__.replace("_", " "))
    return None


def optimize(state: RunState, start: StartingPoint, reference: float) -> Judged:
    """Optimize from a start until no remedy applies.

    Parameters
    ----------
    state
        The state of the run, which records every pass.
    start
        Where the first optimization begins.
    reference
        Objective of the start, J; 0 where it is no measure of the optimum.

    Returns
    -------
    Judged
        The end, on its mesh: of the branches of the start, the best that passes.
    """
    begin: Begin | None = Begin(start, state.first, _first_setup(state.first, start), reference)
    before, ends = Before(), []
    while begin is not None:
        if before.passes == 0:
            near = max(state.first.excesses(begin.start).values(), default=0.0) < FAR
        if before.passes == 0 or begin.physics is not state.physics:
            state.go_on_from(begin.physics, begin.setup.start, begin.reference)
        began = time.perf_counter()
        most = SECOND_ITERATIONS if before.verified else FIRST_ITERATIONS
        most = None if begin.setup.moves == NARROW else most
        result = solve(state, begin.physics, begin.setup, near, most)
        attempt = Attempt(state, begin, result, before)
        again = next_begin(attempt)
        if again is None and attempt.approximate:
            attempt = replace(attempt, exact=True)
            again = next_begin(attempt)
        state.note_pass(attempt.entry(time.perf_counter() - began, again))
        if again is None or again.start is not begin.start:
            ends.append(attempt.end)
            before = Before(verified=ends[-1].passed)
        else:
            before = attempt.after(again)
        begin = again
    return max((end for end in ends if end.passed), key=lambda end: end.rank, default=ends[0])
