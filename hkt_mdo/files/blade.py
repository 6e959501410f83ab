"""Blade files: CSV, AeroDyn 15 blade file, windIO turbine; one table of rows for all of them."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import locate, parse_number, read_text

__all__ = ["BladeTable", "SectionTable", "read_blade", "write_blade_csv"]

FEWEST_ROWS, MOST_ROWS = 2, 100_000
EDGE = 1e-9
"""A row this close to the hub or the tip, over the tip radius, lies on it."""


@dataclass(frozen=True, eq=False)
class SectionTable:
    """A section (airfoil) that comes inside a turbine file.

    Parameters
    ----------
    name : str
    thickness : float or None
        Largest thickness over chord; None where the file does not say.
    polars : tuple of PolarTable
        Lift and drag tables, one a Reynolds number.
    outline_x, outline_y : ndarray, shape (n_points,), or None
        Outline over chord.
    """

    name: str
    thickness: float | None
    polars: tuple
    outline_x: np.ndarray | None = None
    outline_y: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class BladeTable:
    """The rows of a blade file, in SI units and radians.

    Parameters
    ----------
    r : ndarray, shape (n_rows,), m
        Distance from the rotor's centre along the blade, strictly increasing; over the tip radius
        where `relative`.
    chord : ndarray, shape (n_rows,), m
        Over the tip radius where `relative`.
    twist : ndarray, shape (n_rows,), rad
        Angle between the section's chord and the rotor plane, without a set angle.
    relative : bool
        Whether lengths are over the tip radius.
    thickness : ndarray, shape (n_rows,), or None
        Thickness over chord.
    section : tuple of str, length n_rows, or None
        Name of each row's section; AeroDyn's BlAFID as text, such as "1".
    sections : tuple of SectionTable
        The sections that the file itself holds.
    section_position : tuple of (str, float) or None
        Names of sections and the radii (as `r`) where they stand, root to tip (windIO).
    tip_radius, hub_radius : float or None, m
        None where the file does not say.
    blade_count : int or None
    cone : float or None, rad
        Angle between the blade and the rotor plane.
    messages : tuple of str
        Every conversion made and everything passed over.
    file : str
        Where the table comes from, for messages.
    """

    r: np.ndarray
    chord: np.ndarray
    twist: np.ndarray
    relative: bool = False
    thickness: np.ndarray | None = None
    section: tuple[str, ...] | None = None
    sections: tuple[SectionTable, ...] = ()
    section_position: tuple[tuple[str, float], ...] | None = None
    tip_radius: float | None = None
    hub_radius: float | None = None
    blade_count: int | None = None
    cone: float | None = None
    messages: tuple[str, ...] = ()
    file: str = ""

    def scaled(self, tip_radius: float) -> BladeTable:
        """Return the table in metres for a tip radius.

        Lengths over the tip radius are multiplied by it. A table in metres whose file says its tip
        radius is scaled to the new one, by nothing where they are equal; one that does not say it
        (CSV) keeps its lengths.

        Parameters
        ----------
        tip_radius : float, m

        Returns
        -------
        BladeTable
            With this tip radius, lengths in metres.

        Raises
        ------
        InputError
            If the rows of a file without a tip radius reach beyond this one.
        """
        tip_radius = float(tip_radius)
        if not self.relative and self.tip_radius == tip_radius:
            return self
        if not self.relative and self.tip_radius is None:
            if self.r[-1] > tip_radius * (1.0 + EDGE):
                raise InputError(
                    f"reaches beyond the rotor's tip radius of {tip_radius:g} m",
                    "enlarge rotor.radius, cut the blade's rows, or give r_over_R and chord_over_R",
                    file=self.file,
                    key="outermost row",
                    value=float(self.r[-1]),
                )
            return replace(self, tip_radius=tip_radius)
        own = 1.0 if self.relative else float(self.tip_radius or 1.0)

        def scale(length):
            # Division first: what lies on the tip lies on it again, to the last bit.
            return length / own * tip_radius

        note = f"lengths scaled from a tip radius of {own:g} m to {tip_radius:g} m"
        return replace(
            self,
            r=scale(self.r),
            chord=scale(self.chord),
            relative=False,
            section_position=self.section_position
            and tuple((name, scale(radius)) for name, radius in self.section_position),
            tip_radius=tip_radius,
            hub_radius=None if self.hub_radius is None else scale(self.hub_radius),
            messages=self.messages if self.relative else (*self.messages, note),
        )

    def interior(self, hub_radius: float | None = None) -> BladeTable:
        """Return the rows strictly between hub and tip, where blade elements may lie.

        Parameters
        ----------
        hub_radius : float, optional
            In the table's unit of length; by default the file's own.

        Returns
        -------
        BladeTable
            Where the table has no tip radius, rows are cut at the hub only.

        Raises
        ------
        InputError
            If no row is left, or no hub radius is known.
        """
        hub = self.hub_radius if hub_radius is None else float(hub_radius)
        if hub is None:
            raise InputError("says no hub radius", "give one", file=self.file)
        tip = 1.0 if self.relative else self.tip_radius
        margin = EDGE * (self.r[-1] if tip is None else tip)
        keep = self.r > hub + margin
        if tip is not None:
            keep &= self.r < tip - margin
        if not np.any(keep):
            raise InputError(
                f"has no row between the hub ({hub:g}) and the tip",
                "add rows there, or lessen the hub radius",
                file=self.file,
            )
        return replace(
            self,
            r=self.r[keep],
            chord=self.chord[keep],
            twist=self.twist[keep],
            thickness=None if self.thickness is None else self.thickness[keep],
            section=self.section
            and tuple(name for name, kept in zip(self.section, keep, strict=True) if kept),
            hub_radius=hub,
        )

    def blend(self, r: np.ndarray) -> tuple[tuple[str, str, float], ...]:
        """Return the two sections between which each radius lies, and the share of the outer one.

        The share runs linearly with the thickness between the two where it is known and differs,
        and with the radius where not; beyond the first and last section they stand alone.

        Parameters
        ----------
        r : array, shape (n_stations,)
            In the table's unit of length.

        Returns
        -------
        tuple of (inner name, outer name, share of the outer)
            Share within 0 and 1; of two equal names it is 0.

        Raises
        ------
        InputError
            If the file names no sections.
        """
        if self.section_position is not None:
            names = [name for name, _ in self.section_position]
            places = np.array([radius for _, radius in self.section_position])
        elif self.section is not None:
            names, places = list(self.section), self.r
        else:
            raise InputError("names no sections", "add a column section", file=self.file)
        thick = {section.name: section.thickness for section in self.sections}
        blends = []
        for radius in np.atleast_1d(np.asarray(r, dtype=float)):
            outer = int(np.searchsorted(places, radius))
            inner = max(outer - 1, 0)
            outer = min(outer, len(names) - 1)
            share = 0.0
            if names[inner] != names[outer]:
                share = (radius - places[inner]) / (places[outer] - places[inner])
                first, last = thick.get(names[inner]), thick.get(names[outer])
                if self.thickness is not None and first and last and first != last:
                    here = np.interp(radius, self.r, self.thickness)
                    share = np.clip((here - first) / (last - first), 0.0, 1.0)
            blends.append((names[inner], names[outer], float(share)))
        return tuple(blends)


def read_blade(source: str | Path, hub_radius: float | None = None) -> BladeTable:
    """Read a blade from a CSV file, an AeroDyn 15 blade file or a windIO turbine file.

    The format is told by the content, and by the suffix where the content is not enough. CSV names
    its units in its header: a radius (r_m, r_mm or r_over_R), a chord (chord_m, chord_mm,
    chord_over_R or c_over_R), a twist (twist_deg, twist_rad or pitch_deg), and perhaps a thickness
    (thickness_over_chord, t_over_c, thickness_percent or t_over_c_pct) and the name of a section
    (section); other columns are ignored.

    Parameters
    ----------
    source : str or pathlib.Path
        The name of a shipped blade or the path of a file.
    hub_radius : float, optional, m
        Where the blade's root lies; an AeroDyn file counts from there and does not say it. Other
        files need none.

    Returns
    -------
    BladeTable

    Raises
    ------
    InputError
        If the file is missing, larger than 16 MiB, not UTF-8 or broken; the message names file,
        line or key, value and remedy.
    """
    path = locate(source, "blade")
    text = read_text(path, "blade file")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if not re.search(r"^\s*[^#\s]", text, re.MULTILINE):
        raise InputError(
            "is empty or holds remarks only",
            "its first line is such as r_m,chord_m,twist_deg",
            file=path,
            key="line 1",
        )
    if hub_radius is not None and not (np.isfinite(hub_radius) and hub_radius >= 0.0):
        raise InputError(
            "must not be negative", "give it in metres", key="hub_radius", value=hub_radius
        )
    # What a file is shows in its first lines that are no remarks.
    lines = [
        line for line in text.split("\n") if line.strip() and not line.lstrip().startswith("#")
    ]
    head, suffix = "\n".join(lines[:30]), path.suffix.lower()
    if _AERODYN.search(head) or (suffix in {".dat", ".inp"} and "," not in lines[0]):
        return _read_aerodyn(text, path, hub_radius)
    if _WINDIO.search(head) or suffix in {".yaml", ".yml"}:
        from hkt_mdo.files.windio import read_windio

        return read_windio(text, path)
    return _read_csv(text, path)


_AERODYN = re.compile(
    r"^[-=! ]*AERODYN\b|^\s*\S+\s+NumBlNds\b|^\s*BlSpn\b", re.MULTILINE | re.IGNORECASE
)
_WINDIO = re.compile(r"^(windIO_version|assembly|components|airfoils)\s*:", re.MULTILINE)


@dataclass(frozen=True, eq=False)
class Column:
    """Numbers of a file, and how a message names each of them."""

    name: str
    values: np.ndarray
    """In SI units and radians."""
    keys: Sequence[str]
    """The place of each in the file."""
    shown: Sequence[object]
    """Each as it is written."""

    def refuse(self, wrong: np.ndarray, problem: str, remedy: str, file: Path) -> None:
        """Raise InputError for the first of the wrong values, if any."""
        rows = np.flatnonzero(wrong)
        if rows.size:
            row = int(rows[0])
            raise InputError(problem, remedy, file=file, key=self.keys[row], value=self.shown[row])


def check_rows(
    file: Path,
    r: Column,
    chord: Column,
    twist: Column,
    thickness: Column | None,
    longest: float,
) -> None:
    """Refuse rows that are no blade.

    Parameters
    ----------
    file : pathlib.Path
    r, chord, twist, thickness : Column
        In SI units and radians; lengths perhaps over the tip radius.
    longest : float
        What no chord exceeds: the outermost radius.

    Raises
    ------
    InputError
        If radii do not increase strictly from zero or more, a chord is not positive or longer than
        the blade, a twist is beyond 180 degrees, or a thickness outside (0, 1].
    """
    if r.values.size < FEWEST_ROWS:
        raise InputError(
            f"is the only row: a blade has at least {FEWEST_ROWS}",
            "add the rows from hub to tip",
            file=file,
            key=r.keys[0],
            value=r.shown[0],
        )
    r.refuse(r.values < 0.0, "is a negative radius", "count radii from the rotor's centre", file)
    steps = np.diff(r.values, prepend=-np.inf)
    r.refuse(steps == 0.0, "stands there twice", "keep one row for each radius", file)
    r.refuse(
        steps < 0.0,
        "is less than the row before: radii must increase strictly",
        "sort the rows from hub to tip",
        file,
    )
    chord.refuse(chord.values <= 0.0, "is no chord", "chords must be greater than 0", file)
    chord.refuse(
        chord.values > longest,
        f"is a chord longer than the outermost radius ({longest:g})",
        "check the unit of the chord",
        file,
    )
    twist.refuse(
        np.abs(twist.values) > np.pi * (1.0 + EDGE),
        "is beyond 180 degrees",
        "check the unit of the twist",
        file,
    )
    if thickness is not None:
        thickness.refuse(
            (thickness.values <= 0.0) | (thickness.values > 1.0 + EDGE),
            "is no thickness over chord, which lies within 0 and 1 (0 and 100 %)",
            "correct it; thickness_percent counts in per cent, thickness_over_chord does not",
            file,
        )


# Quantity of a CSV column by its name: what it is divided by, and the message about it.
_RADIUS = {"r_m": 1.0, "r_mm": 1e3, "r_over_R": None}
_CHORD = {"chord_m": 1.0, "chord_mm": 1e3, "chord_over_R": None, "c_over_R": None}
_TWIST = ("twist_deg", "twist_rad", "pitch_deg")
_THICKNESS = {"thickness_over_chord": 1.0, "t_over_c": 1.0}
_THICKNESS |= {"thickness_percent": 100.0, "t_over_c_pct": 100.0}
_QUANTITIES: dict[str, tuple[Sequence[str], str]] = {
    "radius": (tuple(_RADIUS), r"r|radius|radii|span|rr|x"),
    "chord": (tuple(_CHORD), r"c|chord|cr"),
    "twist": (_TWIST, r"twist|pitch|theta|beta|twistangle|pitchangle"),
    "thickness": (tuple(_THICKNESS), r"t|tc|thickness|rthick|relativethickness"),
}
_UNIT = re.compile(
    r"[\[(].*|_(m|mm|cm|ft|in|inch|deg|rad|degrees|radians|pct|percent|over_\w+)$|/.*"
)


def _read_csv(text: str, file: Path) -> BladeTable:
    """Read a CSV table; see `read_blade`."""
    rows = _csv_rows(text, file)
    header_line, header = rows[0][0], [cell.strip() for cell in rows[0][1]]
    names = {
        quantity: _choose(header, quantity, quantity != "thickness", header_line, file)
        for quantity in _QUANTITIES
    }
    radius_name, chord_name = str(names["radius"]), str(names["chord"])
    twist_name, thickness_name = str(names["twist"]), names["thickness"]
    relative = _RADIUS[radius_name] is None
    if relative != (_CHORD[chord_name] is None):
        raise InputError(
            f"mixes {radius_name} with {chord_name}",
            "give radius and chord both as lengths or both over the tip radius",
            file=file,
            key=f"line {header_line}",
            value=",".join(header),
        )
    if header.count("section") > 1:
        raise _twice("section", header_line, file)
    if len(rows) == 1:
        raise InputError(
            "has a header but no rows",
            "add the rows from hub to tip",
            file=file,
            key=f"line {header_line}",
        )
    for line, cells in rows[1:]:
        if len(cells) != len(header):
            raise InputError(
                f"has {len(cells)} cells where the header has {len(header)}",
                "give one cell for each column, separated by commas",
                file=file,
                key=f"line {line}",
                value=",".join(cells),
            )

    messages = []

    def column(name: str, divisor: float | None, converted: str) -> Column:
        if converted:
            messages.append(f"{name}: {converted}")
        place = header.index(name)
        keys = [f"line {line}, column {name}" for line, _ in rows[1:]]
        shown = [cells[place].strip() for _, cells in rows[1:]]
        values = _numbers(shown, keys, file)
        return Column(name, values / divisor if divisor else values, keys, shown)

    def length(name: str, divisor: float | None) -> Column:
        return column(name, divisor, "mm converted to m" if divisor == 1e3 else "")

    r = length(radius_name, _RADIUS[radius_name])
    chord = length(chord_name, _CHORD[chord_name])
    twist = column(twist_name, None, "")
    if twist_name.endswith("_deg"):
        messages.append(f"{twist_name}: degrees converted to radians")
        twist = replace(twist, values=np.deg2rad(twist.values))
    thickness = None
    if thickness_name is not None:
        divisor = _THICKNESS[thickness_name]
        note = "per cent converted to a fraction" if divisor == 100.0 else ""
        thickness = column(thickness_name, divisor, note)
    if relative:
        r.refuse(
            r.values > 1.0 + EDGE,
            "lies beyond the tip, where r/R is 1",
            "divide by the tip radius, or name the column r_m or r_mm",
            file,
        )
    check_rows(file, r, chord, twist, thickness, 1.0 if relative else float(np.max(r.values)))

    section = None
    if "section" in header:
        place = header.index("section")
        section = tuple(cells[place].strip() for _, cells in rows[1:])
        for name, (line, _) in zip(section, rows[1:], strict=True):
            if not name:
                raise InputError(
                    "names no section",
                    "name the section of every row, or leave the column out",
                    file=file,
                    key=f"line {line}, column section",
                )
    return BladeTable(
        r.values,
        chord.values,
        twist.values,
        relative,
        None if thickness is None else thickness.values,
        section,
        messages=tuple(messages),
        file=str(file),
    )


def _csv_rows(text: str, file: Path) -> list[tuple[int, list[str]]]:
    """Return (line number, cells) of the lines that are neither empty nor a remark."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    rows = []
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#"):
                rows.append((reader.line_num, cells))
                if len(rows) > MOST_ROWS + 1:
                    raise InputError(
                        f"is beyond {MOST_ROWS} rows",
                        "give a blade of usual length",
                        file=file,
                        key=f"line {reader.line_num}",
                    )
    except csv.Error as error:
        raise InputError(
            f"is not CSV ({error})", "mend the line", file=file, key=f"line {reader.line_num}"
        ) from None
    if not rows:
        raise InputError(
            "has no header",
            "its first line is such as r_m,chord_m,twist_deg",
            file=file,
            key="line 1",
        )
    line, cells = rows[0]
    if len(cells) == 1 and re.search(r"[;\t]", cells[0]):
        raise InputError(
            "is not separated by commas",
            "separate cells by commas and write numbers with a decimal point",
            file=file,
            key=f"line {line}",
            value=cells[0],
        )
    return rows


def _choose(
    header: Sequence[str], quantity: str, needed: bool, line: int, file: Path
) -> str | None:
    """Return the one column of the header that holds a quantity."""
    names, words = _QUANTITIES[quantity]
    one_of = ", ".join(names[:-1]) + f" or {names[-1]}"
    found = [name for name in header if name in names]
    if len(found) > 1:
        if len(set(found)) == 1:
            raise _twice(found[0], line, file)
        raise InputError(
            f"has two columns for the {quantity}: {found[0]} and {found[1]}",
            "keep one of them",
            file=file,
            key=f"line {line}",
            value=",".join(header),
        )
    if found:
        return found[0]
    for cell in header:
        bare = re.sub(r"[^a-z]", "", _UNIT.sub("", cell.lower()))
        if (needed or cell.lower() == "thickness") and re.fullmatch(words, bare):
            problem = "has no unit in its name" if bare == cell.lower() else "is no known column"
            raise InputError(
                problem, f"rename it {one_of}", file=file, key=f"line {line}, column {cell}"
            )
    if needed:
        raise InputError(
            f"lacks a column of the {quantity}",
            f"add one named {one_of}",
            file=file,
            key=f"line {line}",
            value=",".join(header),
        )
    return None


def _twice(name: str, line: int, file: Path) -> InputError:
    return InputError(
        "appears twice in the header",
        "name each column once",
        file=file,
        key=f"line {line}, column {name}",
    )


def to_number(text: str) -> float:
    """Return the number that a text writes, NaN where it writes none that is finite."""
    number = parse_number(re.sub("[dD]", "e", text))  # Fortran writes 1.0D+00 for 1.0e+00
    return np.nan if number is None else number


def _numbers(cells: Sequence[str], keys: Sequence[str], file: Path) -> np.ndarray:
    """Return the numbers of a column."""
    numbers = np.array([to_number(cell) for cell in cells])
    Column("", numbers, keys, cells).refuse(
        np.isnan(numbers),
        "must be a finite number",
        "write it with a decimal point, without a unit",
        file,
    )
    return numbers


_AERODYN_UNITS = {"BlSpn": "m", "BlCrvAC": "m", "BlSwpAC": "m", "BlCrvAng": "deg"}
_AERODYN_UNITS |= {"BlTwist": "deg", "BlChord": "m", "BlAFID": "-", "t_c": "-"}
_AERODYN_NEEDED = ("BlSpn", "BlTwist", "BlChord", "BlAFID")


def _read_aerodyn(text: str, file: Path, hub_radius: float | None) -> BladeTable:
    """Read an AeroDyn 15 blade file; see `read_blade`.

    OpenFAST's form: a line ``19 NumBlNds``, one of column names, one of units, NumBlNds rows. The
    columns are found by their names, since their number grew over the versions.
    """
    lines = text.rstrip().split("\n")
    count, count_line = _node_count(lines, file)
    header_line = next(
        (n for n in range(count_line + 1, len(lines)) if re.match(r"\s*\S", lines[n])), len(lines)
    )
    header = lines[header_line].split() if header_line < len(lines) else []
    known = {name.lower(): name for name in _AERODYN_UNITS}
    header = [known.get(name.lower(), name) for name in header]
    for name in _AERODYN_NEEDED:
        if name not in header:
            raise InputError(
                f"lacks the column {name}",
                "the line after NumBlNds names the columns BlSpn BlCrvAC BlSwpAC BlCrvAng BlTwist "
                "BlChord BlAFID",
                file=file,
                key=f"line {min(header_line, len(lines) - 1) + 1}",
                value=" ".join(header),
            )
    for name in header:
        if header.count(name) > 1:
            raise _twice(name, header_line + 1, file)
    first = header_line + 2
    units = lines[first - 1].split() if first - 1 < len(lines) else []
    if not units or not units[0].startswith("("):
        raise InputError(
            "is not the line of units",
            "write (m) (m) (m) (deg) (deg) (m) (-) under the names of the columns",
            file=file,
            key=f"line {min(first, len(lines))}",
            value=" ".join(units),
        )
    if len(units) == len(header):
        for name, unit in zip(header, units, strict=True):
            if unit.strip("()").lower() != _AERODYN_UNITS.get(name, unit.strip("()").lower()):
                raise InputError(
                    f"is not AeroDyn's unit ({_AERODYN_UNITS[name]})",
                    f"convert the column to ({_AERODYN_UNITS[name]})",
                    file=file,
                    key=f"line {first}, column {name}",
                    value=unit,
                )

    cells = []
    for n in range(first, first + count):
        if n >= len(lines):
            raise InputError(
                f"promises {count} rows, but the file ends after {n - first}",
                "complete the rows or correct NumBlNds",
                file=file,
                key=f"line {count_line + 1}, NumBlNds",
                value=count,
            )
        row = re.split(r"[!#]", lines[n])[0].split()
        if len(row) != len(header):
            raise InputError(
                f"has {len(row)} numbers where the header names {len(header)} columns",
                f"row {n - first + 1} of the {count} that NumBlNds promises; complete it or "
                "correct NumBlNds",
                file=file,
                key=f"line {n + 1}",
                value=lines[n].strip(),
            )
        cells.append(row)
    messages = []
    left = [
        line
        for line in lines[first + count :]
        if not np.isnan(to_number((line.split() or [""])[0]))
    ]
    if left:
        messages.append(
            f"NumBlNds = {count}: {len(left)} rows after these are ignored, as OpenFAST does"
        )

    def column(name: str) -> Column:
        place = header.index(name)
        keys = [f"line {first + n + 1}, column {name}" for n in range(count)]
        shown = [row[place] for row in cells]
        return Column(name, _numbers(shown, keys, file), keys, shown)

    span, chord, degrees = column("BlSpn"), column("BlChord"), column("BlTwist")
    if hub_radius is None:
        raise InputError(
            "counts from the blade's root, whose radius an AeroDyn file does not say",
            "give the hub radius in metres",
            file=file,
            key=span.keys[0],
            value=span.shown[0],
        )
    span.refuse(
        (np.arange(count) == 0) & (span.values != 0.0),
        "is not 0, where AeroDyn's span begins: it counts from the blade's root",
        "subtract the hub radius from the column",
        file,
    )
    span.refuse(span.values < 0.0, "is a negative span", "count from the blade's root", file)
    messages.append("BlTwist: degrees converted to radians")
    if hub_radius:
        messages.append(f"BlSpn: counted from the root, hub radius of {hub_radius:g} m added")
    for name, what in (("BlCrvAC", "prebend"), ("BlSwpAC", "sweep"), ("BlCrvAng", "cant angle")):
        if name in header and np.any(column(name).values != 0.0):
            largest = np.max(np.abs(column(name).values))
            unit = _AERODYN_UNITS[name]
            messages.append(
                f"{name}: {what} of up to {largest:g} {unit} is ignored: straight blade"
            )
    thickness = None
    if "t_c" in header:
        thickness = column("t_c")
        if not np.any(thickness.values):
            messages.append("t_c: all 0, taken as not given")
            thickness = None
    # The r of check_rows is the span, so that its messages quote what the file says.
    twist = replace(degrees, values=np.deg2rad(degrees.values))
    longest = hub_radius + float(np.max(span.values))
    check_rows(file, span, chord, twist, thickness, longest)
    r = hub_radius + span.values
    Column("", np.diff(r, prepend=-1.0), span.keys, span.shown).refuse(
        np.diff(r, prepend=-1.0) <= 0.0, "stands there twice", "keep one row for each radius", file
    )
    section = column("BlAFID")
    section.refuse(
        (section.values < 1.0) | (section.values != np.floor(section.values)),
        "is no number of an airfoil",
        "give the place in AeroDyn's list of airfoil files, from 1",
        file,
    )
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


def _node_count(lines: Sequence[str], file: Path) -> tuple[int, int]:
    """Return what the line NumBlNds says, and its index."""
    for index, line in enumerate(lines):
        found = re.match(r"\s*(\S+)\s+NumBlNds\b", line, re.IGNORECASE)
        if not found:
            continue
        count = to_number(found[1])
        if not (count == np.floor(count) and FEWEST_ROWS <= count <= MOST_ROWS):
            raise InputError(
                f"is no number of rows from {FEWEST_ROWS} to {MOST_ROWS}",
                "write how many rows the blade has",
                file=file,
                key=f"line {index + 1}, NumBlNds",
                value=found[1],
            )
        return int(count), index
    raise InputError(
        "has no line `19 NumBlNds`, so it is no AeroDyn 15 blade file",
        "give the blade file (ADBlFile) that AeroDyn's primary file names, or a CSV file",
        file=file,
        key="line 1",
        value=lines[0],
    )


def write_blade_csv(path: str | Path, blade, remarks: Iterable[str] = ()) -> None:
    """Write a blade as CSV whose numbers read back bit by bit.

    Columns r_m, chord_m, twist_rad, and thickness_over_chord and section where the blade has them.
    The file is complete or not there at all.

    Parameters
    ----------
    path : str or pathlib.Path
    blade : Blade or BladeTable
        In metres and radians.
    remarks : iterable of str
        Written first, as lines that begin with ``#``.

    Raises
    ------
    ValueError
        If the blade's lengths are over the tip radius: `BladeTable.scaled` makes them metres.
    InputError
        If the file cannot be written.
    """
    if getattr(blade, "relative", False):
        raise ValueError("a blade over the tip radius has no lengths to write; scale it first")
    columns: dict[str, Sequence] = {
        "r_m": blade.r,
        "chord_m": blade.chord,
        "twist_rad": blade.twist,
    }
    columns = {name: [repr(float(value)) for value in values] for name, values in columns.items()}
    if getattr(blade, "thickness", None) is not None:
        columns["thickness_over_chord"] = [repr(float(value)) for value in blade.thickness]
    if getattr(blade, "section", None) is not None:
        columns["section"] = blade.section
    stream = io.StringIO(newline="")
    for remark in remarks:
        for line in str(remark).splitlines() or [""]:
            stream.write(f"# {line}".rstrip() + "\n")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))

    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(stream.getvalue(), encoding="utf-8", newline="")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InputError(
            f"cannot be written ({error.strerror})", "choose another place", file=path
        ) from None
