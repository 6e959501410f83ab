"""How near to stall the sections of a designed blade may work."""

from typing import NamedTuple

import numpy as np

from hkt_mdo.rotor import bem

SLOWER = 0.97  # of the tip speed ratio at which sections must still be attached
DISTANCE = np.deg2rad(1.0)  # from the angle of attack of stall


class StallFence(NamedTuple):
    """Stations whose flow must stay attached, and their highest angles of attack (rad)."""

    stations: np.ndarray
    highest: np.ndarray


def stall_fence(polar, shape, blade, ratio):
    """Return the `StallFence` of a blade at its lowest tip speed ratio: what is attached there.

    Beyond stall lift falls, and the balance of momentum and lift has several solutions: where the
    attached one ends, the load jumps, by a third or more where a section is thick. Thick sections
    are best right at that edge, where no optimizer converges. A blade with one section for all
    stations is best far from it, and is left free.
    """
    if not isinstance(polar, tuple) or not shape.designs_chord:
        return StallFence(np.empty(0, dtype=int), np.empty(0))
    stall = np.array([each.stall for each in polar])
    angle, *_ = bem.angles_of_attack(blade, polar, ratio)
    stations = np.flatnonzero(np.isfinite(stall) & (angle < stall + DISTANCE))
    return StallFence(stations, stall[stations] - DISTANCE)
