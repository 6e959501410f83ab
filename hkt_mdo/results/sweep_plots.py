"""Figures of a sweep: Pareto front, map, parallel coordinates."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes

from hkt_mdo.errors import InputError
from hkt_mdo.results import style
from hkt_mdo.results.sweep import SweepTable


def plot_front(table: SweepTable, ax: Axes | None = None) -> Axes:
    """Plot the objective over the cost of every run, and the Pareto front."""
    ax, front, good = ax or style.new_axes(), table.front(), table.verified
    (cost, across), (objective, up) = table.shown(table.cost), table.shown("objective")
    look = {"linestyle": "none", **style.marker(0, 4.0)}
    ax.plot(cost[good], objective[good], color="0.6", label="verified runs", **look)
    words = "Pareto front: none is better in both"
    ax.plot(cost[front], objective[front], marker="s", label=words, **style.line(1))
    return style.finish(ax, across, up)


def plot_map(table: SweepTable, ax: Axes | None = None) -> Axes:
    """Plot the objective over the first two keys of numbers; crosses are runs without success.

    Of runs that differ in other keys, the best is on top.
    """
    ax, axes = ax or style.new_axes(), [table.shown(key) for key in table.numeric[:2]]
    good, sign = table.verified, 1.0 if table.maximize else -1.0
    order = np.flatnonzero(good)[np.argsort(sign * table.objective[good])]
    objective, label = table.shown("objective")
    drawn = ax.scatter(
        *(x[order] for x, _ in axes), c=objective[order], s=60, marker="s", cmap="viridis"
    )
    ax.figure.colorbar(drawn, ax=ax, label=label)
    if not good.all():
        look = {"linestyle": "none", "marker": "x", "color": style.COLORS[1]}
        ax.plot(*(x[~good] for x, _ in axes), label="no success", **look)
    return style.finish(ax, *(label for _, label in axes))


def plot_parallel(table: SweepTable, ax: Axes | None = None) -> Axes:
    """Plot each verified run as a line across keys and outcomes, each from least to largest.

    The colour is that of the objective.
    """
    ax, good = ax or style.new_axes(), np.flatnonzero(table.verified)
    names = [*table.sweep.over, *(x for x in _OUTCOMES if x in table.columns)]
    heights, labels = [], []
    for name in names:
        column = table.columns[name][good]
        if column.dtype.kind == "f":
            shown, name = table.shown(name)
            column = shown[good]
        if column.dtype.kind != "f":  # names: one place each
            known, column = np.unique(column, return_inverse=True)
            ends = known[0], known[-1]
        else:
            ends = tuple(f"{end:.4g}" for end in (np.nanmin(column), np.nanmax(column)))
        low, span = np.nanmin(column), np.ptp(column[np.isfinite(column)])
        heights.append((column - low) / span if span else np.full(good.size, 0.5))
        labels.append(f"{name}\n{ends[0]} to {ends[1]}")
    order = np.argsort(table.objective[good])
    shades = np.linspace(0.0, 1.0, good.size)
    for shade, place in zip(shades, order, strict=True):
        ax.plot([each[place] for each in heights], color=colormaps["viridis"](shade), alpha=0.6)
    ax = style.finish(ax, "", "from least to largest (-)")
    ax.set_xticks(range(len(names)), labels, fontsize=style.FONT_SIZE - 2)
    return ax


_OUTCOMES = "objective", "mass_kg", "thrust_N", "stress_Pa"


def save_figures(table: SweepTable, folder: Path, formats: Sequence[str] = ("png",)) -> list[Path]:
    """Draw front, map and parallel coordinates of a sweep, as far as it has their data.

    Parameters
    ----------
    table : SweepTable
        The table of the sweep.
    folder : pathlib.Path
        Where to.
    formats : sequence of str
        File formats, such as png or pdf.

    Returns
    -------
    list of pathlib.Path
        The files.

    Raises
    ------
    InputError
        If no run is verified, or a format is unknown.
    """
    if not table.verified.any():
        raise InputError("has no verified run to draw", "see its column message", file=table.folder)
    width = 1.2 * len(table.sweep.over) + 5.5
    plots = {"parallel": (plot_parallel, "all runs, in the colour of their objective", width)}
    if table.cost:
        plots["front"] = plot_front, "Pareto front", 6.2
    if len(table.numeric) > 1:
        plots["map"] = plot_map, "objective over two keys", 6.2
    case = Path(table.sweep.case).stem
    figures = {
        name: style.figure_of(wide, 4.4, [partial(plot, table)], title=f"{case}: {words}")
        for name, (plot, words, wide) in plots.items()
    }
    return style.save(figures, folder, formats)
