"""Measured records of a flow: read, checked, brought to even samples in m/s, and low-passed.

A record that is not what a turbine could stand in is refused with file, place and remedy. Nothing
is repaired unless an option says so, and every repair is told in `Record.messages`.
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
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.data import read_bytes
from hkt_mdo.errors import InputError, show

__all__ = ["Record", "RecordOptions", "find_spikes", "low_pass", "read_record", "record_from"]

MAX_BYTES = 256 * 1024**2
"""Largest file that is read, in bytes."""

MAX_ROWS = 10_000_000
"""Largest number of samples."""

MAX_VALUES = 50_000_000
"""Largest number of values that are read of a profiler's record: samples times bins times two."""

MIN_SAMPLES = 16
"""Smallest number of samples that make a record."""

FASTEST = 20.0
"""Speed, m/s, that no river reaches: it is in another unit, or a mark of missing samples."""

SPIKE = 5.0
"""How far, in scales of its surroundings, a sample stands off that is a spike."""

UNEVEN = 0.05
"""Share of a step by which a sample may miss its even time."""


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


@dataclass(frozen=True, eq=False)
class Record:
    """Even samples of a measured flow.

    Parameters
    ----------
    time : array, shape (n,), s
        From 0 in equal steps.
    speed : array, shape (n,), m/s
        Positive, low-passed.
    step : float, s
    cutoff : float, Hz
        Frequency at which the low-pass halves an amplitude.
    messages : tuple of str
        What was read and what was done to it, one line each.
    """

    time: np.ndarray
    speed: np.ndarray
    step: float
    cutoff: float
    messages: tuple[str, ...]


def read_record(path: str | Path, **options: Any) -> Record:
    """Read a record from a CSV, NetCDF or Parquet file, told apart by the file's ending.

    Parameters
    ----------
    path : str or pathlib.Path
        `.csv` or `.txt`: columns separated by commas, a header line, UTF-8; empty cells and `nan`
        are gaps. `.nc`, `.nc4` or `.cdf`, `.parquet` or `.pq`: as MHKiT's data are saved.
    **options
        As in `RecordOptions`.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        If the file cannot be read, is larger than 256 MiB or 10 million rows, or anything in it is
        not as the options say; the message names file, line, column, value and remedy. Also if the
        packages for NetCDF or Parquet are not installed.
    """
    path, chosen = Path(path), RecordOptions(**options)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"has the ending {path.suffix}" if path.suffix else "has no ending that says its kind",
            f"name it {', '.join(_READERS)}, whichever it is",
            file=path,
        )
    return _finish(reader(path, chosen), chosen)


def record_from(data: Any, **options: Any) -> Record:
    """Make a record of data in memory, as MHKiT returns them.

    Parameters
    ----------
    data : pandas DataFrame or Series, or xarray Dataset or DataArray
        As of `mhkit.river.io.usgs` or `mhkit.dolfyn`.
    **options
        As in `RecordOptions`.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        As `read_record`, without a file.
    """
    chosen = RecordOptions(**options)
    if hasattr(data, "to_frame") and not hasattr(data, "columns"):  # a Series
        data = data.to_frame(data.name or "speed")
    if hasattr(data, "columns"):
        return _finish(_from_frame(data, "", chosen), chosen)
    if hasattr(data, "to_dataset") and not hasattr(data, "data_vars"):  # a DataArray
        data = data.to_dataset(name=data.name or "speed")
    if hasattr(data, "data_vars"):
        return _finish(_from_dataset(data, "", chosen), chosen)
    raise InputError(
        "is no record",
        "give a pandas DataFrame or an xarray Dataset",
        value=type(data).__name__,
    )


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


def _spellings() -> dict[str, str]:
    """Return the unit of speed or discharge behind each spelling, words joined by underscores."""
    known = {word: unit for unit, words in _OTHER_WORDS.items() for word in words.split()}
    for unit, words in _LENGTH_WORDS.items():
        for word in words.split():
            for form in ("{}/s", "{}/sec", "{}_s-1", "{}_s", "{}_per_s", "{}_per_second"):
                known[form.format(word)] = unit
    return known


_SPEED_SPELLINGS = _spellings()
_TIME_SPELLINGS = {word: unit for unit, words in _TIME_WORDS.items() for word in words.split()}


def _named_unit(name: str, spellings: dict[str, str]) -> str | None:
    """Return the unit that a column's name or attribute ends with: `v [m/s]`, `v_m_s`, `v, ft/s`.

    None where there is none, or one that is not known.
    """
    text = name.strip().lower().replace("³", "3").replace("**", "").replace("^", "")
    bracket = re.search(r"[\[(]([^\[\]()]*)[\])]$", text)
    text = bracket[1] if bracket else text.rpartition(",")[2]
    words = re.split(r"[\s_]+", text.strip())
    for first in range(len(words)):  # the longest ending that is a unit
        unit = spellings.get("_".join(words[first:]))
        if unit is not None:
            return unit
    return None


def _unit(
    raw: _Raw, column: _Column, given: str | None, spellings: dict[str, str], key: str
) -> str:
    """Return a column's unit, which the option `key` or the column itself says."""
    named = _named_unit(column.unit, spellings) or _named_unit(column.name, spellings)
    known = ", ".join(dict.fromkeys(spellings.values()))
    if given is None and named is None:
        raise InputError(
            f"has no unit that is known ({known})",
            f"give {key}, or name it with its unit, such as {column.example}",
            file=raw.file,
            key=f"column {column.name}",
            **({"value": column.unit} if column.unit else {}),
        )
    if given is not None and named not in (None, given):
        raise InputError(
            f"is in {named} by its own name or attributes, and in {given} by {key}",
            f"mend {key} or the file, whichever is wrong",
            file=raw.file,
            key=f"column {column.name}",
        )
    return str(given or named)


# Raw columns --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Column:
    """A column's name, the unit that it has as an attribute, and what its name could be."""

    name: str
    unit: str = ""
    example: str = ""


@dataclass(frozen=True, eq=False)
class _Raw:
    """Columns as they are in a file.

    time is in seconds if `dated`, else in its unit. place says where a row is, such as `line 7`.
    """

    file: str
    time: np.ndarray
    speed: np.ndarray
    time_column: _Column
    speed_column: _Column
    dated: bool
    place: Callable[[int], str]
    messages: tuple[str, ...] = ()

    def refuse(
        self, problem: str, remedy: str, row: int, value: object, *, time: bool = False
    ) -> InputError:
        """Return the error that lies in a row."""
        column = (self.time_column if time else self.speed_column).name
        return InputError(
            problem, remedy, file=self.file, key=f"{self.place(row)}, column {column}", value=value
        )


def _choose(
    names: Sequence[str], default: str | None, options: RecordOptions, file: str
) -> tuple[str, str]:
    """Return the names of the time and the speed column."""
    shown = ", ".join(show(name).strip("'") for name in names[:12])
    shown += ", ..." if len(names) > 12 else ""
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
                f"has {_count(len(others), 'column')} besides the time {show(time)}",
                f"give speed_column: of {shown}",
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


def _read_csv(path: Path, options: RecordOptions) -> _Raw:
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


def _parse(reader: Any, path: Path, options: RecordOptions) -> _Raw:
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
                "give every column a cell, which may be empty, and quote texts with commas",
                file=path,
                key=f"line {line}",
                value=",".join(cells),
            )
        columns.add(line, cells[time_at], cells[speed_at])
    columns.convert()
    lines = columns.lines
    if not lines:
        raise InputError("has a header but no samples", "add its rows", file=path)
    return _Raw(
        str(path),
        np.array(columns.times),
        np.array(columns.speeds),
        _Column(time_name or "1", example="time_s"),
        _Column(speed_name or "2", example="speed_m_s"),
        columns.dated,
        lambda row: f"line {lines[row]}",
    )


class _Cells:
    """Cells of the two columns on their way to numbers, a block at a time."""

    def __init__(self, file: str, time_name: str, speed_name: str) -> None:
        self.file, self.names = file, (time_name or "1", speed_name or "2")
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
        place = f"line {self.lines[row]}, column {self.names[column]}"
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


def _read_parquet(path: Path, options: RecordOptions) -> _Raw:
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
                key=f"column {name}",
            )
    return time, speed


def _frame_column(frame: Any, name: str) -> Any:
    """Return a column, or the index, as a Series."""
    for number, column in enumerate(frame.columns):
        if str(column) == name:
            return frame.iloc[:, number]
    return frame.index.to_series()


def _from_frame(frame: Any, file: str, options: RecordOptions) -> _Raw:
    """Take two columns of a DataFrame."""
    if len(frame) > MAX_ROWS:
        raise _too_long(file)
    time_name, speed_name = _frame_columns(frame, file, options)
    time, speed = _frame_column(frame, time_name), _frame_column(frame, speed_name)
    if hasattr(time.dtype, "tz"):
        time = time.dt.tz_convert(None)
    dated = time.dtype.kind == "M"
    return _Raw(
        file,
        _since_first(time.to_numpy()) if dated else time.to_numpy(dtype=float, na_value=np.nan),
        _finite(speed.to_numpy(dtype=float, na_value=np.nan), file, speed_name),
        _Column(time_name, example="time_s"),
        _Column(speed_name, example="speed_m_s"),
        dated,
        lambda row: f"row {row + 1}",
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
            key=f"row {infinite[0] + 1}, column {name}",
            value=float(speed[infinite[0]]),
        )
    return speed


# NetCDF, xarray -----------------------------------------------------------------------------------


def _read_netcdf(path: Path, options: RecordOptions) -> _Raw:
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
        dataset = xarray.open_dataset(path, engine=engine, decode_timedelta=False)
    except Exception as error:  # whatever a broken file makes the library say
        raise _unreadable("NetCDF", error, path) from None
    with dataset:
        try:
            return _from_dataset(dataset, str(path), options)
        except InputError:
            raise
        except Exception as error:
            raise _unreadable("NetCDF", error, path) from None


def _from_dataset(data: Any, file: str, options: RecordOptions) -> _Raw:
    """Take a variable over time of a Dataset: a speed, or a profiler's velocity."""
    lines = [name for name, variable in data.variables.items() if variable.ndim == 1]
    default = next((name for name in lines if data[name].dtype.kind == "M"), None)
    default = default or next((name for name in ("time", "dateTime") if name in lines), None)
    chosen = options.time_column or default
    dimension = data[chosen].dims[0] if chosen in lines else None
    names = [str(name) for name, v in data.data_vars.items() if dimension in v.dims]
    names = [name for name in names if name != chosen]
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
                key=f"variable {variable.name}",
            )
    if time.size > MAX_ROWS:
        raise _too_long(file)
    messages: list[str] = []
    values = _profile(speed, dimension, file, options, messages)
    dated = time.dtype.kind == "M"
    return _Raw(
        file,
        _since_first(time.values) if dated else time.values.astype(float),
        _finite(values, file, speed_name),
        _Column(time_name, str(time.attrs.get("units", "")), "units = s"),
        _Column(speed_name, str(speed.attrs.get("units", "")), "units = m/s"),
        dated,
        lambda row: f"sample {row + 1}",
        tuple(messages),
    )


def _profile(
    speed: Any, dimension: Any, file: str, options: RecordOptions, messages: list[str]
) -> np.ndarray:
    """Return the speed over time: of the chosen component or horizontal, averaged over bins."""
    key = f"variable {speed.name}"

    def refuse(problem: str, remedy: str, **where: Any) -> InputError:
        return InputError(problem, remedy, file=file, key=where.pop("key", key), **where)

    others = [name for name in speed.dims if name != dimension]
    labelled = [name for name in others if name in speed.coords]
    labelled = [name for name in labelled if speed[name].dtype.kind in "USOT"]
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
        taken = labels[:2] if options.component is None else [options.component]
        if taken[0] not in labels:
            raise refuse("is no component", f"there are {', '.join(labels)}", value=taken[0])
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
        f"average of {_count(taken.size, 'bin')} from {np.min(centres[taken]):.4g} to "
        f"{np.max(centres[taken]):.4g} m"
    )
    return [part.isel({name: taken}) for part in parts]


# From raw columns to a record ---------------------------------------------------------------------


def _finish(raw: _Raw, options: RecordOptions) -> Record:
    """Convert, cut, check, repair as far as allowed, and low-pass."""
    messages = list(raw.messages)
    time = _seconds(raw, options)
    speed = _metres_per_second(raw, options, messages)
    first, last = _part(raw, time, options, messages)
    whole = raw.place
    raw = replace(
        raw,
        time=time[first:last] - time[first],
        speed=speed[first:last],
        place=lambda row: whole(row + first),
    )
    spikes = _spikes(raw, options, messages)
    step, speed = _even(raw, spikes, options, messages)
    fast = np.flatnonzero(np.abs(speed) > FASTEST)
    if fast.size:
        raise InputError(
            f"is {speed[fast[0]]:.4g} m/s at t = {fast[0] * step:.6g} s, faster than any river",
            "mend speed_unit, or empty the cells that mark missing samples",
            file=raw.file,
            key=f"column {raw.speed_column.name}",
        )
    cutoff, smooth = _cut_off(raw, step, speed, options, messages)
    low = int(np.argmin(smooth))
    if not smooth[low] > 0.0:
        raise InputError(
            f"is {smooth[low]:.3g} m/s at t = {low * step:.6g} s: the flow stands still or turns",
            "take a part where it runs one way, by start and duration, or mend the sign",
            file=raw.file,
            key=f"column {raw.speed_column.name}",
        )
    messages.insert(
        0,
        f"{Path(raw.file).name or 'record'}: {smooth.size} samples every {step:.6g} s, mean "
        f"{np.mean(smooth):.4g} m/s, from {smooth[low]:.4g} to {np.max(smooth):.4g} m/s",
    )
    return Record(np.arange(smooth.size) * step, smooth, step, cutoff, tuple(messages))


def _seconds(raw: _Raw, options: RecordOptions) -> np.ndarray:
    """Return the times in seconds, checked to rise."""
    if raw.dated and options.time_unit is not None:
        raise InputError(
            f"holds dates, and time_unit is {options.time_unit}",
            "leave time_unit out",
            file=raw.file,
            key=f"column {raw.time_column.name}",
        )
    factor = 1.0
    if not raw.dated:
        unit = _unit(raw, raw.time_column, options.time_unit, _TIME_SPELLINGS, "time_unit")
        factor = TIME_UNITS[unit]
    missing = np.flatnonzero(~np.isfinite(raw.time))
    if missing.size:
        raise raw.refuse("is missing", "give every sample a time", int(missing[0]), "", time=True)
    back = np.flatnonzero(np.diff(raw.time) <= 0.0)
    if back.size:
        row = int(back[0]) + 1
        same = raw.time[row] == raw.time[row - 1]
        problem = f"is {'the time of' if same else 'before'} {raw.place(row - 1)}"
        remedy = "sort the rows by time and keep one of each"
        if raw.dated:
            remedy += "; write dates of a clock that was changed with their zone"
        raise raw.refuse(problem, remedy, row, _shown(raw, row), time=True)
    return (raw.time - raw.time[0]) * factor


def _shown(raw: _Raw, row: int) -> str:
    """Return a time as a message quotes it."""
    return f"{raw.time[row]:.15g} s since the first" if raw.dated else f"{raw.time[row]:.15g}"


def _metres_per_second(raw: _Raw, options: RecordOptions, messages: list[str]) -> np.ndarray:
    """Return the speeds in m/s."""
    unit = _unit(raw, raw.speed_column, options.speed_unit, _SPEED_SPELLINGS, "speed_unit")
    key = f"column {raw.speed_column.name}"
    if unit in DISCHARGE_UNITS:
        if options.area is None:
            raise InputError(
                f"is a discharge in {unit}, not a speed",
                "give area, the channel's cross section in m2, or a column of the speed",
                file=raw.file,
                key=key,
            )
        messages.append(f"discharge in {unit} over the area of {options.area:g} m2 is the speed")
        return raw.speed * (DISCHARGE_UNITS[unit] / options.area)
    if options.area is not None:
        raise InputError(
            f"is a speed in {unit}, and area is given for a discharge",
            "leave area out, or give the column of the discharge",
            file=raw.file,
            key=key,
        )
    if unit != "m/s":
        messages.append(f"speed converted from {unit} to m/s, times {SPEED_UNITS[unit]:.6g}")
    return raw.speed * SPEED_UNITS[unit]


def _part(
    raw: _Raw, time: np.ndarray, options: RecordOptions, messages: list[str]
) -> tuple[int, int]:
    """Return the first row from start on, and the row after start + duration."""
    end = np.inf if options.duration is None else options.start + options.duration
    near = 1e-9 * (1.0 + time[-1])
    for name, value, limit in (("start", options.start, time[-1]), ("duration", end, time[-1])):
        if np.isfinite(value) and value > limit + near:
            raise InputError(
                f"asks for {value:.6g} s, and the record ends {limit:.6g} s after its first sample",
                f"give a smaller {name}, or none",
                file=raw.file,
                key=name,
                value=getattr(options, name),
            )
    first, last = map(int, np.searchsorted(time, (options.start - near, end + near)))
    if last - first < MIN_SAMPLES:
        whole = options.start == 0.0 and options.duration is None
        raise InputError(
            f"has {last - first} sample{'s' if last - first != 1 else ''}"
            + ("" if whole else " between start and start + duration"),
            f"give at least {MIN_SAMPLES}",
            file=raw.file,
        )
    if last - first < time.size:
        messages.append(f"taken from {time[first]:.6g} s to {time[last - 1]:.6g} s of the record")
    return first, last


def find_spikes(speed: np.ndarray) -> np.ndarray:
    """Return which samples are spikes, by a Hampel filter.

    A sample is one if it is farther from the median of the seven around it than `SPIKE` times the
    spread of those seven and `SPIKE` times the usual difference of neighbours; spreads are 1.4826
    times a median absolute deviation (Davies and Gather 1993; Pearson 2002). So up to three bad
    samples in a row are found; gusts, steps and the peaks of waves, whose neighbours follow them,
    are spared.

    Parameters
    ----------
    speed : array, shape (n,)
        Finite.

    Returns
    -------
    array of bool, shape (n,)
    """
    from scipy.ndimage import median_filter

    half = 3
    padded = np.pad(speed, half, mode="reflect")
    off = np.abs(speed - median_filter(padded, 2 * half + 1)[half:-half])
    steps = np.abs(np.diff(speed))
    moving = steps[steps > 0.0]
    if not moving.size:
        return np.zeros(speed.size, dtype=bool)
    # samples of a coarse digit mostly do not move: the digit itself is no spike
    digit = min(float(moving.min()), 0.01 * float(np.median(np.abs(speed))))
    usual = max(
        1.4826 * float(np.median(np.abs(np.diff(speed) - np.median(np.diff(speed))))), digit
    )
    found = np.zeros(speed.size, dtype=bool)
    suspects = np.flatnonzero(off > SPIKE * usual)
    for block in np.array_split(suspects, suspects.size // _BLOCK + 1):
        around = padded[block[:, None] + np.arange(2 * half + 1)]
        middle = np.median(around, axis=1, keepdims=True)
        spread = 1.4826 * np.median(np.abs(around - middle), axis=1)
        found[block] = off[block] > SPIKE * spread
    return found


def _spikes(raw: _Raw, options: RecordOptions, messages: list[str]) -> np.ndarray:
    """Return which samples are spikes that are to be replaced."""
    spikes = np.zeros(raw.speed.size, dtype=bool)
    here = np.flatnonzero(np.isfinite(raw.speed))
    if options.spikes == "keep" or here.size < MIN_SAMPLES:
        return spikes
    found = here[find_spikes(raw.speed[here])]
    if not found.size:
        return spikes
    if options.spikes == "refuse":
        row = int(found[0])
        others = f", and {found.size - 1} more do" if found.size > 1 else ""
        raise raw.refuse(
            f"stands off from its neighbours like a spike{others}",
            "give spikes: replace to interpolate there, or spikes: keep if that is the flow",
            row,
            f"{raw.speed[row]:.4g} m/s",
        )
    spikes[found] = True
    messages.append(f"{_count(found.size, 'spike')} replaced, at t = {_times(raw.time[found])}")
    return spikes


def _even(
    raw: _Raw, spikes: np.ndarray, options: RecordOptions, messages: list[str]
) -> tuple[float, np.ndarray]:
    """Return the step, and the speeds at even times, interpolated where the record has none."""
    step, index, miss = _grid(raw.time)
    uneven = miss > UNEVEN * step
    resample = bool(np.any(uneven))
    if resample and options.uneven == "refuse":
        row = int(np.argmax(uneven))
        raise raw.refuse(
            f"is {miss[row]:.3g} s off an even spacing of {step:.6g} s",
            "give uneven: resample to interpolate at even times",
            row,
            _shown(raw, row),
            time=True,
        )
    if resample:
        step = float(np.median(np.diff(raw.time)))
    longest = _check_gaps(raw, step, resample, options)
    count = int(raw.time[-1] / step * (1.0 + 1e-12)) + 1 if resample else int(index[-1]) + 1
    if count > MAX_ROWS:
        raise _too_long(raw.file)

    good = np.isfinite(raw.speed) & ~spikes
    if resample:
        messages.append(
            f"resampled every {step:.6g} s: samples were up to {np.max(miss):.3g} s off even times"
        )
        return step, _interpolate(raw, good, step * np.arange(count))
    if np.max(miss) > 1e-6 * step:
        share = 100 * np.max(miss) / step
        messages.append(f"times taken as even: they are up to {share:.2g} % of a step off")
    speed = np.full(count, np.nan)
    speed[index[good]] = raw.speed[good]
    holes = np.isnan(speed)
    gaps = holes.copy()
    gaps[index[spikes]] = False
    if np.any(gaps):
        begins = np.flatnonzero(gaps & ~np.append(False, gaps[:-1]))
        messages.append(
            f"{_count(begins.size, 'gap')} interpolated, {_count(int(np.sum(gaps)), 'sample')} "
            f"({100 * np.mean(gaps):.2g} %), the longest {longest:.6g} s, "
            f"at t = {_times(step * begins)}"
        )
    if np.any(holes):
        speed[holes] = _interpolate(raw, good, step * np.flatnonzero(holes))
    return step, speed


def _interpolate(raw: _Raw, good: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return speeds between the good samples, without overshoot; the end values beyond them."""
    from scipy.interpolate import PchipInterpolator

    known = raw.time[good]
    return PchipInterpolator(known, raw.speed[good])(np.clip(time, known[0], known[-1]))


def _check_gaps(raw: _Raw, step: float, resample: bool, options: RecordOptions) -> float:
    """Return the longest gap, s; refuse one that may not be interpolated.

    Where samples are uneven, all of them are interpolated, and only the longest gap counts.
    """
    present = np.isfinite(raw.speed)
    empty = np.flatnonzero(~present)
    another = "take a part without it by start and duration"
    if empty.size and options.gaps == "refuse":
        others = f", as are {empty.size - 1} more" if empty.size > 1 else ""
        problem, remedy = f"is missing{others}", f"give gaps: interpolate, or {another}"
        raise raw.refuse(problem, remedy, int(empty[0]), "")
    for row, key in ((0, "start"), (present.size - 1, "duration")):
        if not present[row]:
            problem = "is missing at an end, where nothing can be interpolated"
            raise raw.refuse(problem, f"leave it out by {key}", row, "")
    rows = np.flatnonzero(present)
    missing = np.diff(raw.time[rows]) - step
    longest = min(3.0 * step, 3600.0) if options.longest_gap is None else options.longest_gap
    allowed = longest + 0.1 * step
    gaps = missing > 0.5 * step
    if options.gaps == "interpolate" or resample:
        gaps = missing > allowed
    if np.any(gaps):
        found = int(np.argmax(gaps))
        problem = f"ends a gap of {missing[found]:.6g} s"
        remedy = f"give gaps: interpolate, or {another}"
        if missing[found] > allowed:
            problem += f", and the longest that may be interpolated is {longest:.6g} s"
            remedy = f"{another}, or give longest_gap, an hour at most"
        row = int(rows[found + 1])
        raise raw.refuse(problem, remedy, row, _shown(raw, row), time=True)
    return float(np.max(missing))


def _grid(time: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the step of even samples with gaps, each one's place, and how far (s) it is off."""
    steps = np.diff(time)
    median = float(np.median(steps))
    # the mean of the single steps, as times may be rounded: 0.03, 0.07, 0.10
    usual = float(np.mean(steps[np.abs(steps - median) <= 0.5 * median]))
    index = np.concatenate(([0.0], np.cumsum(np.maximum(np.rint(steps / usual), 1.0))))
    step = float(time[-1] / index[-1])
    return step, index.astype(np.int64), np.abs(time - step * index)


def low_pass(speed: np.ndarray, step: float, cutoff: float) -> np.ndarray:
    """Return even samples low-passed without shift: amplitudes times 1 / (1 + (f/cutoff)^8).

    That is Butterworth's filter of fourth order, forwards and backwards. The record is continued
    point-symmetrically about its ends, which keeps their value and slope: the straight line through
    the two ends passes as it is, the rest as a sum of sines.

    Parameters
    ----------
    speed : array, shape (n,)
    step : float, s
    cutoff : float, Hz
        Frequency at which an amplitude is halved.

    Returns
    -------
    array, shape (n,)
    """
    from scipy.fft import dst, idst

    count = speed.size - 1
    line = speed[0] + (speed[-1] - speed[0]) * np.arange(count + 1) / count
    frequency = np.arange(1, count) / (2.0 * count * step)
    sines = dst((speed - line)[1:-1], type=1)
    smooth = line.copy()
    smooth[1:-1] += idst(sines / (1.0 + (frequency / cutoff) ** 8), type=1)
    return smooth


def _cut_off(
    raw: _Raw, step: float, speed: np.ndarray, options: RecordOptions, messages: list[str]
) -> tuple[float, np.ndarray]:
    """Return the cutoff and the low-passed speeds."""
    nyquist, slowest = 0.5 / step, 1.0 / (step * (speed.size - 1))
    cutoff = 0.5 * nyquist if options.cutoff is None else options.cutoff
    if not slowest <= cutoff < nyquist:
        raise InputError(
            f"must lie between {slowest:.4g} Hz, one wave in the record, and {nyquist:.4g} Hz, "
            "half the sampling rate",
            "give another cutoff, or none for half of the upper one",
            file=raw.file,
            key="cutoff",
            value=cutoff,
        )
    smooth = low_pass(speed, step, cutoff)
    variance = float(np.var(speed))
    removed = 1.0 - float(np.var(smooth)) / variance if variance > 0.0 else 0.0
    messages.append(
        f"low-passed at {cutoff:.4g} Hz, which removed {100 * removed:.2g} % of the variance"
    )
    return cutoff, smooth


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' if number != 1 else ''}"


def _times(times: np.ndarray) -> str:
    shown = ", ".join(f"{time:.6g}" for time in times[:5])
    return f"{shown}{', ...' if times.size > 5 else ''} s"


_READERS = {
    ".csv": _read_csv,
    ".txt": _read_csv,
    ".nc": _read_netcdf,
    ".nc4": _read_netcdf,
    ".cdf": _read_netcdf,
    ".parquet": _read_parquet,
    ".pq": _read_parquet,
}
