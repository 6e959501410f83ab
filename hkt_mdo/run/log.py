"""What a run writes while it works: history, an iterate to resume from, OpenMDAO databases."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import openmdao.api as om

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import read_bytes
from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.point import Operation, StartingPoint
from hkt_mdo.results.folder import write_csv, write_json
from hkt_mdo.results.solution import Solution

FEASIBLE = 1e-6  # largest scaled violation of an iterate that may be the best of a run
RESUMABLE = 1e-2  # largest scaled violation of an iterate worth going on from
SECONDS_BETWEEN_SAVES = 1.0
EVALUATIONS_BETWEEN_POINTS = 5
MAX_ITERATE_BYTES = 64 * 1024**2

Progress = Callable[[int, float, float], None]


class Log:
    """The optimizer's `progress`: notes every evaluation, and saves iterates worth resuming from.

    `out` is the result folder, `scratch` one for OpenMDAO's own files, which vanishes with the run;
    `records` says whether OpenMDAO's databases are written.
    """

    def __init__(self, out: Path, scratch: str, progress: Progress | None, records: bool):
        self._out, self._progress, self._records = out, progress, records
        self.scratch = scratch
        self.history: list = []
        self.reference = 0.0  # J: objective of the case's own start, if the rotor runs on it
        self._saved = 0.0
        self.point: Callable[[], StartingPoint] | None = None  # reads the problem at work
        self.last: StartingPoint | None = None
        # the best of the feasible iterates, and the physics with its mesh
        self.best: tuple[Physics | None, StartingPoint | None] = None, None
        self._highest = -np.inf
        self.terminated = False
        self._physics: Physics | None = None  # that of `last`

    def __call__(self, count: int, objective: float, infeasibility: float) -> None:
        """Note an evaluation, and save the iterate if it is worth going on from."""
        if self.terminated:
            raise KeyboardInterrupt
        self.history.append((len(self.history), objective, infeasibility))
        if infeasibility <= RESUMABLE and self.point is not None:
            # by count, not by time: what an optimization goes on from must not depend on the clock
            if len(self.history) % EVALUATIONS_BETWEEN_POINTS == 0:
                self.last = self.point()
                if infeasibility <= FEASIBLE:
                    self.keep(self.last, objective)
            if time.monotonic() - self._saved >= SECONDS_BETWEEN_SAVES:
                self._write(self.point())
                self.write_history()
        if self._progress is not None:
            self._progress(len(self.history), objective, infeasibility)

    def keep(self, point: StartingPoint, objective: float) -> None:
        """Keep a feasible point if it is the best so far."""
        if objective > self._highest:
            self.best, self._highest = (self._physics, point), objective

    def save(self, point: StartingPoint, physics: Physics) -> None:
        """Keep the point of some physics that a resumed run goes on from, and write it."""
        self.last, self._physics = point, physics
        self._write(point)

    def _write(self, point: StartingPoint) -> None:
        write_json(
            self._out / "iterate.json",
            {
                "chord_m": point.blade.chord,
                "twist_rad": point.blade.twist,
                "thickness_over_chord": point.blade.thickness,
                "rotor_radius_m": point.blade.rotor_radius,
                "gains": point.gains,
                "energy_J": point.operation.energy,
                "reference_energy_J": self.reference,
                "segment_ends_s": [each.edges for each in self._scenarios],
                "rotor_speed_rad_s": point.operation.rotor_speed,
                "hydrodynamic_torque_Nm": point.operation.hydrodynamic_torque,
            },
        )
        self._saved = time.monotonic()

    @property
    def _scenarios(self):
        return self._physics.scenarios if self._physics else ()

    def write_history(self) -> None:
        """Write the energy and infeasibility of every evaluation."""
        header = ("evaluation", "energy_J", "infeasibility")
        write_csv(self._out / "convergence.csv", header, self.history)

    def add_recorders(self, problem: om.Problem) -> None:
        """Record the final case and every iteration; the databases of earlier passes are kept."""
        if not self._records:
            return
        number, history = 1, self._out / "history.db"
        while history.exists():
            number += 1
            history = self._out / f"history_{number}.db"
        problem.driver.add_recorder(_Recorder(str(history.resolve()), record_viewer_data=False))
        solution = self._out / "solution.db"
        solution.unlink(missing_ok=True)
        problem.add_recorder(_Recorder(str(solution.resolve())))
        problem.recording_options["record_inputs"] = False
        problem.recording_options["includes"] = ["*"]

    def record_final(self, problem: om.Problem) -> None:
        """Record the problem as it stands."""
        if self._records:
            problem.record("final")


class _Recorder(om.SqliteRecorder):
    """A recorder of variables that leaves it to the system when its rows reach the disk.

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
        if self.connection is not None:
            self.connection.execute("PRAGMA synchronous=OFF")


def read_iterate(out: Path, physics: Physics) -> tuple[Physics, StartingPoint | None, float, list]:
    """Return the physics on an earlier run's mesh, its point, reference (J) and history.

    The point is None if it recorded none.
    """
    path = out / "iterate.json"
    if not path.exists():
        return physics, None, 0.0, []
    stations = physics.blade.r.size
    sizes = {"chord_m": stations, "twist_rad": stations, "gains": len(physics.gain_units)}
    if physics.shape.designs_thickness:
        sizes["thickness_over_chord"] = stations
    sizes |= dict.fromkeys(("rotor_radius_m", "energy_J", "reference_energy_J"), 1)
    content = read_bytes(path, MAX_ITERATE_BYTES, "iterate of a run")
    try:
        data = json.loads(content)
        physics = _on_mesh(physics, data["segment_ends_s"])
        times = sum(scenario.samples.size for scenario in physics.scenarios)
        sizes |= dict.fromkeys(("rotor_speed_rad_s", "hydrodynamic_torque_Nm"), times)
        values = {key: np.array(data[key], dtype=float).reshape(n) for key, n in sizes.items()}
        if not all(np.all(np.isfinite(value)) for value in values.values()):
            raise ValueError
        if any(np.any(values[key] <= 0.0) for key in ("chord_m", "rotor_radius_m")):
            raise ValueError
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        remedy = "delete it to begin anew, or run the case again with --force"
        raise InputError("is no iterate of this case", remedy, file=path) from None
    table = {}
    if (out / "summary.json").exists():
        table = Solution.load(out, extensions=physics.case.extensions).convergence
    radius, shape = physics.blade.rotor_radius, physics.shape
    if shape.radius_bounds is not None:
        radius = float(np.clip(values["rotor_radius_m"][0], *shape.radius_bounds))
    blade = physics.blade.with_rotor_radius(radius)
    found = values["chord_m"], values["twist_rad"], values.get("thickness_over_chord")
    blade = shape.nearest(blade.with_shape(*found))
    over_time = values["rotor_speed_rad_s"], values["hydrodynamic_torque_Nm"]
    operation = Operation(float(values["energy_J"][0]), *over_time)
    history = list(zip(*table.values(), strict=True))
    reference = float(values["reference_energy_J"][0])
    return physics, StartingPoint(blade, values["gains"], operation), reference, history


def _on_mesh(physics: Physics, ends: list) -> Physics:
    """Return physics with the segments' ends (s) of each scenario; ValueError if none of theirs."""
    scenarios = []
    for scenario, own in zip(physics.scenarios, ends, strict=True):
        edges = np.array(own, dtype=float)
        if not (edges.ndim == 1 and np.all(np.isin(scenario.edges, edges))):
            raise ValueError
        if not (np.all(np.diff(edges) > 0.0) and np.all(edges[[0, -1]] == scenario.edges[[0, -1]])):
            raise ValueError
        scenarios.append(replace(scenario, edges=edges))
    return replace(physics, scenarios=tuple(scenarios))
