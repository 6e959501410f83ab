"""The turbine and the water: sections `rotor` and `fluid`."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, ValidationInfo, field_validator, model_validator

from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import POLAR_FAMILIES, locate, shipped_names, shipped_rotor
from hkt_mdo.sections import Quantity, Section, refusal


class SectionFile(Section):
    """One of several sections along the span."""

    name: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    """Name by which a blade file's column `section` calls it; null: its number, from 1."""

    polar: str
    """Lift and drag, as `rotor.polar`."""

    outline: str | None = None
    """Outline, as `rotor.outline`; null: that of the rotor, stretched to the thickness."""

    thickness: Annotated[float, Quantity(gt=0, le=1)] | None = None
    """Largest thickness over chord; null: the outline's own."""

    @field_validator("polar", "outline")
    @classmethod
    def _find_file(cls, value: str | None, info: ValidationInfo) -> str | None:
        return None if value is None else find_file(value, str(info.field_name), info)


class Rotor(Section):
    """The turbine's rotor: its size, its blade at the start, its sections and its inertia.

    What is null is taken from the blade: a shipped blade brings its own turbine with it, and a
    windIO file says nearly all.
    """

    radius: Annotated[float, Quantity("m", gt=0)] | None = None
    """Tip radius R, measured along the blade; null: the blade's own. A blade of another size is
    scaled to it."""

    hub_radius_fraction: Annotated[float, Quantity(gt=0, lt=1)] | None = None
    """Hub radius over tip radius; null: the blade's own, or 0.125 where its file does not say."""

    blade_count: Annotated[int, Strict(), Field(ge=1, le=10)] | None = None
    """Number of blades; two to six are usual. Null: the blade's own, or 3 where its file does not
    say."""

    cone: Annotated[float, Quantity("deg", ge=-45, le=45)] | None = None
    """Cone angle between the blades and the rotor plane; null: the blade's own, or 0."""

    stations: (
        Annotated[
            tuple[Annotated[float, Quantity(gt=0, lt=1)], ...], Field(min_length=3, max_length=200)
        ]
        | None
    ) = None
    """Radial stations r/R at which chord and twist are given, rising from above the hub to below 1;
    null: the rows of the blade's file between hub and tip.

    The paper says that its blade has nine segments; that these are nine stations is our assumption.
    """

    station_count: Annotated[int, Strict(), Field(ge=3, le=200)] | None = None
    """In place of `stations`: that many, closer together towards hub and tip (equal steps of the
    angle whose cosine is the radius), where the load changes fastest. Null: 40 where chord or twist
    are splines and no stations are given."""

    blade: str = "bahaj2007"
    """Blade at the start: a shipped name, or the path of a CSV file (columns such as `r_m, chord_m,
    twist_deg`, with units in their names, and optionally `section` or `t_over_c`), an AeroDyn 15
    blade file or a windIO turbine YAML.

    A relative path counts from the folder of the case file.
    """

    chord: tuple[Annotated[float, Quantity("m", gt=0)], ...] | None = None
    """Chord at each station; with `twist`, in place of the blade file."""

    twist: tuple[Annotated[float, Quantity("deg", ge=-180, le=180)], ...] | None = None
    """Twist from the rotor plane at each station, set angle included; with `chord`, in place of the
    blade file."""

    set_angle: Annotated[float, Quantity("deg", ge=-90, le=90)] | None = None
    """Set angle, added to the twist of the blade file; null: 5 degrees for bahaj2007, as in its
    tests, else 0."""

    polar: str | None = None
    """Section's lift and drag: a shipped name, or the path of a CSV file (`alpha_deg, cl, cd`), an
    AeroDyn airfoil table or an XFOIL polar; null: the blade's own, or naca63815_Re2e5."""

    outline: str | None = None
    """Section's outline, for thickness, area and inertia: a shipped name, or the path of a CSV file
    `x_over_c, y_over_c` or of a Selig or Lednicer file; null: the blade's own, or naca63815."""

    sections: Annotated[tuple[SectionFile, ...], Field(max_length=50)] = ()
    """Several sections along the span, in place of `polar` and `outline`: blended by the thickness
    that the blade file gives, or as it names them."""

    reynolds: Literal["invariant", "local"] = "invariant"
    """Whether the polar of a station follows its Reynolds number, chord times relative speed over
    the water's viscosity (`local`; the polar then has tables for several, and torque is computed at
    every node: `hydrodynamics.torque` is direct), or does not (`invariant`, the paper's
    assumption)."""

    reynolds_number: Annotated[float, Quantity(gt=0)] | None = None
    """Reynolds number at which an `invariant` polar with tables for several is read."""

    material_density: Annotated[float, Quantity("kg/m**3", gt=0)] = 2700.0
    """Density of the blade's material; the default is aluminium 6061, and the blade is solid."""

    hub_inertia: Annotated[float, Quantity("kg*m**2", ge=0)] = 0.0
    """Moment of inertia about the shaft of all that turns besides the blades."""

    @model_validator(mode="before")
    @classmethod
    def _fill_shipped(cls, data: Any) -> Any:
        """Write out what a shipped blade brings with it."""
        if not isinstance(data, dict):
            return data
        own = shipped_rotor(data.get("blade", cls.model_fields["blade"].default))
        if data.get("station_count") is not None or data.get("stations") is not None:
            own.pop("stations", None)
        if data.get("polar") is not None:
            own.pop("sections", None)
        if data.get("sections"):
            for key in ("polar", "outline"):
                own.pop(key, None)
        return own | {key: value for key, value in data.items() if value is not None}

    @field_validator("blade", "polar", "outline")
    @classmethod
    def _find_file(cls, value: str | None, info: ValidationInfo) -> str | None:
        return None if value is None else find_file(value, str(info.field_name), info)

    @model_validator(mode="after")
    def _check_stations(self) -> Rotor:
        if self.stations is not None and self.station_count is not None:
            raise refusal(
                "stands beside rotor.stations",
                "give one of the two",
                key="station_count",
                value=self.station_count,
            )
        stations = self.stations or ()
        for index, (inner, outer) in enumerate(pairwise(stations)):
            if not inner < outer:
                raise refusal(
                    f"stands after {inner:g}: stations must rise",
                    "sort the stations from hub to tip, none twice",
                    key=f"stations[{index + 1}]",
                    value=outer,
                )
        hub = self.hub_radius_fraction
        if stations and hub is not None and not stations[0] > hub:
            raise refusal(
                f"lies on or within the hub, whose radius is {hub:g} R",
                "move the first station outwards or lessen rotor.hub_radius_fraction",
                key="stations[0]",
                value=stations[0],
            )
        for name, other in (("chord", "twist"), ("twist", "chord")):
            column = getattr(self, name)
            if column is not None and getattr(self, other) is None:
                raise refusal(
                    f"is given without rotor.{other}",
                    f"give rotor.{other} too, or neither and name a blade",
                    key=name,
                    value=list(column),
                )
        for name in ("chord", "twist"):
            column = getattr(self, name)
            if column is not None and len(column) != len(stations):
                raise refusal(
                    f"has {len(column)} values for {len(stations)} stations",
                    "give one value for each of rotor.stations",
                    key=name,
                    value=list(column),
                )
        return self


def find_file(value: str, kind: str, info: ValidationInfo) -> str:
    """Return a shipped name as it is and a path as an absolute one, counted from the case's folder.

    Parameters
    ----------
    value : str
    kind : str
        What the file holds, as `hkt_mdo.files.shipped.shipped_names` knows it.
    info : ValidationInfo
        Its context has the folder, and whether the file must exist.

    Raises
    ------
    PydanticCustomError
        If it is neither a shipped name nor a file.
    """
    names = (*(POLAR_FAMILIES if kind == "polar" else ()), *shipped_names(kind))
    if value in names:
        return value
    context = info.context or {}
    try:
        path = (Path(context.get("folder", ".")) / value).resolve()
        if context.get("check_files", True):
            locate(path, kind)
    except (OSError, ValueError, RuntimeError):
        raise refusal("cannot be a path", _shipped(names)) from None
    except InputError:
        near = difflib.get_close_matches(value[:100], names, n=1)
        guess = f"did you mean {near[0]}? " if near else ""
        problem = f"is neither a shipped {kind} nor a file"
        raise refusal(problem, guess + _shipped(names)) from None
    return str(path)


def _shipped(names: Sequence[str]) -> str:
    return f"shipped: {', '.join(names)}; or give the path of a file"


class Fluid(Section):
    """The water."""

    density: Annotated[float, Quantity("kg/m**3", gt=0)] = 1000.0
    """Density of the water; the paper gives none, its tables imply this one."""

    kinematic_viscosity: Annotated[float, Quantity("m**2/s", gt=0)] = 1.0e-6
    """Kinematic viscosity, of use where `rotor.reynolds` is local; 1.0e-6 for fresh water at 20
    degrees Celsius, 1.2e-6 for the sea at 15."""
