"""Loads along the blade: closed forms, an independent computation, derivatives, the component."""

from dataclasses import replace

import numpy as np
import openmdao.api as om
import pytest

from hkt_mdo.rotor import bem, loads
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.components import TablesComp
from hkt_mdo.rotor.following import LocalReynolds
from hkt_mdo.rotor.loads import LoadModel, moment_weights
from hkt_mdo.rotor.model import RotorModel
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.strength import Structure, place_weights

WATER, METAL = 1000.0, 2700.0
RATIO = np.array([4.0, 6.5, 8.0, 10.0])
NAMES = ("thrust", "root_moment", "stress", "cavitation")


def suction(angle):
    """Return something like the suction of both surfaces of a section, and its slopes."""
    upper, lower = 0.8 + 4.0 * angle + 20.0 * angle**2, 0.6 - 3.0 * angle
    slopes = 4.0 + 40.0 * angle, np.full(angle.shape, -3.0)
    return np.stack((upper, lower)), np.stack(slopes)


def model_of(polar, suction=suction, **changes):
    """Return a model whose sections have some suction."""

    def along(*arguments):
        angle = arguments[-1]
        return *suction(angle), np.zeros((2, *angle.shape))

    polar = type("Sections", (type(polar),), {"along": along})(**vars(polar))
    structure = Structure.of(Outline.from_file("naca63815"), METAL, 70e9)
    return LoadModel(polar, **{"structure": structure, "depth": 3.0} | changes)


def rectangle(height=0.2):
    x, y = np.array([1.0, 0.0, 0.0, 1.0]), height * (np.array([1.0, 1.0, 0.0, 0.0]) - 0.5)
    return Outline(x, y)


@pytest.fixture(scope="module")
def nothing(study):
    """Return the polar of a section without any force."""
    alpha = np.linspace(-np.pi, np.pi, 73)
    return study.circle_polar(alpha, np.zeros(73), np.zeros(73))


@pytest.fixture
def loaded(monkeypatch):
    """Put given loads over q (m) in place of those of BEM."""

    def put(normal, tangential):
        state = bem.Sections(*np.zeros((7, 1, normal.size)), np.empty(0))
        state = state._replace(normal_load=normal[None], tangential_load=tangential[None])
        monkeypatch.setattr(bem, "sections", lambda *_: state)

    return put


def uniform_blade(n=2001, twist=0.0, cone=0.0, hub=0.2, tip=1.4, chord=0.1):
    """Return a blade of constant chord and twist with stations close to hub and tip."""
    r = hub + (tip - hub) * np.linspace(1e-7, 1.0 - 1e-7, n)
    return Blade(r, np.full(n, chord), np.full(n, twist), hub, tip, 3, cone)


# Closed forms


def test_moment_between_stations_is_that_of_a_rule_which_begins_there(blade):
    """The trapezoidal rule over the place itself, the stations outside it and the tip."""
    load = np.random.default_rng(0).uniform(size=blade.r.size)
    places = np.array([blade.hub_radius, 0.3, 0.5, blade.r[3], 1.3])
    moments = load @ moment_weights(blade, places)
    for radius, moment in zip(places, moments, strict=True):
        outside = blade.r > radius
        s = np.concatenate(([radius], blade.r[outside], [blade.tip_radius]))
        force = np.concatenate(([0.0], load[outside], [0.0]))
        assert moment == pytest.approx(np.trapezoid(force * (s - radius), s), rel=1e-13)


def test_stress_of_a_uniformly_loaded_rectangle(loaded):
    """6 M / (b h²) by the normal load and 6 M / (h b²) by the tangential one, at the root."""
    blade, q = uniform_blade(401), 1.0
    n = blade.r.size
    model = LoadModel(None, structure=Structure.of(rectangle(), 1e-12))
    width, height = 0.1, 0.02
    for normal, tangential, twist in ((5.0, 0.0, 0.0), (0.0, 3.0, 0.0), (5.0, 3.0, 0.3)):
        loaded(np.full(n, normal), np.full(n, tangential))
        turned = blade.with_shape(blade.chord, np.full(n, twist))
        flapwise, edgewise = (0.5 * each * q * 1.2**2 for each in (normal, tangential))
        weak = flapwise * np.cos(twist) + edgewise * np.sin(twist)
        strong = edgewise * np.cos(twist) - flapwise * np.sin(twist)
        expected = 6.0 * (abs(weak) / (width * height**2) + abs(strong) / (height * width**2))
        stress = model.loads(turned, [5.0])["stress"]
        assert stress.largest == pytest.approx(expected, rel=1e-4)
        assert stress.r[np.argmax(stress.exact, axis=1)] == pytest.approx(0.2, abs=1e-5)


def test_weight_in_water_of_a_uniform_bar():
    """M = g (rho_b - rho) A L² / 2 about the axis, and 6 M / (h b²) where that bends edgewise."""
    blade, model = uniform_blade(401), LoadModel(None, structure=Structure.of(rectangle(), METAL))
    moment = 9.80665 * (METAL - WATER) * 0.1 * 0.02 * 1.2**2 / 2.0
    assert model.weight_moment(blade) == pytest.approx(moment, rel=1e-9)
    for twist, shape in ((0.0, 0.02 * 0.1**2), (0.5 * np.pi, 0.1 * 0.02**2)):
        turned = blade.with_shape(blade.chord, np.full(401, twist))
        stress = model.weight_stress(turned).largest
        assert stress == pytest.approx(6.0 * moment / shape, rel=2e-4)
    # a blade as light as water has none
    light = replace(model, structure=Structure.of(rectangle(), WATER))
    assert light.weight_stress(blade).largest == 0.0


def test_a_bar_turning_without_loads_has_the_centrifugal_stress(nothing):
    """rho w² (R² - r²) / 2 with a free end."""
    blade = Blade(np.array([0.3, 0.55, 0.9, 1.2]), np.full(4, 0.1), np.zeros(4), 0.2, 1.4, 3)
    model = LoadModel(nothing, structure=Structure.of(rectangle(), METAL))
    stress = model.loads(blade, RATIO, derivatives=True)["stress"]
    flow_speed = 1.7
    speed = RATIO[:, None] * flow_speed / 1.4
    expected = 0.5 * METAL * speed**2 * (1.4**2 - stress.r**2)
    assert 0.5 * WATER * flow_speed**2 * stress.exact == pytest.approx(expected, rel=1e-13)
    # twice as fast is four times the stress; a uniform chord does not matter
    for unit in np.eye(stress.r.size):
        by_ratio, by_chord, *_ = stress.slopes(np.broadcast_to(unit, stress.values.shape))
        assert by_ratio * RATIO == pytest.approx(2.0 * stress.values @ unit, rel=1e-12)
        assert np.sum(by_chord, axis=-1) == pytest.approx(0.0, abs=1e-9)


def test_the_centrifugal_force_bends_coned_blades(nothing):
    """A uniform bar: rho A w² cos sin integral of s (s - r), on 6 / (b h²)."""
    cone, hub, tip, chord, height = 0.2, 0.2, 1.4, 0.1, 0.02
    blade = uniform_blade(5, cone=cone, chord=chord)
    model = LoadModel(nothing, structure=Structure.of(rectangle(), METAL))
    stress = model.loads(blade, [6.0])["stress"]
    r = stress.r
    rate = METAL * 2.0 * 36.0 / (WATER * (tip * np.cos(cone)) ** 2) * np.cos(cone)  # of w²
    tension = rate * np.cos(cone) * 0.5 * (tip**2 - r**2)
    arm = (tip**3 - r**3) / 3.0 - r * (tip**2 - r**2) / 2.0
    bending = rate * np.sin(cone) * arm * 6.0 / height
    assert stress.exact[0] == pytest.approx(tension + bending, rel=1e-12)
    assert hub < r[0] < hub + 1e-6
    (flapwise,), _ = model.moments(blade, [6.0], r)
    assert flapwise == pytest.approx(rate * np.sin(cone) * arm * chord * height, rel=1e-9)


@pytest.mark.parametrize("twist", [0.0, 0.5 * np.pi, 0.6])
def test_deflection_of_a_uniformly_loaded_cantilever(loaded, twist):
    """w L⁴ / (8 E I), with the section's inclined axes."""
    blade = uniform_blade(801, twist=twist)
    loaded(np.full(801, 4.0), np.zeros(801))
    modulus, length, height = 70e9, 1.2, 0.02
    model = LoadModel(None, structure=Structure.of(rectangle(), METAL, modulus))
    weak, strong = 0.1 * height**3 / 12.0, height * 0.1**3 / 12.0
    flexibility = np.cos(twist) ** 2 / weak + np.sin(twist) ** 2 / strong
    expected = 4.0 * length**4 / (8.0 * modulus) * flexibility
    assert model.tip_deflection(blade, [5.0]) == pytest.approx(expected, rel=1e-4)


# Against other computations


@pytest.mark.parametrize("cone", [0.0, 0.15])
def test_loads_at_the_stations_from_their_definitions(blade, polar, cone):
    """Moments by the trapezoidal rule, bending over all points of the outline, sums by hand."""
    blade, flow_speed, depth = replace(blade, cone=cone), 1.7, 3.0
    model = model_of(polar)
    outline, q = Outline.from_file("naca63815"), 0.5 * WATER * flow_speed**2
    result = model.loads(blade, RATIO)
    thrust = bem.rotor_coefficients(blade, polar, RATIO).thrust * np.pi * blade.rotor_radius**2
    assert result["thrust"].largest == pytest.approx(thrust, rel=1e-14)
    state = bem.sections(blade, polar, RATIO)
    stations = np.argmax(place_weights(blade.r.size) == 1.0, axis=0)
    kx, ky, kxy = outline.second_moments
    x, y = outline.x - outline.centroid[0], outline.y - outline.centroid[1]
    s = np.concatenate(([blade.hub_radius], blade.r, [blade.tip_radius]))
    fine = np.linspace(blade.r[0], blade.tip_radius, 100001)
    area = outline.area * np.interp(fine, blade.r, blade.chord) ** 2
    along = np.linspace(blade.hub_radius, blade.tip_radius, 100001)
    for i, ratio in enumerate(RATIO):
        speed = ratio * flow_speed / blade.rotor_radius
        n, t = (
            q * np.cos(cone) ** 2 * np.concatenate(([0.0], load[i], [0.0]))
            for load in (state.normal_load, state.tangential_load)
        )
        line = METAL * speed**2 * outline.area * np.interp(along, blade.r, blade.chord) ** 2 * along
        pulled = np.cos(cone) * np.sin(cone) * np.trapezoid(line * (along - s[0]), along)
        root = np.trapezoid(n * (s - s[0]), s) + pulled
        assert q * result["root_moment"].largest[i] == pytest.approx(root, rel=1e-9)
        for j, (r, chord, twist) in enumerate(zip(blade.r, blade.chord, blade.twist, strict=True)):
            arm = s[j + 1 :] - r
            flapwise, edgewise = (np.trapezoid(e[j + 1 :] * arm, s[j + 1 :]) for e in (n, t))
            outside = fine >= r
            line = METAL * speed**2 * area[outside] * fine[outside]
            bending = np.trapezoid(line * (fine[outside] - r), fine[outside])
            flapwise += np.cos(cone) * np.sin(cone) * bending
            # strain x a + y b: its moments balance those of the loads, see docs/rotor_model.md
            weak = flapwise * np.cos(twist) + edgewise * np.sin(twist)
            strong = edgewise * np.cos(twist) - flapwise * np.sin(twist)
            a, b = np.linalg.solve([[kxy, kx], [ky, kxy]], [-weak, strong]) / chord**3
            tension = np.cos(cone) ** 2 * np.trapezoid(line, fine[outside])
            expected = np.max(np.abs(a * x + b * y)) + tension / (outline.area * chord**2)
            mine = q * result["stress"].exact[i, stations[j]]
            assert mine == pytest.approx(expected, rel=3e-4)
            assert mine > expected * (1.0 - 3e-5)
        static = 101325.0 - 1705.0 + WATER * 9.80665 * (depth - blade.r * np.cos(cone))
        peak, _ = suction(state.angle_of_attack[i])
        relative = q * (np.cos(cone) * state.relative_speed[i]) ** 2
        expected = (1.1 * peak * relative / static).ravel()
        assert q * result["cavitation"].exact[i] == pytest.approx(expected, rel=1e-13)


def test_loads_with_polars_at_the_local_reynolds_number(blade, polar):
    """Equal polars at every number give the loads of one; derivatives are refused."""
    same = LocalReynolds(np.log([1e5, 1e6]), ((polar, polar),), 1.5, 1e-6)
    local, expected = model_of(same), model_of(polar).loads(blade, RATIO)
    for name, mine in local.loads(blade, RATIO).items():
        assert mine.exact == pytest.approx(expected[name].exact, rel=1e-11)
    with pytest.raises(ValueError, match="local Reynolds"):
        local.loads(blade, RATIO, derivatives=True)


# Envelopes


def test_envelopes_are_never_below_the_largest(blade, polar):
    result = model_of(polar).loads(blade, np.linspace(3.0, 12.0, 37))
    for name, load in result.items():
        most = load.largest
        outline = 30.0 ** (1.0 / 400.0) if name == "stress" else 1.0  # its points, at most
        values, bound = load.envelope().values, load.r.size ** (1.0 / 400.0) * outline
        assert np.all(values >= most * (1.0 - 1e-15)), name
        assert np.all(values <= most * bound * (1.0 + 1e-15)), name
        assert np.all(load.values >= load.exact - 1e-15 * np.abs(load.exact))


def test_a_negative_thrust_keeps_its_sign(blade, study):
    """A propeller brake has no positive load to bound."""
    alpha = np.linspace(-np.pi, np.pi, 73)
    polar = study.circle_polar(alpha, -0.5 * np.ones(73), np.full(73, 0.01))
    thrust = LoadModel(polar, None).loads(blade, [6.0], names=["thrust"])["thrust"]
    assert thrust.envelope().values[0] == thrust.largest[0] < 0.0


def test_surfaces_under_pressure_do_not_cavitate(blade, polar):
    """Suction below zero counts as none, with zero slopes."""

    def pressed(angle):
        return np.full((2, *angle.shape), -0.3), np.ones((2, *angle.shape))

    peak = model_of(polar, pressed).loads(blade, RATIO, derivatives=True)["cavitation"].envelope()
    assert not np.any(np.concatenate([each.ravel() for each in peak]))


# Derivatives


def stepped_loads(model, blade, points, **steps):
    """Return the imaginary parts over the step of loads by complex inputs.

    The flow's state is complex by the derivatives that BEM gives (tests/rotor/test_bem.py checks
    these), everything behind it is computed in complex numbers.
    """
    h = 1e-30j
    flow = bem.sections(blade, model.polar, points, True)
    by_ratio, by_chord, by_twist = (flow.derivatives[:, index] for index in range(3))
    chord, twist = (steps.get(name, np.zeros(blade.r.size)) for name in ("chord", "twist"))
    change = steps.get("ratio", 0.0) * by_ratio + chord * by_chord + twist * by_twist
    factor = 1.0
    if "radius" in steps:  # loads (m) are homogeneous in chord and radii, angle and speed invariant
        nothing = np.zeros((2, *flow.branch.shape))
        length = np.array([flow.tangential_load, flow.normal_load, *nothing])
        change = change + (length - by_chord * blade.chord) / blade.rotor_radius
        factor = 1.0 + h / blade.rotor_radius
    tangential, normal, angle, relative = h * change
    flow = flow._replace(
        tangential_load=flow.tangential_load + tangential,
        normal_load=flow.normal_load + normal,
        angle_of_attack=flow.angle_of_attack + angle - h * twist,
        relative_speed=flow.relative_speed + relative,
        derivatives=np.empty(0),
    )
    radii = {name: factor * getattr(blade, name) for name in ("r", "hub_radius", "tip_radius")}
    changed = replace(blade, **radii, chord=blade.chord + h * chord, twist=blade.twist + h * twist)
    ratio = points + h * steps.get("ratio", 0.0)
    parts = {}
    for name in NAMES:
        load = loads._LOADS[name](model, changed, flow, ratio)._replace(slopes=None)
        parts[name] = load.values.imag / 1e-30, load.envelope().values.imag / 1e-30
    return parts


def at_places(load):
    """Return the derivatives of a load's values at each place, (n, m) and (n, m, n_stations)."""
    slopes = [load.slopes(np.tile(unit, (len(load.values), 1))) for unit in np.eye(load.r.size)]
    names = "tip_speed_ratio", "chord", "twist", "thickness", "rotor_radius"
    pairs = zip(names, zip(*slopes, strict=True), strict=True)
    return {name: np.stack(by, axis=1) for name, by in pairs}


@pytest.mark.parametrize(("cone", "hollow"), [(0.0, False), (0.12, False), (0.12, True)])
def test_derivatives_are_those_of_the_complex_step(blade, polar, cone, hollow):
    blade, model = replace(blade, cone=cone), model_of(polar)
    if hollow:
        wall = np.linspace(0.05, 0.01, blade.r.size)
        outlines = [Outline.from_file("naca63815")] * wall.size
        model = model_of(polar, structure=Structure.of(outlines, METAL, wall=wall))
    result = model.loads(blade, RATIO, derivatives=True)
    unit = np.eye(blade.r.size)
    steps = {"tip_speed_ratio": [{"ratio": 1.0}], "rotor_radius": [{"radius": 1.0}]}
    steps |= {name: [{name: each} for each in unit] for name in ("chord", "twist")}
    for by, changes in steps.items():
        expected = [stepped_loads(model, blade, RATIO, **step) for step in changes]
        for name, load in result.items():
            local, whole = (np.stack([e[name][k] for e in expected], axis=-1) for k in (0, 1))
            if by in ("tip_speed_ratio", "rotor_radius"):
                local, whole = local[..., 0], whole[..., 0]
            scale = np.abs(local).max()
            mine = at_places(load)[by]
            assert np.allclose(mine, local, rtol=1e-9, atol=1e-12 * scale), (name, by)
            mine = getattr(load.envelope(), f"by_{by}")
            assert np.allclose(mine, whole, rtol=1e-9, atol=1e-12 * scale), (name, by)


def test_derivatives_of_the_stress_by_the_weight(blade, polar):
    model, h, n = model_of(polar), 1e-6, blade.r.size
    envelope, rng = model.weight_stress(blade).envelope(), np.random.default_rng(3)
    chord, twist = 0.1 * rng.normal(size=n), rng.normal(size=n)

    def slope(changed):
        ends = (model.weight_stress(changed(s * h)).envelope().values for s in (1.0, -1.0))
        return -np.subtract(*reversed(list(ends))) / (2.0 * h)

    by = slope(lambda step: blade.with_shape(blade.chord + step * chord, blade.twist))
    assert envelope.by_chord @ chord == pytest.approx(by, rel=1e-6)
    by = slope(lambda step: blade.with_shape(blade.chord, blade.twist + step * twist))
    assert envelope.by_twist @ twist == pytest.approx(by, rel=1e-6)
    by = slope(lambda step: blade.with_rotor_radius(blade.rotor_radius + step))
    assert envelope.by_rotor_radius == pytest.approx(by, rel=1e-6)


def test_tables_are_torque_and_loads_with_exact_partials(blade, polar):
    problem = om.Problem()
    rotor = RotorModel(polar, model_of(polar).structure, depth=3.0)
    component = TablesComp(rotor, blade, RATIO, ["torque_coefficient", *NAMES])
    problem.model.add_subsystem("table", component, promotes=["*"])
    problem.setup()
    problem.set_val("rotor_radius", 1.3 * blade.rotor_radius)
    problem.set_val("chord", 1.1 * blade.chord)
    problem.run_model()
    changed = blade.with_rotor_radius(1.3 * blade.rotor_radius)
    changed = changed.with_shape(1.1 * blade.chord, blade.twist)
    torque = bem.rotor_coefficients(changed, polar, RATIO).torque
    assert np.array_equal(problem["torque_coefficient_table"], torque)
    for name, load in rotor.loads(changed, RATIO).items():
        assert problem[f"{name}_table"] == pytest.approx(load.envelope().values, rel=1e-14)
    partials = problem.check_partials(out_stream=None, form="central", step=1e-6, step_calc="abs")
    for (output, _), partial in partials["table"].items():
        error = np.abs(partial["J_fwd"] - partial["J_fd"]).max()
        size = max(np.abs(partial["J_fd"]).max(), np.abs(problem[output]).max())
        assert error < 1e-6 * size, output
    assert len({output for output, _ in partials["table"]}) == 5


# Errors


def test_what_cannot_be_computed_is_refused(blade, polar):
    shallow = model_of(polar, depth=0.9 * blade.rotor_radius)
    with pytest.raises(ValueError, match="out of the water"):
        shallow.loads(blade, RATIO)
    outline = Outline.from_file("naca63815")
    other = model_of(polar, structure=Structure.of([outline, outline.stretched(1.2)], METAL))
    with pytest.raises(ValueError, match="stations"):
        other.loads(blade, RATIO)
    with pytest.raises(ValueError, match="gives no cavitation"):
        model_of(polar, depth=None).loads(blade, RATIO, names=NAMES)
    unknown = model_of(polar, structure=Structure.of(outline, METAL))
    assert np.all(np.isnan(unknown.tip_deflection(blade, RATIO)))
