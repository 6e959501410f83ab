"""The report of `hkt check`: `hkt_mdo.run.findings` as rows, with notes and warnings."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import starmap
from operator import itemgetter
from pathlib import Path

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.dynamics.limits import DesignBounds
from hkt_mdo.dynamics.resource import FARTHEST, Resource
from hkt_mdo.problem.contradictions import implausible
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.point import START_EXCESS
from hkt_mdo.results import words
from hkt_mdo.results.summary import Achieved, bending, bends_far, in_operation, water_inertia
from hkt_mdo.results.words import Row, amounts, joined, measured, number, per_cent, powers
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.run import loads
from hkt_mdo.run.checks import design_bounds, designed, entry, explain, of_flow, of_table
from hkt_mdo.run.findings import Findings, Flow, evaluated_problem
from hkt_mdo.run.verification import start_against_friction

FIT = {"chord": 2.0, "twist": 0.5}  # % of the largest, deg: splines may leave the file's blade
# share of the energy that a blade can capture below which a gain is probably a mistake
WASTED = 0.5
REACHED = 0.05  # share of a limit by which a value below it counts as held by it
EDDY = 1.25  # cutoff times diameter over flow speed above which eddies are smaller than the rotor
# share of their size by which the bounds of the design may be exceeded; of the chord by which a
# wall that fills its section may be thinner than half of it
KEPT = 1e-6

Rows = Iterator[Row]


@dataclass(frozen=True, eq=False)
class CheckReport:
    """What a case means.

    Attributes
    ----------
    tables : dict of list of Row
        Quantities, by the title of their table.
    notes : list of Row
        What was converted, repaired or left out of the files.
    warnings : list of Row
        Probable mistakes of a case that can be run.
    findings : Findings
        The quantities behind the rows.
    """

    tables: dict[str, list[Row]]
    notes: list[Row]
    warnings: list[Row]
    findings: Findings


def check_case(case: Case) -> CheckReport:
    """Read and build all that a run of a case needs, and report it; nothing is optimized.

    Parameters
    ----------
    case : Case
        The case.

    Returns
    -------
    CheckReport

    Raises
    ------
    InputError
        If a file of the case is broken, files do not fit each other, or the optimizer that the case
        asks for is not installed.
    """
    findings = Findings(physics(case))
    named = len(findings.flows) > 1
    rows = {
        "Turbine": [*_turbine(findings), *_stations(findings)],
        **{f"Flow{f' of {x.name}' * named}": [*_flow(findings, x, case)] for x in findings.flows},
        "Control": [*_control(findings)],
        "Starting blade": [*_start(findings)],
        "Limits, and values of the starting blade": [*_limits(findings)],
        "Optimization": [*_optimization(findings), *_bounds(findings)],
    }
    every = [row for table in rows.values() for row in table]
    notes = [Row("", text) for text in (*findings.physics.messages, *findings.start.messages)]
    warnings = [Row("", text) for text in findings.physics.warnings]
    return CheckReport(
        {title: [row for row in table if not row.severity] for title, table in rows.items()},
        notes + [row for row in every if row.severity == "note"],
        warnings + [row for row in every if row.severity == "warning"],
        findings,
    )


def _warning(label: str, text: str, severity: str = "warning") -> Row:
    return Row(label, text, severity=severity)


def _turbine(findings: Findings) -> Rows:
    """Yield rotor and blade; warn of a blade that differs from its splines."""
    rotor, blade, file_blade = findings.case.rotor, findings.plant.blade, findings.given
    for name, scale, unit in (
        ("chord", 100.0 / file_blade.chord.max(), "% of the largest"),
        ("twist", np.rad2deg(1.0), "deg"),
    ):
        off = scale * np.abs(getattr(blade, name) - getattr(file_blade, name))
        worst = int(np.argmax(off))
        if off[worst] > FIT[name]:
            points, where = findings.physics.shape.points[name], findings.stations.places([worst])
            yield _warning(
                f"design.{name}_points",
                f"a spline through {points} points differs from the {name} of the blade's file by "
                f"{off[worst]:.2g} {unit} at {where}: the run begins with the "
                "spline; more points follow the file more closely",
            )
    mass, inertia = findings.physics.rotor.mass_and_inertia(blade)
    source = "given in the case" if rotor.chord is not None else Path(rotor.blade).name
    if findings.case.start.from_ is not None:
        source = f"design of {findings.case.start.from_}"
    turbine, places = findings.physics.turbine, findings.stations.places
    half = [0.5 * outline.thickness for outline in turbine.outlines]
    filled = turbine.along_span(np.subtract(turbine.walls, half), turbine.blade.r) > -KEPT
    kind = "" if any(x.area for x in rotor.sections) else "solid " if np.all(filled) else "hollow "
    if np.any(filled) and any(0.0 < (x.wall or 0.0) < 0.5 for x in (rotor, *rotor.sections)):
        yield _warning("rotor.wall", f"leaves no hollow at {places(filled)}", "note")
    material = f"{kind}blades of {rotor.blade_material.density:g} kg/m^3"
    shaft = findings.physics.rotor.hub_of(blade)
    besides = f"of which {shaft:g} kg m^2 besides the blades"
    yield Row("blades", blade.blade_count)
    yield Row("tip radius", blade.tip_radius, "m", digits=4)
    hub = f"{blade.hub_radius / blade.tip_radius:.3g} R"
    yield Row("hub radius", blade.hub_radius, "m", hub, 4)
    if blade.cone:
        yield Row("cone", np.rad2deg(blade.cone), "deg", digits=3)
    yield Row("density of the water", findings.case.fluid.density, "kg/m**3")
    yield Row("blade at the start", source, "", f"{blade.r.size} stations at {places()}")
    yield Row("chord", blade.chord, "m", digits=4)
    yield Row("twist", np.rad2deg(blade.twist), "deg", digits=3)
    yield Row("mass", mass, "kg", material, 4)
    yield Row("inertia", inertia, "kg*m**2", besides if shaft else "", 4)
    water = findings.physics.rotor.water_inertias(blade).values()
    yield water_inertia(tuple(water), inertia, rotor.added_inertia)


def _stations(findings: Findings) -> Rows:
    """Yield angles and Reynolds numbers of the stations; warn, or note, beyond the tables."""
    turbine, stations = findings.physics.turbine, findings.stations
    reynolds, numbers = stations.reynolds, stations.numbers
    yield from stations.messages("starting blade")
    text = powers(list(numbers)) if numbers else "a Reynolds number that the file does not contain"
    if len(numbers) > 1 and turbine.reynolds_number and findings.case.rotor.reynolds == "invariant":
        text += f", taken at {powers(turbine.reynolds_number)}"
    how = "at every speed"
    if findings.plant.polar.follows_reynolds:
        how, ends = "which follow them", np.exp(findings.plant.polar.log_reynolds[[0, -1]])
        off = np.any((reynolds < 0.99 * ends[0]) | (reynolds > 1.01 * ends[1]), axis=0)
        if np.any(off):
            yield _warning(
                "rotor.polar",
                f"Reynolds numbers at {stations.places(off)} are {powers(reynolds[:, off])}, and "
                f"the polars' tables run from {powers(ends)}: outside them the nearest is used",
            )
    yield Row("sections", ", ".join({Path(section.name).name: "" for section in turbine.sections}))
    yield Row("thickness", 100.0 * np.asarray(turbine.thickness), "%", "of the chord", 3)
    yield Row("angles of attack", np.rad2deg(stations.met), "deg", "along the blade", 3)
    note = f"along the blade; polars for {text}, {how}"
    yield Row("Reynolds numbers", powers(reynolds), "", note)


def _flow(findings: Findings, flow: Flow, case: Case) -> Rows:
    """Yield a flow of the case as given; warn of changes that mesh, disc or rotor cannot follow."""
    unknown = "not declared" if flow.range[0] < flow.range[1] else "none: it is steady"
    cutoff, changes = flow.cutoff, "not counted" if flow.steady else unknown
    if cutoff:
        changes = f"up to {cutoff:.3g} Hz, a period of {measured(1.0 / cutoff, 's', 3)}"
        yield from _fast_changes(findings, flow)
    for scenario in flow.scenarios:
        yield from _refused(findings, "inflow", of_flow(scenario))
    why = "as the case says"
    if case.of_scenario(flow.name).phase.duration is None:
        length = flow.inflow.length
        why = "the length of the flow's data" if length else "by default: the flow has no end"
    area = np.pi * findings.plant.blade.rotor_radius**2
    density = findings.physics.rotor_in(flow.scenarios[0]).water_density
    passing = flow.average(power_scale(density, 1.0, flow.speed)) / np.pi
    yield Row("kind", words.flow_words(flow.kind))
    yield Row("speed", flow.range, "m/s", digits=4)
    operating = " while operating" if flow.steady else ""
    yield Row(f"mean speed{operating}", flow.mean, "m/s", digits=4)
    share = f"{100.0 * flow.deviation / flow.mean:.3g} % of the mean"
    yield Row("standard deviation", flow.deviation, "m/s", share, 3)
    if isinstance(flow.kind, Resource):
        why = "a year"
        yield Row("limits hold up to", flow.range[1], "m/s", _fastest(findings, flow), 4)
    yield Row("time", words.duration(flow.duration), "", why)
    if len(findings.flows) > 1:
        yield Row("share of time", flow.share)
    yield Row("changes", changes)
    yield Row("power through the rotor", passing * area, "W", f"mean{operating}", 4)
    yield Row("power per square metre", passing, "W", f"mean{operating}", 4)


def _fastest(findings: Findings, flow: Flow) -> str:
    """Return what decides the fastest flow of a resource, at which limits hold."""
    fastest, spread = flow.range[1], flow.kind.turbulence_intensity
    if fastest == findings.case.control.cut_out:
        return "control.cut_out"
    edge = "the edge of the last bin" if flow.kind.own_bins else "the fastest flow"
    turbulence = f"{FARTHEST:.3g} x {100.0 * spread:.3g} % of turbulence"
    slower = fastest / (1.0 + FARTHEST * spread)
    return f"{edge}, {slower:.4g} m/s + {turbulence}" if spread else edge


def _refused(findings: Findings, key: str, checks: Iterable[tuple]) -> Rows:
    """Warn of what the checks of a run would refuse."""
    for check in starmap(entry, checks):
        if not check.passed:
            yield _warning(key, explain(check, findings.physics))


def _fast_changes(findings: Findings, flow: Flow) -> Rows:
    """Warn of a flow that changes too fast for disc or rotor."""
    cutoff, diameter = flow.cutoff, 2.0 * findings.plant.blade.rotor_radius
    eddies = flow.mean / diameter
    settable = any(hasattr(part, "cutoff") for part in getattr(flow.inflow, "parts", [flow.inflow]))
    if settable and cutoff > EDDY * eddies:
        yield _warning(
            "inflow.cutoff",
            f"the flow has frequencies up to {cutoff:.3g} Hz, and a rotor averages over eddies "
            f"smaller than itself: a cutoff of {eddies:.2g} Hz, mean speed over diameter, "
            "leaves them out",
        )
    shortest = 1.0 / (2.0 * np.pi * cutoff)
    if findings.time_constant is not None and findings.time_constant > shortest:
        yield _warning(
            "inflow",
            f"the flow changes faster, within {measured(shortest, 's', 3)} (1 / (2 pi "
            f"cutoff)), than the rotor follows, {measured(findings.time_constant, 's', 3)}: it "
            "will capture less than the quasi-steady figures",
        )


def _control(findings: Findings) -> Rows:
    """Yield the law; warn of a torque limit or gain that is probably a mistake."""
    case, law, limit = findings.case, findings.physics.law, findings.physics.law.torque_limit
    yield Row("law", _first_line(case.control) or case.control.law)
    note = f"approached smoothly (smoothing {case.control.smoothing:g})" if law.is_feedback else ""
    yield Row("torque limit", limit or "none", "N*m", note if limit else "", 4)
    if limit is not None and not findings.above_rated:
        _, torque = findings.at_best(findings.fastest)
        yield _warning(
            "control.torque_limit",
            f"{measured(limit, 'N*m', 4)} is more than the torque of the flow: at its best tip "
            f"speed ratio the starting blade has {measured(torque, 'N*m', 4)} in the fastest flow, "
            f"{findings.fastest:.4g} m/s",
        )
    if law.is_feedback:
        gains, fitted = findings.begins.gains, findings.begins.gains is None
        how = "suits the starting blade; the run finds its own" if fitted else "as the case says"
        yield Row("gain at the start", amounts(findings.start.gains, law.gain_units, 4), "", how)
        yield from (_warning("control", text) for text in law.held(findings.start.gains))
        if findings.running and 0.0 < findings.captured < WASTED:
            gain = f"a gain{_within_bounds(findings)}" if fitted else measured(gains, "", 4)
            key, cause = (fitted and _reached(findings)) or ("control.gain", gain)
            yield _warning(
                key,
                f"{cause} lets the starting blade capture {100.0 * findings.captured:.2g} % of "
                "what its largest power coefficient gives, which in the mean flow is "
                f"{measured(np.prod(findings.at_best(findings.mean)), 'W', 4)}",
            )
    initial = case.phase.initial_speed
    free = initial == "free" or (initial == "auto" and not law.is_feedback)
    balance = "hydrodynamic and generator torque balance"
    yield Row("at t = 0", "the rotor's speed is free" if free else balance)


def _reached(findings: Findings) -> tuple[str, str] | None:
    """Return key and bound of the limit that the starting blade breaks most, or reaches."""
    limits = [
        (float(np.max(limit.excess(findings.at_start[flow.name]))), limit)
        for flow in findings.flows
        for limit in flow.scenarios[0].limits
        if np.isfinite(limit.upper)
    ]
    share, most = max(limits, key=itemgetter(0), default=(-1.0, None))
    if most is None or share <= -REACHED:
        return None
    return most.key, f"at most {measured(most.upper, most.unit or '', 4)}"


def _within_bounds(findings: Findings) -> str:
    """Return the bounds of the gain in words, empty without them."""
    bounds = findings.case.design.gain_bounds
    return f" within design.gain_bounds = {measured(bounds, '', 4)}" if bounds else ""


def _start(findings: Findings) -> Rows:
    """Yield the operation of the starting blade; warn if it captures little or does not turn."""
    best, mean = findings.best, findings.mean
    rotor, blade, most = findings.physics.rotor, findings.plant.blade, best.power_coefficient
    other = rotor.best_operation(blade.with_shape(blade.chord, -blade.twist)).power_coefficient
    sign = {"power coefficient of the twist with the other sign": max(other / max(most, 1e-9), 0.0)}
    for text in implausible({"largest power coefficient": most} | sign):
        yield _warning("rotor.blade", text)
    speed, torque = findings.at_best(mean)
    ratio = f"at tip speed ratio {number(best.tip_speed_ratio, 3)}"
    yield Row("largest power coefficient", best.power_coefficient, "", ratio, 4)
    there = f"at {mean:.4g} m/s, {measured(torque, 'N*m', 4)}, {measured(speed, 'rad/s', 4)}"
    yield Row("there, in the mean flow", torque * speed, "W", there, 4)
    if np.isfinite(findings.rated_speed):
        power = findings.physics.law.largest_torque * speed * findings.rated_speed / mean
        above = f"flow above it {100.0 * findings.above_rated:.3g} % of the time"
        note = f"at {findings.rated_speed:.4g} m/s, {above}"
        yield Row("there, at the torque limit", power, "W", note, 4)
    if findings.running:
        share = per_cent(findings.captured, 1.0, 3)  # empty without any power
        share = share and f"{share} of what the largest power coefficient gives"
        energy = findings.start.operation.energy
        branch = ""
        for x in findings.start.branches[1:]:
            over = f"; {x.branch} breaks {joined(*x.exceeds)} by up to {100.0 * x.excess:.3g} %"
            over = over if START_EXCESS < x.excess < np.inf else ""
            branch = f"branch {findings.start.branch}{over}"
        yield Row("tip speed ratio under the control law", findings.working, "", branch, 3)
        yield Row("energy if the rotor followed the flow at once", energy, "J", share, 4)
        table = of_table(findings.case.generator, findings.at_start.values())
        yield from _refused(findings, "generator.table", table)
    else:
        yield Row("under the control law", "it does not turn unstalled throughout this flow")
        yield _not_turning(findings)
    text, starts = start_against_friction(findings.plant, findings.physics.scenarios)
    if text:
        yield Row("start", text) if starts else _warning("generator.shaft_friction", text)
    if findings.time_constant is not None:
        how = "of rotor and control law" if findings.physics.law.is_feedback else "the rotor's own"
        at = f"at {mean:.4g} m/s and {measured(findings.steady_speed, 'rad/s', 4)}"
        yield Row("time constant", findings.time_constant, "s", f"{how}, {at}", 3)
        if findings.physics.law.states and findings.growth >= 0.0:
            text = f"unstable with the starting gains, {at}: it grows by {findings.growth:.3g} 1/s"
            yield _warning("control", f"the closed loop of rotor and law is {text}")


def _not_turning(findings: Findings) -> Row:
    """Warn of a rotor that does not turn."""
    case = findings.case
    condition = f" with a gain{within}" if (within := _within_bounds(findings)) else ""
    if getattr(case.control, "gain", None) is not None:
        condition = " and this gain"
    looks = "with this blade a run may find no solution"
    if findings.physics.shape.designs_chord and case.start.method == "quasi_steady":
        looks = "the run looks for one that does"
    text = "the starting blade does not turn unstalled throughout this flow under this law"
    return _warning("control", f"{text}{condition}: {looks}")


def _optimization(findings: Findings) -> Rows:
    """Yield the size of the problem; warn of segments that are too long."""
    case, law, problem = findings.case, findings.physics.law, evaluated_problem(findings)
    phase, hydro = case.phase, case.hydrodynamics
    nodes = sum(scenario.node_times.size for scenario in findings.physics.scenarios)
    moving = [flow for flow in findings.flows if not flow.steady]
    meshes = [flow.scenarios[0].mesh for flow in moving]
    segments = sum(scenario.segments for flow in moving for scenario in flow.scenarios)
    few = sum(mesh.segments for mesh in meshes)
    lengths = np.array([mesh.duration / mesh.segments for mesh in meshes])
    length, periods, constant = np.max(lengths, initial=0.0), "", findings.time_constant or np.inf
    if segments > few:
        periods = f", divided into {segments} where the flow changes fast"
    elif findings.cutoff:
        periods = f" ({1.0 / (findings.cutoff * length):.3g} in the flow's shortest period)"
    if phase.transcription == "radau" and law.is_feedback and length > 2.0 * constant:
        yield _warning(
            "phase.transcription",
            f"radau with segments of {measured(length, 's', 3)}, longer than "
            f"twice the time constant, {measured(constant, 's', 3)}, converges to wrong speeds: "
            "give gauss-lobatto, or as many phase.segments",
        )
    torque = "at every node of the trajectory"
    if findings.physics.has_curve:
        torque = "as a curve over the tip speed ratio, one for each blade"
    if moving:
        of = f"{min(segments, few)} of {measured(lengths, 's', 3)}{periods}"
        mesh = f"{phase.transcription} of order {phase.order}, {nodes} nodes"
        yield Row("segments", of, "", mesh)
    else:
        yield Row("speeds of the flow", str(nodes), "", "in equilibrium, without time")
    yield Row("unknowns", _sizes(problem.driver.get_design_var_values()))
    yield Row("constraints", _sizes(problem.driver.get_constraint_values()))
    yield Row("torque", torque, "", f"by BEM: {hydro.bem}; in the simulation {hydro.check}")
    yield Row("objective", _first_line(case.objective) or case.objective.kind)
    package, tolerance = problem.driver.package, case.driver.tolerance
    yield Row("optimizer", f"{case.driver.optimizer} of {package}, to {tolerance:g}")


def _bounds(findings: Findings) -> Rows:
    """Yield the bounds of the design; warn of those that the start breaks."""
    point = findings.start
    values = designed(findings.physics, point) | findings.physics.shape.control(point.blade)
    for limit, unit, scale in design_bounds(findings.physics):
        low, high = (number(scale * end) for end in (limit.lower, limit.upper))
        value = measured(scale * limit.value_of(values), unit, 4)
        words = f"at least {low} and at most {high} {unit}".rstrip()
        yield Row(limit.key, words, "", f"{value} with the starting blade")
        if np.max(limit.excess(values)) > KEPT:
            text = f"broken at the start, {words}; {value} with the starting blade"
            yield _warning(limit.key, f"{text}: the run looks for a blade within them")


def _limits(findings: Findings) -> Rows:
    """Yield limits and loads of the starting blade as a result has them, and how it bends.

    In quasi-steady operation under the control law; warn of limits that are broken.
    """
    for flow in findings.flows:
        name = f"{flow.name}: " * (len(findings.flows) > 1)
        values, limits = findings.at_start[flow.name], {}
        for limit in (*flow.scenarios[0].limits, *findings.physics.design_limits):
            if isinstance(limit, DesignBounds) or not np.isfinite(limit.end):
                continue
            timed = limit.place == "time"
            has_value = findings.running or not timed
            limits[limit.name] = loads.of_limit(limit, values if has_value else None)
            broken, speed = limit.excess(values) > START_EXCESS, values["inflow_speed"]
            if has_value and np.any(broken):
                where = f"in flows from {speed[broken].min():.4g} m/s" if timed else ""
                text = joined(f"broken at the start, {limits[limit.name].row(limit.name)}", where)
                yield _warning(name + limit.key, f"{text}: the run has to meet it")
        largest = loads.largest([values]) if findings.running else {}
        case, start = findings.case.of_scenario(flow.name), Achieved(limits=limits, loads=largest)
        for row in in_operation(start, case):
            yield replace(row, label=name + row.label)
    rotor, blade = findings.physics.rotor, findings.start.blade
    rotors = [findings.physics.rotor_in(flow.scenarios[0]) for flow in findings.flows]
    pairs = list(zip(rotors, findings.at_start.values(), strict=True)) if findings.running else []
    bent = loads.tip_deflection(blade, pairs)
    yield from bending(bent, blade.tip_radius, rotor.weight_moment(blade))
    yield from (_warning("rotor", text) for text in bends_far(bent, blade.tip_radius))


def _first_line(kind) -> str:
    """Return the first line of the docstring of a law or an objective."""
    return (type(kind).__doc__ or "").strip().partition("\n")[0].rstrip(".")


def _sizes(vectors: dict[str, np.ndarray]) -> str:
    """Return the total size and its parts, by the last parts of the names in the problem."""
    parts: Counter[str] = Counter()
    for name, values in vectors.items():
        parts[name.removesuffix(".value").rpartition(".")[2]] += values.size
    words = joined(*(f"{size} {last}" for last, size in parts.items()))
    return f"{parts.total()}: {words or 'none'}"
