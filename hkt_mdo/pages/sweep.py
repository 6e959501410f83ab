"""The report of a sweep: its front and its map, and a page for each run behind a point."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.case.kinds import Extension
from hkt_mdo.files.table import write_files
from hkt_mdo.pages import plotly_script, rendered
from hkt_mdo.pages.page import write_report
from hkt_mdo.results import style
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.sweep import SweepTable

RED = style.COLORS[1]


def write_sweep_report(
    table: SweepTable,
    told: Callable[[str], None] = lambda line: None,
    extensions: Iterable[Extension] = (),
) -> Path:
    """Write `report.html` into a sweep's folder, and the pages of its runs into theirs.

    The pages share one `plotly.js`, so that a hundred of them stay small; they open from disk, and
    need no network. A page that is newer than its result is kept.

    Parameters
    ----------
    table : SweepTable
        The table of the sweep.
    told : callable
        told(line) is called after each page.
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
    script = plotly_script()
    runs = [str(run) for run in table.columns["run"]]
    for number, run in enumerate(runs, start=1):
        folder = table.folder / run
        page, result = folder / "report.html", folder / "summary.json"
        if not run or not result.is_file():
            continue
        if not page.is_file() or page.stat().st_mtime < result.stat().st_mtime:
            solution = Solution.load(folder, extensions=extensions)
            write_report([solution], page, shared="../../plotly.js")
            told(f"{number} of {len(runs)}: {page}")
    pages = [Path(run, "report.html") for run in runs]
    made = [page.as_posix() if (table.folder / page).is_file() else "" for page in pages]
    links = np.array(made)
    charts = {"front": _front(table, links), "map": _map(table, links)}
    good = int(np.sum(table.verified))
    failed = [
        (links[at], runs[at] or "no run", table.columns["message"][at])
        for at in np.flatnonzero(~table.verified)
    ]
    text = rendered(
        "sweep.html",
        title=f"Sweep over {', '.join(table.sweep.over)}",
        lead=f"{good} of {len(runs)} runs of {Path(table.sweep.case).stem} are verified.",
        failed=failed,
        data=json.dumps(charts, allow_nan=False),
    )
    out = table.folder / "report.html"
    write_files({table.folder / "plotly.js": script.encode(), out: text.encode()})
    return out


def _front(table: SweepTable, links: np.ndarray) -> dict[str, Any] | None:
    """Return the chart of the Pareto front."""
    if not table.cost or not table.verified.any():
        return None
    (cost, across), (objective, up) = table.shown(table.cost), table.shown("objective")
    known = np.flatnonzero(table.verified & np.isfinite(cost))
    kinds = (known, {"color": "#888"}, "verified"), (table.front(), {"color": RED}, "Pareto front")
    return _chart(across, up, cost, objective, kinds, links)


def _map(table: SweepTable, links: np.ndarray) -> dict[str, Any] | None:
    """Return the chart of the objective over two keys."""
    if len(table.numeric) < 2 or not table.verified.any():
        return None
    good = np.flatnonzero(table.verified)
    objective, label = table.shown("objective")
    shades = {"color": objective[good].tolist(), "colorscale": "Viridis", "size": 14}
    shades |= {"symbol": "square", "showscale": True, "colorbar": {"title": {"text": label}}}
    crosses = (
        np.flatnonzero(~table.verified),
        {"symbol": "x", "color": RED, "size": 9},
        "no success",
    )
    (x, across), (y, up) = map(table.shown, table.numeric[:2])
    return _chart(across, up, x, y, ((good, shades, "verified"), crosses), links)


def _chart(
    across: str, up: str, x: np.ndarray, y: np.ndarray, kinds: Any, links: np.ndarray
) -> dict[str, Any]:
    """Return a chart of points with links, of some kinds: their places, markers and name."""
    data = [
        {"type": "scatter", "mode": "lines+markers" if name == "Pareto front" else "markers"}
        | {"x": x[at].tolist(), "y": y[at].tolist(), "customdata": links[at].tolist()}
        | {"name": name, "marker": marker}
        for at, marker, name in kinds
    ]
    layout = {"xaxis": {"title": {"text": across}}, "yaxis": {"title": {"text": up}}}
    look = {"height": 420, "hovermode": "closest", "legend": {"orientation": "h", "y": 1.12}}
    look["margin"] = {"l": 60, "r": 20, "t": 40, "b": 50}
    return {"data": data, "layout": {**layout, **look}}
