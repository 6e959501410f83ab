"""The paper's tables and figures from the shipped cases, beside what the paper prints.

Everything here is put together from the case runner, the simulation under uncertainty and the
plots; no model is built here. Finished cases and ensembles are reused, so an interrupted
reproduction goes on where it stopped.
"""

import hashlib
import json
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import yaml

from hkt_mdo.case import Case, load_case
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import data_path
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.batch import run_batch

LAWS = ("oloc", "linear", "quadratic")
FLOWS = ("A", "B", "C")
LABELS = {"oloc": "OLOC", "linear": "linear feedback", "quadratic": "quadratic feedback"}
TABLES = {
    "step": "Table II: step flow, no torque limit",
    "sine": "Table III: sine flow, no torque limit",
    "sine_limited": "Table IV: sine flow, torque limit 700 N m",
}
SENSOR_RATES = (10.0, 100.0, 1000.0)

Report = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Paper:
    """All results of a reproduction, by name."""

    solutions: dict[str, Solution]
    sequential: dict[str, Solution]
    redesigned: dict[str, Solution]
    ensembles: dict[str, dict]
    reported: dict


def reproduce(
    out: Path,
    cases: Path = Path("cases"),
    jobs: int | None = None,
    repeats: int = 20,
    seed: int = 1,
    report: Report = lambda line: None,
) -> dict:
    """Run everything that the paper's tables and figures need and write the report.

    Parameters
    ----------
    out : Path
        Folder of the results: cases/, uncertainty/, figures/, paper.json, report.md, report.html.
    cases : Path
        Folder of the shipped case files.
    jobs : int or None
        Parallel processes; None: one a core.
    repeats, seed : int
        Of the noisy simulations.
    report : callable
        Called with a line whenever something is done.

    Returns
    -------
    dict
        What paper.json holds.

    Raises
    ------
    InputError
        If the case files are not found or the folder cannot be written.
    """
    names = [*(f"{scenario}_{law}" for scenario in TABLES for law in LAWS), "sine_baseline_oloc"]
    missing = [name for name in names if not (cases / f"{name}.yaml").is_file()]
    if missing:
        raise InputError(
            f"--cases {cases}: has no {missing[0]}.yaml; give the folder of the shipped cases"
        )
    shipped = {name: load_case(cases / f"{name}.yaml") for name in names}
    folder = out / "cases"

    def done(path, word):
        report(f"case {path.name}: {word}")

    plan = shipped | _sequential_cases(shipped)
    found = run_batch({folder / name: case for name, case in plan.items()}, jobs, done)
    ran = {path.name: solution for path, solution in found.items()}
    lost = [name for name, solution in ran.items() if solution is None]
    if lost:
        raise InputError(f"{folder}: could not run {', '.join(lost)}")
    again = run_batch(
        {folder / name: case for name, case in _redesigned_cases(ran).items()}, jobs, done
    )
    ensembles = _ensembles(out, repeats, seed, jobs, report)
    paper = Paper(
        {name: ran[name] for name in names},
        {name: solution for name, solution in ran.items() if name not in names},
        {path.name[-1]: solution for path, solution in again.items()},
        ensembles,
        yaml.safe_load(data_path("amini2023", "reported").read_text(encoding="utf-8")),
    )

    from hkt_mdo.studies.paper_report import write_report

    return write_report(paper, out, report)


def _sequential_cases(shipped):
    """Return cases that keep the best steady blade and optimize the controller only."""
    from hkt_mdo.problem.build import physics
    from hkt_mdo.rotor.steady_optimum import best_rotor

    world = physics(shipped["sine_oloc"])
    best = best_rotor(
        world.blade, world.polar, world.shape.chord_bounds, world.shape.twist_bounds
    ).blade
    return {
        f"{scenario}_sequential_{law}": _fixed(
            shipped[f"{scenario}_{law}"], best.chord, np.rad2deg(best.twist)
        )
        for scenario in ("sine", "sine_limited")
        for law in LAWS
    }


def _redesigned_cases(ran):
    """Return optimal control of the blade of sine_limited_oloc in flows A, B and C."""
    from hkt_mdo.studies.uncertainty import flow_named

    solution = ran["sine_limited_oloc"]
    kept = _fixed(solution.case, solution.summary["chord_m"], solution.summary["twist_deg"])
    return {
        f"redesigned_{name}": kept.model_copy(update={"inflow": flow_named(name, kept.inflow)})
        for name in FLOWS
    }


def _fixed(case: Case, chord, twist) -> Case:
    """Return a case with a blade (m, deg) that is kept."""
    rotor = case.rotor.model_copy(
        update={"chord": tuple(map(float, chord)), "twist": tuple(map(float, twist))}
    )
    design = case.design.model_copy(update={"blade": "fixed"})
    return case.model_copy(update={"rotor": rotor, "design": design})


# Uncertainty --------------------------------------------------------------------------------------


def _ensembles(out, repeats, seed, jobs, report):
    """Return every simulation in a flow that a design was not made for, by a speaking key."""
    folder = out / "uncertainty"
    folder.mkdir(parents=True, exist_ok=True)
    tasks = {f"oloc_{flow}": ("oloc", flow, None, None) for flow in FLOWS}
    for law in LAWS[1:]:
        for flow in FLOWS:
            tasks[f"{law}_{flow}_quiet"] = (law, flow, None, None)
            for reference in ("fluctuation", "total"):
                for rate in SENSOR_RATES:
                    tasks[f"{law}_{flow}_{reference}_{rate:g}Hz"] = (law, flow, reference, rate)
    found, waiting = {}, {}
    for key, (law, flow, reference, rate) in tasks.items():
        source = out / "cases" / f"sine_limited_{law}"
        stamp = _stamp(source, flow, reference, rate, repeats, seed)
        path = folder / f"{key}.json"
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            stored = {}
        if stored.get("stamp") == stamp:
            found[key] = stored
        else:
            waiting[key] = (str(source), flow, reference, rate, repeats, seed, stamp, str(path))
    with ProcessPoolExecutor(jobs or os.cpu_count(), mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(_one_ensemble, *task): key for key, task in waiting.items()}
        try:
            for count, future in enumerate(as_completed(futures), 1):
                found[futures[future]] = future.result()
                report(f"uncertainty {count} of {len(waiting)}: {futures[future]}")
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return {key: found[key] for key in tasks}


def _stamp(source, *settings):
    """Return a fingerprint of a design and of how it is simulated."""
    digest = hashlib.sha256((source / "summary.json").read_bytes())
    digest.update((source / "trajectory.csv").read_bytes())
    digest.update(repr((settings, version("hkt_mdo"))).encode())
    return digest.hexdigest()


def _one_ensemble(source, flow, reference, rate, repeats, seed, stamp, path):
    """Simulate a design in a flow, quietly or under noise, in a process of its own."""
    import warnings

    warnings.filterwarnings("ignore")
    from hkt_mdo.problem.flow import build_inflow
    from hkt_mdo.studies.uncertainty import Design, Sensor, flow_named, fly_noisy

    design = Design.of(Solution.load(source))
    section = flow_named(flow, design.solution.case.inflow)
    inflow = build_inflow(section)
    if reference is None:
        run = design.fly(inflow)
        result = {
            "energy_J": run.energy if run.stopped_at is None else None,
            "stopped_at_s": run.stopped_at,
        }
    else:
        run = fly_noisy(design, inflow, Sensor(reference=reference, rate=rate), repeats, seed)
        turning = np.isfinite(run.energy)
        result = {
            "repeats": repeats,
            "stalled": run.stalled,
            "energy_J": float(np.mean(run.energy[turning])) if turning.any() else None,
            "spread_J": float(np.std(run.energy[turning], ddof=1)) if turning.sum() > 1 else None,
            "worst_J": float(np.min(run.energy[turning])) if turning.any() else None,
            "noise_deviation_rad_s": run.noise_deviation,
            "torque_error": run.torque_error,
        }
    thin = slice(None, None, max(run.time.size // 1200, 1))
    result["series"] = {
        "time_s": run.time[thin].tolist(),
        "inflow_speed_m_s": np.asarray(run.inflow_speed)[thin].tolist(),
        "rotor_speed_rad_s": run.rotor_speed[thin].tolist(),
        "control_torque_Nm": run.control_torque[thin].tolist(),
        "hydrodynamic_torque_Nm": run.hydrodynamic_torque[thin].tolist(),
    }
    result["stamp"] = stamp
    target = Path(path)
    part = target.with_name(target.name + ".part")
    part.write_text(json.dumps(result), encoding="utf-8")
    part.replace(target)
    return result


def default_key(law: str, flow: str) -> str:
    """Return the key of the default sensor's ensemble."""
    return f"{law}_{flow}_fluctuation_100Hz"


def as_solution(solution: Solution, name: str, series: dict | None = None) -> Solution:
    """Return a solution under a legend's name, with another run's time series if given."""
    renamed = replace(
        solution,
        case=solution.case.model_copy(update={"name": name}),
        summary={
            key: value for key, value in solution.summary.items() if not key.startswith("start_")
        },
    )
    if series is None:
        return renamed
    columns = {key: np.array(values) for key, values in series.items()}
    return replace(renamed, simulation=columns, trajectory={})
