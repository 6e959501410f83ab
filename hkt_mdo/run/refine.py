"""How a problem is refined: segments that are divided, and limits that are lowered at the nodes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.operation_group import BINDS, is_quantity
from hkt_mdo.problem.scenario import too_large
from hkt_mdo.problem.setup import Setup
from hkt_mdo.quantities import RATES
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.run import checks
from hkt_mdo.run.verification import Optimized, Verification

LOST = 3e-6
"""Share of the energy that may be lost in segments that are not divided, and by lower limits: a
third of the error of the mesh that is allowed."""
COARSE_SPEED = 0.3
"""Share of the largest error of speed that is allowed above which a segment is divided."""
MOST_DIVISIONS = 6
"""Divisions after which a limit that is exceeded between the nodes is only lowered."""
PARTS, PARTS_OF_RATES = 4, 8
"""Parts of a divided segment; the latter where a rate is limited, which is a second derivative of
the speed (`test_a_limited_rate_of_the_torque_is_one_optimum_in_speed_and_in_torque`)."""
NEARLY_ALL, HIGHER_ORDER = 0.5, 5
"""Share of the segments that are too coarse from which an open loop's polynomials are too low, and
their order then: `river25` takes 2.4 times as long with more segments instead."""
MOST_SEGMENTS, MOST_DENSE = 10_000, 400
"""Segments: the problem takes several gigabytes; that of a dense optimizer, minutes."""
MOST_LOWERED = 5e-3
"""Largest relative amount by which a limit is lowered at the nodes, since that costs energy."""
MOST_EXCEEDED = 0.02
"""Relative excess beyond which lowering a limit at the nodes does not help.

With dynamic inflow limits may be lowered by as much, since the filters of all stations, by
which they are checked, give other loads than the two of the optimization.
"""


@dataclass(frozen=True, eq=False)
class Division:
    """Error of a mesh and the number of parts of each segment, a row for each scenario.

    Attributes
    ----------
    error : float
        Relative change of the objective on a finer mesh, as far as it is known.
    parts : list of numpy.ndarray
        Of shape (n_segments,) each; empty where the mesh is fine enough.
    order : int
        Higher order that all segments' polynomials need instead; 0: none.
    """

    error: float
    parts: list[np.ndarray]
    order: int = 0

    def allowed(self, optimizer: str) -> bool:
        """Tell whether there is something to divide and the optimizer can handle the segments."""
        most = MOST_DENSE if optimizer == "SLSQP" else MOST_SEGMENTS
        return bool(self.parts) and sum(map(np.sum, self.parts)) <= most

    @property
    def why(self) -> str:
        """The reason of the division, as text."""
        error = f", error of the mesh {self.error:.2g}" if self.error else ""
        count = sum(np.sum(parts > 1) for parts in self.parts)
        what = f"{count} segment{' is' if count == 1 else 's are'}"
        if self.order:
            what = f"polynomials of order {self.order} for nearly all segments are"
        return f"{what} too coarse{error}"


def divided(
    physics: Physics, division: Division, shares: dict, excess: dict
) -> tuple[Physics, dict, dict]:
    """Return the physics on a finer mesh, and shares and excess of limits on it, as in a `Setup`.

    A limit is not lowered in a segment that is divided: a finer mesh may need no lower limit.
    """
    order = {"order": division.order} if division.order else {}
    scenarios = tuple(
        replace(scenario.divided(parts), mesh=scenario.mesh.model_copy(update=order))
        for scenario, parts in zip(physics.scenarios, division.parts, strict=True)
    )
    parts_of = {each.name: parts for each, parts in zip(scenarios, division.parts, strict=True)}
    shares = {
        (limit, name): np.repeat(np.where(parts_of[name] > 1, 1.0, share), parts_of[name])
        for (limit, name), share in shares.items()
    }
    excess = {key: np.repeat(x, parts_of[key[1]], axis=0) for key, x in excess.items()}
    return replace(physics, scenarios=scenarios), shares, excess


def excesses_at_nodes(setup: Setup, verifications: tuple[Verification, ...]) -> dict:
    """Return how near limits were at the nodes of each segment, as a `Setup` has it.

    Of an open loop without memory: else no limit is left out, or held between the nodes. A segment
    that was near a limit once keeps it: a rate of the torque oscillates where it is not held, and
    where it is held it may be far from its limit; without that the passes alternate
    (`test_a_limited_rate_of_the_torque_is_one_optimum_in_speed_and_in_torque`).
    """
    extremes = {}
    for run in verifications:
        for limit in run.constrained:
            if not run.scenario.steady and _chooses(run.physics):
                excess, key = run.excess_at_nodes(limit), (limit.name, run.scenario.name)
                largest = np.maximum(np.max(excess, axis=1), setup.excess.get(key, excess)[:, 0])
                extremes[key] = np.stack((largest, np.min(excess, axis=1)), axis=1)
    return extremes


def _chooses(physics: Physics) -> bool:
    """Tell whether the optimizer chooses the operation at each node, without law or memory."""
    return not (physics.law.is_feedback or physics.remembers)


def lowered(
    setup: Setup, verifications: tuple[Verification, ...]
) -> tuple[dict[tuple[str, str], np.ndarray], float]:
    """Return the shares of lowered limits, and the largest excess; 0 where none is lowered.

    Limits that are exceeded between nodes are lowered at these in the segments that need it.
    Elsewhere a lower limit would only cost energy. One that can be held between the nodes is, and
    lowered only if that is not enough: its shares are 1 at first, as are those where it was not
    held.
    """
    shares, worst = dict(setup.shares), 0.0
    for verification in verifications:
        lowest = 1.0 - (MOST_EXCEEDED if verification.physics.remembers else MOST_LOWERED)
        for limit in verification.constrained:
            if not np.isfinite(limit.upper):
                continue
            most = limit.most_between
            over, _ = verification.between_nodes(limit)
            share = reached = setup.share(limit, verification.scenario)
            if verification.two_filters is not None:
                # all stations may exceed a limit that the two filters of the nodes do not reach
                excess = np.max(verification.excess_at_nodes(limit), axis=1)
                reached = np.minimum(share, 1.0 + excess)
            # if it has not helped, or the limit is exceeded by much, a lower limit does not help
            held = setup.holds(limit, verification.scenario)
            over = np.where(~held | (share > lowest) & (over < MOST_EXCEEDED), over, 0.0)
            if np.max(over) > most:
                worst = max(worst, float(np.max(over)))
                key = limit.name, verification.scenario.name
                if key in shares or not (is_quantity(limit) and _chooses(verification.physics)):
                    share = np.where(held & (over > 0.5 * most), reached * (1.0 - over), share)
                shares[key] = share
    return shares, worst


def division(
    result: Optimized, verifications: tuple[Verification, ...], before: Sequence[float]
) -> Division:
    """Return by how much a finer mesh may change the objective, and the segments to divide.

    Under open loop the error is the smaller of two: what the last division leaves to be gained, if
    the error is of the first order, by how much it has changed the objective; and the power in the
    distance that the polynomials keep from the limits that bind in their segments, which is too
    much where a limit begins or ceases to bind. A feedback law leaves the optimizer no torque over
    time to choose, and its error is none.

    Divided are segments where the integration contradicts the collocation, where it exceeds a limit
    between the nodes by so much that a lower limit would cost energy and, under open loop, those in
    which a limit begins or ceases to bind, or that keep most of that power. Where these are nearly
    all, as with a heavy rotor, whose torque has an error of the acceleration, polynomials of a
    higher order do better than shorter segments.

    Parameters
    ----------
    result, verifications
        An optimization's end, integrated.
    before
        Objectives on the coarser meshes, J, the last one's at the end.
    """
    physics, error = result.physics, 0.0
    coarse = [np.zeros(each.scenario.segments, dtype=bool) for each in verifications]
    pairs = zip(coarse, verifications, strict=True)
    moving = [pair for pair in pairs if not pair[1].scenario.steady]  # the others have no mesh
    if checks.is_false(verifications):
        _mark_contradicted(verifications, moving, before)
    if len(before) < MOST_DIVISIONS:
        for marks, verification in moving:
            marks |= _exceeded_between(verification, result.energy)
            marks |= _near_stall(verification)
    rates = any(limit.is_of(RATES) for _, each in moving for limit in each.constrained)
    if not physics.law.is_feedback:
        error = _open_loop(result, moving, before, rates)
    if not any(map(np.any, coarse)):
        return Division(float(error), [])
    mesh, order, parts = physics.scenarios[0].mesh, 0, PARTS_OF_RATES if rates else PARTS
    nearly_all = np.mean(np.concatenate(coarse)) > NEARLY_ALL
    raisable = mesh.transcription == "gauss-lobatto" and mesh.order < HIGHER_ORDER
    if error > checks.MESH_ERROR and nearly_all and raisable:
        order, parts = HIGHER_ORDER, 1
    return Division(float(error), [np.where(marks, parts, 1) for marks in coarse], order)


def _mark_contradicted(verifications, moving, before) -> None:
    """Mark the segments in which the integration contradicts the collocation."""
    # where only the energies differ, speeds differ less than is allowed
    worst = max(np.max(verification.speed_errors) for verification in verifications)
    for marks, verification in moving:
        errors = verification.speed_errors.reshape(marks.size, -1)
        marks |= np.max(errors, axis=1) > COARSE_SPEED * min(checks.SPEED_ERROR, worst)
    # the second time it is another trajectory, which no mesh corrects; Radau's ends are free
    physics, count = verifications[0].physics, sum(each.scenario.segments for each in verifications)
    radau = physics.law.is_feedback and physics.case.phase.transcription == "radau"
    if radau or (before and sum(np.sum(marks) for marks, _ in moving) > 0.5 * count):
        for marks, _ in moving:
            marks[:] = False


def _exceeded_between(verification, energy) -> np.ndarray:
    """Return the segments in which limits are exceeded between nodes that keep them.

    A limit counts if a lower one at the nodes would cost energy, or would have to be much lower.
    """
    marks = np.zeros(verification.scenario.segments, dtype=bool)
    model, shares = verification.of_model, np.sum(_energies(verification, energy), axis=1)
    for limit in verification.constrained:
        over, _ = model.between_nodes(limit)
        nodes = model.excess_at_nodes(limit)
        # what is exceeded at the nodes as well, no division corrects
        exceeded = (over > limit.most_between) & (np.max(nodes, axis=1) < 0.5 * over)
        if shares[exceeded] @ over[exceeded] > LOST or np.max(over) > MOST_LOWERED:
            marks |= exceeded
    return marks


def _near_stall(verification) -> np.ndarray:
    """Return the segments in which a rotor under feedback is closer to stall than at the nodes."""
    physics, scenario = verification.physics, verification.scenario
    marks = np.zeros(scenario.segments, dtype=bool)
    if physics.law.is_feedback and physics.has_curve:
        near = verification.short_of_recovery > checks.RECOVERY_ERROR
        segments = np.searchsorted(scenario.edges, verification.simulation.time[near]) - 1
        marks[np.maximum(segments, 0)] = True
    return marks


def _open_loop(result, moving, before, rates) -> float:
    """Return the error of the mesh under open loop, and mark the segments that cause it.

    `rates` tells whether a limit on a rate holds in some scenario.
    """
    best = result.physics.rotor.best_operation(result.point.blade).power_coefficient
    left = [_left(verification, result.energy, best) for _, verification in moving]
    total = float(sum(map(np.sum, left)))
    change = abs(result.objective / before[-1] - 1.0) if before else np.inf
    # the distance from a limit on the torque's rate is no power: only a division shows its error
    error = change if rates and before else min(change / (PARTS - 1), total)
    if error <= checks.MESH_ERROR and (before or not rates):
        return error
    for (marks, verification), shares in zip(moving, left, strict=True):
        large = shares > 0.0 if rates and not before else too_large(shares, LOST)
        marks |= _switches(verification) | large
    return error


def _switches(verification) -> np.ndarray:
    """Return the segments in which a limit begins or ceases to bind, and their neighbours."""
    marks = np.zeros(verification.scenario.segments, dtype=bool)
    for limit in verification.constrained:
        first, *others = (verification.excess_at_nodes(limit) > -BINDS).T
        last = others[-1]
        marks |= ~np.all(np.equal(first, others), axis=0)
        marks[1:] |= last[:-1] != last[1:]
        marks[:-1] |= first[:-1] != first[1:]
    return marks


def _left(verification, energy, best) -> np.ndarray:
    """Return the energy that the mesh may lose in every segment, as a share of the whole.

    In a segment in which a limit binds at a node, the polynomials keep it at the others as well, at
    a distance. The power in that distance is what a finer mesh may gain, to first order. Elsewhere
    it is the difference of the power coefficient from its largest, `best`, if the objective is that
    energy.
    """
    physics, scenario = verification.physics, verification.scenario
    simulated = verification.integrated
    short = np.zeros(scenario.segments)
    if physics.objective.is_energy and not physics.losses_count:
        density, radius = (verification.scalars[name] for name in ("density", "rotor_radius"))
        scale = power_scale(density, radius, simulated["inflow_speed"])
        short = scale * best - simulated["hydrodynamic_power"]
        short = np.mean(short[1:].reshape(scenario.segments, -1), axis=1)
        short *= np.diff(scenario.edges) * scenario.weight / abs(energy)
    over = [verification.excess_at_nodes(limit) for limit in verification.constrained]
    if not over:
        return short
    room = np.maximum(-np.max(over, axis=0), 0.0)
    binds, shares = np.min(room, axis=1) < BINDS, _energies(verification, energy)
    return np.where(binds, np.sum(room * shares, axis=1), np.maximum(short, 0.0))


def _energies(verification, energy) -> np.ndarray:
    """Return the shares of the nodes of every segment in the energy, (segments, nodes)."""
    scenario = verification.scenario
    power = np.abs(verification.trajectory["hydrodynamic_power"]) * scenario.node_weights
    return power.reshape(scenario.segments, -1) * (scenario.weight / abs(energy))
