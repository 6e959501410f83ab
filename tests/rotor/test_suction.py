"""Suction of sections over the angle of attack: smooth curves of both surfaces, along a blade."""

import importlib
from types import SimpleNamespace

import numpy as np
import pytest
from study_common import shipped_table

from hkt_mdo.errors import InputError
from hkt_mdo.files.polar_table import SURFACES, polar_table
from hkt_mdo.files.shipped import POLAR_FAMILIES, locate, shipped_names
from hkt_mdo.files.table import array_columns
from hkt_mdo.rotor.airfoil import Polar, PolarFamily
from hkt_mdo.rotor.polars import ByStation
from hkt_mdo.rotor.suction import split_at_kink
from tests.rotor.test_airfoil import assert_smooth

ALPHA = np.arange(-12.0, 16.5, 0.5)  # deg


def upper(alpha):
    return 1.0 + 0.11 * alpha + 0.004 * alpha**2


def lower(alpha):
    return 0.7 - 0.12 * alpha + 0.005 * alpha**2


def table(pressure, alpha=ALPHA):
    columns = {"cl": 0.1 * alpha, "cd": np.full(alpha.size, 0.02)} | pressure
    return polar_table(array_columns(alpha_deg=alpha, **columns))


@pytest.fixture(scope="module", params=[*shipped_names("polar"), "both surfaces in one"])
def polar(request):
    if request.param in shipped_names("polar"):
        return PolarFamily.from_file(request.param).polars[0]
    return Polar.from_polar_table(table({"cpmin": -np.maximum(upper(ALPHA), lower(ALPHA))}))


# Smooth curves


def test_curves_and_two_derivatives_are_continuous_everywhere(polar):
    assert_smooth(polar.suction, 1e-11)


def test_slopes_are_those_of_the_values_at_angles_of_any_shape(polar):
    alpha = np.linspace(-7.0, 7.0, 24).reshape(2, 3, 4)
    value, slope = polar.suction_at(alpha)
    assert value.shape == slope.shape == (2, 2, 3, 4)
    complex_value, complex_slope = polar.suction_at(alpha + 1e-30j)
    assert np.array_equal(complex_value.real, value)
    assert np.allclose(slope, complex_value.imag / 1e-30, rtol=1e-12, atol=1e-12)
    assert np.array_equal(complex_slope.real, slope)
    assert polar.suction_at(0.1)[0].tolist() == polar.suction_at(np.array([0.1]))[0][:, 0].tolist()


@pytest.mark.parametrize("name", shipped_names("polar"))
def test_rows_are_interpolated_exactly(name):
    rows = shipped_table(name, "polar")
    near = np.abs(rows["alpha_deg"]) <= 90.0
    (member,) = PolarFamily.from_file(name).polars
    suction, _ = member.suction_at(np.deg2rad(rows["alpha_deg"][near]))
    assert np.allclose(suction, -np.stack([rows[each][near] for each in SURFACES]), atol=1e-11)


@pytest.mark.parametrize("name", POLAR_FAMILIES)
def test_beyond_the_table_the_curves_come_to_rest(name):
    """Within two degrees' worth of the last slope, then constant to 100 degrees."""
    for member in PolarFamily.from_file(name).polars:
        for edge, way in ((member.alpha_min, -1.0), (member.alpha_max, 1.0)):
            value, slope = member.suction_at(edge)
            beyond = member.suction_at(edge + way * np.deg2rad(np.linspace(0.0, 70.0, 281)))[0]
            room = np.deg2rad(2.5) * np.abs(slope) + 0.05
            assert np.all(np.abs(beyond.T - value) <= room)
            assert np.allclose(beyond[:, -40:], beyond[:, -1:], atol=0.01)
        assert np.min(member.suction_at(np.linspace(-np.pi, np.pi, 2001))[0]) > -1.01


# One column for both surfaces


def test_kink_is_split_into_the_two_curves_that_make_it():
    upper_curve, lower_curve = upper(ALPHA), lower(ALPHA)
    both = np.maximum(upper_curve, lower_curve)
    parts = split_at_kink(np.deg2rad(ALPHA), both)
    assert np.array_equal(parts.max(axis=0), both)
    right = upper_curve >= lower_curve
    assert np.array_equal(parts[0][right], upper_curve[right])
    assert np.array_equal(parts[1][~right], lower_curve[~right])
    near = np.abs(ALPHA) < 4.0  # continued with the right slope, too
    assert np.allclose(parts[0][near], upper_curve[near], atol=0.15)
    assert np.allclose(parts[1][near], lower_curve[near], atol=0.15)
    assert np.all(np.diff(parts[0][~right]) > 0.0)
    assert np.all(np.diff(parts[1][right]) < 0.0)
    assert parts.min() > -1.0


@pytest.mark.parametrize("shift", np.linspace(0.0, 0.5, 6))
def test_split_polar_has_the_kink_between_the_curves_alone(shift):
    """Wherever the kink lies between two rows: the larger of both is the table's at its rows, and
    between the rows neither curve leaves the larger of the true ones by more than the kink's gap.
    """
    both = np.maximum(upper(ALPHA + shift), lower(ALPHA + shift))
    split = Polar.from_polar_table(table({"cpmin": -both}))
    assert np.allclose(split.suction_at(np.deg2rad(ALPHA))[0].max(axis=0), both, atol=1e-12)
    fine = np.linspace(ALPHA[0], ALPHA[-1], 2001)
    true = np.maximum(upper(fine + shift), lower(fine + shift))
    assert np.max(np.abs(split.suction_at(np.deg2rad(fine))[0].max(axis=0) - true)) < 0.03


def test_without_a_kink_both_surfaces_have_the_suction():
    alpha = np.deg2rad(ALPHA)
    for suction in (np.full(alpha.size, 3.0), 1.0 + alpha):
        assert np.array_equal(split_at_kink(alpha, suction), [suction, suction])


# Mixtures


def test_blend_is_linear_and_needs_both():
    one, other = PolarFamily.from_file("naca4415").polars[:2]
    alpha = np.linspace(-3.2, 3.2, 99)
    mixed = one.blend(other, 0.3).suction_at(alpha)[0]
    expected = 0.7 * one.suction_at(alpha)[0] + 0.3 * other.suction_at(alpha)[0]
    assert np.allclose(mixed, expected, atol=1e-13)
    without = Polar.from_polar_table(table({}))
    assert without.suction is None
    assert one.blend(without, 0.5).suction is without.blend(one, 0.5).suction is None


def test_along_a_blade_every_station_has_its_own_polar():
    family = PolarFamily.from_file("naca63815").polars
    angle = np.deg2rad(np.linspace(-4.0, 12.0, 12)).reshape(4, 3)
    blade, several = SimpleNamespace(r=np.ones(3)), ByStation.of(family[:3])
    for polar in (family[0], several):
        suction, by_angle, _ = polar.along("suction", blade, [5.0], angle)
        assert suction.shape == by_angle.shape == (2, 4, 3)
        for station in range(3):
            ((member,),) = polar.at_station(station).tables
            expected = member.suction_at(angle[:, station])
            assert np.array_equal((suction[..., station], by_angle[..., station]), expected)
    complex_step = several.along("suction", blade, [5.0], angle + 1e-30j)[0].imag / 1e-30
    assert np.allclose(by_angle, complex_step, rtol=1e-12, atol=1e-12)


def test_polar_without_suction_is_refused_with_the_remedy():
    without = Polar.from_polar_table(table({}))
    family = PolarFamily.from_file("naca63815")
    for polar in (without, ByStation.of((family.polars[0], without, family.polars[0]))):
        with pytest.raises(InputError, match=r"rotor\.polar .*cpmin_upper.*hkt polar"):
            polar.along("suction", None, None, np.zeros((2, 3)))
    with pytest.raises(InputError, match="cpmin"):
        without.suction_at(0.1)


# The shipped columns


def test_shipped_columns_are_what_the_script_computes():
    script = importlib.import_module("polar_suction")
    computed = script.pressures()
    assert sorted(computed) == sorted(shipped_names("polar"))
    for name, pressure in computed.items():
        rows = shipped_table(name, "polar")
        assert np.allclose(np.stack([rows[each] for each in SURFACES]), pressure, atol=2e-4)
        text = locate(name, "polar").read_text(encoding="utf-8")
        again = script.with_pressures(text, -np.ones_like(pressure))
        for line, new in zip(text.splitlines(), again.splitlines(), strict=True):
            assert line.split(",")[:4] == new.split(",")[:4]
