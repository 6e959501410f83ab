"""The feasible start of an optimization: quasi-steady co-design.

The rotor's time constant is a few hundredths of a second and the flow changes over many seconds, so
the rotor follows Q = u at every instant, on the unstalled side. That problem has no differential
equation, no false solutions and few unknowns (blade and gains); its optimum lies within about 1e-5
of the dynamic one.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import Bounds, minimize, minimize_scalar

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.steady_optimum import best_blade
from hkt_mdo.rotor.torque_curve import TorqueSpline

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
    running : bool
        Whether an unstalled equilibrium exists at every instant.
    """

    energy: float
    rotor_speed: np.ndarray
    hydrodynamic_torque: np.ndarray
    by_table: np.ndarray
    by_gain: np.ndarray
    running: bool


@dataclass(frozen=True, eq=False)
class QuasiSteady:
    """Quasi-steady operation of a rotor in a flow under a controller.

    Parameters
    ----------
    inflow_speed, weights : ndarray, shape (n_times,), m/s and s
        The flow at quadrature points of time.
    density : float, kg/m**3
    tip_radius : float, m
    spline : TorqueSpline
    law : FeedbackLaw or None
        None: open loop, the torque that captures most power at each instant.
    torque_limit : float or None, N*m
        Of the open loop; a feedback law has its own.
    """

    inflow_speed: np.ndarray
    weights: np.ndarray
    density: float
    tip_radius: float
    spline: TorqueSpline
    law: object = None
    torque_limit: float | None = None

    def operate(self, table, gains=()):
        """Return the `Operation` for a torque coefficient table[n_nodes] and gains[n_gains]."""
        v, radius, gains = self.inflow_speed, self.tip_radius, np.asarray(gains, dtype=float)
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
        return Operation(float(self.weights @ (torque * w)), w, torque, by_table, by_gain, running)

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
        ratios, speed_per_ratio = self._search(), self.inflow_speed / self.tip_radius
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


def starting_point(
    problem, blade, gains, polar, chord_bounds, twist_bounds, design_ratios, *, fixed_blade, improve
):
    """Return a start near the optimum, found by quasi-steady co-design from a blade.

    Candidates are the blade as given and the steady-optimal blades of a range of tip speed ratios;
    the best of them under the controller is improved by gradient steps within move limits.

    Parameters
    ----------
    problem : QuasiSteady
    blade : Blade
        As given by the case.
    gains : array, shape (n_gains,), or None
        None: fitted to the blade.
    polar : Polar
    chord_bounds, twist_bounds : (float, float), m and rad
    design_ratios : array
        Tip speed ratios whose steady-optimal blades are tried.
    fixed_blade : bool
        Keep the blade and improve only the gains.
    improve : bool
        False: the blade and gains as given.

    Returns
    -------
    StartingPoint
    """
    given = _with_gains(problem, blade, polar, gains)
    if not improve:
        return given
    candidates = [given]
    if not fixed_blade:
        for ratio in design_ratios:
            shaped = best_blade(blade, polar, ratio, chord_bounds, twist_bounds).blade
            candidates.append(_with_gains(problem, shaped, polar, None))
    best = max(candidates, key=lambda point: (point.operation.running, point.operation.energy))
    return _improve(problem, best, polar, chord_bounds, twist_bounds, fixed_blade)


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

    def worth(factor):
        operation = few.operate(table, fitted * factor)
        return operation.running, operation.energy

    gains = fitted * max(np.linspace(0.6, 1.1, 11), key=worth)
    return StartingPoint(blade, gains, problem.operate(table, gains))


def _improve(problem, point, polar, chord_bounds, twist_bounds, fixed_blade):
    """Raise the quasi-steady energy by SLSQP within move limits, re-centred until inactive."""
    n = 0 if fixed_blade else point.blade.r.size
    chord_move, twist_move, gain_move = 1.3, np.deg2rad(3.0), 1.2
    for _ in range(12):
        blade, gains, reference = point.blade, point.gains, max(point.operation.energy, 1e-9)
        units = np.concatenate((blade.chord[:n], np.full(n, np.deg2rad(5.0)), np.abs(gains)))
        center = np.concatenate((blade.chord[:n], blade.twist[:n], gains)) / units

        def loss(x, units=units, reference=reference, base=blade):
            physical = x * units
            shaped = base.with_shape(physical[:n], physical[n : 2 * n]) if n else base
            found = _table(problem, shaped, polar, derivatives=True)
            state = problem.operate(found.torque, physical[2 * n :])
            by = state.by_gain
            if n:
                by = np.concatenate(
                    (
                        state.by_table @ found.torque_by_chord,
                        state.by_table @ found.torque_by_twist,
                        by,
                    )
                )
            # a point without equilibrium is left by the line search
            value = state.energy if state.running else 0.5 * state.energy
            return -100.0 * value / reference, -100.0 * by * units / reference

        low = np.concatenate(
            (
                np.maximum(blade.chord[:n] / chord_move, chord_bounds[0]),
                np.maximum(blade.twist[:n] - twist_move, twist_bounds[0]),
                np.minimum(gains / gain_move, gains * gain_move),
            )
        )
        high = np.concatenate(
            (
                np.minimum(blade.chord[:n] * chord_move, chord_bounds[1]),
                np.minimum(blade.twist[:n] + twist_move, twist_bounds[1]),
                np.maximum(gains / gain_move, gains * gain_move),
            )
        )
        if not units.size:
            return point
        found = minimize(
            loss,
            np.clip(center, low / units, high / units),
            jac=True,
            method="SLSQP",
            bounds=Bounds(low / units, high / units),
            options={"ftol": 1e-9, "maxiter": 100},
        )
        physical = found.x * units
        shaped = blade.with_shape(physical[:n], physical[n : 2 * n]) if n else blade
        operation = problem.operate(_table(problem, shaped, polar).torque, physical[2 * n :])
        if not operation.running or operation.energy <= point.operation.energy * (1.0 + 1e-7):
            break
        point = StartingPoint(shaped, physical[2 * n :], operation)
    return point
