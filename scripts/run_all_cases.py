"""Run all shipped cases with both optimizers and compare them: `make cases`."""

import argparse
import os
import sys
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

from rich.console import Console
from rich.table import Table

from hkt_mdo.case import load_case
from hkt_mdo.run.batch import run_batch

AGREEMENT = 2e-4  # relative difference in energy that the optimizers may have


def main():
    """Run, print the table, exit with 3 unless every case succeeded and optimizers agree."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--cases",
        type=Path,
        default=Path(__file__).parent.parent / "cases",
        help="folder of case files",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("results/cases"), help="folder of the result folders"
    )
    parser.add_argument("--jobs", type=int, default=None, help="processes (default: one a core)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="section.key=value",
        help="override, for all cases",
    )
    arguments = parser.parse_args()

    optimizers = ("IPOPT", "SLSQP")
    files = sorted(arguments.cases.glob("*.yaml"))
    cases = {
        arguments.out / optimizer / file.stem: load_case(
            file, [f"driver.optimizer={optimizer}", *arguments.set]
        )
        for file in files
        for optimizer in optimizers
    }
    console = Console(width=150)
    solutions = run_batch(
        cases, arguments.jobs, lambda folder, word: console.print(f"  {folder}: {word}")
    )

    table = Table(
        "case",
        *(f"{o} simulated / J" for o in optimizers),
        "difference",
        "iterations",
        "gain",
        "share of bound",
    )
    good = True
    for file in files:
        pair = [solutions[arguments.out / optimizer / file.stem] for optimizer in optimizers]
        if any(solution is None or not solution.success for solution in pair):
            good = False
            words = [solution.summary.message if solution else "not run" for solution in pair]
            table.add_row(file.stem, *words, "", "", "", "")
            continue
        first, second = (solution.summary for solution in pair)
        difference = second.simulated_energy_J / first.simulated_energy_J - 1.0
        good = good and abs(difference) <= AGREEMENT
        table.add_row(
            file.stem,
            f"{first.simulated_energy_J:.1f}",
            f"{second.simulated_energy_J:.1f}",
            f"{difference:+.1e}",
            f"{first.iterations}, {second.iterations}",
            "" if first.gain is None else f"{first.gain:.3f}, {second.gain:.3f}",
            f"{first.simulated_energy_J / first.energy_bound_J:.6f}",
        )
    console.print(table)
    sys.exit(0 if good else 3)


if __name__ == "__main__":
    main()
