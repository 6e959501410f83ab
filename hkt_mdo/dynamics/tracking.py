"""Control of the rotor's speed to a schedule over the flow's speed, sensed or estimated."""

from functools import cached_property
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, Strict

from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.sections import Flaws, Pair, Quantity

RESET = 0.2  # s, kp / ki of a controller that the start chooses
STIFFER = 2.0  # kp of it, over the largest of Q/w and dQ/dw along the schedule
NARROWEST = 0.02  # width of a flow's range over its middle, at least, over which knots are placed

_FlowSpeed = Annotated[float, Quantity("m/s", gt=0)]
_Proportional = Annotated[float, Quantity("N*m*s/rad", gt=0)]
_Integral = Annotated[float, Quantity("N*m/rad", gt=0)]


class Tracking(FeedbackLaw):
    """Proportional-integral control of the speed to a schedule over the flow's speed.

    u = sat(kp (w - w_ref(s)) + z), z' = (u - z) ki / kp, s' = (v + bias - s) / lag

    z is the integral part, s the sensor's reading of the flow speed; w_ref is a natural cubic
    spline, linear beyond its knots (docs/controllers.md).

    The optimization assumes a perfect estimate of v but for the filter's lag: designs are the same
    with a sensor and an estimate.
    """

    law: Literal["tracking"] = "tracking"
    """The control law."""
    knots: Annotated[int, Strict(), Field(ge=2, le=40)] = 8
    """Number of equally spaced flow speeds at which the rotor speed is designed."""
    flow_range: Pair[_FlowSpeed] | None = None
    """Flow speeds of the first and the last knot; null: the slowest and the fastest of `inflow`."""
    schedule: tuple[Annotated[float, Quantity("rad/s", gt=0)], ...] | None = None
    """Rotor speeds at the knots at the start; null: those of the open loop of the search for a
    start."""
    proportional_gain: _Proportional | None = None
    """Gain kp; null: twice the larger of the maxima of Q/w and dQ/dw along the schedule of the
    start."""
    proportional_bounds: Pair[_Proportional] | None = None
    """Bounds between which kp is designed; null: it is fixed. Without noise kp often ends at the
    upper bound."""
    integral_gain: _Integral | None = None
    """Gain ki; null: kp / 0.2 s."""
    integral_bounds: Pair[_Integral] | None = None
    """Bounds between which ki is designed; null: it is fixed."""
    flow: Literal["sensed", "estimated"] = "sensed"
    """Source of the flow speed: a sensor, or an estimate from the rotor's speed and torque."""
    lag: Annotated[float, Quantity("s", ge=0.001)] = 0.1
    """Time constant of the sensor, or of the estimate's filter."""
    bias: Annotated[float, Quantity("m/s")] = 0.0
    """Offset of the sensor, also used in the optimization."""
    noise: Annotated[float, Quantity("m/s", ge=0)] = 0.0
    """Standard deviation of a sample of the sensor, in simulations with noise only."""

    states: ClassVar[dict[str, tuple[str, str]]] = {
        "integral_torque": ("N*m", "integral part of the generator torque"),
        "sensed_flow": ("m/s", "inflow speed as read by the sensor"),
    }
    farthest: ClassVar[float] = 1.2  # factor; the rotor follows its schedule
    estimates_flow = property(lambda self: self.flow == "estimated")  # type: ignore[assignment]
    gain_units = property(  # type: ignore[assignment]
        lambda self: ("rad/s",) * self.knots + ("N*m*s/rad", "N*m/rad")
    )

    def flaws(self) -> Flaws:
        if self.schedule is not None and len(self.schedule) != self.knots:
            problem = f"has {len(self.schedule)} speeds for {self.knots} knots"
            yield "schedule", problem, "give one per knot"
        for name in ("bias", "noise") if self.flow == "estimated" else ():
            if getattr(self, name):
                problem = "is for a sensor, but the flow speed is estimated"
                yield name, problem, "leave it out, or give flow: sensed"
        for name in ("proportional", "integral"):
            gain, bounds = getattr(self, f"{name}_gain"), getattr(self, f"{name}_bounds")
            if None not in (gain, bounds) and not bounds[0] <= gain <= bounds[1]:
                problem = f"lies outside control.{name}_bounds = [{bounds[0]:g}, {bounds[1]:g}]"
                remedy = "the start must lie within the bounds: change one or the other"
                yield f"{name}_gain", problem, remedy

    def moves(self, gains, factor):
        ends = super().moves(gains, factor)
        for index, bounds in (-2, self.proportional_bounds), (-1, self.integral_bounds):
            held = bounds or 2 * (gains[index],)
            ends[:, index] = np.clip(ends[:, index], *held)
        return ends

    def in_flow(self, slowest, fastest):
        if self.flow_range is not None:
            return self
        middle, half = 0.5 * (slowest + fastest), 0.5 * (fastest - slowest)
        half = max(half, 0.5 * NARROWEST * middle)
        return self.model_copy(update={"flow_range": (middle - half, middle + half)})

    @cached_property
    def spline(self):
        """The spline of a schedule over the flow's speed, m/s."""
        from hkt_mdo.rotor.torque_curve import TorqueSpline  # a case is read without SciPy

        return TorqueSpline(np.linspace(*self.flow_range, self.knots))

    def reference(self, flow, gains):
        """Return the schedule's speed, rad/s, at sensed flow speeds, m/s; both may be complex."""
        return self.spline.curve(gains[: self.knots])(flow)

    def demand(self, speed, gains, integral_torque, sensed_flow):
        """Return kp (w - w_ref(s)) + z, N*m; arguments of one shape, which may be complex."""
        return gains[-2] * (speed - self.reference(sensed_flow, gains)) + integral_torque

    def rates(self, speed, inflow_speed, gains, integral_torque, sensed_flow):
        # the controller knows what it demands, not what a generator makes of it
        torque = self.torque(speed, gains, integral_torque, sensed_flow) / self._applied
        reset = (torque - integral_torque) * gains[-1] / gains[-2]
        return reset, (inflow_speed + self.bias - sensed_flow) / self.lag

    def at_rest(self, torque, inflow_speed):
        return torque / self._applied, inflow_speed + self.bias

    def speed_at_rest(self, inflow_speed, gains):
        return self.reference(inflow_speed + self.bias, gains)

    def sensed(self, inflow_speed, random):
        return inflow_speed + self.noise * random.standard_normal(np.shape(inflow_speed))

    def follow(self, inflow_speed, speed, torque, slope):
        sensed, least = inflow_speed + self.bias, max(np.max(torque / speed), np.max(slope))
        every = -np.inf, np.inf
        kp = self.proportional_gain or STIFFER * least
        kp = np.clip(kp, *(self.proportional_bounds or every))
        ki = np.clip(self.integral_gain or kp / RESET, *(self.integral_bounds or every))
        if self.schedule is not None:
            return np.array([*self.schedule, kp, ki])
        # at a knot that no flow reaches, its speed is proportional to the flow
        schedule = self.spline.nodes * np.sum(speed) / np.sum(sensed)
        basis = self.spline.basis(sensed)
        schedule = schedule + np.linalg.lstsq(basis, speed - basis @ schedule, rcond=1e-6)[0]
        return np.array([*schedule, kp, ki])
