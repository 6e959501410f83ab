"""Polars along a blade: what the program asks of them, whatever they follow.

Their curves over the angle of attack are periodic, and cubic between equidistant knots.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.rotor.suction import require_suction

# A polar on a 0.25 or 0.5 degree grid is interpolated exactly at its own points. A lookup is one
# multiplication instead of a search.
KNOTS_PER_DEGREE = 4


@lru_cache(maxsize=64)
def stacked(polars, name):
    """Return the curves of several polars in one array.

    Parameters
    ----------
    polars : tuple of Polar
        The polars.
    name : str
        coefficients or suction.

    Returns
    -------
    ndarray of shape (n_polars, n_knots, 8)
        Their curves.
    """
    return np.stack([getattr(polar, name) for polar in polars])


def curves_at(curves, alpha, which=()):
    """Return the values and the slopes (per rad) of two periodic curves at angles.

    Parameters
    ----------
    curves : ndarray of shape (..., n_knots, 8)
        Of `periodic_curves`, or several of them.
    alpha : float or ndarray
        Angle of attack (rad).
    which : tuple of ndarray
        Indices of the leading axes of `curves`, which broadcast with the angles.

    Returns
    -------
    values, slopes : ndarray of shape (2, *alpha.shape)
        The slopes are per rad.
    """
    n_knots = curves.shape[-2]
    step = 2.0 * np.pi / n_knots
    index = np.floor((np.real(alpha) + np.pi) / step).astype(int)
    row = np.moveaxis(curves[(*which, index % n_knots)], -1, 0)
    x, pairs = alpha + np.pi - index * step, (row[:4], row[4:])
    values = [a + x * (b + x * (c + x * d)) for a, b, c, d in pairs]
    return np.stack(values), np.stack([b + x * (2.0 * c + x * 3.0 * d) for _, b, c, d in pairs])


def periodic_curves(alpha, *columns):
    """Return the coefficients of periodic curves through two columns.

    Parameters
    ----------
    alpha : ndarray of shape (n,)
        Angle of attack (rad) over one turn, increasing.
    *columns : ndarray of shape (n,)
        The same at both ends.

    Returns
    -------
    ndarray of shape (n_knots, 8)
        Of both curves from each knot to the next: value, slope, and the coefficients of the
        second and the third power of the angle (rad) from the knot.
    """
    n_knots = 360 * KNOTS_PER_DEGREE
    knots = np.linspace(-np.pi, np.pi, n_knots + 1)
    values = CubicSpline(alpha, np.column_stack(columns), bc_type="periodic")(knots)
    values[-1] = values[0]
    pieces = CubicSpline(knots, values, bc_type="periodic").c[::-1]
    return pieces.transpose(1, 2, 0).reshape(n_knots, -1)


class Polars:
    """Polars of a blade's sections: at a station and an operating point a weighted sum of tables.

    `tables` are `Polar`, some at every station, or one tuple for all stations. A `Polar` is the one
    table of all stations; `ByStation` has one a station, `LocalReynolds` those of several Reynolds
    numbers, `ByThickness` those of several thicknesses.
    """

    tables: tuple[tuple, ...]
    follows_reynolds = False
    """Whether the weights follow the Reynolds number, and with it the speed of the flow."""
    follows_thickness = False
    """Whether they follow the thickness of the blade, which is then designed."""
    several = False
    """Whether the stations have different sections, whose sum is rougher than one polar."""

    def weights(self, blade, _tip_speed_ratio):
        """Return the weights of the tables, and their slopes over what they follow.

        Parameters
        ----------
        blade : Blade
            The blade.
        _tip_speed_ratio : array_like of shape (n_points,)
            Omega R / V of the disc.

        Returns
        -------
        ndarray of shape (2, n_stations, n_points, n_tables)
            Weights and slopes; axis 2 has length 1 where all points have the same.
        """
        return np.repeat([1.0, 0.0], blade.r.size).reshape(2, -1, 1, 1)

    def in_flow(self, _flow_speed):
        """Return the polars at the Reynolds numbers of a flow.

        Parameters
        ----------
        _flow_speed : float or ndarray of shape (n_points,)
            Speed of the undisturbed flow (m/s), one or one an operating point.

        Returns
        -------
        Polars
            Of the same kind.
        """
        return self

    def scaled(self, lift, drag):
        """Return the polars with factors on lift and drag, such as those of fouled sections.

        Parameters
        ----------
        lift, drag : float
            The factors. The suction stays.

        Returns
        -------
        Polars
            Of the same kind.
        """
        tables = tuple(tuple(polar.scaled(lift, drag) for polar in row) for row in self.tables)
        return replace(self, tables=tables)

    def at_station(self, station):
        """Return the polars of one station, for a strip of sections there.

        Parameters
        ----------
        station : int
            Index of the station.

        Returns
        -------
        Polars
            Of the same kind.
        """
        return self if len(self.tables) == 1 else replace(self, tables=(self.tables[station],))

    def stations(self, blade):
        """Return the polars of every station: those by Reynolds number, or its only one.

        Parameters
        ----------
        blade : Blade
            The blade.

        Returns
        -------
        tuple of tuple of Polar
            Of each station.

        Raises
        ------
        ValueError
            If there are neither polars for all stations nor for each.
        """
        return self._by_station(blade.r.size)

    def _by_station(self, n_stations):
        """Return the tables of every station."""
        tables = self.tables * n_stations if len(self.tables) == 1 else self.tables
        if len(tables) != n_stations:
            text = f"{len(tables)} polars for {n_stations} stations"
            raise ValueError(f"{text}: give one polar, or one for each")
        return tables

    def curves(self, n_stations, name):
        """Return the curves of all different tables, and where those of each station begin.

        Parameters
        ----------
        n_stations : int
            Number of stations.
        name : str
            coefficients or suction.

        Returns
        -------
        curves : ndarray of shape (n, n_knots, 8)
            As `stacked` returns them.
        first : ndarray of shape (n_stations,)
            Index of each station's first table.

        Raises
        ------
        ValueError
            As of `stations`.
        """
        by_station = self._by_station(n_stations)
        firsts = {tables: i * len(tables) for i, tables in enumerate(dict.fromkeys(by_station))}
        curves = stacked(tuple(polar for tables in firsts for polar in tables), name)
        return curves, np.array([firsts[tables] for tables in by_station])

    def along(self, name, blade, tip_speed_ratio, angle_of_attack):
        """Return lift and drag of a blade's sections, or -Cp min of both surfaces, and slopes.

        Parameters
        ----------
        name : str
            coefficients or suction.
        blade : Blade
            The blade.
        tip_speed_ratio : array_like of shape (n_points,)
            Omega R / V of the disc.
        angle_of_attack : ndarray of shape (n_points, n_stations)
            Angle of attack (rad), maybe complex.

        Returns
        -------
        values, by_angle, by_followed : ndarray of shape (2, n_points, n_stations)
            Both values, and their slopes per rad and over what the weights follow.

        Raises
        ------
        InputError
            Where a polar has no suction.
        """
        if name == "suction":
            require_suction(polar for tables in self.tables for polar in tables)
        curves, first = self.curves(blade.r.size, name)
        weights, slopes = self.weights(blade, tip_speed_ratio).swapaxes(1, 2)
        which = first[:, None] + np.arange(weights.shape[-1])
        values, by_angle = curves_at(curves, angle_of_attack[..., None], (which,))
        pairs = (weights, values), (weights, by_angle), (slopes, values)
        return tuple(np.sum(weight * value, axis=-1) for weight, value in pairs)


@dataclass(frozen=True, eq=False)
class ByStation(Polars):
    """Polars of a blade with another section at each station: tables has one for each."""

    tables: tuple[tuple, ...]
    several = True

    @classmethod
    def of(cls, polars):
        """Take one polar a station.

        Parameters
        ----------
        polars : sequence of Polar
            Those of the stations.

        Returns
        -------
        ByStation
            With one table a station.
        """
        return cls(tuple((polar,) for polar in polars))
