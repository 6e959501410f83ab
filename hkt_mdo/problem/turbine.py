"""The turbine of a case: its blade, the polar of each station and the area of each section.

Marries a case's section `rotor` with the files that it names.
"""

from dataclasses import dataclass, replace

import numpy as np

from hkt_mdo.case import Fluid, Rotor
from hkt_mdo.errors import InputError
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.blade_table import BladeTable
from hkt_mdo.files.shipped import shipped_names, shipped_rotor
from hkt_mdo.rotor.airfoil import Polar, PolarFamily
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.reynolds import LocalReynolds

HUB, BLADES = 0.125, 3  # where neither case nor blade file says: hub over tip radius, blade count
POLAR, OUTLINE = "naca63815_Re2e5", "naca63815"


@dataclass(frozen=True, eq=False)
class Turbine:
    """What a rotor section describes.

    Parameters
    ----------
    blade : Blade
    polar : Polar, tuple of Polar (one a station), or LocalReynolds
    section_area : float or ndarray, shape (n_stations,)
        Area of the section's outline over chord squared.
    thickness : float or ndarray, shape (n_stations,)
        Largest thickness over chord.
    messages : tuple of str
        What was converted, carried on or left out, in plain words.
    """

    blade: Blade
    polar: Polar | tuple[Polar, ...] | LocalReynolds
    section_area: float | np.ndarray
    thickness: float | np.ndarray
    messages: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Section:
    """One section: polars by Reynolds number, thickness, and area over chord squared."""

    polars: PolarFamily
    thickness: float
    area: float


def build_turbine(rotor: Rotor, fluid: Fluid, flow_speed: float) -> Turbine:
    """Read the files of a rotor section and return its turbine.

    Parameters
    ----------
    rotor : Rotor
    fluid : Fluid
    flow_speed : float, m/s
        At which local Reynolds numbers are taken.

    Raises
    ------
    InputError
        If a file is broken, or what they say does not fit together.
    """
    table, hub_fraction = _blade_table(rotor)
    tip_radius = table.tip_radius
    hub_radius = hub_fraction * tip_radius
    blade_count = rotor.blade_count or table.blade_count or BLADES
    cone = np.deg2rad(rotor.cone) if rotor.cone is not None else table.cone or 0.0
    table, messages = _at_stations(rotor, table, hub_radius)
    set_angle = 0.0 if rotor.chord is not None else np.deg2rad(rotor.set_angle or 0.0)
    blade = Blade(
        table.r,
        table.chord,
        table.twist + set_angle,
        hub_radius,
        tip_radius,
        blade_count,
        float(cone),
    )
    polars, area, thickness, blended = _sections(rotor, table)
    if rotor.reynolds == "local":
        families = polars if isinstance(polars, tuple) else (polars,) * blade.r.size
        polar = LocalReynolds.of(families, flow_speed, fluid.kinematic_viscosity)
    else:
        number = rotor.reynolds_number
        polar = (
            tuple(_invariant(family, number) for family in polars)
            if isinstance(polars, tuple)
            else _invariant(polars, number)
        )
    read = () if rotor.blade in shipped_names("blade") else table.messages
    return Turbine(blade, polar, area, thickness, (*read, *messages, *blended))


def _blade_table(rotor: Rotor) -> tuple[BladeTable, float]:
    """Return the blade's rows for the case's tip radius, and the hub radius over it."""
    fraction = rotor.hub_radius_fraction
    if rotor.chord is not None:
        radius = _radius(rotor, None)
        rows = BladeTable(
            np.array(rotor.stations) * radius,
            np.array(rotor.chord),
            np.deg2rad(rotor.twist),
            tip_radius=radius,
        )
        return rows, HUB if fraction is None else fraction
    table = read_blade(rotor.blade, hub_radius=0.0)
    own = shipped_rotor(rotor.blade).get("radius")
    if own is not None and not table.relative:  # a shipped file in metres is of this size
        table = replace(table, tip_radius=own)
    if table.hub_radius == 0.0 and not table.relative:  # its span is counted from the root
        if fraction is None:
            raise InputError(
                "counts its span from the blade's root and does not say the hub's radius",
                "give rotor.hub_radius_fraction",
                file=rotor.blade,
            )
        span = float(table.r[-1])
        hub = span * fraction / (1.0 - fraction)
        table = replace(table, r=table.r + hub, tip_radius=hub + span, hub_radius=hub)
    if fraction is None:
        fraction = HUB
        if table.hub_radius is not None and table.tip_radius is not None:
            fraction = table.hub_radius / table.tip_radius
    if table.relative:
        return replace(table, tip_radius=_radius(rotor, None)), fraction
    return table.scaled(_radius(rotor, table.tip_radius)), fraction


def _radius(rotor: Rotor, own: float | None) -> float:
    if rotor.radius is not None:
        return rotor.radius
    if own is None:
        raise InputError(
            "does not say the tip radius", "give rotor.radius", file=rotor.blade, key="tip radius"
        )
    return own


def _at_stations(rotor, table, hub_radius) -> tuple[BladeTable, tuple[str, ...]]:
    """Return the rows at the case's stations, in metres; linear between the file's rows."""
    tip_radius, messages = table.tip_radius, ()
    unit = tip_radius if table.relative else 1.0
    if rotor.stations is None and rotor.station_count is None:
        own = table.interior(hub_radius / unit)
        if own.r.size < 3:
            raise InputError(
                f"has {own.r.size} rows between hub and tip",
                "give at least 3, or rotor.station_count",
                file=rotor.blade,
            )
        left_out = table.r.size - own.r.size
        if left_out:
            messages = (
                f"{left_out} of {table.r.size} rows lie at hub or tip, where there is no load: the "
                "stations are the others",
            )
        fraction = own.r * (unit / tip_radius)
        stations = own.r
    else:
        if rotor.stations is not None:
            fraction = np.array(rotor.stations)
        else:
            angle = np.pi * (np.arange(rotor.station_count) + 0.5) / rotor.station_count
            hub = hub_radius / tip_radius
            fraction = hub + (1.0 - hub) * 0.5 * (1.0 - np.cos(angle))
        stations = fraction if table.relative else fraction * tip_radius
    low, high = table.r[0], table.r[-1]
    edge = 1e-9 * high
    if stations[0] <= hub_radius / unit:
        raise InputError(
            f"lies on or within the hub, whose radius is {hub_radius:.6g} m",
            "move the first station outwards or lessen rotor.hub_radius_fraction",
            key="rotor.stations[0]",
            value=float(fraction[0]),
        )
    if rotor.stations is not None and (stations[0] < low - edge or stations[-1] > high + edge):
        ends = low * unit / tip_radius, high * unit / tip_radius
        raise InputError(
            f"blade covers r/R = {ends[0]:g} … {ends[1]:g} but rotor.stations reach "
            f"{fraction[0]:g} … {fraction[-1]:g}",
            "change them or extend the file",
            file=rotor.blade,
        )
    if stations[0] < low - edge or stations[-1] > high + edge:
        messages = (
            *messages,
            f"the file covers r/R = {low * unit / tip_radius:.4g} to "
            f"{high * unit / tip_radius:.4g}: chord, twist and section are carried on unchanged "
            "to hub and tip",
        )

    def at(column):
        return None if column is None else np.interp(stations, table.r, column)

    found = replace(
        table,
        r=fraction * tip_radius if table.relative else stations,
        chord=at(table.chord) * unit,
        twist=at(table.twist),
        thickness=at(table.thickness),
        section=None,
        section_position=None,
        relative=False,
    )
    if table.section is not None or table.section_position is not None:
        # which sections a station lies between, kept by station
        found = replace(found, section=table.blend(np.clip(stations, low, high)))
    return found, messages


def _sections(rotor, table):
    """Return polars, area and thickness: of one section, or of every station; and messages."""
    if rotor.sections:
        named = {}
        for number, entry in enumerate(rotor.sections, start=1):
            outline = None if entry.outline is None else Outline.from_file(entry.outline)
            if outline is None and entry.thickness is None:
                raise InputError(
                    "gives neither outline nor thickness",
                    "give one of them",
                    key=f"rotor.sections[{number - 1}]",
                    value=entry.polar,
                )
            named[entry.name or str(number)] = _section(
                PolarFamily.from_file(entry.polar),
                outline,
                entry.thickness,
                rotor,
            )
    elif rotor.polar is None and table.sections:
        named = {
            each.name: _section(
                PolarFamily.from_tables(each.polars),
                None if each.outline_x is None else Outline(each.outline_x, each.outline_y),
                each.thickness,
                rotor,
            )
            for each in table.sections
        }
    else:
        source = rotor.polar or POLAR
        outline = Outline.from_file(rotor.outline or OUTLINE)
        one = _section(PolarFamily.from_file(source), outline, None, rotor)
        several = {name for pair in table.section or () for name in pair[:2]}
        if len(several) > 1 and rotor.polar is None:
            raise InputError(
                f"names {len(several)} sections: {', '.join(sorted(several)[:8])}",
                "give rotor.sections, one for each, or rotor.polar for all of them",
                file=rotor.blade,
            )
        return one.polars, one.area, one.thickness, ()
    if len(named) == 1:
        (one,) = named.values()
        return one.polars, one.area, one.thickness, ()
    pairs, messages = _pairs(rotor, table, named)
    mixed = [_mixed(named[inner], named[outer], share) for inner, outer, share in pairs]
    polars = tuple(each.polars for each in mixed)
    area = np.array([each.area for each in mixed])
    return polars, area, np.array([each.thickness for each in mixed]), messages


def _section(polars, outline, thickness, rotor) -> _Section:
    """Return a section; one without an outline has the rotor's, stretched to its thickness."""
    if outline is None:
        base = Outline.from_file(rotor.outline or OUTLINE)
        thickness = base.thickness if thickness is None else thickness
        return _Section(polars, thickness, base.area * thickness / base.thickness)
    return _Section(polars, outline.thickness if thickness is None else thickness, outline.area)


def _mixed(inner: _Section, outer: _Section, share: float) -> _Section:
    """Return what stands between two sections: polars, thickness and area, linear in the share."""
    if share == 0.0:
        return inner
    numbers = np.union1d(inner.polars.reynolds, outer.polars.reynolds)
    if np.any(np.isfinite(numbers)):
        numbers = numbers[np.isfinite(numbers)]  # a polar without a number holds at all
    polars = tuple(inner.polars.at(n).blend(outer.polars.at(n), share) for n in numbers)
    return _Section(
        PolarFamily(numbers, polars),
        (1.0 - share) * inner.thickness + share * outer.thickness,
        (1.0 - share) * inner.area + share * outer.area,
    )


def _pairs(rotor, table, named):
    """Return the two sections that each station lies between, and the share of the second."""
    if table.section is not None:
        missing = sorted({name for pair in table.section for name in pair[:2]} - set(named))
        if missing:
            raise InputError(
                f"names the section {missing[0]}, which rotor.sections does not have",
                f"give it there; known: {', '.join(named)}",
                file=rotor.blade,
            )
        return table.section, ()
    if table.thickness is None:
        raise InputError(
            f"says neither thickness nor section of its rows, but there are {len(named)} sections",
            "add a column t_over_c or section",
            file=rotor.blade,
        )
    by_thickness = sorted(named, key=lambda name: named[name].thickness)
    values = np.array([named[name].thickness for name in by_thickness])
    if np.any(np.diff(values) <= 0.0):
        raise InputError(
            "has two sections of one thickness", "keep one of them", key="rotor.sections"
        )
    messages = ()
    beyond = (table.thickness < values[0] - 1e-3) | (table.thickness > values[-1] + 1e-3)
    if np.any(beyond):
        messages = (
            f"{np.count_nonzero(beyond)} stations are thinner or thicker than every section "
            f"({values[0]:.3f} to {values[-1]:.3f}): they have the nearest one's polar",
        )
    place = np.interp(table.thickness, values, np.arange(values.size))
    inner = np.minimum(place.astype(int), values.size - 2)
    return tuple(
        (by_thickness[i], by_thickness[i + 1], float(share - i))
        for i, share in zip(inner, place, strict=True)
    ), messages


def _invariant(family: PolarFamily, number: float | None) -> Polar:
    """Return a family's one polar, or that of a Reynolds number."""
    if len(family.polars) == 1:
        return family.polars[0]
    if number is None:
        known = ", ".join(f"{value:.3g}" for value in family.reynolds)
        raise InputError(
            f"is needed to choose from polars at {known}",
            "give rotor.reynolds_number, or rotor.reynolds: local",
            key="rotor.reynolds_number",
        )
    return family.at(number)
