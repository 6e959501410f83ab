"""A control law with a state: quadratic feedback of a speed that a filter delays.

hkt --extend cases/examples/files/filtered_quadratic.py run cases/sine_limited_quadratic.yaml \
    --set "control={law: filtered_quadratic, torque_limit: 700}" --out results/filtered_quadratic
"""

from typing import Annotated, ClassVar, Literal

import numpy as np

from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.sections import Quantity


class FilteredQuadratic(FeedbackLaw):
    """Torque K f² of a filtered speed f, which follows the rotor's by f' = (w - f) / lag."""

    law: Literal["filtered_quadratic"] = "filtered_quadratic"
    """The control law."""
    lag: Annotated[float, Quantity("s", gt=0)] = 0.1
    """Time constant of the filter."""

    gain_units: ClassVar[tuple[str, ...]] = ("N*m*s**2/rad**2",)
    states: ClassVar[dict[str, tuple[str, str]]] = {
        "filtered_speed": ("rad/s", "rotor speed behind the filter")
    }

    def demand(self, speed, gains, filtered_speed):
        """Return K f², N*m, at any shape; all arguments may be complex."""
        return gains[0] * filtered_speed**2

    def rates(self, speed, inflow_speed, gains, filtered_speed):
        """Return the rate of the state, rad/s^2."""
        return ((speed - filtered_speed) / self.lag,)

    def at_rest(self, torque, inflow_speed):
        """Return a guess of the state in equilibrium, rad/s."""
        return (5.0 * inflow_speed,)

    def speed_at_rest(self, inflow_speed, gains):
        """Return a guess of the rotor's speed in equilibrium, rad/s."""
        return 5.0 * inflow_speed

    def follow(self, inflow_speed, speed, torque, slope):
        """Return the gain with which equilibria are nearest to speeds and torques of a schedule."""
        return np.array([np.sum(torque * speed**2) / np.sum(speed**4)])
