"""The whole case, `sine_limited_quadratic` from nothing: vectorized BEM against CCBlade."""

import json
import os
import statistics
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from cases import OPEN_LOOP, QUADRATIC, TimedBEM, case_of, integrate, optimize, start_of
from hkt_mdo import Solution
from hkt_mdo.case import load_case
from hkt_mdo.cli import main
from hkt_mdo.rotor import model
from hkt_mdo.run.run import run_case

ROOT = Path(__file__).parents[2]


def test_optimization(benchmark, full, in_turns, monkeypatch):
    """The optimization is at least 4 times faster, and BEM at most 15 % of it."""
    pytest.importorskip("wisdem")
    solvers = {name: TimedBEM(name) for name in model.SOLVERS}
    monkeypatch.setattr(model, "SOLVERS", solvers)
    size = 60 if full else 6
    cases = {name: case_of(segments=size, hydrodynamics=f"{{bem: {name}}}") for name in solvers}
    physics, setup = start_of(cases["vectorized"])
    solvers["ccblade"](physics.blade, physics.rotor.polar, setup.nodes[:2])  # imports WISDEM
    shares = {name: [] for name in cases}

    def run(name):
        solvers[name].seconds = 0.0
        began = time.perf_counter()
        result = optimize(replace(physics, case=cases[name]), setup)
        shares[name].append(solvers[name].seconds / (time.perf_counter() - began))
        return result

    times = in_turns({name: lambda name=name: run(name) for name in cases}, rounds=3 if full else 1)
    energies = {
        name: float(result[0].get_val("energy")[0]) for name, result in in_turns.results.items()
    }
    assert all(result[1].success for result in in_turns.results.values())
    assert energies["vectorized"] == pytest.approx(energies["ccblade"], rel=1e-7)
    ratio = times["ccblade"] / times["vectorized"]
    share = {name: statistics.median(values) for name, values in shares.items()}
    benchmark.extra_info |= {
        "times": times,
        "ratio": ratio,
        "bem_share": share,
        "energies": energies,
        "iterations": {n: result[1].iterations for n, result in in_turns.results.items()},
    }
    if full:
        assert ratio > 4.0
        assert share["vectorized"] < 0.15


def test_parts_of_a_run(benchmark, full, in_turns):
    """Search and start take no longer than the optimization."""
    case = case_of(segments=60 if full else 6)
    prepared = start_of(case)
    parts = {"start": lambda: start_of(case), "optimization": lambda: optimize(*prepared)}
    times = in_turns(parts, rounds=5 if full else 1)
    assert in_turns.results["optimization"][1].success
    benchmark.extra_info["times"] = times


def test_with_limits(benchmark, full, in_turns, tmp_path):
    """`hkt run` under all limits takes at most three times as long as under the torque limit.

    On the 40 stations that a case with limits has. Beside the processes from a cold start, with
    figures and records: the run alone, in a process that has imported all.
    """
    files = {"none": "sine_limited_oloc.yaml", "limits": "limits/all_oloc.yaml"}
    files = {name: ROOT / "cases" / path for name, path in files.items()}
    changes = ["rotor.station_count=40"]
    if not full:
        changes = ["rotor.station_count=9", "phase={duration: 5, segments: 5}"]
        changes.append("limits={thrust: 6 kN}")

    def run(name):
        case = load_case(files[name], changes)
        return run_case(case, tmp_path / name, force=True, figures=False, records=False).success

    def process(name):
        command = "run", files[name], "--out", f"{name}_process", "--force", "--quiet"
        command = *command, "--set", changes[0]
        words = "-W", "ignore", "-m", "hkt_mdo", *command
        return subprocess.run([sys.executable, *words], check=True, cwd=tmp_path).returncode == 0

    runs = {name: lambda name=name: run(name) for name in files}
    if full:
        runs |= {f"{name}, process": lambda name=name: process(name) for name in files}
    times = in_turns(runs, rounds=3 if full else 1)
    assert all(in_turns.results.values())
    benchmark.extra_info["times"] = times
    if full:
        assert times["limits, process"] < 3.0 * times["none, process"]


@pytest.mark.parametrize("segments", [60, 3000])
def test_integration(benchmark, full, in_turns, segments):
    """The independent integration agrees with the optimization; its time is quoted over it."""
    laws = {"open loop": OPEN_LOOP, "quadratic": QUADRATIC}
    size, times = segments if full else 10, {}
    for name, control in laws.items():
        case = case_of(control, segments=size)
        prepared = start_of(case)
        began = time.perf_counter()
        problem, ended, _ = optimize(*prepared)
        times[name] = {"optimization": time.perf_counter() - began}
        assert ended.success
        integrate(prepared[0], problem)  # what is compiled is compiled here
        began = time.perf_counter()
        simulated = integrate(prepared[0], problem)
        times[name]["integration"] = time.perf_counter() - began
        assert simulated.energy == pytest.approx(float(problem.get_val("energy")[0]), rel=2e-4)
    benchmark.extra_info["times"] = times
    benchmark.pedantic(lambda: integrate(prepared[0], problem), rounds=1, iterations=1)


def test_memory(benchmark, full, in_turns):
    """A simulation in which the wake has memory takes at most five times as long as without.

    Of results that `tests/data/openfast` keeps, each in a flow in which the rotor is stable.
    """
    ratios, kept = {}, ROOT / "tests" / "data" / "openfast"
    runs = {}
    flows = {"paper": 0.85, "rm1": 1.0, "river": 1.0} if full else {"paper": 0.85}
    for name, share in flows.items():
        quiet = Solution.load(kept / name).design()
        inflow = quiet.physics.inflow
        inflow = inflow if share == 1.0 else inflow.model_copy(update={"scale": share})
        for word, design in (("without", quiet), ("with", quiet.with_memory())):
            runs[name, word] = lambda design=design, inflow=inflow: design.simulate(inflow)
            runs[name, word]()  # what is compiled is compiled here
    times = in_turns(runs, rounds=3 if full else 1)
    for name, word in runs:
        assert in_turns.results[name, word].stopped_at is None
        ratios[name] = times[name, "with"] / times[name, "without"]
    benchmark.extra_info["ratios"] = ratios
    if full:
        assert max(ratios.values()) < 5.0


def test_process(benchmark, full, in_turns, tmp_path):
    """`hkt run` from a cold start is at least 2.5 times faster."""
    pytest.importorskip("wisdem")

    def run(name):
        out = tmp_path / name
        command = ["run", ROOT / "cases" / "sine_limited_quadratic.yaml", "--out", out]
        command += ["--force", "--no-figures", "--quiet"]
        command += ["--set", f"hydrodynamics.bem={name}", "--set", f"hydrodynamics.check={name}"]
        if full:
            program = [sys.executable, "-m", "hkt_mdo"]
            subprocess.run([*program, *command], check=True, cwd=tmp_path)
        else:
            command += ["--set", "phase={duration: 5, segments: 5}", "--set", "design.blade=fixed"]
            assert main(list(map(str, command))) == 0
        return json.loads((out / "summary.json").read_text())

    times = in_turns(
        {name: lambda name=name: run(name) for name in ("vectorized", "ccblade")},
        rounds=3 if full else 1,
    )
    energies = {name: summary["simulated_energy_J"] for name, summary in in_turns.results.items()}
    assert energies["vectorized"] == pytest.approx(energies["ccblade"], rel=1e-6)
    ratio = times["ccblade"] / times["vectorized"]
    benchmark.extra_info |= {"times": times, "ratio": ratio, "energies": energies}
    if full:
        assert ratio > 2.5


def test_over_the_imports(benchmark, full, in_turns, tmp_path):
    """`hkt run` from a cold start, over importing OpenMDAO and Dymos and doing nothing.

    Modules are compiled once, as they are for every user whose Python may write its cache.
    """
    path = ROOT / "cases" / "sine_limited_quadratic.yaml"
    small = ["--set", "phase={duration: 5, segments: 5}", "--set", "design.blade=fixed"]
    small = [] if full else [*small, "--no-figures"]
    caching = os.environ | {"PYTHONDONTWRITEBYTECODE": ""}
    commands = {
        "imports": ["-c", "import openmdao.api, dymos"],
        "run": ["-m", "hkt_mdo", "run", path, "--out", "out", "--force", "--quiet", *small],
    }
    times = in_turns(
        {
            name: lambda words=words: subprocess.run(
                [sys.executable, "-W", "ignore", *words], check=True, cwd=tmp_path, env=caching
            )
            for name, words in commands.items()
        },
        rounds=5 if full else 1,
    )
    benchmark.extra_info["times"] = times


def test_start_up(benchmark, full, in_turns, tmp_path):
    """Help and import, beside an interpreter that does nothing."""
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
        rounds=7 if full else 1,
    )
    code = "import sys, hkt_mdo, hkt_mdo.cli; print(*sys.modules)"
    loaded = subprocess.check_output([sys.executable, "-c", code], text=True, cwd=tmp_path).split()
    assert not {"wisdem", "matplotlib", "dymos", "openmdao", "casadi"} & set(loaded)
    benchmark.extra_info["times"] = times
