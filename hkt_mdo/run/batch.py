"""Many cases in parallel processes; finished results are reused, interrupted ones run again."""

import json
import os
import signal
import threading
import warnings
from collections.abc import Callable, Hashable, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

from hkt_mdo.case import Case, load_case
from hkt_mdo.errors import InputError
from hkt_mdo.results.solution import Solution


def run_batch(
    cases: Mapping[Path, Case],
    jobs: int | None = None,
    done: Callable[[Path, str], None] = lambda folder, word: None,
    figures: bool = False,
    records: bool = True,
) -> dict[Path, Solution | None]:
    """Run every case into its folder and return the solutions.

    Parameters
    ----------
    cases : mapping of Path to Case
        The result folder of each case. A folder that holds the finished result of an equal case is
        reused; any other result is replaced.
    jobs : int or None
        Number of processes; None: one per core.
    done : callable
        Called as done(folder, word) whenever a case ends; word is "reused", "ok", "failed" or the
        error.
    figures : bool
        Whether to draw each result's figures.
    records : bool
        Whether to keep each run's databases and N2 diagram, some megabytes a run.

    Returns
    -------
    dict of Path to Solution or None
        In the order of `cases`; None where a case could not be run at all.
    """
    found: dict[Path, Solution | None] = dict.fromkeys(cases)
    waiting = {}
    for folder, case in cases.items():
        if is_finished(folder, case):
            found[folder] = Solution.load(folder, extensions=case.extensions)
            done(folder, "reused")
        else:
            waiting[folder] = (case, folder, figures, records)

    def ended(folder, future):
        try:
            future.result()
        except InputError as error:
            done(folder, str(error))
        except Exception as error:  # one failing run must not end the others
            done(folder, f"{type(error).__name__}: {error}")
        else:
            found[folder] = Solution.load(folder, extensions=cases[folder].extensions)
            done(folder, "ok" if found[folder].success else "failed")

    in_processes(_run_one, waiting, jobs, ended)
    return found


def in_processes(
    function: Callable,
    tasks: Mapping[Hashable, tuple],
    jobs: int | None,
    ended: Callable[[Hashable, Future], None],
) -> None:
    """Call function(*tasks[key]) in parallel processes, and ended(key, future) as each one ends.

    An interruption (Ctrl-C or SIGTERM) drops the tasks that have not begun. `jobs` is the number of
    processes; None: one per core.
    """
    main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGTERM, signal.default_int_handler) if main else None
    # spawn: a forked child would share OpenMDAO's and numba's state with its parent
    with ProcessPoolExecutor(jobs or os.cpu_count(), mp_context=get_context("spawn")) as pool:
        try:
            futures = {pool.submit(_quietly, function, *tasks[key]): key for key in tasks}
            for future in as_completed(futures):
                ended(futures[future], future)
        except KeyboardInterrupt:  # also SIGTERM: without this the processes would wait for ever
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        finally:
            if main:
                signal.signal(signal.SIGTERM, before or signal.SIG_DFL)


def is_finished(folder: Path, case: Case) -> bool:
    """Return whether a folder holds this version's finished result of an equal case."""
    from hkt_mdo.problem.physics import complete

    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        stored = load_case(folder / "case.yaml", check_files=False, extensions=case.extensions)
        case = complete(case)  # as a run writes it
    except (OSError, ValueError, InputError):
        return False
    if not isinstance(summary, dict) or "checks" not in summary:
        return False
    return stored == case and summary.get("versions", {}).get("hkt_mdo") == version("hkt_mdo")


def _quietly(function, *arguments):
    """Call a function without warnings on the screen."""
    warnings.filterwarnings("ignore")
    return function(*arguments)


def _run_one(case, folder, figures, records):
    """Run a case; the solution stays in its folder."""
    from hkt_mdo.run.run import run_case

    run_case(case, folder, force=True, figures=figures, records=records)
