"""Kill runs at random moments and resume them: nothing may be lost, nothing unfinished called so.

python scripts/kill_runs.py --count 50 --out results/verification

Each run is ended by SIGINT, SIGTERM or SIGKILL. After that its folder must say that it is no
success (or hold the whole success, if the run was faster), and `hkt run --resume` must reach the
energy of the run that nobody disturbed. A folder of a run that was killed before it wrote its case
must take a new run. The figures go to OUT/kills.md, which `hkt verify --report` takes up.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

CASES = Path(__file__).parent.parent / "cases"
NAMES = ("sine_limited_oloc", "sine_limited_linear", "sine_limited_quadratic")
SETTINGS = ["--segments", "20", "--set", "phase.duration=20", "--no-figures", "--quiet"]
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
AGREEMENT = 1e-5  # relative difference in energy of a resumed run


def start(*arguments: object) -> subprocess.Popen:
    """Start `hkt run` in a process of its own."""
    command = [sys.executable, "-m", "hkt_mdo", "run", *map(str, arguments)]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"}
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
    )


def finish(process: subprocess.Popen) -> tuple[int, str]:
    """Wait for a process and return its exit code and what it said."""
    said, _ = process.communicate()
    return process.returncode, said


def kill_one(arguments: list, folder: Path, number: int, delay: float, energy: float) -> list[str]:
    """Kill a run after a delay, resume it, and return what was wrong."""
    process = start(*arguments, "--out", folder)
    time.sleep(delay)
    process.send_signal(number)
    code, said = finish(process)
    wrong = []
    if "Traceback" in said:
        wrong.append(f"traceback: {said[-300:]}")
    summary = folder / "summary.json"
    success = summary.exists() and json.loads(summary.read_text())["success"]
    if success and not (folder / "simulation.csv").exists():
        wrong.append("called a success without its tables")
    if code == 0 and not success:
        wrong.append("exit code 0 without success")
    again = ["--resume", folder, "--quiet", "--no-figures"]
    if not (folder / "case.yaml").exists():
        again = [*arguments, "--out", folder]
    code, said = finish(start(*again))
    if code != 0:
        return [*wrong, f"resumed with exit code {code}: {said[-300:]}"]
    found = json.loads(summary.read_text())["simulated_energy_J"]
    if abs(found / energy - 1.0) > AGREEMENT:
        wrong.append(f"resumed to {found:.2f} J instead of {energy:.2f} J")
    return wrong


def study(out: Path, count: int, seed: int) -> tuple[list[str], bool]:
    """Kill `count` runs and return the figures, and whether all was well."""
    rng, moments, rows, good = random.Random(seed), Counter(), [], True
    references = {}
    for i in range(count):
        name, optimizer = NAMES[i % 3], ("IPOPT", "SLSQP")[i // 3 % 2]
        arguments = [CASES / f"{name}.yaml", *SETTINGS, "--optimizer", optimizer]
        if (name, optimizer) not in references:
            folder, began = out / "reference" / optimizer / name, time.monotonic()
            code, said = finish(start(*arguments, "--out", folder, "--force"))
            if code != 0:
                raise SystemExit(f"the undisturbed run failed: {said}")
            energy = json.loads((folder / "summary.json").read_text())["simulated_energy_J"]
            references[name, optimizer] = energy, time.monotonic() - began
        energy, seconds = references[name, optimizer]
        number = rng.choice(SIGNALS)
        folder = out / f"{seed}_{i:03d}_{time.time_ns()}"
        wrong = kill_one(arguments, folder, number, rng.uniform(0.1, 1.0) * seconds, energy)
        moments[signal.Signals(number).name, not wrong] += 1
        rows += [f"- {folder.name}, {signal.Signals(number).name}: {what}" for what in wrong]
        good = good and not wrong
        print(
            f"{i + 1}/{count} {signal.Signals(number).name}: {'; '.join(wrong) or 'ok'}", flush=True
        )
    table = ["| signal | resumed to the same optimum | anything else |", "|---|---|---|"]
    table += [f"| {s.name} | {moments[s.name, True]} | {moments[s.name, False]} |" for s in SIGNALS]
    return [*table, "", *rows], good


def main() -> None:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=50, help="runs to kill (default: 50)")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers (default: 0)")
    parser.add_argument("--out", type=Path, default=Path("results/verification"))
    options = parser.parse_args()
    rows, good = study(options.out / "kills", options.count, options.seed)
    head = [
        "## Interrupted and killed",
        "",
        "Runs ended by SIGINT, SIGTERM or SIGKILL at random moments, then `hkt run --resume`. "
        f"Goal: each reaches the undisturbed run's energy to {AGREEMENT:g}, and none is called "
        "a success before it is one. `--resume` reads `iterate.json` and `convergence.csv`, plain "
        "text; the recorders' `.db` files hold pickles and are never opened by `hkt`: open them "
        "with OpenMDAO's `CaseReader` only if you trust who wrote them.",
        "",
        f"`python scripts/kill_runs.py --count {options.count} --seed {options.seed}`",
        "",
    ]
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "kills.md").write_text("\n".join([*head, *rows]).rstrip() + "\n", "utf-8")
    sys.exit(0 if good else 3)


if __name__ == "__main__":
    main()
