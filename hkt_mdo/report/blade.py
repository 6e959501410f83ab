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
from hkt_mdo.exports.solids import Stl, outline_names, triangles
from hkt_mdo.report.charts import FAINT, Chart, Look, Told, escaped
from hkt_mdo.results import style

SOLID = Stl(spanwise=44, points=48)
"""Sections and points of a solid in a report, beside its stations."""
APART = 1.35
"""Distance of two blades over the width of the widest one."""
SHOWN = 0.25, 0.5, 0.75
"""Places of the sections that are shown, from hub to tip."""
EYE = np.array([-0.25, -1.0, 0.8])
"""Where the picture is seen from; x along the blade, y across it in the rotor plane."""


class Body(NamedTuple):
    """A blade: its name, the corners[n_triangles, 3, 3] of its surface (m), its colour.

    sections[n_shown, n_points, 2] are those at `SHOWN`, along and across the chord (m).
    """

    name: str
    corners: np.ndarray
    color: str
    sections: np.ndarray


def bodies(told: Sequence[Told]) -> tuple[list[Body], list[str]]:
    """Return the blades of results, each start once behind them, and why others are not there.

    Parameters
    ----------
    told : sequence of Told
        The results.

    Returns
    -------
    found : list of Body
        In axes of which x is along the blade, y in the rotor plane, z along the shaft.
    reasons : list of str
        A line for each result whose blade is not known as a solid.
    """
    found, starts, reasons, known = [], [], [], []
    for index, each in enumerate(told):
        try:
            source = Source(each.solution)
            outline_names(source)  # refuses where the polars have no outline of their own
            color = Look.of(index, each).color
            found.append(_body(source.design, each.label or "optimized blade", color))
            start = _start(source.design, each.solution)
            shape = None if start is None else (start.blade.chord, start.blade.twist)
            if start is not None and not any(np.array_equal(shape, other) for other in known):
                known.append(shape)
                name = "blade at the start" + (f" of {each.label}" if starts else "")
                starts.append(_body(start, name, FAINT))
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


def _body(design: Any, name: str, color: str) -> Body:
    corners = triangles(SOLID.surface(design, SOLID.radii(design)))[..., [2, 1, 0]]
    hub, tip = design.blade.hub_radius, design.blade.tip_radius
    radii = hub + np.array(SHOWN) * (tip - hub)
    return Body(name, corners, color, SOLID.stations(design, radii).plane)


def _beside(found: Sequence[Body]) -> list[np.ndarray]:
    """Return the corners of blades that lie beside one another."""
    width = APART * max(np.ptp(each.corners[..., 1]) for each in found)
    return [each.corners - (0.0, row * width, 0.0) for row, each in enumerate(found)]


def solid(found: Sequence[Body]) -> Chart:
    """Return the blades as one scene that can be turned, one beside the other."""
    data = []
    for body, corners in zip(found, _beside(found), strict=True):
        points, place = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        corner = place.reshape(-1, 3).T
        mesh = {axis: _packed(x, "<f4", "f4") for axis, x in zip("xyz", points.T, strict=True)}
        mesh |= {key: _packed(x, "<u4", "u4") for key, x in zip("ijk", corner, strict=True)}
        look = {"color": body.color, "flatshading": False, "hoverinfo": "name"}
        light = {"ambient": 0.55, "diffuse": 0.7, "specular": 0.25, "roughness": 0.6}
        data.append(
            {"type": "mesh3d", "name": escaped(body.name), "showlegend": True}
            | mesh
            | look
            | {"lighting": light, "lightposition": {"x": -2000, "y": -3000, "z": 6000}}
        )
    quiet = {"visible": False}
    eye = {"x": 0.0, "y": -1.1, "z": 1.25}
    scene = {"aspectmode": "data", "dragmode": "orbit", "yaxis": quiet, "zaxis": quiet}
    along = {"title": {"text": "radius (m)"}, "nticks": 6, "showbackground": False}
    scene |= {"xaxis": along, "camera": {"eye": eye, "projection": {"type": "orthographic"}}}
    return {"data": data, "layout": {"height": 440, "scene": scene}}


def _packed(values: np.ndarray, kind: str, name: str) -> dict[str, str]:
    """Return an array as plotly.js reads it from base64."""
    return {"dtype": name, "bdata": base64.b64encode(values.astype(kind).tobytes()).decode()}


def picture(found: Sequence[Body]) -> bytes:
    """Return a PNG of the blades, one beside the other, for a browser that cannot turn them.

    Parameters
    ----------
    found : sequence of Body
        The blades.

    Returns
    -------
    bytes
        With a transparent ground, lighted from the eye.
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
        light = 0.35 + 0.65 * facing[order, None]
        faces = np.clip(color * light + 0.25 * light**8, 0.0, 1.0)
        ax.add_collection(PolyCollection(seen[order, :, :2], facecolors=faces, edgecolors=faces))
        words = {"color": "0.5", "fontsize": style.FONT_SIZE, "va": "bottom", "ha": "left"}
        place = seen[:, :, 1].max()
        ax.text(seen[:, :, 0].min(), place, body.name.replace("$", r"\$"), **words)
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_axis_off()
    figure.patch.set_alpha(0.0)
    return style.png(figure)


def sections(found: Sequence[Body]) -> Chart:
    """Return some sections of the blades, to scale, with the blade's axis."""
    data, layout = [], {"height": 330, "annotations": []}
    gap = 1.15 * max(np.ptp(each.sections[..., 0]) for each in found)
    for row, body in enumerate(found):
        for column, points in enumerate(body.sections):
            x, y = points.T
            trace = {"type": "scatter", "mode": "lines", "name": escaped(body.name)}
            dash = "dot" if body.color == FAINT else "solid"
            look = {"line": {"color": body.color, "width": 1.6, "dash": dash}}
            fill = {} if body.color == FAINT else {"fill": "toself", "fillcolor": f"{body.color}18"}
            ends = [[float(f"{v:.5g}") for v in np.append(u, u[0])] for u in (x + column * gap, y)]
            shown = {"legendgroup": body.name, "showlegend": column == 0, "hoverinfo": "name"}
            data.append(trace | look | fill | shown | {"x": ends[0], "y": ends[1]})
    top = max(np.max(each.sections[..., 1]) for each in found)
    for column, place in enumerate(SHOWN):
        at = {"x": column * gap, "y": top * 1.2, "showarrow": False, "yanchor": "bottom"}
        words = {"text": f"{100.0 * place:g} % of the span", "font": {"size": 12}}
        layout["annotations"].append(at | words)
        axis = {"type": "scatter", "mode": "markers", "x": [column * gap], "y": [0.0]}
        look = {"marker": {"symbol": "cross-thin-open", "size": 12, "color": FAINT}}
        name = {"name": "blade's axis, at a quarter of the chord", "legendgroup": "axis"}
        data.append(axis | look | name | {"showlegend": column == 0, "hoverinfo": "name"})
    layout["xaxis"] = {"title": {"text": "along the chord, in the scale of the vertical axis"}}
    layout["xaxis"] |= {"showticklabels": False, "zeroline": False, "constrain": "domain"}
    layout["yaxis"] = {"scaleanchor": "x", "title": {"text": "across (m)"}, "zeroline": False}
    return {"data": data, "layout": layout}
