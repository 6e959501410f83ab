"""What a run tells of a wake with memory, and a run whose case asks for it."""

from types import SimpleNamespace

import numpy as np
import pytest

from hkt_mdo import build_problem, load_case, run_case
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics
from hkt_mdo.run.checks import _of_tables
from hkt_mdo.run.memory import Loop, _verdict
from tests.conftest import NINE

CASE = {"inflow": "sine", "control": "quadratic"}
MEMORY = ("inflow_dynamics=oye",)


def test_a_wake_outside_its_tables_and_one_that_they_do_not_determine_are_refused():
    """The tables end at 0.7 and 1.3 times the wake's tip speed ratio; induction must not turn."""
    nodes = np.linspace(4.0, 10.0, 25)
    series = {"tip_speed_ratio": np.array([7.0, 8.0]), "wake_ratio": np.array([7.0, 7.5])}

    def checks(table, direction=1.0, **changes):
        problem, setup = SimpleNamespace(get_val=lambda name: table), SimpleNamespace(nodes=nodes)
        result = SimpleNamespace(setup=setup, trajectories=[series | changes], problem=problem)
        band = SimpleNamespace(direction=direction)
        return {name: value for name, value, *_ in _of_tables(band, result, ["table"])}

    rising = 0.03 * nodes
    kept = {"wake_in_tables": 0.0, "wake_induction_turns": 0.0}
    assert checks(rising) == checks(0.3 - rising, -1.0) == kept
    fast = checks(rising, tip_speed_ratio=np.array([7.0, 10.5]))
    assert fast["wake_in_tables"] == pytest.approx((10.5 / 7.5 - 1.3) / 0.6)
    slow = checks(rising, wake_ratio=np.array([3.4, 7.5]), tip_speed_ratio=np.array([3.4, 7.5]))
    assert slow["wake_in_tables"] == pytest.approx(0.1)
    assert checks(0.3 - rising)["wake_induction_turns"] == pytest.approx(0.03)


@pytest.mark.parametrize(("steady", "share"), [(True, 0.25), (False, 2.0 / 3.0)])
def test_the_share_of_an_instability_is_one_of_the_time(monkeypatch, steady, share):
    values = dict.fromkeys(("frozen_growth", "least_inertia", "frozen"), np.ones(3))
    values["slow"] = np.ones((3, 1))
    loop = SimpleNamespace(growth=np.array([-1.0, 1.0, 1.0]), **values)
    monkeypatch.setattr(Loop, "of", lambda *_: loop)
    scenario = SimpleNamespace(steady=steady, node_weights=np.array([3.0, 1.0, 0.0]))
    plant = SimpleNamespace(blade=SimpleNamespace(rotor_radius=1.0), inertia=1.0)
    series = {"time": np.arange(3), "rotor_speed": np.full(3, 9.0)}
    along = [(scenario, plant, None, series | {"inflow_speed": np.arange(1.0, 4.0)})]
    verdict = _verdict(SimpleNamespace(scenarios=[scenario], law=SimpleNamespace(states={})), along)
    assert verdict.share_of_instants == pytest.approx(share)


@pytest.mark.slow
def test_a_case_that_cannot_be_stable_ends_at_its_start(tmp_path):
    case = load_case(CASE | {"control": {"law": "quadratic", "torque_limit": 700}}, MEMORY)
    with pytest.raises(InputError, match=r"stable from a shaft inertia .* give rotor.hub_inertia"):
        run_case(case, tmp_path / "light", figures=False, records=False)


@pytest.mark.slow
def test_scenarios_with_memory_in_other_water_fouled_and_steady():
    """Each has the tables of its own turbine; in a constant flow they give the loads of BEM."""
    flow = {"profile": "constant", "speed": 1.2}
    scenarios = [
        {"name": "own"},
        {"name": "fouled", "density": 1025, "condition": {"drag": 1.5, "inertia": 1.2}},
        {"name": "steady", "steady": True},
    ]
    case = CASE | {"inflow": flow, "scenarios": scenarios, "limits": {"thrust": 6900}}
    case |= {"phase": {"duration": 10, "segments": 10}, "rotor": {"station_count": 9}}
    problem = build_problem(load_case(case, MEMORY), improve=False)
    problem.run_model()
    model = physics(load_case(case, MEMORY))
    for scenario in model.scenarios:
        rotor = model.rotor_in(scenario)
        path, loads = scenario.path, f"loads_{scenario.name}.thrust"
        ratio = problem.get_val(f"{path}.tip_speed_ratio").ravel()[:1]
        pressure = 0.5 * rotor.water_density * 1.2**2
        load = rotor.loads(model.blade, ratio, names=("thrust",))["thrust"].exact[0, 0]
        assert problem.get_val(loads)[0] == pytest.approx(pressure * load, rel=1e-3)
        torque = pressure * np.pi * 1.4**3 * rotor.coefficients(model.blade, ratio).torque
        assert problem.get_val(f"{path}.hydrodynamic_torque").ravel()[:1] == pytest.approx(
            torque, rel=1e-3
        )


@pytest.mark.slow
def test_the_mesh_is_judged_by_the_two_filters_and_loads_in_their_wake(solve_physics):
    """Filters of all stations that differ from the two do not divide the mesh."""
    case = {"inflow": "sine", "control": "linear", "inflow_dynamics": "oye"}
    case |= {"rotor": {"stations": NINE}, "limits": {"thrust": 8200}}
    case |= {"phase": {"duration": 20, "segments": 20}}
    solved = solve_physics(case)
    assert solved.failed() == []
    assert "closed_loop_with_memory" in solved.by_name
    assert "energy_over_bound" not in solved.by_name
    assert not any("coarse" in each.why for each in solved.passes)
    verification = solved.verification
    assert verification.energy_error < 0.2 * solved.by_name["two_filters_energy"].value < 2e-4
    table = solved.result.problem.get_val("loads_phase.thrust").ravel()
    direct, nodes = verification.at_nodes["thrust"], verification.trajectory
    np.testing.assert_allclose(direct, table, rtol=2e-4)
    assert np.max(np.abs(direct / verification.loads(nodes)["thrust"] - 1.0)) > 5e-3
