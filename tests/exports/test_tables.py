"""Tables as CSV, JSON and NetCDF: what independent readers read back, and what the numbers mean."""

import json
import warnings
from functools import cache

import numpy as np
import pandas
import pytest
import xarray

from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import export
from hkt_mdo.exports.tables import tables
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.start.find import RATIOS, TorqueSpline
from hkt_mdo.start.steady_flow import QuasiSteady
from tests.exports.made import made

QUADRATIC = "inflow: sine\ncontrol: {law: quadratic, torque_limit: 700}\ndesign: {blade: fixed}\n"
OPEN_LOOP = "inflow: sine\ncontrol: {law: open_loop, torque_limit: 700}\n"
TRACKING = """
inflow: sine
control: {law: tracking, torque_limit: 600, knots: 3, flow_range: [1.3, 1.7]}
limits: {power: 6 kW}
rotor: {cone: 5}
"""
SCENARIOS = """
inflow: sine
control: {law: quadratic, torque_limit: 700}
scenarios:
  - {name: slow, weight: 3, inflow: {profile: sine, mean: 1.2}, limits: {thrust: 4 kN}}
  - {name: fast, weight: 1, limits: {thrust: 8 kN}}
"""


GAINS = [6.5, 7.5, 8.2, 150.0, 700.0]


@pytest.fixture(scope="module")
def quadratic(tmp_path_factory):
    return made(tmp_path_factory.mktemp("quadratic") / "result", QUADRATIC, [11.0])


@pytest.fixture(scope="module")
def tracking(tmp_path_factory):
    return made(tmp_path_factory.mktemp("tracking") / "result", TRACKING, GAINS)


@pytest.fixture(scope="module")
def scenarios(tmp_path_factory):
    return made(tmp_path_factory.mktemp("scenarios") / "result", SCENARIOS, [11.0])


@cache
def by_name(solution):
    return {table.name: table for table in tables(solution.design())}


def values(table):
    return {name: np.asarray(column.values) for name, column in table.columns.items()}


@pytest.mark.parametrize(
    "name",
    ["scenarios", *(pytest.param(x, marks=pytest.mark.slow) for x in ("quadratic", "tracking"))],
)
def test_numbers_read_back_bit_by_bit(name, request, tmp_path):
    solution = request.getfixturevalue(name)
    with warnings.catch_warnings(action="error"):  # pydantic's of an option called json
        export(solution, ["csv", "json", "netcdf"], tmp_path)
    data = json.loads((tmp_path / "result.json").read_text())
    assert data["tables"].keys() == by_name(solution).keys()
    exact = {"float_precision": "round_trip", "keep_default_na": False, "na_values": ["nan"]}
    for table in by_name(solution).values():
        frame = pandas.read_csv(tmp_path / f"{table.name}.csv", comment="#", **exact)
        with xarray.open_dataset(tmp_path / "result.nc", group=table.name) as group:
            assert list(frame) == list(table.columns)
            assert set(frame) == set(group.variables)
            for column, array in values(table).items():
                spec, kind = table.columns[column], str if array.dtype.kind == "U" else float
                in_json = data["tables"][table.name]["columns"][column]
                for other in (frame[column], group[column], in_json["values"]):
                    np.testing.assert_array_equal(array, np.array(other, dtype=kind))
                assert group[column].attrs == {"units": spec.unit or "1", "long_name": spec.text}
                assert (in_json["unit"], in_json["long_name"]) == (spec.unit, spec.text)


BLADES = {
    "coned": (TRACKING, GAINS),
    "local Reynolds numbers": (QUADRATIC + "rotor: {polar: naca63815, reynolds: local}\n", [11.0]),
    "designed thickness": (
        """
inflow: sine
control: {law: open_loop, torque_limit: 700}
rotor:
  stations: [0.25, 0.5, 0.75, 0.98]
  sections:
    - {outline: examples/files/naca4412.csv, polar: examples/files/naca4412_polars.csv}
    - {outline: naca4415, polar: naca4415_Re1e6}
    - {outline: examples/files/naca4418.csv, polar: examples/files/naca4418_polars.csv}
design: {chord_points: 4, twist_points: 4, thickness_points: 4}
""",
        None,
    ),
}


@pytest.mark.parametrize(
    "name", ["coned", *(pytest.param(x, marks=pytest.mark.slow) for x in BLADES if x != "coned")]
)
def test_loads_of_the_stations_sum_to_torque_and_thrust(name, tmp_path):
    # loads are per length along a blade, which may be coned; the rotor's are about and along its
    # axis
    text, gains = BLADES[name]
    solution = made(tmp_path / "result", text, gains)
    data, design = by_name(solution), solution.design()
    cases, loads, blade = values(data["load_cases"]), values(data["station_loads"]), design.blade
    edges = np.concatenate(([blade.hub_radius], blade.r, [blade.tip_radius]))
    weights = 0.5 * (edges[2:] - edges[:-2]) * blade.blade_count
    cosine, density = np.cos(blade.cone), design.physics.density
    assert (cosine < 0.997) == (name == "coned")
    columns = (cases[each] for each in ("load_case", "inflow_speed_m_s", "tip_speed_ratio"))
    for number, flow, ratio in zip(*columns, strict=True):
        rows = loads["load_case"] == number
        rotor = design.physics.rotor.at_flow(flow).coefficients(blade, [ratio])
        unit = torque_scale(density, blade.rotor_radius, flow)
        torque = weights @ (loads["tangential_load_N_m"][rows] * blade.r * cosine)
        thrust = weights @ (loads["normal_load_N_m"][rows] * cosine)
        assert torque == pytest.approx(float(rotor.torque[0]) * unit, rel=1e-11)
        assert thrust == pytest.approx(float(rotor.thrust[0]) * unit / blade.rotor_radius, 1e-11)
        speed = loads["relative_speed_m_s"][rows]
        reynolds = speed * blade.chord / design.physics.case.fluid.kinematic_viscosity
        np.testing.assert_allclose(loads["reynolds_number"][rows], reynolds)
        angle = np.array([loads["angle_of_attack_rad"][rows]])
        polar = design.physics.rotor.polar.in_flow(flow)
        expected = polar.along("coefficients", blade, [ratio], angle)[0][:, 0]
        found = [loads[f"{name}_coefficient"][rows] for name in ("lift", "drag")]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(values(data["blade"])["chord_m"], blade.chord)
    if name == "designed thickness":
        thickness = values(data["blade"])["thickness_over_chord"]
        np.testing.assert_array_equal(thickness, blade.thickness)


def test_load_cases_are_the_largest_of_all_scenarios(scenarios):
    cases = values(by_name(scenarios)["load_cases"])
    (row,) = np.flatnonzero(np.char.find(cases["name"], "thrust") >= 0)
    series = scenarios.scenario("fast").simulation  # of which the thrust is twice that of slow
    assert cases["scenario"][row] == "fast"
    assert cases["time_s"][row] == series["time_s"][np.argmax(series["thrust_N"])]
    assert np.count_nonzero(np.isnan(cases["time_s"])) == 5


def test_steady_operation_is_a_balance_of_torques(quadratic):
    operation, design = values(by_name(quadratic)["operation"]), quadratic.design()
    speed, torque = operation["rotor_speed_rad_s"], operation["control_torque_Nm"]
    np.testing.assert_allclose(design.law.torque(speed, design.gains), torque, rtol=1e-12)
    np.testing.assert_allclose(operation["hydrodynamic_power_W"], torque * speed, rtol=1e-14)
    np.testing.assert_allclose(operation["control_torque_over_limit"], torque / 700.0, rtol=1e-14)
    model = design.physics
    spline = TorqueSpline(RATIOS * model.rotor.best_operation(design.blade).tip_speed_ratio)
    table = model.rotor.coefficients(design.blade, spline.nodes).torque
    quasi = QuasiSteady.of(model, design.blade, spline.curve(table))
    balance = quasi.operate(design.gains)
    flow = operation["inflow_speed_m_s"]
    assert (flow[0], flow[-1]) == (1.04, 2.04)
    inside = (flow > 1.31) & (flow < 1.69)
    order = np.argsort(quasi.inflow_speed)
    expected = np.interp(flow[inside], quasi.inflow_speed[order], balance.rotor_speed[order])
    np.testing.assert_allclose(speed[inside], expected, rtol=1e-5)


def test_steady_operation_of_a_law_with_states_is_its_schedule(tracking):
    operation, design = values(by_name(tracking)["operation"]), tracking.design()
    flow, speed = operation["inflow_speed_m_s"], operation["rotor_speed_rad_s"]
    torque = operation["control_torque_Nm"]
    below = torque < 0.9 * design.law.torque_limit  # above, the rotor turns faster
    schedule = design.law.speed_at_rest(flow, design.gains)
    np.testing.assert_allclose(speed[below], schedule[below], rtol=1e-3)
    assert np.all(speed[torque > 595.0] > 1.01 * schedule[torque > 595.0])
    np.testing.assert_allclose(design.plant.generator_torque(speed, flow), torque, rtol=1e-12)
    assert flow.size > 10
    assert np.max(torque) < 600.0
    assert "power_over_limit" in operation


def test_flow_range_is_an_option(quadratic, tmp_path):
    options = ["csv.flow_range=[0.5 m/s, 2.5 m/s]"]
    export(quadratic, ["csv"], tmp_path, options=options)
    frame = pandas.read_csv(tmp_path / "operation.csv", comment="#")
    np.testing.assert_allclose(frame["inflow_speed_m_s"], np.linspace(0.5, 2.5, 41))
    case = QUADRATIC.replace(", torque_limit: 700", "") + "generator: {efficiency: 0.9}"
    strong = made(tmp_path / "strong", case, [1e6])
    for name in ("csv", "windio"):  # which has no such option
        with pytest.raises(InputError, match=r"no steady operation .*check the gains"):
            export(strong, [name], tmp_path)


def test_steady_operation_of_a_year_lies_between_cut_in_and_cut_out(tmp_path):
    year = "resource: {profile: histogram, speeds: [0.5, 1.9], hours: [1, 1], cut_in: 0.7}"
    case = QUADRATIC.replace("inflow: sine", year).replace("700}", "700, cut_out: 2.0}")
    data = by_name(made(tmp_path / "year", case, [11.0]))
    assert values(data["operation"])["inflow_speed_m_s"][[0, -1]] == pytest.approx([0.7, 2.0])


def test_the_stricter_limit_of_two_scenarios_counts(scenarios):
    operation = values(by_name(scenarios)["operation"])
    np.testing.assert_allclose(operation["thrust_over_limit"], operation["thrust_N"] / 4000.0)


def test_open_loop_has_its_recorded_operation_only(tmp_path):
    solution = made(tmp_path / "result", OPEN_LOOP)
    data = by_name(solution)
    assert "operation" not in data
    cases = values(data["load_cases"])
    assert sum(name.startswith("recorded at") for name in cases["name"]) == 5
    assert all(np.isin(cases["time_s"], solution.simulation["time_s"]))


def test_coefficients_reach_beyond_the_operation(quadratic):
    table, design = values(by_name(quadratic)["coefficients"]), quadratic.design()
    ratio = table["tip_speed_ratio"]
    assert ratio[0] == 0.5
    assert ratio[-1] >= 1.9 * np.max(quadratic.trajectory["tip_speed_ratio"])
    expected = design.physics.rotor.coefficients(design.blade, ratio)
    np.testing.assert_array_equal(table["power_coefficient"], expected.power)
    np.testing.assert_allclose(table["power_coefficient"], table["torque_coefficient"] * ratio)
