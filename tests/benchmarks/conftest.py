"""Benchmarks check values as well as time; `make bench` runs them and writes docs/performance.md.

Every comparison is made within one run, in turns (A B A B), and quoted as a ratio of medians.
"""

import statistics
import time

import pytest


@pytest.fixture(autouse=True)
def _scratch(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENMDAO_WORKDIR", str(tmp_path))
    monkeypatch.setenv("OPENMDAO_REPORTS", "0")


@pytest.fixture
def in_turns(benchmark):
    """Return a function that calls functions in turns and returns their median times by name.

    Each call's last result is kept in `in_turns.results`; what the document needs goes to
    `benchmark.extra_info`.
    """

    def run(functions, rounds):
        times = {name: [] for name in functions}

        def one_turn():
            for name, function in functions.items():
                began = time.perf_counter()
                run.results[name] = function()
                times[name].append(time.perf_counter() - began)

        benchmark.pedantic(one_turn, rounds=rounds, iterations=1)
        return {name: statistics.median(values) for name, values in times.items()}

    run.results = {}
    return run
