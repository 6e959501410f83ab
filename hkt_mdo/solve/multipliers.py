"""Lagrange multipliers of an optimum, from its derivatives alone: the same for every optimizer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_array, csr_matrix, diags_array, eye_array, vstack
from scipy.sparse.linalg import splu

from hkt_mdo.solve.driver_base import ReportingDriver

NEAR = 1e-2  # scaled distance from its bound beyond which a row has no multiplier
SLACK = 1e2  # weight of a row's distance from its bound, times its multiplier
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class State:
    """Where a driver's problem stands, scaled as for the optimizer (objective to be minimized).

    values, lower and upper are those of the constraints, then of the design variables; rows has
    those of each constraint, by its name in the driver; scaler is the objective's value over that
    in its own units.
    """

    objective: float
    scaler: float
    values: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    rows: dict[str, slice]

    @classmethod
    def of(cls, driver: ReportingDriver) -> State:
        """Return the state of a driver whose model has run."""
        (objective,) = driver.get_objective_values().values()
        (unscaled,) = driver.get_objective_values(driver_scaling=False).values()
        values, ends = [], []
        for kind, found in (
            ("constraint", driver.get_constraint_values()),
            ("design_var", driver.get_design_var_values()),
        ):
            values += [np.ravel(each) for each in found.values()]
            ends.append(driver._bounds(kind, found))
        lower, upper = (np.concatenate(each) for each in zip(*ends, strict=True))
        sizes = [each.size for each in driver.get_constraint_values().values()]
        last = np.cumsum(sizes, dtype=int)
        rows = map(slice, last - sizes, last)
        return cls(
            float(objective[0]),
            float(objective[0] / unscaled[0]),
            np.concatenate(values),
            lower,
            upper,
            dict(zip(driver._cons, rows, strict=True)),
        )


def multipliers(driver: ReportingDriver, state: State) -> np.ndarray:
    """Return the multipliers of the rows of a state: positive at an upper bound that binds.

    They make the gradient of the Lagrangian least, in the sense of least squares, with a penalty on
    the product of each multiplier and the distance from the bound, which is zero at an optimum.
    """
    totals = _totals(driver)
    gradient, jacobian = totals[[0]].toarray().ravel(), totals[1:]
    rows = vstack((jacobian, eye_array(gradient.size, format="csr")), format="csr")
    room = np.minimum(state.upper - state.values, state.values - state.lower)
    room = np.where(state.upper == state.lower, 0.0, np.maximum(room, 0.0))
    active = np.flatnonzero(room < NEAR)
    held = rows[active].T.tocsc()
    penalty = diags_array((SLACK * room[active]) ** 2 + ROUNDING)
    system = block_array([[eye_array(gradient.size), held], [held.T, -penalty]], format="csc")
    right = np.concatenate((-gradient, np.zeros(active.size)))
    found = np.zeros(state.values.size)
    found[active] = splu(system).solve(right)[gradient.size :]
    return found


def _totals(driver) -> csr_matrix:
    """Return the totals of the objective and the constraints, scaled."""
    responses = [*driver._objs, *driver._cons]
    driver._prepare_totals(responses)
    if driver._sparse is not None:
        return driver._compute_sparse()
    driver._total_jac = None  # an optimizer may have left one of another format
    totals = csr_matrix(driver._compute_totals(responses, list(driver._designvars), "array"))
    driver._total_jac = None
    return totals


def gain(optimum: State, multiplier: np.ndarray, changed: State) -> float:
    """Return what the optimum gains, in the objective's units, if its problem is changed a little.

    `changed` has the same design in the changed problem. To first order the optimum changes as the
    Lagrangian at a constant design does.
    """
    at_upper = optimum.upper - optimum.values <= optimum.values - optimum.lower
    bound = (np.where(at_upper, each.upper, each.lower) for each in (changed, optimum))
    held = multiplier != 0.0
    change = (changed.values - optimum.values - np.subtract(*bound))[held]
    lagrangian = changed.objective - optimum.objective + float(multiplier[held] @ change)
    return lagrangian / optimum.scaler
