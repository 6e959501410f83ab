"""A result folder: what a run wrote is read, and what is corrupt is refused with one message."""

import os
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from hkt_mdo.case import load_case, read_case
from hkt_mdo.errors import InputError
from hkt_mdo.results.folder import write_json
from hkt_mdo.results.solution import TABLES, Solution
from hkt_mdo.results.words import texts
from tests.conftest import DATA


def test_load_reads_everything(result_folder: Path) -> None:
    solution = Solution.load(result_folder)
    assert solution.name == "sine_quadratic"
    assert solution.case.control.torque_limit == 700.0
    assert solution.success
    assert solution.message == "converged and verified"
    assert solution.summary.energy_J == 322239.0
    assert solution.summary.gain == 10.98
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


def test_the_only_scenario_has_its_own_water_flow_and_limits(result_folder: Path) -> None:
    path = result_folder / "case.yaml"
    override = "scenarios=[{name: one, density: 1025, inflow: step, limits: {thrust: 6 kN}, "
    override += "condition: {drag: 2, torque_constant: 0.9}}]"
    path.write_text(load_case(path).with_overrides(override).to_yaml())
    solution = Solution.load(result_folder)
    assert [limit.name for limit in solution.limits] == ["control_torque", "thrust"]
    case = solution.by_scenario[0].case
    assert (case.fluid.density, case.inflow.profile) == (1025.0, "step")
    assert solution.by_scenario[0].coefficients == {}  # they are of clean sections


def test_load_takes_an_interrupted_run(result_folder: Path) -> None:
    for name in ("trajectory", "simulation", "coefficients"):
        (result_folder / f"{name}.csv").unlink()
    (result_folder / "convergence.csv").write_text("evaluation,energy_J,infeasibility\n")
    summary = {"case": "sine_quadratic", "success": False, "message": "interrupted", "gain": None}
    write_json(result_folder / "summary.json", summary)
    solution = Solution.load(result_folder)
    assert not solution.success
    assert solution.trajectory == solution.convergence == solution.blade == {}
    assert solution.summary.energy_J is None
    rows = texts(solution.summary.rows(solution.case))
    assert rows["energy"] == rows["energy, electrical"] == "-"
    assert rows["optimizer"] == "-"
    assert rows["message"] == "interrupted"
    assert repr(solution) == f"<Solution sine_quadratic: not verified, {str(result_folder)!r}>"


@pytest.mark.parametrize("name", ["case.yaml", "summary.json"])
def test_load_refuses_a_folder_without(result_folder: Path, name: str) -> None:
    (result_folder / name).unlink()
    with pytest.raises(InputError, match=f"lacks {name}; give a folder that a run wrote"):
        Solution.load(result_folder)


@pytest.mark.parametrize("folder", ["not/here", "null\0character", "x" * 5000])
def test_load_refuses_no_folder(folder: str) -> None:
    with pytest.raises(InputError, match="does not exist"):
        Solution.load(folder)


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


CORRUPT = yaml.safe_load((DATA / "broken" / "results.yaml").read_text())
CORRUPT += [["summary.json", "[" * 100000, "cannot be read as JSON"]]
CORRUPT += [["summary.json", f'{{"success": true, "energy_J": {"9" * 5000}}}', "cannot be read as"]]


@pytest.mark.parametrize(("name", "text", "words"), CORRUPT)
def test_load_refuses_a_corrupt_file(result_folder: Path, name: str, text: str, words: str) -> None:
    (result_folder / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words) as caught:
        Solution.load(result_folder)
    assert name in str(caught.value)
    assert ("run the case again" in str(caught.value)) == (name == "summary.json")


@pytest.mark.parametrize(("most", "file"), [("MAX_CSV", "trajectory.csv"), ("MAX", "summary.json")])
def test_load_refuses_a_large_file(result_folder: Path, monkeypatch, most: str, file: str) -> None:
    monkeypatch.setattr(f"hkt_mdo.results.solution.{most}_BYTES", 1000)
    with pytest.raises(InputError, match=f"{file}: is larger than"):
        Solution.load(result_folder)


@pytest.mark.parametrize("name", [name for name in TABLES if name != "year"])
def test_tables_for_pandas_and_xarray(result_folder: Path, name: str) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    solution = Solution.load(result_folder)
    frame, dataset = solution.to_pandas(name), solution.to_xarray(name)
    columns = dict(TABLES[name])
    columns.pop("thickness_over_chord", None)  # of a designed thickness only
    assert list(frame) == list(columns)
    assert list(dataset.coords) == [next(iter(columns))]
    for column, (unit, _) in columns.items():
        np.testing.assert_array_equal(frame[column], solution.table(name)[column])
        np.testing.assert_array_equal(dataset[column], solution.table(name)[column])
        assert frame.attrs["units"][column] == dataset[column].attrs["units"] == (unit or "1")
        assert dataset[column].attrs["long_name"]


def test_all_tables_are_one_tree(result_folder: Path, tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("netCDF4")
    solution = Solution.load(result_folder)
    solution.to_datatree().to_netcdf(tmp_path / "result.nc")
    with xarray.open_datatree(tmp_path / "result.nc") as tree:
        assert set(tree.children) == set(TABLES) - {"year"}
        assert tree.attrs["energy_J"] == solution.energy
        assert tree["simulation"]["thrust_N"].attrs["units"] == "N"
        for name in tree.children:
            for column, values in solution.table(name).items():
                np.testing.assert_array_equal(tree[name][column], values)


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_a_missing_package_is_reported(
    result_folder: Path, monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=f"install it with: pip install {package}"):
        getattr(Solution.load(result_folder), f"to_{package}")()


def test_a_missing_table_is_reported(result_folder: Path) -> None:
    (result_folder / "simulation.csv").unlink()
    solution = Solution.load(result_folder)
    with pytest.raises(InputError, match="has no simulation; let the run finish"):
        solution.table("simulation")
    with pytest.raises(InputError, match="unknown table; known: trajectory, simulation"):
        solution.to_pandas("sumlation")


def test_an_allowable_stress_is_that_of_the_material(result_folder):
    """Which the case gives in place of a number; figures draw it."""
    folder = result_folder
    case = (folder / "case.yaml").read_text(encoding="utf-8")
    overrides = {
        "limits.stress=allowable",
        "rotor.material={density: 2700, modulus: 70 GPa, allowable_stress: 90 MPa}",
    }
    allowed = read_case(case, sorted(overrides)).to_yaml()
    (folder / "case.yaml").write_text(allowed, encoding="utf-8")
    solution = Solution.load(folder)
    (stress,) = (limit for limit in solution.limits if limit.name == "stress")
    assert stress.upper == 90e6
    share = solution.limit_shares()["stress"]
    np.testing.assert_allclose(share, solution.simulation["stress_Pa"] / 90e6)
    assert [level for _, level in solution.limit_levels("stress")] == [90e6]
