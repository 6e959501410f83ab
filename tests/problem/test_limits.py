"""The package's limits: what a case may say, closed forms, partials, and short optimizations."""

from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from hkt_mdo import InputError, Limit, load_case, run_case
from hkt_mdo.dynamics.limits import (
    PowerLimit,
    RotorSpeedLimit,
    Taper,
    TipSpeedLimit,
    TorqueRateLimit,
)
from hkt_mdo.problem.components import FormulaComp, LinearComp
from hkt_mdo.problem.operation_group import is_quantity
from hkt_mdo.problem.physics import complete, physics
from hkt_mdo.results.words import texts
from hkt_mdo.run.loads import of_limit
from tests.conftest import NINE, checked

CASE = {"inflow": "sine", "control": "open_loop"}
SHORT = CASE | {"phase": {"segments": 20, "duration": 20}}
SPEED, POWER = np.array([6.0, 9.0, 10.0]), np.array([3e3, 5e3, 6e3])
BLADE = SimpleNamespace(r=np.array([0.2, 0.5, 0.8, 1.0]), tip_radius=1.0)
CHORD = np.array([0.1, 0.2, 0.15, 0.18])


def test_closed_forms():
    series = {"rotor_speed": SPEED, "rotor_radius": 1.4, "generator_power": POWER}
    for limit, value in (
        (PowerLimit(bound=5e3), POWER),
        (RotorSpeedLimit(bound=9.0), SPEED),
        (TipSpeedLimit(bound=12.6), 1.4 * SPEED),
    ):
        np.testing.assert_allclose(limit.value_of(series), value)
        np.testing.assert_allclose(limit.excess(series), value / limit.bound - 1.0, atol=1e-15)
        assert limit.place == "time"


def test_a_rate_is_limited_whether_the_torque_rises_or_falls():
    limit = TorqueRateLimit(bound=500.0)
    series = {"torque_rate": np.array([-600.0, -500.0, 0.0, 450.0])}
    np.testing.assert_allclose(limit.excess(series), [0.2, 0.0, -1.0, -0.1], atol=1e-15)
    np.testing.assert_array_equal(limit.reported(series), [600.0, 500.0, 0.0, 450.0])
    assert limit.place == "time"
    power = {"generator_power": np.array([-9e3, 4e3])}
    np.testing.assert_array_equal(PowerLimit(bound=5e3).reported(power), [-9e3, 4e3])


@pytest.mark.parametrize("transcription", ["gauss-lobatto", "radau"])
def test_rate_of_the_torque_against_complex_step(transcription):
    phase = {"phase": {"segments": 5, "duration": 7, "transcription": transcription}}
    scenario = physics(load_case(CASE | phase)).scenarios[0]
    scenario = scenario.divided(1 + np.arange(scenario.segments) % 2)
    matrices, time = {"control_torque": scenario.differentiation}, scenario.node_times
    rates = LinearComp(matrices, "N*m", "torque_rate", {"units": "N*m/s"})
    problem = checked(rates, 1e-10, 1e-12, control_torque=600.0 + 40.0 * time - 3.0 * time**2)
    values = problem.get_val("torque_rate", units="N*m/s")
    np.testing.assert_allclose(values, 40.0 - 6.0 * time, atol=1e-8)


def test_taper_is_asked_of_the_stations_outboard_of_a_place():
    limit = Taper(bound=0.4).on(BLADE)
    assert limit.place == "span"
    np.testing.assert_allclose(limit.value(chord=CHORD), [0.0, 0.0, 0.75, 1.2])
    np.testing.assert_allclose(limit.excess({"chord": CHORD}), [-1.0, -1.0, -0.25, 0.2])
    assert np.max(Taper(bound=0.1).on(BLADE).value(chord=CHORD)) == 2.0
    with pytest.raises(InputError, match=r"limits.taper_from = 0.9: needs two stations"):
        Taper(bound=0.9).on(BLADE)


@pytest.mark.parametrize(
    ("limit", "inputs"),
    [
        (PowerLimit(bound=5e3), {"generator_power": POWER}),
        (TipSpeedLimit(bound=12.0), {"rotor_speed": SPEED, "rotor_radius": 1.4}),
        (Taper(bound=0.4).on(BLADE), {"chord": CHORD}),
    ],
)
def test_partials_against_complex_step(limit, inputs):
    component = FormulaComp(formula=limit, size=next(iter(inputs.values())).size)
    checked(component, 1e-14, 1e-12, **inputs)


@pytest.mark.parametrize(("bound", "end"), [(20.0, 8.0), (5.0, 5.0), (None, 8.0)])
def test_a_limit_of_the_speed_is_within_the_generator_s_table(bound, end, tmp_path):
    path, rows = tmp_path / "table.csv", "9,1,0.8\n9,8,0.8\n900,1,0.9\n900,8,0.9\n"
    path.write_text("torque_Nm,speed_rad_s,efficiency\n" + rows)
    flow = {"inflow": "sine", "limits": {"rotor_speed": bound}}
    case = CASE | {"generator": {"table": str(path)}, "scenarios": [flow]}
    model = physics(load_case(case))
    (limit,) = (x for x in model.scenarios[0].limits if x.name == "rotor_speed")
    assert (limit.upper, "generator.table" in limit.key) == (end, end == 8.0)


def test_a_limited_rate_of_a_scenario_is_one_of_the_case():
    rate, steady = {"limits": {"torque_rate": 30}}, {"inflow": "sine", "steady": True}
    case = load_case(CASE | {"scenarios": [{"inflow": "sine"} | rate, steady | rate]})
    assert complete(case).ends_free
    model = physics(case)
    names = [[limit.name for limit in each.limits] for each in model.scenarios]
    assert ["torque_rate" in each for each in names] == [True, False]  # at rest it has none
    assert any("no effect in a steady scenario" in text for text in model.messages)


def test_each_scenario_has_its_own_depth():
    """A flow at high water is computed at its depth, the others at that of the case."""
    high = {"limits": {"cavitation": {"depth": 10, "margin": 1.0}}}
    case = {"scenarios": [{"inflow": "sine"}, {"inflow": "sine"} | high]}
    case |= {"control": "open_loop", "limits": {"cavitation": {"depth": 3}}}
    model = physics(load_case(case))
    assert [model.rotor_in(each).depth for each in model.scenarios] == [3.0, 10.0]
    assert [model.rotor_in(each).margin for each in model.scenarios] == [1.1, 1.0]


# Contradictions and limits of no effect -----------------------------------------------------------


def test_what_could_be_kept_is_not_refused():
    """A radius that may grow turns faster at its tip; a tapered blade may be scaled; both run."""
    slow = CASE | {"limits": {"rotor_speed": 0.06}}
    with pytest.raises(InputError, match="rotor_speed"):
        physics(load_case(slow))
    physics(load_case(slow | {"design": {"radius_bounds": [1.0, 3.0]}}))
    physics(load_case(CASE | {"design": {"blade": "fixed"}, "limits": {"taper_from": 0.3}}))


@pytest.mark.parametrize(
    ("limits", "generator", "free"),
    [
        ({"power": 5e3, "electrical_power": 4.7e3}, {"efficiency": 0.92}, ["electrical_power"]),
        ({"power": 5e3, "electrical_power": 4.5e3}, {"efficiency": 0.92}, ["power"]),
        ({"power": 5e3, "electrical_power": 4.7e3}, {}, ["power"]),
        ({"power": 5e3, "electrical_power": 4.7e3}, {"copper_loss": 300, "rated_torque": 700}, []),
        ({"tip_speed": 15, "rotor_speed": 10}, {}, ["tip_speed"]),
        ({"tip_speed": 13, "rotor_speed": 10}, {}, ["rotor_speed"]),
        ({"rotor_speed": 10, "power": 7.1e3}, {}, ["power"]),
        ({"rotor_speed": 10, "power": 6.9e3}, {}, []),
    ],
)
def test_limits_of_no_effect_are_reported(limits, generator, free):
    control = {"law": "open_loop", "torque_limit": 700 if "power" in limits else None}
    data = {"control": control, "limits": limits, "generator": generator}
    model = physics(load_case(CASE | data))
    messages = [text for text in model.messages if "has no effect" in text]
    assert [text.partition(" = ")[0] for text in messages] == [f"limits.{name}" for name in free]


def test_a_limit_with_a_lower_bound_alone_is_reported():
    class Least(Limit):
        name: ClassVar[str] = "least_ratio"
        inputs: ClassVar[tuple[str, ...]] = ("tip_speed_ratio",)
        upper: ClassVar[float] = np.inf
        lower: ClassVar[float] = 5.0

    ratios = {"tip_speed_ratio": np.array([10.0, 7.5, 5.0])}
    np.testing.assert_allclose(Least().share(ratios), [0.0, 0.5, 1.0])
    assert not is_quantity(Least())  # it may not be the only limit on its quantity
    entry = of_limit(Least(), ratios | {"time": np.arange(3.0)})
    assert entry.row("least_ratio").text == "5, at least 5, margin 0.00 %, binding, at t = 2.00 s"
    assert entry.row("least_ratio").label == "smallest least ratio"
    most = type("Window", (Least,), {"upper": 20.0, "__module__": __name__})()
    entry = of_limit(most, {"tip_speed_ratio": np.array([10.0, 4.0]), "time": np.arange(2.0)})
    assert entry.row("window").text == "4, at least 5, exceeded by 20.00 %, at t = 1.00 s"


# Short optimizations ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    def solve(**sections):
        case = load_case(SHORT | {"rotor": {"stations": NINE}} | sections)  # on nine stations
        return run_case(case, tmp_path_factory.mktemp("run") / "out", figures=False, records=False)

    return solve


@pytest.mark.slow
def test_a_limited_rate_of_the_torque_is_one_optimum_in_speed_and_in_torque(run):
    energies = []
    for unknown in ("speed", "torque"):
        control = {"law": "open_loop", "torque_limit": 700, "unknown": unknown}
        fixed = {"control": control, "design": {"blade": "fixed"}}
        solution = run(**fixed, limits={"torque_rate": "20 N m/s"})
        assert solution.success, solution.message
        entry, simulated = solution.summary.limits["torque_rate"], solution.simulation
        assert entry.binding
        assert entry.value == pytest.approx(20.0, rel=1e-3)
        rates = np.gradient(simulated["control_torque_Nm"], simulated["time_s"])
        assert np.max(np.abs(rates)) <= 20.0 * 1.001
        assert np.min(rates) == pytest.approx(-20.0, rel=1e-3)  # a fall is limited too
        assert "largest torque rate" in texts(solution.summary.rows(solution.case))
        energies.append(solution.summary.simulated_energy_J)
    assert energies[0] == pytest.approx(energies[1], rel=5e-5)
    assert max(energies) < run(**fixed).summary.simulated_energy_J


@pytest.mark.slow
def test_feedback_keeps_a_limited_rate_of_its_torque_at_a_loss(run):
    """Each limit's designs are among those of the looser one, so energies fall.

    The start has 29 N m/s. From there these two limits end at the same optimum with every BLAS
    kernel that was tried (Zen, Sandybridge, Nehalem); half of it, 15 N m/s, does not.
    """
    law = {"law": "linear", "torque_limit": 700}
    energies = [run(control=law).summary.simulated_energy_J]
    for bound in (25.0, 20.0):
        held = run(control=law, limits={"torque_rate": bound})
        assert held.success, held.message
        assert held.summary.start_breaks == ["torque_rate"]
        assert held.summary.limits["torque_rate"].value <= bound * 1.001
        energies.append(held.summary.simulated_energy_J)
    assert energies == sorted(energies, reverse=True)


def test_a_tapered_blade_grows_nowhere_outboard(run):
    solution = run(control="quadratic", limits={"taper_from": 0.25, "rotor_speed": "75 rpm"})
    assert solution.success, solution.message
    chord, places = solution.blade["chord_m"], solution.blade["r_m"] / 1.4
    assert np.max(np.diff(chord)[places[:-1] >= 0.25] / chord.max()) <= 1e-6
    assert np.max(solution.simulation["rotor_speed_rad_s"]) <= 2.5 * np.pi * 1.001


@pytest.mark.slow
def test_electrical_energy_is_maximized_where_the_generator_loses_least(run):
    losses = {"rated_torque": 700, "rated_speed": "90 rpm", "copper_loss": "0.5 kW"}
    losses |= {"friction_loss": 50, "iron_loss": 100}
    best, blind = (run(generator=losses, objective=kind) for kind in ("electrical", "generator"))
    for solution in (best, blind):
        assert solution.success, solution.message
    assert best.summary.electrical_energy_J > 1.002 * blind.summary.electrical_energy_J
    assert best.summary.generator_energy_J < blind.summary.generator_energy_J
    assert best.summary.tip_speed_ratio.mean > blind.summary.tip_speed_ratio.mean
    energy = best.summary.electrical_energy_J
    assert best.summary.objective.simulated == pytest.approx(energy, rel=1e-6)
    trajectory = best.trajectory
    torque, speed = trajectory["control_torque_Nm"], trajectory["rotor_speed_rad_s"]
    expected = torque * speed - 500.0 * (torque / 700.0) ** 2
    expected = expected - 50.0 * speed / (3.0 * np.pi) - 100.0 * (speed / (3.0 * np.pi)) ** 2
    np.testing.assert_allclose(trajectory["electrical_power_W"], expected, rtol=1e-8)


def test_a_table_that_is_left_is_no_success(run, tmp_path):
    path, rows = tmp_path / "table.csv", "100,40,0.8\n100,60,0.8\n400,40,0.9\n400,60,0.9\n"
    path.write_text("torque_Nm,speed_rpm,efficiency\n" + rows)
    sections = {"generator": {"table": str(path)}, "objective": "electrical", "control": "linear"}
    solution = run(**sections, design={"blade": "fixed"})
    assert not solution.success
    assert solution.message.startswith("generator_table = ")
    assert "leave generator.table, over its range (try a control.torque_limit" in solution.message
    share = solution.summary.electrical_energy_J / solution.summary.generator_energy_J
    assert 0.85 < share < 0.915
