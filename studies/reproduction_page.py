"""Results of `scripts/paper.py` on two pages: data of docs/studies/reproduction.md.

python studies/reproduction_page.py results/paper

Writes docs/data/reproduction.json from the paper.json in a folder of `scripts/paper.py`, and prints
the words in which docs/validation.md and docs/studies/reproduction.md, written by hand, give the
numbers (`shown`), and the rows of the table of certificates in docs/checks.md (`certificates`).
"""

import json
import sys
from pathlib import Path

import page_data

PARTS = "tables", "uncertain_flow", "sensor", "sequential"


def main():
    """Write the data, and print the words."""
    folder = Path(sys.argv[1])
    paper = json.loads((folder / "paper.json").read_text(encoding="utf-8"))
    gaps = {
        path.parent.name: json.loads(path.read_text(encoding="utf-8"))["certified_gap"]
        for path in sorted(folder.glob("cases/*/summary.json"))
    }
    parts = {name: paper[name] for name in PARTS}
    page_data.record("reproduction", paper=parts, certified_gap=gaps)
    data = page_data.read("reproduction")
    for text in (*shown(data), *certificates(data)):
        print(text)


def shown(data):
    """Return the words in which the page gives the numbers."""
    paper = data["paper"]
    flows, sensor = paper["uncertain_flow"], paper["sensor"]
    tables = step, free, _ = [paper["tables"][x] for x in ("step", "sine", "sine_limited")]
    lost = {
        law: [
            100.0 * (1.0 - flow[law]["energy_J"] / flow["oloc_redesigned"]["energy_J"])
            for flow in flows.values()
        ]
        for law in ("linear", "quadratic")
    }
    replayed, b, c = (flows[name]["oloc"] for name in "ABC")

    def cell(row, name, digits, unit=1.0):
        """Return a number of a table's row, in parentheses that of the paper."""
        values = (round(row[x] / unit, digits) + 0.0 for x in (name, f"reported_{name}"))
        return "{} ({})".format(*(f"{x:.{digits}f}" for x in values)).replace("-", "−")

    def gaps(table):
        """Return gap and gain of both laws."""
        cells = (table[law] for law in ("quadratic", "linear"))
        digits = (3, 2), (2, 1)
        pairs = zip(cells, digits, strict=True)
        return " | ".join(
            f"{cell(x, 'gap_percent', m)} | {cell(x, 'gain', n)}" for x, (m, n) in pairs
        )

    def stalls(law, reference, rate):
        """Return the fewest and the most stalled runs in flows B and C."""
        asked = dict(law=law, reference=reference, rate_Hz=rate)
        rows = [x for x in sensor if x["flow"] in "BC" and asked.items() <= x.items()]
        return sorted(row["stalled"] for row in rows)

    def spread(reference):
        """Return the smallest and the largest noise, rad/s."""
        sizes = [x["noise_deviation_rad_s"] for x in sensor if x["reference"] == reference]
        return f"{min(sizes):.2f} to {max(sizes):.2f} rad/s"

    few, many = stalls("linear", "total", 1000.0)
    slow = stalls("linear", "fluctuation", 10.0)
    return [
        *(f"{cell(table['oloc'], 'energy_J', 2, 1e3)} | {gaps(table)} |" for table in tables),
        f"| {cell(free['baseline_oloc'], 'gap_percent', 1)} |",
        f"co-design gains {paper['sequential']['sine_limited']['oloc']['gain_percent']:.1f} %",
        f"The replayed OLOC loses {-replayed['gap_percent']:.2f} % in flow A (paper 3.7 %) and "
        f"stalls in B (at {b['stopped_at_s']:.1f} s) and C (at {c['stopped_at_s']:.1f} s)",
        f"Linear feedback loses {', '.join(f'{x:.2f}' for x in lost['linear'])} %",
        f"Tables III and IV are {-free['oloc']['difference_percent']:.1f} % below the paper's",
        f"ours is {-free['baseline_oloc']['difference_percent']:.1f} % below the paper's",
        f"agree with Table II to {step['oloc']['difference_percent']:.2f} %",
        f"we find {step['linear']['gain']:.1f}",
        f"less than the {-step['linear']['gap_percent']:.2f} % that we find",
        f"loses {min(lost['quadratic']):.2f} to {max(lost['quadratic']):.2f} % here",
        spread("fluctuation"),
        spread("total"),
        f"linear feedback stalls in {slow[0]} of 20 runs in flows B and C",
        f"only linear feedback in B and C, in {few} to {many} of 20",
    ]


def certificates(data):
    """Return the rows of the table of certificates: open loop, quadratic, linear."""
    gap = data["certified_gap"]

    def percent(name, digits=3):
        return "0" if abs(gap[name]) < 1e-6 else f"{100.0 * gap[name]:.{digits}f} %"

    rows = []
    for flow, title in {"step": "step", "sine": "sine", "sine_limited": "sine, 700 N m"}.items():
        baseline = f" (baseline blade: {percent('sine_baseline_oloc')})" if flow == "sine" else ""
        cells = percent(f"{flow}_oloc") + baseline, percent(f"{flow}_quadratic")
        rows.append(f"| {title} | {' | '.join(cells)} | {percent(f'{flow}_linear', 2)} |")
    return rows


if __name__ == "__main__":
    main()
