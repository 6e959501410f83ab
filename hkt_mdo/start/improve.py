"""The one loop that improves a start: SLSQP within move limits, re-centred until nothing is gained.

`hkt_mdo.start.energy` and `hkt_mdo.start.limited` define its objectives and constraints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, minimize

from hkt_mdo.problem.physics import START_EXCESS, Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.problem.setup import THICKNESS_UNIT, TWIST_UNIT, MoveLimits, gain_bounds
from hkt_mdo.rotor.blade import Blade

NEAR = MoveLimits(
    chord=1.3, twist=np.deg2rad(3.0), thickness=0.02, radius=1.1, gain=1.2
)  # of one SLSQP, about as far as a linearization of the torque holds
WIDE = MoveLimits(
    chord=1.7, twist=np.deg2rad(8.0), thickness=0.04, radius=1.2, gain=1.6
)  # of one SLSQP whose limits are elastic, which finds back from a poor linearization
SCHEDULES, GAIN = 3, 1e-5  # most schedules chosen anew, and the relative gain that is worth one
LOSS = 2.0  # share of the objective lost, over the excess at the beginning, that is too much
HOPELESS = 0.2  # share of a rival's objective that no second way makes up for
_PARTS = "chord_control", "twist_control", "thickness_control", "rotor_radius", "gain"


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
    moves : MoveLimits
        Of one round.
    ratio : float
        Factor within which tip speed ratios move in one round, where they are unknowns.
    tightens : bool
        Whether limits that are exceeded by much are tightened in steps, so that each round begins
        close to its limits.
    price : float
        Price of an excess of limits by 100 %, as a share of the objective, if limits are elastic:
        then all may be exceeded by one more unknown, at that price. It must be more
        than the limits' multipliers together, so that the optimum keeps them. 0: none is elastic.
    tightened, loose : float
        Factor of the excess from one round to the next, and the excess from which nothing is left.
    gain : float
        Relative gain of the objective that is worth another round.
    behind, last : float
        Share of a rival's objective, and multiple of the last gain, by which a point may be worse
        before it is given up.
    """

    rounds: int
    iterations: int
    tolerance: float
    moves: MoveLimits = NEAR
    ratio: float = 1.25
    tightens: bool = False
    price: float = 0.0
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
    """One optimization within move limits around a point; arrays of shape (n_unknowns,).

    `values` returns the `Values` at some unknowns, `rank` the rank of the point there.
    """

    center: np.ndarray
    units: np.ndarray
    low: np.ndarray
    high: np.ndarray
    values: Callable[[np.ndarray], Values]
    rank: Callable[[np.ndarray, StartingPoint], tuple]


class Search:
    """The optimization of a start over one vector of unknowns.

    It begins with control points of chord, twist and thickness, then the disc's radius, then the
    gains; what is not designed has no place in it. A subclass has the objective and the
    constraints: `around(point, settings)` returns the `Round` about a point, `point(unknowns,
    values,
    origin)` the point of unknowns that were reached from another one, and `rank(point)` the rank of
    a point.

    Parameters
    ----------
    physics : Physics
        Whose shape and control law are designed.
    """

    settings: Settings
    second: Settings | None = None
    """Settings of a second attempt, for a point from which the first does not reach the limits."""

    def __init__(self, physics: Physics):
        self.physics, self.shape, self.law = physics, physics.shape, physics.law
        self.resized = self.shape.radius_bounds is not None
        sizes = [*self.shape.points.values(), self.resized, len(physics.gain_units)]
        self.ends = np.cumsum(sizes[:-1])
        shape, radius_bounds = self.shape, self.shape.radius_bounds or (0.0, 0.0)
        own = shape.chord_bounds, shape.twist_bounds, shape.thickness_bounds, radius_bounds
        self._own = np.repeat((*own, gain_bounds(physics)), sizes, axis=0).T
        self._typical = np.repeat([0.0, TWIST_UNIT, THICKNESS_UNIT, 0.0, 0.0], sizes)

    def vector(self, point: StartingPoint) -> tuple[np.ndarray, np.ndarray]:
        """Return the unknowns of a point within their bounds, and their units, both (n,)."""
        radius = [point.blade.rotor_radius] * self.resized
        x = np.concatenate((*self.shape.control(point.blade), radius, point.gains))
        x = np.clip(x, *self._own)
        units = np.where(self._typical > 0.0, self._typical, np.abs(x))
        if self.law.is_feedback:
            units[self.ends[-1] :] = self.law.sizes(self.gains(x))
        return x, units

    def bounds(self, point: StartingPoint, moves: MoveLimits) -> np.ndarray:
        """Return the lower and upper limits of moves from a point, shape (2, n)."""
        bounds = moves.bounds(self.physics, point)
        return np.array([np.concatenate([bounds[name][i] for name in _PARTS]) for i in (0, 1)])

    def blade(self, x: np.ndarray) -> Blade:
        """Return the blade of some unknowns."""
        *control, radius, _ = np.split(x, self.ends)
        return self.shape.at(*control, radius[0] if self.resized else None)

    def gains(self, x: np.ndarray) -> np.ndarray:
        """Return the gains among the unknowns."""
        return x[self.ends[-1] :]

    def slopes(self, by_chord, by_twist, by_thickness, by_radius) -> np.ndarray:
        """Return derivatives by the unknowns but the gains, from those by the stations' shape.

        Parameters
        ----------
        by_chord, by_twist, by_thickness : np.ndarray
            By the values at the stations, shape (m, n_stations).
        by_radius : np.ndarray
            By the radius of the disc, shape (m,).

        Returns
        -------
        np.ndarray
            Shape (m, n - n_gains).
        """
        shape = self.shape
        if not shape.designs_chord:  # the chord is scaled with the disc
            by_radius = by_radius + by_chord @ shape.chord_offset / shape.blade.rotor_radius
        parts = [by_chord @ shape.chord_basis, by_twist @ shape.twist_basis]
        if shape.designs_thickness:
            parts.append(by_thickness @ shape.thickness_basis)
        return np.hstack((*parts, by_radius[:, None][:, : self.resized]))

    def with_schedule_anew(self, point: StartingPoint) -> StartingPoint | None:
        """Return a point with the best schedule of its blade; None where the search has none."""
        return None


def improve(search: Search, point: StartingPoint, rival: float = -np.inf) -> StartingPoint:
    """Return the improved point.

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
    best, settled = _improved(search, search.settings, point, rival)
    # what is lost on the way to the limits is of the size of what they were exceeded by
    lost = best.objective < (1.0 - LOSS * max(point.excess, 0.0)) * point.objective
    if (settled and not lost) or search.second is None:
        return _with_schedule_anew(search, best, rival)
    start = best if not lost and best.excess <= START_EXCESS else point
    return max(best, improve_widely(search, start, rival), key=search.rank)


def improve_widely(search: Search, point: StartingPoint, rival: float = -np.inf) -> StartingPoint:
    """Return the point improved under elastic limits, with the search's second settings.

    Parameters
    ----------
    search : Search
        With a second way.
    point : StartingPoint
        Where it begins.
    rival : float
        As that of `improve`.

    Returns
    -------
    StartingPoint
    """
    return _with_schedule_anew(search, _improved(search, search.second, point, rival)[0], rival)


def _with_schedule_anew(search, best, rival) -> StartingPoint:
    """Return the best point, improved again while a schedule chosen anew for its blade is better.

    SLSQP moves the tip speed ratio of each speed of the flow by small steps: one that has come to
    the wrong side of the largest power stays there, and the blade is shaped for it.
    """
    for _ in range(SCHEDULES):
        again = search.with_schedule_anew(best)
        if again is None or again.objective <= (1.0 + GAIN) * best.objective:
            break
        if _hopeless(again, rival):
            break
        end = _improved(search, search.second, again, rival)[0]
        if search.rank(end) <= search.rank(best):
            break
        best = end
    return best


def _improved(search, settings, point, rival) -> tuple[StartingPoint, bool]:
    """Return the improved point, and whether the search ended there."""
    slack, best = 0.0, point
    if settings.tightens:
        slack = point.excess if np.isfinite(point.excess) else 1.0
    for left in range(settings.rounds, 0, -1):
        slack = settings.tightened * slack if slack > settings.loose else 0.0
        here = search.around(point, settings)
        if not here.center.size:
            return best, True
        x, values = _maximized(here, settings, slack, max(abs(point.objective), 1e-9))
        if not (np.all(np.isfinite(x)) and np.isfinite(values.objective)):
            return best, False  # a step of SLSQP led to where nothing is a number
        better = search.point(x, values, point)
        *kept, value = here.rank(here.center, point)
        if not slack and here.rank(x, better) <= (*kept, value + settings.gain * abs(value)):
            return best, best.excess <= START_EXCESS
        gained, missing = better.objective - point.objective, rival - better.objective
        nearer, point = point.excess - better.excess, better
        best = point if slack else max(point, best, key=search.rank)
        if settings.price and point.excess > max(START_EXCESS, left * nearer):
            return best, False  # it does not reach points that keep the limits
        elastic = settings.price and point.excess > START_EXCESS
        if not elastic and missing > max(settings.behind * abs(rival), settings.last * gained):
            return best, best.excess <= START_EXCESS or _hopeless(best, rival)
    return best, False


def _hopeless(point, rival) -> bool:
    """Tell whether a point that has been given up is too far behind a rival for another way."""
    return rival - point.objective > HOPELESS * abs(rival)


def _maximized(
    here: Round, settings: Settings, slack: float, size: float
) -> tuple[np.ndarray, Values]:
    """Return the unknowns of the largest objective, and the values there.

    The limits may be exceeded by the slack. Under elastic limits SLSQP has one unknown more, the
    excess: each of its quadratic problems then has a solution, however far the limits are exceeded.
    """
    units, scale, n = here.units, -100.0 / size, here.center.size
    low, high = here.low / units, here.high / units
    start = np.clip(here.center / units, low, high)

    @lru_cache(maxsize=2)
    def at(x):
        return here.values(np.array(x[:n]) * units)

    first, excess = at(tuple(start)), np.empty(0)
    if settings.price:
        broken = max([0.0, *-first.above, *np.abs(first.equal)])
        excess = np.array([broken] if broken > START_EXCESS else [])
    price = np.full(excess.size, 100.0 * settings.price)

    def constraint(kind, row, sign=1.0):
        return {
            "type": kind,
            "fun": lambda x: sign * at(tuple(x))[row] + np.sum(x[n:]) + slack * (row == above),
            "jac": lambda x: np.pad(
                sign * at(tuple(x))[row + 1] * units,
                ((0, 0), (0, excess.size)),
                constant_values=1.0,
            ),
        }

    above, equal = (Values._fields.index(name) for name in ("above", "equal"))
    constraints = [constraint("ineq", above)]
    if excess.size:
        constraints += constraint("ineq", equal), constraint("ineq", equal, -1.0)
    else:
        constraints.append(constraint("eq", equal))
    found = minimize(
        lambda x: scale * at(tuple(x)).objective + price @ x[n:],
        np.append(start, excess),
        jac=lambda x: np.append(scale * at(tuple(x)).objective_by * units, price),
        method="SLSQP",
        bounds=Bounds(np.append(low, 0.0 * excess), np.append(high, excess)),
        constraints=constraints,
        options={
            "ftol": settings.tolerance,
            "maxiter": settings.rough_iterations if slack else settings.iterations,
        },
    )
    return found.x[:n] * units, at(tuple(found.x))
