"""The design variables of a blade: values at its stations, or control points of splines."""

from dataclasses import dataclass, field, replace

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

        chord = stretch (chord_offset + chord_basis @ chord_control),
        twist = twist_offset + twist_basis @ twist_control,
        thickness over chord = thickness_basis @ thickness_control,

    where stretch is the rotor's radius over that of the given blade if the chord is not designed
    (the whole blade is then scaled), and one if it is.

    The blade is as given, or the nearest one to it where these are splines; its thickness is None
    where it is not designed. Bases have
    the shape (n_stations, n_control), without columns where nothing is designed. Bounds (m, rad)
    are those of the control points, and so of the blade; radius_bounds (m) those of the disc's
    radius, None if it is not designed. Thickness is only designed along with chord and twist.
    """

    blade: Blade
    chord_offset: np.ndarray
    chord_basis: np.ndarray
    twist_offset: np.ndarray
    twist_basis: np.ndarray
    chord_bounds: tuple[float, float]
    twist_bounds: tuple[float, float]
    radius_bounds: tuple[float, float] | None = None
    thickness_basis: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    thickness_bounds: tuple[float, float] = (0.0, 1.0)

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
        thickness_points=None,
        thickness_bounds=(0.0, 1.0),
    ):
        """Design chord and twist by numbers of control points, or directly at the stations.

        None: at the stations if there are `FREE_STATIONS` or fewer with one section, else by
        `POINTS` control points; of the thickness: it is not designed.

        Parameters
        ----------
        blade : Blade
            The blade as given.
        chord_points, twist_points : int or None
            Numbers of control points; if not fewer than the stations, they are the stations.
        chord_bounds, twist_bounds : tuple of float
            Smallest and largest chord (m) and twist (rad).
        radius_bounds : tuple of float, optional
            Smallest and largest radius of the disc (m); None: it is not designed.
        several_sections : bool
            Whether stations have sections of their own.
        thickness_points : int or None
            Number of control points, as of the chord.
        thickness_bounds : tuple of float
            Smallest and largest thickness over chord.

        Returns
        -------
        Shape
            The family of blades.
        """
        n = blade.r.size
        usual = n if n <= FREE_STATIONS and not several_sections else POINTS
        points = [usual if count is None else count for count in (chord_points, twist_points)]
        points += [thickness_points] if thickness_points else []
        ends = blade.hub_radius, blade.tip_radius
        chord, twist, *thickness = (
            np.eye(n) if count >= n else spline_basis(count, blade.r, *ends) for count in points
        )
        bounds = chord_bounds, twist_bounds, radius_bounds
        family = cls(
            blade,
            *(np.zeros(n), chord),
            *(np.zeros(n), twist),
            *bounds,
            thickness[0] if thickness else np.empty((n, 0)),
            thickness_bounds,
        )
        if min(points) >= n:
            return family  # with exactly the blade as given
        chord, twist, thickness = family.control(blade)
        thickness = np.clip(thickness, *thickness_bounds)
        return replace(family, blade=family.at(chord, twist, thickness))

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
        n = blade.r.size
        turned = np.ones((n, 1)) if set_angle_bounds else np.empty((n, 0))
        twist = blade.twist - set_angle if set_angle_bounds else blade.twist
        bounds = (0.0, np.inf), set_angle_bounds or (-np.inf, np.inf), radius_bounds
        return cls(blade, blade.chord, np.empty((n, 0)), twist, turned, *bounds)

    @property
    def designs_chord(self):
        """Whether the chord is designed.

        Returns
        -------
        bool
            True if the chord has control points.
        """
        return self.chord_basis.shape[1] > 0

    @property
    def bases(self):
        """The spline bases by the name of the design variable; that of the thickness may be empty.

        Returns
        -------
        dict of str to ndarray
            Of shape (n_stations, n_control) each.
        """
        names = "chord", "twist", "thickness"
        return {name: getattr(self, f"{name}_basis") for name in names}

    @property
    def points(self):
        """Number of control points, or of designed stations, by the name of the design variable.

        Returns
        -------
        dict of str to int
            Numbers by the names of `bases`.
        """
        return {name: basis.shape[1] for name, basis in self.bases.items()}

    @property
    def designs_thickness(self):
        """Whether the thickness is designed.

        Returns
        -------
        bool
            True if the thickness has control points.
        """
        return self.points["thickness"] > 0

    @property
    def designs_set_angle(self):
        """Whether the set angle of a fixed blade is designed.

        Returns
        -------
        bool
            True if it is the only control point.
        """
        return not self.designs_chord and self.points["twist"] > 0

    def stretch(self, rotor_radius):
        """Return the factor on chords that are not designed.

        Parameters
        ----------
        rotor_radius : float
            Radius of the swept disc (m).

        Returns
        -------
        float
            The factor; 1 where the chord is designed.
        """
        return 1.0 if self.designs_chord else rotor_radius / self.blade.rotor_radius

    def control(self, blade):
        """Return the control points of chord (m), twist (rad) and thickness of the nearest blade.

        By least squares; empty for what is not designed.

        Parameters
        ----------
        blade : Blade
            The blade to come near to.

        Returns
        -------
        chord_control, twist_control, thickness_control : ndarray
            In m, rad and over the chord; empty where nothing is designed.
        """
        chord, twist = blade.chord - self.chord_offset, blade.twist - self.twist_offset
        points = []
        for basis, rest in zip(self.bases.values(), (chord, twist, blade.thickness), strict=True):
            if not basis.size:
                points.append(np.empty(0))
            elif basis.shape[0] == basis.shape[1]:  # the stations themselves
                points.append(rest)
            else:
                points.append(np.linalg.lstsq(basis, rest, rcond=None)[0])
        return tuple(points)

    def stations(self, chord_control, twist_control, thickness_control=()):
        """Return chord (m), twist (rad) and, if it is designed, thickness at the stations.

        At the radius of the given blade.

        Parameters
        ----------
        chord_control : array_like of shape (n_chord,)
            Control points of the chord (m).
        twist_control : array_like of shape (n_twist,)
            Control points of the twist (rad).
        thickness_control : array_like of shape (n_thickness,)
            Control points of the thickness over chord.

        Returns
        -------
        chord, twist, thickness : ndarray of shape (n_stations,)
            In m, rad and over the chord; the last one only if it is designed.
        """
        chord = self.chord_offset + self.chord_basis @ chord_control
        twist = self.twist_offset + self.twist_basis @ twist_control
        if not self.designs_thickness:
            return chord, twist
        return chord, twist, self.thickness_basis @ thickness_control

    def at(self, chord_control, twist_control, thickness_control=(), rotor_radius=None):
        """Return the blade of control points (m, rad, over chord) and a radius of the disc (m).

        Parameters
        ----------
        chord_control : array_like of shape (n_chord,)
            Control points of the chord (m).
        twist_control : array_like of shape (n_twist,)
            Control points of the twist (rad).
        thickness_control : array_like of shape (n_thickness,)
            Control points of the thickness over chord.
        rotor_radius : float, optional
            Radius of the swept disc (m); by default that of the given blade.

        Returns
        -------
        Blade
            The blade of this design.
        """
        radius = self.blade.rotor_radius if rotor_radius is None else rotor_radius
        chord, *others = self.stations(chord_control, twist_control, thickness_control)
        blade = self.blade.with_rotor_radius(radius)
        return blade.with_shape(chord * self.stretch(radius), *others)

    def within(self, blade):
        """Return the control points nearest to a blade, each within its bounds.

        Parameters
        ----------
        blade : Blade
            The blade to come near to.

        Returns
        -------
        chord_control, twist_control, thickness_control : ndarray
            In m, rad and over the chord; empty where nothing is designed.
        """
        bounds = self.chord_bounds, self.twist_bounds, self.thickness_bounds
        control = zip(self.control(blade), bounds, strict=True)
        return tuple(np.clip(values, *ends) for values, ends in control)

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
        return self.at(*self.within(blade), blade.rotor_radius)
