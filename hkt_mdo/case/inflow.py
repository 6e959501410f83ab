"""The flow: section `inflow`, one class for each profile."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    Field,
    Strict,
    ValidationInfo,
    field_validator,
    model_validator,
)

from hkt_mdo.sections import Quantity, Section, ordered, refusal

MOST_WAVES = 1_000_000
"""Largest number of frequencies that turbulence is made of."""


class ConstantInflow(Section):
    """A steady flow."""

    profile: Literal["constant"] = "constant"
    """The kind of flow."""

    speed: Annotated[float, Quantity("m/s", gt=0)]
    """Inflow speed v."""


class StepInflow(Section):
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
    """Time scale of the step; nine tenths of the change take about six widths."""


class SineInflow(Section):
    """A sinusoidal flow (paper, eq. 10), v = scale (mean + amplitude sin(w t + phase)).

    The uncertain flows of the paper's section V are this one with scale 1.1 (A), angular frequency
    0.225 rad/s (B) and phase 0.2 pi rad (C).
    """

    profile: Literal["sine"] = "sine"
    """The kind of flow."""

    mean: Annotated[float, Quantity("m/s", gt=0)] = 1.5
    """Mean inflow speed, before scaling."""

    amplitude: Annotated[float, Quantity("m/s", ge=0)] = 0.2
    """Amplitude of the inflow speed, before scaling; smaller than the mean."""

    angular_frequency: Annotated[float, Quantity("rad/s", gt=0)] = 0.25
    """Angular frequency of the inflow speed."""

    phase: Annotated[float, Quantity("rad")] = 0.0
    """Phase of the sine at t = 0."""

    scale: Annotated[float, Quantity(gt=0)] = 1.0
    """Factor on the whole flow."""

    @model_validator(mode="after")
    def _check_flow(self) -> SineInflow:
        if self.amplitude >= self.mean:
            raise refusal(
                f"lets the flow reach zero or turn back: its mean is {self.mean:g} m/s",
                "give an amplitude smaller than inflow.mean",
                key="amplitude",
                value=self.amplitude,
            )
        return self


_Bins = tuple[Annotated[float, Quantity("m")], Annotated[float, Quantity("m")]]


class RecordInflow(Section):
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


class TurbulentInflow(Section):
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


class TidalConstituent(Section):
    """A constituent of the tide, amplitude cos(2 pi t/period - phase)."""

    name: Literal["M2", "S2", "N2", "K2", "K1", "O1", "P1", "Q1", "M4", "MS4", "M6"] | None = None
    """Name of the constituent, which says its period."""

    period: Annotated[float, Quantity("s", gt=0)] | None = None
    """Period, in place of a name."""

    amplitude: Annotated[float, Quantity("m/s", ge=0)]
    """Amplitude of the constituent's current."""

    phase: Annotated[float, Quantity("rad")] = 0.0
    """Phase at t = 0; texts such as `30 deg` are converted."""

    @model_validator(mode="after")
    def _check_period(self) -> TidalConstituent:
        if (self.name is None) == (self.period is None):
            raise refusal(
                "has both a name and a period" if self.name else "has neither name nor period",
                "give name: M2 or the like, or a period",
            )
        return self


class TidalInflow(Section):
    """A tidal current, v = scale (mean + sum_k amplitude_k cos(2 pi t/period_k - phase_k)).

    The turbine does not reverse: over the case's duration the flow must run one way.
    """

    profile: Literal["tide"] = "tide"
    """The kind of flow."""

    mean: Annotated[float, Quantity("m/s")] = 0.0
    """Mean (residual) current, before scaling."""

    constituents: Annotated[tuple[TidalConstituent, ...], Field(min_length=1, max_length=100)]
    """The tide's constituents, a list such as `[{name: M2, amplitude: 2, phase: 30 deg}]`."""

    scale: Annotated[float, Quantity(gt=0)] = 1.0
    """Factor on the whole flow."""


class GustInflow(Section):
    """One gust in a steady flow, v = mean + amplitude g((t - time)/width)."""

    profile: Literal["gust"] = "gust"
    """The kind of flow."""

    shape: Literal["one_minus_cosine", "mexican_hat"] = "one_minus_cosine"
    """g(s) for 0 <= s <= 1: `one_minus_cosine`, (1 - cos 2 pi s)^2/4, a rise by the amplitude and
    back, squared to be smooth at its ends; `mexican_hat`, -0.37 sin 3 pi s (1 - cos 2 pi s), the
    extreme operating gust of IEC 61400-1: a dip by 0.27, a rise by 0.74, a dip."""

    mean: Annotated[float, Quantity("m/s", gt=0)] = 1.5
    """Inflow speed before and after the gust."""

    amplitude: Annotated[float, Quantity("m/s")] = 0.3
    """Amplitude of the gust; negative for a lull."""

    time: Annotated[float, Quantity("s")] = 20.0
    """Time at which the gust begins."""

    width: Annotated[float, Quantity("s", gt=0)] = 10.5
    """Time that the gust takes; the default is that of the extreme operating gust."""


_Part = Annotated[
    ConstantInflow
    | StepInflow
    | SineInflow
    | RecordInflow
    | TurbulentInflow
    | TidalInflow
    | GustInflow,
    Field(discriminator="profile"),
]


class SumInflow(Section):
    """A sum of flows: the first one whole, of every other its fluctuation about its own mean.

    So `[{profile: tide, ...}, {profile: turbulence, mean: 1.8}]` is turbulence, drifting at 1.8
    m/s, on a tidal current. Of a step the speed before it counts as the mean, of a gust the speed
    around it.
    """

    profile: Literal["sum"] = "sum"
    """The kind of flow."""

    parts: Annotated[tuple[_Part, ...], Field(min_length=2, max_length=20)]
    """The flows, a list; the first carries the mean."""


Inflow = Annotated[
    ConstantInflow
    | StepInflow
    | SineInflow
    | RecordInflow
    | TurbulentInflow
    | TidalInflow
    | GustInflow
    | SumInflow,
    Field(discriminator="profile"),
]
"""Inflow speed over time; `profile` says which kind."""
