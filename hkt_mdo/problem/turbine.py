"""The turbine of a case, made of its section `rotor` and the files that this section names."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline

from hkt_mdo.case import Design, Fluid, Rotor
from hkt_mdo.errors import InputError
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.blade_table import BladeTable
from hkt_mdo.files.shipped import shipped_names, shipped_rotor
from hkt_mdo.rotor.airfoil import Polar, PolarFamily
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.following import ByThickness, LocalReynolds, over_thickness
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.polars import ByStation, Polars
from hkt_mdo.rotor.strength import Structure, StructureByThickness, material_section

HUB, BLADES = 0.125, 3  # hub over tip radius, blade count: if neither case nor file has them
POLAR, OUTLINE = "naca63815_Re2e5", "naca63815"
AT_HUB = 1e-3  # share of the span by which a first row at the hub may be off it
OUTBOARD = 0.02  # of the tip radius: rows that begin farther from the hub are reported
BEYOND = 1.1  # factor by which a Reynolds number may be beyond the polars
AGAINST = -1e-3  # camber (height of the centroid over the chord) times lift at 0 degrees
OTHER = 0.01  # by which a thickness over chord may differ from that of the section named beside it
ROUNDED = 1e-3  # by which a bound may exceed the sections' thickness, which files round


class Turbine(NamedTuple):
    """The turbine of a section `rotor`; arrays, and tuples of polars, are over the stations.

    Where the thickness is designed, polar and structure are functions of it.
    """

    blade: Blade
    polar: Polars
    thickness: np.ndarray
    """Largest thickness over chord: of one section, or of each station."""
    structure: Structure | StructureByThickness
    messages: tuple[str, ...]
    """What was converted, extrapolated or left out."""
    outlines: tuple[Outline, ...] = ()
    """Of the sections: one, or one a station; where thickness is designed, from thin to thick."""
    walls: tuple[float, ...] = ()
    """Of each outline over the chord; 0.5: solid."""
    blends: tuple[tuple[str, str, float], ...] = ()
    """The two sections that each station lies between, by name, and the share of the second; one
    entry for a blade of one section, none where the thickness is designed."""
    sections: tuple["_Section", ...] = ()
    """The different sections of the case, or of the blade's file."""
    reynolds_number: float | None = None
    """At which polars of several are read; None: the case does not say."""
    doubts: tuple[str, ...] = ()
    """What in the blade's file is probably a mistake."""
    reach: float = 1.0
    """Where the stations or the rows of the blade's file end, over the tip radius."""

    def along_span(self, values: Sequence[Any], r: np.ndarray) -> np.ndarray:
        """Return what belongs to the outlines at some radii.

        Linear between stations; where the thickness is designed, that is linear, and the values
        are a spline over it.

        Parameters
        ----------
        values : array_like of shape (n_outlines, ...)
            Of each of the outlines.
        r : ndarray of shape (n_radii,)
            Radii along the blade (m).

        Returns
        -------
        ndarray of shape (n_radii, ...)
            Values at the radii; those of the first and last station beyond them.
        """
        blade, structure, values = self.blade, self.structure, np.array(values)
        if isinstance(structure, StructureByThickness) and blade.thickness is not None:
            thickness = np.interp(r, blade.r, blade.thickness)
            return over_thickness(structure.thickness, values)(thickness)
        if len(values) == 1:
            return np.repeat(values, r.size, axis=0)
        return make_interp_spline(blade.r, values, k=1)(np.clip(r, blade.r[0], blade.r[-1]))


class _Section(NamedTuple):
    """One section: polars by Reynolds number, thickness, area over chord squared, and outline.

    wall is that of a hollow section, None for a solid one. area, moments None: of outline and wall.
    name is what the polars are called, shape the outline: empty where another one's is taken;
    called is the section's name in tables.
    """

    polars: PolarFamily
    thickness: float
    area: float | None
    outline: Outline
    wall: float | None = None
    moments: tuple[float, float, float] | None = None
    name: str = ""
    shape: str = ""
    called: str = ""


def build_turbine(
    rotor: Rotor, fluid: Fluid, flow_speed: float, design: Design | None = None
) -> Turbine:
    """Read the files of a rotor section and return its turbine.

    Local Reynolds numbers are those at flow_speed, m/s; `design` None: the thickness is not
    designed. Raises InputError if a file is broken, or what they say does not fit together.

    Parameters
    ----------
    rotor : Rotor
        The section `rotor` of a case.
    fluid : Fluid
        The water.
    flow_speed : float
        Speed of the flow for local Reynolds numbers (m/s).
    design : Design, optional
        What is designed; None: not the thickness.

    Returns
    -------
    Turbine

    Raises
    ------
    InputError
        If a file is broken, or files do not fit together.
    """
    table, tip_radius, hub_radius = _blade_table(rotor)
    stations, messages = _stations(rotor, table, tip_radius, hub_radius)
    reach = float(min(stations[-1], table.r[-1])) / tip_radius
    read = () if rotor.blade in shipped_names("blade") else table.messages
    table = _at_stations(table, stations)
    cone = np.deg2rad(rotor.cone) if rotor.cone is not None else table.cone or 0.0
    set_angle = 0.0 if rotor.chord is not None else np.deg2rad(rotor.set_angle or 0.0)
    count = rotor.blade_count or table.blade_count or BLADES
    shape = table.r, table.chord, table.twist + set_angle
    blade = Blade(*shape, hub_radius, tip_radius, count, float(cone))
    named, notes = _named_sections(rotor, table)
    rotor, chosen = _with_reynolds(rotor, named)
    if design is not None and design.thickness_points:
        sections, blended, blends = list(_in_order(named).values()), (), ()
        polar, structure = _by_thickness(rotor, design, sections)
        thickness = np.clip(_starting_thickness(rotor, table, named), *polar.bounds)
        blade = replace(blade, thickness=thickness)
    else:
        sections, blended, blends = _sections(rotor, table, named)
        areas = [x.area or material_section(x.outline, x.wall)[0] for x in sections]
        sections = [x._replace(area=y) for x, y in zip(sections, areas, strict=True)]
        thickness = np.array([section.thickness for section in sections])
        families = [section.polars for section in sections]
        if rotor.reynolds == "local":
            polar = LocalReynolds.of(families, flow_speed, fluid.kinematic_viscosity)
        else:
            polars = {family: _invariant(family, rotor.reynolds_number) for family in families}
            polar, *others = polars.values()
            if others:
                polar = ByStation.of(polars[family] for family in families)
        structure = _structure(rotor, sections)
    outlines = tuple(section.outline for section in sections)
    walls = tuple(0.5 if section.wall is None else section.wall for section in sections)
    messages = (*read, *messages, *notes, *chosen, *blended)
    origin = tuple(named.values()), rotor.reynolds_number, table.doubts, reach
    return Turbine(blade, polar, thickness, structure, messages, outlines, walls, blends, *origin)


def _blade_table(rotor: Rotor) -> tuple[BladeTable, float, float]:
    """Return the blade's rows for the case's tip radius, tip radius and hub radius, m."""
    fraction = rotor.hub_radius_fraction
    if rotor.chord is not None:
        radius = _radius(rotor, None)
        rows = np.array(rotor.stations) * radius, np.array(rotor.chord), np.deg2rad(rotor.twist)
        table = BladeTable(*rows, tip_radius=radius)
    else:
        table = read_blade(rotor.blade)
        tip_radius = shipped_rotor(rotor.blade).get("radius", table.tip_radius)
        table = replace(table, tip_radius=tip_radius)
    if table.hub_radius == 0.0:  # its span begins at the root
        if fraction is None:
            problem = "measures its span from the root and does not contain the hub's radius"
            remedy = "give rotor.hub_radius_fraction"
            raise InputError(problem, remedy, file=rotor.blade)
        span = float(table.r[-1])
        if abs(table.r[0] / span - fraction) < AT_HUB:
            problem = "is the hub's radius, and AeroDyn counts the span from the blade's root"
            value, remedy = float(table.r[0]), "subtract the hub's radius from the column"
            raise InputError(problem, remedy, file=rotor.blade, key="column BlSpn", value=value)
        hub = span * fraction / (1.0 - fraction)
        table = replace(table, r=table.r + hub, tip_radius=hub + span, hub_radius=hub)
    if fraction is None:
        has_radii = table.hub_radius is not None and table.tip_radius is not None
        fraction = table.hub_radius / table.tip_radius if has_radii else HUB
    radius = _radius(rotor, table.tip_radius)
    return table.scaled(radius), radius, fraction * radius


def _radius(rotor: Rotor, file_radius: float | None) -> float:
    """Return the tip radius of the case, or else that of the blade's file."""
    radius = file_radius if rotor.radius is None else rotor.radius
    if radius is None:
        problem, remedy = "does not contain the tip radius", "give rotor.radius"
        raise InputError(problem, remedy, file=rotor.blade, key="tip radius")
    return radius


def _stations(rotor, table, tip_radius, hub_radius) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the radii of the stations, m, and messages about them."""
    low, high, hub = np.array([table.r[0], table.r[-1], hub_radius]) / tip_radius
    if rotor.stations is None and rotor.station_count is None:
        rows = table.interior(hub_radius)
        if rows.size < 3:
            problem = f"has {rows.size} rows between hub (r/R = {hub:.4g}) and tip"
            remedy = "give rotor.station_count, such as 10, or at least 3 rows there"
            raise InputError(problem, remedy, file=rotor.blade)
        left_out = table.r.size - rows.size
        text = f"{left_out} of {table.r.size} rows lie at hub or tip, where there is"
        notes = [f"{text} no load; the other rows are the stations"] if left_out else []
        if low > hub + OUTBOARD:
            text = f"rows begin at r/R = {low:.4g}, the hub ends at {hub:.4g}: the load falls"
            text += " to zero between them"
            notes.append(f"{text}; with rotor.station_count the first row is continued to the hub")
        return rows, tuple(notes)
    if rotor.station_count is not None:  # in place of stations, which may be given as well
        angle = np.pi * (np.arange(rotor.station_count) + 0.5) / rotor.station_count
        fraction = hub + (1.0 - hub) * 0.5 * (1.0 - np.cos(angle))
    else:
        fraction = np.array(rotor.stations)
        if fraction[0] * tip_radius <= hub_radius:
            problem = f"lies on or within the hub, whose radius is {hub_radius:.6g} m"
            remedy = "move the first station outwards or reduce rotor.hub_radius_fraction"
            raise InputError(problem, remedy, key="rotor.stations[0]", value=rotor.stations[0])
    if fraction[0] >= low - 1e-9 * high and fraction[-1] <= high * (1.0 + 1e-9):
        return fraction * tip_radius, ()
    if rotor.station_count is None:
        reach = f"but rotor.stations reach {fraction[0]:g} … {fraction[-1]:g}"
        problem = f"blade covers r/R = {low:g} … {high:g} {reach}"
        raise InputError(problem, "change them or extend the file", file=rotor.blade)
    text = f"the file covers r/R = {low:.4g} to {high:.4g}: chord, twist and section continue"
    return fraction * tip_radius, (f"{text} unchanged to hub and tip",)


def _at_stations(table: BladeTable, r: np.ndarray) -> BladeTable:
    """Return a table's rows at some radii, linear between its own; `section` then holds blends."""
    section = None
    if table.section is not None or table.section_position is not None:
        section = table.blend(np.clip(r, table.r[0], table.r[-1]))
    fields = {name: getattr(table, name) for name in ("chord", "twist", "thickness")}
    columns = {n: np.interp(r, table.r, each) for n, each in fields.items() if each is not None}
    return replace(table, r=r, section=section, section_position=None, **columns)


def _sections(rotor, table, named) -> tuple[list[_Section], tuple[str, ...], tuple]:
    """Return the one section of the blade, or that of every station; messages; and the blends."""
    missing = sorted({name for pair in table.section or () for name in pair[:2]} - set(named))
    if rotor.sections and missing:
        problem = f"names the section {missing[0]}, which rotor.sections does not have"
        raise InputError(problem, f"give it there; known: {', '.join(named)}", file=rotor.blade)
    if len(named) == 1:
        (section,) = named.values()
        sections, notes = _of_thickness(rotor, table.thickness, section)
        return sections, notes, ((section.called, section.called, 0.0),) * len(sections)
    pairs, messages = _pairs(rotor, table, named)
    mixed = [_mixed(named[inner], named[outer], share) for inner, outer, share in pairs]
    blends = ((named[a].called, named[b].called, share) for a, b, share in pairs)
    actual, stated = np.array([section.thickness for section in mixed]), table.thickness
    if table.section and stated is not None and np.max(np.abs(actual - stated)) > OTHER:
        spans = (f"{100.0 * np.min(x):.3g} to {100.0 * np.max(x):.3g} %" for x in (stated, actual))
        note = "thickness is {} in the blade's file, but {} of the sections it names, which counts"
        messages = (*messages, note.format(*spans))
    return mixed, messages, tuple(blends)


def _of_thickness(rotor, thickness, section) -> tuple[list[_Section], tuple[str, ...]]:
    """Return a blade's one section, stretched at each station where its file has the thickness.

    A shipped blade of one section has the same outline everywhere, as the paper assumes.
    """
    shipped = rotor.blade in shipped_names("blade")
    if thickness is None or shipped or np.allclose(thickness, section.thickness, 0.0, ROUNDED):
        return [section], ()
    entry, outline = next(iter(rotor.sections), None), section.outline
    sections = [
        _section(rotor, section.polars, outline.stretched(value / outline.thickness), value, entry)
        for value in np.asarray(thickness).tolist()
    ]
    span = f"{100.0 * np.min(thickness):.3g} to {100.0 * np.max(thickness):.3g} %"
    note = f"the one outline is stretched to the thickness of the blade's file, {span}; its polar "
    note += "is the same at all stations"
    return _alike(sections), (note,)


def _by_thickness(rotor, design, sections):
    """Return polars and structure over the thickness of sections from thin to thick."""
    if len(sections) < 2:
        problem, remedy = "needs several sections, of different thickness", "give rotor.sections"
        raise InputError(problem, remedy, key="design.thickness_points")
    if rotor.reynolds == "local":
        problem = "is designed, which local Reynolds numbers do not allow"
        remedy = "give rotor.reynolds: invariant, or leave out design.thickness_points"
        raise InputError(problem, remedy, key="design.thickness_points")
    thickness = np.array([section.thickness for section in sections])
    low, high = float(thickness[0]), float(thickness[-1])
    bounds = design.thickness_bounds or (low, high)
    if bounds[0] < low - ROUNDED or bounds[1] > high + ROUNDED:
        problem = f"reach beyond the sections, whose thickness is {low:.4g} to {high:.4g}"
        remedy = "narrow the bounds, or give rotor.sections that are thinner or thicker"
        raise InputError(problem, remedy, key="design.thickness_bounds", value=list(bounds))
    bounds = tuple(float(end) for end in np.clip(bounds, low, high))
    polars = [_invariant(section.polars, rotor.reynolds_number) for section in sections]
    return ByThickness.of(thickness, polars, bounds), _structure(rotor, sections, thickness)


def _starting_thickness(rotor, table, named) -> np.ndarray:
    """Return the thickness of the stations where it is designed, half way if no file says it."""
    if table.thickness is not None:
        return table.thickness
    if table.section is None:
        thickness = [section.thickness for section in named.values()]
        return np.full(table.r.size, 0.5 * (min(thickness) + max(thickness)))
    return np.array([section.thickness for section in _sections(rotor, table, named)[0]])


def _structure(rotor, sections, thickness=None) -> Structure | StructureByThickness:
    """Return the structure of the blade's section, or of those of its stations or thicknesses.

    The area over chord squared is linear between stations; where it is None, it follows from
    outline and wall.
    """
    material, walls, properties = rotor.blade_material, None, None
    if sections[0].wall is not None:
        walls = [section.wall for section in sections]
    if sections[0].area is not None:
        properties = [(section.area, *(section.moments or ())) for section in sections]
    outlines = [section.outline for section in sections]
    parts = outlines, material.density, material.modulus, walls, properties
    return Structure.of(*parts) if thickness is None else StructureByThickness.of(thickness, *parts)


def _with_reynolds(rotor, named) -> tuple[Rotor, tuple[str, ...]]:
    """Return a rotor with a Reynolds number where a blade's file brings polars for several.

    One that the case gives must not lie beyond the polars.
    """
    numbers = np.unique(np.concatenate([section.polars.reynolds for section in named.values()]))
    numbers = numbers[np.isfinite(numbers)]
    chosen = rotor.reynolds_number
    if chosen and numbers.size > 1 and not numbers[0] / BEYOND <= chosen <= numbers[-1] * BEYOND:
        problem = f"is beyond the polars, {numbers[0]:.3g} to {numbers[-1]:.3g}"
        raise InputError(problem, "give polars there", key="rotor.reynolds_number", value=chosen)
    if chosen and all(len(section.polars.polars) == 1 for section in named.values()):
        text = f"rotor.reynolds_number = {chosen:g} chooses no polar: each section has one"
        number = None if numbers.size else chosen  # of polars that do not say theirs
        return rotor.model_copy(update={"reynolds_number": number}), (text,)
    from_file = not rotor.sections and rotor.polar is None
    if not from_file or rotor.reynolds_number or rotor.reynolds == "local" or numbers.size < 2:
        return rotor, ()
    number = float(np.sqrt(numbers[0] * numbers[-1]))
    span = f"{numbers[0]:.3g} to {numbers[-1]:.3g}"
    note = f"polars of the blade's file, from {span}, are read at a Reynolds number of {number:.3g}"
    remedy = "rotor.reynolds_number chooses another"
    return rotor.model_copy(update={"reynolds_number": number}), (f"{note}: {remedy}",)


def _named_sections(rotor, table) -> tuple[dict[str, _Section], tuple[str, ...]]:
    """Return the sections that the case or the blade's file gives, by name, and notes."""
    named, from_file = {}, PolarFamily.from_file
    for number, entry in enumerate(rotor.sections):
        if entry.outline is None and entry.thickness is None:
            problem, remedy = "gives neither outline nor thickness", "give one of them"
            raise InputError(problem, remedy, key=f"rotor.sections[{number}]", value=entry.polar)
        outline = None if entry.outline is None else Outline.from_file(entry.outline)
        shape = entry.outline or rotor.outline or ""
        names = entry.polar, shape, entry.name or Path(entry.outline or entry.polar).stem
        parts = from_file(entry.polar), outline, entry.thickness, entry, *names
        named[entry.name or str(number + 1)] = parts
    if not named and rotor.polar is None:
        for section in table.sections:
            outline = Outline(*section.outline) if section.outline else None
            shape = rotor.blade if outline else rotor.outline or ""
            parts = PolarFamily.from_tables(section.polars), outline, section.thickness, None
            named[section.name] = *parts, section.name, shape, section.name
        missing = sorted({name for pair in table.section or () for name in pair[:2]})
        if not named and missing:
            problem = f"names the sections {', '.join(missing[:8])}, which nothing describes"
            remedy = "give rotor.sections, one for each, or rotor.polar for all of them"
            raise InputError(problem, remedy, file=rotor.blade)
    polar, shape = rotor.polar or POLAR, rotor.outline or ("" if rotor.polar else OUTLINE)
    named = named or {"": (from_file(polar), None, None, None, polar, shape, Path(polar).stem)}
    sections = [_section(rotor, *parts) for parts in named.values()]
    notes = [note for section in sections for note in section.polars.messages]
    other = f"{Path(rotor.outline or OUTLINE).stem}, stretched to the thickness"
    if "" in named and rotor.polar is None:
        notes.append(f"no rotor.polar is given: lift and drag are assumed to be those of {POLAR}")
    notes += [
        f"section {name or polar}: without an outline; mass and stress are by that of {other}"
        for name, (_, outline, *_) in named.items()
        if outline is None and (name or rotor.outline is None)
    ]
    notes += [
        f"{entry.outline}: outline from the coordinates that it names or holds (NumCoords)"
        for entry in (*rotor.sections, rotor)
        if entry.outline and entry.outline == entry.polar and Path(entry.outline).is_file()
    ]
    notes += [
        f"{each.shape or OUTLINE}: its camber is against the lift of {each.name}: check y's sign"
        for each in sections
        if each.outline.centroid[1] * each.polars.polars[0].evaluate(0.0)[0] < AGAINST
    ]
    return dict(zip(named, _alike(sections), strict=True)), tuple(dict.fromkeys(notes))


def _section(rotor, polars, outline, thickness, entry, *names) -> _Section:
    """Return a section with the wall, area and second moments that the case gives, if any.

    One without an outline has the rotor's, stretched to its thickness.
    """
    contour = outline or Outline.from_file(rotor.outline or OUTLINE)
    thickness = contour.thickness if thickness is None else thickness
    if outline is None:
        contour = contour.stretched(thickness / contour.thickness)
    wall, area, by = (getattr(entry, name, None) for name in ("wall", "area", "second_moments"))
    moments = by and (by.flapwise, by.edgewise, by.product)
    return _Section(polars, thickness, area, contour, wall or rotor.wall, moments, *names)


def _alike(sections) -> list[_Section]:
    """Return sections that can be blended: if one has a wall or second moments, all have.

    A wall is at most half as thick as its section, which is then solid. Where walls differ and
    nothing else is given, the area is left to follow from outline and wall: it is not linear.
    """
    hollow, explicit = any(each.wall for each in sections), any(each.moments for each in sections)
    walls = [min(x.wall or 0.5, 0.5 * x.outline.thickness) if hollow else None for x in sections]
    linear = explicit or len(set(walls)) == 1 or any(each.area for each in sections)
    alike = []
    for section, wall in zip(sections, walls, strict=True):
        area, moments, _ = material_section(section.outline, wall)
        area, moments = linear and (section.area or area), explicit and (section.moments or moments)
        alike.append(section._replace(wall=wall, area=area or None, moments=moments or None))
    return alike


def _mixed(inner: _Section, outer: _Section, share: float) -> _Section:
    """Return the section between two; all of it but the outline is linear in the share.

    What is None follows from the outline and the wall.
    """
    if share == 0.0:
        return inner
    numbers = np.union1d(inner.polars.reynolds, outer.polars.reynolds)
    if np.any(np.isfinite(numbers)):
        numbers = numbers[np.isfinite(numbers)]  # a polar without a number holds for each
    polars = tuple(inner.polars.at(n).blend(outer.polars.at(n), share) for n in numbers)

    def linear(one, two):
        return (1.0 - share) * one + share * two

    return _Section(
        PolarFamily(numbers, polars),
        linear(inner.thickness, outer.thickness),
        inner.area and linear(inner.area, outer.area),
        inner.outline.blend(outer.outline, share),
        inner.wall and linear(inner.wall, outer.wall),
        inner.moments and tuple(map(linear, inner.moments, outer.moments)),
    )


def _pairs(rotor, table, named):
    """Return the two sections that each station lies between, and the share of the second."""
    if table.section is not None:
        return table.section, ()
    if table.thickness is None:
        problem = f"has neither thickness nor section of its rows, but there are {len(named)}"
        remedy = "add a column t_over_c or section"
        raise InputError(f"{problem} sections", remedy, file=rotor.blade)
    ordered = _in_order(named)
    names, values = list(ordered), np.array([section.thickness for section in ordered.values()])
    beyond = (table.thickness < values[0] - 1e-3) | (table.thickness > values[-1] + 1e-3)
    text = f"{np.count_nonzero(beyond)} stations are thinner or thicker than every section "
    text += f"({values[0]:.3f} to {values[-1]:.3f}): they have the polar of the nearest section"
    index = np.interp(table.thickness, values, np.arange(values.size))
    inner = np.minimum(index.astype(int), values.size - 2)
    pairs = [(names[i], names[i + 1], float(at - i)) for i, at in zip(inner, index, strict=True)]
    return pairs, (text,) if np.any(beyond) else ()


def _in_order(named) -> dict[str, _Section]:
    """Return sections from the thinnest to the thickest; refuse some that have no order."""
    if len({section.thickness for section in named.values()}) < len(named):
        problem, remedy = "has two sections of one thickness", "keep one of them"
        raise InputError(problem, remedy, key="rotor.sections")
    return dict(sorted(named.items(), key=lambda pair: pair[1].thickness))


def _invariant(family: PolarFamily, number: float | None) -> Polar:
    """Return a family's one polar, or that of a Reynolds number."""
    if len(family.polars) == 1:
        return family.polars[0]
    if number is None:
        numbers = ", ".join(f"{value:.3g}" for value in family.reynolds)
        problem = f"is needed to choose from polars at {numbers}"
        remedy = "give rotor.reynolds_number, or rotor.reynolds: local"
        raise InputError(problem, remedy, key="rotor.reynolds_number")
    return family.at(number)
