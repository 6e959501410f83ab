"""Polar files: CSV, AeroDyn airfoil table, XFOIL polar; one table a Reynolds number for all."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import (
    POLAR_FAMILIES,
    data_path,
    locate,
    parse_number,
    parse_table,
    read_text,
    shipped_names,
)

__all__ = ["PolarTable", "polar_table", "read_polars"]

FEWEST_ROWS = 8
NEEDED_RANGE = -5.0, 12.0
"""Angles of attack that a table has to cover, deg; Viterna's extension begins at its ends."""

LARGEST = {"lift": 6.0, "drag": 5.0, "moment": 5.0}
"""Coefficients beyond these, either way, are no section's; most likely another unit."""

REYNOLDS_RANGE = 1e3, 1e9

_CIRCLE_EDGE = 1e-3  # deg: 3.1416 rad is meant to be 180 deg
_ENDS_EQUAL = 1e-6
_QUANTITIES = "alpha", "lift", "drag", "moment"
_FORMATS = "a CSV file alpha_deg,cl,cd, an AeroDyn airfoil table or an XFOIL polar"


@dataclass(frozen=True, eq=False)
class PolarTable:
    """Lift and drag of a section at one Reynolds number, as a file has them.

    Parameters
    ----------
    reynolds : float or None
        Reynolds number by the chord; None where the file states none.
    alpha : ndarray, shape (n_rows,), rad
        Angle of attack, strictly increasing.
    lift, drag : ndarray, shape (n_rows,)
        Lift and drag coefficient.
    moment : ndarray, shape (n_rows,), or None
        Pitching moment coefficient.
    full_circle : bool
        Whether the table runs from -pi to pi, with equal coefficients at both ends.
    source : str
        Where the table comes from, for messages.
    """

    reynolds: float | None
    alpha: np.ndarray
    lift: np.ndarray
    drag: np.ndarray
    moment: np.ndarray | None
    full_circle: bool
    source: str = ""


def read_polars(source: str | Path) -> tuple[PolarTable, ...]:
    """Read the polars of a section, one a Reynolds number.

    The format is told by the content: a CSV file with the columns ``alpha_deg`` or ``alpha_rad``,
    ``cl``, ``cd`` and, if there, ``cm`` and ``reynolds``; an airfoil file of OpenFAST's AeroDyn
    (AirfoilInfo v1.01, Reynolds numbers in millions); or polars that XFOIL or XFLR5 has written,
    one after the other.

    Parameters
    ----------
    source : str or pathlib.Path
        The path of a file, the name of a shipped polar (``naca63815_Re2e5``) or of a shipped
        section (``naca63815``: all its Reynolds numbers).

    Returns
    -------
    tuple of PolarTable
        By rising Reynolds number.

    Raises
    ------
    InputError
        If the file is missing or broken; the message names file, line, column, value and remedy.
    """
    for family, polars in POLAR_FAMILIES.items():
        if str(source) == family:
            return tuple(_read_shipped(name, reynolds) for name, reynolds in polars.items())
        if str(source) in polars:
            return (_read_shipped(str(source), polars[str(source)]),)
    try:
        path = locate(source, "polar")
    except InputError as error:
        names = ", ".join((*POLAR_FAMILIES, *shipped_names("polar")))
        remedy = f"shipped: {names}; or give the path of {_FORMATS}"
        raise InputError(error.problem, remedy, value=str(source)) from None
    text = read_text(path, "file with a polar")
    if not text.strip():
        raise InputError("is empty", f"give {_FORMATS}", file=path)
    for recognise, read in _READERS:
        if recognise.search(text):
            return _by_reynolds(read(text, path), path)
    return _by_reynolds(_read_csv(text, path), path)


def polar_table(
    alpha: np.ndarray,
    lift: np.ndarray,
    drag: np.ndarray,
    moment: np.ndarray | None = None,
    reynolds: float | None = None,
    *,
    file: object = "",
    columns: Sequence[str] = ("alpha_deg", "cl", "cd", "cm"),
    lines: Sequence[int] | None = None,
    where: str = "",
) -> PolarTable:
    """Check a polar and return it in radians.

    Parameters
    ----------
    alpha : array, shape (n_rows,), deg
        Angle of attack; in radians where the first of `columns` ends in ``_rad``.
    lift, drag : array, shape (n_rows,)
        Lift and drag coefficient.
    moment : array, shape (n_rows,), optional
        Pitching moment coefficient.
    reynolds : float, optional
        Reynolds number.
    file : str or path
        Where the polar comes from, for messages.
    columns : sequence of str
        What the file calls angle, lift, drag and moment.
    lines : sequence of int, shape (n_rows,), optional
        Number of each row's line in the file; rows are counted without it.
    where : str
        What tells this polar from others in the file, such as ``table 2``.

    Returns
    -------
    PolarTable
        The checked table.

    Raises
    ------
    InputError
        If there are fewer than 8 rows (two suffice where all are equal, as a cylinder's), angles do
        not increase strictly or cover neither -5 to 12 degrees within ±90 nor the full circle, the
        ends of a full circle differ, drag is not positive, or a number is not finite or beyond what
        sections have.
    """
    in_degrees = not columns[0].endswith("_rad")
    values = {
        name: np.asarray(column, dtype=float)
        for name, column in zip(_QUANTITIES, (alpha, lift, drag, moment), strict=True)
        if column is not None
    }
    given = values["alpha"]
    n_rows = given.size
    table = f"{where}, " if where else ""

    def refuse(problem: str, remedy: str, quantity: str = "", row: int | None = None) -> InputError:
        if row is None:
            span = f"{given[0]:g} … {given[-1]:g}" if n_rows else "nothing"
            return InputError(problem, remedy, file=file, key=f"{table}{columns[0]}", value=span)
        place = f"row {row + 1}" if lines is None else f"line {lines[row]}"
        column = columns[_QUANTITIES.index(quantity)]
        number = float(values[quantity][row])
        return InputError(
            problem, remedy, file=file, key=f"{table}{place}, column {column}", value=number
        )

    for name, column in values.items():
        wrong = np.flatnonzero(~np.isfinite(column))
        if wrong.size:
            raise refuse("must be a finite number", "correct the row", name, int(wrong[0]))
    angle = given if in_degrees else np.rad2deg(given)
    if n_rows and np.max(np.abs(angle)) > 180.0 + _CIRCLE_EDGE:
        row = int(np.argmax(np.abs(angle)))
        unit = "" if in_degrees else "; if these are degrees, name the column alpha_deg"
        raise refuse(
            "lies beyond the full circle",
            f"angles of attack run from -180 to 180 degrees{unit}",
            "alpha",
            row,
        )
    circle = n_rows > 1 and angle[0] <= -180 + _CIRCLE_EDGE and angle[-1] >= 180 - _CIRCLE_EDGE
    radians = np.deg2rad(given) if in_degrees else given.copy()
    if circle:
        radians[0], radians[-1] = -np.pi, np.pi
    falls = np.flatnonzero(np.diff(radians) <= 0.0)
    if falls.size:
        row = int(falls[0]) + 1
        raise refuse(
            f"follows {given[row - 1]:g}: angles must increase strictly",
            "sort the rows and remove duplicates",
            "alpha",
            row,
        )
    even = all(np.ptp(values[name]) == 0.0 for name in ("lift", "drag")) if n_rows else False
    if n_rows < FEWEST_ROWS and not (circle and even):
        raise refuse(
            f"the polar has {n_rows} rows, at least {FEWEST_ROWS} angles of attack are needed",
            "give a finer table",
        )
    low, high = NEEDED_RANGE
    if not circle and (angle[0] > low or angle[-1] < high or angle[0] < -90 or angle[-1] > 90):
        remedy = "extend or cut it (beyond the table the polar is extended by Viterna)"
        if in_degrees and np.max(np.abs(angle)) <= np.pi:
            remedy = f"if these are radians, convert them or name the column alpha_rad; {remedy}"
        raise refuse(
            f"the table must reach from {low:g} or less to {high:g} or more and stay within -90 and"
            " 90 degrees, or run from -180 to 180",
            remedy,
        )
    for name in ("lift", "drag", "moment"):
        if circle and name in values:
            first, last = values[name][0], values[name][-1]
            if abs(last - first) > _ENDS_EQUAL:
                raise refuse(
                    f"differs from {first:g} at -180 degrees",
                    "-180 and 180 degrees are one angle: give both rows the same coefficients",
                    name,
                    n_rows - 1,
                )
    if np.min(values["drag"]) <= 0.0:
        row = int(np.argmin(values["drag"]))
        raise refuse("drag must be positive", "correct the row", "drag", row)
    for name, largest in LARGEST.items():
        if name in values and np.max(np.abs(values[name])) > largest:
            row = int(np.argmax(np.abs(values[name])))
            raise refuse(
                f"is beyond {largest:g}, which no section has",
                "give the coefficient as a plain number, not in counts or percent",
                name,
                row,
            )
    return PolarTable(
        None if reynolds is None else float(reynolds),
        radians,
        values["lift"],
        values["drag"],
        values.get("moment"),
        bool(circle),
        f"{file}, {where}" if where else str(file),
    )


def _read_shipped(name: str, reynolds: float) -> PolarTable:
    path = data_path(name, "polar")
    (table,) = _read_csv(read_text(path, "polar"), path)
    return replace(table, reynolds=reynolds)


def _by_reynolds(tables: list[PolarTable], path: Path) -> tuple[PolarTable, ...]:
    """Return the tables by rising Reynolds number, each number once."""
    ordered = sorted(tables, key=lambda table: table.reynolds or 0.0)
    for one, other in pairwise(ordered):
        if one.reynolds == other.reynolds:
            raise InputError(
                "stands over two tables",
                "give one table for each Reynolds number",
                file=path,
                key="Reynolds number",
                value=other.reynolds,
            )
    return tuple(ordered)


def _check_reynolds(number: float | None, cell: str, path: Path, key: str, unit: float = 1.0):
    low, high = REYNOLDS_RANGE
    if number is None or not low <= number <= high:
        scale = "in millions, such as 0.2" if unit != 1.0 else "as a plain number, such as 2e5"
        raise InputError(
            f"is no Reynolds number between {low / unit:g} and {high / unit:g}",
            f"give it {scale}",
            file=path,
            key=key,
            value=cell,
        )
    return number


# CSV ----------------------------------------------------------------------------------------------


def _read_csv(text: str, path: Path) -> list[PolarTable]:
    said = ((number, line.strip()) for number, line in enumerate(_lines_of(text), start=1))
    at, header = next(((n, line) for n, line in said if line and line[0] != "#"), (1, ""))
    names = [name.strip() for name in header.split(",")]
    angle = "alpha_rad" if "alpha_rad" in names else "alpha_deg"
    problem = ""
    if angle == "alpha_rad" and "alpha_deg" in names:
        problem, remedy = "names both alpha_deg and alpha_rad", "keep one of them"
    elif not {angle, "cl", "cd"} & set(names):
        problem, remedy = f"is no header of {angle},cl,cd", f"give {_FORMATS}"
    if problem:
        raise InputError(problem, remedy, file=path, key=f"line {at}", value=header)
    columns = angle, "cl", "cd", "cm"
    table = parse_table(text, path, columns[:3], "polar", optional=("cm", "reynolds"))
    line = np.array(table.lines)

    def part(rows: np.ndarray, reynolds: float | None) -> PolarTable:
        return polar_table(
            table[angle][rows],
            table["cl"][rows],
            table["cd"][rows],
            table["cm"][rows] if "cm" in table else None,
            reynolds,
            file=path,
            columns=columns,
            lines=line[rows].tolist(),
            where="" if reynolds is None else f"reynolds = {reynolds:g}",
        )

    if "reynolds" not in table:
        return [part(np.arange(line.size), None)]
    for row, number in enumerate(table["reynolds"].tolist()):
        _check_reynolds(number, f"{number:g}", path, f"line {line[row]}, column reynolds")
    return [
        part(np.flatnonzero(table["reynolds"] == number), float(number))
        for number in np.unique(table["reynolds"])
    ]


# Tables in columns of text ------------------------------------------------------------------------


def _lines_of(text: str) -> list[str]:
    return re.split(r"\r\n|\r|\n", text)


def _row(line: int, cells: Sequence[str], n_cells: int, path: Path) -> list[float]:
    """Return the numbers of a row; any number of them where `n_cells` is 0."""
    if n_cells and len(cells) != n_cells:
        raise InputError(
            f"has {len(cells)} numbers where {n_cells} are expected",
            "give every row of the table the same columns",
            file=path,
            key=f"line {line}",
            value=" ".join(cells),
        )
    numbers = []
    for column, cell in enumerate(cells, start=1):
        number = parse_number(re.sub("[dD]", "e", cell))  # Fortran's double precision
        if number is None:
            raise InputError(
                "must be a finite number",
                "correct the row, or leave it out",
                file=path,
                key=f"line {line}, column {column}",
                value=cell,
            )
        numbers.append(number)
    return numbers


# AeroDyn ------------------------------------------------------------------------------------------

_SETTING = re.compile(r"""\s*(@?"[^"]*"|@?'[^']*'|\S+)\s+([A-Za-z]\w*)""")
_AERODYN_KEYS = "InterpOrd|RelThickness|NonDimArea|NumCoords|NumTabs|InclUAdata|NumAlf"
_AERODYN_REMEDY = "see OpenFAST's AirfoilInfo v1.01 files"


class _AeroDynLines:
    """The lines of an AeroDyn file that say something, read one after the other."""

    def __init__(self, text: str, path: Path) -> None:
        self.path = path
        self.at = 0
        self.lines: list[tuple[int, str, list[str]]] = []  # number, text, names of columns above
        names: list[str] = []
        for number, line in enumerate(_lines_of(text), start=1):
            remark = line.lstrip()
            if remark.startswith(("!", "#", "%")):
                words = [re.sub(r"\W|_", "", word).lower() for word in remark.lstrip("!#%").split()]
                if words and words[0] in ("alpha", "aoa", "alfa"):
                    names = words
            elif line.strip():
                self.lines.append((number, line.partition("!")[0].strip(), names))
                names = []

    def refusal(self, problem: str, remedy: str = _AERODYN_REMEDY) -> InputError:
        if self.at < len(self.lines):
            number, text, _ = self.lines[self.at]
            return InputError(problem, remedy, file=self.path, key=f"line {number}", value=text)
        return InputError(f"the file ends where {problem}", remedy, file=self.path, key="end")

    def setting(self, keyword: str) -> tuple[int, str]:
        """Return line number and value of the next setting of this name, passing over others."""
        while self.at < len(self.lines):
            number, text, _ = self.lines[self.at]
            found = _SETTING.match(text)
            if text.startswith("@") and not found:
                raise self.refusal(
                    "takes its tables from another file", "paste that file in place of this line"
                )
            name = found[2].lower() if found else ""
            later = name in ("numtabs", "re", "numalf") and name != keyword.lower()
            if found is None or later:
                raise self.refusal(
                    f"comes where {keyword} is expected",
                    "NumAlf counts the rows of a table, NumTabs the tables, and each table has its "
                    "line Re",
                )
            self.at += 1
            if name == keyword.lower():
                return number, found[1]
            if name == "numcoords" and not found[1].startswith("@"):
                self.at += self.count("NumCoords", number, found[1], 0)
        raise self.refusal(f"{keyword} is expected")

    def count(self, keyword: str, number: int, text: str, fewest: int = 1) -> int:
        if not re.fullmatch(r"\d{1,6}", text, re.ASCII) or int(text) < fewest:
            raise InputError(
                f"must be a whole number of at least {fewest}",
                _AERODYN_REMEDY,
                file=self.path,
                key=f"line {number}, {keyword}",
                value=text,
            )
        return int(text)


def _read_aerodyn(text: str, path: Path) -> list[PolarTable]:
    file = _AeroDynLines(text, path)
    n_tables = file.count("NumTabs", *file.setting("NumTabs"))
    tables = [_read_aerodyn_table(file, index + 1) for index in range(n_tables)]
    if file.at < len(file.lines):
        raise file.refusal(
            "follows the last row of the last table",
            "NumAlf counts the rows of a table, NumTabs the tables",
        )
    return tables


def _read_aerodyn_table(file: _AeroDynLines, index: int) -> PolarTable:
    path = file.path
    at, cell = file.setting("Re")
    millions = parse_number(re.sub("[dD]", "e", cell))
    reynolds = _check_reynolds(
        millions and 1e6 * millions, cell, path, f"line {at}, Re of table {index}", 1e6
    )
    at, cell = file.setting("NumAlf")
    n_rows = file.count("NumAlf", at, cell)
    names = file.lines[file.at][2] if file.at < len(file.lines) else []
    if names and names[1:3] != ["cl", "cd"]:
        raise InputError(
            "the columns are to be Alpha, Cl, Cd and perhaps Cm",
            "put them in this order",
            file=path,
            key=f"table {index}, line {file.lines[file.at][0]}",
            value=" ".join(names),
        )
    rows: list[list[float]] = []
    lines = []
    while len(rows) < n_rows:
        number, line, _ = file.lines[file.at] if file.at < len(file.lines) else (0, "", [])
        cells = re.split(r"[\s,]+", line)
        if parse_number(re.sub("[dD]", "e", cells[0])) is None or (
            len(cells) > 1 and cells[1].lower() in ("re", "userprop", "ctrl")
        ):
            raise file.refusal(
                f"row {len(rows) + 1} of NumAlf = {n_rows} (line {at}) is expected",
                "NumAlf counts the rows of a table",
            )
        rows.append(_row(number, cells, len(rows[0]) if rows else 0, path))
        lines.append(number)
        file.at += 1
    columns = np.array(rows).T
    if len(columns) < 3:
        raise InputError(
            "has fewer than three columns",
            "give Alpha, Cl and Cd in every row",
            file=path,
            key=f"line {lines[0]}",
        )
    # Without names the fourth column is the moment; MHK files have the lowest pressure there.
    moment = names.index("cm") if "cm" in names else (0 if names else 3)
    return polar_table(
        columns[0],
        columns[1],
        columns[2],
        columns[moment] if 0 < moment < len(columns) else None,
        reynolds,
        file=path,
        columns=("Alpha", "Cl", "Cd", "Cm"),
        lines=lines,
        where=f"table {index}",
    )


def _refuse_old_aerodyn(text: str, path: Path) -> list[PolarTable]:
    number = text[: text.lower().index("number of airfoil tables")].count("\n") + 1
    raise InputError(
        "is an airfoil table of AeroDyn 14 or older",
        "copy its rows into a CSV file alpha_deg,cl,cd,cm",
        file=path,
        key=f"line {number}",
    )


# XFOIL --------------------------------------------------------------------------------------------

_XFOIL_BEGIN = re.compile(r"Calculated polar for\s*:", re.IGNORECASE)
_XFOIL_NEXT = re.compile(r"\s*(XFOIL|xflr5)\b|.*Calculated polar for", re.IGNORECASE)
_XFOIL_REYNOLDS = re.compile(r"\bRe\s*=\s*([^\s=]+?)(?:\s*[eE]\s*([+-]?\d{1,3}))?(?=\s|$)")
_XFOIL_REMEDY = "give the file as XFOIL's PACC has written it"


def _read_xfoil(text: str, path: Path) -> list[PolarTable]:
    lines = list(enumerate(_lines_of(text), start=1))
    begins = [at for at, (_, line) in enumerate(lines) if _XFOIL_BEGIN.search(line)]
    if not begins:
        raise InputError(
            "lacks the line Calculated polar for:", _XFOIL_REMEDY, file=path, key="line 1"
        )
    parts = [lines[low:high] for low, high in pairwise([*begins, len(lines)])]
    return [
        _read_xfoil_polar(part, path, f"polar {index}" if len(parts) > 1 else "")
        for index, part in enumerate(parts, start=1)
    ]


def _read_xfoil_polar(part: list[tuple[int, str]], path: Path, where: str) -> PolarTable:
    begin = f"line {part[0][0]}"
    reynolds = None
    names: list[str] = []
    rows: list[list[float]] = []
    numbers: list[int] = []
    for number, line in part:
        words = re.sub(r"(?i)\b(top|bot) (xtr|itr)\b", r"\1_\2", line).split()
        if names:
            if _XFOIL_NEXT.match(line):
                break
            if words and set(line.strip()) - set("- "):
                rows.append(_row(number, words, len(names), path))
                numbers.append(number)
        elif words and words[0].lower() == "alpha":
            names = [word.lower() for word in words]
            missing = next((name for name in ("cl", "cd") if name not in names), None)
            if missing:
                raise InputError(
                    f"lacks the column {missing.upper()}",
                    _XFOIL_REMEDY,
                    file=path,
                    key=f"line {number}",
                    value=line.strip(),
                )
        elif re.search(r"Reynolds number\s*~", line):
            raise InputError(
                "the Reynolds number varies along this polar",
                "run XFOIL at a fixed Reynolds number (TYPE 1)",
                file=path,
                key=f"line {number}",
                value=line.strip(),
            )
        elif found := _XFOIL_REYNOLDS.search(line):
            cell = f"{found[1]}e{found[2]}" if found[2] else found[1]
            reynolds = _check_reynolds(parse_number(cell), cell, path, f"line {number}, Re")
    if not names or reynolds is None:
        lacking = "the line of column names alpha CL CD" if reynolds else "the line Mach = Re ="
        raise InputError(
            f"the polar that begins here lacks {lacking}", _XFOIL_REMEDY, file=path, key=begin
        )
    if not rows:
        raise InputError(
            "the polar that begins here has no rows", _XFOIL_REMEDY, file=path, key=begin
        )
    columns = dict(zip(names, np.array(rows).T, strict=True))
    return polar_table(
        columns["alpha"],
        columns["cl"],
        columns["cd"],
        columns.get("cm"),
        reynolds,
        file=path,
        columns=("alpha", "CL", "CD", "CM"),
        lines=numbers,
        where=where,
    )


_READERS = (
    (
        re.compile(
            rf"""^[ \t]*(@?"[^"\n]*"|\S+)[ \t]+({_AERODYN_KEYS})\b|^!.*AirfoilInfo""",
            re.MULTILINE | re.IGNORECASE,
        ),
        _read_aerodyn,
    ),
    (re.compile(r"Number of airfoil tables", re.IGNORECASE), _refuse_old_aerodyn),
    (
        re.compile(r"\A\s*(XFOIL|xflr5)\b|Calculated polar for", re.IGNORECASE),
        _read_xfoil,
    ),
)
