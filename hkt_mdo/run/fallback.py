"""The result of a run that fails: the best of its end, its best iterate and its start.

Each is integrated and checked; fewer large failures rank first, then fewer failures, then the
objective.
"""

from __future__ import annotations

from hkt_mdo.problem.model import Physics
from hkt_mdo.rotor.shape import POINTS
from hkt_mdo.run.checked import Checked, as_it_stands
from hkt_mdo.run.state import RunState


def best_of(state: RunState, end: Checked) -> tuple[Checked, str]:
    """Return the best of a failed run's end, its best iterate and its start.

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
        checked = Checked.of(state, end.start, end.reference, physics, stands)
        if checked.rank > best.rank:
            best, held = checked, words
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
