"""`hkt check`: its figures held to closed forms, its counts to the problem that a run builds."""

import os
from functools import cache
from pathlib import Path

import numpy as np
import openmdao.api as om
import pytest
import yaml

from hkt_mdo.case import load_case, read_case
from hkt_mdo.cli import main
from hkt_mdo.dynamics.flows import ConstantInflow
from hkt_mdo.dynamics.simulation import simulate
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.words import texts
from hkt_mdo.run.check import CheckReport, check_case
from hkt_mdo.run.check_figures import power_spectrum
from hkt_mdo.run.findings import evaluated_problem
from hkt_mdo.run.verification import HeldSpeeds
from tests.files.broken.blades import WINDIO

CASES, DATA = Path(__file__).parents[2] / "cases", Path(__file__).parents[1] / "data"
BASE = "{inflow: {profile: sine}, control: {law: quadratic}}"


@pytest.fixture(autouse=True)
def _nothing_is_optimized(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a check runs no optimizer")

    monkeypatch.setattr(om.Problem, "run_driver", refuse)
    monkeypatch.setattr(os, "environ", os.environ.copy())
    monkeypatch.chdir(tmp_path)


@cache
def check(*overrides: str) -> CheckReport:
    return check_case(read_case(BASE, overrides))


def rows(report: CheckReport, title: str) -> str:
    return "\n".join(map(str, report.tables[title]))


def warnings(report: CheckReport) -> list[str]:
    return list(map(str, report.warnings))


# Theory -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reynolds", ["invariant", "local"])
def test_torque_at_the_rated_speed_is_the_limit(reynolds: str) -> None:
    local = reynolds == "local"
    polar = ["rotor={polar: naca63815, reynolds: local}"] if local else []
    report = check("control.torque_limit=700", *polar)
    findings = report.findings
    assert findings.physics.rotor.polar.follows_reynolds == local
    assert ("torque: at every node" in rows(report, "Optimization")) == local
    speed, torque = findings.at_best(findings.rated_speed)
    assert torque == pytest.approx(700.0, rel=1e-9)
    assert f"{torque * speed / 1e3:.4g} kW, at" in rows(report, "Starting blade")


def test_time_constant_at_the_best_tip_speed_ratio() -> None:
    """There Cp' = 0, so dQ/dw = -Q/w: J w/Q for a torque held, and J w/(3 Q) for u = K w²."""
    findings = check().findings
    speed, torque = findings.at_best(findings.mean)
    held = findings.plant.inertia * speed / torque
    point = np.array([speed]), np.array([findings.mean])
    for slope, constant in ((0.0, held), (2.0 * torque / speed, held / 3.0)):
        loop = Loop.of(findings.plant, HeldSpeeds(slope), *point)
        assert loop.time_constant == pytest.approx(constant, rel=5e-3)


@pytest.mark.parametrize("law", ["quadratic", "linear"])
def test_time_constant_by_simulation(law: str) -> None:
    """A rotor pushed off its equilibrium by a thousandth comes back as exp(-t/time constant)."""
    result = check(f"control.law={law}", "control.torque_limit=900").findings
    constant = result.time_constant

    def control(_: float, speed: float) -> float:
        return result.physics.law.torque(speed, result.start.gains)

    def moved(push: float):
        flow, span = ConstantInflow(speed=result.mean), 2.0 * constant
        begin = result.steady_speed * push
        return simulate(result.plant, flow, control, begin, np.linspace(0.0, span, 41), None, 1e-12)

    pushed, left = moved(1.001), moved(1.0)
    assert left.rotor_speed[-1] == pytest.approx(result.steady_speed, rel=1e-6)
    off = pushed.rotor_speed - left.rotor_speed
    rate = -np.polyfit(pushed.time, np.log(off), 1)[0]
    assert 1.0 / rate == pytest.approx(constant, rel=5e-3)


def test_open_loop_captures_all_that_the_blade_can() -> None:
    """Without a limit the speed may follow the flow: the largest power coefficient throughout."""
    assert check("control={law: open_loop}").findings.captured == pytest.approx(1.0, abs=2e-4)
    assert check("control.torque_limit=700").findings.captured < 1.0


def test_spectrum_has_the_variance() -> None:
    time = np.arange(20_000) * 0.05
    speed = 2.0 + 0.3 * np.sin(2.0 * np.pi * 0.25 * time) + 0.1 * np.cos(2.0 * np.pi * 2.0 * time)
    frequency, density = power_spectrum(speed, 0.05)
    power = np.fft.rfftfreq(time.size, 0.05)[1]
    # the bands are twelfths of an octave: wide ones hold many frequencies
    edges = frequency[0] * 2.0 ** (np.arange(-0.5, 400) / 12.0)
    assert frequency[np.argmax(density)] == pytest.approx(0.25, rel=0.06)
    assert np.all(np.diff(frequency) > 0.0)
    for center, amplitude in ((0.25, 0.3), (2.0, 0.1)):
        near = np.abs(np.log2(frequency / center)) < 0.2
        count = [np.ptp(edges[np.searchsorted(edges, each) - 1 :][:2]) for each in frequency[near]]
        width = np.maximum(power, count)
        assert np.sum(density[near] * width) == pytest.approx(0.5 * amplitude**2, rel=0.25)


# Size ---------------------------------------------------------------------------------------------


def test_polars_of_another_reynolds_number_are_a_note() -> None:
    for radius, expected in ((5.0, True), (0.6, False)):
        notes = " ".join(map(str, check(f"rotor.radius={radius}").notes))
        assert ("polars are those of Re 2e5" in notes) == expected


def test_a_wall_that_fills_the_section_is_a_note() -> None:
    report = check("rotor.wall=0.08")
    assert "solid blades" in rows(report, "Turbine")
    assert "leaves no hollow at r/R = 0.2 to 0.999" in " ".join(map(str, report.notes))


def test_unknowns_and_constraints_are_those_of_the_transcription() -> None:
    """Order 3: a speed at every end of a segment and its rate within; one defect a segment."""
    report = check("control.torque_limit=700", "phase={segments: 7, duration: 7}")
    ends, nodes = 7 + 1, 3 * 7
    problem = evaluated_problem(report.findings)  # a driver does not hold its problem
    unknowns = problem.driver.get_design_var_values()
    constraints = problem.driver.get_constraint_values()
    assert sorted(map(np.size, unknowns.values())) == sorted((9, 9, 1, ends))
    assert sorted(map(np.size, constraints.values())) == sorted((7, 1, nodes))
    assert f"{nodes} nodes" in texts(report.tables["Optimization"])["segments"]


# Words --------------------------------------------------------------------------------------------


TURBULENCE = "inflow={profile: turbulence, cutoff: 0.5}"


def table(name: str) -> list:
    return yaml.safe_load((DATA / f"{name}.yaml").read_text())


@pytest.mark.parametrize(("overrides", "text"), table("warnings"))
def test_warnings(overrides: list[str], text: str) -> None:
    report = check_case(read_case(BASE, overrides))
    assert any(text in line for line in warnings(report)), warnings(report)


@pytest.mark.parametrize(
    ("first", "last", "covers"), [(0, 1000, True), (0, 900, False), (1e5, 1e6, False)]
)
def test_a_table_that_leaves_out_the_torque_is_a_warning(first, last, covers) -> None:
    lines = [f"{torque},{speed},0.9" for torque in (first, last) for speed in (0, 200)]
    Path("t.csv").write_text("\n".join(["torque_Nm,speed_rpm,efficiency", *lines]))
    messages = warnings(check_case(read_case(BASE, ["generator.table=t.csv"])))
    assert any("0.5902 to 1.009 kN m" in each for each in messages) != covers


@pytest.mark.parametrize(("override", "text"), table("implausible"))
def test_implausible_values_are_told(override: str, text: str) -> None:
    base = "{control: {law: quadratic}}" if "resource" in override else BASE
    (warning,) = physics(read_case(base, [override])).warnings
    assert text in warning


@pytest.mark.parametrize(
    "key", ["limits.power", "limits.thrust", "limits.stress", "control.torque_limit"]
)
def test_a_limit_next_to_zero_is_refused(key: str) -> None:
    """Of the paper's rotor in the mean flow, 1.5 m/s: 0.4 of 10.4 kW, 0.8 of 6.93 kN, and so on."""
    usual = 0.5 * 1000.0 * np.pi * 1.4**2 * 1.5**2
    shares = {"power": 0.4 * 1.5, "thrust": 0.8, "stress": 1e4 / (np.pi * 1.4**2)}
    usual *= shares.get(key.split(".")[1], 0.05 * 1.4)
    flow = "inflow={profile: constant, speed: 1.5}"
    physics(read_case(BASE, [flow, f"{key}={0.0101 * usual}"]))
    with pytest.raises(InputError, match=rf"{key} = .* less than a hundredth .* check its unit"):
        physics(read_case(BASE, [flow, f"{key}={0.0099 * usual}"]))


@pytest.mark.parametrize("law", ["quadratic", "open_loop"])
def test_a_torque_limit_out_of_reach_is_none(law: str) -> None:
    report = check(f"control={{law: {law}, torque_limit: 1e6}}")
    notes = " ".join(map(str, report.notes))
    assert "torque_limit = 1e+06 N m is out of reach of any blade" in notes
    model = report.findings.physics
    assert model.law.torque_limit is None
    assert np.isinf(model.all_limits[0].upper)
    assert model.case.control.torque_limit == 1e6


def test_a_mesh_that_does_not_resolve_the_flow_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    case = read_case(BASE, ["phase.segments=20", TURBULENCE])
    words = "flow_error = 0.0", "flow's speed missed between", "a shorter phase.duration"
    text = " ".join(warnings(check_case(case)))
    assert not any(each in text for each in words)
    monkeypatch.setattr("hkt_mdo.problem.scenario.MOST_SEGMENTS", 20)
    text = " ".join(warnings(check_case(case)))
    assert all(each in text for each in words)


def test_a_gust_of_seconds_in_a_season_is_reported() -> None:
    gust = "{profile: gust, mean: 1.4, amplitude: 1.0, time: 1000001, width: 10}"
    report = check(f"inflow={gust}", "phase.duration=7776000", "limits.thrust=5 kN")
    (flow,) = report.findings.flows
    np.testing.assert_allclose(flow.range, (1.4, 2.4), rtol=0.01)
    assert any("limits.thrust" in text and "broken" in text for text in warnings(report))


def test_a_year_in_both_directions_is_told() -> None:
    polar = CASES.parent / "hkt_mdo/files/data/naca63815_polar_Re1e6.csv"
    flow = {"profile": "histogram", "speeds": [1, 1.5, -2, -2.5], "hours": [1, 1, 1, 1]}
    flow |= {"reversal": "backwards", "reversed_polar": str(polar), "turbulence_intensity": 0.1}
    report = check_case(load_case({"resource": flow, "control": "quadratic"}))
    (flow,) = report.findings.flows
    assert flow.mean == pytest.approx(1.75)
    assert report.findings.fastest == flow.range[1] == pytest.approx(2.75 * (1.0 + 0.1 * 2.856970))
    assert "the edge of the last bin, 2.75 m/s + 2.86 x 10 %" in rows(report, "Flow")


def test_limits_and_loads_of_the_starting_blade() -> None:
    """Held to the quantities of the start: what is broken, what is kept, what is not limited."""
    limits = "limits={power: 5 kW, thrust: 20 kN, stress: 100 MPa, rotor_speed: 9 rad/s}"
    report = check(limits, "control.torque_limit=2000", "site.hub_depth=3")
    model, start = report.findings.physics, report.findings.at_start["phase"]
    entries = texts(report.tables["Limits, and values of the starting blade"])
    q = 0.5 * model.density * start["inflow_speed"] ** 2
    blade, ratio = report.findings.start.blade, start["tip_speed_ratio"]
    loads = {n: q * x.largest for n, x in model.rotor.loads(blade, ratio).items()}
    over, left = loads["stress"].max() / 1e6 - 100.0, 20.0 - loads["thrust"].max() / 1e3
    slow = start["inflow_speed"][loads["stress"] > 1.001 * 100e6].min()
    assert f"limit 100 MPa, exceeded by {over:.2f} %" in entries["largest stress"]
    assert any(f"in flows from {slow:.4g} m/s: the run has to" in x for x in warnings(report))
    assert f"limit 20 kN, margin {5.0 * left:.2f} %" in entries["largest thrust"]
    left = 2.0 - start["control_torque"].max() / 1e3  # not the distance from zero
    assert f"margin {50.0 * left:.2f} %" in entries["largest generator torque"]
    moment = loads["root_moment"]
    when = f"at t = {start['time'][np.argmax(moment)]:.2f} s"
    assert entries["largest root moment"] == f"{moment.max() / 1e3:.5g} kN m, {when}"
    assert entries["largest cavitation"].startswith(f"{loads['cavitation'].max():.5g}, at")
    broken = [line.partition(": broken")[0] for line in warnings(report) if "broken at" in line]
    assert broken == ["limits.power", "limits.stress"]


def test_loads_of_a_scenario_are_those_in_its_water() -> None:
    starts = check("scenarios=[{name: own}, {name: salt, density: 2000}]").findings.at_start
    assert starts["salt"]["thrust"] == pytest.approx(2.0 * starts["own"]["thrust"])


def test_a_start_that_stalls_tells_its_branch_and_what_the_other_one_breaks() -> None:
    text = rows(check("control.law=open_loop", "limits={thrust: 3 kN}"), "Starting blade")
    assert "branch underspeed; overspeed breaks thrust by up to 13" in text


def test_bounds_that_leave_out_the_radius_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "turbine.yaml").write_text(WINDIO)
    (tmp_path / "a.yaml").write_text(
        "rotor: {blade: turbine.yaml, station_count: 6}\ninflow: {profile: sine}\n"
        "control: {law: open_loop}\ndesign: {radius_bounds: [2, 3]}\n"
    )
    report = check_case(load_case(tmp_path / "a.yaml"))
    text = "design.radius_bounds: broken at the start, at least 2 and at most 3 m; 1.4 m with the"
    assert text in " ".join(warnings(report))
    assert "thick, thin" in rows(report, "Turbine")
    assert "polars for 1e6" in rows(report, "Turbine")


def test_notes_of_files(tmp_path: Path) -> None:
    time = np.arange(0.0, 60.0, 0.5)
    speed = 150.0 + 20.0 * np.sin(0.25 * time)
    lines = [f"{t:g},{v:.3f}" for t, v in zip(time, speed, strict=True)]
    lines[40] = "20,"
    (tmp_path / "river.csv").write_text("\n".join(["time_s,speed [cm/s]", *lines]))
    flow = {"profile": "record", "file": "river.csv", "gaps": "interpolate"}
    report = check_case(load_case({"inflow": flow, "control": "linear"}))
    assert any("1 gap interpolated" in str(note) for note in report.notes)
    assert "river.csv" in rows(report, "Flow")
    assert "the length of the flow's data" in rows(report, "Flow")
    assert report.findings.mean == pytest.approx(np.mean(speed) / 100.0, rel=0.01)


# The command --------------------------------------------------------------------------------------


def files(path: Path) -> list[str]:
    return [str(each.relative_to(path)) for each in sorted(path.rglob("*")) if each.is_file()]


def test_command(tmp_path, capsys) -> None:
    case = str(CASES / "sine_limited_quadratic.yaml")
    assert main(["check", case, "--set", "design.chord_bounds=[0.01,0.1]"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for title in ("Turbine", "Flow", "Control", "Starting blade", "Optimization", "Warnings"):
        assert f"\n{title}\n" in out
    assert "the largest deflection of a tip is" in out
    assert out.endswith("sine_limited_quadratic can be run, with 2 warnings.\n")
    assert files(tmp_path) == []


def test_command_draws_only_where_a_folder_is_given(tmp_path, capsys) -> None:
    (tmp_path / "a.yaml").write_text(
        f"rotor: {{blade: river}}\n{TURBULENCE.replace('=', ': ')}\n"
        "control: {law: open_loop, torque_limit: 700}\ndesign: {chord_points: 6, twist_points: 5}\n"
    )
    assert main(["check", "a.yaml", "--out", "b", "--no-figures"]) == 0  # an option of 0.1
    assert files(tmp_path) == ["a.yaml"]
    assert main(["check", "a.yaml", "--out", "b"]) == 0
    names = ("blade", "coefficients", "inflow", "polar")
    assert files(tmp_path) == ["a.yaml", *(f"b/{name}.png" for name in names)]
    assert (tmp_path / "b" / "polar.png").stat().st_size > 10_000
    assert main(["check", "a.yaml", "--out", "a.yaml"]) == 2
    assert "a.yaml" in capsys.readouterr().err


def test_a_missing_optimizer_is_reported(capsys, monkeypatch) -> None:
    monkeypatch.setattr("hkt_mdo.solve.drivers._is_usable", lambda *_: False)
    case = str(CASES / "sine_oloc.yaml")
    assert main(["check", case]) == 2
    assert f"{case}: driver.optimizer = 'IPOPT': IPOPT is not" in capsys.readouterr().err
