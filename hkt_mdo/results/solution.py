"""Results: a result folder as arrays and figures of merit, without what computed them.

A folder may come from anyone: its files are limited in size and read as text, never as pickles.
"""

from __future__ import annotations

import json
import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.case import Case, load_case
from hkt_mdo.errors import InputError
from hkt_mdo.files.table import read_bytes

__all__ = ["Solution", "summary_table"]

MAX_SUMMARY_BYTES = 16 * 1024**2
"""Largest summary.json that is read, in bytes."""

MAX_CSV_BYTES = 64 * 1024**2
"""Largest CSV file that is read, in bytes."""

_OVER_TIME = (
    "time_s",
    "inflow_speed_m_s",
    "rotor_speed_rad_s",
    "tip_speed_ratio",
    "hydrodynamic_torque_Nm",
    "control_torque_Nm",
    "hydrodynamic_power_W",
    "generator_power_W",
)
_TABLES = {
    "trajectory": _OVER_TIME,
    "simulation": _OVER_TIME,
    "power_curve": ("tip_speed_ratio", "power_coefficient", "start_power_coefficient"),
    "convergence": ("evaluation", "energy_J", "infeasibility"),
}
_BLADE = ("r_m", "chord_m", "twist_deg", "start_chord_m", "start_twist_deg")
_WORDS = ("case", "success", "message")
_GAIN_UNITS = {"linear": "N m s/rad", "quadratic": "N m s^2/rad^2"}


@dataclass(frozen=True, eq=False)
class Solution:
    """What a run left in its folder.

    Parameters
    ----------
    folder : pathlib.Path
        The result folder.
    case : Case
        The case that was run, every default written out.
    summary : dict
        Figures of merit, by the names of ``summary.json``; None for what could not be had.
    trajectory : dict of str to numpy.ndarray
        The optimized trajectory, column[n_nodes] at the collocation nodes.
    simulation : dict of str to numpy.ndarray
        The independent integration of the same design, column[n_times].
    power_curve : dict of str to numpy.ndarray
        Power coefficients of the blade and of the blade at the start, column[n_tip_speed_ratios].
    convergence : dict of str to numpy.ndarray
        Energy and infeasibility, column[n_evaluations].

    Notes
    -----
    A table that the run did not get to is an empty dict. Names of columns end in their units.
    """

    folder: Path
    case: Case
    summary: dict[str, Any]
    trajectory: dict[str, np.ndarray]
    simulation: dict[str, np.ndarray]
    power_curve: dict[str, np.ndarray]
    convergence: dict[str, np.ndarray]

    @classmethod
    def load(cls, folder: str | Path) -> Solution:
        """Read a result folder.

        Parameters
        ----------
        folder : str or pathlib.Path
            The folder that a run wrote; of an interrupted run, tables may be missing.

        Returns
        -------
        Solution
            Arrays cannot be written to.

        Raises
        ------
        InputError
            If it is no result folder, or a file in it is too large or corrupt.
        """
        folder = Path(folder)
        for name in ("", "case.yaml", "summary.json"):
            try:
                found = (folder / name).exists()
            except (OSError, ValueError):  # not permitted, too long a name, a null character
                found = False
            if not found:
                problem = f"is no result folder: it lacks {name}" if name else "does not exist"
                remedy = "give a folder that a run wrote, or run the case again"
                raise InputError(problem, remedy, file=folder)
        case = load_case(folder / "case.yaml", check_files=False)
        summary = _read_summary(folder / "summary.json")
        tables = {name: _read_csv(folder / f"{name}.csv", _TABLES[name]) for name in _TABLES}
        return cls(folder, case, summary, **tables)

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.case.name

    @property
    def success(self) -> bool:
        """Whether the optimizer converged and every check of the result passed."""
        return bool(self.summary["success"])

    @property
    def message(self) -> str:
        """What the run says of its end, one printable line."""
        return _line(self.summary.get("message") or "")

    @property
    def energy(self) -> float | None:
        """Energy that the rotor takes from the flow (J); None if it could not be had."""
        return self.summary.get("energy_J")

    @property
    def gain(self) -> float | list[float] | None:
        """Gain of the feedback law, in the unit of `control.gain`; None for open loop."""
        return self.summary.get("gain")

    @property
    def notes(self) -> tuple[str, ...]:
        """What was converted, repaired or left out of the case's files, a printable line each."""
        return tuple(_line(note) for note in self.summary.get("notes") or ())

    @property
    def failed_checks(self) -> tuple[str, ...]:
        """Checks that the result did not pass, each as one printable line."""
        return tuple(
            _line(
                f"{check['name']}: {_number(check.get('value'))}, limit "
                f"{_number(check.get('limit'))}. {check.get('detail') or ''}"
            )
            for check in self.summary.get("checks") or ()
            if not check["passed"]
        )


def summary_table(solution: Solution) -> list[tuple[str, str]]:
    """Return a result's figures of merit as text.

    Parameters
    ----------
    solution : Solution
        The result.

    Returns
    -------
    list of (str, str)
        What, and its value with the unit; ``-`` for what could not be had.
    """
    summary, control = solution.summary, solution.case.control
    get = summary.get
    ratio = get("tip_speed_ratio") or {}
    energy, simulated, bound = get("energy_J"), get("simulated_energy_J"), get("energy_bound_J")
    best = energy if simulated is None else simulated  # collocation alone may exceed the bound
    share = None if best is None or not bound else 100.0 * best / bound
    difference = ""
    if energy and simulated is not None:
        difference = f", {100.0 * (simulated / energy - 1.0):+.2g} %"
    rows = [
        ("case", solution.name),
        ("success", "yes" if solution.success else "no"),
        ("message", solution.message or "-"),
        ("energy", _energy(energy)),
        ("energy, simulated", _energy(simulated, difference)),
        ("share of quasi-steady bound", _number(share, ".3f", " %")),
    ]
    if control.law in _GAIN_UNITS:
        gain = solution.gain
        gains = gain if isinstance(gain, list) else [gain]
        unit = f" {_GAIN_UNITS[control.law]}"
        text = ", ".join(_number(value, ".5g", unit) for value in gains)
        rows.append((f"gain, {control.law} feedback", text))
    limit = control.torque_limit
    rows += [
        (
            "tip speed ratio",
            f"{_number(ratio.get('min'), '.3f')} to {_number(ratio.get('max'), '.3f')}, "
            f"mean {_number(ratio.get('mean'), '.3f')}",
        ),
        (
            "largest power coefficient",
            f"{_number(get('power_coefficient_max'), '.4f')} at tip speed ratio "
            f"{_number(get('tip_speed_ratio_at_power_coefficient_max'), '.3f')}",
        ),
        (
            "largest control torque",
            f"{_number(get('control_torque_max_Nm'), '.5g', ' N m')} "
            f"({'no limit' if limit is None else f'limit {limit:g} N m'})",
        ),
        *_designed(solution),
        ("inertia", _number(get("inertia_kg_m2"), ".4g", " kg m^2")),
        ("mass", _number(get("mass_kg"), ".4g", " kg")),
        ("torque curve, relative error", _number(get("surrogate_error"), ".2g")),
        ("rotor speed, relative error", _number(get("max_speed_error"), ".2g")),
        (
            "optimizer",
            f"{_line(get('optimizer') or '-')} ({_line(get('package') or '-')}), "
            f"{_number(get('iterations'), '.0f')} iterations, "
            f"{_number(get('wall_seconds'), '.1f', ' s')}",
        ),
    ]
    # a composite row of an interrupted run has nothing but dashes and words
    return [
        (what, text if any(map(str.isdigit, text)) or what in _WORDS else "-")
        for what, text in rows
    ]


def _designed(solution: Solution) -> list[tuple[str, str]]:
    """Return the rows of what is seldom designed."""
    design, get, rows = solution.case.design, solution.summary.get, []
    if design.radius_bounds is not None:
        rows.append(("tip radius", _number(get("tip_radius_m"), ".4g", " m")))
    if design.set_angle_bounds is not None:
        rows.append(("set angle", _number(get("set_angle_deg"), ".4g", " deg")))
    return rows


def _number(value: float | None, form: str = ".4g", unit: str = "") -> str:
    return "-" if value is None else f"{value:{form}}{unit}"


def _energy(value: float | None, remark: str = "") -> str:
    return "-" if value is None else f"{value / 1e3:.2f} kJ ({value:.0f} J{remark})"


def _line(text: str) -> str:
    """Return untrusted text as one line without control characters, which terminals obey."""
    return "".join(c if c.isprintable() else " " for c in " ".join(text.split()))


# Reading ------------------------------------------------------------------------------------------


def _read_csv(path: Path, columns: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Return the columns of a table: empty if there is no such file or it has no rows.

    Unlike data that a run starts from, a result may hold nan and inf: what the optimizer met.
    """
    if not path.exists():
        return {}
    remedy = "delete the file, or run the case again"
    content = read_bytes(path, MAX_CSV_BYTES, "table of a result")
    try:
        header, *lines = content.decode("ascii").splitlines() or [""]
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError("is not plain text", remedy, file=path, key=f"line {line}") from None
    names = header.split(",")
    missing = [name for name in columns if names.count(name) != 1]
    if missing:
        raise InputError(f"must have one column {missing[0]}", remedy, file=path, value=header)
    numbers = array("d")
    for number, row in enumerate(lines, start=2):
        cells = row.split(",")
        if len(cells) != len(names):
            problem = f"has {len(cells)} cells where the header has {len(names)}"
            raise InputError(problem, remedy, file=path, key=f"line {number}", value=row)
        try:
            numbers.extend(map(_cell, cells))
        except ValueError:
            problem = "must hold numbers alone"
            raise InputError(problem, remedy, file=path, key=f"line {number}", value=row) from None
    if not lines:
        return {}
    table = np.array(numbers).reshape(len(lines), len(names)).T.copy()
    table.flags.writeable = False
    return {name: table[names.index(name)] for name in columns}


def _cell(text: str) -> float:
    if "_" in text:  # Python's own way to write a number, nobody else's
        raise ValueError
    return float(text)


def _read_summary(path: Path) -> dict[str, Any]:
    """Return the summary, every key that this package knows checked."""
    remedy = "run the case again"
    content = read_bytes(path, MAX_SUMMARY_BYTES, "summary of a result")
    try:
        summary = json.loads(content.decode("utf-8"), parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        problem = f"cannot be read as JSON ({str(error)[:100]})"
        raise InputError(problem, remedy, file=path) from None
    if not isinstance(summary, dict):
        raise InputError("must hold keys and values", remedy, file=path, value=summary)
    for key, (check, words) in _SUMMARY.items():
        value = summary.get(key)
        if not (check(value) or (value is None and key != "success")):
            if key not in summary:
                raise InputError("is missing", remedy, file=path, key=key)
            raise InputError(f"must be {words}", remedy, file=path, key=key, value=value)
    lengths = {key: len(summary[key]) for key in _BLADE if summary.get(key) is not None}
    for key, length in lengths.items():
        if length != lengths.get("r_m"):
            problem = "must have one value for each of r_m"
            raise InputError(problem, remedy, file=path, key=key, value=summary[key])
    return summary


def _refuse_constant(word: str) -> None:
    raise ValueError(f"{word} is no number of JSON")


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_numbers(value: object) -> bool:
    return isinstance(value, list) and all(map(_is_number, value))


def _is_range(value: object) -> bool:
    return isinstance(value, dict) and all(
        value.get(key) is None or _is_number(value[key]) for key in ("min", "max", "mean")
    )


def _is_checks(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(check, dict)
        and _is_text(check.get("name"))
        and isinstance(check.get("passed"), bool)
        and all(check.get(key) is None or _is_number(check[key]) for key in ("value", "limit"))
        and (check.get("detail") is None or _is_text(check["detail"]))
        for check in value
    )


def _is_texts(value: object) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


_Check = tuple[Callable[[object], bool], str]
_SUMMARY: dict[str, _Check] = {
    "success": (lambda value: isinstance(value, bool), "true or false"),
    "gain": (lambda value: _is_number(value) or _is_numbers(value), "a number or a list of them"),
    "tip_speed_ratio": (_is_range, "min, max and mean"),
    "checks": (_is_checks, "a list of checks, each of name, value, limit, passed and detail"),
    **dict.fromkeys(("case", "message", "package", "optimizer"), (_is_text, "a text")),
    "notes": (_is_texts, "a list of texts"),
    **dict.fromkeys(_BLADE, (_is_numbers, "a list of numbers")),
    **dict.fromkeys(
        (
            "iterations",
            "wall_seconds",
            "energy_J",
            "simulated_energy_J",
            "generator_energy_J",
            "energy_bound_J",
            "power_coefficient_max",
            "tip_speed_ratio_at_power_coefficient_max",
            "control_torque_max_Nm",
            "rotor_radius_m",
            "tip_radius_m",
            "set_angle_deg",
            "inertia_kg_m2",
            "mass_kg",
            "surrogate_error",
            "max_speed_error",
        ),
        (_is_number, "a finite number"),
    ),
}
