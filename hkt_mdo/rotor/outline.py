"""The outline of a blade section: area, thickness and second moments of area."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hkt_mdo.files.outline import read_outline

# Where both sides of an outline are blended, as fractions of the chord: crowded towards both edges
FRACTIONS = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 201)))


@dataclass(frozen=True, eq=False)
class Outline:
    """Closed outline of a solid section in units of its chord, x[n] and y[n].

    The chord line is the x axis: leading edge at (0, 0), trailing edge at (1, 0), where the points
    begin and end; angles of attack and twist are measured from it.
    """

    x: np.ndarray
    y: np.ndarray

    @classmethod
    def from_file(cls, source):
        """Read an outline: CSV file x_over_c,y_over_c, Selig's or Lednicer's order, or shipped.

        Raises InputError if the file is broken, or holds no closed section of unit chord.

        Parameters
        ----------
        source : str or path
            Name of a shipped outline, or a file.

        Returns
        -------
        Outline
            The outline.

        Raises
        ------
        InputError
            If the file is broken or holds no closed section.
        """
        return cls(*read_outline(source))

    @classmethod
    def of_sides(cls, x, upper, lower):
        """Return the outline with y of the upper and the lower side at x.

        Parameters
        ----------
        x, upper, lower : ndarray of shape (n,)
            From the leading to the trailing edge, over the chord.

        Returns
        -------
        Outline
            From the trailing edge over the upper side round to it.
        """
        return cls(np.concatenate((x[::-1], x)), np.concatenate((upper[::-1], lower)))

    @cached_property
    def area(self):
        """Area over chord squared (shoelace formula).

        Returns
        -------
        float
            Over chord squared.
        """
        return 0.5 * abs(float(np.sum(self._sides()[4])))

    @property
    def upper_first(self):
        """The points, (n, 2), from the trailing edge over the upper side.

        Returns
        -------
        ndarray of shape (n, 2)
            x and y over the chord.
        """
        return np.column_stack((self.x, self.y))[:: self._turn]

    @cached_property
    def thickness(self):
        """Largest thickness over the chord, measured perpendicular to the chord line.

        Returns
        -------
        float
            Over the chord.
        """
        one, other = _sides_at(self.x, self.x, self.y)  # linear between the points
        return float(np.max(np.abs(one - other)))

    @cached_property
    def centroid(self):
        """Centroid (x, y) over the chord.

        Returns
        -------
        tuple of float
            x and y over the chord.
        """
        x, y, next_x, next_y, cross = self._sides()
        weight = cross / (3.0 * np.sum(cross))
        return float(np.dot(x + next_x, weight)), float(np.dot(y + next_y, weight))

    @cached_property
    def second_moments(self):
        """Second moments of area about the centroid, exact for the polygon.

        xx = integral of y² dA (bending about the chord line: flapwise), yy = integral of x² dA
        (edgewise), xy = integral of x y dA: sums over the sides of cross (a² + a b + b²) / 12 with
        cross = x0 y1 - x1 y0 (Green's theorem), taken with the centroid as origin.

        Returns
        -------
        tuple of float
            xx, yy and xy over chord to the fourth power.
        """
        x, y, next_x, next_y, cross = self._sides(*self.centroid)
        cross = cross * np.sign(np.sum(cross))
        return (
            float(np.dot(cross, y * y + y * next_y + next_y * next_y)) / 12.0,
            float(np.dot(cross, x * x + x * next_x + next_x * next_x)) / 12.0,
            float(np.dot(cross, x * (2.0 * y + next_y) + next_x * (y + 2.0 * next_y))) / 24.0,
        )

    def stretched(self, factor):
        """Return the outline with its thickness, and camber with it, times a factor.

        Parameters
        ----------
        factor : float
            Factor on the thickness.

        Returns
        -------
        Outline
            The stretched outline.
        """
        return Outline(self.x, factor * self.y)

    def blend(self, other, share):
        """Return the outline between two: the mean, by share of the other, of upper and lower side.

        Both sides are taken at equal fractions of the chord, so thickness and area are linear in
        the share, and the second moment of area across the chord is a cubic.

        Parameters
        ----------
        other : Outline
            The outline at a share of 1.
        share : float
            Share of the other, 0 to 1.

        Returns
        -------
        Outline
            The outline between both.
        """
        if share == 0.0 or other is self:
            return self
        if share == 1.0:
            return other
        pairs = zip(self.resampled(), other.resampled(), strict=True)
        return Outline.of_sides(*((1.0 - share) * one + share * two for one, two in pairs))

    def resampled(self, fractions=FRACTIONS):
        """Return x, and y of the upper and the lower side, from leading to trailing edge.

        Parameters
        ----------
        fractions : ndarray of shape (n_fractions,)
            Where, over the chord, from 0 to 1.

        Returns
        -------
        x, upper, lower : ndarray of shape (n_fractions,)
            Over the chord.
        """
        x = np.min(self.x) + fractions * np.ptp(self.x)
        return x, *_sides_at(x, self.x, self.y)[:: self._turn]

    def hollowed(self, wall):
        """Return the outline of the hollow left by a wall (over the chord), or None if none is.

        The inner side has the distance `wall` from the outer one. Towards a sharp trailing edge,
        where the walls meet, the section is solid.

        Parameters
        ----------
        wall : float
            Thickness of the wall over the chord.

        Returns
        -------
        Outline or None
            The outline of the hollow; None where the section is solid.
        """
        run, rise = np.gradient(self.x), np.gradient(self.y)
        step = self._turn * wall / np.maximum(np.hypot(run, rise), np.finfo(float).tiny)
        x = np.min(self.x) + wall + FRACTIONS * (np.ptp(self.x) - 2.0 * wall)
        upper, lower = _sides_at(x, self.x - step * rise, self.y + step * run)[:: self._turn]
        inside = upper > lower
        if np.count_nonzero(inside) < 2:
            return None
        return Outline.of_sides(x[inside], upper[inside], lower[inside])

    @cached_property
    def _turn(self):
        """1 where the points run anticlockwise, over the upper side first, or else -1."""
        return 1 if np.sum(self._sides()[4]) > 0.0 else -1

    def _sides(self, x0=0.0, y0=0.0):
        """Return the ends of every side relative to a point, and their cross products."""
        x, y = self.x - x0, self.y - y0
        next_x, next_y = np.roll(x, -1), np.roll(y, -1)
        return x, y, next_x, next_y, x * next_y - next_x * y


def _sides_at(at, x, y):
    """Return y of both sides of an outline at some x, the side where its points begin first.

    Where a side turns back in x, the part that goes on towards the trailing edge is taken.
    """
    noses, sides = np.flatnonzero(x == np.min(x)), []  # several where it is flat
    for side in (slice(noses[0], None, -1), slice(noses[-1], None)):
        on = np.concatenate(([True], x[side][1:] > np.maximum.accumulate(x[side])[:-1]))
        sides.append(np.interp(at, x[side][on], y[side][on]))
    return sides
