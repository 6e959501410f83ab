"""The reproduction's report and its bookkeeping; the reproduction itself is `hkt paper`."""

import json

import pytest
import yaml

from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import data_path
from hkt_mdo.studies import paper as paper_module
from hkt_mdo.studies.paper import LAWS, SENSOR_RATES, TABLES, Paper, reproduce
from hkt_mdo.studies.paper_report import write_report


@pytest.fixture(scope="module")
def small_paper(solve):
    """All of the paper's slots, filled from four real results: the shape is right."""
    limited = {law: solve(f"sine_limited_{law}", "driver.optimizer=IPOPT") for law in LAWS}
    solutions = {f"{scenario}_{law}": limited[law] for scenario in TABLES for law in LAWS}
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
    ensembles = {"oloc_A": {"energy_J": energy, "stopped_at_s": None, "series": series}}
    for flow in "BC":
        ensembles[f"oloc_{flow}"] = {"energy_J": None, "stopped_at_s": 21.3, "series": series}
    for law in LAWS[1:]:
        for flow in "ABC":
            ensembles[f"{law}_{flow}_quiet"] = {"energy_J": energy, "stopped_at_s": None}
            for reference in ("fluctuation", "total"):
                for rate in SENSOR_RATES:
                    ensembles[f"{law}_{flow}_{reference}_{rate:g}Hz"] = noisy
    sequential = {
        f"{scenario}_sequential_{law}": limited[law]
        for scenario in ("sine", "sine_limited")
        for law in LAWS
    }
    redesigned = dict.fromkeys("ABC", limited["oloc"])
    reported = yaml.safe_load(data_path("amini2023", "reported").read_text(encoding="utf-8"))
    return Paper(solutions, sequential, redesigned, ensembles, reported)


@pytest.fixture(scope="module")
def report(small_paper, tmp_path_factory):
    out = tmp_path_factory.mktemp("paper")
    return out, write_report(small_paper, out, lambda line: None)


def test_every_figure_is_there_and_shown(report):
    out, _ = report
    for number in range(3, 13):
        for suffix in ("png", "pdf"):
            assert (out / "figures" / f"figure_{number:02d}.{suffix}").stat().st_size > 1000
        assert f"figures/figure_{number:02d}.png" in (out / "report.md").read_text()


def test_page_needs_no_server_and_no_network(report):
    page = (report[0] / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 10
    assert "http" not in page


def test_numbers_stand_beside_the_papers(report):
    out, data = report
    assert json.loads((out / "paper.json").read_text()) == json.loads(json.dumps(data))
    row = data["tables"]["sine_limited"]["quadratic"]
    assert row["reported_energy_J"] == 321294
    assert row["difference_percent"] == pytest.approx(100.0 * (row["energy_J"] / 321294 - 1.0))
    assert "rotor stops at t = 21.3 s, not generating" in (out / "report.md").read_text()


def test_checks_tell_what_fails(report):
    """With limited results in the unlimited tables, 7.18 must be found missing."""
    checks = {check["statement"]: check for check in report[1]["checks"]}
    assert not checks["sine OLOC: tip speed ratio over 7.18, %"]["passed"]
    assert checks["sine_limited quadratic: gain over the paper's, %"]["passed"]


def test_an_ensemble_is_computed_once(solve, tmp_path, monkeypatch):
    source = solve("sine_limited_quadratic", "driver.optimizer=IPOPT").folder
    path = tmp_path / "one.json"
    stamp = paper_module._stamp(source, "A", None, None, 2, 1)
    result = paper_module._one_ensemble(str(source), "A", None, None, 2, 1, stamp, str(path))
    assert result["energy_J"] > 0.0
    assert json.loads(path.read_text())["stamp"] == stamp
    assert paper_module._stamp(source, "A", None, None, 3, 1) != stamp


def test_missing_cases_are_told(tmp_path):
    with pytest.raises(InputError, match=r"--cases .* has no step_oloc\.yaml"):
        reproduce(tmp_path / "out", tmp_path)
    assert not (tmp_path / "out").exists()
