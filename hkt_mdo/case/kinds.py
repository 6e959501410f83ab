"""The kinds that a case may name: laws, flow profiles, limits, objectives and aggregates.

Besides those of the package there are extensions: Python files, modules or classes, given to
`load_case` or to `hkt --extend`, and modules or classes of installed packages that declare them as
an entry point of the group `hkt_mdo.extensions`. Each class that they define is one more kind.
"""

from __future__ import annotations

import importlib.util
import re
import sys
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any, Literal, get_args

from pydantic import Field, create_model

from hkt_mdo import quantities
from hkt_mdo.case.guard import guard, one_line
from hkt_mdo.dynamics import (
    flows,
    laws,
    limits,
    long_record,
    objectives,
    resource,
    sampled,
    wide_laws,
)
from hkt_mdo.dynamics.aggregates import Aggregate, ConditionalValueAtRisk, Expected, Worst
from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.formulas import Formula
from hkt_mdo.dynamics.laws import FeedbackLaw, Law
from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.dynamics.objectives import Objective
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.errors import InputError, show
from hkt_mdo.sections import Quantity, Section

ENTRY_POINTS = "hkt_mdo.extensions"
_SORTS: dict[type[Section], tuple[str, str]] = {
    Law: ("laws", "law"),
    Inflow: ("profiles", "profile"),
    Limit: ("limits", "name"),
    Objective: ("objectives", "kind"),
    Aggregate: ("aggregates", "measure"),
}
"""By base class: the field of `Kinds` for such kinds, and the class attribute with the kind's
name."""

_TAKEN = {"given", "torque", *dir(Section)}
_BASES = "FeedbackLaw, Inflow, Limit, Objective or Aggregate"
_FORMULAS = {"demand": FeedbackLaw, "speed_at": Inflow, "value": Aggregate}
"""By base class: the method that a kind must have."""

Extension = str | Path | ModuleType | type


@dataclass(frozen=True)
class Kinds:
    """What a case may name, as classes, and where they come from, but for installed packages."""

    laws: tuple[type[Law], ...]
    profiles: tuple[type[Inflow], ...]
    limits: tuple[type[Limit], ...]
    objectives: tuple[type[Objective], ...]
    aggregates: tuple[type[Aggregate], ...]
    extensions: tuple[str | type, ...] = ()

    def extended(self, extensions: Iterable[Extension]) -> Kinds:
        """Return these kinds and those of some extensions; raise InputError for a bad one."""
        kinds = self
        for extension in extensions:
            source, found = _read(extension)
            if not found:
                remedy = f"write a subclass of {_BASES} (docs/architecture.md)"
                raise InputError("defines no kind", remedy, file=source)
            for each in found:
                kinds = kinds._with(each, source)
            origin = [source] if isinstance(extension, str | Path) else found
            kinds = replace(kinds, extensions=tuple(dict.fromkeys((*kinds.extensions, *origin))))
        return kinds

    def _with(self, kind: Any, source: str) -> Kinds:
        """Return these kinds and one more; refuse one that lacks what a kind must have."""
        sort, attribute = _sort(kind)
        name, known = kind_name(kind), getattr(self, sort, ())
        if sort and sort != "limits" and name and attribute not in kind.model_fields:
            kind = _with_tag(kind, attribute, name)
        if kind in known:
            return self
        slip = _slip(kind, sort, attribute, name)
        if not slip and name in map(kind_name, known):
            slip = f"has the name {name} of another kind", f"give its {attribute} another"
        if slip:
            raise InputError(*slip, file=source, key=kind.__name__)
        return replace(self, **{sort: (*known, guard(kind, source))})


def _slip(kind: Any, sort: str, attribute: str, name: str) -> tuple[str, str] | None:
    """Return what a class lacks to be a kind, and the remedy; None if nothing."""
    if not sort:
        return "is not a law, profile, limit, objective or aggregate", f"derive it from {_BASES}"
    if not name:
        return "has no name", f'write {attribute}: ClassVar[str] = "a_name"'
    field = kind.model_fields.get(attribute)
    if field and not get_args(field.annotation):
        problem = f"has its {attribute} declared as any text"
        return problem, f'write {attribute}: ClassVar[str] = "{name}"'
    if sort == "limits" and (not re.fullmatch("[a-zA-Z]\\w*", name) or name in _TAKEN):
        return f"has the name {name}, which no key can have", "give it another"
    for method, base in _FORMULAS.items():
        if issubclass(kind, base) and getattr(kind, method) is getattr(base, method):
            return f"has no method {method}", f"write {method} as in docs/architecture.md"
    slip = _slip_of_formula(kind) if issubclass(kind, Formula) else None
    return slip or _slip_of_units(kind)


def _slip_of_units(kind: Any) -> tuple[str, str] | None:
    """Return which unit of a class is none that OpenMDAO knows, and the remedy; None if all are."""
    from openmdao.utils import units  # type: ignore[import-untyped]

    about = (each for field in kind.model_fields.values() for each in field.metadata)
    given = [each.unit for each in about if isinstance(each, Quantity)]
    for name in ("unit", "gain_units"):
        value = getattr(kind, name, None)
        given += [value] if isinstance(value, str) else value if isinstance(value, tuple) else []
    for unit in filter(None, given):
        if not (isinstance(unit, str) and units.valid_units(unit)):
            remedy = "write one such as m/s, N*m or kg*m**2, or None for a plain number"
            return f"has the unknown unit {show(unit)}", remedy
    if issubclass(kind, Limit) and kind.value is Formula.value and isinstance(kind.inputs, tuple):
        own = quantities.QUANTITIES[kind.inputs[0]].unit
        if kind.unit != own:
            problem = f"has the unit {kind.unit}, and {kind.inputs[0]} is in {own}"
            return problem, f"write unit = {own!r}, or a method value that converts it"
    return None


def _slip_of_formula(kind: Any) -> tuple[str, str] | None:
    """Return what is wrong with the inputs or methods of a limit or objective; None if nothing."""
    inputs = kind.inputs
    if isinstance(inputs, property):
        return None
    if isinstance(inputs, str) or not inputs or not all(isinstance(each, str) for each in inputs):
        problem = "names no inputs: the quantities that it is a formula of"
        return problem, 'write inputs: ClassVar[tuple[str, ...]] = ("rotor_speed",), or others'
    for name in inputs:
        if name not in quantities.QUANTITIES:
            return f"takes the unknown quantity {name}", quantities.nearest(name)
    own_value = kind.value is not Formula.value
    if issubclass(kind, Objective):
        if kind.rate is Objective.rate and not own_value:
            remedy = "write one of them as in docs/architecture.md"
            return "has neither a rate over time nor a value of the design", remedy
        if own_value and any(map(quantities.is_over_time, inputs)):
            problem = "has a value of the design, but takes a quantity over time"
            return problem, "write a rate instead, which is integrated"
    elif not own_value and len(inputs) > 1:
        return "takes several quantities and has no method value", "write value"
    return None


@cache
def _with_tag(kind: Any, attribute: str, name: str) -> Any:
    """Return a class like another, whose name is a field that a case may give."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the name that becomes a field
        tag: Any = (Literal[name], Field(name, description=(kind.__doc__ or "").strip()))
        about = {"__doc__": kind.__doc__, "__module__": kind.__module__}
        return create_model(kind.__name__, __base__=kind, **about, **{attribute: tag})


BUILT_IN = Kinds(
    laws=(
        laws.OpenLoop,
        laws.LinearFeedback,
        laws.QuadraticFeedback,
        wide_laws.PowerLawFeedback,
        wide_laws.RatedFeedback,
        wide_laws.CurveFeedback,
        Tracking,
    ),
    profiles=(
        flows.ConstantInflow,
        flows.StepInflow,
        flows.SineInflow,
        sampled.RecordInflow,
        sampled.TurbulentInflow,
        flows.TidalInflow,
        flows.GustInflow,
        resource.HistogramResource,
        resource.DistributionResource,
        resource.TidalResource,
        long_record.RecordResource,
        flows.SumInflow,
    ),
    limits=(
        limits.PowerLimit,
        limits.ElectricalPowerLimit,
        limits.RotorSpeedLimit,
        limits.TipSpeedLimit,
        limits.ThrustLimit,
        limits.RootMomentLimit,
        limits.StressLimit,
        limits.CavitationLimit,
        limits.TorqueRateLimit,
        limits.Taper,
    ),
    objectives=(objectives.CapturedEnergy, objectives.GeneratorEnergy, objectives.ElectricalEnergy),
    aggregates=(Expected, Worst, ConditionalValueAtRisk),
)
"""The kinds of the package."""


def _sort(kind: type) -> tuple[str, str]:
    """Return the field of `Kinds` for a class and the attribute of its name, or empty texts."""
    return next((found for base, found in _SORTS.items() if issubclass(kind, base)), ("", ""))


def kind_name(kind: Any) -> str:
    """Return the name by which a case calls a kind; empty for one without a name."""
    _, attribute = _sort(kind)
    field = kind.model_fields.get(attribute) if attribute else None
    own = (*get_args(field.annotation), field.default) if field else ()
    names = (*own, getattr(kind, attribute or "_", None))
    return next((name for name in names if isinstance(name, str)), "")


def known_kinds(extensions: Iterable[Extension] = ()) -> Kinds:
    """Return the kinds of the package, of installed packages, and of extensions."""
    return _installed().extended(extensions)


@cache
def _installed() -> Kinds:
    """Return the kinds of the package and of installed packages."""
    kinds = BUILT_IN
    for point in metadata.entry_points(group=ENTRY_POINTS):
        try:
            extension = point.load()
        except (Exception, SystemExit) as error:
            problem = f"cannot be imported: {one_line(error)}"
            remedy = "correct or uninstall the package that declares it"
            place = f"extension {point.name}"
            raise InputError(problem, remedy, file=place, key=point.value) from error
        kinds = kinds.extended([extension])
    return replace(kinds, extensions=())


def _read(extension: Extension) -> tuple[str, list[type]]:
    """Return what messages call an extension, and the kinds that it defines."""
    if isinstance(extension, type):
        return extension.__qualname__, [extension]
    if isinstance(extension, ModuleType):
        return extension.__name__, _classes(extension)
    if isinstance(extension, str | Path):
        path = Path(extension).resolve()
        return str(path), _classes(_load(path))
    raise InputError(
        "is no file, module or class",
        "give the path of a Python file",
        key="extension",
        value=extension,
    )


def _classes(module: ModuleType) -> list[type]:
    """Return the kinds that a module itself defines, in their order, without nameless bases."""
    own = (each for each in vars(module).values() if isinstance(each, type))
    return [each for each in own if each.__module__ == module.__name__ and kind_name(each)]


def _load(path: Path) -> ModuleType:
    """Run a Python file as a module; a file of the same path and content is run once."""
    try:
        content = path.read_bytes()
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise InputError(problem, "give --extend a Python file", file=path) from None
    digest = sha256(str(path).encode() + b"\0" + content).hexdigest()[:16]
    name = f"hkt_extension_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError("is no Python file", "give --extend a file that ends in .py", file=path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # pydantic looks annotations up there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        frames = extract_tb(error.__traceback__)
        lines = [each.lineno for each in frames if each.filename == str(path)]
        line = error.lineno if isinstance(error, SyntaxError) else [None, *lines][-1]
        key, problem = f"line {line}" if line else "", f"cannot be run: {one_line(error)}"
        raise InputError(problem, "correct the extension", file=path, key=key) from error
    return module
