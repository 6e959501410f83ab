"""Quasi-steady operation against formulas."""

from types import SimpleNamespace

import numpy as np
import pytest

from hkt_mdo.dynamics.generator import LOSSLESS, Generator
from hkt_mdo.dynamics.laws import QuadraticFeedback
from hkt_mdo.dynamics.simulation import Plant, by_curve
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.polars import Polars
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.start.steady_flow import QuasiSteady

RADIUS, DENSITY = 1.4, 1000.0
TIME = np.linspace(0.0, 60.0, 121)
WEIGHTS = np.full(121, 0.5)
WEIGHTS[[0, -1]] = 0.25
FLOW = 1.5 + 0.2 * np.sin(0.25 * TIME)
SPLINE = TorqueSpline(np.linspace(2.0, 15.0, 131))


RUBS = Generator(shaft_friction=40.0, shaft_friction_slope=5.0)


def quasi_steady(table, law, shaft=LOSSLESS):
    blade = SimpleNamespace(rotor_radius=RADIUS)
    plant = Plant(blade, Polars(), 0.0, DENSITY, by_curve(SPLINE.curve(table)), shaft)
    return QuasiSteady(plant, law, FLOW, WEIGHTS)


@pytest.fixture(scope="module")
def table(blade, polar):
    return bem.rotor_coefficients(blade, polar, SPLINE.nodes).torque


def test_quadratic_feedback_with_the_matching_gain_captures_the_largest_power(blade, polar, table):
    """K2 = 0.5 rho pi R^5 Cq / tsr^2 keeps the tip speed ratio at which Cq was taken."""
    best = best_operation(blade, polar)
    gain = 0.5 * DENSITY * np.pi * RADIUS**5 * best.power_coefficient / best.tip_speed_ratio**3
    for shaft in (LOSSLESS, RUBS):
        operation = quasi_steady(table, QuadraticFeedback(), shaft).operate([gain])
        assert operation.running
        balance = gain * operation.rotor_speed**2 + shaft.friction(operation.rotor_speed)
        np.testing.assert_allclose(operation.hydrodynamic_torque, balance, rtol=1e-9)
    operation = quasi_steady(table, QuadraticFeedback()).operate([gain])
    available = 0.5 * DENSITY * np.pi * RADIUS**2 * (WEIGHTS @ FLOW**3)
    assert operation.energy == pytest.approx(best.power_coefficient * available, rel=1e-4)
    ratio = operation.rotor_speed * RADIUS / FLOW
    np.testing.assert_allclose(ratio, best.tip_speed_ratio, rtol=1e-3)


def test_a_rotor_near_its_largest_torque_does_not_recover(table):
    """A constant torque holds no speed below that of the largest torque; K2 w^2 does."""
    problem, gains = quasi_steady(table, QuadraticFeedback()), [10.0]
    assert problem.recovers(gains, problem.operate(gains))
    peak = SPLINE.nodes[np.argmax(table)]
    stalled = problem.held(0.98 * peak * FLOW / RADIUS)
    torque = np.min(stalled.hydrodynamic_torque)
    constant = SimpleNamespace(torque=lambda speed, gains: np.full(np.shape(speed), torque))
    assert not quasi_steady(table, constant).recovers([], stalled)


def test_an_excessive_gain_is_not_running(table):
    assert not quasi_steady(table, QuadraticFeedback()).operate([500.0]).running
