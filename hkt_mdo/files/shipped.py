"""Data files that come with the package, and the strict reader of CSV tables."""

from __future__ import annotations

import csv
import difflib
import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError

__all__ = [
    "POLAR_FAMILIES",
    "Table",
    "data_path",
    "locate",
    "parse_number",
    "parse_table",
    "read_bytes",
    "read_table",
    "read_text",
    "shipped_names",
]

MAX_TABLE_BYTES = 16 * 1024**2
"""Largest CSV file that is read, in bytes."""

POLAR_FAMILIES: dict[str, dict[str, float]] = {
    "naca63815": {
        f"naca63815_Re{reynolds}": float(reynolds)
        for reynolds in ("1e5", "2e5", "3e5", "5e5", "1e6", "2e6")
    },
    "naca63424": {f"naca63424_Re{reynolds}": float(reynolds) for reynolds in ("1e6", "3e6", "1e7")},
    "naca4415": {
        f"naca4415_Re{reynolds}": float(reynolds) for reynolds in ("1e5", "2e5", "5e5", "1e6")
    },
}
"""Shipped polars of one section: name of the section, name of the polar, its Reynolds number."""

_FILES: dict[str, dict[str, str]] = {
    "blade": {
        "bahaj2007": "bahaj2007_blade.csv",
        "rm1": "rm1_blade.csv",
        "river": "river_blade.csv",
    },
    "polar": {
        polar: f"{polar.replace('_', '_polar_')}.csv"
        for family in POLAR_FAMILIES.values()
        for polar in family
    }
    | {"cylinder": "cylinder_polar.csv"},
    "outline": {
        name: f"{name}_coordinates.csv"
        for name in ("naca63815", "naca63424", "naca4415", "cylinder")
    },
    "measurement": {"bahaj2007": "bahaj2007_measured_cp.csv"},
    "reported": {"amini2023": "amini2023_reported.yaml"},
}

_ROTORS: dict[str, dict[str, object]] = {
    "bahaj2007": {
        "radius": 1.4,
        "hub_radius_fraction": 0.125,
        "blade_count": 3,
        "stations": (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.999),
        "set_angle": 5.0,
        "polar": "naca63815_Re2e5",
        "outline": "naca63815",
    },
    "rm1": {
        "radius": 10.0,
        "hub_radius_fraction": 0.1,
        "blade_count": 2,
        "sections": (
            {"polar": "naca63424", "outline": "naca63424"},
            {"polar": "cylinder", "outline": "cylinder"},
        ),
        "reynolds_number": 3e6,
    },
    "river": {
        "radius": 0.8,
        "hub_radius_fraction": 0.15,
        "blade_count": 3,
        "polar": "naca4415_Re2e5",
        "outline": "naca4415",
    },
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


def shipped_rotor(blade: object) -> dict[str, object]:
    """Return what of a case's section `rotor` a shipped blade brings with it; empty for others."""
    return dict(_ROTORS.get(blade, {})) if isinstance(blade, str) else {}


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
    return Path(__file__).parent / "data" / _FILES[kind][name]


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


def read_text(path: Path, what: str, largest: int = MAX_TABLE_BYTES) -> str:
    """Return the text of a regular file of limited size, without a byte order mark.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    what : str
        What the file is to hold, for the message.

    Returns
    -------
    str
        The text, line ends as they are.

    Raises
    ------
    InputError
        If the file cannot be read, is larger than 16 MiB, or is no UTF-8 text; the message names
        the line.
    """
    content = read_bytes(path, largest, what)
    wrong = None
    try:
        text = content.decode("utf-8-sig")
        if "\0" in text:
            wrong = content.index(b"\0")
    except UnicodeDecodeError as error:
        wrong = error.start
    if wrong is not None:
        line = content.count(b"\n", 0, wrong) + 1
        raise InputError("is not UTF-8 text", "save it as UTF-8", file=path, key=f"line {line}")
    return text


def parse_number(text: str) -> float | None:
    """Return a finite number written with a decimal point, or None.

    Parameters
    ----------
    text : str
        What stands in a cell, without spaces round it.

    Returns
    -------
    float or None
        None for anything else: words, nan, inf, thousands separators, other digits.
    """
    if len(text) > _LONGEST_NUMBER or not _NUMBER.fullmatch(text):
        return None
    number = float(text)
    return number if np.isfinite(number) else None


class Table(dict[str, np.ndarray]):
    """Columns of numbers by name; `lines` holds the number of each row's line in the file."""

    def __init__(self, columns: dict[str, np.ndarray], lines: Sequence[int]) -> None:
        super().__init__(columns)
        self.lines = tuple(lines)


def read_table(
    path_or_name: str | Path, columns: Sequence[str], what: str, optional: Sequence[str] = ()
) -> Table:
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
    Table
        Finite numbers, column[n_rows], n_rows >= 1; an optional column that is absent has no entry.

    Raises
    ------
    InputError
        If the file is missing, larger than 16 MiB or not UTF-8, a column is missing or appears
        twice, a line has more or fewer cells than the header, or a cell is no finite number. The
        message names file, line, column and value.
    """
    path = locate(path_or_name, what)
    text = read_text(path, f"CSV file with the {what}")
    return parse_table(text, path, columns, what, optional)


def parse_table(
    text: str, path: Path, columns: Sequence[str], what: str, optional: Sequence[str] = ()
) -> Table:
    """Read columns of numbers from the text of a CSV file; see `read_table`.

    Parameters
    ----------
    text : str
        The whole file.
    path : pathlib.Path
        The file, for messages.
    columns : sequence of str
        Columns that must be there.
    what : str
        What the table holds, for messages.
    optional : sequence of str
        Columns that are read if they are there.

    Returns
    -------
    Table
        Finite numbers, column[n_rows], n_rows >= 1.

    Raises
    ------
    InputError
        As `read_table`.
    """
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
    return Table(
        {name: _column(rows[1:], header.index(name), name, path) for name in wanted},
        [line for line, _ in rows[1:]],
    )


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
        number = parse_number(cell)
        if number is None:
            raise InputError(
                "must be a finite number",
                "write it with a decimal point, without a unit",
                file=path,
                key=f"line {line}, column {name}",
                value=cell,
            )
        numbers[place] = number
    return numbers
