"""The limits as constraints of the optimization: names, and where each is held."""

from __future__ import annotations

import numpy as np

from hkt_mdo.dynamics.limits import LEAST, TYPICAL, DistanceFromStall, Limit, settled
from hkt_mdo.problem.evaluation import on_start
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.quantities import QUANTITIES, RATES
from hkt_mdo.rotor.scales import torque_scale

NEAR = 0.2  # of a typical torque: the recovery below which a node is held to its distance
FEWEST_NEAR = 20  # nodes, at least as many of which are held to their distance from stall


def near_stall(physics: Physics, start: StartingPoint, limit: DistanceFromStall, number: int):
    """Return the nodes of the n-th scenario where a start has settled and is near stall.

    Those that are nearest are at least `FEWEST_NEAR`.

    In a gust that is faster than the rotor, the integration shows whether it recovers: held to its
    distance there, a heavy rotor lost 0.7 % with `rated` (turbine 3 of seed 77 of `make verify
    PART=turbines`).
    """
    scenario = physics.scenarios[number]
    table = physics.rotor_in(scenario).coefficients(start.blade, limit.spline.nodes)
    known = on_start(physics, start)[number]
    known |= {"torque_coefficient_table": table.torque}
    known |= zip(limit.named_numbers, start.gains, strict=True)
    unit = torque_scale(known["density"], known["rotor_radius"], known["inflow_speed"])
    margin = limit.value_of(known) / (TYPICAL * unit) + LEAST
    margin, still = (
        np.interp(scenario.node_times, scenario.samples, each) for each in (margin, settled(known))
    )
    places = np.flatnonzero(still == 1.0)  # the first node is one
    nearest = np.sort(margin[places])[: FEWEST_NEAR + 1]
    return places[margin[places] <= max(NEAR, nearest[-1])]


def source_of(scenario, name) -> str:
    """Return where the values over time of a quantity, or of a law's state, are in the model."""
    source = QUANTITIES[name].source if name in QUANTITIES else "trajectory"
    home = scenario.path if source == "trajectory" else f"{source}_{scenario.name}"
    return f"{home}.{name}"


def is_quantity(limit: Limit) -> bool:
    """Tell whether a limit is one quantity over time as it is, which needs no component.

    One would add a quarter to the time for the derivatives of an open loop with three such limits.
    """
    plain = type(limit).value is Limit.value and len(limit.inputs) == 1
    return plain and limit.place == "time"


def constraint_of(physics: Physics, limit: Limit, number: int = 0) -> str:
    """Return the name of the constraint that holds a limit of the design or the n-th scenario."""
    scenario = physics.scenarios[number]
    if is_quantity(limit):
        return source_of(scenario, limit.inputs[0])
    return f"limit_{limit.name}{f'_{scenario.name}' * (number > 0)}.value"


def limited_nodes(limit: Limit, scenario: Scenario) -> np.ndarray:
    """Return the nodes of a scenario at which a limit over time is held.

    One where two segments meet: a limit that is held there twice has no definite multipliers. The
    rate of the torque alone may differ from one segment to the other.
    """
    return np.arange(scenario.node_times.size) if limit.is_of(RATES) else scenario.distinct_nodes
