"""From standstill into operation and out of it, with the blade and law of a finished result."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.dynamics.flows import ConstantInflow
from hkt_mdo.dynamics.generator import Generator
from hkt_mdo.errors import InputError
from hkt_mdo.studies.start_stop import FIRST, start_and_stop


def limited(design, torque):
    """Return a design with another limit of its torque."""
    law = design.law.model_copy(update={"torque_limit": torque})
    return replace(design, physics=replace(design.physics, law=law))


def test_after_a_start_the_rotor_works_as_if_it_had_never_stood(quadratic):
    """The law has one equilibrium in operation: what the rotor was before is forgotten."""
    flow = quadratic.physics.inflow
    parts, never = start_and_stop(quadratic, flow), quadratic.simulate(flow)
    begin = parts.run_up.rotor_speed[0] * quadratic.plant.blade.rotor_radius / flow.speed_at(0.0)
    assert begin == pytest.approx(FIRST)
    assert 0.05 < parts.started_at < 1.0
    assert parts.operation.rotor_speed[0] == pytest.approx(parts.run_up.speed_at(parts.started_at))
    late = parts.operation.time > parts.started_at + 2.0
    time, speed = parts.operation.time[late], parts.operation.rotor_speed[late]
    np.testing.assert_allclose(speed, never.speed_at(time), rtol=1e-7)
    assert parts.shut_down is None


def test_a_run_up_gains_what_the_flow_does(quadratic):
    """Without a torque the work of the flow is the kinetic energy."""
    parts = start_and_stop(quadratic, ConstantInflow(speed=1.5))
    run = parts.run_up
    assert run.generator_energy == 0.0
    assert run.energy == pytest.approx(run.kinetic_energy_change, rel=1e-9)
    # while the water moves less than the diameter there is no wake: the time is not told
    assert "the time is not known" in next(parts.lines())
    assert f" in {parts.started_at:.2f} s" in next(replace(parts, diameter=0.1).lines())
    reached = parts.operation.rotor_speed[0]
    assert reached == pytest.approx(quadratic.initial_speed(ConstantInflow(speed=1.5)))


def test_the_limit_of_the_torque_stops_a_rotor_that_it_exceeds(quadratic):
    parts = start_and_stop(quadratic, quadratic.physics.inflow, stop=50.0)
    assert parts.operation.time[-1] == pytest.approx(50.0)
    assert 50.0 < parts.shut_down.stopped_at < 51.0
    assert any("700 N m stop the rotor while the water" in line for line in parts.lines())
    parts = start_and_stop(limited(quadratic, 100.0), quadratic.physics.inflow, stop=50.0)
    assert parts.shut_down.stopped_at is None
    assert any("needs a brake" in line for line in parts.lines())


@pytest.mark.parametrize("changed", [{"inertia": 1e6}, {"generator": Generator(shaft_friction=90)}])
def test_a_rotor_that_does_not_start_is_reported(quadratic, changed):
    """Too heavy, or with more friction than the flow's torque on the standing rotor."""
    heavy = replace(quadratic, plant=replace(quadratic.plant, **changed))
    parts = start_and_stop(heavy, quadratic.physics.inflow)
    assert parts.started_at is None
    assert parts.operation is None
    (line,) = parts.lines()
    assert "does not start by itself" in line


@pytest.mark.parametrize(
    ("stop", "limit", "words"),
    [(60.0, 700.0, "--shut-down = 60"), (5.0, None, "no limit of the torque")],
)
def test_an_impossible_start_or_stop_is_refused(quadratic, open_loop, stop, limit, words):
    with pytest.raises(InputError, match=words):
        start_and_stop(limited(quadratic, limit), quadratic.physics.inflow, stop)
    with pytest.raises(InputError, match="open loop cannot start up"):
        start_and_stop(open_loop, quadratic.physics.inflow)
