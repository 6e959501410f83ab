"""The checks of a result, which are independent of the optimizer.

A result is a success only if the optimizer converged and an integration that shares neither torque
curve nor collocation with it, the quasi-steady bound and every limit of the problem agree.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter, methodcaller
from typing import Any

import numpy as np

from hkt_mdo.dynamics.generator import BEYOND, Generator
from hkt_mdo.dynamics.limits import BETWEEN, SLOWED, DesignBounds
from hkt_mdo.dynamics.objectives import INTEGRALS, CapturedEnergy
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO
from hkt_mdo.files.shipped import REMEDIES
from hkt_mdo.problem.evaluation import scalars, united
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import START_EXCESS, StartingPoint
from hkt_mdo.problem.scenario import FLOW_MISSED, Scenario
from hkt_mdo.quantities import LOADS, names
from hkt_mdo.results.summary import CheckEntry
from hkt_mdo.results.words import joined, measured
from hkt_mdo.rotor.band import FACTORS
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.rotor.shape import POINTS
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.run import loads
from hkt_mdo.run.certified import certified_energy
from hkt_mdo.run.memory import stability_of
from hkt_mdo.run.verification import Optimized, Verification

# Limits of the checks, as docs/checks.md explains them
ENERGY_ERROR, SPEED_ERROR = 2e-4, 1e-2
FLOW_ERROR, MESH_ERROR = 1e-4, 1e-5
STORED = 0.01  # largest energy stored in the rotor, over the captured energy
RECOVERY_ERROR = 0.2  # of the least recovery torque, which is a small difference of torques
BEHIND_OPEN_LOOP = 0.2  # largest share that the others may lose: more is another optimum
BELOW_START = 2e-3  # largest relative loss by the rotor's inertia and its distance from stall
BOUND_MARGIN, NODE_VIOLATION = 1e-5, 1e-6
RESOLVED = 1e-2  # by which a load may be larger on a blade of many stations
REDUCED_ENERGY, REDUCED_SPEED = 1e-3, 1e-2  # two filters for all stations (docs/studies/memory.md)
NEAR = 0.03  # of tip speed ratios beside those of the operation, at which a torque must not jump
PROBES = 200  # tip speed ratios at which the slope of the mean induction is checked


def is_false(verifications: tuple[Verification, ...]) -> bool:
    """Tell whether an integration of the model that was optimized contradicts its collocation."""
    errors = [(each.energy_error, np.max(each.speed_errors)) for each in verifications]
    return any(energy > ENERGY_ERROR or speed > SPEED_ERROR for energy, speed in errors)


@dataclass(frozen=True, eq=False)
class Checked:
    """A result with its integrations and checks.

    Attributes
    ----------
    start : StartingPoint
        Where its run began, after all that the search tried.
    result : Optimized
    verifications : tuple of Verification
        The integration in each scenario.
    """

    start: StartingPoint
    result: Optimized
    verifications: tuple[Verification, ...]

    @property
    def physics(self) -> Physics:
        """The physics on the mesh of the result."""
        return self.result.physics

    @cached_property
    def optimum(self) -> SteadyOptimum:
        """The steady optimum whose power coefficient bounds the energy of the optimized blade.

        Where polars follow the Reynolds number: the best of the slowest, usual and fastest flow.
        """
        physics, blade = self.physics, self.result.point.blade
        if blade.rotor_radius == physics.blade.rotor_radius:  # whose optimum is known already
            blade = physics.blade
        optima = [physics.rotor.best_of_shape(physics.shape, blade)]
        if physics.rotor.polar.follows_reynolds:
            speeds = np.concatenate([s.inflow.speed_at(s.node_times) for s in physics.scenarios])
            rotors = (physics.rotor.at_flow(speed) for speed in (speeds.min(), speeds.max()))
            optima += [rotor.best_of_shape(physics.shape, blade) for rotor in rotors]
        return max(optima, key=attrgetter("power_coefficient"))

    @cached_property
    def checks(self) -> list[CheckEntry]:
        """All checks, that of the optimizer first."""
        status = self.result.outcome
        word = status.message
        if not status.success:
            word = f"the optimizer did not converge: {word}{self.jump}"
        checks = [entry("optimizer", not status.success, 0.0, word)]
        for verification, suffix in _suffixed(self.verifications):
            checks += [entry(name + suffix, *row) for name, *row in _of_scenario(verification)]
        return checks + [entry(*row) for row in (*_of_design(self), *_behind_open_loop(self))]

    @cached_property
    def jump(self) -> str:
        """Where the flow stalls at once near the operation, in words; empty if nowhere.

        There neither an optimization nor a torque curve converges, as with a blade of thick root
        sections (IEA 3.4 MW, `make verify PART=real`).
        """
        ratios = [np.maximum(x["tip_speed_ratio"], SLOWEST_RATIO) for x in self.result.trajectories]
        radius = self.physics.rotor.torque_jump(self.result.point.blade, np.hstack(ratios), NEAR)
        if radius is None:
            return ""
        return f"; near it the torque jumps: the flow at r = {radius:.4g} m stalls at once"

    def total(self, of: Callable[[Verification], float]) -> float:
        """Return the weighted sum over the scenarios of something of each verification."""
        return float(sum(each.scenario.weight * of(each) for each in self.verifications))

    @cached_property
    def quantities(self) -> dict[str, Any]:
        """The quantities of the design and of the whole result, by their names."""
        physics, point = self.physics, self.result.point
        integrals = {x: self.total(methodcaller("objective", y)) for x, y in INTEGRALS.items()}
        return scalars(physics, physics.rotor, point.blade) | designed(physics, point) | integrals

    @cached_property
    def objective(self) -> float:
        """The objective of the integrations, in its unit, less the price of the shaft."""
        objective, price = self.physics.objective, self.physics.price_of(self.result.point.blade)
        if objective.is_rate:
            integrals = (each.objective(objective) for each in self.verifications)
            return united(self.physics, integrals) - price
        return float(objective.value_of(self.quantities)) - price

    @property
    def passed(self) -> bool:
        """Whether all checks pass."""
        return all(check.passed for check in self.checks)

    def check(self, name: str) -> float | None:
        """Return the value of a check; None if there is no such check."""
        return next((check.value for check in self.checks if check.name == name), None)

    @cached_property
    def scenarios(self) -> dict[str, tuple[Verification, ...]]:
        """The verifications of each scenario of the case: several where it has intervals."""
        groups = self.physics.groups.items()
        return {name: tuple(self.verifications[i] for i in places) for name, places in groups}

    @cached_property
    def rank(self) -> tuple[float, float, float]:
        """Rank of a result: numbers of large and of all failures, and the integration's objective.

        A start in balance at every instant exceeds a torque limit by the torque that accelerates
        the rotor. It ranks above an end only if that is false or worse by more than `BELOW_START`.
        """
        large = sum(check.value > max(check.limit, BELOW_START) for check in self.checks)
        refused = sum(not check.passed for check in self.checks)
        return -large, -refused, self.physics.objective.sign * self.objective


def _behind_open_loop(ended):
    """Yield how far a law that can follow a schedule is behind the open loops of its search."""
    physics, starts = ended.physics, ended.start.starts
    if not physics.law.follows or physics.start_objective is not physics.objective:
        return
    feasible = (x.objective for x in starts if x.law == "open_loop" and x.excess <= START_EXCESS)
    ceiling = max(feasible, default=0.0)
    if ceiling > 0.0:
        behind = physics.objective.behind(ended.objective, ceiling)
        word = "share by which the objective is below that of an open loop that keeps the limits"
        yield "behind_open_loop", behind, BEHIND_OPEN_LOOP, word


def _suffixed(verifications):
    """Yield each verification and the ending of its checks' names; empty if there is one."""
    for verification in verifications:
        yield verification, "" if len(verifications) == 1 else f" ({verification.scenario.name})"


def entry(name: str, value: float, limit: float, detail: str) -> CheckEntry:
    """Return a check of a value, which must not exceed a limit."""
    passed = bool(value <= limit)
    return CheckEntry(name=name, value=float(value), limit=limit, passed=passed, detail=detail)


def _largest(scenario, values, time) -> tuple[float, str]:
    """Return the largest of some values over time (s) in a scenario, and when that is, in words."""
    at = int(np.argmax(values))
    return float(values[at]), scenario.when(time[at])


def _worst(verifications, name) -> tuple[float, str]:
    """Return the largest value of a quantity along the integrations, and when that is, in words."""
    return max(_largest(x.scenario, getattr(x, name), x.simulation.time) for x in verifications)


def _of_scenario(verification: Verification) -> Iterator[tuple[str, float, float, str]]:
    """Yield name, value, limit and place of the checks of a scenario's integration."""
    simulated, integrated = verification.simulation, verification.integrated
    nodes = verification.trajectory
    time, stopped, series = nodes["time"], simulated.stopped_at, verification.of_model.integrated
    yield from of_flow(verification.scenario)
    when = verification.scenario.when
    word = "the rotor generates until the end"
    if stopped is not None and verification.scenario.steady:
        word = f"the rotor has no equilibrium in {when(stopped)}"
    elif stopped is not None and integrated["tip_speed_ratio"][-1] > 2.0 * SLOWEST_RATIO:
        word = f"the rotor's motion has no solution after {when(stopped)}"
    elif stopped is not None:
        flow = measured(integrated["inflow_speed"][-1], "m/s", 3)
        word = f"rotor stops at {when(stopped)} in a flow of {flow}, not generating"
    yield "rotor_keeps_turning", float(stopped is not None), 0.0, word
    power = np.interp(time, series["time"], series["hydrodynamic_power"])
    off = time[np.argmax(np.abs(power - nodes["hydrodynamic_power"]))]
    word = "collocated over independently integrated energy, less one; power differs most at "
    yield "energy_error", verification.energy_error, ENERGY_ERROR, word + when(off)
    error, instant = _largest(verification.scenario, verification.speed_errors, time)
    word = f"collocated over integrated rotor speed, less one, at {instant}"
    yield "max_speed_error", error, SPEED_ERROR, word
    if verification.two_filters is not None:
        yield from _of_two_filters(verification, verification.two_filters)


def _of_two_filters(verification, reduced):
    """Yield by how much the integration with the filters of all stations differs from the reduced.

    The optimizer maximizes the energy of the reduced model: what it misses is at most the sum of
    this difference for the optimized design and for the best one.
    """
    whole, two = verification.simulation, reduced.simulation
    gap = abs(two.energy / whole.energy - 1.0) if whole.energy > 0.0 else np.inf
    word = "energy by the optimization's two filters of the wake over that of all stations"
    yield "two_filters_energy", gap, REDUCED_ENERGY, f"{word}, less one"
    times = verification.trajectory["time"]
    errors = np.abs(two.speed_at(times) / whole.speed_at(times) - 1.0)
    error, when = _largest(verification.scenario, errors, times)
    yield "two_filters_speed", error, REDUCED_SPEED, f"the same of the speed, at {when}"


def of_flow(scenario: Scenario) -> Iterator[tuple[str, float, float, str]]:
    """Yield name, value, limit and place of the checks of a scenario's mesh against its flow.

    A steady one has none.
    """
    errors, missed, edges = scenario.flow_errors, scenario.flow_missed, scenario.edges

    def where(values):
        worst = int(np.argmax(values))
        return f"most between t = {edges[worst]:.10g} and {edges[worst + 1]:.10g} s"

    if not scenario.steady:
        word = f"error of the mesh's integral of v³, {where(errors)}"
        yield "flow_error", np.sum(errors), FLOW_ERROR, word
        word = "share of the flow's speed missed between the instants at which limits are checked"
        yield "flow_missed", np.max(missed), FLOW_MISSED, f"{word}, {where(missed)}"


def of_table(generator: Generator, trajectories: Iterable[dict]) -> Iterator[tuple]:
    """Yield how far trajectories leave the table of a generator, if it has one, as `of_flow`."""
    if generator.table is not None:
        pairs = ((series["control_torque"], series["rotor_speed"]) for series in trajectories)
        torque, speed = map(np.concatenate, zip(*pairs, strict=True))
        # a limit holds the speed below the end of the table
        off = generator.beyond_table(torque, np.minimum(speed, generator.fastest))
        ranges = f"{measured(torque, 'N*m', 4)} at {measured(speed, 'rad/s', 4)}"
        word = f"how far {ranges} leave generator.table, over its range"
        yield "generator_table", max(off, 0.0), BEYOND, word


def _of_design(ended):
    """Yield name, value, limit and place of the checks of the whole result."""
    physics, result, verifications = ended.physics, ended.result, ended.verifications
    ratios, errors = curve_errors(result)
    worst = int(np.argmax(errors))
    word = f"torque by the curve over direct BEM, less one, at tip speed ratio {ratios[worst]:.3f}"
    word += ended.jump if errors[worst] > physics.case.hydrodynamics.tolerance else ""
    yield "surrogate_error", errors[worst], physics.case.hydrodynamics.tolerance, word
    if physics.law.is_feedback:
        yield from recovery(physics, verifications)
    elif not physics.may_pulse:  # else the objective has no limit on ever finer meshes
        change = "change of the objective on a finer mesh, as far as it is known"
        yield "mesh_error", result.mesh_error, MESH_ERROR, change
    yield from of_table(physics.case.generator, [x.trajectory for x in verifications])
    alone = [x for x in verifications if x.scenario.steady or physics.law.states]
    if physics.law.is_feedback and alone:
        growth, when = _worst(alone, "growth")
        word = f"largest real part of the closed loop's eigenvalues, 1/s, at {when}"
        yield "closed_loop", growth, 0.0, word
    if physics.remembers:
        names = {physics.named("wake_induction_table", scenario) for scenario in physics.scenarios}
        yield from _of_tables(result.setup.band(physics), result, names)
        memory = stability_of(result)
        growth = memory.growth if memory else np.inf
        word = memory.text if memory else "not known at tip speed ratios as small as these"
        if physics.law.is_feedback or not all(scenario.steady for scenario in physics.scenarios):
            yield "closed_loop_with_memory", growth, 0.0, f"growth, 1/s, with memory: {word}"
    yield from _bounds(ended)
    captured = isinstance(physics.objective, CapturedEnergy)
    for verification, suffix in _suffixed(verifications):
        if physics.case.ends_free and not verification.scenario.steady:
            share = _stored(physics, verification) / max(abs(verification.simulation.energy), 1e-9)
            word = "energy that the rotor keeps or gives, beyond equilibrium, over captured energy"
            yield f"stored_energy{suffix}", share, STORED, word
    if not captured:
        of_model = tuple(verification.of_model for verification in verifications)
        integrated = replace(ended, verifications=of_model).objective
        error = abs(result.objective - integrated) / max(abs(integrated), 1e-9)
        yield "objective_error", error, ENERGY_ERROR, "collocated against integrated objective"
    if ended.start.reference > 0.0:
        behind = physics.objective.behind(ended.objective, ended.start.reference)
        word = "share by which the objective is below that at the start of the run"
        yield "energy_below_start", behind, BELOW_START, word
    for limit in physics.design_limits:
        yield _of_design_limit(ended, limit)
    for verification, suffix in _suffixed(verifications):
        for limit in verification.scenario.limits:
            yield from _of_limit(limit, verification, suffix)
    yield from _resolved(ended)


def _of_tables(band, result, names):
    """Yield how far a wake with memory leaves its tables, and whether these determine it.

    The tip speed ratio of the wake follows from its mean induction, which has to rise with it
    everywhere, or to fall.
    """
    nodes, outside, used = result.setup.nodes, 0.0, []
    for trajectory in result.trajectories:
        wake = trajectory["wake_ratio"]
        factor = trajectory["tip_speed_ratio"] / wake
        for values, ends in ((factor, FACTORS), (wake, nodes)):
            beyond = np.maximum(ends[0] - values, values - ends[-1])
            outside = max(outside, float(np.max(beyond)) / np.ptp(ends))
        used += [np.min(wake), np.max(wake)]
    word = "how far the wake's tip speed ratio, or the rotor's over it, is beyond the tables"
    yield "wake_in_tables", outside, 0.0, word
    pieces = TorqueSpline(nodes).pieces
    ratios = np.linspace(max(min(used), nodes[0]), min(max(used), nodes[-1]), PROBES)
    tables = map(result.problem.get_val, names)
    slopes = np.min([band.direction * pieces(table)(ratios, 1) for table in tables], axis=0)
    worst = int(np.argmin(slopes))
    word = f"slope of the mean induction against its direction, at ratio {ratios[worst]:.3g}"
    yield "wake_induction_turns", max(-float(slopes[worst]), 0.0), 0.0, word


def _bounds(ended):
    """Yield by how much the energy exceeds the bounds of theory, with a wake in equilibrium."""
    physics, optimum = ended.physics, ended.optimum
    if physics.remembers:  # before the wake follows, a rotor may capture more
        return
    energy = ended.total(attrgetter("simulation.energy"))
    bound = energy_bound(physics, optimum)
    for name, most, word in (
        ("energy_over_bound", bound, "quasi-steady bound"),
        ("energy_over_certificate", certified_energy(physics, optimum, bound), "certificate"),
    ):
        if most is not None:
            detail = f"simulated energy over the {word}, less one"
            yield name, energy / most - 1.0, BOUND_MARGIN, detail


def _resolved(ended):
    """Yield by how much a blade of many stations exceeds a limit on its loads, the most."""
    excesses = []
    for verification in ended.verifications:
        for limit in verification.scenario.limits:
            if limit.is_of(LOADS) and verification.resolved:
                series = verification.resolved
                over, when = _largest(verification.scenario, limit.excess(series), series["time"])
                excesses.append((over, limit.name, when))
    if excesses:
        over, name, when = max(excesses)
        word = f"{name} of the same blade with {loads.STATIONS} stations over its limit, less one"
        yield "loads_resolved", max(over, 0.0), RESOLVED, f"{word}, at {when}"


def _stored(physics, verification) -> float:
    """Return the kinetic energy that the optimizer stores in a rotor, or takes from it, J.

    Open loop chooses the first and the last speed. Under feedback that begins in equilibrium these
    follow from the flow: only what is gained over the scenario and exceeds that at the equilibrium
    speed of the last flow counts, or what is lost, unless captured energy is the objective.
    """
    captured = isinstance(physics.objective, CapturedEnergy)
    speed, inertia = verification.simulation.rotor_speed, verification.plant.inertia
    change = 0.5 * inertia * (speed[-1] ** 2 - speed[0] ** 2)
    if not physics.law.is_feedback or verification.scenario.mesh.initial_speed == "free":
        return abs(change)
    net, slowed = (torque[-1] for torque in verification.net_torques)
    slope = (slowed - net) / (SLOWED * speed[-1])
    # without a slope no speed near the last one is a stable equilibrium
    beyond = -inertia * speed[-1] * net / slope if slope > 0.0 else change
    return max(min(change, beyond) if captured else -change, 0.0)


def recovery(
    physics: Physics, verifications: tuple[Verification, ...]
) -> Iterator[tuple[str, float, float, str]]:
    """Yield how far a rotor under feedback is closer to stall than `DistanceFromStall` allows.

    That is the check's name, its value and limit, and what it is.
    """
    share, when = _worst(verifications, "short_of_recovery")
    word = f"missing share of the least torque that recovers a slowed rotor, at {when}"
    # without a torque curve no distance is required, only that the rotor recovers
    if np.isfinite(share):
        yield "distance_from_stall", share, RECOVERY_ERROR if physics.has_curve else 1.0, word


def _of_design_limit(ended, limit):
    """Return how far the design, or the whole result, exceeds a limit."""
    point = ended.result.point
    over = limit.excess(ended.quantities)
    worst, where = int(np.argmax(over)), f"the {limit.name.replace('_', ' ')}"
    if limit.place == "span" and over.size == point.blade.r.size:
        where = f"r = {point.blade.r[worst]:.3f} m"
    # the energies are those of the integration
    most = ENERGY_ERROR if limit.is_of(names(over="result")) else NODE_VIOLATION
    word = f"share by which {limit.key} is exceeded, at {where}"
    return f"{limit.name}_bounds", max(over[worst], 0.0), most, word


def _of_limit(limit, verification, suffix):
    """Yield how far a limit over time is exceeded in a scenario, at and between the nodes."""
    scenario, time = verification.scenario, verification.trajectory["time"]
    over, when = _largest(scenario, limit.excess(verification.at_nodes), time)
    # an optimization has loads from tables, which are no more exact
    most = BETWEEN if limit.is_of(LOADS) else NODE_VIOLATION
    word = f"share by which {limit.key} is exceeded, at "
    yield f"{limit.name}_at_nodes{suffix}", max(over, 0.0), most, word + when
    if limit.constrains(verification.physics.law):
        over, when = _largest(scenario, *verification.between_nodes(limit))
        name = "in_equilibrium" if scenario.steady else "between_nodes"
        yield f"{limit.name}_{name}{suffix}", over, limit.most_between, word + when


def designed(physics: Physics, point: StartingPoint) -> dict[str, np.ndarray]:
    """Return the quantities of `DesignBounds` besides the shape: set angle, radius, hub, gains."""
    return {
        "set_angle": physics.shape.control(point.blade).get("twist", np.empty(0)),
        "radius": np.array([point.blade.rotor_radius]),
        "hub_inertia": np.array([point.blade.hub_inertia]),
        "gain": point.gains,
    }


def design_bounds(physics: Physics) -> Iterator[tuple[DesignBounds, str, float]]:
    """Yield each bounds of the design, the unit in which a case gives them, its factor from SI."""
    metres, degrees, plain = ("m", 1.0), ("deg", np.rad2deg(1.0)), ("", 1.0)
    radius = "m", 1.0 / np.cos(physics.blade.cone)  # that of the tip, in place of the disc's
    units = {"chord": metres, "twist": degrees, "set_angle": degrees, "radius": radius}
    units |= {"hub_inertia": ("kg*m**2", 1.0), "thickness": plain, "gain": plain}
    for limit in physics.design_limits:
        if isinstance(limit, DesignBounds):
            yield limit, *units[limit.name]


def energy_bound(physics: Physics, optimum: SteadyOptimum) -> float:
    """Return the quasi-steady bound, J; see `hkt_mdo.rotor.steady_optimum`."""
    bound, blade = 0.0, optimum.blade
    for scenario in physics.scenarios:
        rotor, coefficient = physics.rotor_in(scenario), optimum.power_coefficient
        if rotor is not physics.rotor:
            sized = physics.blade.with_rotor_radius(blade.rotor_radius)
            coefficient = rotor.best_of_shape(physics.shape, sized).power_coefficient
        passing = scenario.weight * float(np.sum(scenario.inflow.cubes(scenario.edges)))
        bound += passing * coefficient * power_scale(rotor.water_density, blade.rotor_radius, 1.0)
    return bound


def curve_errors(result: Optimized) -> tuple[np.ndarray, np.ndarray]:
    """Return the curves' relative torque errors over the trajectories' tip speed ratios.

    The largest of all turbines, where these differ between scenarios. A steady scenario has only
    the tip speed ratios of its equilibria: between them the torque may jump.
    """
    physics, blade, probes = result.physics, result.point.blade, []
    for scenario, trajectory in zip(physics.scenarios, result.trajectories, strict=True):
        ratio = np.maximum(trajectory["tip_speed_ratio"], SLOWEST_RATIO)
        probes.append(ratio if scenario.steady else np.linspace(np.min(ratio), np.max(ratio), 201))
    probe = np.sort(np.concatenate(probes))
    if not result.curve.size:
        return probe, np.zeros(probe.size)
    basis, errors = TorqueSpline(result.setup.nodes).basis(probe), []
    for rotor in dict.fromkeys(map(physics.rotor_in, physics.scenarios)):
        curve = result.curve
        if rotor is not physics.rotor:
            curve = rotor.coefficients(blade, result.setup.nodes).torque
        errors.append(np.abs(basis @ curve / rotor.coefficients(blade, probe).torque - 1.0))
    return probe, np.max(errors, axis=0)


def explain_all(checks: list[CheckEntry], physics: Physics) -> str:
    """Return the failed checks as text; empty if none failed.

    Where the optimizer failed, a standstill stands first, then the optimizer; of the other checks
    only the values follow.
    """
    failed = [check for check in checks if not check.passed]
    if not failed or failed[0].name != "optimizer":
        return "; ".join(explain(check, physics) for check in failed)
    stops = [check for check in failed if check.name.startswith("rotor_keeps_turning")][:1]
    others = [f"{check.name} = {check.value:.3g}" for check in failed[1:] if check not in stops]
    text = "; ".join(explain(check, physics) for check in (*stops, failed[0]))
    return f"{text}; also refused: {', '.join(others)}" if others else text


def explain(check: CheckEntry, physics: Physics) -> str:
    """Return the failed check, its place and what to try."""
    text = check.detail or ""
    if check.name.partition(" (")[0] not in ("optimizer", "rotor_keeps_turning"):
        text = joined(f"{check.name} = {check.value:.3g} exceeds {check.limit:g}", text)
    return f"{text} ({_remedy(check, physics)})"


def _remedy(check: CheckEntry, physics: Physics) -> str:
    """Return what to try where a check fails, without what the case has already."""
    name, _, of = check.name.rstrip(")").partition(" (")
    remedies, end = REMEDIES["moving"], "_".join(name.split("_")[-2:])
    suggestions = remedies.get(name) or remedies.get(end, remedies["others"])
    if all(scenario.steady for scenario in physics.scenarios if of in ("", scenario.name)):
        suggestions = REMEDIES["steady"].get(name, suggestions)
    many = [key for key, count in physics.shape.points.items() if count > POINTS + 1]
    if name == "optimizer" and many and physics.blade.r.size > POINTS + 1:
        return "try " + " and ".join(f"design.{key}_points: {POINTS}" for key in many)
    why = f"{suggestions[0]} " if suggestions[0].endswith(":") else ""
    *others, last = (x for x in suggestions[bool(why) :] if not _has(physics.case, x))
    return f"{why}try {', '.join([*others, f'or {last}' if others else last])}"


def _has(case, suggestion: str) -> bool:
    """Tell whether a case has the value that a suggestion gives a key, or no use for the key."""
    if "resource." in suggestion:
        return not any(x.inflow and x.inflow.steady for x in (case, *case.scenarios))
    if "control.smoothing" in suggestion:
        return not case.control.is_feedback or case.control.torque_limit is None
    match = re.match(r"([\w.]+)=([\w-]+)", suggestion)
    return match is not None and attrgetter(match[1])(case) == match[2]
