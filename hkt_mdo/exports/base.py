"""The contract of a format, and the export of a result in several formats at once.

A format is a class with its options as keys, as a limit is: to add one, write a module with a
subclass of `Format` and name it in `hkt_mdo.exports.FORMATS`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field, create_model

from hkt_mdo.case.schema import assign
from hkt_mdo.errors import InputError, did_you_mean, install, program_version
from hkt_mdo.exports import FORMATS
from hkt_mdo.files.table import write_new
from hkt_mdo.files.template import templates
from hkt_mdo.messages import validated
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import printable
from hkt_mdo.sections import Section

if TYPE_CHECKING:
    from hkt_mdo.results.design import Design

TEMPLATES = Path(__file__).with_name("templates")


@dataclass(frozen=True, eq=False)
class Source:
    """What is exported.

    Attributes
    ----------
    solution : Solution
        The result.
    """

    solution: Solution

    @cached_property
    def design(self) -> Design:
        """Blade, polars, outlines, law and turbine of the result, made once for all formats.

        Returns
        -------
        hkt_mdo.results.design.Design
            The design as objects.
        """
        return self.solution.design()

    @property
    def provenance(self) -> tuple[str, ...]:
        """Where the files come from, in lines for the comment or attribute of a format.

        Returns
        -------
        tuple of str
            Program and version, case, result folder, and a warning if the result is no success.
        """
        solution = self.solution
        lines = [
            f"written by hkt_mdo {program_version()} from the result {solution.folder.name}",
            f"case {solution.name}, control law {solution.case.control.law}",
        ]
        if not solution.success:
            lines.append(f"THE RUN WAS NO SUCCESS: {solution.message}")
        return tuple(map(printable, lines))


class Format(Section, ABC):
    """A format: its fields are its options, with units, given as ``--set NAME.KEY=VALUE``.

    Attributes
    ----------
    name : str
        Its name in `hkt export --to`.
    packages : tuple of str
        Modules that it imports and that do not come with hkt_mdo.
    extra : str
        Extra of hkt_mdo that installs them.
    """

    name: ClassVar[str]
    packages: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    @abstractmethod
    def files(self, source: Source) -> dict[str, bytes]:
        """Return the content of each file by its path below the folder of the export.

        Parameters
        ----------
        source : Source
            The result and its design.

        Returns
        -------
        dict of bytes
            Content by relative path.

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
        module, _, attribute = FORMATS[name].partition(":")
        kind: type[Format] = getattr(import_module(f"hkt_mdo.exports.{module}"), attribute)
        missing = [package for package in kind.packages if find_spec(package) is None]
        if missing:
            remedy = f"install it with: {install(kind.extra)}"
            problem = f"needs {', '.join(missing)}, which is not installed"
            raise InputError(problem, remedy, key="--to", value=name)
        fields[name] = kind, Field(default_factory=kind, description=f"Options of {name}.")
    root = create_model("Exports", __base__=Section, **fields)
    data: dict[str, Any] = {}
    given = {assign(data, override, "hkt export"): override for override in overrides}
    made = validated(root, data, "hkt export", given)
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
    source, contents = Source(solution), {}
    for each in wanted:
        for name, content in each.files(source).items():
            if out / name in contents:
                remedy = "export the formats into folders of their own"
                raise InputError("is written by two formats", remedy, file=out / name)
            contents[out / name] = content
    return write_new(contents, force)


def filled(template: str, words: dict[str, Any]) -> str:
    """Return the text of a template with its fields filled in.

    Parameters
    ----------
    template : str
        Name of a file in the folder of templates.
    words : dict
        What the template names.

    Returns
    -------
    str
        The text.
    """
    return str(templates(TEMPLATES).get_template(template).render(words))
