"""Independent integration of the rotor's equation of motion with direct BEM.

It shares only the physics with the optimization, neither the torque curve nor the mesh. The steps
of a window of time are solved together (`hkt_mdo.dynamics.radau`), so that BEM, flow and law
compute on arrays, and are divided until their estimated errors are within the tolerance.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, PPoly
from scipy.optimize import brentq

from hkt_mdo.dynamics import radau
from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.formulas import STEP
from hkt_mdo.dynamics.generator import LOSSLESS, Generator
from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.dynamics.wake import SLOWEST_RATIO, MeanWake, Wake
from hkt_mdo.errors import InputError
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.polars import Polars
from hkt_mdo.rotor.scales import power_scale, torque_scale

WINDOW, MOST_STEPS = 64, 5_000  # steps solved together, before and after they are divided
FAILURES = 100, 4  # of Newton's method at most, and for each step that is solved
AWAY = 1.5  # tip speed ratio over the first one, above which a rotor has run away
MOST_ITERATIONS = 12  # of Newton's method
PATIENCE = 4  # of them with a wake, after which values that still change by more than FAR are lost
SAME_SLOPE = 1e-4  # relative change of the values below which the slopes are kept
FAR = 0.01  # relative change of the values above which the iteration diverges
LOST = 1e4  # times the speed of the guess: no rotor turns so much faster, the iteration diverges
PROBES = 16  # points at which the flow is looked at in a step, no longer than its shortest period
FLOW_ERROR = 1e-6  # of the flow between the nodes of a step, above which the step is divided


def by_curve(curve):
    """Return a solver for a `Plant` whose torque coefficient is a curve over tip speed ratios."""
    return lambda _blade, _polar, ratio, *_: SimpleNamespace(torque=curve(ratio))


@dataclass(frozen=True, eq=False)
class Plant:
    """The rotor as it is built, in water: blade, section, inertia (kg*m**2) and density (kg/m**3).

    coefficients is the BEM solver, `rotor_coefficients` of `hkt_mdo.rotor.bem` or `ccblade`;
    generator is that on the shaft; wake has the filters of a wake with memory, None: the wake is in
    equilibrium at every instant. A wake with memory is always computed by `hkt_mdo.rotor.bem`.
    """

    blade: Blade
    polar: Polars
    inertia: float
    density: float
    coefficients: Callable
    generator: Generator = LOSSLESS
    wake: Wake | None = None

    def with_memory(self, tau1=None):
        """Return the same rotor with a `Wake`; tau1 in s, None: by the induction."""
        return replace(self, wake=Wake(self.blade, self.polar, tau1))

    def with_mean_wake(self, band):
        """Return the same rotor with the two filters of an optimization with its `Band`."""
        return replace(self, wake=MeanWake(self.blade, self.polar, self.wake.tau1, band))

    def coefficient(self, ratio):
        """Return the torque coefficient; InputError where it depends on the Reynolds number too."""
        if self.polar.follows_reynolds:
            problem = "leaves no torque curve over the tip speed ratio alone, which an estimate of "
            problem += "the flow and runs with sensor noise need"
            remedy = "give invariant, control.flow: sensed, or no --noise-snr"
            raise InputError(problem, remedy, key="rotor.reynolds", value="local")
        return self.coefficients(self.blade, self.polar, ratio).torque

    def tabulated(self, ratios):
        """Return the same rotor with the torque coefficient as a spline over tip speed ratios.

        Without dynamic inflow, and of sections that do not depend on the Reynolds number. A long
        integration evaluates the spline a hundred times faster than BEM.
        """
        curve = CubicSpline(ratios, self.coefficient(ratios))
        solver = by_curve(lambda ratio: curve(np.minimum(ratio, ratios[-1])))
        return replace(self, coefficients=solver)

    def torque(self, speed, inflow_speed, filters=None):
        """Return the torque, N*m, at speeds (rad/s) and inflow speeds (m/s) of shape (n,).

        The wake is in equilibrium, or has the state filters[n, n_filters]. A rotor that is slower
        than `SLOWEST_RATIO` has the torque at that tip speed ratio.
        """
        if filters is not None:
            return np.sum(self.station_torques(speed, inflow_speed, filters), axis=1)
        radius = self.blade.rotor_radius
        ratio = np.maximum(speed * radius / inflow_speed, SLOWEST_RATIO)
        # of the flow at this instant, not the torque curve's
        polar = self.polar.in_flow(inflow_speed)
        coefficient = self.coefficients(self.blade, polar, ratio).torque
        return torque_scale(self.density, radius, inflow_speed) * coefficient

    def generator_torque(self, speed, inflow_speed):
        """Return the generator torque that holds the rotor in equilibrium, N*m, of shape (n,).

        That of the flow less the friction of the shaft; the arguments are those of `torque`.
        """
        return self.torque(speed, inflow_speed) - self.generator.friction(speed)

    def powers(self, speed, driving, control):
        """Return the powers of flow, shaft, generator and friction, W.

        Of the rotor at speeds (rad/s) under the torques of the flow and the generator (N*m).
        """
        electrical = self.generator.electrical_power(control, speed)
        return driving * speed, control * speed, electrical, self.generator.friction(speed) * speed

    @property
    def starting_flow(self):
        """Speed of the flow from which the standing rotor starts against the friction, m/s.

        Without a generator torque; infinite where the flow does not drive the standing rotor.
        """
        friction, one = self.generator.friction(0.0), np.ones(1)
        driving = float(self.torque(0.0 * one, one)[0])  # of a flow of 1 m/s
        if not friction:
            return 0.0
        return float(np.sqrt(friction / driving)) if driving > 0.0 else np.inf

    def station_torques(self, speed, inflow_speed, filters):
        """Return the torque of all blades at each station, N*m, (n, n_stations).

        filters[n, n_filters] is the state of the wake, which need not be in equilibrium.
        """
        scale = torque_scale(self.density, self.blade.rotor_radius, inflow_speed)
        load = self.wake.sections(speed, inflow_speed, filters).tangential_load
        return scale[:, None] * bem.torque_weights(self.blade) * load

    def torque_by_wake(self, speed, inflow_speed, filters):
        """Return the derivatives of stations' torques by the velocity induced there, N*s.

        By the axial velocities and then by the tangential ones, (n, n_velocities); of a `MeanWake`
        that of all stations by the mean one. The arguments are those of `station_torques`.
        """
        step, places = 1e-4 * inflow_speed[:, None], np.arange(filters.shape[1])
        slopes, count = [], np.size(self.wake.share)
        for columns in places[places.size // 2 :].reshape(-1, count):
            moved = []
            for move in (step, -step):
                state = filters.copy()
                state[:, columns] += move
                moved.append(self.station_torques(speed, inflow_speed, state))
            change = np.subtract(*moved).reshape(step.size, count, -1).sum(axis=2)
            slopes.append(change / (2.0 * step))
        return np.concatenate(slopes, axis=1)

    def torque_slope(self, speed, inflow_speed):
        """Return the torque's derivative by the speed, N*m*s/rad, of shape (n,).

        If the wake has memory, the induced velocities are held constant.
        """
        held = None if self.wake is None else self.wake.at_rest(speed, inflow_speed)
        faster, slower = (self.torque(x * speed, inflow_speed, held) for x in (1.00001, 0.99999))
        return (faster - slower) / (2e-5 * speed)


class RecordedTorque:
    """A torque history as collocation has it: one polynomial through a segment's nodes.

    The generator cannot leave its range, so the interpolant is cut to [0, limit] between the nodes.
    time (s) and torque (N*m) are those of a phase's time series: segment ends appear twice.

    A rotor below the speed of its largest torque is unstable under a torque that does not depend
    on its speed. speed (rad/s) is then the speed history to hold, and stiffness (N*m*s/rad) that of
    the controller which does so, by the torque stiffness (w - speed) on top.
    """

    def __init__(self, time, torque, limit=None, speed=None, stiffness=0.0):
        repeats = np.flatnonzero(np.diff(time) <= 1e-12 * time[-1])
        count = repeats[0] + 1 if repeats.size else time.size  # of a segment's nodes
        speed = np.zeros(time.size) if speed is None else speed
        nodes, *values = (np.reshape(series, (-1, count)) for series in (time, torque, speed))
        positions = (nodes[0] - nodes[0, 0]) / (nodes[0, -1] - nodes[0, 0])
        self.ends = np.append(nodes[:, 0], time[-1])
        self.unlimited, self._held = (radau.through(self.ends, positions, x) for x in values)
        """The torque, N*m, before it is cut to the generator's range, as a function of time (s)."""
        self.unlimited_rate, self._held_rate = self.unlimited.derivative(), self._held.derivative()
        """Its rate, N*m/s."""
        self.limit = np.inf if limit is None else limit
        self.stiffness = stiffness

    @classmethod
    def of(cls, plant, nodes, limit=None):
        """Return the history of an open loop with the stiffness that a rotor needs, if any.

        nodes has the quantities of its trajectory. The stiffness is twice the largest slope of the
        hydrodynamic torque over the rotor's speed, where that is positive.
        """
        speed = nodes["rotor_speed"]
        slope = float(np.max(plant.torque_slope(speed, nodes["inflow_speed"])))
        return cls(nodes["time"], nodes["control_torque"], limit, speed, 2.0 * max(slope, 0.0))

    def __call__(self, time, speed=0.0):
        """Return the torque, N*m, at times (s) and speeds (rad/s) of one shape."""
        torque = np.clip(self.unlimited(time), 0.0, self.limit)
        return torque + self.stiffness * (speed - self._held(time))

    def rate(self, time, _speed, acceleration, *_):
        """Return the rate of the torque before it is cut, N*m/s; acceleration in rad/s**2."""
        return self.unlimited_rate(time) + self.stiffness * (acceleration - self._held_rate(time))


@dataclass(frozen=True, eq=False)
class FeedbackTorque:
    """The torque of a feedback law with its gains, in the law's units.

    estimate gives the law the flow speed from the rotor's speed, the torque and the acceleration
    (`FlowEstimate`); None: the law gets the actual flow speed.
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
            flow = self.estimate(speed, self.law.torque(speed, self.gains, *states), acceleration)
        return self.law.rates(speed, flow, self.gains, *states)

    def rate(self, time, speed, acceleration, flow=None, *states):
        """Return the rate of the torque, N*m/s, where the speed (rad/s) changes, rad/s**2."""
        rates = self.rates(speed, flow, acceleration, *states)
        moved = (x + 1j * STEP * rate for x, rate in zip(states, rates, strict=True))
        return np.imag(self(time, speed + 1j * STEP * acceleration, *moved)) / STEP


@dataclass(frozen=True, eq=False)
class Simulation:
    """An integrated trajectory; its energies are integrals over the whole run.

    Attributes
    ----------
    time : ndarray, shape (n_times,)
        Times at which it is sampled, s.
    inflow_speed, rotor_speed : ndarray, shape (n_times,)
        Speeds there, m/s and rad/s.
    hydrodynamic_torque, control_torque : ndarray, shape (n_times,)
        Torque of the flow and of the generator, N*m.
    energy, generator_energy, electrical_energy : float
        Energy that the rotor captures, the generator takes from the shaft and delivers, J.
    friction_energy, kinetic_energy_change : float
        Energy that friction takes, and by which that of the rotor grows, J.
    stopped_at : float or None
        Time at which the rotor came to rest, s; None: it kept turning.
    speed_at : callable
        Gives the rotor's speed, rad/s, at any times of the run.
    states : ndarray, shape (n_states, n_times)
        The states of the control law.
    filters : ndarray, shape (n_times, n_filters)
        The state of the wake's filters, with no columns where the wake has no memory.
    path : PPoly or None
        Speed, states and filters over time, s, by its steps; None if the rotor stops.
    """

    time: np.ndarray
    inflow_speed: np.ndarray
    rotor_speed: np.ndarray
    hydrodynamic_torque: np.ndarray
    control_torque: np.ndarray
    energy: float
    generator_energy: float
    electrical_energy: float
    friction_energy: float
    kinetic_energy_change: float
    stopped_at: float | None
    speed_at: Callable
    states: np.ndarray
    filters: np.ndarray
    path: PPoly | None = None


class IntegrationError(InputError):
    """The equation of motion has no solution beyond a time, s.

    `fastest` is when and how fast (rad/s) a rotor turned that ran away before; None: it did not.
    """

    def __init__(self, time: float, fastest: tuple[float, float] | None = None) -> None:
        problem = f"the independent integration fails at t = {time:.6g} s"
        remedy = "check that the flow is positive there, and the control law finite and continuous"
        if fastest is not None:
            when, speed = fastest
            problem = f"the rotor runs away, to {speed:.4g} rad/s at t = {when:.6g} s; {problem}"
            remedy = "try a larger rotor.hub_inertia, or another control.law"
        super().__init__(problem, remedy)
        self.time, self.fastest = time, fastest

    def __reduce__(self):  # from another process
        return type(self), (self.time, self.fastest)


def simulate(
    plant: Plant,
    inflow: Inflow,
    controller: Callable,
    start: npt.ArrayLike,
    time: np.ndarray,
    max_step: float | None = None,
    tolerance: float = 1e-9,
    guess: PPoly | None = None,
) -> Simulation:
    """Integrate J dw/dt = Q(w, v(t)) - u(t, w) - F(w) (paper eq. 6) and the energies.

    F is the friction of the shaft, if any.

    No step extends over an end of the flow's `pieces`, and the flow is sampled sixteen times in
    each, so that no gust is missed.

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
    start : array_like, shape (1 + n_states,)
        The rotor's speed at the begin, rad/s, and values of the controller's states; or the speed
        alone.
    time : array, shape (n_times,)
        Times that are returned, s, from the run's begin to its end, which shrink if the rotor
        stops.
    max_step : float or None
        Longest step, s; None: a hundredth of the duration.
    tolerance : float
        Largest error of a step, relative to the speed, to a state and to the energy so far.
    guess : PPoly or None
        The `path` of nearly the same motion, whose steps and values are tried first; None: those of
        a rotor that follows the flow.

    Returns
    -------
    Simulation
        The trajectory and its energies.

    Raises
    ------
    IntegrationError
        If the integration fails, which is not the same as a rotor that stops.
    """
    begin, duration = float(time[0]), float(np.ptp(time))
    start = first = np.atleast_1d(np.asarray(start, dtype=float))
    dense = start.size
    if plant.wake is not None:  # it begins in equilibrium
        rest = plant.wake.at_rest(start[:1], np.atleast_1d(inflow.speed_at(begin)))
        first = np.append(start, rest[0])
    motion = _Motion(plant, inflow, controller, first, dense, begin, duration, tolerance, guess)
    path, energies, stopped = motion.march(max_step or duration / 100.0)
    end = float(path.x[-1])
    time = begin + (time - begin) * (end - begin) / duration
    values, flow = path(time), inflow.speed_at(time)
    speed, *states = values[:, :dense].T
    return Simulation(
        time,
        flow,
        speed,
        *motion.torques(time, flow, values),
        *map(float, energies),
        0.5 * plant.inertia * float(path(end)[0] ** 2 - start[0] ** 2),
        end if stopped else None,
        lambda at: path(np.minimum(at, end))[..., 0],
        np.array(states),
        values[:, dense:],
        None if stopped else path,
    )


@dataclass(frozen=True, eq=False)
class _Motion:
    """The equation of motion of one run, and its integration.

    Its values, which begin with `start`, are the rotor's speed and the controller's states, `dense`
    of them, and then the state of the wake's filters, if the plant's has memory.
    """

    plant: Plant
    inflow: Inflow
    controller: Callable
    start: np.ndarray
    dense: int
    begin: float
    duration: float
    tolerance: float
    guess: PPoly | None

    def march(self, longest):
        """Return the motion over time (`PPoly`), the energies, and whether the rotor stops."""
        edges = self._mesh(longest) if self.guess is None else self.guess.x
        count, failures, stop = WINDOW, 0, None
        paths, energies, begun, start = [], np.zeros(4), edges.size, self.start
        while edges.size > 1 and stop is None:
            window = edges[: count + 1]
            result = self._solve(self._divided_by_flow(window), start, energies[0])
            if result and (stop := self._standstill(result[0])) is not None:
                result = self._solve(stop, start, energies[0])
            if not result:
                failures, stop = failures + 1, None
                count = (window.size - 1) // 2
                most = FAILURES[0] + FAILURES[1] * (begun - edges.size)
                endless = result is False and not count
                if endless or failures > most or edges[1] - edges[0] < 1e-14 * self.duration:
                    raise IntegrationError(float(edges[0]), self._fastest(paths))
                if not count:
                    edges = np.insert(edges, 1, 0.5 * (edges[0] + edges[1]))
                    count = 1
                continue
            path, work = result
            paths.append(path)
            energies += work
            start = path(path.x[-1])
            edges, count = edges[window.size - 1 :], 2 * min(count, WINDOW // 2)
        ends = np.concatenate([*(path.x[:-1] for path in paths), paths[-1].x[-1:]])
        whole = PPoly(np.concatenate([path.c for path in paths], axis=1), ends)
        return whole, energies, stop is not None

    def _fastest(self, paths):
        """Return when and how fast a rotor turned that ran away; None: it did not."""
        if not paths:
            return None
        time = np.concatenate([path.x for path in paths])
        speed = np.concatenate([path(path.x)[..., 0] for path in paths])
        ratio = speed / self.inflow.speed_at(time)
        most = np.argmax(ratio)
        return (float(time[most]), float(speed[most])) if ratio[most] > AWAY * ratio[0] else None

    def _mesh(self, longest):
        """Return the longest steps; none extends over an end of a piece of controller or flow."""
        begin, end = self.begin, self.begin + self.duration
        near = 1e-12 * end  # times closer than rounding are one
        ends = np.union1d(getattr(self.controller, "ends", ()), self.inflow.pieces(end, begin))
        inside = ends[(ends > begin + near) & (ends < end - near)]
        inside = inside[np.diff(inside, prepend=begin) > near]
        ends = np.concatenate(([begin], inside, [end]))
        return radau.divided(ends, np.maximum(np.ceil(np.diff(ends) / longest - 1e-6), 1.0))

    def _divided_by_flow(self, edges):
        """Halve the steps in which the flow is no polynomial through the nodes."""
        for _ in range(20):
            step = np.diff(edges)[:, None]
            nodes = self.inflow.speed_at(edges[:-1, None] + step * radau.NODES)
            places = edges[:-1, None] + step * (np.arange(PROBES) + 0.5) / PROBES
            probes = self.inflow.speed_at(places)
            off = np.max(np.abs(radau.through(edges, radau.NODES, nodes)(places) - probes), axis=1)
            coarse = off > FLOW_ERROR * np.max(np.abs(probes), axis=1)
            if not np.any(coarse):
                break
            edges = radau.divided(edges, 1 + coarse)
        return edges

    def torques(self, time, flow, values):
        """Return hydrodynamic and generator torque, N*m, at arrays of one shape."""
        speed, *states = np.moveaxis(values[..., : self.dense], -1, 0)
        filters = None
        if self.plant.wake is not None:
            filters = values[..., self.dense :].reshape(flow.size, -1)
        driving = self.plant.torque(speed.ravel(), flow.ravel(), filters)
        control = self.controller(time, speed, *states) * np.ones(speed.shape)
        return driving.reshape(flow.shape), control

    def _dense_rates(self, flow, values, driving, control):
        """Return the rates of the speed and the controller's states."""
        speed, *states = np.moveaxis(values[..., : self.dense], -1, 0)
        friction = self.plant.generator.friction(speed)
        acceleration = (driving - control - friction) / self.plant.inertia
        rates = self.controller.rates(speed, flow, acceleration, *states) if states else ()
        return np.stack((acceleration, *rates), axis=-1)

    def _rates(self, time, flow, values):
        """Return the rates of all values, of their shape, and what they follow from.

        That is the hydrodynamic and the generator torque, and the velocity induced at 0.7 R.
        """
        driving, control = self.torques(time, flow, values)
        rates, at_place = self._dense_rates(flow, values, driving, control), None
        if (wake := self.plant.wake) is not None:
            flows, filters = flow.ravel(), values[..., self.dense :]
            balanced, at_place = wake.balanced(values[..., 0].ravel(), flows)
            filter_rates = wake.rates(filters.reshape(flows.size, -1), flows, (balanced, at_place))
            rates = np.concatenate((rates, filter_rates.reshape(filters.shape)), axis=-1)
        return rates, (driving, control, at_place)

    def _system(self, step, time, flow, values, rates, sources):
        """Return the linear system of Newton's method; None where it has no slopes.

        sources is what `_rates` returns besides the rates. The slopes by dense values, [..., rate,
        value], are by differences.
        """
        steps, n = 1e-6 * radau.magnitudes(values, self.dense), self.dense
        slopes = np.empty((*values.shape, n))
        for i in range(n):
            moved = values.copy()
            moved[..., i] += steps[..., i]
            change = self._rates(time, flow, moved)[0] - rates
            slopes[..., i] = change / steps[..., i, None]
        chains = ()
        if self.plant.wake is not None:
            by_speed = slopes[..., n:, 0].reshape(*flow.shape, 2, -1)
            chains = *self._wake_slopes(flow, values, rates, sources), by_speed
        finite = all(np.all(np.isfinite(array)) for array in (slopes, *chains))
        return radau.StageSystem(step, slopes[..., :n, :], chains) if finite else None

    def _wake_slopes(self, flow, values, rates, sources):
        """Return the slopes by filters, the first two `chains` of `StageSystem`."""
        (driving, control, at_place), n, shape = sources, self.dense, flow.shape
        flows, speed = flow.ravel(), values[..., 0].ravel()
        filters = values[..., n:].reshape(speed.size, -1)
        by_chain = self.plant.torque_by_wake(speed, flows, filters).reshape(*shape, 1, -1)
        step = 1e-6 * np.maximum(np.abs(driving), 1.0)
        by_torque = self._dense_rates(flow, values, driving + step, control) - rates[..., :n]
        by_chain = (by_torque / step[..., None])[..., None] * by_chain
        slow, fast = self.plant.wake.times(flows, at_place)
        fast = np.tile(fast.reshape(*shape, -1), by_chain.shape[-1] // fast.shape[1])
        chain = np.zeros((*shape, 2, 2, by_chain.shape[-1]))
        chain[..., 0, 0, :] = -1.0 / slow.reshape(*shape, 1)
        chain[..., 1, 0, :], chain[..., 1, 1, :] = 1.0 / fast, -1.0 / fast
        return by_chain, chain

    def _solve(self, edges, start, energy):
        """Return motion (`PPoly`) and energies over some steps, divided until they are accurate.

        energy, J, is what has been captured before. None if Newton's method does not converge,
        False if no number of steps up to `MOST_STEPS` is enough.
        """
        flow = float(self.inflow.speed_at(self.begin))
        power = power_scale(self.plant.density, self.plant.blade.rotor_radius, flow)
        unit = energy + 0.01 * self.duration * power
        path = self.guess
        while edges.size <= MOST_STEPS:
            step = np.diff(edges)[:, None]
            # a controller may jump at the end of a segment: stay before it
            time = edges[:-1, None] + step * np.minimum(radau.NODES, 1.0 - 1e-12)
            flow = self.inflow.speed_at(time)
            if not np.all(flow > 0.0):
                return None
            if path is None:
                guess = np.tile(start, (*time.shape, 1))
                guess[..., 0] *= flow / flow[0, 0]
            else:
                guess = path(time)
            solution = self._stages(start, step, time[:, 1:], flow[:, 1:], guess[:, 1:])
            if solution is None:
                return None
            stages, system, (driving, control, _) = solution
            begin = radau.begins(start, stages)
            rates, (first, *_) = self._rates(time[:, :1], flow[:, :1], begin)
            values = np.concatenate((begin, stages), axis=1)
            path = radau.through(edges, radau.NODES, values)
            errors = np.abs(system.errors(begin, stages, rates[:, 0]))
            errors = np.max(errors / radau.magnitudes(stages, self.dense)[:, -1], axis=1)
            power = np.hstack((first, driving)) * values[..., 0]
            share = np.abs(step[:, 0] * (power @ radau.ERROR)) / unit
            share = np.maximum(share, errors) / self.tolerance
            if np.all(share <= 1.0):
                powers = self.plant.powers(stages[..., 0], driving, control)
                return path, np.array([np.sum(step * radau.MATRIX[-1] * power) for power in powers])
            parts = np.nan_to_num(np.ceil((2.0 * share) ** (1.0 / (radau.STAGES + 1))), nan=8.0)
            edges = radau.divided(edges, np.where(share <= 1.0, 1.0, np.clip(parts, 2.0, 8.0)))
        return False

    def _stages(self, start, step, time, flow, stages):
        """Solve the stages of successive steps by Newton's method, from a guess of their values.

        start has the values at the begin of the first step. Returns the values, the `StageSystem`,
        and what the last rates follow from; None if the method does not converge.
        """
        change, enough = np.inf, max(0.01 * self.tolerance, 1e-12)
        fastest = LOST * np.max(radau.magnitudes(stages, self.dense)[..., 0])
        patience = MOST_ITERATIONS if self.plant.wake is None else PATIENCE
        for iteration in range(MOST_ITERATIONS):
            size = radau.magnitudes(stages, self.dense)
            rates, sources = self._rates(time, flow, stages)
            if change > SAME_SLOPE:
                system = self._system(step, time, flow, stages, rates, sources)
                if system is None:
                    return None
            moved = step[..., None] * np.einsum("ij,nja->nia", radau.MATRIX, rates)
            correction = system.correction(radau.begins(start, stages) + moved - stages)
            stages = stages + correction
            change = np.max(np.abs(correction) / size)
            if change <= enough:
                return stages, system, sources
            lost = not np.all(np.isfinite(stages)) or np.max(np.abs(stages[..., 0])) > fastest
            if lost or (iteration >= patience and change > FAR):
                return None
        return None

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
