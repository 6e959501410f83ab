"""What limits cost and buy: runs cases/limits and variations of them, and writes docs/limits.md.

python scripts/limits_study.py --out results/limits --table docs/limits.md

Finished results are used again.
"""

import argparse
import os
import textwrap
from functools import partial
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np

from hkt_mdo.case import load_case
from hkt_mdo.results import style
from hkt_mdo.results.words import measured
from hkt_mdo.run.batch import run_batch
from hkt_mdo.studies.common import with_blade

ROOT = Path(__file__).parent.parent
LIMITS = ("power", "rotor_speed", "thrust", "stress", "cavitation", "all")
LAWS = {"oloc": "open loop", "quadratic": "quadratic feedback"}
BRANCHES = ("overspeed", "underspeed")
BRANCHED = ("power", "rotor_speed", "all")  # where both branches are optimized
THRUSTS = np.linspace(3.5, 7.3, 16)  # kN
STRESSES = np.geomspace(30.0, 3000.0, 16)  # MPa
SEQUENTIAL = ("power", "rotor_speed", "thrust")
LOSSES = "{rated_torque: 700, rated_speed: 7.5, copper_loss: 500, friction_loss: 50, iron_loss: 50}"
LOADS = ("thrust", "root_moment", "stress", "cavitation")
IMAGE = "images/limits_fronts.png"

HEAD = """\
# What limits cost, and what they buy

Written by `python scripts/limits_study.py`, from cases/limits and variations of them: the paper's
rotor in its sinusoidal flow with 700 N m. Each row is a whole co-design, blade and controller; each
has been integrated again with direct BEM, and each limit was judged along that integration and
between the nodes. Energies are captured energies of the integration.
"""


def main():
    """Run everything that has no result yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/limits"))
    parser.add_argument("--table", type=Path, default=Path("docs/limits.md"))
    parser.add_argument("--jobs", type=int, default=None, help="processes (default: one a core)")
    parser.add_argument("--only", nargs="*", help="parts to run, then no page: names of folders")
    arguments = parser.parse_args()
    out = arguments.out

    def run(plan):
        cases = {out / name: case for name, case in plan.items()}
        return run_batch(cases, arguments.jobs, partial(print, flush=True), records=False)

    runs = {
        name: load_case(ROOT / "cases" / file, changes)
        for name, (file, changes) in plan().items()
        if not arguments.only or name.split("/")[0] in arguments.only
    }
    found = run(runs)
    if not arguments.only:
        found |= run(sequential(runs, found[out / "free" / "oloc"]))
        found = {path.relative_to(out).as_posix(): each for path, each in found.items()}
        fronts(found, arguments.table.parent / IMAGE)
        arguments.table.write_text(page(found), encoding="utf-8")
        print(f"wrote {arguments.table}")


def plan():
    """Return file and overrides of every run that needs no other's result, by its folder."""
    runs = {f"free/{law}": (f"sine_limited_{law}.yaml", []) for law in LAWS}
    for limit in LIMITS:
        for law in LAWS:
            runs[f"cases/{limit}_{law}"] = f"limits/{limit}_{law}.yaml", []
        slsqp = ["driver.optimizer=SLSQP"]
        runs[f"SLSQP/{limit}_quadratic"] = f"limits/{limit}_quadratic.yaml", slsqp
    for limit in BRANCHED:
        for branch in BRANCHES:
            name = f"branches/{limit}_{branch}"
            runs[name] = f"limits/{limit}_oloc.yaml", [f"start.branch={branch}"]
    runs["cases/rm1_turbulent"] = "limits/rm1_turbulent_limits.yaml", []
    for thrust in THRUSTS:
        name = f"thrust/{thrust:.2f}"
        runs[name] = "sine_limited_oloc.yaml", [f"limits.thrust={thrust:.4f} kN"]
    for stress in STRESSES:
        name = f"stress/{stress:.0f}"
        runs[name] = "sine_limited_oloc.yaml", [f"limits.stress={stress:.4f} MPa"]
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


def page(found):
    """Return the page for the solutions by folder."""
    free = {law: energy(found[f"free/{law}"]) for law in LAWS}
    return "\n".join(
        [
            HEAD,
            *in_short(found, free),
            *optimum_without(found["free/oloc"]),
            *costs(found, free),
            *worths(found),
            *fronts_text(found, free),
            *branches_text(found),
            *sequential_text(found),
            *losses_text(found),
            *agreement(found),
            *turbine(found["cases/rm1_turbulent"]),
        ]
    )


def in_short(found, free):
    """Yield the answers in a few sentences."""
    under = {key: energy(found[f"cases/{key}"]) for key in ("power_oloc", "power_quadratic")}
    alone = {
        limit: change(energy(found[f"cases/{limit}_oloc"]), free["oloc"], 1) for limit in LIMITS
    }
    gains = [
        change(energy(found[f"cases/{limit}_oloc"]), energy(found[f"sequential/{limit}"]))
        for limit in SEQUENTIAL
    ]
    electrical = [found[f"losses/{name}"].summary for name in ("captured", "electrical")]
    ratios = [f"{each.tip_speed_ratio.mean:.1f}" for each in electrical]
    delivered = change(*(each.electrical_energy_J for each in reversed(electrical)), 1)
    laws = change(under["power_quadratic"], under["power_oloc"], 1)
    for text in (
        f"- What a limit does to the energy of open loop: 100 MPa {alone['stress']}, 6 kN of "
        f"thrust {alone['thrust']}, 9 rad/s {alone['rotor_speed']}, no cavitation at 3 m "
        f"{alone['cavitation']}, 5 kW {alone['power']}; all together {alone['all']}.",
        f"- With 5 kW the energy of quadratic feedback is {laws} against open loop; without this "
        f"limit {change(free['quadratic'], free['oloc'], 3)}.",
        f"- Co-design gains {gains[0]} (power), {gains[1]} (speed) and {gains[2]} (thrust) over a "
        "blade that was designed without the limit.",
        f"- With losses in the windings the best tip speed ratio rises from {ratios[0]} to "
        f"{ratios[1]}, and designing for what is delivered gains {delivered}.",
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
    if value is None or reference is None:
        return "-"
    return f"{100.0 * (value / reference - 1.0):+.{digits}f} %"


def loads(solution):
    """Return the largest thrust, root moment, stress and suction as one cell."""
    largest = solution.summary.loads
    told = (largest[name] for name in LOADS if name in largest)
    return ", ".join(measured(each.value, each.unit, 3) for each in told)


def fastest(solution):
    """Return the largest rotor speed, rpm, as a cell."""
    return f"{solution.summary.loads['rotor_speed'].value * 30.0 / np.pi:.0f} rpm"


def row(*cells):
    """Return a row of a table."""
    return f"| {' | '.join(str(each) for each in cells)} |"


def binding(solution):
    """Return the names of the limits that bind, with what one per cent more gives, in J."""
    words = []
    for name, each in solution.summary.limits.items():
        if each.binding:
            worth = "" if each.worth is None else f" ({each.worth:.3g})"
            words.append(f"{name}{worth}")
    return ", ".join(words) or "none"


def optimum_without(solution):
    """Yield what the paper's optimum has to withstand."""
    yield "## What is left of the paper's optimum"
    yield ""
    yield "The optimum of `sine_limited_oloc`, which knows the torque limit alone, has along its"
    yield "integration, by direct BEM:"
    yield ""
    yield row("energy", "thrust, moment, stress", "tip deflection", "fastest")
    yield row(*["---"] * 4)
    bent = f"{solution.summary.tip_deflection_m:.2g} m"
    yield row(f"{energy(solution):.2f} kJ", loads(solution), bent, fastest(solution))
    yield ""
    yield "The deflection is that of a linear beam and no prediction where it is large. In what"
    yield "follows, suction is in shares of what a section stands: above 1 it cavitates. It is told"
    yield "where the depth of the hub is given."
    yield ""


def costs(found, free):
    """Yield what each limit costs under both laws."""
    yield "## What each limit costs"
    yield ""
    yield row("limit", "law", "energy, kJ", "cost", "thrust, moment, stress, suction", "fastest")
    yield row(*["---"] * 6)
    for limit in ("none", *LIMITS):
        for law, word in LAWS.items():
            solution = found[f"free/{law}" if limit == "none" else f"cases/{limit}_{law}"]
            value = energy(solution)
            if value is None:
                yield row(limit, word, "no success", "", "", "")
                continue
            cost = change(value, free[law])
            yield row(limit, word, told(value), cost, loads(solution), fastest(solution))
    yield ""
    yield "The limits are 5 kW, 9 rad/s (all: 11), 6 kN (all: 6.5), 100 MPa, and no cavitation at"
    yield "3 m. The cost is against the same law without the limit. A law that has no way to keep"
    yield "a limit but by its blade pays for it: K₂ω² cannot hold a power, and its blade is made"
    yield "for the fastest flow."
    yield "With a limit of the power it has several optima, in which it works at its torque limit"
    yield "most of the time: from random blades up to 0.8 % more than here was found with 5 kW"
    yield "([verification.md](verification.md), `hkt verify limits`). Those rows are verified, but"
    yield "not the best."
    yield ""


def worths(found):
    """Yield which limits bind, when, and what one per cent more of each would give."""
    yield "## What one per cent more would give"
    yield ""
    yield row("case", "limit", "binds", "of the time", "1 % more gives", "of the energy")
    yield row(*["---"] * 6)
    for limit in LIMITS:
        for law in LAWS:
            solution = found[f"cases/{limit}_{law}"]
            if not (solution and solution.success):
                continue
            for name, each in solution.summary.limits.items():
                if not each.binding or each.worth is None:
                    continue
                at = f"at most {measured(each.limit, each.unit, 4)}"
                share = f"{100.0 * each.share_of_time:.1f} %"
                gain = f"{1e-1 * each.worth / energy(solution):.3f} %"
                worth = measured(each.worth, "J", 3)
                yield row(f"{limit}_{law}", name, at, share, worth, gain)
    yield ""
    yield "The worth follows from the multipliers of the optimum, to first order; optimizing again"
    yield "with the larger limit confirms it within ten per cent (`tests/run/test_worth.py`)."
    yield ""


def fronts_text(found, free):
    """Yield the fronts of energy against thrust and against stress."""
    for part, values, unit in (("thrust", THRUSTS, "kN"), ("stress", STRESSES, "MPa")):
        yield f"## Energy against {part}"
        yield ""
        yield row(
            f"{part}, {unit}",
            "energy, kJ",
            "cost",
            "binding (1 % more gives, J)",
            "tip speed ratio",
        )
        yield row(*["---"] * 5)
        for value in values:
            name = f"{value:.2f}" if part == "thrust" else f"{value:.0f}"
            solution = found[f"{part}/{name}"]
            captured = energy(solution)
            if captured is None:
                yield row(name, "no success", "", "", "")
                continue
            ratio = solution.summary.tip_speed_ratio.mean
            cost = change(captured, free["oloc"])
            yield row(name, told(captured), cost, binding(solution), f"{ratio:.2f}")
        yield ""
    yield f"![Energy against thrust and stress]({IMAGE})"
    yield ""


def front(ax, found, part, values, unit):
    """Draw the energy, kJ, over the limits of one front."""
    names = [f"{value:.2f}" if part == "thrust" else f"{value:.0f}" for value in values]
    energies = [energy(found[f"{part}/{name}"]) or np.nan for name in names]
    ax.plot(values, energies, label="open loop, verified", **style.line(0) | style.marker(0, 4.0))
    look = style.REFERENCE | {"linestyle": "-.", "label": "without this limit"}
    ax.axhline(energy(found["free/oloc"]), **look)
    if part == "stress":
        ax.set_xscale("log")
    return style.finish(ax, f"largest {part} allowed ({unit})", "energy (kJ)")


def fronts(found, path):
    """Draw both fronts."""
    parts = ("thrust", THRUSTS, "kN"), ("stress", STRESSES, "MPa")
    plots = [
        partial(front, found=found, part=part, values=values, unit=unit)
        for part, values, unit in parts
    ]
    style.save({path.stem: style.figure_of(6.2, 6.4, plots, share=False)}, path.parent)


def branches_text(found):
    """Yield both branches of the limits that have them."""
    yield "## Overspeed and underspeed"
    yield ""
    yield "Open loop, each branch optimized from its own start (`start.branch`) and verified:"
    yield ""
    yield row("limit", "branch", "energy, kJ", "thrust, moment, stress, suction", "fastest")
    yield row(*["---"] * 5)
    for limit in BRANCHED:
        for branch in BRANCHES:
            solution = found[f"branches/{limit}_{branch}"]
            value = energy(solution)
            if value is None:
                yield row(limit, branch, "no success (see below)", "", "")
                continue
            yield row(limit, branch, told(value), loads(solution), fastest(solution))
    yield ""
    slow, fast = sorted(each.objective_J for each in found["cases/all_oloc"].summary.branches)
    yield "With a limit of the power, overspeed has the larger thrust, and underspeed is close to"
    yield "stall: as an open loop it is unstable (docs/theory.md). Under all limits the slow branch"
    yield f"is {100.0 * (1.0 - slow / fast):.0f} % below the fast one in quasi-steady operation."
    slow = found["branches/all_underspeed"]
    if slow is None:
        yield "It is not verified: the independent integration does not get through it."
    yield ""


def sequential_text(found):
    """Yield what designing the blade first costs."""
    yield "## Blade first, controller second"
    yield ""
    yield "The blade of the optimum without the limit, its operation optimized under the limit:"
    yield ""
    yield row("limit", "blade kept, kJ", "co-design, kJ", "co-design gains")
    yield row(*["---"] * 4)
    for limit in SEQUENTIAL:
        kept, both = energy(found[f"sequential/{limit}"]), energy(found[f"cases/{limit}_oloc"])
        yield row(limit, told(kept), told(both), change(both, kept))
    yield ""
    stress = found["free/oloc"].summary.loads["stress"].value / 1e8
    yield f"Strength is left out: in that blade the stress is {stress:.0f} times 100 MPa."
    yield ""


def losses_text(found):
    """Yield what a generator's losses do to the design."""
    yield "## Losses of the generator"
    yield ""
    yield f"`sine_oloc` with `generator: {LOSSES}`:"
    yield ""
    yield row("objective", "captured, kJ", "electrical, kJ", "tip speed ratio")
    yield row(*["---"] * 4)
    pair = []
    for objective in ("captured", "electrical"):
        solution = found[f"losses/{objective}"]
        summary = solution.summary
        pair.append(summary.electrical_energy_J)
        ratio = f"{summary.tip_speed_ratio.mean:.2f}"
        delivered = told(summary.electrical_energy_J / 1e3 if solution.success else None)
        yield row(objective, told(energy(solution)), delivered, ratio)
    yield ""
    yield f"Designing for what is delivered gains {change(pair[1], pair[0])}: a faster rotor needs"
    yield "less torque for its power, and copper losses grow with the torque squared."
    yield ""


def agreement(found):
    """Yield whether both optimizers find the same."""
    yield "## Two optimizers"
    yield ""
    yield row("case", "IPOPT, J", "SLSQP, J", "difference")
    yield row(*["---"] * 4)
    for limit in LIMITS:
        name = f"{limit}_quadratic"
        values = [energy(found[f"{folder}/{name}"]) for folder in ("cases", "SLSQP")]
        cells = [told(None if each is None else 1e3 * each, 1) for each in values]
        known = None not in values
        yield row(name, *cells, f"{values[1] / values[0] - 1.0:+.1e}" if known else "-")
    yield ""
    yield "The open loops have meshes of several hundred segments, for which SLSQP's dense matrices"
    yield "take minutes an optimization: they are left out."
    yield ""


def turbine(solution):
    """Yield RM1 under limits in turbulence."""
    yield "## RM1 in turbulence"
    yield ""
    value = energy(solution)
    if value is None:
        yield f"No success: {solution.summary.message if solution else 'not run'}"
        return
    yield f"`limits/rm1_turbulent_limits.yaml` captures {value / 1e3:.2f} MJ in ten minutes."
    yield ""
    yield row("limit", "value", "bound", "of the time", "1 % more gives")
    yield row(*["---"] * 5)
    for name, each in solution.summary.limits.items():
        if each.share_of_time is None:
            continue
        cells = (measured(number, each.unit, 4) for number in (each.value, each.limit))
        gain = "-" if each.worth is None else measured(each.worth, "J", 3)
        yield row(name, *cells, f"{100.0 * each.share_of_time:.1f} %", gain)


if __name__ == "__main__":
    main()
