"""The blade section: lift and drag over all angles of attack; its outline, area and stiffness."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.errors import InputError
from hkt_mdo.files.outline import read_outline
from hkt_mdo.files.polar import read_polars
from hkt_mdo.files.polar_table import LARGEST

# One knot every quarter of a degree: every polar on a 0.25 or 0.5 degree grid is interpolated
# exactly at its own points, and a lookup is one multiplication instead of a search.
KNOTS_PER_DEGREE = 4


@dataclass(frozen=True, eq=False)
class Polar:
    """Lift and drag coefficient of a section over the full circle, a C² function.

    The table is interpolated by a periodic cubic spline on equally spaced knots. It has the two
    methods that CCBlade asks of an airfoil (`evaluate`, `derivatives`), so that both BEM solvers
    see the very same function; the Reynolds number is accepted and ignored (Reynolds invariance,
    paper Sec. II-A).

    Parameters
    ----------
    coefficients : ndarray, shape (n_knots, 8)
        Polynomial coefficients of an interval, ascending in the local coordinate (rad): four of
        lift, then four of drag. Interval i begins at angle of attack -pi + i * 2 pi / n_knots.
    alpha_min, alpha_max : float, rad
        Range of the measured or computed table; beyond it the polar is the Viterna extension.
    """

    coefficients: np.ndarray
    alpha_min: float
    alpha_max: float

    @classmethod
    def from_table(cls, alpha, lift, drag, aspect_ratio=10.0):
        """Make a polar from a table of attached and early stalled flow, extended by Viterna.

        Parameters
        ----------
        alpha : array, shape (n,), rad
            Angle of attack, strictly increasing, within (-pi/2, pi/2).
        lift, drag : array, shape (n,)
            Lift and drag coefficient.
        aspect_ratio : float
            Of the blade, for the drag of the plate at 90 degrees (Viterna and Janetzke 1982, eq.
            4).
        """
        alpha, lift, drag = (np.asarray(column, dtype=float) for column in (alpha, lift, drag))
        circle = _viterna(alpha, lift, drag, aspect_ratio)
        return cls(_spline(*circle), float(alpha[0]), float(alpha[-1]))

    @classmethod
    def from_polar_table(cls, table):
        """Make a polar from a table; Viterna extends one that does not cover the full circle.

        Parameters
        ----------
        table : hkt_mdo.files.polar.PolarTable
            A table as `read_polars` returns it.

        Raises
        ------
        InputError
            If the curve leaves between the rows what a section may have: drag that is not positive,
            or coefficients beyond `polar_files.LARGEST`.
        """
        if table.full_circle:
            lift, drag = table.lift.copy(), table.drag.copy()
            lift[-1], drag[-1] = lift[0], drag[0]  # equal but for rounding: one angle
            polar = cls(_spline(table.alpha, lift, drag), -np.pi, np.pi)
        else:
            polar = cls.from_table(table.alpha, table.lift, table.drag)
        polar._refuse_overshoot(table.source)
        return polar

    @classmethod
    def from_csv(cls, source):
        """Read a polar from a file with one Reynolds number, or a shipped one.

        Parameters
        ----------
        source : str or Path
            A shipped name or the path of a file as `read_polars` takes it, such as a CSV file with
            the columns alpha_deg, cl, cd.

        Raises
        ------
        InputError
            If the file is missing or broken, holds several Reynolds numbers, or the curve through
            its rows overshoots.
        """
        tables = read_polars(source)
        if len(tables) > 1:
            raise InputError(
                f"holds polars at {len(tables)} Reynolds numbers where one is asked for",
                "keep one of them",
                file=source,
            )
        return cls.from_polar_table(tables[0])

    def blend(self, other, weight):
        """Return the polar between this one and another, linear in every coefficient.

        c = (1 - weight) c_self + weight c_other at every angle: all polars have the same knots, so
        the blend of the splines is the spline of the blend.

        Parameters
        ----------
        other : Polar
        weight : float
            Of the other polar, 0 to 1.

        Raises
        ------
        ValueError
            If the polars differ in their knots.
        """
        if self.coefficients.shape != other.coefficients.shape:
            raise ValueError("polars with different knots cannot be blended")
        return Polar(
            (1.0 - weight) * self.coefficients + weight * other.coefficients,
            max(self.alpha_min, other.alpha_min),
            min(self.alpha_max, other.alpha_max),
        )

    def evaluate(self, alpha, reynolds=None):
        """Return lift and drag coefficient at an angle of attack (rad)."""
        row, x = self._locate(alpha)
        return (
            row[0] + x * (row[1] + x * (row[2] + x * row[3])),
            row[4] + x * (row[5] + x * (row[6] + x * row[7])),
        )

    def derivatives(self, alpha, reynolds=None):
        """Return dcl/dalpha, dcl/dRe, dcd/dalpha, dcd/dRe, per rad; those by Re are zero."""
        row, x = self._locate(alpha)
        return (
            row[1] + x * (2.0 * row[2] + x * 3.0 * row[3]),
            0.0,
            row[5] + x * (2.0 * row[6] + x * 3.0 * row[7]),
            0.0,
        )

    def _locate(self, alpha):
        """Return the coefficients of the interval that holds alpha, and the place in it."""
        n_knots = self.coefficients.shape[0]
        step = 2.0 * np.pi / n_knots
        index = np.floor((np.real(alpha) + np.pi) / step).astype(int)
        rows = np.moveaxis(self.coefficients[index % n_knots], -1, 0)
        return rows, alpha + np.pi - index * step

    def _refuse_overshoot(self, source):
        """Raise an error where the curve between rows leaves what a section may have."""
        step = 2.0 * np.pi / self.coefficients.shape[0]
        for name, block in (("lift", self.coefficients[:, :4]), ("drag", self.coefficients[:, 4:])):
            c0, c1, c2, c3 = block.T
            with np.errstate(divide="ignore", invalid="ignore"):
                # both roots of the slope c1 + 2 c2 x + 3 c3 x², without cancellation
                half = -(c2 + np.copysign(np.sqrt(c2**2 - 3.0 * c1 * c3), c2))
                x = np.stack((0.0 * c0, half / (3.0 * c3), c1 / half))
            x = np.where((x >= 0.0) & (x <= step), x, 0.0)
            value = c0 + x * (c1 + x * (c2 + x * c3))
            lowest = 0.0 if name == "drag" else -LARGEST[name]
            for wrong, at in (
                (value.min() <= lowest, value.argmin()),
                (value.max() > LARGEST[name], value.argmax()),
            ):
                if wrong:
                    knot = at % c0.size
                    alpha = np.rad2deg(-np.pi + knot * step + x.flat[at])
                    raise InputError(
                        f"the smooth curve through the rows has a {name} coefficient of "
                        f"{value.flat[at]:.3g} at {alpha:.2f} degrees",
                        "add rows near this angle, or take out rows that lie too close together",
                        file=source,
                    )


@dataclass(frozen=True, eq=False)
class PolarFamily:
    """Polars of one section over the Reynolds number.

    Between two Reynolds numbers lift and drag are linear in the logarithm of the Reynolds number;
    beyond the first and the last they are carried unchanged.

    Parameters
    ----------
    reynolds : ndarray, shape (n,)
        By the chord, strictly increasing; infinite for the one polar of a file that states none
        (Reynolds invariance).
    polars : tuple of Polar, length n

    Raises
    ------
    ValueError
        If the Reynolds numbers are not positive and increasing, or as many as the polars.
    """

    reynolds: np.ndarray
    polars: tuple[Polar, ...]

    def __post_init__(self):
        reynolds = np.asarray(self.reynolds, dtype=float)
        if reynolds.shape != (len(self.polars),) or not self.polars:
            raise ValueError("give one Reynolds number for each polar")
        if not reynolds[0] > 0.0 or not np.all(np.diff(reynolds) > 0.0):
            raise ValueError("Reynolds numbers must be positive and increase")
        object.__setattr__(self, "reynolds", reynolds)
        object.__setattr__(self, "polars", tuple(self.polars))

    @classmethod
    def from_tables(cls, tables):
        """Make a family of the tables of a section, as `read_polars` returns them.

        Raises
        ------
        InputError
            If the curve through the rows of a table overshoots.
        """
        reynolds = [np.inf if table.reynolds is None else table.reynolds for table in tables]
        return cls(np.array(reynolds), tuple(map(Polar.from_polar_table, tables)))

    @classmethod
    def from_file(cls, source):
        """Read the polars of a section: a file or a shipped name, as `read_polars` takes it.

        Raises
        ------
        InputError
            If the file is missing or broken, or the curve through its rows overshoots.
        """
        return cls.from_tables(read_polars(source))

    @cached_property
    def log_reynolds(self):
        """Natural logarithm of the Reynolds numbers, shape (n,)."""
        return np.log(self.reynolds)

    @cached_property
    def coefficients(self):
        """Coefficients of all polars, shape (n, n_knots, 8)."""
        return np.stack([polar.coefficients for polar in self.polars])

    def at(self, reynolds):
        """Return the polar at a Reynolds number.

        Parameters
        ----------
        reynolds : float
            By the chord; beyond the first and the last of the family their polars are returned.
        """
        place = np.interp(np.log(reynolds), self.log_reynolds, np.arange(len(self.polars)))
        below = min(int(place), len(self.polars) - 1)
        if place == below:
            return self.polars[below]
        return self.polars[below].blend(self.polars[below + 1], place - below)


class SecondMoments(NamedTuple):
    """Second moments of area over the fourth power of the chord, about the centroid.

    xx = integral of y² dA (bending about the chord line: flapwise), yy = integral of x² dA
    (edgewise), xy = integral of x y dA.
    """

    xx: float
    yy: float
    xy: float


class PrincipalMoments(NamedTuple):
    """Extreme second moments of area over the fourth power of the chord.

    angle (rad) leads from the chord line, towards the upper side, to the axis about which the
    second moment is the smallest.
    """

    smallest: float
    largest: float
    angle: float


@dataclass(frozen=True, eq=False)
class Outline:
    """Closed outline of a section in units of its chord.

    The chord line is the x axis: leading edge at (0, 0), trailing edge at (1, 0); angles of attack
    and twist count from it. The section is solid: what follows from the outline are its area and
    its stiffness in bending. That in torsion is no polygon's sum and is not here.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        From the trailing edge round to the trailing edge.
    """

    x: np.ndarray
    y: np.ndarray

    @classmethod
    def from_file(cls, source):
        """Read an outline: CSV file x_over_c,y_over_c, Selig's or Lednicer's order, or shipped.

        Parameters
        ----------
        source : str or Path
            A shipped name or the path of a file.

        Raises
        ------
        InputError
            If the file is missing or broken, or holds no closed section of unit chord.
        """
        return cls(*read_outline(source))

    from_csv = from_file

    @cached_property
    def area(self):
        """Area over chord squared (shoelace formula)."""
        twice = np.dot(self.x, np.roll(self.y, -1)) - np.dot(self.y, np.roll(self.x, -1))
        return 0.5 * abs(float(twice))

    @cached_property
    def thickness(self):
        """Largest thickness over the chord, measured perpendicular to the chord line."""
        next_x, next_y = np.roll(self.x, -1), np.roll(self.y, -1)
        run, rise = next_x - self.x, next_y - self.y
        largest = 0.0
        for x in self.x:  # the thickness is linear in between
            sides = (np.minimum(self.x, next_x) <= x) & (x <= np.maximum(self.x, next_x))
            upright = run[sides] == 0.0
            share = (x - self.x[sides]) / np.where(upright, 1.0, run[sides])
            y = np.concatenate((self.y[sides] + share * rise[sides], next_y[sides][upright]))
            largest = max(largest, float(np.ptp(y)))
        return largest

    @cached_property
    def centroid(self):
        """Centroid (x, y) over the chord."""
        x, y, next_x, next_y, cross = self._sides()
        weight = cross / (3.0 * np.sum(cross))
        return float(np.dot(x + next_x, weight)), float(np.dot(y + next_y, weight))

    @cached_property
    def second_moments(self):
        """`SecondMoments` about the centroid, exact for the polygon.

        Sums over the sides of cross (a² + a b + b²) / 12 with cross = x0 y1 - x1 y0 (Green's
        theorem), taken with the centroid as origin.
        """
        x, y, next_x, next_y, cross = self._sides(*self.centroid)
        cross = cross * np.sign(np.sum(cross))
        return SecondMoments(
            float(np.dot(cross, y * y + y * next_y + next_y * next_y)) / 12.0,
            float(np.dot(cross, x * x + x * next_x + next_x * next_x)) / 12.0,
            float(np.dot(cross, x * (2.0 * y + next_y) + next_x * (y + 2.0 * next_y))) / 24.0,
        )

    @cached_property
    def principal_moments(self):
        """`PrincipalMoments`: the second moments about the axes for which xy vanishes."""
        moments = self.second_moments
        mean, half = 0.5 * (moments.yy + moments.xx), 0.5 * (moments.yy - moments.xx)
        radius = float(np.hypot(half, moments.xy))
        return PrincipalMoments(
            mean - radius, mean + radius, 0.5 * float(np.arctan2(moments.xy, half))
        )

    def bending_stiffness(self, chord, youngs_modulus):
        """Return the flapwise and the edgewise bending stiffness E I of the solid section, N m².

        E I = E xx c⁴ about the chord line, E yy c⁴ about the line across it, both through the
        centroid. They are coupled by E xy c⁴ where the principal axes lie askew.

        Parameters
        ----------
        chord : float or array, m
        youngs_modulus : float, Pa
        """
        scale = youngs_modulus * np.asarray(chord) ** 4
        return self.second_moments.xx * scale, self.second_moments.yy * scale

    def _sides(self, x0=0.0, y0=0.0):
        """Return the ends of every side, seen from a point, and their cross products."""
        x, y = self.x - x0, self.y - y0
        next_x, next_y = np.roll(x, -1), np.roll(y, -1)
        return x, y, next_x, next_y, x * next_y - next_x * y


def _spline(alpha, lift, drag):
    """Return `Polar.coefficients` of the periodic curves through a table from -pi to pi."""
    n_knots = 360 * KNOTS_PER_DEGREE
    knots = np.linspace(-np.pi, np.pi, n_knots + 1)
    blocks = []
    for column in (lift, drag):
        table = CubicSpline(alpha, column, bc_type="periodic")
        values = table(knots)
        values[-1] = values[0]
        blocks.append(CubicSpline(knots, values, bc_type="periodic").c[::-1].T)
    return np.ascontiguousarray(np.hstack(blocks))


def _viterna(alpha, lift, drag, aspect_ratio):
    """Extend a polar to -pi … pi (Viterna and Janetzke, NASA TM-82944, 1982).

    From the last table row to 90 degrees the flow is that over a plate whose lift and drag match
    the row; beyond 90 degrees and at negative angles it is mirrored, with 0.7 of the lift, as is
    customary for a section with a sharp edge in front. Both ends are joined by straight lines
    through zero lift at +-180.
    """
    drag_max = max(1.11 + 0.018 * aspect_ratio, drag.max())
    stall, sin_s, cos_s = alpha[-1], np.sin(alpha[-1]), np.cos(alpha[-1])
    a2 = (lift[-1] - drag_max * sin_s * cos_s) * sin_s / cos_s**2
    b2 = (drag[-1] - drag_max * sin_s**2) / cos_s

    def plate(angle):
        sine, cosine = np.sin(angle), np.cos(angle)
        return (
            0.5 * drag_max * np.sin(2.0 * angle) + a2 * cosine**2 / sine,
            drag_max * sine**2 + b2 * cosine,
        )

    mirror = 0.7
    step = np.deg2rad(5.0)

    def between(low, high):
        count = max(round((high - low) / step), 1)
        return np.linspace(low, high, count + 1)[1:-1]

    pieces = []  # (alpha, lift, drag), ascending
    a = between(-np.pi, -np.pi + stall)
    cl_edge, cd_edge = plate(stall)
    floor = drag.min()
    pieces.append((np.array([-np.pi]), np.array([0.0]), np.array([floor])))
    share = (a + np.pi) / stall
    pieces.append((a, mirror * cl_edge * share, floor + (cd_edge - floor) * share))
    a = np.r_[-np.pi + stall, between(-np.pi + stall, -0.5 * np.pi), -0.5 * np.pi]
    cl, cd = plate(a + np.pi)
    pieces.append((a, mirror * cl, cd))
    low = min(alpha[0], -stall)
    a = between(-0.5 * np.pi, low)
    cl, cd = plate(-a)
    pieces.append((a, -mirror * cl, cd))
    if (
        alpha[0] > -stall
    ):  # a short table on the negative side: a straight line to the mirrored stall
        cl, cd = plate(stall)
        a = np.r_[-stall, between(-stall, alpha[0])]
        share = (a + stall) / (alpha[0] + stall)
        pieces.append(
            (
                a,
                -mirror * cl * (1.0 - share) + lift[0] * share,
                cd * (1.0 - share) + drag[0] * share,
            )
        )
    pieces.append((alpha, lift, drag))
    a = np.r_[between(stall, 0.5 * np.pi), 0.5 * np.pi]
    pieces.append((a, *plate(a)))
    a = np.r_[between(0.5 * np.pi, np.pi - stall), np.pi - stall]
    cl, cd = plate(np.pi - a)
    pieces.append((a, -mirror * cl, cd))
    a = between(np.pi - stall, np.pi)
    share = (np.pi - a) / stall
    pieces.append((a, -mirror * cl_edge * share, floor + (cd_edge - floor) * share))
    pieces.append((np.array([np.pi]), np.array([0.0]), np.array([floor])))
    full_alpha, full_lift, full_drag = (np.concatenate(part) for part in zip(*pieces, strict=True))
    return full_alpha, full_lift, np.maximum(full_drag, floor)
