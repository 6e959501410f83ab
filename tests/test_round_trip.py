"""A result's blade is the start of the next case, bit by bit."""

from pathlib import Path

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.run.run import run_case

CASES = Path(__file__).parent.parent / "cases"
SHORT = ("phase.duration=20", "phase.segments=20")


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    case = load_case(CASES / "sine_limited_quadratic.yaml", SHORT)
    return run_case(case, tmp_path_factory.mktemp("first") / "out", figures=False, records=False)


def test_the_next_run_starts_from_exactly_that_blade(first, tmp_path):
    changes = ["rotor.blade=blade.csv", "rotor.radius=1.4", "start.method=blade"]
    case = load_case(first.folder / "case.yaml", [*changes, f"control.gain={first.gain!r}"])
    assert not load_case(first.folder / "case.yaml", ["control=open_loop"]).ends_free
    blade = physics(case).blade
    assert blade.r.tolist() == first.summary.r_m
    assert blade.chord.tolist() == first.summary.chord_m
    assert np.rad2deg(blade.twist).tolist() == first.summary.twist_deg
    again = run_case(case, tmp_path / "again", figures=False, records=False)
    assert again.success, again.message
    assert again.summary.start_chord_m == first.summary.chord_m
    assert again.summary.start_twist_deg == first.summary.twist_deg
    energy = first.summary.simulated_energy_J
    assert again.summary.starting_energy_J == pytest.approx(energy, rel=2e-5)
    assert again.summary.simulated_energy_J == pytest.approx(energy, rel=1e-6)


def test_a_spline_is_found_again(tmp_path):
    changes = ["rotor.station_count=24", "design.chord_points=5", "design.twist_points=6"]
    case = load_case(CASES / "sine_limited_quadratic.yaml", [*SHORT, *changes])
    first = run_case(case, tmp_path / "first", figures=False, records=False)
    assert first.success, first.message
    written = load_case(first.folder / "case.yaml", ["rotor.blade=blade.csv", "rotor.radius=1.4"])
    blade, twist = physics(written).blade, first.summary.twist_deg
    np.testing.assert_allclose(blade.chord, first.summary.chord_m, rtol=1e-13)
    np.testing.assert_allclose(np.rad2deg(blade.twist), twist, rtol=0.0, atol=1e-12)
