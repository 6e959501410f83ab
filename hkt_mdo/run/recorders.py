"""OpenMDAO's databases of a run: the final case and every iteration."""

from __future__ import annotations

from pathlib import Path

import openmdao.api as om

_OF_LONG_FLOWS = ["*.timeseries.*", "chord", "twist", "*energy", "inertia", "mass"]


def add_recorders(problem: om.Problem, out: Path, whole: bool = True) -> None:
    """Record the final case and every iteration; the databases of earlier passes are kept.

    Parameters
    ----------
    problem : openmdao.api.Problem
        The problem, set up.
    out
        The result folder.
    whole
        Whether every iteration has its constraints and what changes over time, which of a long
        flow are up to a gigabyte, and the final case has what Dymos computes in between.
    """
    number, history = 1, out / "history.db"
    while history.exists():
        number += 1
        history = out / f"history_{number}.db"
    problem.driver.add_recorder(_Recorder(str(history.resolve()), record_viewer_data=False))
    solution = out / "solution.db"
    solution.unlink(missing_ok=True)
    problem.add_recorder(_Recorder(str(solution.resolve()), record_viewer_data=whole))
    problem.recording_options["record_inputs"] = False
    problem.recording_options["includes"] = ["*"] if whole else _OF_LONG_FLOWS
    if not whole:
        design = list(problem.model.get_design_vars(recurse=False))
        skipped = dict.fromkeys(("record_desvars", "record_constraints"), False)
        problem.driver.recording_options.update(skipped | {"includes": design})


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
