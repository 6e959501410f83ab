"""The results of a year: energy by bins of the flow speed, power curve, hours at each limit."""

from __future__ import annotations

from typing import Any

import numpy as np

from hkt_mdo.dynamics.resource import YEAR, Resource
from hkt_mdo.problem.equilibrium import SteadyScenario
from hkt_mdo.results.summary import YearEntry
from hkt_mdo.run.flight import SteadyFlight

HOUR = 3600.0
KILOWATT_HOUR = 3.6e6
RATED = 0.999  # of the largest power, from which the machine counts as at its rated power
MEANS = {
    "rotor_speed_rad_s": "rotor_speed",
    "control_torque_Nm": "control_torque",
    "captured_power_W": "hydrodynamic_power",
    "generator_power_W": "generator_power",
    "electrical_power_W": "electrical_power",
}


def table(flight: SteadyFlight) -> dict[str, np.ndarray]:
    """Return the power curve and the energy of a year by bins, (n_bins,) by column.

    Parameters
    ----------
    flight : SteadyFlight
        Of a steady scenario.

    Returns
    -------
    dict of numpy.ndarray
        Columns as of `hkt_mdo.results.solution.TABLES`: means over the speeds of a bin, by the time
        of each.
    """
    scenario, known = flight.scenario, flight.integrated
    assert isinstance(scenario, SteadyScenario)
    weights, place = scenario.node_weights, scenario.place
    time = np.bincount(place, weights)
    used = time > 0.0

    def mean(values):
        return (np.bincount(place, weights * values)[used]) / time[used]

    found = {"inflow_speed_m_s": np.cbrt(mean(known["inflow_speed"] ** 3))}
    found["hours"] = time[used] * (YEAR / scenario.mesh.duration) / HOUR
    found |= {column: mean(known[name]) for column, name in MEANS.items()}
    kept = scenario.resource.kept if isinstance(scenario.resource, Resource) else 1.0
    energy = found["electrical_power_W"] * found["hours"] * HOUR
    return found | {"energy_kWh": kept * energy / KILOWATT_HOUR}


def entry(flight: SteadyFlight, limits: dict[str, dict[str, Any]]) -> YearEntry:
    """Return the results of the year of a resource.

    Parameters
    ----------
    flight : SteadyFlight
        Of a resource.
    limits : dict
        The entries of the limits over time, by name, with their shares of the time of operation.

    Returns
    -------
    YearEntry
    """
    scenario, known = flight.scenario, flight.integrated
    assert isinstance(scenario, SteadyScenario)
    assert isinstance(scenario.resource, Resource)
    scale, kept = YEAR / scenario.mesh.duration, scenario.resource.kept
    energy = flight.simulation.electrical_energy * scale
    rated = float(np.max(known["electrical_power"]))
    hours = scenario.duration * scale / HOUR
    at_rated = flight.integral(np.where(known["electrical_power"] >= RATED * rated, 1.0, 0.0))
    return YearEntry(
        energy_kWh=energy / KILOWATT_HOUR,
        net_energy_kWh=kept * energy / KILOWATT_HOUR,
        kept=kept,
        rated_power_W=rated,
        capacity_factor=kept * energy / (YEAR * rated),
        operation_h=hours,
        standstill_h=YEAR / HOUR - hours,
        rated_h=at_rated * scale / HOUR,
        mean_cube_m3_s3=scenario.resource.mean_cube,
        limits_h={name: hours * each["share_of_time"] for name, each in limits.items()},
    )
