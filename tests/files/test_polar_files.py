"""Polar files: three formats, one content; what a family of Reynolds numbers is."""

import numpy as np
import pytest

from hkt_mdo.errors import InputError
from hkt_mdo.files.polar import read_polars
from hkt_mdo.files.polar_table import polar_table
from hkt_mdo.files.table import array_columns
from hkt_mdo.rotor.airfoil import Polar, PolarFamily
from tests.files.broken.polars import DATA

ALPHA = np.arange(-8.0, 17.0)  # deg
REYNOLDS = 2e5, 1e6


def lift(alpha, reynolds):
    return np.round(0.3 + 0.1 * alpha * (1.0 + 0.01 * np.log10(reynolds)), 4)


def drag(alpha, reynolds):
    return np.round(0.05 / np.log10(reynolds) + 1e-4 * alpha**2, 5)


def moment(alpha, reynolds):
    return np.round(-0.08 + 0.0 * reynolds - 1e-3 * alpha, 4)


def pressure(alpha, reynolds, below=0.0):
    return np.round(-1.0 - 0.1 * np.abs(alpha + 2.0) - 1e-7 * reynolds - below, 4)


CURVES = lift, drag, moment
ALL = (*CURVES, pressure)


def rows(alpha, reynolds, curves=CURVES):
    return zip(alpha, *(curve(alpha, reynolds) for curve in curves), strict=True)


def csv_text(angle="alpha_deg", surfaces=()):
    """Return polars in CSV; the pressure of each of the surfaces is 0.1 above that of the last."""
    text = ["# a remark", ",".join(["reynolds", angle, "cl,cd,cm,confidence", *surfaces]), ""]
    for reynolds in reversed(REYNOLDS):
        for a, cl, cd, cm in rows(ALPHA, reynolds):
            value = f"{a:g}" if angle == "alpha_deg" else f"{np.deg2rad(a):.17g}"
            lowest = (pressure(a, reynolds, -0.1 * index) for index in range(len(surfaces)))
            text.append(",".join(map(str, [f"{reynolds:g}", value, cl, cd, cm, 0.9, *lowest])))
    return "\n".join(text) + "\n"


def aerodyn_text(reynolds=REYNOLDS, names="Alpha Cl Cd Cm", unsteady=True, curves=CURVES):
    text = [
        "! ------------ AirfoilInfo v1.01.x Input File ----------",
        '"DEFAULT"  InterpOrd   ! order',
        "1.0  NonDimArea",
        "2  NumCoords ! the shape",
        "! x-y coordinates",
        "0.25 0.0",
        "1.0  0.0",
        '"unused"  BL_file',
        f"{len(reynolds)}  NumTabs  ! how many",
    ]
    for number in reynolds:
        text += [
            "! data of a table",
            f"  {number / 1e6:.3f}  Re  ! in millions",
            "  0  UserProp",
            f"{unsteady}  InclUAdata",
        ]
        if unsteady:
            text += ["  -3.2  alpha0 ! zero lift", '"DEFAULT"  filtCutOff ! (Hz)', "!......"]
        text += [f"{len(ALPHA)}  NumAlf", f"! {names}", "! (deg) (-) (-) (-)"]
        text += [" ".join(map(str, row)) for row in rows(ALPHA, number, curves)]
    return "\n".join(text) + "\n"


def xfoil_text(with_pressure=False):
    """Return polars below the head that the program writes, of a sound file."""
    text, head = [], (DATA / "section.pol").read_text().splitlines()[:12]
    for number in REYNOLDS:
        head[8] = f" Mach =   0.000     Re = {number / 1e6:9.3f} e 6     Ncrit =   9.000  9.000"
        if with_pressure:
            head[10] = "   alpha    CL        CD       CDp       CM    Cpmin   Top_Xtr  Bot_Xtr"
        text += head
        for a, cl, cd, cm, lowest in rows(ALPHA, number, ALL):
            lowest = f"{lowest:9.4f}" if with_pressure else ""
            text.append(f"{a:8.3f}{cl:9.4f}{cd:10.5f}   0.00100{cm:9.4f}{lowest}   0.5000   1.0000")
    return "\r\n".join(text) + "\r\n"


FORMATS = {
    "csv": csv_text(),
    "csv in radians": csv_text("alpha_rad"),
    "aerodyn": aerodyn_text(),
    "aerodyn with Ctrl": aerodyn_text(unsteady=False).replace("UserProp", "Ctrl"),
    "aerodyn in Fortran's digits": aerodyn_text().replace("0.200  Re", "2.0D-01  re"),
    "aerodyn, shape elsewhere": aerodyn_text()
    .replace("2  NumCoords", '@"shape of it.txt"  NumCoords')
    .replace("0.25 0.0\n1.0  0.0\n", ""),
    "aerodyn, tables out of order": aerodyn_text(REYNOLDS[::-1]),
    "aerodyn, columns not named": aerodyn_text(names="rows"),
    "xfoil": xfoil_text(),
    "xflr5": xfoil_text()
    .replace("XFOIL         Version 6.99", "xflr5 v6.47")
    .replace("_Xtr", " Xtr"),
}


WITH_PRESSURE = {
    "csv": (csv_text(surfaces=["cpmin"]), 1),
    "csv, each surface": (csv_text(surfaces=["cpmin_upper", "cpmin_lower"]), 2),
    "csv, in another order": (csv_text(surfaces=["cpmin_upper", "cpmin_lower", "cpmin"]), 2),
    "aerodyn": (aerodyn_text(names="Alpha Cl Cd Cpmin", curves=(lift, drag, pressure)), 1),
    "aerodyn with the moment": (aerodyn_text(names="Alpha Cl Cd Cm Cpmin", curves=ALL), 1),
    "xfoil": (xfoil_text(with_pressure=True), 1),
}


def check(table, reynolds, with_moment=True):
    """Hold a table to the curves; AeroDyn's may have the lowest pressure in the moment's place."""
    assert table.reynolds == pytest.approx(reynolds, rel=1e-12)
    np.testing.assert_array_equal(table.lift, lift(ALPHA, reynolds))
    np.testing.assert_array_equal(table.drag, drag(ALPHA, reynolds))
    assert (table.moment is not None) == with_moment
    if with_moment:
        np.testing.assert_array_equal(table.moment, moment(ALPHA, reynolds))


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_tables(put, name):
    tables = read_polars(put("section.dat", FORMATS[name]))
    for table, reynolds in zip(tables, REYNOLDS, strict=True):
        assert np.allclose(table.alpha, np.deg2rad(ALPHA), rtol=0.0, atol=1e-15)
        check(table, reynolds)
        assert not table.full_circle


@pytest.mark.parametrize("name", WITH_PRESSURE)
def test_every_format_may_have_the_smallest_pressure(put, name):
    text, n_surfaces = WITH_PRESSURE[name]
    for table, reynolds in zip(read_polars(put("section.dat", text)), REYNOLDS, strict=True):
        expected = [pressure(ALPHA, reynolds, -0.1 * index) for index in range(n_surfaces)]
        assert np.allclose(table.smallest_pressure, expected, rtol=0.0, atol=1e-12)
        check(table, reynolds, with_moment=name != "aerodyn")
    with pytest.raises(InputError, match=r"cpmin_upper = .* exchange cpmin_upper and cpmin_lower"):
        read_polars(put("section.dat", csv_text(surfaces=["cpmin_lower", "cpmin_upper"])))


def text_of(head, row):
    """Return a polar's head, and its rows in a format."""
    return head + "".join(row.format(*values) for values in rows(ALPHA, 5e4))


AIRFOIL_TOOLS = text_of(
    "Xfoil polar. Reynolds number fixed. Mach  number fixed\n"
    "Polar key,xf-naca2408-il-50000\nAirfoil,naca2408-il\nReynolds number,50000\nNcrit,9\n"
    "Mach,0\nMax Cl/Cd,37.4214\n\nAlpha,Cl,Cd,Cdp,Cm,Top_Xtr,Bot_Xtr\n",
    "{:.3f},{},{},0.004,{},1.0,0.2\n",
)
XFLR5 = text_of(  # version 6.61, with two numbers more than names
    "xflr5 v6.61\n\n Calculated polar for: NACA 0012\n\n Mach = 0.000 Re = 0.050 e 6\n\n"
    "  alpha     CL        CD       CDp       Cm    Top Xtr Bot Xtr   Cpmin    Chinge"
    "    XCp\n ------- -------- ---------\n",
    " {:.3f} {} {} 0.003 {} 1.0 0.1 -1.5 0.0 0.0 0.0 0.3\n",
)


@pytest.mark.parametrize("text", [AIRFOIL_TOOLS, XFLR5], ids=["tools", "xflr5"])
def test_polars_of_airfoil_tools_and_xflr5(put, text):
    (table,) = read_polars(put("section.dat", text))
    check(table, 5e4)


def test_a_table_of_qblade_has_no_reynolds_number_and_may_repeat_a_row(put):
    lines = [f" {a:.3f} {cl} {cd}" for a, cl, cd, _ in rows(ALPHA, 5e4)]
    head = "made by hand\n\n1 Number of airfoil tables in this file\n0 Table ID parameter\n"
    text = "\n".join([*lines[:4], lines[3], *lines[4:]])
    (table,) = read_polars(put("section.dat", f"{head}12.0 Stall angle (deg)\n{text}\n"))
    assert table.reynolds is None
    np.testing.assert_array_equal(table.lift, lift(ALPHA, 5e4))
    assert "1 repeated rows are left out" in table.messages[0]


def test_airfoil_tools_must_say_the_reynolds_number(put):
    text = AIRFOIL_TOOLS.replace("number,50000", "number,fast")
    with pytest.raises(InputError, match=r"line 4, Re = 'fast': is no Reynolds"):
        read_polars(put("section.dat", text))


# Half of a symmetric section


def symmetric_text(first, camber=0.0, noise=0.0):
    """Return an XFOIL polar from `first` to 16 degrees of a section, symmetric without camber."""
    head = " XFOIL Version 6.99\n Calculated polar for: NACA 0018\n Mach = 0.0 Re = 0.500 e 6\n"
    text = [head + " alpha CL CD CDp CM Top_Xtr Bot_Xtr Cpmin\n ------ ---- ---- ----\n"]
    for angle in np.arange(first, 16.5):
        cl, cd = 0.1 * angle + camber + noise * (angle < 0.0), 0.01 + 1e-4 * angle**2
        text.append(f"{angle:.3f} {cl:.4f} {cd:.5f} 0 {0.001 * angle:.4f} 1 1 {-1 - abs(cl):.4f}\n")
    return "".join(text)


@pytest.mark.parametrize("first", [-2.0, -4.0, 0.0])
def test_half_of_a_symmetric_section_is_mirrored_and_reported(put, first):
    (table,) = read_polars(put("section.dat", symmetric_text(first, noise=0.002)))
    assert np.round(np.rad2deg(table.alpha), 9).tolist() == list(range(-16, 17))
    mirrored = slice(None, int(16 + first))
    for values, sign in ((table.lift, -1), (table.drag, 1), (table.moment, -1)):
        assert values[mirrored].tolist() == (sign * values[::-1])[mirrored].tolist()
    assert table.smallest_pressure[0].tolist() == table.smallest_pressure[0][::-1].tolist() or first
    (message,) = table.messages
    assert f"symmetric section, mirrored below {first:g} degrees" in message
    assert PolarFamily.from_tables([table]).messages == (message,)


@pytest.mark.parametrize("changes", [{"camber": 0.02}, {"noise": 0.02}, {"first": 1.0}])
def test_what_is_not_symmetric_is_not_mirrored(put, changes):
    with pytest.raises(InputError, match="must reach from -5 or less to 12 or more"):
        read_polars(put("section.dat", symmetric_text(**{"first": -2.0} | changes)))


def test_both_surfaces_change_places_in_the_mirror():
    alpha, upper, lower = np.arange(-2.0, 13.0), np.arange(-33.0, -18.0), np.arange(-17.0, -2.0)
    columns = {"cl": 0.1 * alpha, "cpmin_upper": upper, "cpmin_lower": lower}
    table = polar_table(array_columns(alpha_deg=alpha, cd=0.01 + 0.0 * alpha, **columns))
    at_5 = int(np.flatnonzero(np.isclose(table.alpha, np.deg2rad(-5.0)))[0])
    assert table.smallest_pressure[:, at_5].tolist() == [lower[7], upper[7]]


# Full circle


def circle_text(n_rows=73, gap=0.0):
    alpha = np.linspace(-180.0, 180.0, n_rows)
    cl = np.round(np.sin(2.0 * np.deg2rad(alpha)), 6)
    cl[-1] += gap
    cd = np.round(1.0 - 0.98 * np.cos(2.0 * np.deg2rad(alpha)), 6)
    lines = [f"{a:g},{left:.6f},{down:.6f}" for a, left, down in zip(alpha, cl, cd, strict=True)]
    return "\n".join(["alpha_deg,cl,cd", *lines]) + "\n"


def test_full_circle_is_used_as_it_is(put):
    (table,) = read_polars(put("section.dat", circle_text()))
    assert table.full_circle
    assert table.alpha[[0, -1]].tolist() == [-np.pi, np.pi]
    polar = Polar.from_polar_table(table)
    assert (polar.alpha_min, polar.alpha_max) == (-np.pi, np.pi)
    alpha = np.linspace(-4.0, 4.0, 999)
    cl, cd = polar.evaluate(alpha)
    assert np.allclose(cl, np.sin(2.0 * alpha), atol=1e-4)  # the spline's error at 5 degrees
    assert np.allclose(cd, 1.0 - 0.98 * np.cos(2.0 * alpha), atol=1e-4)


def test_a_table_up_to_right_angles_is_extended(put):
    header, *rows = circle_text().splitlines()
    for first, last in ((18, 55), (18, 41), (34, 55)):  # -90 or -10 to 90 or 20 degrees
        (table,) = read_polars(put("section.dat", "\n".join([header, *rows[first:last]])))
        alpha = np.deg2rad(5.0 * np.arange(first, last) - 180.0)
        cl, _ = Polar.from_polar_table(table).evaluate(alpha)
        assert np.allclose(cl, np.sin(2.0 * alpha), atol=1e-6)


def test_ends_of_a_full_circle_are_one_angle(put):
    with pytest.raises(InputError, match=r"line 74, column cl = .*differs.*one angle"):
        read_polars(put("section.dat", circle_text(gap=0.01)))
    rounded = circle_text(gap=0.004).replace("-180,", "-179.92,")
    ((alpha, lift),) = ((x.alpha, x.lift) for x in read_polars(put("section.dat", rounded)))
    assert [*alpha[[0, -1]], *lift[[0, -1]]] == pytest.approx([-np.pi, np.pi, 0.002, 0.002])


def test_cylinder_needs_but_its_ends(put):
    for angles in ((-180, 180), (-180, 0, 180)):
        text = "alpha_deg,cl,cd,cpmin\n" + "".join(f"{angle},0,0.5,0\n" for angle in angles)
        polar = PolarFamily.from_file(put("section.dat", text)).polars[0]
        cl, cd = polar.evaluate(np.linspace(-4.0, 4.0, 99))
        assert np.allclose(cl, 0.0, atol=1e-14)
        assert np.allclose(cd, 0.5, atol=1e-14)
        assert polar.suction is None
    with pytest.raises(InputError, match="at least 8"):
        read_polars(put("section.dat", text.replace("\n0,0,", "\n0,0.1,")))


# Blend and family


def test_family_is_linear_in_the_logarithm_and_clamped():
    family = PolarFamily.from_file("naca63815")
    for reynolds, polar in zip(family.reynolds, family.polars, strict=True):
        assert np.array_equal(family.at(reynolds).coefficients, polar.coefficients)
    assert family.at(1e3) is family.polars[0]
    assert family.at(1e8) is family.polars[-1]
    middle = family.at(np.sqrt(1e5 * 2e5)).coefficients  # half-way in the logarithm
    mean = 0.5 * (family.polars[0].coefficients + family.polars[1].coefficients)
    assert np.allclose(middle, mean, atol=1e-12)


# Curves that overshoot


def test_drag_that_dips_below_zero_between_rows_is_refused(put):
    """A spline through rows far apart may go where no row is."""
    angles = -10, -8, -6, -4, -2, 0, 2, 4, 14, 15
    drags = 0.9, 0.5, 0.3, 0.2, 0.1, 0.03, 0.01, 0.01, 0.9, 1.8
    lines = [f"{a},{0.05 * a},{cd}\n" for a, cd in zip(angles, drags, strict=True)]
    path = put("section.dat", "".join(["alpha_deg,cl,cd\n", *lines]))
    read_polars(path)  # the rows themselves are well
    with pytest.raises(InputError, match=r"section\.dat: .*drag coefficient of -.*add rows"):
        PolarFamily.from_file(path)


def test_rows_too_close_together_are_refused(put):
    angles = [*range(-8, 5), 4.0000001, *range(5, 17)]
    lines = [f"{a:.8g},{0.1 * a + 0.01 * (a != int(a)):.4f},1.0\n" for a in angles]
    with pytest.raises(InputError, match="too close together"):
        PolarFamily.from_file(put("section.dat", "".join(["alpha_deg,cl,cd\n", *lines])))
