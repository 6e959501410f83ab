"""Blade geometry: stations, chord and twist of one of the rotor's equal blades."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class Blade:
    """One blade of a rotor; lengths in m, angles in rad, arrays of shape (n_stations,).

    Stations r increase strictly between hub and tip, twist is the angle between the section's chord
    and the rotor plane, set angle included, and cone the angle of the blades to that plane; radii
    are measured along the blade. thickness, over the chord, is None where it is not designed, and
    so is hub_inertia (kg*m**2), that of all that turns besides the blades.
    """

    r: np.ndarray
    chord: np.ndarray
    twist: np.ndarray
    hub_radius: float
    tip_radius: float
    blade_count: int
    cone: float = 0.0
    thickness: np.ndarray | None = None
    hub_inertia: float | None = None

    @property
    def rotor_radius(self):
        """Radius of the swept disc, tip_radius cos(cone), m.

        Returns
        -------
        float
            Radius (m).
        """
        return self.tip_radius * float(np.cos(self.cone))

    @property
    def edges(self):
        """Radii of hub, stations and tip along the blade, m, shape (n_stations + 2,).

        Returns
        -------
        ndarray of shape (n_stations + 2,)
            Radii (m).
        """
        return np.concatenate(([self.hub_radius], self.r, [self.tip_radius]))

    @property
    def area_weights(self):
        """Weights of the chords in the planform area of all blades, m, shape (n_stations,).

        The area is the integral of the chord from hub to tip: linear between the stations, and
        continued unchanged to hub and tip.

        Returns
        -------
        ndarray of shape (n_stations,)
            Weights (m).
        """
        ends = [2.0 * self.hub_radius - self.r[0]], self.r, [2.0 * self.tip_radius - self.r[-1]]
        edges = np.concatenate(ends)
        return 0.5 * self.blade_count * (edges[2:] - edges[:-2])

    def with_shape(self, chord, twist, thickness=None):
        """Return the blade with another chord (m) and twist (rad), each of shape (n_stations,).

        With another thickness over chord too, if one is given.

        Parameters
        ----------
        chord : array_like of shape (n_stations,)
            Chord (m).
        twist : array_like of shape (n_stations,)
            Twist, set angle included (rad).
        thickness : array_like of shape (n_stations,), optional
            Thickness over chord; by default it stays.

        Returns
        -------
        Blade
            The changed blade.
        """
        chord, twist = np.array(chord, dtype=float), np.array(twist, dtype=float)
        thickness = self.thickness if thickness is None else np.array(thickness, dtype=float)
        return replace(self, chord=chord, twist=twist, thickness=thickness)

    def with_rotor_radius(self, rotor_radius):
        """Return the blade with hub, stations and tip moved to another disc radius (m).

        Chord and twist stay as they are.

        Parameters
        ----------
        rotor_radius : float
            Radius of the swept disc (m).

        Returns
        -------
        Blade
            The blade of that radius.
        """
        if rotor_radius == self.rotor_radius:
            return self
        factor = rotor_radius / self.rotor_radius
        radii = ("r", "hub_radius", "tip_radius")
        return replace(self, **{name: getattr(self, name) * factor for name in radii})
