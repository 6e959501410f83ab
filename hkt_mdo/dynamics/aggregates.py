"""Aggregates: how the scenarios of a case are combined into one objective.

An aggregate of your own is a subclass of `Aggregate` (docs/architecture.md).
"""

from typing import Any, ClassVar, Literal

import numpy as np

from hkt_mdo.sections import Section


class Aggregate(Section):
    """A mean, or a measure of risk, of the scenarios' mean rates.

    `value` takes the mean rate of each scenario over its duration, (n_scenarios,), such as a mean
    power in W, the scenarios' shares of time, (n_scenarios,), which sum to 1, and the `unknowns`,
    (n_unknowns,), which the optimizer chooses along with the design. It must accept complex
    numbers. An aggregate that is not smooth, such as the smallest of the rates, has unknowns and
    `rows`: the value is then the best over the unknowns that keep every row at or above zero (its
    epigraph).
    """

    measure: str
    """How the scenarios are combined."""
    n_unknowns: ClassVar[int] = 0
    """Number of unknowns."""

    def value(self, rates: Any, shares: np.ndarray, unknowns: Any) -> Any:
        """Return the measure, a number in the unit of the rates."""
        raise NotImplementedError

    def rows(self, rates: Any, shares: np.ndarray, unknowns: Any) -> Any:
        """Return what must not be negative, (n_rows,)."""
        return np.empty(0)

    def best_unknowns(self, rates: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Return the unknowns of the best value at some rates, (n_unknowns,)."""
        return np.empty(0)

    def of(self, rates: np.ndarray, shares: np.ndarray) -> float:
        """Return the measure of some rates, the best over the unknowns.

        With upper bounds on the rates it is an upper bound on the measure, which must not decrease
        if a rate increases.
        """
        unknowns = self.best_unknowns(rates, shares)
        return float(np.real(self.value(rates, shares, unknowns)))


class Expected(Aggregate):
    """The mean over time: the scenarios' mean powers, weighted by their shares of time."""

    measure: Literal["expected"] = "expected"
    """How the scenarios are combined."""

    def value(self, rates, shares, unknowns):
        return shares @ rates
