"""Panels of a chart, one below the other, as the plain data that plotly.js draws.

A chart is a dictionary with `data`, the traces, and `layout`. Colours are those of the figures
(`hkt_mdo.results.style`), and the page replaces them by `DARK` on a dark screen. Of a single
result, a quantity has its own colour; several results differ by colour and dashes.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hkt_mdo.results import style
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import printable

Chart = dict[str, Any]
GROUND = "#ffffff"
DARK = dict(
    zip(
        (*style.COLORS, style.QUANTITY_COLORS["cavitation"], GROUND),
        ("#78aee6", "#f08d57", "#6fd3a5", "#c594dc", "#e2b549", "#b9b9b9", "#6fcdf5", "#14181d"),
        strict=True,
    )
)
"""The colour on a dark screen of each colour on a light one."""
DASHES = "solid", "dash", "dashdot", "longdashdot", "dot", "longdash"
FAINT = "#4a4a4a"


class Labelled(NamedTuple):
    """A result of a report and the name that the page gives it; "" where it is the only one."""

    solution: Solution
    label: str


@dataclass
class Panel:
    """Axes of a chart: its title, traces, and levels that are drawn across it, with their names."""

    title: str
    traces: list[dict[str, Any]] = field(default_factory=list)
    levels: dict[str, float] = field(default_factory=dict)
    marks: dict[str, float] = field(default_factory=dict)
    """Places on the horizontal axis, by name."""
    from_zero: bool = False
    log: bool = False
    left: bool = False
    """Whether the first level has its name on the left."""


def thinned(time: np.ndarray, values: np.ndarray, most: int) -> np.ndarray:
    """Return the places of a series that a chart needs: the extremes of equal parts are kept.

    Parameters
    ----------
    time, values : numpy.ndarray, shape (n_times,)
        The series; NaN is a gap in a line.
    most : int
        Largest number of places, but for gaps.

    Returns
    -------
    numpy.ndarray of int
        Places in their order: the smallest and the largest value of each part, both ends, gaps.
    """
    size = values.size
    if size <= most:
        return np.arange(size)
    edges = np.linspace(0, size, max(1, (most - 2) // 2) + 1).astype(int)
    kept = [0, size - 1, *np.flatnonzero(~np.isfinite(values) | ~np.isfinite(time))]
    for begin, end in pairwise(edges):
        if np.any(np.isfinite(values[begin:end])):
            part = values[begin:end]
            kept += [begin + np.nanargmin(part), begin + np.nanargmax(part)]
    return np.unique(kept)


def plain(values: Any, digits: int = 5) -> list[float | None]:
    """Return numbers as a chart takes them.

    Parameters
    ----------
    values : array_like
        Numbers.
    digits : int
        Significant digits that are kept.

    Returns
    -------
    list
        None in place of NaN and infinity.
    """
    return [float(f"{x:.{digits}g}") if np.isfinite(x) else None for x in np.ravel(values)]


def escaped(text: str) -> str:
    """Return a text of which plotly.js, whose texts may have tags, takes none for one.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        The text with entities in place of the signs of a tag.
    """
    return html.escape(printable(text))


def line(x: Any, y: Any, name: str, color: str, **more: Any) -> dict[str, Any]:
    """Return a line as a trace.

    Parameters
    ----------
    x, y : array_like
        The points.
    name : str
        Name in the legend, escaped.
    color : str
        Colour on a light screen.
    **more
        `dash`, `width` and `mode`, and other keys of a trace.

    Returns
    -------
    dict
        The trace.
    """
    look = {"color": color, "dash": more.pop("dash", "solid"), "width": more.pop("width", 1.8)}
    shown = {"type": "scatter", "mode": more.pop("mode", "lines"), "name": name}
    return {"x": plain(x, 7), "y": plain(y), **shown, "line": look, "legendgroup": name, **more}


def band(
    x: Any, low: Any, high: Any, name: str, color: str, width: float = 0.0
) -> list[dict[str, Any]]:
    """Return a filled range as traces.

    Parameters
    ----------
    x, low, high : array_like
        Places and ends of the range.
    name : str
        Name in the legend, escaped.
    color : str
        Colour on a light screen.
    width : float
        Of the edges, which are not drawn without one.

    Returns
    -------
    list of dict
        The traces of both edges, filled between.
    """
    quiet: dict[str, Any] = {"width": width} if width else {"width": 0.0, "hoverinfo": "skip"}
    lower = line(x, low, name, color, showlegend=False, **quiet)
    return [lower, line(x, high, name, color, fill="tonexty", fillcolor=f"{color}33", **quiet)]


GAP = 42
"""Pixels between two panels, for title and labels."""


def stacked(panels: Sequence[Panel], x_title: str, height: int = 150) -> Chart | None:
    """Return panels one below the other, over one horizontal axis.

    Parameters
    ----------
    panels : sequence of Panel
        Those without traces are left out.
    x_title : str
        Title of the horizontal axis.
    height : int
        Of each panel, in pixels.

    Returns
    -------
    dict or None
        The chart, whose height is without its margins; None where no panel has traces.
    """
    panels = [panel for panel in panels if panel.traces]
    if not panels:
        return None
    plotted = len(panels) * (height + GAP)
    layout: dict[str, Any] = {"height": plotted, "annotations": [], "shapes": []}
    last = "y" if len(panels) == 1 else f"y{len(panels)}"
    layout["xaxis"] = {"title": {"text": x_title}, "anchor": last}
    data: list[dict[str, Any]] = []
    named: set[str] = set()
    for number, panel in enumerate(panels, 1):
        top = 1.0 - ((number - 1) * (height + GAP) + 0.6 * GAP) / plotted
        key = "" if number == 1 else str(number)
        axis = {"domain": [max(0.0, top - height / plotted), top], "anchor": "x"}
        layout[f"yaxis{key}"] = axis | _vertical(panel)
        title = {"text": f"<b>{panel.title}</b>", "x": 0, "xanchor": "left", "xref": "paper"}
        layout["annotations"].append(title | _at(f"y{key} domain", 1.0) | {"yanchor": "bottom"})
        for trace in panel.traces:
            first = trace["name"] not in named and trace.get("showlegend", True)
            named |= {trace["name"]} if first else set()
            data.append(trace | {"xaxis": "x", "yaxis": f"y{key}", "showlegend": first})
        _draw_levels(layout, panel, key)
    return {"data": data, "layout": layout}


def _at(reference: str, place: float) -> dict[str, Any]:
    return {"yref": reference, "y": place, "showarrow": False, "font": {"size": 12}}


def _vertical(panel: Panel) -> dict[str, Any]:
    """Return the vertical axis of a panel, which shows its levels too."""
    if panel.log:
        return {"type": "log", "exponentformat": "power", "dtick": 2}
    values = [x for trace in panel.traces for x in trace["y"] if x is not None]
    values += [*panel.levels.values(), *([0.0] if panel.from_zero else [])]
    low, high = (min(values), max(values)) if values else (0.0, 1.0)
    middle, half = 0.5 * (low + high), max(0.54 * (high - low), 0.005 * abs(high), 1e-9)
    least = low if panel.from_zero and low >= 0.0 else middle - half
    room = 0.14 * 2.0 * half if panel.levels else 0.0
    return {"range": plain([least, middle + half + room]), "nticks": 5}


def _draw_levels(layout: dict[str, Any], panel: Panel, key: str) -> None:
    """Draw the levels and the marks of a panel with their names."""
    look: Chart = {"line": {"color": FAINT, "width": 1.2, "dash": "dashdot"}, "type": "line"}
    look["layer"] = "below"  # a curve at its limit is seen
    for number, (name, level) in enumerate(panel.levels.items()):
        ends = {"xref": "paper", "x0": 0, "x1": 1, "yref": f"y{key}", "y0": level, "y1": level}
        layout["shapes"].append(look | ends)
        # above the smallest chord there is room on the left, where the root is
        left = {"smallest": 1, "largest": 0}.get(name.partition(" ")[0], (number + panel.left) % 2)
        side, place = (("right", 1.0), ("left", 0.0))[left]
        words = {"text": escaped(name), "xref": "paper", "x": place, "xanchor": side}
        small = {"yanchor": "bottom", "font": {"size": 11, "color": FAINT}}
        over = {"bgcolor": f"{GROUND}bb", "borderpad": 0}  # the curve of another result
        layout["annotations"].append(words | _at(f"y{key}", level) | small | over)
    for name, place in panel.marks.items():
        ends = {"xref": "x", "x0": place, "x1": place, "yref": f"y{key} domain", "y0": 0, "y1": 1}
        layout["shapes"].append(look | ends)
        words = {"text": escaped(name), "xref": "x", "x": place, "xanchor": "right"}
        small = {"yanchor": "bottom", "font": {"size": 11, "color": FAINT}}
        layout["annotations"].append(words | _at(f"y{key} domain", 0.0) | small)


class Look(NamedTuple):
    """Colour and dashes of a result among several, or of a quantity of a single one."""

    color: str
    dash: str

    @classmethod
    def of(cls, index: int, labelled: Labelled, quantity: str = "") -> Look:
        """Return the look of a result.

        Parameters
        ----------
        index : int
            Its place among the results.
        labelled : Labelled
            The result.
        quantity : str
            What is drawn; of a single result it has its own colour.

        Returns
        -------
        Look
            Colour and dashes.
        """
        color = style.COLORS[index % len(style.COLORS)]
        if not labelled.label:
            color = style.QUANTITY_COLORS.get(quantity, color)
        return cls(color, DASHES[index % len(DASHES)])
