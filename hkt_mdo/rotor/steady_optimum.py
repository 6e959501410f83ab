"""The best blade in steady flow: an upper bound on every trajectory, and a family of good starts.

Blade element momentum theory treats the stations as independent. At a given tip speed ratio, a
search in two variables, chord and twist, therefore finds the best section of every station, and no
local optimum of the whole blade hides a better one. The power coefficient depends on the operating
point alone, so that

    energy <= 0.5 rho A Cp* integral of v³ dt

holds for any motion of the rotor under any controller (the quasi-steady bound).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, minimize, minimize_scalar

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade

GRID = (24, 49)  # chords and twists of the coarse search at one tip speed ratio
SCAN = (12, 25)  # the same at many tip speed ratios, to find the best of them
CLIMBS = 3  # local searches over the tip speed ratio, from the best of the coarse search
TWIST_UNIT = 0.1  # rad, typical change of a twist
WORTHWHILE = 1e-10  # gain in power coefficient for which the local search begins again


class SteadyOptimum(NamedTuple):
    """Blade, tip speed ratio and power coefficient of a steady optimum."""

    blade: Blade
    tip_speed_ratio: float
    power_coefficient: float


def best_blade(
    blade, polar, tip_speed_ratio, chord_bounds, twist_bounds, start=None, tolerance=1e-14
):
    """Return the `SteadyOptimum` over chord and twist at one tip speed ratio.

    The blade gives stations, hub, tip, blade count and cone; bounds are in m and rad. From `start`,
    a blade, the nearest local optimum is taken; None: the search covers the whole range of chord
    and twist. A local search ends where the power coefficient changes by less than the tolerance.
    """
    bounds = chord_bounds, twist_bounds
    if start is None:
        (start,) = _coarse(blade, polar, [tip_speed_ratio], *bounds, GRID)
    return _climb(start, polar, tip_speed_ratio, (tip_speed_ratio,) * 2, *bounds, tolerance)


def best_rotor(blade, polar, chord_bounds, twist_bounds):
    """Return the `SteadyOptimum` over chord, twist and tip speed ratios of 2 to 16.

    Blade, polar and bounds are those of `best_blade`.
    """
    bounds, ratios = (chord_bounds, twist_bounds), np.geomspace(2.0, 16.0, 8)
    starts = _coarse(blade, polar, ratios, *bounds, SCAN)
    power = [_power(start, polar, ratio) for start, ratio in zip(starts, ratios, strict=True)]

    def climb(place, start=None, ratio=None):
        near = ratios[max(place - 1, 0)], ratios[min(place + 1, ratios.size - 1)]
        return _climb(start or starts[place], polar, ratio or ratios[place], near, *bounds)

    # Stations that jump between stalled and attached flow leave several peaks over the ratio.
    peaks = [(climb(place), place) for place in np.argsort(power)[-CLIMBS:]]
    best, place = max(peaks, key=lambda each: each[0].power_coefficient)
    for _ in range(4):
        # Another local optimum of a station may be the better one at this tip speed ratio.
        other = best_blade(blade, polar, best.tip_speed_ratio, *bounds)
        if other.power_coefficient <= best.power_coefficient + WORTHWHILE:
            break
        best = climb(place, other.blade, other.tip_speed_ratio)
    return best


def best_operation(blade, polar):
    """Return the `SteadyOptimum` of a given blade over tip speed ratios of 1 to 20."""
    ratios = np.linspace(1.0, 20.0, 200)
    power = bem.rotor_coefficients(blade, polar, ratios).power

    def at(ratio):
        return SteadyOptimum(blade, float(ratio), _power(blade, polar, ratio))

    return _bracketed(at, ratios, power)


def best_set_angle(shape, blade, polar):
    """Return the `SteadyOptimum` over a `Shape`'s set angle at the radius of a blade."""
    chord, _ = shape.control(blade)

    def at(angle):
        return best_operation(shape.at(chord, np.array([angle]), blade.rotor_radius), polar)

    angles = np.linspace(*shape.twist_bounds, 25)
    return _bracketed(at, angles, [at(angle).power_coefficient for angle in angles])


def _power(blade, polar, ratio):
    """Return the power coefficient at one tip speed ratio."""
    return float(bem.rotor_coefficients(blade, polar, ratio).power[0])


def _coarse(blade, polar, ratios, chord_bounds, twist_bounds, grid):
    """Return the best blade on the grid of chord (geometric) and twist for each tip speed ratio."""
    chords, twists = np.meshgrid(
        np.geomspace(*chord_bounds, grid[0]), np.linspace(*twist_bounds, grid[1]), indexing="ij"
    )
    chords, twists = chords.ravel(), twists.ravel()
    points = np.array(ratios) / np.cos(blade.cone)
    best = np.empty((points.size, blade.r.size), dtype=int)
    for j, station in enumerate(blade.r):
        strip = replace(blade, r=np.full(chords.size, station), chord=chords, twist=twists)
        load = bem.sections(strip, bem.polar_at(polar, j), points).tangential_load
        best[:, j] = np.argmax(load, axis=1)
    return [blade.with_shape(chords[places], twists[places]) for places in best]


def _climb(start, polar, ratio, ratio_bounds, chord_bounds, twist_bounds, tolerance=1e-14):
    """Return the local optimum over chord, twist and tip speed ratio next to a blade (L-BFGS-B)."""
    n = start.r.size
    units = np.concatenate((start.chord, np.full(n, TWIST_UNIT), [ratio]))
    bounds = np.repeat([chord_bounds, twist_bounds, ratio_bounds], [n, n, 1], axis=0).T / units

    def loss(x):
        chord, twist, (ratio,) = np.split(x * units, [n, 2 * n])
        found = bem.rotor_coefficients(start.with_shape(chord, twist), polar, ratio, True)
        by_ratio = found.torque + ratio * found.torque_by_tip_speed_ratio
        by_shape = ratio * np.concatenate((found.torque_by_chord[0], found.torque_by_twist[0]))
        return -found.power[0], -np.concatenate((by_shape, by_ratio)) * units

    found = minimize(
        loss,
        np.concatenate((start.chord, start.twist, [ratio])) / units,
        jac=True,
        method="L-BFGS-B",
        bounds=Bounds(*bounds),
        options={"ftol": tolerance, "gtol": 1e-8},
    )
    chord, twist, (ratio,) = np.split(found.x * units, [n, 2 * n])
    return SteadyOptimum(start.with_shape(chord, twist), float(ratio), -float(found.fun))


def _bracketed(optimum, points, power):
    """Refine the largest of the powers at increasing points between its neighbours."""
    peak = int(np.argmax(power))
    low, high = points[max(peak - 1, 0)], points[min(peak + 1, len(points) - 1)]
    found = minimize_scalar(
        lambda point: -optimum(point).power_coefficient,
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return optimum(found.x)
