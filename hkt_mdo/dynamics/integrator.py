"""A stiff integrator for the speed of a rotor under direct BEM, compiled by numba.

Radau IIA collocation with three stages (order 5; Hairer and Wanner, Solving Ordinary Differential
Equations II, section IV.8) for the one equation I dw/dt = Q(w, v(t)) - u, with the captured and the
generated energy as quadratures over its stages. Flow and control torque are piecewise polynomials.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.polynomial import Legendre

from hkt_mdo.rotor.bem import (
    _NEGATIVE_SAMPLES,
    MOST_KNOTS,
    LocalReynolds,
    _arguments,
    _brake_bracket,
    _curve,
    _mix,
    _root,
    torque_weights,
)
from hkt_mdo.rotor.scales import torque_scale

SLOWEST_RATIO = 0.05  # tip speed ratio at which a rotor counts as standing still
DONE, STOPPED, FAILED, TOO_FAST = range(4)  # how an integration ends

STAGES = 3
DEGREE = 5  # of fitted pieces
MOST_PIECES = 1_000_000
PIECES_A_STEP = 8  # of the flow: no step of the integration spans more

_compile = njit(cache=True, error_model="numpy")


def _radau():
    """Return nodes, matrix, its eigenvalues and vectors, weights of error and of dense output."""
    roots = Legendre.basis(STAGES) - Legendre.basis(STAGES - 1)
    nodes = 0.5 + 0.5 * np.sort(roots.roots().real)
    orders = np.arange(1.0, STAGES + 1.0)
    matrix = nodes[:, None] ** orders / orders @ np.linalg.inv(nodes[:, None] ** (orders - 1.0))
    eigenvalues, vectors = np.linalg.eig(matrix)
    first = float(eigenvalues[np.argmin(np.abs(eigenvalues.imag))].real)
    moments = 1.0 / orders - first * (orders == 1.0)  # embedded formula with weight first at c = 0
    embedded = np.linalg.solve(nodes ** (orders - 1.0)[:, None], moments)
    dense = np.linalg.inv(np.vander(2.0 * np.append(0.0, nodes) - 1.0, increasing=True))
    return nodes, matrix, eigenvalues, vectors, first, embedded - matrix[-1], dense


_NODES, _MATRIX, _EIGENVALUES, _VECTORS, _FIRST, _LATER, _DENSE = _radau()
_BACK = np.linalg.inv(_VECTORS)
_STAGE_ERROR = _LATER @ np.linalg.inv(_MATRIX)


class Pieces(NamedTuple):
    """A piecewise polynomial: edges[n + 1], and coefficients[n, degree + 1] by rising power.

    The variable of each polynomial runs from -1 to 1 over its piece. The first and the last piece
    hold beyond the ends, too.
    """

    edges: np.ndarray
    coefficients: np.ndarray

    def __call__(self, x):
        """Return the values at x of any shape."""
        edges, x = self.edges, np.asarray(x, dtype=float)
        piece = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
        place = 2.0 * (x - edges[piece]) / (edges[piece + 1] - edges[piece]) - 1.0
        value = np.zeros(x.shape)
        for column in self.coefficients.T[::-1]:
            value = value * place + column[piece]
        return value


def fit(function, edges, tolerance):
    """Return a function (vectorized) of one variable as `Pieces` of degree 5, checked against it.

    Pieces between the given edges are halved until the interpolant is as accurate as asked at five
    points between its own six. Returns None where that takes more than a million pieces, or where
    the function is not finite.

    Parameters
    ----------
    function : callable
    edges : array, shape (n + 1,)
    tolerance : float
        Largest error over the largest magnitude of the function.
    """
    nodes = -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
    probes = 0.5 * (nodes[1:] + nodes[:-1])
    to_coefficients = np.linalg.inv(np.vander(nodes, increasing=True)).T
    to_probes = np.vander(probes, DEGREE + 1, increasing=True).T
    shortest = 1e-13 * (edges[-1] - edges[0])  # a jump is left within a piece of this length
    left, width = edges[:-1], np.diff(edges)
    lefts, found, count, size = [], [], 0, 0.0
    while left.size:
        x = left[:, None] + width[:, None] * (0.5 + 0.5 * np.append(nodes, probes))
        values = np.reshape(function(x.ravel()), x.shape)
        count += left.size
        size = max(size, float(np.max(np.abs(values))))
        if count > MOST_PIECES or not np.isfinite(size):
            return None
        coefficients = values[:, : nodes.size] @ to_coefficients
        error = np.max(np.abs(coefficients @ to_probes - values[:, nodes.size :]), axis=1)
        good = (error <= tolerance * size) | (width < shortest)
        lefts.append(left[good])
        found.append(coefficients[good])
        left, width = left[~good], 0.5 * width[~good]
        left, width = np.append(left, left + width), np.append(width, width)
    lefts, found = np.concatenate(lefts), np.concatenate(found)
    order = np.argsort(lefts)
    return Pieces(np.append(lefts[order], edges[-1]), np.ascontiguousarray(found[order]))


class Rotor(NamedTuple):
    """What the compiled equation of motion needs of a rotor, its flow and its controller.

    knots[n_stations, 7, MOST_KNOTS] and counts hold the stations' BEM curves, see `rotor.bem`.
    Where polars follow the Reynolds number, numbers[n_reynolds] holds the logarithms of theirs and
    cardinal[n_reynolds - 1, 4, n_reynolds] the cubics of the tables' weights; else both are empty.
    """

    r: np.ndarray
    chord: np.ndarray
    twist: np.ndarray
    hub_radius: float
    tip_radius: float
    blade_count: int
    polars: np.ndarray
    section: np.ndarray
    weights: np.ndarray
    knots: np.ndarray
    counts: np.ndarray
    numbers: np.ndarray
    cardinal: np.ndarray
    reynolds_unit: float
    cosine: float
    torque_unit: float
    inertia: float
    flow: Pieces
    control: Pieces
    control_range: tuple[float, float]
    by_speed: bool


def rotor(blade, polar, inertia, density, flow, control, control_range, by_speed):
    """Return the `Rotor` of a blade and its polars, as `rotor_coefficients` takes them.

    flow (m/s over s) and control (N*m over s, or over rad/s if by_speed) are `Pieces`; the control
    torque is cut to control_range.
    """
    local = isinstance(polar, LocalReynolds)
    *shape, polars, section, _ = _arguments(
        blade, polar.at_speed(1.0) if local else polar, np.ones(1)
    )
    cosine = float(np.cos(blade.cone))
    knots, counts = np.empty((blade.r.size, 7, MOST_KNOTS)), np.zeros(blade.r.size, dtype=np.int64)
    numbers, cardinal, unit = np.empty(0), np.empty((0, 4, 0)), 0.0
    if local:
        numbers, unit = polar.log_reynolds, cosine / polar.viscosity
        cardinal = np.ascontiguousarray(polar._cardinal.c.transpose(1, 0, 2))
    else:
        r, chord, twist, *rest = shape
        for j in range(blade.r.size):
            station = (chord[j], twist[j], r[j], *rest, polars[section[j]])
            lowest = 0.999 * SLOWEST_RATIO / cosine * r[j] / blade.tip_radius
            counts[j] = _curve(lowest, False, station, knots[j])
    return Rotor(
        *shape,
        polars,
        section,
        torque_weights(blade),
        knots,
        counts,
        numbers,
        cardinal,
        unit,
        cosine,
        torque_scale(density, blade.rotor_radius, 1.0),
        float(inertia),
        flow,
        control,
        control_range,
        by_speed,
    )


@_compile
def _piece(edges, x):
    """Return the index of the piece that has x in it, or is nearest to it."""
    low, high = 0, edges.size - 1
    while high - low > 1:
        middle = (low + high) // 2
        if edges[middle] <= x:
            low = middle
        else:
            high = middle
    return low


@_compile
def _value(pieces, x, near):
    """Return the value at x of the piece that has the point `near` in it."""
    edges, coefficients = pieces
    piece = _piece(edges, near)
    place = 2.0 * (x - edges[piece]) / (edges[piece + 1] - edges[piece]) - 1.0
    value = 0.0
    for power in range(coefficients.shape[1] - 1, -1, -1):
        value = value * place + coefficients[piece, power]
    return value


@_compile
def _load(lambda_r, knots, count, station):
    """Return the tangential load over 0.5 rho V², m, at the attached root, as `bem.sections`."""
    below, above = -1, count
    while above - below > 1:
        middle = (below + above) // 2
        if knots[6, middle] > lambda_r:
            below = middle
        else:
            above = middle
    s = tangential = 0.0
    if 0 < above < count:
        f_below = knots[1, below] - knots[2, below] / lambda_r
        f_above = knots[1, above] - knots[2, above] / lambda_r
        if f_below < 0.0 <= f_above:
            slope_below = knots[3, below] - knots[4, below] / lambda_r
            slope_above = knots[3, above] - knots[4, above] / lambda_r
            low, high = knots[0, below], knots[0, above]
            _, terms = _root(
                low, high, f_below, f_above, slope_below, slope_above, lambda_r, station
            )
            s, tangential = terms[0][0], terms[1][0]
    if s <= 0.0:
        bracket = _brake_bracket(_NEGATIVE_SAMPLES, lambda_r, station)
        if bracket[2] * bracket[3] < 0.0:
            _, terms = _root(*bracket, lambda_r, station)
            s, tangential = terms[0][0], terms[1][0]
    return station[0] * tangential / (s * s) if s > 0.0 else 0.0


@_compile
def _torque_coefficient(ratio, flow, rotor, knots, mixed):
    """Return the torque coefficient by direct BEM; knots and mixed are room to work in."""
    total, tables = 0.0, rotor.numbers.size
    weights = np.zeros(tables)
    for j in range(rotor.r.size):
        lambda_r = ratio * rotor.r[j] / rotor.tip_radius
        count, curve, polar = rotor.counts[j], rotor.knots[j], rotor.polars[rotor.section[j]]
        if tables:
            unit = flow * rotor.reynolds_unit * rotor.chord[j]
            number = np.log(unit * np.sqrt(1.0 + lambda_r * lambda_r))
            number = min(max(number, rotor.numbers[0]), rotor.numbers[-1])
            row = _piece(rotor.numbers, number)
            x = number - rotor.numbers[row]
            for i in range(tables):
                cubic = rotor.cardinal[row, :, i]
                weights[i] = cubic[3] + x * (cubic[2] + x * (cubic[1] + x * cubic[0]))
            first = rotor.section[j]
            _mix(rotor.polars[first : first + tables], weights, mixed)
            curve, polar = knots, mixed
        station = (
            rotor.chord[j],
            rotor.twist[j],
            rotor.r[j],
            rotor.hub_radius,
            rotor.tip_radius,
            rotor.blade_count,
            polar,
        )
        if tables:
            count = _curve(lambda_r, False, station, knots)
        total += rotor.weights[j] * _load(lambda_r, curve, count, station)
    return total


@_compile
def _torques(time, speed, near, rotor, knots, mixed):
    """Return hydrodynamic and control torque, N*m; the time `near` is within the step."""
    flow = _value(rotor.flow, time, time)
    ratio = max(speed * rotor.tip_radius / flow, SLOWEST_RATIO / rotor.cosine)
    hydrodynamic = rotor.torque_unit * flow**2
    hydrodynamic *= _torque_coefficient(ratio, flow, rotor, knots, mixed)
    if rotor.by_speed:
        control = _value(rotor.control, speed, speed)
    else:
        control = _value(rotor.control, time, near)
    return hydrodynamic, min(max(control, rotor.control_range[0]), rotor.control_range[1])


@_compile
def _step(time, speed, step, stages, tolerance, rotor, knots, mixed):
    """Solve for the stages, from their first values on; return the largest speed error if solved.

    Returns whether Newton's iteration has converged, the speed's estimated error, the energies
    captured and generated, and the estimated error of the first.
    """
    near, size = time + 0.5 * step, max(abs(speed), 1e-3)
    driving, control = _torques(time, speed, near, rotor, knots, mixed)
    nudge = 1e-6 * size
    faster = _torques(time, speed + nudge, near, rotor, knots, mixed)
    slope = (faster[0] - faster[1] - driving + control) / (nudge * rotor.inertia)
    inverse = np.zeros((STAGES, STAGES))  # of 1 - step slope A
    for k in range(STAGES):
        weight = 1.0 / (1.0 - step * slope * _EIGENVALUES[k])
        for i in range(STAGES):
            for j in range(STAGES):
                inverse[i, j] += (_VECTORS[i, k] * weight * _BACK[k, j]).real
    rates, miss = np.empty(STAGES), np.empty(STAGES)
    captured, generated = np.zeros(STAGES), np.zeros(STAGES)
    change, solved = np.inf, False
    for iteration in range(12):
        for i in range(STAGES):
            at = time + _NODES[i] * step
            torques = _torques(at, stages[i], near, rotor, knots, mixed)
            rates[i] = (torques[0] - torques[1]) / rotor.inertia
            captured[i], generated[i] = torques[0] * stages[i], torques[1] * stages[i]
        for i in range(STAGES):
            miss[i] = speed - stages[i]
            for j in range(STAGES):
                miss[i] += step * _MATRIX[i, j] * rates[j]
        before, change = change, 0.0
        for i in range(STAGES):
            correction = 0.0
            for j in range(STAGES):
                correction += inverse[i, j] * miss[j]
            stages[i] += correction
            change = max(change, abs(correction))
        share = change / before
        left = change * share / (1.0 - share) if iteration and share < 1.0 else change
        if left <= 0.01 * tolerance * size:
            solved = True
            break
        if iteration > 1 and not share < 1.0:
            break
    error = step * _FIRST * (driving - control) / rotor.inertia
    work = np.zeros(2)
    energy_error = _FIRST * driving * speed
    for i in range(STAGES):
        error += _STAGE_ERROR[i] * (stages[i] - speed)
        work[0] += step * _MATRIX[-1, i] * captured[i]
        work[1] += step * _MATRIX[-1, i] * generated[i]
        energy_error += _LATER[i] * captured[i]
    return solved, abs(error / (1.0 - step * slope * _FIRST)), work, abs(step * energy_error)


@_compile
def _cubic(coefficients, place):
    """Return the cubic's value at a place in the step, from -1 at its start to 1 at its end."""
    value = coefficients[STAGES]
    for power in range(STAGES - 1, -1, -1):
        value = value * place + coefficients[power]
    return value


@_compile
def _length(time, stop, wish, longest, edges):
    """Return the next step: as wished, unless the next stop or a piece of the flow is nearer."""
    ahead = _piece(edges, time) + PIECES_A_STEP
    room = edges[min(ahead, edges.size - 1)] - time
    step, rest = min(wish, longest), stop - time
    if room > 0.0:
        step = min(step, room)
    if step >= rest * (1.0 - 1e-9):
        return rest
    return min(step, 0.5 * rest)


@_compile
def _standstill(time, step, curve, rotor):
    """Return the length of the step at whose end the rotor stands still."""
    low, high = 0.0, step
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _is_slow(time + middle, _cubic(curve, 2.0 * middle / step - 1.0), rotor):
            high = middle
        else:
            low = middle
    return high


@_compile
def _is_slow(time, speed, rotor):
    """Whether the tip speed ratio is at or below that of a rotor that stands still."""
    ratio = speed * rotor.tip_radius * rotor.cosine / _value(rotor.flow, time, time)
    return ratio <= SLOWEST_RATIO


@_compile
def integrate(speed, stops, longest, tolerance, energy_unit, rotor):
    """Integrate speed and energies from stops[0] to stops[-1]; a step ends at every stop.

    Returns how it ended (`DONE`, ...), the steps' ends (s), the speed over each step (rad/s) as
    coefficients of `Pieces`, and the energies captured and generated (J).
    """
    knots, mixed = np.empty((7, MOST_KNOTS)), np.empty_like(rotor.polars[0])
    time, goal, end = stops[0], 1, DONE
    shortest = 1e-14 * (stops[-1] - stops[0])
    step, last, wish, stopping = 0.0, 1.0, 1e-3 * longest, False
    times, curves, energies = [time], [0.0], np.zeros(2)
    curve, stages = np.zeros(STAGES + 1), np.empty(STAGES)
    curve[0] = speed
    while end == DONE and goal < stops.size:
        if not stopping:
            step = _length(time, stops[goal], wish, longest, rotor.flow.edges)
        for i in range(STAGES):  # as if the last step's polynomial went on
            stages[i] = _cubic(curve, 1.0 + 2.0 * step * _NODES[i] / last)
        solved, error, work, energy_error = _step(
            time, speed, step, stages, tolerance, rotor, knots, mixed
        )
        share, factor = np.inf, 0.2
        if solved:
            share = error / (tolerance * max(abs(stages[-1]), 1e-3))
            share = max(share, energy_error / (tolerance * (energies[0] + 0.01 * energy_unit)))
            factor = min(max(0.9 * (share + 1e-16) ** (-1.0 / (STAGES + 1.0)), 0.2), 8.0)
        wish = step * factor
        if not share <= 1.0:
            stopping = False
            if not wish >= shortest:
                end = FAILED
            continue
        found = np.zeros(STAGES + 1)
        for i in range(STAGES + 1):
            found[i] = _DENSE[i, 0] * speed
            for j in range(STAGES):
                found[i] += _DENSE[i, j + 1] * stages[j]
        slow = _is_slow(time + step, stages[-1], rotor)
        if not stopping and slow and not _is_slow(time, speed, rotor):
            step, stopping = _standstill(time, step, found, rotor), True
            continue
        rest = stops[goal] - time
        if step == rest:
            goal += 1
        time = stops[goal - 1] if step == rest else time + step
        speed, last, curve = stages[-1], step, found
        energies += work
        times.append(time)
        curves.extend(found)
        if stopping:
            end = STOPPED
        elif rotor.by_speed and speed > rotor.control.edges[-1]:
            end = TOO_FAST
    return end, np.array(times), np.array(curves)[1:].reshape(-1, STAGES + 1), energies
