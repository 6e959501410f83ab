"""The best section of every station at every tip speed ratio, global by construction.

At an inflow angle phi and a local speed ratio lambda_r let tan(delta) = cd / cl and tau = sin(phi)
tan(phi - delta). With k and m = tau k of `hkt_mdo.rotor.bem`, the residual says

    m = cos(phi) - lambda_r sin(phi) bracket(k),        load = m lambda_r² / (q (cos(phi) - m)²),

where q = m / (chord ct) does not depend on the section. bracket increases with k, so k falls and m
and the load rise with tau: the section with the least delta is the best at this phi, and the chord
follows from k, which is the root of a linear equation (k <= 2/3) or of a quadratic one (Buhl). An
optimum is hence one of

    chord and twist inside their bounds, where delta has a local minimum,
    twist at a bound, chord inside,
    chord at a bound,

each a search in one variable. A positive load needs 0 < phi < arctan(1 / lambda_r), lift, and
delta < phi. A station without a positive load, such as a cylinder, has its optimum at a bound of
the chord. Roots that BEM would not choose, as a smaller one exists, only raise the best load.
"""

import numpy as np

from hkt_mdo.compiled import compiled
from hkt_mdo.rotor import bem

ANGLES = 32  # of the search in the inflow angle, before it is refined
NARROWINGS = 24  # of a bracket, each by 0.618
TWISTS = 91  # of the search where the chord is at a bound
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@compiled(error_model="numpy")
def _delta(alpha, polar):
    """Return delta, the angle between force and lift, and the force coefficient."""
    lift, drag, _, _ = bem._polar_at(alpha, polar)
    return np.arctan2(drag, lift), np.hypot(lift, drag)


@compiled(error_model="numpy", inline="always")
def _narrow(low, high, function, arguments):
    """Return where a function is largest in a bracket (golden section)."""
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_left, at_right = function(left, *arguments)[0], function(right, *arguments)[0]
    for _ in range(NARROWINGS):
        if at_left > at_right:
            high, right, at_right = right, left, at_left
            left = high - _GOLDEN * (high - low)
            at_left = function(left, *arguments)[0]
        else:
            low, left, at_left = left, right, at_right
            right = low + _GOLDEN * (high - low)
            at_right = function(right, *arguments)[0]
    return 0.5 * (low + high)


@compiled(error_model="numpy", inline="always")
def _highest(places, function, arguments):
    """Return where a function is largest: at a place, or between its neighbours (`_narrow`)."""
    last, values = places.size - 1, np.empty(places.size)
    for i in range(places.size):
        values[i] = function(places[i], *arguments)[0]
    top = np.argmax(values)
    highest, at = values[top], places[top]
    for i in range(places.size):
        before, after = max(i - 1, 0), min(i + 1, last)
        lower, higher = min(values[before], values[after]), max(values[before], values[after])
        if values[i] >= higher and values[i] > lower:
            between = _narrow(places[before], places[after], function, arguments)
            value = function(between, *arguments)[0]
            if value > highest:
                highest, at = value, between
    return at


@compiled(error_model="numpy")
def _less(alpha, polar):
    """Return -delta, as a tuple for `_narrow`."""
    return (-_delta(alpha, polar)[0],)


@compiled(error_model="numpy")
def _minima(polar):
    """Return the angles of attack of the local minima of delta below 90 deg, its lowest first."""
    n_knots = polar.shape[0]
    step = 2.0 * np.pi / n_knots
    delta = [np.arctan2(row[4], row[0]) for row in polar]
    angles, count, lowest = np.empty(n_knots), 0, np.inf
    for i, here in enumerate(delta):
        if here < 0.5 * np.pi and here < delta[i - 1] and here <= delta[(i + 1) % n_knots]:
            knot = i * step - np.pi
            angles[count] = _narrow(knot - step, knot + step, _less, (polar,))
            depth = _delta(angles[count], polar)[0]
            if depth < lowest:
                lowest, angles[0], angles[count] = depth, angles[count], angles[0]
            count += 1
    return angles[:count]


@compiled(error_model="numpy")
def _load(phi, delta, lambda_r, station):
    """Return the load at an inflow angle, and chord times normal force coefficient for it."""
    r, hub_radius, tip_radius, blade_count = station
    sine, cosine = np.sin(phi), np.cos(phi)
    tau = sine * np.tan(phi - delta)
    if delta >= phi:
        return 0.0, 0.0
    tip, _ = bem._loss_at(0.5 * blade_count * (tip_radius - r) / (r * sine))
    hub, _ = bem._loss_at(0.5 * blade_count * (r - hub_radius) / (hub_radius * sine))
    loss = tip * hub
    q = blade_count / (8.0 * np.pi * r * loss * sine)
    speed = lambda_r * sine
    k = (cosine - speed) / (speed + tau)
    if k > 2.0 / 3.0:
        square, free = 0.5 * tau / loss, speed * (5.0 / 3.0 - loss) - cosine
        free += 0.5 * tau * (4.0 / 3.0 - loss)
        root = -2.0 * free / (speed + np.sqrt(speed * speed - 4.0 * square * free))
        k = 0.5 * root * root / loss + 0.5 * (4.0 / 3.0 - loss)
    m = tau * k
    return m * (lambda_r / (cosine - m)) ** 2 / q, k * sine / q


@compiled(error_model="numpy")
def _best_at(phi, lambda_r, station, polar, minima, chord_bounds, twist_bounds):
    """Return the best load at an inflow angle over the local minima of delta and twist's bounds.

    Also chord and angle of attack there.
    """
    low, high = phi - twist_bounds[1], phi - twist_bounds[0]
    load, chord, best = -1.0, 0.0, 0.0
    for i in range(3 * minima.size + 2):
        if i < 2:
            alpha = low if i == 0 else high
        else:
            alpha = minima[(i - 2) // 3] + ((i - 2) % 3 - 1) * 2.0 * np.pi
            if not low < alpha < high:
                continue
        delta, force = _delta(alpha, polar)
        value, normal = _load(phi, delta, lambda_r, station)
        width = normal / (force * np.cos(phi - delta))
        if value > load and chord_bounds[0] <= width <= chord_bounds[1]:
            load, chord, best = value, width, alpha
    return load, chord, best


@compiled(error_model="numpy")
def _search(lambda_r, station, polar, minima, chord_bounds, twist_bounds):
    """Return load, chord and twist of the best inflow angle; the load is 0 if there is none."""
    arguments = (lambda_r, station, polar, minima, chord_bounds, twist_bounds)
    high = np.arctan(1.0 / lambda_r)
    room = high - _delta(minima[0], polar)[0] if minima.size else 0.0
    if room <= 0.0:
        return 0.0, 0.0, 0.0
    # crowded towards the undisturbed angle, where little lift or a narrow chord has its optimum
    phi = _highest(high - room * np.linspace(1.0, 0.0, ANGLES + 1) ** 1.5, _best_at, arguments)
    load, chord, alpha = _best_at(phi, *arguments)
    return load, chord, phi - alpha


@compiled(error_model="numpy")
def _turned(twist, chord, lambda_r, station, polar, knots):
    """Return the load of a section by BEM, as a tuple for `_highest`."""
    whole = chord, twist, *station, polar
    _, terms = bem._first_root(lambda_r, knots, bem._curve(lambda_r, whole, knots), whole)
    s = terms[0][0]
    return (chord * terms[1][0] / (s * s) if s > 0.0 else -np.inf,)


@compiled(error_model="numpy")
def _solve(lambda_r, r, ends, polars, section, chord_bounds, twist_bounds):
    """Return the best load, chord and twist, [3, n_points, n_stations]."""
    out, knots = np.empty((3, *lambda_r.shape)), np.empty((7, bem.MOST_KNOTS))
    twists = np.linspace(twist_bounds[0], twist_bounds[1], TWISTS)
    for j in range(lambda_r.shape[1]):
        station, polar = (r[j], *ends), polars[section[j]]
        minima = _minima(polar)
        for i in range(lambda_r.shape[0]):
            point = lambda_r[i, j], station, polar
            best = _search(*point, minima, (0.0, np.inf), twist_bounds)
            if not chord_bounds[0] <= best[1] <= chord_bounds[1]:
                best = _search(*point, minima, chord_bounds, twist_bounds)
                if best[0] <= 0.0:
                    best = -np.inf, chord_bounds[0], twist_bounds[0]
                for chord in chord_bounds:
                    twist = _highest(twists, _turned, (chord, *point, knots))
                    load = _turned(twist, chord, *point, knots)[0]
                    if load > best[0]:
                        best = load, chord, twist
            out[0, i, j], out[1, i, j], out[2, i, j] = best
    return out


def best_sections(blade, polar, tip_speed_ratio, bounds):
    """Return the best tangential loads over chord (m) and twist (rad) within their bounds.

    Blade, polar (a `Polar` or `ByStation`) and tip_speed_ratio[n_points] are those of
    `hkt_mdo.rotor.bem.sections`.

    Parameters
    ----------
    blade : Blade
        The blade.
    polar : Polars
        Polars of the sections.
    tip_speed_ratio : array_like of shape (n_points,)
        Omega R / V of the disc, positive.
    bounds : dict of str to tuple of float
        Smallest and largest chord (m) and twist (rad).

    Returns
    -------
    ndarray of shape (3, n_points, n_stations)
        The loads (m, as in `hkt_mdo.rotor.bem.Sections`), their chords (m) and twists (rad).
    """
    points = bem._points(tip_speed_ratio)
    r, _, _, *ends, polars, section, _ = bem._arguments(blade, polar, points)
    lambda_r = points[:, None] * r / blade.rotor_radius
    limits = (tuple(map(float, bounds[name])) for name in ("chord", "twist"))
    return _solve(lambda_r, r, tuple(ends), polars, section, *limits)
