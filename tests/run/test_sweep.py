"""Sweeps on real schedulers and workers, which die; a stand-in in place of most runs."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import Future
from functools import partial
from operator import attrgetter
from pathlib import Path

import pytest
import stand_in

import hkt_mdo
from hkt_mdo.case.sweep import load_sweep
from hkt_mdo.cli import main
from hkt_mdo.errors import InputError
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.sweep import SweepTable
from hkt_mdo.run import engine
from hkt_mdo.run.engine import in_processes, why_failed
from hkt_mdo.run.sweep import run_sweep
from tests.conftest import edit_summary

ROOT = Path(__file__).parents[2]
SHORT = "set: {phase.duration: 10, phase.segments: 10, design.blade: fixed}\n"


def sweep_of(folder, over, more=SHORT):
    """Return a sweep of the shipped case, read from a file in a folder."""
    path = folder / "some.yaml"
    path.write_text(f"case: sine_limited_quadratic\nover: {over}\n{more}", encoding="utf-8")
    return load_sweep(path)


def start(*words, **more):
    """Start a Python process in which the package and the stand-in can be imported."""
    paths = os.pathsep.join(map(str, (ROOT, Path(__file__).parent)))
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    environment = os.environ | {"PYTHONPATH": paths, "PYTHONWARNINGS": "ignore"}
    return subprocess.Popen([sys.executable, *map(str, words)], env=environment | more, **quiet)


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """Return the address of a scheduler with two worker processes on the loopback interface."""
    folder = tmp_path_factory.mktemp("dask")
    path = folder / "address"
    common = "--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", path
    workers = "--nworkers", 2, "--nthreads", 1, "--local-directory", folder
    made = [start("-m", "dask", "scheduler", "--port", 0, *common)]
    made.append(start("-m", "dask", "worker", *common, *workers))
    try:
        for _ in range(400):
            if path.exists() and path.stat().st_size:
                break
            time.sleep(0.05)
        yield json.loads(path.read_text())["address"]
    finally:
        for process in made:
            process.kill()  # and their workers with them
            process.wait()


@pytest.mark.slow
def test_workers_that_die_lose_nothing(scheduler, tmp_path):
    """One result a case, none computed twice, although workers are killed, once in each way."""
    sweep = sweep_of(tmp_path, "{control.torque_limit: {from: 640, to: 672, count: 33}}")
    deaths = Counter(filter(None, map(stand_in.death, range(640, 673))))
    assert set(deaths) == {*stand_in.DEATHS}
    states, state = [], attrgetter("total", "reused", "computed", "failed", "left", "older")
    how = {"report": lambda x: states.append(state(x)), "scheduler": scheduler, "run": stand_in.run}
    rows = run_sweep(sweep, tmp_path / "out", **how)
    assert [row["objective"] for row in rows] == [float(x) for x in range(640, 673)]
    assert {row["state"] for row in rows} == {"verified"}
    log = Counter((tmp_path / "out" / "runs" / "log").read_text().split())
    assert len(log) == 33
    assert set(log.values()) == {1}
    assert states[-1] == (33, 0, 33, 0, 0.0, 0)
    assert states[16][4] > 0.0


@pytest.mark.slow
def test_real_runs_on_a_scheduler(scheduler, tmp_path, monkeypatch):
    """Two runs; a worker of another version; a folder not shared."""
    sweep = sweep_of(tmp_path, "{control.torque_limit: [600, 700]}")
    rows = run_sweep(sweep, tmp_path / "out", scheduler=scheduler)
    for row, limit in zip(rows, (600.0, 700.0), strict=True):
        solution = Solution.load(tmp_path / "out" / row["run"])
        assert solution.success
        assert solution.case.control.torque_limit == limit == row["control.torque_limit"]
        assert row["objective"] == solution.summary.objective.simulated
    assert rows[0]["objective"] < rows[1]["objective"]
    with pytest.raises(InputError, match=r"does not see it; results are written by the workers"):
        in_processes([(1, dict)], None, print, scheduler, tmp_path / "nowhere")
    other = engine.versions() | {"hkt_mdo": "0.1.0, source 0", "Python": "3.9.1"}
    monkeypatch.setattr(engine, "versions", lambda: other)
    monkeypatch.setattr(engine, "_introduce", own_versions)
    with pytest.raises(InputError, match=r"worker tcp.*Python 3\.1\d.* \(here 3\.9\.1\)") as caught:
        in_processes([(1, dict)], None, print, scheduler)
    assert "same environment" in str(caught.value)


def own_versions(folder):
    """Return what a worker says of itself, whatever the client's module is made to say."""
    return engine.versions(), True


@pytest.mark.slow
def test_a_client_that_is_killed_goes_on(here, tmp_path):
    sweep = sweep_of(tmp_path, "{control.torque_limit: [901, 902, 903, 904]}")
    out = tmp_path / "out"
    client = start(stand_in.__file__, tmp_path / "some.yaml", out)
    deadline = time.monotonic() + 60.0
    log = out / "runs" / "log"
    while not log.exists() or len(log.read_text().split()) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    client.send_signal(signal.SIGKILL)
    client.wait()
    reused = []
    rows = run_sweep(sweep, out, 1, lambda status: reused.append(status.reused), run=stand_in.run)
    assert [row["objective"] for row in rows] == [901.0, 902.0, 903.0, 904.0]
    assert reused[-1] >= 1
    log = log.read_text().split()
    assert {path.parent.name for path in out.glob("runs/*/summary.json")} == {*log}
    assert len(log) <= 5  # one may have been at work


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_told_in_time(tmp_path):
    sweep = sweep_of(tmp_path, "{control.torque_limit: [600, 700]}")
    began = time.monotonic()
    with pytest.raises(InputError, match=r"scheduler = 'tcp://127.0.0.1:1': no scheduler answers"):
        run_sweep(sweep, tmp_path / "out", scheduler="tcp://127.0.0.1:1")
    assert time.monotonic() - began < 10.0


@pytest.mark.parametrize("address", ["localhost:8786", "http://localhost", "tcp://", ""])
def test_an_address_is_tcp_or_tls(address):
    with pytest.raises(InputError, match="give tcp://HOST:PORT or tls://HOST:PORT"):
        in_processes([(1, dict)], None, print, address)


@pytest.fixture
def here(monkeypatch):
    """Make the calls of a sweep in this process."""

    def in_this_process(tasks, jobs, ended, scheduler=None, folder=None):
        for key, task in tasks:
            future = Future()
            try:
                future.set_result(task())
            except Exception as error:
                future.set_exception(error)
            ended(key, future)

    monkeypatch.setattr("hkt_mdo.run.sweep.in_processes", in_this_process)
    monkeypatch.setattr(stand_in, "death", lambda torque: None)


def test_a_bad_case_is_a_row(here, tmp_path):
    """A combination without a case, a run that raises, and one case at two points."""

    def run(case, folder, **more):
        if case.control.torque_limit == 700.0:
            raise ArithmeticError("as an optimizer may")
        return stand_in.run(case, folder, **more)

    loop = "{law: open_loop, torque_limit: 600}", "{law: open_loop, torque_limit: 600 N m}"
    laws = ", ".join((*loop, "{law: quadratic, torque_limit: 700}"))
    sweep = sweep_of(tmp_path, f"{{control: [{laws}], phase.final_speed: [free, initial]}}")
    rows = run_sweep(sweep, tmp_path / "out", run=run)
    assert [row["state"] for row in rows] == ["verified"] * 4 + ["error"] * 2
    assert [rows[0]["run"], rows[1]["run"]] == [rows[2]["run"], rows[3]["run"]]
    assert rows[4]["message"] == "ArithmeticError: as an optimizer may"
    assert "phase.final_speed = 'initial': is for open loop" in rows[5]["message"]
    assert len((tmp_path / "out" / "runs" / "log").read_text().split()) == 2
    table = SweepTable.load(tmp_path / "out")
    assert table.verified.tolist() == [True] * 4 + [False] * 2
    assert table.columns["control"][0] == '{"law": "open_loop", "torque_limit": 600}'


def test_keys_of_numbers_stay_numbers_and_outcomes_have_columns_of_their_own(here, tmp_path):
    over = "{objective: [captured, electrical], phase.segments: {from: 10, to: 20, count: 2}, "
    over += "phase.duration: [9 s], control: [{law: open_loop, torque_limit: 700}, "
    over += "{law: quadratic, torque_limit: 700}], phase.final_speed: [free, initial]}"
    rows = run_sweep(sweep_of(tmp_path, over, ""), tmp_path / "out", run=stand_in.run)
    assert [row["state"] for row in rows] == [*["verified"] * 3, "error"] * 4
    assert [row["phase.duration"] for row in rows] == [9.0] * 16
    table = SweepTable.load(tmp_path / "out")
    assert table.numeric == ["phase.segments", "phase.duration"]
    assert table.columns["case.objective"].tolist() == ["captured"] * 8 + ["electrical"] * 8
    assert table.objective[table.verified].tolist() == [700.0] * 12


@pytest.mark.parametrize("column", ["", "objective,"])
def test_a_sweep_without_a_result_has_a_report_and_no_figures(here, tmp_path, column, capsys):
    run_sweep(sweep_of(tmp_path, "{rotor.radius: [1.2, 1.5]}"), tmp_path / "out", run=None)
    header, *lines = (tmp_path / "out" / "table.csv").read_text().splitlines()
    lines = [column + header, *("," * bool(column) + x for x in lines)]
    (tmp_path / "out" / "table.csv").write_text("\n".join(lines))
    assert main(["report", str(tmp_path / "out")]) == 0
    assert main(["plot", str(tmp_path / "out")]) == 2
    assert "has no verified run to draw" in capsys.readouterr().err


def test_a_neighbour_wins_only_with_a_better_result(here, tmp_path, monkeypatch):
    """From the neighbour's design the stand-in's objective is better by 1 per cent, or worse."""
    monkeypatch.setattr(stand_in, "FACTORS", {700.0: 1.01, 500.0: 0.99})
    more = f"neighbours: true\n{SHORT}"
    sweep = sweep_of(tmp_path, "{control.torque_limit: [600, 700, 500]}", more)
    sources = []

    def run(case, folder, **more):
        sources.extend([case.start.from_] if case.start.from_ else [])
        return stand_in.run(case, folder, **more)

    rows = run_sweep(sweep, tmp_path / "out", run=run)
    assert [row["start"] for row in rows] == ["own", "neighbour", "own"]
    assert [row["objective"] for row in rows] == pytest.approx([600.0, 707.0, 500.0])
    assert sources == [str(tmp_path / "out" / rows[index]["run"]) for index in (0, 1)]
    again = hkt_mdo.sweep(tmp_path / "some.yaml", str(tmp_path / "out"), run=None)
    assert [row["start"] for row in again] == ["own", "neighbour", "own"]


def test_a_result_of_another_version_is_told(here, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("hkt_mdo.run.sweep.run_sweep", partial(run_sweep, run=stand_in.run))
    sweep, out = sweep_of(tmp_path, "{control.torque_limit: [600, 700]}"), tmp_path / "out"
    rows = run_sweep(sweep, out, run=stand_in.run)
    for changed in (False, True):
        assert main(["sweep", str(tmp_path / "some.yaml"), "--out", str(out)]) == 0
        message = "results of another version, or of other files, are computed again"
        assert (message in capsys.readouterr().out) == changed
        edit_summary(out / rows[0]["run"], digest="older")


def test_other_files_are_not_written_among(tmp_path):
    sweep = sweep_of(tmp_path, "{control.torque_limit: [600, 700]}")
    with pytest.raises(InputError, match="holds files that are not of a sweep"):
        run_sweep(sweep, tmp_path)


@pytest.mark.parametrize("option", [["--jobs", "1"], ["--scheduler", "tcp://its.workers:1"]])
def test_a_million_runs_are_asked_back(here, tmp_path, capsys, monkeypatch, option):
    monkeypatch.setattr("hkt_mdo.run.sweep.run_sweep", partial(run_sweep, run=stand_in.run))
    torque, mean = "{from: 500, to: 700, count: 1000}", "{from: 1, to: 2, count: 1000}"
    sweep_of(tmp_path, f"{{control.torque_limit: {torque}, inflow.mean: {mean}}}")
    words = ["sweep", str(tmp_path / "some.yaml"), "--out", str(tmp_path / "out")]
    assert main([*words, *option]) == 2
    message = capsys.readouterr().err
    assert re.search(r"asks for 1,000,000 runs, which take about .* on 1 worker;", message)
    assert "--yes runs them all" in message


def test_why_a_task_failed_is_one_line():
    assert why_failed(InputError("is bad", "mend it", key="a")) == "a: is bad; mend it"
    died = type("KilledWorker", (Exception,), {})
    assert why_failed(died("x")) == "its worker died 4 times: out of memory, or killed"
