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
_SORTS: dict[str, tuple[type[Section], str]] = {
    "laws": (Law, "law"),
    "profiles": (Inflow, "profile"),
    "limits": (Limit, "name"),
    "objectives": (Objective, "kind"),
}
"""Base class of each sort of kind, and the attribute that has the kind's name."""

_TAKEN = {"given", *dir(Section)}
_BASES = "FeedbackLaw, Inflow, Limit or Objective"

Extension = str | Path | ModuleType | type


@dataclass(frozen=True)
class Kinds:
    """What a case may name, as classes, and the extensions (files, classes) that they come from.

    Kinds of installed packages are among the classes, but not among the extensions.
    """

    laws: tuple[type[Law], ...]
    profiles: tuple[type[Inflow], ...]
    limits: tuple[type[Limit], ...]
    objectives: tuple[type[Objective], ...]
    extensions: tuple[str | type, ...] = ()

    def extended(self, extensions: Iterable[Extension]) -> Kinds:
        """Return these kinds and those of some extensions.

        Raises
        ------
        InputError
            If a file cannot be read or run, defines no kind, or one whose name is taken.
        """
        kinds = self
        for extension in extensions:
            source, found = _read(extension)
            if not found:
                raise InputError(
                    "defines no kind",
                    f"write a subclass of {_BASES} (docs/architecture.md)",
                    file=source,
                )
            for each in found:
                kinds = kinds._with(each, source)
            origin = [source] if isinstance(extension, str | Path) else found
            kinds = replace(kinds, extensions=tuple(dict.fromkeys((*kinds.extensions, *origin))))
        return kinds

    def _with(self, kind: Any, source: str) -> Kinds:
        """Return these kinds and one more; refuse it if it has no name or one that is taken."""
        sort = next((sort for sort, (base, _) in _SORTS.items() if issubclass(kind, base)), "")
        known: tuple[Any, ...] = getattr(self, sort, ())
        if kind in known:
            return self
        attribute, name = _SORTS[sort][1] if sort else "", kind_name(kind)
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
            problem, remedy = (
                f"has the name {name} of another kind",
                f"give its {attribute} another",
            )
        else:
            return replace(self, **{sort: (*known, kind)})
        raise InputError(problem, remedy, file=source, key=kind.__name__)


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
    for base, attribute in _SORTS.values():
        if issubclass(kind, base):
            field = kind.model_fields.get(attribute)
            names = (
                (*get_args(field.annotation), field.default)
                if field
                else (getattr(kind, attribute),)
            )
            return next((name for name in names if isinstance(name, str)), "")
    return ""


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
            raise InputError(
                f"cannot be imported: {_one_line(error)}",
                "mend or uninstall the package that declares it",
                file=f"extension {point.name}",
                key=point.value,
            ) from error
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
    bases = tuple(base for base, _ in _SORTS.values())
    return [
        value
        for value in vars(module).values()
        if isinstance(value, type)
        and value.__module__ == module.__name__
        and issubclass(value, bases)
        and kind_name(value)
    ]


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
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        lines = [
            each.lineno for each in extract_tb(error.__traceback__) if each.filename == str(path)
        ]
        if isinstance(error, SyntaxError):
            lines.append(error.lineno)
        raise InputError(
            f"cannot be run: {_one_line(error)}",
            "mend the extension",
            file=path,
            key=f"line {lines[-1]}" if lines and lines[-1] else "",
        ) from error
    return module


def _one_line(error: BaseException) -> str:
    """Return an error's class and text, on one line of limited length."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
