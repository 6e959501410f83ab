"""Polar files: CSV, AeroDyn airfoil table, XFOIL polar; one table a Reynolds number for all."""

import re
from dataclasses import replace
from itertools import compress, pairwise
from pathlib import Path

import numpy as np

from hkt_mdo.files.aerodyn import OLD_COUNT, read_airfoil, read_old_airfoil
from hkt_mdo.files.polar_table import SURFACES, PolarTable, in_order, polar_of_rows, read_reynolds
from hkt_mdo.files.shipped import POLAR_FAMILIES, locate
from hkt_mdo.files.table import Csv, line_error, numbered_lines, read_text

_ANGLES = "alpha_deg", "alpha_rad"
_FORMATS = "a CSV file alpha_deg,cl,cd (or alpha_rad), an AeroDyn airfoil table or an XFOIL polar"
_FLAGS = re.MULTILINE | re.IGNORECASE
_AERODYN = re.compile(
    r"""^[ \t]*(@?"[^"\n]*"|\S+)[ \t]+"""
    r"(InterpOrd|RelThickness|NonDimArea|NumCoords|NumTabs|InclUAdata|NumAlf)\b"
    r"|^!.*AirfoilInfo",
    _FLAGS,
)
_XFOIL = re.compile(r"\A\s*(XFOIL|xflr5)\b|Calculated polar for|^Reynolds number,", _FLAGS)


def read_polars(source: str | Path) -> tuple[PolarTable, ...]:
    """Read the polars of a section, one a Reynolds number.

    The content decides the format: a CSV file with the columns ``alpha_deg`` or ``alpha_rad``,
    ``cl``, ``cd`` and perhaps ``cm``, ``cpmin`` or ``cpmin_upper`` and ``cpmin_lower`` (smallest
    pressure coefficient) and ``reynolds``; an airfoil file of OpenFAST's AeroDyn (AirfoilInfo
    v1.01, Reynolds numbers in millions) or of AeroDyn 13, as HARP_Opt has them; or polars that
    XFOIL or XFLR5 has written, one after the other, or a CSV file of airfoiltools.com.

    Parameters
    ----------
    source : str or pathlib.Path
        A path, the name of a shipped polar (``naca63815_Re2e5``) or of a shipped section
        (``naca63815``: all its Reynolds numbers).

    Returns
    -------
    tuple of PolarTable
        The polars, sorted by Reynolds number.

    Raises
    ------
    InputError
        If there is no such file or it is broken; with file, line, column, value and remedy.
    """
    name = str(source)
    for family, polars in POLAR_FAMILIES.items():
        chosen = [polar for polar in polars if name in (family, polar)]
        if chosen:
            tables = {polar: _read_file(locate(polar, "polar"))[0] for polar in chosen}
            return tuple(replace(table, reynolds=polars[key]) for key, table in tables.items())
    path = locate(source, "polar")
    return in_order(_read_file(path), path)


def _read_file(path: Path) -> list[PolarTable]:
    """Return the polars of a file in the order in which they stand there."""
    text = read_text(path, "file with a polar")
    if _AERODYN.search(text):
        return read_airfoil(text, path)
    if OLD_COUNT.search(text):
        return read_old_airfoil(text, path)
    return _read_xfoil(text, path) if _XFOIL.search(text) else _read_csv(text, path)


# CSV ----------------------------------------------------------------------------------------------


def _read_csv(text: str, path: Path) -> list[PolarTable]:
    """Return the polars of a CSV file, one for each number in its column reynolds."""
    names = *_ANGLES, "cl", "cd", "cm", "reynolds", "cpmin", *SURFACES
    table = Csv(text, path, f"that of {_FORMATS}", names)
    if not {*_ANGLES, "cl", "cd"} & set(table.header):
        raise table.refuse("is no header of alpha_deg,cl,cd", f"give {_FORMATS}")
    table.check((table.one_of(_ANGLES, "angle of attack"), "cl", "cd"), "polar")
    if "reynolds" not in table.header:
        return [polar_of_rows(table.rows, table.header, None, path)]
    column = table.columns(("reynolds",), "polar")["reynolds"]
    for cell, key in zip(column.shown, column.keys, strict=True):
        read_reynolds(str(cell), path, key)
    polars = []
    for number in np.unique(column.values).tolist():
        rows = list(compress(table.rows, column.values == number))
        polars.append(polar_of_rows(rows, table.header, number, path, f"reynolds = {number:g}"))
    return polars


# XFOIL --------------------------------------------------------------------------------------------

# airfoiltools.com writes commas between cells
_XFOIL_BEGIN = re.compile(r"Calculated polar for\s*:|^Reynolds number,", re.IGNORECASE)
_XFOIL_REYNOLDS = re.compile(
    r"(?:\bRe\s*=|^Reynolds number\s)\s*([^\s=]+?)(?:\s*[eE]\s*([+-]?\d{1,3}))?(?=\s|$)"
)
_XFOIL_REMEDY = "give the file as XFOIL's PACC has written it"


def _read_xfoil(text: str, path: Path) -> list[PolarTable]:
    """Return the polars of a file that XFOIL's PACC or XFLR5 has written, one after the other."""
    lines = numbered_lines(text)
    begins = [at for at, (_, line) in enumerate(lines) if _XFOIL_BEGIN.search(line)]
    if not begins:
        raise line_error(path, 1, "lacks the line Calculated polar for:", _XFOIL_REMEDY)
    of_xflr5 = any("xflr5" in line.lower() for _, line in lines[: begins[0]])
    parts = [lines[low:high] for low, high in pairwise([*begins, len(lines)])]
    return [
        _read_xfoil_polar(part, path, f"polar {index}" if len(parts) > 1 else "", of_xflr5)
        for index, part in enumerate(parts, start=1)
    ]


def _read_xfoil_polar(
    part: list[tuple[int, str]], path: Path, where: str, of_xflr5: bool
) -> PolarTable:
    """Return one polar of numbered lines."""
    reynolds, names, rows = None, [], []
    for number, text in part:
        line = text.replace(",", " ")
        words = re.sub(r"(?i)\b(top|bot) (xtr|itr)\b", r"\1_\2", line).split()
        if names:
            if _XFOIL.match(line):
                break
            if words and set(line.strip()) - set("- "):  # XFLR5 writes more columns than it names
                rows.append((number, words[: len(names)] if of_xflr5 else words))
        elif words and words[0].lower() == "alpha":
            names = [word.lower() for word in words]
        elif re.search(r"Reynolds number\s*~", line):
            problem = "the Reynolds number varies along this polar"
            remedy = "run XFOIL at a fixed Reynolds number (TYPE 1)"
            raise line_error(path, number, problem, remedy, value=line.strip())
        elif match := _XFOIL_REYNOLDS.search(line):
            cell = f"{match[1]}e{match[2]}" if match[2] else match[1]
            reynolds = read_reynolds(cell, path, f"line {number}, Re")
    flaws = {
        "lacks the line of column names alpha CL CD": not names,
        "lacks the column CL": "cl" not in names,
        "lacks the column CD": "cd" not in names,
        "lacks the line Mach = Re =": reynolds is None,
        "has no rows": not rows,
    }
    for flaw, present in flaws.items():
        if present:
            problem = f"the polar that begins here {flaw}"
            raise line_error(path, part[0][0], problem, _XFOIL_REMEDY)
    return polar_of_rows(rows, names, reynolds, path, where)
