"""Long records of a flow: samples of a speed with its sign, or of a discharge with a rating curve.

Unlike a record that is run over time (`hkt_mdo.dynamics.records`), gaps are left out, the flow may
stand still and turn, and nothing is low-passed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from hkt_mdo.dynamics.records import FASTEST, read_columns
from hkt_mdo.dynamics.resource import SAME, YEAR, Resource, in_bins
from hkt_mdo.dynamics.sampled import Bins, SpeedUnit, TimeUnit
from hkt_mdo.errors import InputError
from hkt_mdo.files.record_table import RecordOptions, read_pairs
from hkt_mdo.sections import Quantity, existing_file

FEWEST = 16  # samples
SPRING_NEAP, FEWEST_BLOCKS = 14.765 * 86400.0, 3  # s: from one spring tide to the next
POINTS_301, YEARS_301, YEARS_201 = 15, 10.0, 1.0  # of IEC TS 62600, as MHKiT's examples quote it
_SAMPLES = "time_column", "speed_column", "time_unit", "speed_unit", "area", "bins", "component"


@dataclass(frozen=True, eq=False)
class FlowSamples:
    """Samples of a flow without gaps.

    Attributes
    ----------
    time : np.ndarray
        Since the first sample, s, rising, (n,).
    speed : np.ndarray
        Speed, m/s, negative where the flow runs the other way, (n,).
    discharge : np.ndarray or None
        Of the river, m³/s, (n,), where the speed follows from it.
    axis : float or None
        Direction of positive speeds, degrees from north to east, where it is known.
    messages : tuple of str
        Notes on what was read and how it was processed.
    """

    time: np.ndarray
    speed: np.ndarray
    discharge: np.ndarray | None = None
    axis: float | None = None
    messages: tuple[str, ...] = ()

    @property
    def block(self) -> float:
        """Length of a block of the record, s: a year, or of a short one a spring-neap cycle."""
        years = self.time[-1] / YEAR + 0.01 >= FEWEST_BLOCKS
        return YEAR if years else SPRING_NEAP

    def scatter(self, values: np.ndarray) -> float | None:
        """Return the relative standard uncertainty of the mean of values at the samples, (n,).

        That of the means of equal blocks of the record, which count as independent:
        s/(mean sqrt(n)). None of less than three blocks, and of a mean of zero.
        """
        length = float(self.time[-1])
        count = int(length / self.block + 0.01)
        if count < FEWEST_BLOCKS or not np.mean(values):
            return None
        place = np.minimum((count * self.time / length).astype(int), count - 1)
        samples = np.bincount(place, minlength=count)
        means = np.bincount(place, values, count)[samples > 0] / samples[samples > 0]
        if means.size < FEWEST_BLOCKS:
            return None
        return float(np.std(means, ddof=1) / np.sqrt(means.size) / abs(np.mean(values)))


@dataclass(frozen=True, eq=False)
class Rating:
    """Speed of the flow over the discharge of a river: a polynomial, or straight lines.

    Attributes
    ----------
    discharge, speed : np.ndarray
        Points, m³/s and m/s, (n,).
    degree : int or None
        Of the polynomial that is fitted by least squares; None: straight lines between the points.
    """

    discharge: np.ndarray
    speed: np.ndarray
    degree: int | None

    def speed_at(self, discharge: np.ndarray) -> np.ndarray:
        """Return the speed, m/s, at discharges, m³/s."""
        if self.degree is None:
            return np.interp(discharge, self.discharge, self.speed)
        fitted = np.polynomial.Polynomial.fit(self.discharge, self.speed, self.degree)
        return np.asarray(fitted(discharge))

    @property
    def determination(self) -> float:
        """Coefficient of determination of the curve at its points."""
        left = np.sum((self.speed_at(self.discharge) - self.speed) ** 2)
        return float(1.0 - left / np.sum((self.speed - np.mean(self.speed)) ** 2))


class RecordResource(Resource):
    """A long record of the flow, or of a river's discharge with its rating curve.

    Missing samples are left out; all others have equal weight.
    """

    profile: Literal["long_record"] = "long_record"
    """The kind of resource."""
    file: str
    """Path of the record: `.csv`, `.nc` or `.parquet` as of the profile `record`, or `.json` as
    MHKiT saves NOAA's and USGS' stations."""
    time_column: str | None = None
    """Column of the time, as of the profile `record`."""
    speed_column: str | None = None
    """Column of the speed or the discharge, as of the profile `record`."""
    direction_column: str | None = None
    """Column of the direction that the flow runs to, degrees from north to east: the speed is then
    that along the principal axis of the flow, with its sign."""
    time_unit: TimeUnit | None = None
    """Unit of times that are numbers, as of the profile `record`."""
    speed_unit: SpeedUnit | None = None
    """Unit of the speed or the discharge, as of the profile `record`."""
    area: Annotated[float, Quantity("m**2", gt=0)] | None = None
    """Area of the channel's cross section, for a record of the discharge without a rating curve."""
    bins: Bins | None = None
    """Range of the depth bins of a profiler that are averaged, as of the profile `record`."""
    component: str | None = None
    """Label of the component of a velocity that is taken, with its sign; of two with a comma
    between them, such as `E,N`, the speed along the principal axis of the flow."""
    rating: str | None = None
    """Path of a CSV file with the columns `discharge_m3_s` and `speed_m_s`, for a record of the
    discharge."""
    rating_degree: Annotated[int, Field(ge=1, le=5)] | None = None
    """Degree of the polynomial that is fitted to the rating curve; null: straight lines between its
    points, and beyond them the speed of the last point."""
    spikes: Literal["refuse", "keep"] = "refuse"
    """What is done about speeds above 20 m/s or discharges below zero: the record is refused, or
    they are left out."""

    @field_validator("file", "rating")
    @classmethod
    def _find_file(cls, value: str | None, info: ValidationInfo) -> str | None:
        remedy = "give the path of a CSV, JSON, NetCDF or Parquet file"
        return None if value is None else existing_file(value, info, remedy)

    @cached_property
    def samples(self) -> FlowSamples:
        """The samples of the file."""
        if self.rating is not None:
            return self._of_discharge()
        labels = (self.component or "").split(",")
        if self.direction_column is not None:
            speed, angle = self._columns(), self._columns(self.direction_column)
            angle = replace(angle, speed=np.deg2rad(angle.speed))
            parts = [speed.speed * np.sin(angle.speed), speed.speed * np.cos(angle.speed)]
            return self._along_axis(speed, parts)
        if len(labels) == 2:
            first, second = (self._columns(component=label.strip()) for label in labels)
            return self._along_axis(first, [first.speed, second.speed])
        raw = self._columns()
        return self._made(raw.time, raw.speed, raw.messages)

    def _columns(self, column: str | None = None, component: str | None = None, **others):
        """Return the columns of time and of one quantity, of an angle by its column."""
        options = {name: getattr(self, name) for name in _SAMPLES} | others
        options["component"] = component or self.component
        if column is not None:
            options |= {
                "speed_column": column,
                "speed_unit": "m/s",
                "component": None,
                "area": None,
            }
        return read_columns(Path(self.file), RecordOptions(**options))

    def _of_discharge(self) -> FlowSamples:
        """Return the samples of a discharge, and the speed by the rating curve."""
        curve, raw = self.rating_curve, self._columns(area=1.0)
        notes = [text for text in raw.messages if "over the area" not in text]
        made = self._made(raw.time, raw.speed, tuple(notes), most=np.inf, least=0.0)
        low, high = curve.discharge[0], curve.discharge[-1]
        outside = float(np.mean((made.speed < low) | (made.speed > high)))
        notes = f"speed by the rating curve of {curve.discharge.size} points, "
        notes += "straight lines" if curve.degree is None else f"degree {curve.degree}"
        notes += f", coefficient of determination {curve.determination:.4f}"
        if curve.discharge.size < POINTS_301:
            notes += f"; IEC TS 62600-301 asks for {POINTS_301} points"
        if outside:
            notes += f"; {100.0 * outside:.3g} % of the samples lie outside of its points"
        speed = np.maximum(curve.speed_at(made.speed), 0.0)
        return replace(made, speed=speed, discharge=made.speed, messages=(*made.messages, notes))

    @cached_property
    def rating_curve(self) -> Rating:
        """The rating curve, its points in the order of rising discharge."""
        assert self.rating is not None
        discharge, speed = read_pairs(self.rating, ("discharge_m3_s", "speed_m_s"))
        order = np.argsort(discharge)
        discharge, speed = discharge[order], speed[order]
        if discharge.size < 2 or np.any(np.diff(discharge) <= 0.0) or np.any(speed < 0.0):
            problem = "is no rating curve"
            remedy = "give two points at least, each discharge once, and speeds of at least 0"
            raise InputError(problem, remedy, file=self.rating)
        if (self.rating_degree or 0) >= discharge.size:
            problem = f"takes more than {discharge.size} points"
            raise InputError(problem, "give a lower one", key="resource.rating_degree")
        return Rating(discharge, speed, self.rating_degree)

    def _along_axis(self, raw, parts) -> FlowSamples:
        """Return the samples of the speed along the principal axis, of parts to east and north."""
        good = np.isfinite(parts[0]) & np.isfinite(parts[1])
        east, north = (part[good] for part in parts)
        about = np.stack((east, north))
        if about.size:
            _, vectors = np.linalg.eigh(about @ about.T)
            axis = vectors[:, -1]
            along = axis @ about
            sign = 1.0 if np.sum(along**3) >= 0.0 else -1.0
            axis, along = sign * axis, sign * along
            share = float(np.sum(along**2) / max(np.sum(about**2), 1e-300))
            angle = float(np.rad2deg(np.arctan2(axis[0], axis[1])) % 360.0)
            notes = (
                f"principal axis {angle:.1f} deg, with {100.0 * share:.4g} % of the squared speed"
            )
        else:
            along, angle, notes = np.empty(0), 0.0, ""
        made = self._made(raw.time[good], along, (*raw.messages, notes))
        return replace(made, axis=angle)

    def _made(self, time, speed, notes, most=FASTEST, least=-FASTEST) -> FlowSamples:
        """Check samples and return them without gaps."""
        good = np.isfinite(speed) & np.isfinite(time)
        wrong = good & ((speed > most) | (speed < least))
        if np.any(wrong) and self.spikes == "refuse":
            row = int(np.argmax(wrong))
            problem = (
                f"has {speed[row]:.4g} in SI units at t = {time[row]:.6g} s, which no river has"
            )
            remedy = "correct speed_unit, or give spikes: keep to leave such samples out"
            raise InputError(problem, remedy, file=self.file)
        good &= ~wrong
        count = int(np.sum(good))
        if count < FEWEST:
            problem, remedy = f"has {count} samples", f"give {FEWEST} at least"
            raise InputError(problem, remedy, file=self.file)
        time, speed = time[good], speed[good]
        if np.any(np.diff(time) <= 0.0):
            row = int(np.argmax(np.diff(time) <= 0.0)) + 1
            problem = f"has a time that does not rise, {time[row]:.6g} s after the first"
            raise InputError(problem, "sort the rows and keep one of each", file=self.file)
        years, needed = (time[-1] - time[0]) / YEAR, YEARS_301 if most == np.inf else YEARS_201
        first = f"{Path(self.file).name}: {count} samples over {years:.3g} years"
        if count < good.size:
            first += f", {good.size - count} missing"
        if years < 0.98 * needed:
            part = "301" if most == np.inf else "201"
            first += f"; IEC TS 62600-{part} asks for {needed:g} year{'s' * (needed > 1)}"
        return FlowSamples(time - time[0], speed, messages=(first, *filter(None, notes)))

    def occurrence(self):
        speed = self.samples.speed
        return speed, np.full(speed.size, 1.0 / speed.size)

    def binned(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the speeds of bins, m/s, and their shares; reversed flow has bins of its own."""
        speed, found = self.samples.speed, []
        for sign in (1.0, -1.0):
            own = sign * speed[np.sign(speed) == sign if sign < 0.0 else speed >= 0.0]
            if own.size:
                mean, share = in_bins(own, np.full(own.size, 1.0 / speed.size), self.bin_width)
                found.append((sign * mean, share))
        return tuple(np.concatenate(each) for each in zip(*found, strict=True))

    def scatter(self, energies):
        speed = self.samples.speed
        values = np.zeros(speed.size)
        for way, energy in energies.items():
            runs = way * speed >= 0.0
            bins = np.floor(np.abs(speed[runs]) / self.bin_width + SAME).astype(int)
            place = np.unique(bins, return_inverse=True)[1]
            values[runs] += (energy / np.bincount(place))[place]
        return self.samples.scatter(values)

    @property
    def messages(self):
        return (*self.samples.messages, *super().messages)
