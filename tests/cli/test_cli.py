"""The command line: exit codes, one line for each error, and what a command passes on."""

import csv
import errno
import io
import json
import re
import shutil
import sys
import types
import warnings
from pathlib import Path

import pytest

from hkt_mdo.cli import main
from hkt_mdo.errors import InputError
from hkt_mdo.problem.point import StartRecord
from hkt_mdo.results.solution import Solution
from tests.conftest import edit_summary

ROOT = Path(__file__).parents[2]
CASE = str(ROOT / "cases" / "sine_limited_quadratic.yaml")
EXTENSION = str(ROOT / "tests" / "data" / "extension.py")


class FakeRun(types.ModuleType):
    """In place of `hkt_mdo.run.run`: remembers what it was asked for and does as it is told."""

    def __init__(self, result):
        super().__init__("hkt_mdo.run.run")
        self.result, self.error, self.saves = result, None, False

    def run_case(self, case, out, *, progress=None, on_pass=None, on_start=None, **options):
        self.case, self.out, self.options = case, out, options
        if progress is not None:
            on_start(StartRecord("best blade", "overspeed", 3e5, 0.0, (), law="open_loop"))
            progress(1, 320000.0, 1e-3)
            done = {"number": 1, "converged": True, "iterations": 9, "objective_J": 1.0}
            on_pass(types.SimpleNamespace(**done, remedy="a finer mesh", why="of errors"))
        if self.saves:
            out.mkdir(parents=True, exist_ok=True)
            (out / "summary.json").write_text("{}")
        if self.error is not None:
            raise self.error
        return Solution.load(self.result)

    def resume_case(self, out, *, extensions=(), **_):
        self.out, self.extensions = out, extensions
        return Solution.load(self.result, extensions=extensions)

    def write_n2(self, case, path):
        path.write_text(case.name)


@pytest.fixture(autouse=True)
def _own_folder(own_environment, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def fake(monkeypatch, result_folder):
    module = FakeRun(result_folder)
    monkeypatch.setitem(sys.modules, "hkt_mdo.run.run", module)
    monkeypatch.setattr("hkt_mdo.run.run", module, raising=False)
    return module


def fail(folder):
    """Make a result one without success."""
    checks = json.loads((folder / "summary.json").read_text())["checks"]
    checks[1] |= {"passed": False, "value": 0.25}
    edit_summary(folder, success=False, message="the optimizer did not converge", checks=checks)


# Exit codes and messages --------------------------------------------------------------------------


def test_run_succeeds_and_is_plain_in_a_pipe(fake, capsys, monkeypatch):
    monkeypatch.setattr("hkt_mdo.cli.run._SECONDS_BETWEEN_LINES", 0.0)
    assert main(["run", CASE, "--out", "a/b"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("sine_limited_quadratic: searching for a start\n")
    assert out.endswith("\nsine_limited_quadratic: verified. Results: a/b\n")
    assert "322.24 kJ" in out
    assert "0 s, start 1, best blade on overspeed, open loop: 300.00 kJ\n" in out
    assert "pass 1 converged in 9 iterations, 1.0000 J; next, a finer mesh: of errors" in out
    assert "\x1b" not in out
    assert err == ""
    assert fake.out == Path("a/b")
    assert fake.options == {"force": False, "figures": True, "records": True}
    assert fake.case.name == "sine_limited_quadratic"
    assert main(["run", CASE, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    for arguments, word in ([], "hkt new"), (["--version"], "hkt_mdo "):
        assert main(arguments) == 0
        assert word in capsys.readouterr().out


@pytest.mark.parametrize("options", [[], ["--quiet"]])
def test_run_without_success_exits_with_3(fake, result_folder, capsys, options):
    fail(result_folder)
    assert main(["run", CASE, *options]) == 3
    out, err = capsys.readouterr()
    assert "error: no success: the optimizer did not converge" in err
    assert ("energy_error: 0.25, at most 0.0002" in out) == (not options)
    assert main(["show", str(result_folder)]) == 0
    out = capsys.readouterr().out
    assert "energy_error: 0.25, at most 0.0002" in out.partition("Checks not passed")[2]


@pytest.mark.parametrize("saves", [True, False])
def test_interrupted_run_exits_with_130(fake, capsys, saves):
    fake.error, fake.saves = KeyboardInterrupt(), saves
    assert main(["run", CASE, "--out", "here"]) == 130
    message = "the results so far are saved in here: summary.json" if saves else "nothing was saved"
    assert f"interrupted: {message}" in capsys.readouterr().err


ERRORS = [
    (InputError("folder exists", "give --force", file="a"), 2, "a: folder exists; give --force"),
    (OSError(errno.ENOSPC, "No space left on device", "a.csv"), 2, "a.csv: cannot be .*space"),
    (MemoryError(), 2, "out of memory"),
    (TypeError("a\nb"), 1, r"TypeError: a b \(an error of this program"),
    (ImportError("OPENMDAO_USE_MPI is true."), 2, "OPENMDAO_USE_MPI is set, and mpi4py cannot"),
]


@pytest.mark.parametrize(("error", "code", "message"), ERRORS)
def test_errors_are_one_line(fake, capsys, error, code, message):
    fake.error = error
    assert main(["run", CASE, "--quiet"]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert re.search(message, err)


BAD = [
    ("run not_here.yaml", "not_here.yaml: does not exist"),
    ("run CASE --optimizer nelder", "did you mean|give one of IPOPT"),
    ("run CASE --segments many", "integer"),
    ("run CASE --pdf --no-figures", "give one of them"),
    ("--extend not_here.py run CASE", "not_here.py"),
    ("run", "CASE"),
    ("run sine_oloc sine_oloc", "name = 'sine_oloc': is the name of two cases"),
    ("run --resume .", "case.yaml"),
    ("run --resume . --segments 10", "give no other"),
    ("verify", "verify"),
    ("show RESULT --json --csv", "give one of --json and --csv"),
    ("plot .", "lacks case.yaml"),
    ("plot RESULT --out file", "file"),
]


@pytest.mark.parametrize(("command", "message"), BAD)
def test_bad_input_exits_with_2(result_folder, capsys, command, message):
    Path("file").touch()
    places = {"CASE": CASE, "RESULT": str(result_folder)}
    arguments = [places.get(word, word) if command != "run" else word for word in command.split()]
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert re.search(message, " ".join(err.split()))
    assert "Traceback" not in err


@pytest.mark.filterwarnings("default::RuntimeWarning")
def test_warnings_of_libraries_are_not_shown(fake, capsys, monkeypatch):
    def run_case(*_, **__):
        for category in UserWarning, RuntimeWarning:
            warnings.warn_explicit("theirs", category, json.__file__, 1, json.__name__)
        return Solution.load(fake.result)

    monkeypatch.setattr(fake, "run_case", run_case)
    show = warnings.showwarning
    assert main(["run", CASE, "--quiet"]) == 0
    assert not capsys.readouterr().err
    assert warnings.showwarning is show


# What is passed on --------------------------------------------------------------------------------


def test_run_passes_everything_on(fake):
    words = "--force --no-figures --optimizer slsqp --package scipy --segments 17"
    overrides = ["--set", "rotor.radius=2", "--set", "phase.segments=5"]
    assert main(["run", CASE, *words.split(), *overrides]) == 0
    assert fake.out == Path("results/sine_limited_quadratic")
    assert fake.options == {"force": True, "figures": False, "records": True}
    assert (fake.case.driver.optimizer, fake.case.driver.package) == ("SLSQP", "scipy")
    assert (fake.case.phase.segments, fake.case.rotor.radius) == (17, 2.0)
    assert main(["run", CASE, "--no-records", "--pdf"]) == 0
    assert fake.options == {"force": False, "figures": ("png", "pdf"), "records": False}


def test_extensions_are_known_wherever_a_case_is_read(fake, result_folder, capsys):
    extend, ramp = ["--extend", EXTENSION], ["--set", "inflow={profile: ramp}"]
    assert main(["run", CASE, *ramp]) == 2
    assert main([*extend, "run", CASE, *ramp]) == 0
    assert fake.case.inflow.profile == "ramp"
    assert main(["n2", CASE, *ramp, *extend]) == 0
    (result_folder / "case.yaml").write_text(fake.case.to_yaml(), encoding="utf-8")
    capsys.readouterr()
    assert main(["show", str(result_folder)]) == 2
    assert "inflow.profile = 'ramp': unknown" in capsys.readouterr().err
    for command in (["show"], ["plot", "--format", "svg"], ["compare"]):
        assert main([*extend, *command, str(result_folder)]) == 0
    assert main([*extend, "schema"]) == 0
    assert "tip_acceleration" in capsys.readouterr().out
    assert main([*extend, "run", "--resume", str(result_folder)]) == 0
    assert fake.extensions == (Path(EXTENSION),)


def test_plot_draws_the_figures(result_folder, capsys):
    assert main(["plot", str(result_folder), "--format", "svg"]) == 0
    assert (result_folder / "figures" / "operation.svg").is_file()
    assert main(["plot", str(result_folder), "--out", "there"]) == 0
    names = {Path(line).name for line in capsys.readouterr().out.splitlines()[7:]}
    assert names == {path.name for path in Path("there").iterdir()}
    assert {Path(name).suffix for name in names} == {".png"}
    for path in result_folder.glob("*.csv"):
        path.unlink()
    (result_folder / "summary.json").write_text('{"success": false}')
    assert main(["plot", str(result_folder)]) == 2
    assert "holds no data to draw" in capsys.readouterr().err


# What is printed ----------------------------------------------------------------------------------


def records_of(printed, form):
    """Return what --json or --csv printed; an empty cell is None."""
    if form == "--json":
        return json.loads(printed)
    rows = csv.DictReader(io.StringIO(printed))
    return [{key: cell or None for key, cell in row.items()} for row in rows]


@pytest.mark.parametrize("form", ["--json", "--csv"])
def test_show_and_compare_print_for_programs(result_folder, linear_result_folder, form, capsys):
    assert main(["show", str(result_folder), form]) == 0
    rows = {row["quantity"]: row for row in records_of(capsys.readouterr().out, form)}
    assert (float(rows["energy"]["value"]), rows["energy"]["unit"]) == (322239.0, "J")
    assert form == "--csv" or isinstance(rows["rotor speed, relative error"]["value"], float)
    ratio = Solution.load(result_folder).summary.tip_speed_ratio
    ends = [float(rows["tip speed ratio"][key]) for key in ("value", "up_to")]
    assert ends == pytest.approx([ratio.min, ratio.max], rel=1e-12)
    folders = [str(result_folder), str(linear_result_folder)]
    assert main(["compare", *folders, form]) == 0
    rows = records_of(capsys.readouterr().out, form)
    assert {row["result"] for row in rows} == set(folders)


def shares(out):
    """Return the differences of the objective that a comparison prints."""
    (line,) = (line for line in out.splitlines() if ", relative to the best" in line)
    return re.findall(r"[+-][\d.]+ %", line)


def test_compare_ranks_by_the_objective_and_cuts_no_name(tmp_path, result_folder, capsys):
    long = "a_result_whose_name_is_longer_than_a_column_of_a_narrow_terminal_[bold]"
    for name, energy in ((long, 3.0e5), ("best", 3.2e5), ("refused", 3.3e5), ("broken_off", None)):
        shutil.copytree(result_folder, tmp_path / name)
        edit_summary(tmp_path / name, simulated_energy_J=energy)
    edit_summary(tmp_path / "broken_off", success=False, message="interrupted", checks=None)
    fail(tmp_path / "refused")
    assert main(["compare", long, "best", "refused", "broken_off", "--out", "there"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[0].split() == ["best", long, "refused", "broken_off"]
    assert shares(out) == ["+0.0000 %", "-6.2500 %", "+3.1250 %"]
    assert err == "note: broken_off: interrupted; it is not ranked and not in the figures\n"
    assert Path("there/operation.png").stat().st_size > 1000


def test_compare_tells_stations_and_that_flows_differ(result_folder, tmp_path, capsys):
    shutil.copytree(result_folder, tmp_path / "other")
    case = Solution.load(result_folder).case.with_overrides("inflow={profile: constant, speed: 1}")
    (tmp_path / "other" / "case.yaml").write_text(case.to_yaml())
    assert main(["compare", str(result_folder), "other"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"\n *stations +9 +9 *\n[^~]*note: the flows differ", out)


def test_compare_ranks_by_mean_power_where_durations_differ(tmp_path, result_folder, capsys):
    for name, seconds, joules in (("long", 20, 3.0e5), ("short", 10, 2.0e5)):
        shutil.copytree(result_folder, tmp_path / name)
        edit_summary(tmp_path / name, simulated_energy_J=joules)
        case = tmp_path / name / "case.yaml"
        case.write_text(case.read_text().replace("duration: 60.0", f"duration: {seconds}"))
    assert main(["compare", "long", "short"]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0].split() == ["short", "long"]
    assert "objective over duration, relative" in out
    assert shares(out) == ["+0.0000 %", "-25.0000 %"]
