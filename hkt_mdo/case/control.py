"""The control law: section `control`, one class for each law."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hkt_mdo.sections import Quantity, Section


class Controller(Section):
    """What every control law has: its tag, and a limit on the control torque u."""

    law: str
    """The control law."""

    torque_limit: Annotated[float, Quantity("N*m", gt=0)] | None = None
    """Largest control torque u_max; null: no limit."""


class OpenLoop(Controller):
    """Open-loop optimal control: the torque over time is itself optimized, 0 <= u <= u_max."""

    law: Literal["open_loop"] = "open_loop"
    """The control law."""

    unknown: Literal["speed", "torque"] = "speed"
    """What the optimizer chooses over time: the rotor speed, from which the torque follows by
    inverse dynamics, or the torque itself, from which the speed follows by integration."""


class Feedback(Controller):
    """What every feedback law has: a gain that is optimized, and a smoothed saturation.

    With a torque limit g the torque is g/4 (2 + sqrt(nu + (2u/g)^2) - sqrt(nu + (2u/g - 2)^2))
    (paper, eq. 4), where u is the torque the law asks for.
    """

    smoothing: Annotated[float, Quantity(gt=0, le=1)] = 0.001
    """Smoothing nu of the saturation (paper, eq. 4); of no effect without a torque limit."""


class LinearFeedback(Feedback):
    """Linear feedback, u = K1 w (paper, eq. 1)."""

    law: Literal["linear"] = "linear"
    """The control law."""

    gain: Annotated[float, Quantity("N*m*s/rad", gt=0)] | None = None
    """Gain K1 at the start; null: chosen by the starting point."""


class QuadraticFeedback(Feedback):
    """Quadratic feedback, u = K2 w^2 (paper, eq. 2)."""

    law: Literal["quadratic"] = "quadratic"
    """The control law."""

    gain: Annotated[float, Quantity("N*m*s**2/rad**2", gt=0)] | None = None
    """Gain K2 at the start; null: chosen by the starting point."""


Control = Annotated[OpenLoop | LinearFeedback | QuadraticFeedback, Field(discriminator="law")]
"""Control law; `law` says which."""
