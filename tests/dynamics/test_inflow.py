"""Inflow profiles: against the paper's formulas, and their rates by complex step."""

import numpy as np
import openmdao.api as om
import pytest
from openmdao.utils.assert_utils import assert_check_partials

from hkt_mdo.dynamics.inflow import ConstantInflow, InflowComp, SineInflow, StepInflow

TIME = np.linspace(0.0, 60.0, 241)
PROFILES = [
    ConstantInflow(1.3),
    StepInflow(1.2, 1.4, 30.0, 1.0),
    SineInflow(1.5, 0.2, 0.25),
    SineInflow(1.5, 0.2, 0.225, 0.2 * np.pi, 1.1),
]


def test_step_is_equation_9():
    expected = 1.2 + 0.2 / (1.0 + np.exp(-(TIME - 30.0)))
    np.testing.assert_allclose(PROFILES[1].speed(TIME), expected, rtol=1e-14)


def test_step_does_not_overflow_far_from_the_step():
    with np.errstate(all="raise"):
        assert StepInflow(1.2, 1.4, 1e6, 1.0).speed(0.0) == pytest.approx(1.2)


def test_sine_is_equation_10():
    np.testing.assert_allclose(PROFILES[2].speed(TIME), 0.2 * np.sin(0.25 * TIME) + 1.5, rtol=1e-15)


def test_uncertain_flows_are_those_of_section_5():
    v0 = 0.2 * np.sin(0.25 * TIME) + 1.5
    np.testing.assert_allclose(SineInflow(1.5, 0.2, 0.25, scale=1.1).speed(TIME), 1.1 * v0)
    np.testing.assert_allclose(
        SineInflow(1.5, 0.2, 0.25, phase=0.2 * np.pi).speed(TIME),
        0.2 * np.sin(0.25 * TIME + 0.2 * np.pi) + 1.5,
    )


@pytest.mark.parametrize("inflow", PROFILES)
def test_rate_is_the_derivative(inflow):
    by_complex_step = np.imag(inflow.speed(TIME + 1e-30j)) / 1e-30
    np.testing.assert_allclose(inflow.rate(TIME), by_complex_step, rtol=1e-13, atol=1e-16)


@pytest.mark.parametrize("inflow", PROFILES)
def test_partials(inflow):
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("flow", InflowComp(num_nodes=7, inflow=inflow), promotes=["*"])
    problem.setup(force_alloc_complex=True)
    problem.set_val("time", np.linspace(0.0, 60.0, 7))
    problem.run_model()
    data = problem.check_partials(method="cs", compact_print=True, out_stream=None)
    assert_check_partials(data, atol=1e-12, rtol=1e-12)
