"""The commands that run many cases: paper, verify."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import count as count_from
from pathlib import Path
from typing import Annotated

from typer import Argument, Exit, Option, echo

from hkt_mdo.cli.parts import NO_SUCCESS, CaseFolder, Folder, Jobs, Seed


def _clock() -> Callable[[str], None]:
    """Return what prints a line after the seconds since now."""
    began = time.perf_counter()
    return lambda line: echo(f"[{time.perf_counter() - began:7.1f} s] {line}")


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

    data = reproduce(out, cases, jobs, repeats, seed, _clock())
    failed = [check for check in data["checks"] if not check["passed"]]
    echo(f"{len(data['checks']) - len(failed)} of {len(data['checks'])} checks hold")
    for check in failed:
        asked = f"asked {check['low']} to {check['high']}"
        echo(f"  not: {check['statement']} = {check['value']}, {asked}")
    echo(f"Report: {out / 'report.html'}")
    if failed:
        raise Exit(NO_SUCCESS)


_PARTS = "All of them by default."
_COUNT = (
    "Starts a case (30; of limits and laws 20), random mixtures of the sweep (30), flows with "
    "features (300), examples a kind of file (1500), or tries a fault (12)."
)
_BLADES = "Folder of turbines in windIO's format (*.yaml) for the part real, besides RM1."
_REPORT = "Markdown file to write: the figures of all parts that the folder holds."


def verify(
    parts: Annotated[list[str] | None, Argument(metavar="PART...", help=_PARTS)] = None,
    out: Folder = Path("results/verification"),
    cases: CaseFolder = None,
    count: Annotated[int | None, Option(min=1, max=100_000, help=_COUNT)] = None,
    seed: Seed = 0,
    jobs: Jobs = None,
    report: Annotated[Path | None, Option(metavar="FILE", help=_REPORT)] = None,
    blades: Annotated[Path | None, Option(metavar="FOLDER", help=_BLADES)] = None,
) -> None:
    """Run the verification study, or parts of it.

    Parts: starts (random blades, with the program's own start), blades (random blades without it),
    limits (random blades under limits), laws (random blades with laws for the whole range), sweep
    (other sizes, flows, torque limits, polars), physics (stationarity, energy balance, refinement),
    features (gusts and steps between the nodes), real (blades of several sections), fuzz (mutilated
    files) and faults (killed, no disk, no folder, no
    home). It takes hours; what is finished is reused, so it can be interrupted.
    """
    from hkt_mdo.studies import verify as study

    tell, finished = _clock(), count_from(1)

    def done(folder: Path, word: str) -> None:
        number = next(finished)
        if word != "reused":
            tell(f"{number}: {folder}: {word}")

    for part in parts or study.PARTS:
        echo(study.run_part(part, out, cases, count, seed, jobs, done, blades))
    if report is not None:
        report.write_text(study.report(out), encoding="utf-8")
        echo(f"Report: {report}")
