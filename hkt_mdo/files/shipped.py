"""Data files and cases that come with the package: names, paths, and what they hold."""

import os.path
from pathlib import Path
from typing import Any

from hkt_mdo.errors import InputError, did_you_mean
from hkt_mdo.files.table import read_text
from hkt_mdo.files.yaml_text import compose, plain

_FOLDER = Path(__file__).parent / "data"
_SHIPPED, COLUMNS, SPELLINGS, PLAUSIBLE, REMEDIES = (
    plain(compose(read_text(_FOLDER / f"{name}.yaml", "table"), name))
    for name in ("shipped", "columns", "units", "plausible", "remedies")
)
"""COLUMNS: unit and meaning of the columns of tables, of a result and of its exports.

SPELLINGS: those of the units of records. PLAUSIBLE: ranges of a case's values, with what to think
of outside of them. REMEDIES: what to try where checks of a result fail.
"""

POLAR_FAMILIES: dict[str, dict[str, float]] = _SHIPPED["polars"]
"""Shipped polars of one section: name of the section, name of the polar, its Reynolds number."""

MATERIALS: dict[str, dict[str, float]] = _SHIPPED["materials"]
"""Density (kg/m**3), Young's modulus along the blade and allowable stress (Pa) of materials.

The stress is the smallest yield stress of metals, and the strength of laminates along the blade, in
tension or compression, whichever is lower; without any factor of safety. Sources are in
`hkt_mdo/files/data/README.md`.
"""

_FILES: dict[str, dict[str, str]] = _SHIPPED["files"]  # by kind and name


def shipped_names(kind: str) -> tuple[str, ...]:
    """Return the names of the data files of one kind that are shipped.

    Parameters
    ----------
    kind : str
        blade, polar, outline, measurement or reported.

    Returns
    -------
    tuple of str
        The names, as a case gives them.
    """
    return tuple(_FILES[kind])


def shipped_rotor(blade: object) -> dict[str, Any]:
    """Return the keys of a case's section `rotor` that a shipped blade brings with it.

    Parameters
    ----------
    blade : object
        What the case gives as `rotor.blade`.

    Returns
    -------
    dict
        Keys and values; empty if `blade` is not the name of a shipped blade.
    """
    return dict(_SHIPPED["blades"].get(blade, {})) if isinstance(blade, str) else {}


def known_names(kind: str) -> tuple[str, ...]:
    """Return the names of one kind that a case may give: of files, and of sections with polars.

    Parameters
    ----------
    kind : str
        As of `shipped_names`.

    Returns
    -------
    tuple of str
        The names.
    """
    return (*(POLAR_FAMILIES if kind == "polar" else ()), *_FILES[kind])


def locate(path_or_name: str | Path, kind: str) -> Path:
    """Return the file behind a shipped name, which comes first, or behind a path.

    Parameters
    ----------
    path_or_name : str or pathlib.Path
        Shipped name or path.
    kind : str
        As of `shipped_names`.

    Returns
    -------
    pathlib.Path
        An existing file.

    Raises
    ------
    InputError
        If it is neither; the message lists the shipped names.
    """
    name = str(path_or_name)
    if name in _FILES[kind]:
        return _FOLDER / _FILES[kind][name]
    # unlike Path.is_file, it takes names that are too long or hold a null character
    if not os.path.isfile(name):  # noqa: PTH113
        problem = f"is neither a shipped {kind} nor a file"
        raise InputError(problem, nearest_names(name, kind), value=name)
    return Path(name)


def nearest_names(name: str, kind: str) -> str:
    """Return the remedy of an unknown name: the nearest known one, and all of them.

    Parameters
    ----------
    name, kind : str
        The name, and the kind as of `shipped_names`.

    Returns
    -------
    str
        The remedy.
    """
    names = known_names(kind)
    return f"{did_you_mean(name, names)}shipped: {', '.join(names)}; or give the path of a file"


# Cases -------------------------------------------------------------------------------------------

_PACKAGE = Path(__file__).parents[1]


def shipped_cases() -> Path:
    """Return the folder of the shipped case files: in an installed package, or in the checkout.

    Returns
    -------
    pathlib.Path
        The folder.
    """
    installed = _PACKAGE / "cases"
    return installed if installed.is_dir() else _PACKAGE.parent / "cases"


def find_case(path: str | Path) -> Path:
    """Return the path of a case file.

    Parameters
    ----------
    path : str or pathlib.Path
        A path, or the name of a shipped case such as ``sine_oloc``, ``river_gust.yaml`` or
        ``cases/limits/all_oloc.yaml``; a file of that name comes first.

    Returns
    -------
    pathlib.Path
        The shipped case if there is one of that name, else `path`.
    """
    path, folder = Path(path), shipped_cases()
    name = f"{path.as_posix().removesuffix('.yaml')}.yaml"
    for file in folder.rglob("*.yaml"):
        inside = file.relative_to(folder).as_posix()
        if name in (file.name, inside, f"cases/{inside}") and not path.is_file():
            return file
    return path
