"""The reproduction's report: tables, checks and figures as JSON, Markdown and one HTML page."""

import platform
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from numbers import Real
from pathlib import Path

import numpy as np
import yaml
from study_common import LAWS, SCENARIOS, percent, text_page

from hkt_mdo.errors import program_version
from hkt_mdo.files.shipped import locate
from hkt_mdo.files.table import write_files
from hkt_mdo.pages import rendered
from hkt_mdo.results import charts, style
from hkt_mdo.results.charts import figure_of
from hkt_mdo.results.folder import write_json
from hkt_mdo.studies.uncertainty import REFERENCES, Sensor

FLOWS = ("A", "B", "C")
FEEDBACK = LAWS[1:]
SENSORS = tuple(
    Sensor(reference=reference, rate=rate)
    for reference, rate in product(REFERENCES, (10.0, 100.0, 1000.0))
)
DEFAULT = Sensor()
LABELS = {
    "oloc": "OLOC",
    "linear": "linear feedback",
    "quadratic": "quadratic feedback",
    "baseline_oloc": "baseline with OLOC",
    "oloc_redesigned": "OLOC redesigned",
}
TITLES = {
    "step": "Table II: step flow, no torque limit",
    "sine": "Table III: sine flow, no torque limit",
    "sine_limited": "Table IV: sine flow, torque limit 700 N m",
}
TITLE = "Amini et al. (ACC 2023), reproduced"


def ensemble_key(law: str, flow: str, sensor: Sensor | None = DEFAULT) -> str:
    """Return the name of a law's runs in a flow.

    Parameters
    ----------
    law, flow : str
        One of `LAWS` and one of `FLOWS`.
    sensor : Sensor or None
        The sensor; None: there is no noise.

    Returns
    -------
    str
        The key of the runs among the ensembles.
    """
    return f"{law}_{flow}_" + (f"{sensor.reference}_{sensor.rate:g}Hz" if sensor else "quiet")


def _number(value, form: str) -> str:
    """Return a number in a format; a dash where there is none."""
    return form.format(value) if isinstance(value, Real) else "–"


def write_report(solutions: dict, ensembles: dict, out: Path, report: Callable) -> dict:
    """Write paper.json, report.md, report.html and the figures; return what paper.json holds.

    Parameters
    ----------
    solutions : dict of Solution
        Those of the ten shipped cases, of sequential design (`sine_sequential_oloc`, ...) and of
        optimal control in another flow (`redesigned_A`, ...), by name.
    ensembles : dict of dict
        Results of the simulations in other flows, by `ensemble_key`.
    out : pathlib.Path
        Folder of the files.
    report : callable
        report(line) is called when the figures are written.

    Returns
    -------
    dict
        What paper.json holds.
    """
    printed = yaml.safe_load(locate("amini2023", "reported").read_text(encoding="utf-8"))
    data = {
        "version": program_version(),
        "python": platform.python_version(),
        "tables": {each: _scenario(solutions, each, printed[each]) for each in SCENARIOS},
        "uncertain_flow": {
            flow: _uncertain(solutions, ensembles, flow, printed["uncertain_flow"][flow])
            for flow in FLOWS
        },
        "sensor": _sensor(ensembles),
        "sequential": _sequential(solutions),
    }
    lost, names = sum(not each.success for each in solutions.values()), "statement value low high"
    checks = (*_checks(data), ("runs without success", lost, 0, 0))
    data["checks"] = [dict(zip(names.split(), check, strict=True)) for check in checks]
    for check in data["checks"]:
        value = check["value"]
        check["passed"] = value is not None and check["low"] <= value <= check["high"]
    figures, shown = {}, {}
    for number, (caption, figure) in enumerate(_figures(solutions, ensembles).items(), 3):
        name, caption = f"figure_{number:02d}", f"Fig. {number}. {caption}"
        figures[name] = figure
        shown[number] = f"![{caption}](figures/{name}.png)\n\n*{caption}*"
    style.save(figures, out / "figures", ("png", "pdf"))
    report(f"{len(figures)} figures")
    values = {"title": TITLE, "titles": TITLES, "labels": LABELS, "figures": shown} | data
    values["number"] = _number
    text = rendered(Path(__file__).with_name("paper_report.md"), **values)
    write_json(out / "paper.json", data)
    write_files({out / "report.md": text})
    write_files({out / "report.html": text_page(TITLE, text, out)})
    return data


def _scenario(solutions, scenario, reported):
    """Return the rows of Table II, III or IV."""
    best, rows = solutions[f"{scenario}_oloc"].summary.simulated_energy_J, {}
    for name in (*LAWS, *(("baseline_oloc",) if scenario == "sine" else ())):
        summary, printed = solutions[f"{scenario}_{name}"].summary, reported[name]
        energy, keys = summary.simulated_energy_J, ("gain", "tip_speed_ratio")
        kept = ("success", *keys, "power_coefficient_max", "iterations")
        kept = (*kept, "tip_speed_ratio_at_power_coefficient_max")
        rows[name] = {
            "energy_J": energy,
            "difference_percent": percent(energy, printed["energy_J"]),
            "gap_percent": percent(energy, best),
            "gain_difference_percent": percent(summary.gain, printed.get("gain")),
            **summary.model_dump(include={*kept}),
            **{f"reported_{key}": printed.get(key) for key in ("energy_J", "gap_percent", *keys)},
        }
    return rows


def _uncertain(solutions, ensembles, flow, printed):
    """Return a flow's rows of Table V under the default sensor."""
    keys = ("energy_J", "spread_J", "worst_J", "stalled", "repeats")
    replay = ensembles[ensemble_key("oloc", flow, None)]
    redesigned = solutions[f"redesigned_{flow}"]
    rows = {"oloc": {key: replay[key] for key in ("energy_J", "stopped_at_s")}}
    for law in FEEDBACK:
        noisy, quiet = ensembles[ensemble_key(law, flow)], ensembles[ensemble_key(law, flow, None)]
        rows[law] = {key: noisy[key] for key in keys} | {"quiet_energy_J": quiet["energy_J"]}
    ceiling = redesigned.summary.simulated_energy_J
    rows["oloc_redesigned"] = {"energy_J": ceiling, "success": redesigned.success}
    for name, row in rows.items():
        row["gap_percent"] = percent(row["energy_J"], ceiling)
        row["reported_energy_J"] = printed[name]
        row["reported_gap_percent"] = printed["gap_percent"].get(name)
    return rows


def _sensor(ensembles):
    """Return how the number of stalled repeats and the energy depend on the sensor."""
    rows = []
    for law, flow, sensor in product(FEEDBACK, FLOWS, SENSORS):
        quiet = ensembles[ensemble_key(law, flow, None)]["energy_J"]
        run = ensembles[ensemble_key(law, flow, sensor)]
        row = {"law": law, "flow": flow, "reference": sensor.reference, "rate_Hz": sensor.rate}
        row |= {key: run[key] for key in ("noise_deviation_rad_s", "stalled", "repeats")}
        rows.append(row | {"loss_percent": percent(run["energy_J"], quiet)})
    return rows


def _sequential(solutions):
    """Return sequential design (best steady blade first) beside co-design."""
    rows = {"sine": {}, "sine_limited": {}}
    for scenario, law in product(rows, LAWS):
        together = solutions[f"{scenario}_{law}"].summary.simulated_energy_J
        kept = solutions[f"{scenario}_sequential_{law}"].summary
        rows[scenario][law] = {
            "co_design_J": together,
            "sequential_J": kept.simulated_energy_J,
            "sequential_success": kept.success,
            "gain_percent": percent(together, kept.simulated_energy_J),
        }
    return rows


def _checks(data):
    """Yield (statement, value, low, high) of each statement that the tables should confirm."""
    many = float("inf")
    for scenario, rows in data["tables"].items():
        linear, quadratic = rows["linear"], rows["quadratic"]
        yield f"{scenario}: quadratic over OLOC, %", quadratic["gap_percent"], -0.02, 2e-3
        below = percent(linear["energy_J"], quadratic["energy_J"])
        yield f"{scenario}: linear below quadratic, %", below, -100.0, -1e-9
        yield f"{scenario}: linear over OLOC, %", linear["gap_percent"], -1.5, -0.1
        for name, row in rows.items() if scenario != "step" else ():
            over = f"{scenario} {name}: {{}} over the paper's, %"
            yield over.format("energy"), row["difference_percent"], -4.0, 4.0
            if row["reported_gain"]:
                yield over.format("gain"), row["gain_difference_percent"], -8.0, 8.0
    sine, limited = data["tables"]["sine"], data["tables"]["sine_limited"]["oloc"]
    yield "baseline with OLOC over OLOC, %", sine["baseline_oloc"]["gap_percent"], -8.0, -3.0
    ratio = sine["oloc"]["tip_speed_ratio"]
    yield "sine OLOC: range of the tip speed ratio", ratio["max"] - ratio["min"], 0.0, 0.1
    yield "sine OLOC: tip speed ratio over 7.18, %", percent(ratio["mean"], 7.18), -3.0, 3.0
    over = percent(limited["tip_speed_ratio_at_power_coefficient_max"], 8.27)
    yield "limited OLOC: tip speed ratio at maximum C_P over 8.27, %", over, -3.0, 3.0
    for flow, rows in data["uncertain_flow"].items():
        linear, quadratic = rows["linear"], rows["quadratic"]
        yield f"flow {flow}: quadratic over OLOC redesigned, %", quadratic["gap_percent"], -1.0, 0.0
        yield f"flow {flow}: linear over OLOC redesigned, %", linear["gap_percent"], -2.0, 0.0
        above = percent(quadratic["energy_J"], linear["energy_J"])
        yield f"flow {flow}: quadratic over linear, %", above, 1e-9, many
        yield f"flow {flow}: stalled repeats", quadratic["stalled"] + linear["stalled"], 0, 0
    rows = data["uncertain_flow"]["A"]
    replay = percent(rows["oloc"]["energy_J"], rows["linear"]["energy_J"])
    yield "flow A: OLOC replay over linear, %", replay, -100.0, 0.0
    for scenario, low, high in (("sine", -1e-3, 1e-3), ("sine_limited", 1e-2, many)):
        gained = data["sequential"][scenario]["oloc"]["gain_percent"]
        yield f"{scenario}: co-design over sequential design (OLOC), %", gained, low, high


def _figures(solutions, ensembles):
    """Return Figs. 3 to 12 by their captions."""

    def three(scenario):
        return [_named(solutions[f"{scenario}_{law}"], LABELS[law]) for law in LAWS]

    def stack(lines, *names):
        results = charts.by_scenario(charts.labelled(lines))
        panels = [charts.over_time(results, name) for name in names]
        return style.figure_of_panels(panels, 6.4, 1.9, "")

    step = stack(three("step"), "control_torque", "rotor_speed")
    figures = {"Step flow: generator torque and rotor speed": step}
    baseline = _named(solutions["sine_baseline_oloc"], "baseline (Bahaj)")
    for scenario in ("sine", "sine_limited"):
        curves, draw, flow = three(scenario), figure_of, TITLES[scenario].partition(": ")[2]
        over_time = "Flow, generator power, rotor speed, tip speed ratio, generator torque, thrust"
        figures |= {
            f"Twist and chord: {flow}": draw([*curves, baseline], "blade"),
            f"Power coefficient over tip speed ratio: {flow}": draw(curves, "coefficients"),
            f"{over_time}: {flow}": draw(curves, "operation"),
        }
    for flow in FLOWS:
        replay = ensembles[ensemble_key("oloc", flow, None)]
        series, stopped = replay["series"], replay["stopped_at_s"]
        caption = f"Flow {flow}: rotor speed, generator torque, flow's torque"
        if stopped is not None:
            caption += f" (the replayed OLOC stops at {stopped:.1f} s and is not shown)"
            series = {}  # an empty line keeps the line styles of the other controllers as they are
        lines = [_named(solutions["sine_limited_oloc"], "OLOC replayed", series)]
        for law in FEEDBACK:
            series = ensembles[ensemble_key(law, flow)]["series"]
            lines.append(_named(solutions[f"sine_limited_{law}"], LABELS[law], series))
        lines.append(_named(solutions[f"redesigned_{flow}"], "OLOC redesigned"))
        figures[caption] = stack(lines, "rotor_speed", "control_torque", "hydrodynamic_torque")
    return figures


def _named(solution, name, series=None):
    """Return a solution under a legend's name, with another run's time series if given."""
    no_start = dict.fromkeys(("start_chord_m", "start_twist_deg"))
    summary = solution.summary.model_copy(update=no_start)
    renamed = replace(
        solution, case=solution.case.model_copy(update={"name": name}), summary=summary
    )
    if series is None:
        return renamed
    columns = {key: np.array(values) for key, values in series.items()}
    tables = {name: {"simulation": columns} for name in solution.tables}
    return replace(renamed, tables=tables)
