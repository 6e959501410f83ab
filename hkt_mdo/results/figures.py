"""The figures of results, and their files.

A figure has the panels of a chart (`hkt_mdo.results.charts`) for which a result has data.
"""

import base64
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.results import charts, style
from hkt_mdo.results.charts import Results, Solutions
from hkt_mdo.results.panel import Panel
from hkt_mdo.results.plots import plot_limits
from hkt_mdo.results.words import joined, printable

_OF_ONE = "operation", "limits", "year"
"""Figures of one scenario each."""
_OF_DESIGN = "blade", "coefficients", "convergence"
"""Figures of a result as a whole."""
FIGURES: dict[str, tuple[Callable[[Results], list[Panel]] | None, float, float]] = {
    "blade": (charts.blade, 6.6, 1.8),
    "coefficients": (charts.coefficients, 5.6, 2.2),
    "operation": (charts.operation, 7.4, 1.55),
    "power_curve": (charts.power_curve, 7.0, 2.05),
    "year": (charts.year, 6.4, 2.05),
    "limits": (None, 7.0, 1.0),
    "loads": (charts.loads, 5.6, 2.0),
    "convergence": (charts.convergence, 6.2, 2.7),
}
"""By the name of a figure: its panels, None for bars, its width and a panel's height (inches)."""


def figure_of(solutions: Solutions, name: str, scenario: str = "") -> Figure | None:
    """Return one of the `FIGURES`, with the panels that results have data for; None if none.

    The title of a single result has the name of its case and the `scenario`.
    """
    return _figure(charts.labelled(solutions), name, scenario)


def _figure(results: Results, name: str, scenario: str = "") -> Figure | None:
    make, width, height = FIGURES[name]
    first = printable(results[0].solution.name) if len(results) == 1 else ""
    title = ": ".join(filter(None, (joined(first, scenario), name.replace("_", " "))))
    alone = results if name in _OF_DESIGN else charts.by_scenario(results)
    if make is not None:
        panels = make(alone)
        known = any(panel.curves for panel in panels)
        return style.figure_of_panels(panels, width, height, title) if known else None
    bars = [len(each.limit_shares()) for each, _ in alone]
    if not any(bars):
        return None
    height += style.BESIDES + 0.2 * max(bars) * len(bars)  # each bar has room for its number
    plot = partial(plot_limits, [each for each, _ in results])
    return style.figure_of(width, height, [plot], title=title)


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
    results = charts.labelled(solutions)
    several = any(len(each.scenarios) > 1 for each, _ in results)
    for name in names or FIGURES:
        if name not in FIGURES:
            raise InputError("unknown figure", f"known: {', '.join(FIGURES)}", value=name)
        if name in _OF_ONE and several:
            for one in dict.fromkeys(name for each, _ in results for name in each.scenarios):
                alone = charts.of_scenario(results, one)
                drawn[f"{name}_{one}"] = _figure(alone, name, one)
        else:
            drawn[name] = _figure(results, name)
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
