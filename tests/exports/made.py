"""Results of any case without an optimization: the starting blade, and an operation invented."""

from pathlib import Path

import numpy as np

from hkt_mdo.case import read_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.folder import write_csv, write_json
from hkt_mdo.results.solution import Solution
from tests.conftest import CASES, operate


def made(folder: Path, text: str, gains=None, extensions=(), **summary) -> Solution:
    """Write the result folder of a case with its blade as given, and return it."""
    case = read_case(text, file=str(CASES / "case.yaml"), extensions=extensions)
    model = physics(case)
    blade, names = model.blade, list(model.shares)
    folder.mkdir(parents=True)
    (folder / "case.yaml").write_text(case.to_yaml(), encoding="utf-8")
    for index, name in enumerate(names):
        for table, count in (("trajectory", 61), ("simulation", 241)):
            suffix = f"_{name}" if len(names) > 1 else ""
            series = operate(np.linspace(0.0, 60.0, count), case.control.torque_limit, "quadratic")
            series["thrust_N"] *= 1.0 + index
            write_csv(folder / f"{table}{suffix}.csv", series)
    columns = ("tip_speed_ratio", "power_coefficient", "start_power_coefficient")
    write_csv(folder / "coefficients.csv", {name: np.linspace(1.0, 2.0, 3) for name in columns})
    defaults = {
        "case": case.name,
        "success": True,
        "message": "converged and verified",
        "gain": None if gains is None else list(gains),
        "gain_units": list(model.law.gain_units),
        "scenarios": {name: {"weight": 1.0} for name in names},
        "rotor_radius_m": blade.rotor_radius,
        "inertia_kg_m2": float(model.rotor.mass_and_inertia(blade)[1]),
        "r_m": blade.r,
        "chord_m": blade.chord,
        "twist_deg": np.rad2deg(blade.twist),
        "thickness_over_chord": blade.thickness,
    }
    write_json(folder / "summary.json", defaults | summary)
    return Solution.load(folder, extensions=extensions)
