"""Long records of a flow: samples of a speed with its sign, or of a discharge with a rating curve.

Unlike a record that is run over time (`hkt_mdo.dynamics.records`), gaps are left out, the flow may
stand still and turn, and nothing is low-passed.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from hkt_mdo.dynamics import records
from hkt_mdo.dynamics.resource import YEAR, Resource, places_in_bins
from hkt_mdo.errors import InputError
from hkt_mdo.files.record_table import Columns, RecordFile, read_pairs
from hkt_mdo.sections import ExistingFile, Flaws

LONGEST_STILL = 1.0  # days
SPRING_NEAP, FEWEST_BLOCKS = 14.765 * 86400.0, 3  # s: from one spring tide to the next
POINTS_301, YEARS_301, YEARS_201 = 15, 10.0, 1.0  # of IEC TS 62600, as MHKiT's examples quote it
NEAREST, GAP = 25, 1.5  # steps that give the usual one, and how many times longer a gap is
_ANGLE = {"speed_unit": "m/s"} | dict.fromkeys(("component", "second_column", "area"))
"""Options by which angles are read as a speed."""


def span_words(seconds: float) -> str:
    """Return a length of time in the largest unit of which it has two at least."""
    sizes = {"years": YEAR, "days": 86400.0, "hours": 3600.0, "minutes": 60.0, "s": 1.0}
    unit = next((name for name, size in sizes.items() if seconds >= 2.0 * size), "s")
    return f"{seconds / sizes[unit]:.3g} {unit}"


@dataclass(frozen=True, eq=False)
class FlowSamples:
    """Samples of a flow without gaps.

    Attributes
    ----------
    time : np.ndarray
        Since the first sample, s, rising, (n,).
    speed : np.ndarray
        Speed, m/s, negative where the flow runs the other way, (n,).
    messages : tuple of str
        Notes on what was read and how it was processed.
    """

    time: np.ndarray
    speed: np.ndarray
    messages: tuple[str, ...] = ()

    @cached_property
    def gaps(self) -> np.ndarray:
        """Times without samples, s, (n - 1,): by how much a step is longer than the usual one.

        That is the median of the nearest, so that another step is usual from where it begins.
        """
        from scipy.ndimage import median_filter

        steps = np.diff(self.time)
        usual = median_filter(steps, NEAREST, mode="nearest")
        return np.where(steps > GAP * usual, steps - usual, 0.0)

    @cached_property
    def share(self) -> np.ndarray:
        """Share of the time of each sample, (n,): half of the steps beside it, without gaps."""
        steps = np.pad(np.diff(self.time) - self.gaps, 1, mode="edge")
        spans = steps[1:] + steps[:-1]
        return spans / np.sum(spans)

    @property
    def block(self) -> float:
        """Length of a block of the record, s: a year, or of a short one a spring-neap cycle."""
        return YEAR if self.time[-1] / YEAR + 0.01 >= FEWEST_BLOCKS else SPRING_NEAP

    def scatter(self, values: np.ndarray) -> float | None:
        """Return the relative standard uncertainty of the mean of values at the samples, (n,).

        That of the means of equal blocks of the record, which count as independent:
        s/(mean sqrt(n)). None of less than three blocks, and of a mean of zero.
        """
        length = float(self.time[-1])
        count = max(int(length / self.block + 0.01), 1)
        mean = float(self.share @ values)
        block = np.minimum((count * self.time / length).astype(int), count - 1)
        share = np.bincount(block, self.share, count)
        means = np.bincount(block, self.share * values, count)[share > 0.0] / share[share > 0.0]
        if means.size < FEWEST_BLOCKS or not mean:
            return None
        return float(np.std(means, ddof=1) / np.sqrt(means.size) / abs(mean))


class RecordResource(RecordFile, Resource):
    """A long record of the flow, or of a river's discharge with its rating curve.

    Of two components it takes the speed along the principal axis, with its sign.
    """

    profile: Literal["long_record"] = "long_record"
    """The kind of resource."""
    direction_column: str | None = None
    """Column of the direction that the flow runs to, from north to east, in place of a second
    component; in degrees, or in radians if its name says so, as `dir_rad`."""
    rating: ExistingFile | None = None
    """Path of a CSV file `discharge_m3_s,speed_m_s`, for a record of the discharge."""
    rating_degree: Annotated[int, Field(ge=1, le=5)] | None = None
    """Degree of the polynomial fitted to the rating curve; null: straight lines, beyond them the
    last speed."""
    spikes: Literal["refuse", "replace", "keep"] = "refuse"
    """Spikes as of `record`, and a flow of exactly 0 for more than a day: the record is refused; or
    they are left out, with speeds above 20 m/s and discharges below zero; or kept."""

    def flaws(self) -> Flaws:
        yield from super().flaws()
        for key in ("area", "direction_column") if self.rating else ("rating_degree",):
            if getattr(self, key) is not None:
                problem = f"does not go {'with' if self.rating else 'without'} rating"
                yield key, problem, f"leave {'one of them' if self.rating else 'it'} out"

    @cached_property
    def samples(self) -> FlowSamples:
        """The samples of the file."""
        if self.rating is not None:
            return self._of_discharge()
        raw = self._columns()
        if self.direction_column is not None:
            way = self._columns(speed_column=self.direction_column, **_ANGLE)
            if "bins" in way.axes:  # 359 and 1 degree have no mean of 180
                raise self.refuse("direction_column", "has depth bins", "give two components")
            radians = re.search(r"(?i)(\b|_)rad(ian)?s?\W*$", way.units[1] or way.names[1])
            angle = way.speed if radians else np.deg2rad(way.speed)
            raw = replace(raw, parts=raw.speed * np.stack((np.sin(angle), np.cos(angle))))
            if not radians and not np.any(np.abs(way.speed) > 2.0 * np.pi):
                note = f"{way.names[1]} is within 6.3 deg: if these are radians, name it dir_rad"
                raw = replace(raw, messages=(*raw.messages, note))
        return self._made(raw)

    def _columns(self, **others: Any) -> Columns:
        """Return the columns of time and of one quantity, by other options than the keys."""
        return records.read_columns(self.model_copy(update=others))

    def _of_discharge(self) -> FlowSamples:
        """Return the samples of a discharge, and the speed by the rating curve."""
        (discharge, speed, curve), raw = self.rating_curve, self._columns(area=1.0)
        notes = tuple(text for text in raw.messages if "over the area" not in text)
        made = self._made(replace(raw, messages=notes, unit="m3/s"), 0.0, np.inf)
        outside = float(np.mean((made.speed < discharge[0]) | (made.speed > discharge[-1])))
        left = np.sum((curve(discharge) - speed) ** 2) / np.sum((speed - np.mean(speed)) ** 2)
        notes = f"speed by the rating curve of {discharge.size} points, "
        notes += f"degree {self.rating_degree}" if self.rating_degree else "straight lines"
        notes += f", coefficient of determination {1.0 - left:.4f}"
        if discharge.size < POINTS_301:
            notes += f"; IEC TS 62600-301 asks for {POINTS_301} points"
        if outside:
            notes += f"; {100.0 * outside:.3g} % of the samples lie outside of its points"
        speed = np.maximum(curve(made.speed), 0.0)
        return replace(made, speed=speed, messages=(*made.messages, notes))

    @cached_property
    def rating_curve(self) -> tuple[np.ndarray, np.ndarray, Callable]:
        """Discharges (m³/s, rising) and speeds (m/s) of its points, and the curve through them."""
        columns = read_pairs(self.rating, ("discharge_m3_s", "speed_m_s"))
        discharge, speed = (column.values for column in columns)
        order = np.argsort(discharge)
        discharge, speed = discharge[order], speed[order]
        if discharge.size < 2 or np.any(np.diff(discharge) <= 0.0) or np.any(speed < 0.0):
            problem = "is no rating curve"
            remedy = "give two points at least, each discharge once, and speeds of at least 0"
            raise InputError(problem, remedy, file=self.rating)
        if (self.rating_degree or 0) >= discharge.size:
            problem = f"takes more than {discharge.size} points"
            raise InputError(problem, "give a lower one", key="resource.rating_degree")
        if self.rating_degree is None:
            return discharge, speed, partial(np.interp, xp=discharge, fp=speed)
        return discharge, speed, np.polynomial.Polynomial.fit(discharge, speed, self.rating_degree)

    def _made(self, raw: Columns, least=-records.FASTEST, most=records.FASTEST) -> FlowSamples:
        """Return the samples of checked columns without gaps."""
        records.check_order(raw)
        wrong = {"of exactly 0 for over a day": self._standstill(raw)}
        if self.spikes == "replace":
            beyond = "below zero" if least == 0.0 else f"above {most:g} m/s"
            wrong[beyond] = (raw.speed < least) | (raw.speed > most)
        notes = [f"{np.sum(x)} samples {words} left out" for words, x in wrong.items() if np.any(x)]
        speed = np.where(sum(wrong.values()), np.nan, raw.speed)
        whole = replace(raw, speed=speed, messages=(*raw.messages, *notes))
        raw = whole if whole.parts is None else _along_axis(whole)
        spikes, others = records.check_speeds(raw, self.spikes, least, most)
        if raw.parts is not None and np.any(spikes):  # they may have turned the axis
            speed = np.where(spikes, np.nan, whole.speed)
            return self._made(replace(whole, speed=speed, messages=(*whole.messages, *others)))
        good = raw.at(np.flatnonzero(np.isfinite(raw.speed) & ~spikes))
        records.check_order(good)  # whether enough are left
        made = FlowSamples(good.time - good.time[0], good.speed)
        length, missing = made.time[-1], raw.time.size - made.time.size
        first = f"{Path(self.file).name}: {made.time.size} samples over {span_words(length)}"
        if missing:
            first += f", {missing} missing or left out"
        if np.any(made.gaps):
            share = f"{100.0 * np.sum(made.gaps) / length:.2g} % of the time"
            first += f"; gaps are {share}, the longest {span_words(np.max(made.gaps))}"
            first += ": the flow in them counts as that of the samples"
        part, needed = ("301", YEARS_301) if least == 0.0 else ("201", YEARS_201)
        if length < 0.98 * needed * YEAR:
            years = f"{needed:g} year{'s' * (needed > 1)}"
            first += f"; for the hours of each speed IEC TS 62600-{part} asks for {years}"
        return replace(made, messages=(first, *raw.messages, *others))

    def _standstill(self, raw: Columns) -> np.ndarray:
        """Return which samples are of a sensor that gives exactly 0 for a day or more."""
        wrong = np.zeros(raw.speed.size, dtype=bool)
        still = np.diff(raw.speed == 0.0, prepend=False, append=False)
        for begin, end in np.flatnonzero(still).reshape(-1, 2):
            days = (raw.time[end - 1] - raw.time[begin]) / 86400.0
            wrong[begin:end] = days >= LONGEST_STILL and self.spikes != "keep"
            if wrong[begin] and self.spikes == "refuse":
                problem = f"begins {days:.3g} days of exactly 0, such as of a sensor that failed"
                raise raw.refuse(problem, records.SPIKES, begin, 1)
        return wrong

    def occurrence(self):
        return self.samples.speed, self.samples.share

    def scatter(self, energies):
        speed, share = self.occurrence()
        values = np.zeros(speed.size)
        for way, energy in energies.items():
            runs = way * speed >= 0.0
            bins = places_in_bins(np.abs(speed[runs]), self.bin_width)
            values[runs] += (energy / np.bincount(bins, share[runs]))[bins]
        return {"record": self.samples.scatter(values)}

    @property
    def messages(self):
        return (*self.samples.messages, *super().messages)


def _along_axis(raw: Columns) -> Columns:
    """Return columns with the speed along the principal axis of its parts, east and north."""
    good = np.isfinite(raw.speed) & np.all(np.isfinite(raw.parts), axis=0)
    parts = raw.parts[:, good]
    axis = np.linalg.eigh(parts @ parts.T)[1][:, -1]
    axis *= 1.0 if np.sum((axis @ parts) ** 3) >= 0.0 else -1.0
    speed = np.where(good, axis @ raw.parts, np.nan)
    share = float(np.sum(speed[good] ** 2) / max(np.sum(parts**2), 1e-300))
    angle = float(np.rad2deg(np.arctan2(axis[0], axis[1])) % 360.0)
    note = f"principal axis {angle:.1f} deg, with {100.0 * share:.4g} % of the squared speed"
    return replace(raw, speed=speed, messages=(*raw.messages, note))
