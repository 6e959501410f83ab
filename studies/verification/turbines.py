"""The part of the verification study on turbines that nobody here has designed."""

import json
import os
import resource
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from textwrap import shorten

import numpy as np
import yaml

from hkt_mdo.errors import InputError
from hkt_mdo.results.solution import Solution
from studies.study_common import markdown_table

LAWS = "rated", "curve", "quadratic", "open_loop"
LONGEST = 300  # s of processor time of a run, after which it is ended
BELOW = 1e-4  # of the delivered energy: an open loop further below a law's is a false optimum
FILES = Path(__file__).parents[2] / "cases" / "examples" / "files"
SECTIONS = {  # foils that have suction and outlines, of which blades are made
    "naca44xx": {
        "sections": [
            {"polar": f"{FILES}/naca{name}_polars.csv", "outline": f"{FILES}/naca{name}.csv"}
            for name in (4412, 4418, 4424)
        ]
    },
    "naca63424": {"polar": "naca63424_Re1e6", "outline": "naca63424"},
    "naca63815": {"polar": "naca63815_Re1e6", "outline": "naca63815"},
}
ALLOWED = {"steel_s355": 150e6, "aluminium_6061_t6": 90e6, "glass_epoxy_triaxial": 80e6}  # Pa
POWER, RATIO, THRUST = 0.42, 5.5, 0.85  # coefficients and tip speed ratio of a usual rotor


def turbines(study) -> list[str]:
    """Draw turbines at random, and design each for four laws at default settings.

    Drawn are size (0.6 to 8 m), blade, sections, material, wall, generator, drive train, flow
    (turbulence of two spectra, a gust, a sine) and limits of torque, power, thrust, stress and
    mostly cavitation, scaled to the turbine. Each run is a process of `hkt run` without figures,
    which is ended after 300 s of processor time; times are those of the processor. Goals: 95 %
    verified, the median below a minute, no run over five; open loop never more than 1e-4 below a
    law. They are compared over closed cycles, by delivered energy: a law is simulated in its flow
    once more, from the speed at which it ended, and stored energy is subtracted.
    """
    tasks = []
    for i in range(study.count):
        folder = study.out / "turbines" / f"{study.seed}_{i:03d}"
        turbine = draw(np.random.default_rng([study.seed, i]))
        tasks += [(folder, law, turbine) for law in LAWS]
    with ThreadPoolExecutor(study.jobs or os.cpu_count()) as pool:
        runs = list(pool.map(lambda task: _run(study, *task), tasks))
    return table(runs)


@dataclass(frozen=True)
class Run:
    """How a run ended: its result, or None where there is none, and its processor time, s."""

    folder: Path
    result: Solution | None
    seconds: float
    message: str

    @property
    def verified(self) -> bool:
        """Tell whether it is a verified result."""
        return self.result is not None and self.result.success

    @cached_property
    def delivered(self) -> float:
        """Its objective over a closed cycle, less what is stored, J; NaN if it is not verified."""
        if not self.verified:
            return np.nan
        design = self.result.design()
        simulated = design.simulate(design.physics.inflow)
        if design.law.is_feedback:
            simulated = design.simulate(design.physics.inflow, float(simulated.rotor_speed[-1]))
        if self.result.summary.objective.kind == "electrical":
            return simulated.electrical_energy
        return simulated.energy - simulated.kinetic_energy_change


def _run(study, folder, law, turbine) -> Run:
    """Run a turbine under a law, or return the result that its folder has."""
    out, path = folder / law, folder / f"{law}.json"
    if not path.exists():
        file = write(folder, law, turbine)
        command = [sys.executable, "-m", "hkt_mdo", "run", file, "--out", out, "--force"]
        seconds, message = _in_process([*command, "--no-figures"])
        path.write_text(json.dumps({"seconds": seconds, "message": message}), encoding="utf-8")
        study.done(out, message or "ok")
    record = json.loads(path.read_text(encoding="utf-8"))
    try:
        result = Solution.load(out)
    except InputError:
        result = None
    message = record["message"] or (result.message if result else "no result")
    return Run(out, result, record["seconds"], message)


def write(folder, law, turbine) -> Path:
    """Write the blade and the case of a turbine under a law, and return the case's file."""
    folder.mkdir(parents=True, exist_ok=True)
    blade = turbine["rotor"]["blade"]
    rows = np.column_stack([*blade.values()])
    np.savetxt(folder / "blade.csv", rows, "%.5f", ",", header=",".join(blade), comments="")
    case = turbine | {
        "rotor": turbine["rotor"] | {"blade": "blade.csv"},
        "control": {"law": law, **turbine["control"]},
    }
    file = folder / f"{law}.yaml"
    file.write_text(yaml.safe_dump(case, sort_keys=False), encoding="utf-8")
    return file


def _in_process(command) -> tuple[float, str]:
    """Run a command for at most LONGEST; return its processor time, s, and an error, if any."""

    def limited():
        resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST + 5))

    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, preexec_fn=limited, **quiet) as process:
        errors = process.stderr.read().strip().splitlines()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode == -signal.SIGXCPU:
        return LONGEST, f"ended after {LONGEST} s of processor time"
    wrong = process.returncode not in (0, 1, 3) and errors
    return used.ru_utime + used.ru_stime, errors[-1] if wrong else ""


def table(runs) -> list[str]:
    """Return a table of the laws, of the turbines, and the runs that are not verified."""
    groups = [(law, [run for run in runs if run.folder.name == law]) for law in LAWS]
    rows = []
    for law, group in (*groups, ("**all**", runs)):
        times, good = [run.seconds for run in group], sum(run.verified for run in group)
        rows.append(
            [
                law,
                f"{good}/{len(group)}, {100.0 * good / len(group):.0f} %",
                f"{np.median(times):.0f} ({max(times):.0f})",
                str(sum(run.seconds >= LONGEST for run in group)),
            ]
        )
    lines = markdown_table(("law", "verified", "time, median (longest), s", "ended"), rows)
    below = []
    for *laws, ceiling in zip(*(group for _, group in groups), strict=True):
        for run in laws:
            over = run.delivered / ceiling.delivered - 1.0
            if over > BELOW:
                below.append(f"- `{run.folder.parent.name}`: {run.folder.name} is {over:.2e} above")
    failed = [
        f"- `{run.folder.parent.name}/{run.folder.name}`, {run.seconds:.0f} s: "
        + shorten(run.message, 64, placeholder=" …")
        for run in runs
        if not run.verified
    ]
    line = f"Over closed cycles a law is more than {BELOW:g} above open loop in {len(below)} runs."
    if failed:
        failed = ["", "Not verified:", "", *failed]
    return [*lines, "", line, "", *below, *failed]


def draw(rng: np.random.Generator) -> dict:
    """Return the case of a random turbine, but for its law."""

    def between(low, high):
        return round(float(rng.uniform(low, high)), 4)

    def spread(low, high):
        return float(f"{np.exp(rng.uniform(*np.log((low, high)))):.4g}")

    radius, mean = spread(0.6, 8.0), between(1.2, 2.6)
    rated_speed = mean * between(0.9, 1.15)  # of the flow
    kinetic = 500.0 * np.pi * radius**2 * rated_speed**2  # N
    power, turning = POWER * kinetic * rated_speed, RATIO * rated_speed / radius
    losses = power * between(0.02, 0.05)
    depth = radius * between(1.3, 3.0) + 0.5
    family = str(rng.choice([*SECTIONS]))
    large, solid = bool(radius > 1.5), bool(rng.random() < 0.3)
    materials = ("glass_epoxy_triaxial", "steel_s355") if large else ("aluminium_6061_t6",)
    material = str(rng.choice(materials))
    limits = {
        "power": float(f"{power:.4g}"),
        "thrust": float(f"{THRUST * kinetic * between(0.9, 1.3):.4g}"),
        "stress": ALLOWED[material],
    }
    if rng.random() < 0.7:
        limits["cavitation"] = {"depth": round(depth, 2), "margin": 1.1}
    return {
        "rotor": {
            "blade": _blade(between),
            "radius": radius,
            "hub_radius_fraction": between(0.1, 0.18),
            "blade_count": int(rng.choice([2, 3, 3, 4])),
            "reynolds_number": 1e6 if family == "naca44xx" else None,
            **SECTIONS[family],
            "material": material,
            "wall": None if solid and not large else between(0.02, 0.05),
            "hub_inertia": float(f"{spread(0.5, 5.0) * radius**5:.4g}"),
        },
        "inflow": _flow(rng, between, radius, mean),
        "control": {"torque_limit": float(f"{power / turning * between(1.0, 1.5):.4g}")},
        "generator": {
            "rated_torque": float(f"{power / turning:.4g}"),
            "rated_speed": float(f"{turning:.4g}"),
            **dict.fromkeys(("copper_loss", "friction_loss", "iron_loss"), float(f"{losses:.4g}")),
        },
        "objective": str(rng.choice(["captured", "electrical"])),
        "limits": limits,
        "design": {
            **dict.fromkeys(("chord_points", "twist_points"), int(rng.integers(4, 8))),
            "chord_bounds": [round(0.03 * radius, 4), round(0.22 * radius, 4)],
        },
    }


def _blade(between) -> dict:
    """Return a blade's columns: a chord that tapers, and the twist of a tip speed ratio."""
    radius = np.linspace(0.1, 0.99, 12)
    inflow = np.rad2deg(np.arctan(2.0 / (3.0 * between(4.5, 6.5) * radius)))
    return {
        "r_over_R": radius,
        "chord_over_R": between(0.1, 0.18) * (1.0 - between(0.4, 0.7) * radius),
        "twist_deg": inflow - between(3.0, 6.0),
        "t_over_c": np.interp(radius, (0.2, 0.9), (0.24, 0.14)),
    }


def _flow(rng, between, radius, mean) -> dict:
    """Return a random flow of a minute whose eddies are larger than the rotor."""
    kind = rng.choice(["von_karman", "kaimal", "gust", "sine"], p=[0.35, 0.35, 0.15, 0.15])
    if kind == "sine":
        share, frequency = between(0.05, 0.2), between(0.1, 0.6)
        return {"profile": "sine", "mean": mean, "amplitude": round(share * mean, 4),
                "angular_frequency": frequency}  # fmt: skip
    if kind == "gust":
        return {"profile": "gust", "mean": mean, "amplitude": round(between(0.15, 0.4) * mean, 4),
                "time": between(15.0, 40.0), "width": between(4.0, 12.0)}  # fmt: skip
    return {
        "profile": "turbulence", "spectrum": str(kind), "mean": mean,
        "intensity": between(0.06, 0.16), "length_scale": between(2.0, 4.0) + radius / 4.0,
        "duration": 60, "seed": int(rng.integers(1, 1000)), "amplitudes": "random",
        "cutoff": round(min(mean / (2.0 * radius), 0.5), 4),
    }  # fmt: skip
