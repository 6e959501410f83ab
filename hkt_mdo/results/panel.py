"""The panels of a chart as plain data, which `style.draw` and `hkt_mdo.pages.panels` draw.

The panels of a chart stand one below the other over one horizontal axis. One without curves has no
data, and is left out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

COLORS = ("#0b3c6f", "#c4501b", "#4fb286", "#8a4fa3", "#b8860b", "#4a4a4a")
GREY = COLORS[5]
"""Colour of what is compared with: the blade at the start, limits, steady operation."""
QUANTITY_COLORS = {
    "inflow_speed": GREY,
    **dict.fromkeys(("rotor_speed", "tip_speed_ratio", "tip_speed"), COLORS[0]),
    **dict.fromkeys(("power", "generator_power", "electrical_power"), COLORS[1]),
    **dict.fromkeys(("thrust", "root_moment"), COLORS[2]),
    **dict.fromkeys(("control_torque", "hydrodynamic_torque", "torque_rate"), COLORS[3]),
    "stress": COLORS[4],
    "cavitation": "#2b9fd1",
}
"""Colour of a quantity, and of its limit, in every chart of one result."""


@dataclass
class Curve:
    """A curve, points, a band or bars.

    `kind` is one of line, marked (a line with markers), points, runs (points of which each is
    drawn), band (from `low` to `y`) and bar.
    `index` is the place of the result among several, which gives line style and marker; None: a
    reference, which is dotted. A curve without a `name` is not in the legend.
    """

    x: np.ndarray
    y: np.ndarray
    name: str
    color: str
    index: int | None = 0
    kind: str = "line"
    low: np.ndarray | None = None
    shade: np.ndarray | None = None
    """Values whose colours the points have in place of `color`."""
    links: Sequence[str] = ()
    """Pages that the points of a report lead to."""


class Span(NamedTuple):
    """A range of the horizontal axis: of one result shaded, of several (`index`) a bar below."""

    low: float
    high: float
    name: str
    color: str
    index: int | None = None


@dataclass
class Panel:
    """Axes with curves; `levels` and `marks` are horizontal and vertical lines with their names."""

    title: str
    across: str
    curves: list[Curve] = field(default_factory=list)
    levels: dict[str, float] = field(default_factory=dict)
    marks: dict[str, float] = field(default_factory=dict)
    spans: list[Span] = field(default_factory=list)
    notes: list[tuple[float, float, str]] = field(default_factory=list)
    """Texts above points x, y."""
    shades: str = ""
    """What the shades of curves are."""
    ticks: Sequence[str] = ()
    """Texts at 0, 1, ... of a horizontal axis that has no numbers."""
    from_zero: bool = False
    """Whether the vertical axis begins at zero, if no value is below."""
    across_from_zero: bool = False
    log: bool = False
    log_across: bool = False
    in_scale: bool = False

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of a linear vertical axis, with room for curves and the names of levels.

        At least 1 % of the value apart, so that a constant is a straight line.
        """
        arrays = [x for curve in self.curves for x in (curve.y, curve.low) if x is not None]
        values = np.concatenate([*arrays, [*self.levels.values()], [0.0] * self.from_zero])
        values = values[np.isfinite(values)]
        low, high = (np.min(values), np.max(values)) if values.size else (0.0, 1.0)
        middle, half = 0.5 * (low + high), max(0.54 * (high - low), 0.005 * abs(high), 1e-9)
        begin = 0.0 if self.from_zero and low > -0.01 * high else middle - half
        return float(begin), float(middle + half * (1.28 if self.levels else 1.0))

    @property
    def placed_levels(self) -> Iterator[tuple[str, float, bool]]:
        """Name and value of each level, and whether its name stands on the left.

        The first one does on an axis from zero, on whose left curves are low.
        """
        for number, (name, level) in enumerate(self.levels.items()):
            yield name, level, (number + self.across_from_zero) % 2 == 1
