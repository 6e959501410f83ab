"""Prescribed ramps of rotor speed and of flow speed: what AeroDyn's driver makes of them.

The inputs follow from those of `hkt export RESULT --to openfast`; only the model of the wake over
time, the motion and the output change. `python -m tests.dynamics.aerodyn_runs` writes what
`tests/data/openfast` keeps.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from hkt_mdo import Solution
from hkt_mdo.exports.base import export

DATA = Path(__file__).parents[1] / "data" / "openfast"
RAMP = 0.1  # s
KEPT = 80  # points of a hold, at least
COLUMNS = "time_s,inflow_speed_m_s,rotor_speed_rad_s,torque_N_m,thrust_N"


@dataclass(frozen=True)
class Ramps:
    """Tip speed ratio and flow (m/s) at the begin; then factors on the speed or the flow.

    Each factor is reached by a ramp of at least ten of AeroDyn's steps, one every `hold` seconds.
    """

    blade: str
    what: str
    """`speed` or `flow`."""
    ratio: float
    flow: float
    factors: tuple[float, ...]
    hold: float
    tau1: float | None
    """Time constant (s); None: by the induction (`DBEMT_Mod` 2)."""
    step: float = 0.01
    """That of AeroDyn, s."""

    @property
    def name(self):
        """Name of the run, and of its kept file."""
        return f"{self.what}_{'constant' if self.tau1 else 'varying'}_tau1"

    @property
    def duration(self):
        """Length of the run, s."""
        return self.hold * (len(self.factors) + 1)

    @property
    def corners(self):
        """Times (s) and factors between which the prescribed quantity is linear."""
        times, values, last = [0.0], [1.0], 1.0
        for number, factor in enumerate(self.factors, 1):
            begin = number * self.hold
            times += [begin, begin + RAMP]
            values += [last, factor]
            last = factor
        return np.array([*times, self.duration]), np.array([*values, last])

    def speeds(self, time, radius):
        """Return rotor speed (rad/s) and flow speed (m/s) at times, s."""
        factor = np.interp(time, *self.corners)
        speed = self.ratio * self.flow / radius
        of_speed, of_flow = (factor, 1.0) if self.what == "speed" else (1.0, factor)
        return speed * of_speed * np.ones_like(factor), self.flow * of_flow * np.ones_like(factor)


RUNS = (
    Ramps("paper", "speed", 8.06, 1.5, (1.02, 0.9), 8.0, 1.0),
    Ramps("paper", "speed", 8.06, 1.5, (1.02, 0.9), 12.0, None),
    Ramps("paper", "flow", 8.06, 1.5, (1.1, 0.9), 8.0, 1.0, 0.005),
    Ramps("rm1", "speed", 6.5, 1.9, (1.05, 0.9), 16.0, 5.0),
    Ramps("rm1", "speed", 6.5, 1.9, (1.05, 0.9), 24.0, None),
    Ramps("rm1", "flow", 6.5, 1.9, (1.1, 0.9), 16.0, 5.0),
    Ramps("river", "speed", 6.0, 1.5, (1.05, 0.9), 8.0, 2.0),
    Ramps("river", "speed", 6.0, 1.5, (1.05, 0.9), 8.0, None),
    Ramps("river", "flow", 6.0, 1.5, (1.1, 0.9), 8.0, 2.0),
)


@cache
def solution(name):
    """Return a kept result."""
    return Solution.load(DATA / name)


@cache
def design_of(name):
    """Return its design."""
    return solution(name).design()


def write_inputs(run, folder):
    """Write AeroDyn's inputs of a run."""
    export(solution(run.blade), ["openfast"], folder)
    inputs = folder / "openfast"
    mode, tau1 = (2, 1.0) if run.tau1 is None else (3, run.tau1)
    _edit(inputs / "aerodyn.dat", DBEMT_Mod=mode, tau1_const=tau1, CavitCheck="False")
    times, _ = run.corners
    speed, flow = run.speeds(times, design_of(run.blade).blade.rotor_radius)
    driver = inputs / "aerodyn_driver.dvr"
    cases = (DATA / "cases.dat").read_text()
    text = re.sub(r"(?m)^----- Cases.*?(?=^----- Output)", cases, driver.read_text(), flags=re.S)
    driver.write_text(text)
    changes = {"TMax": run.duration, "DT": run.step}
    if run.what == "speed":
        changes |= {"AnalysisType": 2, "TimeAnalysisFileName": '"speed.dat"'}
        rpm = speed * 30.0 / np.pi
        rows = [f"{t!r} {v!r} 0 {n!r} 0 0" for t, v, n in _rows(times, flow, rpm)]
        names = "Time HWndSpeed PLExp RotSpd Pitch Yaw"
        (inputs / "speed.dat").write_text("\n".join([names, *rows, ""]))
    else:
        rpm = float(speed[0] * 30.0 / np.pi)
        changes |= {"AnalysisType": 1, "CompInflow": 1, "InflowFile": '"inflow.dat"'}
        changes["RotSpeed(1)"] = rpm
        shutil.copy(DATA / "inflow.dat", inputs)
        rows = [f"{t!r} {v!r} 0 0 0 0 0 0 0" for t, v, _ in _rows(times, flow, speed)]
        (inputs / "flow.dat").write_text("\n".join(["! Time flow", *rows, ""]))
    _edit(driver, **changes)
    return inputs


def _rows(*columns):
    return zip(*(map(float, each) for each in columns), strict=True)


def _edit(path, **changes):
    """Give other values to keys of a file of OpenFAST's."""
    text = path.read_text()
    for key, value in changes.items():
        pattern = rf"(?m)^\S+(\s+{re.escape(key)}\s)"
        text, count = re.subn(pattern, lambda match, v=value: f"{v}{match[1]}", text)
        if count != 1:
            raise ValueError(f"{path.name} has {key} {count} times")
    path.write_text(text)


def driven(program, folder):
    """Run AeroDyn's driver in the folder of its inputs; return its columns by their names."""
    command = [program, "aerodyn_driver.dvr"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=3600)
    if done.returncode:
        raise RuntimeError(done.stdout[-2000:] + done.stderr)
    (path,) = folder.glob("aerodyn_driver*.out")
    lines = path.read_text().splitlines()
    head = next(i for i, line in enumerate(lines) if line.split()[:1] == ["Time"])
    return dict(zip(lines[head].split(), np.loadtxt(lines[head + 2 :]).T, strict=True))


def aerodyn(run, program, folder):
    """Run AeroDyn; return the rows of `COLUMNS`, at some of its steps."""
    of = driven(program, write_inputs(run, folder))
    time = np.round(of["Time"], 9)
    speed, flow = run.speeds(time, design_of(run.blade).blade.rotor_radius)
    rows = np.column_stack((time, flow, speed, of["RtFldMxh"], of["RtFldFxh"]))
    return rows[:: round(run.hold / KEPT / run.step)]


def kept(run):
    """Return the path of what is kept of a run."""
    return DATA / run.blade / "wake" / f"{run.name}.csv"


if __name__ == "__main__":
    for run in RUNS:
        with tempfile.TemporaryDirectory() as folder:
            rows = aerodyn(run, shutil.which("aerodyn_driver"), Path(folder))
        kept(run).parent.mkdir(exist_ok=True)
        lines = [",".join(f"{x:.10g}" for x in row) for row in rows]
        kept(run).write_text("\n".join([COLUMNS, *lines, ""]))
        print(run.blade, run.name, len(rows), file=sys.stderr)
