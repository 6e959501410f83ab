"""What a run with several scenarios leaves, by their names."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import texts
from hkt_mdo.rotor import bem
from hkt_mdo.run import run as runner
from hkt_mdo.run.groups import by_scenario

CASE = {
    "inflow": "sine",
    "control": {"law": "quadratic", "torque_limit": 700.0},
    "limits": {"power": "6 kW"},
    "phase": {"duration": 15.0, "segments": 15},
    "start": {"method": "blade"},  # what is reported does not depend on it
}
SLOW = {
    "name": "slow",
    "inflow": {"profile": "sine", "mean": 1.2},
    "duration": 12.0,
    "segments": 12,
}
TWO = CASE | {"scenarios": [SLOW | {"weight": 0.6}, {"name": "fast", "weight": 0.4}]}
WEIGHTS = {"slow": 0.6 * 15.0 / 12.0, "fast": 0.4}


@pytest.fixture(scope="module")
def solution(tmp_path_factory) -> Solution:
    out = tmp_path_factory.mktemp("scenarios") / "result"
    return runner.run_case(load_case(TWO), out, records=False)


def test_energies_are_those_of_the_tables(solution):
    assert solution.success, solution.message
    assert solution.scenarios == ("slow", "fast")
    summary, weighted, names = solution.summary, 0.0, solution.scenarios
    for name in names:
        entry, table = summary.scenarios[name], solution.table("simulation", name)
        energy = np.trapezoid(table["hydrodynamic_power_W"], table["time_s"])
        assert entry.simulated_energy_J == pytest.approx(energy, rel=1e-5)
        assert entry.energy_J == pytest.approx(energy, rel=2e-4)
        assert entry.mean_power_W == pytest.approx(energy / entry.duration_s, rel=1e-5)
        assert entry.weight == pytest.approx(WEIGHTS[name], rel=1e-12)
        flow = table["inflow_speed_m_s"]
        assert entry.inflow_speed.max == pytest.approx(flow.max(), rel=1e-8)
        mean = np.trapezoid(flow, table["time_s"]) / table["time_s"][-1]
        assert entry.inflow_speed.mean == pytest.approx(mean, rel=1e-6)
        ratio = solution.table("trajectory", name)["tip_speed_ratio"]
        assert entry.tip_speed_ratio.ends == pytest.approx((ratio.min(), ratio.max()), rel=1e-8)
        weighted += entry.weight * entry.simulated_energy_J
    assert summary.simulated_energy_J == pytest.approx(weighted, rel=1e-12)
    assert [summary.scenarios[name].duration_s for name in names] == [12.0, 15.0]


def test_the_largest_are_reported_with_their_scenario(solution):
    summary = solution.summary
    for name in ("thrust", "stress"):
        entry, own = summary.loads[name], summary.scenarios["fast"].loads[name]
        assert entry.scenario == "fast"
        assert (entry.value, entry.time_s, entry.r_m) == (own.value, own.time_s, own.r_m)
    limit, own = summary.limits["power"], summary.scenarios["fast"].limits["power"]
    assert (limit.value, limit.time_s, limit.scenario) == (own.value, own.time_s, "fast")
    assert own.limit == 6e3
    rows = texts(summary.rows(solution.case))
    assert rows["largest thrust"].endswith("in fast")
    energy = summary.scenarios["slow"].simulated_energy_J
    assert rows["slow: energy, simulated"].startswith(f"{energy / 1e3:#.5g} kJ, on average ")
    assert "share of time 0.6" in rows["slow: flow"]


def test_no_table_is_silently_the_first(solution):
    for ask in (
        lambda: solution.trajectory,
        lambda: solution.to_pandas("simulation"),
        solution.to_xarray,
    ):
        with pytest.raises(InputError, match="has several scenarios: slow, fast; choose one"):
            ask()
    with pytest.raises(InputError, match="'third': unknown scenario; give one of slow, fast"):
        solution.scenario("third")
    assert solution.to_pandas("simulation", "fast")["inflow_speed_m_s"].max() > 1.6
    assert solution.to_xarray("simulation", "slow").attrs["scenario"] == "slow"
    assert solution.table("coefficients") is solution.coefficients


def test_one_scenario_is_a_result_of_its_own(solution):
    fast, own = solution.scenario("fast"), solution.summary.scenarios["fast"]
    assert fast.trajectory is solution.tables["fast"].trajectory
    assert fast.summary.simulated_energy_J == own.simulated_energy_J
    assert fast.summary.energy_bound_J is None
    largest = fast.limit_shares()["power"].max()
    assert largest == pytest.approx(own.limits["power"].value / 6e3, rel=1e-3)
    assert fast.scenario("fast") is fast


def test_the_design_is_that_of_the_result(solution):
    design = solution.design()
    np.testing.assert_allclose(design.blade.chord, solution.blade["chord_m"], rtol=1e-12)
    assert design.gains == pytest.approx([solution.summary.gain])
    assert design.law.law == "quadratic"
    assert design.turbine.blade is design.blade
    assert design.outlines[0].thickness == pytest.approx(design.turbine.thickness)
    ratio = solution.summary.tip_speed_ratio_at_power_coefficient_max
    power = bem.rotor_coefficients(design.blade, design.polars, ratio).power[0]
    assert power == pytest.approx(solution.summary.power_coefficient_max, rel=1e-9)


def test_two_of_one_flow_are_two_and_intervals_are_one():
    (one,) = physics(load_case(CASE)).scenarios
    same = [replace(one, name="a"), replace(one, name="b")]
    assert by_scenario(same) == {"a": [0], "b": [1]}
    parts = [
        replace(one, name=f"a_interval_{n}", interval_of="a", edges=np.array(ends))
        for n, ends in ((1, [0.0, 2.0]), (2, [3.0, 4.0]))
    ]
    assert by_scenario([*parts, same[1]]) == {"a": [0, 1], "b": [2]}
    interval = replace(one, name="interval_1", interval_of="phase")
    assert by_scenario([interval]) == {"phase": [0]}
