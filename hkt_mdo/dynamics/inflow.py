"""Inflow speed over time (paper Sec. IV and V), and its component inside the ODE."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import openmdao.api as om


class Inflow(Protocol):
    """A flow: speed(t) in m/s and its rate(t) in m/s², for t in s of any shape; complex-safe."""

    def speed(self, time):
        """Return the inflow speed, m/s."""

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""


@dataclass(frozen=True)
class ConstantInflow:
    """v(t) = value (m/s)."""

    value: float

    def speed(self, time):
        """Return the inflow speed, m/s."""
        return self.value + 0.0 * np.asarray(time)

    def rate(self, time):
        """Return zero, m/s²."""
        return 0.0 * np.asarray(time)


@dataclass(frozen=True)
class StepInflow:
    """v(t) = before + (after - before) / (1 + exp(-(t - time) / width)), paper eq. 9 (m/s, s)."""

    before: float
    after: float
    time: float
    width: float

    def speed(self, time):
        """Return the inflow speed, m/s."""
        # tanh form: the exponential of eq. 9 would overflow long before the step
        tanh = np.tanh(0.5 * (np.asarray(time) - self.time) / self.width)
        return 0.5 * (self.before + self.after) + 0.5 * (self.after - self.before) * tanh

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        tanh = np.tanh(0.5 * (np.asarray(time) - self.time) / self.width)
        return 0.25 * (self.after - self.before) / self.width * (1.0 - tanh**2)


@dataclass(frozen=True)
class SineInflow:
    """v(t) = scale (mean + amplitude sin(w t + phase)), paper eq. 10 and its flows A, B and C.

    Speeds in m/s, angular frequency in rad/s, phase in rad.
    """

    mean: float
    amplitude: float
    angular_frequency: float
    phase: float = 0.0
    scale: float = 1.0

    def speed(self, time):
        """Return the inflow speed, m/s."""
        angle = self.angular_frequency * np.asarray(time) + self.phase
        return self.scale * (self.mean + self.amplitude * np.sin(angle))

    def rate(self, time):
        """Return the speed's derivative with respect to time, m/s²."""
        angle = self.angular_frequency * np.asarray(time) + self.phase
        return self.scale * self.amplitude * self.angular_frequency * np.cos(angle)


class InflowComp(om.ExplicitComponent):
    """Inflow speed at the nodes of a phase.

    Input time[num_nodes] (s); output inflow_speed[num_nodes] (m/s).
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare("num_nodes", types=int)
        self.options.declare("inflow", desc="the flow, an `Inflow`", recordable=False)

    def setup(self):
        """Declare inputs and outputs."""
        n = self.options["num_nodes"]
        self.add_input(
            "time", shape=(n,), units="s", desc="time since the start", tags=["dymos.targets:time"]
        )
        self.add_output(
            "inflow_speed", shape=(n,), units="m/s", desc="undisturbed flow speed at the rotor"
        )

    def setup_partials(self):
        """Declare the diagonal partial."""
        rows = np.arange(self.options["num_nodes"])
        self.declare_partials("inflow_speed", "time", rows=rows, cols=rows)

    def compute(self, inputs, outputs):
        """Evaluate the flow."""
        outputs["inflow_speed"] = self.options["inflow"].speed(inputs["time"])

    def compute_partials(self, inputs, partials):
        """Evaluate its rate."""
        partials["inflow_speed", "time"] = self.options["inflow"].rate(inputs["time"])
