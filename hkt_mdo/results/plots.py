"""Figures of results: each plot takes one solution or several and axes, and returns the axes.

A plot computes nothing and changes no global setting of Matplotlib. Solutions differ by colour,
line style and marker, so that a grey print is read too. What `hkt check` shows is drawn from arrays
by the functions `draw_...`, which take and return axes as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from hkt_mdo.errors import InputError
from hkt_mdo.results.solution import Solution

__all__ = [
    "blade_figure",
    "check_figures",
    "convergence_figure",
    "draw_blade",
    "draw_inflow",
    "draw_polar",
    "draw_power",
    "draw_spectrum",
    "operation_figure",
    "plot_chord",
    "plot_control_torque",
    "plot_convergence",
    "plot_hydrodynamic_torque",
    "plot_power_curve",
    "plot_rotor_speed",
    "plot_tip_speed_ratio",
    "plot_torque",
    "plot_twist",
    "power_curve_figure",
    "save_check_figures",
    "save_figures",
]

Solutions = Solution | Sequence[Solution]

_COLORS = ("#0b3c6f", "#c4501b", "#4fb286", "#8a4fa3", "#b8860b", "#4a4a4a")
_LINES = ("-", "--", "-.", (0, (5, 1, 1, 1, 1, 1)), ":", (0, (8, 2)))
_MARKERS = ("o", "s", "^", "D", "v", "X")
_REFERENCE: dict[str, Any] = {"color": "0.45", "linewidth": 1.1}
_POINTS: dict[str, Any] = {"color": "#c4501b", "linewidth": 0.8}
_BAR: dict[str, Any] = {"linewidth": 2.5, "marker": "|", "markersize": 8, "markeredgewidth": 1.5}
_MARKS_PER_LINE = 12
_LABEL_SIZE = 9
_MOST_INSIDE = 4  # entries of a legend; more hide the lines


def plot_chord(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Draw the chord over the radius, and that of the blade at the start.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    return _along_blade(solutions, ax, "chord_m", "chord (m)")


def plot_twist(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Draw the twist over the radius, and that of the blade at the start.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    return _along_blade(solutions, ax, "twist_deg", "twist (deg)")


def plot_power_curve(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Draw the power coefficient over tip speed ratio, its peak, and the range operated in.

    The bar at the foot of the axes spans the tip speed ratios of the trajectory.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    chosen, ax = _listed(solutions), _axes(ax)
    starts: list[np.ndarray] = []
    ranges = False
    for index, solution in enumerate(chosen):
        curve, style = solution.power_curve, _style(index)
        if not curve:
            continue
        ratio, start = curve["tip_speed_ratio"], curve["start_power_coefficient"]
        label = _label(solution) if len(chosen) > 1 else "optimized blade"
        if np.array_equal(start, curve["power_coefficient"]):
            label = _label(solution) if len(chosen) > 1 else "blade"
        elif not any(np.array_equal(start, other) for other in starts):
            ax.plot(ratio, start, linestyle=":", **_REFERENCE, label=_start_label(starts))
            starts.append(start)
        ax.plot(ratio, curve["power_coefficient"], label=label, **style)
        summary = solution.summary
        best = summary.get("tip_speed_ratio_at_power_coefficient_max")
        if best is not None and summary.get("power_coefficient_max") is not None:
            ax.plot(
                [best], [summary["power_coefficient_max"]], color=style["color"], **_mark(index)
            )
        reach = summary.get("tip_speed_ratio") or {}
        if reach.get("min") is not None and reach.get("max") is not None:
            ax.plot(
                [reach["min"], reach["max"]],
                [0.035 + 0.04 * index] * 2,
                transform=ax.get_xaxis_transform(),
                color=style["color"],
                **_BAR,
            )
            ranges = True
    if ranges:
        ax.plot([], [], color="0.3", label="range operated in", **_BAR)
    ax.set_ylim(bottom=0.0)
    _finish(ax, "tip speed ratio (-)", "power coefficient $C_P$ (-)")
    return ax


def plot_rotor_speed(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Draw the rotor speed over time.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw; of one alone the collocation nodes are shown.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    return _over_time(solutions, ax, "rotor_speed_rad_s", "rotor speed (rad/s)")


def plot_tip_speed_ratio(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Draw the tip speed ratio over time.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw; of one alone the collocation nodes are shown.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    return _over_time(solutions, ax, "tip_speed_ratio", "tip speed ratio (-)")


def plot_control_torque(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Draw the control torque over time, and its limit.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw; of one alone the collocation nodes are shown.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    ax = _over_time(solutions, ax, "control_torque_Nm", "control torque (N m)")
    return _torque_limits(solutions, ax)


def plot_hydrodynamic_torque(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Draw the hydrodynamic torque over time.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw; of one alone the collocation nodes are shown.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    return _over_time(solutions, ax, "hydrodynamic_torque_Nm", "hydrodynamic torque (N m)")


def plot_torque(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Draw control torque, hydrodynamic torque and the torque limit over time in one picture.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw; the simulation, or the collocation nodes where there is none.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    chosen, ax = _listed(solutions), _axes(ax)
    for index, solution in enumerate(chosen):
        table = solution.simulation or solution.trajectory
        if not table:
            continue
        prefix = f"{_label(solution)}, " if len(chosen) > 1 else ""
        style = _style(index) | _sparse_marks(index, table, len(chosen))
        for name, line in (("control", "-"), ("hydrodynamic", "--")):
            if len(chosen) == 1 and name == "hydrodynamic":
                style["color"] = _COLORS[1]  # a light rotor's two torques all but coincide
            ax.plot(
                table["time_s"],
                table[f"{name}_torque_Nm"],
                label=f"{prefix}{name}",
                **style | {"linestyle": line},
            )
    _finish(ax, "time (s)", "torque (N m)", above=True)
    return _torque_limits(solutions, ax)


def plot_convergence(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Draw energy and, on a logarithmic axis at the right, infeasibility over evaluations.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The left axes, those of the energy.
    """
    chosen, ax = _listed(solutions), _axes(ax)
    right = ax.twinx()
    right.set_ylabel("infeasibility, scaled (-)", fontsize=_LABEL_SIZE)
    right.tick_params(labelsize=_LABEL_SIZE)
    for index, solution in enumerate(chosen):
        table = solution.convergence
        if not table:
            continue
        prefix = f"{_label(solution)}, " if len(chosen) > 1 else ""
        color, evaluation = _style(index)["color"], table["evaluation"]
        ax.plot(evaluation, table["energy_J"], label=f"{prefix}energy", **_style(index))
        right.plot(
            evaluation,
            table["infeasibility"],
            color=color if len(chosen) > 1 else _COLORS[1],
            linestyle=":",
            linewidth=1.0,
            marker=_MARKERS[index % len(_MARKERS)],
            markersize=3,
            markevery=max(1, evaluation.size // 40),
            label=f"{prefix}infeasibility",
        )
    infeasibilities = [
        solution.convergence.get("infeasibility", np.empty(0)) for solution in chosen
    ]
    if any(np.any(np.isfinite(column) & (column > 0.0)) for column in infeasibilities):
        right.set_yscale("log", nonpositive="mask")
    _finish(ax, "evaluation (-)", "energy (J)", also=right, above=True)
    return ax


# Figures ------------------------------------------------------------------------------------------


def blade_figure(solutions: Solutions) -> Figure | None:
    """Return a figure of twist (top) and chord, as Figs. 4 and 7 of the paper.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw.

    Returns
    -------
    matplotlib.figure.Figure or None
        None where no solution has a blade.
    """
    if not any(_has_blade(solution.summary) for solution in _listed(solutions)):
        return None
    figure = _figure(5.6, 5.4)
    top, bottom = figure.subplots(2, 1, sharex=True)
    plot_twist(solutions, top).set_xlabel("")
    plot_chord(solutions, bottom)
    _drop_legend(bottom)
    return figure


def power_curve_figure(solutions: Solutions) -> Figure | None:
    """Return a figure of the power coefficient over tip speed ratio, as Figs. 5 and 8 of the paper.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw.

    Returns
    -------
    matplotlib.figure.Figure or None
        None where no solution has a power curve.
    """
    if not any(solution.power_curve for solution in _listed(solutions)):
        return None
    figure = _figure(5.6, 3.9)
    plot_power_curve(solutions, figure.subplots())
    return figure


def operation_figure(solutions: Solutions) -> Figure | None:
    """Return a figure of speed, tip speed ratio and both torques, as Figs. 6 and 9 of the paper.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw.

    Returns
    -------
    matplotlib.figure.Figure or None
        None where no solution has a trajectory or simulation.
    """
    chosen = _listed(solutions)
    if not any(solution.simulation or solution.trajectory for solution in chosen):
        return None
    figure = _figure(7.0, 8.2)
    panels = figure.subplots(4, 1, sharex=True)
    plots = (plot_rotor_speed, plot_tip_speed_ratio, plot_control_torque, plot_hydrodynamic_torque)
    for panel, plot in zip(panels, plots, strict=True):
        plot(solutions, panel)
        if panel is not panels[-1]:
            panel.set_xlabel("")
        _drop_legend(panel)
    handles: dict[str, Any] = {}
    for panel in panels:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="outside upper center",
        ncols=3,
        frameon=False,
        fontsize=_LABEL_SIZE,
    )
    figure.align_ylabels(panels)
    return figure


def convergence_figure(solutions: Solutions) -> Figure | None:
    """Return a figure of energy and infeasibility over the optimizer's evaluations.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw.

    Returns
    -------
    matplotlib.figure.Figure or None
        None where no solution has a convergence history.
    """
    if not any(solution.convergence for solution in _listed(solutions)):
        return None
    figure = _figure(6.2, 3.9)
    plot_convergence(solutions, figure.subplots())
    return figure


_FIGURES: dict[str, Callable[[Solutions], Figure | None]] = {
    "blade": blade_figure,
    "power_curve": power_curve_figure,
    "operation": operation_figure,
    "convergence": convergence_figure,
}


def save_figures(
    solutions: Solutions, folder: str | Path, formats: Sequence[str] = ("png", "pdf")
) -> list[Path]:
    """Write the figures blade, power_curve, operation and convergence, as far as there are data.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        What to draw.
    folder : str or pathlib.Path
        Where to; made if it does not exist, files of the same names are replaced.
    formats : sequence of str
        Endings that Matplotlib knows, such as png, pdf or svg.

    Returns
    -------
    list of pathlib.Path
        The files written.

    Raises
    ------
    InputError
        If Matplotlib does not know a format; nothing has been written then.
    """
    known = sorted(FigureCanvasAgg.get_supported_filetypes())
    for form in formats:
        if form not in known:
            raise InputError(
                "unknown format of figures", f"known: {', '.join(known)}", key="format", value=form
            )
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, draw in _FIGURES.items():
        figure = draw(solutions)
        if figure is None:
            continue
        for form in formats:
            path = folder / f"{name}.{form}"
            # without a date equal results give equal files; journals want fonts of type 42
            metadata = {"CreationDate": None} if form == "pdf" else None
            with rc_context({"pdf.fonttype": 42}):
                figure.savefig(path, dpi=200, metadata=metadata)
            written.append(path)
    return written


# Figures of a check -------------------------------------------------------------------------------


def draw_blade(
    data: Mapping[str, Any],
    column: str = "chord_m",
    label: str = "chord (m)",
    ax: Axes | None = None,
) -> Axes:
    """Draw a column of the starting blade over the radius, with its stations and control points.

    Parameters
    ----------
    data : mapping
        `blade` of a check's figures.
    column : {'chord_m', 'twist_deg', 'thickness_percent'}
    label : str
        Of the vertical axis.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    ax = _axes(ax)
    style = _style(0) | {"marker": "o", "markersize": 4}
    if f"{column}_file" in data:
        ax.plot(data["r_m"], data[f"{column}_file"], ":", **_REFERENCE, label="blade of the file")
    ax.plot(data["r_m"], data[column], label="blade at the start, its stations", **style)
    if f"{column}_points" in data:
        places, values = data[f"{column}_points"]
        ax.plot(places, values, "--", marker="s", markersize=5, **_POINTS, label="control points")
    for end in data["ends_m"]:
        ax.axvline(end, **_REFERENCE | {"linewidth": 0.8})
    if np.min(data[column]) > 0.0:
        ax.set_ylim(bottom=0.0)
    _finish(ax, "radius (m), from hub to tip", label)
    return ax


def draw_polar(data: Mapping[str, Any], column: str = "lift", ax: Axes | None = None) -> Axes:
    """Draw a coefficient of all polars over the angle of attack; dotted where it is extended.

    Shaded are the angles of attack that the stations meet.

    Parameters
    ----------
    data : mapping
        `polar` of a check's figures.
    column : {'lift', 'drag'}
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    ax = _axes(ax)
    curves = data["curves"]
    for index, curve in enumerate(curves):
        shade = index / max(len(curves) - 1, 1)
        color = _COLORS[index] if len(curves) <= len(_COLORS) else colormaps["viridis"](0.9 * shade)
        alpha = curve["alpha_deg"]
        inside = (alpha >= curve["table_deg"][0]) & (alpha <= curve["table_deg"][1])
        ax.plot(alpha, curve[column], color=color, linestyle=":", linewidth=1.0)
        # of very many the first and the last are named
        named = len(curves) <= 2 * _MOST_INSIDE or index in (0, len(curves) - 1)
        ax.plot(
            alpha[inside],
            curve[column][inside],
            color=color,
            linestyle=_LINES[index % len(_LINES)] if len(curves) <= len(_LINES) else "-",
            linewidth=1.4,
            label=curve["label"] if named else None,
        )
    ax.axvspan(*data["met_deg"], color="0.5", alpha=0.2, linewidth=0, label="met in this flow")
    ax.set_xlim(curves[0]["alpha_deg"][[0, -1]])
    _finish(ax, "angle of attack (deg)", f"{column} coefficient (-)", above=True)
    return ax


def draw_inflow(data: Mapping[str, Any], ax: Axes | None = None) -> Axes:
    """Draw a flow over time, its mean, and the speed at which the torque limit is met.

    Parameters
    ----------
    data : mapping
        `inflow` of a check's figures.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    ax = _axes(ax)
    time, speed = data["time_s"], data["speed_m_s"]
    ax.plot(time, speed, color=_COLORS[0], linewidth=1.2 if time.size < 5000 else 0.6)
    ax.axhline(data["mean_m_s"], linestyle="--", **_REFERENCE, label="mean")
    rated, low, high = data["rated_m_s"], float(np.min(speed)), float(np.max(speed))
    if rated is not None and low - (high - low) < rated < high + (high - low):
        ax.axhline(
            rated, linestyle="-.", color=_COLORS[1], linewidth=1.1, label="torque limit is met"
        )
    ax.set_xlim(time[0], time[-1])
    _keep_small_small(ax)
    _finish(ax, "time (s)", "inflow speed (m/s)", above=True)
    return ax


def draw_spectrum(data: Mapping[str, Any], ax: Axes | None = None) -> Axes:
    """Draw the power spectral density of a flow and its cutoff; of a steady flow nothing.

    Parameters
    ----------
    data : mapping
        `inflow` of a check's figures.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    ax = _axes(ax)
    if "spectrum" in data:
        frequency, density = data["spectrum"]
        ax.loglog(frequency, density, color=_COLORS[0], linewidth=1.2)
        top = float(np.max(density))
        loud = frequency[density > 1e-8 * top]  # the rest is rounding
        ax.set_ylim(1e-8 * top, 4.0 * top)
        ax.set_xlim(0.8 * loud[0], 1.25 * max(loud[-1], data["cutoff_hz"] or 0.0))
        if data["cutoff_hz"]:
            ax.axvline(data["cutoff_hz"], linestyle="--", **_REFERENCE, label="cutoff")
    else:
        ax.text(0.5, 0.5, "steady flow", ha="center", va="center", transform=ax.transAxes)
    _finish(ax, "frequency (Hz)", "spectral density (m²/s)", above=True)
    return ax


def draw_power(data: Mapping[str, Any], ax: Axes | None = None) -> Axes:
    """Draw the starting blade's power coefficient, its peak and the range it works in.

    Parameters
    ----------
    data : mapping
        `power_curve` of a check's figures.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure's by default.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.
    """
    ax = _axes(ax)
    style = _style(0) | {"marker": ""}
    ax.plot(data["tip_speed_ratio"], data["power_coefficient"], label="blade at the start", **style)
    ratio, power = data["best"]
    ax.plot([ratio], [power], color=style["color"], **_mark(0))
    if data["working"] is not None:
        ax.axvspan(
            *data["working"], color="0.5", alpha=0.2, linewidth=2, label="met under the control law"
        )
    ax.set_ylim(bottom=0.0)
    _finish(ax, "tip speed ratio (-)", "power coefficient $C_P$ (-)")
    return ax


def check_figures(data: Mapping[str, Mapping[str, Any]]) -> dict[str, Figure]:
    """Return the figures of a check: blade, polar, inflow and power_curve.

    Parameters
    ----------
    data : mapping
        `figures` of a `hkt_mdo.run.check.CheckReport`.

    Returns
    -------
    dict of str to matplotlib.figure.Figure
    """
    figures = {}
    figures["blade"] = _figure(5.6, 6.8)
    panels = figures["blade"].subplots(3, 1, sharex=True)
    columns = ("chord_m", "twist_deg", "thickness_percent")
    labels = ("chord (m)", "twist (deg)", "thickness (% of the chord)")
    for panel, column, label in zip(panels, columns, labels, strict=True):
        draw_blade(data["blade"], column, label, panel)
        if panel is not panels[-1]:
            panel.set_xlabel("")
        if panel is not panels[0]:
            _drop_legend(panel)
    figures["polar"] = _figure(6.4, 6.4)
    top, bottom = figures["polar"].subplots(2, 1, sharex=True)
    draw_polar(data["polar"], "lift", top).set_xlabel("")
    draw_polar(data["polar"], "drag", bottom)
    _drop_legend(bottom)
    figures["inflow"] = _figure(6.8, 5.8)
    top, bottom = figures["inflow"].subplots(2, 1)
    draw_inflow(data["inflow"], top)
    draw_spectrum(data["inflow"], bottom)
    figures["power_curve"] = _figure(5.6, 3.9)
    draw_power(data["power_curve"], figures["power_curve"].subplots())
    return figures


def save_check_figures(data: Mapping[str, Mapping[str, Any]], folder: str | Path) -> list[Path]:
    """Write the figures of a check as PNG files; files of the same names are replaced.

    Parameters
    ----------
    data : mapping
        `figures` of a `hkt_mdo.run.check.CheckReport`.
    folder : str or pathlib.Path
        Where to; made if it does not exist.

    Returns
    -------
    list of pathlib.Path
        The files written.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, figure in check_figures(data).items():
        path = folder / f"{name}.png"
        figure.savefig(path, dpi=150)
        written.append(path)
    return written


# Parts --------------------------------------------------------------------------------------------


def _listed(solutions: Solutions) -> list[Solution]:
    return [solutions] if isinstance(solutions, Solution) else list(solutions)


def _label(solution: Solution) -> str:
    # Matplotlib leaves labels that begin with an underscore out of legends
    return f" {solution.name}" if solution.name.startswith("_") else solution.name


def _start_label(before: Sequence[object]) -> str | None:
    return None if before else "blade at the start"


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _axes(ax: Axes | None) -> Axes:
    return _figure(6.2, 3.9).subplots() if ax is None else ax


def _style(index: int) -> dict[str, Any]:
    return {
        "color": _COLORS[index % len(_COLORS)],
        "linestyle": _LINES[index % len(_LINES)],
        "linewidth": 1.5,
    }


def _mark(index: int) -> dict[str, Any]:
    return {"marker": _MARKERS[index % len(_MARKERS)], "markersize": 6, "linestyle": "none"}


def _sparse_marks(index: int, table: dict[str, np.ndarray], count: int) -> dict[str, Any]:
    """Return a few markers a line, staggered, where several solutions share the axes."""
    if count == 1:
        return {}
    every = max(1, table["time_s"].size // _MARKS_PER_LINE)
    return {
        "marker": _MARKERS[index % len(_MARKERS)],
        "markersize": 4,
        "markevery": (index * every // count, every),
    }


def _has_blade(summary: dict[str, Any]) -> bool:
    return all(summary.get(name) is not None for name in ("r_m", "chord_m", "twist_deg"))


def _along_blade(solutions: Solutions, ax: Axes | None, column: str, label: str) -> Axes:
    chosen, ax = _listed(solutions), _axes(ax)
    starts: list[list[float]] = []
    for index, solution in enumerate(chosen):
        summary = solution.summary
        if not _has_blade(summary):
            continue
        radius, start = summary["r_m"], summary.get(f"start_{column}")
        name = _label(solution) if len(chosen) > 1 else "optimized blade"
        if start == summary[column]:
            name = _label(solution) if len(chosen) > 1 else "blade"
        elif start is not None and start not in starts:
            ax.plot(
                radius,
                start,
                linestyle=":",
                marker="x",
                markersize=4.5,
                label=_start_label(starts),
                **_REFERENCE,
            )
            starts.append(start)
        style = _style(index) | {"marker": _MARKERS[index % len(_MARKERS)], "markersize": 4.5}
        ax.plot(radius, summary[column], label=name, **style)
    _finish(ax, "radius (m)", label)
    return ax


def _over_time(solutions: Solutions, ax: Axes | None, column: str, label: str) -> Axes:
    chosen, ax = _listed(solutions), _axes(ax)
    for index, solution in enumerate(chosen):
        table = solution.simulation or (solution.trajectory if len(chosen) > 1 else {})
        if table:
            name = _label(solution) if len(chosen) > 1 else "simulation"
            style = _style(index) | _sparse_marks(index, table, len(chosen))
            ax.plot(table["time_s"], table[column], label=name, **style)
        if len(chosen) == 1 and solution.trajectory:
            ax.plot(
                solution.trajectory["time_s"],
                solution.trajectory[column],
                color=_COLORS[1],
                label="collocation nodes",
                **_mark(0) | {"markersize": 3.2, "markerfacecolor": "none", "zorder": 2.5},
            )
    _finish(ax, "time (s)", label, above=True)
    _keep_small_small(ax)
    return ax


def _keep_small_small(ax: Axes) -> None:
    """Give the axes at least 1 % of the value: a constant should look like one, not like noise."""
    low, high = ax.get_ylim()
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), 0.005 * abs(middle))
    ax.set_ylim(middle - half, middle + half)


def _torque_limits(solutions: Solutions, ax: Axes) -> Axes:
    given = [solution.case.control.torque_limit for solution in _listed(solutions)]
    limits = {limit for limit in given if limit is not None}
    for limit in sorted(limits):
        ax.axhline(limit, linestyle="-.", **_REFERENCE, label=f"torque limit {limit:g} N m")
    if limits:
        _legend(ax, above=True)
    return ax


def _finish(
    ax: Axes, x_label: str, y_label: str, also: Axes | None = None, above: bool = False
) -> None:
    ax.set_xlabel(x_label, fontsize=_LABEL_SIZE)
    ax.set_ylabel(y_label, fontsize=_LABEL_SIZE)
    ax.tick_params(labelsize=_LABEL_SIZE)
    formatter = ax.yaxis.get_major_formatter()
    if isinstance(formatter, ScalarFormatter):
        formatter.set_useOffset(False)
    ax.grid(True, color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    _legend(ax, also, above)


def _legend(ax: Axes, also: Axes | None = None, above: bool = False) -> None:
    handles, labels = ax.get_legend_handles_labels()
    if also is not None:
        more = also.get_legend_handles_labels()
        handles, labels = [*handles, *more[0]], [*labels, *more[1]]
    if not handles:
        return
    # the legend belongs to the upper axes, or their lines would cross it
    host = ax if also is None else also
    place: dict[str, Any]
    if above or len(handles) > _MOST_INSIDE:
        columns = 3 if len(handles) <= 3 else 2
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
        place |= {"ncols": columns, "frameon": False}
    else:
        place = {"loc": "best", "framealpha": 0.9, "edgecolor": "0.8"}
    host.legend(handles, labels, fontsize=_LABEL_SIZE, **place)


def _drop_legend(ax: Axes) -> None:
    legend = ax.get_legend()
    if legend is not None:
        legend.remove()
