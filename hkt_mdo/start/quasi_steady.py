"""Quasi-steady operation: the torques on the rotor balance at every instant.

The rotor's time constant is a few hundredths of a second and the flow changes over many seconds, so
the rotor follows Q = u + F on the unstalled side, F the friction of the shaft. No differential
equation is solved, so there are no false solutions; the energy is within about 1e-5 of the dynamic
one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from hkt_mdo.dynamics.formulas import STEP
from hkt_mdo.dynamics.generator import LOSSLESS, Generator
from hkt_mdo.dynamics.laws import Law, OpenLoop
from hkt_mdo.dynamics.limits import SLOWED, TYPICAL
from hkt_mdo.problem.point import Operation
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.torque_curve import TorqueSpline

if TYPE_CHECKING:  # operation itself needs neither Dymos nor BEM
    from hkt_mdo.problem.physics import Physics
    from hkt_mdo.rotor.steady_optimum import SteadyOptimum

SAFE = 2e-2  # margin that a start keeps, so that the optimization begins inside its constraints

SPAN, CURVE_NODES = (0.3, 2.6), 161  # of the curve, over the optimum's tip speed ratio; nodes
PROBES = 12  # flow speeds at which the distance from stall is evaluated
FEWEST_SPEEDS, MOST_SPEEDS = 100, 400  # flow speeds in a condensed problem
N_SEARCH = 240  # points of the search for the unstalled root over the torque curve


def sampled_flow(physics: Physics) -> tuple[np.ndarray, np.ndarray]:
    """Return the speeds (m/s) of all scenarios' flows, and their weights (s), both (n_times,)."""
    scenarios = physics.scenarios
    speed = np.concatenate([each.inflow.speed_at(each.samples) for each in scenarios])
    return speed, np.concatenate([each.weight * each.sample_weights for each in scenarios])


@dataclass(frozen=True, eq=False)
class QuasiSteady:
    """Quasi-steady operation of a rotor in a flow under a controller.

    Attributes
    ----------
    inflow_speed, weights : np.ndarray
        The flow at quadrature points of time, m/s, and their weights, s, shape (n_times,).
    density, rotor_radius : float
        Of the water, kg/m**3, and of the swept disc, m.
    spline : TorqueSpline
        Over the tip speed ratio.
    law : Law
        For open loop the torque captures most power at each instant, up to its limit.
    slowed : float
        Share of its speed that a rotor under feedback must be able to lose.
    generator : Generator or None
        With a generator, open loop delivers most electrical power at each instant.
    shaft : Generator
        Whose shaft has the friction.
    """

    inflow_speed: np.ndarray
    weights: np.ndarray
    density: float
    rotor_radius: float
    spline: TorqueSpline
    law: Law = field(default_factory=OpenLoop)
    slowed: float = SLOWED
    generator: Generator | None = None
    shaft: Generator = LOSSLESS

    @classmethod
    def of(cls, physics: Physics, optimum: SteadyOptimum, slowed: float = SLOWED) -> QuasiSteady:
        """Return the problem of a case over all its scenarios' flows.

        The curve reaches from `SPAN[0]` to `SPAN[1]` of the tip speed ratio of a steady optimum.
        """
        return cls(
            *sampled_flow(physics),
            physics.density,
            physics.blade.rotor_radius,
            TorqueSpline(np.linspace(*SPAN, CURVE_NODES) * optimum.tip_speed_ratio),
            physics.law,
            slowed,
            physics.starting_generator,
            physics.generator,
        )

    def condensed(self) -> QuasiSteady:
        """Return the same problem at one flow speed for forty, but 100 to 400 of them.

        The order of the flow speeds does not matter: instants of nearly equal speed become one with
        their total weight and mean cubed speed. The slowest and the fastest speed are kept.
        """
        v = self.inflow_speed
        most = min(max(v.size // 40, FEWEST_SPEEDS), MOST_SPEEDS)
        if v.size <= most:
            return self
        edges = np.linspace(np.min(v), np.max(v), most - 1)
        place = np.clip(np.digitize(v, edges) - 1, 0, most - 3)
        weights = np.bincount(place, self.weights)
        cubes = np.bincount(place, self.weights * v**3)
        used = weights > 0.0
        speeds = np.cbrt(cubes[used] / weights[used])
        return replace(
            self,
            inflow_speed=np.concatenate(([v.min()], speeds, [v.max()])),
            weights=np.concatenate(([0.0], weights[used], [0.0])),
        )

    def operate(self, table, gains=()) -> Operation:
        """Return the operation of a rotor.

        Parameters
        ----------
        table : np.ndarray
            Torque coefficients at the nodes of the spline, shape (n_nodes,).
        gains : array_like
            Of the law, shape (n_gains,).

        Returns
        -------
        Operation
            With its gradient, which is computed when it is called, and a law's margins.
        """
        v, law, gains = self.inflow_speed, self.law, np.asarray(gains, dtype=float)
        if not law.is_feedback:
            held, ratio, running = self._open_loop(table)
        else:
            held = np.ones(v.size, dtype=bool)
            ratio, running = self._balance(
                table, lambda w: law.torque(w, gains), lambda w: law.torque_by_speed(w, gains)
            )
        operation = replace(self.held(table, ratio * v / self.rotor_radius), running=running)
        return replace(
            operation,
            margin=self._margins(table, gains, operation.rotor_speed),
            gradient=partial(self._gradient, table, gains, held, operation.rotor_speed),
        )

    def _gradient(self, table, gains, held, w):
        """Return the gradient of an operation that is held at speeds (`Operation.gradient`)."""
        v, law = self.inflow_speed, self.law
        torque, by_speed, by_radius, by_table = self._slopes(table, v, w)
        if law.is_feedback:
            slope, by_gains = law.torque_by_speed(w, gains), law.torque_by_gain(w, gains)
        else:
            slope, by_gains = np.zeros(v.size), np.zeros((0, v.size))
        slope = slope + self.shaft.shaft_friction_slope
        # Where the controller holds the speed, Q = u + F moves w. Elsewhere w is where the power is
        # largest, and a small change of w does not matter.
        stiffness = np.where(held, slope - by_speed, np.inf)
        _, power_by_torque, power_by_speed = self._power(torque, w)
        moved = (power_by_speed + power_by_torque * by_speed) / stiffness  # dP/dw dw/dQ
        by_torque = self.weights * (power_by_torque + moved)
        by_all = by_torque @ by_table, -by_gains @ (self.weights * moved), [by_torque @ by_radius]
        gradient = np.concatenate(by_all)[None]
        if not law.is_feedback:
            return gradient
        return np.vstack((gradient, self._margin_gradients(table, gains, w, stiffness)))

    def held(self, table, speed) -> Operation:
        """Return the operation of a rotor that a controller holds at speeds, rad/s, (n_times,)."""
        torque = self._driving(table, self.inflow_speed, speed)
        power = torque * speed
        maximized = power if self.generator is None else self._electrical(torque, speed)
        energy, delivered = (float(self.weights @ rate) for rate in (power, maximized))
        running = bool(np.all(torque > 0.0))
        return Operation(energy, speed, torque, running, delivered=delivered)

    def _power(self, torque, w):
        """Return the maximized power in equilibrium, and its derivatives by torque and speed."""
        if self.generator is None:
            return torque * w, w, torque
        power = self._electrical
        by_torque, by_speed = power(torque + 1j * STEP, w), power(torque, w + 1j * STEP)
        return by_torque.real, by_torque.imag / STEP, by_speed.imag / STEP

    def _electrical(self, torque, w):
        """Return the electrical power in equilibrium with a torque of the flow."""
        return self.generator.electrical_power(torque - self.shaft.friction(w), w)

    def _driving(self, table, v, w):
        """Return the hydrodynamic torque, N m."""
        scale = torque_scale(self.density, self.rotor_radius, v)
        return scale * self.spline.values(table, w * self.rotor_radius / v)[0]

    def _slopes(self, table, v, w):
        """Return the hydrodynamic torque; its derivatives by rotor speed, radius and table."""
        radius, scale = self.rotor_radius, torque_scale(self.density, self.rotor_radius, v)
        ratio = w * radius / v
        by_table = scale[:, None] * self.spline.basis(ratio)
        torque = by_table @ table
        by_speed = scale * self.spline.values(table, ratio)[1] * radius / v
        return torque, by_speed, (3.0 * torque + by_speed * w) / radius, by_table

    @cached_property
    def _probes(self):
        """The instants of the margins: from the slowest flow to the fastest."""
        order = np.argsort(self.inflow_speed)
        return order[np.unique(np.linspace(0, order.size - 1, PROBES).round().astype(int))]

    def _margins(self, table, gains, speed):
        """Return the margins of an operation at rotor speeds, rad/s."""
        if not self.law.is_feedback:
            return np.empty(0)
        v, slowed = self.inflow_speed[self._probes], (1.0 - self.slowed) * speed[self._probes]
        braking = self.law.torque(slowed, gains) + self.shaft.friction(slowed)
        margin = self._driving(table, v, slowed) - braking
        return margin / (TYPICAL * torque_scale(self.density, self.rotor_radius, v))

    def _margin_gradients(self, table, gains, speed, stiffness):
        """Return the gradient of the margins of an operation, shape (n_margins, n_variables)."""
        law, v, w = self.law, self.inflow_speed[self._probes], speed[self._probes]
        slowed = (1.0 - self.slowed) * w
        _, _, by_radius_here, by_table_here = self._slopes(table, v, w)
        driving, by_speed, by_radius, by_table = self._slopes(table, v, slowed)
        margin = driving - law.torque(slowed, gains) - self.shaft.friction(slowed)
        # The equilibrium moves too: dw = d(Q - u) / stiffness.
        moved = (
            (1.0 - self.slowed)
            * (by_speed - law.torque_by_speed(slowed, gains) - self.shaft.shaft_friction_slope)
            / stiffness[self._probes]
        )
        by_gain = -(law.torque_by_gain(slowed, gains) + moved * law.torque_by_gain(w, gains)).T
        by_table = by_table + moved[:, None] * by_table_here
        by_radius = by_radius + moved * by_radius_here - 3.0 * margin / self.rotor_radius
        unit = TYPICAL * torque_scale(self.density, self.rotor_radius, v)
        return np.hstack((by_table, by_gain, by_radius[:, None])) / unit[:, None]

    def _open_loop(self, table):
        """Operate at the largest power, or faster where the torque limit is active."""
        curve, best = self.spline.curve(table), self._best_ratio
        if self.generator is not None:
            best = self._best_electrical_ratios
        ratio = np.broadcast_to(best(curve), self.inflow_speed.shape).copy()
        limit = np.inf if self.law.torque_limit is None else self.law.torque_limit
        scale = torque_scale(self.density, self.rotor_radius, self.inflow_speed)
        speed = ratio * self.inflow_speed / self.rotor_radius
        held, running = scale * curve(ratio) - self.shaft.friction(speed) > limit, True
        if held.any():
            limited = replace(self, inflow_speed=self.inflow_speed[held])
            constant = (lambda w: np.full(w.shape, limit)), np.zeros_like
            ratio[held], running = limited._balance(table, *constant)
        return held, ratio, running

    def _best_ratio(self, curve):
        """Return the tip speed ratio of the largest power coefficient."""
        ratios = np.linspace(curve.x[0], curve.x[-1], N_SEARCH)
        peak = int(np.argmax(ratios * curve(ratios)))
        ends = ratios[[max(peak - 1, 0), min(peak + 1, ratios.size - 1)]]
        return _root(
            lambda x: (curve(x) + x * curve(x, 1), 2.0 * curve(x, 1) + x * curve(x, 2)),
            *ends[:, None],
        )[0]

    def _best_electrical_ratios(self, curve):
        """Return the tip speed ratio of the largest electrical power at each instant."""
        ratios = np.linspace(curve.x[0], curve.x[-1], N_SEARCH)
        scale = torque_scale(self.density, self.rotor_radius, self.inflow_speed)
        unit = self.inflow_speed / self.rotor_radius
        power = self._electrical(scale[:, None] * curve(ratios), ratios * unit[:, None])
        peak = np.argmax(power, axis=1)

        def rise(ratio):
            _, by_torque, by_speed = self._power(scale * curve(ratio), ratio * unit)
            slope = by_torque * scale * curve(ratio, 1) + by_speed * unit
            return slope, np.zeros(ratio.shape)  # bisected: no slope of the slope

        ends = np.maximum(peak - 1, 0), np.minimum(peak + 1, ratios.size - 1)
        return _root(rise, *(ratios[end] for end in ends))

    def _balance(self, table, controller, controller_slope):
        """Find the largest tip speed ratio in balance at each instant: the unstalled root."""
        friction, rubbing = self.shaft.friction, self.shaft.shaft_friction_slope
        curve = self.spline.curve(table)
        ratios = np.linspace(curve.x[0], curve.x[-1], N_SEARCH)
        scale = torque_scale(self.density, self.rotor_radius, self.inflow_speed)
        unit = self.inflow_speed / self.rotor_radius
        speeds = ratios * unit[:, None]
        driving = scale[:, None] * curve(ratios) >= controller(speeds) + friction(speeds)
        last = ratios.size - 1 - np.argmax(driving[:, ::-1], axis=1)
        has_root = driving.any(axis=1) & (last < ratios.size - 1)
        last = np.minimum(last, ratios.size - 2)

        def net(ratio):
            return (
                scale * curve(ratio) - controller(ratio * unit) - friction(ratio * unit),
                scale * curve(ratio, 1) - (controller_slope(ratio * unit) + rubbing) * unit,
            )

        return _root(net, ratios[last], ratios[last + 1]), bool(np.all(has_root))


def _root(function, low, high):
    """Return where functions[n] fall through zero between low[n] and high[n].

    Newton's method with values and slopes, bisection where it would leave the bracket.
    """
    x = 0.5 * (low + high)
    for _ in range(60):
        value, slope = function(x)
        low, high = np.where(value >= 0.0, x, low), np.where(value >= 0.0, high, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = x - value / slope
        new = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        if np.all(np.abs(new - x) <= 1e-14 * x):
            return new
        x = new
    return x
