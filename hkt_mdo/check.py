"""What `hkt check` tells before a run: all that a run needs is read and built, nothing optimized.

The starting blade is put into the case's flow: blade element momentum theory and quasi-steady
operation give the figures that tell whether a case means what its author meant.
"""

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

from hkt_mdo.case import Case, Quantity
from hkt_mdo.dynamics.inflow import ConstantInflow
from hkt_mdo.problem import (
    BEM,
    MOST_SEGMENTS,
    SEGMENTS_PER_PERIOD,
    Physics,
    build_problem,
    complete,
    find_start,
    make_driver,
    physics,
)
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.blade_files import read_blade
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.polar_files import read_polars
from hkt_mdo.rotor.shape import spline_basis
from hkt_mdo.rotor.steady_optimum import SteadyOptimum, best_operation
from hkt_mdo.simulation import Plant
from hkt_mdo.starting_point import StartingPoint
from hkt_mdo.turbine import POLAR, Turbine, build_turbine

Rows = list[tuple[str, str]]
Range = tuple[float, float]

MARGIN = 0.7, 1.3
"""Tip speed ratios over the best one, to which a rotor may come while it is designed."""

MOST_INSTANTS = 2**17
"""At which the flow is looked at."""

MOST_START_SEGMENTS = 2000
"""In which the starting blade's operation is looked at."""

FIT = 0.02, float(np.deg2rad(0.5))
"""How far splines may leave chord (over the largest) and twist (rad) of the blade's file."""

EDDY = 1.25
"""Cutoff times diameter over flow speed, above which eddies are smaller than the rotor."""

# The rule of `expected_cost`: lowest and highest of what whole runs of 60 to 8640 segments took
# (docs/performance.md has iterations and memory up to 3000 segments).
TRIAL_SEGMENTS = 20, 200  # of the two problems that are built to count and to time
PASSES = 1, 2
ITERATIONS = 30, 120  # a pass
EVALUATIONS = 3.5, 6.0  # an iteration of IPOPT: line searches and its own algebra
SLSQP_EVALUATIONS = 1.2, 2.0
SLSQP_SECONDS = 4e-10, 1e-9  # unknowns³ of its dense algebra, an iteration
BASE_SECONDS = 4.0, 7.0  # imports, steady optimum, figures
START_SECONDS = 3e-4, 1.5e-3  # a segment: quasi-steady co-design
SETUP_SECONDS = 2.5e-8, 8e-8  # nodes²: Dymos' dense interpolation of states
CONTROL_SECONDS = 2.8e-11  # nodes³: that of an open loop's control
CALLS = 20, 120  # of BEM, a segment of the independent integration
OPEN_LOOP_CALLS = 3.0  # times as many where a recorded torque, which has kinks, is looked up
CALL_SECONDS = 4e-5  # of the integrator itself
BASE_BYTES, NODE_BYTES = 290e6, 20e3
PAIR_BYTES = 6.5, 15.0  # nodes²


@dataclass(frozen=True)
class ProblemSize:
    """Size of an optimization.

    Parameters
    ----------
    unknowns, constraints : dict of str to int
        By their names in the OpenMDAO problem.
    nodes : int
        At which the rotor's equation is evaluated.
    evaluation_seconds : float
        Of the model and its total derivatives, on this machine.
    """

    unknowns: dict[str, int]
    constraints: dict[str, int]
    nodes: int
    evaluation_seconds: float


@dataclass(frozen=True)
class Cost:
    """What a run may take, lowest and highest: seconds and bytes; integration_seconds are part."""

    seconds: Range
    integration_seconds: Range
    memory_bytes: Range


@dataclass(frozen=True, eq=False)
class Findings:
    """A case's flow, and its starting blade in it, in SI units.

    Parameters
    ----------
    case : Case
        Complete, its start the blade as given.
    world : Physics
    turbine : Turbine
        With the blade of the file, which splines may have left.
    plant : Plant
        The rotor with the starting blade, as it would be simulated.
    mass, inertia : float
    time, speed : array, shape (n,)
        Even instants of the whole duration, and the flow then.
    mean, deviation, mean_cube : float
        Of the flow's speed over time: mean, standard deviation, mean of the cubes.
    cutoff : float
        Highest frequency that matters in the flow; 0 where it is steady.
    best : SteadyOptimum
        Largest power coefficient of the starting blade.
    start : StartingPoint
        Its quasi-steady operation over the flow under the control law.
    working : (float, float)
        Tip speed ratios met in it; if it does not turn throughout, `MARGIN` round the best one.
    steady_speed : float or None
        Rotor speed at which the law holds it in the mean flow; None: it does not turn there.
    time_constant : float or None
        There, see `time_constant`.
    rated_speed : float or None
        Flow speed at which the torque limit is met at the best tip speed ratio; None: no limit.
    above_rated : float
        Share of the time in which the flow is faster.
    """

    case: Case
    world: Physics
    turbine: Turbine
    plant: Plant
    mass: float
    inertia: float
    time: np.ndarray
    speed: np.ndarray
    mean: float
    deviation: float
    mean_cube: float
    cutoff: float
    best: SteadyOptimum
    start: StartingPoint
    working: Range
    steady_speed: float | None
    time_constant: float | None
    rated_speed: float | None
    above_rated: float

    @property
    def rated_power(self) -> float | None:
        """Power at the rated flow speed, W."""
        limit, rated = self.world.torque_limit, self.rated_speed
        if limit is None or rated is None:
            return None
        return limit * self.best.tip_speed_ratio * rated / self.world.blade.rotor_radius


@dataclass(frozen=True, eq=False)
class CheckReport:
    """What a case means, and what a run of it would take.

    Parameters
    ----------
    name : str
        Of the case.
    tables : dict of str to list of (str, str)
        By title: rows of what, and what there is to say of it.
    notes : tuple of str
        What was converted, repaired or left out of the files.
    warnings : tuple of str
        What the author may not have meant; the case runs all the same.
    findings : Findings
    size : ProblemSize
    cost : Cost
    figures : dict of str to dict
        What `hkt_mdo.plots.check_figures` draws: blade, polar, inflow and power_curve.
    """

    name: str
    tables: dict[str, Rows]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    findings: Findings
    size: ProblemSize
    cost: Cost
    figures: dict[str, dict]


def check_case(case: Case) -> CheckReport:
    """Read and build all that a run of a case needs, and tell what it means; nothing is optimized.

    Parameters
    ----------
    case : Case

    Returns
    -------
    CheckReport

    Raises
    ------
    InputError
        If a file of the case is broken, files do not fit each other, or the optimizer that the case
        asks for is not installed.
    """
    whole = complete(case)
    world = physics(whole)
    package = make_driver(whole).package
    found = examine(whole, world)
    size = problem_size(found.case, world, found.best)
    cost = expected_cost(found.case, size, _call_seconds(found))
    met = _Met.of(found)
    told, notes = met.told()
    tables = {
        "Turbine": [*_turbine_rows(found), *met.rows()],
        "Flow": _flow_rows(found, case.phase.duration is None),
        "Control": _control_rows(found),
        "Starting blade": _start_rows(found),
        "Optimization": _optimization_rows(found, size, package),
        "A run on this machine": _cost_rows(size, cost),
    }
    warnings = (
        *_start_warnings(found),
        *_design_warnings(found),
        *told,
        *_flow_warnings(found),
        *_memory_warnings(cost),
    )
    figures = {
        "blade": _blade_data(found),
        "polar": met.data(),
        "inflow": _inflow_data(found),
        "power_curve": _power_data(found),
    }
    notes = (*world.messages, *notes)
    return CheckReport(case.name, tables, notes, warnings, found, size, cost, figures)


# The starting blade in the flow -------------------------------------------------------------------


def examine(case: Case, world: Physics) -> Findings:
    """Put the starting blade of a complete case into its flow; see `Findings`."""
    as_given = case.start.model_copy(update={"method": "blade"})
    case = case.model_copy(update={"start": as_given})
    duration, cutoff = case.phase.duration, getattr(world.inflow, "cutoff", None) or 0.0
    count = int(np.clip(16.0 * duration * cutoff, 2048, MOST_INSTANTS)) + 1
    instants, weights = np.linspace(0.0, duration, count), np.full(count, 1.0 / (count - 1))
    weights[[0, -1]] *= 0.5
    speed = np.asarray(world.inflow.speed(instants))
    mean = float(weights @ speed)

    blade = world.blade
    best = best_operation(blade, world.polar)
    mass, inertia, _, _ = mass_and_inertia(
        blade, world.section_area, case.rotor.material_density, case.rotor.hub_inertia
    )
    check = BEM[case.hydrodynamics.check]
    plant = Plant(blade, world.polar, float(inertia), case.fluid.density, check)
    few = case.phase.model_copy(update={"segments": min(case.phase.segments, MOST_START_SEGMENTS)})
    coarse = case.model_copy(update={"phase": few})
    start = find_start(coarse, world, best)
    flow = world.inflow.speed(np.linspace(0.0, duration, start.operation.rotor_speed.size))
    ratios = start.operation.rotor_speed * blade.rotor_radius / flow
    working = best.tip_speed_ratio * MARGIN[0], best.tip_speed_ratio * MARGIN[1]
    if start.operation.running:
        working = float(ratios.min()), float(ratios.max())
    steady_speed, constant = _steady(coarse, world, best, start, plant, mean)
    rated, above = None, 0.0
    if world.torque_limit is not None:
        rated = rated_speed(plant, best.tip_speed_ratio, world.torque_limit)
        above = float(weights @ (speed > rated))
    return Findings(
        case,
        world,
        build_turbine(case.rotor, case.fluid, mean),
        plant,
        float(mass),
        float(inertia),
        instants,
        speed,
        mean,
        float(np.sqrt(weights @ (speed - mean) ** 2)),
        float(weights @ speed**3),
        cutoff,
        best,
        start,
        working,
        steady_speed,
        constant,
        rated,
        above,
    )


def _steady(case, world, best, start, plant, mean) -> tuple[float | None, float | None]:
    """Return rotor speed (rad/s) and time constant (s) where the law holds the mean flow (m/s)."""
    if world.law is not None:
        gains = {"gain": tuple(start.gains)}
        case = case.model_copy(update={"control": case.control.model_copy(update=gains)})
    held = find_start(case, replace(world, inflow=ConstantInflow(mean)), best)
    if not held.operation.running:
        return None, None
    speed = held.operation.rotor_speed[:1]
    slope = 0.0 if world.law is None else float(world.law.torque_by_speed(speed, held.gains)[0])
    return float(speed[0]), time_constant(plant, float(speed[0]), mean, slope)


def rated_speed(plant: Plant, tip_speed_ratio: float, torque: float) -> float:
    """Return the flow speed (m/s) at which a rotor kept at a tip speed ratio has a torque (N*m).

    0.5 rho pi R³ Cq v² = torque, by iteration, for Cq depends on v where polars follow the Reynolds
    number. Infinite where the rotor has no torque.
    """
    flow = 1.0
    for _ in range(50):
        found = _torque(plant, tip_speed_ratio * flow / plant.blade.rotor_radius, flow)
        if found <= 0.0:
            return np.inf
        before, flow = flow, flow * float(np.sqrt(torque / found))
        if abs(flow - before) <= 1e-12 * flow:
            break
    return flow


def time_constant(
    plant: Plant, rotor_speed: float, flow_speed: float, control_slope: float = 0.0
) -> float:
    """Return the time constant of a rotor near an equilibrium, s.

    I dw/dt = Q(w, v) - u(w), linearized: I / (du/dw - dQ/dw). Negative where the equilibrium is
    unstable.

    Parameters
    ----------
    plant : Plant
    rotor_speed, flow_speed : float, rad/s and m/s
    control_slope : float, N*m*s/rad
        du/dw; zero for a torque that does not follow the speed.
    """
    step = 1e-4 * rotor_speed
    faster = _torque(plant, rotor_speed + step, flow_speed)
    slower = _torque(plant, rotor_speed - step, flow_speed)
    return plant.inertia / (control_slope - (faster - slower) / (2.0 * step))


def _torque(plant: Plant, rotor_speed: float, flow_speed: float) -> float:
    return float(plant.torque(np.array([rotor_speed]), np.array([flow_speed]))[0])


# Size and cost ------------------------------------------------------------------------------------


def problem_size(case: Case, world: Physics, best: SteadyOptimum) -> ProblemSize:
    """Return the size of a case's optimization and the time of one evaluation.

    Two problems of 20 and 200 segments are built, or of all where that is fewer, and carried on:
    unknowns, constraints and the time of an evaluation grow linearly in the segments; Dymos' set-up
    does not, and would take longest.
    """
    phase = case.phase
    few, many = (min(count, phase.segments) for count in TRIAL_SEGMENTS)
    small, large = (_trial(case, world, best, count) for count in (few, many))
    share = 0.0 if few == many else (phase.segments - many) / (many - few)

    def carried(before, after):
        return {name: round(n + share * (n - before[name])) for name, n in after.items()}

    nodes = phase.order + int(phase.transcription == "radau")
    return ProblemSize(
        carried(small[0], large[0]),
        carried(small[1], large[1]),
        nodes * phase.segments,
        large[2] + share * max(large[2] - small[2], 0.0),
    )


def _trial(case, world, best, segments):
    """Return unknowns and constraints by name of a problem of fewer segments, and its time, s."""
    duration = case.phase.duration * segments / case.phase.segments
    phase = case.phase.model_copy(update={"segments": segments, "duration": duration})
    case = case.model_copy(update={"phase": phase})
    nodes = best.tip_speed_ratio * np.linspace(0.5, 1.6, 80)
    problem = build_problem(case, world, find_start(case, world, best), nodes)
    problem.final_setup()
    problem.run_model()
    driver = problem.driver
    unknowns, constraints = driver.get_design_var_values(), driver.get_constraint_values()
    responses = [*driver.get_objective_values(), *constraints]
    totals = problem.model.linear_solver.totals(driver, responses)
    totals.compute()
    seconds = []
    for _ in range(3):
        began = time.perf_counter()
        problem.run_model()
        totals.compute()
        seconds.append(time.perf_counter() - began)
    problem.cleanup()
    unknowns, constraints = (
        {name: value.size for name, value in values.items()} for values in (unknowns, constraints)
    )
    return unknowns, constraints, min(seconds)


def _call_seconds(found: Findings) -> float:
    """Return the time of one call of the simulation's BEM, s."""
    speed, calls = found.best.tip_speed_ratio * found.mean / found.world.blade.rotor_radius, 20
    _torque(found.plant, speed, found.mean)
    began = time.perf_counter()
    for _ in range(calls):
        _torque(found.plant, speed, found.mean)
    return (time.perf_counter() - began) / calls


def expected_cost(case: Case, size: ProblemSize, call_seconds: float) -> Cost:
    """Return what a run may take, by a rule from measured runs.

        base + start n + passes (set-up nodes² + iterations evaluations t) + calls n t_BEM

    with n segments. The times t of an evaluation and t_BEM of a call are measured on this machine,
    the rest is this module's constants. SLSQP's dense algebra adds the cube of the unknowns to an
    iteration, an open loop's set-up the cube of the nodes. Iterations are a guess: few cases take
    fewer, few take more.
    """
    segments, nodes = case.phase.segments, float(size.nodes)
    open_loop, slsqp = case.control.law == "open_loop", case.driver.optimizer == "SLSQP"
    evaluations = SLSQP_EVALUATIONS if slsqp else EVALUATIONS
    kinks = (1.0, OPEN_LOOP_CALLS if open_loop else 1.0)
    seconds, integration, memory = [], [], []
    for side in range(2):
        iteration = evaluations[side] * size.evaluation_seconds
        if slsqp:
            iteration += SLSQP_SECONDS[side] * sum(size.unknowns.values()) ** 3
        setup = SETUP_SECONDS[side] * nodes**2 + (CONTROL_SECONDS * nodes**3 if open_loop else 0.0)
        iterations = min(ITERATIONS[side], case.driver.max_iterations)
        integration.append(kinks[side] * CALLS[side] * segments * (call_seconds + CALL_SECONDS))
        seconds.append(
            BASE_SECONDS[side]
            + START_SECONDS[side] * segments
            + PASSES[side] * (setup + iterations * iteration)
            + integration[side]
        )
        memory.append(BASE_BYTES + NODE_BYTES * nodes + PAIR_BYTES[side] * nodes**2)
    return Cost(*((low, high) for low, high in (seconds, integration, memory)))


# What the stations meet ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Met:
    """Angles of attack (rad) and Reynolds numbers at the stations, beside the polars' tables.

    low, high : shape (n_stations,), in the starting blade's operation; margin_low, margin_high,
    within `MARGIN` of its best tip speed ratio; table_low, table_high, where polars were measured;
    reynolds, shape (2, n_stations), at the slowest and the fastest; unsolved, stations without a
    root.
    """

    found: Findings
    low: np.ndarray
    high: np.ndarray
    margin_low: np.ndarray
    margin_high: np.ndarray
    table_low: np.ndarray
    table_high: np.ndarray
    reynolds: np.ndarray
    unsolved: np.ndarray

    @classmethod
    def of(cls, found: Findings) -> "_Met":
        """Run the starting blade by BEM over its tip speed ratios."""
        blade, polar, cosine = found.world.blade, found.world.polar, np.cos(found.world.blade.cone)
        margin = [side * found.best.tip_speed_ratio for side in MARGIN]
        working, beyond = (
            bem.sections(blade, polar, np.linspace(*ends, 31) / cosine)
            for ends in (found.working, margin)
        )
        tables = [_tables(polar, station) for station in range(blade.r.size)]
        ratio = np.array(found.working)[:, None] / cosine * blade.r / blade.tip_radius
        flow = np.array([[found.speed.min()], [found.speed.max()]]) * cosine
        return cls(
            found,
            working.angle_of_attack.min(axis=0),
            working.angle_of_attack.max(axis=0),
            beyond.angle_of_attack.min(axis=0),
            beyond.angle_of_attack.max(axis=0),
            np.array([max(each.alpha_min for each in table) for table in tables]),
            np.array([min(each.alpha_max for each in table) for table in tables]),
            blade.chord * flow * np.hypot(1.0, ratio) / found.case.fluid.kinematic_viscosity,
            np.flatnonzero(np.any(working.branch < 0, axis=0)),
        )

    def told(self) -> tuple[list[str], list[str]]:
        """Return warnings and notes."""
        found, warnings, notes = self.found, [], []
        if self.unsolved.size:
            warnings.append(
                "blade element momentum theory has no solution at "
                f"{_stations(found, self.unsolved)} of the starting blade: no load counts there"
            )
        beyond = "beyond it the polar is Viterna's extension"
        outside = self._outside(self.low, self.high)
        wider = self._outside(self.margin_low, self.margin_high)
        if outside:
            ratios = _span(found.working, form=".3g")
            warnings.append(f"at tip speed ratios of {ratios} {outside}: {beyond}")
        elif wider:
            low, high = (side * found.best.tip_speed_ratio for side in MARGIN)
            notes.append(
                f"should the tip speed ratio come to {low:.3g} or {high:.3g}, {wider}: {beyond}"
            )
        if isinstance(found.world.polar, bem.LocalReynolds):
            low, high = np.exp(found.world.polar.log_reynolds[[0, -1]])
            off = np.any((self.reynolds < 0.99 * low) | (self.reynolds > 1.01 * high), axis=0)
            if np.any(off):
                warnings.append(
                    f"Reynolds numbers at {_stations(found, off)} are {_powers(self.reynolds)}, "
                    f"and the polars' tables run from {_powers((low, high))}: beyond them the "
                    "nearest table holds"
                )
        return warnings, notes

    def _outside(self, low: np.ndarray, high: np.ndarray) -> str:
        """Tell which stations leave their polar's table, and the worst; nothing if none does."""
        above, below = high - self.table_high, self.table_low - low
        over = np.maximum(above, below)
        stations = np.flatnonzero(over > 1e-9)
        if not stations.size:
            return ""
        worst = int(np.argmax(over))
        angle = np.rad2deg(high[worst] if above[worst] >= below[worst] else low[worst])
        table = np.rad2deg([self.table_low[worst], self.table_high[worst]])
        who = f"the station at {_stations(self.found, [worst])} meets"
        if stations.size > 1:
            who = f"{stations.size} stations leave their polars' tables; {who}"
        return f"{who} an angle of attack of {angle:.3g} deg, and its table has {_span(table)} deg"

    def rows(self) -> Rows:
        """Return rows of the turbine's table."""
        low, high = np.rad2deg([self.low.min(), self.high.max()])
        return [
            ("angles of attack", f"{low:.3g} to {high:.3g} deg along the blade in this flow"),
            ("Reynolds numbers", f"{_powers(self.reynolds)} along the blade; {self._of_polars()}"),
        ]

    def _of_polars(self) -> str:
        """Return the Reynolds numbers that the polars are for."""
        polar, rotor = self.found.world.polar, self.found.case.rotor
        if isinstance(polar, bem.LocalReynolds):
            return f"the polars follow them, by tables for {_powers(np.exp(polar.log_reynolds))}"
        known = _polar_numbers(self.found.case)
        if not known:
            return "the polar holds at all: its file does not say for which"
        if len(known) == 1:
            return f"the polar is for {_powers(known)}, whatever the speed"
        at = "" if rotor.reynolds_number is None else f", taken at {_powers(rotor.reynolds_number)}"
        return f"the polars are for {_powers(known)}{at}, whatever the speed"

    def data(self) -> dict:
        """Return different polars, root to tip, with the angles (deg) that their stations meet."""
        blade, polar = self.found.world.blade, self.found.world.polar
        groups: dict[tuple[Polar, ...], list[int]] = {}
        for station in range(blade.r.size):
            groups.setdefault(_tables(polar, station), []).append(station)
        alpha, curves = np.linspace(-40.0, 50.0, 361), []
        for tables, stations in groups.items():
            where = "all stations" if len(groups) == 1 else _stations(self.found, stations)
            for number, table in enumerate(tables):
                label = where
                if isinstance(polar, bem.LocalReynolds):
                    label += f", Re {_powers(np.exp(polar.log_reynolds[number]))}"
                lift, drag = table.evaluate(np.deg2rad(alpha))
                curves.append(
                    {
                        "label": label,
                        "alpha_deg": alpha,
                        "lift": lift,
                        "drag": drag,
                        "table_deg": np.rad2deg([table.alpha_min, table.alpha_max]),
                    }
                )
        return {
            "curves": curves,
            "met_deg": np.rad2deg([self.low.min(), self.high.max()]),
        }


def _tables(polar, station: int) -> tuple[Polar, ...]:
    """Return the polars of a station, one a Reynolds number."""
    if isinstance(polar, bem.LocalReynolds):
        return polar.polars[station]
    return (bem.polar_at(polar, station),)


def _own_sections(case: Case) -> tuple:
    """Return the sections that the blade's file brings with it, unless the case gives others."""
    rotor = case.rotor
    if rotor.sections or rotor.polar is not None or rotor.chord is not None:
        return ()
    return read_blade(rotor.blade, hub_radius=0.0).sections


def _polar_numbers(case: Case) -> list[float]:
    """Return the Reynolds numbers that the polars of a rotor state."""
    own, sources = _own_sections(case), [section.polar for section in case.rotor.sections]
    tables = [table for section in own for table in section.polars]
    if not tables:
        sources = sources or [case.rotor.polar or POLAR]
        tables = [table for source in sources for table in read_polars(source)]
    return sorted({table.reynolds for table in tables if table.reynolds is not None})


# Rows of the tables -------------------------------------------------------------------------------


def _turbine_rows(found: Findings) -> Rows:
    rotor, blade = found.case.rotor, found.world.blade
    hub = f"hub {blade.hub_radius:.4g} m ({blade.hub_radius / blade.tip_radius:.3g} R)"
    cone = f", coned by {np.rad2deg(blade.cone):.3g} deg" if blade.cone else ""
    source = "given in the case" if rotor.chord is not None else Path(rotor.blade).name
    own = [section.name for section in _own_sections(found.case)]
    sections = [Path(section.polar).name for section in rotor.sections] or own
    names = ", ".join(sections) or Path(rotor.polar or POLAR).name
    thickness = _span(100.0 * np.atleast_1d(found.turbine.thickness), "%", ".3g")
    besides = f", and {rotor.hub_inertia:g} kg m^2 besides" if rotor.hub_inertia else ""
    return [
        (
            "rotor",
            f"{_count(blade.blade_count, 'blade')}, tip radius {blade.tip_radius:.4g} m, {hub}"
            f"{cone}; in water of {found.case.fluid.density:g} kg/m^3",
        ),
        (
            "blade at the start",
            f"{source}: {blade.r.size} stations at {_stations(found, slice(None))}, chord "
            f"{_span(blade.chord, 'm')}, twist {_span(np.rad2deg(blade.twist), 'deg', '.3g')}",
        ),
        ("sections", f"{names}; {thickness} thick"),
        ("designed", "; ".join(_designed(found)) or "nothing of the blade"),
        (
            "mass, inertia",
            f"{found.mass:.4g} kg and {found.inertia:.4g} kg m^2: solid blades of "
            f"{rotor.material_density:g} kg/m^3{besides}",
        ),
    ]


def _designed(found: Findings) -> list[str]:
    """Return what of the blade is designed, with its bounds."""
    shape, design, words = found.world.shape, found.case.design, []
    if shape.designs_chord:
        for name, unit in (("chord", "m"), ("twist", "deg")):
            points = getattr(design, f"{name}_points")
            where = f"at {shape.blade.r.size} stations" if points is None else f"by {points} points"
            words.append(f"{name} {where}, {_span(getattr(design, f'{name}_bounds'), unit)}")
    if shape.designs_set_angle:
        words.append(f"set angle, {_span(design.set_angle_bounds, 'deg')}")
    if shape.radius_bounds is not None:
        words.append(f"tip radius, {_span(design.radius_bounds, 'm')}")
    return words


def _flow_rows(found: Findings, by_default: bool) -> Rows:
    case, duration = found.case, found.case.phase.duration
    why = "as the case says"
    if by_default:
        endless = getattr(found.world.inflow, "duration", None) is None
        why = "by default, for the flow has no end" if endless else "the length of the flow's data"
    changes = "none: it is steady"
    if found.cutoff:
        changes = f"up to {found.cutoff:.3g} Hz, a period of {_seconds(1.0 / found.cutoff)}"
    flux = 0.5 * case.fluid.density * found.mean_cube
    through = _power(flux * np.pi * found.world.blade.rotor_radius**2)
    return [
        ("kind", _flow_words(case.inflow)),
        (
            "speed",
            f"{_span(found.speed, 'm/s')}, mean {found.mean:.4g} m/s, standard deviation "
            f"{found.deviation:.3g} m/s ({100.0 * found.deviation / found.mean:.3g} %)",
        ),
        ("time", f"{_duration(duration)}, {why}"),
        ("changes", changes),
        ("power in it", f"{_power(flux)} a square metre on average, {through} through the rotor"),
    ]


def _control_rows(found: Findings) -> Rows:
    control, law, case = found.case.control, found.world.law, found.case
    limit = "none"
    if control.torque_limit is not None:
        limit = f"{control.torque_limit:g} N m"
        if law is not None:
            limit += f", approached smoothly (smoothing {control.smoothing:g})"
    said = (type(control).__doc__ or control.law).strip().partition("\n")[0].rstrip(".")
    rows = [("law", said), ("torque limit", limit)]
    initial = case.phase.initial_speed
    if law is not None:
        gains = ", ".join(
            f"{gain:.4g} {unit.replace('**', '^').replace('*', ' ')}"
            for gain, unit in zip(found.start.gains, law.gain_units, strict=True)
        )
        how = "as the case says"
        if getattr(control, "gain", None) is None:
            how = "suits the starting blade; the run finds its own"
        rows.append(("gain at the start", f"{gains}: {how}"))
    if case.design.gain_bounds is not None:
        rows.append(("gain", f"{_span(case.design.gain_bounds)}, in the same unit"))
    free = initial == "free" or (initial == "auto" and law is None)
    balance = "hydrodynamic and control torque balance"
    rows.append(("at t = 0", "the rotor's speed is free" if free else balance))
    return rows


def _start_rows(found: Findings) -> Rows:
    world, best, mean = found.world, found.best, found.mean
    speed = best.tip_speed_ratio * mean / world.blade.rotor_radius
    torque = _torque(found.plant, speed, mean)
    rows = [
        (
            "largest power coefficient",
            f"{best.power_coefficient:.4f} at a tip speed ratio of {best.tip_speed_ratio:.3g}",
        ),
        (
            "there, in the mean flow",
            f"{_turning(speed)}, {torque:.4g} N m, {_power(torque * speed)} at {mean:.4g} m/s",
        ),
    ]
    if found.rated_speed is not None:
        often = f"{100.0 * found.above_rated:.3g} % of the time"
        rows.append(
            (
                "there, at the torque limit",
                f"{_power(found.rated_power)} at {found.rated_speed:.4g} m/s; the flow is faster "
                f"{often if found.above_rated else 'at no time'}",
            )
        )
    if found.start.operation.running:
        rows.append(
            (
                "under the control law",
                f"tip speed ratio {_span(found.working, form='.3g')}; "
                f"{found.start.operation.energy / 1e3:.4g} kJ, if it followed the flow at once",
            )
        )
    else:
        rows.append(("under the control law", "it does not turn unstalled throughout this flow"))
    if found.time_constant is not None:
        how = "the rotor's own" if world.law is None else "of rotor and control law"
        rows.append(
            (
                "time constant",
                f"{_seconds(found.time_constant)}, {how}, at {mean:.4g} m/s and "
                f"{_turning(found.steady_speed)}",
            )
        )
    return rows


def _optimization_rows(found: Findings, size: ProblemSize, package: str) -> Rows:
    phase, hydro, driver = found.case.phase, found.case.hydrodynamics, found.case.driver
    length = phase.duration / phase.segments
    periods = ""
    if found.cutoff:
        periods = f" ({1.0 / (found.cutoff * length):.3g} in the flow's shortest period)"
    name = {"gauss-lobatto": "Gauss-Lobatto", "radau": "Radau"}[phase.transcription]
    torque = "at every node of the trajectory"
    if hydro.torque == "curve":
        torque = "as a curve over the tip speed ratio, one for each blade"
    solver = {"vectorized": "this package's BEM", "ccblade": "CCBlade"}
    return [
        (
            "segments",
            f"{phase.segments} of {_seconds(length)}{periods}, {name} of order {phase.order}: "
            f"{size.nodes} nodes",
        ),
        ("unknowns", _sizes(size.unknowns, found.world.shape.designs_set_angle)),
        ("constraints", _sizes(size.constraints)),
        ("torque", f"{torque}, by {solver[hydro.bem]}; simulated by {solver[hydro.check]}"),
        (
            "optimizer",
            f"{driver.optimizer} of {package}, to {driver.tolerance:g}, for the captured energy",
        ),
    ]


def _cost_rows(size: ProblemSize, cost: Cost) -> Rows:
    spent = _time_span(cost.integration_seconds)
    return [
        ("time", f"about {_time_span(cost.seconds)}, {spent} of it to integrate independently"),
        ("memory", f"about {_memory_span(cost.memory_bytes)}"),
        (
            "as measured runs tell",
            f"{PASSES[0]} or {PASSES[1]} passes of {ITERATIONS[0]} to {ITERATIONS[1]} iterations; "
            f"an evaluation with its derivatives takes {_seconds(size.evaluation_seconds)} here",
        ),
    ]


# Warnings -----------------------------------------------------------------------------------------


def _start_warnings(found: Findings):
    """Yield what speaks against torque limit, law and gain."""
    case, limit = found.case, found.world.torque_limit
    fastest = float(found.speed.max())
    if limit is not None and not found.above_rated:
        speed = found.best.tip_speed_ratio * fastest / found.world.blade.rotor_radius
        yield (
            f"control.torque_limit = {limit:g} N m is more than the flow gives: at its best tip "
            f"speed ratio the starting blade has {_torque(found.plant, speed, fastest):.4g} N m "
            f"in the fastest flow, {fastest:.4g} m/s"
        )
    if not found.start.operation.running:
        given = " and this gain" if getattr(case.control, "gain", None) is not None else ""
        looks = "with this blade a run may find no solution"
        if found.world.shape.designs_chord and case.start.method == "quasi_steady":
            looks = "the run looks for one that does"
        yield (
            "the starting blade does not turn unstalled throughout this flow under this law"
            f"{given}: {looks}"
        )


def _design_warnings(found: Findings):
    """Yield what speaks against bounds, which may leave out the start, and control points."""
    shape, design, blade = found.world.shape, found.case.design, found.world.blade
    chord, twist = shape.control(blade)
    starts = [
        ("radius_bounds", np.array([blade.tip_radius]), "m", "tip radius"),
        ("gain_bounds", found.start.gains, "", "gain"),
    ]
    if shape.designs_chord:
        starts += [
            ("chord_bounds", chord, "m", "chord"),
            ("twist_bounds", np.rad2deg(twist), "deg", "twist"),
        ]
    for key, value, unit, what in starts:
        bounds = getattr(design, key)
        if bounds is None:
            continue
        low, high = bounds
        if np.any((value < low - 1e-9 * abs(low)) | (value > high + 1e-9 * abs(high))):
            yield (
                f"design.{key} = [{low:g}, {high:g}] leaves out the {what} of the starting blade, "
                f"{_span(value, unit)}: the run moves it inside"
            )
    given = found.turbine.blade
    for name, off, most, words in (
        (
            "chord",
            (blade.chord - given.chord) / given.chord.max(),
            FIT[0],
            "{:.2g} % of the largest",
        ),
        ("twist", blade.twist - given.twist, FIT[1], "{:.2g} deg"),
    ):
        worst = int(np.argmax(np.abs(off)))
        share = abs(off[worst])
        if share > most:
            words = words.format(100.0 * share if name == "chord" else np.rad2deg(share))
            yield (
                f"the spline through design.{name}_points = {getattr(design, f'{name}_points')} "
                f"leaves the {name} of the blade's file by {words} at {_stations(found, [worst])}: "
                "the run begins with the spline; more points follow the file closer"
            )


def _flow_warnings(found: Findings):
    """Yield what speaks against the flow's cutoff: segments, rotor and disc may not follow."""
    phase, cutoff = found.case.phase, found.cutoff
    if not cutoff:
        return
    profiles = _profiles(found.case.inflow)
    sampled = bool({"record", "turbulence"} & profiles)
    wanted = int(np.ceil(SEGMENTS_PER_PERIOD * cutoff * phase.duration * (1.0 - 1e-9)))
    if phase.segments < wanted:
        each = phase.segments / (cutoff * phase.duration)
        yield (
            f"phase.segments = {phase.segments} gives {each:.2g} to the flow's shortest period, "
            f"{_seconds(1.0 / cutoff)}, and {SEGMENTS_PER_PERIOD:g} are wanted: give "
            + (f"{wanted}" if wanted <= MOST_SEGMENTS else "a shorter phase.duration")
            + (", or a lower cutoff" if sampled else "")
        )
    eddies = found.mean / (2.0 * found.world.blade.rotor_radius)
    if sampled and cutoff > EDDY * eddies:
        yield (
            f"the flow has frequencies up to {cutoff:.3g} Hz, and a rotor averages over eddies "
            f"smaller than itself: a cutoff of {eddies:.2g} Hz, mean speed over diameter, leaves "
            "them out"
        )
    shortest = 1.0 / (2.0 * np.pi * cutoff)
    if found.time_constant is not None and found.time_constant > shortest:
        yield (
            f"the flow changes faster, within {_seconds(shortest)} (1 / (2 pi cutoff)), than the "
            f"rotor follows, {_seconds(found.time_constant)}: it will capture less than the "
            "quasi-steady figures above"
        )


def _memory_warnings(cost: Cost):
    """Yield a word where a run may not fit into this machine."""
    try:
        installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not on every system
        return
    if cost.memory_bytes[1] > 0.9 * installed:
        yield (
            f"a run may need {_memory_span(cost.memory_bytes)} of memory, and this machine has "
            f"{_memory_span((installed, installed))}: give a shorter phase.duration, fewer "
            "phase.segments or a lower cutoff"
        )


# Data of the figures ------------------------------------------------------------------------------


def _blade_data(found: Findings) -> dict:
    """Return the starting blade, and control points beside the file's blade where there are any."""
    shape, blade, given = found.world.shape, found.world.blade, found.turbine.blade
    data = {
        "r_m": blade.r,
        "ends_m": (blade.hub_radius, blade.tip_radius),
        "chord_m": blade.chord,
        "twist_deg": np.rad2deg(blade.twist),
        "thickness_percent": 100.0 * np.broadcast_to(found.turbine.thickness, blade.r.shape),
    }
    chord, twist = shape.control(blade)
    for name, points, control, file in (
        ("chord_m", found.case.design.chord_points, chord, given.chord),
        ("twist_deg", found.case.design.twist_points, np.rad2deg(twist), np.rad2deg(given.twist)),
    ):
        if points is not None:
            # they stand where their own spline is the radius itself
            dense = np.linspace(blade.hub_radius, blade.tip_radius, 8 * points)
            basis = spline_basis(points, dense, blade.hub_radius, blade.tip_radius)
            places = np.linalg.lstsq(basis, dense, rcond=None)[0]
            data |= {f"{name}_points": (places, control), f"{name}_file": file}
    return data


def _inflow_data(found: Findings) -> dict:
    """Return the flow, thinned for drawing, and its spectrum."""
    thin = -(-found.time.size // 20_000)
    data = {
        "time_s": found.time[::thin],
        "speed_m_s": found.speed[::thin],
        "mean_m_s": found.mean,
        "rated_m_s": found.rated_speed,
        "cutoff_hz": found.cutoff or None,
    }
    if found.deviation > 1e-9 * found.mean:
        data["spectrum"] = power_spectrum(found.speed, float(found.time[1]))
    return data


def power_spectrum(speed: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (Hz) and the one-sided power spectral density (m²/s² per Hz) of a flow.

    A periodogram under Hann's window after the mean is taken out, averaged over twelfths of an
    octave.

    Parameters
    ----------
    speed : array, shape (n,), m/s
        Even samples.
    step : float, s
    """
    window = np.hanning(speed.size)
    rest = speed - window @ speed / window.sum()
    density = 2.0 * step * np.abs(np.fft.rfft(rest * window))[1:] ** 2 / np.sum(window**2)
    frequency = np.fft.rfftfreq(speed.size, step)[1:]
    band = np.floor(12.0 * np.log2(frequency / frequency[0]) + 1e-9).astype(int)
    _, band, count = np.unique(band, return_inverse=True, return_counts=True)
    return np.bincount(band, frequency) / count, np.bincount(band, density) / count


def _power_data(found: Findings) -> dict:
    """Return the starting blade's power curve and the range that it works in."""
    best = found.best
    ratios = np.linspace(0.2, 1.9, 171) * best.tip_speed_ratio
    return {
        "tip_speed_ratio": ratios,
        "power_coefficient": bem.rotor_coefficients(
            found.world.blade, found.world.polar, ratios
        ).power,
        "best": (best.tip_speed_ratio, best.power_coefficient),
        "working": found.working if found.start.operation.running else None,
    }


# Words --------------------------------------------------------------------------------------------


def _flow_words(section) -> str:
    """Return the kind of a flow and the values that make it."""
    if section.profile == "sum":
        return " + ".join(_flow_words(part) for part in section.parts)
    words = []
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if name == "file":
            words.insert(0, Path(value).name)
        elif name == "constituents":
            words += [each.name or _duration(each.period) for each in value]
        elif name != "profile" and value is not None:
            value = _span(value) if isinstance(value, tuple) else value
            value = f"{value:g}" if isinstance(value, float) else value
            words.append(f"{name.replace('_', ' ')} {value} {_unit(field)}".rstrip())
    return f"{section.profile}: {', '.join(words)}"


def _unit(field) -> str:
    """Return the unit of a key of a case; nothing where it has none."""
    places = [getattr(field, "metadata", ())]
    places += [getattr(part, "__metadata__", ()) for part in get_args(field.annotation)]
    for mark in (mark for place in places for mark in place):
        if isinstance(mark, Quantity) and mark.unit:
            return mark.unit.replace("**", "^").replace("*", " ")
    return ""


def _profiles(section) -> set[str]:
    """Return the kinds of flow that a flow is made of."""
    return {section.profile, *(part.profile for part in getattr(section, "parts", ()))}


_NAMES = {
    "chord_control": "chord",
    "twist_control": "twist",
    "rotor_radius": "radius",
    "rotor_speed": "rotor speed over time",
    "control_torque": "control torque over time",
    "rotor_acceleration[initial]": "balance at t = 0",
    "rotor_speed_rate[initial]": "balance at t = 0",
    "control_torque[path]": "range of the control torque",
    "defects:rotor_speed": "equation of motion",
    "recovery": "distance from stall",
}


def _sizes(sizes: dict[str, int], set_angle: bool = False) -> str:
    """Return a total and what it is made of, in words."""
    parts: dict[str, int] = {}
    for name, size in sizes.items():
        last = name.rpartition(".")[2]
        words = _NAMES.get(last) or _NAMES.get(last.rpartition(":")[2])
        if last.startswith("defect_control"):
            words = "smoothness of it"
        elif last.startswith("gain_"):
            words = "gain"
        elif last == "twist_control" and set_angle:
            words = "set angle"
        words = words or last.replace("_", " ")
        parts[words] = parts.get(words, 0) + size
    listed = ", ".join(f"{size} {words}" for words, size in parts.items())
    return f"{sum(parts.values())}: {listed}" if parts else "none"


def _stations(found: Findings, chosen) -> str:
    blade = found.world.blade
    return f"r/R = {_span(blade.r[chosen] / blade.tip_radius, form='.3g')}"


def _span(values, unit: str = "", form: str = ".4g") -> str:
    """Return the range of values with its unit."""
    low, high = (f"{end:{form}}" for end in (np.min(values), np.max(values)))
    return f"{low if low == high else f'{low} to {high}'} {unit}".rstrip()


def _powers(values) -> str:
    """Return the range of large numbers, such as 2e5 to 1.2e6."""
    texts = []
    for end in (np.min(values), np.max(values)):
        digits, _, power = f"{end:.1e}".partition("e")
        texts.append(f"{digits.removesuffix('.0')}e{int(power)}")
    return texts[0] if texts[0] == texts[1] else " to ".join(texts)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' if number != 1 else ''}"


def _power(watts: float) -> str:
    return f"{watts / 1e3:.4g} kW" if abs(watts) >= 1e3 else f"{watts:.4g} W"


def _turning(speed: float) -> str:
    return f"{speed:.4g} rad/s ({speed * 30.0 / np.pi:.3g} rpm)"


def _seconds(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if abs(seconds) < 0.1 else f"{seconds:.3g} s"


def _duration(seconds: float) -> str:
    """Return a time in s, and in what it is easier to grasp."""
    for unit, size in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds:g} s ({seconds / size:.3g} {unit})"
    return f"{seconds:g} s"


def _time_span(ends: Range) -> str:
    """Return a guessed time, with no more digits than it deserves."""
    unit, size = "s", 1.0
    for longer in (("min", 60.0), ("h", 3600.0)):
        unit, size = longer if ends[1] >= 1.5 * longer[1] else (unit, size)
    low, high = (f"{end / size:.0f}" if end >= size else f"{end / size:.1g}" for end in ends)
    return f"{low if low == high else f'{low} to {high}'} {unit}"


def _memory_span(ends: Range) -> str:
    unit, size = ("GB", 1e9) if ends[1] >= 1e9 else ("MB", 1e6)
    low, high = (f"{float(f'{end / size:.2g}'):g}" for end in ends)
    return f"{low if low == high else f'{low} to {high}'} {unit}"
