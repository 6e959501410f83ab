"""Laws for the whole range of the flow: their closed forms, and how near open loop they come."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from hkt_mdo.dynamics.formulas import slope
from hkt_mdo.dynamics.generator import Generator
from hkt_mdo.dynamics.laws import LinearFeedback, QuadraticFeedback
from hkt_mdo.dynamics.rotor_ode import FeedbackComp
from hkt_mdo.dynamics.simulation import Plant, by_curve
from hkt_mdo.dynamics.wide_laws import (
    BEND,
    STEEPEST,
    STILL,
    CurveFeedback,
    PowerLawFeedback,
    RatedFeedback,
)
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.polars import Polars
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.start.steady_flow import QuasiSteady
from tests.conftest import checked

SPEED = np.linspace(0.5, 16.0, 40)
KNOTS = np.array([4.0, 6.0, 7.0, 9.0, 12.0])
TORQUES = np.array([150.0, 330.0, 400.0, 300.0, 250.0])
POWER = PowerLawFeedback(), [30.0, 1.4]
RATED = RatedFeedback(smoothing=1e-6), [7.0, 4000.0]
CURVE = CurveFeedback(knots=5), [*KNOTS, *TORQUES]

TIME = np.linspace(0.0, 60.0, 241)
FLOW = 1.5 + 0.5 * np.sin(0.25 * TIME)
LOSSES = Generator(rated_torque=600.0, copper_loss=900.0)
SPLINE = TorqueSpline(np.linspace(2.0, 18.0, 161))


def quasi_steady(table, law):
    weights = np.full(TIME.size, TIME[1])
    weights[[0, -1]] *= 0.5
    blade = SimpleNamespace(rotor_radius=1.4)
    plant = Plant(blade, Polars(), 0.0, 1000.0, by_curve(SPLINE.curve(table)))
    return QuasiSteady(plant, law, FLOW, weights)


@pytest.fixture(scope="module")
def table(blade, polar):
    return bem.rotor_coefficients(blade, polar, SPLINE.nodes).torque


@pytest.mark.parametrize(
    ("law", "gains"),
    [
        (LinearFeedback(), [50.0]),
        (QuadraticFeedback(torque_limit=500.0), [7.0]),
        (PowerLawFeedback(), [7.0, 1.7]),
        (PowerLawFeedback(torque_limit=500.0), [300.0, -2.0]),
        (RatedFeedback(), [7.0, 3600.0]),
        (CurveFeedback(knots=5, torque_limit=500.0), [*KNOTS, *TORQUES]),
    ],
    ids=lambda value: getattr(value, "law", ""),
)
def test_a_law_has_a_torque_where_the_rotor_stands_or_turns_back(law, gains):
    """Collocation interpolates such speeds between nodes that are far apart."""
    speed, gains = np.array([-45.9, -1e-9, 0.0, STILL, 2.0 * STILL]), np.array(gains)
    torque = law.torque(speed, gains)
    assert np.all(np.isfinite(torque))
    inputs = {"speed": speed, "gains": gains}
    slopes = [slope(law.torque, inputs, name, diagonal=name == "speed") for name in inputs]
    assert np.all(np.isfinite(np.column_stack(slopes)))
    if isinstance(law, PowerLawFeedback | CurveFeedback):
        assert np.all(torque[:4] == torque[3])
        assert np.all(slopes[0][:3] == 0.0)


# The curve


def test_a_curve_is_a_natural_spline_of_the_logarithms():
    law = CurveFeedback(knots=5)
    spline = CubicSpline(np.log(KNOTS), np.log(TORQUES), bc_type="natural")
    inside = np.linspace(4.0, 12.0, 50)
    torque = law.torque(inside, np.append(KNOTS, TORQUES))
    np.testing.assert_allclose(torque, np.exp(spline(np.log(inside))), rtol=1e-12)
    np.testing.assert_allclose(law.torque(KNOTS, np.append(KNOTS, TORQUES)), TORQUES, rtol=1e-12)


@pytest.mark.parametrize(
    ("torques", "least"), [(TORQUES, (None, None)), ([900.0, 600.0, 500.0, 80.0, 20.0], (2, -1))]
)
def test_a_curve_goes_on_as_a_power_of_the_speed(torques, least):
    """With the spline's exponents, at least 2 in slower flow and -1 in faster, without a kink."""
    law, gains = CurveFeedback(knots=5), np.append(KNOTS, torques)
    spline = CubicSpline(np.log(KNOTS), np.log(torques), bc_type="natural")
    for end, beyond, fixed in zip((0, -1), ([0.5, 3.0], [13.5, 40.0]), least, strict=True):
        at_end = spline(np.log(KNOTS[end]), 1)
        exponent = at_end if fixed is None else fixed
        # within BEND the mean of both exponents holds
        reached = np.exp(0.5 * (at_end - exponent) * BEND * (1 if end else -1))
        expected = reached * torques[end] * (np.array(beyond) / KNOTS[end]) ** exponent
        np.testing.assert_allclose(law.torque(np.array(beyond), gains), expected, rtol=1e-11)
        speed, moves = np.geomspace(3.0, 20.0, 40), 1e-6 * np.diag(gains)
        for move in moves:  # of a gain; a knot's speed too
            change = law.torque(speed, gains + move) - law.torque(speed, gains - move)
            exact = np.imag(law.torque(speed, gains + 1e-30j * move)) / 1e-30
            np.testing.assert_allclose(exact, 0.5 * change, atol=1e-9 * np.max(torques))
        for edge in KNOTS[end] * np.array([1.0, np.exp(BEND if end else -BEND)]):
            slopes = law.slopes(edge * (1.0 + np.array([-1e-7, 1e-7])), 1.5, gains)[0, 0]
            assert slopes[0] == pytest.approx(slopes[1], rel=1e-4)


def test_neighbouring_knots_stay_within_the_steepest_exponent():
    """In a fit to a wall, and after any number of moves that are as far apart as allowed."""
    law, steepest = CurveFeedback(knots=5), STEEPEST + 1e-9
    gains = law.fit(np.array([5.0, 5.01, 6.0]), np.array([1.0, 500.0, 500.0]))
    for factor in (1.2,) * 8 + (np.inf,):
        exponents = np.diff(np.log(gains[5:])) / np.diff(np.log(gains[:5]))
        assert np.max(np.abs(exponents)) <= steepest
        gains = np.where(np.arange(10) % 2, *law.moves(gains, factor))
    exponents = np.diff(np.log(gains[5:-1])) / np.diff(np.log(gains[:4]))
    assert np.max(np.abs(exponents)) <= steepest


def test_a_schedule_that_drives_the_rotor_is_fitted_without_its_sign():
    """A torque below zero is no law's: the gains are finite all the same."""
    speed, torque = np.linspace(5.0, 9.0, 20), np.linspace(-50.0, 600.0, 20)
    for law in (PowerLawFeedback(), CurveFeedback(knots=4)):
        assert np.all(np.isfinite(law.fit(speed, torque)))


def test_a_single_speed_leaves_a_range_for_the_knots():
    gains = CurveFeedback(knots=3).fit(np.full(5, 8.0), np.full(5, 400.0))
    assert np.all(np.diff(gains[:3]) > 0.5)
    assert CurveFeedback(knots=3).torque(8.0, gains) == pytest.approx(400.0, rel=1e-9)


# Closed forms


def test_rated_feedback_is_quadratic_below_and_of_constant_power_above():
    law, gains = RatedFeedback(smoothing=1e-6), np.array([8.0, 5000.0])
    corner = (5000.0 / 8.0) ** (1.0 / 3.0)
    slow, fast = np.linspace(1.0, 0.9 * corner, 9), np.linspace(1.1 * corner, 30.0, 9)
    np.testing.assert_allclose(law.torque(slow, gains), 8.0 * slow**2, rtol=1e-5)
    np.testing.assert_allclose(law.torque(fast, gains), 5000.0 / fast, rtol=1e-5)
    worn = CurveFeedback(smoothing=1e-6).applied(1.1).simpler
    np.testing.assert_allclose(worn.torque(fast, gains), 5500.0 / fast, rtol=1e-5)


@pytest.mark.parametrize("limit", [None, 400.0])
def test_rated_feedback_in_steady_flow_meets_its_corners(table, limit):
    """K w^2 = Q in slow flow; in fast flow Q w = P, on the fast side, and never above the limit."""
    law = RatedFeedback(power=3000.0, torque_limit=limit, smoothing=1e-8)
    operation = quasi_steady(table, law).operate([8.0])
    assert operation.running
    torque, speed = operation.hydrodynamic_torque, operation.rotor_speed
    most = np.inf if limit is None else limit
    expected = np.minimum(np.minimum(8.0 * speed**2, 3000.0 / speed), most)
    np.testing.assert_allclose(torque, expected, rtol=1e-3)
    assert np.ptp(np.argmin((8.0 * speed**2, 3000.0 / speed), axis=0)) == 1  # both occur


@pytest.mark.parametrize(
    ("law", "gains"),
    [POWER, (PowerLawFeedback(exponent=-1.0), [4000.0]), (RatedFeedback(power=4000.0), [7.0])],
)
def test_a_fit_recovers_the_gains_of_its_own_torque(law, gains):
    speed = np.linspace(4.0, 8.0, 30)
    np.testing.assert_allclose(law.fit(speed, law.torque(speed, np.array(gains))), gains, rtol=1e-3)


@pytest.mark.parametrize(("law", "gains"), [POWER, RATED, CURVE])
def test_eased_gains_demand_a_share(law, gains):
    gains, speed = np.array(gains), np.array([5.0, 6.0])
    share = law.demand(speed, law.scaled_gains(gains, 0.7)) / law.demand(speed, gains)
    np.testing.assert_allclose(share, 0.7, rtol=1e-3)


# Against open loop


def test_a_curve_reaches_open_loop_as_its_knots_grow(table):
    """Without limits the best torque is a smooth function of the speed, and a curve converges.

    Losses in the windings make it no power of the speed. Energy lost is of second order in the
    torque's error, which is of fourth order in the distance of the knots, but near the ends of a
    natural spline of second.
    """
    ratios, weights = np.linspace(4.0, 12.0, 40_001), quasi_steady(table, None).weights
    torque = torque_scale(1000.0, 1.4, FLOW)[:, None] * SPLINE.curve(table)(ratios)
    speed = ratios * FLOW[:, None] / 1.4
    power = LOSSES.electrical_power(torque, speed)
    best = np.arange(FLOW.size), np.argmax(power, axis=1)
    lost, counts = [], (2, 4, 8)
    for knots in counts:
        law = CurveFeedback(knots=knots)
        operation = quasi_steady(table, law).operate(law.fit(speed[best], torque[best]))
        kept = LOSSES.electrical_power(operation.hydrodynamic_torque, operation.rotor_speed)
        lost.append(1.0 - (weights @ kept) / (weights @ power[best]))
    assert np.all(np.array(lost) > 0.0)
    order = -np.diff(np.log(lost)) / np.log(np.divide(counts[1:], counts[:-1]))
    assert np.all(order > 4.0)


# Derivatives


@pytest.mark.parametrize("limit", [None, 350.0])
@pytest.mark.parametrize(
    ("law", "gains"),
    [
        (LinearFeedback(), [60.0]),
        (QuadraticFeedback(), [7.0]),
        POWER,
        (RatedFeedback(), [7.0, 3000.0]),
        CURVE,
    ],
)
def test_partials(law, gains, limit):
    values = {f"gain_{i}": gain for i, gain in enumerate(gains)}
    component = FeedbackComp(num_nodes=40, law=law.model_copy(update={"torque_limit": limit}))
    checked(component, 1e-10, 1e-12, rotor_speed=SPEED, **values)
