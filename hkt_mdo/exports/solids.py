"""Blade and rotor as closed bodies, and the coordinates of their sections.

Axes of the rotor: x along the shaft, downstream; z along the first blade where it has no cone; y
completes a right-handed system. The origin is where the blades' axes meet the shaft.
"""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from hkt_mdo.dynamics.radau import divided
from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Format, filled, provenance
from hkt_mdo.files.table import csv_text
from hkt_mdo.results.design import Design
from hkt_mdo.results.sections import STACKING, around, outline_names, sides
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.sections import Quantity

_COORDINATES = "x_m", "y_m", "z_m", "chordwise_m", "across_m"
TRAILING_EDGE = 0.005
"""Thickness of the trailing edge over the local chord, where none is given."""


class Outer(Format):
    """What all formats of the blade's outer surface have in common."""

    trailing_edge: Annotated[float, Quantity("m", ge=0)] | None = None
    """Thickness of the trailing edge; aft of its thickest place no section is thinner. Null: 0.5 %
    of the local chord; 0: as the outline has it."""
    stacking: Annotated[float, Quantity(ge=0, le=1)] = STACKING
    """Place of the blade's axis on the chord line, over the chord from the leading edge."""
    rotation: Literal["clockwise", "anticlockwise"] = "clockwise"
    """Sense of rotation, seen from upstream, looking along the flow."""
    points: Annotated[int, Field(ge=20, le=1000)] = 200
    """Number of points round a section."""

    def plane(self, design: Design, r: np.ndarray) -> np.ndarray:
        """Return the sections at some radii in their planes, thickened at the trailing edge.

        As mass and stress of the program have them: chord, twist and outline, or designed
        thickness, are linear between the blade's stations, and constant from there to hub and tip.

        Parameters
        ----------
        design : Design
            The design, with outlines.
        r : ndarray of shape (n_radii,)
            Radii along the blade (m).

        Returns
        -------
        ndarray of shape (n_radii, n_points, 2)
            Points (m) along the chord, towards the trailing edge, and across it, towards the
            suction side, both from the blade's axis; from the trailing edge over the suction side
            round to it.

        Raises
        ------
        InputError
            If the trailing edge would be thicker than half of a section.
        """
        chord = np.interp(r, design.blade.r, design.blade.chord)
        fractions = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, self.points // 2 + 1)))
        x, upper, lower = sides(design.turbine, r, fractions)
        thickness = upper - lower
        largest = np.max(thickness, axis=1)
        least = TRAILING_EDGE if self.trailing_edge is None else self.trailing_edge / chord
        least = np.broadcast_to(least, chord.shape)
        thin = int(np.argmax(least / largest))
        if least[thin] > 0.5 * largest[thin]:
            edge, whole = (1e3 * chord[thin] * x[thin] for x in (least, largest))
            problem = f"is more than half of the section's {whole:.3g} mm at r = {r[thin]:.4g} m"
            key = f"{type(self).__name__.lower()}.trailing_edge"
            raise InputError(problem, "give a thinner one", key=key, value=f"{edge:.3g} mm")
        aft = np.arange(x.shape[1]) > np.argmax(thickness, axis=1)[:, None]
        grown = np.where(aft, 0.5 * np.maximum(least[:, None] - thickness, 0.0), 0.0)
        plane = around(x, upper + grown, lower - grown) - (self.stacking, 0.0)
        return plane * chord[:, None, None]

    def stations(self, design: Design, r: np.ndarray) -> np.ndarray:
        """Return the sections of `plane` on the first blade.

        Parameters
        ----------
        design : Design
            The design, with outlines.
        r : ndarray of shape (n_radii,)
            Radii along the blade (m).

        Returns
        -------
        ndarray of shape (n_radii, n_points, 3)
            Their points in the rotor's axes (m).
        """
        along, across = np.moveaxis(self.plane(design, r), -1, 0)
        tilt, twist = design.blade.cone, np.interp(r, design.blade.r, design.blade.twist)
        sine, cosine = np.sin(twist)[:, None], np.cos(twist)[:, None]
        axial, backwards = along * sine + across * cosine, along * cosine - across * sine
        x = axial * np.cos(tilt) - r[:, None] * np.sin(tilt)
        y = backwards * (1.0 if self.rotation == "clockwise" else -1.0)
        return np.stack((x, y, axial * np.sin(tilt) + r[:, None] * np.cos(tilt)), -1)

    def remarks(self, design: Design) -> list[str]:
        """Return remarks on the geometry: provenance, unit, axes, sense of rotation and options.

        Parameters
        ----------
        design : Design
            The design of a result.

        Returns
        -------
        list of str
            Lines for a comment.

        Raises
        ------
        InputError
            If the case gives no outline.
        """
        words = {
            "outlines": outline_names(design.solution, design.turbine),  # refuses if none
            "options": self,
            "cone": np.rad2deg(design.blade.cone),
            "thin": TRAILING_EDGE,
        }
        return filled("solids.txt", design, words).splitlines()


class Sections(Outer):
    """Coordinates of the section at each station, one CSV file a station."""

    def files(self, design: Design) -> dict[str, str]:
        remarks, blade, contents = self.remarks(design), design.blade, {}
        stations, plane = self.stations(design, blade.r), self.plane(design, blade.r)
        across = plane[..., 1]  # over the upper side and back: opposite points are equally far
        thickness = np.max(across - across[:, ::-1], axis=1) / blade.chord
        for n, points in enumerate(np.concatenate((stations, plane), axis=-1)):
            remarks_of_station = (
                f"station {n + 1} of {blade.r.size}: r = {blade.r[n]:.9g} m, chord = "
                f"{blade.chord[n]:.9g} m, twist = {np.rad2deg(blade.twist[n]):.9g} deg, "
                f"thickness = {thickness[n]:.6g} of the chord, before the trailing edge "
                "is thickened",
                "chordwise_m: along the chord towards the trailing edge; across_m: towards the "
                "suction side; both from the blade's axis",
            )
            rows = ([f"{value:.9g}" for value in row] for row in points)
            text = csv_text(_COORDINATES, rows, (*remarks, *remarks_of_station))
            contents[f"sections/station_{n + 1:03d}.csv"] = text
        return contents


class Solid(Outer):
    """What the formats of closed bodies have in common."""

    spanwise: Annotated[int, Field(ge=3, le=1000)] = 100
    """Smallest number of sections along the span; hub, stations and tip are always among them."""
    hub: Literal["none", "cylinder"] = "none"
    """Hub of the rotor; the blades reach into a cylinder, which has the hub's radius."""

    def radii(self, design: Design) -> np.ndarray:
        """Return the radii of the sections from hub to tip.

        Parameters
        ----------
        design : Design
            The design.

        Returns
        -------
        ndarray of shape (n_radii,)
            Radii along the blade (m).
        """
        edges = design.blade.edges
        parts = np.ceil(np.diff(edges) / np.ptp(edges) * (self.spanwise - 1)).astype(int)
        return divided(edges, parts)

    def rooted(self, design: Design) -> np.ndarray:
        """Return radii with one before them at which a blade is inside the hub, without a gap.

        Parameters
        ----------
        design : Design
            The design.

        Returns
        -------
        ndarray of shape (n_radii + 1,)
            Radii along the blade (m); those of `radii` for a rotor without a hub.
        """
        r = self.radii(design)
        if self.hub == "none":
            return r
        wide = np.max(np.abs(self.stations(design, r[:1])[..., 1])) / r[0]
        return np.append(0.95 * r[0] * np.sqrt(1.0 - min(wide, 0.8) ** 2), r)

    def cylinder(self, design: Design) -> tuple[float, float, float]:
        """Return the hub: a cylinder about the shaft that covers the roots of the blades.

        Parameters
        ----------
        design : Design
            The design.

        Returns
        -------
        begin, end, radius : float
            Along the shaft, and about it (m).
        """
        hub, cone = design.blade.hub_radius, design.blade.cone
        root = self.stations(design, self.rooted(design)[:2])[..., 0]
        begin, end = np.min(root) - 0.1 * hub, np.max(root) + 0.1 * hub
        return float(begin), float(end), hub * float(np.cos(cone))


class Stl(Solid):
    """Blade and rotor as closed surfaces of triangles, binary, in metres."""

    def rotor(self, design: Design) -> list[np.ndarray]:
        """Return the closed bodies of a rotor: its blades and, last, a hub if it has one.

        Parameters
        ----------
        design : Design
            The design.

        Returns
        -------
        list of ndarray of shape (n_triangles, 3, 3)
            Corners of the triangles in the rotor's axes (m).
        """
        count = design.blade.blade_count
        rooted = triangles(self.stations(design, self.rooted(design)))
        angles = 2.0 * np.pi * np.arange(count)[:, None] / count
        bodies = [rooted @ turn.T for turn in Rotation.from_euler("x", angles).as_matrix()]
        if self.hub != "none":
            begin, end, radius = self.cylinder(design)
            angle = np.linspace(0.0, 2.0 * np.pi, self.points + 1)[:-1]
            x, circle = np.full(angle.size, 1.0), radius * np.array([np.cos(angle), np.sin(angle)])
            rings = [np.column_stack((at * x, *circle)) for at in (begin, end)]
            bodies.append(triangles(np.array(rings)))
        return bodies

    def files(self, design: Design) -> dict[str, str | bytes]:
        remarks, solution = self.remarks(design), design.solution
        blade = triangles(self.stations(design, self.radii(design)))
        bodies = self.rotor(design)
        whole = "" if self.hub == "none" else ": blades and, last, hub"
        remarks += [
            f"blade.stl: the first blade, closed at hub and tip, volume {volume(blade):.6g} m**3; "
            f"integral of the outlines along the span: {outline_volume(design):.6g} m**3",
            f"rotor.stl: {len(bodies)} closed bodies, volumes (m**3) "
            f"{', '.join(f'{volume(body):.6g}' for body in bodies)}{whole}",
        ]
        mark = "" if solution.success else ", THE RUN WAS NO SUCCESS"
        header = f"STL in metres{mark}, {provenance(solution)[0]}"
        return {
            "blade.stl": binary_stl(blade, header),
            "rotor.stl": binary_stl(np.concatenate(bodies), header),
            "stl.txt": "\n".join(remarks) + "\n",
        }


class Airfoil(NamedTuple):
    """An airfoil of a blade.

    Attributes
    ----------
    polars : tuple of Polar
        Its polar, or those of the Reynolds numbers.
    outline : Outline
        Its outline. Where the thickness is designed, both sides are splines over the thickness
        through those of the sections, as the structure has them.
    stations : list of int
        The stations that have it.
    """

    polars: tuple[Polar, ...]
    outline: Outline
    stations: list[int]


def airfoils(design: Design) -> list[Airfoil]:
    """Return the airfoils of a blade, each once: stations that share polars and shape have one.

    Parameters
    ----------
    design : Design
        The design of a result.

    Returns
    -------
    list of Airfoil
        From hub to tip.
    """
    outlines, r = design.turbine.outlines, design.blade.r
    if design.plant.polar.follows_thickness:
        outlines = tuple(Outline(*points.T) for points in around(*sides(design.turbine, r)))
    by_kind: dict[tuple, Airfoil] = {}
    for station, polars in enumerate(design.plant.polar.stations(design.blade)):
        outline = outlines[station % len(outlines)]
        kind = (*polars, outline.thickness, outline.area)
        by_kind.setdefault(kind, Airfoil(polars, outline, [])).stations.append(station)
    return list(by_kind.values())


def outline_volume(design: Design) -> float:
    """Return the integral of the outlines' area along one blade, as the program's mass has it.

    Parameters
    ----------
    design : Design
        The design.

    Returns
    -------
    float
        Volume before the trailing edge is thickened (m**3).
    """
    turbine, blade = design.turbine, design.blade
    area = turbine.along_span([outline.area for outline in turbine.outlines], blade.r)
    return float(mass_and_inertia(blade, area, 1.0).mass) / blade.blade_count


def triangles(points: np.ndarray) -> np.ndarray:
    """Return the closed surface through plane sections, with a cap at either end.

    Parameters
    ----------
    points : ndarray of shape (n_sections, n_points, 3)
        Points of the sections, once round. The caps join the first and the last point, the second
        and the last but one, and so on.

    Returns
    -------
    ndarray of shape (n_triangles, 3, 3)
        Corners in single precision, normals outwards, without triangles that are points or lines.
    """
    n_sections, n = points.shape[:2]
    index = np.arange(n_sections * n).reshape(n_sections, n)
    ring, half = np.hstack((index, index[:, :1])), np.arange((n - 1) // 2)
    quads = [np.stack((ring[:-1, :-1], ring[:-1, 1:], ring[1:, 1:], ring[1:, :-1]), -1)]
    for end in (index[0], index[-1, ::-1]):
        quads.append(np.stack((end[half], end[-1 - half], end[-2 - half], end[half + 1]), -1))
    four = np.concatenate([quad.reshape(-1, 4) for quad in quads])
    corners = points.reshape(-1, 3)[np.concatenate((four[:, [0, 1, 2]], four[:, [0, 2, 3]]))]
    corners = corners.astype(np.float32).astype(float)
    same = [np.all(corners[:, i] == corners[:, i - 1], axis=1) for i in range(3)]
    corners = corners[~np.any(same, axis=0)]
    return corners if volume(corners) > 0.0 else corners[:, ::-1]


def volume(corners: np.ndarray) -> float:
    """Return the volume that a closed surface of triangles encloses.

    Parameters
    ----------
    corners : ndarray of shape (n_triangles, 3, 3)
        Corners of the triangles (m).

    Returns
    -------
    float
        In m**3; positive where the normals point outwards.
    """
    one, two, three = np.moveaxis(corners, 1, 0)
    return float(np.sum(one * np.cross(two, three))) / 6.0


def binary_stl(corners: np.ndarray, header: str) -> bytes:
    """Return a binary STL file.

    Parameters
    ----------
    corners : ndarray of shape (n_triangles, 3, 3)
        Corners of the triangles (m), anticlockwise seen from outside.
    header : str
        Its first 80 characters; must not begin with ``solid``, which marks a text file.

    Returns
    -------
    bytes
        The file.
    """
    one, two, three = np.moveaxis(corners, 1, 0)
    normal = np.cross(two - one, three - one)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    facet = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    facets = np.zeros(len(corners), dtype=facet)
    facets["normal"] = normal / np.where(length > 0.0, length, 1.0)
    facets["corners"] = corners
    first = header.encode("ascii", "replace")[:80].ljust(80)
    return first + np.uint32(len(corners)).astype("<u4").tobytes() + facets.tobytes()
