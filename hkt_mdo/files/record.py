"""Files of measured records: CSV, NetCDF and Parquet, brought to columns in s and m/s.

Nothing is repaired here. What cannot be read is refused with file, place and remedy.
"""

from __future__ import annotations

from array import array
from datetime import datetime
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.record_table import MAX_BYTES, Columns, RecordOptions, check_length, choose
from hkt_mdo.files.record_xarray import read_binary
from hkt_mdo.files.table import Csv, line_error, parse_number, read_text

__all__ = ["read_columns"]

_MISSING = {"", "nan", "na", "n/a", "null", "none"}
_LONGEST_DATE = 64
_PLAIN = "write it with a decimal point, no unit"
_DATES = "write times as numbers, or as 2024-05-01T12:00:00.0 with or without a zone"


def _read_csv(path: Path, options: RecordOptions) -> Columns:
    """Read two columns of a CSV file."""
    file = str(path)
    table = Csv(read_text(path, "record", MAX_BYTES), path, "a header such as time_s,speed_m_s")
    names = choose(table.header, table.header[0], options, file)
    places = [table.place(name) for name in names]
    lines, times, speeds = array("q"), array("d"), array("d")
    first: datetime | None = None  # where the times are dates
    for line, cells in table:
        time, speed = (cells[place].strip() for place in places)
        seconds, problem, remedy = parse_number(time), "", ""
        if first or (seconds is None and not lines):
            try:
                date = datetime.fromisoformat(time[:_LONGEST_DATE])
                first = first or date
                seconds = (date - first).total_seconds()
            except ValueError:
                problem, remedy = "is neither a number nor a date", _DATES
            except TypeError:
                problem = "has a zone and others have none, or the other way round"
                remedy = "write all dates alike"
        elif seconds is None:
            problem, remedy = "must be a finite number", _PLAIN
        if problem:
            raise line_error(path, line, problem, remedy, f"column {names[0]}", value=time)
        number = np.nan if speed.lower() in _MISSING else parse_number(speed)
        if number is None:
            problem, remedy = (
                "must be a finite number",
                f"{_PLAIN}; leave the cell empty where the ",
            )
            remedy += "sample is missing"
            raise line_error(path, line, problem, remedy, f"column {names[1]}", value=speed)
        lines.append(line)
        times.append(seconds)
        speeds.append(number)
        check_length(len(lines), file)
    if not lines:
        raise InputError("has a header but no samples", "add its rows", file=path)
    raw = Columns(file, names, np.array(times), np.array(speeds), lambda row: f"line {lines[row]}")
    return raw.in_si(first is not None, options)


_READERS = dict.fromkeys((".csv", ".txt"), _read_csv)
_READERS |= dict.fromkeys((".nc", ".nc4", ".cdf", ".parquet", ".pq"), read_binary)


def read_columns(path: Path, options: RecordOptions) -> Columns:
    """Read time and speed from a file, of the kind that its ending says.

    Raises InputError if the file cannot be read, is too large, or its columns or units are not
    plain; also if the packages for NetCDF or Parquet are not installed.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        ending = path.suffix
        problem = f"has the ending {ending}" if ending else "has no ending that says its kind"
        remedy = f"name it {', '.join(_READERS)}, whichever it is"
        raise InputError(problem, remedy, file=path)
    return reader(path, options)
