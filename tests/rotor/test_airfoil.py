"""The section: a smooth periodic polar, the outline's closed forms, files that are refused."""

import numpy as np
import pytest
from study_common import shipped_table

from hkt_mdo.files.shipped import shipped_names
from hkt_mdo.rotor.airfoil import PolarFamily
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.polars import KNOTS_PER_DEGREE

POLARS = shipped_names("polar")


@pytest.fixture(scope="module", params=POLARS, name="polar")
def any_shipped_polar(request):
    return PolarFamily.from_file(request.param).polars[0]


# Theory


def assert_smooth(pieces, atol):
    """Hold two splines to one value, slope and curvature of neighbouring pieces, full circle."""
    step = 2.0 * np.pi / pieces.shape[0]
    for block in (pieces[:, :4], pieces[:, 4:]):
        c0, c1, c2, c3 = block.T
        value, slope, curvature, _ = np.roll(block, -1, axis=0).T
        assert np.allclose(c0 + step * (c1 + step * (c2 + step * c3)), value, atol=atol)
        assert np.allclose(c1 + step * (2.0 * c2 + step * 3.0 * c3), slope, atol=1e2 * atol)
        assert np.allclose(2.0 * c2 + 6.0 * step * c3, 2.0 * curvature, atol=1e5 * atol)


def test_polar_and_two_derivatives_are_continuous_everywhere(polar):
    assert_smooth(polar.coefficients, 1e-12)


def test_derivatives_are_those_of_the_values(polar):
    alpha = np.linspace(-3.1, 3.1, 501)
    lift, drag = polar.evaluate(alpha + 1e-30j)
    lift_slope, by_reynolds, drag_slope, also_by_reynolds = polar.derivatives(alpha)
    assert np.allclose(lift_slope, lift.imag / 1e-30, rtol=1e-12, atol=1e-12)
    assert np.allclose(drag_slope, drag.imag / 1e-30, rtol=1e-12, atol=1e-12)
    assert by_reynolds == also_by_reynolds == 0.0


def test_drag_is_positive_and_flow_at_right_angles_is_that_over_a_plate(polar):
    assert np.min(polar.evaluate(np.linspace(-np.pi, np.pi, 5000))[1]) > 0.0
    if polar.alpha_max == np.pi:
        return  # its table says itself what happens at right angles
    lift, drag = polar.evaluate(0.5 * np.pi)
    assert abs(lift) < 1e-6
    assert drag == pytest.approx(1.11 + 0.018 * 10.0, abs=1e-6)  # Viterna and Janetzke 1982, eq. 4


# The table


@pytest.mark.parametrize("name", POLARS)
def test_table_points_are_interpolated_exactly(name):
    table, (polar,) = shipped_table(name, "polar"), PolarFamily.from_file(name).polars
    # else only to the spline's error
    assert np.all(table["alpha_deg"] * KNOTS_PER_DEGREE % 1.0 == 0.0)
    lift, drag = polar.evaluate(np.deg2rad(table["alpha_deg"]))
    assert np.allclose(lift, table["cl"], atol=1e-12)
    assert np.allclose(drag, table["cd"], atol=1e-12)


# Outline


def naca_4_digit(camber, position, thickness, n=2001):
    """Points of a NACA 4-digit section (Jacobs, Ward and Pinkerton, NACA Report 460, 1933)."""
    x = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, n)))
    a = (0.2969, -0.1260, -0.3516, 0.2843, -0.1015)
    half = 5.0 * thickness * (a[0] * np.sqrt(x) + x * np.polyval(a[:0:-1], x))
    ahead = x < position if camber else np.zeros(n, bool)
    p = position if camber else 0.5
    q = np.where(ahead, p, 1.0 - p)
    line = camber / q**2 * (np.where(ahead, 0.0, 1.0 - 2.0 * p) + 2.0 * p * x - x**2)
    slope = np.arctan(2.0 * camber / q**2 * (p - x))
    upper = x - half * np.sin(slope), line + half * np.cos(slope)
    lower = x + half * np.sin(slope), line - half * np.cos(slope)
    return tuple(np.r_[up[::-1], low[1:]] for up, low in zip(upper, lower, strict=True))


@pytest.mark.parametrize("turn", [1, -1])
def test_rectangle_is_exact(turn):
    """b h, b h³/12, b³ h/12 about the centroid, whichever way round the points run."""
    x, y = np.array([1.0, 0.0, 0.0, 1.0])[::turn], np.array([0.3, 0.3, 0.1, 0.1])[::turn]
    outline = Outline(x, y)
    assert outline.area == pytest.approx(0.2, rel=1e-14)
    assert outline.thickness == pytest.approx(0.2, rel=1e-14)
    assert outline.centroid == pytest.approx((0.5, 0.2), rel=1e-14)
    assert outline.second_moments == pytest.approx((0.2**3 / 12.0, 0.2 / 12.0, 0.0), abs=1e-16)


def test_triangle_is_exact():
    """Right triangle with legs b, h: b h³/36, b³ h/36, product of inertia -b² h²/72."""
    outline = Outline(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 0.3]))
    assert outline.centroid == pytest.approx((1.0 / 3.0, 0.1), rel=1e-14)
    expected = 0.3**3 / 36.0, 0.3 / 36.0, -(0.3**2) / 72.0
    assert outline.second_moments == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("thickness", [0.09, 0.15, 0.21])
def test_naca_4_digit_area_thickness_and_flapwise_moment(thickness):
    """Integrals of the thickness polynomial: area 0.6851 t, thickness t."""
    outline = Outline(*naca_4_digit(0.0, 0.0, thickness))
    a = (0.2969, -0.1260, -0.3516, 0.2843, -0.1015)
    powers = np.array([0.5, 1.0, 2.0, 3.0, 4.0])
    area = 10.0 * thickness * np.sum(np.array(a) / (powers + 1.0))
    assert area == pytest.approx(0.6851 * thickness, rel=1e-4)
    assert outline.area == pytest.approx(area, rel=1e-5)
    assert outline.thickness == pytest.approx(thickness, rel=5e-4)  # rounded a: 1.0002 t
    sums = powers[:, None, None] + powers[:, None] + powers
    cubes = np.einsum("i,j,k,ijk", a, a, a, 1.0 / (sums + 1.0))
    expected = 2.0 / 3.0 * (5.0 * thickness) ** 3 * cubes
    assert outline.second_moments[0] == pytest.approx(expected, rel=1e-5)


def outline_files():
    x, y = naca_4_digit(0.02, 0.4, 0.12, 41)
    selig = [f" {a:.6f}  {b:.6f}" for a, b in zip(x, y, strict=True)]
    after = ["", "http://a.example/b", "t/c 12 %", "12 of 3"]
    sides = [*selig[40::-1], "", *selig[40:]]
    return {
        "CSV": ["# NACA 2412", "x_over_c,y_over_c", *(",".join(row.split()) for row in selig)],
        "Selig with a name": ["NACA 2412", *selig],
        "Selig without a name": selig,
        "Selig with commas": ["63 815 by hand", *(", ".join(row.split()) for row in selig)],
        "Lednicer with a name": ["NACA 2412", "  41.  41.", "", *sides],
        "Lednicer without a name": ["41 41", *sides],
        "Selig with text after": ["NACA 2412", *selig, *after],
        "Selig below two lines": ["NACA 2412", "These points are of a model.", *selig],
        "Selig below heads": ["NACA 2412", "   x/c        y/c", *selig],
        "MSES": ["NACA 2412", "-2.0 3.0 -2.5 3.5", *selig],
        "AeroDyn": ["  82  NumCoords ! and the reference", "! x/c y/c", "0.25  0", *selig],
        "AeroDyn from the nose": ["82 NumCoords", "0.25 0", *selig[40::-1], *selig[:39:-1]],
    }


def assert_is_naca_2412(path):
    outline, (x, y) = Outline.from_file(path), naca_4_digit(0.02, 0.4, 0.12, 41)
    assert outline.x.tolist() == np.round(x, 6).tolist()
    assert outline.y.tolist() == np.round(y, 6).tolist()


@pytest.mark.parametrize("name", outline_files())
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_outline_formats_agree(tmp_path, name, end):
    path = tmp_path / "section.dat"
    path.write_text(end.join(outline_files()[name]) + end, encoding="utf-8", newline="")
    assert_is_naca_2412(path)


def test_an_aerodyn_table_names_its_outline(tmp_path):
    rows = outline_files()["AeroDyn from the nose"]
    (tmp_path / "coords.txt").write_text("\n".join(rows), encoding="utf-8")
    for line in ('@"coords.txt" NumCoords', "\n".join(rows)):  # in another file, and in this one
        table = tmp_path / "airfoil.dat"
        table.write_text(f'"default" InterpOrd\n{line}\n', encoding="utf-8")
        assert_is_naca_2412(table)


def test_lednicer_sides_with_noses_apart_keep_both_points(tmp_path):
    rows = outline_files()["Lednicer with a name"]
    nose = rows.index(rows[3], 4)
    rows[nose] = "0.000000 -0.001000"
    path = tmp_path / "section.dat"
    path.write_text("\n".join(rows), encoding="utf-8")
    assert Outline.from_file(path).x.size == 82
