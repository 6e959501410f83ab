"""The limits of results as bars on axes; other panels are drawn by `style.draw`."""

from typing import Any

from matplotlib.axes import Axes

from hkt_mdo.results import charts, style
from hkt_mdo.results.charts import Solutions
from hkt_mdo.results.panel import QUANTITY_COLORS
from hkt_mdo.results.words import limit_words


def plot_limits(solutions: Solutions, ax: Axes | None = None) -> Axes:
    """Plot a bar for each limit: the largest value over the limit, which is 1; of each solution."""
    ax, results = ax or style.new_axes(), charts.by_scenario(charts.labelled(solutions))
    shares = [charts.largest_shares(solution) for solution, _ in results]
    rows = list(dict.fromkeys(limit for each in shares for limit in each))[::-1]
    height = 0.8 / len(results)
    for index, ((_, label), most) in enumerate(zip(results, shares, strict=True)):
        shift = (0.5 * len(results) - index - 0.5) * height
        places, look = [rows.index(limit) + shift for limit in most], style.bar(index)
        if not label:
            look["color"] = [QUANTITY_COLORS.get(limit, look["color"]) for limit in most]
        label, look["height"], look["alpha"] = label or "largest value", 0.9 * height, 0.85
        if most:
            ax.barh(places, [*most.values()], label=style.legend_name(label), **look)
        for place, value in zip(places, most.values(), strict=True):
            words: dict[str, Any] = {"va": "center", "fontsize": style.FONT_SIZE - 1.5}
            ax.text(max(value, 1.0), place, f" {value:.3f}", **words)  # beyond the limit's line
    ax.axvline(1.0, label="limit", **style.REFERENCE | {"linewidth": 1.6})
    ax.set_xlim(0.0, 1.12 * max(1.0, ax.get_xlim()[1] / 1.05))
    room = max(0.6, 0.5 * (4 - len(rows)))  # a single bar does not fill the axes
    ax.set_ylim(-room, len(rows) - 1 + room)
    style.finish(ax, "largest value over its limit (-)", "")
    ax.set_yticks(range(len(rows)), [limit_words(limit) for limit in rows])
    return ax
