"""The airfoils of a windIO turbine file: thickness, outline and polars."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hkt_mdo.files.blade_table import SectionTable
from hkt_mdo.files.polar_table import PolarTable, polar_table
from hkt_mdo.files.table import Column
from hkt_mdo.files.yaml_text import Place

__all__ = ["VERSIONS", "Version", "read_airfoils"]

# Files round: a full circle of angles to ±3.14 rad, and the coefficients at its two ends.
_CIRCLE_ROUNDED = math.radians(0.1)
_ENDS_ROUNDED = 0.01
THICK_ROUNDED = 1e-6


@dataclass(frozen=True)
class Version:
    """What the versions of windIO write differently."""

    number: int
    shape: str
    half_turn: float
    unit: str
    thickness: str
    coefficients: tuple[str, str, str]

    @property
    def angles(self) -> str:
        """The unit of angles, for messages."""
        return f"windIO {self.number} counts angles in {self.unit}"


VERSIONS = (
    Version(1, "outer_shape_bem", np.pi, "radians", "relative_thickness", ("c_l", "c_d", "c_m")),
    Version(2, "outer_shape", 180.0, "degrees", "rthick", ("cl", "cd", "cm")),
)


def curve(place: Place) -> tuple[Column, Column]:
    """Return the grid, which increases strictly, and the values of a quantity."""
    grid, values = place.get("grid").numbers(), place.get("values").numbers()
    _same_length(grid, values, place)
    grid.check_rising("grids")
    return grid, values


def _same_length(one: Column, other: Column, place: Place) -> None:
    if one.values.size != other.values.size:
        raise place.refuse(
            f"has {one.values.size} numbers in {one.name.rpartition('.')[2]} and "
            f"{other.values.size} in {other.name.rpartition('.')[2]}",
            "give as many values as grid points",
        )


def read_airfoils(
    root: Place,
    used: list[tuple[Place, str, str | None]],
    version: Version,
    messages: list[str],
) -> tuple[SectionTable, ...]:
    """Return the airfoils that a blade uses: (place, name, configuration of the polars) each."""
    library: dict[str, Place] = {}
    for entry in root.get("airfoils", "add the airfoils that the blade names").items():
        name = entry.get("name").text()
        if name in library:
            raise entry.refuse(f"is the second airfoil {name}", "give each its own name")
        library[name] = entry
    chosen: dict[str, str | None] = {}
    for place, name, configuration in used:
        if name not in library:
            raise place.refuse(
                f"names the airfoil {name}, which airfoils does not hold",
                f"add it there; known: {', '.join(list(library)[:8])}",
            )
        if chosen.setdefault(name, configuration) != configuration:
            problem = f"uses {name} in configurations {chosen[name]} and {configuration}"
            raise place.refuse(problem, "copy the airfoil under a second name")
    return tuple(
        _section(library[name], name, configuration, version, messages)
        for name, configuration in chosen.items()
    )


def _section(
    airfoil: Place, name: str, configuration: str | None, version: Version, messages: list[str]
) -> SectionTable:
    """Return one airfoil with the polars of its configuration."""
    thick = airfoil.find(version.thickness)
    thickness = None
    if thick is not None:
        thickness = min(thick.number(0.0, 1.0 + THICK_ROUNDED, "it is over the chord"), 1.0)
    coordinates, outline = airfoil.find("coordinates"), ()
    if coordinates is not None:
        x, y = coordinates.get("x").numbers(), coordinates.get("y").numbers()
        _same_length(x, y, coordinates)
        outline = x.values, y.values
    polars: dict[float | None, PolarTable] = {}
    for one in _polar_places(airfoil, name, configuration, version, messages):
        table = _polar(one, version, name, messages)
        if table.reynolds in polars:
            raise one.refuse(
                f"is the second polar of {name} at one Reynolds number",
                "keep one of them, or tag them with different configurations",
            )
        polars[table.reynolds] = table
    ordered = sorted(polars.values(), key=lambda table: table.reynolds or 0.0)
    return SectionTable(name, thickness, tuple(ordered), *outline)


def _polar_places(
    airfoil: Place, name: str, configuration: str | None, version: Version, messages: list[str]
) -> list[Place]:
    """Return the places of an airfoil's polars of one configuration, the first if none is given."""
    polars = airfoil.get("polars", "add the airfoil's lift and drag")
    tagged: dict[str | None, list[Place]] = {}
    for entry in polars.items():
        tag = entry.find("configuration")
        tagged.setdefault(None if tag is None else tag.text(), []).append(entry)
    if configuration is None:
        configuration = next(iter(tagged))
        if len(tagged) > 1:
            messages.append(
                f"{name}: polars of configuration {configuration}, the first, are taken"
            )
    if configuration not in tagged:
        known = f"known: {', '.join(map(str, tagged))}"
        raise polars.refuse(f"has no polars of configuration {configuration}", known)
    chosen = tagged[configuration]
    if version.number == 1:
        return chosen
    return [one for entry in chosen for one in entry.get("re_sets").items()]


def _polar(place: Place, version: Version, section: str, messages: list[str]) -> PolarTable:
    """Return one polar, its coefficients on one grid of angles of attack."""
    limit = version.half_turn
    curves: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for name in version.coefficients:
        one = place.find(name) if name == version.coefficients[2] else place.get(name)
        if one is None:
            continue
        grid, column = curve(one)
        beyond = np.abs(grid.values) > limit * 1.001
        grid.refuse(beyond, "lies beyond the full circle", version.angles)
        if version.number == 2 and np.max(np.abs(grid.values)) < 3.2:
            raise one.get("grid").refuse(
                f"has angles of attack from {grid.values[0]:g} to {grid.values[-1]:g} degrees",
                "windIO 2 counts them in degrees: convert them if they are radians",
            )
        curves[name] = np.clip(grid.values, -limit, limit), column.values
    alpha, values = _joined(place, curves, section, messages)
    alpha, values = _closed(alpha, values, limit, section, messages)
    reynolds = place.find("re")
    if reynolds is not None:
        number = reynolds.number(0.0, 1e12, "give the Reynolds number as a plain number")
    return polar_table(
        alpha,
        *(values.get(name) for name in version.coefficients),
        None if reynolds is None else number,
        file=place.file,
        columns=(
            f"{version.coefficients[0]}.grid{', alpha_rad' * (version.number == 1)}",
            *(f"{name}.values" for name in values),
        ),
        where=place.shown,
    )


def _joined(
    place: Place,
    curves: dict[str, tuple[np.ndarray, np.ndarray]],
    section: str,
    messages: list[str],
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the coefficients on one grid of angles, linear in between where they have several."""
    grids = [grid for grid, _ in curves.values()]
    alpha = grids[0]
    if all(np.array_equal(alpha, other) for other in grids):
        return alpha, {name: column for name, (_, column) in curves.items()}
    low, high = max(grid[0] for grid in grids), min(grid[-1] for grid in grids)
    alpha = np.unique(np.concatenate(grids))
    alpha = alpha[(alpha >= low) & (alpha <= high)]
    if alpha.size < 2:
        problem = "has lift and drag at angles that do not overlap"
        raise place.refuse(problem, "give both over one grid")
    messages.append(f"{section}: coefficients on different grids of angles are joined linearly")
    return alpha, {name: np.interp(alpha, *points) for name, points in curves.items()}


def _closed(
    alpha: np.ndarray,
    values: dict[str, np.ndarray],
    limit: float,
    section: str,
    messages: list[str],
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Close a full circle whose angles, or whose coefficients at both ends, are rounded."""
    short = limit - np.abs(alpha[[0, -1]])
    if np.any(short >= limit / np.pi * _CIRCLE_ROUNDED):
        return alpha, values
    if np.any(short > 0.0):
        alpha = np.concatenate(([-limit], alpha[1:-1], [limit]))
        messages.append("polars: angles of attack of ±3.14 rad are taken as half a turn")
    values = dict(values)
    for name, numbers in values.items():
        first, last = numbers[0], numbers[-1]
        if 1e-6 < abs(last - first) < _ENDS_ROUNDED:
            mean = 0.5 * (first + last)
            values[name] = np.concatenate(([mean], numbers[1:-1], [mean]))
            messages.append(
                f"{section}: {name} = {first:.4g} and {last:.4g} at ±180 degrees, which are one "
                "angle: their mean is taken"
            )
    return alpha, values
