"""What limits cost and buy: runs cases/limits and variations, writes docs/studies/limits.md.

python studies/limits_study.py --out results/limits --table docs/studies/limits.md

Finished results are used again. The page is written from docs/data/limits.json, without any run
also by `python studies/page_data.py --write limits`.
"""

import argparse
import textwrap
from functools import partial
from pathlib import Path

import numpy as np
import page_data
from study_common import NINE, markdown_table, percent, run_nested, with_blade
from study_plots import line

from hkt_mdo.case import load_case
from hkt_mdo.results import style
from hkt_mdo.results.words import measured

ROOT = Path(__file__).parent.parent
LIMITS = ("power", "rotor_speed", "thrust", "stress", "cavitation", "all")
LAWS = {"oloc": "open loop", "quadratic": "quadratic feedback"}
BRANCHES = ("overspeed", "underspeed")
BRANCHED = ("power", "rotor_speed")  # where both branches are optimized
FRONTS = {  # unit, and values by the names of their runs
    "thrust": ("kN", {f"{value:.2f}": value for value in np.linspace(3.5, 7.3, 16)}),
    "stress": ("MPa", {f"{value:.0f}": value for value in np.geomspace(30.0, 3000.0, 16)}),
}
SEQUENTIAL = ("power", "rotor_speed", "thrust")
LOSSES = "{rated_torque: 700, rated_speed: 7.5, copper_loss: 500, friction_loss: 50, iron_loss: 50}"
SATURATED = 100.0  # N m s²/rad²: a gain with which K₂ω² is beyond 700 N m at all useful speeds
LOADS = ("thrust", "root_moment", "stress", "cavitation")
IMAGE = "../images/limits_fronts.png"
SHOWN = (  # what the page shows of the summaries
    *("simulated_energy_J", "electrical_energy_J", "tip_speed_ratio", "tip_deflection_m", "gain"),
    *("mass_kg", "inertia_kg_m2", "loads", "limits", "branches"),
)

HEAD = """\
# What limits cost, and what they buy

Written by `python studies/limits_study.py`, from cases/limits and variations of them: the paper's
rotor in its sinusoidal flow with 700 N m, its blade on 40 stations. Each row is a complete
co-design of blade and controller. Each was integrated again with direct BEM, and each limit was
checked along that integration, between the nodes and on 120 stations. Energies are captured
energies of the integration.
"""


def main():
    """Run everything that has no result yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/limits"))
    parser.add_argument("--table", type=Path, default=Path("docs/studies/limits.md"))
    parser.add_argument("--jobs", type=int, default=None, help="processes (default: one a core)")
    parser.add_argument("--only", nargs="*", help="parts to run, then no page: names of folders")
    arguments = parser.parse_args()
    out = arguments.out

    def run(plan):
        cases = {out / name: case for name, case in plan.items()}
        return run_nested(cases, arguments.jobs, partial(print, flush=True))

    runs = {
        name: load_case(ROOT / "cases" / file, changes)
        for name, (file, changes) in plan().items()
        if not arguments.only or name.split("/")[0] in arguments.only
    }
    results = run(runs)
    if not arguments.only:
        results |= run(sequential(runs, results[out / "free" / "oloc"]))
        results = {path.relative_to(out).as_posix(): each for path, each in results.items()}
        fronts(results, arguments.table.parent / IMAGE)
        data = data_of(results)
        page_data.write("limits", data)
        arguments.table.write_text(from_data(data), encoding="utf-8")
        print(f"wrote {arguments.table}")


def plan():
    """Return file and overrides of every run that needs no other's result, by its folder."""
    resolved, nine = "rotor.station_count=40", f"rotor.stations={NINE}"
    runs = {f"free/{law}": (f"sine_limited_{law}.yaml", [resolved]) for law in LAWS}
    for limit in ("thrust", "stress", "cavitation", "all"):
        runs[f"nine/{limit}"] = f"limits/{limit}_oloc.yaml", [nine]
    for limit in LIMITS:
        for law in LAWS:
            runs[f"cases/{limit}_{law}"] = f"limits/{limit}_{law}.yaml", []
    for limit in BRANCHED:
        for branch in BRANCHES:
            name = f"branches/{limit}_{branch}"
            runs[name] = f"limits/{limit}_oloc.yaml", [f"start.branch={branch}"]
    runs["cases/rm1_turbulent"] = "limits/rm1_turbulent_limits.yaml", []
    for part, (unit, values) in FRONTS.items():
        for name, value in values.items():
            bound = f"limits.{part}={value:.4f} {unit}"
            runs[f"{part}/{name}"] = "sine_limited_oloc.yaml", [bound]
    for objective in ("captured", "electrical"):
        changes = [f"generator={LOSSES}", f"objective={objective}"]
        runs[f"losses/{objective}"] = "sine_oloc.yaml", changes
    return runs


def sequential(runs, free):
    """Return the cases that keep the blade designed without the limit."""
    blade = free.summary.chord_m, free.summary.twist_deg
    return {
        f"sequential/{limit}": with_blade(runs[f"cases/{limit}_oloc"], *blade, "fixed")
        for limit in SEQUENTIAL
    }


def data_of(solutions):
    """Return what the page shows of the solutions, with what they were made by."""
    shown = {name: each for name, each in solutions.items() if not name.startswith((*FRONTS,))}
    results = {name: page_data.of_result(each, SHOWN) for name, each in shown.items()}
    commands = ["python studies/limits_study.py"]
    return {"commands": commands, **page_data.stamp(), "results": results}


def from_data(data):
    """Return the page of its data."""
    return page({name: page_data.result_of(each) for name, each in data["results"].items()})


def page(results):
    """Return the page for the solutions by folder."""
    free = {law: energy(results[f"free/{law}"]) for law in LAWS}
    return "\n".join(
        [
            HEAD,
            *in_short(results, free),
            *optimum_without(results["free/oloc"]),
            *costs(results, free),
            *unresolved(results),
            *shadow_prices(results),
            "## Energy against thrust and stress",
            "",
            f"![Energy against thrust and stress]({IMAGE})",
            "",
            *branches_text(results),
            *sequential_text(results),
            *losses_text(results),
            *turbine(results["cases/rm1_turbulent"]),
        ]
    )


def in_short(results, free):
    """Yield the answers in a few sentences."""
    under = {key: energy(results[f"cases/{key}"]) for key in ("power_oloc", "power_quadratic")}
    alone = {
        limit: change(energy(results[f"cases/{limit}_oloc"]), free["oloc"], 1) for limit in LIMITS
    }
    gains = [
        change(energy(results[f"cases/{limit}_oloc"]), energy(results[f"sequential/{limit}"]))
        for limit in SEQUENTIAL
    ]
    electrical = [results[f"losses/{name}"].summary for name in ("captured", "electrical")]
    ratios = [f"{each.tip_speed_ratio.mean:.1f}" for each in electrical]
    delivered = change(*(each.electrical_energy_J for each in reversed(electrical)), 1)
    laws = change(under["power_quadratic"], under["power_oloc"], 1)
    stress = results["free/oloc"].summary.loads["stress"]
    others = change(energy(results["cases/all_oloc"]), energy(results["cases/stress_oloc"]), 1)
    for text in (
        f"- Change of the energy of open loop by each limit: 100 MPa {alone['stress']}, 6 kN of "
        f"thrust {alone['thrust']}, 9 rad/s {alone['rotor_speed']}, no cavitation at 3 m "
        f"{alone['cavitation']}, 5 kW {alone['power']}; all together {alone['all']}. The "
        f"reference is a blade with a stress of {measured(stress.value, stress.unit, 2)}, which no "
        f"material allows; relative to the blade that keeps 100 MPa, all limits together change "
        f"the energy by {others}.",
        f"- With 5 kW the energy of quadratic feedback differs from that of open loop by {laws}; "
        f"without this limit by {change(free['quadratic'], free['oloc'], 3)}.",
        f"- Co-design gains {gains[0]} (power), {gains[1]} (speed) and {gains[2]} (thrust) over a "
        "blade that was designed without the limit.",
        f"- With losses in the windings the best tip speed ratio rises from {ratios[0]} to "
        f"{ratios[1]}, and maximizing the delivered energy gains {delivered} of it.",
    ):
        yield textwrap.fill(text, 100, subsequent_indent="  ")
    yield ""


def energy(solution):
    """Return the captured energy, kJ, or None."""
    if solution is None or not solution.success:
        return None
    return solution.summary.simulated_energy_J / 1e3


def told(value, digits=2):
    """Return a number as text, or why there is none."""
    return "no success" if value is None else f"{value:.{digits}f}"


def change(value, reference, digits=2):
    """Return a relative difference in per cent as text."""
    difference = percent(value, reference)
    return "-" if difference is None else f"{difference:+.{digits}f} %"


def loads(solution):
    """Return the largest thrust, root moment, stress and suction as one cell."""
    largest = solution.summary.loads
    entries = (largest[name] for name in LOADS if name in largest)
    return ", ".join(measured(each.value, each.unit, 3) for each in entries)


def fastest(solution):
    """Return the largest rotor speed, rpm, as a cell."""
    return f"{solution.summary.loads['rotor_speed'].value * 30.0 / np.pi:.0f} rpm"


def section(title, before, header, rows, after):
    """Return the lines of a section: its title, words before and after its table."""
    before, after = (
        textwrap.fill(" ".join(words), 100, break_on_hyphens=False) for words in (before, after)
    )
    lines = [f"## {title}", before, "\n".join(markdown_table(header, rows)), after]
    return [each for line in lines if line for each in (line, "")]


def optimum_without(solution):
    """Return the loads of the paper's optimum."""
    bent = f"{solution.summary.tip_deflection_m:.2g} m"
    row = f"{energy(solution):.2f} kJ", loads(solution), bent, fastest(solution)
    return section(
        "The paper's optimum without these limits",
        (
            "The optimum of `sine_limited_oloc`, whose only limit is that of the torque, has along",
            "its integration, by direct BEM:",
        ),
        ("energy", "thrust, moment, stress", "tip deflection", "fastest"),
        [row],
        (
            "The deflection is that of a linear beam, which is not valid where it is this large.",
            "In the following tables, suction is a fraction of the cavitation limit, which has a",
            "margin of 1.1. It is given where the case has the depth of the hub.",
        ),
    )


def costs(results, free):
    """Return what each limit costs under both laws."""
    rows = []
    for limit in ("none", *LIMITS):
        for law, word in LAWS.items():
            solution = results[f"free/{law}" if limit == "none" else f"cases/{limit}_{law}"]
            value = energy(solution)
            if value is None:
                rows.append((limit, word, "no success", "", "", ""))
                continue
            cost = change(value, free[law])
            rows.append((limit, word, told(value), cost, loads(solution), fastest(solution)))
    return section(
        "What each limit costs",
        (),
        ("limit", "law", "energy, kJ", "cost", "thrust, moment, stress, suction", "fastest"),
        rows,
        (
            "The limits are 5 kW, 9 rad/s (all: 11), 6 kN (all: 6.5), 100 MPa, and no cavitation",
            "at 3 m. The cost is against the same law without the limit. A law that cannot hold a",
            "limit by its torque needs a worse blade, which costs energy: K₂ω² cannot hold a",
            "power, so its blade has to suit the fastest flow. With a limit of the power this law",
            "has several optima; in most of them it operates at its torque limit nearly always.",
            "The start tries both kinds, and `make verify PART=limits` shows where runs from",
            "random blades end ([verification.md](verification.md)).",
            *constant_torque(results["cases/power_quadratic"]),
        ),
    )


def constant_torque(solution):
    """Yield a sentence on quadratic feedback whose gain no longer has an effect."""
    if energy(solution) is None or solution.summary.gain < SATURATED:
        return
    summary = solution.summary
    yield (
        f"In `power_quadratic` the gain is {summary.gain:,.0f} N m s²/rad², so large that the law "
        "is a constant torque of 700 N m at every speed, on "
        f"{measured(summary.mass_kg, 'kg', 3)} of solid blades "
        f"({measured(summary.inertia_kg_m2, 'kg m^2', 3)}): no feedback is left. Nothing "
        "determines such a gain, so other starts end at others. Stability at a constant torque is "
        "shown only for quasi-steady induction ([dynamic inflow](../dynamic_inflow.md))."
    )


def unresolved(results):
    """Return how much larger the loads are on a blade of many stations than on the paper's nine."""
    rows = []
    for name, solution in results.items():
        for note in solution.notes if name.startswith("nine/") else ():
            if note.startswith("loads are held on"):
                larger = note.partition(" has ")[2].partition(":")[0]
                verdict = "verified" if solution.success else "refused"
                energies = solution, results[f"cases/{name.removeprefix('nine/')}_oloc"]
                cells = (told(each.summary.simulated_energy_J / 1e3) for each in energies)
                rows.append((name.removeprefix("nine/"), larger, verdict, *cells))
    return section(
        "What nine stations would miss",
        (
            "Under limits a blade has 40 stations unless the case gives others, and",
            "`loads_resolved` refuses a result whose loads on 120 stations exceed a limit by more",
            "than 1 %. The paper's nine stations, given as `rotor.stations`, keep the limits",
            "at these nine; the same blades, with chord and twist linear between them, have larger",
            "loads on 120 stations:",
        ),
        ("limit", "on 120 stations", "verdict", "nine stations, kJ", "40 stations, kJ"),
        rows,
        ("Energies differ because the torque summed over nine stations is too low (stations.md).",),
    )


def shadow_prices(results):
    """Return which limits bind, when, and what one per cent more of each would give."""
    rows = []
    for limit in LIMITS:
        for law in LAWS:
            solution = results[f"cases/{limit}_{law}"]
            if not (solution and solution.success):
                continue
            for name, entry in solution.summary.limits.items():
                if not entry.binding or entry.shadow_price is None:
                    continue
                at = f"at most {measured(entry.limit, entry.unit, 4)}"
                share = f"{100.0 * entry.share_of_time:.1f} %"
                gain = f"{1e-1 * entry.shadow_price / energy(solution):.3f} %"
                price = measured(entry.shadow_price, "J", 3)
                rows.append((f"{limit}_{law}", name, at, share, price, gain))
    return section(
        "What one per cent more would give",
        (),
        ("case", "limit", "bound", "active", "gain per +1 % of it", "relative"),
        rows,
        (
            "These shadow prices follow from the multipliers of the optimum, to first order;",
            "optimizing again with the larger limit confirms them within four per cent.",
        ),
    )


def front(ax, found, part):
    """Draw the energy, kJ, over the limits of one front."""
    unit, values = FRONTS[part]
    energies = [energy(found[f"{part}/{name}"]) or np.nan for name in values]
    look = line(0) | {"marker": "o", "markersize": 4.0}
    ax.plot([*values.values()], energies, label="open loop, verified", **look)
    look = style.REFERENCE | {"linestyle": "-.", "label": "without this limit"}
    ax.axhline(energy(found["free/oloc"]), **look)
    if part == "stress":
        ax.set_xscale("log")
    return style.finish(ax, f"largest {part} allowed ({unit})", "energy (kJ)")


def fronts(results, path):
    """Draw both fronts."""
    plots = [partial(front, found=results, part=part) for part in FRONTS]
    style.save({path.stem: style.figure_of(6.2, 6.4, plots, share=False)}, path.parent)


def branches_text(results):
    """Return both branches of the limits that have them."""
    rows = []
    for limit in BRANCHED:
        for branch in BRANCHES:
            solution = results[f"branches/{limit}_{branch}"]
            value = energy(solution)
            if value is None:
                rows.append((limit, branch, "no success (see below)", "", ""))
                continue
            rows.append((limit, branch, told(value), loads(solution), fastest(solution)))
    start = [each.objective_J for each in results["cases/all_oloc"].summary.branches]
    return section(
        "Overspeed and underspeed",
        ("Open loop, each branch optimized from its own start (`start.branch`) and verified:",),
        ("limit", "branch", "energy, kJ", "thrust, moment, stress, suction", "fastest"),
        rows,
        (
            "With a limit of the power, overspeed has the larger thrust, and underspeed is close",
            "to stall: as an open loop it is unstable ([theory.md](../theory.md#limits)).",
            "Overspeed at the limit is stable only with induction in equilibrium: with dynamic",
            "inflow it needs a heavier shaft or a controller of the speed",
            "([memory.md](memory.md)). Under all limits the slow",
            f"branch is {100.0 * (1.0 - min(start) / max(start)):.0f} % below the fast one in",
            "quasi-steady operation; an optimization from there is refused.",
        ),
    )


def sequential_text(results):
    """Return what designing the blade first costs."""
    rows = []
    for limit in SEQUENTIAL:
        kept, both = energy(results[f"sequential/{limit}"]), energy(results[f"cases/{limit}_oloc"])
        rows.append((limit, told(kept), told(both), change(both, kept)))
    stress = results["free/oloc"].summary.loads["stress"].value / 1e8
    return section(
        "Blade first, controller second",
        ("The blade of the optimum without the limit, its operation optimized under the limit:",),
        ("limit", "blade kept, kJ", "co-design, kJ", "co-design gains"),
        rows,
        [f"The limit of the stress is left out: that blade has {stress:.0f} times 100 MPa."],
    )


def losses_text(results):
    """Return what a generator's losses do to the design."""
    rows, pair = [], []
    for objective in ("captured", "electrical"):
        solution = results[f"losses/{objective}"]
        summary = solution.summary
        pair.append(summary.electrical_energy_J)
        delivered = told(summary.electrical_energy_J / 1e3 if solution.success else None)
        ratio = f"{summary.tip_speed_ratio.mean:.2f}"
        rows.append((objective, told(energy(solution)), delivered, ratio))
    return section(
        "Losses of the generator",
        (f"`sine_oloc` with `generator: {LOSSES}`:",),
        ("objective", "captured, kJ", "electrical, kJ", "tip speed ratio"),
        rows,
        (
            f"Maximizing the delivered energy gains {change(pair[1], pair[0])}: a faster rotor",
            "needs less torque for its power, and copper losses grow with the torque squared.",
        ),
    )


def turbine(solution):
    """Return RM1 under limits in turbulence."""
    value, title = energy(solution), "RM1 in turbulence"
    if value is None:
        return [f"## {title}", "", "No success."]
    rows = []
    for name, entry in solution.summary.limits.items():
        if entry.share_of_time is None:
            continue
        cells = (measured(number, entry.unit, 4) for number in (entry.value, entry.limit))
        gain = "-" if entry.shadow_price is None else measured(entry.shadow_price, "J", 3)
        rows.append((name, *cells, f"{100.0 * entry.share_of_time:.1f} %", gain))
    text = f"`limits/rm1_turbulent_limits.yaml` captures {value / 1e3:.2f} MJ in ten minutes."
    return section(
        title, [text], ("limit", "value", "bound", "active", "gain per +1 % of it"), rows, ()
    )


if __name__ == "__main__":
    main()
