"""A machine is no input: kernels of its linear algebra change the last digit, and no result.

OpenBLAS chooses its kernels by the processor; `OPENBLAS_CORETYPE` stands for other machines. Where
OpenBLAS has no such kernel, or another BLAS is at work, the runs are equal and the test is idle.
"""

import json
import os
import subprocess
import sys

import pytest

KERNELS = "Haswell", "Sandybridge"


def ran(name, kernel, folder):
    """Return the summary of a case that was run with a kernel."""
    environment = os.environ | {"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "hkt_mdo", "run", name, "--out", folder / kernel]
    command += ["--quiet", "--no-figures", "--set", "rotor.station_count=9"]
    done = subprocess.run(command, env=environment, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / kernel / "summary.json").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_limited_case_ends_alike_with_other_kernels(tmp_path):
    summaries = [ran("power_quadratic", kernel, tmp_path) for kernel in KERNELS]
    assert all(each["success"] for each in summaries)
    energies = [each["simulated_energy_J"] for each in summaries]
    assert energies == pytest.approx([energies[0]] * len(KERNELS), rel=1e-4)
