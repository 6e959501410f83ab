"""The one place where an optimizer is chosen, configured and asked how it fared.

IPOPT comes with pyoptsparse or inside CasADi's wheels, SLSQP with pyoptsparse or SciPy. Whichever
carries it, an optimizer is set up the same way, stops at the same tolerance, writes nothing that
was not asked for and reports through `outcome`.
"""

from __future__ import annotations

import importlib
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import numpy as np
import openmdao.api as om
from openmdao.core.driver import Driver, DriverResult, RecordingDebugging
from scipy.sparse import csc_matrix, csr_matrix

from hkt_mdo.errors import InputError

if TYPE_CHECKING:
    import casadi

__all__ = ["CasadiIpoptDriver", "Outcome", "Progress", "make_driver", "outcome"]

Progress = Callable[[int, float, float], None]
"""Called with a count, the objective in its own units and the largest scaled violation."""

CARRIERS = {
    "IPOPT": ("pyoptsparse", "casadi"),
    "SLSQP": ("pyoptsparse", "scipy"),
    "SNOPT": ("pyoptsparse",),
}
"""The packages that carry each optimizer, the preferred one first."""

REMEDIES = {
    "pyoptsparse": "conda install -c conda-forge pyoptsparse",
    "casadi": "pip install casadi",
    "scipy": "pip install scipy",
}


@dataclass(frozen=True)
class Outcome:
    """How an optimization ended, in the same words for every package."""

    success: bool
    """Whether the optimizer converged to the tolerance asked for, and to nothing looser."""
    message: str
    """The optimizer's own words for how it ended."""
    iterations: int
    """Iterations; where pyoptsparse keeps them to itself, gradient evaluations instead."""
    package: str
    """The package that carried the optimizer: pyoptsparse, casadi or scipy."""
    optimizer: str
    """The optimizer's name."""


def outcome(driver: Driver) -> Outcome:
    """Return how the last run of a driver ended.

    Parameters
    ----------
    driver : Driver
        A driver that came from `make_driver`.

    Raises
    ------
    TypeError
        Where the driver is of another kind.
    """
    if not isinstance(driver, _ReportingDriver):
        raise TypeError(f"{type(driver).__name__} is not a driver from make_driver")
    return Outcome(
        success=bool(driver.result.success),
        message=driver.get_exit_status(),
        iterations=driver.iterations,
        package=driver.package,
        optimizer=driver.options["optimizer"],
    )


def make_driver(
    package: str = "auto",
    optimizer: str = "IPOPT",
    tolerance: float = 1e-7,
    max_iterations: int = 1000,
    *,
    hessian_memory: int = 60,
    ipopt_options: dict[str, str | int | float] | None = None,
    print_file: str | Path | None = None,
    progress: Progress | None = None,
) -> Driver:
    """Return a driver for the optimizer, from the package asked for or the first one installed.

    Parameters
    ----------
    package : {'auto', 'pyoptsparse', 'casadi', 'scipy'}
        What carries the optimizer; 'auto' prefers pyoptsparse.
    optimizer : {'IPOPT', 'SLSQP', 'SNOPT'}
        The optimizer's name.
    tolerance : float
        Convergence tolerance on the scaled problem.
    max_iterations : int
        Iterations after which the optimizer gives up.
    hessian_memory : int
        Number of steps from which IPOPT estimates curvature.
    ipopt_options : dict, optional
        Options by IPOPT's own names, over the ones chosen here; pyoptsparse wants a float for a
        number option, an int for an integer one.
    print_file : path, optional
        Where the optimizer writes its own log, if it has one; nowhere by default.
    progress : callable, optional
        Called at each iteration of IPOPT in CasADi, after each evaluation elsewhere, as
        ``progress(count, objective, infeasibility)``.

    Raises
    ------
    InputError
        Where the optimizer or package is unknown, or is not installed.
    """
    if ipopt_options and optimizer != "IPOPT":
        raise InputError("ipopt_options are for IPOPT", value=optimizer)
    carrier = _carrier(package, optimizer)
    print_file = "" if print_file is None else str(print_file)
    settings: dict[str, str | int | float]
    if optimizer == "IPOPT":
        settings = {
            "hessian_approximation": "limited-memory",
            "limited_memory_max_history": hessian_memory,
            # The start is feasible and near the optimum: stay near it, and near the constraints.
            "mu_init": 1e-3,
            "theta_max_fact": 1.0,
            "tol": float(tolerance),
            "constr_viol_tol": float(tolerance),
            # 'Acceptable' is looser than the tolerance asked for.
            "acceptable_iter": 0,
            "max_iter": max_iterations,
            # The problem is scaled where its quantities are declared.
            "nlp_scaling_method": "none",
            # Bounds hold, rather than nearly hold.
            "bound_relax_factor": 0.0,
            "honor_original_bounds": "yes",
            "print_level": 0,
            "sb": "yes",
            "output_file": print_file,
        }
        settings.update(ipopt_options or {})
    elif optimizer == "SLSQP":
        settings = {
            "ACC": float(tolerance),
            "MAXIT": max_iterations,
            "IPRINT": 1 if print_file else -1,
            "IFILE": print_file,
        }
    else:
        settings = {
            "Major optimality tolerance": float(tolerance),
            "Major feasibility tolerance": float(tolerance),
            "Major iterations limit": max_iterations,
            "iPrint": 18 if print_file else 0,
            "iSumm": 0,
            "Print file": print_file,
        }

    if carrier == "casadi":
        driver = CasadiIpoptDriver(progress=progress)
        driver.opt_settings = settings
    elif carrier == "scipy":
        driver = _ScipyDriver(progress=progress, optimizer=optimizer, disp=False)
        driver.options["tol"] = tolerance
        driver.options["maxiter"] = max_iterations
        driver.tolerance = tolerance
    else:
        driver = _PyOptSparseDriver(progress=progress, optimizer=optimizer, print_results=False)
        driver.options["output_dir"] = "."  # unused, but the default would create a directory
        driver.opt_settings = _FirstWins(settings)
        driver.tolerance = tolerance
    return driver


def _carrier(package: str, optimizer: str) -> str:
    """Return the installed package that is to carry an optimizer."""
    if optimizer not in CARRIERS:
        raise InputError("unknown optimizer", f"choose from {', '.join(CARRIERS)}", value=optimizer)
    candidates = CARRIERS[optimizer] if package == "auto" else (package,)
    for candidate in candidates:
        if candidate not in CARRIERS[optimizer]:
            raise InputError(
                f"this package does not carry {optimizer}",
                f"choose from auto, {', '.join(CARRIERS[optimizer])}",
                value=package,
            )
        if _is_usable(candidate, optimizer):
            return candidate
    remedies = " or ".join(REMEDIES[candidate] for candidate in candidates)
    raise InputError(f"{optimizer} is not installed", remedies, key="driver.package", value=package)


def _is_usable(package: str, optimizer: str) -> bool:
    """Return whether a package is installed and, for pyoptsparse, was built with the optimizer."""
    if find_spec(package) is None:
        return False
    if package == "pyoptsparse":
        try:
            getattr(importlib.import_module(package), optimizer)()
        except Exception:  # a missing library shows in as many ways as there are optimizers
            return False
    return True


class _FirstWins(dict):
    """Settings that keep their first value: OpenMDAO's driver would overwrite the print file."""

    __setitem__ = dict.setdefault


class _ReportingDriver(Driver):
    """What the drivers here add to OpenMDAO's: progress, counts and the optimizer's last words."""

    package = ""
    iterations = 0
    _message = "not run"
    _sparse: Any = None

    @property
    def model_evaluations(self) -> int:
        """Number of times the model was run."""
        return self.result.model_evals

    @property
    def gradient_evaluations(self) -> int:
        """Number of times the total derivatives were computed."""
        return self.result.deriv_evals

    def get_exit_status(self) -> str:
        """Return the optimizer's own words for how it ended."""
        return self._message

    def _declare_options(self) -> None:
        super()._declare_options()
        self.options.declare(
            "progress",
            default=None,
            recordable=False,
            check_valid=_check_callable,
            desc="called with a count, the objective and the largest scaled violation",
        )

    def _setup_driver(self, problem: om.Problem) -> None:
        super()._setup_driver(problem)
        # OpenMDAO scales a bound by a negative number without making lower upper: the optimizer
        # would hold x <= 1 where x >= 1 was asked for.
        for name, meta in [*self._designvars.items(), *self._cons.items()]:
            scaler = meta["total_scaler"]
            if meta.get("equals") is None and scaler is not None and np.any(np.less(scaler, 0.0)):
                raise ValueError(f"{name}: a negative ref or scaler would swap its bounds")

    def _prepare_totals(self, responses: Sequence[str]) -> None:
        """Ask the model whether it knows its totals to be sparse; if so, no coloring is needed."""
        solver, self._sparse = self._problem().model.linear_solver, None
        if hasattr(solver, "totals"):
            try:
                self._sparse = solver.totals(self, responses)
            except (NotImplementedError, AttributeError):
                # a part that is not explicit, or an OpenMDAO with other insides: its own way
                return
            self._coloring_info.deactivate()

    @DriverResult.track_stats(kind="deriv")
    def _compute_sparse(self) -> csr_matrix:
        """Return the totals of all responses, scaled."""
        return self._sparse.compute()

    def _report(self, count: int) -> None:
        """Tell `progress` the state of the model as it stands."""
        progress = self.options["progress"]
        if progress is not None:
            objective = next(iter(self.get_objective_values(driver_scaling=False).values()))
            progress(count, float(objective[0]), self._violation())

    def _violation(self) -> float:
        """Return the largest scaled violation of a constraint in the model as it stands."""
        values = self.get_constraint_values()
        lower, upper = self._bounds("constraint", values)
        value = np.concatenate([*values.values(), np.zeros(0)])
        return float(np.max(np.maximum(lower - value, value - upper), initial=0.0))

    def _bounds(self, kind: str, values: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return the lower and upper bound of each element of `values`, scaled as they are."""
        # Bounds in the metadata are physical; the autoscaler has those in the optimizer's scale.
        bounds = self._autoscaler.get_bounds_scaling(kind)
        lower, upper = [np.zeros(0)], [np.zeros(0)]
        for name, value in values.items():
            low, high, equal = bounds[name].lower, bounds[name].upper, bounds[name].equals
            if equal is not None:
                low = high = equal
            lower.append(np.full(value.size, -np.inf if low is None else low))
            upper.append(np.full(value.size, np.inf if high is None else high))
        return np.concatenate(lower), np.concatenate(upper)


def _check_callable(name: str, value: object) -> None:
    """Refuse a `progress` that cannot be called."""
    if value is not None and not callable(value):
        raise TypeError(f"{name} must be callable")


class _ReportEachEvaluation(_ReportingDriver):
    """What the packages that OpenMDAO knows need: progress by model runs, and less credulity."""

    tolerance = 1e-7

    def _run_solve_nonlinear(self) -> None:
        super()._run_solve_nonlinear()
        self._report(self.result.model_evals)

    def _judge(self, converged: bool, message: str) -> bool:
        """Return whether the run failed, as it also has where its design is infeasible."""
        self._message = message
        # SLSQP may report success where it stalled far from feasible. An honest end is no further
        # off than the relaxed test that SLSQP makes, ten tolerances.
        violation = self._violation()
        if converged and not violation <= 10.0 * self.tolerance:
            self._message += f" (but constraints are violated by {violation:.2g}, scaled)"
            converged = False
        self.fail = not converged
        return self.fail


class _ScipyDriver(_ReportEachEvaluation, om.ScipyOptimizeDriver):
    """OpenMDAO's SciPy driver, left at the optimum rather than at its last trial."""

    package = "scipy"

    def run(self) -> bool:
        """Optimize and return whether that failed."""
        self._message = "stopped by an error"
        nonlinear = [name for name, meta in self._cons.items() if not meta["linear"]]
        self._rows = [*self._objs, *nonlinear]
        self._prepare_totals(self._rows)
        super().run()
        result = self._scipy_optimize_result
        self.iterations = result.nit
        self._objfunc(result.x)
        if self._exc_info is not None:
            self._reraise()
        return self._judge(result.success, result.message)

    def _compute_totals(self, of=None, wrt=None, return_format="array", driver_scaling=True):
        if self._sparse is not None and of == self._rows:
            return self._compute_sparse().toarray()
        return super()._compute_totals(of, wrt, return_format, driver_scaling)


class _PyOptSparseDriver(_ReportEachEvaluation, om.pyOptSparseDriver):
    """OpenMDAO's pyoptsparse driver that obeys an interrupt and takes nothing but 0 for success."""

    package = "pyoptsparse"

    def run(self) -> bool:
        """Optimize and return whether that failed."""
        self._message = "stopped by an error"
        self._user_termination_flag = False
        handler = signal.getsignal(signal.SIGINT)
        try:
            super().run()
        finally:  # OpenMDAO puts the handler back only where nothing was raised
            signal.signal(signal.SIGINT, handler)
        self.iterations = self.result.deriv_evals
        # OpenMDAO counts IPOPT's 'acceptable' and more of SLSQP's codes as success.
        inform = self.pyopt_solution.optInform
        converged = 1 if self.options["optimizer"] == "SNOPT" else 0
        return self._judge(inform["value"] == converged, inform["text"])

    def _objfunc(self, design: dict) -> tuple[dict, int]:
        return self._unless_interrupted(super()._objfunc(design))

    def _gradfunc(self, design: dict, functions: dict) -> tuple[dict, int]:
        return self._unless_interrupted(super()._gradfunc(design, functions))

    def _unless_interrupted(self, answer: tuple[dict, int]) -> tuple[dict, int]:
        # OpenMDAO hands an interrupt to the optimizer as a failed evaluation, which SLSQP ignores.
        if self._user_termination_flag:
            raise KeyboardInterrupt
        return answer

    def _signal_handler(self, signum: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt


class CasadiIpoptDriver(_ReportingDriver):
    """IPOPT as CasADi's wheels carry it, with first derivatives from OpenMDAO.

    Linear constraints are differentiated once. A coloring of the total derivatives also tells IPOPT
    their sparsity; without one they are dense. An `AnalysisError` or a value that is not finite
    makes IPOPT shorten its step.

    Parameters
    ----------
    **kwargs : dict
        Values of the driver's options.

    Attributes
    ----------
    opt_settings : dict
        IPOPT's options by IPOPT's names.
    iterations : int
        Iterations of the last run.
    """

    package = "casadi"

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        for feature in (
            "optimization", "gradients", "inequality_constraints", "equality_constraints",
            "two_sided_constraints", "linear_constraints", "simultaneous_derivatives",
        ):  # fmt: skip
            self.supports[feature] = True
        for feature in ("integer_design_vars", "distributed_design_vars"):
            self.supports[feature] = False
        self.supports._read_only = True
        self.opt_settings: dict[str, str | int | float] = {}
        self._total_jac_format = "array"
        self._error: BaseException | None = None

    def _declare_options(self) -> None:
        super()._declare_options()
        self.options.declare("optimizer", default="IPOPT", values=["IPOPT"], desc="the optimizer")

    def _get_name(self) -> str:
        return "CasadiIpopt"

    def run(self) -> bool:
        """Optimize and return whether that failed.

        Raises
        ------
        Exception
            Whatever the model or `progress` raised, except `AnalysisError`.
        """
        self.result.reset()
        self.iter_count = self.iterations = 0
        self._message, self._error = "stopped by an error", None
        self._total_jac = self._total_jac_linear = None
        self._prepare_totals([*self._objs, *self._cons])
        self._design = self._gradient_design = np.zeros(0)
        self._check_for_missing_objective()
        self._check_for_invalid_desvar_values()

        design = np.concatenate(list(self.get_design_var_values().values()))
        # Coloring and the derivatives of linear constraints need a model that has run.
        self._evaluate(design)
        self._raise_error()
        self._problem().get_total_coloring(self._coloring_info, run_model=False)
        with self._interrupts_remembered():
            design, status = self._solve(design)
        self._raise_error()

        # The last design tried need not be the one returned, and the last case is the optimum.
        self._design = np.zeros(0)
        self._evaluate(design)
        self._raise_error()
        self._message, self.iterations = status["return_status"], status["iter_count"]
        return self._message != "Solve_Succeeded"

    def _solve(self, start: np.ndarray) -> tuple[np.ndarray, dict]:
        """Return the scaled design where IPOPT ended and CasADi's statistics of the run."""
        import casadi

        lower, upper = self._bounds("design_var", self.get_design_var_values())
        lower_g, upper_g = self._bounds("constraint", self.get_constraint_values())
        pattern = self._prepare_jacobian(start.size)
        starts, rows = pattern.indptr.tolist(), pattern.indices.tolist()
        jacobian = casadi.Sparsity(lower_g.size, start.size, starts, rows)
        x, f, p = casadi.Sparsity.dense(start.size), casadi.Sparsity.dense(1), casadi.Sparsity(0, 0)
        g = casadi.Sparsity.dense(lower_g.size)

        def values(point, _):
            return self._evaluate(point)

        def objective_gradient(point, _):
            return self._evaluate(point)[0], self._differentiate(point)[0]

        def constraint_jacobian(point, _):
            return self._evaluate(point)[1], casadi.DM(jacobian, self._differentiate(point)[1])

        def iteration(*_):
            return (self._count_iteration(),)

        # CasADi keeps no reference to a callback: these names must outlive the solver.
        inputs = {"x": x, "p": p}
        nlp = _callback("nlp", values, inputs, {"f": f, "g": g})
        grad_f = _callback("grad_f", objective_gradient, inputs, {"f": f, "grad_f_x": x})
        jac_g = _callback("jac_g", constraint_jacobian, inputs, {"g": g, "jac_g_x": jacobian})
        state = {"f": f, "x": x, "lam_x": x, "g": g, "lam_g": g, "lam_p": p}
        after = {name: state[name] for name in casadi.nlpsol_out()}
        each_iteration = _callback("each_iteration", iteration, after, {"stop": f})
        solver = casadi.nlpsol("solver", "ipopt", nlp, {
            "grad_f": grad_f, "jac_g": jac_g, "iteration_callback": each_iteration,
            # Multipliers of parameters, of which there are none, would want reverse derivatives.
            "no_nlp_grad": True, "calc_lam_p": False,
            "print_time": False, "show_eval_warnings": False, "ipopt": self.opt_settings,
        })  # fmt: skip
        solution = solver(x0=start, lbx=lower, ubx=upper, lbg=lower_g, ubg=upper_g)
        return np.array(solution["x"]).ravel(), solver.stats()

    def _prepare_jacobian(self, size: int) -> csc_matrix:
        """Return where the constraints' derivatives may differ from zero, column by column.

        Without sparse totals, those of the linear constraints are filled in for good.
        """
        if self._sparse is not None:
            places = self._sparse.pattern[1:]  # 0: the objective
            places.data = np.arange(self._sparse.pattern.indptr[1], self._sparse.pattern.nnz)
            self._pattern = places.tocsc()  # its data: places in the totals' data
            return self._pattern
        values = self.get_constraint_values()
        linear = [name for name in values if self._cons[name]["linear"]]
        is_linear = np.concatenate(
            [np.zeros(0, bool), *(np.full(values[name].size, name in linear) for name in values)]
        )
        self._nonlinear_rows = np.flatnonzero(~is_linear)
        self._jacobian = np.zeros((is_linear.size, size))
        pattern = np.ones(self._jacobian.shape, bool)
        if linear:
            totals = self._compute_totals(linear, list(self._designvars), self._total_jac_format)
            self._jacobian[is_linear] = totals
            pattern[is_linear] = totals != 0.0
        coloring = self._coloring_info.coloring
        if coloring is not None:
            pattern[self._nonlinear_rows] = coloring.get_dense_sparsity()[1:]
        self._pattern = csc_matrix(pattern)
        return self._pattern

    def _evaluate(self, point: np.ndarray) -> tuple[float, np.ndarray]:
        """Return objective and constraints at a scaled design, running the model if it is new."""
        if self._error is None and not np.array_equal(point, self._design):
            self._design = point.copy()
            try:
                self._values = self._run_model(point)
            except BaseException as error:  # CasADi would take even Ctrl-C for a failed evaluation
                self._error = error
        if self._error is not None:
            return np.nan, np.full_like(self._vectors["constraint"].asarray(), np.nan)
        return self._values

    def _run_model(self, point: np.ndarray) -> tuple[float, np.ndarray]:
        model = self._problem().model
        self._vectors["design_var"].set_data(point, driver_scaling=True)
        self._set_design_vars(driver_scaling=True)
        failed = False
        with RecordingDebugging(self._get_name(), self.iter_count, self):
            self.iter_count += 1
            try:
                with model._relevance.nonlinear_active("iter"):
                    self._run_solve_nonlinear()
            except om.AnalysisError:
                model._clear_iprint()
                failed = True
        objective = next(iter(self.get_objective_values().values()))[0]
        constraints = np.concatenate([*self.get_constraint_values().values(), np.zeros(0)])
        if failed:
            return np.nan, np.full_like(constraints, np.nan)
        return objective, constraints

    def _differentiate(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return gradient and constraint derivatives at a scaled design, reusing those last found.

        The latter at the places of the pattern, column by column.
        """
        objective, _ = self._evaluate(point)
        if not np.array_equal(point, self._gradient_design):
            self._gradient_design = point.copy()
            self._gradient = np.full(point.size, np.nan)
            self._entries = np.full(self._pattern.nnz, np.nan)
            try:
                if np.isfinite(objective):
                    self._gradient, self._entries = self._differentiate_model()
            except om.AnalysisError:
                self._problem().model._clear_iprint()
            except BaseException as error:  # as in _evaluate
                self._error = error
        if self._error is not None:
            return np.full(point.size, np.nan), self._entries
        return self._gradient, self._entries

    def _differentiate_model(self) -> tuple[np.ndarray, np.ndarray]:
        if self._sparse is not None:
            totals = self._compute_sparse()
            return totals[0].toarray().ravel(), totals.data[self._pattern.data]
        totals = self._compute_totals(
            self._get_ordered_nl_responses(), list(self._designvars), self._total_jac_format
        )
        self._jacobian[self._nonlinear_rows] = totals[1:]
        rows, columns = self._pattern.tocoo().coords
        return totals[0].copy(), self._jacobian[rows, columns]

    def _count_iteration(self) -> int:
        """Report an iteration and return whether IPOPT must stop."""
        try:
            self._report(self.iterations)
        except BaseException as error:  # as in _evaluate
            self._error = self._error or error
        self.iterations += 1
        return int(self._error is not None)

    @contextmanager
    def _interrupts_remembered(self) -> Iterator[None]:
        """Remember a Ctrl-C that arrives in compiled code, where CasADi would swallow it."""
        if threading.current_thread() is not threading.main_thread():
            yield  # signals are the main thread's
            return
        previous = signal.getsignal(signal.SIGINT)

        def handler(signum: int, frame: FrameType | None) -> None:
            try:
                if callable(previous):
                    previous(signum, frame)
            except BaseException as error:
                self._error = error
                raise

        signal.signal(signal.SIGINT, handler)
        try:
            yield
        except RuntimeError:  # CasADi's, for whatever a callback raised
            self._raise_error()
            raise
        finally:
            signal.signal(signal.SIGINT, previous)

    def _raise_error(self) -> None:
        """Raise what the callbacks had to hide from CasADi."""
        if self._error is not None:
            error, self._error = self._error, None
            raise error


def _callback(name: str, function: Callable, inputs: dict, outputs: dict) -> casadi.Function:
    """Return `function` of flat arrays as a CasADi function of the named inputs and outputs."""
    import casadi

    class Callback(casadi.Callback):
        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.construct(name, {})

        def get_n_in(self) -> int:
            return len(inputs)

        def get_n_out(self) -> int:
            return len(outputs)

        def get_name_in(self, i: int) -> str:
            return list(inputs)[i]

        def get_name_out(self, i: int) -> str:
            return list(outputs)[i]

        def get_sparsity_in(self, i: int) -> casadi.Sparsity:
            return list(inputs.values())[i]

        def get_sparsity_out(self, i: int) -> casadi.Sparsity:
            return list(outputs.values())[i]

        def eval(self, arguments: Sequence[casadi.DM]) -> list:
            return list(function(*(np.array(argument).ravel() for argument in arguments)))

    return Callback()
