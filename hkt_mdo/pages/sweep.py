"""The report of a sweep: its front and its map, and a page for each run behind a point."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path

from hkt_mdo.case.kinds import Extension
from hkt_mdo.files.table import write_files
from hkt_mdo.pages import plotly_script, rendered
from hkt_mdo.pages.page import write_report
from hkt_mdo.pages.panels import stacked
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.sweep import SweepTable
from hkt_mdo.results.sweep_plots import sweep_charts


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
    drawn = sweep_charts(table)
    charts = {x: stacked([drawn[x]], 300) if x in drawn else None for x in ("front", "map")}
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
    write_files({table.folder / "plotly.js": script.encode(), out: text.encode()})
    return out
