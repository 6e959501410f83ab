"""Base of the drivers: progress, sparse totals and the outcome, added to OpenMDAO's driver."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import openmdao.api as om
from openmdao.core.driver import Driver, DriverResult
from scipy.sparse import csr_matrix

Progress = Callable[[int, float, float], None]
"""Called with a count, the objective in its own units and the largest scaled violation."""


@dataclass(frozen=True)
class Outcome:
    """How an optimization ended, in the same words for every package."""

    success: bool
    """Whether the optimizer converged to the required tolerance, not to a looser one."""
    message: str
    """The optimizer's own words for how it ended."""
    iterations: int
    """Iterations, or gradient evaluations for pyoptsparse, which does not report iterations."""
    package: str
    """Package that carries the optimizer."""
    optimizer: str
    """Name of the optimizer."""


class ReportingDriver(Driver):
    """A driver that reports progress, and uses sparse totals where the model offers them."""

    package = optimizer = ""
    tolerance = 1e-7
    progress: Progress | None = None
    iterations = 0
    gap = 0.0
    """Share of the objective by which an optimum may be better than the end; 0 if it converged."""
    _message = "not run"
    _sparse: Any = None

    def outcome(self) -> Outcome:
        """Return how the last run ended.

        Returns
        -------
        Outcome
            Not a success if the driver has not run.
        """
        success, names = bool(self.result.success), (self.package, self.optimizer)
        return Outcome(success, self._message, self.iterations, *names)

    def _setup_driver(self, problem: om.Problem) -> None:
        super()._setup_driver(problem)
        # With a negative scaler, OpenMDAO scales lower and upper bound without exchanging them.
        for name, meta in [*self._designvars.items(), *self._cons.items()]:
            scaler = meta["total_scaler"]
            if meta.get("equals") is None and scaler is not None and np.any(np.less(scaler, 0.0)):
                raise ValueError(f"{name}: a negative ref or scaler would swap its bounds")

    def _prepare_totals(self, responses: Sequence[str]) -> None:
        """Use sparse totals, which need no coloring, if the model's linear solver offers them."""
        solver, self._sparse = self._problem().model.linear_solver, None
        if hasattr(solver, "totals"):
            self._sparse = solver.totals(self, responses)
            self._coloring_info.deactivate()

    @DriverResult.track_stats(kind="deriv")
    def _compute_sparse(self) -> csr_matrix:
        """Return the totals of all responses, scaled."""
        return self._sparse.compute()

    def _report(self, count: int) -> None:
        """Call `progress` with the current state of the model."""
        if self.progress is not None:
            objective = next(iter(self.get_objective_values(driver_scaling=False).values()))
            self.progress(count, float(objective[0]), self.violation())

    def violation(self) -> float:
        """Return the largest scaled violation of a constraint in the current state of the model.

        Returns
        -------
        float
            Over the references of the constraints; 0 if all are kept.
        """
        value, lower, upper = self._scaled("constraint")
        return float(np.max(np.maximum(lower - value, value - upper), initial=0.0))

    def _scaled(self, kind: str) -> np.ndarray:
        """Return value, lower and upper bound of each element of a kind, scaled, (3, n)."""
        # Bounds in the metadata are physical; the autoscaler has those in the optimizer's scale.
        vector, bounds = self._vectors[kind], self._autoscaler.get_bounds_scaling(kind)
        vector.update_from_model(self)
        rows = [np.zeros((3, 0))]
        for name, value in vector.items():
            low, high, equal = bounds[name].lower, bounds[name].upper, bounds[name].equals
            if equal is not None:
                low = high = equal
            low, high = -np.inf if low is None else low, np.inf if high is None else high
            rows.append(np.stack(np.broadcast_arrays(value, low, high)))
        return np.hstack(rows)
