"""Run a case: optimize, integrate independently, judge, record.

The optimizer is not the judge. A result is a success only if the optimizer converged and an
integration that shares neither torque curve nor collocation with it, the quasi-steady bound and
every bound of the problem agree (`_judge`).
"""

import csv
import json
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import numpy as np
import openmdao.api as om
from scipy.integrate import quad_vec
from scipy.interpolate import CubicSpline

from hkt_mdo.case import Case
from hkt_mdo.drivers import Outcome, outcome
from hkt_mdo.errors import InputError
from hkt_mdo.problem import BEM, Physics, build_problem, find_start, make_driver, physics
from hkt_mdo.results import Solution
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.steady_optimum import SteadyOptimum, best_operation, best_rotor
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.simulation import Plant, RecordedTorque, Simulation, simulate
from hkt_mdo.starting_point import Operation, StartingPoint

MAX_PASSES = 4  # of refining the torque curve or re-centring the move limits
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
# Limits of the judges, as README.md explains them
ENERGY_ERROR, SURROGATE_ERROR, SPEED_ERROR = 2e-4, 1e-3, 1e-2
BOUND_MARGIN, NODE_VIOLATION, BETWEEN_VIOLATION = 1e-5, 1e-6, 1e-3


@dataclass(frozen=True)
class Check:
    """One judge's word: a value, the limit that it must not exceed, and where it occurred."""

    name: str
    value: float
    limit: float
    passed: bool
    detail: str


@dataclass(frozen=True, eq=False)
class Optimized:
    """An optimization's end: the design, the collocated trajectory and how the optimizer fared."""

    problem: om.Problem
    outcome: Outcome
    point: StartingPoint
    nodes: np.ndarray
    trajectory: dict[str, np.ndarray]
    energy: float
    generator_energy: float
    inertia: float
    mass: float
    curve: np.ndarray


def run_case(
    case: Case,
    out: Path,
    *,
    force: bool = False,
    progress: Callable[[int, float, float], None] | None = None,
    figures: bool = True,
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

    Returns
    -------
    Solution
        Loaded from the folder; `success` tells what the judges found.

    Raises
    ------
    InputError
        If a file of the case is broken or the folder cannot be used; nothing has been written then.
    KeyboardInterrupt
        After what exists was saved, with success false.
    """
    began = time.perf_counter()
    out = Path(out)
    world = physics(case)
    make_driver(case)  # a missing package is told before anything is written
    _prepare(out, force)
    _write(out / "case.yaml", case.to_yaml())
    summary: dict = {"case": case.name, "success": False, "message": "interrupted before the end"}
    _write_json(out / "summary.json", summary)
    history: list[tuple[int, float, float]] = []

    def watch(count, energy, infeasibility):
        history.append((len(history), energy, infeasibility))
        if progress is not None:
            progress(len(history), energy, infeasibility)

    try:
        with _scratch_directory():
            optimum = _steady_optimum(case, world)
            start = find_start(case, world, optimum)
            result = _optimize(case, world, start, out, watch)
            flown = _fly(case, world, result)
            checks = _judge(case, world, optimum, result, flown)
            summary |= _summarize(case, world, optimum, start, result, flown, checks)
            summary["wall_seconds"] = time.perf_counter() - began
            _write_tables(out, case, world, start, result, flown)
            om.n2(result.problem, outfile=str(out / "n2.html"), show_browser=False)
    finally:
        _write_csv(out / "convergence.csv", ("evaluation", "energy_J", "infeasibility"), history)
        _write_json(out / "summary.json", summary)
    solution = Solution.load(out)
    if figures:
        from hkt_mdo.plots import save_figures

        save_figures(solution, out / "figures")
    return solution


def write_n2(case: Case, path: Path) -> None:
    """Write the N2 diagram of a case's problem, built at the case's own blade without optimizing.

    Raises
    ------
    InputError
        If a file of the case is broken or the diagram cannot be written.
    """
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


def _steady_optimum(case: Case, world: Physics) -> SteadyOptimum:
    """Return the steady optimum that bounds a case: over the blade too, unless it is fixed."""
    if case.design.blade == "fixed":
        return best_operation(world.blade, world.polar)
    return best_rotor(world.blade, world.polar, world.chord_bounds, world.twist_bounds)


# Optimizing ---------------------------------------------------------------------------------------


def _optimize(case, world, start, out, watch) -> Optimized:
    """Optimize from a start, until the torque curve is fine enough and no move limit is active."""
    nodes = _curve_nodes(case, world, start)
    for _ in range(MAX_PASSES):
        driver = make_driver(case, watch)
        driver.add_recorder(
            om.SqliteRecorder(str((out / "history.db").resolve()), record_viewer_data=False)
        )
        problem = build_problem(case, world, start, nodes, driver)
        problem.add_recorder(om.SqliteRecorder(str((out / "solution.db").resolve())))
        problem.recording_options["record_inputs"] = False
        problem.recording_options["includes"] = ["*"]
        try:
            problem.run_driver()
        finally:
            problem.record("final")
            problem.cleanup()
        result = _collect(case, world, problem, nodes)
        curve_ok = case.hydrodynamics.torque == "direct" or (
            np.max(_curve_errors(world, result)[1]) <= case.hydrodynamics.tolerance
        )
        if not result.outcome.success or (curve_ok and not _at_move_limit(case, start, result)):
            break
        start = result.point
        nodes = _curve_nodes(case, world, start, finer=1 if curve_ok else 2)
    return result


def _curve_nodes(case, world, start, finer=1):
    """Return tip speed ratios for the torque curve: dense where the start works, sparse beyond.

    The dense spacing is halved until the curve of the start's blade is twenty times as accurate
    there as the case asks for, since the blade will change.
    """
    speed = start.operation.rotor_speed
    flow = world.inflow.speed(np.linspace(0.0, case.phase.duration, speed.size))
    ratios = speed * case.rotor.radius / flow
    low, high = float(np.min(ratios)), float(np.max(ratios))
    middle = 0.5 * (low + high)
    spacing = 0.01 * middle
    for _ in range(6):
        nodes = _graded(low - 0.06 * middle, high + 0.06 * middle, spacing, 0.5 * low, 1.6 * high)
        probe = np.linspace(low, high, 101)
        table = bem.rotor_coefficients(start.blade, world.polar, nodes).torque
        exact = bem.rotor_coefficients(start.blade, world.polar, probe).torque
        error = np.max(np.abs(TorqueSpline(nodes).basis(probe) @ table / exact - 1.0))
        if error <= 0.05 * case.hydrodynamics.tolerance:
            break
        spacing *= 0.5
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

    return np.array(
        [*reversed([x for x in outward(low, lowest) if x > 0.02]), *inner, *outward(high, highest)]
    )


def _collect(case, world, problem, nodes) -> Optimized:
    """Read an optimization's end from its problem."""

    def series(name):
        return problem.get_val(f"traj.phase.timeseries.{name}").ravel()

    trajectory = {
        "time": series("time"),
        **{name: series(name) for name in COLUMNS.values() if name not in ("time", "rotor_speed")},
    }
    law = world.law
    trajectory["rotor_speed"] = series("rotor_speed")
    gains = np.array(
        [problem.get_val(f"gain_{i}")[0] for i in range(len(law.gain_units) if law else 0)]
    )
    blade = world.blade.with_shape(problem.get_val("chord"), problem.get_val("twist"))
    energy = float(problem.get_val("energy")[0])
    time_nodes, first = np.unique(trajectory["time"], return_index=True)
    time_grid = np.linspace(0.0, case.phase.duration, 4 * case.phase.segments + 1)

    def resample(name):
        return CubicSpline(time_nodes, trajectory[name][first])(time_grid)

    operation = Operation(
        energy,
        resample("rotor_speed"),
        resample("hydrodynamic_torque"),
        np.empty(0),
        np.empty(0),
        True,
    )
    return Optimized(
        problem,
        outcome(problem.driver),
        StartingPoint(blade, gains, operation),
        nodes,
        trajectory,
        energy,
        float(problem.get_val("generator_energy")[0]),
        float(problem.get_val("inertia")[0]),
        float(problem.get_val("mass")[0]),
        problem.get_val("torque_coefficient_table")
        if case.hydrodynamics.torque == "curve"
        else np.empty(0),
    )


def _curve_errors(world, result):
    """Return the curve's relative torque errors over the trajectory's tip speed ratios."""
    ratios = result.trajectory["tip_speed_ratio"]
    probe = np.linspace(np.min(ratios), np.max(ratios), 201)
    exact = bem.rotor_coefficients(result.point.blade, world.polar, probe).torque
    if not result.curve.size:
        return probe, np.zeros(probe.size)
    return probe, np.abs(TorqueSpline(result.nodes).basis(probe) @ result.curve / exact - 1.0)


def _at_move_limit(case, start, result):
    """Tell whether the trajectory or a gain ended at a limit that was set around the start only."""
    speed, before = result.trajectory["rotor_speed"], start.operation.rotor_speed
    near = 1e-3
    if np.min(speed) < 0.6 * np.min(before) * (1.0 + near) or np.max(speed) > 1.5 * np.max(
        before
    ) * (1.0 - near):
        return True
    if case.design.gain_bounds is not None or not start.gains.size:
        return False
    ratio = result.point.gains / start.gains
    return bool(np.any(ratio < 0.2 * (1.0 + near)) or np.any(ratio > 5.0 * (1.0 - near)))


# Judging ------------------------------------------------------------------------------------------


def _fly(case, world, result) -> Simulation:
    """Integrate the found design under the found controller with direct BEM."""
    plant = Plant(
        result.point.blade,
        world.polar,
        result.inertia,
        case.fluid.density,
        BEM[case.hydrodynamics.check],
    )
    if world.law is None:
        controller = _recorded(case, world, result)
    else:
        law, gains = world.law, result.point.gains

        def controller(_, speed):
            return law.torque(speed, gains)

    return simulate(
        plant,
        world.inflow,
        controller,
        float(result.trajectory["rotor_speed"][0]),
        case.phase.duration,
        samples=20 * case.phase.segments + 1,
        max_step=case.phase.duration / case.phase.segments,
    )


def _recorded(case, world, result) -> RecordedTorque:
    return RecordedTorque(
        result.trajectory["time"],
        result.trajectory["control_torque"],
        case.phase.segments,
        world.torque_limit,
    )


def _judge(case, world, optimum, result, flown) -> list[Check]:
    """Return what every judge says, the optimizer first."""
    trajectory, status = result.trajectory, result.outcome
    checks = [Check("optimizer", float(not status.success), 0.0, status.success, status.message)]

    def check(name, value, limit, detail=""):
        checks.append(Check(name, float(value), limit, bool(value <= limit), detail))

    stopped = flown.stopped_at is not None
    checks.append(
        Check(
            "rotor_keeps_turning",
            float(stopped),
            0.0,
            not stopped,
            f"rotor stops at t = {flown.stopped_at:.2f} s, not generating" if stopped else "",
        )
    )
    check(
        "energy_error",
        abs(result.energy / flown.energy - 1.0) if flown.energy > 0.0 else np.inf,
        ENERGY_ERROR,
        "collocated over independently integrated energy, less one",
    )
    error = np.abs(flown.speed_at(trajectory["time"]) / trajectory["rotor_speed"] - 1.0)
    worst = int(np.argmax(error))
    check("max_speed_error", error[worst], SPEED_ERROR, f"at t = {trajectory['time'][worst]:.2f} s")
    ratios, errors = _curve_errors(world, result)
    worst = int(np.argmax(errors))
    check(
        "surrogate_error", errors[worst], SURROGATE_ERROR, f"at tip speed ratio {ratios[worst]:.3f}"
    )
    check(
        "energy_over_bound",
        flown.energy / _energy_bound(case, world, optimum) - 1.0,
        BOUND_MARGIN,
        "simulated energy over the quasi-steady bound, less one",
    )
    for name, value, where in _node_violations(case, world, result):
        check(name, value, NODE_VIOLATION, where)
    if world.law is None:
        recorded = _recorded(case, world, result)
        dense = np.linspace(0.0, case.phase.duration, 20 * case.phase.segments + 1)
        torque = recorded.unlimited(dense)
        unit = world.torque_limit or float(np.max(torque))
        over = np.maximum(torque - (world.torque_limit or np.inf), -torque) / unit
        worst = int(np.argmax(over))
        check(
            "control_torque_between_nodes",
            over[worst],
            BETWEEN_VIOLATION,
            f"at t = {dense[worst]:.2f} s",
        )
    return checks


def _node_violations(case, world, result):
    """Yield how far each bounded quantity leaves its bounds, over the bounds' own size."""

    def violation(values, low, high, places):
        size = max(abs(x) for x in (low, high) if np.isfinite(x)) or 1.0
        over = np.maximum(low - values, values - high) / size
        worst = int(np.argmax(over))
        return max(float(over[worst]), 0.0), f"at {places[worst]}"

    blade, trajectory = result.point.blade, result.trajectory
    stations = [f"r = {r:.3f} m" for r in blade.r]
    times = [f"t = {t:.2f} s" for t in trajectory["time"]]
    if case.design.blade == "optimized":
        yield "chord_bounds", *violation(blade.chord, *world.chord_bounds, stations)
        yield "twist_bounds", *violation(blade.twist, *world.twist_bounds, stations)
    if case.design.gain_bounds is not None:
        yield "gain_bounds", *violation(result.point.gains, *case.design.gain_bounds, ["the gain"])
    speed = trajectory["rotor_speed"]
    yield "rotor_speed_at_nodes", max(0.0, -float(np.min(speed) / np.max(np.abs(speed)))), ""
    torque = trajectory["control_torque"]
    high = np.inf if world.torque_limit is None else world.torque_limit
    size = np.max(np.abs(torque)) if world.torque_limit is None else world.torque_limit
    over = np.maximum(-torque, torque - high) / size
    worst = int(np.argmax(over))
    yield "control_torque_at_nodes", max(float(over[worst]), 0.0), f"at {times[worst]}"


def _energy_bound(case, world, optimum):
    """Return the quasi-steady bound, J; see `hkt_mdo.rotor.steady_optimum`."""
    edges = np.linspace(0.0, case.phase.duration, case.phase.segments + 1)
    cubed, _ = quad_vec(
        lambda share: np.sum(
            world.inflow.speed(edges[:-1] + share * np.diff(edges)) ** 3 * np.diff(edges)
        ),
        0.0,
        1.0,
    )
    area = np.pi * case.rotor.radius**2
    return 0.5 * case.fluid.density * area * optimum.power_coefficient * float(cubed)


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
        "message": "; ".join(_explain(check) for check in failed) or "converged and verified",
        "package": result.outcome.package,
        "optimizer": result.outcome.optimizer,
        "iterations": result.outcome.iterations,
        "energy_J": result.energy,
        "simulated_energy_J": flown.energy if turning else None,
        "generator_energy_J": flown.generator_energy if turning else None,
        "energy_bound_J": _energy_bound(case, world, optimum),
        "bound_power_coefficient": optimum.power_coefficient,
        "bound_tip_speed_ratio": optimum.tip_speed_ratio,
        "gain": None if not gains else gains[0] if len(gains) == 1 else gains,
        "gain_units": list(world.law.gain_units) if world.law else [],
        "tip_speed_ratio": {"min": np.min(ratios), "max": np.max(ratios), "mean": np.mean(ratios)},
        "power_coefficient_max": peak.power_coefficient,
        "tip_speed_ratio_at_power_coefficient_max": peak.tip_speed_ratio,
        "control_torque_max_Nm": np.max(result.trajectory["control_torque"]),
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
        / flown.energy,
        "checks": [vars(check) for check in checks],
        "versions": _versions(),
    }


def _explain(check: Check) -> str:
    if check.name == "optimizer":
        return f"the optimizer did not converge: {check.detail}"
    if check.name == "rotor_keeps_turning":
        return check.detail
    return f"{check.name} = {check.value:.3g} exceeds {check.limit:g} ({check.detail})"


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


def _write_tables(out, case, world, start, result, flown):
    """Write the trajectory, the simulation and the power curves as CSV files."""
    columns = list(COLUMNS.values())
    _write_csv(
        out / "trajectory.csv",
        COLUMNS,
        zip(*(result.trajectory[name] for name in columns), strict=True),
    )
    speed, flow = flown.rotor_speed, flown.inflow_speed
    rows = (
        flown.time,
        flow,
        speed,
        speed * case.rotor.radius / flow,
        flown.hydrodynamic_torque,
        flown.control_torque,
        flown.hydrodynamic_torque * speed,
        flown.control_torque * speed,
    )
    _write_csv(out / "simulation.csv", COLUMNS, zip(*rows, strict=True))
    peak = best_operation(result.point.blade, world.polar).tip_speed_ratio
    ratios = np.linspace(0.3, 1.7, 141) * peak
    power = [
        bem.rotor_coefficients(blade, world.polar, ratios).power
        for blade in (result.point.blade, world.blade)
    ]
    header = ("tip_speed_ratio", "power_coefficient", "start_power_coefficient")
    _write_csv(out / "power_curve.csv", header, zip(ratios, *power, strict=True))


def _prepare(out: Path, force: bool) -> None:
    """Make the result folder, or empty it of an earlier result."""
    try:
        if out.exists() and not out.is_dir():
            raise InputError(f"--out {out}: is a file; choose another folder")
        if out.is_dir() and any(out.iterdir()):
            if not force:
                raise InputError(
                    f"--out {out}: folder exists; choose another one, or give --force to replace it"
                )
            if not (out / "case.yaml").is_file():
                raise InputError(
                    f"--out {out}: holds no earlier result; --force replaces only results"
                )
            shutil.rmtree(out)
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise InputError(
            f"--out {out}: cannot be written: {error.strerror}; choose another folder"
        ) from error


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


def _write(path: Path, text: str) -> None:
    """Replace a file in one step, so that no reader ever sees half of it."""
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)


def _write_json(path: Path, data) -> None:
    def plain(value):
        if isinstance(value, np.ndarray):
            return value.tolist()
        if isinstance(value, np.generic):
            return value.item()
        raise TypeError(type(value).__name__)

    _write(path, json.dumps(_finite(data), indent=2, default=plain) + "\n")


def _finite(value):
    """Replace what JSON cannot say (NaN, infinity) by null."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float | np.floating) and not np.isfinite(value):
        return None
    return value


def _write_csv(path: Path, header, rows) -> None:
    part = path.with_name(path.name + ".part")
    with part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([[f"{float(value):.10g}" for value in row] for row in rows])
    part.replace(path)
