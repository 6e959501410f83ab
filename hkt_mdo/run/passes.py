"""The passes of a run: optimize, and again until nothing that a pass has set stands in the way."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.dynamics.limits import SLOWED, Limit
from hkt_mdo.dynamics.trajectory import QUANTITIES
from hkt_mdo.problem.build import assemble, make_driver
from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.point import Operation, StartingPoint
from hkt_mdo.problem.setup import NARROW, Setup, curve_nodes
from hkt_mdo.rotor.components import rotor_inputs
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.run.flight import Flight, Optimized, fly
from hkt_mdo.run.judge import (
    MESH_ERROR,
    RECOVERY_ERROR,
    SPEED_ERROR,
    curve_errors,
    is_false,
    most_between,
    recovers,
    short_of_recovery,
)
from hkt_mdo.run.log import Log
from hkt_mdo.start.find import find_start

MAX_PASSES = 24
# recovery of the start, over a typical torque, below which it is a constraint from the beginning
NEAR_STALL = 0.022
WORTHWHILE = 1e-6  # relative gain of the objective for which a move limit is re-centred again
NEAR_LIMIT = 1e-4  # relative distance from its bound within which a limit binds at a node
SHORT_OF = 3e-6  # of the energy: what segments together may fall short of quasi-steady operation
# segments, whose problem takes several gigabytes; of a dense optimizer, minutes
MOST_DIVIDED, MOST_DENSE = 10_000, 400
FEW_DIVISIONS = 4  # after as many, a limit exceeded between the nodes is lowered at the nodes
MOST_LOWERED = 5e-3  # by which it is lowered at most
MOST_EXCEEDED = 0.02  # beyond which lowering it does not help
PARTS = 4  # of a segment in which a limit begins or ceases to bind
FAR = 0.05  # relative excess of a limit from which a start is far from any optimum
FIRST_ITERATIONS = 300  # after as many, an optimization has lost its way


def optimize(
    physics: Physics, start: StartingPoint, log: Log
) -> tuple[Physics, Optimized, tuple[Flight, ...]]:
    """Optimize from a start until nothing that a pass has set stands in the way; integrate.

    That is: the torque curve is fine enough, no move limit is active, a rotor under feedback
    recovers from a small loss of speed (for that a constraint is added, of twice the loss where the
    integration denies the collocation), the mesh is fine enough where the open loop begins or
    ceases to meet a limit, and every limit holds between the nodes too (for that it is lowered at
    the nodes of a segment). The physics that are returned have the last mesh.
    """
    slowed = SLOWED if np.any(start.operation.margin < NEAR_STALL) else 0.0
    setup = Setup(start, curve_nodes(physics, start), slowed=slowed)
    objective, at_limit, coarser, ended = np.inf, False, [], None
    is_near = max(physics.excesses(start).values(), default=0.0) < FAR
    for _ in range(MAX_PASSES):
        solved, result = physics, _solve(physics, setup, log, is_near)
        if not result.outcome.success:
            if setup.moves == NARROW:
                return _coarser(ended, physics, objective) or (
                    physics,
                    result,
                    fly(physics, result),
                )
            setup = _in_smaller_moves(physics, setup, log.last)
            continue
        if not setup.slowed and not recovers(physics, result):
            setup = replace(setup, slowed=SLOWED)
            continue
        gained = abs(result.objective / objective - 1.0) > WORTHWHILE
        objective = result.objective
        at_limit = gained and setup.moves.reached(physics, setup.start, result.point)
        flights = fly(physics, result)
        at_limit = at_limit and not is_false(flights)  # a false solution leads nowhere
        near = _near_stall(physics, result, flights)
        if not setup.slowed and any(map(np.any, near)):
            setup = replace(setup, slowed=SLOWED)
            continue
        again = _refined(physics, setup, result, flights, at_limit)
        if again is None:
            error, parts = _mesh_error(physics, result, flights, near, coarser, start.branch)
            result = replace(result, mesh_error=error)
            ended = physics, result, flights
            most = MOST_DENSE if physics.case.driver.optimizer == "SLSQP" else MOST_DIVIDED
            if parts and sum(map(np.sum, parts)) <= most:
                coarser.append(result.objective)
                physics, setup = _on_finer_mesh(physics, setup, result, parts)
                log.save(setup.start, physics)
                continue
            again = _lowered(physics, setup, result, flights)
            if again is None:
                return ended
        setup = again
    if at_limit:  # an optimum between limits of our own making is none
        message = f"still at a move limit after {MAX_PASSES} optimizations"
        ended = replace(result.outcome, success=False, message=message)
        result = replace(result, outcome=ended)
    return solved, result, fly(solved, result)  # the last pass may have divided the mesh of physics


def _coarser(ended, physics, objective):
    """Return what an optimization on a coarser mesh ended with, None if there is none.

    Where one on the finer mesh has succeeded, its objective tells the error of the coarser mesh.
    """
    if ended is None:
        return None
    before, result, flights = ended
    if before is not physics and objective != result.objective:
        error = abs(objective / result.objective - 1.0)
        result = replace(result, mesh_error=error)
    return before, result, flights


def _in_smaller_moves(physics, setup, last):
    """Return the setup after an optimization lost its way, from the better of start and last."""
    if last.operation.energy > setup.start.operation.energy:
        setup = replace(setup, start=last, nodes=curve_nodes(physics, last))
    return replace(setup, moves=NARROW)


def _refined(physics, setup, result, flights, at_limit) -> Setup | None:
    """Return the setup of the next pass; None if none is needed."""
    curve_ok = not physics.has_curve or (
        np.max(curve_errors(physics, result)[1]) <= physics.case.hydrodynamics.tolerance
    )
    if curve_ok and not at_limit:
        near_stall = physics.law is not None and physics.has_curve and setup.slowed <= SLOWED
        near_stall &= physics.case.phase.transcription != "radau"  # whose false speeds are its own
        if near_stall and is_false(flights):  # there a collocation may follow a false branch
            return replace(setup, slowed=2.0 * SLOWED)
        return None
    nodes = curve_nodes(physics, result.point, finer=not curve_ok)
    return replace(setup, start=result.point, nodes=nodes)


def _mesh_error(physics, result, flights, near, coarser, branch) -> tuple[float, list[np.ndarray]]:
    """Return by how much a finer mesh may change the objective, relatively, and what to divide.

    `near` is that of `_near_stall`; `coarser` has the objectives on the meshes before, the last
    one's at the end. Under open loop the error is how much the last division has changed it; of two
    divisions that form a geometric series, the rest of that series. Before a division it is how far
    the objective is from that of quasi-steady operation of the found blade, which needs no mesh. A
    feedback law leaves the optimizer no torque over time to choose, and its error is none.

    What to divide is the number of parts of each segment, empty where the mesh is fine enough.
    Divided are segments where the integration denies the collocation, where it exceeds a limit or
    is closer to stall between the nodes than at them and, under open loop, those in which a limit
    begins or ceases to bind, or the trajectory falls short of quasi-steady operation.
    """
    coarse, error = [np.zeros(each.scenario.segments, dtype=bool) for each in flights], 0.0
    if is_false(flights):
        for marks, flight in zip(coarse, flights, strict=True):
            errors = flight.speed_errors.reshape(marks.size, -1)
            marks |= np.max(errors, axis=1) > 0.3 * SPEED_ERROR
        # a second time it is another trajectory, which no mesh will mend; Radau's ends are free
        radau = physics.law is not None and physics.case.phase.transcription == "radau"
        if radau or (coarser and np.mean(np.concatenate(coarse)) > 0.5):
            coarse = [np.zeros_like(marks) for marks in coarse]
    unchanged = coarser and abs(result.objective / coarser[-1] - 1.0) < 0.1 * WORTHWHILE
    for marks, close, flight in zip(coarse, near, flights, strict=True):
        if not unchanged:  # by the last division: what is close to stall then is so at the nodes
            marks |= close
        for limit in _held(physics) if len(coarser) < FEW_DIVISIONS else ():
            marks |= flight.between_nodes(limit)[0] > most_between(limit)
    if physics.law is None:
        blade = result.point.blade
        known = replace(physics, shape=replace(physics.shape, blade=blade))

        @cache
        def ideal():
            best = best_operation(blade, physics.polar)
            return find_start(known, best, improve=False, branch=branch)

        values = np.array([*(coarser[-2:] or [physics.objective_at(ideal())]), result.objective])
        *before, error = np.abs(np.diff(values)) / max(abs(result.objective), 1e-9)
        if before and error < 0.5 * before[0]:
            error *= error / (before[0] - error)
        if error > MESH_ERROR:
            steady = not known.broken_limits(ideal())  # a limited rate of the torque may forbid it
            for marks, flight, best in zip(coarse, flights, known.on_start(ideal()), strict=True):
                marks |= _switches(physics, flight)
                if steady or not np.any(marks):
                    marks |= _falls_short(flight, best, result.energy)
            if not any(map(np.any, coarse)):  # what the first speed stores, and no error of a mesh
                error = SHORT_OF
    divided = any(map(np.any, coarse))
    return float(error), [np.where(marks, PARTS, 1) for marks in coarse] if divided else []


def _near_stall(physics, result, flights) -> list[np.ndarray]:
    """Return, for each flight, the segments in which a feedback law is too close to stall."""
    if physics.law is None or not physics.has_curve:
        return [np.zeros(each.scenario.segments, dtype=bool) for each in flights]
    found = []
    for flight in flights:
        short = short_of_recovery(physics, result, flight)[1:].reshape(flight.scenario.segments, -1)
        found.append(np.max(short, axis=1) > RECOVERY_ERROR)
    return found


def _switches(physics, flight) -> np.ndarray:
    """Return the segments in which a limit begins or ceases to bind, and their neighbours."""
    scenario, nodes = flight.scenario, flight.at_nodes
    found = np.zeros(scenario.segments, dtype=bool)
    for limit in _held(physics):
        binds = limit.excess(nodes) > -NEAR_LIMIT
        first, *others = binds.reshape(scenario.segments, -1).T
        last = others[-1]
        found |= ~np.all(np.equal(first, others), axis=0)
        found[1:] |= last[:-1] != last[1:]
        found[:-1] |= first[:-1] != first[1:]
    return found


def _held(physics) -> list[Limit]:
    """Return the limits over time that the optimization constrains."""
    control = physics.case.control
    return [each for each in physics.limits if each.place == "time" and each.constrains(control)]


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
    found[order] = np.cumsum(lost[order]) > SHORT_OF
    return found


def _on_finer_mesh(physics, setup, result, parts) -> tuple[Physics, Setup]:
    """Return the physics with segments divided into parts, and the setup of the next pass."""
    scenarios = [each.divided(own) for each, own in zip(physics.scenarios, parts, strict=True)]
    by_name = {each.name: own for each, own in zip(scenarios, parts, strict=True)}
    physics = replace(physics, scenarios=tuple(scenarios))
    point = _point(physics, result.problem)
    shares = {  # a finer mesh may need no lower limit
        (limit, scenario): np.repeat(np.where(by_name[scenario] > 1, 1.0, share), by_name[scenario])
        for (limit, scenario), share in setup.shares.items()
    }
    return physics, replace(setup, start=point, shares=shares)


def _lowered(physics, setup, result, flights) -> Setup | None:
    """Return the setup with lower limits, where they are exceeded between nodes; None if all hold.

    They are lowered in the segments that need it: elsewhere a lower limit would only cost energy.
    """
    shares, exceeded = dict(setup.shares), False
    for limit in _held(physics):
        if not np.isfinite(limit.upper):
            continue
        most = most_between(limit)
        for flight in flights:
            over, _ = flight.between_nodes(limit)
            share = setup.share(limit, flight.scenario)
            # where it has not helped, or the limit is exceeded by much, no lower limit mends it
            mends = (share > 1.0 - MOST_LOWERED) & (over < MOST_EXCEEDED)
            over = np.where(mends, over, 0.0)
            if np.max(over) > most:
                exceeded = True
                shares[limit.name, flight.scenario.name] = share * (
                    1.0 - np.where(over > 0.5 * most, over, 0.0)
                )
    nodes = curve_nodes(physics, result.point)
    return replace(setup, start=result.point, nodes=nodes, shares=shares) if exceeded else None


def _solve(physics: Physics, setup: Setup, log: Log, near: bool) -> Optimized:
    """Run one optimization; `near`: see `make_driver`."""
    most = None if setup.moves == NARROW else FIRST_ITERATIONS
    driver = make_driver(physics, log, most, near)
    problem = assemble(physics, setup, driver, log.scratch)
    log.add_recorders(problem)
    try:
        problem.final_setup()  # opens the recorders' files
        try:
            # OpenMDAO's drivers run only what the design moves; the flow at the nodes is not
            problem.run_model()
            log.point = lambda: _point(physics, problem)
            problem.run_driver()
        finally:
            log.record_final(problem)
    finally:
        problem.cleanup()
    result = collect(physics, setup, problem, problem.driver.outcome())
    if result.outcome.success:
        log.keep(result.point, result.objective)
    return result


def collect(physics: Physics, setup: Setup, problem, outcome) -> Optimized:
    """Return a problem as it stands as the end of an optimization."""
    return Optimized(
        problem,
        outcome,
        setup,
        _point(physics, problem),
        tuple(
            {name: _series(problem, scenario, name) for name in (*QUANTITIES, *physics.states)}
            for scenario in physics.scenarios
        ),
        *(
            float(problem.get_val(name)[0])
            for name in (
                "energy",
                "generator_energy",
                "electrical_energy",
                "objective",
                "inertia",
                "mass",
            )
        ),
        problem.get_val("torque_coefficient_table") if physics.has_curve else np.empty(0),
    )


def _series(problem, scenario, name) -> np.ndarray:
    return problem.get_val(f"{scenario.path}.{name}").ravel()


def _point(physics: Physics, problem) -> StartingPoint:
    """Return the design and trajectories at which a problem stands as the start of another."""
    sampled = {"rotor_speed": [], "hydrodynamic_torque": []}
    for scenario in physics.scenarios:
        time, first = np.unique(_series(problem, scenario, "time"), return_index=True)
        for name, values in sampled.items():
            spline = CubicSpline(time, _series(problem, scenario, name)[first])
            values.append(spline(scenario.samples))
    speed, torque = (np.concatenate(values) for values in sampled.values())
    gains = [problem.get_val(f"gain_{i}")[0] for i in range(len(physics.gain_units))]
    blade = physics.blade.with_rotor_radius(float(problem.get_val("rotor_radius")[0]))
    names = [name for name in rotor_inputs(blade) if name != "rotor_radius"]
    return StartingPoint(
        blade.with_shape(*map(problem.get_val, names)),
        np.array(gains, dtype=float),
        Operation(float(problem.get_val("energy")[0]), speed, torque),
    )
