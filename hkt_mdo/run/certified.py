"""The certificate of a case: an upper bound for all designs within its bounds."""

from dataclasses import replace

import numpy as np

from hkt_mdo.dynamics.certificate import RAMP, Certificate, between, peak
from hkt_mdo.dynamics.laws import LinearFeedback, QuadraticFeedback
from hkt_mdo.problem.model import Physics
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.bem import STEP
from hkt_mdo.rotor.best_section import best_sections
from hkt_mdo.rotor.steady_optimum import SteadyOptimum

LOWEST, HIGHEST = 0.3, 20.0  # tip speed ratios for which the bound holds
ANGLES = 61  # set angles
CHORDS, TWISTS, RATIOS = 14, 25, 12  # number of chords at which heavy blades are examined
PRICES = np.array([2e-4, 1e-3, 5e-3])  # relative power coefficient for the best blade's inertia
NEAR = 1e-3  # distance from the quasi-steady bound that is neglected at first


def certified_energy(physics: Physics, optimum: SteadyOptimum, bound: float) -> float | None:
    """Return an upper bound on the captured energy under the case's law and torque limit, J.

    `bound` is the quasi-steady one, which it never exceeds. Of a law that is not the package's own,
    only the torque limit is regarded. None where polars follow the Reynolds number, the radius,
    the thickness or the hub's inertia is designed, the turbine differs between scenarios, the
    inertia is not that of blades and hub alone, or the best tip speed ratio is near `HIGHEST`.
    """
    shape, law, limit = physics.shape, physics.law, physics.law.largest_torque
    rotor, designs_radius = physics.rotor, shape.radius_bounds is not None
    designed = designs_radius or physics.designs_hub or "thickness" in shape.bases
    moves_more = rotor.inertia_factor != 1.0 or rotor.added_inertia != "none"
    turbines_differ = len(physics.rotors) > 1
    fast = optimum.tip_speed_ratio > 0.8 * HIGHEST
    if rotor.polar.follows_reynolds or designed or moves_more or turbines_differ or fast:
        return None
    known_law = law if type(law) in (LinearFeedback, QuadraticFeedback) else None
    free = limit is None and (known_law is None or isinstance(known_law, QuadraticFeedback))
    if free or any(scenario.duration < 10.0 * RAMP for scenario in physics.scenarios):
        return bound  # which quadratic feedback reaches
    best, friction = _best_power(physics, optimum), physics.case.generator.friction

    def at(inertia):
        total = 0.0
        for scenario in physics.scenarios:
            flow, radius = (scenario.inflow, scenario.edges), shape.blade.rotor_radius
            certificate = Certificate(*best, inertia, *flow, physics.density, radius, friction)
            # the torque of a law under a limit lies between zero and the limit
            bounds = [certificate.of_limit(limit)] if limit is not None else []
            if known_law is not None:
                bounds.append(certificate.of_law(known_law))
            total += scenario.weight * min(bounds)
        return total

    if not shape.designs_chord:
        inertia = physics.rotor.mass_and_inertia(physics.blade)[1]
        return min(at((inertia, inertia)), bound)
    lightest, heaviest = _inertia_of_heavy(physics, optimum)
    level = 1.0 - NEAR
    energy = at((lightest, heaviest(level)))
    if energy < level * bound:
        level = energy / bound
        energy = at((lightest, heaviest(level)))
    return min(max(energy, level * bound), bound)


def _best_power(physics, optimum):
    """Return tip speed ratios, rising, and the best power coefficients of a case's blades there."""
    shape, blade, peak = physics.shape, physics.blade, optimum.tip_speed_ratio
    upper = min(1.6 * peak, HIGHEST - 1.0)
    ratios = np.concatenate(
        (
            np.linspace(LOWEST, 0.55 * peak, 8, endpoint=False),
            np.linspace(0.55 * peak, upper, 33),
            np.linspace(upper, HIGHEST, 9)[1:],
        )
    )
    if shape.designs_chord:
        load, *_ = best_sections(blade, physics.rotor.polar, ratios, shape.bounds)
        power = ratios * (load @ bem.torque_weights(blade))
    elif shape.designs_set_angle:
        angles = np.linspace(*shape.bounds["twist"], ANGLES)
        blades = (shape.at({"twist": [angle]}) for angle in angles)
        curves = [physics.rotor.coefficients(turned, ratios).power for turned in blades]
        # the increase between two angles, by a parabola
        power = np.max(curves, axis=0) + np.abs(np.diff(curves, 2, axis=0)).max(axis=0) / 8.0
    else:
        power = physics.rotor.coefficients(blade, ratios).power
    fine = np.interp(np.arange(3 * ratios.size - 2) / 3.0, np.arange(ratios.size), ratios)
    return fine, between(ratios, power, fine)


def _inertia_of_heavy(physics, optimum):
    """Return the least inertia, kg m², and the inertia above which power is below a share.

    For a price p of inertia let S(p) be the largest power coefficient + p times inertia over all
    blades and tip speed ratios. A blade heavier than (S - share Cp*) / p has less than the share of
    the best power coefficient Cp*, under any controller. The inertia is a quadratic form of the
    chords without negative coefficients, hence at most the sum of i chord², where i is half its
    slope at unit chords; so S is at most a sum over stations of the largest, over chords c_k, of
    (best share of chord c_k or more) + p i c_{k+1}².
    """
    blade, rotor, best = physics.blade, physics.case.rotor, optimum.blade
    bounds = physics.shape.bounds
    unit = np.ones(blade.r.size)
    moved = replace(blade.with_shape(unit, unit), chord=unit + 1j * STEP * np.eye(unit.size))
    slope = np.imag(physics.rotor.mass_and_inertia(moved).inertia) / STEP
    lightest = physics.rotor.mass_and_inertia(blade.with_shape(bounds["chord"][0] * unit, unit))[1]
    prices = PRICES * optimum.power_coefficient / physics.rotor.mass_and_inertia(best)[1]
    ratios = optimum.tip_speed_ratio * np.linspace(0.25, 1.3, RATIOS)
    weights = bem.torque_weights(blade)
    best_load, best_chord, _ = best_sections(blade, physics.rotor.polar, ratios, bounds)
    chords = np.geomspace(*bounds["chord"], CHORDS + 1)
    twists = np.linspace(*bounds["twist"], TWISTS)
    sums = np.zeros((prices.size, RATIOS))
    for j, r in enumerate(blade.r):
        first = np.searchsorted(chords[:-1], best_chord[:, j].min(), side="right")
        load = np.full((RATIOS, CHORDS), -np.inf)
        if first < CHORDS:  # else the largest chord is the best, and there are none beyond it
            chord, twist = map(np.ravel, np.meshgrid(chords[first:-1], twists, indexing="ij"))
            strip = replace(blade, r=np.full(chord.size, r), chord=chord, twist=twist)
            loads = bem.sections(strip, physics.rotor.polar.at_station(j), ratios).tangential_load
            # the increase between twists, by a parabola; then the best of this and larger chords
            load[:, first:] = peak(loads.reshape(-1, TWISTS)).reshape(RATIOS, -1)
            load = np.maximum.accumulate(load[:, ::-1], axis=1)[:, ::-1]
        load = np.where(chords[:-1] <= best_chord[:, j, None], best_load[:, j, None], load)
        load = np.minimum(load, best_load[:, j, None])
        shares = ratios[:, None] * weights[j] * load
        grown = 0.5 * slope[j] * chords[1:] ** 2
        sums += np.max(shares + prices[:, None, None] * grown, axis=2)
    most = peak(sums) + prices * rotor.hub_inertia

    def heaviest(share):
        return float(np.min((most - share * optimum.power_coefficient) / prices))

    return lightest, heaviest
