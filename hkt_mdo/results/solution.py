"""A result folder as arrays and figures of merit, without the modules that computed them.

A folder may come from any source: its files are limited in size and read as text, never as pickles.
"""

import html
import os.path
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hkt_mdo.case import Case, load_case
from hkt_mdo.case.kinds import Extension
from hkt_mdo.dynamics.laws import Law
from hkt_mdo.dynamics.limits import Limit, RotorSpeedLimit, TorqueLimit
from hkt_mdo.errors import InputError, needed
from hkt_mdo.files.shipped import COLUMNS
from hkt_mdo.files.table import Csv, number_columns, parse_number, read_bytes, read_text
from hkt_mdo.quantities import LOADS, OVER_TIME, QUANTITIES, RATES
from hkt_mdo.results.summary import BLADE, Achieved, Summary
from hkt_mdo.results.words import Row, measured, printable

if TYPE_CHECKING:
    from hkt_mdo.results.design import Design

__all__ = ["TABLES", "Solution"]

MAX_BYTES, MAX_CSV_BYTES = 16 * 1024**2, 64 * 1024**2
"""Largest summary and largest table that are read."""

_OVER_TIME: dict[str, Sequence[Any]] = {
    x.column: (x.unit, x.text) for x in map(QUANTITIES.__getitem__, OVER_TIME)
}

TABLES: dict[str, dict[str, Sequence[Any]]] = {
    **dict.fromkeys(("trajectory", "simulation"), _OVER_TIME),
    **COLUMNS["result"],
}
"""Unit (None: dimensionless) and description of each column of each table of a result."""

_MAYBE = {"flapwise_moment_Nm", "thrust_coefficient", "start_thrust_coefficient"}
_MAYBE |= {QUANTITIES[name].column for name in (*LOADS, *RATES)}
"""Columns that are there only if they are known of the rotor; older results lack them."""


Table = dict[str, np.ndarray]
_OF_SCENARIOS = ("trajectory", "simulation", "loads", "year")
_OF_RESULT = ("coefficients", "convergence")


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """The result of a run, from its folder; a table that the run did not reach is an empty dict.

    `trajectory`, `simulation` and `loads` are tables of one scenario. A result with several
    scenarios has them by `scenario(name)`; its own attributes then raise an InputError that names
    the scenarios.

    Attributes
    ----------
    folder : Path
        The result folder.
    case : Case
        The case that was run, every default written out.
    summary : Summary
        Figures of merit, by the keys of ``summary.json``.
    tables : dict of dict
        Tables over time and along the blade by their names, by scenario.
    coefficients, convergence : dict of ndarray
        Tables of the whole result: column[n_rows] by name; `TABLES` has units and meanings.
    """

    folder: Path
    case: Case
    summary: Summary
    tables: dict[str, dict[str, Table]]
    coefficients: Table
    convergence: Table

    @classmethod
    def load(cls, folder: str | Path, *, extensions: Iterable[Extension] = ()) -> "Solution":
        """Read a result folder, as read-only arrays; after an interruption, tables may be missing.

        Parameters
        ----------
        folder : str or Path
            A folder that a run has written.
        extensions : iterable
            As in `load_case`; extensions are never loaded because a folder names them.

        Returns
        -------
        Solution

        Raises
        ------
        InputError
            If it is not a result folder, or a file in it is too large, corrupt or of a newer
            version.
        """
        folder = Path(folder)
        for name in ("", "case.yaml", "summary.json"):
            # unlike Path.exists, it takes names that are too long or hold a null character
            if not os.path.exists(folder / name):  # noqa: PTH110
                problem = f"is no result folder: it lacks {name}" if name else "does not exist"
                remedy = "give a folder that a run wrote, or run the case again"
                raise InputError(problem, remedy, file=folder)
        case = load_case(folder / "case.yaml", check_files=False, extensions=extensions)
        path = folder / "summary.json"
        summary = Summary.parse(read_bytes(path, MAX_BYTES, "summary of a result"), path)
        # an older result, and one that did not come to its end, name no scenario
        names, tables = tuple(summary.scenarios or ("phase",)), {}
        for name in names:
            suffix = f"_{name}" if len(names) > 1 else ""
            tables[name] = {table: _read_table(folder, table, suffix) for table in _OF_SCENARIOS}
        whole = (_read_table(folder, name) for name in _OF_RESULT)
        return cls(folder, case, summary, tables, *whole)

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of the scenarios."""
        return tuple(self.tables)

    def scenario(self, name: str) -> "Solution":
        """Return the result of one scenario alone.

        Parameters
        ----------
        name : str
            One of `scenarios`.

        Returns
        -------
        Solution
            Its tables, energies, limits and loads are those of the scenario, without its weight;
            values of the whole result, such as bounds, are None.

        Raises
        ------
        InputError
            If there is no such scenario.
        """
        if name not in self.tables:
            remedy = f"give one of {', '.join(self.tables)}"
            raise InputError("unknown scenario", remedy, file=self.folder, value=name)
        case = self.case.of_scenario(name)
        # the coefficients are those of the sections in the case's own condition
        others = {"torque_constant": 1.0, "inertia": 1.0}
        part, whole = (x.condition.model_copy(update=others) for x in (case, self.case))
        alone = replace(self, case=case, coefficients=self.coefficients if part == whole else {})
        if len(self.tables) == 1:
            return alone
        entry = (self.summary.scenarios or {})[name]
        changes = dict.fromkeys(("objective", "energy_bound_J", "certified_gap"))
        changes |= {key: getattr(entry, key) for key in Achieved.model_fields}
        changes["scenarios"] = {name: entry}
        summary = self.summary.model_copy(update=changes)
        return replace(alone, summary=summary, tables={name: self.tables[name]})

    @property
    def by_scenario(self) -> tuple["Solution", ...]:
        """The results of all scenarios, each alone."""
        return tuple(self.scenario(name) for name in self.tables)

    def _only(self, table: str) -> Table:
        """Return a table of the only scenario."""
        first = next(iter(self.tables))
        if len(self.tables) > 1:
            problem = f"has several scenarios: {', '.join(self.tables)}"
            remedy = f"choose one, such as solution.scenario({first!r}), or --scenario {first}"
            raise InputError(problem, remedy, file=self.folder)
        return self.tables[first].get(table, {})

    @property
    def trajectory(self) -> Table:
        """The optimized trajectory at the collocation nodes, of the only scenario."""
        return self._only("trajectory")

    @property
    def simulation(self) -> Table:
        """The independent integration of the same design, of the only scenario."""
        return self._only("simulation")

    @property
    def loads(self) -> Table:
        """Loads along the blade at the times of the largest ones, of the only scenario."""
        return self._only("loads")

    @property
    def year(self) -> Table:
        """Power curve and energy of a year by bins of the flow speed, of the only scenario."""
        return self._only("year")

    @property
    def steady(self) -> bool:
        """Whether the only scenario has no time."""
        entries = [*(self.summary.scenarios or {}).values()]
        return len(entries) == 1 and entries[0].steady

    def design(self) -> "Design":
        """Return blade, law, and turbine with polars and outlines of the result, as objects.

        Returns
        -------
        hkt_mdo.results.design.Design

        Raises
        ------
        InputError
            If the run did not finish, or a file that the case names is missing or broken.
        """
        if self.summary.chord_m is None or not all(x["trajectory"] for x in self.tables.values()):
            remedy = "run the case again, or resume it"
            raise InputError("holds no finished design", remedy, file=self.folder)
        from hkt_mdo.results.design import Design

        return Design.of(self)

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.case.name

    @property
    def success(self) -> bool:
        """Whether the optimizer converged and every check of the result passed."""
        return self.summary.success

    @property
    def finished(self) -> bool:
        """Whether the run finished, so that its result was checked."""
        return self.summary.checks is not None

    @property
    def message(self) -> str:
        """Why the run ended, one printable line."""
        return printable(self.summary.message or "")

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
        return tuple(printable(note) for note in self.summary.notes or ())

    def across_gaps(self, time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return times and values (n_times,) with NaN wherever the machine stood still between two.

        A line through them is then interrupted there; `time` is that of the table.
        """
        operation = self.summary.operation
        spans = np.reshape(operation.intervals_s if operation else [], (-1, 2))
        gaps = np.searchsorted(time, 0.5 * (spans[:-1, 1] + spans[1:, 0]))
        return np.insert(time, gaps, np.nan), np.insert(values, gaps, np.nan)

    @property
    def law(self) -> Law:
        """The control law; a torque limit that was out of reach in the run counts as none."""
        case, limits = self.case.of_scenario(), self.summary.limits
        reached = limits is None or "control_torque" in limits
        law = case.control.model_copy(update={} if reached else {"torque_limit": None})
        return law.applied(case.condition.torque_constant)

    @property
    def limits(self) -> tuple[Limit, ...]:
        """Limits of the case on quantities over time, that of the torque first."""
        case, law = self.case.of_scenario(), self.law
        material = case.rotor.blade_material  # which may have the allowable stress
        limits = {x.name: x.on(None, material) for x in case.limits.given if x.place == "time"}
        if speed := (self.summary.limits or {}).get("rotor_speed"):  # perhaps of generator.table
            limits["rotor_speed"] = RotorSpeedLimit(bound=speed.limit or np.inf)
        every = TorqueLimit(bound=law.largest_torque), *limits.values()
        return tuple(limit for limit in every if np.isfinite(limit.end))

    @property
    def _scalars(self) -> dict[str, float]:
        """The quantities of the design that limits over time take, as far as they are known."""
        summary, density = self.summary, self.case.of_scenario().fluid.density
        scalars = {"rotor_radius": summary.rotor_radius_m, "inertia": summary.inertia_kg_m2}
        scalars["weight_stress"] = summary.weight_stress_Pa
        return {"density": density} | {k: x for k, x in scalars.items() if x is not None}

    def limit_shares(self) -> Table:
        """Return how much of each limit is used, (n_times,), by its name: 1 is the limit.

        Of `simulation`, else of `trajectory`. A limit is left out if the table lacks its
        quantities, as in older results.
        """
        columns: dict[str, Any] = self.simulation or self.trajectory
        headers = {name: QUANTITIES[name].column for name in OVER_TIME}
        values = self._scalars | {k: columns[x] for k, x in headers.items() if x in columns}
        return {x.name: x.share(values) for x in self.limits if values.keys() >= set(x.inputs)}

    def limit_levels(self, quantity: str) -> Iterator[tuple[Limit, float]]:
        """Yield limits of a quantity or load, and the value of it at which each is met.

        Those that are proportional to it, as the tip speed is to `rotor_speed`.
        """
        scalars = self._scalars
        for limit in self.limits:
            if quantity in limit.inputs and {quantity, *scalars} >= set(limit.inputs):
                one, two = (limit.value_of(scalars | {quantity: x}) for x in (1.0, 2.0))
                if one > 0.0 and two == 2.0 * one:
                    yield limit, float(limit.end / one)

    @property
    def failed_checks(self) -> tuple[str, ...]:
        """Checks that the result did not pass, each as one printable line."""
        return tuple(str(check) for check in self.summary.checks or () if not check.passed)

    @property
    def overview(self) -> dict[str, list[Row]]:
        """Figures of merit, notes, warnings and failed checks: rows by the titles of tables."""
        warnings = self.summary.warnings(self.case)
        return self.summary.tables(self.case) | {
            "Notes": [Row("", note, severity="note") for note in self.notes],
            "Warnings": [Row("", text, severity="warning") for text in warnings],
            "Checks not passed": [Row("", text, severity="failure") for text in self.failed_checks],
        }

    @property
    def blade(self) -> Table:
        """Chord and twist of the blade and of the blade at the start, column[n_stations]."""
        columns = {name: getattr(self.summary, name) for name in BLADE}
        return {name: np.array(values) for name, values in columns.items() if values is not None}

    def table(self, name: str, scenario: str | None = None) -> Table:
        """Return a table.

        Parameters
        ----------
        name : str
            A key of `TABLES`.
        scenario : str, optional
            One of `scenarios`; by default, the only one.

        Returns
        -------
        dict of ndarray
            column[n_rows] by name.

        Raises
        ------
        InputError
            If there is no such table or scenario, if the run did not reach it, or if several
            scenarios have one and none is chosen.
        """
        if name not in TABLES:
            raise InputError("unknown table", f"known: {', '.join(TABLES)}", value=name)
        table: Table = getattr(self if scenario is None else self.scenario(scenario), name)
        if not table:
            raise InputError(f"has no {name}", "let the run finish", file=self.folder)
        return table

    def to_pandas(self, name: str = "trajectory", scenario: str | None = None) -> Any:
        """Return a table as a pandas DataFrame, whose attrs hold the units.

        Parameters, errors and the choice of a scenario are those of `table`.
        """
        frame = _package("pandas").DataFrame(self.table(name, scenario))
        frame.attrs["units"] = {column: TABLES[name][column][0] or "1" for column in frame}
        return frame

    def to_xarray(self, name: str = "trajectory", scenario: str | None = None) -> Any:
        """Return a table as an xarray Dataset over its first column.

        Every variable has the attributes ``units`` and ``long_name``. Parameters, errors and the
        choice of a scenario are those of `table`: every scenario has times of its own.
        """
        columns = {x: (y, *TABLES[name][x]) for x, y in self.table(name, scenario).items()}
        attrs = {"case": self.name, "table": name} | ({"scenario": scenario} if scenario else {})
        return dataset(columns, **attrs)

    def to_datatree(self) -> Any:
        """Return all tables as an xarray DataTree, whose method `to_netcdf` writes one file.

        A node a table, as of `to_xarray`; with several scenarios, theirs are below a node of the
        scenario's name. The root's attributes are the numbers of `summary`.
        """
        whole = {x: self.to_xarray(x) for x in ("blade", *_OF_RESULT) if getattr(self, x)}
        for part in self.by_scenario:
            above = f"{part.scenarios[0]}/" if len(self.scenarios) > 1 else ""
            names = (name for name in _OF_SCENARIOS if getattr(part, name))
            whole |= {above + name: part.to_xarray(name) for name in names}
        tree = _package("xarray").DataTree.from_dict(whole, name=self.name)
        tree.attrs = {k: x for k, x in self.summary.model_dump().items() if isinstance(x, float)}
        return tree

    def plot(self, *names: str) -> Any:
        """Return figures by their names, which a notebook shows.

        Parameters
        ----------
        *names : str
            Of `hkt_mdo.results.charts.FIGURES`; by default blade, operation, power_curve and
            limits, as far as the result has their data.

        Returns
        -------
        dict of matplotlib.figure.Figure
            With a picture of each for a notebook.

        Raises
        ------
        InputError
            If there is no figure of a name.
        """
        drawn = import_module("hkt_mdo.results.charts")  # Matplotlib takes its time
        return drawn.figures(self, names or ("blade", "operation", "power_curve", "limits"))

    def __repr__(self) -> str:
        energy = self.summary.energy_J
        amount = "" if energy is None else f", {measured(energy, 'J')}"
        verdict = self.summary.verdict(self.case)
        return f"<Solution {self.name}: {verdict}{amount}, {str(self.folder)!r}>"

    def _repr_html_(self) -> str:
        """Return the summary as a table for notebooks."""
        rows = "".join(
            f"<tr><th>{html.escape(row.label)}</th><td>{html.escape(row.text)}</td></tr>"
            for row in self.summary.rows(self.case)
        )
        return f"<table>{rows}</table>"


def dataset(columns: Mapping[str, Sequence[Any]], **attrs: str) -> Any:
    """Return columns as an xarray Dataset over the first one, with its attributes.

    Each column has values, unit (None: dimensionless) and meaning. InputError without xarray.
    """
    dimension = next(iter(columns))
    variables = {
        name: (dimension, np.asarray(values), {"units": unit or "1", "long_name": meaning})
        for name, (values, unit, meaning) in columns.items()
    }
    return _package("xarray").Dataset(variables, attrs=attrs)


def _package(name: str) -> Any:
    return needed(name, f"install it with: pip install {name}")


def _read_table(folder: Path, name: str, suffix: str = "") -> Table:
    """Return a table of `TABLES`, which may hold nan and inf; empty without file or rows.

    `suffix`: what the name of the file has besides that of the table.
    """
    path, columns = folder / f"{name}{suffix}.csv", tuple(TABLES[name])
    if not path.exists():
        return {}
    required = [column for column in columns if column not in _MAYBE]
    text = read_text(path, "table of a result", MAX_CSV_BYTES)
    table = Csv(text, path, ",".join(required), columns)
    table.check(required, "table of a result")
    rows = list(table)
    numbers = number_columns(rows, table.header, path, columns, parse=_any_number) if rows else {}
    for column in numbers.values():
        column.values.flags.writeable = False
    return {name: column.values for name, column in numbers.items()}


def _any_number(text: str) -> float | None:
    """Return a number, which may be nan, inf or -inf, as an optimizer may have had."""
    return float(text) if text in ("nan", "inf", "-inf") else parse_number(text)
