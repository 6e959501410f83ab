"""What one problem of many flows costs: set-up, an iteration and memory as the flows grow."""

import json
import subprocess
import sys
import time

import numpy as np
import pytest
from test_iteration import iteration, peak_memory

from cases import start_of
from hkt_mdo.case import load_case
from hkt_mdo.problem.build import assemble

FLOWS = {"quadratic": (1, 10, 30, 100), "open_loop": (1, 10, 30)}
LIMITS = {"power": "5 kW", "thrust": "6.5 kN", "stress": "100 MPa"}


def measure(flows, law, duration=60.0):
    """Return the cost of a few iterations of flows of a minute; run in a process of its own."""
    river = {"profile": "turbulence", "length_scale": 4, "cutoff": 0.5, "seed": 1}
    case = load_case(
        {
            "scenarios": [{"inflow": river, "realizations": flows}],
            "control": {"law": law, "torque_limit": 700},
            "limits": LIMITS,
            "robustness": "cvar" if flows > 1 else "expected",
            "phase": {"duration": duration},
            "start": {"method": "blade"},
            "driver": {"max_iterations": 5},
        }
    )
    physics, setup = start_of(case)
    began = time.process_time()
    problem = assemble(physics, setup)
    problem.final_setup()
    built = time.process_time()
    problem.run_model()
    problem.run_driver()
    ended, once = time.process_time(), iteration(problem)
    once()
    samples = []
    for _ in range(5):
        start = time.process_time()
        totals = once()
        samples.append(time.process_time() - start)
    return {
        "flows": flows,
        "setup": built - began,
        "iteration": (ended - built) / max(problem.driver.outcome().iterations, 1),
        "evaluation": float(np.median(samples)),
        "memory_MB": peak_memory(),
        "nonzeros": int(totals.nnz),
    }


@pytest.mark.parametrize("law", ["quadratic", "open_loop"])
def test_growth_of_flows(benchmark, full, law, tmp_path):
    """Set-up, time of an iteration and memory grow no faster than the number of flows."""

    def run(flows):
        code = f"from test_many_flows import *; print(json.dumps(measure({flows}, {law!r})))"
        command = [sys.executable, "-W", "ignore", "-c", code]
        return json.loads(
            subprocess.check_output(command, text=True, cwd=tmp_path).splitlines()[-1]
        )

    if full:
        rows = benchmark.pedantic(
            lambda: [run(each) for each in FLOWS[law]], rounds=1, iterations=1
        )
    else:
        rows = [measure(each, law, 2.0) for each in (1, 3)]
    benchmark.extra_info["rows"] = rows
    first, last = rows[1 if full else 0], rows[-1]  # less alone is mostly what all numbers share
    steps = np.log(last["flows"] / first["flows"])
    slopes = {
        name: float(np.log(last[name] / first[name]) / steps)
        for name in ("setup", "evaluation", "memory_MB", "nonzeros")
    }
    benchmark.extra_info["slopes"] = slopes
    assert slopes["nonzeros"] < 1.02
    if full:
        assert max(slopes.values()) < 1.25
