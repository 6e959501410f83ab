"""Blade and rotor as solids of B-spline surfaces, in STEP (ISO 10303-21)."""

from collections.abc import Sequence
from io import BytesIO
from textwrap import wrap
from typing import Annotated, Any

import numpy as np
from OCP import BRepBuilderAPI as build
from OCP import collections as arrays
from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.BRep import BRep_Builder
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.BRepLib import BRepLib
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
from OCP.GProp import GProp_GProps
from OCP.Interface import Interface_Static
from OCP.Message import Message, Message_Gravity
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TCollection import TCollection_HAsciiString
from OCP.TopoDS import TopoDS, TopoDS_Compound
from pydantic import Field
from scipy.interpolate import BPoly, PchipInterpolator, make_interp_spline

from hkt_mdo.errors import InputError
from hkt_mdo.exports.solids import Solid, outline_volume
from hkt_mdo.results.design import Design

DEGREE = 3
"""Degree of the surfaces round the sections and along the span."""

SHARP = 1e-6
"""Thickness, m, below which a trailing edge is an edge of the solid, and above it a face."""

_MILLI = 1e3  # OpenCASCADE works in millimetres; the files are in metres

for printer in Message.DefaultMessenger_s().Printers():  # which print what is written, too
    printer.SetTraceLevel(Message_Gravity.Message_Fail)


class Step(Solid):
    """Blade and rotor as solids of B-spline surfaces, smooth along the span, in metres."""

    spanwise: Annotated[int, Field(ge=3, le=1000)] = 3
    """Smallest number of sections that the surface goes through; hub, stations and tip always."""

    def files(self, design: Design) -> dict[str, bytes]:
        remarks, count = self.remarks(design), design.blade.blade_count
        blade = self.solid(design, self.radii(design))
        rooted = blade if self.hub == "none" else self.solid(design, self.rooted(design))
        rotor = [turned(rooted, 2.0 * np.pi * n / count) for n in range(count)]
        if self.hub != "none":
            whole = cylinder(*self.cylinder(design))
            for solid in rotor:
                whole = BRepAlgoAPI_Fuse(whole, solid).Shape()
            rotor = [checked(whole)]
        remarks.append(
            f"volume of a blade from hub to tip: {solid_volume(blade):.6g} m**3; integral of the "
            f"outlines along the span: {outline_volume(design):.6g} m**3"
        )
        return {
            f"{name}.step": step_file(solids, name, remarks)
            for name, solids in (("blade", [blade]), ("rotor", rotor))
        }

    def solid(self, design: Design, r: np.ndarray) -> Any:
        """Return the closed solid of a blade.

        Parameters
        ----------
        design : Design
            The design.
        r : ndarray of shape (n_radii,)
            Radii of the sections that it goes through (m).

        Returns
        -------
        OCP.TopoDS.TopoDS_Solid
            In millimetres.

        Raises
        ------
        InputError
            If OpenCASCADE finds that it is no valid solid.
        """
        poles, knots = lofted(_MILLI * self.stations(design, r), r)
        surfaces = [spline_surface(poles, knots)]
        edge = poles[[-1, 0]]
        if np.max(np.linalg.norm(edge[1] - edge[0], axis=-1)) > _MILLI * SHARP:
            surfaces.append(spline_surface(edge, (np.array([0.0, 0.0, 1.0, 1.0]), knots[1])))
        sewing = build.BRepBuilderAPI_Sewing(_MILLI * SHARP)
        for surface in surfaces:
            sewing.Add(build.BRepBuilderAPI_MakeFace(surface, 1e-7).Face())
        for end in (r[0], r[-1]):
            wire = build.BRepBuilderAPI_MakeWire()
            for surface in surfaces:
                wire.Add(build.BRepBuilderAPI_MakeEdge(surface.VIso(float(end))).Edge())
            sewing.Add(build.BRepBuilderAPI_MakeFace(wire.Wire(), True).Face())
        sewing.Perform()
        shell = checked(sewing.SewedShape(), closed=sewing.NbFreeEdges() == 0)
        solid = build.BRepBuilderAPI_MakeSolid(TopoDS.Shell(shell)).Solid()
        BRepLib.OrientClosedSolid_s(solid)
        return checked(solid)


def checked(solid: Any, *, closed: bool = True) -> Any:
    """Return a solid, or its surface, as it is.

    Parameters
    ----------
    solid : OCP.TopoDS.TopoDS_Shape
        The solid.
    closed : bool
        Whether its surface is closed.

    Returns
    -------
    OCP.TopoDS.TopoDS_Shape
        The same.

    Raises
    ------
    InputError
        If it is not closed, or OpenCASCADE finds that it is not valid.
    """
    if not closed or not BRepCheck_Analyzer(solid).IsValid():
        problem = "OpenCASCADE makes no valid solid of this blade"
        remedy = "try other step.points or step.trailing_edge, no step.hub, or stl"
        raise InputError(problem, remedy, key="--to", value="step")
    return solid


def lofted(points: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Return control points and knots of the smooth surface through the points of sections.

    Round the sections it is a cubic spline; along the span a cubic without overshoot (Fritsch and
    Carlson's slopes) with a continuous first derivative.

    Parameters
    ----------
    points : ndarray of shape (n_radii, n_points, 3)
        Points of the sections.
    r : ndarray of shape (n_radii,)
        Their radii.

    Returns
    -------
    poles : ndarray of shape (n_points, 2 n_radii, 3)
        Control points, round the sections and along the span.
    knots : tuple of ndarray
        Knots in both directions, with their repetitions.
    """
    steps = np.linalg.norm(np.diff(points, axis=1), axis=2)
    around = np.append(0.0, np.cumsum(np.mean(steps / np.sum(steps, axis=1)[:, None], axis=0)))
    spline = make_interp_spline(around, points, k=DEGREE, axis=1)
    through = np.moveaxis(spline.c, 0, 1)
    pieces = BPoly.from_power_basis(PchipInterpolator(r, through)).c
    between = np.stack(pieces[1:3], axis=1).reshape(-1, *through.shape[1:])
    poles = np.concatenate((through[:1], between, through[-1:]))
    along = np.concatenate((r[:1], r[:1], np.repeat(r, 2), r[-1:], r[-1:]))
    return np.moveaxis(poles, 0, 1), (spline.t, along)


def spline_surface(poles: np.ndarray, knots: tuple[np.ndarray, np.ndarray]) -> Any:
    """Return a B-spline surface of OpenCASCADE.

    Parameters
    ----------
    poles : ndarray of shape (n_around, n_along, 3)
        Control points.
    knots : tuple of ndarray
        Knots in both directions, with their repetitions: as many more as the degree, and one.

    Returns
    -------
    OCP.Geom.Geom_BSplineSurface
        The surface.
    """
    net = arrays.Array2_gp_Pnt(1, poles.shape[0], 1, poles.shape[1])
    for index in np.ndindex(poles.shape[:2]):
        net.SetValue(index[0] + 1, index[1] + 1, gp_Pnt(*map(float, poles[index])))
    once = [np.unique(each, return_counts=True) for each in knots]
    values = [_array(arrays.Array1_double, each.tolist()) for each, _ in once]
    counts = [_array(arrays.Array1_int, each.tolist()) for _, each in once]
    degrees = (each.size - count - 1 for each, count in zip(knots, poles.shape[:2], strict=True))
    return Geom_BSplineSurface(net, *values, *counts, *degrees)


def _array(kind: Any, values: Sequence[Any]) -> Any:
    """Return an array of OpenCASCADE, whose indices begin with 1."""
    made = kind(1, len(values))
    for n, value in enumerate(values, start=1):
        made.SetValue(n, value)
    return made


def turned(solid: Any, angle: float) -> Any:
    """Return a solid turned about the shaft.

    Parameters
    ----------
    solid : OCP.TopoDS.TopoDS_Shape
        The solid.
    angle : float
        By the right-hand rule about x (rad).

    Returns
    -------
    OCP.TopoDS.TopoDS_Shape
        A copy.
    """
    rotation = gp_Trsf()
    rotation.SetRotation(gp.OX_s(), angle)
    return build.BRepBuilderAPI_Transform(solid, rotation, True).Shape()


def cylinder(begin: float, end: float, radius: float) -> Any:
    """Return a solid cylinder about the shaft.

    Parameters
    ----------
    begin, end : float
        Along the shaft (m).
    radius : float
        Radius (m).

    Returns
    -------
    OCP.TopoDS.TopoDS_Shape
        In millimetres.
    """
    axis = gp_Ax2(gp_Pnt(_MILLI * begin, 0.0, 0.0), gp_Dir(1.0, 0.0, 0.0))
    return BRepPrimAPI_MakeCylinder(axis, _MILLI * radius, _MILLI * (end - begin)).Shape()


def solid_volume(solid: Any) -> float:
    """Return the volume of a solid.

    Parameters
    ----------
    solid : OCP.TopoDS.TopoDS_Shape
        In millimetres.

    Returns
    -------
    float
        In m**3.
    """
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, properties, 1e-5)  # the default errs by 2 %
    return float(properties.Mass()) / _MILLI**3


def step_file(solids: Sequence[Any], name: str, remarks: Sequence[str]) -> bytes:
    """Return a STEP file of solids, in metres.

    Parameters
    ----------
    solids : sequence of OCP.TopoDS.TopoDS_Shape
        In millimetres.
    name : str
        What it is, which its product is called.
    remarks : sequence of str
        Lines for its header.

    Returns
    -------
    bytes
        The file.
    """
    shape, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(shape)
    for solid in solids:
        builder.Add(shape, solid)
    writer, content = STEPControl_Writer(), BytesIO()  # declares the settings
    before = _set({"write.step.unit": "M", "write.step.product.name": name})
    try:
        writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    finally:
        _set(before)
    header = APIHeaderSection_MakeHeader(writer.Model())
    lines = [part for line in remarks for part in wrap(line, 60)]
    texts = [TCollection_HAsciiString(x.encode("ascii", "replace").decode()) for x in lines]
    header.SetDescription(_array(arrays.HArray1_TCollection_HAsciiString, texts))
    header.SetName(TCollection_HAsciiString(f"{name}.step"))
    writer.WriteStream(content)
    return content.getvalue()


def _set(settings: dict[str, str]) -> dict[str, str]:
    """Change settings of OpenCASCADE, which are global, and return what they were."""
    before = {key: Interface_Static.CVal_s(key) for key in settings}
    for key, value in settings.items():
        Interface_Static.SetCVal_s(key, value)
    return before
