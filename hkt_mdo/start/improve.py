"""The one loop that improves a start: SLSQP within move limits, re-centred until nothing is gained.

`hkt_mdo.start.energy` and `hkt_mdo.start.limited` say what is made large and what is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np
from scipy.optimize import Bounds, minimize

from hkt_mdo.problem.point import StartingPoint


@dataclass(frozen=True)
class Settings:
    """How a search improves a point.

    Attributes
    ----------
    rounds : int
        Most move limits that are set, one after another.
    iterations, rough_iterations : int
        Most SLSQP iterations of one round, and of one whose limits are tightened only in part.
    tolerance : float
        SLSQP's, of the objective, of which one is a hundredth.
    tightens : bool
        Whether limits that are exceeded by much are tightened in steps: then each round begins near
        what it asks for.
    tightened, loose : float
        Factor of the excess from one round to the next, and the excess from which nothing is left.
    gain : float
        Relative gain of the objective that is worth another round.
    behind, last : float
        Share of a rival's objective, and multiple of the last gain, by which a point may be behind
        before it is given up.
    """

    rounds: int
    iterations: int
    tolerance: float
    tightens: bool = False
    rough_iterations: int = 12
    tightened: float = 0.5
    loose: float = 0.05
    gain: float = 1e-7
    behind: float = 0.01
    last: float = 4.0


class Values(NamedTuple):
    """Objective, equalities = 0 and inequalities >= 0, each with its slopes by the unknowns."""

    objective: float
    objective_by: np.ndarray
    equal: np.ndarray
    equal_by: np.ndarray
    above: np.ndarray
    above_by: np.ndarray


@dataclass(frozen=True, eq=False)
class Round:
    """One optimization within move limits round a point; arrays of shape (n_unknowns,).

    `values` returns the `Values` at some unknowns, `rank` what ranks a point at some unknowns.
    """

    center: np.ndarray
    units: np.ndarray
    low: np.ndarray
    high: np.ndarray
    values: Callable[[np.ndarray], Values]
    rank: Callable[[np.ndarray, StartingPoint], tuple]


class Search(Protocol):
    """What is improved: how a point becomes unknowns, and unknowns a point."""

    settings: Settings

    def around(self, point: StartingPoint) -> Round:
        """Return the optimization round a point."""

    def point(self, unknowns: np.ndarray, origin: StartingPoint) -> StartingPoint:
        """Return the point of some unknowns, which the search reached from another point."""


def improve(search: Search, point: StartingPoint, rival: float = -np.inf) -> StartingPoint:
    """Return what a point is improved to.

    Parameters
    ----------
    search : Search
    point : StartingPoint
        Where the search begins.
    rival : float
        Objective of another point, J. A point that remains far behind it is given up.

    Returns
    -------
    StartingPoint
    """
    settings, slack = search.settings, 0.0
    if settings.tightens:
        slack = point.excess if np.isfinite(point.excess) else 1.0
    for _ in range(settings.rounds):
        slack = settings.tightened * slack if slack > settings.loose else 0.0
        here = search.around(point)
        if not here.center.size:
            break
        x = _maximized(here, settings, slack, max(abs(point.objective), 1e-9))
        better = search.point(x, point)
        *kept, value = here.rank(here.center, point)
        if not slack and here.rank(x, better) <= (*kept, value + settings.gain * abs(value)):
            break
        gained, missing = better.objective - point.objective, rival - better.objective
        point = better
        if missing > max(settings.behind * abs(rival), settings.last * gained):
            break
    return point


def _maximized(here: Round, settings: Settings, slack: float, size: float) -> np.ndarray:
    """Return the unknowns of the largest objective; the limits may be exceeded by the slack."""
    units, scale = here.units, -100.0 / size
    low, high = here.low / units, here.high / units

    @lru_cache(maxsize=2)
    def at(x):
        return here.values(np.array(x) * units)

    def constraint(kind, row, slack=0.0):
        return {
            "type": kind,
            "fun": lambda x: at(tuple(x))[row] + slack,
            "jac": lambda x: at(tuple(x))[row + 1] * units,
        }

    rows = Values._fields.index
    constraints = [constraint("ineq", rows("above"), slack), constraint("eq", rows("equal"))]
    found = minimize(
        lambda x: scale * at(tuple(x)).objective,
        np.clip(here.center / units, low, high),
        jac=lambda x: scale * at(tuple(x)).objective_by * units,
        method="SLSQP",
        bounds=Bounds(low, high),
        constraints=constraints,
        options={
            "ftol": settings.tolerance,
            "maxiter": settings.rough_iterations if slack else settings.iterations,
        },
    )
    return found.x * units
