"""Figures of results.

Each `plot_...` takes one solution or several and, optionally, the axes to draw on (of a new figure
by default), and returns the axes. A plot computes nothing and sets no rcParams. Solutions, and the
scenarios of one, differ by colour, line style and marker, so that they can be told apart in grey.
Over time, the simulation is shown; of a single one, the collocation nodes, too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hkt_mdo.quantities import QUANTITIES, TRAJECTORY
from hkt_mdo.results import style
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.summary import LimitEntry
from hkt_mdo.results.words import joined, measured

Solutions = Solution | Sequence[Solution]

_BAR: dict[str, Any] = {"linewidth": 2.5, "marker": "|", "markersize": 8, "markeredgewidth": 1.5}
_MARKS_PER_LINE = 12
_MANY_NODES = 400  # above which their markers would hide the line
_DASHES = "-.", ":", "--"  # of the limits in one plot


def _over_radius(column: str, label: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    ax = _beside_start(solutions, ax, "blade", "r_m", column)
    return style.finish(ax, "radius (m)", label)


# over the radius, and that of the blade at the start
plot_chord = partial(_over_radius, "chord_m", "chord (m)")
plot_twist = partial(_over_radius, "twist_deg", "twist (deg)")


def plot_power_curve(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the power coefficient over tip speed ratio, its peak, and the range operated in.

    The bar at the foot of the axes spans the tip speed ratios of the trajectory.
    """
    ax = _beside_start(solutions, ax, "power_curve", "tip_speed_ratio", "power_coefficient")
    bars = []
    for index, (solution, _) in enumerate(_named(solutions)):
        if not solution.power_curve:
            continue
        get, color = solution.summary.get, style.line(index)["color"]
        ratio, power = get("tip_speed_ratio_at_power_coefficient_max"), get("power_coefficient_max")
        ax.plot([ratio], [power], color=color, linestyle="none", **style.marker(index))
        if reach := get("tip_speed_ratio"):
            look = _BAR | {"color": color, "label": None if bars else "range operated in"}
            height, across = 0.035 + 0.04 * index, ax.get_xaxis_transform()
            bars += ax.plot([reach["min"], reach["max"]], [height] * 2, transform=across, **look)
    ax.set_ylim(bottom=0.0)
    return style.finish(ax, "tip speed ratio (-)", "power coefficient (-)")


def _series(
    x: str, quantity: str, solutions: Solutions, ax: Axes | None, scale: float = 1.0
) -> Axes:
    """Plot a quantity times a scale over another one: as simulated, or else at the nodes."""
    chosen, ax, column = _scenarios(solutions), ax or style.new_axes(), QUANTITIES[quantity].column
    for index, (solution, name) in enumerate(chosen):
        table, label = solution.simulation, name or "simulation"
        if column not in table:
            table, label = solution.trajectory, name or "collocation nodes"
        if column in table:
            look = style.line(index)
            if name:
                look |= _few_markers(index, len(chosen), table[column].size)
            across, along = _broken(solution, table, QUANTITIES[x].column, scale * table[column])
            ax.plot(across, along, label=label, **look)
    return ax


def _broken(
    solution: Solution, table: dict[str, np.ndarray], x: str, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return a column of a table and values beside it, for a line that breaks at a standstill."""
    time = table["time_s"]
    return solution.across_gaps(time, table[x]), solution.across_gaps(time, y)


def _few_markers(index: int, count: int, size: int) -> dict[str, Any]:
    """Return the markers of a line of so many points, staggered against those of the others."""
    every = max(1, size // _MARKS_PER_LINE)
    return style.marker(index, 4.0) | {"markevery": (index * every // count, every)}


def _over_time(quantity: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a quantity over time, of one solution at the nodes too, and its limit."""
    chosen, ax = _scenarios(solutions), _series("time", quantity, solutions, ax)
    nodes, about = chosen[0][0].trajectory, QUANTITIES[quantity]
    if len(chosen) == 1 and nodes:
        size = 3.2 if nodes["time_s"].size <= _MANY_NODES else 1.2
        look = style.marker(0, size) | {"linestyle": "none", "markerfacecolor": "none"}
        look |= {"color": style.COLORS[1], "zorder": 2.5}
        ax.plot(nodes["time_s"], nodes[about.column], label="collocation nodes", **look)
    words, unit = quantity.replace("_", " "), (about.unit or "-").replace("*", " ")
    limits = (_limits(each).get(quantity) for each, _ in chosen)
    for bound in sorted({entry.limit for entry in limits if entry} - {None}):
        label = f"{words} limit {bound:g} {unit}"
        ax.axhline(bound, linestyle="-.", label=label, **style.REFERENCE)
    style.widen(ax)
    return style.finish(ax, "time (s)", f"{words} ({unit})")


# rad/s, dimensionless and N m, over time
plot_rotor_speed = partial(_over_time, "rotor_speed")
plot_tip_speed_ratio = partial(_over_time, "tip_speed_ratio")
plot_hydrodynamic_torque = partial(_over_time, "hydrodynamic_torque")


def plot_control_torque(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the control torque (N m) over time, and its limit; the legend tells the other limits."""
    ax = ax or style.new_axes()
    for solution, name in _scenarios(solutions):
        for limit, entry in _limits(solution).items():
            if limit not in TRAJECTORY:  # else it is drawn beside its quantity
                text = f"largest {limit.replace('_', ' ')} {entry}"
                ax.plot([], [], " ", label=f"{name}: {text}" if name else text)
    return _over_time("control_torque", solutions, ax)


def plot_limits(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot each limited quantity over its limit, over time; the limit itself is 1."""
    ax, chosen = ax or style.new_axes(), _scenarios(solutions)
    drawn = 0
    for index, (solution, name) in enumerate(chosen):
        table = "simulation" if solution.simulation else "trajectory"
        for limit, share in solution.limit_shares(table).items():
            look = style.line(drawn)
            if name:
                look |= _few_markers(index, len(chosen), share.size)
            words = limit.replace("_", " ")
            label = f"{name}: {words}" if name else words
            across, along = _broken(solution, getattr(solution, table), "time_s", share)
            ax.plot(across, along, label=label, **look)
            drawn += 1
    ax.axhline(1.0, label="limit", **style.REFERENCE)
    return style.finish(ax, "time (s)", "value over its limit (-)")


_SCHEDULES = {
    "rotor_speed": ("rotor speed (rpm)", 30.0 / np.pi),
    "control_torque": ("generator torque (N m)", 1.0),
    "generator_power": ("generator power (kW)", 1e-3),
    "thrust": ("thrust (kN)", 1e-3),
}
"""Label and scale of what is drawn over the flow speed."""


def _schedule(quantity: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a quantity over the flow speed along the trajectory, and its limits."""
    label, scale = _SCHEDULES[quantity]
    ax = _series("inflow_speed", quantity, solutions, ax, scale)
    _draw_levels((quantity,), scale, solutions, ax)
    style.widen(ax)
    return style.finish(ax, "inflow speed (m/s)", label)


# over the flow speed, with their limits
plot_torque_schedule = partial(_schedule, "control_torque")
plot_thrust_schedule = partial(_schedule, "thrust")


def plot_power_schedule(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot shaft power and, of a generator with losses, electrical power over the flow speed."""
    ax, label = ax or style.new_axes(), "electrical power"
    words, scale = _SCHEDULES["generator_power"]
    _series("inflow_speed", "generator_power", solutions, ax, scale)
    for index, (solution, _) in enumerate(_scenarios(solutions)):
        table = solution.simulation or solution.trajectory
        if table and not np.allclose(table["electrical_power_W"], table["generator_power_W"]):
            look = {"color": style.COLORS[index % len(style.COLORS)], "linewidth": 0.9}
            power = scale * table["electrical_power_W"]
            across, along = _broken(solution, table, "inflow_speed_m_s", power)
            ax.plot(across, along, linestyle=(0, (1, 2)), label=label, **look)
            label = "_"  # one entry in the legend is enough
    _draw_levels(("generator_power", "electrical_power"), scale, solutions, ax)
    style.widen(ax)
    return style.finish(ax, "inflow speed (m/s)", words)


def plot_speed_schedule(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the rotor speed (rpm, at the right rad/s) over the flow speed, and its limits."""
    ax = _schedule("rotor_speed", solutions, ax)
    scale = _SCHEDULES["rotor_speed"][1]
    right = ax.secondary_yaxis("right", functions=(lambda x: x / scale, lambda x: x * scale))
    right.set_ylabel("(rad/s)", fontsize=style.FONT_SIZE)
    right.tick_params(labelsize=style.FONT_SIZE)
    return ax


_OVER_SPAN = {
    "stress_Pa": ("stress", "stress", "stress (MPa)", 1e-6),
    "flapwise_moment_Nm": ("stress", "stress", "flapwise moment (kN m)", 1e-3),
    "cavitation": ("cavitation", "suction", "suction, 1: cavitation (-)", 1.0),
}
"""Load at whose largest value each column is drawn, its word, the column's label and scale."""


def _over_span(column: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a load along the blade at the time of the largest one, and its limits."""
    chosen, ax = _scenarios(solutions), ax or style.new_axes()
    load, word, label, scale = _OVER_SPAN[column]
    for index, (solution, name) in enumerate(chosen):
        if column in solution.loads:
            entry = (solution.summary.loads or {}).get(load)
            words = f"at the largest {word}"
            words += "" if entry is None or entry.time_s is None else f", t = {entry.time_s:.2f} s"
            values, look = scale * solution.loads[column], style.line(index)
            if name:
                look |= _few_markers(index, len(chosen), values.size)
            ax.plot(solution.loads["r_over_R"], values, label=name or words, **look)
    if column == QUANTITIES[load].column:
        _draw_levels((load,), scale, solutions, ax)
    ax.set_ylim(bottom=0.0)
    return style.finish(ax, "radius over that of the tip (-)", label)


# along the blade, at the times of the largest stress and suction
plot_stress = partial(_over_span, "stress_Pa")
plot_flapwise_moment = partial(_over_span, "flapwise_moment_Nm")
plot_suction = partial(_over_span, "cavitation")


def _draw_levels(quantities: Sequence[str], scale: float, solutions: Solutions, ax: Axes) -> None:
    """Draw the limits of some quantities as lines, one for equal ones."""
    drawn: dict[tuple[str, float], list[str]] = {}
    chosen = _scenarios(solutions)
    for solution, name in chosen:
        levels: dict[str, float] = {}
        for each in quantities:
            levels |= solution.limit_levels(each)
        for limit in (each for each in solution.limits if each.name in levels):
            told = measured(float(limit.upper), limit.unit or "", 4)
            label = f"{limit.name.replace('_', ' ')} limit {told}"
            drawn.setdefault((label, levels[limit.name]), []).append(name)
    for dashes, ((label, level), names) in zip(cycle(_DASHES), drawn.items(), strict=False):
        where = "" if len(names) == len(chosen) else f" in {' and '.join(names)}"
        ax.axhline(scale * level, linestyle=dashes, label=label + where, **style.REFERENCE)


def plot_convergence(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot energy (kJ) and, on a logarithmic axis at the right, infeasibility over evaluations.

    The axes returned are those of the energy.
    """
    ax = ax or style.new_axes()
    right = ax.twinx()
    for index, (solution, name) in enumerate(_named(solutions)):
        if not (table := solution.convergence):
            continue
        count, look, prefix = table["evaluation"], style.line(index), f"{name}, " if name else ""
        ax.plot(count, 1e-3 * table["energy_J"], label=f"{prefix}energy", **look)
        look |= {"linestyle": ":", "linewidth": 1.0, "markevery": max(1, count.size // 40)}
        look |= style.marker(index, 3.0) | ({} if name else {"color": style.COLORS[1]})
        right.plot(count, table["infeasibility"], label=f"{prefix}infeasibility", **look)
    values = np.concatenate([[0.0], *(line.get_ydata() for line in right.lines)])
    if np.any(np.isfinite(values) & (values > 0.0)):
        right.set_yscale("log", nonpositive="mask")
        right.yaxis.set_major_formatter("{x:.0e}")
    right.set_ylabel("infeasibility, scaled (-)", fontsize=style.FONT_SIZE)
    right.tick_params(labelsize=style.FONT_SIZE)
    style.finish(ax, "evaluation (-)", "energy (kJ)")
    style.legend([ax, right])
    return ax


class Panel(NamedTuple):
    """A plot, and what tells of a solution whether it has data for it."""

    plot: Callable[..., Axes]
    known: Callable[[Solution], Any]


def _panels(*plots: Callable[..., Axes], tables: Sequence[str], column: str = "") -> list[Panel]:
    """Return panels that are drawn of one of some tables, or of a column of it."""

    def known(solution: Solution) -> bool:
        found = (getattr(one, name) for one in solution.by_scenario for name in tables)
        return any(column in table if column else table for table in found)

    return [Panel(plot, known) for plot in plots]


def _limited(solution: Solution) -> bool:
    return any(one.limit_shares(table) for one in solution.by_scenario for table in _TIMES)


_TIMES = "simulation", "trajectory"
_OVER_TIME = "operation", "limits"
"""Figures of one scenario each."""
_OPERATION = plot_rotor_speed, plot_tip_speed_ratio, plot_control_torque, plot_hydrodynamic_torque
_SCHEDULE = plot_speed_schedule, plot_torque_schedule, plot_power_schedule

FIGURES: dict[str, tuple[list[Panel], float, float]] = {
    "blade": (_panels(plot_twist, plot_chord, tables=["blade"]), 5.6, 5.4),
    "power_curve": (_panels(plot_power_curve, tables=["power_curve"]), 5.6, 3.9),
    "operation": (_panels(*_OPERATION, tables=_TIMES), 7.0, 8.2),
    "schedule": (
        _panels(*_SCHEDULE, tables=_TIMES)
        + _panels(plot_thrust_schedule, tables=_TIMES, column=QUANTITIES["thrust"].column),
        *(7.0, 8.2),
    ),
    "limits": ([Panel(plot_limits, _limited)], 7.0, 4.2),
    "loads": (
        _panels(plot_stress, tables=["loads"], column="stress_Pa")
        + _panels(plot_flapwise_moment, tables=["loads"], column="flapwise_moment_Nm")
        + _panels(plot_suction, tables=["loads"], column="cavitation"),
        *(5.6, 7.2),
    ),
    "convergence": (_panels(plot_convergence, tables=["convergence"]), 6.2, 3.9),
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
    return style.figure_of(width, height, [partial(each.plot, solutions) for each in shown])


def save_figures(
    solutions: Solutions, folder: str | Path, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write the `FIGURES` for which there are data.

    Those over time are drawn for each scenario, as ``operation_<name>``, where there are several;
    the others have a line for each.

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
    figures, chosen = {}, [solution for solution, _ in _named(solutions)]
    scenarios = dict.fromkeys(name for each in chosen for name in each.scenarios)
    for name in FIGURES:
        if name in _OVER_TIME and any(len(each.scenarios) > 1 for each in chosen):
            for one in scenarios:
                alone = [each.scenario(one) for each in chosen if one in each.scenarios]
                figures[f"{name}_{one}"] = figure_of(alone, name)
        else:
            figures[name] = figure_of(solutions, name)
    return style.save({name: each for name, each in figures.items() if each}, folder, formats)


def _named(solutions: Solutions) -> list[tuple[Solution, str]]:
    """Return solutions and their names in a legend; a single solution needs no name."""
    several = [solutions] if isinstance(solutions, Solution) else list(solutions)
    if len(several) == 1:
        return [(several[0], "")]
    # Matplotlib leaves labels that begin with an underscore out of legends
    return [(each, re.sub("^_", " _", each.name)) for each in several]


def _scenarios(solutions: Solutions) -> list[tuple[Solution, str]]:
    """Return each scenario of solutions as one of its own, and their names in a legend."""
    found = []
    for solution, name in _named(solutions):
        for one, scenario in zip(solution.by_scenario, solution.scenarios, strict=True):
            several = len(solution.scenarios) > 1
            label = re.sub("^_", " _", joined(name, scenario)) if several else name
            found.append((one, label))
    return found


def _limits(solution: Solution) -> dict[str, LimitEntry]:
    limits = solution.summary.get("limits") or {}
    return {name: LimitEntry(**entry) for name, entry in limits.items()}


def _beside_start(solutions: Solutions, ax: Axes | None, source: str, x: str, y: str) -> Axes:
    """Plot a column over another, and that of the blade at the start: once if it is the same."""
    ax, size = ax or style.new_axes(), 4.5 if source == "blade" else 0.0
    starts: list[np.ndarray] = []
    for index, (solution, name) in enumerate(_named(solutions)):
        table = getattr(solution, source)
        if y not in table:
            continue
        label, start = "optimized blade", table.get(f"start_{y}")
        if np.array_equal(start, table[y]):
            label = "blade"
        elif start is not None and not any(np.array_equal(start, other) for other in starts):
            look = style.REFERENCE | {"linestyle": ":", "marker": "x", "markersize": size}
            ax.plot(table[x], start, label=None if starts else "blade at the start", **look)
            starts.append(start)
        look = style.line(index) | style.marker(index, size)
        ax.plot(table[x], table[y], label=name or label, **look)
    return ax
