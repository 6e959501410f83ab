"""`hkt run` of several cases: which are run, what is told, and what is not replaced."""

import pytest

from hkt_mdo.case import load_case
from hkt_mdo.cli import main
from hkt_mdo.problem.physics import complete
from hkt_mdo.results.solution import Solution
from tests.conftest import make_result


@pytest.fixture
def asked(monkeypatch, tmp_path):
    """Take the place of the batch: the first case has a result, the others have none."""
    calls = []

    def run_batch(cases, jobs, done, records, figures):
        calls.append((cases, jobs, records, figures))
        solutions = dict.fromkeys(cases)
        first = next(iter(cases))
        solutions[first] = Solution.load(make_result(tmp_path / "made" / str(len(calls))))
        for folder in cases:
            done(folder, "ok" if solutions[folder] else "the reason")
        return solutions

    monkeypatch.setattr("hkt_mdo.run.batch.run_batch", run_batch)
    monkeypatch.chdir(tmp_path)
    return calls


def test_each_case_has_its_folder_and_a_failure_is_told(asked, tmp_path, capsys):
    words = ["run", "sine_oloc", "sine_linear", "--out", "out", "--jobs", "2", "--no-figures"]
    assert main([*words, "--set", "phase.segments=20"]) == 3
    ((cases, *how),) = asked
    assert [str(folder) for folder in cases] == ["out/sine_oloc", "out/sine_linear"]
    assert {case.phase.segments for case in cases.values()} == {20}
    assert how == [2, True, False]
    output = capsys.readouterr()
    lines = "1 of 2: out/sine_oloc: ok", "2 of 2: out/sine_linear: the reason"
    assert output.out == "".join(f"{line}\n" for line in lines)
    assert output.err == "error: no success: out/sine_linear\n"


def test_another_result_is_replaced_by_force_only(asked, tmp_path, capsys):
    folder = make_result(tmp_path / "results" / "sine_oloc")
    (folder / ".hkt_result").touch()
    words = ["run", "sine_oloc", "sine_linear"]
    assert main(words) == 2
    assert "results/sine_oloc: folder exists; choose another one" in capsys.readouterr().err
    assert asked == []
    assert main([*words, "--force"]) == 3
    # what an interrupted run of the same case has left is gone on with
    written = complete(load_case("sine_oloc")).to_yaml()
    (folder / "case.yaml").write_text(written, encoding="utf-8")
    assert main(words) == 3
    assert len(asked) == 2
