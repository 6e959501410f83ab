"""Faults: runs that are killed, short of disk, or without folder, home or cache."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import shipped_cases
from studies.study_common import LAWS, markdown_table

SETTINGS = ("--segments", "20", "--set", "phase.duration=20", "--quiet")
AGREEMENT = 1e-5  # relative difference in energy to the undisturbed run
# a signal may be 9, or come before the program listens or when it has done everything
ENDS = (0, 2, 130, -signal.SIGINT, -signal.SIGTERM, -9)


class _Try(NamedTuple):
    """A run to disturb, the undisturbed one, and the random numbers of the fault."""

    arguments: list[str]
    folder: Path
    reference: Path
    seconds: float
    rng: np.random.Generator

    def start(self, **options) -> subprocess.Popen:
        return _hkt(*self.arguments, "--out", self.folder, **options)

    def wait(self) -> None:
        """Wait until a random moment of the run."""
        time.sleep(self.rng.uniform(0.3, 1.3) * self.seconds)


def _hkt(*arguments, environment=(), **options) -> subprocess.Popen:
    """Start `hkt run` in a process of its own."""
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"} | dict(environment)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    command = [sys.executable, "-m", "hkt_mdo", "run", *map(str, arguments)]
    return subprocess.Popen(command, env=env, **pipes, **options)


def _signalled(number, run: _Try) -> subprocess.Popen:
    # a study in the background ignores SIGINT, which its processes would inherit
    process = run.start(preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL))
    run.wait()
    process.send_signal(number)
    return process


def _without_disk(run: _Try) -> subprocess.Popen:
    import resource  # of POSIX alone

    largest = max(path.stat().st_size for path in run.reference.rglob("*"))
    size = int(np.exp(run.rng.uniform(np.log(100.0), np.log(largest))))
    limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (size, size))
    return run.start(preexec_fn=limit)


def _away(folder: Path) -> Path:
    """Return where a result folder is taken."""
    return folder.with_name(f"{folder.name}_taken_away")


def _without_folder(run: _Try) -> subprocess.Popen:
    process = run.start()
    run.wait()
    with suppress(OSError):  # not made yet
        run.folder.rename(_away(run.folder))
    return process


def _without_home(run: _Try) -> subprocess.Popen:
    nowhere = dict.fromkeys(
        ("HOME", "XDG_CACHE_HOME", "MPLCONFIGDIR", "NUMBA_CACHE_DIR"), os.devnull
    )
    nowhere["NUMBA_CACHE_LOCATOR_CLASSES"] = "UserProvidedCacheLocator"
    return run.start(environment=nowhere)


FAULTS: dict[str, Callable[[_Try], subprocess.Popen]] = {
    "SIGINT": partial(_signalled, signal.SIGINT),
    "SIGTERM": partial(_signalled, signal.SIGTERM),
    "SIGKILL": partial(_signalled, getattr(signal, "SIGKILL", signal.SIGTERM)),
    "no room on the disk": _without_disk,
    "folder taken away": _without_folder,
    "no home, no cache": _without_home,
}


def faults(study) -> list[str]:
    """Disturb runs at random moments, then resume them, or run them again.

    Faults: signals; a limit on the size of files, which acts like a full disk; the result folder
    renamed during the run; no home folder and no cache. Goal: a run ends normally, or with exit
    code 2 or 130 and one line. It counts as a success only with all its tables and the energy of
    the undisturbed run to 1e-5, which `--resume` reaches in the end; other results are not changed.
    `--resume` reads `iterate.json` and `convergence.csv`, which are plain text. The recorders'
    `.db` files contain pickles and `hkt` never opens them: open them with OpenMDAO's `CaseReader`
    only if you trust who wrote them.
    """
    if os.name != "posix":
        raise InputError("the part faults needs signals and limits of POSIX", "leave it out")
    folder = study.out / "faults"
    plans = []
    for law, optimizer in product(LAWS, ("IPOPT", "SLSQP")):
        case = (shipped_cases()) / f"sine_limited_{law}.yaml"
        arguments = [str(case), *SETTINGS, "--optimizer", optimizer]
        reference, began = folder / f"undisturbed_{optimizer}_{law}", time.monotonic()
        process = _hkt(*arguments, "--out", reference, "--force")
        said, _ = process.communicate()
        if process.returncode:
            raise InputError(f"the undisturbed run failed: {said}", file=reference)
        plans.append((arguments, reference, time.monotonic() - began))
    before = _content(folder)
    tries = []
    for index, (name, fault) in enumerate(FAULTS.items()):
        # a sixth where every process compiles anew
        for i in range(study.count if fault is not _without_home else -(-study.count // 6)):
            arguments, reference, seconds = plans[i % len(plans)]
            out = folder / f"{index}_{i:03d}_{time.time_ns()}"
            rng = np.random.default_rng([study.seed, index, i])
            tries.append((name, fault, _Try(arguments, out, reference, seconds, rng)))
    with ThreadPoolExecutor(study.jobs or os.cpu_count()) as threads:
        results = list(threads.map(lambda trial: _disturb(*trial[1:], study.done), tries))
    rows, failures = [], []
    for name in FAULTS:
        outcomes = [
            (code, wrong)
            for (fault, *_), (code, wrong) in zip(tries, results, strict=True)
            if fault == name
        ]
        codes = Counter(code for code, _ in outcomes)
        ends = ", ".join(f"{count} × {code}" for code, count in sorted(codes.items()))
        bad = sum(bool(wrong) for _, wrong in outcomes)
        rows.append([name, str(len(outcomes)), ends, str(len(outcomes) - bad), str(bad)])
        failures += [f"- {name}: {each}" for _, wrong in outcomes for each in wrong]
    if _content(folder) != before:
        failures.append("- results beside the disturbed runs have changed")
    header = "fault", "tries", "exit codes", "nothing lost, nothing false", "anything else"
    return [*markdown_table(header, rows), "", *failures]


def _content(folder):
    """Return the digest of each file of the undisturbed runs."""
    return {
        path: sha256(path.read_bytes()).digest()
        for path in sorted(folder.glob("undisturbed_*/**/*"))
        if path.is_file()
    }


def _disturb(fault, run: _Try, done) -> tuple[int, list[str]]:
    """Disturb a run and go on with it; return its exit code and what was wrong."""
    process = fault(run)
    said, _ = process.communicate()
    code, energy, wrong = process.returncode, _energy(run.reference), []
    if code not in ENDS or len(said.splitlines()) > (code != 0):
        wrong.append(f"exit code {code}: {said[-300:]}")
    captured = _energy(run.folder)
    if code == 0 and captured is None:  # it may be taken away after the run has finished
        captured = _energy(_away(run.folder))
    if code == 0 and captured is None:
        wrong.append("exit code 0 without success")
    if captured is not None and not abs(captured / energy - 1.0) <= AGREEMENT:
        wrong.append(f"called a success at {captured:.2f} J instead of {energy:.2f} J")
    again = [*run.arguments, "--out", run.folder]
    if (run.folder / "case.yaml").exists():
        again = ["--resume", run.folder, "--quiet"]
    process = _hkt(*again)
    said, _ = process.communicate()
    captured = _energy(run.folder)
    if process.returncode or captured is None:
        wrong.append(f"then exit code {process.returncode}: {said[-300:]}")
    elif not abs(captured / energy - 1.0) <= AGREEMENT:
        wrong.append(f"resumed to {captured:.2f} J instead of {energy:.2f} J")
    done(run.folder, "; ".join(wrong) or f"exit code {code}, then ok")
    return code, wrong


def _energy(folder: Path) -> float | None:
    """Return the energy (J) of a folder that is called a success; NaN if it lacks a table."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    if not summary["success"]:
        return None
    tables = ("trajectory", "simulation", "coefficients", "blade", "convergence")
    whole = all((folder / f"{name}.csv").exists() for name in tables)
    return summary["simulated_energy_J"] if whole else np.nan
