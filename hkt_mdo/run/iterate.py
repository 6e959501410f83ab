"""`iterate.json`: the design, gains and trajectories from which a resumed run continues."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import read_bytes
from hkt_mdo.problem.evaluation import split
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import Operation, StartingPoint, StartRecord

VERSION = 1
"""Of the file; one of before the versions is refused."""
MAX_BYTES = 64 * 1024**2
"""Largest file that is read: an hour of flow takes a tenth of it."""
OVER_TIME = "segment_ends_s", "rotor_speed_rad_s", "hydrodynamic_torque_Nm"
REMEDY = "delete it to begin anew, or run the case again with --force"


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
    over_time = {x.name: dict(zip(names, (x.edges, *own), strict=True)) for x, own in pairs}
    return {
        "version": VERSION,
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
        if data.get("version", 0) > VERSION:
            raise InputError("was written by a newer version of hkt_mdo", REMEDY, file=path)
        physics, operation = _over_time(physics, data)
        blade, gains, reference = _design(physics, data)
        starts = tuple(map(_record, data.get("starts", ())))
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        raise InputError("is no iterate of this case", REMEDY, file=path) from None
    about = {"branch": str(data.get("branch", "")), "starts": starts, "reference": reference}
    return physics, StartingPoint(blade, gains, operation, **about)


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
    found = data["scenarios"]
    if found.keys() != {scenario.name for scenario in physics.scenarios}:
        raise ValueError
    scenarios, rows = [], []
    for scenario in physics.scenarios:
        ends, *own = (found[scenario.name][key] for key in (*OVER_TIME, *physics.law.states))
        edges, before = np.array(ends, dtype=float), scenario.edges
        same = np.array_equal(edges[[0, -1]], before[[0, -1]]) and np.all(np.isin(before, edges))
        if edges.ndim != 1 or not same or np.any(np.diff(edges) <= 0.0):
            raise ValueError
        scenarios.append(replace(scenario, edges=edges))
        rows.append([_numbers(row, scenarios[-1].samples.size) for row in own])
    energy = float(_numbers(data["energy_J"], 1)[0])
    speed, torque, *states = np.concatenate(rows, axis=1)
    operation = Operation(energy, speed, torque, states=tuple(states))
    return replace(physics, scenarios=tuple(scenarios)), operation


def _design(physics, data):
    """Return blade, gains and reference of an iterate."""
    shape, stations = physics.shape, physics.blade.r.size
    names = ["chord_m", "twist_rad", *["thickness_over_chord"] * ("thickness" in shape.bases)]
    found = [_numbers(data[name], stations) for name in names]
    radius, reference = (
        float(_numbers(data[key], 1)[0]) for key in ("rotor_radius_m", "reference_energy_J")
    )
    if np.any(found[0] <= 0.0) or radius <= 0.0:
        raise ValueError
    hub = _numbers(data["hub_inertia_kg_m2"], 1)[0] if physics.designs_hub else None
    gains = _numbers(data["gains"], len(physics.law.gain_units))
    return shape.nearest(physics.sized(radius, hub).with_shape(*found)), gains, reference
