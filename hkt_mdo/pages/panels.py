"""The charts of a report as the plain data that plotly.js draws.

A chart is a dictionary with `data`, the traces, and `layout`. Colours are those of the figures
(`hkt_mdo.results.panel`), and the page replaces them by `DARK` on a dark screen.
"""

import html
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from hkt_mdo.results import charts
from hkt_mdo.results.charts import Results
from hkt_mdo.results.panel import COLORS, GREY, QUANTITY_COLORS, Curve, Panel
from hkt_mdo.results.words import printable

Chart = dict[str, Any]
GROUND = "#ffffff"
DARK = dict(
    zip(
        (*COLORS, QUANTITY_COLORS["cavitation"], GROUND),
        ("#78aee6", "#f08d57", "#6fd3a5", "#c594dc", "#e2b549", "#b9b9b9", "#6fcdf5", "#14181d"),
        strict=True,
    )
)
"""The colour on a dark screen of each colour on a light one."""
DASHES = "solid", "dash", "dashdot", "longdashdot", "dot", "longdash"
SYMBOLS = "circle", "square", "triangle-up", "diamond", "triangle-down", "x"
HATCHES = "", "/", ".", "x", "-", "+"
GAP = 42
"""Pixels between two panels, for title and labels."""
MOST_POINTS, LEAST_POINTS = 100_000, 60
"""Points of all series of a page together, and of a series at least."""
MOST_OF_ONE = 6000


def points_each(results: Results) -> int:
    """Return how many points of a series a page has room for.

    Parameters
    ----------
    results : sequence of Labelled
        All results of the page.

    Returns
    -------
    int
        Number of points.
    """
    series = 10 * sum(len(result.solution.scenarios) for result in results)
    return int(np.clip(MOST_POINTS // max(1, series), LEAST_POINTS, MOST_OF_ONE))


def thinned(time: np.ndarray, values: np.ndarray, most: int) -> np.ndarray:
    """Return the indices of a series that a chart needs: the extremes of equal parts are kept.

    Parameters
    ----------
    time, values : numpy.ndarray, shape (n_times,)
        The series; NaN is a gap in a line.
    most : int
        Largest number of indices, but for gaps.

    Returns
    -------
    numpy.ndarray of int
        In their order: those of the smallest and the largest value of each part, both ends, gaps.
    """
    size = values.size
    if size <= most:
        return np.arange(size)
    edges = np.linspace(0, size, max(1, (most - 2) // 2) + 1).astype(int)
    indices = [0, size - 1, *np.flatnonzero(~np.isfinite(values) | ~np.isfinite(time))]
    for begin, end in pairwise(edges):
        if np.any(np.isfinite(values[begin:end])):
            part = values[begin:end]
            indices += [begin + np.nanargmin(part), begin + np.nanargmax(part)]
    return np.unique(indices)


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


def _traces(curve: Curve, most: int, shades: str = "") -> list[Chart]:
    """Return a curve as traces, of at most so many points; `shades` names what its colours are."""
    index, name = curve.index or 0, escaped(curve.name)
    named: Chart = {"name": name, "legendgroup": name, "showlegend": bool(name)}
    shown = thinned(curve.x, curve.y, most) if curve.kind in ("line", "marked") else slice(None)
    dash = "dot" if curve.index is None else DASHES[index % len(DASHES)]
    trace = named | {"type": "scatter", "mode": "lines"}
    trace |= {"x": plain(curve.x[shown], 7), "y": plain(curve.y[shown])}
    marker: Chart = {"color": curve.color}
    trace |= {"customdata": list(np.array(curve.links)[shown])} if len(curve.links) else {}
    if curve.kind == "runs":
        marker |= {"symbol": SYMBOLS[index], "size": 9 if curve.shade is None else 14}
        if curve.shade is not None:
            marker |= {"color": plain(curve.shade), "colorscale": "Viridis", "showscale": True}
            marker["colorbar"] = {"title": {"text": shades}}
        return [trace | {"mode": "markers", "marker": marker}]
    if curve.kind == "bar":
        marker["pattern"] = {"shape": HATCHES[index % len(HATCHES)], "fillmode": "overlay"}
        return [trace | {"type": "bar", "offsetgroup": str(index), "marker": marker}]
    trace["line"] = {"color": curve.color, "dash": dash, "width": 1.6}
    if curve.kind == "band":
        edge = trace | {"line": {"color": curve.color, "width": 1.0}}
        lower = edge | {"y": plain(curve.low), "showlegend": False}
        return [lower, edge | {"fill": "tonexty", "fillcolor": f"{curve.color}33"}]
    if curve.kind == "marked":
        trace |= {"mode": "lines+markers", "marker": marker | {"size": 5}}
    if curve.kind == "points":
        trace |= {"mode": "markers", "marker": marker | {"size": 9, "symbol": "circle-open"}}
    return [trace]


def stacked(panels: Sequence[Panel], height: int = 150, most: int = MOST_OF_ONE) -> Chart | None:
    """Return panels one below the other, over one horizontal axis.

    Parameters
    ----------
    panels : sequence of Panel
        Those without curves are left out.
    height : int
        Of each panel, in pixels.
    most : int
        Largest number of points of a curve.

    Returns
    -------
    dict or None
        The chart, whose height is without its margins; None where no panel has curves.
    """
    panels = [panel for panel in panels if panel.curves]
    if not panels:
        return None
    plotted = len(panels) * (height + GAP)
    layout: Chart = {"height": plotted, "annotations": [], "shapes": []}
    last = "y" if len(panels) == 1 else f"y{len(panels)}"
    layout["xaxis"] = {"title": {"text": panels[-1].across}, "anchor": last}
    if ticks := panels[-1].ticks:
        texts = [escaped(tick).replace("\n", "<br>") for tick in ticks]
        layout["xaxis"] |= {"tickvals": [*range(len(texts))], "ticktext": texts}
        layout["xaxis"]["range"] = [-1, len(texts)]
    if panels[-1].across_from_zero:
        layout["xaxis"]["rangemode"] = "tozero"
    data: list[Chart] = []
    named: set[str] = set()
    for number, panel in enumerate(panels, 1):
        top = 1.0 - ((number - 1) * (height + GAP) + 0.6 * GAP) / plotted
        key = "" if number == 1 else str(number)
        axis = {"domain": [max(0.0, top - height / plotted), top], "anchor": "x"}
        text = f"<b>{panel.title}</b>".replace("\n", " ")
        title = {"text": text, "x": 0, "xanchor": "left", "xref": "paper"}
        layout["annotations"].append(title | _at(f"y{key} domain", 1.0))
        traces = [trace for curve in panel.curves for trace in _traces(curve, most, panel.shades)]
        layout[f"yaxis{key}"] = axis | _vertical(panel)
        for trace in traces:
            first = trace["name"] not in named and trace["showlegend"]
            named |= {trace["name"]} if first else set()
            data.append(trace | {"xaxis": "x", "yaxis": f"y{key}", "showlegend": first})
        _draw_lines(layout, panel, key)
    return {"data": data, "layout": layout}


def _at(reference: str, y: float, size: int = 12) -> Chart:
    font = {"size": size} if size == 12 else {"size": size, "color": GREY}
    return {"yref": reference, "y": y, "showarrow": False, "font": font, "yanchor": "bottom"}


def _vertical(panel: Panel) -> Chart:
    """Return the vertical axis of a panel."""
    if panel.log:
        return {"type": "log", "exponentformat": "power", "dtick": 2}
    if panel.in_scale:
        return {"scaleanchor": "x", "nticks": 3, "zeroline": False}
    return {"range": plain(panel.ends), "nticks": 5}


def _draw_lines(layout: Chart, panel: Panel, key: str) -> None:
    """Draw the levels, marks, spans and notes of a panel with their names."""
    look: Chart = {"line": {"color": GREY, "width": 1.2, "dash": "dashdot"}, "type": "line"}
    bars = panel.curves[0].kind == "bar"
    look["layer"] = "above" if bars else "below"  # a curve at its limit is seen
    shapes, notes = layout["shapes"], layout["annotations"]
    for name, level, left in panel.placed_levels:
        ends = {"xref": "paper", "x0": 0, "x1": 1, "yref": f"y{key}", "y0": level, "y1": level}
        shapes.append(look | ends)
        side = {"x": 0.0, "xanchor": "left"} if left else {"x": 1.0, "xanchor": "right"}
        over = {"bgcolor": f"{GROUND}bb", "borderpad": 0}  # the curve of another result
        words = {"text": escaped(name), "xref": "paper"} | side | over
        notes.append(words | _at(f"y{key}", level, 11))
    for name, at in panel.marks.items():
        ends = {"xref": "x", "x0": at, "x1": at, "yref": f"y{key} domain", "y0": 0, "y1": 1}
        shapes.append(look | ends)
        words = {"text": escaped(name), "xref": "x", "x": at, "xanchor": "right"}
        notes.append(words | _at(f"y{key} domain", 0.0, 11))
    for low, high, _, color, index in panel.spans:
        foot = 0.0 if index is None else 0.05 * index
        tall = {"y0": foot, "y1": 1.0 if index is None else foot + 0.04}
        ends = {"xref": "x", "x0": low, "x1": high, "yref": f"y{key} domain"} | tall
        fill = {"fillcolor": color + ("22" if index is None else "cc"), "line": {"color": color}}
        shapes.append({"type": "rect", "layer": "below"} | ends | fill)
    for x, y, text in panel.notes:
        notes.append({"text": text, "xref": "x", "x": x} | _at(f"y{key}", y))


def views(results: Results) -> dict[str, dict[str, Chart]]:
    """Return the charts that each scenario has, by the name of the scenario and of the chart.

    Parameters
    ----------
    results : sequence of Labelled
        All results of the page.

    Returns
    -------
    dict of dict
        Where there are several scenarios, the first entry is the envelope of all of them.
    """
    most, drawn = points_each(results), {}
    names = list(dict.fromkeys(name for result in results for name in result.solution.scenarios))
    parts = {"all scenarios": results} if len(names) > 1 else {}
    parts |= {name: charts.of_scenario(results, name) for name in names}
    for name, part in parts.items():
        drawn[name] = _drawn(
            flow=stacked(charts.power_curve(part), 170),
            year=stacked(charts.year(part), 130),
            time=stacked([*charts.operation(part), charts.margins_over_time(part)], 130, most),
            limits=stacked(charts.limits(part)),
            span=stacked(charts.loads(part), 160),
        )
    return drawn


def designs(results: Results) -> dict[str, Chart]:
    """Return the charts that belong to a result as a whole, by their names.

    Parameters
    ----------
    results : sequence of Labelled
        All results of the page.

    Returns
    -------
    dict of dict
        Those for which there are data.
    """
    return _drawn(
        shape=stacked(charts.shape(results), 160),
        sections=stacked([charts.sections(results)], 120),
        coefficients=stacked(charts.coefficients(results), 170),
        convergence=stacked(charts.convergence(results), 200, 1000),
    )


def _drawn(**made: Chart | None) -> dict[str, Chart]:
    return {name: chart for name, chart in made.items() if chart is not None}
