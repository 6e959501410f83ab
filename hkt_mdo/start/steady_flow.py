"""Steady operation of a blade at some speeds of a case's flow: rates, limits and their branches.

A rotor keeps a limit of its power by turning faster or slower than where it captures most: these
are the branches of the tip speed ratio.

Over time the operation is quasi-steady. The rotor's time constant is a few hundredths of a second
and the flow changes over many seconds, so the rotor follows Q = u + F on the unstalled side, F the
friction of the shaft. No differential equation is solved, so there are no false solutions; the
energy is within about 1e-5 of the dynamic one.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.laws import Law
from hkt_mdo.dynamics.limits import SLOWED, ElectricalPowerLimit, Limit, PowerLimit, TorqueLimit
from hkt_mdo.dynamics.simulation import FeedbackTorque, Plant, by_curve
from hkt_mdo.dynamics.trajectory import trajectory_of
from hkt_mdo.problem.evaluation import scalars
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import Operation
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.quantities import STEADY
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.polars import Polars
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.torque_curve import TorqueSpline

BRANCHES = {"overspeed": 1, "underspeed": -1}
"""On which side of the ratio of the largest rate each branch keeps the limits."""
KNOTS = 32  # speeds of a flow without time


def in_speeds(
    speed: np.ndarray, weights: np.ndarray, knots: int = KNOTS
) -> tuple[np.ndarray, np.ndarray]:
    """Return equally spaced speeds of a flow, from the slowest to the fastest, and their times.

    The time of each sample is shared by its two neighbours so that the power of the flow is kept.

    Parameters
    ----------
    speed, weights : np.ndarray
        Speeds at quadrature points, m/s, and their weights, s, shape (n_times,).
    knots : int
        Number of speeds; a constant flow has one.

    Returns
    -------
    speeds, times : np.ndarray
        m/s and s, shape (knots,).
    """
    low, high = float(np.min(speed)), float(np.max(speed))
    if high - low < 1e-9 * high:
        return np.array([high]), np.array([np.sum(weights)])
    speeds = np.linspace(low, high, knots)
    position = np.clip((speed - low) / (speeds[1] - low), 0.0, knots - 1.0)
    below = np.minimum(position.astype(int), knots - 2)
    share, cubes = position - below, weights * speed**3
    sums = np.bincount(below, cubes * (1.0 - share), knots)
    sums += np.bincount(below + 1, cubes * share, knots)
    return speeds, sums / speeds**3


@dataclass(frozen=True, eq=False)
class SteadyFlow:
    """Steady operation of a case's rotor at some speeds of its flow.

    Attributes
    ----------
    physics : Physics
    spline : TorqueSpline
        Over the tip speed ratio.
    speeds : np.ndarray
        Speeds of the flow, m/s, shape (n,).
    limits : tuple of Limit
        The limits that a schedule keeps.
    """

    physics: Physics
    spline: TorqueSpline
    speeds: np.ndarray
    limits: tuple[Limit, ...]
    _curves: dict[Blade, tuple[np.ndarray, dict]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, physics: Physics, spline: TorqueSpline) -> "SteadyFlow":
        """Return the speeds of a case's flows; a rate over v³ is linear between two of them."""
        return cls(physics, spline, in_speeds(*physics.sampled_flow)[0], _kept(physics))

    def within(self, scenario: Scenario, knots: int) -> "SteadyFlow":
        """Return the same for a number of speeds of one of the scenarios, within its limits."""
        part = replace(self.physics, scenarios=(scenario,))
        return replace(self, speeds=in_speeds(*part.sampled_flow, knots)[0], limits=_kept(part))

    def curves(self, blade: Blade) -> tuple[np.ndarray, dict[str, Any]]:
        """Return a blade's coefficients at the nodes, and its `scalars`, which are computed once.

        The coefficients are those of the torque, then of the loads, shape (n_nodes, n).
        """
        if blade not in self._curves:
            physics, names = self.physics, ["torque_coefficient", *self.physics.load_names]
            tables = physics.rotor.tables(blade, self.spline.nodes, names)
            table = np.stack([each.values for each in tables.values()], axis=1)
            self._curves[blade] = table, scalars(physics, physics.rotor, blade)
        return self._curves[blade]

    def along(self, blade: Blade, ratio: np.ndarray, flow: np.ndarray | None = None) -> dict:
        """Return the quantities of a trajectory in steady operation, and the design's scalars.

        Parameters
        ----------
        blade : Blade
        ratio : np.ndarray
            Tip speed ratios, shape (n,).
        flow : np.ndarray, optional
            Speeds of the flow, m/s, shape (n,); by default `speeds`.

        Returns
        -------
        dict
            By the names of `hkt_mdo.quantities`, SI units.
        """
        flow, physics = self.speeds if flow is None else flow, self.physics
        generator, radius = physics.case.generator, blade.rotor_radius
        table, design = self.curves(blade)
        torque, *loads = self.spline.curve(table)(ratio).T
        torque = torque_scale(physics.density, radius, flow) * torque
        speed = ratio * flow / radius
        torques = torque, torque - generator.friction(speed)  # of the flow, of the generator
        series = trajectory_of(np.zeros(flow.shape), flow, speed, *torques, radius, generator)
        loads = 0.5 * physics.density * flow**2 * np.reshape(loads, (-1, flow.size))
        return series | dict(zip(physics.load_names, loads, strict=True)) | design

    def excess(self, series: dict) -> np.ndarray:
        """Return by how much the limits are exceeded at most, relatively; -inf without limits."""
        over = np.full(series["time"].size, -np.inf)
        for limit in self.limits:
            over = np.maximum(over, limit.excess(series))
        return over

    def at_nodes(self, blade: Blade) -> tuple[np.ndarray, np.ndarray]:
        """Return the objective's rates (W) and the excess of the limits, both (n, n_nodes)."""
        nodes, n = self.spline.nodes, self.speeds.size
        series = self.along(blade, np.tile(nodes, n), np.repeat(self.speeds, nodes.size))
        rate = self.physics.start_objective.rate_of(series)
        return rate.reshape(n, -1), self.excess(series).reshape(n, -1)

    def side(self, blade: Blade, ratio: float) -> str:
        """Return the branch of a blade that works at a tip speed ratio in the fastest flow."""
        rate, _ = replace(self, speeds=self.speeds[-1:]).at_nodes(blade)
        return "overspeed" if ratio >= self.spline.nodes[np.argmax(rate)] else "underspeed"

    def ratios(self, blade: Blade, branch: str) -> np.ndarray:
        """Return the tip speed ratios of a branch of an open loop at the speeds of the flow.

        That of the largest rate where it keeps the limits; else the next one on the branch's side
        that does; where none does, that of the smallest excess.
        """
        nodes, sign = self.spline.nodes, BRANCHES[branch]
        rate, over = self.at_nodes(blade)
        peak = np.clip(np.argmax(rate, axis=1), 1, nodes.size - 2)
        largest = self._largest(blade, nodes[peak - 1], nodes[peak + 1])
        order = np.arange(nodes.size)[::sign]  # of the search, from either end
        beyond = (nodes[order] - largest[:, None]) * sign > 0.0
        allowed = beyond & (over[:, order] <= 0.0)
        least = np.argmin(np.where(beyond, over[:, order], np.inf), axis=1)
        has, first = allowed.any(axis=1), np.argmax(allowed, axis=1)
        before = np.maximum(nodes[order[first - 1]] * sign, largest * sign)
        broken = self.excess(self.along(blade, largest)) > 0.0
        inside = np.where(has, nodes[order[first]], nodes[order[least]])
        outside = np.where(has, before * sign, inside)
        inside, outside = (np.where(broken, end, largest) for end in (inside, outside))
        for _ in range(30 * np.any(broken)):  # bisection to where the limits begin to hold
            middle = 0.5 * (inside + outside)
            broken = self.excess(self.along(blade, middle)) > 0.0
            inside, outside = np.where(broken, inside, middle), np.where(broken, middle, outside)
        return inside

    def _largest(self, blade, low, high):
        """Return the tip speed ratios of the largest rate between others (golden section)."""
        share = 0.5 * (np.sqrt(5.0) - 1.0)

        def rate(ratio):
            return self.physics.start_objective.rate_of(self.along(blade, ratio))

        for _ in range(20):
            width = share * (high - low)
            left, right = high - width, low + width
            lower = rate(left) > rate(right)
            low, high = np.where(lower, low, left), np.where(lower, right, high)
        return 0.5 * (low + high)


def has_branches(physics: Physics) -> bool:
    """Tell whether a case has limits besides the torque's, which several schedules may keep."""
    return any(not isinstance(limit, TorqueLimit) for limit in _kept(physics))


def limits_power(physics: Physics) -> bool:
    """Tell whether a case has a limit of the power."""
    return any(isinstance(limit, PowerLimit | ElectricalPowerLimit) for limit in _kept(physics))


def _kept(physics: Physics) -> tuple[Limit, ...]:
    """Return the limits that a schedule keeps: those over time that the optimization constrains.

    In any of the scenarios, since a flow speed has one tip speed ratio. Limits on rates are left
    out, since a schedule has no time, and limits on quantities that a schedule does not have.
    """
    law = physics.law

    def constrains(limit):  # a torque limit is held by a law's saturation
        return limit.constrains(law) or (isinstance(limit, TorqueLimit) and not law.is_static)

    return tuple(
        limit
        for limit in physics.all_limits
        if limit.caps_series and STEADY >= {*limit.inputs} and constrains(limit)
    )


@dataclass(frozen=True, eq=False)
class QuasiSteady:
    """Quasi-steady operation of a rotor in a flow under a control law.

    Attributes
    ----------
    plant : Plant
        The rotor, with its torque by a spline over the tip speed ratio.
    law : Law
        Of the torque.
    inflow_speed, weights : np.ndarray
        The flow at quadrature points of time, m/s, and their weights, s, shape (n_times,).
    """

    plant: Plant
    law: Law
    inflow_speed: np.ndarray
    weights: np.ndarray

    @classmethod
    def of(cls, physics: Physics, blade: Blade, curve: Callable) -> "QuasiSteady":
        """Return the operation of a blade, with a curve of its torque, in all flows of a case."""
        density, generator = physics.density, physics.case.generator
        plant = Plant(blade, Polars(), np.nan, density, by_curve(curve), generator)
        return cls(plant, physics.law, *physics.sampled_flow)

    def operate(self, gains) -> Operation:
        """Return the operation of a rotor under a static law, at its fastest equilibria.

        Parameters
        ----------
        gains : array_like
            Of the law, shape (n_gains,).

        Returns
        -------
        Operation
        """
        controller = FeedbackTorque(self.law, gains)
        speed, running, _ = equilibria(self.plant, controller, self.inflow_speed)
        return replace(self.held(speed), running=bool(np.all(running)))

    def recovers(self, gains, operation: Operation) -> bool:
        """Tell whether a rotor in operation under a law recovers from a small loss of speed."""
        speed = (1.0 - SLOWED) * operation.rotor_speed
        return bool(np.all(self.generator_torque(speed) > self.law.torque(speed, gains)))

    def held(self, speed, states=()) -> Operation:
        """Return the operation of a rotor that a controller holds at speeds, rad/s, (n_times,).

        `states` are those of the law, (n_times,) each.
        """
        torque = self.plant.torque(speed, self.inflow_speed)
        energy = float(self.weights @ (torque * speed))
        return Operation(energy, speed, torque, bool(np.all(torque > 0.0)), tuple(states))

    def generator_torque(self, speed) -> np.ndarray:
        """Return the generator's torque, N m, that holds the rotor at speeds, rad/s, (n_times,)."""
        return self.plant.generator_torque(speed, self.inflow_speed)
