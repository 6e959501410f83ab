"""Walls, areas, second moments and materials that a case gives: closed forms, and what is told."""

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.files.shipped import MATERIALS
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.strength import material_section, place_weights

CHORD, HUB, TIP, DENSITY = 0.2, 0.2, 1.5, 1500.0
STATIONS = [0.2, 0.3, 0.4, 0.6, 0.8, 0.95]
UNIFORM = {
    "radius": TIP,
    "hub_radius_fraction": HUB / TIP,
    "stations": STATIONS,
    "chord": [CHORD] * len(STATIONS),
    "twist": [10.0] * len(STATIONS),
    "polar": "naca4415_Re2e5",
    "outline": "naca4415",
    "material_density": DENSITY,
}
SECTION = {"polar": "naca4415_Re2e5", "outline": "naca4415"}
RATIO = np.array([3.0, 5.0, 7.0])


def plant(rotor=None, **limits):
    """Return the physics of a case with a uniform blade and some more keys of `rotor`."""
    case = {"inflow": "sine", "control": "quadratic", "rotor": UNIFORM | (rotor or {})}
    return physics(load_case(case | {"limits": limits}))


def stress(model):
    """Return the stress over q at tip speed ratios and places."""
    return model.rotor.loads(model.blade, RATIO, names=("stress",))["stress"].exact


# Closed forms


@pytest.mark.parametrize("wall", [0.002, 0.03, 0.2])
def test_tube(wall):
    """Area pi/4 (1 - k²), second moments pi/64 (1 - k⁴), k the inner over the outer diameter."""
    model, k = plant({"outline": "cylinder", "wall": wall}), 1.0 - 2.0 * wall
    area, second = 0.25 * np.pi * (1.0 - k**2), np.pi / 64.0 * (1.0 - k**4)
    structure = model.rotor.structure
    assert structure.area == pytest.approx(area, rel=2e-3)
    assert [*structure.xx, *structure.yy] == pytest.approx([second, second], rel=2e-3)
    assert abs(structure.xy) < 1e-12
    blades = 3.0 * DENSITY * area * CHORD**2
    mass, inertia = model.rotor.mass_and_inertia(model.blade)
    assert mass == pytest.approx(blades * (TIP - HUB), rel=2e-3)
    assert inertia == pytest.approx(blades * (TIP**3 - HUB**3) / 3.0, rel=2e-3)


def test_a_wall_of_half_the_thickness_is_solid():
    solid = plant()
    for wall in (0.5, 0.5 * Outline.from_file("naca4415").thickness):
        model = plant({"wall": wall})
        assert model.rotor.structure.section_area == solid.rotor.structure.section_area
        np.testing.assert_array_equal(stress(model), stress(solid))


# What a case gives for its sections


def test_given_numbers_stand_in_for_the_outlines():
    """Half the second moments are twice the bending stress, the area alone is the mass."""
    light, rotor = {"material_density": 1e-9}, {"polar": None}
    _, moments, _ = material_section(Outline.from_file("naca4415"))
    numbers = dict(zip(("flapwise", "edgewise", "product"), 0.5 * np.array(moments), strict=True))
    weak = plant(light | rotor | {"sections": [SECTION | {"second_moments": numbers}]})
    expected = 2.0 * stress(plant(light))
    np.testing.assert_allclose(stress(weak), expected, rtol=1e-9, atol=1e-12 * expected.max())
    heavy = plant(rotor | {"sections": [SECTION | {"area": 0.05, "wall": 0.01}]})
    mass = 3.0 * DENSITY * 0.05 * CHORD**2 * (TIP - HUB)
    assert heavy.rotor.mass_and_inertia(heavy.blade)[0] == pytest.approx(mass, rel=1e-12)
    hollow = plant({"wall": 0.01}).rotor.structure
    assert heavy.rotor.structure.area == 0.05
    assert heavy.rotor.structure.xx == hollow.xx


def spanwise(inner, outer, tmp_path, design=None):
    """Return the physics of a blade whose sections lie between two of 24 and 12 % thickness."""
    path = tmp_path / "blade.csv"
    rows = [f"{r},{CHORD},10,{0.24 - 0.03 * i}" for i, r in enumerate((0.3, 0.5, 0.7, 0.9, 1.1))]
    path.write_text("\n".join(("r_m,chord_m,twist_deg,t_over_c", *rows)), encoding="utf-8")
    polar = {"polar": "naca4415_Re2e5"}
    sections = [polar | {"thickness": 0.24} | inner, polar | {"thickness": 0.12} | outer]
    keys = {key: UNIFORM[key] for key in ("radius", "outline", "material_density")}
    rotor = keys | {"blade": str(path), "hub_radius_fraction": 0.15, "sections": sections}
    case = {"inflow": "sine", "control": "quadratic", "rotor": rotor, "design": design or {}}
    return physics(load_case(case))


def test_sections_are_linear_between_those_that_are_given(tmp_path):
    moments = [
        {"flapwise": 4e-4, "edgewise": 6e-3, "product": 1e-4},
        {"flapwise": 1e-4, "edgewise": 3e-3, "product": -1e-4},
    ]
    inner, outer = ({"second_moments": each} for each in moments)
    model = spanwise(inner | {"area": 0.1}, outer | {"area": 0.06}, tmp_path)
    structure = model.rotor.structure
    np.testing.assert_allclose(structure.section_area, np.linspace(0.1, 0.06, 5), rtol=1e-12)
    share = place_weights(5) @ np.linspace(0.0, 1.0, 5)
    for name, key in (("xx", "flapwise"), ("yy", "edgewise"), ("xy", "product")):
        one, two = (each[key] for each in moments)
        expected = (1.0 - share) * one + share * two
        np.testing.assert_allclose(getattr(structure, name), expected, atol=1e-15)
    np.testing.assert_allclose(structure.area, (1.0 - share) * 0.1 + share * 0.06, rtol=1e-12)


def test_a_solid_section_beside_a_hollow_one(tmp_path):
    model, solid = spanwise({}, {"wall": 0.02}, tmp_path), spanwise({}, {}, tmp_path)
    at, whole = model.rotor.structure, solid.rotor.structure
    base = Outline.from_file("naca4415")
    thin = material_section(base.stretched(0.12 / base.thickness), 0.02)
    assert (at.area[0], at.xx[0]) == pytest.approx((whole.area[0], whole.xx[0]), rel=1e-9)
    assert (at.area[-1], at.xx[-1]) == pytest.approx((thin[0], thin[1][0]), rel=1e-9)
    assert np.all(at.xx <= whole.xx * (1.0 + 1e-9))
    assert at.section_area[-1] == pytest.approx(thin[0], rel=1e-9)
    # mass and centrifugal force have one area
    np.testing.assert_allclose(at.area, place_weights(5) @ at.section_area, rtol=1e-12)


@pytest.mark.parametrize("design", [{}, {"thickness_points": 4}])
def test_between_walls_mass_and_stress_are_of_one_section(design, tmp_path):
    """The wall is linear; that of a solid section, here 0.5, is half as thick as the section."""
    model = spanwise({"wall": 0.5}, {"wall": 0.02}, tmp_path, design)
    thickness = model.blade.thickness if design else np.linspace(0.24, 0.12, 5)
    structure = model.rotor.structure
    area = structure.section_area
    base, weights = Outline.from_file("naca4415"), place_weights(5)
    if design:
        area, (structure, _) = area(thickness), structure.at(weights @ thickness)
    for i, value in enumerate(thickness):
        outline, wall = base.stretched(value / base.thickness), 0.02 + 0.1 * (value - 0.12) / 0.12
        section_area, moments, _ = material_section(outline, wall)
        at = np.argmax(weights[:, i])
        result = area[i], structure.area[at], structure.xx[at]
        assert result == pytest.approx((section_area, section_area, moments[0]), rel=2e-3)


# Materials


@pytest.mark.parametrize("name", MATERIALS)
def test_shipped_materials(name):
    """Mass goes with the density, deflection with one over the modulus; the stress is the bound."""
    model = plant({"material": name, "material_density": None}, stress="allowable")
    solid, row = plant(), MATERIALS[name]
    mass = [each.rotor.mass_and_inertia(each.blade)[0] for each in (model, solid)]
    assert mass[0] / mass[1] == pytest.approx(row["density"] / DENSITY, rel=1e-12)
    sag = [each.rotor.tip_deflection(each.blade, RATIO)[0] for each in (model, solid)]
    assert sag[0] / sag[1] == pytest.approx(68.9e9 / row["modulus"], rel=1e-12)
    assert {each.name: each.upper for each in model.all_limits}["stress"] == row["allowable_stress"]
    assert 500.0 < row["density"] < 9e3
    # metals and laminates of blades break or yield between 0.1 and 1 % of strain
    assert 1e-3 < row["allowable_stress"] / row["modulus"] < 1.3e-2


def test_a_material_of_ones_own_and_keys_beside_it():
    material = {"density": "1.9 g/cm^3", "modulus": "30 GPa", "allowable_stress": "60 MPa"}
    rotor = {"material": material, "material_density": None}
    model = plant(rotor, stress={"bound": "allowable"})
    assert model.rotor.structure.density == pytest.approx(1900.0)
    assert model.rotor.structure.modulus == 30e9
    assert {each.name: each.upper for each in model.all_limits}["stress"] == pytest.approx(60e6)
    structure = plant(rotor | {"material_density": 900.0, "modulus": "20 GPa"}).rotor.structure
    assert (structure.density, structure.modulus) == (900.0, 20e9)
