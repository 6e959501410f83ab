"""The flow's speed as a controller estimates it from the rotor's speed and torque."""

from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from hkt_mdo.dynamics.simulation import SLOWEST_RATIO, Plant
from hkt_mdo.rotor.scales import torque_scale


class FlowEstimate:
    """The speed of the flow in which a rotor has a torque, by a model of the rotor.

    Q = u + F + J dw/dt, F the friction of the shaft, and Q / (w R)² falls with the tip speed ratio
    about that of the largest power. In that range each value belongs to one ratio; a stalled rotor
    is estimated to be at its end.
    `plant` is the rotor that the controller assumes: the estimate is wrong if the actual water,
    blade or inertia differ. A call raises InputError for polars that follow the Reynolds number:
    then there is no curve over the tip speed ratio alone.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant

    @cached_property
    def ratio_of(self):
        """The tip speed ratio as a function of the torque coefficient over its square."""
        ratio = np.concatenate((np.arange(SLOWEST_RATIO, 4.0, 0.02), np.arange(4.0, 20.0, 0.01)))
        share = self.plant.coefficient(ratio) / ratio**2
        best = int(np.argmax(share * ratio**3))
        # where a part begins in which it falls, and behind the last
        begins = np.flatnonzero(np.concatenate(([True], np.diff(share) >= 0.0, [True])))
        after = np.searchsorted(begins, best, side="right")
        falling = slice(begins[after - 1], begins[after])
        return PchipInterpolator(share[falling][::-1], ratio[falling][::-1])

    def __call__(self, speed, torque, acceleration):
        """Return the flow's speed, m/s, by the rotor's (rad/s), the generator's torque and dw/dt.

        The arguments are of one shape, the torque in N*m, the acceleration in rad/s**2.
        """
        tip = speed * self.plant.blade.rotor_radius
        driving = torque + self.plant.generator.friction(speed) + self.plant.inertia * acceleration
        unit = torque_scale(self.plant.density, self.plant.blade.rotor_radius, tip)
        return tip / self.ratio_of(np.clip(driving / unit, self.ratio_of.x[0], self.ratio_of.x[-1]))
