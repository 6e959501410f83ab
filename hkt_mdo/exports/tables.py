"""The tables of a result as CSV, JSON and NetCDF: blade, coefficients, operation, loads, series."""

from collections.abc import Iterable
from typing import Annotated, Any, NamedTuple

import numpy as np

from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.dynamics.trajectory import trajectory_of
from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Format, cut_in, provenance
from hkt_mdo.files.shipped import COLUMNS
from hkt_mdo.files.table import csv_text
from hkt_mdo.problem.evaluation import loads_along, scalars
from hkt_mdo.quantities import LOADS, QUANTITIES
from hkt_mdo.results.design import Design
from hkt_mdo.results.folder import to_json
from hkt_mdo.results.solution import TABLES, dataset
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.sections import Pair, Quantity

RATIO_STEP = 0.1  # of the tip speed ratios of the coefficients
SLOWEST = 0.5  # tip speed ratio at which coefficients begin
BEYOND = 2.0  # largest tip speed ratio of the coefficients over the largest one in operation
WIDER = 0.2  # by which the flow speeds of steady operation go beyond those of the case, relatively
FLOWS = 41  # flow speeds of steady operation
LOAD_FLOWS = 5  # flow speeds for which loads by station are written
REVOLUTIONS = 30.0 / np.pi  # a minute, for 1 rad/s


class Column(NamedTuple):
    """A column of a table.

    Attributes
    ----------
    values : ndarray of shape (n_rows,)
        Numbers or texts.
    unit : str or None
        SI unit; None for a plain number or a text.
    text : str
        Meaning, in words.
    """

    values: Any
    unit: str | None
    text: str


class Table(NamedTuple):
    """A table: its name, what it holds, and its columns by name.

    Attributes
    ----------
    name, title : str
        Name of the file or group, and a line of text.
    columns : dict of Column
        All of one length.
    """

    name: str
    title: str
    columns: dict[str, Column]


class _Tables(Format):
    """What the formats of tables share."""

    flow_range: Pair[Annotated[float, Quantity("m/s", gt=0)]] | None = None
    """Slowest and fastest flow of the table of steady operation; null: those of the case, a fifth
    wider, between the cut-in and the cut-out speed."""


class Csv(_Tables):
    """One CSV file a table; lines that begin with # are comments."""

    def files(self, design: Design) -> dict[str, str]:
        contents, source = {}, provenance(design.solution)
        for table in tables(design, self.flow_range):
            legend = (f"{name} [{c.unit or '-'}]: {c.text}" for name, c in table.columns.items())
            plain = (np.asarray(column.values).tolist() for column in table.columns.values())
            rows = zip(*plain, strict=True)
            remarks = *source, table.title, *legend
            contents[f"{table.name}.csv"] = csv_text(table.columns, rows, remarks)
        return contents


class Json(_Tables):
    """One JSON file of all tables; NaN is null."""

    def files(self, design: Design) -> dict[str, str]:
        solution, contents = design.solution, {}
        for table in tables(design, self.flow_range):
            columns = {
                name: {"unit": c.unit, "long_name": c.text, "values": np.asarray(c.values)}
                for name, c in table.columns.items()
            }
            contents[table.name] = {"title": table.title, "columns": columns}
        data = {"provenance": provenance(solution), "case": solution.case.model_dump(mode="json")}
        return {"result.json": f"{to_json(data | {'tables': contents})}\n"}


class Netcdf(_Tables):
    """One NetCDF file, a group a table, whose dimension is the table's first column."""

    def files(self, design: Design) -> dict[str, bytes]:
        all_tables = tables(design, self.flow_range)
        groups = {x.name: dataset(x.columns, title=x.title) for x in all_tables}
        from xarray import DataTree

        tree = DataTree.from_dict(groups)
        source = "\n".join(provenance(design.solution))
        tree.attrs = {"source": source, "title": design.solution.name}
        return {"result.nc": bytes(tree.to_netcdf(engine="netcdf4"))}


def tables(design: Design, flow_range: tuple[float, float] | None = None) -> list[Table]:
    """Return all tables of a result.

    Parameters
    ----------
    design : Design
        The design of the result.
    flow_range : tuple of float, optional
        Ends of the flow speeds of steady operation (m/s).

    Returns
    -------
    list of Table
        With several scenarios, tables of one scenario end with its name.
    """
    steady, scenarios = steady_operation(design, flow_range), design.solution.tables
    all_tables = [_design(design), _blade(design), _coefficients(design)]
    if steady is not None:
        all_tables.append(_operation(design, steady))
    all_tables += _station_loads(design, steady)
    named = len(scenarios) > 1
    for scenario, part in scenarios.items():
        of, ending = (f" of the scenario {scenario}", f"_{scenario}") if named else ("", "")
        for name, (label, title) in _SERIES.items():
            if columns := part[name]:
                described = {key: Column(x, *TABLES[name][key]) for key, x in columns.items()}
                all_tables.append(Table(label + ending, title + of, described))
    return all_tables


_SERIES = {
    "trajectory": ("trajectory", "optimized trajectory at the collocation nodes"),
    "simulation": ("simulation", "independent integration of the same design with direct BEM"),
    "loads": ("loads_over_span", "loads along the span when stress and suction are largest"),
}
"""Name and title of the tables that a result has."""


def _design(design: Design) -> Table:
    """Return the numbers of a design: dimensions, masses, law and gains."""
    blade, law, physics = design.blade, design.law, design.physics
    rows: list[tuple[str, float, str, str]] = [
        ("tip_radius", blade.tip_radius, "m", "radius of the tip, along the blade"),
        ("hub_radius", blade.hub_radius, "m", "radius of the blade's root, along the blade"),
        ("cone", blade.cone, "rad", "angle of the blades to the rotor plane"),
        ("blade_count", blade.blade_count, "1", "number of blades"),
    ]
    values = scalars(physics, physics.rotor, blade)
    for name in ("rotor_radius", "density", "inertia", "mass", "blade_area"):
        rows.append((name, values[name], QUANTITIES[name].unit or "1", QUANTITIES[name].text))
    for index, (gain, unit) in enumerate(zip(design.gains, law.gain_units, strict=True)):
        rows.append((f"gain_{index}", gain, unit or "1", f"gain of the control law {law.law}"))
    generator = physics.case.generator
    keys = [
        ("fluid.kinematic_viscosity", physics.case.fluid.kinematic_viscosity, "m**2/s"),
        ("control.torque_limit", law.torque_limit, "N*m"),
        ("control.cut_out", law.cut_out, "m/s"),
        ("resource.cut_in", cut_in(design), "m/s"),
        ("generator.shaft_friction", generator.shaft_friction, "N*m"),
        ("generator.shaft_friction_slope", generator.shaft_friction_slope, "N*m*s/rad"),
    ]
    rows += [(key.split(".")[1], x, unit, f"{key} of the case") for key, x, unit in keys if x]
    columns = _columns("design", zip(*rows, strict=True))
    return Table("design", f"numbers of the design; the control law is {law.law}", columns)


def _columns(table: str, values: Iterable[Any]) -> dict[str, Column]:
    """Return the columns of a table, from their values in the order of `COLUMNS`."""
    texts = COLUMNS["exports"][table].items()
    return {name: Column(x, *header) for (name, header), x in zip(texts, values, strict=True)}


def _quantities(values: dict[str, Any]) -> dict[str, Column]:
    """Return the columns of quantities, from their values by name."""
    quantities = {name: QUANTITIES[name] for name in values}
    return {x.column: Column(values[name], x.unit, x.text) for name, x in quantities.items()}


def _blade(design: Design) -> Table:
    blade, thickness = design.blade, design.thickness
    shape = blade.r, blade.r / blade.tip_radius, blade.chord, blade.twist
    values = *shape, np.rad2deg(blade.twist), thickness, thickness * blade.chord
    columns, names = _columns("blade", values), section_names(design)
    if names:
        text = "section; of a station between two, both and the share of the second"
        columns["section_name"] = Column(names, None, text)
    return Table("blade", "stations of the blade, from hub to tip", columns)


def section_names(design: Design) -> list[str]:
    """Return the name of each station's section; empty where the thickness is designed.

    Parameters
    ----------
    design : Design
        The design of a result.

    Returns
    -------
    list of str
        One name a station; between two sections, both and the share of the second.
    """
    blends = design.turbine.blends
    names = [{0.0: a, 1.0: b}.get(c, f"{a} to {b}, {c:.4g}") for a, b, c in blends]
    return names * design.blade.r.size if len(names) == 1 else names


def _coefficients(design: Design) -> Table:
    """Return the coefficients of the blade from slow rotation to beyond its operation."""
    solution = design.solution
    largest = [np.max(part["trajectory"]["tip_speed_ratio"]) for part in solution.tables.values()]
    largest.append(solution.summary.tip_speed_ratio_at_power_coefficient_max or 0.0)
    count = np.ceil((BEYOND * max(largest) - SLOWEST) / RATIO_STEP) + 1
    ratio, rotor = np.round(SLOWEST + RATIO_STEP * np.arange(count), 6), design.physics.rotor
    polars: Any = rotor.polar
    coefficients, title = rotor.coefficients(design.blade, ratio), "coefficients by direct BEM"
    if polars.follows_reynolds:
        title += f", Reynolds numbers at a flow of {polars.flow_speed:.6g} m/s"
    values = ratio, coefficients.power, coefficients.torque, coefficients.thrust
    return Table("coefficients", title, _columns("coefficients", values))


def steady_operation(
    design: Design, flow_range: tuple[float, float] | None = None
) -> dict[str, np.ndarray] | None:
    """Return the steady operation of a feedback law over the speed of the flow, by direct BEM.

    A flow is left out where the rotor has no equilibrium: no torque of the law balances that of the
    flow.

    Parameters
    ----------
    design : Design
        The design of a result.
    flow_range : tuple of float, optional
        Slowest and fastest flow (m/s); by default those of the case, a fifth wider, between the
        cut-in and the cut-out speed.

    Returns
    -------
    dict of ndarray or None
        Quantities over time and loads, SI units, by the names in `hkt_mdo.quantities`, without
        those flows in which there is no balance. None for open loop, which has no such law.

    Raises
    ------
    InputError
        If the law has no torque in equilibrium at any of these speeds.
    """
    law, physics, blade = design.law, design.physics, design.blade
    if not isinstance(law, FeedbackLaw):
        return None
    if flow_range is None:
        speed = np.concatenate([scenario.speeds for scenario in physics.scenarios])
        low = max((1.0 - WIDER) * float(np.min(speed)), cut_in(design))
        high = min((1.0 + WIDER) * float(np.max(speed)), law.cut_out or np.inf)
        flow_range = round(low, 3), round(high, 3)
    flow, speed = design.steady(np.linspace(*flow_range, FLOWS))
    if not flow.size:
        remedy = "check the gains of the result; csv, json and netcdf take other flows: flow_range"
        problem = "has no steady operation between {:.4g} and {:.4g} m/s".format(*flow_range)
        raise InputError(problem, remedy, key="control.law", value=law.law)
    plant, time, generator = design.plant, np.zeros(flow.size), physics.case.generator
    torques = plant.torque(speed, flow), plant.generator_torque(speed, flow)
    steady = trajectory_of(time, flow, speed, *torques, blade.rotor_radius, generator)
    del steady["time"]
    return steady | loads_along(physics.rotor, blade, steady, physics.rotor.load_names)


def _operation(design: Design, steady: dict[str, np.ndarray]) -> Table:
    """Return steady operation as a table, with how much of each limit it uses."""
    physics, flow = design.physics, steady["inflow_speed"]
    scale = power_scale(physics.density, design.blade.rotor_radius, flow)
    rpm, power = steady["rotor_speed"] * REVOLUTIONS, steady["hydrodynamic_power"] / scale
    columns = _quantities(steady) | _columns("operation", (rpm, power, np.zeros(flow.size)))
    values = steady | scalars(physics, physics.rotor, design.blade)
    for limit in physics.all_limits:
        if limit.place == "time" and np.isfinite(limit.end) and values.keys() >= set(limit.inputs):
            name, share = f"{limit.name}_over_limit", limit.share(values)
            if name in columns:  # of another scenario: the stricter one counts
                share = np.maximum(share, columns[name].values)
            columns[name] = Column(share, None, f"{limit.name} over its limit: 1 is the limit")
    title = "steady operation under the control law; flows without a balance of torques are missing"
    return Table("operation", title, columns)


def _station_loads(design: Design, steady: dict | None) -> list[Table]:
    """Return the load cases, and the loads of the stations in each."""
    names, scenarios, points = _load_cases(design, steady)
    blade, flow = design.blade, points["inflow_speed"]
    number = np.arange(1, len(names) + 1)
    columns = _columns("load_cases", (number, names, scenarios, points.pop("time")))
    polar = design.physics.rotor.polar.in_flow(flow)
    sections = bem.sections(blade, polar, points["tip_speed_ratio"])
    across = flow[:, None] * np.cos(blade.cone)  # speed of the flow normal to the blade
    pressure, speed = 0.5 * design.physics.density * across**2, sections.relative_speed * across
    with np.errstate(divide="ignore", invalid="ignore"):  # NaN for a section without a root
        loads = np.stack((sections.normal_load, sections.tangential_load))
        normal, tangential = loads / (blade.chord * sections.relative_speed**2)
    sine, cosine = np.sin(sections.inflow_angle), np.cos(sections.inflow_angle)
    by_station = np.broadcast_arrays(
        *(number[:, None], blade.r, blade.chord),
        pressure * sections.normal_load,
        pressure * sections.tangential_load,
        sections.angle_of_attack,
        np.rad2deg(sections.angle_of_attack),
        speed,
        speed * blade.chord / design.physics.case.fluid.kinematic_viscosity,
        sections.axial_induction,
        sections.tangential_induction,
        normal * cosine + tangential * sine,
        normal * sine - tangential * cosine,
    )
    title = "operating points of the table station_loads"
    text = "loads per length at the stations by direct BEM; linear in between, zero at hub and tip"
    return [
        Table("load_cases", title, columns | _quantities(points)),
        Table("station_loads", text, _columns("station_loads", map(np.ravel, by_station))),
    ]


def _load_cases(
    design: Design, steady: dict | None
) -> tuple[list[str], list[str], dict[str, np.ndarray]]:
    """Return names, scenarios and operating points: instants of largest loads, and some flows."""
    tables = design.solution.tables
    series = [part["simulation"] or part["trajectory"] for part in tables.values()]
    scenario = np.repeat(list(tables), [table["time_s"].size for table in series])
    recorded = {
        name: np.concatenate([table[QUANTITIES[name].column] for table in series])
        for name in (*_AT, *LOADS)
        if all(QUANTITIES[name].column in table for table in series)
    }
    largest: dict[int, list[str]] = {}
    for name in (x for x in LOADS if x in recorded):
        row = int(np.argmax(recorded[name]))
        largest.setdefault(row, []).append(name.replace("_", " "))
    instants = list(largest)
    operation, of, word = recorded, scenario, "recorded"
    if steady is not None:
        size = steady["inflow_speed"].size
        operation, of, word = steady | {"time": np.full(size, np.nan)}, np.full(size, ""), "steady"
    flow = operation["inflow_speed"]
    wanted = np.linspace(np.min(flow), np.max(flow), LOAD_FLOWS)
    rows = [*dict.fromkeys(np.argmin(np.abs(flow - wanted[:, None]), axis=1))]
    names = [f"largest {', '.join(loads)}" for loads in largest.values()]
    names += [f"{word} at {flow[row]:.4g} m/s" for row in rows]
    points = {x: np.concatenate((recorded[x][instants], operation[x][rows])) for x in _AT}
    return names, [*scenario[instants], *of[rows]], points


_AT = "time", "inflow_speed", "rotor_speed", "tip_speed_ratio", "control_torque"
