"""The original CCBlade (WISDEM), behind the same call as `hkt_mdo.rotor.bem`.

WISDEM is imported only when a function is called: its import takes seconds.
"""

import numpy as np

from hkt_mdo.errors import needed
from hkt_mdo.rotor.bem import Coefficients, Table


def rotor_coefficients(blade, polar, tip_speed_ratio, derivatives=False, flow=None):
    """Return the `Coefficients` by CCBlade, as `hkt_mdo.rotor.bem.rotor_coefficients` does.

    Raises InputError if WISDEM is not installed.

    Parameters
    ----------
    blade : Blade
        The blade.
    polar : Polars
        Polars of the sections, which do not follow the Reynolds number.
    tip_speed_ratio : array_like of shape (n_points,)
        Omega R / V of the disc, positive.
    derivatives : bool
        Whether the derivatives are computed.
    flow : Sections, optional
        Without effect: CCBlade solves the flow itself.

    Returns
    -------
    Coefficients
        Coefficients at the points.

    Raises
    ------
    InputError
        If WISDEM is not installed.
    """
    points = np.atleast_1d(np.asarray(tip_speed_ratio, dtype=float))
    rotor = ccblade(blade, polar, derivatives)
    # At unit flow speed the tip speed ratio is the tip speed; CCBlade takes revolutions per minute.
    rpm_per_ratio = 30.0 / (np.pi * blade.rotor_radius)
    # CCBlade normalizes side forces that are zero in aligned flow
    with np.errstate(divide="ignore", invalid="ignore"):
        outputs, gradients = rotor.evaluate(
            np.ones(points.size), points * rpm_per_ratio, np.zeros(points.size), coefficients=True
        )
    torque = Table(outputs["CQ"])
    if derivatives:
        by = gradients["dCQ"]
        torque = Table(
            outputs["CQ"],
            np.diag(by["dOmega"]) * rpm_per_ratio,
            by["dchord"],
            np.rad2deg(by["dtheta"]),
            np.zeros(by["dchord"].shape),
            -(by["dchord"] @ blade.chord) / blade.rotor_radius,
        )
    return Coefficients(torque, outputs["CP"], outputs["CT"], np.zeros(points.size))


def ccblade(blade, polar, derivatives=False):
    """Return WISDEM's CCBlade of a blade in water of unit density, aligned with a uniform flow.

    Parameters
    ----------
    blade : Blade
        The blade.
    polar : Polars
        Polars of the sections, which do not follow the Reynolds number.
    derivatives : bool
        Whether the derivatives are computed.

    Returns
    -------
    wisdem.ccblade.ccblade.CCBlade
        The rotor, ready to be evaluated.

    Raises
    ------
    InputError
        If WISDEM is not installed.
    """
    setting = {"key": "hydrodynamics.bem", "value": "ccblade"}
    wisdem = needed("wisdem.ccblade.ccblade", "pip install wisdem, or choose vectorized", **setting)
    polars = [table for (table,) in polar.stations(blade)]
    stations = blade.r, blade.chord, np.rad2deg(blade.twist), polars
    rotor = {"B": blade.blade_count, "precone": np.rad2deg(blade.cone), "derivatives": derivatives}
    water = {"rho": 1.0, "mu": 1.0, "shearExp": 0.0}
    return wisdem.CCBlade(*stations, blade.hub_radius, blade.tip_radius, **rotor, **water)
