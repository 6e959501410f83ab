"""The kinds that a case may name: control laws, flow profiles, limits and objectives.

Besides those of the package there are extensions: Python files, modules or classes, given to
`load_case` or to `hkt --extend`, and modules or classes of installed packages that declare them as
an entry point of the group `hkt_mdo.extensions`. Each class that they define is one more kind.
"""

from __future__ import annotations

import importlib.util
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any, get_args

from hkt_mdo.dynamics import flows, laws, sampled, wide_laws
from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.laws import Law
from hkt_mdo.dynamics.limits import (
    CavitationLimit,
    ElectricalPowerLimit,
    Limit,
    PowerLimit,
    RootMomentLimit,
    RotorSpeedLimit,
    StressLimit,
    Taper,
    ThrustLimit,
    TipSpeedLimit,
    TorqueRateLimit,
)
from hkt_mdo.dynamics.objectives import (
    CapturedEnergy,
    ElectricalEnergy,
    GeneratorEnergy,
    Objective,
)
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.errors import InputError
from hkt_mdo.sections import Section

ENTRY_POINTS = "hkt_mdo.extensions"
_SORTS: dict[type[Section], tuple[str, str]] = {
    Law: ("laws", "law"),
    Inflow: ("profiles", "profile"),
    Limit: ("limits", "name"),
    Objective: ("objectives", "kind"),
}
"""Base class of each sort of kind: where `Kinds` has it, the attribute with the kind's name."""

_TAKEN = {"given", "torque", *dir(Section)}
_BASES = "FeedbackLaw, Inflow, Limit or Objective"

Extension = str | Path | ModuleType | type


@dataclass(frozen=True)
class Kinds:
    """What a case may name, as classes, and where they come from, but for installed packages."""

    laws: tuple[type[Law], ...]
    profiles: tuple[type[Inflow], ...]
    limits: tuple[type[Limit], ...]
    objectives: tuple[type[Objective], ...]
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
        """Return these kinds and one more; refuse it if it has no name or one that is taken."""
        sort, attribute = _sort(kind)
        name, known = kind_name(kind), getattr(self, sort, ())
        if kind in known:
            return self
        if not sort:
            problem, remedy = "is no law, profile, limit or objective", f"derive it from {_BASES}"
        elif not name:
            problem, remedy = "has no name", f"declare {attribute} as in docs/architecture.md"
        elif sort != "limits" and not get_args(kind.model_fields[attribute].annotation):
            problem = f"has its {attribute} declared as any text"
            remedy = f'write {attribute}: Literal["{name}"] = "{name}"'
        elif sort == "limits" and (not re.fullmatch("[a-zA-Z]\\w*", name) or name in _TAKEN):
            problem, remedy = f"has the name {name}, which no key can have", "give it another"
        elif name in map(kind_name, known):
            problem = f"has the name {name} of another kind"
            remedy = f"give its {attribute} another"
        else:
            return replace(self, **{sort: (*known, kind)})
        raise InputError(problem, remedy, file=source, key=kind.__name__)


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
        flows.SumInflow,
    ),
    limits=(
        PowerLimit,
        ElectricalPowerLimit,
        RotorSpeedLimit,
        TipSpeedLimit,
        ThrustLimit,
        RootMomentLimit,
        StressLimit,
        CavitationLimit,
        TorqueRateLimit,
        Taper,
    ),
    objectives=(CapturedEnergy, GeneratorEnergy, ElectricalEnergy),
)
"""The kinds of the package."""


def _sort(kind: type) -> tuple[str, str]:
    """Return where `Kinds` has a class, and the attribute with its name; empty for no kind."""
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
            problem = f"cannot be imported: {_one_line(error)}"
            remedy = "mend or uninstall the package that declares it"
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
    raise InputError("is no file, module or class", "give one", key="extension", value=extension)


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
        raise InputError("is no Python file", "give --extend a file .py", file=path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # pydantic looks annotations up there
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        frames = extract_tb(error.__traceback__)
        lines = [each.lineno for each in frames if each.filename == str(path)]
        line = error.lineno if isinstance(error, SyntaxError) else [None, *lines][-1]
        key, problem = f"line {line}" if line else "", f"cannot be run: {_one_line(error)}"
        raise InputError(problem, "mend the extension", file=path, key=key) from error
    return module


def _one_line(error: BaseException) -> str:
    """Return an error's class and text, on one line of limited length."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
