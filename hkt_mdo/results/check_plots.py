"""Figures of a check (`hkt check`) and of polars (`hkt polar`).

Each `draw_...` takes a part of `hkt_mdo.run.check.CheckReport.figures` and returns the axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from hkt_mdo.results import style

MOST_NAMED = 8
"""Of more polars, only the first and the last have labels."""

QUIETEST = 1e-4
"""Smallest spectral density that is drawn, over the largest."""

_BAND: dict[str, Any] = {"color": "0.5", "alpha": 0.2}
_BLADE = ("chord_m", "twist_deg", "thickness_percent")
_LABELS = {
    "chord_m": "chord (m)",
    "twist_deg": "twist (deg)",
    "thickness_percent": "thickness (% of the chord)",
    "alpha_deg": "angle of attack (deg)",
    "lift": "lift coefficient (-)",
    "drag": "drag coefficient (-)",
    "ratio": "lift over drag (-)",
    "suction": "largest suction, -cp (-)",
}


def draw_blade(data: Mapping[str, Any], column: str, ax: Axes) -> Axes:
    """Draw a column of the starting blade, its file, control points and ends over the radius."""
    radius, file, points = data["r_m"], data.get(f"{column}_file"), data.get(f"{column}_points")
    if file is not None:
        ax.plot(radius, file, ":", **style.REFERENCE, label="blade of the file")
    look = style.line(0) | style.marker(0, 4.0)
    ax.plot(radius, data[column], label="blade at the start, its stations", **look)
    if points is not None:
        ax.plot(*points, **style.line(1) | style.marker(1, 4.0), label="control points")
    for end in data["ends_m"]:
        ax.axvline(end, **style.REFERENCE | {"linewidth": 0.8})
    if np.min(data[column]) > 0.0:
        ax.set_ylim(bottom=0.0)
    return style.finish(ax, "radius (m), from hub to tip", _LABELS[column])


def draw_polars(curves: Sequence[Mapping[str, Any]], x: str, y: str, ax: Axes) -> Axes:
    """Draw columns of polars over one another: `alpha_deg`, `lift` or `drag`.

    A curve has these columns and a label, and is dotted where it is not `sure`. Of many curves all
    are thin, and the first and the last are named.
    """
    several = len(curves) > MOST_NAMED
    shades = colormaps["viridis"](np.linspace(0.0, 0.9, len(curves)))
    for index, (curve, color) in enumerate(zip(curves, shades, strict=True)):
        named = len(curves) <= MOST_NAMED or index in (0, len(curves) - 1)
        look = style.line(index) | {"color": color, "label": curve["label"] if named else None}
        look |= {"linestyle": "-", "linewidth": 0.8} if several else {}
        ax.plot(curve[x], curve[y], color=color, linestyle=":", linewidth=1.0)
        ax.plot(curve[x], np.where(curve["sure"], curve[y], np.nan), **look)
    return style.finish(ax, _LABELS[x], _LABELS[y])


def draw_polar(data: Mapping[str, Any], column: str, ax: Axes) -> Axes:
    """Draw polars, dotted where extended; the angles of attack that stations meet are shaded."""
    ax.axvspan(*data["met_deg"], linewidth=0, label="met in this flow", **_BAND)
    curves = []
    for curve in data["curves"]:
        alpha, (first, last) = curve["alpha_deg"], curve["table_deg"]
        ratio = curve["lift"] / curve["drag"]
        curves.append({**curve, "ratio": ratio, "sure": (alpha >= first) & (alpha <= last)})
    ax.plot([], [], color="0.5", linestyle=":", label="beyond the table")
    ax.set_xlim(alpha[[0, -1]])
    return draw_polars(curves, "alpha_deg", column, ax)


def draw_inflow(data: Mapping[str, Any], ax: Axes) -> Axes:
    """Draw the flow speed over time, its mean, and the speed at which the torque limit is met."""
    time, speed = data["time_s"], data["speed_m_s"]
    ax.plot(time, speed, color=style.COLORS[0], linewidth=1.2 if time.size < 5000 else 0.6)
    ax.axhline(data["mean_m_s"], linestyle="--", **style.REFERENCE, label="mean")
    rated, low, high = data["rated_m_s"], float(np.min(speed)), float(np.max(speed))
    if rated is not None and low - (high - low) < rated < high + (high - low):
        ax.axhline(rated, label="torque limit is met", **style.line(2))
    ax.set_xlim(time[0], time[-1])
    style.widen(ax)
    return style.finish(ax, "time (s)", "inflow speed (m/s)")


def draw_spectrum(data: Mapping[str, Any], ax: Axes) -> Axes:
    """Draw the power spectral density of the flow and its cutoff."""
    frequency, density = data["spectrum"]
    ax.loglog(frequency, density, color=style.COLORS[0], linewidth=1.2)
    top = float(np.max(density))
    loud = frequency[density > QUIETEST * top]  # the rest of the spectrum is negligible
    ax.set_ylim(QUIETEST * top, 4.0 * top)
    ax.set_xlim(0.8 * loud[0], 1.25 * max(loud[-1], data["cutoff_hz"] or 0.0))
    ax.yaxis.set_major_formatter("{x:.0e}")
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    if data["cutoff_hz"]:
        ax.axvline(data["cutoff_hz"], linestyle="--", **style.REFERENCE, label="cutoff")
    return style.finish(ax, "frequency (Hz)", "spectral density (m²/s)")


def draw_power(data: Mapping[str, Any], ax: Axes) -> Axes:
    """Draw the starting blade's power coefficient, its peak and the range it works in."""
    look = style.line(0)
    ax.plot(data["tip_speed_ratio"], data["power_coefficient"], label="blade at the start", **look)
    ratio, power = data["best"]
    ax.plot([ratio], [power], color=look["color"], linestyle="none", **style.marker(0))
    if data["working"] is not None:
        ax.axvspan(*data["working"], linewidth=2, label="met under the control law", **_BAND)
    ax.set_ylim(bottom=0.0)
    return style.finish(ax, "tip speed ratio (-)", "power coefficient (-)")


def check_figures(case: str, data: Mapping[str, Mapping[str, Any]]) -> dict[str, Figure]:
    """Return the figures of a check of a case; of several scenarios, one of each flow."""
    figures = {}
    for name, part in data.items():
        title = f"{case}: {name.replace('_', ' ')}"
        width, height, share = 5.6, 2.25, None
        if name == "blade":
            plots = [partial(draw_blade, part, column) for column in _BLADE]
        elif name == "polar":
            columns = ["lift", "drag", "ratio"]
            columns += ["suction"] * any(np.any(x["suction"] > 0.0) for x in part["curves"])
            plots, width = [partial(draw_polar, part, column) for column in columns], 6.4
        elif name == "coefficients":
            plots, height = [partial(draw_power, part)], 3.0
        else:
            draws = [draw_inflow, draw_spectrum] if "spectrum" in part else [draw_inflow]
            plots = [partial(draw, part) for draw in draws]
            width, height, share = 6.8, 2.6, 0
        height = style.BESIDES + height * len(plots)
        figures[name] = style.figure_of(width, height, plots, share, title)
    return figures
