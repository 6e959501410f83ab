"""Quasi-steady operation of a rotor: in equilibrium with the flow and its controller at all times.

The rotor's time constant is a few hundredths of a second and the flow changes over many seconds, so
the rotor follows Q = u + F on the unstalled side, F the friction of the shaft. No differential
equation is solved, so there are no false solutions; the energy is within about 1e-5 of the dynamic
one.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.laws import Law
from hkt_mdo.dynamics.limits import SLOWED
from hkt_mdo.dynamics.simulation import FeedbackTorque, Plant, by_curve
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import Operation
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.polars import Polars
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.rotor.torque_curve import TorqueSpline

SPAN, CURVE_NODES = (0.3, 2.6), 481  # of the curve, over the optimum's tip speed ratio; nodes


def ratio_spline(optimum: SteadyOptimum) -> TorqueSpline:
    """Return the spline over `SPAN` of the tip speed ratio of a steady optimum."""
    return TorqueSpline(np.linspace(*SPAN, CURVE_NODES) * optimum.tip_speed_ratio)


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
