"""A case as the benchmarks take it apart: optimum, start, optimization, integration."""

import time
import warnings

import numpy as np

from hkt_mdo.case import read_case
from hkt_mdo.problem.build import BEM, build_problem, find_start, physics
from hkt_mdo.rotor.steady_optimum import best_operation, best_rotor
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.run.judge import fly
from hkt_mdo.run.run import _collect

QUADRATIC = "{law: quadratic, torque_limit: 700}"
OPEN_LOOP = "{law: open_loop, torque_limit: 700}"


def case_of(control=QUADRATIC, segments=60, duration=None, **sections):
    """Return a case over the sine flow."""
    lines = [
        "inflow: {profile: sine}",
        f"control: {control}",
        f"phase: {{segments: {segments}, duration: {duration or segments}}}",
        *(f"{name}: {text}" for name, text in sections.items()),
    ]
    return read_case("\n".join(lines))


def start_of(case, cold=False):
    """Return physics, start and torque curve nodes of a case; cold: the blade as it is given."""
    world = physics(case)
    if cold or case.design.blade == "fixed":
        optimum = best_operation(world.blade, world.polar)
    else:
        optimum = best_rotor(
            world.blade, world.polar, world.shape.chord_bounds, world.shape.twist_bounds
        )
    start = find_start(case, world, optimum)
    speed = start.operation.rotor_speed
    flow = world.inflow.speed(np.linspace(0.0, case.phase.duration, speed.size))
    middle = float(np.mean(speed * world.blade.rotor_radius / flow))
    # dense where the rotor works, as in a run
    nodes = np.unique(np.r_[np.linspace(0.5, 0.85, 6), np.linspace(0.85, 1.15, 27), 1.25, 1.4, 1.6])
    return world, start, middle * nodes


def optimize(case, prepared):
    """Build and optimize; return the problem, its outcome and the seconds that each step took."""
    world, start, nodes = prepared
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        began = time.perf_counter()
        problem = build_problem(case, world, start, nodes)
        problem.final_setup()
        built = time.perf_counter()
        problem.run_driver()
        ended = time.perf_counter()
    return problem, problem.driver.outcome(), {"setup": built - began, "driver": ended - built}


def integrate(case, prepared, problem):
    """Return the independent integration of an optimized problem, as a run judges it by."""
    world, _, nodes = prepared
    return fly(case, world, _collect(case, world, problem, nodes))


class TimedBEM:
    """A BEM solver that adds up the time spent in it."""

    def __init__(self, name):
        self.seconds, self._solve = 0.0, BEM[name]

    def __call__(self, *arguments):
        """Solve."""
        began = time.perf_counter()
        try:
            return self._solve(*arguments)
        finally:
            self.seconds += time.perf_counter() - began


def torque_table(world, nodes):
    """Return the torque curve of a world's blade: a spline and its table."""
    return TorqueSpline(nodes), BEM["vectorized"](world.blade, world.polar, nodes).torque
