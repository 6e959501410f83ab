"""Energies under tracking and under open loop: writes the table of docs/controllers.md.

python scripts/tracking_table.py --out results/tracking    # some minutes; finished runs are reused
"""

import argparse
import os
import re
from functools import partial
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import page_data

from hkt_mdo.case import load_case
from hkt_mdo.run.batch import run_batch
from hkt_mdo.studies.common import markdown_table, percent

PAGE = page_data.ROOT / "docs" / "controllers.md"
BEGIN, END = "<!-- by scripts/tracking_table.py -->\n", "<!-- end of the table -->"
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
    cases = {
        out / re.sub(r"\W+", "_", f"{row}_{law}"): load_case(CASE, ["version=1", *limits, *changes])
        for row, limits in ROWS.items()
        for law, changes in LAWS.items()
    }
    found = [*run_batch(cases, 1, partial(print, flush=True), records=False).values()]
    rows = []
    for i, row in enumerate(ROWS):
        results = found[i * len(LAWS) : (i + 1) * len(LAWS)]
        energies = [x.summary.simulated_energy_J if x and x.success else None for x in results]
        rows.append([row, *(cell(each, energies[0]) for each in energies)])
    table = "\n".join(markdown_table(["limits", *LAWS], rows))
    head, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    text = f"{head}{BEGIN}\n{table}\n\n{END}{rest.partition(END)[2]}"
    PAGE.write_text(text, encoding="utf-8")


def cell(energy, best):
    """Return an energy, and its difference from that of open loop."""
    if energy is None or best is None:
        return "refused"
    less = "" if energy == best else f" ({percent(energy, best):+.3f} %)"
    return f"{energy / 1e3:.2f} kJ{less}"


if __name__ == "__main__":
    main()
    page_data.record("controllers")
