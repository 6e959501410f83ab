"""A year: the co-design of blade and gain for all speeds of a resource takes seconds."""

import time

import numpy as np

from hkt_mdo.case import load_case
from hkt_mdo.run.run import run_case

WEIBULL = {"profile": "distribution", "scale": 1.5, "shape": 2.2, "cut_in": 0.7}
CASES = {
    "quadratic, 700 N m": {"control": {"law": "quadratic", "torque_limit": 700.0}},
    "rated, 5 kW": {"control": {"law": "rated"}, "limits": {"power": "5 kW"}},
    "open loop, 5 kW": {"control": "open_loop", "limits": {"power": "5 kW"}},
}


def test_year(benchmark, full, tmp_path):
    """Bins of half the width change the energy by 0.2 % at most."""
    cases = CASES if full else {name: CASES[name] for name in list(CASES)[:1]}
    rows = []

    def run():
        for name, sections in cases.items():
            for width in (0.1, 0.05) if full else (0.2, 0.1):
                data = {"resource": WEIBULL | {"bin_width": width}, **sections}
                began = time.process_time()
                out = tmp_path / f"{name} {width}"
                solution = run_case(load_case(data), out, figures=False, records=False)
                seconds = time.process_time() - began
                energy = solution.summary.scenarios["phase"].year.energy_kWh
                speeds = solution.simulation["time_s"].size
                rows.append([name, speeds, energy, seconds, solution.summary.iterations])
                assert solution.success, solution.message

    benchmark.pedantic(run, rounds=1, iterations=1)
    benchmark.extra_info["rows"] = rows
    energies = np.array([row[2] for row in rows]).reshape(-1, 2)
    assert np.max(np.abs(energies[:, 1] / energies[:, 0] - 1.0)) < (2e-3 if full else 1e-2)
