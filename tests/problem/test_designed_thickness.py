"""Thickness as a design variable: derivatives of the problem and of its start, what is refused."""

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.start.build import build_problem

SECTIONS = [
    {"polar": "naca4415_Re1e6", "thickness": 0.12},
    {"polar": "naca63815_Re1e6", "outline": "naca63815"},
    {"polar": "naca63424_Re1e6", "outline": "naca63424"},
]


def case(control="open_loop", **design):
    data = {
        "inflow": "sine",
        "control": {"law": control, "torque_limit": 700},
        "rotor": {"sections": SECTIONS, "station_count": 8},
        "phase": {"segments": 10},
        "limits": {"stress": {"bound": "60 MPa", "weight": True}, "cavitation": {"depth": 3}},
        "design": {"thickness_points": 4, "chord_points": 5, "twist_points": 5} | design,
    }
    return load_case(data)


def test_the_start_has_the_thickness_of_the_file_within_the_bounds():
    model = physics(case(thickness_points=8, thickness_bounds=[0.14, 0.2]))
    percent = [24, 22.5, 20.7, 19.5, 18.7, 18.1, 17.6, 17.1, 16.6, 16.1, 15.6, 15.1, 14.6, 14.1]
    r = np.linspace(0.2, 0.85, 14) * model.blade.tip_radius
    inside = model.blade.r < r[-1]
    expected = np.clip(0.01 * np.interp(model.blade.r, r, percent), 0.14, 0.2)
    np.testing.assert_allclose(model.blade.thickness[inside], expected[inside], rtol=1e-12)
    assert "thickness" in model.shape.bases
    assert model.shape.bounds["thickness"] == (0.14, 0.2)


def test_a_fouled_rotor_has_the_factors_at_every_thickness():
    pair = case(), case().with_overrides("condition={lift: 0.9, drag: 1.5}")
    (clean,), (fouled,) = (physics(x).rotor.polar.at(np.array([0.17])) for x in pair)
    np.testing.assert_allclose(fouled.coefficients, clean.scaled(0.9, 1.5).coefficients, 1e-12)


@pytest.mark.parametrize("control", ["open_loop", "quadratic"])
def test_partials_of_the_problem(control):
    problem = build_problem(case(control=control), improve=False)
    problem.run_model()
    names = ["rotor.shape", "rotor.mass_and_inertia", "rotor.tables"]
    data = problem.check_partials(out_stream=None, form="central", step=1e-6, includes=names)
    assert set(data) == set(names)
    assert ("weight_stress", "thickness") in data["rotor.tables"]
    for component, partials in data.items():
        assert any(by == "thickness" or component == "rotor.shape" for _, by in partials)
        for pair, entry in partials.items():
            (error,) = (value for value in entry["abs error"][:2] if value is not None)
            assert error <= 2e-6 * max(entry["magnitude"].fd, 1e-9), (component, pair)
    assert problem.get_val("thickness").shape == (8,)
    assert "thickness_control" in problem.model.get_design_vars()
