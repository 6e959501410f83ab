"""Pairs of periodic curves over the angle of attack, which are cubic between equidistant knots."""

from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

# A polar on a 0.25 or 0.5 degree grid is interpolated exactly at its own points. A lookup is one
# multiplication instead of a search.
KNOTS_PER_DEGREE = 4


@lru_cache(maxsize=64)
def stacked(polars, name):
    """Return the curves of several polars in one array.

    Parameters
    ----------
    polars : tuple of Polar
        The polars.
    name : str
        coefficients or suction.

    Returns
    -------
    ndarray of shape (n_polars, n_knots, 8)
        Their curves.
    """
    return np.stack([getattr(polar, name) for polar in polars])


def curves_at(curves, alpha, which=()):
    """Return the values and the slopes (per rad) of two periodic curves at angles.

    Parameters
    ----------
    curves : ndarray of shape (..., n_knots, 8)
        Of `periodic_curves`, or several of them.
    alpha : float or ndarray
        Angle of attack (rad).
    which : tuple of ndarray
        Indices of the leading axes of `curves`, which broadcast with the angles.

    Returns
    -------
    values, slopes : ndarray of shape (2, *alpha.shape)
        The slopes are per rad.
    """
    n_knots = curves.shape[-2]
    step = 2.0 * np.pi / n_knots
    index = np.floor((np.real(alpha) + np.pi) / step).astype(int)
    row = np.moveaxis(curves[(*which, index % n_knots)], -1, 0)
    x, pairs = alpha + np.pi - index * step, (row[:4], row[4:])
    values = [a + x * (b + x * (c + x * d)) for a, b, c, d in pairs]
    slopes = [b + x * (2.0 * c + x * 3.0 * d) for _, b, c, d in pairs]
    return np.stack(values), np.stack(slopes)


def periodic_curves(alpha, *columns):
    """Return the coefficients of periodic curves through two columns.

    Parameters
    ----------
    alpha : ndarray of shape (n,)
        Angle of attack (rad) over one turn, increasing.
    *columns : ndarray of shape (n,)
        The same at both ends.

    Returns
    -------
    ndarray of shape (n_knots, 8)
        Of both curves from each knot to the next: value, slope, and the coefficients of the
        second and the third power of the angle (rad) from the knot.
    """
    n_knots = 360 * KNOTS_PER_DEGREE
    knots = np.linspace(-np.pi, np.pi, n_knots + 1)
    values = CubicSpline(alpha, np.column_stack(columns), bc_type="periodic")(knots)
    values[-1] = values[0]
    pieces = CubicSpline(knots, values, bc_type="periodic").c[::-1]
    return pieces.transpose(1, 2, 0).reshape(n_knots, -1)
