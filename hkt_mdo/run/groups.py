"""Scenarios of a problem that are intervals of one scenario of the case."""

from __future__ import annotations

from collections.abc import Sequence

from hkt_mdo.problem.scenario import Scenario


def by_scenario(scenarios: Sequence[Scenario]) -> dict[str, list[int]]:
    """Return the indices of the problem's scenarios for each scenario of the case.

    Several are the intervals of operation of one flow.
    """
    groups: dict[str, list[int]] = {}
    for place, scenario in enumerate(scenarios):
        groups.setdefault(scenario.group, []).append(place)
    return groups
