"""The generator: electrical power from torque and speed, and its keys in a case.

Speeds are those of the rotor's shaft: a gearbox is part of the generator.
"""

from functools import cached_property
from typing import Annotated

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.efficiency import read_efficiency
from hkt_mdo.sections import ExistingFile, Flaws, Quantity, Section

_LOSSES = {
    "copper_loss": ("rated_torque", 2),
    "friction_loss": ("rated_speed", 1),
    "iron_loss": ("rated_speed", 2),
}
"""By the key of a loss: the key of the torque or speed at which it is given, and its exponent."""

BEYOND = 0.05  # share of a table's range by which it is continued at its ends
RATIOS = 0.5, 15.0  # tip speed ratios between which rotors work
_Loss = Annotated[float, Quantity("W", ge=0)]
_WAYS = "give efficiency, losses at rated torque and speed, or table: one of the three"


class Generator(Section):
    """What the generator delivers: a constant efficiency, losses, or a table.

    Without keys there are no losses. Only shaft_friction brakes the rotor; the other keys reduce
    the electrical power (docs/theory.md).
    """

    efficiency: Annotated[float, Quantity(gt=0, le=1)] | None = None
    """Electrical power over shaft power, constant."""
    rated_torque: Annotated[float, Quantity("N*m", gt=0)] | None = None
    """Torque at which `copper_loss` is given."""
    rated_speed: Annotated[float, Quantity("rad/s", gt=0)] | None = None
    """Speed of the rotor at which `friction_loss` and `iron_loss` are given."""
    copper_loss: _Loss | None = None
    """Loss in the windings at `rated_torque`; it grows with the torque squared."""
    friction_loss: _Loss | None = None
    """Loss by friction at `rated_speed`; it grows with the speed."""
    iron_loss: _Loss | None = None
    """Loss in the iron at `rated_speed`; it grows with the speed squared."""
    shaft_friction: Annotated[float, Quantity("N*m", ge=0)] = 0.0
    """Torque of shaft, bearings and seals that brakes the rotor at any speed (Coulomb friction)."""
    shaft_friction_slope: Annotated[float, Quantity("N*m*s/rad", ge=0)] = 0.0
    """Friction torque proportional to the rotor's speed, over the speed."""
    table: ExistingFile | None = None
    """CSV file with the columns `torque_Nm` or `torque_kNm`, `speed_rpm` or `speed_rad_s`, and
    `efficiency` or `efficiency_percent`: every torque at every speed."""

    def flaws(self) -> Flaws:
        """Refuse two descriptions at once, and losses without their rated torque or speed."""
        losses = [name for name in _LOSSES if getattr(self, name) is not None]
        rated = [n for n in ("rated_torque", "rated_speed") if getattr(self, n) is not None]
        ways = [name for name in ("efficiency", "table") if getattr(self, name) is not None]
        ways += (losses or rated)[:1]
        if len(ways) > 1:
            yield ways[1], f"is given together with {ways[0]}", _WAYS
        for name in losses:
            if (at := _LOSSES[name][0]) not in rated:
                yield name, f"needs {at}", f"give generator.{at}, at which this loss is given"
        for name in rated:
            if name not in [_LOSSES[loss][0] for loss in losses]:
                needs = " or ".join(loss for loss, (at, _) in _LOSSES.items() if at == name)
                yield name, "has no effect", f"give generator.{needs}, or leave it out"

    def friction(self, speed):
        """Return the torque that brakes the shaft, N*m; speed (rad/s) may be complex."""
        return self.shaft_friction + self.shaft_friction_slope * speed

    @property
    def rubs(self) -> bool:
        """Whether the shaft has friction."""
        return bool(self.shaft_friction or self.shaft_friction_slope)

    def electrical_power(self, torque, speed):
        """Return the electrical power, W; torque (N*m) and speed (rad/s) may be complex."""
        shaft = torque * speed
        if self.table is not None:
            share = self._surface.efficiency(torque, speed)  # a generator that drives draws power
            return shaft * np.where(np.real(shaft) < 0.0, 1.0, share)
        if self.efficiency is not None:
            return self.efficiency * shaft
        actual = {"rated_torque": torque, "rated_speed": speed}
        for name, (at, exponent) in _LOSSES.items():
            if (loss := getattr(self, name)) is not None:
                shaft = shaft - loss * (actual[at] / getattr(self, at)) ** exponent
        return shaft

    def check(self, radius: float, slowest: float, fastest: float) -> None:
        """Read the table, if there is one; InputError if it is broken or of another shaft.

        The rotor's tip radius is in m, the smallest and largest speed of the flow in m/s.
        """
        if self.table is None:
            return
        low, high = RATIOS[0] * slowest / radius, RATIOS[1] * fastest / radius
        first, last = self._surface.speeds
        if first > high or last < low:
            problem = f"has speeds from {first:.4g} to {last:.4g} rad/s, and this rotor turns at "
            problem += f"{low:.3g} to {high:.3g}, in flows of {slowest:.3g} to {fastest:.3g} m/s"
            remedy = "give torque and speed of the rotor's shaft, not of the shaft behind a gearbox"
            raise InputError(problem, remedy, file=self.table)

    @property
    def proportional(self) -> bool:
        """Whether electrical power is a constant share of shaft power."""
        return self.table is None and not any(getattr(self, name) for name in _LOSSES)

    @property
    def lossless(self) -> bool:
        """Whether electrical power is shaft power."""
        return self.proportional and self.largest_efficiency == 1.0

    @property
    def largest_efficiency(self) -> float:
        """An upper bound on electrical over shaft power, at most 1."""
        if self.table is not None:
            return min(self._surface.largest, 1.0)
        return 1.0 if self.efficiency is None else self.efficiency

    @property
    def fastest(self) -> float:
        """Speed at which the table ends, rad/s; inf without a table."""
        return np.inf if self.table is None else float(self._surface.speeds[1])

    def beyond_table(self, torque, speed) -> float:
        """Return by how much of its range a table is left by torques and speeds; 0: it is not."""
        return 0.0 if self.table is None else self._surface.beyond(torque, speed)

    @cached_property
    def _surface(self) -> "_Surface":
        """The contents of the table's file, read once."""
        return _Surface(str(self.table))


LOSSLESS = Generator()


class _Surface:
    """Efficiency over torque (N*m) and speed (rad/s): cubics in each cell of a table.

    Along its rows and columns they stay within their neighbours, inside a cell within some
    thousandths of its corners. Beyond the table they go on along their slopes, by at most `BEYOND`
    of its range.
    """

    def __init__(self, path: str):
        from hkt_mdo.rotor.torque_curve import HermiteSpline  # a case is read without SciPy

        torque, speed, table = read_efficiency(path)
        self.speeds = speed[0], speed[-1]
        self._splines = along, across = HermiteSpline(torque), HermiteSpline(speed)
        slopes = along.slopes(table), across.slopes(table.T).T
        self._table = np.block([[table, slopes[1]], [slopes[0], np.zeros(table.shape)]])
        wide = (np.linspace(2.0 * x[0] - x[-1], 2.0 * x[-1] - x[0], 901) for x in (torque, speed))
        rows, columns = self._bases(*wide)
        self.largest = float(np.max(rows @ self._table @ columns.T))

    def _bases(self, *points):
        """Return the matrices from the table to torques and to speeds, which may be complex."""
        for spline, at in zip(self._splines, points, strict=True):
            low, high = spline.nodes[0], spline.nodes[-1]
            inside, length = np.clip(at.real, low, high), BEYOND * (high - low)
            yield spline.basis(inside + length * np.tanh((at - inside) / length))

    def efficiency(self, torque, speed):
        """Return the efficiency, of a complex step too."""
        torque, speed = np.broadcast_arrays(torque, speed)
        rows, columns = self._bases(torque.ravel(), speed.ravel())
        return np.sum(rows * (columns @ self._table.T), axis=1).reshape(torque.shape)

    def beyond(self, torque, speed) -> float:
        """Return by how much of its range the table is left, along the worse of its axes."""
        return max(
            float(np.max(np.maximum(nodes[0] - x, x - nodes[-1]))) / (nodes[-1] - nodes[0])
            for nodes, x in zip((s.nodes for s in self._splines), (torque, speed), strict=True)
        )
