"""`hydrodynamics.torque`: BEM at every node gives the energy of the torque curve."""

from pathlib import Path

import numpy as np

from hkt_mdo.case import load_case
from hkt_mdo.run.batch import run_batch
from hkt_mdo.run.run import run_case

CASES = sorted((Path(__file__).parents[2] / "cases").glob("*.yaml"))


def test_direct_and_curve_agree(benchmark, full, tmp_path):
    """To 0.01 % of the energy, in all ten cases."""
    cases = CASES if full else [CASES[0]]
    overrides = [] if full else ["phase={duration: 10, segments: 10}"]
    runs = {
        tmp_path / torque / path.stem: load_case(
            path, [*overrides, f"hydrodynamics.torque={torque}"]
        )
        for path in cases
        for torque in ("curve", "direct")
    }

    def run():
        if full:
            return run_batch(runs)
        return {folder: run_case(case, folder, figures=False) for folder, case in runs.items()}

    solutions = benchmark.pedantic(run, rounds=1, iterations=1)
    rows = []
    for path in cases:
        curve, direct = (
            solutions[tmp_path / torque / path.stem].summary for torque in ("curve", "direct")
        )
        rows.append(
            {
                "case": path.stem,
                "curve": curve.simulated_energy_J,
                "direct": direct.simulated_energy_J,
                "seconds": [curve.wall_seconds, direct.wall_seconds],
                "success": [curve.success, direct.success],
            }
        )
    benchmark.extra_info["rows"] = rows
    difference = [row["direct"] / row["curve"] - 1.0 for row in rows]
    assert np.max(np.abs(difference)) < 1e-4
