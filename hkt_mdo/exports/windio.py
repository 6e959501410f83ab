"""A result as a turbine of windIO's schema, version 2 (YAML).

Source: windIO, IEA Wind Task 37, turbine schema, https://windio.readthedocs.io.
"""

import json
from typing import Annotated, Any

import numpy as np
import yaml

from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import TEMPLATES, Format, cut_in, filled
from hkt_mdo.exports.openfast import polar_rows, reynolds_numbers
from hkt_mdo.exports.solids import airfoils
from hkt_mdo.exports.tables import REVOLUTIONS, section_names, steady_operation
from hkt_mdo.files.yaml_text import dump
from hkt_mdo.results.design import Design
from hkt_mdo.results.folder import to_json
from hkt_mdo.results.sections import STACKING, outline_names
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.inertia import extended_to_ends
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.sections import Quantity

DIGITS = 12  # of thickness over chord: rounding must not tell equal sections apart


class Windio(Format):
    """A turbine of windIO 2: blade, airfoils with polars, hub, generator and control."""

    stacking: Annotated[float, Quantity(ge=0, le=1)] = STACKING
    """Place of the blade's straight axis on the chord, from the leading edge, over the chord."""

    def files(self, design: Design) -> dict[str, str]:
        blade, case, tables = design.blade, design.physics.case, design.solution.tables.values()
        root: dict[str, Any] = yaml.safe_load((TEMPLATES / "turbine.yaml").read_text("utf-8"))
        (material,), parts = root["materials"], root["components"]
        root |= {"name": design.solution.name, "comments": _comments(design, material["nu"])}
        root["airfoils"], positions = _airfoils(design)
        root["control"] |= _control(design)
        powers = [part["trajectory"]["electrical_power_W"] for part in tables]
        root["assembly"] |= {
            "number_of_blades": int(blade.blade_count),
            "rotor_diameter": 2.0 * blade.rotor_radius,
            "rated_power": float(max(map(np.max, powers))),
            "cut_in_wind_speed": cut_in(design),
        }
        if design.law.cut_out is not None:
            root["assembly"]["cut_out_wind_speed"] = design.law.cut_out
        cone = abs(float(np.rad2deg(blade.cone)))
        parts["hub"] |= {"diameter": 2.0 * blade.hub_radius, "cone_angle": cone}
        length = blade.tip_radius - blade.hub_radius
        parts["blade"]["reference_axis"]["z"] = _curve([0.0, 1.0], [0.0, length])
        parts["blade"]["outer_shape"] = _outer_shape(design, self.stacking, positions)
        properties = case.rotor.blade_material
        material |= {"rho": properties.density, "E": properties.modulus}
        parts["blade"]["structure"]["layers"][0]["thickness"] = _shell(design)
        steady = None if case.generator.lossless else steady_operation(design)
        if steady is not None:
            parts["drivetrain"]["generator"] = {"rpm_efficiency": _efficiency(steady)}
        return {"turbine.yaml": dump(json.loads(to_json(root)), width=1000)}


def _comments(design: Design, poisson: float) -> str:
    """Return comments on values for which the schema has no key."""
    try:
        outlines = f"Coordinates are those of {outline_names(design.solution, design.turbine)}."
    except InputError as error:
        outlines = f"COORDINATES ARE A PLACEHOLDER: {error.key} {error.problem}."
    return filled("windio.txt", design, {"outlines": outlines, "poisson": poisson}).rstrip("\n")


def _outer_shape(design: Design, stacking: float, positions: list[dict]) -> dict[str, Any]:
    """Return the outer shape; chord, twist and thickness are constant towards hub and tip."""
    grid, chord = _grid(design), extended_to_ends(design.blade.chord)
    return {
        "chord": _curve(grid, chord),
        "twist": _curve(grid, np.rad2deg(extended_to_ends(design.blade.twist))),
        "rthick": _curve(grid, np.round(extended_to_ends(design.thickness), DIGITS)),
        "section_offset_y": _curve(grid, stacking * chord),
        "airfoils": positions,
    }


def _shell(design: Design) -> dict[str, Any]:
    """Return the thickness of the one shell: the wall, or half of a solid section."""
    blade, turbine = design.blade, design.turbine
    walls = turbine.along_span(turbine.walls, blade.r)
    share = np.clip(walls, min(turbine.walls), 0.5 * design.thickness)
    return _curve(_grid(design), extended_to_ends(share * blade.chord))


def _curve(grid: Any, values: Any) -> dict[str, Any]:
    return {"grid": grid, "values": values}


def _grid(design: Design) -> np.ndarray:
    """Return hub, stations and tip as shares of the blade's length."""
    edges = design.blade.edges
    return (edges - edges[0]) / (edges[-1] - edges[0])


# Airfoils -----------------------------------------------------------------------------------------


def _airfoils(design: Design) -> tuple[list[dict], list[dict]]:
    """Return the airfoils, each once, and their places along the blade."""
    called, numbers = section_names(design), reynolds_numbers(design)
    entries, names = [], np.empty(design.blade.r.size, dtype=object)
    for number, (polars, outline, stations) in enumerate(airfoils(design), 1):
        names[stations] = f"section_{number}"
        airfoil = {
            "name": f"section_{number}",
            "description": called[stations[0]] if called else "",
            "rthick": round(float(design.thickness[stations[0]]), DIGITS),
            "aerodynamic_center": 0.25,
            "coordinates": _coordinates(outline),
            "polars": [{"configuration": "default", "re_sets": _re_sets(polars, numbers)}],
        }
        entries.append(airfoil)
    positions = [
        {"name": name, "spanwise_position": share, "configuration": ["default"], "weight": [1.0]}
        for share, name in zip(_grid(design), extended_to_ends(names), strict=True)
    ]
    return entries, positions


def _coordinates(outline: Outline) -> dict[str, np.ndarray]:
    """Return the points from the trailing edge over the upper side, x within 0 and 1, each once."""
    x, y = outline.upper_first.T
    x = np.clip(x, 0.0, 1.0)
    moved = np.append(True, (np.diff(x) != 0.0) | (np.diff(y) != 0.0))
    return {"x": x[moved], "y": y[moved]}


def _re_sets(polars: tuple[Polar, ...], numbers: list[float]) -> list[dict]:
    """Return the polars at the knots of their splines."""
    sets = []
    for polar, number in zip(polars, numbers, strict=True):
        alpha, lift, drag, *_ = polar_rows(polar).T
        columns = {"cl": lift, "cd": drag, "cm": np.zeros(alpha.size)}
        sets.append({"re": number} | {name: _curve(alpha, each) for name, each in columns.items()})
    return sets


# Generator and control ----------------------------------------------------------------------------


def _efficiency(steady: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return the efficiency over rotor speeds (rpm) along the steady operation."""
    running = steady["generator_power"] > 0.0
    names = "rotor_speed", "electrical_power", "generator_power"
    speed, electrical, generated = (steady[name][running] for name in names)
    speed, first = np.unique(speed, return_index=True)
    return _curve(speed * REVOLUTIONS, np.maximum((electrical / generated)[first], 0.0))


def _control(design: Design) -> dict[str, Any]:
    """Return the keys of the schema that describe the law and the limits of the case."""
    law: Any = design.law
    physics, tables = design.physics, design.solution.tables.values()
    limits = [(x.name, float(x.upper)) for x in physics.all_limits if x.caps_series]
    fastest = [float(np.max(part["trajectory"]["rotor_speed_rad_s"])) for part in tables]
    fastest += [most for name, most in limits if name == "rotor_speed"]
    rates = [most for name, most in limits if name == "torque_rate"]
    entries = {
        "max_rotor_speed": max(fastest) * REVOLUTIONS,
        "optimal_tsr": physics.rotor.best_operation(design.blade).tip_speed_ratio,
        "max_gen_torque": law.torque_limit,
        "region2_k": float(design.gains[0]) / REVOLUTIONS**2 if law.law == "quadratic" else None,
        "rated_power": float(law.second_of(design.gains)) if law.law == "rated" else None,
        "max_torque_rate": min(rates, default=None),
    }
    return {key: value for key, value in entries.items() if value is not None}
