"""Run a case: optimize, integrate independently, check, record.

A result is a success only if the optimizer converged and an integration that shares neither torque
curve nor collocation with it, the quasi-steady bound and every limit of the problem agree
(`hkt_mdo.run.checks`).

A run can be killed at any moment: files appear whole or not at all, `success` is false until all
else is written, and `resume_case` continues from the last iterate in `iterate.json`.
"""

import signal
import sqlite3
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import openmdao.api as om

from hkt_mdo.case import Case, load_case
from hkt_mdo.errors import InputError, handling, interrupts_of_compiled_code
from hkt_mdo.files.table import write_files
from hkt_mdo.problem.build import make_driver
from hkt_mdo.problem.evaluation import broken_limits
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.physics import physics as make_physics
from hkt_mdo.problem.point import StartingPoint, StartRecord
from hkt_mdo.results.folder import check_folder, claim, locked, usable
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.summary import PassEntry, Summary
from hkt_mdo.run.checks import explain_all
from hkt_mdo.run.digest import digest
from hkt_mdo.run.memory import with_memory
from hkt_mdo.run.passes import best_of, measured, none_found, optimize
from hkt_mdo.run.state import RunState, read_iterate
from hkt_mdo.run.summary import summarize, write_tables
from hkt_mdo.solve.driver_base import Progress
from hkt_mdo.solve.threads import one_thread
from hkt_mdo.start.build import build_problem
from hkt_mdo.start.find import find_start

ROOM = "make room on the disk and give hkt run --resume"


@interrupts_of_compiled_code()
def run_case(
    case: Case,
    out: str | Path,
    *,
    force: bool = False,
    progress: Progress | None = None,
    on_pass: Callable[[PassEntry], None] | None = None,
    on_start: Callable[[StartRecord], None] | None = None,
    figures: bool | Iterable[str] = True,
    records: bool = True,
) -> Solution:
    """Optimize a case, check the result and write it into a folder.

    Parameters
    ----------
    case
        The case.
    out
        The result folder. It must not exist unless `force` is given.
    force
        Replace an earlier result there, file by file. A folder that no run has marked is refused,
        and other files in it are kept.
    progress
        Called as progress(count, objective in J, infeasibility) while the optimizer works.
    on_pass
        Called after every optimization, with its entry in the summary.
    on_start
        Called after every optimization without time, from which the start is chosen.
    figures
        Whether figures are drawn, as PNG, or in which formats, such as ("png", "pdf").
    records
        Whether OpenMDAO's databases and the N2 diagram are written.

    Returns
    -------
    Solution
        Loaded from the folder; its `success` says whether all checks agreed.

    Raises
    ------
    InputError
        If a file of the case is broken or the folder cannot be used; nothing has been written.
    KeyboardInterrupt
        After Ctrl-C or SIGTERM; the state so far is saved, with success false.
    """
    check_folder(Path(out), force)
    out = Path(out).absolute()  # another thread may change the current folder of the process
    with locked(out):
        physics = _prepared(case)
        names = tuple(physics.groups)
        claim(out, names if len(names) > 1 else ())
        write_files({out / "case.yaml": physics.case.to_yaml()})
        return _run(RunState(physics, out, records, [], progress, on_pass, on_start), figures)


@interrupts_of_compiled_code()
def resume_case(
    out: str | Path,
    *,
    progress: Progress | None = None,
    on_pass: Callable[[PassEntry], None] | None = None,
    on_start: Callable[[StartRecord], None] | None = None,
    figures: bool | Iterable[str] = True,
    records: bool = True,
    extensions: Iterable = (),
) -> Solution:
    """Continue an interrupted or failed run from its last recorded iterate.

    A success is returned as it is; where nothing was recorded yet, the run begins anew.

    Parameters
    ----------
    out
        The result folder.
    progress, on_pass, on_start, figures, records
        As `run_case` takes them.
    extensions
        As `load_case` takes them.

    Returns
    -------
    Solution
        Loaded from the folder.

    Raises
    ------
    InputError
        If the folder's case or iterate is broken, or another run is using it.
    KeyboardInterrupt
        After Ctrl-C or SIGTERM; the state so far is saved, with success false.
    """
    out = Path(out).absolute()
    with locked(out):
        physics = _prepared(load_case(out / "case.yaml", extensions=extensions))
        evaluations: list = []
        if (out / "summary.json").exists():
            solution = Solution.load(out, extensions=extensions)
            if solution.success:
                return solution
            evaluations = [*zip(*solution.convergence.values(), strict=True)]
        physics, start = read_iterate(out, physics)
        history, callbacks = evaluations if start else [], (progress, on_pass, on_start)
        return _run(RunState(physics, out, records, history, *callbacks), figures, start)


def _prepared(case: Case) -> Physics:
    """Return the physics of a case; what cannot be run is refused before anything is written."""
    physics = make_physics(case)
    make_driver(physics)
    return physics


_SILENT = {"show_browser": False, "display_in_notebook": False}


def _run(state: RunState, figures, start: StartingPoint | None = None) -> Solution:
    """Run a case in its locked folder, from the last iterate of an earlier run if there is one."""
    case, out = state.first.case, state.out
    began, made_of = time.perf_counter(), digest(case)
    with one_thread():
        try:
            with handling(signal.SIGTERM, state.terminate):
                finished = _optimize_and_verify(state, start)
            update = {"wall_seconds": time.perf_counter() - began, "digest": made_of}
            state.summary = finished.model_copy(update=update)
        except InputError as error:
            state.summary = state.summary.model_copy(update={"message": str(error)})
            raise
        except sqlite3.Error as error:
            reason = f"OpenMDAO's recorder: {error}"
            if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL:
                reason = "no space left on the device"
            raise InputError(f"cannot be written ({reason})", ROOM, file=out) from error
        finally:
            state.write_history()
            state.write_summary()
    solution = Solution.load(out, extensions=case.extensions)
    if figures:
        from hkt_mdo.results import charts, style

        formats = ("png",) if figures is True else tuple(figures)
        contents = style.pictures(charts.figures(solution), out / "figures", formats)
        with usable(out):  # not made anew where it has been taken away while they were drawn
            (out / "figures").mkdir(exist_ok=True)
        write_files(contents)
    return solution


def _optimize_and_verify(state: RunState, start) -> Summary:
    """Return the summary of a run; its tables are written."""
    if start is None:
        start = find_start(state.first, on_start=state.on_start)
        start = with_memory(state.first, measured(state.first, start))
    end = best = optimize(state, start)
    message, held = explain_all(end.checks, end.physics), ""
    if message:
        best, held = best_of(state, end)
        if held:
            message += f"; the folder and its checks hold {held}, better than this last point"
        why = none_found(state.first, best.start, best.checks)
        message = f"{why}; {message}" if why else message
    result = best.result
    summary = summarize(best, message, broken_limits(state.first, best.start))
    write_tables(state.out, best)
    if state.records:
        om.n2(result.problem, outfile=str(state.out / "n2.html"), **_SILENT)
    if held or result.outcome.success:
        state.go_on_from(best.physics, result.point, best.start)
    return summary


def write_n2(case: Case, path: Path) -> None:
    """Write the N2 diagram of a case's problem, without optimizing.

    Raises
    ------
    InputError
        If a file of the case is broken.
    OSError
        If the diagram cannot be written.
    """
    problem = build_problem(case, improve=False)
    problem.final_setup()
    om.n2(problem, outfile=str(path), **_SILENT)
