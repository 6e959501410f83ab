"""The whole case, and the way from YAML text to it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Union

import yaml
from pydantic import (
    AfterValidator,
    Field,
    SerializeAsAny,
    Strict,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from hkt_mdo.case.design import Design, Driver, Hydrodynamics, Phase, Start
from hkt_mdo.case.kinds import BUILT_IN, Extension, Kinds, kind_name, known_kinds
from hkt_mdo.case.messages import TAGS, translate
from hkt_mdo.case.turbine import Fluid, Rotor, Site, own_keys
from hkt_mdo.dynamics.aggregates import Aggregate, Expected
from hkt_mdo.dynamics.flows import Inflow, SumInflow
from hkt_mdo.dynamics.generator import Generator
from hkt_mdo.dynamics.laws import FeedbackLaw, Law
from hkt_mdo.dynamics.limits import ElectricalPowerLimit, Limit, PowerLimit
from hkt_mdo.dynamics.objectives import CapturedEnergy, Objective
from hkt_mdo.dynamics.wide_laws import RatedFeedback
from hkt_mdo.errors import InputError
from hkt_mdo.files.cases import find_case
from hkt_mdo.files.shipped import shipped_rotor
from hkt_mdo.files.table import read_text
from hkt_mdo.files.yaml_text import Dumper, parse
from hkt_mdo.sections import Quantity, Section, refusal

STATION_COUNT = 40  # within 0.1 % of the energy at any number of them, and 1 % of the loads
MAX_CASE_BYTES = 1024**2  # of a file that is read
VERSION = 2  # of the keys of a case; under 1, limits left a blade its own stations


def _known_version(version: int) -> int:
    """Return a version of the keys; refuse one that this program does not know."""
    if not 1 <= version <= VERSION:
        problem = f"is unknown: this program reads version {VERSION}"
        raise refusal(problem, "install a newer hkt_mdo, or write the case for this one")
    return version


class Limits(Section):
    """Limits besides `control.torque_limit`, each under its name.

    A limit whose only key is `bound` may be given as that alone, such as `limits: {power: 5 kW}`.
    """

    torque: Annotated[float, Quantity("N*m", gt=0)] | None = None
    """Largest control torque: another name of `control.torque_limit`."""

    @property
    def given(self) -> tuple[Limit, ...]:
        """The limits that the case gives."""
        values = (getattr(self, name) for name in type(self).model_fields)
        return tuple(value for value in values if isinstance(value, Limit))


class FlowScenario(Section):
    """One of several flows, for which one blade and one controller are designed.

    Keys that it does not have are taken from the case.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=40)] | None = None
    """Name of the scenario and of its tables: up to 40 letters, digits and `_`, the first a letter;
    null: `flow_1`, and so on."""
    inflow: SerializeAsAny[Inflow] | None = None
    """Inflow speed over time, given as `inflow` of the case; null: that of the case."""
    weight: Annotated[float, Quantity(ge=0)] = 1.0
    """Share of time, relative to the sum of all weights. A scenario of weight 0 adds no energy, but
    its limits hold."""
    duration: Annotated[float, Quantity("s", gt=0, le=3.2e7)] | None = None
    """Duration; null: `phase.duration`, or that of the flow's record, or 60 s."""
    segments: Annotated[int, Strict(), Field(ge=2, le=20000)] | None = None
    """Number of collocation segments; null: `phase.segments`, or as many as the flow needs."""
    limits: SerializeAsAny[Limits] = Limits()
    """Limits over time, given as `limits` of the case. They hold in this scenario in addition to
    those of the case, and replace those of the same name."""


class Case(Section):
    """One experiment: a turbine in a flow under a control law, and how it is optimized."""

    name: Annotated[
        str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$", min_length=1, max_length=100)
    ] = "case"
    """Name of the case and of its results: letters, digits, `_`, `-` and `.`; by default the case
    file's own name."""
    rotor: Rotor = Rotor()
    fluid: Fluid = Fluid()
    site: Site = Site()

    inflow: SerializeAsAny[Inflow]
    """Inflow speed over time; `profile` says which kind."""
    control: SerializeAsAny[Law]
    """Control law; `law` says which."""
    limits: SerializeAsAny[Limits] = Limits()
    generator: Generator = Generator()

    scenarios: SerializeAsAny[tuple[FlowScenario, ...]] = Field((), max_length=200)
    """Several flows, for which one blade and one controller are designed.

    A feedback law has the same gains in all of them, open loop a trajectory for each. The objective
    is the mean power times `phase.duration`, where each scenario counts with its share of time.
    Without entries there is one flow, `inflow`."""
    robustness: SerializeAsAny[Aggregate] = Expected()
    """How the scenarios' mean powers are combined into one objective; `measure` says which way."""

    objective: SerializeAsAny[Objective] = CapturedEnergy()
    """What is optimized; `kind` says which."""
    design: Design = Design()
    phase: Phase = Phase()
    start: Start = Start()
    hydrodynamics: Hydrodynamics = Hydrodynamics()
    driver: Driver = Driver()

    version: Annotated[int, Strict(), AfterValidator(_known_version)] = VERSION
    """Version of the keys that the file is written with. With version 1, a blade in a case with
    limits keeps the stations of its file."""

    kinds: ClassVar[Kinds] = BUILT_IN
    """What cases of this class may name."""

    @property
    def extensions(self) -> tuple[Extension, ...]:
        """Python files and classes that define kinds of this case's class."""
        return self.kinds.extensions

    @model_validator(mode="before")
    @classmethod
    def _spell_out(cls, data: Any) -> Any:
        """Write out a kind that is given by its bare name, and the stations of a resolved blade.

        A blade of splines has them, and one whose operation is limited (docs/stations.md).
        """
        if not isinstance(data, dict):
            return data
        data = _scenarios_spelled_out(data)
        for key, tag in TAGS.items():
            if isinstance(data.get(key), str):
                data = data | {key: {tag: data[key]}}
        data = _torque_limit_moved(data)
        if isinstance(data.get("inflow"), SumInflow):  # of any class of parts
            data = data | {"inflow": data["inflow"].model_dump()}
        rotor, given = data.get("rotor", {}), ("stations", "station_count", "chord")
        if isinstance(rotor, dict) and all(rotor.get(name) is None for name in given):
            limited = _is_limited(data) and data.get("version", VERSION) != 1
            if limited or _is_splined(data.get("design")):
                return data | {"rotor": rotor | {"station_count": STATION_COUNT}}
        return data

    @model_validator(mode="after")
    def _check_start(self) -> Case:
        """Refuse a start outside the bounds of the design, and options that exclude each other."""
        design, rotor, control = self.design, self.rotor, self.control
        if design.gain_bounds is not None and not isinstance(control, FeedbackLaw):
            problem = f"bounds a gain that the law {control.law} does not have"
            remedy = "leave design.gain_bounds out, or choose a feedback law"
            raise refusal(problem, remedy, key="design.gain_bounds", value=list(design.gain_bounds))
        if design.gain_bounds is not None and len(control.gain_units) != 1:
            problem = f"bounds one gain, and the law {control.law} has {len(control.gain_units)}"
            remedy = "leave design.gain_bounds out"
            raise refusal(problem, remedy, key="design.gain_bounds", value=list(design.gain_bounds))
        self._check_scenarios()
        limited = {each.name for each in self.limits.given}
        if (
            isinstance(control, RatedFeedback)
            and control.power is None
            and not limited & {PowerLimit.name, ElectricalPowerLimit.name}
        ):
            problem = "is missing in a case without a limit of the power, which would choose it"
            remedy = "give it or limits.power, or control.law: quadratic, which needs none"
            raise refusal(problem, remedy, key="control.power", value=None)
        if self.phase.final_speed == "initial" and isinstance(control, FeedbackLaw):
            problem = f"is for open loop: the law {control.law} decides the speed"
            remedy = "give free, or control.law: open_loop"
            raise refusal(problem, remedy, key="phase.final_speed", value="initial")
        problem = "takes the Reynolds number of the induced speed, not that of rotor.reynolds"
        remedy = "give vectorized, or rotor.reynolds: invariant"
        for name in ("bem", "check"):
            if rotor.reynolds == "local" and getattr(self.hydrodynamics, name) == "ccblade":
                raise refusal(problem, remedy, key=f"hydrodynamics.{name}", value="ccblade")
        start = [
            ("rotor.set_angle", rotor.set_angle or 0.0, "set_angle_bounds"),
            ("rotor.radius", rotor.radius, "radius_bounds"),
        ]
        if isinstance(control, FeedbackLaw) and (gains := control.starting_gains()) is not None:
            start += [("control.gain", float(gain), "gain_bounds") for gain in gains]
        for name in ("chord", "twist") if design.blade == "optimized" else ():
            for index, value in enumerate(getattr(rotor, name) or ()):
                start.append((f"rotor.{name}[{index}]", value, f"{name}_bounds"))
        for key, value, name in start:
            bounds = getattr(design, name)
            if None not in (bounds, value) and not bounds[0] <= value <= bounds[1]:
                problem = f"lies outside design.{name} = [{bounds[0]:g}, {bounds[1]:g}]"
                remedy = "the start must lie within the bounds: change one or the other"
                raise refusal(problem, remedy, key=key, value=value)
        return self

    def of_scenario(self, name: str) -> Case:
        """Return the case of one of its scenarios alone; for an unknown name, the case itself."""
        for own in self.scenarios:
            if own.name == name:
                limits = {limit.name: limit for limit in own.limits.given}
                mesh = {
                    "duration": own.duration or self.phase.duration,
                    "segments": own.segments or self.phase.segments,
                }
                update = {
                    "inflow": own.inflow or self.inflow,
                    "limits": self.limits.model_copy(update=limits),
                    "phase": self.phase.model_copy(update=mesh),
                    "scenarios": (),
                }
                return self.model_copy(update=update)
        return self

    def _check_scenarios(self) -> None:
        """Refuse scenarios that share a name, weigh nothing, or limit what they do not own."""
        names = [(each.name or "").lower() for each in self.scenarios]  # they name files
        for number, scenario in enumerate(self.scenarios):
            key = f"scenarios[{number}]"
            if names[number] in names[:number]:
                problem, remedy = "is the name of two scenarios", "give each its own"
                raise refusal(problem, remedy, key=f"{key}.name", value=scenario.name)
            if scenario.limits.torque is not None:
                problem = "is the controller's, which all scenarios share"
                remedy = "give control.torque_limit"
                torque = scenario.limits.torque
                raise refusal(problem, remedy, key=f"{key}.limits.torque", value=torque)
            for limit in scenario.limits.given:
                if limit.place != "time":
                    problem = "is a limit of the design, which all scenarios share"
                    remedy = f"give it as limits.{limit.name}"
                    value = getattr(limit, "bound", None)
                    raise refusal(problem, remedy, key=f"{key}.limits.{limit.name}", value=value)
        if self.scenarios and not any(each.weight > 0.0 for each in self.scenarios):
            problem, remedy = "have weights that are all zero", "give one of them a weight above 0"
            weights = [each.weight for each in self.scenarios]
            raise refusal(problem, remedy, key="scenarios", value=weights)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the values and the extensions: another process makes the class again."""
        again = partial(load_case, check_files=False, extensions=self.extensions)
        return again, (self.model_dump(),)

    def to_yaml(self) -> str:
        """Return the case as YAML with every default written out; `read_case` makes it again.

        Values that a shipped blade has are left to the blade, and listed in a comment.
        """
        data, own = self._without_own()
        write = partial(yaml.dump, Dumper=Dumper, sort_keys=False, allow_unicode=True)
        text = str(write(data, width=100))
        if not own:
            return text
        brings = str(write(own, width=float("inf"), default_flow_style=True)).strip()
        about = f"  # where null, the blade {data['rotor']['blade']} brings its own: {brings}"
        return text.replace("\nrotor:\n", f"\nrotor:\n{about}\n", 1)

    def _without_own(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the case as JSON has it, without what the blade brings with it, and that."""
        data = self.model_dump(mode="json")
        own = own_keys(data["rotor"])
        if _is_splined(data["design"]) or _is_limited(data):  # without them it would be resolved
            own.pop("stations", None)
        data["rotor"] |= {key: [] if key == "sections" else None for key in own}
        data["scenarios"] = [_without_nulls(each) for each in data["scenarios"]]
        return data, own

    def with_overrides(self, *overrides: str) -> Case:
        """Return a case in which some keys have other values, checked as a file would be.

        An override is a text such as ``rotor.radius=2`` or ``control={law: linear}``; relative
        paths start from the current folder. Raises InputError for one that is not valid.
        """
        data, _ = self._without_own()
        return _make_case(data, overrides, self.kinds, file=f"case {self.name}")


def _without_nulls(section: dict[str, Any]) -> dict[str, Any]:
    """Return a section of a case without keys that are null, nor in the sections below."""
    return {
        key: _without_nulls(value) if isinstance(value, dict) else value
        for key, value in section.items()
        if value is not None
    }


def _is_splined(design: Any) -> bool:
    """Tell whether chord or twist are given by control points."""
    names = "chord_points", "twist_points"
    return isinstance(design, dict) and any(design.get(name) is not None for name in names)


def _is_limited(data: dict[str, Any]) -> bool:
    """Tell whether a case, or one of its scenarios, has limits besides that of the torque."""
    scenarios = data.get("scenarios")
    for each in (data, *(scenarios if isinstance(scenarios, list | tuple) else ())):
        limits = each.get("limits") if isinstance(each, dict) else None
        if isinstance(limits, dict) and any(x is not None for x in limits.values()):
            return True
    return False


def _scenarios_spelled_out(data: dict[str, Any]) -> dict[str, Any]:
    """Return a case's data with names and flows of its scenarios; the case's flow is the first."""
    given = data.get("scenarios")
    if not isinstance(given, list | tuple) or not all(isinstance(each, dict) for each in given):
        return data
    scenarios = []
    for number, scenario in enumerate(given, start=1):
        spelled = dict(scenario)
        if spelled.get("name") is None:
            spelled["name"] = f"flow_{number}"
        if isinstance(spelled.get("inflow"), str):
            spelled["inflow"] = {TAGS["inflow"]: spelled["inflow"]}
        scenarios.append(spelled)
    data = data | {"scenarios": scenarios}
    first = scenarios[0].get("inflow") if scenarios else None
    return data if first is None else {"inflow": first} | data


def _torque_limit_moved(data: dict[str, Any]) -> dict[str, Any]:
    """Return a case's data with `limits.torque` in `control.torque_limit`; refuse two of them."""
    limits, control = data.get("limits"), data.get("control")
    if not isinstance(limits, dict) or not isinstance(control, dict):
        return data
    torque, given = limits.get("torque"), control.get("torque_limit")
    try:
        torque, given = (x if x is None else _TORQUE.read(x) for x in (torque, given))
    except PydanticCustomError:  # which is told where the key is read
        return data
    if torque is None:
        return data
    if given not in (None, torque):
        problem = f"is not control.torque_limit = {given:g} N m, of which it is another name"
        raise refusal(problem, "give one of them", key="limits.torque", value=limits["torque"])
    limits = {name: value for name, value in limits.items() if name != "torque"}
    return data | {"limits": limits, "control": control | {"torque_limit": torque}}


_TORQUE = Quantity("N*m", gt=0)
_BaseCase = Case


@cache
def case_class(kinds: Kinds) -> type[Case]:
    """Return the class of the cases that may name some kinds; a subclass of `Case`."""
    profiles = [each for each in kinds.profiles if not issubclass(each, SumInflow)]
    part: Any = Annotated[Union[tuple(profiles)], Field(discriminator="profile")]  # noqa: UP007
    about = SumInflow.model_fields["parts"].description
    parts = Field(min_length=2, max_length=20, description=about)
    total = _subclass(SumInflow, parts=(tuple[part, ...], parts))
    limits: dict[str, Any] = {
        kind_name(each): (each | None, Field(None, description=(each.__doc__ or "").strip()))
        for each in kinds.limits
    }
    section = _subclass(Limits, **limits)
    own = FlowScenario.model_fields
    scenario = _subclass(
        FlowScenario,
        inflow=_choice("inflow", [*profiles, total, None], own["inflow"]),
        limits=(section, Field(section(), description=own["limits"].description)),
    )
    several = _BaseCase.model_fields["scenarios"].description
    made = _subclass(
        Case,
        scenarios=(
            tuple[scenario, ...],  # type: ignore[valid-type]
            Field((), max_length=200, description=several),
        ),
        robustness=_choice("robustness", kinds.aggregates),
        inflow=_choice("inflow", [*profiles, total]),
        control=_choice("control", kinds.laws),
        limits=(section, Field(section(), description=Limits.__doc__)),
        objective=_choice("objective", kinds.objectives),
    )
    made.kinds = kinds
    return made


def _subclass(base: Any, **fields: Any) -> Any:
    """Return a subclass of a section, under its name, with other types of some fields."""
    return create_model(base.__name__, __base__=base, __doc__=base.__doc__, **fields)


def _choice(
    key: str, classes: Sequence[type[Section] | None], field: FieldInfo | None = None
) -> Any:
    """Return a field that takes one of some sections, which a tag tells apart; None: or null.

    `field` has default and description, by default those of the case's key.
    """
    field = field or _BaseCase.model_fields[key]
    kinds = [each for each in classes if each is not None]
    plain = [e for e in kinds if not any(f.is_required() for f in e.model_fields.values())]

    def describe(schema: dict[str, Any]) -> None:
        """Let the JSON schema take the bare name of a kind that has no required keys."""
        for part in schema.get("anyOf", [schema])[:1]:
            whole = part.pop("oneOf", None) or [{"$ref": part.pop("$ref")}]
            part["oneOf"] = [*whole, {"enum": [kind_name(each) for each in plain]}]
            part.setdefault("discriminator", {"propertyName": TAGS[key]})

    options: dict[str, Any] = {"default": field.default, "description": field.description}
    if len(kinds) > 1:
        options["discriminator"] = TAGS[key]
    return Union[tuple(classes)], Field(json_schema_extra=describe, **options)  # noqa: UP007


if not TYPE_CHECKING:
    Case = case_class(BUILT_IN)


# Reading ------------------------------------------------------------------------------------------


def load_case(
    source: str | Path | Mapping[str, Any],
    overrides: Sequence[str] = (),
    *,
    check_files: bool = True,
    extensions: Iterable[Extension] = (),
) -> Case:
    """Read a case file, or take a case as a dict.

    The case has the file's name unless it gives another; relative paths start from the file's
    folder, in overrides too, and are absolute in the case. Raises InputError, with file, key, value
    and remedy, if the file cannot be read or anything in it, or in an override, is wrong.

    `source` is a YAML file, the name of a shipped case if there is no such file, or the content of
    a file as a dict. `overrides` are texts such as ``rotor.radius=2``; the text after the first
    ``=`` is YAML. `check_files` says whether the files that the case names must exist. `extensions`
    are Python files, modules or classes that define further kinds of flow, law, limit or objective
    (docs/architecture.md); a file is executed, so give only files that you trust.
    """
    if isinstance(source, Mapping):
        data = deepcopy(dict(source))
        return _make_case(data, overrides, known_kinds(extensions), check_files=check_files)
    path = find_case(source)
    return read_case(
        read_text(path, "case file in YAML", MAX_CASE_BYTES),
        overrides,
        file=str(path),
        folder=path.parent,
        name=path.stem,
        check_files=check_files,
        extensions=extensions,
    )


def read_case(
    text: str,
    overrides: Sequence[str] = (),
    *,
    file: str = "case",
    folder: str | Path = ".",
    name: str = "case",
    check_files: bool = True,
    extensions: Iterable[Extension] = (),
) -> Case:
    """Make a case of YAML text; the rest is as in `load_case`.

    `file` names the text in messages, relative paths start from `folder`, and `name` is the name of
    a case that gives none.
    """
    data = parse(text, file)
    if data is None:
        remedy = "give at least inflow: {profile: ...} and control: {law: ...}"
        raise InputError("contains no case", remedy, file=file)
    if not isinstance(data, dict):
        problem = "must hold keys and values at its top"
        raise InputError(problem, "write inflow: ... and so on", file=file, value=data)
    return _make_case(data, overrides, known_kinds(extensions), file, folder, name, check_files)


def _make_case(
    data: dict[str, Any],
    overrides: Sequence[str],
    kinds: Kinds,
    file: str = "case",
    folder: str | Path = ".",
    name: str = "case",
    check_files: bool = True,
) -> Case:
    """Return the case of some data, which is changed, and overrides."""
    overrides = (overrides,) if isinstance(overrides, str) else overrides
    _leave_to_blade(data, overrides)
    given = {assign(data, override, file): override for override in overrides}
    data.setdefault("name", name)
    made = case_class(kinds)
    try:
        return made.model_validate(data, context={"folder": folder, "check_files": check_files})
    except ValidationError as error:
        raise translate(error.errors(include_url=False), made, file, given) from None


def _leave_to_blade(data: dict[str, Any], overrides: Sequence[str]) -> None:
    """Take what the old blade brought out of a case written by an earlier version.

    Such a case has all of it written out, so that another blade would be of the old one's size.
    """
    rotor = data.get("rotor")
    if isinstance(rotor, dict) and any(re.match(r"\s*rotor\.blade\s*=", o) for o in overrides):
        if all(rotor.get(key) is not None for key in shipped_rotor(rotor.get("blade"))):
            for key in own_keys(rotor):
                del rotor[key]


def assign(data: dict[str, Any], override: str, file: str) -> str:
    """Apply an override and return its dotted key; a bare name of a kind becomes a section first.

    `data` is changed; `file` names it in messages. Raises InputError if the override is not valid.
    """
    key, equals, text = override.partition("=")
    key = key.strip()
    if not equals or not text.strip() or not re.fullmatch(r"\w+(\.\w+)*", key, re.ASCII):
        remedy = "write section.key=value, such as rotor.radius=2 (null for none)"
        raise InputError("is not an override", remedy, file=file, key="override", value=override)
    *sections, last = key.split(".")
    for depth, section in enumerate(sections):
        inner = data.setdefault(section, {})
        if isinstance(inner, str) and depth == 0 and section in TAGS:
            inner = data[section] = {TAGS[section]: inner}
        if not isinstance(inner, dict):
            problem = f"has no keys, so the override {key} cannot be applied"
            remedy = "override it as a whole, or only keys of sections"
            place = ".".join(sections[: depth + 1])
            raise InputError(problem, remedy, file=file, key=place, value=inner)
        data = inner
    data[last] = parse(text, f"{file}, override {key}", key)
    return key
