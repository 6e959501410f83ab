"""The equilibria of a rotor under a feedback law in steady flows, by direct BEM.

It shares only the physics with the optimization, neither the torque curve nor the start.
"""

from __future__ import annotations

import numpy as np

from hkt_mdo.dynamics.simulation import SLOWEST_RATIO, FeedbackTorque, Plant
from hkt_mdo.rotor.reynolds import LocalReynolds
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.torque_curve import last_fall

GRID = 241  # range of the tip speed ratio that is searched for equilibria
HIGHEST = 12.0, 96.0  # of them, at first and at last


def equilibria(
    plant: Plant, controller: FeedbackTorque, flow: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the fastest equilibrium of a rotor in each flow: where Q = u + F and Q - u - F falls.

    A fast rotor that is then loaded settles there. The states of a law are in equilibrium too.

    Parameters
    ----------
    plant : Plant
        The rotor in water.
    controller : FeedbackTorque
        A law with its gains.
    flow : np.ndarray
        Speeds of the flow, m/s, (n,).

    Returns
    -------
    speed : np.ndarray
        Speeds of the rotor, rad/s, (n,).
    running : np.ndarray
        Whether there is an equilibrium, (n,); otherwise the speed is that of a standing rotor.
    """
    law, gains, unit = controller.law, controller.gains, flow / plant.blade.rotor_radius
    if law.states:
        speed = np.asarray(law.speed_at_rest(flow, gains), dtype=float)
        return speed, plant.generator_torque(speed, flow) > 0.0

    def net(ratio, flow):
        speed = ratio * flow / plant.blade.rotor_radius
        return plant.generator_torque(speed, flow) - law.torque(speed, gains)

    highest, last = HIGHEST
    while True:
        ratios = np.linspace(SLOWEST_RATIO, highest, GRID)
        speeds = np.outer(unit, ratios)
        braking = law.torque(speeds, gains) + plant.generator.friction(speeds)
        driving = _driving(plant, flow, ratios) >= braking
        if not np.any(driving[:, -1]) or highest >= last:
            break
        highest *= 2.0
    found, running = last_fall(net, ratios, driving, flow)
    return np.where(running, found, SLOWEST_RATIO) * unit, running


def _driving(plant, flow, ratios):
    """Return the torque of the flow at tip speed ratios, N m, (n, n_ratios)."""
    radius = plant.blade.rotor_radius
    if isinstance(plant.polar, LocalReynolds):
        both = np.outer(flow / radius, ratios).ravel(), np.repeat(flow, ratios.size)
        return plant.torque(*both).reshape(flow.size, -1)
    one = np.full(ratios.size, 1.0)
    coefficient = plant.torque(ratios / radius, one) / torque_scale(plant.density, radius, 1.0)
    return np.outer(torque_scale(plant.density, radius, flow), coefficient)
