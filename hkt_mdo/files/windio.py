"""The blade of a windIO turbine file (YAML), versions 1 and 2.

Version 1 keeps the blade's shape in ``components.blade.outer_shape_bem`` and counts angles in
radians; version 2 keeps it in ``components.blade.outer_shape`` and counts them in degrees.
Source: windIO, IEA Wind Task 37, turbine schema, https://windio.readthedocs.io.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.blade_table import EDGE, MOST_ROWS, BladeTable, SectionTable, check_rows
from hkt_mdo.files.polar_table import PolarTable, polar_table
from hkt_mdo.files.table import Column, fortran_number
from hkt_mdo.files.yaml_text import Node, compose

__all__ = ["read_windio"]

DIAMETER_OFF = 0.02
"""How far the file's rotor diameter may be from that of its hub and blade, relatively."""

# What files round: a circle of angles to ±3.14 rad, and a section's coefficients at its ends.
_CIRCLE_ROUNDED = math.radians(0.1)
_ENDS_ROUNDED = 0.01
_THICK_ROUNDED = 1e-6


@dataclass(frozen=True)
class _Place:
    """A value in the file with its dotted key."""

    node: Node
    key: str
    file: Path

    def refuse(self, problem: str, remedy: str, key: str = "", shown: bool = True) -> InputError:
        place = f"{key or self.key} (line {self.node.line})"
        value = {"value": self.node.value} if shown and isinstance(self.node.value, str) else {}
        return InputError(problem, remedy, file=self.file, key=place, **value)

    def find(self, name: str) -> _Place | None:
        """Return a member; None where there is none or it is empty."""
        self._expect(dict, "a mapping")
        node = self.node.value.get(name)
        if node is None or (isinstance(node.value, str) and node.word == "null"):
            return None
        return _Place(node, f"{self.key}.{name}" if self.key else name, self.file)

    def get(self, path: str, remedy: str = "") -> _Place:
        """Return what a dotted key below this place names; it must be there."""
        here = self
        for name in path.split("."):
            found = here.find(name)
            if found is None:
                full = f"{here.key}.{name}" if here.key else name
                raise here.refuse("is missing", remedy or "add it", key=full, shown=False)
            here = found
        return here

    def items(self) -> list[_Place]:
        """Return the members of a list."""
        self._expect(list, "a list")
        return [
            _Place(node, f"{self.key}[{index}]", self.file)
            for index, node in enumerate(self.node.value)
        ]

    def text(self) -> str:
        self._expect(str, "a word")
        return self.node.value.strip()

    @property
    def place(self) -> str:
        """What a message calls the place."""
        return f"{self.key} (line {self.node.line})"

    def finite(self) -> float:
        """Return a finite number."""
        self._expect(str, "a number")
        number = None if self.node.quoted else fortran_number(self.node.value)
        if number is None:
            raise self.refuse("must be a finite number", "write it plainly, without a unit")
        return number

    def number(self, low: float, high: float, remedy: str) -> float:
        """Return a number within (low, high]."""
        number = self.finite()
        if not low < number <= high:
            raise self.refuse(f"must be above {low:g} and at most {high:g}", remedy)
        return number

    def numbers(self) -> Column:
        """Return a list of at least one number."""
        items = self.items()
        if not items:
            raise self.refuse("is empty", "give its numbers")
        if len(items) > MOST_ROWS:
            raise self.refuse(f"has more than {MOST_ROWS} numbers", "give fewer")
        return _column(self.key, items)

    def _expect(self, kind: type, what: str) -> None:
        if not isinstance(self.node.value, kind):
            raise self.refuse(f"must be {what}", "see the windIO turbine schema")


def _column(name: str, places: list[_Place]) -> Column:
    return Column(
        name,
        np.array([place.finite() for place in places]),
        [place.place for place in places],
        [place.node.value for place in places],
        places[0].file,
    )


def _same_length(one: Column, other: Column, place: _Place) -> None:
    if one.values.size != other.values.size:
        raise place.refuse(
            f"has {one.values.size} numbers in {one.name.rpartition('.')[2]} and "
            f"{other.values.size} in {other.name.rpartition('.')[2]}",
            "give as many values as grid points",
        )


def _rising(grid: Column) -> None:
    grid.refuse(
        np.diff(grid.values, prepend=-np.inf) <= 0.0,
        "does not exceed the value before: a grid must increase strictly",
        "sort it and remove duplicates",
    )


def _spanwise(place: _Place) -> tuple[np.ndarray, Column]:
    """Return grid and values of a quantity along the whole span."""
    grid, values = place.get("grid").numbers(), place.get("values").numbers()
    _same_length(grid, values, place)
    _rising(grid)
    if abs(grid.values[0]) > EDGE or abs(grid.values[-1] - 1.0) > EDGE:
        raise place.refuse(
            f"has a grid from {grid.values[0]:g} to {grid.values[-1]:g}",
            "a grid runs from 0 at the root to 1 at the tip",
            key=f"{place.key}.grid",
        )
    return grid.values, values


def read_windio(text: str, file: Path) -> BladeTable:
    """Read the blade of a windIO turbine file.

    Rows are the grid of the chord together with that of the twist; what is given on another grid is
    interpolated linearly. A row's radius is the hub radius plus z of the reference axis.

    The table has the `sections` that its blade uses and `section_position`, where they stand.
    Raises InputError if something is missing or broken; the message names the dotted key and the
    line.
    """
    tree = compose(text, file)
    if tree is None or not isinstance(tree.value, dict):
        raise InputError(
            "is no windIO turbine",
            "it has the keys assembly, components and airfoils",
            file=file,
            key="line 1",
        )
    root = _Place(tree, "", file)
    messages: list[str] = []
    blade = root.get("components.blade", "give a turbine with a blade")
    shape, first_version = _shape(blade)
    diameter = root.get("components").get("hub.diameter", "add the hub's diameter in metres")
    hub = 0.5 * diameter.number(0.0, 100.0, "give the hub's diameter in metres")
    s_axis, height = _height(shape.find("reference_axis") or blade.get("reference_axis"), messages)

    s_chord, chord = _spanwise(shape.get("chord"))
    s_twist, twist = _spanwise(shape.get("twist"))
    unit = "windIO 1 counts it in radians" if first_version else "windIO 2 counts it in degrees"
    if not first_version:
        twist = replace(twist, values=np.deg2rad(twist.values))
        messages.append("windIO 2: degrees converted to radians")
    twist.refuse(np.abs(twist.values) > np.pi * (1.0 + EDGE), "is beyond 180 degrees", unit)
    s = _union(s_chord, s_twist)
    if s_chord.size != s_twist.size or np.any(s_chord != s_twist):
        messages.append("chord and twist have different grids: rows are both, linear in between")
    r = hub + np.interp(s, s_axis, height)
    places = [f"components.blade, row at s = {share:.6g}" for share in s]
    check_rows(Column("r", r, places, r.tolist(), file), chord, twist, None, float(r[-1]))

    names, stands, sections = _sections(root, shape, first_version, messages)
    cone = root.get("components.hub").find("cone_angle")
    angle = None
    if cone is not None:
        turn = np.pi if first_version else 180.0
        angle = cone.number(-0.5 * turn, 0.5 * turn, unit) / turn * np.pi
    _check_diameter(root, float(r[-1]), angle or 0.0, messages)
    return BladeTable(
        r,
        np.interp(s, s_chord, chord.values),
        np.interp(s, s_twist, twist.values),
        thickness=_thickness(shape, s, names, stands, sections),
        sections=sections,
        section_position=tuple(
            (name, float(hub + z))
            for name, z in zip(names, np.interp(stands, s_axis, height), strict=True)
        ),
        tip_radius=float(r[-1]),
        hub_radius=hub,
        blade_count=_blade_count(root),
        cone=angle,
        messages=tuple(dict.fromkeys(messages)),
        file=str(file),
    )


def _shape(blade: _Place) -> tuple[_Place, bool]:
    """Return the blade's outer shape, and whether it is that of windIO 1."""
    old, new = blade.find("outer_shape_bem"), blade.find("outer_shape")
    if old and new:
        raise blade.refuse(
            "holds outer_shape and outer_shape_bem", "keep that of the file's windIO version"
        )
    shape = old or new
    if shape is None:
        raise blade.refuse(
            "is missing",
            "add outer_shape (windIO 2) or outer_shape_bem (windIO 1)",
            key=f"{blade.key}.outer_shape",
            shown=False,
        )
    return shape, new is None


def _height(axis: _Place, messages: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the grid of a blade's axis and z over it, which begins at 0 and rises."""
    grid, z = _spanwise(axis.get("z"))
    aside = np.zeros(z.values.size, dtype=bool)
    aside[0] = abs(z.values[0]) > EDGE * abs(z.values[-1])
    z.refuse(aside, "is not 0 at the blade's root", "count z from the root")
    height = np.concatenate(([0.0], z.values[1:]))
    z.refuse(
        np.diff(height, prepend=-np.inf) <= 0.0,
        "does not exceed the value before: the blade must run outwards",
        "sort z from root to tip, in metres",
    )
    for name, what in (("x", "prebend"), ("y", "sweep")):
        side = axis.find(name)
        largest = 0.0 if side is None else np.max(np.abs(_spanwise(side)[1].values))
        if largest > 0.0:
            messages.append(
                f"{axis.key}.{name}: {what} of up to {largest:g} m is ignored: straight blade"
            )
    return grid, height


def _thickness(
    shape: _Place,
    s: np.ndarray,
    names: list[str],
    stands: np.ndarray,
    sections: tuple[SectionTable, ...],
) -> np.ndarray | None:
    """Return the thickness of rows: the blade's own, or linear between its sections."""
    own = shape.find("rthick")
    if own is None:
        known = {section.name: section.thickness for section in sections}
        between = [known[name] for name in names]
        if None in between:
            return None
        return np.interp(s, stands, np.array(between, dtype=float))
    grid, column = _spanwise(own)
    column.refuse(
        (column.values <= 0.0) | (column.values > 1.0 + _THICK_ROUNDED),
        "is no thickness over chord",
        "rthick lies within 0 (a plate) and 1 (a cylinder)",
    )
    return np.minimum(np.interp(s, grid, column.values), 1.0)


def _union(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the points of two grids; those closer than a billionth are one."""
    points = np.union1d(one, other)
    return points[np.diff(points, prepend=-1.0) > EDGE]


def _blade_count(root: _Place) -> int | None:
    assembly = root.find("assembly")
    count = assembly and assembly.find("number_of_blades")
    if count is None:
        return None
    number = count.number(0.0, 100.0, "give the number of blades")
    if number != math.floor(number):
        raise count.refuse("is no whole number", "give the number of blades")
    return int(number)


def _check_diameter(root: _Place, tip: float, cone: float, messages: list[str]) -> None:
    """Hold the file's rotor diameter, 2 (hub radius + z of the tip) cos(cone), to its blade."""
    assembly = root.find("assembly")
    diameter = assembly and assembly.find("rotor_diameter")
    if diameter is None:
        return
    number = diameter.number(-EDGE, 1000.0, "give the rotor's diameter in metres")
    if number <= 0.0:  # windIO's default: not given
        return
    own = 2.0 * tip * math.cos(cone)
    off = abs(number / own - 1.0)
    if off > DIAMETER_OFF:
        raise diameter.refuse(
            f"does not fit hub and blade, which give {own:.6g} m",
            "no blade is scaled to it: correct components.hub.diameter, the reference axis or it",
        )
    if off > 1e-6:
        messages.append(
            f"assembly.rotor_diameter = {number:.8g} m, but hub and blade give {own:.8g} m, which "
            "is taken"
        )


def _sections(
    root: _Place, shape: _Place, first_version: bool, messages: list[str]
) -> tuple[list[str], np.ndarray, tuple[SectionTable, ...]]:
    """Return the names of the sections along the span, where they stand, and the sections."""
    if first_version:
        where = shape.get("airfoil_position")
        grid, labels = where.get("grid").numbers(), where.get("labels").items()
        if grid.values.size != len(labels):
            raise where.refuse(
                f"has {grid.values.size} grid points and {len(labels)} labels",
                "give as many labels as grid points",
            )
        used: list[tuple[_Place, str, str | None]] = [
            (label, label.text(), None) for label in labels
        ]
    else:
        entries = shape.get("airfoils").items()
        if not entries:
            raise shape.refuse("is empty", "list the airfoils", key=f"{shape.key}.airfoils")
        keyed = [entry.get("spanwise_position") for entry in entries]
        grid = _column("spanwise_position", keyed)
        used = [(entry, entry.get("name").text(), _configuration(entry)) for entry in entries]
    grid.refuse(
        (grid.values < -EDGE) | (grid.values > 1.0 + EDGE),
        "is no position along the span",
        "it lies within 0 (root) and 1 (tip)",
    )
    _rising(grid)

    library: dict[str, _Place] = {}
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
                shown=False,
            )
        if chosen.setdefault(name, configuration) != configuration:
            raise place.refuse(
                f"uses {name} in configurations {chosen[name]} and {configuration}",
                "copy the airfoil under a second name",
                shown=False,
            )
    sections = tuple(
        _section(library[name], name, configuration, first_version, messages)
        for name, configuration in chosen.items()
    )
    return [name for _, name, _ in used], grid.values, sections


def _configuration(entry: _Place) -> str | None:
    """Return the one configuration of polars that a blade's airfoil uses (windIO 2)."""
    tags = entry.find("configuration")
    if tags is None:
        return None
    names = [tag.text() for tag in tags.items()]
    weights = entry.find("weight")
    if weights is None:
        shares = np.ones(len(names))
    else:
        column = weights.numbers()
        shares = column.values
        if shares.size != len(names):
            raise weights.refuse(
                f"has {shares.size} weights for {len(names)} configurations", "give one for each"
            )
    used = [name for name, share in zip(names, shares, strict=True) if share > 0.0]
    if len(used) != 1:
        raise tags.refuse(
            f"blends {len(used)} configurations of polars",
            "keep the one that holds for your water, with the weight [1.0]",
        )
    return used[0]


def _section(
    airfoil: _Place,
    name: str,
    configuration: str | None,
    first_version: bool,
    messages: list[str],
) -> SectionTable:
    """Return one airfoil with the polars of its configuration."""
    thick = airfoil.find("relative_thickness" if first_version else "rthick")
    thickness = None
    if thick is not None:
        thickness = min(thick.number(0.0, 1.0 + _THICK_ROUNDED, "it is over the chord"), 1.0)
    outline_x = outline_y = None
    coordinates = airfoil.find("coordinates")
    if coordinates is not None:
        x, y = coordinates.get("x").numbers(), coordinates.get("y").numbers()
        _same_length(x, y, coordinates)
        outline_x, outline_y = x.values, y.values

    entries = airfoil.get("polars", "add the airfoil's lift and drag").items()
    tagged = [(entry, _tag(entry)) for entry in entries]
    tags = list(dict.fromkeys(tag for _, tag in tagged))
    if not entries:
        raise airfoil.refuse("is empty", "add lift and drag", key=f"{airfoil.key}.polars")
    if configuration is None:
        configuration = tags[0]
        if len(tags) > 1:
            messages.append(
                f"{name}: polars of configuration {configuration}, the first, are taken"
            )
    chosen = [entry for entry, tag in tagged if tag == configuration]
    if not chosen:
        raise airfoil.refuse(
            f"has no polars of configuration {configuration}",
            f"known: {', '.join(str(tag) for tag in tags)}",
            key=f"{airfoil.key}.polars",
            shown=False,
        )
    sets = chosen if first_version else [one for entry in chosen for one in _re_sets(entry)]
    polars: dict[float | None, PolarTable] = {}
    for one in sets:
        table = _polar(one, first_version, name, messages)
        if table.reynolds in polars:
            raise one.refuse(
                f"is the second polar of {name} at one Reynolds number",
                "keep one of them, or tag them with different configurations",
                key=f"{one.key}.re",
            )
        polars[table.reynolds] = table
    ordered = sorted(polars.values(), key=lambda table: table.reynolds or 0.0)
    return SectionTable(name, thickness, tuple(ordered), outline_x, outline_y)


def _tag(entry: _Place) -> str | None:
    configuration = entry.find("configuration")
    return None if configuration is None else configuration.text()


def _re_sets(entry: _Place) -> Iterator[_Place]:
    sets = entry.get("re_sets").items()
    if not sets:
        raise entry.refuse("is empty", "add lift and drag", key=f"{entry.key}.re_sets")
    yield from sets


def _polar(place: _Place, first_version: bool, section: str, messages: list[str]) -> PolarTable:
    """Return one polar, its coefficients on one grid of angles of attack."""
    limit, unit = (np.pi, "radians") if first_version else (180.0, "degrees")
    grids: dict[str, np.ndarray] = {}
    values: dict[str, np.ndarray] = {}
    for quantity in ("c_l", "c_d", "c_m") if first_version else ("cl", "cd", "cm"):
        one = place.find(quantity) if quantity.endswith("m") else place.get(quantity)
        if one is None:
            continue
        grid, column = one.get("grid").numbers(), one.get("values").numbers()
        _same_length(grid, column, one)
        _rising(grid)
        grid.refuse(
            np.abs(grid.values) > limit * 1.001,
            "lies beyond the full circle",
            f"windIO {1 if first_version else 2} counts angles of attack in {unit}",
        )
        if not first_version and np.max(np.abs(grid.values)) < 3.2:
            raise one.refuse(
                f"has angles of attack from {grid.values[0]:g} to {grid.values[-1]:g} degrees",
                "windIO 2 counts them in degrees: convert them if they are radians",
                key=f"{one.key}.grid",
            )
        grids[quantity] = np.clip(grid.values, -limit, limit)
        values[quantity] = column.values
    alpha, *others = grids.values()
    if not all(np.array_equal(alpha, other) for other in others):
        low = max(grid[0] for grid in grids.values())
        high = min(grid[-1] for grid in grids.values())
        alpha = np.unique(np.concatenate(list(grids.values())))
        alpha = alpha[(alpha >= low) & (alpha <= high)]
        if alpha.size < 2:
            raise place.refuse(
                "has lift and drag at angles that do not overlap", "give both over one grid"
            )
        values = {name: np.interp(alpha, grids[name], column) for name, column in values.items()}
        messages.append(f"{section}: coefficients on different grids of angles are joined linearly")
    short = limit - np.abs(alpha[[0, -1]])
    if np.all(short < limit / np.pi * _CIRCLE_ROUNDED):
        if np.any(short > 0.0):
            alpha = np.concatenate(([-limit], alpha[1:-1], [limit]))
            messages.append("polars: angles of attack of ±3.14 rad are taken as half a turn")
        for name, numbers in values.items():
            first, last = numbers[0], numbers[-1]
            if 1e-6 < abs(last - first) < _ENDS_ROUNDED:
                mean = 0.5 * (first + last)
                values[name] = np.concatenate(([mean], numbers[1:-1], [mean]))
                messages.append(
                    f"{section}: {name} = {first:.4g} and {last:.4g} at ±180 degrees, which are "
                    "one angle: their mean is taken"
                )
    reynolds = place.find("re")
    number = None
    if reynolds is not None:
        number = reynolds.number(0.0, 1e12, "give the Reynolds number as a plain number")
    lift, drag, *moment = values
    return polar_table(
        alpha,
        values[lift],
        values[drag],
        values[moment[0]] if moment else None,
        number,
        file=place.file,
        columns=(f"{lift}.grid{', alpha_rad' * first_version}", *(f"{q}.values" for q in values)),
        where=f"{place.key} (line {place.node.line})",
    )
