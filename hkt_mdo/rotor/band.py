"""Tables of a rotor whose wake has memory: loads in a band about the wake's tip speed ratio.

A wake that is not in equilibrium is described as that of another tip speed ratio, the wake's. This
ratio follows from the mean axial velocity that the wake induces, as a share of the flow's speed,
which rises with the ratio or, where inner stations have most of the torque, falls. Loads are a
table over the wake's ratio and over the quotient of the rotor's ratio and the wake's.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.loads import radius_slope
from hkt_mdo.rotor.torque_curve import TorqueSpline

FACTORS = np.linspace(0.7, 1.3, 13)
"""Tip speed ratios of the rotor over those of its wake at which loads are computed."""
_ACROSS = TorqueSpline(FACTORS)
ALONG = "torque_coefficient", "wake_induction", "place_induction"
"""What has a table over the tip speed ratio of the wake alone, in equilibrium."""
BEYOND = 0.1
"""Share of the range of a table's tip speed ratios by which the wake's may be beyond them."""
PLACE = 0.7
"""r/R of the induction that decides the wake's time constant."""


def place_shares(places):
    """Return the share of each station in the induction at `PLACE`, linear between stations.

    Parameters
    ----------
    places : ndarray of shape (n_stations,)
        Radii of the stations over that of the tip.

    Returns
    -------
    ndarray of shape (n_stations,)
        Their sum is one.
    """
    return np.array([np.interp(PLACE, places, row) for row in np.eye(places.size)])


def fast_share(places):
    """Return the fast filter's time constant over the slow one's.

    Parameters
    ----------
    places : ndarray of shape (n_stations,)
        Radii of the stations over that of the tip.

    Returns
    -------
    ndarray of shape (n_stations,)
        By Øye's formula.
    """
    return 0.39 - 0.26 * places**2


@dataclass(frozen=True, eq=False)
class Band:
    """The tip speed ratios of the tables, and the weights of the mean induction.

    Attributes
    ----------
    nodes : array, shape (n_nodes,)
        Tip speed ratios of the wake (of the disc), rising.
    weights : array, shape (n_stations,)
        Share of each station in the mean axial induction.
    places : array, shape (n_stations,)
        Share of each station in the axial induction at `PLACE`.
    share : float
        Time constant of the fast filter over that of the slow one, the mean of all stations.
    direction : float
        1 where the mean axial induction rises with the tip speed ratio, -1 where it falls.
    """

    nodes: np.ndarray
    weights: np.ndarray
    places: np.ndarray
    share: float
    direction: float = 1.0

    @classmethod
    def of(cls, polar, blade, tip_speed_ratio, nodes):
        """Return the band of a blade; its weights are the effects of the inductions on the torque.

        Parameters
        ----------
        polar : Polars
            Polars of the sections.
        blade : Blade
            The blade.
        tip_speed_ratio : float
            Of the disc, at which the weights are made.
        nodes : array_like of shape (n_nodes,)
            Tip speed ratios of the tables.

        Returns
        -------
        Band
            With weights whose sum is one.
        """
        ratio = np.array([tip_speed_ratio])
        flow = bem.sections(blade, polar, ratio)
        ends = []
        for move in (1e-4, -1e-4):
            induced = bem.induced_speeds(blade, flow, ratio)
            induced[:, 0] += move
            ends.append(bem.sections_with(blade, polar, ratio, induced).tangential_load[0])
        weights = bem.torque_weights(blade) * np.abs(ends[0] - ends[1])
        places, weights = blade.r / blade.tip_radius, weights / np.sum(weights)
        share = float(weights @ fast_share(places))
        beside = bem.sections(blade, polar, ratio * np.array([0.95, 1.05]))
        slower, faster = _induction(blade, weights, beside).values
        direction = 1.0 if faster >= slower else -1.0
        nodes = np.asarray(nodes, dtype=float)
        return cls(nodes, weights, place_shares(places), share, direction)

    @cached_property
    def spline(self):
        """The curves over the tip speed ratio of the wake.

        Returns
        -------
        TorqueSpline
            Over the nodes.
        """
        return TorqueSpline(self.nodes)

    def curve(self, table):
        """Return a table as a function of tip speed ratios of rotor and wake, maybe complex.

        Parameters
        ----------
        table : ndarray of shape (n_nodes * n_factors,)
            As `solve` makes it.

        Returns
        -------
        callable
            Takes and returns arrays of shape (n_points,).
        """
        columns = self.spline.curve(table.reshape(-1, FACTORS.size))
        return lambda ratio, wake_ratio: np.sum(
            columns(wake_ratio) * _ACROSS.basis(ratio / wake_ratio), axis=1
        )

    def basis(self, ratio, wake_ratio):
        """Return the matrix (n_points, n_nodes * n_factors) from a table to its `curve`.

        Parameters
        ----------
        ratio, wake_ratio : ndarray of shape (n_points,)
            Tip speed ratios of rotor and wake.

        Returns
        -------
        ndarray
            The matrix.
        """
        along, across = self.spline.basis(wake_ratio), _ACROSS.basis(ratio / wake_ratio)
        return (along[:, :, None] * across[:, None]).reshape(ratio.size, -1)

    def wake_ratio(self, table, induction):
        """Return the wake's tip speed ratio and its slope by the mean induction.

        Parameters
        ----------
        table : ndarray of shape (n_nodes,)
            Mean axial induction in equilibrium, at the nodes. It rises, or falls, by `direction`;
            of a table that does both, the part in which it does so most determines the wake.
        induction : ndarray of shape (n_points,)
            Mean axial induction.

        Returns
        -------
        ratio, slope : ndarray of shape (n_points,)
            By Newton's method, from linear interpolation. Beyond the nodes, where an optimizer may
            try points, it is continued smoothly by at most `BEYOND` of their range.
        """
        table, induction = self.direction * table, self.direction * induction
        end = max(1, np.argmax(table - np.minimum.accumulate(table)))
        begin = np.argmin(table[:end])
        nodes, rising = self.nodes[begin : end + 1], np.maximum.accumulate(table[begin : end + 1])
        rising += 1e-9 * np.arange(rising.size)
        inside = np.clip(induction, rising[0], rising[-1])
        ratio = np.interp(inside, rising, nodes)
        least = 1e-2 * (rising[-1] - rising[0]) / np.ptp(nodes)
        pieces = self.spline.pieces(table)
        for _ in range(8):
            slope = np.maximum(pieces(ratio, 1), least)
            ratio = np.clip(ratio - (pieces(ratio) - inside) / slope, nodes[0], nodes[-1])
        room = BEYOND * np.ptp(self.nodes)
        turned = np.tanh((induction - inside) / (slope * room))
        return ratio + room * turned, self.direction * (1.0 - turned**2) / slope

    def solve(self, rotor, blade, names, derivatives=False):
        """Return the tables of a blade by their names.

        Parameters
        ----------
        rotor : RotorModel
            Computes the loads.
        blade : Blade
            The blade.
        names : sequence of str
            As of `RotorModel.tables`, with torque_coefficient.
        derivatives : bool
            Whether the tables have derivatives.

        Returns
        -------
        dict of Table
            torque_coefficient_table, wake_induction_table, place_induction_table (n_nodes) in
            equilibrium; torque_coefficient_band and, of each load over the dynamic pressure,
            <load>_band (n_nodes * n_factors).
        """
        wake = bem.sections(blade, rotor.polar, self.nodes, derivatives)
        repeated = bem.Sections(*(np.repeat(x, FACTORS.size, axis=-2) for x in wake))
        ratio = np.outer(self.nodes, FACTORS).ravel()
        wakes = np.repeat(self.nodes, FACTORS.size)
        flow = bem.sections_behind(blade, rotor.polar, repeated, wakes, ratio)
        tables = {
            **rotor.tables(blade, self.nodes, ["torque_coefficient"], derivatives, wake),
            "wake_induction": _induction(blade, self.weights, wake),
            "place_induction": _induction(blade, self.places, wake),
        }
        bands = rotor.tables(blade, ratio, names, derivatives, flow)
        tables = {f"{name}_table": table for name, table in tables.items()}
        return tables | {f"{name}_band": table for name, table in bands.items()}


def _induction(blade, weights, flow):
    """Return the weighted axial induction of sections, as a share of the flow's normal speed."""
    speed, angle = flow.relative_speed, flow.inflow_angle
    has_root = (speed > 0.0) * weights
    values = np.sum(has_root * (1.0 - speed * np.sin(angle)), axis=1)
    if not flow.derivatives.size:
        return bem.Table(values)
    angles, speeds = flow.derivatives[2:, 1:]
    slopes = -has_root * (speeds * np.sin(angle) + speed * np.cos(angle) * angles)
    return bem.Table(values, np.empty(0), *slopes, radius_slope(blade, 0.0 * values, slopes[0], 0))
