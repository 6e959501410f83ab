"""Blade element momentum theory for all stations and operating points at once.

Ning's single residual in the inflow angle phi (Wind Energy 17(9), 2014), with the loss factors and
the high-induction branch of CCBlade. With

    s(phi) = sin(phi) / (1 - a),    c(phi) = cos(phi) (1 - k'),

which do not depend on the operating point, the residual is f = s - c / lambda_r. The induction
factors have singularities; s and c have none: 1 / (1 - a) is 1 + k up to k = 2/3 and
sqrt(g2) + 5/3 - F beyond it (Buhl's branch, whose quotient has g3 as a common factor), and c =
cos(phi) - cos(phi) k' is finite at phi = 90 degrees. The relative speed is W = V / s, so that a
root is valid only where s > 0.

A station is therefore one curve, g(phi) = c / s, and a root at the local speed ratio lambda_r is a
crossing g = lambda_r. The curve is sampled once, and its local minima, where a root vanishes, are
located exactly. For every operating point, the crossing with the smallest phi, which is the
attached one, is found by a binary search in the running minimum of g and refined by Newton's method
inside its bracket. See docs/studies/bem.md.
"""

import warnings
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hkt_mdo.compiled import compiled

PHI_MIN = 1e-6  # rad, CCBlade's distance from the singular points phi = 0 and pi


def _up_to_right_angle(count):
    """Return inflow angles up to 90 degrees, dense near phi = 0, where rotors operate."""
    return PHI_MIN + (0.5 * np.pi - PHI_MIN) * np.linspace(0.0, 1.0, count) ** 1.5


_SAMPLES = np.append(_up_to_right_angle(56), np.linspace(0.5 * np.pi, np.pi - PHI_MIN, 25)[1:])
_NEGATIVE_SAMPLES = -_up_to_right_angle(33)

STEP = 1e-40  # of derivatives by complex step: nothing is subtracted
FINEST = 0.004  # rad, about the spacing of a polar's knots: no interval is divided further
MOST_KNOTS = 1024  # on the curve of a station; 50 to 60 are usual

# The terms of no root: s = 0; see `_terms`
_NOTHING = (0.0,) * 4, (0.0,) * 6, (0.0,) * 5

# Rows of `Sections.derivatives`; the last is the other variable of the polars: the logarithm of the
# Reynolds number (`LocalReynolds`) or the thickness (`ByThickness`)
INPUTS = ("tip_speed_ratio", "chord", "twist", "followed")


class Sections(NamedTuple):
    """State of the flow at every operating point (axis 0) and station (axis 1).

    inflow_angle, angle_of_attack (rad), axial_induction, tangential_induction; relative_speed over
    the inflow speed; normal_load and tangential_load in N/m over 0.5 rho V², that is m. All are
    zero where there is no root.

    derivatives are those of the tangential load, the normal load, the inflow angle and the relative
    speed with respect to `INPUTS`, shape (4, 4, n_points, n_stations), empty unless requested; all
    but the last are at a constant Reynolds number and thickness.
    """

    inflow_angle: np.ndarray
    angle_of_attack: np.ndarray
    axial_induction: np.ndarray
    tangential_induction: np.ndarray
    relative_speed: np.ndarray
    normal_load: np.ndarray
    tangential_load: np.ndarray
    derivatives: np.ndarray

    @property
    def branch(self):
        """Branch of the theory at every operating point and station.

        Returns
        -------
        ndarray of shape (n_points, n_stations)
            0 for momentum theory (k <= 2/3), 1 for Buhl's empirical branch (k > 2/3), 2 for an
            inflow angle beyond 90 degrees, 3 for a negative inflow angle (propeller brake) and -1
            for no root.
        """
        phi, buhl = self.inflow_angle, self.axial_induction > 0.4
        cases = [self.relative_speed == 0.0, phi < 0.0, phi > 0.5 * np.pi, buhl]
        return np.select(cases, [-1, 3, 2, 1], 0)


class Table(NamedTuple):
    """A quantity at n tip speed ratios, and its derivatives by the blade; empty unless requested.

    values, by_tip_speed_ratio and by_rotor_radius (per m; hub, stations and tip move at constant
    chord and twist) have the shape (n,), by_chord (per m), by_twist (per rad) and by_thickness
    (over the chord) (n, n_stations).
    """

    values: np.ndarray
    by_tip_speed_ratio: np.ndarray = np.empty(0)
    by_chord: np.ndarray = np.empty(0)
    by_twist: np.ndarray = np.empty(0)
    by_thickness: np.ndarray = np.empty(0)
    by_rotor_radius: np.ndarray = np.empty(0)


class Coefficients(NamedTuple):
    """Rotor coefficients at n operating points, and the torque coefficient's derivatives.

    torque = Q / (0.5 rho V² pi R³), power = P / (0.5 rho V³ pi R²), thrust = T / (0.5 rho V² pi
    R²), R the radius of the disc, each of shape (n,). torque_table is the torque coefficient with
    its derivatives (by_thickness is zero where polars do not follow it); torque_by_log_reynolds
    (n,), empty unless requested, is that by the Reynolds numbers of all stations, if they grow by
    one factor, as with the speed of the flow.
    """

    torque_table: Table
    power: np.ndarray
    thrust: np.ndarray
    torque_by_log_reynolds: np.ndarray = np.empty(0)

    @property
    def torque(self):
        """The torque coefficient.

        Returns
        -------
        ndarray of shape (n,)
            At the operating points.
        """
        return self.torque_table.values


@compiled(error_model="numpy")
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


@compiled(error_model="numpy")
def _loss_at(exponent):
    """Return arccos(exp(-x)) 2 / pi and the slope of its logarithm."""
    if exponent.real > 40.0:  # exp(-40) is below the last digit
        return 1.0 + 0.0 * exponent, 0.0 * exponent
    decay = np.exp(-exponent)
    angle = np.arccos(decay)
    return 2.0 / np.pi * angle, decay / (np.sqrt(1.0 - decay * decay) * angle)


@compiled(error_model="numpy")
def _terms(phi, chord, twist, r, hub_radius, tip_radius, blade_count, polar):
    """Evaluate a station at an inflow angle: s, c and their slopes, forces and their parts.

    Arguments may be complex: the tests check every derivative by complex step.
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
        (k, m, k_unit, m_unit, sine * bracket_k),
    )


@compiled(error_model="numpy")
def _derivatives(terms, lambda_r, chord, r, tip_radius, by_followed, out):
    """Fill out[4, 4]: total derivatives at a root, by `INPUTS`; see `Sections`.

    dphi/dx = -f_x / f_phi by the implicit function theorem. by_followed holds the derivatives of
    the tangential and the normal force coefficient by the other variable of the polars.
    """
    (s, c, s_phi, c_phi), forces, (k, m, k_unit, m_unit, s_k) = terms
    f_phi = s_phi - c_phi / lambda_r
    chord_load = chord / (s * s)
    changes = (  # at constant phi: of f by the speed ratio, of ln(chord), and of the forces
        (c / (lambda_r * lambda_r) * r / tip_radius, 0.0, 0.0, 0.0),
        (0.0, 1.0 / chord, 0.0, 0.0),
        (0.0, 0.0, -forces[4], -forces[5]),
        (0.0, 0.0, by_followed[0], by_followed[1]),
    )
    for i, (f_ratio, by_chord, tangential_x, normal_x) in enumerate(changes):
        s_x = s_k * (k_unit * normal_x + k * by_chord)
        phi_x = -(s_x + (m_unit * tangential_x + m * by_chord) / lambda_r + f_ratio) / f_phi
        s_x += s_phi * phi_x
        out[2, i], out[3, i] = phi_x, -s_x / (s * s)
        for load, force_x in enumerate((tangential_x, normal_x)):
            by_force = force_x + forces[2 + load] * phi_x
            out[load, i] = chord_load * (by_force + forces[load] * (by_chord - 2.0 * s_x / s))


@compiled(error_model="numpy")
def _point(phi, station):
    """Return phi, s, c, their slopes, and the curve's polar angle arctan(g) with its slope."""
    s, c, s_phi, c_phi = _terms(phi, *station)[0]
    return phi, s, c, s_phi, c_phi, (c_phi * s - c * s_phi) / (s * s + c * c), np.arctan2(c, s)


@compiled(error_model="numpy")
def _uneven(left, right):
    """Tell whether the curve may have hidden turning points between two points.

    It may where the slope of arctan(g), which is -1 throughout without load, differs much between
    both ends and the middle of the cubic with the values and slopes of the ends.
    """
    middle = 1.5 * (right[6] - left[6]) / (right[0] - left[0]) - 0.25 * (left[5] + right[5])
    return max(left[5], right[5], middle) > 0.7 * min(left[5], right[5], middle)


@compiled(error_model="numpy")
def _change(left, right, station, row):
    """Return two points closer together between which a row of `_point` changes its sign."""
    while right[0] - left[0] > 1e-9:
        middle = _point(0.5 * (left[0] + right[0]), station)
        if (middle[row] > 0.0) == (left[row] > 0.0):
            left = middle
        else:
            right = middle
    return left, right


@compiled(error_model="numpy")
def _add(point, knots, count):
    """Append a point to the knots; return their number."""
    g = point[2] / point[1] if point[1] > 0.0 else np.inf
    for row in range(5):
        knots[row, count] = point[row]
    knots[5, count] = g
    knots[6, count] = min(g, knots[6, count - 1]) if count else g
    return count + 1


@compiled(error_model="numpy")
def _curve(lowest, station, knots):
    """Sample a station's curve g = c / s; return the number of knots.

    knots[7, n] holds phi, s, c, their slopes, g (infinite where s <= 0) and the running minimum of
    g. The local minima of the curve are knots too. Sampling ends where the running minimum is at or
    below `lowest`, because all first roots have then been passed.
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
                if left[5] < 0.0 and right[5] > 0.0:
                    count = _add(_change(left, right, station, 5)[1], knots, count)
            elif left[1] > 0.0 and right[2] < 0.0:  # g falls to minus infinity, where s vanishes
                count = _add(_change(left, right, station, 1)[0], knots, count)
            count = _add(right, knots, count)
            if right[0] == goal[0]:
                break
            left, right = right, goal
        left = right
        if knots[6, count - 1] <= lowest:
            break
    return count


@compiled(error_model="numpy")
def _root(left, right, lambda_r, station):
    """Return the root in a bracket and the terms there (Newton, bisection where it fails)."""
    (low, f_low, slope_low), (high, f_high, slope_high) = left, right
    # Start from the cubic phi(f) with the residual's values and slopes at both ends.
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


@compiled(error_model="numpy")
def _residual(point, lambda_r):
    """Return the angle of a knot or of other terms, the residual there and its slope."""
    return point[0], point[1] - point[2] / lambda_r, point[3] - point[4] / lambda_r


@compiled(error_model="numpy")
def _first_root(lambda_r, knots, n_knots, station):
    """Return the first root (phi and the terms there), or terms with s <= 0."""
    # the first knot whose running minimum is <= lambda_r
    above = np.searchsorted(-knots[6, :n_knots], -lambda_r)
    phi, terms = 0.0, _NOTHING
    if 0 < above < n_knots:
        low, high = _residual(knots[:, above - 1], lambda_r), _residual(knots[:, above], lambda_r)
        if low[1] < 0.0 <= high[1]:
            phi, terms = _root(low, high, lambda_r, station)
    if terms[0][0] <= 0.0:  # no root in 0 to 180 degrees, or one with a negative relative speed
        high = np.nan, np.nan, np.nan
        for angle in _NEGATIVE_SAMPLES:
            s, c, s_phi, c_phi = _terms(angle, *station)[0]
            low, high = high, _residual((angle, s, c, s_phi, c_phi), lambda_r)
            if low[1] * high[1] < 0.0:
                return _root(low, high, lambda_r, station)
    return phi, terms


@compiled(error_model="numpy")
def _store(phi, terms, chord, twist, out):
    """Write a root to out[7]; see `Sections`."""
    s, c, _s_phi, _c_phi = terms[0]
    out[0], out[1] = phi, phi - twist
    out[2], out[3], out[4] = 1.0 - np.sin(phi) / s, np.cos(phi) / c - 1.0, 1.0 / s
    out[5], out[6] = chord * terms[1][1] / (s * s), chord * terms[1][0] / (s * s)


@compiled(error_model="numpy")
def _mix(polars, weights, out):
    """Write the weighted sum of polars (n, n_knots, 8) to out."""
    out[:] = 0.0
    for number in range(weights.size):
        weight = weights[number]
        if weight != 0.0:
            for row in range(out.shape[0]):
                for column in range(out.shape[1]):
                    out[row, column] += weight * polars[number, row, column]


@compiled(error_model="numpy")
def _mixed_force(phi, twist, polars, weights):
    """Return the tangential and the normal force coefficient of a weighted sum of polars."""
    lift = drag = 0.0
    for number in range(weights.size):
        section = _polar_at(phi - twist, polars[number])
        lift += weights[number] * section[0]
        drag += weights[number] * section[1]
    sine, cosine = np.sin(phi), np.cos(phi)
    return lift * sine - drag * cosine, lift * cosine + drag * sine


@compiled(error_model="numpy")
def _solve(
    tip_speed_ratio, r, chord, twist, hub_radius, tip_radius, blade_count,
    polars, section, mixture, with_derivatives,
):  # fmt: skip
    """Solve all stations at all points. Arrays are station-major, so that writes are in order.

    Station j has the polars from section[j] on times the weights mixture[0, j, i], whose
    derivatives by the other variable are mixture[1, j, i]; mixture[:, j, 0] where all points have
    the same.

    Raises
    ------
    ValueError
        For speed ratios that are not positive, and stations that do not lie on the blade.
    """
    n_points, n_stations, n_mixed = tip_speed_ratio.size, r.size, mixture.shape[3]
    last = mixture.shape[2] - 1
    if not np.min(tip_speed_ratio) > 0.0:
        raise ValueError("tip speed ratios must be positive")
    if not (hub_radius < np.min(r) and np.max(r) < tip_radius):
        raise ValueError("stations must lie strictly between hub and tip")
    state = np.zeros((7, n_stations, n_points))
    derivatives = np.zeros((4, 4 * with_derivatives, n_stations, n_points))
    knots, n_knots = np.empty((7, MOST_KNOTS)), 0
    mixed, by_followed = np.empty_like(polars[0]), (0.0, 0.0)
    for j in range(n_stations):
        station_polars = polars[section[j] : section[j] + n_mixed]
        polar = mixed if n_mixed > 1 else station_polars[0]
        station = chord[j], twist[j], r[j], hub_radius, tip_radius, blade_count, polar
        for i in range(n_points):
            lambda_r = tip_speed_ratio[i] * r[j] / tip_radius
            if n_mixed > 1 and i <= last:
                _mix(station_polars, mixture[0, j, i], mixed)
            if last > 0:
                n_knots = _curve(lambda_r, station, knots)
            elif i == 0:  # one curve serves all points
                n_knots = _curve(np.min(tip_speed_ratio) * r[j] / tip_radius, station, knots)
            phi, terms = _first_root(lambda_r, knots, n_knots, station)
            if terms[0][0] <= 0.0:  # there is no root
                continue
            _store(phi, terms, chord[j], twist[j], state[:, j, i])
            if with_derivatives:
                if n_mixed > 1:
                    slopes = mixture[1, j, min(i, last)]
                    by_followed = _mixed_force(phi, twist[j], station_polars, slopes)
                out = derivatives[:, :, j, i]
                _derivatives(terms, lambda_r, chord[j], r[j], tip_radius, by_followed, out)
    return state, derivatives


def _arguments(blade, polar, tip_speed_ratio):
    """Return a blade and its polars as `_solve` takes them, from r to mixture."""
    curves, first = polar.curves(blade.r.size, "coefficients")
    shape = (np.ascontiguousarray(x, dtype=float) for x in (blade.r, blade.chord, blade.twist))
    sizes = float(blade.hub_radius), float(blade.tip_radius), int(blade.blade_count)
    return *shape, *sizes, curves, first, polar.weights(blade, tip_speed_ratio)


def sections(blade, polar, tip_speed_ratio, derivatives=False):
    """Solve every station of a blade at every tip speed ratio; return the `Sections`.

    Stations lie strictly between hub and tip, in any order; tip_speed_ratio[n_points] is positive.
    Raises ValueError where one of these does not hold.

    Coned blades meet V cos(cone) at Omega r cos(cone) (CCBlade): a section sees the ratio of blade
    speed and flow, Omega r / V, that a plane rotor would at the tip speed ratio over cos(cone).

    Parameters
    ----------
    blade : Blade
        The blade.
    polar : Polars
        Polars of the sections.
    tip_speed_ratio : array_like of shape (n_points,)
        Omega R / V of the disc, positive.
    derivatives : bool
        Whether the derivatives are computed.

    Returns
    -------
    Sections
        State of the flow, (n_points, n_stations).

    Raises
    ------
    ValueError
        Where one of the conditions above does not hold.
    """
    points, cosine = _points(tip_speed_ratio), float(np.cos(blade.cone))
    state, gradient = _solve(points / cosine, *_arguments(blade, polar, points), derivatives)
    gradient[:, :1] /= cosine
    return Sections(*state.transpose(0, 2, 1), gradient.transpose(0, 1, 3, 2))


def sections_with(blade, polar, tip_speed_ratio, induced):
    """Return the `Sections` of a blade under given induced velocities.

    Momentum theory is not used: the induced velocities are given, such as those of a wake with
    memory, and the loads are those of the sections in the resulting flow.

    Parameters
    ----------
    blade : Blade
        The blade.
    polar : Polars
        Polars of the sections.
    tip_speed_ratio : array_like of shape (n_points,)
        Omega R / V of the disc.
    induced : ndarray of shape (n_points, 2, n_stations)
        Axial velocity against the flow and tangential velocity against the rotation, over the
        speed of the flow normal to the blade.

    Returns
    -------
    Sections
        State of the flow, (n_points, n_stations), without derivatives.
    """
    return Sections(*_state_under(blade, _points(tip_speed_ratio), induced, polar), np.empty(0))


def _state_under(blade, tip_speed_ratio, induced, polar, followed=0.0):
    """Return all but the derivatives of `Sections` under given induced velocities.

    All but the polars and the radii may have a complex step; followed is that of what the polars
    follow.
    """
    lambda_r = tip_speed_ratio[:, None] * (blade.r / blade.rotor_radius)
    axial, swirl = induced[:, 0], induced[:, 1]
    normal, tangential = 1.0 - axial, lambda_r + swirl
    phi = np.arctan2(normal.real, tangential.real)
    squared = normal**2 + tangential**2
    if np.iscomplexobj(squared):  # arctan2 takes no complex numbers
        turned = np.cos(phi) * normal.imag - np.sin(phi) * tangential.imag
        phi = phi + 1j * turned / np.sqrt(squared.real)
    alpha, sine, cosine = phi - blade.twist, np.sin(phi), np.cos(phi)
    values, _, by_followed = polar.along("coefficients", blade, tip_speed_ratio, alpha)
    lift, drag = blade.chord * squared * (values + followed * by_followed)
    loads = lift * cosine + drag * sine, lift * sine - drag * cosine
    return phi, alpha, axial, swirl / lambda_r, np.sqrt(squared), *loads


def sections_behind(blade, polar, wake, wake_ratio, tip_speed_ratio):
    """Return the `Sections` of a blade in the wake of another tip speed ratio.

    The velocities induced at the wake's tip speed ratio are kept, as shares of the flow's speed.

    Parameters
    ----------
    blade : Blade
        The blade.
    polar : Polars
        Polars of the sections.
    wake : Sections
        What `sections` returns at the tip speed ratios of the wake.
    wake_ratio, tip_speed_ratio : ndarray of shape (n_points,)
        Omega R / V of the disc, of the wake and of the blade.

    Returns
    -------
    Sections
        State of the flow, (n_points, n_stations). Derivatives, if the wake has them, are totals:
        those by the tip speed ratio with the wake unchanged, the others with the wake of the
        changed blade.
    """
    flow = sections_with(blade, polar, tip_speed_ratio, induced_speeds(blade, wake, wake_ratio))
    if not wake.derivatives.size:
        return flow
    derivatives = np.zeros((4, len(INPUTS), *flow.inflow_angle.shape))
    for column in range(len(INPUTS)):
        step = 1j * STEP * (np.arange(len(INPUTS)) == column)
        angle, speed = wake.derivatives[2:, column] * (column > 0)
        changed = wake._replace(
            inflow_angle=wake.inflow_angle + 1j * STEP * angle,
            relative_speed=wake.relative_speed + 1j * STEP * speed,
        )
        moved = replace(blade, chord=blade.chord + step[1], twist=blade.twist + step[2])
        induced = induced_speeds(blade, changed, wake_ratio)
        state = _state_under(moved, tip_speed_ratio + step[0], induced, polar, step[3])
        phi, *_, speed, normal, tangential = state
        derivatives[:, column] = np.imag((tangential, normal, phi, speed)) / STEP
    return flow._replace(derivatives=derivatives)


def induced_speeds(blade, flow, tip_speed_ratio):
    """Return the velocities induced by the wake of solved sections; zero without a root.

    Parameters
    ----------
    blade : Blade
        The blade.
    flow : Sections
        What `sections` returns.
    tip_speed_ratio : ndarray of shape (n_points,)
        Omega R / V of the disc.

    Returns
    -------
    ndarray of shape (n_points, 2, n_stations)
        As `sections_with` takes it.
    """
    lambda_r = tip_speed_ratio[:, None] * (blade.r / blade.rotor_radius)
    axial = 1.0 - flow.relative_speed * np.sin(flow.inflow_angle)
    swirl = flow.relative_speed * np.cos(flow.inflow_angle) - lambda_r
    return np.where(flow.relative_speed[:, None] != 0.0, np.stack((axial, swirl), axis=1), 0.0)


def torque_weights(blade):
    """Return the weights w[n_stations] with torque coefficient = w @ tangential_load.

    The trapezoidal rule over hub, stations and tip with no load at hub and tip, as in CCBlade. The
    cone does not appear: loads times the lever arm, and the cube of the disc's radius, are both
    proportional to the cube of its cosine.

    Parameters
    ----------
    blade : Blade
        The blade.

    Returns
    -------
    ndarray of shape (n_stations,)
        Weights, 1/m.
    """
    spacing = 0.5 * (blade.edges[2:] - blade.edges[:-2])
    return blade.blade_count * spacing * blade.r / (np.pi * blade.tip_radius**3)


def rotor_coefficients(blade, polar, tip_speed_ratio, derivatives=False, flow=None):
    """Return the `Coefficients` of a rotor, and the torque's derivatives if asked.

    The coefficients depend on lengths only through their ratios: hence the slope by the radius.

    Stations ascend; polar, tip_speed_ratio[n_points] and errors are those of `sections`. A
    RuntimeWarning says where a station has no root; its load is taken as zero there.

    Parameters
    ----------
    blade : Blade
        The blade.
    polar : Polars
        Polars of the sections.
    tip_speed_ratio : array_like of shape (n_points,)
        Omega R / V of the disc, positive.
    derivatives : bool
        Whether the derivatives are computed.
    flow : Sections, optional
        The flow at the points, if it is known, with its derivatives if they are asked for.

    Returns
    -------
    Coefficients
        Coefficients at the points.

    Raises
    ------
    ValueError
        As `sections`.
    """
    points = _points(tip_speed_ratio)
    if flow is None:
        flow = sections(blade, polar, points, derivatives)
    if missing := np.count_nonzero(flow.relative_speed == 0.0):
        text = f"no root at {missing} of {flow.relative_speed.size} sections"
        warnings.warn(f"{text}: their loads are set to zero", RuntimeWarning, stacklevel=2)
    weights = torque_weights(blade)
    torque = weights @ flow.tangential_load.T
    thrust = (weights * blade.rotor_radius / blade.r) @ flow.normal_load.T
    if not derivatives:
        return Coefficients(Table(torque), torque * points, thrust)
    by, by_reynolds = _torque_derivatives(blade, polar, points, flow.derivatives[0])
    return Coefficients(Table(torque, *by), torque * points, thrust, by_reynolds)


def _torque_derivatives(blade, polar, points, gradient):
    """Return the torque's slopes as `Table` has them, and those by the Reynolds number."""
    by_ratio, by_chord, by_twist, by_followed = gradient * torque_weights(blade)
    by_radius = -(by_chord @ blade.chord) / blade.rotor_radius
    by_reynolds = np.zeros(points.size)
    if polar.follows_reynolds:
        # chord and tip speed ratio change the Reynolds number too; the radius does not
        squared = (points[:, None] * blade.r / blade.rotor_radius) ** 2
        by_ratio = by_ratio + by_followed * squared / (1.0 + squared) / points[:, None]
        by_chord = by_chord + by_followed / blade.chord
        by_reynolds, by_followed = np.sum(by_followed, axis=1), 0.0 * by_followed
    return (np.sum(by_ratio, axis=1), by_chord, by_twist, by_followed, by_radius), by_reynolds


def _points(tip_speed_ratio):
    """Return tip speed ratios as an array of one axis."""
    return np.atleast_1d(np.asarray(tip_speed_ratio, dtype=float))
