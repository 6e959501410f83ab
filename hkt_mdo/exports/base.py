"""The contract of a format, and the export of a result in several formats at once.

A format is a class with its options as keys, as a limit is: to add one, write a module with a
subclass of `Format` and name it in `hkt_mdo.exports.FORMATS`.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import Any
from warnings import catch_warnings

import numpy as np
from pydantic import create_model

from hkt_mdo.errors import InputError, did_you_mean, install, needed, program_version
from hkt_mdo.exports import FORMATS, PACKAGES
from hkt_mdo.files.table import write_new
from hkt_mdo.files.template import templates
from hkt_mdo.messages import validated
from hkt_mdo.results.design import Design
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import printable
from hkt_mdo.sections import Section

TEMPLATES = Path(__file__).with_name("templates")


class Format(Section, ABC):
    """A format: its fields are its options, with units, given as ``--set NAME.KEY=VALUE``."""

    @abstractmethod
    def files(self, design: Design) -> Mapping[str, str | bytes]:
        """Return the content of each file by its path below the folder of the export.

        Parameters
        ----------
        design : Design
            The design of a result, which has that as well.

        Returns
        -------
        mapping of str or bytes
            Content by relative path; a text in UTF-8.

        Raises
        ------
        InputError
            If the result has something that the format cannot express, with the reason.
        """


def chosen(names: Sequence[str], overrides: Iterable[str] = ()) -> list[Format]:
    """Return the formats of some names, with their options.

    Parameters
    ----------
    names : sequence of str
        Keys of `FORMATS`.
    overrides : iterable of str
        Options, such as ``stl.trailing_edge=2 mm``.

    Returns
    -------
    list of Format
        In the order of the names, each once.

    Raises
    ------
    InputError
        If a name or an option is unknown, a value is out of range, or a package is not installed.
    """
    fields: dict[str, Any] = {}
    for name in dict.fromkeys(names):
        if name not in FORMATS:
            remedy = f"{did_you_mean(name, FORMATS)}known: {', '.join(FORMATS)}"
            raise InputError("unknown format", remedy, key="--to", value=name)
        if name in PACKAGES:
            package, extra = PACKAGES[name]
            needed(package, f"install it with: {install(extra)}", key="--to", value=name)
        kind = resolve_name(f"hkt_mdo.exports.{FORMATS[name]}")
        fields[name] = kind, kind()
    with catch_warnings(action="ignore"):  # pydantic has a method `json`
        root = create_model("Exports", __base__=Section, **fields)
    made = validated(root, {}, "hkt export", overrides)
    return [getattr(made, name) for name in fields]


def export(
    solution: Solution,
    formats: Sequence[str],
    out: str | Path,
    *,
    options: Iterable[str] = (),
    force: bool = False,
) -> list[Path]:
    """Write a result in the files that other programs read.

    Parameters
    ----------
    solution : Solution
        The result; one of a run that did not succeed only with `force`, and its files say so.
    formats : sequence of str
        Keys of `FORMATS`.
    out : str or pathlib.Path
        Folder for the files; created if needed.
    options : iterable of str
        Options of the formats, such as ``stl.trailing_edge=2 mm``.
    force : bool, optional
        Also export a result that is no success, and replace files that are there already.

    Returns
    -------
    list of pathlib.Path
        The files that were written.

    Raises
    ------
    InputError
        If a format or option is unknown, a package is missing, the result is unfinished or no
        success, a format cannot express it, or a file is there already. Then nothing is written.
    """
    wanted, out = chosen(formats, options), Path(out)
    if not solution.success and not force:
        problem = f"is the result of a run that did not succeed ({solution.message})"
        remedy = "run the case again, or give --force: every file then says so"
        raise InputError(problem, remedy, file=solution.folder)
    design = solution.design()
    contents = {out / name: x for each in wanted for name, x in each.files(design).items()}
    return write_new(contents, force)


def provenance(solution: Solution) -> tuple[str, ...]:
    """Return where the files come from, in lines for the comment or attribute of a format.

    Parameters
    ----------
    solution : Solution
        The result.

    Returns
    -------
    tuple of str
        Program and version, case, result folder, and a warning if the result is no success.
    """
    lines = [
        f"written by hkt_mdo {program_version()} from the result {solution.folder.name}",
        f"case {solution.name}, control law {solution.case.control.law}",
    ]
    if not solution.success:
        lines.append(f"THE RUN WAS NO SUCCESS: {solution.message}")
    return tuple(map(printable, lines))


def cut_in(design: Design) -> float:
    """Return the speed of the flow below which the machine stands still in all scenarios.

    Parameters
    ----------
    design : Design
        The design of a result.

    Returns
    -------
    float
        In m/s; zero where the case has none.
    """
    scenarios = design.physics.scenarios
    return min(getattr(getattr(each, "resource", None), "cut_in", 0.0) for each in scenarios)


def beside_law(design: Design) -> dict[str, str]:
    """Return what an operation has besides the control law: cut-in, cut-out and friction.

    Parameters
    ----------
    design : Design
        The design of a result.

    Returns
    -------
    dict of str
        A text for each that the case has.
    """
    generator = design.physics.case.generator
    ends = {"cut-in": cut_in(design), "cut-out": design.law.cut_out}
    texts = {name: f"a flow of {speed:g} m/s" for name, speed in ends.items() if speed}
    if generator.rubs:
        constant, slope = generator.shaft_friction, generator.shaft_friction_slope
        texts["friction"] = f"{constant:g} N m and {slope:g} N m s/rad on the shaft"
    return texts


def filled(template: str, design: Design, words: dict[str, Any]) -> str:
    """Return the text of a template with its fields filled in.

    Parameters
    ----------
    template : str
        Name of a file in the folder of templates.
    design : Design
        The design of a result; a template may name it, its `blade` and its `case`, and what
        `provenance` and `beside_law` return.
    words : dict
        What else the template names; its filter `rows` writes numbers to some digits, a line each
        row.

    Returns
    -------
    str
        The text.
    """
    fields = {"design": design, "blade": design.blade, "case": design.physics.case}
    fields |= {"provenance": provenance(design.solution), "beside_law": beside_law(design)}
    return str(templates(TEMPLATES, rows=_rows).get_template(template).render(fields | words))


def _rows(values: np.ndarray, digits: int) -> str:
    """Return rows of numbers as lines of a file."""
    return "\n".join("  ".join(f"{x:.{digits}g}" for x in row) for row in np.atleast_2d(values))
