"""The start of one optimization."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hkt_mdo.dynamics.limits import SLOWED
from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.start.quasi_steady import QuasiSteady
from hkt_mdo.start.result import design_of_result
from hkt_mdo.start.search import ScheduleSearch, follows_schedule, largest_energy, start_of
from hkt_mdo.start.strategies import Task, best_blades, blade_as_given

FAR_BEHIND = 0.05  # relative difference of the objective beyond which a branch is not tried second
LOCAL = (
    "start.method = blade: the optimum is a local one near the given blade, others were not "
    "searched; quasi_steady searches for them"
)


def steady_optimum(physics: Physics, blade: Blade) -> SteadyOptimum:
    """Return the largest power coefficient: over the blade too, unless it is fixed."""
    return physics.rotor.best_of_shape(physics.shape, blade)


def bounding_optimum(physics: Physics, optimum: SteadyOptimum, blade: Blade) -> SteadyOptimum:
    """Return the steady optimum that bounds the energy of a blade, whose radius may differ.

    Where polars follow the Reynolds number: the best of the slowest, usual and fastest flow.

    Parameters
    ----------
    physics : Physics
    optimum : SteadyOptimum
        That of the case's blade.
    blade : Blade

    Returns
    -------
    SteadyOptimum
    """
    found, rotors = [], []
    if blade.rotor_radius == optimum.blade.rotor_radius:
        found.append(optimum)
    else:
        rotors.append(physics.rotor)
    if physics.rotor.follows_reynolds:
        speeds = np.concatenate([s.inflow.speed_at(s.node_times) for s in physics.scenarios])
        rotors += [physics.rotor.at_flow(speed) for speed in (speeds.min(), speeds.max())]
    found += [rotor.best_of_shape(physics.shape, blade) for rotor in rotors]
    return max(found, key=lambda optimum: optimum.power_coefficient)


def improves(physics: Physics, improve: bool | None = None) -> bool:
    """Tell whether a start is improved; None: as in the case."""
    return physics.case.start.method == "quasi_steady" if improve is None else improve


def find_start(
    physics: Physics,
    optimum: SteadyOptimum,
    *,
    improve: bool | None = None,
    slowed: float = SLOWED,
    branch: str = "",
) -> StartingPoint:
    """Return the start of an optimization by quasi-steady co-design over all scenarios' flows.

    Parameters
    ----------
    physics : Physics
    optimum : SteadyOptimum
        Where the search begins.
    improve : bool, optional
        False keeps blade and gains as the case gives them; None does as `start` says.
    slowed : float
        Share of its speed that the rotor must be able to lose.
    branch : str
        The one to start on where limits make several (`hkt_mdo.start.steady_flow`), by default that
        of `start.branch`.

    Returns
    -------
    StartingPoint
        With the outcomes of all candidates (`starts`).

    Raises
    ------
    InputError
        If `start.from` is no result that the case can begin with.
    """
    result, messages = None, ()
    if improve is not False and physics.case.start.from_ is not None:
        result, messages = design_of_result(physics)
    candidates = tuple(blade_as_given(physics))
    if improves(physics, improve):
        candidates += *filter(None, [result]), *best_blades(physics, optimum)
    else:
        candidates = (result,) if result else candidates
        messages += (LOCAL,) if improve is None else ()
    problem = QuasiSteady.of(physics, optimum, slowed)
    task = Task(physics, problem, optimum, candidates, improves(physics, improve))
    if not follows_schedule(physics):
        return replace(largest_energy(task), messages=messages)
    search = ScheduleSearch(task)
    found, branch = search.ends(), branch or physics.case.start.branch
    found.sort(key=lambda point: point.branch != branch)
    return replace(start_of(physics, problem, found, search.starts), messages=messages)


def other_branch(
    physics: Physics, optimum: SteadyOptimum, start: StartingPoint
) -> StartingPoint | None:
    """Return the start on a starting point's other branch; None if there is no good one.

    A good one keeps the limits and is not much worse; the case must not have chosen a branch.

    Parameters
    ----------
    physics : Physics
    optimum : SteadyOptimum
        That of `find_start`.
    start : StartingPoint
        Its result.

    Returns
    -------
    StartingPoint or None
    """
    if len(start.branches) < 2 or physics.case.start.branch != "best":
        return None
    first, other, *_ = start.branches
    kept, objective = other.worth
    if not kept or objective < (1.0 - FAR_BEHIND) * first.objective:
        return None
    second = start_of(physics, QuasiSteady.of(physics, optimum), [other, first], start.starts)
    return replace(second, messages=start.messages)
