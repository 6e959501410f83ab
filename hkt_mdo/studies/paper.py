"""The paper's tables and figures from the shipped cases, beside what the paper prints.

Everything here is put together from the case runner, the simulation under uncertainty and the
plots; no model is built here. Finished cases and ensembles are reused, so an interrupted
reproduction goes on where it stopped.
"""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from itertools import product
from pathlib import Path

import numpy as np
import yaml

from hkt_mdo.dynamics.trajectory import COLUMNS
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import data_path
from hkt_mdo.results.folder import write_text
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.batch import in_processes, run_batch
from hkt_mdo.studies.common import CODESIGN, LAWS, case_file, with_blade

FLOWS = ("A", "B", "C")
REFERENCES = ("fluctuation", "total")
SENSOR_RATES = (10.0, 100.0, 1000.0)

Report = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Paper:
    """All results of a reproduction, by name, and the paper's printed numbers.

    The solutions are those of the ten shipped cases, of sequential design
    (`sine_sequential_oloc`, ...) and of the redesigned optimal control (`redesigned_A`, ...).
    """

    solutions: dict[str, Solution]
    ensembles: dict[str, dict]
    reported: dict


def reproduce(
    out: Path,
    cases: Path | None = None,
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
    cases : Path or None
        Folder of the case files; None: the shipped ones.
    jobs : int or None
        Parallel processes; None: one per core.
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
    shipped = {name: case_file(cases, name) for name in (*CODESIGN, "sine_baseline_oloc")}

    def run(plan):
        found = run_batch(
            {out / "cases" / name: case for name, case in plan.items()},
            jobs,
            lambda path, word: report(f"case {path.name}: {word}"),
        )
        if lost := [path.name for path, solution in found.items() if solution is None]:
            raise InputError(f"{out / 'cases'}: could not run {', '.join(lost)}")
        return {path.name: solution for path, solution in found.items()}

    solutions = run(shipped | _sequential_cases(shipped))
    solutions |= run(_redesigned_cases(solutions["sine_limited_oloc"]))
    ensembles = _ensembles(out, repeats, seed, jobs, report)
    reported = yaml.safe_load(data_path("amini2023", "reported").read_text(encoding="utf-8"))

    from hkt_mdo.studies.paper_report import write_report

    return write_report(Paper(solutions, ensembles, reported), out, report)


def _sequential_cases(shipped):
    """Return cases that keep the best steady blade and optimize the controller only."""
    from hkt_mdo.problem.physics import physics
    from hkt_mdo.rotor.steady_optimum import best_rotor

    world = physics(shipped["sine_oloc"])
    best = best_rotor(
        world.blade, world.polar, world.shape.chord_bounds, world.shape.twist_bounds
    ).blade
    return {
        f"{scenario}_sequential_{law}": with_blade(
            shipped[f"{scenario}_{law}"], best.chord, np.rad2deg(best.twist), "fixed"
        )
        for scenario in ("sine", "sine_limited")
        for law in LAWS
    }


def _redesigned_cases(solution):
    """Return optimal control of the blade of a solution in flows A, B and C."""
    from hkt_mdo.studies.uncertainty import flow_named

    summary = solution.summary
    kept = with_blade(solution.case, summary["chord_m"], summary["twist_deg"], "fixed")
    return {
        f"redesigned_{name}": kept.model_copy(update={"inflow": flow_named(name, kept.inflow)})
        for name in FLOWS
    }


# Uncertainty --------------------------------------------------------------------------------------


def ensemble_key(law: str, flow: str, reference="fluctuation", rate=100.0) -> str:
    """Return the name of a law's runs in a flow, by default under the default sensor."""
    return f"{law}_{flow}_quiet" if reference is None else f"{law}_{flow}_{reference}_{rate:g}Hz"


def _ensembles(out, repeats, seed, jobs, report):
    """Return every simulation in a flow that a design was not made for, by name."""
    folder = out / "uncertainty"
    folder.mkdir(parents=True, exist_ok=True)
    settings = {f"oloc_{flow}": ("oloc", flow, None, None) for flow in FLOWS}
    for law, flow in product(LAWS[1:], FLOWS):
        for sensor in ((None, None), *product(REFERENCES, SENSOR_RATES)):
            settings[ensemble_key(law, flow, *sensor)] = (law, flow, *sensor)
    found, waiting, stamps = {}, {}, {}
    for key, (law, *rest) in settings.items():
        task = (out / "cases" / f"sine_limited_{law}", *rest, repeats, seed)
        stamps[key] = _stamp(*task)
        try:
            stored = json.loads((folder / f"{key}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            stored = {}
        if stored.get("stamp") == stamps[key]:
            found[key] = stored
        else:
            waiting[key] = task

    def ended(key, future):
        found[key] = future.result() | {"stamp": stamps[key]}
        write_text(folder / f"{key}.json", json.dumps(found[key]))
        report(f"uncertainty: {key}")

    in_processes(_one_ensemble, waiting, jobs, ended)
    return {key: found[key] for key in settings}


def _stamp(source, *settings):
    """Return a fingerprint of a design and of how it is simulated."""
    digest = hashlib.sha256((source / "summary.json").read_bytes())
    digest.update((source / "trajectory.csv").read_bytes())
    digest.update(repr((settings, version("hkt_mdo"))).encode())
    return digest.hexdigest()


def _one_ensemble(source, flow, reference, rate, repeats, seed):
    """Simulate a design in a flow, without noise where no reference of the noise is given."""
    from hkt_mdo.studies.uncertainty import Design, Sensor, flow_named, fly_noisy

    design = Design.of(Solution.load(source))
    inflow = flow_named(flow, design.solution.case.inflow)
    if reference is None:
        run = design.fly(inflow)
        energy = run.energy if run.stopped_at is None else None
        result = {"energy_J": energy, "stopped_at_s": run.stopped_at}
    else:
        run = fly_noisy(design, inflow, Sensor(reference=reference, rate=rate), repeats, seed)
        energy = run.energy[np.isfinite(run.energy)]
        result = {
            "repeats": repeats,
            "stalled": run.stalled,
            "energy_J": float(np.mean(energy)) if energy.size else None,
            "spread_J": float(np.std(energy, ddof=1)) if energy.size > 1 else None,
            "worst_J": float(np.min(energy)) if energy.size else None,
            "noise_deviation_rad_s": run.noise_deviation,
            "torque_error": run.torque_error,
        }
    thin = slice(None, None, max(run.time.size // 1200, 1))
    series = {
        COLUMNS[name]: np.asarray(getattr(run, name))[thin].tolist()
        for name in ("time", "inflow_speed", "rotor_speed", "control_torque", "hydrodynamic_torque")
    }
    return result | {"series": series}
