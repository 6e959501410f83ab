"""How fine the mesh has to be: its error, and the segments to divide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.quantities import RATES
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.run.flight import Flight, Optimized
from hkt_mdo.run.judge import (
    MESH_ERROR,
    RECOVERY_ERROR,
    SPEED_ERROR,
    is_false,
    most_between,
    short_of_recovery,
)


@dataclass(frozen=True)
class Rules:
    """Thresholds that decide which segments are divided, as relative values.

    Attributes
    ----------
    near_limit : float
        Distance from its bound within which a limit binds at a node.
    short_of : float
        Share of the energy that may be lost in segments that are not divided; a third of the error
        of the mesh that the judges allow.
    speed : float
        Share of the judges' largest error of speed above which a segment is divided.
    unchanged : float
        Change of the objective by a division that changes nothing.
    few : int
        Divisions after which a limit that is exceeded between the nodes is lowered instead.
    hair : float
        Relative excess of an open loop's limit between the nodes up to which it may be lowered
        instead, where that costs little.
    parts, parts_rates : int
        Parts of a divided segment; the latter where a rate is limited, which is a second derivative
        of the speed (`test_a_limited_rate_of_the_torque_is_one_optimum_in_speed_and_in_torque`).
    nearly_all : float
        Share of the segments that are too coarse from which an open loop's polynomials are too low.
    higher : int
        Order of the polynomials then.
    most, most_dense : int
        Segments: the problem takes several gigabytes; that of a dense optimizer, minutes.
    """

    near_limit: float = 1e-4
    short_of: float = 3e-6
    speed: float = 0.3
    unchanged: float = 1e-7
    few: int = 6
    hair: float = 5e-3
    parts: int = 4
    parts_rates: int = 8
    nearly_all: float = 0.5
    higher: int = 5
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
    order : int
        Higher order that all segments' polynomials need instead; 0: none.
    """

    error: float
    parts: list[np.ndarray]
    order: int = 0

    def allowed(self, optimizer: str) -> bool:
        """Tell whether there is something to divide and the optimizer can handle the segments."""
        most = RULES.most_dense if optimizer == "SLSQP" else RULES.most
        return bool(self.parts) and sum(map(np.sum, self.parts)) <= most


def division(
    physics: Physics,
    result: Optimized,
    flights: tuple[Flight, ...],
    near: list[np.ndarray],
    before: Sequence[float],
) -> Division:
    """Return by how much a finer mesh may change the objective, and the segments to divide.

    Under open loop the error is the smaller of two: what the last division leaves to be gained, if
    the error is of the first order, by how much it has changed the objective; and the power in the
    distance that the polynomials keep from the limits that bind in their segments, which is too
    much where a limit begins or ceases to bind. A feedback law leaves the optimizer no torque over
    time to choose, and its error is none.

    Divided are segments where the integration contradicts the collocation, where it exceeds a limit
    or is closer to stall between the nodes than at them and, under open loop, those in which a
    limit begins or ceases to bind, or that keep most of that power. Where these are nearly all, as
    with a heavy rotor, whose torque has an error of the acceleration, polynomials of a higher order
    do better than shorter segments.

    Parameters
    ----------
    physics, result, flights
        An optimization's end, integrated.
    near
        Result of `too_close_to_stall`.
    before
        Objectives on the coarser meshes, J, the last one's at the end.
    """
    coarse, error = _contradicted(physics, flights, before), 0.0
    unchanged = before and abs(result.objective / before[-1] - 1.0) < RULES.unchanged
    for marks, close, flight in zip(coarse, near, flights, strict=True):
        if flight.scenario.steady:  # has no mesh
            continue
        if not unchanged:  # by the last division: close to stall now means at the nodes
            marks |= close
        for limit in held(physics, flight.scenario) if len(before) < RULES.few else ():
            over = flight.of_model.between_nodes(limit)[0]
            nodes = limit.excess(flight.of_model.at_nodes).reshape(marks.size, -1)
            # what is exceeded at the nodes as well, no division corrects
            found = (over > most_between(limit)) & (np.max(nodes, axis=1) < 0.5 * over)
            lost = np.sum(_energies(flight, result.energy), axis=1) @ np.where(found, over, 0.0)
            by_a_hair = np.max(over) <= RULES.hair and lost <= RULES.short_of
            if physics.law.is_feedback or not by_a_hair:
                marks |= found  # otherwise lowering an open loop's limit there costs very little
    if not physics.law.is_feedback:
        error = _open_loop(physics, result, flights, coarse, before)
    if not any(map(np.any, coarse)):
        return Division(float(error), [])
    mesh = physics.scenarios[0].mesh
    if (
        error > MESH_ERROR
        and mesh.transcription == "gauss-lobatto"
        and mesh.order < RULES.higher
        and np.mean(np.concatenate(coarse)) > RULES.nearly_all
    ):
        return Division(float(error), [np.ones(x.size, dtype=int) for x in coarse], RULES.higher)
    return Division(float(error), [np.where(marks, _parts(physics), 1) for marks in coarse])


def _contradicted(physics, flights, before) -> list[np.ndarray]:
    """Return the segments in which the integration contradicts the collocation."""
    coarse = [np.zeros(each.scenario.segments, dtype=bool) for each in flights]
    if not is_false(flights):
        return coarse
    # where only the energies differ, speeds differ less than the judges allow
    worst = max(np.max(flight.speed_errors) for flight in flights)
    for marks, flight in zip(coarse, flights, strict=True):
        if flight.scenario.steady:
            continue
        errors = flight.speed_errors.reshape(marks.size, -1)
        marks |= np.max(errors, axis=1) > RULES.speed * min(SPEED_ERROR, worst)
    # the second time it is another trajectory, which no mesh corrects; Radau's ends are free
    radau = physics.law.is_feedback and physics.case.phase.transcription == "radau"
    if radau or (before and np.mean(np.concatenate(coarse)) > 0.5):
        return [np.zeros_like(marks) for marks in coarse]
    return coarse


def _open_loop(physics, result, flights, coarse, before) -> float:
    """Return the error of the mesh under open loop, and mark in `coarse` what causes it."""
    best = physics.rotor.best_operation(result.point.blade).power_coefficient
    left = [_left(physics, flight, result.energy, best) for flight in flights]
    known = float(sum(map(np.sum, left)))
    change = abs(result.objective / before[-1] - 1.0) if before else np.inf
    # the distance from a limit on the torque's rate is no power: only a division shows its error
    rates = _limits_rates(physics)
    error = change if rates and before else min(change / (_parts(physics) - 1), known)
    if error <= MESH_ERROR and (before or not rates):
        return error
    for marks, flight, own in zip(coarse, flights, left, strict=True):
        if flight.scenario.steady:
            continue
        marks |= _switches(physics, flight) | (own > 0.0 if rates and not before else _most(own))
    return error


def _parts(physics) -> int:
    """Return the number of parts into which a segment is divided."""
    return RULES.parts_rates if _limits_rates(physics) else RULES.parts


def _limits_rates(physics) -> bool:
    """Tell whether a limit on a rate holds in some scenario."""
    return any(x.is_of(RATES) for each in physics.scenarios for x in held(physics, each))


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
        if flight.scenario.steady:
            found.append(np.zeros(flight.scenario.segments, dtype=bool))
            continue
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


def _left(physics, flight, energy, best) -> np.ndarray:
    """Return the energy that the mesh may lose in every segment, as a share of the whole.

    In a segment in which a limit binds at a node, the polynomials keep it at the others as well, at
    a distance. The power in that distance is what a finer mesh may gain, to first order. Elsewhere
    it is the difference of the power coefficient from its largest, `best`, if the objective is that
    energy.
    """
    scenario, nodes = flight.scenario, flight.at_nodes
    if scenario.steady:
        return np.zeros(scenario.segments)
    flown = flight.integrated
    short = np.zeros(scenario.segments)
    if physics.objective.is_energy and physics.starting_generator is None:
        density = physics.of(scenario).density
        scale = power_scale(density, flight.scalars["rotor_radius"], flown["inflow_speed"])
        short = scale * best - flown["hydrodynamic_power"]
        short = np.mean(short[1:].reshape(scenario.segments, -1), axis=1)
        short *= np.diff(scenario.edges) * scenario.weight / abs(energy)
    over = [limit.excess(nodes) for limit in held(physics, scenario)]
    if not over:
        return short
    room = np.maximum(-np.max(np.broadcast_arrays(*over), axis=0), 0.0)
    room = room.reshape(scenario.segments, -1)
    binds = np.min(room, axis=1) < RULES.near_limit
    return np.where(binds, np.sum(room * _energies(flight, energy), axis=1), np.maximum(short, 0.0))


def _energies(flight, energy) -> np.ndarray:
    """Return the shares of the nodes of every segment in the energy, (segments, nodes)."""
    scenario = flight.scenario
    power = np.abs(flight.trajectory["hydrodynamic_power"]) * scenario.node_weights
    return power.reshape(scenario.segments, -1) * (scenario.weight / abs(energy))


def _most(lost: np.ndarray) -> np.ndarray:
    """Return the segments with nearly all of the loss together."""
    found, order = np.zeros(lost.size, dtype=bool), np.argsort(lost)
    found[order] = np.cumsum(lost[order]) > RULES.short_of
    return found
