"""Panels drawn by Matplotlib, in the common style of all figures, and figures as files.

Nothing is drawn by pyplot, and no rcParams are set.
"""

import io
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import TightLayoutEngine
from matplotlib.ticker import LogLocator, NullFormatter

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import write_new
from hkt_mdo.results.panel import Curve, Panel

LINES = ("-", "--", "-.", (0, (5, 1, 1, 1, 1, 1)), ":", (0, (8, 2)))
HATCHES = ("", "//", "..", "xx", "--", "oo")
"""Of bars, beside their colours."""
MARKERS = ("o", "s", "^", "D", "v", "X")
REFERENCE: dict[str, Any] = {"color": "0.45", "linewidth": 1.1}
FONT_SIZE = 9
DPI = 150
"""Dots per inch of a PNG."""
MOST_MARKERS = 40
"""On a curve: more would hide it."""
BESIDES = 1.3
"""Inches of a figure's height that its axes do not share: labels, legend and title."""


def figure_of(
    width: float,
    height: float,
    plots: Sequence[Callable[[Axes], Axes]],
    share: int | None = None,
    title: str = "",
) -> Figure:
    """Return a figure (inches) of plots, one below the other, with one legend above all.

    `share`: how many, up to the lowest, have one horizontal axis; None: all. Axes in scale are as
    high as what they show, and change the height of the figure.
    """
    figure = Figure(figsize=(width, height))
    if title:
        figure.suptitle(title.replace("$", r"\$"), fontsize=FONT_SIZE + 1.5)
    grid = figure.add_gridspec(len(plots), 1)
    panels = grid.subplots(squeeze=False)[:, 0]
    for ax in panels:
        ax.spines[:].set_in_layout(False)  # they lie on the axes' edges, and would measure ticks
    sharing = panels[len(panels) - (len(panels) if share is None else share) :]
    for ax in sharing[1:]:
        ax.sharex(sharing[0])
    for plot, ax in zip(plots, panels, strict=True):
        plot(ax)
    for ax in sharing[:-1]:
        ax.set_xlabel("")
        ax.tick_params(labelbottom=False)
    heights = [
        max(0.85, 1.3 * (width - 1.2) * ax.dataLim.height / ax.dataLim.width)
        if ax.get_aspect() == 1.0
        else (height - BESIDES) / len(panels)
        for ax in panels
    ]
    grid.set_height_ratios(heights)
    figure.align_ylabels()
    figure.set_figheight(BESIDES + sum(heights) + 0.16 * max(0, legend(figure.axes) - 2))
    TightLayoutEngine().execute(figure)
    return figure


def figure_of_panels(panels: Sequence[Panel], width: float, height: float, title: str) -> Figure:
    """Return a figure of the panels that have curves, `height` inches each.

    The last ones, with the same label, share their horizontal axis.
    """
    panels = [panel for panel in panels if panel.curves]
    share = [panel.across for panel in panels].count(panels[-1].across)
    plots = [partial(draw, panel) for panel in panels]
    return figure_of(width, BESIDES + height * len(plots), plots, share, title)


def draw(panel: Panel, ax: Axes) -> Axes:
    """Draw a panel on axes, without a legend, and return them."""
    if panel.log:
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter("{x:.0e}")
    if panel.log_across:
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter(NullFormatter())
    ranks = sorted({curve.index or 0 for curve in panel.curves if curve.kind == "bar"})
    for curve in panel.curves:
        _draw_curve(curve, ax, ranks)
        if curve.shade is not None:
            ax.figure.colorbar(ax.collections[-1], ax=ax, label=panel.shades)
    for span in panel.spans:
        foot = 0.0 if span.index is None else 0.015 + 0.04 * span.index
        top = 1.0 if span.index is None else foot + 0.03
        alpha = 0.2 if span.index is None else 1.0
        look: dict[str, Any] = {"color": span.color, "alpha": alpha, "linewidth": 0.8}
        ax.axvspan(span.low, span.high, foot, top, label=legend_name(span.name), zorder=0.5, **look)
    for x, y, text in panel.notes:
        above: dict[str, Any] = {"xytext": (0, 3), "textcoords": "offset points", "ha": "center"}
        ax.annotate(text, (x, y), fontsize=FONT_SIZE - 1.5, **above)
    if panel.in_scale:
        ax.set_aspect("equal", adjustable="datalim")
    elif not panel.log and panel.curves:
        ax.set_ylim(panel.ends)
    if panel.across_from_zero:
        ax.set_xlim(left=0.0)
    for name, value, left in panel.placed_levels:
        _draw_level(ax, value, name, left)
    for name, value in panel.marks.items():
        ax.axvline(value, label=name, linestyle=":", **REFERENCE)
    if panel.ticks:
        ax.set_xticks(range(len(panel.ticks)), panel.ticks)
        ax.set_xlim(-1.0, len(panel.ticks))
    return finish(ax, panel.across, panel.title)


def legend_name(name: str) -> str:
    """Return a name for Matplotlib's legend, which omits `_name` and reads ``$`` as mathematics."""
    shown = " " + name if name.startswith("_") else name or "_"
    return shown.replace("$", r"\$")


def _draw_curve(curve: Curve, ax: Axes, ranks: Sequence[int]) -> None:
    """Draw a curve; bars of the results with these indices stand one beside the other."""
    index, label, color = curve.index or 0, legend_name(curve.name), curve.color
    if curve.kind == "runs":
        look = {"color": color} if curve.shade is None else {"c": curve.shade, "s": 60}
        ax.scatter(curve.x, curve.y, marker=MARKERS[index], label=label, **look)
    elif curve.kind == "band":
        look = {"color": color, "alpha": 0.2, "linewidth": 0}
        ax.fill_between(curve.x, curve.low, curve.y, label=label, **look)
    elif curve.kind == "bar":
        step = min(np.diff(curve.x), default=0.5) / len(ranks)
        at = curve.x + step * (ranks.index(index) - 0.5 * (len(ranks) - 1))
        look = {"color": color, "hatch": HATCHES[index % len(HATCHES)], "edgecolor": "white"}
        ax.bar(at, curve.y, width=0.9 * step, label=label, **look)
    else:
        look = {"linestyle": LINES[index % len(LINES)], "linewidth": 1.5}
        if curve.index is None:
            look = REFERENCE | {"linestyle": ":"}
        look |= {"color": color, "label": label}
        if curve.kind != "line":
            size = 4.0 if curve.kind == "marked" else 5.0
            look |= {"marker": MARKERS[index % len(MARKERS)], "markersize": size}
            look |= {"markevery": max(1, curve.x.size // MOST_MARKERS)}
        if curve.kind == "points":
            look |= {"linestyle": "none", "markerfacecolor": "none"}
        ax.plot(curve.x, curve.y, **look)


def _draw_level(ax: Axes, value: float, label: str, left: bool) -> None:
    """Draw a horizontal line with its label above it; no legend has it."""
    ax.axhline(value, linestyle="-.", gid=label, **REFERENCE)
    side, x = ("left", 0.005) if left else ("right", 0.995)
    words: dict[str, Any] = {"fontsize": FONT_SIZE - 1.5, "color": "0.3", "ha": side}
    words["bbox"] = {"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.8}
    where: dict[str, Any] = {"xycoords": ax.get_yaxis_transform(), "textcoords": "offset points"}
    ax.annotate(label, (x, value), xytext=(0, 2.5), va="bottom", **where, **words)


def finish(ax: Axes, x_label: str, y_label: str) -> Axes:
    """Label the axes and draw a grid."""
    ax.set_xlabel(x_label, fontsize=FONT_SIZE)
    ax.set_ylabel(y_label, fontsize=FONT_SIZE)
    ax.tick_params(labelsize=FONT_SIZE)
    if ax.get_yscale() == "linear":
        ax.ticklabel_format(axis="y", useOffset=False)
    ax.grid(True, color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    return ax


def legend(axes: Sequence[Axes]) -> int:
    """Draw the legend of axes above the first, in columns as there is room; return its rows."""
    entries: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if not entries:
        return 0
    fitting = int((axes[0].figure.get_figwidth() - 0.7) / (0.6 + 0.06 * max(map(len, entries))))
    columns = max(1, min(fitting, 3 if len(entries) == 3 else 2))
    where: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": columns}
    look = {"fontsize": FONT_SIZE, "frameon": False, "borderaxespad": 0.2}
    axes[0].legend(list(entries.values()), list(entries), **where, **look)
    return -(-len(entries) // columns)


_OPTIONS: dict[str, dict[str, Any]] = {
    "pdf": {"metadata": {"CreationDate": None}},  # equal results give equal files
    "png": {"pil_kwargs": {"compress_level": 3}},  # a tenth larger, in half the time
}


def picture(figure: Figure, form: str = "png") -> bytes:
    """Return a figure as a file of a format."""
    drawn = io.BytesIO()
    with rc_context({"pdf.fonttype": 42}):  # as journals ask for
        figure.savefig(drawn, format=form, dpi=DPI, **_OPTIONS.get(form, {}))
    return drawn.getvalue()


def pictures(
    figures: Mapping[str, Figure], folder: str | Path, formats: Sequence[str]
) -> dict[Path, bytes]:
    """Return figures as the contents of the files NAME.FORMAT in a folder; nothing is written.

    Raises InputError if Matplotlib does not know a format.
    """
    supported = sorted(FigureCanvasAgg.get_supported_filetypes())
    for form in formats:
        if form not in supported:
            words = f"known: {', '.join(supported)}"
            raise InputError("unknown format of figures", words, key="format", value=form)
    return {
        Path(folder, f"{name}.{form}"): picture(figure, form)
        for name, figure in figures.items()
        for form in formats
    }


def save(
    figures: Mapping[str, Figure], folder: str | Path, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write `pictures` into a folder that is made if need be, and return their paths.

    Raises InputError as `pictures`, or if a file cannot be written.
    """
    return write_new(pictures(figures, folder, formats), force=True)
