"""Tracking in a whole run: as good as open loop in a slow flow, its loop judged, and resumed."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.dynamics.tracking import Tracking

TORQUE = "control={law: tracking, torque_limit: 700}"


@pytest.fixture(scope="module")
def solved(solve):
    return solve("sine_limited_oloc", TORQUE)


def checks(solution):
    return {check.name: check for check in solution.summary.checks}


def test_torque_limit_costs_what_it_costs_open_loop(solve, solved):
    best = solve("sine_limited_oloc")
    assert solved.success, solved.summary.message
    assert solved.summary.energy_J == pytest.approx(best.summary.energy_J, rel=1e-4)
    assert solved.summary.control_torque_max_Nm < 700.0
    assert len(solved.summary.gain) == len(solved.summary.gain_units) == 10


def test_closed_loop_is_judged(solved):
    check = checks(solved)["closed_loop"]
    assert check.passed
    assert check.value < -1.0  # 1/s: the slowest eigenvalue is about that of the integral part


def test_an_unstable_loop_is_refused(solve_physics):
    """Underspeed needs a proportional part: with one of a tenth the judge sees the growth."""
    data = {
        "inflow": {"profile": "sine"},
        "control": {"law": "tracking", "torque_limit": 700},
        "design": {"blade": "fixed"},
    }
    found = solve_physics(data)
    assert found.checks()["closed_loop"].passed
    flight, law = found.flights[0], found.physics.law
    gains = flight.controller.gains.copy()
    gains[-2] *= -1.0  # pushes the rotor away from its schedule
    wrong = replace(flight, controller=replace(flight.controller, gains=gains))
    assert isinstance(law, Tracking)
    refused = replace(found, flights=(wrong,)).checks()["closed_loop"]
    assert not refused.passed
    assert refused.value > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("branch", "gains"),
    [
        ("overspeed", "torque_limit: 700"),
        ("underspeed", "knots: 12, proportional_gain: 300, integral_gain: 6000"),
    ],
)
def test_power_limit_is_kept_on_either_branch(solve, branch, gains):
    """Within half a per cent of open loop; underspeed is what no law of the speed alone can."""
    control = f"control={{law: tracking, {gains}}}"
    power = "limits.power=5 kW", f"start.branch={branch}"
    found, best = solve("sine_oloc", control, *power), solve("sine_oloc", *power)
    assert found.success, found.summary.message
    assert found.summary.simulated_energy_J == pytest.approx(
        best.summary.simulated_energy_J, rel=5e-3
    )
    nodes = found.trajectory
    fast = nodes["inflow_speed_m_s"] > 1.6
    along = np.corrcoef(nodes["inflow_speed_m_s"][fast], nodes["rotor_speed_rad_s"][fast])[0, 1]
    assert along > 0.9 if branch == "overspeed" else along < -0.5
