"""What the paper's reproduction and other studies share."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from hkt_mdo.case import Case, load_case
from hkt_mdo.errors import InputError
from hkt_mdo.files.cases import shipped_cases

LAWS = ("oloc", "linear", "quadratic")
SCENARIOS = ("step", "sine", "sine_limited")
CODESIGN = tuple(f"{scenario}_{law}" for scenario in SCENARIOS for law in LAWS)
"""The shipped cases in which blade and controller are designed together."""


def case_file(folder: Path | None, name: str, overrides: Sequence[str] = ()) -> Case:
    """Return a case by the name of its file in a folder (None: the shipped cases).

    Raises InputError if there is no such file, or something in the case or an override is wrong.
    """
    path = (folder or shipped_cases()) / f"{name}.yaml"
    if not path.is_file():
        remedy, key = "give the folder of the shipped cases", f"--cases {path.parent}"
        raise InputError(f"has no {path.name}", remedy, key=key)
    return load_case(path, overrides)


def with_blade(case: Case, chord: Iterable[float], twist: Iterable[float], design="") -> Case:
    """Return a case with a blade of given chord (m) and twist (deg), and another `design.blade`."""
    shape = {"chord": tuple(map(float, chord)), "twist": tuple(map(float, twist))}
    changed = {"rotor": case.rotor.model_copy(update=shape)}
    if design:
        changed["design"] = case.design.model_copy(update={"blade": design})
    return case.model_copy(update=changed)


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (header, *rows)]
    return [lines[0], "|" + "---|" * len(header), *lines[1:]]


def percent(value: float | None, reference: float | None) -> float | None:
    """Return by how much a value exceeds a reference, %; None where either is missing."""
    return None if value is None or not reference else 100.0 * (value / reference - 1.0)
