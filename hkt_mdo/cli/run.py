"""The command that runs a case."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import BadParameter, Exit, Option, echo

from hkt_mdo.cli.parts import (
    CASE,
    EXTENSIONS,
    INTERRUPTED,
    NO_SUCCESS,
    NoFigures,
    OutFolder,
    Overrides,
    complain,
    print_result,
    read_case,
)

if TYPE_CHECKING:
    from rich.console import Console

_SECONDS_BETWEEN_LINES = 5.0

_RESUME = (
    "In place of CASE: go on with the interrupted or failed run in this result folder from its "
    "last recorded iterate."
)
_OPTIMIZER = "IPOPT, SLSQP or SNOPT: sets driver.optimizer. Default: as the case says."
_PACKAGE = (
    "What provides the optimizer; auto, pyoptsparse, casadi (IPOPT alone) or scipy (SLSQP alone): "
    "sets driver.package. Default: as the case says."
)
_SEGMENTS = "Number of collocation segments: sets phase.segments. Default: as the case says."


def run(
    case: Annotated[Path | None, CASE] = None,
    out: OutFolder = None,
    force: Annotated[
        bool, Option("--force", help="Replace an earlier result in the folder.")
    ] = False,
    resume: Annotated[Path | None, Option(metavar="DIR", help=_RESUME)] = None,
    optimizer: Annotated[str | None, Option(metavar="NAME", help=_OPTIMIZER)] = None,
    package: Annotated[str | None, Option(metavar="NAME", help=_PACKAGE)] = None,
    segments: Annotated[int | None, Option(metavar="N", help=_SEGMENTS)] = None,
    overrides: Overrides = None,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
    no_figures: NoFigures = False,
    pdf: Annotated[bool, Option("--pdf", help="Draw the figures as PDF too.")] = False,
) -> None:
    """Run a case and write a result folder.

    The case is optimized, the result integrated independently and judged. The folder, results/<name
    of the case> unless --out is given, gets case.yaml (every default written out), summary.json
    (figures of merit and checks), trajectory.csv, simulation.csv, power_curve.csv, convergence.csv,
    solution.db and history.db (OpenMDAO recorders), n2.html and figures/. Options override --set,
    --set overrides the file.
    """
    from rich.console import Console

    given = {"driver.optimizer": optimizer, "driver.package": package, "phase.segments": segments}
    settings = [f"{key}={value}" for key, value in given.items() if value is not None]
    changes = [*(overrides or ()), *settings]
    if resume is not None and (case is not None or changes or out is not None or force):
        raise BadParameter("--resume goes on with a run as it is: give nothing else")
    if no_figures and pdf:
        raise BadParameter("--pdf draws figures and --no-figures none: give one of them")
    source = case if resume is None else resume / "case.yaml"
    if source is None:
        raise BadParameter("give a CASE, or --resume DIR")
    loaded = read_case(source, changes)
    folder = resume or out or Path("results") / loaded.name
    console = Console(quiet=quiet, highlight=False)
    before = _written(folder)
    try:
        with _progress(console, loaded.name) as progress:
            from hkt_mdo.run import run as runner

            figures = ("png", "pdf") if pdf else not no_figures
            how: dict[str, Any] = {"progress": progress, "figures": figures}
            if resume is None:
                solution = runner.run_case(loaded, folder, force=force, **how)
            else:
                solution = runner.resume_case(folder, **how, extensions=EXTENSIONS.get())
    except KeyboardInterrupt:
        complain("interrupted", _saved(folder, before))
        raise Exit(INTERRUPTED) from None
    print_result(console, solution)
    for line in (*(f"note: {note}" for note in solution.notes), f"Results: {folder}"):
        console.print(line, markup=False, soft_wrap=True)
    if not solution.success:
        reason = solution.message or "the run gives no reason"
        complain("error", f"no success: {reason} (what was found is in {folder})")
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
            what = f"evaluation {count}, energy {energy:.0f} J, infeasibility {infeasibility:.1e}"
            if console.is_terminal:
                status.update(f"{name}: {what}")
            elif time.monotonic() - last >= _SECONDS_BETWEEN_LINES:
                last = time.monotonic()
                echo(f"{name}: {what}")

        yield report


def _written(folder: Path) -> int | None:
    """Return the time at which a folder's summary was written (ns); None: there is none."""
    try:
        return (folder / "summary.json").stat().st_mtime_ns
    except OSError:
        return None


def _saved(folder: Path, before: int | None) -> str:
    """Return what an interrupted run saved; `before` is the time of an earlier summary."""
    if _written(folder) in (None, before):
        return "nothing was saved"
    names = sorted(path.name for path in folder.iterdir())
    return f"what there was is saved in {folder}: {', '.join(names)}"
