"""Nested cases: a result is feasible in every less restricted case, and may be better there.

Cases are nested by their limits, since one more limit can only cost energy; by control laws of
which one is a special case of another (`Law.contains`); and by a fixed and a designed blade. So
several results of one turbine in one flow check each other, without another program.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import Row

BETTER = 1e-4
"""Share of the objective by which another result must be better to be reported."""
EXCEEDED = 1e-3
"""Relative excess of a limit along an integration with which a result counts as allowed."""
OWN = {"name", "control", "limits", "design", "start", "driver", "hydrodynamics", "phase"}
"""Sections of a case in which two cases of one turbine in one flow may differ."""


class Dominated(NamedTuple):
    """A result, and the best of the others that its case allows, which is better.

    Attributes
    ----------
    result, by : Solution
    gain : float
        By how much the other's objective is better, as a share; infinite where the result was
        refused by its checks and the other one was not.
    """

    result: Solution
    by: Solution
    gain: float

    def __str__(self) -> str:
        how = "was refused" if np.isinf(self.gain) else "is not the best that its case allows"
        better = "" if np.isinf(self.gain) else f" and is {100.0 * self.gain:.2g} % better"
        return f"{self.result.folder} {how}: {self.by.folder} keeps its limits{better}"


def dominated(solutions: Iterable[Solution]) -> list[Dominated]:
    """Return the results that another one beats in their own case.

    Parameters
    ----------
    solutions : iterable of Solution
        Finished results.

    Returns
    -------
    list of Dominated
        One for each result that is dominated, with the best of those that beat it.
    """
    results, entries = list(solutions), []
    verified = [result for result in results if result.success]
    for result in results:
        others = [other for other in verified if other is not result and allows(result, other)]
        if others:
            best = max(others, key=lambda other: _gain(result, other))
            gain = _gain(result, best) if result.success else np.inf
            entries += [Dominated(result, best, gain)] if gain > BETTER else []
    return entries


def remarks(solutions: Iterable[Solution]) -> list[str]:
    """Return what a reader of results side by side has to know.

    Parameters
    ----------
    solutions : iterable of Solution
        Finished results.

    Returns
    -------
    list of str
        Whether objectives or flows differ, and which results are dominated.
    """
    results, lines = list(solutions), []
    if len({result.case.objective.kind for result in results}) > 1:
        lines.append("the objectives differ: results are in the order given")
    flow = {"inflow", "resource", "scenarios"}
    if len({result.case.model_dump_json(include=flow) for result in results}) > 1:
        lines.append("the flows differ: objectives and loads are not of the same conditions")
    return [*lines, *map(str, dominated(results))]


def ranked(solutions: Iterable[Solution]) -> tuple[list[Solution], list[list[Row]]]:
    """Return results by their objectives, as simulated: successes, refused ones, unfinished ones.

    Results of different durations are compared by the objective over the duration, of an energy the
    mean power, where the objective is an integral over time.

    Parameters
    ----------
    solutions : iterable of Solution

    Returns
    -------
    solutions : list of Solution
        The best first; results of different objectives keep their order.
    behind : list of list of Row
        By how much each of several objectives differs from that of the best success, a row each;
        none where that is not known.
    """
    results, measure = list(solutions), "objective"
    values = [_objective(result) if result.finished else None for result in results]
    durations = [result.case.phase.duration for result in results]
    if len({*durations}) > 1 and results[0].case.objective.is_rate:
        measure = "objective over duration"
        values = [x and t and x / t for x, t in zip(values, durations, strict=True)]
    kinds = {x.case.objective.kind for x, value in zip(results, values, strict=True) if value}
    sign = results[0].case.objective.sign if len(kinds) == 1 else 0.0
    pairs = sorted(
        zip(values, results, strict=True),
        key=lambda x: (x[0] is None, not x[1].success, -sign * (x[0] or 0.0)),
    )
    best, first = pairs[0]

    def behind(value: float | None) -> list[Row]:
        if best is None or value is None or len(kinds) > 1 or len(results) == 1:
            return []
        share = 0.0 - first.case.objective.behind(value, best)
        return [Row(f"{measure}, relative to the best", f"{100.0 * share:+.4f} %")]

    return [result for _, result in pairs], [behind(value) for value, _ in pairs]


def _objective(solution: Solution) -> float | None:
    """Return the objective of a result as simulated; older results have the energy alone."""
    entry, case = solution.summary.objective, solution.case
    old = solution.summary.simulated_energy_J if case.objective.kind == "captured" else None
    return old if entry is None else entry.simulated


def allows(result: Solution, other: Solution) -> bool:
    """Tell whether a result's case allows another result as it is.

    Parameters
    ----------
    result : Solution
        The result of the case.
    other : Solution

    Returns
    -------
    bool
        Also False if a branch is required, or if it is not known: for limits on the design, several
        scenarios, and quantities that the other's tables lack.
    """
    case, theirs = result.case, other.case
    if case.start.branch not in ("best", theirs.start.branch):
        return False
    if case.scenarios or case.model_dump(exclude=OWN) != theirs.model_dump(exclude=OWN):
        return False
    phases = [(x.phase.duration, x.phase.initial_speed) for x in (case, theirs)]
    ends = theirs.ends_free or not case.ends_free
    if phases[0] != phases[1] or not ends or not case.control.contains(theirs.control):
        return False
    return _allows_blade(result, other) and _keeps_limits(result, other)


def _allows_blade(result, other) -> bool:
    """Tell whether the other's blade is one that the result's case may design."""
    design, theirs = result.case.design, other.case.design
    if design == theirs:
        blades = [(x.summary.chord_m, x.summary.twist_deg) for x in (result, other)]
        return design.blade == "optimized" or bool(np.allclose(*blades, rtol=1e-9, atol=0.0))
    unlike = design.hub_inertia_bounds, theirs.hub_inertia_bounds, theirs.thickness_points
    unlike += design.gain_bounds, design.chord_points, design.twist_points, design.thickness_points
    if design.blade == "fixed" or any(unlike):
        return False
    chord, twist = other.summary.chord_m, other.summary.twist_deg
    bounds = (chord, design.chord_bounds or (0.0, np.inf)), (twist, design.twist_bounds)
    within = all(low <= min(values) and max(values) <= high for values, (low, high) in bounds)
    return within and other.summary.rotor_radius_m == result.summary.rotor_radius_m


def _keeps_limits(result, other) -> bool:
    """Tell whether the other's integration keeps every limit of the result's case."""
    limits = result.case.limits.given
    if other.summary.loads is None:
        return False
    theirs = {limit.name: limit for limit in other.case.limits.given}
    # the suction in the tables depends on depth and margin
    if any(x.name == "cavitation" and theirs.get(x.name) not in (None, x) for x in limits):
        return False
    summary = other.summary.model_copy(update={"limits": result.summary.limits})
    shares = replace(other, case=result.case, summary=summary).limit_shares()
    if not {limit.name for limit in limits} <= shares.keys():
        return False
    return all(np.max(share) <= 1.0 + EXCEEDED for share in shares.values())


def _gain(result, other) -> float:
    """Return by how much the other's objective is better than a result's, as a share.

    Over a closed cycle what is captured is delivered: energy that the other stores does not count.
    """
    objective, theirs = result.case.objective, _objective(other) or 0.0
    if objective.kind == "captured" and other.case.ends_free and not result.case.ends_free:
        theirs = min(theirs, other.summary.generator_energy_J or 0.0)
    return objective.behind(_objective(result) or 0.0, theirs)
