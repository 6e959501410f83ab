"""What a run leaves to go on from: by scenario, with a version."""

import json
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics as make_physics
from hkt_mdo.results.folder import to_json
from hkt_mdo.run.checks import MESH_ERROR
from hkt_mdo.run.run import resume_case, run_case
from hkt_mdo.run.state import RunState, as_data, read_iterate
from hkt_mdo.start.find import find_start

GUST = {"profile": "gust", "mean": 1.4, "amplitude": 0.4, "time": 6.0, "width": 8.0}
ONE = {
    "inflow": GUST,
    "control": {"law": "quadratic"},
    "design": {"blade": "fixed"},
    "phase": {"duration": 20.0, "segments": 40},
}
LIMITED = ONE | {
    "limits": {"power": "4 kW"},
    "control": {"law": "open_loop"},
    "start": {"method": "blade"},
}
SEVERAL = ONE | {"control": {"law": "quadratic", "cut_out": 1.42}}
FLOWS = ONE | {"scenarios": [{"inflow": "sine", "duration": 8.0, "segments": 6}, {"inflow": GUST}]}


def iterate(case):
    """Return physics on a finer mesh, a point there, and the data of its file."""
    physics = make_physics(load_case(case))
    finer = tuple(x.divided(np.arange(1, x.segments + 1) % 2 + 1) for x in physics.scenarios)
    fine = type(physics)(**vars(physics) | {"scenarios": finer})
    start = find_start(fine)
    point = replace(start, branch="underspeed", reference=5.0)
    return physics, fine, point, json.loads(to_json(as_data(fine, point, point)))


@pytest.fixture(scope="module")
def whole():
    """Physics and the data of an iterate."""
    physics, _, _, data = iterate(ONE)
    return physics, data


@pytest.fixture
def damaged(whole):
    """The same, for a test to damage."""
    physics, data = whole
    return physics, deepcopy(data)


def read(folder, physics, data):
    (folder / "iterate.json").write_text(json.dumps(data))
    return read_iterate(folder, physics)


@pytest.mark.parametrize("case", [ONE, SEVERAL])
def test_an_iterate_comes_back_whatever_the_order_of_its_scenarios(tmp_path, case):
    physics, fine, point, data = iterate(case)
    assert list(data["scenarios"]) == [each.name for each in physics.scenarios]
    data["scenarios"] = dict(reversed(data["scenarios"].items()))
    physics, start = read(tmp_path, physics, data)
    for one, other in zip(physics.scenarios, fine.scenarios, strict=True):
        assert np.array_equal(one.edges, other.edges)
    assert np.array_equal(start.operation.rotor_speed, point.operation.rotor_speed)
    assert np.array_equal(start.gains, point.gains)
    assert start.reference == point.reference == 5.0
    assert start.starts == point.starts != ()
    assert start.branch == point.branch


def test_a_file_of_another_version_is_refused(tmp_path, damaged):
    physics, data = damaged
    with pytest.raises(InputError, match=r"newer version.*--force"):
        read(tmp_path, physics, data | {"version": 99})
    del data["version"]
    with pytest.raises(InputError, match=r"no iterate of this case.*--force"):
        read(tmp_path, physics, data)


@pytest.mark.parametrize(
    "content",
    ["", "{}", "[]", '{"chord_m": [1e999]}', '{"chord_m": "x"}', "[" * 100_000, "\ud800"],
    ids=["empty", "no keys", "a list", "infinite", "text", "deep", "no UTF-8"],
)
def test_a_corrupt_file_is_refused(tmp_path, whole, content):
    (tmp_path / "iterate.json").write_bytes(content.encode("utf-8", "surrogatepass"))
    with pytest.raises(InputError, match=r"iterate\.json"):
        read_iterate(tmp_path, whole[0])


@pytest.mark.parametrize(
    ("key", "damage"),
    [
        ("chord_m", lambda chord: ["none"] * len(chord)),
        ("chord_m", lambda chord: [-1.0] * len(chord)),
        ("rotor_radius_m", lambda radius: 0.0),
        ("gains", lambda gains: None),
        ("energy_J", lambda energy: [1.0, 2.0]),
        ("scenarios", lambda scenarios: {}),
        ("segment_ends_s", lambda ends: ends[::-1]),
        ("segment_ends_s", lambda ends: ends[1:]),
        ("segment_ends_s", lambda ends: [0.0]),
        ("segment_ends_s", lambda ends: [ends[0], None, *ends[1:]]),
    ],
)
def test_an_iterate_that_cannot_be_of_this_case_is_refused(tmp_path, damaged, key, damage):
    physics, data = damaged
    (scenario,) = data["scenarios"].values()
    section = scenario if key in scenario else data
    section[key] = damage(section[key])
    with pytest.raises(InputError, match=r"no iterate of this case.*--force"):
        read(tmp_path, physics, data)


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(SEVERAL, id="several scenarios"),
        pytest.param(FLOWS, id="several flows", marks=pytest.mark.slow),
        pytest.param(LIMITED, id="two branches", marks=pytest.mark.slow),
    ],
)
def test_a_run_is_resumed_with_its_branches(tmp_path, case):
    def progress(count, *_):
        if count == 2:
            raise KeyboardInterrupt

    how = {"figures": False, "records": False}
    with pytest.raises(KeyboardInterrupt):
        run_case(load_case(case), tmp_path / "out", progress=progress, **how)
    resumed = resume_case(tmp_path / "out", **how)
    assert resumed.success, resumed.message
    again = run_case(load_case(case), tmp_path / "whole", **how)
    # the segments of an open loop are divided where its optima, slightly different, ask for it
    one, two = (each.summary.simulated_energy_J for each in (resumed, again))
    assert one == pytest.approx(two, rel=MESH_ERROR if case is LIMITED else 1e-6)
    assert resumed.summary.branches == again.summary.branches
    names = [(each.name, each.taken) for each in again.summary.branches]
    assert names == ([("overspeed", True), ("underspeed", False)] if case is LIMITED else [])


def test_a_run_goes_on_only_from_where_constraints_nearly_hold(tmp_path, whole):
    state = RunState(whole[0], tmp_path, False)
    state.start = iterate(ONE)[2]
    state.point = lambda: state.start
    for infeasibility, saved in ((0.1, False), (1e-3, True)):
        state(1, 1.0, infeasibility)
        assert (tmp_path / "iterate.json").exists() == saved
