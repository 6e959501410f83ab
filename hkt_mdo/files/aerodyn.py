"""Files of OpenFAST's AeroDyn 15: blade definitions, and airfoil tables (also AeroDyn 13's).

Numbers may have Fortran's exponents (1.0D+00).
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.blade_table import FEWEST_ROWS, MOST_ROWS, BladeTable, check_rows
from hkt_mdo.files.polar_table import PolarTable, Source, check_reynolds, polar_table
from hkt_mdo.files.table import (
    Column,
    fortran_number,
    line_error,
    lines_of,
    number_columns,
    read_text,
)

# Airfoil tables -----------------------------------------------------------------------------------

_SETTING = re.compile(r"""\s*(@?"[^"]*"|@?'[^']*'|\S+)\s+([A-Za-z]\w*)""")
OLD_COUNT = re.compile(r"Number of airfoil tables", re.IGNORECASE)
"""In the line of an airfoil file of AeroDyn 14 or older that says how many tables it has."""

_REMEDY = "see OpenFAST's AirfoilInfo v1.01 files"
_COUNTS = "NumAlf counts the rows of a table, NumTabs the tables"


class _Lines:
    """The lines of an airfoil file without remarks, which are read one after the other."""

    def __init__(self, text: str, file: Path) -> None:
        self.file, self.at = file, 0
        self.lines: list[tuple[int, str, list[str]]] = []  # number, text, names of columns above
        names: list[str] = []
        for number, line in enumerate([*lines_of(text.rstrip()), ""], start=1):
            remark = line.lstrip()
            if remark.startswith(("!", "#", "%")):
                words = [re.sub(r"\W|_", "", word).lower() for word in remark.lstrip("!#%").split()]
                if words and words[0] in ("alpha", "aoa", "alfa"):
                    names = words
            elif remark:
                self.lines.append((number, line.partition("!")[0].strip(), names))
                names = []
        self.lines.append((number, "", []))

    def refuse(self, problem: str, remedy: str) -> InputError:
        """Return the error of the next line."""
        number, text, _ = self.lines[self.at]
        return line_error(self.file, number, problem, remedy, value=text)

    def refuse_unexpected(self, expected: str, remedy: str = _COUNTS) -> InputError:
        """Return the error of a line, or of the end, that comes before what is expected."""
        begin = "comes" if self.at < len(self.lines) - 1 else "the file ends"
        return self.refuse(f"{begin} where {expected} is expected", remedy)

    def setting(self, keyword: str) -> tuple[int, str]:
        """Return line number and value of the next setting of this name, passing over others."""
        while True:
            number, text, _ = self.lines[self.at]
            match = _SETTING.match(text)
            name = match[2].lower() if match else ""
            if text.startswith("@") and not match:
                remedy = "paste that file in place of this line"
                raise self.refuse("takes its tables from another file", remedy)
            if match is None or (name in ("numtabs", "re", "numalf") and name != keyword.lower()):
                remedy = f"{_COUNTS}, and each table has its line Re"
                raise self.refuse_unexpected(keyword, remedy)
            self.at += 1
            if name == keyword.lower():
                return number, match[1]
            if name == "numcoords" and not match[1].startswith("@"):
                after = self.at + self.count("NumCoords", number, match[1], 0)
                self.at = min(after, len(self.lines) - 1)

    def count(self, keyword: str, number: int, text: str, fewest: int = 1) -> int:
        """Return the number of rows or tables that a setting in line `number` states."""
        if not re.fullmatch(r"\d{1,6}", text, re.ASCII) or int(text) < fewest:
            problem = f"must be a whole number of at least {fewest}"
            raise line_error(self.file, number, problem, _REMEDY, keyword, value=text)
        return int(text)

    def rows(self, count: int, count_line: int) -> list[tuple[int, list[str]]]:
        """Return line number and cells of the rows that NumAlf, in line `count_line`, promises."""
        rows: list[tuple[int, list[str]]] = []
        while len(rows) < count:
            number, line, _ = self.lines[self.at]
            cells = re.split(r"[\s,]+", line)
            setting = len(cells) > 1 and cells[1].lower() in ("re", "userprop", "ctrl")
            if setting or fortran_number(cells[0]) is None:
                expected = f"row {len(rows) + 1} of NumAlf = {count} (line {count_line})"
                raise self.refuse_unexpected(expected)
            rows.append((number, cells))
            self.at += 1
        return rows


def read_airfoil(text: str, path: Path) -> list[PolarTable]:
    """Read the tables of an airfoil file of AeroDyn 15.

    The format is AirfoilInfo v1.01 of OpenFAST, https://openfast.readthedocs.io; the file's
    Reynolds numbers are in millions.

    Parameters
    ----------
    text : str
        Content of the file.
    path : pathlib.Path
        The file, for messages.

    Returns
    -------
    list of PolarTable
        The tables in the order of the file.

    Raises
    ------
    InputError
        If the file is broken; the message names the line.
    """
    file = _Lines(text, path)
    n_tables = file.count("NumTabs", *file.setting("NumTabs"))
    tables = [_read_table(file, f"table {index + 1}") for index in range(n_tables)]
    if file.at < len(file.lines) - 1:
        raise file.refuse("follows the last row of the last table", _COUNTS)
    return tables


def _read_table(file: _Lines, where: str) -> PolarTable:
    """Read the next table; `where` tells it from others in the file."""
    line, cell = file.setting("Re")
    reynolds = check_reynolds(fortran_number(cell), cell, file.file, f"line {line}, Re", 1e6)
    count_line, cell = file.setting("NumAlf")
    line, _, names = file.lines[file.at]
    if names and names[1:3] != ["cl", "cd"]:
        problem = "the columns are to be Alpha, Cl, Cd and optionally Cm and Cpmin"
        remedy = "put them in order"
        raise line_error(file.file, line, problem, remedy, where, value=" ".join(names))
    rows = file.rows(file.count("NumAlf", count_line, cell), count_line)
    numbers = [str(number + 1) for number in range(len(rows[0][1]))]
    read = number_columns(rows, numbers, file.file, numbers).values()
    if len(read) < 3:
        remedy = "give Alpha, Cl and Cd in every row"
        raise line_error(file.file, rows[0][0], "has fewer than three columns", remedy)
    # Without names the fourth column is the moment; MHK files have the smallest pressure there.
    names = names or ["alpha", "cl", "cd", "cm"]
    alpha, lift, drag, *_ = columns = [column.values for column in read]
    further = dict(zip(names[3:], columns[3:], strict=False))
    pressure = {"Cpmin": further["cpmin"]} if "cpmin" in further else None
    source = Source(file.file, where, ("Alpha", "Cl", "Cd", "Cm"), [line for line, _ in rows])
    return polar_table(alpha, lift, drag, further.get("cm"), reynolds, pressure, source)


FEWEST_POINTS = 10
"""Fewer points show no section."""

_OLD_REMEDY = "see the airfoil files of AeroDyn 13, or copy the rows into a CSV file"


def read_old_airfoil(text: str, path: Path) -> list[PolarTable]:
    """Read the tables of an airfoil file of AeroDyn 13 or 14, as WT_Perf and HARP_Opt have them.

    After lines of text and the number of tables, each table has some lines of a number and its
    meaning, the first of them the Reynolds number in millions, then its rows, and ``EOT``.

    Parameters
    ----------
    text : str
        Content of the file.
    path : pathlib.Path
        The file, for messages.

    Returns
    -------
    list of PolarTable
        The tables in the order of the file. The fourth column is the smallest pressure coefficient
        if the text says so, else the moment.

    Raises
    ------
    InputError
        If the file is broken, or older, with its tables beside each other; with the line.
    """  # noqa: DOC501 - `line_error` returns an InputError
    lines = list(enumerate(lines_of(text), start=1))
    begin = next(at for at, (_, line) in enumerate(lines) if OLD_COUNT.search(line))
    number, counted = lines[begin]
    count = int(fortran_number(counted.split()[0]) or 0)
    about = " ".join(line for _, line in lines[:begin]).lower()
    fourth = "cpmin" if re.search(r"min\w* pressure|cpmin", about) else "cm"
    tables: list[PolarTable] = []
    block: list[tuple[int, list[str]]] = []
    for line, content in [*lines[begin + 1 :], (lines[-1][0], "EOT")]:
        cells = re.split(r"[\s,]+", content.strip())
        if cells[0].upper() != "EOT":
            block += [(line, cells)] if content.strip() else []
        elif block:
            where = f"table {len(tables) + 1}"
            tables.append(_read_old_table(block, path, where, fourth, count == 1))
            block = []
    if len(tables) != count:
        problem = f"is not the number of tables that end with EOT, {len(tables)}"
        raise line_error(path, number, problem, _OLD_REMEDY, value=counted.strip())
    return tables


def _read_old_table(
    block: list[tuple[int, list[str]]], path: Path, where: str, fourth: str, alone: bool
) -> PolarTable:
    """Read a table of AeroDyn 13 from the lines between two EOT; one alone may have Re = 0."""
    line, cells = block[0]
    if len(cells) > 1 and fortran_number(cells[1]) is not None:
        problem = (
            "has several Reynolds numbers: its tables stand beside each other, as of AeroDyn 12"
        )
        raise line_error(path, line, problem, _OLD_REMEDY, where, value=" ".join(cells))
    reynolds = fortran_number(cells[0])
    where_re = f"line {line}, Re"
    zero = alone and reynolds == 0.0
    reynolds = None if zero else check_reynolds(reynolds, cells[0], path, where_re, 1e6)
    rows = [row for row in block if len(row[1]) > 2 and None not in map(fortran_number, row[1])]
    if not rows:
        raise line_error(path, line, "begins a table without rows", _OLD_REMEDY, where)
    names = ["alpha", "cl", "cd", fourth][: len(rows[0][1])]
    given = {
        name: column.values for name, column in number_columns(rows, names, path, names).items()
    }
    pressure = {"Cpmin": given.pop("cpmin")} if "cpmin" in given else None
    source = Source(path, where, ("alpha", "cl", "cd", "cm"), [number for number, _ in rows])
    return polar_table(*given.values(), reynolds=reynolds, pressure=pressure, source=source)


_COORDINATES = re.compile(
    r"""^[ \t]*(@?"[^"\n]*"|@?'[^'\n]*'|\S+)[ \t]+NumCoords\b""", re.MULTILINE | re.IGNORECASE
)


def coordinates_of(airfoil: Path) -> Path:
    """Return the file that holds the coordinates of a section.

    Parameters
    ----------
    airfoil : pathlib.Path
        An airfoil file of AeroDyn, or any other file.

    Returns
    -------
    pathlib.Path
        The file that the airfoil file names at ``NumCoords``, from its own folder; else itself.

    Raises
    ------
    InputError
        If the file cannot be read, or the one that it names does not exist.
    """  # noqa: DOC501 - `line_error` returns an InputError
    text = read_text(airfoil, "file with an outline")
    match = _COORDINATES.search(text)
    named = match and _named(match, airfoil)
    if not match or not named:
        return airfoil
    if not named.is_file():
        line = len(lines_of(text[: match.end()]))
        remedy = "put the file there, or give another outline"
        raise line_error(airfoil, line, "does not exist", remedy, "NumCoords", value=str(named))
    return named


def has_coordinates(airfoil: str) -> bool:
    """Tell whether an airfoil file of AeroDyn holds coordinates, or names a file that exists.

    Parameters
    ----------
    airfoil : str
        A path, or anything else.

    Returns
    -------
    bool
        False also for files of other formats, and for those that cannot be read.
    """
    try:
        match = _COORDINATES.search(read_text(Path(airfoil), "file with a polar"))
    except InputError:  # said where the polar is read
        return False
    if not match:
        return False
    named = _named(match, Path(airfoil))
    return named.is_file() if named else (fortran_number(match[1]) or 0.0) >= FEWEST_POINTS


def _named(match: re.Match[str], airfoil: Path) -> Path | None:
    """Return the file that a setting NumCoords names by an @, if it does."""
    name = match[1].removeprefix("@").strip("\"'").replace("\\", "/")
    return airfoil.parent / name if match[1].startswith("@") else None


# Blade definition ---------------------------------------------------------------------------------

# Units of the columns; see the input files of AeroDyn at https://openfast.readthedocs.io.
_UNITS = {"BlSpn": "m", "BlCrvAC": "m", "BlSwpAC": "m", "BlCrvAng": "deg"}
_UNITS |= {"BlTwist": "deg", "BlChord": "m", "BlAFID": "-", "t_c": "-"}
_NEEDED = ("BlSpn", "BlTwist", "BlChord", "BlAFID")
AT_HUB = 1e-3
"""How far over the span the first row may be from the hub's radius to count as there."""

_USUAL = "BlSpn BlCrvAC BlSwpAC BlCrvAng BlTwist BlChord BlAFID"


def read_blade_definition(text: str, file: Path, hub_radius: float | None) -> BladeTable:
    """Read an AeroDyn 15 blade file.

    OpenFAST's form: a line ``19 NumBlNds``, one of column names, one of units, NumBlNds rows. The
    columns are identified by their names, since their number grew over the versions.

    Parameters
    ----------
    text : str
        Content of the file.
    file : pathlib.Path
        The file, for messages.
    hub_radius : float or None
        Radius of the blade's root, m, from which the file counts its span.

    Returns
    -------
    BladeTable
        The rows in SI units and radians.

    Raises
    ------
    InputError
        If the file is broken, with the line, or `hub_radius` is None.
    """
    columns, messages = _blade_columns(lines_of(text.rstrip()), file)
    span, degrees, chord, section = (columns[name] for name in _NEEDED)
    unknown = np.full(span.values.size, hub_radius is None)
    problem = "is measured from the blade's root, whose radius an AeroDyn file does not contain"
    span.refuse(unknown, problem, "give the hub radius in metres")
    first, last = float(span.values[0]), float(span.values[-1])
    messages.append("BlTwist: degrees converted to radians")
    at_hub = np.array([0.0 < first and abs(first - (hub_radius or 0.0)) < AT_HUB * last])
    problem = "is the hub's radius, and AeroDyn counts the span from the blade's root"
    span.refuse(at_hub, problem, "subtract the hub's radius from the column")
    if first > 0.0:
        note = f"rows begin {first:g} m ({100.0 * first / last:.3g} % of the span) outboard of the"
        messages.append(f"BlSpn: {note} blade's root, from which AeroDyn counts")
    if hub_radius:
        messages.append(f"BlSpn: measured from the root, hub radius of {hub_radius:g} m added")
    for name, what in (("BlCrvAC", "prebend"), ("BlSwpAC", "sweep"), ("BlCrvAng", "cant angle")):
        if name in columns and np.any(columns[name].values != 0.0):
            largest = f"{np.max(np.abs(columns[name].values)):g} {_UNITS[name]}"
            messages.append(f"{name}: {what} of up to {largest} is ignored: straight blade")
    thickness = columns.get("t_c")
    if thickness is not None and not np.any(thickness.values):
        messages.append("t_c: all 0, taken as not given")
        thickness = None
    # check_rows is given the span as the radius, so that its messages quote what the file says.
    twist = replace(degrees, values=np.deg2rad(degrees.values))
    check_rows(span, chord, twist, thickness, hub_radius + float(np.max(span.values)))
    r = hub_radius + span.values
    span.check_rising("radii", r)  # spans that differ may give one radius by rounding
    wrong = (section.values < 1.0) | (section.values != np.floor(section.values))
    remedy = "give the place in AeroDyn's list of airfoil files, from 1"
    section.refuse(wrong, "is no number of an airfoil", remedy)
    return BladeTable(
        r,
        chord.values,
        twist.values,
        thickness=None if thickness is None else thickness.values,
        section=tuple(f"{number:.0f}" for number in section.values),
        tip_radius=float(r[-1]),
        hub_radius=float(hub_radius),
        messages=tuple(messages),
        file=str(file),
    )


def _blade_columns(lines: list[str], file: Path) -> tuple[dict[str, Column], list[str]]:
    """Return the columns in the file's units, and messages about rows that are ignored."""
    matches = (re.match(r"\s*(\S+)\s+NumBlNds\b", line, re.IGNORECASE) for line in lines)
    counts = ((number, match[1]) for number, match in enumerate(matches, 1) if match)
    count_line, cell = next(counts, (0, ""))
    if not count_line:
        problem = "has no line `19 NumBlNds`, so it is no AeroDyn 15 blade file"
        remedy = "give the blade file (ADBlFile) that AeroDyn's primary file names, or a CSV file"
        raise line_error(file, 1, problem, remedy, value=lines[0])
    number = fortran_number(cell) or 0.0
    count = int(number)
    if count != number or not FEWEST_ROWS <= count <= MOST_ROWS:
        problem = f"is no number of rows from {FEWEST_ROWS} to {MOST_ROWS}"
        remedy = "write how many rows the blade has"
        raise line_error(file, count_line, problem, remedy, "NumBlNds", value=cell)
    names_line = count_line + 1
    while names_line < len(lines) and not lines[names_line - 1].strip():
        names_line += 1
    names, units = (line.split() for line in [*lines, "", ""][names_line - 1 : names_line + 1])
    spellings = {name.lower(): name for name in _UNITS}
    names = [spellings.get(name.lower(), name) for name in names]
    _check_head(names, units, names_line, file)
    rows = [
        (line, re.split(r"[!#]", text)[0].split())
        for line, text in enumerate(lines[names_line + 1 :], names_line + 2)
    ]
    if len(rows) < count:
        problem = f"announces {count} rows, but the file ends after {len(rows)}"
        remedy = "complete the rows or correct NumBlNds"
        raise line_error(file, count_line, problem, remedy, "NumBlNds", value=count)
    ignored = sum(fortran_number(cells[0]) is not None for _, cells in rows[count:] if cells)
    message = f"NumBlNds = {count}: {ignored} rows after these are ignored, as OpenFAST does"
    return number_columns(rows[:count], names, file, _UNITS), [message] if ignored else []


def _check_head(names: list[str], units: list[str], line: int, file: Path) -> None:
    """Refuse columns that are missing or appear twice, and units that are not AeroDyn's."""
    missing = [f"lacks the column {name}" for name in _NEEDED if name not in names]
    repeated = [f"has the column {name} twice" for name in names if names.count(name) > 1]
    for problem in (missing + repeated)[:1]:
        remedy = f"the line after NumBlNds names the columns {_USUAL}"
        raise line_error(file, line, problem, remedy, value=" ".join(names))
    if not units or not units[0].startswith("("):
        remedy = "write (m) (m) (m) (deg) (deg) (m) (-) under the names of the columns"
        raise line_error(file, line + 1, "is not the line of units", remedy, value=" ".join(units))
    for name, unit in zip(names, units, strict=False) if len(names) == len(units) else ():
        if name in _UNITS and unit.strip("()").lower() != _UNITS[name]:
            problem, remedy = f"is not AeroDyn's unit ({_UNITS[name]})", "convert the column to it"
            raise line_error(file, line + 1, problem, remedy, f"column {name}", value=unit)
