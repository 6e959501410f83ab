"""Mass and rotational inertia of blades (paper Sec. II-B), and of the water that they move."""

from typing import NamedTuple

import numpy as np

# Gauss's rule between two edges: three points are exact for (linear chord)² times linear shape
# times r², a quintic.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
SHARES, WEIGHTS = 0.5 * (_POINTS + 1.0)[:, None], 0.5 * _WEIGHTS[:, None]


class RotorMass(NamedTuple):
    """Mass (kg) and inertia (kg*m**2) of a rotor."""

    mass: float
    inertia: float


def between(values):
    """Return values that are linear between edges, at the points of Gauss's rule.

    Parameters
    ----------
    values : ndarray of shape (n_edges,)
        Values at the edges.

    Returns
    -------
    ndarray of shape (3, n_edges - 1)
        Values at three points between each two edges.
    """
    return values[..., None, :-1] + SHARES * np.diff(values)[..., None, :]


def extended_to_ends(values):
    """Return values at hub, stations and tip; the first and last station's hold at hub and tip.

    Parameters
    ----------
    values : ndarray of shape (n_stations,)
        Values at the stations.

    Returns
    -------
    ndarray of shape (n_stations + 2,)
        Values at hub, stations and tip.
    """
    return np.concatenate((values[..., :1], values, values[..., -1:]), axis=-1)


def spread(blade, values):
    """Return values of a blade's stations at the points of Gauss's rule from hub to tip.

    Parameters
    ----------
    blade : Blade
        The blade.
    values : float or ndarray of shape (..., n_stations)
        One for all stations, or one each.

    Returns
    -------
    ndarray of shape (..., 3, n_stations + 1)
        Linear between stations, constant from the first to the hub and from the last to the tip.
    """
    return between(extended_to_ends(np.broadcast_to(values, np.shape(values)[:-1] + blade.r.shape)))


def mass_and_inertia(blade, section_area, density, hub_inertia=0.0):
    """Return the `RotorMass` of solid blades.

    The area of a section is A = section_area chord². Chord and section_area are linear between
    stations, and constant from the first station to the hub and from the last to the tip:
    m = B rho integral of A dr, J = B rho integral of A (r cos(cone))² dr + hub inertia, both exact.
    section_area, the area of the outline over chord squared, is one number, one a station, or a
    spline of it over the blade's thickness; density is in kg/m**3.

    Parameters
    ----------
    blade : Blade
        The blade.
    section_area : float or ndarray of shape (n_stations,) or CubicSpline
        Area of a section's material over chord squared: one, one a station, or over the
        thickness.
    density : float
        Density of the material (kg/m**3).
    hub_inertia : float
        Inertia of all that is not a blade (kg*m**2).

    Returns
    -------
    RotorMass
        Arrays where chord or thickness of the blade are of shape (..., n_stations). They may be
        complex, for derivatives by complex step.
    """
    if callable(section_area):
        thickness = np.real(blade.thickness)
        step = 1j * np.imag(blade.thickness) if np.iscomplexobj(blade.thickness) else 0.0
        section_area = section_area(thickness) + step * section_area(thickness, 1)
    area = spread(blade, section_area) * spread(blade, blade.chord) ** 2
    line = WEIGHTS * np.diff(blade.edges) * blade.blade_count * density * area
    arm = between(blade.edges) * np.cos(blade.cone)
    axes = (-2, -1)  # points of Gauss's rule, and intervals
    return RotorMass(np.sum(line, axis=axes), np.sum(line * arm**2, axis=axes) + hub_inertia)


def water_inertia(blade, density, thickness=0.0):
    """Return the inertia of the water that turning blades accelerate, kg*m**2.

    By strips of potential flow: an ellipse of the section's chord c and thickness t accelerates,
    per length, rho pi c²/4 of water across its chord and rho pi t²/4 along it (Lamb, Hydrodynamics,
    art. 71). The rotor's acceleration w' r has the share sin(twist) across the chord, and of the
    force as much acts about the axis: J = B integral of rho pi/4 (c² sin² + t² cos²) (r cos(cone))²
    dr (docs/rotor_model.md). Chord, twist and thickness are linear between stations.

    Parameters
    ----------
    blade : Blade
        The blade.
    density : float
        Density of the water (kg/m**3).
    thickness : float or ndarray of shape (n_stations,)
        Thickness of the sections over the chord; 0: flat plates.

    Returns
    -------
    float
        In kg*m**2.
    """
    chord, twist, thickness = (spread(blade, x) for x in (blade.chord, blade.twist, thickness))
    arm = between(blade.edges) * np.cos(blade.cone)
    across = chord**2 * (np.sin(twist) ** 2 + (thickness * np.cos(twist)) ** 2)
    line = WEIGHTS * np.diff(blade.edges) * blade.blade_count * density * 0.25 * np.pi * across
    return np.sum(line * arm**2, axis=(-2, -1))
