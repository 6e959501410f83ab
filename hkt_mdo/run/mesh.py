"""How fine the mesh has to be: its error, and the segments to divide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.run.flight import Flight, Optimized
from hkt_mdo.run.judge import (
    MESH_ERROR,
    RECOVERY_ERROR,
    SPEED_ERROR,
    is_false,
    most_between,
    short_of_recovery,
)
from hkt_mdo.start.find import find_start


@dataclass(frozen=True)
class Rules:
    """What decides which segments are divided, relative to what it is compared with.

    Attributes
    ----------
    near_limit : float
        Distance from its bound within which a limit binds at a node.
    short_of : float
        Of the energy: what segments together may fall short of quasi-steady operation; a third of
        the error of the mesh that the judges allow.
    speed : float
        Of the judges' error of speed: what a segment may have before it is divided.
    unchanged : float
        Change of the objective by a division that changes nothing.
    few : int
        Divisions after which a limit that is exceeded between the nodes is lowered instead.
    parts : int
        Parts of a divided segment.
    most, most_dense : int
        Segments: the problem takes several gigabytes; that of a dense optimizer, minutes.
    """

    near_limit: float = 1e-4
    short_of: float = 3e-6
    speed: float = 0.3
    unchanged: float = 1e-7
    few: int = 4
    parts: int = 4
    most: int = 10_000
    most_dense: int = 400


RULES = Rules()


@dataclass(frozen=True, eq=False)
class Division:
    """Error of a mesh and the number of parts of each segment, a row for each scenario.

    Attributes
    ----------
    error : float
        Relative change of the objective on a finer mesh, as far as it is known.
    parts : list of numpy.ndarray
        Of shape (n_segments,) each; empty where the mesh is fine enough.
    """

    error: float
    parts: list[np.ndarray]

    def allowed(self, optimizer: str) -> bool:
        """Tell whether there is something to divide and the optimizer can bear the segments."""
        most = RULES.most_dense if optimizer == "SLSQP" else RULES.most
        return bool(self.parts) and sum(map(np.sum, self.parts)) <= most


def division(
    physics: Physics,
    result: Optimized,
    flights: tuple[Flight, ...],
    near: list[np.ndarray],
    before: Sequence[float],
    branch: str,
) -> Division:
    """Return by how much a finer mesh may change the objective, and what to divide.

    Under open loop the error is how much the last division has changed it; of two divisions that
    form a geometric series, the rest of that series. Before a division it is how far the objective
    is from that of quasi-steady operation of the found blade, which needs no mesh. A feedback law
    leaves the optimizer no torque over time to choose, and its error is none.

    Divided are segments where the integration denies the collocation, where it exceeds a limit or
    is closer to stall between the nodes than at them and, under open loop, those in which a limit
    begins or ceases to bind, or the trajectory falls short of quasi-steady operation.

    Parameters
    ----------
    physics, result, flights
        An optimization's end, integrated.
    near
        What `too_close_to_stall` returns.
    before
        Objectives on the coarser meshes, J, the last one's at the end.
    branch
        That of the start.
    """
    coarse, error = _denied(physics, flights, before), 0.0
    unchanged = before and abs(result.objective / before[-1] - 1.0) < RULES.unchanged
    for marks, close, flight in zip(coarse, near, flights, strict=True):
        if not unchanged:  # by the last division: what is close to stall then is so at the nodes
            marks |= close
        for limit in held(physics, flight.scenario) if len(before) < RULES.few else ():
            marks |= flight.between_nodes(limit)[0] > most_between(limit)
    if not physics.law.is_feedback:
        error = _open_loop(physics, result, flights, coarse, before, branch)
    divided = any(map(np.any, coarse))
    return Division(
        float(error), [np.where(marks, RULES.parts, 1) for marks in coarse] if divided else []
    )


def _denied(physics, flights, before) -> list[np.ndarray]:
    """Return the segments in which the integration denies the collocation."""
    coarse = [np.zeros(each.scenario.segments, dtype=bool) for each in flights]
    if not is_false(flights):
        return coarse
    for marks, flight in zip(coarse, flights, strict=True):
        errors = flight.speed_errors.reshape(marks.size, -1)
        marks |= np.max(errors, axis=1) > RULES.speed * SPEED_ERROR
    # a second time it is another trajectory, which no mesh will mend; Radau's ends are free
    radau = physics.law.is_feedback and physics.case.phase.transcription == "radau"
    if radau or (before and np.mean(np.concatenate(coarse)) > 0.5):
        return [np.zeros_like(marks) for marks in coarse]
    return coarse


def _open_loop(physics, result, flights, coarse, before, branch) -> float:
    """Return the error of the mesh under open loop, and mark in `coarse` what causes it."""
    blade = result.point.blade
    known = replace(physics, shape=replace(physics.shape, blade=blade))

    @cache
    def ideal():
        best = physics.rotor.best_operation(blade)
        return find_start(known, best, improve=False, branch=branch)

    values = [*(before[-2:] or [physics.objective_at(ideal())]), result.objective]
    *change, error = np.abs(np.diff(values)) / max(abs(result.objective), 1e-9)
    if change and error < 0.5 * change[0]:
        error *= error / (change[0] - error)
    if error <= MESH_ERROR:
        return error
    steady = not known.broken_limits(ideal())  # a limited rate of the torque may forbid it
    for marks, flight, best in zip(coarse, flights, known.on_start(ideal()), strict=True):
        marks |= _switches(physics, flight)
        if steady or not np.any(marks):
            marks |= _falls_short(flight, best, result.energy)
    # what the first speed stores is no error of a mesh
    return error if any(map(np.any, coarse)) else RULES.short_of


def too_close_to_stall(
    physics: Physics, result: Optimized, flights: tuple[Flight, ...]
) -> list[np.ndarray]:
    """Return, for each flight, the segments in which a feedback law is too close to stall.

    Returns
    -------
    list of numpy.ndarray
        Of bool, of shape (n_segments,) each.
    """
    if not (physics.law.is_feedback and physics.has_curve):
        return [np.zeros(each.scenario.segments, dtype=bool) for each in flights]
    found = []
    for flight in flights:
        short = short_of_recovery(physics, result, flight)[1:].reshape(flight.scenario.segments, -1)
        found.append(np.max(short, axis=1) > RECOVERY_ERROR)
    return found


def held(physics: Physics, scenario: Scenario) -> list[Limit]:
    """Return the limits over time that the optimization constrains in a scenario."""
    return [limit for limit in physics.limits_in(scenario) if limit.constrains(physics.law)]


def _switches(physics, flight) -> np.ndarray:
    """Return the segments in which a limit begins or ceases to bind, and their neighbours."""
    scenario, nodes = flight.scenario, flight.at_nodes
    found = np.zeros(scenario.segments, dtype=bool)
    for limit in held(physics, scenario):
        binds = limit.excess(nodes) > -RULES.near_limit
        first, *others = binds.reshape(scenario.segments, -1).T
        last = others[-1]
        found |= ~np.all(np.equal(first, others), axis=0)
        found[1:] |= last[:-1] != last[1:]
        found[:-1] |= first[:-1] != first[1:]
    return found


def _falls_short(flight, best, energy) -> np.ndarray:
    """Return the segments that together lose most against quasi-steady operation."""
    scenario, nodes = flight.scenario, flight.trajectory
    steady = CubicSpline(best["time"], best["hydrodynamic_power"])(nodes["time"])
    # where a limit binds, the rotor's inertia moves the captured power, else the generator's
    short = [nodes[name] - steady for name in ("hydrodynamic_power", "generator_power")]
    shape = 2, scenario.segments, scenario.nodes_per_segment
    lost = np.reshape(scenario.node_weights * short, shape).sum(axis=2) / energy
    lost = np.min(np.abs(lost), axis=0)
    found, order = np.zeros(scenario.segments, dtype=bool), np.argsort(lost)
    found[order] = np.cumsum(lost[order]) > RULES.short_of
    return found
