"""What one per cent more of a limit gives, held to optimizing again."""

import numpy as np
import pytest

from tests.conftest import NINE

CASE = "sine_limited_oloc"
FEW = "phase={duration: 26, segments: 13}", f"rotor.stations={NINE}"


def price(solution, name):
    return solution.summary.limits[name].shadow_price


@pytest.mark.slow
@pytest.mark.parametrize("law", ["open_loop", "linear", "quadratic"])
def test_torque(solve, law):
    control = "control={{law: {}, torque_limit: {}}}"
    first, more = (solve(CASE, control.format(law, limit)) for limit in (700.0, 707.0))
    gained = more.summary.energy_J - first.summary.energy_J
    assert price(first, "control_torque") == pytest.approx(gained, rel=0.1)
    assert gained > 50.0


@pytest.mark.slow
def test_optimizers_agree(solve):
    ipopt, slsqp = (
        price(solve(CASE, "control.law=quadratic", f"driver.optimizer={name}"), "control_torque")
        for name in ("IPOPT", "SLSQP")
    )
    assert slsqp == pytest.approx(ipopt, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "bound", "larger"), [("thrust", "6 kN", "6.06 kN"), ("power", "5 kW", "5.05 kW")]
)
def test_others(solve, name, bound, larger, monkeypatch):
    monkeypatch.setattr("hkt_mdo.solve.multipliers.FULL", 1.0)  # as with many segments
    first, more = (solve(CASE, *FEW, f"limits.{name}={each}") for each in (bound, larger))
    gained = more.summary.energy_J - first.summary.energy_J
    assert price(first, name) == pytest.approx(gained, rel=0.1)
    assert first.summary.limits[name].binding


@pytest.mark.slow
def test_share_of_time(solve):
    entry = solve(CASE, *FEW, "limits.power=5 kW").summary.limits["power"]
    time = np.linspace(0.0, 26.0, 26001)
    # the flow in which the rotor reaches 5 kW is between 1.51 and 1.52 m/s
    low, high = (np.mean(1.5 + 0.2 * np.sin(0.25 * time) > each) for each in (1.52, 1.51))
    assert low < entry.share_of_time < high


def test_without_binding_it_is_zero(solve):
    entry = solve("sine_quadratic", "control.torque_limit=1200").summary.limits["control_torque"]
    assert not entry.binding
    assert entry.share_of_time == 0.0
    assert abs(entry.shadow_price) < 1e-3
