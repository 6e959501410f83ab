"""Files of OpenFAST's AeroDyn 15: blade definitions, and airfoil tables (also AeroDyn 13's).

Numbers may have Fortran's exponents (1.0D+00).
"""

import re
from dataclasses import replace
from itertools import dropwhile, groupby, islice
from pathlib import Path

import numpy as np

from hkt_mdo.files.blade_table import BladeTable, checked_rows
from hkt_mdo.files.polar_table import PolarTable, polar_of_rows, read_reynolds
from hkt_mdo.files.table import Column, line_error, number_columns, numbered_lines, parse_number

# Airfoil tables -----------------------------------------------------------------------------------

_SETTING = re.compile(r"""(@?"[^"]*"|@?'[^']*'|\S+)\s+([A-Za-z]\w*)""")
_SEPARATOR = re.compile(r"[\s,]+")
OLD_COUNT = re.compile(r"Number of airfoil tables", re.IGNORECASE)
"""In the line of an airfoil file of AeroDyn 14 or older that says how many tables it has."""

_COLUMNS = ["alpha", "cl", "cd", "cm"]  # where a file does not name them
_REMEDY = "NumTabs counts the tables; each has Re, and NumAlf, which counts the rows below it"

_Line = tuple[int, str, list[str]]
"""Number and text of a line, and the names of columns in the remark above it."""


def read_airfoil(text: str, path: Path) -> list[PolarTable]:
    """Read the tables of an airfoil file of AeroDyn 15.

    The format is AirfoilInfo v1.01 of OpenFAST, https://openfast.readthedocs.io; the file's
    Reynolds numbers are in millions. Each line has a value and its name; NumCoords and NumAlf say
    how many rows of numbers follow.

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
    """  # noqa: DOC501 - `line_error` returns an InputError
    tables = []  # rows and settings of each
    settings: dict[str, tuple[int, str]] = {}  # line and value by name
    lines = iter(_lines_without_remarks(text))
    for line, content, _ in lines:
        match = _SETTING.match(content)
        if match is None:
            problem, remedy = "comes where a value with its name is expected", _REMEDY
            if content.startswith("@"):
                problem = "takes its tables from another file"
                remedy = "paste that file in place of this line"
            raise line_error(path, line, problem, remedy, value=content)
        value, name = match[1], match[2].lower()
        settings[name] = line, value
        if name == "numcoords" and not value.startswith("@"):
            list(islice(lines, _count((line, value), "NumCoords", path, 0)))  # passed over
        elif name == "numalf":
            rows = list(islice(lines, _count((line, value), "NumAlf", path)))
            tables.append((rows, settings.copy()))
            settings.pop("re", None)
    polars = [_read_table(*table, path, f"table {i}") for i, table in enumerate(tables, start=1)]
    count = _count(settings.get("numtabs", (1, "")), "NumTabs", path)
    if count != len(tables):
        line, problem = settings["numtabs"][0], f"is not the number of tables, {len(tables)}"
        raise line_error(path, line, problem, _REMEDY, "NumTabs", value=count)
    return polars


def _lines_without_remarks(text: str) -> list[_Line]:
    """Return the lines of an airfoil file that are neither empty nor remarks."""
    lines: list[_Line] = []
    names: list[str] = []
    for number, line in numbered_lines(text):
        if line.lstrip()[:1] in ("!", "#", "%"):
            words = [re.sub(r"\W|_", "", word).lower() for word in line.strip(" \t!#%").split()]
            names = words if words[:1] in (["alpha"], ["aoa"], ["alfa"]) else names
        elif line.strip():
            lines.append((number, line.partition("!")[0].strip(), names))
            names = []
    return lines


def _count(stated: tuple[int, str], name: str, path: Path, fewest: int = 1) -> int:
    """Return the number of rows or tables that a setting states, of its line and its value."""
    line, value = stated
    if not re.fullmatch(r"\d{1,6}", value, re.ASCII) or int(value) < fewest:
        problem = f"must be a whole number of at least {fewest}" if value else "is missing"
        remedy = "write how many rows or tables follow"
        raise line_error(path, line, problem, remedy, name, value=value)
    return int(value)


def _read_table(
    lines: list[_Line], settings: dict[str, tuple[int, str]], path: Path, where: str
) -> PolarTable:
    """Return the polar of some rows; `where` tells it from others in the file."""
    count_line, count = settings["numalf"]
    if "re" not in settings:
        raise line_error(path, count_line, "comes without a line Re above it", _REMEDY, "NumAlf")
    line, cell = settings["re"]
    reynolds = read_reynolds(cell, path, f"line {line}, Re", 1e6)
    if len(lines) < int(count):
        problem = f"announces more rows than the {len(lines)} that follow"
        raise line_error(path, count_line, problem, _REMEDY, "NumAlf", value=count)
    rows = [(number, _SEPARATOR.split(content)) for number, content, _ in lines]
    line, _, names = lines[0]
    if names and names[1:3] != ["cl", "cd"]:
        problem = "the columns are to be Alpha, Cl, Cd and optionally Cm and Cpmin"
        raise line_error(path, line, problem, "put them in order", where, value=" ".join(names))
    width = len(rows[0][1])
    if width < 3:
        remedy = "give Alpha, Cl and Cd in every row"
        raise line_error(path, line, "has fewer than three columns", remedy)
    # Without names the fourth column is the moment; MHK files have the smallest pressure there.
    names = ["alpha", *(names or _COLUMNS)[1:], *[""] * width][:width]
    return polar_of_rows(rows, names, reynolds, path, where)


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
        If the file is broken, or older, with its tables side by side; with the line.
    """  # noqa: DOC501 - `line_error` returns an InputError
    lines = numbered_lines(text)
    begin = next(at for at, (_, line) in enumerate(lines) if OLD_COUNT.search(line))
    number, counted = lines[begin]
    count = parse_number(counted.split()[0])
    preface = " ".join(line for _, line in lines[:begin]).lower()
    fourth = "cpmin" if re.search(r"min\w* pressure|cpmin", preface) else "cm"
    split = [(line, _SEPARATOR.split(x.strip())) for line, x in lines[begin + 1 :] if x.strip()]
    parts = groupby(split, lambda row: row[1][0].upper() == "EOT")
    tables: list[PolarTable] = []
    for block in (list(block) for ends, block in parts if not ends):
        (line, cells), where, reynolds = block[0], f"table {len(tables) + 1}", None
        if count != 1.0 or parse_number(cells[0]) != 0.0:  # a table alone may have Re = 0
            reynolds = read_reynolds(cells[0], path, f"line {line}, Re", 1e6)
        rows = [row for row in block if len(row[1]) > 2 and None not in map(parse_number, row[1])]
        if not rows:
            raise line_error(path, line, "begins a table without rows", _OLD_REMEDY, where)
        names = [*_COLUMNS[:3], fourth][: len(rows[0][1])]
        tables.append(polar_of_rows(rows, names, reynolds, path, where))
    if len(tables) != count or not tables:
        problem = f"is not the number of tables that end with EOT, {len(tables)}"
        raise line_error(path, number, problem, _OLD_REMEDY, value=counted.strip())
    return tables


# Blade definition ---------------------------------------------------------------------------------

# Units of the columns; see the input files of AeroDyn at https://openfast.readthedocs.io.
_UNITS = {"BlSpn": "m", "BlCrvAC": "m", "BlSwpAC": "m", "BlCrvAng": "deg"}
_UNITS |= {"BlTwist": "deg", "BlChord": "m", "BlAFID": "-", "t_c": "-"}
_ROW_COUNT = re.compile(r"\s*\S+\s+NumBlNds\b", re.IGNORECASE)
_NEEDED = ("BlSpn", "BlTwist", "BlChord", "BlAFID")


def read_blade_definition(text: str, file: Path) -> BladeTable:
    """Read an AeroDyn 15 blade file.

    OpenFAST's form: a line ``19 NumBlNds``, one of column names, one of units, NumBlNds rows. The
    columns are identified by their names, since their number grew over the versions.

    Parameters
    ----------
    text : str
        Content of the file.
    file : pathlib.Path
        The file, for messages.

    Returns
    -------
    BladeTable
        The rows in SI units and radians, with radii from the blade's root and a hub radius of 0.

    Raises
    ------
    InputError
        If the file is broken, with the line.
    """
    columns, messages = _blade_columns(text, file)
    span, degrees, chord, section = (columns[name] for name in _NEEDED)
    first, last = float(span.values[0]), float(span.values[-1])
    messages.append("BlTwist: degrees converted to radians")
    if first > 0.0:
        note = f"rows begin {first:g} m ({100.0 * first / last:.3g} % of the span) outboard of the"
        messages.append(f"BlSpn: {note} blade's root, from which AeroDyn counts")
    for name, what in (("BlCrvAC", "prebend"), ("BlSwpAC", "sweep"), ("BlCrvAng", "cant angle")):
        if name in columns and np.any(columns[name].values != 0.0):
            largest = f"{np.max(np.abs(columns[name].values)):g} {_UNITS[name]}"
            messages.append(f"{name}: {what} of up to {largest} is ignored: straight blade")
    thickness = columns.get("t_c")
    if thickness is not None and not np.any(thickness.values):
        messages.append("t_c: all 0, taken as not given")
        thickness = None
    twist = replace(degrees, values=np.deg2rad(degrees.values))
    rows = checked_rows(span, chord, twist, thickness, float(np.max(span.values)))
    wrong = (section.values < 1.0) | (section.values != np.floor(section.values))
    remedy = "give the place in AeroDyn's list of airfoil files, from 1"
    section.refuse(wrong, "is no number of an airfoil", remedy)
    return BladeTable(
        **rows,
        section=tuple(f"{number:.0f}" for number in section.values),
        tip_radius=last,
        hub_radius=0.0,
        messages=tuple(messages),
        file=str(file),
    )


def _blade_columns(text: str, file: Path) -> tuple[dict[str, Column], list[str]]:
    """Return the columns in the file's units, and messages about rows that are ignored.

    Missing or repeated columns and other units than AeroDyn's are refused.
    """  # noqa: DOC501 - `line_error` returns an InputError
    lines = numbered_lines(text.rstrip())
    begin = next((at for at, (_, line) in enumerate(lines) if _ROW_COUNT.match(line)), None)
    if begin is None:
        problem = "has no line `19 NumBlNds`, so it is no AeroDyn 15 blade file"
        remedy = "give the blade file (ADBlFile) that AeroDyn's primary file names, or a CSV file"
        raise line_error(file, 1, problem, remedy, value=lines[0][1])
    rows = [(number, re.split(r"[!#]", line)[0].split()) for number, line in lines[begin:]]
    (count_line, (cell, *_)), *rows = rows
    count = _count((count_line, cell), "NumBlNds", file)
    rows = [*dropwhile(lambda row: not row[1], rows)]
    end = lines[-1][0] + 1, []
    (line, cells), (units_line, units) = [*rows, end, end][:2]
    rows = rows[2:]
    spellings = {name.lower(): name for name in _UNITS}
    names = [spellings.get(name.lower(), name) for name in cells]
    missing = [f"lacks the column {name}" for name in _NEEDED if name not in names]
    repeated = [f"has the column {name} twice" for name in names if names.count(name) > 1]
    for problem in (missing + repeated)[:1]:
        remedy = f"the line after NumBlNds names the columns {' '.join([*_UNITS][:-1])}"
        raise line_error(file, line, problem, remedy, value=" ".join(names))
    if not units or not units[0].startswith("("):
        problem = "is not the line of units"
        remedy = "write (m) (m) (m) (deg) (deg) (m) (-) under the names of the columns"
        raise line_error(file, units_line, problem, remedy, value=" ".join(units))
    for name, unit in zip(names, units, strict=False) if len(names) == len(units) else ():
        if name in _UNITS and unit.strip("()").lower() != _UNITS[name]:
            problem, remedy = f"is not AeroDyn's unit ({_UNITS[name]})", "convert the column to it"
            raise line_error(file, units_line, problem, remedy, f"column {name}", value=unit)
    if len(rows) < count:
        problem = f"announces {count} rows, but the file ends after {len(rows)}"
        remedy = "complete the rows or correct NumBlNds"
        raise line_error(file, count_line, problem, remedy, "NumBlNds", value=count)
    ignored = sum(parse_number(cells[0]) is not None for _, cells in rows[count:] if cells)
    message = f"NumBlNds = {count}: {ignored} rows after these are ignored, as OpenFAST does"
    return number_columns(rows[:count], names, file, _UNITS), [message] if ignored else []
