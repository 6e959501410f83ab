"""The turbine and the water: sections `rotor` and `fluid`."""

from __future__ import annotations

import difflib
from itertools import pairwise
from pathlib import Path
from typing import Annotated

from pydantic import Field, Strict, ValidationInfo, field_validator, model_validator

from hkt_mdo.case.base import Quantity, Section, refusal
from hkt_mdo.data import locate, shipped_names
from hkt_mdo.errors import InputError


class Rotor(Section):
    """The turbine's rotor: its size, its blade at the start, its section and its inertia."""

    radius: Annotated[float, Quantity("m", gt=0)] = 1.4
    """Tip radius R."""

    hub_radius_fraction: Annotated[float, Quantity(gt=0, lt=1)] = 0.125
    """Hub radius over tip radius."""

    blade_count: Annotated[int, Strict(), Field(ge=1, le=10)] = 3
    """Number of blades; two to six are usual."""

    stations: Annotated[
        tuple[Annotated[float, Quantity(gt=0, lt=1)], ...], Field(min_length=3, max_length=200)
    ] = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.999)
    """Radial stations r/R at which chord and twist are given, rising from above the hub to below 1.

    The paper says that the blade has nine segments; that these are nine stations is our assumption.
    """

    blade: str = "bahaj2007"
    """Blade at the start: a shipped name, or the path of a CSV file `r_over_R,c_over_R,pitch_deg`.

    A relative path counts from the folder of the case file.
    """

    chord: tuple[Annotated[float, Quantity("m", gt=0)], ...] | None = None
    """Chord at each station; with `twist`, in place of the blade file."""

    twist: tuple[Annotated[float, Quantity("deg", ge=-180, le=180)], ...] | None = None
    """Twist from the rotor plane at each station, set angle included; with `chord`, in place of the
    blade file."""

    set_angle: Annotated[float, Quantity("deg", ge=-90, le=90)] = 5.0
    """Set angle, added to the pitch column of the blade file."""

    polar: str = "naca63815_Re2e5"
    """Section's lift and drag: a shipped name, or the path of a CSV file `alpha_deg,cl,cd` (and
    `cm`)."""

    outline: str = "naca63815"
    """Section's outline, for area and inertia: a shipped name, or the path of a CSV file
    `x_over_c,y_over_c`."""

    material_density: Annotated[float, Quantity("kg/m**3", gt=0)] = 2700.0
    """Density of the blade's material; the default is aluminium 6061, and the blade is solid."""

    hub_inertia: Annotated[float, Quantity("kg*m**2", ge=0)] = 0.0
    """Moment of inertia about the shaft of all that turns besides the blades."""

    @field_validator("blade", "polar", "outline")
    @classmethod
    def _find_file(cls, value: str, info: ValidationInfo) -> str:
        kind = str(info.field_name)
        if value in shipped_names(kind):
            return value
        context = info.context or {}
        try:
            path = (Path(context.get("folder", ".")) / value).resolve()
            if context.get("check_files", True):
                locate(path, kind)
        except (OSError, ValueError, RuntimeError):
            raise refusal("cannot be a path", _shipped(kind)) from None
        except InputError:
            near = difflib.get_close_matches(value[:100], shipped_names(kind), n=1)
            guess = f"did you mean {near[0]}? " if near else ""
            problem = f"is neither a shipped {kind} nor a file"
            raise refusal(problem, guess + _shipped(kind)) from None
        return str(path)

    @model_validator(mode="after")
    def _check_stations(self) -> Rotor:
        for index, (inner, outer) in enumerate(pairwise(self.stations)):
            if not inner < outer:
                raise refusal(
                    f"stands after {inner:g}: stations must rise",
                    "sort the stations from hub to tip, none twice",
                    key=f"stations[{index + 1}]",
                    value=outer,
                )
        if not self.stations[0] > self.hub_radius_fraction:
            raise refusal(
                f"lies on or within the hub, whose radius is {self.hub_radius_fraction:g} R",
                "move the first station outwards or lessen rotor.hub_radius_fraction",
                key="stations[0]",
                value=self.stations[0],
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
            if column is not None and len(column) != len(self.stations):
                raise refusal(
                    f"has {len(column)} values for {len(self.stations)} stations",
                    "give one value for each of rotor.stations",
                    key=name,
                    value=list(column),
                )
        return self


def _shipped(kind: str) -> str:
    return f"shipped: {', '.join(shipped_names(kind))}; or give the path of a CSV file"


class Fluid(Section):
    """The water."""

    density: Annotated[float, Quantity("kg/m**3", gt=0)] = 1000.0
    """Density of the water; the paper gives none, its tables imply this one."""
