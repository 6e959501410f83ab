"""The common style of all figures, and what every plot needs: axes, legends, files.

Margins are set in inches rather than found by Matplotlib's layout engines, which draw a figure
several times. No rcParams are set.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from hkt_mdo.errors import InputError

COLORS = ("#0b3c6f", "#c4501b", "#4fb286", "#8a4fa3", "#b8860b", "#4a4a4a")
LINES = ("-", "--", "-.", (0, (5, 1, 1, 1, 1, 1)), ":", (0, (8, 2)))
MARKERS = ("o", "s", "^", "D", "v", "X")
REFERENCE: dict[str, Any] = {"color": "0.45", "linewidth": 1.1}
FONT_SIZE = 9
MOST_INSIDE = 4  # entries of a legend; more would hide the lines

# in inches
_LEFT, _RIGHT, _BOTTOM, _TOP, _GAP, _LABEL, _LEGEND_ROW = 0.9, 0.2, 0.5, 0.15, 0.15, 0.62, 0.21


def new_axes() -> Axes:
    """Return the axes of a new figure, with room for a legend above and an axis at the right."""
    figure = _empty(6.2, 3.9)
    ax = figure.subplots()
    _fit(figure, rows=3, right=_LEFT)
    return ax


def figure_of(
    width: float, height: float, plots: Sequence[Callable[[Axes], Axes]], share: bool = True
) -> Figure:
    """Return a figure (inches) of plots, one below the other, with one legend above all.

    `share`: the plots have the same horizontal axis.
    """
    figure = _empty(width, height)
    for plot, ax in zip(plots, np.ravel(figure.subplots(len(plots), sharex=share)), strict=True):
        plot(ax)
    for ax in figure.axes:
        if (own := ax.get_legend()) is not None:
            own.remove()
        if share:
            ax.label_outer()
    right = _LEFT if len(figure.axes) > len(plots) else _RIGHT
    _fit(figure, legend(figure.axes, above=True), right, _GAP if share else _BOTTOM)
    return figure


def _empty(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def _fit(figure: Figure, rows: int, right: float, gap: float = _GAP) -> None:
    """Set margins and gaps (inches) that hold tick labels, axis labels and rows of a legend."""
    width, height = figure.get_size_inches()
    bottom, top = _BOTTOM, height - _TOP - _LEGEND_ROW * rows
    count = len({ax.get_subplotspec().rowspan.start for ax in figure.axes})
    panel = (top - bottom - gap * (count - 1)) / count
    figure.subplots_adjust(
        _LEFT / width, bottom / height, 1.0 - right / width, top / height, hspace=gap / panel
    )
    for ax in figure.axes:
        if ax.yaxis.get_label_position() == "left":
            ax.yaxis.set_label_coords(-_LABEL / (width - _LEFT - right), 0.5)


def line(index: int) -> dict[str, Any]:
    """Return colour and line style of a solution: they differ in grey, too."""
    look = {"color": COLORS[index % len(COLORS)], "linestyle": LINES[index % len(LINES)]}
    return look | {"linewidth": 1.5}


def marker(index: int, size: float = 6.0) -> dict[str, Any]:
    """Return the marker of a solution."""
    return {"marker": MARKERS[index % len(MARKERS)], "markersize": size}


def finish(ax: Axes, x_label: str, y_label: str, above: bool = False, grid: bool = True) -> Axes:
    """Label the axes, draw a grid and a legend; `above` the axes or, if it is short, inside."""
    ax.set_xlabel(x_label, fontsize=FONT_SIZE)
    ax.set_ylabel(y_label, fontsize=FONT_SIZE)
    ax.tick_params(labelsize=FONT_SIZE)
    formatter = ax.yaxis.get_major_formatter()
    if isinstance(formatter, ScalarFormatter):
        formatter.set_useOffset(False)
    if grid:
        ax.grid(True, color="0.88", linewidth=0.6)
        ax.set_axisbelow(True)
        legend([ax], above)
    return ax


def legend(axes: Sequence[Axes], above: bool) -> int:
    """Draw the legend of some axes on the first; return its number of rows above the axes."""
    entries: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if not entries:
        return 0
    rows, place = 0, {"loc": "best", "framealpha": 0.9, "edgecolor": "0.8"}
    if above or len(entries) > MOST_INSIDE:
        columns, width = 3 if len(entries) == 3 else 2, 0.6 + 0.06 * max(map(len, entries))
        while columns > 1 and columns * width > axes[0].figure.get_figwidth() - 0.7:
            columns -= 1
        rows = ceil(len(entries) / columns)
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "borderaxespad": 0.2}
        place |= {"ncols": columns, "frameon": False}
    axes[0].legend(list(entries.values()), list(entries), fontsize=FONT_SIZE, **place)
    return rows


def widen(ax: Axes) -> None:
    """Give the vertical axis at least 1 % of the value, so that a constant is a straight line."""
    low, high = ax.get_ylim()
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), 0.005 * abs(middle))
    ax.set_ylim(middle - half, middle + half)


def save(
    figures: Mapping[str, Figure], folder: str | Path, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write figures as NAME.FORMAT and return the paths.

    The folder is made if it does not exist; files of the same names are replaced. Raises InputError
    if Matplotlib does not know a format; nothing has been written then.
    """
    known = sorted(FigureCanvasAgg.get_supported_filetypes())
    for form in formats:
        if form not in known:
            words = f"known: {', '.join(known)}"
            raise InputError("unknown format of figures", words, key="format", value=form)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, figure in figures.items():
        for form in formats:
            path = folder / f"{name}.{form}"
            # without a date, equal results give equal files; journals ask for fonts of type 42
            extra: dict[str, Any] = {"metadata": {"CreationDate": None}} if form == "pdf" else {}
            with rc_context({"pdf.fonttype": 42}):
                figure.savefig(path, dpi=150, **extra)
            written.append(path)
    return written
