"""Limits on a design and its operation, each defined once.

Optimization, checks, `hkt check`, summary and figures get its value from the limit; nothing else
knows the formula. A limit of your own is a subclass of `Limit` (docs/dev/architecture.md).
"""

from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import PrivateAttr, Strict

from hkt_mdo.dynamics.formulas import Formula
from hkt_mdo.dynamics.laws import Law
from hkt_mdo.errors import InputError
from hkt_mdo.quantities import QUANTITIES
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.sections import Quantity

BETWEEN = 1e-4  # relative excess between the nodes at which a limit still counts as kept
ALLOWABLE = "allowable"  # in place of a number: the allowable stress of the material
SLOWED = 0.02  # share of its speed that a rotor may lose and still recover from
TYPICAL = 0.05  # torque coefficient to which a recovery torque is compared
QUICK, LAG = 0.05, 5.0  # see `settled`
LEAST = 5e-3  # least recovery torque over a typical torque; closer to stall recovery is too slow


class Limit(Formula):
    """A quantity that must stay between `lower` and `upper`.

    A limit that a case may give under `limits` has a `name`, a `unit` and usually one field,
    `bound`, a `Quantity`: then ``limits: {name: 15 m/s}`` is short for ``{name: {bound: 15 m/s}}``.
    A limit `of` one quantity has its name, its unit and this input.

    `value` takes the quantities that `inputs` names (`hkt_mdo.quantities`) as keyword arguments:
    arrays (n_times,) over time, (n_stations,) along the span, numbers of the design. It must accept
    complex numbers, for its derivatives are taken by complex step. With an input over time it
    returns (n_times,), else a number or an array of any size.
    """

    name: ClassVar[str] = ""
    named_by, short = "name", "bound"
    lower: ClassVar[Any] = -np.inf
    bounded: ClassVar[bool] = False
    """Whether bounds of the optimizer's own variables ensure it, so that no constraint is needed.
    """
    most_between: ClassVar[float] = BETWEEN
    """Relative excess between the nodes up to which it counts as kept."""

    def __init_subclass__(cls, of: str = "", **options: Any) -> None:
        super().__init_subclass__(**options)
        if of:
            cls.name = vars(cls).get("name", of)
            cls.unit, cls.inputs = QUANTITIES[of].unit, (of,)

    def on(self, blade: Any, material: Any = None) -> "Limit":
        """Return this limit for a turbine's blade and `Material`; most do not depend on them."""
        return self

    @property
    def place(self) -> str:
        """Dimension of its value: over "time", over the "span" of the blade, or of the "design"."""
        over = {QUANTITIES[name].over for name in self.inputs if name in QUANTITIES}
        return next((each for each in ("time", "span") if each in over), "design")

    @property
    def key(self) -> str:
        """Key of the case that gives it."""
        return f"limits.{self.name}"

    @property
    def caps_series(self) -> bool:
        """Whether it is an upper bound on a quantity over time."""
        return bool(self.place == "time" and np.isfinite(self.upper))

    @property
    def upper(self) -> Any:
        """Upper bound, in `unit`."""
        bound = getattr(self, "bound", None)
        return np.inf if bound is None else bound

    def constrains(self, control: Law) -> bool:
        """Tell whether the optimization needs a constraint to hold it under a control law."""
        return not self.bounded

    @property
    def end(self) -> Any:
        """The bound in reports: the upper one, or a lower one alone, but zero, as of a torque."""
        return self.lower if self.upper == np.inf and self.lower != 0.0 else self.upper

    def end_of(self, values: np.ndarray) -> Any:
        """Return the bound in reports of some values: of two bounds the one they are closest to.

        A lower bound of zero, as of a torque, counts where it is broken.
        """
        two = np.isfinite(self.upper) and self.lower not in (0.0, -self.upper, -np.inf)
        least = np.max(values - self.upper) if two else BETWEEN * self.bounds_size
        return self.lower if np.max(self.lower - values) > least else self.end

    @property
    def bounds_size(self) -> float:
        """Magnitude of its bounds, in `unit`; 0 where they are none."""
        ends = np.abs(np.hstack((self.lower, self.upper)))
        return float(np.max(ends[np.isfinite(ends)], initial=0.0))

    def reported(self, quantities: Any) -> np.ndarray:
        """Return the value for a report: its magnitude if the limit applies to both signs."""
        value = np.asarray(self.value_of(quantities))
        return np.abs(value) if np.all(self.lower == -self.upper) else value

    def share(self, quantities: Any) -> np.ndarray:
        """Return how much of it is used, relatively: 1 at the bound that reports give."""
        values = self.reported(quantities)
        end = self.end_of(values)
        over = (values - end) / (abs(end) or 1.0)
        return 1.0 - over if end == self.lower else 1.0 + over

    def excess(self, quantities: Any) -> np.ndarray:
        """Return the excess over its bounds, relative to them; at most 0 if the limit is kept."""
        value = np.atleast_1d(self.value_of(quantities))
        size = self.bounds_size or np.max(np.abs(value)) or 1.0
        return np.asarray(np.maximum(self.lower - value, value - self.upper) / size)


class TorqueLimit(Limit, of="control_torque"):
    """The generator's torque: never driving the rotor, and at most `control.torque_limit`."""

    key: ClassVar[str] = "control.torque_limit"  # type: ignore[misc]
    lower: ClassVar[float] = 0.0
    most_between: ClassVar[float] = 1e-3  # of polynomials, which the generator cuts at its limit

    bound: float | None = None

    def constrains(self, control):
        # a law saturates, and a torque that is a control has bounds
        return control.chooses_speed


class TorqueRateLimit(Limit, of="torque_rate"):
    """Largest rate at which the generator's torque rises or falls, |du/dt|."""

    lower = property(lambda self: -self.bound)  # type: ignore[assignment]

    bound: Annotated[float, Quantity("N*m/s", gt=0)]
    """Largest rate of the generator torque, rising or falling."""


class ForwardRotation(Limit, of="rotor_speed"):
    """The rotor turns forward; the bounds of its speed in the optimization hold this."""

    name: ClassVar[str] = "forward_rotation"
    lower: ClassVar[float] = 0.0
    bounded: ClassVar[bool] = True


class PowerLimit(Limit, of="generator_power"):
    """Largest power that the generator takes from the shaft, u w."""

    name: ClassVar[str] = "power"

    bound: Annotated[float, Quantity("W", gt=0)]
    """Largest shaft power of the generator."""


class ElectricalPowerLimit(Limit, of="electrical_power"):
    """Largest power that the generator delivers, after its losses (section `generator`)."""

    bound: Annotated[float, Quantity("W", gt=0)]
    """Largest electrical power."""


class RotorSpeedLimit(Limit, of="rotor_speed"):
    """Largest angular speed of the rotor, w."""

    bound: Annotated[float, Quantity("rad/s", gt=0)]
    """Largest rotor speed."""


class TableEnd(RotorSpeedLimit):
    """The speed at which the generator's table ends, rad/s."""

    key: ClassVar[str] = "limits.rotor_speed (end of generator.table)"  # type: ignore[misc]


class TipSpeedLimit(Limit):
    """Largest speed of the blades' tips about the axis, w R, R the radius of the disc."""

    name: ClassVar[str] = "tip_speed"
    unit: ClassVar[str | None] = "m/s"
    inputs: ClassVar[tuple[str, ...]] = ("rotor_speed", "rotor_radius")

    bound: Annotated[float, Quantity("m/s", gt=0)]
    """Largest tip speed."""

    def value(self, rotor_speed, rotor_radius):
        return rotor_speed * rotor_radius


class ThrustLimit(Limit, of="thrust"):
    """Largest thrust of the flow on the rotor, along its axis."""

    bound: Annotated[float, Quantity("N", gt=0)]
    """Largest thrust."""


class RootMomentLimit(Limit, of="root_moment"):
    """Largest flapwise bending moment of one blade at the hub's radius."""

    bound: Annotated[float, Quantity("N*m", gt=0)]
    """Largest flapwise root moment of one blade."""


class StressLimit(Limit):
    """Largest stress in a blade, from its first station outwards (docs/rotor_model.md)."""

    name: ClassVar[str] = "stress"
    unit: ClassVar[str | None] = "Pa"

    bound: Annotated[Any, Quantity("Pa", gt=0, word=ALLOWABLE)]
    """Largest stress, or `allowable`, that of `rotor.material`; apply a safety factor yourself."""
    weight: Annotated[bool, Strict()] = False
    """Whether the largest stress by the blade's weight in water is added: an upper bound, for both
    may be largest at different places."""

    @property
    def inputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """The stress by flow and rotation, and that by the weight where it counts."""
        return ("stress", "weight_stress") if self.weight else ("stress",)

    def on(self, blade, material=None):
        if self.bound != ALLOWABLE:
            return self
        if material.allowable_stress is None:
            problem = "refers to the allowable stress of rotor.material, which has none"
            remedy = "give rotor.material.allowable_stress, or a stress here"
            raise InputError(problem, remedy, key="limits.stress", value=self.bound)
        return self.model_copy(update={"bound": material.allowable_stress})


class CavitationLimit(Limit, of="cavitation"):
    """No section reaches the vapour pressure at the top of its turn (docs/rotor_model.md)."""

    upper: ClassVar[float] = 1.0  # type: ignore[assignment]
    short = "margin"

    depth: Annotated[float, Quantity("m", gt=0)] | None = None
    """Depth of the hub below the surface; null: `site.hub_depth`."""
    margin: Annotated[float, Quantity(ge=1, le=10)] = 1.1
    """Factor on the suction."""


class Taper(Limit):
    """Radius over tip radius outboard of which the chord must not grow, for manufacture."""

    name: ClassVar[str] = "taper_from"
    inputs: ClassVar[tuple[str, ...]] = ("chord",)
    upper: ClassVar[float] = 1.0  # type: ignore[assignment]

    bound: Annotated[float, Quantity(ge=0, lt=1)]
    """Distance from the axis over the tip radius from which the chord does not grow outwards."""
    _stations: tuple[float, ...] = PrivateAttr(())  # r/R of the stations of the blade

    def on(self, blade, material=None):
        stations = blade.r / blade.tip_radius
        if stations[-2] < self.bound:
            problem = "needs two stations outboard of it; the last but one is at "
            problem += f"{stations[-2]:.3g}"
            remedy = "give a place inboard of that"
            raise InputError(problem, remedy, key=self.key, value=self.bound)
        limit = self.model_copy()
        limit._stations = tuple(stations)
        return limit

    def value(self, chord):
        asked = np.where(np.array(self._stations[:-1]) >= self.bound, 1.0, 0.0)
        return np.append(0.0, asked * chord[1:] / chord[:-1])


class DesignBounds(Limit):
    """Bounds of the case on a design variable: shape of the blade, set angle, radius or gains."""

    quantity: str
    """Name of the design variable."""
    bounds: tuple[float, float]
    """Lower and upper bound, in SI units."""
    bounded: ClassVar[bool] = True
    name = property(lambda self: self.quantity)  # type: ignore[assignment]
    key = property(lambda self: f"design.{self.quantity}_bounds")
    inputs = property(lambda self: (self.quantity,))  # type: ignore[assignment]
    lower = property(lambda self: self.bounds[0])  # type: ignore[assignment]
    upper = property(lambda self: self.bounds[1])


def settled(quantities):
    """Tell at which times of a trajectory the rotor has followed the flow, near its equilibrium.

    The rotor's time scale is that in which a typical torque stops it, J w / (TYPICAL 0.5 rho pi R³
    v²), a few hundredths of a second; the flow is quick where it changes by a share of `QUICK`
    within this time. The rotor has settled after `LAG` time scales in which the flow was not quick.
    In a scenario without time it always is in equilibrium. quantities has the `QUANTITIES` of
    the trajectory, of shape (n,), rotor_radius, density, inertia and, if it is so, `steady`.
    """
    time, flow = quantities["time"], quantities["inflow_speed"]
    unit = TYPICAL * torque_scale(quantities["density"], quantities["rotor_radius"], flow)
    scale = quantities["inertia"] * quantities["rotor_speed"] / unit
    step = np.diff(time, prepend=time[0] - 1.0)
    quick = scale * np.abs(np.diff(flow, prepend=flow[0])) > QUICK * flow * step
    last = np.maximum.accumulate(np.where(quick, time, -np.inf))
    return (time - last > LAG * scale) | quantities.get("steady", False)


class DistanceFromStall(Limit):
    """A rotor under feedback recovers from a small loss of speed.

    N((1 - slowed) w) - N(w) >= LEAST, N = Q(w, v) - u(w): positive where the rotor keeps a distance
    from stall, where stable and unstable equilibrium meet. Collocation does not distinguish them,
    so an optimizer would go to that edge and beyond. N(w) = J dw/dt is the acceleration due to
    changes of the flow, which is not stall. `LEAST` is a share of a typical torque, TYPICAL 0.5 rho
    pi R³ v²: close to stall a rotor recovers slowly and the problem is badly conditioned. Q is that
    of the torque curve. For a law with states, u is computed with the states held.
    """

    name: ClassVar[str] = "distance_from_stall"
    unit: ClassVar[str | None] = "N*m"
    lower: ClassVar[float] = 0.0  # the required minimum is subtracted from the value

    law: Any
    spline: Any
    slowed: float = SLOWED
    """Share of its speed that the rotor loses."""

    @property
    def inputs(self):
        """Its inputs, and the states of the law."""
        flow = "rotor_speed", "inflow_speed", "torque_coefficient_table", "density", "rotor_radius"
        return (*flow, *self.law.named_gains, *self.law.states)

    @property
    def named_numbers(self):
        """The gains of the law."""
        return self.law.named_gains

    @property
    def series(self):
        """Also the states of the law."""
        return super().series | self.law.states

    def value(self, rotor_speed, inflow_speed, density, rotor_radius, **others):
        table, *states = (others[x] for x in ("torque_coefficient_table", *self.law.states))
        gains = np.hstack([others[x] for x in self.law.named_gains])
        unit = torque_scale(density, rotor_radius, inflow_speed)
        coefficient = self.spline.curve(table)

        def net(speed):
            driving = coefficient(speed * rotor_radius / inflow_speed)
            return unit * driving - self.law.torque(speed, gains, *states)

        return net((1.0 - self.slowed) * rotor_speed) - net(rotor_speed) - LEAST * TYPICAL * unit

    def partial(self, name, quantities):
        if name != "torque_coefficient_table":
            return super().partial(name, quantities)
        names = "rotor_speed", "inflow_speed", "rotor_radius", "density"
        speed, flow, radius, density = (quantities[each] for each in names)
        ratio = speed * radius / flow
        bases = self.spline.basis((1.0 - self.slowed) * ratio) - self.spline.basis(ratio)
        return torque_scale(density, radius, flow)[:, None] * bases
