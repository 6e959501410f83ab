"""Plots of results on axes.

Each `plot_...` takes one solution or several and, optionally, the axes to draw on (of a new figure
by default), and returns the axes. A plot sets no rcParams. Solutions, and the
scenarios of one, differ by colour, line style and marker, so that they can be told apart in grey.
Of a single one, a quantity has the same colour in every figure, and over time there are collocation
nodes beside the simulation.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from hkt_mdo.quantities import QUANTITIES
from hkt_mdo.results import shown, style
from hkt_mdo.results.sections import STACKING
from hkt_mdo.results.shown import Solutions, named, named_scenarios
from hkt_mdo.results.steady import binned, rated_point, steady_curve
from hkt_mdo.results.words import limit_words

_BAR: dict[str, Any] = {"linewidth": 2.5, "marker": "|", "markersize": 8, "markeredgewidth": 1.5}
_MARKS_PER_LINE = 12
_NODES_SHOWN = 40  # of the collocation: more markers would hide the line


def _over_radius(column: str, label: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a column of the blade over the radius, from zero, with the bounds of the design."""
    ax = _beside_start(solutions, ax, "blade", "r_m", column)
    values = np.concatenate([[0.0], *(line.get_ydata() for line in ax.lines)])
    ax.axhline(0.0, color="0.75", linewidth=0.8, label="_zero")
    ax.set_xlim(left=0.0)
    if column != "twist_deg":
        ax.set_ylim(bottom=0.0)
    chosen = [each for each, _ in named(solutions)]
    for words, (end, bound) in shown.near_bounds(chosen, column, values).items():
        style.level(ax, bound, words, 1 - end)
    return style.finish(ax, "radius (m)", label)


# over the radius, and that of the blade at the start
plot_chord = partial(_over_radius, "chord_m", "chord (m)")
plot_twist = partial(_over_radius, "twist_deg", "twist (deg)")
plot_thickness = partial(_over_radius, "thickness_over_chord", "thickness\nover chord (-)")


def plot_planform(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot the outline of the untwisted blade in scale, with its axis."""
    ax = ax or style.new_axes()
    for index, (solution, name) in enumerate(named(solutions)):
        if not (blade := solution.blade):
            continue
        radius, chord, look = blade["r_m"], blade["chord_m"], style.line(index)
        edges = STACKING * chord, (STACKING - 1.0) * chord
        around = np.r_[edges[0], edges[1][::-1], edges[0][:1]]
        ax.plot(np.r_[radius, radius[::-1], radius[:1]], around, label=name or "_blade", **look)
        if not name:
            ax.fill_between(radius, *edges, color=look["color"], alpha=0.12, linewidth=0)
        if index == 0:
            along = [0.0, radius[-1]], [0.0, 0.0]
            ax.plot(*along, label=shown.AXIS, linestyle="-.", **style.REFERENCE)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlim(left=0.0)
    return style.finish(ax, "radius (m)", "planform,\nin scale (m)")


def plot_sections(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot sections of the blade in scale, without twist, one beside the other, with its axis.

    Results whose files or outlines are not known are left out.
    """
    ax, end, color = ax or style.new_axes(), 0.0, style.REFERENCE["color"]
    found = [(*each, shown.known_sections(each[0])) for each in named(solutions)]
    known = [(index, name, x) for index, (_, name, x) in enumerate(found) if x.size]
    for number, place in enumerate(shown.SHOWN if known else ()):
        low, high = (most([x[number] for *_, x in known], axis=(0, 1)) for most in (np.min, np.max))
        axis, words = end - low[0], f"{100.0 * place:g} % span"
        for index, name, x in known:
            along, across = np.append(x[number], x[number][:1], axis=0).T
            label = f"_{words}" if number or not name else name
            ax.plot(axis + along, across, label=label, **style.line(index))
        ax.plot([axis], [0.0], "+", label="_" if number else shown.AXIS, markersize=9, color=color)
        above: dict[str, Any] = {"xytext": (0, 3), "textcoords": "offset points", "ha": "center"}
        above |= {"fontsize": style.FONT_SIZE - 1.5}
        ax.annotate(words, (end + 0.5 * (high[0] - low[0]), high[1]), **above)
        end += 1.15 * (high[0] - low[0])
    ax.set_aspect("equal", adjustable="datalim")
    style.finish(ax, "", "sections,\nin scale (m)")
    ax.tick_params(bottom=False, labelbottom=False)
    return ax


def _over_ratio(word: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a coefficient over tip speed ratio, its peak if known, and the range operated in.

    The bar at the foot of the axes spans the tip speed ratios of the trajectory.
    """
    column = f"{word}_coefficient"
    ax = _beside_start(solutions, ax, "coefficients", "tip_speed_ratio", column)
    across, bars = ax.get_xaxis_transform(), 0
    for index, (solution, _) in enumerate(named(solutions)):
        get, color = solution.summary.get, style.line(index)["color"]
        if solution.coefficients and (most := get(f"{column}_max")) is not None:
            peak = {"color": color, "linestyle": "none", "label": "_" if index else "largest value"}
            ax.plot(
                [get(f"tip_speed_ratio_at_{column}_max")], [most], **peak, **style.marker(index)
            )
        if reach := get("tip_speed_ratio"):
            look = _BAR | {"color": color, "label": "_" if bars else "range operated in"}
            height, bars = 0.035 + 0.04 * index, bars + 1
            ax.plot([reach["min"], reach["max"]], [height] * 2, transform=across, **look)
    ax.set_ylim(bottom=0.0)
    return style.finish(ax, "tip speed ratio (-)", f"{word} coefficient (-)")


plot_power_coefficient = partial(_over_ratio, "power")
plot_thrust_coefficient = partial(_over_ratio, "thrust")


def _few_markers(index: int, count: int, size: int) -> dict[str, Any]:
    """Return the markers of a line of so many points, staggered against those of the others."""
    every = max(1, size // _MARKS_PER_LINE)
    return style.marker(index, 4.0) | {"markevery": (index * every // count, every)}


def _over_time(quantity: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a quantity over time, of one solution at some of the nodes too, and its limits."""
    chosen, ax = named_scenarios(solutions), ax or style.new_axes()
    column = QUANTITIES[quantity].column
    words, unit, scale = shown.words_of(quantity, (each for each, _ in chosen))
    for index, (solution, name) in enumerate(chosen):
        table, label = solution.simulation, name or "simulation"
        if column not in table:
            table, label = solution.trajectory, name or "collocation nodes"
        if column in table:
            time, look = table["time_s"], style.line(index)
            extra = _few_markers(index, len(chosen), time.size) if name else {}
            look = (look if name else style.colored(look, quantity)) | extra
            series = (solution.across_gaps(time, each) for each in (time, scale * table[column]))
            ax.plot(*series, label=label, **look)
    nodes = chosen[0][0].trajectory
    if len(chosen) == 1 and column in nodes:
        look = style.marker(0, 3.2) | {"linestyle": "none", "markerfacecolor": "none"}
        look |= {"color": "0.35", "zorder": 2.5, "label": "collocation nodes"}
        look |= {"markevery": max(1, -(-nodes["time_s"].size // _NODES_SHOWN))}
        ax.plot(nodes["time_s"], scale * nodes[column], **look)
    _draw_levels(quantity, scale, solutions, ax)
    style.widen(ax)
    return style.finish(ax, "time (s)", f"{words} ({unit})")


# over time, in the units of `hkt_mdo.results.shown.WORDS`
plot_inflow_speed = partial(_over_time, "inflow_speed")
plot_rotor_speed = partial(_over_time, "rotor_speed")
plot_tip_speed_ratio = partial(_over_time, "tip_speed_ratio")
plot_hydrodynamic_torque = partial(_over_time, "hydrodynamic_torque")
plot_control_torque = partial(_over_time, "control_torque")
plot_power = partial(_over_time, "generator_power")
plot_thrust = partial(_over_time, "thrust")
plot_root_moment = partial(_over_time, "root_moment")
plot_stress_over_time = partial(_over_time, "stress")
plot_suction_over_time = partial(_over_time, "cavitation")


def plot_limits(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a bar for each limit: the largest value over the limit, which is 1; of each solution."""
    ax, chosen = ax or style.new_axes(), named_scenarios(solutions)
    shares = [solution.limit_shares() for solution, _ in chosen]
    rows = list(dict.fromkeys(limit for each in shares for limit in each))[::-1]
    height = 0.8 / len(chosen)
    for index, ((_, name), found) in enumerate(zip(chosen, shares, strict=True)):
        if not found:
            continue
        places = [rows.index(limit) + (0.5 * len(chosen) - index - 0.5) * height for limit in found]
        most = [float(np.nanmax(share)) for share in found.values()]
        look = style.bar(index) | {"height": 0.9 * height, "alpha": 0.85}
        if not name:
            look["color"] = [style.colored(look, limit)["color"] for limit in found]
        ax.barh(places, most, label=name or "largest value", **look)
        for place, value in zip(places, most, strict=True):
            words: dict[str, Any] = {"va": "center", "fontsize": style.FONT_SIZE - 1.5}
            ax.text(max(value, 1.0), place, f" {value:.3f}", **words)  # beyond the limit's line
    ax.axvline(1.0, label="limit", **style.REFERENCE | {"linewidth": 1.6})
    ax.set_xlim(0.0, 1.12 * max(1.0, ax.get_xlim()[1] / 1.05))
    room = max(0.6, 0.5 * (4 - len(rows)))  # a single bar does not fill the axes
    ax.set_ylim(-room, len(rows) - 1 + room)
    style.finish(ax, "largest value over its limit (-)", "")
    ax.set_yticks(range(len(rows)), [limit_words(limit) for limit in rows])
    return ax


def _over_flow(quantity: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a quantity over the flow speed, from zero: means, most instants, steady operation."""
    chosen, ax = named_scenarios(solutions), ax or style.new_axes()
    words, unit, scale = shown.words_of(quantity, (each for each, _ in chosen))
    column = QUANTITIES[quantity].column
    for index, (solution, name) in enumerate(chosen):
        table, look = solution.simulation or solution.trajectory, style.line(index)
        if column not in table:
            continue
        if not name:
            look = style.colored(look, quantity)
        speed, mean, low, high = binned(
            table["inflow_speed_m_s"], scale * table[column], solution.steady
        )
        band = {"alpha": 0.12 if name else 0.2, "color": look["color"], "linewidth": 0}
        if not solution.steady:
            label = None if name else "90 % of the instants"
            ax.fill_between(speed, low, high, label=label, **band)
        marks = _few_markers(index, len(chosen), speed.size)
        ax.plot(speed, mean, label=name or "mean at this flow speed", **look, **marks)
        if column in (steady := steady_curve(solution)):
            dashed: dict[str, Any] = {"color": look["color"] if name else "black", "linewidth": 1.0}
            dashed |= {"linestyle": "--", "label": "_steady" if name else "in steady flow"}
            ax.plot(steady["inflow_speed_m_s"], scale * steady[column], **dashed)
    ax.set_xlim(left=0.0)
    ax.set_ylim(bottom=0.0)
    _draw_levels(quantity, scale, solutions, ax, 1)  # where the curves are low
    stops = {solution.case.control.cut_out for solution, _ in chosen} - {None}
    for stop in sorted(stops):
        ax.axvline(stop, label=f"cut-out {stop:g} m/s", linestyle=":", **style.REFERENCE)
    return style.finish(ax, "inflow speed (m/s)", f"{words} ({unit})")


# over the flow speed, with their limits
plot_torque_curve = partial(_over_flow, "control_torque")
plot_thrust_curve = partial(_over_flow, "thrust")
plot_speed_curve = partial(_over_flow, "rotor_speed")


def plot_power_curve(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot shaft power and, of a generator with losses, the mean electrical power over the flow."""
    ax, label = _over_flow("generator_power", solutions, ax), "electrical power, mean"
    chosen = named_scenarios(solutions)
    for index, (solution, name) in enumerate(chosen):
        table = solution.simulation or solution.trajectory
        rated = None if name else rated_point(solution)
        if rated is not None:
            look = style.marker(3, 7.0) | {"color": "black", "linestyle": "none"}
            point = [rated[0]], [1e-3 * rated[1]]
            ax.plot(*point, label=f"rated at {rated[0]:.2f} m/s", **look)
        if table and not np.allclose(table["electrical_power_W"], table["generator_power_W"]):
            look = {"color": style.COLORS[index % len(style.COLORS)], "linewidth": 1.2}
            found = binned(
                table["inflow_speed_m_s"], 1e-3 * table["electrical_power_W"], solution.steady
            )
            ax.plot(found.speed, found.mean, linestyle=(0, (1, 2)), label=label, **look)
            label = "_"  # one entry in the legend is enough
    style.legend([ax])
    return ax


def _over_span(column: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a load along the blade at the time of the largest one, and its limits."""
    chosen, ax = named_scenarios(solutions), ax or style.new_axes()
    load, quantity, label, scale = shown.OVER_SPAN[column]
    for index, (solution, name) in enumerate(chosen):
        if column in solution.loads:
            entry = (solution.summary.loads or {}).get(load)
            words = f"at the largest {'suction' if load == 'cavitation' else load}"
            words += "" if entry is None or entry.time_s is None else f", t = {entry.time_s:.2f} s"
            values, look = scale * solution.loads[column], style.line(index)
            if not name:  # another instant has another look
                dashes = {"linestyle": "-" if load == "stress" else (0, (4, 1.5))}
                look = style.colored(look, quantity) | dashes
            if name:
                look |= _few_markers(index, len(chosen), values.size)
            ax.plot(solution.loads["r_over_R"], values, label=name or words, **look)
    if column == QUANTITIES[quantity].column:  # not a moment along the blade
        _draw_levels(quantity, scale, solutions, ax)
    lines = [line.get_ydata() for line in ax.lines]
    if all(np.min(values) > -0.01 * np.max(values) for values in lines):
        ax.set_ylim(bottom=0.0)
    return style.finish(ax, "radius over that of the tip, r/R (-)", label)


# along the blade, at the times of the largest stress and suction
plot_stress = partial(_over_span, "stress_Pa")
plot_flapwise_moment = partial(_over_span, "flapwise_moment_Nm")
plot_suction = partial(_over_span, "cavitation")


def _draw_levels(
    quantity: str, scale: float, solutions: Solutions, ax: Axes, first: int = 0
) -> None:
    """Draw the limits of a quantity as lines; `first`: place of the first label."""
    levels = shown.levels_of(named_scenarios(solutions), quantity, scale)
    for place, (words, level) in enumerate(levels.items(), first):
        style.level(ax, level, words, place)


def plot_convergence(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot infeasibility, and the distance of the energy from its last value, over evaluations."""
    ax = ax or style.new_axes()
    for index, (solution, name) in enumerate(named(solutions)):
        count, distance, infeasibility = shown.convergence(solution)
        if not count.size:
            continue
        look, prefix = style.line(index), f"{name}, " if name else ""
        look |= style.marker(index, 3.0) | {"markevery": max(1, count.size // 40)}
        ax.plot(count, distance, label=f"{prefix}energy: distance from its last value", **look)
        look |= {"linestyle": ":", "linewidth": 1.0} | ({} if name else {"color": style.COLORS[1]})
        ax.plot(count, infeasibility, label=f"{prefix}infeasibility, scaled", **look)
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter("{x:.0e}")
    return style.finish(ax, "evaluation (-)", f"relative, at least {shown.LEAST_SHOWN:.0e} (-)")


def _by_bin(column: str, solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a column of the year over the flow speed as bars, one a bin, in a quantity's colour."""
    chosen, ax = named_scenarios(solutions), ax or style.new_axes()
    label, scale, quantity = shown.YEAR[column]
    for index, (solution, name) in enumerate(chosen):
        if table := solution.year:
            speed = table["inflow_speed_m_s"]
            step = float(np.min(np.diff(speed), initial=0.1)) / len(chosen)
            at = speed + step * (index - 0.5 * (len(chosen) - 1))
            look = style.bar(index) if name else style.colored(style.bar(index), quantity)
            ax.bar(at, scale * table[column], width=0.9 * step, label=name or "_a year", **look)
    return style.finish(ax, "inflow speed (m/s)", label)


# over the bins of a year
plot_year_power = partial(_by_bin, "electrical_power_W")
plot_year_hours = partial(_by_bin, "hours")
plot_year_energy = partial(_by_bin, "energy_kWh")


def _beside_start(solutions: Solutions, ax: Axes | None, source: str, x: str, y: str) -> Axes:
    """Plot a column over another, and that of the blade at the start."""
    ax, size = ax or style.new_axes(), 4.5 if source == "blade" else 0.0
    for index, along, values, label in shown.beside_start(named(solutions), source, x, y):
        look = style.REFERENCE | {"linestyle": ":", "marker": "x", "markersize": size}
        if index is not None:
            look = style.line(index) | style.marker(index, size)
        ax.plot(along, values, label=label, **look)
    return ax
