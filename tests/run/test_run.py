"""Whole runs, held to theory: bounds, formulas, the ranking of controllers."""

import json
from pathlib import Path

import numpy as np
import pytest

from hkt_mdo.case import load_case, read_case
from hkt_mdo.errors import InputError
from hkt_mdo.run.run import run_case

CASES = Path(__file__).parent.parent / "cases"
RADIUS, DENSITY = 1.4, 1000.0


@pytest.mark.parametrize("optimizer", ["IPOPT", "SLSQP"])
@pytest.mark.parametrize("name", ["sine_oloc", "sine_quadratic", "sine_limited_quadratic"])
def test_case_succeeds(solve, name, optimizer):
    solution = solve(name, f"driver.optimizer={optimizer}")
    assert solution.success, solution.summary["message"]
    assert solution.summary["optimizer"] == optimizer


@pytest.mark.parametrize("name", ["sine_oloc", "sine_quadratic", "sine_limited_quadratic"])
def test_optimizers_agree(solve, name):
    ipopt, slsqp = (
        solve(name, f"driver.optimizer={o}").summary["energy_J"] for o in ("IPOPT", "SLSQP")
    )
    assert slsqp == pytest.approx(ipopt, rel=2e-4)


def test_unlimited_open_loop_reaches_the_bound_at_constant_tip_speed_ratio(solve):
    summary = solve("sine_oloc", "driver.optimizer=IPOPT").summary
    assert 0.9995 <= summary["simulated_energy_J"] / summary["energy_bound_J"] <= 1.0 + 1e-5
    assert summary["tip_speed_ratio"]["max"] - summary["tip_speed_ratio"]["min"] < 0.1


def test_quadratic_feedback_is_open_loop_without_a_limit(solve):
    """K2 = 0.5 rho pi R^5 Cp / tsr^3 at the Cp maximum of its blade."""
    loop, feedback = (
        solve("sine_oloc", "driver.optimizer=IPOPT"),
        solve("sine_quadratic", "driver.optimizer=IPOPT"),
    )
    summary = feedback.summary
    assert summary["simulated_energy_J"] == pytest.approx(
        loop.summary["simulated_energy_J"], rel=2e-4
    )
    ratio = summary["tip_speed_ratio_at_power_coefficient_max"]
    gain = 0.5 * DENSITY * np.pi * RADIUS**5 * summary["power_coefficient_max"] / ratio**3
    assert summary["gain"] == pytest.approx(gain, rel=5e-3)


def test_ranking_under_a_torque_limit(solve):
    energy = {
        law: solve(f"sine_limited_{law}", "driver.optimizer=IPOPT").summary["simulated_energy_J"]
        for law in ("oloc", "linear", "quadratic")
    }
    assert energy["linear"] < energy["quadratic"] <= energy["oloc"] * (1.0 + 2e-5)
    assert 0.001 < 1.0 - energy["linear"] / energy["oloc"] < 0.015
    unlimited = solve("sine_oloc", "driver.optimizer=IPOPT").summary["simulated_energy_J"]
    assert max(energy.values()) < unlimited


@pytest.mark.parametrize("law", ["oloc", "linear", "quadratic"])
def test_torque_never_exceeds_its_limit(solve, law):
    solution = solve(f"sine_limited_{law}", "driver.optimizer=IPOPT")
    for columns in (solution.trajectory, solution.simulation):
        assert np.max(columns["control_torque_Nm"]) <= 700.0 * (1.0 + 1e-6)


def test_baseline_is_a_few_percent_below_the_optimum(solve):
    baseline, best = solve("sine_baseline_oloc"), solve("sine_oloc", "driver.optimizer=IPOPT")
    assert baseline.success
    assert baseline.summary["chord_m"] == baseline.summary["start_chord_m"]
    loss = 1.0 - baseline.summary["simulated_energy_J"] / best.summary["simulated_energy_J"]
    assert 0.03 < loss < 0.08


@pytest.mark.parametrize(
    "overrides",
    [
        ("control.unknown=torque",),
        ("phase.transcription=radau",),
        ("hydrodynamics.torque=direct",),
        ("hydrodynamics.bem=ccblade", "phase.segments=20", "phase.duration=20"),
    ],
    ids=lambda o: o[0],
)
def test_other_formulations_find_the_same_optimum(solve, overrides):
    length = [o for o in overrides if o.startswith("phase.") and "transcription" not in o]
    reference, other = solve("sine_limited_oloc", *length), solve("sine_limited_oloc", *overrides)
    assert other.success, other.summary["message"]
    assert other.summary["simulated_energy_J"] == pytest.approx(
        reference.summary["simulated_energy_J"], rel=2e-5
    )


def test_result_folder_is_complete_and_reruns_identically(solve, tmp_path):
    solution = solve("sine_limited_quadratic", "driver.optimizer=SLSQP")
    names = {path.name for path in solution.folder.iterdir()}
    assert {
        "case.yaml", "summary.json", "solution.db", "history.db", "trajectory.csv",
        "simulation.csv", "power_curve.csv", "convergence.csv", "n2.html",
    } <= names  # fmt: skip
    again = run_case(load_case(solution.folder / "case.yaml"), tmp_path / "again", figures=False)
    for key in ("energy_J", "simulated_energy_J", "gain", "chord_m", "twist_deg", "iterations"):
        assert again.summary[key] == solution.summary[key], key


def test_recorder_databases_hold_the_solution(solve):
    import openmdao.api as om

    solution = solve("sine_limited_quadratic", "driver.optimizer=SLSQP")
    final = om.CaseReader(str(solution.folder / "solution.db")).get_case("final")
    assert final.get_val("energy", units="J")[0] == pytest.approx(
        solution.summary["energy_J"], rel=1e-12
    )
    history = om.CaseReader(str(solution.folder / "history.db"))
    assert len(history.list_cases("driver", out_stream=None)) > 1


def test_nothing_is_written_outside_the_result_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = load_case(CASES / "sine_baseline_oloc.yaml", ["phase.segments=10", "phase.duration=10"])
    run_case(case, tmp_path / "out", figures=False)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_unfinished_optimization_is_no_success(tmp_path):
    case = load_case(CASES / "sine_limited_oloc.yaml", ["driver.max_iterations=2"])
    solution = run_case(case, tmp_path / "out", figures=False)
    assert not solution.success
    assert "optimizer did not converge" in solution.summary["message"]
    assert solution.summary["simulated_energy_J"] is not None


def test_a_false_solution_is_no_success(tmp_path):
    """Dymos' Radau collocates left ends only: on stiff feedback it finds false speeds."""
    overrides = ["phase.transcription=radau", "phase.segments=20", "phase.duration=20"]
    case = load_case(CASES / "sine_limited_linear.yaml", overrides)
    solution = run_case(case, tmp_path / "out", figures=False)
    assert not solution.success
    failed = {check["name"] for check in solution.summary["checks"] if not check["passed"]}
    assert failed & {"max_speed_error", "energy_error", "energy_below_start"}


def test_an_interrupt_leaves_an_honest_folder(tmp_path):
    def interrupt(count, energy, infeasibility):
        if count == 3:
            raise KeyboardInterrupt

    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        run_case(
            load_case(CASES / "sine_limited_oloc.yaml"), out, progress=interrupt, figures=False
        )
    summary = json.loads((out / "summary.json").read_text())
    assert summary["success"] is False
    assert "interrupted" in summary["message"]
    assert (out / "case.yaml").is_file()
    assert (out / "convergence.csv").is_file()


def test_existing_folder_is_kept_without_force(tmp_path):
    case = load_case(CASES / "sine_baseline_oloc.yaml")
    (tmp_path / "precious.txt").write_text("mine")
    with pytest.raises(InputError, match="exists"):
        run_case(case, tmp_path)
    with pytest.raises(InputError, match="no earlier result"):
        run_case(case, tmp_path, force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_bad_files_are_told_before_anything_is_written(tmp_path):
    polar = tmp_path / "polar.csv"
    polar.write_text(
        "alpha_deg,cl,cd\n" + "\n".join(f"{a},0.1,0.01" for a in (0, 1, 3, 2, 4, 5, 6, 7, 8))
    )
    case = read_case(
        f"inflow: {{profile: sine}}\ncontrol: {{law: linear}}\nrotor: {{polar: {polar}}}\n"
    )
    with pytest.raises(InputError, match=r"polar\.csv.*alpha_deg"):
        run_case(case, tmp_path / "out")
    assert not (tmp_path / "out").exists()
