"""The pages of reports, of results and of sweeps: what is shown, put into the templates."""

import base64
import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.case.kinds import Extension
from hkt_mdo.errors import InputError
from hkt_mdo.files.table import file_state, write_files, write_new
from hkt_mdo.pages import panels, plotly_script, rendered
from hkt_mdo.results.charts import Labelled, labelled
from hkt_mdo.results.nesting import ranked, remarks
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.steady import rated_point
from hkt_mdo.results.sweep import SweepTable
from hkt_mdo.results.words import Row, aligned, joined, limit_words, measured, texts
from hkt_mdo.sections import leaves


def write_report(
    solutions: Solution | Iterable[Solution], out: str | Path, shared: str = ""
) -> Path:
    """Write the report of results as one HTML file that needs no network.

    Parameters
    ----------
    solutions : Solution, or iterable of Solution
        One result, or several that the page sets side by side, the best first.
    out : str or pathlib.Path
        The file, which is replaced; its folder is made if need be.
    shared : str
        Address, relative to the file, of a plotly.js that several pages share; none: in the file.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    InputError
        If a package is missing, there is no result, or the file cannot be written.
    """
    script = "" if shared else plotly_script()
    chosen = [solutions] if isinstance(solutions, Solution) else list(solutions)
    if not chosen:
        raise InputError("a report needs a result", "give a result folder")
    (path,) = write_new({Path(out): _page(chosen, shared, script)}, force=True)
    return path


def write_sweep_report(
    table: SweepTable, tell: Callable[[str], None], extensions: Iterable[Extension]
) -> Path:
    """Write `report.html` into a sweep's folder, and the pages of its runs into theirs.

    The pages share one `plotly.js`, so that a hundred of them stay small; they open from disk, and
    need no network. A page that is newer than its result is kept.

    Parameters
    ----------
    table : SweepTable
        The table of the sweep.
    tell : callable
        tell(line) is called after each page.
    extensions : iterable
        Of the cases, as `load_case` takes them.

    Returns
    -------
    pathlib.Path
        The sweep's page.

    Raises
    ------
    InputError
        If a package is missing, or a file cannot be written.
    """
    from hkt_mdo.results.sweep_plots import sweep_charts

    script = plotly_script()
    runs = [str(run) for run in table.columns["run"]]
    for number, run in enumerate(runs, start=1):
        page = table.folder / run / "report.html"
        written, result = file_state(page), file_state(page.with_name("summary.json"))
        if run and result and (written is None or written < result):
            solution = Solution.load(page.parent, extensions=extensions)
            write_report([solution], page, shared="../../plotly.js")
            tell(f"{number} of {len(runs)}: {page}")
    drawn = sweep_charts(table)
    charts = {x: panels.stacked([drawn[x]], 300) if x in drawn else None for x in ("front", "map")}
    rows = zip(table.pages, runs, table.columns["message"], table.verified, strict=True)
    failed = [(link, run or "no run", message) for link, run, message, good in rows if not good]
    share = f"{len(runs) - len(failed)} of {len(runs)} runs"
    text = rendered(
        "sweep.html",
        title=f"Sweep over {', '.join(table.sweep.over)}",
        lead=f"{share} of {Path(table.sweep.case).stem} are verified.",
        failed=failed,
        data=json.dumps(charts, allow_nan=False),
    )
    out = table.folder / "report.html"
    write_files({table.folder / "plotly.js": script, out: text})
    return out


def _page(solutions: Sequence[Solution], shared: str, script: str) -> str:
    """Return the page as HTML."""
    from hkt_mdo.pages import blade

    order, behind = ranked(solutions)
    results = labelled(order)
    rotors, reasons = blade.bodies(results)
    drawn, views = panels.designs(results), panels.views(results)
    if rotors:
        drawn["solid"] = blade.solid(rotors)
    entries, titles = list(map(_entry, results)), dict.fromkeys(solution.name for solution in order)
    checks = [{limit_words(x.name): x for x in solution.summary.checks or ()} for solution in order]
    limits = [solution.summary.at_limits(solution.case) for solution in order]
    headlines = [
        [replace(x, note="") for x in (*rows, *_headline(solution)) if x.value is not None]
        for solution, rows in zip(order, behind, strict=True)
    ]
    return rendered(
        "report.html",
        title=" and ".join(titles) if len(titles) < 4 else f"{len(order)} results",
        results=entries,
        headline=aligned([*map(texts, headlines)]),
        merits=aligned([entry["merits"] for entry in entries]),
        checks=sorted(aligned(checks), key=lambda row: all(not x or x.passed for x in row[1])),
        measured=measured,
        limits=sorted(aligned(limits), key=lambda row: not any(x and x[0].limit for x in row[1])),
        differences=_differences([solution.case for solution in order]),
        remarks=remarks(solution for solution in order if solution.finished),
        not_modelled=list(dict.fromkeys(line for x in order for line in not_modelled(x.case))),
        reasons=reasons,
        picture=base64.b64encode(blade.picture(rotors)).decode() if rotors else "",
        points=panels.points_each(results),
        views=list(views),
        charts=drawn,
        view_charts=sorted({name for view in views.values() for name in view}),
        data=json.dumps({"charts": drawn, "views": views, "dark": panels.DARK}, allow_nan=False),
        shared=shared,
        plotly=script,
    )


def _entry(result: Labelled) -> dict[str, Any]:
    """Return what the page says of one result by itself."""
    solution, name, state = result.solution, result.label or "result", "unfinished"
    if solution.finished:
        good = solution.success and not solution.summary.breaks(solution.case)
        state = "verified" if good else "refused"
    merits = texts(solution.summary.rows(solution.case))
    return {"name": name, "solution": solution, "state": state, "merits": merits}


def _headline(solution: Solution) -> Iterator[Row]:
    """Yield the figures that a designer asks for first, of which some may not be known."""
    summary, largest = solution.summary, solution.summary.largest
    duration = solution.case.phase.duration  # the energies of all scenarios are those in this time
    yield Row("verdict", summary.verdict(solution.case))
    yield from summary.year.rows() if summary.year else ()
    energies = {"captured": summary.simulated_energy_J or summary.energy_J}
    if solution.case.generator.rubs or not solution.case.generator.lossless:
        energies["electrical"] = summary.electrical_energy_J
    for name, energy in energies.items():
        if energy is not None and duration:
            yield Row(f"mean {name} power", energy / duration, "W", digits=4)
            yield Row(f"{name} energy a day", 24e-3 * energy / duration, "kWh", digits=4)
    alone = [(part.simulation, rated_point(part)) for part in solution.by_scenario]
    rated = [point[0] for _, point in alone if point is not None]
    yield Row("power limit reached from", min(rated, default=None), "m/s", digits=3)
    speeds = [30.0 / np.pi * x["rotor_speed_rad_s"] for x, _ in alone if x]
    yield Row("rotor speed", np.concatenate(speeds) if speeds else None, "rpm", digits=4)
    shown = "control_torque", "power", "thrust", "root_moment", "stress", "cavitation", "tip_speed"
    yield from (replace(largest[x].row(x), digits=4) for x in shown if x in largest)
    radius = summary.rotor_radius_m
    yield Row("rotor diameter", radius and 2.0 * radius, "m", digits=4)
    yield Row("mass of the blades", summary.mass_kg, "kg", digits=4)


def _differences(cases: Sequence[Case]) -> list[tuple[str, list[str]]]:
    """Return the keys in which cases differ, with the value of each case in people's units."""
    rows = aligned([_values(case) for case in cases])
    different = [row for row in rows if len(set(row[1])) > 1 and row[0] != "name"]
    return [(key, [value or "-" for value in values]) for key, values in different]


def _values(case: Case) -> dict[str, str]:
    """Return the values of a case as texts by their dotted keys, those of a list in one text."""
    values: dict[str, str] = {}
    for key, value, unit in leaves(case):
        if value is not None:
            text = measured(value, unit, 10) if isinstance(value, float) else str(value)
            key = re.sub(r"\[\d+\]$", "", key)
            values[key] = joined(values.get(key, ""), text)
    return values


def not_modelled(case: Case) -> list[str]:
    """Return what the numbers of a result leave out, a sentence each.

    Parameters
    ----------
    case : Case
        The case that was run.

    Returns
    -------
    list of str
        What no case has, and what this case does not ask for.
    """
    weight = any(getattr(limit, "weight", False) for limit in case.all_limits)
    depth = case.site.hub_depth or any(getattr(limit, "depth", None) for limit in case.all_limits)
    return rendered("not_modelled.txt", case=case, weight=weight, depth=depth).splitlines()
