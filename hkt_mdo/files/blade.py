"""Blade files: CSV, AeroDyn 15 blade file, windIO turbine; one table of rows for all of them."""

import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from hkt_mdo.errors import did_you_mean
from hkt_mdo.files.aerodyn import read_blade_definition
from hkt_mdo.files.blade_table import EDGE, BladeTable, checked_rows
from hkt_mdo.files.shipped import locate
from hkt_mdo.files.table import Csv, csv_text, line_error, numbered_lines, read_text, write_files
from hkt_mdo.files.windio import read_windio

_AERODYN = re.compile(
    r"^[-=! ]*AERODYN\b|^\s*\S+\s+NumBlNds\b|^\s*BlSpn\b", re.MULTILINE | re.IGNORECASE
)
_WINDIO = re.compile(r"^(windIO_version|assembly|components|airfoils)\s*:", re.MULTILINE)


def read_blade(source: str | Path) -> BladeTable:
    """Read a blade from a CSV file, an AeroDyn 15 blade file or a windIO turbine file.

    The content decides the format, and the suffix where that is not enough. CSV names its units in
    its header: a radius (r_m, r_mm or r_over_R), a chord (chord_m, chord_mm, chord_over_R or
    c_over_R), a twist (twist_deg, twist_rad or pitch_deg), and perhaps a thickness
    (thickness_over_chord, t_over_c, thickness_percent or t_over_c_pct) and a section's name
    (section).

    Parameters
    ----------
    source : str or pathlib.Path
        Name of a shipped blade, or a path.

    Returns
    -------
    BladeTable
        The rows in SI units and radians; of AeroDyn, which does not say where the blade's root is,
        with radii from there and a hub radius of 0.

    Raises
    ------
    InputError
        If there is no such file or it is broken; with file, line or key, value and remedy.
    """
    path = locate(source, "blade")
    text = read_text(path, "blade file")
    # The first lines that are no remarks show which format it is.
    lines = [line for _, line in numbered_lines(text) if line.strip() and line.lstrip()[0] != "#"]
    head, suffix = "\n".join(lines[:30]), path.suffix.lower()
    if _AERODYN.search(head) or (lines and suffix in {".dat", ".inp"} and "," not in lines[0]):
        table = read_blade_definition(text, path)
        doubts = _suspect_radians(path, "BlTwist", np.rad2deg(table.twist), "convert it")
        return replace(table, doubts=doubts)
    if _WINDIO.search(head) or suffix in {".yaml", ".yml"}:
        return read_windio(text, path)
    return _read_csv(text, path)


def _suspect_radians(file: Path, column: str, twist: np.ndarray, remedy: str) -> tuple[str, ...]:
    """Return a warning of twists in degrees that are so small that they are most likely radians."""
    most = float(np.max(np.abs(twist)))
    suspected = bool(0.0 < most < 1.0 and np.ptp(twist) > 0.0)
    problem = f"{column} is in degrees, and no value is above {most:.3g}"
    return (f"{file}: {problem}: if it is in radians, {remedy}",) * suspected


# CSV ----------------------------------------------------------------------------------------------

_QUANTITIES = {
    "radius": ["r_m", "r_mm", "r_over_R"],
    "chord": ["chord_m", "chord_mm", "chord_over_R", "c_over_R"],
    "twist": ["twist_deg", "twist_rad", "pitch_deg"],
    "thickness": ["thickness_over_chord", "t_over_c", "thickness_percent", "t_over_c_pct"],
}
"""For each quantity the names of its columns."""
# For each unit at a name's end that is converted: the factor, and the text of the message.
_CONVERSIONS: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "mm": (lambda length: length / 1e3, "mm converted to m"),
    "deg": (np.deg2rad, "degrees converted to radians"),
    "percent": (lambda share: share / 100.0, "per cent converted to a fraction"),
    "pct": (lambda share: share / 100.0, "per cent converted to a fraction"),
}


def _read_csv(text: str, file: Path) -> BladeTable:
    """Return the blade of a CSV file."""
    headers = ["section", *chain.from_iterable(_QUANTITIES.values())]
    table = Csv(text, file, "a header such as r_m,chord_m,twist_deg", headers)
    both_twists = set(table.header) >= {"twist_rad", "twist_deg"}  # of a result's file
    quantities = _QUANTITIES | ({"twist": ["twist_rad"]} if both_twists else {})
    needed = {"radius", "chord", "twist", *map(str.lower, table.header)}
    names = {
        quantity: table.one_of(columns, quantity, quantity in needed)
        for quantity, columns in quantities.items()
    }
    relative = names["radius"] == "r_over_R"
    if relative != names["chord"].endswith("_over_R"):
        problem = f"mixes {names['radius']} with {names['chord']}"
        remedy = "give radius and chord both as lengths or both over the tip radius"
        raise table.refuse(problem, remedy)
    columns = table.columns(list(filter(None, names.values())), "blade")
    messages = [
        f"the column {name} is not read; {did_you_mean(name, headers)}".rstrip("; ")
        for name in table.header
        if name not in headers
    ]
    doubts: tuple[str, ...] = ()
    for name, column in columns.items():
        unit = name.rpartition("_")[2]
        if unit == "deg":
            doubts = _suspect_radians(file, name, column.values, "name the column twist_rad")
        if unit in _CONVERSIONS:
            convert, message = _CONVERSIONS[unit]
            columns[name] = replace(column, values=convert(column.values))
            messages.append(f"{name}: {message}")
    r, chord, twist, thickness = (columns.get(name) for name in names.values())
    if both_twists:
        same = table.columns(["twist_deg"], "blade")["twist_deg"]
        differs = np.abs(np.deg2rad(same.values) - twist.values) > 1e-9
        same.refuse(differs, "is not twist_rad in degrees", "keep one of both columns")
    if relative:
        problem = "lies beyond the tip, where r/R is 1"
        remedy = "divide by the tip radius, or name the column r_m or r_mm"
        r.refuse(r.values > 1.0 + EDGE, problem, remedy)
    rows = checked_rows(r, chord, twist, thickness, 1.0 if relative else float(np.max(r.values)))
    section = None
    if "section" in table.header:
        index = table.header.index("section")
        section = tuple(cells[index].strip() for _, cells in table.rows)
        if "" in section:
            line, remedy = table.rows[section.index("")][0], "name the section of every row or none"
            raise line_error(file, line, "names no section", remedy, "column section")
    remarks = {"messages": tuple(messages), "doubts": doubts, "file": str(file)}
    return BladeTable(**rows, **remarks, relative=relative, section=section)


def write_blade_csv(path: Path, blade, thickness: np.ndarray, remarks: Iterable[str]) -> None:
    """Write a blade as CSV whose numbers read back bit by bit.

    Columns are r_m, chord_m, twist_deg as people read it, twist_rad, which is exact, and
    thickness_over_chord. The file is complete or not there at all.

    Parameters
    ----------
    path : pathlib.Path
        File to write or replace.
    blade : Blade
        The blade, m and rad.
    thickness : numpy.ndarray, shape (n_stations,)
        Thickness over chord.
    remarks : iterable of str
        Lines above the header, which get a ``#``.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    names = "r_m", "chord_m", "twist_deg", "twist_rad", "thickness_over_chord"
    columns = blade.r, blade.chord, np.rad2deg(blade.twist), blade.twist, thickness
    lines = "\n".join(map(str, remarks)).splitlines()
    write_files({path: csv_text(names, np.column_stack(columns).tolist(), lines)})
