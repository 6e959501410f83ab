"""Flows: inflow speed over time (paper Sec. IV and V), each profile one class.

A profile is its keys in a case's section `inflow` together with its formula. Formulas stand here
(constant, step, sine, tide, gust), flows through samples in `hkt_mdo.dynamics.sampled`. A profile
of your own is a subclass of `Inflow` (docs/dev/architecture.md).
"""

from collections.abc import Iterator
from functools import partial
from numbers import Real
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, SerializeAsAny

from hkt_mdo.dynamics.laws import STEP
from hkt_mdo.errors import InputError
from hkt_mdo.sections import Flaws, Quantity, Section

CHECKS_PER_PIECE, FEWEST_CHECKS = 16, 1024
LOOKS = 8  # samples between two times, to measure the distance of a flow from a straight line
UNKNOWN_PIECES = 1000  # of a flow that does not declare where it changes
PIECES_AT_ONCE = 50_000
SLOWEST = 1e-4  # m/s, of a flow in which a turbine could work
FASTEST = 20.0
"""Speed, m/s, that no river or tide reaches: a larger number is in another unit or marks a gap."""


class Inflow(Section):
    """A flow: speed_at(t), m/s, for t in s of any shape, twice continuously differentiable.

    `speed_at` must accept complex times. Everything else that a flow declares has a default:

    - length: duration (s) of the flow's data, or its period; None: it has no end.
    - highest_frequency: the highest frequency (Hz) in it; None: it is steady, or not known.
    - features: where it changes as fast, (from, to, period) in s; by default everywhere, at its
      highest frequency. The flow is sampled many times in each period (`pieces`). A flow that
      declares neither is sampled in `UNKNOWN_PIECES` of the time span, with a message: shorter
      features can be missed.
    - mean_speed: the speed about which it fluctuates, m/s, for sums of flows: its key `mean`,
      times its key `scale`; if it has no mean, the speed at t = 0.
    - messages: what was done to its data, one line each.
    - last_time: time (s) beyond which it is unknown.
    """

    named_by: ClassVar[str] = "profile"
    profile: str
    """The kind of flow."""
    steady: ClassVar[bool] = False
    """Whether it is a resource: speeds and their hours, without an order in time."""
    length: ClassVar[float | None] = None
    highest_frequency: ClassVar[float | None] = None
    messages: ClassVar[tuple[str, ...]] = ()
    last_time: ClassVar[float] = np.inf

    @property
    def mean_speed(self) -> float:
        mean = getattr(self, "mean", None)
        return float(self.speed_at(0.0)) if mean is None else getattr(self, "scale", 1.0) * mean

    def model_copy(self, **options):
        """Return a copy as pydantic does, but without each `cached_property` of the old fields."""
        copied = super().model_copy(**options)
        for name in copied.__dict__.keys() - type(self).model_fields.keys():
            del copied.__dict__[name]
        return copied

    def reseeded(self, number: int) -> Self:
        """Return the flow with a seed that is larger by a number; without a seed, as it is."""
        seed = getattr(self, "seed", None)
        return self if seed is None else self.model_copy(update={"seed": seed + number})

    def speed_at(self, time):
        """Return the inflow speed, m/s."""
        raise NotImplementedError

    def rate_at(self, time):
        """Return the speed's derivative by time, m/s², by complex step."""
        return np.imag(self.speed_at(np.asarray(time) + 1j * STEP)) / STEP

    @property
    def features(self) -> tuple[tuple[float, float, float], ...]:
        """Time spans with the shortest period in each, (from, to, period) in s."""
        cutoff = self.highest_frequency or 0.0
        if not (isinstance(cutoff, Real) and 0.0 <= cutoff < np.inf):
            entry = {"key": f"{type(self).__name__}.highest_frequency", "value": cutoff}
            raise InputError("is no frequency", "give a number in Hz, or None", **entry)
        return ((-np.inf, np.inf, 1.0 / cutoff),) if cutoff else ()

    @property
    def tells_features(self) -> bool:
        """Whether the class declares `features` or `highest_frequency`."""
        return bool(self.highest_frequency) or type(self).features is not Inflow.features

    def pieces(self, last: float, first: float = 0.0) -> np.ndarray:
        """Return times, s, rising from the first to the last, between which the flow is smooth.

        They are no farther apart than the shortest period there, and features begin and end there.
        """
        times = [np.linspace(first, last, 2 if self.tells_features else UNKNOWN_PIECES + 1)]
        for begin, end, period in self.features:
            begin, end = np.clip((begin, end), first, last)
            if end > begin:
                times.append(np.linspace(begin, end, int(np.ceil((end - begin) / period)) + 1))
        return np.unique(np.concatenate(times))

    def _looks(self, duration: float) -> Iterator[np.ndarray]:
        """Yield rising times, s, sixteen in the shortest period, in blocks with common ends."""
        ends = self.pieces(duration)
        count = max(CHECKS_PER_PIECE, FEWEST_CHECKS // (ends.size - 1))
        share = np.arange(count) / count
        for first in range(0, ends.size - 1, PIECES_AT_ONCE):
            block = ends[first : first + PIECES_AT_ONCE + 1]
            yield np.append(block[:-1, None] + share * np.diff(block)[:, None], block[-1])

    def spans_below(self, speed: float, duration: float) -> np.ndarray:
        """Return the time spans within a duration (s) in which the flow is at most a speed (m/s).

        Rows [begin, end], s; between them the flow is faster. The ends are exact to rounding.
        """
        from scipy.optimize import brentq

        speed *= 1.0 + 1e-15  # a peak that just reaches it does not exceed it

        def excess(time):
            return float(self.speed_at(time)) - speed

        crossings = []
        for time in self._looks(duration):
            over, rate, step = self.speed_at(time) - speed, self.rate_at(time), np.diff(time)
            # between two samples only a peak may be faster; it lies below the tangents there
            reach = np.minimum(over[:-1] + rate[:-1] * step, over[1:] - rate[1:] * step)
            peaks = np.flatnonzero((reach > 0.0) & (rate[:-1] > 0.0) & (rate[1:] < 0.0))
            peaks = [brentq(self.rate_at, time[i], time[i + 1], xtol=1e-15) for i in peaks]
            time = np.union1d(time, peaks)
            faster = self.speed_at(time) > speed
            places = np.flatnonzero(faster[1:] != faster[:-1])
            crossings += [brentq(excess, time[i], time[i + 1], xtol=1e-15) for i in places]
        begins = [0.0] if excess(0.0) <= 0.0 else []
        ends = [duration] if excess(duration) <= 0.0 else []
        return np.array([*begins, *crossings, *ends]).reshape(-1, 2)

    def cubes(self, edges: np.ndarray) -> np.ndarray:
        """Return the integral of v³ between consecutive edges, m³/s², of rising edges (s).

        By adaptive quadrature in each of the flow's `pieces`.
        """
        from scipy.integrate import quad_vec

        ends = np.union1d(edges, self.pieces(edges[-1], edges[0]))
        step, whole = np.diff(ends), np.zeros(ends.size)
        mean, _ = quad_vec(lambda share: self.speed_at(ends[:-1] + share * step) ** 3, 0.0, 1.0)
        whole[1:] = np.cumsum(step * mean)
        return np.diff(whole[np.searchsorted(ends, edges)])

    def off_lines(self, times: np.ndarray) -> np.ndarray:
        """Return the distance of the flow from straight lines between its speeds at some times.

        It is sampled `LOOKS` times between two of the times (s), and in each of its `pieces`.

        Returns
        -------
        array
            Largest distance after each time but the last, m/s, (n_times - 1,).
        """
        ends = np.union1d(times, self.pieces(times[-1], times[0]))
        speed, share = self.speed_at(times), (np.arange(LOOKS) + 0.5) / LOOKS
        largest = np.zeros(times.size - 1)
        for first in range(0, ends.size - 1, PIECES_AT_ONCE):
            block = ends[first : first + PIECES_AT_ONCE + 1]
            looks = block[:-1, None] + share * np.diff(block)[:, None]
            off = np.abs(self.speed_at(looks) - np.interp(looks, times, speed))
            index = np.searchsorted(times, block[:-1], side="right") - 1
            np.maximum.at(largest, index, np.max(off, axis=1))
        return largest

    def check(self, duration: float) -> None:
        """Refuse, by InputError, a flow that ends, stops or reverses within a time (s).

        A flow that is faster than any natural current is refused, too. It is sampled sixteen times
        in its shortest period.
        """
        if duration > self.last_time * (1.0 + 1e-9):
            problem = f"is longer than the record of the flow, {self.last_time:.6g} s"
            remedy = "give phase.duration: null for the whole record, or a shorter one"
            raise InputError(problem, remedy, key="phase.duration", value=duration)
        for time in self._looks(duration):
            speed = np.asarray(self.speed_at(time))
            low = int(np.argmin(speed))
            if not speed[low] >= SLOWEST:
                lowest = f"reaches {speed[low]:.3g} m/s at t = {time[low]:.6g} s"
                problem = f"{lowest}: the flow stops or reverses, which no turbine here does"
                remedy = "give a larger mean, smaller fluctuations, a shorter phase.duration, or a "
                remedy += "resource of a year, in which the flow may reverse"
                raise InputError(problem, remedy, key="inflow")
            if (fastest := float(np.max(speed))) > FASTEST:
                remedy = f"check its unit: no river or tide is faster than {FASTEST:g} m/s"
                raise InputError(f"reaches {fastest:.3g} m/s", remedy, key="inflow")


class ConstantInflow(Inflow):
    """A steady flow."""

    profile: Literal["constant"] = "constant"
    """The kind of flow."""
    speed: Annotated[float, Quantity("m/s", gt=0)]
    """Inflow speed v."""
    features: ClassVar[tuple] = ()

    def speed_at(self, time):
        return self.speed + 0.0 * np.asarray(time)


class StepInflow(Inflow):
    """A smoothed step (paper, eq. 9), v = before + (after - before)/(1 + e^(-(t - time)/width))."""

    profile: Literal["step"] = "step"
    """The kind of flow."""
    before: Annotated[float, Quantity("m/s", gt=0)] = 1.2
    """Inflow speed long before the step."""
    after: Annotated[float, Quantity("m/s", gt=0)] = 1.4
    """Inflow speed long after the step."""
    time: Annotated[float, Quantity("s")] = 30.0
    """Time of the middle of the step."""
    width: Annotated[float, Quantity("s", gt=0)] = 1.0
    """Time scale of the step; nine tenths of the change take six widths."""

    @property
    def highest_frequency(self):
        # where the rate's spectrum, x/sinh(x) with x = 2 π² f width, is 3 %
        return 0.3 / self.width

    @property
    def features(self):
        # 20 widths from its middle, the step is complete to 2e-9
        reach = 20.0 * self.width
        return ((self.time - reach, self.time + reach, 1.0 / self.highest_frequency),)

    @property
    def mean_speed(self):
        return self.before

    def speed_at(self, time):
        # the exponential of eq. 9 would overflow long before the step; this form does not
        rise = np.tanh(0.5 * (np.asarray(time) - self.time) / self.width)
        return 0.5 * (self.before + self.after) + 0.5 * (self.after - self.before) * rise


class SineInflow(Inflow):
    """A sinusoidal flow (paper, eq. 10), v = scale (mean + amplitude sin(w t + phase)).

    The paper's uncertain flows have scale 1.1 (A), angular frequency 0.225 rad/s (B) and phase 0.2
    pi rad (C).
    """

    profile: Literal["sine"] = "sine"
    """The kind of flow."""
    mean: Annotated[float, Quantity("m/s", gt=0)] = 1.5
    """Mean inflow speed, before scaling."""
    amplitude: Annotated[float, Quantity("m/s", ge=0)] = 0.2
    """Amplitude of the inflow speed, before scaling; smaller than the mean."""
    angular_frequency: Annotated[float, Quantity("rad/s", gt=0, le=100)] = 0.25
    """Angular frequency of the inflow speed."""
    phase: Annotated[float, Quantity("rad")] = 0.0
    """Phase of the sine at t = 0."""
    scale: Annotated[float, Quantity(gt=0)] = 1.0
    """Factor on the whole flow."""

    def flaws(self) -> Flaws:
        if self.amplitude >= self.mean:
            problem = f"lets the flow reach zero or reverse: its mean is {self.mean:g} m/s"
            yield "amplitude", problem, "give an amplitude smaller than inflow.mean"

    @property
    def highest_frequency(self):
        return self.angular_frequency / (2.0 * np.pi)

    def speed_at(self, time):
        angle = self.angular_frequency * np.asarray(time) + self.phase
        return self.scale * (self.mean + self.amplitude * np.sin(angle))


# The speeds of the equilibrium tide (deg/h) are sums of the astronomical rates
# tau = 14.4920521, s = 0.5490165, h = 0.0410686, p = 0.0046418 (Doodson 1921)
TIDAL_HOURS = {
    "M2": 12.4206012,
    "S2": 12.0,
    "N2": 12.65834751,
    "K2": 11.96723606,
    "K1": 23.93447213,
    "O1": 25.81934171,
    "P1": 24.06588766,
    "Q1": 26.868357,
    "M4": 6.210300601,
    "MS4": 6.103339275,
    "M6": 4.140200401,
}
"""Periods of the usual tidal constituents, h."""


class TidalConstituent(Section):
    """A constituent of the tide."""

    name: Literal[(*TIDAL_HOURS,)] | None = None
    """Name of the constituent, which determines its period."""
    period: Annotated[float, Quantity("s", gt=0)] | None = None
    """Period, in place of a name."""
    amplitude: Annotated[float, Quantity("m/s", ge=0)]
    """Amplitude of its current."""
    phase: Annotated[float, Quantity("rad")] = 0.0
    """Phase at t = 0."""

    def flaws(self) -> Flaws:
        if (self.name is None) == (self.period is None):
            problem = "has both a name and a period" if self.name else "has neither name nor period"
            yield "", problem, "give name: M2 or the like, or a period"

    @property
    def angular_frequency(self) -> float:
        """Angular frequency, rad/s."""
        period = 3600.0 * TIDAL_HOURS[self.name] if self.name else self.period
        return 2.0 * np.pi / period  # type: ignore[operator]


class TidalInflow(Inflow):
    """A tidal current, v = scale (mean + sum_k amplitude_k cos(2 pi t/period_k - phase_k)).

    It must keep its direction over the case's duration.
    """

    profile: Literal["tide"] = "tide"
    """The kind of flow."""
    mean: Annotated[float, Quantity("m/s")] = 0.0
    """Mean (residual) current, before scaling."""
    constituents: Annotated[tuple[TidalConstituent, ...], Field(min_length=1, max_length=100)]
    """The tide's constituents, a list such as `[{name: M2, amplitude: 2, phase: 30 deg}]`."""
    scale: Annotated[float, Quantity(gt=0)] = 1.0
    """Factor on the whole flow."""

    @property
    def highest_frequency(self):
        return max(wave.angular_frequency for wave in self.constituents) / (2.0 * np.pi)

    def speed_at(self, time):
        rows = [(wave.amplitude, wave.angular_frequency, wave.phase) for wave in self.constituents]
        amplitude, frequency, phase = np.array(rows).T
        waves = np.cos(np.multiply.outer(np.asarray(time), frequency) - phase)
        return self.scale * (self.mean + waves @ amplitude)


class GustInflow(Inflow):
    """One gust in a steady flow, v = mean + amplitude g((t - time)/width)."""

    profile: Literal["gust"] = "gust"
    """The kind of flow."""
    shape: Literal["one_minus_cosine", "mexican_hat"] = "one_minus_cosine"
    """g(s) for 0 <= s <= 1: `one_minus_cosine`, (1 - cos 2 pi s)^2/4, a rise and back;
    `mexican_hat`, -0.37 sin 3 pi s (1 - cos 2 pi s), the extreme operating gust of IEC 61400-1."""
    mean: Annotated[float, Quantity("m/s", gt=0)] = 1.5
    """Inflow speed before and after the gust."""
    amplitude: Annotated[float, Quantity("m/s")] = 0.3
    """Amplitude of the gust; negative for a lull."""
    time: Annotated[float, Quantity("s")] = 20.0
    """Time at which the gust begins."""
    width: Annotated[float, Quantity("s", gt=0)] = 10.5
    """Duration of the gust."""

    @property
    def highest_frequency(self):
        # that of the fastest of the cosines that make it up
        return (2.0 if self.shape == "one_minus_cosine" else 2.5) / self.width

    @property
    def features(self):
        return ((self.time, self.time + self.width, 1.0 / self.highest_frequency),)

    def speed_at(self, time):
        share = (np.asarray(time) - self.time) / self.width
        inside = (np.real(share) >= 0.0) & (np.real(share) <= 1.0)
        rise = 1.0 - np.cos(2.0 * np.pi * share)
        if self.shape == "one_minus_cosine":
            gust = 0.25 * rise**2
        else:
            gust = -0.37 * np.sin(3.0 * np.pi * share) * rise
        return self.mean + self.amplitude * inside * gust


def _of_parts(name, join):
    """Return a property of a sum of flows: what its parts have by that name, put together."""
    return property(lambda self: join(y for x in self.parts if (y := getattr(x, name)) is not None))


class SumInflow(Inflow):
    """A sum of flows: all of the first one, and the others' fluctuations about their own means.

    A step's mean is the speed before it, a gust's that around it.
    """

    profile: Literal["sum"] = "sum"
    """The kind of flow."""
    parts: Annotated[tuple[SerializeAsAny[Inflow], ...], Field(min_length=2, max_length=20)]
    """The flows, a list; the first one has the mean."""

    length = _of_parts("length", partial(min, default=None))
    highest_frequency = _of_parts("highest_frequency", partial(max, default=None))
    features = _of_parts("features", partial(sum, start=()))
    tells_features = _of_parts("tells_features", all)
    messages = _of_parts("messages", partial(sum, start=()))
    last_time = _of_parts("last_time", min)

    def flaws(self) -> Flaws:
        seeds = [part.seed for part in self.parts if hasattr(part, "seed")]
        if len({*seeds}) < len(seeds):
            problem = "has random parts of the same seed, which are one flow"
            yield "parts", problem, "give each its own seed"

    def reseeded(self, number):
        number *= sum(part.reseeded(1) != part for part in self.parts)  # no two share a part
        return self.model_copy(update={"parts": tuple(x.reseeded(number) for x in self.parts)})

    @property
    def mean_speed(self):
        return self.parts[0].mean_speed

    def speed_at(self, time):
        offset = sum(part.mean_speed for part in self.parts[1:])
        return sum(part.speed_at(time) for part in self.parts) - offset
