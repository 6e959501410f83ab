"""What `hkt check` tells before a run: all that a run needs is read and built, nothing optimized.

The figures are those of `hkt_mdo.run.findings`; here they are put into words, with what was done to
the files and what their author may not have meant.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from hkt_mdo.case import Case, Quantity
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.polar import read_polars
from hkt_mdo.problem.build import (
    MOST_SEGMENTS,
    SEGMENTS_PER_PERIOD,
    complete,
    has_curve,
    make_driver,
    physics,
)
from hkt_mdo.problem.turbine import POLAR
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.shape import spline_basis
from hkt_mdo.run.findings import (
    ITERATIONS,
    MARGIN,
    PASSES,
    Cost,
    Findings,
    ProblemSize,
    Range,
    examine,
    expected_cost,
    problem_size,
    torque_at,
)

Rows = list[tuple[str, str]]

FIT = 0.02, float(np.deg2rad(0.5))
"""How far splines may leave chord (over the largest) and twist (rad) of the blade's file."""

POOR = 0.2
"""Largest power coefficient, below which a blade was hardly meant as it stands."""

LIGHT = 0.02
"""Share of the torque, below which stations outside their polars' tables are but noted."""

WASTED = 0.5
"""Share of what a blade can capture, below which a gain was hardly meant."""

OUTERMOST = 0.9
"""Radius of the last station over the tip radius, below which a part of the blade is missing."""

EDDY = 1.25
"""Cutoff times diameter over flow speed, above which eddies are smaller than the rotor."""


@dataclass(frozen=True, eq=False)
class CheckReport:
    """What a case means, and what a run of it would take.

    Parameters
    ----------
    name : str
        Of the case.
    tables : dict of str to list of (str, str)
        By title: rows of what, and what there is to say of it.
    notes : tuple of str
        What was converted, repaired or left out of the files.
    warnings : tuple of str
        What the author may not have meant; the case runs all the same.
    findings : Findings
    size : ProblemSize
    cost : Cost
    figures : dict of str to dict
        What `hkt_mdo.results.check_plots` draws: blade, polar, inflow and power_curve.
    """

    name: str
    tables: dict[str, Rows]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    findings: Findings
    size: ProblemSize
    cost: Cost
    figures: dict[str, dict]


def check_case(case: Case) -> CheckReport:
    """Read and build all that a run of a case needs, and tell what it means; nothing is optimized.

    Parameters
    ----------
    case : Case

    Returns
    -------
    CheckReport

    Raises
    ------
    InputError
        If a file of the case is broken, files do not fit each other, or the optimizer that the case
        asks for is not installed.
    """
    whole = complete(case)
    world = physics(whole)
    package = make_driver(whole).package
    found = examine(whole, world)
    size = problem_size(found.case, world, found.best)
    cost = expected_cost(found, size)
    met = _Met.of(found)
    told, notes = met.told()
    tables = {
        "Turbine": [*_turbine_rows(found), *met.rows()],
        "Flow": _flow_rows(found, case.phase.duration is None),
        "Control": _control_rows(found),
        "Starting blade": _start_rows(found),
        "Optimization": _optimization_rows(found, size, package),
        "A run on this machine": _cost_rows(size, cost),
    }
    warnings = (
        *_start_warnings(found),
        *_design_warnings(found),
        *told,
        *_flow_warnings(found),
        *_memory_warnings(cost),
    )
    figures = {
        "blade": _blade_data(found),
        "polar": met.data(),
        "inflow": _inflow_data(found),
        "power_curve": _power_data(found),
    }
    notes = (*world.messages, *notes)
    return CheckReport(case.name, tables, notes, warnings, found, size, cost, figures)


# What the stations meet ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Met:
    """Angles of attack (rad) and Reynolds numbers at the stations, beside the polars' tables.

    low, high : shape (n_stations,), in the starting blade's operation; margin_low, margin_high,
    within `MARGIN` of its best tip speed ratio; table_low, table_high, where polars were measured;
    reynolds, shape (2, n_stations), at the slowest and the fastest; unsolved, stations without a
    root; weight, shape (n_stations,), largest share of a station in the torque, without signs.
    """

    found: Findings
    low: np.ndarray
    high: np.ndarray
    margin_low: np.ndarray
    margin_high: np.ndarray
    table_low: np.ndarray
    table_high: np.ndarray
    reynolds: np.ndarray
    unsolved: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, found: Findings) -> "_Met":
        """Run the starting blade by BEM over its tip speed ratios."""
        blade, polar, cosine = found.world.blade, found.world.polar, np.cos(found.world.blade.cone)
        margin = [side * found.best.tip_speed_ratio for side in MARGIN]
        working, beyond = (
            bem.sections(blade, polar, np.linspace(*ends, 31) / cosine)
            for ends in (found.working, margin)
        )
        tables = [_tables(polar, station) for station in range(blade.r.size)]
        ratio = np.array(found.working)[:, None] / cosine * blade.r / blade.tip_radius
        flow = np.array([[found.speed.min()], [found.speed.max()]]) * cosine
        torque = np.abs(bem.torque_weights(blade) * working.tangential_load)
        return cls(
            found,
            working.angle_of_attack.min(axis=0),
            working.angle_of_attack.max(axis=0),
            beyond.angle_of_attack.min(axis=0),
            beyond.angle_of_attack.max(axis=0),
            np.array([max(each.alpha_min for each in table) for table in tables]),
            np.array([min(each.alpha_max for each in table) for table in tables]),
            blade.chord * flow * np.hypot(1.0, ratio) / found.case.fluid.kinematic_viscosity,
            np.flatnonzero(np.any(working.branch < 0, axis=0)),
            np.max(torque / torque.sum(axis=1, keepdims=True), axis=0),
        )

    def told(self) -> tuple[list[str], list[str]]:
        """Return warnings and notes."""
        found, warnings, notes = self.found, [], []
        if self.unsolved.size:
            warnings.append(
                "blade element momentum theory has no solution at "
                f"{_stations(found, self.unsolved)} of the starting blade: no load counts there"
            )
        low, high = (f"{side * found.best.tip_speed_ratio:.3g}" for side in MARGIN)
        outside, weight = self._outside(self.low, self.high)
        wider, _ = self._outside(self.margin_low, self.margin_high)
        if outside:
            kind = warnings if weight > LIGHT else notes
            kind.append(f"{outside}, at tip speed ratios of {_span(found.working, digits=3)}")
        elif wider:
            notes.append(f"{wider}, should the tip speed ratio be {low} or {high}")
        if isinstance(found.world.polar, bem.LocalReynolds):
            low, high = np.exp(found.world.polar.log_reynolds[[0, -1]])
            off = np.any((self.reynolds < 0.99 * low) | (self.reynolds > 1.01 * high), axis=0)
            if np.any(off):
                warnings.append(
                    f"Reynolds numbers at {_stations(found, off)} are "
                    f"{_powers(self.reynolds[:, off])}, and the polars' tables run from "
                    f"{_powers((low, high))}: beyond them the nearest table holds"
                )
        return warnings, notes

    def _outside(self, low: np.ndarray, high: np.ndarray) -> tuple[str, float]:
        """Tell which stations leave their polar's table, if any, and their share of the torque."""
        above, below = high - self.table_high, self.table_low - low
        over = np.maximum(above, below)
        stations = np.flatnonzero(over > 1e-9)
        if not stations.size:
            return "", 0.0
        worst, weight = int(np.argmax(over)), float(self.weight[stations].sum())
        angle = np.rad2deg(high[worst] if above[worst] >= below[worst] else low[worst])
        table = np.rad2deg([self.table_low[worst], self.table_high[worst]])
        who = f"{_count(stations.size, 'station')} at {_stations(self.found, stations)}"
        return (
            f"{who} with {_number(100.0 * weight, 2)} % of the torque: beyond the polar's table, "
            f"{_span(table)} deg, in Viterna's extension, with angles of attack up to "
            f"{angle:.3g} deg",
            weight,
        )

    def rows(self) -> Rows:
        """Return rows of the turbine's table."""
        low, high = np.rad2deg([self.low.min(), self.high.max()])
        return [
            ("angles of attack", f"{low:.3g} to {high:.3g} deg along the blade in this flow"),
            ("Reynolds numbers", f"{_powers(self.reynolds)} along the blade; {self._of_polars()}"),
        ]

    def _of_polars(self) -> str:
        """Return the Reynolds numbers that the polars are for."""
        polar, rotor = self.found.world.polar, self.found.case.rotor
        if isinstance(polar, bem.LocalReynolds):
            return f"the polars follow them, by tables for {_powers(np.exp(polar.log_reynolds))}"
        known = _polar_numbers(self.found.case)
        if not known:
            return "the polar holds at all: its file does not say for which"
        if len(known) == 1:
            return f"the polar is for {_powers(known)}, whatever the speed"
        at = "" if rotor.reynolds_number is None else f", taken at {_powers(rotor.reynolds_number)}"
        return f"the polars are for {_powers(known)}{at}, whatever the speed"

    def data(self) -> dict:
        """Return different polars, root to tip, with the angles (deg) that their stations meet."""
        blade, polar = self.found.world.blade, self.found.world.polar
        groups: dict[tuple[Polar, ...], list[int]] = {}
        for station in range(blade.r.size):
            groups.setdefault(_tables(polar, station), []).append(station)
        alpha, curves = np.linspace(-40.0, 50.0, 361), []
        for tables, stations in groups.items():
            where = "all stations" if len(groups) == 1 else _stations(self.found, stations)
            for number, table in enumerate(tables):
                label = where
                if isinstance(polar, bem.LocalReynolds):
                    label += f", Re {_powers(np.exp(polar.log_reynolds[number]))}"
                lift, drag = table.evaluate(np.deg2rad(alpha))
                curves.append(
                    {
                        "label": label,
                        "alpha_deg": alpha,
                        "lift": lift,
                        "drag": drag,
                        "table_deg": np.rad2deg([table.alpha_min, table.alpha_max]),
                    }
                )
        return {
            "curves": curves,
            "met_deg": np.rad2deg([self.low.min(), self.high.max()]),
        }


def _tables(polar, station: int) -> tuple[Polar, ...]:
    """Return the polars of a station, one a Reynolds number."""
    if isinstance(polar, bem.LocalReynolds):
        return polar.polars[station]
    return (bem.polar_at(polar, station),)


def _own_sections(case: Case) -> tuple:
    """Return the sections that the blade's file brings with it, unless the case gives others."""
    rotor = case.rotor
    if rotor.sections or rotor.polar is not None or rotor.chord is not None:
        return ()
    return read_blade(rotor.blade, hub_radius=0.0).sections


def _polar_numbers(case: Case) -> list[float]:
    """Return the Reynolds numbers that the polars of a rotor state."""
    own, sources = _own_sections(case), [section.polar for section in case.rotor.sections]
    tables = [table for section in own for table in section.polars]
    if not tables:
        sources = sources or [case.rotor.polar or POLAR]
        tables = [table for source in sources for table in read_polars(source)]
    return sorted({table.reynolds for table in tables if table.reynolds is not None})


# Rows of the tables -------------------------------------------------------------------------------


def _turbine_rows(found: Findings) -> Rows:
    rotor, blade = found.case.rotor, found.world.blade
    hub = f"hub {blade.hub_radius:.4g} m ({blade.hub_radius / blade.tip_radius:.3g} R)"
    cone = f", coned by {np.rad2deg(blade.cone):.3g} deg" if blade.cone else ""
    source = "given in the case" if rotor.chord is not None else Path(rotor.blade).name
    own = [section.name for section in _own_sections(found.case)]
    sections = [Path(section.polar).name for section in rotor.sections] or own
    names = ", ".join(sections) or Path(rotor.polar or POLAR).name
    thickness = _span(100.0 * np.atleast_1d(found.turbine.thickness), "%", 3)
    besides = f", and {rotor.hub_inertia:g} kg m^2 besides" if rotor.hub_inertia else ""
    return [
        (
            "rotor",
            f"{_count(blade.blade_count, 'blade')}, tip radius {blade.tip_radius:.4g} m, {hub}"
            f"{cone}; in water of {found.case.fluid.density:g} kg/m^3",
        ),
        (
            "blade at the start",
            f"{source}: {blade.r.size} stations at {_stations(found, slice(None))}, chord "
            f"{_span(blade.chord, 'm')}, twist {_span(np.rad2deg(blade.twist), 'deg', 3)}",
        ),
        ("sections", f"{names}; {thickness} thick"),
        ("designed", "; ".join(_designed(found)) or "nothing of the blade"),
        (
            "mass, inertia",
            f"{_number(found.mass)} kg and {_number(found.inertia)} kg m^2: solid blades of "
            f"{rotor.material_density:g} kg/m^3{besides}",
        ),
    ]


def _designed(found: Findings) -> list[str]:
    """Return what of the blade is designed, with its bounds."""
    shape, design, words = found.world.shape, found.case.design, []
    if shape.designs_chord:
        for name, unit in (("chord", "m"), ("twist", "deg")):
            points, stations = shape.points[name], shape.blade.r.size
            where = f"at {stations} stations" if points == stations else f"by {points} points"
            words.append(f"{name} {where}, {_span(getattr(design, f'{name}_bounds'), unit)}")
    if shape.designs_set_angle:
        words.append(f"set angle, {_span(design.set_angle_bounds, 'deg')}")
    if shape.radius_bounds is not None:
        words.append(f"tip radius, {_span(design.radius_bounds, 'm')}")
    return words


def _flow_rows(found: Findings, by_default: bool) -> Rows:
    case, duration = found.case, found.case.phase.duration
    why = "as the case says"
    if by_default:
        endless = getattr(found.world.inflow, "duration", None) is None
        why = "by default, for the flow has no end" if endless else "the length of the flow's data"
    changes = "none: it is steady"
    if found.cutoff:
        changes = f"up to {found.cutoff:.3g} Hz, a period of {_seconds(1.0 / found.cutoff)}"
    flux = 0.5 * case.fluid.density * found.mean_cube
    through = _large(flux * np.pi * found.world.blade.rotor_radius**2, "W")
    return [
        ("kind", _flow_words(case.inflow)),
        (
            "speed",
            f"{_span(found.speed, 'm/s')}, mean {found.mean:.4g} m/s, standard deviation "
            f"{found.deviation:.3g} m/s ({100.0 * found.deviation / found.mean:.3g} %)",
        ),
        ("time", f"{_duration(duration)}, {why}"),
        ("changes", changes),
        (
            "power in it",
            f"{_large(flux, 'W')} a square metre on average, {through} through the rotor",
        ),
    ]


def _control_rows(found: Findings) -> Rows:
    control, law, case = found.case.control, found.world.law, found.case
    limit = "none"
    if control.torque_limit is not None:
        limit = _large(control.torque_limit, "N m")
        if law is not None:
            limit += f", approached smoothly (smoothing {control.smoothing:g})"
    said = (type(control).__doc__ or control.law).strip().partition("\n")[0].rstrip(".")
    rows = [("law", said), ("torque limit", limit)]
    initial = case.phase.initial_speed
    if law is not None:
        gains = ", ".join(
            f"{_number(gain)} {unit.replace('**', '^').replace('*', ' ')}"
            for gain, unit in zip(found.start.gains, law.gain_units, strict=True)
        )
        how = "as the case says"
        if getattr(control, "gain", None) is None:
            how = "suits the starting blade; the run finds its own"
        rows.append(("gain at the start", f"{gains}: {how}"))
    if case.design.gain_bounds is not None:
        rows.append(("gain", f"{_span(case.design.gain_bounds)}, in the same unit"))
    free = initial == "free" or (initial == "auto" and law is None)
    balance = "hydrodynamic and control torque balance"
    rows.append(("at t = 0", "the rotor's speed is free" if free else balance))
    return rows


def _start_rows(found: Findings) -> Rows:
    world, best, mean = found.world, found.best, found.mean
    speed = best.tip_speed_ratio * mean / world.blade.rotor_radius
    torque = torque_at(found.plant, speed, mean)
    rows = [
        (
            "largest power coefficient",
            f"{best.power_coefficient:.4f} at a tip speed ratio of {best.tip_speed_ratio:.3g}",
        ),
        (
            "there, in the mean flow",
            f"{_large(torque * speed, 'W')} at {mean:.4g} m/s: {_large(torque, 'N m')}, "
            f"{_turning(speed)}",
        ),
    ]
    if found.rated_speed is not None:
        often = f"{100.0 * found.above_rated:.3g} % of the time" if found.above_rated else "never"
        rows.append(
            (
                "there, at the torque limit",
                f"{_large(found.rated_power, 'W')} at {found.rated_speed:.4g} m/s; flow above it: "
                f"{often}",
            )
        )
    if found.start.operation.running:
        rows.append(
            (
                "under the control law",
                f"tip speed ratio {_span(found.working, digits=3)}; "
                f"{_large(found.start.operation.energy, 'J')} if it followed the flow at once, "
                f"{100.0 * found.captured:.3g} % of what the largest power coefficient gives",
            )
        )
    else:
        rows.append(("under the control law", "it does not turn unstalled throughout this flow"))
    if found.time_constant is not None:
        how = "the rotor's own" if world.law is None else "of rotor and control law"
        rows.append(
            (
                "time constant",
                f"{_seconds(found.time_constant)}, {how}, at {mean:.4g} m/s and "
                f"{_turning(found.steady_speed)}",
            )
        )
    return rows


def _optimization_rows(found: Findings, size: ProblemSize, package: str) -> Rows:
    phase, hydro, driver = found.case.phase, found.case.hydrodynamics, found.case.driver
    length = phase.duration / phase.segments
    periods = ""
    if found.cutoff:
        periods = f" ({1.0 / (found.cutoff * length):.3g} in the flow's shortest period)"
    name = {"gauss-lobatto": "Gauss-Lobatto", "radau": "Radau"}[phase.transcription]
    torque = "at every node of the trajectory"
    if has_curve(found.case, found.world):
        torque = "as a curve over the tip speed ratio, one for each blade"
    solver = {"vectorized": "this package's BEM", "ccblade": "CCBlade"}
    check = "too" if hydro.check == hydro.bem else f"by {solver[hydro.check]}"
    return [
        (
            "segments",
            f"{phase.segments} of {_seconds(length)}{periods}, {name} of order {phase.order}: "
            f"{size.nodes} nodes",
        ),
        ("unknowns", _sizes(size.unknowns, found.world.shape.designs_set_angle)),
        ("constraints", _sizes(size.constraints)),
        ("torque", f"{torque}, by {solver[hydro.bem]}; in the simulation {check}"),
        (
            "optimizer",
            f"{driver.optimizer} of {package}, to {driver.tolerance:g}, for the captured energy",
        ),
    ]


def _cost_rows(size: ProblemSize, cost: Cost) -> Rows:
    spent = _time_span(cost.integration_seconds)
    return [
        ("time", f"about {_time_span(cost.seconds)}, {spent} of it to integrate independently"),
        ("memory", f"about {_memory_span(cost.memory_bytes)}"),
        (
            "as measured runs tell",
            f"{PASSES[0]} or {PASSES[1]} passes of {ITERATIONS[0]} to {ITERATIONS[1]} iterations, "
            "unless it loses its way; an evaluation with its derivatives takes "
            f"{_seconds(size.evaluation_seconds)} here",
        ),
    ]


# Warnings -----------------------------------------------------------------------------------------


def _start_warnings(found: Findings) -> Iterator[str]:
    """Yield what speaks against torque limit, law and gain."""
    case, limit = found.case, found.world.torque_limit
    fastest, most = float(found.speed.max()), found.best.power_coefficient
    if most < POOR:
        yield (
            f"the starting blade's power coefficient is {most:.3g} at most: look at the sign and "
            "unit of its twist, at rotor.set_angle and at the polar"
        )
    if limit is not None and not found.above_rated:
        speed = found.best.tip_speed_ratio * fastest / found.world.blade.rotor_radius
        most = _large(torque_at(found.plant, speed, fastest), "N m")
        yield (
            f"control.torque_limit = {_large(limit, 'N m')} is more than the flow gives: at its "
            f"best tip speed ratio the starting blade has {most} in the fastest flow, "
            f"{fastest:.4g} m/s"
        )
    gain = getattr(case.control, "gain", None)
    if found.start.operation.running and gain is not None and found.captured < WASTED:
        yield (
            f"control.gain = {_span(gain)} lets the starting blade capture "
            f"{100.0 * found.captured:.2g} % of what its largest power coefficient gives"
        )
    if not found.start.operation.running:
        given = " and this gain" if gain is not None else ""
        looks = "with this blade a run may find no solution"
        if found.world.shape.designs_chord and case.start.method == "quasi_steady":
            looks = "the run looks for one that does"
        yield (
            "the starting blade does not turn unstalled throughout this flow under this law"
            f"{given}: {looks}"
        )


def _design_warnings(found: Findings) -> Iterator[str]:
    """Yield what speaks against bounds, which may leave out the start, and control points."""
    shape, design, blade = found.world.shape, found.case.design, found.world.blade
    chord, twist = shape.control(blade)
    starts = [
        ("radius_bounds", np.array([blade.tip_radius]), "m", "tip radius"),
        ("gain_bounds", found.start.gains, "", "gain"),
    ]
    if shape.designs_chord:
        starts += [
            ("chord_bounds", chord, "m", "chord"),
            ("twist_bounds", np.rad2deg(twist), "deg", "twist"),
        ]
    for key, value, unit, what in starts:
        bounds = getattr(design, key)
        if bounds is None:
            continue
        low, high = bounds
        if np.any((value < low - 1e-9 * abs(low)) | (value > high + 1e-9 * abs(high))):
            yield (
                f"design.{key} = [{low:g}, {high:g}] leaves out the {what} of the starting blade, "
                f"{_span(value, unit)}: the run moves it inside"
            )
    if blade.r[-1] < OUTERMOST * blade.tip_radius:
        yield (
            f"the outermost station is at {_stations(found, [-1])}, and the load falls to zero "
            "from there to the tip: give stations farther out, or look at rotor.radius"
        )
    given = found.turbine.blade
    for name, off, most, words in (
        (
            "chord",
            (blade.chord - given.chord) / given.chord.max(),
            FIT[0],
            "{:.2g} % of the largest",
        ),
        ("twist", blade.twist - given.twist, FIT[1], "{:.2g} deg"),
    ):
        worst = int(np.argmax(np.abs(off)))
        share = abs(off[worst])
        if share > most:
            words = words.format(100.0 * share if name == "chord" else np.rad2deg(share))
            yield (
                f"the spline through design.{name}_points = {shape.points[name]} "
                f"leaves the {name} of the blade's file by {words} at {_stations(found, [worst])}: "
                "the run begins with the spline; more points follow the file closer"
            )


def _flow_warnings(found: Findings) -> Iterator[str]:
    """Yield what speaks against the flow's cutoff: segments, rotor and disc may not follow."""
    phase, cutoff = found.case.phase, found.cutoff
    if not cutoff:
        return
    profiles = _profiles(found.case.inflow)
    sampled = bool({"record", "turbulence"} & profiles)
    wanted = int(np.ceil(SEGMENTS_PER_PERIOD * cutoff * phase.duration * (1.0 - 1e-9)))
    if phase.segments < wanted:
        each = phase.segments / (cutoff * phase.duration)
        yield (
            f"phase.segments = {phase.segments} gives {each:.2g} to the flow's shortest period, "
            f"{_seconds(1.0 / cutoff)}, and {SEGMENTS_PER_PERIOD:g} are wanted: give "
            + (f"{wanted}" if wanted <= MOST_SEGMENTS else "a shorter phase.duration")
            + (", or a lower cutoff" if sampled else "")
        )
    eddies = found.mean / (2.0 * found.world.blade.rotor_radius)
    if sampled and cutoff > EDDY * eddies:
        yield (
            f"the flow has frequencies up to {cutoff:.3g} Hz, and a rotor averages over eddies "
            f"smaller than itself: a cutoff of {eddies:.2g} Hz, mean speed over diameter, leaves "
            "them out"
        )
    shortest = 1.0 / (2.0 * np.pi * cutoff)
    if found.time_constant is not None and found.time_constant > shortest:
        yield (
            f"the flow changes faster, within {_seconds(shortest)} (1 / (2 pi cutoff)), than the "
            f"rotor follows, {_seconds(found.time_constant)}: it will capture less than the "
            "quasi-steady figures above"
        )


def _memory_warnings(cost: Cost) -> Iterator[str]:
    """Yield a word where a run may not fit into this machine."""
    try:
        installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not on every system
        return
    if cost.memory_bytes[1] > 0.9 * installed:
        yield (
            f"a run may need {_memory_span(cost.memory_bytes)} of memory, and this machine has "
            f"{_memory_span((installed, installed))}: give a shorter phase.duration, fewer "
            "phase.segments or a lower cutoff"
        )


# Data of the figures ------------------------------------------------------------------------------


def _blade_data(found: Findings) -> dict:
    """Return the starting blade, and control points beside the file's blade where there are any."""
    shape, blade, given = found.world.shape, found.world.blade, found.turbine.blade
    data = {
        "r_m": blade.r,
        "ends_m": (blade.hub_radius, blade.tip_radius),
        "chord_m": blade.chord,
        "twist_deg": np.rad2deg(blade.twist),
        "thickness_percent": 100.0 * np.broadcast_to(found.turbine.thickness, blade.r.shape),
    }
    chord, twist = shape.control(blade)
    for name, points, control, file in (
        ("chord_m", shape.points["chord"], chord, given.chord),
        ("twist_deg", shape.points["twist"], np.rad2deg(twist), np.rad2deg(given.twist)),
    ):
        if shape.designs_chord and points < blade.r.size:
            # they stand where their own spline is the radius itself
            dense = np.linspace(blade.hub_radius, blade.tip_radius, 8 * points)
            basis = spline_basis(points, dense, blade.hub_radius, blade.tip_radius)
            places = np.linalg.lstsq(basis, dense, rcond=None)[0]
            data |= {f"{name}_points": (places, control), f"{name}_file": file}
    return data


def _inflow_data(found: Findings) -> dict:
    """Return the flow, thinned for drawing, and its spectrum."""
    thin = -(-found.time.size // 20_000)
    data = {
        "time_s": found.time[::thin],
        "speed_m_s": found.speed[::thin],
        "mean_m_s": found.mean,
        "rated_m_s": found.rated_speed,
        "cutoff_hz": found.cutoff or None,
    }
    if found.deviation > 1e-9 * found.mean:
        data["spectrum"] = power_spectrum(found.speed, float(found.time[1]))
    return data


def power_spectrum(speed: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (Hz) and the one-sided power spectral density (m²/s² per Hz) of a flow.

    A periodogram under Hann's window after the mean is taken out, averaged over twelfths of an
    octave.

    Parameters
    ----------
    speed : array, shape (n,), m/s
        Even samples.
    step : float, s
    """
    window = np.hanning(speed.size)
    rest = speed - window @ speed / window.sum()
    density = 2.0 * step * np.abs(np.fft.rfft(rest * window))[1:] ** 2 / np.sum(window**2)
    frequency = np.fft.rfftfreq(speed.size, step)[1:]
    band = np.floor(12.0 * np.log2(frequency / frequency[0]) + 1e-9).astype(int)
    _, band, count = np.unique(band, return_inverse=True, return_counts=True)
    return np.bincount(band, frequency) / count, np.bincount(band, density) / count


def _power_data(found: Findings) -> dict:
    """Return the starting blade's power curve and the range that it works in."""
    best = found.best
    ratios = np.linspace(0.2, 1.9, 171) * best.tip_speed_ratio
    return {
        "tip_speed_ratio": ratios,
        "power_coefficient": bem.rotor_coefficients(
            found.world.blade, found.world.polar, ratios
        ).power,
        "best": (best.tip_speed_ratio, best.power_coefficient),
        "working": found.working if found.start.operation.running else None,
    }


# Words --------------------------------------------------------------------------------------------


def _flow_words(section) -> str:
    """Return the kind of a flow and the values that make it."""
    if section.profile == "sum":
        return " + ".join(_flow_words(part) for part in section.parts)
    words = []
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if name == "file":
            words.insert(0, Path(value).name)
        elif name == "constituents":
            words += [each.name or _duration(each.period) for each in value]
        elif name != "profile" and value is not None and (name, value) not in _NEUTRAL:
            value = _span(value) if isinstance(value, tuple) else value
            value = f"{value:g}" if isinstance(value, float) else value
            words.append(f"{name.replace('_', ' ')} {value} {_unit(field)}".rstrip())
    return f"{section.profile}: {', '.join(words)}"


_NEUTRAL = (
    ("start", 0.0),
    ("phase", 0.0),
    ("scale", 1.0),
    ("gaps", "refuse"),
    ("spikes", "refuse"),
    ("uneven", "refuse"),
)
"""Values of a flow that change nothing."""


def _unit(field) -> str:
    """Return the unit of a key of a case; nothing where it has none."""
    places = [getattr(field, "metadata", ())]
    places += [getattr(part, "__metadata__", ()) for part in get_args(field.annotation)]
    for mark in (mark for place in places for mark in place):
        if isinstance(mark, Quantity) and mark.unit:
            return mark.unit.replace("**", "^").replace("*", " ")
    return ""


def _profiles(section) -> set[str]:
    """Return the kinds of flow that a flow is made of."""
    return {section.profile, *(part.profile for part in getattr(section, "parts", ()))}


_NAMES = {
    "chord_control": "chord",
    "twist_control": "twist",
    "rotor_radius": "radius",
    "rotor_speed": "rotor speed over time",
    "control_torque": "control torque over time",
    "rotor_acceleration[initial]": "balance at t = 0",
    "rotor_speed_rate[initial]": "balance at t = 0",
    "control_torque[path]": "range of the control torque",
    "defects:rotor_speed": "equation of motion",
    "recovery": "distance from stall",
}


def _sizes(sizes: dict[str, int], set_angle: bool = False) -> str:
    """Return a total and what it is made of, in words."""
    parts: dict[str, int] = {}
    for name, size in sizes.items():
        last = name.rpartition(".")[2]
        plain = last.rpartition(":")[2].removesuffix("_rate")
        words = _NAMES.get(last) or _NAMES.get(plain) or plain.replace("_", " ")
        if last.startswith("defect_control"):
            words = f"smoothness of the {words.removesuffix(' over time')}"
        elif last.startswith("gain_"):
            words = "gain"
        elif last == "twist_control" and set_angle:
            words = "set angle"
        parts[words] = parts.get(words, 0) + size
    listed = ", ".join(f"{size} {words}" for words, size in parts.items())
    return f"{sum(parts.values())}: {listed}" if parts else "none"


def _stations(found: Findings, chosen) -> str:
    blade = found.world.blade
    return f"r/R = {_span(blade.r[chosen] / blade.tip_radius)}"


def _number(value: float, digits: int = 4) -> str:
    """Return a number with so many digits, without a power of ten where it can be avoided."""
    return f"{float(f'{value:.{digits}g}'):.10g}"


def _span(values, unit: str = "", digits: int = 4) -> str:
    """Return the range of values with its unit."""
    low, high = (_number(end, digits) for end in (np.min(values), np.max(values)))
    return f"{low if low == high else f'{low} to {high}'} {unit}".rstrip()


def _powers(values) -> str:
    """Return the range of large numbers, such as 2e5 to 1.2e6."""
    texts = []
    for end in (np.min(values), np.max(values)):
        digits, _, power = f"{end:.1e}".partition("e")
        texts.append(f"{digits.removesuffix('.0')}e{int(power)}")
    return texts[0] if texts[0] == texts[1] else " to ".join(texts)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' if number != 1 else ''}"


def _large(value: float, unit: str) -> str:
    """Return a quantity in its unit, or thousands or millions of it."""
    for prefix, size in (("M", 1e6), ("k", 1e3)):
        if abs(value) >= size:
            return f"{value / size:.4g} {prefix}{unit}"
    return f"{value:.4g} {unit}"


def _turning(speed: float) -> str:
    return f"{speed:.4g} rad/s ({speed * 30.0 / np.pi:.3g} rpm)"


def _seconds(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if abs(seconds) < 0.1 else f"{seconds:.3g} s"


def _duration(seconds: float) -> str:
    """Return a time in s, and in what it is easier to grasp."""
    for unit, size in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds:g} s ({seconds / size:.3g} {unit})"
    return f"{seconds:g} s"


def _time_span(ends: Range) -> str:
    """Return a guessed time, with no more digits than it deserves."""
    unit, size = "s", 1.0
    for longer in (("min", 60.0), ("h", 3600.0)):
        unit, size = longer if ends[1] >= 1.5 * longer[1] else (unit, size)
    low, high = (f"{end / size:.0f}" if end >= size else f"{end / size:.1g}" for end in ends)
    return f"{low if low == high else f'{low} to {high}'} {unit}"


def _memory_span(ends: Range) -> str:
    unit, size = ("GB", 1e9) if ends[1] >= 1e9 else ("MB", 1e6)
    low, high = (f"{float(f'{end / size:.2g}'):g}" for end in ends)
    return f"{low if low == high else f'{low} to {high}'} {unit}"
