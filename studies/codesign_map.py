"""When does co-design beat sequential design? Writes docs/studies/codesign_map.md.

python studies/codesign_map.py --out results/codesign

Finished results are used again. About half an hour on two cores. --page writes the page and its
figure from docs/data/codesign_map.csv alone, without any run.
"""

import argparse
import csv
import math
import textwrap
from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay
from study_common import NINE, markdown_table, with_blade

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.results import style
from hkt_mdo.run.batch import run_batch

ROOT = Path(__file__).parent.parent
DATA = ROOT / "docs" / "data" / "codesign_map.csv"
PAGE = ROOT / "docs" / "studies" / "codesign_map.md"
IMAGE = "../images/codesign_map.png"
MEAN, AMPLITUDE, PERIOD = 1.5, 0.3, 10.0  # m/s, m/s, s
SWING = AMPLITUDE / MEAN
SHARES = {"torque": (0.7, 2.3), "power": (0.8, 2.6)}  # of the limit: its range over the map
BETAS = 0.05, 8.0
FIRST, POINTS, ROUNDS = 7, 100, 4  # first points a side; all of them; rounds of refinement
SEGMENTS = 24  # of the collocation, twice as many where a run is refused
TOLD = 1e-4  # share of the energy from which a gain counts
NEARLY = 1e-6  # share of the energy to which two runs agree
COLUMNS = (
    *("limit", "share", "beta", "limit_SI", "hub_inertia_kg_m2", "sequential_J", "codesign_J"),
    *("start", "verified", "segments"),
)


class Rotor:
    """The paper's rotor with the blade of the largest steady power coefficient."""

    def __init__(self):
        physics_ = physics(case({}, 0.0))
        best = physics_.rotor.best_of_shape(physics_.shape, physics_.blade)
        self.blade, self.ratio = best.blade, best.tip_speed_ratio
        radius = self.blade.rotor_radius
        self.speed = self.ratio * MEAN / radius
        area = math.pi * radius**2
        self.power = 0.5 * physics_.density * area * MEAN**3 * best.power_coefficient
        self.torque = self.power / self.speed
        self.inertia = physics_.rotor.mass_and_inertia(self.blade)[1]
        self.nominal = {"torque": self.torque, "power": self.power}

    def cases(self, limit, share, beta, segments):
        """Return the co-design at a point of the map, and the law alone on the blade."""
        inertia = beta * PERIOD / (2.0 * math.pi) * self.torque / self.speed
        hub = max(0.0, inertia - self.inertia)
        together = case({limit: share * self.nominal[limit]}, hub, segments)
        twist = np.rad2deg(self.blade.twist)
        return together, with_blade(together, self.blade.chord, twist, "fixed")


def case(limits, hub_inertia, segments=SEGMENTS):
    """Return the paper's rotor under open loop over one closed cycle of a sine."""
    return load_case(
        {
            "rotor": {"stations": NINE, "set_angle": 5, "hub_inertia": hub_inertia},
            "inflow": {
                "profile": "sine",
                "mean": MEAN,
                "amplitude": AMPLITUDE,
                "angular_frequency": 2.0 * math.pi / PERIOD,
            },
            "control": "open_loop",
            "limits": limits,
            "phase": {"duration": PERIOD, "segments": segments, "final_speed": "initial"},
        }
    )


def main():
    """Run every point that has no result yet, and write the data and the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/codesign"))
    parser.add_argument("--jobs", type=int, default=None, help="processes (default: one a core)")
    parser.add_argument("--points", type=int, default=POINTS, help="of each limit")
    parser.add_argument("--page", action="store_true", help="write the page from the data alone")
    arguments = parser.parse_args()
    if not arguments.page:
        rotor, maps = Rotor(), {limit: {} for limit in SHARES}
        for round_ in range(ROUNDS + 1):
            asked, segments = [], SEGMENTS
            for limit, of_limit in maps.items():
                if round_ < ROUNDS:
                    places = chosen(limit, of_limit, arguments.points, round_)
                else:  # where a run was refused, on a finer mesh
                    places = [key for key, row in of_limit.items() if row["verified"] == "no"]
                    segments = 2 * SEGMENTS
                asked += [(limit, *point) for point in places]
            rows = run(rotor, asked, arguments.out.absolute(), arguments.jobs, segments)
            for key, row in rows.items():
                maps[key[0]][key[1:]] = row
            save([row for each in maps.values() for _, row in sorted(each.items())])
    write_page()


def save(rows):
    """Write the data."""
    DATA.parent.mkdir(exist_ok=True)
    with DATA.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


# The points ---------------------------------------------------------------------------------------


def chosen(limit, rows, points, round_):
    """Return the points of a round: a grid first, then where the answer changes most."""
    low, high = SHARES[limit]
    if round_ == 0:
        across = np.geomspace(*BETAS, FIRST)
        grid = [(y, x) for y in np.linspace(low, high, FIRST) for x in across]
        return [(round(float(y), 4), float(f"{x:.4g}")) for y, x in grid]
    count = (points - len(rows)) // (ROUNDS - round_)
    places = np.array([*rows])
    span = math.log(BETAS[1] / BETAS[0])
    flat = np.c_[(places[:, 0] - low) / (high - low), np.log(places[:, 1] / BETAS[0]) / span]
    answers = np.array([answer(row) for row in rows.values()])
    corners = Delaunay(flat).simplices
    edges = {
        tuple(sorted(pair)) for x in corners for pair in ((x[0], x[1]), (x[1], x[2]), (x[0], x[2]))
    }
    edges = np.array(sorted(edges))
    change = np.abs(np.diff(answers[edges], axis=1)[:, 0])
    length = np.linalg.norm(flat[edges[:, 0]] - flat[edges[:, 1]], axis=1)
    middles = {}
    for index in np.argsort(-change * length):
        middle = flat[edges[index]].mean(axis=0)
        share = round(float(low + middle[0] * (high - low)), 4)
        beta = float(f"{BETAS[0] * (BETAS[1] / BETAS[0]) ** middle[1]:.4g}")
        if (share, beta) not in rows and all(
            np.linalg.norm(middle - other) > 0.03 for other in middles.values()
        ):
            middles[share, beta] = middle
        if len(middles) == count:
            break
    return list(middles)


def answer(row):
    """Return the gain of co-design on a scale on which 0.01 % and 10 % are three apart."""
    return math.log10(max(gain(row), TOLD)) if row["verified"] == "yes" else 0.0


def gain(row):
    """Return the gain of co-design, as a share of the energy of sequential design."""
    return float(row["codesign_J"] or "nan") / float(row["sequential_J"] or "nan") - 1.0


def run(rotor, asked, out, jobs, segments):
    """Return the row of each point asked; co-design begins twice, also at the sequential design."""

    def in_turn(plan):
        return run_batch(plan, jobs, lambda folder, word: print(folder, word, flush=True), False)

    cases = {key: rotor.cases(*key, segments) for key in asked}
    finer = "" if segments == SEGMENTS else f"_{segments}"
    folder = {key: out / key[0] / f"{key[1]:g}_{key[2]:g}{finer}" for key in asked}
    plan = {}
    for key, (together, alone) in cases.items():
        plan |= {folder[key] / "sequential": alone, folder[key] / "codesign": together}
    solutions = in_turn(plan)
    again = {}
    for key, (together, _) in cases.items():
        first = solutions[folder[key] / "sequential"]
        if first is not None and first.success:
            start = together.start.model_copy(update={"from_": str(first.folder)})
            again[folder[key] / "from_sequential"] = together.model_copy(update={"start": start})
    solutions |= in_turn(again)
    rows = {}
    for key, (together, _) in cases.items():
        energy = {
            name: solution.summary.simulated_energy_J
            for name in ("sequential", "codesign", "from_sequential")
            if (solution := solutions.get(folder[key] / name)) is not None and solution.success
        }
        best = max(("codesign", "from_sequential"), key=lambda name: energy.get(name, 0.0))
        won = energy.get("from_sequential", 0.0) > energy.get("codesign", 0.0) * (1.0 + NEARLY)
        rows[key] = dict(zip(COLUMNS, (
            *key, f"{key[1] * rotor.nominal[key[0]]:.6g}", f"{together.rotor.hub_inertia:.6g}",
            energy.get("sequential", ""), energy.get(best, ""),
            "sequential design" if won else "own",
            "yes" if "sequential" in energy and best in energy else "no", segments,
        ), strict=True))  # fmt: skip
    return rows


# Theory -------------------------------------------------------------------------------------------

ANGLE = np.linspace(0.0, 2.0 * np.pi, 3601)


def tracking(beta):
    """Return torque and power, over those at mean flow, that keep the best tip speed ratio."""
    flow = 1.0 + SWING * np.sin(ANGLE)
    torque = flow**2 - np.multiply.outer(beta, SWING * np.cos(ANGLE))
    return {"torque": torque, "power": torque * flow}


def limit_that_binds(limit, beta):
    """Return the largest limit, over its value at mean flow, that binds."""
    return np.max(tracking(beta)[limit], axis=-1)


def slowest():
    """Return the product beyond which the generator would have to drive the rotor."""
    flow, slope = 1.0 + SWING * np.sin(ANGLE), SWING * np.cos(ANGLE)
    return float(np.min(flow[slope > 0.0] ** 2 / slope[slope > 0.0]))


def free(row):
    """Return whether no limit binds, so that no design is better than the sequential one."""
    beta = float(row["beta"])
    return float(row["share"]) >= limit_that_binds(row["limit"], beta) and beta <= slowest()


def full(row):
    """Return whether the sequential design gives the power of the limit throughout the cycle."""
    most = float(row["limit_SI"]) * PERIOD
    return row["limit"] == "power" and float(row["sequential_J"]) > (1.0 - TOLD) * most


# The page -----------------------------------------------------------------------------------------

THEORY = """\
With the best tip speed ratio λ* and the largest power coefficient of the sequential blade, let
Q̄ and P̄ be torque and power at the mean flow v̄, ω̄ = λ* v̄ / R the speed there, and

$$
\\begin{aligned}
v(t) &= \\bar v\\,(1 + a \\sin\\varphi), \\qquad \\varphi = w t, \\\\
T &= J \\bar\\omega / \\bar Q, \\qquad \\beta = T w.
\\end{aligned}
$$

The flow has the amplitude a over the mean and the angular frequency w. T is the rotor's time
constant: at a constant generator torque, its speed returns as exp(-t/T), since the torque's slope
at λ* is dQ/dω = -Q̄/ω̄. β is the time constant times the bandwidth of the flow.

The energy of any blade and any control over a closed cycle is at most that of the largest power
coefficient at every instant. The sequential blade reaches it if its rotor keeps λ* throughout, so
that ω = λ* v / R. From J dω/dt = Q - u this takes the generator torque and power

$$
\\begin{aligned}
u / \\bar Q &= (1 + a \\sin\\varphi)^2 - \\beta a \\cos\\varphi, \\\\
u \\omega / \\bar P &= \\left((1 + a \\sin\\varphi)^2 - \\beta a \\cos\\varphi\\right)
(1 + a \\sin\\varphi).
\\end{aligned}
$$

**While 0 ≤ u, and u, or u ω, is within the limit at every instant, no co-design can be better.**
Hence the two lines of the map: a limit below τ of the torque, over Q̄, or π of the power, over P̄,

$$
\\begin{aligned}
\\tau(\\beta) &= \\max_\\varphi\\, (1 + a \\sin\\varphi)^2 - \\beta a \\cos\\varphi, \\\\
\\pi(\\beta) &= \\max_\\varphi\\,
\\left((1 + a \\sin\\varphi)^2 - \\beta a \\cos\\varphi\\right) (1 + a \\sin\\varphi)
\\end{aligned}
$$

binds, and beyond β₀ = min over φ of (1 + a sin φ)² / (a cos φ), where cos φ > 0, the generator
would have to drive the rotor. For small β the lines begin at (1 + a)² and (1 + a)³, the torque and
the power in the fastest flow; for large β they rise with a β, the torque that slows the rotor down
with the flow.

Below a line both designs lose energy. Their blades differ if, to first order, another blade loses
less. Let μ be the multiplier of the limit in slow operation (β → 0), where u = Q. At an instant at
the limit the Lagrange function is P + μ (limit - Q), or P + μ (limit - P), and with the torque's
slope Q' = dQ/dω < 0 the best speed has

$$
\\begin{aligned}
\\frac{d(Q \\omega)}{d\\omega} &= \\mu Q', & \\mu &= \\omega + \\frac{Q}{Q'}
&& \\text{under a torque limit,} \\\\
\\frac{d(Q \\omega)}{d\\omega} &= \\mu \\frac{d(Q \\omega)}{d\\omega}, & \\mu &= 1
&& \\text{under a power limit.}
\\end{aligned}
$$

The slope over a parameter b of the blade is (ω - μ) ∂Q/∂b = -(Q/Q') ∂Q/∂b under a torque limit,
which is zero at λ* and not elsewhere, and (1 - μ) ∂P/∂b = 0 under a power limit.

So **under a torque limit below τ(0) the two designs differ**: a blade made for a higher tip speed
ratio gives the same power with less torque. **Under a power limit they do not differ as long as the
rotor is fast**: every blade gives the power of the limit while it binds, and the sequential blade
gives the most while it does not. Under a power limit only the rotor's inertia makes the designs
differ: between operation at the limit and operation at λ* the speed has to change, which takes
torque. Where the limit is below the mean power of the flow and the rotor is heavy, both designs
give the same energy again: the energy of rotation carries the rotor through the slow flow, both
give the power of the limit throughout the cycle, and no design can give more.
"""


def read():
    """Return the rows of the data."""
    with DATA.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def write_page():
    """Write the page and its figure from the data."""
    rows = read()
    draw(rows, PAGE.parent / IMAGE)
    lines = [
        "# When does co-design beat sequential design?",
        "",
        "Written by `python studies/codesign_map.py` from `docs/data/codesign_map.csv`, which the "
        "same command computes.",
        "",
        *summary(rows),
        "",
        f"![Gain of co-design over sequential design]({IMAGE})",
        "",
        "*Gain in energy, per cent, at verified points (dots; small ones: less than "
        f"{100 * TOLD:g} %), interpolated between them. Above the solid line and left of the "
        "dashed one, no limit binds if the sequential blade keeps its best tip speed ratio.*",
        "",
        "## What was compared",
        "",
        *compared(rows),
        "",
        "## Where the two designs must differ",
        "",
        THEORY,
        "## How the runs agree with it",
        "",
        *agreement(rows),
        "",
    ]
    wrapped = [
        line
        if line.startswith(("|", "#", "!", " ")) or "\n" in line
        else textwrap.fill(line, 100, subsequent_indent="  " if line.startswith("- ") else "")
        for line in lines
    ]
    PAGE.write_text("\n".join(wrapped), encoding="utf-8")
    print(f"wrote {PAGE}")


def of(rows, limit, *, kept=None):
    """Return the verified rows of a limit; `kept`: those where no limit binds, or one does."""
    chosen = [row for row in rows if row["limit"] == limit and row["verified"] == "yes"]
    return [row for row in chosen if kept is None or free(row) == kept]


def summary(rows):
    """Yield the answer in a few sentences."""
    fast = {x: [row for row in of(rows, x, kept=False) if float(row["beta"]) < 0.1] for x in SHARES}
    most = {limit: max(of(rows, limit), key=gain) for limit in SHARES}
    gains = "; ".join(
        f"{limit} limit {float(row['share']):.2f} and β {float(row['beta']):.2g}: "
        f"{100 * gain(row):.1f} %"
        for limit, row in most.items()
    )
    power = max(map(gain, fast["power"]))
    yield (
        "- With a **torque limit**: as soon as the limit is below the torque at the best tip speed "
        f"ratio in the fastest flow, (1 + a)² = {(1 + SWING) ** 2:.2f} times that in the mean flow."
    )
    yield (
        "- With a **power limit**: hardly at all while the rotor is fast (at most "
        f"{100 * power:.2f} % for β < 0.1), since every blade gives the power of the limit; the "
        "gain comes with the rotor's inertia."
    )
    yield (
        "- **Without a binding limit**: not at all, for any time constant up to β₀ = "
        f"{slowest():.2f}, beyond which the generator would have to drive the rotor."
    )
    yield f"- The largest gains on the map: {gains}."


def compared(rows):
    """Yield what was run."""
    verified = {limit: len(of(rows, limit)) for limit in SHARES}
    asked = {limit: sum(row["limit"] == limit for row in rows) for limit in SHARES}
    won = sum(row["start"] != "own" for row in rows)
    yield (
        "The paper's rotor (R = 1.4 m, nine stations) under open loop, over one closed cycle of "
        f"v = {MEAN:g} + {AMPLITUDE:g} sin(2π t / {PERIOD:g} s) m/s, so a = {SWING:g}. The rotor's "
        "time constant is set by the inertia of hub and generator. Only one limit holds at a time: "
        "of the generator's torque, or of its power; the torque is never negative."
    )
    yield ""
    yield (
        "*Sequential design*: the blade for the largest steady power coefficient, then the law on "
        "it under the limits. *Co-design*: blade and law together under the same limits. Co-design "
        "runs twice, from its own start and from the sequential design, and the better verified "
        f"result counts: that from the sequential design in {won} of {len(rows)} points."
    )
    yield ""
    finer = sum(int(row["segments"]) > SEGMENTS for row in rows)
    counts = ", ".join(f"{verified[x]} of {asked[x]} with a {x} limit" for x in SHARES)
    yield (
        "Each point is two energies of the independent integration with direct BEM, both runs "
        f"verified by every check: {counts}. After a grid of {FIRST} × {FIRST} the other points "
        "were placed where the gain changes most. Where a run was refused, both were run again on "
        f"twice as many segments ({finer} of {len(rows)} points)."
    )


def agreement(rows):
    """Yield how the runs agree with theory."""
    table = []
    for limit in SHARES:
        inside, outside = of(rows, limit, kept=True), of(rows, limit, kept=False)
        near = [row for row in outside if gain(row) < TOLD]
        bands = []
        for low, high in ((0.0, 0.1), (0.1, 1.0), (1.0, slowest()), (slowest(), np.inf)):
            gains = [gain(row) for row in outside if low <= float(row["beta"]) < high]
            bands.append(f"{100 * max(gains):.2f}" if gains else "-")
        table.append(
            (limit, str(len(inside)), f"{100 * max(map(gain, inside)):.0e}", str(len(outside)),
             str(len(near)), *bands)
        )  # fmt: skip
    header = (
        *(
            "limit",
            "no limit binds",
            "largest gain, %",
            "a limit binds",
            f"gain < {100 * TOLD:g} %",
        ),
        *("β < 0.1: largest, %", "0.1 to 1", "1 to β₀", "> β₀"),
    )
    yield "\n".join(markdown_table(header, table))
    yield ""
    most = [row for row in of(rows, "power") if full(row)]
    bad = [row for row in rows if row["verified"] == "yes" and free(row) and gain(row) > TOLD]
    word = "no point contradicts it" if not bad else f"{len(bad)} points contradict it"
    yield (
        "Where no limit binds, theory allows no gain: the second column of numbers is numerical "
        f"error, and {word}. Points where a limit binds and the gain is small lie "
        "beside the line, where it grows from zero, or, with a power limit, at small β, or where "
        f"the sequential design gives the power of the limit throughout ({len(most)} points, the "
        f"largest gain {100 * max(map(gain, most)):.0e} %)."
    )
    yield ""
    least = min((row for row in rows if row["verified"] == "yes"), key=gain)
    yield (
        "A sequential design is one of the possible co-designs, so a gain below zero is numerical "
        f"error: the smallest of all points is {100 * gain(least):.0e} %."
    )


def draw(rows, path):
    """Draw the gain over both maps."""
    from matplotlib.figure import Figure

    sheet = Figure(figsize=(9.6, 4.4), layout="constrained")
    betas = np.geomspace(*BETAS, 200)
    levels = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0]
    ends = {"vmin": math.log10(levels[0]), "vmax": math.log10(levels[-1]), "cmap": "viridis"}
    ticks = [0.05, 0.1, 0.2, 0.5, 1, 2, 4, 8]
    for ax, limit in zip(sheet.subplots(1, 2), SHARES, strict=True):
        points = of(rows, limit)
        beta, share = (np.array([float(row[x]) for row in points]) for x in ("beta", "share"))
        gains, across = 100.0 * np.array([gain(row) for row in points]), np.log10(beta)
        least = np.log10(np.clip(gains, 0.5 * levels[0], None))
        filled = ax.tricontourf(across, share, least, np.log10(levels), alpha=0.85, **ends)
        small = gains < 100.0 * TOLD
        ax.plot(across[small], share[small], ".", color="0.4", markersize=2.5)
        look = {"s": 22, "edgecolor": "k", "linewidth": 0.4, **ends}
        ax.scatter(across[~small], share[~small], c=least[~small], **look)
        ax.plot(np.log10(betas), limit_that_binds(limit, betas), "k-", linewidth=1.6)
        ax.axvline(np.log10(slowest()), color="k", linestyle="--", linewidth=1.2)
        ax.text(np.log10(slowest()) - 0.02, SHARES[limit][0] + 0.04, "β₀", ha="right")
        above = limit_that_binds(limit, BETAS[0]) + 0.05
        ax.text(np.log10(BETAS[0]) + 0.05, above + 0.05, "no limit binds")
        words = f"{limit} limit over the {limit} at\nthe best tip speed ratio in mean flow"
        style.finish(ax, "β: time constant of the rotor × frequency of the flow", words)
        ax.set_xticks(np.log10(ticks), [f"{tick:g}" for tick in ticks])
        ax.set_xlim(*np.log10(BETAS))
        ax.set_ylim(SHARES[limit])
    bar = sheet.colorbar(filled, ax=sheet.axes, label="gain of co-design, %", shrink=0.9)
    bar.set_ticks(np.log10(levels), labels=[f"{level:g}" for level in levels])
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.savefig(path, dpi=130)


if __name__ == "__main__":
    main()
