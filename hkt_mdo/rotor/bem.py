"""Blade element momentum theory for all stations and operating points at once.

Ning's single residual in the inflow angle phi (Wind Energy 17(9), 2014) with the equations, loss factors
and high-induction branch of CCBlade. Written with

    s(phi) = sin(phi) / (1 - a),    c(phi) = cos(phi) (1 - k'),

neither of which depends on the operating point, the residual is f = s - c / lambda_r. Both are free of the
singularities of the induction factors: 1 / (1 - a) is 1 + k up to k = 2/3 and sqrt(g2) + 5/3 - F beyond it
(Buhl's branch, whose quotient in Ning's eq. 19 has g3 as a common factor), and c = cos(phi) - cos(phi) k'
is finite at phi = 90 degrees. The relative speed follows as W = V / s.

A station is sampled once over phi; at each tip speed ratio the first interval from phi = 0 in which the
residual rises through zero holds the root with the lowest angle of attack, the attached one. Where there is
none, the root is sought with phi < 0 (propeller brake) and beyond 90 degrees, in CCBlade's order.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

PHI_MIN = 1e-6  # CCBlade's distance from the singular points phi = 0 and pi
N_SAMPLES = 48
# Samples crowd towards phi = 0, where rotors work.
_SAMPLES = PHI_MIN + (0.5 * np.pi - PHI_MIN) * np.linspace(0.0, 1.0, N_SAMPLES) ** 1.5

# Rows of `Sections.derivatives`
INPUTS = ("tip_speed_ratio", "chord", "twist", "r", "hub_radius", "tip_radius")


class Sections(NamedTuple):
    """What happens at every operating point (axis 0) and station (axis 1).

    normal_load and tangential_load are N/m over 0.5 rho V², that is metres; derivatives hold those of
    the tangential, then the normal load with respect to `INPUTS` (shape (2, 6, n_points, n_stations)).
    """

    inflow_angle: np.ndarray
    angle_of_attack: np.ndarray
    axial_induction: np.ndarray
    tangential_induction: np.ndarray
    relative_speed: np.ndarray
    normal_load: np.ndarray
    tangential_load: np.ndarray
    residual: np.ndarray
    roots: np.ndarray
    derivatives: np.ndarray


class Coefficients(NamedTuple):
    """Rotor coefficients at n operating points, and the torque coefficient's derivatives.

    torque = Q / (0.5 rho V² pi R³), power = P / (0.5 rho V³ pi R²), thrust = T / (0.5 rho V² pi R²),
    each of shape (n,); torque_by_chord (1/m) and torque_by_twist (1/rad) of shape (n, n_stations).
    """

    torque: np.ndarray
    power: np.ndarray
    thrust: np.ndarray
    torque_by_tip_speed_ratio: np.ndarray
    torque_by_chord: np.ndarray
    torque_by_twist: np.ndarray


@njit(cache=True, error_model="numpy")
def _shape_terms(phi, chord, twist, r, hub_radius, tip_radius, blade_count, polar):
    """Return s, c and the tangential and normal force coefficient of a station at an inflow angle."""
    sine, cosine = np.sin(phi), np.cos(phi)
    n_knots = polar.shape[0]
    alpha = phi - twist
    place = (alpha.real / np.pi + 1.0) * 0.5 * n_knots
    index = int(np.floor(place))
    x = alpha - (2.0 * np.pi / n_knots * index - np.pi)
    row = polar[index % n_knots]
    lift = row[0] + x * (row[1] + x * (row[2] + x * row[3]))
    drag = row[4] + x * (row[5] + x * (row[6] + x * row[7]))
    normal = lift * cosine + drag * sine
    tangential = lift * sine - drag * cosine
    size = sine if sine.real > 0.0 else -sine
    tip = 0.5 * blade_count * (tip_radius - r) / (r * size)
    hub = 0.5 * blade_count * (r - hub_radius) / (hub_radius * size)
    loss = (2.0 / np.pi) ** 2 * np.arccos(np.exp(-tip)) * np.arccos(np.exp(-hub))
    solidity = blade_count * chord / (2.0 * np.pi * r)
    k = solidity * normal / (4.0 * loss * sine * sine)
    c = cosine - solidity * tangential / (4.0 * loss * sine)
    if phi.real > 0.0:
        if k.real <= 2.0 / 3.0:
            s = sine * (1.0 + k)
        else:
            s = sine * (np.sqrt(2.0 * loss * k - (4.0 / 3.0 - loss) * loss) + 5.0 / 3.0 - loss)
    else:
        s = sine * (1.0 - k)
    return s, c, tangential, normal


@njit(cache=True, error_model="numpy")
def _derivatives(phi, lambda_r, lambda_r_by, chord, twist, r, hub_radius, tip_radius, blade_count, polar, out):
    """Fill out[2, 6]: total derivatives of the tangential and normal load at a root, by `INPUTS`.

    The residual's own partials give dphi/dx = -f_x / f_phi; nothing passes through the solver's steps.
    """
    sine, cosine = np.sin(phi), np.cos(phi)
    n_knots = polar.shape[0]
    alpha = phi - twist
    index = int(np.floor((alpha / np.pi + 1.0) * 0.5 * n_knots))
    x = alpha - (2.0 * np.pi / n_knots * index - np.pi)
    row = polar[index % n_knots]
    lift = row[0] + x * (row[1] + x * (row[2] + x * row[3]))
    drag = row[4] + x * (row[5] + x * (row[6] + x * row[7]))
    lift_a = row[1] + x * (2.0 * row[2] + x * 3.0 * row[3])
    drag_a = row[5] + x * (2.0 * row[6] + x * 3.0 * row[7])
    normal = lift * cosine + drag * sine
    tangential = lift * sine - drag * cosine
    normal_a = lift_a * cosine + drag_a * sine
    tangential_a = lift_a * sine - drag_a * cosine

    sign = 1.0 if sine > 0.0 else -1.0
    tip = 0.5 * blade_count * (tip_radius - r) / (r * sign * sine)
    hub = 0.5 * blade_count * (r - hub_radius) / (hub_radius * sign * sine)
    exp_tip, exp_hub = np.exp(-tip), np.exp(-hub)
    acos_tip, acos_hub = np.arccos(exp_tip), np.arccos(exp_hub)
    loss = (2.0 / np.pi) ** 2 * acos_tip * acos_hub
    # d ln(loss) / d(tip exponent), d(hub exponent)
    log_tip = exp_tip / (np.sqrt(1.0 - exp_tip * exp_tip) * acos_tip)
    log_hub = exp_hub / (np.sqrt(1.0 - exp_hub * exp_hub) * acos_hub)
    cot = cosine / sine
    loss_phi = -(log_tip * tip + log_hub * hub) * cot
    loss_r = -log_tip * 0.5 * blade_count * tip_radius / (r * r * sign * sine) + (
        log_hub * 0.5 * blade_count / (hub_radius * sign * sine)
    )
    loss_hub = -log_hub * 0.5 * blade_count * r / (hub_radius * hub_radius * sign * sine)
    loss_tip = log_tip * 0.5 * blade_count / (r * sign * sine)

    solidity = blade_count * chord / (2.0 * np.pi * r)
    k_per_normal = solidity / (4.0 * loss * sine * sine)
    m_per_tangential = solidity / (4.0 * loss * sine)
    k, m = k_per_normal * normal, m_per_tangential * tangential

    # by x = phi, chord, twist, r, hub radius, tip radius: d ln(loss), d ln(solidity), dk, dm, ds, dc
    s_k = sine
    s_loss = 0.0
    if phi > 0.0:
        if k <= 2.0 / 3.0:
            bracket = 1.0 + k
        else:
            root = np.sqrt(2.0 * loss * k - (4.0 / 3.0 - loss) * loss)
            bracket = root + 5.0 / 3.0 - loss
            s_k = sine * loss / root
            s_loss = sine * ((k - 2.0 / 3.0 + loss) / root - 1.0)
    else:
        bracket = 1.0 - k
        s_k = -sine
    s = sine * bracket
    c = cosine - m

    k_phi = k_per_normal * (-lift * sine + drag * cosine + normal_a) - k * (loss_phi + 2.0 * cot)
    m_phi = m_per_tangential * (lift * cosine + drag * sine + tangential_a) - m * (loss_phi + cot)
    s_phi = cosine * bracket + s_k * k_phi + s_loss * loss * loss_phi
    c_phi = -sine - m_phi
    f_phi = s_phi - c_phi / lambda_r
    load_t, load_n = chord * tangential / (s * s), chord * normal / (s * s)
    t_phi = chord * (lift * cosine + drag * sine + tangential_a) / (s * s) - 2.0 * load_t * s_phi / s
    n_phi = chord * (-lift * sine + drag * cosine + normal_a) / (s * s) - 2.0 * load_n * s_phi / s

    for i in range(6):
        log_loss = 0.0
        log_solidity = 0.0
        normal_x = 0.0
        tangential_x = 0.0
        chord_x = 0.0
        if i == 1:
            log_solidity = 1.0 / chord
            chord_x = 1.0
        elif i == 2:
            normal_x = -normal_a
            tangential_x = -tangential_a
        elif i == 3:
            log_loss = loss_r
            log_solidity = -1.0 / r
        elif i == 4:
            log_loss = loss_hub
        elif i == 5:
            log_loss = loss_tip
        k_x = k_per_normal * normal_x + k * (log_solidity - log_loss)
        m_x = m_per_tangential * tangential_x + m * (log_solidity - log_loss)
        s_x = s_k * k_x + s_loss * loss * log_loss
        f_x = s_x + m_x / lambda_r + c / (lambda_r * lambda_r) * lambda_r_by[i]
        phi_x = -f_x / f_phi
        out[0, i] = (
            chord_x * tangential / (s * s) + chord * tangential_x / (s * s) - 2.0 * load_t * s_x / s + t_phi * phi_x
        )
        out[1, i] = chord_x * normal / (s * s) + chord * normal_x / (s * s) - 2.0 * load_n * s_x / s + n_phi * phi_x


@njit(cache=True, error_model="numpy")
def _refine(low, high, f_low, f_high, lambda_r, chord, twist, r, hub_radius, tip_radius, blade_count, polar):
    """Return the root inside a bracket (Chandrupatla's method: inverse quadratic steps, else bisection)."""
    a, b, f_a, f_b = high, low, f_high, f_low
    share = 0.5
    for _ in range(80):
        new = a + share * (b - a)
        s, c, _t, _n = _shape_terms(new, chord, twist, r, hub_radius, tip_radius, blade_count, polar)
        f = s - c / lambda_r
        if (f > 0.0) == (f_a > 0.0):
            third, f_third = a, f_a
        else:
            third, f_third = b, f_b
            b, f_b = a, f_a
        a, f_a = new, f
        best, f_best = (a, f_a) if abs(f_a) < abs(f_b) else (b, f_b)
        tolerance = 4.5e-16 * abs(best) + 1e-15
        limit = tolerance / abs(b - a)
        if limit > 0.5 or f_best == 0.0:
            return best
        xi = (a - b) / (third - b)
        ratio = (f_a - f_b) / (f_third - f_b)
        if 1.0 - np.sqrt(1.0 - xi) < ratio < np.sqrt(xi):
            share = f_a / (f_b - f_a) * f_third / (f_b - f_third) + (
                (third - a) / (b - a) * f_a / (f_third - f_a) * f_b / (f_third - f_b)
            )
            share = min(max(share, limit), 1.0 - limit)
        else:
            share = 0.5
    return best


@njit(cache=True, error_model="numpy")
def _solve(tip_speed_ratio, r, chord, twist, hub_radius, tip_radius, blade_count, polar, samples, want_derivatives):
    n_points, n_stations, n_samples = tip_speed_ratio.size, r.size, samples.size
    state = np.empty((8, n_points, n_stations))
    roots = np.empty((n_points, n_stations), dtype=np.int64)
    derivatives = np.empty((2, 6, n_points if want_derivatives else 0, n_stations))
    gradient = np.empty((2, 6))
    by = np.zeros(6)
    s_sample, c_sample = np.empty(n_samples), np.empty(n_samples)
    for j in range(n_stations):
        station = (chord[j], twist[j], r[j], hub_radius, tip_radius, blade_count, polar)
        for m in range(n_samples):
            s_sample[m], c_sample[m], _t, _n = _shape_terms(samples[m], *station)
        for i in range(n_points):
            lambda_r = tip_speed_ratio[i] * r[j] / tip_radius
            count = 0
            low, high, f_low, f_high = 0.0, 0.0, 0.0, 0.0
            before = s_sample[0] - c_sample[0] / lambda_r
            for m in range(1, n_samples):
                now = s_sample[m] - c_sample[m] / lambda_r
                if (before < 0.0) != (now < 0.0):
                    if count == 0:
                        low, high, f_low, f_high = samples[m - 1], samples[m], before, now
                    count += 1
                before = now
            if count == 0:
                s, c, _t, _n = _shape_terms(-0.25 * np.pi, *station)
                f_low = s - c / lambda_r
                s, c, _t, _n = _shape_terms(-PHI_MIN, *station)
                f_high = s - c / lambda_r
                low, high = -0.25 * np.pi, -PHI_MIN
                if not (f_low < 0.0 and f_high > 0.0):
                    low, high = 0.5 * np.pi, np.pi - PHI_MIN
                    s, c, _t, _n = _shape_terms(low, *station)
                    f_low = s - c / lambda_r
                    s, c, _t, _n = _shape_terms(high, *station)
                    f_high = s - c / lambda_r
            phi = _refine(low, high, f_low, f_high, lambda_r, *station)
            s, c, tangential, normal = _shape_terms(phi, *station)
            state[0, i, j] = phi
            state[1, i, j] = phi - twist[j]
            state[2, i, j] = 1.0 - np.sin(phi) / s
            state[3, i, j] = np.cos(phi) / c - 1.0
            state[4, i, j] = 1.0 / s
            state[5, i, j] = chord[j] * normal / (s * s)
            state[6, i, j] = chord[j] * tangential / (s * s)
            state[7, i, j] = s - c / lambda_r
            roots[i, j] = count
            if want_derivatives:
                by[0] = r[j] / tip_radius
                by[3] = tip_speed_ratio[i] / tip_radius
                by[5] = -lambda_r / tip_radius
                _derivatives(phi, lambda_r, by, *station, gradient)
                derivatives[:, :, i, j] = gradient
    return state, roots, derivatives


def sections(blade, polar, tip_speed_ratio, derivatives=False):
    """Solve every station of a blade at every tip speed ratio.

    Parameters
    ----------
    blade : Blade
    polar : Polar
    tip_speed_ratio : array, shape (n_points,)
        Positive.
    derivatives : bool
        Whether to fill `Sections.derivatives`.

    Returns
    -------
    Sections
    """
    points = np.atleast_1d(np.asarray(tip_speed_ratio, dtype=float))
    state, roots, gradient = _solve(
        points,
        np.ascontiguousarray(blade.r, dtype=float),
        np.ascontiguousarray(blade.chord, dtype=float),
        np.ascontiguousarray(blade.twist, dtype=float),
        float(blade.hub_radius),
        float(blade.tip_radius),
        blade.blade_count,
        polar.coefficients,
        _SAMPLES,
        derivatives,
    )
    return Sections(*state, roots, gradient)


def torque_weights(blade):
    """Return the weights w[n_stations] with torque coefficient = w @ tangential_load.

    The trapezoidal rule over hub, stations and tip with no load at hub and tip, as in CCBlade.
    """
    edges = np.concatenate(([blade.hub_radius], blade.r, [blade.tip_radius]))
    spacing = 0.5 * (edges[2:] - edges[:-2])
    return blade.blade_count * spacing * blade.r / (np.pi * blade.tip_radius**3)


def rotor_coefficients(blade, polar, tip_speed_ratio, derivatives=False):
    """Torque, power and thrust coefficient of a rotor, with the torque's derivatives when asked for.

    Parameters
    ----------
    blade : Blade
    polar : Polar
    tip_speed_ratio : array, shape (n_points,)
    derivatives : bool

    Returns
    -------
    Coefficients
        Derivatives are empty unless asked for.
    """
    points = np.atleast_1d(np.asarray(tip_speed_ratio, dtype=float))
    found = sections(blade, polar, points, derivatives)
    weights = torque_weights(blade)
    torque = found.tangential_load @ weights
    thrust = found.normal_load @ (weights * blade.tip_radius / blade.r)
    by = found.derivatives[0]
    return Coefficients(
        torque, torque * points, thrust, by[0] @ weights, by[1] * weights, by[2] * weights
    )
