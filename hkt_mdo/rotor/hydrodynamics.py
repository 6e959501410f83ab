"""The hydrodynamics of a rotor: the rest of the program computes its flow by this object only.

A finer model of the flow, such as sectors of the disc, would be added here.
"""

from dataclasses import dataclass, replace

import numpy as np

from hkt_mdo.rotor import bem, ccblade
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.angle_curves import curves_at, stacked
from hkt_mdo.rotor.best_section import best_sections
from hkt_mdo.rotor.reynolds import LocalReynolds, polar_in_flow
from hkt_mdo.rotor.suction import require_suction
from hkt_mdo.rotor.thickness import ByThickness

SOLVERS = {"vectorized": bem.rotor_coefficients, "ccblade": ccblade.rotor_coefficients}
"""Solvers of the coefficients of a rotor, by the name in a case."""


@dataclass(frozen=True, eq=False)
class Hydrodynamics:
    """Blade element momentum theory for any blade with the same sections.

    Attributes
    ----------
    polar : Polar or tuple of Polar or LocalReynolds or ByThickness
        Lift and drag of the sections: the same at all stations, one a station, or polars that
        follow the local Reynolds number or the blade's thickness.
    solver : str
        Solver of `coefficients`, one of `SOLVERS`; all else is computed by `hkt_mdo.rotor.bem`.
    """

    polar: Polar | tuple[Polar, ...] | LocalReynolds | ByThickness
    solver: str = "vectorized"

    @property
    def follows_reynolds(self):
        """Whether polars follow the Reynolds number, and with it the speed of the flow.

        Returns
        -------
        bool
            True for a `LocalReynolds`.
        """
        return isinstance(self.polar, LocalReynolds)

    @property
    def follows_thickness(self):
        """Whether polars follow the thickness of the blade, which is then designed.

        Returns
        -------
        bool
            True for a `ByThickness`.
        """
        return isinstance(self.polar, ByThickness)

    @property
    def several_sections(self):
        """Whether the stations have different polars, whose sum is rougher than one polar.

        Returns
        -------
        bool
            False for one section of all stations.
        """
        return isinstance(self.polar, tuple | ByThickness)

    def at_station(self, station):
        """Return the same rotor for a strip of sections at one station, by its index.

        Parameters
        ----------
        station : int
            Index of the station.

        Returns
        -------
        Hydrodynamics
            With the polar of that station alone.
        """
        own = self.polar if isinstance(self.polar, Polar) else self.polar[station]
        return replace(self, polar=own)

    def at_flow(self, flow_speed):
        """Return the same rotor with polars at the Reynolds numbers of a flow.

        Parameters
        ----------
        flow_speed : float or ndarray of shape (n_points,)
            Speed of the undisturbed flow (m/s), one or one an operating point. It matters only
            where polars follow the Reynolds number.

        Returns
        -------
        Hydrodynamics
            Of the same class as this one.
        """
        return replace(self, polar=polar_in_flow(self.polar, flow_speed))

    def as_built(self, blade):
        """Return the same rotor with the polars of a blade's sections at their thickness.

        Parameters
        ----------
        blade : Blade
            Its thickness over chord matters only where polars follow the thickness.

        Returns
        -------
        Hydrodynamics
            Of the same class as this one.
        """
        if not self.follows_thickness:
            return self
        return replace(self, polar=self.polar.at(blade.thickness))

    def sections(self, blade, tip_speed_ratio, derivatives=False):
        """Solve the flow at every station of a blade; see `hkt_mdo.rotor.bem.sections`.

        Parameters
        ----------
        blade : Blade
            The blade.
        tip_speed_ratio : array_like of shape (n_points,)
            Omega R / V of the disc, positive.
        derivatives : bool
            Whether the derivatives are computed.

        Returns
        -------
        Sections
            Arrays (n_points, n_stations). Their derivatives by the tip speed ratio are by that
            along the blade, which is the disc's over cos(cone).

        Raises
        ------
        ValueError
            Where a tip speed ratio is not positive, stations do not lie between hub and tip, or
            there is neither one polar nor one a station.
        """
        points = np.asarray(tip_speed_ratio, dtype=float) / np.cos(blade.cone)
        return bem.sections(blade, self.polar, points, derivatives)

    def coefficients(self, blade, tip_speed_ratio, derivatives=False, flow=None):
        """Return torque, power and thrust coefficient of the rotor.

        Parameters
        ----------
        blade : Blade
            The blade.
        tip_speed_ratio : array_like of shape (n_points,)
            Omega R / V of the disc, positive.
        derivatives : bool
            Whether the derivatives of the torque coefficient are computed.
        flow : Sections, optional
            What `sections` returns for the same, if it is known; without effect for CCBlade.

        Returns
        -------
        Coefficients
            Coefficients at the points.

        Raises
        ------
        ValueError
            As `sections` does.
        InputError
            If the solver is CCBlade and WISDEM is not installed.
        """
        return SOLVERS[self.solver](blade, self.polar, tip_speed_ratio, derivatives, flow)

    def suction(self, angle_of_attack, *thickness):
        """Return the largest -Cp of the sections of a blade and its slopes.

        Parameters
        ----------
        angle_of_attack : ndarray of shape (n_points, n_stations)
            Angle of attack (rad).
        *thickness : ndarray of shape (n_stations,)
            Over chord; given where polars follow it.

        Returns
        -------
        suction, by_angle, by_thickness : ndarray of shape (2, n_points, n_stations)
            -Cp of the upper and the lower surface and its slopes, per rad and over the thickness;
            the last one only where polars follow the thickness.

        Raises
        ------
        InputError
            Where a polar has no suction.
        """
        own = self.polar.sections if self.follows_thickness else self.polar
        polars = (own,) if isinstance(own, Polar) else own
        require_suction(polars)
        curves, each = stacked(polars, "suction"), (np.arange(len(polars)),)
        if not self.follows_thickness:
            return curves_at(curves, angle_of_attack, each)
        suction, by_angle = curves_at(curves, angle_of_attack[..., None], each)
        weights, slopes = self.polar.weights(*thickness)
        pairs = (weights, suction), (weights, by_angle), (slopes, suction)
        return tuple(np.sum(weight * value, axis=-1) for weight, value in pairs)

    def best_sections(self, blade, tip_speed_ratio, bounds):
        """Return the best section of every station; see `hkt_mdo.rotor.best_section`.

        Parameters
        ----------
        blade : Blade
            Its chord and twist do not matter.
        tip_speed_ratio : array_like of shape (n_points,)
            Omega R / V of the disc.
        bounds : dict of str to tuple of float
            Smallest and largest chord (m) and twist (rad).

        Returns
        -------
        BestSections
            Arrays (n_points, n_stations).
        """
        points = np.asarray(tip_speed_ratio, dtype=float) / np.cos(blade.cone)
        return best_sections(blade, self.polar, points, bounds)
