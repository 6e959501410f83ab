"""Which of a problem's scenarios are one scenario of the case."""

from __future__ import annotations

from collections.abc import Sequence

from hkt_mdo.problem.scenario import Scenario


def by_scenario(scenarios: Sequence[Scenario]) -> dict[str, list[int]]:
    """Return the places of the problem's scenarios that are one of the case, by its name.

    Several are the intervals of operation of one flow.
    """
    groups: dict[str, list[int]] = {}
    for place, scenario in enumerate(scenarios):
        groups.setdefault(scenario.group, []).append(place)
    return groups
