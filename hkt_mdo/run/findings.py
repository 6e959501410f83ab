"""A case's starting blade in its flow, and what the optimization of it will take.

Figures that need no optimizer: blade element momentum theory, quasi-steady operation, and problems
of few segments that are built to be counted and timed.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.dynamics.inflow import ConstantInflow
from hkt_mdo.dynamics.simulation import Plant
from hkt_mdo.problem.build import BEM, Physics, build_problem, find_start
from hkt_mdo.problem.start import StartingPoint
from hkt_mdo.problem.turbine import Turbine, build_turbine
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.steady_optimum import SteadyOptimum, best_blade, best_operation

Range = tuple[float, float]

MARGIN = 0.7, 1.3
"""Tip speed ratios over the best one, to which a rotor may come while it is designed."""

MOST_INSTANTS = 2**17
"""At which the flow is looked at."""

MOST_START_SEGMENTS = 2000
"""In which the starting blade's operation is looked at."""

# The rule of `expected_cost`: lowest and highest of what whole runs of 60 to 8640 segments took
# (docs/performance.md has iterations and memory up to 3000 segments).
TRIAL_SEGMENTS = 20, 200  # of the two problems that are built to count and to time
BASE_SECONDS = 3.0, 5.0  # imports, records, figures
STEADY = 50, 80  # searches of the best blade at a tip speed ratio, or the best operation
STEADY_REYNOLDS = 100, 130  # the same where polars follow the Reynolds number
START_SECONDS = 3e-4, 1.5e-3  # a segment: quasi-steady co-design
STATION_SECONDS = 0.02, 0.35  # a station: the same
SETUP_SECONDS = 2.5e-8, 8e-8  # nodes²: Dymos' dense interpolation, a pass
PASSES = 1, 2
ITERATIONS = 30, 120  # a pass
EVALUATIONS = 3.5, 6.0  # an iteration of IPOPT: line searches and its own algebra
SLSQP_EVALUATIONS = 1.2, 2.0
SLSQP_SECONDS = 4e-10, 1e-9  # unknowns³: its dense algebra in an iteration
CALLS = 10, 130  # of BEM, a segment of the independent integration
CALL_SECONDS, RECALL_SECONDS = 4e-5, 8e-5  # of the integrator itself; of an open loop's torque
BASE_BYTES, NODE_BYTES = 300e6, 20e3  # of every run, a node
PAIR_BYTES = 4.5, 6.5  # nodes²: Dymos' dense interpolation of states by Gauss and Lobatto
LARGER_PAIR_BYTES = 8.5, 14.5  # by Radau, and of controls


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
    def captured(self) -> float:
        """Energy of the start over that at the largest power coefficient throughout."""
        area, duration = np.pi * self.world.blade.rotor_radius**2, self.time[-1]
        passing = 0.5 * self.case.fluid.density * area * self.mean_cube * duration
        most = max(self.best.power_coefficient, 1e-9) * passing
        return float(self.start.operation.energy / most)

    @property
    def rated_power(self) -> float | None:
        """Power at the rated flow speed, W."""
        limit, rated = self.world.torque_limit, self.rated_speed
        if limit is None or rated is None:
            return None
        return limit * self.best.tip_speed_ratio * rated / self.world.blade.rotor_radius


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
        case=case,
        world=world,
        turbine=build_turbine(case.rotor, case.fluid, mean),
        plant=plant,
        mass=float(mass),
        inertia=float(inertia),
        time=instants,
        speed=speed,
        mean=mean,
        deviation=float(np.sqrt(weights @ (speed - mean) ** 2)),
        mean_cube=float(weights @ speed**3),
        cutoff=cutoff,
        best=best,
        start=start,
        working=working,
        steady_speed=steady_speed,
        time_constant=constant,
        rated_speed=rated,
        above_rated=above,
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
        found = torque_at(plant, tip_speed_ratio * flow / plant.blade.rotor_radius, flow)
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
    faster = torque_at(plant, rotor_speed + step, flow_speed)
    slower = torque_at(plant, rotor_speed - step, flow_speed)
    return plant.inertia / (control_slope - (faster - slower) / (2.0 * step))


def torque_at(plant: Plant, rotor_speed: float, flow_speed: float) -> float:
    """Return the torque (N*m) at a rotor speed (rad/s) and a flow speed (m/s)."""
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
    seconds = _timed(lambda: (problem.run_model(), totals.compute()), 5)
    problem.cleanup()
    unknowns, constraints = (
        {name: value.size for name, value in values.items()} for values in (unknowns, constraints)
    )
    return unknowns, constraints, seconds


def expected_cost(found: Findings, size: ProblemSize) -> Cost:
    """Return what a run may take, by a rule from measured runs.

        base + steady t_steady + start + passes (set-up + iterations evaluations t) + calls n t_BEM

    with n segments. The times t of an evaluation, t_BEM of a call of BEM and t_steady of a search
    for the best blade are measured on this machine, the rest is this module's constants. Set-up and
    memory grow with the square of the nodes, SLSQP's dense algebra with the cube of the unknowns.
    Iterations are a guess: a run that loses its way takes more.
    """
    case, blade, polar = found.case, found.world.blade, found.world.polar
    ratio = found.best.tip_speed_ratio
    speed = ratio * found.mean / blade.rotor_radius
    call = _timed(lambda: torque_at(found.plant, speed, found.mean), 20)
    call += CALL_SECONDS + (RECALL_SECONDS if found.world.law is None else 0.0)
    shape = found.world.shape
    if shape.designs_chord:
        bounds = shape.chord_bounds, shape.twist_bounds
        search = _timed(lambda: best_blade(blade, polar, ratio, *bounds), 2)
    else:
        search = _timed(lambda: best_operation(blade, polar), 2)
    searches = STEADY_REYNOLDS if isinstance(polar, bem.LocalReynolds) else STEADY
    segments, nodes = case.phase.segments, float(size.nodes)
    small = found.world.law is not None and case.phase.transcription == "gauss-lobatto"
    pairs = PAIR_BYTES if small else LARGER_PAIR_BYTES
    slsqp = case.driver.optimizer == "SLSQP"
    evaluations = SLSQP_EVALUATIONS if slsqp else EVALUATIONS
    seconds, integration, memory = [], [], []
    for side in range(2):
        iteration = evaluations[side] * size.evaluation_seconds
        if slsqp:
            iteration += SLSQP_SECONDS[side] * sum(size.unknowns.values()) ** 3
        setup = SETUP_SECONDS[side] * nodes**2
        iterations = min(ITERATIONS[side], case.driver.max_iterations)
        integration.append(CALLS[side] * segments * call)
        seconds.append(
            BASE_SECONDS[side]
            + searches[side] * search
            + START_SECONDS[side] * segments
            + STATION_SECONDS[side] * blade.r.size
            + PASSES[side] * (setup + iterations * iteration)
            + integration[side]
        )
        memory.append(BASE_BYTES + NODE_BYTES * nodes + pairs[side] * nodes**2)
    return Cost(*((low, high) for low, high in (seconds, integration, memory)))


def _timed(action: Callable[[], object], times: int) -> float:
    """Return how long an action takes, s: the shortest of some times, or of those in a second."""
    shortest, began = np.inf, time.perf_counter()
    for _ in range(times):
        before = time.perf_counter()
        action()
        shortest = min(shortest, time.perf_counter() - before)
        if time.perf_counter() - began > 1.0:
            break
    return shortest
