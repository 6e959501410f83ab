"""The kinds that a case may name: control laws, flow profiles, limits and objectives.

Besides those of the package there are extensions: a Python file, a module, or classes, given to
`load_case` or to `hkt --extend`; and modules of installed packages that declare an entry point of
the group `hkt_mdo.extensions`. Each class that they define is one more kind.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

from hkt_mdo.dynamics.flows import (
    ConstantInflow,
    GustInflow,
    Inflow,
    SineInflow,
    StepInflow,
    SumInflow,
    TidalInflow,
)
from hkt_mdo.dynamics.laws import Law, LinearFeedback, OpenLoop, QuadraticFeedback
from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.dynamics.objectives import CapturedEnergy, Objective
from hkt_mdo.dynamics.sampled import RecordInflow, TurbulentInflow
from hkt_mdo.errors import InputError
from hkt_mdo.sections import Section

ENTRY_POINTS = "hkt_mdo.extensions"
_TAGS: dict[str, tuple[type[Section], str]] = {
    "laws": (Law, "law"),
    "profiles": (Inflow, "profile"),
    "limits": (Limit, ""),
    "objectives": (Objective, "kind"),
}
"""Base class of each sort of kind, and the key by which a case names it."""

Extension = str | Path | ModuleType | type


@dataclass(frozen=True)
class Kinds:
    """What a case may name, as classes; `files` are the extensions that were read from files."""

    laws: tuple[type[Law], ...]
    profiles: tuple[type[Inflow], ...]
    limits: tuple[type[Limit], ...]
    objectives: tuple[type[Objective], ...]
    files: tuple[str, ...] = ()

    def extended(self, extensions: Iterable[Extension]) -> Kinds:
        """Return these kinds and those of some extensions.

        Raises
        ------
        InputError
            If a file cannot be read or run, defines no kind, or one whose name is taken.
        """
        kinds = self
        for extension in extensions:
            if isinstance(extension, type):
                found, source = [extension], extension.__qualname__
            elif isinstance(extension, ModuleType):
                found, source = _classes(extension), extension.__name__
            else:
                source = str(Path(extension).resolve())
                found = _classes(_load(Path(source)))
                if source not in kinds.files:
                    kinds = replace(kinds, files=(*kinds.files, source))
            if not found:
                raise InputError(
                    "defines no kind",
                    "write a subclass of FeedbackLaw, Inflow, Limit or Objective "
                    "(docs/architecture.md)",
                    file=source,
                )
            for each in found:
                kinds = kinds._with(each, source)
        return kinds

    def _with(self, kind: type, source: str) -> Kinds:
        for sort, (base, _) in _TAGS.items():
            if not issubclass(kind, base):
                continue
            known: tuple[Any, ...] = getattr(self, sort)
            if kind in known:
                return self
            name = kind_name(kind)
            if not name or name in map(kind_name, known):
                problem = f"has the name {name} of another kind" if name else "has no name"
                key = _TAGS[sort][1] or "name"
                raise InputError(problem, f"give its {key} another", file=source, key=kind.__name__)
            return replace(self, **{sort: (*known, kind)})
        raise InputError(
            "is no law, profile, limit or objective",
            "derive it from FeedbackLaw, Inflow, Limit or Objective",
            file=source,
            key=kind.__name__,
        )


BUILT_IN = Kinds(
    (OpenLoop, LinearFeedback, QuadraticFeedback),
    (
        ConstantInflow,
        StepInflow,
        SineInflow,
        RecordInflow,
        TurbulentInflow,
        TidalInflow,
        GustInflow,
        SumInflow,
    ),
    (),
    (CapturedEnergy,),
)
"""The kinds of the package."""


def kind_name(kind: type) -> str:
    """Return the name by which a case calls a kind; empty for one without a name."""
    for base, tag in _TAGS.values():
        if issubclass(kind, base):
            name = kind.model_fields[tag].default if tag else kind.name  # type: ignore[attr-defined]
            return name if isinstance(name, str) else ""
    return ""


def known_kinds(extensions: Iterable[Extension] = ()) -> Kinds:
    """Return the kinds of the package, of installed packages, and of extensions."""
    return _installed().extended(extensions)


@cache
def _installed() -> Kinds:
    modules = (point.load() for point in metadata.entry_points(group=ENTRY_POINTS))
    return BUILT_IN.extended(modules)


def _classes(module: ModuleType) -> list[type]:
    """Return the kinds that a module itself defines, in their order; bases without a name not."""

    def kinds() -> Iterator[type]:
        for value in vars(module).values():
            own = isinstance(value, type) and value.__module__ == module.__name__
            if own and issubclass(value, tuple(base for base, _ in _TAGS.values())):
                yield value

    return [kind for kind in kinds() if kind_name(kind)]


def _load(path: Path) -> ModuleType:
    """Run a Python file as a module; a file of the same path and content is run once."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"cannot be read ({error.strerror})", "give --extend a Python file", file=path
        ) from None
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
    except Exception as error:
        del sys.modules[name]
        lines = [
            frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == str(path)
        ]
        raise InputError(
            f"cannot be run: {type(error).__name__}: {' '.join(str(error).split())[:200]}",
            "mend the extension",
            file=path,
            key=f"line {lines[-1]}" if lines else "",
        ) from error
    return module
