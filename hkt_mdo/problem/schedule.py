"""The start under limits: blade, gains and operating schedule by quasi-steady co-design together.

A schedule is the tip speed ratio over the speed of the flow. Without limits, or with one of the
torque alone, an open loop's schedule follows from the blade (`hkt_mdo.dynamics.quasi_steady`).
Under other limits it has branches: a rotor keeps a limit of its power by turning faster or slower
than where it captures most. Each branch is a local optimum with a blade of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from scipy.optimize import Bounds, minimize

from hkt_mdo.dynamics.laws import STEP
from hkt_mdo.dynamics.limits import SLOWED, TYPICAL, Limit, TorqueLimit
from hkt_mdo.dynamics.quasi_steady import SAFE, Operation, QuasiSteady
from hkt_mdo.dynamics.trajectory import RATES, quantities
from hkt_mdo.problem.physics import START_EXCESS, Physics
from hkt_mdo.problem.start import CoDesign, StartingPoint, start_candidates
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.steady_optimum import SteadyOptimum, best_blade
from hkt_mdo.rotor.torque_curve import TorqueSpline

BRANCHES = {"overspeed": 1, "underspeed": -1}
"""On which side of the ratio of the largest rate each branch keeps the limits."""
KNOTS, FINE = 32, 400  # flow speeds of a schedule that is designed, and of one that is given
THINNED = 2  # nodes of the torque curve to one of the curves of loads
RATIO_MOVE = 1.25  # factor within which tip speed ratios move before they are re-centred
VIOLATION = 1e-6  # relative excess of a limit that counts as none
ROUNDS, MOST = 16, 40  # and iterations of one
ROUGH = 12  # of one that is tightened only in part
TIGHTENED, LOOSE = 0.5, 0.05  # of an excess that is tightened in steps, and one that is not
APART = 0.01  # relative difference between a ratio and that of the designed schedule
SAME = 2e-3  # relative difference of the tip speed ratios of one optimum
GAIN = 1e-7  # relative gain of the objective that is worth another round
BEHIND, LAST = 0.01, 4.0  # of the best objective, and of the last gain: a schedule is given up
SOLID = 0.45  # of the optimum's tip speed ratio: that of the blade for a constant torque
SATURATED = 10.0  # demand over the limit of the torque at which a law's torque is constant


@dataclass(frozen=True, eq=False)
class Curves:
    """Coefficients of a blade over the tip speed ratio, by name: "torque" and loads.

    values[n_nodes] are those at the nodes of a spline. inertia in kg m².
    """

    blade: Blade
    inertia: float
    values: dict[str, np.ndarray]

    @cached_property
    def table(self) -> np.ndarray:
        """The values of all, (n_nodes, n_names)."""
        return np.stack(list(self.values.values()), axis=1)


@dataclass(frozen=True, eq=False)
class SteadyFlow:
    """Steady operation of a case's rotor at some speeds of its flow.

    speeds[n] (m/s) and weights[n] (s): the objective is the sum of weights times rates. spline is
    over the tip speed ratio.
    """

    physics: Physics
    spline: TorqueSpline
    speeds: np.ndarray
    weights: np.ndarray

    @classmethod
    def of(cls, physics: Physics, spline: TorqueSpline, knots: int = KNOTS) -> SteadyFlow:
        """Take the flows of a case; a rate over v³ is linear between the speeds of two knots."""
        scenarios = physics.scenarios
        speed = np.concatenate([each.inflow.speed_at(each.samples) for each in scenarios])
        weights = np.concatenate([each.weight * each.sample_weights for each in scenarios])
        low, high = float(np.min(speed)), float(np.max(speed))
        if high - low < 1e-9 * high:
            return cls(physics, spline, np.array([high]), np.array([np.sum(weights)]))
        speeds = np.linspace(low, high, knots)
        place = np.clip((speed - low) / (speeds[1] - low), 0.0, knots - 1.0)
        below = np.minimum(place.astype(int), knots - 2)
        share, cubes = place - below, weights * speed**3
        sums = np.bincount(below, cubes * (1.0 - share), knots)
        sums += np.bincount(below + 1, cubes * share, knots)
        return cls(physics, spline, speeds, sums / speeds**3)

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """The limits that a schedule keeps."""
        return _kept(self.physics)

    def curves(self, blade: Blade) -> Curves:
        """Return the curves of a blade."""
        physics, nodes = self.physics, self.spline.nodes
        values = {"torque": bem.rotor_coefficients(blade, physics.polar, nodes).torque}
        loads = physics.loads.coefficients(blade, nodes, names=physics.load_names)
        for name, load in loads.items():
            values[name] = load.envelope(physics.loads.exponent).values
        return Curves(blade, physics.mass_and_inertia(blade)[1], values)

    def coefficients(self, curves: Curves, ratio) -> dict:
        """Return what the quantities of steady operation follow from, at tip speed ratios."""
        radius, inertia = curves.blade.rotor_radius, curves.inertia
        found = {"ratio": ratio, "rotor_radius": radius, "inertia": inertia}
        all_values, _ = self.spline.values(curves.table, ratio)
        return found | dict(zip(curves.values, all_values.T, strict=True))

    def known(self, coefficients: dict, flow=None) -> dict:
        """Return the quantities of a trajectory in steady operation, and the design's scalars."""
        flow, physics = self.speeds if flow is None else flow, self.physics
        ratio, radius = coefficients["ratio"], coefficients["rotor_radius"]
        torque = torque_scale(physics.density, radius, flow) * coefficients["torque"]
        speed = ratio * flow / radius
        both = torque, torque  # of the flow and of the generator
        found = quantities(np.zeros(flow.shape), flow, speed, *both, radius, physics.generator)
        for name in physics.load_names:
            if name in coefficients:
                found[name] = 0.5 * physics.density * flow**2 * coefficients[name]
        scalars = {"density": physics.density, "inertia": coefficients["inertia"]}
        return found | {"rotor_radius": radius} | scalars

    def met(self, curves: Curves, ratio, flow=None) -> dict:
        """Return what `known` does of curves at tip speed ratios."""
        return self.known(self.coefficients(curves, ratio), flow)

    def excess(self, known: dict) -> np.ndarray:
        """Return by how much the limits are exceeded at most, relatively; -inf without limits."""
        over = np.full(known["time"].size, -np.inf)
        for limit in self.limits:
            over = np.maximum(over, limit.excess(known))
        return over

    def at(self, curves: Curves, ratio) -> tuple[np.ndarray, np.ndarray]:
        """Return the objective's rates, W, at tip speed ratios, and the excess of the limits."""
        known = self.met(curves, ratio)
        return self.physics.objective.rate_of(known), self.excess(known)

    def at_nodes(self, curves: Curves) -> tuple[np.ndarray, np.ndarray]:
        """Return what `at` does at all nodes of the spline, of shape (n, n_nodes)."""
        nodes, n = self.spline.nodes, self.speeds.size
        flow = np.repeat(self.speeds, nodes.size)
        known = self.met(curves, np.tile(nodes, n), flow)
        rate = self.physics.objective.rate_of(known)
        return rate.reshape(n, -1), self.excess(known).reshape(n, -1)

    def ratios(self, curves: Curves, branch: str) -> np.ndarray:
        """Return the tip speed ratios of a branch of an open loop at the speeds of the flow.

        That of the largest rate where it keeps the limits; else the next one on the branch's side
        that does; where none does, that of the smallest excess.
        """
        nodes = self.spline.nodes
        rate, over = self.at_nodes(curves)
        peak = np.clip(np.argmax(rate, axis=1), 1, nodes.size - 2)
        found = self._largest(curves, nodes[peak - 1], nodes[peak + 1])
        order = np.arange(nodes.size)[:: BRANCHES[branch]]  # of the search, from either end
        beyond = (nodes[order] - found[:, None]) * BRANCHES[branch] > 0.0
        kept = beyond & (over[:, order] <= 0.0)
        least = np.argmin(np.where(beyond, over[:, order], np.inf), axis=1)
        has, first = kept.any(axis=1), np.argmax(kept, axis=1)
        before = np.maximum(nodes[order[first - 1]] * BRANCHES[branch], found * BRANCHES[branch])
        broken = self.at(curves, found)[1] > 0.0
        inside = np.where(has, nodes[order[first]], nodes[order[least]])
        outside = np.where(has, before * BRANCHES[branch], inside)
        inside, outside = (np.where(broken, each, found) for each in (inside, outside))
        for _ in range(30 * np.any(broken)):  # bisection to where the limits begin to hold
            middle = 0.5 * (inside + outside)
            broken = self.excess(self.met(curves, middle)) > 0.0
            inside, outside = np.where(broken, inside, middle), np.where(broken, middle, outside)
        return inside

    def _largest(self, curves, low, high):
        """Return the tip speed ratios of the largest rate between others (golden section)."""
        share = 0.5 * (np.sqrt(5.0) - 1.0)

        def rate(ratio):
            return self.physics.objective.rate_of(self.met(curves, ratio))

        for _ in range(20):
            width = share * (high - low)
            left, right = high - width, low + width
            lower = rate(left) > rate(right)
            low, high = np.where(lower, low, left), np.where(lower, right, high)
        return 0.5 * (low + high)


@dataclass(frozen=True, eq=False)
class Schedule:
    """A blade, gains and tip speed ratios over the speeds of a `SteadyFlow`.

    objective in J; excess is the largest of any limit, relatively, and of the control law's balance
    of torques and its distance from stall. tried is the number of schedules that it is the best of.
    """

    branch: str
    blade: Blade
    gains: np.ndarray
    ratio: np.ndarray
    objective: float
    excess: float
    tried: int = 1

    @property
    def worth(self) -> tuple[bool, float]:
        """What ranks schedules: those that keep the limits by objective, the others by excess."""
        kept = self.excess <= VIOLATION
        return kept, self.objective if kept else -self.excess

    def same_as(self, other: Schedule) -> bool:
        """Tell whether this is the same optimum as another."""
        close = np.allclose(self.ratio, other.ratio, rtol=SAME)
        return close and np.allclose(self.blade.chord, other.blade.chord, rtol=10.0 * SAME)


class Joint:
    """Objective and constraints over one vector: the design's unknowns, then the ratios.

    Under a law with states there are none of these: the ratios follow from its gains.
    """

    def __init__(self, steady: SteadyFlow, design: CoDesign, slowed: float):
        self.steady, self.design, self.slowed = steady, design, slowed

    def vector(self, schedule):
        """Return the unknowns of a schedule, their units, and how far they may move."""
        x, units = self.design.vector(schedule)
        ratio = schedule.ratio[: 0 if self.steady.physics.states else None]
        moves = ratio / RATIO_MOVE, ratio * RATIO_MOVE
        ends = zip(self.design.bounds(x), moves, strict=True)
        low, high = (np.concatenate(each) for each in ends)
        return np.r_[x, ratio], np.r_[units, ratio], low, high

    def split(self, z):
        """Return the design's unknowns, the ratios, and their slopes by all unknowns."""
        steady, law, n = self.steady, self.steady.physics.law, self.steady.speeds.size
        if not steady.physics.states:
            return z[:-n], z[-n:], np.eye(n, z.size, z.size - n)
        gains, radius = self.design.gains(z), self.design.blade(z).rotor_radius
        speed = law.speed_at_rest(steady.speeds, gains)
        by = np.zeros((n, z.size))
        by[:, z.size - gains.size :] = law.speed_at_rest_by_gain(steady.speeds, gains).T
        stations = np.zeros((1, self.design.blade(z).r.size))
        by_radius = self.design.by_unknowns(*3 * (stations,), np.ones(1))
        by[:, : z.size - gains.size] = speed[:, None] / radius * by_radius
        return z, speed * radius / steady.speeds, by * (radius / steady.speeds)[:, None]

    def values(self, z):
        """Return objective, equalities = 0 and inequalities >= 0, each with its slopes."""
        steady, design = self.steady, self.design
        physics, law = steady.physics, steady.physics.law
        x, ratio, own = self.split(z)
        here = self._coefficients(x, ratio, own, physics.load_names)
        rooms = [partial(_room, limit) for limit in steady.limits]
        (rate, rate_by), *above = self._chained([physics.objective.rate_of, *rooms], *here)
        nothing = np.empty(0), np.empty((0, z.size))
        equal, above = [nothing], [nothing, *above]
        if law is not None and not physics.states:
            gains, share = design.gains(x), 1.0 - self.slowed

            def unit(known):
                radius, flow = known["rotor_radius"], known["inflow_speed"]
                return TYPICAL * torque_scale(known["density"], radius, flow)

            def net(known):  # torque that accelerates the rotor, over a typical one
                torque = law.torque(known["rotor_speed"], gains)
                return (known["hydrodynamic_torque"] - torque) / unit(known)

            slowed = self._coefficients(x, share * ratio, share * own, ())
            for rows, at, least in ((equal, here, 0.0), (above, slowed, SAFE)):
                ((value, by),) = self._chained([net], *at)
                known = steady.known(at[0])
                by_gains = law.torque_by_gain(known["rotor_speed"], gains) / unit(known)
                by[:, x.size - gains.size : x.size] -= by_gains.T
                rows.append((value - least, by))
        weights = steady.weights
        return float(weights @ rate), weights @ rate_by, *_stacked(equal), *_stacked(above)

    def _chained(self, functions, values, slopes):
        """Return the values of functions of the known quantities, and their slopes.

        `values` and `slopes` are those of coefficients; the step between is complex.
        """
        steady, ones = self.steady, np.ones(self.steady.speeds.size)
        known = steady.known(values)
        found = [np.real(each(known)) * ones for each in functions]
        total = [0.0] * len(functions)
        for name, by in slopes.items():
            moved = steady.known(values | {name: values[name] + 1j * STEP})
            for place, each in enumerate(functions):
                total[place] += (np.imag(each(moved)) / STEP * ones)[:, None] * by
        return list(zip(found, total, strict=True))

    def _coefficients(self, x, ratio, own, names):
        """Return torque, named loads and what else quantities follow from at tip speed ratios.

        And their slopes by all unknowns; `own` has those of the ratios.
        """
        design, physics, blade = self.design, self.steady.physics, self.design.blade(x)
        none, density = np.zeros((1, blade.r.size)), physics.case.rotor.blade_material.density

        def by_all(by, by_ratio=0.0):  # by chord, twist, thickness and radius
            by = design.by_unknowns(*by)
            rest = np.zeros((len(by), own.shape[1] - by.shape[1]))
            return np.hstack((by, rest)) + np.reshape(by_ratio, (-1, 1)) * own

        mass = mass_and_inertia(blade, physics.section_area, density)
        values = {
            "ratio": ratio,
            "rotor_radius": blade.rotor_radius,
            "inertia": physics.mass_and_inertia(blade)[1],
        }
        by = mass.inertia_by_chord[None], none, mass.inertia_by_thickness[None]
        slopes = {
            "ratio": own,
            "rotor_radius": by_all((*3 * [none], np.ones(1)))[:1],
            "inertia": by_all((*by, np.array([3.0 * mass.inertia / blade.rotor_radius])))[:1],
        }
        found = bem.rotor_coefficients(blade, physics.polar, ratio, derivatives=True)
        values["torque"] = found.torque
        by = found.torque_by_chord, found.torque_by_twist, found.torque_by_thickness
        by = *by, found.torque_by_rotor_radius
        slopes["torque"] = by_all(by, found.torque_by_tip_speed_ratio)
        loads = physics.loads.coefficients(blade, ratio, True, names) if names else {}
        for name, load in loads.items():
            found = load.envelope(physics.loads.exponent)
            by = found.by_chord, found.by_twist, found.by_thickness, found.by_rotor_radius
            values[name] = found.values
            slopes[name] = by_all(by, found.by_tip_speed_ratio)
        return values, slopes


def _stacked(rows):
    """Return the values and the slopes of some rows of constraints, one after another."""
    values, slopes = zip(*rows, strict=True)
    return np.concatenate(values), np.vstack(slopes)


def _room(limit, known):
    """Return by how much a limit is kept, over its bound."""
    return 1.0 - limit.value_of(known) / limit.upper


def needed(physics: Physics) -> bool:
    """Tell whether a start needs a schedule: for limits but torque's, or a law that follows it."""
    follows = physics.law is not None and (physics.states or physics.law.coarser() is not None)
    return bool(follows) or _has_branches(physics)


def _has_branches(physics: Physics) -> bool:
    """Tell whether a case has limits that several schedules keep: others than torque's."""
    return any(not isinstance(each, TorqueLimit) for each in _kept(physics))


def _kept(physics: Physics) -> tuple[Limit, ...]:
    """Return the limits that a schedule keeps: those over time that the optimization constrains.

    Those of rates are none: a schedule has no time.
    """
    control = physics.case.control

    def constrains(limit):  # a torque limit is held by a law's saturation
        if RATES.keys() & set(limit.inputs):
            return False
        saturates = physics.law is not None and not physics.states
        return limit.constrains(control) or (isinstance(limit, TorqueLimit) and not saturates)

    return tuple(each for each in physics.limits if each.caps_series and constrains(each))


def quasi_steady(physics: Physics, optimum: SteadyOptimum, slowed: float = SLOWED) -> QuasiSteady:
    """Return the quasi-steady problem of a case over all its scenarios' flows."""
    scenarios = physics.scenarios
    return QuasiSteady(
        np.concatenate([each.inflow.speed_at(each.samples) for each in scenarios]),
        np.concatenate([each.weight * each.sample_weights for each in scenarios]),
        physics.density,
        physics.blade.rotor_radius,
        TorqueSpline(np.linspace(0.3, 2.6, 161) * optimum.tip_speed_ratio),
        physics.law,
        physics.torque_limit,
        slowed,
        physics.starting_generator,
    )


def schedules(
    physics: Physics, problem: QuasiSteady, optimum: SteadyOptimum, *, improve: bool
) -> tuple[Schedule, ...]:
    """Return the schedule of each branch, the best first.

    `problem` has the whole flow, `optimum` is that of the blades to choose from. Without `improve`,
    blade and gains are as given. A feedback law has the branches of the open loops that its gains
    are fitted to; a branch that leads to another's optimum is left out. Of a branch that is given
    up, far behind the other, the objective is what it had reached.
    """
    if physics.load_names:  # loads cost more than torque
        problem = replace(problem, spline=TorqueSpline(problem.spline.nodes[::THINNED]))
    steady = SteadyFlow.of(physics, problem.spline)
    few = replace(problem, inflow_speed=steady.speeds, weights=steady.weights)
    law, gains = physics.law, physics.law.starting_gains() if physics.law else None
    gain_bounds = physics.case.design.gain_bounds or (-np.inf, np.inf)
    free = replace(few, law=None, torque_limit=physics.torque_limit)
    open_loop = replace(steady, physics=replace(physics, law=None))

    def candidates(of, gains=None):
        found = start_candidates(of, physics.shape, gains, physics.polar, optimum, gain_bounds)
        return list(found) if improve else [next(found)]

    def improved(flow, of, best, others):
        design = CoDesign(of, physics.shape, physics.polar, gain_bounds)
        rival = max((each.objective for each in others if each.worth[0]), default=-np.inf)
        return _improve(Joint(flow, design, of.slowed), best, rival) if improve else best

    coarser = law.coarser() if law is not None and improve and gains is None else None
    found, tried = [], 0
    if coarser is not None:
        simple = replace(physics, law=coarser), replace(problem, law=coarser)
        found = list(schedules(*simple, optimum, improve=True))
        tried = found[0].tried
    else:
        starts = candidates(free)
        for branch in BRANCHES:
            best = max((_along(open_loop, start, branch) for start in starts), key=_worth)
            tried += len(starts)
            found.append(improved(open_loop, free, best, found))
            starts.append(StartingPoint(found[-1].blade, np.empty(0), starts[0].operation))
    if law is not None:
        # what has several gains, or follows a schedule, is near the best where it is fitted
        alone = bool(physics.states) or (improve and gains is None and len(law.gain_units) > 1)
        own = [] if alone else [_along(steady, start, "") for start in candidates(few, gains)]
        begun = [_begun(steady, few, each) for each in found] if improve or alone else []
        tried += len(own) + len(begun)
        begun = [*sorted(own, key=_worth)[-1:], *begun]
        if improve and not alone and law.torque_limit is not None and physics.shape.designs_chord:
            begun.insert(0, _along(steady, _at_constant_torque(steady, few, optimum), ""))
            tried += 1
        found = []
        for each in begun:
            found.append(_met(steady, few, improved(steady, few, each, found)))
    found = [replace(each, branch=_side(steady, each), tried=tried) for each in found]
    found.sort(key=_worth, reverse=True)
    others = [each for each in found[1:] if each.branch != found[0].branch]
    others = [each for each in others[:1] if not each.same_as(found[0])]
    return (found[0], *others)


def _begun(steady, problem, schedule) -> Schedule:
    """Return a law's schedule with the blade of an open loop's, as near to that as it comes."""
    if steady.physics.states:
        return _following(steady, schedule)
    return _along(steady, _fitted(steady, problem, schedule), "")


def _following(steady, schedule) -> Schedule:
    """Return the schedule of a law with states whose gains follow that of an open loop."""
    law, curves, speeds = steady.physics.law, steady.curves(schedule.blade), steady.speeds
    gains, unit = law.starting_gains(), schedule.blade.rotor_radius / speeds
    if gains is None:
        known = steady.met(curves, schedule.ratio)
        slope = steady.spline.values(curves.values["torque"], schedule.ratio)[1] * unit
        slope *= torque_scale(known["density"], known["rotor_radius"], speeds)
        gains = law.follow(speeds, known["rotor_speed"], known["hydrodynamic_torque"], slope)
    ratio = law.speed_at_rest(speeds, gains) * unit
    rate, over = steady.at(curves, ratio)
    value, excess = float(steady.weights @ rate), float(np.max(over))
    return replace(schedule, gains=gains, ratio=ratio, objective=value, excess=excess)


def _met(steady, problem, schedule) -> Schedule:
    """Return a law's schedule, or that which the rotor meets where it is another.

    A law may have several equilibria in a flow: the rotor comes to the fastest, after a run-up.
    """
    if steady.physics.states:
        return schedule
    table = steady.curves(schedule.blade).values["torque"]
    problem = replace(problem, rotor_radius=schedule.blade.rotor_radius)
    operation = problem.operate(table, schedule.gains)
    real = _along(steady, StartingPoint(schedule.blade, schedule.gains, operation), "")
    same = operation.running and np.allclose(real.ratio, schedule.ratio, rtol=APART)
    return schedule if same else real


def _fitted(steady, problem, schedule) -> StartingPoint:
    """Return a law's starting point whose gains are fitted to the schedule of an open loop."""
    physics, curves = steady.physics, steady.curves(schedule.blade)
    known = steady.met(curves, schedule.ratio)
    gains = physics.law.fit(known["rotor_speed"], known["hydrodynamic_torque"])
    gains = np.clip(gains, *(physics.case.design.gain_bounds or (-np.inf, np.inf)))
    problem = replace(problem, rotor_radius=schedule.blade.rotor_radius)
    return StartingPoint(schedule.blade, gains, problem.operate(curves.values["torque"], gains))


def _at_constant_torque(steady, problem, optimum) -> StartingPoint:
    """Return a law's starting point at its torque limit, with a solid blade for a slow rotor.

    At a constant torque the power is proportional to the rotor speed, which varies little with the
    flow if the torque falls steeply with the tip speed ratio: that of solid, slow blades does.
    """
    physics, law = steady.physics, steady.physics.law
    shape, ratio = physics.shape, SOLID * optimum.tip_speed_ratio
    bounds = shape.chord_bounds, shape.twist_bounds
    blade = best_blade(shape.blade, physics.polar, ratio, *bounds, optimum.blade).blade
    blade = shape.nearest(blade)
    torque = steady.curves(blade).values["torque"]
    held = replace(problem, law=None, torque_limit=law.torque_limit).operate(torque)
    demand = np.full(held.rotor_speed.shape, SATURATED * law.torque_limit)
    gains = law.fit(held.rotor_speed, demand)
    gains = np.clip(gains, *(physics.case.design.gain_bounds or (-np.inf, np.inf)))
    return StartingPoint(blade, gains, problem.operate(torque, gains))


def _side(steady, schedule) -> str:
    """Return the branch of a schedule: where its blade works in the fastest flow."""
    nodes = steady.spline.nodes
    flow = replace(steady, speeds=steady.speeds[-1:], weights=steady.weights[-1:])
    rate, _ = flow.at_nodes(flow.curves(schedule.blade))
    best = nodes[np.argmax(rate)]
    return "overspeed" if schedule.ratio[-1] >= best else "underspeed"


def start_of(physics: Physics, problem: QuasiSteady, found: tuple[Schedule, ...]) -> StartingPoint:
    """Return the first of some schedules as a starting point over the whole flow."""
    best = found[0]
    steady = SteadyFlow.of(physics, problem.spline, FINE)
    curves, flow = steady.curves(best.blade), problem.inflow_speed
    if physics.law is not None:
        whole = replace(problem, rotor_radius=best.blade.rotor_radius)
        if physics.states:
            operation = whole.held(
                curves.values["torque"], physics.law.speed_at_rest(flow, best.gains)
            )
        else:
            operation = whole.operate(curves.values["torque"], best.gains)
    else:
        coarse = SteadyFlow.of(physics, problem.spline).speeds
        guide = np.interp(steady.speeds, coarse, best.ratio)
        sides = np.array([steady.ratios(curves, branch) for branch in BRANCHES])
        nearest = np.argmin(np.abs(sides - guide), axis=0)
        exact = sides[nearest, np.arange(guide.size)]
        # where limits leave a single ratio, the search on a grid does not meet it, or another one
        over, least = steady.at(curves, exact)[1], steady.at(curves, guide)[1]
        far = np.abs(exact / guide - 1.0) > APART
        closed = (over > np.maximum(least, VIOLATION)) | (far & (least <= START_EXCESS))
        ratio = np.interp(flow, steady.speeds, np.where(closed, guide, exact))
        known = steady.met(curves, ratio, flow)
        speed, torque = known["rotor_speed"], known["hydrodynamic_torque"]
        operation = Operation(float(problem.weights @ (torque * speed)), speed, torque)
    branches = found if _has_branches(physics) else ()
    return StartingPoint(best.blade, best.gains, operation, branches, best.tried)


def _worth(schedule):
    return schedule.worth


def _along(steady: SteadyFlow, start: StartingPoint, branch: str) -> Schedule:
    """Return a starting point's blade and gains with the schedule of a branch, or of its law."""
    curves = steady.curves(start.blade)
    if branch:
        ratio = steady.ratios(curves, branch)
    else:
        ratio = start.operation.rotor_speed * start.blade.rotor_radius / steady.speeds
    rate, over = steady.at(curves, ratio)
    excess = float(np.max(over)) if start.operation.running else np.inf
    value = float(steady.weights @ rate)
    return Schedule(branch, start.blade, start.gains, ratio, value, excess)


def _improve(joint: Joint, best: Schedule, rival: float = -np.inf) -> Schedule:
    """Improve a schedule by SLSQP within move limits, re-centred until nothing is gained.

    Limits that it exceeds by much are tightened in steps: each round begins near what it asks for.
    A schedule that remains far behind the objective of a rival is given up.
    """
    design = joint.design
    slack = best.excess if np.isfinite(best.excess) else 1.0
    for _ in range(ROUNDS):
        slack = TIGHTENED * slack if slack > LOOSE else 0.0
        center, units, low, high = joint.vector(best)
        reference = max(abs(best.objective), 1e-9)
        low, high = low / units, high / units
        z = _solve(joint, center / units, low, high, units, reference, slack) * units
        x, ratio, _ = joint.split(z)
        value, _, equal, _, above, _ = joint.values(z)
        excess = float(max(np.max(-above, initial=-np.inf), np.max(np.abs(equal), initial=-np.inf)))
        better = replace(
            best,
            blade=design.blade(x),
            gains=design.gains(x),
            ratio=ratio,
            objective=value,
            excess=excess,
        )
        kept, objective = best.worth
        if slack == 0.0 and better.worth <= (kept, objective + GAIN * abs(objective)):
            break
        gained, missing = better.objective - best.objective, rival - better.objective
        best = better
        if missing > max(BEHIND * abs(rival), LAST * gained):
            break
    return best


def _solve(joint, start, low, high, units, objective, slack):
    """Return the unknowns over their units with the largest objective that keeps the limits.

    The limits may be exceeded by the slack.
    """

    @lru_cache(maxsize=2)
    def at(z):
        return joint.values(np.array(z) * units)

    def of(place, slack=0.0):
        return {
            "fun": lambda z: at(tuple(z))[place] + slack,
            "jac": lambda z: at(tuple(z))[place + 1] * units,
        }

    scale = -100.0 / objective
    constraints = [{"type": "ineq"} | of(4, slack)]
    if joint.steady.physics.law is not None and not joint.steady.physics.states:
        constraints.append({"type": "eq"} | of(2))
    return minimize(
        lambda z: scale * at(tuple(z))[0],
        np.clip(start, low, high),
        jac=lambda z: scale * at(tuple(z))[1] * units,
        method="SLSQP",
        bounds=Bounds(low, high),
        constraints=constraints,
        options={"ftol": 1e-6, "maxiter": ROUGH if slack else MOST},
    ).x
