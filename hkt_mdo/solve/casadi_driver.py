"""IPOPT in CasADi's wheels as an OpenMDAO driver."""

import os
import signal
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
import openmdao.api as om
from openmdao.core.driver import RecordingDebugging
from scipy.sparse import csc_matrix

from hkt_mdo.errors import handling
from hkt_mdo.solve.driver_base import ReportingDriver
from hkt_mdo.solve.stationary import Stationary

Settings = dict[str, str | int | float]
"""An optimizer's options by its own names."""

_FEATURES = (
    *("optimization", "gradients", "simultaneous_derivatives"),
    *("inequality_constraints", "equality_constraints", "two_sided_constraints"),
)
"""What the driver supports, in OpenMDAO's names."""
STUCK = "Error_In_Step_Computation", "Restoration_Failed", "Search_Direction_Becomes_Too_Small"
"""Ends of IPOPT where it finds no step: after an optimum as of `Stationary`, which then is the end,
as of `sine_oloc` with the kernels of Sandybridge."""


class CasadiIpoptDriver(ReportingDriver):
    """IPOPT in CasADi, with first derivatives from OpenMDAO.

    The sparsity of the derivatives comes from sparse totals or a coloring; without both they are
    dense. An `AnalysisError` or a value that is not finite makes IPOPT shorten its step; any other
    error of the model or of `progress` is raised by `run`. `opt_settings` has IPOPT's own names
    (https://coin-or.github.io/Ipopt/OPTIONS.html).

    Parameters
    ----------
    **kwargs
        Options of the driver.
    """

    package = "casadi"

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        self.supports.update({name: name in _FEATURES for name in self.supports})
        self.opt_settings: Settings = {}
        self._error: BaseException | None = None
        self._gradients: tuple[np.ndarray, np.ndarray] | None = None

    def _get_name(self) -> str:
        return "CasadiIpopt"

    def run(self) -> bool:
        """Optimize, and leave the model at IPOPT's solution.

        Returns
        -------
        bool
            Whether the optimization failed.
        """
        self.result.reset()
        self.iter_count = self.iterations = 0
        self._message, self._error = "stopped by an error", None
        self._total_jac = self._total_jac_linear = None
        self._prepare_totals(self._get_ordered_nl_responses())
        self._check_for_missing_objective()
        self._check_for_invalid_desvar_values()

        design = np.concatenate(list(self.get_design_var_values().values()))
        # Coloring needs a model that has run.
        self._evaluate_anew(design)
        self._problem().get_total_coloring(self._coloring_info, run_model=False)
        with ExitStack() as interrupts:  # what their handlers raise, CasADi would swallow
            for number in (signal.SIGINT, signal.SIGTERM):
                if callable(handler := signal.getsignal(number)):
                    stored = partial(self._guarded, handler, None)
                    interrupts.enter_context(handling(number, stored))
            design, status = self._solve(design)
        # IPOPT's solution need not be the last design evaluated; the last case is the optimum.
        self._evaluate_anew(design)
        self._message, self.iterations = status["return_status"], status["iter_count"]
        if self._message == "User_Requested_Stop":  # by `_end_iteration`: an error has been raised
            self.gap = self._stationary.gap
            self._message = f"no better iterate, at an optimum within {self.gap:.1e}"
            return False
        return self._message != "Solve_Succeeded"

    def _solve(self, start: np.ndarray) -> tuple[np.ndarray, dict]:
        """Return the scaled design where IPOPT ended and CasADi's statistics of the run."""
        import casadi

        # IPOPT's own OpenBLAS, which is loaded here and which threadpoolctl does not know: its
        # threads took a third more time of two cores, waiting for each other
        with patch.dict(os.environ, OPENBLAS_NUM_THREADS="1"):
            casadi.has_nlpsol("ipopt")

        _, lower, upper = self._scaled("design_var")
        _, lower_g, upper_g = self._scaled("constraint")
        self._pattern = pattern = self._jacobian_pattern((lower_g.size, start.size))
        starts, rows = pattern.indptr.tolist(), pattern.indices.tolist()
        jacobian = casadi.Sparsity(lower_g.size, start.size, starts, rows)
        x, f, g = (casadi.Sparsity.dense(size) for size in (start.size, 1, lower_g.size))
        p = casadi.Sparsity(0, 0)  # there are no parameters

        def objective_gradient(point, _):
            return self._evaluate(point)[0], self._differentiate(point)[0]

        def constraint_jacobian(point, _):
            return self._evaluate(point)[1], casadi.DM(jacobian, self._differentiate(point)[1])

        bounds = np.append(lower, lower_g), np.append(upper, upper_g)
        self._stationary = Stationary(*bounds, float(self.opt_settings.get("tol", 1e-8)), start)

        # CasADi keeps no reference to a callback: these names must outlive the solver.
        values = _callback("values", self._evaluate, [x], [f, g])
        grad_f = _callback("grad_f", objective_gradient, [x, p], [f, x])
        jac_g = _callback("jac_g", constraint_jacobian, [x, p], [g, jacobian])
        iteration = _callback("iteration", self._end_iteration, [x, f, g, x, g, p], [f])
        point = casadi.MX.sym("x", x)
        nlp = dict(zip("xfg", (point, *values(point)), strict=True))
        solver = casadi.nlpsol("solver", "ipopt", nlp, {
            "grad_f": grad_f, "jac_g": jac_g, "iteration_callback": iteration,
            # Multipliers of parameters, of which there are none, would need reverse derivatives.
            "no_nlp_grad": True, "calc_lam_p": False,
            "print_time": False, "show_eval_warnings": False, "ipopt": self.opt_settings,
        })  # fmt: skip
        solution = solver(x0=start, lbx=lower, ubx=upper, lbg=lower_g, ubg=upper_g)
        status, best = solver.stats(), self._stationary.best
        if status["return_status"] in STUCK and best is not None:
            status["return_status"] = "User_Requested_Stop"
        ends = status["return_status"] == "User_Requested_Stop" and self._error is None
        return best if ends and best is not None else np.array(solution["x"]).ravel(), status

    def _get_ordered_nl_responses(self) -> list[str]:
        """Return all responses: linear constraints are treated as nonlinear ones."""
        return [*self._objs, *self._cons]

    def _jacobian_pattern(self, shape: tuple[int, int]) -> csc_matrix:
        """Return where the constraints' derivatives may differ from zero, column by column."""
        if self._sparse is not None:
            pattern = self._sparse.pattern[1:]  # row 0 is the objective
            pattern.data = np.arange(self._sparse.pattern.indptr[1], self._sparse.pattern.nnz)
            return pattern.tocsc()  # its data are positions in the totals' data
        coloring = self._coloring_info.coloring
        return csc_matrix(np.ones(shape) if coloring is None else coloring.get_dense_sparsity()[1:])

    def _evaluate_anew(self, point: np.ndarray) -> None:
        """Run the model at a scaled design outside CasADi, or raise the error that is stored."""
        self._design = np.zeros(0)
        self._evaluate(point)
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _evaluate(self, point: np.ndarray) -> tuple[float, np.ndarray]:
        """Return objective and constraints at a scaled design, running the model if it is new."""
        if not np.array_equal(point, self._design):
            self._design, self._gradients = point.copy(), None
            nothing = np.full_like(self._vectors["constraint"].asarray(), np.nan)
            self._values = self._guarded(self._run_model, (np.nan, nothing), point)
        return self._values

    def _run_model(self, point: np.ndarray) -> tuple[float, np.ndarray]:
        """Return objective and constraints at a scaled design, and record the case."""
        model = self._problem().model
        self._vectors["design_var"].set_data(point, driver_scaling=True)
        self._set_design_vars(driver_scaling=True)
        with RecordingDebugging(self._get_name(), self.iter_count, self):
            self.iter_count += 1
            with model._relevance.nonlinear_active("iter"):
                self._run_solve_nonlinear()
        objective = next(iter(self.get_objective_values().values()))[0]
        return objective, np.concatenate([*self.get_constraint_values().values(), np.zeros(0)])

    def _differentiate(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return gradient and constraint derivatives at a scaled design, reusing those last found.

        The latter are in the order of the pattern, column by column.
        """
        objective, _ = self._evaluate(point)
        if self._gradients is None:
            self._gradients = np.full(point.size, np.nan), np.full(self._pattern.nnz, np.nan)
            if np.isfinite(objective):
                self._gradients = self._guarded(self._differentiate_model, self._gradients)
        return self._gradients

    def _differentiate_model(self) -> tuple[np.ndarray, np.ndarray]:
        """Return gradient and constraint derivatives in the model's state, as `_differentiate`."""
        if self._sparse is not None:
            totals = self._compute_sparse()
            return totals[0].toarray().ravel(), totals.data[self._pattern.data]
        responses = self._get_ordered_nl_responses()
        totals = self._compute_totals(responses, list(self._designvars), "array")
        rows, columns = self._pattern.tocoo().coords
        return totals[0].copy(), totals[1:][rows, columns]

    def _end_iteration(self, design, _, constraints, of_design, of_constraints, *__) -> tuple[int]:
        """Report an iteration, count it and return whether IPOPT must stop.

        Arguments are CasADi's: objective and parameters are not needed; `of_design` and
        `of_constraints` are the multipliers of the bounds.
        """
        self._guarded(self._report, None, self.iterations)
        self.iterations += 1
        objective, _ = self._evaluate(design)
        gradient, slopes = self._differentiate(design)
        pattern = self._pattern
        by = csc_matrix((slopes, pattern.indices, pattern.indptr), shape=pattern.shape)
        lagrangian = gradient + by.T @ of_constraints + of_design
        multipliers = np.append(of_design, of_constraints)
        values = np.append(design, constraints)
        ends = self._stationary.note(values, multipliers, objective, lagrangian)
        return (int(ends or self._error is not None),)

    def _guarded(self, work: Callable, otherwise: Any, *arguments: Any) -> Any:
        """Return what `work` returns, or `otherwise` if it fails or an error is stored already.

        CasADi would take any error, even an interrupt, for a failed evaluation. It is therefore
        stored until IPOPT has stopped; an `AnalysisError` is a failed evaluation and is not.
        """
        if self._error is None:
            try:
                return work(*arguments)
            except om.AnalysisError:
                self._problem().model._clear_iprint()
            except BaseException as error:
                self._error = error
        return otherwise


def _callback(name: str, function: Callable, inputs: list, outputs: list) -> Any:
    """Return `function` of flat arrays as a CasADi function of inputs and outputs, by sparsity."""
    import casadi

    class Callback(casadi.Callback):
        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.construct(name, {})

        def get_n_in(self) -> int:
            return len(inputs)

        def get_n_out(self) -> int:
            return len(outputs)

        def get_sparsity_in(self, i: int) -> Any:
            return inputs[i]

        def get_sparsity_out(self, i: int) -> Any:
            return outputs[i]

        def eval(self, arguments: Sequence) -> list:
            return list(function(*(np.array(argument).ravel() for argument in arguments)))

    return Callback()
