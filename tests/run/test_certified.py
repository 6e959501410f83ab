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


def _model(law, limit, **sections):
    control = {"law": law, "torque_limit": limit}
    return physics(load_case({"inflow": {"profile": "sine"}, "control": control} | sections))


EVEN = np.linspace(0.0, 60.0, 61)  # edges of a mesh, s


def _certified(model):
    optimum = model.rotor.best_of_shape(model.shape, model.blade)
    bound = energy_bound(model, optimum)
    return optimum, bound, certified_energy(model, optimum, bound)


def _simulated(model, blade, torque, speed):
    """Return the energy that a blade captures from a starting speed under torque(time, speed)."""
    parameters = model.rotor.mass_and_inertia(blade)[1], model.density, bem.rotor_coefficients
    plant = Plant(blade, model.rotor.polar, *parameters)
    return simulate(plant, model.inflow, torque, speed, np.linspace(0.0, 60.0, 601), 1.0).energy


def _certificate(model, optimum, inertia, edges=EVEN):
    parameters = model.density, model.blade.rotor_radius, model.case.generator.friction
    best = *_best_power(model, optimum), (inertia, inertia)
    return Certificate(*best, model.inflow, edges, *parameters)


# Theory


def test_a_torque_of_the_generator_counts_as_the_rotor_feels_it():
    """500 N m demanded are 700 N m on the rotor where the torque constant is 1.4 times as large."""
    worn = _model("quadratic", 500.0, condition={"torque_constant": 1.4})
    assert _certified(worn)[2] == pytest.approx(_certified(_model("quadratic", 700.0))[2], rel=1e-6)


@pytest.mark.parametrize("law", ["open_loop", "quadratic"])
def test_without_a_limit_it_is_the_quasi_steady_bound(law):
    _, bound, certified = _certified(_model(law, None))
    assert certified == bound


def test_quadratic_feedback_without_a_limit_leaves_no_duality_gap():
    model = _model("quadratic", None)
    optimum, bound, _ = _certified(model)
    inertia = model.rotor.mass_and_inertia(model.blade)[1]
    energy = _certificate(model, optimum, inertia).of_law(QuadraticFeedback())
    assert energy == pytest.approx(bound, rel=2e-5)


def test_edges_beside_the_ends_of_the_mesh_change_nothing():
    model = _model("quadratic", 700.0)
    args = model, _certified(model)[0], model.rotor.mass_and_inertia(model.blade)[1]
    edges = np.r_[0.0, 0.001, 0.05, 1.0:61.0]
    bounds = [each.of_limit(700.0) for each in (_certificate(*args), _certificate(*args, edges))]
    assert bounds[1] == pytest.approx(bounds[0], rel=1e-6)


@pytest.mark.parametrize("law", ["linear", "quadratic"])
def test_no_design_and_gain_captures_more(law):
    model = _model(law, 700.0)
    optimum, bound, certified = _certified(model)
    assert certified < bound
    rng, best = np.random.default_rng(3), optimum.blade
    gain = {"linear": 70.0, "quadratic": 7.2}[law]
    for _ in range(12):
        chord = best.chord * rng.uniform(0.8, 2.0)
        blade = best.with_shape(chord, best.twist + rng.uniform(-0.04, 0.04))
        gains = np.array([gain * rng.uniform(0.7, 1.4)])
        simulated = _simulated(model, blade, lambda _, w, k=gains: model.law.torque(w, k), 8.0)
        assert simulated <= certified


def test_no_torque_history_captures_more():
    model = _model("open_loop", 700.0)
    optimum, _, certified = _certified(model)
    rng = np.random.default_rng(4)
    for _ in range(12):
        level, swing, rate = rng.uniform([500.0, 0.0, 0.2], [700.0, 80.0, 2.0])

        def torque(time, speed, level=level, swing=swing, rate=rate):
            wanted = level + swing * np.sin(rate * time) + 150.0 * (speed - 8.0)
            return np.clip(wanted, 0.0, 700.0)

        assert _simulated(model, optimum.blade, torque, 8.0) <= certified


def test_a_heavy_rotor_stores_more_than_a_light_one_can_capture_but_not_more_than_its_own_bound():
    model = _model("open_loop", 300.0, rotor={"hub_inertia": 2e4}, design={"blade": "fixed"})
    optimum, bound, certified = _certified(model)
    decoupled = _certificate(model, optimum, 0.0).of_limit(300.0)
    simulated = _simulated(model, model.blade, lambda _, w: 300.0 + 0.0 * w, 5.0)
    assert decoupled < simulated <= certified <= bound


def test_local_reynolds_numbers_and_a_designed_radius_have_none():
    assert _certified(_model("linear", None, design={"radius_bounds": [1.2, 1.6]}))[2] is None
