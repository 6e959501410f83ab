"""An hour of turbulence under the three controllers: writes docs/studies/hour.md and its figure.

python studies/turbulent_hour.py --out results/hour

Each case is one `hkt run` of its own, so that time and memory are those of the command.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import page_data
import study_plots as plots

from hkt_mdo.problem.physics import physics
from hkt_mdo.results import style
from hkt_mdo.results.solution import Solution

ROOT = Path(__file__).parent.parent
LAWS = {"oloc": "open loop", "quadratic": "quadratic feedback", "linear": "linear feedback"}

LAST = "## What to look at"

PAGE = """# An hour of turbulence

`cases/examples/turbulent_hour_*.yaml`: the paper's turbine under its 700 N m limit in {flow}
Written by `studies/turbulent_hour.py`; each case is one `hkt run` from the command line.

![Rotor speed and power over two minutes of the hour](../images/example_turbulent_hour.png)

| control | success | energy / MJ | to open loop | share of bound | gain | tip speed ratio |
|---|---|---|---|---|---|---|
{results}

| control | segments | unknown speeds | evaluations | energy error | speed error | curve error |
|---|---|---|---|---|---|---|
{checks}

Energy is that of the independent simulation. Errors are those of the checks: collocation against
the independent integration with direct BEM
(limits 2e-4 in energy and 1e-2 in speed), curve against direct BEM (1e-4).

| control | time | peak memory |
|---|---|---|
{costs}

{machine}

{last}

{text}
"""


def run(case: Path, folder: Path) -> dict:
    """Run a case by the command line; return its exit code, seconds and peak memory (bytes)."""
    command = [sys.executable, "-W", "ignore", "-m", "hkt_mdo", "run", str(case)]
    began = time.perf_counter()
    process = subprocess.Popen([*command, "--out", str(folder), "--force"])
    _, status, usage = os.wait4(process.pid, 0)
    return {
        "exit": os.waitstatus_to_exitcode(status),
        "seconds": time.perf_counter() - began,
        "bytes": usage.ru_maxrss * 1024,
    }


def draw(solutions: dict, path: Path, span=(1500.0, 1620.0)) -> None:
    """Draw flow, rotor speed, torque and power of all controllers over a part of the hour."""
    shown = []
    for law, solution in solutions.items():
        table = solution.simulation
        inside = (table["time_s"] >= span[0]) & (table["time_s"] <= span[1])
        part = {"simulation": {name: column[inside] for name, column in table.items()}}
        case = solution.case.model_copy(update={"name": LAWS[law]})
        tables = dict.fromkeys(solution.tables, part)
        shown.append(replace(solution, case=case, tables=tables))
    drawn = plots.plot_inflow_speed, plots.plot_power, plots.plot_rotor_speed
    panels = [partial(plot, shown) for plot in (*drawn, plots.plot_control_torque)]
    style.save({path.stem: style.figure_of(7.4, 7.6, panels)}, path.parent)


def main() -> None:
    """Run the three cases, unless they are there already, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/hour"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    solutions, costs = {}, {}
    for law in LAWS:
        folder, record = arguments.out / law, arguments.out / f"{law}.json"
        if not record.exists():
            case = ROOT / "cases" / "examples" / f"turbulent_hour_{law}.yaml"
            record.write_text(json.dumps(run(case, folder)), encoding="utf-8")
        costs[law] = json.loads(record.read_text(encoding="utf-8"))
        solutions[law] = Solution.load(folder)
    draw(solutions, ROOT / "docs" / "images" / "example_turbulent_hour.png")

    speed = physics(solutions["oloc"].case).inflow.speed_at(np.linspace(0.0, 3600.0, 36_001))
    flow = {
        "mean": float(np.mean(speed)),
        "deviation": float(np.std(speed)),
        "lowest": float(speed.min()),
        "highest": float(speed.max()),
        "cutoff_Hz": physics(solutions["oloc"].case).inflow.cutoff,
    }
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}"
    results = {law: shown(solution) | costs[law] for law, solution in solutions.items()}
    page_data.page_from("hour", from_data, results=results, flow_m_s=flow, machine=machine)


def shown(solution) -> dict:
    """Return what the page shows of a result."""
    summary = solution.summary
    checks = {check.name: check.value for check in summary.checks}
    return {
        "success": solution.success,
        "message": str(solution.message),
        "simulated_energy_J": summary.simulated_energy_J,
        "energy_bound_J": summary.energy_bound_J,
        "gain": summary.gain,
        "tip_speed_ratio": [*summary.tip_speed_ratio.ends],
        "segments": solution.case.phase.segments,
        "evaluations": int(solution.convergence["evaluation"].size),
        "errors": [checks[x] for x in ("energy_error", "max_speed_error", "surrogate_error")],
    }


def from_data(data: dict) -> str:
    """Return the page of its data; its last section is written by hand, and stays."""
    results, checks, spent = [], [], []
    best = data["results"]["oloc"]["simulated_energy_J"]
    for law, entry in data["results"].items():
        energy, (low, high) = entry["simulated_energy_J"], entry["tip_speed_ratio"]
        gain = "" if entry["gain"] is None else f"{entry['gain']:.4g}"
        results.append(
            f"| {LAWS[law]} | {'yes' if entry['success'] else 'no: ' + entry['message']} | "
            f"{energy / 1e6:.4f} | {100.0 * (energy / best - 1.0):+.4f} % | "
            f"{100.0 * energy / entry['energy_bound_J']:.3f} % | {gain} | {low:.2f} to {high:.2f} |"
        )
        counts = f"{entry['segments']} | {entry['segments'] + 1} | {entry['evaluations']}"
        errors = " | ".join(f"{error:.1e}" for error in entry["errors"])
        checks.append(f"| {LAWS[law]} | {counts} | {errors} |")
        spent.append(
            f"| {LAWS[law]} | {entry['seconds'] / 60.0:.1f} min | {entry['bytes'] / 1e9:.2f} GB |"
        )
    return PAGE.format(
        flow="von Kármán turbulence of {mean:.2f} m/s with a standard deviation of "
        "{deviation:.3f} m/s,\n{lowest:.2f} to {highest:.2f} m/s, up to "
        "{cutoff_Hz:g} Hz.".format(**data["flow_m_s"]),
        results="\n".join(results),
        checks="\n".join(checks),
        costs="\n".join(spent),
        machine=f"{data['machine']}; other work ran beside it.",
        text=page_data.text_of("hour").partition(LAST)[2].strip(),
        last=LAST,
    )


if __name__ == "__main__":
    main()
