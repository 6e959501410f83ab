"""Lagrange multipliers of an optimum from its derivatives, for any optimizer."""

from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.sparse import block_array, csc_array, diags_array, eye_array, vstack
from scipy.sparse.linalg import splu

from hkt_mdo.solve.driver_base import ReportingDriver

NEAR = 1e-2
"""Scaled distance from its bound beyond which a row has no multiplier."""

SLACK = 1e2
"""Weight of the product of a row's multiplier and its distance from the bound."""

FULL = 10.0
"""Entries of a column over the root of its length from which it counts as full, as in COLAMD."""

ROUNDING = 1e-9
"""Weight of the multipliers' own squares, so that dependent rows leave the system regular."""


@dataclass(frozen=True, eq=False)
class State:
    """Values and bounds of a driver's problem, scaled as for the optimizer, which minimizes."""

    objective: float
    """The objective, scaled."""
    scaler: float
    """The scaled objective over that in its own units."""
    values: np.ndarray
    """The constraints, then the design variables, shape (n_rows,)."""
    lower: np.ndarray
    """Lower bound of each value, -inf where there is none, shape (n_rows,)."""
    upper: np.ndarray
    """Upper bound of each value, inf where there is none, shape (n_rows,)."""
    rows: dict[str, slice]
    """Rows of each constraint and design variable, by its name in the driver."""

    @classmethod
    def of(cls, driver: ReportingDriver) -> "State":
        """Return the state of a driver whose model has run.

        Parameters
        ----------
        driver : ReportingDriver
            A driver after final setup.

        Returns
        -------
        State
            Its present values and bounds.
        """
        (objective,) = driver.get_objective_values().values()
        (unscaled,) = driver.get_objective_values(driver_scaling=False).values()
        kinds, rows, count = ("constraint", "design_var"), {}, 0
        for name, value in chain(*(driver._vectors[kind].items() for kind in kinds)):
            rows[name] = slice(count, count + value.size)
            count += value.size
        scaled = np.hstack([driver._scaled(kind) for kind in kinds])
        return cls(float(objective[0]), float(objective[0] / unscaled[0]), *scaled, rows)


def multipliers(driver: ReportingDriver, state: State) -> np.ndarray:
    """Return the Lagrange multipliers at an optimum, from its derivatives alone.

    They make the gradient of the Lagrangian least, in the sense of least squares, with a penalty on
    the product of each multiplier and the distance from the bound, which is zero at an optimum
    (complementarity; Nocedal and Wright, Numerical Optimization, 2006, chapter 12).

    Parameters
    ----------
    driver : ReportingDriver
        A driver whose model, with the linear solver `Substitution`, is at the optimum.
    state : State
        The driver's state there.

    Returns
    -------
    numpy.ndarray, shape (n_rows,)
        Scaled multipliers of the state's rows: positive at an upper bound that binds.
    """
    driver._prepare_totals([*driver._objs, *driver._cons])
    totals = driver._compute_sparse()
    gradient, jacobian = totals[[0]].toarray().ravel(), totals[1:]
    rows = vstack((jacobian, eye_array(gradient.size, format="csr")), format="csr")
    slack = np.minimum(state.upper - state.values, state.values - state.lower)
    slack = np.where(state.upper == state.lower, 0.0, np.maximum(slack, 0.0))
    active = np.flatnonzero(slack < NEAR)
    normals = rows[active].T.tocsc()
    penalty = diags_array((SLACK * slack[active]) ** 2 + ROUNDING)
    system = block_array([[eye_array(gradient.size), normals], [normals.T, -penalty]], format="csc")
    right = np.concatenate((-gradient, np.zeros(active.size)))
    multiplier = np.zeros(state.values.size)
    multiplier[active] = _solved(system, right)[gradient.size :]
    return multiplier


def _solved(system: csc_array, right: np.ndarray) -> np.ndarray:
    """Return the solution of a symmetric sparse system, some of whose columns may be full.

    Those of the design, in a flow of many segments, would fill the factors (12 s for 0.1 s in
    `river25_record`): their unknowns are found first, by the Schur complement of the others.
    """
    full, solution = np.diff(system.indptr) > FULL * np.sqrt(right.size), np.empty_like(right)
    across, factors = system[:, full].toarray(), splu(system[~full][:, ~full])
    sides = np.column_stack((right, across))
    solved = factors.solve(sides[~full])
    left = sides[full] - across[~full].T @ solved
    solution[full] = np.linalg.solve(left[:, 1:], left[:, 0])
    solution[~full] = solved[:, 0] - solved[:, 1:] @ solution[full]
    return solution


def gain(optimum: State, multiplier: np.ndarray, changed: State) -> float:
    """Return the change of the optimal objective if the problem is changed a little.

    To first order the optimum changes as the Lagrangian at a constant design does.

    Parameters
    ----------
    optimum : State
        The optimum.
    multiplier : numpy.ndarray, shape (n_rows,)
        Its multipliers, as of `multipliers`.
    changed : State
        The same design in the changed problem.

    Returns
    -------
    float
        New optimum less the old one, in the objective's own units.
    """
    at_upper = optimum.upper - optimum.values <= optimum.values - optimum.lower
    bounds = (np.where(at_upper, state.upper, state.lower) for state in (changed, optimum))
    active = multiplier != 0.0
    new, old = (bound[active] for bound in bounds)  # the others may have none
    change = (changed.values - optimum.values)[active] - (new - old)
    lagrangian = changed.objective - optimum.objective + float(multiplier[active] @ change)
    return lagrangian / optimum.scaler
