"""The rotor in files of OpenFAST 5: AeroDyn with its driver, and a rotor-only ElastoDyn.

The texts of the files are the templates beside this module; values that the user has to give are
marked FILL IN. `openfast_io` reads the files.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Format, Source, filled
from hkt_mdo.exports.solids import station_outlines
from hkt_mdo.exports.tables import REVOLUTIONS
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.bem import station_polars
from hkt_mdo.rotor.inertia import extended_to_ends
from hkt_mdo.rotor.loads import Cavitation
from hkt_mdo.rotor.reynolds import LocalReynolds
from hkt_mdo.rotor.strength import Structure, place_weights
from hkt_mdo.sections import Quantity, Section

MOST_BLADES = 3  # of ElastoDyn
UNKNOWN_DEPTH = 2.0  # rotor radii from the surface to the hub, where no case gives it
BED = 1.5  # rotor radii from the hub to the bed, where nothing gives it
STIFF = 1e10  # Pa, modulus of a blade that has none; its modes are switched off
PARTS = 4  # rows of ElastoDyn's blade between two places of the structure
TOWER_DIAMETER = 0.1  # rotor radii


class TipSpeedRatios(Section):
    """Which tip speed ratios AeroDyn's driver computes."""

    lowest: Annotated[float, Quantity(gt=0)] | None = None
    """The lowest; null: the first of the result's power curve."""
    highest: Annotated[float, Quantity(gt=0)] | None = None
    """The highest; null: the last of the result's power curve."""
    count: Annotated[int, Field(strict=True, ge=1, le=1000)] = 21
    """How many, equally spaced."""


class OpenFast(Format):
    """AeroDyn blade, airfoils, primary file and driver, and a rotor-only ElastoDyn."""

    name: ClassVar[str] = "openfast"

    tip_speed_ratio: TipSpeedRatios = TipSpeedRatios()
    """Range of AeroDyn's driver."""
    flow_speed: Annotated[float, Quantity("m/s", gt=0)] | None = None
    """Speed of the flow there; null: the mean of the first scenario's."""
    mhk: Literal[1, 2] = 1
    """1: the turbine stands on the bed, 2: it floats."""
    water_depth: Annotated[float, Quantity("m", gt=0)] | None = None
    """Depth of the water; null: that of the hub and 1.5 rotor radii, to be filled in."""
    hub_volume: Annotated[float, Quantity("m**3", gt=0)] | None = None
    """Volume of the hub, with which AeroDyn computes buoyancy; null: no buoyancy of hub and blades,
    since AeroDyn takes both or none."""

    def files(self, source: Source) -> dict[str, bytes]:
        rotor = _Rotor(source)
        if rotor.blade.blade_count > MOST_BLADES:
            problem = f"takes {MOST_BLADES} blades, and the rotor has {rotor.blade.blade_count}"
            raise InputError(problem, "leave out openfast", key="--to", value=self.name)
        words = rotor.words | self._water(rotor) | self._cases(rotor)
        words["provenance"] = "; ".join(source.provenance)
        words["hub_volume"] = self.hub_volume or 0.0
        airfoils = {f"airfoils/{name}": text for name, text in rotor.airfoil_files(words).items()}
        words["airfoils"] = list(airfoils)
        names = ("aerodyn_driver.dvr", "aerodyn.dat", "elastodyn.dat", "elastodyn_tower.dat")
        texts = {name: filled(name, words) for name in names}
        blades = {"aerodyn_blade.dat": rotor.rows(self.hub_volume is not None)}
        for name, rows in (blades | {"elastodyn_blade.dat": rotor.elastic}).items():
            table = {"count": len(rows), "rows": "\n".join(map(_row, rows))}
            texts[name] = filled(name, words | table)
        return {f"openfast/{name}": text.encode() for name, text in (texts | airfoils).items()}

    def _water(self, rotor: _Rotor) -> dict[str, Any]:
        """Return depths and heights (m), and remarks on those that are assumed."""
        radius, cavitation = rotor.blade.rotor_radius, rotor.world.rotor.cavitation
        known = cavitation.depth if cavitation else rotor.world.case.site.hub_depth
        depth = UNKNOWN_DEPTH * radius if known is None else known
        water = depth + BED * radius if self.water_depth is None else self.water_depth
        if water <= depth + radius:
            problem = f"is too small for the blades: the hub is {depth:.4g} m deep"
            remedy = f"give more than {depth + radius:.4g} m"
            raise InputError(problem, remedy, key="openfast.water_depth", value=self.water_depth)
        height = water - depth if self.mhk == 1 else -depth
        assumed = f" FILL IN: a hub {UNKNOWN_DEPTH:g} rotor radii deep is assumed"
        deep = f" FILL IN: {BED:g} rotor radii from hub to bed are assumed"
        return {
            "mhk": self.mhk,
            "water_depth": water,
            "hub_height": height,
            "hub_height_over_bed": water - depth,
            "tower_top": height,
            "tower_base": 0.0 if self.mhk == 1 else 0.5 * height,
            "depth_mark": assumed if known is None else "",
            "water_depth_mark": deep if self.water_depth is None else "",
            "cavitation": known is not None and rotor.has_suction,
        }

    def _cases(self, rotor: _Rotor) -> dict[str, Any]:
        """Return the rows of AeroDyn's driver."""
        flow = self.flow_speed or rotor.world.scenarios[0].mean_flow
        asked = self.tip_speed_ratio
        curve = rotor.solution.table("coefficients")["tip_speed_ratio"]
        lowest = float(curve[0]) if asked.lowest is None else asked.lowest
        highest = float(curve[-1]) if asked.highest is None else asked.highest
        if lowest > highest:
            remedy = f"give a highest of at least {lowest:g}"
            key = "openfast.tip_speed_ratio.highest"
            raise InputError("is below the lowest", remedy, key=key, value=highest)
        ratios = np.linspace(lowest, highest, asked.count)
        speeds = ratios * flow / rotor.blade.rotor_radius * REVOLUTIONS
        rows = [f"{flow!r} 0 {float(speed)!r} 0 0 0.1 0.1 0 0 0" for speed in speeds]
        words = {"lowest": lowest, "highest": highest, "count": asked.count, "flow_speed": flow}
        return words | {"cases": "\n".join(rows)}


class _Rotor:
    """The rotor of a result in the form of the files."""

    def __init__(self, source: Source) -> None:
        self.solution, self.design = source.solution, source.design
        self.blade, self.world = self.design.blade, self.design.physics

    @cached_property
    def polars(self) -> tuple[tuple[Polar, ...], ...]:
        """The tables of each station: one, or those of the Reynolds numbers."""
        rotor = self.world.rotor.as_built(self.blade)
        return station_polars(rotor.polar, self.blade.r.size)

    @property
    def has_suction(self) -> bool:
        """Whether the smallest pressure is known of all sections."""
        return all(polar.suction is not None for tables in self.polars for polar in tables)

    @property
    def reynolds(self) -> list[float]:
        """Reynolds numbers of the tables, in millions; that of a single table has no effect."""
        polar = self.world.rotor.polar
        if not isinstance(polar, LocalReynolds):
            return [1.0]
        return list(np.exp(polar.log_reynolds) / 1e6)

    @cached_property
    def sections(self) -> np.ndarray:
        """Thickness, area and centroid x, y of the stations over powers of the chord, (4, n)."""
        outlines = station_outlines(self.design)
        return np.array([(x.thickness, x.area, *x.centroid) for x in outlines]).T

    @cached_property
    def _kinds(self) -> dict[tuple, list[int]]:
        """The stations that share an airfoil file, by its polars and suction."""
        kinds: dict[tuple, list[int]] = {}
        for station, tables in enumerate(self.polars):
            thickness, area = self.sections[:2, station]
            kinds.setdefault((*tables, thickness, area), []).append(station)
        return kinds

    @property
    def words(self) -> dict[str, Any]:
        """The values of rotor and water for the templates."""
        blade = self.blade
        speed = float(self.solution.by_scenario[0].trajectory["rotor_speed_rad_s"][0])
        modulus = self.design.turbine.structure.modulus
        return {
            "blade": blade,
            "fluid": self.world.case.fluid,
            "pressure": self.world.rotor.cavitation or Cavitation,  # with its defaults
            "precone": 0.0 - float(np.rad2deg(blade.cone)),
            "tower_diameter": TOWER_DIAMETER * float(blade.rotor_radius),
            "rotor_speed": speed * REVOLUTIONS,
            "hub_inertia": self.world.rotor.hub_of(blade),
            "inertia": float(self.design.inertia),
            "stiffness_mark": "" if modulus else " FILL IN: the material's modulus is unknown",
            "table_mode": 2 if self.world.rotor.follows_reynolds else 1,
            "pressure_column": 4 * self.has_suction,
            "pressure_channels": ", CpMin" * self.has_suction,
        }

    def rows(self, floats: bool) -> np.ndarray:
        """Return the rows of AeroDyn's blade: hub, stations and tip, with buoyancy or without."""
        blade, (thickness, area, x, y) = self.blade, self.sections
        number = np.empty(blade.r.size)
        for place, stations in enumerate(self._kinds.values(), 1):
            number[stations] = place
        zero = np.zeros(blade.r.size)
        columns = [zero, zero, zero, np.rad2deg(blade.twist), blade.chord, number, thickness]
        columns += [
            4.0 / np.pi * area * floats,
            y * blade.chord,
            (x - 0.25) * blade.chord,
            *[zero] * 5,
        ]
        rows = np.column_stack((blade.edges - blade.hub_radius, *map(extended_to_ends, columns)))
        rows[[0, -1], 6] = len(self._kinds) + 1
        return rows

    @property
    def elastic(self) -> np.ndarray:
        """Rows of ElastoDyn's blade: hub, places along the stations, and tip."""
        blade, turbine, weights = self.blade, self.design.turbine, place_weights(self.blade.r.size)
        structure, places = turbine.structure, len(weights)
        if not isinstance(structure, Structure):
            structure = structure.at(weights @ blade.thickness)
        at = np.linspace(0.0, places - 1.0, PARTS * (places - 1) + 1)

        def fine(values):
            return np.interp(at, np.arange(places), np.broadcast_to(values, places))

        area = turbine.section_area
        area = np.broadcast_to(area(blade.thickness) if callable(area) else area, blade.r.shape)
        r, chord, twist, area = (
            fine(weights @ each) for each in (blade.r, blade.chord, blade.twist, area)
        )
        modulus, mass = structure.modulus or STIFF, self.world.rotor.material_density * area
        stiffness = [modulus * fine(moment) * chord**4 for moment in (structure.xx, structure.yy)]
        r = np.concatenate(([blade.hub_radius], r, [blade.tip_radius]))
        columns = np.rad2deg(twist), mass * chord**2, *stiffness
        return np.column_stack(((r - r[0]) / (r[-1] - r[0]), *map(extended_to_ends, columns)))

    def airfoil_files(self, words: dict[str, Any]) -> dict[str, str]:
        """Return the texts of the airfoil files by their names."""
        texts = {}
        places = self.blade.r / self.blade.tip_radius
        for number, ((*tables, thickness, area), stations) in enumerate(self._kinds.items(), 1):
            radii = ", ".join(f"{place:.4g}" for place in places[stations])
            own = {
                "where": f"the stations at r/R = {radii}",
                "thickness": thickness,
                "area": area,
                "table_count": len(tables),
                "alpha_min": f"{np.rad2deg(max(polar.alpha_min for polar in tables)):.6g}",
                "alpha_max": f"{np.rad2deg(min(polar.alpha_max for polar in tables)):.6g}",
            }
            parts = [filled("airfoil.dat", words | own)]
            for reynolds, polar in zip(self.reynolds, tables, strict=True):
                parts.append(_table(polar, reynolds, self.has_suction))
            texts[f"section_{number:02d}.dat"] = "".join(parts)
        return texts | {"no_load.dat": filled("no_load.dat", words)}


def polar_rows(polar: Polar) -> np.ndarray:
    """Return a polar at the knots of its spline, from -180 to 180 degrees.

    Parameters
    ----------
    polar : Polar
        The polar of a section.

    Returns
    -------
    ndarray of shape (n_knots + 1, 3)
        Angle of attack (degrees), lift and drag coefficient; the last row repeats the first.
    """
    values = polar.coefficients[:, [0, 4]]
    alpha = np.linspace(-180.0, 180.0, len(values) + 1)
    return np.column_stack((alpha, np.vstack((values, values[:1]))))


def _table(polar: Polar, reynolds: float, with_suction: bool) -> str:
    """Return the lines of a polar, with the smallest pressure if it is known everywhere."""
    rows, suction = polar_rows(polar), ("", "")
    if with_suction and polar.suction is not None:
        pressure = -np.maximum(polar.suction[:, 0], polar.suction[:, 4])
        rows = np.column_stack((rows, np.append(pressure, pressure[0])))
        suction = "    Cpmin", "   (-)"
    words = {"reynolds": f"{reynolds:.9g}", "count": len(rows)}
    words |= {"suction": suction[0], "unit": suction[1], "rows": "\n".join(map(_row, rows))}
    return filled("polar.dat", words)


def _row(values) -> str:
    """Return numbers as a row of a file, to 13 digits."""
    return "  ".join(f"{value:.13g}" for value in values)
