"""Figures of results.

Each `plot_...` takes one solution or several and, optionally, the axes to draw on (of a new figure
by default), and returns the axes. A plot computes nothing and sets no rcParams. Solutions differ by
colour, line style and marker, so that they can be told apart in grey. Over time, the simulation is
shown; of a single solution, the collocation nodes, too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hkt_mdo.dynamics.trajectory import COLUMNS, QUANTITIES
from hkt_mdo.results import style
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.summary import LimitEntry

Solutions = Solution | Sequence[Solution]

_BAR: dict[str, Any] = {"linewidth": 2.5, "marker": "|", "markersize": 8, "markeredgewidth": 1.5}
_MARKS_PER_LINE = 12


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


def _over_time(quantity: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a quantity over time, and its limit."""
    chosen, ax, column = _named(solutions), ax or style.new_axes(), COLUMNS[quantity]
    for index, (solution, name) in enumerate(chosen):
        nodes = solution.trajectory
        if table := solution.simulation or (nodes if name else {}):
            look = style.line(index)
            if name:  # a few markers a line, staggered
                every = max(1, table["time_s"].size // _MARKS_PER_LINE)
                start = index * every // len(chosen)
                look |= style.marker(index, 4.0) | {"markevery": (start, every)}
            ax.plot(table["time_s"], table[column], label=name or "simulation", **look)
        if nodes and not name:
            look = style.marker(0, 3.2) | {"linestyle": "none", "markerfacecolor": "none"}
            look |= {"color": style.COLORS[1], "zorder": 2.5}
            ax.plot(nodes["time_s"], nodes[column], label="collocation nodes", **look)
    words, unit = quantity.replace("_", " "), (QUANTITIES[quantity][0] or "-").replace("*", " ")
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
    for solution, name in _named(solutions):
        for limit, entry in _limits(solution).items():
            if limit not in QUANTITIES:  # else it is drawn beside its quantity
                text = f"largest {limit.replace('_', ' ')} {entry}"
                ax.plot([], [], " ", label=f"{name}: {text}" if name else text)
    return _over_time("control_torque", solutions, ax)


def plot_convergence(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot energy (J) and, on a logarithmic axis at the right, infeasibility over evaluations.

    The axes returned are those of the energy.
    """
    ax = ax or style.new_axes()
    right = ax.twinx()
    for index, (solution, name) in enumerate(_named(solutions)):
        if not (table := solution.convergence):
            continue
        count, look, prefix = table["evaluation"], style.line(index), f"{name}, " if name else ""
        ax.plot(count, table["energy_J"], label=f"{prefix}energy", **look)
        look |= {"linestyle": ":", "linewidth": 1.0, "markevery": max(1, count.size // 40)}
        look |= style.marker(index, 3.0) | ({} if name else {"color": style.COLORS[1]})
        right.plot(count, table["infeasibility"], label=f"{prefix}infeasibility", **look)
    values = np.concatenate([[0.0], *(line.get_ydata() for line in right.lines)])
    if np.any(np.isfinite(values) & (values > 0.0)):
        right.set_yscale("log", nonpositive="mask")
        right.yaxis.set_major_formatter("{x:.0e}")
    right.set_ylabel("infeasibility, scaled (-)", fontsize=style.FONT_SIZE)
    right.tick_params(labelsize=style.FONT_SIZE)
    style.finish(ax, "evaluation (-)", "energy (J)")
    style.legend([ax, right])
    return ax


FIGURES: dict[str, tuple[tuple[str, ...], tuple[Callable[..., Axes], ...], float, float]] = {
    "blade": (("blade",), (plot_twist, plot_chord), 5.6, 5.4),
    "power_curve": (("power_curve",), (plot_power_curve,), 5.6, 3.9),
    "operation": (
        ("simulation", "trajectory"),
        (plot_rotor_speed, plot_tip_speed_ratio, plot_control_torque, plot_hydrodynamic_torque),
        *(7.0, 8.2),
    ),
    "convergence": (("convergence",), (plot_convergence,), 6.2, 3.9),
}
"""Tables needed, of which one suffices, plots from the top, width and height (inches)."""


def figure_of(solutions: Solutions, name: str) -> Figure | None:
    """Return one of the `FIGURES`; None if no solution has a table that it needs."""
    tables, plots, width, height = FIGURES[name]
    if not any(getattr(each, table) for each, _ in _named(solutions) for table in tables):
        return None
    return style.figure_of(width, height, [partial(plot, solutions) for plot in plots])


def save_figures(
    solutions: Solutions, folder: str | Path, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write the `FIGURES` for which there are data; paths and errors are those of `style.save`."""
    figures = {name: figure_of(solutions, name) for name in FIGURES}
    return style.save({name: each for name, each in figures.items() if each}, folder, formats)


def _named(solutions: Solutions) -> list[tuple[Solution, str]]:
    """Return solutions and their names in a legend; a single solution needs no name."""
    several = [solutions] if isinstance(solutions, Solution) else list(solutions)
    if len(several) == 1:
        return [(several[0], "")]
    # Matplotlib leaves labels that begin with an underscore out of legends
    return [(each, re.sub("^_", " _", each.name)) for each in several]


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
