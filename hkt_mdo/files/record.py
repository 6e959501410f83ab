"""Files of measured records: CSV, NetCDF and Parquet, brought to columns in s and m/s.

Nothing is repaired here. What cannot be read is refused with file, place and remedy.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from datetime import datetime
from itertools import islice
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.record_table import (
    MAX_BYTES,
    Columns,
    Name,
    RecordOptions,
    check_length,
    choose,
    in_si,
)
from hkt_mdo.files.record_xarray import read_netcdf, read_parquet
from hkt_mdo.files.table import Csv, parse_numbers, read_text

__all__ = ["read_columns"]

_MISSING = {"", "nan", "na", "n/a", "null", "none"}
_BLOCK = 65536
_LONGEST_DATE = 64


def _read_csv(path: Path, options: RecordOptions) -> Columns:
    """Read two columns of a CSV file, a block of rows at a time."""
    text = read_text(path, "record", MAX_BYTES)
    table = Csv(text, path, "a header such as time_s,speed_m_s")
    del text
    chosen = choose(table.header, table.header[0], options, str(path))
    time_at, speed_at = map(table.place, chosen)
    reader = _Cells(table, *chosen)
    while rows := list(islice(table, _BLOCK)):
        reader.lines.extend(line for line, _ in rows)
        check_length(len(reader.lines), str(path))
        reader.add_times([cells[time_at] for _, cells in rows])
        reader.add_speeds([cells[speed_at] for _, cells in rows])
    if not reader.lines:
        raise InputError("has a header but no samples", "add its rows", file=path)
    lines = reader.lines
    raw = Columns(
        str(path),
        chosen,
        np.array(reader.times),
        np.array(reader.speeds),
        lambda row: f"line {lines[row]}",
    )
    return in_si(raw, (Name(chosen[0]), Name(chosen[1])), reader.first is not None, options)


class _Cells:
    """Cells of the two columns on their way to numbers."""

    def __init__(self, table: Csv, time_name: str, speed_name: str) -> None:
        self.table, self.time_name, self.speed_name = table, time_name, speed_name
        self.lines, self.times, self.speeds = array("q"), array("d"), array("d")
        self.first: datetime | None = None  # where the times are dates

    def add_times(self, cells: Sequence[str]) -> None:
        """Take a block of times: dates if the first of all is no number."""
        numbers, wrong = parse_numbers(cells)
        done = len(self.times)
        if wrong == done == 0:
            self.first = self.date(cells[0], 0)
        if self.first is not None:
            self.times.extend(self.since_first(cells))
        elif wrong is not None:
            raise self.refuse_number(self.time_name, cells[wrong], done + wrong)
        else:
            self.times.frombytes(numbers.tobytes())

    def add_speeds(self, cells: Sequence[str]) -> None:
        """Take a block of speeds, which may be missing."""
        numbers, wrong = parse_numbers(cells, missing=_MISSING)
        if wrong is not None:
            row = len(self.speeds) + wrong
            more = "; leave the cell empty where the sample is missing"
            raise self.refuse_number(self.speed_name, cells[wrong], row, more)
        self.speeds.frombytes(numbers.tobytes())

    def since_first(self, cells: Sequence[str]) -> list[float]:
        """Return dates in seconds since the first."""
        seconds = []
        for row, cell in enumerate(cells, len(self.times)):
            date = self.date(cell, row)
            try:
                seconds.append((date - self.first).total_seconds())  # type: ignore[operator]
            except TypeError:
                problem = "has a zone and others have none, or the other way round"
                raise self.refuse(
                    problem, "write all dates alike", self.time_name, cell, row
                ) from None
        return seconds

    def date(self, cell: str, row: int) -> datetime:
        try:
            return datetime.fromisoformat(cell.strip()[:_LONGEST_DATE])
        except ValueError:
            problem = "is neither a number nor a date"
            remedy = "write times as numbers, or as 2024-05-01T12:00:00.0 with or without a zone"
            raise self.refuse(problem, remedy, self.time_name, cell, row) from None

    def refuse_number(self, name: str, cell: str, row: int, more: str = "") -> InputError:
        remedy = f"write it with a decimal point, no unit{more}"
        return self.refuse("must be a finite number", remedy, name, cell.strip(), row)

    def refuse(self, problem: str, remedy: str, name: str, cell: str, row: int) -> InputError:
        return self.table.refuse(problem, remedy, self.lines[row], f"column {name}", value=cell)


_READERS = {
    ".csv": _read_csv,
    ".txt": _read_csv,
    ".nc": read_netcdf,
    ".nc4": read_netcdf,
    ".cdf": read_netcdf,
    ".parquet": read_parquet,
    ".pq": read_parquet,
}


def read_columns(path: Path, options: RecordOptions) -> Columns:
    """Read time and speed from a file, of the kind that its ending says.

    Raises InputError if the file cannot be read, is too large, or its columns or units are not
    plain; also if the packages for NetCDF or Parquet are not installed.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"has the ending {path.suffix}" if path.suffix else "has no ending that says its kind",
            f"name it {', '.join(_READERS)}, whichever it is",
            file=path,
        )
    return reader(path, options)
