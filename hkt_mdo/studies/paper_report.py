"""The reproduction's report: tables, checks and figures as JSON, Markdown and one HTML page."""

import base64
import html
import json
import platform
import re
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hkt_mdo.results import plots
from hkt_mdo.results.folder import write_text
from hkt_mdo.studies.common import LAWS, SCENARIOS, markdown_table, percent
from hkt_mdo.studies.paper import FLOWS, REFERENCES, SENSOR_RATES, Paper, ensemble_key

LABELS = {
    "oloc": "OLOC",
    "linear": "linear feedback",
    "quadratic": "quadratic feedback",
    "baseline_oloc": "baseline with OLOC",
}
TITLES = (
    "Table II: step flow, no torque limit",
    "Table III: sine flow, no torque limit",
    "Table IV: sine flow, torque limit 700 N m",
)


def write_report(paper: Paper, out: Path, report: Callable[[str], None]) -> dict:
    """Write paper.json, report.md, report.html and the figures; return what paper.json holds.

    Parameters
    ----------
    paper : hkt_mdo.studies.paper.Paper
        All results.
    out : Path
        Folder to write into.
    report : callable
        Called with a line whenever something is done.
    """
    data = {
        "version": version("hkt_mdo"),
        "python": platform.python_version(),
        "tables": {scenario: _scenario(paper, scenario) for scenario in SCENARIOS},
        "uncertain_flow": {flow: _uncertain(paper, flow) for flow in FLOWS},
        "sensor": _sensor(paper),
        "sequential": _sequential(paper),
    }
    checks = [*_table_checks(data["tables"]), *_flow_checks(data["uncertain_flow"])]
    for scenario, low, high in (("sine", -1e-3, 1e-3), ("sine_limited", 1e-2, float("inf"))):
        value = data["sequential"][scenario]["oloc"]["gain_percent"]
        statement = f"{scenario}: co-design over sequential design (OLOC), %"
        checks.append((statement, value, low, high))
    lost = sum(not solution.success for solution in paper.solutions.values())
    checks.append(("runs without success", lost, 0, 0))
    data["checks"] = [
        {
            "statement": statement, "value": value, "low": low, "high": high,
            "passed": value is not None and low <= value <= high,
        }
        for statement, value, low, high in checks
    ]  # fmt: skip
    figures = _figures(paper, out / "figures")
    report(f"{len(figures)} figures")
    text = "\n\n".join(_blocks(data, figures))
    write_text(out / "paper.json", json.dumps(data, indent=2) + "\n")
    write_text(out / "report.md", text + "\n")
    write_text(out / "report.html", _page(text, out))
    return data


# Numbers ------------------------------------------------------------------------------------------


def _energy(paper, name):
    return paper.solutions[name].summary["simulated_energy_J"]


def _scenario(paper, scenario):
    """Return the rows of Table II, III or IV."""
    best, rows = _energy(paper, f"{scenario}_oloc"), {}
    for name in (*LAWS, *(("baseline_oloc",) if scenario == "sine" else ())):
        summary = paper.solutions[f"{scenario}_{name}"].summary
        printed, energy = paper.reported[scenario][name], summary["simulated_energy_J"]
        kept = ("success", "gain", "tip_speed_ratio", "power_coefficient_max", "iterations")
        peak, told = "tip_speed_ratio_at_power_coefficient_max", ("gain", "tip_speed_ratio")
        rows[name] = {
            "energy_J": energy,
            "difference_percent": percent(energy, printed["energy_J"]),
            "gap_percent": percent(energy, best),
            "gain_difference_percent": percent(summary["gain"], printed.get("gain")),
            **{key: summary[key] for key in (*kept, peak)},
            **{f"reported_{key}": printed.get(key) for key in ("energy_J", "gap_percent", *told)},
        }
    return rows


def _uncertain(paper, flow):
    """Return a flow's rows of Table V under the default sensor."""
    replay = paper.ensembles[f"oloc_{flow}"]
    rows = {"oloc": {key: replay[key] for key in ("energy_J", "stopped_at_s")}}
    for law in LAWS[1:]:
        noisy = paper.ensembles[ensemble_key(law, flow)]
        keys = ("energy_J", "spread_J", "worst_J", "stalled", "repeats")
        rows[law] = {key: noisy[key] for key in keys}
        rows[law]["quiet_energy_J"] = paper.ensembles[ensemble_key(law, flow, None)]["energy_J"]
    ceiling, printed = _energy(paper, f"redesigned_{flow}"), paper.reported["uncertain_flow"][flow]
    success = paper.solutions[f"redesigned_{flow}"].success
    rows["oloc_redesigned"] = {"energy_J": ceiling, "success": success}
    for name, row in rows.items():
        row["gap_percent"] = percent(row["energy_J"], ceiling)
        row["reported_energy_J"] = printed[name]
        row["reported_gap_percent"] = printed["gap_percent"].get(name)
    return rows


def _sensor(paper):
    """Return how the number of stalled repeats and the energy depend on the sensor."""
    rows = []
    for law, flow in product(LAWS[1:], FLOWS):
        quiet = paper.ensembles[ensemble_key(law, flow, None)]["energy_J"]
        for reference, rate in product(REFERENCES, SENSOR_RATES):
            run = paper.ensembles[ensemble_key(law, flow, reference, rate)]
            row = {"law": law, "flow": flow, "reference": reference, "rate_Hz": rate}
            row |= {key: run[key] for key in ("noise_deviation_rad_s", "stalled", "repeats")}
            rows.append(row | {"loss_percent": percent(run["energy_J"], quiet)})
    return rows


def _sequential(paper):
    """Return sequential design (best steady blade first) beside co-design."""
    rows = {"sine": {}, "sine_limited": {}}
    for scenario, row in rows.items():
        for law in LAWS:
            together = _energy(paper, f"{scenario}_{law}")
            kept = paper.solutions[f"{scenario}_sequential_{law}"].summary
            row[law] = {
                "co_design_J": together,
                "sequential_J": kept["simulated_energy_J"],
                "sequential_success": kept["success"],
                "gain_percent": percent(together, kept["simulated_energy_J"]),
            }
    return rows


def _table_checks(tables):
    """Yield (statement, value, low, high) of what Tables II to IV have to bear out."""
    for scenario, rows in tables.items():
        best, linear, quadratic = (rows[law]["energy_J"] for law in LAWS)
        yield f"{scenario}: quadratic over OLOC, %", percent(quadratic, best), -0.02, 2e-3
        below = percent(linear, quadratic)
        yield f"{scenario}: linear below quadratic, %", below, -100.0, -1e-9
        yield f"{scenario}: linear over OLOC, %", percent(linear, best), -1.5, -0.1
        for name, row in rows.items() if scenario != "step" else ():
            difference = row["difference_percent"]
            yield f"{scenario} {name}: energy over the paper's, %", difference, -4.0, 4.0
            if row["reported_gain"]:
                difference = row["gain_difference_percent"]
                yield f"{scenario} {name}: gain over the paper's, %", difference, -8.0, 8.0
    sine, limited = tables["sine"], tables["sine_limited"]
    yield "baseline with OLOC over OLOC, %", sine["baseline_oloc"]["gap_percent"], -8.0, -3.0
    ratio = sine["oloc"]["tip_speed_ratio"]
    yield "sine OLOC: range of the tip speed ratio", ratio["max"] - ratio["min"], 0.0, 0.1
    over = percent(ratio["mean"], 7.18)
    yield "sine OLOC: tip speed ratio over 7.18, %", over, -3.0, 3.0
    over = percent(limited["oloc"]["tip_speed_ratio_at_power_coefficient_max"], 8.27)
    yield "limited OLOC: tip speed ratio at maximum C_P over 8.27, %", over, -3.0, 3.0


def _flow_checks(flows):
    """Yield (statement, value, low, high) of what Table V has to bear out."""
    for flow, rows in flows.items():
        quadratic, linear = rows["quadratic"], rows["linear"]
        yield f"flow {flow}: quadratic over the ceiling, %", quadratic["gap_percent"], -1.0, 0.0
        yield f"flow {flow}: linear over the ceiling, %", linear["gap_percent"], -2.0, 0.0
        above = percent(quadratic["energy_J"], linear["energy_J"])
        yield f"flow {flow}: quadratic over linear, %", above, 1e-9, float("inf")
        yield f"flow {flow}: stalled repeats", quadratic["stalled"] + linear["stalled"], 0, 0
    replay = percent(flows["A"]["oloc"]["energy_J"], flows["A"]["linear"]["energy_J"])
    yield "flow A: OLOC replay over linear, %", replay, -100.0, 0.0


# Figures ------------------------------------------------------------------------------------------


def _figures(paper, folder):
    """Draw Figs. 3 to 12 as PNG and PDF; return each in Markdown by its number."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {}

    def save(caption, figure):
        number = 3 + len(drawn)
        for suffix, metadata in (("png", {"Software": None}), ("pdf", {"CreationDate": None})):
            figure.savefig(folder / f"figure_{number:02d}.{suffix}", dpi=140, metadata=metadata)
        caption = f"Fig. {number}. {caption}"
        drawn[number] = f"![{caption}](figures/figure_{number:02d}.png)\n\n*{caption}*"

    def three(scenario):
        return [_named(paper.solutions[f"{scenario}_{law}"], LABELS[law]) for law in LAWS]

    caption = "Step flow: control torque and rotor speed"
    save(caption, _stack(three("step"), plots.plot_control_torque, plots.plot_rotor_speed))
    baseline = _named(paper.solutions["sine_baseline_oloc"], "baseline (Bahaj)")
    torques = "control and hydrodynamic torque"
    for scenario, words in (("sine", "no torque limit"), ("sine_limited", "torque limit 700 N m")):
        curves, flow = three(scenario), f"Sine flow, {words}"
        for name, shown, words in (
            ("blade", [*curves, baseline], "twist and chord"),
            ("power_curve", curves, "power coefficient over tip speed ratio"),
            ("operation", curves, f"rotor speed, tip speed ratio, {torques}"),
        ):
            save(f"{flow}: {words}", plots.figure_of(shown, name))
    for flow in FLOWS:
        replay = paper.ensembles[f"oloc_{flow}"]
        caption = f"Flow {flow}: rotor speed, control torque, hydrodynamic torque"
        series = replay["series"]
        if replay["stopped_at_s"] is not None:
            # an empty line keeps the line styles of the other controllers as they are
            series, stopped = {}, replay["stopped_at_s"]
            caption += f" (the replayed OLOC stops at {stopped:.1f} s and is not shown)"
        lines = [_named(paper.solutions["sine_limited_oloc"], "OLOC replayed", series)]
        for law in LAWS[1:]:
            series = paper.ensembles[ensemble_key(law, flow)]["series"]
            lines.append(_named(paper.solutions[f"sine_limited_{law}"], LABELS[law], series))
        lines.append(_named(paper.solutions[f"redesigned_{flow}"], "OLOC redesigned"))
        panels = plots.plot_rotor_speed, plots.plot_control_torque, plots.plot_hydrodynamic_torque
        save(caption, _stack(lines, *panels))
    return drawn


def _named(solution, name, series=None):
    """Return a solution under a legend's name, with another run's time series if given."""
    summary = {k: value for k, value in solution.summary.items() if not k.startswith("start_")}
    case = solution.case.model_copy(update={"name": name})
    renamed = replace(solution, case=case, summary=summary)
    if series is None:
        return renamed
    columns = {key: np.array(values) for key, values in series.items()}
    return replace(renamed, simulation=columns, trajectory={})


def _stack(solutions, *panels):
    """Return a figure of panels above each other with one legend and one time axis."""
    figure = Figure(figsize=(6.4, 2.1 * len(panels) + 0.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(panels), 1, sharex=True)
    for plot, ax in zip(panels, axes, strict=True):
        plot(solutions, ax)
        if ax is not axes[0] and ax.get_legend() is not None:
            ax.get_legend().remove()
        if ax is not axes[-1]:
            ax.set_xlabel("")
    return figure


# Text ---------------------------------------------------------------------------------------------


def _table(header, cells, rows):
    """Return a table in Markdown from its headings and a template of the other rows."""
    filled = [[_filled(cell, row) for cell in cells.split(" | ")] for row in rows]
    return "\n".join(markdown_table(header.split(" | "), filled))


def _filled(template, row):
    """Return a template with a row's values; a dash where a value is missing (None)."""
    try:
        return template.format(**row)
    except TypeError:  # None takes no number format
        return "–"


def _blocks(data, figures):
    """Yield the report in Markdown: headings, paragraphs, tables and figures."""
    passed = sum(check["passed"] for check in data["checks"])
    yield "# Amini et al. (ACC 2023), reproduced"
    yield (
        "Energies are those of the independent integration with direct BEM "
        "(`simulated_energy_J`), not the optimizer's. 'Gap' is relative to OLOC in the same "
        "table; 'difference' is relative to the paper. What the paper leaves out, and how it "
        "was inferred, is in docs/reproduction.md."
    )
    yield f"{passed} of {len(data['checks'])} checks pass (last section)."
    yield from _tables(data["tables"], figures)
    yield from _uncertain_table(data["uncertain_flow"])
    yield from (figures[number] for number in (10, 11, 12))
    yield from _sensor_table(data["sensor"])
    yield from _sequential_table(data["sequential"])
    yield "## Checks"
    yield _table(
        "statement | found | asked | holds",
        "{statement} | {value:.4g} | {low:g} … {high:g} | {holds}",
        [check | {"holds": "yes" if check["passed"] else "NO"} for check in data["checks"]],
    )
    yield "## How this was made"
    yield (
        f"`hkt paper` of hkt_mdo {data['version']}, Python {data['python']}. All numbers are in "
        "paper.json."
    )


def _tables(tables, figures):
    header = " | energy / J | paper / J | difference | gap | paper"
    cells = (
        "{label} | {energy_J:.0f} | {reported_energy_J:.0f} | {difference_percent:+.2f} %"
        " | {gap_percent:+.4f} % | {reported_gap_percent:+.3f} %"
        " | {gain:.2f} | {reported_gain:.2f}"
        " | {tip_speed_ratio_at_power_coefficient_max:.2f} | {reported_tip_speed_ratio:.2f}"
    )
    header += " | gain | paper | TSR at max C_P | paper"
    numbers = ((3,), (4, 5, 6), (7, 8, 9))
    for title, table, shown in zip(TITLES, tables.values(), numbers, strict=True):
        rows = [{"label": LABELS[name]} | row for name, row in table.items()]
        yield f"## {title}"
        yield _table(header, cells, rows)
        yield from (figures[number] for number in shown)


def _uncertain_table(flows):
    labels = LABELS | {"oloc": "OLOC replayed", "oloc_redesigned": "OLOC redesigned"}
    rows = []
    for flow, lines in flows.items():
        for name, row in lines.items():
            form = "{energy_J:.0f}"
            if row["energy_J"] is None:
                form = "rotor stops at t = {stopped_at_s:.1f} s, not generating"
            elif row.get("spread_J") is not None:
                form += " ± {spread_J:.0f} (worst {worst_J:.0f})"
            words = {"flow": flow, "label": labels[name], "energy": form.format(**row)}
            words["of"] = "{stalled} of {repeats}".format(**row) if "stalled" in row else ""
            rows.append(words | row)
    yield "## Table V: uncertain flows"
    yield (
        "Designs of Table IV in flows that they were not made for. Feedback reads a speed sensor "
        "with 20 dB of the speed's fluctuation, sampled at 100 Hz, behind a second-order "
        "Butterworth low-pass at 0.5 Hz; mean and standard deviation over the repeats. OLOC "
        "replays its recorded torque. 'Redesigned' is the optimal control of the fixed blade of "
        "sine_limited_oloc in the actual flow: the ceiling. Every run starts at the tip speed "
        "ratio that its design starts at."
    )
    yield _table(
        "flow | controller | energy / J | paper / J | gap | paper | stalled",
        "{flow} | {label} | {energy} | {reported_energy_J:.0f} | {gap_percent:+.2f} %"
        " | {reported_gap_percent:+.1f} % | {of}",
        rows,
    )


def _sensor_table(rows):
    yield "## What the sensor's open choices do"
    yield (
        "The paper does not say what the 20 dB refer to (the speed's fluctuation about its mean, "
        "or the whole speed, whose rms is some ten times larger), nor how often the sensor is "
        "sampled. Stalled repeats are counted here and left out of the energies. The default, "
        "fluctuation at 100 Hz, is the coarsest choice under which nothing stalls, as in the "
        "paper."
    )
    yield _table(
        "law | flow | 20 dB of | rate / Hz | σ / (rad/s) | stalled | energy, to no noise",
        "{law} | {flow} | {reference} | {rate_Hz:g} | {noise_deviation_rad_s:.3f}"
        " | {stalled} of {repeats} | {loss_percent:+.3f} %",
        rows,
    )


def _sequential_table(found):
    rows = []
    for limit, lines in zip(("none", "700 N m"), found.values(), strict=True):
        for law, row in lines.items():
            kept = f"{row['sequential_J']:.0f}" if row["sequential_success"] else "no success"
            rows.append(row | {"limit": limit, "label": LABELS[law], "kept": kept})
    yield "## Sequential against simultaneous design"
    yield (
        "Sequential: the best steady blade first, then the controller on it. Without a torque "
        "limit both lead to the same rotor under OLOC and quadratic feedback; with it, or with "
        "linear feedback, the controller changes the best blade (paper Sec. IV, from its ref. 11)."
    )
    yield _table(
        "torque limit | controller | sequential / J | co-design / J | co-design gains",
        "{limit} | {label} | {kept} | {co_design_J:.0f} | {gain_percent:+.4f} %",
        rows,
    )


_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 64rem; margin: 2rem auto;
       padding: 0 1rem; }
table { border-collapse: collapse; font-size: 0.9rem; margin: 1rem 0; }
th, td { border-bottom: 1px solid #ccc; padding: 0.25rem 0.6rem; text-align: right;
         white-space: nowrap; }
th { border-bottom: 2px solid #555; }
th:first-child, td:first-child { text-align: left; }
figure { margin: 1.5rem 0; }
img { max-width: 100%; }
figcaption { color: #555; font-size: 0.9rem; }
.scroll { overflow-x: auto; }
"""


def _page(text, out):
    """Return the report as one HTML page with its images inside: no server, no network."""
    parts = []
    for block in html.escape(text).split("\n\n"):
        if block.startswith("#"):
            level, title = block.split(" ", 1)
            parts.append(f"<h{len(level)}>{title}</h{len(level)}>")
        elif block.startswith("|"):
            header, _, *rows = (line[2:-2].split(" | ") for line in block.splitlines())
            rows = _row("th", header) + "".join(_row("td", row) for row in rows)
            parts.append(f'<div class="scroll"><table>{rows}</table></div>')
        elif figure := re.fullmatch(r"!\[(.*)\]\((.*)\)", block):
            image = base64.b64encode((out / figure[2]).read_bytes()).decode("ascii")
            parts.append(f'<figure><img alt="{figure[1]}" src="data:image/png;base64,{image}">')
        elif block.startswith("*"):
            parts.append(f"<figcaption>{block.strip('*')}</figcaption></figure>")
        else:
            words = re.sub("`([^`]*)`", r"<code>\1</code>", block)
            parts.append(f"<p>{words}</p>")
    title = text.partition("\n")[0].strip("# ")
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{_STYLE}</style></head>\n<body>\n" + "\n".join(parts) + "\n</body></html>\n"
    )


def _row(tag, cells):
    return "<tr>" + "".join(f"<{tag}>{cell}</{tag}>" for cell in cells) + "</tr>"
