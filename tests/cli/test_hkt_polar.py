"""`hkt polar`: an outline's polars by NeuralFoil, usable as they are written, or nothing at all."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from study_common import shipped_table

from hkt_mdo.cli import main
from hkt_mdo.cli.polar_report import draw_report, parse_alpha, parse_reynolds
from hkt_mdo.errors import InputError, install
from hkt_mdo.files.polar import read_polars
from hkt_mdo.files.polar_table import SURFACES
from hkt_mdo.files.shipped import POLAR_FAMILIES
from hkt_mdo.rotor.airfoil import PolarFamily
from hkt_mdo.rotor.neuralfoil import ComputedPolar, compute_polars
from hkt_mdo.rotor.outline import Outline

SMALL = "naca63815 --reynolds 2e5 --model xxsmall".split()


@pytest.fixture(autouse=True)
def _own_folder(own_environment, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def neuralfoil():
    return pytest.importorskip("neuralfoil")


def polar(*arguments):
    return main(["polar", *arguments])


# What is computed


def test_shipped_polars_come_out_again(neuralfoil, tmp_path):
    """Within the rounding of six decimals, all six Reynolds numbers."""
    family = POLAR_FAMILIES["naca63815"]
    assert polar("naca63815", "--reynolds", ",".join(f"{r:g}" for r in family.values())) == 0
    ours = tmp_path / "results/polars/naca63815_polars.csv"
    new = np.genfromtxt(ours, delimiter=",", names=True, skip_header=1)
    for name, reynolds in family.items():
        shipped = shipped_table(name, "polar")
        rows = new["reynolds"] == reynolds
        assert new["alpha_deg"][rows].tolist() == shipped["alpha_deg"].tolist()
        apart = dict.fromkeys(("cl", "cd", "cm"), 1.1e-6) | dict.fromkeys(SURFACES, 2e-4)
        for column, most in apart.items():
            assert np.max(np.abs(new[column][rows] - shipped[column])) < most
    assert np.all((new["confidence"] >= 0.0) & (new["confidence"] <= 1.0))


def test_symmetric_section_has_symmetric_polars(neuralfoil):
    """Lift odd, drag even; and none of it depends on the way round the points are listed."""
    x = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 81)))
    half = 0.6 * (0.2969 * np.sqrt(x) + x * (-0.126 + x * (-0.3516 + x * (0.2843 - 0.1036 * x))))
    outline = Outline(np.r_[x[::-1], x[1:]], np.r_[half[::-1], -half[1:]])
    alpha = np.deg2rad(np.arange(-12.0, 12.5))
    (one,) = compute_polars(outline, [1e6], alpha)
    assert np.allclose(one.table.lift, -one.table.lift[::-1], atol=1e-6)
    assert np.allclose(one.table.drag, one.table.drag[::-1], rtol=1e-6)
    (other,) = compute_polars(Outline(outline.x[::-1], outline.y[::-1]), [1e6], alpha)
    assert np.allclose(one.table.lift, other.table.lift, atol=1e-9)
    slope = np.polyfit(one.table.alpha[8:17], one.table.lift[8:17], 1)[0]
    assert slope == pytest.approx(2.0 * np.pi, rel=0.1)  # thin-airfoil theory


# What is written


def test_table_is_a_polar_and_the_figure_is_there(neuralfoil, tmp_path, capsys):
    arguments = "naca63815 --reynolds 1e6,2e5 --out mine --alpha -10:15:1 --beside naca63815"
    assert polar(*arguments.split()) == 0
    output = capsys.readouterr().out
    assert polar(*arguments.split()) == 2
    assert "naca63815_polars.csv: is there already; give --force" in capsys.readouterr().err
    assert polar(*arguments.split(), "--force") == 0
    assert "Re 2e5: confidence" in output
    assert "below 0.8 at -10 degrees" in output
    names = sorted(path.name for path in (tmp_path / "mine").iterdir())
    assert names == ["naca63815_polars.csv", "naca63815_polars.png"]
    assert (tmp_path / "mine/naca63815_polars.png").read_bytes().startswith(b"\x89PNG")
    family = PolarFamily.from_file(tmp_path / "mine/naca63815_polars.csv")
    assert family.reynolds.tolist() == [2e5, 1e6]


def test_failure_half_way_leaves_nothing(neuralfoil, tmp_path, monkeypatch, capsys):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.replace", fail)
    assert polar(*SMALL, "--out", "mine") == 2
    assert "No space left" in capsys.readouterr().err
    assert list((tmp_path / "mine").iterdir()) == []


# What is refused


def test_without_neuralfoil_the_message_says_how_to_get_it(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "neuralfoil", None)
    assert polar("naca63815", "--reynolds", "2e5") == 2
    assert install("neuralfoil") in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("nowhere.dat --reynolds 2e5", "nowhere.dat"),
        ("naca63815 --reynolds 2e5,2e5", "different"),
        ("naca63815 --reynolds 0.2", "reynolds = 0.2"),
        ("naca63815 --reynolds 2e5 --n-crit 90", "n_crit"),
        ("naca63815 --reynolds 2e5 --model huge", "xxsmall"),
        ("naca63815 --reynolds 2e5 --alpha 0:10", "--alpha"),
        ("naca63815 --reynolds 2e5 --alpha -16:24:1e-9", "--alpha"),
        ("naca63815 --reynolds 2e5 --alpha 0:10:0.5", "must reach from -5 or less to 12"),
        ("naca63815 --reynolds 2e5 --beside naca63815_Re9e9", "naca63815_Re9e9"),
        ("naca63815 --reynolds 2e5 --beside mine.csv", "mine.csv"),
    ],
)
def test_bad_arguments_are_one_line(arguments, message, tmp_path, capsys):
    if "0:10:0.5" in arguments:  # found after the polar is computed
        pytest.importorskip("neuralfoil")
    assert polar(*arguments.split()) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


# Arguments


def test_range_of_angles():
    assert parse_alpha("-16:24:0.5").tolist() == np.linspace(-16.0, 24.0, 81).tolist()
    assert parse_alpha("-10:15:0.1")[-1] == 15.0
    assert parse_alpha(" -10 : 15 : 10").tolist() == [-10.0, 0.0, 10.0]


def test_list_of_reynolds_numbers():
    assert parse_reynolds("5e5, 200000") == [2e5, 5e5]
    for text in ("", "2e5,", "2e5;5e5", "inf", "nan"):
        with pytest.raises(InputError, match="--reynolds"):
            parse_reynolds(text)


def test_the_figure_has_lift_over_drag_and_suction():
    (table,) = read_polars("naca63815_Re2e5")
    polar = ComputedPolar(table, np.ones(table.alpha.size))
    lift, drag, ratio, suction = draw_report("a", [polar], []).axes
    np.testing.assert_allclose(ratio.lines[1].get_ydata(), table.lift / table.drag)
    most = -np.min(np.atleast_2d(table.smallest_pressure), axis=0)
    np.testing.assert_allclose(suction.lines[1].get_ydata(), most)
    assert (drag.get_yscale(), lift.get_yscale()) == ("log", "linear")
    bare = ComputedPolar(replace(table, smallest_pressure=None), polar.confidence)
    assert len(draw_report("a", [bare], []).axes) == 3
