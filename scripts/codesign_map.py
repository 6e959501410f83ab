"""When does co-design beat sequential design? Runs the map, and writes docs/codesign_map.md.

python scripts/codesign_map.py --out results/codesign

Finished results are used again. About half an hour on two cores. --page writes the page and its
figure from docs/data/codesign_map.csv alone, without any run.
"""

import argparse
import csv
import math
import os
import textwrap
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
from scipy.spatial import Delaunay

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.results import style
from hkt_mdo.run.batch import run_batch
from hkt_mdo.start.find import steady_optimum
from hkt_mdo.studies.common import markdown_table, with_blade

ROOT = Path(__file__).parent.parent
DATA, PAGE = ROOT / "docs" / "data" / "codesign_map.csv", ROOT / "docs" / "codesign_map.md"
IMAGE = "images/codesign_map.png"
MEAN, AMPLITUDE, PERIOD = 1.5, 0.3, 10.0  # m/s, m/s, s
SWING = AMPLITUDE / MEAN
SHARES = {"torque": (0.7, 2.3), "power": (0.8, 2.6)}  # of the limit: its range over the map
BETAS = 0.05, 8.0
FIRST, POINTS, ROUNDS = 7, 100, 4  # first points a side; all of them; rounds of refinement
TOLD = 1e-4  # share of the energy from which a gain counts
NEARLY = 1e-6  # share of the energy to which two runs agree
COLUMNS = (
    *("limit", "share", "beta", "limit_SI", "hub_inertia_kg_m2", "sequential_J", "codesign_J"),
    *("start", "verified"),
)


class Rotor:
    """The paper's rotor with the blade of the largest steady power coefficient."""

    def __init__(self):
        world = physics(case({}, 0.0))
        best = steady_optimum(world, world.blade)
        self.blade, self.ratio = best.blade, best.tip_speed_ratio
        radius = self.blade.rotor_radius
        self.speed = self.ratio * MEAN / radius
        area = math.pi * radius**2
        self.power = 0.5 * world.density * area * MEAN**3 * best.power_coefficient
        self.torque = self.power / self.speed
        self.inertia = world.mass_and_inertia(self.blade)[1]
        self.own = {"torque": self.torque, "power": self.power}

    def cases(self, limit, share, beta):
        """Return the co-design at a point of the map, and the law alone on the blade."""
        inertia = beta * PERIOD / (2.0 * math.pi) * self.torque / self.speed
        hub = max(0.0, inertia - self.inertia)
        together = case({limit: share * self.own[limit]}, hub)
        twist = np.rad2deg(self.blade.twist)
        return together, with_blade(together, self.blade.chord, twist, "fixed")


def case(limits, hub_inertia):
    """Return the paper's rotor under open loop over one closed cycle of a sine."""
    return load_case(
        {
            "version": 1,
            "rotor": {"set_angle": 5, "hub_inertia": hub_inertia},
            "inflow": {
                "profile": "sine",
                "mean": MEAN,
                "amplitude": AMPLITUDE,
                "angular_frequency": 2.0 * math.pi / PERIOD,
            },
            "control": "open_loop",
            "limits": limits,
            "phase": {"duration": PERIOD, "segments": 24, "final_speed": "initial"},
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
        rotor, known = Rotor(), {limit: {} for limit in SHARES}
        for round_ in range(ROUNDS):
            asked = [
                (limit, *place)
                for limit in SHARES
                for place in chosen(limit, known[limit], arguments.points, round_)
            ]
            for key, row in run(rotor, asked, arguments.out.absolute(), arguments.jobs).items():
                known[key[0]][key[1:]] = row
            rows = [row for of in known.values() for _, row in sorted(of.items())]
            DATA.parent.mkdir(exist_ok=True)
            with DATA.open("w", encoding="utf-8", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
                writer.writeheader()
                writer.writerows(rows)
    write_page()


# The points ---------------------------------------------------------------------------------------


def chosen(limit, known, points, round_):
    """Return the points of a round: a grid first, then where the answer changes most."""
    low, high = SHARES[limit]
    if round_ == 0:
        across = np.geomspace(*BETAS, FIRST)
        grid = [(y, x) for y in np.linspace(low, high, FIRST) for x in across]
        return [(round(float(y), 4), float(f"{x:.4g}")) for y, x in grid]
    count = (points - len(known)) // (ROUNDS - round_)
    places = np.array([*known])
    flat = np.c_[
        (places[:, 0] - low) / (high - low), np.log(places[:, 1] / BETAS[0]) / np.log(BETAS[1] / BETAS[0])
    ]  # fmt: skip
    answers = np.array([answer(row) for row in known.values()])
    corners = Delaunay(flat).simplices
    edges = {
        tuple(sorted(pair)) for x in corners for pair in ((x[0], x[1]), (x[1], x[2]), (x[0], x[2]))
    }
    edges = np.array(sorted(edges))
    change = np.abs(np.diff(answers[edges], axis=1)[:, 0])
    length = np.linalg.norm(flat[edges[:, 0]] - flat[edges[:, 1]], axis=1)
    found = {}
    for place in np.argsort(-change * length):
        middle = flat[edges[place]].mean(axis=0)
        share = round(float(low + middle[0] * (high - low)), 4)
        beta = float(f"{BETAS[0] * (BETAS[1] / BETAS[0]) ** middle[1]:.4g}")
        if (share, beta) not in known and all(
            np.linalg.norm(middle - each) > 0.03 for each in found.values()
        ):
            found[share, beta] = middle
        if len(found) == count:
            break
    return list(found)


def answer(row):
    """Return the gain of co-design on a scale on which 0.01 % and 10 % are three apart."""
    return math.log10(max(gain(row), TOLD)) if row["verified"] == "yes" else 0.0


def gain(row):
    """Return the gain of co-design, as a share of the energy of sequential design."""
    return float(row["codesign_J"] or "nan") / float(row["sequential_J"] or "nan") - 1.0


def run(rotor, asked, out, jobs):
    """Return the row of each point asked; co-design begins twice, also at the sequential design."""

    def in_turn(plan):
        return run_batch(plan, jobs, lambda folder, word: print(folder, word, flush=True), False)

    cases = {key: rotor.cases(*key) for key in asked}
    folder = {key: out / key[0] / f"{key[1]:g}_{key[2]:g}" for key in asked}
    plan = {}
    for key, (together, alone) in cases.items():
        plan |= {folder[key] / "sequential": alone, folder[key] / "codesign": together}
    found = in_turn(plan)
    again = {}
    for key, (together, _) in cases.items():
        first = found[folder[key] / "sequential"]
        if first is not None and first.success:
            start = together.start.model_copy(update={"from_": str(first.folder)})
            again[folder[key] / "from_sequential"] = together.model_copy(update={"start": start})
    found |= in_turn(again)
    rows = {}
    for key, (together, _) in cases.items():
        energy = {
            name: each.summary.simulated_energy_J
            for name in ("sequential", "codesign", "from_sequential")
            if (each := found.get(folder[key] / name)) is not None and each.success
        }
        best = max(("codesign", "from_sequential"), key=lambda name: energy.get(name, 0.0))
        won = energy.get("from_sequential", 0.0) > energy.get("codesign", 0.0) * (1.0 + NEARLY)
        rows[key] = dict(zip(COLUMNS, (
            *key, f"{key[1] * rotor.own[key[0]]:.6g}", f"{together.rotor.hub_inertia:.6g}",
            energy.get("sequential", ""), energy.get(best, ""),
            "sequential design" if won else "own",
            "yes" if "sequential" in energy and best in energy else "no",
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
