"""Runs that are interrupted, killed or out of disk: they say so, and they can be resumed."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hkt_mdo.case import load_case
from hkt_mdo.cli import main
from hkt_mdo.errors import InputError
from hkt_mdo.results import charts
from hkt_mdo.results.solution import Solution
from hkt_mdo.run import check, optimization, run

CASES = Path(__file__).parents[2] / "cases"
# from the given blade: a search for a start takes most of a short run
SHORT = ["phase.segments=15", "phase.duration=15", "start.method=blade"]
QUIET = ["--quiet", "--no-figures", *(part for each in SHORT for part in ("--set", each))]
posix = pytest.mark.skipif(os.name != "posix", reason="signals and limits of POSIX")


def case(name="sine_limited_quadratic", *overrides):
    return load_case(CASES / f"{name}.yaml", [*SHORT, *overrides])


def summary(folder):
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def energy(solution):
    """Return the energy of a success, to five digits."""
    assert solution.success, solution.message
    return pytest.approx(solution.summary.simulated_energy_J, rel=1e-5)


def interrupted(folder, *overrides, number=signal.SIGINT):
    """Run a case that is interrupted by a signal at its fifth evaluation."""

    def progress(count, energy, infeasibility):
        if count == 5:
            signal.raise_signal(number)

    with pytest.raises(KeyboardInterrupt):
        run.run_case(case("sine_limited_quadratic", *overrides), folder, progress=progress)
    return folder


def hkt(*arguments, **options):
    command = [sys.executable, "-m", "hkt_mdo", *map(str, arguments)]
    said = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    return subprocess.Popen(command, **said, **options)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "undisturbed"
    return run.run_case(case(), folder, figures=False)


@pytest.mark.parametrize("optimizer", ["IPOPT", "SLSQP"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_an_interrupted_run_says_so_and_is_resumed(tmp_path, undisturbed, optimizer, number):
    folder = interrupted(tmp_path / "out", f"driver.optimizer={optimizer}", number=number)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert summary(folder)["success"] is False
    assert "--resume" in summary(folder)["message"]
    assert (folder / "iterate.json").is_file()
    evaluations = Solution.load(folder).convergence["evaluation"].size
    resumed = run.resume_case(folder, figures=False)
    assert energy(resumed) == undisturbed.summary.simulated_energy_J
    assert resumed.convergence["evaluation"].size > evaluations
    assert resumed.summary.starts == undisturbed.summary.starts
    assert not (folder / "lock").exists()


def compiled_code_interrupted(*_, **__):
    """Fail as Python does when code compiled by numba returned although a handler had raised."""
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as interrupt:
        try:
            raise SystemError("returned a result with an exception set") from interrupt
        except SystemError as error:
            raise SystemError("returned a result with an exception set") from error


@pytest.mark.parametrize("where", ["make_physics", "_optimize_and_verify"])
def test_an_interrupt_in_compiled_code_is_one(tmp_path, monkeypatch, where):
    monkeypatch.setattr(run, where, compiled_code_interrupted)
    with pytest.raises(KeyboardInterrupt):
        run.run_case(case(), tmp_path / "out")
    if where != "make_physics":
        assert "--resume" in summary(tmp_path / "out")["message"]


@pytest.mark.parametrize(("command", "name"), [("run", "make_physics"), ("check", "physics")])
def test_an_interrupt_in_compiled_code_ends_a_command(monkeypatch, capsys, command, name):
    module = {"run": run, "check": check}[command]
    monkeypatch.setattr(module, name, compiled_code_interrupted)
    assert main([command, "sine_oloc", "--out", "nowhere"]) == 130
    assert "interrupted: nothing was saved" in capsys.readouterr().err


def test_resuming_a_success_changes_nothing(undisturbed):
    before = (undisturbed.folder / "summary.json").read_bytes()
    assert run.resume_case(undisturbed.folder).success
    assert (undisturbed.folder / "summary.json").read_bytes() == before


@pytest.mark.slow
def test_a_run_that_gave_up_is_resumed(tmp_path, undisturbed):
    folder = tmp_path / "out"
    few = ("driver.max_iterations=3", "start.method=quasi_steady")
    few = run.run_case(case("sine_limited_quadratic", *few), folder)
    assert not few.success
    assert "driver.max_iterations" in few.message
    (folder / "case.yaml").write_text(undisturbed.case.to_yaml(), encoding="utf-8")
    assert energy(run.resume_case(folder, figures=False)) == undisturbed.summary.simulated_energy_J


def test_a_corrupt_recorder_file_does_not_matter(tmp_path):
    folder = interrupted(tmp_path / "out")
    for name in ("history.db", "solution.db"):
        (folder / name).write_bytes(b"not a database")
    assert run.resume_case(folder, figures=False).success
    assert (folder / "history.db").read_bytes() == b"not a database"
    with sqlite3.connect(folder / "history_2.db") as database:
        assert database.execute("select count(*) from driver_iterations").fetchone()[0] > 1


def test_a_verdict_never_precedes_its_tables(tmp_path, monkeypatch):
    def starve(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(run, "write_tables", starve)
    with pytest.raises(OSError, match="No space"):
        run.run_case(case(), tmp_path / "out", figures=False)
    assert summary(tmp_path / "out")["success"] is False


@posix
@pytest.mark.parametrize(
    "size", [0, *(pytest.param(size, marks=pytest.mark.slow) for size in (3_000, 20_000, 100_000))]
)
def test_a_full_disk_is_reported(tmp_path, size):
    """A limit on the size of files stands for the disk."""
    import resource

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    folder = tmp_path / "out"
    process = hkt("run", "sine_limited_oloc", "--out", folder, *QUIET, preexec_fn=limit)
    said, _ = process.communicate()
    assert process.returncode == 2, said
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    if (folder / "summary.json").exists():
        assert summary(folder)["success"] is False


def test_a_full_disk_is_reported_by_that_word(tmp_path, monkeypatch):
    """SQLite's own words for it, when a recorder opens its file and when it writes."""
    error = sqlite3.OperationalError("database or disk is full")
    error.sqlite_errorcode = sqlite3.SQLITE_FULL

    def starve(*_):
        raise error

    for method in ("_initialize_database", "record_iteration_driver"):
        with monkeypatch.context() as patch:
            patch.setattr(optimization._Recorder, method, starve)
            with pytest.raises(InputError, match=r"out.*no space left on the device.*--resume"):
                run.run_case(case(), tmp_path / "out", force=True, figures=False)
        assert summary(tmp_path / "out")["success"] is False


@posix
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write")
def test_a_read_only_folder_is_reported(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir(mode=0o500)
    with pytest.raises(InputError, match="cannot be written"):
        run.run_case(case(), folder)


@posix
@pytest.mark.slow
@pytest.mark.parametrize("written", ["case.yaml", "iterate.json"], ids=["no start", "a start"])
def test_a_killed_run_is_resumed(tmp_path, undisturbed, written):
    folder = tmp_path / "out"
    process = hkt("run", "sine_limited_quadratic", "--out", folder, *QUIET)
    while not (folder / written).exists() and process.poll() is None:
        time.sleep(0.01)
    process.kill()
    process.communicate()
    assert not (folder / "summary.json").exists() or not summary(folder)["success"]
    process = hkt("run", "--resume", folder, "--quiet", "--no-figures")
    said, _ = process.communicate()
    assert process.returncode == 0, said
    assert energy(Solution.load(folder)) == undisturbed.summary.simulated_energy_J


def test_a_folder_that_is_taken_away_is_not_made_anew(tmp_path, monkeypatch):
    """Its figures are not written; the result is where the folder has gone."""

    def taken_away(solution):
        (tmp_path / "out").rename(tmp_path / "away")
        return {}

    monkeypatch.setattr(charts, "figures", taken_away)
    with pytest.raises(InputError, match="cannot be written"):
        run.run_case(case("sine_baseline_oloc"), tmp_path / "out", records=False)
    assert not (tmp_path / "out").exists()
    assert Solution.load(tmp_path / "away").success
