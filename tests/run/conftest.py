"""What the tests of runs share: cases of a few seconds, solved without a result folder."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.objectives import GeneratorEnergy
from hkt_mdo.problem.evaluation import objective_at
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.summary import CheckEntry, PassEntry
from hkt_mdo.run.checks import Checked
from hkt_mdo.run.passes import optimize
from hkt_mdo.run.state import RunState
from hkt_mdo.run.verification import Verification
from hkt_mdo.start.find import find_start


@dataclass(frozen=True, eq=False)
class Solved(Checked):
    """The end of a run, and how it came to be."""

    on_first_mesh: Physics
    passes: list[PassEntry]

    @property
    def by_name(self) -> dict[str, CheckEntry]:
        """What every check says, by its name."""
        return {check.name: check for check in self.checks}

    def failed(self) -> list[str]:
        """Return the names of the checks that refuse."""
        return [check.name for check in self.checks if not check.passed]

    @property
    def verification(self) -> Verification:
        """Return the verification of the only scenario."""
        (verification,) = self.verifications
        return verification


def _solve(
    data: dict, change: Callable[[Physics], Physics] = lambda model: model, *extensions: type
) -> Solved:
    model = change(physics(load_case(data, extensions=[GeneratorEnergy, *extensions])))
    with threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        state = RunState(model, Path(folder), False)
        start = find_start(model)
        end = optimize(state, replace(start, reference=objective_at(model, start)))
    return Solved(end.start, end.result, end.verifications, model, state.passes)


@pytest.fixture(scope="session")
def solve_physics():
    """Optimize a case given as a dict, its physics changed or not, in one call."""
    return _solve
