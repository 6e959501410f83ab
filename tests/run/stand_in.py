"""What stands for a run in tests of sweeps: it writes a result folder in no time, or dies."""

import os
import random
import signal
import sys
import time
from pathlib import Path

from hkt_mdo.case.sweep import load_sweep
from hkt_mdo.files.table import write_files
from hkt_mdo.problem.physics import complete
from hkt_mdo.results.folder import locked
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.summary import CheckEntry, ObjectiveEntry, Summary
from hkt_mdo.run.digest import digest
from hkt_mdo.run.sweep import run_sweep

DEATHS = "begins", "writes", "ends"
SECONDS = 0.02
FACTORS = {}
"""What the objective is multiplied by where a run begins at another one's design."""


def run(case, folder, **_):
    """Write a result of a case, and a line about it in a log; the objective is its torque limit."""
    torque = case.control.torque_limit
    objective = torque * (FACTORS[torque] if case.start.from_ else 1.0)
    attempts = folder.with_name(f"attempts_{folder.name}")
    dies = None if attempts.exists() else death(torque)
    attempts.touch()
    if dies == "begins":
        die()
    with locked(folder):
        write_files({folder / "case.yaml": complete(case).to_yaml()})
        if dies == "writes":
            die()
        time.sleep(SECONDS)
        entry = ObjectiveEntry(kind="captured", value=0.0, simulated=objective)
        passed = [CheckEntry(name="optimizer", value=0.0, limit=0.0, passed=True)]
        summary = Summary(
            case=case.name, success=True, message="", objective=entry, checks=passed,
            digest=digest(case), wall_seconds=SECONDS,
        )  # fmt: skip
        with (folder.parent / "log").open("a", encoding="utf-8") as file:
            file.write(f"{folder.name}\n")
        write_files({folder / "summary.json": summary.model_dump_json()})
    if dies == "ends":
        die()
    return Solution.load(folder)


def death(torque):
    """Return when the worker of a case dies: of four in a hundred, drawn by the case's torque."""
    drawn = random.Random(torque)
    return drawn.choice(DEATHS) if drawn.random() < 0.04 else None


def die():
    """Die as a process that is killed."""
    os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":  # a client that a test kills
    SECONDS = 0.5
    run_sweep(load_sweep(sys.argv[1]), Path(sys.argv[2]), 1, run=run)
