"""The passes of a run: optimize, and again as long as a remedy asks for it."""

from __future__ import annotations

import time

from hkt_mdo.problem.start import StartingPoint
from hkt_mdo.run.attempt import Attempt, Before, Begin, Judged
from hkt_mdo.run.optimization import solve
from hkt_mdo.run.remedies import first_setup, next_begin
from hkt_mdo.run.state import RunState

FAR = 0.05
"""Relative excess of a limit from which a start is far from any optimum."""


def optimize(state: RunState, start: StartingPoint, reference: float) -> Judged:
    """Optimize from a start until no remedy asks for another optimization.

    Parameters
    ----------
    state
        What the run knows; it is told of every pass.
    start
        Where the first optimization begins.
    reference
        Objective of the start, J; 0 where it is no measure of the optimum.

    Returns
    -------
    Judged
        The end, on its mesh: of the start's other branch where only that one passes.
    """
    begin: Begin | None = Begin(start, state.first, first_setup(state.first, start), reference)
    before, ends = Before(), []
    while begin is not None:
        if before.passes == 0:
            near = max(state.first.excesses(begin.start).values(), default=0.0) < FAR
        if before.passes == 0 or begin.physics is not state.physics:
            state.go_on_from(begin.physics, begin.setup.start, begin.reference)
        began = time.perf_counter()
        result = solve(state, begin.physics, begin.setup, near)
        attempt = Attempt(state, begin, result, before)
        again = next_begin(attempt)
        state.note_pass(attempt.entry(time.perf_counter() - began, again))
        if again is None or again.start is not begin.start:
            ends.append(attempt.end)
            before = Before()
        else:
            before = attempt.after(again)
        begin = again
    return next((end for end in ends[::-1] if end.passed), ends[0])
