"""Verdict, objective and time of the reference cases, to compare programs with each other.

python scripts/reference_runs.py run NAME=PYTHON ... --out results/reference --only river25
python scripts/reference_runs.py compare BEFORE.csv AFTER.csv

`run` optimizes each case by `hkt run` in the environment of each Python interpreter, one after the
other, so that the times of two programs are of one machine in one state, and writes NAME.csv.
A case that has a row there is not run again. `compare` prints what differs and exits with 3 if a
case of AFTER is worse: refused where it was verified, or lower in the objective by more than 1e-5,
1e-4 for a random turbine.
"""

import argparse
import csv
import json
import math
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from studies.verification.turbines import LAWS, draw, write

COLUMNS = "case", "verified", "objective", "unit", "iterations", "passes", "wall_s", "cpu_s"
LOWER, LOWER_RANDOM = 1e-5, 1e-4  # relative losses of the objective that are allowed
TURBINES, SEED = 30, 0  # random turbines, and the seed from which they are drawn
FOLDER = ROOT / "tests" / "data" / "river25"
LONG = "turbulent_hour"  # cases of a study of its own
VARIANTS = {  # what no shipped case has
    "scenarios": ("examples/two_flows", "control={law: linear, torque_limit: 700}"),
    "inflow_dynamics": ("sine_limited_quadratic", "inflow_dynamics=oye", "rotor.hub_inertia=100"),
    "radius": ("sine_limited_oloc", "design.radius_bounds=[1.2, 1.5]"),
    "tracking": ("sine_limited_quadratic", "control={law: tracking, torque_limit: 700}"),
    "turbulence": ("sine_quadratic", "limits.power=5000",
                   "inflow={profile: turbulence, mean: 1.5, intensity: 0.15, seed: 3}"),
}  # fmt: skip


def reference_cases(out: Path) -> dict[str, list[str]]:
    """Return the arguments of `hkt run` of each case; files of random turbines are written."""
    shipped = sorted((ROOT / "cases").rglob("*.yaml"))
    cases = {
        f"cases/{path.relative_to(ROOT / 'cases').with_suffix('')}": [str(path)]
        for path in shipped
        if LONG not in path.name
    }
    for name, (file, *overrides) in VARIANTS.items():
        options = [part for each in overrides for part in ("--set", each)]
        cases[f"variants/{name}"] = [str(ROOT / "cases" / f"{file}.yaml"), *options]
    for path in sorted(FOLDER.glob("*.yaml")):
        for law in LAWS:
            cases[f"{path.stem}/{law}"] = [str(path), "--set", f"control.law={law}"]
    for number in range(TURBINES):
        turbine = draw(np.random.default_rng([SEED, number]))
        for law in LAWS:
            file = write(out / "turbines" / f"{SEED}_{number:03d}", law, turbine)
            cases[f"turbines/{SEED}_{number:03d}/{law}"] = [str(file)]
    return cases


def row_of(python: str, name: str, arguments: list[str], folder: Path) -> dict:
    """Run a case by `hkt run` with a Python interpreter and return its row."""
    command = [python, "-m", "hkt_mdo", "run", *arguments, "--out", folder, "--force"]
    used, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*command, "--no-figures"], capture_output=True, check=False)
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    row = {"case": name, "verified": False, "wall_s": round(wall, 1)}
    row["cpu_s"] = round(after.ru_utime + after.ru_stime - used.ru_utime - used.ru_stime, 1)
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        objective = summary["objective"]
    except (OSError, KeyError, TypeError):
        return row  # refused before its end
    return row | {
        "verified": summary["success"],
        "objective": objective["simulated"],
        "unit": objective["unit"],
        "iterations": summary["iterations"],
        "passes": len(summary["passes"]),
    }


def run(programs: dict[str, str], out: Path, only: str) -> None:
    """Run the cases whose names contain a text by each program, and write a table for each."""
    out.mkdir(parents=True, exist_ok=True)
    tables = {name: out / f"{name}.csv" for name in programs}
    done = {name: read(path) if path.exists() else {} for name, path in tables.items()}
    for case, arguments in reference_cases(out).items():
        for name, python in programs.items():
            if only not in case or case in done[name]:
                continue
            row = row_of(python, case, arguments, out / name / case)
            fresh = not tables[name].exists()
            with tables[name].open("a", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, COLUMNS)
                if fresh:
                    writer.writeheader()
                writer.writerow(row)
            print(name, *row.values(), flush=True)


def read(path: Path) -> dict[str, dict]:
    """Return the rows of a table by case."""
    with path.open(newline="", encoding="utf-8") as file:
        return {row["case"]: row for row in csv.DictReader(file)}


def compare(before: Path, after: Path) -> bool:
    """Print the cases of two tables that differ, and tell whether none is worse."""
    old, new = read(before), read(after)
    ratios, good = [], True
    for case in sorted(old.keys() & new.keys()):
        one, other = old[case], new[case]
        ratios.append(float(other["wall_s"]) / float(one["wall_s"]))
        verdicts = [row["verified"] == "True" for row in (one, other)]
        values = [float(row["objective"] or "nan") for row in (one, other)]
        change = values[1] / values[0] - 1.0
        allowed = LOWER_RANDOM if case.startswith("turbines/") else LOWER
        worse = verdicts[0] and (not verdicts[1] or change < -allowed)
        good = good and not worse
        if verdicts[0] != verdicts[1] or not abs(change) <= allowed:
            words = ["refused", "verified"]
            text = "" if verdicts[0] == verdicts[1] else f", {words[verdicts[0]]} before"
            print(f"{case}: {words[verdicts[1]]}{text}, objective {change:+.1e}"
                  f"{', WORSE' if worse else ''}")  # fmt: skip
    if ratios:
        middle = math.exp(np.mean(np.log(ratios)))
        print(f"{len(ratios)} cases; wall time over that before: mean ratio {middle:.2f}")
    return good


def main():
    """Run or compare, as the arguments say."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=("run", "compare"))
    parser.add_argument("what", nargs="+", help="NAME=PYTHON of each program, or two tables")
    parser.add_argument("--out", type=Path, default=Path("results/reference"))
    parser.add_argument("--only", default="", help="run the cases whose names contain this text")
    arguments = parser.parse_args()
    if arguments.action == "compare":
        sys.exit(0 if compare(*map(Path, arguments.what)) else 3)
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    run(dict(each.split("=", 1) for each in arguments.what), arguments.out, arguments.only)


if __name__ == "__main__":
    main()
