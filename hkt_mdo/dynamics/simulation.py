"""Independent integration of the rotor's equation of motion with direct BEM.

Nothing here is shared with the optimization but the physics: no torque curve, no mesh. The steps
of a window are solved together (`hkt_mdo.dynamics.radau`), so that BEM, flow and law see arrays,
and divided until their estimated errors are within the tolerance.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PPoly
from scipy.optimize import brentq

from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.formulas import STEP
from hkt_mdo.dynamics.generator import LOSSLESS, Generator
from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.dynamics.radau import (
    ERROR,
    MATRIX,
    NODES,
    STAGES,
    divided,
    magnitudes,
    solve_stages,
    step_errors,
    through,
)
from hkt_mdo.errors import InputError
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.reynolds import LocalReynolds
from hkt_mdo.rotor.scales import power_scale, torque_scale

SLOWEST_RATIO = 0.05  # tip speed ratio at which a rotor counts as standing still
WINDOW, MOST_STEPS = 64, 5_000  # steps solved together, before and after they are divided
FAILURES = 100  # of Newton's method, and one more a step, at most: a window that fails is halved
PROBES = 16  # points at which the flow is looked at in a step, no longer than its shortest period
FLOW_ERROR = 1e-6  # of the flow between the nodes of a step, above which the step is divided


@dataclass(frozen=True, eq=False)
class Plant:
    """The rotor as it is built, in water: blade, section, inertia (kg*m**2) and density (kg/m**3).

    coefficients is the BEM solver, `rotor_coefficients` of `hkt_mdo.rotor.bem` or `ccblade`;
    generator is what is on the shaft.
    """

    blade: Blade
    polar: Polar | tuple[Polar, ...] | LocalReynolds
    inertia: float
    density: float
    coefficients: Callable
    generator: Generator = LOSSLESS

    def torque(self, speed, inflow_speed):
        """Return the torque, N*m, at speeds (rad/s) and inflow speeds (m/s) of shape (n,)."""
        radius, polar = self.blade.rotor_radius, self.polar
        ratio = np.maximum(speed * radius / inflow_speed, SLOWEST_RATIO)
        if isinstance(polar, LocalReynolds):  # the flow of the instant, not the torque curve's
            polar = polar.at_speed(inflow_speed)
        coefficient = self.coefficients(self.blade, polar, ratio).torque
        return torque_scale(self.density, radius, inflow_speed) * coefficient


class RecordedTorque:
    """A torque history as its transcription means it: one polynomial through a segment's nodes.

    The generator cannot leave its range, so the interpolant is cut to [0, limit] between the nodes.
    time (s) and torque (N*m) are those of a phase's time series: segment ends appear twice.

    A rotor below the speed of its largest torque is unstable under a torque that does not depend
    on its speed. speed (rad/s) is then the speed history to hold, and stiffness (N*m*s/rad) that of
    the controller which does so, by the torque stiffness (w - speed) on top.
    """

    def __init__(self, time, torque, limit=None, speed=None, stiffness=0.0):
        repeats = np.flatnonzero(np.diff(time) <= 1e-12 * time[-1])
        count = repeats[0] + 1 if repeats.size else time.size  # of a segment's nodes
        nodes, values = (np.reshape(each, (-1, count)) for each in (time, torque))
        place = (nodes[0] - nodes[0, 0]) / (nodes[0, -1] - nodes[0, 0])
        self.ends = np.append(nodes[:, 0], time[-1])
        self.unlimited = through(self.ends, place, values)
        """The torque, N*m, before it is cut to the generator's range, as a function of time (s)."""
        self.unlimited_rate = self.unlimited.derivative()
        """Its rate, N*m/s."""
        self.limit = np.inf if limit is None else limit
        self.stiffness = stiffness
        if stiffness:
            self._held = through(self.ends, place, np.reshape(speed, nodes.shape))
            self._held_rate = self._held.derivative()

    @classmethod
    def of(cls, plant, nodes, limit=None):
        """Return the history of an open loop with the stiffness that a rotor needs, if any.

        nodes has the quantities of its trajectory. The stiffness is twice the largest slope of the
        hydrodynamic torque over the rotor's speed, where that is positive.
        """
        speed, flow = nodes["rotor_speed"], nodes["inflow_speed"]
        faster, slower = (plant.torque(factor * speed, flow) for factor in (1.001, 0.999))
        slope = float(np.max((faster - slower) / (0.002 * speed)))
        return cls(nodes["time"], nodes["control_torque"], limit, speed, 2.0 * max(slope, 0.0))

    def __call__(self, time, speed=None):
        """Return the torque, N*m, at times (s) and speeds (rad/s) of one shape."""
        torque = np.clip(self.unlimited(time), 0.0, self.limit)
        if self.stiffness:
            torque = torque + self.stiffness * (speed - self._held(time))
        return torque

    def rate(self, time, _speed, acceleration, *_):
        """Return the rate of the torque before it is cut, N*m/s; acceleration in rad/s**2."""
        rate = self.unlimited_rate(time)
        if self.stiffness:
            rate = rate + self.stiffness * (acceleration - self._held_rate(time))
        return rate


@dataclass(frozen=True, eq=False)
class FeedbackTorque:
    """The torque of a feedback law with its gains, in the law's units.

    estimate tells the law the flow's speed from the rotor's speed, the torque and the acceleration
    (`FlowEstimate`); None: the law hears the speed that the flow has.
    """

    law: FeedbackLaw
    gains: np.ndarray
    estimate: Callable | None = None

    def __call__(self, _time, speed, *states):
        """Return the torque, N*m, at speeds, rad/s, and values of the law's states."""
        return self.law.torque(speed, self.gains, *states)

    def rates(self, speed, flow, acceleration, *states):
        """Return the rates of the law's states; flow in m/s, acceleration in rad/s**2."""
        if self.estimate is not None:
            torque = self.law.torque(speed, self.gains, *states)
            flow = self.estimate(speed, torque, acceleration)
        return self.law.rates(speed, flow, self.gains, *states)

    def rate(self, time, speed, acceleration, flow=None, *states):
        """Return the rate of the torque, N*m/s, where the speed (rad/s) changes, rad/s**2."""
        rates = self.rates(speed, flow, acceleration, *states)
        moved = (x + 1j * STEP * rate for x, rate in zip(states, rates, strict=True))
        return np.imag(self(time, speed + 1j * STEP * acceleration, *moved)) / STEP

    def linearized(self, plant, speed, flow, *states):
        """Return the matrix of the motion linearized at points of shape (n,), [n, rate, value].

        Rates and values are those of the rotor's speed, then of the law's states, while the flow
        (m/s) keeps its speed; the slope of the flow's torque is by differences of direct BEM.
        """
        step = 1e-5 * speed
        faster, slower = (plant.torque(speed + move, flow) for move in (step, -step))
        slopes = self.law.slopes(speed, flow, self.gains, *states)
        slopes[0] *= -1.0 / plant.inertia
        slopes[0, 0] += (faster - slower) / (2.0 * step * plant.inertia)
        return np.moveaxis(slopes, -1, 0)


@dataclass(frozen=True, eq=False)
class Simulation:
    """An integrated trajectory, sampled at `time`, in SI units.

    Energies are integrals over the whole run. stopped_at is the time at which the rotor came to
    rest, None if it kept turning; speed_at gives its speed at any times of the run. states has a
    row for each state of the control law.
    """

    time: np.ndarray
    inflow_speed: np.ndarray
    rotor_speed: np.ndarray
    hydrodynamic_torque: np.ndarray
    control_torque: np.ndarray
    energy: float
    generator_energy: float
    electrical_energy: float
    kinetic_energy_change: float
    stopped_at: float | None
    speed_at: Callable
    states: np.ndarray


class IntegrationError(InputError):
    """The equation of motion has no solution beyond a time, s."""

    def __init__(self, time: float) -> None:
        problem = f"the independent integration fails at t = {time:.6g} s"
        remedy = "see that the flow is positive there, and the control law finite and continuous"
        super().__init__(problem, remedy)
        self.time = time

    def __reduce__(self):  # from another process
        return type(self), (self.time,)


class Start(NamedTuple):
    """Where a simulation begins.

    Attributes
    ----------
    speed
        Rotor speed, rad/s.
    states
        Values of the controller's states, (n_states,).
    time
        Time, s.
    """

    speed: float
    states: Sequence[float] = ()
    time: float = 0.0


def simulate(
    plant: Plant,
    inflow: Inflow,
    controller: Callable,
    start: float | Start,
    duration: float,
    samples: int | np.ndarray = 601,
    max_step: float | None = None,
    tolerance: float = 1e-9,
) -> Simulation:
    """Integrate I dw/dt = Q(w, v(t)) - u(t, w) (paper eq. 6) and the three energies.

    No step passes an end of the flow's `pieces`, and the flow is looked at sixteen times in each,
    so that no gust is stepped over.

    Parameters
    ----------
    plant : Plant
        The rotor in water.
    inflow : Inflow
        The flow.
    controller : callable
        controller(time, speed) is the torque, N*m, for arrays of one shape; it is smooth between
        its `ends` (s), if it has such. A controller with states takes their values too, and has
        their `rates`, like `FeedbackTorque`; they are integrated with the speed.
    start : Start or float
        Where the run begins; a number is the rotor's speed at t = 0, rad/s.
    duration : float
        How long it lasts, s.
    samples : int or array, shape (n_times,)
        Number of points that are returned, or their times (s) from the run's begin to its end,
        which shrink if the rotor stops.
    max_step : float or None
        Longest step, s; None: a hundredth of the duration.
    tolerance : float
        Largest error of a step, relative to the speed, to a state and to the energy so far.

    Returns
    -------
    Simulation
        The trajectory and its energies.

    Raises
    ------
    IntegrationError
        If the integration fails, which is not the same as a rotor that stops.
    """
    start = start if isinstance(start, Start) else Start(start)
    motion, begin = _Motion(plant, inflow, controller, start.time, duration, tolerance), start.time
    values = np.array([start.speed, *start.states], dtype=float)
    path, energies, stopped = motion.march(values, max_step or duration / 100.0)
    end = float(path.x[-1])
    if isinstance(samples, int):
        time = np.linspace(begin, end, samples)
    else:
        time = begin + (samples - begin) * (end - begin) / duration
    (speed, *states), flow = path(time).T, inflow.speed_at(time)
    return Simulation(
        time,
        flow,
        speed,
        plant.torque(speed, flow),
        np.asarray(controller(time, speed, *states), dtype=float) * np.ones(time.size),
        *map(float, energies),
        0.5 * plant.inertia * float(path(end)[0] ** 2 - start.speed**2),
        end if stopped else None,
        lambda at: path(np.minimum(at, end))[..., 0],
        np.array(states),
    )


@dataclass(frozen=True, eq=False)
class _Motion:
    """The equation of motion of one run, and its integration."""

    plant: Plant
    inflow: Inflow
    controller: Callable
    begin: float
    duration: float
    tolerance: float

    def march(self, start, longest):
        """Return the motion over time (`PPoly`), the energies, and whether the rotor stops.

        The motion is the speed and, where the controller has states, their values: (n_values,).
        """
        edges, count, failures, stop = self._mesh(longest), WINDOW, 0, None
        paths, energies, most = [], np.zeros(3), FAILURES + edges.size
        while edges.size > 1 and stop is None:
            window = edges[: count + 1]
            found = self._solve(self._divided_by_flow(window), start, energies[0])
            if found and (stop := self._standstill(found[0])) is not None:
                found = self._solve(stop, start, energies[0])
            if not found:
                failures, stop = failures + 1, None
                count = (window.size - 1) // 2
                endless = found is False and not count
                if endless or failures > most or edges[1] - edges[0] < 1e-14 * self.duration:
                    raise IntegrationError(float(edges[0]))
                if not count:
                    edges = np.insert(edges, 1, 0.5 * (edges[0] + edges[1]))
                    count = 1
                continue
            path, work = found
            paths.append(path)
            energies += work
            start = path(path.x[-1])
            edges, count = edges[window.size - 1 :], 2 * min(count, WINDOW // 2)
        ends = np.concatenate([*(each.x[:-1] for each in paths), paths[-1].x[-1:]])
        whole = PPoly(np.concatenate([each.c for each in paths], axis=1), ends)
        return whole, energies, stop is not None

    def _mesh(self, longest):
        """Return the longest steps: none passes an end of the controller's or flow's pieces."""
        begin, end = self.begin, self.begin + self.duration
        near = 1e-12 * end  # what rounding may part
        ends = np.union1d(getattr(self.controller, "ends", ()), self.inflow.pieces(end, begin))
        inside = ends[(ends > begin + near) & (ends < end - near)]
        inside = inside[np.diff(inside, prepend=begin) > near]
        ends = np.concatenate(([begin], inside, [end]))
        return divided(ends, np.maximum(np.ceil(np.diff(ends) / longest - 1e-6), 1).astype(int))

    def _divided_by_flow(self, edges):
        """Halve the steps in which the flow is no polynomial through the nodes."""
        for _ in range(20):
            step = np.diff(edges)[:, None]
            nodes = self.inflow.speed_at(edges[:-1, None] + step * NODES)
            places = edges[:-1, None] + step * (np.arange(PROBES) + 0.5) / PROBES
            probes = self.inflow.speed_at(places)
            off = np.max(np.abs(through(edges, NODES, nodes)(places) - probes), axis=1)
            coarse = off > FLOW_ERROR * np.max(np.abs(probes), axis=1)
            if not np.any(coarse):
                break
            edges = divided(edges, 1 + coarse)
        return edges

    def _torques(self, time, values, flow):
        """Return hydrodynamic and control torque, N*m, at arrays of one shape."""
        speed, *states = np.moveaxis(values, -1, 0)
        driving = self.plant.torque(speed.ravel(), flow.ravel()).reshape(speed.shape)
        return driving, self.controller(time, speed, *states) * np.ones(speed.shape)

    def _rates(self, values, flow, driving, control):
        """Return the rates of the speed and the controller's states, of the shape of values."""
        speed, *states = np.moveaxis(values, -1, 0)
        acceleration = (driving - control) / self.plant.inertia
        rates = self.controller.rates(speed, flow, acceleration, *states) if states else ()
        return np.stack((acceleration, *rates), axis=-1)

    def _slope(self, time, values, flow, driving, rates):
        """Return the derivatives of the rates by the values, [..., rate, value], by differences."""
        size, found = magnitudes(values), np.empty((*values.shape, values.shape[-1]))
        for i in range(values.shape[-1]):
            step = 1e-6 * size[..., i]
            moved = values.copy()
            moved[..., i] += step
            if i:  # a state of the controller: the flow's torque is the same
                speed, *states = np.moveaxis(moved, -1, 0)
                torques = driving, self.controller(time, speed, *states) * np.ones(speed.shape)
            else:
                torques = self._torques(time, moved, flow)
            found[..., i] = (self._rates(moved, flow, *torques) - rates) / step[..., None]
        return found

    def _solve(self, edges, start, energy):
        """Return motion (`PPoly`) and energies over some steps, divided until they are accurate.

        energy, J, is what has been captured before. None if Newton's method does not converge,
        False if no number of steps up to `MOST_STEPS` is enough.
        """
        flow = float(self.inflow.speed_at(self.begin))
        power = power_scale(self.plant.density, self.plant.blade.rotor_radius, flow)
        unit = energy + 0.01 * self.duration * power
        path = None
        while edges.size <= MOST_STEPS:
            step = np.diff(edges)[:, None]
            # a controller may jump at the end of a segment: stay before it
            time = edges[:-1, None] + step * np.minimum(NODES, 1.0 - 1e-12)
            flow = self.inflow.speed_at(time)
            if not np.all(flow > 0.0):
                return None
            if path is None:
                guess = np.repeat(start, time.size).reshape(-1, *time.shape)
                guess[0] *= flow / flow[0, 0]
                guess = np.moveaxis(guess, 0, -1)
            else:
                guess = path(time)
            found = self._stages(start, step, time[:, 1:], flow[:, 1:], guess[:, 1:])
            if found is None:
                return None
            stages, slope, driving, control = found
            begin = np.concatenate((start[None], stages[:-1, -1]))[:, None]
            first = self._torques(time[:, :1], begin, flow[:, :1])
            path = through(edges, NODES, np.concatenate((begin, stages), axis=1))
            rates = self._rates(begin, flow[:, :1], *first)[:, 0]
            errors = step_errors(step, begin, stages, rates, slope)
            speed = np.concatenate((begin, stages), axis=1)[..., 0]
            power = np.hstack((first[0], driving)) * speed
            share = np.abs(step[:, 0] * (power @ ERROR)) / unit
            share = np.maximum(share, errors) / self.tolerance
            if np.all(share <= 1.0):
                turning = stages[..., 0]
                electrical = self.plant.generator.electrical_power(control, turning)
                powers = driving * turning, control * turning, electrical
                return path, np.array([np.sum(step * MATRIX[-1] * each) for each in powers])
            parts = np.nan_to_num(np.ceil((2.0 * share) ** (1.0 / (STAGES + 1))), nan=8.0)
            edges = divided(edges, np.where(share <= 1.0, 1, np.clip(parts, 2, 8)).astype(int))
        return False

    def _stages(self, start, step, time, flow, guess):
        """Return values at the stages, the slope of the rates, and both torques; None if lost."""
        torques: list = []

        def rates_at(stages):
            torques[:] = self._torques(time, stages, flow)
            return self._rates(stages, flow, *torques)

        def slope_at(stages, rates):
            return self._slope(time, stages, flow, torques[0], rates)

        enough = max(0.01 * self.tolerance, 1e-12)
        found = solve_stages(rates_at, slope_at, start, step, guess, enough)
        return found and (*found, *torques)

    def _standstill(self, path):
        """Return the steps up to where the rotor comes to rest; None if it does not."""

        def excess(time):
            ratio = path(time)[..., 0] * self.plant.blade.rotor_radius / self.inflow.speed_at(time)
            return ratio - SLOWEST_RATIO

        turning = excess(path.x) > 0.0
        crossed = np.flatnonzero(turning[:-1] & ~turning[1:])
        if not crossed.size:
            return None
        until = path.x[: crossed[0] + 1]
        return np.append(until, brentq(excess, until[-1], path.x[crossed[0] + 1], xtol=1e-15))
