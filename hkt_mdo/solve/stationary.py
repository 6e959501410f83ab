"""When an optimizer is at an optimum and stagnates: later iterates are no better.

On a function that is rough in its second derivatives, such as a torque of blended polars, the
approximated Hessian of a quasi-Newton method is never good enough for the last digits of the
gradient: hundreds of iterations move nothing. What such an iterate lacks is known: its multipliers
bound it by the gap between the objective and its dual.
"""

from dataclasses import dataclass

import numpy as np

GRADIENT = 1e3
"""Largest element of the Lagrangian's gradient, of the scaled problem, in tolerances."""
GAP = 500.0
"""Sum of multipliers times distances from their bounds, over the objective, in tolerances.

By as much the optimum of a convex problem may be better. At a tolerance of 1e-7, half of what the
checks allow of the energy.
"""
NO_GRADIENT, NO_GAP = 200.0, 10.0
"""The same of an iterate that is the end at once, unless it is better by a tolerance than those
before: a designed hub ended 0.08 % short of its bound. Its gap includes the gradient times the
distance from the start, by which an optimum that is no farther away may be better. A third of the
iterations of an open loop followed, for 2e-7 of the energy. At a larger gradient a law of two gains
(`tests/test_extension.py`) lost 5e-6."""
ROUNDING = 0.01
"""Share of a tolerance by which an iterate must be better to be the best. Where the objective is
flat its last digits would choose among blades that differ by 1e-5: not the same on another kernel,
or with the flows in another order."""
PATIENCE = 15
"""Iterations within all bounds, without an objective that is better by a tolerance, after which the
best is the end. Of 30 a third of `rotor_speed_oloc` was waiting, for 1e-9 of the energy; after 10
the law of two gains of `tests/test_extension.py` lost 5e-6 of it."""


@dataclass
class Stationary:
    """The best optimum among the iterates of a minimization, and whether it is the end.

    Attributes
    ----------
    lower, upper : np.ndarray
        Bounds of the unknowns, then of the constraints, shape (n_unknowns + n_constraints,).
    tolerance : float
        The optimizer's; the largest violation of a bound.
    start : np.ndarray
        Unknowns at the start, shape (n_unknowns,).
    best : np.ndarray or None
        Unknowns of the best optimum so far, shape (n_unknowns,).
    gap : float
        Its gap, over the objective.
    """

    lower: np.ndarray
    upper: np.ndarray
    tolerance: float
    start: np.ndarray
    best: np.ndarray | None = None
    gap: float = np.inf
    _objective: float = np.inf
    _improved: float = np.inf
    _waited: int = 0

    def note(
        self, values: np.ndarray, multipliers: np.ndarray, objective: float, gradient: np.ndarray
    ) -> bool:
        """Note an iterate and return whether the best one is the end.

        Parameters
        ----------
        values : np.ndarray
            Unknowns, then constraints.
        multipliers : np.ndarray
            Of the bounds of `values`, positive at an upper one.
        objective : float
            What is minimized.
        gradient : np.ndarray
            That of the Lagrangian by the unknowns.

        Returns
        -------
        bool
            True at a gap within `NO_GAP`, if the objective is not better by a tolerance, and once
            no iterate has been better for `PATIENCE` iterations.
        """
        unit, unknowns = self.tolerance, values[: gradient.size]
        over = np.max(np.maximum(self.lower - values, values - self.upper), initial=0.0)
        self._waited += bool(over <= unit)  # an iterate beyond its bounds is on its way
        bound = np.where(multipliers > 0.0, self.upper, self.lower)
        room = np.where(np.isfinite(bound), np.abs(bound - values), 0.0)
        size, slopes = max(abs(objective), 1e-9), np.abs(gradient)
        gap, slope = float(np.abs(multipliers) @ room) / size, np.max(slopes, initial=0.0)
        if over <= unit and gap <= GAP * unit and slope <= GRADIENT * unit:
            if objective < self._objective - ROUNDING * unit * abs(objective):
                self.best, self.gap, self._objective = unknowns.copy(), gap, objective
            gap += slopes @ np.abs(unknowns - self.start) / size
            if objective < self._improved - unit * abs(objective):
                self._improved, self._waited = objective, 0
            elif gap <= NO_GAP * unit and slope <= NO_GRADIENT * unit:
                return True
        return self.best is not None and self._waited >= PATIENCE
