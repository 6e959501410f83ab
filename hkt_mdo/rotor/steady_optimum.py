"""The best blade in steady flow: an upper bound on every trajectory, and a family of good starts.

Blade element momentum theory treats the stations as independent, so at a given tip speed ratio the
best chord and twist of each station follow from a search in two variables, and the best rotor from
a search over the tip speed ratio. No local optimum of the whole blade can hide a better one from
this search, and since the power coefficient depends on the operating point alone,

    energy <= 0.5 rho A Cp* integral of v³ dt

holds for any motion of the rotor under any controller (the quasi-steady bound).
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, minimize, minimize_scalar

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade


class SteadyOptimum(NamedTuple):
    """Blade, tip speed ratio and power coefficient of a steady optimum."""

    blade: Blade
    tip_speed_ratio: float
    power_coefficient: float


def best_blade(blade, polar, tip_speed_ratio, chord_bounds, twist_bounds, grid=(24, 49)):
    """Find the chord and twist that capture most power at one tip speed ratio.

    Parameters
    ----------
    blade : Blade
        Gives stations, hub, tip, blade count and cone.
    polar : Polar or sequence of Polar
        One for all stations, or one for each.
    tip_speed_ratio : float
    chord_bounds, twist_bounds : (float, float), m and rad
    grid : (int, int)
        Points of the coarse search in chord (geometric) and twist, before the local one.

    Returns
    -------
    SteadyOptimum
    """
    chords, twists = np.meshgrid(
        np.geomspace(*chord_bounds, grid[0]), np.linspace(*twist_bounds, grid[1]), indexing="ij"
    )
    chords, twists = chords.ravel(), twists.ravel()
    blade_ratio = tip_speed_ratio / np.cos(blade.cone)
    n = blade.r.size
    start, scale = np.empty((2, n)), np.empty(n)
    for j, station in enumerate(blade.r):
        strip = Blade(
            np.full(chords.size, station),
            chords,
            twists,
            blade.hub_radius,
            blade.tip_radius,
            blade.blade_count,
        )
        load = bem.sections(strip, bem.polar_at(polar, j), blade_ratio).tangential_load[0]
        best = int(np.argmax(load))
        start[:, j], scale[j] = (chords[best], twists[best]), max(load[best], 1e-9)

    # The stations are independent: one search over all of them does the work of n.
    units = np.concatenate((start[0], np.full(n, 0.1)))

    def loss(x):
        physical = x * units
        found = bem.sections(
            blade.with_shape(physical[:n], physical[n:]), polar, blade_ratio, derivatives=True
        )
        by = found.derivatives[0, 1:3, 0]
        if isinstance(polar, bem.LocalReynolds):  # the chord changes the Reynolds number too
            by[0] += found.derivatives[0, 6, 0] / physical[:n]
        by = by / scale
        return -np.sum(found.tangential_load[0] / scale), -by.ravel() * units

    lower = np.concatenate((np.full(n, chord_bounds[0]), np.full(n, twist_bounds[0])))
    upper = np.concatenate((np.full(n, chord_bounds[1]), np.full(n, twist_bounds[1])))
    found = minimize(
        loss,
        start.ravel() / units,
        jac=True,
        method="L-BFGS-B",
        bounds=Bounds(lower / units, upper / units),
        options={"ftol": 1e-14, "gtol": 1e-8},
    )
    physical = found.x * units
    shaped = blade.with_shape(physical[:n], physical[n:])
    power = bem.rotor_coefficients(shaped, polar, tip_speed_ratio).power[0]
    return SteadyOptimum(shaped, float(tip_speed_ratio), float(power))


def best_rotor(blade, polar, chord_bounds, twist_bounds, search=(2.0, 16.0)):
    """Find the chord, twist and tip speed ratio of the largest power coefficient.

    Parameters
    ----------
    blade, polar, chord_bounds, twist_bounds
        As in `best_blade`.
    search : (float, float)
        Range of tip speed ratios.

    Returns
    -------
    SteadyOptimum
    """

    def optimum(ratio):
        return best_blade(blade, polar, ratio, chord_bounds, twist_bounds)

    return _best_over_ratio(optimum, search)


def best_operation(blade, polar, search=(1.0, 20.0)):
    """Find the tip speed ratio of a given blade's largest power coefficient; see `best_rotor`."""
    ratios = np.linspace(*search, 200)
    power = bem.rotor_coefficients(blade, polar, ratios).power

    def operation(ratio):
        return SteadyOptimum(
            blade, float(ratio), float(bem.rotor_coefficients(blade, polar, ratio).power[0])
        )

    return _bracketed(operation, ratios, int(np.argmax(power)))


def best_set_angle(shape, blade, polar):
    """Find the set angle and tip speed ratio of a fixed blade's largest power coefficient.

    Parameters
    ----------
    shape : Shape
        Of a fixed blade whose set angle has bounds.
    blade : Blade
        Of the radius asked for.
    polar
        As in `best_blade`.

    Returns
    -------
    SteadyOptimum
    """
    chord, _ = shape.control(blade)

    def at(angle):
        return best_operation(shape.at(chord, np.array([angle]), blade.rotor_radius), polar)

    angles = np.linspace(*shape.twist_bounds, 25)
    power = [at(angle).power_coefficient for angle in angles]
    return _bracketed(at, angles, int(np.argmax(power)))


def _best_over_ratio(optimum, search):
    ratios = np.geomspace(*search, 8)
    power = [optimum(ratio).power_coefficient for ratio in ratios]
    return _bracketed(optimum, ratios, int(np.argmax(power)))


def _bracketed(optimum, ratios, peak):
    """Refine the peak between the neighbours of a coarse maximum."""
    low, high = ratios[max(peak - 1, 0)], ratios[min(peak + 1, len(ratios) - 1)]
    found = minimize_scalar(
        lambda ratio: -optimum(ratio).power_coefficient,
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return optimum(found.x)
