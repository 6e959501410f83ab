"""The reproduction's report and its bookkeeping; the reproduction itself is `scripts/paper.py`."""

from concurrent.futures import Future

import paper
import pytest
from paper_report import FLOWS, SENSORS, ensemble_key, write_report
from study_common import LAWS, SCENARIOS

from hkt_mdo.errors import InputError


@pytest.fixture(scope="module")
def small_paper(solve):
    """All of the paper's slots, filled from four real results: the shape is right."""
    limited = {law: solve(f"sine_limited_{law}", "driver.optimizer=IPOPT") for law in LAWS}
    solutions = {f"{scenario}_{law}": limited[law] for scenario in SCENARIOS for law in LAWS}
    solutions["sine_baseline_oloc"] = solve("sine_baseline_oloc")
    series = {
        key: limited["oloc"].simulation[key].tolist()
        for key in ("time_s", "rotor_speed_rad_s", "control_torque_Nm", "hydrodynamic_torque_Nm")
    }
    energy = limited["linear"].summary["simulated_energy_J"]
    noisy = {
        "repeats": 3, "stalled": 0, "energy_J": energy, "spread_J": 5.0, "worst_J": energy - 9.0,
        "noise_deviation_rad_s": 0.1, "torque_error": 1e-9, "series": series,
    }  # fmt: skip
    ensembles = {"oloc_A_quiet": {"energy_J": energy, "stopped_at_s": None, "series": series}}
    for flow in "BC":
        ensembles[f"oloc_{flow}_quiet"] = {"energy_J": None, "stopped_at_s": 21.3, "series": series}
    for law in LAWS[1:]:
        for flow in FLOWS:
            ensembles[f"{law}_{flow}_quiet"] = {"energy_J": energy, "stopped_at_s": None}
            for sensor in SENSORS:
                ensembles[ensemble_key(law, flow, sensor)] = noisy
    lost = {"stalled": 3, "energy_J": None, "spread_J": None, "worst_J": None}
    ensembles[ensemble_key("linear", "C")] = noisy | lost
    for law in LAWS:
        for scenario in ("sine", "sine_limited"):
            solutions[f"{scenario}_sequential_{law}"] = limited[law]
    solutions |= {f"redesigned_{flow}": limited["oloc"] for flow in FLOWS}
    return solutions, ensembles


@pytest.fixture(scope="module")
def report(small_paper, tmp_path_factory):
    out = tmp_path_factory.mktemp("paper")
    return out, write_report(*small_paper, out, lambda line: None)


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
