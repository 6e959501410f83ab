"""The figures of `hkt check`: blade, polars, flows and power curve, as panels."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hkt_mdo.results import style
from hkt_mdo.results.charts import polar_panels
from hkt_mdo.results.panel import COLORS, GREY, Curve, Panel, Span
from hkt_mdo.results.words import powers
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.run.check import CheckReport
from hkt_mdo.run.findings import Findings, Flow

SIZES = {"blade": (5.6, 2.25), "polar": (6.4, 2.25), "coefficients": (5.6, 3.0)}
"""Width of a figure and height of a panel (inches)."""
QUIETEST = 1e-4
"""Smallest spectral density that is drawn, over the largest."""


def save_check_figures(report: CheckReport, folder: Path) -> list[Path]:
    """Write the figures of a check as PNG into a folder, and return their paths.

    Of several scenarios there is one of each flow.
    """
    findings, figures = report.findings, {}
    charts = {"blade": _blade_panels(findings), "polar": polar_panels([*_polar_curves(findings)])}
    angles = np.rad2deg([findings.stations.met.min(), findings.stations.met.max()])
    for panel in charts["polar"]:
        panel.spans.append(Span(*angles, "met in this flow", GREY))
    for flow in findings.flows:
        name = f"inflow_{flow.name}" if len(findings.flows) > 1 else "inflow"
        charts[name] = [*_flow_panels(flow, findings.rated_speed)]
    charts["coefficients"] = [_power_panel(findings)]
    for name, panels in charts.items():
        title = f"{findings.case.name}: {name.replace('_', ' ')}"
        figures[name] = style.figure_of_panels(panels, *SIZES.get(name, (6.8, 2.6)), title)
    return style.save(figures, folder)


def _blade_panels(findings: Findings) -> list[Panel]:
    """Return the starting blade, and control points beside the file's blade where there are any."""
    shape, blade, from_file = findings.physics.shape, findings.plant.blade, findings.given
    marks = {"hub": blade.hub_radius, "tip": blade.tip_radius}
    control = shape.control(blade) if shape.designs_chord else {}
    thickness = np.broadcast_to(findings.physics.turbine.thickness, blade.r.shape)
    panels = []
    for title, name, scale, values in (
        ("chord (m)", "chord", 1.0, blade.chord),
        ("twist (deg)", "twist", 180.0 / np.pi, blade.twist),
        ("thickness (% of the chord)", "", 100.0, thickness),
    ):
        panel = Panel(title, "radius (m), from hub to tip", from_zero=True, marks=marks)
        words = "blade at the start, its stations"
        panel.curves.append(Curve(blade.r, scale * values, words, COLORS[0], 0, "marked"))
        if name in control and control[name].size < blade.r.size:
            # they stand where their own spline is the radius itself
            places = np.linalg.lstsq(shape.bases[name], blade.r, rcond=None)[0]
            file = Curve(blade.r, scale * getattr(from_file, name), "blade of the file", GREY, None)
            points = Curve(places, scale * control[name], "control points", COLORS[1], 1, "marked")
            panel.curves = [file, *panel.curves, points]
        panels.append(panel)
    return panels


def _polar_curves(findings: Findings) -> Iterator[tuple[str, Polar, np.ndarray, np.ndarray]]:
    """Yield the different polars, root to tip, as `polar_panels` takes them."""
    groups: dict[tuple[Polar, ...], list[int]] = {}
    for station, polars in enumerate(findings.stations.polars):
        groups.setdefault(polars, []).append(station)
    angle = np.deg2rad(np.linspace(-40.0, 50.0, 361))
    for tables, where in groups.items():
        label = "all stations" if len(groups) == 1 else findings.stations.places(where)
        labels = [label]
        if (polar := findings.plant.polar).follows_reynolds:
            labels = [f"{label}, Re {powers(np.exp(log))}" for log in polar.log_reynolds]
        for table, label in zip(tables, labels, strict=True):
            yield label, table, angle, (angle >= table.alpha_min) & (angle <= table.alpha_max)


def _flow_panels(flow: Flow, rated_speed: float) -> Iterator[Panel]:
    """Yield the flow speed over time, and the spectrum of one that changes over time."""
    panel = Panel("inflow speed (m/s)", "time (s)", levels={"mean": flow.mean})
    panel.curves.append(Curve(flow.time, flow.speed, "", COLORS[0]))
    low, high = np.min(flow.speed), np.max(flow.speed)
    if low - (high - low) < rated_speed < high + (high - low):
        panel.levels["torque limit is met"] = rated_speed
    yield panel
    if flow.deviation > 1e-9 * flow.mean and not flow.steady:
        frequency, density = power_spectrum(flow.speed, float(flow.time[1]))
        loud = density > QUIETEST * np.max(density)
        shown = frequency <= max(frequency[loud][-1], flow.cutoff)
        values = np.where(loud, density, np.nan)[shown]
        panel = Panel("spectral density (m²/s)", "frequency (Hz)", log=True, log_across=True)
        panel.curves.append(Curve(frequency[shown], values, "", COLORS[0]))
        panel.marks = {"cutoff": flow.cutoff} if flow.cutoff else {}
        yield panel


def power_spectrum(speed: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (Hz) and the one-sided power spectral density (m²/s² per Hz) of a flow.

    A periodogram of even samples (m/s), `step` (s) apart, under Hann's window after the mean is
    taken out, averaged over twelfths of an octave.
    """
    from scipy.signal import periodogram  # takes a third of the time that this package takes

    frequency, density = periodogram(speed, 1.0 / step, "hann")
    band = np.floor(12.0 * np.log2(frequency[1:] / frequency[1]) + 1e-9).astype(int)
    _, band, count = np.unique(band, return_inverse=True, return_counts=True)
    return tuple(np.bincount(band, each[1:]) / count for each in (frequency, density))


def _power_panel(findings: Findings) -> Panel:
    """Return the starting blade's power coefficient, its peak and the range it works in."""
    best = findings.best
    ratios = np.linspace(0.2, 1.9, 171) * best.tip_speed_ratio
    power = bem.rotor_coefficients(findings.plant.blade, findings.plant.polar, ratios).power
    panel = Panel("power coefficient (-)", "tip speed ratio (-)", from_zero=True)
    peak = np.array([best.tip_speed_ratio]), np.array([best.power_coefficient])
    panel.curves = [
        Curve(ratios, np.where(power >= 0.0, power, np.nan), "blade at the start", COLORS[0]),
        Curve(*peak, "largest value", COLORS[0], 0, "points"),
    ]
    if findings.running:
        panel.spans.append(Span(*findings.working, "met under the control law", GREY))
    return panel
