"""Sweeps: what a run costs beside its optimization, and what a second worker gives."""

import time
from functools import partial
from pathlib import Path

from hkt_mdo.case import load_case
from hkt_mdo.run import passes
from hkt_mdo.run.engine import in_processes
from hkt_mdo.run.run import run_case
from hkt_mdo.run.sweep import run_one

CASE = Path(__file__).parents[2] / "cases" / "sine_limited_quadratic.yaml"
SMALL = ["phase.duration=10", "phase.segments=10"]


def one(case, folder):
    """Return the seconds of a run, and those of its optimization alone, as a worker takes them."""
    alone, solve = [], passes.solve

    def timed(*arguments, **more):
        began = time.perf_counter()
        try:
            return solve(*arguments, **more)
        finally:
            alone.append(time.perf_counter() - began)

    passes.solve = timed
    try:
        began = time.perf_counter()
        row = run_one(case, folder, None, run_case)
        whole = time.perf_counter() - began
    finally:
        passes.solve = solve
    assert row["state"] == "verified"
    return whole, sum(alone)


def work(folder, count, workers, full):
    """Return when each of some runs ended, and its times, on some workers."""
    ended, times = [], []

    def done(_, future):
        ended.append(time.perf_counter())
        times.append(future.result())

    torques = [f"control.torque_limit={680 + number}" for number in range(count)]
    cases = [load_case(CASE, [torque, *([] if full else SMALL)]) for torque in torques]
    tasks = [(x, partial(one, case, folder / str(x))) for x, case in enumerate(cases)]
    in_processes(tasks, workers, done)
    return ended, times


def test_workers(benchmark, full, tmp_path):
    """A whole run over its optimization; two workers do at least 1.6 times as much as one.

    The first runs of each worker, which import and compile, are left out. Scheduler and client
    share the cores with the workers.
    """
    warm, count = (4, 24) if full else (1, 2)
    results = {}

    def both():
        for workers in (1, 2):
            results[workers] = work(tmp_path / str(workers), warm + count, workers, full)

    benchmark.pedantic(both, rounds=1, iterations=1)
    rates = {}
    for workers, (ended, _) in results.items():
        rates[workers] = count / (ended[-1] - ended[warm - 1])
    wholes, alone = zip(*results[1][1][warm:], strict=True)
    middle = sorted(whole / part for whole, part in zip(wholes, alone, strict=True))[count // 2]
    benchmark.extra_info |= {
        "whole": sorted(wholes)[count // 2],
        "alone": sorted(alone)[count // 2],
        "over_optimization": middle,
        "rates": {str(workers): rate for workers, rate in rates.items()},
    }
    if full:
        assert rates[2] > 1.6 * rates[1]
