"""Control laws: generator torque from rotor speed (paper eqs. 1 to 4).

A law is a class with `gain_units` and `torque(speed, gains)`; nothing else knows its formula. Its
component differentiates it by complex step, so a new law is one class here and one entry in the
case schema (see docs/controllers.md).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import openmdao.api as om

STEP = 1e-40


def smooth_saturation(torque, limit, smoothing):
    """Return the smoothly saturated torque (paper eq. 4), N*m.

    sat(u) = limit/4 (2 + sqrt(nu + (2u/limit)²) - sqrt(nu + (2u/limit - 2)²)), nu = smoothing.
    It lies between 0 and the limit for every u, below the limit by nu limit / (16 (u/limit - 1))
    far above it, and gives limit/4 (2 + sqrt(nu) - sqrt(nu + 4)) for u = 0: 0.78 % of the limit at
    nu = 0.001.001, for
    u = 0.

    Parameters
    ----------
    torque : array, N*m
    limit : float, N*m
    smoothing : float
    """
    ratio = 2.0 * torque / limit
    return (
        0.25
        * limit
        * (2.0 + np.sqrt(smoothing + ratio**2) - np.sqrt(smoothing + (ratio - 2.0) ** 2))
    )


@dataclass(frozen=True)
class FeedbackLaw:
    """Generator torque as a function of rotor speed; subclasses give the formula.

    Parameters
    ----------
    torque_limit : float or None, N*m
        Upper limit of the smoothed saturation; None leaves the torque unlimited.
    smoothing : float
        nu of eq. 4.
    """

    torque_limit: float | None = None
    smoothing: float = 0.001

    gain_units: ClassVar[tuple[str, ...]] = ()

    def demand(self, speed, gains):
        """Return the torque before saturation, N*m, at speeds (rad/s) for gains[n_gains]."""
        raise NotImplementedError

    def torque(self, speed, gains):
        """Return the generator torque, N*m, at speeds (rad/s, any shape)."""
        demand = self.demand(speed, gains)
        if self.torque_limit is None:
            return demand
        return smooth_saturation(demand, self.torque_limit, self.smoothing)

    def fit(self, speed, torque):
        """Return the starting gains: their demand is closest to torques (N*m) at speeds (rad/s).

        Least squares over the demand's derivatives by gain, exact for a law that is linear in its
        gains; a law that is not overrides this.
        """
        ones = np.ones(len(self.gain_units))
        columns = [
            np.imag(self.demand(speed, ones + 1j * STEP * unit)) / STEP
            for unit in np.eye(ones.size)
        ]
        return np.linalg.lstsq(np.transpose(columns), torque, rcond=None)[0]

    def torque_by_speed(self, speed, gains):
        """Return the torque's derivative with respect to speed, N*m*s/rad, by complex step."""
        return np.imag(self.torque(speed + 1j * STEP, gains)) / STEP

    def torque_by_gain(self, speed, gains):
        """Return the torque's derivative by each gain, shape (n_gains, *speed.shape)."""
        steps = 1j * STEP * np.eye(len(gains))
        return np.array([np.imag(self.torque(speed, gains + step)) for step in steps]) / STEP


class LinearLaw(FeedbackLaw):
    """u = K1 w, paper eq. 1."""

    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s/rad",)

    def demand(self, speed, gains):
        """Return K1 w."""
        return gains[0] * speed


class QuadraticLaw(FeedbackLaw):
    """u = K2 w², paper eq. 2."""

    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s**2/rad**2",)

    def demand(self, speed, gains):
        """Return K2 w²."""
        return gains[0] * speed**2


LAWS: dict[str, type[FeedbackLaw]] = {"linear": LinearLaw, "quadratic": QuadraticLaw}
"""The feedback laws by the name that a case gives as `control.law`."""


class FeedbackComp(om.ExplicitComponent):
    """A feedback law at the nodes of a phase.

    Inputs rotor_speed[num_nodes] (rad/s) and one scalar gain_0, gain_1, … in the law's units;
    output control_torque[num_nodes] (N*m).
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare("num_nodes", types=int)
        self.options.declare("law", types=FeedbackLaw, recordable=False)

    def setup(self):
        """Declare inputs and outputs."""
        n = self.options["num_nodes"]
        self.add_input("rotor_speed", shape=(n,), units="rad/s", desc="angular speed of the rotor")
        for i, units in enumerate(self.options["law"].gain_units):
            self.add_input(
                f"gain_{i}",
                val=1.0,
                units=units,
                desc="feedback gain",
                tags=["dymos.static_target"],
            )
        self.add_output(
            "control_torque", shape=(n,), units="N*m", desc="generator torque on the rotor"
        )

    def setup_partials(self):
        """Declare the diagonal partial by speed and the column by each gain."""
        rows = np.arange(self.options["num_nodes"])
        self.declare_partials("control_torque", "rotor_speed", rows=rows, cols=rows)
        self.declare_partials("control_torque", "gain_*")

    def compute(self, inputs, outputs):
        """Evaluate the law."""
        outputs["control_torque"] = self.options["law"].torque(
            inputs["rotor_speed"], self._gains(inputs)
        )

    def compute_partials(self, inputs, partials):
        """Differentiate the law."""
        law, speed, gains = self.options["law"], inputs["rotor_speed"], self._gains(inputs)
        partials["control_torque", "rotor_speed"] = law.torque_by_speed(speed, gains)
        for i, column in enumerate(law.torque_by_gain(speed, gains)):
            partials["control_torque", f"gain_{i}"] = column[:, None]

    def _gains(self, inputs):
        return np.array(
            [inputs[f"gain_{i}"][0] for i in range(len(self.options["law"].gain_units))]
        )
