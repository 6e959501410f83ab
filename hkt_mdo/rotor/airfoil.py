"""Polars of a blade section: lift, drag, suction over all angles of attack, Reynolds numbers."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.polar import read_polars
from hkt_mdo.files.polar_table import LARGEST
from hkt_mdo.rotor.polars import Polars, curves_at, periodic_curves, stacked
from hkt_mdo.rotor.suction import require_suction, surface_curves

ASPECT_RATIO = 10.0  # of the blade, for the drag of the plate (Viterna and Janetzke 1982, eq. 4)


@dataclass(frozen=True, eq=False)
class Polar(Polars):
    """Lift and drag coefficient of a section over the full circle, a C² function.

    A periodic cubic spline through the table on equally spaced knots: coefficients[n_knots, 8] are
    its polynomials, ascending in the local coordinate (rad), four of lift, then four of drag, and
    interval i begins at angle of attack -pi + i * 2 pi / n_knots. Beyond alpha_min to alpha_max
    (rad), the range of the table, the polar is the Viterna extension. CCBlade can use it as an
    airfoil (`evaluate`, `derivatives`), so that both BEM solvers see the same function; the
    Reynolds number is accepted and ignored (Reynolds invariance, paper Sec. II-A).

    suction[n_knots, 8] are the polynomials of -Cp min on the same knots, four of the upper, then
    four of the lower surface (`hkt_mdo.rotor.suction.surface_curves`); None where a table has no
    smallest pressure. Beyond the table it is continued as a constant, so a limit on it means little
    there.
    """

    coefficients: np.ndarray
    alpha_min: float
    alpha_max: float
    suction: np.ndarray | None = None

    @property
    def tables(self):
        """The polar as the one of all stations.

        Returns
        -------
        tuple of tuple of Polar
            See `Polars`.
        """
        return ((self,),)

    @classmethod
    def from_polar_table(cls, table):
        """Make a polar of a `PolarTable`; Viterna extends one that does not cover the full circle.

        Raises InputError if the curve between the rows has a drag that is not positive, or
        coefficients beyond `hkt_mdo.files.polar_table.LARGEST`.

        Parameters
        ----------
        table : PolarTable
            Rows of a polar file.

        Returns
        -------
        Polar
            The polar over the full circle.

        Raises
        ------
        InputError
            Where the curve between rows is impossible.
        """
        alpha, lift, drag = table.alpha, table.lift.copy(), table.drag.copy()
        if table.full_circle:
            lift[-1], drag[-1] = lift[0], drag[0]  # the same angle; equal except for rounding
        else:
            alpha, lift, drag = _viterna(alpha, lift, drag)
        suction, ends = table.smallest_pressure, map(float, table.alpha[[0, -1]])
        if suction is not None:
            suction = periodic_curves(*surface_curves(table.alpha, -suction))
        polar = cls(periodic_curves(alpha, lift, drag), *ends, suction)
        polar._refuse_overshoot(table.source)
        return polar

    def blend(self, other, weight):
        """Return the polar (1 - weight) self + weight other, with a weight of 0 to 1.

        It has no suction where either has none.

        Parameters
        ----------
        other : Polar
            The other one, of weight 1.
        weight : float
            Weight of the other, 0 to 1.

        Returns
        -------
        Polar
            The weighted mean.
        """
        return mixture((self, other), np.array([1.0 - weight, weight]))

    def scaled(self, lift, drag):
        """Return the polar with factors on its lift and drag, such as that of a fouled section.

        Parameters
        ----------
        lift, drag : float
            The factors. The suction stays.

        Returns
        -------
        Polar
            Of the same range.
        """
        return replace(self, coefficients=self.coefficients * np.repeat((lift, drag), 4))

    def evaluate(self, alpha, reynolds=None):
        """Return lift and drag coefficient at an angle of attack (rad).

        Parameters
        ----------
        alpha : float or ndarray
            Angle of attack (rad).
        reynolds : float, optional
            Reynolds number by the chord; without effect.

        Returns
        -------
        lift, drag : float or ndarray
            The coefficients, of the angle's shape.
        """
        return tuple(curves_at(self.coefficients, alpha)[0])

    def derivatives(self, alpha, reynolds=None):
        """Return dcl/dalpha, dcl/dRe, dcd/dalpha, dcd/dRe, per rad; those by Re are zero.

        Parameters
        ----------
        alpha : float or ndarray
            Angle of attack (rad).
        reynolds : float, optional
            Reynolds number by the chord; without effect.

        Returns
        -------
        by_alpha, 0.0, by_alpha, 0.0 : float or ndarray
            Slopes of lift and drag, per rad.
        """
        lift, drag = curves_at(self.coefficients, alpha)[1]
        return lift, 0.0, drag, 0.0

    def suction_at(self, alpha):
        """Return -Cp min and its slope (per rad) at an angle of attack (rad) of any shape.

        Shape (2, *alpha.shape) each, of the upper and the lower surface. Raises InputError if the
        polar has no suction.

        Parameters
        ----------
        alpha : float or ndarray
            Angle of attack (rad).

        Returns
        -------
        suction, slopes : ndarray of shape (2, *alpha.shape)
            -Cp min, and its slope per rad.

        Raises
        ------
        InputError
            If the polar has no suction.
        """
        require_suction((self,))
        return curves_at(self.suction, alpha)

    def _refuse_overshoot(self, source):
        """Raise an error where the curve between rows has impossible coefficients."""
        at = np.linspace(-np.pi, np.pi, 8 * self.coefficients.shape[0] + 1)
        for name, value in zip(("lift", "drag"), curves_at(self.coefficients, at)[0], strict=True):
            lowest = 0.0 if name == "drag" else -LARGEST[name]
            for extreme in (value.argmin(), value.argmax()):
                if not lowest < value[extreme] <= LARGEST[name]:
                    raise InputError(
                        f"the smooth curve through the rows has a {name} coefficient of "
                        f"{value[extreme]:.3g} at {np.rad2deg(at[extreme]):.2f} degrees",
                        "add rows near this angle, or remove rows that are too close together",
                        file=source,
                    )


def mixture(polars, weights):
    """Return the weighted sum of polars; it has no suction where one of them has none.

    Parameters
    ----------
    polars : sequence of Polar
        The polars.
    weights : ndarray of shape (n_polars,)
        Their weights, whose sum is one.

    Returns
    -------
    Polar
        Of the range that all polars have.
    """

    def mixed(name):
        return np.tensordot(weights, stacked(tuple(polars), name), 1)

    return Polar(
        mixed("coefficients"),
        max(polar.alpha_min for polar in polars),
        min(polar.alpha_max for polar in polars),
        None if any(polar.suction is None for polar in polars) else mixed("suction"),
    )


@dataclass(frozen=True, eq=False)
class PolarFamily:
    """Polars of one section over the Reynolds number.

    Between two of reynolds[n], which increase, lift and drag are linear in its logarithm; beyond
    the first and the last they are constant. Reynolds numbers are by the chord, and infinite for
    the one polar of a file that states none (Reynolds invariance). `messages` say how the rows of
    its file were changed.
    """

    reynolds: np.ndarray
    polars: tuple[Polar, ...]
    messages: tuple[str, ...] = ()

    @classmethod
    def from_tables(cls, tables):
        """Make a family of a section's tables; see `Polar.from_polar_table`.

        Parameters
        ----------
        tables : sequence of PolarTable
            Tables by increasing Reynolds number.

        Returns
        -------
        PolarFamily
            Polars over the Reynolds number.

        Raises
        ------
        InputError
            As `Polar.from_polar_table`.
        """
        reynolds = [np.inf if table.reynolds is None else table.reynolds for table in tables]
        messages = dict.fromkeys(message for table in tables for message in table.messages)
        return cls(np.array(reynolds), tuple(map(Polar.from_polar_table, tables)), tuple(messages))

    @classmethod
    def from_file(cls, source):
        """Read a section's polars as `read_polars` does; see `Polar.from_polar_table` too.

        Parameters
        ----------
        source : str or path
            Name of a shipped section, or a file.

        Returns
        -------
        PolarFamily
            Polars over the Reynolds number.

        Raises
        ------
        InputError
            If the file is broken.
        """
        return cls.from_tables(read_polars(source))

    def at(self, reynolds):
        """Return the polar at a Reynolds number by the chord.

        Parameters
        ----------
        reynolds : float
            Reynolds number by the chord.

        Returns
        -------
        Polar
            Interpolated in the logarithm of the Reynolds number.
        """
        numbers = np.log(self.reynolds)
        position = np.interp(np.log(reynolds), numbers, np.arange(numbers.size))
        below = int(position)
        if position == below:
            return self.polars[below]
        return self.polars[below].blend(self.polars[below + 1], position - below)


def _viterna(alpha, lift, drag):
    """Extend a polar to -pi … pi (Viterna and Janetzke, NASA TM-82944, 1982).

    From the last table row to 90 degrees, the flow is that over a plate whose lift and drag match
    the row. Beyond 90 degrees and at negative angles it is mirrored, with 0.7 of the lift, as is
    customary for a section with its sharp edge in front. Straight lines join both ends through zero
    lift at +-180 degrees, and the mirrored stall with a table that begins after it.
    """
    drag_max = max(1.11 + 0.018 * ASPECT_RATIO, drag.max())
    stall, sin_s, cos_s = alpha[-1], np.sin(alpha[-1]), np.cos(alpha[-1])
    a2 = (lift[-1] - drag_max * sin_s * cos_s) * sin_s / cos_s**2
    b2 = (drag[-1] - drag_max * sin_s**2) / cos_s
    half, floor = 0.5 * np.pi, drag.min()

    def outside(angle):
        back = np.pi - np.abs(angle)
        near = np.maximum(np.minimum(np.abs(angle), back), stall)  # of the plate
        sine, cosine = np.sin(near), np.cos(near)
        share = np.minimum(back / stall, 1.0)
        factor = np.array([0.7, -0.7, 1.0, -0.7])[np.digitize(angle, (-half, 0.0, half))]
        plate = 0.5 * drag_max * np.sin(2.0 * near) + a2 * cosine**2 / sine
        return factor * share * plate, floor + share * (drag_max * sine**2 + b2 * cosine - floor)

    def spaced(*ends):  # every 5 degrees, without the last end
        pieces = []
        for low, high in pairwise(ends):
            count = max(round((high - low) / np.deg2rad(5.0)), int(high > low))
            pieces.append(np.linspace(low, high, count, endpoint=False))
        return np.concatenate(pieces)

    below = spaced(-np.pi, stall - np.pi, -half, min(alpha[0], -stall), alpha[0])
    above = -spaced(-np.pi, stall - np.pi, -half, -stall)[::-1]
    columns, pieces = [], ((lift, drag), *map(outside, (-stall, below, above)))
    for column, first, before, after in zip(*pieces, strict=True):
        line = np.interp(below, (-stall, alpha[0]), (first, column[0]))
        before = np.where(below > -stall, line, before)
        columns.append(np.concatenate((before, column, after)))
    return np.concatenate((below, alpha, above)), columns[0], np.maximum(columns[1], floor)
