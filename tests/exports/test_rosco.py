"""The control law in ROSCO's files: read back by ROSCO's toolbox, and run by its controller.

`rosco_run.py` drives the rotor's own equation of motion by `libdiscon`, which the package `rosco`
brings, in a process of its own. docs/studies/exports_compared.md has the differences.
"""

import importlib.util
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hkt_mdo import Solution
from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.simulation import FeedbackTorque, Plant, simulate
from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import export
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.scales import torque_scale
from tests.conftest import edit_summary

DATA = Path(__file__).parents[1] / "data" / "openfast"
FLOWS = np.linspace(1.3, 1.7, 8)  # m/s, knots of a tracking law
UNITS = ["rad/s"] * FLOWS.size + ["N*m*s/rad", "N*m/rad"]


@cache
def rosco():
    """Return ROSCO's own readers, whose import takes 10 s."""
    from rosco.toolbox import utilities

    return utilities


def underspeed():
    """Return the schedule of a rotor that turns slower than at its best above 1.5 m/s, rad/s."""
    return np.interp(FLOWS, (1.3, 1.5, 1.7), (8.0, 8.0, 6.6)) * FLOWS / 1.4


def with_law(tmp_path, control, gain, units):
    """Return a kept result with another control law, given as the YAML of its section."""
    folder = tmp_path / "result"
    shutil.copytree(DATA / "paper", folder)
    case = folder / "case.yaml"
    text = re.sub(r"(?ms)^control:.*?(?=^limits:)", f"control: {control}\n", case.read_text())
    case.write_text(text)
    edit_summary(folder, gain=gain, gain_units=units)
    return Solution.load(folder)


def tracking(tmp_path, more=""):
    control = f"{{law: tracking, knots: {FLOWS.size}, flow_range: [1.3, 1.7]{more}}}"
    return with_law(tmp_path, control, [*underspeed(), 200.0, 1000.0], UNITS)


def exported(solution, tmp_path, *options):
    export(solution, ["rosco"], tmp_path / "out", options=options)
    return tmp_path / "out" / "rosco"


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Return the design of a kept result and the folder of its files, which are written once."""

    @cache
    def of(name):
        solution = Solution.load(DATA / name)
        folder = exported(solution, tmp_path_factory.mktemp(name), "rosco.speed_filter=40")
        return solution.design(), folder

    return of


def operate(solution, tmp_path, step=0.01, duration=None):
    """Drive the rotor of a result over its flow by ROSCO's controller, and by this program's `own`.

    energy is captured, generated delivered, J.
    """
    design = solution.design()
    blade, rotor = design.blade, design.physics.rotor
    scenario = design.physics.scenarios[0]
    duration = duration or scenario.mesh.duration
    time = np.arange(0.0, duration + 0.5 * step, step)
    flow = scenario.inflow.speed_at(time)
    density = design.physics.density
    plant = Plant(blade, rotor.polar, design.inertia, density, bem.rotor_coefficients)
    speed = float(solution.trajectory["rotor_speed_rad_s"][0])
    torque, states = FeedbackTorque(design.law, design.gains), ()
    if design.law.states:
        (speed,), _, states = equilibria(plant, torque, flow[:1])
    start = [speed, *(each[0] for each in states)]
    simulation = simulate(plant, scenario.inflow, torque, start, time)
    inputs, outputs = tmp_path / "given.npz", tmp_path / "found.npz"
    ratio = np.linspace(0.5, 20.0, 1200)
    np.savez(
        inputs,
        library=library(),
        discon=str(exported(solution, tmp_path) / "DISCON.IN"),
        step=step,
        flow=flow,
        ratio=ratio,
        coefficient=rotor.coefficients(blade, ratio).torque,
        scale=float(torque_scale(density, blade.rotor_radius, 1.0)),
        radius=blade.rotor_radius,
        inertia=design.inertia,
        speed=speed,
        blades=blade.blade_count,
    )
    command = [sys.executable, str(Path(__file__).with_name("rosco_run.py")), inputs, outputs]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    result = np.load(outputs)
    speed, torque = result["speed"], result["torque"]
    energy = np.trapezoid(plant.torque(speed, flow) * speed, time)
    outputs = {"energy": energy, "generated": np.trapezoid(torque * speed, time), "own": simulation}
    return SimpleNamespace(time=time, speed=speed, torque=torque, **outputs)


def library():
    """Return the path of the controller that the package `rosco` brings."""
    (folder,) = importlib.util.find_spec("rosco").submodule_search_locations
    (path,) = (each for each in Path(folder).glob("lib/libdiscon.*") if each.suffix != ".a")
    return str(path)


def away(operation, begin=0.5):
    """Return the largest difference of the speeds over the mean, from a time (s) on."""
    apart = np.abs(operation.speed - operation.own.rotor_speed)[operation.time >= begin]
    return np.max(apart) / np.mean(operation.speed)


def test_table_has_the_coefficients_of_direct_bem(kept):
    design, folder = kept("river")
    pitch, ratio, power, thrust, torque = rosco().load_from_txt(str(folder / "Cp_Ct_Cq.txt"))
    rotor, blade = design.physics.rotor, design.blade
    assert 0.0 in pitch
    for column in (list(pitch).index(0.0), -1):
        pitched = blade.with_shape(blade.chord, blade.twist + pitch[column])
        coefficients = rotor.coefficients(pitched, ratio)
        np.testing.assert_allclose(power[:, column], coefficients.power, atol=1e-6)
        np.testing.assert_allclose(thrust[:, column], coefficients.thrust, atol=1e-6)
        np.testing.assert_allclose(torque[:, column], coefficients.torque, atol=1e-6)


@pytest.mark.parametrize("name", ["paper", "river"])
def test_quadratic_and_rated_law_are_overspeed_by_vs_fbp_1(kept, name):
    """From the speed at which K w² meets the limit of the torque, or the rated power."""
    design, folder = kept(name)
    text = rosco().read_DISCON(str(folder / "DISCON.IN"))
    inputs = {key: float(x) for key, x in text.items() if np.isscalar(x) and not isinstance(x, str)}
    assert (inputs["VS_ControlMode"], inputs["VS_FBP"]) == (1, 1)
    gain, *power = design.gains
    wanted = {"VS_Rgn2K": gain, "WE_Jtot": design.inertia, "WE_RhoAir": design.physics.density}
    if name == "paper":
        wanted |= {"VS_MaxTq": 700.0, "VS_RefSpd": np.sqrt(700.0 / gain)}
    else:
        wanted |= {"VS_RtPwr": power[0], "VS_RefSpd": np.cbrt(power[0] / gain)}
    assert {key: inputs[key] for key in wanted} == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("name", ["paper", "river"])
def test_schedule_is_the_equilibrium_of_the_law(kept, name):
    design, folder = kept(name)
    inputs = rosco().read_DISCON(str(folder / "DISCON.IN"))
    flow, speed, torque = (np.array(inputs[f"VS_FBP_{each}"]) for each in ("U", "Omega", "Tau"))
    blade, rotor = design.blade, design.physics.rotor
    scale = torque_scale(design.physics.density, blade.rotor_radius, flow)
    driving = scale * rotor.coefficients(blade, speed * blade.rotor_radius / flow).torque
    np.testing.assert_allclose(driving, torque, rtol=1e-7)
    np.testing.assert_allclose(design.law.torque(speed, design.gains), torque, rtol=1e-6)
    assert np.all(np.diff(flow) > 0.0)


def test_tracking_is_a_speed_over_the_flow_by_vs_fbp_2(tmp_path):
    inputs = rosco().read_DISCON(str(exported(tracking(tmp_path), tmp_path) / "DISCON.IN"))
    assert (int(inputs["VS_ControlMode"]), int(inputs["VS_FBP"])) == (2, 2)
    assert (float(inputs["VS_KP"]), float(inputs["VS_KI"])) == (-200.0, -1000.0)
    at_knots = np.interp(FLOWS, inputs["VS_FBP_U"], inputs["VS_FBP_Omega"])
    np.testing.assert_allclose(at_knots, underspeed(), rtol=1e-3)  # linear between the columns
    assert float(inputs["F_WECornerFreq"]) == 10.0 / 0.1  # the lag of the sensor


def test_a_law_whose_torque_rises_is_a_speed_over_the_torque_by_vs_fbp_3(tmp_path):
    law = "{law: power_law, exponent: 1.5, cut_out: 2.4}"
    file = exported(with_law(tmp_path, law, 22.0, ["N*m"]), tmp_path) / "DISCON.IN"
    assert "! cut-out, not part of the law: a flow of 2.4 m/s" in file.read_text()
    inputs = rosco().read_DISCON(str(file))
    assert (int(inputs["VS_ControlMode"]), int(inputs["VS_FBP"])) == (4, 3)
    speed, torque = np.array(inputs["VS_FBP_Omega"]), np.array(inputs["VS_FBP_Tau"])
    np.testing.assert_allclose(torque, 22.0 * speed**1.5, rtol=1e-8)
    assert np.all(np.diff(torque) > 0.0)


def test_a_torque_that_falls_is_refused_with_the_reason(tmp_path):
    solution = with_law(tmp_path, "{law: power_law, exponent: -0.5}", 1700.0, ["N*m"])
    with pytest.raises(InputError, match="has to increase") as caught:
        exported(solution, tmp_path)
    assert (caught.value.key, caught.value.value) == ("--to", "rosco")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_rosco_flies_the_quadratic_law_as_this_program_does(tmp_path):
    """ROSCO's limit is sharp, the program's smoothed; with a sharp one the energies are equal."""
    paper = Solution.load(DATA / "paper")
    operation = operate(paper, tmp_path)
    assert operation.energy == pytest.approx(operation.own.energy, rel=1e-4)
    assert away(operation) < 0.01
    assert paper.case.control.smoothing == 0.001
    (tmp_path / "sharp").mkdir()
    control = "{law: quadratic, torque_limit: 700, smoothing: 1e-9}"
    solution = with_law(tmp_path / "sharp", control, paper.gain, ["N*m*s**2/rad**2"])
    operation = operate(solution, tmp_path / "sharp")
    assert operation.energy == pytest.approx(operation.own.energy, rel=1e-6)
    assert operation.generated == pytest.approx(operation.own.generator_energy, rel=5e-5)
    assert away(operation) < 1e-3


@pytest.mark.slow
def test_rosco_flies_the_rated_law_as_this_program_does(tmp_path):
    operation = operate(Solution.load(DATA / "river"), tmp_path)
    assert operation.energy == pytest.approx(operation.own.energy, rel=1e-3)
    assert away(operation, 2.0) < 0.02
    # but for its first two calls, in which it does not know the schedule yet
    assert np.max(operation.torque[2:]) < 1.02 * np.max(operation.own.control_torque)


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", ", flow: estimated"])
def test_rosco_holds_the_schedule_of_a_tracking_law(tmp_path, more):
    """Also where the rotor is to turn slower in a faster flow, and by its own flow estimator."""
    solution = tracking(tmp_path, more)
    operation = operate(solution, tmp_path, 0.0025, 20.0)
    assert operation.energy == pytest.approx(operation.own.energy, rel=2e-4)
    assert operation.generated == pytest.approx(operation.own.generator_energy, rel=2e-4)
    assert away(operation) < 0.01
    fastest = np.argmax(operation.own.inflow_speed)
    assert operation.speed[fastest] < 0.9 * 8.0 * operation.own.inflow_speed[fastest] / 1.4


@pytest.mark.slow
def test_rosco_follows_a_law_of_the_speed_by_its_torque(tmp_path):
    control = "{law: power_law, exponent: 1.5, torque_limit: 700}"
    operation = operate(with_law(tmp_path, control, 22.0, ["N*m"]), tmp_path)
    assert operation.energy == pytest.approx(operation.own.energy, rel=2e-4)
    assert away(operation) < 0.01
