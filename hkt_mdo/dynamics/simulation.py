"""Independent integration of the rotor's equation of motion with direct BEM.

Nothing here is shared with the optimization but the physics: no torque curve, no collocation of its
own. A stiff method follows speed, captured and generated energy; it stops where the rotor does.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from hkt_mdo.dynamics import integrator
from hkt_mdo.dynamics.inflow import Inflow
from hkt_mdo.dynamics.integrator import SLOWEST_RATIO, Pieces
from hkt_mdo.errors import InputError
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.bem import LocalReynolds
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.scales import power_scale, torque_scale

TABLE_ERROR = 1e-11  # of flow and control torque as piecewise polynomials, over their largest value
STEPS_PER_PERIOD = 4  # at least, of the highest frequency that matters in the flow


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
        return torque_scale(self.density, radius, inflow_speed) * coefficient


@dataclass(frozen=True, eq=False)
class Feedback:
    """A feedback law with its gains as a controller: u(t, w) = law.torque(w, gains), N*m."""

    law: Any
    gains: np.ndarray

    def __call__(self, time, speed):
        """Return the torque, N*m, at speeds (rad/s) of any shape; the time does not matter."""
        return self.law.torque(speed, self.gains)


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
        nodes, values = (np.reshape(each, (segments, -1)) for each in (time, torque))
        place = 2.0 * (nodes[0] - nodes[0, 0]) / (nodes[0, -1] - nodes[0, 0]) - 1.0
        coefficients = np.linalg.solve(np.vander(place, increasing=True), values.T).T
        self.unlimited = Pieces(np.append(nodes[:, 0], time[-1]), np.ascontiguousarray(coefficients))
        """The torque, N*m, before it is cut to the generator's range, as a function of time (s)."""
        self.limit = np.inf if limit is None else limit

    def __call__(self, time, speed=None):
        """Return the torque, N*m, at times (s) of any shape; the speed does not matter."""
        return np.clip(self.unlimited(time), 0.0, self.limit)


@dataclass(frozen=True, eq=False)
class Simulation:
    """An integrated trajectory, sampled at `time`.

    Arrays of shape (n,) in SI units; energies are integrals over the whole run. stopped_at is the
    time at which the rotor came to rest, None if it kept turning; speed_at gives the rotor speed
    (rad/s) at any times (s) of the run.
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

    A `Feedback` or `RecordedTorque` on a plant of `bem.rotor_coefficients` is integrated by compiled
    code; any other controller or plant by SciPy's LSODA, some fifty times slower.

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
        None: a hundredth of the duration. Steps are also at most a quarter of the shortest period
        in the flow (its `cutoff`), so that no gust is stepped over.
    tolerance : float
        Relative tolerance of the solver, and absolute in units of the initial speed and energy.

    Raises
    ------
    InputError
        If the integration fails, which is not the same as a rotor that stops.
    """
    longest, cutoff = max_step or duration / 100.0, getattr(inflow, "cutoff", None)
    if cutoff:
        longest = min(longest, 1.0 / (STEPS_PER_PERIOD * cutoff))
    run = (plant, inflow, controller, float(initial_speed), duration, longest, tolerance)
    end, stopped, speed_at, energy, generated = _compiled(*run) or _general(*run)
    time = np.linspace(0.0, end, samples)
    speed, flow = speed_at(time), inflow.speed(time)
    return Simulation(
        time,
        flow,
        speed,
        plant.torque(speed, flow),
        np.asarray(controller(time, speed), dtype=float) * np.ones(samples),
        float(energy),
        float(generated),
        0.5 * plant.inertia * float(speed_at(end) ** 2 - initial_speed**2),
        float(end) if stopped else None,
        lambda at: speed_at(np.minimum(at, end)),
    )


def _failure(time):
    return InputError(
        f"the independent integration fails at t = {time:.6g} s",
        "see that flow and control law are finite and continuous there",
    )


def _energy_unit(plant, inflow, duration):
    return duration * power_scale(
        plant.density, plant.blade.rotor_radius, float(inflow.speed(0.0))
    )


def _compiled(plant, inflow, controller, speed, duration, longest, tolerance):
    """Integrate by compiled code; None if plant, flow or controller are not made for it."""
    feedback = isinstance(controller, Feedback)
    if plant.coefficients is not bem.rotor_coefficients or not (
        feedback or isinstance(controller, RecordedTorque)
    ):
        return None
    pieces = integrator.PIECES_A_STEP * max(int(np.ceil(duration / longest)), 1)
    edges = np.linspace(0.0, duration, pieces + 1)
    kinks = inflow.kinks(duration) if hasattr(inflow, "kinks") else edges[:0]
    flow = integrator.fit(inflow.speed, np.union1d(edges, kinks), TABLE_ERROR)
    if flow is None:
        return None
    stops, fastest = np.array([0.0, duration]), 2.0 * speed
    if not feedback:
        inside = controller.unlimited.edges
        stops = np.union1d(stops, inside[(inside > 0.0) & (inside < duration)])
    while True:
        limits, control = (-np.inf, np.inf), None
        if feedback:
            control = integrator.fit(
                lambda w: controller(0.0, w), np.linspace(0.0, fastest, 65), TABLE_ERROR
            )
            if control is None:
                return None
        else:
            limits, control = (0.0, float(controller.limit)), controller.unlimited
        rotor = integrator.rotor(
            plant.blade, plant.polar, plant.inertia, plant.density, flow, control, limits, feedback
        )
        end, times, curves, energies = integrator.integrate(
            speed, stops, longest, tolerance, _energy_unit(plant, inflow, duration), rotor
        )
        if end != integrator.TOO_FAST:
            break
        fastest *= 2.0  # once more, with a wider table of the law
    if end == integrator.FAILED:
        raise _failure(times[-1])
    return times[-1], end == integrator.STOPPED, Pieces(times, curves), *energies


def _general(plant, inflow, controller, initial_speed, duration, longest, tolerance):
    """Integrate any plant under any controller by LSODA."""
    energy_unit = _energy_unit(plant, inflow, duration)
    speed_unit = max(abs(initial_speed), 1e-3)

    def rates(time, state):
        speed = state[0] * speed_unit
        hydrodynamic = plant.torque(np.array([speed]), np.array([inflow.speed(time)]))[0]
        control = float(controller(time, speed))
        return [
            (hydrodynamic - control) / plant.inertia / speed_unit,
            hydrodynamic * speed / energy_unit,
            control * speed / energy_unit,
        ]

    def standstill(time, state):
        return state[0] * speed_unit * plant.blade.rotor_radius / inflow.speed(time) - SLOWEST_RATIO

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
        max_step=longest,
    )
    if found.status < 0:
        raise _failure(found.t[-1])
    energies = found.y[1:, -1] * energy_unit
    return found.t[-1], found.status == 1, lambda at: found.sol(at)[0] * speed_unit, *energies
