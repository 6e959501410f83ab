"""Plots: axes in, axes out, nothing global touched, and something to see even in grey."""

import json
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hkt_mdo.case import load_case
from hkt_mdo.errors import InputError
from hkt_mdo.results import plots
from hkt_mdo.results.solution import ScenarioTables, Solution

PLOTS = [plot for name, plot in vars(plots).items() if name.startswith("plot_")]
FIGURES = ("blade", "power_curve", "operation", "schedule", "limits", "loads", "convergence")


def legend_texts(ax: Axes) -> list[str]:
    """Return a legend's labels, of the axes or their twin."""
    legends = [axes.get_legend() for axes in ax.figure.axes]
    return [text.get_text() for legend in legends if legend for text in legend.get_texts()]


@pytest.fixture
def solution(result_folder: Path) -> Solution:
    return Solution.load(result_folder)


@pytest.fixture
def both(solution: Solution, linear_result_folder: Path) -> list[Solution]:
    return [solution, Solution.load(linear_result_folder)]


@pytest.mark.parametrize("plot", PLOTS)
def test_plot_draws_in_its_own_figure(plot, solution: Solution) -> None:
    before = dict(mpl.rcParams)
    ax = plot(solution)
    ax.figure.canvas.draw()
    assert ax.lines
    assert ax.get_xlabel().endswith(")")  # a unit
    assert ax.get_ylabel().endswith(")")
    assert legend_texts(ax)
    assert dict(mpl.rcParams) == before


@pytest.mark.parametrize("plot", PLOTS)
def test_plot_draws_several_where_told(plot, both: list[Solution]) -> None:
    if plot is plots.plot_limits:  # of which the other has none
        case = both[0].case.model_copy(update={"name": "sine_linear"})
        both = [both[0], replace(both[0], case=case)]
    ax = Figure().subplots()
    assert plot(both, ax) is ax
    ax.figure.canvas.draw()
    labels = " ".join(legend_texts(ax))
    assert "sine_quadratic" in labels
    assert "sine_linear" in labels
    styles = [
        (line.get_linestyle(), line.get_marker())
        for line in ax.lines
        if line.get_label().startswith("sine_")
    ]
    assert len(set(styles)) == len(styles)  # apart without colours


@pytest.mark.parametrize("plot", PLOTS)
def test_plot_of_nothing_is_empty(plot, result_folder: Path) -> None:
    for path in result_folder.glob("*.csv"):
        path.unlink()
    (result_folder / "summary.json").write_text('{"success": false}')
    ax = plot(Solution.load(result_folder))
    ax.figure.canvas.draw()
    assert all("limit" in line.get_label() for line in ax.lines)


@pytest.mark.filterwarnings("error")
def test_plots_bear_what_an_optimizer_met(result_folder: Path) -> None:
    path = result_folder / "convergence.csv"
    path.write_text("evaluation,energy_J,infeasibility\n0,nan,inf\n1,3e5,0\n2,3.1e5,nan\n")
    plots.plot_convergence(Solution.load(result_folder)).figure.canvas.draw()


def test_plots_show_the_numbers(solution: Solution) -> None:
    nodes = next(
        line
        for line in plots.plot_rotor_speed(solution).lines
        if line.get_label() == "collocation nodes"
    )
    np.testing.assert_array_equal(nodes.get_ydata(), solution.trajectory["rotor_speed_rad_s"])
    limit = plots.plot_control_torque(solution).lines[-1]
    assert list(limit.get_ydata()) == [700.0, 700.0]
    assert limit.get_label() == "control torque limit 700 N m"
    bar = next(
        line for line in plots.plot_power_curve(solution).lines if len(line.get_xdata()) == 2
    )
    reach = solution.summary["tip_speed_ratio"]
    assert list(bar.get_xdata()) == [reach["min"], reach["max"]]


def test_limits_are_drawn_beside_their_quantity_or_told(
    result_folder: Path, linear_result_folder: Path
) -> None:
    path = result_folder / "summary.json"
    summary = json.loads(path.read_text())
    summary["limits"] |= {
        "rotor_speed": {"value": 8.7, "limit": 9.0, "unit": "rad/s"},
        "tip_speed": {"value": 11.5, "limit": 11.5, "unit": "m/s"},
    }
    path.write_text(json.dumps(summary))
    solution = Solution.load(result_folder)
    told = ["largest tip speed 11.5 m/s, limit 11.5 m/s", "control torque limit 700 N m"]
    assert plots.plot_rotor_speed(solution).lines[-1].get_label() == "rotor speed limit 9 rad/s"
    shown = legend_texts(plots.figure_of(solution, "operation").axes[0])
    assert {*told, "rotor speed limit 9 rad/s"} <= set(shown)
    both = [solution, Solution.load(linear_result_folder)]
    shown = legend_texts(plots.figure_of(both, "operation").axes[0])
    assert f"sine_quadratic: {told[0]}" in shown


def line_of(ax: Axes, label: str):
    """Return the line that a legend names so."""
    return next(line for line in ax.lines if line.get_label() == label)


def limited(folder: Path, limits: str) -> Solution:
    """Return a solution whose case has other limits than that of the torque, too."""
    path = folder / "case.yaml"
    case = load_case(path, [f"limits={{{limits}}}"])
    path.write_text(case.to_yaml(), encoding="utf-8")
    return Solution.load(folder)


def test_limits_over_time_are_values_over_bounds(result_folder: Path) -> None:
    solution = limited(
        result_folder,
        "power: 5 kW, tip_speed: 12 m/s, thrust: 6.5 kN, stress: 100 MPa, cavitation: {depth: 3}",
    )
    table, ax = solution.simulation, plots.plot_limits(solution)
    expected = {
        "control torque": table["control_torque_Nm"] / 700.0,
        "power": table["control_torque_Nm"] * table["rotor_speed_rad_s"] / 5000.0,
        "tip speed": table["rotor_speed_rad_s"] * 1.4 / 12.0,
        "thrust": table["thrust_N"] / 6500.0,
        "stress": table["stress_Pa"] / 1e8,
        "cavitation": table["cavitation"],
    }
    assert [line.get_label() for line in ax.lines] == [*expected, "limit"]
    for label, values in expected.items():
        np.testing.assert_allclose(line_of(ax, label).get_ydata(), values, rtol=1e-9)
    assert list(line_of(ax, "limit").get_ydata()) == [1.0, 1.0]


def test_without_limits_no_figure_of_limits(linear_result_folder: Path) -> None:
    solution = Solution.load(linear_result_folder)
    assert solution.limit_shares() == {}
    assert plots.figure_of(solution, "limits") is None


def test_schedule_is_over_the_flow_with_its_limits(result_folder: Path) -> None:
    solution = limited(
        result_folder,
        "power: 5 kW, electrical_power: 4.8 kW, tip_speed: 12 m/s, rotor_speed: 9 rad/s, "
        "thrust: 6.5 kN",
    )
    table = solution.simulation
    rpm, power = 30.0 / np.pi, table["control_torque_Nm"] * table["rotor_speed_rad_s"]
    for plot, values, levels in (
        (
            plots.plot_speed_schedule,
            rpm * table["rotor_speed_rad_s"],
            {"tip speed limit 12 m/s": rpm * 12.0 / 1.4, "rotor speed limit 9 rad/s": rpm * 9.0},
        ),
        (
            plots.plot_torque_schedule,
            table["control_torque_Nm"],
            {"control torque limit 700 N m": 700.0},
        ),
        (
            plots.plot_power_schedule,
            power / 1e3,
            {"electrical power limit 4.8 kW": 4.8, "power limit 5 kW": 5.0},
        ),
        (plots.plot_thrust_schedule, table["thrust_N"] / 1e3, {"thrust limit 6.5 kN": 6.5}),
    ):
        ax = plot(solution)
        line = line_of(ax, "simulation")
        np.testing.assert_array_equal(line.get_xdata(), table["inflow_speed_m_s"])
        np.testing.assert_allclose(line.get_ydata(), values, rtol=1e-8)
        found = {
            each.get_label().partition(" (")[0]: each.get_ydata()[0]
            for each in ax.lines
            if "limit" in each.get_label()
        }
        assert found == pytest.approx(levels, rel=1e-12)
    electrical = line_of(plots.plot_power_schedule(solution), "electrical power")
    np.testing.assert_allclose(electrical.get_ydata(), 0.9 * power / 1e3, rtol=1e-8)


def test_loads_are_along_the_span_with_their_limits(result_folder: Path) -> None:
    solution = limited(result_folder, "stress: 100 MPa, cavitation: {depth: 3}")
    for plot, column, word, scale, limit in (
        (plots.plot_stress, "stress_Pa", "stress", 1e-6, 100.0),
        (plots.plot_flapwise_moment, "flapwise_moment_Nm", "stress", 1e-3, None),
        (plots.plot_suction, "cavitation", "suction", 1.0, 1.0),
    ):
        line, *levels = plot(solution).lines
        assert line.get_label() == f"at the largest {word}, t = 56.55 s"
        np.testing.assert_array_equal(line.get_xdata(), solution.loads["r_over_R"])
        np.testing.assert_array_equal(line.get_ydata(), scale * solution.loads[column])
        assert [each.get_ydata()[0] for each in levels] == ([] if limit is None else [limit])


def test_panels_without_data_are_left_out(result_folder: Path) -> None:
    """A rotor whose depth is not known has no suction, an older result no loads."""
    for name, gone in (("simulation", "thrust_N"), ("trajectory", "thrust_N"), ("loads", "cavit")):
        path = result_folder / f"{name}.csv"
        rows = [line.split(",") for line in path.read_text().splitlines()]
        kept = [index for index, title in enumerate(rows[0]) if not title.startswith(gone)]
        lines = (",".join(row[index] for index in kept) for row in rows)
        path.write_text("\n".join(lines) + "\n")
    solution = Solution.load(result_folder)
    schedule, loads = (plots.figure_of(solution, name) for name in ("schedule", "loads"))
    assert [ax.get_ylabel() for ax in schedule.axes] == [
        "rotor speed (rpm)",
        "generator torque (N m)",
        "generator power (kW)",
    ]
    assert [ax.get_ylabel() for ax in loads.axes] == ["stress (MPa)", "flapwise moment (kN m)"]


def test_a_constant_looks_like_one(solution: Solution) -> None:
    table = {name: column.copy() for name, column in solution.simulation.items()}
    table["tip_speed_ratio"] = 7.18 + 1e-6 * np.sin(table["time_s"])
    constant = replace(solution, tables={"phase": ScenarioTables({}, table, {})})
    low, high = plots.plot_tip_speed_ratio(constant).get_ylim()
    assert high - low >= 0.07


def test_start_is_drawn_once_and_not_for_a_fixed_blade(
    both: list[Solution], result_folder: Path
) -> None:
    assert legend_texts(plots.plot_chord(both)).count("blade at the start") == 1
    path = result_folder / "summary.json"
    summary = json.loads(path.read_text())
    path.write_text(json.dumps(summary | {"start_chord_m": summary["chord_m"]}))
    assert legend_texts(plots.plot_chord(Solution.load(result_folder))) == ["blade"]


@pytest.mark.slow
def test_save_figures_writes_all(solution: Solution, tmp_path: Path) -> None:
    written = plots.save_figures(solution, tmp_path / "new" / "figures", ("png", "pdf"))
    assert [path.name for path in written] == [
        f"{name}.{form}" for name in FIGURES for form in ("png", "pdf")
    ]
    assert all(path.stat().st_size > 5000 for path in written)
    again = plots.save_figures(solution, tmp_path / "again", ("png", "pdf"))
    for one, other in zip(written, again, strict=True):
        assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize(
    ("missing", "figures"),
    [
        ((), FIGURES),
        (("simulation",), FIGURES),
        (("power_curve", "simulation", "trajectory"), ("blade", "loads", "convergence")),
        (("loads",), tuple(name for name in FIGURES if name != "loads")),
    ],
)
def test_save_figures_draws_what_there_is(
    result_folder: Path,
    linear_result_folder: Path,
    tmp_path: Path,
    missing: tuple[str, ...],
    figures: tuple[str, ...],
) -> None:
    for name in missing:
        (result_folder / f"{name}.csv").unlink()
        (linear_result_folder / f"{name}.csv").unlink()
    one = Solution.load(result_folder)
    written = plots.save_figures(one, tmp_path / "one")
    assert [path.name for path in written] == [f"{name}.png" for name in figures]
    two = [one, Solution.load(linear_result_folder)]
    written = plots.save_figures(two, tmp_path / "two", ("svg",))
    assert [path.name for path in written] == [f"{name}.svg" for name in figures]


@pytest.mark.parametrize("count", [1, 2, 6])
def test_nothing_is_cut_off(solution: Solution, count: int) -> None:
    """Every label and legend lies within its figure."""
    name = "a" * 30
    cases = [solution.case.model_copy(update={"name": f"{name}_{i}"}) for i in range(count)]
    several = [replace(solution, case=case) for case in cases]
    for name in FIGURES:
        figure = plots.figure_of(several, name)
        figure.draw_without_rendering()
        box = figure.get_tightbbox()
        assert box.x0 >= 0.0
        assert box.y0 >= 0.0
        assert box.x1 <= figure.get_figwidth()
        assert box.y1 <= figure.get_figheight()


def test_save_figures_refuses_unknown_formats(solution: Solution, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unknown format of figures; known: .*pdf"):
        plots.save_figures(solution, tmp_path / "figures", ("png", "docx"))
    assert not (tmp_path / "figures").exists()
