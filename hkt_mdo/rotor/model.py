"""A rotor as one object: hydrodynamics, loads, mass and best operation of any of its blades."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hkt_mdo.rotor import bem, ccblade, steady_optimum
from hkt_mdo.rotor.inertia import RotorMass, mass_and_inertia, water_inertia
from hkt_mdo.rotor.loads import LoadModel

SOLVERS = {"vectorized": bem.rotor_coefficients, "ccblade": ccblade.rotor_coefficients}
"""Solvers of the coefficients of a rotor, by the name in a case."""
JUMP, JUMP_SAMPLES = 1e-4, 2001
"""Share of the torque, and tip speed ratios, by which a jump of the torque is found."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RotorModel(LoadModel):
    """The data of a rotor that do not depend on its design, and the models of any of its blades.

    Attributes
    ----------
    polar, structure, water_density, depth, margin
        See `LoadModel`.
    hub_inertia : float
        Inertia about the rotor's axis of all that is not a blade (kg*m**2), where a blade does not
        have its own, which is designed.
    inertia_factor : float
        Inertia of the actual rotor over that of blades, hub and water.
    added_inertia : str
        The water that turning blades accelerate, as part of the inertia: "none", or that of flat
        plates, "plate", or of ellipses with the sections' thickness, "ellipse".
    thickness : float or ndarray of shape (n_stations,)
        Thickness of the sections over the chord, where a blade does not have its own.
    solver : str
        Solver of `coefficients`, one of `SOLVERS`; all else is computed by `hkt_mdo.rotor.bem`.
    """

    hub_inertia: float = 0.0
    inertia_factor: float = 1.0
    added_inertia: str = "none"
    thickness: float | np.ndarray = 0.0
    solver: str = "vectorized"

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
            What `bem.sections` returns for the same, if it is known; without effect for CCBlade.

        Returns
        -------
        Coefficients
            Coefficients at the points.

        Raises
        ------
        ValueError
            As `bem.sections` does.
        InputError
            If the solver is CCBlade and WISDEM is not installed.
        """
        return SOLVERS[self.solver](blade, self.polar, tip_speed_ratio, derivatives, flow)

    def tables(self, blade, tip_speed_ratio, names, derivatives=False, flow=None):
        """Return the torque coefficient and smooth largest loads (`Load.envelope`) over q.

        Parameters
        ----------
        blade : Blade
            The blade.
        tip_speed_ratio : ndarray of shape (n_points,)
            Omega R / V of the disc, positive.
        names : sequence of str
            torque_coefficient, and some of `load_names`.
        derivatives : bool
            Whether to compute the derivatives by the blade.
        flow : Sections, optional
            As `loads` takes it.

        Returns
        -------
        dict of Table
            The torque coefficient first, then loads in the order of the names.
        """
        if flow is None:
            flow = bem.sections(blade, self.polar, tip_speed_ratio, derivatives)
        arguments, tables = (blade, tip_speed_ratio, derivatives), {}
        if "torque_coefficient" in names:
            tables["torque_coefficient"] = self.coefficients(*arguments, flow).torque_table
        loads = self.loads(*arguments, [name for name in names if name not in tables], flow)
        return tables | {name: load.envelope() for name, load in loads.items()}

    def mass_and_inertia(self, blade):
        """Return mass and inertia of the rotor with a blade.

        Parameters
        ----------
        blade : Blade
            The blade.

        Returns
        -------
        RotorMass
            The mass is that of the blades, the inertia that of blades, hub and water times the
            factor.
        """
        hub, material = self.hub_of(blade), self.structure
        mass, inertia = mass_and_inertia(blade, material.section_area, material.density, hub)
        if self.added_inertia != "none":
            inertia = inertia + self.water_inertias(blade)[self.added_inertia]
        return RotorMass(mass, inertia * self.inertia_factor)

    def hub_of(self, blade):
        """Return the inertia of all that is not a blade, designed or not.

        Parameters
        ----------
        blade : Blade
            The blade.

        Returns
        -------
        float
            Inertia (kg*m**2), without the factor.
        """
        return self.hub_inertia if blade.hub_inertia is None else blade.hub_inertia

    def thickness_of(self, blade):
        """Return the largest thickness over chord of a blade's sections, designed or not.

        Parameters
        ----------
        blade : Blade
            The blade.

        Returns
        -------
        ndarray of shape (n_stations,)
            At the stations.
        """
        thickness = self.thickness if blade.thickness is None else blade.thickness
        return np.broadcast_to(thickness, blade.r.shape)

    def water_inertias(self, blade):
        """Return the inertia of the water that a turning blade accelerates, by both models.

        Parameters
        ----------
        blade : Blade
            The blade.

        Returns
        -------
        dict of str to float
            Of "plate" and "ellipse", kg*m**2; see `water_inertia`.
        """
        ellipse = water_inertia(blade, self.water_density, self.thickness_of(blade))
        return {"plate": water_inertia(blade, self.water_density), "ellipse": ellipse}

    def torque_jump(self, blade, tip_speed_ratio, near=0.0):
        """Return where the torque of a blade jumps most between some tip speed ratios.

        It does where the flow at a station stalls at once: a root of blade element momentum theory
        vanishes (docs/studies/bem.md).

        Parameters
        ----------
        blade : Blade
            The blade.
        tip_speed_ratio : array_like
            Omega R / V of the disc, between whose smallest and largest value it may jump.
        near : float
            Share of these by which the range is wider.

        Returns
        -------
        float or None
            Radius of the station (m) whose torque differs most, between neighbours of many ratios,
            from what its slopes say; None if that is nowhere more than `JUMP` of the largest torque
            of the blade.
        """
        ends = (1.0 - near) * np.min(tip_speed_ratio), (1.0 + near) * np.max(tip_speed_ratio)
        ratios, weights = np.linspace(*ends, JUMP_SAMPLES), bem.torque_weights(blade)
        flow = bem.sections(blade, self.polar, ratios, derivatives=True)
        torque, slope = weights * flow.tangential_load, weights * flow.derivatives[0, 0]
        change = 0.5 * (slope[1:] + slope[:-1]) * np.diff(ratios)[:, None]
        off = np.max(np.abs(np.diff(torque, axis=0) - change), axis=0)
        jumps = np.max(off) > JUMP * np.max(np.abs(np.sum(torque, axis=1)))
        return float(blade.r[np.argmax(off)]) if jumps else None

    def best_operation(self, blade):
        """Return where a blade has its largest power coefficient.

        Parameters
        ----------
        blade : Blade
            The blade.

        Returns
        -------
        SteadyOptimum
            Tip speed ratio and power coefficient there.
        """
        return steady_optimum.best_operation(blade, self.polar)

    @lru_cache(maxsize=8)  # noqa: B019 - the search for a start and every check of a run ask
    def best_of_shape(self, shape, blade):
        """Return the best rotor of a family of blades with the radius of one of them.

        Parameters
        ----------
        shape : Shape
            What is designed: chord and twist at the stations, the set angle, or nothing.
        blade : Blade
            Gives the radius, and chord and twist where they are not designed.

        Returns
        -------
        SteadyOptimum
            The best blade, where it works, and its power coefficient.
        """
        if shape.designs_chord:
            return steady_optimum.best_rotor(blade, self.polar, shape.bounds)
        if shape.designs_set_angle:
            return steady_optimum.best_set_angle(shape, blade, self.polar)
        return self.best_operation(blade)
