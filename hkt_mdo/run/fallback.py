"""What a run that fails leaves: the best of its end, its best iterate and its start.

Each is flown and judged as it stands; few refusals count more than the objective.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hkt_mdo.problem.build import assemble
from hkt_mdo.problem.physics import START_EXCESS, Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.rotor.shape import POINTS
from hkt_mdo.run.flight import Flight, Optimized, fly, total
from hkt_mdo.run.judge import BELOW_START, judge
from hkt_mdo.run.log import Log
from hkt_mdo.run.passes import collect

FEW_ITERATIONS = 300  # as many are little for an optimizer


def best_of(
    physics: Physics, optimum, result: Optimized, flights: tuple[Flight, ...], others, log: Log
) -> tuple[Physics, Optimized, tuple[Flight, ...], str]:
    """Return the best of a failed run's end and others, its physics, and words for what it is.

    Others are (physics, point or None, words): the meshes of iterates and start may differ.
    """
    best = physics, result, flights, ""
    worth = _worth(physics, optimum, log, result, flights)
    for world, point, word in others:
        if point is None or not point.operation.running:
            continue
        other = as_it_stands(world, point, result, log)
        flown = fly(world, other)
        value = _worth(world, optimum, log, other, flown)
        if value > worth:
            best, worth = (world, other, flown, word), value
    return best


def as_it_stands(physics: Physics, point: StartingPoint, ended: Optimized, log: Log) -> Optimized:
    """Return a point as the result of an optimization that ended without success."""
    setup = Setup(point, curve_nodes(physics, point))
    problem = assemble(physics, setup, work_dir=log.scratch)
    problem.run_model()
    message = "its result was refused" if ended.outcome.success else ended.outcome.message
    problem.cleanup()
    return collect(physics, setup, problem, replace(ended.outcome, success=False, message=message))


def moving_reference(physics: Physics, start: StartingPoint, ended: Optimized, log: Log) -> float:
    """Return the objective of a start as its rotor moves, J; 0 if it stops or breaks a limit.

    A quasi-steady start follows every gust at once, which a rotor with inertia cannot.
    """
    stands = as_it_stands(physics, start, ended, log)
    flights = fly(physics, stands)
    for flight in flights:
        held = [each for each in physics.limits if each.place == "time"]
        parts = flight.at_nodes, flight.flown  # a law with states meets others than at rest
        over = [np.max(each.excess(known)) for each in held for known in parts]
        if flight.simulation.stopped_at is not None or max(over) > START_EXCESS:
            return 0.0
    return total(flights, lambda flight: flight.objective(physics.objective))


def _worth(physics, optimum, log, result, flights):
    """Return what ranks results: large refusals, all refusals, the integration's objective.

    A start in balance at every instant exceeds a torque limit by what turns the rotor faster: that
    is better than an end that is false or by more than `BELOW_START` worse, and only then.
    """
    checks = judge(physics, optimum, log.reference, result, flights)
    large = sum(check.value > max(check.limit, BELOW_START) for check in checks)
    refused = sum(not check.passed for check in checks)
    return -large, -refused, total(flights, lambda flight: flight.objective(physics.objective))


def first_remedy(physics: Physics, result: Optimized) -> str:
    """Return the one thing to try first where an optimizer did not converge."""
    case, points = physics.case, physics.shape.points
    stations = physics.blade.r.size
    if physics.shape.designs_chord and stations > POINTS + 1:
        free = [name for name, count in points.items() if count > POINTS + 1]
        if free:
            return "try " + " and ".join(f"design.{name}_points: {POINTS}" for name in free)
    if case.start.method == "blade":
        return "try start.method: quasi_steady"
    if case.driver.max_iterations < min(FEW_ITERATIONS, result.outcome.iterations + 10):
        return f"try driver.max_iterations: {10 * FEW_ITERATIONS // 3}"
    other = "SLSQP" if case.driver.optimizer == "IPOPT" else "IPOPT"
    return f"try driver.optimizer: {other}"
