"""The turbine and the water: sections `rotor` and `fluid`."""

from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field, Strict, ValidationInfo, model_validator

from hkt_mdo.errors import InputError, did_you_mean
from hkt_mdo.files.outline import coordinates_of
from hkt_mdo.files.shipped import MATERIALS, known_names, nearest_names, shipped_rotor
from hkt_mdo.sections import Flaws, Quantity, Section, find_file, refusal


def _find_file(value: str, info: ValidationInfo) -> str:
    """Return a shipped name as it is and a path as an absolute one, from the case's folder."""
    kind = str(info.field_name)
    if value in known_names(kind):
        return value
    problem = f"is neither a shipped {kind} nor a file"
    return find_file(value, info, problem, nearest_names(value, kind))


def _outline_of_polar(value: str | None, info: ValidationInfo) -> str | None:
    """Return the outline; without one the polar, if it has coordinates (AeroDyn), or the blade's.

    A table whose coordinates are missing can be read alone.
    """
    polar = info.data.get("polar")
    if value is None and polar:
        with suppress(InputError):
            value = polar if coordinates_of(Path(polar)) else None
        value = value or shipped_rotor(info.data.get("blade")).get("outline")
    return value


_File = Annotated[str, AfterValidator(_find_file)]
MOST_DRAW, MOST_SPREAD = 3.0, 0.3  # standard deviations; largest one, so that none is negative
_Outline = Annotated[_File | None, AfterValidator(_outline_of_polar), Field(validate_default=True)]
_Station = Annotated[float, Quantity(gt=0, lt=1)]
_SECTIONS = {"polar": {"sections", "outline"}, "sections": {"polar", "outline"}}
_IN_PLACE = _SECTIONS | {"station_count": {"stations"}}
"""By a key of a rotor that is given: the keys of a shipped blade that it replaces."""

_Wall = Annotated[float, Quantity(gt=0, le=0.5)]


class Material(Section):
    """What the blades are made of: a shipped name, or its properties along the blade."""

    bare: ClassVar[tuple[str, ...]] = tuple(MATERIALS)

    density: Annotated[float, Quantity("kg/m**3", gt=0)]
    """Density."""
    modulus: Annotated[float, Quantity("Pa", gt=0)]
    """Young's modulus, for the deflection of the tip."""
    allowable_stress: Annotated[float, Quantity("Pa", gt=0)] | None = None
    """Stress that `limits.stress: allowable` permits; divide it by your safety factor."""

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any) -> Any:
        """Take the name of a shipped material for its properties."""
        if not isinstance(data, str):
            return data
        if data not in MATERIALS:
            remedy = f"known: {', '.join(MATERIALS)}; or give density and modulus"
            raise refusal("unknown material", did_you_mean(data, MATERIALS) + remedy)
        return MATERIALS[data]


class SectionMoments(Section):
    """Second moments of area of a section's material over the fourth power of its chord.

    About its centroid; x is along the chord towards the trailing edge, y across it towards the
    suction side.
    """

    flapwise: Annotated[float, Quantity(gt=0)]
    """Integral of y² dA: bending about the chord line."""
    edgewise: Annotated[float, Quantity(gt=0)]
    """Integral of x² dA: bending about the axis across the chord."""
    product: Annotated[float, Quantity()] = 0.0
    """Integral of x y dA."""

    def flaws(self) -> Flaws:
        if self.product**2 >= self.flapwise * self.edgewise:
            largest = (self.flapwise * self.edgewise) ** 0.5
            problem = f"is not less than sqrt(flapwise * edgewise) = {largest:.4g}, as in any area"
            yield "product", problem, "correct one of the three"


class SectionFile(Section):
    """One of several sections along the span."""

    name: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    """Name of the section in the blade file's column `section`; null: its number, from 1."""
    polar: _File
    """Lift and drag of the section, given as `rotor.polar`."""
    outline: _Outline = None
    """Outline, as `rotor.outline`; null: that which the polar names, or the rotor's, stretched to
    the thickness, with a note."""
    thickness: Annotated[float, Quantity(gt=0, le=1)] | None = None
    """Largest thickness over chord; null: that of the outline."""
    wall: _Wall | None = None
    """Thickness of the section's wall over its chord; null: `rotor.wall`. 0.5 is solid."""
    area: Annotated[float, Quantity(gt=0, le=1)] | None = None
    """Area of material over chord squared, for mass and centrifugal force; null: from outline and
    wall."""
    second_moments: SectionMoments | None = None
    """Second moments of area, for stress and deflection; null: from outline and wall."""


class Rotor(Section):
    """The rotor: size, blade at the start, sections and inertia.

    A null is taken from the blade: a shipped one has all values, a windIO file nearly all.
    """

    radius: Annotated[float, Quantity("m", gt=0, le=1000)] | None = None
    """Tip radius R, measured along the blade; null: the blade's own. A blade of another radius is
    scaled, one of a CSV file in metres never."""
    hub_radius_fraction: Annotated[float, Quantity(gt=0, lt=1)] | None = None
    """Hub radius over tip radius; null: the blade's own, or 0.125."""
    blade_count: Annotated[int, Strict(), Field(ge=1, le=10)] | None = None
    """Number of blades; null: the blade's own, or 3."""
    cone: Annotated[float, Quantity("deg", ge=-45, le=45)] | None = None
    """Cone angle between the blades and the rotor plane; null: the blade's own, or 0."""
    stations: Annotated[tuple[_Station, ...], Field(min_length=3, max_length=200)] | None = None
    """Rising stations r/R of chord and twist between hub and tip; null: the rows of the blade's
    file."""
    station_count: Annotated[int, Strict(), Field(ge=3, le=200)] | None = None
    """Number of stations in place of `stations`, closer together towards hub and tip. Null: 40 if
    chord or twist are splines or the case has limits; otherwise those of the blade."""
    blade: _File = "bahaj2007"
    """Blade at the start: a shipped name, or the path of a CSV file (columns such as `r_m, chord_m,
    twist_deg`, optionally `section` or `t_over_c`), an AeroDyn 15 blade file or a windIO turbine.
    """
    chord: tuple[Annotated[float, Quantity("m", gt=0)], ...] | None = None
    """Chord at each station; given with `twist`, in place of the blade file."""
    twist: tuple[Annotated[float, Quantity("deg", ge=-180, le=180)], ...] | None = None
    """Twist from the rotor plane at each station, including the set angle; given with `chord`."""
    set_angle: Annotated[float, Quantity("deg", ge=-90, le=90)] | None = None
    """Set angle, added to the twist of the blade file; null: 5 degrees for bahaj2007, else 0."""
    polar: _File | None = None
    """Lift and drag: a shipped name, or the path of a CSV file (`alpha_deg, cl, cd`, or of
    airfoiltools.com), an AeroDyn airfoil table or a polar of XFOIL or XFLR5; null: the blade's own,
    or naca63815_Re2e5."""
    outline: _Outline = None
    """Outline, for thickness, mass and stress: a shipped name, or the path of a CSV file
    (`x_over_c, y_over_c`), of a Selig or Lednicer file, or of AeroDyn's coordinates; null: that
    which the `polar` names, or the blade's own, or naca63815."""
    sections: Annotated[tuple[SectionFile, ...], Field(max_length=50)] = ()
    """Several sections in place of `polar` and `outline`, blended along the blade by thickness or
    by name, as in the blade file."""
    reynolds: Literal["invariant", "local"] = "invariant"
    """`local`: each station's polar follows its Reynolds number, which needs tables for several;
    `invariant`: it does not."""
    reynolds_number: Annotated[float, Quantity(gt=0)] | None = None
    """Reynolds number at which an `invariant` polar with several tables is read; null: for a windIO
    file, midway in the logarithm."""
    material: Material = Field(default="aluminium_6061_t6", validate_default=True)  # type: ignore[assignment]
    """Material of the blades: a shipped name, or its properties."""
    material_density: Annotated[float, Quantity("kg/m**3", gt=0)] | None = None
    """Density of the blades, in place of the material's."""
    modulus: Annotated[float, Quantity("Pa", gt=0)] | None = None
    """Young's modulus of the blades, in place of the material's."""
    wall: _Wall | None = None
    """Wall thickness of hollow blades over the chord; null: solid blades. The inside has no weight
    and carries no load. Buckling is not checked."""
    hub_inertia: Annotated[float, Quantity("kg*m**2", ge=0)] = 0.0
    """Moment of inertia about the shaft of everything that turns except the blades."""
    added_inertia: Literal["none", "plate", "ellipse"] = "none"
    """The water that the blades accelerate, as part of the inertia, as of flat plates or of
    ellipses (docs/rotor_model.md)."""

    @classmethod
    def spelled_out(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Fill in the keys that a shipped blade brings with it."""
        shipped = shipped_rotor(data.get("blade", cls.model_fields["blade"].default))
        stated = {key: x for key, x in data.items() if x is not None and (key != "sections" or x)}
        replaced = {name for key in stated for name in _IN_PLACE.get(key, ())}
        return {key: x for key, x in shipped.items() if key not in replaced} | stated

    @property
    def blade_material(self) -> Material:
        """The material of the blades, with the density and the modulus that stand beside it."""
        beside = {"density": self.material_density, "modulus": self.modulus}
        changes = {key: value for key, value in beside.items() if value is not None}
        return self.material.model_copy(update=changes)

    def flaws(self) -> Flaws:
        stations = self.stations or ()
        for name, other in (("polar", "sections"), ("station_count", "stations")):
            if getattr(self, name) is not None and getattr(self, other):
                yield name, f"is given together with rotor.{other}", "give one of the two"
        for index, (inner, outer) in enumerate(pairwise(stations), start=1):
            if not inner < outer:
                problem = f"stands after {inner:g}: stations must increase"
                yield f"stations[{index}]", problem, "sort the stations from hub to tip, none twice"
        for name, other in (("chord", "twist"), ("twist", "chord")):
            column = getattr(self, name)
            if column is not None and getattr(self, other) is None:
                remedy = f"give rotor.{other} too, or neither and name a blade"
                yield name, f"is given without rotor.{other}", remedy
            if column is not None and len(column) != len(stations):
                problem = f"has {len(column)} values for {len(stations)} stations"
                yield name, problem, "give one value for each of rotor.stations"


def own_keys(rotor: dict[str, Any]) -> dict[str, Any]:
    """Return the keys of a section `rotor` (JSON) that have the values of its shipped blade."""
    blade = rotor.get("blade", Rotor.model_fields["blade"].default)
    shipped = Rotor(blade=blade).model_dump(mode="json") if (keys := shipped_rotor(blade)) else {}
    return {key: shipped[key] for key in keys if rotor.get(key) == shipped[key]}


class Site(Section):
    """Where the turbine stands."""

    hub_depth: Annotated[float, Quantity("m", gt=0)] | None = None
    """Depth of the hub below the surface, for cavitation."""


class Condition(Section):
    """How the actual turbine differs from the design, such as by fouled sections."""

    lift: Annotated[float, Quantity(gt=0, le=2)] = 1.0
    """Factor on the lift coefficients of all sections."""
    drag: Annotated[float, Quantity(gt=0, le=20)] = 1.0
    """Factor on the drag coefficients of all sections."""
    polar: _File | None = None
    """Lift and drag of the one section in place of `rotor.polar`, before the factors."""
    inertia: Annotated[float, Quantity(gt=0, le=20)] = 1.0
    """Factor on the rotor's moment of inertia."""
    torque_constant: Annotated[float, Quantity(gt=0, le=2)] = 1.0
    """Torque on the rotor over the torque that a feedback law demands, after its limit."""

    @property
    def fouls(self) -> bool:
        """Whether the sections have other lift or drag."""
        return (self.lift, self.drag, self.polar) != (1.0, 1.0, None)


_Deviation = Annotated[float, Quantity(ge=0, lt=MOST_SPREAD)]


class Spread(Section):
    """Standard deviations of the realizations about the scenario, normal and cut off at three."""

    lift: _Deviation = 0.0
    """Deviation of the lift factor."""
    drag: _Deviation = 0.0
    """Deviation of the drag factor."""
    inertia: _Deviation = 0.0
    """Deviation of the inertia factor."""
    torque_constant: _Deviation = 0.0
    """Deviation of the factor on the torque of a feedback law."""
    density: Annotated[float, Quantity("kg/m**3", ge=0, le=100)] = 0.0
    """Deviation of the density."""
    seed: Annotated[int, Strict(), Field(ge=0, lt=2**63)] = 1
    """Seed of the draws."""

    def drawn(self, condition: Condition, density: float, number: int) -> dict[str, Any]:
        """Return `condition` of the turbine and `density` of the water (kg/m**3) of a number."""
        names = "lift", "drag", "inertia", "torque_constant"
        draws = np.random.default_rng((self.seed, number)).standard_normal(len(names) + 1)
        *factors, last = np.clip(draws, -MOST_DRAW, MOST_DRAW).tolist()
        moved = {
            name: getattr(condition, name) + getattr(self, name) * draw
            for name, draw in zip(names, factors, strict=True)
        }
        condition = condition.model_copy(update=moved)
        return {"condition": condition, "density": density + self.density * last}


class Fluid(Section):
    """The water."""

    density: Annotated[float, Quantity("kg/m**3", gt=0, le=20000)] = 1000.0
    """Density of the water."""
    kinematic_viscosity: Annotated[float, Quantity("m**2/s", gt=0)] = 1.0e-6
    """Kinematic viscosity, used if `rotor.reynolds` is local; of sea water at 15 degrees Celsius
    1.2e-6."""
