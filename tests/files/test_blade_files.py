"""Blade files: what is read is what the file says, in every format."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hkt_mdo.case import load_case
from hkt_mdo.errors import InputError
from hkt_mdo.files.blade import read_blade, write_blade_csv
from hkt_mdo.files.blade_table import BladeTable, SectionTable
from hkt_mdo.problem.physics import physics
from tests.files.broken.blades import AERODYN, CSV, WINDIO
from tests.properties import examples

METRES = "r_m,chord_m,twist_rad\n0.5,0.25,0.5\n1,0.125,0.25\n"


def changed(text, changes):
    """Return a text with other parts in place of those it has."""
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return text


# --- theory: units, and what is the same blade in another unit -----------------------------------


def test_the_same_blade_in_other_units(put):
    metres = read_blade(put("m.csv", METRES))
    others = {
        "mm.csv": "r_mm,chord_mm,twist_rad\n500,250,0.5\n1000,125,0.25\n",
        "deg.csv": "r_m,chord_mm,twist_deg\n.5,2.5e2,28.64788975654116\n1,125,14.32394487827058\n",
        "order.csv": "# a remark\n\ntwist_rad,weight,r_m,chord_m\n0.5,x,+0.5,0.25\n.25,,1.,0.125\n",
    }
    for name, text in others.items():
        other = read_blade(put(name, text))
        np.testing.assert_array_equal(other.r, metres.r)
        np.testing.assert_array_equal(other.chord, metres.chord)
        np.testing.assert_allclose(other.twist, metres.twist, rtol=4e-16)
    relative = read_blade(put("R.csv", "r_over_R,c_over_R,twist_rad\n.25,.125,.5\n.5,.0625,.25\n"))
    assert relative.relative
    doubled = relative.scaled(2.0)
    np.testing.assert_array_equal(doubled.r, metres.r)
    np.testing.assert_array_equal(doubled.chord, metres.chord)
    assert doubled.tip_radius == 2.0
    assert not doubled.relative


def test_sections_of_a_csv(put):
    text = 'r_m,chord_m,twist_rad,t_over_c,section\n.5,.2,0,.24,"a, b"\n1,.1,0,.12,tip\n'
    table = read_blade(put("a.csv", text))
    assert table.section == ("a, b", "tip")
    np.testing.assert_array_equal(table.thickness, [0.24, 0.12])
    inner, outer, shares = zip(*table.blend([0.4, 0.5, 0.625, 1.0, 2.0]), strict=True)
    assert inner == ("a, b", "a, b", "a, b", "a, b", "tip")
    assert outer == ("a, b", "a, b", "tip", "tip", "tip")
    assert shares == (0.0, 0.0, 0.25, 1.0, 0.0)


def test_sections_are_blended_by_thickness():
    # thickness falls from 0.4 to 0.2 in the first tenth of the span, then stays
    sections = (SectionTable("thick", 0.4, ()), SectionTable("thin", 0.2, ()))
    r, position = np.array([0.0, 0.1, 1.0]), (("thick", 0.0), ("thin", 1.0))
    plain = BladeTable(r, np.ones(3), np.zeros(3), sections=sections, section_position=position)
    table = replace(plain, thickness=np.array([0.4, 0.2, 0.2]))
    shares = [share for _, _, share in table.blend([0.0, 0.05, 0.1, 0.7, 1.0])]
    np.testing.assert_allclose(shares, [0.0, 0.5, 1.0, 1.0, 1.0], rtol=1e-14)
    np.testing.assert_allclose([share for _, _, share in plain.blend([0.05, 0.7])], [0.05, 0.7])


@examples(200)
@given(
    data=st.lists(
        st.tuples(st.floats(1e-3, 1e3), st.floats(1e-300, 1e-3), st.floats(-np.pi, np.pi)),
        min_size=2,
        max_size=20,
        unique_by=lambda row: row[0],
    )
)
def test_what_is_written_reads_back_bit_by_bit(data, tmp_path_factory):
    r, chord, twist = np.array(sorted(data)).T
    path = tmp_path_factory.mktemp("blade") / "blade.csv"
    blade = BladeTable(r, chord, twist, thickness=0.4 + 0.1 * twist)
    write_blade_csv(path, blade, blade.thickness, ["a remark", "two\nlines"])
    back = read_blade(path)
    for name in ("r", "chord", "twist", "thickness"):
        assert getattr(back, name).tobytes() == getattr(blade, name).tobytes()
    assert back.messages == ()
    assert not list(path.parent.glob("*.part"))


def test_what_cannot_be_written_is_said(tmp_path, put):
    table = read_blade(put("m.csv", METRES))
    with pytest.raises(InputError, match="cannot be written"):
        write_blade_csv(tmp_path / "no" / "b.csv", table, table.chord, [])


# --- radii: scaling, hub and tip -----------------------------------------------------------------


def aerodyn(put, rows):
    """Write rows below the head of the sound file."""
    head = "\n".join(AERODYN.splitlines()[:6])
    head = changed(head, {"4   Num": f"{len(rows.splitlines())}   Num"})
    return put("blade.dat", f"{head}\n{rows}\n")


def test_metres_without_a_tip_stay_metres(put):
    table = read_blade(put("m.csv", METRES))
    np.testing.assert_array_equal(table.scaled(1.1).r, table.r)
    assert table.scaled(1.1).tip_radius == 1.1
    with pytest.raises(InputError, match=r"m\.csv.*beyond the rotor's tip radius of 0\.9 m"):
        table.scaled(0.9)


def test_interior_rows_lie_between_hub_and_tip():
    table = read_blade("bahaj2007").scaled(1.4)
    assert table.interior(0.125 * 1.4)[0] == pytest.approx(0.28)
    inner = table.interior(0.2 * 1.4)
    assert inner[[0, -1]] == pytest.approx([0.25 * 1.4, 0.95 * 1.4])
    assert inner.size == 15
    assert not table.interior(1.39).size


# --- published files -----------------------------------------------------------------------------


def test_an_aerodyn_blade_counts_from_the_root(put):
    rows = "0.0E+00 0 0 0 1.3308000E+01 3.542 1\n1.3667D+00 0 0 0 13.308 3.542 1\n"
    table = read_blade(aerodyn(put, rows + "4.1 0 0 0 13.308 3.854 3 ! remark"))
    np.testing.assert_array_equal(table.r, [0.0, 1.3667, 4.1])
    np.testing.assert_array_equal(table.twist, np.deg2rad([13.308] * 3))
    assert table.section == ("1", "1", "3")
    assert (table.hub_radius, table.tip_radius) == (0.0, 4.1)
    np.testing.assert_array_equal(table.interior(0.0), [1.3667])


def test_aerodyn_columns_go_by_name_not_by_place(put):
    # OpenFAST 4 with the columns of a marine turbine; t_c = 0 stands for 'not given'
    newer = """------- AERODYN v15.00.* BLADE DEFINITION INPUT FILE ----
Marine turbine
======  Blade Properties ================================
2        NumBlNds    - Number of blade nodes used in the analysis (-)
BlSpn BlCrvAC BlSwpAC BlCrvAng BlTwist BlChord BlAFID t_c BlCb   BlCenBn BlCenBt BlCpn
(m)   (m)     (m)     (deg)    (deg)   (m)     (-)    (-) (-)    (m)     (m)     (-)
0.0   0.00    0.00    0.00     12.86   0.8     1      0.0 0.9956 0.0     0.0     0.0
9.0   0.00    0.00    0.00     2.18    0.626   9      0.0 0.1870 0.0097  0.05088 0.0

! what follows the promised rows is passed over
9.1   0.00    0.00    0.00     2.18    0.626   9      0.0 0.1870 0.0097  0.05088 0.0
"""
    table = read_blade(put("marine.dat", newer))
    np.testing.assert_array_equal(table.chord, [0.8, 0.626])
    assert table.thickness is None
    assert any("t_c" in message for message in table.messages)
    assert any("1 rows after these are ignored" in message for message in table.messages)
    swapped = {"BlTwist BlChord": "BlChord BlTwist", "(deg)   (m) ": "(m) (deg)   "}
    swapped |= {"12.86   0.8": "0.8 12.86", "2.18    0.626": "0.626 2.18"}
    other = read_blade(put("swapped.dat", changed(newer, swapped)))
    np.testing.assert_array_equal(other.chord, table.chord)
    np.testing.assert_array_equal(other.twist, table.twist)


def test_prebend_sweep_and_layers_are_not_ignored_silently(put):
    rows = "0 0 0 0 10 .3 1\n1 -.25 0.5 -3 5 .2 1"
    layers = WINDIO.replace("    blade:\n", "    blade:\n        structure: {layers: []}\n", 1)
    said = read_blade(put("layers.yaml", layers)).messages
    assert any("blade.structure: webs and layers are not read" in each for each in said)
    messages = " ".join(read_blade(aerodyn(put, rows)).messages)
    assert "BlCrvAC: prebend of up to 0.25 m" in messages
    assert "BlSwpAC: sweep of up to 0.5 m" in messages
    assert "BlCrvAng: cant angle of up to 3 deg" in messages
    assert "straight blade" in messages


def test_windio_says_more_than_rows(put):
    table = read_blade(put("a.yaml", WINDIO))
    np.testing.assert_allclose(table.r, 0.175 + 1.225 * np.array([0.0, 0.3, 0.7, 1.0]), rtol=1e-15)
    assert (table.hub_radius, table.blade_count, table.tip_radius) == (0.175, 3, 0.175 + 1.225)
    assert table.cone == pytest.approx(np.deg2rad(2.5), rel=1e-15)
    np.testing.assert_array_equal(table.thickness, [0.24, 0.18, 0.15, 0.12])
    assert table.section_position == (("thick", 0.175), ("thin", table.tip_radius))
    thick, thin = table.sections
    assert (thick.name, thick.thickness, thin.name, thin.thickness) == ("thick", 0.24, "thin", 0.12)
    assert [values.size for values in thick.outline] == [11, 11]
    assert not thin.outline
    (polar,) = thick.polars
    assert polar.full_circle
    assert polar.reynolds == 1e6
    assert polar.lift[np.argmin(np.abs(polar.alpha - np.deg2rad(5.0)))] == 0.7
    # 2 (0.175 + 1.225) cos 2.5 deg is not quite what the file says
    assert any("rotor_diameter = 2.8 m" in message for message in table.messages)
    shares = [share for _, _, share in table.blend(table.r)]
    np.testing.assert_allclose(shares, [0.0, 0.5, 0.75, 1.0], rtol=1e-14)


def test_windio_1_counts_in_radians(put):
    def radians(numbers):
        return str([float(np.deg2rad(number)) for number in numbers])

    text = changed(WINDIO, {"outer_shape:": "outer_shape_bem:", "2.5": "0.04363323129985824"})
    text = changed(text, {"[20.0, 9.0, 4.0, 1.0]": radians([20.0, 9.0, 4.0, 1.0])})
    start, end = text.index("            airfoils:"), text.index("    hub:")
    position = "            airfoil_position: {grid: [0.0, 1.0], labels: [thick, thin]}\n"
    text = text[:start] + position + text[end:]
    head, library = text.split("\nairfoils:")
    degrees = library[library.index("[-180") : library.index("], values") + 1]
    library = library.replace(degrees, radians(json.loads(degrees)))
    names = {"        re_sets:\n          - re:": "        re:", "rthick": "relative_thickness"}
    names |= {"            cl:": "        c_l:", "            cd:": "        c_d:"}
    library = changed(library, names)
    old = read_blade(put("old.yaml", f"{head}\nairfoils:{library}"))
    new = read_blade(put("new.yaml", WINDIO))
    for name in ("r", "chord", "twist", "thickness"):
        np.testing.assert_allclose(getattr(old, name), getattr(new, name), rtol=1e-15)
    assert old.cone == pytest.approx(new.cone, rel=1e-15)
    assert old.section_position == new.section_position
    for one, other in zip(old.sections, new.sections, strict=True):
        np.testing.assert_allclose(one.polars[0].alpha, other.polars[0].alpha, rtol=1e-15)
        np.testing.assert_array_equal(one.polars[0].lift, other.polars[0].lift)


def test_windio_grids_of_their_own(put):
    # a chord given at root and tip only is linear: its value at the twist's grid is known
    grid, straight = "grid: &grid [0.0, 0.3, 0.7, 1.0]", "x: {grid: [0.0, 1.0], values: [0.0, 0.0]}"
    ends = {f"chord:\n                {grid}": "chord:\n                grid: [0.0, 1.0]"}
    text = changed(WINDIO, ends | {"[0.18, 0.12, 0.09, 0.06]": "[0.2, 0.1]"})
    text = text.replace("grid: *grid", grid, 1)
    bent = changed(text, {straight: "x: {grid: [0, 1], values: [0, -0.5]}"})
    table = read_blade(put("a.yaml", bent))
    np.testing.assert_allclose(table.chord, [0.2, 0.17, 0.13, 0.1], rtol=1e-14)
    assert any("different grids" in message for message in table.messages)
    assert any("prebend of up to 0.5 m is ignored" in message for message in table.messages)
    # without rthick the thickness is linear between the sections
    start = text.index("            rthick:")
    bare = text[:start] + text[text.index("            airfoils:") :]
    expected = 0.24 - 0.12 * np.array([0.0, 0.3, 0.7, 1.0])
    np.testing.assert_allclose(read_blade(put("b.yaml", bare)).thickness, expected)


def test_a_reference_turbine_reads_as_it_is_published():
    """IEA Wind 15 MW (Gaertner et al., NREL/TP-5000-75698): hub 7.94 m, blade 117 m, cone 4 deg."""
    examples = pytest.importorskip("windIO.examples")
    path = Path(examples.__file__).parent / "turbine" / "IEA-15-240-RWT.yaml"
    if not path.is_file():
        pytest.skip("this windIO comes without the turbine")
    table = read_blade(path)
    assert table.hub_radius == pytest.approx(3.97)
    assert table.tip_radius == pytest.approx(120.97)
    assert table.blade_count == 3
    assert np.rad2deg(table.cone) == pytest.approx(4.0)
    assert table.chord.max() == pytest.approx(5.77, abs=0.01)
    assert np.rad2deg(table.twist[0]) == pytest.approx(15.6, abs=0.01)
    assert table.thickness[0] == 1.0
    assert [section.name for section in table.sections][-1] == "FFA-W3-211"
    assert all(polar.full_circle for section in table.sections for polar in section.polars)
    assert any("prebend of up to 4 m" in message for message in table.messages)


def test_the_sound_files_are_one_blade(put):
    for suffix, text, hub in (("csv", CSV, 0.0), ("dat", AERODYN, 0.175), ("yaml", WINDIO, 0.0)):
        table = read_blade(put(f"sound.{suffix}", text))
        np.testing.assert_allclose(table.chord, [0.18, 0.12, 0.09, 0.06], rtol=1e-15)
        np.testing.assert_allclose(np.rad2deg(table.twist), [20, 9, 4, 1], rtol=1e-15)
        assert table.r[-1] + hub == pytest.approx(1.4, rel=1e-15)


@pytest.mark.parametrize("path", ["", "no such file.csv", "\0", "x" * 5000, "."])
def test_a_path_that_is_no_file(path):
    with pytest.raises(InputError, match="shipped: bahaj2007"):
        read_blade(path)


def test_radians_below_the_name_of_degrees_are_suspected(put):
    path = put("b.csv", "r_m,chord_m,twist_deg\n0.2,0.2,0.4\n0.6,0.15,0.2\n1.0,0.1,0.05\n")
    message = r"b\.csv: twist_deg is in degrees, and no value is above 0\.4: .* twist_rad"
    rotor = {"blade": str(path), "radius": 1.0, "station_count": 5}
    warned = physics(load_case({"rotor": rotor, "inflow": "sine", "control": "linear"})).warnings
    assert any(re.search(message, text) for text in warned)
    for text in ("twist_rad\n0.2,0.2,0.4\n1.0,0.1,0.05\n", "twist_deg\n0.2,0.2,0\n1,0.1,0\n"):
        assert not read_blade(put("b.csv", f"r_m,chord_m,{text}")).doubts


def test_a_written_blade_has_the_twist_in_degrees_too(tmp_path, put):
    path, blade = tmp_path / "b.csv", read_blade(put("m.csv", METRES))
    write_blade_csv(path, blade, blade.chord, [])
    header, *rows = [line.split(",") for line in path.read_text().splitlines()]
    assert header == ["r_m", "chord_m", "twist_deg", "twist_rad", "thickness_over_chord"]
    assert [float(row[2]) for row in rows] == np.rad2deg(blade.twist).tolist()
    path.write_text(path.read_text().replace(rows[1][2], "7.5"))
    with pytest.raises(InputError, match=r"line 3, column twist_deg = '7.5': is not twist_rad in"):
        read_blade(path)
