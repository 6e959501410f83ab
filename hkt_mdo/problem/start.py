"""The feasible start of an optimization: quasi-steady co-design.

The rotor's time constant is a few hundredths of a second and the flow changes over many seconds, so
the rotor follows Q = u at every instant, on the unstalled side. That problem has no differential
equation, no false solutions and few unknowns (blade and gains); its optimum lies within about 1e-5
of the dynamic one.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import Bounds, minimize, minimize_scalar

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.steady_optimum import best_blade
from hkt_mdo.rotor.torque_curve import TorqueSpline

SLOWED = 0.02  # of its speed that a rotor may lose and still recover from
TYPICAL = 0.05  # torque coefficient
LEAST = 5e-3  # recovery over a typical torque that a trajectory keeps: nearer, stall is too slow
SAFE = 2e-2  # the same of a start: the optimization begins inside
PROBES = 12  # flow speeds at which the distance from stall is looked at
MOST_SPEEDS = 400  # of a flow whose quasi-steady energy is optimized
N_SEARCH = 240  # points of the search for the unstalled root over the torque curve


@dataclass(frozen=True, eq=False)
class Operation:
    """A rotor in quasi-steady operation over a sampled flow.

    Parameters
    ----------
    energy : float, J
    rotor_speed, hydrodynamic_torque : ndarray, shape (n_times,), rad/s and N*m
    by_table : ndarray, shape (n_nodes,), J
        Gradient of the energy with respect to the torque coefficient table.
    by_gain : ndarray, shape (n_gains,), J per gain
    by_radius : float, J/m
        With respect to the disc's radius, the torque coefficient table held.
    running : bool
        Whether an unstalled equilibrium exists at every instant.
    recovery : Recovery or None
        The rotor's distance from stall under feedback; None without it.
    """

    energy: float
    rotor_speed: np.ndarray
    hydrodynamic_torque: np.ndarray
    by_table: np.ndarray
    by_gain: np.ndarray
    by_radius: float
    running: bool
    recovery: "Recovery | None" = None


@dataclass(frozen=True, eq=False)
class Recovery:
    """Torque that speeds a rotor under feedback up again after it was slowed by `SLOWED`.

    margin = Q((1 - SLOWED) w) - u((1 - SLOWED) w) over a typical torque, TYPICAL 0.5 rho pi R³ v²,
    at speeds of the flow from the slowest to the fastest: positive where stable and unstable
    equilibrium, which meet at stall, are apart.

    Parameters
    ----------
    margin : ndarray, shape (n,)
    by_table, by_gain, by_radius : ndarray, shape (n, n_nodes), (n, n_gains), (n, 1)
        Its derivatives along the equilibria.
    """

    margin: np.ndarray
    by_table: np.ndarray
    by_gain: np.ndarray
    by_radius: np.ndarray


@dataclass(frozen=True, eq=False)
class QuasiSteady:
    """Quasi-steady operation of a rotor in a flow under a controller.

    Parameters
    ----------
    inflow_speed, weights : ndarray, shape (n_times,), m/s and s
        The flow at quadrature points of time.
    density : float, kg/m**3
    rotor_radius : float, m
    spline : TorqueSpline
    law : FeedbackLaw or None
        None: open loop, the torque that captures most power at each instant.
    torque_limit : float or None, N*m
        Of the open loop; a feedback law has its own.
    """

    inflow_speed: np.ndarray
    weights: np.ndarray
    density: float
    rotor_radius: float
    spline: TorqueSpline
    law: object = None
    torque_limit: float | None = None

    def condensed(self):
        """Return the same problem at `MOST_SPEEDS` flow speeds or fewer: their order is nothing.

        Instants of nearly one speed become one with their weights and mean speed; the slowest and
        the fastest are kept.
        """
        v = self.inflow_speed
        if v.size <= MOST_SPEEDS:
            return self
        edges = np.linspace(np.min(v), np.max(v), MOST_SPEEDS - 1)
        place = np.clip(np.digitize(v, edges) - 1, 0, MOST_SPEEDS - 3)
        weights = np.bincount(place, self.weights)
        speeds = np.bincount(place, self.weights * v)
        met = weights > 0.0
        return replace(
            self,
            inflow_speed=np.concatenate(([v.min()], speeds[met] / weights[met], [v.max()])),
            weights=np.concatenate(([0.0], weights[met], [0.0])),
        )

    def operate(self, table, gains=()):
        """Return the `Operation` for a torque coefficient table[n_nodes] and gains[n_gains]."""
        v, radius, gains = self.inflow_speed, self.rotor_radius, np.asarray(gains, dtype=float)
        scale = 0.5 * np.pi * radius**3 * self.density * v**2
        curve = CubicSpline(self.spline.nodes, table, bc_type="natural")
        if self.law is None:
            held, ratio, running = self._open_loop(curve, scale)
        else:
            held = np.ones(v.size, dtype=bool)
            ratio, running = self._balance(curve, scale, lambda w: self.law.torque(w, gains))
        w = ratio * v / radius
        basis = self.spline.basis(ratio)
        torque = scale * (basis @ table)
        by_w = scale * (self.spline.basis(ratio, 1) @ table) * radius / v
        if self.law is None:
            slope, by_gains = np.zeros(v.size), np.zeros((0, v.size))
        else:
            slope, by_gains = self.law.torque_by_speed(w, gains), self.law.torque_by_gain(w, gains)
        # Where the controller holds the speed, Q(w) = u(w) moves w; elsewhere w is at the power's
        # maximum.
        stiffness = np.where(held, slope - by_w, np.inf)
        gain_w = (torque + w * by_w) / stiffness  # dP/dw dw/dQ
        by_table = (self.weights * scale * (w + gain_w)) @ basis
        by_gain = -by_gains @ (self.weights * gain_w)
        torque_by_radius = (3.0 * torque + by_w * w) / radius
        return Operation(
            float(self.weights @ (torque * w)),
            w,
            torque,
            by_table,
            by_gain,
            float((self.weights * (w + gain_w)) @ torque_by_radius),
            running,
            self._recovery(table, gains, w, stiffness, torque_by_radius),
        )

    def _recovery(self, table, gains, speed, stiffness, torque_by_radius):
        """Return the `Recovery` of an operation; None for open loop."""
        if self.law is None:
            return None
        order = np.argsort(self.inflow_speed)
        few = order[np.unique(np.linspace(0, order.size - 1, PROBES).round().astype(int))]
        v, w, stiffness = self.inflow_speed[few], speed[few], stiffness[few]
        radius = self.rotor_radius
        scale = 0.5 * np.pi * radius**3 * self.density * v**2
        slowed, ratio = (1.0 - SLOWED) * w, w * radius / v
        basis = self.spline.basis((1.0 - SLOWED) * ratio)
        slope = self.spline.basis((1.0 - SLOWED) * ratio, 1)
        driving, by_w = scale * (basis @ table), scale * (slope @ table) * radius / v
        margin = driving - self.law.torque(slowed, gains)
        by_speed = (1.0 - SLOWED) * (by_w - self.law.torque_by_speed(slowed, gains))
        # the equilibrium itself moves: dw = d(Q - u) / stiffness
        by_equilibrium = (by_speed / stiffness)[:, None]
        held = -self.law.torque_by_gain(w, gains).T
        unit = (TYPICAL * scale)[:, None]
        by_table = scale[:, None] * (basis + by_equilibrium * self.spline.basis(ratio))
        by_radius = ((3.0 * driving + by_w * slowed) / radius)[:, None]
        by_radius += by_equilibrium * torque_by_radius[few][:, None]
        by_radius -= (3.0 * margin / radius)[:, None]  # of the unit
        by_gain = -self.law.torque_by_gain(slowed, gains).T + by_equilibrium * held
        return Recovery(margin / unit[:, 0], by_table / unit, by_gain / unit, by_radius / unit)

    def _open_loop(self, curve, scale):
        """Operate at the largest power coefficient, or faster at the torque limit."""
        ratios = self._search()
        peak = int(np.argmax(ratios * curve(ratios)))
        low, high = ratios[max(peak - 1, 0)], ratios[min(peak + 1, ratios.size - 1)]
        best = minimize_scalar(
            lambda x: -x * float(curve(x)),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-10},
        ).x
        ratio = np.full(scale.size, best)
        held, running = np.zeros(scale.size, dtype=bool), True
        if self.torque_limit is not None:
            held = scale * float(curve(best)) > self.torque_limit
            limited, running = self._balance(
                curve, scale, lambda w: np.full(w.shape, self.torque_limit), held
            )
            ratio = np.where(held, limited, ratio)
        return held, ratio, running

    def _balance(self, curve, scale, controller, needed=True):
        """Find the largest tip speed ratio with Q = u at each instant: the unstalled root."""
        ratios, speed_per_ratio = self._search(), self.inflow_speed / self.rotor_radius
        driving = scale[:, None] * curve(ratios) >= controller(ratios * speed_per_ratio[:, None])
        last = ratios.size - 1 - np.argmax(driving[:, ::-1], axis=1)
        has_root = driving.any(axis=1) & (last < ratios.size - 1)
        low, high = (
            ratios[np.minimum(last, ratios.size - 2)],
            ratios[np.minimum(last + 1, ratios.size - 1)],
        )
        for _ in range(40):  # bisection of a narrow bracket never leaves the branch
            middle = 0.5 * (low + high)
            driven = scale * curve(middle) >= controller(middle * speed_per_ratio)
            low, high = np.where(driven, middle, low), np.where(driven, high, middle)
        return 0.5 * (low + high), bool(np.all(has_root | ~np.asarray(needed)))

    def _search(self):
        return np.linspace(self.spline.nodes[0], self.spline.nodes[-1], N_SEARCH)


@dataclass(frozen=True, eq=False)
class StartingPoint:
    """Where an optimization begins: a blade, gains, and their quasi-steady operation."""

    blade: Blade
    gains: np.ndarray
    operation: Operation


def starting_point(problem, shape, gains, polar, design_ratios, *, improve):
    """Return a start near the optimum, found by quasi-steady co-design from a blade.

    Candidates are the blade as given and, where its shape is designed, the steady-optimal blades of
    a range of tip speed ratios; the best of them under the controller is improved by gradient steps
    within move limits.

    Parameters
    ----------
    problem : QuasiSteady
    shape : Shape
        The blades to choose from, and the one given.
    gains : array, shape (n_gains,), or None
        None: fitted to the blade.
    polar : Polar or sequence of Polar
    design_ratios : array
        Tip speed ratios whose steady-optimal blades are tried.
    improve : bool
        False: the blade and gains as given.

    Returns
    -------
    StartingPoint
    """
    given = _with_gains(problem, shape.blade, polar, gains)
    if not improve:
        return given
    whole, problem = problem, problem.condensed()
    given = _with_gains(problem, shape.blade, polar, gains)
    candidates = [given]
    if shape.designs_chord:
        bounds = shape.chord_bounds, shape.twist_bounds
        for ratio in design_ratios:
            best = shape.nearest(best_blade(shape.blade, polar, ratio, *bounds).blade)
            candidates.append(_with_gains(problem, best, polar, None))
    best = _improve(problem, shape, max(candidates, key=lambda each: _worth(each.operation)), polar)
    if problem is whole:
        return best
    whole = replace(whole, rotor_radius=best.blade.rotor_radius)
    table = _table(whole, best.blade, polar).torque
    return replace(best, operation=whole.operate(table, best.gains))


def _worth(operation):
    """Return what ranks operations: one that runs, then one that recovers, then energy."""
    # the optimizer of the start meets its constraints to the last digits
    safe = operation.recovery is None or bool(np.all(operation.recovery.margin >= SAFE - 1e-6))
    return operation.running, safe, operation.energy


def _table(problem, blade, polar, derivatives=False):
    return bem.rotor_coefficients(blade, polar, problem.spline.nodes, derivatives)


def _with_gains(problem, blade, polar, gains):
    """Return a starting point of a blade; gains not given are fitted to its open loop."""
    table = _table(problem, blade, polar).torque
    if problem.law is None:
        return StartingPoint(blade, np.empty(0), problem.operate(table))
    if gains is not None:
        return StartingPoint(blade, np.asarray(gains, dtype=float), problem.operate(table, gains))
    # a quarter of the instants is enough to rank gains
    few = replace(problem, inflow_speed=problem.inflow_speed[::4], weights=problem.weights[::4])
    ideal = replace(few, law=None, torque_limit=problem.law.torque_limit).operate(table)
    fitted = problem.law.fit(ideal.rotor_speed, ideal.hydrodynamic_torque)

    factors = np.linspace(0.6, 1.1, 11)
    gains = fitted * max(factors, key=lambda by: _worth(few.operate(table, fitted * by)))
    return StartingPoint(blade, gains, problem.operate(table, gains))


def _improve(problem, shape, point, polar):
    """Raise the quasi-steady energy by SLSQP within move limits, re-centred until inactive."""
    chord_move, twist_move, radius_move, gain_move = 1.3, np.deg2rad(3.0), 1.1, 1.2
    resized = shape.radius_bounds is not None
    sizes = shape.chord_basis.shape[1], shape.twist_basis.shape[1], int(resized)
    ends = np.cumsum(sizes)

    def split(x):
        """Return chord and twist control, radius of the disc, and gains."""
        chord, twist, radius, gains = np.split(x, ends)
        return chord, twist, radius[0] if resized else shape.blade.rotor_radius, gains

    def operate(x, derivatives):
        chord, twist, radius, gains = split(x)
        found = _table(problem, shape.at(chord, twist, radius), polar, derivatives)
        return found, replace(problem, rotor_radius=radius).operate(found.torque, gains)

    for _ in range(12):
        chord, twist = shape.control(point.blade)
        chord, twist = np.clip(chord, *shape.chord_bounds), np.clip(twist, *shape.twist_bounds)
        radius, gains = np.full(sizes[2], point.blade.rotor_radius), point.gains
        center = np.concatenate((chord, twist, radius, gains))
        units = np.concatenate((chord, np.full(sizes[1], np.deg2rad(5.0)), radius, np.abs(gains)))
        reference = max(point.operation.energy, 1e-9)
        if not units.size:
            return point

        @lru_cache(maxsize=1)
        def at(x, units=units):
            """Return an operation and its energy's and recovery's gradients by the unknowns."""
            found, state = operate(np.array(x) * units, derivatives=True)
            recovery = state.recovery
            by_table = state.by_table[None]
            if recovery is not None:
                by_table = np.vstack((by_table, recovery.by_table))
            by_chord = by_table @ found.torque_by_chord
            by_radius = by_table @ found.torque_by_rotor_radius
            if not shape.designs_chord:  # it is scaled with the disc
                by_radius += by_chord @ shape.chord_offset / shape.blade.rotor_radius
            by_radius[0] += state.by_radius
            by_gain = state.by_gain[None]
            if recovery is not None:
                by_radius[1:] += recovery.by_radius[:, 0]
                by_gain = np.vstack((by_gain, recovery.by_gain))
            by = (
                by_chord @ shape.chord_basis,
                by_table @ found.torque_by_twist @ shape.twist_basis,
                by_radius[:, None] * np.ones(sizes[2]),
                by_gain,
            )
            return state, np.hstack(by) * units

        def loss(x, reference=reference, at=at):
            state, gradients = at(tuple(x))
            # a point without equilibrium is left by the line search
            value = state.energy if state.running else 0.5 * state.energy
            return -100.0 * value / reference, -100.0 * gradients[0] / reference

        distance = {
            "type": "ineq",
            "fun": lambda x, at=at: at(tuple(x))[0].recovery.margin - SAFE,
            "jac": lambda x, at=at: at(tuple(x))[1][1:],
        }

        low = (
            np.maximum(chord / chord_move, shape.chord_bounds[0]),
            np.maximum(twist - twist_move, shape.twist_bounds[0]),
            np.maximum(radius / radius_move, shape.radius_bounds[0]) if resized else radius,
            np.minimum(gains / gain_move, gains * gain_move),
        )
        high = (
            np.minimum(chord * chord_move, shape.chord_bounds[1]),
            np.minimum(twist + twist_move, shape.twist_bounds[1]),
            np.minimum(radius * radius_move, shape.radius_bounds[1]) if resized else radius,
            np.maximum(gains / gain_move, gains * gain_move),
        )
        low, high = np.concatenate(low) / units, np.concatenate(high) / units
        found = minimize(
            loss,
            np.clip(center / units, low, high),
            jac=True,
            method="SLSQP",
            bounds=Bounds(low, high),
            constraints=() if problem.law is None else distance,
            options={"ftol": 1e-9, "maxiter": 100},
        )
        physical = found.x * units
        _, operation = operate(physical, derivatives=False)
        new, old = _worth(operation), _worth(point.operation)
        if new[:2] < old[:2] or (new[:2] == old[:2] and new[2] <= old[2] * (1.0 + 1e-7)):
            break
        point = StartingPoint(shape.at(*split(physical)[:3]), split(physical)[3], operation)
    return point
