"""The search of blade, gains and schedule: exact slopes of what it optimizes."""

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.start.find import steady_optimum
from hkt_mdo.start.improve import improve
from hkt_mdo.start.limited import LimitedSearch
from hkt_mdo.start.quasi_steady import QuasiSteady
from hkt_mdo.start.steady_flow import SteadyFlow


@pytest.mark.parametrize("law", ["quadratic", "tracking"])
def test_slopes_of_objective_and_constraints(law):
    data = {"power": "5 kW", "stress": "300 MPa", "cavitation": {"depth": 3}}
    control = {"law": law, "torque_limit": 700.0}
    design = {"radius_bounds": [1.2, 1.6]}
    case = physics(
        load_case({"inflow": "sine", "control": control, "limits": data, "design": design})
    )
    problem = QuasiSteady.of(case, steady_optimum(case, case.blade))
    flow = SteadyFlow.of(case, TorqueSpline(problem.spline.nodes[::10]), 3)
    search = LimitedSearch(flow, 0.02)
    gains = np.array([*np.linspace(6.5, 8.5, 8), 150.0, 600.0] if law == "tracking" else [9.0])
    x, units = search.vector(StartingPoint(case.blade, gains, None))
    ratios = np.full(0 if law == "tracking" else 3, 7.0)
    z, units = np.append(x, ratios), np.append(units, ratios)

    def values(share):
        objective, _, equal, _, above, _ = search.values(share * units)
        return np.concatenate(([objective / 1e5], equal, above))

    _, objective_by, _, equal_by, _, above_by = search.values(z)
    slopes = np.vstack((objective_by / 1e5, equal_by, above_by)) * units
    step, numeric = 1e-6, []
    for unit in np.eye(z.size):
        numeric.append((values(z / units + step * unit) - values(z / units - step * unit)) / 2e-6)
    assert np.allclose(slopes, np.transpose(numeric), rtol=1e-5, atol=1e-5)


def test_a_point_far_behind_another_branch_has_no_second_search(monkeypatch):
    """Which would find a blade that keeps the limit of its stress."""
    limits = {"power": "5 kW", "stress": "100 MPa"}
    case = physics(load_case({"inflow": "sine", "control": "open_loop", "limits": limits}))
    problem = QuasiSteady.of(case, steady_optimum(case, case.blade))
    flow = SteadyFlow.of(case, TorqueSpline(problem.spline.nodes[::10]), 3)
    point = flow.on_branch(StartingPoint(case.blade, np.empty(0), None), "overspeed")
    assert point.excess > 0.5
    search, ahead = LimitedSearch(flow, 0.0), 10.0 * point.objective
    assert improve(search, point, ahead).excess > 0.01
    monkeypatch.setattr("hkt_mdo.start.improve.HOPELESS", np.inf)
    assert improve(search, point, ahead).excess < 1e-3
