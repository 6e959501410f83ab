"""Steady scenarios and years: held to sums by SciPy, to runs over time, and to differences."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from openmdao.utils.assert_utils import assert_check_totals
from scipy.optimize import brentq
from scipy.stats import norm, weibull_min

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.flows import SineInflow
from hkt_mdo.dynamics.resource import YEAR
from hkt_mdo.dynamics.simulation import Plant
from hkt_mdo.errors import InputError
from hkt_mdo.problem.build import assemble
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.results.charts import figures
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.run.check import check_case
from hkt_mdo.run.run import run_case
from hkt_mdo.run.year import MEANS, table, uncertainty
from hkt_mdo.start.find import find_start
from hkt_mdo.studies.other_flows import Run, runs_of, simulations

HISTOGRAM = {
    "profile": "histogram",
    "speeds": [0.4, 0.8, 1.1, 1.4, -1.7, 2.2],
    "hours": [10, 20, 30, 20, 15, 5],
    "availability": 0.9,
    "speed_uncertainty": 0.02,
}
FIXED = {"design": {"blade": "fixed"}, "start": {"method": "blade"}}
QUADRATIC = {"law": "quadratic", "torque_limit": 900.0}
TIGHT = {"driver": {"tolerance": 1e-10}}


SECONDS = np.array(HISTOGRAM["hours"]) / sum(HISTOGRAM["hours"]) * YEAR
BINS = [*zip(HISTOGRAM["speeds"], SECONDS, strict=True)][1:]
"""Speed and seconds of the bins; the first one is below cut-in."""


def plant_of(model, polar=None):
    """Return the rotor of the model's blade, by direct BEM."""
    return Plant(model.blade, polar or model.rotor.polar, 1.0, 1000.0, bem.rotor_coefficients)


def power_of(plant, law, gain, flow):
    """Return the power in equilibrium, of several the fastest, by SciPy's root finding."""
    flow, gain = np.array([flow]), np.array([gain])

    def net(speed):
        speed = np.array([speed])
        return float(plant.torque(speed, flow)[0] - law.torque(speed, gain)[0])

    speeds = np.linspace(4.0, 14.0, 101) * flow[0] / 1.4
    last = np.flatnonzero([net(speed) > 0.0 for speed in speeds])[-1]
    speed = brentq(net, speeds[last], speeds[last + 1], xtol=1e-14, rtol=1e-14)
    return speed * float(plant.torque(np.array([speed]), flow)[0])


def run(out, **data):
    return run_case(load_case(data), out, figures=False, records=False)


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    """A year of a fixed blade, whose gain is designed."""
    out = tmp_path_factory.mktemp("year") / "year"
    return run(out, resource=HISTOGRAM, control=QUADRATIC, **FIXED)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["open_loop", "linear", "tracking"])
def test_derivatives_are_those_of_differences(law):
    asked = {"resource": HISTOGRAM, "control": law, "limits": {"thrust": "9 kN"}}
    model = physics(load_case(asked | {"start": {"method": "blade"}}))
    start = find_start(model, best_operation(model.blade, model.rotor.polar))
    problem = assemble(model, Setup(start, curve_nodes(model, start)))
    problem.run_model()
    options = {"method": "fd", "form": "central", "step_calc": "rel_avg", "out_stream": None}
    data = problem.check_totals(step=1e-6, driver_scaling=True, **options)
    assert_check_totals(data, atol=2e-6, rtol=2e-5)


def test_a_fixed_blades_year_is_the_sum_over_its_bins(year):
    """With the hours of the histogram."""
    assert year.success, year.message
    plant, law = plant_of(physics(year.case)), year.case.control
    total = sum(time * power_of(plant, law, year.gain, abs(v)) for v, time in BINS)
    assert year.summary.simulated_energy_J == pytest.approx(total, rel=1e-8)
    assert year.energy == pytest.approx(total, rel=2e-5)  # by the torque curve
    assert np.sum(year.year["energy_kWh"]) * 3.6e6 == pytest.approx(0.9 * total, rel=1e-8)


def test_a_years_design_is_simulated_in_a_record_as_long_as_that_is(year, tmp_path):
    """In the flow of a bin it comes to the power of the bin."""
    flow, power = (year.year[name][-1] for name in ("inflow_speed_m_s", "captured_power_W"))
    rows = [f"{time},{flow:.12g}" for time in range(25)]
    path = tmp_path / "record.csv"
    path.write_text("\n".join(("time_s,speed_m_s", *rows)))
    (result,) = runs_of(year, {"profile": "record", "file": str(path)})
    simulated = result.simulation
    assert simulated.time[-1] == 24.0
    last = simulated.hydrodynamic_torque[-1] * simulated.rotor_speed[-1]
    assert last == pytest.approx(power, rel=1e-6)
    # and begins in the equilibrium of the law, which in slower flow has another tip speed ratio
    assert np.allclose(simulated.rotor_speed, simulated.rotor_speed[-1], rtol=1e-6)
    # through gusts above the cut-out of mean speeds too, which is told
    stopped = replace(year, case=year.case.with_overrides(f"control.cut_out={0.9 * flow}"))
    (result,) = runs_of(stopped, {"profile": "record", "file": str(path)})
    assert "for 100 % of the time" in result.extremes["flow above the cut-out"].remark


@pytest.mark.slow
def test_jumps_of_the_torque_between_the_flows_of_a_year_do_not_matter(tmp_path):
    flow = {"speeds": [0.9, 1.3, 1.7, 2.1], "hours": [3000, 3000, 2000, 766], "cut_in": 0.7}
    data = {"rotor": {"blade": "river"}, "limits": {"power": "1.5 kW"}}
    data |= {"control": {"law": "tracking", "knots": 4}, "design": {"blade": "fixed"}}
    solution = run(tmp_path, resource={"profile": "histogram", **flow}, **data)
    assert solution.success, solution.message
    assert solution.summary.branches[0].name == "underspeed"
    assert len(solution.summary.passes) == 1


def test_the_uncertainty_of_the_speed_is_that_of_a_faster_and_a_slower_year(year):
    """In all flows one per cent faster and slower."""
    plant, law = plant_of(physics(year.case)), year.case.control

    def energy(scale):
        return sum(time * power_of(plant, law, year.gain, scale * abs(v)) for v, time in BINS)

    entry = year.summary.scenarios["phase"].year
    share = 0.02 * (energy(1.01) - energy(0.99)) / (0.02 * energy(1.0))
    assert entry.uncertainty == entry.uncertainty_by["speed"] == pytest.approx(share, rel=0.02)
    rows = {row.label: row for row in year.summary.rows(year.case)}
    row, energy = rows["standard uncertainty of annual energy"], rows["annual energy"]
    assert (row.value, row.unit) == (pytest.approx(100.0 * share, rel=0.02), "%")
    assert (energy.value, energy.unit) == (entry.energy_kWh, "kWh")


@pytest.mark.parametrize("intensity", [0.0, 0.1])
def test_hours_that_cross_the_cut_off_speeds_count_in_the_uncertainty(intensity):
    """Held to the energy in a flow that is faster and slower, by quantiles of the distribution."""
    resource = {"profile": "distribution", "scale": 1.4, "shape": 2.2, "cut_in": 0.7}
    resource |= {"turbulence_intensity": intensity, "speed_uncertainty": 0.03}
    control = {"law": "linear", "cut_out": 1.9}
    scenario = physics(load_case({"resource": resource, "control": control})).scenarios[0]
    speed = scenario.speeds

    def power(speed):
        return speed**3 / (1.0 + (speed / 2.0) ** 8)

    series = {"inflow_speed": speed, "electrical_power": power(speed)}
    parts = uncertainty([SimpleNamespace(scenario=scenario, integrated=series)])
    rank = (np.arange(2000) + 0.5) / 2000.0
    flow = np.outer(weibull_min.ppf(rank, 2.2, scale=1.4), 1.0 + intensity * norm.ppf(rank))

    def energy(scale):
        speeds = scale * flow
        return np.sum(power(speeds[(speeds > 0.7) & (speeds < 1.9)]))

    expected = abs(energy(1.03) - energy(0.97)) / (2.0 * energy(1.0))
    assert parts == {"speed": pytest.approx(expected, abs=2e-3)}  # bins of 0.1 m/s


def test_rows_of_a_turbulent_year_have_the_hours_of_the_resource():
    """Their power is a mean over all of their time, so that hours times power is the energy."""
    resource = {"profile": "histogram", "speeds": [0.8, 1.8], "hours": [7, 3]}
    resource |= {"turbulence_intensity": 0.1, "cut_in": 0.6}
    case = {"resource": resource, "control": {"law": "linear", "cut_out": 1.9}}
    scenario = physics(load_case(case)).scenarios[0]
    series = dict.fromkeys(MEANS.values(), scenario.speeds**3)
    columns = table([SimpleNamespace(scenario=scenario, integrated=series)])
    np.testing.assert_allclose(columns["hours"], [0.7 * 8766.0, 0.3 * 8766.0])
    energy = scenario.node_weights @ scenario.speeds**3 / 3.6e6
    assert np.sum(columns["energy_kWh"]) == pytest.approx(energy, rel=1e-12)


def force_on_section(flow, chordwise, normal):
    """Force on a section over dynamic pressure and chord, as vectors, at any angle of attack.

    The lift of a plate and drag, and a force to the convex side by camber. `flow` is the direction
    of the flow, `chordwise` that from the leading to the trailing edge.
    """
    cosine, sine = flow @ chordwise, flow @ normal
    across = np.array([-flow[1], flow[0]])
    return 5.0 * sine * cosine * across + 0.1 * cosine**2 * normal + 0.05 * flow


def reversed_polar(path):
    """Write the polar of that section in flow from behind, over its angle less 180 degrees."""
    rows, x, y = [], np.array([1.0, 0.0]), np.array([0.0, 1.0])
    for angle in np.arange(-20.0, 20.25, 0.25):
        full = np.deg2rad(angle + 180.0)
        flow = np.array([np.cos(full), np.sin(full)])
        force = force_on_section(flow, x, y)
        rows.append([angle, force @ np.array([-flow[1], flow[0]]), force @ flow])
    np.savetxt(path, rows, delimiter=",", header="alpha_deg,cl,cd", comments="")
    return str(path)


def test_a_section_in_flow_from_behind_has_the_forces_of_the_blade_in_its_own_frame(tmp_path):
    """The flow is along -x, the blade moves along -y, its trailing edge in front."""
    rotor = {"polar": reversed_polar(tmp_path / "reversed.csv")}
    model = physics(load_case({"resource": HISTOGRAM, "control": QUADRATIC, "rotor": rotor}))
    blade, ratio = model.blade, 6.0
    sections = bem.sections(blade, model.rotor.polar, np.array([ratio]))
    checked = 0
    for i, r in enumerate(blade.r):
        if abs(sections.angle_of_attack[0, i]) > np.deg2rad(18.0):
            continue  # beyond the file
        axial = 1.0 - sections.axial_induction[0, i]
        turning = ratio * r / blade.rotor_radius * (1.0 + sections.tangential_induction[0, i])
        wind = np.array([-axial, turning])
        twist = blade.twist[i]
        chordwise = np.array([np.sin(twist), -np.cos(twist)])
        normal = np.array([np.cos(twist), np.sin(twist)])
        size = np.hypot(*wind)
        force = blade.chord[i] * size**2 * force_on_section(wind / size, chordwise, normal)
        loads = sections.normal_load[0, i], sections.tangential_load[0, i]
        np.testing.assert_allclose(-force, loads, rtol=2e-4, atol=1e-4)
        checked += 1
    assert checked > 5


@pytest.mark.slow
def test_a_year_backwards_is_the_sum_over_its_bins(tmp_path):
    """Each direction with the polar of its own; limits hold in both."""
    file = reversed_polar(tmp_path / "reversed.csv")
    back = {"reversal": "backwards", "reversed_polar": file}
    solution = run(tmp_path / "a", resource=HISTOGRAM | back, control=QUADRATIC, **FIXED)
    assert solution.success, solution.message
    model, law = physics(solution.case), solution.case.control
    rotor = solution.case.rotor.model_copy(update={"polar": file})
    plants = plant_of(model), plant_of(model, build_turbine(rotor, solution.case.fluid, 1.0).polar)
    total = sum(time * power_of(plants[v < 0.0], law, solution.gain, abs(v)) for v, time in BINS)
    assert solution.summary.simulated_energy_J == pytest.approx(total, rel=1e-8)
    assert np.sum(solution.year["energy_kWh"]) * 3.6e6 == pytest.approx(0.9 * total, rel=1e-8)
    rows = {row.label: row.text for row in solution.summary.rows(solution.case)}
    assert "standstill 876.6 h" in rows["hours of operation"]
    assert "year" in figures(solution)
    flows = [{"resource": HISTOGRAM | back}, {"inflow": "sine", "duration": 8.0, "segments": 8}]
    mixed = run(tmp_path / "b", scenarios=flows, control=QUADRATIC, **FIXED)
    assert mixed.success, mixed.message  # the nodes of the torque curve suit the reversed polar
    assert len(mixed.summary.passes) < 4


def test_a_year_is_reported(year):
    entry = year.summary.scenarios["phase"].year
    assert entry.operation_h == pytest.approx(0.9 * 8766.0)
    assert entry.standstill_h == pytest.approx(0.1 * 8766.0)
    assert entry.net_energy_kWh == pytest.approx(0.9 * entry.energy_kWh)
    most = float(np.max(year.simulation["electrical_power_W"]))  # at the edge of the last bin
    assert entry.capacity_factor == pytest.approx(entry.net_energy_kWh / (8.766 * most), rel=1e-9)
    held = year.year["control_torque_Nm"] >= 0.999 * 900.0
    assert entry.limits_h["control_torque"] == pytest.approx(np.sum(year.year["hours"][held]))
    assert entry.limits_h["control_torque"] > 0.0
    rows = {row.label: row.text for row in year.summary.rows(year.case)}
    assert rows["capacity factor"].endswith("at an end of the flow's range, which has no hours")
    weights = physics(year.case).scenarios[0].node_weights
    mean = np.average(year.simulation["tip_speed_ratio"], weights=weights)
    assert year.summary.tip_speed_ratio.mean == pytest.approx(mean, rel=1e-9)
    assert "kWh" in rows["annual energy, net"]
    assert "in a flow of 2.35 m/s" in rows["largest rotor speed"]
    checks = {check.name: check for check in year.summary.checks}
    assert "energy_error" in checks
    assert checks["closed_loop"].value < 0.0
    assert checks["max_speed_error"].value < 1e-5


def test_a_limit_holds_at_the_ends_of_the_flow_and_the_error_of_its_bins_is_told(tmp_path):
    """Simulated over time, and by the equilibria at all speeds of the sine."""
    scenario, limit = [{"name": "st", "steady": True}], {"power": "6.8 kW"}
    data = {"inflow": "sine", "limits": limit, "control": QUADRATIC, **FIXED}
    solution = run(tmp_path / "a", scenarios=scenario, **data)
    assert solution.success, solution.message
    entry = solution.summary.scenarios["st"].limits["power"]
    assert entry.flow_m_s == pytest.approx(1.7, rel=1e-5)
    assert entry.value == pytest.approx(6800.0, rel=1e-4)
    design, sine = solution.design(), SineInflow()
    most = Run(design, sine).extremes["power"]
    assert most.kept
    assert most.value == pytest.approx(6800.0, rel=2e-3)
    flow = sine.speed_at(60.0 * (np.arange(2000) + 0.5) / 2000)
    speed, *_ = equilibria(design.plant, design.controller, np.sort(flow))
    power = speed * design.plant.torque(speed, np.sort(flow))
    table = solution.simulation
    weights = physics(solution.case).scenarios[0].node_weights
    binned = weights @ table["hydrodynamic_power_W"] / np.sum(weights)
    assert solution.summary.bins_error == pytest.approx(binned / np.mean(power) - 1.0, abs=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "goal"), [("quadratic", "captured"), ("open_loop", "generator")])
def test_a_year_of_one_speed_is_the_run_over_time(tmp_path, law, goal):
    data = {"control": {"law": law, "torque_limit": 500.0}, "objective": goal, **FIXED, **TIGHT}
    one = {"profile": "histogram", "speeds": [1.3], "hours": [1]}
    flow = {"profile": "constant", "speed": 1.3}
    phase = {"duration": 10.0, "segments": 8}
    steady = run(tmp_path / "a", resource=one, **data)
    moving = run(tmp_path / "b", inflow=flow, phase=phase, **data)
    scenario = {"inflow": flow, "steady": True}
    third = run(tmp_path / "c", scenarios=[scenario], phase=phase, **data)
    power = steady.summary.objective.simulated / YEAR
    for solution, rel in ((moving, 1e-6), (third, 1e-9)):
        assert steady.success and solution.success  # noqa: PT018
        assert solution.summary.objective.simulated / 10.0 == pytest.approx(power, rel=rel)


@pytest.mark.slow
def test_steady_and_moving_scenarios_share_a_design(tmp_path):
    """A load case without time keeps its limit, and the shares of time count."""
    fast = {"inflow": {"profile": "constant", "speed": 1.9}, "limits": {"power": "6 kW"}}
    flows = [
        {"name": "moving", "inflow": "sine", "weight": 1.0, "duration": 8.0, "segments": 8},
        {"name": "year", "resource": HISTOGRAM, "weight": 3.0},
        {"name": "fast", "steady": True, "weight": 0.0, **fast},
    ]
    solution = run(tmp_path / "a", scenarios=flows, control=QUADRATIC, **FIXED)
    assert solution.success, solution.message
    scenarios = solution.summary.scenarios
    powers = [scenarios[name].mean_power_W for name in ("moving", "year")]
    mean = solution.summary.objective.simulated / solution.case.phase.duration
    assert mean == pytest.approx(0.25 * powers[0] + 0.75 * powers[1], rel=1e-8)
    assert scenarios["fast"].limits["power"].value <= 6000.0 * (1.0 + 1e-4)
    assert scenarios["fast"].steady and not scenarios["moving"].steady  # noqa: PT018


def test_a_year_has_no_course_to_be_simulated_in(year):
    with pytest.raises(InputError, match="no flow over time"):
        year.design().simulate(year.case.inflow)


def test_a_finished_design_makes_in_another_year_the_sum_over_its_bins(year):
    speeds, hours = [0.9, 1.3, 1.9], np.array([4.0, 5.0, 6.0])
    plant, law = plant_of(physics(year.case)), year.case.control
    flow = {"profile": "histogram", "speeds": speeds, "hours": hours.tolist()}
    (result,), (shut,) = runs_of(year, flow), simulations(year, flow, cut_out=1.5)
    *slow, fast = hours * [power_of(plant, law, year.gain, flow) for flow in speeds]
    total = (sum(slow) + fast) / np.sum(hours) * YEAR
    assert result.energies["energy"] == pytest.approx(total, rel=1e-8)
    assert shut.energies["energy"] == pytest.approx(sum(slow) / np.sum(hours) * YEAR, rel=1e-8)
    assert result.lines()[0].startswith(f"annual energy: {total / 3.6e6:.6g} kWh")
    assert result.extremes["control_torque"].flow_m_s > 1.9
    # with another torque constant, too, as over time
    worn = replace(year, case=year.case.with_overrides("condition.torque_constant=0.8"))
    (steady,) = runs_of(worn, {"profile": "histogram", "speeds": [1.9], "hours": [1]})
    (moving,) = runs_of(worn, {"profile": "constant", "speed": 1.9})
    power = moving.energies["energy"] / 60.0
    assert steady.energies["energy"] / YEAR == pytest.approx(power, rel=1e-6)
    assert power < 0.99 * fast / hours[-1]
    stalled = replace(result, design=replace(result.design, gains=1e4 * result.design.gains))
    with pytest.raises(InputError, match=r"no equilibrium of the rotor in a flow of .* cut_in"):
        stalled.lines()


MONTH = {
    "profile": "tide",
    "mean": 1.5,
    "constituents": [{"name": "M2", "amplitude": 0.4}, {"name": "S2", "amplitude": 0.15}],
}


def test_a_month_of_a_tide_over_time_is_refused_and_the_steady_scenario_offered(tmp_path):
    phase = {"duration": 14 * 86400.0}
    data = {"inflow": MONTH, "control": QUADRATIC, "phase": phase}
    for begun in check_case, lambda case: run_case(case, tmp_path / "never"):
        with pytest.raises(InputError, match=r"inflow = .*profile: tide.*steady: true"):
            begun(load_case(data))
    assert not (tmp_path / "never").exists()
    check_case(load_case(data | {"control": "open_loop"}))
    scenario = {"inflow": MONTH, "steady": True}
    model = physics(load_case(data | {"inflow": "sine", "scenarios": [scenario]}))
    assert not model.warnings
    steady = model.scenarios[0]
    tide = steady.resource.speed_at(np.linspace(0.0, 14 * 86400.0, 20001))
    mean = steady.node_weights @ steady.speeds**3 / steady.duration
    assert mean == pytest.approx(np.mean(tide**3), rel=2e-4)
