"""The flow's speed from speed and torque: closed forms, then the motion under such an estimate."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.dynamics.estimate import FlowEstimate
from hkt_mdo.dynamics.flows import ConstantInflow, SineInflow
from hkt_mdo.dynamics.simulation import FeedbackTorque, Plant, simulate
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.errors import InputError
from hkt_mdo.rotor.following import LocalReynolds
from hkt_mdo.rotor.steady_optimum import best_operation
from tests.dynamics.test_simulation import constant_torque_coefficient

LAW = Tracking(knots=2, flow_range=(1.0, 2.0), flow="estimated")


def test_estimate_is_the_flow_that_has_the_torque(plant):
    """At every tip speed ratio out of stall, to a rotor that is driven."""
    ratio, flow = np.meshgrid(np.linspace(4.2, 14.0, 21), np.linspace(1.0, 2.0, 11))
    speed = ratio * flow / plant.blade.rotor_radius
    driving = plant.torque(speed.ravel(), flow.ravel()).reshape(speed.shape)
    acceleration = (driving - 300.0) / plant.inertia
    np.testing.assert_allclose(FlowEstimate(plant)(speed, 300.0, acceleration), flow, rtol=2e-6)


def test_dense_water_looks_like_a_fast_flow(blade, polar):
    """A torque that does not depend on the speed grows with rho v²: v is told sqrt(f) too large."""

    model = Plant(blade, polar, 4.0, 1000.0, constant_torque_coefficient(0.05))
    dense, speed, flow = replace(model, density=1100.0), np.array([8.0]), np.array([1.5])
    torque = dense.torque(speed, flow)
    assert FlowEstimate(model)(speed, torque, 0.0) == pytest.approx(np.sqrt(1.1) * 1.5, rel=1e-6)
    # where 10 % of the inertia are missing, so are 10 % of what accelerates the rotor
    estimate = FlowEstimate(replace(model, inertia=3.6))(speed, 0.0 * torque, torque / 4.0)
    assert estimate == pytest.approx(np.sqrt(1.1 * 0.9) * 1.5, rel=1e-6)


def test_motion_is_that_with_an_exact_sensor_and_settles_where_the_estimate_says(plant):
    best = best_operation(plant.blade, plant.polar)
    unit = best.tip_speed_ratio / plant.blade.rotor_radius
    gains, estimate = np.array([unit, 2.0 * unit, 150.0, 600.0]), FlowEstimate(plant)
    states = [float(plant.torque(np.array([1.5 * unit]), np.array([1.5]))[0]), 1.5]
    start = [1.5 * unit, *states], np.linspace(0.0, 20.0, 401), 0.2
    sensed, estimated = (
        simulate(plant, SineInflow(), FeedbackTorque(LAW, gains, sensor), *start)
        for sensor in (None, estimate)
    )
    np.testing.assert_allclose(estimated.rotor_speed, sensed.rotor_speed, rtol=1e-5)
    dense, flow = replace(plant, density=1100.0), ConstantInflow(speed=1.5)
    run = simulate(dense, flow, FeedbackTorque(LAW, gains, estimate), *start)
    inflow = run.states[1, -1]
    assert run.rotor_speed[-1] == pytest.approx(unit * inflow, rel=1e-6)
    torque = dense.torque(run.rotor_speed[-1:], np.array([1.5]))
    assert plant.torque(run.rotor_speed[-1:], np.array([inflow])) == pytest.approx(torque, rel=1e-5)
    assert 1.01 < inflow / 1.5 < np.sqrt(1.1)


def test_an_estimate_from_polars_at_the_local_reynolds_number_is_refused(plant):
    polar = LocalReynolds(*[None] * len(LocalReynolds.__dataclass_fields__))
    with pytest.raises(InputError, match=r"rotor\.reynolds.*give invariant, control\.flow: sensed"):
        FlowEstimate(replace(plant, polar=polar))(8.0, 300.0, 0.0)
