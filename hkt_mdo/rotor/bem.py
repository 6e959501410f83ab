"""Blade element momentum theory for all stations and operating points at once.

Ning's single residual in the inflow angle phi (Wind Energy 17(9), 2014) with the loss
factors and the high-induction branch of CCBlade. Written with

    s(phi) = sin(phi) / (1 - a),    c(phi) = cos(phi) (1 - k'),

neither of which depends on the operating point, the residual is f = s - c / lambda_r. Both are
free of the singularities of the induction factors: 1 / (1 - a) is 1 + k up to k = 2/3 and
sqrt(g2) + 5/3 - F beyond it (Buhl's branch, whose quotient has g3 as a common factor), and c =
cos(phi) - cos(phi) k' is finite at phi = 90 degrees. The relative speed follows as W = V / s, so
a root counts only where s > 0.

A station is therefore one curve, g(phi) = c / s, and a root at the local speed ratio lambda_r is
a crossing g = lambda_r. The curve is sampled once; its local minima, where a root vanishes, are
located exactly; and for every operating point the crossing with the smallest phi, the attached
one, is found by a binary search in the running minimum and finished by Newton's method inside its
bracket. See docs/bem.md.
"""

import warnings
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from hkt_mdo.errors import InputError
from hkt_mdo.rotor.airfoil import Polar

PHI_MIN = 1e-6  # CCBlade's distance from the singular points phi = 0 and pi

# Samples crowd towards phi = 0, where rotors work, and are few beyond 90 degrees.
_SAMPLES = np.concatenate(
    (
        PHI_MIN + (0.5 * np.pi - PHI_MIN) * np.linspace(0.0, 1.0, 56) ** 1.5,
        np.linspace(0.5 * np.pi, np.pi - PHI_MIN, 25)[1:],
    )
)
_NEGATIVE_SAMPLES = -PHI_MIN - (0.5 * np.pi - PHI_MIN) * np.linspace(0.0, 1.0, 33) ** 1.5

FINEST = 0.004  # rad, about the spacing of a polar's knots: no interval is divided further
MOST_KNOTS = 1024  # on the curve of a station; 50 to 60 are usual

# Rows of `Sections.derivatives`
INPUTS = ("tip_speed_ratio", "chord", "twist", "r", "hub_radius", "tip_radius", "log_reynolds")

# Values of `Sections.branch`
BRANCHES = {
    -1: "no root: loads are zero",
    0: "momentum theory, k <= 2/3",
    1: "Buhl's empirical branch, k > 2/3",
    2: "inflow angle beyond 90 degrees",
    3: "negative inflow angle (propeller brake)",
}


class Sections(NamedTuple):
    """What happens at every operating point (axis 0) and station (axis 1).

    inflow_angle, angle_of_attack (rad), axial_induction, tangential_induction; relative_speed
    over the inflow speed; normal_load and tangential_load are N/m over 0.5 rho V², that is
    metres; residual is f, infinite where there is no root (all else is then zero); branch holds
    keys of `BRANCHES`; roots is the number of roots with 0 < phi < 180 degrees, empty unless
    asked for; derivatives hold those of the tangential, then the normal load with respect to
    `INPUTS`, shape (2, 7, n_points, n_stations), empty unless asked for; those but the last hold
    the Reynolds number.
    """

    inflow_angle: np.ndarray
    angle_of_attack: np.ndarray
    axial_induction: np.ndarray
    tangential_induction: np.ndarray
    relative_speed: np.ndarray
    normal_load: np.ndarray
    tangential_load: np.ndarray
    residual: np.ndarray
    branch: np.ndarray
    roots: np.ndarray
    derivatives: np.ndarray


class Coefficients(NamedTuple):
    """Rotor coefficients at n operating points, and the torque coefficient's derivatives.

    torque = Q / (0.5 rho V² pi R³), power = P / (0.5 rho V³ pi R²), thrust = T / (0.5 rho V² pi
    R²), R the radius of the disc, each of shape (n,); torque_by_chord (1/m) and torque_by_twist
    (1/rad) of shape (n, n_stations); torque_by_rotor_radius (1/m) of shape (n,): hub, stations and
    tip move with the disc, chord and twist stay; torque_by_log_reynolds of shape (n,): the Reynolds
    numbers of all stations grow by one factor, as with the flow's speed.
    """

    torque: np.ndarray
    power: np.ndarray
    thrust: np.ndarray
    torque_by_tip_speed_ratio: np.ndarray
    torque_by_chord: np.ndarray
    torque_by_twist: np.ndarray
    torque_by_rotor_radius: np.ndarray
    torque_by_log_reynolds: np.ndarray


class RootChanges(NamedTuple):
    """Where stations change root along a sweep of the tip speed ratio; one entry a change.

    station (index), tip_speed_ratio, and the inflow angle (rad) just below and just above it; an
    angle is NaN on a side where the station has no root.
    """

    station: np.ndarray
    tip_speed_ratio: np.ndarray
    angle_below: np.ndarray
    angle_above: np.ndarray


@njit(cache=True, error_model="numpy")
def _polar_at(alpha, polar):
    """Return lift, drag and their slopes at an angle of attack."""
    n_knots = polar.shape[0]
    index = int(np.floor((alpha.real + np.pi) * (n_knots / (2.0 * np.pi))))
    x = alpha + np.pi - index * (2.0 * np.pi / n_knots)
    if index < 0 or index >= n_knots:
        index %= n_knots
    row = polar[index]
    return (
        row[0] + x * (row[1] + x * (row[2] + x * row[3])),
        row[4] + x * (row[5] + x * (row[6] + x * row[7])),
        row[1] + x * (2.0 * row[2] + x * 3.0 * row[3]),
        row[5] + x * (2.0 * row[6] + x * 3.0 * row[7]),
    )


@njit(cache=True, error_model="numpy")
def _loss_at(exponent):
    """Return arccos(exp(-x)) 2 / pi and the slope of its logarithm."""
    if exponent.real > 40.0:  # exp(-40) is below the last digit
        return 1.0 + 0.0 * exponent, 0.0 * exponent
    decay = np.exp(-exponent)
    angle = np.arccos(decay)
    return 2.0 / np.pi * angle, decay / (np.sqrt(1.0 - decay * decay) * angle)


@njit(cache=True, error_model="numpy")
def _terms(phi, chord, twist, r, hub_radius, tip_radius, blade_count, polar):
    """Evaluate a station at an inflow angle: s, c and their slopes, forces and their parts.

    It holds for complex arguments too, by which the tests check every derivative.
    """
    sine, cosine = np.sin(phi), np.cos(phi)
    lift, drag, lift_a, drag_a = _polar_at(phi - twist, polar)
    normal = lift * cosine + drag * sine
    tangential = lift * sine - drag * cosine
    normal_a = lift_a * cosine + drag_a * sine
    tangential_a = lift_a * sine - drag_a * cosine
    normal_phi = normal_a - tangential
    tangential_phi = tangential_a + normal

    inverse = 1.0 / sine
    size = inverse if phi.real > 0.0 else -inverse
    tip = (0.5 * blade_count * (tip_radius - r) / r) * size
    hub = (0.5 * blade_count * (r - hub_radius) / hub_radius) * size
    tip_loss, log_tip = _loss_at(tip)
    hub_loss, log_hub = _loss_at(hub)
    loss = tip_loss * hub_loss
    cot = cosine * inverse
    log_loss_phi = -(log_tip * tip + log_hub * hub) * cot

    # k = k_unit cn and k' cos(phi) = m = m_unit ct
    m_unit = (blade_count * chord / (8.0 * np.pi * r)) * inverse / loss
    k_unit = m_unit * inverse
    k, m = k_unit * normal, m_unit * tangential
    k_phi = k_unit * normal_phi - k * (log_loss_phi + 2.0 * cot)
    m_phi = m_unit * tangential_phi - m * (log_loss_phi + cot)

    # s = sin(phi) bracket(k, F)
    bracket_loss = 0.0 * loss
    if phi.real < 0.0:
        bracket, bracket_k = 1.0 - k, -1.0 + 0.0 * k
    elif k.real <= 2.0 / 3.0:
        bracket, bracket_k = 1.0 + k, 1.0 + 0.0 * k
    else:
        root = np.sqrt(2.0 * loss * k - (4.0 / 3.0 - loss) * loss)
        bracket, bracket_k = root + 5.0 / 3.0 - loss, loss / root
        bracket_loss = (k - 2.0 / 3.0 + loss) / root - 1.0
    s, c = sine * bracket, cosine - m
    s_phi = cosine * bracket + sine * (bracket_k * k_phi + bracket_loss * loss * log_loss_phi)
    c_phi = -sine - m_phi
    return (
        (s, c, s_phi, c_phi),
        (tangential, normal, tangential_phi, normal_phi, tangential_a, normal_a),
        (k, m, k_unit, m_unit, sine * bracket_k, sine * bracket_loss * loss),
        (tip, hub, log_tip, log_hub),
    )


@njit(cache=True, error_model="numpy")
def _derivatives(
    terms, tip_speed_ratio, chord, r, hub_radius, tip_radius, blade_count, by_reynolds, out
):
    """Fill out[n_loads, n_inputs]: total derivatives of the loads at a root, by `INPUTS`.

    The residual's own partials give dphi/dx = -f_x / f_phi; nothing passes through the solver's
    steps. by_reynolds has the tangential and the normal force coefficient's derivative with respect
    to the logarithm of the Reynolds number.
    """
    (s, c, s_phi, c_phi), forces, (k, m, k_unit, m_unit, s_k, s_log_loss), losses = terms
    tip, hub, log_tip, log_hub = losses
    lambda_r = tip_speed_ratio * r / tip_radius
    f_phi = s_phi - c_phi / lambda_r
    c_by_ratio = c / (lambda_r * lambda_r)
    chord_load = chord / (s * s)
    for i in range(out.shape[1]):
        # What changes before phi answers: twist, ln(solidity), ln(F), lambda_r, ln(chord)
        turn = log_solidity = log_loss = ratio = stretch = polar_change = 0.0
        if i == 0:
            ratio = r / tip_radius
        elif i == 1:
            log_solidity = stretch = 1.0 / chord
        elif i == 2:
            turn = -1.0
        elif i == 3:
            log_solidity = -1.0 / r
            log_loss = log_hub * hub / (r - hub_radius) - log_tip * tip * tip_radius / (
                r * (tip_radius - r)
            )
            ratio = tip_speed_ratio / tip_radius
        elif i == 4:
            log_loss = -log_hub * hub * r / (hub_radius * (r - hub_radius))
        elif i == 5:
            log_loss = log_tip * tip / (tip_radius - r)
            ratio = -lambda_r / tip_radius
        else:
            polar_change = 1.0
        normal_x = forces[5] * turn + by_reynolds[1] * polar_change
        tangential_x = forces[4] * turn + by_reynolds[0] * polar_change
        k_x = k_unit * normal_x + k * (log_solidity - log_loss)
        m_x = m_unit * tangential_x + m * (log_solidity - log_loss)
        s_x = s_k * k_x + s_log_loss * log_loss
        phi_x = -(s_x + m_x / lambda_r + c_by_ratio * ratio) / f_phi
        s_x += s_phi * phi_x
        for load in range(out.shape[0]):
            force_x = (normal_x if load else tangential_x) + forces[2 + load] * phi_x
            out[load, i] = chord_load * (force_x + forces[load] * (stretch - 2.0 * s_x / s))


@njit(cache=True, error_model="numpy")
def _point(phi, station):
    """Return phi, s, c, their slopes, and the curve's polar angle arctan(g) with its slope."""
    s, c, s_phi, c_phi = _terms(phi, *station)[0]
    return phi, s, c, s_phi, c_phi, (c_phi * s - c * s_phi) / (s * s + c * c), np.arctan2(c, s)


@njit(cache=True, error_model="numpy")
def _uneven(left, right):
    """Whether the curve may turn unseen between two points: its slope differs much there.

    The slopes are those of arctan(g), -1 throughout without load: at both ends, and in the middle
    of the cubic that has the ends' values and slopes.
    """
    middle = 1.5 * (right[6] - left[6]) / (right[0] - left[0]) - 0.25 * (left[5] + right[5])
    return max(left[5], right[5], middle) > 0.7 * min(left[5], right[5], middle)


@njit(cache=True, error_model="numpy")
def _turning(left, right, station):
    """Return the turning point between two others (regula falsi, Illinois)."""
    low, high, slope_low, slope_high = left[0], right[0], left[5], right[5]
    for _ in range(60):
        point = _point((low * slope_high - high * slope_low) / (slope_high - slope_low), station)
        if (point[5] < 0.0) == (slope_high < 0.0):
            step = high - point[0]
            high, slope_high, slope_low = point[0], point[5], 0.5 * slope_low
        else:
            step = point[0] - low
            low, slope_low, slope_high = point[0], point[5], 0.5 * slope_high
        if step < 1e-9:
            break
    return point


@njit(cache=True, error_model="numpy")
def _last_positive(left, right, station):
    """Return the last point with s > 0 before s vanishes between two others."""
    low, high = left[0], right[0]
    while high - low > 1e-14:
        middle = 0.5 * (low + high)
        if _point(middle, station)[1] > 0.0:
            low = middle
        else:
            high = middle
    return _point(low, station)


@njit(cache=True, error_model="numpy")
def _add(point, knots, count):
    """Append a point to the knots; return their number."""
    g = point[2] / point[1] if point[1] > 0.0 else np.inf
    knots[0, count], knots[1, count], knots[2, count] = point[0], point[1], point[2]
    knots[3, count], knots[4, count], knots[5, count] = point[3], point[4], g
    knots[6, count] = min(g, knots[6, count - 1]) if count else g
    return count + 1


@njit(cache=True, error_model="numpy")
def _curve(lowest, full, station, knots):
    """Sample a station's curve g = c / s; return the number of knots.

    knots[7, n] holds phi, s, c, their slopes, g (infinite where s <= 0) and the running minimum
    of g. The curve's turning points become knots of their own: minima always, maxima if full.
    Unless full, sampling ends where the running minimum is at or below `lowest`: no root is
    sought further on.
    """
    left = _point(_SAMPLES[0], station)
    count = _add(left, knots, 0)
    for phi in _SAMPLES[1:]:
        goal = _point(phi, station)
        right = goal
        while True:
            if left[1] > 0.0 and right[1] > 0.0:
                room = right[0] - left[0] > FINEST and count < knots.shape[1] - 8
                if room and _uneven(left, right):
                    right = _point(0.5 * (left[0] + right[0]), station)
                    continue
                if (left[5] < 0.0 and right[5] > 0.0) or (
                    full and left[5] > 0.0 and right[5] < 0.0
                ):
                    count = _add(_turning(left, right, station), knots, count)
            elif left[1] > 0.0 and right[2] < 0.0:  # g falls to minus infinity, where s vanishes
                count = _add(_last_positive(left, right, station), knots, count)
            count = _add(right, knots, count)
            if right[0] == goal[0]:
                break
            left, right = right, goal
        left = right
        if not full and knots[6, count - 1] <= lowest:
            break
    return count


@njit(cache=True, error_model="numpy")
def _root(low, high, f_low, f_high, slope_low, slope_high, lambda_r, station):
    """Return the root in a bracket and the terms there (Newton, bisection where it fails)."""
    # Start from the cubic phi(f) that has the residual's values and slopes at both ends.
    rise = f_high - f_low
    t = -f_low / rise
    u = 1.0 - t
    phi = low * u * u * (1.0 + 2.0 * t) + high * t * t * (3.0 - 2.0 * t)
    phi += rise * t * u * (u / slope_low - t / slope_high)
    if not (low < phi < high or high < phi < low):
        phi = low * u + high * t
    f_before = np.inf
    for _ in range(100):
        terms = _terms(phi, *station)
        s, c, s_phi, c_phi = terms[0]
        f = s - c / lambda_r
        if abs(f) <= 2e-15 * (abs(s) + abs(c) / lambda_r):
            break
        if (f > 0.0) == (f_low > 0.0):
            low = phi
        else:
            high = phi
        new = phi - f / (s_phi - c_phi / lambda_r)
        if not (low < new < high or high < new < low) or abs(f) > 0.5 * f_before:
            new = 0.5 * (low + high)
        f_before = abs(f)
        if abs(new - phi) <= 2.3e-16 * abs(phi):
            break
        phi = new
    return phi, terms


@njit(cache=True, error_model="numpy")
def _brake_bracket(samples, lambda_r, station):
    """Return the residual's sign change nearest below phi = 0: both angles, values, slopes."""
    low = f_low = slope_low = np.nan
    for phi in samples:
        (s, c, s_phi, c_phi), _f, _k, _l = _terms(phi, *station)
        f, slope = s - c / lambda_r, s_phi - c_phi / lambda_r
        if f * f_low < 0.0:
            return low, phi, f_low, f, slope_low, slope
        low, f_low, slope_low = phi, f, slope
    return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan


@njit(cache=True, error_model="numpy")
def _mix(polars, weights, out):
    """Write the weighted sum of polars (n, n_knots, 8) to out."""
    out[:] = 0.0
    for number in range(weights.size):
        weight = weights[number]
        if weight != 0.0:
            for row in range(out.shape[0]):
                for column in range(out.shape[1]):
                    out[row, column] += weight * polars[number, row, column]


@njit(cache=True, error_model="numpy")
def _solve(
    tip_speed_ratio,
    r,
    chord,
    twist,
    hub_radius,
    tip_radius,
    blade_count,
    polars,
    section,
    mixture,
    full,
    n_loads,
    n_inputs,
):
    """Solve all stations at all points; arrays are station-major: inner loops write in order.

    Station j has the polar section[j]; or, where mixture is not empty, those from section[j] on
    times the weights mixture[0, j, i], whose derivatives by ln(Re) are mixture[1, j, i].
    """
    n_points, n_stations = tip_speed_ratio.size, r.size
    if not np.min(tip_speed_ratio) > 0.0:
        raise ValueError("tip speed ratios must be positive")
    if not (hub_radius < np.min(r) and np.max(r) < tip_radius):
        raise ValueError("stations must lie strictly between hub and tip")
    state = np.zeros((8, n_stations, n_points))
    branch = np.empty((n_stations, n_points), dtype=np.int8)
    roots = np.zeros((n_stations, n_points if full else 0), dtype=np.int64)
    derivatives = np.zeros((n_loads, n_inputs, n_stations, n_points))
    gradient = np.empty((n_loads, n_inputs))
    knots = np.empty((7, MOST_KNOTS))
    angle, s_knot, c_knot, s_phi_knot, c_phi_knot, g, running = knots
    lowest = np.min(tip_speed_ratio)
    local = mixture.shape[3] > 0
    mixed = np.empty_like(polars[0])
    by_reynolds = (0.0, 0.0)
    n_knots = 0
    for j in range(n_stations):
        station_polar = polars[section[j]]
        for i in range(n_points):
            lambda_r = tip_speed_ratio[i] * r[j] / tip_radius
            if local:
                _mix(polars[section[j] : section[j] + mixture.shape[3]], mixture[0, j, i], mixed)
                station_polar = mixed
            station = (
                chord[j],
                twist[j],
                r[j],
                hub_radius,
                tip_radius,
                blade_count,
                station_polar,
            )
            if local or i == 0:  # else one curve serves all points
                ratio = lambda_r if local else lowest * r[j] / tip_radius
                n_knots = _curve(ratio, full, station, knots)
            if full:
                for m in range(1, n_knots):
                    roots[j, i] += (g[m] > lambda_r) != (g[m - 1] > lambda_r)
            below, above = (
                -1,
                n_knots,
            )  # the first knot whose running minimum is at or below lambda_r
            while above - below > 1:
                middle = (below + above) // 2
                if running[middle] > lambda_r:
                    below = middle
                else:
                    above = middle
            s = c = f_below = f_above = 0.0
            if 0 < above < n_knots:
                f_below = s_knot[below] - c_knot[below] / lambda_r
                f_above = s_knot[above] - c_knot[above] / lambda_r
            if f_below < 0.0 <= f_above:
                phi, terms = _root(
                    angle[below],
                    angle[above],
                    f_below,
                    f_above,
                    s_phi_knot[below] - c_phi_knot[below] / lambda_r,
                    s_phi_knot[above] - c_phi_knot[above] / lambda_r,
                    lambda_r,
                    station,
                )
                s, c, _s_phi, _c_phi = terms[0]
            if s <= 0.0:  # no root yet, or one whose relative speed points backwards
                bracket = _brake_bracket(_NEGATIVE_SAMPLES, lambda_r, station)
                if bracket[2] * bracket[3] < 0.0:
                    phi, terms = _root(*bracket, lambda_r, station)
                    s, c, _s_phi, _c_phi = terms[0]
            if s <= 0.0:
                branch[j, i] = -1
                state[7, j, i] = np.inf
                continue
            if phi < 0.0:
                branch[j, i] = 3
            elif phi > 0.5 * np.pi:
                branch[j, i] = 2
            else:
                branch[j, i] = terms[2][0] > 2.0 / 3.0
            state[0, j, i] = phi
            state[1, j, i] = phi - twist[j]
            state[2, j, i] = 1.0 - np.sin(phi) / s
            state[3, j, i] = np.cos(phi) / c - 1.0
            state[4, j, i] = 1.0 / s
            state[5, j, i] = chord[j] * terms[1][1] / (s * s)
            state[6, j, i] = chord[j] * terms[1][0] / (s * s)
            state[7, j, i] = s - c / lambda_r
            if n_inputs:
                if local:
                    lift = drag = 0.0
                    for number in range(mixture.shape[3]):
                        found = _polar_at(phi - twist[j], polars[section[j] + number])
                        lift += mixture[1, j, i, number] * found[0]
                        drag += mixture[1, j, i, number] * found[1]
                    sine, cosine = np.sin(phi), np.cos(phi)
                    by_reynolds = (lift * sine - drag * cosine, lift * cosine + drag * sine)
                _derivatives(
                    terms,
                    tip_speed_ratio[i],
                    chord[j],
                    r[j],
                    hub_radius,
                    tip_radius,
                    blade_count,
                    by_reynolds,
                    gradient,
                )
                derivatives[:, :, j, i] = gradient
    return state, branch, roots, derivatives


@lru_cache(maxsize=32)
def _stack(polars):
    """Return the coefficients of different polars in one array (n_polars, n_knots, 8)."""
    return np.stack([polar.coefficients for polar in polars])


@dataclass(frozen=True, eq=False)
class LocalReynolds:
    """Polars that follow the Reynolds number of their station and operating point.

        Re = chord V sqrt(1 + lambda_r²) / nu,

    that of the undisturbed relative speed: induction would couple it to the inflow angle, for a
    change of a few hundredths in its logarithm, in which the polars are linear between tables.
    Beyond the tables the nearest one holds.

    Parameters
    ----------
    log_reynolds : ndarray, shape (n_reynolds,)
        Rising; at least two.
    polars : tuple, length n_stations, of tuple of Polar, length n_reynolds
    flow_speed : float or ndarray, shape (n_points,), m/s
        For all operating points or for each.
    viscosity : float, m**2/s
        Kinematic viscosity nu.
    """

    log_reynolds: np.ndarray
    polars: tuple[tuple[Polar, ...], ...]
    flow_speed: float | np.ndarray
    viscosity: float

    @classmethod
    def of(cls, families, flow_speed, viscosity):
        """Take the families of the stations in a flow (m/s) of a kinematic viscosity (m²/s)."""
        numbers = np.unique(np.concatenate([family.reynolds for family in families]))
        numbers = numbers[np.isfinite(numbers)]
        if numbers.size < 2:
            raise InputError(
                "needs polars at two or more Reynolds numbers",
                "give such polars, or rotor.reynolds: invariant",
                key="rotor.reynolds",
                value="local",
            )
        tables = {family: tuple(family.at(number) for number in numbers) for family in families}
        return cls(
            np.log(numbers),
            tuple(tables[family] for family in families),
            flow_speed,
            viscosity,
        )

    def at_speed(self, flow_speed):
        """Return the same polars in another flow (m/s), or others by operating point."""
        return replace(self, flow_speed=flow_speed)

    @cached_property
    def _cardinal(self):
        level = (1, np.zeros(self.log_reynolds.size))
        return CubicSpline(
            self.log_reynolds, np.eye(self.log_reynolds.size), bc_type=(level, level)
        )

    def mixture(self, blade, blade_ratio):
        """Return the weights of the tables and their slopes over ln(Re), by station and point.

        Shape (2, n_stations, n_points, n_reynolds), for Omega R / V at the points.
        """
        lambda_r = blade.r[:, None] / blade.tip_radius * blade_ratio
        unit = self.flow_speed * np.cos(blade.cone) / self.viscosity
        number = np.log(unit * blade.chord[:, None] * np.sqrt(1.0 + lambda_r**2))
        inside = np.clip(number, self.log_reynolds[0], self.log_reynolds[-1])
        slopes = self._cardinal(inside, 1) * (inside == number)[:, :, None]
        return np.stack((self._cardinal(inside), slopes))

    def __getitem__(self, station):
        """Return the polars of a station alone, for a single strip."""
        return replace(self, polars=(self.polars[station],))


def polar_at(polar, station):
    """Return the polar of a station (index), given one for all stations or one for each."""
    return polar if isinstance(polar, Polar) else polar[station]


def _arguments(blade, polar, blade_ratio=()):
    """Return a blade and its polars as `_solve` takes them, from r to mixture."""
    mixture = np.empty((2, 0, 0, 0))
    if isinstance(polar, Polar):
        polars, section = polar.coefficients[None], np.zeros(blade.r.size, dtype=np.int64)
    elif isinstance(polar, LocalReynolds):
        stations = polar.polars * blade.r.size if len(polar.polars) == 1 else polar.polars
        different = tuple(dict.fromkeys(stations))
        polars = _stack(tuple(each for station in different for each in station))
        section = np.array([different.index(each) for each in stations]) * polar.log_reynolds.size
        mixture = polar.mixture(blade, blade_ratio)
    else:
        if len(polar) != blade.r.size:
            raise ValueError(
                f"{len(polar)} polars for {blade.r.size} stations: give one polar, or one for each"
            )
        different = tuple(dict.fromkeys(polar))
        polars, section = _stack(different), np.array([different.index(each) for each in polar])
    return (
        np.ascontiguousarray(blade.r, dtype=float),
        np.ascontiguousarray(blade.chord, dtype=float),
        np.ascontiguousarray(blade.twist, dtype=float),
        float(blade.hub_radius),
        float(blade.tip_radius),
        int(blade.blade_count),
        polars,
        section,
        mixture,
    )


def sections(blade, polar, tip_speed_ratio, derivatives=False, count_roots=False):
    """Solve every station of a blade at every tip speed ratio.

    Parameters
    ----------
    blade : Blade
        Stations strictly between hub and tip, in any order.
    polar : Polar, sequence of Polar, or LocalReynolds
        One for all stations, one for each, or polars that follow the Reynolds number.
    tip_speed_ratio : array, shape (n_points,)
        Positive. Here, and in the derivatives, that of the blade as it lies: Omega R / V with R
        along the blade, which for coned blades is larger than that of the disc.
    derivatives : bool
        Whether to fill `Sections.derivatives`.
    count_roots : bool
        Whether to fill `Sections.roots`.

    Returns
    -------
    Sections

    Raises
    ------
    ValueError
        If a tip speed ratio is not positive, a station is not between hub and tip, or the number
        of polars is not that of the stations.
    """
    points = np.atleast_1d(np.asarray(tip_speed_ratio, dtype=float))
    n_loads, n_inputs = (2, len(INPUTS)) if derivatives else (2, 0)
    state, branch, roots, gradient = _solve(
        points, *_arguments(blade, polar, points), count_roots, n_loads, n_inputs
    )
    return Sections(*state.transpose(0, 2, 1), branch.T, roots.T, gradient.transpose(0, 1, 3, 2))


def root_changes(blade, polar, tip_speed_ratio):
    """Find where along a tip speed ratio sweep stations change root, hence torque jumps.

    They are exact, not read off the sweep: a station's root vanishes at a minimum of its curve
    g(phi).

    Parameters
    ----------
    blade, polar
        As in `sections`.
    tip_speed_ratio : array
        Its smallest and largest value bound the search.

    Returns
    -------
    RootChanges
        In the order of the tip speed ratio.
    """
    low, high = float(np.min(tip_speed_ratio)), float(np.max(tip_speed_ratio))
    if isinstance(polar, LocalReynolds):
        raise ValueError("the polars must not follow the Reynolds number")
    r, chord, twist, hub_radius, tip_radius, blade_count, polars, section, mixture = _arguments(
        blade, polar
    )
    knots = np.empty((7, MOST_KNOTS))
    found = []
    for j in range(r.size):
        station = (
            chord[j],
            twist[j],
            r[j],
            hub_radius,
            tip_radius,
            blade_count,
            polars[section[j]],
        )
        count = _curve(0.0, True, station, knots)
        running = knots[6, :count]
        # Where the running minimum stays, the root left of it vanishes; so it does at the ends.
        held = np.flatnonzero((running[1:] == running[:-1]) & np.isfinite(running[:-1]))
        vanishing = np.unique(np.concatenate((running[[0, -1]], running[held])))
        found += [(j, ratio) for ratio in vanishing * tip_radius / r[j] if low <= ratio <= high]
    found.sort(key=lambda change: change[1])
    angles = np.empty((2, len(found)))
    for place, (j, ratio) in enumerate(found):
        pair = _solve(
            ratio * np.array([1.0 - 1e-9, 1.0 + 1e-9]),
            *(values[j : j + 1] for values in (r, chord, twist)),
            hub_radius,
            tip_radius,
            blade_count,
            polars,
            section[j : j + 1],
            mixture,
            False,
            2,
            0,
        )
        angles[:, place] = np.where(pair[1][0] < 0, np.nan, pair[0][0, 0])
    stations = np.array([j for j, _ in found], dtype=int)
    return RootChanges(stations, np.array([ratio for _, ratio in found]), *angles)


def torque_weights(blade):
    """Return the weights w[n_stations] with torque coefficient = w @ tangential_load.

    The trapezoidal rule over hub, stations and tip with no load at hub and tip, as in CCBlade. The
    cone cancels: loads fall with its cosine squared, the lever arm with its cosine, and the disc's
    radius cubed with all three.
    """
    edges = np.concatenate(([blade.hub_radius], blade.r, [blade.tip_radius]))
    spacing = 0.5 * (edges[2:] - edges[:-2])
    return blade.blade_count * spacing * blade.r / (np.pi * blade.tip_radius**3)


def rotor_coefficients(blade, polar, tip_speed_ratio, derivatives=False):
    """Torque, power and thrust coefficient of a rotor, and the torque's derivatives if asked.

    Parameters
    ----------
    blade : Blade
        Stations in ascending order.
    polar : Polar, sequence of Polar, or LocalReynolds
        One for all stations, one for each, or polars that follow the Reynolds number.
    tip_speed_ratio : array, shape (n_points,)
    derivatives : bool

    Returns
    -------
    Coefficients
        Derivatives are empty unless asked for.

    Warns
    -----
    RuntimeWarning
        If a station has no root at some point; its load is taken as zero there.

    Notes
    -----
    Coned blades meet V cos(cone) at Omega r cos(cone) (CCBlade): a section sees the ratio of blade
    speed and flow, Omega r / V, that a plane rotor would at the tip speed ratio over cos(cone). The
    coefficients depend on lengths only through their ratios, hence the derivative by the radius.
    """
    points = np.atleast_1d(np.asarray(tip_speed_ratio, dtype=float))
    cosine = float(np.cos(blade.cone))
    local = isinstance(polar, LocalReynolds)
    # Only the tangential load by tip speed ratio, chord and twist is asked for.
    n_inputs = (len(INPUTS) if local else 3) if derivatives else 0
    state, branch, _, gradient = _solve(
        points / cosine, *_arguments(blade, polar, points / cosine), False, 1, n_inputs
    )
    unsolved = np.count_nonzero(branch < 0)
    if unsolved:
        warnings.warn(
            f"no root at {unsolved} of {branch.size} sections: their loads are taken as zero",
            RuntimeWarning,
            2,
        )
    weights = torque_weights(blade)
    torque = weights @ state[6]
    thrust = (weights * blade.rotor_radius / blade.r) @ state[5]
    if derivatives:
        by_ratio = weights @ gradient[0, 0] / cosine
        by_chord, by_twist = (gradient[0, 1:3] * weights[:, None]).transpose(0, 2, 1)
        by_radius = -(by_chord @ blade.chord) / blade.rotor_radius
        by_reynolds = np.zeros(points.size)
        if local:  # chord and tip speed ratio change the Reynolds number too; the radius does not
            by_number = (gradient[0, 6] * weights[:, None]).T
            squared = (points[:, None] / cosine * blade.r / blade.tip_radius) ** 2
            by_ratio = by_ratio + np.sum(by_number * squared / (1.0 + squared), axis=1) / points
            by_chord = by_chord + by_number / blade.chord
            by_reynolds = np.sum(by_number, axis=1)
    else:
        by_ratio = by_chord = by_twist = by_radius = by_reynolds = np.empty(0)
    return Coefficients(
        torque, torque * points, thrust, by_ratio, by_chord, by_twist, by_radius, by_reynolds
    )
