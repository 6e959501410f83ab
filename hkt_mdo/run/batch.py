"""Many cases in parallel processes; finished results are reused, interrupted ones run again."""

import os
import shutil
import signal
import tempfile
import threading
import warnings
from collections.abc import Callable, Hashable, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from hkt_mdo.case import Case
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import complete
from hkt_mdo.results.nesting import beaten
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.digest import digest
from hkt_mdo.run.run import run_case


def run_batch(
    cases: Mapping[Path, Case],
    jobs: int | None = None,
    done: Callable[[Path, str], None] = lambda folder, word: None,
    records: bool = True,
    pass_on: bool = False,
) -> dict[Path, Solution | None]:
    """Run every case into its folder and return the solutions, None where a case could not be run.

    A folder that holds the finished result of an equal case, of the same files and source code, is
    reused; any other result is replaced. `jobs` is the number of processes, None: one per core;
    done(folder, word) is called whenever a case ends, with "reused", "ok", "failed" or the error;
    `records` tells whether to keep each run's databases and N2 diagram, some megabytes a run.
    With `pass_on`, a case that allows a better result of another one (`hkt_mdo.results.nesting`) is
    run again from that one's design, and the better of both results stays.
    """
    run = partial(run_case, force=True, figures=False, records=records)
    found, waiting = {}, {}
    for folder, case in cases.items():
        found[folder] = finished_result(folder, case)
        if found[folder]:
            done(folder, "reused")
        else:
            waiting[folder] = partial(run, case, folder)

    def ended(folder, future):
        try:
            found[folder] = future.result()
            done(folder, "ok" if found[folder].success else "failed")
        except InputError as error:
            done(folder, str(error))
        except Exception as error:  # one failing run must not end the others
            done(folder, f"{type(error).__name__}: {error}")

    in_processes(waiting, jobs, ended)
    if pass_on:
        _pass_on(found, cases, jobs, done, run)
    return found


def _pass_on(found, cases, jobs, done, run) -> None:
    """Run every case again that allows a better result of another one, from the best of those.

    What is better then may be better for others too; a case is run again from each at most once.
    """
    tried: set[tuple[Path, Path]] = set()
    folders = {found[folder].folder: folder for folder in cases if found[folder]}
    while True:
        known = beaten(filter(None, found.values()))
        pairs = {folders[each.result.folder]: each.by.folder for each in known}
        pairs = {key: value for key, value in pairs.items() if (key, value) not in tried}
        if not pairs:
            return
        tried |= {*pairs.items()}
        with tempfile.TemporaryDirectory(dir=next(iter(pairs)).parent) as scratch:
            again = {}
            for number, (folder, source) in enumerate(pairs.items()):
                start = cases[folder].start.model_copy(update={"from_": str(source)})
                case = cases[folder].model_copy(update={"start": start})
                again[folder] = partial(run, case, Path(scratch, str(number)))

            def ended(folder, future):
                try:
                    better = _take_if_better(found[folder], future.result())
                except Exception as error:  # the result that there was stays
                    done(folder, f"{type(error).__name__}: {error}")
                    return
                if better:
                    own = cases[folder].extensions
                    found[folder] = Solution.load(found[folder].folder, extensions=own)
                done(folder, "better from another's design" if better else "not better")

            in_processes(again, jobs, ended)


def in_processes(
    tasks: Mapping[Hashable, Callable], jobs: int | None, ended: Callable[[Hashable, Future], None]
) -> None:
    """Call tasks in `jobs` parallel processes, and ended(key, future) as each one ends.

    An interruption (Ctrl-C or SIGTERM) drops the tasks that have not begun.
    """
    main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGTERM, signal.default_int_handler) if main else None
    # spawn: a forked child would share OpenMDAO's and numba's state with its parent
    with ProcessPoolExecutor(
        jobs or os.cpu_count(), get_context("spawn"), warnings.filterwarnings, ("ignore",)
    ) as pool:
        try:
            futures = {pool.submit(task): key for key, task in tasks.items()}
            for future in as_completed(futures):
                ended(futures[future], future)
        except KeyboardInterrupt:  # also SIGTERM: without this the processes would wait for ever
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        finally:
            if main:
                signal.signal(signal.SIGTERM, before or signal.SIG_DFL)


def _take_if_better(before: Solution, after: Solution) -> bool:
    """Copy a case's new result over the one before if it is better, and tell whether it is."""
    objective = before.case.objective
    values = [each.summary.objective.simulated for each in (after, before)]
    better = after.success and (not before.success or objective.behind(*values) < 0.0)
    if better:
        shutil.copytree(after.folder, before.folder, dirs_exist_ok=True)
    return better


def finished_result(folder: Path, case: Case) -> Solution | None:
    """Return what a folder holds if it is the finished result of an equal case.

    The files that the case names and the source code must have the content that the run met. A
    result that was begun from another's design is one of the case as well.
    """
    try:
        solution = Solution.load(folder, extensions=case.extensions)
        case = complete(case)  # as a run writes it
    except InputError:
        return None
    start = solution.case.start.model_copy(update={"from_": case.start.from_})
    same = solution.case.model_copy(update={"start": start}) == case
    ended = solution.summary.checks is not None
    return solution if ended and same and solution.summary.digest == digest(case) else None
