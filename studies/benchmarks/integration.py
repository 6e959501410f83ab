"""How long the independent integration takes, over the optimization that it checks."""

import time
from pathlib import Path
from unittest.mock import patch

import openmdao.api as om

from hkt_mdo.case import load_case
from hkt_mdo.run.run import run_case


def integration_over_optimization(case: Path, segments: int, folder: Path) -> float:
    """Return the ratio of both times for a case of so many segments of a second."""
    length = (f"phase.duration={segments}", f"phase.segments={segments}")
    spent, run_driver = [], om.Problem.run_driver

    def timed(problem, *arguments, **options):
        began = time.perf_counter()
        ended = run_driver(problem, *arguments, **options)
        spent.append(time.perf_counter() - began)
        return ended

    with patch.object(om.Problem, "run_driver", timed):
        solution = run_case(load_case(case, length), folder, figures=False, records=False)
    design = solution.design()
    began = time.perf_counter()
    design.simulate(design.physics.inflow)
    return (time.perf_counter() - began) / sum(spent)
