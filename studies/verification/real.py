"""The part of the verification study that designs on from real blades of several sections."""

from pathlib import Path

from hkt_mdo.case import load_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor.scales import torque_scale
from studies.study_common import LAWS

BLADES = Path(__file__).parents[2] / "tests" / "data" / "blades"
RADIUS = 8.0  # m, of blades from files: those of wind turbines would need flows of the sea
WITHOUT_ROOT = 0.2  # hub over radius that leaves out the root, where the flow stalls at once
LOWERED = 0.042  # torque limit as a torque coefficient: about 0.8 of what an open loop asks for


def real_cases():
    """Return cases with default settings by name: of RM1 and every windIO file of `BLADES`."""
    files = sorted(BLADES.glob("*.yaml"))
    rotors = {"rm1": {"blade": "rm1"}}
    rotors |= {file.stem: {"blade": str(file.resolve()), "radius": RADIUS} for file in files}
    rotors["iea3_4_without_root"] = rotors["iea3_4"] | {"hub_radius_fraction": WITHOUT_ROOT}
    cases = {}
    for blade, rotor in rotors.items():
        for law in LAWS:
            control = {"law": law.replace("oloc", "open_loop")}
            design = {"chord_bounds": [0.01, 1.0]}  # those of the paper, as in the whole study
            keys = {"rotor": rotor, "inflow": "sine", "control": control, "design": design}
            case = load_case(keys)
            physics_ = physics(case)
            fastest = physics_.inflow.speed_at(physics_.scenarios[0].samples).max()
            limit = LOWERED * torque_scale(physics_.density, physics_.blade.rotor_radius, fastest)
            cases[f"{blade}/{law}"] = case
            cases[f"{blade}/{law}_limited"] = case.with_overrides(f"control.torque_limit={limit:g}")
    return cases
