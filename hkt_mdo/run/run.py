"""Run a case: optimize, integrate independently, judge, record.

The optimizer is not the judge. A result is a success only if the optimizer converged and an
integration that shares neither torque curve nor collocation with it, the quasi-steady bound and
every limit of the problem agree (`hkt_mdo.run.judge`).

A run can be killed at any moment: files appear whole or not at all, `success` is false until all
else is written, and `resume_case` goes on from the last iterate in `iterate.json`.
"""

from __future__ import annotations

import signal
import sqlite3
import tempfile
import threading
import time
from collections.abc import Iterable
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import openmdao.api as om

from hkt_mdo.case import Case, load_case
from hkt_mdo.dynamics.limits import LEAST, SLOWED
from hkt_mdo.errors import InputError, interrupts_of_compiled_code
from hkt_mdo.problem.build import build_problem, make_driver
from hkt_mdo.problem.physics import Physics, physics
from hkt_mdo.problem.setup import bounding_optimum, find_start, other_branch, steady_optimum
from hkt_mdo.problem.start import StartingPoint
from hkt_mdo.results.folder import check_folder, claim, locked, make_folder, write_json, write_text
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.summary import VERSION, Summary
from hkt_mdo.run.digest import digest
from hkt_mdo.run.fallback import best_of, first_remedy, moving_reference
from hkt_mdo.run.groups import by_scenario
from hkt_mdo.run.judge import BELOW_START, explain_all, judge
from hkt_mdo.run.log import Log, Progress, read_iterate
from hkt_mdo.run.none_found import none_found, starts
from hkt_mdo.run.passes import optimize
from hkt_mdo.run.summary import Finished, summarize, write_tables
from hkt_mdo.run.worth import worths
from hkt_mdo.solve.threads import one_thread

NOT_RUNNING = (
    "no blade and gain{within} were found on which the rotor runs unstalled throughout this flow, "
    "from {starts}: the problem may have no solution (try a larger control.torque_limit, another "
    "control.law, or wider design bounds)"
)
ROOM = "make room on the disk and give hkt run --resume"
UNFINISHED = "interrupted before the end; hkt run --resume goes on from the last iterate"


@interrupts_of_compiled_code()
def run_case(
    case: Case,
    out: str | Path,
    *,
    force: bool = False,
    progress: Progress | None = None,
    figures: bool | Iterable[str] = True,
    records: bool = True,
) -> Solution:
    """Optimize a case, judge the result and leave it in a folder.

    `out` must not exist unless `force` is given, which replaces an earlier result there, file by
    file: a folder that no run has marked is refused, and what else is in it stays. `progress` is
    called as progress(count, objective in J, infeasibility) while the optimizer works. `figures`
    says whether figures are drawn, as PNG, or in which formats, such as ("png", "pdf"); `records`
    whether OpenMDAO's databases and the N2 diagram are written. The solution is loaded from the
    folder; its `success` tells what the judges found.

    Raises InputError if a file of the case is broken or the folder cannot be used, when nothing has
    been written; and KeyboardInterrupt, after Ctrl-C or SIGTERM, when what there was is saved, with
    success false.
    """
    out = Path(out)
    world = physics(case)
    make_driver(world)  # a missing package is told before anything is written
    check_folder(out, force)
    out = out.absolute()  # the current folder is the process's, and another thread may change it
    with locked(out):
        names = tuple(by_scenario(world.scenarios))
        claim(out, names if len(names) > 1 else ())
        write_text(out / "case.yaml", world.case.to_yaml())
        return _run(world, out, progress, figures, records)


@interrupts_of_compiled_code()
def resume_case(
    out: str | Path,
    *,
    progress: Progress | None = None,
    figures: bool | Iterable[str] = True,
    records: bool = True,
    extensions: Iterable = (),
) -> Solution:
    """Go on with an interrupted or failed run from its last recorded iterate.

    Parameters and errors are those of `run_case` and `load_case`. A success is returned as it is;
    where nothing was recorded yet, the run begins anew.
    """
    out = Path(out).absolute()
    world = physics(load_case(out / "case.yaml", extensions=extensions))
    make_driver(world)
    with locked(out):
        if (out / "summary.json").exists():
            solution = Solution.load(out, extensions=extensions)
            if solution.success:
                return solution
        world, *before = read_iterate(out, world)
        return _run(world, out, progress, figures, records, *before)


def _run(
    world: Physics, out, progress, figures, records, start=None, reference=0.0, history=()
) -> Solution:
    """Run a case in its locked folder from a start, None: the case's own."""
    began, made_of = time.perf_counter(), digest(world.case)
    name = world.case.name
    summary = Summary(version=VERSION, case=name, success=False, message=UNFINISHED)
    write_json(out / "summary.json", dict(summary))
    with tempfile.TemporaryDirectory(prefix="hkt_mdo_") as scratch, one_thread():
        log = Log(out, scratch, progress, records)
        log.history, log.reference = list(history), reference
        try:
            with _termination_interrupts(log):
                finished = _optimize_and_judge(world, out, log, start, records)
            told = {"wall_seconds": time.perf_counter() - began, "digest": made_of}
            summary = finished.model_copy(update=told)
        except InputError as error:
            summary = summary.model_copy(update={"message": str(error)})
            raise
        except sqlite3.Error as error:
            reason = f"OpenMDAO's recorder: {error}"
            if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL:
                reason = "no space left on the device"
            raise InputError(f"cannot be written ({reason})", ROOM, file=out) from error
        finally:
            log.write_history()
            write_json(out / "summary.json", dict(summary))
    solution = Solution.load(out, extensions=world.case.extensions)
    if figures:
        from hkt_mdo.results.plots import save_figures

        make_folder(out / "figures")
        save_figures(solution, out / "figures", ("png",) if figures is True else tuple(figures))
    return solution


def _optimize_and_judge(
    world: Physics, out: Path, log: Log, start: StartingPoint | None, records: bool
) -> Summary:
    """Return the summary of a run; its tables are written."""
    optimum = steady_optimum(world, world.blade)
    if start is None:
        start = find_start(world, optimum)
        log.reference = _reference(world, start)
    first, second = world, None
    world, result, flights, bound, checks = _attempt(first, optimum, start, log)
    if any(not each.passed for each in checks):
        second = other_branch(first, optimum, start)
    if second is not None:
        reference, log.reference = log.reference, _reference(first, second)
        again = _attempt(first, optimum, second, log)
        if all(each.passed for each in again[-1]):
            start, (world, result, flights, bound, checks) = second, again
        else:
            log.reference = reference
    breaks = first.start_breaks(start)
    held, remedy = "", first_remedy(world, result)
    refused = explain_all(checks, remedy)
    if refused:
        others = (*log.best, "the best iterate"), (first, start, "the start")
        world, result, flights, held = best_of(world, bound, result, flights, others, log)
    if held:
        bound = bounding_optimum(world, optimum, result.point.blade)
        checks = judge(world, bound, log.reference, result, flights)
        log.save(result.point, world)
    gains = {}
    if result.outcome.success:
        gains = worths(world, result, [each.at_nodes for each in flights], log.scratch)
    parts = Finished(world, bound, start, breaks, result, flights, checks, remedy, gains)
    finished = summarize(parts)
    if held:
        message = f"{refused}; the folder holds {held}, which is better than the end"
        finished = finished.model_copy(update={"message": message})
    if not (finished.success or start.operation.running):
        bounds = world.case.design.gain_bounds
        within = f" within design.gain_bounds = [{bounds[0]:g}, {bounds[1]:g}]" if bounds else ""
        told = NOT_RUNNING.format(within=within, starts=starts(start))
    else:
        told = "" if finished.success else none_found(first, start, checks)
    if told:
        message = f"{told}; {finished.message}"
        finished = finished.model_copy(update={"message": message})
    write_tables(out, parts)
    if records:
        om.n2(result.problem, outfile=str(out / "n2.html"), show_browser=False)
    if result.outcome.success:
        log.save(result.point, world)
    return finished


def _attempt(world, optimum, start, log):
    """Optimize from a start; return physics, result, flights, steady optimum and checks."""
    first = world
    log.save(start, world)
    world, result, flights = optimize(world, start, log)
    if log.reference and result.setup.slowed > SLOWED:  # farther from stall than the start
        kept = find_start(first, optimum, slowed=result.setup.slowed)
        log.reference = min(log.reference, _reference(first, kept))
    if result.objective < (1.0 - BELOW_START) * log.reference:
        log.reference = min(log.reference, moving_reference(first, start, result, log))
    bound = bounding_optimum(world, optimum, result.point.blade)
    return world, result, flights, bound, judge(world, bound, log.reference, result, flights)


def _reference(world: Physics, start: StartingPoint) -> float:
    """Return the objective of a start, J; 0 where it is no measure of the optimum.

    A start that breaks a limit may well be better than the best design that keeps it.
    """
    state = start.operation
    kept = state.running and bool(np.all(state.margin >= LEAST)) and not world.start_breaks(start)
    return world.objective_at(start) if kept else 0.0


def write_n2(case: Case, path: Path) -> None:
    """Write the N2 diagram of a case's problem, without optimizing.

    Raises
    ------
    InputError
        If a file of the case is broken or the diagram cannot be written.
    """
    problem = build_problem(case, improve=False)
    problem.final_setup()
    try:
        om.n2(problem, outfile=str(path), show_browser=False)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written: {error.strerror}; choose another --out"
        ) from error


@contextmanager
def _termination_interrupts(log: Log):
    """Let SIGTERM end a run as Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the main thread's
        return

    def handler(signum, frame):
        log.terminated = True  # heeded at the next evaluation, should compiled code swallow this
        interrupt = signal.getsignal(signal.SIGINT)
        (interrupt if callable(interrupt) else signal.default_int_handler)(signum, frame)

    previous = signal.signal(signal.SIGTERM, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous or signal.SIG_DFL)
