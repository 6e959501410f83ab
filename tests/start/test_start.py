"""The start by quasi-steady co-design reaches what theory knows."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.evaluation import in_motion, on_start
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.point import PRICE
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.start.find import LOCAL, Candidate, Search, find_start


def model_of(law="open_loop", limit=None, **sections):
    control = {"law": law, "torque_limit": limit}
    return physics(load_case({"inflow": "sine", "control": control} | sections))


@pytest.fixture(scope="module")
def optimum():
    free = model_of()
    return free.rotor.best_of_shape(free.shape, free.blade)


@pytest.mark.parametrize("law", ["open_loop", "quadratic"])
def test_co_design_reaches_the_steady_optimum(law, optimum):
    """Without a limit, open loop and quadratic feedback keep the best rotor at its best ratio."""
    case = model_of(law)
    start, (flow, weights) = find_start(case, optimum), case.sampled_flow
    power = optimum.power_coefficient * power_scale(case.density, case.blade.rotor_radius, flow)
    assert start.operation.energy == pytest.approx(weights @ power, rel=5e-5)
    assert start.operation.rotor_speed.shape == flow.shape


def test_the_optimum_of_one_blade_is_start_enough(optimum):
    """The candidates are improved from any blade, not from the steady optimum alone."""
    case = model_of(limit=700.0)
    operation = best_operation(case.blade, case.rotor.polar)
    best, energy = (find_start(case, each).operation.energy for each in (optimum, operation))
    assert energy == pytest.approx(best, rel=1e-5)


def test_a_fixed_blade_is_kept():
    case = model_of("quadratic", design={"blade": "fixed"})
    best = best_operation(case.blade, case.rotor.polar)
    start, radius = find_start(case, best), case.blade.rotor_radius
    np.testing.assert_array_equal(start.blade.chord, case.blade.chord)
    gain = 0.5 * case.density * np.pi * radius**5 * best.power_coefficient
    assert start.gains[0] == pytest.approx(gain / best.tip_speed_ratio**3, rel=0.02)
    as_it_is = find_start(model_of("quadratic", 700.0), best, improve=False)
    assert as_it_is.objective == pytest.approx(as_it_is.operation.energy)  # not the open loop's


@pytest.mark.parametrize("bounds", [pytest.param((0.0, 1.0), marks=pytest.mark.slow), (30.0, 40.0)])
def test_gains_are_searched_within_their_bounds(bounds, optimum):
    """Whatever the bounds, the start keeps them and is worth what its own gain gives."""
    free, bound = (
        find_start(model_of("quadratic", 700.0, design=design), optimum)
        for design in ({}, {"gain_bounds": bounds})
    )
    assert not bounds[0] <= free.gains[0] <= bounds[1]
    assert bounds[0] <= bound.gains[0] <= bounds[1]
    assert bound.operation.running
    assert bound.operation.energy < free.operation.energy


@pytest.mark.slow
def test_it_reports_the_outcome_of_each_candidate():
    start = find_start(model_of("quadratic", limits={"rotor_speed": 11}))
    names = [record.strategy for record in start.starts]
    assert names == ["best blade", "best blade of a slower rotor", "blade as given"]
    (kept,) = (record for record in start.starts if record.kept)
    merits = [x.objective * (1.0 - PRICE * max(x.excess, 0.0)) for x in start.starts]
    assert kept.objective == pytest.approx(max(merits), rel=1e-5)
    assert kept.objective == pytest.approx(start.operation.energy, rel=1e-4)
    assert (kept.exceeds, len(start.starts)) == ((), 3)


def test_the_blade_as_given_says_that_its_optimum_is_local(optimum):
    case = model_of(start={"method": "blade"})
    start = find_start(case, optimum)
    assert start.messages == (LOCAL,)
    assert [(record.strategy, record.kept) for record in start.starts] == [("blade as given", True)]
    np.testing.assert_array_equal(start.blade.chord, case.blade.chord)
    assert find_start(case, optimum, improve=False).messages == ()


def test_a_schedule_keeps_the_limit_of_the_torque_between_the_speeds_of_its_search():
    """Where the law is saturated, the rotor is not at the speed of its schedule."""
    law = {"law": "tracking", "torque_limit": 700, "knots": 12}
    law |= {"proportional_gain": 300, "integral_gain": 6000}
    case = physics(load_case({"inflow": "sine", "control": law}))
    assert max(np.max(x["control_torque"]) for x in on_start(case, find_start(case))) < 1.005 * 700


def test_a_load_may_be_limited_in_one_scenario_alone():
    flows = [{"inflow": "sine"}, {"inflow": "step", "limits": {"thrust": "6 kN"}}]
    case = physics(load_case({"inflow": "sine", "control": "quadratic", "scenarios": flows}))
    assert find_start(case, case.rotor.best_operation(case.blade), improve=False).operation.running
    assert case.load_names == ("thrust",)


def test_a_static_law_is_fitted_on_the_branch_that_it_can_hold(optimum, monkeypatch):
    """Where the open loop's optimum has left that: to the schedule of the candidate's blade."""
    case = physics(load_case({"inflow": "sine", "control": "rated", "limits": {"power": 3000}}))
    begun = []

    def optimum_of(self, point, steady=None):
        if steady is not None:
            return replace(point, branch="underspeed", operation=None)
        begun.append(point)
        return replace(point, objective=1.0)

    monkeypatch.setattr(Search, "_optimum", optimum_of)
    monkeypatch.setattr(Search, "_over_time", lambda self, point: point)
    search = Search(case, optimum)
    search.optima([Candidate("", case.blade)])
    expected = search._scheduled(case.blade, "overspeed")
    assert np.array_equal(begun[0].operation.rotor_speed, expected.operation.rotor_speed)


def test_an_open_loop_begins_as_its_inertia_allows():
    """A rotor of 50 kg m² would need 1.3 times its torque to follow the schedule within 5 kW."""
    case = model_of(limits={"power": 5000}, rotor={"hub_inertia": 50})
    start = find_start(case, improve=False)
    (series,), largest = on_start(case, start), []
    for operation in (start.operation, in_motion(case, start).operation):
        change = series["inertia"] * np.diff(operation.rotor_speed) / np.diff(series["time"])
        largest.append(np.max(operation.hydrodynamic_torque[1:] - change))
    np.testing.assert_allclose(largest / np.max(series["control_torque"]), [1.3, 1.04], atol=0.01)
