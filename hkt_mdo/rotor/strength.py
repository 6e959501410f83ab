"""Strength of a blade's sections: bending about inclined axes by their outline and material.

A section has the axes x along its chord, from the leading to the trailing edge, and y across it,
towards the upper (suction) side, both from the centroid of its material; see docs/rotor_model.md.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.compiled import compiled
from hkt_mdo.rotor.following import over_thickness
from hkt_mdo.rotor.outline import Outline

PLACES = 64  # about; with them the largest stress is within 1e-3 of that between all places
EXPONENT = 400  # of the norms that are smooth instead of the largest; see `norm`
PARTS = 32  # between two sections, in which sections of a designed thickness are tabulated
POINT_ERROR = 2e-4  # largest relative error of the extent of an outline by the points that are kept


class Bending(NamedTuple):
    """Largest bending stress of sections (Pa), each of shape (n_points, n_places).

    largest is over the outline; smooth, never below it, a norm over it with the derivatives by_weak
    and by_strong by both moments (1/m³), and by_thickness by that of the sections. At places with
    too little stress for the norm along the blade, smooth is the largest.
    """

    largest: np.ndarray
    smooth: np.ndarray
    by_weak: np.ndarray
    by_strong: np.ndarray
    by_thickness: np.ndarray


@dataclass(frozen=True, eq=False)
class Structure:
    """Area and second moments of a blade's sections, over powers of the chord, at n places.

    area over chord squared; second moments of area over its fourth power, xx = integral of y² dA,
    yy = integral of x² dA, xy = integral of x y dA about the centroid; each of shape (n,) or, for
    equal sections, (1,). points[n or 1, 2, n_points] are those (x, y) of the outline that can have
    the largest stress, over the chord, from the centroid. density (kg/m³) and Young's modulus (Pa)
    are the material's; the latter is needed for deflections only (NaN: they are NaN, too).
    n_stations is that of the blade, None for equal sections.
    """

    area: np.ndarray
    xx: np.ndarray
    yy: np.ndarray
    xy: np.ndarray
    points: np.ndarray
    density: float
    modulus: float = np.nan
    n_stations: int | None = None

    @classmethod
    def of(cls, outlines, density, modulus=np.nan, wall=None, given=None):
        """Return the structure of a blade with one `Outline`, or one for each station.

        Between stations the outlines are blended (`Outline.blend`). wall is the thickness of the
        wall of hollow sections over the chord, one or one a station, linear between; the hollow
        itself carries and weighs nothing. Numbers that are given, as measured or computed, stand in
        for those of outline and wall, and are linear between stations.

        Parameters
        ----------
        outlines : Outline or sequence of Outline
            One for all stations, or one a station.
        density : float
            Density of the material (kg/m**3).
        modulus : float, optional
            Young's modulus of the material (Pa).
        wall : float or array_like of shape (n_stations,), optional
            Thickness of a hollow section's wall over the chord; None: solid.
        given : array_like of shape (n_outlines, 1 or 4), optional
            Area over chord squared, or area and second moments as `Outline.second_moments`.

        Returns
        -------
        Structure
            Of the sections.
        """
        outlines = [outlines] if isinstance(outlines, Outline) else outlines
        n, between = len(outlines), []
        weights = place_weights(n)
        for row in weights:
            first, last = np.flatnonzero(row)[[0, -1]]
            between.append(outlines[first].blend(outlines[last], row[last]))
        walls = None if wall is None else weights @ np.broadcast_to(wall, n)
        given = None if given is None else weights @ given
        numbers, points = _tabulated(between, walls, given)
        return cls(*numbers.T, points, float(density), modulus, n if n > 1 else None)

    @property
    def section_area(self):
        """Area over chord squared of every station, of which the mass is made.

        Returns
        -------
        ndarray of shape (n_stations or 1,)
            Linear between the stations.
        """
        if self.n_stations is None:
            return self.area
        return self.area[:: (self.area.size - 1) // (self.n_stations - 1)]

    def at(self, _thickness=None):
        """Return the structure of places, and its rate by the thickness, which is not designed.

        Parameters
        ----------
        _thickness : ndarray of shape (n_places,), optional
            Without effect.

        Returns
        -------
        structure, rate : Structure
            This one, and zeros.
        """
        nothing = dict.fromkeys(("area", "xx", "yy", "xy"), 0.0)
        return self, replace(self, **nothing, points=np.zeros(self.points.shape))

    def bending(self, weak, strong, chord, rate=None, tension=0.0):
        """Return the `Bending` stress by moments weak and strong[n_points, n_places] (N m).

        weak is the moment of forces towards +y, strong of forces towards -x; chord[n_places] in m.
        The stress is x u + y v with

            u = (xx strong + xy weak) / d,  v = -(yy weak + xy strong) / d,  d = (xx yy - xy²) c³.

        Parameters
        ----------
        weak : ndarray of shape (n_points, n_places)
            Moment of forces towards +y (N*m).
        strong : ndarray of shape (n_points, n_places)
            Moment of forces towards -x (N*m).
        chord : ndarray of shape (n_places,)
            Chord (m).
        rate : Structure, optional
            Rate of the structure by the thickness; by default that of `at`.
        tension : float or ndarray of shape (n_points, n_places)
            Stress (Pa) that is added at each place.

        Returns
        -------
        Bending
            The largest stress, and its derivatives.
        """
        d = (self.xx * self.yy - self.xy**2) * chord**3
        u, v = self._gradient(weak, strong, d)
        rate = self.at()[1] if rate is None else rate
        added = np.full(u.shape, np.real(tension))
        norms, largest = _norms_around(u, v, added, self.points, rate.points, EXPONENT)
        smooth, by_u, by_v, by_points = norms
        by_weak = (self.xy * by_u - self.yy * by_v) / d
        by_strong = (self.xx * by_u - self.xy * by_v) / d
        u_t, v_t = rate._gradient(weak, strong, d)
        grown = self.xx * rate.yy + rate.xx * self.yy - 2.0 * self.xy * rate.xy
        grown = grown / (self.xx * self.yy - self.xy**2)
        by_thickness = by_points + by_u * (u_t - u * grown) + by_v * (v_t - v * grown)
        return Bending(largest, smooth, by_weak, by_strong, by_thickness)

    def _gradient(self, weak, strong, d):
        """Return the stress' gradients u and v along x and y; see `bending`."""
        return ((self.xx * strong + self.xy * weak) / d, -(self.yy * weak + self.xy * strong) / d)

    def curvature(self, weak, strong, chord, twist):
        """Return the curvature (1/m) of a blade out of the rotor plane; see `bending`.

        The section bends about its own inclined axes, so both moments count. Twist is in rad.

        Parameters
        ----------
        weak : ndarray of shape (n_points, n_places)
            Moment of forces towards +y (N*m).
        strong : ndarray of shape (n_points, n_places)
            Moment of forces towards -x (N*m).
        chord : ndarray of shape (n_places,)
            Chord (m).
        twist : ndarray of shape (n_places,)
            Twist (rad).

        Returns
        -------
        ndarray of shape (n_points, n_places)
            In 1/m.
        """
        d = (self.xx * self.yy - self.xy**2) * chord**4 * self.modulus
        u, v = self._gradient(weak, strong, d)
        return -(v * np.cos(twist) + u * np.sin(twist))


@dataclass(frozen=True, eq=False)
class StructureByThickness:
    """The structure of sections whose thickness over chord is designed, linear between stations.

    thickness[n_sections] is that of the sections, which increases; numbers is a spline over it:
    area, xx, yy, xy and the coordinates of the points, as `Structure` has them. density (kg/m³) and
    modulus (Pa) are the material's.
    """

    thickness: np.ndarray
    numbers: CubicSpline
    density: float
    modulus: float = np.nan

    @classmethod
    def of(cls, thickness, outlines, density, modulus=np.nan, wall=None, given=None):
        """Return the structure of sections of a thickness[n_sections], which increases.

        Outlines between them are splines through theirs, at equal fractions of the chord, as are
        walls between the sections' (over the chord; None: solid sections), within their range.

        Parameters
        ----------
        thickness : ndarray of shape (n_sections,)
            Thickness over chord of the sections, increasing.
        outlines : sequence of Outline
            Those of the sections.
        density : float
            Density of the material (kg/m**3).
        modulus : float, optional
            Young's modulus of the material (Pa).
        wall : array_like of shape (n_sections,), optional
            Walls over the chord; None: solid sections.
        given : array_like of shape (n_sections, 1 or 4), optional
            As `Structure.of` takes it.

        Returns
        -------
        StructureByThickness
            Of the sections.
        """
        parts = [np.linspace(*ends, PARTS + 1) for ends in pairwise(thickness)]
        at = np.unique(np.concatenate(parts))
        along = over_thickness(thickness, [outline.resampled() for outline in outlines])(at)
        if wall is not None:
            wall = np.clip(over_thickness(thickness, wall)(at), np.min(wall), np.max(wall))
        given = None if given is None else over_thickness(thickness, given)(at)
        numbers, points = _tabulated([Outline.of_sides(*rows) for rows in along], wall, given, True)
        table = np.hstack((numbers, points.reshape(at.size, -1)))
        return cls(thickness, CubicSpline(at, table), float(density), modulus)

    def section_area(self, thickness, order=0):
        """Return the area over chord squared of a thickness, or its rate by it.

        Parameters
        ----------
        thickness : ndarray of shape (...)
            Thickness over chord.
        order : int
            1: its rate by the thickness.

        Returns
        -------
        ndarray of shape (...)
            The area, or its rate.
        """
        return self.numbers(thickness, order)[..., 0]

    def at(self, thickness):
        """Return the `Structure` of places with a thickness[n_places], and its rate by it.

        Parameters
        ----------
        thickness : ndarray of shape (n_places,)
            Thickness over chord.

        Returns
        -------
        structure, rate : Structure
            At the places.
        """
        structures = []
        for order in (0, 1):
            table = self.numbers(thickness, order)
            points = table[:, 4:].reshape(table.shape[0], 2, -1)
            structures.append(Structure(*table[:, :4].T, points, self.density, self.modulus))
        return tuple(structures)


def place_weights(n_stations):
    """Return the matrix (n_places, n_stations) from values at stations to those at places.

    The places are where stress is looked at: the stations, and others equally spaced between each
    two: about `PLACES` in all, and at least two in each interval. Between stations, values are
    linear.

    Parameters
    ----------
    n_stations : int
        Number of stations.

    Returns
    -------
    ndarray of shape (n_places, n_stations)
        Rows that sum to one.
    """
    parts = max(3, -(-PLACES // max(n_stations - 1, 1)))
    at = np.arange((n_stations - 1) * parts + 1)[:, None] / parts
    return np.maximum(1.0 - np.abs(at - np.arange(n_stations)), 0.0)


def norm(values, exponent=EXPONENT):
    """Return a smooth largest value over the last axis, of those above zero, and its derivatives.

    (sum x^p)^(1/p) over them: homogeneous, never below the largest and at most n^(1/p) times it,
    for n equal values.

    Parameters
    ----------
    values : ndarray of shape (..., n)
        Loads of either sign.
    exponent : int
        Exponent of the norm that stands for the largest.

    Returns
    -------
    smooth : ndarray of shape (...)
        The norm; 0 where no value is above zero.
    share : ndarray of shape (..., n)
        Its derivatives.
    """
    largest = np.maximum(np.max(np.real(values), axis=-1), 0.0)
    ratio = values / np.where(largest > 0.0, largest, 1.0)[..., None]
    near = np.real(ratio) > np.exp(-40.0 / exponent)  # the others are below the last digit
    power = np.zeros_like(ratio)
    power[near] = ratio[near] ** (exponent - 1)
    total = np.where(largest > 0.0, np.sum(power * ratio, axis=-1), 1.0)
    return largest * total ** (1.0 / exponent), power * total[..., None] ** (1.0 / exponent - 1.0)


@compiled(error_model="numpy")
def _norms_around(u, v, added, points, moved, exponent):
    """Return the quantities of `Bending` for the stress x u + y v over the points of every outline.

    u, v and added, the stress besides, are [n_points, n_places]; points and their rates moved as in
    `Structure`. Returned are the `norm` with its derivatives by u, by v and by what moves the
    points, [4, n_points, n_places], and the largest.
    """
    slopes, largest = np.zeros((4, *u.shape), dtype=u.dtype), np.zeros(u.shape)
    negligible, most = np.exp(-40.0 / exponent), points.shape[2] ** (1.0 / exponent)
    for i in range(u.shape[0]):
        needed = 0.0
        for j in range(u.shape[1]):
            k = min(j, len(points) - 1)
            largest[i, j] = _largest(u[i, j], v[i, j], points[k])
            needed = max(needed, negligible * (largest[i, j] + added[i, j]))
        for j in range(u.shape[1]):
            k, top, u_here, v_here = min(j, len(points) - 1), largest[i, j], u[i, j], v[i, j]
            if top == 0.0:
                continue
            counts = most * top + added[i, j] > needed  # in the norm along the blade
            # else its farthest point alone
            p, near = (exponent, top * negligible) if counts else (1, (1.0 - 1e-12) * top)
            total = by_u = by_v = by_points = 0.0 * u_here
            for at in range(points.shape[2]):
                value = points[k, 0, at] * u_here + points[k, 1, at] * v_here
                if abs(value.real) > near:  # the others are below the last digit
                    ratio = value / (top if value.real > 0.0 else -top)
                    power = ratio ** (p - 1)
                    total += power * ratio
                    power = power if value.real > 0.0 else -power
                    by_u += power * points[k, 0, at]
                    by_v += power * points[k, 1, at]
                    by_points += power * (moved[k, 0, at] * u_here + moved[k, 1, at] * v_here)
                    if not counts:
                        break
            scale = total ** (1.0 / p - 1.0)
            slopes[0, i, j], slopes[1, i, j] = top * total * scale, by_u * scale
            slopes[2, i, j], slopes[3, i, j] = by_v * scale, by_points * scale
    return slopes, largest


@compiled(error_model="numpy", fastmath={"nnan", "nsz", "reassoc"})
def _largest(u, v, points):
    """Return the largest magnitude of x u + y v over points[2, n], by vector instructions."""
    largest = 0.0
    for at in range(points.shape[1]):
        largest = max(largest, abs((points[0, at] * u + points[1, at] * v).real))
    return largest


def material_section(outline, wall=None):
    """Return area, second moments and points[n, 2] of a solid or hollow section.

    Over powers of the chord, about the centroid of its material; the points are the outline's. wall
    is the thickness of the wall over the chord, None for a solid section.

    Parameters
    ----------
    outline : Outline
        Outline of the section.
    wall : float, optional
        Thickness of the wall over the chord; None: solid.

    Returns
    -------
    area : float
        Over chord squared.
    moments : tuple of float
        As `Outline.second_moments`.
    points : ndarray of shape (n, 2)
        Those of the outline from the centroid, over the chord.
    """
    material, hollow = outline, None if wall is None else outline.hollowed(wall)
    if hollow is not None:  # once round the outline, and back round the hollow
        outer, inner = outline.upper_first, hollow.upper_first[::-1]
        material = Outline(*np.concatenate((outer, outer[:1], inner, inner[:1])).T)
    points = np.column_stack((outline.x, outline.y)) - material.centroid
    return material.area, material.second_moments, points


def _tabulated(outlines, walls, given, same=False):
    """Return area and second moments (n, 4), or those given, and the `_governing` points."""
    walls = [None] * len(outlines) if walls is None else walls
    sections = [material_section(*pair) for pair in zip(outlines, walls, strict=True)]
    numbers = np.array([(area, *moments) for area, moments, _ in sections])
    if given is not None:
        numbers[:, : given.shape[1]] = given
    return numbers, _governing([points for _, _, points in sections], same)


def _governing(shapes, same=False):
    """Return the few points of each outline that can have the largest stress.

    In every direction of the stress' gradient their reach, of either sign, is that of the whole
    outline or up to `POINT_ERROR` more. The same directions are taken in all outlines; with `same`,
    the same points, where outlines have points at the same fractions of the chord. The shape is
    (n_outlines, 2, n_governing).
    """
    size = np.max([np.max(np.abs(points), axis=0) for points in shapes], axis=0)
    angle = np.linspace(0.0, np.pi, 721)[:-1]
    directions = np.array([np.cos(angle), np.sin(angle)]) / size[:, None]
    reaches = [np.abs(points @ directions) for points in shapes]
    reach = np.array([reaching.max(axis=0) for reaching in reaches])
    farthest = np.array([reaching.argmax(axis=0) for reaching in reaches])
    governing, covered = [], np.zeros(reach.shape)
    while (least := np.min(covered / reach)) < 1.0 - POINT_ERROR:
        if same:
            indices = [farthest.ravel()[np.argmin(covered / reach)]] * len(shapes)
        else:
            indices = farthest[:, np.argmin(np.min(covered / reach, axis=0))]
        points = [shape[index] for shape, index in zip(shapes, indices, strict=True)]
        governing.append(np.array(points))
        covered = np.maximum(covered, np.abs(governing[-1] @ directions))
    return np.stack(governing, axis=-1) / least
