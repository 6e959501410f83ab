"""Files of measured records: CSV, NetCDF and Parquet, brought to columns in s and m/s.

Nothing is repaired here. What cannot be read is refused with file, place and remedy.
"""

from __future__ import annotations

import csv
import difflib
import importlib
import importlib.util
import io
import re
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import read_bytes

__all__ = ["Columns", "RecordOptions", "columns_from", "read_columns"]

MAX_BYTES = 256 * 1024**2
"""Largest file that is read, in bytes."""

MAX_ROWS = 10_000_000
"""Largest number of samples."""

MAX_VALUES = 50_000_000
"""Largest number of values that are read of a profiler's record: samples times bins times two."""


@dataclass(frozen=True)
class RecordOptions:
    """Where in a file the speed is, and what may be done to it; see the case section `record`.

    Parameters
    ----------
    time_column, speed_column : str or None
        Names of columns or variables; None: the first (or the index, or the only time), and the
        only other.
    time_unit : {'s', 'ms', 'min', 'h', 'days'} or None
        Of times that are numbers; None: as the name or the file says.
    speed_unit : str or None
        One of `SPEED_UNITS` or `DISCHARGE_UNITS`; None: as the name or the file says.
    area : float or None, m²
        Cross section of the channel, for a discharge only.
    bins : (float, float) or None, m
        Range of depth bins to average over.
    component : str or None
        Label of a velocity's component; None: the horizontal speed, of the first two.
    start, duration : float, s
        The part that is taken; duration None: up to the end.
    gaps : {'refuse', 'interpolate'}
    longest_gap : float or None, s
        None: three samples, and no more than an hour.
    spikes : {'refuse', 'replace', 'keep'}
    uneven : {'refuse', 'resample'}
    cutoff : float or None, Hz
        Of the low-pass; None: half of Nyquist's frequency.
    """

    time_column: str | None = None
    speed_column: str | None = None
    time_unit: str | None = None
    speed_unit: str | None = None
    area: float | None = None
    bins: tuple[float, float] | None = None
    component: str | None = None
    start: float = 0.0
    duration: float | None = None
    gaps: str = "refuse"
    longest_gap: float | None = None
    spikes: str = "refuse"
    uneven: str = "refuse"
    cutoff: float | None = None

    def __post_init__(self) -> None:
        """Refuse a word that is none of its option's."""
        for key, words in {
            "time_unit": (None, *TIME_UNITS),
            "speed_unit": (None, *SPEED_UNITS, *DISCHARGE_UNITS),
            "gaps": ("refuse", "interpolate"),
            "spikes": ("refuse", "replace", "keep"),
            "uneven": ("refuse", "resample"),
        }.items():
            word = getattr(self, key)
            if word not in words:
                remedy = f"give one of {', '.join(word for word in words if word)}"
                raise InputError("unknown", remedy, key=key, value=word)


@dataclass(frozen=True, eq=False)
class Columns:
    """Time and speed of a record as they are in the file, but in SI units.

    Parameters
    ----------
    file : str
        Its name; empty for data in memory.
    columns : (str, str)
        What messages call the columns of time and speed, such as ``column time_s``.
    time : array, shape (n,), s
        Since the first sample, not checked; NaN where a date is missing.
    speed : array, shape (n,), m/s
        NaN where a sample is missing.
    place : callable
        place(row) says where a row is, such as ``line 7``.
    messages : tuple of str
        What was done to the numbers.
    """

    file: str
    columns: tuple[str, str]
    time: np.ndarray
    speed: np.ndarray
    place: Callable[[int], str]
    messages: tuple[str, ...] = ()

    def refuse(self, problem: str, remedy: str, row: int, column: int) -> InputError:
        """Return the error that lies in a row, in the column of the time (0) or the speed (1)."""
        number = float((self.time, self.speed)[column][row])
        key = f"{self.place(row)}, {self.columns[column]}"
        if np.isnan(number):
            return InputError(problem, remedy, file=self.file, key=key)
        value = f"{number:.10g} {('s since the first', 'm/s')[column]}"
        return InputError(problem, remedy, file=self.file, key=key, value=value)


# Units --------------------------------------------------------------------------------------------

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0, "days": 86400.0}
"""Seconds in each unit of time."""

SPEED_UNITS = {
    "m/s": 1.0,
    "cm/s": 0.01,
    "mm/s": 0.001,
    "km/h": 1 / 3.6,
    "ft/s": 0.3048,
    "knot": 1852 / 3600,
    "mph": 0.44704,
}
"""m/s in each unit of speed."""

DISCHARGE_UNITS = {"m3/s": 1.0, "L/s": 0.001, "ft3/s": 0.3048**3}
"""m³/s in each unit of discharge."""

_TIME_WORDS = {
    "s": "s sec secs second seconds",
    "ms": "ms msec millisecond milliseconds",
    "min": "min mins minute minutes",
    "h": "h hr hrs hour hours",
    "days": "d day days",
}
_LENGTH_WORDS = {
    "m/s": "m meter meters metre metres",
    "cm/s": "cm centimeter centimeters centimetre centimetres",
    "mm/s": "mm millimeter millimeters millimetre millimetres",
    "ft/s": "ft foot feet",
    "m3/s": "m3 cubic_meter cubic_meters cubic_metre cubic_metres",
    "L/s": "l liter liters litre litres",
    "ft3/s": "ft3 cubic_foot cubic_feet",
}
_OTHER_WORDS = {
    "m/s": "mps",
    "ft/s": "fps",
    "ft3/s": "cfs",
    "km/h": "km/h kmh kph km_h km_h-1 kilometers_per_hour kilometres_per_hour",
    "knot": "knot knots kn kt kts",
    "mph": "mph mi/h miles_per_hour",
}


_EXAMPLES = {"time_unit": "time_s or time [h]", "speed_unit": "speed_m_s or v [ft/s]"}
_LONGEST_NAME = 100


def _spellings() -> dict[str, str]:
    """Return the unit of speed or discharge behind each spelling, words joined by underscores."""
    known = {word: unit for unit, words in _OTHER_WORDS.items() for word in words.split()}
    for unit, words in _LENGTH_WORDS.items():
        for word in words.split():
            for form in ("{}/s", "{}/sec", "{}_s-1", "{}_s", "{}_per_s", "{}_per_second"):
                known[form.format(word)] = unit
    return known


_SPEEDS = _spellings()
_TIMES = {word: unit for unit, words in _TIME_WORDS.items() for word in words.split()}


def _named_unit(name: str, spellings: dict[str, str]) -> str | None:
    """Return the unit that a column's name or attribute ends with: `v [m/s]`, `v_m_s`, `v, ft/s`.

    None where there is none, or one that is not known.
    """
    text = re.sub(r"\*\*|\^", "", name.strip().lower().replace("³", "3"))
    bracket = re.search(r"[\[(]([^\[\]()]*)[\])]$", text)
    text = bracket[1] if bracket else text.rpartition(",")[2]
    words = re.split(r"[\s_.·]+", text.strip())
    for first in range(len(words)):  # the longest ending that is a unit: m_s, not s
        ending = "_".join(words[first:])
        if ending in _SPEEDS or ending in _TIMES:
            return spellings.get(ending)
    return None


def _unit(file: str, column: _Name, given: str | None, spellings: dict[str, str], key: str) -> str:
    """Return a column's unit, which the option `key` or the column itself says."""
    named = _named_unit(column.unit, spellings) or _named_unit(column.name, spellings)
    if given is None and named is None:
        known = ", ".join(dict.fromkeys(spellings.values()))
        raise InputError(
            f"has no unit that is known ({known})" + (f": {column.unit}" if column.unit else ""),
            f"give {key}, or name it with its unit, such as {_EXAMPLES[key]}",
            file=file,
            key=column.place,
        )
    if given is not None and named not in (None, given):
        raise InputError(
            f"is in {named} by its own name or attributes, and in {given} by {key}",
            f"mend {key} or the file, whichever is wrong",
            file=file,
            key=column.place,
        )
    return str(given or named)


@dataclass(frozen=True)
class _Name:
    """A column's name, and the unit that it has as an attribute."""

    name: str
    unit: str = ""

    @property
    def place(self) -> str:
        """What a message calls the column."""
        return f"column {self.name[:_LONGEST_NAME] or '1'}"


def _columns(
    file: str,
    time: np.ndarray,
    speed: np.ndarray,
    names: tuple[_Name, _Name],
    dated: bool,
    place: Callable[[int], str],
    options: RecordOptions,
    messages: Sequence[str] = (),
) -> Columns:
    """Return columns in s and m/s of what a file holds: seconds where dated, else in its units."""
    if dated and options.time_unit is not None:
        raise InputError(
            f"holds dates, and time_unit is {options.time_unit}",
            "leave time_unit out",
            file=file,
            key=names[0].place,
        )
    if not dated:
        unit = _unit(file, names[0], options.time_unit, _TIMES, "time_unit")
        with np.errstate(over="ignore"):  # infinite times are refused later, with their place
            time = (time - time[:1]) * TIME_UNITS[unit]
    factor, told = _speed_factor(file, names[1], options)
    return Columns(
        file,
        (names[0].place, names[1].place),
        time,
        speed * factor,
        place,
        (*messages, *told),
    )


def _speed_factor(
    file: str, column: _Name, options: RecordOptions
) -> tuple[float, tuple[str, ...]]:
    """Return what brings a speed or a discharge to m/s, and what is to be told of it."""
    unit = _unit(file, column, options.speed_unit, _SPEEDS, "speed_unit")
    key = column.place
    if unit in DISCHARGE_UNITS:
        if options.area is None:
            raise InputError(
                f"is a discharge in {unit}, not a speed",
                "give area, the channel's cross section in m2, or a column of the speed",
                file=file,
                key=key,
            )
        told = f"discharge in {unit} over the area of {options.area:g} m2 is the speed"
        return DISCHARGE_UNITS[unit] / options.area, (told,)
    if options.area is not None:
        raise InputError(
            f"is a speed in {unit}, and area is given for a discharge",
            "leave area out, or give the column of the discharge",
            file=file,
            key=key,
        )
    factor = SPEED_UNITS[unit]
    told = f"speed converted from {unit} to m/s, times {factor:.6g}"
    return factor, () if unit == "m/s" else (told,)


# Columns ------------------------------------------------------------------------------------------


def _choose(
    names: Sequence[str], default: str | None, options: RecordOptions, file: str
) -> tuple[str, str]:
    """Return the names of the time and the speed column."""
    shown = ", ".join(name[:_LONGEST_NAME] for name in names[:8]) + (
        ", ..." if len(names) > 8 else ""
    )
    time, speed = options.time_column, options.speed_column
    if time is None:
        if default is None:
            raise InputError(
                "has nothing that is plainly the time", f"give time_column: of {shown}", file=file
            )
        time = default
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


# CSV ----------------------------------------------------------------------------------------------

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_PLAIN = re.compile(r"[-+.0-9eE \n]*")
_MISSING = {"", "nan", "na", "n/a", "null", "none"}
_BLOCK = 65536
_LONGEST_CELL = 64


def _read_csv(path: Path, options: RecordOptions) -> Columns:
    """Read two columns of a CSV file, line by line, into arrays."""
    content = read_bytes(path, MAX_BYTES, "record")
    if b"\0" in content[:4096] and not content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError("is not text", "give a CSV file, or the ending of its kind", file=path)
    stream = io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig", newline="")
    reader = csv.reader(stream, strict=True)
    try:
        return _parse(reader, path, options)
    except UnicodeDecodeError:
        raise _not_utf8(content, path) from None
    except csv.Error as error:
        raise InputError(
            f"is not CSV ({error})", "mend the line", file=path, key=f"line {reader.line_num}"
        ) from None


def _not_utf8(content: bytes, path: Path) -> InputError:
    try:
        content.decode("utf-8-sig")
        start = 0
    except UnicodeDecodeError as error:
        start = error.start
    line = content.count(b"\n", 0, start) + 1
    return InputError("is not UTF-8 text", "save it as UTF-8", file=path, key=f"line {line}")


def _parse(reader: Any, path: Path, options: RecordOptions) -> Columns:
    """Read the rows of a CSV file."""
    rows = ((reader.line_num, cells) for cells in reader)
    rows = (row for row in rows if any(map(str.strip, row[1])) and row[1][0].lstrip()[:1] != "#")
    header_line, cells = next(rows, (1, []))
    names = [cell.strip() for cell in cells]
    if not names:
        raise InputError(
            "is empty", "its first line is a header such as time_s,speed_m_s", file=path
        )
    place = f"line {header_line}"
    if len(names) == 1 and re.search("[;\t|]", names[0]):
        raise InputError(
            "has no commas between its columns",
            "separate columns by commas and write decimals with a point",
            file=path,
            key=place,
            value=names[0],
        )
    if any(_NUMBER.fullmatch(name) for name in names):
        raise InputError(
            "is a number where the columns' names are expected",
            "begin with a header line such as time_s,speed_m_s",
            file=path,
            key=place,
            value=",".join(names),
        )
    time_name, speed_name = _choose(names, names[0], options, str(path))
    time_at, speed_at = names.index(time_name), names.index(speed_name)

    columns = _Cells(str(path), time_name, speed_name)
    for line, cells in rows:
        if len(cells) != len(names):
            raise InputError(
                f"has {len(cells)} cells where the header has {len(names)}",
                "give every column one cell, empty or not, and write decimals with a point",
                file=path,
                key=f"line {line}",
                value=",".join(cells),
            )
        columns.add(line, cells[time_at], cells[speed_at])
    columns.convert()
    lines = columns.lines
    if not lines:
        raise InputError("has a header but no samples", "add its rows", file=path)
    return _columns(
        str(path),
        np.array(columns.times),
        np.array(columns.speeds),
        (_Name(time_name), _Name(speed_name)),
        columns.dated,
        lambda row: f"line {lines[row]}",
        options,
    )


class _Cells:
    """Cells of the two columns on their way to numbers, a block at a time."""

    def __init__(self, file: str, time_name: str, speed_name: str) -> None:
        self.file, self.columns = file, (_Name(time_name).place, _Name(speed_name).place)
        self.lines, self.times, self.speeds = array("q"), array("d"), array("d")
        self.first: datetime | None = None
        self._waiting: tuple[list[str], list[str]] = ([], [])

    @property
    def dated(self) -> bool:
        """Whether the times are dates."""
        return self.first is not None

    def add(self, line: int, time: str, speed: str) -> None:
        """Take one row."""
        self.lines.append(line)
        self._waiting[0].append(time)
        self._waiting[1].append(speed)
        if len(self._waiting[0]) == _BLOCK:
            self.convert()

    def convert(self) -> None:
        """Turn the waiting cells into numbers."""
        times, speeds = self._waiting
        if not times:
            return
        if len(self.lines) > MAX_ROWS:
            raise _too_long(self.file)
        if not self.times and not _NUMBER.fullmatch(times[0].strip()):
            self.first = self._date(times[0], len(self.lines) - len(times))
        self.times.extend(self._dates(times) if self.dated else self._numbers(times, 0))
        self.speeds.extend(self._numbers(speeds, 1))
        times.clear()
        speeds.clear()

    def _numbers(self, cells: list[str], column: int) -> Iterable[float]:
        # one look at a whole block is quick; what is not plain is read cell by cell
        if _PLAIN.fullmatch("\n".join(cells)):
            try:
                numbers = [float(cell) for cell in cells]
            except ValueError:
                pass
            else:
                if np.all(np.isfinite(numbers)):
                    return numbers
        first = len(self.lines) - len(cells)
        return [self._number(cell.strip(), first + i, column) for i, cell in enumerate(cells)]

    def _number(self, cell: str, row: int, column: int) -> float:
        if column == 1 and cell.lower() in _MISSING:
            return np.nan
        plain = len(cell) <= _LONGEST_CELL and _NUMBER.fullmatch(cell)
        number = float(cell) if plain else np.nan
        if not np.isfinite(number):
            problem, remedy = "must be a finite number", "write it with a decimal point, no unit"
            if column == 1:
                remedy += "; leave the cell empty where the sample is missing"
            raise self._refuse(problem, remedy, row, column, cell)
        return number

    def _dates(self, cells: list[str]) -> Iterable[float]:
        first = len(self.lines) - len(cells)
        for row, cell in enumerate(cells, first):
            date = self._date(cell, row)
            try:
                yield (date - self.first).total_seconds()  # type: ignore[operator]
            except TypeError:
                problem = "has a zone and others have none, or the other way round"
                raise self._refuse(problem, "write all dates alike", row, 0, cell) from None

    def _date(self, cell: str, row: int) -> datetime:
        try:
            return datetime.fromisoformat(cell.strip()[:_LONGEST_CELL])
        except ValueError:
            raise self._refuse(
                "is neither a number nor a date",
                "write times as numbers, or as 2024-05-01T12:00:00.0 with or without a zone",
                row,
                0,
                cell,
            ) from None

    def _refuse(self, problem: str, remedy: str, row: int, column: int, cell: str) -> InputError:
        place = f"line {self.lines[row]}, {self.columns[column]}"
        return InputError(problem, remedy, file=self.file, key=place, value=cell)


def _too_long(file: str) -> InputError:
    return InputError(
        f"has more than {MAX_ROWS:,} samples", "give a part of it, or every so many", file=file
    )


# Parquet, pandas ----------------------------------------------------------------------------------


def _need(name: str, file: object) -> Any:
    """Return a module of the extra `records`."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise InputError(
            f"needs the package {name.partition('.')[0]}, which is not installed",
            "pip install 'hkt_mdo[records]', or save the record as CSV",
            file=file,
        ) from None


def _read_parquet(path: Path, options: RecordOptions) -> Columns:
    """Read two columns of a Parquet file."""
    parquet = _need("pyarrow.parquet", path)
    _need("pandas", path)
    content = read_bytes(path, MAX_BYTES, "record")
    try:
        file = parquet.ParquetFile(io.BytesIO(content))
        rows, empty = file.metadata.num_rows, file.schema_arrow.empty_table().to_pandas()
    except Exception as error:  # whatever a broken file makes the library say
        raise _unreadable("Parquet", error, path) from None
    if rows > MAX_ROWS:
        raise _too_long(str(path))
    wanted = _frame_columns(empty, str(path), options)
    try:
        columns = [name for name in empty.columns if str(name) in wanted]
        frame = file.read(columns=columns, use_pandas_metadata=True).to_pandas()
    except Exception as error:
        raise _unreadable("Parquet", error, path) from None
    return _from_frame(frame, str(path), options)


def _unreadable(kind: str, error: Exception, path: Path) -> InputError:
    reason = re.sub(r"\s+", " ", str(error))[:120] or type(error).__name__
    return InputError(
        f"cannot be read as {kind} ({reason})", "write the file anew, or as CSV", file=path
    )


def _frame_columns(frame: Any, file: str, options: RecordOptions) -> tuple[str, str]:
    """Return the names of the time, which may be the index, and of the speed."""
    names = [str(name) for name in frame.columns]
    default = names[0] if names else None
    if frame.index.nlevels == 1 and (frame.index.name or frame.index.dtype.kind == "M"):
        default = str(frame.index.name or "index")
        names.insert(0, default)
    time, speed = _choose(names, default, options, file)
    for name, kinds in ((time, "iufM"), (speed, "iuf")):
        kind = _frame_column(frame, name).dtype.kind
        if kind not in kinds:
            raise InputError(
                "holds no numbers" + (" and no dates" if "M" in kinds else ""),
                "write the column as numbers, or choose another",
                file=file,
                key=_Name(name).place,
            )
    return time, speed


def _frame_column(frame: Any, name: str) -> Any:
    """Return a column, or the index, as a Series."""
    for number, column in enumerate(frame.columns):
        if str(column) == name:
            return frame.iloc[:, number]
    return frame.index.to_series()


def _from_frame(frame: Any, file: str, options: RecordOptions) -> Columns:
    """Take two columns of a DataFrame."""
    if len(frame) > MAX_ROWS:
        raise _too_long(file)
    time_name, speed_name = _frame_columns(frame, file, options)
    time, speed = _frame_column(frame, time_name), _frame_column(frame, speed_name)
    if hasattr(time.dtype, "tz"):
        time = time.dt.tz_convert(None)
    dated = time.dtype.kind == "M"
    return _columns(
        file,
        _since_first(time.to_numpy()) if dated else time.to_numpy(dtype=float, na_value=np.nan),
        _finite(speed.to_numpy(dtype=float, na_value=np.nan), file, speed_name),
        (_Name(time_name), _Name(speed_name)),
        dated,
        lambda row: f"row {row + 1}",
        options,
    )


def _since_first(dates: np.ndarray) -> np.ndarray:
    """Return dates in seconds since the first, NaN where there is none."""
    nanoseconds = dates.astype("datetime64[ns]")
    since = (nanoseconds - nanoseconds[:1]).astype(np.int64) * 1e-9
    return np.where(np.isnat(nanoseconds), np.nan, since)


def _finite(speed: np.ndarray, file: str, name: str) -> np.ndarray:
    """Return speeds that may be missing, but not infinite."""
    infinite = np.flatnonzero(np.isinf(speed))
    if infinite.size:
        raise InputError(
            "must be a finite number",
            "mark missing samples by NaN",
            file=file,
            key=f"row {infinite[0] + 1}, {_Name(name).place}",
            value=float(speed[infinite[0]]),
        )
    return speed


# NetCDF, xarray -----------------------------------------------------------------------------------


def _read_netcdf(path: Path, options: RecordOptions) -> Columns:
    """Read a variable over time of a NetCDF file."""
    xarray = _need("xarray", path)
    head = read_bytes(path, MAX_BYTES, "record")[:8]
    if head.startswith(b"CDF"):
        engine = "scipy"
    elif head.startswith(b"\x89HDF\r\n\x1a\n"):
        engine = "netcdf4" if importlib.util.find_spec("netCDF4") else "h5netcdf"
        if engine == "h5netcdf" and not importlib.util.find_spec("h5netcdf"):
            _need("netCDF4", path)
    else:
        raise InputError("is not NetCDF", "write the file anew, or as CSV", file=path)
    try:
        further = {"mmap": False} if engine == "scipy" else {}
        dataset = xarray.open_dataset(path, engine=engine, decode_timedelta=False, **further)
    except Exception as error:  # whatever a broken file makes the library say
        raise _unreadable("NetCDF", error, path) from None
    with dataset:
        try:
            return _from_dataset(dataset, str(path), options)
        except InputError:
            raise
        except Exception as error:
            raise _unreadable("NetCDF", error, path) from None


def _from_dataset(data: Any, file: str, options: RecordOptions) -> Columns:
    """Take a variable over time of a Dataset: a speed, or a profiler's velocity."""
    lines = [name for name, variable in data.variables.items() if variable.ndim == 1]
    dates = [name for name in lines if name in data.dims and data[name].dtype.kind == "M"]
    usual = [name for name in ("time", "dateTime") if name in lines]
    default = next(iter(usual or (dates if len(dates) == 1 else [])), None)
    chosen = options.time_column or default
    dimension = data[chosen].dims[0] if chosen in lines else None
    names = [str(name) for name, v in data.data_vars.items() if dimension in v.dims]
    names = [name for name in names if name != chosen]
    # what has a unit of speed comes first in a message
    names.sort(key=lambda name: _named_unit(str(data[name].attrs.get("units")), _SPEEDS) is None)
    time_name, speed_name = _choose(
        [*([str(chosen)] if chosen in lines else lines), *names],
        None if default is None else str(default),
        options,
        file,
    )
    time, speed = data[time_name], data[speed_name]
    for variable, kinds in ((time, "iufM"), (speed, "iuf")):
        if variable.dtype.kind not in kinds:
            raise InputError(
                "holds no numbers" + (" and no dates" if "M" in kinds else ""),
                "write the variable as numbers, or choose another",
                file=file,
                key=_Name(str(variable.name)).place,
            )
    if time.size > MAX_ROWS:
        raise _too_long(file)
    messages: list[str] = []
    values = _profile(speed, dimension, file, options, messages)
    dated = time.dtype.kind == "M"
    return _columns(
        file,
        _since_first(time.values) if dated else time.values.astype(float),
        _finite(values, file, speed_name),
        (
            _Name(time_name, str(time.attrs.get("units", ""))),
            _Name(speed_name, str(speed.attrs.get("units", ""))),
        ),
        dated,
        lambda row: f"row {row + 1}",
        options,
        messages,
    )


_HORIZONTAL = {("e", "n"), ("x", "y"), ("u", "v"), ("streamwise", "x-stream")}


def _profile(
    speed: Any, dimension: Any, file: str, options: RecordOptions, messages: list[str]
) -> np.ndarray:
    """Return the speed over time: of the chosen component or horizontal, averaged over bins."""
    key = _Name(str(speed.name)).place

    def refuse(problem: str, remedy: str, **where: Any) -> InputError:
        return InputError(problem, remedy, file=file, key=where.pop("key", key), **where)

    others = [name for name in speed.dims if name != dimension]
    labelled = [
        name
        for name in others
        if name in speed.coords and (name == "dir" or speed[name].dtype.kind in "USOT")
    ]
    bins = [name for name in others if name not in labelled]
    if len(labelled) > 1 or len(bins) > 1:
        raise refuse(
            f"has the dimensions {', '.join(map(str, speed.dims))}",
            "give a variable over time, depth bins and components at most",
        )
    parts = [speed]
    if labelled:
        labels = [str(label) for label in speed[labelled[0]].values]
        if all(label.isdigit() for label in labels):
            raise refuse(
                "is along the beams of the instrument", "rotate it to earth or flow coordinates"
            )
        known = f"there are {', '.join(labels)}"
        taken = labels[:2] if options.component is None else [options.component]
        if options.component is None and tuple(map(str.lower, taken)) not in _HORIZONTAL:
            raise refuse("has no two horizontal components at its head", f"give component: {known}")
        if taken[0] not in labels:
            raise refuse("is no component", known, key="component", value=options.component)
        parts = [speed.isel({labelled[0]: labels.index(label)}) for label in taken]
        kind = "component" if options.component else "horizontal speed of"
        messages.append(f"{speed.name}: {kind} {' and '.join(taken)}")
    elif options.component is not None:
        raise refuse(
            "is given for a record without components",
            "leave it out",
            key="component",
            value=options.component,
        )
    if bins:
        parts = _bins(parts, bins[0], refuse, options, messages)
    elif options.bins is not None:
        raise refuse(
            "are given for a record without depth bins",
            "leave them out",
            key="bins",
            value=list(options.bins),
        )
    if sum(part.size for part in parts) > MAX_VALUES:
        raise refuse(f"has more than {MAX_VALUES:,} values to read", "take fewer bins")
    order = [dimension, *bins]
    arrays = [part.transpose(*order).values.astype(float) for part in parts]
    size = arrays[0] if len(arrays) == 1 else np.hypot(*arrays)
    return np.mean(size, axis=1) if bins else size


def _bins(
    parts: list[Any],
    name: Any,
    refuse: Callable[..., InputError],
    options: RecordOptions,
    messages: list[str],
) -> list[Any]:
    """Return the parts with the chosen bins alone."""
    if name not in parts[0].coords or parts[0][name].dtype.kind not in "iuf":
        raise refuse(f"has no distances along {name}", f"give {name} its values in metres")
    centres = parts[0][name].values.astype(float)
    if not centres.size:
        raise refuse(f"has no bin along {name}", "give a record that has some")
    known = f"{centres.size} from {np.min(centres):.4g} to {np.max(centres):.4g} m"
    if options.bins is None:
        raise refuse(
            f"has depth bins along {name}", f"give bins: [lower, upper]; there are {known}"
        )
    lower, upper = options.bins
    taken = np.flatnonzero((centres >= lower) & (centres <= upper))
    if not taken.size:
        raise refuse(
            "has no bin", f"widen it; there are {known}", key="bins", value=list(options.bins)
        )
    messages.append(
        f"average of {taken.size} bins from {np.min(centres[taken]):.4g} to "
        f"{np.max(centres[taken]):.4g} m"
    )
    return [part.isel({name: taken}) for part in parts]


_READERS = {
    ".csv": _read_csv,
    ".txt": _read_csv,
    ".nc": _read_netcdf,
    ".nc4": _read_netcdf,
    ".cdf": _read_netcdf,
    ".parquet": _read_parquet,
    ".pq": _read_parquet,
}


def read_columns(path: Path, options: RecordOptions) -> Columns:
    """Read time and speed from a file, of the kind that its ending says.

    Parameters
    ----------
    path : pathlib.Path
    options : RecordOptions

    Returns
    -------
    Columns

    Raises
    ------
    InputError
        If the file cannot be read, is too large, or its columns or units are not plain; also if the
        packages for NetCDF or Parquet are not installed.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"has the ending {path.suffix}" if path.suffix else "has no ending that says its kind",
            f"name it {', '.join(_READERS)}, whichever it is",
            file=path,
        )
    return reader(path, options)


def columns_from(data: Any, options: RecordOptions) -> Columns:
    """Take time and speed from a pandas or xarray object.

    Parameters
    ----------
    data : pandas DataFrame or Series, or xarray Dataset or DataArray
    options : RecordOptions

    Returns
    -------
    Columns

    Raises
    ------
    InputError
        If it is something else, or its columns or units are not plain.
    """
    if hasattr(data, "to_frame") and not hasattr(data, "columns"):  # a Series
        data = data.to_frame(data.name or "speed")
    if hasattr(data, "columns"):
        return _from_frame(data, "", options)
    if hasattr(data, "to_dataset") and not hasattr(data, "data_vars"):  # a DataArray
        data = data.to_dataset(name=data.name or "speed")
    if hasattr(data, "data_vars"):
        return _from_dataset(data, "", options)
    raise InputError(
        "is no record",
        "give a pandas DataFrame or an xarray Dataset",
        value=type(data).__name__,
    )
