"""A result with its integrations and checks, measured by its start; the best where a run fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import START_EXCESS, StartingPoint
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.rotor.shape import POINTS
from hkt_mdo.run.checks import BELOW_START, Checked
from hkt_mdo.run.optimization import assembled
from hkt_mdo.run.state import RunState
from hkt_mdo.run.verification import Optimized, Verification, simulated_objective, verify
from hkt_mdo.start.find import bounding_optimum


def checked(
    state: RunState,
    start: StartingPoint,
    reference: float,
    result: Optimized,
    verifications: tuple[Verification, ...] = (),
) -> Checked:
    """Return a result, of a run that began at a start, with its integrations; they may be given."""
    verifications = verifications or verify(result)
    if result.objective < (1.0 - BELOW_START) * reference:
        reference = min(reference, _moving_reference(state, start, result))
    optimum = bounding_optimum(result.physics, state.optimum, result.point.blade)
    return Checked(start, result, verifications, optimum, reference)


def quasi_steady_reference(physics: Physics, start: StartingPoint) -> float:
    """Return the objective of a start, J; 0 where it is no measure of the optimum.

    A start that breaks a limit may be better than the best design that keeps it.

    Parameters
    ----------
    physics
        On the mesh of the start.
    start
        Found by quasi-steady co-design.
    """
    if physics.start_objective is not physics.objective:  # the start maximizes another quantity
        return 0.0
    if len(physics.rotors) > 1:  # its operation is that of the case's own turbine
        return 0.0
    if not start.operation.running or start.excess > START_EXCESS or np.isnan(start.objective):
        return 0.0
    return start.objective - physics.price_of(start.blade)


def _moving_reference(state, start, result) -> float:
    """Return the objective of a start with the rotor's inertia, J; 0 if it breaks a limit.

    A quasi-steady start follows every gust at once, which a rotor with inertia cannot.
    """
    physics = state.first
    verifications = verify(as_it_stands(state, physics, start, result))
    for verification in verifications:
        limits = physics.limits_in(verification.scenario)
        # a law with states has other states over time than in equilibrium
        over = [
            np.max(x.excess(at))
            for x in limits
            for at in (verification.at_nodes, verification.simulated)
        ]
        if verification.simulation.stopped_at is not None or max(over) > START_EXCESS:
            return 0.0
    return simulated_objective(verifications)


def as_it_stands(
    state: RunState, physics: Physics, point: StartingPoint, ended: Optimized
) -> Optimized:
    """Return a point as the result of an optimization without success.

    Parameters
    ----------
    state
        State of the run.
    physics, point
        A start or an iterate, and the physics on its mesh.
    ended
        The optimization whose outcome it takes.
    """
    message = "its result was refused" if ended.outcome.success else ended.outcome.message
    outcome = replace(ended.outcome, success=False, message=message)
    return assembled(physics, Setup(point, curve_nodes(physics, point)), outcome, state.scratch)


def best_of(state: RunState, end: Checked) -> tuple[Checked, str]:
    """Return the best of a failed run's end, its best iterate and its start, each checked.

    Parameters
    ----------
    state
        What the run knows.
    end
        What its last optimization ended with.

    Returns
    -------
    tuple of Checked and str
        The best one, on its own mesh, and its description; empty for the end.
    """
    best, held = end, ""
    iterate = (*state.best, "the best iterate") if state.best else None
    for other in (iterate, (state.first, end.start, "the start")):
        if other is None or not other[1].operation.running:
            continue
        physics, point, words = other
        stands = as_it_stands(state, physics, point, end.result)
        known = checked(state, end.start, end.reference, stands)
        if known.rank > best.rank:
            best, held = known, words
    return best, held


def first_remedy(physics: Physics) -> str:
    """Return the one thing to try first where an optimizer did not converge; often not known."""
    case, points = physics.case, physics.shape.points
    stations = physics.blade.r.size
    if physics.law.is_feedback and case.phase.transcription == "radau":  # has free last speeds
        return "try phase.transcription=gauss-lobatto"
    if physics.shape.designs_chord and stations > POINTS + 1:
        free = [name for name, count in points.items() if count > POINTS + 1]
        if free:
            return "try " + " and ".join(f"design.{name}_points: {POINTS}" for name in free)
    return "try start.method: quasi_steady" if case.start.method == "blade" else ""
