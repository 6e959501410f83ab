"""What a polar table is: lift and drag at one Reynolds number, whichever format it comes from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hkt_mdo.errors import InputError

__all__ = ["PolarTable", "polar_table"]

FEWEST_ROWS = 8
NEEDED_RANGE = -5.0, 12.0
"""Angles of attack that a table has to cover, deg; Viterna's extension begins at its ends."""

LARGEST = {"lift": 6.0, "drag": 5.0, "moment": 5.0}
"""Coefficients beyond these, either way, are no section's; most likely another unit."""

REYNOLDS_RANGE = 1e3, 1e9

_CIRCLE_EDGE = 1e-3  # deg: 3.1416 rad is meant to be 180 deg
_ENDS_EQUAL = 1e-6
_QUANTITIES = "alpha", "lift", "drag", "moment"


@dataclass(frozen=True, eq=False)
class PolarTable:
    """Lift and drag of a section at one Reynolds number, as a file has them."""

    reynolds: float | None
    """Reynolds number by the chord; None where the file states none."""
    alpha: np.ndarray
    """Angle of attack, rad, strictly increasing, shape (n_rows,)."""
    lift: np.ndarray
    drag: np.ndarray
    moment: np.ndarray | None
    full_circle: bool
    """Whether the table runs from -pi to pi, with equal coefficients at both ends."""
    source: str = ""
    """Where the table comes from, for messages."""


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

    Columns alpha, lift, drag and moment[n_rows] are as the file has them: angles in degrees, or in
    radians where the first of `columns`, the file's names for them, ends in ``_rad``. `lines` are
    the numbers of the rows' lines (rows are counted without), and `where` tells this polar from
    others in the file. Raises InputError if there are fewer than 8 rows (two suffice where all are
    equal, as a cylinder's), angles do not increase strictly or cover neither -5 to 12 degrees
    within ±90 nor the full circle, the ends of a full circle differ, drag is not positive, or a
    number is not finite or beyond what sections have.
    """
    values = {
        name: np.asarray(column, dtype=float)
        for name, column in zip(_QUANTITIES, (alpha, lift, drag, moment), strict=True)
        if column is not None
    }
    raw = _Raw(values, dict(zip(_QUANTITIES, columns, strict=False)), lines, file, where)
    for name, column in values.items():
        wrong = np.flatnonzero(~np.isfinite(column))
        if wrong.size:
            raise raw.refuse("must be a finite number", "correct the row", name, int(wrong[0]))
    radians, circle = _angles(raw, in_degrees=not columns[0].endswith("_rad"))
    _check_coefficients(raw, circle)
    return PolarTable(
        None if reynolds is None else float(reynolds),
        radians,
        values["lift"],
        values["drag"],
        values.get("moment"),
        circle,
        f"{file}, {where}" if where else str(file),
    )


@dataclass(frozen=True)
class _Raw:
    """The columns of a polar as they are in a file, and how a message names a value of them."""

    values: dict[str, np.ndarray]
    names: dict[str, str]
    lines: Sequence[int] | None
    file: object
    where: str

    def refuse(self, problem: str, remedy: str, quantity: str = "", row: int = 0) -> InputError:
        """Return the error in a row of a quantity; of the whole table where none is named."""
        angle = self.values["alpha"]
        if quantity:
            place = f"row {row + 1}" if self.lines is None else f"line {self.lines[row]}"
            key = f"{place}, column {self.names[quantity]}"
            value: object = float(self.values[quantity][row])
        else:
            key = self.names["alpha"]
            value = f"{angle[0]:g} … {angle[-1]:g}" if angle.size else "nothing"
        key = f"{self.where}, {key}" if self.where else key
        return InputError(problem, remedy, file=self.file, key=key, value=value)


def _angles(raw: _Raw, in_degrees: bool) -> tuple[np.ndarray, bool]:
    """Return the angles in radians, and whether they run round the full circle."""
    given = raw.values["alpha"]
    angle = given if in_degrees else np.rad2deg(given)
    if given.size and np.max(np.abs(angle)) > 180.0 + _CIRCLE_EDGE:
        unit = "" if in_degrees else "; if these are degrees, name the column alpha_deg"
        raise raw.refuse(
            "lies beyond the full circle",
            f"angles of attack run from -180 to 180 degrees{unit}",
            "alpha",
            int(np.argmax(np.abs(angle))),
        )
    circle = bool(
        given.size > 1 and angle[0] <= -180 + _CIRCLE_EDGE and angle[-1] >= 180 - _CIRCLE_EDGE
    )
    radians = np.deg2rad(given) if in_degrees else given.copy()
    if circle:
        radians[0], radians[-1] = -np.pi, np.pi
    falls = np.flatnonzero(np.diff(radians) <= 0.0)
    if falls.size:
        row = int(falls[0]) + 1
        problem = f"follows {given[row - 1]:g}: angles must increase strictly"
        raise raw.refuse(problem, "sort the rows and remove duplicates", "alpha", row)
    even = given.size and all(np.ptp(raw.values[name]) == 0.0 for name in ("lift", "drag"))
    if given.size < FEWEST_ROWS and not (circle and even):
        raise raw.refuse(
            f"the polar has {given.size} rows, at least {FEWEST_ROWS} angles of attack are needed",
            "give a finer table",
        )
    low, high = NEEDED_RANGE
    if not circle and (angle[0] > low or angle[-1] < high or angle[0] < -90 or angle[-1] > 90):
        remedy = "extend or cut it (beyond the table the polar is extended by Viterna)"
        if in_degrees and np.max(np.abs(angle)) <= np.pi:
            remedy = f"if these are radians, convert them or name the column alpha_rad; {remedy}"
        raise raw.refuse(
            f"the table must reach from {low:g} or less to {high:g} or more and stay within -90 and"
            " 90 degrees, or run from -180 to 180",
            remedy,
        )
    return radians, circle


def _check_coefficients(raw: _Raw, circle: bool) -> None:
    """Refuse a circle that does not close, drag that is not positive, and absurd coefficients."""
    coefficients = {name: column for name, column in raw.values.items() if name != "alpha"}
    for name, column in coefficients.items():
        if circle and abs(column[-1] - column[0]) > _ENDS_EQUAL:
            raise raw.refuse(
                f"differs from {column[0]:g} at -180 degrees",
                "-180 and 180 degrees are one angle: give both rows the same coefficients",
                name,
                column.size - 1,
            )
    least = int(np.argmin(coefficients["drag"]))
    if coefficients["drag"][least] <= 0.0:
        raise raw.refuse("drag must be positive", "correct the row", "drag", least)
    for name, column in coefficients.items():
        row = int(np.argmax(np.abs(column)))
        if abs(column[row]) > LARGEST[name]:
            raise raw.refuse(
                f"is beyond {LARGEST[name]:g}, which no section has",
                "give the coefficient as a plain number, not in counts or percent",
                name,
                row,
            )


def check_reynolds(
    number: float | None, cell: str, file: object, key: str, unit: float = 1.0
) -> float:
    """Return a Reynolds number that is within the range of sections; `unit` is 1 or a million."""
    low, high = REYNOLDS_RANGE
    if number is None or not low <= number <= high:
        scale = "in millions, such as 0.2" if unit != 1.0 else "as a plain number, such as 2e5"
        raise InputError(
            f"is no Reynolds number between {low / unit:g} and {high / unit:g}",
            f"give it {scale}",
            file=file,
            key=key,
            value=cell,
        )
    return number
