"""Flows through samples: a measured record, and turbulence that is made of waves."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    Strict,
    ValidationInfo,
    field_validator,
    model_validator,
)

from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.sections import Quantity, ordered, refusal

SAMPLES_PER_PERIOD = 8
"""Samples of synthesized turbulence in the shortest period that it contains, at least."""

MOST_WAVES = 1_000_000
"""Largest number of frequencies that turbulence is made of."""


@dataclass(frozen=True, eq=False)
class Samples:
    """A flow through equally spaced samples: the C² cubic spline, not-a-knot or periodic.

    Outside the record the speed keeps its end value, or repeats if there is a period. No optimizer
    and no integration should go there: the rate jumps to zero at the ends.

    Parameters
    ----------
    time : array, shape (n,), s
        Rising in equal steps, n >= 4.
    speed_values : array, shape (n,), m/s
    period : float or None, s
        n steps: the sample after the last one is the first again.
    cutoff : float or None, Hz
        The highest frequency in the samples; None: half of Nyquist's.

    Raises
    ------
    ValueError
        If there are too few samples, or the times or the period do not rise in equal steps.
    """

    time: np.ndarray
    speed_values: np.ndarray
    period: float | None = None
    cutoff: float | None = None
    _step: float = field(init=False, repr=False)
    _start: float = field(init=False, repr=False)
    _cubics: np.ndarray = field(init=False, repr=False)

    def __post_init__(self):
        from scipy.interpolate import CubicSpline

        time = np.asarray(self.time, dtype=float)
        values = np.asarray(self.speed_values, dtype=float)
        if time.ndim != 1 or time.shape != values.shape or time.size < 4:
            raise ValueError("a sampled flow needs at least four times and as many speeds")
        step = (time[-1] - time[0]) / (time.size - 1)
        even = time[0] + step * np.arange(time.size)
        if not (step > 0.0 and np.max(np.abs(time - even)) < 1e-6 * step + 1e-12 * abs(time[-1])):
            raise ValueError("the times of a sampled flow must rise in equal steps")
        kind = "not-a-knot"
        if self.period is not None:
            if abs(self.period / step - time.size) > 1e-6 * time.size:
                raise ValueError("the period of a sampled flow must be as many steps as samples")
            values, kind = np.append(values, values[0]), "periodic"
        # rows d, c, b, a of a + b s + c s² + d s³, with s in steps
        cubics = CubicSpline(np.arange(float(values.size)), values, bc_type=kind).c
        for name, value in (
            ("_step", float(step)),
            ("_start", float(time[0])),
            ("_cubics", cubics),
            ("cutoff", self.cutoff or 0.25 / float(step)),
        ):
            object.__setattr__(self, name, value)

    @property
    def duration(self):
        """Length of the record or of its period, s."""
        return self._cubics.shape[1] * self._step

    def speed_at(self, time):
        """Return the inflow speed, m/s."""
        (d, c, b, a), s, _ = self._look_up(time)
        return a + s * (b + s * (c + s * d))

    def rate_at(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        (d, c, b, _), s, inside = self._look_up(time)
        return inside * (b + s * (2.0 * c + s * 3.0 * d)) / self._step

    def _look_up(self, time):
        """Return the coefficients of the cubic at `time`, the place on it, and if it is inside."""
        count = self._cubics.shape[1]
        place = (time - self._start) / self._step
        if isinstance(place, float):  # an integrator's call: no array, for it comes very often
            if self.period is not None:
                place %= count
            inside = 0.0 <= place <= count
            place = min(max(place, 0.0), float(count))
            row = min(int(place), count - 1)
            return self._cubics[:, row].tolist(), place - row, inside
        place = np.asarray(place)
        if self.period is not None:
            place = place - count * np.floor(place.real / count)
        inside = (place.real >= 0.0) & (place.real <= count)
        place = np.where(inside, place, np.clip(place.real, 0.0, count))
        row = np.minimum(place.real.astype(np.intp), count - 1)
        return self._cubics[:, row], place - row, inside


_Bins = tuple[Annotated[float, Quantity("m")], Annotated[float, Quantity("m")]]


class RecordInflow(Inflow):
    """A measured flow: the samples of a file, low-passed, and a smooth cubic spline through them.

    Nothing in the record is repaired unless a key below says so, and every repair is told.
    """

    profile: Literal["record"] = "record"
    """The kind of flow."""

    file: str
    """Path of the record: a file `.csv` with a header line, `.nc` (NetCDF) or `.parquet`.

    A relative path counts from the folder of the case file. NetCDF and Parquet, as MHKiT's data are
    saved, need `hkt_mdo[records]`.
    """

    time_column: str | None = None
    """Column or variable of the time; null: the first column of a CSV file, the index of a Parquet
    file, the only time in a NetCDF file."""

    speed_column: str | None = None
    """Column or variable of the speed; null: the only one besides the time."""

    time_unit: Literal["s", "ms", "min", "h", "days"] | None = None
    """Unit of times that are numbers; null: as the column's name says, such as `time_s` or
    `time [h]`. Dates are told from numbers: `2024-05-01T12:00:00`, with or without a zone."""

    speed_unit: (
        Literal["m/s", "cm/s", "mm/s", "km/h", "ft/s", "knot", "mph", "m3/s", "L/s", "ft3/s"] | None
    ) = None
    """Unit of the speed, or of a discharge; null: as the column's name says, such as `speed_m_s`
    or `Stream velocity, feet per second`."""

    area: Annotated[float, Quantity("m**2", gt=0)] | None = None
    """Area of the channel's cross section, for a record of the discharge alone: speed = discharge /
    area, the mean over the section."""

    bins: Annotated[_Bins, AfterValidator(ordered)] | None = None
    """Range of the depth bins of a profiler that are averaged, [lower, upper], such as those that
    the rotor spans; null: the record has no bins."""

    component: str | None = None
    """Label of the component of a velocity that is taken, such as `E` or `streamwise`; null: the
    horizontal speed, of the first two."""

    start: Annotated[float, Quantity("s", ge=0)] = 0.0
    """Time in the record, from its first sample, that becomes t = 0."""

    duration: Annotated[float, Quantity("s", gt=0)] | None = None
    """Length of the part that is taken; null: up to the record's end."""

    gaps: Literal["refuse", "interpolate"] = "refuse"
    """What is done about missing samples and empty or NaN cells: the record is refused, or the
    speed is interpolated up to `longest_gap`."""

    longest_gap: Annotated[float, Quantity("s", gt=0, le=3600)] | None = None
    """Longest gap, as missing samples times their spacing, that may be interpolated; null: three
    samples, and no more than an hour."""

    spikes: Literal["refuse", "replace", "keep"] = "refuse"
    """What is done about spikes, which are up to three samples that stand off from their
    neighbours: the record is refused, they are interpolated, or they are taken for the flow."""

    uneven: Literal["refuse", "resample"] = "refuse"
    """What is done about unevenly spaced samples: the record is refused, or the speed is
    interpolated at even times, spaced by the median."""

    cutoff: Annotated[float, Quantity("Hz", gt=0)] | None = None
    """Frequency of the low-pass, which shifts no phase; null: half of Nyquist's. A rotor averages
    over eddies smaller than itself: speed over rotor diameter is a good cutoff."""

    @field_validator("file")
    @classmethod
    def _find_file(cls, value: str, info: ValidationInfo) -> str:
        context = info.context or {}
        remedy = "give the path of a CSV, NetCDF or Parquet file"
        try:
            path = (Path(context.get("folder", ".")) / value).resolve()
            found = path.is_file()
        except (OSError, ValueError, RuntimeError):
            raise refusal("cannot be a path", remedy) from None
        if context.get("check_files", True) and not found:
            raise refusal("is not a file", f"{remedy}, which counts from the case's folder")
        return str(path)

    @cached_property
    def _record(self):
        """The samples of the file and what was done to them; read once for equal options."""
        try:
            state = Path(self.file).stat()
        except OSError:  # reading tells what is wrong with the file
            return _read(self, None)
        return _read(self, (state.st_mtime_ns, state.st_size))

    @property
    def length(self):
        """Length of the part of the record that is taken, s."""
        return self._record[0].duration

    @property
    def highest_frequency(self):
        """Frequency of the low-pass, Hz."""
        return self._record[0].cutoff

    @property
    def mean_speed(self):
        """Mean of the samples, m/s."""
        return float(np.mean(self._record[0].speed_values))

    @property
    def messages(self):
        """What was converted and repaired."""
        return self._record[1]

    @property
    def last_time(self):
        """The record's end, s."""
        return self.length

    def speed_at(self, time):
        """Return the inflow speed, m/s."""
        return self._record[0].speed_at(time)

    def rate_at(self, time):
        """Return the speed's derivative by time, m/s²."""
        return self._record[0].rate_at(time)


@lru_cache(maxsize=2)  # a case is built more than once, and reading takes longest
def _read(inflow: RecordInflow, state: object) -> tuple[Samples, tuple[str, ...]]:
    from hkt_mdo.dynamics.records import RecordOptions, read_record

    options = {option.name: getattr(inflow, option.name) for option in fields(RecordOptions)}
    record = read_record(inflow.file, **options)
    return Samples(record.time, record.speed, cutoff=record.cutoff), tuple(record.messages)


def von_karman(frequency):
    """Return von Kármán's spectrum of longitudinal velocity, 4 / (1 + 70.8 n²)^(5/6).

    Of a homogeneous and isotropic flow (von Kármán 1948, in Taylor's frozen form; ESDU 85020): with
    n = f L / V, the one-sided spectrum is S(f) = σ² (L / V) times this, and L is the integral
    length scale.
    """
    return 4.0 / (1.0 + 70.8 * frequency**2) ** (5.0 / 6.0)


def kaimal(frequency):
    """Return Kaimal's spectrum of longitudinal velocity, 4 / (1 + 6 n)^(5/3).

    Of a boundary layer, in the form of IEC 61400-1 (edition 3, Annex B): with n = f L / V, the
    one-sided spectrum is S(f) = σ² (L / V) times this.
    """
    return 4.0 / (1.0 + 6.0 * frequency) ** (5.0 / 3.0)


SPECTRA = {"von_karman": von_karman, "kaimal": kaimal}


class TurbulentInflow(Inflow):
    """Turbulence, v = mean + sum_k sqrt(2 S(f_k) df) cos(2 pi f_k t + phase_k), df = 1/duration.

    The phases are random, the spectrum is exact. Frequencies above the cutoff are missing, as are
    those below 1/duration, and the rest is not scaled up in their place: the share of the variance
    that is kept is told.
    """

    profile: Literal["turbulence"] = "turbulence"
    """The kind of flow."""

    spectrum: Literal["von_karman", "kaimal"] = "von_karman"
    """Spectrum S(f) of the longitudinal velocity, with n = f L/V: `von_karman`, S = 4 s^2 (L/V) /
    (1 + 70.8 n^2)^(5/6), of isotropic turbulence; `kaimal`, S = 4 s^2 (L/V) / (1 + 6 n)^(5/3), of a
    boundary layer (IEC 61400-1)."""

    mean: Annotated[float, Quantity("m/s", gt=0)] = 1.5
    """Mean inflow speed V, with which the turbulence drifts past the rotor."""

    intensity: Annotated[float, Quantity(gt=0, lt=1)] = 0.1
    """Turbulence intensity: standard deviation s of the whole spectrum over the mean."""

    length_scale: Annotated[float, Quantity("m", gt=0)] = 5.0
    """Integral length scale L, of the order of the river's depth; eddies pass in about L/V."""

    seed: Annotated[int, Strict(), Field(ge=0, lt=2**63)] = 1
    """Seed of the random phases."""

    duration: Annotated[float, Quantity("s", gt=0)] = 60.0
    """Duration of the realization, after which it repeats; ten times L/V at least. What is slower
    is missing, too."""

    cutoff: Annotated[float, Quantity("Hz", gt=0)] | None = None
    """Highest frequency; null: 2 mean/length_scale, above which is a tenth of the variance. A rotor
    averages over eddies smaller than itself: mean over rotor diameter is a good cutoff."""

    @property
    def highest_frequency(self) -> float:
        """The cutoff or its default, Hz."""
        return self.cutoff or 2.0 * self.mean / self.length_scale

    @model_validator(mode="after")
    def _check_size(self) -> TurbulentInflow:
        shortest = 10.0 * self.length_scale / self.mean
        if self.duration < shortest:
            raise refusal(
                "is too short for the slowest eddies",
                f"give at least 10 length_scale/mean = {shortest:g} s",
                key="duration",
                value=self.duration,
            )
        waves = self.duration * self.highest_frequency
        if not 4 <= waves <= MOST_WAVES:
            raise refusal(
                f"makes {waves:.3g} waves, their frequencies 1/duration apart",
                f"between 4 and {MOST_WAVES} are possible: change it or the duration",
                key="cutoff",
                value=self.highest_frequency,
            )
        return self

    @property
    def length(self):
        """Duration of the realization, s."""
        return self.duration

    @property
    def mean_speed(self):
        """The mean, m/s."""
        return self.mean

    def spectral_density(self, frequency):
        """Return the one-sided spectrum S(f), m²/s² per Hz, whose integral over f is s²."""
        time_scale = self.length_scale / self.mean
        variance = (self.intensity * self.mean) ** 2
        return variance * time_scale * SPECTRA[self.spectrum](frequency * time_scale)

    @property
    def frequencies(self):
        """Frequencies f_k of the waves, Hz."""
        # rounding must not lose the last one where the cutoff is a whole number of df
        count = int(self.highest_frequency * self.duration * (1 + 1e-12))
        return np.arange(1, count + 1) / self.duration

    @property
    def kept_variance(self) -> float:
        """Variance of this flow as a share of s²."""
        power = np.sum(self.spectral_density(self.frequencies)) / self.duration
        return float(power / (self.intensity * self.mean) ** 2)

    @property
    def messages(self):
        """What the realization has of the spectrum."""
        deviation = self.intensity * self.mean * np.sqrt(self.kept_variance)
        return (
            f"turbulence from {1.0 / self.duration:.3g} to {self.highest_frequency:.3g} Hz has "
            f"{100 * self.kept_variance:.3g} % of the spectrum's variance: its standard deviation "
            f"is {deviation:.3g} m/s",
        )

    @cached_property
    def samples(self) -> Samples:
        """The flow as periodic samples.

        Phases are drawn from the lowest frequency up by NumPy's default generator: another cutoff
        leaves the slower waves as they are.
        """
        from scipy.fft import irfft, next_fast_len

        frequencies = self.frequencies
        amplitudes = np.sqrt(2.0 * self.spectral_density(frequencies) / self.duration)
        phases = np.random.default_rng(self.seed).uniform(0.0, 2.0 * np.pi, frequencies.size)
        count = next_fast_len(max(SAMPLES_PER_PERIOD * frequencies.size, 8), real=True)
        terms = np.zeros(count // 2 + 1, dtype=complex)
        terms[0] = count * self.mean
        terms[1 : frequencies.size + 1] = 0.5 * count * amplitudes * np.exp(1j * phases)
        time = np.arange(count) * (self.duration / count)
        return Samples(time, irfft(terms, count), self.duration, self.highest_frequency)

    def speed_at(self, time):
        """Return the inflow speed, m/s."""
        return self.samples.speed_at(time)

    def rate_at(self, time):
        """Return the speed's derivative by time, m/s²."""
        return self.samples.rate_at(time)
