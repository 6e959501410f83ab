"""Loads of a rotor over the flow's dynamic pressure q = 0.5 rho v², by the tip speed ratio.

At a tip speed ratio every speed is proportional to that of the flow v, and every load to q, that of
the centrifugal force too: load = q c(tip speed ratio). Definitions are in docs/rotor_model.md.
"""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from typing import NamedTuple

import numpy as np

from hkt_mdo.rotor import bem
from hkt_mdo.rotor.inertia import WEIGHTS, between, spread
from hkt_mdo.rotor.polars import Polars
from hkt_mdo.rotor.strength import Structure, StructureByThickness, norm, place_weights

GRAVITY = 9.80665  # m/s²
ATMOSPHERIC, VAPOUR = 101325.0, 1705.0  # Pa, the latter of water at 15 degrees Celsius


class Load(NamedTuple):
    """A load over q at n tip speed ratios and m places along the blade, at the radii r[m].

    exact[n, m] is the load, values[n, m] a smooth one at or above it (over the outline, for stress;
    else the same). Loads of the whole blade have one place. slopes takes share[n, m] and returns
    the derivatives of the sums of share times values over the places, at constant share: by tip
    speed ratio, chord, twist, thickness and rotor radius, as a `bem.Table` has them; None unless
    derivatives are requested.
    """

    r: np.ndarray
    exact: np.ndarray
    values: np.ndarray
    slopes: Callable[[np.ndarray], tuple[np.ndarray, ...]] | None = None

    @property
    def largest(self):
        """Largest load along the blade, shape (n,).

        Returns
        -------
        ndarray of shape (n,)
            Load over q.
        """
        return np.max(np.real(self.exact), axis=1)

    def envelope(self):
        """Return the smooth largest load along the blade: a norm of the loads above zero.

        It is never below the largest of them.

        Returns
        -------
        Table
            The smooth largest load and its derivatives.
        """
        if self.r.size == 1:
            values, share = self.values[:, 0], np.ones(self.values.shape)
        else:
            values, share = norm(self.values)
        return bem.Table(values, *(() if self.slopes is None else self.slopes(share)))


@dataclass(frozen=True, eq=False)
class LoadModel:
    """A rotor's loads: everything that they depend on besides the blade.

    polar has lift, drag and suction of the sections; structure is that of the material,
    water_density in kg/m³. Without the depth of the hub (m) there is no cavitation: a section does
    that at the top of the turn. margin is a factor on the suction.
    """

    polar: Polars
    structure: Structure | StructureByThickness
    _: KW_ONLY
    water_density: float = 1000.0
    depth: float | None = None
    margin: float = 1.1

    def at_flow(self, flow_speed):
        """Return the same rotor with polars at the Reynolds numbers of a flow.

        Parameters
        ----------
        flow_speed : float or ndarray of shape (n_points,)
            Speed of the undisturbed flow (m/s), one or one an operating point. It matters only
            where polars follow the Reynolds number.

        Returns
        -------
        LoadModel
            Of the same class as this one.
        """
        return replace(self, polar=self.polar.in_flow(flow_speed))

    @property
    def load_names(self):
        """Names of the loads that the model gives.

        Returns
        -------
        tuple of str
            thrust, root_moment, stress and, with a depth, cavitation.
        """
        return tuple(_LOADS)[: -1 if self.depth is None else None]

    def loads(self, blade, tip_speed_ratio, derivatives=False, names=None, flow=None):
        """Return a `Load` for each name: thrust, root_moment, stress, cavitation, all over q.

        thrust (m²) is that of the rotor along its axis; root_moment (m³) bends one blade flapwise
        at the hub's radius; stress (dimensionless) is the largest over a section of bending and
        centrifugal stress, at the places of `strength.place_weights`; cavitation (1/Pa) is the
        suction over the pressure available, for upper and then lower surfaces of all stations, and
        q times it is 1 where cavitation begins.

        Stations ascend; tip_speed_ratio[n] is that of the disc. A section without a root has no
        load. Raises ValueError where `bem.sections` does, for derivatives with `LocalReynolds`, for
        a structure with another number of stations, where a station is out of the water, and for
        names of loads that the model does not give.

        Parameters
        ----------
        blade : Blade
            The blade.
        tip_speed_ratio : array_like of shape (n_points,)
            Omega R / V of the disc, positive.
        derivatives : bool
            Whether the derivatives are computed.
        names : sequence of str, optional
            Names of the loads; by default all of `load_names`.
        flow : Sections, optional
            The flow at the points, if it is known, or where its wake is not in equilibrium; with
            its derivatives if they are asked for.

        Returns
        -------
        dict of str to Load
            The loads by name.

        Raises
        ------
        ValueError
            See above.
        """
        if derivatives and self.polar.follows_reynolds:
            raise ValueError("loads have no derivatives with local Reynolds numbers")
        names = self.load_names if names is None else names
        if missing := [name for name in names if name not in self.load_names]:
            raise ValueError(f"the model gives no {', '.join(missing)}")
        ratio = np.atleast_1d(np.asarray(tip_speed_ratio, dtype=float))
        flow = bem.sections(blade, self.polar, ratio, derivatives) if flow is None else flow
        loads = {name: _LOADS[name](self, blade, flow, ratio) for name in names}
        if flow.derivatives.size:
            return loads
        return {name: load._replace(slopes=None) for name, load in loads.items()}

    def _beam(self, blade):
        """Return the blade at the places of `place_weights`, its structure, its rate; and these."""
        weights = place_weights(blade.r.size)
        shape = {name: getattr(blade, name) for name in ("r", "chord", "twist", "thickness")}
        fine = replace(blade, **{name: weights @ x for name, x in shape.items() if x is not None})
        return fine, *self.structure.at(fine.thickness), weights

    def _centrifugal(self, blade, ratio):
        """Return the beam, the rate rho_b omega² cos²(cone) over q [n_points, 1], and two loads.

        Times the rate, these are the pull of all that is outboard of the hub and of every place,
        and the flapwise moment by it on coned blades; with their derivatives, as of `_outboard`.

        Raises
        ------
        ValueError
            For a structure with another number of stations.
        """
        beam = _, structure, *_ = self._beam(blade)
        if structure.n_stations not in (None, blade.r.size):
            raise ValueError(f"the structure is not that of {blade.r.size} stations")
        rate = 2.0 * structure.density / (self.water_density * blade.rotor_radius**2)
        rate = rate * np.cos(blade.cone) ** 2 * np.reshape(ratio, (-1, 1)) ** 2
        pulls, bends = zip(*_outboard(beam, 1), strict=True)
        return beam, rate, pulls, [np.tan(blade.cone) * bend for bend in bends]

    def weight_stress(self, blade):
        """Return the stress in a blade by its weight in water alone, as a `Load` (Pa, not over q).

        The weight less the buoyancy, g (rho_b - rho) A per length, bends a horizontal blade about
        the rotor's axis; in half a turn this moment changes its sign. The material alone is in the
        water's way: a hollow blade is flooded. The pull along a vertical blade is left out
        (docs/dev/equations.md).

        Parameters
        ----------
        blade : Blade
            The blade.

        Returns
        -------
        Load
            Of one point, which has no tip speed ratio.
        """
        beam = fine, structure, *_ = self._beam(blade)
        excess = GRAVITY * (structure.density - self.water_density)
        moment, *moment_by = (excess * bend[..., 1:] for _, bend in _outboard(beam, 0))
        exact, values, bent_by = _bent(beam, 0.0, moment[None])

        def slopes(share):
            _, by_moment, _, *by_shape = bent_by(share)
            pairs = zip(by_shape, moment_by, strict=True)
            by_shape = [slope + by_moment @ moment_x.T for slope, moment_x in pairs]
            by_radius = radius_slope(blade, np.sum(share * values, axis=1), by_shape[0], 1)
            return np.zeros(1), *by_shape, by_radius

        return Load(fine.r, exact, values, slopes)

    def weight_moment(self, blade):
        """Return the moment of a horizontal blade's weight in water at the hub's radius, N*m.

        Parameters
        ----------
        blade : Blade
            The blade.

        Returns
        -------
        float
            Less the buoyancy; the sections are linear between stations.
        """
        beam = _, structure, *_ = self._beam(blade)
        (_, moment), *_ = _outboard(beam, 0)
        return float(GRAVITY * (structure.density - self.water_density) * moment[0])

    def moments(self, blade, tip_speed_ratio, r, flow=None):
        """Return the moments that bend a blade at radii r over q, m³: flapwise, and edgewise.

        With the moment of the centrifugal force on coned blades.

        Parameters
        ----------
        blade : Blade
            The blade.
        tip_speed_ratio : array_like of shape (n_points,)
            Omega R / V of the disc, positive.
        r : ndarray of shape (n_r,)
            Radii along the blade (m).
        flow : Sections, optional
            As `loads` takes it.

        Returns
        -------
        flapwise, edgewise : ndarray of shape (n_points, n_r)
            In m**3.
        """
        flow = bem.sections(blade, self.polar, tip_speed_ratio) if flow is None else flow
        flapwise, edgewise = _moments(blade, flow, np.asarray(r, dtype=float))
        (fine, *_), rate, _, (bend, *_) = self._centrifugal(blade, tip_speed_ratio)
        return flapwise + rate * np.interp(r, fine.edges, np.append(bend, 0.0)), edgewise

    def tip_deflection(self, blade, tip_speed_ratio):
        """Return the tip's deflection out of the rotor plane over q, m/Pa, shape (n_points,).

        Euler-Bernoulli's beam of small deflections, clamped at the hub radius, under the loads of
        the undeformed blade, which the centrifugal force does not stiffen: integral of the
        curvature times (tip radius - r). Sections bend about their own inclined axes; chord, twist
        and section are linear between stations and constant from there to hub and tip.

        Parameters
        ----------
        blade : Blade
            The blade.
        tip_speed_ratio : array_like of shape (n_points,)
            Omega R / V of the disc, positive.

        Returns
        -------
        ndarray of shape (n_points,)
            In m/Pa.
        """
        fine, structure, *_ = self._beam(blade)
        r = between(fine.edges).ravel()
        properties = fine.chord, fine.twist, structure.xx, structure.yy, structure.xy
        chord, twist, xx, yy, xy = (spread(fine, values).ravel() for values in properties)
        weak, strong = _about_chord(*self.moments(blade, tip_speed_ratio, r), twist)
        bent = replace(structure, xx=xx, yy=yy, xy=xy).curvature(weak, strong, chord, twist)
        return bent @ ((WEIGHTS * np.diff(fine.edges)).ravel() * (blade.tip_radius - r))


def moment_weights(blade, r):
    """Return the matrix (n_stations, n_places) from loads at stations (N/m) to moments at radii r.

    The trapezoidal rule for the integral of load times arm (s - r) from r to the tip, over r,
    stations and tip with no load at the tip: from the hub, the rule that gives the torque.

    Parameters
    ----------
    blade : Blade
        The blade.
    r : ndarray of shape (n_places,)
        Radii along the blade (m).

    Returns
    -------
    ndarray of shape (n_stations, n_places)
        In m**2.
    """
    inner, stations, outer = (blade.edges[:, None][at] for at in np.s_[:-2, 1:-1, 2:])
    inner = np.where(np.real(inner) > np.real(r), inner, r)
    return np.where(np.real(stations) > np.real(r), 0.5 * (outer - inner) * (stations - r), 0.0)


def _moments(blade, flow, r):
    """Return the flapwise and edgewise moment of the flow's loads over q at radii r (m³)."""
    weights = np.cos(blade.cone) ** 2 * moment_weights(blade, r)
    return flow.normal_load @ weights, flow.tangential_load @ weights


def _about_chord(flapwise, edgewise, twist):
    """Return the moments about the chord line (of forces across it) and across it."""
    sine, cosine = np.sin(twist), np.cos(twist)
    return flapwise * cosine + edgewise * sine, edgewise * cosine - flapwise * sine


def _by_flow(flow, normal, tangential):
    """Return derivatives by ratio, chord, twist and thickness through the loads of the stations.

    normal and tangential[n_points, n_stations] are the derivatives by both loads.
    """
    by_ratio, *by_shape = normal * flow.derivatives[1] + tangential * flow.derivatives[0]
    return np.sum(by_ratio, axis=-1), *by_shape


def radius_slope(blade, values, by_chord, power):
    """Return the derivative by the rotor radius of values that grow with length to a power.

    They are homogeneous in the lengths, of which only the chord does not move with the radius.

    Parameters
    ----------
    blade : Blade
        The blade.
    values : ndarray of shape (n_points,)
        Values proportional to length to the power.
    by_chord : ndarray of shape (n_points, n_stations)
        Its derivative by the chord.
    power : int
        Of the length.

    Returns
    -------
    ndarray of shape (n_points,)
        A unit of the values per m.
    """
    return (power * values - by_chord @ blade.chord) / blade.rotor_radius


def _thrust(_model, blade, flow, _ratio):
    weights = 0.5 * np.cos(blade.cone) ** 3 * blade.blade_count
    return _whole(blade, flow, weights * (blade.edges[2:] - blade.edges[:-2]), 2)


def _moment(model, blade, flow, ratio):
    weights = np.cos(blade.cone) ** 2 * moment_weights(blade, np.array([blade.hub_radius]))[:, 0]
    _, rate, _, bends = model._centrifugal(blade, ratio)
    bend, *by_shape = (rate * term[..., 0] for term in bends)
    return _whole(blade, flow, weights, 3, bend, 2.0 / ratio[:, None] * bend, by_shape)


def _whole(blade, flow, weights, power, added=0.0, by_ratio=0.0, by_shape=(0.0, 0.0, 0.0)):
    """Return the `Load` of the whole blade, weights[n_stations] times the normal loads.

    And what is added to it, of shape (n_points, 1), with its derivatives by the ratio, and by
    chord, twist and thickness.
    """
    values, r = (flow.normal_load @ weights)[:, None] + added, np.array([blade.hub_radius])

    def slopes(share):
        by = _by_flow(flow, share * weights, np.zeros(flow.normal_load.shape))
        of_added = np.sum(share * by_ratio, axis=1), *(share * slope for slope in by_shape)
        by = [slope + other for slope, other in zip(by, of_added, strict=True)]
        return *by, radius_slope(blade, (share * values)[:, 0], by[1], power)

    return Load(r, values, values, slopes)


def _bent(beam, flapwise, edgewise, pull=0.0):
    """Return the stress of a beam by moments and pull, the smooth one, and a function of its share.

    The function takes share[n_points, n_places] and returns derivatives of the share times the
    smooth stress: by both moments and by the pull at the places, and at constant moments and pull
    by chord, twist and thickness of the stations.
    """
    fine, structure, change, weights = beam
    weak, strong = _about_chord(flapwise, edgewise, fine.twist)
    section = structure.area * fine.chord**2
    tension = pull / section
    bending = structure.bending(weak, strong, fine.chord, change, tension)
    values = bending.smooth + tension

    def slopes(share):
        by_weak, by_strong = share * bending.by_weak, share * bending.by_strong
        by_chord = -share * (3.0 * bending.smooth + 2.0 * tension) / fine.chord
        by_twist = by_weak * strong - by_strong * weak
        by_thickness = share * (bending.by_thickness - tension / structure.area * change.area)
        by_moments = _about_chord(by_weak, by_strong, -fine.twist)
        by_places = by_chord, by_twist, by_thickness
        return *by_moments, share / section, *(slope @ weights for slope in by_places)

    return bending.largest + np.real(tension), values, slopes


def _stress(model, blade, flow, ratio):
    beam, rate, *integrals = model._centrifugal(blade, ratio)
    (pull, *pull_by), (bend, *bend_by) = ([term[..., 1:] for term in terms] for terms in integrals)
    flapwise, edgewise = _moments(blade, flow, beam[0].r)
    exact, values, bent_by = _bent(beam, flapwise + rate * bend, edgewise, rate * pull)

    def slopes(share):
        by_flapwise, by_edgewise, by_pull, *by_places = bent_by(share)
        arms = np.cos(blade.cone) ** 2 * moment_weights(blade, beam[0].r).T
        by_ratio, *by_shape = _by_flow(flow, by_flapwise @ arms, by_edgewise @ arms)
        by_bend, by_pull = by_flapwise * rate, by_pull * rate
        by_ratio = by_ratio + 2.0 / ratio * np.sum(by_bend * bend + by_pull * pull, axis=1)
        parts = zip(by_shape, by_places, bend_by, pull_by, strict=True)
        by_shape = [
            by_load + by_place + by_bend @ bend_x.T + by_pull @ pull_x.T
            for by_load, by_place, bend_x, pull_x in parts
        ]
        by_radius = radius_slope(blade, np.sum(share * values, axis=1), by_shape[0], 0)
        return by_ratio, *by_shape, by_radius

    return Load(beam[0].r, exact, values, slopes)


def _outboard(beam, power):
    """Return the integrals of A s^p ds and of A s^p (s - r) ds from hub and every place to the tip.

    [2, n_places + 1]; and their derivatives by chord, twist and thickness of the stations,
    [2, n_stations, n_places + 1] each. A = area chord², both linear between the places and constant
    from there to hub and tip.
    """
    fine, structure, change, weights = beam
    s, unit = between(fine.edges), WEIGHTS * np.diff(fine.edges)

    def integrals(area, chord, other):
        area, chord, other = (spread(fine, values) for values in (area, chord, other))
        line = unit * area * chord * other * s**power
        lines = np.sum(line, axis=-2), np.sum(line * s, axis=-2)
        pull, second = (np.cumsum(sums[..., ::-1], axis=-1)[..., ::-1] for sums in lines)
        return np.stack((pull, second - fine.edges[:-1] * pull))

    by_chord = integrals(2.0 * structure.area, fine.chord, weights.T)
    nothing, values = np.zeros(by_chord.shape), integrals(structure.area, fine.chord, fine.chord)
    if not np.any(change.area):
        return values, by_chord, nothing, nothing
    return values, by_chord, nothing, integrals(change.area * weights.T, fine.chord, fine.chord)


def _cavitation(model, blade, flow, ratio):
    cosine = np.cos(blade.cone)
    height = blade.r * cosine
    if np.any(np.real(height) >= model.depth):
        raise ValueError("the blade reaches out of the water: the depth is less than its radius")
    static = model.water_density * GRAVITY * (model.depth - height)
    pressure = np.tile(ATMOSPHERIC - VAPOUR + static, 2)  # of both surfaces, beside each other
    lift = model.water_density * GRAVITY * np.tile(height, 2) / pressure
    surfaces = model.polar.along("suction", blade, ratio, flow.angle_of_attack)
    suction, by_angle, by_followed = map(np.hstack, surfaces)
    speed, scale = np.tile(flow.relative_speed, 2), model.margin * cosine**2 / pressure
    values = scale * suction * speed**2

    def slopes(share):
        angle, relative = np.tile(flow.derivatives[2:], 2)
        angle[2] -= 1.0  # of attack
        by = scale * speed * (by_angle * speed * angle + 2.0 * suction * relative)
        by[3] += scale * speed**2 * by_followed
        by_ratio, *by_shape = (share * by).reshape(4, len(share), 2, -1).sum(axis=2)
        weighted = share * values
        by_radius = radius_slope(blade, np.sum(weighted, axis=1), by_shape[0], 0)
        by_radius = by_radius + weighted @ lift / blade.rotor_radius
        return np.sum(by_ratio, axis=1), *by_shape, by_radius

    return Load(np.tile(blade.r, 2), values, values, slopes)


_LOADS = {"thrust": _thrust, "root_moment": _moment, "stress": _stress, "cavitation": _cavitation}
