"""Control laws and the smoothed saturation: closed forms, and the gains to begin with."""

from typing import ClassVar, Literal

import numpy as np
import pytest

from hkt_mdo.dynamics.laws import FeedbackLaw, LinearFeedback, QuadraticFeedback, smooth_saturation

SPEED = np.linspace(0.5, 12.0, 24)


def test_laws_are_equations_1_and_2():
    np.testing.assert_allclose(LinearFeedback().torque(SPEED, np.array([70.0])), 70.0 * SPEED)
    np.testing.assert_allclose(QuadraticFeedback().torque(SPEED, np.array([7.0])), 7.0 * SPEED**2)


def test_a_limited_law_is_equation_4():
    gain, limit, smoothing = np.array([9.0]), 500.0, 0.01
    ratio = 2.0 * 9.0 * SPEED**2 / limit
    rising, falling = np.sqrt(smoothing + ratio**2), np.sqrt(smoothing + (ratio - 2.0) ** 2)
    expected = 0.25 * limit * (2.0 + rising - falling)
    law = QuadraticFeedback(torque_limit=limit, smoothing=smoothing)
    np.testing.assert_allclose(law.torque(SPEED, gain), expected, rtol=1e-14)


def test_saturation_is_within_one_percent_of_the_limit_of_the_sharp_one():
    torque = np.linspace(0.0, 3000.0, 3001)
    error = smooth_saturation(torque, 700.0, 0.001) - np.minimum(torque, 700.0)
    assert np.max(np.abs(error)) < 0.01 * 700.0  # the paper's statement below eq. 4


def test_fit_minimizes_the_squared_distance():
    torque = 5.0 * SPEED**2 + 20.0 * np.sin(SPEED)
    (gain,) = QuadraticFeedback().fit(SPEED, torque)
    assert gain == pytest.approx(torque @ SPEED**2 / (SPEED**2 @ SPEED**2), rel=1e-12)


class TwoTerms(FeedbackLaw):
    """u = K1 w^2 + K2 w^3."""

    law: Literal["two_terms"] = "two_terms"
    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s**2/rad**2", "N*m*s**3/rad**3")

    def demand(self, speed, gains):
        return gains[0] * speed**2 + gains[1] * speed**3


def test_every_gain_begins_with_the_sign_that_it_has_alone_and_may_change_it():
    """Least squares would make one negative; the optimization decides."""
    law, exact = TwoTerms(), np.array([3.0, 0.5])
    assert law.fit(SPEED, law.torque(SPEED, exact)) == pytest.approx(exact, rel=1e-6)
    flat = np.full(SPEED.shape, 400.0)
    terms = np.stack((SPEED**2, SPEED**3))
    assert np.linalg.lstsq(terms.T, flat, rcond=None)[0].min() < 0.0
    alone = terms @ flat / np.sum(terms**2, axis=1)
    assert np.all(law.fit(SPEED, flat) >= 0.01 * alone)
    np.testing.assert_array_equal(law.moves(exact, 5.0), [-5.0 * exact, 5.0 * exact])
    assert np.all(QuadraticFeedback().moves(exact[:1], 5.0) > 0.0)


def test_a_term_that_is_zero_at_all_speeds_has_no_gain():
    class Ramp(TwoTerms):
        law: Literal["ramp"] = "ramp"

        def demand(self, speed, gains):
            return gains[0] * speed**2 + gains[1] * np.where(speed > 20.0, speed - 20.0, 0.0)

    assert Ramp().fit(SPEED, 3.0 * SPEED**2) == pytest.approx([3.0, 0.0], rel=1e-9)
