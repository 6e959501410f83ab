"""The evaluation of an operation without time: its quantities, limits and objective.

That of a starting point is the rotor's speed at the samples of the flow. It is quasi-steady: the
generator's torque balances that of the flow. Under a static law it is the law's own, also of a
rotor in motion.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from hkt_mdo.dynamics.limits import DesignBounds
from hkt_mdo.dynamics.objectives import INTEGRALS
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO, Plant
from hkt_mdo.dynamics.trajectory import trajectory_of
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import START_EXCESS, Operation, StartingPoint
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.model import SOLVERS, RotorModel
from hkt_mdo.rotor.scales import torque_scale

RATIOS = 1001  # tip speed ratios at which loads are computed at most


def split(physics: Physics, operation: Operation) -> list[np.ndarray]:
    """Return speed, hydrodynamic torque and states of an operation, (n, n_times) a scenario."""
    ends = np.cumsum([scenario.samples.size for scenario in physics.scenarios])[:-1]
    rows = np.stack((operation.rotor_speed, operation.hydrodynamic_torque, *operation.states))
    return np.split(rows, ends, axis=1)


@lru_cache(maxsize=8)  # every limit of a problem asks, and the checks of a run
def on_start(physics: Physics, point: StartingPoint) -> list[dict[str, Any]]:
    """Return the quantities of a quasi-steady starting point, one dict a scenario.

    Those of `hkt_mdo.quantities.OVER_TIME`, of loads those that the case limits, and the scalars
    that limits and objectives may take. The generator torque is that of a static law, else it
    balances the flow's.
    """
    starts, blade, generator = [], point.blade, physics.case.generator
    pairs = zip(physics.scenarios, split(physics, point.operation), strict=True)
    for scenario, (speed, torque, *states) in pairs:
        rotor, radius = physics.rotor_in(scenario), blade.rotor_radius
        time, flow = scenario.samples, scenario.speeds
        if rotor is not physics.rotor:  # the operation is that of the case's own turbine
            torque = torque_of(rotor, blade, speed, flow)
        held = torque - generator.friction(speed)
        if physics.law.is_static:  # a rotor may be in motion, and not in equilibrium
            held = physics.law_in(scenario).torque(speed, point.gains)
        quantities = trajectory_of(time, flow, speed, torque, held, radius, generator)
        quantities |= loads_along(rotor, blade, quantities, physics.load_names)
        rate = 0.0 * held if scenario.steady else np.gradient(held, time)
        quantities |= {"torque_rate": rate, "steady": scenario.steady}
        quantities |= scalars(physics, rotor, blade)
        starts.append(quantities | dict(zip(physics.law.states, states, strict=True)))
    weights = [scenario.weight for scenario in physics.scenarios]
    integrals = {
        name: float(np.dot(weights, _integrals(physics, starts, integrand)))
        for name, integrand in INTEGRALS.items()
    }
    return [quantities | integrals for quantities in starts]


def in_motion(physics: Physics, point: StartingPoint) -> StartingPoint:
    """Return a start whose rotor follows an open loop's schedule as its inertia allows.

    The generator has no more torque or power than without time, and does not drive the rotor; where
    that does not lead to the next speed of the schedule, the speed is another one, to first order
    that at the same captured power. Else a heavy rotor in turbulence begins far beyond its limits:
    104 iterations of the first optimization of `river25_record` for 35. The iterate of a run that
    is resumed keeps to this already, and stays as it is.
    """
    if not physics.law.chooses_speed:
        return point
    rows = []
    for start in on_start(physics, point):
        schedule, driving = start["rotor_speed"], start["hydrodynamic_torque"]
        held, speed = np.maximum(start["control_torque"], 0.0), schedule.copy()
        most = np.minimum(np.max(held), np.max(held * schedule) / schedule)
        steps = [] if start["steady"] else start["inertia"] / np.diff(start["time"])
        for i, per_change in enumerate(steps, 1):
            torque = held[i] - per_change * (schedule[i] - speed[i - 1])
            beyond = torque - min(max(torque, 0.0), most[i])
            speed[i] += beyond / (per_change + held[i] / schedule[i])
        rows.append((speed, driving * schedule / speed))
    speed, driving = np.concatenate(rows, axis=1)
    operation = replace(point.operation, rotor_speed=speed, hydrodynamic_torque=driving)
    return replace(point, operation=operation)


def torque_of(rotor: RotorModel, blade: Blade, speed: np.ndarray, flow: np.ndarray) -> np.ndarray:
    """Return the torque in steady operation by direct BEM, N*m, at speeds of rotor and flow.

    All are of shape (n_times,), in rad/s and m/s.
    """
    ratio = np.maximum(speed * blade.rotor_radius / flow, SLOWEST_RATIO)
    scale = torque_scale(rotor.water_density, blade.rotor_radius, flow)
    return scale * rotor.coefficients(blade, ratio).torque


def loads_along(
    rotor: RotorModel, blade: Blade, series: dict, names: tuple[str, ...], reach: float = np.inf
) -> dict:
    """Return the largest loads along a blade at each time of a trajectory, SI units.

    By direct BEM at the trajectory's tip speed ratios, or at `RATIOS` of them if there are more,
    between which they are linear. series has the quantities of the trajectory, and the `sections`
    where the wake is not in equilibrium: the flow at each time. Beyond the radius `reach` (m) no
    load counts.
    """
    ratio, flow = np.maximum(series["tip_speed_ratio"], SLOWEST_RATIO), series["inflow_speed"]
    if not names:
        return {}

    def largest(rotor, ratio, sections=None):
        loads = rotor.loads(blade, ratio, names=names, flow=sections)
        return {k: x._replace(exact=x.exact[:, x.r <= reach]).largest for k, x in loads.items()}

    parts = np.array_split(np.arange(ratio.size), -(-ratio.size // RATIOS))
    if "sections" in series:
        loads = largest(rotor, ratio, series["sections"])
    elif len(parts) == 1 or rotor.polar.follows_reynolds:  # the flow counts too
        pieces = [largest(rotor.at_flow(flow[part]), ratio[part]) for part in parts]
        loads = {name: np.concatenate([piece[name] for piece in pieces]) for name in names}
    else:
        at = np.linspace(ratio.min(), ratio.max(), RATIOS)
        loads = {name: np.interp(ratio, at, x) for name, x in largest(rotor, at).items()}
    pressure = 0.5 * rotor.water_density * flow**2
    return {name: pressure * load for name, load in loads.items()}


def scalars(physics: Physics, rotor: RotorModel, blade: Blade) -> dict[str, Any]:
    """Return the quantities of a design, along the span and as numbers, by name; SI units.

    `rotor` is one of those of the physics. The weight's stress is 0 where nothing asks for it.
    """
    mass, inertia = rotor.mass_and_inertia(blade)
    stress = rotor.weight_stress(blade).largest[0] if physics.asks_for("weight_stress") else 0.0
    return {
        "rotor_radius": blade.rotor_radius,
        "density": rotor.water_density,
        "inertia": float(inertia),
        "mass": float(mass),
        "blade_area": float(blade.area_weights @ blade.chord),
        "weight_stress": float(stress),
        "chord": blade.chord,
        "twist": blade.twist,
        "thickness": rotor.thickness_of(blade),
    }


def steady_plant(physics: Physics, rotor: RotorModel, blade: Blade) -> Plant:
    """Return a rotor, one of those of the physics, with direct BEM, its wake in equilibrium."""
    water, inertia = rotor.water_density, float(rotor.mass_and_inertia(blade).inertia)
    solver = SOLVERS[physics.case.hydrodynamics.check]
    return Plant(blade, rotor.polar, inertia, water, solver, physics.case.generator)


def united(physics: Physics, integrals: Iterable[float]) -> float:
    """Return the objective that follows from its integrals over the scenarios, one for each.

    Those of `scenarios`, in their order, over the time of each.
    """
    return physics.case.phase.duration * physics.case.robustness.of(*_means(physics, integrals))


def _means(physics, integrals) -> tuple[np.ndarray, np.ndarray]:
    """Return the rates that the aggregate takes, of integrals over the scenarios, and shares."""
    means = dict.fromkeys(physics.shares, 0.0)
    for scenario, integral in zip(physics.scenarios, integrals, strict=True):
        means[scenario.group] += float(integral) / scenario.mesh.duration
    rates, shares = (np.array(list(each.values())) for each in (means, physics.shares))
    return physics.rate_factors * rates, shares


def _integrals(physics, starts, objective) -> list[float]:
    """Return the integrals of an objective's rate over each scenario, of `on_start`."""
    pairs = zip(physics.scenarios, starts, strict=True)
    return [scenario.sample_weights @ objective.rate_of(start) for scenario, start in pairs]


def epigraph(physics: Physics, point: StartingPoint) -> tuple[np.ndarray, int]:
    """Return the aggregate's unknowns at a starting point, and the number of its rows."""
    aggregate, starts = physics.case.robustness, on_start(physics, point)
    means = _means(physics, _integrals(physics, starts, physics.objective))
    unknowns = aggregate.best_unknowns(*means)
    return unknowns, np.size(aggregate.rows(*means, unknowns))


def objective_at(physics: Physics, point: StartingPoint) -> float:
    """Return the objective of a quasi-steady starting point, in its unit, without its price."""
    starts = on_start(physics, point)
    if not physics.objective.is_rate:
        return float(physics.objective.value_of(starts[0]))
    return united(physics, _integrals(physics, starts, physics.objective))


def excesses(physics: Physics, point: StartingPoint) -> dict[str, tuple[float, float | None]]:
    """Return by how much a starting point exceeds each limit, design bounds aside, and where.

    By name: the relative excess, at most 0 if it is kept, and the flow's speed (m/s) there; None
    for a limit on the design alone.
    """
    largest: dict[str, tuple[float, float | None]] = {}
    for scenario, start in zip(physics.scenarios, on_start(physics, point), strict=True):
        flow = start["inflow_speed"]
        for limit in (*scenario.limits, *physics.design_limits):
            if not isinstance(limit, DesignBounds):
                over = limit.excess(start)
                worst = int(np.argmax(over))
                if limit.name not in largest or over[worst] > largest[limit.name][0]:
                    there = float(flow[worst]) if limit.place == "time" else None
                    largest[limit.name] = float(over[worst]), there
    return largest


def broken_limits(physics: Physics, point: StartingPoint) -> list[str]:
    """Return the names of the limits, design bounds aside, that a point does not keep."""
    return [name for name, (over, _) in excesses(physics, point).items() if over > START_EXCESS]
