"""Several formats at once: what is refused, with which words, and that nothing is written then."""

import shutil
import sys
from pathlib import Path

import pytest

from hkt_mdo.cli import main
from hkt_mdo.errors import install
from tests.conftest import edit_summary
from tests.exports.made import made

RESULT = Path(__file__).parents[1] / "data" / "openfast" / "paper"


@pytest.fixture
def hkt(capsys):
    """Return what a command exits with and prints."""

    def run(*arguments):
        code = main(list(map(str, arguments)))
        printed = capsys.readouterr()
        return code, printed.out + printed.err

    return run


def changed(folder, **entries):
    """Return a copy of a result with other entries in its summary."""
    shutil.copytree(RESULT, folder)
    edit_summary(folder, **entries)
    return folder


def test_several_formats_are_written_side_by_side(hkt, tmp_path):
    formats = "--to", "controller, sections", "--to", "openfast"
    code, printed = hkt("export", RESULT, *formats, "--out", tmp_path / "out")
    written = sorted(path for path in (tmp_path / "out").rglob("*") if path.is_file())
    assert code == 0
    assert sorted(map(Path, printed.split())) == written
    names = "controller.c", "sections/station_001.csv", "openfast/aerodyn.dat"
    assert {tmp_path / "out" / name for name in names} <= set(written)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--to", "cvs"], ["--to = 'cvs'", "did you mean csv? known: csv, json"]),
        (["--to", "stl", "--set", "stl.point=99"], ["stl.point = 99", "did you mean points"]),
        (["--to", "stl", "--set", "step.points=99"], ["step", "unknown key; known here: stl"]),
        (["--to", "stl", "--set", "stl.trailing_edge=2 kg"], ["'2 kg'", "does not convert to m"]),
        (["--to", "stl", "--set", "stl.points"], ["'stl.points': is not an override"]),
        (["--to", "csv", "--set", "csv.flow_range=[3, 1]"], ["csv.flow_range", "[lower, upper]"]),
    ],
)
def test_what_is_not_understood_is_reported_with_the_remedy(hkt, tmp_path, arguments, words):
    code, printed = hkt("export", RESULT, *arguments, "--out", tmp_path / "out")
    assert code == 2
    assert [each for each in words if each not in printed] == []
    assert not (tmp_path / "out").exists()


def test_a_missing_package_is_reported_with_the_line_that_installs_it(hkt, tmp_path, monkeypatch):
    for module in ("OCP", "netCDF4"):
        monkeypatch.setitem(sys.modules, module, None)
    for name, extra in (("step", "cad"), ("netcdf", "records")):
        code, printed = hkt("export", RESULT, "--to", "controller", "--to", name, "--out", tmp_path)
        assert code == 2
        assert f"--to = '{name}': needs" in printed
        assert install(extra) in printed
    assert hkt("export", RESULT, "--to", "controller", "--out", tmp_path / "out")[0] == 0


def test_files_are_replaced_only_by_force(hkt, tmp_path):
    command = "export", RESULT, "--to", "controller", "--out", tmp_path / "out"
    assert hkt(*command)[0] == 0
    file = tmp_path / "out" / "controller.c"
    before = file.read_text()
    file.write_text("mine")
    code, printed = hkt(*command)
    assert code == 2
    assert "is there already; give --force to replace it" in printed
    assert file.read_text() == "mine"
    assert hkt(*command, "--force")[0] == 0
    assert file.read_text() == before
    file.unlink()
    file.mkdir()
    code, printed = hkt(*command, "--force")
    assert code == 2
    assert "controller.c: is a folder; choose another name or folder" in printed
    code, printed = hkt(*command[:-1], tmp_path / "out" / "controller.h")
    assert code == 2
    assert "cannot be made a folder (File exists); choose another one" in printed


def test_a_result_without_success_is_exported_by_force_only(hkt, tmp_path):
    failed = changed(tmp_path / "failed", success=False, message="no solution within 300 steps")
    command = "export", failed, "--to", "csv,controller,rosco", "--out", tmp_path / "out"
    code, printed = hkt(*command)
    assert code == 2
    assert "a run that did not succeed (no solution within 300 steps)" in printed
    assert "or give --force" in printed
    assert not (tmp_path / "out").exists()
    assert hkt(*command, "--force")[0] == 0
    for file in (path for path in (tmp_path / "out").rglob("*") if path.is_file()):
        assert "THE RUN WAS NO SUCCESS: no solution within 300 steps" in file.read_text()


def test_an_unfinished_result_is_reported(hkt, tmp_path):
    (changed(tmp_path / "begun") / "summary.json").unlink()
    code, printed = hkt("export", tmp_path / "begun", "--to", "csv", "--out", tmp_path / "out")
    assert code == 2
    assert "begun: is no result folder: it lacks summary.json" in printed


def test_one_format_that_cannot_express_the_result_stops_all(hkt, tmp_path):
    result = made(tmp_path / "open", "inflow: sine\ncontrol: open_loop\n").folder
    for name in ("controller", "rosco"):
        code, printed = hkt("export", result, "--to", f"sections,{name}", "--out", tmp_path / "out")
        assert code == 2
        assert f"--to = '{name}'" in printed
        assert "run the case with a feedback law" in printed
    assert not (tmp_path / "out").exists()
