"""The whole case, and the way from YAML text to it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from hkt_mdo.case.control import Control, Feedback
from hkt_mdo.case.design import Design, Driver, Hydrodynamics, Phase, Start
from hkt_mdo.case.inflow import Inflow
from hkt_mdo.case.messages import translate
from hkt_mdo.case.turbine import Fluid, Rotor
from hkt_mdo.case.yaml_text import Dumper, parse
from hkt_mdo.errors import InputError
from hkt_mdo.files.cases import find_case
from hkt_mdo.files.shipped import read_bytes
from hkt_mdo.sections import Section, refusal

STATION_COUNT = 40
"""Stations of a blade of splines: within 0.1 % of the energy at any number of them."""

MAX_CASE_BYTES = 1024**2
"""Largest case file that is read, in bytes."""


class Case(Section):
    """One experiment: a turbine in a flow under a control law, and how it is optimized."""

    name: Annotated[
        str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$", min_length=1, max_length=100)
    ] = "case"
    """Name of the case and of its results: letters, digits, `_`, `-` and `.`; by default the case
    file's own name."""

    rotor: Rotor = Rotor()
    """The rotor."""

    fluid: Fluid = Fluid()
    """The water."""

    inflow: Inflow
    """Inflow speed over time; `profile` says which kind."""

    control: Control
    """Control law; `law` says which."""

    design: Design = Design()
    """What may be changed, and how far."""

    phase: Phase = Phase()
    """The time span and its discretization."""

    start: Start = Start()
    """Where the optimization begins."""

    hydrodynamics: Hydrodynamics = Hydrodynamics()
    """How the rotor's torque is computed."""

    driver: Driver = Driver()
    """The optimizer and the package that provides it."""

    @model_validator(mode="before")
    @classmethod
    def _fill_stations(cls, data: Any) -> Any:
        """Give a blade of splines the stations that resolve it; see docs/stations.md."""
        if not isinstance(data, dict):
            return data
        design, rotor = data.get("design"), data.get("rotor", {})
        if isinstance(rotor, Rotor) or not isinstance(design, dict) or not isinstance(rotor, dict):
            return data
        splined = any(design.get(name) is not None for name in ("chord_points", "twist_points"))
        own = any(rotor.get(name) is not None for name in ("stations", "station_count", "chord"))
        if splined and not own:
            return data | {"rotor": rotor | {"station_count": STATION_COUNT}}
        return data

    @model_validator(mode="after")
    def _check_start(self) -> Case:
        """Hold the start to the bounds of the design."""
        bounds = self.design.gain_bounds
        if bounds is not None:
            if not isinstance(self.control, Feedback):
                raise refusal(
                    f"bounds a gain that the law {self.control.law} does not have",
                    "leave design.gain_bounds out, or choose a feedback law",
                    key="design.gain_bounds",
                    value=list(bounds),
                )
            gain = self.control.gain
            if gain is not None and not bounds[0] <= gain <= bounds[1]:
                raise _outside("control.gain", gain, "design.gain_bounds", bounds)
        for name in ("bem", "check"):
            if self.rotor.reynolds == "local" and getattr(self.hydrodynamics, name) == "ccblade":
                raise refusal(
                    "takes the Reynolds number of the induced speed, not that of rotor.reynolds",
                    "give vectorized, or rotor.reynolds: invariant",
                    key=f"hydrodynamics.{name}",
                    value="ccblade",
                )
        radius, limits = self.rotor.radius, self.design.radius_bounds
        if radius is not None and limits is not None and not limits[0] <= radius <= limits[1]:
            raise _outside("rotor.radius", radius, "design.radius_bounds", limits)
        angle, limits = self.rotor.set_angle or 0.0, self.design.set_angle_bounds
        if limits is not None and not limits[0] <= angle <= limits[1]:
            raise _outside("rotor.set_angle", angle, "design.set_angle_bounds", limits)
        if self.design.blade == "optimized":
            for name in ("chord", "twist"):
                limits = getattr(self.design, f"{name}_bounds")
                for index, value in enumerate(getattr(self.rotor, name) or ()):
                    if not limits[0] <= value <= limits[1]:
                        key = f"rotor.{name}[{index}]"
                        raise _outside(key, value, f"design.{name}_bounds", limits)
        return self

    def to_yaml(self) -> str:
        """Return the case as YAML with every default written out.

        Returns
        -------
        str
            The same text for equal cases; `read_case` makes an equal case of it.
        """
        return yaml.dump(
            self.model_dump(mode="json"),
            Dumper=Dumper,
            sort_keys=False,
            allow_unicode=True,
            width=100,
        )

    def with_overrides(self, *overrides: str) -> Case:
        """Return a case in which some keys have other values.

        Parameters
        ----------
        *overrides : str
            Such as ``rotor.radius=2`` or ``control={law: linear}``; relative paths count from the
            current folder.

        Returns
        -------
        Case
            The changed case, checked as a file would be.

        Raises
        ------
        InputError
            If an override is malformed or makes the case invalid.
        """
        return read_case(self.to_yaml(), overrides, file=f"case {self.name}")


def _outside(
    key: str, value: float, bounds_key: str, bounds: tuple[float, float]
) -> PydanticCustomError:
    return refusal(
        f"lies outside {bounds_key} = [{bounds[0]:g}, {bounds[1]:g}]",
        "the start must lie within the bounds: change one or the other",
        key=key,
        value=value,
    )


# Reading ------------------------------------------------------------------------------------------


def load_case(path: str | Path, overrides: Sequence[str] = (), *, check_files: bool = True) -> Case:
    """Read a case file.

    Parameters
    ----------
    path : str or pathlib.Path
        A YAML file, or the name of a shipped case where no such file exists.
    overrides : sequence of str
        Such as ``rotor.radius=2``; what stands after the first ``=`` is YAML.
    check_files : bool
        Whether the CSV files that the case names must exist; a result is looked at without them.

    Returns
    -------
    Case
        Named after the file unless it gives a name; relative paths of blade, polar and outline
        count from the file's folder, in overrides too, and are absolute in the case.

    Raises
    ------
    InputError
        If the file cannot be read or anything in it, or in an override, is wrong. The message names
        file, key, value and remedy.
    """
    path = find_case(path)
    content = read_bytes(path, MAX_CASE_BYTES, "case file in YAML")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(
            "is not UTF-8 text", "save it as UTF-8", file=path, key=f"line {line}"
        ) from None
    return read_case(
        text,
        overrides,
        file=str(path),
        folder=path.parent,
        name=path.stem,
        check_files=check_files,
    )


def read_case(
    text: str,
    overrides: Sequence[str] = (),
    *,
    file: str = "case",
    folder: str | Path = ".",
    name: str = "case",
    check_files: bool = True,
) -> Case:
    """Make a case of YAML text.

    Parameters
    ----------
    text : str
        The case in YAML.
    overrides : sequence of str
        Such as ``rotor.radius=2``; what stands after the first ``=`` is YAML.
    file : str
        What messages call the text.
    folder : str or pathlib.Path
        Where relative paths of blade, polar and outline count from.
    name : str
        Name of a case that gives none.
    check_files : bool
        Whether the CSV files that the case names must exist.

    Returns
    -------
    Case
        The case.

    Raises
    ------
    InputError
        If anything in the text or an override is wrong.
    """
    data = parse(text, file)
    if data is None:
        raise InputError(
            "holds no case",
            "give at least inflow: {profile: ...} and control: {law: ...}",
            file=file,
        )
    if not isinstance(data, dict):
        raise InputError(
            "must hold keys and values at its top",
            "write inflow: ... and so on",
            file=file,
            value=data,
        )
    given = {}
    for override in (overrides,) if isinstance(overrides, str) else overrides:
        key, value = _split(override, file)
        _assign(data, key, value, file)
        given[key] = override
    data.setdefault("name", name)
    try:
        return Case.model_validate(data, context={"folder": folder, "check_files": check_files})
    except ValidationError as error:
        raise translate(error.errors(include_url=False), Case, file, given) from None


def _split(override: str, file: str) -> tuple[str, Any]:
    """Return the dotted key and the value of an override."""
    key, equals, text = override.partition("=")
    key = key.strip()
    if not equals or not text.strip() or not re.fullmatch(r"\w+(\.\w+)*", key, re.ASCII):
        raise InputError(
            "is no override",
            "write section.key=value, such as rotor.radius=2 (null for none)",
            file=file,
            key="override",
            value=override,
        )
    return key, parse(text, f"{file}, override {key}", key)


def _assign(data: dict[str, Any], key: str, value: object, file: str) -> None:
    *sections, last = key.split(".")
    for depth, section in enumerate(sections):
        data = data.setdefault(section, {})
        if not isinstance(data, dict):
            raise InputError(
                f"has no keys, so the override {key} cannot be made",
                "override the whole of it, or only keys of sections",
                file=file,
                key=".".join(sections[: depth + 1]),
                value=data,
            )
    data[last] = value
