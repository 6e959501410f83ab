"""Blade element momentum theory: theory, then CCBlade and published rotors, own past last."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hkt_mdo.files.shipped import shipped_names
from hkt_mdo.rotor import bem, ccblade
from hkt_mdo.rotor.airfoil import PolarFamily
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.polars import ByStation

POLARS = [PolarFamily.from_file(name).polars[0] for name in shipped_names("polar")]


@st.composite
def rotors(draw, wild=True):
    """Any rotor to cope with: 1 to 10 blades, solidity beyond 1, twist to +-90 degrees."""
    n = draw(st.integers(3, 8))

    def numbers(low, high):
        return np.array(draw(st.lists(st.floats(low, high), min_size=n, max_size=n)))

    tip_radius = draw(st.floats(0.1, 100.0))
    hub_radius = tip_radius * draw(st.floats(0.02, 0.5))
    share = np.clip((np.arange(n) + numbers(0.1, 0.9)) / n, 0.001, 0.999)
    chord = tip_radius * (np.exp(numbers(-6.0, 1.0)) if wild else numbers(0.02, 0.15))
    twist = np.deg2rad(numbers(-90.0, 90.0) if wild else np.sort(numbers(-5.0, 25.0))[::-1])
    r = hub_radius + share * (tip_radius - hub_radius)
    blade = Blade(r, chord, twist, hub_radius, tip_radius, draw(st.integers(1, 10)))
    return blade, draw(st.sampled_from(POLARS))


ratios = st.lists(st.floats(0.1, 30.0), min_size=1, max_size=6).map(np.array)


def station_of(blade, polar, j):
    """Return a station as the solver's inner functions take it."""
    rotor = (blade.r[j], blade.hub_radius, blade.tip_radius, blade.blade_count)
    return (blade.chord[j], blade.twist[j], *rotor, polar.coefficients)


def glauert_rotor(ratio, count=3000):
    """Return Glauert's optimum rotor with rotating wake, and its inflow angles; cl = 1 throughout.

    phi = 2/3 arctan(1 / lambda_r), B c cl / (2 pi r) = 4 (1 - cos(phi)).
    """
    r = np.linspace(0.02, 0.98, 4000)
    phi = 2.0 / 3.0 * np.arctan(1.0 / (ratio * r))
    chord = 8.0 * np.pi * r / count * (1.0 - np.cos(phi))
    return Blade(r, chord, phi - np.arcsin(1.0 / (2.0 * np.pi)), 0.001, 1.0, count), phi


# Theory


@pytest.mark.parametrize("angle", [-0.6, -0.1, 0.02, 0.1, 0.3, 0.8, 1.4, 1.8, 2.6])
def test_residual_is_nings(angle, polar):
    """His equations as printed: k, k', a with Buhl's quotient, two forms of the residual."""
    chord, twist, r, hub_radius, tip_radius, count = 0.25, 0.2, 0.7, 0.2, 1.4, 3
    lift, drag = polar.evaluate(angle - twist)
    sine, cosine = np.sin(angle), np.cos(angle)
    normal, tangential = lift * cosine + drag * sine, lift * sine - drag * cosine
    exponent = -count / 2.0 / abs(sine)
    tip = 2.0 / np.pi * np.arccos(np.exp(exponent * (tip_radius - r) / r))
    hub = 2.0 / np.pi * np.arccos(np.exp(exponent * (r - hub_radius) / hub_radius))
    loss, solidity = tip * hub, count * chord / (2.0 * np.pi * r)
    k = solidity * normal / (4.0 * loss * sine**2)
    k_prime = solidity * tangential / (4.0 * loss * sine * cosine)
    if k <= 2.0 / 3.0:
        induction = k / (1.0 + k)
    else:
        g1 = 2.0 * loss * k - (10.0 / 9.0 - loss)
        g2 = 2.0 * loss * k - loss * (4.0 / 3.0 - loss)
        g3 = 2.0 * loss * k - (25.0 / 9.0 - 2.0 * loss)
        induction = (g1 - np.sqrt(g2)) / g3
    for lambda_r in (0.3, 2.0, 8.0):
        first = sine * (1.0 - k) if angle < 0.0 else sine / (1.0 - induction)
        expected = first - cosine / lambda_r * (1.0 - k_prime)
        station = (chord, twist, r, hub_radius, tip_radius, count, polar.coefficients)
        s, c, _, _ = bem._terms(angle, *station)[0]
        assert s - c / lambda_r == pytest.approx(expected, rel=1e-11, abs=1e-11)


def test_momentum_and_blade_element_agree_at_every_root(blade, polar):
    """Thrust and torque of an annulus are those of its momentum; velocities form a triangle."""
    ratio = np.linspace(2.0, 14.0, 49)
    sections = bem.sections(blade, polar, ratio)
    lambda_r = ratio[:, None] * blade.r / blade.tip_radius
    a, a_prime, phi = sections.axial_induction, sections.tangential_induction, sections.inflow_angle
    along, around = 1.0 - a, lambda_r * (1.0 + a_prime)
    assert np.allclose(np.tan(phi), along / around, rtol=1e-11)
    assert np.allclose(sections.relative_speed, np.hypot(along, around), rtol=1e-11)
    exponent = 0.5 * blade.blade_count / np.sin(phi)
    tip = np.arccos(np.exp(-exponent * (blade.tip_radius - blade.r) / blade.r))
    hub = np.arccos(np.exp(-exponent * (blade.r - blade.hub_radius) / blade.hub_radius))
    loss = (2.0 / np.pi) ** 2 * tip * hub
    annulus = 2.0 * np.pi * blade.r
    turning = 4.0 * loss * a_prime * (1.0 - a) * lambda_r * annulus
    assert np.allclose(blade.blade_count * sections.tangential_load, turning, atol=1e-11)
    thrust = np.where(
        sections.branch == 0,
        4.0 * loss * a * (1.0 - a),
        8.0 / 9.0 + (4.0 * loss - 40.0 / 9.0) * a + (50.0 / 9.0 - 4.0 * loss) * a**2,  # Buhl 2005
    )
    assert set(sections.branch.ravel()) == {0, 1}
    assert np.allclose(blade.blade_count * sections.normal_load, thrust * annulus, rtol=1e-10)


@pytest.mark.parametrize("ratio", [0.5, 1.0, 3.0, 8.0])
def test_glauerts_rotor(ratio, ideal_polar):
    """Without drag and with very many blades roots and power are those of Glauert's theory."""
    blade, phi = glauert_rotor(ratio)
    sections = bem.sections(blade, ideal_polar, ratio)
    middle = (blade.r > 0.03) & (blade.r < 0.95)  # elsewhere the losses are felt
    assert np.allclose(sections.inflow_angle[0, middle], phi[middle], atol=1e-7)
    k = (1.0 - np.cos(phi)) * np.cos(phi) / np.sin(phi) ** 2
    assert np.allclose(sections.axial_induction[0, middle], (k / (1.0 + k))[middle], atol=1e-7)
    # The annulus' power is the integrand of Wilson's and Lissaman's power coefficient
    lambda_r, sine, cosine = ratio * blade.r, np.sin(phi), np.cos(phi)
    share = 4.0 * sine**2 * (cosine - lambda_r * sine) * (sine + lambda_r * cosine) * lambda_r
    bem_share = blade.blade_count * sections.tangential_load[0] * ratio / (2.0 * np.pi)
    assert np.allclose(bem_share[middle], share[middle], atol=1e-7)


@given(rotor=rotors(), ratio=ratios)
def test_every_section_with_drag_has_a_root(rotor, ratio):
    """With cd > 0 a root with 0 < phi < 180 degrees and W > 0 exists always (docs/studies/bem.md).

    It is one to the last digits, nothing is NaN, and the power stays below Betz' limit for the
    annuli that the trapezoidal rule sees.
    """
    blade, polar = rotor
    sections = bem.sections(blade, polar, ratio, derivatives=True)
    for values in sections:
        assert np.all(np.isfinite(values))
    assert np.all(sections.branch >= 0)
    assert np.all(sections.branch <= 2)
    assert np.all(sections.inflow_angle > 0.0)
    assert np.all(sections.inflow_angle < np.pi)
    assert np.all(sections.relative_speed > 0.0)
    for i, j in np.ndindex(sections.branch.shape):  # where it is steep, the bracket is tight
        angles = sections.inflow_angle[i, j] + np.array([-1e-13, 0.0, 1e-13])
        terms = [bem._terms(angle, *station_of(blade, polar, j))[0] for angle in angles]
        f = [s - c * blade.tip_radius / (ratio[i] * blade.r[j]) for s, c, _, _ in terms]
        assert abs(f[1]) <= 1e-10 or f[0] < 0.0 < f[2]
    swept = 1.0 - (blade.hub_radius / blade.tip_radius) ** 2
    assert np.all(bem.rotor_coefficients(blade, polar, ratio).power < 16.0 / 27.0 * swept)


@given(rotor=rotors(wild=False), ratio=ratios)
def test_first_root_is_taken(rotor, ratio):
    """No root lies at a smaller inflow angle: the residual is negative all the way."""
    blade, polar = rotor
    sections = bem.sections(blade, polar, ratio)
    for i, j in np.ndindex(sections.branch.shape):
        angles = np.linspace(1e-6, sections.inflow_angle[i, j] - 1e-9, 100)
        terms = [bem._terms(angle, *station_of(blade, polar, j))[0] for angle in angles]
        f = [s - c * blade.tip_radius / (ratio[i] * blade.r[j]) for s, c, _, _ in terms]
        assert max(f) < 1e-7


def root_changes(blade, polar, low, high):
    """Return (station, tip speed ratio) where a first root vanishes, in order of the latter.

    That is at the local minima of the station's curve g(phi) that are below all before them.
    """
    roots = []
    for j, r in enumerate(blade.r):
        knots = np.empty((7, bem.MOST_KNOTS))
        running = knots[6, : bem._curve(-np.inf, station_of(blade, polar, j), knots)]
        held = np.flatnonzero((running[1:] == running[:-1]) & np.isfinite(running[:-1]))
        vanishing = np.unique(np.concatenate((running[[0, -1]], running[held])))
        roots += [(j, ratio) for ratio in vanishing * blade.tip_radius / r if low <= ratio <= high]
    return sorted(roots, key=lambda change: change[1])


def largest_jump(blade, polar, low, high):
    """Return the largest jump of torque over the largest torque, and that of the inflow angle.

    The former is found by bisection, and the latter (rad, of any section) is the one there.
    """
    points = np.linspace(low, high, 61)
    torque = bem.rotor_coefficients(blade, polar, points).torque
    scale = np.abs(torque).max()
    index = int(np.argmax(np.abs(np.diff(torque))))
    low, high = points[index : index + 2]
    for _ in range(40):
        points = np.array([low, 0.5 * (low + high), high])
        left, right = np.abs(np.diff(bem.rotor_coefficients(blade, polar, points).torque))
        low, high = points[:2] if left > right else points[1:]
    angles = bem.sections(blade, polar, np.array([low, high])).inflow_angle
    return max(left, right) / scale, np.abs(np.diff(angles, axis=0)).max()


FOLDED = Blade(np.array([0.89511]), np.array([1.15915]), np.array([1.192278]), 0.496532, 1.0, 5)
"""Two turning points of its curve are 0.0014 rad apart with the polar of `POLARS[4]`."""


@example(rotor=(FOLDED, POLARS[4]), low=1.0, width=8.0)
@given(rotor=rotors(), low=st.floats(0.1, 8.0), width=st.floats(0.5, 8.0))
def test_torque_is_continuous_except_where_a_root_vanishes(rotor, low, width):
    """Turning points closer than `bem.FINEST` may be missed (docs/studies/bem.md).

    Between and around two of them, d apart, the curve is about a cubic: the first root then jumps
    by 1.5 d.
    """
    blade, polar = rotor
    changes = [ratio for _, ratio in root_changes(blade, polar, low, low + width)]
    for left, right in itertools.pairwise([low, *changes, low + width]):
        if right > left * (1.0 + 1e-7):
            ends = left * (1.0 + 1e-9), right * (1.0 - 1e-9)
            jump, angle = largest_jump(blade, polar, *ends)
            assert jump < 1e-4 or angle < 1.5 * bem.FINEST


# Derivatives: complex step through the residual, at every branch


def complex_section(phi, inputs, r, blade, polar):
    """Return loads, inflow angle and relative speed with complex inputs, by Newton's method."""
    ratio, chord, twist = (complex(value) for value in inputs)
    phi = complex(phi)
    lambda_r = ratio * r / blade.tip_radius
    radii = (complex(each) for each in (r, blade.hub_radius, blade.tip_radius))
    station = (chord, twist, *radii, blade.blade_count, polar.coefficients)
    for _ in range(3):
        (s, c, s_phi, c_phi), forces = bem._terms(phi, *station)[:2]
        phi -= (s - c / lambda_r) / (s_phi - c_phi / lambda_r)
    (s, c, _, _), forces = bem._terms(phi, *station)[:2]
    return np.array([chord * forces[0] / s**2, chord * forces[1] / s**2, phi, 1.0 / s])


@pytest.mark.parametrize("branch", [0, 1, 2, 3])
def test_derivatives_are_those_of_the_complex_step(branch, study, ideal_polar):
    rng, checked = np.random.default_rng(branch), 0
    while checked < 40:
        rotor = (study.wild_rotor if checked % 2 else study.random_rotor)(rng, POLARS)
        blade, polar = rotor.blade, ideal_polar if branch == 3 else POLARS[checked % 6]
        sections = bem.sections(blade, polar, rotor.tip_speed_ratio, derivatives=True)
        for i, j in np.argwhere(sections.branch == branch)[:2]:
            phi = sections.inflow_angle[i, j]
            inputs = [rotor.tip_speed_ratio[i], blade.chord[j], blade.twist[j]]
            for index in range(len(inputs)):
                stepped = list(inputs)
                stepped[index] = inputs[index] + 1e-30j
                expected = complex_section(phi, stepped, blade.r[j], blade, polar).imag / 1e-30
                mine = sections.derivatives[:, index, i, j]
                assert np.allclose(mine, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
            checked += 1


# Interface


def test_one_polar_for_each_station_and_any_order_of_stations(blade, polar):
    ratio = np.array([3.0, 7.0])
    whole = bem.sections(blade, polar, ratio, derivatives=True)
    same = bem.sections(blade, ByStation.of([polar] * blade.r.size), ratio, derivatives=True)
    for mine, theirs in zip(whole, same, strict=True):
        assert np.array_equal(mine, theirs)
    mixed = ByStation.of(POLARS[0] if j < 4 else polar for j in range(blade.r.size))
    sections = bem.sections(blade, mixed, ratio)
    assert np.array_equal(sections.normal_load[:, 4:], whole.normal_load[:, 4:])
    assert not np.any(sections.normal_load[:, :4] == whole.normal_load[:, :4])
    back = replace(blade, r=blade.r[::-1], chord=blade.chord[::-1], twist=blade.twist[::-1])
    assert np.array_equal(bem.sections(back, polar, ratio).normal_load[:, ::-1], whole.normal_load)


@pytest.mark.parametrize("cone", [0.0, 0.1])
def test_coefficients_follow_from_sections_that_are_known(blade, polar, cone):
    ratio = np.array([5.0, 8.0, 11.0])
    coned = replace(blade, cone=cone)
    result = bem.sections(coned, polar, ratio, True)
    result = bem.rotor_coefficients(coned, polar, ratio, True, result)
    np.testing.assert_equal(result, bem.rotor_coefficients(coned, polar, ratio, True))


def test_ratios_must_be_positive_and_stations_inside(blade, polar):
    for ratio in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match="positive"):
            bem.rotor_coefficients(blade, polar, [5.0, ratio])
    blade = Blade(np.array([0.3, 1.0]), np.full(2, 0.1), np.zeros(2), 0.1, 1.0, 3)
    with pytest.raises(ValueError, match="between hub and tip"):
        bem.rotor_coefficients(blade, polar, 5.0)
    with pytest.raises(ValueError, match="3 polars"):
        bem.rotor_coefficients(blade, ByStation.of([polar] * 3), 5.0)


def test_section_without_a_root_is_marked_and_bears_no_load(study, ideal_polar):
    """Only a section without drag can have none; nothing wrong is returned in silence."""
    rng = np.random.default_rng(1)
    rotor = next(
        rotor
        for rotor in (study.wild_rotor(rng, [ideal_polar]) for _ in range(300))
        if np.any(bem.sections(rotor.blade, ideal_polar, rotor.tip_speed_ratio).branch == -1)
    )
    sections = bem.sections(rotor.blade, ideal_polar, rotor.tip_speed_ratio, derivatives=True)
    none = sections.branch == -1
    assert not np.any(np.array(sections[:-1])[:, none])
    assert not np.any(sections.derivatives[:, :, none])
    assert np.all(sections.relative_speed[~none] > 0.0)
    with pytest.warns(RuntimeWarning, match="no root"):
        bem.rotor_coefficients(rotor.blade, ideal_polar, rotor.tip_speed_ratio)


# CCBlade, given the very same polar objects


def test_published_rotors_are_those_of_ccblade(study):
    for rotor in (study.bahaj(), study.nrel_5mw()):
        comparison = study.compare(rotor, derivatives=True)
        assert set(comparison.kinds) == {study.SAME}
        assert comparison.error < 1e-10
        assert comparison.gradient_error < 1e-8


def test_random_rotors_are_those_of_ccblade_and_every_difference_is_explained(study):
    rng, polars = np.random.default_rng(11), study.all_polars()
    for number in range(150):
        wild = number % 5 == 4
        rotor = (study.wild_rotor if wild else study.random_rotor)(rng, polars)
        comparison = study.compare(rotor, derivatives=number % 5 == 0)
        assert comparison.error < 1e-8
        assert comparison.gradient_error < 1e-6
        assert study.OTHER not in comparison.kinds
        assert study.CC_ONLY not in comparison.kinds


# Cone


@pytest.mark.parametrize("cone", [0.0, 0.1, -0.2])
def test_coned_rotor_is_that_of_ccblade(blade, cone):
    """With another polar at every station."""
    coned, ratio = replace(blade, cone=cone), np.linspace(4.0, 10.0, 7)
    polars = ByStation.of(POLARS[station % 6] for station in range(blade.r.size))
    mine = bem.rotor_coefficients(coned, polars, ratio, derivatives=True)
    theirs = ccblade.rotor_coefficients(coned, polars, ratio, derivatives=True)
    mine, theirs = ((*each[1:], *each.torque_table) for each in (mine, theirs))
    for ours, other in zip(mine, theirs, strict=True):
        np.testing.assert_allclose(ours, other, rtol=1e-6, atol=1e-9)


# Local Reynolds number


@pytest.fixture(scope="module")
def local():
    from hkt_mdo.case import Fluid, Rotor
    from hkt_mdo.problem.turbine import build_turbine

    return build_turbine(Rotor(polar="naca63815", reynolds="local"), Fluid(), 1.5)


def test_local_reynolds_number_picks_the_polar(local):
    """At the viscosity that brings one station to a table's Reynolds number, it has that table."""
    blade, ratio, index = local.blade, 7.0, 5
    relative = blade.chord[index] * np.sqrt(1.0 + (ratio * blade.r[index] / blade.tip_radius) ** 2)
    for number, polar in zip((1e5, 5e5, 2e6), (POLARS[0], POLARS[3], POLARS[5]), strict=True):
        polars = replace(local.polar, flow_speed=number * local.polar.viscosity / relative)
        load, alone = (
            bem.sections(blade, table, ratio).tangential_load[0, index] for table in (polars, polar)
        )
        assert load == pytest.approx(alone, rel=1e-9)


def test_derivatives_with_a_local_reynolds_number(local):
    blade, ratio, step = local.blade, np.linspace(4.0, 10.0, 13), 1e-6
    exact = bem.rotor_coefficients(blade, local.polar, ratio, derivatives=True)

    def slope(chord=0.0, radius=0.0, faster=0.0):
        """Return that of the torque along a change of chord (m), radius (m) and ratio."""

        def torque(move):
            changed = blade.with_rotor_radius(blade.rotor_radius + move * radius)
            changed = changed.with_shape(changed.chord + move * chord, changed.twist)
            return bem.rotor_coefficients(changed, local.polar, ratio + move * faster).torque

        return (torque(step) - torque(-step)) / (2.0 * step)

    for station in (0, 4, 8):
        by_chord = slope(chord=np.eye(blade.r.size)[station])
        np.testing.assert_allclose(exact.torque_table.by_chord[:, station], by_chord, atol=1e-8)
    np.testing.assert_allclose(exact.torque_table.by_tip_speed_ratio, slope(faster=1.0), atol=1e-8)
    np.testing.assert_allclose(exact.torque_table.by_rotor_radius, slope(radius=1.0), atol=1e-8)


# Published numbers


def test_nrel_5mw_rotor_has_its_published_peak(study):
    """Cp 0.482 at tip speed ratio 7.55, by another program (NREL/TP-500-38060, sec. 7)."""
    rotor = study.nrel_5mw()
    ratio = np.linspace(5.0, 10.0, 101)
    power = bem.rotor_coefficients(rotor.blade, rotor.polar, ratio).power
    assert power.max() == pytest.approx(0.482, abs=0.012)
    assert ratio[np.argmax(power)] == pytest.approx(7.55, abs=0.4)


@pytest.mark.parametrize(
    ("slopes", "uneven"), [((-1, -1), False), ((-2, -1), True), ((-1, -2), True)]
)
def test_a_curve_of_uneven_slope_may_hide_turning_points(slopes, uneven):
    change = (-1.0 + 0.25 * sum(slopes)) / 1.5  # of the cubic whose slope in the middle is -1
    left, right = ((phi, *4 * (0.0,), float(slopes[phi]), 3.0 + phi * change) for phi in (0, 1))
    assert bem._uneven(left, right) == uneven
