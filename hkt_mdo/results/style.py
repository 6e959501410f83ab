"""The common style of all figures, with axes, legends and files.

Nothing is drawn by pyplot, and no rcParams are set.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import TightLayoutEngine

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import make_folder, write_files

COLORS = ("#0b3c6f", "#c4501b", "#4fb286", "#8a4fa3", "#b8860b", "#4a4a4a")
LINES = ("-", "--", "-.", (0, (5, 1, 1, 1, 1, 1)), ":", (0, (8, 2)))
HATCHES = ("", "//", "..", "xx", "--", "oo")
"""Of bars, beside their colours."""
MARKERS = ("o", "s", "^", "D", "v", "X")
QUANTITY_COLORS = {
    "inflow_speed": COLORS[5],
    **dict.fromkeys(("rotor_speed", "tip_speed_ratio", "tip_speed"), COLORS[0]),
    **dict.fromkeys(("power", "generator_power", "electrical_power"), COLORS[1]),
    **dict.fromkeys(("thrust", "root_moment"), COLORS[2]),
    **dict.fromkeys(("control_torque", "hydrodynamic_torque", "torque_rate"), COLORS[3]),
    "stress": COLORS[4],
    "cavitation": "#2b9fd1",
}
"""Colour of a quantity, and of its limit, in every figure of one result."""
REFERENCE: dict[str, Any] = {"color": "0.45", "linewidth": 1.1}
FONT_SIZE = 9
DPI = 150
"""Dots per inch of a PNG."""
BESIDES = 1.3
"""Inches of a figure's height that its axes do not share: labels, legend and title."""


class _Layout(TightLayoutEngine):
    """A layout in which the labels of the vertical axes are aligned.

    `Figure.align_ylabels` measures all vertical axes again for each of them.
    """

    def execute(self, fig: Figure) -> None:
        """Lay the axes out, then move each label as far to the left as the leftmost one."""
        super().execute(fig)
        if scaled := [ax for ax in fig.axes if ax.get_aspect() == 1.0]:
            for ax in scaled:
                ax.apply_aspect()  # to this size, which gives it other ticks
            super().execute(fig)
        axes = [ax.yaxis for ax in fig.axes if ax.get_ylabel()]
        labels = [axis for axis in axes if axis.get_label_position() == "left"]  # no colour bar
        left = [axis.label.get_window_extent().x0 for axis in labels]
        for axis, start in zip(labels, left, strict=True):
            axis.labelpad += (start - min(left)) * 72.0 / fig.dpi


def new_axes() -> Axes:
    """Return the axes of a new figure."""
    return figure_of(6.2, 3.9, [lambda ax: ax]).axes[0]


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
    figure = Figure(figsize=(width, height), layout=_Layout())
    FigureCanvasAgg(figure)
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
        if (own := ax.get_legend()) is not None:
            own.remove()
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
    rows = legend(figure.axes)
    figure.set_figheight(BESIDES + sum(heights) + 0.16 * max(0, rows - 2))
    return figure


def line(index: int) -> dict[str, Any]:
    """Return colour and line style of a solution: they differ in grey, too."""
    look = {"color": COLORS[index % len(COLORS)], "linestyle": LINES[index % len(LINES)]}
    return look | {"linewidth": 1.5}


def marker(index: int, size: float = 6.0) -> dict[str, Any]:
    """Return the marker of a solution."""
    return {"marker": MARKERS[index % len(MARKERS)], "markersize": size}


def bar(index: int) -> dict[str, Any]:
    """Return colour and hatch of a solution's bars: they differ in grey, too."""
    look = {"color": COLORS[index % len(COLORS)], "hatch": HATCHES[index % len(HATCHES)]}
    return look | {"edgecolor": "white"}


def colored(look: dict[str, Any], quantity: str) -> dict[str, Any]:
    """Return a look in the colour of a quantity, if it has one."""
    return look | {"color": QUANTITY_COLORS.get(quantity, look["color"])}


_SIDES = ("right", 0.995), ("left", 0.005), ("center", 0.5)


def level(ax: Axes, value: float, label: str, number: int | None = None) -> None:
    """Draw a horizontal line with its label above it, each at another place; no legend has it.

    `number`: of the place; None: that after those taken.
    """
    taken = sum(line.get_gid() == _TOLD for line in ax.lines)
    side, place = _SIDES[(taken if number is None else number) % len(_SIDES)]
    ax.axhline(value, linestyle="-.", label=label, gid=_TOLD, **REFERENCE)
    low, high = ax.get_ylim()
    ax.set_ylim(low, max(high, value + 0.16 * (max(high, value) - low)))  # room for the label
    words: dict[str, Any] = {"fontsize": FONT_SIZE - 1.5, "color": "0.3", "ha": side}
    words["bbox"] = {"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.8}
    where: dict[str, Any] = {"xycoords": ax.get_yaxis_transform(), "textcoords": "offset points"}
    ax.annotate(label, (place, value), xytext=(0, 2.5), va="bottom", **where, **words)


_TOLD = "told beside it"


def finish(ax: Axes, x_label: str, y_label: str) -> Axes:
    """Label the axes, draw a grid, and a legend above."""
    ax.set_xlabel(x_label, fontsize=FONT_SIZE)
    ax.set_ylabel(y_label, fontsize=FONT_SIZE)
    ax.tick_params(labelsize=FONT_SIZE)
    if ax.get_yscale() == "linear":
        ax.ticklabel_format(axis="y", useOffset=False)
    ax.grid(True, color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    legend([ax])
    return ax


def legend(axes: Sequence[Axes]) -> int:
    """Draw the legend of axes above the first, in columns as there is room; return its rows."""
    entries: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            if getattr(handle, "get_gid", lambda: None)() != _TOLD:
                entries.setdefault(label, handle)
    if not entries:
        return 0
    room = axes[0].figure.get_figwidth() - 0.7
    fitting = int(room / (0.6 + 0.06 * max(map(len, entries))))
    columns = max(1, min(fitting, 3 if len(entries) == 3 else 2))
    place: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": columns}
    look = {"fontsize": FONT_SIZE, "frameon": False, "borderaxespad": 0.2}
    axes[0].legend(list(entries.values()), list(entries), **place, **look)
    return -(-len(entries) // columns)


def widen(ax: Axes) -> None:
    """Give the vertical axis at least 1 % of the value, so that a constant is a straight line."""
    low, high = ax.get_ylim()
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), 0.005 * abs(middle))
    ax.set_ylim(middle - half, middle + half)


@contextmanager
def _laid_out(figure: Figure, dpi: float) -> Iterator[None]:
    """Lay a figure out once, since `savefig` would draw everything twice to compute the layout."""
    engine, before = figure.get_layout_engine(), figure.dpi
    if engine is None:
        yield
        return
    figure.set_dpi(dpi)
    engine.execute(figure)
    figure.set_layout_engine(None)
    try:
        yield
    finally:
        figure.set_layout_engine(engine)
        figure.set_dpi(before)


def png(figure: Figure) -> bytes:
    """Return a figure as a PNG."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DPI)
    return drawn.getvalue()


_OPTIONS: dict[str, dict[str, Any]] = {
    "pdf": {"metadata": {"CreationDate": None}},  # equal results give equal files
    "png": {"pil_kwargs": {"compress_level": 3}},  # a tenth larger, in half the time
}


def save(
    figures: Mapping[str, Figure], folder: str | Path, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write figures as NAME.FORMAT, into a folder that is made if need be; return the paths.

    Raises InputError if Matplotlib does not know a format, when nothing has been written, or a file
    cannot be written.
    """
    known = sorted(FigureCanvasAgg.get_supported_filetypes())
    for form in formats:
        if form not in known:
            words = f"known: {', '.join(known)}"
            raise InputError("unknown format of figures", words, key="format", value=form)
    make_folder(Path(folder))
    written = []
    for name, figure in figures.items():
        with rc_context({"pdf.fonttype": 42}), _laid_out(figure, DPI):  # as journals ask for
            for form in formats:
                drawn = io.BytesIO()
                figure.savefig(drawn, format=form, dpi=DPI, **_OPTIONS.get(form, {}))
                written.append(Path(folder, f"{name}.{form}"))
                write_files({written[-1]: drawn.getvalue()})
    return written
