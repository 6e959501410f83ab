"""Many cases in parallel processes; finished results are reused, interrupted ones run again."""

import json
import os
import signal
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

from hkt_mdo.case import Case, read_case
from hkt_mdo.errors import InputError
from hkt_mdo.results.solution import Solution


def run_batch(
    cases: Mapping[Path, Case],
    jobs: int | None = None,
    done: Callable[[Path, str], None] | None = None,
    figures: bool = False,
    records: bool = True,
) -> dict[Path, Solution | None]:
    """Run every case into its folder and return the solutions.

    Parameters
    ----------
    cases : mapping of Path to Case
        The result folder of each case. A folder that holds the finished result of an equal case is
        reused; anything else that is a result is replaced.
    jobs : int or None
        Number of processes; None: one a core.
    done : callable or None
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

    def report(folder, word):
        if done is not None:
            done(folder, word)

    waiting = {}
    for folder, case in cases.items():
        if is_finished(folder, case):
            found[folder] = Solution.load(folder)
            report(folder, "reused")
        else:
            waiting[folder] = case
    main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGTERM, signal.default_int_handler) if main else None
    # spawn: a forked child would share OpenMDAO's and numba's state with its parent
    with ProcessPoolExecutor(jobs or os.cpu_count(), mp_context=get_context("spawn")) as pool:
        futures = {
            pool.submit(_run_one, case.to_yaml(), str(folder), figures, records): folder
            for folder, case in waiting.items()
        }
        try:
            for future in as_completed(futures):
                folder = futures[future]
                try:
                    future.result()
                except InputError as error:
                    report(folder, str(error))
                    continue
                except Exception as error:  # one broken run must not end the others
                    report(folder, f"{type(error).__name__}: {error}")
                    continue
                found[folder] = Solution.load(folder)
                report(folder, "ok" if found[folder].success else "failed")
        except KeyboardInterrupt:  # or SIGTERM: processes without a parent would wait for ever
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        finally:
            if main:
                signal.signal(signal.SIGTERM, before or signal.SIG_DFL)
    return found


def is_finished(folder: Path, case: Case) -> bool:
    """Return whether a folder holds this version's finished result of an equal case."""
    from hkt_mdo.problem.build import complete

    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        stored = read_case((folder / "case.yaml").read_text(encoding="utf-8"))
        case = complete(case)  # as a run writes it
    except (OSError, ValueError, InputError):
        return False
    if not isinstance(summary, dict) or "checks" not in summary:
        return False
    return stored == case and summary.get("versions", {}).get("hkt_mdo") == version("hkt_mdo")


def _run_one(text: str, folder: str, figures: bool, records: bool) -> None:
    """Run a case in a process of its own."""
    # the cores are shared out by processes already
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    import warnings

    warnings.filterwarnings("ignore")
    from hkt_mdo.run.run import run_case

    run_case(read_case(text), Path(folder), force=True, figures=figures, records=records)
