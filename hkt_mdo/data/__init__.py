"""Data files that come with the package, and the strict reader of CSV tables."""

from __future__ import annotations

import csv
import difflib
import io
import re
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError

__all__ = ["data_path", "locate", "read_bytes", "read_table", "shipped_names"]

MAX_TABLE_BYTES = 16 * 1024**2
"""Largest CSV file that is read, in bytes."""

_FILES: dict[str, dict[str, str]] = {
    "blade": {"bahaj2007": "bahaj2007_blade.csv"},
    "polar": {
        f"naca63815_{reynolds}": f"naca63815_polar_{reynolds}.csv"
        for reynolds in ("Re1e5", "Re2e5", "Re3e5", "Re5e5", "Re1e6", "Re2e6")
    },
    "outline": {"naca63815": "naca63815_coordinates.csv"},
    "measurement": {"bahaj2007": "bahaj2007_measured_cp.csv"},
    "reported": {"amini2023": "amini2023_reported.yaml"},
}

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_LONGEST_NUMBER = 64


def shipped_names(kind: str) -> tuple[str, ...]:
    """Return the names of the data files of one kind that come with the package.

    Parameters
    ----------
    kind : {'blade', 'polar', 'outline', 'measurement', 'reported'}
        What the file holds.

    Returns
    -------
    tuple of str
        Names that `data_path` takes.
    """
    return tuple(_FILES[kind])


def data_path(name: str, kind: str) -> Path:
    """Return the path of a data file that comes with the package.

    Parameters
    ----------
    name : str
        Short name, such as ``bahaj2007`` or ``naca63815_Re2e5``.
    kind : {'blade', 'polar', 'outline', 'measurement', 'reported'}
        What the file holds.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    InputError
        If no such file is shipped; the message lists those that are.
    """
    if kind not in _FILES:
        raise InputError("no such kind of data", f"kinds: {', '.join(_FILES)}", value=kind)
    if name not in _FILES[kind]:
        raise InputError(f"no shipped {kind} has this name", _remedy(name, kind), value=name)
    return Path(str(resources.files(__name__) / _FILES[kind][name]))


def locate(path_or_name: str | Path, kind: str) -> Path:
    """Return the file behind a shipped name, or the path itself where it is a file.

    Parameters
    ----------
    path_or_name : str or pathlib.Path
        A shipped name, which comes first, or a path.
    kind : {'blade', 'polar', 'outline', 'measurement', 'reported'}
        What the file holds.

    Returns
    -------
    pathlib.Path
        An existing file.

    Raises
    ------
    InputError
        If it is neither; the message lists the shipped names.
    """
    name = str(path_or_name)
    if name in _FILES.get(kind, {}):
        return data_path(name, kind)
    try:
        found = Path(name).is_file()
    except (OSError, ValueError):  # too long a name, a null character
        found = False
    if not found:
        raise InputError(f"is neither a shipped {kind} nor a file", _remedy(name, kind), value=name)
    return Path(name)


def _remedy(name: str, kind: str) -> str:
    known = shipped_names(kind)
    near = difflib.get_close_matches(name[:100], known, n=1)
    guess = f"did you mean {near[0]}? " if near else ""
    return f"{guess}shipped: {', '.join(known)}; or give the path of a file"


def read_bytes(path: Path, largest: int, what: str) -> bytes:
    """Return the content of a regular file of limited size.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    largest : int
        Largest size taken, in bytes.
    what : str
        What the file is to hold, for the message.

    Returns
    -------
    bytes
        The content.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or it is too large.
    """
    try:
        if not path.is_file():
            problem = "is not a file" if path.exists() else "does not exist"
            raise InputError(problem, f"give the path of a {what}", file=path)
        with path.open("rb") as stream:
            content = stream.read(largest + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"cannot be read ({reason})", f"give the path of a readable {what}", file=path
        ) from None
    if len(content) > largest:
        raise InputError(
            f"is larger than {largest / 1024**2:g} MiB",
            f"give a {what} of its usual size",
            file=path,
        )
    return content


def read_table(
    path_or_name: str | Path, columns: Sequence[str], what: str, optional: Sequence[str] = ()
) -> dict[str, np.ndarray]:
    """Read columns of numbers from a CSV file with a header line.

    Empty lines and lines that begin with ``#`` are passed over; columns that were not asked for are
    ignored.

    Parameters
    ----------
    path_or_name : str or pathlib.Path
        A shipped name or the path of a CSV file.
    columns : sequence of str
        Columns that must be there.
    what : {'blade', 'polar', 'outline', 'measurement'}
        What the table holds: where shipped names are looked up, and what messages call it.
    optional : sequence of str
        Columns that are read if they are there.

    Returns
    -------
    dict of str to numpy.ndarray
        Finite numbers, column[n_rows], n_rows >= 1; an optional column that is absent has no entry.

    Raises
    ------
    InputError
        If the file is missing, larger than 16 MiB or not UTF-8, a column is missing or appears
        twice, a line has more or fewer cells than the header, or a cell is no finite number. The
        message names file, line, column and value.
    """
    path = locate(path_or_name, what)
    content = read_bytes(path, MAX_TABLE_BYTES, f"CSV file with the {what}")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(
            "is not UTF-8 text", "save it as UTF-8", file=path, key=f"line {line}"
        ) from None

    rows = _rows(text, path)
    if not rows:
        raise InputError("is empty", f"its first line is {','.join(columns)}", file=path)
    header_line, cells = rows[0]
    header = [cell.strip() for cell in cells]
    for name in (*columns, *optional):
        if header.count(name) > 1:
            raise InputError(
                "appears twice in the header",
                "name each column once",
                file=path,
                key=f"line {header_line}, column {name}",
            )
    missing = [name for name in columns if name not in header]
    if missing:
        raise InputError(
            f"lacks the column {missing[0]}",
            f"a {what} has the columns {','.join(columns)}",
            file=path,
            key=f"line {header_line}",
            value=",".join(header),
        )
    if len(rows) == 1:
        raise InputError("has a header but no numbers", f"add the rows of the {what}", file=path)

    for line, cells in rows[1:]:
        if len(cells) != len(header):
            raise InputError(
                f"has {len(cells)} cells where the header has {len(header)}",
                "give one number for each column, separated by commas",
                file=path,
                key=f"line {line}",
                value=",".join(cells),
            )
    wanted = [name for name in (*columns, *optional) if name in header]
    return {name: _column(rows[1:], header.index(name), name, path) for name in wanted}


def _rows(text: str, path: Path) -> list[tuple[int, list[str]]]:
    """Return (line number, cells) of the lines that are neither empty nor a remark."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    rows = []
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#"):
                rows.append((reader.line_num, cells))
    except csv.Error as error:
        raise InputError(
            f"is not CSV ({error})", "mend the line", file=path, key=f"line {reader.line_num}"
        ) from None
    return rows


def _column(rows: Sequence[tuple[int, list[str]]], index: int, name: str, path: Path) -> np.ndarray:
    numbers = np.empty(len(rows))
    for place, (line, cells) in enumerate(rows):
        cell = cells[index].strip()
        plain = len(cell) <= _LONGEST_NUMBER and _NUMBER.fullmatch(cell)
        number = float(cell) if plain else np.nan
        if not np.isfinite(number):
            raise InputError(
                "must be a finite number",
                "write it with a decimal point, without a unit",
                file=path,
                key=f"line {line}, column {name}",
                value=cell,
            )
        numbers[place] = number
    return numbers
