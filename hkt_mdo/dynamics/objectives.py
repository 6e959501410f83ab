"""Objectives, which the optimization maximizes or minimizes.

An objective of your own is a subclass of `Objective` (docs/dev/architecture.md).
"""

from typing import Any, ClassVar, Literal

import numpy as np

from hkt_mdo.dynamics.formulas import Formula


class Objective(Formula):
    """The integral over time of a rate, or a value of the design.

    A subclass has either `rate` or `value`. Both take the quantities that `inputs` names
    (`hkt_mdo.quantities`) as keyword arguments, as `Limit.value` does, and must accept complex
    numbers, too. Over several scenarios the mean of a rate is taken as `robustness` says.
    """

    named_by: ClassVar[str] = "kind"
    kind: str
    """What is optimized."""
    unit: ClassVar[str | None] = "J"
    """Unit of the integral of the rate, or of the value."""
    maximize: ClassVar[bool] = True
    """Whether it is maximized; otherwise it is minimized."""
    closes: ClassVar[bool] = False
    """Whether it counts the kinetic energy with which the rotor begins, unless it ends at its
    initial speed: its bound holds over a closed cycle only."""

    def rate(self, **quantities: Any) -> Any:
        """Return the rate, `unit` a second, shape (n_times,)."""
        raise NotImplementedError

    @property
    def is_rate(self) -> bool:
        """Whether it is the integral of a rate."""
        return type(self).rate is not Objective.rate

    @property
    def function(self):
        """The rate, or the value if it has none."""
        return self.rate if self.is_rate else self.value

    @property
    def function_unit(self):
        rate = f"({self.unit})/s" if self.unit else "1/s"
        return rate if self.is_rate else self.unit

    @property
    def is_energy(self) -> bool:
        """Whether it is an energy that is maximized."""
        return self.is_rate and self.maximize and self.unit == "J"

    @property
    def sign(self) -> float:
        """1 where a larger objective is better, -1 where a smaller one is."""
        return 1.0 if self.maximize else -1.0

    def rate_of(self, quantities: Any) -> np.ndarray:
        """Return the rate, shape (n_times,), from a trajectory and what is known of the design."""
        return self.value_of(quantities) * np.ones(np.shape(quantities["time"]))

    def behind(self, objective: float, reference: float) -> float:
        """Return by which share of a reference an objective is worse; negative if it is better."""
        return self.sign * (reference - objective) / max(abs(reference), 1e-300)

    def bound(self, captured: float) -> float | None:
        """Return an upper bound, J, over a closed cycle if it `closes`; None: none is known.

        `captured` is the bound on the captured energy, J, by quasi-steady operation
        (docs/checks.md).
        """
        return None


class _Energy(Objective):
    """The integral of one power; none exceeds the captured energy, as no loss is negative."""

    def rate(self, **power):
        return self.value(**power)

    def bound(self, captured):
        return captured


class CapturedEnergy(_Energy):
    """The energy that the rotor takes from the flow, the integral of Q w (paper, eq. 7)."""

    kind: Literal["captured"] = "captured"
    """What is maximized."""
    inputs: ClassVar[tuple[str, ...]] = ("hydrodynamic_power",)


class GeneratorEnergy(_Energy):
    """The energy that the generator takes from the shaft, the integral of u w."""

    closes: ClassVar[bool] = True

    kind: Literal["generator"] = "generator"
    """What is maximized."""
    inputs: ClassVar[tuple[str, ...]] = ("generator_power",)


class ElectricalEnergy(_Energy):
    """The energy that the generator delivers, the integral of u w less its losses (`generator`)."""

    closes: ClassVar[bool] = True

    kind: Literal["electrical"] = "electrical"
    """What is maximized."""
    inputs: ClassVar[tuple[str, ...]] = ("electrical_power",)


INTEGRALS: dict[str, Objective] = {
    "energy": CapturedEnergy(),
    "generator_energy": GeneratorEnergy(),
    "electrical_energy": ElectricalEnergy(),
}
"""Integrals over all scenarios, by name: the quantities over the whole result."""
