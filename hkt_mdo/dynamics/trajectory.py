"""The quantities of a rotor's trajectory, from its speeds and torques."""


def trajectory_of(
    time, inflow_speed, rotor_speed, hydrodynamic_torque, control_torque, rotor_radius, generator
):
    """Return all quantities that a trajectory provides, by name.

    Parameters
    ----------
    time, inflow_speed, rotor_speed, hydrodynamic_torque, control_torque : array
        Of one shape; s, m/s, rad/s, N*m, N*m.
    rotor_radius : float
        Radius of the swept disc, m.
    generator : Generator
        Its losses decide the electrical power.

    Returns
    -------
    dict of array
        Of that shape, by the names in `hkt_mdo.quantities`.
    """
    return {
        "time": time,
        "inflow_speed": inflow_speed,
        "rotor_speed": rotor_speed,
        "tip_speed_ratio": rotor_speed * rotor_radius / inflow_speed,
        "hydrodynamic_torque": hydrodynamic_torque,
        "control_torque": control_torque,
        "hydrodynamic_power": hydrodynamic_torque * rotor_speed,
        "generator_power": control_torque * rotor_speed,
        "electrical_power": generator.electrical_power(control_torque, rotor_speed),
    }
