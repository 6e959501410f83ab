"""Reference magnitudes of a rotor's loads, by which dimensionless coefficients are multiplied."""

import numpy as np


def torque_scale(density, rotor_radius, inflow_speed):
    """Return 0.5 rho pi R³ v² (N*m), so that the torque is Q = Cq torque_scale; SI units.

    Parameters
    ----------
    density : float
        Density of the water (kg/m**3).
    rotor_radius : float
        Radius of the swept disc (m).
    inflow_speed : float or ndarray
        Speed of the undisturbed flow (m/s).

    Returns
    -------
    float or ndarray
        In N*m.
    """
    return 0.5 * density * np.pi * rotor_radius**3 * inflow_speed**2


def power_scale(density, rotor_radius, inflow_speed):
    """Return 0.5 rho pi R² v³ (W), so that the power is P = Cp power_scale; SI units.

    Parameters
    ----------
    density : float
        Density of the water (kg/m**3).
    rotor_radius : float
        Radius of the swept disc (m).
    inflow_speed : float or ndarray
        Speed of the undisturbed flow (m/s).

    Returns
    -------
    float or ndarray
        In W.
    """
    return 0.5 * density * np.pi * rotor_radius**2 * inflow_speed**3
