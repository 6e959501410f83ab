"""How close each feedback law comes to open loop in the sine: runs the study, writes its page.

python studies/laws_study.py --out results/laws

Finished results are used again. About an hour on two cores. The page is written from
docs/data/laws.json, without any run also by `python studies/page_data.py --write laws`.
"""

import argparse
import os
from functools import partial
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
import page_data
from study_common import markdown_table, percent, run_nested, with_blade

from hkt_mdo.case import load_case
from hkt_mdo.results import style
from hkt_mdo.results.nesting import dominated
from hkt_mdo.results.panel import COLORS

LAWS = {
    "open loop": "law: open_loop",
    "linear": "law: linear",
    "quadratic": "law: quadratic",
    "power law": "law: power_law",
    "rated": "law: rated",
    "curve, 4 knots": "law: curve, knots: 4",
    "curve, 6 knots": "law: curve, knots: 6",
    "curve, 8 knots": "law: curve, knots: 8",
    "tracking": "law: tracking",
}
POWER = "power: 5 kW"
EXTRA = "rotor_speed: 11 rad/s, stress: 100 MPa, cavitation: {depth: 3}"
LIMITS = {  # control.torque_limit, limits
    "none": ("null", ""),
    "700 N m": ("700", ""),
    "and 5 kW": ("700", POWER),
    "and 6.5 kN": ("700", f"{POWER}, thrust: 6.5 kN"),
    "all": ("700", f"{POWER}, thrust: 6.5 kN, {EXTRA}"),
}
TITLES = {
    "none": "No limit",
    "700 N m": "700 N m of generator torque",
    "and 5 kW": "700 N m and 5 kW",
    "and 6.5 kN": "700 N m, 5 kW and 6.5 kN of thrust",
    "all": "All: 700 N m, 5 kW, 6.5 kN, 11 rad/s, 100 MPa, no cavitation at 3 m",
}
BLADES = "designed", "kept"
SHOWN = "simulated_energy_J", "generator_energy_J", "tip_speed_ratio", "loads", "r_m", "chord_m"
NEAR, LEAST = 0.1, 5e-4  # per cent of open loop's energy: a line of the figure, and its lower end
FOOT = f"\u00d7: refused by its checks; the shortest bars: less than {LEAST:g} %"
IMAGE = "../images/laws.png"

HEAD = f"""\
# How close does each feedback law come to open loop?

Written by `python studies/laws_study.py`: the paper's rotor on 40 stations in the sine, blade and
law designed together (*designed*), or the law alone with the blade of open loop under the same
limits (*kept*). Energies are captured, by integrations with direct BEM; 'all' is 700 N m, 5 kW,
6.5 kN, 11 rad/s, 100 MPa and no cavitation at 3 m. Open loop ends at the speed at which it began,
other laws do not: what more they capture is left in the rotor; the last table has delivered
energies. 'Refused' marks a run that its checks refused: with a blade kept, open loop keeps the
limits and the law does not. A case that allows a better result of another one is run again from
that design: with 5 kW `tracking` ends 0.4 % lower by itself, since its torque jumps on the better
branch (`--set start.branch=underspeed`).

Under a limit of the power, choose a law that changes to constant power by overspeed, `rated` or
`curve`. Static laws lose most where open loop slows the rotor to keep a limit (underspeed), as it
does with 5 kW and a limit of the thrust: no law of the speed alone is stable there with induction
in equilibrium. With dynamic inflow, laws that hold the torque or the power constant let a light
rotor run away ([memory.md](memory.md)); the designs of this page do not include it.

![energy below open loop]({IMAGE})

"""


def main():
    """Run everything that has no result yet, and write figure, page and data."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/laws"))
    parser.add_argument("--jobs", type=int, default=None, help="processes (default: one a core)")
    args = parser.parse_args()

    def run(cases):
        folders = {args.out / "/".join(key).replace(" ", "_"): x for key, x in cases.items()}
        results = run_nested(folders, args.jobs, partial(print, flush=True))
        return dict(zip(cases, results.values(), strict=True))

    results = run({(x, law, "designed"): case(x, law) for x in LIMITS for law in laws(x)})
    better = [
        str(pair).replace(f"{args.out}/", "") for pair in dominated(filter(None, results.values()))
    ]
    kept = {}
    for limit, law, _ in results:
        best = results[limit, "open loop", "designed"]
        if law != "open loop" and best is not None and best.success:
            blade = best.summary.chord_m, best.summary.twist_deg
            kept[limit, law, "kept"] = with_blade(case(limit, law), *blade, "fixed")
    results |= run(kept)
    data = {
        "; ".join(key): page_data.of_result(x, SHOWN if key[0] == "and 5 kW" else SHOWN[:1])
        for key, x in results.items()
    }
    page_data.page_from("laws", from_data, results=data, better=better)
    plots = [
        partial(panel, results=data, limit=limit, foot=FOOT if limit == "all" else "")
        for limit in LIMITS
    ]
    drawn = style.figure_of(7.5, 1.0 + 2.3 * len(plots), plots, share=0)
    style.save({"laws": drawn}, page_data.path_of("laws").parent / Path(IMAGE).parent)


def laws(limit):
    """Return the laws that are run under some limits; constant power needs a limit of the power."""
    return [law for law in LAWS if law != "rated" or POWER in LIMITS[limit][1]]


def case(limit, law):
    """Return the case of a law under limits."""
    torque, limits = LIMITS[limit]
    data = "inflow={profile: sine}", f"control={{{LAWS[law]}, torque_limit: {torque}}}"
    return load_case({}, [*data, f"limits={{{limits}}}", "rotor.station_count=40"])


def below(results, limit, law, blade):
    """Return the energy of a law over that of open loop, %; None: refused; nan: was not run."""
    key = f"{limit}; {law}; {blade}"
    result, best = results.get(key, np.nan), results[f"{limit}; open loop; designed"]
    if not isinstance(result, dict):
        return result
    if not (result["success"] and best["success"]):
        return None
    return percent(*(each["summary"]["simulated_energy_J"] for each in (result, best)))


def from_data(data):
    """Return the page of its data."""
    results, rows = data["results"], []
    energies = [results[f"{limit}; open loop; designed"]["summary"] for limit in LIMITS]
    rows.append(["open loop, kJ", *(f"{x['simulated_energy_J'] / 1e3:.2f}" for x in energies)])
    for law in list(LAWS)[1:]:
        values = [[below(results, limit, law, blade) for blade in BLADES] for limit in LIMITS]
        rows.append([law, *(" / ".join(map(cell, pair)) for pair in values)])
    words = "Energy over that of open loop, %: blade designed with the law / open loop's kept."
    lines = ["## Energy", "", words, "", *markdown_table(["", *LIMITS], rows), ""]
    if data["better"]:
        lines += ["Results that another one of the table shows not to be the best:", ""]
        lines += [*(f"- {each}" for each in data["better"]), ""]
    lines += ["## The blade of each law", "", "In the sine with 700 N m and 5 kW.", ""]
    header = ["law", "mean tip speed ratio", "largest", "blade area, 10⁻³ m²", "thrust, kN"]
    lines += markdown_table([*header, "delivered, kJ"], map(partial(blade_of, results), LAWS))
    return HEAD + "\n".join([*lines, ""])


def cell(value):
    """Return a cell of the table of energies."""
    return "refused" if value is None else "-" if np.isnan(value) else f"{value:+.3f}"


def blade_of(results, law):
    """Return the row of the blade that a law ends with, with 700 N m and 5 kW."""
    result = page_data.result_of(results[f"and 5 kW; {law}; designed"])
    summary = result.summary
    if not result.success:
        return [law, "refused", *4 * ["-"]]
    area, ratio = np.trapezoid(summary.chord_m, summary.r_m), summary.tip_speed_ratio
    thrust, delivered = summary.loads["thrust"].value / 1e3, summary.generator_energy_J / 1e3
    ratios = f"{ratio.mean:.2f}", f"{ratio.max:.2f}"
    return [law, *ratios, f"{1e3 * area:.1f}", f"{thrust:.2f}", f"{delivered:.2f}"]


def panel(ax, results, limit, foot):
    """Draw what each law loses under some limits, with a blade of its own and with open loop's."""
    asked = laws(limit)[1:]
    for i, blade in enumerate(BLADES):
        values = [below(results, limit, law, blade) for law in asked]
        lost = np.array([np.nan if x is None else max(-x, 1.3 * LEAST) for x in values])
        look = {"color": COLORS[i], "hatch": style.HATCHES[i], "edgecolor": "white"}
        left = np.arange(len(asked)) + 0.4 * (i - 0.5)
        ax.bar(left, lost, 0.36, label=f"blade {blade}", **look)
        refused = left[np.isnan(lost)]
        mark = {"marker": "x", "linestyle": "none", "markersize": 5, "color": look["color"]}
        ax.plot(refused, np.full(refused.size, 1.6 * LEAST), **mark)
    ax.set_yscale("log")
    ax.set_ylim(bottom=LEAST)
    ax.yaxis.set_major_formatter("{x:g}")
    ax.axhline(NEAR, label=f"{NEAR:g} %: as good as open loop", **style.REFERENCE)
    ax.set_title(TITLES[limit], fontsize=style.FONT_SIZE + 1, loc="left", fontweight="bold")
    style.finish(ax, foot, "energy below\nopen loop (%)")
    ax.set_xticks(range(len(asked)), [law.replace(", ", ",\n") for law in asked])
    return ax


if __name__ == "__main__":
    main()
