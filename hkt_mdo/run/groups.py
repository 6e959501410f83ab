"""Which of a problem's scenarios are one scenario of the case."""

from __future__ import annotations

import re
from collections.abc import Sequence

from hkt_mdo.problem.scenario import Scenario


def by_scenario(scenarios: Sequence[Scenario]) -> dict[str, list[int]]:
    """Return which of a problem's scenarios are one scenario of the case, by its name.

    Parameters
    ----------
    scenarios : sequence of Scenario
        Those of the problem. Intervals of operation follow each other in one flow, and its
        scenario has their name without ``interval_1``; ``phase`` where nothing is left.

    Returns
    -------
    dict of list of int
        Places in `scenarios`.
    """
    groups: dict[str, list[int]] = {}
    name, before = "", None
    for place, scenario in enumerate(scenarios):
        follows = (
            before is not None
            and scenario.inflow is before.inflow
            and scenario.edges[0] >= before.edges[-1]
        )
        if not follows:
            name = re.sub(r"_?interval_\d+$", "", scenario.name) or "phase"
        groups.setdefault(name, []).append(place)
        before = scenario
    return groups
