"""The problem without time: what it keeps of the flow, and its optima against theory."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.solve import drivers
from hkt_mdo.solve.casadi_driver import CasadiIpoptDriver
from hkt_mdo.start.find import BEST, CONSTANT, find_start
from hkt_mdo.start.result import GIVEN
from hkt_mdo.start.steady import without_time
from hkt_mdo.start.steady_flow import KNOTS

RIVER = Path(__file__).parents[1] / "data" / "river25"


@cache
def river(law):
    """Return the start of a turbine of its own with several limits under a law."""
    changes = f"control.law={law}", "rotor.station_count=10"
    model = physics(load_case(RIVER / "river25.yaml", changes))
    return model, find_start(model)


def test_it_keeps_the_power_and_the_ends_of_each_flow():
    flows = [{"inflow": "sine"}, {"inflow": "step", "weight": 2.0}]
    model = physics(load_case({"inflow": "sine", "control": "linear", "scenarios": flows}))
    for before, after in zip(model.scenarios, without_time(model).scenarios, strict=True):
        flow = before.inflow.speed_at(before.samples)
        assert after.speeds.size <= KNOTS
        assert after.speeds[[0, -1]] == pytest.approx([flow.min(), flow.max()])
        power = before.sample_weights @ flow**3
        assert after.sample_weights @ after.speeds**3 == pytest.approx(power, rel=1e-4)
        assert after.weight == before.weight


def test_memory_and_a_designed_hub_have_no_effect_in_equilibrium():
    case = {"inflow": "sine", "control": "quadratic", "inflow_dynamics": "oye"}
    case |= {"rotor": {"hub_inertia": 100.0}}
    case |= {"design": {"hub_inertia_bounds": [10, 1000], "hub_inertia_price": 2.0}}
    steady = without_time(physics(load_case(case)))
    assert not steady.remembers
    assert steady.case.design.hub_inertia_bounds == (100.0, 100.0)


def test_a_generator_s_table_ends_at_a_limit_of_the_speed():
    """Beyond it no efficiency is known, so the optimizer may not go there."""
    for rpm, overrides in ((70.0, []), (60.0, ["limits.rotor_speed=60 rpm"])):
        model = physics(load_case(RIVER / "river25.yaml", overrides))
        (limit,) = (each for each in model.all_limits if each.name == "rotor_speed")
        assert limit.bound == pytest.approx(rpm * np.pi / 30.0)


@pytest.mark.slow
def test_under_quadratic_feedback_power_is_kept_by_a_poor_blade_or_a_constant_torque():
    """K w^2 keeps the tip speed ratio, so the power goes with v^3 up to the fastest flow's.

    Which blade leads to the poor one, besides the solid one, depends on the machine: with
    OPENBLAS_CORETYPE=Haswell the given blade does too.
    """
    model, start = river("quadratic")
    (solid,) = (each for each in start.starts if each.strategy == CONSTANT)
    assert start.objective == pytest.approx(solid.objective, rel=1e-6)
    assert start.excess < 1e-3
    proportional = [each for each in start.starts if each.objective < 0.999 * solid.objective]
    assert len(proportional) >= 2
    assert all(each.objective < 0.8 * start.objective for each in proportional)
    flow, weights = model.sampled_flow
    most = 25e3 * (weights @ flow**3) / flow.max() ** 3
    assert all(each.objective < most for each in proportional if each.excess < 1e-3)


@pytest.mark.slow
def test_laws_nest_without_time():
    """A rated law is nearly an open loop, and no law is above it."""
    (_, quadratic), (model, rated) = river("quadratic"), river("rated")
    assert max(quadratic.excess, rated.excess) < 1e-3
    guides = [each for each in rated.starts if each.law == "open_loop"]
    assert max(each.excess for each in guides) < 1e-3
    free = max(each.objective for each in guides if each.branch == rated.branch)
    assert quadratic.objective < rated.objective < free * (1.0 + 1e-4)
    assert rated.objective > 0.99 * free
    flow, weights = model.sampled_flow
    best = model.rotor.best_of_shape(model.shape, model.blade).power_coefficient
    passing = power_scale(model.density, model.blade.rotor_radius, flow)
    assert max(x.objective for x in guides) < weights @ np.minimum(best * passing, 25e3)


def test_gains_that_a_law_does_not_need_are_given_as_they_are():
    """A law with a given power keeps it while its gain is designed."""
    control = {"law": "rated", "gain": 8.0, "power": 4000.0}
    case = {"inflow": "sine", "control": control, "start": {"method": "blade"}}
    model = physics(load_case(case))
    start = find_start(model)
    assert list(start.gains) == list(model.law.starting_gains())
    assert start.operation.running


@pytest.mark.parametrize("gain", [1.5, 150.0])
def test_it_goes_on_where_an_optimization_ends_as_far_as_it_may_go(gain):
    """From a gain far from the best one, 22.6 N m s², it reaches the same optimum."""
    control = {"law": "quadratic", "gain": gain}
    case = {"inflow": "sine", "control": control, "design": {"blade": "fixed"}}
    starts = find_start(physics(load_case(case)), improve=True).starts
    assert [each.strategy for each in starts] == [BEST, GIVEN]
    assert starts[1].objective == pytest.approx(starts[0].objective, rel=1e-5)


def test_it_goes_on_where_an_optimization_ends_before_an_optimum(monkeypatch):
    """At gaps of 1e-3 and 2e-5 of the objective, not at 1e-6."""
    gaps, made, make_driver = [1e-3, 2e-5, 1e-6], [], drivers.make_driver

    def make(*args, **options):
        made.append(make_driver(*args, **options))
        return made[-1]

    gap = property(lambda driver: gaps[made.index(driver)], lambda driver, value: None)
    monkeypatch.setattr(drivers, "make_driver", make)
    monkeypatch.setattr(CasadiIpoptDriver, "gap", gap)
    find_start(physics(load_case({"inflow": "sine", "control": "open_loop"})))
    assert len(made) == 3
