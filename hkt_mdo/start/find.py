"""The start of one optimization: the best optimum without time from a few blades.

A limit on the power, a load or the speed can be kept by turning faster or slower than where most
is captured (`hkt_mdo.start.steady_flow`): each of these branches is a local optimum with a blade of
its own, and the optimizer does not change from one to the other. So the problem without time
(`hkt_mdo.start.steady`) is optimized from every blade on every branch, and the best is the start.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from hkt_mdo.dynamics.laws import OpenLoop
from hkt_mdo.dynamics.limits import SLOWED
from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.point import Operation, StartingPoint, records
from hkt_mdo.problem.setup import gain_bounds
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.start.quasi_steady import QuasiSteady
from hkt_mdo.start.result import RESULT, design_of_result
from hkt_mdo.start.steady import co_designed, flow_of, without_time
from hkt_mdo.start.steady_flow import BRANCHES, SteadyFlow, has_branches

GIVEN, BEST, FASTER = "blade as given", "best blade", "best blade of a faster rotor"
CONSTANT, FITTED = "solid blade at a constant torque", "law fitted to open loop"
FEW = 2  # gains of a law that cannot follow any schedule
FAST = 1.5  # tip speed ratio of a faster rotor's blade over that of the best one
ALIKE = 2e-4  # relative difference of the objectives of branches of which one is better
FAR_BEHIND = 0.05  # relative difference of the objective beyond which a branch is not tried second
CLOSE = 0.02  # relative difference of rotor speeds of the same equilibrium
LOCAL = (
    "start.method = blade: the optimum is a local one near the given blade, others were not "
    "searched; quasi_steady searches for them"
)
MERIT = attrgetter("merit")


class _Solid(NamedTuple):
    """A solid blade for a constant torque: its tip speed ratio and chord over those of the best one,
    and the demand of a law over its largest torque at which it is constant.
    """

    ratio: float = 0.4
    width: float = 1.7
    demand: float = 10.0


SOLID = _Solid()


class Candidate(NamedTuple):
    """A blade from which the search begins, and gains; None: fitted to its open loop."""

    strategy: str
    blade: Blade
    gains: np.ndarray | None = None


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
    physics: Physics, optimum: SteadyOptimum, *, improve: bool | None = None
) -> StartingPoint:
    """Return the start of an optimization by co-design without time.

    Parameters
    ----------
    physics : Physics
    optimum : SteadyOptimum
        The best blade, and where it works best.
    improve : bool, optional
        False keeps blade and gains as the case gives them; None does as `start` says.

    Returns
    -------
    StartingPoint
        With the outcomes of all candidates (`starts`), and the best of each branch (`branches`).

    Raises
    ------
    InputError
        If `start.from` is no result that the case can begin with.
    """
    messages: tuple[str, ...] = ()
    candidates = [Candidate(GIVEN, physics.shape.blade, physics.law.starting_gains())]
    if improve is not False and physics.case.start.from_ is not None:
        (blade, gains), messages = design_of_result(physics)
        candidates.append(Candidate(RESULT, blade, gains))
    with TemporaryDirectory() as scratch:
        search = Search(physics, optimum, scratch)
        if improves(physics, improve):
            found = search.optima((*candidates, *best_blades(physics, optimum)))
        else:
            found = [search.begin(candidates[-1], branch) for branch in search.branches]
            found.sort(key=MERIT, reverse=True)
            messages += (LOCAL,) if improve is None else ()
    first = {branch: None for branch in search.branches}
    sides = [each for each in found if first.pop(each.branch, 0) is None]
    points = [search.over_time(each) for each in sides]
    kept, named = points[0], len(search.branches) > 1
    tried = [replace(each.record, law=law) for law, each in search.tried]
    return replace(
        kept,
        branches=tuple(points) if named else (),
        starts=records(tried, kept, points if named else ()),
        messages=messages,
    )


def best_blades(physics: Physics, optimum: SteadyOptimum) -> Iterator[Candidate]:
    """Yield the best blade of all, and that of a rotor that turns faster."""
    shape = physics.shape
    yield Candidate(BEST, shape.nearest(optimum.blade))
    if shape.designs_chord:
        ratio = FAST * optimum.tip_speed_ratio
        faster = physics.rotor.best_blade(shape, ratio, optimum.blade, 1e-8).blade
        yield Candidate(FASTER, shape.nearest(faster))


def other_branch(physics: Physics, start: StartingPoint) -> StartingPoint | None:
    """Return the start on a starting point's other branch; None if there is no good one.

    A good one keeps the limits and is not much worse; the case must not have chosen a branch.
    """
    if len(start.branches) < 2:
        return None
    other = start.branches[1]
    kept, objective = other.worth
    if not kept or objective < (1.0 - FAR_BEHIND) * start.branches[0].objective:
        return None
    return replace(other, branches=start.branches[::-1], starts=start.starts)


@dataclass(frozen=True, eq=False)
class Search:
    """The search for a start.

    Attributes
    ----------
    physics : Physics
    optimum : SteadyOptimum
        The best blade, and where it works best.
    scratch : str
        Folder for OpenMDAO's own files.
    tried : list
        Name of the law and point of each optimization so far.
    """

    physics: Physics
    optimum: SteadyOptimum
    scratch: str

    def __post_init__(self):
        object.__setattr__(self, "tried", [])

    @cached_property
    def steady(self) -> Physics:
        """The physics without time."""
        return without_time(self.physics)

    @cached_property
    def _open_loop(self) -> Physics:
        """The same with an open loop, to whose schedule a law is fitted."""
        law = self.physics.law
        free = OpenLoop(torque_limit=law.torque_limit) if law.is_feedback else self.steady.law
        return replace(self.steady, law=free)

    @cached_property
    def _schedules(self) -> SteadyFlow:
        """Schedules of an open loop that keep the limits."""
        free = replace(self.physics, law=self._open_loop.law)
        return SteadyFlow.of(free, QuasiSteady.of(self.physics, self.optimum).spline)

    @cached_property
    def branches(self) -> tuple[str, ...]:
        """The branches on which the limits can be kept."""
        asked = self.physics.case.start.branch
        if not has_branches(self._schedules.physics):
            return ("",)
        if asked != "best":
            return (asked,)
        # where a rotor is slowed below its best speed, a torque that follows from the speed stalls it
        return tuple(BRANCHES)[: 1 if self.physics.law.is_static else None]

    def optima(self, candidates: Sequence[Candidate]) -> list[StartingPoint]:
        """Return the optima without time that are reached from some candidates, the best first."""
        law, found = self.physics.law, []
        several, follows = len(law.gain_units) > 1, bool(law.states) or len(law.gain_units) > FEW
        if law.is_static and not follows:
            found += map(self._optimum, self._at_constant_torque())
        for branch in self.branches:
            # slower than at the best speed, stalled flow makes optimizations long: one is enough
            some = candidates if branch == self.branches[0] else candidates[-2:-1]
            if not follows:
                found += [self._optimum(self.begin(each, branch)) for each in some]
            if follows or (law.is_feedback and several):
                free = [self._scheduled(each.blade, branch) for each in some]
                free = [self._optimum(each, self._open_loop) for each in free]
                guide = max(free, key=MERIT)
                found.append(self._optimum(self._fitted(replace(guide, strategy=FITTED))))
        found.sort(key=MERIT, reverse=True)
        if not law.is_feedback:
            # below the speed of the largest torque, the torque does not hold the speed of a rotor
            value = (1.0 - np.sign(found[0].objective) * ALIKE) * found[0].objective
            alike = (x for x in found if x.branch == "overspeed" and x.merit >= (True, value))
            if (first := next(alike, None)) is not None:
                found = [first, *(each for each in found if each is not first)]
        return found

    def _optimum(self, point: StartingPoint, steady: Physics | None = None) -> StartingPoint:
        """Return the optimum that is reached from a point, and note it."""
        steady = steady or self.steady
        slowed = SLOWED if steady.law.is_static else 0.0
        t0 = time.process_time()
        known = [x.objective for law, x in self.tried if law == steady.law.law and x.worth[0]]
        rival = max(known, default=-np.inf) if point.branch == "underspeed" else -np.inf
        end = co_designed(steady, point, slowed, self.scratch, rival)
        if os.environ.get("SS"):
            print(f"   {steady.law.law:10} {point.strategy:30} {point.branch:10} {end.objective:12.1f} {end.excess:.1e} {end.iterations} its {time.process_time() - t0:.2f} s", flush=True)
        self.tried.append((steady.law.law, end))
        return end

    def begin(self, candidate: Candidate, branch: str) -> StartingPoint:
        """Return where the optimization from a candidate begins, at the speeds of the flow."""
        strategy, blade, gains = candidate
        point = replace(self._scheduled(blade, branch), strategy=strategy)
        if not self.physics.law.is_feedback:
            return point
        return self._fitted(point, gains)

    def _at_constant_torque(self) -> Iterator[StartingPoint]:
        """Yield a solid, slow rotor under the largest torque of a law, if it turns in all flows.

        A law of the speed alone that keeps a limit of the power has two kinds of optima: at a tip
        speed ratio that does not depend on the flow, or at a torque that does not.
        """
        physics, optimum, law = self.physics, self.optimum, self.physics.law
        ratio = SOLID.ratio * optimum.tip_speed_ratio
        slow = physics.rotor.best_blade(physics.shape, ratio, optimum.blade, 1e-8).blade
        blade = physics.shape.nearest(replace(slow, chord=SOLID.width * slow.chord))
        problem = QuasiSteady.of(self.steady, optimum)
        problem = replace(problem, rotor_radius=blade.rotor_radius)
        free = replace(problem, law=OpenLoop(torque_limit=law.torque_limit))
        table = self._table(blade)
        speed = free.operate(table).rotor_speed
        gains = law.fit(speed, np.full(speed.shape, SOLID.demand * law.torque_limit))
        gains = np.clip(gains, *gain_bounds(physics))
        operation = problem.operate(table, gains)
        if operation.running:
            yield StartingPoint(blade, gains, operation, strategy=CONSTANT, branch="overspeed")

    def _scheduled(self, blade: Blade, branch: str) -> StartingPoint:
        """Return a blade with the schedule of an open loop on a branch."""
        guide = self._schedules.on_branch(
            StartingPoint(blade, np.empty(0), None), branch or "overspeed"
        )
        flow = flow_of(self.steady)
        ratio = np.interp(flow, self._schedules.speeds, guide.ratio)
        return replace(
            guide, branch=branch, operation=self._held(blade, ratio * flow / blade.rotor_radius)
        )

    def _held(self, blade: Blade, speed: np.ndarray) -> Operation:
        """Return the operation of a blade at rotor speeds, rad/s, in the flow without time."""
        problem = QuasiSteady.of(self.steady, self.optimum)
        problem = replace(problem, rotor_radius=blade.rotor_radius)
        return problem.held(self._table(blade), speed)

    def _table(self, blade: Blade) -> np.ndarray:
        return self._schedules.curves(blade).values["torque"]

    def _fitted(self, point: StartingPoint, gains: np.ndarray | None = None) -> StartingPoint:
        """Return a point of an open loop with the gains of the law that are closest to it."""
        law, flow, blade = self.physics.law, flow_of(self.steady), point.blade
        speed, torque = point.operation.rotor_speed, point.operation.hydrodynamic_torque
        held = torque - self.physics.generator.friction(speed)
        if gains is None and law.states:
            spline, radius = self._schedules.spline, blade.rotor_radius
            slope = spline.values(self._table(blade), speed * radius / flow)[1]
            slope *= torque_scale(self.physics.density, radius, flow) * radius / flow
            gains = law.follow(flow, speed, held, slope)
        elif gains is None:
            gains = law.fit(speed, held)
        gains = np.clip(gains, *gain_bounds(self.physics))
        if law.states:
            speed = law.speed_at_rest(flow, gains)
        return replace(point, gains=gains, operation=self._held(blade, speed))

    def over_time(self, point: StartingPoint) -> StartingPoint:
        """Return a point with its operation over the whole flow.

        A static law operates at its own equilibria, unless those at the speeds of the point are
        others.
        """
        physics, blade, law = self.physics, point.blade, self.physics.law
        problem = replace(QuasiSteady.of(physics, self.optimum), rotor_radius=blade.rotor_radius)
        table, flow = self._table(blade), flow_of(physics)
        if law.states:
            return replace(point, operation=problem.held(table, law.speed_at_rest(flow, point.gains)))
        speeds, places = [], np.cumsum([each.samples.size for each in self.steady.scenarios])[:-1]
        for scenario, steady, speed in zip(
            physics.scenarios,
            self.steady.scenarios,
            np.split(point.operation.rotor_speed, places),
            strict=True,
        ):
            known = steady.inflow.speed_at(steady.samples)
            own = scenario.inflow.speed_at(scenario.samples)
            speeds.append(np.interp(own, known, speed / known) * own)
        speed = np.concatenate(speeds)
        if law.is_static:
            own = problem.operate(table, point.gains)
            if own.running and np.allclose(own.rotor_speed, speed, rtol=CLOSE):
                return replace(point, operation=own)
        return replace(point, operation=problem.held(table, speed))
