"""Control laws: generator torque from rotor speed (paper eqs. 1 to 4).

A law is one class: its keys in a case's section `control`, and its formula. The formula is nowhere
else; a law of your own is a subclass of `FeedbackLaw` (docs/controllers.md).
"""

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import PrivateAttr

from hkt_mdo.dynamics.formulas import STEP, slope
from hkt_mdo.sections import Quantity, Section

LEAST_TERM = 0.02
"""Least share of each term of a law at the start, of what fits best without the others."""


def smooth_saturation(torque, limit, smoothing):
    """Return the smoothly saturated torque (paper eq. 4), N*m.

    sat(u) = limit/4 (2 + sqrt(nu + (2u/limit)²) - sqrt(nu + (2u/limit - 2)²)), nu = smoothing.
    It lies between 0 and the limit for every u. With x = u/limit far above 1 it is nu limit / (16 x
    (x - 1)) below the limit; at u = 0 it is 0.78 % of the limit for nu = 0.001.
    """
    ratio = 2.0 * torque / limit
    rising, falling = np.sqrt(smoothing + ratio**2), np.sqrt(smoothing + (ratio - 2.0) ** 2)
    return 0.25 * limit * (2.0 + rising - falling)


class Law(Section):
    """Base of all control laws: a name, a limit on the torque u, and a cut-out speed.

    The rest of the program uses the properties of a law and never depends on which one it is. An
    open loop has no gains and no states; its torque over time is chosen by the optimizer.
    """

    named_by: ClassVar[str] = "law"
    law: str
    """The control law."""
    torque_limit: Annotated[float, Quantity("N*m", gt=0)] | None = None
    """Largest generator torque u_max; null: no limit."""
    cut_out: Annotated[float, Quantity("m/s", gt=0)] | None = None
    """Flow speed above which the machine stands still, without energy and limits."""
    gain_units: ClassVar[tuple[str, ...]] = ()
    """Units of the gains, which are optimized."""
    farthest: ClassVar[float] = np.inf
    """Largest factor by which gains change in one optimization."""
    states: ClassVar[dict[str, tuple[str, str]]] = {}
    """Unit and description of each state of the controller, by its name."""
    is_feedback: ClassVar[bool] = False
    """Whether the torque is a function of measured quantities."""
    chooses_speed: ClassVar[bool] = False
    """Whether the optimizer chooses the rotor speed over time, and the torque follows from it."""
    chooses_torque: ClassVar[bool] = False
    """Whether the optimizer chooses the torque over time."""
    estimates_flow: ClassVar[bool] = False
    """Whether the flow speed that a law with states uses is estimated from speed and torque."""
    simpler: ClassVar["Law | None"] = None
    """A law of fewer gains, from whose optimum the start is found where the power is limited."""
    _applied: float = PrivateAttr(1.0)  # torque on the rotor over the torque that the law demands

    @property
    def is_static(self) -> bool:
        """Whether the torque follows from the rotor speed alone."""
        return self.is_feedback and not self.states

    @property
    def follows(self) -> bool:
        """Whether it can nearly follow an open loop; of two gains of your own that is not known."""
        return bool(self.states) or len(self.gain_units) > 2

    @property
    def named_gains(self) -> dict[str, tuple[str | None, str]]:
        """Unit and description of each gain, by its name in the model."""
        return {f"gain_{i}": (unit, "feedback gain") for i, unit in enumerate(self.gain_units)}

    def applied(self, factor: float) -> Self:
        """Return the same law; the torque on the rotor is that of the law times a factor."""
        law = self.model_copy()
        law._applied = factor
        return law

    @property
    def largest_torque(self) -> float | None:
        """Largest torque on the rotor, N*m; None: without a limit."""
        return self.torque_limit and self._applied * self.torque_limit

    def in_flow(self, slowest: float, fastest: float) -> "Law":
        """Return this law for a design flow between two speeds, m/s; most laws are unchanged."""
        return self

    def starting_gains(self) -> np.ndarray | None:
        """Return the gains that the case gives for the start; None: the search chooses them."""
        return np.empty(0)

    def held(self, gains):
        """Yield a warning of each gain that begins at zero, which no optimization changes."""
        for i in np.flatnonzero(gains == 0.0) if self.starting_gains() is None else ():
            yield f"gain_{i} of the law {self.law} begins at 0 and is not designed: write a fit"

    def sizes(self, gains):
        """Return the typical change of each gain, positive, (n_gains,)."""
        return np.abs(gains)

    def moves(self, gains, factor):
        """Return the lower and upper bounds, (n_gains,), of one step of a search from some gains.

        They are apart by a factor, at most `farthest` of a law. A gain with equal bounds is fixed.
        Of a static law that is linear in several gains, as the default `fit` says, each may change
        its sign: with 5 kW, K1 w² + K2 w captures 13 % more if one does.
        """
        factor = min(factor, self.farthest)
        linear = getattr(type(self), "fit", None) is FeedbackLaw.fit and not self.states
        least = -gains * factor if linear and len(gains) > 1 else gains / factor
        return np.sort((least, gains * factor), axis=0)

    def contains(self, other: "Law") -> bool:
        """Tell whether another law is a special case of this one, with some of its gains."""
        return self == other


class OpenLoop(Law):
    """Open-loop optimal control: the torque over time is itself optimized, 0 <= u <= u_max."""

    law: Literal["open_loop"] = "open_loop"
    """The control law."""
    unknown: Literal["speed", "torque"] = "speed"
    """What the optimizer chooses over time: the rotor speed, from which the torque follows, or the
    torque."""
    chooses_speed = property(lambda self: self.unknown == "speed")  # type: ignore[assignment]
    chooses_torque = property(lambda self: self.unknown == "torque")  # type: ignore[assignment]

    def contains(self, other):
        limit, lower = (law.torque_limit or np.inf for law in (self, other))
        return self.cut_out == other.cut_out and lower <= limit


class FeedbackLaw(Law):
    """Base of all feedback laws: gains that are optimized, and a smoothed saturation.

    A law may have states, x' = `rates`: then `demand`, and what follows from it, takes their values
    after the gains, each of the speed's shape.
    """

    is_feedback: ClassVar[bool] = True

    smoothing: Annotated[float, Quantity(gt=0, le=1)] = 0.001
    """Smoothing nu of the saturation at the torque limit (paper, eq. 4)."""

    def demand(self, speed, gains, *states):
        """Return the torque before saturation, N*m.

        speed (rad/s, any shape), gains[n_gains] (in `gain_units`) and states may be complex.
        """
        raise NotImplementedError

    def torque(self, speed, gains, *states):
        """Return the generator torque, N*m; the parameters are those of `demand`."""
        demand = self.demand(speed, gains, *states)
        if self.torque_limit is not None:
            demand = smooth_saturation(demand, self.torque_limit, self.smoothing)
        return self._applied * demand

    def fit(self, speed, torque):
        """Return the starting gains: their demand is closest to torques (N*m) at speeds (rad/s).

        By least squares, for a law that is linear in its gains; one that is not overrides this.
        Each gain begins with the sign that it has alone, and `LEAST_TERM` of that.
        """
        from scipy.optimize import lsq_linear

        ones = {"gains": np.ones(len(self.gain_units))}
        terms = slope(lambda gains: self.demand(speed, gains), ones, "gains", diagonal=False)
        # a term may be zero at all of these speeds
        alone = torque @ terms / np.maximum(np.sum(terms**2, axis=0), np.finfo(float).tiny)
        return lsq_linear(terms * alone, torque, (LEAST_TERM, np.inf)).x * alone

    def scaled_gains(self, gains, share):
        """Return gains whose torque is a share of that with other gains, if possible."""
        return share * gains

    def rates(self, speed, inflow_speed, gains, *states):
        """Return the rates of the states, a unit of each a second, at arrays of one shape.

        inflow_speed (m/s) is the input of a flow sensor; all may be complex.
        """
        return ()

    def at_rest(self, torque, inflow_speed):
        """Return a guess of the states in equilibrium, under a torque, N*m, in a flow, m/s."""
        return ()

    def speed_at_rest(self, inflow_speed, gains):
        """Return a guess of the equilibrium's speed, rad/s, in a flow, m/s."""
        raise NotImplementedError

    def sensed(self, inflow_speed, random):
        """Return the flow's speed, m/s, with the noise of its sensor, from NumPy's generator."""
        return inflow_speed

    def follow(self, inflow_speed, speed, torque, slope):
        """Return the starting gains of a law with states, which follow an open loop's schedule.

        inflow_speed (m/s), speed (rad/s), torque (N*m) and its slope dQ/dw (N*m*s/rad) are those of
        the open loop at some instants.
        """
        raise NotImplementedError

    def slopes(self, speed, inflow_speed, gains, *states):
        """Return the derivatives of torque and rates by speed and states, ``[of, by, *shape]``.

        By complex step; rows and columns begin with the torque (N*m) and the speed (rad/s).
        """
        columns, values = [], [speed, *states]
        for index in range(len(values)):
            moved = [value + 1j * STEP * (i == index) for i, value in enumerate(values)]
            torque = self.torque(moved[0], gains, *moved[1:])
            rates = self.rates(moved[0], inflow_speed, gains, *moved[1:])
            columns.append(np.imag([torque, *rates]) / STEP)
        return np.stack(columns, axis=1)

    def starting_gains(self):
        gain = getattr(self, "gain", None)
        return None if gain is None else np.atleast_1d(np.asarray(gain, dtype=float))


class LinearFeedback(FeedbackLaw):
    """Linear feedback, u = K1 w (paper, eq. 1)."""

    law: Literal["linear"] = "linear"
    """The control law."""
    gain: Annotated[float, Quantity("N*m*s/rad", gt=0)] | None = None
    """Gain K1 at the start of the optimization; null: chosen by the search for a start."""
    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s/rad",)

    def demand(self, speed, gains):
        return gains[0] * speed


class QuadraticFeedback(FeedbackLaw):
    """Quadratic feedback, u = K2 w^2 (paper, eq. 2)."""

    law: Literal["quadratic"] = "quadratic"
    """The control law."""
    gain: Annotated[float, Quantity("N*m*s**2/rad**2", gt=0)] | None = None
    """Gain K2 at the start of the optimization; null: chosen by the search for a start."""
    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s**2/rad**2",)

    def demand(self, speed, gains):
        return gains[0] * speed**2
