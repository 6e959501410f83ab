"""Benchmarks check values as well as time; `make bench` writes docs/dev/performance.md.

Every comparison is made within one run, in turns (A B A B), and quoted as a ratio of medians.
Without `--benchmark-enable` each benchmark runs once and small, as a test that it still works:
values are checked, times are not.
"""

import os
import statistics
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def pytest_itemcollected(item):
    if Path(__file__).parent in item.path.parents:
        item.add_marker(pytest.mark.slow)


@pytest.fixture(autouse=True)
def _scratch(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENMDAO_WORKDIR", str(tmp_path))
    monkeypatch.setenv("OPENMDAO_REPORTS", "0")
    # processes started in other folders get the package of this checkout, too
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(map(str, (ROOT, Path(__file__).parent))))


@pytest.fixture
def full(benchmark):
    """Whether this is a real measurement: of the full size, its times asserted."""
    return benchmark.enabled


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
