"""Aggregates: how the scenarios of a case are combined into one objective.

An aggregate of your own is a subclass of `Aggregate` (docs/dev/architecture.md).
"""

from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from hkt_mdo.sections import Quantity, Section

NEAR = 1e-4  # rates within this relative distance count as equal


class Aggregate(Section):
    """A mean, or a measure of risk, of the scenarios' mean rates.

    `value` takes the mean rate of each scenario over its duration, (n_scenarios,), such as a mean
    power in W, the scenarios' shares of time, (n_scenarios,), which sum to 1, and the `unknowns`,
    (n_unknowns,), which the optimizer chooses along with the design. It must accept complex
    numbers. An aggregate that is not smooth, such as the smallest of the rates, has unknowns and
    `rows`: the value is then the best over the unknowns that keep every row at or above zero (its
    epigraph).
    """

    named_by: ClassVar[str] = "measure"
    measure: str
    """How the scenarios are combined."""
    n_unknowns: ClassVar[int | None] = 0
    """Number of unknowns; None: it depends on the scenarios and is the length of
    `best_unknowns`."""
    relative: ClassVar[bool] = False
    """Whether each rate is divided by an upper bound of its own (its ceiling), so that the slowest
    flow is not the worst only because it is slow. The rates are then multiplied by the scenarios'
    mean ceiling over their own,
    and keep their unit (docs/dev/equations.md)."""

    def value(self, rates: Any, shares: np.ndarray, unknowns: Any) -> Any:
        """Return the measure, a number in the unit of the rates."""
        raise NotImplementedError

    def rows(self, rates: Any, shares: np.ndarray, unknowns: Any) -> Any:
        """Return what must not be negative, (n_rows,)."""
        return np.empty(0)

    def best_unknowns(self, rates: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Return the unknowns of the best value at some rates, (n_unknowns,)."""
        return np.empty(0)

    def binding(self, rates: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Return which scenarios decide the measure, (n_scenarios,); all False: all do.

        That is the default. The worst rate, for example, is that of one scenario or a few.
        """
        return np.zeros(shares.size, dtype=bool)

    def of(self, rates: np.ndarray, shares: np.ndarray) -> float:
        """Return the measure of some rates, the best over the unknowns.

        With upper bounds on the rates it is an upper bound on the measure, which must not decrease
        if a rate increases.
        """
        return float(np.real(self.value(rates, shares, self.best_unknowns(rates, shares))))


class Expected(Aggregate):
    """The mean over time: the scenarios' mean powers, weighted by their shares of time."""

    measure: Literal["expected"] = "expected"
    """How the scenarios are combined."""

    def value(self, rates, shares, unknowns):
        return shares @ rates


class _OfTheWorst(Aggregate):
    """A measure of the smallest rates of scenarios, without scenarios of weight 0."""

    n_unknowns: ClassVar[int | None] = None
    relative: ClassVar[bool] = True


class Worst(_OfTheWorst):
    """The smallest of the scenarios' mean powers, each over its own ceiling.

    The ceiling is the mean of the largest power that such a rotor can take from the flow, or of the
    power limit if smaller.
    """

    measure: Literal["worst"] = "worst"
    """How the scenarios are combined."""

    def value(self, rates, shares, unknowns):
        return unknowns[0]

    def rows(self, rates, shares, unknowns):
        return rates[shares > 0.0] - unknowns[0]

    def best_unknowns(self, rates, shares):
        return np.array([np.min(rates[shares > 0.0])])

    def binding(self, rates, shares):
        least = np.min(rates[shares > 0.0])
        return (shares > 0.0) & (rates <= least + NEAR * np.abs(least))


class ConditionalValueAtRisk(_OfTheWorst):
    """The mean over the worst share of time of the scenarios' mean powers, each over its ceiling.

    The conditional value at risk (Rockafellar and Uryasev 2000). With a share of 1 it is
    the mean over all time, with one below each scenario's share `worst`.
    """

    measure: Literal["cvar"] = "cvar"
    """How the scenarios are combined."""
    share: Annotated[float, Quantity(gt=0, le=1)] = 0.2
    """Share of time over which the mean is taken."""

    def value(self, rates, shares, unknowns):
        if self.share == 1.0:  # any level at or above the largest rate would do
            return shares @ rates
        level, below = unknowns[0], unknowns[1:]
        return level - shares[shares > 0.0] @ below / self.share

    def rows(self, rates, shares, unknowns):
        if self.share == 1.0:
            return np.empty(0)
        level, below = unknowns[0], unknowns[1:]
        return np.concatenate((below, below - level + rates[shares > 0.0]))

    def best_unknowns(self, rates, shares):
        if self.share == 1.0:
            return np.empty(0)
        rates, level = rates[shares > 0.0], self._level(rates, shares)
        return np.concatenate(([level], np.maximum(level - rates, 0.0)))

    def binding(self, rates, shares):
        level = self._level(rates, shares)
        return (shares > 0.0) & (rates <= level + NEAR * np.abs(level))

    def _level(self, rates, shares):
        """Return the rate that the worst scenarios do not exceed: the value at risk."""
        rates, shares = rates[shares > 0.0], shares[shares > 0.0]
        order = np.argsort(rates)
        rank = np.searchsorted(np.cumsum(shares[order]), self.share * (1.0 - 1e-12))
        return rates[order[min(rank, order.size - 1)]]
