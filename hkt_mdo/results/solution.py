"""A result folder as arrays and figures of merit, without the modules that computed them.

A folder may come from anyone: its files are limited in size and read as text, never as pickles.
"""

from __future__ import annotations

import html
import importlib
import os.path
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.case import Case, load_case
from hkt_mdo.case.kinds import Extension
from hkt_mdo.dynamics.limits import Limit, TorqueLimit
from hkt_mdo.dynamics.trajectory import COLUMNS, LOADS, QUANTITIES, RATES, SERIES
from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Csv, number_columns, parse_number, read_bytes, read_text
from hkt_mdo.results import words
from hkt_mdo.results.summary import BLADE, Summary, printable

__all__ = ["TABLES", "Solution"]

MAX_BYTES, MAX_CSV_BYTES = 16 * 1024**2, 64 * 1024**2
"""Largest summary and largest table that are read."""

_OVER_TIME = {COLUMNS[name]: about for name, about in SERIES.items()}

TABLES: dict[str, dict[str, tuple[str | None, str]]] = {
    "trajectory": _OVER_TIME,
    "simulation": _OVER_TIME,
    "loads": {
        "r_m": ("m", "distance from the axis, along the blade"),
        "r_over_R": (None, "distance from the axis over the tip radius"),
        "stress_Pa": (
            "Pa",
            "largest stress in the section, at the time of the largest in the blade",
        ),
        "flapwise_moment_Nm": ("N*m", "moment that bends the blade flapwise, at that time"),
        "cavitation": (
            None,
            "suction, times its margin, over the pressure above vapour's, at the time of the "
            "largest; linear between the stations",
        ),
    },
    "power_curve": {
        "tip_speed_ratio": QUANTITIES["tip_speed_ratio"],
        "power_coefficient": (None, "power coefficient"),
        "start_power_coefficient": (None, "power coefficient of the blade at the start"),
    },
    "convergence": {
        "evaluation": (None, "evaluations of the optimizer"),
        "energy_J": ("J", "captured energy"),
        "infeasibility": (None, "largest scaled violation of a constraint"),
    },
    "blade": {
        "r_m": ("m", "distance of the station from the axis, along the blade"),
        "chord_m": ("m", "chord"),
        "twist_deg": ("deg", "twist, including the set angle"),
        "thickness_over_chord": (None, "thickness over chord, where it is designed"),
        "start_chord_m": ("m", "chord of the blade at the start"),
        "start_twist_deg": ("deg", "twist of the blade at the start, including the set angle"),
    },
}
"""Unit (None: dimensionless) and description of each column of each table of a result."""

_MAYBE = {
    "trajectory": {COLUMNS[name] for name in LOADS | RATES},
    "simulation": {COLUMNS[name] for name in LOADS | RATES},
    "loads": {"stress_Pa", "flapwise_moment_Nm", "cavitation"},
}
"""Columns that are there only if they are known of the rotor; older results lack them."""


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """What a run left in its folder; a table that the run did not reach is an empty dict.

    A table is column[n_rows] by name; `TABLES` has the units and meanings of all columns.
    """

    folder: Path
    case: Case
    """The case that was run, every default written out."""
    summary: Summary
    """Figures of merit: attributes, or values by the keys of ``summary.json``."""
    trajectory: dict[str, np.ndarray]
    """The optimized trajectory at the collocation nodes."""
    simulation: dict[str, np.ndarray]
    """The independent integration of the same design."""
    power_curve: dict[str, np.ndarray]
    convergence: dict[str, np.ndarray]
    loads: dict[str, np.ndarray] = field(default_factory=dict)
    """Loads along the blade at the times of the largest stress and of the largest suction."""

    @classmethod
    def load(cls, folder: str | Path, *, extensions: Iterable[Extension] = ()) -> Solution:
        """Read a result folder, as read-only arrays; after an interruption, tables may be missing.

        `extensions` are those of `load_case`; a folder never chooses what is run. Raises InputError
        if it is not a result folder, or a file in it is too large or corrupt.
        """
        folder = Path(folder)
        for name in ("", "case.yaml", "summary.json"):
            # unlike Path.exists, it bears too long a name and a null character
            if not os.path.exists(folder / name):  # noqa: PTH110
                problem = f"is no result folder: it lacks {name}" if name else "does not exist"
                remedy = "give a folder that a run wrote, or run the case again"
                raise InputError(problem, remedy, file=folder)
        case = load_case(folder / "case.yaml", check_files=False, extensions=extensions)
        path = folder / "summary.json"
        summary = Summary.parse(read_bytes(path, MAX_BYTES, "summary of a result"), path)
        tables = {
            name: _read_csv(folder / f"{name}.csv", tuple(TABLES[name]), _MAYBE.get(name, set()))
            for name in ("trajectory", "simulation", "power_curve", "convergence", "loads")
        }
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
        """Why the run ended, one printable line."""
        return printable(self.summary.get("message") or "")

    @property
    def energy(self) -> float | None:
        """Energy that the rotor takes from the flow, by collocation (J)."""
        return self.summary.energy_J

    @property
    def gain(self) -> float | list[float] | None:
        """Gain of the feedback law, in the unit of `control.gain`; None for open loop."""
        return self.summary.gain

    @property
    def notes(self) -> tuple[str, ...]:
        """What was converted, repaired or left out of the case's files, a printable line each."""
        return tuple(printable(note) for note in self.summary.get("notes") or ())

    def across_gaps(self, time: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return values (n_times,) with NaN wherever the machine stood still between two times.

        So that a line through them breaks there; `time` is the table's.
        """
        operation = self.summary.operation
        spans = np.reshape(operation.intervals_s if operation else [], (-1, 2))
        between = 0.5 * (spans[:-1, 1] + spans[1:, 0])
        return np.insert(values, np.searchsorted(time, between), np.nan)

    @property
    def limits(self) -> tuple[Limit, ...]:
        """Limits that the case gives of what changes over time, that of the torque first."""
        torque = TorqueLimit(bound=self.case.control.torque_limit)
        given = (torque, *self.case.limits.given)
        return tuple(each for each in given if each.caps_series)

    def limit_shares(self, table: str = "simulation") -> dict[str, np.ndarray]:
        """Return each limit's value over its bound, (n_times,), by its name: 1 is the limit.

        Of `trajectory` or `simulation`. A limit is left out whose quantities the table lacks, as
        that of an older result.
        """
        columns: dict[str, Any] = getattr(self, table)
        known = {name: columns[COLUMNS[name]] for name in SERIES if COLUMNS[name] in columns}
        known |= {
            "rotor_radius": self.summary.rotor_radius_m,
            "density": self.case.fluid.density,
            "inertia": self.summary.inertia_kg_m2,
        }
        known = {name: value for name, value in known.items() if value is not None}
        return {
            each.name: each.told(known) / each.upper
            for each in self.limits
            if each.upper > 0.0 and known.keys() >= set(each.inputs)
        }

    def limit_levels(self, quantity: str) -> dict[str, float]:
        """Return the values of a quantity or load at which limits of it are met, by their names.

        Those of limits that are proportional to it, as the tip speed's is to `rotor_speed`.
        """
        scalars = {"rotor_radius": self.summary.rotor_radius_m, "density": self.case.fluid.density}
        known = {name: value for name, value in scalars.items() if value is not None}
        levels = {}
        for each in self.limits:
            if quantity in each.inputs and {quantity, *known} >= set(each.inputs):
                one, two = (each.value_of(known | {quantity: x}) for x in (1.0, 2.0))
                if one > 0.0 and two == 2.0 * one:
                    levels[each.name] = float(each.upper / one)
        return levels

    @property
    def failed_checks(self) -> tuple[str, ...]:
        """Checks that the result did not pass, each as one printable line."""
        return tuple(str(check) for check in self.summary.checks or () if not check.passed)

    @property
    def blade(self) -> dict[str, np.ndarray]:
        """Chord and twist of the blade and of the blade at the start, column[n_stations]."""
        columns = {name: self.summary.get(name) for name in BLADE}
        return {name: np.array(values) for name, values in columns.items() if values is not None}

    def table(self, name: str) -> dict[str, np.ndarray]:
        """Return a table by its name in `TABLES`; InputError if the run did not reach it."""
        if name not in TABLES:
            raise InputError("unknown table", f"known: {', '.join(TABLES)}", value=name)
        if not (table := getattr(self, name)):
            raise InputError(f"has no {name}", "let the run come to its end", file=self.folder)
        return table

    def to_pandas(self, name: str = "trajectory") -> Any:
        """Return a table (or raise InputError) as a pandas DataFrame; its attrs hold the units."""
        frame = _package("pandas").DataFrame(self.table(name))
        frame.attrs["units"] = {column: TABLES[name][column][0] or "1" for column in frame}
        return frame

    def to_xarray(self, name: str = "simulation") -> Any:
        """Return a table (or raise InputError) as an xarray Dataset over its first column.

        Every variable has the attributes ``units`` and ``long_name``.
        """
        xarray, table = _package("xarray"), self.table(name)
        dimension, variables = next(iter(table)), {}
        for column, values in table.items():
            unit, about = TABLES[name][column]
            variables[column] = dimension, values, {"units": unit or "1", "long_name": about}
        return xarray.Dataset(variables, attrs={"case": self.name, "table": name})

    def __repr__(self) -> str:
        outcome = "success" if self.success else "no success"
        energy = self.summary.energy_J
        known = "" if energy is None else f", {words.energy(energy)}"
        return f"<Solution {self.name}: {outcome}{known}, {str(self.folder)!r}>"

    def _repr_html_(self) -> str:
        """Return the summary as a table for notebooks."""
        cells = [map(html.escape, row) for row in self.summary.rows(self.case)]
        rows = "".join(f"<tr><th>{label}</th><td>{text}</td></tr>" for label, text in cells)
        return f"<table>{rows}</table>"


def _package(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        remedy = f"install it with: pip install {name}"
        raise InputError(f"the package {name} is not installed", remedy) from None


def _read_csv(path: Path, columns: tuple[str, ...], maybe: set[str]) -> dict[str, np.ndarray]:
    """Return the columns of a table, which may hold nan and inf; empty without file or rows.

    Those of `maybe` need not be there.
    """
    if not path.exists():
        return {}
    text = read_text(path, "table of a result", MAX_CSV_BYTES)
    table = Csv(text, path, ",".join(name for name in columns if name not in maybe))
    rows = list(table)
    columns = tuple(name for name in columns if name not in maybe or name in table.header)
    for name in columns:
        if name not in table.header:
            raise table.refuse(f"lacks the column {name}", "run the case again")
        table.place(name)
    if not rows:
        return {}
    found = number_columns(rows, table.header, path, columns, parse=_any_number)
    for column in found.values():
        column.values.flags.writeable = False
    return {name: column.values for name, column in found.items()}


def _any_number(text: str) -> float | None:
    """Return a number, which may be what an optimizer met: nan, inf or -inf."""
    return float(text) if text in ("nan", "inf", "-inf") else parse_number(text)
