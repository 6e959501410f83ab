"""The whole case, `sine_limited_quadratic` from nothing: vectorized BEM against CCBlade."""

import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cases import TimedBEM, case_of, optimize, start_of
from hkt_mdo.problem import build as problem

ROOT = Path(__file__).parents[2]


def test_optimization(benchmark, in_turns, monkeypatch):
    """The optimization is at least 4 times faster, and BEM at most 15 % of it."""
    pytest.importorskip("wisdem")
    solvers = {name: TimedBEM(name) for name in problem.BEM}
    monkeypatch.setattr(problem, "BEM", solvers)
    cases = {name: case_of(hydrodynamics=f"{{bem: {name}}}") for name in solvers}
    prepared = start_of(cases["vectorized"])
    solvers["ccblade"](prepared[0].blade, prepared[0].polar, prepared[2][:2])  # imports WISDEM
    shares = {name: [] for name in cases}

    def run(name):
        solvers[name].seconds = 0.0
        began = time.perf_counter()
        found = optimize(cases[name], prepared)
        shares[name].append(solvers[name].seconds / (time.perf_counter() - began))
        return found

    times = in_turns({name: lambda name=name: run(name) for name in cases}, rounds=3)
    energies = {
        name: float(found[0].get_val("energy")[0]) for name, found in in_turns.results.items()
    }
    assert all(found[1].success for found in in_turns.results.values())
    assert energies["vectorized"] == pytest.approx(energies["ccblade"], rel=1e-7)
    ratio = times["ccblade"] / times["vectorized"]
    share = {name: statistics.median(values) for name, values in shares.items()}
    benchmark.extra_info |= {
        "times": times,
        "ratio": ratio,
        "bem_share": share,
        "energies": energies,
        "iterations": {n: found[1].iterations for n, found in in_turns.results.items()},
    }
    assert ratio > 4.0
    assert share["vectorized"] < 0.15


def test_process(benchmark, in_turns, tmp_path):
    """`hkt run` from a cold start is at least 2.5 times faster."""
    pytest.importorskip("wisdem")

    def run(name):
        out = tmp_path / name
        command = [sys.executable, "-m", "hkt_mdo", "run"]
        command += [ROOT / "cases" / "sine_limited_quadratic.yaml", "--out", out]
        command += ["--set", f"hydrodynamics.bem={name}", "--set", f"hydrodynamics.check={name}"]
        subprocess.run([*command, "--force", "--no-figures", "--quiet"], check=True, cwd=tmp_path)
        return json.loads((out / "summary.json").read_text())

    times = in_turns(
        {name: lambda name=name: run(name) for name in ("vectorized", "ccblade")}, rounds=3
    )
    energies = {name: found["simulated_energy_J"] for name, found in in_turns.results.items()}
    assert energies["vectorized"] == pytest.approx(energies["ccblade"], rel=1e-6)
    ratio = times["ccblade"] / times["vectorized"]
    benchmark.extra_info |= {"times": times, "ratio": ratio, "energies": energies}
    assert ratio > 2.5


def test_start_up(benchmark, in_turns, tmp_path):
    """What nothing costs: help and import, over an interpreter that does nothing."""
    commands = {
        "python": ["-c", "pass"],
        "import hkt_mdo": ["-c", "import hkt_mdo"],
        "hkt --help": ["-m", "hkt_mdo", "--help"],
    }
    times = in_turns(
        {
            name: lambda words=words: subprocess.run(
                [sys.executable, *words], check=True, cwd=tmp_path, capture_output=True
            )
            for name, words in commands.items()
        },
        rounds=7,
    )
    code = "import sys, hkt_mdo, hkt_mdo.cli; print(*sys.modules)"
    loaded = subprocess.check_output([sys.executable, "-c", code], text=True, cwd=tmp_path).split()
    assert not {"wisdem", "matplotlib", "dymos", "openmdao", "casadi"} & set(loaded)
    benchmark.extra_info["times"] = times
    assert times["hkt --help"] < 0.5
