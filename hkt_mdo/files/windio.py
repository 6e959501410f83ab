"""The blade and the airfoils of a windIO turbine file (YAML), versions 1 and 2.

Source: windIO, IEA Wind Task 37, turbine schema, https://windio.readthedocs.io.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from hkt_mdo.errors import InputError
from hkt_mdo.files.blade_table import EDGE, BladeTable, SectionTable, checked_rows
from hkt_mdo.files.outline import checked_outline
from hkt_mdo.files.polar_table import CIRCLE_EDGE, PolarTable, in_order, polar_table
from hkt_mdo.files.table import Column, array_columns
from hkt_mdo.files.yaml_text import Place, compose, places_column

DIAMETER_OFF = 0.02
"""How far the file's rotor diameter may be from that of its hub and blade, relatively."""

DIAMETER_ROUNDED = 1e-6
"""How far it may be without a message, relatively: files round."""

_STRUCTURES = ("internal_structure_2d_fem", "internal_structure", "structure")


_Airfoil = tuple[Place, str, str | None]
"""An airfoil along the blade: where it stands, its name, and its polars' configuration, if any."""


# Of each version of windIO, by the key of the blade's shape: number, unit of angles in words
# and in radians, key of an airfoil's thickness, keys of its coefficients.
_VERSIONS = {
    "outer_shape_bem": (1, "radians", 1.0, "relative_thickness", ("c_l", "c_d", "c_m")),
    "outer_shape": (2, "degrees", np.pi / 180.0, "rthick", ("cl", "cd", "cm")),
}


def read_windio(text: str, file: Path) -> BladeTable:
    """Read the blade of a windIO turbine file.

    Rows are the grids of chord and twist together; what is given on another grid is interpolated
    linearly. A row's radius is the hub radius plus z of the reference axis.

    Parameters
    ----------
    text : str
        Content of the file.
    file : pathlib.Path
        The file, for messages.

    Returns
    -------
    BladeTable
        The rows in SI units and radians, with the sections that the blade uses.

    Raises
    ------
    InputError
        If the file is broken; the message has the dotted key and the line.
    """
    tree = compose(text, file)
    if not isinstance(tree, yaml.MappingNode):
        remedy = "it has the keys assembly, components and airfoils"
        raise InputError("is no windIO turbine", remedy, file=file, key="line 1")
    root = Place(tree, "", file)
    blade = root.get("components.blade", "give a turbine with a blade")
    shapes = [key for key in _VERSIONS if blade.find(key)]
    if len(shapes) != 1:
        problem = "must hold one of outer_shape (windIO 2) and outer_shape_bem (windIO 1)"
        raise blade.refuse(problem, "give that of the file's version of windIO")
    return _Turbine(root, shapes[0]).blade()


def _curve(place: Place) -> tuple[Column, Column]:
    """Return the grid, which increases strictly, and the values of a quantity."""
    grid, values = place.pair("grid", "values")
    grid.check_rising("grids")
    return grid, values


def _spanwise(place: Place) -> tuple[np.ndarray, Column]:
    """Return grid and values of a quantity along the whole span."""
    grid, values = _curve(place)
    if abs(grid.values[0]) > EDGE or abs(grid.values[-1] - 1.0) > EDGE:
        problem = f"has a grid from {grid.values[0]:g} to {grid.values[-1]:g}"
        raise place.get("grid").refuse(problem, "a grid runs from 0 at the root to 1 at the tip")
    return grid.values, values


class _Turbine:
    """Reads one turbine and collects the messages about it."""

    def __init__(self, root: Place, shape: str) -> None:
        self.root, self.shape = root, root.get(f"components.blade.{shape}")
        self.version, unit, self.radian, self.thickness, self.coefficients = _VERSIONS[shape]
        self.angles = f"windIO {self.version} counts angles in {unit}"
        self.messages: list[str] = []

    def blade(self) -> BladeTable:
        """Return the table of the turbine's blade."""
        root, shape, radian = self.root, self.shape, self.radian
        diameter = root.get("components.hub.diameter", "add the hub's diameter in metres")
        hub = 0.5 * diameter.number(0.0, 100.0, "give the hub's diameter in metres")
        # a blade here is of one material
        note = "webs and layers are not read: rotor.material and rotor.wall are used instead"
        structures = (root.find(f"components.blade.{name}") for name in _STRUCTURES)
        self.messages += [f"{structure.key}: {note}" for structure in structures if structure]
        s_axis, height = self.height()
        s_chord, chord = _spanwise(shape.get("chord"))
        s_twist, twist = _spanwise(shape.get("twist"))
        twist = replace(twist, values=radian * twist.values)
        if self.version == 2:
            self.messages.append("windIO 2: degrees converted to radians")
        if not np.array_equal(s_chord, s_twist):
            grids = "chord and twist have different grids: rows are both, linear in between"
            self.messages.append(grids)
        s = np.union1d(s_chord, s_twist)
        s = s[np.diff(s, prepend=-1.0) > EDGE]  # points closer than that are one
        r = hub + np.interp(s, s_axis, height)
        tip = float(r[-1])
        rows = [f"components.blade, row at s = {share:.6g}" for share in s]
        s_thick, thick = _spanwise(shape.get("rthick")) if shape.find("rthick") else (None, None)
        radii = Column("r", r, rows, r.tolist(), root.file)
        checked_rows(radii, chord, twist, thick, tip, self.angles)
        airfoils, s_airfoils = self.positions()
        names = [name for _, name, _ in airfoils]
        sections = self.sections(airfoils)
        of_section = {section.name: section.thickness for section in sections}
        thickness = None
        if thick is not None:
            thickness = np.minimum(np.interp(s, s_thick, thick.values), 1.0)
        elif None not in of_section.values():
            thickness = np.interp(s, s_airfoils, [of_section[name] for name in names])
        cone, most = root.find("components.hub.cone_angle"), 0.5 * np.pi / radian
        angle = cone and radian * cone.number(-most, most, self.angles)
        r_airfoils = hub + np.interp(s_airfoils, s_axis, height)
        return BladeTable(
            r,
            np.interp(s, s_chord, chord.values),
            np.interp(s, s_twist, twist.values),
            thickness=thickness,
            sections=sections,
            section_position=tuple(zip(names, r_airfoils.tolist(), strict=True)),
            tip_radius=tip,
            hub_radius=hub,
            blade_count=self.assembly(tip, angle or 0.0),
            cone=angle,
            messages=tuple(dict.fromkeys(self.messages)),
            file=str(root.file),
        )

    def height(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the grid of the blade's axis and z over it, which begins at 0 and rises."""
        axis = self.shape.find("reference_axis")
        axis = axis or self.root.get("components.blade.reference_axis")
        grid, z = _spanwise(axis.get("z"))
        aside = np.abs(z.values[:1]) > EDGE * abs(z.values[-1])
        z.refuse(aside, "is not 0 at the blade's root", "measure z from the root")
        height = np.concatenate(([0.0], z.values[1:]))
        z.check_rising("heights above the root", height)
        for name, what in (("x", "prebend"), ("y", "sweep")):
            side = axis.find(name)
            largest = np.max(np.abs(_spanwise(side)[1].values)) if side else 0.0
            if largest > 0.0:
                note = f"{what} of up to {largest:g} m is ignored: straight blade"
                self.messages.append(f"{axis.key}.{name}: {note}")
        return grid, height

    def assembly(self, tip: float, cone: float) -> int | None:
        """Return the number of blades; hold the diameter to 2 (hub + z of the tip) cos(cone)."""
        count = self.root.find("assembly.number_of_blades")
        number = count and count.number(0.0, 100.0, "give the number of blades")
        if count and number != math.floor(number):
            raise count.refuse("is no whole number", "give the number of blades")
        diameter = self.root.find("assembly.rotor_diameter")
        swept = 2.0 * tip * math.cos(cone)
        # windIO's default of 0 says that it is not given
        stated = diameter and diameter.number(-EDGE, 1000.0, "give the rotor's diameter in metres")
        error = abs(stated / swept - 1.0) if stated and stated > 0.0 else 0.0
        if error > DIAMETER_OFF:
            problem = f"does not fit hub and blade, which give {swept:.6g} m"
            problem += " (WISDEM scales the axis)"
            remedy = "delete it, or correct hub or axis; rotor.radius scales all lengths and chords"
            raise diameter.refuse(problem, remedy)
        if error > DIAMETER_ROUNDED:
            note = f"{stated:.8g} m, but hub and blade give {swept:.8g} m, which is taken"
            self.messages.append(f"assembly.rotor_diameter = {note}")
        return number and int(number)

    def positions(self) -> tuple[list[_Airfoil], np.ndarray]:
        """Return the airfoils along the span, and their positions from 0 (root) to 1 (tip)."""
        if self.version == 1:
            where = self.shape.get("airfoil_position")
            grid, labels = where.get("grid").numbers(), where.get("labels").items()
            where.check_sizes(grid=grid.values, labels=labels)
            airfoils: list[_Airfoil] = [(label, label.text(), None) for label in labels]
        else:
            entries = self.shape.get("airfoils").items()
            positions = [entry.get("spanwise_position") for entry in entries]
            grid = places_column("spanwise_position", positions)
            airfoils = [(e, e.get("name").text(), _configuration(e)) for e in entries]
        outside = (grid.values < -EDGE) | (grid.values > 1.0 + EDGE)
        grid.refuse(outside, "is no position along the span", "it lies within 0 (root) and 1 (tip)")
        grid.check_rising("positions")
        return airfoils, grid.values

    def sections(self, airfoils: list[_Airfoil]) -> tuple[SectionTable, ...]:
        """Return the airfoils that the blade uses, each once."""
        library: dict[str, Place] = {}
        for entry in self.root.get("airfoils", "add the airfoils that the blade names").items():
            name = entry.get("name").text()
            if name in library:
                raise entry.refuse(f"is the second airfoil named {name}", "give each its own name")
            library[name] = entry
        chosen: dict[str, str | None] = {}
        for place, name, configuration in airfoils:
            if name not in library:
                problem = f"names the airfoil {name}, which airfoils does not hold"
                raise place.refuse(problem, f"add it there; known: {', '.join(list(library)[:8])}")
            if chosen.setdefault(name, configuration) != configuration:
                problem = f"uses {name} in configurations {chosen[name]} and {configuration}"
                raise place.refuse(problem, "copy the airfoil under a second name")
        return tuple(self.section(library[name], name, tag) for name, tag in chosen.items())

    def section(self, airfoil: Place, name: str, configuration: str | None) -> SectionTable:
        """Return one airfoil with the polars of its configuration."""
        thick = airfoil.find(self.thickness)
        thickness = thick and min(thick.number(0.0, 1.0 + 1e-6, "it is over the chord"), 1.0)
        coordinates = airfoil.find("coordinates")
        outline = checked_outline(*coordinates.pair("x", "y")) if coordinates else ()
        listed = airfoil.get("polars", "add the airfoil's lift and drag")
        tagged: dict[str | None, list[Place]] = {}
        for entry in listed.items():
            tag = entry.find("configuration")
            tagged.setdefault(tag and tag.text(), []).append(entry)
        if configuration is None:  # the first one
            configuration = next(iter(tagged))
            if len(tagged) > 1:
                note = f"polars of configuration {configuration}, the first, are taken"
                self.messages.append(f"{name}: {note}")
        if configuration not in tagged:
            remedy = f"known: {', '.join(map(str, tagged))}"
            raise listed.refuse(f"has no polars of configuration {configuration}", remedy)
        places = tagged[configuration]
        if self.version == 2:
            places = [place for entry in places for place in entry.get("re_sets").items()]
        polars = in_order([self.polar(x, name) for x in places], airfoil.file, f" of {name}")
        return SectionTable(name, thickness, polars, outline)

    def polar(self, place: Place, section: str) -> PolarTable:
        """Return one polar, its coefficients on one grid of angles of attack."""
        curves: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for name, key in zip(("cl", "cd", "cm"), self.coefficients, strict=True):
            curve = place.find(key) if name == "cm" else place.get(key)
            if curve is not None:
                grid, column = _curve(curve)
                beyond = np.abs(np.rad2deg(self.radian * grid.values)) > 180.0 + CIRCLE_EDGE
                grid.refuse(beyond, "lies beyond the full circle", self.angles)
                curves[name] = grid.values, column.values
        grids = [grid for grid, _ in curves.values()]
        alpha = np.unique(np.concatenate(grids))
        low, high = max(grid[0] for grid in grids), min(grid[-1] for grid in grids)
        alpha = alpha[(alpha >= low) & (alpha <= high)]
        if alpha.size < 2:
            problem = "has lift and drag at angles that do not overlap"
            raise place.refuse(problem, "give both over one grid")
        if any(grid.size != alpha.size for grid in grids):
            self.messages.append(f"{section}: coefficients on different grids are joined linearly")
        arrays = {"alpha" if self.version == 2 else "alpha_rad": alpha}
        arrays |= {name: np.interp(alpha, *curve) for name, curve in curves.items()}
        number = place.find("re")
        reynolds = number and number.number(0.0, 1e12, "give it as a plain number")
        return polar_table(array_columns(place.file, place.shown, **arrays), reynolds, place.shown)


def _configuration(entry: Place) -> str | None:
    """Return the one configuration of polars that a blade's airfoil uses (windIO 2)."""
    tags, weights = entry.find("configuration"), entry.find("weight")
    if tags is None:
        return None
    names = [tag.text() for tag in tags.items()]
    shares = weights.numbers().values if weights else np.ones(len(names))
    entry.check_sizes(configuration=names, weight=shares)
    used = [name for name, share in zip(names, shares, strict=True) if share > 0.0]
    if len(used) != 1:
        remedy = "keep the one that holds for your water, with the weight [1.0]"
        raise tags.refuse(f"blends {len(used)} configurations of polars", remedy)
    return used[0]
