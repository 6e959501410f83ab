"""What runs many cases: the command that runs a sweep, and `hkt run` of several cases."""

import os
import sys
import time
from collections import Counter
from datetime import timedelta
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console
from rich.text import Text
from typer import Argument, Exit, Option, confirm, echo

from hkt_mdo.cli import parts
from hkt_mdo.errors import InputError

ASKED = 1000
"""Number of runs above which the user is asked."""
MOST_TOLD = 10
"""Failures that are listed; the table has all."""
_SECONDS_BETWEEN_LINES = 5.0

_SWEEP = "Sweep file in YAML: a case, and values of its keys (docs/sweeps.md)."
_SCHEDULER = (
    "Address of a Dask scheduler, tcp://HOST:PORT or tls://HOST:PORT, whose workers run the cases; "
    "by default workers are started here. With tcp, anybody who reaches it can run programs on it."
)
_YES = f"Run more than {ASKED:,} cases without being asked."


def sweep(
    sweep: Annotated[Path, Argument(metavar="SWEEP", help=_SWEEP, show_default=False)],
    out: parts.OutFolder = None,
    jobs: parts.Jobs = None,
    scheduler: Annotated[str | None, Option(metavar="ADDRESS", help=_SCHEDULER)] = None,
    yes: Annotated[bool, Option("--yes", help=_YES)] = False,
    quiet: Annotated[bool, Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Run a case with many values of its keys, and write a table.

    The folder, results/NAME unless --out is given, gets sweep.yaml, a result folder for each run in
    runs, and one row a run in table.csv (table.parquet and grid.nc too, where pandas and xarray are
    installed). A run that fails is a row with its message. The same command continues an
    interrupted sweep: runs that are finished are not repeated. hkt plot and hkt report take the
    folder, too.
    """
    from hkt_mdo.case.sweep import load_sweep

    asked = load_sweep(sweep, parts.EXTENSIONS.get())
    folder = out or Path("results") / sweep.stem
    how: dict[str, Any] = {"scheduler": scheduler, "extensions": parts.EXTENSIONS.get()}
    try:
        with Console(quiet=quiet).status(Text(f"{sweep.stem}: {asked.size:,} runs")) as status:
            from hkt_mdo.run.sweep import run_sweep

            if asked.size > ASKED and not yes:
                seconds = [
                    row.get("wall_seconds") for row in run_sweep(asked, folder, 1, most=2, **how)
                ]
                status.stop()
                _ask(asked.size, [x for x in seconds if x], jobs or os.cpu_count() or 1)
                status.start()
            told = _reporter(status, quiet)
            rows = run_sweep(asked, folder, jobs, told, **how)
    except KeyboardInterrupt:
        parts.complain("interrupted", f"finished runs are in {folder}; the same command continues")
        raise Exit(parts.INTERRUPTED) from None
    states = Counter(row["state"] for row in rows)
    if not quiet:
        _summarize(rows, states, folder)
    if not states["verified"]:
        parts.complain("error", f"no run is a success: see {folder / 'table.csv'}")
        raise Exit(parts.NO_SUCCESS)


def _ask(size: int, seconds: list[float], workers: int) -> None:
    """Ask whether so many runs are meant, each of which takes some seconds."""
    took = "an unknown time"
    if seconds:
        left = timedelta(seconds=round(size * seconds[-1] / workers))
        took = f"about {left} (one took {seconds[-1]:.2g} s) on {workers} workers"
    problem = f"asks for {size:,} runs, which take {took}"
    if sys.stdin.isatty() and confirm(f"This {problem}. Run them all?"):
        return
    remedy = "give fewer values, or samples: 1000 of ranges without a count; --yes runs them all"
    raise InputError(problem, remedy, key="over")


def _reporter(status: Any, quiet: bool) -> Any:
    """Return what tells how far a sweep is: a live line on a terminal, else one every seconds."""
    last = 0.0

    def told(now: Any) -> None:
        nonlocal last
        if quiet:
            return
        done = now.reused + now.computed
        line = f"{done:,} of {now.total:,} runs"
        line += f", {now.reused:,} from before" if now.reused else ""
        line += f", {now.failed:,} without success" if now.failed else ""
        if now.left is not None and done < now.total:
            line += f", about {timedelta(seconds=round(now.left))} left"
        if status.console.is_terminal:
            status.update(line)
        elif time.monotonic() - last >= _SECONDS_BETWEEN_LINES or done == now.total:
            last = time.monotonic()
            echo(line)

    return told


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


def run_several(
    files: list[Path],
    changes: list[str],
    out: Path | None,
    jobs: int | None,
    force: bool,
    quiet: bool,
    no_figures: bool,
    no_records: bool,
    pdf: bool,
) -> None:
    """Run several cases into folders of their names; tell each that ends."""
    out, figures = out or Path("results"), ("png", "pdf") if pdf else not no_figures
    from hkt_mdo.results.folder import check_folder
    from hkt_mdo.run.batch import begun, run_batch

    loaded = [parts.read_case(file, changes) for file in files]
    names = [each.name for each in loaded]
    if twice := [name for name in names if names.count(name) > 1]:
        given = {"key": "name", "value": twice[0]}
        raise InputError("is the name of two cases", "give each its own", **given)
    plan = {out / each.name: each for each in loaded}
    for folder, case in plan.items():
        if not begun(folder, case):
            check_folder(folder, force)
    done = 0

    def told(folder: Path, word: str) -> None:
        nonlocal done
        done += 1
        if not quiet:
            echo(f"{done} of {len(plan)}: {folder}: {word}")

    try:
        found = run_batch(plan, jobs, told, not no_records, figures=figures)
    except KeyboardInterrupt:
        parts.complain("interrupted", f"finished results are in {out}; the same command continues")
        raise Exit(parts.INTERRUPTED) from None
    failed = [path for path, each in found.items() if each is None or not each.success]
    if failed:
        parts.complain("error", f"no success: {', '.join(map(str, failed))}")
        raise Exit(parts.NO_SUCCESS)
