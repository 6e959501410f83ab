"""What a finished run leaves in its folder: the summary, the tables and the blade."""

import platform
from importlib import metadata

import numpy as np

from hkt_mdo.dynamics.trajectory import COLUMNS
from hkt_mdo.files.blade import BladeTable, write_blade_csv
from hkt_mdo.results.folder import to_json, write_csv
from hkt_mdo.results.summary import Summary
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.run.judge import energy_bound, explain

PACKAGES = (
    "hkt_mdo",
    "openmdao",
    "dymos",
    "numpy",
    "scipy",
    "numba",
    "casadi",
    "wisdem",
    "pyoptsparse",
)


def _summarize(case, world, optimum, start, result, flown, checks) -> Summary:
    """Return the summary of a finished run."""
    failed = [check for check in checks if not check.passed]
    blade, ratios = result.point.blade, result.trajectory["tip_speed_ratio"]
    peak = best_operation(blade, world.polar)
    by_name = {check.name: check.value for check in checks}
    gains = [float(gain) for gain in result.point.gains]
    turning = flown.stopped_at is None
    unbalanced = flown.energy - flown.generator_energy - flown.kinetic_energy_change
    values = {
        "case": case.name,
        "success": not failed,
        "message": "; ".join(explain(check) for check in failed) or "converged and verified",
        "package": result.outcome.package,
        "optimizer": result.outcome.optimizer,
        "iterations": result.outcome.iterations,
        "energy_J": result.energy,
        "simulated_energy_J": flown.energy if turning else None,
        "generator_energy_J": flown.generator_energy if turning else None,
        "energy_bound_J": energy_bound(case, world, optimum),
        "bound_power_coefficient": optimum.power_coefficient,
        "bound_tip_speed_ratio": optimum.tip_speed_ratio,
        "gain": None if not gains else gains[0] if len(gains) == 1 else gains,
        "gain_units": list(world.law.gain_units) if world.law else [],
        "tip_speed_ratio": {"min": np.min(ratios), "max": np.max(ratios), "mean": np.mean(ratios)},
        "power_coefficient_max": peak.power_coefficient,
        "tip_speed_ratio_at_power_coefficient_max": peak.tip_speed_ratio,
        "control_torque_max_Nm": np.max(result.trajectory["control_torque"]),
        "rotor_radius_m": blade.rotor_radius,
        "tip_radius_m": blade.tip_radius,
        "set_angle_deg": _set_angle(case, world, blade),
        "inertia_kg_m2": result.inertia,
        "mass_kg": result.mass,
        "r_m": blade.r,
        "chord_m": blade.chord,
        "twist_deg": np.rad2deg(blade.twist),
        "start_chord_m": world.blade.chord,
        "start_twist_deg": np.rad2deg(world.blade.twist),
        "starting_energy_J": start.operation.energy,
        "surrogate_error": by_name["surrogate_error"],
        "surrogate_nodes": int(result.curve.size),
        "max_speed_error": by_name["max_speed_error"],
        "energy_balance_error": abs(unbalanced) / max(flown.energy, 1e-9),
        "checks": [vars(check) for check in checks],
        "notes": list(world.messages),
        "versions": _versions(),
    }
    return Summary.parse(to_json(values))


def _set_angle(case, world, blade):
    """Return the set angle, deg: as found or as given; None where a designed twist contains it."""
    if world.shape.designs_set_angle:
        return float(np.rad2deg(world.shape.control(blade)[1][0]))
    return None if world.shape.designs_chord else case.rotor.set_angle or 0.0


def _versions():
    """Return the versions of Python and of the installed packages."""
    versions = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


def _write_tables(out, case, world, result, flown):
    """Write the trajectory, the simulation, the blade and the power curves as CSV files."""
    blade = result.point.blade
    trajectory = (result.trajectory[name] for name in COLUMNS)
    write_csv(out / "trajectory.csv", COLUMNS.values(), zip(*trajectory, strict=True))
    speed, flow = flown.rotor_speed, flown.inflow_speed
    simulation = {
        "time": flown.time,
        "inflow_speed": flow,
        "rotor_speed": speed,
        "tip_speed_ratio": speed * blade.rotor_radius / flow,
        "hydrodynamic_torque": flown.hydrodynamic_torque,
        "control_torque": flown.control_torque,
        "hydrodynamic_power": flown.hydrodynamic_torque * speed,
        "generator_power": flown.control_torque * speed,
    }
    rows = zip(*(simulation[name] for name in COLUMNS), strict=True)
    write_csv(out / "simulation.csv", COLUMNS.values(), rows)
    _write_blade(out / "blade.csv", case, world, blade)
    ratios = np.linspace(0.3, 1.7, 141) * best_operation(blade, world.polar).tip_speed_ratio
    power = [
        bem.rotor_coefficients(each, world.polar, ratios).power for each in (blade, world.blade)
    ]
    header = ("tip_speed_ratio", "power_coefficient", "start_power_coefficient")
    write_csv(out / "power_curve.csv", header, zip(ratios, *power, strict=True))


def _write_blade(path, case, world, blade):
    """Write the blade of the result as a file that another case can start from."""
    rotor = {
        "blade": "blade.csv",
        "radius": blade.tip_radius,
        "hub_radius_fraction": blade.hub_radius / blade.tip_radius,
        "blade_count": blade.blade_count,
        "cone": float(np.rad2deg(blade.cone)),
        "set_angle": 0.0,
        "stations": "null",
    }
    section = ", ".join(f"{key}: {value}" for key, value in rotor.items())
    remarks = (
        f"blade found by the case {case.name}; the twist includes the set angle",
        f"to start from it, with the path of this file: rotor: {{{section}}}",
    )
    thickness = np.broadcast_to(np.asarray(world.thickness, dtype=float), blade.r.shape)
    table = BladeTable(blade.r, blade.chord, blade.twist, thickness=thickness)
    write_blade_csv(path, table, remarks)
