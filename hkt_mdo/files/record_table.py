"""What a record is before it is checked: two columns, in s and m/s, of whichever file."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

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
                raise self.refuse(key, "unknown", f"give one of {', '.join(filter(None, words))}")

    def refuse(self, key: str, problem: str, remedy: str, file: str = "") -> InputError:
        """Return the error of an option that does not fit, perhaps to a file."""
        value = getattr(self, key)
        value = list(value) if isinstance(value, tuple) else value
        return InputError(problem, remedy, file=file, key=key, value=value)


def column_key(name: str) -> str:
    """Return what a message calls a column."""
    return f"column {name[:_LONGEST_NAME] or '1'}"


@dataclass(frozen=True, eq=False)
class Columns:
    """Time and speed of a record: as they are in the file, and then in SI units."""

    file: str
    """Its name; empty for data in memory."""
    names: tuple[str, str]
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
        value = {} if np.isnan(number) else {"value": f"{number:.10g} {_SI[column]}"}
        key = f"{self.place(row)}, {column_key(self.names[column])}"
        return InputError(problem, remedy, file=self.file, key=key, **value)

    def in_si(
        self, dated: bool, options: RecordOptions, units: tuple[str, str] = ("", "")
    ) -> Columns:
        """Return the columns in s and m/s; times are in seconds already where they were dates.

        `units` are those that the file says besides its columns' names.
        """
        time, wanted = self.time, options.time_unit
        if dated and wanted is not None:
            problem = f"holds dates, and time_unit is {wanted}"
            key = column_key(self.names[0])
            raise InputError(problem, "leave time_unit out", file=self.file, key=key)
        if not dated:
            unit = self._unit(0, units[0], wanted, "time_unit", TIMES)
            with np.errstate(over="ignore"):  # infinite times are refused later, with their place
                time = (time - time[:1]) * TIME_UNITS[unit]
        unit, area = self._unit(1, units[1], options.speed_unit, "speed_unit", SPEEDS), options.area
        if (unit in DISCHARGE_UNITS) != (area is not None):
            problem = f"is a speed in {unit}, and area is given for a discharge"
            remedy = "leave area out, or give the column of the discharge"
            if area is None:
                problem = f"is a discharge in {unit}, not a speed"
                remedy = "give area, the channel's cross section in m2, or a column of the speed"
            raise InputError(problem, remedy, file=self.file, key=column_key(self.names[1]))
        if area is None:
            factor = SPEED_UNITS[unit]
            note = f"speed converted from {unit} to m/s, times {factor:.6g}"
        else:
            factor = DISCHARGE_UNITS[unit] / area
            note = f"discharge in {unit} over the area of {area:g} m2 is the speed"
        notes = () if unit == "m/s" else (note,)
        return replace(
            self, time=time, speed=self.speed * factor, messages=(*self.messages, *notes)
        )

    def _unit(
        self, column: int, said: str, given: str | None, key: str, spellings: dict[str, str]
    ) -> str:
        """Return a column's unit, which the option `key` or the file says."""
        named = named_unit(said, spellings) or named_unit(self.names[column], spellings)
        if given is None and named is None:
            known = ", ".join(dict.fromkeys(spellings.values()))
            problem = f"has no unit that is known ({known})" + (f": {said}" if said else "")
            example = ("time_s or time [h]", "speed_m_s or v [ft/s]")[column]
            remedy = f"give {key}, or name it with its unit, such as {example}"
        elif given is not None and named not in (None, given):
            problem = f"is in {named} by its own name or attributes, and in {given} by {key}"
            remedy = f"mend {key} or the file, whichever is wrong"
        else:
            return str(given or named)
        raise InputError(problem, remedy, file=self.file, key=column_key(self.names[column]))


_SI = "s since the first", "m/s"


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
            problem = f"has {len(others) or 'no'} columns besides the time, {time[:_LONGEST_NAME]}"
            remedy = f"give speed_column: of {shown}" if others else "add the speed"
            raise InputError(problem, remedy, file=file)
        speed = others[0]
    for key, name in (("time_column", time), ("speed_column", speed)):
        found = names.count(name)
        if found != 1 or time == speed:
            near = difflib.get_close_matches(name, names, n=1)
            guess = f"did you mean {near[0]}? " if near and not found else ""
            problem = ("is no column", "is the time")[found] if found < 2 else "appears twice"
            raise InputError(problem, f"{guess}there are {shown}", file=file, key=key, value=name)
    return time, speed


def check_length(count: int, file: str) -> None:
    """Refuse a record of more than `MAX_ROWS` samples."""
    if count > MAX_ROWS:
        remedy = "give a part of it, or every so many"
        raise InputError(f"has more than {MAX_ROWS:,} samples", remedy, file=file)
