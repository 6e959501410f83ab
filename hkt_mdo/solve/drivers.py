"""Choice and settings of the optimizers: IPOPT, SLSQP and SNOPT, from whichever package has them.

Whichever package carries it, an optimizer stops at the same tolerance, writes nothing and reports
through the driver's `outcome`.
"""

import importlib
import signal
from importlib.util import find_spec

import openmdao.api as om

from hkt_mdo.errors import InputError
from hkt_mdo.solve.casadi_driver import CasadiIpoptDriver, Settings
from hkt_mdo.solve.driver_base import Progress, ReportingDriver

CARRIERS = {
    "IPOPT": ("pyoptsparse", "casadi"),
    "SLSQP": ("pyoptsparse", "scipy"),
    "SNOPT": ("pyoptsparse",),
}
"""The packages that carry each optimizer, the preferred one first."""

NEAR_START: Settings = dict.fromkeys(
    ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"), 1e-3
)
"""How far IPOPT moves a good start off its bounds, relative to their size.

Ten times less doubles the iterations on finer meshes; from ten times farther a short open loop with
a generator came to torques that exceed their limit between the nodes.
"""

RELAXED = 10.0
"""Violation, in tolerances, up to which a converged run counts as feasible; as in SLSQP's test."""


def make_driver(
    package: str = "auto",
    optimizer: str = "IPOPT",
    tolerance: float = 1e-7,
    max_iterations: int = 1000,
    *,
    ipopt: Settings | None = None,
    progress: Progress | None = None,
) -> ReportingDriver:
    """Return a driver for an optimizer.

    Parameters
    ----------
    package : str
        Package that carried the optimizer, or auto for the first of `CARRIERS` that is installed.
    optimizer : str
        One of `CARRIERS`.
    tolerance : float
        Tolerance of optimality and feasibility, of the scaled problem.
    max_iterations : int
        Largest number of iterations.
    ipopt : dict, optional
        Options by IPOPT's own names, in place of the usual ones; no other optimizer takes them.
    progress : Progress, optional
        Called at each iteration of IPOPT in CasADi, after each evaluation elsewhere.

    Returns
    -------
    ReportingDriver
        The driver of an OpenMDAO problem.

    Raises
    ------
    InputError
        If optimizer or package is unknown or not installed.
    """
    carrier = _carrier(package, optimizer)
    settings = _settings(optimizer, float(tolerance), max_iterations)
    if optimizer == "IPOPT":
        settings |= ipopt or {}
    driver: ReportingDriver
    if carrier == "scipy":
        options = {"tol": tolerance, "maxiter": max_iterations, "disp": False}
        driver = _ScipyDriver(optimizer=optimizer, **options)
    elif carrier == "casadi":
        driver = CasadiIpoptDriver()
        driver.opt_settings = settings
    else:  # the directory is unused, but the default would create one
        driver = _PyOptSparseDriver(optimizer=optimizer, print_results=False, output_dir=".")
        driver.opt_settings = _FirstWins(settings)
    driver.optimizer, driver.tolerance, driver.progress = optimizer, tolerance, progress
    return driver


def near_start(barrier: float) -> Settings:
    """Return the options of IPOPT for a start that is near the optimum.

    Parameters
    ----------
    barrier : float
        First and largest barrier parameter.

    Returns
    -------
    dict
        By IPOPT's own names.
    """
    return {"mu_init": barrier, "mu_max": barrier} | NEAR_START


def _settings(optimizer: str, tolerance: float, max_iterations: int) -> Settings:
    """Return an optimizer's options by its own names: nothing is printed or written."""
    if optimizer == "SLSQP":
        return {"ACC": tolerance, "MAXIT": max_iterations, "IPRINT": -1, "IFILE": ""}
    if optimizer == "SNOPT":
        return {
            "Major optimality tolerance": tolerance,
            "Major feasibility tolerance": tolerance,
            "Major iterations limit": max_iterations,
            "iPrint": 0,
            "iSumm": 0,
            "Print file": "",
        }
    return {
        "hessian_approximation": "limited-memory",
        "limited_memory_max_history": 60,
        # The start is feasible and near the optimum: stay near it, and near the constraints.
        "mu_init": 1e-3,
        "theta_max_fact": 1.0,
        "tol": tolerance,
        "constr_viol_tol": tolerance,
        "acceptable_iter": 0,  # the 'acceptable' level is looser than the tolerance asked for
        "max_iter": max_iterations,
        "nlp_scaling_method": "none",  # the problem is scaled where its quantities are declared
        "bound_relax_factor": 0.0,  # bounds hold exactly
        "honor_original_bounds": "yes",
        "print_level": 0,
        "sb": "yes",
        "output_file": "",
    }


def _carrier(package: str, optimizer: str) -> str:
    """Return the installed package that is to carry an optimizer."""
    if optimizer not in CARRIERS:
        raise InputError("unknown optimizer", f"choose from {', '.join(CARRIERS)}", value=optimizer)
    candidates = CARRIERS[optimizer] if package == "auto" else (package,)
    for candidate in candidates:
        if candidate not in CARRIERS[optimizer]:
            remedy = f"choose from auto, {', '.join(CARRIERS[optimizer])}"
            raise InputError(f"this package does not have {optimizer}", remedy, value=package)
        if _is_usable(candidate, optimizer):
            return candidate
    conda = {"pyoptsparse": "conda install -c conda-forge pyoptsparse"}
    remedies = " or ".join(conda.get(name, f"pip install {name}") for name in candidates)
    if optimizer == "SNOPT":
        remedies = "SNOPT is commercial: build pyoptsparse with your copy of it, or give IPOPT"
    key, value = ("optimizer", optimizer) if package == "auto" else ("package", package)
    raise InputError(f"{optimizer} is not installed", remedies, key=f"driver.{key}", value=value)


def _is_usable(package: str, optimizer: str) -> bool:
    """Return whether a package is installed and, for pyoptsparse, was built with the optimizer."""
    if find_spec(package) is None:
        return False
    if package == "pyoptsparse":
        try:
            getattr(importlib.import_module(package), optimizer)()
        except Exception:  # each optimizer reports a missing library in its own way
            return False
    return True


class _FirstWins(dict):
    """Settings that keep their first value: OpenMDAO's driver would overwrite the print file."""

    __setitem__ = dict.setdefault


class _ReportEachEvaluation(ReportingDriver):
    """Additions to OpenMDAO's own drivers: progress by model runs, and a check of their success."""

    def _run_solve_nonlinear(self) -> None:
        super()._run_solve_nonlinear()
        self._report(self.result.model_evals)

    def _fails(self, converged: bool, message: str) -> bool:
        """Return whether the run failed; a converged run fails if its design is infeasible."""
        self._message = message
        # SLSQP may report success where it stalled far from feasible.
        violation = self.violation()
        if converged and not violation <= RELAXED * self.tolerance:
            self._message += f" (but constraints are violated by {violation:.2g}, scaled)"
            converged = False
        self.fail = not converged
        return self.fail


class _ScipyDriver(_ReportEachEvaluation, om.ScipyOptimizeDriver):
    """OpenMDAO's SciPy driver, which leaves the model at the optimum, not at the last trial."""

    package = "scipy"

    def run(self) -> bool:  # whether it failed, as for all drivers
        self._message = "stopped by an error"
        self._rows = self._get_ordered_nl_responses()
        self._prepare_totals(self._rows)
        super().run()
        result = self._scipy_optimize_result
        self.iterations = result.nit
        self._objfunc(result.x)
        if self._exc_info is not None:
            self._reraise()
        return self._fails(result.success, result.message)

    def _compute_totals(self, of=None, wrt=None, return_format="array", driver_scaling=True):
        if self._sparse is not None and of == self._rows:
            return self._compute_sparse().toarray()
        return super()._compute_totals(of, wrt, return_format, driver_scaling)


class _PyOptSparseDriver(_ReportEachEvaluation, om.pyOptSparseDriver):
    """OpenMDAO's pyoptsparse driver, which stops at an interrupt and accepts only full success."""

    package = "pyoptsparse"

    def run(self) -> bool:
        self._message = "stopped by an error"
        self._user_termination_flag = False
        handler = signal.getsignal(signal.SIGINT)
        try:
            super().run()
        finally:  # OpenMDAO restores the handler only if nothing was raised
            signal.signal(signal.SIGINT, handler)
        self.iterations = self.result.deriv_evals
        # OpenMDAO counts IPOPT's 'acceptable' and more of SLSQP's codes as success.
        inform = self.pyopt_solution.optInform
        converged = 1 if self.optimizer == "SNOPT" else 0
        return self._fails(inform["value"] == converged, inform["text"])

    def _objfunc(self, design: dict) -> tuple[dict, int]:
        return self._unless_interrupted(super()._objfunc(design))

    def _gradfunc(self, design: dict, functions: dict) -> tuple[dict, int]:
        return self._unless_interrupted(super()._gradfunc(design, functions))

    def _unless_interrupted(self, answer: tuple[dict, int]) -> tuple[dict, int]:
        """Return an evaluation's values, or raise the interrupt that OpenMDAO has caught.

        OpenMDAO hands it to the optimizer as a failed evaluation, which SLSQP ignores.

        Raises
        ------
        KeyboardInterrupt
            If there was one.
        """
        if self._user_termination_flag:
            raise KeyboardInterrupt
        return answer

    def _signal_handler(self, signum: int, frame: object) -> None:
        raise KeyboardInterrupt
