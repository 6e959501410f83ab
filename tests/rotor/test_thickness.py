"""Sections over their thickness: theory, derivatives of BEM and loads, the steady optimum."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hkt_mdo.errors import InputError
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import PolarFamily
from hkt_mdo.rotor.following import ByThickness
from hkt_mdo.rotor.loads import LoadModel
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.polars import ByStation
from hkt_mdo.rotor.steady_optimum import best_rotor
from hkt_mdo.rotor.strength import Structure, StructureByThickness

THICKNESS = np.array([0.12, 0.15, 0.24])
RATIO = np.linspace(3.0, 11.0, 9)
BOUNDS = {"chord": (0.01, 1.0), "twist": (-0.5, 0.5)}
METAL = 2700.0


@pytest.fixture(scope="module")
def sections():
    names = "naca63815_Re1e6", "naca4415_Re1e6", "naca63424_Re1e6"
    return tuple(PolarFamily.from_file(name).polars[0] for name in names)


@pytest.fixture(scope="module")
def family(sections):
    return ByThickness.of(THICKNESS, sections, (0.12, 0.24))


@pytest.fixture(scope="module")
def thick(blade):
    return replace(blade, thickness=np.linspace(0.235, 0.125, blade.r.size))


def outlines():
    base = Outline.from_file("naca63815")
    return [base.stretched(each / base.thickness) for each in THICKNESS]


def model_of(family, wall=None):
    walls = None if wall is None else np.broadcast_to(wall, 3)
    structure = StructureByThickness.of(THICKNESS, outlines(), METAL, wall=walls)
    return LoadModel(family, structure=structure, depth=3.0)


def slope(function, size=1e-4):
    """Return the derivative of a function at zero, by differences of fourth order."""
    values = [function(k * size) for k in (-2, -1, 1, 2)]
    return (values[0] - 8.0 * values[1] + 8.0 * values[2] - values[3]) / (12.0 * size)


# Theory


def test_a_curve_over_the_thickness_meets_its_sections_and_is_linear_where_they_are(family):
    weights, slopes = family.weights(SimpleNamespace(thickness=THICKNESS))[:, :, 0]
    np.testing.assert_allclose(weights, np.eye(3), atol=1e-14)
    at = np.linspace(0.12, 0.24, 41)
    weights, slopes = family.weights(SimpleNamespace(thickness=at))[:, :, 0]
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-13)
    np.testing.assert_allclose(weights @ THICKNESS, at, rtol=1e-13)
    np.testing.assert_allclose(slopes @ THICKNESS, 1.0, rtol=1e-12)
    second = family._cardinal(THICKNESS[1] + np.array([-1e-9, 1e-9]), 2)
    np.testing.assert_allclose(second[0], second[1], rtol=1e-6)


@pytest.mark.parametrize("index", [0, 1, 2])
def test_at_a_sections_thickness_the_rotor_is_that_of_the_section(thick, family, sections, index):
    same = replace(thick, thickness=np.full(thick.r.size, THICKNESS[index]))
    coefficients = bem.rotor_coefficients(same, family, RATIO, derivatives=True)
    single = bem.rotor_coefficients(same, sections[index], RATIO, derivatives=True)
    parts = (each.torque_table._replace(by_thickness=0.0) for each in (coefficients, single))
    for mine, its in zip(*parts, strict=True):
        np.testing.assert_allclose(mine, its, rtol=1e-9, atol=1e-12)
    angle = np.deg2rad(np.linspace(-5.0, 12.0, 6 * thick.r.size)).reshape(6, -1)
    mine, its = (each.along("suction", same, RATIO, angle) for each in (family, sections[index]))
    np.testing.assert_allclose(mine[0], its[0], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(mine[1], its[1], rtol=1e-10, atol=1e-10)


def test_ellipses_have_their_closed_forms_between_the_sections():
    """Area π/4 t, second moments π/64 t³ and π/64 t over powers of the chord."""
    angle = np.linspace(0.0, 2.0 * np.pi, 1001)
    ellipses = [Outline(0.5 + 0.5 * np.cos(angle), 0.5 * t * np.sin(angle)) for t in THICKNESS]
    at = np.array([0.13, 0.18, 0.2, 0.24])
    structure, rate = StructureByThickness.of(THICKNESS, ellipses, METAL).at(at)
    np.testing.assert_allclose(structure.area, np.pi / 4.0 * at, rtol=3e-4)
    np.testing.assert_allclose(structure.xx, np.pi / 64.0 * at**3, rtol=6e-4)
    np.testing.assert_allclose(structure.yy, np.pi / 64.0 * at, rtol=6e-4)
    np.testing.assert_allclose(rate.xx, 3.0 * np.pi / 64.0 * at**2, rtol=6e-4)


@pytest.mark.parametrize("wall", [None, 0.02])
def test_the_stress_at_a_sections_thickness_is_that_of_the_section(thick, family, wall):
    same = replace(thick, thickness=np.full(thick.r.size, THICKNESS[1]))
    loads = model_of(family, wall).loads(same, RATIO, names=("stress",))
    single = Structure.of(outlines()[1], METAL, wall=wall)
    model = LoadModel(ByStation(family.stations(same)), structure=single)
    expected = model.loads(same, RATIO, names=("stress",))["stress"]
    np.testing.assert_allclose(loads["stress"].exact, expected.exact, rtol=2e-3)


def test_sections_that_differ_too_much_are_refused():
    names = "naca63815_Re1e6", "naca63424_Re1e6", "cylinder"
    polars = [PolarFamily.from_file(name).polars[0] for name in names]
    with pytest.raises(InputError, match=r"no positive drag at a thickness of 0\.1"):
        ByThickness.of([0.15, 0.24, 0.3], polars, (0.15, 0.24))


# Derivatives


@pytest.mark.parametrize("cone", [0.0, 0.12])
def test_derivatives_of_sections_by_thickness(thick, family, cone):
    thick = replace(thick, cone=cone)
    state = bem.sections(thick, family, RATIO, derivatives=True)

    def at(step):
        moved = bem.sections(replace(thick, thickness=thick.thickness + step), family, RATIO)
        names = "tangential_load", "normal_load", "inflow_angle", "relative_speed"
        return np.stack([getattr(moved, name) for name in names])

    expected = slope(at)
    scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(state.derivatives[:, 3] / scale, expected / scale, atol=1e-7)
    torque = bem.rotor_coefficients(thick, family, RATIO, derivatives=True)
    for station in (0, 4, 8):
        one = np.eye(thick.r.size)[station]

        def coefficient(step, one=one):
            moved = replace(thick, thickness=thick.thickness + step * one)
            return bem.rotor_coefficients(moved, family, RATIO).torque

        mine = torque.torque_table.by_thickness[:, station]
        np.testing.assert_allclose(mine, slope(coefficient), atol=1e-9)


@pytest.mark.parametrize(("cone", "wall"), [(0.0, None), (0.12, None), (0.12, (0.06, 0.02, 0.03))])
def test_derivatives_of_loads_by_thickness(thick, family, cone, wall):
    thick = replace(thick, cone=cone)
    model, n = model_of(family, wall), thick.r.size
    changes = np.vstack((np.eye(n)[[0, 3, 8]], np.random.default_rng(2).normal(size=n)))
    loads = model.loads(thick, RATIO, derivatives=True)
    assert set(loads) == {"thrust", "root_moment", "stress", "cavitation"}
    for change in changes:

        def at(step, name, change=change):
            moved = replace(thick, thickness=thick.thickness + step * change)
            return model.loads(moved, RATIO)[name].envelope().values

        for name, load in loads.items():
            expected = slope(lambda step, name=name: at(step, name), 1e-5)
            mine = load.envelope().by_thickness @ change
            size = np.abs(load.envelope().values)
            np.testing.assert_allclose(mine / size, expected / size, rtol=1e-5, atol=1e-5)


# The steady optimum


def test_more_freedom_of_the_thickness_never_lowers_the_steady_optimum(thick, family, sections):
    families = [replace(family, bounds=bounds) for bounds in ((0.14, 0.2), (0.12, 0.24))]
    *fixed, narrow, wide = (best_rotor(thick, each, BOUNDS) for each in (*sections, *families))
    assert max(each.power_coefficient for each in fixed) <= wide.power_coefficient + 1e-8
    assert narrow.power_coefficient <= wide.power_coefficient + 1e-8
    assert np.all((narrow.blade.thickness >= 0.14) & (narrow.blade.thickness <= 0.2))
