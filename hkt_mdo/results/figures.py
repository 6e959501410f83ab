"""The figures of results: which plots stand one below the other, and their files.

A figure has the plots for which a result has data (`hkt_mdo.results.plots`).
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.quantities import QUANTITIES
from hkt_mdo.results import plots, style
from hkt_mdo.results.shown import Solutions, known_sections, named, named_scenarios, of_scenario
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import joined, printable


class Panel(NamedTuple):
    """A plot, and what tells of a solution whether it has data for it."""

    plot: Callable[..., Axes]
    known: Callable[[Solution], Any]


def _panels(
    tables: Sequence[str],
    *plotted: Callable[..., Axes],
    steady: bool = True,
    limited: bool = False,
    **of_column: Callable[..., Axes],
) -> list[Panel]:
    """Return panels that are drawn of one of some tables, and last those of a column of it.

    Without `steady`, they need a scenario with a time; `limited`: and a limit of the column.
    """

    def known(column: str, solution: Solution) -> bool:
        shown = [one for one in solution.by_scenario if steady or not one.steady]
        if limited:
            names = {QUANTITIES[x.name].column for x in solution.limits if x.name in QUANTITIES}
            shown = shown if column in names else []
        found = (getattr(one, name) for one in shown for name in tables)
        return any(column in table if column else table for table in found)

    needed = [("", plot) for plot in plotted] + [*of_column.items()]
    return [Panel(plot, partial(known, column)) for column, plot in needed]


_TIMES = "simulation", "trajectory"
_OF_ONE = "operation", "limits", "year"
"""Figures of one scenario each."""
_OPERATION = (
    *(plots.plot_inflow_speed, plots.plot_power, plots.plot_rotor_speed),
    *(plots.plot_tip_speed_ratio, plots.plot_control_torque),
)
_LOADS = {
    "root_moment_Nm": plots.plot_root_moment,
    "stress_Pa": plots.plot_stress_over_time,
    "cavitation": plots.plot_suction_over_time,
}
_OVER_FLOW = plots.plot_power_curve, plots.plot_speed_curve, plots.plot_torque_curve
_YEAR = plots.plot_year_power, plots.plot_year_hours, plots.plot_year_energy
FIGURES: dict[str, tuple[list[Panel], float, float]] = {
    "blade": (
        [
            Panel(plots.plot_sections, lambda solution: known_sections(solution).size),
            *_panels(["blade"], plots.plot_planform, plots.plot_chord, plots.plot_twist),
            *_panels(["blade"], thickness_over_chord=plots.plot_thickness),
        ],
        *(6.6, 1.8),
    ),
    "coefficients": (
        _panels(
            ["coefficients"],
            power_coefficient=plots.plot_power_coefficient,
            thrust_coefficient=plots.plot_thrust_coefficient,
        ),
        *(5.6, 2.2),
    ),
    "operation": (
        [
            *_panels(_TIMES, *_OPERATION, steady=False, thrust_N=plots.plot_thrust),
            *_panels(_TIMES, steady=False, limited=True, **_LOADS),
        ],
        *(7.4, 1.55),
    ),
    "power_curve": (_panels(_TIMES, *_OVER_FLOW, thrust_N=plots.plot_thrust_curve), 7.0, 2.05),
    "year": (_panels(["year"], *_YEAR), 6.4, 2.05),
    "limits": (
        [Panel(plots.plot_limits, lambda x: any(one.limit_shares() for one in x.by_scenario))],
        *(7.0, 1.0),
    ),
    "loads": (
        _panels(
            ["loads"],
            stress_Pa=plots.plot_stress,
            flapwise_moment_Nm=plots.plot_flapwise_moment,
            cavitation=plots.plot_suction,
        ),
        *(5.6, 2.0),
    ),
    "convergence": (_panels(["convergence"], plots.plot_convergence), 6.2, 2.7),
}
"""Panels from the top, width, and height of a panel (inches)."""


def figure_of(solutions: Solutions, name: str, scenario: str = "") -> Figure | None:
    """Return one of the `FIGURES`, with the panels that a solution has data for; None if none.

    The title of a single solution has the name of its case and the `scenario`.
    """
    panels, width, height = FIGURES[name]
    chosen = [one for one, _ in named(solutions)]
    shown = [each.plot for each in panels if any(map(each.known, chosen))]
    if not shown:
        return None
    if name == "limits":  # each bar has room for its number
        bars = [len(one.limit_shares()) for one, _ in named_scenarios(solutions)]
        height += 0.2 * max(bars) * len(bars)
    names = joined(printable(chosen[0].name) if len(chosen) == 1 else "", scenario)
    title = ": ".join(filter(None, (names, name.replace("_", " "))))
    share = sum(plot is not plots.plot_sections for plot in shown)  # which have no radius
    drawn = [partial(plot, solutions) for plot in shown]
    return style.figure_of(width, style.BESIDES + height * len(shown), drawn, share, title)


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
        if name in _OF_ONE and any(len(each.scenarios) > 1 for each in chosen):
            for one in scenarios:
                alone = [of_scenario(each, one) for each in chosen]
                drawn[f"{name}_{one}"] = figure_of(alone, name, one)
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
