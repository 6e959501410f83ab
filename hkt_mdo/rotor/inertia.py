"""Mass and rotational inertia of solid blades (paper Sec. II-B)."""

from typing import NamedTuple

import numpy as np

# Gauss's rule between two edges: three points are exact for (linear chord)² times linear shape
# times r², a quintic.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
SHARES, WEIGHTS = 0.5 * (_POINTS + 1.0)[:, None], 0.5 * _WEIGHTS[:, None]


class RotorMass(NamedTuple):
    """Mass (kg) and inertia (kg*m**2) of a rotor and their gradients, each (n_stations,).

    By the chord (per m) and by the thickness over chord, zero where section areas do not follow it.
    """

    mass: float
    inertia: float
    mass_by_chord: np.ndarray
    inertia_by_chord: np.ndarray
    mass_by_thickness: np.ndarray
    inertia_by_thickness: np.ndarray

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
        names = "inertia", "inertia_by_chord", "inertia_by_thickness"
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

    def gradient(inside):
        by_edge = np.zeros(blade.r.size + 2, dtype=inside.dtype)
        by_edge[:-1] += np.sum(inside * (1.0 - SHARES), axis=0)
        by_edge[1:] += np.sum(inside * SHARES, axis=0)
        by_edge[1] += by_edge[0]
        by_edge[-2] += by_edge[-1]
        return by_edge[1:-1]

    by_area = unit * local_c**2
    return RotorMass(
        mass,
        inertia,
        gradient(2.0 * area * local_c),
        gradient(2.0 * (area * local_r**2) * local_c),
        gradient(by_area) * by_thickness,
        gradient(by_area * local_r**2) * by_thickness,
    )
