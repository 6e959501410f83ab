"""One optimization of a run, with the quantities that remedies and judges examine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hkt_mdo.problem.physics import START_EXCESS, Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.problem.setup import NARROW, Setup, curve_nodes
from hkt_mdo.results.summary import CheckEntry, MemoryEntry, PassEntry
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.run.flight import Flight, Optimized, fly, may_tabulate, simulated_objective
from hkt_mdo.run.judge import BELOW_START, curve_errors, is_false, judge
from hkt_mdo.run.memory import stability_of
from hkt_mdo.run.mesh import Division, division, too_close_to_stall
from hkt_mdo.run.optimization import assembled
from hkt_mdo.run.state import RunState
from hkt_mdo.start.find import bounding_optimum

WORTHWHILE = 1e-6
"""Relative gain of the objective for which a move limit is re-centred again."""

FEW = 0.1
"""Share of the segments up to which few of them are too coarse."""

FALLEN = 1e-4
"""Share of the objective by which an optimum may be below one that it began with."""

AT_OPTIMUM = "finer mesh", "lowered limits"
"""Remedies that follow an optimum on its mesh."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A result with its integrations and the checks of its judges.

    Attributes
    ----------
    start : StartingPoint
        Where its run began.
    physics : Physics
        On the mesh of the result.
    result : Optimized
    flights : tuple of Flight
        The integration in each scenario.
    optimum : SteadyOptimum
        That which bounds the energy of the optimized blade.
    reference : float
        Objective of the start, J; 0 where it is no measure of the optimum.
    checks : list of CheckEntry
    """

    start: StartingPoint
    physics: Physics
    result: Optimized
    flights: tuple[Flight, ...]
    optimum: SteadyOptimum
    reference: float
    checks: list[CheckEntry]

    @classmethod
    def of(
        cls,
        start: StartingPoint,
        optimum: SteadyOptimum,
        physics: Physics,
        result: Optimized,
        flights: tuple[Flight, ...] | None = None,
        *,
        reference: float,
    ) -> Judged:
        """Return a result with its checks; `optimum` is the case's own; flights may be computed."""
        flights = flights or fly(physics, result)
        optimum = bounding_optimum(physics, optimum, result.point.blade)
        checks = judge(physics, optimum, reference, result, flights, start.starts)
        return cls(start, physics, result, flights, optimum, reference, checks)

    @property
    def passed(self) -> bool:
        """Whether every judge accepts it."""
        return all(check.passed for check in self.checks)

    @cached_property
    def rank(self) -> tuple[float, float, float]:
        """Rank of a result: numbers of large and of all failures, and the integration's objective.

        A start in balance at every instant exceeds a torque limit by the torque that accelerates
        the rotor. It ranks above an end only if that is false or worse by more than `BELOW_START`.
        """
        large = sum(check.value > max(check.limit, BELOW_START) for check in self.checks)
        refused = sum(not check.passed for check in self.checks)
        worth = self.physics.objective.sign * simulated_objective(self.physics, self.flights)
        return -large, -refused, worth


@dataclass(frozen=True, eq=False)
class Begin:
    """The start of an optimization, and the reason for it.

    Attributes
    ----------
    start : StartingPoint
        The start of the series of passes to which it belongs.
    physics : Physics
        On the mesh that is optimized on.
    setup : Setup
    reference : float
        Objective of the start, J; 0 where it is no measure of the optimum.
    remedy, why : str
        Name of the remedy that requires it, and the reason; empty for the first one.
    """

    start: StartingPoint
    physics: Physics
    setup: Setup
    reference: float
    remedy: str = ""
    why: str = ""


@dataclass(frozen=True, eq=False)
class Before:
    """The results of the earlier passes from the same start.

    Attributes
    ----------
    passes : int
        How many there were.
    verified : bool or None
        Whether the start's first branch has led to a result that passes; None: this is the first.
    objective : float
        Objective of the last that converged, J.
    coarser : tuple of float
        Objectives after which the mesh was divided, J, the last one's at the end; of polynomials of
        one order.
    optimum : tuple of Physics, Optimized and flights, or None
        The last optimum to which only remedies for the mesh, or for limits between its nodes,
        applied.
    """

    passes: int = 0
    verified: bool | None = None
    objective: float = np.inf
    coarser: tuple[float, ...] = ()
    optimum: tuple[Physics, Optimized, tuple[Flight, ...]] | None = None


@dataclass(frozen=True, eq=False)
class Attempt:
    """One optimization of a run: its start and its end.

    Attributes
    ----------
    state : RunState
    begin : Begin
    result : Optimized
    before : Before
    exact : bool
        Whether its integrations have their torque by direct BEM, however long they are.
    """

    state: RunState
    begin: Begin
    result: Optimized
    before: Before
    exact: bool = False

    @property
    def approximate(self) -> bool:
        """Whether the integrations have their torque by a spline, not by direct BEM."""
        return not self.exact and may_tabulate(self.physics)

    @property
    def physics(self) -> Physics:
        """The physics on the mesh of this optimization."""
        return self.begin.physics

    @property
    def setup(self) -> Setup:
        """Start and settings of the optimization."""
        return self.begin.setup

    @property
    def converged(self) -> bool:
        """Whether the optimizer converged."""
        return self.result.outcome.success

    @property
    def lost(self) -> bool:
        """Whether the optimizer failed, or lost much, even with narrow move limits."""
        failed = not self.converged or self.fallen > FALLEN
        return failed and self.setup.moves == NARROW

    @cached_property
    def memory(self) -> MemoryEntry | None:
        """Stability of an optimum's loop in a case with memory of the wake."""
        remembers = self.physics.remembers and self.converged
        return stability_of(self.physics, self.result) if remembers else None

    @property
    def runs_away(self) -> bool:
        """Whether the loop is unstable with memory of the wake, in a case with memory."""
        return self.memory is not None and not self.memory.stable

    @cached_property
    def flights(self) -> tuple[Flight, ...]:
        """The integration of the end in each scenario."""
        return fly(self.physics, self.result, self.approximate)

    @cached_property
    def is_false(self) -> bool:
        """Whether the integration contradicts the collocation."""
        return is_false(self.flights)

    @property
    def few_divided(self) -> bool:
        """Whether a division of the mesh leaves most segments as they are."""
        parts = self.division.parts
        return bool(parts) and bool(np.mean(np.concatenate(parts) > 1) < FEW)

    @cached_property
    def near_stall(self) -> list[np.ndarray]:
        """The segments of each scenario in which a feedback law is too close to stall."""
        return too_close_to_stall(self.physics, self.result, self.flights)

    @cached_property
    def curve_error(self) -> float:
        """Largest relative error of the torque curve; 0 without one."""
        return float(np.max(curve_errors(self.physics, self.result)[1], initial=0.0))

    @property
    def gain(self) -> float:
        """Relative change of the objective by this optimization; 1 for the first."""
        return abs(self.result.objective / self.before.objective - 1.0)

    @property
    def fallen(self) -> float:
        """Share by which the objective is below that of the optimum from which it began.

        On a finer mesh, or within other move limits, an open loop can still operate as before; a
        law may lose, since a coarse mesh let it exceed a limit.
        """
        after = self.begin.remedy in ("finer mesh", "recentred moves")
        if self.physics.law.is_feedback or not (self.converged and after):
            return 0.0
        return self.physics.objective.behind(self.result.objective, self.before.objective)

    @cached_property
    def at_limit(self) -> bool:
        """Whether it ended at a move limit, so that another optimization from there may be better.

        A false solution is no start for another optimization.
        """
        if not self.converged or self.gain <= WORTHWHILE:
            return False
        reached = self.setup.moves.reached(self.physics, self.setup.start, self.result.point)
        return reached and not self.is_false

    @cached_property
    def division(self) -> Division:
        """Error of the mesh, and the segments to divide."""
        about = self.physics, self.result, self.flights, self.near_stall
        return division(*about, self.before.coarser)

    def begin_again(self, why: str, **changes) -> Begin:
        """Return the start of the next optimization, with changes of the setup or the physics."""
        physics = changes.pop("physics", self.physics)
        return replace(self.begin, physics=physics, setup=replace(self.setup, **changes), why=why)

    def from_end(self, why: str, *, finer: bool = False) -> Begin:
        """Return `begin_again` from this optimization's end, its torque curve finer or not."""
        point = self.result.point
        nodes = curve_nodes(self.physics, point, finer=finer)
        return self.begin_again(why, start=point, nodes=nodes)

    def entry(self, seconds: float, again: Begin | None) -> PassEntry:
        """Return the report of this optimization and of the remedy that follows.

        Parameters
        ----------
        seconds
            Time that it took, s.
        again
            The start of the next optimization; None if there is none.
        """
        return PassEntry(
            number=len(self.state.passes) + 1,
            converged=self.converged,
            objective_J=self.result.objective,
            iterations=self.result.outcome.iterations,
            seconds=seconds,
            remedy=again.remedy if again else "",
            why=again.why if again else "",
        )

    def after(self, again: Begin) -> Before:
        """Return the record of the passes so far for the next one, which begins again."""
        before = replace(self.before, passes=self.before.passes + 1)
        if self.converged and again.remedy != "smaller moves":  # otherwise its objective has fallen
            before = replace(before, objective=self.result.objective)
        if again.remedy in AT_OPTIMUM:
            result = replace(self.result, mesh_error=self.division.error)
            before = replace(before, optimum=(self.physics, result, self.flights))
        if again.physics is not self.physics:
            meshes = [each.scenarios[0].mesh for each in (self.physics, again.physics)]
            same = meshes[0] == meshes[1]  # otherwise the objectives are no series
            last = (self.result.objective,) if self.converged else ()
            coarser = (*before.coarser, *last) if same else ()
            before = replace(before, coarser=coarser)
        return before

    @cached_property
    def end(self) -> Judged:
        """The result of the run if no remedy follows, with its checks, of this or an earlier pass.

        If this pass failed, it is the last optimum; a finer mesh that converged gives the error of
        its mesh.
        """
        physics, result, flights = self.physics, self.result, None
        if self.lost and self.before.optimum:
            physics, result, _ = self.before.optimum
            if physics is not self.physics and self.before.objective != result.objective:
                error = abs(self.before.objective / result.objective - 1.0)
                result = replace(result, mesh_error=error)
        elif self.converged:
            result = replace(result, mesh_error=self.division.error)
            flights = None if self.approximate else self.flights
        if self.at_limit:  # an optimum at a move limit is not an optimum of the case
            message = f"still at a move limit after {self.before.passes + 1} optimizations"
            outcome = replace(result.outcome, success=False, message=message)
            result = replace(result, outcome=outcome)
        about = self.begin.start, self.state.optimum, physics, result, flights
        return Judged.of(*about, reference=self._reference(result))

    def _reference(self, result) -> float:
        """Return the objective of the start, J, as a measure of the optimum."""
        reference = self.begin.reference
        if result.objective < (1.0 - BELOW_START) * reference:
            reference = min(reference, self._moving_reference(result))
        return reference

    def _moving_reference(self, result) -> float:
        """Return the objective of the start with the rotor's inertia, J; 0 if it breaks a limit.

        A quasi-steady start follows every gust at once, which a rotor with inertia cannot.
        """
        physics = self.state.first
        stands = as_it_stands(self.state, physics, self.begin.start, result)
        flights = fly(physics, stands)
        for flight in flights:
            held = physics.limits_in(flight.scenario)
            # a law with states has other states over time than in equilibrium
            parts = flight.at_nodes, flight.flown
            over = [np.max(each.excess(known)) for each in held for known in parts]
            if flight.simulation.stopped_at is not None or max(over) > START_EXCESS:
                return 0.0
        return simulated_objective(physics, flights)


def quasi_steady_reference(physics: Physics, start: StartingPoint) -> float:
    """Return the objective of a start, J; 0 where it is no measure of the optimum.

    A start that breaks a limit may be better than the best design that keeps it.

    Parameters
    ----------
    physics
        On the mesh of the start.
    start
        Found by quasi-steady co-design.
    """
    if physics.start_objective is not physics.objective:  # the start maximizes another quantity
        return 0.0
    if len(physics.variants) > 1:  # its operation is that of the case's own turbine
        return 0.0
    if not start.operation.running or start.excess > START_EXCESS or np.isnan(start.objective):
        return 0.0
    return start.objective - physics.price_of(start.blade)


def as_it_stands(
    state: RunState, physics: Physics, point: StartingPoint, ended: Optimized
) -> Optimized:
    """Return a point as the result of an optimization without success.

    Parameters
    ----------
    state
        State of the run.
    physics, point
        A start or an iterate, and the physics on its mesh.
    ended
        The optimization whose outcome it takes.
    """
    message = "its result was refused" if ended.outcome.success else ended.outcome.message
    outcome = replace(ended.outcome, success=False, message=message)
    return assembled(physics, Setup(point, curve_nodes(physics, point)), outcome, state.scratch)
