"""The whole case, and the way from YAML text to it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Union

import yaml
from pydantic import Field, SerializeAsAny, ValidationError, create_model, model_validator
from pydantic_core import PydanticCustomError

from hkt_mdo.case.design import Design, Driver, Hydrodynamics, Phase, Start
from hkt_mdo.case.kinds import BUILT_IN, Extension, Kinds, kind_name, known_kinds
from hkt_mdo.case.messages import translate
from hkt_mdo.case.turbine import Fluid, Rotor
from hkt_mdo.dynamics.flows import Inflow, SumInflow
from hkt_mdo.dynamics.laws import FeedbackLaw, Law
from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.dynamics.objectives import CapturedEnergy, Objective
from hkt_mdo.errors import InputError
from hkt_mdo.files.table import read_bytes
from hkt_mdo.files.yaml_text import Dumper, parse
from hkt_mdo.sections import Section, refusal

STATION_COUNT = 40
"""Stations of a blade of splines: within 0.1 % of the energy at any number of them."""

MAX_CASE_BYTES = 1024**2
"""Largest case file that is read, in bytes."""


class Limits(Section):
    """Limits besides that on the control torque, each under its name.

    One whose only key is `bound` may be given as that alone, such as `limits: {NAME: 15 m/s}`.
    """

    @property
    def given(self) -> tuple[Limit, ...]:
        """The limits that the case gives."""
        values = (getattr(self, name) for name in type(self).model_fields)
        return tuple(value for value in values if value is not None)


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

    inflow: SerializeAsAny[Inflow]
    """Inflow speed over time; `profile` says which kind."""

    control: SerializeAsAny[Law]
    """Control law; `law` says which."""

    limits: SerializeAsAny[Limits] = Limits()
    """Limits besides `control.torque_limit`."""

    objective: SerializeAsAny[Objective] = CapturedEnergy()
    """What is maximized; `kind` says which."""

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

    extensions: ClassVar[tuple[str, ...]] = ()
    """Python files that define kinds of this case's class."""

    @model_validator(mode="before")
    @classmethod
    def _spell_out(cls, data: Any) -> Any:
        """Give a kind without keys by its bare name, and a blade of splines its stations.

        docs/stations.md tells how many stations resolve it.
        """
        if not isinstance(data, dict):
            return data
        for key, tag in _TAGS.items():
            if isinstance(data.get(key), str):
                data = data | {key: {tag: data[key]}}
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
            if not isinstance(self.control, FeedbackLaw):
                raise refusal(
                    f"bounds a gain that the law {self.control.law} does not have",
                    "leave design.gain_bounds out, or choose a feedback law",
                    key="design.gain_bounds",
                    value=list(bounds),
                )
            gain = getattr(self.control, "gain", None)
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
        return read_case(
            self.to_yaml(), overrides, file=f"case {self.name}", extensions=self.extensions
        )


_TAGS = {"inflow": "profile", "control": "law", "objective": "kind"}


@cache
def case_class(kinds: Kinds) -> type[Case]:
    """Return the class of the cases that may name some kinds."""
    profiles = [each for each in kinds.profiles if not issubclass(each, SumInflow)]
    parts = Annotated[Union[tuple(profiles)], Field(discriminator="profile")]  # noqa: UP007
    about = SumInflow.model_fields["parts"].description
    total = create_model(
        "SumInflow",
        __base__=SumInflow,
        __doc__=SumInflow.__doc__,
        parts=(tuple[parts, ...], Field(min_length=2, max_length=20, description=about)),
    )
    limits: dict[str, Any] = {
        kind_name(each): (each | None, Field(None, description=(each.__doc__ or "").strip()))
        for each in kinds.limits
    }
    section = create_model("Limits", __base__=Limits, __doc__=Limits.__doc__, **limits)
    made = create_model(
        "Case",
        __base__=_AnyCase,
        __doc__=_AnyCase.__doc__,
        inflow=_choice("inflow", [*profiles, total]),
        control=_choice("control", kinds.laws),
        limits=(section, Field(section(), description=Limits.__doc__)),
        objective=_choice("objective", kinds.objectives),
    )
    made.extensions = kinds.files
    return made


def _choice(key: str, classes: Sequence[type]) -> Any:
    """Return the field of a case that takes one of some sections, which a tag tells apart."""
    field = _AnyCase.model_fields[key]
    tag = {"discriminator": _TAGS[key]} if len(classes) > 1 else {}
    about = {"default": field.default, "description": field.description}
    return Union[tuple(classes)], Field(**about, **tag)  # noqa: UP007


_AnyCase = Case
if not TYPE_CHECKING:
    Case = case_class(BUILT_IN)


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


def load_case(
    source: str | Path | Mapping[str, Any],
    overrides: Sequence[str] = (),
    *,
    check_files: bool = True,
    extensions: Iterable[Extension] = (),
) -> Case:
    """Read a case file, or take a case as a dict.

    Parameters
    ----------
    source : str, pathlib.Path or mapping
        A YAML file; or what one holds, with relative paths from the current folder.
    overrides : sequence of str
        Such as ``rotor.radius=2``; what stands after the first ``=`` is YAML.
    check_files : bool
        Whether the files that the case names must exist; a result is looked at without them.
    extensions : iterable of path, module or class
        Python files, modules or classes that define further kinds of flow, law, limit or objective
        (docs/architecture.md). A file is run: give only what you trust.

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
    kinds = known_kinds(extensions)
    if isinstance(source, Mapping):
        return _make_case(dict(source), overrides, "case", ".", "case", check_files, kinds)
    path = Path(source)
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
        extensions=kinds,
    )


def read_case(
    text: str,
    overrides: Sequence[str] = (),
    *,
    file: str = "case",
    folder: str | Path = ".",
    name: str = "case",
    check_files: bool = True,
    extensions: Iterable[Extension] | Kinds = (),
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
        Whether the files that the case names must exist.
    extensions : iterable of path, module or class, or Kinds
        As of `load_case`.

    Returns
    -------
    Case

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
    kinds = extensions if isinstance(extensions, Kinds) else known_kinds(extensions)
    return _make_case(data, overrides, file, folder, name, check_files, kinds)


def _make_case(data, overrides, file, folder, name, check_files, kinds) -> Case:
    given = {}
    for override in (overrides,) if isinstance(overrides, str) else overrides:
        key, value = _split(override, file)
        _assign(data, key, value, file)
        given[key] = override
    data.setdefault("name", name)
    made = case_class(kinds)
    try:
        return made.model_validate(data, context={"folder": folder, "check_files": check_files})
    except ValidationError as error:
        raise translate(error.errors(include_url=False), made, file, given) from None


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
