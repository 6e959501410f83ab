"""Runs with a designed thickness: a single section's result, more freedom, and reading back."""

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.run.run import run_case

SECTIONS = [
    {"polar": "naca4415_Re1e6", "thickness": 0.12},
    {"polar": "naca63815_Re1e6", "outline": "naca63815", "thickness": 0.15},
    {"polar": "naca63424_Re1e6", "outline": "naca63424"},
]


SINGLE = {"polar": "naca63815_Re1e6", "outline": "naca63815"}
LAW = {"law": "open_loop", "torque_limit": 700}
CASE = {"inflow": "sine", "control": LAW, "phase": {"segments": 30}}
STRONG = {"stress": "60 MPa"}


def run(folder, rotor, limits, **design):
    rotor, design = rotor | {"station_count": 30}, {"chord_points": 4, "twist_points": 4} | design
    case = load_case(CASE | {"rotor": rotor, "design": design, "limits": limits})
    solution = run_case(case, folder, figures=False, records=False)
    assert solution.success, solution.message
    return solution.summary


@pytest.fixture(scope="module")
def designed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("designed")
    return folder, run(folder, {"sections": SECTIONS}, STRONG, thickness_points=3)


@pytest.mark.slow
def test_freedom_of_the_thickness_only_gains(designed, tmp_path):
    """Of the same stations and control points, with the single section among those given."""
    _, summary = designed
    single = run(tmp_path / "single", SINGLE, STRONG)
    assert summary.simulated_energy_J > (1.0 + 1e-4) * single.simulated_energy_J
    assert summary.limits["stress"].value <= 60e6 * (1.0 + 1e-3)


@pytest.mark.slow
def test_at_one_sections_thickness_the_run_is_that_of_the_section(tmp_path):
    single = run(tmp_path / "single", SINGLE, {})
    bounds = {"thickness_points": 3, "thickness_bounds": [0.15, 0.150001]}
    summary = run(tmp_path / "family", {"sections": SECTIONS}, {}, **bounds)
    assert summary.simulated_energy_J == pytest.approx(single.simulated_energy_J, rel=1e-6)
    np.testing.assert_allclose(summary.chord_m, single.chord_m, rtol=0.02)
    np.testing.assert_allclose(summary.thickness_over_chord, 0.15, atol=2e-6)


@pytest.mark.slow
def test_the_blade_that_is_written_is_read_back_with_its_thickness(designed):
    folder, summary = designed
    base = {"blade": str(folder / "blade.csv"), "set_angle": 0, "hub_radius_fraction": 0.125}
    rotor = base | {"radius": 1.4, "sections": SECTIONS}
    others = {"inflow": "sine", "control": "quadratic", "rotor": rotor}
    again = physics(load_case(others | {"design": {"thickness_points": 30}}))
    np.testing.assert_allclose(again.blade.thickness, summary.thickness_over_chord, rtol=1e-9)
    np.testing.assert_allclose(again.blade.chord, summary.chord_m, rtol=1e-9)
    fixed = physics(load_case(others | {"design": {"blade": "fixed"}}))
    np.testing.assert_allclose(fixed.turbine.thickness, summary.thickness_over_chord, rtol=1e-9)
