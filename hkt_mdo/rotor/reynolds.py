"""Polars that follow the Reynolds number of their station and operating point."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.errors import InputError
from hkt_mdo.rotor.airfoil import Polar


@dataclass(frozen=True, eq=False)
class LocalReynolds:
    """Polars at the local Reynolds number, splines over its logarithm with zero slope at the ends.

        Re = chord V sqrt(1 + lambda_r²) / nu,

    with the undisturbed relative speed. The induction would change the logarithm of Re by a few
    hundredths, but would couple it to the inflow angle. Beyond the tables the nearest one holds.
    log_reynolds[n_reynolds] increases, polars are by station and number, the flow speed (m/s) is
    that of all operating points or of each, and nu is the kinematic viscosity (m²/s).
    """

    log_reynolds: np.ndarray
    polars: tuple[tuple[Polar, ...], ...]
    flow_speed: float | np.ndarray
    viscosity: float

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
        polars = tuple(tables[family] for family in families)
        return cls(np.log(numbers), polars, flow_speed, viscosity)

    @cached_property
    def _cardinal(self):
        level = (1, np.zeros(self.log_reynolds.size))
        unit = np.eye(self.log_reynolds.size)
        return CubicSpline(self.log_reynolds, unit, bc_type=(level, level))

    def mixture(self, blade, blade_ratio):
        """Return the weights of the tables and their slopes over ln(Re), by station and point.

        Shape (2, n_stations, n_points, n_reynolds), for Omega R / V at the points.

        Parameters
        ----------
        blade : Blade
            The blade.
        blade_ratio : array_like of shape (n_points,)
            Omega R / V with R along the blade.

        Returns
        -------
        ndarray of shape (2, n_stations, n_points, n_reynolds)
            Weights, and their slopes over ln(Re).
        """
        lambda_r = blade.r[:, None] / blade.tip_radius * blade_ratio
        unit = self.flow_speed * np.cos(blade.cone) / self.viscosity
        number = np.log(unit * blade.chord[:, None] * np.sqrt(1.0 + lambda_r**2))
        inside = np.clip(number, self.log_reynolds[0], self.log_reynolds[-1])
        slopes = self._cardinal(inside, 1) * (inside == number)[:, :, None]
        return np.stack((self._cardinal(inside), slopes))

    def __getitem__(self, station):
        """Return the polars of one station, for a strip of sections there."""
        return replace(self, polars=(self.polars[station],))


def polar_in_flow(polar, flow_speed):
    """Return polars at the Reynolds numbers of a flow; those that do not follow it as they are.

    Parameters
    ----------
    polar : Polar or tuple of Polar or LocalReynolds or ByThickness
        Polars of the sections.
    flow_speed : float or ndarray of shape (n_points,)
        Speed of the undisturbed flow (m/s).

    Returns
    -------
    Polar or tuple of Polar or LocalReynolds or ByThickness
        Of the same kind.
    """
    return replace(polar, flow_speed=flow_speed) if isinstance(polar, LocalReynolds) else polar
