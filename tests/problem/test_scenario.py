"""Scenarios: exact quadrature, node times, and the interpolation of Dymos in sparse form."""

import dymos as dm
import numpy as np
import pytest

from hkt_mdo.case import Phase
from hkt_mdo.dynamics.flows import SineInflow
from hkt_mdo.problem.scenario import GaussLobatto, Radau, Scenario

TRANSCRIPTIONS = ["gauss-lobatto", "radau"]


def scenario(transcription, order, segments=4, duration=10.0):
    mesh = Phase(transcription=transcription, order=order, segments=segments, duration=duration)
    return Scenario(SineInflow(), mesh)


@pytest.mark.parametrize("transcription", TRANSCRIPTIONS)
@pytest.mark.parametrize("order", [3, 5])
def test_weights_integrate_polynomials_exactly(transcription, order):
    """LGL of n points is exact to degree 2n - 3, LGR to 2n - 2; one degree more is not."""
    made = scenario(transcription, order)
    degree = 2 * order - (3 if transcription == "gauss-lobatto" else 2)
    errors = [
        made.node_weights @ made.node_times**power / (10.0 ** (power + 1) / (power + 1)) - 1.0
        for power in (0, 1, degree, degree + 1)
    ]
    np.testing.assert_allclose(errors[:3], 0.0, atol=1e-13)
    assert abs(errors[3]) > 1e-11


@pytest.mark.parametrize("transcription", TRANSCRIPTIONS)
def test_distinct_nodes_have_every_time_once(transcription):
    made = scenario(transcription, 3)
    time = made.node_times[made.distinct_nodes]
    assert np.all(np.diff(time) > 0.1)
    np.testing.assert_allclose(time, np.unique(made.node_times.round(9)), rtol=1e-9)


@pytest.mark.parametrize("transcription", TRANSCRIPTIONS)
@pytest.mark.parametrize("order", [3, 5])
def test_rates_are_those_of_each_segments_polynomial(transcription, order):
    """Exact to the degree of the polynomial, on segments of unequal lengths; a ramp's is constant.

    One degree more is not.
    """
    made = scenario(transcription, order).divided(np.array([1, 3, 2, 1]))
    time, degree = made.node_times, made.nodes_per_segment - 1
    np.testing.assert_allclose(made.differentiation @ (7.0 - 3.0 * time), -3.0, rtol=1e-11)
    rate = degree * time ** (degree - 1)
    np.testing.assert_allclose(
        made.differentiation @ time**degree, rate, rtol=1e-10, atol=1e-10 * np.max(rate)
    )
    error = made.differentiation @ time ** (degree + 1) - (degree + 1) * time**degree
    assert np.max(np.abs(error)) > 1e-5 * np.max(rate)
    others = made.differentiation.toarray().reshape(made.segments, degree + 1, -1, degree + 1)
    index = np.arange(made.segments)
    others[index, :, index, :] = 0.0
    assert not np.any(others)


def test_samples_are_four_a_segment_with_trapezoidal_weights():
    made = scenario("gauss-lobatto", 3)
    np.testing.assert_allclose(made.samples, np.linspace(0.0, 10.0, 17))
    assert made.sample_weights @ (3.0 + 2.0 * made.samples) == pytest.approx(130.0, rel=1e-14)


@pytest.mark.parametrize("transcription", TRANSCRIPTIONS)
def test_sparse_interpolation_matrices_are_those_of_dymos(transcription):
    ours, theirs = {"gauss-lobatto": (GaussLobatto, dm.GaussLobatto), "radau": (Radau, dm.Radau)}[
        transcription
    ]
    grids = []
    for kind in (ours, theirs):
        made = kind(num_segments=7, order=3)
        made.init_grid()
        grids.append(made.grid_data)
    for method, source, wanted in (
        ("phase_lagrange_matrices", "control_disc", "all"),
        ("phase_lagrange_matrices", "state_disc", "col"),
        ("phase_hermite_matrices", "state_disc", "col"),
    ):
        for sparse in (True, False):
            mine, dymos = (getattr(grid, method)(source, wanted, sparse) for grid in grids)
            for one, other in zip(mine, dymos, strict=True):
                if sparse:
                    one, other = one.toarray(), other.toarray()
                np.testing.assert_array_equal(one, other)
