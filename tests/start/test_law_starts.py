"""Starts of the laws for the whole range: what theory says of them in quasi-steady operation."""

from functools import cache

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.evaluation import on_start
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.point import START_EXCESS
from hkt_mdo.start.find import find_start
from tests.conftest import NINE


@cache
def start(law, limits="{}", torque_limit=None):
    control = {"law": law} if isinstance(law, str) else dict(law)
    case = {"inflow": "sine", "control": control | {"torque_limit": torque_limit}}
    model = physics(load_case(case, [f"limits={limits}", f"rotor.stations={NINE}"]))
    return model, find_start(model)


def below(law, limits="{}", torque_limit=None):
    """Return by which share a law's start falls short of open loop's, without time."""
    ideal, point = (start(each, limits, torque_limit)[1] for each in ("open_loop", law))
    assert point.operation.running
    assert point.excess <= START_EXCESS
    return 1.0 - point.objective / ideal.objective


def test_without_limits_the_best_power_of_the_speed_is_the_second():
    """The best tip speed ratio does not depend on the flow, so Q and u go with w^2."""
    _, point = start("power_law")
    assert point.gains[1] == pytest.approx(2.0, abs=0.02)
    assert below("power_law") < 1e-6
    assert all(record.strategy for record in point.starts)


@pytest.mark.slow
def test_laws_with_constant_power_keep_a_limit_of_the_power_nearly_for_nothing():
    """K w^2 loses eight per cent: its power goes with the cube of the speed; K w^n, K/w, over one.

    From the exponents of the open loops, about -0.4, it comes to an optimum that loses five.
    """
    knots = (("law", "curve"), ("knots", 4))
    assert below("rated", "{power: 5 kW}", 700.0) < 5e-4
    assert below(knots, "{power: 5 kW}", 700.0) < 1e-3
    assert 0.01 < below("power_law", "{power: 5 kW}", 700.0) < 0.015


@pytest.mark.slow
def test_constant_power_is_passed_on_the_fast_side():
    model, point = start("rated", "{power: 5 kW}", 700.0)
    (series,) = on_start(model, point)
    limited = series["generator_power"] > 0.999 * 5000.0
    assert np.mean(limited) > 0.3
    slopes = np.polyfit(series["rotor_speed"][limited], series["control_torque"][limited], 1)
    assert slopes[0] < 0.0
    assert np.min(series["tip_speed_ratio"][limited]) > np.min(series["tip_speed_ratio"])
