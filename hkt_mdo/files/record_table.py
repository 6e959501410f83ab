"""What a record is before it is checked: two columns, in s and m/s, of whichever file."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.units import (
    DISCHARGE_UNITS,
    SPEED_UNITS,
    SPEEDS,
    TIME_UNITS,
    TIMES,
    named_unit,
)

__all__ = ["Columns", "RecordOptions"]

MAX_BYTES = 256 * 1024**2
"""Largest file that is read, in bytes."""

MAX_ROWS = 10_000_000
"""Largest number of samples."""

_LONGEST_NAME = 100
_EXAMPLES = {"time_unit": "time_s or time [h]", "speed_unit": "speed_m_s or v [ft/s]"}


@dataclass(frozen=True)
class RecordOptions:
    """Where in a file the speed is, and what may be done to it; see the case section `record`."""

    time_column: str | None = None  # by default the first, the index, or the only time
    speed_column: str | None = None  # by default the only other
    time_unit: str | None = None  # of `TIME_UNITS`; by default as the name or the file says
    speed_unit: str | None = None  # of `SPEED_UNITS` or `DISCHARGE_UNITS`; the same default
    area: float | None = None  # cross section of the channel for a discharge, m²
    bins: tuple[float, float] | None = None  # range of depth bins to average over, m
    component: str | None = None  # label of a velocity's component; by default horizontal speed
    start: float = 0.0  # s
    duration: float | None = None  # s; by default up to the end
    gaps: str = "refuse"
    longest_gap: float | None = None  # s; by default three samples, and no more than an hour
    spikes: str = "refuse"
    uneven: str = "refuse"
    cutoff: float | None = None  # Hz, of the low-pass; by default half of Nyquist's frequency

    def __post_init__(self) -> None:
        """Refuse a word that is none of its option's."""
        for key, words in {
            "time_unit": (None, *TIME_UNITS),
            "speed_unit": (None, *SPEED_UNITS, *DISCHARGE_UNITS),
            "gaps": ("refuse", "interpolate"),
            "spikes": ("refuse", "replace", "keep"),
            "uneven": ("refuse", "resample"),
        }.items():
            if getattr(self, key) not in words:
                remedy = f"give one of {', '.join(word for word in words if word)}"
                raise self.refuse(key, "unknown", remedy)

    def refuse(self, key: str, problem: str, remedy: str, file: str = "") -> InputError:
        """Return the error of an option that does not fit, perhaps to a file."""
        value = getattr(self, key)
        value = list(value) if isinstance(value, tuple) else value
        return InputError(problem, remedy, file=file, key=key, value=value)


@dataclass(frozen=True, eq=False)
class Columns:
    """Time and speed of a record as they are in the file, but in SI units."""

    file: str
    """Its name; empty for data in memory."""
    columns: tuple[str, str]
    """What messages call the columns of time and speed, such as ``column time_s``."""
    time: np.ndarray
    """Seconds since the first sample, not checked; NaN where a date is missing."""
    speed: np.ndarray
    """Speed, m/s; NaN where a sample is missing."""
    place: Callable[[int], str]
    """place(row) says where a row is, such as ``line 7``."""
    messages: tuple[str, ...] = ()
    """What was done to the numbers."""

    def refuse(self, problem: str, remedy: str, row: int, column: int) -> InputError:
        """Return the error that lies in a row, in the column of the time (0) or the speed (1)."""
        number = float((self.time, self.speed)[column][row])
        key = f"{self.place(row)}, {self.columns[column]}"
        if np.isnan(number):
            return InputError(problem, remedy, file=self.file, key=key)
        value = f"{number:.10g} {('s since the first', 'm/s')[column]}"
        return InputError(problem, remedy, file=self.file, key=key, value=value)


@dataclass(frozen=True)
class Name:
    """A column's name, and the unit that it has as an attribute."""

    name: str
    unit: str = ""

    @property
    def place(self) -> str:
        """What a message calls the column."""
        return f"column {self.name[:_LONGEST_NAME] or '1'}"


def in_si(raw: Columns, names: tuple[Name, Name], dated: bool, options: RecordOptions) -> Columns:
    """Return columns in s and m/s: times are seconds where dated, and else in the file's units."""
    time = raw.time
    if dated and options.time_unit is not None:
        raise InputError(
            f"holds dates, and time_unit is {options.time_unit}",
            "leave time_unit out",
            file=raw.file,
            key=names[0].place,
        )
    if not dated:
        unit = _unit(raw.file, names[0], options.time_unit, TIMES, "time_unit")
        with np.errstate(over="ignore"):  # infinite times are refused later, with their place
            time = (time - time[:1]) * TIME_UNITS[unit]
    factor, notes = _speed_factor(raw.file, names[1], options)
    places = names[0].place, names[1].place
    return Columns(raw.file, places, time, raw.speed * factor, raw.place, (*raw.messages, *notes))


def _unit(file: str, column: Name, given: str | None, spellings: dict[str, str], key: str) -> str:
    """Return a column's unit, which the option `key` or the column itself says."""
    named = named_unit(column.unit, spellings) or named_unit(column.name, spellings)
    if given is None and named is None:
        known = ", ".join(dict.fromkeys(spellings.values()))
        problem = f"has no unit that is known ({known})"
        problem += f": {column.unit}" if column.unit else ""
        remedy = f"give {key}, or name it with its unit, such as {_EXAMPLES[key]}"
    elif given is not None and named not in (None, given):
        problem = f"is in {named} by its own name or attributes, and in {given} by {key}"
        remedy = f"mend {key} or the file, whichever is wrong"
    else:
        return str(given or named)
    raise InputError(problem, remedy, file=file, key=column.place)


def _speed_factor(file: str, column: Name, options: RecordOptions) -> tuple[float, tuple[str, ...]]:
    """Return what brings a speed or a discharge to m/s, and a note of what was done."""
    unit = _unit(file, column, options.speed_unit, SPEEDS, "speed_unit")
    if unit in DISCHARGE_UNITS and options.area is not None:
        note = f"discharge in {unit} over the area of {options.area:g} m2 is the speed"
        return DISCHARGE_UNITS[unit] / options.area, (note,)
    if unit in SPEED_UNITS and options.area is None:
        factor = SPEED_UNITS[unit]
        note = f"speed converted from {unit} to m/s, times {factor:.6g}"
        return factor, () if unit == "m/s" else (note,)
    if unit in DISCHARGE_UNITS:
        problem = f"is a discharge in {unit}, not a speed"
        remedy = "give area, the channel's cross section in m2, or a column of the speed"
    else:
        problem = f"is a speed in {unit}, and area is given for a discharge"
        remedy = "leave area out, or give the column of the discharge"
    raise InputError(problem, remedy, file=file, key=column.place)


def choose(
    names: Sequence[str], default: str | None, options: RecordOptions, file: str
) -> tuple[str, str]:
    """Return the names of the time and the speed column; `default` is the time if none is given."""
    shown = ", ".join([*(name[:_LONGEST_NAME] for name in names[:8]), *["..."][: len(names) > 8]])
    speed = options.speed_column
    time = default if options.time_column is None else options.time_column
    if time is None:
        problem, remedy = "has nothing that is plainly the time", f"give time_column: of {shown}"
        raise InputError(problem, remedy, file=file)
    if speed is None:
        others = [name for name in names if name != time]
        if len(others) != 1:
            raise InputError(
                f"has {len(others) or 'no'} columns besides the time, {time[:_LONGEST_NAME]}",
                f"give speed_column: of {shown}" if others else "add the speed",
                file=file,
            )
        speed = others[0]
    for key, name in (("time_column", time), ("speed_column", speed)):
        found = names.count(name)
        if found != 1 or time == speed:
            near = difflib.get_close_matches(name, names, n=1)
            guess = f"did you mean {near[0]}? " if near and not found else ""
            problem = "is the time" if found == 1 else "is no column"
            problem = "appears twice" if found > 1 else problem
            raise InputError(problem, f"{guess}there are {shown}", file=file, key=key, value=name)
    return time, speed


def check_length(count: int, file: str) -> None:
    """Refuse a record of more than `MAX_ROWS` samples."""
    if count > MAX_ROWS:
        remedy = "give a part of it, or every so many"
        raise InputError(f"has more than {MAX_ROWS:,} samples", remedy, file=file)
