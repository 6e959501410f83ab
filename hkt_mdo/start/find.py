"""The start of one optimization: the best optimum without time from a few blades.

A limit on the power, a load or the speed can be kept by turning faster or slower than where most
is captured (`hkt_mdo.start.steady_flow`): each of these branches is a local optimum with a blade of
its own, and the optimizer does not change from one to the other. So the problem without time
(`hkt_mdo.start.steady`) is optimized from every blade on every branch, and the best is the start.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter

import numpy as np
from scipy.interpolate import PchipInterpolator

from hkt_mdo.dynamics.equilibrium import at_rest
from hkt_mdo.dynamics.laws import Law, OpenLoop
from hkt_mdo.dynamics.limits import SLOWED
from hkt_mdo.problem.evaluation import excesses, objective_at, on_start, split
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import START_EXCESS, StartingPoint, StartRecord, records
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.steady_optimum import SteadyOptimum, nearest_optimum
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.start.result import Candidate, given_designs
from hkt_mdo.start.steady import TIE, co_designed, optimized, without_time
from hkt_mdo.start.steady_flow import BRANCHES, QuasiSteady, SteadyFlow, has_branches, limits_power

BEST = "best blade"
# names, and tip speed ratios over that of the best blade
FASTER, SLOWER = ("best blade of a faster rotor", 1.5), ("best blade of a slower rotor", 0.75)
CONSTANT, FITTED = "solid blade at a constant torque", "law fitted to open loop"
SPECIAL = "optimum of a special case of the law"
# share of its speed that a rotor may lose in the search. With one gain and limits that is made with
# `SLOWED`, too, since the paths lead to other optima: of `make verify PART=turbines` with
# `quadratic` turbine 29 loses 27 % without this one, turbine 11 0.08 % without the other
FARTHER = 0.08
RATIOS = np.linspace(0.3, 2.6, 481)  # nodes of a curve, over the optimum's tip speed ratio
FINE = 400  # speeds of the flow of a schedule that is not optimized
JUMPING = 0.02  # share of the objective by which a branch is better though its torque jumps
# the same by which overspeed may be behind, which gains over time: turbine 3 of `make verify
# PART=turbines` with open loop is 0.3 % behind and ends 1.7 % higher
EVEN = 1e-2
CLOSE = 0.02  # relative difference of rotor speeds of the same equilibrium
SOLID_RATIO, SOLID_WIDTH = 0.4, 1.7  # tip speed ratio and chord over those of the best blade
DEMAND = 10.0  # of a law over its largest torque, at which the torque is constant
SHARES = np.linspace(1.0, 0.5, 11)  # of an open loop's torque, to which gains are fitted
LOCAL = "start.method = blade: a local optimum near the given blade; quasi_steady looks for others"
MERIT = attrgetter("merit")


def find_start(
    physics: Physics,
    optimum: SteadyOptimum | None = None,
    *,
    improve: bool | None = None,
    on_start: Callable[[StartRecord], None] | None = None,
) -> StartingPoint:
    """Return the start of an optimization by co-design without time.

    Parameters
    ----------
    physics : Physics
    optimum : SteadyOptimum, optional
        The best blade, and where it works best; by default, of all that the case allows.
    improve : bool, optional
        False keeps blade and gains as the case, or `start.from`, gives them; None does as `start`
        says.
    on_start : callable, optional
        Called after every optimization of the search, with its outcome.

    Returns
    -------
    StartingPoint
        With the outcomes of all candidates (`starts`), and the best of each branch (`branches`).

    Raises
    ------
    InputError
        If `start.from` is no result that the case can begin with.
    """
    designs, messages = given_designs(physics)
    optimum = optimum or physics.rotor.best_of_shape(physics.shape, physics.blade)
    search = Search(physics, optimum, on_start)
    if improve or (improve is None and physics.case.start.method == "quasi_steady"):
        # under limits a law may end 1.3 % lower without the given blade (turbine 12 of `make verify
        # PART=turbines` with `quadratic`)
        *results, case_design = designs
        tried = physics.law.is_feedback and (has_branches(physics) or case_design.gains is not None)
        candidates = [*best_blades(physics, optimum), *(designs if tried else results)]
        approached = search.simpler is not None and not physics.law.contains(search.simpler)
        if approached and all(candidate.gains is None for candidate in candidates):
            points = [search.of_simpler_law(candidates)]
        else:
            points = search.optima(candidates)
    else:
        points = [search.as_given(designs[0], branch) for branch in search.branches]
        points.sort(key=MERIT, reverse=True)
        messages += (LOCAL,) if improve is None else ()
    branches = tuple(points) if search.branches != ("",) else ()
    starts = records(search.tried, points[0], branches)
    return replace(points[0], messages=messages, branches=branches, starts=starts)


def best_blades(physics: Physics, optimum: SteadyOptimum) -> Iterator[Candidate]:
    """Yield the best blade and, under limits, the best one of another rotor.

    An open loop may keep a limit by turning faster; a law of one gain has better optima where it
    turns slower (0.1 % of turbines 17 and 20 of `make verify PART=turbines` with `quadratic`).
    Without limits that make branches all blades led to one optimum, within 3e-5, in 24 cases of
    eight random turbines.
    """
    shape = physics.shape
    yield Candidate(BEST, shape.nearest(optimum.blade))
    if shape.designs_chord and has_branches(physics):
        name, factor = SLOWER if len(physics.law.gain_units) == 1 else FASTER
        ratio = factor * optimum.tip_speed_ratio
        other = nearest_optimum(optimum.blade, physics.rotor.polar, ratio, shape.bounds, 1e-8)
        # a large rotor, too (6 % of `river25_short` with open loop and a radius of 2 to 3 m)
        yield Candidate(name, shape.nearest(other.blade).with_rotor_radius(shape.radii[1]))


def _jumps(physics: Physics, point: StartingPoint) -> bool:
    """Tell whether the torque of a rotor jumps in its operation, where no optimization converges.

    So it does on the better branch of `river25` with open loop. Without time a rotor never passes a
    jump between two flows.
    """
    pairs = zip(physics.scenarios, on_start(physics, point), strict=True)
    ratios = [series["tip_speed_ratio"] for scenario, series in pairs if not scenario.steady]
    radius = physics.rotor.torque_jump(point.blade, np.concatenate(ratios)) if ratios else None
    return radius is not None


def _ties(points: Sequence[StartingPoint]) -> list[StartingPoint]:
    """Return the best, by their merit, and those that tie with it, in their order."""
    feasible, value = max(map(MERIT, points))
    return [point for point in points if point.merit >= (feasible, value - TIE * abs(value))]


@dataclass(frozen=True, eq=False)
class Search:
    """The search for a start.

    Attributes
    ----------
    physics : Physics
    optimum : SteadyOptimum
        The best blade, and where it works best.
    on_start : callable or None
        As `find_start` takes it.
    tried : list of StartRecord
        The outcome of each optimization so far.
    """

    physics: Physics
    optimum: SteadyOptimum
    on_start: Callable[[StartRecord], None] | None = None
    tried: list[StartRecord] = field(default_factory=list)

    @cached_property
    def steady(self) -> Physics:
        """The physics without time."""
        return without_time(self.physics)

    @cached_property
    def _open_loop(self) -> Physics:
        """The same with an open loop, to whose schedule a law is fitted."""
        law = self.steady.law
        free = OpenLoop(torque_limit=law.largest_torque) if law.is_feedback else law
        return replace(self.steady, law=free)

    @cached_property
    def _schedules(self) -> SteadyFlow:
        """Schedules of an open loop that keep the limits."""
        free = replace(self.physics, law=self._open_loop.law)
        return SteadyFlow.of(free, TorqueSpline(RATIOS * self.optimum.tip_speed_ratio))

    @cached_property
    def branches(self) -> tuple[str, ...]:
        """The branches on which the limits can be kept, the first one by which to begin."""
        asked = self.physics.case.start.branch
        if not has_branches(self._schedules.physics):
            return ("",)
        if asked != "best":
            return (asked,)
        # slower than at its best speed a rotor stalls if its torque follows from the speed
        return tuple(BRANCHES)[: 1 if self.physics.law.is_static else None]

    @cached_property
    def simpler(self) -> Law | None:
        """A simpler law under a limit of the power, from whose optimum the case's law begins."""
        return self.physics.law.simpler if limits_power(self.physics) else None

    @property
    def _one_gain(self) -> bool:
        """Whether the law has one gain, with which a rotor has several optima under limits."""
        law = self.physics.law
        return law.is_static and len(law.gain_units) == 1 and self.branches != ("",)

    def optima(self, candidates: Sequence[Candidate]) -> list[StartingPoint]:
        """Return the best optimum of each branch over the whole flow, the best first.

        A law of one gain is optimized from every blade. One of several gains, or with states, can
        nearly follow an open loop, and is optimized from each of these, and from the optimum of a
        simpler law that it contains (3.7 % of `power_law` in the sine with 5 kW). On a second
        branch the flow is stalled, which makes optimizations long: one blade is enough.
        """
        law, ends = self.physics.law, []
        follows = bool(law.states) or len(law.gain_units) > 1
        for branch in self.branches:
            chosen = candidates if branch == self.branches[0] else candidates[:1]
            direct = [x for x in chosen if not follows or (x.gains is not None and law.is_static)]
            ends += [self._optimum(self._begin(candidate, branch)) for candidate in direct]
            for design in chosen if follows else ():
                begin = replace(self._scheduled(design.blade, branch), strategy=design.strategy)
                guide = self._optimum(begin, self._open_loop)
                if law.is_static and guide.branch != branch:
                    # it has left the branch that the law can hold: 33 % of turbine 16 of `make
                    # verify PART=turbines` with `rated`
                    guide = begin
                ends.append(self._optimum(self._fitted(replace(guide, strategy=FITTED), None)))
        if self.simpler is not None and law.contains(self.simpler):
            begin = self._optimum_of_simpler_law(candidates[:1])
            speed = begin.operation.rotor_speed
            gains = law.fit(speed, self.simpler.demand(speed, begin.gains))
            operation = self._quasi_steady(begin.blade, self.steady).operate(gains)
            if operation.running:
                begin = replace(begin, strategy=SPECIAL, gains=gains, operation=operation)
                ends.append(self._optimum(begin))
        # last, since rivals end it: its curve may have 1,700 nodes (`two_flows`)
        ends += map(self._optimum, self._at_constant_torque())
        ends.sort(key=MERIT, reverse=True)
        branches = dict.fromkeys(end.branch for end in ends)
        best = [self._heaviest([x for x in ends if x.branch == name]) for name in branches]
        best = list(map(self._over_time, best))
        return sorted(best, key=self._rank, reverse=True) if len(best) > 1 else best

    def of_simpler_law(self, candidates: Sequence[Candidate]) -> StartingPoint:
        """Return the optimum over time under a simpler law, which the law nearly contains.

        Limits are kept on a branch that the law can hold, and the rotor moves with its inertia. An
        open loop's optimum is often on the other branch, and without time a law of many gains has
        optima that it cannot reach in gusts (turbines 10, 14 and 16 of `make verify PART=turbines`
        with `curve`, which did not converge; 2 % of the energy of turbine 1).

        It begins with the simpler law's operation, or with its own where it differs from that law
        by more torque than accelerates the rotor (4 knots on a given blade, 5 kW: not converged).
        """
        law, simpler = self.physics.law, self.simpler
        begin = self._optimum_of_simpler_law(candidates)
        physics = replace(self.steady, law=simpler, scenarios=self.physics.scenarios)
        end, *_ = optimized(physics, begin, free=True)
        self._noted(simpler.law, end)
        # in equilibrium a heavy rotor has a wider range of speeds
        speed = np.concatenate([x.operation.rotor_speed for x in (begin, end)])
        gains = law.fit(speed, simpler.demand(speed, end.gains))
        problem, speed = self._quasi_steady(end.blade), end.operation.rotor_speed
        others = law.torque(speed, gains), problem.generator_torque(speed)
        missed, moving = (np.sum(np.abs(x - simpler.torque(speed, end.gains))) for x in others)
        own = problem.operate(gains) if missed > moving else end.operation
        return replace(end, gains=gains, operation=own if own.running else end.operation)

    def _optimum_of_simpler_law(self, candidates: Sequence[Candidate]) -> StartingPoint:
        """Return the best optimum without time under the simpler law, in the whole flow."""
        search = replace(self, physics=replace(self.physics, law=self.simpler))
        return replace(search.optima(candidates)[0], strategy=f"law fitted to {self.simpler.law}")

    def _rank(self, end: StartingPoint) -> tuple[bool, float]:
        """Return the merit of a branch; over time overspeed is better where they are nearly even.

        One whose torque jumps must be much better, since optimizations seldom converge there.
        """
        feasible, value = end.merit
        first = end.branch == "overspeed" and not all(x.steady for x in self.physics.scenarios)
        share = EVEN * first - JUMPING * _jumps(self.physics, end)
        return feasible, value + share * abs(value)

    def _heaviest(self, optima: list[StartingPoint]) -> StartingPoint:
        """Return the heaviest rotor of the optima that tie with the best.

        Inertia has no effect without time. Over time it keeps limits in gusts: of three blades that
        tie under a limit of the power in turbulence, the heaviest leads to 5 % more energy.
        """
        return max(_ties(optima), key=lambda end: self.physics.rotor.mass_and_inertia(end.blade)[1])

    def as_given(self, candidate: Candidate, branch: str) -> StartingPoint:
        """Return a candidate as it is, in operation over the whole flow."""
        point = self._begin(candidate, branch, self.physics)
        if self.physics.law.is_static:
            problem = self._quasi_steady(candidate.blade)
            # near the peak it may stall
            for share in SHARES if candidate.gains is None else (1.0,):
                scaled_gains = self.physics.law.scaled_gains(point.gains, share)
                operation = problem.operate(scaled_gains)
                if operation.running and problem.recovers(scaled_gains, operation):
                    break
            point = replace(point, gains=scaled_gains, operation=operation)
            point = self._on_its_side(point, self.physics) if operation.running else point
        return self._noted(self.physics.law.law, self._evaluated(point))

    def _evaluated(self, point: StartingPoint) -> StartingPoint:
        """Return a point with the objective and the excess of its operation in the whole flow."""
        model = replace(self.physics, objective=self.physics.start_objective)
        limited = [limit.name for limit in self._schedules.limits]
        over = {name: x for name, (x, _) in excesses(model, point).items() if name in limited}
        exceeds = tuple(name for name, x in over.items() if x > START_EXCESS)
        excess = max(over.values(), default=-np.inf) if point.operation.running else np.inf
        return replace(point, objective=objective_at(model, point), excess=excess, exceeds=exceeds)

    def _noted(self, law: str, end: StartingPoint) -> StartingPoint:
        """Return the end of an optimization under a law, noted."""
        outcome = end.strategy, end.branch, end.objective, end.excess, end.exceeds
        self.tried.append(StartRecord(*outcome, law=law))
        if self.on_start is not None:
            self.on_start(self.tried[-1])
        return end

    def _optimum(self, point: StartingPoint, steady: Physics | None = None) -> StartingPoint:
        """Return the optimum that is reached from a point, by default under the case's law."""
        steady = steady or self.steady
        law, rivals = steady.law.law, [-np.inf]
        if point.branch != self.branches[0] or point.strategy == CONSTANT:
            rivals += [x.objective for x in self.tried if x.law == law and x.excess <= START_EXCESS]
        shares = [SLOWED] * self._one_gain + [FARTHER]
        ends = [co_designed(steady, point, max(rivals), share) for share in shares]
        return self._noted(law, self._on_its_side(_ties(ends)[0], steady))

    def _on_its_side(self, point: StartingPoint, physics: Physics) -> StartingPoint:
        """Return a point with the branch on which it is: it may have left that of its schedule."""
        if not point.branch:
            return point
        flow, _ = physics.sampled_flow
        fastest, radius = int(np.argmax(flow)), point.blade.rotor_radius
        ratio = point.operation.rotor_speed[fastest] * radius / flow[fastest]
        return replace(point, branch=self._schedules.side(point.blade, ratio))

    def _begin(self, by: Candidate, branch: str, over: Physics | None = None) -> StartingPoint:
        """Return where the optimization from a candidate begins, by default without time."""
        point = replace(self._scheduled(by.blade, branch, over), strategy=by.strategy)
        return self._fitted(point, by.gains, over) if self.physics.law.is_feedback else point

    def _at_constant_torque(self) -> Iterator[StartingPoint]:
        """Yield a solid, slow rotor under the largest torque of a law, if it turns in all flows.

        A law of one gain has two kinds of optima under limits: at a tip speed ratio that does not
        depend on the flow, or at a torque that does not.
        """
        physics, law = self.physics, self.physics.law
        if not (self._one_gain and law.torque_limit and physics.shape.designs_chord):
            return
        ratio = SOLID_RATIO * self.optimum.tip_speed_ratio
        best, polar, bounds = self.optimum.blade, physics.rotor.polar, physics.shape.bounds
        slow = nearest_optimum(best, polar, ratio, bounds, 1e-8).blade
        blade = physics.shape.nearest(replace(slow, chord=SOLID_WIDTH * slow.chord))
        problem = self._quasi_steady(blade, self.steady)
        speed = ratio * problem.inflow_speed / blade.rotor_radius
        gains = physics.bounded(law.fit(speed, np.full(speed.shape, DEMAND * law.torque_limit)))
        operation = problem.operate(gains)
        if operation.running:
            yield StartingPoint(blade, gains, operation, branch=self.branches[0], strategy=CONSTANT)

    def _scheduled(self, blade: Blade, branch: str, over: Physics | None = None) -> StartingPoint:
        """Return a blade with an open loop's schedule, by default in the flow without time."""
        over, tip_speed = over or self.steady, []
        for scenario in over.scenarios:
            fine, flow = self._schedules.within(scenario, FINE), scenario.speeds
            ratio = fine.ratios(blade, branch or "overspeed")
            tip_speed.append(_smooth(flow, fine.speeds, ratio) * flow)
        speed = np.concatenate(tip_speed) / blade.rotor_radius
        operation = self._quasi_steady(blade, over).held(speed)
        return StartingPoint(blade, np.empty(0), operation, branch=branch)

    def _quasi_steady(self, blade: Blade, over: Physics | None = None) -> QuasiSteady:
        """Return the operation of a blade, by default in the whole flow."""
        table, _ = self._schedules.curves(blade)
        curve = self._schedules.spline.curve(table[:, 0])
        return QuasiSteady.of(over or self.physics, blade, curve)

    def _fitted(
        self, point: StartingPoint, gains: np.ndarray | None, over: Physics | None = None
    ) -> StartingPoint:
        """Return a point of an open loop with gains of the law, by default the closest ones."""
        law, problem = self.physics.law, self._quasi_steady(point.blade, over or self.steady)
        speed, flow = point.operation.rotor_speed, problem.inflow_speed
        held = point.operation.hydrodynamic_torque - problem.plant.generator.friction(speed)
        if gains is None and law.states:
            gains = law.follow(flow, speed, held, problem.plant.torque_slope(speed, flow))
        elif gains is None:
            gains = law.fit(speed, held / self.physics.case.condition.torque_constant)
        gains = self.physics.bounded(gains)
        if not law.states:
            return replace(point, gains=gains)
        (speed, *states), _ = at_rest(law, gains, flow, problem.generator_torque)
        return replace(point, gains=gains, operation=problem.held(speed, states))

    def _over_time(self, point: StartingPoint) -> StartingPoint:
        """Return a point with its operation over the whole flow.

        An open loop follows the schedule of the blade, which keeps limits between the speeds of the
        point as well. A static law operates at its own equilibria, unless those at these speeds are
        others: a law may have several in a flow, and over time it begins at the one chosen. One
        with states begins with these, and at these speeds.
        """
        physics, law = self.physics, self.physics.law
        if not law.is_feedback:
            whole = self._scheduled(point.blade, point.branch, physics)
            return replace(point, operation=whole.operation)
        problem = self._quasi_steady(point.blade)
        parts, pairs = [], zip(physics.scenarios, self.steady.scenarios, strict=True)
        designed = split(self.steady, point.operation)
        for (scenario, steady), (speed, _, *states) in zip(pairs, designed, strict=True):
            flow, values = scenario.speeds, (speed / steady.speeds, *states)
            ratio, *states = (_smooth(flow, steady.speeds, series) for series in values)
            parts.append((ratio * flow, *states))
        speed, *states = np.concatenate(parts, axis=1)
        if law.is_static:
            operation = problem.operate(point.gains)
            if operation.running and np.allclose(operation.rotor_speed, speed, rtol=CLOSE):
                return replace(point, operation=operation)
        return replace(point, operation=problem.held(speed, states))


def _smooth(flow: np.ndarray, speeds: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values at rising speeds of the flow, (n,), between these without jumps of the slope.

    A jump would be one of the rotor's acceleration.
    """
    if speeds.size == 1:
        return np.full(flow.shape, values[0])
    return PchipInterpolator(speeds, values)(np.clip(flow, speeds[0], speeds[-1]))
