"""Many cases in parallel processes; finished results are reused, interrupted ones run again."""

import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

from hkt_mdo.case import Case, load_case
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import complete
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.digest import digest
from hkt_mdo.run.engine import in_processes, outcome
from hkt_mdo.run.run import run_case


def run_batch(
    cases: Mapping[Path, Case],
    jobs: int | None = None,
    done: Callable[[Path, str], None] = lambda folder, word: None,
    records: bool = True,
    figures: bool | Iterable[str] = False,
) -> dict[Path, Solution | None]:
    """Run every case into its folder and return the solutions, None where a case could not be run.

    A script calls it below ``if __name__ == "__main__":``, since its processes import the script.

    A folder that holds the finished result of an equal case, of the same files and source code, is
    reused; any other result is replaced. `jobs` is the number of processes, None: one per core;
    done(folder, word) is called whenever a case ends, with "reused", "ok", "failed" or the error;
    `records` tells whether to keep each run's databases and N2 diagram, some megabytes a run, and
    `figures` which figures to draw, as `run_case` takes it.
    """
    run = partial(run_case, force=True, figures=figures, records=records)
    solutions, waiting = {}, {}
    for folder, case in cases.items():
        solutions[folder] = finished_result(folder, case)
        if solutions[folder]:
            done(folder, "reused")
        else:
            waiting[folder] = partial(run, case, folder)

    def ended(folder, future):
        solutions[folder], why = outcome(future)
        done(folder, why or ("ok" if solutions[folder].success else "failed"))

    in_processes(waiting.items(), jobs, ended)
    return solutions


def passed_on(case: Case, source: str) -> Case:
    """Return a case that begins at the design of another result.

    It is not searched for a start again: of several optima that search may choose another one.
    """
    start = case.start.model_copy(update={"from_": source, "method": "blade"})
    return case.model_copy(update={"start": start})


def improved(
    before: Solution, case: Case, source: Path, run: Callable[..., Solution], least: float = 0.0
) -> Solution | None:
    """Run a case again from the design of another result, and return the new one if it is better.

    It then takes the place of the one before. `least`: the share of the objective by which it has
    to be better. Stopped at any point, this leaves either result or an unfinished one, since the
    summary is the last file to come.
    """
    with tempfile.TemporaryDirectory(prefix="hkt_mdo_", dir=before.folder.parent) as scratch:
        after = run(passed_on(case, str(source)), Path(scratch, "run"))
        values = [solution.summary.objective.simulated for solution in (after, before)]
        if not after.success or (
            before.success and before.case.objective.behind(*values) >= -least
        ):
            return None
        Path(before.folder, "summary.json").unlink()
        rest = shutil.ignore_patterns("summary.json")
        shutil.copytree(after.folder, before.folder, dirs_exist_ok=True, ignore=rest)
        shutil.copy(after.folder / "summary.json", before.folder)
    return Solution.load(before.folder, extensions=case.extensions)


def begun(folder: Path, case: Case) -> bool:
    """Tell whether a folder has a result of an equal case, finished or not."""
    try:
        return _is(case, load_case(folder / "case.yaml", extensions=case.extensions))
    except InputError:
        return False


def _is(case: Case, written: Case) -> bool:
    """Tell whether a case is one that a run has written, with what that took from its files.

    A result that was begun from another's design is one of the case as well.
    """
    case, source = complete(case), written.start.from_
    if case.design.chord_bounds is None:
        design = case.design.model_copy(update={"chord_bounds": written.design.chord_bounds})
        case = case.model_copy(update={"design": design})
    return written in (case, passed_on(case, source or ""))


def finished_result(folder: Path, case: Case) -> Solution | None:
    """Return what a folder holds if it is the finished result of an equal case.

    The files that the case names and the source code must have the content that the run met.
    """
    solution = ended_result(folder, case)
    return solution if solution and solution.summary.digest == digest(complete(case)) else None


def ended_result(folder: Path, case: Case) -> Solution | None:
    """Return what a folder holds if it is a finished result of an equal case, of any version.

    The files that the case names may have changed, too.
    """
    try:
        solution = Solution.load(folder, extensions=case.extensions)
        return solution if _is(case, solution.case) and solution.finished else None
    except InputError:
        return None
