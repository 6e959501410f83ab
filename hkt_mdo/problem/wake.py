"""A wake with memory along the start of an optimization."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hkt_mdo.dynamics.wake import AT_ONCE, slow_time
from hkt_mdo.problem.evaluation import on_start, split
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.setup import Setup
from hkt_mdo.rotor.band import Band

PULSE = 0.002
"""How much farther from its wake an open loop may be than its start, relatively."""


def band_of(physics: Physics, setup: Setup) -> Band | None:
    """Return the tables of a wake with memory at a setup; None without memory.

    Its weights are those of the setup's blade at the mean of its tip speed ratios.
    """
    if not physics.remembers:
        return None
    blade = setup.start.blade
    ratios = [known["tip_speed_ratio"] for known in on_start(physics, setup.start)]
    mean = float(np.mean(np.concatenate(ratios)))
    return Band.of(physics.rotor.as_built(blade), blade, mean, setup.nodes)


@dataclass(frozen=True, eq=False)
class Follower:
    """A wake that follows the quasi-steady start of an optimization by its two filters.

    Attributes
    ----------
    physics, setup
        The start.
    """

    physics: Physics
    setup: Setup

    @cached_property
    def band(self) -> Band | None:
        """The tables of the start's blade; None without memory."""
        return band_of(self.physics, self.setup)

    def along(self, scenario, speed) -> dict[str, np.ndarray]:
        """Return the state of the wake at the samples of a scenario, (n_times,).

        Parameters
        ----------
        scenario : Scenario
            Flow and samples.
        speed : array, shape (n_times,)
            The start's rotor speed there, rad/s.

        Returns
        -------
        dict of array
            reduced_velocity, induced_velocity (m/s), and wake_factor, the tip speed ratio over that
            of the wake.
        """
        blade, time = self.setup.start.blade, scenario.samples
        flow = scenario.inflow.speed_at(time)
        ratio = speed * blade.rotor_radius / flow
        tables = self.band.solve(self.physics.rotor_in(scenario).as_built(blade), blade, ())
        table, place = (tables[f"{name}_induction_table"].values for name in ("wake", "place"))
        steady = flow * self.band.spline.curve(table)(ratio)
        tau1 = self.physics.case.inflow_dynamics.tau1
        induction = self.band.spline.curve(place)(ratio)
        slow = np.broadcast_to(slow_time(tau1, induction, blade.rotor_radius, flow), time.shape)
        reduced = _followed(time, (1.0 - AT_ONCE) * steady, slow)
        induced = _followed(time, reduced + AT_ONCE * steady, self.band.share * slow)
        wake_ratio, _ = self.band.wake_ratio(table, induced / flow)
        return {
            "reduced_velocity": reduced,
            "induced_velocity": induced,
            "wake_factor": ratio / wake_ratio,
        }

    def bounds(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the bounds of an open loop's wake factor in a scenario, by its number.

        At the distinct nodes. A rotor that pulses, alternately faster and slower than its wake,
        would capture more than the best steady rotor, by a model that was not made for this. So it
        may be farther from its wake than its quasi-steady start by no more than `PULSE`.
        """
        scenario = self.physics.scenarios[number]
        speed, *_ = split(self.physics, self.setup.start.operation)[number]
        factor = self.along(scenario, speed)["wake_factor"]
        factor = np.interp(scenario.node_times[scenario.distinct_nodes], scenario.samples, factor)
        return factor - PULSE, factor + PULSE


def _followed(time, goal, constant):
    """Return z of constant z' = goal - z, with a goal that is linear between the times.

    It begins in equilibrium.
    """
    step = np.diff(time) / (0.5 * (constant[1:] + constant[:-1]))
    decay, rate = np.exp(-step), np.diff(goal) / step
    found = np.array(goal)
    for i in range(step.size):
        off = found[i] - goal[i] + rate[i]
        found[i + 1] = goal[i + 1] - rate[i] + off * decay[i]
    return found
