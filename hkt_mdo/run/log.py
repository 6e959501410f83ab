"""Files that a run writes while it works: history, iterate to resume from, OpenMDAO databases."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import openmdao.api as om

from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.results.folder import write_csv, write_json
from hkt_mdo.results.summary import PassEntry, Summary
from hkt_mdo.run.iterate import as_data

_OF_LONG_FLOWS = ["*.timeseries.*", "chord", "twist", "*energy", "inertia", "mass"]


class Log:
    """Writes a result folder while a run works; nothing is read from it.

    Parameters
    ----------
    out
        The result folder.
    records
        Whether OpenMDAO's databases are written.
    summary
        The summary that stands in the folder until the run ends.
    history
        Evaluations of an earlier run: number, objective (J), infeasibility.
    """

    def __init__(self, out: Path, records: bool, summary: Summary, history: Iterable = ()):
        self._out, self._records, self._summary = out, records, summary
        self._history = list(history)

    def note_evaluation(self, objective: float, infeasibility: float) -> int:
        """Add an evaluation's objective (J) and infeasibility to the history; return its length."""
        self._history.append((len(self._history), objective, infeasibility))
        return len(self._history)

    def write_iterate(self, physics: Physics, point: StartingPoint, reference: float) -> None:
        """Write the point from which a resumed run continues."""
        write_json(self._out / "iterate.json", as_data(physics, point, reference))

    def write_history(self) -> None:
        """Write the energy and infeasibility of every evaluation."""
        header = ("evaluation", "energy_J", "infeasibility")
        write_csv(self._out / "convergence.csv", header, self._history)

    def write_passes(self, passes: list[PassEntry]) -> None:
        """Write the optimizations so far into the summary."""
        self.write_summary(self._summary.model_copy(update={"passes": passes}))

    def write_summary(self, summary: Summary) -> None:
        """Write the summary."""
        write_json(self._out / "summary.json", dict(summary))

    def add_recorders(self, problem: om.Problem, whole: bool = True) -> None:
        """Record the final case and every iteration; the databases of earlier passes are kept.

        Parameters
        ----------
        problem : openmdao.api.Problem
            The problem, set up.
        whole
            Whether every iteration has its constraints and what changes over time, which of a long
            flow are up to a gigabyte, and the final case has what Dymos computes in between.
        """
        if not self._records:
            return
        number, history = 1, self._out / "history.db"
        while history.exists():
            number += 1
            history = self._out / f"history_{number}.db"
        problem.driver.add_recorder(_Recorder(str(history.resolve()), record_viewer_data=False))
        solution = self._out / "solution.db"
        solution.unlink(missing_ok=True)
        problem.add_recorder(_Recorder(str(solution.resolve()), record_viewer_data=whole))
        problem.recording_options["record_inputs"] = False
        problem.recording_options["includes"] = ["*"] if whole else _OF_LONG_FLOWS
        if not whole:
            design = list(problem.model.get_design_vars(recurse=False))
            skipped = dict.fromkeys(("record_desvars", "record_constraints"), False)
            problem.driver.recording_options.update(skipped | {"includes": design})

    def record_final(self, problem: om.Problem) -> None:
        """Record the problem as it stands."""
        if self._records:
            problem.record("final")


class _Recorder(om.SqliteRecorder):
    """A recorder of variables that lets the system decide when its rows reach the disk.

    Waiting for the disk at every row takes longer than an iteration. A killed process loses
    nothing; a power cut may cost the last rows, and a run is resumed from `iterate.json`.
    Options of systems are not recorded: `case.yaml` says the same, and grids cannot be pickled.
    """

    def shutdown(self):
        """Close the database; OpenMDAO also collects garbage, which takes longer than the rest."""
        for connection in {self.connection, self.metadata_connection} - {None}:
            connection.close()

    def record_metadata_system(self, system, run_number=None):
        """Record nothing."""

    @property
    def connection(self):
        """The connection to the database."""
        return self._connection

    @connection.setter
    def connection(self, connection):
        self._connection = connection
        if connection is not None:
            connection.execute("PRAGMA synchronous=OFF")  # before OpenMDAO writes its tables
