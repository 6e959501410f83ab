"""The design variables of a blade: values at its stations, or control points of splines."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline

from hkt_mdo.rotor.blade import Blade

DEGREE = 3  # of the splines, where there are enough control points
# More than FREE_STATIONS stations, or stations of several sections, are designed by a spline of
# POINTS control points. Designed directly, the innermost and outermost of many stations jump to the
# high induction of Buhl's branch and back, stations of a cylindrical root go to their bounds, and
# optimizers converge poorly (docs/studies/stations.md).
FREE_STATIONS, POINTS = 20, 8


def spline_basis(points, position, low, high):
    """Return the matrix (n, points) from control points of a clamped B-spline to its values.

    Knots are equally spaced from `low` to `high`, and position[n] lies between; the degree is
    three, or one less than the number of control points if that is fewer than four. Rows are not
    negative and sum to one, so the curve stays within the range of its control points.

    Parameters
    ----------
    points : int
        Number of control points.
    position : array_like of shape (n,)
        Where the curve is evaluated.
    low : float
        Where the curve begins.
    high : float
        Where it ends.

    Returns
    -------
    ndarray of shape (n, points)
        Rows that sum to one.
    """
    degree = min(DEGREE, points - 1)
    inner = np.linspace(low, high, points - degree + 1)
    knots = np.concatenate((np.full(degree, low), inner, np.full(degree, high)))
    return BSpline.design_matrix(np.asarray(position, dtype=float), knots, degree).toarray()


@dataclass(frozen=True, eq=False)
class Shape:
    """The family of blades that a design chooses from.

    chord (m), twist (rad) and thickness over the chord at the stations are

        offset + basis @ control,

    the chord times the rotor's radius over that of the given blade if it is not designed (the whole
    blade is then scaled). The thickness is only designed along with chord and twist.

    Attributes
    ----------
    blade : Blade
        As given, or the nearest one to it where chord and twist are splines.
    offsets : dict of str to ndarray
        By the names chord, twist and, where it is designed, thickness; (n_stations,) each.
    bases : dict of str to ndarray
        Of what is designed, (n_stations, n_control) each.
    bounds : dict of str to tuple of float
        Of what is designed: smallest and largest value of the control points, and so of the blade.
    radius_bounds : tuple of float, optional
        Smallest and largest radius of the disc (m); None: it is not designed.
    """

    blade: Blade
    offsets: dict[str, np.ndarray]
    bases: dict[str, np.ndarray]
    bounds: dict[str, tuple[float, float]]
    radius_bounds: tuple[float, float] | None = None

    @classmethod
    def designed(cls, blade, points, bounds, radius_bounds=None, several_sections=False):
        """Design chord and twist by numbers of control points, or directly at the stations.

        None: at the stations if there are `FREE_STATIONS` or fewer with one section, else by
        `POINTS` control points.

        Parameters
        ----------
        blade : Blade
            The blade as given.
        points : dict of str to (int or None)
            Numbers of control points of chord, twist and, if it is designed, thickness; if not
            fewer than the stations, they are the stations.
        bounds : dict of str to tuple of float
            Smallest and largest chord (m), twist (rad) and thickness over chord.
        radius_bounds : tuple of float, optional
            Smallest and largest radius of the disc (m); None: it is not designed.
        several_sections : bool
            Whether stations have sections of their own.

        Returns
        -------
        Shape
            The family of blades.
        """
        n, bases = blade.r.size, {}
        usual = n if n <= FREE_STATIONS and not several_sections else POINTS
        for name, number in points.items():
            count, ends = usual if number is None else number, (blade.hub_radius, blade.tip_radius)
            bases[name] = np.eye(n) if count >= n else spline_basis(count, blade.r, *ends)
        family = cls(blade, dict.fromkeys(bases, np.zeros(n)), bases, bounds, radius_bounds)
        if min(family.points.values()) >= n:
            return family  # with exactly the blade as given
        control = family.control(blade)
        if "thickness" in control:
            control["thickness"] = np.clip(control["thickness"], *bounds["thickness"])
        return replace(family, blade=family.at(control))

    @classmethod
    def fixed(cls, blade, set_angle=0.0, set_angle_bounds=None, radius_bounds=None):
        """Keep chord and twist, but for the set angle (rad) if that has bounds.

        Parameters
        ----------
        blade : Blade
            The blade as given.
        set_angle : float
            That of the blade as given (rad).
        set_angle_bounds : tuple of float, optional
            In rad; None: it is not designed.
        radius_bounds : tuple of float, optional
            Smallest and largest radius of the disc (m); None: it is not designed.

        Returns
        -------
        Shape
            The family of blades.
        """
        offsets, bases, bounds = {"chord": blade.chord, "twist": blade.twist}, {}, {}
        if set_angle_bounds:
            offsets["twist"] = blade.twist - set_angle
            bases, bounds = {"twist": np.ones((blade.r.size, 1))}, {"twist": set_angle_bounds}
        return cls(blade, offsets, bases, bounds, radius_bounds)

    @property
    def radii(self):
        """Smallest and largest radius of the disc; equal where it is not designed.

        Returns
        -------
        tuple of float
            In m.
        """
        return self.radius_bounds or 2 * (self.blade.rotor_radius,)

    @property
    def designs_chord(self):
        """Whether the chord is designed.

        Returns
        -------
        bool
            True if the chord has control points.
        """
        return "chord" in self.bases

    @property
    def points(self):
        """Number of control points, or of designed stations, of what is designed.

        Returns
        -------
        dict of str to int
            Numbers by the names of `bases`.
        """
        return {name: basis.shape[1] for name, basis in self.bases.items()}

    @property
    def designs_set_angle(self):
        """Whether the set angle of a fixed blade is designed.

        Returns
        -------
        bool
            True if it is the only control point.
        """
        return self.bases.keys() == {"twist"}

    def control(self, blade):
        """Return the control points of the nearest blade, by least squares.

        Parameters
        ----------
        blade : Blade
            The blade to come near to.

        Returns
        -------
        dict of str to ndarray
            In m, rad and over the chord, by the names of `bases`.
        """
        points = {}
        for name, basis in self.bases.items():
            points[name] = getattr(blade, name) - self.offsets[name]
            if basis.shape[0] != basis.shape[1]:  # else they are the stations themselves
                points[name] = np.linalg.lstsq(basis, points[name], rcond=None)[0]
        return points

    def stations(self, control, rotor_radius):
        """Return chord (m), twist (rad) and, if it is designed, thickness at the stations.

        Parameters
        ----------
        control : dict of str to array_like
            Control points by the names of `bases`.
        rotor_radius : float
            Radius of the swept disc (m).

        Returns
        -------
        dict of str to ndarray
            In m, rad and over the chord, by the names of `offsets`.
        """
        moves = {name: basis @ control[name] for name, basis in self.bases.items()}
        values = {name: offset + moves.get(name, 0.0) for name, offset in self.offsets.items()}
        if not self.designs_chord:
            values["chord"] = values["chord"] * (rotor_radius / self.blade.rotor_radius)
        return values

    def at(self, control, rotor_radius=None):
        """Return the blade of control points (m, rad, over chord) and a radius of the disc (m).

        Parameters
        ----------
        control : dict of str to array_like
            Control points by the names of `bases`.
        rotor_radius : float, optional
            Radius of the swept disc (m); by default that of the given blade.

        Returns
        -------
        Blade
            The blade of this design.
        """
        radius = self.blade.rotor_radius if rotor_radius is None else rotor_radius
        return self.blade.with_rotor_radius(radius).with_shape(**self.stations(control, radius))

    def within(self, blade):
        """Return the control points nearest to a blade, each within its bounds.

        Parameters
        ----------
        blade : Blade
            The blade to come near to.

        Returns
        -------
        dict of str to ndarray
            In m, rad and over the chord, by the names of `bases`.
        """
        control = self.control(blade).items()
        return {name: np.clip(values, *self.bounds[name]) for name, values in control}

    def nearest(self, blade):
        """Return the blade of this family, within its bounds, that is nearest to a given one.

        Parameters
        ----------
        blade : Blade
            The blade to come near to.

        Returns
        -------
        Blade
            The nearest blade.
        """
        nearest = self.at(self.within(blade), blade.rotor_radius)
        return replace(nearest, hub_inertia=blade.hub_inertia)
