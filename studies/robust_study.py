"""What a design for several flows gains over one for a single flow: runs the study, and its page.

python studies/robust_study.py --out results/robust

Designs and simulations that a folder has are used again. About half an hour on two cores. The page
is written from docs/data/robust.json, without any run also by
`python studies/page_data.py --write robust`.
"""

import argparse
import json
import os
import textwrap
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
import page_data
from study_common import markdown_table, run_nested

from hkt_mdo.case import load_case
from hkt_mdo.results.folder import write_json
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import limit_words
from hkt_mdo.run.engine import in_processes
from hkt_mdo.studies.other_flows import Run

LAWS = "quadratic", "rated"
LIMITS = {
    "power": "5 kW",
    "rotor_speed": "11 rad/s",
    "thrust": "6.5 kN",
    "stress": "100 MPa",
    "cavitation": {"depth": 3},
}
SHARED = {"profile": "turbulence", "duration": 60, "cutoff": 0.5, "amplitudes": "random"}
RIVERS = {
    "calm": SHARED | {"mean": 1.5, "intensity": 0.1, "length_scale": 4},
    "rough": SHARED | {"spectrum": "kaimal", "mean": 1.4, "intensity": 0.16, "length_scale": 4},
}
SEEN, FIRST_UNSEEN = 5, 1001  # minutes of the calm river in designs; seed of the first other one
SHOWN = "scenarios", "limits", "inertia_kg_m2"  # of the summaries, on the page
FOULED = {"lift": 0.9, "drag": 1.5}
DESIGNS = "nominal", "expected"
STATES = {"as new": {}, "fouled": {"condition": FOULED}}
RATIOS = np.linspace(0.05, 25.0, 2500)  # tip speed ratios of the torque in unseen minutes
DRAWS, INTERVAL = 10_000, (2.5, 97.5)  # of the bootstrap; per cent

HEAD = f"""\
# One design for several flows

Written by `python studies/robust_study.py`: the paper's rotor on 40 stations with 700 N m, 5 kW,
6.5 kN, 11 rad/s, 100 MPa and no cavitation at 3 m; blade and law are designed together. *Nominal*
is designed in one minute of turbulence (seed 1) of the calm river, *expected* in {SEEN} (seeds 1 to
{SEEN}) for their mean power ([equations.md](../dev/equations.md#several-flows)). Of a design for
the worst minute, whose optimization takes hundreds of iterations, this page has no result.

The *calm* river is von Karman's turbulence, 1.5 m/s, 10 %; the *rough* one Kaimal's, 1.4 m/s, 16 %;
both of 4 m, up to 0.5 Hz, with random amplitudes. Every design is simulated in other, *unseen*,
minutes: its torque from a curve of {RATIOS.size} tip speed ratios by BEM, its loads by direct BEM.
A minute breaks a limit where the simulation exceeds it by more than a run allows between its nodes.
Brackets are 95 % intervals by bootstrap over the minutes. A design that breaks its limits may
capture more, so compare powers only together with the share of minutes in which a limit is broken.

"""


def main():
    """Run what has no result yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/robust"))
    parser.add_argument("--jobs", type=int, default=None, help="processes (default: one a core)")
    parser.add_argument("--flows", type=int, default=50, help="unseen minutes of each river")
    arguments = parser.parse_args()
    report = partial(print, flush=True)
    keys = [*product(LAWS, DESIGNS)]
    folders = {key: arguments.out / "_".join(key) for key in keys}
    cases = {folder: case(*key) for key, folder in folders.items()}
    designs = dict(zip(keys, run_nested(cases, arguments.jobs, report).values(), strict=True))
    scores, tasks = {}, {}
    for key, (state, river) in product(keys, product(STATES, RIVERS)):
        if designs[key] is None or not designs[key].success:
            continue
        file = folders[key] / f"{river}_{state}.json".replace(" ", "_")
        tasks[key, f"{river}, {state}"] = partial(
            simulated, folders[key], file, river, state, arguments.flows
        )

    def ended(task, future):
        key, name = task
        scores.setdefault("; ".join(key), {})[name] = future.result()
        report(*key, name)

    in_processes(tasks.items(), arguments.jobs, ended)
    results = {
        "designs": {
            "; ".join(key): page_data.of_result(design, SHOWN) for key, design in designs.items()
        },
        "scores": {name: dict(sorted(scores[name].items())) for name in sorted(scores)},
    }
    page_data.page_from("robust", from_data, **results)


def case(law, name):
    """Return the case of a design."""
    river = RIVERS["calm"] | {"seed": 1}
    data = {"control": {"law": law, "torque_limit": 700}, "limits": LIMITS}
    if name == "nominal":
        return load_case(data | {"inflow": river})
    flow = {"inflow": river, "realizations": SEEN, "name": "new"}
    return load_case(data | {"scenarios": [flow], "robustness": name})


def simulated(folder, file, river, state, count):
    """Return what a design does in unseen minutes, from a file if it has them.

    By minute: mean power (W), the largest excess of a limit as a share of it, which limit that is,
    whether one is broken, and whether the rotor stops.
    """
    solution = Solution.load(folder)
    design = {"digest": solution.summary.digest, "chord_m": solution.summary.chord_m}
    if file.exists():
        record = json.loads(file.read_text(encoding="utf-8"))
        if record.pop("design") == design and len(record["power_W"]) == count:
            return record
    changed = replace_turbine(solution, state)
    minutes = {name: [] for name in ("power_W", "excess", "limit", "broken", "stops")}
    for seed in range(FIRST_UNSEEN, FIRST_UNSEEN + count):
        flow = {"inflow": RIVERS[river] | {"seed": seed}, "control": "quadratic"}
        run = Run(changed, load_case(flow).inflow)
        shares = {n: x.share for n, x in run.extremes.items() if x.share is not None}
        worst = max(shares, key=shares.get)
        broken = [name for name, each in run.extremes.items() if each.kept is False]
        power = (run.energies["energy"] or 0.0) / run.simulation.time[-1]
        values = round(power, 3), round(shares[worst] - 1.0, 6), worst, bool(broken)
        for column, value in zip(minutes.values(), (*values, "rotor stops" in broken), strict=True):
            column.append(value)
    write_json(file, {"design": design, **minutes})
    return minutes


def replace_turbine(solution, state):
    """Return a finished design as it is in another state."""
    first = solution.by_scenario[0]
    base = {"inflow": "sine", "control": "quadratic", **STATES[state]}
    design = replace(first, case=first.case.of_turbine(None, load_case(base).condition)).design()
    plant = design.plant.tabulated(RATIOS)
    return replace(design, plant=plant, known=plant)


def interval(values, form="+.2f"):
    """Return the mean of some values with its interval by bootstrap, as text."""
    values = np.asarray(values, dtype=float)
    draws = np.random.default_rng(1).integers(0, values.size, (DRAWS, values.size))
    ends = np.percentile(np.mean(values[draws], axis=1), INTERVAL)
    mean, low, high = (f"{value:{form}}" for value in (np.mean(values), *ends))
    return f"{mean} [{low}, {high}]"


def from_data(data):
    """Return the page of its data."""
    parts = drawn(data["designs"]), unseen(data["scores"]), fouled(data["scores"])
    return HEAD + "\n".join(line for part in parts for line in part)


def drawn(designs):
    """Return the table of designs."""
    rows = []
    for name, design in designs.items():
        if design is None or not design["success"]:
            rows.append([*name.split("; "), "refused", "-", "-", "-"])
            continue
        summary = page_data.result_of(design).summary
        powers = [each.mean_power_W for each in summary.scenarios.values() if each.mean_power_W]
        limits = [limit_words(n) for n, each in summary.limits.items() if each.binding]
        cells = f"{np.mean(powers):.1f}", f"{np.min(powers):.1f}", f"{summary.inertia_kg_m2:.2f}"
        rows.append([*name.split("; "), *cells, ", ".join(limits) or "none"])
    header = ["law", "design", "mean power, W", "least, W", "inertia, kg m²", "binding"]
    words = "Designs in the minutes that they were made for. A power is that of a minute."
    return ["## Designs", "", words, "", *markdown_table(header, rows), ""]


def unseen(scores):
    """Return the tables of unseen minutes, one a river."""
    lines = ["## Minutes that no design has seen", ""]
    header = ["law", "design", "mean power, W", "over nominal, %", "minutes that break a limit, %"]
    header += ["largest excess, %", "rotor stops"]
    for river in RIVERS:
        rows = []
        for name, minutes in ((name, score[f"{river}, as new"]) for name, score in scores.items()):
            law, design = name.split("; ")
            nominal = np.array(scores[f"{law}; nominal"][f"{river}, as new"]["power_W"])
            power = np.array(minutes["power_W"])
            over = 100.0 * (power - nominal) / np.mean(nominal)
            excess, limit = max(zip(minutes["excess"], minutes["limit"], strict=True))
            most = f"{100.0 * excess:.1f} ({limit_words(limit)})"
            broken = interval(100.0 * np.array(minutes["broken"]), ".0f")
            cells = f"{np.mean(power):.1f}", "-" if design == "nominal" else interval(over)
            rows.append([law, design, *cells, broken, most, str(sum(minutes["stops"]))])
        count = f"The {river} river, {len(power)} minutes:"
        lines += [count, "", *markdown_table(header, rows), ""]
    return lines


def fouled(scores):
    """Return the table of fouled sections, over the same minutes as new."""
    rows = []
    for name, score in scores.items():
        cells = []
        for river in RIVERS:
            new, worn = (score[f"{river}, {state}"] for state in STATES)
            before, power = (np.array(minutes["power_W"]) for minutes in (new, worn))
            cells += [f"{np.mean(power):.1f}", interval(100.0 * (power - before) / np.mean(before))]
            cells.append(f"{100.0 * np.mean(worn['broken']):.0f}")
        rows.append([*name.split("; "), *cells])
    columns = ["mean power, W", "change, %", "minutes that break a limit, %"]
    header = ["law", "design", *(f"{river}: {x}" for river in RIVERS for x in columns)]
    words = (
        f"{FOULED['lift']:g} of the lift and {FOULED['drag']:g} of the drag. Change against the "
        "same minutes as new."
    )
    return ["## Fouled", "", textwrap.fill(words, 100), "", *markdown_table(header, rows), ""]


if __name__ == "__main__":
    main()
