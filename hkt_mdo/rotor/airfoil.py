"""Polars of a blade section: lift and drag over all angles of attack and Reynolds numbers."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.errors import InputError
from hkt_mdo.files.polar import read_polars
from hkt_mdo.files.polar_table import LARGEST

# A polar on a 0.25 or 0.5 degree grid is interpolated exactly at its own points. A lookup is one
# multiplication instead of a search.
KNOTS_PER_DEGREE = 4
ASPECT_RATIO = 10.0  # of the blade, for the drag of the plate (Viterna and Janetzke 1982, eq. 4)


@dataclass(frozen=True, eq=False)
class Polar:
    """Lift and drag coefficient of a section over the full circle, a C² function.

    The table is interpolated by a periodic cubic spline on equally spaced knots. CCBlade can use it
    as an airfoil (`evaluate`, `derivatives`), so that both BEM solvers see the same function; the
    Reynolds number is accepted and ignored (Reynolds invariance, paper Sec. II-A).

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
    def from_table(cls, alpha, lift, drag):
        """Make a polar from a table of attached and early stalled flow, extended by Viterna.

        Parameters
        ----------
        alpha : array, shape (n,), rad
            Angle of attack, strictly increasing, within (-pi/2, pi/2).
        lift, drag : array, shape (n,)
        """
        alpha, lift, drag = (np.asarray(column, dtype=float) for column in (alpha, lift, drag))
        return cls(_spline(*_viterna(alpha, lift, drag)), float(alpha[0]), float(alpha[-1]))

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
            If the curve between the rows has a drag that is not positive, or coefficients beyond
            `hkt_mdo.files.polar.LARGEST`.
        """
        if table.full_circle:
            lift, drag = table.lift.copy(), table.drag.copy()
            lift[-1], drag[-1] = lift[0], drag[0]  # the same angle; equal except for rounding
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

        c = (1 - weight) c_self + weight c_other at every angle, with a weight of 0 to 1. A
        ValueError is raised if the polars differ in their knots.
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
        """Raise an error where the curve between rows has impossible coefficients."""
        step = 2.0 * np.pi / self.coefficients.shape[0]
        for name, block in (("lift", self.coefficients[:, :4]), ("drag", self.coefficients[:, 4:])):
            c0, c1, c2, c3 = block.T
            with np.errstate(divide="ignore", invalid="ignore"):
                # Both roots of the slope c1 + 2 c2 x + 3 c3 x², without cancellation
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
    beyond the first and the last they are constant.

    Parameters
    ----------
    reynolds : ndarray, shape (n,)
        By the chord, strictly increasing; infinite for the one polar of a file that states none
        (Reynolds invariance).
    polars : tuple of Polar, length n

    Raises
    ------
    ValueError
        If the Reynolds numbers are not positive and increasing, or not as many as the polars.
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

    def at(self, reynolds):
        """Return the polar at a Reynolds number by the chord."""
        place = np.interp(np.log(reynolds), self.log_reynolds, np.arange(len(self.polars)))
        below = min(int(place), len(self.polars) - 1)
        if place == below:
            return self.polars[below]
        return self.polars[below].blend(self.polars[below + 1], place - below)


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


def _viterna(alpha, lift, drag):
    """Extend a polar to -pi … pi (Viterna and Janetzke, NASA TM-82944, 1982).

    From the last table row to 90 degrees, the flow is that over a plate whose lift and drag match
    the row. Beyond 90 degrees and at negative angles it is mirrored, with 0.7 of the lift, as is
    customary for a section with its sharp edge in front. Straight lines join both ends through zero
    lift at +-180 degrees.
    """
    drag_max = max(1.11 + 0.018 * ASPECT_RATIO, drag.max())
    stall, sin_s, cos_s = alpha[-1], np.sin(alpha[-1]), np.cos(alpha[-1])
    a2 = (lift[-1] - drag_max * sin_s * cos_s) * sin_s / cos_s**2
    b2 = (drag[-1] - drag_max * sin_s**2) / cos_s

    def plate(angle, lift_factor):
        sine, cosine = np.sin(angle), np.cos(angle)
        cl = 0.5 * drag_max * np.sin(2.0 * angle) + a2 * cosine**2 / sine
        return lift_factor * cl, drag_max * sine**2 + b2 * cosine

    def between(low, high):  # every 5 degrees, without the ends
        count = max(round((high - low) / np.deg2rad(5.0)), 1)
        return np.linspace(low, high, count + 1)[1:-1]

    mirror, half, floor = 0.7, 0.5 * np.pi, drag.min()
    cl_edge, cd_edge = plate(stall, mirror)

    def edge(angle, sign):  # straight lines from +-180 degrees
        share = (np.pi - np.abs(angle)) / stall
        return angle, sign * cl_edge * share, floor + (cd_edge - floor) * share

    last = np.array([np.pi])
    a = np.r_[-np.pi + stall, between(-np.pi + stall, -half), -half]
    pieces = [edge(-last, 1.0), edge(between(-np.pi, -np.pi + stall), 1.0)]
    pieces.append((a, *plate(a + np.pi, mirror)))
    a = between(-half, min(alpha[0], -stall))
    pieces.append((a, *plate(-a, -mirror)))
    if alpha[0] > -stall:  # from the mirrored stall to a table that begins after it
        a = np.r_[-stall, between(-stall, alpha[0])]
        share = (a + stall) / (alpha[0] + stall)
        cl = -cl_edge * (1.0 - share) + lift[0] * share
        pieces.append((a, cl, cd_edge * (1.0 - share) + drag[0] * share))
    pieces.append((alpha, lift, drag))
    a = np.r_[between(stall, half), half]
    pieces.append((a, *plate(a, 1.0)))
    a = np.r_[between(half, np.pi - stall), np.pi - stall]
    pieces.append((a, *plate(np.pi - a, -mirror)))
    pieces += [edge(between(np.pi - stall, np.pi), -1.0), edge(last, -1.0)]
    alpha, lift, drag = (np.concatenate(part) for part in zip(*pieces, strict=True))
    return alpha, lift, np.maximum(drag, floor)
