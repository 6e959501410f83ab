"""Independent integration of the rotor's equation of motion with direct BEM.

Nothing here is shared with the optimization but the physics: no torque curve, no collocation. A
stiff solver (LSODA) follows speed, captured and generated energy; it stops where the rotor does.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.reynolds import LocalReynolds

SLOWEST_RATIO = 0.05  # tip speed ratio at which a rotor counts as standing still


@dataclass(frozen=True, eq=False)
class Plant:
    """The rotor as it is built, in water: blade, section, inertia (kg*m**2) and density (kg/m**3).

    coefficients is the BEM solver, `rotor_coefficients` of `hkt_mdo.rotor.bem` or `ccblade`.
    """

    blade: Blade
    polar: Polar | tuple[Polar, ...] | LocalReynolds
    inertia: float
    density: float
    coefficients: Callable

    def torque(self, speed, inflow_speed):
        """Return the torque, N*m, at speeds (rad/s) and inflow speeds (m/s) of shape (n,)."""
        radius, polar = self.blade.rotor_radius, self.polar
        ratio = np.maximum(speed * radius / inflow_speed, SLOWEST_RATIO)
        if isinstance(polar, LocalReynolds):  # the flow of the instant, not the torque curve's
            polar = polar.at_speed(inflow_speed)
        coefficient = self.coefficients(self.blade, polar, ratio).torque
        return 0.5 * np.pi * radius**3 * self.density * inflow_speed**2 * coefficient


@dataclass(frozen=True, eq=False)
class Simulation:
    """An integrated trajectory, sampled at `time`.

    Arrays of shape (n,) in SI units; energies are integrals over the whole run. stopped_at is the
    time at which the rotor came to rest, None if it kept turning.
    """

    time: np.ndarray
    inflow_speed: np.ndarray
    rotor_speed: np.ndarray
    hydrodynamic_torque: np.ndarray
    control_torque: np.ndarray
    energy: float
    generator_energy: float
    kinetic_energy_change: float
    stopped_at: float | None
    speed_at: Callable


def simulate(
    plant: Plant,
    inflow: Inflow,
    controller: Callable,
    initial_speed: float,
    duration: float,
    samples: int = 601,
    max_step: float | None = None,
    tolerance: float = 1e-9,
) -> Simulation:
    """Integrate I dw/dt = Q(w, v(t)) - u(t, w) (paper eq. 6) and the two energies.

    Parameters
    ----------
    plant : Plant
    inflow : Inflow
    controller : callable
        u(time, speed), N*m, for scalars or arrays of one shape.
    initial_speed : float, rad/s
    duration : float, s
    samples : int
        Number of equally spaced points of the returned trajectory.
    max_step : float or None, s
        None: a hundredth of the duration, so that no gust is stepped over.
    tolerance : float
        Relative tolerance of the solver, and absolute in units of the initial speed and energy.

    Returns
    -------
    Simulation
    """
    radius = plant.blade.rotor_radius
    power_unit = 0.5 * np.pi * radius**2 * plant.density * float(inflow.speed_at(0.0)) ** 3
    energy_unit = power_unit * duration
    speed_unit = max(abs(initial_speed), 1e-3)

    def rates(time, state):
        speed = state[0] * speed_unit
        hydrodynamic = plant.torque(np.array([speed]), np.array([inflow.speed_at(time)]))[0]
        control = float(controller(time, speed))
        return [
            (hydrodynamic - control) / plant.inertia / speed_unit,
            hydrodynamic * speed / energy_unit,
            control * speed / energy_unit,
        ]

    def standstill(time, state):
        return state[0] * speed_unit * radius / inflow.speed_at(time) - SLOWEST_RATIO

    standstill.terminal, standstill.direction = True, -1.0
    found = solve_ivp(
        rates,
        (0.0, duration),
        [initial_speed / speed_unit, 0.0, 0.0],
        method="LSODA",
        events=standstill,
        dense_output=True,
        rtol=tolerance,
        atol=tolerance * 1e-2,
        max_step=max_step or duration / 100.0,
    )
    stopped = float(found.t[-1]) if found.status != 0 else None
    time = np.linspace(0.0, found.t[-1], samples)
    speed = found.sol(time)[0] * speed_unit
    flow = inflow.speed_at(time)
    return Simulation(
        time,
        flow,
        speed,
        plant.torque(speed, flow),
        np.asarray(controller(time, speed), dtype=float) * np.ones(samples),
        float(found.y[1, -1] * energy_unit),
        float(found.y[2, -1] * energy_unit),
        0.5 * plant.inertia * float((found.y[0, -1] * speed_unit) ** 2 - initial_speed**2),
        stopped,
        lambda at: found.sol(np.minimum(at, found.t[-1]))[0] * speed_unit,
    )


class RecordedTorque:
    """A torque history as its transcription means it: one polynomial through a segment's nodes.

    The generator cannot leave its range, so the interpolant is cut to [0, limit] between the nodes.

    Parameters
    ----------
    time, torque : array, shape (n_segments * nodes_per_segment,), s and N*m
        As in the time series of a phase: segment ends appear twice.
    segments : int
    limit : float or None, N*m
    """

    def __init__(self, time, torque, segments, limit=None):
        self.ends = np.append(np.reshape(time, (segments, -1))[:, 0], time[-1])
        nodes = np.reshape(time, (segments, -1))
        self._position = (nodes[0] - nodes[0, 0]) / (nodes[0, -1] - nodes[0, 0])
        self._values = np.reshape(torque, (segments, -1)).T
        self.limit = np.inf if limit is None else limit

    def __call__(self, time, speed=None):
        """Return the torque, N*m, at times (s) of any shape; the speed is not looked at."""
        return np.clip(self.unlimited(time), 0.0, self.limit)

    def unlimited(self, time):
        """Return the interpolated torque, N*m, before it is cut to the generator's range."""
        time = np.asarray(time, dtype=float)
        segment = np.clip(np.searchsorted(self.ends, time, side="right") - 1, 0, self.ends.size - 2)
        place = (time - self.ends[segment]) / (self.ends[segment + 1] - self.ends[segment])
        return np.sum(self._basis(place) * self._values[:, segment], axis=0)

    def _basis(self, place):
        """Return Lagrange's polynomials at places in 0 … 1, shape (n_nodes, *place.shape)."""
        nodes = self._position
        factors = []
        for i, node in enumerate(nodes):
            others = np.delete(nodes, i)
            factors.append(np.prod([(place - other) / (node - other) for other in others], axis=0))
        return np.array(factors)
