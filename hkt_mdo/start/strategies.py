"""Strategies of the search for a start: each proposes blades, or points with gains and a schedule.

The names below appear in the summary under `starts`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from hkt_mdo.dynamics.laws import Law, OpenLoop
from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.problem.setup import gain_bounds
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.start.energy import EnergySearch, operating_point
from hkt_mdo.start.limited import LimitedSearch
from hkt_mdo.start.quasi_steady import QuasiSteady
from hkt_mdo.start.steady_flow import SteadyFlow

GIVEN, BEST, RESULT = "blade as given", "best blade of a tip speed ratio", "design of a result"
OTHER_BRANCH, FITTED = "blade of the other branch", "law fitted to open loop"
COARSER, CONSTANT_TORQUE = "law fitted to a coarser law", "solid blade at a constant torque"
LONGER = "longer solid part"


@dataclass(frozen=True)
class _BestBlades:
    """Tip speed ratios, over that of the steady optimum, whose best blades are candidates.

    Downwards and upwards; each search begins at the previous blade. Blades of other ratios are too
    far from any optimum under the limits of a turbine.
    """

    below: tuple[float, ...] = tuple(np.geomspace(0.93, 0.75, 3))
    above: tuple[float, ...] = tuple(np.geomspace(1.04, 2.0, 7))
    tolerance: float = 1e-8  # of the power coefficient: candidates are improved later


@dataclass(frozen=True)
class _Fit:
    """How gains are fitted to open loop: the shares of its torque that are tried.

    `every`: one of so many instants is used, which is enough to rank gains.
    """

    shares: tuple[float, ...] = tuple(np.linspace(0.6, 1.1, 11))
    every: int = 4


@dataclass(frozen=True)
class _SolidBlade:
    """Blades for a constant torque.

    `ratio`: their tip speed ratio over the optimum's. `widths`: their chords over that of the best
    blade at this ratio; each leads to an optimum of its own. `jump`: factor of the chord from one
    control point to the next at which the solid part ends. `saturated`: demand over the limit of
    the torque at which a law's torque is constant.
    """

    ratio: float = 0.45
    widths: tuple[float, ...] = (1.0, 3.0)
    jump: float = 2.0
    saturated: float = 10.0


BEST_BLADES, FIT, SOLID_BLADE = _BestBlades(), _Fit(), _SolidBlade()


class Candidate(NamedTuple):
    """A blade that a strategy proposes, and gains; None: fitted to its open loop."""

    strategy: str
    blade: Blade
    gains: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Task:
    """The input of a search for a start.

    Attributes
    ----------
    physics : Physics
        Limits and law.
    problem : QuasiSteady
        Over the whole flow, or some speeds of it.
    optimum : SteadyOptimum
        Of the blades to choose from.
    candidates : tuple of Candidate
        Blades, the given one first; only that if blades are not improved.
    improves : bool
        Whether blades and gains are improved, or stay as given.
    steady : SteadyFlow or None
        The speeds at which schedules are designed, which are those of `problem` then.
    """

    physics: Physics
    problem: QuasiSteady
    optimum: SteadyOptimum
    candidates: tuple[Candidate, ...]
    improves: bool
    steady: SteadyFlow | None = None

    @property
    def effort(self) -> int:
        """How many candidates of a strategy are improved."""
        return self.physics.case.start.effort

    def under(self, law: Law) -> Task:
        """Return the task of another law, whose gains are not given."""
        physics = replace(self.physics, law=law)
        candidates = tuple(each._replace(gains=None) for each in self.candidates)
        problem = replace(self.problem, law=law)
        return replace(self, physics=physics, problem=problem, candidates=candidates)

    def operating(self, point: StartingPoint) -> StartingPoint:
        """Return a law's point with its quasi-steady operation at the speeds of the flow."""
        problem = replace(self.problem, rotor_radius=point.blade.rotor_radius)
        table = self.steady.curves(point.blade).values["torque"]
        return replace(point, operation=problem.operate(table, point.gains))


def blade_as_given(physics: Physics) -> Iterator[Candidate]:
    """Yield the blade of the case, with the gains that it gives."""
    gains = physics.law.starting_gains()
    yield Candidate(GIVEN, physics.shape.blade, gains)


def best_blades(physics: Physics, optimum: SteadyOptimum) -> Iterator[Candidate]:
    """Yield the steady-optimal blades of a range of tip speed ratios, where a shape is designed.

    Parameters
    ----------
    physics : Physics
    optimum : SteadyOptimum
        Of the blades that the shape gives to choose from, at the given radius.

    Yields
    ------
    Candidate
    """
    shape, tolerance = physics.shape, BEST_BLADES.tolerance
    for ratios in (BEST_BLADES.below, BEST_BLADES.above) if shape.designs_chord else ():
        blade = optimum.blade
        for share in ratios:
            ratio = share * optimum.tip_speed_ratio
            blade = physics.rotor.best_blade(shape, ratio, blade, tolerance).blade
            yield Candidate(BEST, shape.nearest(blade))


def with_gains(physics: Physics, problem: QuasiSteady, candidate: Candidate) -> StartingPoint:
    """Return a candidate in quasi-steady operation, its gains fitted where it has none.

    Parameters
    ----------
    physics : Physics
    problem : QuasiSteady
        Flow and law.
    candidate : Candidate

    Returns
    -------
    StartingPoint
        Its gains are within their bounds; fitted gains are the best of several shares of open
        loop's torque.
    """
    strategy, blade, gains = candidate
    problem, law = replace(problem, rotor_radius=blade.rotor_radius), problem.law
    table = physics.rotor.coefficients(blade, problem.spline.nodes).torque
    if not law.is_feedback:
        return operating_point(blade, np.empty(0), problem.operate(table), strategy)
    if gains is None:
        flow = {"inflow_speed": problem.inflow_speed, "weights": problem.weights}
        few = replace(problem, **{name: values[:: FIT.every] for name, values in flow.items()})
        ideal = replace(few, law=OpenLoop(torque_limit=law.torque_limit)).operate(table)
        friction = physics.generator.friction(ideal.rotor_speed)
        fitted = law.fit(ideal.rotor_speed, ideal.hydrodynamic_torque - friction)
        tried = [np.clip(law.eased(fitted, share), *gain_bounds(physics)) for share in FIT.shares]
        points = (operating_point(blade, gains, few.operate(table, gains)) for gains in tried)
        gains = max(points, key=EnergySearch.rank).gains
    gains = np.asarray(gains, dtype=float)
    return operating_point(blade, gains, problem.operate(table, gains), strategy)


def fitted(task: Task, guide: StartingPoint, strategy: str) -> StartingPoint:
    """Return a law's point with the blade of an open loop, fitted to its schedule.

    A static law's own operation may be far from the schedule that its gains are fitted to, above
    all where its torque falls with the speed. If it exceeds limits by more, the point has that
    schedule, on which the torques are not quite in balance.

    Parameters
    ----------
    task : Task
        At some speeds of the flow.
    guide : StartingPoint
        With the schedule of open loop or of a coarser law.
    strategy : str
        The strategy's name.

    Returns
    -------
    StartingPoint
    """
    law, steady, blade = task.physics.law, task.steady, guide.blade
    curves, point = steady.curves(blade), replace(guide, strategy=strategy)
    series = steady.along(curves, guide.ratio)
    speed, torque = series["rotor_speed"], series["control_torque"]
    if not task.physics.states:
        point = replace(point, gains=np.clip(law.fit(speed, torque), *gain_bounds(task.physics)))
        held = LimitedSearch(steady, task.problem.slowed).measured(point)
        return max(steady.in_balance(task.operating(point)), held, key=attrgetter("worth"))
    gains, unit = law.starting_gains(), blade.rotor_radius / steady.speeds
    if gains is None:
        slope = steady.spline.values(curves.values["torque"], guide.ratio)[1] * unit
        slope *= torque_scale(series["density"], blade.rotor_radius, steady.speeds)
        gains = law.follow(steady.speeds, speed, torque, slope)
    ratio = law.speed_at_rest(steady.speeds, gains) * unit
    return steady.on_schedule(replace(point, gains=gains), ratio)


def constant_torque(task: Task) -> Iterator[StartingPoint]:
    """Yield a law's points at its torque limit, if any, with solid blades for a slow rotor.

    At a constant torque the power is proportional to the rotor speed, which varies little with the
    flow if the torque falls steeply with the tip speed ratio: that of solid, slow blades does.

    Parameters
    ----------
    task : Task
        At some speeds of the flow.

    Yields
    ------
    StartingPoint
    """
    law, shape, optimum = task.physics.law, task.physics.shape, task.optimum
    if law.torque_limit is None or not shape.designs_chord:
        return
    ratio = SOLID_BLADE.ratio * optimum.tip_speed_ratio
    best = task.physics.rotor.best_blade(shape, ratio, optimum.blade).blade
    for width in SOLID_BLADE.widths:
        blade = shape.nearest(replace(best, chord=width * best.chord))
        torque = task.steady.curves(blade).values["torque"]
        held = replace(task.problem, law=OpenLoop(torque_limit=law.torque_limit)).operate(torque)
        demand = np.full(held.rotor_speed.shape, SOLID_BLADE.saturated * law.torque_limit)
        gains = np.clip(law.fit(held.rotor_speed, demand), *gain_bounds(task.physics))
        point = StartingPoint(blade, gains, held, strategy=CONSTANT_TORQUE)
        yield task.steady.in_balance(task.operating(point))


def longer_solid_part(task: Task, point: StartingPoint) -> Iterator[StartingPoint]:
    """Yield a law's point with the solid part of its blade a control point longer, if any.

    A rotor at a constant torque is solid inboard and slender outboard. How many of its control
    points are solid is a choice between optima: none follows from another by small changes.

    Parameters
    ----------
    task : Task
        At some speeds of the flow.
    point : StartingPoint
        Its best.

    Yields
    ------
    StartingPoint
    """
    shape = task.physics.shape
    if not shape.designs_chord:
        return
    chord, twist, *others = (each.copy() for each in shape.control(point.blade))
    jump = chord[1:-2] / chord[2:-1]  # the last one may be as slender as its bounds allow
    if np.max(jump, initial=0.0) < SOLID_BLADE.jump:
        return
    last = 1 + int(np.argmax(jump))
    chord[last + 1] = min(chord[last] ** 2 / chord[last - 1], shape.chord_bounds[1])
    if twist.size == chord.size:
        twist[last + 1] = 2.0 * twist[last] - twist[last - 1]
    blade = shape.nearest(shape.at(chord, twist, *others, point.blade.rotor_radius))
    longer = replace(point, blade=blade, strategy=LONGER)
    yield task.steady.in_balance(task.operating(longer))
