"""One optimization: the problem of some physics at a setup, solved, recorded and read."""

from itertools import count
from pathlib import Path

import numpy as np
import openmdao.api as om

from hkt_mdo.case.guard import any_values
from hkt_mdo.problem.build import assemble, point_of, series
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.setup import Setup
from hkt_mdo.quantities import TRAJECTORY
from hkt_mdo.run.state import RunState
from hkt_mdo.run.verification import Optimized
from hkt_mdo.solve.driver_base import Outcome, ReportingDriver

MOST_ROWS = 500
"""Segments times limits and the equation of motion, above which little is recorded."""

_OF_LONG_FLOWS = ["*.timeseries.*", "chord", "twist", "*energy", "inertia", "mass"]


def solve(state: RunState, physics: Physics, setup: Setup, driver: ReportingDriver) -> Optimized:
    """Run one optimization.

    Parameters
    ----------
    state
        What the run knows.
    physics, setup
        The problem and its start.
    driver
        That reports its progress to the state.

    Returns
    -------
    Optimized
        The end of the optimization, converged or not.
    """
    problem = assemble(physics, setup, driver)
    rows = sum(x.segments * (1 + len(x.limits)) for x in physics.scenarios)
    if state.records:
        add_recorders(problem, state.out, whole=rows <= MOST_ROWS)
    try:
        problem.final_setup()  # opens the recorders' files
        try:
            # OpenMDAO's drivers run only components that depend on the design; the flow does not
            problem.run_model()
            state.point = lambda: point_of(physics, problem)
            with any_values():
                problem.run_driver()
        finally:
            if state.records:
                problem.record("final")
    finally:
        problem.cleanup()
    result = collect(physics, setup, problem, problem.driver.outcome())
    if result.outcome.success:
        state.keep(result.point, result.objective)
    return result


def collect(physics: Physics, setup: Setup, problem, outcome: Outcome) -> Optimized:
    """Return the present state of a problem as the end of an optimization.

    Parameters
    ----------
    physics, setup
        What the problem was assembled from.
    problem : openmdao.api.Problem
        The problem, its model run.
    outcome
        How the optimizer ended.
    """
    names = *TRAJECTORY, *physics.law.states, *["wake_ratio"] * physics.remembers
    trajectories = tuple(
        {name: series(problem, scenario, name) for name in names} for scenario in physics.scenarios
    )
    return Optimized(
        *(physics, problem, outcome, setup, point_of(physics, problem), trajectories),
        *(float(problem.get_val(name)[0]) for name in ("energy", "objective", "inertia", "mass")),
        problem.get_val("torque_coefficient_table") if physics.has_curve else np.empty(0),
    )


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
    files = (out / f"history{f'_{number}' * (number > 1)}.db" for number in count(1))
    history = next(file for file in files if not file.exists())
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

    def _initialize_database(self, comm):
        super()._initialize_database(comm)
        self.connection.execute("PRAGMA synchronous=OFF")
