"""The reproduction's bookkeeping; the reproduction itself is `scripts/paper.py`."""

from concurrent.futures import Future

import paper
import pytest
from study_common import LAWS

from hkt_mdo.errors import InputError


def test_an_ensemble_is_computed_once(solve, tmp_path, monkeypatch):
    """What is there is read; another number of repeats, or a damaged file, is simulated again."""
    (tmp_path / "cases").mkdir()
    for law in LAWS:
        folder = solve(f"sine_limited_{law}", "driver.optimizer=IPOPT").folder
        (tmp_path / "cases" / f"sine_limited_{law}").symlink_to(folder)
    simulated = []

    def in_this_process(tasks, jobs, ended):
        tasks = dict(tasks)
        simulated.append(list(tasks))
        for key, task in tasks.items():
            future = Future()
            future.set_result(task() if key == "quadratic_A_quiet" else {"energy_J": 1.0})
            ended(key, future)

    monkeypatch.setattr(paper, "in_processes", in_this_process)
    found = paper._ensembles(tmp_path, 2, 1, 1, lambda line: None)
    assert found["quadratic_A_quiet"]["energy_J"] > 1e5
    assert list(found) == simulated[0]
    (tmp_path / "uncertainty" / "oloc_A_quiet.json").write_text("{")
    assert paper._ensembles(tmp_path, 2, 1, 1, lambda line: None) == found
    assert simulated[1] == ["oloc_A_quiet"]
    paper._ensembles(tmp_path, 3, 1, 1, lambda line: None)
    assert simulated[2] == simulated[0]


def test_missing_cases_are_reported(tmp_path):
    with pytest.raises(InputError, match=r"--cases .* has no step_oloc\.yaml"):
        paper.reproduce(tmp_path / "out", tmp_path, 1, 2, 1, print)
    assert not (tmp_path / "out").exists()
