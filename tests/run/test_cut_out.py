"""Runs of a machine that stands still in fast flow: closed forms, and the folder they leave."""

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.flows import ConstantInflow
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import texts
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.run.run import run_case

STEADY, GUST = 1.4, {"profile": "gust", "mean": 1.4, "amplitude": 0.4, "time": 6.0, "width": 8.0}
CUT = 1.42
CASE = {
    "inflow": GUST,
    "control": {"law": "quadratic", "cut_out": CUT},
    "limits": {"power": "5 kW"},
    "design": {"blade": "fixed"},
    "phase": {"duration": 20.0, "segments": 40},
}
REACH = 8.0 * np.arccos(1.0 - np.sqrt(4.0 * (CUT - STEADY) / 0.4)) / (2.0 * np.pi)
"""Time that the gust takes to reach the cut-out speed, s: (1 - cos 2 pi s)² / 4 = 0.02 / 0.4."""
SPANS = np.array([[0.0, 6.0 + REACH], [14.0 - REACH, 20.0]])


@pytest.fixture(scope="module")
def solution(tmp_path_factory) -> Solution:
    out = tmp_path_factory.mktemp("cut_out") / "result"
    return run_case(load_case(CASE), out, figures=False, records=False)


def test_energy_is_that_of_the_parts(solution):
    """In steady flow with a gust cut out: the best power coefficient times what passes."""
    assert solution.success, solution.message
    model = physics(load_case(CASE))
    best = best_operation(model.blade, model.rotor.polar)
    share = np.linspace(0.0, REACH / 8.0, 2001)
    rise = STEADY + 0.1 * (1.0 - np.cos(2.0 * np.pi * share)) ** 2
    cubes = 12.0 * STEADY**3 + 2.0 * np.trapezoid(rise**3, 8.0 * share)
    expected = power_scale(model.density, model.blade.rotor_radius, 1.0) * cubes
    expected *= best.power_coefficient
    assert solution.summary.simulated_energy_J == pytest.approx(expected, rel=2e-5)
    assert solution.summary.energy_bound_J == pytest.approx(expected, rel=1e-6)


def test_summary_tells_the_intervals(solution):
    operation = solution.summary.operation
    np.testing.assert_allclose(operation.intervals_s, SPANS, rtol=1e-12)
    still = 8.0 - 2.0 * REACH
    assert operation.standstill_s == pytest.approx(still, rel=1e-12)
    energy = solution.summary.simulated_energy_J
    assert operation.mean_power_W == pytest.approx(energy / 20.0, rel=1e-9)
    again = solution.simulation["time_s"] >= SPANS[1, 0] - 1e-8
    speed = solution.simulation["rotor_speed_rad_s"][again][0]
    stored = 0.5 * solution.summary.inertia_kg_m2 * speed**2
    assert operation.run_up_J == pytest.approx(stored, rel=1e-8)
    row = texts(solution.summary.rows(solution.case))["operation"]
    assert row.startswith(f"in 2 intervals, standstill for {still:.4g}")
    assert f"({100.0 * still / 20.0:.3g} %)" in row
    (note,) = [note for note in solution.notes if "cut_out" in note]
    assert "standstill" in note
    # the limit is broken in the gust alone, 5.7 kW, and the checks are asked in each interval
    assert not solution.summary.limits["power"].binding
    names = {check.name for check in solution.summary.checks}
    for name in ("energy_error", "power_between_nodes", "power_at_nodes"):
        assert {f"{name} (interval_1)", f"{name} (interval_2)"} <= names


def test_a_simulation_through_a_standstill_is_refused(solution):
    design = solution.design()
    with pytest.raises(InputError, match="in the design's own flow") as caught:
        design.simulate(solution.case.inflow)
    assert caught.value.key == "control.cut_out"
    summary = solution.summary
    power = summary.power_coefficient_max * power_scale(1e3, summary.rotor_radius_m, STEADY)
    slow = design.simulate(ConstantInflow(speed=STEADY))
    assert slow.energy == pytest.approx(20.0 * power, rel=2e-5)


@pytest.mark.parametrize(
    "objective", ["electrical", pytest.param("captured", marks=pytest.mark.slow)]
)
def test_open_loop_with_each_interval_judged_for_itself(solve_physics, objective):
    control = {"law": "open_loop", "torque_limit": 540.0, "cut_out": CUT}
    solved = solve_physics(CASE | {"control": control, "objective": objective})
    assert solved.failed() == []
    for verification, span in zip(solved.verifications, SPANS, strict=True):
        np.testing.assert_allclose(verification.trajectory["time"][[0, -1]], span, rtol=1e-12)
        change = verification.simulation.kinetic_energy_change
        if objective == "electrical":  # no interval may sell what its rotor has stored
            assert abs(change) < 1e-6 * verification.simulation.energy
