"""Results: what a run wrote is read, what anyone else did to it is refused with a word."""

import json
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

from hkt_mdo.errors import InputError
from hkt_mdo.results import solution as results
from hkt_mdo.results.solution import Solution, summary_table


def edit(folder: Path, **changes: object) -> None:
    """Change keys of a summary."""
    path = folder / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes), encoding="utf-8")


def test_load_reads_everything(result_folder: Path) -> None:
    solution = Solution.load(result_folder)
    assert solution.name == "sine_quadratic"
    assert solution.case.control.torque_limit == 700.0
    assert solution.success
    assert solution.message == "converged and verified"
    assert solution.energy == 322239.0
    assert solution.gain == 10.98
    assert solution.failed_checks == ()
    assert solution.trajectory["time_s"].size == 181
    assert solution.simulation["rotor_speed_rad_s"].size == 1201
    np.testing.assert_allclose(
        solution.trajectory["hydrodynamic_power_W"],
        solution.trajectory["hydrodynamic_torque_Nm"] * solution.trajectory["rotor_speed_rad_s"],
        rtol=1e-8,
    )
    with pytest.raises(ValueError, match="read-only"):
        solution.trajectory["time_s"][0] = 1.0


def test_load_takes_an_interrupted_run(result_folder: Path) -> None:
    for name in ("trajectory", "simulation", "power_curve"):
        (result_folder / f"{name}.csv").unlink()
    (result_folder / "convergence.csv").write_text("evaluation,energy_J,infeasibility\n")
    summary = {"case": "sine_quadratic", "success": False, "message": "interrupted", "gain": None}
    (result_folder / "summary.json").write_text(json.dumps(summary))
    solution = Solution.load(result_folder)
    assert not solution.success
    assert solution.trajectory == solution.convergence == {}
    assert solution.energy is None
    rows = dict(summary_table(solution))
    assert rows["energy"] == rows["tip speed ratio"] == rows["optimizer"] == "-"
    assert rows["message"] == "interrupted"


def test_load_takes_what_an_optimizer_met(result_folder: Path) -> None:
    path = result_folder / "convergence.csv"
    path.write_text("evaluation,energy_J,infeasibility\n0,nan,inf\n1,3e5,1e-3\n")
    table = Solution.load(result_folder).convergence
    assert np.isnan(table["energy_J"][0])
    assert np.isinf(table["infeasibility"][0])


def test_load_ignores_more_columns_and_keys(result_folder: Path) -> None:
    path = result_folder / "power_curve.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([f"new,{lines[0]}", *(f"1,{line}" for line in lines[1:])]))
    edit(result_folder, new_key={"a": [1]})
    solution = Solution.load(result_folder)
    assert set(solution.power_curve) == set(lines[0].split(","))
    assert solution.power_curve["tip_speed_ratio"][0] == 2.2


def test_load_needs_no_blade_file(result_folder: Path) -> None:
    path = result_folder / "case.yaml"
    path.write_text(path.read_text().replace("blade: bahaj2007", "blade: /not/here.csv"))
    assert Solution.load(result_folder).case.rotor.blade.endswith("here.csv")


@pytest.mark.parametrize("name", ["case.yaml", "summary.json"])
def test_load_refuses_a_folder_without(result_folder: Path, name: str) -> None:
    (result_folder / name).unlink()
    with pytest.raises(InputError, match=f"lacks {name}; give a folder that a run wrote"):
        Solution.load(result_folder)


@pytest.mark.parametrize("folder", ["not/here", "null\0character", "x" * 5000])
def test_load_refuses_no_folder(folder: str) -> None:
    with pytest.raises(InputError, match="does not exist"):
        Solution.load(folder)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "cannot be read as JSON"),
        ("{", "cannot be read as JSON"),
        ("[]", "must hold keys and values"),
        ('{"success": NaN}', "NaN is no number of JSON"),
        ('{"success": true, "energy_J": ' + "9" * 5000 + "}", "cannot be read as JSON"),
        ('{"success": true, "energy_J": ' + "9" * 400 + "}", "must be a finite number"),
        ('{"success": true, "energy_J": 1e999}', "must be a finite number"),
        ('{"success": true, "energy_J": true}', "must be a finite number"),
        ("[" * 100000, "cannot be read as JSON"),
        ("{}", "success: is missing"),
        ('{"success": null}', "must be true or false"),
        ('{"success": true, "message": 1}', "must be a text"),
        ('{"success": true, "gain": "x"}', "must be a number or a list"),
        ('{"success": true, "r_m": ["a"]}', "must be a list of numbers"),
        ('{"success": true, "r_m": [1], "chord_m": [1, 2]}', "one value for each of r_m"),
        ('{"success": true, "chord_m": [1, 2]}', "one value for each of r_m"),
        ('{"success": true, "tip_speed_ratio": {"min": "a"}}', "must be min, max and mean"),
        ('{"success": true, "checks": [{"name": "a"}]}', "must be a list of checks"),
    ],
)
def test_load_refuses_a_corrupt_summary(result_folder: Path, text: str, told: str) -> None:
    (result_folder / "summary.json").write_text(text)
    with pytest.raises(InputError, match=told) as caught:
        Solution.load(result_folder)
    assert "summary.json" in str(caught.value)
    assert "run the case again" in str(caught.value)


def test_load_refuses_pickles(result_folder: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple:
            return os.mkdir, (str(result_folder / "trapped"),)

    for name in ("summary.json", "trajectory.csv", "case.yaml"):
        whole = (result_folder / name).read_bytes()
        (result_folder / name).write_bytes(pickle.dumps(Trap()))
        with pytest.raises(InputError, match=name):
            Solution.load(result_folder)
        (result_folder / name).write_bytes(whole)
    assert not (result_folder / "trapped").exists()


HEADER = "evaluation,energy_J,infeasibility\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "must have one column evaluation"),
        ("evaluation,energy_J\n1,2\n", "must have one column infeasibility"),
        (f"energy_J,{HEADER}1,2,3,4\n", "must have one column energy_J"),
        (f"{HEADER}1,2\n", "line 2 = '1,2': has 2 cells where the header has 3"),
        (f"{HEADER}1,2,3\n1,x,3\n", "line 3 = '1,x,3': must hold numbers alone"),
        (f"{HEADER}1,,3\n", "must hold numbers alone"),
        (f"{HEADER}1,1_000,3\n", "must hold numbers alone"),
        (f"{HEADER}1,2,3\n\n", "line 3"),
        (f"{HEADER}1,é,3\n", "line 2: is not plain text"),
    ],
)
def test_load_refuses_a_corrupt_table(result_folder: Path, text: str, told: str) -> None:
    (result_folder / "convergence.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=told) as caught:
        Solution.load(result_folder)
    assert "convergence.csv" in str(caught.value)


def test_load_refuses_large_files(result_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results, "MAX_CSV_BYTES", 1000)
    with pytest.raises(InputError, match=r"trajectory\.csv: is larger than"):
        Solution.load(result_folder)
    monkeypatch.setattr(results, "MAX_SUMMARY_BYTES", 100)
    with pytest.raises(InputError, match=r"summary\.json: is larger than"):
        Solution.load(result_folder)


def test_summary_table_has_units(result_folder: Path) -> None:
    rows = dict(summary_table(Solution.load(result_folder)))
    assert rows["energy"] == "322.24 kJ (322239 J)"
    assert rows["share of quasi-steady bound"] == "99.982 %"
    assert rows["gain, quadratic feedback"] == "10.98 N m s^2/rad^2"
    assert rows["largest control torque"] == "700 N m (limit 700 N m)"
    assert rows["optimizer"] == "IPOPT (pyoptsparse), 44 iterations, 12.3 s"


def test_summary_table_of_linear_feedback_without_limit(linear_result_folder: Path) -> None:
    rows = dict(summary_table(Solution.load(linear_result_folder)))
    assert rows["gain, linear feedback"] == "90.9 N m s/rad"
    assert rows["largest control torque"].endswith("(no limit)")


def test_text_of_others_does_not_command_the_terminal(result_folder: Path) -> None:
    check = {"name": "a\x1b]0;b\x07", "value": 2.0, "limit": None, "passed": False, "detail": "c\n"}
    edit(result_folder, message="\x1b[2Jgone\nsecond line", checks=[check], optimizer="\x1b[1m")
    solution = Solution.load(result_folder)
    texts = [*(value for _, value in summary_table(solution)), *solution.failed_checks]
    assert all(text.isprintable() for text in texts)
    assert solution.failed_checks[0].endswith("2, limit -. c")
