"""Figures of results.

Each `plot_...` takes one solution or several and, optionally, the axes to draw on (of a new figure
by default), and returns the axes. A plot sets no rcParams. Solutions, and the
scenarios of one, differ by colour, line style and marker, so that they can be told apart in grey.
Of a single one, a quantity has the same colour in every figure, and over time there are collocation
nodes beside the simulation.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.quantities import QUANTITIES
from hkt_mdo.results import style
from hkt_mdo.results.sections import STACKING, sections
from hkt_mdo.results.solution import ScenarioTables, Solution
from hkt_mdo.results.steady import binned, rated_point, steady_curve
from hkt_mdo.results.words import joined, limit_words, measured, printable

Solutions = Solution | Sequence[Solution]

_BAR: dict[str, Any] = {"linewidth": 2.5, "marker": "|", "markersize": 8, "markeredgewidth": 1.5}
_MARKS_PER_LINE = 12
SHOWN = 0.25, 0.5, 0.75
"""Places of the sections that are shown, from hub to tip."""
AXIS = f"blade's axis, at {STACKING:g} of the chord"
_NODES_SHOWN = 40  # of the collocation: more markers would hide the line


def near_bounds(
    solutions: Sequence[Solution], column: str, values: np.ndarray
) -> dict[str, tuple[int, float]]:
    """Return the bounds of a column of the blade that all designs share and that are near.

    Parameters
    ----------
    solutions : sequence of Solution
        The results.
    column : str
        A column of the blade that is designed.
    values : numpy.ndarray, shape (n_values,)
        What is drawn; a bound far from these and from zero says nothing.

    Returns
    -------
    dict of (int, float)
        0 for the lower and 1 for the upper end, and the bound, by its words.
    """
    quantity, unit = column.split("_", 1)
    designs = [each.case.design for each in solutions if each.case.design.blade == "optimized"]
    given = {getattr(each, f"{quantity}_bounds") for each in designs}
    low, high = (1.5 * end(values, initial=0.0) for end in (np.min, np.max))
    return {
        f"{word} {quantity} {bound:.4g} {unit.replace('over_chord', '')}".rstrip(): (end, bound)
        for bounds in (given if len(given) == 1 else ())
        for end, (word, bound) in enumerate(
            zip(("smallest", "largest"), bounds or (), strict=False)
        )
        if low <= bound <= high
    }


def _over_radius(column: str, label: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a column of the blade over the radius, from zero, with the bounds of the design."""
    ax = _beside_start(solutions, ax, "blade", "r_m", column)
    values = np.concatenate([[0.0], *(line.get_ydata() for line in ax.lines)])
    ax.axhline(0.0, color="0.75", linewidth=0.8, label="_zero")
    ax.set_xlim(left=0.0)
    if column != "twist_deg":
        ax.set_ylim(bottom=0.0)
    chosen = [each for each, _ in _named(solutions)]
    for words, (end, bound) in near_bounds(chosen, column, values).items():
        style.level(ax, bound, words, 1 - end)
    return style.finish(ax, "radius (m)", label)


# over the radius, and that of the blade at the start
plot_chord = partial(_over_radius, "chord_m", "chord (m)")
plot_twist = partial(_over_radius, "twist_deg", "twist (deg)")
plot_thickness = partial(_over_radius, "thickness_over_chord", "thickness\nover chord (-)")


def plot_planform(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the outline of the untwisted blade in scale, with its axis."""
    ax = ax or style.new_axes()
    for index, (solution, name) in enumerate(_named(solutions)):
        if not (blade := solution.blade):
            continue
        radius, chord, look = blade["r_m"], blade["chord_m"], style.line(index)
        edges = STACKING * chord, (STACKING - 1.0) * chord
        around = np.r_[edges[0], edges[1][::-1], edges[0][:1]]
        ax.plot(np.r_[radius, radius[::-1], radius[:1]], around, label=name or "_blade", **look)
        if not name:
            ax.fill_between(radius, *edges, color=look["color"], alpha=0.12, linewidth=0)
        if index == 0:
            along = [0.0, radius[-1]], [0.0, 0.0]
            ax.plot(*along, label=AXIS, linestyle="-.", **style.REFERENCE)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlim(left=0.0)
    return style.finish(ax, "radius (m)", "planform,\nin scale (m)")


def plot_sections(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot sections of the blade in scale, without twist, about its axis; of several one of each.

    Results whose files or outlines are not known are left out.
    """
    ax, chosen = ax or style.new_axes(), _named(solutions)
    for index, (solution, name) in enumerate(chosen):
        places = SHOWN[1:2] if name else SHOWN
        for number, section in enumerate(_sections(solution, places)):
            look = style.line(index) if name else style.line(number) | {"color": style.COLORS[0]}
            label = name or f"section at {100.0 * places[number]:g} % of the span"
            ax.plot(*np.append(section, section[:1], axis=0).T, label=label, **look)
    if ax.lines:
        ax.plot([0.0], [0.0], "+", markersize=9, label=AXIS, color=style.REFERENCE["color"])
    ax.set_aspect("equal", adjustable="datalim")
    ax.locator_params(axis="x", prune="both")  # a label at the end would be cut off
    label = (
        f"section at {100.0 * SHOWN[1]:g} %,\nin scale (m)"
        if len(chosen) > 1
        else "sections,\nin scale (m)"
    )
    return style.finish(ax, "along the chord, from the blade's axis (m)", label)


def _sections(solution: Solution, places: Sequence[float] = SHOWN) -> np.ndarray:
    """Return sections of a blade; none where its files or outlines are not known."""
    try:
        return sections(solution, places)
    except InputError:
        return np.empty((0, 0, 2))


def plot_power_curve(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the power coefficient over tip speed ratio, its peak, and the range operated in.

    The bar at the foot of the axes spans the tip speed ratios of the trajectory.
    """
    ax = _beside_start(solutions, ax, "power_curve", "tip_speed_ratio", "power_coefficient")
    for index, (solution, _) in enumerate(_named(solutions)):
        if not solution.power_curve:
            continue
        get, color = solution.summary.get, style.line(index)["color"]
        ratio, power = get("tip_speed_ratio_at_power_coefficient_max"), get("power_coefficient_max")
        peak = {"color": color, "linestyle": "none", "label": "_" if index else "largest value"}
        ax.plot([ratio], [power], **peak, **style.marker(index))
    return _with_operation(solutions, ax, "power coefficient (-)")


def plot_thrust_curve(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the thrust coefficient over tip speed ratio, and the range operated in."""
    ax = _beside_start(solutions, ax, "power_curve", "tip_speed_ratio", "thrust_coefficient")
    return _with_operation(solutions, ax, "thrust coefficient (-)")


def _with_operation(solutions: Solutions, ax: Axes, label: str) -> Axes:
    """Draw the tip speed ratios operated in as bars at the foot of axes from zero."""
    bars: list[Any] = []
    for index, (solution, _) in enumerate(_named(solutions)):
        if reach := solution.summary.get("tip_speed_ratio"):
            look = _BAR | {"color": style.line(index)["color"]}
            look |= {"label": None if bars else "range operated in"}
            height, across = 0.035 + 0.04 * index, ax.get_xaxis_transform()
            bars += ax.plot([reach["min"], reach["max"]], [height] * 2, transform=across, **look)
    ax.set_ylim(bottom=0.0)
    return style.finish(ax, "tip speed ratio (-)", label)


def _few_markers(index: int, count: int, size: int) -> dict[str, Any]:
    """Return the markers of a line of so many points, staggered against those of the others."""
    every = max(1, size // _MARKS_PER_LINE)
    return style.marker(index, 4.0) | {"markevery": (index * every // count, every)}


WORDS = {
    "inflow_speed": ("inflow speed", "m/s", 1.0),
    "rotor_speed": ("rotor speed", "rpm", 30.0 / np.pi),
    "tip_speed_ratio": ("tip speed ratio", "-", 1.0),
    "control_torque": ("generator torque", "N m", 1.0),
    "hydrodynamic_torque": ("flow's torque", "N m", 1.0),
    "generator_power": ("generator power", "kW", 1e-3),
    "thrust": ("thrust", "kN", 1e-3),
}
"""Name, unit and scale of what is drawn over time and over the flow speed."""
LARGE_TORQUE = 1e3  # N m


def words_of(quantity: str, solutions: Iterable[Solution]) -> tuple[str, str, float]:
    """Return name, unit and scale of a quantity of `WORDS`, torques of large machines in kN m.

    Parameters
    ----------
    quantity : str
        One of `WORDS`.
    solutions : iterable of Solution
        What is drawn together.

    Returns
    -------
    tuple of (str, str, float)
        The scale is that of values in SI.
    """
    words, unit, scale = WORDS[quantity]
    most = max((each.summary.control_torque_max_Nm or 0.0 for each in solutions), default=0.0)
    large = unit == "N m" and most >= LARGE_TORQUE
    return (words, "kN m", 1e-3) if large else (words, unit, scale)


def _over_time(quantity: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a quantity over time, of one solution at some of the nodes too, and its limits."""
    chosen, ax, column = _scenarios(solutions), ax or style.new_axes(), QUANTITIES[quantity].column
    words, unit, scale = words_of(quantity, (each for each, _ in chosen))
    for index, (solution, name) in enumerate(chosen):
        table, label = solution.simulation, name or "simulation"
        if column not in table:
            table, label = solution.trajectory, name or "collocation nodes"
        if column in table:
            time, look = table["time_s"], style.line(index)
            extra = _few_markers(index, len(chosen), time.size) if name else {}
            look = (look if name else style.colored(look, quantity)) | extra
            series = (solution.across_gaps(time, each) for each in (time, scale * table[column]))
            ax.plot(*series, label=label, **look)
    nodes = chosen[0][0].trajectory
    if len(chosen) == 1 and column in nodes:
        look = style.marker(0, 3.2) | {"linestyle": "none", "markerfacecolor": "none"}
        look |= {"color": "0.35", "zorder": 2.5, "label": "collocation nodes"}
        look |= {"markevery": max(1, -(-nodes["time_s"].size // _NODES_SHOWN))}
        ax.plot(nodes["time_s"], scale * nodes[column], **look)
    _draw_levels(quantity, scale, solutions, ax)
    style.widen(ax)
    return style.finish(ax, "time (s)", f"{words} ({unit})")


LIMITED_BY = {"generator_power": ("generator_power", "electrical_power")}

# over time: m/s, rpm, dimensionless, N m, kW and kN
plot_inflow_speed = partial(_over_time, "inflow_speed")
plot_rotor_speed = partial(_over_time, "rotor_speed")
plot_tip_speed_ratio = partial(_over_time, "tip_speed_ratio")
plot_hydrodynamic_torque = partial(_over_time, "hydrodynamic_torque")
plot_control_torque = partial(_over_time, "control_torque")
plot_power = partial(_over_time, "generator_power")
plot_thrust = partial(_over_time, "thrust")


def plot_limits(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a bar for each limit: the largest value over the limit, which is 1; of each solution."""
    ax, chosen = ax or style.new_axes(), _scenarios(solutions)
    shares = [x.limit_shares("simulation" if x.simulation else "trajectory") for x, _ in chosen]
    rows = list(dict.fromkeys(limit for each in shares for limit in each))[::-1]
    height = 0.8 / len(chosen)
    for index, ((_, name), found) in enumerate(zip(chosen, shares, strict=True)):
        if not found:
            continue
        places = [rows.index(limit) + (0.5 * len(chosen) - index - 0.5) * height for limit in found]
        most = [float(np.nanmax(share)) for share in found.values()]
        look = style.bar(index) | {"height": 0.9 * height, "alpha": 0.85}
        if not name:
            look["color"] = [style.colored(look, limit)["color"] for limit in found]
        ax.barh(places, most, label=name or "largest value", **look)
        for place, value in zip(places, most, strict=True):
            words: dict[str, Any] = {"va": "center", "fontsize": style.FONT_SIZE - 1.5}
            ax.text(max(value, 1.0), place, f" {value:.3f}", **words)  # beyond the limit's line
    ax.axvline(1.0, label="limit", **style.REFERENCE | {"linewidth": 1.6})
    ax.set_xlim(0.0, 1.12 * max(1.0, ax.get_xlim()[1] / 1.05))
    room = max(0.6, 0.5 * (4 - len(rows)))  # a single bar does not fill the axes
    ax.set_ylim(-room, len(rows) - 1 + room)
    style.finish(ax, "largest value over its limit (-)", "")
    ax.set_yticks(range(len(rows)), [limit_words(limit) for limit in rows])
    return ax


def _schedule(quantity: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a quantity over the flow speed, from zero: means, most instants, steady operation."""
    chosen, ax = _scenarios(solutions), ax or style.new_axes()
    words, unit, scale = words_of(quantity, (each for each, _ in chosen))
    column = QUANTITIES[quantity].column
    for index, (solution, name) in enumerate(chosen):
        table, look = solution.simulation or solution.trajectory, style.line(index)
        if column not in table:
            continue
        if not name:
            look = style.colored(look, quantity)
        speed, mean, low, high = binned(
            table["inflow_speed_m_s"], scale * table[column], solution.steady
        )
        band = {"alpha": 0.12 if name else 0.2, "color": look["color"], "linewidth": 0}
        if not solution.steady:
            label = None if name else "90 % of the instants"
            ax.fill_between(speed, low, high, label=label, **band)
        marks = _few_markers(index, len(chosen), speed.size)
        ax.plot(speed, mean, label=name or "mean at this flow speed", **look, **marks)
        if column in (steady := steady_curve(solution)):
            dashed: dict[str, Any] = {"color": look["color"] if name else "black", "linewidth": 1.0}
            dashed |= {"linestyle": "--", "label": "_steady" if name else "in steady flow"}
            ax.plot(steady["inflow_speed_m_s"], scale * steady[column], **dashed)
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=0.0)
    _draw_levels(quantity, scale, solutions, ax, 1)  # where the curves are low
    stops = {solution.case.control.cut_out for solution, _ in chosen} - {None}
    for stop in sorted(stops):
        ax.axvline(stop, label=f"cut-out {stop:g} m/s", linestyle=":", **style.REFERENCE)
    return style.finish(ax, "inflow speed (m/s)", f"{words} ({unit})")


# over the flow speed, with their limits
plot_torque_schedule = partial(_schedule, "control_torque")
plot_thrust_schedule = partial(_schedule, "thrust")
plot_speed_schedule = partial(_schedule, "rotor_speed")


def plot_power_schedule(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot shaft power and, of a generator with losses, the mean electrical power over the flow."""
    ax, label = _schedule("generator_power", solutions, ax), "electrical power, mean"
    chosen = _scenarios(solutions)
    for index, (solution, name) in enumerate(chosen):
        table = solution.simulation or solution.trajectory
        rated = None if name else rated_point(solution)
        if rated is not None:
            look = style.marker(3, 7.0) | {"color": "black", "linestyle": "none"}
            point = [rated[0]], [1e-3 * rated[1]]
            ax.plot(*point, label=f"rated at {rated[0]:.2f} m/s", **look)
        if table and not np.allclose(table["electrical_power_W"], table["generator_power_W"]):
            look = {"color": style.COLORS[index % len(style.COLORS)], "linewidth": 1.2}
            found = binned(
                table["inflow_speed_m_s"], 1e-3 * table["electrical_power_W"], solution.steady
            )
            ax.plot(found.speed, found.mean, linestyle=(0, (1, 2)), label=label, **look)
            label = "_"  # one entry in the legend is enough
    style.legend([ax])
    return ax


OVER_SPAN = {
    "stress_Pa": ("stress", "stress", "stress (MPa)", 1e-6),
    "flapwise_moment_Nm": ("stress", "root_moment", "flapwise moment (kN m)", 1e-3),
    "cavitation": ("cavitation", "cavitation", "suction, 1: cavitation (-)", 1.0),
}
"""Load at whose largest value each column is drawn, its quantity, the column's label and scale."""


def _over_span(column: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a load along the blade at the time of the largest one, and its limits."""
    chosen, ax = _scenarios(solutions), ax or style.new_axes()
    load, quantity, label, scale = OVER_SPAN[column]
    for index, (solution, name) in enumerate(chosen):
        if column in solution.loads:
            entry = (solution.summary.loads or {}).get(load)
            words = f"at the largest {'suction' if load == 'cavitation' else load}"
            words += "" if entry is None or entry.time_s is None else f", t = {entry.time_s:.2f} s"
            values, look = scale * solution.loads[column], style.line(index)
            if not name:  # another instant has another look
                dashes = {"linestyle": "-" if load == "stress" else (0, (4, 1.5))}
                look = style.colored(look, quantity) | dashes
            if name:
                look |= _few_markers(index, len(chosen), values.size)
            ax.plot(solution.loads["r_over_R"], values, label=name or words, **look)
    if column == QUANTITIES[quantity].column:  # not a moment along the blade
        _draw_levels(quantity, scale, solutions, ax)
    lines = [line.get_ydata() for line in ax.lines]
    if all(np.min(values) > -0.01 * np.max(values) for values in lines):
        ax.set_ylim(bottom=0.0)
    return style.finish(ax, "radius over that of the tip (-)", label)


# along the blade, at the times of the largest stress and suction
plot_stress = partial(_over_span, "stress_Pa")
plot_flapwise_moment = partial(_over_span, "flapwise_moment_Nm")
plot_suction = partial(_over_span, "cavitation")


def levels_of(
    chosen: Sequence[tuple[Solution, str]], quantity: str, scale: float
) -> dict[str, float]:
    """Return the limits of a quantity, one for equal ones.

    Parameters
    ----------
    chosen : sequence of (Solution, str)
        Results of one scenario each, with their names.
    quantity : str
        The quantity over time.
    scale : float
        Of the values.

    Returns
    -------
    dict of float
        Levels by their words, which name the results where not all have the limit.
    """
    found: dict[tuple[str, float], list[str]] = {}
    chosen = [each for each in chosen if each[0].simulation or each[0].trajectory]
    for solution, name in chosen:
        levels: dict[str, float] = {}
        for each in LIMITED_BY.get(quantity, (quantity,)):
            levels |= solution.limit_levels(each)
        for limit in (each for each in solution.limits if each.name in levels):
            told = measured(float(limit.upper), limit.unit or "", 4)
            words = f"{limit_words(limit.name)} limit {told}"
            found.setdefault((words, levels[limit.name]), []).append(name)
    named = {}
    for (words, level), names in found.items():
        apart = [] if len(names) == len(chosen) else list(filter(None, dict.fromkeys(names)))
        named[words + (f" in {' and '.join(apart)}" if apart else "")] = scale * level
    return named


def _draw_levels(
    quantity: str, scale: float, solutions: Solutions, ax: Axes, first: int = 0
) -> None:
    """Draw the limits of a quantity as lines; `first`: place of the first label."""
    levels = levels_of(_scenarios(solutions), quantity, scale)
    for place, (words, level) in enumerate(levels.items(), first):
        style.level(ax, level, words, place)


def plot_convergence(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot infeasibility, and the distance of the energy from its last value, over evaluations."""
    ax = ax or style.new_axes()
    for index, (solution, name) in enumerate(_named(solutions)):
        if not (table := solution.convergence):
            continue
        count, look, prefix = table["evaluation"], style.line(index), f"{name}, " if name else ""
        known = table["energy_J"][np.isfinite(table["energy_J"])]
        end = known[-1] if known.size and known[-1] else 1.0
        distance = np.abs(table["energy_J"] / end - 1.0)
        look |= style.marker(index, 3.0) | {"markevery": max(1, count.size // 40)}
        ax.plot(count, distance, label=f"{prefix}energy: distance from its last value", **look)
        look |= {"linestyle": ":", "linewidth": 1.0} | ({} if name else {"color": style.COLORS[1]})
        ax.plot(count, table["infeasibility"], label=f"{prefix}infeasibility, scaled", **look)
    values = np.concatenate([[0.0], *(line.get_ydata() for line in ax.lines)])
    values = values[np.isfinite(values) & (values > 0.0)]
    if values.size:
        ax.set_yscale("log", nonpositive="mask")
        ax.set_ylim(bottom=max(1e-10, 0.5 * float(np.min(values))))
        ax.yaxis.set_major_formatter("{x:.0e}")
    return style.finish(ax, "evaluation (-)", "relative (-)")


def plot_year_power(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the electrical power over the flow speed, bin by bin."""
    ax = ax or style.new_axes()
    for index, (solution, name) in enumerate(_scenarios(solutions)):
        if table := solution.year:
            look = style.line(index) | style.marker(index, 3.5)
            look = look if name else style.colored(look, "electrical_power")
            along = table["inflow_speed_m_s"], 1e-3 * table["electrical_power_W"]
            ax.plot(*along, label=name or "mean electrical power", **look)
    ax.set_ylim(bottom=0.0)
    return style.finish(ax, "inflow speed (m/s)", "power (kW)")


def _by_bin(
    column: str, label: str, quantity: str, solutions: Solutions, ax: Axes | None = None
) -> Axes:
    """Plot a column of the year over the flow speed as bars, one a bin, in a quantity's colour."""
    chosen, ax = _scenarios(solutions), ax or style.new_axes()
    for index, (solution, name) in enumerate(chosen):
        if table := solution.year:
            speed = table["inflow_speed_m_s"]
            step = float(np.min(np.diff(speed), initial=0.1)) / len(chosen)
            at = speed + step * (index - 0.5 * (len(chosen) - 1))
            look = style.bar(index) if name else style.colored(style.bar(index), quantity)
            ax.bar(at, table[column], width=0.9 * step, label=name or "_a year", **look)
    return style.finish(ax, "inflow speed (m/s)", label)


plot_year_hours = partial(_by_bin, "hours", "hours a year (h)", "inflow_speed")
plot_year_energy = partial(_by_bin, "energy_kWh", "energy a year\n(kW h)", "power")


class Panel(NamedTuple):
    """A plot, and what tells of a solution whether it has data for it."""

    plot: Callable[..., Axes]
    known: Callable[[Solution], Any]


def _panels(
    tables: Sequence[str],
    *plots: Callable[..., Axes],
    steady: bool = True,
    **of_column: Callable[..., Axes],
) -> list[Panel]:
    """Return panels that are drawn of one of some tables, and last those of a column of it.

    Without `steady`, they need a scenario with a time.
    """

    def known(column: str, solution: Solution) -> bool:
        shown = (one for one in solution.by_scenario if steady or not one.steady)
        found = (getattr(one, name) for one in shown for name in tables)
        return any(column in table if column else table for table in found)

    needed = [("", plot) for plot in plots] + [*of_column.items()]
    return [Panel(plot, partial(known, column)) for column, plot in needed]


def _limited(solution: Solution) -> bool:
    return any(one.limit_shares(table) for one in solution.by_scenario for table in _TIMES)


_TIMES = "simulation", "trajectory"
_OVER_TIME = "operation", "limits", "year"
"""Figures of one scenario each."""
_OPERATION = (
    *(plot_inflow_speed, plot_power, plot_rotor_speed),
    *(plot_tip_speed_ratio, plot_control_torque),
)
_SCHEDULE = plot_power_schedule, plot_speed_schedule, plot_torque_schedule

FIGURES: dict[str, tuple[list[Panel], float, float]] = {
    "blade": (
        [
            *_panels(["blade"], plot_planform, plot_chord, plot_twist),
            *_panels(["blade"], thickness_over_chord=plot_thickness),
            Panel(plot_sections, lambda solution: _sections(solution).size),
        ],
        *(6.6, 10.2),
    ),
    "power_curve": (
        _panels(["power_curve"], plot_power_curve, thrust_coefficient=plot_thrust_curve),
        *(5.6, 5.6),
    ),
    "operation": (_panels(_TIMES, *_OPERATION, steady=False, thrust_N=plot_thrust), 7.4, 10.4),
    "schedule": (_panels(_TIMES, *_SCHEDULE, thrust_N=plot_thrust_schedule), 7.0, 9.4),
    "year": (_panels(["year"], plot_year_power, plot_year_hours, plot_year_energy), 6.4, 7.4),
    "limits": ([Panel(plot_limits, _limited)], 7.0, 4.2),
    "loads": (
        _panels(["loads"], stress_Pa=plot_stress, flapwise_moment_Nm=plot_flapwise_moment)
        + _panels(["loads"], cavitation=plot_suction),
        *(5.6, 7.2),
    ),
    "convergence": (_panels(["convergence"], plot_convergence), 6.2, 3.9),
}
"""Panels from the top, width and, with all panels, height (inches)."""

_BESIDES = 1.2  # inches of a figure's height that its panels do not share


def figure_of(solutions: Solutions, name: str) -> Figure | None:
    """Return one of the `FIGURES`, with the panels that a solution has data for; None if none."""
    panels, width, height = FIGURES[name]
    shown = [each for each in panels if any(each.known(one) for one, _ in _named(solutions))]
    if not shown:
        return None
    height = _BESIDES + (height - _BESIDES) * len(shown) / len(panels)
    if name == "limits":  # each bar has room for its number
        bars = [len(one.limit_shares("trajectory")) for one, _ in _scenarios(solutions)]
        height = max(height, 1.5 + 0.16 * max(bars) * len(bars))
    share = sum(each.plot is not plot_sections for each in shown)  # which have no radius
    plots = [partial(each.plot, solutions) for each in shown]
    heights = [1.0] * len(shown)
    if name == "blade" and shown[0].plot is plot_planform:
        blades = [each.blade for each, _ in _named(solutions) if each.blade]
        most = (max(np.max(each[x]) for each in blades) for x in ("chord_m", "r_m"))
        wide = (width - 1.2) * np.divide(*most) / 1.6  # over the height of the other panels
        heights[0] = max(1.0, 1.2 * float(wide))
        height *= (len(heights) - 1.0 + heights[0]) / len(heights)
    return style.figure_of(width, height, plots, share, heights)


class Figures(dict[str, Figure]):
    """Figures by their names, which a notebook shows one below the other."""

    def _repr_html_(self) -> str:
        pictures = (base64.b64encode(style.png(figure)).decode() for figure in self.values())
        return "".join(f'<img src="data:image/png;base64,{each}">' for each in pictures)


def figures(solutions: Solutions, names: Sequence[str] = ()) -> Figures:
    """Return the `FIGURES` for which there are data.

    Those over time are drawn for each scenario, as ``operation_<name>``, where there are several;
    the others have a line for each.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        Results, which are drawn together.
    names : sequence of str
        Which; by default all.

    Returns
    -------
    Figures

    Raises
    ------
    InputError
        If there is no figure of a name.
    """
    drawn: dict[str, Figure | None] = {}
    chosen = [solution for solution, _ in _named(solutions)]
    scenarios = dict.fromkeys(name for each in chosen for name in each.scenarios)
    for name in names or FIGURES:
        if name not in FIGURES:
            raise InputError("unknown figure", f"known: {', '.join(FIGURES)}", value=name)
        if name in _OVER_TIME and any(len(each.scenarios) > 1 for each in chosen):
            for one in scenarios:
                alone = [of_scenario(each, one) for each in chosen]
                drawn[f"{name}_{one}"] = figure_of(alone, name)
        else:
            drawn[name] = figure_of(solutions, name)
    return Figures({name: each for name, each in drawn.items() if each})


def of_scenario(solution: Solution, name: str) -> Solution:
    """Return a result of one scenario alone.

    Parameters
    ----------
    solution : Solution
        The result.
    name : str
        The scenario.

    Returns
    -------
    Solution
        Without tables where it has no such scenario: other results keep their colours beside it.
    """
    if name in solution.scenarios:
        return solution.scenario(name)
    return replace(solution, tables={name: ScenarioTables({}, {}, {})})


def save_figures(
    solutions: Solutions, folder: str | Path, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write the figures of results, as `figures` draws them.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        Results, which are drawn together.
    folder : str or Path
        Where to, made if need be.
    formats : sequence of str
        Endings of the files that Matplotlib knows.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If a format is not known, when nothing has been written, or a file cannot be written.
    """
    return style.save(figures(solutions), folder, formats)


def labels(solutions: Sequence[Solution]) -> list[str]:
    """Return what results are called beside one another; "" for a single one.

    Parameters
    ----------
    solutions : sequence of Solution
        The results.

    Returns
    -------
    list of str
        Names of the cases, of the folders where those are equal, and numbers where these are, too.
    """
    if len(solutions) == 1:
        return [""]
    for name in (lambda each: each.name, lambda each: each.folder.resolve().name):
        names = [printable(name(each)) for each in solutions]
        if len(set(names)) == len(names):
            return names
    return [f"{index}: {name}" for index, name in enumerate(names, 1)]


def _named(solutions: Solutions) -> list[tuple[Solution, str]]:
    """Return solutions and their names in a legend; a single solution needs no name."""
    several = [solutions] if isinstance(solutions, Solution) else list(solutions)
    # Matplotlib leaves labels that begin with an underscore out of legends
    names = [re.sub("^_", " _", label) for label in labels(several)]
    return list(zip(several, names, strict=True))


def _scenarios(solutions: Solutions) -> list[tuple[Solution, str]]:
    """Return each scenario of solutions as one of its own, and their names in a legend."""
    found = []
    for solution, name in _named(solutions):
        for one, scenario in zip(solution.by_scenario, solution.scenarios, strict=True):
            several = len(solution.scenarios) > 1
            label = re.sub("^_", " _", joined(name, scenario)) if several else name
            found.append((one, label))
    return found


def beside_start(
    chosen: Sequence[tuple[Solution, str]], source: str, x: str, y: str
) -> Iterator[tuple[int | None, np.ndarray, np.ndarray, str]]:
    """Yield a column over another of each result, and before it that of the blade at the start.

    Parameters
    ----------
    chosen : sequence of (Solution, str)
        Results with their names.
    source : str
        The table of a result.
    x, y : str
        Its columns.

    Yields
    ------
    index : int or None
        Place of the result; None: it is a start, which is there once if it is the same.
    x, y : numpy.ndarray, shape (n_rows,)
        The columns.
    label : str
        Name of the curve.
    """
    starts: list[np.ndarray] = []
    for index, (solution, name) in enumerate(chosen):
        table = getattr(solution, source)
        if y not in table:
            continue
        start = table.get(f"start_{y}")
        same = np.array_equal(start, table[y])  # the blade is not designed
        if (
            start is not None
            and not same
            and not any(np.array_equal(start, other) for other in starts)
        ):
            starts.append(start)
            yield None, table[x], start, "blade at the start"
        yield index, table[x], table[y], name or ("blade" if same else "optimized blade")


def _beside_start(solutions: Solutions, ax: Axes | None, source: str, x: str, y: str) -> Axes:
    """Plot a column over another, and that of the blade at the start."""
    ax, size = ax or style.new_axes(), 4.5 if source == "blade" else 0.0
    for index, along, values, label in beside_start(_named(solutions), source, x, y):
        look = style.REFERENCE | {"linestyle": ":", "marker": "x", "markersize": size}
        if index is not None:
            look = style.line(index) | style.marker(index, size)
        ax.plot(along, values, label=label, **look)
    return ax
