"""Loads that are told of a result: held to sums over the stations, and to the model by instants."""

from dataclasses import replace

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.evaluation import RATIOS, loads_along, scalars
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.solution import TABLES, Solution
from hkt_mdo.results.words import texts
from hkt_mdo.rotor import bem
from hkt_mdo.run import loads
from hkt_mdo.run.run import run_case

PLAIN = {"inflow": "sine", "control": {"law": "quadratic"}, "site": {"hub_depth": 3.0}}
SHORT = PLAIN | {
    "control": {"law": "quadratic", "torque_limit": 700.0},
    "generator": {"efficiency": 0.9},
    "phase": {"duration": 10.0, "segments": 10},
}


COLUMNS = {"thrust": "thrust_N", "root_moment": "root_moment_Nm", "stress": "stress_Pa"}
COLUMNS |= {"cavitation": "cavitation", "power": "generator_power_W"}
COLUMNS |= {"rotor_speed": "rotor_speed_rad_s"}


def trajectory(model, count=40):
    """Return quantities of an invented trajectory with all loads."""
    time = np.linspace(0.0, 25.0, count)
    flow = 1.5 + 0.2 * np.sin(0.25 * time)
    speed = (6.5 + 0.5 * np.cos(0.2 * time)) * flow / model.blade.rotor_radius
    series = {
        "time": time,
        "inflow_speed": flow,
        "rotor_speed": speed,
        "tip_speed_ratio": speed * model.blade.rotor_radius / flow,
        "generator_power": 600.0 * speed,
    }
    series |= loads_along(model.rotor, model.blade, series, model.rotor.load_names)
    return series | scalars(model, model.rotor, model.blade) | {"inertia": 10.0}


def pressure(model, series, at):
    return 0.5 * model.density * series["inflow_speed"][at] ** 2


# Theory -------------------------------------------------------------------------------------------


def test_flapwise_moment_is_the_integral_of_load_times_arm():
    """The trapezoidal rule over stations and tip, by hand; at the hub it is the root moment."""
    turbine = physics(load_case(PLAIN))
    blade, model, ratio = turbine.blade, turbine.rotor, 6.3
    normal = bem.sections(blade, turbine.rotor.polar, np.array([ratio])).normal_load[0]
    edges = np.append(blade.r, blade.tip_radius)
    by_hand = []
    for first in range(blade.r.size):
        arm = np.append(normal[first:], 0.0) * (edges[first:] - blade.r[first])
        by_hand.append(np.trapezoid(arm, edges[first:]))
    moments = model.moments(blade, ratio, blade.r)[0][0]
    np.testing.assert_allclose(moments, by_hand, rtol=1e-12, atol=1e-12 * by_hand[0])
    root = model.loads(blade, ratio, names=("root_moment",))["root_moment"].exact
    hub, _ = model.moments(blade, ratio, [blade.hub_radius])
    np.testing.assert_allclose(hub, root, rtol=1e-12)


def test_the_span_is_that_of_the_worst_instants():
    model = physics(load_case(PLAIN))
    series = trajectory(model)
    weaker = series | {name: 0.9 * series[name] for name in model.rotor.load_names}
    other = replace(model.rotor, water_density=900.0)  # each trajectory is of its own rotor
    span = loads.over_span(model.blade, [(other, weaker), (model.rotor, series)])
    assert set(span) == {"stress", "flapwise_moment", "cavitation"}
    for name in ("stress", "cavitation"):
        r, values = span[name]
        assert values.max() == pytest.approx(series[name].max(), rel=1e-12)
        assert model.blade.r[0] <= r[np.argmax(values)] <= model.blade.r[-1]
    at = np.argmax(series["stress"])
    ratio = series["tip_speed_ratio"][at]
    moment = model.rotor.moments(model.blade, ratio, span["stress"][0])[0][0]
    expected = pressure(model, series, at) * moment
    np.testing.assert_allclose(span["flapwise_moment"][1], expected, rtol=1e-12)
    at = np.argmax(series["cavitation"])
    sections = bem.sections(model.blade, model.rotor.polar, series["tip_speed_ratio"][at : at + 1])
    suction, _ = model.rotor.polar.suction_at(sections.angle_of_attack)
    available = 101325.0 - 1705.0 + 9.80665 * model.density * (3.0 - model.blade.r)
    dynamic = pressure(model, series, at) * sections.relative_speed[0] ** 2
    by_hand = 1.1 * suction.max(axis=0)[0] * dynamic / available
    np.testing.assert_allclose(span["cavitation"][1], by_hand, rtol=1e-12)


def test_local_reynolds_numbers_are_those_of_each_instant():
    """More instants than are looked at together; each as if it were alone."""
    rotor = {"polar": "naca63815", "reynolds": "local"}
    turbine = physics(load_case(PLAIN | {"rotor": rotor}))
    assert turbine.rotor.load_names == ("thrust", "root_moment", "stress")
    series = trajectory(turbine, RATIOS + 20)
    for at in (0, RATIOS - 1, RATIOS, RATIOS + 19):
        model = turbine.rotor.at_flow(series["inflow_speed"][at])
        values = model.loads(turbine.blade, series["tip_speed_ratio"][at])
        for name, load in values.items():
            expected = pressure(turbine, series, at) * load.largest[0]
            assert series[name][at] == pytest.approx(expected, rel=1e-9)
    assert loads.tip_deflection(turbine.blade, [(turbine.rotor, series)]) is None
    values = loads.over_span(turbine.blade, [(turbine.rotor, series)])
    assert set(values) == {"stress", "flapwise_moment"}
    assert values["stress"][1].max() == pytest.approx(series["stress"].max(), rel=1e-9)


def test_a_fouled_polar_without_suction_has_no_cavitation(tmp_path):
    """Although the clean one has it: a run ended in an error after its optimization."""
    fouled = tmp_path / "fouled.csv"
    rows = (f"{alpha},{0.1 * alpha:g},0.02" for alpha in range(-10, 16))
    fouled.write_text("\n".join(("alpha_deg,cl,cd", *rows)))
    model = physics(load_case(PLAIN | {"condition": {"polar": str(fouled)}}))
    assert model.rotor.load_names == ("thrust", "root_moment", "stress")
    assert physics(load_case(PLAIN)).rotor.load_names == (*model.rotor.load_names, "cavitation")


# A result's folder --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> Solution:
    out = tmp_path_factory.mktemp("loads") / "result"
    return run_case(load_case(SHORT), out, figures=False, records=False)


def test_the_tables_have_the_loads(result):
    """Every load of both tables, and those along the span, by the model at their instants."""
    turbine = physics(result.case)
    chord, twist = result.blade["chord_m"], np.deg2rad(result.blade["twist_deg"])
    design = replace(turbine.blade, chord=chord, twist=twist)
    for table in (result.trajectory, result.simulation):
        assert set(table) == set(TABLES["trajectory"])
        q = 0.5 * turbine.density * table["inflow_speed_m_s"] ** 2
        model = turbine.rotor.loads(design, table["tip_speed_ratio"])
        for name, load in model.items():
            np.testing.assert_allclose(table[COLUMNS[name]], q * load.largest, rtol=1e-8)
    span, simulation = result.loads, result.simulation
    assert set(span) == set(TABLES["loads"])
    np.testing.assert_allclose(span["r_over_R"] * 1.4, span["r_m"], rtol=1e-9)
    for name in ("stress_Pa", "cavitation"):
        assert span[name].max() == pytest.approx(simulation[name].max(), rel=1e-8)


def test_the_summary_tells_the_same(result):
    simulation, entries = result.simulation, result.summary.loads
    for name, column in COLUMNS.items():
        worst = np.argmax(simulation[column])
        assert entries[name].value == pytest.approx(simulation[column][worst], rel=1e-8)
        assert entries[name].time_s == pytest.approx(simulation["time_s"][worst], abs=1e-9)
    assert entries["tip_speed"].value == pytest.approx(1.4 * entries["rotor_speed"].value, rel=1e-9)
    for name in ("stress", "cavitation"):
        radius = result.loads["r_m"][np.argmax(result.loads[COLUMNS[name]])]
        assert entries[name].r_m == pytest.approx(radius, rel=1e-9)
    assert entries["thrust"].r_m is None
    beyond = np.interp(np.linspace(0.0, 8.0, 9001), simulation["time_s"], simulation["cavitation"])
    assert entries["cavitation"].share_of_time == pytest.approx(np.mean(beyond > 1.1), abs=2e-3)
    summary = result.summary
    lost = summary.generator_energy_J - summary.electrical_energy_J
    assert lost == pytest.approx(0.1 * summary.generator_energy_J, rel=1e-9)
    rows = texts(summary.rows(result.case))
    assert rows["energy, electrical"].endswith(f"losses {lost / 1e3:#.5g} kJ (10 %)")
    share = result.limit_shares()
    assert list(share) == ["control_torque"]
    np.testing.assert_allclose(share["control_torque"], simulation["control_torque_Nm"] / 700.0)


def test_an_older_result_is_read(result, tmp_path):
    """Its tables have no loads, and its summary no places along the blade."""
    for name in ("case.yaml", "summary.json", "coefficients.csv", "convergence.csv"):
        (tmp_path / name).write_bytes((result.folder / name).read_bytes())
    for name in ("trajectory", "simulation"):
        lines = (result.folder / f"{name}.csv").read_text().splitlines()
        older = "\n".join(",".join(line.split(",")[:9]) for line in lines)
        (tmp_path / f"{name}.csv").write_text(older + "\n")
    old = Solution.load(tmp_path)
    assert old.loads == {}
    assert list(old.simulation) == list(TABLES["simulation"])[:9]
    np.testing.assert_array_equal(old.trajectory["time_s"], result.trajectory["time_s"])
    assert list(old.limit_shares()) == ["control_torque"]
