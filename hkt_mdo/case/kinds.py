"""The kinds that a case may name: laws, flow profiles, limits, objectives and aggregates.

Each class with a name in the modules `MODULES` is a kind. Besides these there are extensions:
Python files, modules or classes, given to `load_case` or to `hkt --extend`, and modules or classes
of installed packages that declare them as an entry point of the group `hkt_mdo.extensions`. Each
class that they define is one more kind.
"""

import importlib.util
import re
import sys
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cache
from hashlib import sha256
from importlib import metadata
from itertools import chain
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, Literal

import numpy as np
from pydantic import Field, create_model

from hkt_mdo.case.guard import guard, line_of, one_line
from hkt_mdo.dynamics.aggregates import Aggregate
from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.formulas import Formula
from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.dynamics.limits import DistanceFromStall, ForwardRotation, Limit, TableEnd, TorqueLimit
from hkt_mdo.dynamics.objectives import Objective
from hkt_mdo.dynamics.resource import DurationCurve
from hkt_mdo.errors import InputError, did_you_mean, show
from hkt_mdo.quantities import OVER_TIME, QUANTITIES
from hkt_mdo.sections import Quantity, Section, is_unit, kind_name, parts_of

ENTRY_POINTS = "hkt_mdo.extensions"
MODULES = ["laws", "wide_laws", "tracking", "flows", "records", "sampled", "resource"]
MODULES += ["long_record", "limits", "objectives", "aggregates"]
"""Modules of the package's own kinds, in the order in which a case's reference lists them."""

INTERNAL = DurationCurve, TorqueLimit, ForwardRotation, DistanceFromStall, TableEnd
"""Classes there that no case names: they follow from other keys."""

_TAKEN = {"given", *dir(Section)}
_BASES = "FeedbackLaw, Inflow, Limit, Objective or Aggregate"
_FORMULAS = {"demand": FeedbackLaw, "speed_at": Inflow, "value": Aggregate}
"""By a method that a kind must have: its base class."""

Extension = str | Path | ModuleType | type


@dataclass(frozen=True)
class Kinds:
    """What a case may name, as classes, and where they come from, but for installed packages."""

    classes: tuple[type[Section], ...]
    extensions: tuple[str | type, ...] = ()

    def of(self, base: type) -> tuple[Any, ...]:
        """Return the kinds that are subclasses of a class."""
        return tuple(kind for kind in self.classes if issubclass(kind, base))

    def extended(self, extensions: Iterable[Extension]) -> "Kinds":
        """Return these kinds and those of some extensions; raise InputError for a bad one."""
        classes, origins = list(self.classes), list(self.extensions)
        for extension in extensions:
            source, definitions = _read(extension)
            if not definitions:
                remedy = f"write a subclass of {_BASES} with its name (docs/dev/architecture.md)"
                raise InputError("defines no kind", remedy, file=source)
            for definition in definitions:
                kind = _tagged(definition)
                if kind not in classes:
                    for problem, remedy in _flaws(kind, classes):
                        raise InputError(problem, remedy, file=source, key=kind.__name__)
                    classes.append(guard(kind, source))
            origins += [source] if isinstance(extension, str | Path) else definitions
        return Kinds(tuple(classes), tuple(dict.fromkeys(origins)))


def _flaws(kind: Any, others: Iterable[type]) -> Iterator[tuple[str, str]]:
    """Yield what a class lacks to be a kind, and the remedies, the most basic flaw first."""
    tag, name = getattr(kind, "named_by", ""), kind_name(kind)
    if not tag:
        yield "is not a law, profile, limit, objective or aggregate", f"derive it from {_BASES}"
    if not name:
        yield "has no name", f'write {tag}: ClassVar[str] = "a_name"'
    if tag == "name" and (not re.fullmatch("[a-zA-Z]\\w*", name) or name in _TAKEN):
        yield f"has the name {name}, which no key can have", "give it another"
    yield from _flaws_of_names(kind)
    for method, base in _FORMULAS.items():
        if issubclass(kind, base) and getattr(kind, method) is getattr(base, method):
            yield f"has no method {method}", f"write {method} as in docs/dev/architecture.md"
    if issubclass(kind, Formula) and not isinstance(kind.inputs, property):
        yield from _flaws_of_formula(kind)
    yield from _flaws_of_units(kind)
    if any(getattr(other, "named_by", "") == tag and kind_name(other) == name for other in others):
        yield f"has the name {name} of another kind", f"give its {tag} another"
    if issubclass(kind, FeedbackLaw):
        yield from _flaws_of_law(kind)


def _flaws_of_law(kind: Any) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with the gains, states or methods of a law."""
    if isinstance(kind.gain_units, str) or not kind.gain_units:
        problem = "names no gains, a tuple with the unit of each"
        yield problem, 'write gain_units: ClassVar[tuple[str, ...]] = ("N*m*s/rad",), or others'
    for method in ("rates", "at_rest", "follow", "speed_at_rest") if kind.states else ():
        if getattr(kind, method) is getattr(FeedbackLaw, method):
            yield f"has states and no method {method}", f"write {method} as in docs/controllers.md"
    for method in ("slopes", "torque"):
        if getattr(kind, method) is not getattr(FeedbackLaw, method):
            yield f"has its own {method}, which follows from demand", f"leave {method} out"
    states = kind.states if isinstance(kind.states, dict) else {}
    if isinstance(kind.states, tuple | list) or states.keys() & QUANTITIES:
        yield f"has the states {show(kind.states)}", "write a dict, by names that no quantity has"
    for state, meta in states.items():
        if not (np.shape(meta) == (2,) and (meta[0] is None or is_unit(meta[0]))):
            remedy = 'write both, such as ("N*m", "torque behind the lag")'
            yield f"has {show(meta)} for unit and description of the state {state}", remedy


def _flaws_of_names(kind: Any) -> Iterator[tuple[str, str]]:
    """Yield which names of a class are misspelt, and which of its properties are methods."""
    base: Any = next(x for x in kind.__mro__ if x.__module__.partition(".")[0] == "hkt_mdo")
    names = [name for name in dir(base) if not name.startswith("_")]
    for name in sorted({*dir(kind), *kind.model_fields} - {*dir(base), *base.model_fields}):
        for near in get_close_matches(name, names, n=1, cutoff=0.9):
            yield f"has {name}, and {base.__name__} has {near}", f"write {near}, or rename it"
    for name in names:
        if isinstance(getattr(kind, name), FunctionType) and not callable(getattr(base, name)):
            yield f"has a method {name}, which must be a value", f"write @property above {name}"


def _flaws_of_units(kind: Any) -> Iterator[tuple[str, str]]:
    """Yield which units of a class are unknown, or not those of the quantities they belong to."""
    parts = {key: parts_of(x.rebuild_annotation()) for key, x in kind.model_fields.items()}
    units = {key: [x.unit for x in part if isinstance(x, Quantity)] for key, part in parts.items()}
    value_unit, gains = getattr(kind, "unit", None), getattr(kind, "gain_units", ())
    # where they are properties they depend on the case
    stated = {"unit": [] if isinstance(value_unit, property) else [value_unit or None]}
    stated["gain_units"] = [*gains] if isinstance(gains, tuple | list) else []
    for unit in filter(None, chain(*units.values(), *stated.values())):
        if not (isinstance(unit, str) and is_unit(unit)):
            remedy = "write one such as m/s, N*m or kg*m**2, or None for a plain number"
            yield f"has the unknown unit {show(unit)}", remedy
    for key, name in (("bound", "unit"), ("gain", "gain_units")):
        for unit, other in zip(units.get(key, ()), stated[name], strict=False):
            if unit != other:
                yield f"has {key} in {unit}, and {name} = {other}", "give both the same unit"
    if issubclass(kind, Limit) and kind.value is Formula.value and isinstance(kind.inputs, tuple):
        input_unit = QUANTITIES[kind.inputs[0]].unit
        if (kind.unit or None) != input_unit:
            problem = f"has the unit {kind.unit}, and {kind.inputs[0]} is in {input_unit}"
            yield problem, f"write unit = {input_unit!r}, or a method value that converts it"


def _flaws_of_formula(kind: Any) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with the inputs or methods of a limit or objective."""
    inputs = kind.inputs
    if isinstance(inputs, str) or not inputs or not all(isinstance(name, str) for name in inputs):
        problem = "names no inputs: the quantities that it is a formula of"
        yield problem, 'write inputs: ClassVar[tuple[str, ...]] = ("rotor_speed",), or others'
    for name in inputs:
        if name not in QUANTITIES:
            remedy = f"{did_you_mean(name, QUANTITIES)}known: {', '.join(QUANTITIES)}"
            yield f"takes the unknown quantity {name}", remedy
    own_value = kind.value is not Formula.value
    if issubclass(kind, Objective):
        if kind.rate is Objective.rate and not own_value:
            remedy = "write one of them as in docs/dev/architecture.md"
            yield "has neither a rate over time nor a value of the design", remedy
        if own_value and {*inputs} & {*OVER_TIME}:
            problem = "has a value of the design, but takes a quantity over time"
            yield problem, "write a rate instead, which is integrated"
    elif not own_value and len(inputs) > 1:
        yield "takes several quantities and has no method value", "write value"


@cache
def _tagged(kind: Any) -> Any:
    """Return a class like another, whose name is a field that a case may give; limits need none."""
    tag, name = getattr(kind, "named_by", ""), kind_name(kind)
    if tag in ("", "name") or not name:
        return kind
    if tag in kind.model_fields and kind.model_fields[tag].annotation is not str:
        return kind
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the name that becomes a field
        field: Any = (Literal[name], Field(name, description=(kind.__doc__ or "").strip()))
        attributes = {"__doc__": kind.__doc__, "__module__": kind.__module__}
        return create_model(kind.__name__, __base__=kind, **attributes, **{tag: field})


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
            source = f"extension {point.name}"
            raise InputError(problem, remedy, file=source, key=point.value) from error
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
    remedy = "give the path of a Python file"
    raise InputError("is no file, module or class", remedy, key="extension", value=extension)


def _classes(module: ModuleType) -> list[type]:
    """Return the kinds that a module itself defines, in their order, without nameless bases."""
    classes = (kind for kind in vars(module).values() if isinstance(kind, type))
    return [kind for kind in classes if kind.__module__ == module.__name__ and kind_name(kind)]


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
        key, problem = line_of(error, str(path)), f"cannot be run: {one_line(error)}"
        raise InputError(problem, "correct the extension", file=path, key=key) from error
    return module


_OWN = chain(*(_classes(importlib.import_module(f"hkt_mdo.dynamics.{x}")) for x in MODULES))
BUILT_IN = Kinds(tuple(kind for kind in _OWN if kind not in INTERNAL))
"""The kinds of the package."""
