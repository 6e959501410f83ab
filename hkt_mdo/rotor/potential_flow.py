"""Suction of an outline in potential flow, with the circulation of the lift it has in real flow.

A boundary layer hardly changes the pressure near the nose from that of potential flow; it changes
the circulation. The panels have linearly varying vorticity, as those of XFOIL (Drela
1989).
"""

import numpy as np
from scipy.interpolate import BPoly, CubicSpline

from hkt_mdo.files.polar_table import PRESSURE_RANGE

PANELS = 160  # of each side, closer together towards both edges
ORDER = 7  # of the Bernstein polynomials of a side
# of the chord: behind it the flow with other circulation than Kutta's turns round the edge
FORWARD = 0.9


def potential_suction(outline, alpha, lift):
    """Return -Cp min of the upper and the lower surface, [2, n_rows], of an `Outline`.

    alpha[n_rows] is the angle of attack (rad), lift[n_rows] the lift coefficient c_l of the real
    flow, whose circulation V c c_l / 2 the potential flow is given in place of Kutta's. A surface
    runs from the stagnation point near the nose to 90 % of the chord. Up to stall this is within a
    few per cent of XFOIL, in stall above it; the values end at 60, which only stall reaches.

    Parameters
    ----------
    outline : Outline
        Outline of the section.
    alpha : ndarray of shape (n_rows,)
        Angle of attack (rad).
    lift : ndarray of shape (n_rows,)
        Lift coefficient of the real flow.

    Returns
    -------
    ndarray of shape (2, n_rows)
        -Cp min of the upper and the lower surface.
    """
    x, y = faired(outline)
    along, across, circulating = surface_speed(x, y)
    speed = along * np.cos(alpha) + across * np.sin(alpha) + circulating * lift
    suction = np.where(x < FORWARD, speed.T**2 - 1.0, -1.0)
    stagnation = (speed[:-1] > 0.0) & (speed[1:] <= 0.0) & (x[1:, None] < FORWARD)
    from_nose = np.abs(np.arange(x.size - 1) - np.argmin(x))[:, None]
    last = np.argmin(np.where(stagnation, from_nose, from_nose + x.size), axis=0)
    upper = np.arange(x.size) <= last[:, None]
    sides = [np.max(np.where(side, suction, -1.0), axis=1) for side in (upper, ~upper)]
    return np.minimum(sides, -PRESSURE_RANGE[0])


def faired(outline, n_panels=PANELS):
    """Return nodes x, y of an outline as a smooth curve with a sharp trailing edge.

    Points of a file are rounded and may have corners at the nose, of which potential flow makes
    suction peaks that no flow shows. Each side is the class and shape function of Kulfan (Journal
    of Aircraft 45, 2008) with eight weights, fitted by least squares,

        y = sqrt(x) (1 - x) Σ w_i C(7, i) x^i (1 - x)^(7 - i) + w_e x (1 - x)^7.5 ± x t / 2,

    between the trailing edge and the point farthest from it; w_e is the same for both sides and
    the thickness t of the trailing edge is left out. NeuralFoil fits the same curve before it
    computes a polar. The 2 n_panels + 1 nodes, in the outline's own axes, run from the trailing
    edge over the upper side to it.

    Parameters
    ----------
    outline : Outline
        Outline of the section.
    n_panels : int
        Panels of each side.

    Returns
    -------
    x, y : ndarray of shape (2 n_panels + 1,)
        Over the chord.
    """
    points = outline.upper_first
    points = points[np.append(True, np.any(np.diff(points, axis=0) != 0.0, axis=1))]
    edge = 0.5 * (points[0] + points[-1])
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    places = np.linspace(0.25, 0.75, 20001) * length[-1]
    near = CubicSpline(length, points)(places)
    at = np.argmax(np.hypot(*(near - edge).T))
    nose, upper = near[at], length <= places[at]
    chord = edge - nose
    axes = np.array([chord, [-chord[1], chord[0]]])  # along and across, as long as the chord
    along, across = axes @ (points - nose).T / (chord @ chord)
    along = np.clip(along, 0.0, 1.0)

    def side(x, is_upper):
        shape = BPoly(np.eye(ORDER + 1)[:, None], (0.0, 1.0))(x)
        shape = shape * (np.sqrt(x) * (1.0 - x))[:, None]
        common = np.column_stack((x * (1.0 - x) ** (ORDER + 0.5), np.where(is_upper, x, -x) / 2.0))
        is_upper = np.broadcast_to(is_upper, x.shape)[:, None]
        return np.hstack((np.where(is_upper, shape, 0.0), np.where(is_upper, 0.0, shape), common))

    weights = np.linalg.lstsq(side(along, upper), across, rcond=None)[0]
    weights[-1] = 0.0  # the trailing edge is sharp
    x = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, n_panels + 1))
    sides = [np.column_stack((x, side(x, is_upper) @ weights)) for is_upper in (True, False)]
    return (np.vstack((sides[0][::-1], sides[1][1:])) @ axes + nose).T


def surface_speed(x, y):
    """Return the speed along the surface over that of the flow, round an outline with a sharp edge.

    It is positive backwards above, and linear in the flow along x and along y, both without
    circulation, and in the circulation of a lift coefficient of 1. The nodes run from the trailing
    edge over the upper side to it. Vorticity that is linear between the nodes is the speed along
    the surface where the stream function at all of them is the same:

        psi_i = V (y_i cos α - x_i sin α) + Σ_j A_ij γ_j.

    The edge's two nodes are one point, with a speed as large on both sides.

    Parameters
    ----------
    x : ndarray of shape (n_nodes,)
        Along the chord, over it.
    y : ndarray of shape (n_nodes,)
        Across the chord, over it.

    Returns
    -------
    along, across, circulating : ndarray of shape (n_nodes, 1)
        Speed along the surface at the nodes.
    """
    n = x.size
    influence, length = _influence(x, y)
    system, right = np.zeros((n + 1, n + 1)), np.zeros((n + 1, 3))
    system[: n - 1, :n] = influence[:-1]
    system[: n - 1, n] = -1.0
    right[: n - 1, 0], right[: n - 1, 1] = -y[:-1], x[:-1]
    system[n - 1, [0, n - 1]] = 1.0, -1.0
    system[n, :n] = np.convolve(length, (0.5, 0.5))  # circulation
    right[n, 2] = 0.5  # of a lift coefficient of 1
    return np.linalg.solve(system, right)[:n].T[:, :, None]


def _influence(x, y):
    """Return the stream function at every node by the vorticity at each, and panels' lengths."""
    dx, dy = np.diff(x), np.diff(y)
    length = np.hypot(dx, dy)
    from_x, from_y = x[:, None] - x[:-1], y[:, None] - y[:-1]
    along = (from_x * dx + from_y * dy) / length  # from the panel's first end
    off = (from_y * dx - from_x * dy) / length
    rest = along - length  # from its second end
    on_line = np.abs(off) < 1e-12
    off = np.where(on_line, 0.0, off)
    near, far = along**2 + off**2, rest**2 + off**2
    log_near, log_far = (0.5 * np.log(np.where(d < 1e-28, 1.0, d)) for d in (near, far))
    angles = np.where(on_line, 0.0, np.arctan2(along, off) - np.arctan2(rest, off))
    even = along * log_near - rest * log_far - length + off * angles
    odd = (along + rest) * even + far * log_far - near * log_near + 0.5 * (along**2 - rest**2)
    odd /= length
    influence = np.zeros((x.size, x.size))
    influence[:, :-1] += (even - odd) / (4.0 * np.pi)
    influence[:, 1:] += (even + odd) / (4.0 * np.pi)
    return influence, length
