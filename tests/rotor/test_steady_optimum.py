"""The best blade in steady flow: Glauert's without drag and losses, and none better."""

import numpy as np
import pytest

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import PolarFamily
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.polars import ByStation
from hkt_mdo.rotor.steady_optimum import _newton_step, best_blade, best_operation, best_rotor

BOUNDS = {"chord": (0.01, 1.0), "twist": (np.deg2rad(-30.0), np.deg2rad(30.0))}


# Theory


def test_without_drag_and_losses_the_best_angles_are_glauerts(ideal_polar):
    """Glauert's optimum with rotating wake has phi = 2/3 arctan(1 / lambda_r)."""
    r = np.linspace(0.3, 0.9, 7)
    start = Blade(r, np.full(7, 1e-3), np.zeros(7), 0.1, 1.0, 3000)
    bounds = {"chord": (1e-6, 1e-3), "twist": (-0.3, 0.9)}
    optimum = best_blade(start, ideal_polar, 5.0, bounds)
    phi = bem.sections(optimum.blade, ideal_polar, 5.0).inflow_angle[0]
    assert np.allclose(phi, 2.0 / 3.0 * np.arctan(1.0 / (5.0 * r)), atol=2e-4)  # a flat optimum


@pytest.mark.parametrize("twists", [BOUNDS["twist"], (0.05, 0.2)])
def test_no_tip_speed_ratio_is_better(twists, blade, polar):
    """With few twists to choose from, the power has several peaks over the tip speed ratio."""
    best = best_rotor(blade, polar, BOUNDS | {"twist": twists})
    for ratio in np.linspace(4.0, 9.0, 11):
        optimum = best_blade(blade, polar, ratio, BOUNDS | {"twist": twists})
        assert optimum.power_coefficient <= best.power_coefficient + 1e-9


def test_a_cylindrical_root_does_not_stop_the_search(blade, polar):
    """The best load of its stations is negative; the others reach their own optimum."""
    polars = [PolarFamily.from_file("cylinder").polars[0]] * 2 + [polar] * (blade.r.size - 2)
    polars = ByStation.of(polars)
    free, mixed = (best_blade(blade, each, 7.0, BOUNDS).blade for each in (polar, polars))
    load = [bem.sections(each, polar, 7.0).tangential_load[0, 2:] for each in (free, mixed)]
    np.testing.assert_allclose(load[1], load[0], rtol=1e-6)


def test_one_blade_works_best_at_the_peak_of_its_curve(blade, polar):
    optimum = best_operation(blade, polar)
    sweep = bem.rotor_coefficients(blade, polar, np.linspace(4.0, 12.0, 801)).power
    assert optimum.power_coefficient >= sweep.max() - 1e-9


def test_a_station_stays_at_a_bound_only_where_it_would_go_beyond():
    """Two variables of two stations, both at their upper bound: f = a.x - |x|^2 / 2."""
    slope = np.array([[1.0, -1.0], [-0.5, 0.5]])
    bend, room = -np.repeat(np.eye(2)[:, :, None], 2, axis=2), np.zeros((2, 2, 2))
    room[0] = -4.0
    step = _newton_step(slope, bend, room, np.full(2, 4.0))
    np.testing.assert_allclose(step, np.minimum(slope, 0.0))
