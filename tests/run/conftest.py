"""What the tests of runs share: cases of a few seconds, solved without a result folder."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.objectives import GeneratorEnergy
from hkt_mdo.problem.evaluation import objective_at
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.results.summary import CheckEntry, PassEntry, Summary
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.run.checked import Checked
from hkt_mdo.run.checks import checks_of
from hkt_mdo.run.log import Log
from hkt_mdo.run.passes import optimize
from hkt_mdo.run.state import RunState
from hkt_mdo.run.verification import Optimized, Verification
from hkt_mdo.start.find import find_start


@dataclass(frozen=True)
class Solved:
    """What the checks look at."""

    physics: Physics
    start: StartingPoint
    optimum: SteadyOptimum
    reference: float
    result: Optimized
    verifications: tuple[Verification, ...]
    on_first_mesh: Physics
    passes: list[PassEntry]

    def checks(self) -> dict[str, CheckEntry]:
        """Return what every check says, by its name."""
        parts = self.physics, self.optimum, self.reference, self.result, self.verifications
        return {check.name: check for check in checks_of(*parts)}

    def failed(self) -> list[str]:
        """Return the names of the checks that refuse."""
        return [name for name, check in self.checks().items() if not check.passed]

    @property
    def verification(self) -> Verification:
        """Return the verification of the only scenario."""
        (verification,) = self.verifications
        return verification

    def finished(self) -> Checked:
        """Return what a summary and the tables are made of."""
        parts = self.start, self.physics, self.result, self.verifications
        return Checked(*parts, self.optimum, self.reference, list(self.checks().values()))


def _solve(
    data: dict, change: Callable[[Physics], Physics] = lambda world: world, *extensions: type
) -> Solved:
    world = change(physics(load_case(data, extensions=[GeneratorEnergy, *extensions])))
    with threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        state = RunState(world, Log(Path(folder), False, Summary(success=False)), folder)
        start = find_start(world, state.optimum)
        reference = objective_at(world, start)
        end = optimize(state, start, reference)
    about = end.physics, start, end.optimum, end.reference, end.result, end.verifications
    return Solved(*about, world, state.passes)


@pytest.fixture(scope="session")
def solve_physics():
    """Optimize a case given as a dict, its physics changed or not, in one call."""
    return _solve
