"""What dynamic inflow changes; writes the tables of docs/studies/memory.md.

python studies/memory_study.py --out results/memory --page docs/studies/memory.md

Cases without a result in --out are run (about ten minutes); finished ones are used again. With
--limited, results of cases/limits in another folder are simulated, too. What stands in the page
before the line of its tables is kept.
"""

import argparse
import os
from dataclasses import replace
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
import page_data
from study_common import CODESIGN, markdown_table, percent

from hkt_mdo import build_problem, load_case
from hkt_mdo.dynamics import wake as filters
from hkt_mdo.dynamics.flows import GustInflow, StepInflow
from hkt_mdo.dynamics.simulation import FeedbackTorque
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.problem import operation_group
from hkt_mdo.results import style
from hkt_mdo.results.solution import Solution
from hkt_mdo.studies.other_flows import runs_of

PAPER = (*CODESIGN, "sine_baseline_oloc")
OYE = ("inflow_dynamics=oye",)
DESIGNED = {  # name: case, overrides
    "no limit, quadratic": ("sine_quadratic", ()),
    "no limit, linear": ("sine_linear", ()),
    "700 N m, quadratic, 30 kg m² more on the shaft": (
        "sine_limited_quadratic",
        ("rotor.hub_inertia=30",),
    ),
    "700 N m, open loop": ("sine_limited_oloc", ()),
    "700 N m and 6 kN, quadratic": ("limits/thrust_quadratic", ("rotor.station_count=9",)),
    "all limits, quadratic": ("limits/all_quadratic", ()),
    "5 kW, rated, 250 kg m² more on the shaft": (
        "limits/power_quadratic",
        (
            "control={law: rated}",
            "rotor.hub_inertia=250",
            "rotor.station_count=9",
            "phase.segments=40",
            "driver.optimizer=SLSQP",
        ),
    ),
}
SHAFT = "design.hub_inertia_bounds=[0, 400]", "design.hub_inertia_price=20", *OYE
REAL = {  # kg m², radius in m
    "Reference Model 1": (92_169.0, 10.0),
    "with its generator": (484_000.0, 10.0),
}
MAP, SHARES = "../images/memory_map.png", (1.0, 0.95, 0.8, 0.6)
MOST_STATIONS = 20  # of a rotor that runs away: its simulation takes minutes with more
PULSES = 0.002, 0.01, 0.03
VARIED = {  # what is varied in the model of the wake: name: constant, its value
    "τ₁ × 0.8": ("SLOW", 0.8 * filters.SLOW),
    "τ₁ × 1.25": ("SLOW", 1.25 * filters.SLOW),
    "k = 0.3": ("AT_ONCE", 0.3),
    "k = 0.9": ("AT_ONCE", 0.9),
}
MARK = "<!-- Tables by python studies/memory_study.py -->"


class Held:
    """A controller whose torque has a slope over the speed, N m s/rad."""

    def __init__(self, stiffness):
        self.stiffness = stiffness


def main():
    """Run what has no result yet, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/memory"))
    parser.add_argument("--limited", type=Path, default=None, help="results of cases/limits")
    parser.add_argument("--page", type=Path, default=Path("docs/studies/memory.md"))
    arguments = parser.parse_args()
    out = arguments.out
    folders = [solved(out / name, name) for name in PAPER]
    limited = sorted(arguments.limited.iterdir()) if arguments.limited else []
    reference = Solution.load(out / "sine_limited_quadratic")
    river = load_case("cases/limits/rm1_turbulent_limits.yaml")
    parts = [
        ["## The paper's cases", "", *simulated(folders)],
        ["## Under limits", "", *simulated(limited)] if limited else [],
        ["## The stable region", "", *the_map(reference, river, arguments.page.parent / MAP)],
        ["## What tracking needs", "", *tracking(reference)],
        ["## Thrust after a change of the flow", "", *overshoot(out)],
        ["## Designed with dynamic inflow", "", *designed(out)],
        ["## What the model of the wake decides", "", *variations(out)],
    ]
    tables = "\n".join(line for part in parts for line in (*part, "") if part)
    head = arguments.page.read_text(encoding="utf-8").partition(MARK)[0]
    arguments.page.write_text(f"{head}{MARK}\n\n{tables.rstrip()}\n", encoding="utf-8")


def solved(folder, name, overrides=()):
    """Return the folder of a case's result, run if need be."""
    if not (folder / "summary.json").exists():
        case = load_case(f"cases/{name}.yaml", list(overrides))
        run(case, folder)
    return folder


def run(case, folder):
    """Run a case without figures."""
    from hkt_mdo.run.run import run_case

    print(folder, run_case(case, folder, force=True, figures=False, records=False).message)


def simulated(folders):
    """Return the table of results, with dynamic inflow and without."""
    rows = []
    for folder in folders:
        solution = Solution.load(folder)
        if not solution.success:
            continue
        runs = runs_of(solution, "design", memory=True)
        verdict = solution.summary.memory
        least = verdict.least_inertia_kg_m2
        loop = (
            folder.name,
            "stable" if verdict.stable else f"unstable, +{verdict.growth:.2g} 1/s",
            f"{verdict.frozen_growth:+.3g}",
            "none" if least is None else f"{least:.3g} ({verdict.inertia_kg_m2:.3g})",
        )
        if not verdict.stable and solution.design().blade.r.size > MOST_STATIONS:
            rows.append((*loop, *("not simulated",) * 4))
            continue
        away = [x.runs_away for x in runs if x.runs_away is not None]
        pairs = [(x.without, x) for x in runs]
        energy = [sum(each.simulation.energy for each in side) for side in zip(*pairs, strict=True)]
        speed, thrust = (
            [max(of(each) for each in side) for side in zip(*pairs, strict=True)]
            for of in (
                lambda x: np.max(x.simulation.rotor_speed),
                lambda x: x.extremes["thrust"].value,
            )
        )
        stopped = any(each.simulation.stopped_at is not None for each in runs)
        rows.append(
            (
                *loop,
                "stops" if stopped else f"{percent(energy[1], energy[0]):+.2f} %",
                f"{speed[0]:.2f}, {speed[1]:.2f}",
                f"{thrust[0] / 1e3:.2f}, {thrust[1] / 1e3:.2f}",
                f"from {min(away):.1f} s" if away else "no",
            )
        )
        print(*rows[-1], flush=True)
    header = (
        "case", "loop", "growth at frozen wake, 1/s", "stable from kg m² (its own)",
        "captured with dynamic inflow", "rotor speed without and with, rad/s",
        "thrust without and with, kN", "runs away",
    )  # fmt: skip
    return markdown_table(header, rows)


def the_map(reference, other, image):
    """Return the table of least inertias at a limit of torque and of power; draw their figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.4), layout="constrained")
    ax, rows = figure.subplots(), []
    design = reference.design()
    plants = {"paper's rotor (700 N m)": design.plant, "Reference Model 1": plant_of(other)}
    for (name, plant), line in zip(plants.items(), ("-", "--"), strict=True):
        size = plant.density * plant.blade.rotor_radius**5
        for what, color in (("torque", style.COLORS[0]), ("power", style.COLORS[1])):
            shares, least, slope = least_inertias(plant.with_memory(), what)
            ax.plot(shares, least / size, line, color=color, label=f"{name}, limit of the {what}")
            for share in SHARES:
                at = np.interp(share, shares[::-1], least[::-1])
                held = np.interp(share, shares[::-1], slope[::-1])
                scaled = f"{at / size:.2g}" if np.isfinite(at) else "none"
                kg = f"{at:.3g}" if np.isfinite(at) else "none"
                rows.append((name, what, f"{share:.2f}", scaled, kg, f"{held:.3g}"))
    blades_alone = design.inertia / (design.plant.density * design.plant.blade.rotor_radius**5)
    drive = {"the paper's blades alone": blades_alone}
    drive |= {name: inertia / (1000.0 * radius**5) for name, (inertia, radius) in REAL.items()}
    for name, value in drive.items():
        ax.axhline(value, color="0.5", linewidth=0.8)
        ax.text(0.6, value, f" {name}", va="bottom", fontsize=8)
    ax.set_yscale("log")
    ax.set_xlabel("limit over what the rotor has at its best tip speed ratio (-)")
    ax.set_ylabel("least inertia over $\\rho R^5$ (-)")
    ax.legend(fontsize=8)
    image.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(image, dpi=120)
    header = (
        "rotor", "limit of the", "share", "least inertia over ρR⁵", "kg m²",
        "stiffness that holds it at once, N m s/rad",
    )  # fmt: skip
    names = ", ".join(f"{name} {value:.2g}" for name, value in drive.items())
    return [
        f"![least inertia over the limit](../images/{image.name})",
        "",
        f"Inertias of real drive trains over ρR⁵: {names}.",
        "",
        *markdown_table(header, rows),
    ]


def plant_of(case):
    """Return the rotor of a case as its file has it."""
    from hkt_mdo.dynamics.simulation import Plant
    from hkt_mdo.problem.physics import physics
    from hkt_mdo.rotor import bem

    physics_ = physics(case)
    blade = physics_.blade
    inertia = physics_.rotor.mass_and_inertia(blade)[1]
    polar = physics_.rotor.polar
    return Plant(blade, polar, inertia, physics_.density, bem.rotor_coefficients)


def least_inertias(plant, what, flow=1.5):
    """Return shares of the best torque or power, falling, least inertias and frozen slopes.

    Of equilibria on the fast side, at which the torque is held, or its product with the speed.
    """
    ratio = np.linspace(2.0, 16.0, 561)
    flow = np.full(ratio.size, flow)
    speed = ratio * flow / plant.blade.rotor_radius
    torque = plant.torque(speed, flow)
    best = int(np.argmax(torque * speed))
    values = torque if what == "torque" else torque * speed
    until = best + int(np.argmax(values[best:] < 0.55 * values[best]))
    part = slice(best, until)
    least, slope = np.empty(until - best), np.empty(until - best)
    for i in range(until - best):
        at = slice(best + i, best + i + 1)
        stiffness = 0.0 if what == "torque" else -float(torque[at][0] / speed[at][0])
        loop = Loop.of(plant, Held(stiffness), speed[at], flow[at])
        least[i], slope[i] = loop.least_inertia[0], max(loop.frozen[0] - stiffness, 0.0)
    return values[part] / values[best], least, slope


def tracking(reference):
    """Return what proportional and integral gain a light rotor needs."""
    design, flow, rows = reference.design(), np.array([1.7]), []
    plant = design.plant.with_memory()
    speed = 8.06 * flow / plant.blade.rotor_radius
    torque = plant.torque(speed, flow)
    frozen = float(plant.torque_slope(speed, flow)[0])
    law = Tracking(knots=3, flow_range=(1.0, 2.0))
    schedule = speed[0] * np.array([1.0, 1.5, 2.0]) / flow[0]
    for factor in (0.5, 0.9, 1.1, 5.0):
        for reset in (2.0, 0.02):
            kp = factor * frozen
            controller = FeedbackTorque(law, np.array([*schedule, kp, kp / reset]))
            loop = Loop.of(plant, controller, speed, flow, torque, flow)
            least = loop.least_inertia[0]
            cell = f"{least:.3g}" if np.isfinite(least) else "none"
            rows.append((f"{factor:g}", f"{kp:.3g}", f"{reset:g}", f"{loop.growth[0]:+.3g}", cell))
    header = "kp over the slope", "kp, N m s/rad", "kp / ki, s", "growth, 1/s", "stable from kg m²"
    intro = (
        f"The blade of `sine_limited_quadratic` at 1.7 m/s, tip speed ratio 8.06, not saturated; "
        f"the slope of its torque at frozen wake is {frozen:.3g} N m s/rad. Its rotor has "
        f"{plant.inertia:.3g} kg m²."
    )
    return [intro, "", *markdown_table(header, rows)]


def overshoot(out):
    """Return the largest thrust after changes of the flow, with dynamic inflow over without."""
    solution, rows = Solution.load(out / "sine_quadratic"), []
    flows = {
        f"step from 1.4 to 1.6 m/s, width {width:g} s": StepInflow(
            before=1.4, after=1.6, time=20.0, width=width
        )
        for width in (0.05, 0.2, 1.0, 3.0)
    }
    flows["extreme operating gust, 0.5 m/s in 10.5 s"] = GustInflow(
        shape="mexican_hat", amplitude=0.5, time=15.0
    )
    (base,) = runs_of(solution, "design", memory=True)
    for name, flow in flows.items():
        quiet = replace(base.without, inflow=flow)
        with_memory = replace(base, inflow=flow, without=quiet)
        thrusts = [each.extremes["thrust"].value / 1e3 for each in (quiet, with_memory)]
        speeds = [float(np.max(each.simulation.rotor_speed)) for each in (quiet, with_memory)]
        change = percent(thrusts[1], thrusts[0])
        rows.append((name, *(f"{x:.3f}" for x in (*thrusts, *speeds)), f"{change:+.1f} %"))
        print(*rows[-1], flush=True)
    header = (
        "flow", "thrust without, kN", "with", "rotor speed without, rad/s", "with",
        "thrust, more",
    )  # fmt: skip
    return ["The design of `sine_quadratic`.", "", *markdown_table(header, rows)]


def designed(out):
    """Return what design with dynamic inflow gives, beside design without."""
    rows = []
    for label, (name, overrides) in DESIGNED.items():
        quiet = Solution.load(solved(out / place_of(name, overrides), name, overrides))
        memory = solved(out / place_of(name, overrides, "_oye"), name, (*overrides, *OYE))
        memory = Solution.load(memory)
        both = quiet, memory
        (run,) = runs_of(quiet, "design", memory=True)
        summary, loop = memory.summary, memory.summary.memory
        off = percent(summary.simulated_energy_J, summary.energy_J)
        gap = {each.name: each.value for each in summary.checks}.get("two_filters_speed")
        verdict = "verified" if memory.success else "refused"
        stable = "stable" if loop is not None and loop.stable else "unstable"
        rows.append(
            (
                label,
                f"{quiet.summary.simulated_energy_J / 1e3:.2f}",
                run.outcome.split(";")[0],
                f"{summary.simulated_energy_J / 1e3:.2f}" if summary.simulated_energy_J else "-",
                "-" if off is None else f"{off:+.3f} %",
                "-" if gap is None else f"{100.0 * gap:.2f} %",
                f"{verdict}, {stable}",
                ", ".join(str(sum(each.iterations for each in x.summary.passes)) for x in both),
            )
        )
        print(*rows[-1], flush=True)
    header = (
        "limits, law", "designed without, kJ", "the same simulated with dynamic inflow",
        "designed with, kJ", "all stations over two filters", "speed, at most", "verdict",
        "iterations without and with",
    )  # fmt: skip
    return [*markdown_table(header, rows), "", *pulses(), "", *shaft(out)]


def shaft(out):
    """Return what a shaft ends at that is designed at a price, under 700 N m."""
    solution = Solution.load(solved(out / "designed_shaft_oye", "sine_limited_quadratic", SHAFT))
    summary, memory, goal = solution.summary, solution.summary.memory, solution.summary.objective
    needed = (x.why.partition("from ")[2].split()[0] for x in summary.passes if x.remedy)
    verdict = "verified" if solution.success else "refused"
    row = (
        f"{summary.hub_inertia_kg_m2:.1f}", f"{summary.inertia_kg_m2:.1f}",
        f"{memory.least_inertia_kg_m2:.1f}", f"{summary.simulated_energy_J / 1e3:.2f}",
        f"{goal.price:.0f}", f"{goal.simulated / 1e3:.2f}", ", ".join(needed), verdict,
    )  # fmt: skip
    header = (
        "shaft, kg m²", "rotor", "stable from", "captured, kJ", "price paid, J", "objective, kJ",
        "least shaft after each optimization but the last, kg m²", "verdict",
    )  # fmt: skip
    intro = "Quadratic feedback under 700 N m, with a shaft from 0 to 400 kg m² at 20 J/(kg m²):"
    return [intro, "", *markdown_table(header, [row])]


def place_of(name, overrides, ending=""):
    """Return the name of the folder of a design."""
    return f"designed_{Path(name).name}{'_heavy' * ('hub_inertia' in str(overrides))}{ending}"


def variations(out):
    """Return what the constants of the filters change of the designs' energies and speeds."""
    rows = []
    for label, (name, overrides) in DESIGNED.items():
        solution = Solution.load(out / place_of(name, overrides, "_oye"))
        if not solution.success:
            continue
        (base,) = runs_of(solution, "design", memory=True)
        time, cells = base.simulation.time, []
        for constant, value in VARIED.values():
            kept = getattr(filters, constant)
            setattr(filters, constant, value)
            (run,) = runs_of(solution, "design", memory=True)
            speed = np.max(np.abs(run.simulation.speed_at(time) / base.simulation.rotor_speed - 1))
            setattr(filters, constant, kept)
            energy = percent(run.simulation.energy, base.simulation.energy)
            cells.append(f"{energy:+.2f} %, {100.0 * speed:.2f} %")
        gap = percent(solution.summary.energy_J, base.simulation.energy)
        checks = {each.name: each.value for each in solution.summary.checks}
        two_filters = f"{gap:+.2f} %, {100.0 * checks['two_filters_speed']:.2f} %"
        rows.append((label, two_filters, *cells))
        print(*rows[-1], flush=True)
    intro = (
        "The designs with dynamic inflow, simulated with the filters of all stations and other "
        "constants: change of the energy, and largest change of the rotor's speed. The first "
        "column has the same of the optimization's two filters."
    )
    header = "limits, law", "two filters", *VARIED
    return [intro, "", *markdown_table(header, rows)]


def pulses():
    """Return the energy of an open loop by how far it may be from its wake."""
    rows, kept = [], operation_group.PULSE
    for pulse in PULSES:
        operation_group.PULSE = pulse
        case = load_case("cases/sine_limited_oloc.yaml", [*OYE, "driver.max_iterations=300"])
        problem = build_problem(case)
        problem.run_model()
        problem.run_driver()
        rows.append((f"{100 * pulse:g} %", f"{problem.get_val('energy')[0] / 1e3:.2f}"))
    operation_group.PULSE = kept
    intro = (
        "Open loop under 700 N m, 60 segments, by how far it may be from the start's wake factor:"
    )
    return [intro, "", *markdown_table(("from the start's", "captured, kJ"), rows)]


if __name__ == "__main__":
    main()
    page_data.record("memory")
