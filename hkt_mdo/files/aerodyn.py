"""Files of OpenFAST's AeroDyn 15: blade definitions, and airfoil tables (AirfoilInfo v1.01).

Numbers may have Fortran's exponents (1.0D+00).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.blade_table import FEWEST_ROWS, MOST_ROWS, BladeTable, check_rows
from hkt_mdo.files.polar_table import PolarTable, check_reynolds, polar_table
from hkt_mdo.files.table import Column, Source, fortran_number, lines_of, text_columns

__all__ = ["read_airfoil", "read_blade_definition"]

# Airfoil tables -----------------------------------------------------------------------------------

_SETTING = re.compile(r"""\s*(@?"[^"]*"|@?'[^']*'|\S+)\s+([A-Za-z]\w*)""")
_REMEDY = "see OpenFAST's AirfoilInfo v1.01 files"


class _Lines(Source):
    """The lines of an airfoil file that are no remarks, read one after the other."""

    def __init__(self, text: str, path: Path) -> None:
        super().__init__(path)
        self.at = 0
        self.lines: list[tuple[int, str, list[str]]] = []  # number, text, names of columns above
        names: list[str] = []
        for number, line in enumerate(lines_of(text), start=1):
            remark = line.lstrip()
            if remark.startswith(("!", "#", "%")):
                words = [re.sub(r"\W|_", "", word).lower() for word in remark.lstrip("!#%").split()]
                if words and words[0] in ("alpha", "aoa", "alfa"):
                    names = words
            elif line.strip():
                self.lines.append((number, line.partition("!")[0].strip(), names))
                names = []

    def refusal(self, problem: str, remedy: str = _REMEDY) -> InputError:
        if self.at < len(self.lines):
            number, text, _ = self.lines[self.at]
            return self.refuse(problem, remedy, number, value=text)
        return InputError(f"the file ends where {problem}", remedy, file=self.file, key="end")

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
            problem = f"must be a whole number of at least {fewest}"
            raise self.refuse(problem, _REMEDY, number, keyword, value=text)
        return int(text)

    def rows(self, count: int, count_line: int) -> list[tuple[int, list[str]]]:
        """Return line number and cells of the rows that NumAlf, in line `count_line`, promises."""
        rows: list[tuple[int, list[str]]] = []
        while len(rows) < count:
            number, line, _ = self.lines[self.at] if self.at < len(self.lines) else (0, "", [])
            cells = re.split(r"[\s,]+", line)
            setting = len(cells) > 1 and cells[1].lower() in ("re", "userprop", "ctrl")
            if setting or fortran_number(cells[0]) is None:
                raise self.refusal(
                    f"row {len(rows) + 1} of NumAlf = {count} (line {count_line}) is expected",
                    "NumAlf counts the rows of a table",
                )
            rows.append((number, cells))
            self.at += 1
        return rows


def read_airfoil(text: str, path: Path) -> list[PolarTable]:
    """Read the tables of an airfoil file; Reynolds numbers are in millions.

    Raises InputError with the line where the file is broken.
    """
    file = _Lines(text, path)
    n_tables = file.count("NumTabs", *file.setting("NumTabs"))
    tables = [_read_table(file, index + 1) for index in range(n_tables)]
    if file.at < len(file.lines):
        raise file.refusal(
            "follows the last row of the last table",
            "NumAlf counts the rows of a table, NumTabs the tables",
        )
    return tables


def _read_table(file: _Lines, index: int) -> PolarTable:
    """Read the table of this number, from 1."""
    path = file.file
    at, cell = file.setting("Re")
    millions = fortran_number(cell)
    reynolds = check_reynolds(
        millions and 1e6 * millions, cell, path, f"line {at}, Re of table {index}", 1e6
    )
    at, cell = file.setting("NumAlf")
    names = file.lines[file.at][2] if file.at < len(file.lines) else []
    if names and names[1:3] != ["cl", "cd"]:
        problem = "the columns are to be Alpha, Cl, Cd and perhaps Cm"
        line, remedy = file.lines[file.at][0], "put them in this order"
        raise file.refuse(problem, remedy, line, f"table {index}", value=" ".join(names))
    rows = file.rows(file.count("NumAlf", at, cell), at)
    numbers = [str(number + 1) for number in range(len(rows[0][1]))]
    columns = list(text_columns(rows, numbers, path, numbers).values())
    if len(columns) < 3:
        remedy = "give Alpha, Cl and Cd in every row"
        raise file.refuse("has fewer than three columns", remedy, rows[0][0])
    # Without names the fourth column is the moment; MHK files have the lowest pressure there.
    moment = names.index("cm") if "cm" in names else (0 if names else 3)
    return polar_table(
        *(column.values for column in columns[:3]),
        columns[moment].values if 0 < moment < len(columns) else None,
        reynolds,
        file=path,
        columns=("Alpha", "Cl", "Cd", "Cm"),
        lines=[line for line, _ in rows],
        where=f"table {index}",
    )


# Blade definition ---------------------------------------------------------------------------------

_UNITS = {"BlSpn": "m", "BlCrvAC": "m", "BlSwpAC": "m", "BlCrvAng": "deg"}
_UNITS |= {"BlTwist": "deg", "BlChord": "m", "BlAFID": "-", "t_c": "-"}
_NEEDED = ("BlSpn", "BlTwist", "BlChord", "BlAFID")
_USUAL = "BlSpn BlCrvAC BlSwpAC BlCrvAng BlTwist BlChord BlAFID"


def read_blade_definition(text: str, file: Path, hub_radius: float | None) -> BladeTable:
    """Read an AeroDyn 15 blade file, whose span counts from the hub radius (m).

    OpenFAST's form: a line ``19 NumBlNds``, one of column names, one of units, NumBlNds rows. The
    columns are found by their names, since their number grew over the versions. Raises InputError
    with the line where the file is broken.
    """
    lines = lines_of(text.rstrip())
    columns, messages = _blade_columns(lines, file)
    span, chord, degrees = (columns[name] for name in ("BlSpn", "BlChord", "BlTwist"))
    if hub_radius is None:
        raise InputError(
            "counts from the blade's root, whose radius an AeroDyn file does not say",
            "give the hub radius in metres",
            file=file,
            key=span.keys[0],
            value=span.shown[0],
        )
    span.refuse(
        (np.arange(span.values.size) == 0) & (span.values != 0.0),
        "is not 0, where AeroDyn's span begins: it counts from the blade's root",
        "subtract the hub radius from the column",
    )
    span.refuse(span.values < 0.0, "is a negative span", "count from the blade's root")
    messages.append("BlTwist: degrees converted to radians")
    if hub_radius:
        messages.append(f"BlSpn: counted from the root, hub radius of {hub_radius:g} m added")
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
    r = replace(span, values=hub_radius + span.values)
    r.check_rising("radii")  # spans that differ may give one radius by rounding
    section = columns["BlAFID"]
    section.refuse(
        (section.values < 1.0) | (section.values != np.floor(section.values)),
        "is no number of an airfoil",
        "give the place in AeroDyn's list of airfoil files, from 1",
    )
    return BladeTable(
        r.values,
        chord.values,
        twist.values,
        thickness=None if thickness is None else thickness.values,
        section=tuple(f"{number:.0f}" for number in section.values),
        tip_radius=float(r.values[-1]),
        hub_radius=float(hub_radius),
        messages=tuple(messages),
        file=str(file),
    )


def _blade_columns(lines: Sequence[str], file: Path) -> tuple[dict[str, Column], list[str]]:
    """Return the columns in the file's units, and what is to be said of rows that are ignored."""
    count, count_line = _node_count(lines, file)
    first, header = _blade_header(lines, count_line, file)
    rows = [
        (number + 1, re.split(r"[!#]", lines[number])[0].split())
        for number in range(first, min(first + count, len(lines)))
    ]
    if len(rows) < count:
        problem = f"promises {count} rows, but the file ends after {len(rows)}"
        remedy = "complete the rows or correct NumBlNds"
        raise Source(file).refuse(problem, remedy, count_line + 1, "NumBlNds", value=count)
    more = [line.split() for line in lines[first + count :]]
    left = sum(fortran_number(cells[0]) is not None for cells in more if cells)
    said = f"NumBlNds = {count}: {left} rows after these are ignored, as OpenFAST does"
    return text_columns(rows, header, file, _UNITS), [said] if left else []


def _blade_header(lines: Sequence[str], count_line: int, file: Path) -> tuple[int, list[str]]:
    """Return the index of the first row, and the names of the columns."""
    after = (number for number in range(count_line + 1, len(lines)) if lines[number].strip())
    header_line = next(after, len(lines))
    header = lines[header_line].split() if header_line < len(lines) else []
    known = {name.lower(): name for name in _UNITS}
    header = [known.get(name.lower(), name) for name in header]
    wrong = [name for name in _NEEDED if name not in header]
    twice = [name for name in header if header.count(name) > 1]
    if wrong or twice:
        problem = f"lacks the column {wrong[0]}" if wrong else f"has the column {twice[0]} twice"
        remedy = f"the line after NumBlNds names the columns {_USUAL}"
        line = min(header_line, len(lines) - 1) + 1
        raise Source(file).refuse(problem, remedy, line, value=" ".join(header))
    first = header_line + 2
    units = lines[first - 1].split() if first - 1 < len(lines) else []
    if not units or not units[0].startswith("("):
        remedy = "write (m) (m) (m) (deg) (deg) (m) (-) under the names of the columns"
        line, shown = min(first, len(lines)), " ".join(units)
        raise Source(file).refuse("is not the line of units", remedy, line, value=shown)
    if len(units) == len(header):
        for name, unit in zip(header, units, strict=True):
            if name in _UNITS and unit.strip("()").lower() != _UNITS[name]:
                problem = f"is not AeroDyn's unit ({_UNITS[name]})"
                remedy = f"convert the column to ({_UNITS[name]})"
                raise Source(file).refuse(problem, remedy, first, f"column {name}", value=unit)
    return first, header


def _node_count(lines: Sequence[str], file: Path) -> tuple[int, int]:
    """Return what the line NumBlNds says, and its index."""
    for index, line in enumerate(lines):
        found = re.match(r"\s*(\S+)\s+NumBlNds\b", line, re.IGNORECASE)
        if found:
            count = fortran_number(found[1]) or 0.0
            if count == np.floor(count) and FEWEST_ROWS <= count <= MOST_ROWS:
                return int(count), index
            problem = f"is no number of rows from {FEWEST_ROWS} to {MOST_ROWS}"
            remedy = "write how many rows the blade has"
            raise Source(file).refuse(problem, remedy, index + 1, "NumBlNds", value=found[1])
    problem = "has no line `19 NumBlNds`, so it is no AeroDyn 15 blade file"
    remedy = "give the blade file (ADBlFile) that AeroDyn's primary file names, or a CSV file"
    raise Source(file).refuse(problem, remedy, 1, value=lines[0])
