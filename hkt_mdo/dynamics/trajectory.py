"""The quantities of a rotor's trajectory: their names, units and columns, stated once."""

from hkt_mdo.dynamics.generator import LOSSLESS

QUANTITIES = {
    "time": ("s", "time since the start"),
    "inflow_speed": ("m/s", "undisturbed flow speed at the rotor"),
    "rotor_speed": ("rad/s", "angular speed of the rotor"),
    "tip_speed_ratio": (None, "tip speed over inflow speed"),
    "hydrodynamic_torque": ("N*m", "torque of the flow on the rotor"),
    "control_torque": ("N*m", "generator torque on the rotor"),
    "hydrodynamic_power": ("W", "power captured from the flow"),
    "generator_power": ("W", "power taken by the generator"),
    "electrical_power": ("W", "power delivered by the generator, less its losses"),
}
"""Unit (None: dimensionless) and description of each quantity, by its name in the ODE."""

LOADS = {
    "thrust": ("N", "thrust of the flow on the rotor, along its axis"),
    "root_moment": ("N*m", "flapwise moment of one blade at the hub's radius"),
    "stress": ("Pa", "largest stress in a blade"),
    "cavitation": (None, "largest suction, times its margin, over the pressure above vapour's"),
}
"""Unit and description of each load, which follow from tip speed ratio and flow; those that are
known of a rotor (`hkt_mdo.rotor.loads`) stand beside the quantities of its trajectory."""

RATES = {"torque_rate": ("N*m/s", "rate of the control torque")}
"""Unit and description of each rate, which follows from a quantity at several times."""

SERIES = QUANTITIES | LOADS | RATES

_SUFFIXES = {None: "", "N*m": "_Nm", "N*m/s": "_Nm_s", "m/s": "_m_s", "rad/s": "_rad_s"}

COLUMNS = {name: name + _SUFFIXES.get(unit, f"_{unit}") for name, (unit, _) in SERIES.items()}
"""Header of each quantity's, load's and rate's column in `trajectory.csv` and `simulation.csv`."""


def quantities(
    time,
    inflow_speed,
    rotor_speed,
    hydrodynamic_torque,
    control_torque,
    rotor_radius,
    generator=LOSSLESS,
):
    """Return all `QUANTITIES` by their names, arrays of one shape; rotor_radius (m) is a scalar."""
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
