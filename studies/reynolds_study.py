"""What Reynolds-dependent polars do to the paper's conclusions: writes docs/studies/reynolds.md.

python studies/reynolds_study.py --out results/reynolds
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import page_data
from study_common import markdown_table

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.run.batch import run_batch

LAWS = {"oloc": "open loop", "quadratic": "quadratic", "linear": "linear"}
CASES = {
    f"sine_{limit}{law}": (words, "700 N m" if limit else "none")
    for limit in ("", "limited_")
    for law, words in LAWS.items()
}
LOCAL = ("rotor.polar=naca63815", "rotor.reynolds=local")
VARIANTS = {
    "invariant": (),
    "local": LOCAL,
    # five times the size in the same flow: Reynolds numbers five times as large
    "large_invariant": ("rotor.radius=7", "design.chord_bounds=[0.05, 5]"),
    "large_local": ("rotor.radius=7", "design.chord_bounds=[0.05, 5]", *LOCAL),
}
BIG = ("sine_oloc", "sine_quadratic", "sine_linear")

LAST = "## What it does to the conclusions"

PAGE = """# Reynolds-dependent polars

The paper assumes Reynolds invariance: one polar, at Re = 2·10⁵, for every station at every speed.
With `rotor.reynolds: local` a station's lift and drag follow its own Reynolds number, chord times
relative speed over viscosity ([rotor_model.md](../rotor_model.md#blade)), in the flow of the
instant. Here the paper's sinusoidal cases are optimized both ways, and the invariant designs are
then simulated with local polars. Written by `studies/reynolds_study.py`; every run converged and
was verified unless the table says no. Kinematic viscosity 10⁻⁶ m²/s.

## The paper's turbine (R = 1.4 m)

{table}

*to open loop*: simulated energy against open loop of the same polars and limit. *in local polars*:
the invariant blade and gain simulated with local polars, against the design made with local polars
(feedback only: the recorded torque of open loop does not suit the changed rotor).

Stations of the blade that open loop finds with local polars see Reynolds numbers of {low:.2g} to
{high:.2g}.

## Five times the size (R = 7 m), without a limit

{large}

{last}

{conclusions}
"""


def describe(solution, local=None):
    """Return the figures of a result that the tables show; `local` is its case in local polars."""
    summary = solution.summary
    chord = np.interp(0.7, summary.r_m / np.max(summary.r_m), summary.chord_m)
    figures = {
        "success": "yes" if solution.success else "no",
        "energy_J": summary.simulated_energy_J,
        "gain": summary.gain,
        "tip_speed_ratio": summary.tip_speed_ratio_at_power_coefficient_max,
        "power_coefficient": summary.power_coefficient_max,
        "chord_m": float(chord),
    }
    if local is not None and summary.gain is not None:
        figures["in_local_polars_J"] = in_local_polars(solution, local)  # None if the rotor stops
    return figures


def in_local_polars(invariant, local):
    """Return the energy (J) of an invariant feedback design in the flow with local polars."""
    physics_ = physics(local.case)
    design = invariant.design()
    inertia = physics_.rotor.mass_and_inertia(design.plant.blade)[1]
    plant = replace(design.plant, polar=physics_.rotor.polar, inertia=inertia)
    simulation = replace(design, plant=plant).simulate(physics_.inflow)
    return None if simulation.stopped_at is not None else simulation.energy


def reynolds_range(solution):
    """Return the smallest and the largest Reynolds number of the stations."""
    physics_, summary = physics(solution.case), solution.summary
    blade = physics_.blade.with_shape(summary.chord_m, np.deg2rad(summary.twist_deg))
    ratio, flow = (np.array(solution.simulation[key]) for key in
                   ("tip_speed_ratio", "inflow_speed_m_s"))  # fmt: skip
    local = blade.r / blade.tip_radius * ratio[:, None]
    number = blade.chord * np.sqrt(1.0 + local**2) * flow[:, None]
    number = number / solution.case.fluid.kinematic_viscosity
    return float(number.min()), float(number.max())


def rows(results, cases, variants):
    """Return the rows of a table: one a case and variant."""
    header = ("control", "limit", "polars", "success", "energy / kJ", "to open loop", "gain")
    header += ("Cp max", "at TSR", "chord at 0.7 R / m", "in local polars")
    lines = []
    for case in cases:
        law, limit = CASES[case]
        for variant in variants:
            result = results[variant][case]
            best = results[variant][case.rpartition("_")[0] + "_oloc"]["energy_J"]
            less = 100.0 * (result["energy_J"] / best - 1.0)
            apart = ""
            if "in_local_polars_J" in result:
                energy = result["in_local_polars_J"]
                design = results[variant.replace("invariant", "local")][case]["energy_J"]
                apart = f"{100.0 * (energy / design - 1.0):+.2f} %" if energy else "stops"
            gain = "" if result["gain"] is None else f"{result['gain']:.4g}"
            cells = law, limit, variant.rpartition("_")[2], result["success"]
            cells += f"{result['energy_J'] / 1e3:.2f}", f"{less:+.3f} %", gain
            cells += f"{result['power_coefficient']:.4f}", f"{result['tip_speed_ratio']:.2f}"
            lines.append((*cells, f"{result['chord_m']:.4f}", apart))
    return "\n".join(markdown_table(header, lines))


def main():
    """Run the cases and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=Path, default=Path(__file__).parent.parent / "cases")
    parser.add_argument("--out", type=Path, default=Path("results/reynolds"))
    parser.add_argument("--jobs", type=int, default=None)
    arguments = parser.parse_args()

    plan = {
        arguments.out / variant / case: load_case(arguments.cases / f"{case}.yaml", overrides)
        for variant, overrides in VARIANTS.items()
        for case in (BIG if variant.startswith("large") else CASES)
    }
    runs = run_batch(plan, arguments.jobs, lambda folder, word: print(folder, word, flush=True))
    results = {variant: {} for variant in VARIANTS}
    for variant, entries in results.items():
        for case in BIG if variant.startswith("large") else CASES:
            local = None
            if variant.endswith("invariant"):
                local = runs[arguments.out / variant.replace("invariant", "local") / case]
            entries[case] = describe(runs[arguments.out / variant / case], local)
    numbers = reynolds_range(runs[arguments.out / "local" / "sine_oloc"])
    page_data.page_from("reynolds", from_data, results=results, reynolds=numbers)


def from_data(data):
    """Return the page of its data; its last section is written by hand, and stays."""
    low, high = data["reynolds"]
    return PAGE.format(
        table=rows(data["results"], CASES, ("invariant", "local")),
        large=rows(data["results"], BIG, ("large_invariant", "large_local")),
        low=low,
        high=high,
        conclusions=page_data.text_of("reynolds").partition(LAST)[2].strip(),
        last=LAST,
    )


if __name__ == "__main__":
    main()
