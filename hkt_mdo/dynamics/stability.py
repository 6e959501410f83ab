"""Stability of rotor, wake and controller together, linearized about equilibrium at instants.

When a rotor gains speed, its torque at first is that in the present wake, and only after seconds
that in the wake that follows. With Øye's filters at every station (`hkt_mdo.dynamics.wake`), a
small change
of the speed, e^(st), changes the torque of the flow by (docs/dynamic_inflow.md)

    G(s) = k0 + sum of c_j (k + (1 - k) / (1 + tau1 s)) / (1 + tau2_j s),

k0 the slope of the torque by the speed in an unchanged wake, c_j the slope that the wake of station
j adds in the end. With the controller's U(s), the loop has J s = G(s) - U(s).
"""

from dataclasses import dataclass, replace

import numpy as np

from hkt_mdo.dynamics.simulation import FeedbackTorque, Plant, RecordedTorque
from hkt_mdo.dynamics.wake import AT_ONCE

FREQUENCIES = 600  # frequencies between those of the slowest and the fastest time constant
HEAVY = 1e3  # times the largest inertia of a loop at its limit: as heavy as any rotor
MOVE = 1e-4  # relative change of the speed for differences


@dataclass(frozen=True, eq=False)
class Loop:
    """A rotor, its wake and its controller, linearized at n instants.

    Attributes
    ----------
    frozen : array, shape (n,)
        Slope of the flow's torque by the rotor's speed in an unchanged wake, less that of the
        shaft's friction, N*m*s/rad.
    answers : array, shape (n, n_stations)
        Slope that the wake of each station adds in the end, N*m*s/rad.
    slow, fast : array, shape (n, 1) and (n, n_stations)
        Time constants of the wake's filters, s.
    law : array, shape (n, 1 + n_states, 1 + n_states)
        Derivatives of the generator torque and of the rates of the law's states (rows) by the
        rotor's speed and those states.
    inertia : float
        That of the rotor, kg*m**2.
    """

    frozen: np.ndarray
    answers: np.ndarray
    slow: np.ndarray
    fast: np.ndarray
    law: np.ndarray
    inertia: float

    @classmethod
    def of(cls, plant: Plant, controller: FeedbackTorque | RecordedTorque, speed, flow, *states):
        """Return the loop of a plant, in equilibrium at some points.

        speed (rad/s), flow (m/s) and the states of the law have the shape (n,). A wake without
        memory follows at once: there are no stations.
        """
        wake, n = plant.wake, speed.size
        frozen = plant.torque_slope(speed, flow) - plant.generator.shaft_friction_slope
        if isinstance(controller, FeedbackTorque):
            law = np.moveaxis(controller.law.slopes(speed, flow, controller.gains, *states), -1, 0)
        else:
            law = np.full((n, 1, 1), controller.stiffness)
        if wake is None:
            none = np.empty((n, 0))
            return cls(frozen, none, np.ones((n, 1)), none, law, plant.inertia)
        rest, (_, at_place) = wake.at_rest(speed, flow), wake.balanced(speed, flow)
        step = MOVE * speed
        (faster, _), (slower, _) = (wake.balanced(speed + move, flow) for move in (step, -step))
        by_speed = (faster - slower) / (2.0 * step[:, None])
        answers = plant.torque_by_wake(speed, flow, rest) * by_speed
        answers = answers.reshape(n, 2, -1).sum(axis=1)  # of the axial and the tangential velocity
        return cls(frozen, answers, *wake.times(flow, at_place), law, plant.inertia)

    @property
    def matrix(self) -> np.ndarray:
        """Matrix of the motion, (n, size, size).

        Its values are the rotor's speed, the law's states, the slow filter, which all stations
        share, and the fast filters.
        """
        (n, dense, _), stations = self.law.shape, self.answers.shape[1]
        matrix = np.zeros((n, dense + 1 + stations, dense + 1 + stations))
        matrix[:, :dense, :dense] = self.law
        matrix[:, 0, :dense] *= -1.0 / self.inertia
        matrix[:, 0, 0] += self.frozen / self.inertia
        matrix[:, 0, dense + 1 :] = self.answers / self.inertia
        matrix[:, dense, 0] = (1.0 - AT_ONCE) / self.slow[:, 0]
        matrix[:, dense, dense] = -1.0 / self.slow[:, 0]
        fast, chain = np.arange(dense + 1, dense + 1 + stations), 1.0 / self.fast
        matrix[:, fast, 0], matrix[:, fast, dense] = AT_ONCE * chain, chain
        matrix[:, fast, fast] = -chain
        return matrix

    @property
    def growth(self) -> np.ndarray:
        """Largest real part of the loop's eigenvalues, 1/s, (n,); it is stable below 0."""
        return np.linalg.eigvals(self.matrix).real.max(axis=1)

    @property
    def rotor(self) -> np.ndarray:
        """Matrix of rotor and controller alone, in an unchanged wake, (n, 1 + n_states, …)."""
        dense = self.law.shape[1]
        return self.matrix[:, :dense, :dense]

    @property
    def frozen_growth(self) -> np.ndarray:
        """The same of rotor and controller alone, in an unchanged wake, 1/s."""
        return np.linalg.eigvals(self.rotor).real.max(axis=1)

    @property
    def time_constant(self) -> np.ndarray:
        """Time constant of the rotor's speed in an unchanged wake, s, the law's states held.

        From J dw/dt = Q(w, v) - u(w), linearized: J / (du/dw - dQ/dw), negative where the
        equilibrium is unstable.
        """
        return -1.0 / self.rotor[:, 0, 0]

    @property
    def least_inertia(self) -> np.ndarray:
        """Inertia above which the loop is stable, kg*m**2, (n,); infinite where no inertia is.

        On the limit of stability s = i w: the real part of G - U is zero there, and its imaginary
        part over w is the inertia. Above the largest of these inertias stability does not change.
        """
        w = np.geomspace(1e-3 / np.max(self.slow), 1e2 / np.min(self.fast), FREQUENCIES)
        s = 1j * w
        passed = AT_ONCE + (1.0 - AT_ONCE) / (1.0 + self.slow * s)
        chains = np.einsum("nj,njw->nw", self.answers, 1.0 / (1.0 + self.fast[..., None] * s))
        law, states = self.law[:, None], self.law.shape[1] - 1
        system = s[:, None, None] * np.eye(states) - law[..., 1:, 1:]
        answer = np.linalg.solve(system, law[..., 1:, :1] + 0j)[..., 0]
        # the generator torque over the speed, N*m*s/rad, (n, n_frequencies)
        controller = law[..., 0, 0] + np.sum(law[..., 0, 1:] * answer, axis=-1)
        open_loop = self.frozen[:, None] + passed * chains - controller
        real, imaginary = open_loop.real, open_loop.imag / w
        crossed = real[:, :-1] * real[:, 1:] <= 0.0
        share = real[:, :-1] / np.where(crossed, real[:, :-1] - real[:, 1:], 1.0)
        at = imaginary[:, :-1] + share * np.diff(imaginary, axis=1)
        least = np.max(np.where(crossed, at, 0.0), axis=1, initial=0.0)
        heavy = replace(self, inertia=HEAVY * max(self.inertia, float(np.max(least))))
        return np.where(heavy.growth < 0.0, least, np.inf)
