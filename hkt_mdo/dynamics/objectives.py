"""Objectives: what the optimization makes as large as it can, an integral over the trajectory.

An objective of your own is a subclass of `Objective` (docs/architecture.md).
"""

from typing import ClassVar, Literal

import numpy as np

from hkt_mdo.sections import Section


class Objective(Section):
    """The integral over time of a rate, J, which is made as large as possible.

    `rate` takes the quantities that `inputs` names as keyword arguments, as `Limit.value` does, and
    must accept complex numbers, too.
    """

    kind: str
    """What is maximized."""
    inputs: ClassVar[tuple[str, ...]] = ()
    closes: ClassVar[bool] = False
    """Whether it could sell the rotor's kinetic energy, so that the cycle of an open loop is closed
    by default: the rotor ends at its initial speed."""

    def rate(self, **quantities):
        """Return the rate, W, shape (n_times,)."""
        raise NotImplementedError

    def rate_of(self, quantities):
        """Return the rate, W, shape (n_times,), from a trajectory and the design's scalars."""
        rate = self.rate(**{name: quantities[name] for name in self.inputs})
        return rate * np.ones(quantities["time"].size)

    def bound(self, captured: float) -> float | None:
        """Return an upper bound, J, over a closed cycle if it `closes`; None: none is known.

        `captured` is that of the captured energy, J, by quasi-steady operation (docs/theory.md).
        """
        return None


class CapturedEnergy(Objective):
    """The energy that the rotor takes from the flow, the integral of Q w (paper, eq. 5)."""

    kind: Literal["captured"] = "captured"
    """What is maximized."""
    inputs: ClassVar[tuple[str, ...]] = ("hydrodynamic_power",)

    def rate(self, hydrodynamic_power):
        return hydrodynamic_power

    def bound(self, captured):
        return captured


class GeneratorEnergy(Objective):
    """The energy that the generator takes from the shaft, the integral of u w."""

    closes: ClassVar[bool] = True

    kind: Literal["generator"] = "generator"
    """What is maximized."""
    inputs: ClassVar[tuple[str, ...]] = ("generator_power",)

    def rate(self, generator_power):
        return generator_power

    def bound(self, captured):
        return captured


class ElectricalEnergy(Objective):
    """The energy that the generator delivers, the integral of u w less its losses.

    The section `generator` says what these are; where they exceed the shaft's power, energy is
    drawn from the grid and counts against the rest.
    """

    closes: ClassVar[bool] = True

    kind: Literal["electrical"] = "electrical"
    """What is maximized."""
    inputs: ClassVar[tuple[str, ...]] = ("electrical_power",)

    def rate(self, electrical_power):
        return electrical_power

    def bound(self, captured):
        return captured  # no loss is negative
