"""Sparse total derivatives of a model of explicit components, at a cost proportional to nonzeros.

OpenMDAO solves one linear system a color, through all components in Python, into a dense matrix,
and three for every design variable to find the colors.
"""

from collections.abc import Sequence

import numpy as np
import openmdao.api as om
from openmdao.core.driver import Driver
from openmdao.jacobians import jacobian as om_jacobian
from openmdao.matrices.coo_matrix import COOMatrix
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from hkt_mdo.compiled import compiled


class SparseTotals:
    """Total derivatives of a model of explicit components, by substitution in its sparse Jacobian.

    Such a model is a list of assignments y_i = f_i(y_j, j < i), so its totals follow row by row,

        dy_i/dx = sum over j of (df_i/dy_j) (dy_j/dx),

    over the nonzeros alone, whose positions follow from the declared partials: `pattern`, a
    csr_matrix of ones, shape (n_responses, n_design).

    Parameters
    ----------
    driver : openmdao.core.driver.Driver
        A driver after final setup.
    responses : sequence of str
        Names of its objective and constraints, in the order of the rows.
    """

    def __init__(self, driver: Driver, responses: Sequence[str]) -> None:
        self._model = driver._problem().model
        self._jacobian = om_jacobian.SplitJacobian(COOMatrix, self._model)
        partials = self._jacobian.get_dr_do_matrix()
        self._by_row = np.argsort(partials.row, kind="stable")
        counts = np.bincount(partials.row, minlength=partials.shape[0])
        chain = np.concatenate(([0], np.cumsum(counts))), partials.col[self._by_row]

        design = list(driver._designvars.items())
        functions = [(name, driver._responses[name]) for name in responses]
        seeds, rows = self._positions(design), self._positions(functions)
        graph = csr_matrix((np.ones(partials.nnz), *chain[::-1]), partials.shape)
        needed = np.isfinite(dijkstra(graph, indices=rows, unweighted=True, min_only=True))
        needed[seeds] = False
        # every row is a component of its own, and SciPy numbers it after those that it depends on
        order = np.argsort(connected_components(graph, connection="strong")[1])
        rank = np.argsort(order)
        if np.any(rank[graph.indices] > np.repeat(rank, np.diff(graph.indptr))):
            raise RuntimeError("parts of the model depend on each other in a circle")
        order = order[needed[order]]
        self._structure = order, *chain, *_total_pattern(order, seeds, *chain)

        *_, first, last, columns = self._structure
        counts = last[rows] - first[rows]
        ends = np.concatenate(([0], np.cumsum(counts)))
        of_row = np.repeat(np.arange(rows.size), counts)
        chosen = np.arange(ends[-1]) + (first[rows] - ends[:-1])[of_row]
        self._chosen = chosen[np.lexsort((columns[chosen], of_row))]
        entries = np.ones(ends[-1]), columns[self._chosen], ends
        self.pattern = csr_matrix(entries, (rows.size, seeds.size))
        scalers = self._scalers(functions)[of_row]
        self._entry_scalers = scalers / self._scalers(design)[self.pattern.indices]

    def compute(self) -> csr_matrix:
        """Return the totals in the current state of the model.

        Returns
        -------
        scipy.sparse.csr_matrix, shape (n_responses, n_design)
            Derivatives of the scaled responses with respect to the scaled design.
        """
        self._model.run_linearize(sub_do_ln=False)
        self._jacobian._update(self._model)
        order, indptr, indices, first, last, columns = self._structure
        partials = self._jacobian.get_dr_do_matrix().data[self._by_row]
        values = _substitute(order, indptr, indices, partials, first, last, columns)
        totals = self.pattern.copy()
        totals.data = values[self._chosen] * self._entry_scalers
        return totals

    def _positions(self, variables: list) -> np.ndarray:
        """Return the positions of variables' elements in the model's vector of outputs."""
        positions = [np.zeros(0, int)]
        for _, meta in variables:
            elements = np.arange(*self._model._outputs.get_range(meta["source"]))
            indices = meta["indices"]
            positions.append(elements if indices is None else elements[indices.flat()])
        return np.concatenate(positions)

    @staticmethod
    def _scalers(variables: list) -> np.ndarray:
        """Return the factors from variables to their values in the optimizer."""
        scalers = [np.zeros(0)]
        for _, meta in variables:
            scaler = 1.0 if meta["total_scaler"] is None else meta["total_scaler"]
            scalers.append(np.ones(meta["size"]) * scaler * (meta.get("unit_scaler") or 1.0))
        return np.concatenate(scalers)


class Substitution(om.LinearRunOnce):
    """OpenMDAO's linear solver for groups of explicit components, which also offers `totals`.

    The drivers of this package ask for them in place of linear solves and a coloring.
    """

    totals = SparseTotals


@compiled()
def _total_pattern(order, seeds, indptr, indices):
    """Return where totals may differ from zero: row i has the columns[first[i] : last[i]]."""
    first, last = np.zeros(indptr.size - 1, np.int64), np.zeros(indptr.size - 1, np.int64)
    columns, last_row = np.arange(seeds.size), np.full(seeds.size, -1)  # last_row[column] of totals
    for count, row in enumerate(seeds):
        first[row], last[row] = count, count + 1
    count = seeds.size
    for row in order:
        first[row] = count
        for entry in range(indptr[row], indptr[row + 1]):
            source = indices[entry]
            if source == row:
                continue
            for position in range(first[source], last[source]):
                column = columns[position]
                if last_row[column] != row:
                    last_row[column] = row
                    if count == columns.size:
                        columns = np.append(columns, columns)
                    columns[count] = column
                    count += 1
        last[row] = count
    return first, last, columns[:count].copy()


@compiled()
def _substitute(order, indptr, indices, partials, first, last, columns):
    """Return the totals at the positions of `_total_pattern`."""
    totals, sums = np.ones(columns.size), np.zeros(columns.size)
    for row in order:
        for entry in range(indptr[row], indptr[row + 1]):
            source, partial = indices[entry], partials[entry]
            if source != row:
                for position in range(first[source], last[source]):
                    sums[columns[position]] += partial * totals[position]
        for position in range(first[row], last[row]):
            totals[position] = sums[columns[position]]
            sums[columns[position]] = 0.0
    return totals
