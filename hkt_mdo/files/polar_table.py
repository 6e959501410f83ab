"""Table of a polar, the same for every file format: lift and drag at one Reynolds number."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Column, Row, number_columns

FEWEST_ROWS = 8
"""Fewest angles of a polar; fewer do not show where it stalls."""

NEEDED_RANGE = -5.0, 12.0
"""Angles of attack that a table has to cover, deg; Viterna's extension begins at its ends."""

LARGEST = {"lift": 6.0, "drag": 5.0, "moment": 5.0}
"""Largest magnitudes of coefficients; larger ones are most likely in another unit."""

REYNOLDS_RANGE = 1e3, 1e9
"""Range of Reynolds numbers of blades, with a margin; others are most likely in another unit."""

PRESSURE_RANGE = -60.0, 1.0
"""Smallest pressure coefficients; 1 is that of a stagnation point."""

SURFACES = "cpmin_upper", "cpmin_lower"
"""Columns of the smallest pressure coefficient of each surface; `cpmin` is that of both."""

ANGLES = "alpha_deg", "alpha_rad", "alpha"
"""Names of a column of angles of attack, the first of which counts; without a unit in degrees."""

_CIRCLE_EDGE = 1e-3
"""How far an end of a full circle may be from 180 deg, deg; files write 3.1416 rad."""

_SYMMETRIC = {"lift": 0.005, "drag": 0.05, "moment": 0.005}
"""How far rows at opposite angles of a symmetric section may differ; drag relatively."""

_ENDS_EQUAL = 1e-6
"""How far coefficients at -180 and 180 deg, which are one angle, may differ."""


@dataclass(frozen=True, eq=False)
class PolarTable:
    """Lift and drag of a section at one Reynolds number, from a file."""

    reynolds: float | None
    """Reynolds number by the chord; None where the file states none."""
    alpha: np.ndarray
    """Angle of attack, rad, strictly increasing, shape (n_rows,)."""
    lift: np.ndarray
    """Lift coefficient, shape (n_rows,)."""
    drag: np.ndarray
    """Drag coefficient, shape (n_rows,)."""
    moment: np.ndarray | None
    """Pitching moment coefficient, shape (n_rows,); None where the file has none."""
    full_circle: bool
    """Whether the table runs from -pi to pi, with equal coefficients at both ends."""
    smallest_pressure: np.ndarray | None = None
    """Smallest pressure coefficient (Cp min), negative where there is suction: shape (2, n_rows) of
    the upper and the lower surface, or (1, n_rows) where only the smaller of them is known."""
    source: str = ""
    """Where the table comes from, for messages."""
    messages: tuple[str, ...] = ()
    """Notes on how the rows were changed."""


class Source(NamedTuple):
    """Where the numbers of a polar come from, for messages."""

    file: object = ""
    where: str = ""
    """Words that identify this polar among others in the file."""
    titles: Sequence[str] = ("alpha_deg", "cl", "cd", "cm")
    """The file's names of angle, lift, drag and moment; an angle that ends in _rad is in rad."""
    lines: Sequence[int] = ()
    """Numbers of the rows' lines; empty where the file has no line for each row."""


def polar_table(
    alpha: np.ndarray,
    lift: np.ndarray,
    drag: np.ndarray,
    moment: np.ndarray | None = None,
    reynolds: float | None = None,
    pressure: Mapping[str, np.ndarray] | None = None,
    source: Source | None = None,
) -> PolarTable:
    """Check a polar and return it in radians.

    A row that repeats the one before is left out. Rows of a symmetric section that begin between -5
    and 0 degrees are mirrored: lift and moment change their sign with the angle, drag does not. A
    section counts as symmetric if that is so of the rows that have a counterpart.

    Parameters
    ----------
    alpha : numpy.ndarray, shape (n_rows,)
        Angle of attack, deg, or rad where the first of the source's titles ends in ``_rad``.
    lift, drag : numpy.ndarray, shape (n_rows,)
        Lift and drag coefficient.
    moment : numpy.ndarray, shape (n_rows,), optional
        Pitching moment coefficient.
    reynolds : float, optional
        Reynolds number by the chord.
    pressure : mapping of str to numpy.ndarray, shape (n_rows,), optional
        Smallest pressure coefficients by the names of their columns: ``cpmin`` in any spelling, or
        both of `SURFACES`, which then count.
    source : Source, optional
        Where the numbers come from, for messages.

    Returns
    -------
    PolarTable
        The polar.

    Raises
    ------
    InputError
        If there are fewer than 8 rows (two suffice where all are equal, as a cylinder's), angles do
        not increase strictly or cover neither -5 to 12 degrees within ±90 nor the full circle, the
        ends of a full circle differ, drag is not positive, one surface's pressure comes without the
        other's, or a number is not finite or beyond what sections have.
    """
    source, messages = source or Source(), []
    given = {"angle": alpha, "lift": lift, "drag": drag, "moment": moment, **(pressure or {})}
    table = {name: np.asarray(rows, float) for name, rows in given.items() if rows is not None}
    changes = np.any([np.diff(rows) != 0.0 for rows in table.values()], axis=0)
    new = np.append(True, changes)[: table["angle"].size]
    table["row"] = np.asarray(source.lines if len(source.lines) else np.arange(new.size) + 1)
    if not np.all(new):
        messages.append(f"{source.file}: {np.sum(~new)} repeated rows are left out")
        table = {name: rows[new] for name, rows in table.items()}
    radians_per_unit = 1.0 if source.titles[0].endswith("_rad") else np.pi / 180.0
    if _is_half_of_symmetric(table, np.deg2rad(NEEDED_RANGE[0]) / radians_per_unit):
        first = f"{np.rad2deg(table['angle'][0] * radians_per_unit):.4g}"
        messages.append(f"{source.file}: symmetric section, mirrored below {first} degrees")
        table = _mirrored(table)
    titles = dict(zip(("angle", *LARGEST), source.titles, strict=False))
    columns = {
        name: _column(titles.get(name, name), rows, table["row"], source)
        for name, rows in table.items()
        if name != "row"
    }
    values = {name: column.values for name, column in columns.items()}
    constant = values["lift"].size > 0 and not np.ptp(values["lift"]) and not np.ptp(values["drag"])
    radians, circle = _angles(columns["angle"], radians_per_unit != 1.0, constant)
    for name in LARGEST:
        if name in columns:
            _check_coefficient(name, columns[name], circle)
    return PolarTable(
        None if reynolds is None else float(reynolds),
        radians,
        values["lift"],
        values["drag"],
        values.get("moment"),
        circle,
        _smallest_pressure({name: columns[name] for name in pressure or ()}),
        f"{source.file}, {source.where}" if source.where else str(source.file),
        tuple(messages),
    )


def polar_of_rows(
    rows: Sequence[Row], names: Sequence[str], reynolds: float | None, file: object, where: str = ""
) -> PolarTable:
    """Return the polar of rows of a text.

    Parameters
    ----------
    rows : sequence of (int, sequence of str)
        Line number and cells of each row.
    names : sequence of str
        Names of all columns: ``alpha``, ``alpha_deg`` or ``alpha_rad``, ``cl``, ``cd``, and perhaps
        ``cm``, ``cpmin`` and `SURFACES`, in small letters; others are not read.
    reynolds : float or None
        Reynolds number by the chord.
    file : object
        The file, for messages.
    where : str
        Words that identify this polar among others in the file.

    Returns
    -------
    PolarTable
        The polar.

    Raises
    ------
    InputError
        If a row has more or fewer cells than `names`, a cell is no number, or as of `polar_table`.
    """
    angle = next(name for name in ANGLES if name in names)
    wanted = angle, "cl", "cd", "cm", "cpmin", *SURFACES
    columns = number_columns(rows, names, file, wanted)
    values = {name: column.values for name, column in columns.items()}
    alpha, lift, drag = values.pop(angle), values.pop("cl"), values.pop("cd")
    moment = values.pop("cm", None)
    source = Source(file, where, (angle, "cl", "cd", "cm"), [line for line, _ in rows])
    return polar_table(alpha, lift, drag, moment, reynolds, values, source)


def _column(title: str, values: np.ndarray, rows: np.ndarray, source: Source) -> Column:
    """Return finite numbers with the place of each."""
    prefix = f"{source.where}, " if source.where else ""
    word = "line" if len(source.lines) else "row"
    keys = [f"{prefix}{word} {row:.0f}, column {title}" for row in rows]
    column = Column(f"{prefix}{title}", values, keys, values.tolist(), source.file)
    column.refuse(~np.isfinite(values), "must be a finite number", "correct the row")
    return column


def _is_half_of_symmetric(table: Mapping[str, np.ndarray], low: float) -> bool:
    """Tell whether a table begins between `low` and 0, and is symmetric as far as it goes."""
    angle = table["angle"]
    begins_late = angle.size and low < angle[0] <= 0.0 and np.all(np.diff(angle) > 0.0)
    if not begins_late or (angle[0] == 0.0 and "moment" not in table):
        return False
    below = np.flatnonzero(angle <= 0.0)
    opposite = np.array([np.argmin(np.abs(angle + angle[at])) for at in below])
    if np.any(np.abs(angle[below] + angle[opposite]) >= 1e-6):
        return False
    for name, near in _SYMMETRIC.items():
        if name in table:
            one, two = table[name][below], table[name][opposite]
            off = one - two if name == "drag" else one + two
            if not np.all(np.abs(off) <= near * (np.abs(two) if name == "drag" else 1.0)):
                return False
    return True


def _mirrored(table: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return a table with the rows that a symmetric section lacks."""
    lacking = np.flatnonzero(table["angle"] > -table["angle"][0])[::-1]
    other = dict(zip(SURFACES, SURFACES[::-1], strict=True))
    signs = {"angle": -1.0, "lift": -1.0, "moment": -1.0}
    return {
        name: np.append(signs.get(name, 1.0) * table.get(other.get(name), rows)[lacking], rows)
        for name, rows in table.items()
    }


def _angles(given: Column, in_degrees: bool, constant: bool) -> tuple[np.ndarray, bool]:
    """Return the angles in radians, and whether they run round; constant: lift and drag are so."""
    angle = given.values if in_degrees else np.rad2deg(given.values)
    remedy = "angles of attack run from -180 to 180 degrees"
    remedy += "" if in_degrees else "; if these are degrees, name the column alpha_deg"
    given.refuse(np.abs(angle) > 180.0 + _CIRCLE_EDGE, "lies beyond the full circle", remedy)
    first, last = (angle[0], angle[-1]) if angle.size else (0.0, 0.0)
    circle = bool(first <= -180 + _CIRCLE_EDGE and last >= 180 - _CIRCLE_EDGE)
    radians = np.deg2rad(given.values) if in_degrees else given.values.copy()
    if circle:
        radians[0], radians[-1] = -np.pi, np.pi
    given.check_rising("angles", radians)
    low, high = NEEDED_RANGE
    if angle.size < FEWEST_ROWS and not (circle and constant):
        problem = f"the polar has {angle.size} rows, at least {FEWEST_ROWS} are needed"
        remedy = "give a finer table"
    elif not circle and (first > low or last < high or first < -90 or last > 90):
        problem = f"the table must reach from {low:g} or less to {high:g} or more and stay within "
        problem += "-90 and 90 degrees, or run from -180 to 180"
        remedy = "extend or cut it (beyond the table the polar is extended by Viterna)"
        if in_degrees and np.max(np.abs(angle)) <= np.pi:
            remedy = f"if these are radians, convert them or name the column alpha_rad; {remedy}"
    else:
        return radians, circle
    span = f"{given.values[0]:g} … {given.values[-1]:g}" if angle.size else "nothing"
    raise InputError(problem, remedy, file=given.file, key=given.name, value=span)


def _check_coefficient(name: str, column: Column, circle: bool) -> None:
    """Refuse a circle that does not close, drag that is not positive, and absurd coefficients."""
    values = column.values
    if circle:
        last = np.arange(values.size) == values.size - 1
        problem = f"differs from {values[0]:g} at -180 degrees"
        remedy = "-180 and 180 degrees are one angle: give both rows the same coefficients"
        column.refuse(last & (np.abs(values - values[0]) > _ENDS_EQUAL), problem, remedy)
    if name == "drag":
        column.refuse(values <= 0.0, "drag must be positive", "correct the row")
    problem = f"is beyond {LARGEST[name]:g}, which no section has"
    remedy = "give the coefficient as a plain number, not in counts or percent"
    column.refuse(np.abs(values) > LARGEST[name], problem, remedy)


def _smallest_pressure(given: dict[str, Column]) -> np.ndarray | None:
    """Return `PolarTable.smallest_pressure` of the columns of a file."""
    low, high = PRESSURE_RANGE
    for column in given.values():
        problem = f"is no smallest pressure coefficient: it lies between {low:g} and {high:g}"
        remedy = "give it as Cp is: negative where there is suction"
        column.refuse((column.values < low) | (column.values > high), problem, remedy)
    surfaces = [given[name] for name in SURFACES if name in given]
    if len(surfaces) == 1:
        remedy = f"give {' and '.join(SURFACES)}, or cpmin, the smaller of both"
        file, key = surfaces[0].file, surfaces[0].name
        raise InputError("is of one surface alone", remedy, file=file, key=key)
    columns = [column.values for column in surfaces or given.values()]
    return np.stack(columns) if columns else None


def check_reynolds(
    number: float | None, cell: str, file: object, key: str, unit: float = 1.0
) -> float:
    """Return a Reynolds number that a section may have.

    Parameters
    ----------
    number : float or None
        The file's number, in `unit`; None if it is no number.
    cell : str
        The same as it is written.
    file, key : object, str
        Where it stands, for messages.
    unit : float
        Unit of `number`, such as 1e6.

    Returns
    -------
    float
        Reynolds number.

    Raises
    ------
    InputError
        If it is no number or out of `REYNOLDS_RANGE`.
    """
    low, high = REYNOLDS_RANGE
    if number is None or not low <= number * unit <= high:
        scale = "in millions, such as 0.2" if unit != 1.0 else "as a plain number, such as 2e5"
        problem = f"is no Reynolds number between {low / unit:g} and {high / unit:g}"
        raise InputError(problem, f"give it {scale}", file=file, key=key, value=cell)
    return number * unit
