"""Radau IIA for the steps of a window together: five stages, order 9, L-stable.

Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.8. The steps of a window
are solved at once by Newton's method, so that the equation sees arrays.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import Legendre
from scipy.interpolate import PPoly

STAGES = 5
MOST_ITERATIONS = 12  # of Newton's method
SAME_SLOPE = 1e-4  # relative change of the values below which the slopes are kept


def _method() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the method's nodes (0 first), matrix and error weights."""
    legendre = Legendre.basis(STAGES) - Legendre.basis(STAGES - 1)
    nodes = 0.5 + 0.5 * np.sort(legendre.roots().real)
    orders = np.arange(1.0, STAGES + 1.0)
    powers = nodes[:, None] ** (orders - 1.0)
    matrix = (nodes[:, None] ** orders / orders) @ np.linalg.inv(powers)
    eigenvalues = np.linalg.eigvals(matrix)
    first = eigenvalues[np.argmin(np.abs(eigenvalues.imag))].real
    # less the embedded quadrature of order STAGES with the weight `first` at the step's start
    error = np.linalg.solve(powers.T, 1.0 / orders - first * (orders == 1.0)) - matrix[-1]
    return np.append(0.0, nodes), matrix, np.append(first, error)


NODES, MATRIX, ERROR = _method()
"""Nodes of a step with its begin first, (6,); matrix of the stages, (5, 5); error weights, (6,)."""
_STAGE_ERROR = ERROR[1:] @ np.linalg.inv(MATRIX)


def through(edges: np.ndarray, places: np.ndarray, values: np.ndarray) -> PPoly:
    """Return the polynomials through values[piece, place, ...] at places (0 to 1) of pieces."""
    values = np.moveaxis(values, 1, 0)
    powers = np.linalg.solve(np.vander(places), values.reshape(places.size, -1))
    step = np.diff(edges) ** np.arange(places.size)[::-1, None]
    step = step.reshape(step.shape + (1,) * (values.ndim - 2))
    return PPoly(powers.reshape(values.shape) / step, edges)


def divided(edges: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Return the edges of pieces that are each divided into a number of equal parts."""
    number = np.arange(np.sum(parts)) - np.repeat(np.cumsum(parts) - parts, parts)
    left = np.repeat(edges[:-1], parts) + number * np.repeat(np.diff(edges) / parts, parts)
    return np.append(left, edges[-1])


def magnitudes(values: np.ndarray) -> np.ndarray:
    """Return the magnitudes to which errors of the first value, and of others, are compared.

    Others than the first may pass through zero: each is compared to its largest value.
    """
    size = np.maximum(np.abs(values), 1e-3)
    size[..., 1:] = np.max(size[..., 1:], axis=tuple(range(values.ndim - 1)))
    return size


def solve_stages(
    rates_at: Callable[[np.ndarray], np.ndarray],
    slope_at: Callable[[np.ndarray, np.ndarray], np.ndarray],
    start: np.ndarray,
    step: np.ndarray,
    stages: np.ndarray,
    enough: float,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Solve the stages of successive steps by Newton's method.

    Parameters
    ----------
    rates_at : callable
        Takes the values at the stages, (n_steps, 5, n_values), and returns their rates.
    slope_at : callable
        Takes values and rates, and returns the rates' derivatives by the values of the same stage,
        (n_steps, 5, n_values, n_values).
    start : array
        Values at the begin of the first step, (n_values,).
    step : array
        Lengths of the steps, (n_steps, 1).
    stages : array
        Guess of the values at the stages.
    enough : float
        Relative change of the values at which they count as found.

    Returns
    -------
    tuple or None
        Values at the stages, and the slopes; None if the method does not converge.
    """
    change, n = np.inf, start.size
    for _ in range(MOST_ITERATIONS):
        size = magnitudes(stages)
        rates = rates_at(stages)
        if change > SAME_SLOPE:
            slope = slope_at(stages, rates)
            if not np.all(np.isfinite(slope)):
                return None
            # rows and columns of the system: the values of the first stage, of the second, …
            system = np.einsum("n,ij,njab->niajb", step[:, 0], MATRIX, slope)
            system = np.eye(STAGES * n) - system.reshape(-1, STAGES * n, STAGES * n)
            inverse = np.linalg.inv(system)
            # of the stages by the values at the step's start
            gain = inverse.reshape(-1, STAGES, n, STAGES, n).sum(axis=3)
        begin = np.concatenate((start[None], stages[:-1, -1]))[:, None]
        miss = begin + step[..., None] * np.einsum("ij,nja->nia", MATRIX, rates) - stages
        own = np.einsum("nij,nj->ni", inverse, miss.reshape(-1, STAGES * n)).reshape(miss.shape)
        carried = [np.zeros(n)]  # change of the values from step to step
        for shift, factor in zip(own[:, -1], gain[:, -1], strict=True):
            carried.append(shift + factor @ carried[-1])
        correction = own + np.einsum("niab,nb->nia", gain, np.array(carried[:-1]))
        stages = stages + correction
        change = np.max(np.abs(correction) / size)
        if change <= enough:
            return stages, slope
        if not np.all(np.isfinite(stages)):
            return None
    return None


def step_errors(
    step: np.ndarray, begin: np.ndarray, stages: np.ndarray, first: np.ndarray, slope: np.ndarray
) -> np.ndarray:
    """Return the largest relative error of each step, by the embedded formula, (n_steps,).

    Parameters
    ----------
    step : array
        Lengths of the steps, (n_steps, 1).
    begin, first : array
        Values and rates at the begin of the steps, (n_steps, 1, n_values) and (n_steps, n_values).
    stages, slope : array
        What `solve_stages` returns.
    """
    off = ERROR[0] * step * first + np.einsum("nia,i->na", stages - begin, _STAGE_ERROR)
    filtered = np.eye(begin.shape[-1]) - step[:, :, None] * ERROR[0] * slope[:, 0]
    off = np.linalg.solve(filtered, off[..., None])[..., 0]
    return np.asarray(np.max(np.abs(off) / magnitudes(stages)[:, -1], axis=1))
