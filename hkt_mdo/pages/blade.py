"""The blades of results as solids that can be turned, as a picture, and their sections."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Source
from hkt_mdo.exports.solids import Stl, triangles
from hkt_mdo.pages.panels import FAINT, Chart, Labelled, Look, escaped, line
from hkt_mdo.results import style
from hkt_mdo.results.sections import outline_names
from hkt_mdo.results.shown import AXIS, SHOWN

SOLIDS = Stl(spanwise=44, points=48), Stl(spanwise=20, points=24)
"""Sections and points of the solids of few results and of many, beside their stations."""
FEW = 4
APART = 1.35
"""Distance from one blade to the next one over its width."""
EYE, LIGHT = np.array([-0.25, -1.0, 0.8]), np.array([-0.4, 0.3, 0.87])
"""Where the picture is seen and lighted from; x along the blade, y across it, z upstream."""


class Body(NamedTuple):
    """A blade: its name, the corners[n_triangles, 3, 3] of its surface (m), its colour.

    sections[n_shown, n_points, 2] are those at `SHOWN`, along and across the chord (m).
    """

    name: str
    corners: np.ndarray
    color: str
    sections: np.ndarray


def bodies(labelled: Sequence[Labelled]) -> tuple[list[Body], list[str]]:
    """Return the blades of results, each start once behind them, and why others are not there.

    Parameters
    ----------
    labelled : sequence of Labelled
        The results.

    Returns
    -------
    found : list of Body
        In axes of which x is along the blade, y in the rotor plane, z along the shaft, upstream.
    reasons : list of str
        A line for each result whose blade is not known as a solid.
    """
    found: list[Body] = []
    starts: list[Body] = []
    reasons: list[str] = []
    known: list[np.ndarray] = []
    for index, each in enumerate(labelled):
        try:
            source = Source(each.solution)
            outline_names(each.solution)  # refuses where the polars have no outline of their own
            color = Look.of(index, each).color
            start, kind = _start(source.design, each.solution), SOLIDS[len(labelled) > FEW]
            name = each.label or ("blade" if start is None else "optimized blade")
            found.append(_body(source.design, kind, name, color))
            if start is None:
                continue
            shape = np.stack((start.blade.r, start.blade.chord, start.blade.twist))
            if not any(np.array_equal(shape, other) for other in known):
                known.append(shape)
                name = "blade at the start" + (f" of {each.label}" if starts else "")
                starts.append(_body(start, kind, name, FAINT))
        except InputError as error:
            reasons.append(f"{each.label or each.solution.name}: {error}")
    return [*found, *starts], reasons


def _start(design: Any, solution: Any) -> Any:
    """Return the design with the blade at the start; None if that is not known, or the same."""
    summary, before = solution.summary, design.physics.blade
    if summary.start_chord_m is None or summary.start_twist_deg is None:
        return None
    shape = np.array(summary.start_chord_m), np.deg2rad(summary.start_twist_deg)
    if np.allclose(shape, (design.blade.chord, design.blade.twist)):
        return None
    return replace(design, blade=before.with_shape(*shape, before.thickness))


def _body(design: Any, kind: Stl, name: str, color: str) -> Body:
    # the rotor's axes turned about y
    corners = triangles(kind.surface(design, kind.radii(design)))[..., [2, 1, 0]] * (1, 1, -1)
    hub, tip = design.blade.hub_radius, design.blade.tip_radius
    radii = hub + np.array(SHOWN) * (tip - hub)
    return Body(name, corners, color, SOLIDS[0].stations(design, radii).plane)


def _beside(found: Sequence[Body]) -> list[np.ndarray]:
    """Return the corners of blades that lie beside one another."""
    widths = np.array([np.ptp(each.corners[..., 1]) for each in found])
    ends = np.cumsum(APART * widths)
    return [
        each.corners - (0.0, end - 0.5 * width + np.mean(each.corners[..., 1]), 0.0)
        for each, end, width in zip(found, ends, widths, strict=True)
    ]


def solid(found: Sequence[Body]) -> Chart:
    """Return the blades as one scene that can be turned, one beside the other.

    Parameters
    ----------
    found : list of Body
        The blades.

    Returns
    -------
    dict
        The chart.
    """
    data = []
    for body, corners in zip(found, _beside(found), strict=True):
        points, place = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        corner = place.reshape(-1, 3).T
        mesh = {axis: _packed(x, "f4") for axis, x in zip("xyz", points.T, strict=True)}
        kind = "u2" if len(points) < 2**16 else "u4"
        mesh |= {key: _packed(x, kind) for key, x in zip("ijk", corner, strict=True)}
        look = {"color": body.color, "flatshading": False, "hoverinfo": "name"}
        # faces of a few mm have normals, too
        exact = {"vertexnormalsepsilon": 0, "facenormalsepsilon": 0}
        light = {"ambient": 0.45, "diffuse": 0.7, "specular": 0.3, "roughness": 0.4} | exact
        data.append(
            {"type": "mesh3d", "name": escaped(body.name), "showlegend": True}
            | mesh
            | look
            | {"lighting": light, "lightposition": {"x": -2000, "y": 1500, "z": 4000}}
        )
    whole = np.concatenate([corners.reshape(-1, 3) for corners in _beside(found)])
    extent = np.ptp(whole, axis=0)
    ratio = extent / max(extent[0], 0.9 * extent[1])
    quiet, eye = {"visible": False}, {"x": -0.7, "y": -2.2, "z": 1.8}
    scene = {"aspectmode": "manual", "dragmode": "orbit", "yaxis": quiet, "zaxis": quiet}
    along = {"title": {"text": "radius (m)"}, "nticks": 6, "showbackground": False}
    scene |= {"xaxis": along, "camera": {"eye": eye, "center": {"x": 0.0, "y": 0.0, "z": -0.3}}}
    scene["aspectratio"] = dict(zip("xyz", ratio.tolist(), strict=True))
    return {"data": data, "layout": {"height": 300 + 60 * len(found), "scene": scene}}


def _packed(values: np.ndarray, kind: str) -> dict[str, str]:
    """Return an array as plotly.js reads it from base64."""
    data = values.astype(f"<{kind}").tobytes()
    return {"dtype": kind, "bdata": base64.b64encode(data).decode()}


def picture(found: Sequence[Body]) -> bytes:
    """Return a PNG of the blades, one beside the other, for a browser that cannot turn them.

    Parameters
    ----------
    found : sequence of Body
        The blades.

    Returns
    -------
    bytes
        With a transparent ground.
    """
    toward = EYE / np.linalg.norm(EYE)
    right = np.cross((0.0, 0.0, 1.0), toward)
    right /= np.linalg.norm(right)
    axes = np.stack((-right if right[0] < 0.0 else right, np.cross(toward, right), toward), -1)
    figure = Figure(figsize=(9.0, 1.1 + 0.9 * len(found)), layout="constrained")
    ax = figure.add_subplot()
    for body, corners in zip(found, _beside(found), strict=True):
        seen = corners @ axes
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        facing = normal @ toward
        order = np.argsort(seen[:, :, 2].mean(axis=1))
        order = order[facing[order] > 0.0]
        color = np.array([int(body.color[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
        light = 0.5 + 0.5 * np.clip(normal[order] @ LIGHT, 0.0, 1.0)[:, None]
        faces = np.clip(color * light + 0.3 * light**12, 0.0, 1.0)
        ax.add_collection(PolyCollection(seen[order, :, :2], facecolors=faces, edgecolors=faces))
        points = seen[..., :2].reshape(-1, 2)
        tip = points[np.argmax(points[:, 0])]
        words = "  " + body.name.replace("$", r"\$")
        ax.text(tip[0], tip[1], words, color="0.5", fontsize=1.5 * style.FONT_SIZE, va="center")
    ax.set_aspect("equal")
    ax.autoscale_view()
    begin, end = ax.get_xlim()
    ax.set_xlim(begin, end + 0.018 * max(len(each.name) for each in found) * (end - begin))
    ax.set_axis_off()
    figure.patch.set_alpha(0.0)
    return style.png(figure)


def sections(found: Sequence[Body]) -> Chart:
    """Return some sections of the blades, to scale, one below the other, with the blade's axis.

    Parameters
    ----------
    found : list of Body
        The blades.

    Returns
    -------
    dict
        The chart.
    """
    data: list[dict[str, Any]] = []
    notes: list[dict[str, Any]] = []
    thick = max(np.ptp(each.sections[..., 1]) for each in found)
    for row, place in enumerate(SHOWN):
        down = -1.9 * row * thick
        for body in found:
            x, y = np.append(body.sections[row], body.sections[row][:1], axis=0).T
            start = body.color == FAINT
            dash = {"dash": "dot"} if start else {}
            trace = line(x, y + down, escaped(body.name), body.color, showlegend=row == 0, **dash)
            if not start and len(found) <= 2:
                trace |= {"fill": "toself", "fillcolor": f"{body.color}18"}
            data.append(trace | {"hoverinfo": "name"})
        axis = line([0.0], [down], AXIS, FAINT, mode="markers")
        mark = {"symbol": "cross-thin-open", "size": 9, "color": FAINT}
        data.append(axis | {"marker": mark, "showlegend": row == 0, "hoverinfo": "name"})
        at = {"x": 0, "xref": "paper", "xanchor": "left", "y": down + 0.75 * thick}
        words = {"text": f"{100.0 * place:g} % of the span", "font": {"size": 12}}
        notes.append(at | words | {"showarrow": False, "yanchor": "bottom"})
    across = {"scaleanchor": "x", "showticklabels": False, "showgrid": False, "zeroline": False}
    layout = {"height": 430, "annotations": notes, "hovermode": "closest", "yaxis": across}
    layout["xaxis"] = {"title": {"text": "along the chord (m)"}, "zeroline": False}
    return {"data": data, "layout": layout}
