"""The state of a run, to which the optimizer reports every evaluation, and its files meanwhile."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterable
from functools import cached_property
from pathlib import Path

import numpy as np

from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import StartingPoint, StartRecord
from hkt_mdo.results.folder import write_csv, write_json
from hkt_mdo.results.summary import PassEntry, Summary
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.run.iterate import as_data
from hkt_mdo.solve.driver_base import Progress
from hkt_mdo.start.find import steady_optimum

FEASIBLE = 1e-6
"""Largest scaled violation of an iterate that may be the best of a run: that of a converged one."""
RESUMABLE = 1e-2
"""Largest scaled violation of an iterate from which a run may continue."""
SECONDS_BETWEEN_SAVES = 1.0
"""A save takes milliseconds, an evaluation some ten."""
EVALUATIONS_BETWEEN_POINTS = 5
"""By count, not by time: a resumed run must not depend on the clock."""


class RunState:
    """The state of a run; called at every evaluation of the optimizer.

    It writes history, iterate and summary while the run works; nothing is read from these.

    Parameters
    ----------
    physics
        The case's, on the mesh that the run begins with.
    out
        The result folder.
    records
        Whether OpenMDAO's databases are written.
    summary
        The summary that stands in the folder until the run ends.
    scratch
        Folder for OpenMDAO's own files.
    history
        Evaluations of an earlier run: number, objective (J), infeasibility.
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
    point : callable
        Reads the problem at work, as a `StartingPoint`; set before an optimization begins.
    last : StartingPoint or None
        The last recorded iterate.
    best : tuple of Physics and StartingPoint, or None
        The best feasible iterate and the physics with its mesh.
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
        out: Path,
        records: bool,
        summary: Summary,
        scratch: str,
        history: Iterable = (),
        progress: Progress | None = None,
        on_pass: Callable[[PassEntry], None] | None = None,
        on_start: Callable[[StartRecord], None] | None = None,
    ):
        self.first = self.physics = physics
        self.out, self.records, self.scratch, self.on_start = out, records, scratch, on_start
        self.point: Callable[[], StartingPoint]
        self.last: StartingPoint | None = None
        self.best: tuple[Physics, StartingPoint] | None = None
        self.passes: list[PassEntry] = []
        self.terminated = False
        self._progress, self._on_pass = progress, on_pass
        self._summary, self._history = summary, [*history]
        self._highest, self._saved = -np.inf, 0.0
        self.write_summary(summary)

    @cached_property
    def optimum(self) -> SteadyOptimum:
        """The steady optimum of all blades that the case allows."""
        return steady_optimum(self.first, self.first.blade)

    def __call__(self, count: int, objective: float, infeasibility: float) -> None:
        """Note an evaluation, and the iterate if a run may continue from it."""
        if self.terminated:
            raise KeyboardInterrupt
        self._history.append((len(self._history), objective, infeasibility))
        if infeasibility <= RESUMABLE:
            if len(self._history) % EVALUATIONS_BETWEEN_POINTS == 0:
                self.last = self.point()
                if infeasibility <= FEASIBLE:
                    self.keep(self.last, objective)
            if time.monotonic() - self._saved >= SECONDS_BETWEEN_SAVES:
                self._save(self.point())
                self.write_history()
        if self._progress is not None:
            self._progress(len(self._history), objective, infeasibility)

    def terminate(self, number, frame) -> None:
        """Handle SIGTERM, which ends a run as Ctrl-C does."""
        # checked at the next evaluation, in case compiled code swallows this
        self.terminated = True
        interrupt = signal.getsignal(signal.SIGINT)
        (interrupt if callable(interrupt) else signal.default_int_handler)(number, frame)

    def keep(self, point: StartingPoint, objective: float) -> None:
        """Keep a feasible point of the physics at work if it is the best so far."""
        worth = self.first.objective.sign * objective
        if worth > self._highest:
            self.best, self._highest = (self.physics, point), worth

    def go_on_from(self, physics: Physics, point: StartingPoint, start: StartingPoint) -> None:
        """Take a point as the last iterate, and write it.

        Parameters
        ----------
        physics, point
            The point from which a resumed run continues, and its physics.
        start
            The start that has led to it.
        """
        self.physics, self.last, self.start = physics, point, start
        self._save(point)

    def _save(self, point) -> None:
        write_json(self.out / "iterate.json", as_data(self.physics, point, self.start))
        self._saved = time.monotonic()

    def write_history(self) -> None:
        """Write the energy and infeasibility of every evaluation."""
        header = ("evaluation", "energy_J", "infeasibility")
        write_csv(self.out / "convergence.csv", header, self._history)

    def write_summary(self, summary: Summary) -> None:
        """Write a summary."""
        write_json(self.out / "summary.json", summary.model_dump(exclude_unset=True))

    def note_pass(self, entry: PassEntry) -> None:
        """Note an optimization and the remedy that decides the next one."""
        self.passes.append(entry)
        self.write_summary(self._summary.model_copy(update={"passes": self.passes}))
        if self._on_pass is not None:
            self._on_pass(entry)
