"""The message where no design was found that keeps the limits."""

from __future__ import annotations

import numpy as np

from hkt_mdo.problem.evaluation import excesses, on_start
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import START_EXCESS, StartingPoint
from hkt_mdo.quantities import RATES
from hkt_mdo.results.summary import CheckEntry

NONE_FOUND = (
    "no design that keeps the limits was found from {starts}: the smallest violation was "
    "{share:.3g} % of {key}, {where}; this does not prove that there is none (try {law}a looser "
    "{key}, or wider design bounds)"
)


def none_found(physics: Physics, start: StartingPoint, checks: list[CheckEntry]) -> str:
    """Return the message that no design keeps the limits; empty if start or end keep them.

    `physics` is on the mesh of the start; `checks` are those of the end.
    """
    rates = {limit.name for limit in physics.all_limits if limit.is_of(RATES)}
    over = excesses(physics, start)
    if not np.isnan(start.objective):  # optimized at some speeds; between these it exceeds more
        over = {x: y if x in rates else min(y, start.excess) for x, y in over.items()}
    at_end = {
        name: max((c.value for c in checks if not c.passed and _is_of(c, name)), default=0.0)
        for name in over
    }
    begun, ended = (max((share, name) for name, share in each.items()) for each in (over, at_end))
    if begun[0] <= START_EXCESS or ended[0] <= 0.0:
        return ""
    at_start = f"by the best of them, {_in_flow(physics, start, begun[1])}"
    share, name, where = min((*begun, at_start), (*ended, "at the end of the optimization"))
    key = {"control_torque": "control.torque_limit"}.get(name, f"limits.{name}")
    law = "control.law: curve, which can keep more limits, " * (len(physics.law.gain_units) == 1)
    about = {"share": 100.0 * share, "key": key, "where": where, "law": law}
    return NONE_FOUND.format(starts=starts(start), **about)


def _in_flow(physics, start, name) -> str:
    """Return in which flow a starting point exceeds a limit most."""
    excesses = [
        (limit.excess(known), known["inflow_speed"])
        for scenario, known in zip(physics.scenarios, on_start(physics, start), strict=True)
        for limit in (*physics.limits_in(scenario), *physics.design_limits)
        if limit.name == name
    ]
    over, flow = max(excesses, key=lambda pair: np.max(pair[0]))
    if over.size != flow.size:  # a limit on the design alone
        return "in any flow"
    return f"in a flow of {flow[np.argmax(over)]:.4g} m/s"


def _is_of(check: CheckEntry, limit: str) -> bool:
    """Tell whether a check is that of a limit."""
    parts = ("at_nodes", "between_nodes", "bounds")
    return check.name.partition(" (")[0] in [f"{limit}_{part}" for part in parts]


def starts(start: StartingPoint) -> str:
    """Return the number of starts among which a starting point was chosen, as text."""
    return f"{start.tried} start{'s' * (start.tried != 1)}"
