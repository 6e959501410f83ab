"""The state of a run, to which the optimizer reports every evaluation, and its files meanwhile.

`iterate.json` has the design, gains and trajectories from which a resumed run continues.
"""

import json
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import read_bytes
from hkt_mdo.problem.evaluation import split
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import Operation, StartingPoint, StartRecord
from hkt_mdo.results.folder import write_csv, write_json
from hkt_mdo.results.summary import VERSION, PassEntry, Summary
from hkt_mdo.solve.driver_base import Progress

UNFINISHED = "interrupted before the end; hkt run --resume continues from the last iterate"
FEASIBLE = 1e-6
"""Largest scaled violation of an iterate that may be the best of a run: that of a converged one."""
RESUMABLE = 1e-2
"""Largest scaled violation of an iterate from which a run may continue."""
SECONDS_BETWEEN_SAVES = 1.0
"""A save takes milliseconds, an evaluation some ten."""
EVALUATIONS_BETWEEN_POINTS = 5
"""By count, not by time: a resumed run must not depend on the clock."""
ITERATE = 1
"""Version of `iterate.json`; one of before the versions is refused."""
MAX_BYTES = 64 * 1024**2
"""Largest `iterate.json` that is read: an hour of flow takes a tenth of it."""
OVER_TIME = "segment_ends_s", "rotor_speed_rad_s", "hydrodynamic_torque_Nm"
REMEDY = "delete it to begin anew, or run the case again with --force"


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
    physics : Physics
        On the mesh at work.
    point : callable
        Reads the problem at work, as a `StartingPoint`; set before an optimization begins.
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
    point: Callable[[], StartingPoint] = field(init=False)
    best: tuple[Physics, StartingPoint] | None = None
    passes: list[PassEntry] = field(default_factory=list)
    terminated: bool = False
    _highest: float = -np.inf
    _saved: float = 0.0

    def __post_init__(self) -> None:
        """Write the summary that stands in the folder until the run ends."""
        self.physics, name = self.first, self.first.case.name
        self.summary = Summary(version=VERSION, case=name, success=False, message=UNFINISHED)
        self.write_summary()

    def __call__(self, count: int, objective: float, infeasibility: float) -> None:
        """Note an evaluation, and the iterate if a run may continue from it."""
        if self.terminated:
            raise KeyboardInterrupt
        self.history.append((len(self.history), objective, infeasibility))
        if infeasibility <= RESUMABLE:
            if len(self.history) % EVALUATIONS_BETWEEN_POINTS == 0 and infeasibility <= FEASIBLE:
                self.keep(self.point(), objective)
            if time.monotonic() - self._saved >= SECONDS_BETWEEN_SAVES:
                self.go_on_from(self.physics, self.point(), self.start)
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
        merit = self.first.objective.sign * objective
        if merit > self._highest:
            self.best, self._highest = (self.physics, point), merit

    def go_on_from(self, physics: Physics, point: StartingPoint, start: StartingPoint) -> None:
        """Take a point as the last iterate, and write it.

        Parameters
        ----------
        physics, point
            The point from which a resumed run continues, and its physics.
        start
            The start that has led to it.
        """
        self.physics, self.start = physics, start
        write_json(self.out / "iterate.json", as_data(physics, point, start))
        self._saved = time.monotonic()

    def write_history(self) -> None:
        """Write the energy and infeasibility of every evaluation."""
        header = ("evaluation", "energy_J", "infeasibility")
        columns = np.reshape(self.history, (-1, len(header))).T
        write_csv(self.out / "convergence.csv", dict(zip(header, columns, strict=True)))

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


def as_data(physics: Physics, point: StartingPoint, start: StartingPoint) -> dict[str, Any]:
    """Return a point as the data of `iterate.json`: the scenarios' mesh and trajectories by name.

    Parameters
    ----------
    physics
        The physics on the mesh of the point.
    point
        Blade, gains, and the trajectories at the samples of every scenario.
    start
        The start that has led to it.
    """
    pairs = zip(physics.scenarios, split(physics, point.operation), strict=True)
    names = *OVER_TIME, *physics.law.states
    over_time = {x.name: dict(zip(names, (x.edges, *series), strict=True)) for x, series in pairs}
    return {
        "version": ITERATE,
        "chord_m": point.blade.chord,
        "twist_rad": point.blade.twist,
        "thickness_over_chord": point.blade.thickness,
        "rotor_radius_m": point.blade.rotor_radius,
        "hub_inertia_kg_m2": point.blade.hub_inertia,
        "gains": point.gains,
        "energy_J": point.operation.energy,
        "reference_energy_J": start.reference,
        "branch": start.branch,
        "starts": [vars(record) for record in start.starts],
        "scenarios": over_time,
    }


def read_iterate(out: Path, physics: Physics) -> tuple[Physics, StartingPoint | None]:
    """Return the physics on an earlier run's mesh, and its last iterate; None if there is none.

    Parameters
    ----------
    out
        The result folder.
    physics
        The case's, on its own mesh.

    Raises
    ------
    InputError
        If the file is no iterate of this case, or of a newer version.
    """
    path = out / "iterate.json"
    if not path.exists():
        return physics, None
    content = read_bytes(path, MAX_BYTES, "iterate of a run")
    try:
        data = json.loads(content)
        if data["version"] > ITERATE:
            raise InputError("was written by a newer version of hkt_mdo", REMEDY, file=path)
        physics, operation = _over_time(physics, data)
        blade, gains, reference = _design(physics, data)
        starts = tuple(map(_record, data.get("starts", ())))
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        raise InputError("is no iterate of this case", REMEDY, file=path) from None
    origin = {"branch": str(data.get("branch", "")), "starts": starts, "reference": reference}
    return physics, StartingPoint(blade, gains, operation, **origin)


def _record(data) -> StartRecord:
    """Return the record of a start; JSON has null where a number is not finite."""
    missing = {"objective": np.nan, "excess": np.inf}
    numbers = {x: y if data[x] is None else float(data[x]) for x, y in missing.items()}
    return StartRecord(**data | numbers | {"exceeds": tuple(data["exceeds"])})


def _numbers(row, size) -> np.ndarray:
    """Return a row of finite numbers of a size; ValueError if it is none."""
    values = np.array(row, dtype=float).reshape(size)
    if not np.all(np.isfinite(values)):
        raise ValueError
    return values


def _over_time(physics, data) -> tuple[Physics, Operation]:
    """Return the physics on the mesh of an iterate, and its trajectories."""
    entries = data["scenarios"]
    if entries.keys() != {scenario.name for scenario in physics.scenarios}:
        raise ValueError
    scenarios, rows = [], []
    for scenario in physics.scenarios:
        ends, *series = (entries[scenario.name][key] for key in (*OVER_TIME, *physics.law.states))
        edges, before = np.array(ends, dtype=float), scenario.edges
        same = np.array_equal(edges[[0, -1]], before[[0, -1]]) and np.all(np.isin(before, edges))
        if edges.ndim != 1 or not same or not np.all(np.diff(edges) > 0.0):
            raise ValueError
        scenarios.append(replace(scenario, edges=edges))
        rows.append([_numbers(row, scenarios[-1].samples.size) for row in series])
    energy = float(_numbers(data["energy_J"], 1)[0])
    speed, torque, *states = np.concatenate(rows, axis=1)
    operation = Operation(energy, speed, torque, states=tuple(states))
    return replace(physics, scenarios=tuple(scenarios)), operation


def _design(physics, data):
    """Return blade, gains and reference of an iterate."""
    shape, stations = physics.shape, physics.blade.r.size
    names = ["chord_m", "twist_rad", *["thickness_over_chord"] * ("thickness" in shape.bases)]
    rows = [_numbers(data[name], stations) for name in names]
    keys = "rotor_radius_m", "reference_energy_J"
    radius, reference = (float(_numbers(data[key], 1)[0]) for key in keys)
    if np.any(rows[0] <= 0.0) or radius <= 0.0:
        raise ValueError
    hub = _numbers(data["hub_inertia_kg_m2"], 1)[0] if physics.designs_hub else None
    gains = _numbers(data["gains"], len(physics.law.gain_units))
    return shape.nearest(physics.sized(radius, hub).with_shape(*rows)), gains, reference
