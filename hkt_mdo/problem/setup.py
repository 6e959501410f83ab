"""The start of one optimization, and how far it may go from there."""

from dataclasses import dataclass, field, replace

import numpy as np

from hkt_mdo.dynamics.limits import SLOWED, Limit
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO
from hkt_mdo.problem.evaluation import on_start
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.rotor.band import Band
from hkt_mdo.rotor.torque_curve import TorqueSpline

TWIST_UNIT, THICKNESS_UNIT = np.deg2rad(5.0), 0.03  # typical changes of twist and thickness / chord
LOAD_ERROR = 5e-5  # of a load between the nodes of its curve, relatively
FAR, NEAR = (0.2, 4.0, np.inf, np.inf), (0.6, 1.5, 1.2, 5.0)
"""How far from its start an optimization may go, besides the case's own bounds: factors on the
start's smallest and largest rotor speed, on the disc radius and on the gains. Near its start it
stays on its branch."""
AT_END = 1e-3  # relative distance from an end of a move at which an optimum is not one
UNUSED = 0.2
"""Relative distance of an open loop's coarser optimum from a limit, beyond which a segment does not
hold it: half of the time of `river25_record`, whose thrust and stress are far from their limits, as
is its torque half of the time."""


@dataclass(frozen=True, eq=False)
class Setup:
    """The start and the settings of one optimization.

    `nodes` are the tip speed ratios of the torque curve. `shares` has, by the names of limit and
    scenario, the share of the limit's upper bound to which the nodes of each segment are held, so
    that the limit holds between the nodes as well; a lower bound is raised there by as much. A
    limit that it has is held between the nodes, too, where `excess` says that this is possible.
    `excess` has, by the same names, how far a limit was exceeded at the nodes of each segment,
    relatively: most on all coarser meshes, and least on the last, shape (n_segments, 2); empty
    where limits are held at the nodes, as usual.
    `near` tells that it must stay `NEAR` the start, not only within `FAR`; `least_hub` (kg*m**2)
    raises the lower bound of a designed `hub_inertia`. `slowed` is the share of its speed that a
    rotor under feedback may lose and still recover from.
    """

    start: StartingPoint
    nodes: np.ndarray
    near: bool = False
    shares: dict = field(default_factory=dict)
    excess: dict = field(default_factory=dict)
    least_hub: float = 0.0
    slowed: float = SLOWED

    def bounds(self, physics: Physics) -> dict[str, tuple]:
        """Return (lower, upper) of what the optimizer changes, speed and torque too, SI units.

        By their names in the model; a radius, a hub and gains that are not designed have none.
        """
        start, shape = self.start, physics.shape
        slower, faster, by_radius, by_gain = NEAR if self.near else FAR
        speed, radius = start.operation.rotor_speed, start.blade.rotor_radius
        bounds = {f"{name}_control": ends for name, ends in shape.bounds.items()}
        bounds["rotor_speed"] = slower * np.min(speed), faster * np.max(speed)
        bounds["control_torque"] = 0.0, physics.law.torque_limit
        if shape.radius_bounds is not None:
            ends = radius / by_radius, radius * by_radius
            bounds["rotor_radius"] = np.clip(ends, *shape.radius_bounds)
        if physics.designs_hub:
            low, high = physics.case.design.hub_inertia_bounds
            bounds["hub_inertia"] = max(low, self.least_hub), high
        gains = physics.bounded(physics.law.moves(start.gains, by_gain))
        for i, (low, high) in enumerate(np.sort(gains, axis=0).T):
            if low < high:
                bounds[f"gain_{i}"] = low, high
        return bounds

    def stops(self, physics: Physics, end: StartingPoint) -> bool:
        """Tell whether an optimization ended as far from its start as it may go."""
        values = dict(zip(physics.law.named_gains, end.gains, strict=True))
        values |= {"rotor_speed": end.operation.rotor_speed, "rotor_radius": end.blade.rotor_radius}
        bounds, free = self.bounds(physics), replace(self, near=False).bounds(physics)
        return any(
            np.any(np.abs(values[name] / move - 1.0) < AT_END)
            for name in values.keys() & bounds.keys()
            for move, bound in zip(bounds[name], free[name], strict=True)
            if move != bound
        )

    def band(self, physics: Physics) -> Band | None:
        """Return the tables of a wake with memory; None without memory.

        Their weights are those of the start's blade at the mean of its tip speed ratios.
        """
        if not physics.remembers:
            return None
        blade = self.start.blade
        ratios = [start["tip_speed_ratio"] for start in on_start(physics, self.start)]
        mean = float(np.mean(np.concatenate(ratios)))
        return Band.of(physics.rotor.polar, blade, mean, self.nodes)

    def excess_of(self, limit: Limit, scenario: Scenario) -> np.ndarray:
        """Return the `excess` of a limit in a scenario, (n_segments, 2); 0 if not known."""
        return self.excess.get((limit.name, scenario.name), np.zeros((scenario.segments, 2)))

    def holds(self, limit: Limit, scenario: Scenario) -> np.ndarray:
        """Tell in which segments a limit is held: not where they and the next are far from it.

        One with a lower bound alone is held in all of them.
        """
        near = (self.excess_of(limit, scenario)[:, 0] > -UNUSED) | np.isinf(limit.upper)
        return np.convolve(near, np.ones(3))[1:-1] > 0.0

    def share(self, limit: Limit, scenario: Scenario) -> np.ndarray:
        """Return the share of a limit that is required in each segment of a scenario; 1: all."""
        return self.shares.get((limit.name, scenario.name), np.ones(scenario.segments))

    def share_at(self, limit: Limit, scenario: Scenario, nodes: np.ndarray) -> np.ndarray:
        """Return the share of a limit required at some nodes: the smaller one of two segments.

        The segments of a steady scenario share no node.
        """
        share = self.share(limit, scenario)
        by_node = np.repeat(share, scenario.nodes_per_segment).reshape(scenario.segments, -1)
        if not scenario.steady:
            by_node[:-1, -1] = np.minimum(share[:-1], share[1:])
        return by_node.ravel()[nodes]


def curve_nodes(physics: Physics, start: StartingPoint, kept: float = np.inf) -> np.ndarray:
    """Return tip speed ratios for the torque curve: dense where the start works, sparse beyond.

    The blade will change, so nodes are added until the curve of the start's blade is twenty times
    as accurate as the case asks for, and those of the limited loads are to `LOAD_ERROR`: in and
    beside the intervals that need them, which are those where a station changes from attached to
    stalled flow. No more are added where they leave a share of the largest error in the operation,
    `kept`: at a jump that the rotor passes.
    """
    flow, _ = physics.sampled_flow
    ratios = start.operation.rotor_speed * start.blade.rotor_radius / flow
    # an optimizer that diverged may have stopped the rotor somewhere
    low, high = (max(float(end), SLOWEST_RATIO) for end in (np.min(ratios), np.max(ratios)))
    middle = 0.5 * (low + high)
    lowest = max(low - 0.06 * middle, 0.5 * low)
    nodes = _graded(lowest, high + 0.06 * middle, 0.01 * middle, 0.5 * low, 1.6 * high)
    worst = np.inf
    for _ in range(6):
        centers = 0.5 * (nodes[1:] + nodes[:-1])
        used = (centers > low - 0.03 * middle) & (centers < high + 0.03 * middle)
        errors = used * np.max([*_errors(physics, start.blade, nodes, centers)], axis=0)
        before, worst = worst, np.max(errors * ((centers > low) & (centers < high)))
        if np.max(errors) <= 1.0 or worst / kept > before:
            break
        # beside a jump of the torque the spline oscillates
        coarse = np.convolve(errors > 1.0, np.ones(3), mode="same") > 0.0
        nodes = np.sort(np.r_[nodes, centers[coarse]])
    return nodes


def _errors(physics, blade, nodes, centers):
    """Yield the relative errors of the curves of torque and limited loads over those allowed.

    Between their nodes, for the sections in every scenario, which may be fouled or reversed. The
    torque decides the energy; a load only how far its limit is kept.
    """
    allowed = {"torque_coefficient": 0.05 * physics.case.hydrodynamics.tolerance}
    names = ["torque_coefficient", *physics.load_names]
    basis, rotors = TorqueSpline(nodes).basis(centers), map(physics.rotor_in, physics.scenarios)
    for rotor in {each.polar: each for each in rotors}.values():
        tables, exact = (rotor.tables(blade, ratios, names) for ratios in (nodes, centers))
        for name in names:
            error = np.abs(basis @ tables[name].values / exact[name].values - 1.0)
            yield error / allowed.get(name, LOAD_ERROR)


def _graded(low, high, spacing, lowest, highest):
    """Return nodes equally spaced from low to high; beyond, spacing grows by a quarter a step."""
    inner = np.linspace(low, high, int(np.ceil((high - low) / spacing)) + 1)
    away = spacing * np.cumsum(np.minimum(1.25 ** np.arange(1, 100), 8.0))
    below, above = (
        edge + way * away[: np.searchsorted(away, abs(end - edge)) + 1]
        for edge, end, way in ((low, lowest, -1.0), (high, highest, 1.0))
    )
    nodes = np.concatenate((below[::-1], inner, above))
    return nodes[nodes > 0.02]
