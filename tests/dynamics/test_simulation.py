"""The independent integration: closed forms, energy balance, convergence and standstill."""

import numpy as np
import pytest

from hkt_mdo.dynamics.controllers import QuadraticLaw
from hkt_mdo.dynamics.inflow import ConstantInflow, SineInflow
from hkt_mdo.dynamics.simulation import Plant, RecordedTorque, simulate
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.bem import Coefficients
from hkt_mdo.rotor.steady_optimum import best_operation

DENSITY = 1000.0


@pytest.fixture(scope="module")
def plant(blade, polar):
    return Plant(blade, polar, 4.0, DENSITY, bem.rotor_coefficients)


def constant_torque_coefficient(value):
    def coefficients(blade, polar, ratio, derivatives=False):
        empty = np.empty(0)
        return Coefficients(np.full(ratio.shape, value), ratio * value, *[empty] * 6)

    return coefficients


def test_speed_under_constant_torques_is_a_straight_line(blade, polar):
    """With Q and u constant, w = w0 + (Q - u) t / I and the energies are parabolas."""
    coefficient, control, inertia, duration = 0.05, 300.0, 40.0, 5.0
    plant = Plant(blade, polar, inertia, DENSITY, constant_torque_coefficient(coefficient))
    torque = 0.5 * DENSITY * 1.5**2 * np.pi * 1.4**3 * coefficient
    run = simulate(plant, ConstantInflow(1.5), lambda t, w: control, 6.0, duration)
    rate = (torque - control) / inertia
    np.testing.assert_allclose(run.rotor_speed, 6.0 + rate * run.time, rtol=1e-8)
    angle = 6.0 * duration + 0.5 * rate * duration**2
    assert run.energy == pytest.approx(torque * angle, rel=1e-8)
    assert run.generator_energy == pytest.approx(control * angle, rel=1e-8)


def test_a_rotor_in_equilibrium_stays_there(plant):
    """K2 = 0.5 rho pi R^5 Cp / tsr^3 holds the optimum in steady flow (docs/theory.md)."""
    optimum = best_operation(plant.blade, plant.polar)
    gain = 0.5 * DENSITY * np.pi * 1.4**5 * optimum.power_coefficient / optimum.tip_speed_ratio**3
    speed = optimum.tip_speed_ratio * 1.5 / 1.4
    law = QuadraticLaw()
    run = simulate(plant, ConstantInflow(1.5), lambda t, w: law.torque(w, [gain]), speed, 20.0)
    np.testing.assert_allclose(run.rotor_speed, speed, rtol=1e-7)
    power = 0.5 * DENSITY * np.pi * 1.4**2 * 1.5**3 * optimum.power_coefficient
    assert run.energy == pytest.approx(20.0 * power, rel=1e-7)


@pytest.fixture(scope="module")
def closed_loop(plant):
    law = QuadraticLaw(700.0)

    def run(tolerance):
        return simulate(
            plant,
            SineInflow(1.5, 0.2, 0.25),
            lambda t, w: law.torque(w, [20.0]),
            6.5,
            30.0,
            tolerance=tolerance,
        )

    return run


def test_energy_balance_closes(closed_loop):
    """The integral of (Q - u) w is the change of kinetic energy."""
    run = closed_loop(1e-9)
    assert run.energy - run.generator_energy == pytest.approx(
        run.kinetic_energy_change, abs=1e-6 * run.energy
    )


def test_tolerance_does_not_decide_the_energy(closed_loop):
    assert closed_loop(1e-9).energy == pytest.approx(closed_loop(1e-11).energy, rel=1e-6)


def test_a_rotor_that_is_braked_too_hard_stops(plant):
    run = simulate(plant, ConstantInflow(1.5), lambda t, w: 5000.0, 6.0, 20.0)
    assert run.stopped_at is not None
    assert 0.0 < run.stopped_at < 1.0
    assert run.time[-1] == run.stopped_at


def test_recorded_torque_is_the_segments_own_polynomial():
    """Three nodes a segment reproduce parabolas, a different one in each segment."""
    time = np.array([0.0, 1.0, 2.0, 2.0, 3.0, 4.0])
    torque = np.array([0.0, 1.0, 4.0, 4.0, 9.0, 16.0])
    recorded = RecordedTorque(time, torque, 2)
    dense = np.linspace(0.0, 4.0, 41)
    np.testing.assert_allclose(recorded(dense), dense**2, atol=1e-13)
    assert recorded(2.5) == pytest.approx(6.25)


def test_recorded_torque_stays_in_the_generators_range():
    time = np.array([0.0, 1.0, 2.0])
    recorded = RecordedTorque(time, np.array([500.0, 700.0, 700.0]), 1, limit=700.0)
    dense = np.linspace(0.0, 2.0, 101)
    assert np.max(recorded.unlimited(dense)) > 700.0
    assert np.max(recorded(dense)) == 700.0
