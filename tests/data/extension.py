"""An extension with kinds of each sort, written against the public names alone."""

from typing import Annotated, ClassVar, Literal

import numpy as np

from hkt_mdo import Aggregate, FeedbackLaw, Inflow, Limit, Objective, Quantity


class TipAcceleration(Limit):
    """Largest centripetal acceleration of the blade tip, w^2 R."""

    name: ClassVar[str] = "tip_acceleration"
    unit: ClassVar[str] = "m/s**2"
    inputs: ClassVar[tuple[str, ...]] = ("rotor_speed", "rotor_radius")

    bound: Annotated[float, Quantity("m/s**2", gt=0)]
    """Largest tip acceleration."""

    def value(self, rotor_speed, rotor_radius):
        return rotor_speed**2 * rotor_radius


class LargestMass(Limit):
    """Largest mass of the blades: a quantity of the design."""

    name: ClassVar[str] = "mass"
    unit: ClassVar[str] = "kg"
    inputs: ClassVar[tuple[str, ...]] = ("mass",)

    bound: Annotated[float, Quantity("kg", gt=0)]
    """Largest mass."""


class LargestChord(Limit):
    """Largest chord anywhere: a quantity along the span."""

    name: ClassVar[str] = "chord"
    unit: ClassVar[str] = "m"
    inputs: ClassVar[tuple[str, ...]] = ("chord",)

    bound: Annotated[float, Quantity("m", gt=0)]
    """Largest chord."""


class LeastEnergy(Limit):
    """Least energy that the rotor captures: a quantity of the result."""

    name: ClassVar[str] = "least_energy"
    unit: ClassVar[str] = "J"
    inputs: ClassVar[tuple[str, ...]] = ("energy",)
    upper: ClassVar[float] = np.inf

    bound: Annotated[float, Quantity("J", gt=0)]
    """Least energy."""

    @property
    def lower(self):
        return self.bound


class ThrustImpulse(Objective):
    """The integral of the thrust, made as small as possible: a load over time."""

    kind: ClassVar[str] = "thrust"
    unit: ClassVar[str] = "N*s"
    maximize: ClassVar[bool] = False
    inputs: ClassVar[tuple[str, ...]] = ("thrust",)

    def rate(self, thrust):
        return thrust


class BladeMass(Objective):
    """The mass of the blades, made as small as possible: a value of the design."""

    kind: ClassVar[str] = "mass"
    unit: ClassVar[str] = "kg"
    maximize: ClassVar[bool] = False
    inputs: ClassVar[tuple[str, ...]] = ("mass",)

    def value(self, mass):
        return mass


class Smallest(Aggregate):
    """The smallest of the scenarios' mean rates, as the largest number at or below each of them."""

    measure: ClassVar[str] = "smallest"
    n_unknowns: ClassVar[int] = 1

    def value(self, rates, shares, unknowns):
        return unknowns[0]

    def rows(self, rates, shares, unknowns):
        return rates - unknowns[0]

    def best_unknowns(self, rates, shares):
        return np.array([np.min(rates)])


class PricedTorque(Objective):
    """Captured energy less a price on the mean squared torque."""

    kind: Literal["priced_torque"] = "priced_torque"
    """What is maximized."""

    price: Annotated[float, Quantity("W/(N**2*m**2)", ge=0)] = 1e-4
    """Price of a squared torque."""

    inputs: ClassVar[tuple[str, ...]] = ("hydrodynamic_power", "control_torque")

    def rate(self, hydrodynamic_power, control_torque):
        return hydrodynamic_power - self.price * control_torque**2


class OffsetQuadratic(FeedbackLaw):
    """Quadratic feedback with a linear part, u = K1 w + K2 w^2."""

    law: Literal["mixed"] = "mixed"
    """The control law."""

    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s/rad", "N*m*s**2/rad**2")

    def demand(self, speed, gains):
        return gains[0] * speed + gains[1] * speed**2


class Ramp(Inflow):
    """A flow that rises smoothly, v = before + rise (t/time)^2 / (1 + (t/time)^2)."""

    profile: Literal["ramp"] = "ramp"
    """The kind of flow."""

    before: Annotated[float, Quantity("m/s", gt=0)] = 1.3
    """Speed at t = 0."""

    rise: Annotated[float, Quantity("m/s")] = 0.4
    """Rise after a long time."""

    time: Annotated[float, Quantity("s", gt=0)] = 20.0
    """Time of half the rise."""

    @property
    def highest_frequency(self):
        return 1.0 / self.time

    def speed_at(self, time):
        share = (np.asarray(time) / self.time) ** 2
        return self.before + self.rise * share / (1.0 + share)
