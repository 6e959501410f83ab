"""What `hkt check` tells before a run: the figures of `hkt_mdo.run.findings`, put into words."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.dynamics.limits import DesignBounds, Limit, TorqueLimit
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.polar import read_polars
from hkt_mdo.problem.build import make_driver
from hkt_mdo.problem.physics import START_EXCESS, physics
from hkt_mdo.problem.turbine import POLAR
from hkt_mdo.results.words import amounts, bent, measured, number, quantity, turning
from hkt_mdo.rotor.reynolds import LocalReynolds
from hkt_mdo.run import loads
from hkt_mdo.run.findings import Findings, figure_data, problem_size
from hkt_mdo.run.judge import FLOW_ERROR, designed
from hkt_mdo.run.words import duration, flow_words, powers, span

FIT = {"chord": 2.0, "twist": 0.5}  # % of the largest, deg: splines may leave the file's blade
POOR = 0.2  # largest power coefficient below which a blade was hardly meant as it stands
LIGHT = 0.02  # share of the torque below which stations outside their polars' tables are a note
WASTED = 0.5  # share of what a blade can capture below which a gain was hardly meant
OUTERMOST = 0.9  # r/R of the last station below which a part of the blade is missing
EDDY = 1.25  # cutoff times diameter over flow speed above which eddies are smaller than the rotor
KEPT = 1e-6  # share of their size by which the bounds of the design may be left


@dataclass(frozen=True, eq=False)
class CheckReport:
    """What a case means.

    `tables` has rows of a name and a text by the table's title; `notes` say what was converted,
    repaired or left out of the files; `warnings` what the author may not have meant, though the
    case runs; `figures` is what `hkt_mdo.results.check_plots.check_figures` draws.
    """

    name: str
    tables: dict[str, dict[str, str]]
    notes: list[str]
    warnings: list[str]
    findings: Findings
    figures: dict[str, dict]


def check_case(case: Case) -> CheckReport:
    """Read and build all that a run of a case needs, and tell what it means; nothing is optimized.

    Raises InputError if a file of the case is broken, files do not fit each other, or the optimizer
    that the case asks for is not installed.
    """
    world = physics(case)
    package = make_driver(world).package
    found, notes, warnings = Findings(world), list(world.messages), list(world.warnings)
    warn = warnings.append
    tables = {
        "Turbine": _turbine(found, warn) | _stations(found, notes.append, warn),
        "Flow": _flow(found, case.phase.duration is None, warn),
        "Control": _control(found, warn),
        "Starting blade": _start(found, warn),
        "Limits, and what the starting blade does": _limits(found, warn),
        "Optimization": _optimization(found, package, warn),
    }
    return CheckReport(case.name, tables, notes, warnings, found, figure_data(found))


def _turbine(found: Findings, warn) -> dict[str, str]:
    """Tell rotor and blade; warn of a blade that ends early or that splines leave."""
    rotor, blade, given = found.case.rotor, found.plant.blade, found.given
    if blade.r[-1] < OUTERMOST * blade.tip_radius:
        warn(
            f"the outermost station is at {found.places([-1])}, and the load falls to zero "
            "from there to the tip: give stations farther out, or look at rotor.radius"
        )
    for name, scale, unit in (
        ("chord", 100.0 / given.chord.max(), "% of the largest"),
        ("twist", np.rad2deg(1.0), "deg"),
    ):
        off = scale * np.abs(getattr(blade, name) - getattr(given, name))
        worst, points = int(np.argmax(off)), found.physics.shape.points[name]
        if off[worst] > FIT[name]:
            warn(
                f"the spline through design.{name}_points = {points} leaves the {name} of the "
                f"blade's file by {off[worst]:.2g} {unit} at {found.places([worst])}: the run "
                "begins with the spline; more points follow the file closer"
            )
    cone = f", coned by {np.rad2deg(blade.cone):.3g} deg" if blade.cone else ""
    source = "given in the case" if rotor.chord is not None else Path(rotor.blade).name
    mass, inertia = found.physics.mass_and_inertia(blade)
    besides = f", and {rotor.hub_inertia:g} kg m^2 besides" if rotor.hub_inertia else ""
    return {
        "rotor": f"{blade.blade_count}-bladed, tip radius {blade.tip_radius:.4g} m, hub "
        f"{blade.hub_radius:.4g} m ({blade.hub_radius / blade.tip_radius:.3g} R){cone}; in water "
        f"of {found.case.fluid.density:g} kg/m^3",
        "blade at the start": f"{source}: {blade.r.size} stations at {found.places()}, chord "
        f"{span(blade.chord, 'm')}, twist {span(np.rad2deg(blade.twist), 'deg', 3)}",
        "mass, inertia": f"{number(mass)} kg and {number(inertia)} kg m^2: {_kind(rotor)}blades "
        f"of {rotor.blade_material.density:g} kg/m^3{besides}",
    }


def _kind(rotor) -> str:
    """Return whether blades are solid or hollow; neither where the area of a section is given."""
    if any(each.area is not None for each in rotor.sections):
        return ""
    return "hollow " if rotor.wall or any(each.wall for each in rotor.sections) else "solid "


def _stations(found: Findings, note, warn) -> dict[str, str]:
    """Tell what the stations meet; warn, or note where the load is light, of what no table has."""
    rotor = found.case.rotor
    for share, message in found.stations.messages("starting blade"):
        (warn if share > LIGHT else note)(message)
    polars = _polars(rotor)
    numbers = {table.reynolds for tables in polars.values() for table in tables} - {None}
    known = powers(list(numbers)) if numbers else "a number that the file does not say"
    if len(numbers) > 1 and rotor.reynolds_number:
        known += f", taken at {powers(rotor.reynolds_number)}"
    how = "whatever the speed"
    if isinstance(found.plant.polar, LocalReynolds):
        how, (low, high) = "which follow them", np.exp(found.plant.polar.log_reynolds[[0, -1]])
        met = found.reynolds
        off = np.any((met < 0.99 * low) | (met > 1.01 * high), axis=0)
        if np.any(off):
            warn(
                f"Reynolds numbers at {found.places(off)} are {powers(met[:, off])}, and the "
                f"polars' tables run from {powers((low, high))}: beyond them the nearest holds"
            )
    thickness = 100.0 * np.asarray(found.physics.thickness)
    return {
        "sections": f"{', '.join(polars)}; {span(thickness, '%', 3)} thick",
        "angles of attack": f"{span(np.rad2deg(found.met), 'deg', 3)} along the blade in this flow",
        "Reynolds numbers": f"{powers(found.reynolds)} along the blade; polars for {known}, {how}",
    }


def _polars(rotor) -> dict[str, tuple]:
    """Return the tables of the rotor's polars, by name of polar or section."""
    if not rotor.sections and rotor.polar is None and rotor.chord is None:
        own = {each.name: each.polars for each in read_blade(rotor.blade, hub_radius=0.0).sections}
        if own:
            return own
    sources = [section.polar for section in rotor.sections] or [rotor.polar or POLAR]
    return {Path(source).name: read_polars(source) for source in sources}


def _flow(found: Findings, by_default: bool, warn) -> dict[str, str]:
    """Tell the flow; warn of a cutoff that segments, disc or rotor cannot follow."""
    phase, cutoff, flow = found.case.phase, found.cutoff, found.case.inflow
    radius, changes = found.plant.blade.rotor_radius, "none: it is steady"
    if cutoff:
        period = quantity(1.0 / cutoff, "s", 3)
        changes = f"up to {cutoff:.3g} Hz, a period of {period}"
        sampled = any(hasattr(part, "cutoff") for part in getattr(flow, "parts", (flow,)))
        error = max(float(np.sum(each.flow_errors)) for each in found.physics.scenarios)
        if error > FLOW_ERROR:
            warn(
                f"{_segments(found)} segments leave the integral of v³ "
                f"uncertain by {error:.1g}, more than {FLOW_ERROR:g}: give a shorter phase.duration"
                + (", or a lower cutoff" if sampled else "")
            )
        eddies = found.mean / (2.0 * radius)
        if sampled and cutoff > EDDY * eddies:
            warn(
                f"the flow has frequencies up to {cutoff:.3g} Hz, and a rotor averages over eddies "
                f"smaller than itself: a cutoff of {eddies:.2g} Hz, mean speed over diameter, "
                "leaves them out"
            )
        shortest = 1.0 / (2.0 * np.pi * cutoff)
        if found.time_constant is not None and found.time_constant > shortest:
            warn(
                f"the flow changes faster, within {quantity(shortest, 's', 3)} (1 / (2 pi "
                f"cutoff)), than the rotor follows, {quantity(found.time_constant, 's', 3)}: it "
                "will capture less than the quasi-steady figures"
            )
    why = "as the case says"
    if by_default:
        why = "the length of the flow's data" if flow.length else "by default: the flow has no end"
    return {
        "kind": flow_words(flow),
        "speed": f"{span(found.speed, 'm/s')}, mean {found.mean:.4g} m/s, standard deviation "
        f"{found.deviation:.3g} m/s ({100.0 * found.deviation / found.mean:.3g} %)",
        "time": f"{duration(phase.duration)}, {why}",
        "changes": changes,
        "power in it": f"{quantity(found.passing / (np.pi * radius**2), 'W')} a square metre on "
        f"average, {quantity(found.passing, 'W')} through the rotor",
    }


def _segments(found: Findings) -> int:
    return sum(each.segments for each in found.physics.scenarios)


def _control(found: Findings, warn) -> dict[str, str]:
    """Tell the law; warn of a torque limit and of a gain that were hardly meant."""
    control, law, limit = found.case.control, found.physics.law, found.physics.torque_limit
    rows = {"law": _first_line(control) or control.law, "torque limit": "none"}
    if limit is not None:
        rows["torque limit"] = quantity(limit, "N m")
        fastest = found.fastest
        speed = found.best.tip_speed_ratio * fastest / found.plant.blade.rotor_radius
        if not found.above_rated:
            warn(
                f"control.torque_limit = {quantity(limit, 'N m')} is more than the flow gives: at "
                "its best tip speed ratio the starting blade has "
                f"{quantity(found.torque(speed, fastest), 'N m')} in the fastest flow, "
                f"{fastest:.4g} m/s"
            )
    if law is not None:
        if limit is not None:
            rows["torque limit"] += f", approached smoothly (smoothing {control.smoothing:g})"
        gains = amounts(found.start.gains, law.gain_units, digits=4)
        own = law.starting_gains() is None
        how = "suits the starting blade; the run finds its own" if own else "as the case says"
        rows["gain at the start"] = f"{gains}: {how}"
        if found.running and found.captured < WASTED:
            key = "a gain" if own else f"control.gain = {span(law.starting_gains())}"
            if own and found.case.design.gain_bounds:
                key += f" within design.gain_bounds = {span(found.case.design.gain_bounds)}"
            warn(
                f"{key} lets the starting blade capture "
                f"{100.0 * found.captured:.2g} % of what its largest power coefficient gives"
            )
    initial = found.case.phase.initial_speed
    free = initial == "free" or (initial == "auto" and law is None)
    balance = "hydrodynamic and control torque balance"
    return rows | {"at t = 0": "the rotor's speed is free" if free else balance}


def _start(found: Findings, warn) -> dict[str, str]:
    """Tell what the starting blade does; warn if that is little, or if it does not turn."""
    best, mean, case = found.best, found.mean, found.case
    if best.power_coefficient < POOR:
        warn(
            f"the starting blade's power coefficient is {best.power_coefficient:.3g} at most: look "
            "at the sign and unit of its twist, at rotor.set_angle and at the polar"
        )
    speed = best.tip_speed_ratio * mean / found.plant.blade.rotor_radius
    torque = found.torque(speed, mean)
    rows = {
        "largest power coefficient": f"{best.power_coefficient:.4f} at a tip speed ratio of "
        f"{best.tip_speed_ratio:.3g}",
        "there, in the mean flow": f"{quantity(torque * speed, 'W')} at {mean:.4g} m/s: "
        f"{quantity(torque, 'N m')}, {turning(speed)}",
    }
    if np.isfinite(found.rated_speed):
        power = found.physics.torque_limit * speed * found.rated_speed / mean
        rows["there, at the torque limit"] = (
            f"{quantity(power, 'W')} at {found.rated_speed:.4g} m/s; flow above it: "
            f"{100.0 * found.above_rated:.3g} % of the time"
        )
    if found.running:
        rows["under the control law"] = (
            f"tip speed ratio {span(found.working, digits=3)}; "
            f"{quantity(found.start.operation.energy, 'J')} if it followed the flow at once, "
            f"{100.0 * found.captured:.3g} % of what the largest power coefficient gives"
        )
    else:
        rows["under the control law"] = "it does not turn unstalled throughout this flow"
        given = " and this gain" if getattr(case.control, "gain", None) is not None else ""
        if not given and case.design.gain_bounds:
            given = f" with a gain within design.gain_bounds = {span(case.design.gain_bounds)}"
        looks = "with this blade a run may find no solution"
        if found.physics.shape.designs_chord and case.start.method == "quasi_steady":
            looks = "the run looks for one that does"
        warn(
            "the starting blade does not turn unstalled throughout this flow under this law"
            f"{given}: {looks}"
        )
    if found.time_constant is not None:
        how = "the rotor's own" if found.physics.law is None else "of rotor and control law"
        constant = f"{quantity(found.time_constant, 's', 3)}, {how}, at {mean:.4g} m/s and "
        rows["time constant"] = constant + turning(found.steady_speed)
    return rows


def _optimization(found: Findings, package: str, warn) -> dict[str, str]:
    """Tell the size of the problem and its bounds; warn of those that the start breaks."""
    phase, hydro, driver = found.case.phase, found.case.hydrodynamics, found.case.driver
    size, length = problem_size(found.physics, found.best), phase.duration / phase.segments
    segments, periods = _segments(found), ""
    if segments > phase.segments:
        periods = f", divided into {segments} where the flow changes fast"
    elif found.cutoff:
        periods = f" ({1.0 / (found.cutoff * length):.3g} in the flow's shortest period)"
    free, constant = found.physics.law is None, found.time_constant or np.inf
    if phase.transcription == "radau" and not free and length > 2.0 * constant:
        warn(
            f"phase.transcription = radau with segments of {quantity(length, 's', 3)}, longer than "
            f"twice the time constant, {quantity(constant, 's', 3)}, converges to false speeds: "
            "give gauss-lobatto, or as many phase.segments"
        )
    torque = "at every node of the trajectory"
    if found.physics.has_curve:
        torque = "as a curve over the tip speed ratio, one for each blade"
    rows = {
        "segments": f"{min(segments, phase.segments)} of {quantity(length, 's', 3)}{periods}, "
        f"{phase.transcription} of order {phase.order}: {size.nodes} nodes",
        "unknowns": _sizes(size.unknowns),
        "constraints": _sizes(size.constraints),
        "torque": f"{torque}, by BEM: {hydro.bem}; in the simulation {hydro.check}",
        "objective": _first_line(found.case.objective) or found.case.objective.kind,
        "optimizer": f"{driver.optimizer} of {package}, to {driver.tolerance:g}",
        "an evaluation": f"about {quantity(size.evaluation_seconds, 's', 2)} on this machine, "
        "derivatives included",
    }
    point = found.start
    control = found.physics.shape.control(point.blade)
    control = dict(zip(found.physics.shape.points, control, strict=True))
    values = designed(found.physics, point) | control
    metres, degrees, plain = ("m", 1.0), ("deg", np.rad2deg(1.0)), ("", 1.0)
    in_case = {"chord": metres, "twist": degrees, "set_angle": degrees, "gain": plain}
    in_case["thickness"] = plain
    in_case["radius"] = "m", 1.0 / np.cos(point.blade.cone)
    for limit in found.physics.limits:
        if not isinstance(limit, DesignBounds):
            continue
        key, (unit, scale) = f"design.{limit.name}_bounds", in_case[limit.name]
        value = scale * limit.value_of(values)
        words = f"at least {number(scale * limit.lower)} and at most {number(scale * limit.upper)}"
        rows[key] = f"{f'{words} {unit}'.rstrip()}; {span(value)} with the starting blade"
        if np.max(limit.excess(values)) > KEPT:
            warn(f"{key} is broken at the start, {rows[key]}: the run moves it inside")
    return rows


def _limits(found: Findings, warn) -> dict[str, str]:
    """Tell by how much the starting blade keeps or breaks each limit, and its other loads.

    In quasi-steady operation under the control law; warn of limits that are broken.
    """
    rows, values, limited = {}, found.at_start, set()
    for limit in found.physics.limits:
        endless = not np.isfinite(limit.upper) and limit.lower <= 0.0
        if isinstance(limit, DesignBounds) or endless:
            continue
        key = "control.torque_limit" if isinstance(limit, TorqueLimit) else f"limits.{limit.name}"
        limited.add(limit.name)
        rows[key] = _bounds(limit)
        if found.running or limit.place != "time":
            rows[key] += f"; {_kept(limit, limit.value_of(values))}"
            if np.max(limit.excess(values)) > START_EXCESS:
                warn(f"{key} is broken at the start, {rows[key]}: the run moves it inside")
    if found.running:
        for name, entry in loads.largest([values]).items():
            if name not in limited:
                rows[f"largest {name.replace('_', ' ')}"] = str(entry)
        deflection = loads.tip_deflection(found.physics, found.start.blade, [values])
        if deflection is not None:
            rows["largest tip deflection"] = bent(deflection, found.start.blade.tip_radius)
    return rows


def _bounds(limit: Limit) -> str:
    """Return the bounds of a limit; none below that is zero."""
    ends = {"at least": limit.lower, "at most": limit.upper}
    told = {word: float(end) for word, end in ends.items() if np.isfinite(end)}
    if told.get("at least") == 0.0:
        del told["at least"]
    return " and ".join(f"{word} {measured(x, limit.unit or '', 4)}" for word, x in told.items())


def _kept(limit: Limit, value) -> str:
    """Return the range of a limited value, and by how much it is kept or broken."""
    unit, value = limit.unit or "", np.atleast_1d(value)
    ends = dict.fromkeys(measured(float(end(value)), unit, 4) for end in (np.min, np.max))
    bounds = [(limit.lower - value, limit.lower), (value - limit.upper, limit.upper)]
    over, bound = max((float(np.max(each)), abs(float(bound))) for each, bound in bounds)
    told = f"{' to '.join(ends)}: "
    if abs(over) <= START_EXCESS * bound:
        return told + "at the limit"
    share = f" ({100.0 * abs(over) / bound:.3g} %)" if bound else ""
    return f"{told}{'broken' if over > 0.0 else 'kept'} by {measured(abs(over), unit, 3)}{share}"


def _first_line(kind) -> str:
    """Return the first line of the docstring of a law or an objective."""
    return (type(kind).__doc__ or "").strip().partition("\n")[0].rstrip(".")


def _sizes(sizes: dict[str, int]) -> str:
    """Return a total and what it is made of, by the last parts of the names in the problem."""
    lasts = (name.removesuffix(".value").rpartition(".")[2] for name in sizes)
    parts = [f"{size} {last}" for size, last in zip(sizes.values(), lasts, strict=True)]
    return f"{sum(sizes.values())}: {', '.join(parts) or 'none'}"
