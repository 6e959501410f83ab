"""Measured records of a flow: checked, brought to even samples, and low-passed.

A record of a flow in which no turbine could work is refused with file, place and remedy. Nothing is
repaired unless an option says so, and every repair is named in its messages.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from hkt_mdo.dynamics.flows import FASTEST
from hkt_mdo.dynamics.sampled import SampledInflow
from hkt_mdo.errors import InputError
from hkt_mdo.files.record_json import read_json
from hkt_mdo.files.record_table import LONGEST, Columns, RecordFile, read_csv
from hkt_mdo.files.record_xarray import read_netcdf, read_parquet
from hkt_mdo.files.table import file_state
from hkt_mdo.messages import validated
from hkt_mdo.sections import Quantity

MIN_SAMPLES = 16
"""Smallest number of samples that make a record."""

SPIKES = "give spikes: replace to leave such samples out, or spikes: keep if that is the flow"
"""Remedy of samples that a sensor most likely got wrong."""

SPIKE = 6.0
"""Least distance of a spike from the median of the samples around it, in units of their spread."""

REPAIRS = {"spikes": "replace", "gaps": "interpolate", "uneven": "resample"}
"""The value of each option that allows a repair."""

MAX_ROWS = 10_000_000
"""Largest number of even samples."""

SHORTEST = 1e-6
"""Step, s, below which no flow is sampled."""

AVERAGED, NOISY = 600.0, 0.01
"""Time, s, of a mean vector, and the share by which speeds above it are told to be noise."""

UNEVEN = 0.05
"""Share of a step by which a sample may be off its even time."""

_OTHERS = {"eastward": "northward", "east": "north", "e": "n", "u": "v", "x": "y"}
_OTHERS |= {other: name for name, other in _OTHERS.items()}  # words for two components
_COMPONENT = re.compile(rf"(.*(?<![a-z]))({'|'.join(_OTHERS)})(?![a-z])")

_READERS = dict.fromkeys((".csv", ".txt"), ("CSV", read_csv)) | {".json": ("JSON", read_json)}
_READERS |= dict.fromkeys((".nc", ".nc4", ".cdf"), ("NetCDF", read_netcdf))
_READERS |= dict.fromkeys((".parquet", ".pq"), ("Parquet", read_parquet))


class RecordInflow(RecordFile, SampledInflow):
    """A measured flow: the samples of a file, low-passed, with a cubic spline through them.

    It is repaired only where a key allows it; every repair is reported (docs/flows.md).
    """

    profile: Literal["record"] = "record"
    """The kind of flow."""
    start: Annotated[float, Quantity("s", ge=0)] = 0.0
    """Time in the record, from its first sample, that becomes t = 0."""
    duration: Annotated[float, Quantity("s", gt=0)] | None = None
    """Length of the part that is taken; null: up to the record's end."""
    gaps: Literal["refuse", "interpolate"] = "refuse"
    """Missing samples: the record is refused, or gaps up to `longest_gap` are interpolated."""
    longest_gap: Annotated[float, Quantity("s", gt=0, le=3600)] | None = None
    """Longest gap that may be interpolated; null: three samples, at most an hour."""
    spikes: Literal["refuse", "replace", "keep"] = "refuse"
    """Up to three samples that differ strongly from their neighbours: the record is refused, or
    they are interpolated or kept."""
    uneven: Literal["refuse", "resample"] = "refuse"
    """Uneven steps: the record is refused, or interpolated at the median step."""
    cutoff: Annotated[float, Quantity("Hz", gt=0)] | None = None
    """Cutoff of the low-pass, without phase shift; null: half of Nyquist's frequency."""
    scale: Annotated[float, Quantity(gt=0)] = 1.0
    """Factor on all speeds."""

    @cached_property
    def _record(self) -> Columns:
        """Even samples from t = 0, positive and low-passed, read once for equal options."""
        return _read(self, file_state(self.file))

    def samples(self):
        return self._record.time, self.scale * self._record.speed, "not-a-knot"

    @property
    def length(self):
        return float(self._record.time[-1])

    last_time = length

    @property
    def highest_frequency(self):
        return self.cutoff or 0.25 / float(self._record.time[1])

    @property
    def mean_speed(self):
        return self.scale * float(np.mean(self._record.speed))

    @property
    def messages(self):
        return self._record.messages


@lru_cache(maxsize=2)  # a case is built more than once, and reading takes longest
def _read(flow: RecordInflow, state: object) -> Columns:
    """Return the record of a flow; one that needs several repairs is refused with all of them."""
    raw = read_columns(flow)

    def tried(**allowed: str) -> Columns | InputError:
        try:
            return _made(raw, flow.model_copy(update=allowed))
        except InputError as error:
            return error

    record = tried()
    if isinstance(record, Columns):
        return record
    every = {key: word for key, word in REPAIRS.items() if getattr(flow, key) == "refuse"}
    if isinstance(tried(**every), Columns):
        needed = [key for key in every if isinstance(tried(**every | {key: "refuse"}), InputError)]
        if len(needed) > 1:
            repairs = ", ".join(f"{key}: {every[key]}" for key in needed)
            record.remedy += f"; the whole record needs {repairs}"
    raise record


def read_record(path: str | Path, **options: Any) -> Columns:
    """Read a record from a CSV, JSON, NetCDF or Parquet file; the ending says which.

    `.csv` or `.txt`: a header line, commas, UTF-8; empty cells and `nan` are gaps. `.json`: tidal
    data as MHKiT saves them, or a response of USGS. `.nc`, `.nc4` or `.cdf`, `.parquet` or `.pq`:
    as MHKiT's data are saved. The options are the keys of `RecordInflow`. Times are even,
    from 0 s, and speeds, m/s, low-passed; `messages` say what was done. Raises InputError, with
    file, line, column, value and remedy, if anything in the file is not as they say, it has more
    than 256 MiB, or packages for NetCDF or Parquet are missing.
    """
    keys = {"file": str(path)} | options
    return validated(RecordInflow, keys, "", context={"check_files": False})._record


def read_columns(options: RecordFile) -> Columns:
    """Return the columns of a record as they stand in its file, in SI units.

    Parameters
    ----------
    options : RecordFile
        The file, whose ending says which of `_READERS` reads it, and its columns.

    Returns
    -------
    Columns
        Times and speeds, neither checked nor repaired.

    Raises
    ------
    InputError
        If the ending is unknown, the file is broken, whatever that makes a library raise, or it is
        not as the options say.
    """
    path = Path(options.file)
    ending = path.suffix
    if ending.lower() not in _READERS:
        problem = f"has the file extension {ending}" if ending else "has no file extension"
        raise InputError(problem, f"name it {', '.join(_READERS)}, by its format", file=path)
    kind, reader = _READERS[ending.lower()]
    try:
        return _with_parts(reader, options)
    except Exception as error:
        if isinstance(error, InputError) or kind == "CSV":
            raise
        reason = re.sub(r"\s+", " ", str(error))[:120] or type(error).__name__
        problem = f"cannot be read as {kind} ({reason})"
        raise InputError(problem, "write the file anew, or as CSV", file=path) from None


def _with_parts(read: Callable[[RecordFile], Columns], options: RecordFile) -> Columns:
    """Return columns with the speed of two components, and a note where noise adds to it.

    The speed of a vector with noise is too large on average (Rice's distribution), unlike the
    vector's mean.
    """
    raw, messages = read(options).in_si(options), []
    if options.second_column == raw.names[1]:
        raise options.refuse("second_column", "is the first one", "give the other one")
    if options.second_column is not None:
        other = options.model_copy(update={"speed_column": options.second_column})
        second = read(other).in_si(other)
        messages.append(f"horizontal speed of {raw.names[1]} and {second.names[1]}")
        parts = np.stack((raw.speed, second.speed))
        raw = replace(raw, speed=np.hypot(*parts), parts=parts)
    elif raw.parts is None:
        other = _COMPONENT.sub(lambda match: match[1] + _OTHERS[match[2]], raw.names[1].lower())
        text = f"{raw.names[1]} alone is the speed: if it is a component, give second_column: "
        messages += [text + name for name in raw.names[2:] if name.lower() == other]
    if raw.parts is not None:
        good = np.isfinite(raw.time) & (raw.speed <= FASTEST)  # no gaps, nor what marks them
        _, block = np.unique(raw.time[good] // AVERAGED, return_inverse=True)
        mean = np.sum(np.hypot(*(np.bincount(block, part[good]) for part in raw.parts)))
        if (above := np.sum(raw.speed[good]) - mean) > NOISY * mean:
            text = f"speeds are on average {100.0 * above / mean:.2g} % above those of their mean "
            text += f"vectors over {AVERAGED / 60.0:g} min: if they are single pings of an ADCP, "
            messages.append(text + "average the components first, or take that along the flow")
    return replace(raw, messages=(*raw.messages, *messages))


def check_order(raw: Columns) -> None:
    """Refuse a record that is too short, lacks a time, or whose times do not rise plausibly."""
    time = raw.time
    if time.size < MIN_SAMPLES:
        problem = f"has {_count(time.size, 'sample')}"
        raise InputError(problem, f"give {MIN_SAMPLES} at least", file=raw.file)
    for row in np.flatnonzero(~np.isfinite(time))[:1]:
        raise raw.refuse("is no time", "give a time for every sample", row, 0)
    for row in np.flatnonzero(np.abs(time) > LONGEST)[:1]:
        remedy = "correct it or the first time, or time_unit"
        raise raw.refuse(f"is more than {LONGEST:g} s from the first time", remedy, row, 0)
    for row in np.flatnonzero(np.diff(time) <= 0.0)[:1]:
        after = "also the time of" if time[row + 1] == time[row] else "before"
        remedy = "sort the rows by time and keep one of each; if the clock was changed, give "
        remedy += "dates with their zone"
        raise raw.refuse(f"is {after} {raw.place(row)}", remedy, row + 1, 0)
    if (step := float(np.median(np.diff(time)))) < SHORTEST:
        problem = f"is where steps of {step:.3g} s begin, and {SHORTEST:g} s are the shortest"
        raise raw.refuse(problem, "correct the times, or time_unit", 0, 0)


def check_speeds(
    raw: Columns, choice: str, least: float = -FASTEST, most: float = FASTEST
) -> tuple[np.ndarray, list[str]]:
    """Return which samples are spikes that are to be left out, and notes about them.

    Spikes are refused if the choice is ``refuse``, and part of the flow if it is ``keep``; samples
    below `least` and above `most` that are no spikes are always refused.
    """
    speed, spikes = raw.speed, np.zeros(raw.speed.size, dtype=bool)
    present, notes = np.flatnonzero(np.isfinite(speed)), []
    if choice != "keep" and present.size >= MIN_SAMPLES:
        spikes[present[find_spikes(speed[present])]] = True
    rows = np.flatnonzero(spikes)
    if rows.size and choice == "refuse":
        others = f", and {rows.size - 1} more do" if rows.size > 1 else ""
        problem = f"differs from its neighbours like a spike{others}"
        raise raw.refuse(problem, SPIKES, int(rows[0]), 1)
    if rows.size:
        text = f"{_count(rows.size, 'spike')} replaced ({100.0 * np.mean(spikes):.2g} %)"
        notes.append(f"{text}, at t = {_times(raw.time[rows])}")
    for row in np.flatnonzero(((speed > most) | (speed < least)) & ~spikes)[:1]:
        problem = f"is faster than any river, {FASTEST:g} m/s" if most == FASTEST else "is negative"
        remedy = "correct speed_unit, or leave cells empty where samples are missing"
        raise raw.refuse(problem, remedy, row, 1)
    return spikes, notes


def _made(raw: Columns, options: RecordInflow) -> Columns:
    """Return the record of columns: checked, cut, repaired as far as allowed, low-passed."""
    check_order(raw)
    raw = _cut(raw, options)
    spikes, notes = check_speeds(raw, options.spikes)
    even = _even(replace(raw, messages=(*raw.messages, *notes)), options, spikes)
    step = float(even.time[1])
    nyquist, slowest = 0.5 / step, 1.0 / even.time[-1]
    cutoff = 0.5 * nyquist if options.cutoff is None else options.cutoff
    if not slowest <= cutoff < nyquist:
        problem = f"must lie between {slowest:.4g} Hz, one wave in the record, and "
        problem += f"{nyquist:.4g} Hz, half the sampling rate"
        remedy = "give another cutoff, or none for half of the upper one"
        raise options.refuse("cutoff", problem, remedy)
    smooth, variance = low_pass(even.speed, step, cutoff), float(np.var(even.speed))
    along, where = smooth, ""
    if even.parts is not None:
        mean = np.mean(even.parts, axis=1)
        along = low_pass(mean @ even.parts / max(np.hypot(*mean), 1e-9), step, cutoff)
        where = " along its mean direction"
    low = int(np.argmin(along))
    if not along[low] > 0.0:
        row = min(int(np.searchsorted(raw.time, low * step)), raw.time.size - 1)
        problem = f"falls to {along[low]:.3g} m/s{where} when low-passed: the flow stops or "
        remedy = "choose a part by start and duration, lower the cutoff, or correct the sign"
        raise raw.refuse(f"{problem}reverses", remedy, row, 1)
    summary = f"{Path(raw.file).name}: {_count(smooth.size, 'sample')} every {step:.6g} s, mean "
    summary += f"{smooth.mean():.4g} m/s, from {smooth.min():.4g} to {smooth.max():.4g} m/s"
    removed = 1.0 - float(np.var(smooth)) / variance if variance > 0.0 else 0.0
    note = f"low-passed at {cutoff:.4g} Hz, which removed {100.0 * removed:.2g} % of the variance"
    return replace(even, speed=smooth, parts=None, messages=(summary, *even.messages, note))


def _cut(raw: Columns, options: RecordInflow) -> Columns:
    """Return the rows from start to start + duration, times anew from 0."""
    time, start, last = raw.time, options.start, raw.time[-1]
    end = last if options.duration is None else start + options.duration
    near = 1e-9 * (1.0 + last)
    rows = np.flatnonzero((time >= start - near) & (time <= end + near))
    if rows.size < MIN_SAMPLES or end > last + near:
        problem = f"takes {_count(rows.size, 'sample')} between {start:.6g} s and {end:.6g} s of a "
        problem += f"record that ends at {last:.6g} s"
        remedy = f"take {MIN_SAMPLES} samples at least, and no time after its end"
        key = "start" if options.duration is None or start > last else "duration"
        raise options.refuse(key, problem, remedy)
    if rows.size == time.size:
        return raw
    note = f"taken from {time[rows[0]]:.6g} s to {time[rows[-1]]:.6g} s of the record"
    part = raw.at(rows)
    return replace(part, time=part.time - part.time[0], messages=(*raw.messages, note))


def _even(raw: Columns, options: RecordInflow, spikes: np.ndarray) -> Columns:
    """Return the columns at even times, without overshoot between the samples, and notes."""
    from scipy.interpolate import PchipInterpolator

    step, index, miss = _grid(raw.time)
    count = int(index[-1]) + 1
    uneven = np.flatnonzero(miss > UNEVEN * step)
    if uneven.size and options.uneven == "refuse":
        problem = f"is {miss[uneven[0]]:.3g} s off an even spacing of {step:.6g} s"
        remedy = "give uneven: resample to interpolate at even times"
        raise raw.refuse(problem, remedy, uneven[0], 0)
    time, notes = raw.time, []
    if uneven.size:
        step = float(np.median(np.diff(time)))
        count = int(time[-1] / step * (1.0 + 1e-12)) + 1
        off = f"samples were up to {np.max(miss):.3g} s off even times"
        notes.append(f"resampled every {step:.6g} s: {off}")
    longest = _longest_gap(raw, options, step, uneven.size > 0)
    if count > MAX_ROWS:
        problem = f"has {count:,} even samples, and {MAX_ROWS:,} are the most"
        raise InputError(problem, "choose a part of it by start and duration", file=raw.file)
    if not uneven.size:
        time = step * index
        if np.max(miss) > 1e-3 * step:
            share = f"{100.0 * np.max(miss) / step:.2g} % of a step off"
            notes.append(f"times taken as even: they are up to {share}")
        gaps = np.ones(count, dtype=bool)
        gaps[index[np.isfinite(raw.speed)].astype(np.intp)] = False
        begins = np.flatnonzero(gaps & ~np.append(False, gaps[:-1]))
        if begins.size:
            share = f"{100.0 * np.mean(gaps):.2g} %"
            missing = f"{_count(int(np.sum(gaps)), 'sample')} ({share})"
            text = f"{_count(begins.size, 'gap')} interpolated, {missing}, the longest "
            notes.append(f"{text}{longest:.6g} s, at t = {_times(step * begins)}")
    good = np.isfinite(raw.speed) & ~spikes
    times, at = time[good], step * np.arange(count)
    values = np.stack((raw.speed, *(() if raw.parts is None else raw.parts)))[:, good]
    speed, *parts = PchipInterpolator(times, values, axis=1)(np.clip(at, times[0], times[-1]))
    parts, messages = np.array(parts) if parts else None, (*raw.messages, *notes)
    return replace(raw, time=at, speed=speed, parts=parts, messages=messages)


def _longest_gap(raw: Columns, options: RecordInflow, step: float, resample: bool) -> float:
    """Return the longest gap, s; refuse one that may not be interpolated.

    Where samples are uneven, all of them are interpolated, and only the longest gap counts.
    """
    present = np.isfinite(raw.speed)
    for row, key in ((0, "start"), (present.size - 1, "duration")):
        if not present[row]:
            problem = "is missing at an end of the record, where nothing can be interpolated"
            raise raw.refuse(problem, f"leave it out by {key}", row, 1)
    rows = np.flatnonzero(present)
    missing = np.diff(raw.time[rows]) - step
    longest = options.longest_gap or min(3.0 * step, 3600.0)
    allowed = longest + 0.1 * step
    refused = missing > (allowed if options.gaps == "interpolate" or resample else 0.5 * step)
    if options.gaps == "refuse":
        refused |= np.diff(rows) > 1
    for gap in np.flatnonzero(refused)[:1]:
        problem, remedy = f"is at a gap of {missing[gap]:.6g} s", "give gaps: interpolate"
        if missing[gap] > allowed:
            problem += f", and no more than {longest:.6g} s may be interpolated"
            remedy = "give a longest_gap of up to an hour"
        remedy += ", or choose a part without it by start and duration"
        row = int(rows[gap]) + 1  # which lacks a speed, or whose time is the end of the gap
        raise raw.refuse(problem, remedy, row, int(not present[row]))
    return float(np.max(missing))


def _grid(time: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the step of even samples with gaps, each one's place, and how far (s) it is off it."""
    steps = np.diff(time)
    median = float(np.quantile(steps, 0.5, method="lower"))  # one of the steps
    # the mean of the steps without gaps, since times may be rounded: 0.03, 0.07, 0.10
    usual = float(np.mean(steps[np.abs(steps - median) <= 0.5 * median]))
    index = np.concatenate(([0.0], np.cumsum(np.maximum(np.rint(steps / usual), 1.0))))
    step = float(time[-1] / index[-1])
    return step, index, np.abs(time - step * index)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' if number != 1 else ''}"


def _times(times: np.ndarray) -> str:
    shown = ", ".join(f"{time:.6g}" for time in times[:5])
    return f"{shown}{', ...' if times.size > 5 else ''} s"


def find_spikes(speed: np.ndarray) -> np.ndarray:
    """Return which samples of speed[n], n >= 16 and finite, are spikes, by a Hampel filter.

    A sample is one if it is farther from the median of the seven around it than `SPIKE` times
    their spread, and `SPIKE` times the usual difference of neighbours among the 51 around it; both
    are 1.4826 times a median absolute deviation (Davies and Gather 1993; Pearson 2002). The samples
    left are filtered again, until there are none: so two or three bad samples in a row are found.
    Gusts, steps and crests of waves are no spikes, since their neighbours follow them.
    """
    left, far = np.arange(speed.size), np.ones(speed.size, dtype=bool)
    while np.any(far) and left.size >= MIN_SAMPLES:
        far = _stand_off(np.clip(speed[left], -1e6, 1e6))  # so that absurd speeds do not overflow
        left = left[~far]
    return ~np.isin(np.arange(speed.size), left)


def _stand_off(speed: np.ndarray) -> np.ndarray:
    """Return which samples are far from the median of the seven around them."""
    from scipy.ndimage import median_filter, minimum_filter

    half = 3
    steps = np.abs(np.diff(speed, append=speed[-1]))
    # Samples of few digits differ mostly by zero: a step of the last digit is no spike, unless it
    # is more than a hundredth of the speed.
    digit = minimum_filter(np.where(steps > 0.0, steps, np.inf), 51)
    digit = np.minimum(digit, 0.01 * np.median(np.abs(speed)))
    usual = np.maximum(1.4826 * median_filter(steps, 51), digit)
    # the first and the last samples are compared with the first and the last seven
    centres = np.clip(np.arange(speed.size), half, speed.size - 1 - half)
    off = np.abs(speed - median_filter(speed, 2 * half + 1)[centres])
    suspects = np.flatnonzero(off > SPIKE * usual)
    around = np.lib.stride_tricks.sliding_window_view(speed, 2 * half + 1)[centres[suspects] - half]
    spread = np.median(np.abs(around - np.median(around, axis=1, keepdims=True)), axis=1)
    far = np.zeros(speed.size, dtype=bool)
    far[suspects] = off[suspects] > SPIKE * 1.4826 * spread
    return far


def low_pass(speed: np.ndarray, step: float, cutoff: float) -> np.ndarray:
    """Return even samples low-passed without shift: amplitudes times 1 / (1 + (f/cutoff)^8).

    That is Butterworth's filter of fourth order, forwards and backwards; an amplitude is halved at
    the cutoff (Hz). Samples speed[n] are `step` seconds apart. The record is continued
    point-symmetrically about its ends, which keeps their value and slope: the straight line through
    the two ends passes as it is, the rest as a sum of sines.
    """
    from scipy.fft import dst, idst

    count = speed.size - 1
    line = speed[0] + (speed[-1] - speed[0]) * np.arange(count + 1) / count
    frequency = np.arange(1, count) / (2.0 * count * step)
    sines = dst((speed - line)[1:-1], type=1)
    return line + np.pad(idst(sines / (1.0 + (frequency / cutoff) ** 8), type=1), 1)
