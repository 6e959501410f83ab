"""Cases of several flows through every command: run, show, plot, compare, simulate, resume.

One blade and one controller are designed for all flows of `scenarios`. Weights are shares of time:
the objective is the mean power, the sum of weight times mean power, times the case's duration.
"""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.cli import main
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import complete, physics
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import texts
from hkt_mdo.run.check import check_case
from hkt_mdo.run.run import run_case

SLOW = {"name": "slow", "inflow": {"profile": "sine", "mean": 1.1}, "weight": 0.5}
FAST = {"name": "fast", "inflow": "sine", "weight": 0.5}
TIGHT = {"tolerance": 1e-10}
ENERGIES = {
    "simulated_energy_J": "hydrodynamic_power_W",
    "generator_energy_J": "generator_power_W",
    "electrical_energy_J": "electrical_power_W",
}
# the search for a start takes most of a short run
QUICK = {"start": {"method": "blade"}}


def case(law="quadratic", *scenarios, duration=8.0, segments=6, **sections):
    """Return the data of a short case; without scenarios, of one sine.

    The last speed is free: the end of a short closed cycle makes the optimum of the blade flat.
    """
    flows = {"scenarios": list(scenarios)} if scenarios else {"inflow": "sine"}
    control = {"law": law, "torque_limit": 700.0}
    phase = {"duration": duration, "segments": segments, "final_speed": "free"}
    return {"control": control, "phase": phase, **flows, **sections}


def run(out, data, **options):
    return run_case(load_case(data), out, figures=False, records=False, **options)


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    return run(tmp_path_factory.mktemp("scenarios") / "one", case(driver=TIGHT))


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Flows of different durations and weights, under feedback."""
    flows = SLOW | {"duration": 6.0, "weight": 1.0}, FAST | {"weight": 3.0}
    return run(tmp_path_factory.mktemp("scenarios") / "two", case("quadratic", *flows, **QUICK))


@pytest.fixture(scope="module", params=["two", pytest.param("open_loop", marks=pytest.mark.slow)])
def solution(request, tmp_path_factory):
    """The result of two sines; that which is slow keeps 5 kW and, in one of them, 6 kN too."""
    if request.param == "two":
        return request.getfixturevalue("two")
    flows = SLOW, FAST | {"limits": {"thrust": "6 kN"}}
    sections = {"limits": {"power": "5 kW"}, "rotor": {"station_count": 24}}
    out = tmp_path_factory.mktemp("scenarios") / request.param
    return run(out, case(request.param, *flows, **sections))


# Results of two flows -----------------------------------------------------------------------------


def test_energies_are_integrals_and_the_total_is_the_mean_power_times_the_duration(solution):
    assert solution.success, solution.message
    summary, duration = solution.summary, solution.case.phase.duration
    weights = {each.name: each.weight for each in solution.case.scenarios}
    shares = {name: weight / sum(weights.values()) for name, weight in weights.items()}
    power = 0.0
    for name, share in shares.items():
        row, table = summary.scenarios[name], solution.to_pandas("simulation", name)
        for key, power_of in ENERGIES.items():
            energy = np.trapezoid(table[power_of], table["time_s"])
            assert getattr(row, key) == pytest.approx(energy, rel=1e-5), (name, key)
        assert row.energy_J == pytest.approx(row.simulated_energy_J, rel=2e-4)
        assert row.mean_power_W == pytest.approx(row.simulated_energy_J / row.duration_s, rel=1e-5)
        assert row.share == pytest.approx(share, rel=1e-12)
        power += share * row.mean_power_W
    assert summary.objective.simulated == pytest.approx(duration * power, rel=1e-9)
    assert summary.simulated_energy_J == pytest.approx(duration * power, rel=1e-5)
    assert summary.energy_J == pytest.approx(summary.objective.value, rel=1e-9)
    assert summary.energy_J < summary.energy_bound_J


def test_limits_hold_in_their_scenarios(solution):
    scenarios, several = solution.summary.scenarios, len(solution.case.limits.given) > 0
    assert ("thrust" in scenarios["fast"].limits) == several
    assert "thrust" not in scenarios["slow"].limits
    assert solution.summary.limits["control_torque"].value <= 700.0 * (1.0 + 1e-4)
    if several:
        fast, binds = scenarios["fast"], solution.summary.limits["thrust"].share_of_time
        assert fast.limits["thrust"].value <= 6e3 * (1.0 + 1e-4)
        assert binds == pytest.approx(fast.share * fast.limits["thrust"].share_of_time, abs=1e-8)
        assert solution.summary.limits["power"].scenario == "fast"


def test_the_largest_are_reported_with_their_scenario(solution):
    summary = solution.summary
    for name in ("thrust", "stress"):
        entry, load = summary.loads[name], summary.scenarios["fast"].loads[name]
        assert entry.scenario == "fast"
        assert (entry.value, entry.time_s, entry.r_m) == (load.value, load.time_s, load.r_m)


def test_two_of_one_flow_are_two_and_intervals_are_one():
    made = physics(load_case(case()))
    (one,) = made.scenarios
    same = [replace(one, name="a"), replace(one, name="b")]
    assert replace(made, scenarios=same).groups == {"a": [0], "b": [1]}
    parts = [replace(one, name=f"a_interval_{n}", interval_of="a") for n in (1, 2)]
    assert replace(made, scenarios=[*parts, same[1]]).groups == {"a": [0, 1], "b": [2]}


def test_a_result_gives_each_flow_and_one_design(solution, capsys):
    for command in ("show", "simulate"):
        assert main([command, str(solution.folder)]) == 0
        assert "fast" in capsys.readouterr().out
    empty = replace(solution, summary=solution.summary.model_copy(update={"chord_m": None}))
    with pytest.raises(InputError, match="holds no finished design"):
        empty.design()
    assert "share of time" in texts(check_case(solution.case).tables["Flow of fast"])
    assert solution.scenarios == ("slow", "fast")
    slow = solution.scenario("slow")
    assert slow.energy == solution.summary.scenarios["slow"].energy_J
    assert slow.case.phase.duration == slow.summary.scenarios["slow"].duration_s
    assert slow.case.inflow.mean == 1.1
    speed = slow.to_pandas("trajectory")["inflow_speed_m_s"]
    assert 0.9 <= speed.min() < speed.max() <= 1.3
    with pytest.raises(InputError, match=r"several scenarios: slow, fast; choose one.*--scenario"):
        solution.to_pandas()
    with pytest.raises(InputError, match="'third': unknown scenario; give one of slow, fast"):
        solution.scenario("third")
    design = solution.design()
    np.testing.assert_allclose(design.blade.chord, solution.summary.chord_m, rtol=1e-12)
    gains = [] if solution.gain is None else [solution.gain]
    assert list(design.gains) == pytest.approx(gains)


def test_the_case_of_a_run_is_that_case(two):
    """`case.yaml` has every default of every scenario, and means the same."""
    again = load_case(two.folder / "case.yaml")
    assert again == two.case == complete(again)
    assert [each.duration for each in again.scenarios] == [6.0, 8.0]
    ours, theirs = physics(again), physics(two.case)
    for here, there in zip(ours.scenarios, theirs.scenarios, strict=True):
        assert (here.name, here.weight) == (there.name, there.weight)
        np.testing.assert_array_equal(here.edges, there.edges)


@pytest.mark.slow
def test_force_leaves_no_table_of_the_run_before(tmp_path):
    out, quick = tmp_path / "out", {"driver": {"max_iterations": 2}}
    one, two = case(**quick), case("quadratic", SLOW, FAST, **quick)
    for data, names in ((two, ("_slow", "_fast")), (one, ("",)), (two, ("_slow", "_fast"))):
        run(out, data, force=True)
        tables = {f"{x}{name}.csv" for x in ("simulation", "trajectory", "loads") for name in names}
        shared = {"blade.csv", "coefficients.csv", "convergence.csv"}
        assert {path.name for path in out.glob("*.csv")} == tables | shared
    assert Solution.load(out).scenarios == ("slow", "fast")


# Weights and order --------------------------------------------------------------------------------


def same_design(result, expected, rel, rel_design=None):
    assert result.success, result.message
    assert result.energy == pytest.approx(expected.energy, rel=rel)
    for key in ("chord_m", "twist_deg"):
        here, there = (np.array(getattr(each.summary, key)) for each in (result, expected))
        assert np.max(np.abs(here - there)) <= (rel_design or rel) * np.max(np.abs(there))
    if expected.gain is not None:
        assert result.gain == pytest.approx(expected.gain, rel=rel_design or rel)


@pytest.mark.parametrize("weight", [pytest.param(0.5, marks=pytest.mark.slow), 2.0])
def test_two_equal_flows_are_one(one, tmp_path, weight):
    flows = [{"name": name, "inflow": "sine", "weight": weight} for name in ("a", "b")]
    two = run(tmp_path / "out", case("quadratic", *flows, driver=TIGHT))
    # the energy is flat at the optimum, which the two approach from different starts
    same_design(two, one, 1e-8, rel_design=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["quadratic", "open_loop"])
def test_the_order_of_the_flows_does_not_matter(law, tmp_path):
    flows = SLOW | {"weight": 0.3}, FAST
    result = run(tmp_path / "one", case(law, *flows, driver=TIGHT))
    other = run(tmp_path / "other", case(law, *flows[::-1], driver=TIGHT))
    same_design(other, result, 1e-6)
    assert other.scenarios == ("fast", "slow")


@pytest.mark.slow
def test_a_flow_of_weight_0_counts_in_no_energy_and_keeps_its_limits(one, tmp_path):
    gust = {"profile": "gust", "mean": 1.6, "amplitude": 0.3, "time": 1.0, "width": 6.0}
    flows = FAST, {"name": "gust", "inflow": gust, "weight": 0.0}
    free = run(tmp_path / "free", case("quadratic", *flows))
    assert free.energy == pytest.approx(one.energy, rel=1e-6)
    thrust = free.summary.scenarios["gust"].loads["thrust"].value
    flows[1]["limits"] = {"thrust": 0.97 * thrust}
    kept = run(tmp_path / "kept", case("quadratic", *flows, **QUICK))
    assert kept.success, kept.message
    scenarios = kept.summary.scenarios
    assert kept.summary.simulated_energy_J == scenarios["fast"].simulated_energy_J
    assert scenarios["gust"].limits["thrust"].value <= 0.97 * thrust * (1.0 + 1e-4)
    assert kept.summary.limits["thrust"].scenario == "gust"
    assert kept.summary.limits["thrust"].binding
    assert scenarios["gust"].share == 0.0


@pytest.mark.slow
def test_one_of_two_flows_is_cut(tmp_path):
    flows = SLOW | {"inflow": {"profile": "sine", "mean": 1.2}}, FAST
    data = case("quadratic", *flows, duration=16.0, segments=12)
    data["control"]["cut_out"] = 1.65
    result = run(tmp_path / "out", data)
    assert result.success, result.message
    scenarios = result.summary.scenarios
    assert scenarios["slow"].operation is None
    spans = scenarios["fast"].operation.intervals_s
    assert len(spans) == 2
    still = 16.0 - sum(end - begin for begin, end in spans)
    assert scenarios["fast"].operation.standstill_s == pytest.approx(still, rel=1e-9)
    assert result.table("simulation", "fast")["inflow_speed_m_s"].max() <= 1.65 * (1.0 + 1e-9)
    mean = 0.5 * (scenarios["slow"].simulated_energy_J + scenarios["fast"].simulated_energy_J)
    assert result.summary.simulated_energy_J == pytest.approx(mean, rel=1e-12)
    assert "fast: operation" in texts(result.summary.rows(result.case))
    assert main(["plot", str(result.folder), "--out", str(tmp_path / "figures")]) == 0


# Cases --------------------------------------------------------------------------------------------


def test_what_a_scenario_does_not_say_is_the_case_s(tmp_path):
    record = tmp_path / "flow.csv"
    rows = [f"{t:.2f},{1.4 + 0.1 * np.sin(t):.6f}" for t in np.linspace(0.0, 20.0, 201)]
    record.write_text("\n".join(["time_s,speed_m_s", *rows]), encoding="utf-8")
    flow = {"profile": "record", "file": str(record)}
    scenarios = [{"inflow": flow}, {"duration": 12.0}, {"segments": 9}]
    data = {"inflow": "sine", "control": "quadratic", "scenarios": scenarios}
    whole = complete(load_case(data)).scenarios
    assert [each.duration for each in whole] == pytest.approx([20.0, 12.0, 60.0])
    assert whole[2].segments == 9
    variant = complete(load_case(data | {"phase": {"duration": 10.0, "segments": 8}}))
    assert [each.duration for each in variant.scenarios] == [10.0, 12.0, 10.0]
    assert [each.segments for each in variant.scenarios] == [8, 8, 9]
    assert variant.of_scenario("flow_1").inflow.profile == "record"
    assert variant.of_scenario("flow_1").phase.duration == 10.0
    with pytest.raises(InputError, match=r"scenarios\[0\]\."):
        physics(load_case(data | {"phase": {"duration": 30.0}}))
