"""Blade geometry: stations, chord and twist of one of the rotor's equal blades."""

from dataclasses import dataclass

import numpy as np

from hkt_mdo.data import read_table
from hkt_mdo.errors import InputError


@dataclass(frozen=True, eq=False)
class Blade:
    """One blade of a rotor, and what the rotor needs to know besides.

    Parameters
    ----------
    r : ndarray, shape (n_stations,), m
        Station radii, increasing, strictly between hub and tip.
    chord : ndarray, shape (n_stations,), m
    twist : ndarray, shape (n_stations,), rad
        Angle between the section's chord and the rotor plane, set angle included.
    hub_radius, tip_radius : float, m
    blade_count : int
    """

    r: np.ndarray
    chord: np.ndarray
    twist: np.ndarray
    hub_radius: float
    tip_radius: float
    blade_count: int

    def with_shape(self, chord, twist):
        """Return the blade with another chord (m) and twist (rad), each of shape (n_stations,)."""
        return Blade(
            self.r,
            np.array(chord, dtype=float),
            np.array(twist, dtype=float),
            self.hub_radius,
            self.tip_radius,
            self.blade_count,
        )

    @classmethod
    def from_csv(cls, source, stations, tip_radius, hub_radius, blade_count, set_angle):
        """Scale a published blade to a radius and read it at the stations, linearly in between.

        Parameters
        ----------
        source : str or Path
            CSV file with columns r_over_R, c_over_R, pitch_deg, or the name of a shipped blade.
        stations : array, shape (n_stations,)
            r/R.
        tip_radius, hub_radius : float, m
        blade_count : int
        set_angle : float, rad
            Added to the file's pitch.

        Raises
        ------
        InputError
            If the file is missing or broken, its radii do not increase, or it does not cover the
            stations.
        """
        table = read_table(source, ("r_over_R", "c_over_R", "pitch_deg"), "blade")
        radius = table["r_over_R"]
        if radius.size < 2 or np.any(np.diff(radius) <= 0.0):
            raise InputError(
                f"{source}: r_over_R must increase strictly over at least two rows; sort the rows"
            )
        if np.min(table["c_over_R"]) <= 0.0:
            raise InputError(
                f"{source}: c_over_R = {np.min(table['c_over_R']):g}: chords must be positive"
            )
        stations = np.asarray(stations, dtype=float)
        if stations[0] < radius[0] - 1e-9 or stations[-1] > radius[-1] + 1e-9:
            raise InputError(
                f"{source}: blade covers r/R = {radius[0]:g} … {radius[-1]:g} but "
                f"rotor.stations reach {stations[0]:g} … {stations[-1]:g}; change them or extend "
                "the file"
            )
        return cls(
            stations * tip_radius,
            np.interp(stations, radius, table["c_over_R"]) * tip_radius,
            np.deg2rad(np.interp(stations, radius, table["pitch_deg"])) + set_angle,
            hub_radius,
            tip_radius,
            blade_count,
        )
