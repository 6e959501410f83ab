"""The equilibria of a rotor under a feedback law in steady flows, by the torque of its plant."""

from collections.abc import Callable

import numpy as np

from hkt_mdo.dynamics.simulation import SLOWEST_RATIO, FeedbackTorque, Plant
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.torque_curve import last_fall

GRID = 241  # range of the tip speed ratio that is searched for equilibria
HIGHEST = 12.0, 24.0, 48.0, 96.0  # of them, tried until no rotor is driven there
STEPS, BALANCED = 40, 1e-9  # of Newton's method at most; what is left over the size of its terms
FARTHEST, REACH = 0.2, 10.0  # of the speed in a step, and of all values, over the largest
MOVE = 1e-5  # share of the speed for differences


def equilibria(
    plant: Plant, controller: FeedbackTorque, flow: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the fastest equilibrium of a rotor in each flow: where Q = u + F and Q - u - F falls.

    A fast rotor that is then loaded settles there. Under a law with states it is the equilibrium
    close to the law's `speed_at_rest`.

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
        Whether there is an equilibrium, (n,); otherwise the speed is that of a standing rotor, or
        the law's `speed_at_rest`.
    states : np.ndarray
        States of the law, (n_states, n).
    """
    law, gains, unit = controller.law, controller.gains, flow / plant.blade.rotor_radius
    if law.states:
        values, running = at_rest(law, gains, flow, lambda w: plant.generator_torque(w, flow))
        return values[0], running, values[1:]

    def net(ratio, flow):
        speed = ratio * flow / plant.blade.rotor_radius
        return plant.generator_torque(speed, flow) - law.torque(speed, gains)

    for highest in HIGHEST:
        ratios = np.linspace(SLOWEST_RATIO, highest, GRID)
        speeds = np.outer(unit, ratios)
        braking = law.torque(speeds, gains) + plant.generator.friction(speeds)
        driving = _driving(plant, flow, ratios) >= braking
        if not np.any(driving[:, -1]):
            break
    ratio, running = last_fall(net, ratios, driving, flow)
    return np.where(running, ratio, SLOWEST_RATIO) * unit, running, np.empty((0, flow.size))


def at_rest(law, gains, flow: np.ndarray, held: Callable) -> tuple[np.ndarray, np.ndarray]:
    """Return where a rotor and the states of its law are at rest in some flows.

    By Newton's method from the law's `speed_at_rest` and `at_rest`: the states' rates are zero, and
    the law's torque is the one that holds the rotor.

    Parameters
    ----------
    law : FeedbackLaw
        A law with states.
    gains : np.ndarray
        Its gains.
    flow : np.ndarray
        Speeds of the flow, m/s, (n,).
    held : callable
        The torque of the generator that holds the rotor at speeds (rad/s) in these flows, N*m.

    Returns
    -------
    values : np.ndarray
        Speed of the rotor (rad/s) and states, (1 + n_states, n); the law's own where there is none.
    balanced : np.ndarray
        Whether there is an equilibrium in which the flow drives the rotor, (n,).
    """
    speed = np.asarray(law.speed_at_rest(flow, gains), dtype=float)
    values = first = np.array([speed, *law.at_rest(held(speed), flow)])
    for _ in range(STEPS):
        speed, *states = values
        slopes, torque = law.slopes(speed, flow, gains, *states), law.torque(speed, gains, *states)
        change = held((1.0 + MOVE) * speed) - held((1.0 - MOVE) * speed)
        slopes[0, 0] -= change / (2.0 * MOVE * speed)
        off = np.array([torque - held(speed), *law.rates(speed, flow, gains, *states)])
        terms = np.einsum("ijn,jn->in", np.abs(slopes), np.abs(values))
        balanced = np.all(np.abs(off) <= BALANCED * terms, axis=0)
        if np.all(balanced):
            break
        moves = -np.einsum("nij,jn->in", np.linalg.pinv(np.moveaxis(slopes, -1, 0)), off)
        far = np.abs(moves[0]) / (FARTHEST * speed), np.abs(moves) / (REACH * np.max(values))
        values = values + moves / np.maximum(1.0, np.max(np.vstack(far), axis=0))
    return np.where(balanced, values, first), balanced & (held(values[0]) > 0.0)


def _driving(plant, flow, ratios):
    """Return the torque of the flow at tip speed ratios, N m, (n, n_ratios)."""
    radius = plant.blade.rotor_radius
    if plant.polar.follows_reynolds:
        speed, inflow = np.outer(flow / radius, ratios).ravel(), np.repeat(flow, ratios.size)
        return plant.torque(speed, inflow).reshape(flow.size, -1)
    return np.outer(torque_scale(plant.density, radius, flow), plant.coefficient(ratios))
