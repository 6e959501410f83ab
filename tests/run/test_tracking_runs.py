"""Tracking in a whole run: as good as open loop in a slow flow, its loop checked, and resumed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import NINE

TRACKING = "control={law: tracking, torque_limit: 700}"
SHORT = "phase={duration: 26, segments: 26}", f"rotor.stations={NINE}"  # one period


@pytest.mark.slow
def test_torque_limit_costs_what_it_costs_open_loop(solve):
    best, solved = solve("sine_limited_oloc"), solve("sine_limited_oloc", TRACKING)
    assert solved.success, solved.summary.message
    assert solved.summary.energy_J == pytest.approx(best.summary.energy_J, rel=1e-4)
    assert solved.summary.control_torque_max_Nm < 700.0
    assert len(solved.summary.gain) == len(solved.summary.gain_units) == 10
    (check,) = (each for each in solved.summary.checks if each.name == "closed_loop")
    assert check.value < -1.0  # 1/s: the slowest eigenvalue is about that of the integral part


def test_an_unstable_loop_is_refused(solve_physics):
    """Underspeed needs a proportional part: with one of a tenth the check sees the growth."""
    control = {"law": "tracking", "torque_limit": 700}
    solved = solve_physics({"inflow": "sine", "control": control, "design": {"blade": "fixed"}})
    assert solved.by_name["closed_loop"].passed
    controller = solved.verification.controller
    gains = controller.gains.copy()
    gains[-2] *= -1.0  # pushes the rotor away from its schedule
    wrong = replace(solved.verification, controller=replace(controller, gains=gains))
    refused = replace(solved, verifications=(wrong,)).by_name["closed_loop"]
    assert not refused.passed
    assert refused.value > 0.0


def energy(solution):
    assert solution.success, solution.summary.message
    return solution.summary.simulated_energy_J


def along(solution):
    """Return the correlation of the rotor's speed with the flow's, where that is fast."""
    nodes = solution.trajectory
    fast = nodes["inflow_speed_m_s"] > 1.6
    return np.corrcoef(nodes["inflow_speed_m_s"][fast], nodes["rotor_speed_rad_s"][fast])[0, 1]


@pytest.mark.slow
def test_power_limit_is_kept_by_overspeed(solve):
    """No better than open loop, and no worse than the same law on open loop's own blade.

    There are several optima, 0.2 and 0.6 % below open loop, and the BLAS kernel decides which one
    is found. That with open loop's blade is the same with all of them, and one of the designs here.
    """
    power = "limits.power=5 kW", "start.branch=overspeed", *SHORT
    best, solution = solve("sine_oloc", *power), solve("sine_oloc", TRACKING, *power)
    chord, twist = (best.blade[name].tolist() for name in ("chord_m", "twist_deg"))
    fixed = f"rotor.chord={chord}", f"rotor.twist={twist}", "design.blade=fixed"
    same_blade = solve("sine_oloc", TRACKING, *power, *fixed)
    assert energy(same_blade) * (1.0 - 1e-5) <= energy(solution) <= energy(best) * (1.0 + 1e-5)
    assert np.max(solution.simulation["generator_power_W"]) <= 5e3 * 1.001
    assert along(solution) > 0.9


@pytest.mark.slow
def test_power_limit_is_kept_by_underspeed(solve):
    """Within half a per cent of open loop, which no law of the speed alone can."""
    tracking = "control={law: tracking, knots: 12, proportional_gain: 300, integral_gain: 6000}"
    power = "limits.power=5 kW", "start.branch=underspeed", *SHORT
    solution, best = solve("sine_oloc", tracking, *power), solve("sine_oloc", *power)
    assert energy(solution) == pytest.approx(energy(best), rel=5e-3)
    assert along(solution) < -0.5
