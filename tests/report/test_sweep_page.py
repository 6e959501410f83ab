"""The report of a sweep: in a real browser a click on a point opens the report of its run."""

import csv
from itertools import product

import numpy as np
import pytest
from matplotlib.figure import Figure

from hkt_mdo.case.sweep import SWEEP, load_sweep
from hkt_mdo.cli import main
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.sweep import SweepTable, row_of, write_table
from hkt_mdo.results.sweep_plots import plot_parallel, sweep_charts
from tests.conftest import make_result
from tests.report.test_browser import browser, start  # noqa: F401 - fixtures


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a sweep over two keys: three invented results, and a run that failed."""
    path = tmp_path / SWEEP
    over = "{control.torque_limit: [600, 700], inflow.mean: [1.4, 1.5]}"
    path.write_text(f"case: sine_limited_quadratic\nover: {over}\nfront: mass_kg\n")
    rows = []
    for number, mass in enumerate((3.0, 2.0, 4.0)):
        row = row_of(Solution.load(make_result(tmp_path / "runs" / str(number))))
        rows.append(row | {"objective": 300.0 + number, "mass_kg": mass})
    rows.append({"state": "error", "message": "<b>its worker died</b>"})
    for number, (torque, mean) in enumerate(product((600, 700), (1.4, 1.5))):
        axes = {"control.torque_limit": torque, "inflow.mean": mean, "run": f"runs/{number}"}
        rows[number] = axes | rows[number]
    write_table(tmp_path, load_sweep(path), rows)
    return tmp_path


def test_the_table_has_a_grid_too(folder):
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(folder / "grid.nc") as grid:
        value = grid["objective"].sel({"control.torque_limit": 600.0, "inflow.mean": 1.5})
        assert float(value) == 301.0
        assert grid["objective"].isnull().sum() == 1
        assert str(grid["message"][1, 1].item()) == "<b>its worker died</b>"
    frame = pytest.importorskip("pandas").read_parquet(folder / "table.parquet")
    with (folder / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert frame["mass_kg"].tolist()[:3] == [float(row["mass_kg"]) for row in rows[:3]]
    assert frame["state"].tolist() == [row["state"] for row in rows]


def test_an_outcome_that_no_run_has_is_left_out(folder):
    table = SweepTable.load(folder)
    table.columns["mass_kg"][:] = np.nan
    ax = plot_parallel(table, Figure().add_subplot())
    assert not any("mass" in x.get_text() for x in ax.get_xticklabels())


def test_null_beside_numbers_leaves_the_map(folder):
    table, over = folder / "table.csv", folder / SWEEP
    table.write_text(table.read_text().replace("700,", "null,"))
    over.write_text(over.read_text().replace("700", "null"))
    label = sweep_charts(SweepTable.load(folder))["map"].across
    assert label == "control.torque_limit (N m), null left out"


@pytest.mark.parametrize("unit", ["", " N*m*s**2/rad**2"])
def test_gains_are_numbers_in_the_unit_of_the_cases_law(tmp_path, unit):
    (tmp_path / SWEEP).write_text(f"case: first_turbine\nover: {{control.gain: [0.2{unit}]}}\n")
    sweep = load_sweep(tmp_path / SWEEP)
    columns = {key: np.array([x]) for key, x in sweep.row_at(next(sweep.points())).items()}
    shown = SweepTable(tmp_path, sweep, columns).shown("control.gain")
    assert shown == ([0.2], "control.gain (N m s^2/rad^2)")


@pytest.mark.slow
def test_a_click_opens_the_report_of_a_run(folder, browser, capsys):  # noqa: F811
    assert main(["report", str(folder)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(folder / "report.html")
    for number in range(3):
        assert (folder / "runs" / str(number) / "report.html").stat().st_size < 1e6
    tab = browser.new_page()
    errors = []
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.on("console", lambda x: errors.append(x.text) if x.type == "error" else None)
    tab.goto((folder / "report.html").as_uri())
    tab.wait_for_selector("body[data-ready]")
    assert "<b>its worker died</b>" in tab.locator("table").inner_text()
    front = tab.evaluate("document.getElementById('front').data[1]")
    assert (front["x"], front["y"]) == ([2.0, 4.0], [301.0, 302.0])  # the first is dominated
    for chart, trace, point in (("front", 1, 0), ("map", 0, 2)):
        run = tab.evaluate(f"document.getElementById('{chart}').data[{trace}].customdata[{point}]")
        with tab.expect_navigation():
            tab.evaluate(f"document.getElementById('{chart}').emit('plotly_click', "
                         f"{{points: [{{customdata: '{run}'}}]}})")  # fmt: skip
        assert tab.url == (folder / run).as_uri()
        tab.wait_for_selector("body[data-ready]", timeout=60_000)
        tab.go_back()
        tab.wait_for_selector("body[data-ready]")
    assert errors == []
    tab.close()
