"""The planform of the blades."""

import numpy as np

from hkt_mdo.rotor.blade import Blade


def area_weights(blade: Blade) -> np.ndarray:
    """Return the weights of the chords in the planform area of all blades, m, (n_stations,).

    The chord is linear between the stations, and continued unchanged to hub and tip.

    Parameters
    ----------
    blade : Blade
        The blade.

    Returns
    -------
    ndarray of shape (n_stations,)
        Weights (m).
    """
    r = blade.r
    edges = np.concatenate(([2.0 * blade.hub_radius - r[0]], r, [2.0 * blade.tip_radius - r[-1]]))
    return 0.5 * blade.blade_count * (edges[2:] - edges[:-2])


def planform_area(blade: Blade) -> float:
    """Return the planform area of all blades, m**2: the integral of the chord from hub to tip.

    Parameters
    ----------
    blade : Blade
        The blade.

    Returns
    -------
    float
        Area (m**2).
    """
    return float(area_weights(blade) @ blade.chord)
