"""Quasi-steady operation: against formulas, and its gradients against differences."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.dynamics.generator import LOSSLESS, Generator
from hkt_mdo.dynamics.laws import LinearFeedback, OpenLoop, QuadraticFeedback
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.hydrodynamics import Hydrodynamics
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.start.quasi_steady import MOST_SPEEDS, QuasiSteady

RADIUS, DENSITY = 1.4, 1000.0
TIME = np.linspace(0.0, 60.0, 121)
WEIGHTS = np.full(121, 0.5)
WEIGHTS[[0, -1]] = 0.25
FLOW = 1.5 + 0.2 * np.sin(0.25 * TIME)
SPLINE = TorqueSpline(np.linspace(2.0, 15.0, 131))


RUBS = Generator(shaft_friction=40.0, shaft_friction_slope=5.0)


def quasi_steady(law=None, limit=None, shaft=LOSSLESS):
    law = law or OpenLoop(torque_limit=limit)
    return QuasiSteady(FLOW, WEIGHTS, DENSITY, RADIUS, SPLINE, law, shaft=shaft)


@pytest.fixture(scope="module")
def table(blade, polar):
    return bem.rotor_coefficients(blade, polar, SPLINE.nodes).torque


def ideal_energy(power_coefficient):
    return 0.5 * DENSITY * np.pi * RADIUS**2 * power_coefficient * (WEIGHTS @ FLOW**3)


def test_unlimited_open_loop_captures_the_largest_power_at_each_instant(blade, polar, table):
    best = best_operation(blade, Hydrodynamics(polar))
    operation = quasi_steady().operate(table)
    assert operation.energy == pytest.approx(ideal_energy(best.power_coefficient), rel=1e-4)
    np.testing.assert_allclose(
        operation.rotor_speed * RADIUS / FLOW, best.tip_speed_ratio, rtol=1e-2
    )


def test_quadratic_feedback_with_the_matching_gain_equals_open_loop(table):
    """K2 = 0.5 rho pi R^5 Cq / tsr^2 keeps the tip speed ratio at which Cq was taken."""
    ratio = quasi_steady().operate(table).rotor_speed[0] * RADIUS / FLOW[0]
    coefficient = float((SPLINE.basis(np.array([ratio])) @ table)[0])
    gain = 0.5 * DENSITY * np.pi * RADIUS**5 * coefficient / ratio**2
    operation = quasi_steady(QuadraticFeedback()).operate(table, [gain])
    assert operation.running
    assert operation.energy == pytest.approx(quasi_steady().operate(table).energy, rel=1e-9)


def test_torque_limit_is_met_on_the_fast_side(table):
    operation = quasi_steady(limit=700.0).operate(table)
    assert np.max(operation.hydrodynamic_torque) == pytest.approx(700.0, rel=1e-9)
    free = quasi_steady().operate(table)
    assert np.all(operation.rotor_speed >= free.rotor_speed * (1.0 - 1e-9))


def test_the_torque_that_the_limit_leaves_with_friction(table):
    """The generator holds its limit, and the shaft takes the rest."""
    operation = quasi_steady(limit=700.0, shaft=RUBS).operate(table)
    held = operation.hydrodynamic_torque - RUBS.friction(operation.rotor_speed)
    assert np.max(held) == pytest.approx(700.0, rel=1e-9)


def test_an_excessive_gain_is_not_running(table):
    assert not quasi_steady(QuadraticFeedback()).operate(table, [500.0]).running


@pytest.mark.parametrize(
    ("law", "limit", "gains", "shaft"),
    [
        (None, None, [], LOSSLESS),
        (None, 700.0, [], LOSSLESS),
        (None, 700.0, [], RUBS),
        (LinearFeedback(), None, [110.0], LOSSLESS),
        (LinearFeedback(torque_limit=700.0), None, [80.0], LOSSLESS),
        (QuadraticFeedback(torque_limit=700.0), None, [15.0], LOSSLESS),
        (QuadraticFeedback(torque_limit=700.0), None, [15.0], RUBS),
    ],
)
def test_gradient_of_the_energy(table, law, limit, gains, shaft):
    problem, gains = quasi_steady(law, limit, shaft), np.array(gains)
    operation = problem.operate(table, gains)
    direction = np.cos(np.arange(table.size))
    step = 1e-7
    difference = (
        problem.operate(table + step * direction, gains).energy
        - problem.operate(table - step * direction, gains).energy
    ) / (2.0 * step)
    by_table, by_gain, (by_radius,) = np.split(operation.gradient()[0], [table.size, -1])
    assert by_table @ direction == pytest.approx(difference, rel=1e-4)
    larger, smaller = (
        replace(problem, rotor_radius=RADIUS * factor).operate(table, gains).energy
        for factor in (1.0 + 1e-6, 1.0 - 1e-6)
    )
    assert by_radius == pytest.approx((larger - smaller) / (2e-6 * RADIUS), rel=1e-4)
    for i in range(gains.size):
        change = 1e-5 * gains[i] * np.eye(gains.size)[i]
        difference = (
            problem.operate(table, gains + change).energy
            - problem.operate(table, gains - change).energy
        ) / (2.0 * change[i])
        assert by_gain[i] == pytest.approx(difference, rel=1e-4)


@pytest.mark.parametrize(
    ("law", "gains", "shaft"),
    [
        (LinearFeedback(), [110.0], LOSSLESS),
        (LinearFeedback(torque_limit=700.0), [80.0], LOSSLESS),
        (QuadraticFeedback(), [9.0], LOSSLESS),
        (QuadraticFeedback(), [9.0], RUBS),
    ],
)
def test_gradients_of_the_distance_from_stall(table, law, gains, shaft):
    problem, gains = quasi_steady(law, shaft=shaft), np.array(gains)
    gradient = problem.operate(table, gains).gradient()[1:]
    by_table, by_gain, by_radius = np.split(gradient, [table.size, -1], axis=1)

    def slope(at):
        return at(1.0) - at(-1.0)

    def margin(table, gains, radius=RADIUS):
        changed = replace(problem, rotor_radius=radius)
        found = changed.operate(table, gains)
        speeds = np.sort(FLOW)[np.unique(np.linspace(0, 120, 12).round().astype(int))]
        w = np.interp(speeds, np.sort(FLOW), found.rotor_speed[np.argsort(FLOW)]) * 0.98
        scale = 0.5 * np.pi * radius**3 * DENSITY * speeds**2
        driving = scale * (SPLINE.basis(w * radius / speeds) @ table)
        assert found.margin * 0.05 * scale == pytest.approx(
            driving - law.torque(w, gains) - shaft.friction(w), rel=1e-6, abs=1e-6
        )
        return found.margin

    step = 1e-6
    difference = slope(lambda sign: margin(table, gains * (1.0 + sign * step)))
    np.testing.assert_allclose(by_gain @ gains, difference / (2.0 * step), rtol=1e-4, atol=1e-6)
    difference = slope(lambda sign: margin(table, gains, RADIUS * (1.0 + sign * step)))
    np.testing.assert_allclose(
        by_radius[:, 0] * RADIUS, difference / (2.0 * step), rtol=1e-4, atol=1e-6
    )
    direction = np.cos(np.arange(table.size)) * 1e-2
    difference = slope(lambda sign: margin(table + sign * step * direction, gains))
    np.testing.assert_allclose(
        by_table @ direction, difference / (2.0 * step), rtol=1e-4, atol=1e-6
    )


def test_a_condensed_flow_has_the_same_energy(table):
    time = np.linspace(0.0, 600.0, 24001)
    flow = 1.5 + 0.2 * np.sin(0.25 * time) + 0.1 * np.sin(1.7 * time + 1.0)
    weights = np.full(time.size, time[1])
    problem = QuasiSteady(
        flow, weights, DENSITY, RADIUS, SPLINE, LinearFeedback(torque_limit=700.0)
    )
    few = problem.condensed()
    assert few.inflow_speed.size <= MOST_SPEEDS
    assert few.weights.sum() == pytest.approx(weights.sum(), rel=1e-12)
    assert (few.inflow_speed[0], few.inflow_speed[-1]) == (flow.min(), flow.max())
    assert few.operate(table, [80.0]).energy == pytest.approx(
        problem.operate(table, [80.0]).energy, rel=2e-6
    )
