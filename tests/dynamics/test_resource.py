"""Resources: hours of a year of each speed of the flow, held to formulas and to SciPy."""

from math import gamma

import numpy as np
import pytest
from scipy.optimize import brentq

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.laws import LinearFeedback, QuadraticFeedback
from hkt_mdo.dynamics.resource import (
    YEAR,
    DistributionResource,
    HistogramResource,
    TidalResource,
    in_bins,
)
from hkt_mdo.dynamics.simulation import FeedbackTorque
from hkt_mdo.problem.physics import physics
from tests.test_extension_faults import Lagging

CONTROL = {"law": "quadratic"}


def year(**resource):
    return load_case({"resource": resource, "control": CONTROL})


def test_bins_keep_time_and_power_of_the_flow():
    speed = np.random.default_rng(1).weibull(2.0, 1000)
    mean, share = in_bins(speed, np.full(1000, 1e-3), 0.1)
    assert np.sum(share) == pytest.approx(1.0, rel=1e-12)
    assert share @ mean**3 == pytest.approx(np.mean(speed**3), rel=1e-12)
    assert np.all((mean / 0.1).astype(int) == np.unique((speed / 0.1).astype(int)))


@pytest.mark.parametrize("width", [0.05, 0.2])
def test_a_weibull_distribution_has_its_moments(width):
    speeds = DistributionResource(scale=1.5, shape=2.0, bin_width=width, cut_in=0.0).speeds
    exact = 1.5**3 * gamma(1.0 + 3.0 / 2.0)
    assert np.sum(speeds.share) == pytest.approx(1.0, rel=1e-12)
    assert speeds.share @ speeds.speed**3 == pytest.approx(exact, rel=4e-4)  # but for the tail
    below = speeds.speed < 1.2  # the end of a bin
    assert np.sum(speeds.share[below]) == pytest.approx(1.0 - np.exp(-(0.8**2)), rel=2e-5)


def test_turbulence_adds_its_variance_to_the_mean_cube():
    """Of a normal distribution, E v³ = m³ (1 + 3 I²)."""
    histogram = {"speeds": [1.0, 2.0], "hours": [3.0, 1.0], "cut_in": 0.0}
    calm = HistogramResource(**histogram).speeds
    rough = HistogramResource(**histogram, turbulence_intensity=0.1).speeds
    factor = rough.share @ rough.speed**3 / (calm.share @ calm.speed**3)
    assert factor == pytest.approx(1.03, rel=1e-12)
    assert np.all(np.diff(rough.speed) >= 0.0)
    means = [rough.share[rough.place == i] @ rough.speed[rough.place == i] for i in (0, 1)]
    assert means == pytest.approx([0.75 * 1.0, 0.25 * 2.0], rel=1e-12)


def test_a_reversing_tide_turns_or_stands():
    parts = [{"name": "M2", "amplitude": 2.0}]
    turns, stands = (
        TidalResource(constituents=parts, cut_in=0.0, reversal=reversal).speeds
        for reversal in ("turns", "stands")
    )
    assert turns.share @ turns.speed**3 == pytest.approx(8.0 * 4.0 / (3.0 * np.pi), rel=1e-3)
    assert stands.idle == pytest.approx(0.5, abs=2e-3)
    half = stands.share @ stands.speed**3
    assert half == pytest.approx(0.5 * (turns.share @ turns.speed**3), rel=5e-3)
    slow = TidalResource(constituents=parts, cut_in=1.0).speeds
    assert slow.idle == pytest.approx(2.0 / np.pi * np.arcsin(0.5), abs=0.03)  # to a bin


def test_a_scenario_of_a_year_has_its_hours():
    data = {"profile": "histogram", "speeds": [0.3, 1.0, -1.5], "hours": [2, 5, 3]}
    data["bin_width"] = 0.1  # cases of results have all keys
    scenario = physics(year(**data)).scenarios[0]
    assert scenario.steady
    assert scenario.mesh.duration == YEAR
    np.testing.assert_allclose(scenario.speeds, [0.5, 1.0, 1.5, 1.75], rtol=1e-12)
    np.testing.assert_allclose(scenario.node_weights / YEAR, [0.0, 0.5, 0.3, 0.0], atol=1e-12)
    assert scenario.mesh.duration - scenario.duration == pytest.approx(0.2 * YEAR, rel=1e-12)
    assert "wider bins than the 0.1 m/s" in scenario.messages[0]
    assert "they sum to 10 and are scaled to a year of 8766 h" in scenario.messages[1]
    assert len(year(**data | {"hours": [0, 4383, 4383]}).inflow.messages) == 1


BINS = {"profile": "histogram", "speeds": [0.8, 0.9, 1.0], "hours": [1, 1, 1]}
WEIBULL = {"profile": "distribution", "scale": 1.0, "shape": 2, "cut_in": 0.7}
TIDE = {"profile": "tidal_year", "constituents": [{"name": "M2", "amplitude": 2.03}]}
FARTHEST = np.sqrt(5.0 + np.sqrt(10.0))  # of the quadrature of turbulence, standard deviations


@pytest.mark.parametrize(
    ("resource", "cut_out", "ends"),
    [
        (BINS, 3.0, (0.75, 1.05)),
        (BINS, 0.93, (0.75, 0.93)),
        (BINS | {"speeds": [1.0], "hours": [1]}, None, (1.0, 1.0)),
        (WEIBULL, 2.45, (0.7, 2.45)),
        (TIDE, None, (0.5, 2.03)),
        (TIDE | {"turbulence_intensity": 0.1}, None, (0.5, 2.03 * (1.0 + 0.1 * FARTHEST))),
    ],
)
def test_the_ends_of_the_flow_are_speeds_without_energy(resource, cut_out, ends):
    """Of bins their edges, of a record its largest speed, else cut-in and cut-out."""
    case = year(**resource).with_overrides(f"control.cut_out={cut_out or 'null'}")
    scenario = physics(case).scenarios[0]
    np.testing.assert_allclose(scenario.speeds[[0, -1]], ends, rtol=1e-6)
    if ends[0] < ends[1]:
        shares = scenario.node_weights / np.sum(scenario.node_weights)
        assert np.max(shares[[0, -1]]) < 1e-13
        assert np.min(shares[1:-1]) > 1e-12


def test_a_law_with_states_is_at_rest_where_the_same_law_without_them_is(plant):
    """Its speed_at_rest is a guess, and its torque limit counts."""
    flow, gains = np.array([1.0, 1.5, 1.7]), np.array([8.0])
    controllers = (
        FeedbackTorque(kind(torque_limit=700.0), gains) for kind in (Lagging, QuadraticFeedback)
    )
    (speed, running, (z,)), (plain, *_) = (equilibria(plant, each, flow) for each in controllers)
    assert np.all(running)
    np.testing.assert_allclose(speed, plain, rtol=1e-8)
    np.testing.assert_allclose(z, gains * plain**2, rtol=1e-8)


def test_equilibria_are_those_of_brentq(plant):
    """The fastest root of Q = u, from direct BEM, each by itself."""
    law, flow = LinearFeedback(torque_limit=700.0), np.array([1.0, 1.5, 2.5])
    speed, running, _ = equilibria(plant, FeedbackTorque(law, np.array([70.0])), flow)
    assert np.all(running)
    for v, root in zip(flow, speed, strict=True):

        def net(w, v=v):
            w = np.array([w])
            return float(plant.torque(w, np.array([v]))[0] - law.torque(w, [70.0])[0])

        assert root == pytest.approx(brentq(net, root - 0.2, root + 0.2, xtol=1e-14), rel=1e-10)
        assert max(map(net, np.linspace(1.001, 3.0, 30) * root)) < 0.0
    _, none, _ = equilibria(plant, FeedbackTorque(LinearFeedback(), np.array([7e4])), flow)
    assert not np.any(none)
