"""Figures of results.

Each `plot_...` takes one solution or several and, optionally, the axes to draw on (of a new figure
by default), and returns the axes. Each `..._figure` returns a figure, or None without data for it.
A plot computes nothing and sets no rcParams. Solutions differ by colour, line style and marker, so
that they can be told apart in grey. Over time, the simulation is shown; of a single solution, the
collocation nodes, too.
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

Solutions = Solution | Sequence[Solution]

_BAR: dict[str, Any] = {"linewidth": 2.5, "marker": "|", "markersize": 8, "markeredgewidth": 1.5}
_MARKS_PER_LINE = 12


def plot_chord(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the chord (m) over the radius, and that of the blade at the start."""
    ax = _beside_start(solutions, ax, "blade", "r_m", "chord_m", markers=True)
    return style.finish(ax, "radius (m)", "chord (m)")


def plot_twist(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the twist (deg) over the radius, and that of the blade at the start."""
    ax = _beside_start(solutions, ax, "blade", "r_m", "twist_deg", markers=True)
    return style.finish(ax, "radius (m)", "twist (deg)")


def plot_power_curve(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the power coefficient over tip speed ratio, its peak, and the range operated in.

    The bar at the foot of the axes spans the tip speed ratios of the trajectory.
    """
    ax = _beside_start(solutions, ax, "power_curve", "tip_speed_ratio", "power_coefficient")
    bar = None
    for index, (solution, _) in enumerate(_named(solutions)):
        if not solution.power_curve:
            continue
        get, color = solution.summary.get, style.line(index)["color"]
        ratio, power = get("tip_speed_ratio_at_power_coefficient_max"), get("power_coefficient_max")
        if ratio is not None and power is not None:
            ax.plot([ratio], [power], color=color, linestyle="none", **style.marker(index))
        reach = get("tip_speed_ratio") or {}
        ends = [reach.get("min"), reach.get("max")]
        if None not in ends:
            height, across = 0.035 + 0.04 * index, ax.get_xaxis_transform()
            bar = ax.plot(ends, [height] * 2, transform=across, color=color, **_BAR)
    if bar:
        ax.plot([], [], color="0.3", label="range operated in", **_BAR)
    ax.set_ylim(bottom=0.0)
    return style.finish(ax, "tip speed ratio (-)", "power coefficient (-)")


def plot_rotor_speed(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the rotor speed (rad/s) over time."""
    return _over_time(solutions, ax, "rotor_speed")


def plot_tip_speed_ratio(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the tip speed ratio over time."""
    return _over_time(solutions, ax, "tip_speed_ratio")


def plot_control_torque(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the control torque (N m) over time, and its limit."""
    return _over_time(solutions, ax, "control_torque")


def plot_hydrodynamic_torque(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the hydrodynamic torque (N m) over time."""
    return _over_time(solutions, ax, "hydrodynamic_torque")


def plot_torque(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot control torque, hydrodynamic torque and the torque limit (N m) over time together.

    The simulation is shown, or the collocation nodes where there is none.
    """
    chosen, ax = _named(solutions), ax or style.new_axes()
    for index, (solution, name) in enumerate(chosen):
        table = solution.simulation or solution.trajectory
        for torque, dashes in (("control", "-"), ("hydrodynamic", "--")) if table else ():
            look = style.line(index) | _sparse_marks(index, table, len(chosen))
            if not name and torque == "hydrodynamic":
                look["color"] = style.COLORS[1]  # the two torques of a light rotor nearly coincide
            label, look["linestyle"] = ", ".join(filter(None, (name, torque))), dashes
            ax.plot(table["time_s"], table[f"{torque}_torque_Nm"], label=label, **look)
    _torque_limits(solutions, ax)
    return style.finish(ax, "time (s)", "torque (N m)", above=True)


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
    style.finish(right, "", "infeasibility, scaled (-)", grid=False)
    style.finish(ax, "evaluation (-)", "energy (J)")
    style.legend([ax, right], above=True)
    return ax


# Figures ------------------------------------------------------------------------------------------


def blade_figure(solutions: Solutions) -> Figure | None:
    """Return a figure of twist (top) and chord, as Figs. 4 and 7 of the paper."""
    return _figure(solutions, ("blade",), (plot_twist, plot_chord), 5.6, 5.4)


def power_curve_figure(solutions: Solutions) -> Figure | None:
    """Return a figure of the power coefficient, as Figs. 5 and 8 of the paper."""
    return _figure(solutions, ("power_curve",), (plot_power_curve,), 5.6, 3.9)


def operation_figure(solutions: Solutions) -> Figure | None:
    """Return a figure of speed, tip speed ratio and both torques, as Figs. 6 and 9 of the paper."""
    plots = (plot_rotor_speed, plot_tip_speed_ratio, plot_control_torque, plot_hydrodynamic_torque)
    return _figure(solutions, ("simulation", "trajectory"), plots, 7.0, 8.2)


def convergence_figure(solutions: Solutions) -> Figure | None:
    """Return a figure of energy and infeasibility over the optimizer's evaluations."""
    return _figure(solutions, ("convergence",), (plot_convergence,), 6.2, 3.9)


def _figure(
    solutions: Solutions,
    tables: Sequence[str],
    plots: Sequence[Callable[[Solutions, Axes], Axes]],
    width: float,
    height: float,
) -> Figure | None:
    """Return plots one below the other; None if no solution has one of the tables."""
    if not any(getattr(each, table) for each, _ in _named(solutions) for table in tables):
        return None
    return style.figure_of(width, height, [partial(plot, solutions) for plot in plots])


def save_figures(
    solutions: Solutions, folder: str | Path, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write the figures blade, power_curve, operation and convergence for which there are data.

    Returns the paths, FIGURE.FORMAT; the folder is made if it does not exist, and files of the same
    names are replaced. Raises InputError if Matplotlib does not know a format.
    """
    figures = {
        "blade": blade_figure(solutions),
        "power_curve": power_curve_figure(solutions),
        "operation": operation_figure(solutions),
        "convergence": convergence_figure(solutions),
    }
    return style.save({name: each for name, each in figures.items() if each}, folder, formats)


# Parts --------------------------------------------------------------------------------------------


def _named(solutions: Solutions) -> list[tuple[Solution, str]]:
    """Return solutions and their names in a legend; a single solution needs no name."""
    several = [solutions] if isinstance(solutions, Solution) else list(solutions)
    if len(several) == 1:
        return [(several[0], "")]
    # Matplotlib leaves labels that begin with an underscore out of legends
    return [(each, re.sub("^_", " _", each.name)) for each in several]


def _sparse_marks(index: int, table: dict[str, np.ndarray], count: int) -> dict[str, Any]:
    """Return a few markers a line, staggered, where several solutions share the axes."""
    if count == 1:
        return {}
    every = max(1, table["time_s"].size // _MARKS_PER_LINE)
    return style.marker(index, 4.0) | {"markevery": (index * every // count, every)}


def _beside_start(
    solutions: Solutions, ax: Axes | None, source: str, x: str, y: str, markers: bool = False
) -> Axes:
    """Plot a column over another, and that of the blade at the start: once if it is the same."""
    ax = ax or style.new_axes()
    starts: list[np.ndarray] = []
    for index, (solution, name) in enumerate(_named(solutions)):
        table = getattr(solution, source)
        if y not in table:
            continue
        label, start = "optimized blade", table.get(f"start_{y}")
        if np.array_equal(start, table[y]):
            label = "blade"
        elif start is not None and not any(np.array_equal(start, other) for other in starts):
            look = style.REFERENCE | ({"marker": "x", "markersize": 4.5} if markers else {})
            text = None if starts else "blade at the start"
            ax.plot(table[x], start, linestyle=":", label=text, **look)
            starts.append(start)
        look = style.line(index) | (style.marker(index, 4.5) if markers else {})
        ax.plot(table[x], table[y], label=name or label, **look)
    return ax


def _over_time(solutions: Solutions, ax: Axes | None, quantity: str) -> Axes:
    """Plot a quantity over time, and the limit of the control torque."""
    chosen, ax, column = _named(solutions), ax or style.new_axes(), COLUMNS[quantity]
    for index, (solution, name) in enumerate(chosen):
        nodes = solution.trajectory
        if table := solution.simulation or (nodes if name else {}):
            look = style.line(index) | _sparse_marks(index, table, len(chosen))
            ax.plot(table["time_s"], table[column], label=name or "simulation", **look)
        if nodes and not name:
            look = style.marker(0, 3.2) | {"linestyle": "none", "markerfacecolor": "none"}
            look |= {"color": style.COLORS[1], "zorder": 2.5}
            ax.plot(nodes["time_s"], nodes[column], label="collocation nodes", **look)
    if quantity == "control_torque":
        _torque_limits(solutions, ax)
    style.widen(ax)
    unit = (QUANTITIES[quantity][0] or "-").replace("*", " ")
    return style.finish(ax, "time (s)", f"{quantity.replace('_', ' ')} ({unit})", above=True)


def _torque_limits(solutions: Solutions, ax: Axes) -> None:
    limits = {solution.case.control.torque_limit for solution, _ in _named(solutions)} - {None}
    for limit in sorted(limits):
        label = f"torque limit {limit:g} N m"
        ax.axhline(limit, linestyle="-.", label=label, **style.REFERENCE)
