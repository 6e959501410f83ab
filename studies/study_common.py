"""What the paper's reproduction and other studies share."""

import base64
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from hkt_mdo.case import Case, load_case
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import locate, shipped_cases, shipped_rotor
from hkt_mdo.pages import rendered
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.results.nesting import dominated
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.batch import improved, run_batch
from hkt_mdo.run.engine import in_processes, outcome
from hkt_mdo.run.run import run_case

LAWS = ("oloc", "linear", "quadratic")
SCENARIOS = ("step", "sine", "sine_limited")
CODESIGN = tuple(f"{scenario}_{law}" for scenario in SCENARIOS for law in LAWS)
"""The shipped cases in which blade and controller are designed together."""
NINE = shipped_rotor("bahaj2007")["stations"]
"""r/R of the paper's stations; a case with limits has 40 stations unless it gives these."""


def case_file(folder: Path | None, name: str, overrides: Sequence[str] = ()) -> Case:
    """Return a case by the name of its file.

    Parameters
    ----------
    folder : pathlib.Path or None
        Folder of the case files; None: the shipped ones.
    name : str
        Name of the file without its ending.
    overrides : sequence of str
        As of `load_case`.

    Returns
    -------
    Case
        The case.

    Raises
    ------
    InputError
        If there is no such file, or something in the case or an override is wrong.
    """
    path = (folder or shipped_cases()) / f"{name}.yaml"
    if not path.is_file():
        remedy, key = "give the folder of the shipped cases", f"--cases {path.parent}"
        raise InputError(f"has no {path.name}", remedy, key=key)
    return load_case(path, overrides)


def shipped_table(name: str, kind: str) -> np.ndarray:
    """Return the columns of a shipped table as they are in its file.

    Parameters
    ----------
    name : str
        Shipped name or path.
    kind : str
        As of `hkt_mdo.files.shipped.locate`.

    Returns
    -------
    numpy.ndarray of shape (n_rows,)
        Its fields are the columns.
    """
    return np.genfromtxt(locate(name, kind), delimiter=",", names=True)


def with_blade(case: Case, chord: Iterable[float], twist: Iterable[float], design="") -> Case:
    """Return a case with another blade.

    Parameters
    ----------
    case : Case
        The case.
    chord, twist : iterable of float
        Chord (m) and twist (deg) at the stations of the case, (n_stations,).
    design : str
        Another `design.blade`; empty: that of the case.

    Returns
    -------
    Case
        The case with this blade at the start.
    """
    blade = build_turbine(case.rotor, case.fluid, 1.0).blade
    columns = {"stations": blade.r / blade.tip_radius, "chord": chord, "twist": twist}
    shape: dict = {name: tuple(map(float, values)) for name, values in columns.items()}
    shape["station_count"] = None
    changed = {"rotor": case.rotor.model_copy(update=shape)}
    if design:
        changed["design"] = case.design.model_copy(update={"blade": design})
    return case.model_copy(update=changed)


def run_nested(
    cases: Mapping[Path, Case], jobs: int | None, done: Callable[[Path, str], None]
) -> dict[Path, Solution | None]:
    """Run every case into its folder, and again where another result shows that it can be better.

    A case that allows a better result of another one (`hkt_mdo.results.nesting`) is run from the
    best of those; the better of both results stays. What is better then may be better for others
    too; a case is run again from each at most once.

    Parameters
    ----------
    cases, jobs, done
        As of `run_batch`.

    Returns
    -------
    dict of (Solution or None)
        As of `run_batch`.
    """
    solutions = run_batch(cases, jobs, done, records=False)
    run = partial(run_case, force=True, figures=False, records=False)
    tried: set[tuple[Path, Path]] = set()
    folders = {solutions[folder].folder: folder for folder in cases if solutions[folder]}
    while True:
        entries = dominated(filter(None, solutions.values()))
        pairs = {folders[each.result.folder]: each.by.folder for each in entries}
        pairs = {key: value for key, value in pairs.items() if (key, value) not in tried}
        if not pairs:
            return solutions
        tried |= {*pairs.items()}

        def ended(folder, future):
            better, why = outcome(future)  # where it failed, the result that there was stays
            solutions[folder] = better or solutions[folder]
            done(folder, why or ("better from another's design" if better else "not better"))

        again = {x: partial(improved, solutions[x], cases[x], pairs[x], run) for x in pairs}
        in_processes(again.items(), jobs, ended)


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table in Markdown.

    Parameters
    ----------
    header : sequence of str
        Titles of the columns.
    rows : iterable of sequences of str
        Cells of each row.

    Returns
    -------
    list of str
        One line a row, and two of the header.
    """
    lines = ["| " + " | ".join(cells) + " |" for cells in (header, *rows)]
    return [lines[0], "|" + "---|" * len(header), *lines[1:]]


def percent(value: float | None, reference: float | None) -> float | None:
    """Return by how much a value exceeds a reference.

    Parameters
    ----------
    value, reference : float or None
        In the same unit.

    Returns
    -------
    float or None
        The difference over the reference, %; None where either is missing.
    """
    return None if value is None or not reference else 100.0 * (value / reference - 1.0)


def text_page(title: str, text: str, folder: Path) -> str:
    """Return a text in Markdown as an HTML page that needs no other file and no network.

    Parameters
    ----------
    title : str
        Title of the page.
    text : str
        The text; HTML in it is shown as it is written.
    folder : Path
        Where the text's images are, as PNG.

    Returns
    -------
    str
        The page.
    """
    from markdown_it import MarkdownIt

    def inside(image: re.Match) -> str:
        content = base64.b64encode((folder / image[1]).read_bytes()).decode("ascii")
        return f'src="data:image/png;base64,{content}"'

    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    template = Path(__file__).with_name("text.html")
    return rendered(template, title=title, body=re.sub('src="(.*?)"', inside, body))
