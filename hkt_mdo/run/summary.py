"""The files of a finished run: the summary, the tables and the blade."""

import platform
from collections.abc import Sequence
from importlib import metadata
from itertools import product
from operator import attrgetter, itemgetter
from pathlib import Path

import numpy as np

from hkt_mdo.dynamics.limits import CavitationLimit, DesignBounds
from hkt_mdo.dynamics.resource import Resource
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO
from hkt_mdo.files.blade import write_blade_csv
from hkt_mdo.files.yaml_text import dump
from hkt_mdo.problem.point import START_EXCESS
from hkt_mdo.quantities import OVER_TIME, QUANTITIES, column_of
from hkt_mdo.results.folder import to_json, write_csv
from hkt_mdo.results.solution import TABLES
from hkt_mdo.results.summary import VERSION, Summary
from hkt_mdo.rotor.strength import place_weights
from hkt_mdo.run import loads, verification
from hkt_mdo.run import year as a_year
from hkt_mdo.run.checks import RESOLVED, Checked, design_bounds, energy_bound
from hkt_mdo.run.findings import Stations
from hkt_mdo.run.memory import stability, stability_of
from hkt_mdo.run.shadow_prices import shadow_prices

LEAST_WEIGHT = 1e-30
"""Of a load case, for a mean where all scenarios are load cases."""

MOST_ROWS = 50_000
"""Rows of the independent integration's table, but for extremes; it has 20 a segment."""

ENERGIES = {
    "energy": "simulated_energy_J",
    "generator_energy": "generator_energy_J",
    "electrical_energy": "electrical_energy_J",
    "kinetic_energy_change": "stored_energy_J",
}
"""Key in the summary of each energy of a `Simulation`."""
PULSES = (
    "an open loop whose wake has memory would pulse the rotor, which captures more by this model: "
    "its tip speed ratio is held to that of the start over its wake's within 0.2 %, and "
    "a finer mesh is not asked for (docs/studies/memory.md)"
)
PACKAGES = "hkt_mdo openmdao dymos numpy scipy numba casadi wisdem pyoptsparse".split()


def summarize(finished: Checked, message: str = "", start_breaks: Sequence[str] = ()) -> Summary:
    """Return the summary of a finished run.

    Parameters
    ----------
    finished
        The end of the run, or what its folder holds in place of it.
    message
        Why it failed.
    start_breaks
        Names of the limits that the start exceeds, on the mesh that it was found on.
    """
    physics, result, start = finished.physics, finished.result, finished.start
    design, blade, outcome = _design(finished), result.point.blade, result.outcome
    ratios = design["tip_speed_ratio"]
    working = max(float(ratios["min"]), SLOWEST_RATIO), float(ratios["max"])
    rows = list(Stations(physics, blade, working).messages("found blade"))
    warned, noted = ([x.text for x in rows if x.severity == kind] for kind in ("warning", "note"))
    scenarios = {name: _scenario(finished, runs) for name, runs in finished.scenarios.items()}
    if len(scenarios) > 1 and physics.objective.is_rate:
        _decide(physics, scenarios)
    packages = {name: [*metadata.distributions(name=name)] for name in PACKAGES}
    memory = stability_of(result) if physics.remembers else stability(finished.verifications)
    values = {
        **vars(outcome),
        "version": VERSION,
        "case": physics.case.name,
        "success": finished.passed,
        "message": message or "converged and verified",
        **_energies(finished),
        **design,
        **_extremes(finished, scenarios),
        "memory": memory and memory.model_dump(),
        "at_bounds": list(_at_bounds(finished)),
        "scenarios": scenarios,
        "branches": [*_branches(start)],
        "starts": [vars(record) for record in start.starts],
        "start_breaks": list(start_breaks),
        "surrogate_error": finished.check("surrogate_error"),
        "bins_error": a_year.bins_error(finished.verifications),
        "max_speed_error": max(np.max(run.speed_errors) for run in finished.verifications),
        "checks": [vars(check) for check in finished.checks],
        "notes": [*physics.messages, *start.messages, *noted, *_notes(finished)],
        "doubts": [*physics.warnings, *physics.law.held(start.gains), *warned],
        "versions": {"python": platform.python_version()}
        | {name: installed[0].version for name, installed in packages.items() if installed},
    }
    return Summary.parse(to_json(values))


def _branches(start):
    """Yield the branches of the search for a result's start, that of the result first."""
    sides = [record for record in start.starts if record.side]
    for record in sorted(sides, key=lambda x: x.side != start.branch):
        flags = {"taken": record.side == start.branch, "kept": record.excess <= START_EXCESS}
        yield {"name": record.side, "objective_J": record.objective} | flags


def _energies(finished):
    """Return the energies of a result, the weighted sums of those of its scenarios, and bounds."""
    physics, verifications = finished.physics, finished.verifications
    taken = "generator_energy", "friction_energy", "kinetic_energy_change"
    names, turning = {*ENERGIES, *taken}, _turning(verifications)
    sums = {x: finished.total(attrgetter(f"simulation.{x}")) for x in names}
    simulated = {key: sums[name] if turning else None for name, key in ENERGIES.items()}
    energy, used = sums["energy"], sum(sums[name] for name in taken)
    bound, over = energy_bound(physics, finished.optimum), finished.check("energy_over_certificate")
    open_ended = physics.objective.closes and physics.case.ends_free
    return {
        "energy_J": finished.result.energy,
        **simulated,
        "energy_bound_J": bound,
        # relative difference of the certificate and the simulated energy
        "certified_gap": None if over is None or not turning else -over,
        "objective": {
            "kind": physics.objective.kind,
            "unit": physics.objective.unit or "",
            "value": finished.result.objective,
            "simulated": finished.objective,
            "price": physics.price_of(finished.result.point.blade) or None,
            "bound": None if open_ended else physics.objective_bound(bound),
            "measure": physics.case.robustness.measure if len(finished.scenarios) > 1 else None,
        },
        "starting_energy_J": finished.start.operation.energy,
        "energy_balance_error": abs(energy - used) / max(energy, 1e-9),
    }


def _design(finished):
    """Return gains and largest torque, the rotor's best operation, and its blade and the case's."""
    physics, blade = finished.physics, finished.result.point.blade
    gains, verifications = finished.result.point.gains.tolist(), finished.verifications
    peak, shape = physics.rotor.best_operation(blade), physics.shape
    set_angle = None if shape.designs_chord else physics.case.rotor.set_angle or 0.0
    if shape.designs_set_angle:
        set_angle = np.rad2deg(shape.control(blade)["twist"][0])
    return {
        "gain": None if not gains else gains[0] if len(gains) == 1 else gains,
        "gain_units": list(physics.law.gain_units),
        "tip_speed_ratio": _ratios(verifications),
        "power_coefficient_max": peak.power_coefficient,
        "tip_speed_ratio_at_power_coefficient_max": peak.tip_speed_ratio,
        "control_torque_max_Nm": max(np.max(x.simulated["control_torque"]) for x in verifications),
        "rotor_radius_m": blade.rotor_radius,
        "tip_radius_m": blade.tip_radius,
        "set_angle_deg": set_angle,
        "inertia_kg_m2": finished.result.inertia,
        "hub_inertia_kg_m2": blade.hub_inertia,
        "water_inertia_kg_m2": [*physics.rotor.water_inertias(blade).values()],
        "mass_kg": finished.result.mass,
        "r_m": blade.r,
        "chord_m": blade.chord,
        "twist_deg": np.rad2deg(blade.twist),
        "thickness_over_chord": blade.thickness,
        "start_chord_m": physics.blade.chord,
        "start_twist_deg": np.rad2deg(physics.blade.twist),
    }


def _at_bounds(finished):
    """Yield design variables that end at a bound of the case, and where along the blade."""
    blade = finished.result.point.blade
    for limit, unit, scale in design_bounds(finished.physics):
        value = limit.value_of(finished.quantities)
        for end in ("lower", "upper"):
            bound, size = getattr(limit, end), np.max(np.abs(value))
            at = np.isclose(value, bound, loads.BINDING, 0.1 * loads.BINDING * size)
            if np.any(at):
                spans = np.flatnonzero(np.diff(at, prepend=False, append=False)).reshape(-1, 2)
                along = limit.place == "span"
                ratio = (blade.r / blade.tip_radius)[spans - [0, 1]] if along else []
                where = {"unit": unit, "r_over_R": ratio}
                yield {"name": limit.name, "end": end, "bound": scale * bound} | where


def _extremes(finished, scenarios):
    """Return limits, loads and standstill of the result: the largest of all scenarios."""
    physics, largest, limits = finished.physics, {}, {}
    for name, scenario in scenarios.items():
        for load, entry in scenario["loads"].items():
            if load not in largest or entry["value"] > largest[load]["value"]:
                largest[load] = entry | ({"scenario": name} if len(scenarios) > 1 else {})
    for limit in physics.design_limits:
        if not isinstance(limit, DesignBounds) and np.isfinite(limit.end):
            entry = loads.of_limit(limit, finished.quantities)
            limits[limit.name] = entry.model_dump(exclude_unset=True)
    over_time = _over_time(finished.verifications, with_scenario=len(scenarios) > 1)
    prices = shadow_prices(finished)
    limits |= {name: x | {"shadow_price": prices.get(name)} for name, x in over_time.items()}
    (first, *others) = scenarios.values()
    blade = finished.result.point.blade
    pairs = [(run.rotor, run.simulated) for run in finished.verifications]
    return {
        "operation": None if others else first["operation"],
        "limits": limits,
        "loads": largest,
        "tip_deflection_m": loads.tip_deflection(blade, pairs),
        "weight_stress_Pa": finished.quantities["weight_stress"] or None,
        "weight_moment_Nm": physics.rotor.weight_moment(blade),
    }


def _scenario(finished, verifications):
    """Return the results of one scenario, by the keys of `ScenarioEntry`."""
    scenario, objective = verifications[0].scenario, finished.physics.start_objective
    simulations, duration = [run.simulation for run in verifications], scenario.mesh.duration
    sums, power = dict.fromkeys(ENERGIES.values()), None
    if _turning(verifications):
        sums = {key: sum(getattr(x, name) for x in simulations) for name, key in ENERGIES.items()}
        power = sum(run.objective(objective) for run in verifications) / duration
    speeds = [simulation.inflow_speed for simulation in simulations]
    limits = _over_time(verifications)
    pairs = [(run.rotor, run.simulated) for run in verifications]
    largest = loads.placed(finished.result.point.blade, pairs)
    if load := largest.get("cavitation"):
        most, series = CavitationLimit().margin, (run.simulated for run in verifications)
        share = _mean(verifications, [1.0 * (x["cavitation"] > most) for x in series])
        largest["cavitation"] = load.model_copy(update={"share_of_time": share})
    nodes = [(run.scenario.node_weights, run.trajectory) for run in verifications]
    has_year = isinstance(getattr(scenario, "resource", None), Resource)
    return {
        "share": finished.physics.shares[scenario.group],
        "weight": scenario.weight,
        "duration_s": duration,
        "energy_J": sum(weights @ x["hydrodynamic_power"] for weights, x in nodes),
        **sums,
        "mean_power_W": power,
        "ceiling_W": finished.physics.ceilings.get(scenario.group),
        "inflow_speed": _span(speeds, _mean(verifications, speeds)),
        "tip_speed_ratio": _ratios(verifications),
        "operation": _operation(finished, verifications, power),
        "limits": limits,
        "loads": {name: x.model_dump(exclude_unset=True) for name, x in largest.items()},
        "steady": scenario.steady,
        "year": a_year.entry(verifications, limits).model_dump() if has_year else None,
    }


def _decide(physics, scenarios):
    """Set in each scenario whether it decides the measure of the objective."""
    powers = [scenarios[name]["mean_power_W"] for name in physics.shares]
    if None not in powers:
        shares = np.array(list(physics.shares.values()))
        decides = physics.case.robustness.binding(physics.rate_factors * np.array(powers), shares)
        for name, decisive in zip(physics.shares, decides, strict=True):
            scenarios[name]["decides"] = decisive


def _turning(verifications):
    return all(run.simulation.stopped_at is None for run in verifications)


def _mean(verifications, values):
    """Return the mean over time of values along each integration, by the scenarios' weights."""
    sums = np.zeros(2)
    for run, series in zip(verifications, values, strict=True):
        weight = max(run.scenario.weight, LEAST_WEIGHT)
        sums += weight * np.array([run.integral(series), run.integral(np.ones(series.size))])
    return sums[0] / sums[1]


def _ratios(verifications):
    """Return the range of the tip speed ratio at the nodes, and its mean over time."""
    simulated = [run.simulated["tip_speed_ratio"] for run in verifications]
    nodes = [run.trajectory["tip_speed_ratio"] for run in verifications]
    return _span(nodes, _mean(verifications, simulated))


def _span(parts, mean):
    return {"min": min(map(np.min, parts)), "max": max(map(np.max, parts)), "mean": mean}


def _operation(finished, verifications, power):
    """Return the intervals of operation; None where a machine never stands still."""
    spans = np.array([run.scenario.edges[[0, -1]] for run in verifications])
    still = verifications[0].scenario.mesh.duration - float(np.sum(np.diff(spans)))
    steady = verifications[0].scenario.steady
    if finished.physics.case.control.cut_out is None or still <= 0.0 or steady:
        return None
    speeds = np.array([run.trajectory["rotor_speed"][0] for run in verifications])
    return {
        "intervals_s": spans,
        "standstill_s": still,
        "mean_power_W": power,
        "run_up_J": 0.5 * finished.result.inertia * np.sum(speeds[spans[:, 0] > 0.0] ** 2),
    }


def _notes(finished):
    """Yield notes on the stations that loads need, and on the operation."""
    physics, verifications = finished.physics, finished.verifications
    if all(run.resolved for run in verifications):

        def most(attribute, name):
            return max(np.max(getattr(run, attribute)[name]) for run in verifications)

        changes = {x: most("resolved", x) / most("simulated", x) - 1.0 for x in physics.load_names}
        if max(map(abs, changes.values())) > RESOLVED:
            text = ", ".join(f"{name} {100.0 * change:+.1f} %" for name, change in changes.items())
            yield (
                f"loads are held on {physics.blade.r.size} stations; the same blade with "
                f"{loads.STATIONS} stations has {text}: give rotor.station_count: 40"
            )
    if stiffness := max(getattr(run.controller, "stiffness", 0.0) for run in verifications):
        yield (
            "the rotor turns below the speed of its largest torque, where a torque over time does "
            f"not hold its speed: the integration adds {stiffness:.3g} N m s/rad times the "
            "difference from the speed that was found"
        )
    start, _ = verification.start_against_friction(verifications[0].plant, physics.scenarios)
    if start:
        yield start
    if physics.may_pulse:
        yield PULSES


def _over_time(verifications, with_scenario=False):
    """Return the entries of limits over time by their names, with their scenario on request."""
    limits = [limit for run in verifications for limit in run.scenario.limits]
    names = dict.fromkeys(limit.name for limit in limits if np.isfinite(limit.end))
    return {name: _limit(name, verifications, with_scenario) for name in names}


def _limit(name, verifications, with_scenario):
    """Return the worst value of a limit over time, at the nodes and in the integration.

    With its time and the share of the whole time in which it binds, which it does not in scenarios
    that do not have it.
    """
    rows, binding = [], []
    for run in verifications:
        limits = [limit for limit in run.scenario.limits if limit.name == name]
        where = {"scenario": run.scenario.group} if with_scenario else {}
        pairs = product(limits, (run.simulated, run.at_nodes))
        rows += [(np.max(x.share(series)), loads.of_limit(x, series), where) for x, series in pairs]
        binds = [x.share(run.simulated) >= loads.binds_from(x) for x in limits]
        binding.append(np.any(binds, axis=0) * np.ones(run.simulated["rotor_speed"].size))
    _, entry, where = max(rows, key=itemgetter(0))
    share = round(_mean(verifications, binding), 9)
    return entry.model_dump(exclude_unset=True) | where | {"share_of_time": share}


def write_tables(out: Path, finished: Checked) -> None:
    """Write the trajectories, the integrations, the loads, the blade and its power curve as CSV.

    Parameters
    ----------
    out : Path
        The result folder.
    finished : Checked
        The end of the run. Of several scenarios, each has tables with its name.
    """
    physics, blade = finished.physics, finished.result.point.blade
    headers, states = {x: QUANTITIES[x].column for x in OVER_TIME}, physics.law.states.items()
    headers |= {name: column_of(name, unit) for name, (unit, _) in states}
    for scenario, verifications in finished.scenarios.items():
        suffix = f"_{scenario}" if len(finished.scenarios) > 1 else ""
        for name, attribute in (("trajectory", "at_nodes"), ("simulation", "simulated")):
            parts = [getattr(run, attribute) for run in verifications]
            table = {
                column: np.concatenate([part[quantity] for part in parts])
                for quantity, column in headers.items()
                if quantity in parts[0]
            }
            if name == "simulation":  # open loop repeats the trajectory, at every node
                shown = _shown(np.column_stack([*table.values()]))
                table = {column: values[shown] for column, values in table.items()}
            write_csv(out / f"{name}{suffix}.csv", table)
        span = loads.over_span(blade, [(run.rotor, run.simulated) for run in verifications])
        _write_loads(out / f"loads{suffix}.csv", blade, span)
        if verifications[0].scenario.steady:
            write_csv(out / f"year{suffix}.csv", a_year.table(verifications))
    _write_blade(out / "blade.csv", physics, blade)
    working = [run.simulated["tip_speed_ratio"] for run in finished.verifications]
    best = physics.rotor.best_operation(blade).tip_speed_ratio
    low = min(0.3 * best, 0.95 * min(map(np.min, working)))
    high = max(1.7 * best, 1.05 * max(map(np.max, working)))
    ratios = np.linspace(max(low, 0.05 * best), min(high, 5.0 * best), 141)
    curves = [physics.rotor.coefficients(design, ratios) for design in (blade, physics.blade)]
    columns = ratios, *(x.power for x in curves), *(x.thrust for x in curves)
    write_csv(out / "coefficients.csv", dict(zip(TABLES["coefficients"], columns, strict=True)))


def _shown(rows):
    """Return places of the rows of a long table, at equal steps and at each column's extremes."""
    step = -(-len(rows) // MOST_ROWS)
    values = np.nan_to_num(rows)
    ends = np.argmin(values, axis=0), np.argmax(values, axis=0), [0, len(rows) - 1]
    return np.union1d(np.arange(0, len(rows), step), np.concatenate(ends))


def _write_loads(path, blade, curves):
    """Write the loads along the blade; values at stations only are linear between them."""
    units = {"stress": "stress_Pa", "flapwise_moment": "flapwise_moment_Nm"}
    places = place_weights(blade.r.size) @ blade.r
    table = {"r_m": places, "r_over_R": places / blade.tip_radius}
    for name, (r, values) in curves.items():
        table[units.get(name, name)] = np.interp(places, r, values)
    write_csv(path, table)


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
    case_rotor = physics.case.rotor.model_dump(mode="json")
    for key in ("polar", "outline", "sections", "reynolds_number"):
        rotor |= {key: case_rotor[key]} if case_rotor[key] else {}
    section = dump(rotor, width=float("inf"), default_flow_style=True).strip()
    remarks = (
        f"blade found by the case {physics.case.name}; the twist includes the set angle",
        f"to start from it, with the path of this file: rotor: {section}",
    )
    write_blade_csv(path, blade, physics.rotor.thickness_of(blade), remarks)
