"""Running a sweep: every point once, those that are finished not again."""

import hashlib
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.case.kinds import Extension
from hkt_mdo.case.sweep import SWEEP, Sweep, load_sweep
from hkt_mdo.errors import InputError
from hkt_mdo.files.table import write_files
from hkt_mdo.results.folder import InUseError, locked
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.sweep import ERROR, VERIFIED, Row, row_of, write_table
from hkt_mdo.run.batch import ended_result, finished_result, improved
from hkt_mdo.run.engine import in_processes, outcome
from hkt_mdo.run.run import run_case

BETTER = 1e-6
"""Share of the objective by which the result from a neighbour's design must be better to count."""
SECONDS_BETWEEN_TABLES = 30.0
RUNS = "runs"


def run_sweep(
    sweep: Sweep | str | Path,
    out: str | Path,
    jobs: int | None = None,
    report: Callable[["Plan"], None] = lambda plan: None,
    *,
    scheduler: str | None = None,
    extensions: Iterable[Extension] = (),
    most: int | None = None,
    run: Callable[..., Solution] = run_case,
) -> list[Row]:
    """Run the points of a sweep, or of its file, that have no result in a folder; return its table.

    The folder gets `sweep.yaml`, the tables (`hkt_mdo.results.sweep`) and the runs in `runs`, each
    in a folder named after the content of its case. A result of an equal case, with the files and
    the source code that are there now, is used again, so that a sweep goes on after any kill.

    `jobs` and `scheduler` are those of `in_processes`; report(plan) is called when a run ends;
    `extensions`: of the cases of a file; `most`: run no more points than these; `run`: what runs a
    case, called as `run_case`.
    """
    sweep = sweep if isinstance(sweep, Sweep) else load_sweep(sweep, extensions)
    out = Path(out).absolute()
    inside = {path.name for path in out.iterdir()} if out.is_dir() else set()
    if inside and not inside & {SWEEP, "lock"}:
        remedy = "choose another folder, or that of an earlier sweep, which is then continued"
        raise InputError("holds files that are not of a sweep", remedy, file=out)
    with locked(out):
        (out / RUNS).mkdir(exist_ok=True)
        write_files({out / SWEEP: sweep.to_yaml()})
        plan = Plan(sweep, out, run, report, sweep.size if most is None else most)
        try:
            in_processes(plan.tasks(), jobs, plan.ended, scheduler, out)
        finally:
            plan.write()
        return plan.table()


class Plan:
    """The points of a sweep, what of them is done, and what is to be run next.

    Numbers of runs are the `total`, those `reused`, `computed` and `failed`, and `older`, finished
    results that are replaced, since the version or a file is another one now.
    """

    def __init__(self, sweep, out, run, report, total) -> None:
        self.sweep, self.out = sweep, out
        self.run, self.report, self.total = run, report, total
        self.points: list[tuple[Row, str]] = []  # values of the keys, and the run's name
        self.rows: dict[str, Row] = {}  # by the run's name
        self.places: dict[str, np.ndarray] = {}  # on the axes, each from 0 to 1, by the run's name
        self.began = self.written = time.monotonic()
        self.reused = self.computed = self.failed = self.older = 0

    def tasks(self) -> Iterator[tuple[str, Callable[[], Row]]]:
        """Yield the runs that have no result, in the order of the points."""
        for position in islice(self.sweep.places(), self.total):
            point = self.sweep.point_at(position)
            try:
                case = self.sweep.case_at(point)
            except InputError as error:
                name = f"none-{len(self.points)}"
                self.points.append((self.sweep.row_at(point), name))
                self.rows[name] = {"run": ""}
                self.computed += 1
                self.done(name, {"state": ERROR, "message": str(error)})
                continue
            name = hashlib.sha256(case.model_dump_json(exclude={"name"}).encode()).hexdigest()[:16]
            case = case.model_copy(update={"name": f"{case.name[:80]}-{name[:8]}"})
            self.points.append((self.sweep.row_at(point), name))
            if name in self.rows:  # the same case at another point
                self.total -= 1
                continue
            self.rows[name] = {"run": f"{RUNS}/{name}", "state": "", "message": "has not ended"}
            self.places[name] = np.array([*position.values()])
            folder = self.out / RUNS / name
            if solution := finished_result(folder, case):
                self.reused += 1
                self.done(name, _row(solution, case))
                continue
            if ended_result(folder, case):
                self.older += 1
                self.report(self)
            yield name, partial(run_one, case, folder, self.nearest(name), self.run)

    def ended(self, name: str, future: Any) -> None:
        """Take a run's row."""
        self.computed += 1
        row, why = outcome(future)
        self.done(name, row or {"state": ERROR, "message": why})
        if time.monotonic() - self.written > SECONDS_BETWEEN_TABLES:
            self.write()

    def nearest(self, name: str) -> Path | None:
        """Return the folder of the verified run nearest to one, if it is asked for and there is."""
        verified = [other for other, row in self.rows.items() if row["state"] == VERIFIED]
        if not (self.sweep.neighbours and verified):
            return None
        far = {other: np.sum((self.places[other] - self.places[name]) ** 2) for other in verified}
        return self.out / RUNS / min(verified, key=far.__getitem__)

    def done(self, name: str, row: Row) -> None:
        """Keep a row, and tell of it."""
        self.rows[name] |= row
        self.failed += row["state"] != VERIFIED
        self.report(self)

    @property
    def left(self) -> float | None:
        """Estimate of the time that is left, s; None before a run has been computed."""
        if not self.computed:
            return None
        seconds = (time.monotonic() - self.began) / self.computed
        return seconds * max(0, self.total - self.reused - self.computed)

    def table(self) -> list[Row]:
        """Return the rows of the points so far; a run that has not ended has no state."""
        return [values | self.rows[name] for values, name in self.points]

    def write(self) -> None:
        """Write the table."""
        if self.points:
            write_table(self.out, self.sweep, self.table())
        self.written = time.monotonic()


def run_one(case: Case, folder: Path, neighbour: Path | None, run: Callable[..., Solution]) -> Row:
    """Run a case in its folder, unless a worker that died has finished it, and return its row.

    With the folder of a `neighbour`, it is run from that one's design as well.
    """
    run = partial(run, figures=False, records=False)
    while True:
        if solution := finished_result(folder, case):
            return _row(solution, case)
        try:
            solution = run(case, folder, force=True)
            break
        except InUseError:  # a client that was killed left it to a worker
            time.sleep(1.0)
    if neighbour is not None:
        with suppress(InputError):  # such as of a design that this case cannot begin with
            solution = improved(solution, case, neighbour, run, BETTER) or solution
    return _row(solution, case)


def _row(solution: Solution, case: Case) -> Row:
    """Return the row of a result, with the start that it comes from."""
    own_start = solution.case.start.from_ == case.start.from_
    return {"start": "own" if own_start else "neighbour"} | row_of(solution)
