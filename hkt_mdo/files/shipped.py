"""Data files that come with the package: their names, their paths, and what they hold."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Csv, read_text

__all__ = [
    "MATERIALS",
    "POLAR_FAMILIES",
    "data_path",
    "locate",
    "read_table",
    "shipped_names",
    "shipped_rotor",
]

POLAR_FAMILIES: dict[str, dict[str, float]] = {
    section: {f"{section}_Re{number}": float(number) for number in numbers.split()}
    for section, numbers in {
        "naca63815": "1e5 2e5 3e5 5e5 1e6 2e6",
        "naca63424": "1e6 3e6 1e7",
        "naca4415": "1e5 2e5 5e5 1e6",
    }.items()
}
"""Shipped polars of one section: name of the section, name of the polar, its Reynolds number."""

MATERIALS: dict[str, dict[str, float]] = {
    name: dict(zip(("density", "modulus", "allowable_stress"), numbers, strict=True))
    for name, numbers in {
        "aluminium_6061_t6": (2700.0, 68.9e9, 240e6),
        "steel_s355": (7850.0, 210e9, 355e6),
        "glass_epoxy_uniaxial": (1940.0, 43.7e9, 370.69e6),
        "glass_epoxy_triaxial": (1940.0, 28.2114e9, 343.1e6),
        "carbon_epoxy_uniaxial": (1600.0, 140e9, 878.21e6),
    }.items()
}
"""Density (kg/m**3), Young's modulus along the blade and allowable stress (Pa) of materials.

The stress is the smallest yield stress of metals, and the strength of laminates along the blade, in
tension or compression, whichever is lower; without any factor of safety. Sources are in
`hkt_mdo/files/data/README.md`.
"""

_POLARS = [polar for family in POLAR_FAMILIES.values() for polar in family]
_FILES: dict[str, dict[str, str]] = {
    "blade": {name: f"{name}_blade.csv" for name in ("bahaj2007", "rm1", "river")},
    "polar": {name: f"{name.replace('_', '_polar_')}.csv" for name in _POLARS}
    | {"cylinder": "cylinder_polar.csv"},
    "outline": {name: f"{name}_coordinates.csv" for name in (*POLAR_FAMILIES, "cylinder")},
    "measurement": {"bahaj2007": "bahaj2007_measured_cp.csv"},
    "reported": {"amini2023": "amini2023_reported.yaml"},
}

_ROTORS: dict[str, dict[str, object]] = {
    "bahaj2007": {
        "radius": 1.4,
        "hub_radius_fraction": 0.125,
        "blade_count": 3,
        "stations": (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.999),
        "set_angle": 5.0,
        "polar": "naca63815_Re2e5",
        "outline": "naca63815",
    },
    "rm1": {
        "radius": 10.0,
        "hub_radius_fraction": 0.1,
        "blade_count": 2,
        "sections": (
            {"polar": "naca63424", "outline": "naca63424"},
            {"polar": "cylinder", "outline": "cylinder"},
        ),
        "reynolds_number": 3e6,
    },
    "river": {
        "radius": 0.8,
        "hub_radius_fraction": 0.15,
        "blade_count": 3,
        "polar": "naca4415_Re2e5",
        "outline": "naca4415",
    },
}


def shipped_names(kind: str) -> tuple[str, ...]:
    """Return the names of the data files of one kind, such as blade or polar, that are shipped."""
    return tuple(_FILES[kind])


def shipped_rotor(blade: object) -> dict[str, object]:
    """Return what of a case's section `rotor` a shipped blade brings with it; empty for others."""
    return dict(_ROTORS.get(blade, {})) if isinstance(blade, str) else {}


def data_path(name: str, kind: str) -> Path:
    """Return the path of a data file that comes with the package.

    `kind` is blade, polar, outline, measurement or reported. Raises InputError if no such file is
    shipped; the message lists those that are.
    """
    if kind not in _FILES:
        raise InputError("no such kind of data", f"kinds: {', '.join(_FILES)}", value=kind)
    if name not in _FILES[kind]:
        raise InputError(f"no shipped {kind} has this name", _remedy(name, kind), value=name)
    return Path(__file__).parent / "data" / _FILES[kind][name]


def locate(path_or_name: str | Path, kind: str) -> Path:
    """Return the file behind a shipped name, which comes first, or behind a path.

    Raises InputError, with the shipped names, if it is neither.
    """
    name = str(path_or_name)
    if name in _FILES[kind]:
        return data_path(name, kind)
    try:
        found = Path(name).is_file()
    except (OSError, ValueError):  # the name is too long or holds a null character
        found = False
    if not found:
        raise InputError(f"is neither a shipped {kind} nor a file", _remedy(name, kind), value=name)
    return Path(name)


def _remedy(name: str, kind: str) -> str:
    near = difflib.get_close_matches(name[:100], _FILES[kind], n=1)
    guess = f"did you mean {near[0]}? " if near else ""
    return f"{guess}shipped: {', '.join(_FILES[kind])}; or give the path of a file"


def read_table(
    path_or_name: str | Path, columns: Sequence[str], what: str, optional: Sequence[str] = ()
) -> dict[str, np.ndarray]:
    """Read columns of numbers, column[n_rows], from a CSV file: a shipped name or a path.

    `columns` must be there; `optional` ones are read if they are there, and others are ignored.
    `what` is blade, polar, outline or measurement. Raises InputError, with file, line, column and
    value, if a column is missing or appears twice, there are no rows, or a cell is no number.
    """
    path = locate(path_or_name, what)
    table = Csv(read_text(path, f"CSV file with the {what}"), path, ",".join(columns))
    return {name: each.values for name, each in table.columns(columns, what, optional).items()}
