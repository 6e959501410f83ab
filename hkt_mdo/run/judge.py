"""The judges of a result: what is asked besides the optimizer's own word.

A result is a success only if the optimizer converged and an integration that shares neither torque
curve nor collocation with it, the quasi-steady bound and every bound of the problem agree.
"""

from dataclasses import dataclass

import numpy as np
import openmdao.api as om
from scipy.integrate import quad_vec

from hkt_mdo.dynamics.simulation import SLOWEST_RATIO, Plant, RecordedTorque, Simulation, simulate
from hkt_mdo.problem.build import BEM
from hkt_mdo.problem.start import SLOWED, StartingPoint
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.solve.drivers import Outcome

# Limits of the judges, as README.md explains them
ENERGY_ERROR, SURROGATE_ERROR, SPEED_ERROR = 2e-4, 1e-3, 1e-2
BELOW_START = 2e-3  # what the rotor's inertia and its distance from stall may cost
BOUND_MARGIN, NODE_VIOLATION, BETWEEN_VIOLATION = 1e-5, 1e-6, 1e-3


@dataclass(frozen=True)
class Check:
    """One judge's word: a value, the limit that it must not exceed, and where it occurred."""

    name: str
    value: float
    limit: float
    passed: bool
    detail: str


@dataclass(frozen=True, eq=False)
class Optimized:
    """An optimization's end: the design, the collocated trajectory and how the optimizer fared."""

    problem: om.Problem
    outcome: Outcome
    point: StartingPoint
    nodes: np.ndarray
    trajectory: dict[str, np.ndarray]
    energy: float
    generator_energy: float
    inertia: float
    mass: float
    curve: np.ndarray


def fly(case, world, result) -> Simulation:
    """Integrate the found design under the found controller with direct BEM."""
    plant = Plant(
        result.point.blade,
        world.polar,
        result.inertia,
        case.fluid.density,
        BEM[case.hydrodynamics.check],
    )
    if world.law is None:
        controller = _recorded(case, world, result)
    else:
        law, gains = world.law, result.point.gains

        def controller(_, speed):
            return law.torque(speed, gains)

    return simulate(
        plant,
        world.inflow,
        controller,
        float(result.trajectory["rotor_speed"][0]),
        case.phase.duration,
        samples=20 * case.phase.segments + 1,
        max_step=case.phase.duration / case.phase.segments,
    )


def _recorded(case, world, result) -> RecordedTorque:
    return RecordedTorque(
        result.trajectory["time"],
        result.trajectory["control_torque"],
        case.phase.segments,
        world.torque_limit,
    )


def energy_error(result, flown) -> float:
    """Return the relative difference of the collocated from the integrated energy."""
    return abs(result.energy / flown.energy - 1.0) if flown.energy > 0.0 else np.inf


def speed_errors(result, flown) -> np.ndarray:
    """Return the relative differences of the integrated from the collocated speed at the nodes."""
    trajectory = result.trajectory
    return np.abs(flown.speed_at(trajectory["time"]) / trajectory["rotor_speed"] - 1.0)


def is_false(result, flown) -> bool:
    """Tell whether an integration denies what the collocation has solved."""
    return bool(
        energy_error(result, flown) > ENERGY_ERROR
        or np.max(speed_errors(result, flown)) > SPEED_ERROR
    )


def judge(case, world, optimum, reference, result, flown) -> list[Check]:
    """Return what every judge says, the optimizer first."""
    trajectory, status = result.trajectory, result.outcome
    checks = [Check("optimizer", float(not status.success), 0.0, status.success, status.message)]

    def check(name, value, limit, detail=""):
        checks.append(Check(name, float(value), limit, bool(value <= limit), detail))

    stopped = flown.stopped_at is not None
    checks.append(
        Check(
            "rotor_keeps_turning",
            float(stopped),
            0.0,
            not stopped,
            f"rotor stops at t = {flown.stopped_at:.2f} s, not generating" if stopped else "",
        )
    )
    off = np.abs(
        np.interp(trajectory["time"], flown.time, flown.hydrodynamic_torque * flown.rotor_speed)
        - trajectory["hydrodynamic_power"]
    )
    check(
        "energy_error",
        energy_error(result, flown),
        ENERGY_ERROR,
        "collocated over independently integrated energy, less one; power differs most at "
        f"t = {trajectory['time'][np.argmax(off)]:.2f} s",
    )
    error = speed_errors(result, flown)
    worst = int(np.argmax(error))
    check("max_speed_error", error[worst], SPEED_ERROR, f"at t = {trajectory['time'][worst]:.2f} s")
    ratios, errors = curve_errors(world, result)
    worst = int(np.argmax(errors))
    check(
        "surrogate_error", errors[worst], SURROGATE_ERROR, f"at tip speed ratio {ratios[worst]:.3f}"
    )
    check(
        "energy_over_bound",
        flown.energy / energy_bound(case, world, optimum) - 1.0,
        BOUND_MARGIN,
        "simulated energy over the quasi-steady bound, less one",
    )
    if reference > 0.0:
        check(
            "energy_below_start",
            1.0 - flown.energy / reference,
            BELOW_START,
            "a worse optimum than where the run began",
        )
    for name, value, where in _node_violations(case, world, result):
        check(name, value, NODE_VIOLATION, where)
    if world.law is None:
        over, when = between_nodes(case, world, result)
        worst = int(np.argmax(over))
        check(
            "control_torque_between_nodes",
            over[worst],
            BETWEEN_VIOLATION,
            f"at t = {when[worst]:.2f} s",
        )
    return checks


def between_nodes(case, world, result):
    """Return how far the open loop's torque leaves its range, and when (s), by segment.

    Looked at twenty times a segment; over the limit, or the largest torque where there is none.
    """
    segments = case.phase.segments
    if world.law is not None:
        return np.zeros(segments), np.zeros(segments)
    share = (np.arange(20) + 0.5) / 20.0
    dense = (np.arange(segments)[:, None] + share) * case.phase.duration / segments
    torque = _recorded(case, world, result).unlimited(dense)
    unit = world.torque_limit or float(np.max(torque))
    over = np.maximum(torque - (world.torque_limit or np.inf), -torque) / unit
    worst = np.argmax(over, axis=1)
    rows = np.arange(segments)
    return over[rows, worst], dense[rows, worst]


def _node_violations(case, world, result):
    """Yield how far each bounded quantity leaves its bounds, over the bounds' own size."""

    def violation(values, low, high, places):
        size = max(abs(x) for x in (low, high) if np.isfinite(x)) or 1.0
        over = np.maximum(low - values, values - high) / size
        worst = int(np.argmax(over))
        return max(float(over[worst]), 0.0), f"at {places[worst]}"

    blade, trajectory = result.point.blade, result.trajectory
    stations = [f"r = {r:.3f} m" for r in blade.r]
    times = [f"t = {t:.2f} s" for t in trajectory["time"]]
    if case.design.blade == "optimized":
        yield "chord_bounds", *violation(blade.chord, *world.shape.chord_bounds, stations)
        yield "twist_bounds", *violation(blade.twist, *world.shape.twist_bounds, stations)
    elif case.design.set_angle_bounds is not None:
        _, angle = world.shape.control(blade)
        yield "set_angle_bounds", *violation(angle, *world.shape.twist_bounds, ["the set angle"])
    if world.shape.radius_bounds is not None:
        radius = np.array([blade.rotor_radius])
        yield "radius_bounds", *violation(radius, *world.shape.radius_bounds, ["the radius"])
    if case.design.gain_bounds is not None:
        yield "gain_bounds", *violation(result.point.gains, *case.design.gain_bounds, ["the gain"])
    speed = trajectory["rotor_speed"]
    yield "rotor_speed_at_nodes", max(0.0, -float(np.min(speed) / np.max(np.abs(speed)))), ""
    torque = trajectory["control_torque"]
    high = np.inf if world.torque_limit is None else world.torque_limit
    size = np.max(np.abs(torque)) if world.torque_limit is None else world.torque_limit
    over = np.maximum(-torque, torque - high) / size
    worst = int(np.argmax(over))
    yield "control_torque_at_nodes", max(float(over[worst]), 0.0), f"at {times[worst]}"


def energy_bound(case, world, optimum):
    """Return the quasi-steady bound, J; see `hkt_mdo.rotor.steady_optimum`."""
    edges = np.linspace(0.0, case.phase.duration, case.phase.segments + 1)
    cubed, _ = quad_vec(
        lambda share: np.sum(
            world.inflow.speed(edges[:-1] + share * np.diff(edges)) ** 3 * np.diff(edges)
        ),
        0.0,
        1.0,
    )
    area = np.pi * optimum.blade.rotor_radius**2
    return 0.5 * case.fluid.density * area * optimum.power_coefficient * float(cubed)


def curve_errors(world, result):
    """Return the curve's relative torque errors over the trajectory's tip speed ratios."""
    ratios = np.maximum(result.trajectory["tip_speed_ratio"], SLOWEST_RATIO)
    probe = np.linspace(np.min(ratios), np.max(ratios), 201)
    if not result.curve.size:
        return probe, np.zeros(probe.size)
    exact = bem.rotor_coefficients(result.point.blade, world.polar, probe).torque
    return probe, np.abs(TorqueSpline(result.nodes).basis(probe) @ result.curve / exact - 1.0)


def recovers(case, world, result, slowed=SLOWED):
    """Tell whether a rotor under feedback keeps its distance from stall; see `RecoveryComp`."""
    if world.law is None or not result.curve.size:
        return True
    flow, radius = result.trajectory["inflow_speed"], result.point.blade.rotor_radius
    scale = 0.5 * np.pi * radius**3 * case.fluid.density * flow**2

    def net(share):
        speed = share * result.trajectory["rotor_speed"]
        basis = TorqueSpline(result.nodes).basis(speed * radius / flow)
        return scale * (basis @ result.curve) - world.law.torque(speed, result.point.gains)

    return bool(np.all(net(1.0 - slowed) >= net(1.0)))


FALSE_SOLUTION = (
    "the collocation is too coarse or met a false solution: try more phase.segments, "
    "phase.transcription=gauss-lobatto, start.method=quasi_steady"
)
TRY = {
    "optimizer": "try hkt run --resume, the other driver.optimizer, or more driver.max_iterations",
    "rotor_keeps_turning": "try a larger control.torque_limit, or start.method=quasi_steady",
    "energy_error": FALSE_SOLUTION,
    "max_speed_error": FALSE_SOLUTION,
    "surrogate_error": "try a smaller hydrodynamics.tolerance, or hydrodynamics.torque=direct",
    "energy_below_start": FALSE_SOLUTION,
    "energy_over_bound": "try more phase.segments and a smaller hydrodynamics.tolerance",
    "control_torque_between_nodes": "try more phase.segments",
}


def explain(check: Check) -> str:
    """Return which judge refused, why and where, and what to try."""
    remedy = TRY.get(check.name, "try a smaller driver.tolerance")
    if check.name == "optimizer":
        return f"the optimizer did not converge: {check.detail} ({remedy})"
    if check.name == "rotor_keeps_turning":
        return f"{check.detail} ({remedy})"
    where = f", {check.detail}" if check.detail else ""
    return f"{check.name} = {check.value:.3g} exceeds {check.limit:g}{where} ({remedy})"
