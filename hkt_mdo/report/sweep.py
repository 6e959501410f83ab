"""The report of a sweep: its front and its map, and a page for each run behind a point."""

from __future__ import annotations

import html
import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from hkt_mdo.files.table import write_files
from hkt_mdo.report.page import require_packages, write_report
from hkt_mdo.results import style
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.sweep import SweepTable

_TEMPLATES = Path(__file__).parent / "templates"
_SHARED = '<script src="../../plotly.js"></script>'
_SCRIPTS = "script-src 'unsafe-inline'"
"""What the page of a run allows; one of a sweep may load the sweep's plotly.js as well."""


def write_sweep_report(table: SweepTable, told: Callable[[str], None] = lambda line: None) -> Path:
    """Write `report.html` into a sweep's folder, and the pages of its runs into theirs.

    The pages share one `plotly.js`, so that a hundred of them stay small; they open from disk, and
    need no network. A page that is newer than its result is kept.

    Parameters
    ----------
    table : SweepTable
    told : callable
        told(line) is called after each page.

    Returns
    -------
    pathlib.Path
        The sweep's page.

    Raises
    ------
    InputError
        If a package is missing, or a file cannot be written.
    """
    require_packages()
    script = import_module("plotly.offline").get_plotlyjs()
    runs = [str(run) for run in table.columns["run"]]
    for number, run in enumerate(runs, start=1):
        folder = table.folder / run
        page, result = folder / "report.html", folder / "summary.json"
        if not run or not result.is_file():
            continue
        if not page.is_file() or page.stat().st_mtime < result.stat().st_mtime:
            text = write_report([Solution.load(folder)], page).read_text(encoding="utf-8")
            text = text.replace(f"<script>{script}</script>", _SHARED)
            write_files({page: text.replace(_SCRIPTS, f"{_SCRIPTS} file: 'self'").encode()})
            told(f"{number} of {len(runs)}: {page}")
    pages = [Path(run, "report.html") for run in runs]
    links = [page.as_posix() if (table.folder / page).is_file() else "" for page in pages]
    charts = {"front": _front(table, links), "map": _map(table, links)}
    good = int(np.sum(table.verified))
    failed = [
        f'<tr><th><a href="{links[at]}">{html.escape(runs[at] or "no run")}</a></th>'
        f"<td>{html.escape(table.columns['message'][at])}</td></tr>"
        for at in np.flatnonzero(~table.verified)
    ]
    text = Template((_TEMPLATES / "sweep.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(f"Sweep over {', '.join(table.sweep.over)}"),
        css=(_TEMPLATES / "report.css").read_text(encoding="utf-8"),
        lead=html.escape(f"{good} of {len(runs)} runs of {table.sweep.case} are verified."),
        failed="\n".join(failed) or "<tr><td>none</td></tr>",
        data=json.dumps(charts, allow_nan=False).replace("<", "\\u003c"),
    )
    out = table.folder / "report.html"
    write_files({table.folder / "plotly.js": script.encode(), out: text.encode()})
    return out


def _points(x: np.ndarray, y: np.ndarray, links: list[str], at: np.ndarray, **more: Any) -> dict:
    """Return some runs as a trace whose points have links."""
    found = {"x": x[at].tolist(), "y": y[at].tolist(), "customdata": [links[i] for i in at]}
    return {"type": "scatter", "mode": "markers", **found, **more}


def _layout(x: str, y: str) -> dict[str, Any]:
    axes = {"xaxis": {"title": {"text": x}}, "yaxis": {"title": {"text": y}}}
    return {**axes, "height": 460, "hovermode": "closest", "legend": {"orientation": "h", "y": 1.1}}


def _front(table: SweepTable, links: list[str]) -> dict[str, Any] | None:
    """Return the chart of the Pareto front."""
    if not table.cost or not table.verified.any():
        return None
    cost, place = table.columns[table.cost], table.front()
    known = np.flatnonzero(table.verified & np.isfinite(cost))
    line = {"mode": "lines+markers", "line": {"color": style.COLORS[1]}, "name": "Pareto front"}
    return {
        "data": [
            _points(cost, table.objective, links, known, name="verified", marker={"color": "#888"}),
            _points(cost, table.objective, links, place, **line),
        ],
        "layout": _layout(table.cost, table.label),
    }


def _map(table: SweepTable, links: list[str]) -> dict[str, Any] | None:
    """Return the chart of the objective over two keys."""
    if len(table.numeric) < 2 or not table.verified.any():
        return None
    x, y = (table.columns[key] for key in table.numeric[:2])
    good, bad = np.flatnonzero(table.verified), np.flatnonzero(~table.verified)
    shades = {"color": table.objective[good].tolist(), "colorscale": "Viridis", "size": 14}
    shades |= {"symbol": "square", "showscale": True, "colorbar": {"title": {"text": table.label}}}
    crosses = {"symbol": "x", "color": style.COLORS[1], "size": 9}
    kinds = [_points(x, y, links, good, name="verified", marker=shades)]
    if bad.size:
        kinds.append(_points(x, y, links, bad, name="no success", marker=crosses))
    return {"data": kinds, "layout": _layout(*table.numeric[:2])}
