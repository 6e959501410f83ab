"""The state of a run, to which the optimizer reports every evaluation, and its files meanwhile."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import StartingPoint, StartRecord
from hkt_mdo.results.folder import write_csv, write_json
from hkt_mdo.results.summary import VERSION, PassEntry, Summary
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.run.iterate import as_data
from hkt_mdo.solve.driver_base import Progress
from hkt_mdo.start.find import steady_optimum

UNFINISHED = "interrupted before the end; hkt run --resume continues from the last iterate"
FEASIBLE = 1e-6
"""Largest scaled violation of an iterate that may be the best of a run: that of a converged one."""
RESUMABLE = 1e-2
"""Largest scaled violation of an iterate from which a run may continue."""
SECONDS_BETWEEN_SAVES = 1.0
"""A save takes milliseconds, an evaluation some ten."""
EVALUATIONS_BETWEEN_POINTS = 5
"""By count, not by time: a resumed run must not depend on the clock."""


@dataclass(eq=False, repr=False)
class RunState:
    """The state of a run; called at every evaluation of the optimizer.

    It writes history, iterate and summary while the run works; nothing is read from these.

    Attributes
    ----------
    first : Physics
        The case's, on the mesh that the run began with.
    out : Path
        The result folder.
    records : bool
        Whether OpenMDAO's databases are written.
    history : list of tuple
        Number, objective (J) and infeasibility of every evaluation, those of an earlier run first.
    progress, on_pass, on_start : callable or None
        Called at every evaluation, after every optimization, and after every one of the search for
        a start.
    scratch : str
        Folder for OpenMDAO's own files.
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
    summary : Summary
        The summary that stands in the folder, but for the passes.
    """

    first: Physics
    out: Path
    records: bool
    history: list[tuple] = field(default_factory=list)
    progress: Progress | None = None
    on_pass: Callable[[PassEntry], None] | None = None
    on_start: Callable[[StartRecord], None] | None = None
    scratch: str = ""
    point: Callable[[], StartingPoint] = field(init=False)
    last: StartingPoint | None = None
    best: tuple[Physics, StartingPoint] | None = None
    passes: list[PassEntry] = field(default_factory=list)
    terminated: bool = False
    _highest: float = -np.inf
    _saved: float = 0.0

    def __post_init__(self) -> None:
        """Write the summary that stands in the folder until the run ends."""
        self.physics, about = self.first, {"version": VERSION, "case": self.first.case.name}
        self.summary = Summary(**about, success=False, message=UNFINISHED)
        self.write_summary()

    @cached_property
    def optimum(self) -> SteadyOptimum:
        """The steady optimum of all blades that the case allows."""
        return steady_optimum(self.first, self.first.blade)

    def __call__(self, count: int, objective: float, infeasibility: float) -> None:
        """Note an evaluation, and the iterate if a run may continue from it."""
        if self.terminated:
            raise KeyboardInterrupt
        self.history.append((len(self.history), objective, infeasibility))
        if infeasibility <= RESUMABLE:
            if len(self.history) % EVALUATIONS_BETWEEN_POINTS == 0:
                self.last = self.point()
                if infeasibility <= FEASIBLE:
                    self.keep(self.last, objective)
            if time.monotonic() - self._saved >= SECONDS_BETWEEN_SAVES:
                self._save(self.point())
                self.write_history()
        if self.progress is not None:
            self.progress(len(self.history), objective, infeasibility)

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
        write_csv(self.out / "convergence.csv", header, self.history)

    def write_summary(self) -> None:
        """Write the summary, with the passes so far."""
        summary = self.summary.model_copy(update={"passes": self.passes})
        write_json(self.out / "summary.json", summary.model_dump(exclude_unset=True))

    def note_pass(self, entry: PassEntry) -> None:
        """Note an optimization and the remedy that decides the next one."""
        self.passes.append(entry)
        self.write_summary()
        if self.on_pass is not None:
            self.on_pass(entry)
