"""The table of a sweep: a row a run, as CSV, Parquet and NetCDF.

A sweep's folder has `sweep.yaml`, `table.csv` and the result folders of its runs in `runs`.
"""

import csv
import io
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.case.document import quantities
from hkt_mdo.case.sweep import SWEEP, Sweep, load_sweep
from hkt_mdo.errors import InputError
from hkt_mdo.files.table import csv_text, read_text, write_files
from hkt_mdo.quantities import column_of
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.words import PREFIXED, plain_unit, prefixed

TABLE = "table.csv"
VERIFIED, REFUSED, ERROR = "verified", "refused", "error"
"""States of a run: a success; a result that its checks refused; none, see its message."""
NULL = "null"
"""What `table.csv` has where a sweep gives null to a key, such as a limit in a run without it."""
MAX_BYTES = 1024**3
_MERITS = (
    *("simulated_energy_J", "generator_energy_J", "electrical_energy_J", "energy_bound_J"),
    *("certified_gap", "power_coefficient_max", "rotor_radius_m", "inertia_kg_m2", "mass_kg"),
    *("iterations", "wall_seconds"),
)
"""Numbers of a summary that have a column under their own names."""

Row = dict[str, Any]


def row_of(solution: Solution) -> Row:
    """Return what the table has of a result, in SI units.

    Parameters
    ----------
    solution : Solution
        A finished result.

    Returns
    -------
    dict
        Values by the names of their columns; energies are those of the integration.
    """
    summary, case = solution.summary, solution.case
    gains = np.atleast_1d([] if summary.gain is None else summary.gain)
    return {
        "state": VERIFIED if solution.success else REFUSED,
        "objective": None if summary.objective is None else summary.objective.simulated,
        "objective_unit": case.objective.unit,
        "better": "larger" if case.objective.maximize else "smaller",
        **{name: getattr(summary, name) for name in _MERITS},
        **{column_of(name, load.unit): load.value for name, load in (summary.loads or {}).items()},
        **{f"gain_{number}": float(gain) for number, gain in enumerate(gains)},
        "binding": " ".join(x for x, entry in (summary.limits or {}).items() if entry.binding),
        "message": "" if solution.success else solution.message,
    }


def write_table(folder: Path, sweep: Sweep, rows: Sequence[Row]) -> None:
    """Write the table of a sweep: CSV, and as packages allow Parquet and, of a grid, NetCDF.

    Parameters
    ----------
    folder : pathlib.Path
        The sweep's folder.
    sweep : Sweep
        What was asked.
    rows : sequence of dict
        A row for each point, in the order of the points.
    """
    names = list(dict.fromkeys(name for row in rows for name in row))
    names.sort(key="message".__eq__)  # a text, the last one
    text = csv_text(names, ([row.get(name) for name in names] for row in rows))
    files: dict[Path, str | bytes] = {folder / TABLE: text}
    columns = {name: _column(row.get(name) for row in rows) for name in names}
    if all(map(find_spec, ("pandas", "pyarrow"))):
        from pandas import DataFrame

        files[folder / "table.parquet"] = DataFrame(columns).to_parquet(None)
    grid, shape, keys = folder / "grid.nc", sweep.shape, sweep.columns
    for stale in {grid, folder / "table.parquet"} - {*files}:
        stale.unlink(missing_ok=True)
    write_files(files)
    if not sweep.sampled and len(rows) == sweep.size and all(map(find_spec, ("xarray", "netCDF4"))):
        from xarray import Dataset

        shaped = {name: values.reshape(shape) for name, values in columns.items()}
        along = {key: np.moveaxis(shaped.pop(key), at, 0) for at, key in enumerate(keys)}
        axes = {key: each.reshape(len(each), -1)[:, 0] for key, each in along.items()}
        Dataset({name: (keys, each) for name, each in shaped.items()}, axes).to_netcdf(grid)


def _column(values: Iterable[Any]) -> np.ndarray:
    """Return values as numbers, NaN for none and null; as texts if another one is no number."""
    cells = ["" if value is None else value for value in values]
    with suppress(ValueError):
        if any(value not in ("", NULL) for value in cells):
            return np.array([np.nan if x in ("", NULL) else float(x) for x in cells])
    return np.array([str(value) for value in cells])


@dataclass(frozen=True, eq=False)
class SweepTable:
    """The table of a sweep, read from its folder.

    Attributes
    ----------
    folder : pathlib.Path
        The sweep's folder.
    sweep : Sweep
        What was asked.
    columns : dict of ndarray, shape (n_runs,)
        Numbers, NaN for none, or texts, by the names of the columns.
    """

    folder: Path
    sweep: Sweep
    columns: dict[str, np.ndarray]

    @classmethod
    def load(cls, folder: str | Path) -> "SweepTable":
        """Read the table in a sweep's folder.

        Parameters
        ----------
        folder : str or pathlib.Path
            The folder.

        Returns
        -------
        SweepTable
            The table.

        Raises
        ------
        InputError
            If there is none, or it cannot be read.
        """
        folder = Path(folder)
        sweep = load_sweep(folder / SWEEP, check=False)
        text = read_text(folder / TABLE, "table of a sweep", MAX_BYTES)
        header, *rows = list(csv.reader(io.StringIO(text))) or [[]]
        if not rows or {*map(len, rows)} != {len(header)} or not {*sweep.columns} <= {*header}:
            remedy = "run the same hkt sweep command again, which writes the table anew"
            raise InputError("is not the table of this sweep", remedy, file=folder / TABLE)
        columns = dict(zip(header, map(_column, zip(*rows, strict=True)), strict=True))
        return cls(folder, sweep, columns)

    @property
    def pages(self) -> np.ndarray:
        """Links to the reports of the runs from the sweep's folder, "" for none, (n_runs,)."""
        links = [f"{run}/report.html" if run else "" for run in self.columns["run"]]
        return np.array([x if (self.folder / x).is_file() else "" for x in links])

    @property
    def verified(self) -> np.ndarray:
        """Whether each run is a success, shape (n_runs,)."""
        return (self.columns["state"] == VERIFIED) & np.isfinite(self.objective)

    @property
    def objective(self) -> np.ndarray:
        """The objective of each run, NaN for none, shape (n_runs,)."""
        values = self.columns.get("objective", np.array(""))  # of no result none
        return values if values.dtype.kind == "f" else np.full(self.columns["state"].size, np.nan)

    @property
    def merit(self) -> np.ndarray:
        """The objective, or less it where it is to be small: a larger one is better, (n_runs,)."""
        return -self.objective if "smaller" in self.columns.get("better", ()) else self.objective

    def shown(self, name: str) -> tuple[np.ndarray, str]:
        """Return a column of numbers as people read it, shape (n_runs,), and its label.

        Parameters
        ----------
        name : str
            Of the column.

        Returns
        -------
        values : numpy.ndarray, shape (n_runs,)
            In kJ, kW, kN or MPa where they are large.
        label : str
            Name and unit; that of a key of the case is the key, with a note where it is null.
        """
        values = self.columns[name].astype(float)
        words, _, unit = name.rpartition("_")
        words = words.replace("_", " ")
        if name == "objective":
            words, unit = name, ", ".join({*self.columns["objective_unit"]} - {""})
        elif name in self.sweep.over:
            case = None
            with suppress(InputError):  # such as without an extension
                case = self.sweep.case_at(next(self.sweep.points()))
            words, unit = name, getattr(next(quantities(name, (), case), None), "unit", None) or ""
        elif unit not in ("W", "J", "N", "Pa", "Nm", "kg"):
            return values, name
        plain = plain_unit(unit.replace("Nm", "N m"))
        most = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
        prefix, scale = prefixed(most) if plain in PREFIXED else ("", 1.0)
        note = ", null left out" if name in self.sweep.over and np.isnan(values).any() else ""
        return values / scale, f"{words} ({prefix}{plain or '-'}){note}"

    @property
    def numeric(self) -> list[str]:
        """The keys of the sweep whose values are numbers."""
        return [key for key in self.sweep.columns if self.columns[key].dtype.kind == "f"]

    @property
    def cost(self) -> str:
        """The column that the Pareto front weighs against the objective; empty: there is none.

        Raises
        ------
        InputError
            If the sweep names a column that there is not.
        """
        name = self.sweep.front
        if name is None:
            return next(iter(self.numeric), "")
        names = [x for x, column in self.columns.items() if column.dtype.kind == "f"]
        if name not in names:
            remedy, where = f"give one of {', '.join(names)}", self.folder / SWEEP
            raise InputError("is no column of numbers", remedy, file=where, key="front", value=name)
        return name

    def front(self) -> np.ndarray:
        """Return the places of the verified runs that no other one betters in both respects.

        Returns
        -------
        ndarray of int
            By rising cost; with a better objective each.
        """
        cost, gain = self.columns[self.cost], self.merit
        runs = np.flatnonzero(self.verified & np.isfinite(cost))
        order = runs[np.lexsort((-gain[runs], cost[runs]))]
        return order[gain[order] > np.maximum.accumulate(np.r_[-np.inf, gain[order]])[:-1]]
