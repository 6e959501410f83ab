"""The command that runs a case."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Column
from typer import BadParameter, Exit, Option, echo

from hkt_mdo.cli import parts
from hkt_mdo.cli.sweep import run_several

_SECONDS_BETWEEN_LINES = 5.0

_FORCE = "Replace an earlier result in the folder; files that are not of a run are kept."
_RESUME = "In place of CASE: continue the unfinished run in this folder from its last iterate."
_OPTIMIZER = "IPOPT, SLSQP or SNOPT: sets driver.optimizer."
_PACKAGE = "auto, pyoptsparse, casadi (only IPOPT) or scipy (only SLSQP): sets driver.package."
_NO_RECORDS = "Write no OpenMDAO databases and no N2 diagram."
_SEGMENTS = "Number of collocation segments: sets phase.segments."


def run(
    cases: parts.Cases = None,
    out: parts.OutFolder = None,
    force: Annotated[bool, Option("--force", help=_FORCE)] = False,
    resume: Annotated[Path | None, Option(metavar="DIR", help=_RESUME)] = None,
    optimizer: Annotated[str | None, Option(metavar="NAME", help=_OPTIMIZER)] = None,
    package: Annotated[str | None, Option(metavar="NAME", help=_PACKAGE)] = None,
    segments: Annotated[int | None, Option(metavar="N", help=_SEGMENTS)] = None,
    overrides: parts.Overrides = None,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
    no_figures: parts.NoFigures = False,
    no_records: Annotated[bool, Option("--no-records", help=_NO_RECORDS)] = False,
    pdf: Annotated[bool, Option("--pdf", help="Draw the figures as PDF too.")] = False,
    jobs: parts.Jobs = None,
) -> None:
    """Run a case and write a result folder; of several cases, one folder each.

    The case is optimized, and the result is integrated independently and checked. The folder,
    results/NAME unless --out is given, where NAME is the name of the case, gets case.yaml (every
    default written out), summary.json (figures of merit and checks), trajectory.csv,
    simulation.csv, loads.csv, blade.csv, coefficients.csv, convergence.csv, solution.db and
    history.db (OpenMDAO recorders), n2.html and figures/. Other options override
    --set, and --set overrides the file.

    Several cases run in --jobs processes, each into a folder of its name in --out. Cases that
    have a finished result there are not run again, so the same command continues after an
    interruption. hkt sweep runs one case with many values of its keys.
    """
    given = {"driver.optimizer": optimizer, "driver.package": package, "phase.segments": segments}
    settings = (f"{key}={value}" for key, value in given.items() if value is not None)
    changes = [*(overrides or ()), *settings]
    if resume is not None and (cases or changes or out is not None or force):
        raise BadParameter("--resume continues a run without changes: give no other option")
    if no_figures and pdf:
        raise BadParameter("--pdf draws figures and --no-figures none: give one of them")
    if cases is not None and len(cases) > 1:
        return run_several(cases, changes, out, jobs, force, quiet, no_figures, no_records, pdf)
    if not cases and resume is None:
        raise BadParameter("give a CASE, or --resume DIR")
    loaded = parts.read_case(cases[0] if cases else Path(resume or "", "case.yaml"), changes)
    folder = resume or out or Path("results") / loaded.name
    if resume is None:
        from hkt_mdo.results.folder import check_folder

        check_folder(folder, force)  # which takes no time, unlike what a run imports
    before = _written(folder)
    try:
        with _live(loaded.name, quiet) as live:
            from hkt_mdo.run import run as runner

            how: dict[str, Any] = {"figures": ("png", "pdf") if pdf else not no_figures}
            how["records"] = not no_records
            if not quiet:
                about = loaded.name, loaded.objective.unit or "", live
                how["progress"], how["on_pass"] = _reporters(*about)
            if resume is None:
                solution = runner.run_case(loaded, folder, force=force, **how)
            else:
                solution = runner.resume_case(folder, **how, extensions=parts.EXTENSIONS.get())
    except KeyboardInterrupt:
        saved = "nothing was saved"
        if _written(folder) not in ([], before):
            names = sorted(path.name for path in folder.iterdir())
            saved = f"the results so far are saved in {folder}: {', '.join(names)}"
        parts.complain("interrupted", saved)
        raise Exit(parts.INTERRUPTED) from None
    if not quiet:
        parts.print_tables(parts.tables_of(solution))
        echo(f"\n{loaded.name}: {solution.summary.verdict(solution.case)}. Results: {folder}")
    if not solution.success:
        reason = solution.message or "the run gives no reason"
        parts.complain("error", f"no success: {reason} (the result is in {folder})")
        raise Exit(parts.NO_SUCCESS)


def _reporters(
    name: str, unit: str, live: Progress
) -> tuple[Callable[..., None], Callable[..., None]]:
    """Return what a run reports its evaluations and its passes to.

    An evaluation is the live line on a terminal, else a line every few seconds; a pass is a line.
    """
    from hkt_mdo.results.words import measured

    began = last = time.monotonic()
    number = 1

    def evaluation(count: int, value: float, infeasibility: float) -> None:
        nonlocal last
        now = time.monotonic()
        line = f"pass {number}, evaluation {count}, {measured(value, unit)}"
        line += f", infeasibility {infeasibility:.1e}"
        if live.console.is_terminal:
            live.update(live.task_ids[0], description=line)
        elif now - last >= _SECONDS_BETWEEN_LINES:
            last = now
            _tell(live, f"{name}: {now - began:.0f} s, {line}")

    def passed(entry: Any) -> None:
        nonlocal number
        number = entry.number + 1
        ended = "converged" if entry.converged else "did not converge"
        line = f"{name}: {time.monotonic() - began:.0f} s, pass {entry.number} {ended} in "
        line += f"{entry.iterations} iterations, {measured(entry.objective_J, unit)}"
        then = "optimizing again" if entry.remedy else "checking"
        live.update(live.task_ids[0], description=then)
        _tell(live, f"{line}; next, {entry.remedy}: {entry.why}" if entry.remedy else line)

    return evaluation, passed


def _tell(live: Progress, line: str) -> None:
    """Print a line above the live one; where it is no terminal, without a line break within."""
    live.console.print(line, markup=False, highlight=False, soft_wrap=not live.console.is_terminal)


@contextmanager
def _live(name: str, quiet: bool) -> Iterator[Progress]:
    """Give a line of a terminal that tells the time since it began; elsewhere a plain first one."""
    one_line = Column(no_wrap=True, overflow="ellipsis")  # what wraps would stay on the screen
    text = TextColumn("{task.description}", markup=False, table_column=one_line)
    columns = SpinnerColumn(), TimeElapsedColumn(), text
    with Progress(*columns, console=Console(quiet=quiet), transient=True) as live:
        _tell(live, f"{name}: searching for a start")
        live.add_task("searching for a start")
        yield live


def _written(folder: Path) -> list[int]:
    """Return the time at which a folder's summary was written (ns), if it is there."""
    return [path.stat().st_mtime_ns for path in folder.glob("summary.json")]
