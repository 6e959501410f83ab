"""Plots: axes in, axes out, nothing global touched, and something to see even in grey."""

import json
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.results import plots
from hkt_mdo.results.solution import Solution

PLOTS = [plot for name, plot in vars(plots).items() if name.startswith("plot_")]
FIGURES = ("blade", "power_curve", "operation", "convergence")


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


def test_a_constant_looks_like_one(solution: Solution) -> None:
    table = {name: column.copy() for name, column in solution.simulation.items()}
    table["tip_speed_ratio"] = 7.18 + 1e-6 * np.sin(table["time_s"])
    constant = Solution(solution.folder, solution.case, solution.summary, {}, table, {}, {})
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
        (("power_curve", "simulation", "trajectory"), ("blade", "convergence")),
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
