"""What each part of search, optimizer and refinement changes; writes docs/dev/ablation.md.

python studies/ablation.py --runs results/reference/NAME [--only TEXT] [--jobs 2]

`--runs` holds the results of `scripts/reference_runs.py run NAME=PYTHON`. A part is switched off in
the cases in which it had a share; others would run as before. Results that are there are kept.
"""

import argparse
import math
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import page_data
from study_common import markdown_table

from hkt_mdo.case import load_case
from hkt_mdo.problem import build as problems
from hkt_mdo.results.solution import Solution
from hkt_mdo.run import passes, refine
from hkt_mdo.run.run import run_case
from hkt_mdo.solve import stationary
from hkt_mdo.start import find, steady
from hkt_mdo.start.result import GIVEN

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))
SKIPPED = "turbines/", "river25/open_loop"  # parts of the names of cases that take too long
SAME = 1e-5  # relative difference of objectives that counts as none
MANY = 30  # iterations from which it is asked whether a Hessian was forgotten
ALIKE = 0.1  # relative difference of iterations that counts as none
OPTIMA = find.Search.optima


def went_on(text, result):
    """Tell whether a run went on after an optimization for some reason."""
    return any(text in f"{each.remedy} {each.why}" for each in result.summary.passes)


def began(strategy, result):
    """Tell whether a run began at an optimum from some blade."""
    return any(each.kept and each.strategy == strategy for each in result.summary.starts or ())


def tied(result):
    """Tell whether a run began at another optimum than the best without time."""
    ends = [each for each in result.summary.starts or () if each.law == result.case.control.law]
    best = max(ends, key=lambda start: start.objective or 0.0, default=None)
    return best is not None and not best.kept


def stagnated(result):
    """Tell whether the last optimization ended where no iterate was better, not at a small gap."""
    most = stationary.NO_GAP * result.case.driver.tolerance
    details = [each.detail or "" for each in result.summary.checks or ()]
    messages = [each for each in details if each.startswith("no better iterate")]
    return any(float(each.split()[-1]) > most for each in messages)


def open_loop(result):
    """Tell whether torque is free over time."""
    return result.case.control.law == "open_loop"


def branches(result):
    """Tell whether the limits have branches on which they can be kept."""
    return bool(result.summary.branches)


def iterations_of(result):
    """Return the iterations of all optimizations."""
    return sum(each.iterations for each in result.summary.passes)


def blades(without):
    """Return a patch of the search that leaves out a blade to begin with."""

    def optima(self, candidates):
        return OPTIMA(self, [each for each in candidates if each.strategy != without])

    return find.Search, "optima", optima


PARTS = {  # in which runs a part has a share, and what switches it off
    "a finer torque curve": (
        partial(went_on, "torque curve"),
        [(passes, "curve_errors", lambda result: ((), ()))],
    ),
    "divided segments": (
        partial(went_on, "too coarse"),
        [(refine.Division, "allowed", lambda self, optimizer: False)],
    ),
    "polynomials of order 5": (partial(went_on, "of order"), [(refine, "HIGHER_ORDER", 0)]),
    "limits lowered between the nodes": (
        partial(went_on, "between the nodes"),
        [(passes, "lowered", lambda setup, verifications: (setup.shares, 0.0))],
    ),
    "a branch whose torque jumps comes second": (
        lambda result: len(result.summary.branches or ()) > 1,
        [(find, "_jumps", lambda physics, point: False)],
    ),
    "no finer torque curve of a start at a jump": (
        lambda result: len(result.summary.branches or ()) > 1,
        [(steady, "KEPT", math.inf)],
    ),
    "the heaviest of rotors that tie": (
        tied,
        [(find.Search, "_heaviest", lambda self, optima: optima[0])],
    ),
    "search from the given blade": (partial(began, GIVEN), [blades(GIVEN)]),
    "search from a slower rotor": (partial(began, find.SLOWER[0]), [blades(find.SLOWER[0])]),
    "search from a faster rotor": (partial(began, find.FASTER[0]), [blades(find.FASTER[0])]),
    "search from a solid blade": (
        partial(began, find.CONSTANT),
        [(find.Search, "_at_constant_torque", lambda self: ())],
    ),
    "search with a loss of 8 % of the speed": (
        lambda result: branches(result) and not open_loop(result),
        [(find, "FARTHER", find.SLOWED)],
    ),
    "search with a loss of 2 % of the speed": (
        lambda result: branches(result) and result.case.control.law in ("linear", "quadratic"),
        [(find, "SLOWED", find.FARTHER)],
    ),
    "search that goes on at a gap": (open_loop, [(steady, "TIE", math.inf)]),
    "a first rotor with inertia": (
        open_loop,
        [(passes, "in_motion", lambda physics, point: point)],
    ),
    "the end of optimizations that stagnate": (stagnated, [(stationary, "PATIENCE", 10**6)]),
    "the end at a small gap": (open_loop, [(stationary, "NO_GAP", 0.0)]),
    "a Hessian that is kept when steps are skipped": (
        lambda result: not open_loop(result) and iterations_of(result) > MANY,
        [(problems, "MOST_SKIPPED", 2)],
    ),
    "a barrier that does not grow on finer meshes": (
        lambda result: open_loop(result) and went_on("too coarse", result),
        [(problems, "LARGEST_BARRIER", 100.0)],
    ),
}


def run_without(part, arguments, out):
    """Run a case with a part switched off."""
    for owner, name, value in PARTS[part][1]:
        setattr(owner, name, value)
    case = load_case(arguments[0], arguments[2::2])
    run_case(case, out, force=True, figures=False, records=False)


def result_of(folder):
    """Return the result in a folder; None if its run was refused before its end."""
    solution = Solution.load(folder) if (folder / "summary.json").is_file() else None
    return solution if solution and solution.summary.objective else None


def row_of(part, case, arguments, runs, out):
    """Run a case without a part unless that is done, and return the row of the table."""
    before, folder = result_of(runs / case), out / part.replace(" ", "_") / case
    if result_of(folder) is None:
        command = [sys.executable, __file__, "--without", part, "--out", folder, "--", *arguments]
        subprocess.run(command, capture_output=True, check=False)
    after = result_of(folder)
    print(part, case, after and after.summary.message, flush=True)
    values = [each and each.summary.objective.simulated for each in (before, after)]
    counts = [iterations_of(each) if each else 0 for each in (before, after)]
    return {
        "part": part,
        "case": case,
        "verified": bool(after and after.success),
        "change": values[1] / values[0] - 1.0 if all(values) else None,
        "iterations": counts,
    }


def from_data(results):
    """Return the page of results."""
    cells = []
    for part in PARTS:
        rows = [row for row in results["rows"] if row["part"] == part]
        telling = [row for row in rows if differs(row)]
        refused = [row for row in telling if not row["verified"]]
        other = [row for row in telling if row["verified"] and abs(row["change"]) > SAME]
        slower = [row for row in telling if row not in refused + other]
        cells.append((
            part,
            listed(refused, lambda row: ""),
            listed(other, lambda row: f" {row['change']:+.1e}"),
            listed(slower, lambda row: " {1}/{0}".format(*row["iterations"])),
            str(len(rows) - len(telling)),
        ))  # fmt: skip
    return "\n".join([INTRODUCTION, *markdown_table(HEADER, cells)]) + "\n"


def listed(rows, words):
    """Return the names of the cases of rows, each with some words."""
    return ", ".join(f"`{row['case'].removeprefix('cases/')}`{words(row)}" for row in rows)


def differs(row):
    """Tell whether a row shows that a part changes something."""
    before, after = row["iterations"]
    changed = row["change"] is None or abs(row["change"]) > SAME
    return changed or not row["verified"] or abs(after - before) > ALIKE * before


HEADER = "without", "refused", "another objective", "other iterations", "no change, cases"
INTRODUCTION = """\
# What each part of the method is for

Written by `python studies/ablation.py`. Each part of the search, the optimizer and the refinement \
is switched off, one at a time, in the reference cases in which it has a share, all verified with \
all parts. Then some are refused; some have another objective, by the relative difference that is \
given; some take other iterations, those without the part over those with it. Changes below 10⁻⁵ \
of the objective and a tenth of the iterations count as none. Where parts replace each other, one \
at a time shows too little. Left out are the random turbines, and `river25` with open \
loop, whose better branch has a torque that jumps; without the last part it takes 127 s for 73.
"""


def main():
    """Run what the arguments say, and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("arguments", nargs="*", help=argparse.SUPPRESS)
    parser.add_argument("--without", choices=PARTS, help=argparse.SUPPRESS)
    parser.add_argument("--runs", type=Path, help="results of the reference cases")
    parser.add_argument("--out", type=Path, default=Path("results/ablation"))
    parser.add_argument("--only", default="", help="parts whose names contain this text")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    if asked.without:
        run_without(asked.without, asked.arguments, asked.out)
        return
    from reference_runs import reference_cases

    cases = {name: arguments for name, arguments in reference_cases(asked.out).items()
             if not any(part in name for part in SKIPPED)}  # fmt: skip
    results = {name: result for name in cases if (result := result_of(asked.runs / name))}
    pairs = [(part, name) for part, (share, _) in PARTS.items() if asked.only in part
             for name, result in results.items() if share(result)]  # fmt: skip
    with ThreadPoolExecutor(asked.jobs) as pool:
        rows = list(pool.map(lambda x: row_of(*x, cases[x[1]], asked.runs, asked.out), pairs))
    if not asked.only:
        page_data.page_from("ablation", from_data, rows=rows)


if __name__ == "__main__":
    main()
