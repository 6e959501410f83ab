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
    step, free, limited = (paper["tables"][name] for name in ("step", "sine", "sine_limited"))
    lost = {
        law: [
            100.0 * (1.0 - flow[law]["energy_J"] / flow["oloc_redesigned"]["energy_J"])
            for flow in flows.values()
        ]
        for law in ("linear", "quadratic")
    }
    most = max(-table["quadratic"]["gap_percent"] for table in (step, free, limited))
    replayed, b, c = (flows[name]["oloc"] for name in "ABC")
    k2, k1, k2_limited, k1_limited = (
        (table[law]["gain"], abs(table[law]["gain_difference_percent"]))
        for table in (free, limited)
        for law in ("quadratic", "linear")
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
        f"Quadratic feedback is within {most:.4f} % of OLOC in every table",
        f"linear is {-free['linear']['gap_percent']:.2f} % below it without a limit (0.60 %), "
        f"{-limited['linear']['gap_percent']:.2f} % with it (0.6 %)",
        f"K₂ = {k2[0]:.2f} (10.98, −{k2[1]:.1f} %), K₁ = {k1[0]:.1f} (90.90, −{k1[1]:.1f} %)",
        f"K₂ = {k2_limited[0]:.2f} (7.16, +{k2_limited[1]:.1f} %), "
        f"K₁ = {k1_limited[0]:.1f} (68.64, +{k1_limited[1]:.1f} %)",
        f"co-design gains {paper['sequential']['sine_limited']['oloc']['gain_percent']:.1f} %",
        f"The replayed OLOC loses {-replayed['gap_percent']:.2f} % in flow A (paper 3.7 %) and "
        f"stalls in B (at {b['stopped_at_s']:.1f} s) and C (at {c['stopped_at_s']:.1f} s)",
        f"Linear feedback loses {', '.join(f'{x:.2f}' for x in lost['linear'])} %",
        f"Tables III and IV are {-free['oloc']['difference_percent']:.1f} % below the paper's",
        f"is {-free['baseline_oloc']['gap_percent']:.1f} % below OLOC (paper 6.0 %)",
        f"our baseline is {-free['baseline_oloc']['difference_percent']:.1f} % below the paper's",
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
