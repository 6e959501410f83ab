"""A year of HARP_Opt's shipped turbine: writes docs/studies/annual_energy.md and its figure.

python studies/annual_energy.py --out results/annual_energy

HARP_Opt's example of a fixed pitch and a variable speed (NREL/HARP_Opt, Output/test_VSFP) is scored
by this program's evaluator on HARP_Opt's own blade, and its blade is designed again under the same
limits. The data are in tests/data/harp_opt, with their licence.
"""

import argparse
import time
from copy import deepcopy
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import page_data
from matplotlib.figure import Figure
from study_plots import line

from hkt_mdo import Limit, load_case, run_case
from hkt_mdo.dynamics.simulation import Plant
from hkt_mdo.files.record_table import read_pairs
from hkt_mdo.problem.physics import physics
from hkt_mdo.results import style
from hkt_mdo.rotor.model import SOLVERS

ROOT = Path(__file__).parent.parent
DATA = ROOT / "tests" / "data" / "harp_opt"
RATED, HOURS = 550e3, 8760.0  # W; hours of a year in HARP_Opt
SLOWEST, FASTEST = 5.0, 15.0  # rpm
RPM = np.pi / 30.0


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
    r = read_pairs(DATA / "blade.csv", ("r_m", "chord_m"))[0].values
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


def case(**sections: Any):
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
    data["limits"] |= sections.pop("limits", {})
    return load_case(data | sections, extensions=LIMITS)


DESIGNED = {
    "design": {
        "chord_points": 5,
        "twist_points": 5,
        "chord_bounds": [0.01, 3.0],
        "twist_bounds": [-10.0, 40.0],
    },
    "limits": {"falling_twist": {}},
}
ROWS = {
    "fixed": "HARP_Opt's blade, speeds chosen by this program",
    "design": "co-design: chord and twist by five control points each, twist falling",
}
SECTIONS = {"fixed": {"design": {"blade": "fixed"}}, "design": DESIGNED}

PAGE = """# A year of HARP_Opt's turbine

HARP_Opt ([NREL/HARP_Opt](https://github.com/NREL/HARP_Opt), Apache 2.0) designs rotors for the
energy of a year by a pattern search or a genetic algorithm on WT_Perf. Its shipped example of a
fixed pitch and a variable speed, `Output/test_VSFP`, is a rotor of 20 m with two blades and 550 kW
in the flow of Admiralty Inlet. Here its blade is scored by this program, and designed again.
Written by `python studies/annual_energy.py`; the data are in
[tests/data/harp_opt](../../tests/data/harp_opt), with their licence. How a year is computed:
[year.md](../year.md).

| | energy a year / kWh | to HARP_Opt's blade here | success | processor time / s |
|---|---|---|---|---|
{rows}

- **The gain of co-design is {gain:+.2f} %**, against HARP_Opt's own blade under the same evaluator,
  limits and flow, each with the best speeds that this program finds for it. Against the energy that
  HARP_Opt reports it is {reported:+.2f} %, which includes the difference of the evaluators.
- The energy that HARP_Opt reports follows from its own power curve: the sum over the bins of power,
  at most 550 kW, times the bin's share of the time times 8760 h. The curve itself has {over:.1f} kW
  at 2.1 m/s.
- With HARP_Opt's blade at HARP_Opt's rotor speeds, power here differs by {region:+.2f} % from that
  of WT_Perf between 0.9 and 1.9 m/s, where the tip speed ratio is constant. WT_Perf sums over
  elements, this program integrates between stations ([bem.md](bem.md)).
- HARP_Opt stopped at its limit of 20 iterations, after 273 evaluations.

![Power, energy by bins, chord and twist](../images/annual_energy.png)

## What is the same, and what is not

| | HARP_Opt | here |
|---|---|---|
{compared}

- Beyond rated flow both rotors are slowed down into stall. A torque that does not depend on the
  speed does not hold such a rotor: it needs a controller of its speed, in HARP_Opt's result too.
- HARP_Opt's example has no limit on the stress, and neither have these runs. Solid blades of
  aluminium with the outline of NACA 63-815, scaled to the thickness, would have a stress of
  {stress:.0f} MPa in the co-design and {own_stress:.0f} MPa in HARP_Opt's blade: a part of the gain
  comes from the more slender blade. With a limit on the stress it would be smaller.
- Beyond 20 degrees of the angle of attack, lift and drag are those that HARP_Opt's tables extend.
"""

COMPARED = (
    ("flow", "bins of 0.1 m/s, 8760 h, operation from 0.5 to 3.5 m/s", "the same"),
    ("limits of the operation", "550 kW of shaft power, 5 to 15 rpm", "the same"),
    ("cavitation", "blade upwards, hub at 37 m", "the same, as a limit at every speed"),
    (
        "chord",
        "up to 3 m, falling outwards",
        "up to 3 m, without a condition that it falls ({chord})",
    ),
    ("twist", "-10 to 40 deg, falling outwards", "the same"),
    ("shape", "five control points each of chord and twist", "the same, another spline"),
    ("thickness", "places of three sections, designed", "that of HARP_Opt's result"),
    ("sections", "FFA-W3 of 21 to 30 %, one Reynolds number", "HARP_Opt's own tables"),
    ("rotor speed", "constant tip speed ratio, then the power limit", "free at each flow speed"),
    ("physics", "losses at tip and hub, drag in the induction", "the same, summed in another way"),
)


def flow() -> tuple[np.ndarray, np.ndarray]:
    """Return speeds, m/s, and hours of a year of HARP_Opt's histogram."""
    return tuple(x.values for x in read_pairs(DATA / "flow.csv", ("speed_m_s", "hours")))


def scored() -> dict[str, float]:
    """Return HARP_Opt's own energy, and that of its blade at its speeds by direct BEM, kWh."""
    table = np.genfromtxt(DATA / "power.csv", delimiter=",", names=True)
    speed, turning = table["speed_m_s"], table["rotor_speed_rpm"] * RPM
    model = physics(case(**deepcopy(SECTIONS["fixed"])))
    plant = Plant(model.blade, model.rotor.polar, 1.0, model.density, SOLVERS["vectorized"])
    power = {"own": table["power_kW"], "here": 1e-3 * plant.torque(turning, speed) * turning}
    v, hours = flow()
    energies = {
        name: float(hours @ np.interp(v, speed, np.minimum(curve, 1e-3 * RATED), left=0.0))
        for name, curve in power.items()
    }
    steady = (speed > 0.85) & (speed < 1.95)
    ratio = np.mean(power["here"][steady] / power["own"][steady]) - 1.0
    return energies | {"over": float(table["power_kW"][speed == 2.1][0]), "region": 100.0 * ratio}


def annual(solution) -> float:
    """Return the energy of HARP_Opt's year, kWh, from the power at each speed of its flow."""
    v, hours = flow()
    table = solution.year
    power = np.interp(v, table["inflow_speed_m_s"], table["captured_power_W"], left=0.0)
    return 1e-3 * float(hours @ power)


def draw(solutions, path: Path) -> None:
    """Draw power, energy by bins, chord and twist of HARP_Opt's blade and of the co-design."""
    table = np.genfromtxt(DATA / "power.csv", delimiter=",", names=True)
    names = {"fixed": "HARP_Opt's blade", "design": "co-design"}
    figure = Figure(figsize=(8.4, 6.2), layout="constrained")
    axes = figure.subplots(2, 2)
    axes[0, 0].plot(table["speed_m_s"], table["power_kW"], ":", color="0.3", label="HARP_Opt's own")
    for index, (key, name) in enumerate(names.items()):
        look, solution = line(index), solutions[key]
        year, blade = solution.year, solution.blade
        speed = year["inflow_speed_m_s"]
        axes[0, 0].plot(speed, 1e-3 * year["captured_power_W"], label=name, **look)
        axes[0, 1].plot(speed, 1e-3 * year["energy_kWh"], label=name, **look)
        axes[1, 0].plot(blade["r_m"], blade["chord_m"], label=name, **look)
        axes[1, 1].plot(blade["r_m"], blade["twist_deg"], label=name, **look)
    words = [("inflow speed (m/s)", "power (kW)"), ("inflow speed (m/s)", "energy a year (MW h)")]
    words += [("radius (m)", "chord (m)"), ("radius (m)", "twist (deg)")]
    for ax, (x, y) in zip(axes.ravel(), words, strict=True):
        style.legend([style.finish(ax, x, y)])
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Run the cases and write page and figure."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/annual_energy"))
    out = parser.parse_args().out
    score, solutions, seconds = scored(), {}, {}
    for name, sections in SECTIONS.items():
        began = time.process_time()
        variant = case(name=f"harp_opt_{name}", **deepcopy(sections))
        solutions[name] = run_case(variant, out / name, force=True, figures=False, records=False)
        seconds[name] = time.process_time() - began
    results = {
        name: {
            "success": solution.success,
            "energy_kWh": annual(solution),
            "processor_time_s": seconds[name],
            "stress_Pa": solution.summary.loads["stress"].value,
            "chord_falls": bool(np.all(np.diff(solution.blade["chord_m"]) <= 0.0)),
        }
        for name, solution in solutions.items()
    }
    draw(solutions, ROOT / "docs" / "images" / "annual_energy.png")
    page_data.page_from("annual_energy", from_data, results=results, score=score)


def from_data(data: dict) -> str:
    """Return the page of its data."""
    score, results = data["score"], data["results"]
    energy = {name: each["energy_kWh"] for name, each in results.items()}
    lines = [("reported by HARP_Opt, by WT_Perf", score["own"], "unconverged", "")]
    lines.append(("HARP_Opt's blade at HARP_Opt's speeds, scored here", score["here"], "", ""))
    for name, text in ROWS.items():
        success = "yes" if results[name]["success"] else "no"
        lines.append((text, energy[name], success, f"{results[name]['processor_time_s']:.0f}"))
    rows = []
    for text, value, ok, seconds in lines:
        more = 100.0 * (value / energy["fixed"] - 1.0)
        kilowatt_hours = f"{value:,.0f}".replace(",", " ")
        rows.append(f"| {text} | {kilowatt_hours} | {more:+.2f} % | {ok} | {seconds} |")
    compared = "\n".join(f"| {' | '.join(row)} |" for row in COMPARED)
    return PAGE.format(
        rows="\n".join(rows),
        gain=100.0 * (energy["design"] / energy["fixed"] - 1.0),
        reported=100.0 * (energy["design"] / score["own"] - 1.0),
        over=score["over"],
        region=score["region"],
        compared=compared.format(
            chord="it does" if results["design"]["chord_falls"] else "it does not"
        ),
        stress=1e-6 * results["design"]["stress_Pa"],
        own_stress=1e-6 * results["fixed"]["stress_Pa"],
    )


if __name__ == "__main__":
    main()
