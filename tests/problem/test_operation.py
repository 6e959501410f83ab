"""Intervals of operation below a cut-out speed: closed forms, what stays as it is, refusals."""

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.certificate import Certificate
from hkt_mdo.errors import InputError
from hkt_mdo.problem.evaluation import broken_limits
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.start.find import find_start

FIRST, HALF = np.arcsin(0.5) / 0.25, np.pi / 0.25
"""When the paper's sine reaches 1.6 m/s, and half its period (s)."""
BELOW = HALF * np.array([[0, 0], [1, 2], [3, 4]]) + FIRST * np.array([[0, 1], [-1, 1], [-1, 1]])


def model_of(cut_out=1.6, **sections):
    """Return the physics of the paper's turbine with quadratic feedback; the flow is its sine."""
    control = {"law": "quadratic", "cut_out": cut_out}
    return physics(load_case({"inflow": "sine", "control": control} | sections))


def passed(begin, end):
    """Return the integral of (1.5 + 0.2 sin x/4)³ over time, m³/s², by its antiderivative."""

    def primitive(time):
        x, (a, b) = 0.25 * time, (1.5, 0.2)
        squares = 0.5 * x - 0.25 * np.sin(2.0 * x)
        cubes = np.cos(x) ** 3 / 3.0 - np.cos(x)
        linear = a**3 * x - 3 * a * a * b * np.cos(x)
        return (linear + 3 * a * b * b * squares + b**3 * cubes) / 0.25

    return primitive(end) - primitive(begin)


# Theory -------------------------------------------------------------------------------------------


def test_a_cut_sine_is_what_is_left_of_it():
    model = model_of()
    np.testing.assert_allclose([each.edges[[0, -1]] for each in model.scenarios], BELOW, rtol=1e-12)
    for scenario, (begin, end) in zip(model.scenarios, BELOW, strict=True):
        expected = passed(begin, end)
        flow = scenario.inflow.speed_at
        assert np.sum(scenario.inflow.cubes(scenario.edges)) == pytest.approx(expected, rel=1e-10)
        nodes = scenario.node_weights @ flow(scenario.node_times) ** 3
        assert nodes == pytest.approx(expected, rel=1e-5)
        best = np.ones(3), np.ones(3), (1.0, 1.0)
        passing = Certificate(*best, scenario.inflow, scenario.edges, 1.0, 1.0, None)
        assert passing.weights @ passing.speed**3 == pytest.approx(expected, rel=1e-5)
        np.testing.assert_allclose(passing.time.min() + passing.time.max(), end - begin)
        assert np.max(flow(scenario.samples)) <= 1.6 * (1.0 + 1e-11)


def test_quasi_steady_energy_of_a_cut_sine():
    """Quadratic feedback with its best gain has the largest power coefficient in every flow."""
    model = model_of()
    best = model.rotor.best_operation(model.blade)
    gain = power_scale(model.density, model.blade.rotor_radius, 1.0) * best.power_coefficient
    gain *= (model.blade.rotor_radius / best.tip_speed_ratio) ** 3
    model = model_of(control={"law": "quadratic", "cut_out": 1.6, "gain": gain})
    start = find_start(model, best, improve=False)
    expected = power_scale(model.density, model.blade.rotor_radius, 1.0) * best.power_coefficient
    expected *= sum(passed(*span) for span in BELOW)
    assert start.operation.energy == pytest.approx(expected, rel=1e-4)


def test_a_limit_that_the_fast_flow_alone_breaks_is_kept():
    broken = []
    for cut_out in (None, 1.6):
        model = model_of(cut_out, limits={"power": "6 kW"})
        start = find_start(model, model.rotor.best_operation(model.blade), improve=False)
        broken.append(broken_limits(model, start))
    assert broken == [["power"], []]


@pytest.mark.parametrize("cut_out", [1.7, 2.0])
def test_a_flow_that_is_nowhere_faster_is_left_as_it_is(cut_out):
    (kept,), (whole,) = (model_of(each).scenarios for each in (cut_out, None))
    assert kept.name == whole.name
    assert np.array_equal(kept.edges, whole.edges)
    assert np.array_equal(kept.sample_weights, whole.sample_weights)
    assert "no effect" in " ".join(model_of(cut_out).messages)


# What is told and refused -------------------------------------------------------------------------


def test_short_intervals_are_standstill_too():
    """A rotor of 2.8 m needs 1.7 s in 1.65 m/s: the lulls of this flow last for 1 s."""
    gust = {"profile": "gust", "mean": 1.7, "amplitude": -0.3, "time": 10.0, "width": 2.0}
    dip = {"profile": "gust", "mean": 1.7, "amplitude": -0.3, "time": 30.0, "width": 20.0}
    model = model_of(1.65, inflow={"profile": "sum", "parts": [dip, gust]})
    (scenario,) = model.scenarios
    # (1 - cos 2 pi s)² / 4 = 1/6 at the ends of the long one
    share = np.arccos(1.0 - np.sqrt(4.0 / 6.0)) / (2.0 * np.pi)
    np.testing.assert_allclose(scenario.edges[[0, -1]], [30 + 20 * share, 50 - 20 * share])
    (message,) = [each for each in model.messages if "cut_out" in each]
    still = 60.0 - 20.0 * (1.0 - 2.0 * share)
    assert f"standstill for {still:.4g} s of 60 s" in message
    assert f"operation: 1; 1 more, of {2.0 * (1.0 - 2.0 * share):.3g} s together" in message


def test_the_name_of_an_interval_is_that_of_no_other_scenario():
    slow = {"name": "a_interval_1", "inflow": {"profile": "constant", "speed": 1.0}}
    scenarios = [{"name": "a", "inflow": "sine"}, slow]
    case = {"control": {"law": "quadratic", "cut_out": 1.6}, "scenarios": scenarios}
    with pytest.raises(InputError, match="scenarios = 'a_interval_1': is the name"):
        physics(load_case(case))
