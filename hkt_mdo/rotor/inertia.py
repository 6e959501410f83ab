"""Mass and rotational inertia of solid blades (paper Sec. II-B)."""

import numpy as np

# Three points are exact for (linear chord)² times linear shape times r², a quintic.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


def mass_and_inertia(blade, section_area, density, hub_inertia=0.0):
    """Return the rotor's mass and inertia, and their gradients with respect to chord.

    The area of a section is A = section_area chord². Chord and section_area are linear between
    stations, and constant from the first station to the hub and from the last to the tip:
    m = B rho integral of A dr, I = B rho integral of A (r cos(cone))² dr + hub inertia, both exact.
    section_area, the area of the outline over chord squared, is one number or one a station;
    density is in kg/m**3, inertia in kg*m**2, gradients[n_stations] are per metre of chord.
    """
    edges = np.concatenate(([blade.hub_radius], blade.r, [blade.tip_radius]))

    def carried(values):
        return np.concatenate((values[:1], values, values[-1:]))

    chord = carried(np.asarray(blade.chord))
    shape = carried(np.broadcast_to(np.asarray(section_area, dtype=float), blade.r.shape))
    inner, width = edges[:-1], np.diff(edges)
    share = 0.5 * (_POINTS + 1.0)[:, None]
    local_r = (inner + share * width) * np.cos(blade.cone)
    local_c = chord[:-1] + share * np.diff(chord)
    area = _WEIGHTS[:, None] * 0.5 * width * blade.blade_count * density
    area = area * (shape[:-1] + share * np.diff(shape))
    mass = np.sum(area * local_c**2)
    inertia = np.sum(area * local_c**2 * local_r**2) + hub_inertia

    def gradient(weight):
        inside = 2.0 * weight * local_c
        by_edge = np.zeros(edges.size, dtype=inside.dtype)
        by_edge[:-1] += np.sum(inside * (1.0 - share), axis=0)
        by_edge[1:] += np.sum(inside * share, axis=0)
        by_edge[1] += by_edge[0]
        by_edge[-2] += by_edge[-1]
        return by_edge[1:-1]

    return mass, inertia, gradient(area), gradient(area * local_r**2)
