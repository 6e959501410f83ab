"""Kinds of one's own: a limit, an objective, a law and a flow that the package does not know.

`data/extension.py` defines them with the public names alone; nothing of the package is changed.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hkt_mdo import InputError, Solution, load_case, run_case
from hkt_mdo.run.check import check_case
from tests.conftest import NINE

EXTENSION = Path(__file__).parent / "data" / "extension.py"
SHORT = {"inflow": "sine", "control": "quadratic", "phase": {"segments": 30, "duration": 30}}
SHORT |= {"rotor": {"stations": NINE}}  # on nine stations, with limits and without


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run a short case with the extension; equal cases once."""

    @cache
    def solve(case):
        return run_case(case, tmp_path_factory.mktemp("runs") / "out", figures=False)

    return lambda **sections: solve(load_case(SHORT | sections, extensions=[EXTENSION]))


@pytest.mark.parametrize(
    "control", ["quadratic", pytest.param("open_loop", marks=pytest.mark.slow)]
)
def test_a_limit_is_kept_and_reported(run, control):
    free, held = run(control=control), run(control=control, limits={"tip_acceleration": "95 m/s^2"})
    assert held.success, held.message
    entry = held.summary.limits["tip_acceleration"]
    assert (entry.limit, entry.unit, entry.binding) == (95.0, "m/s**2", True)
    assert entry.value == pytest.approx(95.0, rel=1e-3)
    acceleration = held.trajectory["rotor_speed_rad_s"] ** 2 * held.summary.rotor_radius_m
    assert np.max(acceleration) <= 95.0 * (1.0 + 1e-6)
    assert np.max(free.trajectory["rotor_speed_rad_s"]) ** 2 * 1.4 > 99.0
    assert held.summary.simulated_energy_J < free.summary.simulated_energy_J
    checks = {check.name for check in held.summary.checks}
    assert {"tip_acceleration_at_nodes", "tip_acceleration_between_nodes"} <= checks


def test_an_objective_is_maximized(run):
    plain = run()
    priced = run(objective={"kind": "priced_torque", "price": 1e-3})
    assert priced.success, priced.message
    objective = priced.summary.objective

    def price(solution):
        torque, time = (solution.simulation[each] for each in ("control_torque_Nm", "time_s"))
        return 1e-3 * np.trapezoid(torque**2, time)

    expected = priced.summary.simulated_energy_J - price(priced)
    assert objective.simulated == pytest.approx(expected, rel=1e-4)
    # it gives up energy for torque, and is better by its own measure
    assert priced.summary.energy_J < plain.summary.energy_J
    assert objective.simulated > plain.summary.simulated_energy_J - price(plain)


@pytest.mark.slow
def test_a_law_of_two_gains_is_at_least_as_good_as_its_parts(run):
    mixed, quadratic, open_loop = (
        run(control={"law": law, "torque_limit": 700})
        for law in ("mixed", "quadratic", "open_loop")
    )
    assert mixed.success, mixed.message
    assert len(mixed.summary.gain) == 2
    energy, least, most = (x.summary.simulated_energy_J for x in (mixed, quadratic, open_loop))
    assert least * (1.0 - 1e-6) <= energy <= most * (1.0 + 2e-5)


def test_a_result_is_read_only_with_its_extension(run):
    """Its folder must not choose what is executed."""
    folder = run(limits={"tip_acceleration": "95 m/s^2"}).folder
    with pytest.raises(InputError, match="tip_acceleration"):
        Solution.load(folder)
    again = Solution.load(folder, extensions=[EXTENSION])
    assert again.case == load_case(folder / "case.yaml", extensions=[EXTENSION])


LEAST = {"least_energy": "140 kJ"}


@pytest.mark.slow
def test_a_load_is_made_as_small_as_the_energy_allows(run):
    """A rate of a load over time, minimized, under a limit on the energy of the result."""
    free = run(control="open_loop")
    least = run(control="open_loop", objective="thrust", limits=LEAST)
    assert least.success, least.message
    assert least.summary.energy_J == pytest.approx(140e3, rel=1e-4)

    def impulse(solution):
        return np.trapezoid(solution.simulation["thrust_N"], solution.simulation["time_s"])

    objective = least.summary.objective
    assert objective.simulated == pytest.approx(impulse(least), rel=1e-4)
    assert objective.unit == "N*s"
    # near the most energy, the last of it costs most thrust: 8 % less energy, more less thrust
    assert impulse(least) / impulse(free) < 0.92 * 140e3 / free.summary.energy_J


@pytest.mark.slow
def test_a_value_of_the_design_is_made_as_small_as_the_energy_allows(run):
    """The mass of the blades, minimized."""
    free = run()
    light = run(objective="mass", limits=LEAST)
    assert light.success, light.message
    assert light.summary.energy_J >= 140e3 * (1.0 - 1e-6)
    assert light.summary.mass_kg < 0.8 * free.summary.mass_kg
    assert light.summary.objective.simulated == pytest.approx(light.summary.mass_kg)


@pytest.mark.parametrize(
    ("limits", "value"),
    [
        ({"mass": "2.5 kg"}, lambda summary: summary.mass_kg / 2.5),
        ({"chord": "6 cm"}, lambda summary: np.max(summary.chord_m) / 0.06),
    ],
    ids=["design", "span"],
)
def test_limits_of_the_design_and_along_the_span_bind(run, limits, value):
    free, held = run(), run(limits=limits)
    assert any("broken at the start" in str(x) for x in check_case(held.case).warnings)
    assert held.success, held.message
    assert value(free.summary) > 1.05
    assert value(held.summary) == pytest.approx(1.0, abs=1e-5)
    assert held.summary.energy_J < free.summary.energy_J


@pytest.mark.slow
def test_an_aggregate_unites_scenarios(run):
    """The worst of two flows, by its epigraph: never below that of the mean's design."""
    flows = [{"inflow": {"profile": "sine", "mean": mean}} for mean in (1.3, 1.5)]
    fixed = {"control": {"law": "quadratic", "torque_limit": 500}, "scenarios": flows}
    mean = run(**fixed)
    worst = run(**fixed, robustness="smallest")
    for solution in (mean, worst):
        assert solution.success, solution.message

    def slowest(solution):
        return min(each.simulated_energy_J for each in solution.summary.scenarios.values())

    assert worst.summary.objective.simulated == pytest.approx(slowest(worst), rel=1e-6)
    assert slowest(worst) >= slowest(mean) * (1.0 - 1e-6)
