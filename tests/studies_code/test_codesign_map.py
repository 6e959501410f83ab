"""The map of co-design: its theory by other means, its data against the theory, and its page."""

import importlib

import numpy as np
import pytest


@pytest.fixture(scope="module")
def study():
    return importlib.import_module("codesign_map")


def test_lines_are_those_of_the_equation_of_motion(study):
    """Torque and power of a rotor that keeps its tip speed ratio, by differences over time."""
    mean, swing, speed, torque, frequency = 1.5, study.SWING, 7.7, 628.0, 0.63
    for beta in (0.05, 1.0, 6.0):
        inertia = beta * torque / speed / frequency
        time = np.linspace(0.0, 2.0 * np.pi / frequency, 20_001)
        flow = mean * (1.0 + swing * np.sin(frequency * time))
        turning = speed * flow / mean
        needed = torque * (flow / mean) ** 2 - inertia * np.gradient(turning, time)
        most, power = np.max(needed) / torque, np.max(needed * turning) / (torque * speed)
        assert study.limit_that_binds("torque", beta) == pytest.approx(most, rel=1e-4)
        assert study.limit_that_binds("power", beta) == pytest.approx(power, rel=1e-4)
        assert (np.min(needed) < 0.0) == (beta > study.slowest())
    assert study.limit_that_binds("torque", 0.0) == pytest.approx((1.0 + swing) ** 2)
    assert study.limit_that_binds("power", 0.0) == pytest.approx((1.0 + swing) ** 3)


def test_the_data_agree_with_the_theory(study):
    rows = study.read()
    verified = [row for row in rows if row["verified"] == "yes"]
    assert len(verified) > 0.97 * len(rows)
    for row in verified:
        assert study.gain(row) > -study.TOLD  # the sequential design is one of co-design's
        if study.free(row):
            assert study.gain(row) < 1e-6
        if study.full(row):
            assert study.gain(row) < study.TOLD
    below = [row for row in verified if row["limit"] == "torque" and float(row["share"]) < 1.4]
    assert min(map(study.gain, below)) > 1e-4
    fast = [row for row in verified if row["limit"] == "power" and float(row["beta"]) < 0.06]
    assert max(map(study.gain, fast)) < 2e-4
