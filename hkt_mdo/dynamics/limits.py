"""Limits: what a design and its operation must keep, each stated once.

The optimization holds a limit at the nodes, the judges look at it there, between the nodes and on
the independent integration, `hkt check` on the start, the summary and the figures show it. All of
them ask the limit for its value; nobody else knows the formula. A limit of your own is a subclass
of `Limit` (docs/architecture.md).
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from pydantic import model_validator

from hkt_mdo.dynamics.laws import Law, OpenLoop
from hkt_mdo.dynamics.trajectory import QUANTITIES
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.sections import Section

STEP = 1e-40  # of complex-step differentiation
SLOWED = 0.02  # share of its speed that a rotor may lose and still recover from
TYPICAL = 0.05  # torque coefficient to which a recovery torque is compared
LEAST = 5e-3  # recovery over a typical torque that a trajectory keeps; closer to stall it is slow


class Limit(Section):
    """A quantity that must stay between `lower` and `upper`.

    `value` takes the quantities that `inputs` names as keyword arguments and must accept complex
    numbers, for its derivatives are taken by complex step. The quantities are those of the
    trajectory (`hkt_mdo.dynamics.trajectory.QUANTITIES`), arrays of shape (n_times,), and the
    scalars rotor_radius (m), density (kg/m**3) and inertia (kg*m**2).

    A limit that a case may give under `limits` has a `name`, a `unit` and usually one field,
    `bound`, a `Quantity`: then `limits: {name: 15 m/s}` is short for `{name: {bound: 15 m/s}}`.
    """

    name: ClassVar[str] = ""
    unit: ClassVar[str | None] = None
    inputs: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def _bare_bound(cls, data: Any) -> Any:
        """Take a number or text for the field `bound`."""
        bare = "bound" in cls.model_fields and isinstance(data, str | int | float)
        return {"bound": data} if bare and not isinstance(data, bool) else data

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> Any:
        """Return the JSON schema: a section, or the value of `bound` alone."""
        whole = handler(schema)
        bound = handler.resolve_ref_schema(whole)["properties"].get("bound")
        return {"anyOf": [bound, whole]} if bound else whole

    @property
    def place(self) -> str:
        """What its value is an array over: the "time", or the "design" if only scalars are in it.

        Of `DesignBounds` also the "span" of the blade.
        """
        return "time" if QUANTITIES.keys() & set(self.inputs) else "design"

    @property
    def lower(self) -> Any:
        """Lower bound, in `unit`."""
        return -np.inf

    @property
    def upper(self) -> Any:
        """Upper bound, in `unit`."""
        return getattr(self, "bound", np.inf)

    def value(self, **quantities: Any) -> Any:
        """Return the limited quantity, in `unit`."""
        raise NotImplementedError

    def constrains(self, control: Law) -> bool:
        """Tell whether the optimization needs a constraint to hold it under a control law."""
        return True

    def partials(self, **quantities: Any) -> dict[str, np.ndarray]:
        """Return the value's derivative by each input, by complex step.

        Shape (n_times,) for a quantity over time and for a scalar.
        """
        found = {}
        for name in self.inputs:
            moved = {**quantities, name: quantities[name] + 1j * STEP}
            found[name] = np.imag(self.value(**moved)) / STEP
        return found

    def excess(self, quantities: Any) -> np.ndarray:
        """Return how far the value leaves its bounds, over their size; at most 0 where it is kept.

        Parameters
        ----------
        quantities : mapping of str to array
            At least those of `inputs`.
        """
        value = np.atleast_1d(self.value(**{name: quantities[name] for name in self.inputs}))
        ends = np.abs(np.r_[np.atleast_1d(self.lower), np.atleast_1d(self.upper)])
        size = np.max(ends[np.isfinite(ends)], initial=0.0) or np.max(np.abs(value)) or 1.0
        return np.asarray(np.maximum(self.lower - value, value - self.upper) / size)


class TorqueLimit(Limit):
    """The generator's torque: never driving the rotor, and at most `control.torque_limit`."""

    name: ClassVar[str] = "control_torque"
    unit: ClassVar[str | None] = "N*m"
    inputs: ClassVar[tuple[str, ...]] = ("control_torque",)

    bound: float | None = None

    @property
    def lower(self):
        """Zero: the generator does not drive the rotor."""
        return 0.0

    @property
    def upper(self):
        """The torque limit, N*m."""
        return np.inf if self.bound is None else self.bound

    def value(self, control_torque):
        """Return the control torque, N*m."""
        return control_torque

    def constrains(self, control):
        """Tell that open loop in speed needs it; a law saturates, a control has bounds."""
        return isinstance(control, OpenLoop) and control.unknown == "speed"


class ForwardRotation(Limit):
    """The rotor turns forward; the bounds of its speed in the optimization hold this."""

    name: ClassVar[str] = "rotor_speed"
    unit: ClassVar[str | None] = "rad/s"
    inputs: ClassVar[tuple[str, ...]] = ("rotor_speed",)

    @property
    def lower(self):
        """Zero."""
        return 0.0

    def value(self, rotor_speed):
        """Return the rotor speed, rad/s."""
        return rotor_speed

    def constrains(self, control):
        """Tell that no constraint is needed."""
        return False


class DesignBounds(Limit):
    """Bounds of the case on a design variable: chord, twist, set angle, radius or gains."""

    quantity: str
    """Name of the design variable."""

    bounds: tuple[float, float]
    """Lower and upper bound, in SI units."""

    @property
    def inputs(self):  # type: ignore[override]
        """The design variable."""
        return (self.quantity,)

    @property
    def name(self):  # type: ignore[override]
        """The design variable."""
        return self.quantity

    @property
    def place(self):
        """Chord and twist are arrays over the span."""
        return "span" if self.quantity in ("chord", "twist") else "design"

    @property
    def lower(self):
        """Lower bound."""
        return self.bounds[0]

    @property
    def upper(self):
        """Upper bound."""
        return self.bounds[1]

    def value(self, **quantities):
        """Return the design variable."""
        return quantities[self.quantity]

    def constrains(self, control):
        """Tell that no constraint is needed: the optimizer bounds its variables itself."""
        return False


class DistanceFromStall(Limit):
    """A rotor under feedback recovers from a small loss of speed.

    N((1 - slowed) w) - N(w) >= least, N = Q(w, v) - u(w): positive where the rotor keeps a distance
    from stall, where stable and unstable equilibrium meet. Collocation cannot tell one from the
    other, so an optimizer would go to that edge and beyond. N(w) = I dw/dt is what the flow's
    changes ask for, and no stall. `least` is a share of a typical torque, TYPICAL 0.5 rho pi R³ v²:
    close to stall a rotor recovers slowly and the problem is badly conditioned.

    Q comes from the torque curve: Cq = spline.basis(w R/v) @ torque_coefficient_table.
    """

    name: ClassVar[str] = "distance_from_stall"
    unit: ClassVar[str | None] = "N*m"
    inputs: ClassVar[tuple[str, ...]] = (
        "rotor_speed",
        "inflow_speed",
        "torque_coefficient_table",
        "density",
        "rotor_radius",
        "gains",
    )

    law: Any
    spline: Any
    slowed: float = SLOWED
    least: float = LEAST

    @property
    def lower(self):
        """Zero: what is asked for is subtracted from the value."""
        return 0.0

    def _net(self, share, q):
        """Return N at a share of the rotor's speed, shape (n_times,), and its derivatives."""
        v, radius, table = q["inflow_speed"], q["rotor_radius"], q["torque_coefficient_table"]
        gains, speed = q["gains"], share * q["rotor_speed"]
        scale, ratio = torque_scale(q["density"], radius, v), speed * radius / v
        basis = self.spline.basis(ratio)
        driving = scale * (basis @ table)
        sloped = scale * (self.spline.basis(ratio, 1) @ table) * ratio
        by = {
            "rotor_speed": share * (sloped / speed - self.law.torque_by_speed(speed, gains)),
            "torque_coefficient_table": scale[:, None] * basis,
            "rotor_radius": (3.0 * driving + sloped) / radius,
            "inflow_speed": (2.0 * driving - sloped) / v,
            "density": driving / q["density"],
            "gains": -self.law.torque_by_gain(speed, gains).T,
        }
        return driving - self.law.torque(speed, gains), by

    def _asked(self, q):
        """Return the recovery torque that is asked for, N*m."""
        unit = torque_scale(q["density"], q["rotor_radius"], q["inflow_speed"])
        return self.least * TYPICAL * unit

    def value(self, **quantities):
        """Return the recovery torque beyond what is asked for, N*m, shape (n_times,)."""
        slowed, here = self._net(1.0 - self.slowed, quantities), self._net(1.0, quantities)
        return slowed[0] - here[0] - self._asked(quantities)

    def partials(self, **quantities):
        """Return the value's derivative by each input."""
        slowed, here = self._net(1.0 - self.slowed, quantities)[1], self._net(1.0, quantities)[1]
        found = {name: slowed[name] - here[name] for name in slowed}
        for name, power in (("rotor_radius", 3.0), ("inflow_speed", 2.0), ("density", 1.0)):
            found[name] -= power * self._asked(quantities) / quantities[name]
        return found
