"""The wake's memory: Øye's two filters of the velocities that it induces at every station.

Direct BEM gives the velocity q that a wake in equilibrium would induce, axial (a V) and tangential
(a' w r). A wake that is not in equilibrium induces the velocity z instead (docs/theory.md):

    tau1 x' = (1 - k) q - x,    tau2 z' = x + k q - z.

This is the reduced form of y + tau1 y' = q + k tau1 q', z + tau2 z' = y, with x = y - k q, which
needs no rate of q. The sections see the velocity z, and their forces follow from it by the polars.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.band import place_shares
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.reynolds import LocalReynolds

AT_ONCE = 0.6
"""Øye's k: the share of a change that does not pass through the slow filter."""
MOST_INDUCTION = 0.5
"""Axial induction above which the slow filter's time constant grows no more."""


def fast_share(places):
    """Return the fast filter's time constant over the slow one's, at radii over the tip's."""
    return 0.39 - 0.26 * places**2


@dataclass(frozen=True, eq=False)
class Wake:
    """The filters of a blade's wake; tau1 (s) is the time constant of the slow ones.

    Without tau1 it is 1.1 R / ((1 - 1.3 a) V), a the axial induction at 0.7 R in equilibrium.

    The state of the filters is an array (..., 4 n_stations): x, then z of the module's equations,
    each of the axial velocity against the flow and then of the tangential one, with the rotation of
    the blades, in m/s.
    """

    blade: Blade
    polar: Polar | tuple[Polar, ...] | LocalReynolds
    tau1: float | None = None

    @cached_property
    def _spread(self):
        """Share of each station in the induction at 0.7 R, and tau2 over tau1 of each."""
        places = self.blade.r / self.blade.tip_radius
        return place_shares(places), fast_share(places)

    def _polar(self, flow):
        polar = self.polar
        return polar.at_speed(flow) if isinstance(polar, LocalReynolds) else polar

    def _ratio(self, speed, flow):
        """Return the tip speed ratio along the blade, and the flow's speed normal to it, m/s."""
        blade = self.blade
        return speed * blade.tip_radius / flow, flow * np.cos(blade.cone)

    def balanced(self, speed, flow):
        """Return the velocities that a wake in equilibrium induces, m/s, (n_points, 2 n_stations).

        speed (rad/s) and flow (m/s) have the shape (n_points,).
        """
        ratio, normal = self._ratio(speed, flow)
        found = bem.sections(self.blade, self._polar(flow), ratio)
        induced = normal[:, None, None] * bem.induced_speeds(self.blade, found, ratio)
        return induced.reshape(ratio.size, -1)

    def at_rest(self, speed, flow):
        """Return the state of filters in equilibrium, (n_points, 4 n_stations)."""
        induced = self.balanced(speed, flow)
        return np.concatenate(((1.0 - AT_ONCE) * induced, induced), axis=-1)

    def times(self, flow, balanced):
        """Return tau1 (n_points, 1) and tau2 (n_points, n_stations), s."""
        share, factors = self._spread
        if self.tau1 is not None:
            slow = np.full((flow.size, 1), self.tau1)
        else:
            normal = flow * np.cos(self.blade.cone)
            induction = balanced[:, : share.size] @ share / normal
            kept = 1.0 - 1.3 * np.minimum(induction, MOST_INDUCTION)
            slow = (1.1 * self.blade.rotor_radius / (kept * flow))[:, None]
        return slow, factors * slow

    def rates(self, filters, flow, balanced):
        """Return the rates of the filters' state, of its shape, m/s²; points in one row."""
        slow, fast = self.times(flow, balanced)
        reduced, induced = np.split(filters, 2, axis=-1)
        first = ((1.0 - AT_ONCE) * balanced - reduced) / slow
        second = (reduced + AT_ONCE * balanced - induced) / np.tile(fast, 2)
        return np.concatenate((first, second), axis=-1)

    def sections(self, speed, flow, filters):
        """Return the `Sections` under the filters' velocities, (n_points, n_filters)."""
        ratio, normal = self._ratio(speed, flow)
        induced = filters[:, filters.shape[1] // 2 :].reshape(ratio.size, 2, -1)
        induced = induced / normal[:, None, None]
        return bem.sections_with(self.blade, self._polar(flow), ratio, induced)
