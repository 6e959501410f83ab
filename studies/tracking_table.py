"""Energies under tracking and under open loop: writes the table of docs/studies/tracking.md.

python studies/tracking_table.py --out results/tracking    # some minutes; finished runs are reused
"""

import argparse
import re
from functools import partial
from pathlib import Path

import page_data
from study_common import NINE, markdown_table, percent

from hkt_mdo.case import load_case
from hkt_mdo.run.batch import run_batch

BEGIN, END = "<!-- by studies/tracking_table.py -->\n", "<!-- end of the table -->"
CASE = page_data.ROOT / "cases" / "sine_limited_oloc.yaml"
POWER = ("limits={power: 5 kW}", "start.branch=overspeed")
ROWS = {"700 N m": (), "700 N m and 5 kW, overspeed": POWER}
LAWS = {
    "open loop": (),
    "tracking, 8 knots": ("control={law: tracking, torque_limit: 700, knots: 8}",),
    "tracking, 12 knots, kp 300 N m s/rad, ki 6000 N m/rad": (
        "control={law: tracking, torque_limit: 700, knots: 12, proportional_gain: 300,"
        " integral_gain: 6000}",
    ),
}


def main():
    """Run what has no result yet, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/tracking"))
    out = parser.parse_args().out
    nine = f"rotor.stations={NINE}"
    cases = {
        out / re.sub(r"\W+", "_", f"{row}_{law}"): load_case(CASE, [nine, *limits, *changes])
        for row, limits in ROWS.items()
        for law, changes in LAWS.items()
    }
    solutions = [*run_batch(cases, 1, partial(print, flush=True), records=False).values()]
    results = {}
    for i, row in enumerate(ROWS):
        energies = [x.summary.simulated_energy_J if x and x.success else None for x in solutions]
        results[row] = dict(zip(LAWS, energies[i * len(LAWS) : (i + 1) * len(LAWS)], strict=True))
    page_data.page_from("tracking", from_data, simulated_energy_J=results)


def from_data(data):
    """Return the page with the table of its data."""
    rows = []
    for row, energies in data["simulated_energy_J"].items():
        rows.append([row, *(cell(each, energies["open loop"]) for each in energies.values())])
    table = "\n".join(markdown_table(["limits", *LAWS], rows))
    return page_data.between(page_data.text_of("tracking"), BEGIN, END, f"\n{table}\n\n")


def cell(energy, best):
    """Return an energy, and its difference from that of open loop."""
    if energy is None or best is None:
        return "refused"
    less = "" if energy == best else f" ({percent(energy, best):+.3f} %)"
    return f"{energy / 1e3:.2f} kJ{less}"


if __name__ == "__main__":
    main()
