"""Outline files: CSV, Selig, Lednicer and AeroDyn coordinates of a section, over its chord."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hkt_mdo.files.shipped import locate
from hkt_mdo.files.table import (
    Column,
    Csv,
    line_error,
    number_columns,
    numbered_lines,
    parse_number,
    read_text,
)

FEWEST_POINTS, MOST_POINTS = 10, 5000
"""Fewer points show no section; testing more for crossings takes too long."""

EDGE = 0.02
"""How far the leading edge may lie from x = 0 and the trailing edge from x = 1, over the chord."""

AREA_RANGE = 0.005, 0.8
"""Area of a section, over the chord squared; a circle has 0.785."""

FARTHEST = 0.6
"""Largest distance of a point from the chord line, over the chord; a circle has 0.5."""

_ORDER = "give the points from the trailing edge over the upper side to the leading edge and back"
_CHORD_AXES = "give coordinates over the chord: leading edge at (0, 0), trailing edge at (1, 0)"
_FORMATS = "a CSV file x_over_c,y_over_c, or coordinates in Selig's or Lednicer's order"
_NUM_COORDS = re.compile(r"(\d+)\s+NumCoords\b", re.IGNORECASE)
_COORDINATES = re.compile(
    r"""^[ \t]*(@?"[^"\n]*"|@?'[^'\n]*'|\S+)[ \t]+NumCoords\b""", re.MULTILINE | re.IGNORECASE
)
_TEXT = re.compile(r"(?!.*\b(nan|inf))(.*[^\W\d_]{3}|\D*[^\W\d_]\D*$)")

_ROUNDING = 1e-12
"""Twice the area of a triangle, over the chord squared, below which its corners are on a line."""


def read_outline(source: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Read the outline of a section.

    The content decides the format: a CSV file with the columns ``x_over_c`` and ``y_over_c``, or
    pairs of numbers, with or without lines of text above them, in Selig's order (from the trailing
    edge round to it) or Lednicer's (number of points of either side, then the upper and the lower
    side from the leading edge); both are those of https://m-selig.ae.illinois.edu/ads.html. Text
    after the last point is ignored. A coordinate file of OpenFAST's AeroDyn begins with
    ``NumCoords`` and the point of reference; an airfoil table of AeroDyn may name or hold one.

    Parameters
    ----------
    source : str or pathlib.Path
        Name of a shipped outline, or a path, also of an AeroDyn airfoil table.

    Returns
    -------
    x, y : numpy.ndarray, shape (n_points,)
        Coordinates over the chord, from the trailing edge over the upper side round to it.

    Raises
    ------
    InputError
        If there is no such file, it is broken, or its points are no closed section; with file,
        line, value and remedy.
    """  # noqa: DOC501 - `line_error` returns an InputError
    path = locate(source, "outline")
    path = coordinates_of(path) or path
    text = read_text(path, "file with an outline")
    lines = [
        (number, line.strip())
        for number, line in numbered_lines(text)
        if line.strip() and line.lstrip()[0] not in "#!%"
    ]
    if not lines:
        raise line_error(path, 1, "is empty", f"give {_FORMATS}")
    begin = next((at for at, line in enumerate(lines) if _NUM_COORDS.match(line[1])), None)
    if re.search(r"[xy]_over_c", lines[0][1]):
        names = "x_over_c", "y_over_c"
        points = Csv(text, path, ",".join(names), names).columns(names, "outline")
    elif begin is None:
        points = _read_pairs(lines, path)
    else:
        points = _read_aerodyn(lines[begin:], path)
    return checked_outline(*points.values())


def coordinates_of(airfoil: Path) -> Path | None:
    """Return the file that holds the coordinates of a section, as an airfoil file says.

    Parameters
    ----------
    airfoil : pathlib.Path
        An airfoil file of AeroDyn, or any other file.

    Returns
    -------
    pathlib.Path or None
        The file that the airfoil file names at ``NumCoords``, from its own folder; itself if it
        holds them; None if it has neither.

    Raises
    ------
    InputError
        If the file cannot be read, or the one that it names does not exist.
    """  # noqa: DOC501 - `line_error` returns an InputError
    text = read_text(airfoil, "file with an outline")
    match = _COORDINATES.search(text)
    if not match:
        return None
    if not match[1].startswith("@"):
        return airfoil if (parse_number(match[1]) or 0.0) >= FEWEST_POINTS else None
    named = airfoil.parent / match[1].removeprefix("@").strip("\"'").replace("\\", "/")
    if not named.is_file():
        line = len(numbered_lines(text[: match.end()]))
        remedy = "put the file there, or give another outline"
        raise line_error(airfoil, line, "does not exist", remedy, "NumCoords", value=str(named))
    return named


def _read_pairs(lines: list[tuple[int, str]], path: Path) -> dict[str, Column]:
    """Return x and y of pairs of numbers in Selig's or Lednicer's order."""
    rows = [(number, re.split(r"[\s,;]+", line)) for number, line in lines]
    points = [at for at, (_, cells) in enumerate(rows) if _count(cells) == 2]
    if not points:
        raise line_error(path, lines[0][0], "has no coordinates", f"give {_FORMATS}")
    first, last = points[0], points[-1]
    beside = [*range(1, first), *range(last + 1, len(rows))[:1]]  # line 0 may be any name
    # text above the points may also be the four ends of the grid of MSES
    broken = [rows[at] for at in beside if not _TEXT.match(lines[at][1])]
    broken = [row for row in broken if _count(row[1]) != 4]
    lines, rows = lines[first : last + 1], rows[first : last + 1]
    # a line beside the points that is no text is refused as a broken point
    columns = number_columns(broken + rows, ("x", "y"), path, ("x", "y"), remedy=f"give {_FORMATS}")
    x, y = (column.values for column in columns.values())
    if not (min(x[0], y[0]) >= 2.0 and x[0] == int(x[0]) and y[0] == int(y[0])):
        return columns
    n_upper, n_lower = int(x[0]), int(y[0])
    if n_upper + n_lower != x.size - 1:
        problem = f"{x.size - 1} points follow, not {n_upper} + {n_lower}"
        remedy = "count the points of either side, or give coordinates over the chord"
        raise line_error(path, lines[0][0], problem, remedy, value=lines[0][1])
    upper, lower = np.arange(1, n_upper + 1), np.arange(n_upper + 1, x.size)
    for side, name in ((upper, "upper"), (lower, "lower")):
        behind = (x > x[side[-1]]) & (np.arange(x.size) == side[0])
        problem = f"the {name} side begins nearer to the trailing edge than it ends"
        remedy = "in Lednicer's order both sides run from the leading to the trailing edge"
        columns["x"].refuse(behind, problem, remedy)
    shared = x[upper[0]] == x[lower[0]] and y[upper[0]] == y[lower[0]]
    order = np.concatenate((upper[::-1], lower[1:] if shared else lower))
    return {name: column.at(order) for name, column in columns.items()}


def _count(cells: Sequence[str]) -> int:
    """Return how many numbers a row is; 0 of one that has anything else."""
    return 0 if None in map(parse_number, cells) else len(cells)


def _read_aerodyn(lines: list[tuple[int, str]], path: Path) -> dict[str, Column]:
    """Return x and y of AeroDyn: below their number and the reference, from either edge."""
    (line, first), *lines = lines
    count = int(_NUM_COORDS.match(first)[1])  # type: ignore[index]
    rows = [(number, re.split(r"[\s,]+", text.partition("!")[0].strip())) for number, text in lines]
    rows = rows[:count]
    good = next((at for at, (_, row) in enumerate(rows) if _count(row) != 2), len(rows))
    if good < count or count < FEWEST_POINTS:
        problem = f"is followed by {good} pairs of numbers"
        remedy = f"NumCoords counts the reference and the points, {FEWEST_POINTS} at least"
        raise line_error(path, line, problem, remedy, "NumCoords", value=count)
    columns = number_columns(rows[1:], ("x", "y"), path, ("x", "y"))
    x, y = (column.values for column in columns.values())
    if max(abs(x[0]), abs(x[-1])) > EDGE:
        return columns
    # from the leading edge round to it: over the same side back from the trailing edge
    order = np.arange(x.size - 1 if x[0] == x[-1] and y[0] == y[-1] else x.size)
    order = np.roll(order[::-1], int(np.argmax(x)) + 1)
    return {name: column.at(order) for name, column in columns.items()}


def checked_outline(along: Column, across: Column) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of an outline; refuse those that are no closed section.

    Parameters
    ----------
    along, across : Column
        Coordinates over the chord, from the trailing edge over the upper side round to it.

    Returns
    -------
    x, y : numpy.ndarray, shape (n_points,)
        The same.

    Raises
    ------
    InputError
        With the first point that is wrong, and a remedy.
    """
    x, y, places = along.values, across.values, np.arange(along.values.size)

    def refuse(wrong: bool, problem: str, remedy: str, point: int) -> None:
        along.refuse(wrong & (places == places[point]), problem, remedy)

    size = f"the outline has {x.size} points, not {FEWEST_POINTS} to {MOST_POINTS}"
    refuse(not FEWEST_POINTS <= x.size <= MOST_POINTS, size, "give some hundred points", -1)
    nose, tail, far = int(np.argmin(x)), int(np.argmax(x)), int(np.argmax(np.abs(y)))
    for edge, end, what in ((0, nose, "smallest"), (1, tail, "largest")):
        off = abs(x[end] - edge) > EDGE
        refuse(off, f"the {what} x is {x[end]:g} instead of {edge}", _CHORD_AXES, end)
    beside = f"lies more than {FARTHEST:g} of the chord away from it"
    refuse(abs(y[far]) > FARTHEST, beside, _CHORD_AXES, far)
    for point, name in ((0, "first"), (-1, "last")):
        inside = x[point] < 1.0 - 2.0 * EDGE
        refuse(inside, f"the {name} point is not at the trailing edge", _ORDER, point)
    back = not 2 < nose < x.size - 3
    refuse(back, "the outline does not go round the leading edge", _ORDER, nose)
    for side, other in _first_crossing(x, y):
        refuse(True, f"the outline crosses itself: here and at {along.keys[other]}", _ORDER, side)
    area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    outside = not AREA_RANGE[0] <= area <= AREA_RANGE[1]
    encloses = f"the outline from here encloses {area:.4g} chord²"
    refuse(outside, f"{encloses}, which is not the area of a section", _ORDER, 0)
    return x, y


def _first_crossing(x: np.ndarray, y: np.ndarray) -> list[tuple[int, int]]:
    """Return the first two sides (by their first points) that cross within both, if any."""
    dx, dy = np.diff(x, append=x[0]), np.diff(y, append=y[0])

    def turn(i, k):  # of point k from side i: positive on its left, 0 within rounding
        area = dx[i] * (y[k] - y[i]) - dy[i] * (x[k] - x[i])
        return np.where(np.abs(area) > _ROUNDING, area, 0.0)

    for side in range(x.size - 2):
        others = np.arange(side + 2, x.size - (side == 0))
        apart = turn(side, others) * turn(side, (others + 1) % x.size)
        side_apart = turn(others, side) * turn(others, side + 1)
        crossed = np.flatnonzero((apart < 0.0) & (side_apart < 0.0))
        if crossed.size:
            return [(side, int(others[crossed[0]]))]
    return []
