"""Whole runs, held to theory: bounds, formulas, the ranking of controllers; and what they leave."""

import json
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from hkt_mdo.case import load_case
from hkt_mdo.cli import main
from hkt_mdo.errors import InputError
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.checks import BELOW_START
from hkt_mdo.run.run import resume_case, run_case
from hkt_mdo.solve.threads import one_thread

CASES = Path(__file__).parents[2] / "cases"
RADIUS, DENSITY = 1.4, 1000.0
PERIOD = ("phase.segments=25", "phase.duration=25")  # of the sinusoidal flow
SHORT = ("phase.segments=15", "phase.duration=15")
PAPER = ["sine_oloc", "sine_quadratic", "sine_limited_quadratic"]
MAKE = "hkt_mdo.run.run.make_physics"
RESULTS = ("energy_J", "simulated_energy_J", "gain", "chord_m", "twist_deg", "iterations")


def short_case(name, *overrides):
    return load_case(CASES / f"{name}.yaml", [*SHORT, *overrides])


@pytest.fixture
def run(solve):
    """Run a shipped case over one period of its flow, once per session."""

    def over_a_period(name, optimizer="IPOPT"):
        solution = solve(name, *PERIOD, f"driver.optimizer={optimizer}")
        assert solution.success, solution.message
        assert solution.summary.optimizer == optimizer
        return solution

    return over_a_period


# Theory -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAPER)
def test_both_optimizers_succeed_and_agree(run, name):
    ipopt, slsqp = (run(name, optimizer).energy for optimizer in ("IPOPT", "SLSQP"))
    assert slsqp == pytest.approx(ipopt, rel=2e-4)


def test_unlimited_open_loop_reaches_the_bound_at_constant_tip_speed_ratio(run):
    summary = run("sine_oloc").summary
    assert 0.9995 <= summary.simulated_energy_J / summary.energy_bound_J <= 1.0 + 1e-5
    assert np.diff(summary.tip_speed_ratio.ends) < 0.1


def test_quadratic_feedback_is_open_loop_without_a_limit(run):
    """K2 = 0.5 rho pi R^5 Cp / tsr^3 at the Cp maximum of its blade."""
    summary, energy = run("sine_quadratic").summary, run("sine_oloc").summary.simulated_energy_J
    assert summary.simulated_energy_J == pytest.approx(energy, rel=2e-4)
    ratio = summary.tip_speed_ratio_at_power_coefficient_max
    gain = 0.5 * DENSITY * np.pi * RADIUS**5 * summary.power_coefficient_max / ratio**3
    assert summary.gain == pytest.approx(gain, rel=5e-3)


def test_ranking_under_a_torque_limit(run):
    solutions = {law: run(f"sine_limited_{law}") for law in ("oloc", "linear", "quadratic")}
    for solution in solutions.values():
        for columns in (solution.trajectory, solution.simulation):
            assert np.max(columns["control_torque_Nm"]) <= 700.0 * (1.0 + 1e-6)
    energy = {law: solution.summary.simulated_energy_J for law, solution in solutions.items()}
    assert energy["linear"] < energy["quadratic"] <= energy["oloc"] * (1.0 + 2e-5)
    assert 0.001 < 1.0 - energy["linear"] / energy["oloc"] < 0.015
    assert max(energy.values()) < run("sine_oloc").summary.simulated_energy_J


@pytest.mark.parametrize(
    ("override", "blade"),
    [
        ("control.unknown=torque", "optimized"),
        ("phase.transcription=radau", "optimized"),
        ("hydrodynamics.torque=direct", "optimized"),
        pytest.param("hydrodynamics.bem=ccblade", "fixed", marks=pytest.mark.slow),
    ],
)
def test_other_formulations_find_the_same_optimum(solve, override, blade):
    case = "sine_limited_oloc", *SHORT, f"design.blade={blade}"
    reference, other = solve(*case), solve(*case, override)
    assert other.success, other.message
    expected = reference.summary.simulated_energy_J
    assert other.summary.simulated_energy_J == pytest.approx(expected, rel=2e-5)


# What a run leaves --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """A short run of quadratic feedback, with all its files."""
    folder = tmp_path_factory.mktemp("runs") / "short"
    return run_case(short_case("sine_limited_quadratic", "driver.optimizer=SLSQP"), folder)


def test_result_folder_is_complete(short):
    names = {path.name for path in short.folder.iterdir()}
    assert {
        "case.yaml", "summary.json", "solution.db", "history.db", "trajectory.csv",
        "simulation.csv", "coefficients.csv", "convergence.csv", "blade.csv", "n2.html", "figures",
    } <= names  # fmt: skip
    assert "lock" not in names


def test_the_case_of_a_result_reruns_identically(short, tmp_path):
    case = load_case(short.folder / "case.yaml")
    assert case == short.case
    again = run_case(case, tmp_path / "again", figures=False, records=False)
    for key in RESULTS:
        assert getattr(again.summary, key) == getattr(short.summary, key), key


def test_the_case_of_a_result_takes_overrides(short, tmp_path):
    """As the case that was run, with the same override, would."""
    override = "control.torque_limit=0.6 kN*m"
    case = short_case("sine_limited_quadratic", "driver.optimizer=SLSQP", override)
    expected = run_case(case, tmp_path / "expected", figures=False, records=False)
    assert short.case.with_overrides(override) == expected.case
    command = ["run", str(short.folder / "case.yaml"), "--out", str(tmp_path / "again")]
    assert main([*command, "--quiet", "--no-figures", "--set", override]) == 0
    solution = Solution.load(tmp_path / "again")
    assert solution.summary.control_torque_max_Nm == pytest.approx(600.0, rel=0.01)
    for key in RESULTS:
        assert getattr(solution.summary, key) == getattr(expected.summary, key), key


# Runs that are no success, or none at all ---------------------------------------------------------


def test_an_unfinished_optimization_is_no_success(tmp_path):
    case = short_case("sine_limited_oloc", "driver.max_iterations=2")
    solution = run_case(case, tmp_path / "out", figures=False)
    assert not solution.success
    assert "optimizer did not converge" in solution.summary.message
    assert solution.summary.simulated_energy_J is not None


@pytest.mark.slow
def test_a_false_solution_is_no_success(tmp_path):
    """Dymos' Radau collocates left ends only: on stiff feedback it finds false speeds."""
    short = "phase.segments=8", "phase.duration=8"
    case = short_case("sine_limited_linear", *short, "phase.transcription=radau")
    solution = run_case(case, tmp_path / "out", figures=False)
    assert not solution.success
    refused = ("max_speed_error", "energy_error", "energy_below_start")
    assert any(name in solution.message for name in refused)
    start = solution.summary.starting_energy_J
    assert solution.summary.simulated_energy_J > (1.0 - BELOW_START) * start


def test_existing_folder_is_kept_without_force(tmp_path, capsys):
    (tmp_path / "precious.txt").write_text("mine")
    assert main(["run", str(CASES / "sine_baseline_oloc.yaml"), "--out", str(tmp_path)]) == 2
    output = capsys.readouterr()
    assert "folder exists" in output.err
    assert "searching" not in output.out
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_bad_files_are_reported_before_anything_is_written(tmp_path):
    polar, rows = tmp_path / "polar.csv", [f"{a},0.1,0.01" for a in (0, 1, 3, 2, 4, 5, 6, 7, 8)]
    polar.write_text("\n".join(["alpha_deg,cl,cd", *rows]))
    case = load_case({"inflow": "sine", "control": "linear", "rotor": {"polar": str(polar)}})
    with pytest.raises(InputError, match=r"polar\.csv.*alpha_deg"):
        run_case(case, tmp_path / "out")
    assert not (tmp_path / "out").exists()


# At the same time ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_two_runs_at_the_same_time_are_as_alone(tmp_path):
    """In one process: a run changes neither folder nor environment, which its threads share."""
    names = ["sine_limited_quadratic", "sine_baseline_oloc"]
    surroundings = Path.cwd(), dict(os.environ)
    barrier, records = Barrier(2, timeout=120.0), []

    def beside(name):
        def meet(count, objective, infeasibility):
            if count in (1, 4):
                barrier.wait()
                records.append((Path.cwd(), dict(os.environ)))

        case = short_case(name, "driver.optimizer=IPOPT")
        return run_case(case, tmp_path / "beside" / name, progress=meet, figures=False)

    with ThreadPoolExecutor(2) as threads:
        solutions = list(threads.map(beside, names))
    assert records == [surroundings] * 4
    for name, solution in zip(names, solutions, strict=True):
        case = short_case(name, "driver.optimizer=IPOPT")
        alone = run_case(case, tmp_path / "alone" / name, figures=False)
        assert solution.success, solution.message
        for key in RESULTS:
            assert getattr(solution.summary, key) == getattr(alone.summary, key), (name, key)
        speeds = [each.simulation["rotor_speed_rad_s"] for each in (solution, alone)]
        np.testing.assert_array_equal(*speeds)


def test_the_last_of_several_runs_lifts_the_limit_of_threads():
    """Runs that overlap, the first one ending first."""

    def threads():
        return [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]

    with threadpool_limits(2, user_api="blas"):
        before, first, second = threads(), one_thread(), one_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert set(threads()) <= {1}
        second.__exit__(None, None, None)
        assert threads() == before


def test_a_change_of_the_current_folder_does_not_move_a_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    elsewhere, case = tmp_path / "elsewhere", short_case("sine_baseline_oloc")
    elsewhere.mkdir()
    move = {"progress": lambda *_: monkeypatch.chdir(elsewhere)}
    assert run_case(case, "out", figures=False, **move).success
    assert not list(elsewhere.iterdir())


def test_a_second_run_on_one_folder_is_refused(tmp_path):
    out, refused = tmp_path / "out", []
    case = short_case("sine_baseline_oloc")

    def second(count, objective, infeasibility):
        if count == 2:
            for start in (lambda: run_case(case, out, force=True), lambda: resume_case(out)):
                with pytest.raises(InputError, match="another run is using it") as caught:
                    start()
                refused.append(caught.value)
            assert json.loads((out / "summary.json").read_text())["success"] is False

    solution = run_case(case, out, progress=second, figures=False)
    assert len(refused) == 2
    assert solution.success, solution.message


def test_a_folder_is_locked_before_a_case_is_prepared(tmp_path, monkeypatch):
    """Which may take long; where the case is refused, no new folder remains."""
    out, case = tmp_path / "results" / "out", short_case("sine_baseline_oloc")

    def prepare(_):
        monkeypatch.setattr(MAKE, lambda _: pytest.fail("it is prepared, too"))
        with pytest.raises(InputError, match="another run is using it"):
            run_case(case, out)
        raise InputError("is no case")

    monkeypatch.setattr(MAKE, prepare)
    with pytest.raises(InputError, match="is no case"):
        run_case(case, out)
    assert list(tmp_path.iterdir()) == []
