"""The best blade in steady flow: an upper bound on every trajectory, and a family of good starts.

Blade element momentum theory treats the stations as independent. At a given tip speed ratio the
best section of every station is therefore found by itself, globally
(`hkt_mdo.rotor.best_section`), and no local optimum of the whole blade hides a better one. The
power coefficient depends on the operating point alone, so that

    energy <= 0.5 rho A Cp* integral of v³ dt

holds for any motion of the rotor under any controller (the quasi-steady bound).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.best_section import best_sections
from hkt_mdo.rotor.blade import Blade

GRID = (24, 49)  # chords and twists of the search where polars follow the Reynolds number
SCAN = (12, 25)  # the same at many tip speed ratios, to find the best of them
FINER = 13  # tip speed ratios around a peak
RATIOS = np.geomspace(2.0, 16.0, 12)  # tip speed ratios among which the best is sought
PEAKS = 2  # of the power over them that are refined
# first trust region of the local search: share of chord, rad, over chord
CHORD_MOVE, TWIST_MOVE, THICKNESS_MOVE = 0.3, 0.1, 0.02
THICKNESSES = 5  # of the search, between the bounds, where polars follow the thickness
MOST_STEPS = 60  # of the local search
WORTHWHILE = 1e-10  # gain in power coefficient for which the search begins again


class SteadyOptimum(NamedTuple):
    """Blade, tip speed ratio and power coefficient of a steady optimum."""

    blade: Blade
    tip_speed_ratio: float
    power_coefficient: float


def best_blade(blade, polar, tip_speed_ratio, bounds):
    """Return the `SteadyOptimum` over chord and twist at one tip speed ratio, found globally.

    Also over the thickness, within the bounds of polars that follow it.

    Parameters
    ----------
    blade : Blade
        Gives stations, hub, tip, blade count and cone.
    polar : Polars
        Polars of the sections.
    tip_speed_ratio : float
        Omega R / V of the disc.
    bounds : dict of str to tuple of float
        Smallest and largest chord (m) and twist (rad).

    Returns
    -------
    SteadyOptimum
        The best blade and its power coefficient.
    """
    (start,) = _candidates(blade, polar, [tip_speed_ratio], bounds)
    return nearest_optimum(start, polar, tip_speed_ratio, bounds, 1e-14)


def best_rotor(blade, polar, bounds):
    """Return the `SteadyOptimum` over chord, twist and tip speed ratios of 2 to 16.

    Blade, polar and bounds are those of `best_blade`.

    Parameters
    ----------
    blade : Blade
        Gives stations, hub, tip, blade count and cone.
    polar : Polars
        Polars of the sections.
    bounds : dict of str to tuple of float
        Smallest and largest chord (m) and twist (rad).

    Returns
    -------
    SteadyOptimum
        The best blade, where it works, and its power coefficient.
    """

    def peaks(ratios, count):
        # the best blade at each of the highest peaks, and the ratios around it
        starts = _candidates(blade, polar, ratios, bounds, SCAN)
        power = [_power(start, polar, ratio) for start, ratio in zip(starts, ratios, strict=True)]
        padded = np.array([-np.inf, *power, -np.inf])
        indices = np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] >= padded[2:]))
        indices = indices[np.argsort(padded[indices + 1])[-count:]]
        return [(starts[peak], ratios[max(peak - 1, 0) : peak + 2]) for peak in indices]

    def refined(start, near):
        # the best optimum between the ratios, by continuation from a blade
        return _bracketed(lambda ratio: nearest_optimum(start, polar, ratio, bounds, 1e-12), near)

    # Stations that jump between stalled and attached flow leave several peaks over the ratio.
    candidates = peaks(RATIOS, PEAKS)
    if not polar.follows_reynolds:
        finer = (np.linspace(near[0], near[-1], FINER) for _, near in candidates)
        candidates = [peak for ratios in finer for peak in peaks(ratios, 1)]
    optima = [(refined(*candidate), candidate[1]) for candidate in candidates]
    best, near = max(optima, key=lambda candidate: candidate[0].power_coefficient)
    for _ in range(4):
        # Another local optimum of a station may be the better one at this tip speed ratio.
        other = best_blade(blade, polar, best.tip_speed_ratio, bounds)
        if other.power_coefficient <= best.power_coefficient + WORTHWHILE:
            break
        best = refined(other.blade, near)
    return best


def best_operation(blade, polar):
    """Return the `SteadyOptimum` of a given blade over tip speed ratios of 1 to 20.

    Parameters
    ----------
    blade : Blade
        The blade.
    polar : Polars
        Polars of the sections.

    Returns
    -------
    SteadyOptimum
        Tip speed ratio and power coefficient of the peak.
    """
    ratios = np.linspace(1.0, 20.0, 200)

    def at(ratio):
        return SteadyOptimum(blade, float(ratio), _power(blade, polar, ratio))

    return _peak(at, ratios, bem.rotor_coefficients(blade, polar, ratios).power)


def best_set_angle(shape, blade, polar):
    """Return the `SteadyOptimum` over a `Shape`'s set angle at the radius of a blade.

    Parameters
    ----------
    shape : Shape
        The family of blades.
    blade : Blade
        Gives the radius.
    polar : Polars
        Polars of the sections.

    Returns
    -------
    SteadyOptimum
        The best blade, where it works, and its power coefficient.
    """

    def at(angle):
        return best_operation(shape.at({"twist": [angle]}, blade.rotor_radius), polar)

    angles = np.linspace(*shape.bounds["twist"], 25)
    return _peak(at, angles, [at(angle).power_coefficient for angle in angles])


def _power(blade, polar, ratio):
    """Return the power coefficient at one tip speed ratio."""
    return float(bem.rotor_coefficients(blade, polar, ratio).power[0])


def _candidates(blade, polar, ratios, bounds, grid=GRID):
    """Return a blade near the best one for each tip speed ratio, found globally.

    Where polars follow the thickness, at `THICKNESSES` of them, the best of which each station has.
    """
    ratios = np.array(ratios)
    if not polar.follows_thickness:
        _, *shape = _best_stations(blade, polar, ratios, bounds, grid)
    else:
        tried = np.linspace(*polar.bounds, THICKNESSES)
        optima = [_best_stations(blade, one, ratios, bounds, grid) for one in polar.at(tried)]
        load, chord, twist = np.stack(optima, axis=1)
        best = np.argmax(load, axis=0)
        shape = *(np.choose(best, x) for x in (chord, twist)), tried[best]
    return [blade.with_shape(*values) for values in zip(*shape, strict=True)]


def _best_stations(blade, polar, ratios, bounds, grid):
    """Return load, chord and twist near the best of each station, [3, n_ratios, n_stations].

    By `best_sections`. Where polars follow the Reynolds number, or where BEM takes another root of
    a section than the best, the best of a grid of chord (geometric) and twist.
    """
    reached = np.zeros((ratios.size, blade.r.size), dtype=bool)
    optima = np.empty((3, *reached.shape))
    if not polar.follows_reynolds:
        optima = best_sections(blade, polar, ratios, bounds)
        for at, (load, *shape) in enumerate(optima.swapaxes(0, 1)):
            solved = bem.sections(blade.with_shape(*shape), polar, ratios[at]).tangential_load[0]
            reached[at] = solved >= load - 1e-9 * np.abs(load)
    axes = np.geomspace(*bounds["chord"], grid[0]), np.linspace(*bounds["twist"], grid[1])
    chords, twists = (x.ravel() for x in np.meshgrid(*axes, indexing="ij"))
    for j in np.flatnonzero(~reached.all(axis=0)):
        few = ~reached[:, j]
        strip = replace(blade, r=np.full(chords.size, blade.r[j]), chord=chords, twist=twists)
        load = bem.sections(strip, polar.at_station(j), ratios[few]).tangential_load
        best = np.argmax(load, axis=1)
        optima[:, few, j] = load.max(axis=1), chords[best], twists[best]
    return optima


def nearest_optimum(start, polar, tip_speed_ratio, bounds, tolerance):
    """Return the local optimum over chord, twist and maybe thickness next to a blade.

    Newton's method, for all stations at once and each within bounds and a trust region of its own:
    stations do not depend on each other, so a difference of gradients has every second derivative.

    Parameters
    ----------
    start : Blade
        Where the search begins.
    polar : Polars
        Polars of the sections.
    tip_speed_ratio : float
        Omega R / V of the disc.
    bounds : dict of str to tuple of float
        Smallest and largest chord (m) and twist (rad).
    tolerance : float
        Change of the power coefficient at which the search ends.

    Returns
    -------
    SteadyOptimum
        The best blade and its power coefficient.
    """
    weights = bem.torque_weights(start)
    bounds, x = [bounds["chord"], bounds["twist"]], [start.chord, start.twist]
    if polar.follows_thickness:
        bounds, x = [*bounds, polar.bounds], [*x, start.thickness]
    bounds = np.array(bounds).T[:, :, None]
    x = np.clip(np.stack(x), *bounds)
    unit = np.repeat([[1.0], [TWIST_MOVE], [THICKNESS_MOVE]][: len(x)], x[0].size, axis=1)
    unit[0] = CHORD_MOVE * x[0]

    def at(x):
        # the tangential loads of the stations, and their derivatives by their shape
        flow = bem.sections(start.with_shape(*x), polar, tip_speed_ratio, derivatives=True)
        _, *by_shape, by_followed = flow.derivatives[0, :, 0]
        if polar.follows_reynolds:
            by_shape[0] = by_shape[0] + by_followed / x[0]
        if polar.follows_thickness:
            by_shape.append(by_followed)
        return flow.tangential_load[0], np.stack(by_shape)

    load, slope = at(x)
    radius = np.ones(load.size)
    for _ in range(MOST_STEPS):
        # second derivatives by one-sided differences, in trust region units from here on
        moved = [at(x + direction[:, None] * 1e-5 * unit)[1] for direction in np.eye(len(x))]
        bend = np.stack([(slopes - slope) * unit for slopes in moved]) / 1e-5
        step = _newton_step(slope * unit, bend, (bounds - x) / unit, radius) * unit
        if tip_speed_ratio * weights @ np.abs(np.sum(slope * step, axis=0)) <= tolerance:
            break
        better, better_slope = at(x + step)
        taken = better > load
        x, load = np.where(taken, x + step, x), np.where(taken, better, load)
        slope = np.where(taken, better_slope, slope)
        radius = np.where(taken, np.minimum(2.0 * radius, 4.0), 0.25 * radius)
    blade = start.with_shape(*x)
    return SteadyOptimum(blade, float(tip_speed_ratio), _power(blade, polar, tip_speed_ratio))


def _newton_step(slope, bend, room, radius):
    """Return steps[m, n] that raise n functions of m variables with slope[m, n].

    The step is Newton's with the absolute values of the eigenvalues of the second derivatives
    bend[m, m, n]; it stays in room[lower and upper, m, n] and within the radius. A variable at a
    bound that its slope points beyond stays there.
    """
    free = ~(((slope > 0.0) & (room[1] <= 0.0)) | ((slope < 0.0) & (room[0] >= 0.0)))
    slope = np.where(free, slope, 0.0)
    bend = np.where(free & free[:, None] | np.eye(len(slope), dtype=bool)[:, :, None], bend, 0.0)
    sizes, axes = np.linalg.eigh(0.5 * np.moveaxis(bend + bend.swapaxes(0, 1), -1, 0))
    along = np.einsum("nij,in->nj", axes, slope) / np.maximum(np.abs(sizes), 1e-30)
    step = np.einsum("nij,nj->in", axes, along)
    step *= np.minimum(1.0, radius / np.maximum(np.linalg.norm(step, axis=0), 1e-300))
    return np.clip(step, *room)


def _peak(optimum, points, powers):
    """Return the best optimum next to the place with the largest power coefficient."""
    at = int(np.argmax(powers))
    return _bracketed(optimum, points[max(at - 1, 0) : at + 2])


def _bracketed(optimum, near):
    """Return the best optimum between the first and the last of some points."""
    peak = minimize_scalar(
        lambda point: -optimum(point).power_coefficient,
        bounds=(near[0], near[-1]),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return optimum(peak.x)
