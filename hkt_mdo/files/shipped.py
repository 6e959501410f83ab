"""Data files that come with the package: their names, their paths, and what they hold."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Table, parse_table, read_text

__all__ = [
    "POLAR_FAMILIES",
    "data_path",
    "locate",
    "read_table",
    "shipped_names",
    "shipped_rotor",
]

POLAR_FAMILIES: dict[str, dict[str, float]] = {
    "naca63815": {
        f"naca63815_Re{reynolds}": float(reynolds)
        for reynolds in ("1e5", "2e5", "3e5", "5e5", "1e6", "2e6")
    },
    "naca63424": {f"naca63424_Re{reynolds}": float(reynolds) for reynolds in ("1e6", "3e6", "1e7")},
    "naca4415": {
        f"naca4415_Re{reynolds}": float(reynolds) for reynolds in ("1e5", "2e5", "5e5", "1e6")
    },
}
"""Shipped polars of one section: name of the section, name of the polar, its Reynolds number."""

_FILES: dict[str, dict[str, str]] = {
    "blade": {
        "bahaj2007": "bahaj2007_blade.csv",
        "rm1": "rm1_blade.csv",
        "river": "river_blade.csv",
    },
    "polar": {
        polar: f"{polar.replace('_', '_polar_')}.csv"
        for family in POLAR_FAMILIES.values()
        for polar in family
    }
    | {"cylinder": "cylinder_polar.csv"},
    "outline": {
        name: f"{name}_coordinates.csv"
        for name in ("naca63815", "naca63424", "naca4415", "cylinder")
    },
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

    Raises InputError if it is neither a shipped name of this kind nor an existing file; the
    message lists the shipped names.
    """
    name = str(path_or_name)
    if name in _FILES.get(kind, {}):
        return data_path(name, kind)
    try:
        found = Path(name).is_file()
    except (OSError, ValueError):  # the name is too long or holds a null character
        found = False
    if not found:
        raise InputError(f"is neither a shipped {kind} nor a file", _remedy(name, kind), value=name)
    return Path(name)


def _remedy(name: str, kind: str) -> str:
    known = shipped_names(kind)
    near = difflib.get_close_matches(name[:100], known, n=1)
    guess = f"did you mean {near[0]}? " if near else ""
    return f"{guess}shipped: {', '.join(known)}; or give the path of a file"


def read_table(
    path_or_name: str | Path, columns: Sequence[str], what: str, optional: Sequence[str] = ()
) -> Table:
    """Read columns of numbers from a CSV file, given by a shipped name or a path.

    `what` is blade, polar, outline or measurement: where shipped names are looked up, and what
    messages call the table. Columns, result and errors are those of `parse_table`.
    """
    path = locate(path_or_name, what)
    return parse_table(read_text(path, f"CSV file with the {what}"), path, columns, what, optional)
