"""The search without limits but the torque's: blade and gains by quasi-steady operation.

Open loop's schedule then follows from the blade (`hkt_mdo.start.quasi_steady`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.point import KEPT_EXCESS, Operation, StartingPoint
from hkt_mdo.problem.setup import TWIST_UNIT
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.stall import SLOWER
from hkt_mdo.start.improve import Round, Search, Settings, Values
from hkt_mdo.start.quasi_steady import SAFE, QuasiSteady

# share of the energy by which a point without equilibrium is worse, so that SLSQP avoids it
STANDSTILL = 0.5
TOUCHING = -1e-6  # of `TWIST_UNIT`: distance below stall that counts as zero


def operating_point(
    blade: Blade, gains: np.ndarray, operation: Operation, strategy: str = ""
) -> StartingPoint:
    """Return the starting point of a blade (and gains) in quasi-steady operation without limits."""
    about = operation.delivered, _short_of_recovery(operation)
    point = StartingPoint(blade, gains, operation, *about, strategy=strategy)
    if not operation.running:
        return replace(point, excess=np.inf, exceeds=("rotor_keeps_turning",))
    return point if point.worth[0] else replace(point, exceeds=("distance_from_stall",))


def _short_of_recovery(operation):
    """Return by how much the margin of an operation is below `SAFE`; -inf without any."""
    return SAFE - float(np.min(operation.margin, initial=np.inf))


class EnergySearch(Search):
    """Largest delivered energy of blade and gains that recover from a small loss of speed.

    Parameters
    ----------
    physics : Physics
    problem : QuasiSteady
        Its flow; the law is that of the physics.
    """

    # the constraints are few and cheap, so that SLSQP may go on to the end of each round
    settings = Settings(rounds=12, iterations=100, tolerance=1e-9)

    def __init__(self, physics: Physics, problem: QuasiSteady):
        super().__init__(physics)
        self.problem = problem

    @staticmethod
    def rank(point: StartingPoint) -> tuple:
        """Return the rank of a point: whether it runs, whether it recovers, then its energy."""
        recovers = _short_of_recovery(point.operation) <= KEPT_EXCESS
        return point.operation.running, recovers, point.objective

    def around(self, point: StartingPoint, settings: Settings) -> Round:
        """Return the optimization around a point, which keeps its sections away from stall."""
        center, units = self.vector(point)
        room = self._room(point) if center.size else None

        def values(x):
            better, slopes = self._evaluated(x)
            state, (below, below_by) = better.operation, room(x)
            return Values(
                state.delivered - (0.0 if state.running else STANDSTILL * state.energy),
                slopes[0],
                np.empty(0),
                np.empty((0, x.size)),
                np.concatenate((state.margin - SAFE, below)),
                np.vstack((slopes[1:], below_by)),
            )

        def rank(x, point):
            return bool(np.all(room(x)[0] > TOUCHING)), *self.rank(point)

        return Round(center, units, *self.bounds(point, settings.moves), values, rank)

    def point(self, unknowns: np.ndarray, _: Values, origin: StartingPoint) -> StartingPoint:
        """Return the point of some unknowns, (n,)."""
        return replace(self._evaluated(unknowns)[0], strategy=origin.strategy)

    def _evaluated(self, x):
        """Return the point at x; derivatives of `delivered` and margins, row by row."""
        blade, gains = self.blade(x), self.gains(x)
        problem = replace(self.problem, rotor_radius=blade.rotor_radius)
        rotor = self.physics.rotor.coefficients(blade, problem.spline.nodes, derivatives=True)
        state = problem.operate(rotor.torque, gains)
        by_table, by_gain, by_radius = np.split(state.gradient(), [rotor.torque.size, -1], axis=1)
        by_radius = by_radius[:, 0] + by_table @ rotor.torque_by_rotor_radius
        by_shape = rotor.torque_by_chord, rotor.torque_by_twist, rotor.torque_by_thickness
        slopes = self.slopes(*(by_table @ by for by in by_shape), by_radius)
        return operating_point(blade, gains, state), np.hstack((slopes, by_gain))

    def _room(self, point):
        """Return the function of x with the room below a point's `StallFence`, and its slopes."""
        shape, rotor, ends = self.shape, self.physics.rotor, self.ends
        ratio = point.operation.rotor_speed / self.problem.inflow_speed * point.blade.rotor_radius
        ratio = float(np.min(ratio))
        fence = rotor.stall_fence(shape, point.blade, ratio)
        places = fence.stations

        def at(x):
            slopes = np.zeros((places.size, x.size))
            if not places.size:
                return np.empty(0), slopes
            blade = self.blade(x)
            flow = rotor.angles_of_attack(blade, SLOWER * ratio)
            angle, _, by_chord, by_twist = (values[places] for values in flow)
            slopes[:, : ends[0]] = -by_chord[:, None] * shape.chord_basis[places]
            slopes[:, ends[0] : ends[1]] = -by_twist[:, None] * shape.twist_basis[places]
            if self.resized:  # only the chord over the radius matters
                by_radius = by_chord * blade.chord[places] / blade.rotor_radius
                slopes[:, ends[2] : ends[3]] = by_radius[:, None]
            return (fence.highest - angle) / TWIST_UNIT, slopes / TWIST_UNIT

        return at
