"""The figures of results: which plots stand one below the other, and their files.

A figure has the plots for which a result has data (`hkt_mdo.results.plots`).
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.results import plots, style
from hkt_mdo.results.shown import Solutions, known_sections, named, named_scenarios, of_scenario
from hkt_mdo.results.solution import Solution


class Panel(NamedTuple):
    """A plot, and what tells of a solution whether it has data for it."""

    plot: Callable[..., Axes]
    known: Callable[[Solution], Any]


def _panels(
    tables: Sequence[str],
    *plotted: Callable[..., Axes],
    steady: bool = True,
    **of_column: Callable[..., Axes],
) -> list[Panel]:
    """Return panels that are drawn of one of some tables, and last those of a column of it.

    Without `steady`, they need a scenario with a time.
    """

    def known(column: str, solution: Solution) -> bool:
        shown = (one for one in solution.by_scenario if steady or not one.steady)
        found = (getattr(one, name) for one in shown for name in tables)
        return any(column in table if column else table for table in found)

    needed = [("", plot) for plot in plotted] + [*of_column.items()]
    return [Panel(plot, partial(known, column)) for column, plot in needed]


def _limited(solution: Solution) -> bool:
    return any(one.limit_shares(table) for one in solution.by_scenario for table in _TIMES)


_TIMES = "simulation", "trajectory"
_OVER_TIME = "operation", "limits", "year"
"""Figures of one scenario each."""
_OPERATION = (
    *(plots.plot_inflow_speed, plots.plot_power, plots.plot_rotor_speed),
    *(plots.plot_tip_speed_ratio, plots.plot_control_torque),
)
_SCHEDULE = plots.plot_power_schedule, plots.plot_speed_schedule, plots.plot_torque_schedule
FIGURES: dict[str, tuple[list[Panel], float, float]] = {
    "blade": (
        [
            *_panels(["blade"], plots.plot_planform, plots.plot_chord, plots.plot_twist),
            *_panels(["blade"], thickness_over_chord=plots.plot_thickness),
            Panel(plots.plot_sections, lambda solution: known_sections(solution).size),
        ],
        *(6.6, 10.2),
    ),
    "power_curve": (
        _panels(
            ["power_curve"], plots.plot_power_curve, thrust_coefficient=plots.plot_thrust_curve
        ),
        *(5.6, 5.6),
    ),
    "operation": (
        _panels(_TIMES, *_OPERATION, steady=False, thrust_N=plots.plot_thrust),
        7.4,
        10.4,
    ),
    "schedule": (_panels(_TIMES, *_SCHEDULE, thrust_N=plots.plot_thrust_schedule), 7.0, 9.4),
    "year": (
        _panels(["year"], plots.plot_year_power, plots.plot_year_hours, plots.plot_year_energy),
        6.4,
        7.4,
    ),
    "limits": ([Panel(plots.plot_limits, _limited)], 7.0, 4.2),
    "loads": (
        _panels(
            ["loads"], stress_Pa=plots.plot_stress, flapwise_moment_Nm=plots.plot_flapwise_moment
        )
        + _panels(["loads"], cavitation=plots.plot_suction),
        *(5.6, 7.2),
    ),
    "convergence": (_panels(["convergence"], plots.plot_convergence), 6.2, 3.9),
}
"""Panels from the top, width and, with all panels, height (inches)."""
_BESIDES = 1.2  # inches of a figure's height that its panels do not share


def figure_of(solutions: Solutions, name: str) -> Figure | None:
    """Return one of the `FIGURES`, with the panels that a solution has data for; None if none."""
    panels, width, height = FIGURES[name]
    shown = [each for each in panels if any(each.known(one) for one, _ in named(solutions))]
    if not shown:
        return None
    height = _BESIDES + (height - _BESIDES) * len(shown) / len(panels)
    if name == "limits":  # each bar has room for its number
        bars = [len(one.limit_shares("trajectory")) for one, _ in named_scenarios(solutions)]
        height = max(height, 1.5 + 0.16 * max(bars) * len(bars))
    share = sum(each.plot is not plots.plot_sections for each in shown)  # which have no radius
    drawn = [partial(each.plot, solutions) for each in shown]
    heights = [1.0] * len(shown)
    if name == "blade" and shown[0].plot is plots.plot_planform:
        blades = [each.blade for each, _ in named(solutions) if each.blade]
        most = (max(np.max(each[x]) for each in blades) for x in ("chord_m", "r_m"))
        wide = (width - 1.2) * np.divide(*most) / 1.6  # over the height of the other panels
        heights[0] = max(1.0, 1.2 * float(wide))
        height *= (len(heights) - 1.0 + heights[0]) / len(heights)
    return style.figure_of(width, height, drawn, share, heights)


class Figures(dict[str, Figure]):
    """Figures by their names, which a notebook shows one below the other."""

    def _repr_html_(self) -> str:
        pictures = (base64.b64encode(style.png(figure)).decode() for figure in self.values())
        return "".join(f'<img src="data:image/png;base64,{each}">' for each in pictures)


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
    drawn: dict[str, Figure | None] = {}
    chosen = [solution for solution, _ in named(solutions)]
    scenarios = dict.fromkeys(name for each in chosen for name in each.scenarios)
    for name in names or FIGURES:
        if name not in FIGURES:
            raise InputError("unknown figure", f"known: {', '.join(FIGURES)}", value=name)
        if name in _OVER_TIME and any(len(each.scenarios) > 1 for each in chosen):
            for one in scenarios:
                alone = [of_scenario(each, one) for each in chosen]
                drawn[f"{name}_{one}"] = figure_of(alone, name)
        else:
            drawn[name] = figure_of(solutions, name)
    return Figures({name: each for name, each in drawn.items() if each})


def save_figures(
    solutions: Solutions, folder: str | Path, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write the figures of results, as `figures` draws them.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
        Results, which are drawn together.
    folder : str or Path
        Where to, made if need be.
    formats : sequence of str
        Endings of the files that Matplotlib knows.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If a format is not known, when nothing has been written, or a file cannot be written.
    """
    return style.save(figures(solutions), folder, formats)
