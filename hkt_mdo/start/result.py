"""The designs that a case gives: that of an earlier result (`start.from`), and its own."""

from typing import NamedTuple

import numpy as np

from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.errors import InputError
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.results.solution import Solution
from hkt_mdo.rotor.blade import Blade

GIVEN, RESULT = "blade as given", "design of a result"


class Candidate(NamedTuple):
    """A blade from which the search begins, and gains; None: fitted to its open loop."""

    strategy: str
    blade: Blade
    gains: np.ndarray | None = None


def given_designs(physics: Physics) -> tuple[list[Candidate], tuple[str, ...]]:
    """Return the designs that a case gives, the one that it begins with first, and messages.

    Parameters
    ----------
    physics : Physics

    Returns
    -------
    list of Candidate
        That of the result that `start.from` names, if any: its blade on this case's stations and
        within its bounds, with gains of the same law; then the blade and the gains of the case.
    tuple of str
        That the result was refused by its checks, if it was.

    Raises
    ------
    InputError
        If the folder is no result, holds no design, or the blade count is another.
    """
    case_design = Candidate(GIVEN, physics.blade, physics.law.starting_gains())
    folder = physics.case.start.from_
    if folder is None:
        return [case_design], ()
    where = {"key": "start.from", "value": folder}
    try:
        solution = Solution.load(folder, extensions=physics.case.extensions)
        rotor, fluid = solution.case.rotor, solution.case.fluid
        count = rotor.blade_count or build_turbine(rotor, fluid, 1.0).blade.blade_count
    except InputError as error:
        remedy = "give the folder of a finished run"
        raise InputError(f"is no result that can be read ({error})", remedy, **where) from error
    summary = solution.summary
    needed = physics.blade.blade_count
    if count != needed:
        problem = f"has {count} blades, the case has {needed}"
        remedy = f"give a result with rotor.blade_count = {needed}"
        raise InputError(problem, remedy, file=solution.folder, **where)
    if None in (summary.r_m, summary.chord_m, summary.twist_deg, summary.rotor_radius_m):
        remedy = "let that run finish with hkt run --resume"
        raise InputError("contains no design yet", remedy, file=solution.folder, **where)
    refused = f"start.from: the result there was refused by its checks: {solution.message}"
    result = Candidate(RESULT, _blade(physics, summary), _gains(physics, solution))
    return [result, case_design], (refused,) * (not solution.success)


def _blade(physics: Physics, summary) -> Blade:
    """Return a result's blade on a case's stations, interpolated over r/R where these differ.

    With its radius if the case designs that, otherwise scaled to the case's radius.
    """
    shape, blade = physics.shape, physics.sized(summary.rotor_radius_m, summary.hub_inertia_kg_m2)
    scale = blade.rotor_radius / summary.rotor_radius_m
    places = np.array(summary.r_m) * scale

    def at_stations(values):
        return np.interp(blade.r, places, values)

    thickness = blade.thickness
    if "thickness" in shape.bases and summary.thickness_over_chord is not None:
        thickness = at_stations(summary.thickness_over_chord)
    chord, twist = scale * at_stations(summary.chord_m), np.deg2rad(at_stations(summary.twist_deg))
    return shape.nearest(blade.with_shape(chord, twist, thickness))


def _gains(physics: Physics, solution: Solution) -> np.ndarray | None:
    """Return a result's gains within a case's bounds; None where they are another law's.

    Gains at flow speeds of a law's knots do not apply to a flow with another range.
    """
    law, theirs, gains = physics.law, solution.case.control, solution.gain
    if not law.is_feedback or gains is None or theirs.law != law.law:
        return None
    gains = np.atleast_1d(np.asarray(gains, dtype=float))
    same = type(law).in_flow is FeedbackLaw.in_flow or solution.case.inflow == physics.case.inflow
    return physics.bounded(gains) if same and gains.size == len(law.gain_units) else None
