"""The generator: closed forms of its losses, its table, and where a lossy rotor works best."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from hkt_mdo import InputError, load_case
from hkt_mdo.dynamics.generator import Generator
from hkt_mdo.dynamics.laws import STEP
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.start.find import find_start

LOSSY = Generator(
    rated_torque=700.0, rated_speed=9.0, copper_loss=300.0, friction_loss=50.0, iron_loss=100.0
)
TORQUE = np.array([0.0, 100.0, 350.0, 700.0])
SPEED = np.array([0.0, 3.0, 9.0, 12.0])


def table_of(tmp_path, efficiency, torques=(0, 200, 400, 700), speeds=(0, 30, 60, 90, 120)):
    rows = [f"{u},{n},{efficiency(u, n):.12g}" for u in torques for n in speeds]
    path = tmp_path / "table.csv"
    path.write_text("\n".join(["torque_Nm,speed_rpm,efficiency", *rows[::-1], ""]))
    return path


def test_losses_are_those_of_their_formulas_and_negative_power_is_drawn():
    expected = TORQUE * SPEED - 300.0 * (TORQUE / 700.0) ** 2
    expected = expected - 50.0 * (SPEED / 9.0) - 100.0 * (SPEED / 9.0) ** 2
    np.testing.assert_allclose(LOSSY.electrical_power(TORQUE, SPEED), expected, rtol=1e-14)
    assert LOSSY.electrical_power(700.0, 9.0) == pytest.approx(6300.0 - 450.0)
    assert LOSSY.electrical_power(0.0, 9.0) == pytest.approx(-150.0)


def test_a_table_is_met_at_its_nodes_and_between_them_a_plane_is_a_plane(tmp_path):
    def plane(u, n):
        return 0.7 + 1e-4 * u + 1e-3 * n

    generator = Generator(table=str(table_of(tmp_path, plane)))
    u, w = np.array([0.0, 150.0, 333.0, 700.0]), np.array([1.0, 3.3, 12.5, np.pi])
    expected = u * w * plane(u, w * 30.0 / np.pi)
    np.testing.assert_allclose(generator.electrical_power(u, w), expected, rtol=1e-12)
    assert generator.largest_efficiency == pytest.approx(0.7 + 0.07 + 0.12 + 0.05 * (0.07 + 0.12))
    assert generator.beyond_table(u, w) <= 0.0
    assert generator.beyond_table(u + 70.0, w) == pytest.approx(0.1)
    # far beyond the table the efficiency is that of 5 % beyond it
    far = generator.electrical_power(1e5, 60.0 * np.pi / 30.0) / (1e5 * 2.0 * np.pi)
    assert far == pytest.approx(plane(735.0, 60.0), rel=1e-9)
    # a generator that drives never delivers: an efficiency below zero there made that the best
    assert generator.electrical_power(-100.0, 3.0) == -300.0


def test_a_table_has_the_units_of_its_names_and_may_be_zero_at_standstill(tmp_path):
    rows = "torque_kNm,speed_rad_s,efficiency_percent\n0,0,0\n0,9,0\n0.7,0,0\n0.7,9,90\n"
    (tmp_path / "t.csv").write_text(rows)
    power = Generator(table=str(tmp_path / "t.csv")).electrical_power
    assert power(TORQUE[[0, 3, 3]], SPEED[[2, 0, 2]]) == pytest.approx([0.0, 0.0, 5670.0])


def test_between_its_points_a_table_stays_within_its_neighbours(tmp_path):
    """A spline through a steep rise would be above one: more power than the shaft has."""
    rise = {0: 0.3, 60: 0.96, 200: 0.97, 400: 0.97}
    path = table_of(tmp_path, lambda u, n: rise[u] * (0.5 if n == 60 else 1.0), torques=[*rise])
    generator, torque = Generator(table=str(path)), np.linspace(0.0, 400.0, 801)
    for speed in (30.0, 40.0, 75.0, 110.0):
        speed *= np.pi / 30.0
        efficiency = generator.electrical_power(torque, speed)[1:] / (torque[1:] * speed)
        ends = np.sort([efficiency[0], efficiency[-1]])
        assert np.all(np.diff(efficiency) > -1e-12)
        assert np.all((efficiency >= ends[0]) & (efficiency <= 0.97 + 1e-12))
    assert generator.largest_efficiency == pytest.approx(0.97)


def test_between_its_points_a_table_is_that_of_the_losses(tmp_path):
    """Natural splines with limited slopes were wrong by 2 % beside the knee of a usual table."""

    def efficiency(u, n):
        u, w = np.maximum(u, 1e-9), n * np.pi / 30.0
        losses = 25.0 + 6.0 * w + 250.0 * (u / 600.0) ** 2 + 0.02 * u * w
        return np.maximum(1.0 - losses / (u * w), 0.0)

    torques, speeds = (0, 100, 200, 400, 600, 900, 1300), (10, 30, 60, 90, 130)
    generator = Generator(table=str(table_of(tmp_path, efficiency, torques, speeds)))
    u, n = np.meshgrid(np.linspace(250.0, 1000.0, 40), np.linspace(32.0, 120.0, 40))
    power = generator.electrical_power(u, n * np.pi / 30.0)
    error = power / (u * n * np.pi / 30.0) - efficiency(u, n)
    assert np.max(np.abs(error)) < 0.008


def test_a_table_of_a_fast_shaft_is_refused(tmp_path):
    """A rotor of 0.8 m in 1 to 2 m/s turns at tip speed ratios of 0.5 to 15: 0.6 to 38 rad/s."""
    Generator(table=str(table_of(tmp_path, lambda u, n: 0.9))).check(0.8, 1.0, 2.0)
    path = table_of(tmp_path, lambda u, n: 0.9, speeds=(1000, 2000, 3000))
    with pytest.raises(InputError, match=r"has speeds from 104\.7 .* turns at 0\.625 to 37\.5"):
        Generator(table=str(path)).check(0.8, 1.0, 2.0)


@pytest.mark.parametrize("kind", ["losses", "table", "efficiency"])
def test_derivatives_by_complex_step(kind, tmp_path):
    path = table_of(tmp_path, lambda u, n: 0.9 - 0.3 * np.exp(-u / 150) - 1e-3 * n)
    generator = {
        "losses": LOSSY,
        "table": Generator(table=str(path)),
        "efficiency": Generator(efficiency=0.9),
    }[kind]  # fmt: skip
    u, w = np.array([150.0, 500.0, 720.0, 900.0]), np.array([2.0, 7.0, 11.0, 13.0])
    for step in ((1.0, 0.0), (0.0, 1e-2)):
        h = 1e-4
        exact = generator.electrical_power(u + 1j * STEP * step[0], w + 1j * STEP * step[1])
        difference = generator.electrical_power(u + h * step[0], w + h * step[1])
        difference = difference - generator.electrical_power(u - h * step[0], w - h * step[1])
        np.testing.assert_allclose(exact.imag / STEP, difference / (2.0 * h), rtol=1e-6)


# Where a rotor works best -------------------------------------------------------------------------


def test_copper_losses_move_the_best_tip_speed_ratio_up():
    """Less torque at more speed: each flow against a search over the tip speed ratio."""
    fixed = {"inflow": "sine", "control": "open_loop", "design": {"blade": "fixed"}}
    losses = {"generator": {"rated_torque": 700.0, "copper_loss": 500.0}}
    fixed["objective"] = "electrical"
    plain, lossy = (physics(load_case(fixed | more)) for more in ({}, losses))
    best = plain.rotor.best_operation(plain.blade)
    starts = [find_start(each, best, improve=False) for each in (plain, lossy)]
    flow, _ = plain.sampled_flow
    radius = plain.blade.rotor_radius
    ratios = [each.operation.rotor_speed * radius / flow for each in starts]
    np.testing.assert_allclose(ratios[0], best.tip_speed_ratio, rtol=1e-3)
    assert np.all(ratios[1] > 1.02 * ratios[0])
    for index in (0, 5, 17):

        def lost(ratio, index=index):
            torque = plain.rotor.coefficients(plain.blade, np.array([ratio])).torque[0]
            torque *= torque_scale(plain.density, radius, flow[index])
            return -lossy.case.generator.electrical_power(torque, ratio * flow[index] / radius)

        expected = minimize_scalar(lost, bounds=(4.0, 12.0), method="bounded")
        assert -lost(ratios[1][index]) == pytest.approx(-expected.fun, rel=1e-6)
        assert -lost(ratios[0][index]) < -expected.fun
