"""A case as an OpenMDAO problem at its start."""

from __future__ import annotations

import openmdao.api as om

from hkt_mdo.case import Case
from hkt_mdo.problem.build import assemble
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.solve.threads import one_thread
from hkt_mdo.start.find import find_start, steady_optimum


def build_problem(case: Case, *, improve: bool | None = None) -> om.Problem:
    """Return the OpenMDAO problem of a case, set up at its start.

    `problem.run_model()`, `problem.check_partials()`, `om.n2(problem)` and `problem.run_driver()`
    work with it directly. `run_case` optimizes it repeatedly if necessary, and checks the result.

    Parameters
    ----------
    case : Case
    improve : bool, optional
        Whether the starting blade and gains are improved by co-design without time, or kept as
        given; None: as in the case's `start`.

    Returns
    -------
    om.Problem
        Its outputs are energy, generator_energy, electrical_energy and objective (J), mass (kg),
        inertia (kg*m**2); `traj.phase.timeseries` has the trajectory.

    Raises
    ------
    InputError
        If a file of the case is broken, or its optimizer is not installed.
    """
    return assemble(*start_of_case(case, improve))


def start_of_case(case: Case, improve: bool | None = None) -> tuple[Physics, Setup]:
    """Return the physics of a case and where its first optimization begins.

    Parameters
    ----------
    case : Case
    improve : bool, optional
        As that of `build_problem`.

    Returns
    -------
    Physics, Setup

    Raises
    ------
    InputError
        If a file of the case is broken.
    """
    world = physics(case)
    with one_thread():
        start = find_start(world, steady_optimum(world, world.blade), improve=improve)
    return world, Setup(start, curve_nodes(world, start))
