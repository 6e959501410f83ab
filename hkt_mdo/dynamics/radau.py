"""Radau IIA for many steps at once: five stages, order 9, L-stable.

Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.8. All steps of a window
of time are solved together by Newton's method, on arrays.
"""

import numpy as np
from numpy.polynomial import Legendre
from scipy.interpolate import PPoly

STAGES, ALL = 5, slice(None)  # of a step; steps


def _method() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the method's nodes (0 first), matrix and error weights."""
    legendre = Legendre.basis(STAGES) - Legendre.basis(STAGES - 1)
    nodes = 0.5 + 0.5 * np.sort(legendre.roots().real)
    orders = np.arange(1.0, STAGES + 1.0)
    powers = nodes[:, None] ** (orders - 1.0)
    matrix = (nodes[:, None] ** orders / orders) @ np.linalg.inv(powers)
    eigenvalues = np.linalg.eigvals(matrix)
    first = eigenvalues[np.argmin(np.abs(eigenvalues.imag))].real
    # minus the embedded quadrature of order STAGES, with the weight `first` at the step's start
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
    number = np.append(0, np.cumsum(parts.astype(int)))
    return np.interp(np.arange(number[-1] + 1), number, edges)


def magnitudes(values: np.ndarray, dense: int) -> np.ndarray:
    """Return the magnitudes to which errors of the first value, and of others, are compared.

    Others than the first may pass through zero: each is compared to its largest value, those beyond
    the first `dense`, which are of one kind, to the largest of all.
    """
    size = np.maximum(np.abs(values), 1e-3)
    size[..., 1:] = np.max(size[..., 1:], axis=tuple(range(values.ndim - 1)))
    size[..., dense:] = np.max(size[..., dense:], initial=0.0)
    return size


def begins(start: np.ndarray, stages: np.ndarray) -> np.ndarray:
    """Return the values at the begin of successive steps, (n_steps, 1, n_values), from the first's.

    stages are those at their stages, (n_steps, 5, n_values).
    """
    return np.concatenate((start[None], stages[:-1, -1]))[:, None]


class StageSystem:
    """The linear system of Newton's method, from which chains of filters are eliminated.

    Values are a few dense ones, then the first filter of every chain, then the second. Dense values
    follow each other and the last filters of the chains; a chain follows itself and the first dense
    value. What is left to invert has the dense values alone (Schur complement), so that the cost
    grows with the number of chains, not with its cube.

    Parameters
    ----------
    step : array
        Lengths of the steps, (n_steps, 1).
    dense : array
        Derivatives of the rates of dense values by these at the stages,
        (n_steps, n_stages, n_dense, n_dense).
    chains : sequence of array
        Derivatives of the same first dimensions: of dense values by last filters, (n_dense,
        n_chains); of filters by those of their chain, (n_filters, n_filters, n_chains), and by the
        first dense value, (n_filters, n_chains). Empty: there are no chains.
    matrix : array
        The method's; one of other stages serves for the errors.
    """

    def __init__(self, step, dense, chains=(), matrix=MATRIX):
        self._step, self._slopes, h = step, (dense, *chains), step[..., None] * matrix
        (steps, s, n, _), none = dense.shape, ((dense.shape[2], 0), (1, 1, 0), (1, 0))
        by_last, chain, by_first = chains or (np.empty((steps, s, *shape)) for shape in none)
        c, m = chain.shape[-2:]
        self._shape = steps, s, n, c, m
        # filters at the stages by what they miss and by the first dense value there
        by_chain = np.einsum("nij,njabm->nmaibj", h, chain).reshape(steps, m, c * s, c * s)
        first = np.einsum("nij,njam->nmaij", h, by_first).reshape(steps, m, c * s, s)
        self._chain = np.linalg.inv(np.eye(c * s) - by_chain)
        self._by_first = self._chain @ first
        self._by_last = np.einsum("nij,njdm->nidmj", h, by_last).reshape(steps, s * n, m * s)
        system = np.einsum("nij,njde->nidje", h, dense).reshape(steps, s * n, s * n)
        system[..., ::n] += self._of_last(self._by_first)
        self._inverse = np.linalg.inv(np.eye(s * n) - system)

    def _of_last(self, chain, span=ALL):
        """Return the changes of the dense values at the stages by those of the last filters."""
        by_last, s = self._by_last[span], self._shape[1]
        return by_last @ chain[:, :, -s:].reshape(*by_last.shape[::2], chain.shape[-1])

    def _change(self, miss, span=ALL):
        """Return the change of some steps' stages with the values at their begins as they are."""
        (_, s, n, c, m), steps = self._shape, len(miss)
        if not m:  # products of nothing would take as long as the one that is needed
            return (self._inverse[span] @ miss.reshape(steps, s * n, 1)).reshape(miss.shape)
        dense, chain = miss[..., :n], miss[..., n:].reshape(steps, s, c, m)
        chain = self._chain[span] @ chain.transpose(0, 3, 2, 1).reshape(steps, m, c * s, 1)
        right_side = dense.reshape(steps, s * n, 1) + self._of_last(chain, span)
        dense = self._inverse[span] @ right_side
        chain = chain + self._by_first[span] @ dense[:, None, ::n]
        chain = chain.reshape(steps, m, c, s).transpose(0, 3, 2, 1).reshape(steps, s, c * m)
        return np.concatenate((dense.reshape(steps, s, n), chain), axis=-1)

    def correction(self, miss: np.ndarray) -> np.ndarray:
        """Return the change of the stages, (n_steps, 5, n_values), that makes up what they miss."""
        change, begin = np.empty_like(miss), 0.0
        for step in range(len(miss)):
            span = slice(step, step + 1)
            change[span] = self._change(miss[span] + begin, span)
            begin = change[step, -1]
        return change

    def filtered(self, off: np.ndarray) -> np.ndarray:
        """Return errors of the values, (n_steps, n_values), without their fast part."""
        dense, *chains = (slopes[:, :1] for slopes in self._slopes)
        return StageSystem(self._step, dense, chains, ERROR[:1, None])._change(off[:, None])[:, 0]

    def errors(self, begin: np.ndarray, stages: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Return the error of each step's values by the embedded formula, (n_steps, n_values).

        Parameters
        ----------
        begin, first : array
            Values and rates at the begin of the steps, (n_steps, 1, n_values) and
            (n_steps, n_values).
        stages : array
            Values at the stages of the steps, (n_steps, 5, n_values).
        """
        off = ERROR[0] * self._step * first
        return self.filtered(off + np.einsum("nia,i->na", stages - begin, _STAGE_ERROR))
