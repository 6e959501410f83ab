"""An upper bound on the captured energy that includes the torque limit and the control law.

Every instant may have a blade and a rotor speed of its own. Energy stored in the rotor between
instants enters by a multiplier theta(t), any smooth function: with J dw/dt = Q - u, u
including friction,

    integral of Q w dt = integral of [(1 - theta) u w + theta Q w + theta' J w² / 2] dt
                         + [(1 - theta) J w² / 2] from 0 to T,

and the supremum of the integrand over speed and blade, at each instant, is a bound. theta is one at
both ends, where the last term then vanishes. See docs/dev/numerics.md.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from hkt_mdo.rotor.scales import power_scale

SPEEDS = 25  # flow speeds of the table
BISECTIONS = 16  # for the multiplier
MOST = 4.0  # largest multiplier
RAMP = 0.2  # s, over which the multiplier becomes one at both ends
LEAST = 0.1  # share of the flow's torque that a law is fitted to, if friction takes more
GAINS, WIDEST, REFINEMENTS = 17, 5.0, 5  # gains tried, their range about a good one, refinements


class Certificate:
    """Upper bounds on the captured energy, J, of every blade of a family in a passing inflow.

    power[n] bounds the power coefficient of the family at tip speed ratios ratio[n], which rise and
    within which the bounds hold; its inertia (kg m²) lies between the two of `inertia`. friction
    (N*m) is a function of the rotor speed (rad/s). The flow is sampled by Gauss's rule,
    four points in segments with rising edges (s), which resolve it, and in the ramps at both ends:
    time (s, since the first edge), weights (s), speed (m/s) and rate (m/s²). Powers are over a grid
    of flow speeds (axis 0) and tip speed ratios (axis 1).
    """

    def __init__(self, ratio, power, inertia, inflow, edges, density, rotor_radius, friction):
        self.ratio, self.power, self.inertia, self.friction = ratio, power, inertia, friction
        self.density, self.radius = density, rotor_radius
        ends = np.array([0.0, 0.5 * RAMP, RAMP])
        edges = np.union1d(np.union1d(edges, edges[0] + ends), edges[-1] - ends)
        places, weights = np.polynomial.legendre.leggauss(4)
        half = 0.5 * np.diff(edges)[:, None]
        time = ((edges[:-1, None] + half) + half * places).ravel()
        self.time, self.weights = time - edges[0], (half * weights).ravel()
        self.duration = edges[-1] - edges[0]
        self.speed, self.rate = inflow.speed_at(time), inflow.rate_at(time)
        low, high = self.speed.min(), self.speed.max()
        margin = 1e-3 * high
        self.flow = np.linspace(low - margin, high + margin, SPEEDS)
        self.rotor_speed = ratio * self.flow[:, None] / rotor_radius
        self.scale = power_scale(density, rotor_radius, self.flow)[:, None]

    def of_limit(self, torque_limit):
        """Return the bound for any torque between zero and a limit, N*m."""
        return self._energy(lambda speed: (torque_limit + self.friction(speed)) * speed, most=1.0)

    def of_law(self, law):
        """Return the bound for a `FeedbackLaw` with one gain.

        For gains within a factor `WIDEST` of the one that is best in steady flow.
        """
        best = np.argmax(self.power)
        middle = np.cbrt(self.weights @ self.speed**3 / self.weights.sum())
        speed = self.ratio[best] * middle / self.radius
        torque = power_scale(self.density, self.radius, middle) * self.power[best] / speed
        held = max(torque - self.friction(speed), LEAST * torque)
        fitted = law.fit(np.array([speed]), np.array([held]))

        def at(gain):
            gain = np.atleast_1d(gain)
            return self._energy(lambda w: (law.torque(w, gain) + self.friction(w)) * w)

        gains = fitted * np.geomspace(1.0 / WIDEST, WIDEST, GAINS)
        bounds = np.array([at(gain) for gain in gains])
        for _ in range(REFINEMENTS):
            peak = int(np.argmax(bounds))
            around = gains[max(peak - 1, 0) : peak + 2]
            new = np.sqrt(around[1:] * around[:-1])
            gains, order = np.unique(np.append(gains, new), return_index=True)
            bounds = np.append(bounds, [at(gain) for gain in new])[order]
        return float(bounds.max())

    def _energy(self, generated, most=MOST):
        """Return the bound, J, from the generator power u w (W), a function of the rotor speed.

        `most` is the largest multiplier: 1 if the torque may be lower, because a larger one gains
        nothing.
        """
        multiplier, speed = self._multiplier(generated(self.rotor_speed) / self.scale, most)
        theta, balanced = (PchipInterpolator(self.flow, each) for each in (multiplier, speed))
        time, duration = self.time, self.duration
        # rises from zero at both ends to one within RAMP
        part = np.minimum(np.minimum(time, duration - time) / RAMP, 1.0)
        sign = np.where(time < 0.5 * duration, 1.0, -1.0)
        ramp, ramp_rate = part**2 * (3.0 - 2.0 * part), sign * 6.0 * part * (1.0 - part) / RAMP
        excess = theta(self.speed) - 1.0
        rate = ramp * theta(self.speed, 1) * self.rate + ramp_rate * excess
        mean = 0.5 * self.weights @ (rate * balanced(self.speed) ** 2) / duration
        inner = (time > RAMP) & (time < duration - RAMP)
        # convex in the rate of the flow: chords between none and the extremes lie above
        flow = np.interp(np.arange(2 * SPEEDS - 1) / 2.0, np.arange(SPEEDS), self.flow)
        steepest = np.abs(self.rate).max() + 1e-12

        def supremum(flow, theta, rate):
            # of the integrand over power_scale at flow speeds
            speed = self.ratio * flow[:, None] / self.radius
            scale = power_scale(self.density, self.radius, flow)[:, None]
            theta = theta[:, None]
            storing = 0.5 * rate[:, None] * (speed**2 - balanced(flow)[:, None] ** 2) + mean
            low, high = self.inertia
            stored = np.maximum(low * storing, high * storing)
            return peak(((1.0 - theta) * generated(speed) + stored) / scale + theta * self.power)

        down, level, up = (
            between(flow, supremum(flow, theta(flow), x * theta(flow, 1)), self.speed[inner])
            for x in (-steepest, 0.0, steepest)
        )
        share = self.rate[inner] / steepest
        rising, falling = np.maximum(share, 0.0), np.maximum(-share, 0.0)
        power, outer = power_scale(self.density, self.radius, self.speed), ~inner
        power[inner] *= level + rising * (up - level) + falling * (down - level)
        power[outer] *= supremum(self.speed[outer], 1.0 + ramp[outer] * excess[outer], rate[outer])
        return float(self.weights @ power)

    def _multiplier(self, braking, most):
        """Return the multiplier with the least bound in steady flow, and the speed there."""
        low, high = np.full(SPEEDS, 1e-3), np.full(SPEEDS, 2.0 * most)
        rows = np.arange(SPEEDS)
        for _ in range(BISECTIONS + 1):
            theta = np.minimum(0.5 * (low + high), most)
            best = np.argmax(braking + theta[:, None] * (self.power - braking), axis=1)
            rising = self.power[best] > braking[rows, best]
            low, high = np.where(rising, low, theta), np.where(rising, theta, high)
        return theta, self.rotor_speed[rows, best]


def between(x, values, at):
    """Interpolate and add a bound on the error, a quarter of that of every other point."""
    error = np.abs(PchipInterpolator(x[::2], values[::2])(x) - values)
    error[1:-1] = np.maximum(error[1:-1], np.maximum(error[:-2], error[2:]))
    return PchipInterpolator(x, values)(at) + 0.25 * np.interp(at, x, error)


def peak(values):
    """Return the largest value of each row, between the points by a parabola."""
    index = np.clip(np.argmax(values, axis=1), 1, values.shape[1] - 2)
    rows = np.arange(values.shape[0])
    left, middle, right = (values[rows, index + shift] for shift in (-1, 0, 1))
    bend = np.maximum(2.0 * middle - left - right, 1e-300)
    gain = np.minimum((right - left) ** 2 / (8.0 * bend), np.abs(right - left))
    return np.maximum(values.max(axis=1), middle + gain)
