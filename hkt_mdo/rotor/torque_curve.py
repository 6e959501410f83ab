"""Torque coefficient over tip speed ratio: a table of a blade's, and a spline over it."""

from functools import cached_property, partial

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator, PPoly
from scipy.optimize.elementwise import find_root


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

    def basis(self, tip_speed_ratio):
        """Return the matrix (n_points, n_nodes) from a table to spline values.

        Parameters
        ----------
        tip_speed_ratio : ndarray of shape (n_points,)
            Omega R / V of the disc; it may be complex.

        Returns
        -------
        ndarray of shape (n_points, n_nodes)
            The matrix.
        """
        return self._at(self._cardinal, tip_speed_ratio)

    def curve(self, table):
        """Return the spline of a table as a function of tip speed ratios, maybe complex.

        Parameters
        ----------
        table : ndarray of shape (n_nodes,) or (n_nodes, n_tables)
            Coefficients at the nodes.

        Returns
        -------
        callable
            Returns (n_points,) or (n_points, n_tables).
        """
        return partial(self._at, self.pieces(table))

    def pieces(self, table):
        """Return the cubics of a table between its nodes.

        Parameters
        ----------
        table : ndarray of shape (n_nodes,) or (n_nodes, n_tables)
            Coefficients at the nodes, maybe complex.

        Returns
        -------
        scipy.interpolate.PPoly
            Over the tip speed ratio.
        """
        return PPoly.construct_fast(self._cardinal.c @ table, self.nodes)

    def _at(self, pieces, points):
        """Return cubics at points, linear beyond the nodes and in a complex step."""
        points = np.asarray(points)
        inside = np.clip(points.real, self.nodes[0], self.nodes[-1])
        values, beyond = pieces(inside), points - inside
        return values + (pieces(inside, 1).T * beyond.T).T if np.any(beyond) else values


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

        They are those of PCHIP: harmonic means of the two differences beside a node, and none at an
        extremum (F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5, 1984).

        Parameters
        ----------
        values : ndarray of shape (n_nodes, n_tables)
            Values at the nodes.

        Returns
        -------
        ndarray of shape (n_nodes, n_tables)
            The slopes.
        """
        return PchipInterpolator(self.nodes, values)(self.nodes, 1)


def last_fall(function, grid, above, *args):
    """Return where functions fall through zero for the last time on a grid.

    Parameters
    ----------
    function : callable
        Takes a place for each of the functions, (n,), and the arguments.
    grid : ndarray of shape (n_places,)
        Places, rising.
    above : ndarray of shape (n, n_places)
        Whether each function is at or above zero there.
    *args : ndarray of shape (n,)
        Of each function.

    Returns
    -------
    place : ndarray of shape (n,)
        A place of the grid where a function does not fall.
    falls : ndarray of shape (n,)
        Whether it does.
    """
    last = grid.size - 1 - np.argmax(above[:, ::-1], axis=1)
    falls = above.any(axis=1) & (last < grid.size - 1)
    root = find_root(function, (grid[last], grid[np.minimum(last + 1, grid.size - 1)]), args=args)
    # rounding may give both ends of a bracket one sign: the root is at its end
    return np.where(root.success, root.x, grid[last]), falls
