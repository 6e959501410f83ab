"""A turbine of windIO 2: validated by its package, read by this program, and by WISDEM."""

from collections import defaultdict
from functools import cache

import numpy as np
import pytest
import yaml
from scipy.interpolate import CubicSpline, PchipInterpolator

from hkt_mdo.case import read_case
from hkt_mdo.exports.base import export, provenance
from hkt_mdo.exports.solids import airfoils
from hkt_mdo.exports.tables import steady_operation
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor.outline import Outline
from tests.exports.made import made

SEVERAL = """
rotor:
  stations: [0.25, 0.45, 0.65, 0.85, 0.98]
  sections:
    - {outline: examples/files/naca4412.csv, polar: examples/files/naca4412_polars.csv}
    - {outline: naca4415, polar: naca4415_Re1e6}
    - {outline: examples/files/naca4418.csv, polar: examples/files/naca4418_polars.csv}
    - {outline: examples/files/naca4424.csv, polar: examples/files/naca4424_polars.csv}
"""
THICKNESS = "{chord_points: 5, twist_points: 5, thickness_points: 5}"
STEEL = "{polar: naca63815, reynolds: local, material: steel_s355, wall: 0.03}"
LOSSY = "{rated_torque: 700, copper_loss: 300}"

CASES = {
    "one section": ("limits: {cavitation: {depth: 4}}", [11.0]),
    "resized": ("rotor: {blade: rm1, radius: 2.0, cone: -4, station_count: 6}", [40.0]),
    "several sections": (f"{SEVERAL}  blade: rm1\n  radius: 1.4\n", [40.0]),
    "designed thickness": (f"{SEVERAL}design: {THICKNESS}\n", [11.0]),
    "Reynolds numbers": (f"rotor: {STEEL}\ngenerator: {LOSSY}\n", [11.0]),
}
"""Keys of the case, and the gain."""


FIXED = "inflow: sine\ncontrol: {law: quadratic, torque_limit: 700}\ndesign: {blade: fixed}\n"


def written(folder, name):
    """Return a result, its design, and the path and content of its turbine file."""
    text, gains = CASES[name]
    head = FIXED.replace("design: {blade: fixed}\n", "") if "design:" in text else FIXED
    solution = made(folder / "result", f"{head}{text}\n", gains)
    (path,) = export(solution, ["windio"], folder, options=["windio.stacking=0.3"])
    data = yaml.load(path.read_text(), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return solution, solution.design(), path, data


@pytest.fixture(scope="module")
def turbines(tmp_path_factory):
    return cache(lambda name: written(tmp_path_factory.mktemp("windio"), name))


QUICK, *OTHERS = CASES


@pytest.fixture(
    scope="module", params=[QUICK, *(pytest.param(each, marks=pytest.mark.slow) for each in OTHERS)]
)
def turbine(request, turbines):
    return turbines(request.param)


def test_windio_validates_it_and_this_program_reads_the_same_rotor(turbine):
    import windIO  # 4 s

    solution, design, path, _ = turbine
    windIO.validate(path, "turbine/turbine_schema")
    case = solution.case
    rotor = {"blade": str(path), "reynolds": case.rotor.reynolds, "wall": case.rotor.wall}
    rotor["material"] = case.rotor.blade_material.model_dump()
    text = {"rotor": rotor, "design": {"blade": "fixed"}}
    text |= {"inflow": {"profile": "sine"}, "control": {"law": "quadratic"}}
    read = physics(read_case(yaml.safe_dump(text)))
    blade = design.blade
    assert read.blade.blade_count == blade.blade_count
    assert read.blade.rotor_radius == pytest.approx(blade.rotor_radius, rel=1e-12)
    assert read.blade.hub_radius == pytest.approx(blade.hub_radius, rel=1e-12)
    assert abs(read.blade.cone) == pytest.approx(abs(blade.cone), abs=1e-12)
    for name in ("r", "chord", "twist"):
        np.testing.assert_allclose(getattr(read.blade, name), getattr(blade, name), atol=1e-12)
    ratio = np.linspace(0.5, 15.0, 59)
    rotor = read.rotor if case.rotor.reynolds == "invariant" else read.rotor.at_flow(1.4)
    expected = design.physics.rotor.at_flow(1.4).coefficients(blade, ratio)
    other = rotor.coefficients(read.blade, ratio)
    np.testing.assert_allclose(other.power, expected.power, atol=1e-7)
    np.testing.assert_allclose(other.thrust, expected.thrust, atol=1e-7)
    mass = design.physics.rotor.mass_and_inertia(blade)
    np.testing.assert_allclose(read.rotor.mass_and_inertia(read.blade), mass, rtol=5e-4)
    np.testing.assert_allclose(read.rotor.thickness_of(read.blade), design.thickness, rtol=1e-9)


def test_it_says_what_the_schema_has_no_key_for(turbine):
    solution, design, _, data = turbine
    for line in provenance(solution):
        assert line in data["comments"]
    fluid = solution.case.fluid
    assert f"density {fluid.density!r} kg/m^3" in data["comments"]
    assert f"viscosity {fluid.kinematic_viscosity!r} m^2/s" in data["comments"]
    depth = "4.0 m" if solution.case.limits.given else "not given"
    assert f"depth of the hub {depth}." in data["comments"]
    assert ("TURNED DOWNSTREAM by cone_angle" in data["comments"]) == (design.blade.cone < 0.0)
    placeholder = "COORDINATES ARE A PLACEHOLDER: rotor.outline is not given"
    has_outline = solution.case.rotor.polar is None or solution.case.rotor.outline is not None
    assert (placeholder in data["comments"]) == (not has_outline)
    shape = data["components"]["blade"]["outer_shape"]
    offset = 0.3 * np.array(shape["chord"]["values"])
    np.testing.assert_allclose(shape["section_offset_y"]["values"], offset)
    control, (gain,) = data["control"], design.gains
    assert control["region2_k"] * 60.0**2 == pytest.approx(gain * (2.0 * np.pi) ** 2)  # of rpm
    assert control["max_gen_torque"] == 700.0
    best = design.physics.rotor.best_operation(design.blade)
    assert control["optimal_tsr"] == best.tip_speed_ratio


def test_the_airfoils_are_those_of_the_stations(turbine):
    _, design, _, data = turbine
    written = {each["name"]: each for each in data["airfoils"]}
    positions = data["components"]["blade"]["outer_shape"]["airfoils"]
    grid = [each["spanwise_position"] for each in positions]
    assert (grid[0], grid[-1]) == (0.0, 1.0)
    blade, by_station = design.blade, design.plant.polar.stations(design.blade)
    span = (blade.r - blade.hub_radius) / (blade.tip_radius - blade.hub_radius)
    outlines = {n: each.outline for each in airfoils(design) for n in each.stations}
    for station, outline in sorted(outlines.items()):
        at = np.searchsorted(grid, span[station] - 1e-12)
        airfoil = written[positions[at]["name"]]
        sets = airfoil["polars"][0]["re_sets"]
        polars = by_station[station]
        assert len(sets) == len(polars)
        if design.physics.case.rotor.polar is None and not design.physics.case.rotor.sections:
            assert [each["re"] for each in sets] == [2e5]  # of the shipped polar
        for table, polar in zip(sets, polars, strict=True):
            alpha, probes = np.deg2rad(table["cl"]["grid"]), np.linspace(-3.1, 3.1, 777)
            for name, expected in zip(("cl", "cd"), polar.evaluate(probes), strict=True):
                curve = CubicSpline(alpha, table[name]["values"], bc_type="periodic")
                np.testing.assert_allclose(curve(probes), expected, atol=1e-6)
        x, y = (np.array(airfoil["coordinates"][name]) for name in "xy")
        assert Outline(x, y).area == pytest.approx(outline.area, rel=3e-4)
        # thickness is linear between sections; that of the outline between them is a bit less
        assert airfoil["rthick"] == pytest.approx(outline.thickness, rel=2e-2)
        assert np.all(np.hypot(np.diff(x), np.diff(y)) > 0.0)
        assert np.mean(y[: x.size // 4]) > np.mean(y[-x.size // 4 :])  # the suction side first


@pytest.mark.slow
def test_losses_of_the_generator_are_an_efficiency_along_the_operation(turbines):
    _, design, _, data = turbines("Reynolds numbers")
    curve = data["components"]["drivetrain"]["generator"]["rpm_efficiency"]
    steady = steady_operation(design)
    rpm = steady["rotor_speed"] * 30.0 / np.pi
    efficiency = np.interp(rpm, curve["grid"], curve["values"])
    np.testing.assert_allclose(efficiency * steady["generator_power"], steady["electrical_power"])
    assert min(curve["values"]) < max(curve["values"]) < 1.0


class Airfoil:
    """An airfoil for WISDEM's CCBlade that smooths nothing."""

    def __init__(self, alpha, lift, drag):
        self.curves = PchipInterpolator(alpha, lift), PchipInterpolator(alpha, drag)

    def evaluate(self, alpha, *_):
        return tuple(float(curve(alpha)) for curve in self.curves)


def read_by_wisdem(path, folder, n_span, n_aoa):
    """Return what WISDEM takes in: span, chord, twist (deg), angles (deg), lift and drag."""
    from wisdem.glue_code.gc_LoadInputs import WindTurbineOntologyPython
    from wisdem.glue_code.gc_WT_InitModel import assign_airfoil_values, assign_outer_shape_values

    options, analysis = folder / "modeling.yaml", folder / "analysis.yaml"
    rotor = {"flag": True, "n_span": n_span, "n_aoa": n_aoa}
    off = {name: {"flag": False} for name in ("TowerSE", "DriveSE", "BOS")}
    options.write_text(yaml.safe_dump({"WISDEM": {"RotorSE": rotor} | off}))
    analysis.write_text(yaml.safe_dump({"general": {"folder_output": str(folder / "out")}}))
    read = WindTurbineOntologyPython(str(path), str(options), str(analysis))
    turbine, modeling, optimization = read.get_input_data()
    shape = turbine["components"]["blade"]["outer_shape"]
    inputs = defaultdict(lambda: np.zeros(len(shape["airfoils"])))
    aero = optimization["design_variables"]["blade"]["aero_shape"]
    assign_outer_shape_values(inputs, modeling, aero, shape)
    assign_airfoil_values(inputs, modeling, shape["airfoils"], turbine["airfoils"])
    return inputs


def power_by_wisdem(blade, inputs, airfoil):
    """Return power coefficients at some tip speed ratios by WISDEM's CCBlade."""
    from wisdem.ccblade.ccblade import CCBlade

    span, ratio = inputs["blade.outer_shape.s"][1:-1], np.arange(4.0, 9.0)
    r = blade.hub_radius + span * (blade.tip_radius - blade.hub_radius)
    chord, twist = (inputs[f"blade.outer_shape.{name}"][1:-1] for name in ("chord", "twist"))
    shape = r, chord, twist, [airfoil] * r.size, blade.hub_radius, blade.tip_radius
    rotor = CCBlade(*shape, blade.blade_count, 1000.0, 1e-3, nSector=1, derivatives=False)
    speed = ratio * 1.5 / blade.tip_radius * 30.0 / np.pi  # rpm
    flow, pitch = np.full(ratio.size, 1.5), np.zeros(ratio.size)
    outputs, _ = rotor.evaluate(flow, speed, pitch, coefficients=True)
    return ratio, outputs["CP"]


@pytest.mark.slow
def test_wisdem_reads_it_interpolates_and_smooths(tmp_path):
    # WISDEM takes the file in at a span and at angles of its own, by monotone interpolation: the
    # finer these, the closer to the design. Its CCAirfoil then smooths the polars.
    from wisdem.ccblade.ccblade import CCAirfoil

    text = "inflow: sine\ncontrol: {law: quadratic}\ndesign: {blade: fixed}\n"
    solution = made(tmp_path / "result", f"{text}rotor: {{station_count: 100}}\n", [11.0])
    design, (path,) = solution.design(), export(solution, ["windio"], tmp_path)
    blade, errors, powers = design.blade, [], []
    span = (blade.r - blade.hub_radius) / (blade.tip_radius - blade.hub_radius)
    for n_span, n_aoa in ((30, 200), (300, 2000)):
        inputs = read_by_wisdem(path, tmp_path, n_span, n_aoa)
        s, angle = inputs["blade.outer_shape.s"], np.deg2rad(inputs["airfoils.aoa"])
        chord, twist = (inputs[f"blade.outer_shape.{name}"] for name in ("chord", "twist"))
        lift, drag, moment = (inputs[f"airfoils.{name}"][0] for name in ("cl", "cd", "cm"))
        off = PchipInterpolator(s, twist)(span) - np.rad2deg(blade.twist)
        relative = PchipInterpolator(s, chord)(span) / blade.chord - 1.0
        errors.append(np.max(np.abs([relative, off]), axis=1))
        exact = Airfoil(angle, lift[:, 0], drag[:, 0])
        smooth = CCAirfoil(inputs["airfoils.aoa"], inputs["airfoils.Re"], lift, drag, moment)
        for airfoil in (exact, smooth):
            ratio, power = power_by_wisdem(blade, inputs, airfoil)
            expected = design.physics.rotor.coefficients(blade, ratio).power
            powers.append(np.max(np.abs(power / expected - 1.0)))
    assert np.all(errors[1] < 0.2 * errors[0])
    assert np.all(errors[1] < [1e-3, 2e-2])
    coarse, coarse_smooth, fine, fine_smooth = powers
    print("Cp by WISDEM less own, largest over own:", powers)
    assert fine < 1e-3
    assert fine < coarse < 2e-2
    assert 2.0 * fine < fine_smooth < 5e-2
    assert coarse_smooth < 5e-2
