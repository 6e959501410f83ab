"""Polars that follow the Reynolds number or the thickness of their station."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.errors import InputError
from hkt_mdo.rotor.airfoil import Polar, mixture
from hkt_mdo.rotor.polars import Polars

BETWEEN = 9  # thicknesses between two sections at which the drag is checked


def over_thickness(thickness, values):
    """Return the natural cubic spline of values[n_sections, ...] over the sections' thickness.

    It is linear in the values and C²; of two sections, a straight line.

    Parameters
    ----------
    thickness : ndarray of shape (n_sections,)
        Thickness over chord of the sections, increasing.
    values : array_like of shape (n_sections, ...)
        The values at these thicknesses.

    Returns
    -------
    CubicSpline
        The curve over the thickness.
    """
    return CubicSpline(thickness, values, bc_type="natural")


@dataclass(frozen=True, eq=False)
class ByThickness(Polars):
    """Polars of sections over their thickness; the blade gives the thickness of its stations.

    Lift, drag and suction at an angle of attack are splines through the sections' (see
    `over_thickness`). thickness[n_sections], over the chord, increases, with a table of each;
    bounds are the smallest and the largest thickness that a blade may have, within the sections'.
    """

    thickness: np.ndarray
    tables: tuple[tuple[Polar, ...], ...]
    bounds: tuple[float, float]
    follows_thickness = several = True

    @classmethod
    def of(cls, thickness, sections, bounds):
        """Return the family; InputError where a curve between the sections has no positive drag.

        Parameters
        ----------
        thickness : ndarray of shape (n_sections,)
            Thickness over chord of the sections, increasing.
        sections : sequence of Polar
            Those of the sections.
        bounds : tuple of float
            Smallest and largest thickness of a blade.

        Returns
        -------
        ByThickness
            The polars over the thickness.

        Raises
        ------
        InputError
            Where the drag between sections is not positive.
        """
        family = cls(np.array(thickness, dtype=float), (tuple(sections),), tuple(bounds))
        between = [np.linspace(*ends, BETWEEN + 2)[1:-1] for ends in pairwise(family.thickness)]
        between = np.concatenate(between)
        for at, polar in zip(between, family.at(between), strict=True):
            if np.min(polar.coefficients[:, 4]) <= 0.0:
                problem = "the curve through the sections has no positive drag at a thickness of"
                remedy = "give a section there, or leave out those that differ too much"
                raise InputError(f"{problem} {at:.3g}", remedy, key="rotor.sections")
        return family

    @cached_property
    def _cardinal(self):
        return over_thickness(self.thickness, np.eye(self.thickness.size))

    def weights(self, blade, _tip_speed_ratio=()):
        """Return the sections' weights at a blade's stations and their slopes by the thickness.

        Parameters
        ----------
        blade : Blade
            Gives the thickness of its stations.
        _tip_speed_ratio : array_like
            Without effect.

        Returns
        -------
        ndarray of shape (2, n_stations, 1, n_sections)
            The same at all points.
        """
        weights, slopes = self._cardinal(blade.thickness), self._cardinal(blade.thickness, 1)
        return np.stack((weights, slopes))[:, :, None]

    def stations(self, blade):
        return tuple((polar,) for polar in self.at(blade.thickness))

    def at(self, thickness):
        """Return a `Polar` for each of thickness[n].

        Parameters
        ----------
        thickness : ndarray of shape (n,)
            Thickness over chord.

        Returns
        -------
        tuple of Polar
            One polar for each thickness.
        """
        return tuple(mixture(*self.tables, weights) for weights in self._cardinal(thickness))


@dataclass(frozen=True, eq=False)
class LocalReynolds(Polars):
    """Polars at the local Reynolds number, splines over its logarithm with zero slope at the ends.

        Re = chord V sqrt(1 + lambda_r²) / nu,

    with the undisturbed relative speed. The induction would change the logarithm of Re by a few
    hundredths, but would couple it to the inflow angle. Beyond the tables the nearest one holds.
    log_reynolds[n_reynolds] increases, tables are by station and number, the flow speed (m/s) is
    that of all operating points or of each, and nu is the kinematic viscosity (m²/s).
    """

    log_reynolds: np.ndarray
    tables: tuple[tuple[Polar, ...], ...]
    flow_speed: float | np.ndarray
    viscosity: float
    follows_reynolds = True

    @classmethod
    def of(cls, families, flow_speed, viscosity):
        """Take the polar families of the stations; InputError if there is one number only.

        Parameters
        ----------
        families : sequence of PolarFamily
            Polars of each station.
        flow_speed : float or ndarray of shape (n_points,)
            Speed of the undisturbed flow (m/s).
        viscosity : float
            Kinematic viscosity (m**2/s).

        Returns
        -------
        LocalReynolds
            The polars of the stations.

        Raises
        ------
        InputError
            If there is one Reynolds number only.
        """
        numbers = np.unique(np.concatenate([family.reynolds for family in families]))
        numbers = numbers[np.isfinite(numbers)]
        if numbers.size < 2:
            problem = "needs polars at two or more Reynolds numbers"
            remedy = "give a CSV file with the column reynolds, or rotor.reynolds: invariant"
            raise InputError(problem, remedy, key="rotor.reynolds", value="local")
        tables = {family: tuple(family.at(number) for number in numbers) for family in families}
        by_station = tuple(tables[family] for family in families)
        return cls(np.log(numbers), by_station, flow_speed, viscosity)

    @cached_property
    def _cardinal(self):
        return CubicSpline(self.log_reynolds, np.eye(self.log_reynolds.size), bc_type="clamped")

    def weights(self, blade, tip_speed_ratio):
        """Return the weights of the tables and their slopes over ln(Re), by station and point.

        Parameters
        ----------
        blade : Blade
            The blade.
        tip_speed_ratio : array_like of shape (n_points,)
            Omega R / V of the disc.

        Returns
        -------
        ndarray of shape (2, n_stations, n_points, n_reynolds)
            Weights, and their slopes over ln(Re).
        """
        lambda_r = blade.r[:, None] / blade.rotor_radius * tip_speed_ratio
        unit = self.flow_speed * np.cos(blade.cone) / self.viscosity
        number = np.log(unit * blade.chord[:, None] * np.sqrt(1.0 + lambda_r**2))
        inside = np.clip(number, self.log_reynolds[0], self.log_reynolds[-1])
        slopes = self._cardinal(inside, 1) * (inside == number)[:, :, None]
        return np.stack((self._cardinal(inside), slopes))

    def in_flow(self, flow_speed):
        return replace(self, flow_speed=flow_speed)
