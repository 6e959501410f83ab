"""The rotor in files of OpenFAST 5: AeroDyn with its driver, and a rotor-only ElastoDyn.

The texts of the files are the templates beside this module; values that the user has to give are
marked FILL IN. `openfast_io` reads the files.
"""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Format, filled
from hkt_mdo.exports.solids import Airfoil, airfoils
from hkt_mdo.exports.tables import REVOLUTIONS
from hkt_mdo.results.design import Design
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.inertia import extended_to_ends
from hkt_mdo.rotor.loads import ATMOSPHERIC, VAPOUR
from hkt_mdo.rotor.strength import place_weights
from hkt_mdo.sections import Quantity, Section

MOST_BLADES = 3  # of ElastoDyn
UNKNOWN_DEPTH = 2.0  # rotor radii from the surface to the hub, where no case gives it
BED = 1.5  # rotor radii from the hub to the bed, where nothing gives it
PARTS = 4  # rows of ElastoDyn's blade between two places of the structure
WHOLE = (
    *("aerodyn_driver.dvr", "aerodyn.dat", "aerodyn_blade.dat", "airfoils/no_load.dat"),
    *("elastodyn.dat", "elastodyn_blade.dat", "elastodyn_tower.dat"),
)
"""Files of the whole rotor, each of a template."""


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

    def files(self, design: Design) -> dict[str, str]:
        blade = design.blade
        if blade.blade_count > MOST_BLADES:
            problem = f"takes {MOST_BLADES} blades, and the rotor has {blade.blade_count}"
            raise InputError(problem, "leave out openfast", key="--to", value="openfast")
        kinds, first = airfoils(design), design.solution.by_scenario[0]
        sections = {f"airfoils/section_{n:02d}.dat": kind for n, kind in enumerate(kinds, 1)}
        has_suction = all(polar.suction is not None for kind in kinds for polar in kind.polars)
        words = self._water(design) | self._cases(design)
        words |= {
            "options": self,
            "pressure": {"atmospheric": ATMOSPHERIC, "vapour": VAPOUR},
            "precone": 0.0 - float(np.rad2deg(blade.cone)),
            "rotor_speed": float(first.trajectory["rotor_speed_rad_s"][0]) * REVOLUTIONS,
            "has_suction": has_suction,
            "airfoils": [*sections, "airfoils/no_load.dat"],
            "aerodyn_rows": self._aerodyn_rows(blade, kinds),
            "elastodyn_rows": _elastodyn_rows(design),
        }
        texts = {name: filled(name.removeprefix("airfoils/"), design, words) for name in WHOLE}
        words["numbers"], columns = reynolds_numbers(design), 3 + has_suction
        for name, kind in sections.items():
            airfoil_words = _airfoil_words(design, kind, columns)
            texts[name] = filled("airfoil.dat", design, words | airfoil_words)
        return {f"openfast/{name}": text for name, text in texts.items()}

    def _water(self, design: Design) -> dict[str, Any]:
        """Return depths and heights (m)."""
        radius, physics = design.blade.rotor_radius, design.physics
        case_depth = physics.rotor.depth or physics.case.site.hub_depth
        depth = UNKNOWN_DEPTH * radius if case_depth is None else case_depth
        water = depth + BED * radius if self.water_depth is None else self.water_depth
        if water <= depth + radius:
            problem = f"is too small for the blades: the hub is {depth:.4g} m deep"
            remedy = f"give more than {depth + radius:.4g} m"
            raise InputError(problem, remedy, key="openfast.water_depth", value=self.water_depth)
        height = water - depth if self.mhk == 1 else -depth
        return {
            "water_depth": water,
            "hub_height": height,
            "hub_height_over_bed": water - depth,
            "tower_base": 0.0 if self.mhk == 1 else 0.5 * height,
            "depth_is_known": case_depth is not None,
            "unknown_depth": UNKNOWN_DEPTH,
            "bed": BED,
        }

    def _cases(self, design: Design) -> dict[str, Any]:
        """Return the flow speed (m/s) and the rotor speeds (rpm) of AeroDyn's driver."""
        flow = self.flow_speed or design.physics.scenarios[0].mean_flow
        asked = self.tip_speed_ratio
        curve = design.solution.table("coefficients")["tip_speed_ratio"]
        lowest = float(curve[0]) if asked.lowest is None else asked.lowest
        highest = float(curve[-1]) if asked.highest is None else asked.highest
        if lowest > highest:
            remedy = f"give a highest of at least {lowest:g}"
            key = "openfast.tip_speed_ratio.highest"
            raise InputError("is below the lowest", remedy, key=key, value=highest)
        ratios = np.linspace(lowest, highest, asked.count)
        speeds = ratios * flow / design.blade.rotor_radius * REVOLUTIONS
        return {"lowest": lowest, "highest": highest, "flow_speed": flow, "speeds": speeds.tolist()}

    def _aerodyn_rows(self, blade: Blade, kinds: list[Airfoil]) -> np.ndarray:
        """Return the rows of AeroDyn's blade: hub, stations and tip, with buoyancy or without."""
        shapes = np.empty((blade.r.size, 5))
        for number, (_, outline, stations) in enumerate(kinds, 1):
            shapes[stations] = number, outline.thickness, outline.area, *outline.centroid
        numbers, thickness, area, x, y = shapes.T
        zero, floats = np.zeros(blade.r.size), self.hub_volume is not None
        columns = [zero, zero, zero, np.rad2deg(blade.twist), blade.chord, numbers, thickness]
        columns += [4.0 / np.pi * area * floats, y * blade.chord, (x - 0.25) * blade.chord]
        columns += 5 * [zero]
        rows = np.column_stack((blade.edges - blade.hub_radius, *map(extended_to_ends, columns)))
        rows[[0, -1], 6] = len(kinds) + 1
        return rows


def _elastodyn_rows(design: Design) -> np.ndarray:
    """Return the rows of ElastoDyn's blade: hub, places along the stations, and tip."""
    blade, turbine, weights = design.blade, design.turbine, place_weights(design.blade.r.size)
    places, thickness = len(weights), blade.thickness
    structure, _ = turbine.structure.at(None if thickness is None else weights @ thickness)
    at = np.linspace(0.0, places - 1.0, PARTS * (places - 1) + 1)

    def fine(values):
        return np.interp(at, np.arange(places), np.broadcast_to(values, places))

    r, chord, twist = (fine(weights @ each) for each in (blade.r, blade.chord, blade.twist))
    area, *moments = map(fine, (structure.area, structure.xx, structure.yy))
    stiffness = [structure.modulus * moment * chord**4 for moment in moments]
    r = np.concatenate(([blade.hub_radius], r, [blade.tip_radius]))
    columns = np.rad2deg(twist), structure.density * area * chord**2, *stiffness
    return np.column_stack(((r - r[0]) / (r[-1] - r[0]), *map(extended_to_ends, columns)))


def _airfoil_words(design: Design, kind: Airfoil, columns: int) -> dict[str, Any]:
    """Return what the file of an airfoil names."""
    radii = (design.blade.r / design.blade.tip_radius)[kind.stations]
    return {
        "outline": kind.outline,
        "radii": ", ".join(f"{radius:.4g}" for radius in radii),
        "alpha_min": np.rad2deg(max(polar.alpha_min for polar in kind.polars)),
        "alpha_max": np.rad2deg(min(polar.alpha_max for polar in kind.polars)),
        "tables": [polar_rows(polar)[:, :columns] for polar in kind.polars],
    }


def reynolds_numbers(design: Design) -> list[float]:
    """Return the Reynolds numbers of the polars, as their files or the case say them.

    Parameters
    ----------
    design : Design
        The design of a result.

    Returns
    -------
    list of float
        One for each table of a section. Where the files say none or different ones, that of the
        case; without that, one of the operation.
    """
    turbine, physics, blade = design.turbine, design.physics, design.blade
    polar: Any = physics.rotor.polar
    if polar.follows_reynolds:
        return np.exp(polar.log_reynolds).tolist()
    numbers = np.unique(np.concatenate([section.polars.reynolds for section in turbine.sections]))
    numbers = numbers[np.isfinite(numbers)]
    number = numbers[0] if numbers.size == 1 else turbine.reynolds_number
    if number is None:
        best = physics.rotor.best_operation(blade).tip_speed_ratio
        flow = physics.scenarios[0].mean_flow * np.cos(blade.cone)
        speed = bem.sections(blade, polar, best).relative_speed[0] * flow
        number = np.median(speed * blade.chord) / physics.case.fluid.kinematic_viscosity
    return [float(number)]


def polar_rows(polar: Polar) -> np.ndarray:
    """Return a polar at the knots of its spline, from -180 to 180 degrees.

    Parameters
    ----------
    polar : Polar
        The polar of a section.

    Returns
    -------
    ndarray of shape (n_knots + 1, 3 or 4)
        Angle of attack (degrees), lift and drag coefficient, and the smallest pressure coefficient
        where it is known; the last row repeats the first.
    """
    values = polar.coefficients[:, [0, 4]]
    if polar.suction is not None:
        values = np.column_stack((values, -np.maximum(polar.suction[:, 0], polar.suction[:, 4])))
    alpha = np.linspace(-180.0, 180.0, len(values) + 1)
    return np.column_stack((alpha, np.vstack((values, values[:1]))))
