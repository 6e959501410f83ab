"""Independent integration of the rotor's equation of motion with direct BEM.

Nothing here is shared with the optimization but the physics: no torque curve, no mesh. Radau IIA
(five stages, order 9, L-stable; Hairer and Wanner, Solving Ordinary Differential Equations II,
section IV.8) solves the steps of a window together by Newton's method, so that BEM, flow and law
see arrays, and divides them until their estimated errors are within the tolerance.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Legendre
from scipy.interpolate import PPoly
from scipy.optimize import brentq

from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.generator import LOSSLESS, Generator
from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.errors import InputError
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.reynolds import LocalReynolds
from hkt_mdo.rotor.scales import power_scale, torque_scale

SLOWEST_RATIO = 0.05  # tip speed ratio at which a rotor counts as standing still
STAGES = 5
WINDOW, MOST_STEPS = 64, 5_000  # steps solved together, before and after they are divided
FAILURES = 100  # of Newton's method, and one more a step, at most: a window that fails is halved
PROBES = 16  # points at which the flow is looked at in a step, no longer than its shortest period
FLOW_ERROR = 1e-6  # of the flow between the nodes of a step, above which the step is divided
MOST_ITERATIONS = 12


def _radau():
    """Return the method's nodes (0 first), matrix and error weights."""
    legendre = Legendre.basis(STAGES) - Legendre.basis(STAGES - 1)
    nodes = 0.5 + 0.5 * np.sort(legendre.roots().real)
    orders = np.arange(1.0, STAGES + 1.0)
    powers = nodes[:, None] ** (orders - 1.0)
    matrix = (nodes[:, None] ** orders / orders) @ np.linalg.inv(powers)
    eigenvalues = np.linalg.eigvals(matrix)
    first = eigenvalues[np.argmin(np.abs(eigenvalues.imag))].real
    # less the embedded quadrature of order STAGES with the weight `first` at the step's start
    error = np.linalg.solve(powers.T, 1.0 / orders - first * (orders == 1.0)) - matrix[-1]
    return np.append(0.0, nodes), matrix, np.append(first, error)


_NODES, _MATRIX, _ERROR = _radau()
_STAGE_ERROR = _ERROR[1:] @ np.linalg.inv(_MATRIX)


def _through(edges, places, values):
    """Return the polynomials through values[piece, place] at places (0 to 1) of each piece."""
    powers = np.linalg.solve(np.vander(places), values.T)
    step = np.diff(edges)
    return PPoly(powers / step ** np.arange(places.size)[::-1, None], edges)


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
        self.unlimited = _through(self.ends, place, values)
        """The torque, N*m, before it is cut to the generator's range, as a function of time (s)."""
        self.unlimited_rate = self.unlimited.derivative()
        """Its rate, N*m/s."""
        self.limit = np.inf if limit is None else limit
        self.stiffness = stiffness
        if stiffness:
            self._held = _through(self.ends, place, np.reshape(speed, nodes.shape))
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

    def rate(self, time, _speed, acceleration):
        """Return the rate of the torque before it is cut, N*m/s; acceleration in rad/s**2."""
        rate = self.unlimited_rate(time)
        if self.stiffness:
            rate = rate + self.stiffness * (acceleration - self._held_rate(time))
        return rate


@dataclass(frozen=True, eq=False)
class FeedbackTorque:
    """The torque of a feedback law with its gains, in the law's units."""

    law: FeedbackLaw
    gains: np.ndarray

    def __call__(self, _time, speed):
        """Return the torque, N*m, at speeds, rad/s."""
        return self.law.torque(speed, self.gains)

    def rate(self, _time, speed, acceleration):
        """Return the rate of the torque, N*m/s, where the speed (rad/s) changes, rad/s**2."""
        return self.law.torque_by_speed(speed, self.gains) * acceleration


@dataclass(frozen=True, eq=False)
class Simulation:
    """An integrated trajectory, sampled at `time`, in SI units.

    Energies are integrals over the whole run. stopped_at is the time at which the rotor came to
    rest, None if it kept turning; speed_at gives its speed at any times of the run.
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


def simulate(
    plant: Plant,
    inflow: Inflow,
    controller: Callable,
    initial_speed: float,
    duration: float,
    samples: int | np.ndarray = 601,
    max_step: float | None = None,
    tolerance: float = 1e-9,
    begin: float = 0.0,
) -> Simulation:
    """Integrate I dw/dt = Q(w, v(t)) - u(t, w) (paper eq. 6) and the three energies.

    No step passes an end of the flow's `pieces`, and the flow is looked at sixteen times in each,
    so that no gust is stepped over. controller(time, speed) is the torque, N*m, for arrays of one
    shape; it is smooth between its `ends` (s), if it has such. Speeds are in rad/s, times in s.
    The run lasts for the duration from `begin` on. `samples` is a number of points that are
    returned, or their times from its begin to its end, which shrink if the rotor stops; `max_step`
    None is a hundredth of the duration; `tolerance` is the largest error of a step, relative to the
    speed and to the energy so far. Raises InputError if the integration fails, which is not the
    same as a rotor that stops.
    """
    motion = _Motion(plant, inflow, controller, begin, duration, tolerance)
    path, energies, stopped = motion.march(float(initial_speed), max_step or duration / 100.0)
    end = float(path.x[-1])
    if isinstance(samples, int):
        time = np.linspace(begin, end, samples)
    else:
        time = begin + (samples - begin) * (end - begin) / duration
    speed, flow = path(time), inflow.speed_at(time)
    return Simulation(
        time,
        flow,
        speed,
        plant.torque(speed, flow),
        np.asarray(controller(time, speed), dtype=float) * np.ones(time.size),
        *map(float, energies),
        0.5 * plant.inertia * float(path(end) ** 2 - initial_speed**2),
        end if stopped else None,
        lambda at: path(np.minimum(at, end)),
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

    def march(self, speed, longest):
        """Return the speed over time (`PPoly`), the energies, and whether the rotor stops."""
        edges, count, failures, stop = self._mesh(longest), WINDOW, 0, None
        paths, energies, most = [], np.zeros(3), FAILURES + edges.size
        while edges.size > 1 and stop is None:
            window = edges[: count + 1]
            found = self._solve(self._divided_by_flow(window), speed, energies[0])
            if found and (stop := self._standstill(found[0])) is not None:
                found = self._solve(stop, speed, energies[0])
            if found is None:
                failures, stop = failures + 1, None
                if failures > most or edges[1] - edges[0] < 1e-14 * self.duration:
                    problem = f"the independent integration fails at t = {edges[0]:.6g} s"
                    remedy = "see that the flow is positive there, and the control law finite and"
                    raise InputError(problem, f"{remedy} continuous")
                count = (window.size - 1) // 2
                if not count:
                    edges = np.insert(edges, 1, 0.5 * (edges[0] + edges[1]))
                    count = 1
                continue
            path, work = found
            paths.append(path)
            energies += work
            speed = float(path(path.x[-1]))
            edges, count = edges[window.size - 1 :], 2 * min(count, WINDOW // 2)
        ends = np.concatenate([*(each.x[:-1] for each in paths), paths[-1].x[-1:]])
        whole = PPoly(np.concatenate([each.c for each in paths], axis=1), ends)
        return whole, energies, stop is not None

    def _mesh(self, longest):
        """Return the longest steps: none passes an end of the controller's or flow's pieces."""
        begin, end, near = self.begin, self.begin + self.duration, 1e-9 * self.duration
        ends = np.union1d(getattr(self.controller, "ends", ()), self.inflow.pieces(end, begin))
        inside = ends[(ends > begin + near) & (ends < end - near)]
        inside = inside[np.diff(inside, prepend=begin) > near]
        ends = np.concatenate(([begin], inside, [end]))
        return divided(ends, np.maximum(np.ceil(np.diff(ends) / longest - 1e-6), 1).astype(int))

    def _divided_by_flow(self, edges):
        """Halve the steps in which the flow is no polynomial through the nodes."""
        for _ in range(20):
            step = np.diff(edges)[:, None]
            nodes = self.inflow.speed_at(edges[:-1, None] + step * _NODES)
            places = edges[:-1, None] + step * (np.arange(PROBES) + 0.5) / PROBES
            probes = self.inflow.speed_at(places)
            off = np.max(np.abs(_through(edges, _NODES, nodes)(places) - probes), axis=1)
            coarse = off > FLOW_ERROR * np.max(np.abs(probes), axis=1)
            if not np.any(coarse):
                break
            edges = divided(edges, 1 + coarse)
        return edges

    def _torques(self, time, speed, flow):
        """Return hydrodynamic and control torque, N*m, at arrays of one shape."""
        driving = self.plant.torque(speed.ravel(), flow.ravel()).reshape(speed.shape)
        return driving, self.controller(time, speed) * np.ones(speed.shape)

    def _solve(self, edges, speed, energy):
        """Return speed (`PPoly`) and energies over some steps, divided until they are accurate.

        energy, J, is what has been captured before. None if Newton's method does not converge.
        """
        flow = float(self.inflow.speed_at(self.begin))
        power = power_scale(self.plant.density, self.plant.blade.rotor_radius, flow)
        unit = energy + 0.01 * self.duration * power
        path = None
        while edges.size <= MOST_STEPS:
            step = np.diff(edges)[:, None]
            # a controller may jump at the end of a segment: stay before it
            time = edges[:-1, None] + step * np.minimum(_NODES, 1.0 - 1e-12)
            flow = self.inflow.speed_at(time)
            if not np.all(flow > 0.0):
                return None
            guess = speed * flow / flow[0, 0] if path is None else path(time)
            found = self._newton(speed, step, time[:, 1:], flow[:, 1:], guess[:, 1:])
            if found is None:
                return None
            stages, driving, control, slope = found
            start = np.append(speed, stages[:-1, -1])[:, None]
            first = self._torques(time[:, :1], start, flow[:, :1])
            path = _through(edges, _NODES, np.hstack((start, stages)))
            off = step * _ERROR[0] * (first[0] - first[1]) / self.plant.inertia
            off = off[:, 0] + (stages - start) @ _STAGE_ERROR
            off /= (1.0 - step * _ERROR[0] * slope)[:, 0]
            power = np.hstack((first[0] * start, driving * stages))
            share = np.abs(step[:, 0] * (power @ _ERROR)) / unit
            share = np.maximum(share, np.abs(off) / _size(stages[:, -1])) / self.tolerance
            if np.all(share <= 1.0):
                electrical = self.plant.generator.electrical_power(control, stages)
                powers = driving * stages, control * stages, electrical
                return path, np.array([np.sum(step * _MATRIX[-1] * each) for each in powers])
            parts = np.nan_to_num(np.ceil((2.0 * share) ** (1.0 / (STAGES + 1))), nan=8.0)
            edges = divided(edges, np.where(share <= 1.0, 1, np.clip(parts, 2, 8)).astype(int))
        return None

    def _newton(self, speed, step, time, flow, stages):
        """Return speeds at the stages, both torques and the slope of dw/dt there; None if lost."""
        change, inertia = np.inf, self.plant.inertia
        enough = max(0.01 * self.tolerance, 1e-12)
        for _ in range(MOST_ITERATIONS):
            size = _size(stages)
            driving, control = self._torques(time, stages, flow)
            if change > 1e-4:
                faster = self._torques(time, stages + 1e-6 * size, flow)
                slope = (faster[0] - faster[1] - driving + control) / (1e-6 * size * inertia)
                if not np.all(np.isfinite(slope)):
                    return None
                system = np.eye(STAGES) - step[:, :, None] * _MATRIX * slope[:, None, :]
                inverse = np.linalg.inv(system)
                gain = np.sum(inverse, axis=2)  # of the stages by the speed at the step's start
            start = np.append(speed, stages[:-1, -1])[:, None]
            miss = start + step * ((driving - control) / inertia @ _MATRIX.T) - stages
            own = np.einsum("nij,nj->ni", inverse, miss)
            carried = [0.0]  # change of the speed from step to step
            for shift, factor in zip(own[:, -1].tolist(), gain[:, -1].tolist(), strict=True):
                carried.append(shift + factor * carried[-1])
            correction = own + gain * np.array(carried[:-1])[:, None]
            stages = stages + correction
            change = np.max(np.abs(correction) / size)
            if change <= enough:
                return stages, driving, control, slope
            if not np.all(np.isfinite(stages)):
                return None
        return None

    def _standstill(self, path):
        """Return the steps up to where the rotor comes to rest; None if it does not."""

        def excess(time):
            ratio = path(time) * self.plant.blade.rotor_radius / self.inflow.speed_at(time)
            return ratio - SLOWEST_RATIO

        turning = excess(path.x) > 0.0
        crossed = np.flatnonzero(turning[:-1] & ~turning[1:])
        if not crossed.size:
            return None
        until = path.x[: crossed[0] + 1]
        return np.append(until, brentq(excess, until[-1], path.x[crossed[0] + 1], xtol=1e-15))


def _size(speed):
    """Return the magnitude, rad/s, to which errors of a speed are compared."""
    return np.maximum(np.abs(speed), 1e-3)


def divided(edges, parts):
    """Return the edges of pieces that are each divided into a number of equal parts."""
    number = np.arange(np.sum(parts)) - np.repeat(np.cumsum(parts) - parts, parts)
    left = np.repeat(edges[:-1], parts) + number * np.repeat(np.diff(edges) / parts, parts)
    return np.append(left, edges[-1])
