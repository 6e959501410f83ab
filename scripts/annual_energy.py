"""A year of HARP_Opt's shipped turbine: writes docs/annual_energy.md and its figure.

python scripts/annual_energy.py --out results/annual_energy

HARP_Opt's example of a fixed pitch and a variable speed (NREL/HARP_Opt, Output/test_VSFP) is scored
by this program's evaluator on HARP_Opt's own blade, and its blade is designed again under the same
limits. The data are in tests/data/harp_opt, with their licence.
"""

import argparse
import time
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hkt_mdo import Limit, load_case, run_case
from hkt_mdo.dynamics.simulation import Plant
from hkt_mdo.files.record_table import read_pairs
from hkt_mdo.problem.physics import BEM, physics
from hkt_mdo.results import style

ROOT = Path(__file__).parent.parent
DATA = ROOT / "tests" / "data" / "harp_opt"
RATED, HOURS = 550e3, 8760.0  # W; hours of a year in HARP_Opt
SLOWEST, FASTEST = 5.0, 15.0  # rpm
RPM = np.pi / 30.0
REPORTED = 1_847_218.0  # kWh a year, as the issue and HARP_Opt's own files have it


class LeastRotorSpeed(Limit):
    """Smallest angular speed of the rotor."""

    name: ClassVar[str] = "least_rotor_speed"
    unit: ClassVar[str] = "rad/s"
    inputs: ClassVar[tuple[str, ...]] = ("rotor_speed",)
    lower: ClassVar[float] = SLOWEST * RPM

    def value(self, rotor_speed):
        return 1.0 * rotor_speed  # a constraint of its own beside that of limits.rotor_speed


class FallingTwist(Limit):
    """The twist does not grow outwards: difference of neighbouring stations."""

    name: ClassVar[str] = "falling_twist"
    unit: ClassVar[str] = "rad"
    inputs: ClassVar[tuple[str, ...]] = ("twist",)
    upper: ClassVar[float] = 0.0

    def value(self, twist):
        return twist[1:] - twist[:-1]

    def excess(self, quantities):
        return self.value_of(quantities) / np.deg2rad(1.0)


LIMITS = [LeastRotorSpeed, FallingTwist]


def rotor() -> dict[str, Any]:
    """Return HARP_Opt's rotor as the section of a case."""
    r, _ = read_pairs(DATA / "blade.csv", ("r_m", "chord_m"))
    polars = sorted(DATA.glob("ffa_*.csv"), reverse=True)
    sections = [
        {"name": x.stem, "polar": str(x), "thickness": int(x.stem[-4:]) / 1000.0, "area": 0.15}
        for x in polars
    ]
    return {
        "blade": str(DATA / "blade.csv"),
        "radius": 10.0,
        "hub_radius_fraction": 0.1,
        "blade_count": 2,
        "stations": [float(x) for x in r / 10.0],
        "sections": sections,
    }


def case(**about: Any):
    """Return the case of HARP_Opt's example, with some sections of its own."""
    data = {
        "rotor": rotor(),
        "fluid": {"density": 1025.0},
        "site": {"hub_depth": 37.0},
        "resource": {"profile": "histogram", "file": str(DATA / "flow.csv"), "cut_in": 0.49},
        "control": {"law": "open_loop"},
        "limits": {
            "power": RATED,
            "rotor_speed": FASTEST * RPM,
            "cavitation": {"margin": 1.0},
            "least_rotor_speed": {},
        },
        "hydrodynamics": {"tolerance": 5e-4},
    }
    data["limits"] |= about.pop("limits", {})
    return load_case(data | about, extensions=LIMITS)


DESIGNED = {
    "design": {
        "chord_points": 5,
        "twist_points": 5,
        "chord_bounds": [0.01, 3.0],
        "twist_bounds": [-10.0, 40.0],
    },
    "limits": {"falling_twist": {}},
}
