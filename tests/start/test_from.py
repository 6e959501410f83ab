"""The design of an earlier result as a start (`start.from`)."""

import pickle

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.folder import write_json
from hkt_mdo.start.find import LOCAL, find_start
from hkt_mdo.start.result import given_designs
from tests.conftest import NINE, edit_summary

RESULT = "design of a result"
TRACKING = load_case({"inflow": "sine", "control": "tracking"})


@pytest.fixture
def result(tmp_path):
    """Return a function that writes a result folder whose blade is a scaled one of its case."""

    def write(law="quadratic", gain=9.0, success=True, **more):
        case = load_case({"inflow": "sine", "control": law} | more)
        blade = physics(case).blade
        folder = tmp_path / "earlier"
        folder.mkdir(exist_ok=True)
        (folder / "case.yaml").write_text(case.to_yaml())
        shape = {"chord_m": 0.9 * blade.chord, "twist_deg": np.rad2deg(blade.twist) + 1.0}
        shape |= {"r_m": blade.r, "rotor_radius_m": blade.rotor_radius}
        outcome = {"success": success, "message": "the mesh is too coarse", "gain": gain}
        write_json(folder / "summary.json", shape | outcome)
        return folder

    return write


def model_of(folder, law="quadratic", method="quasi_steady", **more):
    start = {"from": str(folder), "method": method}
    return physics(load_case({"inflow": "sine", "control": law, "start": start} | more))


def begin(case):
    return find_start(case)


def test_the_best_of_all_is_kept(result):
    """A design that is better than all others is what the search goes on from."""
    folder = result()
    best = begin(model_of(folder))
    shape = {"chord_m": best.blade.chord, "twist_deg": np.rad2deg(best.blade.twist)}
    edit_summary(folder, **shape, gain=best.gains[0])
    again = begin(model_of(folder))
    (kept,) = (record.strategy for record in again.starts if record.kept)
    assert kept == RESULT
    assert again.operation.energy >= best.operation.energy * (1.0 - 1e-8)


@pytest.mark.parametrize("limits", [{}, {"power": "5 kW"}])
def test_with_the_blade_s_method_it_is_taken_as_it_is(result, limits):
    control = {"law": "quadratic", "torque_limit": 700.0}
    case = model_of(result(gain=12.0), control, "blade", limits=limits, rotor={"stations": NINE})
    start = begin(case)
    np.testing.assert_allclose(start.blade.chord, 0.9 * case.blade.chord)
    np.testing.assert_allclose(start.blade.twist, case.blade.twist + np.deg2rad(1.0))
    assert list(start.gains) == [12.0]
    assert start.messages == (LOCAL,)
    assert [record.strategy for record in start.starts] == [RESULT]


def test_gains_of_another_law_are_fitted(result):
    fitted = begin(model_of(result("linear", gain=150.0), method="blade"))
    assert fitted.gains[0] != 150.0
    assert fitted.operation.running


def test_gains_over_the_flow_s_range_are_those_of_the_same_flow(result):
    gains = [10.0 * n for n in range(len(physics(TRACKING).law.gain_units))]
    folder = result("tracking", gains)
    assert list(given_designs(model_of(folder, "tracking"))[0][0].gains) == gains
    gust = {"profile": "sine", "mean": "1 m/s"}
    assert given_designs(model_of(folder, "tracking", inflow=gust))[0][0].gains is None


def test_it_is_interpolated_over_the_stations_of_the_case(result):
    blade = given_designs(model_of(result(), rotor={"station_count": 30}))[0][0].blade
    original = physics(load_case({"inflow": "sine", "control": "quadratic"})).blade
    assert blade.r.size == 30
    expected = 0.9 * np.interp(blade.r, original.r, original.chord)
    assert np.max(np.abs(blade.chord - expected)) < 0.02 * np.max(expected)


def test_the_count_of_blades_may_be_that_of_the_files(result, tmp_path):
    file = tmp_path / "blade.csv"
    file.write_text("r_m,chord_m,twist_deg\n0.3,0.12,20\n0.9,0.1,8\n1.3,0.08,3\n")
    rotor = {"blade": str(file), "radius": 1.4}
    assert given_designs(model_of(result(rotor=rotor), rotor=rotor))[0][0].blade.blade_count == 3


def test_its_radius_is_taken_where_that_is_designed(result):
    folder = result(rotor={"radius": "1.6 m"})
    fixed, free = model_of(folder), model_of(folder, design={"radius_bounds": [1.2, 1.5]})
    assert given_designs(fixed)[0][0].blade.rotor_radius == fixed.blade.rotor_radius
    assert given_designs(free)[0][0].blade.rotor_radius == pytest.approx(1.5)


def test_a_refused_result_is_allowed_and_reported(result):
    _, messages = given_designs(model_of(result(success=False)))
    assert "refused by its checks: the mesh is too coarse" in messages[0]


def test_the_key_is_kept_by_yaml_and_pickle(result, tmp_path):
    folder = result()
    (tmp_path / "a.yaml").write_text("inflow: sine\ncontrol: quadratic\nstart: {from: earlier}\n")
    case = load_case(tmp_path / "a.yaml")
    assert case.start.from_ == str(folder.resolve())
    assert f"from: {folder.resolve()}" in case.to_yaml()
    assert pickle.loads(pickle.dumps(case)) == case
    other = case.with_overrides("start.method=blade")
    assert (other.start.from_, other.start.method) == (case.start.from_, "blade")


# Bad input


def test_a_result_without_a_design_is_refused(result):
    case = model_of(folder := result())
    for text, message in (
        ('{"success": false}', "no design yet"),
        ("{", "no result that can be read"),
    ):
        (folder / "summary.json").write_text(text)
        with pytest.raises(InputError, match=f"start.from = .*: .*{message}"):
            begin(case)


def test_another_count_of_blades_is_refused(result):
    case = model_of(result(rotor={"blade_count": 2}))
    with pytest.raises(InputError, match=r"start.from = .*: has 2 blades, the case has 3; give"):
        begin(case)
