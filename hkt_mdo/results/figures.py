"""The figures of results, and their files.

A figure has the panels of a chart (`hkt_mdo.results.charts`) for which a result has data.
"""

import base64
from collections.abc import Callable, Sequence
from functools import partial

from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.results import charts, style
from hkt_mdo.results.charts import Results, Solutions
from hkt_mdo.results.panel import Panel
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import joined, printable

_OF_ONE = "operation", "limits", "year"
"""Figures of one scenario each."""
_OF_DESIGN = "blade", "coefficients", "convergence"
"""Figures of a result as a whole."""
FIGURES: dict[str, tuple[Callable[[Results], list[Panel]], float, float]] = {
    "blade": (charts.blade, 6.6, 1.8),
    "coefficients": (charts.coefficients, 5.6, 2.2),
    "operation": (partial(charts.operation, nodes=True), 7.4, 1.55),
    "power_curve": (charts.power_curve, 7.0, 2.05),
    "year": (charts.year, 6.4, 2.05),
    "limits": (charts.limits, 7.0, 2.2),
    "loads": (charts.loads, 5.6, 2.0),
    "convergence": (charts.convergence, 6.2, 2.7),
}
"""By the name of a figure: its panels, its width and a panel's height (inches)."""


def figure_of(solutions: Solutions, name: str, scenario: str = "") -> Figure | None:
    """Return one of the `FIGURES`, with the panels that results have data for; None if none.

    Of several scenarios it shows the `scenario`, else all. The title of a single result has the
    name of its case and the scenario.
    """
    results, (make, width, height) = charts.labelled(solutions), FIGURES[name]
    first = printable(results[0].solution.name) if len(results) == 1 else ""
    title = ": ".join(filter(None, (joined(first, scenario), name.replace("_", " "))))
    if scenario:
        results = charts.of_scenario(results, scenario)
    elif name not in _OF_DESIGN:
        results = charts.by_scenario(results)
    panels = make(results)
    known = any(panel.curves for panel in panels)
    return style.figure_of_panels(panels, width, height, title) if known else None


class Figures(dict[str, Figure]):
    """Figures by their names, which a notebook shows one below the other."""

    def _repr_html_(self) -> str:
        pictures = (base64.b64encode(style.picture(figure)).decode() for figure in self.values())
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
    several = [solutions] if isinstance(solutions, Solution) else solutions
    for name in names or FIGURES:
        if name not in FIGURES:
            raise InputError("unknown figure", f"known: {', '.join(FIGURES)}", value=name)
        if name in _OF_ONE and any(len(each.scenarios) > 1 for each in several):
            for one in dict.fromkeys(name for each in several for name in each.scenarios):
                drawn[f"{name}_{one}"] = figure_of(several, name, one)
        else:
            drawn[name] = figure_of(several, name)
    return Figures({name: each for name, each in drawn.items() if each})
