"""Torque coefficient over tip speed ratio: a table of a blade's, and a spline over it."""

from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PPoly


class TorqueSpline:
    """Natural cubic spline over increasing tip speed ratios, linear beyond them: a C² function.

    Its value is linear in the table, q(tsr) = basis(tsr) @ table, so both partials are exact and
    cost a small matrix product; the basis does not change during an optimization.

    Parameters
    ----------
    nodes : array_like of shape (n_nodes,)
        Tip speed ratios of the table, increasing.
    """

    def __init__(self, nodes):
        self.nodes = np.asarray(nodes, dtype=float)

    @cached_property
    def _cardinal(self):
        return CubicSpline(self.nodes, np.eye(self.nodes.size), bc_type="natural")

    def basis(self, tip_speed_ratio, derivative=0):
        """Return the matrix (n_points, n_nodes) from a table to spline values or derivatives.

        Parameters
        ----------
        tip_speed_ratio : ndarray of shape (n_points,)
            Omega R / V of the disc.
        derivative : int
            Order of the derivative, 0 to 2.

        Returns
        -------
        ndarray of shape (n_points, n_nodes)
            The matrix, or its derivative.
        """
        points = np.asarray(tip_speed_ratio)
        inside = np.clip(points.real, self.nodes[0], self.nodes[-1])
        basis, beyond = self._cardinal(inside, derivative), points - inside
        if derivative == 0 and np.any(beyond):
            basis = basis + self._cardinal(inside, 1) * beyond[:, None]
        return basis * (beyond.real == 0.0)[:, None] if derivative > 1 else basis

    def curve(self, table):
        """Return the spline of a table as a function of the tip speed ratio within the nodes.

        Parameters
        ----------
        table : ndarray of shape (n_nodes,) or (n_nodes, n_tables)
            Coefficients at the nodes.

        Returns
        -------
        PPoly
            The curve or curves of the tables.
        """
        return PPoly.construct_fast(self._cardinal.c @ table, self.nodes)

    def values(self, table, tip_speed_ratio):
        """Return the spline's values and slopes (n_points,) for a table, without the matrices.

        Of several tables, the columns of one array, those are (n_points, n_tables).

        Parameters
        ----------
        table : ndarray of shape (n_nodes,) or (n_nodes, n_tables)
            Coefficients at the nodes.
        tip_speed_ratio : ndarray of shape (n_points,)
            Omega R / V of the disc.

        Returns
        -------
        values, slopes : ndarray of shape (n_points,) or (n_points, n_tables)
            Coefficients, and their slopes by the tip speed ratio.
        """
        points = np.asarray(tip_speed_ratio)
        inside = np.clip(points.real, self.nodes[0], self.nodes[-1])
        curve, beyond = self.curve(table), points - inside
        slope = curve(inside, 1)
        return curve(inside) + (slope.T * beyond).T, slope


class HermiteSpline(TorqueSpline):
    """The cubics that have given values and slopes at the nodes, linear beyond them: a C¹ function.

    A table has all values first, then all slopes: the basis is (n_points, 2 n_nodes).
    """

    @cached_property
    def _cardinal(self):
        values, slopes = np.split(np.eye(2 * self.nodes.size), 2)
        return CubicHermiteSpline(self.nodes, values, slopes)

    def slopes(self, values):
        """Return slopes at the nodes by which no value of a table leaves that of its neighbours.

        They are those of the natural spline, limited to three times the smaller one of the two
        differences beside a node, and none at an extremum (J. M. Hyman, Accurate monotonicity
        preserving cubic interpolation, SIAM J. Sci. Stat. Comput. 4, 1983).

        Parameters
        ----------
        values : ndarray of shape (n_nodes, n_tables)
            Values at the nodes.

        Returns
        -------
        ndarray of shape (n_nodes, n_tables)
            The slopes.
        """
        smooth = CubicSpline(self.nodes, values, bc_type="natural")(self.nodes, 1)
        between = np.diff(values, axis=0) / np.diff(self.nodes)[:, None]
        before, after = np.vstack((between[:1], between)), np.vstack((between, between[-1:]))
        most = 3.0 * np.minimum(np.maximum(before, 0.0), np.maximum(after, 0.0))
        least = 3.0 * np.maximum(np.minimum(before, 0.0), np.minimum(after, 0.0))
        return np.clip(smooth, least, most)
