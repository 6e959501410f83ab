"""The command that runs a case."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, BadParameter, Exit, Option, echo

from hkt_mdo.cli.look import print_solution
from hkt_mdo.cli.parts import (
    CASE_HELP,
    INTERRUPTED,
    NO_SUCCESS,
    Extend,
    Overrides,
    complain,
    extensions,
)

if TYPE_CHECKING:
    from rich.console import Console

_SECONDS_BETWEEN_LINES = 5.0

_Case = Annotated[Path | None, Argument(metavar="CASE", help=CASE_HELP, show_default=False)]
_Out = Annotated[
    Path | None,
    Option(
        metavar="DIR", help="Result folder, made anew.", show_default="results/<name of the case>"
    ),
]
_Resume = Annotated[
    Path | None,
    Option(
        metavar="DIR",
        help="In place of CASE: go on with the interrupted or failed run in this result folder "
        "from its last recorded iterate.",
    ),
]
_Optimizer = Annotated[
    str | None,
    Option(
        metavar="NAME",
        help="IPOPT, SLSQP or SNOPT: sets driver.optimizer.",
        show_default="as the case says, else IPOPT",
    ),
]
_Package = Annotated[
    str | None,
    Option(
        metavar="NAME",
        help="What provides the optimizer; auto, pyoptsparse, casadi (IPOPT alone) or scipy "
        "(SLSQP alone): sets driver.package.",
        show_default="as the case says, else auto",
    ),
]
_Segments = Annotated[
    int | None,
    Option(
        metavar="N",
        help="Number of collocation segments: sets phase.segments.",
        show_default="as the case says, else from its flow",
    ),
]


def run(
    case: _Case = None,
    out: _Out = None,
    force: Annotated[
        bool, Option("--force", help="Replace an earlier result in the folder.")
    ] = False,
    resume: _Resume = None,
    optimizer: _Optimizer = None,
    package: _Package = None,
    segments: _Segments = None,
    overrides: Overrides = None,
    extend: Extend = None,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
    no_figures: Annotated[
        bool, Option("--no-figures", help="Leave the figures out; hkt plot draws them.")
    ] = False,
    pdf: Annotated[bool, Option("--pdf", help="Draw the figures as PDF too.")] = False,
) -> None:
    """Run a case and write a result folder.

    The case is optimized, the result integrated independently and judged. The folder gets case.yaml
    (every default written out), summary.json (figures of merit and checks), trajectory.csv,
    simulation.csv, power_curve.csv, convergence.csv, solution.db and history.db (OpenMDAO
    recorders), n2.html and figures/. Options override --set, --set overrides the file.
    """
    from rich.console import Console

    from hkt_mdo.case import load_case

    given = {"driver.optimizer": optimizer, "driver.package": package, "phase.segments": segments}
    changes = [f"{key}={value}" for key, value in given.items() if value is not None]
    changes = [*(overrides or ()), *changes]
    if resume is not None and (case is not None or changes or out is not None or force):
        raise BadParameter("--resume goes on with a run as it is: give nothing else")
    if no_figures and pdf:
        raise BadParameter("--pdf draws figures and --no-figures none: give one of them")
    source = case if resume is None else resume / "case.yaml"
    if source is None:
        raise BadParameter("give a CASE, or --resume DIR")
    loaded = load_case(source, changes, **extensions(extend))
    folder = resume or out or Path("results") / loaded.name
    console = Console(quiet=quiet, highlight=False)
    before = _written(folder)
    try:
        with _progress(console, loaded.name) as progress:
            from hkt_mdo.run import run as runner

            how = {"progress": progress, "figures": not no_figures}
            if resume is None:
                solution = runner.run_case(loaded, folder, force=force, **how)
            else:
                solution = runner.resume_case(folder, **how, **extensions(extend))
    except KeyboardInterrupt:
        complain("interrupted", _saved(folder, before))
        raise Exit(INTERRUPTED) from None
    if pdf:
        from hkt_mdo.results.plots import save_figures

        save_figures(solution, folder / "figures", ("pdf",))
    print_solution(console, solution)
    for line in (*(f"note: {note}" for note in solution.notes), f"Results: {folder}"):
        console.print(line, markup=False, soft_wrap=True)
    if not solution.success:
        complain("error", f"no success: {solution.message or 'the run gives no reason'}")
        if quiet:
            complain("error", f"what was found is in {folder}")
        raise Exit(NO_SUCCESS)


@contextmanager
def _progress(console: Console, name: str) -> Iterator[Callable[[int, float, float], None] | None]:
    """Yield what a run reports to: a live line on a terminal, else a line every few seconds."""
    if console.quiet:
        yield None
        return
    last = time.monotonic()
    with console.status(f"{name}: preparing") as status:

        def report(count: int, energy: float, infeasibility: float) -> None:
            nonlocal last
            line = (
                f"{name}: evaluation {count}, energy {energy:.0f} J, infeasibility "
                f"{infeasibility:.1e}"
            )
            if console.is_terminal:
                status.update(line)
            elif time.monotonic() - last >= _SECONDS_BETWEEN_LINES:
                last = time.monotonic()
                echo(line)

        yield report


def _written(folder: Path) -> int | None:
    """Return the time at which a folder's summary was written (ns); None: there is none."""
    try:
        return (folder / "summary.json").stat().st_mtime_ns
    except OSError:
        return None


def _saved(folder: Path, before: int | None) -> str:
    """Return what an interrupted run saved; `before` is the age of an earlier summary."""
    if _written(folder) in (None, before):
        return "nothing was saved"
    names = sorted(path.name for path in folder.iterdir())
    return f"what there was is saved in {folder}: {', '.join(names)}"
