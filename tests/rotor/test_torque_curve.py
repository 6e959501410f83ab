"""The spline over tip speed ratio: closed forms and derivatives."""

import numpy as np
import pytest

from hkt_mdo.rotor.torque_curve import TorqueSpline

NODES = np.concatenate((np.arange(1.0, 4.0, 0.5), np.arange(4.0, 11.0, 0.25), [12.0, 14.0]))


@pytest.fixture(scope="module")
def spline():
    return TorqueSpline(NODES)


# Theory


def test_straight_line_is_reproduced_inside_and_beyond(spline):
    points = np.linspace(-1.0, 20.0, 97)
    assert np.allclose(spline.basis(points) @ (2.0 - 0.3 * NODES), 2.0 - 0.3 * points, atol=1e-12)


def test_nodes_are_interpolated_and_weights_sum_to_one(spline):
    assert np.allclose(spline.basis(NODES), np.eye(NODES.size), atol=1e-13)
    assert np.allclose(spline.basis(np.linspace(0.0, 20.0, 50)).sum(axis=1), 1.0, atol=1e-12)


def test_derivatives_are_exact(spline):
    """By complex step, within the nodes and beyond; the natural curve has no bend at its ends."""
    points, step = np.linspace(0.2, 16.0, 201), 1e-5
    slopes = spline.basis(points + 1e-30j).imag / 1e-30
    ahead, behind = (spline.basis(points + move) for move in (step, -step))
    assert np.allclose((ahead - behind) / (2.0 * step), slopes, atol=1e-4)
    table = np.sin(NODES)
    assert np.allclose(spline.curve(table)(points), spline.basis(points) @ table, atol=1e-12)
