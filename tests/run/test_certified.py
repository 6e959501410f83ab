"""The certificate: no design and no operation within the case's bounds captures more."""

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.certificate import Certificate
from hkt_mdo.dynamics.laws import QuadraticFeedback
from hkt_mdo.dynamics.simulation import Plant, simulate
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor import bem
from hkt_mdo.run.certified import _best_power, certified_energy
from hkt_mdo.run.checks import energy_bound


def _world(law, limit, **sections):
    control = {"law": law, "torque_limit": limit}
    return physics(load_case({"inflow": {"profile": "sine"}, "control": control} | sections))


EVEN = np.linspace(0.0, 60.0, 61)  # edges of a mesh, s


def _certified(world):
    optimum = world.rotor.best_of_shape(world.shape, world.blade)
    bound = energy_bound(world, optimum)
    return optimum, bound, certified_energy(world, optimum, bound)


def _simulated(world, blade, torque, speed):
    """Return the energy that a blade captures from a starting speed under torque(time, speed)."""
    about = world.rotor.mass_and_inertia(blade)[1], world.density, bem.rotor_coefficients
    plant = Plant(blade, world.rotor.polar, *about)
    return simulate(plant, world.inflow, torque, speed, np.linspace(0.0, 60.0, 601), 1.0).energy


def _certificate(world, optimum, inertia, edges=EVEN):
    about = world.density, world.blade.rotor_radius, world.case.generator.friction
    best = *_best_power(world, optimum), (inertia, inertia)
    return Certificate(*best, world.inflow, edges, *about)


# Theory


def test_a_torque_of_the_generator_counts_as_the_rotor_feels_it():
    """500 N m demanded are 700 N m on the rotor where the torque constant is 1.4 times as large."""
    worn = _world("quadratic", 500.0, condition={"torque_constant": 1.4})
    assert _certified(worn)[2] == pytest.approx(_certified(_world("quadratic", 700.0))[2], rel=1e-6)


@pytest.mark.parametrize("law", ["open_loop", "quadratic"])
def test_without_a_limit_it_is_the_quasi_steady_bound(law):
    _, bound, certified = _certified(_world(law, None))
    assert certified == bound


def test_quadratic_feedback_without_a_limit_leaves_no_duality_gap():
    world = _world("quadratic", None)
    optimum, bound, _ = _certified(world)
    inertia = world.rotor.mass_and_inertia(world.blade)[1]
    found = _certificate(world, optimum, inertia).of_law(QuadraticFeedback())
    assert found == pytest.approx(bound, rel=2e-5)


def test_edges_beside_the_ends_of_the_mesh_change_nothing():
    world = _world("quadratic", 700.0)
    own = world, _certified(world)[0], world.rotor.mass_and_inertia(world.blade)[1]
    edges = np.r_[0.0, 0.001, 0.05, 1.0:61.0]
    bounds = [each.of_limit(700.0) for each in (_certificate(*own), _certificate(*own, edges))]
    assert bounds[1] == pytest.approx(bounds[0], rel=1e-6)


@pytest.mark.parametrize("law", ["linear", "quadratic"])
def test_no_design_and_gain_captures_more(law):
    world = _world(law, 700.0)
    optimum, bound, certified = _certified(world)
    assert certified < bound
    rng, best = np.random.default_rng(3), optimum.blade
    gain = {"linear": 70.0, "quadratic": 7.2}[law]
    for _ in range(12):
        chord = best.chord * rng.uniform(0.8, 2.0)
        blade = best.with_shape(chord, best.twist + rng.uniform(-0.04, 0.04))
        gains = np.array([gain * rng.uniform(0.7, 1.4)])
        simulated = _simulated(world, blade, lambda _, w, k=gains: world.law.torque(w, k), 8.0)
        assert simulated <= certified


def test_no_torque_history_captures_more():
    world = _world("open_loop", 700.0)
    optimum, _, certified = _certified(world)
    rng = np.random.default_rng(4)
    for _ in range(12):
        level, swing, rate = rng.uniform([500.0, 0.0, 0.2], [700.0, 80.0, 2.0])

        def torque(time, speed, level=level, swing=swing, rate=rate):
            wanted = level + swing * np.sin(rate * time) + 150.0 * (speed - 8.0)
            return np.clip(wanted, 0.0, 700.0)

        assert _simulated(world, optimum.blade, torque, 8.0) <= certified


def test_a_heavy_rotor_stores_more_than_a_light_one_can_capture_but_not_more_than_its_own_bound():
    world = _world("open_loop", 300.0, rotor={"hub_inertia": 2e4}, design={"blade": "fixed"})
    optimum, bound, certified = _certified(world)
    decoupled = _certificate(world, optimum, 0.0).of_limit(300.0)
    simulated = _simulated(world, world.blade, lambda _, w: 300.0 + 0.0 * w, 5.0)
    assert decoupled < simulated <= certified <= bound


def test_local_reynolds_numbers_and_a_designed_radius_have_none():
    assert _certified(_world("linear", None, design={"radius_bounds": [1.2, 1.6]}))[2] is None
