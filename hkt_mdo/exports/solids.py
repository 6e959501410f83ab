"""Blade and rotor as closed bodies, and the coordinates of their sections.

Axes of the rotor: x along the shaft, downstream; z along the first blade where it has no cone; y
completes a right-handed system. The origin is where the blades' axes meet the shaft.
"""

from __future__ import annotations

from abc import ABC
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field
from scipy.interpolate import make_interp_spline

from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Format, Source
from hkt_mdo.files.blade import read_blade
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.thickness import over_thickness
from hkt_mdo.sections import Quantity

if TYPE_CHECKING:
    from hkt_mdo.results.design import Design

TRAILING_EDGE = 0.005
"""Thickness of the trailing edge over the local chord, where none is given."""

_AXES = (
    "unit: metre",
    "x: along the shaft, downstream; z: along the first blade, before the cone; y = z cross x",
    "origin: where the axes of the blades meet the shaft",
)


class Stations(NamedTuple):
    """Sections of a blade at some radii, thickened at the trailing edge.

    plane[n_radii, n_points, 2] are the points of each (m) along the chord, towards the trailing
    edge, and across it, towards the suction side, both from the blade's axis; they run from the
    trailing edge over the suction side round to it. chord (m), twist (rad) and thickness (over the
    chord) are [n_radii].
    """

    r: np.ndarray
    chord: np.ndarray
    twist: np.ndarray
    thickness: np.ndarray
    plane: np.ndarray


class Outer(Format, ABC):
    """What all formats of the blade's outer surface have in common."""

    trailing_edge: Annotated[float, Quantity("m", ge=0)] | None = None
    """Thickness of the trailing edge: aft of its thickest place no section is thinner. Null: 0.5 %
    of the local chord; 0: as the outline has it."""
    stacking: Annotated[float, Quantity(ge=0, le=1)] = 0.25
    """Where the blade's axis meets the chord line, over the chord from the leading edge."""
    rotation: Literal["clockwise", "anticlockwise"] = "clockwise"
    """Sense of rotation, seen from upstream, looking along the flow."""
    points: Annotated[int, Field(ge=20, le=1000)] = 200
    """Number of points round a section."""

    def stations(self, design: Design, r: np.ndarray) -> Stations:
        """Return the sections at some radii.

        As mass and stress of the program have them: chord, twist and outline, or designed
        thickness, are linear between the blade's stations, and carried on to hub and tip.

        Parameters
        ----------
        design : Design
            The design, with outlines.
        r : ndarray of shape (n_radii,)
            Radii along the blade (m).

        Returns
        -------
        Stations
            The sections.

        Raises
        ------
        InputError
            If the trailing edge would be thicker than half of a section.
        """
        blade = design.blade
        chord, twist = (np.interp(r, blade.r, each) for each in (blade.chord, blade.twist))
        fractions = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, self.points // 2 + 1)))
        sides = np.array([outline.resampled(fractions) for outline in design.outlines])
        if blade.thickness is not None:
            at = np.interp(r, blade.r, blade.thickness)
            sides = over_thickness(design.turbine.structure.thickness, sides)(at)
        elif len(sides) == 1:
            sides = np.repeat(sides, r.size, axis=0)
        else:
            sides = make_interp_spline(blade.r, sides, k=1)(np.clip(r, blade.r[0], blade.r[-1]))
        x, upper, lower = np.moveaxis(sides, 1, 0)
        thickness = upper - lower
        largest = np.max(thickness, axis=1)
        least = TRAILING_EDGE if self.trailing_edge is None else self.trailing_edge / chord
        if np.any(least > 0.5 * largest):
            thin = int(np.argmin(largest * chord))
            problem = (
                f"is more than half the thickness of the section at r = {r[thin]:.4g} m, "
                f"{1e3 * largest[thin] * chord[thin]:.3g} mm"
            )
            raise InputError(
                problem,
                "give a thinner trailing edge",
                key=f"{self.name}.trailing_edge",
                value=f"{self.trailing_edge:g} m",
            )
        aft = np.arange(x.shape[1]) > np.argmax(thickness, axis=1)[:, None]
        least = np.broadcast_to(least, chord.shape)[:, None]
        grown = np.where(aft, 0.5 * np.maximum(least - thickness, 0.0), 0.0)
        along = np.hstack((x[:, ::-1], x[:, 1:])) - self.stacking
        across = np.hstack(((upper + grown)[:, ::-1], (lower - grown)[:, 1:]))
        plane = chord[:, None, None] * np.stack((along, across), axis=-1)
        return Stations(r, chord, twist, largest, plane)

    def placed(self, design: Design, sections: Stations) -> np.ndarray:
        """Return the points of sections of the first blade in the rotor's axes.

        Parameters
        ----------
        design : Design
            Gives the cone.
        sections : Stations
            The sections.

        Returns
        -------
        ndarray of shape (n_radii, n_points, 3)
            x, y and z (m).
        """
        along, across = np.moveaxis(sections.plane, -1, 0)
        sine, cosine = np.sin(sections.twist)[:, None], np.cos(sections.twist)[:, None]
        axial, backwards = along * sine + across * cosine, along * cosine - across * sine
        tilt, r = design.blade.cone, sections.r[:, None]
        x = axial * np.cos(tilt) - r * np.sin(tilt)
        z = axial * np.sin(tilt) + r * np.cos(tilt)
        return np.stack((x, backwards * (1.0 if self.rotation == "clockwise" else -1.0), z), -1)

    def remarks(self, source: Source) -> list[str]:
        """Return what a file says of its geometry: provenance, unit, axes, hand and options.

        Parameters
        ----------
        source : Source
            The result and its design.

        Returns
        -------
        list of str
            Lines for a comment.

        Raises
        ------
        InputError
            If the case gives no outline.
        """
        require_outlines(source)
        blade = source.design.blade
        edge = f"{1e3 * (self.trailing_edge or 0.0):g} mm"
        if self.trailing_edge is None:
            edge = f"{100.0 * TRAILING_EDGE:g} % of the local chord"
        return [
            *source.provenance,
            *_AXES,
            f"rotation: {self.rotation}, seen from upstream: about "
            f"{'+' if self.rotation == 'clockwise' else '-'}x by the right-hand rule",
            f"blades: {blade.blade_count}; hub radius {blade.hub_radius:.6g} m, tip radius "
            f"{blade.tip_radius:.6g} m along the blade; cone {np.rad2deg(blade.cone):.6g} deg, "
            "positive: tips upstream",
            "twist: from the rotor plane to the chord, set angle included; positive: the leading "
            "edge is turned upstream",
            f"blade's axis: at {self.stacking:g} of the chord from the leading edge",
            f"trailing edge: aft of the thickest place no section is thinner than {edge}",
        ]


class Sections(Outer):
    """Coordinates of the section at each station, one CSV file a station."""

    name = "sections"

    def files(self, source: Source) -> dict[str, bytes]:
        remarks, design = self.remarks(source), source.design
        sections = self.stations(design, design.blade.r)
        placed = self.placed(design, sections)
        found = {}
        for n, r in enumerate(sections.r):
            own = (
                f"station {n + 1} of {sections.r.size}: r = {r:.9g} m, chord = "
                f"{sections.chord[n]:.9g} m, twist = {np.rad2deg(sections.twist[n]):.9g} deg, "
                f"thickness = {sections.thickness[n]:.6g} of the chord, before the trailing edge "
                "is thickened",
                "chordwise_m: along the chord towards the trailing edge; across_m: towards the "
                "suction side; both from the blade's axis",
            )
            text = [f"# {line}" for line in (*remarks, *own)]
            text.append("x_m,y_m,z_m,chordwise_m,across_m")
            rows = np.hstack((placed[n], sections.plane[n]))
            text += [",".join(f"{value:.9g}" for value in row) for row in rows]
            found[f"sections/station_{n + 1:03d}.csv"] = ("\n".join(text) + "\n").encode()
        return found


class Solid(Outer, ABC):
    """What the formats of closed bodies have in common."""

    spanwise: Annotated[int, Field(ge=3, le=2000)] = 100
    """Smallest number of sections along the span; hub, stations and tip are always among them."""
    hub: bool = False
    """Whether the rotor has a hub: a cylinder of the hub's radius, into which its blades reach."""

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
        inner = (
            np.linspace(low, high, n, endpoint=False)
            for low, high, n in zip(edges[:-1], edges[1:], parts, strict=True)
        )
        return np.append(np.concatenate(list(inner)), edges[-1])

    def surface(self, source: Source, r: np.ndarray) -> np.ndarray:
        """Return the points of the first blade's sections in the rotor's axes.

        Parameters
        ----------
        source : Source
            The result and its design.
        r : ndarray of shape (n_radii,)
            Radii along the blade (m).

        Returns
        -------
        ndarray of shape (n_radii, n_points, 3)
            x, y and z (m).
        """
        return self.placed(source.design, self.stations(source.design, r))

    def reach(self, source: Source) -> float:
        """Return the radius from which blades begin that reach into a hub, so that no gap is left.

        Parameters
        ----------
        source : Source
            The result and its design.

        Returns
        -------
        float
            Radius along the blade (m).
        """
        hub = source.design.blade.hub_radius
        wide = np.max(np.abs(self.surface(source, np.array([hub]))[..., 1])) / hub
        return 0.95 * hub * float(np.sqrt(1.0 - min(wide, 0.8) ** 2))

    def cylinder(self, source: Source) -> tuple[float, float, float]:
        """Return the hub: a cylinder about the shaft that covers the roots of the blades.

        Parameters
        ----------
        source : Source
            The result and its design.

        Returns
        -------
        begin, end, radius : float
            Along the shaft, and about it (m).
        """
        blade = source.design.blade
        root = self.surface(source, np.array([self.reach(source), blade.hub_radius]))[..., 0]
        beyond = 0.1 * blade.hub_radius
        radius = blade.hub_radius * float(np.cos(blade.cone))
        return float(np.min(root)) - beyond, float(np.max(root)) + beyond, radius


class Stl(Solid):
    """Blade and rotor as closed surfaces of triangles, binary, in metres."""

    name = "stl"

    def files(self, source: Source) -> dict[str, bytes]:
        remarks, blade = self.remarks(source), source.design.blade
        r = self.radii(source.design)
        one = body = triangles(self.surface(source, r))
        if self.hub:
            body = triangles(self.surface(source, np.append(self.reach(source), r)))
        bodies = [body @ turn.T for turn in turns(blade.blade_count)]
        if self.hub:
            bodies.append(cylinder_triangles(*self.cylinder(source), self.points))
        remarks += [
            f"blade.stl: the first blade, closed at hub and tip, volume {volume(one):.6g} m**3; "
            f"{outline_volume(source):.6g} m**3 is the integral of the outlines along the span",
            f"rotor.stl: {len(bodies)} closed bodies, volumes (m**3) "
            + ", ".join(f"{volume(each):.6g}" for each in bodies)
            + (": the blades, which reach into the hub, and the hub" if self.hub else ""),
        ]
        header = f"Binary STL, metres, {source.provenance[0]}"
        return {
            "blade.stl": binary_stl(one, header),
            "rotor.stl": binary_stl(np.concatenate(bodies), header),
            "stl.txt": ("\n".join(remarks) + "\n").encode(),
        }


def require_outlines(source: Source) -> None:
    """Refuse a result whose case has polars of its own without the outlines that belong to them.

    The program then takes another outline, stretched, for mass and stress only.

    Parameters
    ----------
    source : Source
        The result.

    Raises
    ------
    InputError
        If a section has no outline.
    """
    rotor, key = source.solution.case.rotor, ""
    if rotor.outline is not None:
        return
    lacking = [n for n, each in enumerate(rotor.sections) if each.outline is None]
    if lacking:
        key = f"rotor.sections[{lacking[0]}].outline"
    elif not rotor.sections and rotor.polar is not None:
        key = "rotor.outline"
    elif not rotor.sections and rotor.chord is None:
        of_file = read_blade(rotor.blade, hub_radius=0.0).sections
        key = "rotor.outline" if any(each.outline_x is None for each in of_file) else ""
    if key:
        problem = "is not given: the polars alone do not say the shape of the sections"
        remedy = "give the outline in the case and run it again"
        raise InputError(problem, remedy, file=source.solution.folder, key=key)


def outline_volume(source: Source) -> float:
    """Return the integral of the outlines' area along one blade, as the program's mass has it.

    Parameters
    ----------
    source : Source
        The result and its design.

    Returns
    -------
    float
        Volume before the trailing edge is thickened (m**3).
    """
    design, blade = source.design, source.design.blade
    area = np.array([outline.area for outline in design.outlines])
    if blade.thickness is not None:
        area = over_thickness(design.turbine.structure.thickness, area)(blade.thickness)
    return float(mass_and_inertia(blade, area, 1.0).mass) / blade.blade_count


def turns(count: int) -> list[np.ndarray]:
    """Return the rotations about the shaft from the first blade to each.

    Parameters
    ----------
    count : int
        Number of blades.

    Returns
    -------
    list of ndarray of shape (3, 3)
        The first one is the identity.
    """
    found = []
    for angle in 2.0 * np.pi * np.arange(count) / count:
        sine, cosine = np.sin(angle), np.cos(angle)
        found.append(np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]]))
    return found


def triangles(points: np.ndarray) -> np.ndarray:
    """Return the closed surface through sections: skin, trailing edge, and a cap at either end.

    Parameters
    ----------
    points : ndarray of shape (n_radii, n_points, 3)
        Points of the sections, from the trailing edge round to it.

    Returns
    -------
    ndarray of shape (n_triangles, 3, 3)
        Corners, with normals outwards; none is a point or a line.
    """
    n_radii, n = points.shape[:2]
    index = np.arange(n_radii * n).reshape(n_radii, n)
    ring = np.hstack((index, index[:, :1]))
    half = np.arange(n // 2)
    quads = [np.stack((ring[:-1, :-1], ring[:-1, 1:], ring[1:, 1:], ring[1:, :-1]), -1)]
    for end in (index[0], index[-1, ::-1]):
        quads.append(np.stack((end[half], end[-1 - half], end[-2 - half], end[half + 1]), -1))
    corners = np.concatenate([quad.reshape(-1, 4) for quad in quads])
    found = points.reshape(-1, 3)[np.concatenate((corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]))]
    return _oriented(found)


def cylinder_triangles(begin: float, end: float, radius: float, count: int) -> np.ndarray:
    """Return a closed cylinder about the shaft.

    Parameters
    ----------
    begin, end : float
        Along the shaft (m).
    radius : float
        Radius (m).
    count : int
        Number of its sides.

    Returns
    -------
    ndarray of shape (n_triangles, 3, 3)
        Corners, with normals outwards.
    """
    angle = 2.0 * np.pi * np.arange(count) / count
    ring = np.column_stack((np.full(count, begin), radius * np.cos(angle), radius * np.sin(angle)))
    rings = np.stack((ring, ring + np.array([end - begin, 0.0, 0.0])))
    following = np.roll(rings, -1, axis=1)
    axis = np.zeros_like(rings)
    axis[..., 0] = rings[..., 0]
    parts = (
        (rings[0], following[0], following[1]),
        (rings[0], following[1], rings[1]),
        (axis[0], following[0], rings[0]),
        (axis[1], rings[1], following[1]),
    )
    return _oriented(np.concatenate([np.stack(part, axis=1) for part in parts]))


def _oriented(corners: np.ndarray) -> np.ndarray:
    """Return triangles as single precision has them, normals outwards, without degenerate ones."""
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
    facets = np.zeros(
        len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    )
    facets["normal"] = normal / np.where(length > 0.0, length, 1.0)
    facets["corners"] = corners
    first = header.encode("ascii", "replace")[:80].ljust(80)
    return first + np.uint32(len(corners)).astype("<u4").tobytes() + facets.tobytes()
