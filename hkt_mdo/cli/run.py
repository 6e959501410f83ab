"""The commands that optimize: run a case or several, and a sweep."""

import os
import sys
import time
from collections import Counter
from datetime import timedelta
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Column
from typer import Argument, BadParameter, Option, confirm, echo

from hkt_mdo.cli import parts
from hkt_mdo.errors import InputError

if TYPE_CHECKING:
    from hkt_mdo.case import Case

_SECONDS_BETWEEN_LINES = 5.0
ASKED = 1000
"""Number of runs above which the user is asked."""
MOST_TOLD = 10
"""Failures that are listed; the table has all."""


def run(
    cases: Annotated[list[Path] | None, Argument(metavar="CASE...", show_default=False)] = None,
    out: parts.OutFolder = None,
    force: Annotated[bool, Option("--force")] = False,
    resume: Annotated[Path | None, Option(metavar="DIR")] = None,
    optimizer: Annotated[str | None, Option(metavar="NAME")] = None,
    package: Annotated[str | None, Option(metavar="NAME")] = None,
    segments: Annotated[int | None, Option(metavar="N")] = None,
    overrides: parts.Overrides = None,
    quiet: Annotated[bool, Option("--quiet")] = False,
    no_figures: Annotated[bool, Option("--no-figures")] = False,
    no_records: Annotated[bool, Option("--no-records")] = False,
    pdf: Annotated[bool, Option("--pdf")] = False,
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

    Parameters
    ----------
    cases
        Case file in YAML, such as cases/sine_quadratic.yaml; several run at the same time.
    force
        Replace an earlier result in the folder; files that are not of a run are kept.
    resume
        In place of CASE: continue the unfinished run in this folder from its last iterate.
    optimizer
        IPOPT, SLSQP or SNOPT: sets driver.optimizer.
    package
        auto, pyoptsparse, casadi (only IPOPT) or scipy (only SLSQP): sets driver.package.
    segments
        Number of collocation segments: sets phase.segments.
    quiet
        Print nothing but errors.
    no_figures
        Draw no figures.
    no_records
        Write no OpenMDAO databases and no N2 diagram.
    pdf
        Draw the figures as PDF too.
    """
    values = {"driver.optimizer": optimizer, "driver.package": package, "phase.segments": segments}
    settings = (f"{key}={value}" for key, value in values.items() if value is not None)
    changes = [*(overrides or ()), *settings]
    if resume is not None and (cases or changes or out is not None or force):
        raise BadParameter("--resume continues a run without changes: give no other option")
    if no_figures and pdf:
        raise BadParameter("--pdf draws figures and --no-figures none: give one of them")
    if not cases and resume is None:
        raise BadParameter("give a CASE, or --resume DIR")
    how: dict[str, Any] = {"figures": ("png", "pdf") if pdf else not no_figures}
    how["records"] = not no_records
    loaded = [parts.read_case(x, changes) for x in cases or [Path(resume or "", "case.yaml")]]
    if len(loaded) > 1:
        _run_several(loaded, out or Path("results"), jobs, force, quiet, how)
    else:
        _run_one(loaded[0], resume or out, None if resume else force, quiet, how)


def _run_one(
    case: "Case", out: Path | None, force: bool | None, quiet: bool, how: dict[str, Any]
) -> None:
    """Run a case into a folder, or with `force` None continue its run there; tell what came out."""
    from hkt_mdo.files.table import file_state
    from hkt_mdo.results.folder import check_folder

    folder = out or Path("results", case.name)
    if force is not None:
        check_folder(folder, force)  # which takes no time, unlike what a run imports
    before = file_state(folder / "summary.json")

    def saved() -> str:
        if file_state(folder / "summary.json") in (None, before):
            return "nothing was saved"
        names = sorted(path.name for path in folder.iterdir())
        return f"the results so far are saved in {folder}: {', '.join(names)}"

    parts.SAVED.set(saved)
    first, unit = f"{case.name}: searching for a start", case.objective.unit or ""
    with _Live(first, quiet, case.name, unit) as live:
        from hkt_mdo.run import run as runner

        how |= {"progress": live.evaluated, "on_pass": live.passed, "on_start": live.started}
        if force is None:
            solution = runner.resume_case(folder, **how, extensions=parts.EXTENSIONS.get())
        else:
            solution = runner.run_case(case, folder, force=force, **how)
    if not quiet:
        parts.print_tables(solution.overview)
        echo(f"\n{case.name}: {solution.summary.verdict(solution.case)}. Results: {folder}")
    if not solution.success:
        raise parts.failed(f"no success: {solution.message} (the result is in {folder})")


class _Live(Progress):
    """A line of a terminal with the time since it began, and the lines that are told above it.

    Parameters
    ----------
    first : str
        The first line, which is told too.
    quiet : bool
        Whether nothing is shown.
    name : str
        Where given, the other lines begin with it and the time.
    unit : str
        That of the objective of a run.
    """

    def __init__(self, first: str, quiet: bool, name: str = "", unit: str = "") -> None:
        one_line = Column(no_wrap=True, overflow="ellipsis")  # what wraps would stay on the screen
        text = TextColumn("{task.description}", markup=False, table_column=one_line)
        columns = SpinnerColumn(), TimeElapsedColumn(), text
        super().__init__(*columns, console=Console(quiet=quiet), transient=True)
        self.name, self.began, self.last = "", time.monotonic(), time.monotonic()
        self.tell(first)
        self.name, self.line = name, self.add_task(first)
        self.unit, self.passes, self.starts, self.older = unit, 0, 0, 0

    def show(self, line: str, ends: bool = False) -> None:
        """Update the line; where it is no terminal, tell it every few seconds, and at the end."""
        if self.console.is_terminal:
            self.update(self.line, description=line)
        elif ends or time.monotonic() - self.last >= _SECONDS_BETWEEN_LINES:
            self.last = time.monotonic()
            self.tell(line)

    def tell(self, line: str) -> None:
        """Print a line above the live one; where it is no terminal, without a line break within."""
        line = f"{self.name}: {time.monotonic() - self.began:.0f} s, {line}" if self.name else line
        soft = not self.console.is_terminal
        self.console.print(line, markup=False, highlight=False, soft_wrap=soft)

    def amount(self, objective: float, unit: str = "") -> str:
        """Return an objective with its unit."""
        from hkt_mdo.results.words import measured

        return measured(objective, unit or self.unit)

    def started(self, record: Any) -> None:
        """Show a start that was tried."""
        self.starts += 1
        where = record.strategy + f" on {record.branch}" * bool(record.branch)
        line = f"start {self.starts}, {where}, {record.law.replace('_', ' ')}"
        self.show(f"{line}: {self.amount(record.objective, 'J')}")

    def evaluated(self, count: int, objective: float, infeasibility: float) -> None:
        """Show an evaluation of the optimizer."""
        line = f"pass {self.passes + 1}, evaluation {count}, {self.amount(objective)}"
        self.show(f"{line}, infeasibility {infeasibility:.1e}")

    def passed(self, entry: Any) -> None:
        """Tell the end of an optimization, and what follows."""
        self.passes = entry.number
        ended = "converged" if entry.converged else "did not converge"
        line = f"pass {entry.number} {ended} in {entry.iterations} iterations, "
        line += self.amount(entry.objective_J)
        self.update(self.line, description="optimizing again" if entry.remedy else "checking")
        self.tell(f"{line}; next, {entry.remedy}: {entry.why}" if entry.remedy else line)

    def swept(self, now: Any) -> None:
        """Show how far a sweep is; tell the first result that is replaced."""
        if now.older and not self.older:
            self.tell("results of another version, or of other files, are computed again")
        self.older = now.older
        done = now.reused + now.computed
        line = f"{done:,} of {now.total:,} runs"
        line += f", {now.reused:,} from before" if now.reused else ""
        line += f", {now.failed:,} without success" if now.failed else ""
        if now.left is not None and done < now.total:
            line += f", about {timedelta(seconds=round(now.left))} left"
        self.show(line, ends=done == now.total)


def _run_several(
    cases: "list[Case]", out: Path, jobs: int | None, force: bool, quiet: bool, how: dict[str, Any]
) -> None:
    """Run several cases into folders of their names; tell each that ends."""
    from hkt_mdo.results.folder import check_folder
    from hkt_mdo.run.batch import begun, run_batch

    names = [case.name for case in cases]
    if twice := [name for name in names if names.count(name) > 1]:
        where = {"key": "name", "value": twice[0]}
        raise InputError("is the name of two cases", "give each its own", **where)
    plan, ended = {out / case.name: case for case in cases}, count(1)
    for folder, case in plan.items():
        if not begun(folder, case):
            check_folder(folder, force)

    def tell(folder: Path, word: str) -> None:
        number = next(ended)
        if not quiet:
            echo(f"{number} of {len(plan)}: {folder}: {word}")

    parts.SAVED.set(lambda: f"finished results are in {out}; the same command continues")
    results = run_batch(plan, jobs, tell, **how)
    if failed := [path for path, each in results.items() if each is None or not each.success]:
        raise parts.failed(f"no success: {', '.join(map(str, failed))}")


# Sweeps ------------------------------------------------------------------------------------------

_YES = f"Run more than {ASKED:,} cases without being asked."


def sweep(
    sweep: Annotated[Path, Argument(metavar="SWEEP", show_default=False)],
    out: parts.OutFolder = None,
    jobs: parts.Jobs = None,
    scheduler: Annotated[str | None, Option(metavar="ADDRESS")] = None,
    yes: Annotated[bool, Option("--yes", help=_YES)] = False,
    quiet: Annotated[bool, Option("--quiet")] = False,
) -> None:
    """Run a case with many values of its keys, and write a table.

    The folder, results/NAME unless --out is given, gets sweep.yaml, a result folder for each run in
    runs, and one row a run in table.csv (table.parquet and grid.nc too, where pandas and xarray are
    installed). A run that fails is a row with its message. The same command continues an
    interrupted sweep: runs that are finished are not repeated. hkt plot and hkt report take the
    folder, too.

    Parameters
    ----------
    sweep
        Sweep file in YAML: a case, and values of its keys (docs/sweeps.md).
    scheduler
        Address of a Dask scheduler, tcp://HOST:PORT or tls://HOST:PORT, whose workers run the
        cases; by default workers are started here. With tcp, anybody who reaches it can run
        programs on it.
    quiet
        Print nothing but errors.
    """
    from hkt_mdo.case.sweep import load_sweep

    asked = load_sweep(sweep, parts.EXTENSIONS.get())
    folder = out or Path("results") / sweep.stem
    parts.SAVED.set(lambda: f"finished runs are in {folder}; the same command continues")
    with _Live(f"{sweep.stem}: {asked.size:,} runs", quiet) as live:
        from hkt_mdo.run.sweep import run_sweep

        if asked.size > ASKED and not yes:
            first = run_sweep(asked, folder, 1, scheduler=scheduler, most=2)
            seconds = [x for row in first if (x := row.get("wall_seconds"))]
            live.stop()
            # how many workers a scheduler has is not known
            _ask(asked.size, seconds, 1 if scheduler else jobs or os.cpu_count() or 1)
            live.start()
        rows = run_sweep(asked, folder, jobs, live.swept, scheduler=scheduler)
    states = Counter(row["state"] for row in rows)
    if not quiet:
        _summarize(rows, states, folder)
    if not states["verified"]:
        raise parts.failed(f"no run is a success: see {folder / 'table.csv'}")


def _ask(size: int, seconds: list[float], workers: int) -> None:
    """Ask whether so many runs are meant, each of which takes some seconds."""
    took = "an unknown time"
    if seconds:
        left = timedelta(seconds=round(size * seconds[-1] / workers))
        took = f"about {left} (one took {seconds[-1]:.2g} s) on {workers} worker"
        took += "s" * (workers > 1)
    problem = f"asks for {size:,} runs, which take {took}"
    if sys.stdin.isatty() and confirm(f"This {problem}. Run them all?"):
        return
    remedy = "give fewer values, or samples: 1000 of ranges without a count; --yes runs them all"
    raise InputError(problem, remedy, key="over")


def _summarize(rows: list[dict[str, Any]], states: Counter[str], folder: Path) -> None:
    """Print what came of a sweep."""
    echo(", ".join(f"{state}: {count:,}" for state, count in states.items()))
    failed = [row for row in rows if row["state"] != "verified"]
    for row in failed[:MOST_TOLD]:
        echo(f"  {row['run'] or 'no run'}: {row['message']}")
    if len(failed) > MOST_TOLD:
        echo(f"  and {len(failed) - MOST_TOLD:,} more: see the table")
    if won := sum(row.get("start") == "neighbour" for row in rows):
        echo(f"the design of a neighbour led to the better result in {won:,} of {len(rows):,} runs")
    echo(f"Table: {folder / 'table.csv'}")
