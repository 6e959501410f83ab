"""The turbine of a case: files, stations and sections fit together, or it is told why not."""

import re

import numpy as np
import pytest

from hkt_mdo.case import read_case
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import shipped_names
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.rotor.airfoil import Polar, PolarFamily
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.steady_optimum import best_operation
from tests.files.broken.blades import WINDIO

CSV = (
    "r_m,chord_m,twist_deg,t_over_c\n0.2,0.2,20,0.24\n0.6,0.1,10,0.18\n0.9,0.1,5,0.15\n1,0.1,4,0.15"
)
NAMED = "r_m,chord_m,twist_deg,section\n0.2,0.2,20,a\n0.6,0.1,10,b\n0.9,0.1,5,b\n1.0,0.1,4,b\n"
AERODYN = """\
------- AERODYN BLADE -------
======  Blade Properties =====
5 NumBlNds
BlSpn BlCrvAC BlSwpAC BlCrvAng BlTwist BlChord BlAFID
(m) (m) (m) (deg) (deg) (m) (-)
0.0 0 0 0 20 0.2 1
0.2 0 0 0 15 0.15 1
0.4 0 0 0 10 0.1 1
0.7 0 0 0 5 0.1 1
0.8 0 0 0 4 0.1 1
"""
THICK = "{polar: naca4415_Re2e5, thickness: 0.24}"
THIN = "{polar: naca63815_Re2e5, thickness: 0.15}"


@pytest.fixture
def turbine(tmp_path):
    """Return a function that builds the turbine of some keys of `rotor`."""
    (tmp_path / "b.csv").write_text(CSV, encoding="utf-8")
    (tmp_path / "n.csv").write_text(NAMED, encoding="utf-8")
    (tmp_path / "lone.csv").write_text(NAMED.replace(",b", ",a"), encoding="utf-8")
    (tmp_path / "a.dat").write_text(AERODYN, encoding="utf-8")

    def build(keys):
        text = f"inflow: sine\ncontrol: linear\nrotor: {{{keys}}}"
        case = read_case(text, file=f"{tmp_path}/case.yaml")
        return build_turbine(case.rotor, case.fluid, 1.5)

    return build


@pytest.mark.parametrize("name", shipped_names("blade"))
def test_a_shipped_blade_brings_its_turbine_with_it(name, turbine):
    rotor = turbine(f"blade: {name}")
    best = best_operation(rotor.blade, rotor.polar)
    # bahaj2007: as measured; RM1: ROSCO (hkt_mdo/files/data/README.md); river: designed for 5
    expected, ratio = {"bahaj2007": (0.458, 5.37), "rm1": (0.447, 7.0), "river": (0.45, 5.0)}[name]
    assert best.power_coefficient == pytest.approx(expected, rel=0.04)
    assert best.tip_speed_ratio == pytest.approx(ratio, rel=0.05)


def test_rows_between_hub_and_tip_are_the_stations(turbine):
    rotor = turbine("blade: b.csv, radius: 1, set_angle: 2, cone: 3")
    np.testing.assert_array_equal(rotor.blade.r, [0.2, 0.6, 0.9])
    np.testing.assert_array_equal(rotor.blade.chord, [0.2, 0.1, 0.1])
    np.testing.assert_allclose(np.rad2deg(rotor.blade.twist), [22, 12, 7], rtol=1e-12)
    assert (rotor.blade.hub_radius, rotor.blade.blade_count) == (0.125, 3)
    assert np.rad2deg(rotor.blade.cone) == pytest.approx(3.0)
    assert any("1 of 4 rows lie at hub or tip" in line for line in rotor.messages)
    assert any("no rotor.polar is given: lift and" in line for line in rotor.messages)


def test_counted_stations_are_closer_together_towards_hub_and_tip(turbine):
    rotor = turbine("blade: b.csv, radius: 1, hub_radius_fraction: 0.1, station_count: 4")
    angle = np.pi * np.array([1, 3, 5, 7]) / 8
    np.testing.assert_allclose(rotor.blade.r, 0.1 + 0.45 * (1 - np.cos(angle)), rtol=1e-12)
    assert rotor.blade.chord[0] == 0.2
    assert turbine("blade: b.csv, radius: 2, station_count: 4").reach == 0.5
    assert any("continue unchanged to hub and tip" in line for line in rotor.messages)


def test_a_span_that_is_counted_from_the_root_begins_at_the_hub(turbine):
    blade = turbine("blade: a.dat, hub_radius_fraction: 0.2, polar: naca4415_Re2e5").blade
    assert (blade.tip_radius, blade.hub_radius) == pytest.approx((1.0, 0.2))
    np.testing.assert_allclose(blade.r, [0.4, 0.6, 0.9])


def test_sections_are_blended_by_thickness(turbine):
    rotor = turbine(f"blade: b.csv, radius: 1, sections: [{THIN}, {THICK}]")
    np.testing.assert_allclose(rotor.thickness, [0.24, 0.18, 0.15], rtol=1e-12)
    names = "naca4415_Re2e5", "naca63815_Re2e5"
    thick, thin = (PolarFamily.from_file(name).polars[0] for name in names)
    for (polar,), share in zip(rotor.polar.tables, (1.0, 1.0 / 3.0, 0.0), strict=True):
        expected = share * thick.evaluate(0.1)[0] + (1.0 - share) * thin.evaluate(0.1)[0]
        assert polar.evaluate(0.1)[0] == pytest.approx(expected, rel=1e-9)
    base = Outline.from_file("naca63815")
    area = base.area * rotor.thickness / base.thickness
    np.testing.assert_allclose(rotor.structure.section_area, area, rtol=1e-12)
    with pytest.raises(InputError, match=r"names the section a, which rotor\.sections"):
        turbine(f"blade: n.csv, radius: 1, sections: [{THIN}]")


def test_rows_may_begin_outboard_of_the_hub(turbine, tmp_path):
    text = AERODYN.replace("5 NumBlNds", "4 NumBlNds").replace("0.0 0 0 0 20 0.2 1\n", "")
    (tmp_path / "o.dat").write_text(text, encoding="utf-8")
    keys = "hub_radius_fraction: 0.2, polar: naca4415_Re2e5"
    rotor = turbine(f"blade: o.dat, {keys}, station_count: 9")
    assert rotor.blade.tip_radius == pytest.approx(1.0)
    np.testing.assert_array_equal(rotor.blade.chord[rotor.blade.r < 0.4], 0.15)
    assert any("rows begin 0.2 m (25 % of the span) outboard" in line for line in rotor.messages)
    rotor = turbine("blade: b.csv, radius: 1, hub_radius_fraction: 0.1")
    assert any("rows begin at r/R = 0.2, the hub ends at 0.1" in line for line in rotor.messages)
    with pytest.raises(InputError, match=r"column BlSpn = 0\.2: is the hub's radius"):
        turbine("blade: o.dat, hub_radius_fraction: 0.25, polar: naca4415_Re2e5")


@pytest.mark.parametrize("sign", [1, -1])
def test_an_outline_upside_down_is_told(turbine, tmp_path, sign):
    foil = Outline.from_file("naca4415")
    np.savetxt(tmp_path / "foil.dat", np.column_stack((foil.x, sign * foil.y))[::-sign])
    notes = " ".join(turbine("blade: river, outline: foil.dat").messages)
    assert ("its camber is against the lift" in notes) == (sign < 0)


def test_an_aerodyn_polar_brings_its_outline(turbine, tmp_path):
    foil = Outline.from_file("naca4415")
    points = [f"{x} {y}" for x, y in zip(foil.x, foil.y, strict=True)]
    text = "\n".join([f"{len(points) + 1} NumCoords", "0.25 0", *points])
    (tmp_path / "coords.txt").write_text(text, encoding="utf-8")
    rows = "\n".join(f"{a} {0.1 * a + 0.3} 0.02" for a in range(-9, 16))
    table = f'@"coords.txt" NumCoords\n1 NumTabs\n1.0 Re\nFalse InclUAdata\n25 NumAlf\n{rows}\n'
    (tmp_path / "foil.dat").write_text(table, encoding="utf-8")
    rotor = turbine("blade: b.csv, radius: 1, polar: foil.dat")
    stretched = foil.area * rotor.thickness / foil.thickness
    np.testing.assert_allclose(rotor.structure.section_area, stretched, rtol=1e-12)
    assert any("foil.dat: outline from the coordinates" in line for line in rotor.messages)
    assert turbine("polar: foil.dat").thickness == pytest.approx(foil.thickness)
    other = turbine("blade: b.csv, radius: 1, polar: foil.dat, outline: naca63815")
    stretched = other.thickness * Outline.from_file("naca63815").area
    np.testing.assert_allclose(other.structure.section_area, stretched / 0.15, rtol=1e-3)
    described = "{name: a, polar: foil.dat}, {name: b, polar: foil.dat, outline: naca63815}"
    sections = turbine(f"blade: n.csv, radius: 1, sections: [{described}]")
    assert sections.thickness[0] == pytest.approx(foil.thickness)
    (tmp_path / "coords.txt").unlink()  # the table alone is read as before
    alone = turbine("blade: b.csv, radius: 1, polar: foil.dat")
    np.testing.assert_array_equal(alone.structure.section_area, other.structure.section_area)


def test_the_one_section_has_the_thickness_of_the_blade_file(turbine, tmp_path):
    """Area grows with the thickness, the second moment of area about the chord with its cube."""
    foil = Outline.from_file("naca63815")
    rotor, default = turbine("blade: b.csv, radius: 1"), turbine("")
    np.testing.assert_allclose(rotor.thickness, [0.24, 0.18, 0.15], rtol=1e-12)
    stretch = rotor.thickness / foil.thickness
    np.testing.assert_allclose(rotor.structure.section_area, stretch * foil.area, rtol=1e-12)
    assert isinstance(rotor.polar, Polar)
    assert any("thickness of the blade's file, 15 to 24 %" in text for text in rotor.messages)
    (tmp_path / "even.csv").write_text(re.sub(r"0\.\d+$", "0.24", CSV, flags=re.MULTILINE))
    even = turbine("blade: even.csv, radius: 1").structure
    ratio = 0.24 / foil.thickness * np.ones(even.xx.size)
    # outlines of several stations are resampled
    np.testing.assert_allclose(even.xx, ratio**3 * default.structure.xx, rtol=2e-4)
    np.testing.assert_allclose(even.yy, ratio * default.structure.yy, rtol=2e-4)
    text = re.sub(r"0\.\d+$", "0.15,1", CSV, flags=re.MULTILINE)
    (tmp_path / "same.csv").write_text(text.replace("t_over_c", "T_over_C,thicknes"))
    same = turbine("blade: same.csv, radius: 1")
    assert same.structure.section_area == foil.area
    assert any("thicknes is not read; did you mean" in text for text in same.messages)


def test_a_thickness_beside_other_sections_is_told_not_to_count(turbine, tmp_path):
    rows = NAMED.replace("section", "section,t_over_c").replace(",a\n", ",a,0.4\n")
    (tmp_path / "both.csv").write_text(rows.replace(",b\n", ",b,0.15\n"))
    sections = f"sections: [{THICK[:-1]}, name: a}}, {THIN[:-1]}, name: b}}]"
    text = "thickness is 15 to 40 % in the blade's file, but 15 to 24 % of the sections"
    assert text in str(turbine(f"blade: both.csv, radius: 1, {sections}").messages)


def test_polars_of_a_turbine_file_need_no_reynolds_number(turbine, tmp_path):
    low, high = WINDIO, WINDIO.replace("re: 1.0e+6", "re: 9.0e+6")
    start = low.index("          - re: 1.0e+6")
    one = low[start : low.index("  - name: thin")]
    two = high[start : high.index("  - name: thin")].replace("0.01, 0.01", "0.03, 0.03")
    (tmp_path / "t.yaml").write_text(low.replace(one, one + two), encoding="utf-8")
    rotor = turbine("blade: t.yaml, station_count: 5")
    assert any("are read at a Reynolds number of 3e+06" in line for line in rotor.messages)
    reference = turbine("blade: t.yaml, station_count: 5, reynolds_number: 3e6")
    for (one,), (other,) in zip(rotor.polar.tables, reference.polar.tables, strict=True):
        assert one.evaluate(0.05) == other.evaluate(0.05)
    ((first,), *_) = rotor.polar.tables
    assert first.evaluate(0.0)[1] > 0.011  # between both tables of the thick section
    assert "chooses no polar" not in str(reference.messages)
    (tmp_path / "t.yaml").write_text(low, encoding="utf-8")
    single = turbine("blade: t.yaml, station_count: 5, reynolds_number: 3e6")
    assert "rotor.reynolds_number = 3e+06 chooses no polar" in str(single.messages)
    named = turbine("blade: t.yaml, station_count: 5, outline: naca4415")  # of one that has none
    assert [x.shape for x in named.sections] == [x.shape or "naca4415" for x in single.sections]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("blade: b.csv", "b.csv: tip radius: does not contain the tip radius; give rotor.radius"),
        ("blade: a.dat", "a.dat: measures its span from the root .*hub_radius_fraction"),
        ("blade: b.csv, radius: 0.9", "reaches beyond the rotor's tip radius of 0.9 m"),
        (
            "blade: b.csv, radius: 1, hub_radius_fraction: 0.5",
            r"has 2 rows between .*; give rotor\.station_count",
        ),
        (
            "blade: b.csv, radius: 1, stations: [0.1, 0.5, 0.9]",
            r"stations\[0\] = 0.1: .* within the hub",
        ),
        ("blade: lone.csv, radius: 1", "names the sections a, which nothing describes; give rotor"),
        (
            "blade: n.csv, radius: 1",
            "n.csv: names the sections a, b, .*; give rotor.sections, one for",
        ),
        (
            f"blade: n.csv, radius: 1, sections: [{THIN}, {THICK}]",
            "names the section a, .*; known: 1, 2",
        ),
        (
            f"blade: b.csv, radius: 1, sections: [{THIN}, {THIN}]",
            "has two sections of one thickness",
        ),
    ],
)
def test_what_does_not_fit_together_is_reported(keys, message, turbine):
    with pytest.raises(InputError, match=message):
        turbine(keys)


@pytest.mark.parametrize(
    ("keys", "bounds"),
    [
        ("", (0.01, 1.0)),  # the paper's rotor
        ("rotor: {radius: 1400 mm}", (0.01, 1.0)),
        ("rotor: {radius: 14}", None),
        ("rotor: {blade: rm1}", None),
        ("rotor: {blade: river, radius: 1.6}", None),
        ("rotor: {blade: rm1}, design: {chord_bounds: [0.3, 2.5]}", (0.3, 2.5)),
        ("rotor: {blade: rm1}, design: {blade: fixed}", None),
    ],
)
def test_bounds_of_the_chord_follow_the_blade(keys, bounds):
    case = read_case(f"{{inflow: sine, control: linear, {keys}}}")
    model = physics(case)
    chord = model.turbine.blade.chord
    bounds = bounds or (0.2 * chord.min(), 3.0 * chord.max())
    if case.design.blade == "fixed":
        assert model.case.design.chord_bounds is None
        return
    assert model.shape.bounds["chord"] == pytest.approx(bounds, rel=0.005)  # three digits
    again = physics(read_case(model.case.to_yaml()))  # a result's case has the numbers
    assert again.case.design == model.case.design
