"""The whole case, and how it is read from YAML text."""

import html
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Union

from pydantic import AfterValidator, Field, SerializeAsAny, Strict, create_model

from hkt_mdo.case.design import Design, Driver, Hydrodynamics, InflowDynamics, Phase, Start
from hkt_mdo.case.kinds import BUILT_IN, Extension, Kinds, known_kinds
from hkt_mdo.case.turbine import Condition, Fluid, Rotor, Site, Spread, own_keys
from hkt_mdo.dynamics.aggregates import Aggregate, Expected
from hkt_mdo.dynamics.flows import ConstantInflow, Inflow, SumInflow
from hkt_mdo.dynamics.generator import Generator
from hkt_mdo.dynamics.laws import FeedbackLaw, Law
from hkt_mdo.dynamics.limits import ElectricalPowerLimit, Limit, PowerLimit
from hkt_mdo.dynamics.objectives import CapturedEnergy, Objective
from hkt_mdo.dynamics.resource import Resource
from hkt_mdo.dynamics.wide_laws import RatedFeedback
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import find_case
from hkt_mdo.files.table import read_text
from hkt_mdo.files.yaml_text import dump, parse
from hkt_mdo.messages import validated
from hkt_mdo.quantities import RATES
from hkt_mdo.sections import Flaws, Quantity, Section, kind_name, refusal

MOST_SCENARIOS, LONGEST_NAME = 200, 40  # LONGEST_NAME in characters, of a scenario
STATION_COUNT = 40  # within 0.1 % of the energy at any number of them, and 1 % of the loads
MAX_CASE_BYTES = 1024**2  # of a file that is read
VERSION = 2  # of the keys of a case


def _known_version(version: int) -> int:
    """Return a version of the keys; refuse one that this program does not read."""
    if version == 1:
        problem = "is not read any more: two defaults have changed since"
        remedy = (
            "remove it; to keep the results, give design.chord_bounds: [0.01, 1] if the blade is "
            "designed, and rotor.stations, those of the blade's file, if the case has limits and "
            "neither stations nor control points"
        )
        raise refusal(problem, remedy)
    if version != VERSION:
        problem = f"is unknown: this program reads version {VERSION}"
        raise refusal(problem, "install a newer hkt_mdo, or write the case for this one")
    return version


class Limits(Section):
    """Limits besides `control.torque_limit`, each under its name (docs/theory.md).

    A limit is given as its bound, such as `limits: {power: 5 kW}`, or as a section with the key
    `bound`.
    """

    @property
    def given(self) -> tuple[Limit, ...]:
        """The limits that the case gives."""
        values = (getattr(self, name) for name in type(self).model_fields)
        return tuple(value for value in values if value is not None)


_LATER = ConstantInflow(speed=1.0)
"""Stands for the flow of a case that has a resource, or takes the flow of its first scenario."""


class _WithFlow(Section):
    """A case, or one of its scenarios: a resource as the flow."""

    def flaws(self: Any) -> Flaws:
        """Take `resource` for `inflow`; yield a flaw where both are given."""
        if self.resource is not None:
            if self.inflow is not None and self.inflow is not _LATER:
                problem = "is given besides inflow, of which resource is another name"
                yield "resource.profile", problem, "give one of them"
            object.__setattr__(self, "inflow", self.resource)
            object.__setattr__(self, "resource", None)


class FlowScenario(_WithFlow):
    """One of several flows; keys that it does not have are taken from the case."""

    name: (
        Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=LONGEST_NAME)] | None
    ) = None
    """Name: up to 40 letters and digits and `_` that begin with a letter; null: `flow_1`, and so
    on."""
    inflow: SerializeAsAny[Inflow] | None = None
    """Flow, as `inflow` of the case."""
    resource: SerializeAsAny[Resource] | None = None
    """Hours of each speed in place of `inflow`, as `resource` of the case."""
    steady: bool = False
    """Whether the flow's speeds are taken without their order, as with a resource."""
    weight: Annotated[float, Quantity(ge=0)] = 1.0
    """Share of time, over the sum of all weights. With weight 0 it is a load case: its limits hold,
    its energy does not count."""
    realizations: Annotated[int, Strict(), Field(ge=1, le=200)] | None = None
    """Number of flows with the seeds `inflow.seed` and the next ones, which share the weight:
    `NAME_1`, `NAME_2`, and so on."""
    duration: Annotated[float, Quantity("s", gt=0, le=3.2e7)] | None = None
    """Duration; null: `phase.duration`, or that of the flow's record, or 60 s."""
    segments: Annotated[int, Strict(), Field(ge=2, le=20000)] | None = None
    """Number of collocation segments; null: `phase.segments`, or as many as the flow needs."""
    limits: SerializeAsAny[Limits] = Limits()
    """Limits over time, besides those of the case or in place of those of the same name."""
    density: Annotated[float, Quantity("kg/m**3", gt=0, le=20000)] | None = None
    """Density of the water; null: `fluid.density`."""
    condition: Condition | None = None
    """The turbine in this scenario, as `condition` of the case."""
    spread: Spread | None = None
    """Variation of `condition` and `density` from one realization to the next."""

    def realized(self, case: "Case", key: str) -> list["FlowScenario"]:
        """Return one scenario for each realization of a case's scenario, called `key`.

        Refuses realizations that would all be the same.
        """
        count, flow, made = self.realizations or 1, self.inflow or case.inflow, []
        for number in range(count):
            changes: dict[str, Any] = {"realizations": None, "spread": None}
            if count > 1:
                changes |= {"name": f"{self.name}_{number + 1}", "weight": self.weight / count}
                changes["inflow"] = flow.reseeded(number)
            if self.spread is not None:
                condition, density = self.condition or case.condition, self.density
                changes |= self.spread.drawn(condition, density or case.fluid.density, number)
            elif number and changes["inflow"] == flow:
                problem = f"asks for {count} flows, and inflow.profile = {flow.profile} has no seed"
                remedy = "leave realizations out, or give profile: turbulence, or a spread"
                raise refusal(problem, remedy, key=f"{key}.realizations", value=count)
            made.append(self.model_copy(update=changes))
        return made


class Case(_WithFlow):
    """One experiment: a turbine in a flow under a control law, and how it is optimized."""

    name: Annotated[
        str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$", min_length=1, max_length=100)
    ] = "case"
    """Name of case and results: up to 100 letters and digits and `_` `-` `.` beginning with none
    of `-` `.`; by default the file's."""
    rotor: Rotor = Rotor()
    fluid: Fluid = Fluid()
    site: Site = Site()
    condition: Condition = Condition()

    inflow: SerializeAsAny[Inflow]
    """Inflow speed over time; `profile` says which kind."""
    resource: SerializeAsAny[Resource] | None = None
    """How long the flow has each speed in a year, in place of `inflow`: the profiles `histogram` to
    `long_record` (docs/year.md)."""
    control: SerializeAsAny[Law]
    """Control law; `law` says which."""
    limits: SerializeAsAny[Limits] = Limits()
    generator: Generator = Generator()

    scenarios: SerializeAsAny[tuple[FlowScenario, ...]] = Field((), max_length=MOST_SCENARIOS)
    """Several flows, for which one blade and one controller are designed (docs/flows.md)."""
    robustness: SerializeAsAny[Aggregate] = Expected()
    """How the scenarios' mean powers are combined into one objective; `measure` says which way."""

    objective: SerializeAsAny[Objective] = CapturedEnergy()
    """What is optimized; `kind` says which."""
    design: Design = Design()
    phase: Phase = Phase()
    start: Start = Start()
    hydrodynamics: Hydrodynamics = Hydrodynamics()
    inflow_dynamics: InflowDynamics = InflowDynamics()
    driver: Driver = Driver()

    version: Annotated[int, Strict(), AfterValidator(_known_version)] = VERSION
    """Version of the keys that the file is written with."""

    kinds: ClassVar[Kinds] = BUILT_IN
    """The kinds that cases of this class may name."""

    @property
    def all_limits(self) -> tuple[Limit, ...]:
        """The limits of the case, and those of its scenarios."""
        return sum((scenario.limits.given for scenario in self.scenarios), self.limits.given)

    @property
    def ends_free(self) -> bool:
        """Whether the rotor may end at another speed than it has at first (`final_speed`)."""
        if self.phase.final_speed != "auto":
            return self.phase.final_speed == "free"
        return self.control.is_feedback or any(limit.is_of(RATES) for limit in self.all_limits)

    @property
    def extensions(self) -> tuple[Extension, ...]:
        """Python files and classes that define kinds of this case's class."""
        return self.kinds.extensions

    @classmethod
    def spelled_out(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Write out the stations of a resolved blade; keep a place for a flow that comes later."""
        data, keys = super().spelled_out(data), ("inflow", "resource")
        flows = [part.get(key) for part in (data, *_scenarios(data)[:1]) for key in keys]
        if flows[0] is None and any(flow is not None for flow in flows):
            data = data | {"inflow": _LATER}
        if isinstance(data.get("inflow"), SumInflow):  # of any class of parts
            data = data | {"inflow": data["inflow"].model_dump()}
        rotor, station_keys = data.get("rotor", {}), ("stations", "station_count", "chord")
        if isinstance(rotor, dict) and all(rotor.get(name) is None for name in station_keys):
            if _is_resolved(data):
                return data | {"rotor": rotor | {"station_count": STATION_COUNT}}
        return data

    def flaws(self) -> Flaws:
        """Yield a start outside the bounds of the design, and options that exclude each other.

        Scenarios of several realizations become one scenario for each.
        """
        design, rotor, control = self.design, self.rotor, self.control
        yield from super().flaws()
        yield from self._flaws_of_scenarios()
        if design.gain_bounds is not None and len(control.gain_units) != 1:
            problem = f"bounds one gain, and the law {control.law} has {len(control.gain_units)}"
            remedy = "leave design.gain_bounds out, or choose a feedback law of one gain"
            yield "design.gain_bounds", problem, remedy
        for key, needs_energy in (
            ("robustness.measure", self.robustness.relative),
            ("design.hub_inertia_price", design.hub_inertia_price),
        ):
            if needs_energy and not self.objective.is_energy:
                problem = "needs an objective that is an energy and is maximized"
                yield key, problem, "leave it out, or give an objective such as captured"
        limited = any(isinstance(x, PowerLimit | ElectricalPowerLimit) for x in self.limits.given)
        if isinstance(control, RatedFeedback) and control.power is None and not limited:
            problem = "is missing, and there is no limit of the power from which it would follow"
            remedy = "give it or limits.power, or control.law: quadratic, which needs none"
            yield "control.power", problem, remedy
        if self.phase.final_speed == "initial" and isinstance(control, FeedbackLaw):
            problem = f"is for open loop: the law {control.law} decides the speed"
            yield "phase.final_speed", problem, "give free, or control.law: open_loop"
        if self.inflow_dynamics.remembers:
            problem = "does not go with inflow_dynamics: oye"
            for key, choice, only in (
                ("rotor.reynolds", rotor.reynolds, "invariant"),
                ("hydrodynamics.torque", self.hydrodynamics.torque, "curve"),
                ("hydrodynamics.bem", self.hydrodynamics.bem, "vectorized"),
            ):
                if choice != only:
                    yield key, problem, f"give {only}, or inflow_dynamics: quasi_steady"
        problem = "takes the Reynolds number of the induced speed, not that of rotor.reynolds"
        remedy = "give vectorized, or rotor.reynolds: invariant"
        for name in ("bem", "check"):
            if rotor.reynolds == "local" and getattr(self.hydrodynamics, name) == "ccblade":
                yield f"hydrodynamics.{name}", problem, remedy
        start = [
            ("rotor.set_angle", rotor.set_angle or 0.0, "set_angle_bounds"),
            ("rotor.radius", rotor.radius, "radius_bounds"),
            ("rotor.hub_inertia", rotor.hub_inertia or None, "hub_inertia_bounds"),
        ]
        if isinstance(control, FeedbackLaw) and (gains := control.starting_gains()) is not None:
            if len(gains) != len(control.gain_units):
                problem = f"begins with {len(gains)} gains of {len(control.gain_units)} to design"
                yield "control.law", problem, "give one for each"
            start += [("control.gain", float(gain), "gain_bounds") for gain in gains]
        for name in ("chord", "twist") if design.blade == "optimized" else ():
            for index, value in enumerate(getattr(rotor, name) or ()):
                start.append((f"rotor.{name}[{index}]", value, f"{name}_bounds"))
        for key, value, name in start:
            bounds = getattr(design, name)
            if None not in (bounds, value) and not bounds[0] <= value <= bounds[1]:
                problem = f"lies outside design.{name} = [{bounds[0]:g}, {bounds[1]:g}]"
                yield key, problem, "the start must lie within the bounds: change one or the other"

    def of_scenario(self, name: str = "") -> "Case":
        """Return the case of one of its scenarios alone; for an unknown name, the case itself.

        If it has one scenario, it is that one, whatever the name.
        """
        for scenario in self.scenarios:
            if scenario.name == name or len(self.scenarios) == 1:
                made = self.of_turbine(scenario.density, scenario.condition)
                limits = {limit.name: limit for limit in scenario.limits.given}
                keys = "duration", "segments"
                mesh = {key: getattr(scenario, key) or getattr(self.phase, key) for key in keys}
                update = {
                    "inflow": scenario.inflow or self.inflow,
                    "limits": self.limits.model_copy(update=limits),
                    "phase": self.phase.model_copy(update=mesh),
                    "scenarios": (),
                }
                return made.model_copy(update=update)
        return self

    def of_turbine(self, density, condition, cavitation=None) -> "Case":
        """Return the case in other water, in another condition, at another depth; None: its own.

        `cavitation` is the limit that has the depth.
        """
        update: dict[str, Any] = {"condition": condition or self.condition}
        update["fluid"] = self.fluid.model_copy(update=density and {"density": density})
        update["limits"] = self.limits.model_copy(update=cavitation and {"cavitation": cavitation})
        return self.model_copy(update=update)

    def _flaws_of_scenarios(self) -> Flaws:
        """Yield what is wrong with scenarios; put one in place of each of their realizations."""
        if self.inflow is _LATER:
            object.__setattr__(self, "inflow", self.scenarios[0].inflow)
        weights = [scenario.weight for scenario in self.scenarios]
        if weights and not any(weights):
            remedy = "give one of them a weight above 0"
            yield "scenarios", "have weights that are all zero", remedy
        yield from self._flaws_of_condition("condition", self.condition)
        flows = ((f"scenarios[{i}].inflow", each.inflow) for i, each in enumerate(self.scenarios))
        for key, flow in (("inflow", self.inflow), *flows):
            if back := getattr(flow, "reversed_polar", None):
                yield from self._flaws_of_condition(key, Condition(polar=back), "reversed_polar")
        made: dict[str, FlowScenario] = {}
        for number, scenario in enumerate(self.scenarios):
            key = f"scenarios[{number}]"
            for limit in scenario.limits.given:
                if limit.place != "time":
                    problem = "is a limit of the design, which all scenarios share"
                    yield f"{key}.limits.{limit.name}", problem, f"give it as limits.{limit.name}"
            named = scenario.model_copy(update={"name": scenario.name or f"flow_{number + 1}"})
            for realization in named.realized(self, key):
                name = str(realization.name).lower()  # they name files
                if name in made:
                    problem, remedy = "is the name of two scenarios", "give each its own"
                    raise refusal(problem, remedy, key=f"{key}.name", value=realization.name)
                made[name] = realization
                if realization.condition is not None:
                    yield from self._flaws_of_condition(f"{key}.condition", realization.condition)
        if len(made) > MOST_SCENARIOS:
            problem = f"are {len(made)} flows with their realizations"
            yield "scenarios", problem, f"give at most {MOST_SCENARIOS}"
        object.__setattr__(self, "scenarios", tuple(made.values()))

    def _flaws_of_condition(self, key: str, condition: Condition, polar: str = "polar") -> Flaws:
        """Yield what the law or the rotor cannot have of a condition of the turbine."""
        if condition.torque_constant != 1.0 and not self.control.is_feedback:
            problem = "is that of a feedback law; the torque of an open loop is itself optimized"
            yield f"{key}.torque_constant", problem, "leave it out, or give another control.law"
        if condition.polar is not None and self.rotor.sections:
            problem = "is that of one section, and the rotor has several"
            yield f"{key}.{polar}", problem, "give factors on lift and drag instead"
        if condition.fouls and self.rotor.reynolds == "local":
            yield key, "needs rotor.reynolds: invariant", "give that, or leave it out"

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the values and the extensions: another process makes the class again."""
        again = partial(load_case, check_files=False, extensions=self.extensions)
        return again, (self.model_dump(),)

    def to_yaml(self) -> str:
        """Return the case as YAML with every default written out; `read_case` makes it again.

        Keys whose values come from the shipped blade are not written but listed in a comment.
        """
        data, shipped = self._without_shipped()
        text = dump(data)
        if not shipped:
            return text
        brings = dump(shipped, width=float("inf"), default_flow_style=True).strip()
        comment = f"  # where null, the blade {data['rotor']['blade']} brings its own: {brings}"
        return text.replace("\nrotor:\n", f"\nrotor:\n{comment}\n", 1)

    def __repr__(self) -> str:
        return f"<Case {self.name}: {self.control.law} control, {self.inflow.profile} flow>"

    def _repr_html_(self) -> str:
        """Return what differs from the defaults, as YAML for notebooks."""
        data = self.model_dump(mode="json", exclude_defaults=True)
        data["inflow"] = {"profile": self.inflow.profile} | data["inflow"]
        data["control"] = {"law": self.control.law} | data["control"]
        return f"<pre>{html.escape(dump(data))}</pre>"

    def _without_shipped(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the case as JSON without the values of its shipped blade, and these values."""
        data = self.model_dump(mode="json")
        shipped = own_keys(data["rotor"])
        # without its stations the blade would have 40
        if _is_resolved(data):
            shipped.pop("stations", None)
        data["rotor"] |= {key: [] if key == "sections" else None for key in shipped}
        # a limit of an extension that the case does not use need not be there when it is read
        built_in, limits = {kind_name(kind) for kind in BUILT_IN.of(Limit)}, data["limits"]
        data["limits"] = {key: x for key, x in limits.items() if x is not None or key in built_in}
        flows = [flow.model_dump(mode="json", exclude_none=True) for flow in self.scenarios]
        data["scenarios"] = flows
        return data, shipped

    def with_overrides(self, *overrides: str) -> "Case":
        """Return a case in which some keys have other values, checked as a file would be.

        An override is a text such as ``rotor.radius=2`` or ``control={law: linear}``; relative
        paths start from the current folder. Raises InputError for one that is not valid.
        """
        data, _ = self._without_shipped()
        return _make_case(data, overrides, self.kinds, f"case {self.name}")


def _is_resolved(data: dict[str, Any]) -> bool:
    """Tell whether a case's blade is resolved: of splines, or limited (docs/studies/stations.md).

    Limits are those besides that of the torque, of the case or of one of its scenarios.
    """
    design, limits = data.get("design"), [x.get("limits") for x in (data, *_scenarios(data))]
    values = [value for part in limits if isinstance(part, dict) for value in part.values()]
    if isinstance(design, dict):
        values += [design.get("chord_points"), design.get("twist_points")]
    return any(value is not None for value in values)


def _scenarios(data: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the scenarios in a case's data that are sections of keys."""
    entries = data.get("scenarios")
    return [x for x in entries if isinstance(x, dict)] if isinstance(entries, list | tuple) else []


_BaseCase = Case


@cache
def case_class(kinds: Kinds) -> type[Case]:
    """Return the class of the cases that may name some kinds; a subclass of `Case`."""
    resources = kinds.of(Resource)
    profiles = [x for x in kinds.of(Inflow) if not issubclass(x, SumInflow | Resource)]
    part: Any = Annotated[Union[tuple(profiles)], Field(discriminator="profile")]  # noqa: UP007
    total = _subclass(SumInflow, parts=(tuple[part, ...], Field(min_length=2, max_length=20)))
    limits: dict[str, Any] = {
        kind_name(kind): (kind | None, Field(None, description=(kind.__doc__ or "").strip()))
        for kind in kinds.of(Limit)
    }
    section = _subclass(Limits, **limits)
    scenario = _subclass(
        FlowScenario,
        inflow=_choice("inflow", [*profiles, *resources, total, None]),
        resource=_choice("resource", [*resources, None]),
        limits=(section, Field(section())),
    )
    made = _subclass(
        Case,
        scenarios=(tuple[scenario, ...], Field((), max_length=MOST_SCENARIOS)),  # type: ignore[valid-type]
        robustness=_choice("robustness", kinds.of(Aggregate)),
        inflow=_choice("inflow", [*profiles, *resources, total]),
        resource=_choice("resource", [*resources, None]),
        control=_choice("control", kinds.of(Law)),
        limits=(section, Field(section(), description=Limits.__doc__)),
        objective=_choice("objective", kinds.of(Objective)),
    )
    made.kinds = kinds
    return made


def _subclass(base: Any, **fields: Any) -> Any:
    """Return a subclass of a section, under its name, with other types of some fields."""
    return create_model(base.__name__, __base__=base, __doc__=base.__doc__, **fields)


def _choice(key: str, classes: Sequence[type[Section] | None]) -> Any:
    """Return a field that takes one of some sections, which a tag tells apart; None: or null.

    Its default is null where that is possible, else that of the case's key.
    """
    kinds = [kind for kind in classes if kind is not None]
    plain = [e for e in kinds if not any(f.is_required() for f in e.model_fields.values())]

    def describe(schema: dict[str, Any]) -> None:
        """Let the JSON schema take the bare name of a kind that has no required keys."""
        part = schema.get("anyOf", [schema])[0]
        part["oneOf"].append({"enum": [kind_name(kind) for kind in plain]})

    default = None if None in classes else _BaseCase.model_fields[key].default
    tag = Field(default, discriminator=kinds[0].named_by, json_schema_extra=describe)
    return Union[tuple(classes)], tag  # noqa: UP007


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
    (docs/dev/architecture.md); a file is executed, so give only files that you trust.
    """
    if isinstance(source, Mapping):
        data, kinds = deepcopy(dict(source)), known_kinds(extensions)
        return _make_case(data, overrides, kinds, check_files=check_files)
    path = find_case(source)
    text, file = read_text(path, "case file in YAML", MAX_CASE_BYTES), str(path)
    return read_case(text, overrides, file=file, check_files=check_files, extensions=extensions)


def read_case(
    text: str,
    overrides: Sequence[str] = (),
    *,
    file: str = "case",
    check_files: bool = True,
    extensions: Iterable[Extension] = (),
) -> Case:
    """Make a case of YAML text as if it stood in `file`, which need not exist; see `load_case`.

    Messages name the file; relative paths begin at its folder, and a case without a name has its.
    """
    data = parse(text, file)
    if data is None:
        remedy = "give at least inflow: {profile: ...} and control: {law: ...}"
        raise InputError("contains no case", remedy, file=file)
    if not isinstance(data, dict):
        problem = "must hold keys and values at its top"
        raise InputError(problem, "write inflow: ... and so on", file=file, value=data)
    return _make_case(data, overrides, known_kinds(extensions), file, check_files)


def _make_case(
    data: dict[str, Any],
    overrides: Sequence[str],
    kinds: Kinds,
    file: str = "case",
    check_files: bool = True,
) -> Case:
    """Return the case of some data, which is changed, and overrides; `file` is where it stands."""
    overrides = (overrides,) if isinstance(overrides, str) else overrides
    context = {"folder": Path(file).parent, "check_files": check_files}
    data.setdefault("name", Path(file).stem)
    return validated(case_class(kinds), data, file, overrides, context)
