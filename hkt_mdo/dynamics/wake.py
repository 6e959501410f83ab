"""The wake's memory: Øye's two filters of the velocities that it induces at every station.

Direct BEM gives the velocity q that a wake in equilibrium would induce, axial (a V) and tangential
(a' w r). A wake that is not in equilibrium induces the velocity z instead (docs/dynamic_inflow.md):

    tau1 x' = (1 - k) q - x,    tau2 z' = x + k q - z.

This is the reduced form of y + tau1 y' = q + k tau1 q', z + tau2 z' = y, with x = y - k q, which
needs no rate of q. The sections see the velocity z, and their forces follow from it by the polars.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.band import Band, fast_share, place_shares
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.polars import Polars

AT_ONCE = 0.6
"""Øye's k: the share of a change that does not pass through the slow filter."""
SLOW = 1.1
"""tau1 (1 - 1.3 a) V / R, where tau1 follows from the induction."""
MOST_INDUCTION = 0.5
"""Axial induction above which the slow filter's time constant grows no more."""
SLOWEST_RATIO = 0.05
"""Tip speed ratio at which a rotor counts as standing still; a slower one has its wake there."""
FINER = 4
"""Intervals of `MeanWake`'s table in one of the optimization's."""


def slow_time(tau1, induction, radius, flow):
    """Return the slow filter's time constant, s: tau1, or if it is None that by the induction.

    That is 1.1 R / ((1 - 1.3 a) V), a the axial induction at 0.7 R in equilibrium; it, the radius R
    of the disc (m) and the flow's speed V (m/s) may be complex.
    """
    if tau1 is not None:
        return tau1
    factor = 1.0 - 1.3 * np.where(np.real(induction) < MOST_INDUCTION, induction, MOST_INDUCTION)
    return SLOW * radius / (factor * flow)


@dataclass(frozen=True, eq=False)
class Wake:
    """The filters of a blade's wake; tau1 is that of `slow_time`.

    The state of the filters is an array (..., 4 n_stations): x, then z of the module's equations,
    each of the axial velocity against the flow and then of the tangential one, with the rotation of
    the blades, in m/s.
    """

    blade: Blade
    polar: Polars
    tau1: float | None = None

    @cached_property
    def share(self):
        """Time constant of the fast filters over that of the slow ones, by station."""
        return fast_share(self.blade.r / self.blade.tip_radius)

    def _ratio(self, speed, flow):
        """Return the tip speed ratio, and the flow's speed normal to the blade, m/s."""
        ratio = np.maximum(speed * self.blade.rotor_radius / flow, SLOWEST_RATIO)
        return ratio, flow * np.cos(self.blade.cone)

    def balanced(self, speed, flow):
        """Return the velocities that a wake in equilibrium induces, m/s, and the axial at 0.7 R.

        They have the shapes (n_points, 2 n_stations) and (n_points,); speed (rad/s) and flow (m/s)
        have the latter.
        """
        ratio, normal = self._ratio(speed, flow)
        sections = bem.sections(self.blade, self.polar.in_flow(flow), ratio)
        induced = normal[:, None, None] * bem.induced_speeds(self.blade, sections, ratio)
        at_place = induced[:, 0] @ place_shares(self.blade.r / self.blade.tip_radius)
        return induced.reshape(ratio.size, -1), at_place

    def at_rest(self, speed, flow):
        """Return the state of filters in equilibrium, (n_points, n_filters)."""
        induced, _ = self.balanced(speed, flow)
        return np.concatenate(((1.0 - AT_ONCE) * induced, induced), axis=-1)

    def times(self, flow, at_place):
        """Return tau1 (n_points, 1) and tau2 (n_points, n_stations), s.

        at_place is the axial velocity that is induced in equilibrium at 0.7 R, m/s, (n_points,).
        """
        induction = at_place / (flow * np.cos(self.blade.cone))
        slow = slow_time(self.tau1, induction, self.blade.rotor_radius, flow)
        slow = np.broadcast_to(slow, flow.shape)[:, None]
        return slow, self.share * slow

    def rates(self, filters, flow, balanced):
        """Return the rates of the filters' state, of its shape, m/s²; points in one row."""
        steady, at_place = balanced
        slow, fast = self.times(flow, at_place)
        reduced, induced = np.split(filters, 2, axis=-1)
        first = ((1.0 - AT_ONCE) * steady - reduced) / slow
        fast = np.tile(fast, steady.shape[-1] // fast.shape[-1])
        return np.concatenate((first, (reduced + AT_ONCE * steady - induced) / fast), axis=-1)

    def sections(self, speed, flow, filters):
        """Return the `Sections` under the filters' velocities, (n_points, n_filters)."""
        ratio, normal = self._ratio(speed, flow)
        induced = filters[:, filters.shape[1] // 2 :].reshape(ratio.size, 2, -1)
        induced = induced / normal[:, None, None]
        return bem.sections_with(self.blade, self.polar.in_flow(flow), ratio, induced)


@dataclass(frozen=True, eq=False)
class MeanWake(Wake):
    """The two filters of the optimization: those of a mean axial velocity of the wake.

    The wake at every station is that of the tip speed ratio at which a wake in equilibrium has this
    mean velocity (`hkt_mdo.rotor.band`). Torque and mean velocity are those of direct BEM; the tip
    speed ratio of the wake is found by a table of the mean velocity, `FINER` times finer than that
    of the optimization.

    The state of the filters is an array (n_points, 2): the reduced velocity and the mean velocity.
    """

    band: Band = None  # type: ignore[assignment]

    @property
    def share(self):
        return self.band.share

    @cached_property
    def _table(self):
        """The band with finer nodes, and the mean induction at them."""
        nodes, last = self.band.nodes, self.band.nodes.size - 1
        finer = np.interp(np.linspace(0, last, FINER * last + 1), range(last + 1), nodes)
        sections = bem.sections(self.blade, self.polar.in_flow(1.0), finer)
        induced = bem.induced_speeds(self.blade, sections, finer)[:, 0]
        return replace(self.band, nodes=finer), induced @ self.band.weights

    def balanced(self, speed, flow):
        """Return the mean velocity in equilibrium, (n_points, 1), and that at 0.7 R, m/s."""
        induced, at_place = super().balanced(speed, flow)
        mean = induced[:, : self.blade.r.size] @ self.band.weights / np.cos(self.blade.cone)
        return mean[:, None], at_place

    def sections(self, speed, flow, filters):
        band, table = self._table
        wake_ratio, _ = band.wake_ratio(table, filters[:, 1] / flow)
        ratio = np.maximum(speed * self.blade.rotor_radius / flow, SLOWEST_RATIO)
        return self.behind(ratio, wake_ratio, flow)

    def behind(self, ratio, wake_ratio, flow):
        """Return the `Sections` in the wake of other tip speed ratios, (n_points,)."""
        polar = self.polar.in_flow(flow)
        wake = bem.sections(self.blade, polar, wake_ratio)
        return bem.sections_behind(self.blade, polar, wake, wake_ratio, ratio)
