"""The results of a year: energy by bins of the flow speed, power curve, hours at each limit."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from hkt_mdo.dynamics.resource import YEAR, Resource
from hkt_mdo.results.summary import YearEntry
from hkt_mdo.run.verification import Verification

HOUR = 3600.0
KILOWATT_HOUR = 3.6e6
NARROW = 1e-3  # relative change of the flow's speed below which slopes are those of rounding
RATED = 0.999  # of the largest power, from which the machine counts as at its rated power
MEANS = {
    "rotor_speed_rad_s": "rotor_speed",
    "control_torque_Nm": "control_torque",
    "captured_power_W": "hydrodynamic_power",
    "generator_power_W": "generator_power",
    "electrical_power_W": "electrical_power",
}


def table(verifications: Sequence[Verification]) -> dict[str, np.ndarray]:
    """Return the power curve and the energy of a year by bins, (n_bins,) by column.

    Parameters
    ----------
    verifications : sequence of Verification
        Of a steady scenario, one for each direction of the flow in which the rotor works.

    Returns
    -------
    dict of numpy.ndarray
        Columns as of `hkt_mdo.results.solution.TABLES`: means over the time of a bin, zero while
        the machine stands still in it. Speeds at which the rotor turns backwards are negative.
    """
    ways = [_of_direction(verification) for verification in verifications]
    order = np.argsort(np.concatenate([way["inflow_speed_m_s"] for way in ways]))
    return {name: np.concatenate([way[name] for way in ways])[order] for name in ways[0]}


def _of_direction(verification: Verification) -> dict[str, np.ndarray]:
    """Return the table of one direction of the flow."""
    scenario, series = verification.scenario, verification.integrated
    bins, shares = scenario.bins, scenario.node_weights / scenario.mesh.duration
    used = np.unique(bins.place)

    def mean(values):
        return np.bincount(bins.place, shares * values)[used] / bins.time[used]

    columns = {"inflow_speed_m_s": (-1.0 if scenario.backwards else 1.0) * bins.mean[used]}
    columns["hours"] = bins.time[used] * YEAR / HOUR
    columns |= {column: mean(series[name]) for column, name in MEANS.items()}
    share = scenario.resource.kept if isinstance(scenario.resource, Resource) else 1.0
    energy = columns["electrical_power_W"] * columns["hours"] * HOUR
    return columns | {"energy_kWh": share * energy / KILOWATT_HOUR}


def entry(verifications: Sequence[Verification], limits: dict[str, dict[str, Any]]) -> YearEntry:
    """Return the results of the year of a resource.

    Parameters
    ----------
    verifications : sequence of Verification
        Of a resource, one for each direction of the flow in which the rotor works.
    limits : dict
        The entries of the limits over time, by name, with their shares of the time of operation.

    Returns
    -------
    YearEntry
    """
    scenario = verifications[0].scenario
    scale, share = YEAR / scenario.mesh.duration, scenario.resource.kept
    energy = sum(run.simulation.electrical_energy for run in verifications) * scale
    power = "electrical_power"
    rated = max(float(np.max(run.integrated[power])) for run in verifications)
    hours = sum(run.scenario.duration for run in verifications) * scale / HOUR
    at_rated = sum(x.integral(1.0 * (x.integrated[power] >= RATED * rated)) for x in verifications)
    parts = uncertainty(verifications)
    complete = parts and None not in parts.values()
    return YearEntry(
        energy_kWh=energy / KILOWATT_HOUR,
        net_energy_kWh=share * energy / KILOWATT_HOUR,
        uncertainty=float(np.linalg.norm([*parts.values()])) if complete else None,
        uncertainty_by=parts,
        kept=share,
        rated_power_W=rated,
        capacity_factor=share * energy / (YEAR * rated),
        operation_h=hours,
        standstill_h=max(YEAR / HOUR - hours, 0.0),
        rated_h=round(at_rated * scale / HOUR, 6),
        limits_h={name: hours * limit["share_of_time"] for name, limit in limits.items()},
    )


def uncertainty(verifications: Sequence[Verification]) -> dict[str, float | None]:
    """Return the relative standard uncertainties of the energy of a year, by their cause.

    The uncertainty of the speed of the flow counts by the slope of the power curve, v dP/dv =
    3 P + v³ d(P/v³)/d(ln v), between speeds that are apart by the uncertainty to both sides, and by
    the hours that cross the cut-in and the cut-out speed, with the power there. The length of a
    record counts by the scatter of the energy over parts of it.

    Parameters
    ----------
    verifications : sequence of Verification
        Of a resource, one for each direction of the flow in which the rotor works.

    Returns
    -------
    dict of str to float or None
        ``speed`` and ``record``, where they count; None: not known, of a short record.
    """
    resource, parts, total, slope = verifications[0].scenario.resource, {}, 0.0, 0.0
    reach, by_bin = max(resource.speed_uncertainty, NARROW), {}
    for scenario, series in ((run.scenario, run.integrated) for run in verifications):
        bins, speed, power = scenario.bins, series["inflow_speed"], series["electrical_power"]
        log_speed, energy = np.log(speed), scenario.node_weights * power
        ends = np.clip((log_speed + reach, log_speed - reach), log_speed[0], log_speed[-1])
        change = np.subtract(*np.interp(ends, log_speed, power / speed**3))
        change = change / np.maximum(np.subtract(*ends), NARROW)
        total += float(np.sum(energy))
        slope += float(np.sum(3.0 * energy + scenario.node_weights * speed**3 * change))
        way = -1.0 if scenario.backwards else resource.forward
        ends, lost = speed[[0, -1]], power[[0, -1]] * scenario.mesh.duration * [-1.0, 1.0]
        near = np.maximum(reach, resource.bin_width / ends)  # shares are known by bins
        slower, at, faster = (bins.below(ends * np.exp(x)) for x in (-near, 0.0, near))
        beyond = at[0] > slower[0], faster[1] > at[1]  # else no hours cross the first, the last
        slope -= float(np.sum(beyond * lost * (faster - slower) / (2.0 * near)))
        by_bin[way] = np.bincount(bins.place, energy, bins.mean.size)
    if resource.speed_uncertainty and total:
        parts["speed"] = resource.speed_uncertainty * abs(slope / total)
    return parts | resource.scatter(by_bin)


def bins_error(verifications: Sequence[Verification]) -> float | None:
    """Return the relative error of the captured energy by the bins of steady scenarios.

    The bins' energies, each at a mean speed, against the energy at all speeds of the flow, by the
    curve of P/v³ through the equilibria.

    Parameters
    ----------
    verifications : sequence of Verification
        Of all scenarios.

    Returns
    -------
    float or None
        None where the speeds are not known more finely than the bins.
    """
    binned, exact = 0.0, 0.0
    for verification in verifications:
        scenario = verification.scenario
        if scenario.steady and scenario.bins.finer is not None:
            at, power = (verification.integrated[x] for x in ("inflow_speed", "hydrodynamic_power"))
            speed, share = scenario.bins.finer
            inside = (speed >= at[0]) & (speed <= at[-1])
            powers = PchipInterpolator(at, power / at**3)(speed[inside]) * speed[inside] ** 3
            exact += scenario.weight * scenario.mesh.duration * float(share[inside] @ powers)
            binned += scenario.weight * verification.integral(power)
    return binned / exact - 1.0 if exact > 0.0 else None
