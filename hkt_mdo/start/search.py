"""The search for a start: candidates of several strategies, the best of which are improved.

A schedule is the tip speed ratio over the speed of the flow. Without limits, or with one of the
torque alone, an open loop's schedule follows from the blade (`hkt_mdo.start.quasi_steady`). Under
other limits it has branches (`hkt_mdo.start.steady_flow`). Each is a local optimum with a blade of
its own (`hkt_mdo.start.limited`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import groupby
from operator import attrgetter

import numpy as np

from hkt_mdo.dynamics.laws import OpenLoop
from hkt_mdo.problem.physics import START_EXCESS, Physics
from hkt_mdo.problem.point import KEPT_EXCESS, Operation, StartingPoint, StartRecord, records
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.start import strategies
from hkt_mdo.start.energy import EnergySearch
from hkt_mdo.start.improve import improve, improve_widely
from hkt_mdo.start.limited import LimitedSearch
from hkt_mdo.start.quasi_steady import QuasiSteady
from hkt_mdo.start.steady_flow import BRANCHES, SteadyFlow, has_branches
from hkt_mdo.start.strategies import Candidate, Task


@dataclass(frozen=True)
class _Schedule:
    """Constants of schedules.

    `fine`: flow speeds of one that is given to the optimization. `thinned`: nodes of the torque
    curve to one of the curves of loads, which cost more. `apart`: relative difference between a
    tip speed ratio and that of the designed schedule from which it is another equilibrium. `same`:
    relative difference of the ratios of one optimum, a tenth of that of the chords. `alike`: least
    relative difference of the objectives of branches of which one is better. `longer`: relative
    gain of the objective that makes a longer solid part worthwhile. `others`: how many more
    candidates are improved where all have left a branch, one of `apart_by` in their order.
    """

    fine: int = 400
    thinned: int = 2
    apart: float = 0.01
    same: float = 2e-3
    alike: float = 2e-4
    longer: float = 1e-5
    others: int = 2
    apart_by: int = 2


SCHEDULE, MERIT = _Schedule(), attrgetter("merit")


def follows_schedule(physics: Physics) -> bool:
    """Tell whether a start needs a schedule: for limits but torque's, or a law that follows it."""
    follows = physics.states or physics.law.coarser() is not None
    return bool(follows) or has_branches(physics)


def largest_energy(task: Task) -> StartingPoint:
    """Return the start without limits but the torque's: the best candidate, improved."""
    physics, problem = task.physics, task.problem
    search = EnergySearch(physics, problem.condensed() if task.improves else problem)
    tried = [strategies.with_gains(physics, search.problem, each) for each in task.candidates]
    chosen = sorted(tried, key=search.rank, reverse=True)[: task.effort]
    ends = {id(point): improve(search, point) if task.improves else point for point in chosen}
    end = max(ends.values(), key=search.rank)
    tried = [ends.get(id(point), point) for point in tried]
    starts = [replace(point.record, law=physics.law.law) for point in tried]
    gained = Candidate(end.strategy, end.blade, end.gains)
    whole = strategies.with_gains(physics, problem, gained)
    return replace(whole, starts=records(starts, end))


class ScheduleSearch:
    """The search under limits, or of a law that follows a schedule.

    Parameters
    ----------
    task : Task

    Attributes
    ----------
    task : Task
        At some speeds of the case's flow.
    starts : list of StartRecord
        The outcomes of the candidates tried so far.
    """

    def __init__(self, task: Task):
        self._whole, self.physics, spline = task, task.physics, task.problem.spline
        if task.physics.load_names:  # loads cost more than torque
            spline = TorqueSpline(spline.nodes[:: SCHEDULE.thinned])
        self.steady = SteadyFlow.of(task.physics, spline)
        flow = {"inflow_speed": self.steady.speeds, "weights": self.steady.weights}
        problem = replace(task.problem, spline=spline, **flow)
        self.task = replace(task, problem=problem, steady=self.steady)
        self.starts: list[StartRecord] = []

    def ends(self) -> list[StartingPoint]:
        """Return the best point of each branch, the best first.

        A feedback law has the branches of the open loops to which its gains are fitted; a branch
        that leads to another's optimum is left out. A branch that is much worse is given up and
        keeps the objective that it had reached. Between equally good ones, open loop begins with
        overspeed, since below the speed of the largest torque its torque does not hold the speed.
        """
        feedback = self.physics.law.is_feedback
        found = self.open_loop() if not feedback else self._of_law()
        found = [replace(point, branch=self.steady.side(point)) for point in found]
        best, *others = sorted(found, key=MERIT, reverse=True)
        faster = [x for x in others if x.branch == "overspeed" and self._is_alike(x, best)]
        if faster and best.branch != "overspeed" and not feedback:
            best, others = faster[0], [best]
        others = [point for point in others if point.branch != best.branch][:1]
        return [best, *(point for point in others if not _is_same(point, best))]

    def _is_alike(self, point, best) -> bool:
        """Tell whether a point may be as good as the best once its rotor moves.

        A quasi-steady objective does not contain the energy that a rotor stores and returns.
        """
        unsure = max(SCHEDULE.alike * abs(best.objective), *map(self._exchanged, (point, best)))
        kept, value = best.merit
        return point.merit >= (kept, value - unsure)

    def _exchanged(self, point) -> float:
        """Return the energy that a point's rotor stores and returns along the flows, J."""
        inertia, radius = self.physics.mass_and_inertia(point.blade)[1], point.blade.rotor_radius
        total = 0.0
        for scenario in self.physics.scenarios:
            flow = scenario.inflow.speed_at(scenario.samples)
            speed = np.interp(flow, self.steady.speeds, point.ratio) * flow / radius
            total += scenario.weight * 0.5 * inertia * float(np.sum(np.abs(np.diff(speed**2))))
        return total

    def open_loop(self) -> list[StartingPoint]:
        """Return the improved candidates of open loop on each branch."""
        points = [self._operating(candidate) for candidate in self.task.candidates]
        found: list[StartingPoint] = []
        for branch in BRANCHES:
            about = {"operation": points[0].operation, "strategy": strategies.OTHER_BRANCH}
            others = [replace(end, **about) for end in found]
            ended: list[StartingPoint] = []
            for _, group in groupby((*points, *others), key=attrgetter("strategy")):
                # each may have its own optimum
                group = [self.steady.on_branch(point, branch) for point in group]
                ended.append(self._best_improved(group, (*found, *ended)))
            found.append(max(self._on_side(branch, points, ended), key=MERIT))
        return found

    def _on_side(self, branch, points, ended) -> list[StartingPoint]:
        """Return the points that ended on a branch, or reach it from others, if any.

        Where all candidates have ended on the other branch, the best one is improved widely, and
        some of those that have not been tried are improved too. If none of them stays on the branch
        either, the ends on the other one are returned.
        """
        there = [end for end in ended if self.steady.side(end) == branch]
        if there or not self.task.improves:
            return there or ended
        begin = [self.steady.on_branch(point, branch) for point in points]
        first, *others = sorted(begin, key=MERIT, reverse=True)
        others = others[self.task.effort :: SCHEDULE.apart_by][: SCHEDULE.others]
        ends = [
            end
            for end in self._improved([first, *others], first=improve_widely)
            if end.excess <= START_EXCESS
        ]
        return [end for end in ends if self.steady.side(end) == branch] or ended

    def _of_law(self) -> list[StartingPoint]:
        """Return the improved candidates of a feedback law."""
        law, task, given = self.physics.law, self.task, self.task.candidates[0].gains
        free = task.improves and given is None
        # a law with several gains, or a schedule, is near its best when it is fitted
        follows = bool(self.physics.states) and (task.improves or given is None)
        fitted_only = follows or (free and len(law.gain_units) > 1)
        if fitted_only:
            known = [each for each in task.candidates[1:] if each.gains is not None]
            groups = [[self._own(candidate)] for candidate in known]
        else:
            solid = strategies.constant_torque(task) if task.improves else ()
            groups = [[each] for each in solid]
            groups.append([self._own(candidate) for candidate in task.candidates])
        if task.improves or fitted_only:
            guides, strategy = self._guides(law.coarser() if free else None)
            groups += [[strategies.fitted(self.task, guide, strategy)] for guide in guides]
        found: list[StartingPoint] = []
        for group in filter(None, groups):
            found.append(self._best_improved(group, found))
        return found if fitted_only or not task.improves else self._with_longer_solid_part(found)

    def _guides(self, coarser):
        """Return points to whose schedules a law is fitted, and the name of the strategy."""
        other = ScheduleSearch(
            self._whole.under(coarser or OpenLoop(torque_limit=self.physics.law.torque_limit))
        )
        guides = other.open_loop() if coarser is None else other.ends()
        self.starts += other.starts
        running = [point for point in guides if point.excess < np.inf] or guides[:1]
        return running, strategies.FITTED if coarser is None else strategies.COARSER

    def _with_longer_solid_part(self, found):
        """Return points, with the best of them given a longer solid part while that is better."""
        best = max(found, key=MERIT)
        while longer := list(strategies.longer_solid_part(self.task, best)):
            end, (kept, value) = self._best_improved(longer, found), best.merit
            if end.merit <= (kept, value + SCHEDULE.longer * abs(value)):
                break
            found = [*found, best := end]
        return found

    def _operating(self, candidate):
        return strategies.with_gains(self.physics, self.task.problem, candidate)

    def _own(self, candidate) -> StartingPoint:
        """Return a law's point of a candidate, with the schedule of its own gains."""
        law, (strategy, blade, gains) = self.physics.law, candidate
        if not self.physics.states:
            return self.steady.in_balance(self._operating(candidate))
        speeds = self.steady.speeds
        ratio = law.speed_at_rest(speeds, gains) * (blade.rotor_radius / speeds)
        point = StartingPoint(blade, gains, None, strategy=strategy)
        return self.steady.on_schedule(point, ratio)

    def _best_improved(self, points, others) -> StartingPoint:
        """Return the best of some points when they are improved; the others are its rivals.

        Improved are the best ones, as many as `start.effort` says.
        """
        ranked, effort = sorted(points, key=MERIT, reverse=True), self.task.effort
        asked = self.physics.case.start.branch != "best"  # which is not given up
        rivals = [x.objective for x in others if x.excess <= START_EXCESS and not asked]
        ends = self._improved(ranked[:effort], max(rivals, default=-np.inf))
        self._note(*ranked[effort:])
        return max(ends, key=MERIT)

    def _improved(self, points, rival=-np.inf, first=improve) -> list[StartingPoint]:
        """Return points improved, the first one by a function of its own, and note them."""
        if self.task.improves:
            search = LimitedSearch(self.steady, self.task.problem.slowed)
            ways = first, *[improve] * len(points)
            points = [way(search, *x, rival) for way, *x in zip(ways, points, strict=False)]
        if self.physics.law.is_static:
            points = [self._fastest(point) for point in points]
        self._note(*points)
        return points

    def _note(self, *points) -> None:
        """Add points to the outcomes of the search."""
        self.starts += [replace(point.record, law=self.physics.law.law) for point in points]

    def _fastest(self, point) -> StartingPoint:
        """Return a law's point, or that of its fastest equilibrium where this counts or is better.

        A law may have several equilibria in a flow. In a steady scenario the rotor is at the
        fastest; over time it begins at the one that is chosen. Its operation is the fastest one.
        """
        operating = self.task.operating(point)
        real = self.steady.in_balance(operating)
        point = replace(point, operation=operating.operation)
        if operating.operation.running and _is_close(real.ratio, point.ratio):
            return point
        steady = any(scenario.steady for scenario in self.physics.scenarios)
        return real if steady else max(point, real, key=MERIT)


def start_of(
    physics: Physics,
    problem: QuasiSteady,
    found: list[StartingPoint],
    starts: Iterable[StartRecord],
) -> StartingPoint:
    """Return the first of some points as the start over the whole flow.

    Parameters
    ----------
    physics : Physics
    problem : QuasiSteady
        Over the whole flow.
    found : list of StartingPoint
        That of each branch, the one to begin with first.
    starts : iterable of StartRecord
        Of all candidates.

    Returns
    -------
    StartingPoint
    """
    best, law = found[0], physics.law
    steady = SteadyFlow.of(physics, problem.spline, SCHEDULE.fine)
    curves = steady.curves(best.blade)
    whole = replace(problem, rotor_radius=best.blade.rotor_radius)
    if not law.is_feedback:
        operation = _on_exact_schedule(steady, whole, best)
    elif physics.states:
        speed = law.speed_at_rest(problem.inflow_speed, best.gains)
        operation = whole.held(curves.values["torque"], speed)
    else:
        operation = _of_static_law(steady, whole, best)
    branches = tuple(found) if has_branches(physics) else ()
    about = {"branch": best.branch if branches else "", "branches": branches}
    return replace(best, operation=operation, starts=records(starts, best, branches), **about)


def _of_static_law(steady, problem, best) -> Operation:
    """Return a static law's operation: at its fastest equilibria, unless others were designed."""
    table = steady.curves(best.blade).values["torque"]
    coarse, radius = SteadyFlow.of(steady.physics, steady.spline).speeds, problem.rotor_radius
    if _is_close(best.operation.rotor_speed * radius / coarse, best.ratio):
        return problem.operate(table, best.gains)
    flow = problem.inflow_speed
    speed = np.interp(flow, coarse, best.ratio) * flow / radius
    return problem.held(table, speed)


def _on_exact_schedule(steady, problem, best) -> Operation:
    """Return open loop's operation that keeps the limits at many speeds of the flow.

    Its schedule has been designed at few.
    """
    coarse, curves = SteadyFlow.of(steady.physics, steady.spline).speeds, steady.curves(best.blade)
    guide = np.interp(steady.speeds, coarse, best.ratio)
    sides = np.array([steady.ratios(curves, branch) for branch in BRANCHES])
    nearest = np.argmin(np.abs(sides - guide), axis=0)
    exact = sides[nearest, np.arange(guide.size)]
    # if limits allow a single ratio, the search on a grid misses it or finds another one
    over, least = (steady.excess(steady.along(curves, ratio)) for ratio in (exact, guide))
    far = np.abs(exact / guide - 1.0) > SCHEDULE.apart
    closed = (over > np.maximum(least, KEPT_EXCESS)) | (far & (least <= START_EXCESS))
    flow = problem.inflow_speed
    ratio = np.interp(flow, steady.speeds, np.where(closed, guide, exact))
    series = steady.along(curves, ratio, flow)
    speed, torque = series["rotor_speed"], series["hydrodynamic_torque"]
    return Operation(float(problem.weights @ (torque * speed)), speed, torque)


def _is_close(ratio: np.ndarray, other: np.ndarray) -> bool:
    """Tell whether tip speed ratios, or rotor speeds, are of the same equilibria."""
    return np.allclose(ratio, other, rtol=SCHEDULE.apart)


def _is_same(point: StartingPoint, other: StartingPoint) -> bool:
    """Tell whether two points are the same optimum."""
    close = np.allclose(point.ratio, other.ratio, rtol=SCHEDULE.same)
    chords = point.blade.chord, other.blade.chord
    return close and np.allclose(*chords, rtol=10.0 * SCHEDULE.same)
