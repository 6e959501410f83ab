"""What the number of blade stations and of control points does: writes docs/studies/stations.md.

python studies/station_study.py --out results/stations
"""

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np
import page_data

from hkt_mdo.case import load_case
from hkt_mdo.case.schema import STATION_COUNT
from hkt_mdo.run.batch import run_batch

LAWS = ("quadratic", "oloc", "linear")
COUNTS = (9, 18, 36, 72, 144)
POINTS = (4, 6, 8, 12)
FREE = 36


def splines(points=6):
    """Return the overrides that make chord and twist splines."""
    return [f"design.chord_points={points}", f"design.twist_points={points}"]


def stations(count):
    """Return the override that sets the number of stations."""
    return [f"rotor.station_count={count}"]


VARIANTS = {
    "paper_free": [],  # first: it loads what the others then find loaded
    "paper": [*splines(), "rotor.stations=[0.2,0.3,0.4,0.5,0.6,0.7,0.8,0.9,0.999]"],
    "points_6": splines(),  # with the default number of stations
    **{f"count_{n}": [*splines(), *stations(n)] for n in COUNTS},
    **{f"points_{n}": splines(n) for n in POINTS if n != 6},
    "free": [*splines(FREE), *stations(FREE)],  # as many points as stations: no splines
}

HEAD = """\
# Blade stations and control points

Written by `python studies/station_study.py`. The sine cases with 700 N m, of
`cases/sine_limited_*.yaml`: chord and twist are B-splines, with six control points each unless said
otherwise, so the freedom of the design stays the same while the number of stations of the blade
element momentum theory grows. Every row is a complete co-design. Energies are those of the
independent simulation; wall times are of the whole run, on a machine shared with other work.
"""

RESOLVED = """\
Under limits a blade has 40 stations as well, unless the case says which: loads at the paper's nine
are up to a fifth too small ([limits.md](limits.md#what-nine-stations-would-miss))."""
WHY = """\
**Why.** The rotor's torque is the trapezoidal rule over hub, stations and tip with no load at both
ends, as in CCBlade. The load rises steeply at hub and tip (Prandtl's losses), so
`rotor.station_count` = n puts the stations at equal steps of an angle,

$$
r_i = R_h + (R - R_h)\\, \\frac{1 - \\cos(\\pi (i + \\tfrac12)/n)}{2}, \\qquad i = 0 \\ldots n - 1,
$$

closer together towards both. The error is then of second order: it falls to a quarter
where n is doubled. A coarse rule misses part of the load: with more stations every energy
rises towards its limit.
"""

FREE_WHY = """\
Near hub and tip, where Prandtl's loss factor is small, the optimum of a free station lies at high
induction (Buhl's branch) instead of about a third, with a chord and twist unlike its neighbours'.
The free design changes there abruptly from one station to the next; splines change smoothly. The
gain is small, comes from a range in which the theory is least certain, and makes a blade that
nobody would build. So with more than twenty stations chord and twist are splines of eight points
unless `design.chord_points` and `design.twist_points` give other numbers.

Iterations are those of the last optimization of a run; wall times have all of them. Roughness: the
largest difference of a station from the straight line between its neighbours, chord over the
largest chord and twist. Angle of attack over the stations, and axial induction a, at the mean tip
speed ratio.
"""


def main():
    """Run all variants, one after the other, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=Path, default=Path(__file__).parent.parent / "cases")
    parser.add_argument("--out", type=Path, default=Path("results/stations"))
    arguments = parser.parse_args()

    plan = {
        arguments.out / variant / law: load_case(
            arguments.cases / f"sine_limited_{law}.yaml", overrides
        )
        for variant, overrides in VARIANTS.items()
        for law in LAWS
    }
    # one at a time: the wall times count
    solutions = run_batch(
        plan, 1, lambda path, word: print(f"  {path}: {word}", flush=True), records=False
    )
    results = {variant: {} for variant in VARIANTS}
    for path, solution in solutions.items():
        results[path.parent.name][path.name] = _shown(solution)
    page_data.page_from("stations", from_data, results=results)


def _shown(solution):
    """Return what the page shows of a result."""
    chord, twist = _roughness(solution)
    low, high, inducing = _flow(solution)
    summary = solution.summary
    return {
        "success": solution.success,
        "energy_J": summary.simulated_energy_J,
        "iterations": summary.iterations,
        "wall_time_s": summary.wall_seconds,
        "roughness_of_chord": chord,
        "roughness_of_twist_deg": twist,
        "angle_of_attack_deg": [low, high],
        "high_induction_stations": inducing,
    }


def from_data(data):
    """Return the page of its data."""
    results = {(name, law): x for name, of in data["results"].items() for law, x in of.items()}
    energy = {key: each["energy_J"] for key, each in results.items()}

    def cost(variant, law):
        """Return the relative difference to the most stations, in per cent."""
        return 100.0 * (energy[variant, law] / energy[f"count_{COUNTS[-1]}", law] - 1.0)

    def effort(variant, law):
        one = results[variant, law]
        mark = "" if one["success"] else " (no success)"
        return f"{one['iterations']} iterations, {one['wall_time_s']:.1f} s{mark}"

    limits = {law: _limit([energy[f"count_{n}", law] for n in COUNTS]) for law in LAWS}
    lines = [HEAD, "## Refinement", ""]
    for law in LAWS:
        values = np.array([energy[f"count_{n}", law] for n in COUNTS])
        orders = ["", "", *(f"{order:.2f}" for order in _orders(values))]
        lines += [
            f"`sine_limited_{law}`:",
            "",
            f"| stations | energy, J | to {COUNTS[-1]} stations | observed order | effort |",
            "|---|---|---|---|---|",
        ]
        lines += [
            f"| {n} | {value:.1f} | {cost(f'count_{n}', law):+.3f} % | {order} | "
            f"{effort(f'count_{n}', law)} |"
            for n, value, order in zip(COUNTS, values, orders, strict=True)
        ]
        lines += [
            f"| → ∞ | {limits[law]:.1f} | {100.0 * (limits[law] / values[-1] - 1.0):+.3f} % | | |",
            "",
        ]
    lines += [
        "The order is log₂ of the ratio of successive differences; the last row extrapolates the",
        "last two by second order (Richardson).",
        "",
        WHY,
        "## What is shipped",
        "",
        f"| | {' | '.join(LAWS)} |",
        f"|---|{'---|' * len(LAWS)}",
    ]
    for label, variant in (
        (f"splines without stations given: {STATION_COUNT} stations", "points_6"),
        ("the paper's nine stations, splines", "paper"),
        ("the paper's nine stations, designed at each: the shipped cases", "paper_free"),
    ):
        cells = (
            f"{energy[variant, law]:.1f} J, {cost(variant, law):+.3f} %, {effort(variant, law)}"
            for law in LAWS
        )
        lines.append(f"| {label} | {' | '.join(cells)} |")
    lines += ["", *_shipped(cost, energy), "", RESOLVED, ""]

    lines += [
        "## Control points",
        "",
        f"{STATION_COUNT} stations, the default; relative to six control points.",
        "",
        "| control points of chord, of twist | " + " | ".join(LAWS) + " |",
        "|---|" + "---|" * len(LAWS),
    ]
    for n in POINTS:
        cells = (
            f"{energy[f'points_{n}', law]:.1f} J, "
            f"{100.0 * (energy[f'points_{n}', law] / energy['points_6', law] - 1.0):+.3f} %, "
            f"{effort(f'points_{n}', law)}"
            for law in LAWS
        )
        lines.append(f"| {n} | {' | '.join(cells)} |")
    gains = [
        100.0 * (energy[f"points_{POINTS[-1]}", law] / energy[f"points_{POINTS[0]}", law] - 1.0)
        for law in LAWS
    ]
    lines += [
        "",
        f"From {POINTS[0]} to {POINTS[-1]} control points the energy grows by {min(gains):.3f} to "
        f"{max(gains):.3f} %: more",
        "freedom gains little. Few points make a smooth blade and few iterations.",
        "",
        "## No splines",
        "",
        f"Chord and twist designed at each of {FREE} stations, beside six control points there.",
        "",
        "| | energy, J | over splines | effort | roughness | angle of attack | a > 0.5 |",
        "|---|---|---|---|---|---|---|",
    ]
    for law in LAWS:
        for label, variant in ((f"{law}, free", "free"), (f"{law}, splines", f"count_{FREE}")):
            over = 100.0 * (energy[variant, law] / energy[f"count_{FREE}", law] - 1.0)
            one = results[variant, law]
            low, high = one["angle_of_attack_deg"]
            lines.append(
                f"| {label} | {energy[variant, law]:.1f} | {over:+.3f} % | "
                f"{effort(variant, law)} | {one['roughness_of_chord']:.3f}, "
                f"{one['roughness_of_twist_deg']:.2f}° | {low:.1f} to {high:.1f}° | "
                f"{one['high_induction_stations']} stations |"
            )
    lines += [
        "",
        f"{sum(results['free', law]['success'] for law in LAWS)} of {len(LAWS)} free designs are a "
        "success.",
        "",
        FREE_WHY,
    ]
    return "\n".join(lines)


def _shipped(cost, energy):
    """Return what the numbers of the shipped cases mean."""
    worst = max(abs(cost("points_6", law)) for law in LAWS)
    low, high = sorted(-cost("paper", law) for law in LAWS)[:: len(LAWS) - 1]
    lines = [
        f"The default of {STATION_COUNT} stations is within {worst:.3f} % of {COUNTS[-1]}.",
        f"The paper's nine stations, r/R = 0.2, 0.3, … 0.9, 0.999, cost {low:.2f} to {high:.2f} % "
        "with the",
        "same splines; nine placed closer together towards hub and tip cost "
        f"{-cost('count_9', 'oloc'):.2f} %.",
        "",
        "This is an error of quadrature, which is nearly the same for all controllers, so their "
        "order stays:",
        "",
        "| stations | quadratic over open loop | linear over open loop |",
        "|---|---|---|",
    ]
    for label, variant in (
        ("the paper's nine, designed at each", "paper_free"),
        ("the paper's nine, splines", "paper"),
        *((str(n), f"count_{n}") for n in COUNTS),
    ):
        shares = (
            100.0 * (energy[variant, law] / energy[variant, "oloc"] - 1.0)
            for law in ("quadratic", "linear")
        )
        lines.append(f"| {label} | {' | '.join(f'{share:+.4f} %' for share in shares)} |")
    return lines


def _orders(values):
    """Return the observed orders of convergence of a sequence with doubled stations."""
    return [np.log2(a / b) for a, b in pairwise(np.diff(values))]


def _limit(values):
    """Return the limit that the last two values of a second-order sequence have."""
    return values[-1] + (values[-1] - values[-2]) / 3.0


def _roughness(solution):
    """Return how far stations stand off their neighbours: chord over its largest, twist in deg."""
    r = np.array(solution.summary.r_m)

    def off(values):
        values = np.array(values)
        share = (r[1:-1] - r[:-2]) / (r[2:] - r[:-2])
        return np.max(np.abs(values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:]))

    chord = np.array(solution.summary.chord_m)
    return float(off(chord) / np.max(chord)), float(off(solution.summary.twist_deg))


def _flow(solution):
    """Return smallest and largest angle of attack, deg, and how many stations have a > 0.5."""
    from hkt_mdo.problem.physics import physics
    from hkt_mdo.rotor import bem

    summary, physics_ = solution.summary, physics(solution.case)
    blade = physics_.blade.with_shape(summary.chord_m, np.deg2rad(summary.twist_deg))
    sections = bem.sections(blade, physics_.rotor.polar, summary.tip_speed_ratio.mean)
    angle = np.rad2deg(sections.angle_of_attack)
    high = np.count_nonzero(sections.axial_induction > 0.5)
    return float(angle.min()), float(angle.max()), int(high)


if __name__ == "__main__":
    main()
