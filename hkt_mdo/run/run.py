"""Run a case: optimize, integrate independently, judge, record.

The optimizer is not the judge. A result is a success only if the optimizer converged and an
integration that shares neither torque curve nor collocation with it, the quasi-steady bound and
every bound of the problem agree (`hkt_mdo.run.judge`).

A run can be killed at any moment: files appear whole or not at all, `success` is false until all
else is written, and `resume_case` goes on from the last iterate in `iterate.json`.
"""

import json
import os
import platform
import signal
import sqlite3
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib import metadata
from pathlib import Path

import numpy as np
import openmdao.api as om
from scipy.interpolate import CubicSpline

from hkt_mdo.case import Case, load_case
from hkt_mdo.dynamics.quasi_steady import SLOWED, Operation
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO, Simulation
from hkt_mdo.errors import InputError
from hkt_mdo.files.blade import BladeTable, write_blade_csv
from hkt_mdo.files.shipped import read_bytes
from hkt_mdo.problem.build import (
    MoveLimits,
    Physics,
    build_problem,
    complete,
    find_start,
    has_curve,
    make_driver,
    physics,
    quadrature,
)
from hkt_mdo.problem.start import StartingPoint
from hkt_mdo.results.folder import check_folder, clear, locked, write_csv, write_json, write_text
from hkt_mdo.results.solution import Solution
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.steady_optimum import (
    SteadyOptimum,
    best_operation,
    best_rotor,
    best_set_angle,
)
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.run.judge import (
    BETWEEN_VIOLATION,
    Optimized,
    between_nodes,
    curve_errors,
    energy_bound,
    explain,
    fly,
    is_false,
    judge,
    recovers,
)
from hkt_mdo.solve.drivers import outcome

MAX_PASSES = 8  # of refining the torque curve or re-centring the move limits
# recovery of the start, over a typical torque, below which it is a constraint from the beginning
NEAR_STALL = 0.022
WORTHWHILE = 1e-6  # relative gain in energy for which a move limit is re-centred again
FIRST_ITERATIONS = 300  # after as many, an optimization has lost its way
NARROW = MoveLimits(slower=0.8, faster=1.25, chord=1.3, twist=np.deg2rad(3.0), gain=1.3)
COLUMNS = {
    "time_s": "time",
    "inflow_speed_m_s": "inflow_speed",
    "rotor_speed_rad_s": "rotor_speed",
    "tip_speed_ratio": "tip_speed_ratio",
    "hydrodynamic_torque_Nm": "hydrodynamic_torque",
    "control_torque_Nm": "control_torque",
    "hydrodynamic_power_W": "hydrodynamic_power",
    "generator_power_W": "generator_power",
}

RESUMABLE = 1e-2  # largest scaled violation of an iterate worth going on from
SECONDS_BETWEEN_SAVES = 0.2
EVALUATIONS_BETWEEN_POINTS = 5
MAX_ITERATE_BYTES = 64 * 1024**2
NOT_RUNNING = (
    "no blade and gain were found on which the rotor runs unstalled throughout this flow: the "
    "problem may have no solution (try a larger control.torque_limit, another control.law, or "
    "wider design bounds)"
)
UNFINISHED = "interrupted before the end; hkt run --resume goes on from the last iterate"


Progress = Callable[[int, float, float], None]


def run_case(
    case: Case,
    out: Path,
    *,
    force: bool = False,
    progress: Progress | None = None,
    figures: bool = True,
    records: bool = True,
) -> Solution:
    """Optimize a case, judge the result and leave it in a folder.

    Parameters
    ----------
    case : Case
    out : Path
        Result folder; must not exist unless force is given.
    force : bool
        Replace an earlier result in `out`.
    progress : callable or None
        Called as progress(count, energy in J, infeasibility) while the optimizer works.
    figures : bool
        Whether to draw the figures.
    records : bool
        Whether to write OpenMDAO's databases and the N2 diagram.

    Returns
    -------
    Solution
        Loaded from the folder; `success` tells what the judges found.

    Raises
    ------
    InputError
        If a file of the case is broken or the folder cannot be used; nothing has been written then.
    KeyboardInterrupt
        After what exists was saved, with success false; SIGTERM does the same as Ctrl-C.
    """
    out = Path(out)
    case = complete(case)
    world = physics(case)
    make_driver(case)  # a missing package is told before anything is written
    check_folder(out, force)
    with locked(out):
        clear(out)
        write_text(out / "case.yaml", case.to_yaml())
        return _run(case, world, out, None, _Log(out, [], progress), figures, records)


def resume_case(
    out: Path, *, progress: Progress | None = None, figures: bool = True, records: bool = True
) -> Solution:
    """Go on with an interrupted or failed run from its last recorded iterate.

    Parameters and errors are those of `run_case`. A success is returned as it is; where nothing was
    recorded yet, the run begins anew.
    """
    out = Path(out)
    case = complete(load_case(out / "case.yaml"))
    world = physics(case)
    make_driver(case)
    with locked(out):
        if (out / "summary.json").exists() and (solution := Solution.load(out)).success:
            return solution
        start, reference, history = _read_iterate(out, case, world)
        log = _Log(out, history, progress)
        log.reference = reference
        return _run(case, world, out, start, log, figures, records)


def _run(case, world, out, start, log, figures, records) -> Solution:
    """Run a case in its locked folder from a start, None: the case's own."""
    began = time.perf_counter()
    summary: dict = {"case": case.name, "success": False, "message": UNFINISHED}
    write_json(out / "summary.json", summary)
    try:
        with _scratch_directory(), _termination_interrupts(log):
            optimum = _steady_optimum(world, world.blade)
            if start is None:
                start = find_start(case, world, optimum)
                log.reference = start.operation.energy if start.operation.running else 0.0
            log.save(start)
            result, flown = _optimize(case, world, start, out, log, records)
            optimum = _bounding_optimum(world, optimum, result.point.blade, flown.inflow_speed)
            checks = judge(case, world, optimum, log.reference, result, flown)
            finished = _summarize(case, world, optimum, start, result, flown, checks)
            if not (finished["success"] or start.operation.running):
                finished["message"] = f"{NOT_RUNNING}; {finished['message']}"
            _write_tables(out, case, world, result, flown)
            if records:
                om.n2(result.problem, outfile=str(out / "n2.html"), show_browser=False)
            if result.outcome.success:
                log.save(result.point)
            summary |= finished | {"wall_seconds": time.perf_counter() - began}
    except sqlite3.Error as error:
        raise InputError(
            f"{out}: OpenMDAO's recorder cannot write there ({error}); make room on the disk and "
            "give hkt run --resume"
        ) from error
    finally:
        log.write_history()
        write_json(out / "summary.json", summary)
    solution = Solution.load(out)
    if figures:
        from hkt_mdo.results.plots import save_figures

        save_figures(solution, out / "figures")
    return solution


class _Log:
    """What a run writes as it goes: the energy of every evaluation and a point to resume from.

    The optimizer's `progress`; `point` reads the problem that is being optimized.
    """

    def __init__(self, out: Path, history: list, progress: Progress | None):
        self._out, self._history, self._progress = out, history, progress
        self.reference = 0.0  # J: the energy of the case's own start, if the rotor runs on it
        self._saved = 0.0
        self.point: Callable[[], StartingPoint] | None = None
        self.last: StartingPoint | None = None
        self.terminated = False

    def __call__(self, count: int, energy: float, infeasibility: float) -> None:
        """Note an evaluation, and save the iterate if it is worth going on from."""
        if self.terminated:
            raise KeyboardInterrupt
        self._history.append((len(self._history), energy, infeasibility))
        if infeasibility <= RESUMABLE and self.point is not None:
            # by count, not by time: what an optimization goes on from must not depend on the clock
            if len(self._history) % EVALUATIONS_BETWEEN_POINTS == 0:
                self.last = self.point()
            if time.monotonic() - self._saved >= SECONDS_BETWEEN_SAVES:
                self._write(self.point())
                self.write_history()
        if self._progress is not None:
            self._progress(len(self._history), energy, infeasibility)

    def save(self, point: StartingPoint) -> None:
        """Keep the point that `resume_case` goes on from, and write it."""
        self.last = point
        self._write(point)

    def _write(self, point: StartingPoint) -> None:
        write_json(
            self._out / "iterate.json",
            {
                "chord_m": point.blade.chord,
                "twist_rad": point.blade.twist,
                "rotor_radius_m": point.blade.rotor_radius,
                "gains": point.gains,
                "energy_J": point.operation.energy,
                "reference_energy_J": self.reference,
                "rotor_speed_rad_s": point.operation.rotor_speed,
                "hydrodynamic_torque_Nm": point.operation.hydrodynamic_torque,
            },
        )
        self._saved = time.monotonic()

    def write_history(self) -> None:
        """Write the energy and infeasibility of every evaluation."""
        header = ("evaluation", "energy_J", "infeasibility")
        write_csv(self._out / "convergence.csv", header, self._history)


def _read_iterate(out, case, world) -> tuple[StartingPoint | None, float, list]:
    """Return an earlier run's point, reference energy (J) and history; None if it recorded none."""
    path = out / "iterate.json"
    if not path.exists():
        return None, 0.0, []
    n_stations, n_times = world.blade.r.size, 4 * case.phase.segments + 1
    n_gains = len(world.law.gain_units) if world.law else 0
    sizes = {
        "chord_m": n_stations,
        "twist_rad": n_stations,
        "rotor_radius_m": 1,
        "gains": n_gains,
        "energy_J": 1,
        "reference_energy_J": 1,
        "rotor_speed_rad_s": n_times,
        "hydrodynamic_torque_Nm": n_times,
    }
    content = read_bytes(path, MAX_ITERATE_BYTES, "iterate of a run")
    try:
        data = json.loads(content)
        values = {
            key: np.array(data[key], dtype=float).reshape(size) for key, size in sizes.items()
        }
        sound = all(np.all(np.isfinite(value)) for value in values.values())
        for key in ("chord_m", "rotor_radius_m", "gains", "rotor_speed_rad_s"):
            sound = sound and bool(np.all(values[key] > 0.0))
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        sound = False
    if not sound:
        raise InputError(
            "is no iterate of this case",
            "delete it to begin anew, or run the case again with --force",
            file=path,
        )
    table = Solution.load(out).convergence if (out / "summary.json").exists() else {}
    radius = world.blade.rotor_radius
    if world.shape.radius_bounds is not None:
        radius = float(np.clip(values["rotor_radius_m"][0], *world.shape.radius_bounds))
    blade = world.blade.with_rotor_radius(radius)
    blade = world.shape.nearest(blade.with_shape(values["chord_m"], values["twist_rad"]))
    operation = Operation(
        float(values["energy_J"][0]),
        values["rotor_speed_rad_s"],
        values["hydrodynamic_torque_Nm"],
        np.empty(0),
        np.empty(0),
        0.0,
        True,
    )
    history = list(zip(*table.values(), strict=True))
    reference = float(values["reference_energy_J"][0])
    return StartingPoint(blade, values["gains"], operation), reference, history


def write_n2(case: Case, path: Path) -> None:
    """Write the N2 diagram of a case's problem, built at the case's own blade without optimizing.

    Raises
    ------
    InputError
        If a file of the case is broken or the diagram cannot be written.
    """
    case = complete(case)
    world = physics(case)
    as_given = case.model_copy(update={"start": case.start.model_copy(update={"method": "blade"})})
    with _scratch_directory():
        start = find_start(as_given, world, best_operation(world.blade, world.polar))
        problem = build_problem(case, world, start, _curve_nodes(case, world, start))
        problem.final_setup()
        try:
            om.n2(problem, outfile=str(path), show_browser=False)
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written: {error.strerror}; choose another --out"
            ) from error


def _bounding_optimum(
    world: Physics, optimum: SteadyOptimum, blade: Blade, flow_speed: np.ndarray
) -> SteadyOptimum:
    """Return the steady optimum that bounds a case's energy, which may have found another radius.

    Where polars follow the Reynolds number: the best of the slowest, usual and fastest flow.
    """
    polars = []
    if blade.rotor_radius != optimum.blade.rotor_radius:
        polars.append(world.polar)
    if isinstance(world.polar, bem.LocalReynolds):
        polars += [world.polar.at_speed(speed) for speed in (flow_speed.min(), flow_speed.max())]
    found = [_steady_optimum(replace(world, polar=polar), blade) for polar in polars]
    if blade.rotor_radius == optimum.blade.rotor_radius:
        found.append(optimum)
    return max(found, key=lambda each: each.power_coefficient)


def _steady_optimum(world: Physics, blade: Blade) -> SteadyOptimum:
    """Return the steady optimum of a case: over the blade too, unless it is fixed."""
    shape = world.shape
    if shape.designs_chord:
        return best_rotor(blade, world.polar, shape.chord_bounds, shape.twist_bounds)
    if not shape.designs_set_angle:
        return best_operation(blade, world.polar)
    return best_set_angle(shape, blade, world.polar)


# Optimizing ---------------------------------------------------------------------------------------


def _optimize(case, world, start, out, log, records) -> tuple[Optimized, Simulation]:
    """Optimize from a start, until nothing that the start has set stands in the way; integrate.

    That is: the torque curve is fine enough, no move limit is active, the open loop's torque keeps
    its limit between the nodes too (for that it is lowered at the nodes of a segment), and a rotor
    under feedback recovers from a small loss of speed (for that a constraint is added, of twice the
    loss where the integration denies the collocation).
    """
    nodes, limits, moves = _curve_nodes(case, world, start), None, MoveLimits()
    margin = start.operation.recovery.margin if start.operation.recovery else np.inf
    slowed = SLOWED if np.min(margin) < NEAR_STALL else 0.0
    limited, energy = False, np.inf
    for _ in range(MAX_PASSES):
        most = None if moves == NARROW else FIRST_ITERATIONS
        driver = make_driver(case, log, most)
        problem = build_problem(case, world, start, nodes, driver, moves, slowed, limits)
        if records:
            _add_recorders(problem, out)
        try:
            problem.run_model()  # also what no design moves, which drivers leave out: time
            log.point = partial(_point, case, world, problem)
            problem.run_driver()
        finally:
            if records:
                problem.record("final")
            problem.cleanup()
        result = _collect(case, world, problem, nodes)
        curve_ok = not has_curve(case, world) or (
            np.max(curve_errors(world, result)[1]) <= case.hydrodynamics.tolerance
        )
        over, _ = between_nodes(case, world, result)
        torque_ok = np.max(over) <= BETWEEN_VIOLATION or world.torque_limit is None
        if not result.outcome.success:  # it lost its way: once more, in smaller moves
            if moves == NARROW:
                break
            moves = NARROW
            if log.last.operation.energy > start.operation.energy:
                start = log.last
                nodes = _curve_nodes(case, world, start)
            continue
        if not slowed and not recovers(case, world, result):
            slowed = SLOWED
            continue
        gained = abs(result.energy / energy - 1.0) > WORTHWHILE
        energy = result.energy
        limited = gained and _at_move_limit(case, world, start, result, moves)
        if curve_ok and torque_ok and not limited:
            flown = fly(case, world, result)
            near = world.law is not None and has_curve(case, world) and slowed <= SLOWED
            if not (near and is_false(result, flown)):
                return result, flown
            slowed = 2.0 * SLOWED  # near stall, where collocation is deceived
            continue
        if not torque_ok:
            limits = world.torque_limit if limits is None else limits
            # where it is exceeded: elsewhere a lower limit would only cost energy
            limits = limits * (1.0 - np.where(over > 0.5 * BETWEEN_VIOLATION, over, 0.0))
        start = result.point
        nodes = _curve_nodes(case, world, start, finer=1 if curve_ok else 2)
    else:
        if limited:  # an optimum between limits of our own making is none
            message = f"still at a move limit after {MAX_PASSES} optimizations"
            ended = replace(result.outcome, success=False, message=message)
            result = replace(result, outcome=ended)
    return result, fly(case, world, result)


class _Recorder(om.SqliteRecorder):
    """A recorder that leaves it to the system when its rows reach the disk.

    Waiting for the disk at every row takes longer than an iteration. A killed process loses
    nothing; a power cut may cost the last rows, and a run is resumed from `iterate.json`.
    """

    def _initialize_database(self, comm):
        super()._initialize_database(comm)
        if self.connection is not None:
            self.connection.execute("PRAGMA synchronous=OFF")


def _add_recorders(problem, out):
    """Record the final case and every iteration; the databases of earlier passes are kept."""
    number, history = 1, out / "history.db"
    while history.exists():
        number += 1
        history = out / f"history_{number}.db"
    problem.driver.add_recorder(_Recorder(str(history.resolve()), record_viewer_data=False))
    solution = out / "solution.db"
    solution.unlink(missing_ok=True)
    problem.add_recorder(_Recorder(str(solution.resolve())))
    problem.recording_options["record_inputs"] = False
    problem.recording_options["includes"] = ["*"]


def _curve_nodes(case, world, start, finer=1):
    """Return tip speed ratios for the torque curve: dense where the start works, sparse beyond.

    Where the curve of the start's blade is not twenty times as accurate as the case asks for, since
    the blade will change, nodes are added: in and beside the intervals that need them, which are
    those where a station changes from attached to stalled flow.
    """
    speed = start.operation.rotor_speed
    flow = world.inflow.speed(np.linspace(0.0, case.phase.duration, speed.size))
    # an optimizer that lost its way may have left the rotor standing somewhere
    ratios = np.maximum(speed * start.blade.rotor_radius / flow, SLOWEST_RATIO)
    low, high = float(np.min(ratios)), float(np.max(ratios))
    middle = 0.5 * (low + high)
    spacing = 0.01 * middle
    nodes = _graded(low - 0.06 * middle, high + 0.06 * middle, spacing, 0.5 * low, 1.6 * high)
    for _ in range(6):
        centers = 0.5 * (nodes[1:] + nodes[:-1])
        table = bem.rotor_coefficients(start.blade, world.polar, nodes).torque
        exact = bem.rotor_coefficients(start.blade, world.polar, centers).torque
        error = np.abs(TorqueSpline(nodes).basis(centers) @ table / exact - 1.0)
        coarse = error > 0.05 * case.hydrodynamics.tolerance
        coarse &= (centers > low - 0.03 * middle) & (centers < high + 0.03 * middle)
        if not np.any(coarse):
            break
        # a jump makes the spline ring beside it
        coarse = np.convolve(coarse, np.ones(3), mode="same") > 0.0
        nodes = np.sort(np.r_[nodes, centers[coarse]])
    return nodes if finer == 1 else np.sort(np.r_[nodes, 0.5 * (nodes[1:] + nodes[:-1])])


def _graded(low, high, spacing, lowest, highest):
    """Return nodes with equal spacing from low to high that grows by a quarter a step beyond."""
    inner = np.linspace(low, high, int(np.ceil((high - low) / spacing)) + 1)

    def outward(edge, end):
        steps, place, step = [], edge, spacing
        while abs(place - edge) < abs(end - edge):
            step = min(1.25 * step, 8.0 * spacing)
            place += np.copysign(step, end - edge)
            steps.append(place)
        return steps

    nodes = np.array([*reversed(outward(low, lowest)), *inner, *outward(high, highest)])
    return nodes[nodes > 0.02]


def _point(case, world, problem) -> StartingPoint:
    """Return the design and trajectory at which a problem stands as the start of another."""
    time_nodes, first = np.unique(_series(problem, "time"), return_index=True)
    time_grid, _ = quadrature(case)  # the instants that a start is sampled at
    speed, torque = (
        CubicSpline(time_nodes, _series(problem, name)[first])(time_grid)
        for name in ("rotor_speed", "hydrodynamic_torque")
    )
    energy = float(problem.get_val("energy")[0])
    n_gains = len(world.law.gain_units) if world.law else 0
    gains = np.array([problem.get_val(f"gain_{i}")[0] for i in range(n_gains)])
    blade = world.blade.with_rotor_radius(float(problem.get_val("rotor_radius")[0]))
    return StartingPoint(
        blade.with_shape(problem.get_val("chord"), problem.get_val("twist")),
        gains,
        Operation(energy, speed, torque, np.empty(0), np.empty(0), 0.0, True),
    )


def _series(problem, name):
    return problem.get_val(f"traj.phase.timeseries.{name}").ravel()


def _collect(case, world, problem, nodes) -> Optimized:
    """Read an optimization's end from its problem."""
    return Optimized(
        problem,
        outcome(problem.driver),
        _point(case, world, problem),
        nodes,
        {name: _series(problem, name) for name in COLUMNS.values()},
        float(problem.get_val("energy")[0]),
        float(problem.get_val("generator_energy")[0]),
        float(problem.get_val("inertia")[0]),
        float(problem.get_val("mass")[0]),
        problem.get_val("torque_coefficient_table") if has_curve(case, world) else np.empty(0),
    )


def _at_move_limit(case, world, start, result, moves):
    """Tell whether the optimum ended at a limit that is set around the start only."""
    near, point = 1e-3, result.point
    own = MoveLimits(0.0, *[np.inf] * 5).bounds(case, world.shape, start)
    chord, twist = world.shape.control(point.blade)
    ends = {
        "rotor_speed": result.trajectory["rotor_speed"],
        "chord_control": chord,
        "twist_control": twist,
        "rotor_radius": np.array([point.blade.rotor_radius]),
        "gain": point.gains,
    }
    for name, (low, high) in moves.bounds(case, world.shape, start).items():
        value, (own_low, own_high) = ends[name], own[name]
        close = near * np.maximum(np.abs(value), 1e-2)
        if np.any((value < low + close) & (low > own_low)) or np.any(
            (value > high - close) & (high < own_high)
        ):
            return True
    return False


# Writing ------------------------------------------------------------------------------------------


def _summarize(case, world, optimum, start, result, flown, checks):
    """Return the summary of a finished run."""
    failed = [check for check in checks if not check.passed]
    blade, ratios = result.point.blade, result.trajectory["tip_speed_ratio"]
    peak = best_operation(blade, world.polar)
    by_name = {check.name: check.value for check in checks}
    gains = [float(gain) for gain in result.point.gains]
    turning = flown.stopped_at is None
    return {
        "success": not failed,
        "message": "; ".join(explain(check) for check in failed) or "converged and verified",
        "package": result.outcome.package,
        "optimizer": result.outcome.optimizer,
        "iterations": result.outcome.iterations,
        "energy_J": result.energy,
        "simulated_energy_J": flown.energy if turning else None,
        "generator_energy_J": flown.generator_energy if turning else None,
        "energy_bound_J": energy_bound(case, world, optimum),
        "bound_power_coefficient": optimum.power_coefficient,
        "bound_tip_speed_ratio": optimum.tip_speed_ratio,
        "gain": None if not gains else gains[0] if len(gains) == 1 else gains,
        "gain_units": list(world.law.gain_units) if world.law else [],
        "tip_speed_ratio": {"min": np.min(ratios), "max": np.max(ratios), "mean": np.mean(ratios)},
        "power_coefficient_max": peak.power_coefficient,
        "tip_speed_ratio_at_power_coefficient_max": peak.tip_speed_ratio,
        "control_torque_max_Nm": np.max(result.trajectory["control_torque"]),
        "rotor_radius_m": blade.rotor_radius,
        "tip_radius_m": blade.tip_radius,
        "set_angle_deg": _set_angle(case, world, blade),
        "inertia_kg_m2": result.inertia,
        "mass_kg": result.mass,
        "r_m": blade.r,
        "chord_m": blade.chord,
        "twist_deg": np.rad2deg(blade.twist),
        "start_chord_m": world.blade.chord,
        "start_twist_deg": np.rad2deg(world.blade.twist),
        "starting_energy_J": start.operation.energy,
        "surrogate_error": by_name["surrogate_error"],
        "surrogate_nodes": int(result.curve.size),
        "max_speed_error": by_name["max_speed_error"],
        "energy_balance_error": abs(
            flown.energy - flown.generator_energy - flown.kinetic_energy_change
        )
        / max(flown.energy, 1e-9),
        "checks": [vars(check) for check in checks],
        "notes": list(world.messages),
        "versions": _versions(),
    }


def _set_angle(case, world, blade):
    """Return the set angle, deg: what was found, or given; None where a designed twist has it."""
    if world.shape.designs_set_angle:
        return float(np.rad2deg(world.shape.control(blade)[1][0]))
    return None if world.shape.designs_chord else case.rotor.set_angle or 0.0


def _versions():
    versions = {"python": platform.python_version()}
    for name in (
        "hkt_mdo",
        "openmdao",
        "dymos",
        "numpy",
        "scipy",
        "numba",
        "casadi",
        "wisdem",
        "pyoptsparse",
    ):
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return versions


def _write_tables(out, case, world, result, flown):
    """Write the trajectory, the simulation and the power curves as CSV files."""
    columns = list(COLUMNS.values())
    write_csv(
        out / "trajectory.csv",
        COLUMNS,
        zip(*(result.trajectory[name] for name in columns), strict=True),
    )
    speed, flow = flown.rotor_speed, flown.inflow_speed
    rows = (
        flown.time,
        flow,
        speed,
        speed * result.point.blade.rotor_radius / flow,
        flown.hydrodynamic_torque,
        flown.control_torque,
        flown.hydrodynamic_torque * speed,
        flown.control_torque * speed,
    )
    write_csv(out / "simulation.csv", COLUMNS, zip(*rows, strict=True))
    _write_blade(out / "blade.csv", case, world, result.point.blade)
    peak = best_operation(result.point.blade, world.polar).tip_speed_ratio
    ratios = np.linspace(0.3, 1.7, 141) * peak
    power = [
        bem.rotor_coefficients(blade, world.polar, ratios).power
        for blade in (result.point.blade, world.blade)
    ]
    header = ("tip_speed_ratio", "power_coefficient", "start_power_coefficient")
    write_csv(out / "power_curve.csv", header, zip(ratios, *power, strict=True))


def _write_blade(path, case, world, blade):
    """Write the found blade as a file that another case can begin from."""
    rotor = {
        "blade": "blade.csv",
        "radius": blade.tip_radius,
        "hub_radius_fraction": blade.hub_radius / blade.tip_radius,
        "blade_count": blade.blade_count,
        "cone": float(np.rad2deg(blade.cone)),
        "set_angle": 0.0,
        "stations": None,
    }
    section = ", ".join(
        f"{key}: {'null' if value is None else value}" for key, value in rotor.items()
    )
    remarks = (
        f"blade found by the case {case.name}; the twist has the set angle in it",
        f"to begin from it, with the path of this file: rotor: {{{section}}}",
    )
    table = BladeTable(
        blade.r,
        blade.chord,
        blade.twist,
        thickness=np.broadcast_to(np.asarray(world.thickness, dtype=float), blade.r.shape),
    )
    write_blade_csv(path, table, remarks)


@contextmanager
def _termination_interrupts(log: _Log):
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


@contextmanager
def _scratch_directory():
    """Let OpenMDAO put its own files (coloring, reports) where they vanish."""
    before = os.environ.get("OPENMDAO_WORKDIR")
    with tempfile.TemporaryDirectory(prefix="hkt_mdo_") as scratch:
        os.environ["OPENMDAO_WORKDIR"] = scratch
        try:
            yield
        finally:
            if before is None:
                del os.environ["OPENMDAO_WORKDIR"]
            else:
                os.environ["OPENMDAO_WORKDIR"] = before
