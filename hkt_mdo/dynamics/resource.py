"""Resources: for how long a flow has each speed in a year, without the order in time.

A resource is a kind of flow that a case names under `resource`. The rotor is then in equilibrium at
each speed, and the energy of a year is a sum over the speeds, each with its hours. Bins, mean speed
of a bin and hours of a year are those of IEC TS 62600-200 and -201 (docs/studies/year_checked.md).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from hkt_mdo.dynamics.flows import SLOWEST, Inflow, TidalInflow
from hkt_mdo.errors import InputError
from hkt_mdo.sections import ExistingFile, Flaws, Quantity

YEAR = 8766.0 * 3600.0
"""A year, s: 8766 hours."""
POINTS = 5  # of a normal distribution of turbulence: exact for polynomials of the ninth degree
PLACES, WEIGHTS = np.polynomial.hermite_e.hermegauss(POINTS)
FARTHEST = float(PLACES[-1])  # of these points, in standard deviations
FINE = 256  # parts of a bin of a distribution
TAIL = 1e-5  # share of the time above the fastest bin of a distribution, five minutes a year
TIDE_STEP = 600.0  # s, at which a tide is sampled
YEAR_ROUNDED = 3e-3  # a year has 8760, 8766 or 8784 hours
SAME = 1e-9  # m/s, by which speeds of one bin differ at most
MOST_SPEEDS = 2000
WIDEST = 0.1  # m/s, of the bins of IEC TS 62600-200
AT_END = 1e-14  # share of the time of the ends of the speeds' range: no energy, but limits hold


@dataclass(frozen=True, eq=False)
class Speeds:
    """Speeds of a flow, and how long it has each of them.

    Attributes
    ----------
    speed : np.ndarray
        Speeds, m/s, rising, (n,).
    share : np.ndarray
        Share of the time of each, (n,); what is missing to 1 is `idle`.
    place : np.ndarray
        Number of the bin of each, (n,); a bin has several under turbulence.
    mean : np.ndarray
        Mean speed of each bin, m/s, (n_bins,).
    time : np.ndarray
        Share of the time of each bin before speeds are left out, (n_bins,).
    idle : float
        Share of the time in which the turbine stands still: the flow is too slow, too fast, or runs
        the other way.
    """

    speed: np.ndarray
    share: np.ndarray
    place: np.ndarray
    mean: np.ndarray
    time: np.ndarray
    idle: float = 0.0
    finer: tuple[np.ndarray, np.ndarray] | None = None
    """Speeds, m/s, and shares of the time from which the bins are made; None: unknown."""
    whole: tuple[np.ndarray, np.ndarray] = (np.empty(0), np.empty(0))
    """The same before speeds are left out, or those of the bins where they are unknown."""

    def below(self, speed: np.ndarray) -> np.ndarray:
        """Return the share of the time in which the flow is slower than speeds, m/s, (n,)."""
        order = np.argsort(self.whole[0])
        speeds, share = (column[order] for column in self.whole)
        return np.interp(speed, speeds, np.cumsum(share) - 0.5 * share)

    def between(self, slowest: float, fastest: float) -> "Speeds":
        """Return the speeds from the slowest to the fastest, m/s; the others are `idle`."""
        within = (self.speed >= slowest) & (self.speed <= fastest)
        fields = {name: getattr(self, name)[within] for name in ("speed", "share", "place")}
        return replace(self, **fields, idle=self.idle + float(np.sum(self.share[~within])))

    def with_ends(self, slowest: float, fastest: float) -> "Speeds":
        """Return the speeds and the ends of their range, m/s, at which limits hold as well."""
        first, last = (1.0 - SAME) * self.speed[0], (1.0 + SAME) * self.speed[-1]
        more = int(slowest < first), int(fastest > last)
        ends = np.array([slowest][: more[0]]), self.speed, np.array([fastest][: more[1]])
        share = np.pad(self.share, more, constant_values=AT_END)
        bins = np.pad(self.place, more, mode="edge")
        return replace(self, speed=np.concatenate(ends), share=share, place=bins)

    def curve(self, duration: float) -> "DurationCurve":
        """Return the speeds as a flow over a duration, s."""
        ends = duration * np.append(self.idle, self.idle + np.cumsum(self.share))
        return DurationCurve(speeds=tuple(self.speed), ends=tuple(ends))

    def turbulent(self, intensity: float) -> "Speeds":
        """Replace each speed by a normal distribution about it, of a relative deviation.

        By Gauss-Hermite quadrature; the share of negative speeds is `idle`.
        """
        if not intensity:
            return self
        speed = np.outer(self.speed, 1.0 + intensity * PLACES).ravel()
        share = np.outer(self.share, WEIGHTS / WEIGHTS.sum()).ravel()
        order = np.argsort(speed, kind="stable")
        bins = np.repeat(self.place, POINTS)
        spread = replace(self, speed=speed[order], share=share[order], place=bins[order])
        return spread.between(SLOWEST, np.inf)


def places_in_bins(speed: np.ndarray, width: float) -> np.ndarray:
    """Return the number of the bin of each speed, (n,), rising with the speed.

    Bins begin at multiples of the width (m/s), and reversed flow, which is negative, has bins of
    its own. A bin without a speed has no number.
    """
    multiple = np.floor(np.abs(speed) / width + SAME)
    return np.unique(np.where(speed < 0.0, -1.0 - multiple, multiple), return_inverse=True)[1]


def in_bins(speed: np.ndarray, share: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the power-weighted speeds of bins, m/s, and the share of the time of each.

    The speed of a bin is the cube root of the mean cubed speed in it, so that the power of the flow
    is kept. Bins are those of `places_in_bins`.

    Parameters
    ----------
    speed, share : np.ndarray
        Speeds, m/s, and their shares of the time, (n,).
    width : float
        Of a bin, m/s.

    Returns
    -------
    speed, share : np.ndarray
        Of the bins that have a share, rising.
    """
    bins = places_in_bins(speed, width)
    shares = np.bincount(bins, share)
    cubes = np.bincount(bins, share * speed**3)
    used = shares > 0.0
    return np.cbrt(cubes[used] / shares[used]), shares[used]


class DurationCurve(Inflow):
    """The speeds of a resource as a flow over time: rising, each for its share of the time.

    It is made from a resource; a case cannot name it.
    """

    profile: Literal["duration_curve"] = "duration_curve"
    """The kind of flow."""
    speeds: tuple[float, ...]
    """Speeds, m/s, rising."""
    ends: tuple[float, ...]
    """Times, s, between which the flow has each speed, rising; one more than speeds."""
    features: ClassVar[tuple] = ()

    def speed_at(self, time):
        inner = np.array(self.ends[1:-1])
        return np.array(self.speeds)[np.searchsorted(inner, np.real(time), "right")] + 0.0 * time


class Resource(Inflow):
    """How long a flow has each speed in a year, with cut-in, availability and losses.

    A subclass gives the speeds by `occurrence`. Negative speeds are those of reversed flow.
    """

    steady: ClassVar[bool] = True
    features: ClassVar[tuple] = ()
    length: ClassVar[float | None] = YEAR
    own_bins: ClassVar[bool] = False
    """Whether `occurrence` returns the speeds of bins already."""

    bin_width: Annotated[float, Quantity("m/s", ge=0.005, le=1)] = 0.1
    """Width of the bins; those of a histogram are as it gives them."""
    turbulence_intensity: Annotated[float, Quantity(ge=0, le=0.3)] = 0.0
    """Standard deviation of the speed within a bin over its mean (docs/year.md)."""
    cut_in: Annotated[float, Quantity("m/s", ge=0)] = 0.5
    """Speed below which the machine stands still; above `control.cut_out` it does, too."""
    reversal: Literal["turns", "stands", "backwards"] = "turns"
    """In reversed flow the turbine turns into the flow, stands still, or its rotor turns backwards,
    with `reversed_polar`."""
    reversed_polar: ExistingFile | None = None
    """Path of the polar in flow from behind, of the section turned by 180 degrees (docs/year.md).
    """
    availability: Annotated[float, Quantity(gt=0, le=1)] = 1.0
    """Share of the time in which the machine is ready to work."""
    array_losses: Annotated[float, Quantity(ge=0, lt=1)] = 0.0
    """Share of the energy that is lost to wakes of other machines."""
    electrical_losses: Annotated[float, Quantity(ge=0, lt=1)] = 0.0
    """Share of the energy that is lost between generator and grid."""

    speed_uncertainty: Annotated[float, Quantity(ge=0, le=0.3)] = 0.0
    """Standard uncertainty of the speed, as a share of it; that of the annual energy follows."""

    def occurrence(self) -> tuple[np.ndarray, np.ndarray]:
        """Return speeds, m/s, and their shares of the time, which sum to 1, both (n,)."""
        raise NotImplementedError

    def scatter(self, energies: dict[float, np.ndarray]) -> dict[str, float | None]:
        """Return the relative standard uncertainty of an energy by the length of the record.

        `energies` has the energy of each bin of `speeds`, (n_bins,), by the direction of the flow:
        `forward`, and -1 for that of `reversed_speeds`. It is returned as `record`, None of a
        record that is too short; empty where there is no record.
        """
        return {}

    @property
    def forward(self) -> float:
        """The direction of `speeds`: 1, or 0 for both if the turbine turns into the flow."""
        return 0.0 if self.reversal == "turns" else 1.0

    @property
    def kept(self) -> float:
        """Factor on the energy by availability and losses."""
        return self.availability * (1.0 - self.array_losses) * (1.0 - self.electrical_losses)

    def flaws(self) -> Flaws:
        if (self.reversal == "backwards") != (self.reversed_polar is not None):
            problem = "belongs to reversal: backwards, which needs it"
            yield "reversed_polar", problem, "give both or neither"

    @cached_property
    def speeds(self) -> "Speeds":
        """The speeds in bins, rising, without those at which the machine stands still.

        Of both directions if the turbine turns into the flow, otherwise of positive speeds only.
        """
        return self._toward(self.forward)

    @cached_property
    def reversed_speeds(self) -> Speeds | None:
        """The same of reversed flow, in which the rotor turns backwards; None if it never does."""
        slowest = max(self.cut_in, SLOWEST)
        if self.reversal != "backwards" or np.min(self.occurrence()[0]) > -slowest:
            return None
        return self._toward(-1.0)

    def _toward(self, way: float) -> "Speeds":
        """Return the speeds of a direction, 1 or -1, or of both, 0, without its sign."""
        speed, share = self.occurrence()
        runs = way * speed >= 0.0
        idle, speed, share = float(np.sum(share[~runs])), np.abs(speed[runs]), share[runs]
        # bins of its own: one of equal speeds
        rounded, width = (np.round(speed, 9), SAME) if self.own_bins else (speed, self.bin_width)
        mean, time = in_bins(rounded, share, width)
        finer = None if self.own_bins or self.turbulence_intensity else (speed, share)
        speeds = Speeds(mean, time, np.arange(mean.size), mean, time, idle, finer)
        speeds = speeds.turbulent(self.turbulence_intensity)
        whole, slowest = finer or (speeds.speed, speeds.share), max(self.cut_in, SLOWEST)
        speeds = replace(speeds, whole=whole).between(slowest, np.inf)
        if not np.any(speeds.share):
            problem = "leaves no time of operation: the flow is slower or reversed, all year"
            remedy, key = "give a smaller cut_in, or another reversal", "resource.cut_in"
            raise InputError(problem, remedy, key=key, value=self.cut_in)
        if speeds.speed.size > MOST_SPEEDS:
            problem = f"makes {speeds.speed.size} speeds, and {MOST_SPEEDS} are the most"
            raise InputError(problem, "give wider bins", key="resource.bin_width")
        low, high = np.min(speed), np.max(speed)
        if self.own_bins:
            gaps = np.diff(mean) if mean.size > 1 else np.zeros(1)
            low, high = mean[[0, -1]] + np.minimum(gaps[[0, -1]], np.median(gaps)) * [-0.5, 0.5]
        farthest = self.turbulence_intensity * FARTHEST
        return speeds.with_ends(max((1.0 - farthest) * low, slowest), (1.0 + farthest) * high)

    @property
    def messages(self):
        speeds = self.speeds
        notes = f"resource {self.profile}: {speeds.mean.size} speeds of the flow"
        notes += f", mean cubed speed {self.mean_cube:.4g} m³/s³"
        idle = f"; below resource.cut_in = {self.cut_in:g} m/s the machine stands still"
        still = speeds.idle
        if self.reversal == "stands":
            idle += ", and where the flow runs the other way"
        elif (back := self.reversed_speeds) is not None:
            still += back.idle - 1.0
            notes += f", {back.mean.size} more at which the rotor turns backwards"
        spaced = self.own_bins and speeds.mean.size > 1
        if (np.median(np.diff(speeds.mean)) if spaced else self.bin_width) > 1.15 * WIDEST:
            notes += f", in wider bins than the {WIDEST:g} m/s of IEC TS 62600-200"
        return (f"{notes}{idle}: {8766.0 * still:.4g} h a year",)

    @property
    def mean_cube(self) -> float:
        """Mean cubed speed of the flow, whichever way it runs, m³/s³."""
        speed, share = self.occurrence()
        return float(share @ np.abs(speed) ** 3)

    def check(self, duration):
        if self.speeds.speed[-1] > 1e3:
            problem = f"reaches {self.speeds.speed[-1]:.3g} m/s"
            raise InputError(problem, "give speeds of currents", key="resource")


_Speed = Annotated[float, Quantity("m/s", ge=-20, le=20)]
_Hours = Annotated[float, Quantity(ge=0)]


class HistogramResource(Resource):
    """Hours of a year, or shares of the time, of each speed of the flow."""

    own_bins: ClassVar[bool] = True

    profile: Literal["histogram"] = "histogram"
    """The kind of resource."""
    speeds_of_bins: tuple[_Speed, ...] | None = Field(None, alias="speeds", max_length=2000)
    """Speed of each bin, negative for a flow that runs the other way."""
    hours: Annotated[tuple[_Hours, ...] | None, Field(max_length=2000)] = None
    """Hours of each bin, or numbers in proportion to them."""
    file: ExistingFile | None = None
    """Path of a CSV file `speed_m_s,hours` in place of both."""

    def flaws(self) -> Flaws:
        yield from super().flaws()
        speeds, hours = self.speeds_of_bins or (), self.hours or ()
        if self.file is not None:
            if (self.speeds_of_bins, self.hours) != (None, None):
                yield "file", "is given besides speeds and hours", "give one of them"
        elif not speeds or len(speeds) != len(hours):
            problem = f"has {len(hours)} values for {len(speeds)} speeds"
            yield "hours", problem, "give speeds and hours, one for each, or file"
        elif len(set(speeds)) != len(speeds):
            yield "speeds", "has a speed twice", "give each bin once"
        elif not sum(hours) > 0.0:
            yield "hours", "sum to nothing: the year has no flow", "give the hours of each speed"

    @cached_property
    def _table(self) -> tuple[np.ndarray, np.ndarray]:
        if self.file is None:
            return np.array(self.speeds_of_bins, dtype=float), np.array(self.hours, dtype=float)
        from hkt_mdo.files.record_table import read_pairs

        speed, hours = read_pairs(self.file, ("speed_m_s", "hours"))
        speed.refuse(np.abs(speed.values) > 20.0, "is no speed of a flow", "give at most 20 m/s")
        hours.refuse(hours.values < 0.0, "is negative", "give hours of at least 0")
        if not np.sum(hours.values) > 0.0:
            problem, remedy = "sum to nothing: the year has no flow", "give the hours of each speed"
            raise InputError(problem, remedy, file=self.file, key="hours")
        return speed.values, hours.values

    @property
    def messages(self):
        total, year = float(np.sum(self._table[1])), YEAR / 3600.0
        if abs(total / year - 1.0) < YEAR_ROUNDED:
            return super().messages
        note = f"resource.hours: they sum to {total:.6g} and are scaled to a year of {year:g} h"
        return (*super().messages, note)

    def occurrence(self):
        speed, hours = self._table
        return speed, hours / np.sum(hours)


class DistributionResource(Resource):
    """A distribution of the flow's speed that a formula gives."""

    profile: Literal["distribution"] = "distribution"
    """The kind of resource."""
    family: Literal["weibull", "lognormal", "gamma"] = "weibull"
    """Distribution, as SciPy's `weibull_min`, `lognorm` or `gamma`; Rayleigh's is Weibull's of
    shape 2."""
    scale: Annotated[float, Quantity("m/s", gt=0, le=20)]
    """Scale: of Weibull's, the speed below which 63 % of the time lies."""
    shape: Annotated[float, Quantity(gt=0.1, le=100)]
    """Shape: Weibull's exponent, or the standard deviation of the lognormal speed's logarithm."""

    def occurrence(self):
        """Return the speeds in the middle of `FINE` equal parts of every bin."""
        from scipy import stats

        family = {"weibull": "weibull_min", "lognormal": "lognorm", "gamma": "gamma"}[self.family]
        distribution = getattr(stats, family)(self.shape, scale=self.scale)
        count = int(np.ceil(distribution.ppf(1.0 - TAIL) / self.bin_width))
        if count > MOST_SPEEDS:
            problem = f"needs {count} bins of resource.bin_width"
            raise InputError(problem, "correct scale and shape", key="resource.shape")
        edges = self.bin_width / FINE * np.arange(FINE * count + 1)
        share = np.diff(distribution.cdf(edges))
        return 0.5 * (edges[1:] + edges[:-1]), share / np.sum(share)


class TidalResource(TidalInflow, Resource):
    """The tide of a year, from its constituents.

    v = scale (mean + sum_k amplitude_k cos(2 pi t/period_k - phase_k)), sampled every ten minutes
    over some years from t = 0.
    """

    profile: Literal["tidal_year"] = "tidal_year"  # type: ignore[assignment]
    """The kind of resource."""
    years: Annotated[float, Quantity(ge=0.05, le=20)] = 1.0
    """Years that are sampled."""

    def occurrence(self):
        count = int(self.years * YEAR / TIDE_STEP)
        speed = np.concatenate(
            [self.speed_at(TIDE_STEP * part) for part in np.array_split(np.arange(count), 20)]
        )
        return speed, np.full(count, 1.0 / count)
