"""A design with its trajectory: the start, an iterate or the end of an optimization."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hkt_mdo.rotor.blade import Blade

PRICE = 10.0  # share of the objective that an excess of the limits by their own size costs
NEAR_EXCESS = 0.01  # relative excess of a limit up to which starts rank by objective and price
START_EXCESS = 1e-3  # relative excess of a limit up to which a start counts as keeping it


@dataclass(frozen=True, eq=False)
class Operation:
    """A rotor in operation over a sampled flow.

    Attributes
    ----------
    energy : float
        Captured energy, J.
    rotor_speed, hydrodynamic_torque : np.ndarray
        At the samples of the flow, rad/s and N m, shape (n_times,).
    running : bool
        Whether an unstalled equilibrium exists at every instant.
    states : tuple of np.ndarray
        Those of the control law, in its units, shape (n_times,) each.
    """

    energy: float
    rotor_speed: np.ndarray
    hydrodynamic_torque: np.ndarray
    running: bool = True
    states: tuple[np.ndarray, ...] = ()


@dataclass(frozen=True)
class StartRecord:
    """The outcome of one candidate of the search for a start.

    Attributes
    ----------
    strategy : str
        Which strategy proposed it (`hkt_mdo.start.find`).
    branch : str
        Overspeed or underspeed, where limits make branches; else empty.
    objective : float or None
        Quasi-steady objective where it ended, J.
    excess : float or None
        Largest relative excess of a limit there, at most 0 if all are kept; inf: the rotor does not
        run.
    exceeds : tuple of str
        Names of the limits that it exceeds there.
    kept : bool
        Whether the optimization begins with it.
    law : str
        The control law under which it was tried: another one guides that of the case.
    side : str
        The branch of which it is the best, where limits make branches; else empty.
    """

    strategy: str
    branch: str
    objective: float | None
    excess: float | None
    exceeds: tuple[str, ...]
    kept: bool = False
    law: str = ""
    side: str = ""


@dataclass(frozen=True, eq=False)
class StartingPoint:
    """A blade, gains and their operation: the start, an iterate or the end of an optimization.

    Attributes
    ----------
    blade : Blade
    gains : np.ndarray
        Gains of the feedback law in its `gain_units`, shape (n_gains,).
    operation : Operation
        Over the flow at hand: all samples of a case's flow in a start, some speeds in its search.
    objective : float
        The quantity that the search for a start maximizes, J.
    excess : float
        Largest relative excess of a limit, of the law's balance of torques and of its distance from
        stall; inf: the rotor does not run.
    exceeds : tuple of str
        Names of what is exceeded by more than `START_EXCESS`.
    branch : str
        Overspeed or underspeed, where limits make branches; else empty.
    strategy : str
        Which strategy of the search proposed it.
    branches : tuple of StartingPoint
        The best of each branch, its own first, where limits make a choice of branches necessary.
    starts : tuple of StartRecord
        The outcomes of all candidates of the search; empty if there was no search.
    messages : tuple of str
        Messages about the start.
    reference : float
        What the optimum is measured by: the objective at the start of the run, J; 0: no measure.
    """

    blade: Blade
    gains: np.ndarray
    operation: Operation
    objective: float = np.nan
    excess: float = -np.inf
    exceeds: tuple[str, ...] = ()
    branch: str = ""
    strategy: str = ""
    branches: tuple["StartingPoint", ...] = ()
    starts: tuple[StartRecord, ...] = ()
    messages: tuple[str, ...] = ()
    reference: float = 0.0

    @property
    def merit(self) -> tuple[bool, float]:
        """Rank of points as starts: by objective less a price of the excess where that is small.

        The driver begins with a small excess as well as with none, and what an excess of a
        thousandth gains may be several per cent.
        """
        if self.excess > NEAR_EXCESS:
            return False, -self.excess
        return True, self.objective - PRICE * max(self.excess, 0.0) * abs(self.objective)


def records(
    tried: Sequence[StartRecord], kept: StartingPoint, branches: Iterable[StartingPoint] = ()
) -> tuple[StartRecord, ...]:
    """Return records with those of the kept point and of the best of each branch marked.

    They are found by their objectives.
    """
    sides = {point.objective: point.branch for point in branches}
    first = next((record for record in tried if record.objective == kept.objective), None)
    return tuple(replace(x, kept=x is first, side=sides.pop(x.objective, "")) for x in tried)
