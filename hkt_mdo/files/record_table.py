"""Columns of time and speed of a record, in s and m/s, before gaps and spikes are checked."""

import re
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from hkt_mdo.errors import InputError, did_you_mean
from hkt_mdo.files.shipped import SPELLINGS
from hkt_mdo.files.table import LONGEST_NAME, MAX_RECORD_BYTES, Column, Csv, parse_number, read_text
from hkt_mdo.sections import ExistingFile, Pair, Quantity, Section

_MISSING = {"", "nan", "na", "n/a", "null", "none"}  # cells of missing samples, in small letters
_MOST_NAMES = 8  # that a message lists

LONGEST = 1e10
"""Longest time, s, some 300 years: a later one is a mistake."""

_AXES = {"component": "components", "bins": "depth bins"}  # by the key that chooses along each

# Problem and remedy of a cell.
_NO_NUMBER = "must be a finite number", "write it with a decimal point, no unit"
_NO_SPEED = _NO_NUMBER[0], f"{_NO_NUMBER[1]}; leave the cell empty where the sample is missing"
_NO_DATE = (
    "is neither a number nor a date",
    "write times as numbers, or as 2024-05-01T12:00:00.0 with or without a zone",
)
_MIXED_ZONES = "has a zone and others have none, or the other way round", "write all dates alike"

# Units --------------------------------------------------------------------------------------------

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
TIME_UNITS |= {"min": 60.0, "h": 3600.0, "days": 86400.0}
"""Seconds in each unit of time."""

SPEED_UNITS = {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001, "km/h": 1 / 3.6, "ft/s": 0.3048}
SPEED_UNITS |= {"knot": 1852 / 3600, "mph": 0.44704}
"""m/s in each unit of speed."""

DISCHARGE_UNITS = {"m3/s": 1.0, "L/s": 0.001, "ft3/s": 0.3048**3}
"""m³/s in each unit of discharge."""

_FORMS = ("{}/s", "{}/sec", "{}_s-1", "{}_s", "{}_per_s", "{}_per_second")

TIMES = {word: unit for unit, words in SPELLINGS["time"].items() for word in words}
"""The unit of time behind each spelling."""

SPEEDS = {word: unit for unit, words in SPELLINGS["whole"].items() for word in words} | {
    form.format(word): unit
    for unit, words in SPELLINGS["per_second"].items()
    for word in words
    for form in _FORMS
}
"""The unit of speed or discharge behind each spelling, words joined by underscores."""


def named_unit(name: str, spellings: dict[str, str]) -> str | None:
    """Return the unit that a column's name or attribute ends with, as in `v [m/s]` or `v_m_s`.

    Parameters
    ----------
    name : str
        Name or attribute.
    spellings : dict of str to str
        `TIMES` or `SPEEDS`.

    Returns
    -------
    str or None
        The unit; None if there is none of these.
    """
    text = re.sub(r"\*\*|\^", "", name.strip().lower().replace("³", "3"))
    bracket = re.search(r"[\[(]([^\[\]()]*)[\])]$", text)
    text = bracket[1] if bracket else text.rpartition(",")[2]
    words = re.split(r"[\s_.·]+", text.strip())
    for first in range(len(words)):  # the longest ending that is a unit: m_s, not s
        ending = "_".join(words[first:])
        if ending in SPEEDS or ending in TIMES:
            return spellings.get(ending)
    return None


# Columns ------------------------------------------------------------------------------------------


class RecordFile(Section):
    """A file of samples over time, and its columns."""

    file: ExistingFile
    """Path of the record: `.csv` with a header line, `.json` of MHKiT or USGS, `.nc` or `.parquet`
    (needs `hkt_mdo[records]`)."""
    time_column: str | None = None
    """Column or variable of the time; null: the first column of a CSV file, the index of a Parquet
    file, that of the speed in NetCDF."""
    speed_column: str | None = None
    """Column or variable of the speed; null: the only one besides the time."""
    second_column: str | None = None
    """Column of the other horizontal component, north where `speed_column` is east."""
    time_unit: Literal[(*TIME_UNITS,)] | None = None
    """Unit of times that are numbers; null: as in the column's name, such as `time_s`. Dates need
    none."""
    speed_unit: Literal[(*SPEED_UNITS, *DISCHARGE_UNITS)] | None = None
    """Unit of the speed or discharge; null: as in the column's name."""
    area: Annotated[float, Quantity("m**2", gt=0)] | None = None
    """Cross section of the channel, for a record of the discharge: speed = discharge / area."""
    bins: Pair[Annotated[float, Quantity("m")]] | None = None
    """Depth bins of a profiler that are averaged, [lower, upper]."""
    component: str | None = None
    """Velocity component to use, such as `E`, or two, such as `E,N`; null: the first two."""

    def refuse(self, key: str, problem: str, remedy: str) -> InputError:
        """Return the error of a key.

        Parameters
        ----------
        key : str
            Name of the key.
        problem, remedy : str
            As of `InputError`.

        Returns
        -------
        InputError
            To be raised.
        """
        value = getattr(self, key)
        value = list(value) if isinstance(value, tuple) else value
        return InputError(problem, remedy, file=self.file, key=key, value=value)


def column_key(name: str) -> str:
    """Return what a message calls a column.

    Parameters
    ----------
    name : str
        Name of the column; may be empty.

    Returns
    -------
    str
        The key of an `InputError`.
    """
    return f"column {name[:LONGEST_NAME] or '1'}"


@dataclass(frozen=True, eq=False)
class Columns:
    """Time and speed of a record: as they are in the file, and then in SI units."""

    file: str
    """Its name."""
    names: tuple[str, ...]
    """Names of the time and the speed, and of other columns."""
    time: np.ndarray
    """Seconds since the first sample, not checked; NaN where a date is missing, (n_samples,)."""
    speed: np.ndarray
    """Speed, m/s; NaN where a sample is missing, shape (n_samples,)."""
    place: Callable[[int], str] = lambda row: f"row {row + 1}"
    """place(row) says where a row is, such as ``line 7``."""
    messages: tuple[str, ...] = ()
    """Notes on how the numbers were changed."""
    parts: np.ndarray | None = None
    """Two horizontal components of the velocity, m/s, shape (2, n_samples), where known."""
    unit: str = "m/s"
    """SI unit of the speed, or of a discharge in its place."""
    units: tuple[str, str] = ("", "")
    """Units of time and speed by the file's attributes, besides the names of the columns."""
    dated: bool = False
    """Whether the times were dates, and are in seconds already."""
    axes: tuple[str, ...] = ()
    """Keys of `RecordFile` that have chosen along an axis of the file."""

    def refuse(self, problem: str, remedy: str, row: int, column: int) -> InputError:
        """Return the error of a sample.

        Parameters
        ----------
        problem, remedy : str
            As of `InputError`.
        row : int
            Index of the sample.
        column : int
            0 for its time, 1 for its speed.

        Returns
        -------
        InputError
            To be raised.
        """
        number = float((self.time, self.speed)[column][row])
        unit = ("s since the first", self.unit)[column]
        value = {} if np.isnan(number) else {"value": f"{number:.10g} {unit}"}
        key = f"{self.place(row)}, {column_key(self.names[column])}"
        return InputError(problem, remedy, file=self.file, key=key, **value)

    def at(self, rows: np.ndarray) -> "Columns":
        """Return the columns of some rows.

        Parameters
        ----------
        rows : np.ndarray
            Their indices, in the order that they are to have.

        Returns
        -------
        Columns
            The columns.
        """
        place, time, speed = self.place, self.time[rows], self.speed[rows]
        part = replace(self, time=time, speed=speed, place=lambda row: place(rows[row]))
        return part if self.parts is None else replace(part, parts=self.parts[:, rows])

    def in_si(self, options: RecordFile) -> "Columns":
        """Return the columns in s and m/s.

        Parameters
        ----------
        options : RecordFile
            Units that are given, and the area for a discharge.

        Returns
        -------
        Columns
            The columns, and a message if the speed was converted.

        Raises
        ------
        InputError
            If a unit is unknown or contradicts an option, or an option has no use.
        """
        for key, what in _AXES.items():
            if key not in self.axes and getattr(options, key) is not None:
                raise options.refuse(key, f"is given for a record without {what}", "leave it out")
        if self.dated and options.time_unit is not None:
            problem = f"holds dates, and time_unit is {options.time_unit}"
            raise self.refuse_column(0, problem, "leave time_unit out")
        scale = 1.0 if self.dated else TIME_UNITS[self._unit(0, options)]
        # times may be counted from year 0, in minutes and longer units from before
        if scale <= 1.0 and np.any(np.abs(self.time[:1]) * scale > 10.0 * LONGEST):
            problem = f"begins at {self.time[0] * scale:.6g} s, more than 3000 years"
            raise self.refuse_column(0, problem, "correct its unit, such as time_ms")
        unit, area = self._unit(1, options), options.area
        if (unit in DISCHARGE_UNITS) != (area is not None):
            problem = f"is a speed in {unit}, and area is given for a discharge"
            remedy = "leave area out, or give the column of the discharge"
            if area is None:
                problem = f"is a discharge in {unit}, not a speed"
                remedy = "give area, in m2, a long_record's rating, or a column of the speed"
            raise self.refuse_column(1, problem, remedy)
        factor = (SPEED_UNITS | DISCHARGE_UNITS)[unit] / (area or 1.0)
        note = f"speed converted from {unit} to m/s, times {factor:.6g}"
        if area is not None:
            note = f"discharge in {unit} over the area of {area:g} m2 is the speed"
        messages = self.messages if unit == "m/s" else (*self.messages, note)
        with np.errstate(over="ignore"):  # what overflows is refused later, with its row
            time, speed = (self.time - self.time[:1]) * scale, self.speed * factor
        parts = None if self.parts is None else self.parts * factor
        return replace(self, time=time, speed=speed, parts=parts, messages=messages)

    def _unit(self, column: int, options: RecordFile) -> str:
        """Return a column's unit, which an option, an attribute in the file or its name states."""
        key, spellings = (("time_unit", TIMES), ("speed_unit", SPEEDS))[column]
        option, attribute = getattr(options, key), self.units[column]
        named = named_unit(attribute, spellings) or named_unit(self.names[column], spellings)
        if option is None and named is None:
            units = ", ".join(dict.fromkeys(spellings.values()))
            problem = f"has no unit that is known ({units})" + (attribute and f": {attribute}")
            example = ("time_s or time [h]", "speed_m_s or v [ft/s]")[column]
            remedy = f"give {key}, or name it with its unit, such as {example}"
            raise self.refuse_column(column, problem, remedy)
        if option is not None and named not in (None, option):
            problem = f"is in {named} by its own name or attributes, and in {option} by {key}"
            remedy = f"correct {key} or the file, whichever is wrong"
            raise self.refuse_column(column, problem, remedy)
        return str(option or named)

    def refuse_column(self, column: int, problem: str, remedy: str) -> InputError:
        """Return the error of a column.

        Parameters
        ----------
        column : int
            0 for the time, 1 for the speed.
        problem, remedy : str
            As of `InputError`.

        Returns
        -------
        InputError
            To be raised.
        """
        return InputError(problem, remedy, file=self.file, key=column_key(self.names[column]))


def choose(names: Sequence[str], default: str | None, options: RecordFile) -> tuple[str, ...]:
    """Return the names of the time and the speed column, and of the others.

    Parameters
    ----------
    names : sequence of str
        Names of all columns.
    default : str or None
        The time where the options name none.
    options : RecordFile
        Their `time_column` and `speed_column`.

    Returns
    -------
    tuple of str
        Names of the time, of the speed, and of the others.

    Raises
    ------
    InputError
        If either is not clear, is no column, or is one of two columns of that name.
    """
    time = default if options.time_column is None else options.time_column
    others = [name for name in names if name != time]
    if time is None:
        problem = "has nothing that is clearly the time"
        raise InputError(problem, f"give time_column: of {_listed(names)}", file=options.file)
    speed = options.speed_column
    if speed is None:
        if len(others) != 1:
            problem = f"has {len(others) or 'no'} columns besides the time, {time[:LONGEST_NAME]}"
            remedy = "add the speed after a comma; lines of text above the header begin with #"
            remedy = f"give speed_column: of {_listed(others)}" if others else remedy
            raise InputError(problem, remedy, file=options.file)
        speed = others[0]
    for key, name in (("time_column", time), ("speed_column", speed)):
        count = names.count(name)
        if count != 1 or time == speed:
            problem = ("is no column", "is the time")[count] if count < 2 else "appears twice"
            remedy = f"{'' if count else did_you_mean(name, names)}there are {_listed(names)}"
            raise InputError(problem, remedy, file=options.file, key=key, value=name)
    return time, speed, *(name for name in others if name != speed)


def _listed(names: Sequence[str]) -> str:
    """Return the first of some names."""
    cut = [name[:LONGEST_NAME] for name in names[:_MOST_NAMES]]
    listed = [name if name and "," not in name else f"'{name}'" for name in cut]
    return ", ".join(listed + ["..."] * (len(names) > _MOST_NAMES))


def read_csv(options: RecordFile) -> Columns:
    """Read time and speed from two columns of a CSV file.

    Parameters
    ----------
    options : RecordFile
        The file, which columns, and their units.

    Returns
    -------
    Columns
        Time and speed as in the file.

    Raises
    ------
    InputError
        If the file is broken, or its columns are not clear; with file, line and column.
    """
    path = Path(options.file)
    text = read_text(path, "record", MAX_RECORD_BYTES)
    table = Csv(text, path, "a header such as time_s,speed_m_s")
    names = choose(table.header, table.header[0], options)
    indices = [table.header.index(name) for name in names[:2]]
    cells = ((line, *(row[index].strip() for index in indices)) for line, row in table)
    return parse_rows(cells, names, path, "line")


def parse_rows(
    rows: Iterable[tuple[int, str, str]], names: tuple[str, ...], file: Path, where: str
) -> Columns:
    """Return texts of time and speed as numbers.

    Parameters
    ----------
    rows : iterable of (int, str, str)
        Number, time and speed of each row.
    names : tuple of str
        Names of the time, of the speed, and of others.
    file : pathlib.Path
        The file, for messages.
    where : str
        What messages call a row, such as ``line``.

    Returns
    -------
    Columns
        As in the file; dates in seconds since the first.

    Raises
    ------
    InputError
        If there are no rows, or a text is neither number nor date.
    """
    lines, times, speeds = array("q"), array("d"), array("d")
    first: datetime | None = None  # where the times are dates
    for line, time, speed in rows:
        seconds, wrong = parse_number(time), _NO_NUMBER
        if first or (seconds is None and not lines):
            try:
                date = datetime.fromisoformat(time)
                first = first or date
                seconds = (date - first).total_seconds()
            except (ValueError, TypeError) as error:
                seconds, wrong = None, _NO_DATE if isinstance(error, ValueError) else _MIXED_ZONES
        number = np.nan if speed.lower() in _MISSING else parse_number(speed)
        if seconds is None or number is None:
            at, value, problem = (0, time, wrong) if seconds is None else (1, speed, _NO_SPEED)
            key = f"{where} {line}, {column_key(names[at])}"
            raise InputError(*problem, file=file, key=key, value=value)
        lines.append(line)
        times.append(seconds)
        speeds.append(number)
    if not lines:
        raise InputError("has no samples", "add its rows", file=file)
    time, speed = np.array(times), np.array(speeds)
    dated = first is not None
    return Columns(str(file), names, time, speed, lambda row: f"{where} {lines[row]}", dated=dated)


def read_pairs(path: str | Path, columns: tuple[str, str]) -> tuple[Column, Column]:
    """Read two columns of numbers of a CSV file.

    Parameters
    ----------
    path : str or pathlib.Path
        The file.
    columns : tuple of str
        Their names in its header. Two others, which are mere letters such as `D,V`, are taken in
        this order; names that may say a unit or another order are not.

    Returns
    -------
    Column, Column
        Their values, (n_rows,), finite.

    Raises
    ------
    InputError
        If the file is broken, or lacks one of them; with file, line and column.
    """
    path = Path(path)
    text, begin = read_text(path, "table", MAX_RECORD_BYTES), f"a header with {','.join(columns)}"
    table, words = Csv(text, path, begin, columns), {*"_".join(columns).split("_")}
    plain = all(name.isalpha() and name.lower() not in words for name in table.header)
    by_order = plain and len({*table.header}) == len(table.header) == 2
    return tuple(table.columns(table.header if by_order else columns, "table").values())
