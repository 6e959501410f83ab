"""What a design for many flows gains over one for a single flow: runs the study, writes its page.

python studies/robust_study.py --out results/robust --table docs/studies/robust.md

Designs and scores that a folder has are used again. About two hours on one core; --laws, --flows
and --ceilings take a part. The page is written from docs/data/robust.json, without any run also by
`python studies/page_data.py --write robust`.
"""

import argparse
import json
import os
import textwrap
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
import page_data
from study_common import markdown_table, with_blade

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import complete, physics
from hkt_mdo.results.folder import write_json
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import limit_words
from hkt_mdo.run.run import run_case
from hkt_mdo.studies.other_flows import Run

LAWS = "quadratic", "rated"
# Under Gauss-Lobatto these optimizations need hundreds of iterations once their mesh is refined
RADAU = {"segments": 320, "transcription": "radau"}
LOBATTO = {("quadratic", "expected"), ("quadratic", "CVaR")}
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
SEEDS = 10  # of the calm river, which designs see
FIRST_UNSEEN = 1001
SHOWN = "scenarios", "limits", "inertia_kg_m2", "wall_seconds"  # of the summaries, on the page
WORN = {"lift": 0.9, "drag": 1.5}
DENSE = 1025.0
MEASURES = {
    "nominal": None,
    "expected": "expected",
    "CVaR": {"measure": "cvar", "share": 0.2},
    "worst": "worst",
    "expected, clean and fouled": "expected",
}
STATES = {"as new": {}, "fouled": {"condition": WORN}, "sea water": {"density": DENSE}}
RATIOS = np.linspace(0.05, 25.0, 2500)  # tip speed ratios of the torque in unseen minutes
DRAWS, INTERVAL = 10_000, (2.5, 97.5)  # of the bootstrap; per cent

HEAD = """\
# One design for many flows

One blade and one controller can be designed for many flows; water and condition of the turbine may
differ between them. `hkt show` lists the energy and the limits of each flow, and which flows decide
the objective ([cases.md](../cases.md#scenarios)):

```yaml
control: {law: quadratic, torque_limit: 700}
scenarios:
  - {name: river, inflow: {profile: turbulence, seed: 1}, weight: 0.9, realizations: 10}
  - {name: fouled, inflow: sine, weight: 0.1, condition: {lift: 0.9, drag: 1.5}}
  - {name: flood, inflow: {profile: sine, mean: 2.2}, weight: 0, limits: {power: 6 kW}}
robustness: {measure: cvar, share: 0.2}
```

This page shows in an example what such a design gains.

## The example

Written by `python studies/robust_study.py`: the paper's rotor on 40 stations with 700 N m, 5 kW,
6.5 kN, 11 rad/s, 100 MPa and no cavitation at 3 m; blade and law are designed together. *Nominal*
is designed in one minute of turbulence (seed 1), the others in ten minutes (seeds 1 to 10) of the
calm river: for their mean power (*expected*), for the mean of the worst fifth (*CVaR*) and for the
worst of them (*worst*), each minute's mean power over its ceiling
([equations.md](../dev/equations.md#several-flows)). One more counts every minute twice, as new and
with fouled sections, which have 0.9 times the lift and 1.5 times the drag.

The *calm* river is von Karman's turbulence, 1.5 m/s, 10 %; the *rough* one Kaimal's, 1.4 m/s, 16 %;
both of 4 m, up to 0.5 Hz, with random amplitudes. Every design is simulated in other, *unseen*,
minutes: its torque from a curve of 2500 tip speed ratios by BEM, its loads by direct BEM. A
minute breaks a limit where the simulation exceeds it by more than a run allows between its nodes.
Brackets are 95 % intervals by bootstrap over the minutes. A design that breaks its limits may
capture more, so compare powers only together with the share of minutes in which a limit is broken.
"""


def main():
    """Run what has no result yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/robust"))
    parser.add_argument("--table", type=Path, default=Path("docs/studies/robust.md"))
    parser.add_argument("--laws", nargs="*", default=list(LAWS), choices=LAWS)
    parser.add_argument("--designs", nargs="*", default=list(MEASURES), choices=MEASURES)
    parser.add_argument("--flows", type=int, default=100, help="unseen minutes of each river")
    parser.add_argument("--changed", type=int, default=10, help="of them, fouled and in sea water")
    parser.add_argument(
        "--ceilings", type=int, default=3, help="of them, open loop optimized again"
    )
    parser.add_argument("--finished", action="store_true", help="only designs that are there")
    given = parser.parse_args()
    designs = {}
    for law, name in product(given.laws, given.designs):
        folder = given.out / law / name.replace(", ", "_").replace(" ", "_")
        found = result(folder, case(law, name, given.out), run=not given.finished)
        if found is not None:
            designs[law, name] = found
    scores = {
        key: score(given.out / "scores", key, solution, given)
        for key, solution in designs.items()
        if solution.success
    }
    best = ceilings(designs, scores, given)
    data = data_of(designs, scores, best)
    page_data.write("robust", data)
    given.table.write_text(from_data(page_data.read("robust")), encoding="utf-8")
    print(f"wrote {given.table}")


def case(law, name, out):
    """Return the case of a design; those of other measures begin with that of the mean power."""
    river, measure = RIVERS["calm"], MEASURES[name]
    data = {"control": {"law": law, "torque_limit": 700}, "limits": LIMITS}
    if name not in ("nominal", "expected"):
        data["start"] = {"method": "blade", "from": str((out / law / "expected").absolute())}
    if measure is None:
        return load_case(data | {"inflow": river | {"seed": 1}})
    data["phase"] = {} if (law, name) in LOBATTO else RADAU
    many = {"inflow": river | {"seed": 1}, "realizations": SEEDS}
    flows = [many | {"name": "new"}]
    if "fouled" in name:
        flows.append(many | {"name": "fouled", "condition": WORN})
    return load_case(data | {"scenarios": flows, "robustness": measure})


def result(folder, case, run=True):
    """Return the result of a case, which is run unless the folder has it; None: it has not."""
    try:
        found = Solution.load(folder)
        same = found.case.model_copy(update={"start": case.start}) == complete(case)
        if same and found.summary.checks is not None:  # wherever it began
            return found
    except InputError:
        pass
    if not run:
        return None
    found = run_case(case, folder, force=True, figures=False, records=False)
    told = f"{found.summary.simulated_energy_J or np.nan:.6g} J", found.message
    print(folder, *told, f"{found.summary.wall_seconds:.0f} s", flush=True)
    return found


# Scores -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Score:
    """What a design does in one unseen minute.

    Attributes
    ----------
    energy : float
        Captured, J; 0 where the rotor stops.
    excess : dict of float
        By how much each limit is exceeded, relatively; negative where it is kept.
    broken : list of str
        Names of the limits that are not kept, and `rotor stops` if it does.
    """

    energy: float
    excess: dict[str, float]
    broken: list[str]


def score(folder, key, solution, given):
    """Return the scores of a design, by river and state, one a seed; those of a file are kept."""
    file = folder / f"{'_'.join(key).replace(', ', '_').replace(' ', '_')}.json"
    known = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    marked = np.array([*solution.summary.chord_m, solution.summary.energy_J]).tolist()
    if known.get("of") != marked:
        known = {"of": marked, "scores": {}}
    for river, state in product(RIVERS, STATES):
        own = known["scores"].setdefault(f"{river}, {state}", [])
        own_case = replace_turbine(solution, state)
        for number in range(len(own), given.flows if state == "as new" else given.changed):
            flow = flow_of(solution, river, FIRST_UNSEEN + number)
            own.append(vars(scored(own_case, flow)))
        folder.mkdir(parents=True, exist_ok=True)
        write_json(file, known)
    print(file.stem, flush=True)
    return {name: [Score(**each) for each in own] for name, own in known["scores"].items()}


def replace_turbine(solution, state):
    """Return a finished design as it is in another state."""
    first = solution.by_scenario[0]
    data = STATES[state]
    base = {"inflow": "sine", "control": "quadratic", "condition": data.get("condition", {})}
    case = first.case.of_turbine(data.get("density"), load_case(base).condition)
    design = replace(first, case=case).design()
    plant = design.plant.tabulated(RATIOS)
    return replace(design, plant=plant, known=plant)


def flow_of(solution, river, seed) -> Inflow:
    """Return an unseen minute of a river."""
    data = {"inflow": RIVERS[river] | {"seed": seed}, "control": "quadratic"}
    return load_case(data).inflow


def scored(design, flow) -> Score:
    """Return what a design does in a flow."""
    run = Run(design, flow)
    told = run.extremes
    excess = {name: each.share - 1.0 for name, each in told.items() if each.share is not None}
    broken = [name for name, each in told.items() if each.kept is False]
    return Score(run.energies["energy"] or 0.0, excess, broken)


def ceilings(designs, scores, given):
    """Return the energy of open loop on each blade in some unseen minutes, optimized again, J."""
    found = {}
    for (law, name), solution in designs.items():
        if not solution.success or name != "expected":
            continue
        for river, number in product(RIVERS, range(given.ceilings)):
            seed = FIRST_UNSEEN + number
            data = {"control": {"law": "open_loop", "torque_limit": 700}, "limits": LIMITS}
            data["inflow"] = RIVERS[river] | {"seed": seed}
            blade = solution.summary.chord_m, solution.summary.twist_deg
            folder = given.out / "open_loop" / f"{law}_{name}_{river}_{seed}"
            again = with_blade(load_case(data), *blade, "fixed")
            best = result(folder, again, run=not given.finished)
            own = scores[law, name][f"{river}, as new"][number]
            if best is not None and best.success and not own.broken:
                found.setdefault((law, name, river), []).append((own.energy, best.energy))
    return found


# Page ---------------------------------------------------------------------------------------------


def interval(values, of=np.mean):
    """Return a statistic of some values with its interval by bootstrap, as three numbers."""
    values = np.asarray(values, dtype=float)
    draws = np.random.default_rng(1).integers(0, values.size, (DRAWS, values.size))
    low, high = np.percentile(of(values[draws], axis=1), INTERVAL)
    return float(of(values, axis=0)), low, high


def bracketed(values, digits=2):
    """Return the mean of some values with its interval, as text."""
    found = (f"{each:+.{digits}f}" for each in interval(values))
    return "{} [{}, {}]".format(*found)


def data_of(designs, scores, best):
    """Return what the page shows of designs and scores, with what they were made by."""
    passed = {
        f"{river} {FIRST_UNSEEN + number}": passing(river, FIRST_UNSEEN + number)
        for river in RIVERS
        for number in range(max(len(own[f"{river}, as new"]) for own in scores.values()))
    }
    return {
        "commands": ["python studies/robust_study.py"],
        **page_data.stamp(),
        "passed_J": passed,
        "designs": {
            f"{law}; {name}": page_data.of_result(each, SHOWN)
            for (law, name), each in designs.items()
        },
        "scores": {
            "; ".join(key): {state: [*map(vars, each)] for state, each in own.items()}
            for key, own in scores.items()
        },
        "open_loop_J": {"; ".join(key): pairs for key, pairs in best.items()},
    }


def from_data(data):
    """Return the page of its data."""

    def keyed(name):
        return {tuple(key.split("; ")): each for key, each in data[name].items()}

    passed = {tuple(key.split()): each for key, each in data["passed_J"].items()}
    scores = {
        key: {state: [Score(**each) for each in own] for state, own in states.items()}
        for key, states in keyed("scores").items()
    }
    designs = {key: page_data.result_of(each) for key, each in keyed("designs").items()}
    return page(designs, scores, keyed("open_loop_J"), passed)


def page(designs, scores, best, passed):
    """Return the page."""
    parts = answer(scores, passed), drawn(designs), unseen(scores, passed)
    parts += changed(scores), open_loop(best)
    return "\n".join([HEAD, *(line for part in parts for line in part)])


def shares(scores, river, passed):
    """Return the captured share of the energy that passed the disc in each unseen minute."""
    mine = scores[f"{river}, as new"]
    known = [passed[river, str(FIRST_UNSEEN + number)] for number in range(len(mine))]
    return np.array([each.energy for each in mine]) / known


def passing(river, seed):
    """Return the energy of the water that passes the disc in a minute, J."""
    world = physics(load_case({"inflow": RIVERS[river] | {"seed": seed}, "control": "quadratic"}))
    scenario, radius = world.scenarios[0], world.blade.rotor_radius
    cubes = float(np.sum(scenario.inflow.cubes(scenario.edges)))
    return 0.5 * world.density * np.pi * radius**2 * cubes


def worst_fifth(values):
    """Return the mean of the smallest fifth of some values."""
    return float(np.mean(np.sort(values)[: max(len(values) // 5, 1)]))


def answer(scores, passed):
    """Return what the tables say, in a few sentences."""
    lines = []
    for law in dict.fromkeys(law for law, _ in scores):
        told = []
        for name in (name for own, name in scores if own == law):
            mine = scores[law, name]["calm, as new"]
            power = np.mean([each.energy for each in mine]) / 60.0
            broken = 100.0 * np.mean([bool(each.broken) for each in mine])
            fifth = 100.0 * worst_fifth(shares(scores[law, name], "calm", passed))
            told.append(
                f"{name} {power:.0f} W, {broken:.0f} % of minutes break a limit, worst fifth "
                f"{fifth:.2f} %"
            )
        lines += [textwrap.fill(f"- `{law}`: {'; '.join(told)}.", 100, subsequent_indent="  ")]
    words = (
        "Unseen minutes of the calm river: mean power, the share of minutes in which a limit is "
        "broken, and the share of the water's energy that is captured in the fifth of minutes "
        "where that is least."
    )
    return ["## In short", "", textwrap.fill(words, 100), "", *lines, ""]


def drawn(designs):
    """Return the table of designs."""
    rows = []
    for (law, name), solution in designs.items():
        summary = solution.summary
        if not solution.success:
            rows.append([law, name, "refused", *3 * ["-"], str(solution.message)[:80]])
            continue
        parts = summary.scenarios or {}
        powers = [each.mean_power_W for each in parts.values() if each.mean_power_W]
        limits = [limit_words(n) for n, each in summary.limits.items() if each.binding]
        cells = f"{np.mean(powers):.1f}", f"{np.min(powers):.1f}", f"{summary.inertia_kg_m2:.2f}"
        seconds = f"{summary.wall_seconds:.0f}"
        rows.append([law, name, *cells, ", ".join(limits) or "none", seconds])
    header = ["law", "design", "mean power, W", "least, W", "inertia, kg m²", "binding", "run, s"]
    words = (
        "Designs in the minutes that they were made for. A power is that of a minute; times are "
        "wall times, of some runs beside other work."
    )
    asked = (f"{law} {name}" for law, name in product(LAWS, MEASURES) if (law, name) not in designs)
    if missing := "; ".join(asked):
        words += f" Without a result so far are: {missing}."
    body = textwrap.fill(words, 100), "", *markdown_table(header, rows), ""
    return ["## Designs", "", *body]


def unseen(scores, passed):
    """Return the tables of unseen minutes, one a river."""
    lines = ["## Minutes that no design has seen", ""]
    for river in RIVERS:
        rows = []
        for (law, name), own in scores.items():
            mine = own[f"{river}, as new"]
            powers = np.array([each.energy for each in mine]) / 60.0
            gains = "-"
            if name != "nominal" and (law, "nominal") in scores:
                before = scores[law, "nominal"][f"{river}, as new"]
                other = np.array([each.energy for each in before]) / 60.0
                gains = bracketed(100.0 * (powers / np.mean(other) - other / np.mean(other)))
            fifth = f"{100.0 * worst_fifth(shares(own, river, passed)):.2f}"
            rows.append([law, name, f"{np.mean(powers):.1f}", gains, fifth, *violations(mine)])
        header = ["law", "design", "mean power, W", "over nominal, %", "worst fifth, %"]
        header += VIOLATIONS
        count = len(mine) if rows else 0
        words = f"The {river} river, {count} minutes:"
        lines += [words, "", *markdown_table(header, rows), ""]
    return lines


VIOLATIONS = "minutes that break a limit, %", "mean of the largest excess, %", "most", "rotor stops"


def violations(scores):
    """Return the cells of `VIOLATIONS`."""
    broken = [100.0 * bool(each.broken) for each in scores]
    over = [100.0 * max(0.0, *each.excess.values()) for each in scores]
    worst = max(scores, key=lambda each: max(each.excess.values()))
    name = limit_words(max(worst.excess, key=worst.excess.get))
    stops = sum("rotor stops" in each.broken for each in scores)
    share, low, high = interval(broken)
    most = f"{max(over):.1f} ({name})" if max(over) > 0.0 else "-"
    mean, least, largest = interval(over)
    told = f"{share:.0f} [{low:.0f}, {high:.0f}]", f"{mean:.2f} [{least:.2f}, {largest:.2f}]"
    return [*told, most, str(stops)]


def changed(scores):
    """Return the table of fouled sections and sea water, over the same minutes as new."""
    rows = []
    for (law, name), own in scores.items():
        for state in list(STATES)[1:]:
            cells = []
            for river in RIVERS:
                there = own[f"{river}, {state}"]
                new = own[f"{river}, as new"][: len(there)]
                power, before = (np.array([x.energy for x in each]) for each in (there, new))
                broken = 100.0 * np.mean([bool(each.broken) for each in there])
                change = bracketed(100.0 * (power - before) / np.mean(before)) if there else "-"
                cells += [f"{np.mean(power) / 60.0:.1f}", change, f"{broken:.0f}"]
            rows.append([law, name, state, *cells])
    each = ["mean power, W", "change, %", "minutes that break a limit, %"]
    header = ["law", "design", "state", *(f"{river}: {x}" for river in RIVERS for x in each)]
    words = (
        f"*Fouled*: {WORN['lift']:g} of the lift and {WORN['drag']:g} of the drag; *sea water*: "
        f"{DENSE:g} kg/m³. Change against the same minutes as new."
    )
    body = ["## Fouled, and in sea water", "", textwrap.fill(words, 100), ""]
    return [*body, *markdown_table(header, rows), ""]


def open_loop(best):
    """Return what open loop gains on the same blades, its operation optimized again."""
    rows = [
        [
            law,
            name,
            river,
            str(len(pairs)),
            f"{100.0 * (np.sum(pairs, axis=0)[1] / np.sum(pairs, axis=0)[0] - 1.0):+.2f}",
        ]
        for (law, name, river), pairs in best.items()
    ]
    if not rows:
        return []
    words = (
        "Open loop with the same blade and limits in unseen minutes, its operation optimized again "
        "in each: what any law could still gain there. Only minutes in which the law breaks no "
        "limit count."
    )
    header = ["law", "design", "river", "minutes", "open loop over the law, %"]
    return [
        "## The ceiling of operation",
        "",
        textwrap.fill(words, 100),
        "",
        *markdown_table(header, rows),
        "",
    ]


if __name__ == "__main__":
    main()
