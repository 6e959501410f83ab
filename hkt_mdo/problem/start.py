"""The feasible start of an optimization: co-design of blade and gains in quasi-steady operation."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import Bounds, minimize

from hkt_mdo.dynamics.quasi_steady import SAFE, Operation
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.stall import SLOWER, stall_fence
from hkt_mdo.rotor.steady_optimum import best_blade

# Tip speed ratios, over that of the steady optimum, whose best blades are candidates: downwards and
# upwards, each search beginning at the blade found before.
RATIOS = np.geomspace(0.93, 0.75, 3), np.geomspace(1.04, 2.0, 7)
# A start moves within these limits, which are re-centred until they are inactive.
CHORD_MOVE, RADIUS_MOVE, GAIN_MOVE = 1.3, 1.1, 1.2
TWIST_MOVE, THICKNESS_MOVE = np.deg2rad(3.0), 0.02
TWIST_UNIT, THICKNESS_UNIT = np.deg2rad(5.0), 0.03  # typical changes


@dataclass(frozen=True, eq=False)
class StartingPoint:
    """Where an optimization begins: a blade, gains, and their quasi-steady operation.

    branches has the `Schedule` of each branch, its own first, where limits ask for one. tried is
    the number of starts that it is the best of, or was improved from: blades, each with gains or a
    schedule.
    """

    blade: Blade
    gains: np.ndarray
    operation: Operation
    branches: tuple = ()
    tried: int = 1

    @property
    def branch(self) -> str:
        """Name of its branch; empty where there are none."""
        return self.branches[0].branch if self.branches else ""


def starting_point(
    problem, shape, gains, polar, optimum, *, improve, gain_bounds=(-np.inf, np.inf)
):
    """Return a start near the optimum, found by quasi-steady co-design from a blade.

    Candidates are the blade as given and, where its shape is designed, the steady-optimal blades of
    a range of tip speed ratios; the best of them under the controller is improved by gradient steps
    within move limits.

    `optimum` is the `SteadyOptimum` of the blades that the shape gives to choose from, at the given
    radius. Gains that are None are fitted to the blade, within `gain_bounds`. Without `improve`,
    blade and gains are as given.
    """
    if not improve:
        return _with_gains(problem, shape.blade, polar, gains, gain_bounds)
    few = problem.condensed()
    candidates = list(start_candidates(few, shape, gains, polar, optimum, gain_bounds))
    best = max(candidates, key=lambda each: _worth(each.operation))
    best = _improve(CoDesign(few, shape, polar, gain_bounds), best)
    whole = replace(problem, rotor_radius=best.blade.rotor_radius)
    operation = whole.operate(_torque(whole, best.blade, polar), best.gains)
    return replace(best, operation=operation, tried=len(candidates))


def start_candidates(problem, shape, gains, polar, optimum, gain_bounds):
    """Yield starting points: of the blade as given, and of blades for other tip speed ratios."""
    yield _with_gains(problem, shape.blade, polar, gains, gain_bounds)
    bounds = shape.chord_bounds, shape.twist_bounds
    for ratios in RATIOS if shape.designs_chord else ():
        blade = optimum.blade
        for ratio in ratios * optimum.tip_speed_ratio:
            blade = best_blade(shape.blade, polar, ratio, *bounds, blade, tolerance=1e-8).blade
            yield _with_gains(problem, shape.nearest(blade), polar, None, gain_bounds)


def _worth(operation):
    """Return what ranks operations: one that runs, then one that recovers, then its energy."""
    # The optimizer of the start meets its constraints only to within rounding.
    return operation.running, bool(np.all(operation.margin >= SAFE - 1e-6)), operation.delivered


def _torque(problem, blade, polar):
    """Return the torque coefficient table of a blade."""
    return bem.rotor_coefficients(blade, polar, problem.spline.nodes).torque


def _with_gains(problem, blade, polar, gains, bounds):
    """Return a starting point of a blade; gains not given are fitted to its open loop in bounds."""
    table, law = _torque(problem, blade, polar), problem.law
    if law is None:
        return StartingPoint(blade, np.empty(0), problem.operate(table))
    if gains is not None:
        return StartingPoint(blade, np.asarray(gains, dtype=float), problem.operate(table, gains))
    # A quarter of the instants is enough to rank gains.
    few = replace(problem, inflow_speed=problem.inflow_speed[::4], weights=problem.weights[::4])
    ideal = replace(few, law=None, torque_limit=law.torque_limit).operate(table)
    fitted = law.fit(ideal.rotor_speed, ideal.hydrodynamic_torque)
    tried = [np.clip(law.eased(fitted, share), *bounds) for share in np.linspace(0.6, 1.1, 11)]
    gains = max(tried, key=lambda each: _worth(few.operate(table, each)))
    return StartingPoint(blade, gains, problem.operate(table, gains))


class CoDesign:
    """Operation over one vector of unknowns: control of the shape, disc radius, gains.

    The shape's are those of chord, twist and thickness.
    """

    def __init__(self, problem, shape, polar, gain_bounds):
        self.problem, self.shape, self.polar = problem, shape, polar
        self._resized = shape.radius_bounds is not None
        n_gains = 0 if problem.law is None else len(problem.law.gain_units)
        sizes = [*shape.points.values(), self._resized, n_gains]
        self._ends = np.cumsum(sizes[:-1])
        own = shape.chord_bounds, shape.twist_bounds, shape.thickness_bounds
        own = *own, shape.radius_bounds or (0.0, 0.0), gain_bounds
        self._own = np.repeat(own, sizes, axis=0).T
        # moves are by factors, or by steps
        self._factor = np.repeat([CHORD_MOVE, 1.0, 1.0, RADIUS_MOVE, 1.0], sizes)
        self._step = np.repeat([0.0, TWIST_MOVE, THICKNESS_MOVE, 0.0, 0.0], sizes)
        self._unit = np.repeat([0.0, TWIST_UNIT, THICKNESS_UNIT, 0.0, 0.0], sizes)

    def vector(self, point):
        """Return the unknowns of a starting point, and their units."""
        radius = [point.blade.rotor_radius] * self._resized
        x = np.concatenate((*self.shape.control(point.blade), radius, point.gains))
        x = np.clip(x, *self._own)
        units = np.where(self._unit > 0.0, self._unit, np.abs(x))
        if self.problem.law is not None:
            units[self._ends[-1] :] = self.problem.law.sizes(self.gains(x))
        return x, units

    def bounds(self, x):
        """Return the lower and upper limits of moves from x, within the design's own bounds."""
        ends = np.sort((x / self._factor, x * self._factor), axis=0)
        ends = np.where(self._step > 0.0, (x - self._step, x + self._step), ends)
        if self.problem.law is not None:
            ends[:, self._ends[-1] :] = self.problem.law.moves(self.gains(x), GAIN_MOVE)
        return np.clip(ends, *self._own)

    def blade(self, x):
        """Return the blade of some unknowns."""
        *control, radius, _ = np.split(x, self._ends)
        return self.shape.at(*control, radius[0] if self._resized else None)

    def gains(self, x):
        """Return the gains among the unknowns."""
        return x[self._ends[-1] :]

    def by_unknowns(self, by_chord, by_twist, by_thickness, by_radius):
        """Return derivatives by the unknowns, gains aside, from those by the stations' shape.

        They are of shape (n, n_stations) each and (n,), the last by the disc's radius.
        """
        shape = self.shape
        if not shape.designs_chord:  # the chord is scaled with the disc
            by_radius = by_radius + by_chord @ shape.chord_offset / shape.blade.rotor_radius
        parts = [by_chord @ shape.chord_basis, by_twist @ shape.twist_basis]
        if shape.designs_thickness:
            parts.append(by_thickness @ shape.thickness_basis)
        return np.hstack((*parts, by_radius[:, None][:, : self._resized]))

    def evaluate(self, x):
        """Return the starting point at x; derivatives of `delivered` and margins, row by row."""
        blade, gains = self.blade(x), self.gains(x)
        problem = replace(self.problem, rotor_radius=blade.rotor_radius)
        found = bem.rotor_coefficients(blade, self.polar, problem.spline.nodes, derivatives=True)
        state = problem.operate(found.torque, gains)
        by_table, by_gain, by_radius = np.split(state.gradient, [found.torque.size, -1], axis=1)
        by_radius = by_radius[:, 0] + by_table @ found.torque_by_rotor_radius
        by_shape = found.torque_by_chord, found.torque_by_twist, found.torque_by_thickness
        parts = *(by_table @ each for each in by_shape), by_radius
        return StartingPoint(blade, gains, state), np.hstack((self.by_unknowns(*parts), by_gain))

    def room(self, point):
        """Return the function of x with the room below a point's `StallFence`, and its slopes."""
        shape, problem = self.shape, self.problem
        ratio = point.operation.rotor_speed / problem.inflow_speed * point.blade.rotor_radius
        ratio = float(np.min(ratio))
        fence = stall_fence(self.polar, shape, point.blade, ratio)

        def at(x):
            slopes = np.zeros((fence.stations.size, x.size))
            if not fence.stations.size:
                return np.empty(0), slopes
            blade = self.blade(x)
            found = bem.angles_of_attack(blade, self.polar, SLOWER * ratio)
            angle, _, by_chord, by_twist = (each[fence.stations] for each in found)
            ends = self._ends
            slopes[:, : ends[0]] = -by_chord[:, None] * shape.chord_basis[fence.stations]
            slopes[:, ends[0] : ends[1]] = -by_twist[:, None] * shape.twist_basis[fence.stations]
            if self._resized:  # only the chord over the radius matters
                by_radius = by_chord * blade.chord[fence.stations] / blade.rotor_radius
                slopes[:, ends[2] : ends[3]] = by_radius[:, None]
            return (fence.highest - angle) / TWIST_UNIT, slopes / TWIST_UNIT

        return at


def _improve(design, point):
    """Raise the quasi-steady energy by SLSQP within move limits, re-centred until inactive."""
    for _ in range(12):
        center, units = design.vector(point)
        if not center.size:
            return point
        room = design.room(point)
        low, high = design.bounds(center) / units
        found = _maximize(design, room, center / units, low, high, units, point.operation.energy)
        better, _ = design.evaluate(found * units)
        attached, after = (bool(np.all(room(x)[0] > -1e-6)) for x in (center, found * units))
        *sound, energy = _worth(point.operation)
        if (after, *_worth(better.operation)) <= (attached, *sound, energy * (1.0 + 1e-7)):
            break
        point = better
    return point


def _maximize(design, room, start, low, high, units, energy):
    """Return the unknowns, over their units, of the largest energy with a safe recovery."""

    @lru_cache(maxsize=1)
    def at(x):
        point, gradients = design.evaluate(np.array(x) * units)
        return point.operation, gradients * units

    def loss(x):
        state, gradients = at(tuple(x))
        # The line search turns away from a point without equilibrium.
        value = state.delivered - (0.0 if state.running else 0.5 * state.energy)
        scale = -100.0 / max(energy, 1e-9)
        return scale * value, scale * gradients[0]

    distance = {
        "type": "ineq",
        "fun": lambda x: at(tuple(x))[0].margin - SAFE,
        "jac": lambda x: at(tuple(x))[1][1:],
    }
    constraints = [] if design.problem.law is None else [distance]
    if room(start * units)[0].size:
        constraints.append(
            {
                "type": "ineq",
                "fun": lambda x: room(x * units)[0],
                "jac": lambda x: room(x * units)[1] * units,
            }
        )
    return minimize(
        loss,
        np.clip(start, low, high),
        jac=True,
        method="SLSQP",
        bounds=Bounds(low, high),
        constraints=constraints,
        options={"ftol": 1e-9, "maxiter": 100},
    ).x
