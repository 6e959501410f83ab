"""The best section at a station: no chord and twist within the bounds has a larger load."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.best_section import best_sections
from hkt_mdo.rotor.steady_optimum import best_rotor

STEADY = {"inflow": {"profile": "constant", "speed": 2.0}, "control": {"law": "quadratic"}}
DEGREES = np.pi / 180.0


@pytest.fixture(scope="module", params=["bahaj2007", "rm1", "river"])
def shipped(request):
    model = physics(load_case(STEADY | {"rotor": {"blade": request.param}}))
    return model.blade, model.rotor.polar


# Theory


def test_without_a_binding_bound_every_angle_of_attack_has_the_best_lift_to_drag(blade, polar):
    sections = best_sections(blade, polar, 7.0, {"chord": (1e-4, 10.0), "twist": (-3.0, 3.0)})
    phi = bem.sections(blade.with_shape(*sections[1:, 0]), polar, 7.0).inflow_angle[0]
    alpha = np.linspace(-0.1, 0.3, 40001)
    lift, drag = polar.evaluate(alpha)
    np.testing.assert_allclose(phi - sections[2, 0], alpha[np.argmax(lift / drag)], atol=1e-4)


@pytest.mark.parametrize("chords", [(0.01, 1.0), (0.3, 2.5), (0.1, 0.101)])
@pytest.mark.parametrize("twists", [(-30.0, 30.0), (3.0, 12.0)])
def test_no_section_of_a_grid_is_better(shipped, chords, twists):
    blade, polar = shipped
    ratios, twists = np.array([1.5, 4.0, 7.0, 11.0, 16.0]), np.array(twists) * DEGREES
    sections = best_sections(blade, polar, ratios, {"chord": chords, "twist": twists})
    chord, twist = (
        grid.ravel() for grid in np.meshgrid(np.geomspace(*chords, 25), np.linspace(*twists, 97))
    )
    for j in range(0, blade.r.size, 4):
        strip = replace(blade, r=np.full(chord.size, blade.r[j]), chord=chord, twist=twist)
        load = bem.sections(strip, polar.at_station(j), ratios).tangential_load
        assert np.all(load.max(axis=1) <= sections[0, :, j] + 1e-12)
        best = replace(blade, r=blade.r[[j] * 5], chord=sections[1, :, j], twist=sections[2, :, j])
        reached = bem.sections(best, polar.at_station(j), ratios).tangential_load.diagonal()
        chosen = reached > sections[0, :, j] - 1e-9  # else BEM takes another root
        assert np.all(chosen[1:])


def test_the_bound_of_a_blade_with_a_cylindrical_root_is_the_sum_of_its_best_sections():
    """A local search that took its scale from negative loads stopped 0.13 % below."""
    turbine = {"rotor": {"blade": "rm1"}, "design": {"chord_points": 100, "twist_points": 100}}
    model = physics(load_case(STEADY | turbine))
    best = best_rotor(model.blade, model.rotor.polar, model.shape.bounds)
    for ratio in np.append(np.linspace(5.0, 15.0, 11), best.tip_speed_ratio):
        load = best_sections(model.blade, model.rotor.polar, ratio, model.shape.bounds)[0, 0]
        power = ratio * bem.torque_weights(model.blade) @ load
        assert power <= best.power_coefficient + 1e-9
    assert power == pytest.approx(best.power_coefficient, abs=1e-12)
