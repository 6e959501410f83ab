"""Plots of results on axes, for the figures of the studies.

Each `plot_...` takes one solution or several and the axes to draw on, and returns these.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from matplotlib.axes import Axes

from hkt_mdo.results import charts, style
from hkt_mdo.results.charts import Solutions
from hkt_mdo.results.panel import COLORS, Panel


def line(index: int) -> dict[str, Any]:
    """Return colour and line style of a solution: they differ in grey, too."""
    look = {"color": COLORS[index % len(COLORS)], "linewidth": 1.5}
    return look | {"linestyle": style.LINES[index % len(style.LINES)]}


def _of_design(make: Callable[..., Panel], what: str, solutions: Solutions, ax: Axes) -> Axes:
    """Draw a panel of results as a whole."""
    return style.draw(make(charts.labelled(solutions), what), ax)


def _of_scenarios(make: Callable[..., Panel], what: str, solutions: Solutions, ax: Axes) -> Axes:
    """Draw a panel of the scenarios of results."""
    return style.draw(make(charts.by_scenario(charts.labelled(solutions)), what), ax)


plot_chord = partial(_of_design, charts.over_radius, "chord_m")
plot_twist = partial(_of_design, charts.over_radius, "twist_deg")
plot_power_coefficient = partial(_of_design, charts.coefficient, "power")
_at_nodes = partial(charts.over_time, nodes=True)
plot_inflow_speed = partial(_of_scenarios, _at_nodes, "inflow_speed")
plot_rotor_speed = partial(_of_scenarios, _at_nodes, "rotor_speed")
plot_control_torque = partial(_of_scenarios, _at_nodes, "control_torque")
plot_power = partial(_of_scenarios, _at_nodes, "generator_power")
