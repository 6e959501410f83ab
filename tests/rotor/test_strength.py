"""What sections resist: closed forms of simple sections, and the numbers of the default one."""

import numpy as np
import pytest

from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.strength import PLACES, POINT_ERROR, Structure, norm, place_weights

HEIGHT = 0.2
CHORD = 0.3


def rectangle(height=HEIGHT, angle=0.0):
    """Return a rectangle of unit length, turned about its middle."""
    x, y = np.array([1.0, 0.0, 0.0, 1.0]) - 0.5, height * (np.array([1.0, 1.0, 0.0, 0.0]) - 0.5)
    cosine, sine = np.cos(angle), np.sin(angle)
    return Outline(0.5 + x * cosine - y * sine, x * sine + y * cosine)


def ellipse(height=HEIGHT, n=2000):
    angle = np.linspace(0.0, 2.0 * np.pi, n + 1)
    return Outline(0.5 + 0.5 * np.cos(angle), 0.5 * height * np.sin(angle))


def largest(structure, weak, strong, chord=CHORD):
    moments = (np.array([[float(each)]]) for each in (weak, strong))
    return structure.bending(*moments, np.array([chord])).largest.item()


@pytest.fixture(scope="module")
def naca():
    return Outline.from_file("naca63815")


# Closed forms


@pytest.mark.parametrize("angle", [0.1, 0.4, -0.7])
def test_inclined_rectangle_bends_about_its_own_axes(angle):
    """The moments are resolved along the axes of the rectangle, where there is no xy."""
    structure = Structure.of(rectangle(angle=angle), 1000.0)
    weak, strong = 70.0, 40.0
    # forces towards (-strong, weak), seen along and across the turned rectangle
    across = -strong * -np.sin(angle) + weak * np.cos(angle)
    along = -strong * np.cos(angle) + weak * np.sin(angle)
    expected = 6.0 * (abs(across) / HEIGHT**2 + abs(along) / HEIGHT) / CHORD**3
    assert largest(structure, weak, strong) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("height", [1.0, 0.3])
def test_hollow_ellipse(height):
    """A wall of constant thickness round an ellipse, by its integrals along the outline."""
    wall, angle = 0.02, np.linspace(0.0, 2.0 * np.pi, 20001)
    a, b = 0.5, 0.5 * height
    x, y = a * np.cos(angle), b * np.sin(angle)
    size = np.hypot(a * np.sin(angle), b * np.cos(angle))
    inner = x - wall * b * np.cos(angle) / size, y - wall * a * np.sin(angle) / size
    shapes = [Outline(*each) for each in ((x, y), inner)]
    area = shapes[0].area - shapes[1].area
    moments = np.subtract(shapes[0].second_moments, shapes[1].second_moments)
    structure = Structure.of(ellipse(height), 1000.0, wall=wall)
    assert structure.area[0] == pytest.approx(area, rel=1e-3)
    assert [structure.xx[0], structure.yy[0]] == pytest.approx(moments[:2], rel=2e-3)


def test_thin_wall_tends_to_the_integral_along_the_outline(naca):
    """Area is length times wall, and so are the second moments, about the outline's centroid."""
    wall = 5e-4
    run, rise = np.diff(naca.x), np.diff(naca.y)
    length = np.hypot(run, rise)
    x, y = 0.5 * (naca.x[1:] + naca.x[:-1]), 0.5 * (naca.y[1:] + naca.y[:-1])
    x, y = x - np.average(x, weights=length), y - np.average(y, weights=length)
    structure = Structure.of(naca, 1000.0, wall=wall)
    assert structure.area[0] == pytest.approx(wall * np.sum(length), rel=0.02)
    assert structure.xx[0] == pytest.approx(wall * np.sum(length * y**2), rel=0.02)
    assert structure.yy[0] == pytest.approx(wall * np.sum(length * x**2), rel=0.02)
    small = 0.01 * np.sqrt(structure.xx[0] * structure.yy[0])  # both sides' products nearly cancel
    assert structure.xy[0] == pytest.approx(wall * np.sum(length * x * y), abs=small)


def test_default_section_has_its_published_proportions(naca):
    """NACA 63-815: area, second moments and extents from the centroid, computed elsewhere."""
    structure = Structure.of(naca, 2700.0)
    numbers = [structure.area[0], structure.xx[0], structure.yy[0], abs(structure.xy[0])]
    assert numbers == pytest.approx([0.0940, 1.250e-4, 4.42e-3, 8.2e-5], rel=1e-3)
    assert np.max(np.abs(structure.points[0]), axis=1) == pytest.approx([0.594, 0.0800], rel=1e-3)


# The points that are kept, and the norm


@pytest.mark.parametrize("name", ["naca63815", "naca4415", "naca63424", "cylinder"])
def test_points_reach_as_far_as_the_outline(name):
    outline = Outline.from_file(name)
    points = Structure.of(outline, 1000.0).points[0].T
    around = np.column_stack((outline.x, outline.y)) - outline.centroid
    angle = np.random.default_rng(0).uniform(0.0, np.pi, 5000)
    gradient = np.array([np.cos(angle), np.sin(angle) / outline.thickness])
    reach = np.max(np.abs(points @ gradient), axis=0) / np.max(np.abs(around @ gradient), axis=0)
    assert len(points) <= (100 if name == "cylinder" else 30)
    assert reach.min() > 1.0 - 2e-5  # directions lie between those that were looked at
    assert reach.max() < 1.0 + 1.2 * POINT_ERROR


@pytest.mark.parametrize("exponent", [8, 50, 400])
def test_norm_is_smooth_and_never_below_the_largest(exponent):
    values = np.random.default_rng(1).normal(size=(200, 7))
    values[:50, 1] = values[:50, 0]  # ties
    smooth, share = norm(values, exponent)
    most = np.maximum(np.max(values, axis=1), 0.0)
    assert np.all(smooth >= most)
    assert np.all(smooth <= most * 7.0 ** (1.0 / exponent) * (1.0 + 1e-15))
    assert norm(1e30 * values, exponent)[0] == pytest.approx(1e30 * smooth, rel=1e-12)
    for column in range(7):
        stepped = values.astype(complex)
        stepped[:, column] += 1e-30j
        slope = norm(stepped, exponent)[0].imag / 1e-30
        assert share[:, column] == pytest.approx(slope, rel=1e-10, abs=1e-14)


def test_slopes_of_bending_are_those_of_the_complex_step(naca):
    structure = Structure.of(naca, 1000.0)
    rng = np.random.default_rng(2)
    weak, strong, chord = rng.normal(size=(5, 3)), 9.0 * rng.normal(size=(5, 3)), np.full(3, CHORD)
    bending = structure.bending(weak, strong, chord)
    by_weak = structure.bending(weak + 1e-30j, strong, chord).smooth.imag / 1e-30
    by_strong = structure.bending(weak, strong + 1e-30j, chord).smooth.imag / 1e-30
    assert bending.by_weak == pytest.approx(by_weak, rel=1e-10)
    assert bending.by_strong == pytest.approx(by_strong, rel=1e-10)
    assert np.all(bending.smooth >= bending.largest)


# Along the span


@pytest.mark.parametrize("n", [2, 9, 40])
def test_places_hold_the_stations_and_values_are_linear_between(n):
    weights = place_weights(n)
    stations = np.arange(n) * ((len(weights) - 1) // (n - 1))
    values = np.random.default_rng(n).normal(size=n)
    assert len(weights) >= max(PLACES, 3 * (n - 1))
    assert (weights @ values)[stations] == pytest.approx(values, rel=1e-14)
    assert np.sum(weights, axis=1) == pytest.approx(1.0, rel=1e-14)
    line = np.linspace(2.0, 3.0 * n - 1.0, len(weights))
    assert weights @ (2.0 + 3.0 * np.arange(n)) == pytest.approx(line, rel=1e-13)


def test_stretched_sections_along_the_span_have_powers_of_the_thickness(naca):
    """Between stations, too: area goes with thickness, xx with its cube, xy with its square."""
    thickness = np.array([2.0, 1.0, 1.0, 0.8])
    structure = Structure.of([naca.stretched(each) for each in thickness], 1000.0)
    share = place_weights(4) @ thickness
    one = Structure.of(naca, 1000.0)
    assert structure.area == pytest.approx(one.area[0] * share, rel=1e-4)
    assert structure.xx == pytest.approx(one.xx[0] * share**3, rel=3e-4)
    assert structure.yy == pytest.approx(one.yy[0] * share, rel=1e-4)
    assert structure.xy == pytest.approx(one.xy[0] * share**2, rel=3e-4)
    reach = np.max(np.abs(structure.points[:, 1]), axis=1)
    assert reach == pytest.approx(share * np.max(np.abs(one.points[0, 1])), rel=3e-4)


def test_given_second_moments_stand_in_for_those_of_the_outline(naca):
    moments = [(0.05, 2e-4, 5e-3, 0.0), (0.05, 1e-4, 5e-3, 0.0)]
    structure = Structure.of([naca, naca], 1000.0, given=moments)
    assert structure.xx == pytest.approx(np.linspace(2e-4, 1e-4, structure.xx.size))
    for name, number in (("area", 0.05), ("yy", 5e-3), ("xy", 0.0)):
        assert getattr(structure, name) == pytest.approx(number, rel=1e-14)
    np.testing.assert_array_equal(structure.points[0], Structure.of(naca, 1000.0).points[0])
