"""The state of a run: the optimizer reports every evaluation to it, and it reports to the log."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import StartingPoint, StartRecord
from hkt_mdo.results.summary import PassEntry
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.run.log import Log
from hkt_mdo.start.find import steady_optimum

FEASIBLE = 1e-6
"""Largest scaled violation of an iterate that may be the best of a run: that of a converged one."""
RESUMABLE = 1e-2
"""Largest scaled violation of an iterate from which a run may continue."""
SECONDS_BETWEEN_SAVES = 1.0
"""A save takes milliseconds, an evaluation some ten."""
EVALUATIONS_BETWEEN_POINTS = 5
"""By count, not by time: a resumed run must not depend on the clock."""

Progress = Callable[[int, float, float], None]
"""Called with the number of evaluations, the objective (J) and the infeasibility."""


class RunState:
    """The state of a run; called at every evaluation of the optimizer.

    Parameters
    ----------
    physics
        The case's, on the mesh that the run begins with.
    log
        Writer of the files.
    scratch
        Folder for OpenMDAO's own files.
    progress
        Called at every evaluation.
    on_pass
        Called after every optimization.
    on_start
        Called after every one of the search for a start.

    Attributes
    ----------
    first : Physics
        The case's, on the mesh that the run began with.
    physics : Physics
        On the mesh at work.
    point : callable or None
        Reads the problem at work, as a `StartingPoint`.
    last : StartingPoint or None
        The last recorded iterate.
    best : tuple of Physics and StartingPoint, or None
        The best feasible iterate and the physics with its mesh.
    reference : float
        Objective of the start, J; 0 where it is no measure of the optimum.
    start : StartingPoint
        Where the series of optimizations at work began.
    passes : list of PassEntry
        The optimizations so far.
    terminated : bool
        Whether the run was asked to end: the next evaluation does so.
    """

    def __init__(
        self,
        physics: Physics,
        log: Log,
        scratch: str,
        progress: Progress | None = None,
        on_pass: Callable[[PassEntry], None] | None = None,
        on_start: Callable[[StartRecord], None] | None = None,
    ):
        self.first = self.physics = physics
        self.log, self.scratch, self.on_start = log, scratch, on_start
        self.point: Callable[[], StartingPoint] | None = None
        self.last: StartingPoint | None = None
        self.best: tuple[Physics, StartingPoint] | None = None
        self.reference = 0.0
        self.passes: list[PassEntry] = []
        self.terminated = False
        self._progress, self._on_pass = progress, on_pass
        self._highest, self._saved = -np.inf, 0.0

    @cached_property
    def optimum(self) -> SteadyOptimum:
        """The steady optimum of all blades that the case allows."""
        return steady_optimum(self.first, self.first.blade)

    def __call__(self, count: int, objective: float, infeasibility: float) -> None:
        """Note an evaluation, and the iterate if a run may continue from it."""
        if self.terminated:
            raise KeyboardInterrupt
        evaluations = self.log.note_evaluation(objective, infeasibility)
        if infeasibility <= RESUMABLE and self.point is not None:
            if evaluations % EVALUATIONS_BETWEEN_POINTS == 0:
                self.last = self.point()
                if infeasibility <= FEASIBLE:
                    self.keep(self.last, objective)
            if time.monotonic() - self._saved >= SECONDS_BETWEEN_SAVES:
                self._save(self.point())
                self.log.write_history()
        if self._progress is not None:
            self._progress(evaluations, objective, infeasibility)

    def keep(self, point: StartingPoint, objective: float) -> None:
        """Keep a feasible point of the physics at work if it is the best so far."""
        worth = self.first.objective.sign * objective
        if worth > self._highest:
            self.best, self._highest = (self.physics, point), worth

    def go_on_from(
        self, physics: Physics, point: StartingPoint, start: StartingPoint, reference: float
    ) -> None:
        """Take a point as the last iterate, and write it.

        Parameters
        ----------
        physics, point
            The point from which a resumed run continues, and its physics.
        start, reference
            The start that has led to it, and its objective, J.
        """
        self.physics, self.last, self.start, self.reference = physics, point, start, reference
        self._save(point)

    def _save(self, point) -> None:
        point = replace(point, branch=self.start.branch, starts=self.start.starts)
        self.log.write_iterate(self.physics, point, self.reference)
        self._saved = time.monotonic()

    def note_pass(self, entry: PassEntry) -> None:
        """Note an optimization and the remedy that decides the next one."""
        self.passes.append(entry)
        self.log.write_passes(self.passes)
        if self._on_pass is not None:
            self._on_pass(entry)
