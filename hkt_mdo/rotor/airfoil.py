"""The blade section: lift and drag over all angles of attack, and the area of its outline."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.data import read_table
from hkt_mdo.errors import InputError

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
        full_alpha, full_lift, full_drag = _viterna(
            *(np.asarray(column, dtype=float) for column in (alpha, lift, drag)), aspect_ratio
        )
        n_knots = 360 * KNOTS_PER_DEGREE
        knots = np.linspace(-np.pi, np.pi, n_knots + 1)
        blocks = []
        for column in (full_lift, full_drag):
            table = CubicSpline(full_alpha, column, bc_type="periodic")
            values = table(knots)
            values[-1] = values[0]
            blocks.append(CubicSpline(knots, values, bc_type="periodic").c[::-1].T)
        return cls(np.ascontiguousarray(np.hstack(blocks)), float(alpha[0]), float(alpha[-1]))

    @classmethod
    def from_csv(cls, source):
        """Read a polar from a CSV file with columns alpha_deg, cl, cd, or a shipped one.

        Raises
        ------
        InputError
            If the file is missing or broken, alpha is not strictly increasing, the range does not
            reach from -5 to +12 degrees, or drag is not positive.
        """
        table = read_table(source, ("alpha_deg", "cl", "cd"), "polar")
        alpha = table["alpha_deg"]
        if alpha.size < 8:
            raise InputError(
                f"{source}: polar has {alpha.size} rows: at least 8 angles of attack are needed; "
                "give a finer table"
            )
        falls = np.flatnonzero(np.diff(alpha) <= 0.0)
        if falls.size:
            row = int(falls[0])
            raise InputError(
                f"{source}: alpha_deg = {alpha[row + 1]:g} follows {alpha[row]:g}: angles must "
                "increase strictly; sort the rows and remove duplicates"
            )
        if alpha[0] > -5.0 or alpha[-1] < 12.0 or alpha[0] < -90.0 or alpha[-1] > 90.0:
            raise InputError(
                f"{source}: alpha_deg = {alpha[0]:g} … {alpha[-1]:g}: the table must reach from "
                "-5 or less to 12 or more and stay within -90 and 90 degrees; extend or cut it "
                "(beyond the table the polar is extended by Viterna)"
            )
        if np.min(table["cd"]) <= 0.0:
            row = int(np.argmin(table["cd"]))
            raise InputError(
                f"{source}: cd = {table['cd'][row]:g} at alpha_deg = {alpha[row]:g}: drag must be "
                "positive; correct the row"
            )
        return cls.from_table(np.deg2rad(alpha), table["cl"], table["cd"])

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
        return self.coefficients[index % n_knots].T, alpha + np.pi - index * step


@dataclass(frozen=True, eq=False)
class Outline:
    """Closed outline of a section in units of its chord.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        From the trailing edge round to the trailing edge.
    """

    x: np.ndarray
    y: np.ndarray

    @classmethod
    def from_csv(cls, source):
        """Read an outline from a CSV file with columns x_over_c, y_over_c, or a shipped one."""
        table = read_table(source, ("x_over_c", "y_over_c"), "outline")
        outline = cls(table["x_over_c"], table["y_over_c"])
        if outline.x.size < 10 or not 0.005 <= outline.area <= 0.8:
            raise InputError(
                f"{source}: outline of {outline.x.size} points with area {outline.area:.4g} "
                "chord²: not a closed section of unit chord; give the points from the trailing "
                "edge round to it"
            )
        return outline

    @cached_property
    def area(self):
        """Area over chord squared (shoelace formula)."""
        twice = np.dot(self.x, np.roll(self.y, -1)) - np.dot(self.y, np.roll(self.x, -1))
        return 0.5 * abs(float(twice))


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
