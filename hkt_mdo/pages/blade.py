"""The rotors of results as solids that can be turned, and as a picture."""

import base64
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from hkt_mdo.errors import InputError
from hkt_mdo.exports.solids import Stl
from hkt_mdo.pages.panels import Chart, escaped
from hkt_mdo.results import style
from hkt_mdo.results.charts import Labelled
from hkt_mdo.results.design import Design
from hkt_mdo.results.panel import GREY
from hkt_mdo.results.sections import outline_names

SOLIDS = tuple(Stl(spanwise=n, points=m, hub="cylinder") for n, m in ((44, 48), (20, 24)))
"""Sections and points of the solids of few results and of many, beside their stations."""
FEW = 4
APART = 1.15
"""Distance from one rotor to the next one over the largest diameter."""
EYE, LIGHT = np.array([0.0, -0.6, 1.9]), np.array([-0.4, 0.3, 0.87])
"""Where the picture is seen and lighted from; x and y in the rotor plane, z upstream."""


class Body(NamedTuple):
    """A rotor: its name, the corners[n_triangles, 3, 3] of its surface (m), its colour."""

    name: str
    corners: np.ndarray
    color: str


def bodies(labelled: Sequence[Labelled]) -> tuple[list[Body], list[str]]:
    """Return the rotors of results, each start once behind them, and why others are not there.

    Parameters
    ----------
    labelled : sequence of Labelled
        The results.

    Returns
    -------
    rotors : list of Body
        In axes of which x is along the first blade, y in the rotor plane, z upstream.
    reasons : list of str
        A line for each result whose blade is not known as a solid.
    """
    rotors: list[Body] = []
    starts: dict[bytes, Body] = {}
    reasons: list[str] = []
    for result in labelled:
        try:
            design = result.solution.design()
            outline_names(result.solution, design.turbine)  # refuses polars without an outline
            start, kind = _start(design), SOLIDS[len(labelled) > FEW]
            shape = _shape(start)
            changed = not np.allclose(shape, _shape(design))
            name = result.label or ("optimized blade" if changed else "blade")
            rotors.append(_body(design, kind, name, result.color()))
            if changed and shape.tobytes() not in starts:
                name = "blade at the start" + (f" of {result.label}" if starts else "")
                starts[shape.tobytes()] = _body(start, kind, name, GREY)
        except InputError as error:
            reasons.append(f"{result.label or result.solution.name}: {error}")
    return [*rotors, *starts.values()], reasons


def _start(design: Design) -> Design:
    """Return the design with the blade at the start."""
    blade = design.physics.blade
    return replace(design, blade=blade, turbine=design.turbine._replace(blade=blade))


def _shape(design: Design) -> np.ndarray:
    """Return what a design may change of a blade: radii, chord, twist and thickness."""
    return np.stack((design.blade.r, design.blade.chord, design.blade.twist, design.thickness))


def _body(design: Design, kind: Stl, name: str, color: str) -> Body:
    # the rotor's axes turned about y
    return Body(name, np.concatenate(kind.rotor(design))[..., [2, 1, 0]] * (1, 1, -1), color)


def _beside(rotors: Sequence[Body]) -> list[np.ndarray]:
    """Return the corners of rotors that stand in rows."""
    step = 2.0 * APART * max(float(np.max(np.abs(rotor.corners))) for rotor in rotors)
    columns = int(np.ceil(len(rotors) / max(1, round(np.sqrt(0.5 * len(rotors))))))
    return [
        rotor.corners + step * np.array((number % columns, -(number // columns), 0.0))
        for number, rotor in enumerate(rotors)
    ]


def solid(rotors: Sequence[Body]) -> Chart:
    """Return the rotors as one scene that can be turned, one beside the other.

    Parameters
    ----------
    rotors : list of Body
        The rotors.

    Returns
    -------
    dict
        The chart.
    """
    data, beside = [], _beside(rotors)
    for body, corners in zip(rotors, beside, strict=True):
        points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        corner = index.reshape(-1, 3).T
        mesh = {axis: _packed(x, "f4") for axis, x in zip("xyz", points.T, strict=True)}
        kind = "u2" if len(points) < 2**16 else "u4"
        mesh |= {key: _packed(x, kind) for key, x in zip("ijk", corner, strict=True)}
        light = {"ambient": 0.45, "diffuse": 0.7, "specular": 0.3, "roughness": 0.4}
        light |= {"vertexnormalsepsilon": 0, "facenormalsepsilon": 0}  # of faces of a few mm, too
        look = {"color": body.color, "flatshading": False, "lighting": light}
        look["lightposition"] = {"x": -2000, "y": 1500, "z": 4000}
        named = {"name": escaped(body.name), "hoverinfo": "name", "showlegend": True}
        data.append({"type": "mesh3d"} | named | mesh | look)
    extent = np.ptp(np.concatenate([corners.reshape(-1, 3) for corners in beside]), axis=0)
    scene: Chart = {"aspectmode": "manual", "dragmode": "orbit"}
    scene |= {f"{axis}axis": {"visible": False} for axis in "xyz"}
    scene["camera"] = {"eye": dict(zip("xyz", EYE, strict=True)), "up": {"x": 0, "y": 1, "z": 0}}
    scene["aspectratio"] = dict(zip("xyz", (extent / extent[0]).tolist(), strict=True))
    return {"data": data, "layout": {"height": 480, "scene": scene}}


def _packed(values: np.ndarray, kind: str) -> dict[str, str]:
    """Return an array as plotly.js reads it from base64."""
    data = values.astype(f"<{kind}").tobytes()
    return {"dtype": kind, "bdata": base64.b64encode(data).decode()}


def picture(rotors: Sequence[Body]) -> bytes:
    """Return a PNG of the rotors, one beside the other, for a browser that cannot turn them.

    Parameters
    ----------
    rotors : sequence of Body
        The rotors.

    Returns
    -------
    bytes
        With a transparent ground.
    """
    toward = EYE / np.linalg.norm(EYE)
    right = np.cross((0.0, 1.0, 0.0), toward)
    right /= np.linalg.norm(right)
    axes = np.stack((right, np.cross(toward, right), toward), -1)
    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    ax = figure.add_subplot()
    for body, corners in zip(rotors, _beside(rotors), strict=True):
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
        low, high = np.min(seen, axis=(0, 1)), np.max(seen, axis=(0, 1))
        words: dict[str, Any] = {"color": "0.5", "fontsize": style.FONT_SIZE + 2, "ha": "center"}
        words |= {"textcoords": "offset points", "va": "top"}
        at = 0.5 * (low[0] + high[0]), low[1]
        ax.annotate(body.name.replace("$", r"\$"), at, xytext=(0, -4), **words)
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_axis_off()
    figure.patch.set_alpha(0.0)
    return style.picture(figure)
