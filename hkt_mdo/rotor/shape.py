"""The designed part of a blade: chord and twist at the stations, or splines of few points."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline

from hkt_mdo.rotor.blade import Blade

DEGREE = 3  # of the splines, where there are enough control points
# More than FREE_STATIONS stations, or stations of several sections, are designed by a spline of
# POINTS control points. Designed directly, the innermost and outermost of many stations jump to the
# high induction of Buhl's branch and back, stations of a cylindrical root go to their bounds, and
# optimizers converge poorly (docs/stations.md).
FREE_STATIONS, POINTS = 20, 8


def spline_basis(points, position, low, high):
    """Return the matrix (n, points) from control points of a clamped B-spline to its values.

    Knots are equally spaced from `low` to `high`, and position[n] lies between; the degree is
    three, or one less than the number of control points if that is fewer than four. Rows are not
    negative and sum to one, so the curve stays within the range of its control points.
    """
    degree = min(DEGREE, points - 1)
    inner = np.linspace(low, high, points - degree + 1)
    knots = np.concatenate((np.full(degree, low), inner, np.full(degree, high)))
    return BSpline.design_matrix(np.asarray(position, dtype=float), knots, degree).toarray()


@dataclass(frozen=True, eq=False)
class Shape:
    """The family of blades that a design chooses from.

        chord = stretch (chord_offset + chord_basis @ chord_control),
        twist = twist_offset + twist_basis @ twist_control,

    where stretch is the rotor's radius over that of the given blade if the chord is not designed
    (the whole blade is then scaled), and one if it is.

    The blade is as given, or the nearest one to it where chord and twist are splines. Bases have
    the shape (n_stations, n_control), without columns where nothing is designed. Bounds (m, rad)
    are those of the control points, and so of the blade; radius_bounds (m) those of the disc's
    radius, None if it is not designed.
    """

    blade: Blade
    chord_offset: np.ndarray
    chord_basis: np.ndarray
    twist_offset: np.ndarray
    twist_basis: np.ndarray
    chord_bounds: tuple[float, float]
    twist_bounds: tuple[float, float]
    radius_bounds: tuple[float, float] | None = None

    @classmethod
    def designed(
        cls,
        blade,
        chord_points,
        twist_points,
        chord_bounds,
        twist_bounds,
        radius_bounds=None,
        *,
        several_sections=False,
    ):
        """Design chord and twist by numbers of control points, or directly at the stations.

        They are designed at the stations if there are no fewer control points than stations. None:
        at the stations if there are `FREE_STATIONS` or fewer with one section, else by `POINTS`
        control points.
        """
        n = blade.r.size
        usual = n if n <= FREE_STATIONS and not several_sections else POINTS
        points = [usual if each is None else each for each in (chord_points, twist_points)]
        ends = blade.hub_radius, blade.tip_radius
        chord, twist = (
            np.eye(n) if each >= n else spline_basis(each, blade.r, *ends) for each in points
        )
        bounds = chord_bounds, twist_bounds, radius_bounds
        family = cls(blade, np.zeros(n), chord, np.zeros(n), twist, *bounds)
        if min(points) >= n:
            return family  # with exactly the blade as given
        return replace(family, blade=family.at(*family.control(blade)))

    @classmethod
    def fixed(cls, blade, set_angle=0.0, set_angle_bounds=None, radius_bounds=None):
        """Keep chord and twist, but for the set angle (rad) if that has bounds."""
        n = blade.r.size
        turned = np.ones((n, 1)) if set_angle_bounds else np.empty((n, 0))
        twist = blade.twist - set_angle if set_angle_bounds else blade.twist
        bounds = (0.0, np.inf), set_angle_bounds or (-np.inf, np.inf), radius_bounds
        return cls(blade, blade.chord, np.empty((n, 0)), twist, turned, *bounds)

    @property
    def designs_chord(self):
        """Whether the chord is designed."""
        return self.chord_basis.shape[1] > 0

    @property
    def points(self):
        """Number of control points, or of stations designed, of chord and twist, by name."""
        return {"chord": self.chord_basis.shape[1], "twist": self.twist_basis.shape[1]}

    @property
    def designs_set_angle(self):
        """Whether the set angle of a fixed blade is designed."""
        return not self.designs_chord and self.points["twist"] > 0

    def stretch(self, rotor_radius):
        """Return the factor on chords that are not designed."""
        return 1.0 if self.designs_chord else rotor_radius / self.blade.rotor_radius

    def control(self, blade):
        """Return the control points (m, rad) whose blade is nearest to one, by least squares."""
        found = []
        for basis, rest in (
            (self.chord_basis, blade.chord - self.chord_offset),
            (self.twist_basis, blade.twist - self.twist_offset),
        ):
            direct = basis.shape[0] == basis.shape[1]  # the stations themselves
            found.append(rest if direct else np.linalg.lstsq(basis, rest, rcond=None)[0])
        return tuple(found)

    def chord_and_twist(self, chord_control, twist_control):
        """Return chord (m) and twist (rad) at the stations, at the radius of the given blade."""
        chord = self.chord_offset + self.chord_basis @ chord_control
        return chord, self.twist_offset + self.twist_basis @ twist_control

    def at(self, chord_control, twist_control, rotor_radius=None):
        """Return the blade of control points (m, rad) and a radius of the disc (m)."""
        radius = self.blade.rotor_radius if rotor_radius is None else rotor_radius
        chord, twist = self.chord_and_twist(chord_control, twist_control)
        return self.blade.with_rotor_radius(radius).with_shape(chord * self.stretch(radius), twist)

    def nearest(self, blade):
        """Return the blade of this family, within its bounds, nearest to one, of its radius."""
        chord, twist = self.control(blade)
        chord, twist = np.clip(chord, *self.chord_bounds), np.clip(twist, *self.twist_bounds)
        return self.at(chord, twist, blade.rotor_radius)
