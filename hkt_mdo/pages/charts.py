"""The charts of a report: what each shows of the results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from hkt_mdo.pages.panels import (
    DASHES,
    FAINT,
    Chart,
    Labelled,
    Look,
    Panel,
    band,
    escaped,
    line,
    plain,
    stacked,
    thinned,
)
from hkt_mdo.quantities import QUANTITIES
from hkt_mdo.results.shown import (
    OVER_SPAN,
    YEAR,
    beside_start,
    convergence,
    levels_of,
    near_bounds,
    of_scenario,
    words_of,
)
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.steady import BINS, Binned, binned, rated_point, steady_curve
from hkt_mdo.results.words import limit_words

MOST_POINTS, LEAST_POINTS = 100_000, 60
"""Points of all series of a page together, and of a series at least."""
MOST_OF_ONE = 6000
ENVELOPE = 300
"""Classes of the time in an envelope of scenarios."""


def points_each(labelled: Sequence[Labelled]) -> int:
    """Return how many points of a series a page has room for.

    Parameters
    ----------
    labelled : sequence of Labelled
        All results of the page.

    Returns
    -------
    int
        Number of points.
    """
    series = 9 * sum(len(each.solution.scenarios) for each in labelled)
    return int(np.clip(MOST_POINTS // max(1, series), LEAST_POINTS, MOST_OF_ONE))


def _table_of(solution: Solution) -> dict[str, np.ndarray]:
    """Return the integration of one scenario, else its trajectory; empty where there is none."""
    return solution.simulation or solution.trajectory


def _panel_of(quantity: str, labelled: Sequence[Labelled], from_zero: bool) -> tuple[Panel, float]:
    """Return the empty panel of a quantity, and the scale of its values."""
    words, unit, scale = words_of(quantity, (each.solution for each in labelled))
    return Panel(f"{words} ({unit})", from_zero=from_zero), scale


# ---- over the flow speed and over time, of one scenario of each result

_FLOW = "generator_power", "rotor_speed", "control_torque", "thrust"
_TIME = "inflow_speed", "generator_power", "rotor_speed", "control_torque", "thrust"


def _over_flow(labelled: Sequence[Labelled]) -> Chart | None:
    """Return power, speed, torque and thrust over the flow speed, with limits and rated points."""
    panels = [_flow_panel(labelled, quantity) for quantity in _FLOW]
    if (chart := stacked(panels, "flow speed (m/s)", 170)) is not None:
        chart["layout"]["xaxis"]["rangemode"] = "tozero"
    return chart


def _flow_panel(labelled: Sequence[Labelled], quantity: str) -> Panel:
    column, (panel, scale) = QUANTITIES[quantity].column, _panel_of(quantity, labelled, True)
    panel.left = True  # where the curves are low
    for index, each in enumerate(labelled):
        table, look = _table_of(each.solution), Look.of(index, each, quantity)
        if column not in table:
            continue
        found = binned(table["inflow_speed_m_s"], scale * table[column], each.solution.steady)
        name = escaped(each.label)
        if found.speed.size:
            panel.traces += _met(found, name, look)
        steady = steady_curve(each.solution)
        if column in steady:
            curve = steady["inflow_speed_m_s"], scale * steady[column]
            ink = {"showlegend": not name, "dash": "dot", "width": 1.4}
            words = name or "in steady flow"
            panel.traces.append(line(*curve, words, look.color if name else FAINT, **ink))
        if quantity == "generator_power":
            panel.traces += _power_of(each, look, table)
        stop = each.solution.case.control.cut_out
        panel.marks |= {} if stop is None else {f"cut-out {stop:g} m/s": stop}
    if panel.traces:
        panel.levels = levels_of(labelled, quantity, scale)
    return panel


def _met(found: Binned, name: str, look: Look) -> list[dict[str, Any]]:
    """Return mean and range of a quantity over the flow speed as traces."""
    words = name or "mean at this flow speed"
    mean = line(found.speed, found.mean, words, look.color, dash=look.dash, mode="lines+markers")
    spread = band(found.speed, found.low, found.high, words, look.color)
    spread[1] |= {"showlegend": False} if name else {"name": "90 % of the instants"}
    spread = [] if found.low is found.high else spread
    return [*spread, mean | {"marker": {"size": 5, "color": look.color}}]


def _power_of(each: Labelled, look: Look, table: dict[str, np.ndarray]) -> list[dict[str, Any]]:
    """Return electrical power, where there are losses, and the rated point, as traces."""
    traces, name = [], escaped(each.label)
    speed, electrical = table["inflow_speed_m_s"], table["electrical_power_W"]
    if not np.allclose(electrical, table["generator_power_W"]):
        found = binned(speed, 1e-3 * electrical, each.solution.steady)
        words = ", ".join(filter(None, (name, "electrical, mean")))
        traces.append(line(found.speed, found.mean, words, look.color, dash="dash", width=1.3))
    if (rated := rated_point(each.solution)) is not None:
        words = ", ".join(filter(None, (name, f"rated at {rated[0]:.2f} m/s")))
        point = line([rated[0]], [1e-3 * rated[1]], words, look.color, mode="markers")
        traces.append(point | {"marker": {"size": 11, "symbol": "diamond", "color": look.color}})
    return traces


def _over_time(labelled: Sequence[Labelled], most: int) -> Chart | None:
    """Return flow, power, speed, torque, thrust and margins over time, on one axis."""
    names = ["" if each.solution.steady else each.solution.scenarios[0] for each in labelled]
    labelled = [
        Labelled(of_scenario(each.solution, name), each.label)
        for each, name in zip(labelled, names, strict=True)
    ]
    panels = [_time_panel(labelled, quantity, most) for quantity in _TIME]
    return stacked([*panels, _margin_panel(labelled, most)], "time (s)", 130)


def _series(each: Labelled, values: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Return time and values with gaps at a standstill, of as many points as there is room for."""
    time = _table_of(each.solution)["time_s"]
    along = each.solution.across_gaps(time, values)
    across = each.solution.across_gaps(time, time)
    kept = thinned(across, along, most)
    return across[kept], along[kept]


def _time_panel(labelled: Sequence[Labelled], quantity: str, most: int) -> Panel:
    column, (panel, scale) = QUANTITIES[quantity].column, _panel_of(quantity, labelled, False)
    for index, each in enumerate(labelled):
        table, look = _table_of(each.solution), Look.of(index, each, quantity)
        if column in table:
            series = _series(each, scale * table[column], most)
            name = escaped(each.label) or panel.title.partition(" (")[0]
            shown = {"showlegend": bool(each.label), "dash": look.dash if each.label else "solid"}
            panel.traces.append(line(*series, name, look.color, width=1.4, **shown))
    if panel.traces:
        panel.levels = levels_of(labelled, quantity, scale)
    return panel


def _margins(solution: Solution) -> dict[str, np.ndarray]:
    """Return what is left up to each limit over time (%), (n_times,), by its name."""
    return {name: 100.0 * (1.0 - share) for name, share in solution.limit_shares().items()}


def _margin_panel(labelled: Sequence[Labelled], most: int) -> Panel:
    """Return the margin of each limit of a single result, the smallest of each of several."""
    several = len(labelled) > 1
    words = "smallest margin of all limits" if several else "margin of each limit"
    panel = Panel(f"{words} (%)", levels={"limit": 0.0})
    for index, each in enumerate(labelled):
        left = _margins(each.solution)
        if several and left:
            left = {each.label: np.min([*left.values()], axis=0)}
        for number, (limit, values) in enumerate(left.items()):
            look = Look.of(index, each, limit)
            dash = look.dash if several else DASHES[number % len(DASHES)]
            name = escaped(each.label) if several else f"margin: {limit_words(limit)}"
            series = _series(each, values, most)
            panel.traces.append(line(*series, name, look.color, dash=dash, width=1.4))
    return panel


# ---- the envelope of several scenarios


def _envelope(labelled: Sequence[Labelled], over: str) -> Chart | None:
    """Return the range of each quantity over all scenarios, over `time` or `inflow_speed`."""
    column = QUANTITIES[over].column
    panels = [
        _envelope_panel(labelled, each, column) for each in (_TIME if over == "time" else _FLOW)
    ]
    if over == "time":
        margin = Panel("smallest margin of all limits and scenarios (%)", levels={"limit": 0.0})
        for index, each in enumerate(labelled):
            parts = []
            for one in _scenarios(each, column):
                if left := _margins(one):
                    parts.append((_table_of(one)[column], np.min([*left.values()], axis=0)))
            if parts:
                x, low, _ = _ranges(parts, ENVELOPE)
                color = Look.of(index, each).color
                margin.traces.append(line(x, low, escaped(each.label) or "smallest margin", color))
        panels.append(margin)
    title = "time (s)" if over == "time" else "flow speed (m/s)"
    return stacked(panels, title, 130 if over == "time" else 170)


def _scenarios(each: Labelled, x: str) -> list[Solution]:
    """Return the scenarios that have a column: those without time have none over time."""
    return [one for one in each.solution.by_scenario if x != "time_s" or not one.steady]


def _envelope_panel(labelled: Sequence[Labelled], quantity: str, x: str) -> Panel:
    column, alone = QUANTITIES[quantity].column, []
    panel, scale = _panel_of(quantity, labelled, x != "time_s")
    panel.left = x != "time_s"
    for index, each in enumerate(labelled):
        tables = [_table_of(one) for one in _scenarios(each, x)]
        parts = [(table[x], scale * table[column]) for table in tables if column in table]
        alone += [Labelled(one, each.label) for one in each.solution.by_scenario]
        if parts:
            name = escaped(each.label) or "smallest to largest of all scenarios"
            color = Look.of(index, each, quantity).color
            classes = ENVELOPE if x == "time_s" else BINS
            panel.traces += band(*_ranges(parts, classes), name, color, 1.0)
    if panel.traces:
        panel.levels = levels_of(alone, quantity, scale)
    return panel


def _ranges(
    parts: Sequence[tuple[np.ndarray, np.ndarray]], most: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the smallest and the largest of several series in classes of their abscissa."""
    x, y = (np.concatenate(each) for each in zip(*parts, strict=True))
    count = max(1, min(most, min(each.size for each, _ in parts) // 2))
    edges = np.linspace(np.min(x), np.max(x), count + 1)
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, count - 1)
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, place, y)
    np.maximum.at(high, place, y)
    met = np.isfinite(low)
    return 0.5 * (edges[1:] + edges[:-1])[met], low[met], high[met]


def _year(labelled: Sequence[Labelled]) -> Chart | None:
    """Return electrical power, hours and energy of a year over the flow speed, bin by bin."""
    panels = []
    for column, (title, scale, quantity) in YEAR.items():
        panel = Panel(title.replace("\n", " "), from_zero=True)
        for index, each in enumerate(labelled):
            if table := each.solution.year:
                look, name = Look.of(index, each, quantity), escaped(each.label) or "a year"
                shown: Chart = {"type": "bar", "marker": {"color": look.color}}
                shown["showlegend"] = bool(each.label)
                series = table["inflow_speed_m_s"], scale * table[column]
                panel.traces.append(line(*series, name, look.color, **shown))
                panel.traces[-1].pop("line")
        panels.append(panel)
    return stacked(panels, "flow speed (m/s)", 130)


# ---- the blade, its coefficients, its loads, and the optimizer's way

_SHAPES = {
    "chord_m": "chord (m)",
    "twist_deg": "twist (deg)",
    "thickness_over_chord": "thickness over chord (-)",
}


def _shape(labelled: Sequence[Labelled]) -> Chart | None:
    """Return chord, twist and a designed thickness over the radius, with start and bounds."""
    panels = []
    for column, title in _SHAPES.items():
        panel = Panel(title, from_zero=True)
        panel.traces += _beside_start(labelled, "blade", "r_m", column)
        values = np.array([x for trace in panel.traces for x in trace["y"] if x is not None])
        bounds = near_bounds([each.solution for each in labelled], column, values)
        panel.levels = {words: bound for words, (_, bound) in bounds.items()}
        panels.append(panel)
    return stacked(panels, "radius (m)", 160)


def _beside_start(labelled: Sequence[Labelled], source: str, x: str, y: str) -> Iterator[Chart]:
    """Yield a column of each result, and of the blade at the start, once if it is one."""
    for index, along, values, label in beside_start(labelled, source, x, y):
        if index is None:
            yield line(along, values, label, FAINT, dash="dot", width=1.4)
        else:
            look = Look.of(index, labelled[index])
            yield line(along, values, escaped(label), look.color, dash=look.dash)


def _coefficients(labelled: Sequence[Labelled]) -> Chart | None:
    """Return power and thrust coefficient over the tip speed ratio, and what is operated in."""
    panels = []
    for word in ("power", "thrust"):
        panel = Panel(f"{word} coefficient (-)", from_zero=True)
        column = f"{word}_coefficient"
        for trace in _beside_start(labelled, "coefficients", "tip_speed_ratio", column):
            turned = [y if y is not None and y >= 0.0 else None for y in trace["y"]]  # by the flow
            panel.traces.append(trace | {"y": turned})
        panels.append(panel)
    chart = stacked(panels, "tip speed ratio (-)", 170)
    for index, each in enumerate(labelled):
        reach = each.solution.summary.tip_speed_ratio
        if chart is None or reach is None or reach.ends is None:
            continue
        color, ends = Look.of(index, each).color, {"x0": reach.min, "x1": reach.max}
        foot = 0.05 * index
        tall = {"y0": foot, "y1": foot + 0.04} if each.label else {"y0": 0, "y1": 1}
        place: Chart = {"xref": "x", "type": "rect", "layer": "below"}
        place |= {"fillcolor": color + ("cc" if each.label else "22")}
        place |= {"line": {"width": 1, "color": color}}
        for axis in (name for name in chart["layout"] if name.startswith("yaxis")):
            over = {"yref": f"y{axis.removeprefix('yaxis')} domain"}
            chart["layout"]["shapes"].append(place | tall | ends | over)
    return chart


def _over_span(labelled: Sequence[Labelled]) -> Chart | None:
    """Return the loads along the blade at the times of the largest ones, with their limits.

    Of several scenarios, the largest of all.
    """
    panels = []
    for column, (_, quantity, title, scale) in OVER_SPAN.items():
        panel, alone = Panel(title, from_zero=True), []
        for index, each in enumerate(labelled):
            scenarios, look = each.solution.by_scenario, Look.of(index, each, quantity)
            loads = _largest([one.loads for one in scenarios if one.loads])
            if column in loads:
                name = escaped(each.label) or "load"
                shown = {"showlegend": bool(each.label), "dash": look.dash}
                values = scale * loads[column]
                panel.traces.append(line(loads["r_over_R"], values, name, look.color, **shown))
            alone += [Labelled(one, each.label) for one in scenarios]
        if panel.traces and column == QUANTITIES[quantity].column:  # not a moment along the blade
            panel.levels = levels_of(alone, quantity, scale)
        panels.append(panel)
    return stacked(panels, "radius over that of the tip, r/R (-)", 160)


def _largest(tables: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Return the largest values of tables of one blade, which have the same rows."""
    columns = {name for table in tables for name in table}
    having = {name: [table[name] for table in tables if name in table] for name in columns}
    return {name: np.max(values, axis=0) for name, values in having.items()}


def _limit_bars(labelled: Sequence[Labelled]) -> Chart | None:
    """Return a bar for each limit of each result: the largest value over the limit, in per cent."""
    data: list[dict[str, Any]] = []
    names: list[str] = []
    for index, each in enumerate(labelled):
        left = [_margins(one) for one in each.solution.by_scenario]
        limits = list(dict.fromkeys(name for one in left for name in one))
        if not limits:
            continue
        most = [100.0 - min(np.min(one[x]) for one in left if x in one) for x in limits]
        look = [Look.of(index, each, limit).color for limit in limits]
        words = [limit_words(limit) for limit in limits]
        names += [word for word in words if word not in names]
        bar = {"type": "bar", "orientation": "h", "x": plain(most), "y": words}
        gap = "\u2002" if each.label else ""  # beside the bar
        text = {
            "text": [f"{gap}{x:.1f} %" for x in most],
            "textposition": "outside" if each.label else "auto",
        }
        text |= {"insidetextanchor": "end"}
        pattern = {"shape": ("", "/", ".", "x", "-", "+")[index % 6], "fillmode": "overlay"}
        marker = {"marker": {"color": look if not each.label else look[0], "pattern": pattern}}
        data.append(bar | text | marker | {"name": escaped(each.label), "cliponaxis": False})
    if not data:
        return None
    high = max(100.0, max(x for bar in data for x in bar["x"]))
    layout = {
        "height": (12 + 24 * len(data)) * len(names),
        "bargap": 0.3,
        "xaxis": {"title": {"text": "largest value, % of the limit"}, "range": [0, 1.18 * high]},
        "yaxis": {"autorange": "reversed", "ticksuffix": "  ", "showgrid": False},
        "showlegend": len(data) > 1,
        "shapes": [
            {"type": "line", "xref": "x", "x0": 100, "x1": 100, "yref": "paper", "y0": 0, "y1": 1}
            | {"line": {"color": FAINT, "width": 1.6, "dash": "dashdot"}}
        ],
    }
    return {"data": data, "layout": layout}


def _convergence(labelled: Sequence[Labelled]) -> Chart | None:
    """Return the distance of the energy from its last value, and infeasibility, by evaluation."""
    energy = Panel("energy: distance from its last value (-)", log=True)
    broken = Panel("infeasibility: largest scaled violation (-)", log=True)
    for index, each in enumerate(labelled):
        (count, *found), look = convergence(each.solution), Look.of(index, each)
        for panel, values in zip((energy, broken), found, strict=True):
            if not count.size:
                continue
            kept = thinned(count, values, 1000)
            name, more = escaped(each.label) or "optimizer", {"showlegend": bool(each.label)}
            series = count[kept], values[kept]
            panel.traces.append(line(*series, name, look.color, mode="lines+markers", **more))
            panel.traces[-1] |= {"marker": {"size": 4, "color": look.color}}
    return stacked([energy, broken], "evaluation of the optimizer (-)", 150)


def views(labelled: Sequence[Labelled]) -> dict[str, dict[str, Chart]]:
    """Return the charts that each scenario has, by the name of the scenario and of the chart.

    Parameters
    ----------
    labelled : sequence of Labelled
        All results of the page.

    Returns
    -------
    dict of dict
        Where there are several scenarios, the first entry is the envelope of all of them.
    """
    most, found = points_each(labelled), {}
    names = list(dict.fromkeys(name for each in labelled for name in each.solution.scenarios))
    if len(names) > 1:
        found["all scenarios"] = {
            "flow": _envelope(labelled, "inflow_speed"),
            "time": _envelope(labelled, "time"),
            "limits": _limit_bars(labelled),
            "span": _over_span(labelled),
        }
    for name in names:
        alone = [Labelled(of_scenario(each.solution, name), each.label) for each in labelled]
        charts: dict[str, Callable[[Sequence[Labelled]], Chart | None]] = {
            "flow": _over_flow,
            "year": _year,
            "time": partial(_over_time, most=most),
            "limits": _limit_bars,
            "span": _over_span,
        }
        found[name] = {key: make(alone) for key, make in charts.items()}
    return {name: _drawn(charts.items()) for name, charts in found.items()}


def designs(labelled: Sequence[Labelled]) -> dict[str, Chart]:
    """Return the charts that belong to a result as a whole, by their names.

    Parameters
    ----------
    labelled : sequence of Labelled
        All results of the page.

    Returns
    -------
    dict of dict
        Those for which there are data.
    """
    makers = {"shape": _shape, "coefficients": _coefficients, "convergence": _convergence}
    return _drawn((name, make(labelled)) for name, make in makers.items())


def _drawn(charts: Iterable[tuple[str, Chart | None]]) -> dict[str, Chart]:
    return {name: chart for name, chart in charts if chart is not None}
