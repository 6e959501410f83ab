"""Many cases in parallel processes; finished results are reused, interrupted ones run again."""

import os
import signal
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
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.digest import digest
from hkt_mdo.run.run import run_case


def run_batch(
    cases: Mapping[Path, Case],
    jobs: int | None = None,
    done: Callable[[Path, str], None] = lambda folder, word: None,
    records: bool = True,
) -> dict[Path, Solution | None]:
    """Run every case into its folder and return the solutions, None where a case could not be run.

    A folder that holds the finished result of an equal case, of the same files and source code, is
    reused; any other result is replaced. `jobs` is the number of processes, None: one per core;
    done(folder, word) is called whenever a case ends, with "reused", "ok", "failed" or the error;
    `records` tells whether to keep each run's databases and N2 diagram, some megabytes a run.
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
    return found


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


def finished_result(folder: Path, case: Case) -> Solution | None:
    """Return what a folder holds if it is the finished result of an equal case.

    The files that the case names and the source code must have the content that the run met.
    """
    try:
        solution = Solution.load(folder, extensions=case.extensions)
        case = complete(case)  # as a run writes it
    except InputError:
        return None
    ended, same = solution.summary.checks is not None, solution.case == case
    return solution if ended and same and solution.summary.digest == digest(case) else None
