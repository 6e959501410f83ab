"""What `hkt check` tells before a run: all that a run needs is read and built, nothing optimized.

Here the figures of `hkt_mdo.run.findings` are put into words, with what was done to the files and
what their author may not have meant.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.polar import read_polars
from hkt_mdo.problem.build import make_driver
from hkt_mdo.problem.physics import MOST_SEGMENTS, SEGMENTS_PER_PERIOD, physics
from hkt_mdo.problem.turbine import POLAR
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.run import findings
from hkt_mdo.run.findings import Findings, ProblemSize, Stations
from hkt_mdo.run.words import (
    count,
    duration,
    flow_words,
    number,
    plain_unit,
    powers,
    quantity,
    span,
)

Rows = dict[str, str]

FIT = {"chord": 2.0, "twist": 0.5}  # % of the largest, deg: splines may leave the file's blade
POOR = 0.2  # largest power coefficient below which a blade was hardly meant as it stands
LIGHT = 0.02  # share of the torque below which stations outside their polars' tables are a note
WASTED = 0.5  # share of what a blade can capture below which a gain was hardly meant
OUTERMOST = 0.9  # r/R of the last station below which a part of the blade is missing
EDDY = 1.25  # cutoff times diameter over flow speed above which eddies are smaller than the rotor
KEPT = 1e-6  # share of its bound by which a limit may be left
SOLVER = {"vectorized": "this package's BEM", "ccblade": "CCBlade"}


@dataclass(frozen=True, eq=False)
class CheckReport:
    """What a case means.

    `tables` has rows of a name and a text by the table's title; `notes` say what was converted,
    repaired or left out of the files; `warnings` what the author may not have meant, though the
    case runs; `figures` is what `hkt_mdo.results.check_plots.check_figures` draws.
    """

    name: str
    tables: dict[str, Rows]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    findings: Findings
    size: ProblemSize
    figures: dict[str, dict]


def check_case(case: Case) -> CheckReport:
    """Read and build all that a run of a case needs, and tell what it means; nothing is optimized.

    Raises
    ------
    InputError
        If a file of the case is broken, files do not fit each other, or the optimizer that the case
        asks for is not installed.
    """
    world = physics(case)
    package = make_driver(world.case).package
    found = findings.examine(world)
    size = findings.problem_size(world, found.best)
    met = findings.meet(found)
    tables = {
        "Turbine": _turbine_rows(found) | _station_rows(found, met),
        "Flow": _flow_rows(found, case.phase.duration is None),
        "Control": _control_rows(found),
        "Starting blade": _start_rows(found),
        "Optimization": _optimization_rows(found, size, package),
    }
    told, notes = _station_remarks(found, met)
    warnings = *_start_warnings(found), *_design_warnings(found), *told, *_flow_warnings(found)
    notes, figures = (*world.messages, *notes), findings.figure_data(found, met)
    return CheckReport(case.name, tables, notes, warnings, found, size, figures)


# Rows of the tables -------------------------------------------------------------------------------


def _turbine_rows(found: Findings) -> Rows:
    rotor, blade = found.case.rotor, found.physics.blade
    cone = f", coned by {np.rad2deg(blade.cone):.3g} deg" if blade.cone else ""
    source = "given in the case" if rotor.chord is not None else Path(rotor.blade).name
    own = [section.name for section in _own_sections(rotor)]
    sections = [Path(section.polar).name for section in rotor.sections] or own
    names = ", ".join(sections) or Path(rotor.polar or POLAR).name
    besides = f", and {rotor.hub_inertia:g} kg m^2 besides" if rotor.hub_inertia else ""
    thickness = 100.0 * np.asarray(found.turbine.thickness)
    return {
        "rotor": f"{count(blade.blade_count, 'blade')}, tip radius {blade.tip_radius:.4g} m, hub "
        f"{blade.hub_radius:.4g} m ({blade.hub_radius / blade.tip_radius:.3g} R){cone}; in water "
        f"of {found.case.fluid.density:g} kg/m^3",
        "blade at the start": f"{source}: {blade.r.size} stations at {found.places()}, chord "
        f"{span(blade.chord, 'm')}, twist {span(np.rad2deg(blade.twist), 'deg', 3)}",
        "sections": f"{names}; {span(thickness, '%', 3)} thick",
        "designed": "; ".join(_designed(found)) or "nothing of the blade",
        "mass, inertia": f"{number(found.mass)} kg and {number(found.plant.inertia)} kg m^2: solid "
        f"blades of {rotor.material_density:g} kg/m^3{besides}",
    }


def _designed(found: Findings) -> Iterator[str]:
    """Yield what of the blade is designed, with its bounds."""
    shape, design = found.physics.shape, found.case.design
    if shape.designs_chord:
        for name, unit in (("chord", "m"), ("twist", "deg")):
            points, all_of_them = shape.points[name], shape.blade.r.size
            where = f"at {points} stations" if points == all_of_them else f"by {points} points"
            yield f"{name} {where}, {span(getattr(design, f'{name}_bounds'), unit)}"
    if shape.designs_set_angle:
        yield f"set angle, {span(design.set_angle_bounds, 'deg')}"
    if shape.radius_bounds is not None:
        yield f"tip radius, {span(design.radius_bounds, 'm')}"


def _station_rows(found: Findings, met: Stations) -> Rows:
    polar, rotor = found.physics.polar, found.case.rotor
    known = _polar_numbers(rotor)
    if isinstance(polar, bem.LocalReynolds):
        told = f"the polars follow them, by tables for {powers(np.exp(polar.log_reynolds))}"
    elif not known:
        told = "the polar's file does not say for which it is"
    elif len(known) == 1:
        told = f"the polar is for {powers(known)}, whatever the speed"
    else:
        at = f", taken at {powers(rotor.reynolds_number)}" if rotor.reynolds_number else ""
        told = f"the polars are for {powers(known)}{at}, whatever the speed"
    angles = span(np.rad2deg(met.met), "deg", 3)
    return {
        "angles of attack": f"{angles} along the blade in this flow",
        "Reynolds numbers": f"{powers(met.reynolds)} along the blade; {told}",
    }


def _own_sections(rotor) -> tuple:
    """Return the sections that the blade's file brings with it, unless the case gives others."""
    if rotor.sections or rotor.polar is not None or rotor.chord is not None:
        return ()
    return read_blade(rotor.blade, hub_radius=0.0).sections


def _polar_numbers(rotor) -> list[float]:
    """Return the Reynolds numbers that the polars of a rotor state."""
    tables = [table for section in _own_sections(rotor) for table in section.polars]
    if not tables:
        sources = [section.polar for section in rotor.sections] or [rotor.polar or POLAR]
        tables = [table for source in sources for table in read_polars(source)]
    return sorted({table.reynolds for table in tables if table.reynolds is not None})


def _flow_rows(found: Findings, by_default: bool) -> Rows:
    why = "as the case says"
    if by_default:
        endless = found.physics.inflow.length is None
        why = "by default, for the flow has no end" if endless else "the length of the flow's data"
    changes = "none: it is steady"
    if found.cutoff:
        changes = f"up to {found.cutoff:.3g} Hz, a period of {quantity(1 / found.cutoff, 's', 3)}"
    radius = found.physics.blade.rotor_radius
    through = found.average(power_scale(found.case.fluid.density, radius, found.speed))
    flux = through / (np.pi * radius**2)
    return {
        "kind": flow_words(found.case.inflow),
        "speed": f"{span(found.speed, 'm/s')}, mean {found.mean:.4g} m/s, standard deviation "
        f"{found.deviation:.3g} m/s ({100.0 * found.deviation / found.mean:.3g} %)",
        "time": f"{duration(found.case.phase.duration)}, {why}",
        "changes": changes,
        "power in it": f"{quantity(flux, 'W')} a square metre on average, "
        f"{quantity(through, 'W')} through the rotor",
    }


def _control_rows(found: Findings) -> Rows:
    control, law, case = found.case.control, found.physics.law, found.case
    rows = {"law": _first_line(control) or control.law, "torque limit": "none"}
    if control.torque_limit is not None:
        rows["torque limit"] = quantity(control.torque_limit, "N m")
        if law is not None:
            rows["torque limit"] += f", approached smoothly (smoothing {control.smoothing:g})"
    if law is not None:
        pairs = zip(found.start.gains, law.gain_units, strict=True)
        gains = ", ".join(f"{number(gain)} {plain_unit(unit)}" for gain, unit in pairs)
        own = law.starting_gains() is None
        how = "suits the starting blade; the run finds its own" if own else "as the case says"
        rows["gain at the start"] = f"{gains}: {how}"
    if case.design.gain_bounds is not None:
        rows["gain"] = f"{span(case.design.gain_bounds)}, in the same unit"
    initial = case.phase.initial_speed
    free = initial == "free" or (initial == "auto" and law is None)
    balance = "hydrodynamic and control torque balance"
    return rows | {"at t = 0": "the rotor's speed is free" if free else balance}


def _start_rows(found: Findings) -> Rows:
    best, mean, start = found.best, found.mean, found.start.operation
    speed = best.tip_speed_ratio * mean / found.physics.blade.rotor_radius
    torque = found.torque(speed, mean)
    rows = {
        "largest power coefficient": f"{best.power_coefficient:.4f} at a tip speed ratio of "
        f"{best.tip_speed_ratio:.3g}",
        "there, in the mean flow": f"{quantity(torque * speed, 'W')} at {mean:.4g} m/s: "
        f"{quantity(torque, 'N m')}, {_turning(speed)}",
    }
    if found.rated_speed is not None:
        often = f"{100.0 * found.above_rated:.3g} % of the time" if found.above_rated else "never"
        power = found.physics.torque_limit * speed * found.rated_speed / mean
        at = f"{quantity(power, 'W')} at {found.rated_speed:.4g} m/s"
        rows["there, at the torque limit"] = f"{at}; flow above it: {often}"
    rows["under the control law"] = "it does not turn unstalled throughout this flow"
    if start.running:
        rows["under the control law"] = (
            f"tip speed ratio {span(found.working, digits=3)}; {quantity(start.energy, 'J')} if it "
            f"followed the flow at once, {100.0 * found.captured:.3g} % of what the largest power "
            "coefficient gives"
        )
    if found.time_constant is not None:
        how = "the rotor's own" if found.physics.law is None else "of rotor and control law"
        constant = f"{quantity(found.time_constant, 's', 3)}, {how}, at {mean:.4g} m/s and "
        rows["time constant"] = constant + _turning(found.steady_speed)
    return rows


def _turning(speed: float) -> str:
    return f"{speed:.4g} rad/s ({speed * 30.0 / np.pi:.3g} rpm)"


def _optimization_rows(found: Findings, size: ProblemSize, package: str) -> Rows:
    phase, hydro, driver = found.case.phase, found.case.hydrodynamics, found.case.driver
    length = phase.duration / phase.segments
    periods = ""
    if found.cutoff:
        periods = f" ({1.0 / (found.cutoff * length):.3g} in the flow's shortest period)"
    name = {"gauss-lobatto": "Gauss-Lobatto", "radau": "Radau"}[phase.transcription]
    torque = "at every node of the trajectory"
    if found.physics.has_curve:
        torque = "as a curve over the tip speed ratio, one for each blade"
    unknowns = _sizes(size.unknowns)
    if found.physics.shape.designs_set_angle:
        unknowns = unknowns.replace("twist", "set angle")
    check = "too" if hydro.check == hydro.bem else f"by {SOLVER[hydro.check]}"
    return {
        "segments": f"{phase.segments} of {quantity(length, 's', 3)}{periods}, {name} of order "
        f"{phase.order}: {size.nodes} nodes",
        "unknowns": unknowns,
        "constraints": _sizes(size.constraints),
        "torque": f"{torque}, by {SOLVER[hydro.bem]}; in the simulation {check}",
        "objective": _first_line(found.case.objective) or found.case.objective.kind,
        **{f"limit, {limit.name}": told for limit, told, _ in _limits(found)},
        "optimizer": f"{driver.optimizer} of {package}, to {driver.tolerance:g}",
        "an evaluation": f"about {quantity(size.evaluation_seconds, 's', 2)} on this machine, "
        "derivatives included",
    }


def _limits(found: Findings) -> Iterator[tuple[Limit, str, bool]]:
    """Yield the limits that the case gives, each with its bounds and values, and if it is kept."""
    for limit in found.case.limits.given:
        ends = {"at least": limit.lower, "at most": limit.upper}
        words = [f"{word} {number(end)}" for word, end in ends.items() if np.isfinite(end)]
        told, kept = f"{' and '.join(words)} {plain_unit(limit.unit or '')}".rstrip(), True
        if found.start.operation.running:
            value = limit.value(**{name: found.at_start[name] for name in limit.inputs})
            told += f"; {span(value)} with the starting blade"
            kept = bool(np.max(limit.excess(found.at_start)) <= KEPT)
        yield limit, told, kept


def _first_line(kind) -> str:
    """Return the first line of the docstring of a law or an objective."""
    return (type(kind).__doc__ or "").strip().partition("\n")[0].rstrip(".")


_NAMES = {
    "chord_control": "chord",
    "twist_control": "twist",
    "rotor_radius": "radius",
    "gain_": "gain",
    "[initial]": "balance at t = 0",
    "[path]": "range of the control torque",
    "defect_control": "smoothness",
    "defects:": "equation of motion",
    "rotor_speed": "rotor speed over time",
    "control_torque": "control torque over time",
    "recovery": "distance from stall",
}
"""What the parts of names in the problem mean; the first one that a name has tells."""


def _sizes(sizes: dict[str, int]) -> str:
    """Return a total and what it is made of, in words."""
    parts: dict[str, int] = {}
    for name, size in sizes.items():
        last = name.removesuffix(".value").rpartition(".")[2]
        words = next((words for part, words in _NAMES.items() if part in last), last)
        parts[words] = parts.get(words, 0) + size
    listed = ", ".join(f"{size} {words}" for words, size in parts.items())
    return f"{sum(parts.values())}: {listed}" if parts else "none"


# Notes and warnings -------------------------------------------------------------------------------


def _station_remarks(found: Findings, met: Stations) -> tuple[list[str], list[str]]:
    """Return warnings and notes on angles of attack and Reynolds numbers."""
    polar, warnings, notes = found.physics.polar, [], []
    if np.any(met.unsolved):
        warnings.append(
            "blade element momentum theory has no solution at "
            f"{found.places(met.unsolved)} of the starting blade: no load counts there"
        )
    below, above = met.table[0] - met.met[0], met.met[1] - met.table[1]
    over = np.maximum(above, below)
    outside = over > 1e-9
    if np.any(outside):
        worst, share = int(np.argmax(over)), float(met.share[outside].sum())
        angle = np.rad2deg(met.met[int(above[worst] >= below[worst]), worst])
        (warnings if share > LIGHT else notes).append(
            f"{count(int(outside.sum()), 'station')} at {found.places(outside)} with "
            f"{number(100.0 * share, 2)} % of the torque: beyond the polar's table, "
            f"{span(np.rad2deg(met.table[:, worst]))} deg, in Viterna's extension, with angles of "
            f"attack up to {angle:.3g} deg, at tip speed ratios of {span(found.working, digits=3)}"
        )
    if isinstance(polar, bem.LocalReynolds):
        low, high = np.exp(polar.log_reynolds[[0, -1]])
        off = np.any((met.reynolds < 0.99 * low) | (met.reynolds > 1.01 * high), axis=0)
        if np.any(off):
            warnings.append(
                f"Reynolds numbers at {found.places(off)} are {powers(met.reynolds[:, off])}, and "
                f"the polars' tables run from {powers((low, high))}: beyond them the nearest table "
                "holds"
            )
    return warnings, notes


def _start_warnings(found: Findings) -> Iterator[str]:
    """Yield what speaks against torque limit, law and gain."""
    case, limit, running = found.case, found.physics.torque_limit, found.start.operation.running
    fastest, most = float(found.speed.max()), found.best.power_coefficient
    if most < POOR:
        yield (
            f"the starting blade's power coefficient is {most:.3g} at most: look at the sign and "
            "unit of its twist, at rotor.set_angle and at the polar"
        )
    if limit is not None and not found.above_rated:
        speed = found.best.tip_speed_ratio * fastest / found.physics.blade.rotor_radius
        most = quantity(found.torque(speed, fastest), "N m")
        yield (
            f"control.torque_limit = {quantity(limit, 'N m')} is more than the flow gives: at its "
            f"best tip speed ratio the starting blade has {most} in the fastest flow, "
            f"{fastest:.4g} m/s"
        )
    for broken, told, kept in _limits(found):
        if not kept:
            yield f"limits.{broken.name} is broken at the start, {told}: the run moves it inside"
    gain = getattr(case.control, "gain", None)
    if running and gain is not None and found.captured < WASTED:
        yield (
            f"control.gain = {span(gain)} lets the starting blade capture "
            f"{100.0 * found.captured:.2g} % of what its largest power coefficient gives"
        )
    if not running:
        given = " and this gain" if gain is not None else ""
        looks = "with this blade a run may find no solution"
        if found.physics.shape.designs_chord and case.start.method == "quasi_steady":
            looks = "the run looks for one that does"
        yield (
            "the starting blade does not turn unstalled throughout this flow under this law"
            f"{given}: {looks}"
        )


def _design_warnings(found: Findings) -> Iterator[str]:
    """Yield what speaks against bounds, which may leave out the start, and control points."""
    shape, design, blade = found.physics.shape, found.case.design, found.physics.blade
    given, (chord, twist) = found.turbine.blade, shape.control(blade)
    starts = {"radius": (blade.tip_radius, "tip radius", "m")}
    starts["gain"] = found.start.gains, "gain", ""
    if shape.designs_chord:
        starts |= {"chord": (chord, "chord", "m"), "twist": (np.rad2deg(twist), "twist", "deg")}
    for key, (value, what, unit) in starts.items():
        low, high = getattr(design, f"{key}_bounds") or (-np.inf, np.inf)
        if np.any((value < low - 1e-9 * abs(low)) | (value > high + 1e-9 * abs(high))):
            yield (
                f"design.{key}_bounds = [{low:g}, {high:g}] leaves out the {what} of the starting "
                f"blade, {span(value, unit)}: the run moves it inside"
            )
    if blade.r[-1] < OUTERMOST * blade.tip_radius:
        yield (
            f"the outermost station is at {found.places([-1])}, and the load falls to zero "
            "from there to the tip: give stations farther out, or look at rotor.radius"
        )
    for name, scale, unit in (
        ("chord", 100.0 / given.chord.max(), "% of the largest"),
        ("twist", np.rad2deg(1.0), "deg"),
    ):
        off = scale * np.abs(getattr(blade, name) - getattr(given, name))
        worst = int(np.argmax(off))
        if off[worst] > FIT[name]:
            yield (
                f"the spline through design.{name}_points = {shape.points[name]} leaves the {name} "
                f"of the blade's file by {off[worst]:.2g} {unit} at {found.places([worst])}: "
                "the run begins with the spline; more points follow the file closer"
            )


def _flow_warnings(found: Findings) -> Iterator[str]:
    """Yield what speaks against the flow's cutoff: segments, rotor and disc may not follow."""
    phase, cutoff, flow = found.case.phase, found.cutoff, found.case.inflow
    if not cutoff:
        return
    sampled = any(hasattr(part, "cutoff") for part in getattr(flow, "parts", (flow,)))
    wanted = int(np.ceil(SEGMENTS_PER_PERIOD * cutoff * phase.duration * (1.0 - 1e-9)))
    if phase.segments < wanted:
        each = phase.segments / (cutoff * phase.duration)
        yield (
            f"phase.segments = {phase.segments} gives {each:.2g} to the flow's shortest period, "
            f"{quantity(1.0 / cutoff, 's', 3)}, and {SEGMENTS_PER_PERIOD:g} are wanted: give "
            + (f"{wanted}" if wanted <= MOST_SEGMENTS else "a shorter phase.duration")
            + (", or a lower cutoff" if sampled else "")
        )
    eddies = found.mean / (2.0 * found.physics.blade.rotor_radius)
    if sampled and cutoff > EDDY * eddies:
        yield (
            f"the flow has frequencies up to {cutoff:.3g} Hz, and a rotor averages over eddies "
            f"smaller than itself: a cutoff of {eddies:.2g} Hz, mean speed over diameter, leaves "
            "them out"
        )
    shortest = 1.0 / (2.0 * np.pi * cutoff)
    if found.time_constant is not None and found.time_constant > shortest:
        yield (
            f"the flow changes faster, within {quantity(shortest, 's', 3)} (1 / (2 pi cutoff)), "
            f"than the rotor follows, {quantity(found.time_constant, 's', 3)}: it will capture "
            "less than the quasi-steady figures above"
        )
