"""The charts of results: what each shows, as panels that Matplotlib or plotly.js draws; figures.

A chart is a list of panels (`hkt_mdo.results.panel`). Results, and the scenarios of one, differ by
colour, line style and marker, so that they can be told apart in grey. Of a single one, a quantity
has the same colour in every chart.
"""

import base64
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.quantities import QUANTITIES
from hkt_mdo.results import style
from hkt_mdo.results.panel import COLORS, GREY, QUANTITY_COLORS, Curve, Panel, Span
from hkt_mdo.results.sections import STACKING
from hkt_mdo.results.sections import sections as sections_of
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.steady import BINS, binned, rated_point, steady_curve
from hkt_mdo.results.words import joined, limit_words, measured, plain_unit, printable
from hkt_mdo.rotor.airfoil import Polar

UNITS = {"rad/s": ("rpm", 30.0 / np.pi), "W": ("kW", 1e-3), "N": ("kN", 1e-3), "Pa": ("MPa", 1e-6)}
"""Unit, and scale of the values, that are drawn in place of a unit of the registry."""
NAMES = {"hydrodynamic_torque": "flow's torque", "cavitation": "suction, 1: cavitation"}
"""Names of quantities that are not those of limits."""
LARGE_TORQUE = 1e3  # N m
TIME = "inflow_speed generator_power rotor_speed tip_speed_ratio control_torque thrust".split()
FLOW = "generator_power", "rotor_speed", "control_torque", "thrust"
LIMITED = "root_moment", "stress", "cavitation"
"""What is drawn over time, over the flow speed, and over time where it is limited."""
LIMITED_BY = {"generator_power": ("generator_power", "electrical_power")}
OVER_SPAN = {"stress_Pa": "stress", "flapwise_moment_Nm": "stress", "cavitation": "cavitation"}
"""The load at whose largest value each column is drawn."""
YEAR = {
    "electrical_power_W": ("mean electrical\npower (kW)", 1e-3, "power"),
    "hours": ("hours a year (h)", 1.0, "inflow_speed"),
    "energy_kWh": ("net electrical energy\na year (kWh)", 1.0, "power"),
}
"""Label, scale and quantity of the columns of a year."""
RADIUS = {
    "chord_m": "chord (m)",
    "twist_deg": "twist (deg)",
    "thickness_over_chord": "thickness\nover chord (-)",
}
SHOWN = 0.25, 0.5, 0.75
"""Places of the sections that are drawn, from hub to tip."""
AXIS = f"blade's axis, at {STACKING:g} of the chord"
LEAST_SHOWN = 1e-10
"""Smallest value of the convergence that is drawn."""
ENVELOPE = 300
"""Classes of the time in an envelope of scenarios."""

MOST_NAMED = 8
"""Of more polars, only the first and the last have labels."""
POLARS = (
    *("lift coefficient (-)", "drag coefficient (-)", "lift over drag (-)"),
    "largest suction, -cp (-)",
)

Solutions = Solution | Sequence[Solution]


class Labelled(NamedTuple):
    """A result, its name among several, "" where it is the only one, and its place among them."""

    solution: Solution
    label: str
    index: int = 0

    @property
    def table(self) -> dict[str, np.ndarray]:
        """The integration of one scenario, else its trajectory; empty where there is none."""
        return self.solution.simulation or self.solution.trajectory

    def color(self, quantity: str = "") -> str:
        """Return the colour of a result among several, or of a quantity of the only one."""
        color = COLORS[self.index % len(COLORS)]
        return color if self.label else QUANTITY_COLORS.get(quantity, color)

    def curve(
        self, x: np.ndarray, y: np.ndarray, name: str, quantity: str = "", **more: Any
    ) -> Curve:
        """Return a curve in the colour and line style of the result; `more`: of `Curve`."""
        return Curve(x, y, name, self.color(quantity), self.index, **more)


Results = Sequence[Labelled]


# ---- results and their names


def labelled(solutions: Solutions) -> list[Labelled]:
    """Return results with what they are called beside one another.

    That are the names of the cases, those of the folders where these are equal, with numbers where
    those are, too.
    """
    chosen = [solutions] if isinstance(solutions, Solution) else list(solutions)
    if len(chosen) == 1:
        return [Labelled(chosen[0], "")]
    names = [printable(solution.name) for solution in chosen]
    if len({*names}) < len(names):
        names = [printable(solution.folder.resolve().name) for solution in chosen]
    if len({*names}) < len(names):
        names = [f"{number}: {name}" for number, name in enumerate(names, 1)]
    return list(map(Labelled, chosen, names, range(len(chosen))))


def by_scenario(results: Results) -> list[Labelled]:
    """Return each scenario of results as a result of its own."""
    parts = [
        (one, joined(label, scenario) if len(solution.scenarios) > 1 else label)
        for solution, label, _ in results
        for one, scenario in zip(solution.by_scenario, solution.scenarios, strict=True)
    ]
    return [Labelled(*part, index) for index, part in enumerate(parts)]


def of_scenario(results: Results, name: str) -> list[Labelled]:
    """Return one scenario of the results that have it."""
    return [
        result._replace(solution=result.solution.scenario(name))
        for result in results
        if name in result.solution.scenarios
    ]


def _alone(results: Results, over: str = "") -> list[Labelled]:
    """Return the scenarios of results that have tables over something, named as the results."""
    parts = [each._replace(solution=one) for each in results for one in each.solution.by_scenario]
    return [part for part in parts if part.table and not (over == "time" and part.solution.steady)]


def _panel_of(results: Results, quantity: str, across: str) -> tuple[Panel, float]:
    """Return the panel of a quantity over time with its limits, and the scale of values in SI.

    Torques of large machines are in kN m, as are moments of a blade.
    """
    si_unit = QUANTITIES[quantity].unit
    unit, scale = UNITS.get(si_unit, (plain_unit(si_unit or "-"), 1.0))
    torques = [result.solution.summary.control_torque_max_Nm or 0.0 for result in results]
    most = max(torques, default=0.0)
    if si_unit == "N*m" and (most >= LARGE_TORQUE or quantity == "root_moment"):
        unit, scale = "kN m", 1e-3
    levels = levels_of(results, quantity, scale)
    words = NAMES.get(quantity, limit_words(quantity))
    return Panel(f"{words} ({unit})", across, levels=levels), scale


def levels_of(results: Results, quantity: str, scale: float) -> dict[str, float]:
    """Return the limits of a quantity in all scenarios of results, one for equal ones.

    Their words name the results and scenarios where not all have the limit.
    """
    labels: dict[tuple[str, float], list[str]] = {}
    results = by_scenario(results)
    for solution, label, _ in results:
        limits = map(solution.limit_levels, LIMITED_BY.get(quantity, (quantity,)))
        for limit, level in chain.from_iterable(limits):
            words = f"{limit_words(limit.name)} limit {measured(limit.end, limit.unit or '', 4)}"
            labels.setdefault((words, level), []).append(label)
    named = {}
    for (words, level), names in labels.items():
        apart = [] if len(names) == len(results) else list(filter(None, dict.fromkeys(names)))
        named[words + (f" in {' and '.join(apart)}" if apart else "")] = scale * level
    return named


# ---- over time and over the flow speed


def over_time(results: Results, quantity: str, nodes: bool = False) -> Panel:
    """Return a quantity over time with its limits, interrupted at a standstill.

    Of several scenarios, from the smallest to the largest value, as in `over_flow`. With `nodes`, a
    single result is shown at the collocation nodes, too.
    """
    column, (panel, scale) = QUANTITIES[quantity].column, _panel_of(results, quantity, "time (s)")
    for result in results:
        solution = result.solution
        if len(solution.scenarios) > 1:
            panel.curves += _envelope(result, quantity, "time", scale)
            continue
        tables = {"simulation": solution.simulation, "collocation nodes": solution.trajectory}
        shown = [(name, x) for name, x in tables.items() if column in x and not solution.steady]
        for name, table in shown[:1]:
            x, y = solution.across_gaps(table["time_s"], scale * table[column])
            panel.curves.append(result.curve(x, y, result.label or name, quantity))
        for name, table in shown[1:] if nodes and not result.label else ():
            x, y = table["time_s"], scale * table[column]
            panel.curves.append(Curve(x, y, name, GREY, 0, "points"))
    return panel


def operation(results: Results, nodes: bool = False) -> list[Panel]:
    """Return operation over time, with the loads that are limited."""
    limited = {limit.name for result in _alone(results) for limit in result.solution.limits}
    names = *TIME, *(x for x in LIMITED if x in limited)
    return [over_time(results, name, nodes) for name in names]


def over_flow(results: Results, quantity: str) -> Panel:
    """Return a quantity over the flow speed: mean, 90 % of the instants, steady operation."""
    column = QUANTITIES[quantity].column
    panel, scale = _panel_of(results, quantity, "inflow speed (m/s)")
    panel.from_zero = panel.across_from_zero = True
    for result in results:
        if len(result.solution.scenarios) > 1:
            panel.curves += _envelope(result, quantity, "inflow_speed", scale)
            continue
        solution, label, table = result.solution, result.label, result.table
        if column not in table:
            continue
        flow = table["inflow_speed_m_s"]
        speed, mean, low, high = binned(flow, scale * table[column], solution.steady)
        if not solution.steady:
            name = "" if label else "90 % of the instants"
            panel.curves.append(result.curve(speed, high, name, quantity, kind="band", low=low))
        name = label or "mean at this flow speed"
        panel.curves.append(result.curve(speed, mean, name, quantity, kind="marked"))
        steady = steady_curve(solution)
        if column in steady:
            name, ink = ("", result.color()) if label else ("in steady flow", GREY)
            x, y = steady["inflow_speed_m_s"], scale * steady[column]
            panel.curves.append(Curve(x, y, name, ink, None))
        if quantity == "generator_power":
            panel.curves += _power_curves(result)
        stop = solution.case.control.cut_out
        panel.marks |= {} if stop is None else {f"cut-out {stop:g} m/s": stop}
    return panel


def _power_curves(result: Labelled) -> Iterator[Curve]:
    """Yield the electrical power of a generator with losses, and the rated point."""
    (solution, label, index), table = result, result.table
    color, electrical = result.color("generator_power"), table["electrical_power_W"]
    if not np.allclose(electrical, table["generator_power_W"]):
        speed, mean, *_ = binned(table["inflow_speed_m_s"], 1e-3 * electrical, solution.steady)
        yield Curve(speed, mean, joined(label, "electrical power, mean"), color, index + 1)
    if (rated := rated_point(solution)) is not None:
        name = joined(label, f"rated at {rated[0]:.2f} m/s")
        x, y = np.array([rated[0]]), np.array([1e-3 * rated[1]])
        yield Curve(x, y, name, color, index + 3, "points")


def power_curve(results: Results) -> list[Panel]:
    """Return power, speed, torque and thrust over the flow speed."""
    return [over_flow(results, quantity) for quantity in FLOW]


def year(results: Results) -> list[Panel]:
    """Return power, hours and energy of a year by the bins of the flow speed."""
    panels = []
    for column, (title, scale, quantity) in YEAR.items():
        panel = Panel(title, "inflow speed (m/s)", from_zero=True)
        for result in results:
            if len(result.solution.scenarios) == 1 and (table := result.solution.year):
                x, y = table["inflow_speed_m_s"], scale * table[column]
                panel.curves.append(result.curve(x, y, result.label, quantity, kind="bar"))
        panels.append(panel)
    return panels


def limits(results: Results) -> list[Panel]:
    """Return a bar for each limit of each result: the largest value over the limit (%)."""
    panel = Panel("largest value over its limit (%)", "", levels={"limit": 100.0}, from_zero=True)
    percentages: dict[str, list[str]] = {}
    for result in results:
        shares = [one.limit_shares() for one in result.solution.by_scenario]
        for limit in dict.fromkeys(chain.from_iterable(shares)):
            most = 100.0 * max(float(np.nanmax(x[limit])) for x in shares if limit in x)
            percentages.setdefault(limit, []).append(f"{most:.1f}")
            x, y = np.array([[*percentages].index(limit)]), np.array([most])
            panel.curves += [result.curve(x, y, result.label or "largest value", limit, kind="bar")]
    values = ((limit_words(x).replace(" ", "\n"), ", ".join(y)) for x, y in percentages.items())
    panel.ticks = [f"{words}\n{numbers} %" for words, numbers in values]
    return [panel]


def margins_over_time(results: Results) -> Panel:
    """Return the margin of each limit, or the smallest of several results or scenarios."""
    smallest = any(result.label or len(result.solution.scenarios) > 1 for result in results)
    words = "smallest margin of all limits" if smallest else "margin of each limit"
    panel = Panel(f"{words} (%)", "time (s)", levels={"limit": 0.0})
    for result in results:
        alone = _alone([result], "time")
        used = [(x.solution, x.table["time_s"], x.solution.limit_shares()) for x in alone]
        for solution, time, shares in used if not smallest else ():
            for number, (limit, share) in enumerate(shares.items()):
                x, y = solution.across_gaps(time, 100.0 * (1.0 - share))
                name = f"margin: {limit_words(limit)}"
                panel.curves.append(Curve(x, y, name, result.color(limit), number))
        used = [part for part in used if part[2]]
        parts = [(time, 100.0 * (1.0 - np.max([*x.values()], axis=0))) for _, time, x in used]
        if smallest and parts:
            x, y = used[0][0].across_gaps(*parts[0])
            if len(parts) > 1:
                x, _, y, _ = _ranges(parts, ENVELOPE)
            panel.curves.append(result.curve(x, y, result.label or "smallest margin"))
    return panel


# ---- from the smallest to the largest value of several scenarios


def _envelope(result: Labelled, quantity: str, over: str, scale: float) -> Iterator[Curve]:
    """Yield the range of a quantity over several scenarios, over `time` or `inflow_speed`."""
    x, column = QUANTITIES[over].column, QUANTITIES[quantity].column
    tables = [one.table for one in _alone([result], over)]
    parts = [(table[x], scale * table[column]) for table in tables if column in table]
    if parts:
        abscissa, _, low, high = _ranges(parts, ENVELOPE if over == "time" else BINS)
        name = result.label or "smallest to largest of all scenarios"
        yield result.curve(abscissa, high, name, quantity, kind="band", low=low)


def _ranges(parts: Sequence[tuple[np.ndarray, np.ndarray]], most: int) -> np.ndarray:
    """Return the smallest and the largest of several series in classes of their abscissa."""
    x, y = (np.concatenate(each) for each in zip(*parts, strict=True))
    count = max(1, min(most, min(each.size for each, _ in parts) // 2))
    return binned(x, y, count=count, fewest=1, ends=(0.0, 100.0))


# ---- the blade, its coefficients, its loads, and the convergence


def _beside_start(results: Results, source: str, x: str, y: str, kind: str) -> Iterator[Curve]:
    """Yield a column of each result over another, and before it that of the blade at the start.

    The start is there once if it is the same.
    """
    starts: list[np.ndarray] = []
    for result in results:
        table = getattr(result.solution, source)
        if y not in table:
            continue
        start = table.get(f"start_{y}")
        same = np.array_equal(start, table[y])  # the blade is not designed
        drawn = start is None or any(np.array_equal(start, other) for other in starts)
        if not same and not drawn:
            starts.append(start)
            yield Curve(table[x], start, "blade at the start", GREY, None, kind)
        name = result.label or ("blade" if same else "optimized blade")
        yield result.curve(table[x], table[y], name, kind=kind)


def over_radius(results: Results, column: str) -> Panel:
    """Return a column of the blade over the radius, with the bounds that all designs share.

    Of these, the ones that are near its values.
    """
    panel = Panel(RADIUS[column], "radius (m)", from_zero=True, across_from_zero=True)
    panel.curves = [*_beside_start(results, "blade", "r_m", column, "marked")]
    quantity, unit = column.split("_", 1)
    designs = [result.solution.case.design for result in results]
    bounds = {getattr(x, f"{quantity}_bounds") for x in designs if x.blade == "optimized"}
    if panel.curves and len(bounds) == 1:
        values = np.concatenate([curve.y for curve in panel.curves])
        low, high = (1.5 * end(values, initial=0.0) for end in (np.min, np.max))
        for word, bound in zip(("smallest", "largest"), bounds.pop() or (), strict=False):
            if low <= bound <= high:
                words = f"{word} {quantity} {bound:.4g} {unit.replace('over_chord', '')}".rstrip()
                panel.levels[words] = bound
    return panel


def shape(results: Results) -> list[Panel]:
    """Return chord, twist and a designed thickness over the radius."""
    return [over_radius(results, column) for column in RADIUS]


def planform(results: Results) -> Panel:
    """Return the outline of the untwisted blade in scale, with its axis."""
    panel = Panel("planform,\nin scale (m)", "radius (m)", in_scale=True, across_from_zero=True)
    for result in results:
        if blade := result.solution.blade:
            radius, chord = blade["r_m"], blade["chord_m"]
            around = np.r_[radius, radius[::-1], radius[:1]]
            edges = np.r_[STACKING * chord, (STACKING - 1.0) * chord[::-1], STACKING * chord[:1]]
            panel.curves.append(result.curve(around, edges, result.label))
    if panel.curves:
        ends = np.array([0.0, panel.curves[0].x.max()])
        panel.curves.append(Curve(ends, np.zeros(2), AXIS, GREY, None))
    return panel


def sections(results: Results) -> Panel:
    """Return sections of the blades in scale, without twist, one beside the other, with the axis.

    Results whose files or outlines are not known are left out.
    """
    panel = Panel("sections,\nin scale (m)", "", in_scale=True)
    pairs = []
    for result in results:
        with suppress(InputError):
            pairs.append((result, sections_of(result.solution, SHOWN)))
    end = 0.0
    for number, position in enumerate(SHOWN if pairs else ()):
        drawn = np.array([outlines[number] for _, outlines in pairs])
        low, high = drawn.min(axis=(0, 1)), drawn.max(axis=(0, 1))
        axis = end - low[0]
        for result, outlines in pairs:
            x, y = np.append(outlines[number], outlines[number][:1], axis=0).T
            panel.curves.append(result.curve(axis + x, y, "" if number else result.label))
        name = "" if number else AXIS
        panel.curves.append(Curve(np.array([axis]), np.zeros(1), name, GREY, None, "points"))
        middle = end + 0.5 * (high[0] - low[0])
        panel.notes.append((float(middle), float(high[1]), f"{100.0 * position:g} % span"))
        end += 1.15 * (high[0] - low[0])
    return panel


def blade(results: Results) -> list[Panel]:
    """Return the blade: sections and planform in scale, chord, twist, thickness."""
    return [sections(results), planform(results), *shape(results)]


def coefficient(results: Results, word: str) -> Panel:
    """Return a coefficient over tip speed ratio, its peak if known, and the range operated in."""
    column = f"{word}_coefficient"
    panel = Panel(f"{word} coefficient (-)", "tip speed ratio (-)", from_zero=True)
    for curve in _beside_start(results, "coefficients", "tip_speed_ratio", column, "line"):
        curve.y = np.where(curve.y >= 0.0, curve.y, np.nan)  # below, it drives the water
        panel.curves.append(curve)
    for result in results if panel.curves else ():
        summary = result.solution.summary
        peak = getattr(summary, f"{column}_max", None)
        if peak is not None and column in result.solution.coefficients:
            x = np.array([getattr(summary, f"tip_speed_ratio_at_{column}_max")])
            name = "" if "largest value" in [x.name for x in panel.curves] else "largest value"
            panel.curves.append(result.curve(x, np.array([peak]), name, kind="points"))
        if summary.tip_speed_ratio and (ends := summary.tip_speed_ratio.ends):
            name, index = "" if panel.spans else "range operated in", result.index
            panel.spans.append(Span(*ends, name, result.color(), index if result.label else None))
    return panel


def coefficients(results: Results) -> list[Panel]:
    """Return the coefficients of power and thrust."""
    return [coefficient(results, word) for word in ("power", "thrust")]


def over_span(results: Results, column: str) -> Panel:
    """Return a load along the blade at the time of the largest one, and its limits.

    Of several scenarios, the largest of all.
    """
    load, moment = OVER_SPAN[column], column == "flapwise_moment_Nm"
    quantity = "root_moment" if moment else load
    panel, scale = _panel_of(results, quantity, "radius over that of the tip, r/R (-)")
    panel.from_zero = True
    if moment:  # along the blade
        panel.title, panel.levels = "flapwise moment (kN m)", {}
    for result in results:
        tables = [one.loads for one in result.solution.by_scenario if column in one.loads]
        if tables:
            entry = (result.solution.summary.loads or {}).get(load)
            words = f"at the largest {'suction' if load == 'cavitation' else load}"
            words += "" if entry is None or entry.time_s is None else f", t = {entry.time_s:.2f} s"
            x, y = tables[0]["r_over_R"], scale * np.max([x[column] for x in tables], axis=0)
            panel.curves.append(result.curve(x, y, result.label or words, quantity))
    return panel


def loads(results: Results) -> list[Panel]:
    """Return the loads along the blade."""
    return [over_span(results, column) for column in OVER_SPAN]


def convergence(results: Results) -> list[Panel]:
    """Return infeasibility, and how far the objective is from its last value, by evaluation."""
    panel = Panel(f"relative, at least {LEAST_SHOWN:.0e} (-)", "evaluation (-)", log=True)
    for result in results:
        if table := result.solution.convergence:
            objective = table["energy_J"]
            finite = objective[np.isfinite(objective)]
            last = finite[-1] if finite.size and finite[-1] else 1.0
            distance = np.maximum(np.abs(objective / last - 1.0), LEAST_SHOWN)
            broken = np.maximum(table["infeasibility"], LEAST_SHOWN)
            name = joined(result.label, "objective: distance from its last value")
            panel.curves.append(result.curve(table["evaluation"], distance, name, kind="marked"))
            name = joined(result.label, "infeasibility, scaled")
            color = result.color() if result.label else COLORS[1]
            after = result.index + len(results)  # another line style
            panel.curves.append(Curve(table["evaluation"], broken, name, color, after, "marked"))
    return [panel]


# ---- figures: the panels of a chart for which a result has data, drawn by Matplotlib

FIGURES: dict[str, tuple[Callable[[Results], list[Panel]], float, float]] = {
    "blade": (blade, 6.6, 1.8),
    "coefficients": (coefficients, 5.6, 2.2),
    "operation": (partial(operation, nodes=True), 7.4, 1.55),
    "power_curve": (power_curve, 7.0, 2.05),
    "year": (year, 6.4, 2.05),
    "limits": (limits, 7.0, 2.2),
    "loads": (loads, 5.6, 2.0),
    "convergence": (convergence, 6.2, 2.7),
}
"""By the name of a figure: its panels, its width and a panel's height (inches)."""
OF_WHOLE, OF_ONE = ("blade", "coefficients", "convergence"), ("operation", "limits", "year")
"""Figures of the whole result, and those of one scenario each; the others have a line for each."""


def figure_of(solutions: Solutions, name: str, scenario: str = "") -> Figure | None:
    """Return one of the `FIGURES`, with the panels that results have data for; None if none.

    Of several scenarios it shows the `scenario`, else all. The title of a single result has the
    name of its case and the scenario.
    """
    results, (make, width, height) = labelled(solutions), FIGURES[name]
    first = printable(results[0].solution.name) if len(results) == 1 else ""
    title = ": ".join(filter(None, (joined(first, scenario), name.replace("_", " "))))
    if scenario:
        results = of_scenario(results, scenario)
    elif name not in OF_WHOLE:
        results = by_scenario(results)
    panels = [panel for panel in make(results) if panel.curves]
    return style.figure_of_panels(panels, width, height, title) if panels else None


class Figures(dict[str, Figure]):
    """Figures by their names, which a notebook shows one below the other."""

    def _repr_html_(self) -> str:
        pictures = (base64.b64encode(style.picture(figure)).decode() for figure in self.values())
        return "".join(f'<img src="data:image/png;base64,{picture}">' for picture in pictures)


def figures(solutions: Solutions, names: Sequence[str] = ()) -> Figures:
    """Return the `FIGURES` for which there are data.

    Those over time are drawn for each scenario, as ``operation_<name>``, where there are several;
    the others have a line for each.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        Results, which are drawn together.
    names : sequence of str
        Which; by default all.

    Returns
    -------
    Figures

    Raises
    ------
    InputError
        If there is no figure of a name.
    """
    drawn, names_of = Figures(), [each.solution.scenarios for each in labelled(solutions)]
    several, scenarios = any(len(x) > 1 for x in names_of), dict.fromkeys(chain(*names_of))
    for name in names or FIGURES:
        if name not in FIGURES:
            raise InputError("unknown figure", f"known: {', '.join(FIGURES)}", value=name)
        for one in scenarios if several and name in OF_ONE else ("",):
            if figure := figure_of(solutions, name, one):
                drawn["_".join(filter(None, (name, one)))] = figure
    return drawn


# ---- polars, for `hkt check` and `hkt polar`


def polar_panels(curves: Sequence[tuple[str, Polar, np.ndarray, np.ndarray]]) -> list[Panel]:
    """Return lift, drag, their ratio and suction, where it is known, over the angle of attack.

    Parameters
    ----------
    curves : sequence of tuple
        Name, polar, angles of attack (rad), (n_angles,), and where the curve is sure, (n_angles,);
        elsewhere it is dotted.

    Returns
    -------
    list of Panel
        Of many curves only the first and the last are named.
    """
    many = len(curves) > MOST_NAMED
    shades = [to_hex(color) for color in colormaps["viridis"](np.linspace(0.0, 0.9, len(curves)))]
    panels = [Panel(title, "angle of attack (deg)") for title in POLARS]
    for number, (label, polar, angle, sure) in enumerate(curves):
        lift, drag = polar.evaluate(angle)
        columns = [lift, drag, lift / drag]
        if polar.suction is not None:  # none is known beyond the table
            inside = (angle >= polar.alpha_min) & (angle <= polar.alpha_max)
            columns.append(np.where(inside, np.max(polar.suction_at(angle)[0], axis=0), np.nan))
        name = "" if many and 0 < number < len(curves) - 1 else label
        for panel, y in zip(panels, columns, strict=False):
            x, color, certain = np.rad2deg(angle), shades[number], np.where(sure, y, np.nan)
            panel.curves.append(Curve(x, y, "", color, None))
            panel.curves.append(Curve(x, certain, name, color, 0 if many else number))
    return panels
