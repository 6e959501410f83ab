"""The joint search of blade, gains and schedule: exact slopes of what it optimizes."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.joint import Joint
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.schedule import quasi_steady
from hkt_mdo.problem.setup import steady_optimum
from hkt_mdo.problem.start import CoDesign, StartingPoint
from hkt_mdo.problem.steady_flow import SteadyFlow
from hkt_mdo.rotor.torque_curve import TorqueSpline


@pytest.mark.parametrize("law", ["quadratic", "tracking"])
def test_slopes_of_objective_and_constraints(law):
    data = {"power": "5 kW", "stress": "300 MPa", "cavitation": {"depth": 3}}
    control = {"law": law, "torque_limit": 700.0}
    design = {"radius_bounds": [1.2, 1.6]}
    case = physics(
        load_case({"inflow": "sine", "control": control, "limits": data, "design": design})
    )
    problem = quasi_steady(case, steady_optimum(case, case.blade))
    spline = TorqueSpline(problem.spline.nodes[::10])
    flow = SteadyFlow.of(case, spline, 3)
    design = CoDesign(replace(problem, spline=spline), case.shape, case.polar, (-np.inf, np.inf))
    joint = Joint(flow, design, 0.02)
    gains = np.array([*np.linspace(6.5, 8.5, 8), 150.0, 600.0] if law == "tracking" else [9.0])
    x, units = design.vector(StartingPoint(case.blade, gains, None))
    ratios = np.full(0 if law == "tracking" else 3, 7.0)
    z, units = np.append(x, ratios), np.append(units, ratios)

    def values(share):
        objective, _, equal, _, above, _ = joint.values(share * units)
        return np.concatenate(([objective / 1e5], equal, above))

    _, objective_by, _, equal_by, _, above_by = joint.values(z)
    slopes = np.vstack((objective_by / 1e5, equal_by, above_by)) * units
    step, numeric = 1e-6, []
    for unit in np.eye(z.size):
        numeric.append((values(z / units + step * unit) - values(z / units - step * unit)) / 2e-6)
    assert np.allclose(slopes, np.transpose(numeric), rtol=1e-5, atol=1e-5)
