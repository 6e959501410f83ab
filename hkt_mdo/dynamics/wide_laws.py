"""Laws for the whole range of the flow: static, of several gains (docs/controllers.md)."""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.sections import Flaws, Quantity

REACH = 1.05  # range of a curve's knots over that of the speeds that it is fitted to
LEAST_RANGE = 0.1  # and least half of it, of the speed's logarithm
SPREAD, EVEN = 201, 0.5  # points of that range, and evenness of the knots
STEEPEST = 20.0  # exponent between neighbouring knots: a torque that doubles within 3.5 % of speed
LEAST = np.array([2.0, -1.0])  # exponents of a curve below its first and above its last knot
BEND = 0.1  # of the speed's logarithm, beyond these knots, within which it comes to them
STILL = 1e-3  # rad/s, slower than any rotor turns
_OF_EVERY_LAW = "torque_limit", "cut_out", "smoothing"


def _forward(speed):
    """Return speeds, rad/s, of at least `STILL`.

    Collocation may interpolate negative speeds, which have no real power or logarithm.
    """
    return np.maximum(speed, STILL)


def _positive(torque):
    """Return torques, N*m, of at least a thousandth of the largest."""
    return np.maximum(torque, 1e-3 * np.max(np.abs(torque)))


def _natural_slopes(position, height):
    """Return the slopes at its knots of the natural cubic spline through positions and heights.

    Both may be in a complex step; a `TorqueSpline` has fixed positions.
    """
    weight = 1.0 / np.diff(position)
    matrix = 2.0 * np.diag(np.append(weight, 0.0) + np.append(0.0, weight))
    matrix = matrix + np.diag(weight, 1) + np.diag(weight, -1)
    force = 3.0 * weight**2 * np.diff(height)
    return np.linalg.solve(matrix, np.append(force, 0.0) + np.append(0.0, force))


class _TwoGains(FeedbackLaw):
    """A law of a gain and a second parameter, which is given with it, or designed."""

    second: ClassVar[str] = ""
    """Key of the second parameter."""
    both_units: ClassVar[tuple[str | None, ...]] = ()

    follows = property(lambda self: len(self.gain_units) > 1)  # type: ignore[assignment]

    def flaws(self) -> Flaws:
        if self.gain is not None and getattr(self, self.second) is None:
            yield "gain", f"is given without control.{self.second}", "give both, or neither"

    @property
    def gain_units(self):  # type: ignore[override]
        """Units of the gain, and of the second parameter where it is designed."""
        return self.both_units[: 1 + (getattr(self, self.second) is None)]

    def second_of(self, gains):
        """Return the second parameter, given or designed."""
        fixed = getattr(self, self.second)
        return gains[1] if fixed is None else fixed

    def scaled_gains(self, gains, share):
        return np.append(share * gains[:1], gains[1:])


class PowerLawFeedback(_TwoGains):
    """A power of the speed, u = K (w / (1 rad/s))^p."""

    law: Literal["power_law"] = "power_law"
    """The control law."""
    gain: Annotated[float, Quantity("N*m", gt=0)] | None = None
    """Torque K at 1 rad/s at the start of the optimization, given with `exponent`; null: chosen by
    the search for a start."""
    exponent: Annotated[float, Quantity(ge=-5, le=20)] | None = None
    """Exponent p; null: designed."""
    second: ClassVar[str] = "exponent"
    both_units: ClassVar[tuple[str | None, ...]] = ("N*m", None)

    @property
    def simpler(self):  # type: ignore[override]
        """Of constant power, near which there is an optimum of its own under a limit of it."""
        return self.model_copy(update={"exponent": -1.0}) if self.exponent is None else None

    def contains(self, other):
        powers = {"linear": 1.0, "quadratic": 2.0, self.law: getattr(other, "exponent", None)}
        power = powers.get(other.law)
        if power is None or self.exponent not in (None, power):
            return super().contains(other)
        return all(getattr(self, name) == getattr(other, name) for name in _OF_EVERY_LAW)

    def demand(self, speed, gains):
        return gains[0] * _forward(speed) ** self.second_of(gains)

    def fit(self, speed, torque):
        logarithm, torque = np.log(speed), _positive(torque)
        exponent = 2.0 if self.exponent is None else self.exponent
        if self.exponent is None and np.ptp(logarithm) >= 1e-6:
            exponent = np.polyfit(logarithm, np.log(torque), 1)[0]
        gain = np.exp(np.mean(np.log(torque) - exponent * logarithm))
        return np.array([gain, exponent][: len(self.gain_units)])

    def sizes(self, gains):
        return np.where(np.arange(gains.size) == 0, np.abs(gains), 1.0)

    def moves(self, gains, factor):
        ends = super().moves(gains, factor**4)  # at 1 rad/s, far from where the rotor turns
        ends[:, 1:] = gains[1:] + np.array([[1.0 - factor], [factor - 1.0]])
        return ends


class RatedFeedback(_TwoGains):
    """Quadratic feedback up to a rated power, constant power by overspeed above it.

    Smoothly the smaller of K w^2 and P / w (docs/controllers.md).
    """

    law: Literal["rated"] = "rated"
    """The control law."""
    gain: Annotated[float, Quantity("N*m*s**2/rad**2", gt=0)] | None = None
    """Gain K at the start of the optimization, given with `power`; null: chosen by the search for a
    start."""
    power: Annotated[float, Quantity("W", gt=0)] | None = None
    """Rated power P of the shaft; null: designed, which needs a limit of the power in the case."""
    second: ClassVar[str] = "power"
    both_units: ClassVar[tuple[str | None, ...]] = ("N*m*s**2/rad**2", "W")

    def demand(self, speed, gains):
        power = self.second_of(gains)
        wanted = gains[0] * speed**3  # power of quadratic feedback
        root = np.sqrt((wanted - power) ** 2 + 0.25 * self.smoothing * wanted * power)
        least = (2.0 - 0.125 * self.smoothing) * power / (wanted + power + root)
        return least * gains[0] * speed**2

    def fit(self, speed, torque):
        most = np.max(torque * speed)
        power = most if self.power is None else self.power
        limit = self.torque_limit or np.inf
        below = (torque * speed < 0.98 * min(power, most)) & (torque < 0.98 * limit)
        if not below.any():
            below = np.ones(speed.size, dtype=bool)
        # the median: other limits than the power's may make some of the torques small
        gain = np.median(torque[below] / speed[below] ** 2)
        return np.array([gain, power][: len(self.gain_units)])


class CurveFeedback(FeedbackLaw):
    """A smooth curve of the torque over the speed through knots, whose torques are designed.

    The start fixes the speeds of the knots (docs/controllers.md).
    """

    law: Literal["curve"] = "curve"
    """The control law."""
    knots: Annotated[int, Field(strict=True, ge=2, le=40)] = 8
    """Number of knots."""
    farthest: ClassVar[float] = 1.2  # factor; neighbours far apart make the curve oscillate
    knot_speeds: tuple[Annotated[float, Quantity("rad/s", gt=0)], ...] | None = None
    """Rotor speeds of the knots, increasing, given with `knot_torques`; null: chosen by the search
    for a start."""
    knot_torques: tuple[Annotated[float, Quantity("N*m", gt=0)], ...] | None = None
    """Torques of the knots at the start of the optimization."""

    def flaws(self) -> Flaws:
        keys, pair = ("knot_speeds", "knot_torques"), (self.knot_speeds, self.knot_torques)
        for key, values, other in zip(keys, pair, pair[::-1], strict=True):
            if values is None and other is not None:
                yield key, "is missing", "give knot_speeds and knot_torques, or neither"
            if values is not None and len(values) != self.knots:
                problem = f"has {len(values)} numbers for {self.knots} knots"
                yield key, problem, "give one for each knot"
        if self.knot_speeds is not None and np.any(np.diff(self.knot_speeds) <= 0.0):
            yield "knot_speeds", "do not rise", "give them from the slowest to the fastest"

    @property
    def gain_units(self):  # type: ignore[override]
        """The speeds of the knots, then their torques."""
        return ("rad/s",) * self.knots + ("N*m",) * self.knots

    @property
    def simpler(self):  # type: ignore[override]
        """Of the same limit and constant of the torque: a curve can follow it closely."""
        law = RatedFeedback(**{name: getattr(self, name) for name in _OF_EVERY_LAW})
        return law.applied(self._applied)

    def starting_gains(self):
        if self.knot_speeds is None:
            return None
        return np.array((*self.knot_speeds, *self.knot_torques), dtype=float)

    def demand(self, speed, gains):
        at, (knots, height, slope) = np.log(_forward(speed)), self.curve(gains)
        first = np.clip(np.searchsorted(knots.real, at.real) - 1, 0, knots.size - 2)
        step, rise = (row[first + 1] - row[first] for row in (knots, height))
        begin, end, share = step * slope[first], step * slope[first + 1], (at - knots[first]) / step
        cubic, square = begin + end - 2.0 * rise, 3.0 * rise - 2.0 * begin - end
        return np.exp(height[first] + share * (begin + share * (square + share * cubic)))

    def curve(self, gains):
        """Return the logarithms of speeds and torques, and the slopes there, of piecewise cubics.

        Beyond an end knot the exponent of the torque changes to its least one, where it is less,
        within `BEND` of the speed's logarithm, so that the torque has no kink at which an
        optimization would stop. So there are two more knots at both ends: that of a parabola, and
        one on the line that follows.
        """
        knots = np.log(gains).reshape(2, -1)
        knots = np.vstack((knots, _natural_slopes(*knots)))
        (position, height, slope), way = knots[:, [0, -1]], np.array([-1.0, 1.0])
        steep = np.where(slope.real < LEAST, LEAST, slope)
        rise = 0.5 * BEND * (slope + steep)
        bent = np.array([position + BEND * way, height + rise * way, steep])
        line = bent + way * np.array([np.ones(2), steep, np.zeros(2)])
        return np.column_stack((line[:, 0], bent[:, 0], knots, bent[:, 1], line[:, 1]))

    def fit(self, speed, torque):
        from scipy.optimize import lsq_linear  # reading a case does not need SciPy

        from hkt_mdo.rotor.torque_curve import TorqueSpline

        speed, torque = np.log(speed), np.log(_positive(torque))
        knots = self._spread(speed, torque)
        # the height of the first knot and the exponents between neighbours, which are bounded
        sums = np.tri(self.knots) * np.append(1.0, np.diff(knots))
        most = np.append(np.inf, np.full(self.knots - 1, STEEPEST))
        height = sums @ lsq_linear(TorqueSpline(knots).basis(speed) @ sums, torque, (-most, most)).x
        # knots that no speed is near have torques of the same size as the others
        height = np.clip(height, np.min(torque) - 1.0, np.max(torque) + 1.0)
        return np.exp(np.append(knots, height))

    def _spread(self, position, height):
        """Return places for the knots, close together where a curve through points bends."""
        low, high = np.min(position), np.max(position)
        middle, half = 0.5 * (low + high), max(0.5 * (high - low), LEAST_RANGE)
        fine = np.linspace(middle - REACH * half, middle + REACH * half, SPREAD)
        order = np.argsort(position)
        curve = np.interp(fine, position[order], height[order])
        window = np.hanning(2 * (SPREAD // self.knots) + 1)
        bend = np.convolve(np.abs(np.gradient(np.gradient(curve))), window, mode="same")
        density = np.sqrt(bend / max(np.max(bend), 1e-12)) + EVEN
        share = np.append(0.0, np.cumsum(0.5 * (density[1:] + density[:-1])))
        return np.interp(np.linspace(0.0, share[-1], self.knots), share, fine)

    def moves(self, gains, factor):
        speeds, torques = gains.reshape(2, -1)
        low, high = super().moves(torques, factor)
        # each of two neighbours may take half of what is left to STEEPEST
        rise, most = np.diff(np.log(torques)), STEEPEST * np.diff(np.log(speeds))
        apart, closer = (np.exp(0.5 * np.maximum(x, 0.0)) for x in (most - rise, most + rise))
        low[:-1] = np.maximum(low[:-1], torques[:-1] / apart)
        high[1:] = np.minimum(high[1:], torques[1:] * apart)
        low[1:] = np.maximum(low[1:], torques[1:] / closer)
        high[:-1] = np.minimum(high[:-1], torques[:-1] * closer)
        return np.array(((*speeds, *low), (*speeds, *high)))

    def scaled_gains(self, gains, share):
        return np.append(gains[: self.knots], share * gains[self.knots :])
