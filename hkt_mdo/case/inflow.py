"""The flow: section `inflow`, one class for each profile."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from hkt_mdo.case.base import Quantity, Section, refusal


class ConstantInflow(Section):
    """A steady flow."""

    profile: Literal["constant"] = "constant"
    """The kind of flow."""

    speed: Annotated[float, Quantity("m/s", gt=0)]
    """Inflow speed v."""


class StepInflow(Section):
    """A smoothed step (paper, eq. 9), v = before + (after - before)/(1 + e^(-(t - time)/width))."""

    profile: Literal["step"] = "step"
    """The kind of flow."""

    before: Annotated[float, Quantity("m/s", gt=0)] = 1.2
    """Inflow speed long before the step."""

    after: Annotated[float, Quantity("m/s", gt=0)] = 1.4
    """Inflow speed long after the step."""

    time: Annotated[float, Quantity("s")] = 30.0
    """Time of the middle of the step."""

    width: Annotated[float, Quantity("s", gt=0)] = 1.0
    """Time scale of the step; nine tenths of the change take about six widths."""


class SineInflow(Section):
    """A sinusoidal flow (paper, eq. 10), v = scale (mean + amplitude sin(w t + phase)).

    The uncertain flows of the paper's section V are this one with scale 1.1 (A), angular frequency
    0.225 rad/s (B) and phase 0.2 pi rad (C).
    """

    profile: Literal["sine"] = "sine"
    """The kind of flow."""

    mean: Annotated[float, Quantity("m/s", gt=0)] = 1.5
    """Mean inflow speed, before scaling."""

    amplitude: Annotated[float, Quantity("m/s", ge=0)] = 0.2
    """Amplitude of the inflow speed, before scaling; smaller than the mean."""

    angular_frequency: Annotated[float, Quantity("rad/s", gt=0)] = 0.25
    """Angular frequency of the inflow speed."""

    phase: Annotated[float, Quantity("rad")] = 0.0
    """Phase of the sine at t = 0."""

    scale: Annotated[float, Quantity(gt=0)] = 1.0
    """Factor on the whole flow."""

    @model_validator(mode="after")
    def _check_flow(self) -> SineInflow:
        if self.amplitude >= self.mean:
            raise refusal(
                f"lets the flow reach zero or turn back: its mean is {self.mean:g} m/s",
                "give an amplitude smaller than inflow.mean",
                key="amplitude",
                value=self.amplitude,
            )
        return self


Inflow = Annotated[ConstantInflow | StepInflow | SineInflow, Field(discriminator="profile")]
"""Inflow speed over time; `profile` says which kind."""
