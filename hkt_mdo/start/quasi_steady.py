"""Quasi-steady operation of a rotor: in equilibrium with the flow and its controller at all times.

The rotor's time constant is a few hundredths of a second and the flow changes over many seconds, so
the rotor follows Q = u + F on the unstalled side, F the friction of the shaft. No differential
equation is solved, so there are no false solutions; the energy is within about 1e-5 of the dynamic
one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hkt_mdo.dynamics.generator import LOSSLESS, Generator
from hkt_mdo.dynamics.laws import Law
from hkt_mdo.dynamics.limits import SLOWED
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import Operation
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.rotor.torque_curve import TorqueSpline, last_fall

SPAN, CURVE_NODES = (0.3, 2.6), 481  # of the curve, over the optimum's tip speed ratio; nodes
N_SEARCH = 240  # points of the search for the unstalled root over the torque curve


def sampled_flow(physics: Physics) -> tuple[np.ndarray, np.ndarray]:
    """Return the speeds (m/s) of all scenarios' flows, and their weights (s), both (n_times,)."""
    scenarios = physics.scenarios
    speed = np.concatenate([each.inflow.speed_at(each.samples) for each in scenarios])
    return speed, np.concatenate([each.weight * each.sample_weights for each in scenarios])


def ratio_spline(optimum: SteadyOptimum) -> TorqueSpline:
    """Return the spline over `SPAN` of the tip speed ratio of a steady optimum."""
    return TorqueSpline(np.linspace(*SPAN, CURVE_NODES) * optimum.tip_speed_ratio)


@dataclass(frozen=True, eq=False)
class QuasiSteady:
    """Quasi-steady operation of a rotor in a flow under a control law.

    Attributes
    ----------
    inflow_speed, weights : np.ndarray
        The flow at quadrature points of time, m/s, and their weights, s, shape (n_times,).
    density, rotor_radius : float
        Of the water, kg/m**3, and of the swept disc, m.
    spline : TorqueSpline
        Over the tip speed ratio.
    table : np.ndarray
        Torque coefficients at the nodes of the spline, shape (n_nodes,).
    law : Law
        Of the torque.
    shaft : Generator
        Whose shaft has the friction.
    """

    inflow_speed: np.ndarray
    weights: np.ndarray
    density: float
    rotor_radius: float
    spline: TorqueSpline
    table: np.ndarray
    law: Law
    shaft: Generator = LOSSLESS

    @classmethod
    def of(cls, physics: Physics, blade: Blade, spline: TorqueSpline, table) -> QuasiSteady:
        """Return the operation of a blade, with its table of a spline, over all flows of a case."""
        about = physics.density, blade.rotor_radius, spline, table, physics.law
        return cls(*sampled_flow(physics), *about, physics.case.generator)

    @property
    def scale(self) -> np.ndarray:
        """Torque over its coefficient, N m, shape (n_times,)."""
        return torque_scale(self.density, self.rotor_radius, self.inflow_speed)

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
        curve, unit = self.spline.curve(self.table), self.inflow_speed / self.rotor_radius
        ratios, scale = np.linspace(*self.spline.nodes[[0, -1]], N_SEARCH), self.scale

        def net(ratio, unit, scale):
            return scale * curve(ratio) - self._braking(ratio * unit, gains)

        driving = net(ratios, unit[:, None], scale[:, None]) >= 0.0
        ratio, falls = last_fall(net, ratios, driving, unit, scale)
        return replace(self.held(ratio * unit), running=bool(np.all(falls)))

    def _braking(self, speed, gains):
        """Return the torque of a law and of the friction, N m."""
        return self.law.torque(speed, gains) + self.shaft.friction(speed)

    def recovers(self, gains, operation: Operation) -> bool:
        """Tell whether a rotor in operation under a law recovers from a small loss of speed."""
        speed = (1.0 - SLOWED) * operation.rotor_speed
        return bool(np.all(self.held(speed).hydrodynamic_torque > self._braking(speed, gains)))

    def held(self, speed, states=()) -> Operation:
        """Return the operation of a rotor that a controller holds at speeds, rad/s, (n_times,).

        `states` are those of the law, (n_times,) each.
        """
        ratio = speed * self.rotor_radius / self.inflow_speed
        torque = self.scale * self.spline.curve(self.table)(ratio)
        energy = float(self.weights @ (torque * speed))
        return Operation(energy, speed, torque, bool(np.all(torque > 0.0)), tuple(states))

    def generator_torque(self, speed) -> np.ndarray:
        """Return the generator's torque, N m, that holds the rotor at speeds, rad/s, (n_times,)."""
        return self.held(speed).hydrodynamic_torque - self.shaft.friction(speed)

    def torque_slope(self, speed) -> np.ndarray:
        """Return the slope of the flow's torque by the rotor's speed, N m s/rad, (n_times,)."""
        unit = self.rotor_radius / self.inflow_speed
        return self.spline.values(self.table, speed * unit)[1] * self.scale * unit
