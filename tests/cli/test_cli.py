"""The command line: exit codes, messages, and no waiting for imports that are not needed."""

import csv
import errno
import io
import json
import os
import re
import shutil
import subprocess
import sys
import types
import warnings
from functools import partial
from pathlib import Path

import pytest
from rich.console import Console
from typer.main import get_command

from hkt_mdo.case import Case
from hkt_mdo.cli import app, main
from hkt_mdo.errors import InputError
from hkt_mdo.results.solution import Solution

ROOT = Path(__file__).parents[2]
CASE = str(ROOT / "cases" / "sine_limited_quadratic.yaml")


class FakeRun(types.ModuleType):
    """In place of `hkt_mdo.run.run`: remembers what it was asked for and does as it is told."""

    def __init__(self) -> None:
        super().__init__("hkt_mdo.run.run")
        self.result: Path | None = None
        self.error: BaseException | None = None
        self.saves = False

    def run_case(
        self,
        case: Case,
        out: Path,
        *,
        force=False,
        progress=None,
        on_pass=None,
        figures=True,
        records=True,
    ):
        self.case, self.out, self.force, self.figures = case, out, force, figures
        self.records = records
        if progress is not None:
            progress(1, 320000.0, 1e-3)
        if self.saves:
            out.mkdir(parents=True, exist_ok=True)
            (out / "summary.json").write_text("{}")
        if self.error is not None:
            raise self.error
        return Solution.load(self.result)

    def resume_case(self, out: Path, *, extensions=(), **_: object):
        self.out, self.extensions = out, extensions
        return Solution.load(self.result)

    def write_n2(self, case: Case, path: Path) -> None:
        path.write_text(case.name)


@pytest.fixture(autouse=True)
def _own_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(os, "environ", os.environ.copy())
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, result_folder: Path) -> FakeRun:
    module = FakeRun()
    module.result = result_folder
    monkeypatch.setitem(sys.modules, "hkt_mdo.run.run", module)
    monkeypatch.setattr("hkt_mdo.run.run", module, raising=False)
    return module


def fail(folder: Path) -> None:
    """Make a result one without success."""
    path = folder / "summary.json"
    summary = json.loads(path.read_text())
    summary |= {"success": False, "message": "the optimizer did not converge"}
    summary["checks"][1] |= {"passed": False, "value": 0.25}
    path.write_text(json.dumps(summary))


def test_run_succeeds(fake: FakeRun, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", CASE, "--out", "a/b"]) == 0
    out, err = capsys.readouterr()
    assert "322.24 kJ" in out
    assert out.endswith("\nsine_limited_quadratic: verified. Results: a/b\n")
    assert err == ""
    assert (fake.out, fake.force, fake.figures) == (Path("a/b"), False, True)
    assert fake.case.name == "sine_limited_quadratic"


def test_run_passes_everything_on(fake: FakeRun) -> None:
    code = main(
        [
            *("run", CASE, "--force", "--no-figures", "--optimizer", "slsqp", "--package", "scipy"),
            *("--segments", "17", "--set", "rotor.radius=2", "--set", "phase.segments=5"),
        ]
    )
    assert code == 0
    assert fake.out == Path("results/sine_limited_quadratic")
    assert (fake.force, fake.figures, fake.records) == (True, False, True)
    assert (fake.case.driver.optimizer, fake.case.driver.package) == ("SLSQP", "scipy")
    assert (fake.case.phase.segments, fake.case.rotor.radius) == (17, 2.0)
    assert main(["run", CASE, "--no-records"]) == 0
    assert fake.records is False


def test_run_draws_pdf_where_asked(
    fake: FakeRun, result_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", CASE, "--pdf"]) == 0
    assert fake.figures == ("png", "pdf")
    assert main(["run", CASE, "--pdf", "--no-figures"]) == 2
    assert "give one of them" in " ".join(capsys.readouterr().err.split())


EXTENSION = str(ROOT / "tests" / "data" / "extension.py")


def test_extensions_are_known_wherever_a_case_is_read(
    fake: FakeRun, result_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    extend, ramp = ["--extend", EXTENSION], ["--set", "inflow={profile: ramp}"]
    assert main(["run", CASE, *ramp]) == 2
    assert main([*extend, "run", CASE, *ramp]) == 0
    assert fake.case.inflow.profile == "ramp"
    assert main([*extend, "n2", CASE, *ramp]) == 0
    (result_folder / "case.yaml").write_text(fake.case.to_yaml(), encoding="utf-8")
    capsys.readouterr()
    assert main(["show", str(result_folder)]) == 2
    assert "inflow.profile = 'ramp': unknown" in capsys.readouterr().err
    for command in (["show"], ["plot", "--format", "svg"], ["compare"]):
        assert main([*extend, *command, str(result_folder)]) == 0
    assert main([*extend, "schema"]) == 0
    assert "tip_acceleration" in capsys.readouterr().out


def test_resume_is_given_the_extensions(fake: FakeRun, result_folder: Path) -> None:
    assert main(["run", "--resume", str(result_folder)]) == 0
    assert list(fake.extensions) == []
    assert main(["--extend", EXTENSION, "run", "--resume", str(result_folder)]) == 0
    assert list(fake.extensions) == [Path(EXTENSION)]


def test_run_quietly_prints_nothing(fake: FakeRun, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", CASE, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("options", [[], ["--quiet"]])
def test_run_without_success_exits_with_3(
    fake: FakeRun,
    result_folder: Path,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
) -> None:
    fail(result_folder)
    assert main(["run", CASE, *options]) == 3
    out, err = capsys.readouterr()
    assert "error: no success: the optimizer did not converge" in err
    assert ("energy_error: 0.25, at most 0.0002" in out) == (not options)


@pytest.mark.parametrize("saves", [True, False])
def test_interrupted_run_exits_with_130(
    fake: FakeRun, capsys: pytest.CaptureFixture[str], saves: bool
) -> None:
    fake.error, fake.saves = KeyboardInterrupt(), saves
    assert main(["run", CASE, "--out", "here"]) == 130
    told = "the results so far are saved in here: summary.json" if saves else "nothing was saved"
    assert f"interrupted: {told}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (
            InputError("folder exists", "give --force", file="a"),
            2,
            "a: folder exists; give --force",
        ),
        (OSError(errno.ENOSPC, "No space left on device", "a.csv"), 2, "a.csv: cannot be .*space"),
        (MemoryError(), 2, "out of memory"),
        (TypeError("a\nb"), 1, r"TypeError: a b \(an error of this program"),
        (
            ImportError("Importing MPI failed and OPENMDAO_USE_MPI is true."),
            2,
            "variable OPENMDAO_USE_MPI is set, and mpi4py cannot be imported; unset the variable",
        ),
    ],
)
def test_errors_are_one_line(
    fake: FakeRun, capsys: pytest.CaptureFixture[str], error: Exception, code: int, told: str
) -> None:
    fake.error = error
    assert main(["run", CASE, "--quiet"]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert re.search(told, err)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["run", "not_here.yaml"], "not_here.yaml: does not exist"),
        (["run", CASE, "--optimizer", "nelder"], "did you mean|give one of IPOPT"),
        (["run", CASE, "--set", "rotor.radus=1"], "unknown key; did you"),
        (["run", CASE, "--segments", "many"], "integer"),
        (["--extend", "not_here.py", "run", CASE], "not_here.py"),
        (["run"], "CASE"),
        (["verify"], "verify"),
        (["show", "not_here"], "not_here: does not exist"),
        (["plot", "."], "lacks case.yaml"),
    ],
)
def test_bad_input_exits_with_2(
    capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert re.search(told, err)
    assert "Traceback" not in err


@pytest.mark.filterwarnings("default::RuntimeWarning")
def test_only_our_warnings_are_shown(
    fake: FakeRun, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import hkt_mdo.errors

    def run_case(*_: object, **__: object) -> Solution:
        for text, category, module in (
            ("ours", UserWarning, hkt_mdo.errors),
            ("of numbers", RuntimeWarning, hkt_mdo.errors),
            ("theirs", UserWarning, json),
        ):
            warnings.warn_explicit(text, category, module.__file__, 1, module.__name__)
        return Solution.load(fake.result)

    monkeypatch.setattr(fake, "run_case", run_case)
    show = warnings.showwarning
    assert main(["run", CASE, "--quiet"]) == 0
    assert capsys.readouterr().err == "warning: ours\n"
    assert warnings.showwarning is show


def test_n2_writes_to_the_given_file(fake: FakeRun, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["n2", CASE]) == 0
    assert capsys.readouterr().out == "sine_limited_quadratic_n2.html\n"
    assert Path("sine_limited_quadratic_n2.html").is_file()
    assert main(["n2", CASE, "--out", "a.html", "--set", "name=other"]) == 0
    assert Path("a.html").read_text() == "other"


def test_show_prints_tables(
    result_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show", str(result_folder)]) == 0
    out = capsys.readouterr().out
    assert "10.98 N m s^2/rad^2" in out
    titles = ["Result", "Blade and controller", "Operation, limits and loads", "Optimization"]
    assert re.findall(r"^\w.*$", out, re.MULTILINE) == titles
    fail(result_folder)
    terminal = partial(Console, width=80, force_terminal=True, color_system="standard")
    monkeypatch.setattr("hkt_mdo.cli.parts.Console", terminal)
    assert main(["show", str(result_folder)]) == 0
    refused = capsys.readouterr().out.partition("Checks not passed")[2]
    assert "\x1b[31menergy_error: 0.25, at most 0.0002" in refused


def records_of(printed: str, form: str) -> list[dict]:
    """Return what --json or --csv printed; an empty cell is None."""
    if form == "--json":
        return json.loads(printed)
    rows = csv.DictReader(io.StringIO(printed))
    return [{key: cell or None for key, cell in row.items()} for row in rows]


@pytest.mark.parametrize("form", ["--json", "--csv"])
def test_show_and_compare_print_for_programs(
    result_folder: Path, linear_result_folder: Path, form: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show", str(result_folder), form]) == 0
    rows = {row["quantity"]: row for row in records_of(capsys.readouterr().out, form)}
    assert (float(rows["energy"]["value"]), rows["energy"]["unit"]) == (322239.0, "J")
    ratio = Solution.load(result_folder).summary.tip_speed_ratio
    ends = [float(rows["tip speed ratio"][key]) for key in ("value", "up_to")]
    assert ends == pytest.approx([ratio.min, ratio.max], rel=1e-12)
    folders = [str(result_folder), str(linear_result_folder)]
    assert main(["compare", *folders, form]) == 0
    rows = records_of(capsys.readouterr().out, form)
    assert {row["result"] for row in rows} == set(folders)
    assert main(["show", folders[0], "--json", "--csv"]) == 2
    assert "give one of --json and --csv" in " ".join(capsys.readouterr().err.split())


def test_check_prints_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", CASE, "--json"]) == 0
    out, err = capsys.readouterr()
    rows = json.loads(out)
    (torque,) = (row for row in rows if row["quantity"] == "control.torque_limit")
    assert set(torque) == {"part", "quantity", "value", "up_to", "unit", "note"}
    assert "can be run" in err


def energy(folder: Path, value: float | None) -> str:
    """Give a result another simulated energy, or make it one of an interrupted run."""
    path = folder / "summary.json"
    summary = json.loads(path.read_text()) | {"simulated_energy_J": value}
    if value is None:
        summary |= {"success": False, "message": "interrupted before the end", "checks": None}
    path.write_text(json.dumps(summary))
    return str(folder)


def test_compare_ranks_by_the_objective_and_cuts_no_name(
    tmp_path: Path, result_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    long = "a_result_whose_name_is_longer_than_a_column_of_a_narrow_terminal_[bold]"
    given = {long: 3.0e5, "best": 3.2e5, "refused": 3.3e5, "broken_off": None}
    for name, value in given.items():
        shutil.copytree(result_folder, tmp_path / name)
        energy(tmp_path / name, value)
    fail(tmp_path / "refused")
    assert main(["compare", *given, "--out", "there"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[0].split() == ["best", long, "refused", "broken_off"]
    (shares,) = (line for line in out.splitlines() if "to the best" in line)
    assert re.findall(r"[+-][\d.]+ %", shares) == ["+0.0000 %", "-6.2500 %", "+3.1250 %"]
    assert err == (
        "note: broken_off: interrupted before the end; it is not ranked and not in the figures\n"
    )


def test_compare_ranks_by_mean_power_where_durations_differ(
    tmp_path: Path, result_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, seconds, joules in (("long", 20, 3.0e5), ("short", 10, 2.0e5)):
        shutil.copytree(result_folder, tmp_path / name)
        energy(tmp_path / name, joules)
        case = Path(tmp_path / name, "case.yaml")
        text = re.sub(r"duration: null", f"duration: {seconds}", case.read_text(), count=1)
        case.write_text(text)
    assert main(["compare", "long", "short"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["short", "long"]
    (shares,) = (line for line in lines if "objective over duration, relative" in line)
    assert re.findall(r"[+-][\d.]+ %", shares) == ["+0.0000 %", "-25.0000 %"]


def test_compare_divides_what_is_too_wide_for_a_terminal(
    tmp_path: Path,
    result_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    names = [f"result_{'x' * 20}_{number}" for number in range(4)]
    for name in names:
        shutil.copytree(result_folder, tmp_path / name)
    terminal = partial(Console, width=110, force_terminal=True, color_system=None)
    monkeypatch.setattr("hkt_mdo.cli.results.Console", terminal)
    assert main(["compare", *names]) == 0
    lines = capsys.readouterr().out.splitlines()
    heads = [re.findall(r"result_x+_\d", line) for line in lines]
    assert [name for head in heads for name in head] == names
    assert max(map(len, lines)) <= 110
    monkeypatch.setattr("hkt_mdo.cli.results.Console", partial(terminal, width=70))
    assert main(["compare", *names]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum("objective, relative to the best" in line for line in lines) == len(names)
    assert max(map(len, lines)) <= 70


def test_without_arguments_the_first_steps_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    told = re.findall(r"^  hkt (\w+)", capsys.readouterr().out, re.MULTILINE)
    assert told == ["new", "check", "run", "show", "compare"]


def test_a_shell_can_complete(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    assert "--install-completion" in told
    assert "Exit codes: 0 done" in told


def test_plot_draws_the_figures(result_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", str(result_folder), "--format", "svg"]) == 0
    assert (result_folder / "figures" / "operation.svg").is_file()
    assert main(["plot", str(result_folder), "--out", "there"]) == 0
    names = {Path(line).name for line in capsys.readouterr().out.splitlines()[7:]}
    assert names == {path.name for path in Path("there").iterdir()}
    assert {Path(name).suffix for name in names} == {".png"}
    assert main(["plot", str(result_folder), "--format", "docx"]) == 2
    Path("file").touch()
    assert main(["plot", str(result_folder), "--out", "file"]) == 2


def test_plot_of_nothing_says_so(result_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in result_folder.glob("*.csv"):
        path.unlink()
    (result_folder / "summary.json").write_text('{"success": false}')
    assert main(["plot", str(result_folder)]) == 2
    assert "holds no data to draw" in capsys.readouterr().err


def test_schema_is_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert "rotor" in json.loads(capsys.readouterr().out)["properties"]


def test_version_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("hkt_mdo ")
    assert main(["-h"]) == 0
    out = capsys.readouterr().out
    assert out.count("Exit codes") == 1
    assert "Look at results" in out


@pytest.mark.parametrize("name", get_command(app).commands)
def test_help_leaves_out_nothing(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Words in brackets, such as the extra of a package, are no markup."""
    command = get_command(app).commands[name]
    assert main([name, "-h"]) == 0
    shown = re.sub(r"[\s│]", "", capsys.readouterr().out)
    for text in (command.help, *(each.help for each in command.params if not each.hidden)):
        for word in text.replace("`", "").split():
            assert word in shown
    assert "Exitcodes" not in shown


@pytest.mark.parametrize(
    ("modules", "absent"),
    [
        ("hkt_mdo.cli", "dymos openmdao wisdem matplotlib numba scipy"),
        ("hkt_mdo.cli, hkt_mdo.results.solution", "dymos openmdao wisdem matplotlib numba"),
        ("hkt_mdo.results.figures", "dymos openmdao wisdem numba matplotlib.pyplot"),
    ],
)
def test_imports_are_light(modules: str, absent: str) -> None:
    code = f"import sys, {modules}; print(*(set('{absent}'.split()) & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout.split() == []


def test_module_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "hkt_mdo", "run", "not_here.yaml"],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: not_here.yaml: does not exist")


def test_progress_reports_the_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    from hkt_mdo.cli import run

    now, shown, lines = [0.0], [], []
    monkeypatch.setattr(run.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(run, "_tell", lambda _, line: lines.append(line))
    live = types.SimpleNamespace(console=types.SimpleNamespace(is_terminal=True), task_ids=[7])
    live.update = lambda task, description: shown.append(description)
    evaluation, passed = run._reporters("mine", "J", live)
    entry = types.SimpleNamespace(number=1, converged=True, iterations=9, objective_J=1.0)
    entry.remedy = entry.why = ""
    now[0] = 10.0  # the start is found
    evaluation(1, 2000.0, 1e-3)
    now[0] = 30.0
    evaluation(50, 2000.0, 1e-4)
    passed(entry)
    now[0] = 35.0
    evaluation(9, 2000.0, 1e-5)
    assert shown[0] == "pass 1, evaluation 1, 2.0000 kJ, infeasibility 1.0e-03"
    assert shown[2] == "judging"
    assert shown[3].startswith("pass 2, evaluation 9")
    live.console.is_terminal = False
    now[0] = 40.0
    evaluation(10, 2000.0, 1e-5)
    assert lines[-1].startswith("mine: 40 s, pass 2, evaluation 10, 2.0000 kJ")


def test_progress_is_plain_in_a_pipe(fake: FakeRun, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", CASE, "--out", "out", "--no-figures"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("sine_limited_quadratic: searching for a start\n")
    assert "\x1b" not in out
    assert re.search(r"^ energy, simulated +\S+ kJ, .*%$", out, re.MULTILINE)
    assert re.search(r"^ largest root moment .* at t = \S+ s$", out, re.MULTILINE)  # one line each


def test_progress_is_one_live_line_on_a_terminal() -> None:
    """In a pseudo-terminal the line is drawn with the time, cut to one line, and erased."""
    code = (
        "import time; from hkt_mdo.cli import run\n"
        "with run._live('mine [1]', False) as live:\n"
        "    live.update(live.task_ids[0], description=90 * 'x'); time.sleep(0.2)\n"
        "    run._tell(live, '[2] ' + 20 * 'words '); time.sleep(0.2)"
    )
    theirs, ours = os.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=ours,
        cwd=ROOT,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "60"},
    )
    assert process.wait(60) == 0
    screen = os.read(theirs, 65536).decode()
    assert "0:00:00" in screen
    lines = re.split(r"\s*[\r\n]+", re.sub(r"\x1b\[[\d;?]*[a-zA-Z]", "", screen))
    assert "mine [1]: searching for a start" in lines
    told = [line.count("words") for line in lines if "words" in line]
    assert told == [9, 10, 1]  # above the live line, between words
    assert max(map(len, lines)) <= 60
    assert any(line.endswith("x…") for line in lines)
    assert screen.rstrip("\r\n").endswith("\x1b[2K")
