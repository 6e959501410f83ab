"""What one NLP iteration costs: over the bare phase, over OpenMDAO's own totals, as it grows."""

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import openmdao.api as om
import pytest

from cases import case_of, optimize, start_of
from hkt_mdo.dynamics import rotor_ode
from hkt_mdo.problem.build import assemble
from hkt_mdo.rotor import components

SEGMENTS = (30, 100, 300, 1000, 3000)
STATIONS = (9, 20, 50, 100)
LIMITS = (
    "{power: 5 kW, rotor_speed: 11 rad/s, thrust: 6.5 kN, stress: 100 MPa, cavitation: {depth: 3}}"
)


class BareHydrodynamics(om.ExplicitComponent):
    """The least that closes the phase: torque and power fall linearly with speed, no blade."""

    def __init__(self, num_nodes, _, spline):
        super().__init__()
        self.num_nodes, self.spline = num_nodes, spline

    def setup(self):
        n = self.num_nodes
        static = ["dymos.static_target"]
        self.add_input("rotor_speed", shape=(n,), units="rad/s")
        self.add_input("inflow_speed", shape=(n,), units="m/s")
        self.add_input("density", val=1000.0, units="kg/m**3", tags=static)
        self.add_input("rotor_radius", units="m", tags=static)
        self.add_input("torque_coefficient_table", shape=self.spline.nodes.shape, tags=static)
        self.add_output("tip_speed_ratio", shape=(n,))
        self.add_output("hydrodynamic_torque", shape=(n,), units="N*m")
        self.add_output("hydrodynamic_power", shape=(n,), units="W")
        rows = np.arange(n)
        self.declare_partials("hydrodynamic_*", "rotor_speed", rows=rows, cols=rows)

    def compute(self, inputs, outputs):
        w = inputs["rotor_speed"]
        outputs["hydrodynamic_torque"] = 1500.0 - 100.0 * w
        outputs["hydrodynamic_power"] = 1500.0 * w - 100.0 * w**2

    def compute_partials(self, inputs, partials):
        partials["hydrodynamic_torque", "rotor_speed"] = -100.0
        partials["hydrodynamic_power", "rotor_speed"] = 1500.0 - 200.0 * inputs["rotor_speed"]


def built(prepared):
    problem = assemble(*prepared)
    problem.run_model()
    return problem


def iteration(problem, openmdao=False):
    """Return one evaluation of the model and of its totals."""
    driver = problem.driver
    if openmdao:
        problem.get_total_coloring(driver._coloring_info, run_model=False)

        def totals():
            return driver._compute_totals(return_format="array")

    else:
        totals = problem.model.linear_solver.totals(driver, [*driver._objs, *driver._cons]).compute

    def once():
        problem.model.run_solve_nonlinear()
        return totals()

    return once


def test_over_the_bare_phase(benchmark, full, in_turns, monkeypatch):
    """Model and totals with hydrodynamics, without, and by OpenMDAO's colored solves."""
    segments = 60 if full else 6
    prepared = start_of(case_of(segments=segments), cold=True)
    once = {
        "this": iteration(built(prepared)),
        "openmdao": iteration(built(prepared), openmdao=True),
    }
    bare = start_of(case_of(segments=segments, design="{blade: fixed}"), cold=True)
    monkeypatch.setattr(rotor_ode, "CurveComp", BareHydrodynamics)
    for name in ("RatioComp", "TorqueComp"):
        monkeypatch.setattr(rotor_ode, name, lambda _: om.Group())
    monkeypatch.setattr(
        components,
        "TablesComp",
        lambda rotor, blade, nodes, **_: om.IndepVarComp(
            "torque_coefficient_table", np.zeros(nodes.size)
        ),
    )
    once["bare"] = iteration(built(bare))
    times = in_turns(once, rounds=40 if full else 1)
    totals = in_turns.results
    np.testing.assert_allclose(totals["this"].toarray(), totals["openmdao"], rtol=1e-9, atol=1e-9)
    benchmark.extra_info["times"] = times
    if full:
        assert times["this"] < times["openmdao"]


def peak_memory():
    """Return the most memory that this process has held, MB."""
    status = Path("/proc/self/status")
    if status.exists():  # getrusage would count the parent's, which it was forked from
        line = next(x for x in status.read_text().splitlines() if x.startswith("VmHWM"))
        return int(line.split()[1]) / 1024.0
    unit = 2.0**20 if sys.platform == "darwin" else 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def measure(segments, stations, limits="{}"):
    """Return cost and memory of a few NLP iterations; run in a process of its own."""
    places = np.round(np.linspace(0.2, 0.999, stations), 6).tolist()
    case = case_of(
        segments=segments,
        rotor=f"{{stations: {places}}}",
        driver="{max_iterations: 12}",
        start="{method: blade}",
        limits=limits,
    )
    problem, ended, seconds = optimize(*start_of(case, cold=True))
    driver = problem.driver
    once = iteration(problem)
    once()
    samples = []
    for _ in range(7):
        began = time.perf_counter()
        totals = once()
        samples.append(time.perf_counter() - began)
    return {
        "segments": segments,
        "stations": stations,
        "setup": seconds["setup"],
        "iteration": seconds["driver"] / max(ended.iterations, 1),
        "evaluation": float(np.median(samples)),
        "evaluations": driver.result.model_evals,
        "iterations": ended.iterations,
        "memory_MB": peak_memory(),
        "nonzeros": int(totals.nnz),
    }


@pytest.mark.parametrize("limits", ["{}", LIMITS], ids=["none", "limits"])
@pytest.mark.parametrize(
    ("what", "sizes"),
    [("segments", [(n, 9) for n in SEGMENTS]), ("stations", [(60, n) for n in STATIONS])],
    ids=["segments", "stations"],
)
def test_growth(benchmark, full, what, sizes, limits, tmp_path):
    """Time and memory of an iteration grow no faster than their number, with limits or without."""

    def run(size):
        arguments = (*size, limits)
        code = f"from test_iteration import *; print(json.dumps(measure{arguments}))"
        return json.loads(
            subprocess.check_output(
                [sys.executable, "-W", "ignore", "-c", code], text=True, cwd=tmp_path
            ).splitlines()[-1]
        )

    if full:
        rows = benchmark.pedantic(lambda: [run(size) for size in sizes], rounds=1, iterations=1)
    elif what == "segments":
        rows = [run((4, 9)), measure(8, 9, limits)]
    else:
        rows = [measure(4, 9, limits), measure(4, 12, limits)]
    benchmark.extra_info["rows"] = rows
    first, last = rows[-2], rows[-1]  # where the constant part of the cost matters least
    slope = np.log(last["evaluation"] / first["evaluation"]) / np.log(last[what] / first[what])
    benchmark.extra_info["slope"] = slope
    if full:
        assert slope < 1.25
