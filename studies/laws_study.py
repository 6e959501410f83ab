"""How close each feedback law comes to open loop: runs the study, and writes docs/studies/laws.md.

python studies/laws_study.py --out results/laws --table docs/studies/laws.md

Finished results are used again. An hour on a core for each flow; --flows, --limits take a part.
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
from study_common import markdown_table, percent, run_nested, with_blade

from hkt_mdo.case import load_case
from hkt_mdo.problem.evaluation import loads_along, scalars
from hkt_mdo.results import style
from hkt_mdo.results.folder import write_json
from hkt_mdo.results.panel import COLORS
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.engine import in_processes
from hkt_mdo.studies.uncertainty import Sensor, noisy_runs

LAWS = {
    "open loop": "law: open_loop",
    "linear": "law: linear",
    "quadratic": "law: quadratic",
    "power law": "law: power_law",
    "rated": "law: rated",
    "curve, 4 knots": "law: curve, knots: 4",
    "curve, 6 knots": "law: curve, knots: 6",
    "curve, 8 knots": "law: curve, knots: 8",
    "tracking": "law: tracking",
}
POWER = "power: 5 kW"
EXTRA = "rotor_speed: 11 rad/s, stress: 100 MPa, cavitation: {depth: 3}"
LIMITS = {  # control.torque_limit, limits
    "none": ("null", ""),
    "700 N m": ("700", ""),
    "and 5 kW": ("700", POWER),
    "and 6.5 kN": ("700", f"{POWER}, thrust: 6.5 kN"),
    "all": ("700", f"{POWER}, thrust: 6.5 kN, {EXTRA}"),
}
TURBULENCE = "profile: turbulence, length_scale: 4, cutoff: 0.5, duration: 60"
FLOWS = {
    "sine": "profile: sine",
    "step": "profile: step",
    "gust": "profile: gust, shape: mexican_hat, amplitude: 0.5",
    "turbulence 5 %": f"{TURBULENCE}, intensity: 0.05",
    "turbulence 10 %": f"{TURBULENCE}, intensity: 0.1",
    "turbulence 15 %": f"{TURBULENCE}, intensity: 0.15",
}
BLADES = "designed", "kept"
UNSEEN = "turbulence 10 %"
SENSOR = Sensor(cutoff=None, snr=50.0, reference="total")
CHANGES = "density", "polar", "inertia"
TRACKING, ESTIMATED = "tracking", "tracking, flow estimated"
OPEN = "open loop", "designed"
NEAR, LEAST = 0.1, 5e-4  # per cent of open loop's energy: a line of the figure, and its lower end
NEARLY = 1e-4  # share of an energy below which two are the same
IMAGE = "../images/laws.png"

HEAD = """\
# How close does each feedback law come to open loop?

Written by `python studies/laws_study.py`: the paper's rotor on 40 stations, blade and law designed
together (*designed*), or the law alone with the blade of open loop under the same limits (*kept*).
Every energy is the captured energy of the integration with direct BEM, over an open cycle, compared
with open loop in the same flow under the same limits. 'Refused' marks a run that its checks
refused. Flows and limits that are not in the tables were not run: `--flows` and `--limits` choose
what is, and a flow takes about an hour.

Induction is quasi-steady in this program, while a wake needs seconds. With memory, laws that hold
the torque or the power constant let a light rotor run away; laws that rise with the speed do not
([memory.md](memory.md)). Every result has a line that says whether its loop is stable with memory.
The designs and energies of this page are those of induction in equilibrium.
"""


def main():
    """Run everything that has no result yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/laws"))
    parser.add_argument("--table", type=Path, default=Path("docs/studies/laws.md"))
    parser.add_argument("--jobs", type=int, default=None, help="processes (default: one a core)")
    parser.add_argument("--seeds", type=int, default=19, help="flows that no design has seen")
    parser.add_argument("--flows", nargs="*", default=list(FLOWS), choices=FLOWS)
    parser.add_argument("--limits", nargs="*", default=list(LIMITS), choices=LIMITS)
    parser.add_argument(
        "--skip",
        nargs="*",
        default=[],
        help="left out: FLOW/LIMITS; of kept blades FLOW/LIMITS/LAW",
    )
    parser.add_argument(
        "--kept", nargs="*", default=list(FLOWS), choices=FLOWS, help="flows with open loop's blade"
    )
    arguments = parser.parse_args()
    out = arguments.out

    def run(plan):
        cases = {out / "/".join(key).replace(" ", "_"): case for key, case in plan.items()}
        found = run_nested(cases, arguments.jobs, partial(print, flush=True))
        return dict(zip(plan, found.values(), strict=True))

    pairs = product(arguments.flows, arguments.limits)
    part = [pair for pair in pairs if "/".join(pair) not in arguments.skip]
    plan = {key: case(*key) for key in ((*each, law) for each in part for law in laws(each[1]))}
    found = {(*key, "designed"): each for key, each in run(plan).items()}
    kept = {}
    for (flow, limit, law), each in plan.items():
        best = found[flow, limit, "open loop", "designed"]
        asked = law != "open loop" and flow in arguments.kept
        asked &= f"{flow}/{limit}/{law}" not in arguments.skip
        if asked and best is not None and best.success:
            blade = best.summary.chord_m, best.summary.twist_deg
            kept[flow, limit, law, "kept"] = with_blade(each, *blade, "fixed")
    found |= run(kept)
    runs = unseen(found, arguments.seeds, arguments.jobs)
    figure(found, arguments.table.parent / IMAGE)
    arguments.table.write_text(page(found, runs), encoding="utf-8")
    print(f"wrote {arguments.table}")


def laws(limit):
    """Return the laws that are run under some limits; constant power needs a limit of the power."""
    return [law for law in LAWS if law != "rated" or POWER in LIMITS[limit][1]]


def case(flow, limit, law):
    """Return the case of a law under limits in a flow."""
    torque, limits = LIMITS[limit]
    data = f"inflow={{{FLOWS[flow]}}}", f"control={{{LAWS[law]}, torque_limit: {torque}}}"
    resolved = "rotor.station_count=40"  # the default with limits, here without them too
    return load_case({}, [*data, f"limits={{{limits}}}", resolved])


# Flows that a design has not seen ---------------------------------------------------------------


def unseen(found, count, jobs):
    """Return what each verified design in turbulence does in other seeds, and with changes."""
    tasks, runs, paths = {}, {}, {}
    for (flow, limit, law, blade), solution in found.items():
        limited = POWER in LIMITS[limit][1]
        asked = flow == UNSEEN and limited and law != "open loop" and blade == "designed"
        if not (asked and good(solution)):
            continue
        for each in (law, ESTIMATED) if law == TRACKING else (law,):
            key, estimated = (flow, limit, each, blade), each == ESTIMATED
            name = "unseen_estimated.json" if estimated else "unseen.json"
            paths[key] = solution.folder / name
            try:
                runs[key] = json.loads(paths[key].read_text(encoding="utf-8"))
            except (OSError, ValueError):
                runs[key] = {}
            if runs[key].get("seeds") != count:
                tasks[key] = partial(simulated, solution.folder, count, estimated)

    def ended(key, future):
        runs[key] = future.result()
        write_json(paths[key], runs[key])
        print("unseen:", *key, flush=True)

    in_processes(tasks.items(), jobs, ended)
    return runs


def simulated(folder, count, estimated=False):
    """Return energies and the limits' excess of one design in flows that it has not seen."""
    design = Solution.load(folder).design()
    if estimated:  # the design is the same as with a sensor
        law = design.law.model_copy(update={"flow": "estimated"})
        design = replace(design, physics=replace(design.physics, law=law))
    inflow = design.physics.inflow
    seeds = range(inflow.seed + 1, inflow.seed + 1 + count)
    flows = [inflow.model_copy(update={"seed": seed}) for seed in seeds]
    quiet = [design.simulate(flow) for flow in flows]
    noisy = [
        noisy_runs(design, flow, SENSOR, 1, seed) for seed, flow in zip(seeds, flows, strict=True)
    ]
    shares, excess = zip(*(exceeded(design, each) for each in (*quiet, *noisy)), strict=True)
    own = design.simulate(inflow)
    changed = {
        f"{name} {100.0 * (factor - 1.0):+.0f} %": altered(design, name, factor).simulate(inflow)
        for name, factor in product(CHANGES, (0.9, 1.1))
    }
    n = len(flows)
    return {
        "seeds": n,
        "energy_J": [each.energy for each in quiet],
        "noisy_energy_J": [float(each.energy[0]) for each in noisy],
        "stopped": sum(each.stopped_at is not None for each in quiet),
        "noisy_stopped": sum(each.stalled for each in noisy),
        "share_of_time": [float(np.mean(shares[:n])), float(np.mean(shares[n:]))],
        "excess": [float(np.max(excess[:n])), float(np.max(excess[n:]))],
        "changed": {
            name: None if each.stopped_at else each.energy / own.energy - 1.0
            for name, each in changed.items()
        },
    }


def exceeded(design, run):
    """Return the share of time in which a limit is exceeded by 0.1 %, and by how much at most."""
    physics, blade = design.physics, design.plant.blade
    known = scalars(physics, physics.rotor, blade)
    known |= {
        "inertia": design.plant.inertia,
        "time": run.time,
        "inflow_speed": run.inflow_speed,
        "rotor_speed": run.rotor_speed,
        "control_torque": run.control_torque,
        "hydrodynamic_torque": run.hydrodynamic_torque,
        "tip_speed_ratio": run.rotor_speed * blade.rotor_radius / run.inflow_speed,
        "generator_power": run.control_torque * run.rotor_speed,
    }
    known |= loads_along(physics.rotor, blade, known, physics.load_names)
    over = [each.excess(known) for each in physics.all_limits if each.caps_series]
    over = np.max(over, axis=0)
    return float(np.mean(over > 1e-3)), float(np.max(over))


def altered(design, name, factor):
    """Return a design whose plant has another density, polar (its lift) or inertia."""
    plant = design.plant
    if name == "density":
        plant = replace(plant, density=factor * plant.density)
    elif name == "inertia":
        plant = replace(plant, inertia=factor * plant.inertia)
    else:
        scaled = plant.polar.coefficients * np.repeat([factor, 1.0], 4)  # lift, drag
        plant = replace(plant, polar=replace(plant.polar, coefficients=scaled))
    return replace(design, plant=plant)


# The page ----------------------------------------------------------------------------------------


def page(found, runs):
    """Return the page for the solutions, and the runs in other flows, by their keys."""
    parts = [HEAD, *turbulence(found), *answer(found, runs)]
    parts += [f"![energy below open loop]({IMAGE})", "", *false_optima(found)]
    for flow in dict.fromkeys(key[0] for key in found):
        parts += table(found, flow)
        parts += delivered(found) if flow == "sine" else []
    return "\n".join([*parts, *blades(found), *seeds(runs), *robustness(runs)])


def turbulence(found):
    """Return what the turbulent flows are, with the intensities that are left of their names'."""
    known = []
    for flow in dict.fromkeys(key[0] for key in found if key[0].startswith("turbulence")):
        inflow = case(flow, "none", "open loop").inflow
        speed = inflow.speed_at(np.linspace(0.0, inflow.length, 6001)[:-1])
        share = f"{100.0 * np.std(speed) / np.mean(speed):.1f} %"
        known.append(f"{flow.removeprefix('turbulence ')} has {share}")
    words = (
        "Turbulence has von Kármán's spectrum with a mean of 1.5 m/s, a length scale of 4 m and "
        "frequencies up to 0.5 Hz, and lasts a minute. It is named by the intensity of the whole "
        "spectrum; frequencies below one a minute and above the cutoff are missing, so the flow "
        f"named {', '.join(known)}."
    )
    return [textwrap.fill(words, 100), ""] if known else []


def nested(found):
    """Return what a law reaches under more limits, where that is more than its result under fewer.

    By flow, limits and law: the result's energy, J, None where it was refused, then the largest
    energy under more limits, and these.
    """
    better = {}
    for flow, limit, law, blade in found:
        if blade != "designed":
            continue
        own = energy(found, (flow, limit, law, blade))
        others = {
            more: energy(found, (flow, more, law, blade))
            for more in list(LIMITS)[list(LIMITS).index(limit) + 1 :]
        }
        others = {more: value for more, value in others.items() if value is not None}
        most = (1.0 - NEARLY) * max(others.values(), default=0.0)
        if others and (own is None or own < most):
            more = next(more for more in reversed(others) if others[more] >= most)
            better[flow, limit, law] = own, others[more], more
    return better


def under(limit):
    """Return limits as a sentence has them."""
    return "under all limits" if limit == "all" else f"with {limit.removeprefix('and ')}"


def false_optima(found):
    """Return which results are not the best of their law, by its results under more limits."""
    rows = []
    for (flow, limit, law), (own, most, more) in nested(found).items():
        value = "refused" if own is None else f"{own / 1e3:.2f}"
        rows.append([flow, law, under(limit), value, f"{most / 1e3:.2f}", under(more)])
    words = (
        "A design that keeps several limits is also allowed where only some of them apply. So if a "
        "law captures more under more limits, its result under fewer limits is only a local "
        "optimum; if that run was refused, at least the energy under more limits is possible. "
        "The other tables and the figure show the results as the runs gave them."
    )
    header = ["flow", "law", "limits", "energy, kJ", "possible, kJ", "by the result"]
    body = textwrap.fill(words, 100), "", *markdown_table(header, rows), ""
    return ["## Results that are not the best of their law", "", *body] if rows else []


def delivered(found):
    """Return what open loop and the laws nearest to it deliver in the sine under all limits."""
    nearest = "open loop", "rated", "curve, 6 knots"
    runs = [found.get(("sine", "all", law, "designed")) for law in nearest]
    if not all(map(good, runs)):
        return []
    told = [f"{each.summary.generator_energy_J / 1e3:.2f} kJ" for each in runs]
    captured = f"{runs[0].summary.simulated_energy_J / 1e3:.2f} kJ"
    words = (
        "These are captured energies over open cycles, so part of the differences is energy stored "
        f"in the rotors. Under all limits open loop captures {captured} and delivers {told[0]} to "
        f"the generator; rated delivers {told[1]}, and a curve of 6 knots {told[2]}. Compared by "
        "delivered energy the three are close too."
    )
    return [textwrap.fill(words, 100), ""]


def good(solution):
    """Tell whether a run is verified."""
    return solution is not None and solution.success


def energy(found, key):
    """Return the energy of a verified run, J, or None."""
    return found[key].summary.simulated_energy_J if good(found.get(key)) else None


def below(found, flow, limit, law, blade="designed"):
    """Return by how much a law's energy exceeds that of open loop, %; None without one of both."""
    reference = energy(found, (flow, limit, "open loop", "designed"))
    return percent(energy(found, (flow, limit, law, blade)), reference)


def asked(found, flow=None):
    """Return the limits that were run, in a flow."""
    keys = {key[1] for key in found if flow in (None, key[0])}
    return [limit for limit in LIMITS if limit in keys]


def cell(found, flow, limit, law, blade):
    """Return what a law loses, or why nothing is known."""
    key = flow, limit, law, blade
    if key not in found:
        return "-"
    if not good(found[key]):
        return "refused"
    value = below(found, *key)
    return "no open loop" if value is None else f"{value:+.3f}"


def table(found, flow):
    """Return the table of a flow: energies of open loop, and what each law has more, %."""
    limits = asked(found, flow)
    first = ["open loop, kJ"]
    for limit in limits:
        value = energy(found, (flow, limit, "open loop", "designed"))
        first.append("refused" if value is None else f"{value / 1e3:.2f}")
    rows = [first]
    for law in list(LAWS)[1:]:
        cells = (
            " / ".join(cell(found, flow, limit, law, blade) for blade in BLADES) for limit in limits
        )
        rows.append([law, *cells])
    words = (
        "Energy difference from open loop, %: blade designed with the law / open loop's blade kept."
    )
    return [
        f"## {flow[0].upper()}{flow[1:]}",
        "",
        words,
        "",
        *markdown_table(["", *limits], rows),
        "",
    ]


def blades(found):
    """Return the blade that each law ends with, in the sine."""
    flow, rows = "sine", []
    limits = [limit for limit in asked(found, flow) if POWER in LIMITS[limit][1]]
    for limit, law in product(limits[:1], LAWS):
        solution = found.get((flow, limit, law, "designed"))
        if good(solution):
            summary = solution.summary
            ratio = summary.tip_speed_ratio
            worst = summary.loads["thrust"].value / 1e3
            cells = f"{ratio.mean:.2f}", f"{ratio.max:.2f}", blade_area(solution), f"{worst:.2f}"
            rows.append([law, *cells, f"{summary.power_coefficient_max:.4f}"])
    header = ["law", "mean tip speed ratio", "largest", "blade area, 10⁻³ m²", "thrust, kN"]
    title = ["## The blade of each law", "", "In the sine with 700 N m and 5 kW.", ""]
    return [*title, *markdown_table([*header, "largest C_P"], rows), ""] if rows else []


def seeds(runs):
    """Return what designs do in turbulence that they have not seen."""
    rows = []
    for (_, limit, law, _), each in runs.items():
        time = (f"{100.0 * share:.2f}" for share in each["share_of_time"])
        size = (f"{100.0 * max(over, 0.0):.1f}" for over in each["excess"])
        pairs = zip(each["noisy_energy_J"], each["energy_J"], strict=True)
        pairs = np.array([pair for pair in pairs if pair[0] is not None and pair[0] > 0.0])
        noise = "-"
        if pairs.size:  # of the seeds in which the noisy rotor turns to the end
            noise = f"{percent(*pairs.sum(axis=0)):+.2f}"
        stops = f"{each['stopped']} / {each['noisy_stopped']}"
        rows.append([limit, law, " / ".join(time), " / ".join(size), noise, stops])
    if not rows:
        return []
    words = (
        "Each design made in turbulence of 10 % was simulated in "
        f"{max(each['seeds'] for each in runs.values())} other seeds, with a perfect sensor "
        f"(quiet) and with one whose noise is {SENSOR.snr:g} dB below the signal, at "
        f"{SENSOR.rate:g} Hz and without a filter (noisy). The table has the share of time in "
        "which a limit is exceeded by more than 0.1 %, the largest excess, the change of the "
        "energy by the noise, and how many runs stall."
    )
    header = ["limits", "law", "time, % quiet / noisy", "excess, %", "noise, %", "stalled"]
    body = textwrap.fill(words, 100), "", *markdown_table(header, rows), ""
    return ["## Flows that the design has not seen", "", *body]


def robustness(runs):
    """Return what ten per cent of density, lift and inertia do to the energy."""
    rows, header = [], ["limits", "law"]
    for (_, limit, law, _), each in runs.items():
        header = ["limits", "law", *each["changed"]]
        cells = ("stalls" if x is None else f"{100.0 * x:+.2f}" for x in each["changed"].values())
        rows.append([limit, law, *cells])
    if not rows:
        return []
    words = "Change of the energy in the design's own flow, %, by other density, lift or inertia:"
    return ["## Robustness", "", words, "", *markdown_table(header, rows), ""]


def answer(found, runs):
    """Return the answer in a few sentences, then how many runs it rests on."""
    pairs = list(dict.fromkeys(key[:2] for key in found))
    free = [pair for pair in pairs if POWER not in LIMITS[pair[1]][1]]
    slow = [pair for pair in pairs if pair not in free and underspeed(found.get((*pair, *OPEN)))]
    fast = [pair for pair in pairs if pair not in (*free, *slow)]

    def losses(law, pairs, blade="designed"):
        """Return what a law loses, %, and the flow and the limits, the least first."""
        values = [(below(found, *pair, law, blade), *pair) for pair in pairs]
        return sorted((max(-value, 0.0), *where) for value, *where in values if value is not None)

    def most(law, pairs, blade="designed"):
        values = losses(law, pairs, blade)
        return f"{values[-1][0]:.2g} %" if values else "no result"

    area = {law: blade_area(found.get(("sine", "and 5 kW", law, "designed"))) for law in LAWS}
    static = [law for law in LAWS if law.startswith(("rated", "curve"))]
    limits = {limit for _, limit in fast} - {limit for _, limit in slow}
    of_limits = {
        limit: [pair for pair in fast if pair[1] == limit] for limit in LIMITS if limit in limits
    }
    several = ", ".join(
        f"{named(law)} loses "
        + " and ".join(
            f"{most(law, of_limits[each])} ({each.removeprefix('and ')})" for each in of_limits
        )
        for law in static
    )
    doubtful = doubts(found, fast)
    sentences = [
        "Under a limit of the power, choose a law that changes to constant power by overspeed. "
        f"Largest losses against open loop: {several}; tracking, because of its lag, loses up to "
        f"{most(TRACKING, fast)}, quadratic feedback {most('quadratic', fast)} and linear "
        f"feedback {most('linear', fast)}{' (but see the next paragraph)' if doubtful else ''}.",
        f"Without such a limit quadratic feedback loses at most {most('quadratic', free)} and "
        f"linear feedback {most('linear', free)}.",
        "Laws close to open loop end with nearly its blade (in the sine with 5 kW an area of "
        f"{area['rated']}·10⁻³ m² for rated, {area[OPEN[0]]} for open loop). With open loop's "
        f"blade kept, rated loses at most {most('rated', fast, 'kept')} and quadratic feedback "
        f"{most('quadratic', fast, 'kept')}; designed with quadratic feedback, the blade is wide "
        f"and slow, with an area of {area['quadratic']}·10⁻³ m².",
    ]
    least = [losses(law, slow)[0][0] for law in static if losses(law, slow)]
    tracked = [each[0] for each in losses(TRACKING, slow)]
    if least and tracked:
        sentences.append(
            "Static laws lose most where open loop slows the rotor to keep a limit (underspeed), "
            "as it does with 5 kW and a limit on the thrust: no law of the speed alone is stable "
            "there (with induction in equilibrium), "
            f"and each loses {min(least):.2g} % or more, tracking at most {tracked[-1]:.2g} %."
        )
    sentences.append(breaking(runs))

    def refused(blade, place, word):
        """Return how many runs with a blade were refused, by the law or the limits."""
        runs = [key[place] for key in found if key[3] == blade and not good(found[key])]
        counts = {each: runs.count(each) for each in dict.fromkeys(runs)}
        words = (f"{n} {word} {each.removeprefix('and ')}" for each, n in counts.items())
        return ", ".join(words) or "none"

    runs = (
        f"{sum(map(good, found.values()))} of {len(found)} runs are verified. Refused with the "
        f"blade designed: {refused('designed', 2, 'of')}. Refused with the blade of open loop: "
        f"{refused('kept', 1, 'under')}; with this blade open loop keeps the limits, these laws "
        "do not."
    )
    texts = filter(None, (" ".join(filter(None, sentences)), doubtful, runs))
    wrapped = (textwrap.fill(text, 100, break_on_hyphens=False) for text in texts)
    return [line for text in wrapped for line in (text, "")]


def doubts(found, pairs):
    """Return a sentence on losses of linear and quadratic feedback that are not the laws' own."""
    known = nested(found)
    words = []
    for law, (flow, limit) in product(("quadratic", "linear"), pairs):
        if (flow, limit, law) in known:
            own, most, more = known[flow, limit, law]
            first = "refused" if own is None else f"{own / 1e3:.2f} kJ"
            then = f"{under(more)} it captures {most / 1e3:.2f} kJ"
            words.append(f"{law} feedback {under(limit)}, {flow}: {first}, although {then}")
    if not words:
        return ""
    listed = "; ".join(words)
    return (
        "The losses of quadratic and linear feedback under a limit of the power do not measure "
        "these laws: only verified runs count, and some of these are local optima, since the same "
        "law captures more under more limits. "
        f"{listed[:1].upper()}{listed[1:]} ([all such results]"
        "(#results-that-are-not-the-best-of-their-law))."
    )


def named(law):
    """Return a law's name as a sentence has it."""
    return law.replace("curve, ", "a curve of ")


def underspeed(solution):
    """Tell whether a verified run keeps its limit of the power by turning slower."""
    if not good(solution) or not solution.summary.limits["power"].binding:
        return False
    return any(each.taken and each.name == "underspeed" for each in solution.summary.branches)


def breaking(runs):
    """Return a sentence on flows that no design has seen."""
    if not runs:
        return ""
    stalls, runs_of_law = {}, {}
    for (_, _, law, _), each in runs.items():
        stalls[law] = stalls.get(law, 0) + each["stopped"]
        runs_of_law[law] = runs_of_law.get(law, 0) + each["seeds"]
    lag = [each["excess"][0] for key, each in runs.items() if key[2] == TRACKING]
    told = TRACKING, ESTIMATED
    static = [each["excess"] for key, each in runs.items() if key[2] not in told]
    quiet, noisy = (100.0 * max(0.0, *ends) for ends in zip(*static, strict=True))
    fell = " and in ".join(
        f"{count} of {runs_of_law[law]} simulations of {named(law)}"
        for law, count in stalls.items()
        if count
    )
    count = max(each["seeds"] for each in runs.values())
    kept = f"exceed limits by up to {quiet:.1f} %"
    if quiet < 0.05:
        kept = "keep every limit"
    return (
        f"In {count} other seeds of the turbulence (10 %) static laws {kept}; with a noisy sensor "
        f"they exceed one by {noisy:.1f} %. Tracking exceeds one by "
        f"{100.0 * max(lag, default=0.0):.0f} %."
        + (f" The rotor stalls in {fell}." if fell else "")
    )


def blade_area(solution):
    """Return the area of a blade of a verified run, 10⁻³ m², as text."""
    if not good(solution):
        return "-"
    summary = solution.summary
    return f"{1e3 * np.trapezoid(summary.chord_m, summary.r_m):.1f}"


TITLES = {
    "none": "No limit",
    "700 N m": "700 N m of generator torque",
    "and 5 kW": "700 N m and 5 kW",
    "and 6.5 kN": "700 N m, 5 kW and 6.5 kN of thrust",
    "all": "All: 700 N m, 5 kW, 6.5 kN, 11 rad/s, 100 MPa, no cavitation at 3 m",
}
FOOT = f"\u00d7: refused by its checks; the shortest bars: less than {LEAST:g} %"


def panel(ax, found, limit, foot=""):
    """Draw what each law loses in each flow under some limits."""
    asked, flows = laws(limit)[1:], list(dict.fromkeys(key[0] for key in found))
    place, width = np.arange(len(asked)), 0.8 / len(flows)
    for i, flow in enumerate(flows):
        lost = [below(found, flow, limit, law) for law in asked]
        lost = np.array([np.nan if each is None else max(-each, 1.3 * LEAST) for each in lost])
        look = {"color": COLORS[i], "hatch": style.HATCHES[i], "edgecolor": "white"}
        left = place + (i + 0.5 - 0.5 * len(flows)) * width
        ax.bar(left, lost, 0.9 * width, label=flow, **look)
        known = [(flow, limit, law, "designed") in found for law in asked]
        refused = left[np.isnan(lost) & known]
        mark = {"marker": "x", "linestyle": "none", "markersize": 5, "color": look["color"]}
        ax.plot(refused, np.full(refused.size, 1.6 * LEAST), **mark)
    ax.set_yscale("log")
    ax.set_ylim(bottom=LEAST)
    ax.yaxis.set_major_formatter("{x:g}")
    ax.axhline(NEAR, label=f"{NEAR:g} %: as good as open loop", **style.REFERENCE)
    ax.set_title(TITLES[limit], fontsize=style.FONT_SIZE + 1, loc="left", fontweight="bold")
    style.finish(ax, foot, "energy below\nopen loop (%)")
    ax.set_xticks(place, [law.replace(", ", ",\n") for law in asked])
    return ax


def figure(found, path):
    """Draw what each law loses, one panel for each set of limits."""
    limits = asked(found)
    feet = [""] * (len(limits) - 1) + [FOOT]
    plots = [
        partial(panel, found=found, limit=limit, foot=foot)
        for limit, foot in zip(limits, feet, strict=True)
    ]
    drawn = style.figure_of(7.5, 1.0 + 2.3 * len(plots), plots, share=0)
    style.save({path.stem: drawn}, path.parent)


if __name__ == "__main__":
    main()
    page_data.record("laws")
