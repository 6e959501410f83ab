"""The blade of a windIO turbine file (YAML), versions 1 and 2.

Source: windIO, IEA Wind Task 37, turbine schema, https://windio.readthedocs.io.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from hkt_mdo.errors import InputError
from hkt_mdo.files.blade_table import EDGE, MOST_ROWS, BladeTable, SectionTable, check_rows
from hkt_mdo.files.table import Column
from hkt_mdo.files.windio_airfoil import (
    THICK_ROUNDED,
    VERSIONS,
    Version,
    curve,
    read_airfoils,
)
from hkt_mdo.files.yaml_text import Place, compose, places_column

__all__ = ["read_windio"]

DIAMETER_OFF = 0.02
"""How far the file's rotor diameter may be from that of its hub and blade, relatively."""


def read_windio(text: str, file: Path) -> BladeTable:
    """Read the blade of a windIO turbine file.

    Rows are the grid of the chord together with that of the twist; what is given on another grid is
    interpolated linearly. A row's radius is the hub radius plus z of the reference axis. The table
    has the `sections` that its blade uses and `section_position`, where they stand. Raises
    InputError if something is missing or broken; the message names the dotted key and the line.
    """
    tree = compose(text, file)
    if not isinstance(tree, yaml.MappingNode):
        remedy = "it has the keys assembly, components and airfoils"
        raise InputError("is no windIO turbine", remedy, file=file, key="line 1")
    root = Place(tree, "", file)
    messages: list[str] = []
    blade = root.get("components.blade", "give a turbine with a blade")
    shape, version = _shape(blade)
    diameter = root.get("components.hub.diameter", "add the hub's diameter in metres")
    hub = 0.5 * diameter.number(0.0, 100.0, "give the hub's diameter in metres")
    s_axis, height = _height(shape.find("reference_axis") or blade.get("reference_axis"), messages)
    s, chord, twist = _chord_and_twist(shape, version, messages)
    r = hub + np.interp(s, s_axis, height)
    tip = float(r[-1])
    rows = [f"components.blade, row at s = {share:.6g}" for share in s]
    check_rows(Column("r", r, rows, r.tolist(), file), chord[1], twist[1], None, tip)
    names, stands = _positions(shape, version)
    sections = read_airfoils(root, names, version, messages)
    cone = root.get("components.hub").find("cone_angle")
    angle = None
    if cone is not None:
        half = 0.5 * version.half_turn
        angle = cone.number(-half, half, version.angles) / version.half_turn * np.pi
    _check_diameter(root.find("assembly"), tip, angle or 0.0, messages)
    labels = [name for _, name, _ in names]
    stand_r = hub + np.interp(stands, s_axis, height)
    return BladeTable(
        r,
        np.interp(s, chord[0], chord[1].values),
        np.interp(s, twist[0], twist[1].values),
        thickness=_thickness(shape, s, labels, stands, sections),
        sections=sections,
        section_position=tuple(zip(labels, stand_r.tolist(), strict=True)),
        tip_radius=tip,
        hub_radius=hub,
        blade_count=_blade_count(root.find("assembly")),
        cone=angle,
        messages=tuple(dict.fromkeys(messages)),
        file=str(file),
    )


def _shape(blade: Place) -> tuple[Place, Version]:
    """Return the blade's outer shape and the version of windIO that it belongs to."""
    found = [(blade.find(version.shape), version) for version in VERSIONS]
    shapes = [(shape, version) for shape, version in found if shape is not None]
    if not shapes:
        blade.get("outer_shape", "add outer_shape (windIO 2) or outer_shape_bem (windIO 1)")
    if len(shapes) > 1:
        remedy = "keep that of the file's windIO version"
        raise blade.refuse("holds outer_shape and outer_shape_bem", remedy)
    return shapes[0]


def _spanwise(place: Place) -> tuple[np.ndarray, Column]:
    """Return grid and values of a quantity along the whole span."""
    grid, values = curve(place)
    if abs(grid.values[0]) > EDGE or abs(grid.values[-1] - 1.0) > EDGE:
        problem = f"has a grid from {grid.values[0]:g} to {grid.values[-1]:g}"
        raise place.get("grid").refuse(problem, "a grid runs from 0 at the root to 1 at the tip")
    if grid.values.size > MOST_ROWS:
        raise place.get("grid").refuse(f"has more than {MOST_ROWS} numbers", "give fewer")
    return grid.values, values


def _chord_and_twist(
    shape: Place, version: Version, messages: list[str]
) -> tuple[np.ndarray, tuple[np.ndarray, Column], tuple[np.ndarray, Column]]:
    """Return the grid of the rows, and grid and values of chord and twist (rad)."""
    s_chord, chord = _spanwise(shape.get("chord"))
    s_twist, twist = _spanwise(shape.get("twist"))
    if version.number == 2:
        twist = replace(twist, values=np.deg2rad(twist.values))
        messages.append("windIO 2: degrees converted to radians")
    beyond = np.abs(twist.values) > np.pi * (1.0 + EDGE)
    twist.refuse(beyond, "is beyond 180 degrees", version.angles)
    if not np.array_equal(s_chord, s_twist):
        messages.append("chord and twist have different grids: rows are both, linear in between")
    s = np.union1d(s_chord, s_twist)
    s = s[np.diff(s, prepend=-1.0) > EDGE]  # points closer than that are one
    return s, (s_chord, chord), (s_twist, twist)


def _height(axis: Place, messages: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the grid of a blade's axis and z over it, which begins at 0 and rises."""
    grid, z = _spanwise(axis.get("z"))
    aside = np.zeros(z.values.size, dtype=bool)
    aside[0] = abs(z.values[0]) > EDGE * abs(z.values[-1])
    z.refuse(aside, "is not 0 at the blade's root", "count z from the root")
    height = np.concatenate(([0.0], z.values[1:]))
    z.check_rising("heights above the root", np.diff(height, prepend=-np.inf))
    for name, what in (("x", "prebend"), ("y", "sweep")):
        side = axis.find(name)
        largest = 0.0 if side is None else np.max(np.abs(_spanwise(side)[1].values))
        if largest > 0.0:
            said = f"{what} of up to {largest:g} m is ignored: straight blade"
            messages.append(f"{axis.key}.{name}: {said}")
    return grid, height


def _positions(
    shape: Place, version: Version
) -> tuple[list[tuple[Place, str, str | None]], np.ndarray]:
    """Return (place, name, configuration) of the airfoils along the span, and where they stand."""
    if version.number == 1:
        where = shape.get("airfoil_position")
        grid, labels = where.get("grid").numbers(), where.get("labels").items()
        if grid.values.size != len(labels):
            problem = f"has {grid.values.size} grid points and {len(labels)} labels"
            raise where.refuse(problem, "give as many labels as grid points")
        used: list[tuple[Place, str, str | None]] = [(at, at.text(), None) for at in labels]
    else:
        entries = shape.get("airfoils").items()
        stands = [entry.get("spanwise_position") for entry in entries]
        grid = places_column("spanwise_position", stands)
        used = [(entry, entry.get("name").text(), _configuration(entry)) for entry in entries]
    grid.refuse(
        (grid.values < -EDGE) | (grid.values > 1.0 + EDGE),
        "is no position along the span",
        "it lies within 0 (root) and 1 (tip)",
    )
    grid.check_rising("positions")
    return used, grid.values


def _configuration(entry: Place) -> str | None:
    """Return the one configuration of polars that a blade's airfoil uses (windIO 2)."""
    tags, weights = entry.find("configuration"), entry.find("weight")
    if tags is None:
        return None
    names = [tag.text() for tag in tags.items()]
    shares = np.ones(len(names)) if weights is None else weights.numbers().values
    if weights is not None and shares.size != len(names):
        problem = f"has {shares.size} weights for {len(names)} configurations"
        raise weights.refuse(problem, "give one for each")
    used = [name for name, share in zip(names, shares, strict=True) if share > 0.0]
    if len(used) != 1:
        remedy = "keep the one that holds for your water, with the weight [1.0]"
        raise tags.refuse(f"blends {len(used)} configurations of polars", remedy)
    return used[0]


def _thickness(
    shape: Place,
    s: np.ndarray,
    labels: list[str],
    stands: np.ndarray,
    sections: tuple[SectionTable, ...],
) -> np.ndarray | None:
    """Return the thickness of rows: the blade's own, or linear between its sections."""
    own = shape.find("rthick")
    if own is None:
        known = {section.name: section.thickness for section in sections}
        between = [known[name] for name in labels]
        return None if None in between else np.interp(s, stands, np.array(between, dtype=float))
    grid, column = _spanwise(own)
    column.refuse(
        (column.values <= 0.0) | (column.values > 1.0 + THICK_ROUNDED),
        "is no thickness over chord",
        "rthick lies within 0 (a plate) and 1 (a cylinder)",
    )
    return np.minimum(np.interp(s, grid, column.values), 1.0)


def _blade_count(assembly: Place | None) -> int | None:
    count = assembly and assembly.find("number_of_blades")
    if count is None:
        return None
    number = count.number(0.0, 100.0, "give the number of blades")
    if number != math.floor(number):
        raise count.refuse("is no whole number", "give the number of blades")
    return int(number)


def _check_diameter(assembly: Place | None, tip: float, cone: float, messages: list[str]) -> None:
    """Hold the file's rotor diameter, 2 (hub radius + z of the tip) cos(cone), to its blade."""
    diameter = assembly and assembly.find("rotor_diameter")
    if diameter is None:
        return
    number = diameter.number(-EDGE, 1000.0, "give the rotor's diameter in metres")
    own = 2.0 * tip * math.cos(cone)
    off = abs(number / own - 1.0)
    if number <= 0.0 or off <= 1e-6:  # windIO's default of 0 says that it is not given
        return
    if off > DIAMETER_OFF:
        raise diameter.refuse(
            f"does not fit hub and blade, which give {own:.6g} m",
            "no blade is scaled to it: correct components.hub.diameter, the reference axis or it",
        )
    messages.append(
        f"assembly.rotor_diameter = {number:.8g} m, but hub and blade give {own:.8g} m, which is "
        "taken"
    )
