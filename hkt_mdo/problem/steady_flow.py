"""Steady operation of a blade at some speeds of a case's flow: rates, limits and their branches.

A rotor keeps a limit of its power by turning faster or slower than where it captures most: these
are the branches of the tip speed ratio.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hkt_mdo.dynamics.limits import Limit, TorqueLimit
from hkt_mdo.dynamics.trajectory import RATES, quantities
from hkt_mdo.problem.physics import Physics
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.torque_curve import TorqueSpline

BRANCHES = {"overspeed": 1, "underspeed": -1}
"""On which side of the ratio of the largest rate each branch keeps the limits."""
KNOTS = 32  # flow speeds of a schedule that is designed


@dataclass(frozen=True, eq=False)
class Curves:
    """Coefficients of a blade over the tip speed ratio, by name: "torque" and loads.

    values[n_nodes] are those at the nodes of a spline. inertia in kg m².
    """

    blade: Blade
    inertia: float
    values: dict[str, np.ndarray]

    @cached_property
    def table(self) -> np.ndarray:
        """The values of all, (n_nodes, n_names)."""
        return np.stack(list(self.values.values()), axis=1)


@dataclass(frozen=True, eq=False)
class SteadyFlow:
    """Steady operation of a case's rotor at some speeds of its flow.

    speeds[n] (m/s) and weights[n] (s): the objective is the sum of weights times rates. spline is
    over the tip speed ratio.
    """

    physics: Physics
    spline: TorqueSpline
    speeds: np.ndarray
    weights: np.ndarray

    @classmethod
    def of(cls, physics: Physics, spline: TorqueSpline, knots: int = KNOTS) -> SteadyFlow:
        """Take the flows of a case; a rate over v³ is linear between the speeds of two knots."""
        scenarios = physics.scenarios
        speed = np.concatenate([each.inflow.speed_at(each.samples) for each in scenarios])
        weights = np.concatenate([each.weight * each.sample_weights for each in scenarios])
        low, high = float(np.min(speed)), float(np.max(speed))
        if high - low < 1e-9 * high:
            return cls(physics, spline, np.array([high]), np.array([np.sum(weights)]))
        speeds = np.linspace(low, high, knots)
        place = np.clip((speed - low) / (speeds[1] - low), 0.0, knots - 1.0)
        below = np.minimum(place.astype(int), knots - 2)
        share, cubes = place - below, weights * speed**3
        sums = np.bincount(below, cubes * (1.0 - share), knots)
        sums += np.bincount(below + 1, cubes * share, knots)
        return cls(physics, spline, speeds, sums / speeds**3)

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """The limits that a schedule keeps."""
        return _kept(self.physics)

    def curves(self, blade: Blade) -> Curves:
        """Return the curves of a blade."""
        physics, nodes = self.physics, self.spline.nodes
        values = {"torque": bem.rotor_coefficients(blade, physics.polar, nodes).torque}
        loads = physics.loads.coefficients(blade, nodes, names=physics.load_names)
        for name, load in loads.items():
            values[name] = load.envelope(physics.loads.exponent).values
        return Curves(blade, physics.mass_and_inertia(blade)[1], values)

    def coefficients(self, curves: Curves, ratio) -> dict:
        """Return what the quantities of steady operation follow from, at tip speed ratios."""
        radius, inertia = curves.blade.rotor_radius, curves.inertia
        found = {"ratio": ratio, "rotor_radius": radius, "inertia": inertia}
        all_values, _ = self.spline.values(curves.table, ratio)
        return found | dict(zip(curves.values, all_values.T, strict=True))

    def known(self, coefficients: dict, flow=None) -> dict:
        """Return the quantities of a trajectory in steady operation, and the design's scalars."""
        flow, physics = self.speeds if flow is None else flow, self.physics
        ratio, radius = coefficients["ratio"], coefficients["rotor_radius"]
        torque = torque_scale(physics.density, radius, flow) * coefficients["torque"]
        speed = ratio * flow / radius
        both = torque, torque  # of the flow and of the generator
        found = quantities(np.zeros(flow.shape), flow, speed, *both, radius, physics.generator)
        for name in physics.load_names:
            if name in coefficients:
                found[name] = 0.5 * physics.density * flow**2 * coefficients[name]
        scalars = {"density": physics.density, "inertia": coefficients["inertia"]}
        return found | {"rotor_radius": radius} | scalars

    def met(self, curves: Curves, ratio, flow=None) -> dict:
        """Return what `known` does of curves at tip speed ratios."""
        return self.known(self.coefficients(curves, ratio), flow)

    def excess(self, known: dict) -> np.ndarray:
        """Return by how much the limits are exceeded at most, relatively; -inf without limits."""
        over = np.full(known["time"].size, -np.inf)
        for limit in self.limits:
            over = np.maximum(over, limit.excess(known))
        return over

    def at(self, curves: Curves, ratio) -> tuple[np.ndarray, np.ndarray]:
        """Return the objective's rates, W, at tip speed ratios, and the excess of the limits."""
        known = self.met(curves, ratio)
        return self.physics.objective.rate_of(known), self.excess(known)

    def at_nodes(self, curves: Curves) -> tuple[np.ndarray, np.ndarray]:
        """Return what `at` does at all nodes of the spline, of shape (n, n_nodes)."""
        nodes, n = self.spline.nodes, self.speeds.size
        flow = np.repeat(self.speeds, nodes.size)
        known = self.met(curves, np.tile(nodes, n), flow)
        rate = self.physics.objective.rate_of(known)
        return rate.reshape(n, -1), self.excess(known).reshape(n, -1)

    def ratios(self, curves: Curves, branch: str) -> np.ndarray:
        """Return the tip speed ratios of a branch of an open loop at the speeds of the flow.

        That of the largest rate where it keeps the limits; else the next one on the branch's side
        that does; where none does, that of the smallest excess.
        """
        nodes = self.spline.nodes
        rate, over = self.at_nodes(curves)
        peak = np.clip(np.argmax(rate, axis=1), 1, nodes.size - 2)
        found = self._largest(curves, nodes[peak - 1], nodes[peak + 1])
        order = np.arange(nodes.size)[:: BRANCHES[branch]]  # of the search, from either end
        beyond = (nodes[order] - found[:, None]) * BRANCHES[branch] > 0.0
        kept = beyond & (over[:, order] <= 0.0)
        least = np.argmin(np.where(beyond, over[:, order], np.inf), axis=1)
        has, first = kept.any(axis=1), np.argmax(kept, axis=1)
        before = np.maximum(nodes[order[first - 1]] * BRANCHES[branch], found * BRANCHES[branch])
        broken = self.at(curves, found)[1] > 0.0
        inside = np.where(has, nodes[order[first]], nodes[order[least]])
        outside = np.where(has, before * BRANCHES[branch], inside)
        inside, outside = (np.where(broken, each, found) for each in (inside, outside))
        for _ in range(30 * np.any(broken)):  # bisection to where the limits begin to hold
            middle = 0.5 * (inside + outside)
            broken = self.excess(self.met(curves, middle)) > 0.0
            inside, outside = np.where(broken, inside, middle), np.where(broken, middle, outside)
        return inside

    def _largest(self, curves, low, high):
        """Return the tip speed ratios of the largest rate between others (golden section)."""
        share = 0.5 * (np.sqrt(5.0) - 1.0)

        def rate(ratio):
            return self.physics.objective.rate_of(self.met(curves, ratio))

        for _ in range(20):
            width = share * (high - low)
            left, right = high - width, low + width
            lower = rate(left) > rate(right)
            low, high = np.where(lower, low, left), np.where(lower, right, high)
        return 0.5 * (low + high)


def has_branches(physics: Physics) -> bool:
    """Tell whether a case has limits that several schedules keep: others than torque's."""
    return any(not isinstance(each, TorqueLimit) for each in _kept(physics))


def _kept(physics: Physics) -> tuple[Limit, ...]:
    """Return the limits that a schedule keeps: those over time that the optimization constrains.

    Those of rates are none: a schedule has no time.
    """
    control = physics.case.control

    def constrains(limit):  # a torque limit is held by a law's saturation
        if RATES.keys() & set(limit.inputs):
            return False
        saturates = physics.law is not None and not physics.states
        return limit.constrains(control) or (isinstance(limit, TorqueLimit) and not saturates)

    return tuple(each for each in physics.limits if each.caps_series and constrains(each))
