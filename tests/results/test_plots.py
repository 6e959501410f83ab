"""Plots: axes in, axes out, nothing global touched, and the numbers of the result."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.laws import OpenLoop
from hkt_mdo.errors import InputError
from hkt_mdo.results import charts, steady, style
from hkt_mdo.results.charts import figure_of, figures
from hkt_mdo.results.sections import sections
from hkt_mdo.results.solution import Solution


def drawn_by(make, *what, of=charts.by_scenario):
    """Return what draws a panel of results on axes of its own."""
    return lambda runs: style.draw(make(of(charts.labelled(runs)), *what), Figure().subplots())


def of_whole(make, *what):
    return drawn_by(make, *what, of=list)


PLOTS = {
    "chord": of_whole(charts.over_radius, "chord_m"),
    "twist": of_whole(charts.over_radius, "twist_deg"),
    "planform": of_whole(charts.planform),
    "sections": of_whole(charts.sections),
    "power_coefficient": of_whole(charts.coefficient, "power"),
    "thrust_coefficient": of_whole(charts.coefficient, "thrust"),
    "convergence": of_whole(lambda results: charts.convergence(results)[0]),
    "limits": drawn_by(lambda results: charts.limits(results)[0]),
    **{
        f"{name} over time": drawn_by(partial(charts.over_time, nodes=True), name)
        for name in (*charts.TIME, "hydrodynamic_torque", "stress")
    },
    **{f"{name} over flow": drawn_by(charts.over_flow, name) for name in charts.FLOW},
    **{f"{name} over span": drawn_by(charts.over_span, name) for name in charts.OVER_SPAN},
}
FIGURES = ("blade", "coefficients", "operation", "power_curve", "limits", "loads", "convergence")


@pytest.fixture
def solution(result_folder: Path) -> Solution:
    return Solution.load(result_folder)


@pytest.fixture
def both(solution: Solution, linear_result_folder: Path) -> list[Solution]:
    return [solution, Solution.load(linear_result_folder)]


@pytest.mark.parametrize("plot", PLOTS.values(), ids=PLOTS)
def test_plot_draws_one_several_and_nothing(plot, both, result_folder) -> None:
    """With units and names, and without global changes."""
    before = dict(mpl.rcParams)
    ax = plot(both[0])
    assert ax.lines
    # a unit; sections and bars with names stand one beside the other
    assert ax.get_xlabel().endswith(")") or plot in (PLOTS["sections"], PLOTS["limits"])
    assert ax.get_ylabel().endswith(")")
    if plot is not PLOTS["limits"]:  # of which the other result has none
        ax = plot(both)
        ax.figure.canvas.draw()
        names = " ".join(ax.get_legend_handles_labels()[1])
        assert all(name in names for name in ("sine_quadratic", "sine_linear"))
    for path in result_folder.glob("*.csv"):
        path.unlink()
    (result_folder / "summary.json").write_text('{"success": false}')
    words = "limit", "smallest", "largest", "axis"
    for line in plot(Solution.load(result_folder)).lines:
        assert any(word in (line.get_gid() or line.get_label()) for word in words)
    assert dict(mpl.rcParams) == before


def test_plots_show_the_numbers(solution: Solution) -> None:
    nodes = line_of(PLOTS["rotor_speed over time"](solution), "collocation nodes")
    rpm = 30.0 / np.pi * solution.trajectory["rotor_speed_rad_s"]
    np.testing.assert_allclose(nodes.get_ydata(), rpm, rtol=1e-14)
    shown = PLOTS["control_torque over time"](solution)
    assert list(line_of(shown, "generator torque limit 700 N m").get_ydata()) == [700.0, 700.0]
    reach = solution.summary.tip_speed_ratio
    for plot in (PLOTS["power_coefficient"], PLOTS["thrust_coefficient"]):
        (span,) = plot(solution).patches
        assert [span.get_x(), span.get_x() + span.get_width()] == pytest.approx(reach.ends)


def line_of(ax: Axes, label: str):
    """Return the line of this name, which a legend has or which stands above it."""
    return next(line for line in ax.lines if label in (line.get_label(), line.get_gid()))


def limited(folder: Path, limits: str) -> Solution:
    """Return a solution whose case has other limits than that of the torque, too."""
    path = folder / "case.yaml"
    case = load_case(path, [f"limits={{{limits}}}"])
    path.write_text(case.to_yaml(), encoding="utf-8")
    return Solution.load(folder)


def test_limits_are_bars_of_the_largest_value_over_the_bound(result_folder: Path) -> None:
    solution = limited(
        result_folder,
        "power: 5 kW, tip_speed: 12 m/s, thrust: 6.5 kN, stress: 100 MPa, cavitation: {depth: 3}",
    )
    table, ax = solution.simulation, PLOTS["limits"](solution)
    expected = {
        "generator torque": table["control_torque_Nm"] / 700.0,
        "power": table["control_torque_Nm"] * table["rotor_speed_rad_s"] / 5000.0,
        "tip speed": table["rotor_speed_rad_s"] * 1.4 / 12.0,
        "thrust": table["thrust_N"] / 6500.0,
        "stress": table["stress_Pa"] / 1e8,
        "cavitation": table["cavitation"],
    }
    names = [" ".join(label.get_text().split()) for label in ax.get_xticklabels()]
    for bar, text, (name, values) in zip(ax.patches, names, expected.items(), strict=True):
        most = 100.0 * np.max(values)
        assert bar.get_height() == pytest.approx(most, rel=1e-9)
        assert names[round(bar.get_x() + 0.5 * bar.get_width())] == text == f"{name} {most:.1f} %"
    assert list(line_of(ax, "limit").get_ydata()) == [100.0, 100.0]


def test_classes_of_the_flow_speed_have_mean_and_range() -> None:
    speed, values = np.tile(np.linspace(1.0, 2.0, 30), 100), np.repeat(np.arange(100.0), 30)
    classes, mean, low, high = steady.binned(speed, values)
    np.testing.assert_allclose(classes, np.linspace(1.0, 2.0, 30), rtol=1e-12)
    np.testing.assert_allclose(mean, 49.5, rtol=1e-12)
    np.testing.assert_allclose([low[0], high[0]], [4.95, 94.05], rtol=1e-12)
    assert steady.binned(speed[:30], values[:30]).size == 0  # too few instants
    points = steady.binned(np.array([2.0, 1.0]), np.array([8.0, 1.0]), steady=True)
    np.testing.assert_array_equal(points, [[1.0, 2.0], *[[1.0, 8.0]] * 3])


def test_the_steady_curve_balances_the_torques(solution: Solution) -> None:
    """Below the limit K w² = rho/2 A R v² Cp/lambda: the tip speed ratio does not change."""
    curve, law = steady.steady_curve(solution), solution.case.control
    speed, flow = curve["rotor_speed_rad_s"], curve["inflow_speed_m_s"]
    ratio, radius = 1.4 * speed / flow, 1.4
    table = solution.coefficients
    power = np.interp(ratio, table["tip_speed_ratio"], table["power_coefficient"])
    pressure = 0.5 * 1000.0 * np.pi * radius**2 * flow**2
    torque = law.torque(speed, np.array([solution.gain]))
    np.testing.assert_allclose(torque, pressure * radius * power / ratio, rtol=2e-3)
    np.testing.assert_allclose(curve["control_torque_Nm"] * speed, curve["generator_power_W"])
    thrust = np.interp(ratio, table["tip_speed_ratio"], table["thrust_coefficient"])
    np.testing.assert_allclose(curve["thrust_N"], pressure * thrust, rtol=2e-3)
    assert flow[0] < 0.3  # from near zero to the largest speed that was met
    assert flow[-1] == np.max(solution.simulation["inflow_speed_m_s"])
    stopped = solution.case.model_copy(update={"control": law.model_copy(update={"cut_out": 2.5})})
    assert steady.steady_curve(replace(solution, case=stopped))["inflow_speed_m_s"][-1] == 2.5
    shown = PLOTS["generator_power over flow"](replace(solution, case=stopped))
    assert "cut-out 2.5 m/s" in shown.get_legend_handles_labels()[1]
    open_loop = solution.case.model_copy(update={"control": OpenLoop(law="open_loop")})
    assert steady.steady_curve(replace(solution, case=open_loop)) == {}


def test_the_steady_curve_has_friction_and_the_motors_constant(solution: Solution) -> None:
    keys = "condition.torque_constant=1.1", "generator.shaft_friction="
    new, worn = (solution.case.with_overrides(keys[0], f"{keys[1]}{x}") for x in (0, 20))
    assert replace(solution, case=new).limits[0].end == pytest.approx(770.0)  # of 700 N m demanded
    none = solution.summary.model_copy(update={"limits": {}})  # out of reach in the run
    assert replace(solution, summary=none).limits == ()
    new, worn = (steady.steady_curve(replace(solution, case=each)) for each in (new, worn))
    law = solution.case.control.torque(worn["rotor_speed_rad_s"], np.array([solution.gain]))
    np.testing.assert_allclose(worn["control_torque_Nm"], 1.1 * law, rtol=3e-3)
    assert worn["rotor_speed_rad_s"][-1] < 0.99 * new["rotor_speed_rad_s"][-1]


def test_the_rated_point_is_where_steady_power_meets_its_limit(result_folder: Path) -> None:
    free = steady.steady_curve(Solution.load(result_folder))
    bound = float(np.interp(1.45, free["inflow_speed_m_s"], free["generator_power_W"]))
    solution = limited(result_folder, f"power: {bound:.3f}")
    flow, power = steady.rated_point(solution)
    assert 1.4 < flow < 1.46
    assert power == pytest.approx(bound, rel=0.02)
    _, labels = PLOTS["generator_power over flow"](solution).get_legend_handles_labels()
    assert f"rated at {flow:.2f} m/s" in labels


def test_sections_need_an_outline(solution: Solution) -> None:
    changed = {"polar": "naca4415", "reynolds_number": 2e5, "outline": None}
    rotor = solution.case.rotor.model_copy(update=changed)
    alone = replace(solution, case=solution.case.model_copy(update={"rotor": rotor}))
    with pytest.raises(InputError, match=r"rotor\.outline"):
        sections(alone, [0.5])
    assert len(figure_of(alone, "blade").axes) == 3


@pytest.mark.parametrize(
    ("missing", "names"),
    [
        (["simulation"], FIGURES),
        (["coefficients", "simulation", "trajectory"], ("blade", "loads", "convergence")),
        (["loads"], tuple(name for name in FIGURES if name != "loads")),
    ],
)
def test_figures_are_of_what_there_is(both, tmp_path, missing, names) -> None:
    for name in missing:
        for solution in both:
            (solution.folder / f"{name}.csv").unlink()
    one, other = (Solution.load(solution.folder) for solution in both)
    written = style.save(figures(one), tmp_path / "one")
    assert [path.name for path in written] == [f"{name}.png" for name in names]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in written)
    of_both = figures([one, other])
    assert tuple(of_both) == names
    (legend,) = filter(None, (ax.get_legend() for ax in of_both["blade"].axes))
    assert "sine_linear" in [text.get_text() for text in legend.get_texts()]
    assert figure_of(other, "limits") is None  # it has none


def test_unknown_formats_and_figures_are_refused(solution, tmp_path) -> None:
    with pytest.raises(InputError, match=r"unknown format of figures; known: .*pdf"):
        style.save(figures(solution), tmp_path / "figures", ("png", "docx"))
    assert not (tmp_path / "figures").exists()
    assert list(solution.plot("convergence")) == ["convergence"]
    with pytest.raises(InputError, match="unknown figure; known: blade"):
        solution.plot("blades")
