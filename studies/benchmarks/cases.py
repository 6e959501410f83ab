"""A case as the benchmarks take it apart: optimum, start, optimization, integration."""

import time
import warnings

from hkt_mdo.case import read_case
from hkt_mdo.problem.build import assemble
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.rotor.model import SOLVERS
from hkt_mdo.rotor.steady_optimum import best_operation
from hkt_mdo.run.optimization import collect
from hkt_mdo.run.verification import verify
from hkt_mdo.start.find import find_start

QUADRATIC = "{law: quadratic, torque_limit: 700}"
OPEN_LOOP = "{law: open_loop, torque_limit: 700}"


def case_of(control=QUADRATIC, segments=60, duration=None, final_speed="auto", **sections):
    """Return a case over the sine flow."""
    lines = [
        "inflow: {profile: sine}",
        f"control: {control}",
        f"phase: {{segments: {segments}, duration: {duration or segments},"
        f" final_speed: {final_speed}}}",
        *(f"{name}: {text}" for name, text in sections.items()),
    ]
    return read_case("\n".join(lines))


def start_of(case, cold=False):
    """Return physics of a case and the setup it begins with; cold: the blade as it is given."""
    physics_ = physics(case)
    optimum = best_operation(physics_.blade, physics_.rotor.polar) if cold else None
    start = find_start(physics_, optimum)
    return physics_, Setup(start, curve_nodes(physics_, start))


def optimize(physics_, setup):
    """Build and optimize; return the problem, its outcome and the seconds that each step took."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        began = time.perf_counter()
        problem = assemble(physics_, setup)
        problem.final_setup()
        built = time.perf_counter()
        problem.run_model()
        problem.run_driver()
        ended = time.perf_counter()
    return problem, problem.driver.outcome(), {"setup": built - began, "driver": ended - built}


def integrate(physics_, problem):
    """Return the independent integration of an optimized problem, by which a run checks it."""
    return verify(collect(physics_, None, problem, None))[0].simulation


class TimedBEM:
    """A BEM solver that adds up the time spent in it."""

    def __init__(self, name):
        self.seconds, self._solve = 0.0, SOLVERS[name]

    def __call__(self, *arguments, **options):
        """Solve."""
        began = time.perf_counter()
        try:
            return self._solve(*arguments, **options)
        finally:
            self.seconds += time.perf_counter() - began
