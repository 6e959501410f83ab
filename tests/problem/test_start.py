"""The start by quasi-steady co-design reaches what theory knows."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.dynamics.laws import LinearFeedback, QuadraticFeedback
from hkt_mdo.dynamics.limits import SLOWED
from hkt_mdo.dynamics.quasi_steady import SAFE, QuasiSteady
from hkt_mdo.problem.start import starting_point
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.rotor.shape import Shape
from hkt_mdo.rotor.steady_optimum import best_operation, best_rotor
from hkt_mdo.rotor.torque_curve import TorqueSpline

RADIUS, DENSITY = 1.4, 1000.0
CHORDS, TWISTS = (0.01, 1.0), (-np.pi / 6.0, np.pi / 6.0)
WEIGHTS = np.full(121, 0.5)
FLOW = 1.5 + 0.2 * np.sin(0.25 * np.linspace(0.0, 60.0, 121))


def quasi_steady(law=None, limit=None):
    spline = TorqueSpline(np.linspace(2.0, 15.0, 131))
    return QuasiSteady(FLOW, WEIGHTS, DENSITY, RADIUS, spline, law, limit)


@pytest.fixture(scope="module")
def optimum(blade, polar):
    return best_rotor(blade, polar, CHORDS, TWISTS)


@pytest.mark.parametrize("law", [None, QuadraticFeedback()])
def test_co_design_reaches_the_steady_optimum(law, optimum, blade, polar):
    """Without a limit, open loop and quadratic feedback keep the best rotor at its best ratio."""
    shape = Shape.designed(blade, None, None, CHORDS, TWISTS)
    start = starting_point(quasi_steady(law), shape, None, polar, optimum, improve=True)
    power = optimum.power_coefficient * power_scale(DENSITY, RADIUS, FLOW)
    assert start.operation.energy == pytest.approx(WEIGHTS @ power, rel=5e-5)
    assert start.operation.rotor_speed.shape == FLOW.shape


def test_the_optimum_of_one_blade_is_start_enough(optimum, blade, polar):
    """The candidates are improved from any blade, not from the steady optimum alone."""
    shape, problem = Shape.designed(blade, None, None, CHORDS, TWISTS), quasi_steady(limit=700.0)
    energy = [
        starting_point(problem, shape, None, polar, each, improve=True).operation.energy
        for each in (optimum, best_operation(blade, polar))
    ]
    assert energy[1] == pytest.approx(energy[0], rel=1e-5)


def test_a_fixed_blade_is_kept(blade, polar):
    best = best_operation(blade, polar)
    start = starting_point(
        quasi_steady(QuadraticFeedback()), Shape.fixed(blade), None, polar, best, improve=True
    )
    np.testing.assert_array_equal(start.blade.chord, blade.chord)
    gain = 0.5 * DENSITY * np.pi * RADIUS**5 * best.power_coefficient / best.tip_speed_ratio**3
    assert start.gains[0] == pytest.approx(gain, rel=0.02)


@pytest.mark.parametrize("bounds", [(0.0, 1.0), (30.0, 40.0)])
def test_gains_are_searched_within_their_bounds(bounds, optimum, blade, polar):
    """Whatever the bounds, the start keeps them and is worth what its own gain gives."""
    shape, problem = (
        Shape.designed(blade, None, None, CHORDS, TWISTS),
        quasi_steady(QuadraticFeedback(torque_limit=700.0)),
    )
    free, bound = (
        starting_point(problem, shape, None, polar, optimum, improve=True, **given)
        for given in ({}, {"gain_bounds": bounds})
    )
    assert not bounds[0] <= free.gains[0] <= bounds[1]
    assert bounds[0] <= bound.gains[0] <= bounds[1]
    assert bound.operation.running
    assert bound.operation.energy < free.operation.energy


def test_more_distance_from_stall_costs_energy(optimum, blade, polar):
    """A start that must be able to lose more of its speed keeps that, and captures less."""
    shape = Shape.designed(blade, None, None, CHORDS, TWISTS)
    law = LinearFeedback(torque_limit=700.0)
    near, far = (
        starting_point(
            replace(quasi_steady(law), slowed=slowed), shape, None, polar, optimum, improve=True
        ).operation
        for slowed in (SLOWED, 5.0 * SLOWED)
    )
    assert min(near.margin.min(), far.margin.min()) > SAFE - 1e-5
    assert far.energy < near.energy
