"""The limits as constraints of the optimization: where each is held, and how scaled."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hkt_mdo.dynamics.limits import LEAST, TYPICAL, DistanceFromStall, Limit, settled
from hkt_mdo.problem.evaluation import on_start
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.scenario import Scales, Scenario
from hkt_mdo.problem.setup import Setup
from hkt_mdo.quantities import QUANTITIES, RATES
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.torque_curve import TorqueSpline

NEAR = 0.2  # of a typical torque: the recovery below which a node is held to its distance
FEWEST_NEAR = 20  # nodes, at least as many of which are held to their distance from stall


@dataclass(frozen=True, eq=False)
class Held:
    """A limit as the optimization holds it: over time in one scenario, or of the design.

    Attributes
    ----------
    limit
        What is held.
    constraint
        Name of the constraint in the model.
    size
        Number of values.
    options
        Bounds, reference, unit and places, as OpenMDAO's `add_constraint` takes them.
    scenario, nodes
        Where a limit over time is held, and places of the nodes, (size,).
    """

    limit: Limit
    constraint: str
    size: int
    options: dict[str, Any]
    scenario: Scenario | None = None
    nodes: np.ndarray | None = None


def held_limits(physics: Physics, setup: Setup, scales: Scales) -> Iterator[Held]:
    """Yield the limits that the optimization holds, scenario by scenario, then of the design.

    Under feedback with a torque curve also the distance from stall.
    """
    known = on_start(physics, setup.start)
    for number, scenario in enumerate(physics.scenarios):
        limits = [*physics.limits_in(scenario)]
        if physics.law.is_feedback and physics.has_curve:
            spline = TorqueSpline(setup.nodes)
            limits.append(DistanceFromStall(law=physics.law_in(scenario), spline=spline))
        for limit in limits:
            if limit.constrains(physics.law):
                yield _held(physics, setup, limit, number, scales, known[number])
    for limit in physics.design_limits:
        if limit.constrains(physics.law):
            bounds = {"lower": limit.lower, "upper": limit.upper}
            options = {"ref": size_of(limit), "units": limit.unit} | bounds
            size = np.size(limit.value_of(known[0]))
            yield Held(limit, constraint_of(physics, limit), size, options)


def _held(physics, setup, limit, number, scales, known) -> Held:
    """Return a limit over time as it is held in the number-th scenario."""
    scenario, ref, less = physics.scenarios[number], None, 0.0
    nodes = limited_nodes(limit, scenario)
    if isinstance(limit, DistanceFromStall):
        nodes, ref = _near_stall(physics, setup, limit, scenario, known), scales.torque
    elif limit.is_of(["control_torque"]) and limit.unit == "N*m":
        ref = scales.torque
    if np.isfinite(limit.upper):
        less = (1.0 - setup.share_at(limit, scenario, nodes)) * abs(limit.upper)
    bounds = {"lower": limit.lower + less, "upper": limit.upper - less}
    options = {"ref": ref or size_of(limit), "units": limit.unit} | bounds
    if is_quantity(limit):
        options |= {"indices": nodes, "flat_indices": True}
    return Held(limit, constraint_of(physics, limit, number), nodes.size, options, scenario, nodes)


def _near_stall(physics, setup, limit, scenario, known):
    """Return the nodes at which the start has settled and is near stall, or the nearest ones.

    In a gust that is faster than the rotor, the integration shows whether it recovers: held to its
    distance there, a heavy rotor lost 0.7 % with `rated` (turbine 3 of seed 77 of `make verify
    PART=turbines`).
    """
    start = setup.start
    table = physics.rotor_in(scenario).coefficients(start.blade, limit.spline.nodes)
    known = known | {"torque_coefficient_table": table.torque, "gains": start.gains}
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


def size_of(limit: Limit) -> float:
    """Return the magnitude of a limit's bounds; 1 where they are none."""
    ends = np.abs(np.hstack((limit.lower, limit.upper)))
    return float(np.max(ends[np.isfinite(ends)], initial=0.0)) or 1.0
