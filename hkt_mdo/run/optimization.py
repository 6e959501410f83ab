"""One optimization: the problem of some physics at a setup, solved and read."""

from __future__ import annotations

import numpy as np

from hkt_mdo.case.guard import any_values
from hkt_mdo.problem.build import assemble, make_driver, point_of, series
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.setup import Setup
from hkt_mdo.quantities import TRAJECTORY
from hkt_mdo.run.recorders import add_recorders
from hkt_mdo.run.state import RunState
from hkt_mdo.run.verification import Optimized
from hkt_mdo.solve.drivers import Outcome

MOST_ROWS = 500
"""Segments times limits and the equation of motion, above which little is recorded."""


def solve(
    state: RunState, physics: Physics, setup: Setup, near: bool, refined: bool, most: int | None
) -> Optimized:
    """Run one optimization; the run's state is updated at every evaluation.

    Parameters
    ----------
    state
        What the run knows.
    physics, setup
        The problem and its start.
    near, refined
        Whether the start is near the optimum, and that on a coarser mesh (`make_driver`).
    most
        Largest number of iterations; None: as in the case.

    Returns
    -------
    Optimized
        The end of the optimization, converged or not.
    """
    driver = make_driver(physics, state, most, near, refined)
    problem = assemble(physics, setup, driver, state.scratch)
    rows = sum(x.segments * (1 + len(physics.limits_in(x))) for x in physics.scenarios)
    if state.records:
        add_recorders(problem, state.out, whole=rows <= MOST_ROWS)
    try:
        problem.final_setup()  # opens the recorders' files
        try:
            # OpenMDAO's drivers run only components that depend on the design; the flow does not
            problem.run_model()
            state.point = lambda: point_of(physics, problem)
            with any_values():
                problem.run_driver()
        finally:
            if state.records:
                problem.record("final")
    finally:
        problem.cleanup()
    result = collect(physics, setup, problem, problem.driver.outcome())
    if result.outcome.success:
        state.keep(result.point, result.objective)
    return result


def collect(physics: Physics, setup: Setup, problem, outcome: Outcome) -> Optimized:
    """Return the present state of a problem as the end of an optimization.

    Parameters
    ----------
    physics, setup
        What the problem was assembled from.
    problem : openmdao.api.Problem
        The problem, its model run.
    outcome
        How the optimizer ended.
    """
    names = *TRAJECTORY, *physics.law.states
    trajectories = tuple(
        {name: series(problem, scenario, name) for name in names} for scenario in physics.scenarios
    )
    for scenario, nodes in zip(physics.scenarios, trajectories, strict=True):
        if physics.remembers:
            wake = "tip_speed_ratio" if scenario.steady else "wake_ratio"
            nodes["wake_ratio"] = series(problem, scenario, wake)
    return Optimized(
        *(physics, problem, outcome, setup, point_of(physics, problem), trajectories),
        *(float(problem.get_val(name)[0]) for name in ("energy", "objective", "inertia", "mass")),
        problem.get_val("torque_coefficient_table") if physics.has_curve else np.empty(0),
    )
