"""Control laws and the smoothed saturation: closed forms first, then partials."""

import numpy as np
import openmdao.api as om
import pytest
from openmdao.utils.assert_utils import assert_check_partials

from hkt_mdo.dynamics.controllers import (
    LAWS,
    FeedbackComp,
    LinearLaw,
    QuadraticLaw,
    smooth_saturation,
)

SPEED = np.linspace(0.5, 12.0, 24)


def test_laws_are_equations_1_and_2():
    np.testing.assert_allclose(LinearLaw().torque(SPEED, np.array([70.0])), 70.0 * SPEED)
    np.testing.assert_allclose(QuadraticLaw().torque(SPEED, np.array([7.0])), 7.0 * SPEED**2)


def test_saturation_stays_between_zero_and_the_limit():
    saturated = smooth_saturation(np.linspace(0.0, 1e5, 2001), 700.0, 0.001)
    assert np.all(saturated > 0.0)
    assert np.all(saturated < 700.0)
    assert np.all(np.diff(saturated) > 0.0)


def test_saturation_at_standstill_is_0_78_percent_of_the_limit():
    expected = 0.25 * (2.0 + np.sqrt(0.001) - np.sqrt(4.001))
    assert smooth_saturation(0.0, 700.0, 0.001) / 700.0 == pytest.approx(expected, rel=1e-14)
    assert expected == pytest.approx(0.0078, abs=5e-5)


def test_saturation_is_within_one_percent_of_the_limit_of_the_sharp_one():
    torque = np.linspace(0.0, 3000.0, 3001)
    error = smooth_saturation(torque, 700.0, 0.001) - np.minimum(torque, 700.0)
    assert np.max(np.abs(error)) < 0.01 * 700.0  # the paper's statement below eq. 4


def test_saturation_tends_to_the_sharp_one_as_the_smoothing_vanishes():
    torque = np.array([0.0, 350.0, 699.0, 701.0, 2000.0])
    np.testing.assert_allclose(
        smooth_saturation(torque, 700.0, 1e-16), np.minimum(torque, 700.0), atol=1e-5
    )


@pytest.mark.parametrize("name", LAWS)
def test_fit_recovers_the_gain_of_its_own_torque(name):
    law = LAWS[name]()
    np.testing.assert_allclose(law.fit(SPEED, law.torque(SPEED, np.array([8.5]))), [8.5])


@pytest.mark.parametrize("limit", [None, 700.0])
@pytest.mark.parametrize("name", LAWS)
def test_partials(name, limit):
    law = LAWS[name](limit)
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("law", FeedbackComp(num_nodes=24, law=law), promotes=["*"])
    problem.setup(force_alloc_complex=True)
    problem.set_val("rotor_speed", SPEED)
    problem.set_val("gain_0", 60.0 if name == "linear" else 7.0)
    problem.run_model()
    data = problem.check_partials(method="cs", compact_print=True, out_stream=None)
    assert_check_partials(data, atol=1e-10, rtol=1e-12)
