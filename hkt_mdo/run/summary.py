"""What a finished run leaves in its folder: the summary, the tables and the blade."""

import platform
from importlib import metadata
from itertools import groupby
from types import MappingProxyType

import numpy as np
import yaml
from scipy.integrate import trapezoid

from hkt_mdo.dynamics.limits import DesignBounds
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO
from hkt_mdo.dynamics.trajectory import COLUMNS, LOADS
from hkt_mdo.files.blade import write_blade_csv
from hkt_mdo.files.blade_table import BladeTable
from hkt_mdo.files.yaml_text import Dumper
from hkt_mdo.results.folder import to_json, write_csv
from hkt_mdo.results.summary import Summary
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.rotor.strength import place_weights
from hkt_mdo.run import loads
from hkt_mdo.run.findings import Stations
from hkt_mdo.run.flight import total
from hkt_mdo.run.judge import energy_bound, explain_all

# relative distance from its bound within which a limit counts as binding; that of a load, of whose
# values along the blade the optimization has a smooth largest that is up to as much above them
BINDING, ENVELOPE = 1e-3, 1e-2

PACKAGES = "hkt_mdo openmdao dymos numpy scipy numba casadi wisdem pyoptsparse".split()


def summarize(
    physics,
    optimum,
    start,
    start_breaks,
    result,
    flights,
    checks,
    remedy="",
    worths=MappingProxyType({}),
) -> Summary:
    """Return the summary of a finished run; `remedy`: what to try if the optimizer failed.

    `start_breaks` names the limits that the start exceeds, on the mesh that it was found on;
    `worths` are those of `hkt_mdo.run.worth`.
    """
    failed = [check for check in checks if not check.passed]
    blade = result.point.blade
    ratios, torques = (
        np.concatenate([each[name] for each in result.trajectories])
        for name in ("tip_speed_ratio", "control_torque")
    )
    working = max(float(np.min(ratios)), SLOWEST_RATIO), float(np.max(ratios))
    met = Stations.of(blade, physics.built(blade), working).messages("found blade")
    peak, bound = best_operation(blade, physics.polar), energy_bound(physics, optimum)
    by_name = {check.name: check.value for check in checks}
    gains = [float(gain) for gain in result.point.gains]
    turning = all(flight.simulation.stopped_at is None for flight in flights)
    energy, generated, electrical, stored = (
        total(flights, lambda flight, name=name: getattr(flight.simulation, name))
        for name in (
            *("energy", "generator_energy", "electrical_energy"),
            "kinetic_energy_change",
        )
    )
    objective = total(flights, lambda flight: flight.objective(physics.objective))
    flown = [flight.told for flight in flights]
    values = {
        "case": physics.case.name,
        "success": not failed,
        "message": explain_all(checks, remedy) or "converged and verified",
        "package": result.outcome.package,
        "optimizer": result.outcome.optimizer,
        "iterations": result.outcome.iterations,
        "energy_J": result.energy,
        "simulated_energy_J": energy if turning else None,
        "generator_energy_J": generated if turning else None,
        "electrical_energy_J": electrical if turning else None,
        "energy_bound_J": bound,
        "certified_gap": _gap(by_name.get("energy_over_certificate"), turning),
        "objective": {
            "kind": physics.objective.kind,
            "value_J": result.objective,
            "simulated_J": objective,
            "bound_J": None
            if physics.objective.closes and physics.case.phase.final_speed != "initial"
            else physics.objective_bound(bound),
        },
        "operation": _operation(physics, flights, result.inertia, objective if turning else None),
        "limits": {
            limit.name: _limit(limit, flights, worths)
            for limit in physics.limits
            if not isinstance(limit, DesignBounds) and np.isfinite(limit.upper)
        },
        "loads": _loads(physics, blade, flown),
        "tip_deflection_m": loads.tip_deflection(physics, blade, flown),
        "branches": [
            {
                "name": each.branch,
                "objective_J": each.objective,
                "taken": each is start.branches[0],
                "kept": each.worth[0],
            }
            for each in start.branches
        ],
        "starts": [vars(record) for record in start.starts],
        "bound_power_coefficient": optimum.power_coefficient,
        "bound_tip_speed_ratio": optimum.tip_speed_ratio,
        "gain": None if not gains else gains[0] if len(gains) == 1 else gains,
        "gain_units": list(physics.gain_units),
        "tip_speed_ratio": {"min": np.min(ratios), "max": np.max(ratios), "mean": np.mean(ratios)},
        "power_coefficient_max": peak.power_coefficient,
        "tip_speed_ratio_at_power_coefficient_max": peak.tip_speed_ratio,
        "control_torque_max_Nm": np.max(torques),
        "rotor_radius_m": blade.rotor_radius,
        "tip_radius_m": blade.tip_radius,
        "set_angle_deg": _set_angle(physics, blade),
        "inertia_kg_m2": result.inertia,
        "mass_kg": result.mass,
        "r_m": blade.r,
        "chord_m": blade.chord,
        "twist_deg": np.rad2deg(blade.twist),
        "thickness_over_chord": blade.thickness,
        "start_chord_m": physics.blade.chord,
        "start_twist_deg": np.rad2deg(physics.blade.twist),
        "starting_energy_J": start.operation.energy,
        "start_breaks": list(start_breaks),
        "surrogate_error": by_name["surrogate_error"],
        "surrogate_nodes": int(result.curve.size),
        "max_speed_error": max(np.max(flight.speed_errors) for flight in flights),
        "energy_balance_error": abs(energy - generated - stored) / max(energy, 1e-9),
        "checks": [vars(check) for check in checks],
        "notes": [
            *physics.messages,
            *physics.warnings,
            *start.messages,
            *(text for _, text in met),
            *_outside_table(physics.generator, flights),
            *_unstable(flights),
        ],
        "versions": _versions(),
    }
    return Summary.parse(to_json(values))


def _operation(physics, flights, inertia, objective):
    """Return the intervals of operation; None where a machine never stands still."""
    duration = physics.case.phase.duration
    spans = np.array([each.scenario.edges[[0, -1]] for each in flights])
    still = duration - float(np.sum(np.diff(spans)))
    if physics.case.control.cut_out is None or still <= 0.0:
        return None
    speeds = np.array([each.trajectory["rotor_speed"][0] for each in flights])
    return {
        "intervals_s": spans,
        "standstill_s": still,
        "mean_power_W": None if objective is None else objective / duration,
        "run_up_J": 0.5 * inertia * np.sum(speeds[spans[:, 0] > 0.0] ** 2),
    }


def _outside_table(generator, flights):
    """Yield by how much a trajectory leaves the generator's table."""
    worst = max(
        generator.beyond_table(each.trajectory["control_torque"], each.trajectory["rotor_speed"])
        for each in flights
    )
    if worst > 1e-6:
        yield (
            f"torque or speed leaves generator.table by up to {100.0 * worst:.2g} % of its range, "
            "where its efficiency is continued: extend the table"
        )


def _unstable(flights):
    """Yield that an open loop needs a controller of its speed, where it does."""
    stiffness = max((each.recorded.stiffness for each in flights if each.recorded), default=0.0)
    if stiffness:
        yield (
            "the rotor works below the speed of its largest torque, where a torque over time does "
            f"not hold its speed: the integration adds {stiffness:.3g} N m s/rad times the "
            "difference from the speed that was found"
        )


def _gap(over, turning):
    """Return what the simulated energy lacks of the certificate, over the certificate, or None."""
    return None if over is None or not turning else -over


def _limit(limit, flights, worths):
    """Return the largest value of a limit, at the nodes and in the integration, and its bound."""
    flown = [limit.told(flight.flown) for flight in flights]
    at_nodes = [limit.told(flight.at_nodes) for flight in flights]
    value, bound = float(max(map(np.max, flown + at_nodes))), float(limit.upper)
    least = bound - (ENVELOPE if limit.name in LOADS else BINDING) * abs(bound)
    binding = value >= least
    entry = {"value": value, "limit": bound, "unit": limit.unit or "", "binding": binding}
    if limit.place != "time":
        return entry
    times = [flight.flown["time"] for flight in flights]
    worst = max(range(len(flights)), key=lambda i: np.max(flown[i]))
    weights = np.array([each.scenario.weight for each in flights])
    spans = np.array([time[-1] - time[0] for time in times])
    binds = np.array(
        [
            trapezoid(np.where(along >= least, 1.0, 0.0), time)
            for along, time in zip(flown, times, strict=True)
        ]
    )
    return entry | {
        "time_s": times[worst][np.argmax(flown[worst])],
        "share_of_time": weights @ binds / (weights @ spans),
        "worth": worths.get(limit.name),
    }


def _loads(physics, blade, flown):
    """Return the largest loads along the integrations, when and where along the blade."""
    found = {name: entry.model_dump() for name, entry in loads.largest(flown).items()}
    for name, (r, values) in loads.over_span(physics, blade, flown).items():
        if name in found:
            found[name]["r_m"] = r[np.argmax(values)]
    return found


def _set_angle(physics, blade):
    """Return the set angle, deg: as found or as given; None where a designed twist contains it."""
    shape = physics.shape
    if shape.designs_set_angle:
        return float(np.rad2deg(shape.control(blade)[1][0]))
    return None if shape.designs_chord else physics.case.rotor.set_angle or 0.0


def _versions():
    """Return the versions of Python and of the installed packages."""
    versions = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


def write_tables(out, physics, result, flights):
    """Write the trajectories, the integrations, the loads, the blade and its power curve as CSV."""
    for _, group in groupby(flights, key=lambda flight: id(flight.scenario.inflow)):
        several = list(group)  # intervals of one flow have one table, without the time between them
        suffix = "" if several[0] is flights[0] else f"_{several[0].scenario.name}"
        for name, values in (
            ("trajectory", [x.trajectory | x.loads_at_nodes | x.rates_at_nodes for x in several]),
            ("simulation", [flight.told for flight in several]),
        ):
            table = {
                column: np.concatenate([each[name] for each in values])
                for name, column in COLUMNS.items()
                if name in values[0]
            }
            write_csv(out / f"{name}{suffix}.csv", table, zip(*table.values(), strict=True))
    blade = result.point.blade
    flown = [flight.told for flight in flights]
    _write_loads(out / "loads.csv", blade, loads.over_span(physics, blade, flown))
    _write_blade(out / "blade.csv", physics, blade)
    ratios = np.linspace(0.3, 1.7, 141) * best_operation(blade, physics.polar).tip_speed_ratio
    power = [
        bem.rotor_coefficients(each, physics.polar, ratios).power for each in (blade, physics.blade)
    ]
    header = ("tip_speed_ratio", "power_coefficient", "start_power_coefficient")
    write_csv(out / "power_curve.csv", header, zip(ratios, *power, strict=True))


def _write_loads(path, blade, found):
    """Write the loads along the blade; what is known at the stations only, linear between them."""
    units = {"stress": "stress_Pa", "flapwise_moment": "flapwise_moment_Nm"}
    places = place_weights(blade.r.size) @ blade.r
    table = {"r_m": places, "r_over_R": places / blade.tip_radius}
    for name, (r, values) in found.items():
        table[units.get(name, name)] = np.interp(places, r, values)
    write_csv(path, table, zip(*table.values(), strict=True))


def _write_blade(path, physics, blade):
    """Write the blade of the result as a file that another case can start from."""
    rotor = {
        "blade": "blade.csv",
        "radius": blade.tip_radius,
        "hub_radius_fraction": blade.hub_radius / blade.tip_radius,
        "blade_count": blade.blade_count,
        "cone": float(np.rad2deg(blade.cone)),
        "set_angle": 0.0,
        "stations": None,
    }
    given = physics.case.rotor.model_dump(mode="json")
    for key in ("polar", "outline", "sections", "reynolds_number"):
        rotor |= {key: given[key]} if given[key] else {}
    section = yaml.dump(
        rotor, Dumper=Dumper, sort_keys=False, default_flow_style=True, width=float("inf")
    ).strip()
    remarks = (
        f"blade found by the case {physics.case.name}; the twist includes the set angle",
        f"to start from it, with the path of this file: rotor: {section}",
    )
    thickness = physics.thickness if blade.thickness is None else blade.thickness
    thickness = np.broadcast_to(np.asarray(thickness, dtype=float), blade.r.shape)
    table = BladeTable(blade.r, blade.chord, blade.twist, thickness=thickness)
    write_blade_csv(path, table, remarks)
