"""The polar: a smooth periodic function through its table, and files that are refused."""

import numpy as np
import pytest

from hkt_mdo.data import read_table, shipped_names
from hkt_mdo.errors import InputError
from hkt_mdo.rotor.airfoil import KNOTS_PER_DEGREE, Outline, Polar

POLARS = shipped_names("polar")


@pytest.fixture(scope="module", params=POLARS, name="polar")
def any_shipped_polar(request):
    return Polar.from_csv(request.param)


def write(folder, rows, header="alpha_deg,cl,cd"):
    path = folder / "polar.csv"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def good_rows():
    return [
        f"{alpha},{0.1 * alpha + 0.3:.3f},{0.01 + 1e-4 * alpha**2:.5f}" for alpha in range(-8, 17)
    ]


# Theory


def test_polar_and_two_derivatives_are_continuous_everywhere(polar):
    """A spline's neighbouring pieces share value, slope and curvature, round the full circle."""
    step = 2.0 * np.pi / polar.coefficients.shape[0]
    for block in (polar.coefficients[:, :4], polar.coefficients[:, 4:]):
        c0, c1, c2, c3 = block.T
        following = np.roll(block, -1, axis=0)
        assert np.allclose(c0 + step * (c1 + step * (c2 + step * c3)), following[:, 0], atol=1e-12)
        assert np.allclose(c1 + step * (2.0 * c2 + step * 3.0 * c3), following[:, 1], atol=1e-10)
        assert np.allclose(2.0 * c2 + 6.0 * step * c3, 2.0 * following[:, 2], atol=1e-7)


def test_polar_is_periodic(polar):
    alpha = np.linspace(-np.pi, np.pi, 101)
    for turns in (-2.0, -1.0, 1.0):
        assert np.allclose(
            polar.evaluate(alpha + 2.0 * np.pi * turns), polar.evaluate(alpha), atol=1e-11
        )
    assert np.allclose(polar.evaluate(np.pi), polar.evaluate(-np.pi), atol=1e-12)


def test_derivatives_are_those_of_the_values(polar):
    alpha = np.linspace(-3.1, 3.1, 501)
    lift, drag = polar.evaluate(alpha + 1e-30j)
    lift_slope, by_reynolds, drag_slope, also_by_reynolds = polar.derivatives(alpha)
    assert np.allclose(lift_slope, lift.imag / 1e-30, rtol=1e-12, atol=1e-12)
    assert np.allclose(drag_slope, drag.imag / 1e-30, rtol=1e-12, atol=1e-12)
    assert by_reynolds == also_by_reynolds == 0.0


def test_drag_is_positive_and_flow_at_right_angles_is_that_over_a_plate(polar):
    alpha = np.linspace(-np.pi, np.pi, 5000)
    assert np.min(polar.evaluate(alpha)[1]) > 0.0
    lift, drag = polar.evaluate(0.5 * np.pi)
    assert abs(lift) < 1e-6
    assert drag == pytest.approx(1.11 + 0.018 * 10.0, abs=1e-6)  # Viterna and Janetzke 1982, eq. 4


def test_viterna_extension_meets_the_table(polar):
    """The extension takes the last row's lift and drag: no step."""
    for edge in (polar.alpha_min, polar.alpha_max):
        around = edge + np.deg2rad(np.linspace(-1.0, 1.0, 201))
        assert np.max(np.abs(np.diff(polar.evaluate(around), axis=1))) < 0.01


# The table


@pytest.mark.parametrize("name", POLARS)
def test_table_points_are_interpolated_exactly(name):
    table, polar = read_table(name, ("alpha_deg", "cl", "cd"), "polar"), Polar.from_csv(name)
    assert np.all(
        table["alpha_deg"] * KNOTS_PER_DEGREE % 1.0 == 0.0
    )  # else only to the spline's error
    lift, drag = polar.evaluate(np.deg2rad(table["alpha_deg"]))
    assert np.allclose(lift, table["cl"], atol=1e-12)
    assert np.allclose(drag, table["cd"], atol=1e-12)


def test_spline_reproduces_a_straight_line_inside_the_table():
    alpha = np.deg2rad(np.arange(-16.0, 20.5, 0.5))
    polar = Polar.from_table(alpha, 0.2 + 5.0 * alpha, np.full(alpha.size, 0.02))
    inside = np.deg2rad(np.linspace(-8.0, 10.0, 333))
    lift, drag = polar.evaluate(inside)
    assert np.allclose(lift, 0.2 + 5.0 * inside, atol=1e-8)
    assert np.allclose(drag, 0.02, atol=1e-8)


# Broken files


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda rows: rows[:5], "at least 8"),
        (lambda rows: [*rows[:3], rows[2], *rows[3:]], "increase strictly"),
        (lambda rows: rows[6:], "-5"),
        (lambda rows: rows[:18], "12"),
        (lambda rows: [*rows[:4], "-4,0.1,-0.01", *rows[5:]], "drag must be positive"),
        (lambda rows: [*rows[:4], "-4,0.1,nan", *rows[5:]], "line 6"),
        (lambda rows: [*rows[:4], "-4,0.1", *rows[5:]], "line 6"),
    ],
)
def test_broken_polar_is_refused_with_file_and_place(tmp_path, change, told):
    path = write(tmp_path, change(good_rows()))
    with pytest.raises(InputError) as caught:
        Polar.from_csv(path)
    assert str(path) in str(caught.value)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_good_polar_is_taken_and_a_missing_column_is_not(tmp_path):
    Polar.from_csv(write(tmp_path, good_rows()))
    with pytest.raises(InputError, match="cd"):
        Polar.from_csv(write(tmp_path, good_rows(), header="alpha_deg,cl,drag"))


def test_outline_area():
    """A rhombus has half the area of its box; the shipped section the area its README states."""
    side = np.linspace(0.0, 1.0, 6)[1:]
    x = np.concatenate(([1.0], 1.0 - 0.5 * side, 0.5 - 0.5 * side, 0.5 * side, 0.5 + 0.5 * side))
    y = np.concatenate(([0.0], 0.1 * side, 0.1 - 0.1 * side, -0.1 * side, -0.1 + 0.1 * side))
    assert Outline(x, y).area == pytest.approx(0.1, rel=1e-12)
    assert Outline.from_csv("naca63815").area == pytest.approx(0.094, abs=0.001)


def test_open_outline_is_refused(tmp_path):
    path = tmp_path / "outline.csv"
    path.write_text("x_over_c,y_over_c\n" + "0.5,0.1\n" * 12)
    with pytest.raises(InputError, match=r"outline\.csv"):
        Outline.from_csv(path)
