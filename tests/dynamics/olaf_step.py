"""A step of the rotor's speed by 2 %: Oye's filters beside AeroDyn's free vortex wake, OLAF.

OLAF (`Wake_Mod` 3 of the same driver) is physics of another kind: the comparison says how far the
filters are a model of a wake. `python -m tests.dynamics.olaf_step` writes what
`tests/data/openfast` keeps (about ten minutes), `... --kept` prints the table of
docs/studies/memory.md.
"""

import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

from hkt_mdo.dynamics.simulation import simulate
from tests.dynamics import aerodyn_runs
from tests.dynamics.aerodyn_runs import DATA, Ramps
from tests.dynamics.test_wake import Driven, RampedInflow, plant_of

HOLD, STEP, CORE = 10.0, 0.04, 0.05  # s, s, m: before and after the step, of OLAF, of its vortices
RUN, HELD = (Ramps("paper", "speed", 8.06, 1.5, (x,), HOLD, 1.0, STEP) for x in (1.02, 1.0))
NEAR, FAR = 100, 120  # panels of the wake
TIMES = 0.12, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0, 9.0  # s after the begin of the ramp
KEPT = DATA / "paper" / "wake" / "olaf_step.csv"
COLUMNS = "time_s,torque_N_m,held_torque_N_m"


def olaf(run, program, folder):
    """Run OLAF; return time (s) and torque (N m)."""
    input_folder = aerodyn_runs.write_inputs(run, folder)
    changes = {"Wake_Mod": 3, "OLAFInputFileName": '"olaf.dat"'}
    aerodyn_runs._edit(input_folder / "aerodyn.dat", **changes)
    inputs = (DATA / "olaf.dat").read_text()
    (input_folder / "olaf.dat").write_text(inputs.format(STEP=STEP, NEAR=NEAR, FAR=FAR, CORE=CORE))
    of = aerodyn_runs.driven(program, input_folder)
    return of["Time"], of["RtFldMxh"]


def oye(tau1, time):
    """Return the torque (N m) of this program in the same step, by Oye's filters, at times (s)."""
    plant, (times, _) = plant_of(RUN).with_memory(tau1), RUN.corners
    speeds, flows = RUN.speeds(times, plant.blade.rotor_radius)
    flow = RampedInflow(times=tuple(times), speeds=tuple(flows))
    motion = Driven(times, speeds), speeds[0], time
    return simulate(plant, flow, *motion, max_step=0.5).hydrodynamic_torque


def table(kept):
    """Return the rows: time after the step (s), and what the step changes by each model, N m.

    OLAF's wake is still growing: its torque is compared with that of a run without the step.
    """
    every, at = np.arange(0.0, RUN.duration + 1e-9, STEP), HOLD + np.array(TIMES)
    torques = [oye(tau1, every) for tau1 in (1.0, None)]
    torques = [np.interp(at, every, each) - np.interp(HOLD, every, each) for each in torques]
    time, stepped, held = kept.T
    return np.column_stack((TIMES, *torques, np.interp(at, time, stepped - held)))


if __name__ == "__main__":
    if "--kept" not in sys.argv:
        torques = []
        for run in (RUN, HELD):
            with tempfile.TemporaryDirectory() as folder:
                time, torque = olaf(run, shutil.which("aerodyn_driver"), Path(folder))
            torques.append(torque)
        rows = np.column_stack((time, *torques))[time >= HOLD - 1e-9]
        lines = [",".join(f"{x:.8g}" for x in row) for row in rows]
        KEPT.write_text("\n".join([COLUMNS, *lines, ""]))
    for row in table(np.loadtxt(KEPT, delimiter=",", skiprows=1)):
        print("| {:g} | {:+.1f} | {:+.1f} | {:+.1f} |".format(*row))
