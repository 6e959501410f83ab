"""A wake with memory along the start of an optimization."""

from __future__ import annotations

import numpy as np

from hkt_mdo.dynamics.wake import AT_ONCE, slow_time
from hkt_mdo.problem.evaluation import on_start
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.setup import Setup
from hkt_mdo.rotor.band import Band


def band_of(physics: Physics, setup: Setup) -> Band | None:
    """Return the tables of a wake with memory at a setup; None without memory.

    Its weights are those of the setup's blade at the mean of its tip speed ratios.
    """
    if not physics.remembers:
        return None
    blade = setup.start.blade
    ratios = [known["tip_speed_ratio"] for known in on_start(physics, setup.start)]
    mean = float(np.mean(np.concatenate(ratios)))
    return Band.of(physics.rotor.polar, blade, mean, setup.nodes)


def along_start(physics, blade, band, scenario, speed) -> dict[str, np.ndarray]:
    """Return the wake's state at the samples of a scenario: it follows a start by its two filters.

    Parameters
    ----------
    physics : Physics
    blade : Blade
        That of the start.
    band : Band
        Its tables.
    scenario : Scenario
        Flow and samples.
    speed : array, shape (n_times,)
        The start's rotor speed there, rad/s.

    Returns
    -------
    dict of array
        reduced_velocity, induced_velocity (m/s), and wake_factor, the tip speed ratio over that of
        the wake, (n_times,).
    """
    time = scenario.samples
    flow = scenario.inflow.speed_at(time)
    ratio = speed * blade.rotor_radius / flow
    tables = band.solve(physics.rotor_in(scenario), blade, ())
    table, place = (tables[f"{name}_induction_table"].values for name in ("wake", "place"))
    steady = flow * band.spline.curve(table)(ratio)
    tau1 = physics.case.inflow_dynamics.tau1
    induction = band.spline.curve(place)(ratio)
    slow = np.broadcast_to(slow_time(tau1, induction, blade.rotor_radius, flow), time.shape)
    reduced = _followed(time, (1.0 - AT_ONCE) * steady, slow)
    induced = _followed(time, reduced + AT_ONCE * steady, band.share * slow)
    wake_ratio, _ = band.wake_ratio(table, induced / flow)
    return {
        "reduced_velocity": reduced,
        "induced_velocity": induced,
        "wake_factor": ratio / wake_ratio,
    }


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
