"""Reproduce the paper: Tables II to V and Figs. 3 to 12 of Amini et al. (ACC 2023).

python scripts/paper.py --out results/paper    # some minutes

Writes paper.json, report.md and report.html with the results of the shipped cases beside the
paper's numbers; exits with 3 if a check does not hold. Finished cases and ensembles are reused, so
an interrupted reproduction goes on where it stopped.
"""

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "studies"))

from paper_report import FLOWS, SENSORS, ensemble_key, write_report
from study_common import CODESIGN, LAWS, case_file, with_blade

from hkt_mdo.errors import InputError, program_version
from hkt_mdo.problem.physics import physics
from hkt_mdo.quantities import QUANTITIES
from hkt_mdo.results.folder import write_json
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.batch import run_batch
from hkt_mdo.run.engine import in_processes
from hkt_mdo.studies.uncertainty import flow_given, noisy_runs


def reproduce(
    out: Path, cases: Path | None, jobs: int | None, repeats: int, seed: int, report: Callable
) -> dict:
    """Reproduce the paper in a folder and return what its paper.json holds.

    Parameters
    ----------
    out : pathlib.Path
        Folder that gets cases/, uncertainty/, figures/, paper.json, report.md and report.html.
    cases : pathlib.Path or None
        Folder of the case files; None: the shipped ones.
    jobs : int or None
        Number of processes; None: one a core.
    repeats, seed : int
        Number of the noisy simulations of each design, and seed of their random numbers.
    report : callable
        report(line) is called whenever something is done.

    Returns
    -------
    dict
        What paper.json holds.

    Raises
    ------
    InputError
        If the case files are not found or a case cannot be run.
    """
    shipped = {name: case_file(cases, name) for name in (*CODESIGN, "sine_baseline_oloc")}

    def run(plan):
        folders = {out / "cases" / name: case for name, case in plan.items()}
        results = run_batch(folders, jobs, lambda path, word: report(f"case {path.name}: {word}"))
        if lost := [path.name for path, solution in results.items() if solution is None]:
            raise InputError(f"could not run {', '.join(lost)}", file=out / "cases")
        return {path.name: solution for path, solution in results.items()}

    physics_ = physics(shipped["sine_oloc"])
    best = physics_.rotor.best_of_shape(physics_.shape, physics_.blade).blade
    solutions = run(shipped | {
        f"{scenario}_sequential_{law}": with_blade(
            shipped[f"{scenario}_{law}"], best.chord, np.rad2deg(best.twist), "fixed"
        )
        for scenario, law in product(("sine", "sine_limited"), LAWS)
    })  # fmt: skip
    limited = solutions["sine_limited_oloc"]
    kept = with_blade(limited.case, limited.summary.chord_m, limited.summary.twist_deg, "fixed")
    solutions |= run({
        f"redesigned_{flow}": kept.model_copy(update={"inflow": flow_given(flow, kept)})
        for flow in FLOWS
    })  # fmt: skip
    return write_report(solutions, _ensembles(out, repeats, seed, jobs, report), out, report)


def _ensembles(out, repeats, seed, jobs, report):
    """Return every simulation in a flow that a design was not made for, by name."""
    folder = out / "uncertainty"
    folder.mkdir(parents=True, exist_ok=True)
    results, waiting, stamps = {}, {}, {}
    for law, flow, sensor in product(LAWS, FLOWS, (None, *SENSORS)):
        if law == "oloc" and sensor:
            continue  # it reads none
        key, source = ensemble_key(law, flow, sensor), out / "cases" / f"sine_limited_{law}"
        made_of = repr((flow, sensor, repeats, seed, program_version())).encode()
        made_of += (source / "summary.json").read_bytes() + (source / "trajectory.csv").read_bytes()
        stamps[key] = hashlib.sha256(made_of).hexdigest()
        try:
            results[key] = json.loads((folder / f"{key}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            results[key] = {}
        if results[key].get("stamp") != stamps[key]:
            waiting[key] = partial(_one_ensemble, source, flow, sensor, repeats, seed)

    def ended(key, future):
        results[key] = future.result() | {"stamp": stamps[key]}
        write_json(folder / f"{key}.json", results[key])
        report(f"uncertainty: {key}")

    in_processes(waiting.items(), jobs, ended)
    return results


def _one_ensemble(source, flow, sensor, repeats, seed):
    """Simulate a design in a flow, without noise where no sensor is given."""
    design = Solution.load(source).design()
    inflow = flow_given(flow, design.physics.case)
    if sensor is None:
        run = design.simulate(inflow)
        energy = run.energy if run.stopped_at is None else None
        result = {"energy_J": energy, "stopped_at_s": run.stopped_at}
    else:
        run = noisy_runs(design, inflow, sensor, repeats, seed)
        energies = run.energies
        result = {
            "repeats": repeats,
            "stalled": int(np.isfinite(run.stopped_at).sum()),
            "energy_J": energies.get("mean"),
            "spread_J": energies.get("standard deviation"),
            "worst_J": energies.get("smallest"),
            "noise_deviation_rad_s": run.noise_deviation,
        }
    names = ("time", "inflow_speed", "rotor_speed", "hydrodynamic_torque", "control_torque")
    values = [getattr(run, name) for name in names] if sensor is None else run.samples
    first = slice(np.argmax(np.diff(values[0], append=0.0) < 0.0) + 1)  # of the repeats
    thin = slice(None, None, max(first.stop // 1200, 1))
    pairs = zip(names, values, strict=True)
    series = {QUANTITIES[name].column: each[first][thin].tolist() for name, each in pairs}
    return result | {"series": series}


def main():
    """Reproduce the paper and print the checks that do not hold."""
    parser = argparse.ArgumentParser(description="Reproduce the paper's tables and figures.")
    parser.add_argument("--out", type=Path, default=Path("results/paper"), help="result folder")
    parser.add_argument("--cases", type=Path, help="folder of the case files; default: shipped")
    parser.add_argument("--jobs", type=int, help="processes; default: one a core")
    parser.add_argument("--repeats", type=int, default=20, help="noisy runs of each design")
    parser.add_argument("--seed", type=int, default=1, help="of their random numbers")
    args, began = parser.parse_args(), time.perf_counter()

    def report(line):
        print(f"[{time.perf_counter() - began:7.1f} s] {line}", flush=True)

    data = reproduce(args.out, args.cases, args.jobs, args.repeats, args.seed, report)
    failed = [check for check in data["checks"] if not check["passed"]]
    print(f"{len(data['checks']) - len(failed)} of {len(data['checks'])} checks hold")
    for check in failed:
        expected = f"expected {check['low']} to {check['high']}"
        print(f"  not: {check['statement']} = {check['value']}, {expected}")
    print(f"Report: {args.out / 'report.html'}")
    sys.exit(3 if failed else 0)


if __name__ == "__main__":
    main()
