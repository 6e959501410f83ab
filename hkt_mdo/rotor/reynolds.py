"""Polars that follow the Reynolds number of their station and operating point."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.errors import InputError
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.polars import Polars


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
