"""The charts of a sweep, Pareto front and map, and its figures, with parallel coordinates."""

from functools import partial
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.results import style
from hkt_mdo.results.panel import COLORS, GREY, Curve, Panel
from hkt_mdo.results.sweep import SweepTable


def sweep_charts(table: SweepTable) -> dict[str, Panel]:
    """Return front and map of a sweep, as far as it has their data; points link to their pages."""
    if not table.verified.any():
        return {}
    made = {"front": _front} if table.cost else {}
    made |= {"map": _map} if len(table.numeric) > 1 else {}
    return {name: make(table) for name, make in made.items()}


def _front(table: SweepTable) -> Panel:
    """Return the objective over the cost of every run, and the Pareto front."""
    (cost, across), (objective, up) = table.shown(table.cost), table.shown("objective")
    runs, front = np.flatnonzero(table.verified & np.isfinite(cost)), table.front()
    words, links = "Pareto front: none is better in both", table.pages
    curves = [
        Curve(cost[runs], objective[runs], "verified runs", GREY, 0, "runs", links=links[runs]),
        Curve(cost[front], objective[front], words, COLORS[1], 1, "marked", links=links[front]),
    ]
    return Panel(up, across, curves)


def _map(table: SweepTable) -> Panel:
    """Return the objective over the first two keys of numbers; crosses are runs without success.

    Of runs that differ in other keys, the best is on top.
    """
    (x, across), (y, up) = map(table.shown, table.numeric[:2])
    (objective, label), links = table.shown("objective"), table.pages
    order = np.argsort(table.merit)
    good, failed = order[table.verified[order]], np.flatnonzero(~table.verified)
    curves = [
        Curve(
            x[good], y[good], "verified runs", GREY, 1, "runs", None, objective[good], links[good]
        ),
        Curve(x[failed], y[failed], "no success", COLORS[1], 5, "runs", links=links[failed]),
    ]
    return Panel(up, across, [curve for curve in curves if curve.x.size], shades=label)


def plot_parallel(table: SweepTable, ax: Axes) -> Axes:
    """Plot each verified run as a line across keys and outcomes, each from least to largest.

    The colour is that of the objective.
    """
    good = np.flatnonzero(table.verified)
    names = [*table.sweep.columns, *(x for x in _OUTCOMES if x in table.columns)]
    heights, labels = [], []
    for name in names:
        column = table.columns[name][good]
        if {*map(str, column)} <= {"", "nan"}:
            continue
        if column.dtype.kind == "f":
            shown, name = table.shown(name)
            column = shown[good]
            ends = tuple(f"{end:.4g}" for end in (np.nanmin(column), np.nanmax(column)))
        else:  # names: one place each
            texts, column = np.unique(column, return_inverse=True)
            ends = texts[0], texts[-1]
        low, span = np.nanmin(column), np.ptp(column[np.isfinite(column)])
        heights.append((column - low) / span if span else np.full(good.size, 0.5))
        labels.append(f"{name}\n{ends[0]} to {ends[1]}")
    shades = np.linspace(0.0, 1.0, good.size)
    for shade, run in zip(shades, np.argsort(table.objective[good]), strict=True):
        ax.plot([height[run] for height in heights], color=colormaps["viridis"](shade), alpha=0.6)
    ax = style.finish(ax, "", "from least to largest (-)")
    ax.set_xticks(range(len(labels)), labels, fontsize=style.FONT_SIZE - 2)
    return ax


_OUTCOMES = "objective", "mass_kg", "thrust_N", "stress_Pa"


def sweep_figures(table: SweepTable) -> dict[str, Figure]:
    """Draw front, map and parallel coordinates of a sweep, as far as it has their data.

    Parameters
    ----------
    table : SweepTable
        The table of the sweep.

    Returns
    -------
    dict of matplotlib.figure.Figure
        By name.

    Raises
    ------
    InputError
        If no run is verified.
    """
    if not table.verified.any():
        raise InputError("has no verified run to draw", "see its column message", file=table.folder)
    width, case = 1.2 * len(table.sweep.over) + 5.5, Path(table.sweep.case).stem
    title = f"{case}: all runs, in the colour of their objective"
    parallel = partial(plot_parallel, table)
    figures = {"parallel": style.figure_of(width, 4.4, [parallel], title=title)}
    titles = {"front": "Pareto front", "map": "objective over two keys"}
    for name, panel in sweep_charts(table).items():
        figures[name] = style.figure_of_panels([panel], 6.2, 3.1, f"{case}: {titles[name]}")
    return figures
