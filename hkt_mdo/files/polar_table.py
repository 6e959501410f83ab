"""Table of a polar, the same for every file format: lift and drag at one Reynolds number."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Column, Row, number_columns, parse_number

FEWEST_ROWS = 8
"""Fewest angles of a polar; fewer do not show where it stalls."""

NEEDED_RANGE = -5.0, 12.0
"""Angles of attack that a table has to cover, deg; Viterna's extension begins at its ends."""

LARGEST = {"lift": 6.0, "drag": 5.0, "moment": 5.0}
"""Largest magnitudes of coefficients; larger ones are most likely in another unit."""

REYNOLDS_RANGE = 1e3, 1e9
"""Range of Reynolds numbers of blades, with a margin; others are most likely in another unit."""

ATTACHED, LEAST_FALL = 5.0, 0.1
"""Angle of attack, deg, up to which the lift of sections rises; a smaller fall is a cylinder's."""

PRESSURE_RANGE = -60.0, 1.0
"""Smallest pressure coefficients; 1 is that of a stagnation point."""

SURFACES = "cpmin_upper", "cpmin_lower"
"""Columns of the smallest pressure coefficient of each surface; `cpmin` is that of both."""

ANGLES = "alpha_deg", "alpha_rad", "alpha"
"""Names of a column of angles of attack, the first of which counts; without a unit in degrees."""

CIRCLE_EDGE = 0.1
"""How far an end of a full circle may be from 180 deg, deg; files write 3.14 rad."""

_COEFFICIENTS = "cl", "cd", "cm", "cpmin", *SURFACES

_OPPOSITE = {"alpha": -1.0, "cl": -1.0, "cm": -1.0}
"""Factor of a symmetric section's values at the opposite angle, where it is not 1."""

_SYMMETRIC = {"cl": (0.0, 0.005), "cd": (0.05, 0.0), "cm": (0.0, 0.005)}
"""How far rows at opposite angles of a symmetric section may differ, relatively and absolutely."""

ENDS_EQUAL, ENDS_ROUNDED = 1e-6, 0.01
"""How far coefficients at -180 and 180 deg, which are one angle, may differ; and with a message."""


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


def polar_table(
    columns: Mapping[str, Column], reynolds: float | None = None, where: str = ""
) -> PolarTable:
    """Check a polar and return it in radians.

    A row that repeats the one before is left out. Rows of a symmetric section that begin between -5
    and 0 degrees are mirrored: lift and moment change their sign with the angle, drag does not. A
    section counts as symmetric if that is so of the rows that have a counterpart. A full circle
    whose angles or coefficients at both ends are rounded is closed.

    Parameters
    ----------
    columns : mapping of str to Column
        Finite numbers, one row at least: the angle of attack by one of the names `ANGLES`, ``cl``,
        ``cd``, and perhaps ``cm`` and the smallest pressure coefficient, ``cpmin`` or both of
        `SURFACES`, which then count.
    reynolds : float, optional
        Reynolds number by the chord.
    where : str
        Words that identify this polar among others in the file.

    Returns
    -------
    PolarTable
        The polar.

    Raises
    ------
    InputError
        If there are fewer than 8 rows (two suffice where all are equal, as a cylinder's), angles do
        not increase strictly or cover neither -5 to 12 degrees within ±90 nor the full circle, the
        ends of a full circle differ by more than rounding, drag is not positive, lift falls,
        pressure is nowhere below 0 though not 0 throughout, one surface's comes without the
        other's, or a number is beyond what sections have.
    """
    messages = []
    unit = next(name for name in ANGLES if name in columns)
    angle, file = columns[unit], columns[unit].file
    if unit == "alpha_rad":
        angle = replace(angle, values=np.rad2deg(angle.values))
    table = {"alpha": angle} | {name: columns[name] for name in _COEFFICIENTS if name in columns}
    changes = [np.diff(column.values) != 0.0 for column in table.values()]
    new = np.append(True, np.any(changes, axis=0))
    if not np.all(new):
        messages.append(f"{file}: {np.sum(~new)} repeated rows are left out")
        table = {name: column.at(np.flatnonzero(new)) for name, column in table.items()}
    if _is_half_of_symmetric(table):
        first = table["alpha"].values[0]
        messages.append(f"{file}: symmetric section, mirrored below {first:.4g} degrees")
        table = _mirrored(table)
    constant = not np.ptp(table["cl"].values) and not np.ptp(table["cd"].values)
    degrees, circle = _angles(table["alpha"], constant)
    if circle:
        ends = table["alpha"].values[[0, -1]]
        if not np.allclose(np.abs(ends), 180.0, rtol=1e-5, atol=0.0):
            note = f"angles from {ends[0]:.6g} to {ends[1]:.6g} degrees count as a full circle"
            messages.append(f"{file}: {note}")
        table |= {x: _closed(table[x], messages) for x in ("cl", "cd", "cm") if x in table}
    lift, drag, moment = table["cl"], table["cd"], table.get("cm")
    ends = "; for a hub or tip without load, name the section beside it in the blade's file"
    remedy = "correct the row" + ends * (not np.any(drag.values))
    drag.refuse(drag.values <= 0.0, "drag must be positive", remedy)
    remedy = "give the coefficient as a plain number, not in counts or percent"
    for name, column in (("lift", lift), ("drag", drag), ("moment", moment)):
        if column is not None:
            problem = f"is beyond {LARGEST[name]:g}, which no section has"
            column.refuse(np.abs(column.values) > LARGEST[name], problem, remedy)
    below, above = np.interp([-ATTACHED, ATTACHED], degrees, lift.values)
    problem = f"falls from -{ATTACHED:g} to {ATTACHED:g} degrees, where the lift of sections rises"
    falls = (np.abs(degrees) < ATTACHED) & (above < below - LEAST_FALL)
    lift.refuse(falls, problem, "correct its sign, or that of the angle of attack")
    return PolarTable(
        None if reynolds is None else float(reynolds),
        np.deg2rad(degrees),
        lift.values,
        drag.values,
        None if moment is None else moment.values,
        circle,
        _smallest_pressure(table),
        f"{file}, {where}" if where else str(file),
        tuple(messages),
    )


def in_order(tables: list[PolarTable], file: object, of: str = "") -> tuple[PolarTable, ...]:
    """Return the polars of a section by rising Reynolds number.

    Parameters
    ----------
    tables : list of PolarTable
        One at least.
    file, of : object, str
        The file, and what follows "Reynolds number" in a message, such as `` of thick``.

    Returns
    -------
    tuple of PolarTable
        The same.

    Raises
    ------
    InputError
        If two have the same number, or one of several has none.
    """
    polars = sorted(tables, key=lambda table: table.reynolds or 0.0)
    for one, other in pairwise(polars):
        if one.reynolds in (None, other.reynolds):
            problem = "is missing" if one.reynolds is None else "is that of two tables"
            remedy = "give one table for each Reynolds number"
            key = f"Reynolds number{of}"
            raise InputError(problem, remedy, file=file, key=key, value=one.reynolds)
    return tuple(polars)


def polar_of_rows(
    rows: Sequence[Row], names: Sequence[str], reynolds: float | None, file: object, where: str = ""
) -> PolarTable:
    """Return the polar of rows of a text.

    Parameters
    ----------
    rows : sequence of (int, sequence of str)
        Line number and cells of each row.
    names : sequence of str
        Names of all columns, as of `polar_table`, in small letters; others are not read.
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
    wanted = (*ANGLES, *_COEFFICIENTS)
    return polar_table(number_columns(rows, names, file, wanted, where), reynolds, where)


def _is_half_of_symmetric(table: Mapping[str, Column]) -> bool:
    """Tell whether a table begins between -5 and 0 degrees, and is symmetric as far as it goes."""
    angle = table["alpha"].values
    begins_late = NEEDED_RANGE[0] < angle[0] <= 0.0 and np.all(np.diff(angle) > 0.0)
    if not begins_late or (angle[0] == 0.0 and "cm" not in table):
        return False
    below = np.flatnonzero(angle <= 0.0)
    opposite = np.array([np.argmin(np.abs(angle + angle[at])) for at in below])
    if np.any(np.abs(angle[below] + angle[opposite]) >= 1e-6):
        return False
    for name in _SYMMETRIC.keys() & table.keys():
        expected = _OPPOSITE.get(name, 1.0) * table[name].values[opposite]
        if not np.allclose(table[name].values[below], expected, *_SYMMETRIC[name]):
            return False
    return True


def _mirrored(table: Mapping[str, Column]) -> dict[str, Column]:
    """Return a table with the rows that a symmetric section lacks."""
    angle = table["alpha"].values
    lacking = np.flatnonzero(angle > -angle[0])[::-1]
    rows = np.append(lacking, np.arange(angle.size))
    other = dict(zip(SURFACES, SURFACES[::-1], strict=True))
    made = {}
    for name, column in table.items():
        opposite = table.get(other.get(name, name), column).values[lacking]
        values = np.append(_OPPOSITE.get(name, 1.0) * opposite, column.values)
        made[name] = replace(column.at(rows), values=values)
    return made


def _angles(column: Column, constant: bool) -> tuple[np.ndarray, bool]:
    """Return the angles in degrees, and whether they run round; constant: lift and drag are so."""
    angle, in_radians = column.values.copy(), column.name.endswith("alpha_rad")
    remedy = "angles of attack run from -180 to 180 degrees"
    remedy += "; if these are degrees, name the column alpha_deg" * in_radians
    column.refuse(np.abs(angle) > 180.0 + CIRCLE_EDGE, "lies beyond the full circle", remedy)
    first, last = angle[0], angle[-1]
    circle = bool(first <= -180 + CIRCLE_EDGE and last >= 180 - CIRCLE_EDGE)
    if circle:
        angle[0], angle[-1] = -180.0, 180.0
    column.check_rising("angles", angle)
    low, high = NEEDED_RANGE
    if angle.size < FEWEST_ROWS and not (circle and constant):
        problem = f"the polar has {angle.size} rows, at least {FEWEST_ROWS} are needed"
        remedy = "give a finer table"
    elif not circle and (first > low or last < high or first < -90 or last > 90):
        problem = f"the table must reach from {low:g} or less to {high:g} or more and stay within "
        problem += "-90 and 90 degrees, or run from -180 to 180"
        remedy = "extend or cut it (beyond the table the polar is extended by Viterna)"
        if not in_radians and np.max(np.abs(angle)) < 1.01 * np.pi:  # files round
            other = " or name the column alpha_rad" * column.name.endswith("alpha_deg")
            remedy = f"if these are radians, convert them{other}; {remedy}"
    else:
        return angle, circle
    span = f"{angle[0]:g} … {angle[-1]:g}"
    raise InputError(problem, remedy, file=column.file, key=column.name, value=span)


def _closed(column: Column, messages: list[str]) -> Column:
    """Return a coefficient that is the same at both ends of a full circle, but for rounding."""
    values = column.values.copy()
    first, end = values[0], np.arange(values.size) == values.size - 1
    problem = f"differs from {first:g} at -180 degrees"
    remedy = "-180 and 180 degrees are one angle: give both rows the same coefficients"
    column.refuse(end & (np.abs(values - first) >= ENDS_ROUNDED), problem, remedy)
    if abs(values[-1] - first) > ENDS_EQUAL:
        ends = f"{column.file}: {column.name} = {first:.4g} and {values[-1]:.4g} at ±180 degrees"
        messages.append(f"{ends}, which are one angle: their mean is taken")
        values[[0, -1]] = 0.5 * (first + values[-1])
    return replace(column, values=values)


def _smallest_pressure(table: Mapping[str, Column]) -> np.ndarray | None:
    """Return `PolarTable.smallest_pressure` of the columns of a file; None without any but 0."""
    columns = {name: table[name] for name in ("cpmin", *SURFACES) if name in table}
    if not any(np.any(column.values) for column in columns.values()):
        return None  # zeros stand in for a pressure that is unknown
    low, high = PRESSURE_RANGE
    without = all(np.all(column.values >= 0.0) for column in columns.values())
    for column in columns.values():
        problem = f"is no smallest pressure coefficient: {low:g} to {high:g}, somewhere below 0"
        remedy = "give it as Cp is: negative where there is suction"
        column.refuse((column.values < low) | (column.values > high) | without, problem, remedy)
    surfaces = [columns[name] for name in SURFACES if name in columns]
    if len(surfaces) == 1:
        remedy = f"give {' and '.join(SURFACES)}, or cpmin, the smaller of both"
        file, key = surfaces[0].file, surfaces[0].name
        raise InputError("is of one surface alone", remedy, file=file, key=key)
    if surfaces:
        upper, lower = surfaces
        swapped = (upper.values > lower.values) & (table["cl"].values == table["cl"].values.max())
        problem = "is less suction than that of the lower surface, where the lift is largest"
        upper.refuse(swapped, problem, f"exchange {' and '.join(SURFACES)}")
    return np.stack([column.values for column in surfaces or columns.values()])


def read_reynolds(cell: str, file: object, key: str, unit: float = 1.0) -> float:
    """Return a Reynolds number that a section may have.

    Parameters
    ----------
    cell : str
        The number as it is written, in `unit`.
    file, key : object, str
        Where it stands, for messages.
    unit : float
        Unit of the number, such as 1e6.

    Returns
    -------
    float
        Reynolds number.

    Raises
    ------
    InputError
        If it is no number or out of `REYNOLDS_RANGE`.
    """
    number, (low, high) = parse_number(cell), REYNOLDS_RANGE
    if number is None or not low <= number * unit <= high:
        scale = "in millions, such as 0.2" if unit != 1.0 else "as a plain number, such as 2e5"
        problem = f"is no Reynolds number between {low / unit:g} and {high / unit:g}"
        raise InputError(problem, f"give it {scale}", file=file, key=key, value=cell)
    return number * unit
