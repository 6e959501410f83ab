"""The command that runs many cases: paper."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from typer import Exit, Option, echo

from hkt_mdo.cli.parts import NO_SUCCESS, CaseFolder, Folder, Jobs, Seed


def paper(
    out: Folder = Path("results/paper"),
    cases: CaseFolder = None,
    jobs: Jobs = None,
    repeats: Annotated[int, Option(min=2, max=10_000, help="Noisy runs of each design.")] = 20,
    seed: Seed = 1,
) -> None:
    """Reproduce the paper's tables and figures.

    Tables II to V and Figs. 3 to 12 of Amini et al. (ACC 2023) from the shipped cases, beside the
    paper's numbers: paper.json, report.md and report.html. Finished parts are reused, so it can be
    interrupted.
    """
    from hkt_mdo.studies.paper import reproduce

    began = time.perf_counter()

    def told(line: str) -> None:
        echo(f"[{time.perf_counter() - began:7.1f} s] {line}")

    data = reproduce(out, cases, jobs, repeats, seed, told)
    failed = [check for check in data["checks"] if not check["passed"]]
    echo(f"{len(data['checks']) - len(failed)} of {len(data['checks'])} checks hold")
    for check in failed:
        expected = f"expected {check['low']} to {check['high']}"
        echo(f"  not: {check['statement']} = {check['value']}, {expected}")
    echo(f"Report: {out / 'report.html'}")
    if failed:
        raise Exit(NO_SUCCESS)
