"""The unknowns of the search for a start as one vector: shape, disc radius and gains."""

from __future__ import annotations

import numpy as np

from hkt_mdo.problem.physics import Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.problem.setup import THICKNESS_UNIT, TWIST_UNIT, MoveLimits, gain_bounds
from hkt_mdo.rotor.blade import Blade

MOVES = MoveLimits(
    chord=1.3, twist=np.deg2rad(3.0), thickness=0.02, radius=1.1, gain=1.2
)  # of one SLSQP, about as far as a linearization of the torque holds
_PARTS = "chord_control", "twist_control", "thickness_control", "rotor_radius", "gain"


class Unknowns:
    """Control points of chord, twist and thickness, then the disc's radius, then the gains.

    What is not designed has no place in the vector x.

    Parameters
    ----------
    physics : Physics
        Whose shape and control law are designed.
    """

    def __init__(self, physics: Physics):
        self.physics, self.shape, self.law = physics, physics.shape, physics.law
        self.resized = self.shape.radius_bounds is not None
        sizes = [*self.shape.points.values(), self.resized, len(physics.gain_units)]
        self.ends = np.cumsum(sizes[:-1])
        shape, radius_bounds = self.shape, self.shape.radius_bounds or (0.0, 0.0)
        own = shape.chord_bounds, shape.twist_bounds, shape.thickness_bounds, radius_bounds
        self._own = np.repeat((*own, gain_bounds(physics)), sizes, axis=0).T
        self._typical = np.repeat([0.0, TWIST_UNIT, THICKNESS_UNIT, 0.0, 0.0], sizes)

    def vector(self, point: StartingPoint) -> tuple[np.ndarray, np.ndarray]:
        """Return the unknowns of a point within their bounds, and their units, both (n,)."""
        radius = [point.blade.rotor_radius] * self.resized
        x = np.concatenate((*self.shape.control(point.blade), radius, point.gains))
        x = np.clip(x, *self._own)
        units = np.where(self._typical > 0.0, self._typical, np.abs(x))
        if self.law is not None:
            units[self.ends[-1] :] = self.law.sizes(self.gains(x))
        return x, units

    def bounds(self, point: StartingPoint) -> np.ndarray:
        """Return the lower and upper limits of moves from a point, shape (2, n)."""
        bounds = MOVES.bounds(self.physics, point)
        return np.array([np.concatenate([bounds[name][i] for name in _PARTS]) for i in (0, 1)])

    def blade(self, x: np.ndarray) -> Blade:
        """Return the blade of some unknowns."""
        *control, radius, _ = np.split(x, self.ends)
        return self.shape.at(*control, radius[0] if self.resized else None)

    def gains(self, x: np.ndarray) -> np.ndarray:
        """Return the gains among the unknowns."""
        return x[self.ends[-1] :]

    def slopes(self, by_chord, by_twist, by_thickness, by_radius) -> np.ndarray:
        """Return derivatives by the unknowns but the gains, from those by the stations' shape.

        Parameters
        ----------
        by_chord, by_twist, by_thickness : np.ndarray
            By the values at the stations, shape (m, n_stations).
        by_radius : np.ndarray
            By the radius of the disc, shape (m,).

        Returns
        -------
        np.ndarray
            Shape (m, n - n_gains).
        """
        shape = self.shape
        if not shape.designs_chord:  # the chord is scaled with the disc
            by_radius = by_radius + by_chord @ shape.chord_offset / shape.blade.rotor_radius
        parts = [by_chord @ shape.chord_basis, by_twist @ shape.twist_basis]
        if shape.designs_thickness:
            parts.append(by_thickness @ shape.thickness_basis)
        return np.hstack((*parts, by_radius[:, None][:, : self.resized]))
