"""Steady scenarios and years: held to sums by SciPy, to runs over time, and to differences."""

import numpy as np
import pytest
from openmdao.utils.assert_utils import assert_check_partials, assert_check_totals
from scipy.optimize import brentq

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.flows import ConstantInflow
from hkt_mdo.dynamics.resource import YEAR
from hkt_mdo.dynamics.simulation import Plant
from hkt_mdo.errors import InputError
from hkt_mdo.problem.build import assemble
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.report.charts import Labelled, views
from hkt_mdo.results.plots import figures
from hkt_mdo.results.solution import Solution
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.hydrodynamics import Hydrodynamics
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.run.check import check_case
from hkt_mdo.run.run import run_case
from hkt_mdo.start.find import find_start
from hkt_mdo.studies.uncertainty import Design

HISTOGRAM = {
    "profile": "histogram",
    "speeds": [0.4, 0.8, 1.1, 1.4, -1.7, 2.2],
    "hours": [10, 20, 30, 20, 15, 5],
    "availability": 0.9,
}
FIXED = {"design": {"blade": "fixed"}, "start": {"method": "blade"}}
QUADRATIC = {"law": "quadratic", "torque_limit": 900.0}
TIGHT = {"driver": {"tolerance": 1e-10}}


def run(out, **data):
    return run_case(load_case(data), out, figures=False, records=False)


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    """A year of a fixed blade, whose gain is designed."""
    out = tmp_path_factory.mktemp("year") / "year"
    run(out, resource=HISTOGRAM, control=QUADRATIC, **FIXED)
    return Solution.load(out)


def check_derivatives(control, **more):
    """Compare partials and totals of a coarse problem with differences."""
    more = {"resource": HISTOGRAM, "control": control, "start": {"method": "blade"}} | more
    world = physics(load_case(more))
    start = find_start(world, best_operation(world.blade, Hydrodynamics(world.polar)))
    problem = assemble(world, Setup(start, curve_nodes(world, start)))
    problem.run_model()
    about = {"method": "fd", "form": "central", "step_calc": "rel_avg", "out_stream": None}
    part = ["operation.steady_phase.timeseries"]
    assert_check_partials(problem.check_partials(includes=part, **about), atol=1e-4, rtol=1e-5)
    data = problem.check_totals(step=1e-6, driver_scaling=True, **about)
    assert_check_totals(data, atol=2e-6, rtol=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["open_loop", "linear", "tracking"])
def test_derivatives_are_those_of_differences(law):
    check_derivatives({"law": law}, limits={"thrust": "9 kN"})


def test_a_fixed_blades_year_is_the_sum_over_its_bins(year):
    """Each by SciPy's root finding on direct BEM, with the hours of the histogram."""
    assert year.success, year.message
    world, law = physics(year.case), year.case.control
    plant = Plant(world.blade, world.polar, 1.0, 1000.0, bem.rotor_coefficients)
    gain, total = np.array([year.gain]), 0.0
    hours = np.array(HISTOGRAM["hours"]) / sum(HISTOGRAM["hours"]) * YEAR
    for v, time in zip(HISTOGRAM["speeds"], hours, strict=True):
        v = abs(v)
        if v < 0.5:
            continue  # below cut-in

        def net(w, v=v):
            torque = plant.torque(np.array([w]), np.array([v]))[0]
            return float(torque - law.torque(np.array([w]), gain)[0])

        w = brentq(net, 5.0 * v / 1.4, 14.0 * v / 1.4, xtol=1e-14, rtol=1e-14)
        total += time * w * float(plant.torque(np.array([w]), np.array([v]))[0])
    assert year.summary.simulated_energy_J == pytest.approx(total, rel=1e-8)
    assert year.energy == pytest.approx(total, rel=2e-5)  # by the torque curve
    assert np.sum(year.year["energy_kWh"]) * 3.6e6 == pytest.approx(0.9 * total, rel=1e-8)


def test_a_year_is_reported(year):
    told = year.summary.scenarios["phase"].year
    assert told.operation_h == pytest.approx(0.9 * 8766.0)
    assert told.standstill_h == pytest.approx(0.1 * 8766.0)
    assert told.net_energy_kWh == pytest.approx(0.9 * told.energy_kWh)
    most = float(np.max(year.year["electrical_power_W"]))
    assert told.capacity_factor == pytest.approx(told.net_energy_kWh / (8.766 * most), rel=1e-9)
    held = year.year["control_torque_Nm"] >= 0.999 * 900.0
    assert told.limits_h["control_torque"] == pytest.approx(np.sum(year.year["hours"][held]))
    assert told.limits_h["control_torque"] > 0.0
    rows = {row.label: row.text for row in year.summary.rows(year.case)}
    assert "kWh" in rows["annual energy, net"]
    assert "in a flow of 2.2 m/s" in rows["largest rotor speed"]
    assert "energy_error" in {check.name for check in year.summary.checks}


@pytest.mark.slow
def test_a_year_has_figures_and_a_check(year):
    drawn = set(figures(year))
    assert {"year", "schedule"} <= drawn
    assert "operation" not in drawn
    kind = next(row for row in check_case(year.case).tables["Flow"] if row.label == "kind")
    assert kind.text.startswith("histogram")


def test_a_report_of_a_year_has_bins_and_nothing_over_time(year):
    (view,) = views([Labelled(year, "")]).values()
    assert {"flow", "year", "limits"} - view.keys() <= {"limits"}  # it has no limits
    assert "time" not in view
    bars = {trace["yaxis"]: trace["y"] for trace in view["year"]["data"]}
    np.testing.assert_allclose(bars["y3"], year.year["energy_kWh"], rtol=1e-4)
    mean = next(x for x in view["flow"]["data"] if x["name"] == "mean at this flow speed")
    assert mean["y"] == pytest.approx(
        np.sort(1e-3 * year.simulation["generator_power_W"]), rel=1e-4
    )


def test_stability_and_equilibrium_are_judged(year):
    checks = {check.name: check for check in year.summary.checks}
    assert checks["equilibrium_growth"].value < 0.0
    assert checks["max_speed_error"].value < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(("law", "goal"), [("quadratic", "captured"), ("open_loop", "generator")])
def test_a_year_of_one_speed_is_the_run_over_time(tmp_path, law, goal):
    about = {"control": {"law": law, "torque_limit": 500.0}, "objective": goal, **FIXED, **TIGHT}
    one = {"profile": "histogram", "speeds": [1.3], "hours": [1]}
    flow = {"profile": "constant", "speed": 1.3}
    phase = {"duration": 10.0, "segments": 8}
    steady = run(tmp_path / "a", resource=one, **about)
    moving = run(tmp_path / "b", inflow=flow, phase=phase, **about)
    scenario = {"inflow": flow, "steady": True}
    third = run(tmp_path / "c", scenarios=[scenario], phase=phase, **about)
    power = [
        x.summary.objective.simulated / t
        for x, t in ((steady, YEAR), (moving, 10.0), (third, 10.0))
    ]
    assert steady.success and moving.success and third.success  # noqa: PT018
    assert power[0] == pytest.approx(power[1], rel=1e-6)
    assert power[0] == pytest.approx(power[2], rel=1e-9)


@pytest.mark.slow
def test_steady_and_moving_scenarios_share_a_design(tmp_path):
    """A load case without time keeps its limit, and the shares of time count."""
    flows = [
        {"name": "moving", "inflow": "sine", "weight": 1.0, "duration": 8.0, "segments": 8},
        {"name": "year", "resource": HISTOGRAM, "weight": 3.0},
        {
            "name": "fast",
            "inflow": {"profile": "constant", "speed": 1.9},
            "steady": True,
            "weight": 0.0,
            "limits": {"power": "6 kW"},
        },
    ]
    found = run(tmp_path / "a", scenarios=flows, control=QUADRATIC, **FIXED)
    assert found.success, found.message
    told = found.summary.scenarios
    powers = [told[name].mean_power_W for name in ("moving", "year")]
    mean = found.summary.objective.simulated / found.case.phase.duration
    assert mean == pytest.approx(0.25 * powers[0] + 0.75 * powers[1], rel=1e-8)
    assert told["fast"].limits["power"].value <= 6000.0 * (1.0 + 1e-4)
    assert told["fast"].steady and not told["moving"].steady  # noqa: PT018


@pytest.mark.slow
def test_turbulence_within_a_bin_is_the_mean_of_a_run_over_time(tmp_path):
    """Of a fixed blade and its gain; the rotor follows the flow, but not without inertia."""
    flow = {"profile": "turbulence", "mean": 1.5, "intensity": 0.1, "seed": 3}
    flow |= {"duration": 300.0, "cutoff": 0.3}
    control = {"law": "quadratic", "gain": 10.0}
    about = FIXED | {"control": control}
    about["design"] = {"blade": "fixed", "gain_bounds": [9.999, 10.001]}
    moving = run(tmp_path / "a", inflow=flow, phase={"segments": 300}, **about)
    speed = moving.simulation["inflow_speed_m_s"]
    time = moving.simulation["time_s"]
    mean = np.trapezoid(speed, time) / time[-1]
    deviation = np.sqrt(np.trapezoid((speed - mean) ** 2, time) / time[-1])
    resource = {"profile": "histogram", "speeds": [float(mean)], "hours": [1]}
    resource["turbulence_intensity"] = float(deviation / mean)
    steady = run(tmp_path / "b", resource=resource, **about)
    powers = steady.summary.simulated_energy_J / YEAR, moving.summary.simulated_energy_J / 300.0
    assert powers[0] == pytest.approx(powers[1], rel=2e-3)
    calm = mean**3 * powers[1] / np.mean(speed**3)
    assert abs(powers[0] - powers[1]) < 0.1 * abs(calm - powers[1])


def test_a_year_has_no_course_to_be_simulated_in(year):
    design = Design.of(year)
    with pytest.raises(InputError, match="no flow over time"):
        design.fly(year.case.inflow)
    flow = ConstantInflow(speed=1.4)
    run_over_time = design.fly(flow)
    assert run_over_time.time[-1] == 60.0
    power = np.interp(1.4, year.year["inflow_speed_m_s"], year.year["captured_power_W"])
    assert run_over_time.energy / 60.0 == pytest.approx(power, rel=1e-4)


def test_the_torque_over_time_is_refused():
    case = load_case({"resource": HISTOGRAM, "control": {"law": "open_loop", "unknown": "torque"}})
    with pytest.raises(InputError, match=r"control\.unknown"):
        physics(case)


MONTH = {
    "profile": "tide",
    "mean": 1.5,
    "constituents": [{"name": "M2", "amplitude": 0.4}, {"name": "S2", "amplitude": 0.15}],
}


def test_a_month_of_a_tide_over_time_offers_the_steady_scenario():
    phase = {"duration": 14 * 86400.0}
    data = {"inflow": MONTH, "control": QUADRATIC, "phase": phase}
    assert any("steady: true" in text for text in physics(load_case(data)).warnings)
    scenario = {"inflow": MONTH, "steady": True}
    world = physics(load_case(data | {"inflow": "sine", "scenarios": [scenario]}))
    assert not world.warnings
    found = world.scenarios[0]
    tide = found.resource.speed_at(np.linspace(0.0, 14 * 86400.0, 20001))
    mean = found.node_weights @ found.speeds**3 / found.duration
    assert mean == pytest.approx(np.mean(tide**3), rel=2e-4)


@pytest.mark.slow
def test_a_month_of_spring_and_neap_is_designed_without_its_time(tmp_path):
    scenario = {"inflow": MONTH, "steady": True}
    phase = {"duration": 14 * 86400.0}
    control = {"law": "quadratic", "torque_limit": 700.0}
    found = run(tmp_path / "a", scenarios=[scenario], control=control, phase=phase)
    assert found.success, found.message
    assert found.energy / 6.4022e9 > 1.0  # of the start of the run over time, which was refused
