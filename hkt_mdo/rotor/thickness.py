"""Polars that follow the thickness of their station, where that is designed."""

from dataclasses import dataclass
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
