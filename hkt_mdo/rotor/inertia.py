"""Mass and rotational inertia of blades (paper Sec. II-B), and of the water that they move."""

from typing import NamedTuple

import numpy as np

# Gauss's rule between two edges: three points are exact for (linear chord)² times linear shape
# times r², a quintic.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
SHARES, WEIGHTS = 0.5 * (_POINTS + 1.0)[:, None], 0.5 * _WEIGHTS[:, None]


class RotorMass(NamedTuple):
    """Mass (kg) and inertia (kg*m**2) of a rotor and their gradients, each (n_stations,).

    By the chord (per m), by the thickness over chord, zero where section areas do not follow it,
    and by the twist (per rad), zero without the water that the blades move.
    """

    mass: float
    inertia: float
    mass_by_chord: np.ndarray
    inertia_by_chord: np.ndarray
    mass_by_thickness: np.ndarray
    inertia_by_thickness: np.ndarray
    inertia_by_twist: np.ndarray

    def heavier(self, factor):
        """Return the same with the inertia, and its gradients, times a factor.

        Parameters
        ----------
        factor : float
            The factor.

        Returns
        -------
        RotorMass
            The mass stays.
        """
        names = [name for name in self._fields if name.startswith("inertia")]
        return self._replace(**{name: factor * getattr(self, name) for name in names})


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
    return values[:-1] + SHARES * np.diff(values)


def carried(values):
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
    return np.concatenate((values[:1], values, values[-1:]))


def mass_and_inertia(blade, section_area, density, hub_inertia=0.0):
    """Return the `RotorMass` of solid blades.

    The area of a section is A = section_area chord². Chord and section_area are linear between
    stations, and constant from the first station to the hub and from the last to the tip:
    m = B rho integral of A dr, I = B rho integral of A (r cos(cone))² dr + hub inertia, both exact.
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
        Mass, inertia and their gradients.
    """
    by_thickness = 0.0
    if callable(section_area):
        by_thickness, section_area = section_area(blade.thickness, 1), section_area(blade.thickness)
    shape = carried(np.broadcast_to(np.asarray(section_area, dtype=float), blade.r.shape))
    local_r = between(blade.edges) * np.cos(blade.cone)
    local_c = between(carried(np.asarray(blade.chord)))
    unit = WEIGHTS * np.diff(blade.edges) * blade.blade_count * density
    area = unit * between(shape)
    mass = np.sum(area * local_c**2)
    inertia = np.sum(area * local_c**2 * local_r**2) + hub_inertia

    by_area = unit * local_c**2
    return RotorMass(
        mass,
        inertia,
        _by_stations(2.0 * area * local_c),
        _by_stations(2.0 * (area * local_r**2) * local_c),
        _by_stations(by_area) * by_thickness,
        _by_stations(by_area * local_r**2) * by_thickness,
        np.zeros(blade.r.size),
    )


def _by_stations(inside):
    """Return derivatives by values at stations from those at the points of `between`."""
    by_edge = np.zeros(inside.shape[1] + 1, dtype=inside.dtype)
    by_edge[:-1] += np.sum(inside * (1.0 - SHARES), axis=0)
    by_edge[1:] += np.sum(inside * SHARES, axis=0)
    by_edge[1] += by_edge[0]
    by_edge[-2] += by_edge[-1]
    return by_edge[1:-1]


def water_inertia(blade, density, thickness=0.0):
    """Return the inertia of the water that turning blades accelerate, as a `RotorMass`.

    By strips of potential flow: an ellipse of the section's chord c and thickness t accelerates,
    per length, rho pi c²/4 of water across its chord and rho pi t²/4 along it (Lamb, Hydrodynamics,
    art. 71). The rotor's acceleration w' r has the share sin(twist) across the chord, and of the
    force as much acts about the axis: I = B integral of rho pi/4 (c² sin² + t² cos²) (r cos(cone))²
    dr (docs/theory.md). Chord, twist and thickness are linear between stations.

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
    RotorMass
        Its inertia and the gradients of that; it has no mass.
    """
    spread = np.broadcast_to(np.asarray(thickness), blade.r.shape)
    chord, twist, thick = (between(carried(each)) for each in (blade.chord, blade.twist, spread))
    reach = (between(blade.edges) * np.cos(blade.cone)) ** 2
    unit = WEIGHTS * np.diff(blade.edges) * blade.blade_count * density * 0.25 * np.pi * reach
    share = np.sin(twist) ** 2 + (thick * np.cos(twist)) ** 2
    none = np.zeros(blade.r.size)
    return RotorMass(
        0.0,
        np.sum(unit * chord**2 * share),
        none,
        _by_stations(2.0 * unit * chord * share),
        none,
        _by_stations(2.0 * unit * chord**2 * thick * np.cos(twist) ** 2),
        _by_stations(unit * chord**2 * (1.0 - thick**2) * np.sin(2.0 * twist)),
    )
