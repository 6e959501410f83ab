"""The joint search under limits: blade, gains and schedule by sequential quadratic programming.

Objective and constraints are those of a `SteadyFlow`, with exact slopes by all unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from scipy.optimize import Bounds, minimize

from hkt_mdo.dynamics.laws import STEP
from hkt_mdo.dynamics.limits import TYPICAL
from hkt_mdo.dynamics.quasi_steady import SAFE
from hkt_mdo.problem.start import CoDesign
from hkt_mdo.problem.steady_flow import SteadyFlow
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.scales import torque_scale

VIOLATION = 1e-6  # relative excess of a limit that counts as none
SAME = 2e-3  # relative difference of the tip speed ratios of one optimum
RATIO_MOVE = 1.25  # factor within which tip speed ratios move before they are re-centred
ROUNDS, MOST = 16, 40  # of move limits, and SLSQP iterations of one
ROUGH = 12  # of one that is tightened only in part
TIGHTENED, LOOSE = 0.5, 0.05  # of an excess that is tightened in steps, and one that is not
GAIN = 1e-7  # relative gain of the objective that is worth another round
BEHIND, LAST = 0.01, 4.0  # of the best objective, and of the last gain: a schedule is given up


@dataclass(frozen=True, eq=False)
class Schedule:
    """A blade, gains and tip speed ratios over the speeds of a `SteadyFlow`.

    objective in J; excess is the largest of any limit, relatively, and of the control law's balance
    of torques and its distance from stall. tried is the number of schedules that it is the best of.
    """

    branch: str
    blade: Blade
    gains: np.ndarray
    ratio: np.ndarray
    objective: float
    excess: float
    tried: int = 1

    @property
    def worth(self) -> tuple[bool, float]:
        """What ranks schedules: those that keep the limits by objective, the others by excess."""
        kept = self.excess <= VIOLATION
        return kept, self.objective if kept else -self.excess

    def same_as(self, other: Schedule) -> bool:
        """Tell whether this is the same optimum as another."""
        close = np.allclose(self.ratio, other.ratio, rtol=SAME)
        return close and np.allclose(self.blade.chord, other.blade.chord, rtol=10.0 * SAME)


class Joint:
    """Objective and constraints over one vector: the design's unknowns, then the ratios.

    Under a law with states there are none of these: the ratios follow from its gains.
    """

    def __init__(self, steady: SteadyFlow, design: CoDesign, slowed: float):
        self.steady, self.design, self.slowed = steady, design, slowed

    def vector(self, schedule):
        """Return the unknowns of a schedule, their units, and how far they may move."""
        x, units = self.design.vector(schedule)
        ratio = schedule.ratio[: 0 if self.steady.physics.states else None]
        moves = ratio / RATIO_MOVE, ratio * RATIO_MOVE
        ends = zip(self.design.bounds(x), moves, strict=True)
        low, high = (np.concatenate(each) for each in ends)
        return np.r_[x, ratio], np.r_[units, ratio], low, high

    def split(self, z):
        """Return the design's unknowns, the ratios, and their slopes by all unknowns."""
        steady, law, n = self.steady, self.steady.physics.law, self.steady.speeds.size
        if not steady.physics.states:
            return z[:-n], z[-n:], np.eye(n, z.size, z.size - n)
        gains, radius = self.design.gains(z), self.design.blade(z).rotor_radius
        speed = law.speed_at_rest(steady.speeds, gains)
        by = np.zeros((n, z.size))
        by[:, z.size - gains.size :] = law.speed_at_rest_by_gain(steady.speeds, gains).T
        stations = np.zeros((1, self.design.blade(z).r.size))
        by_radius = self.design.by_unknowns(*3 * (stations,), np.ones(1))
        by[:, : z.size - gains.size] = speed[:, None] / radius * by_radius
        return z, speed * radius / steady.speeds, by * (radius / steady.speeds)[:, None]

    def values(self, z):
        """Return objective, equalities = 0 and inequalities >= 0, each with its slopes."""
        steady, design = self.steady, self.design
        physics, law = steady.physics, steady.physics.law
        x, ratio, own = self.split(z)
        here = self._coefficients(x, ratio, own, physics.load_names)
        rooms = [partial(_room, limit) for limit in steady.limits]
        (rate, rate_by), *above = self._chained([physics.objective.rate_of, *rooms], *here)
        nothing = np.empty(0), np.empty((0, z.size))
        equal, above = [nothing], [nothing, *above]
        if law is not None and not physics.states:
            gains, share = design.gains(x), 1.0 - self.slowed

            def unit(known):
                radius, flow = known["rotor_radius"], known["inflow_speed"]
                return TYPICAL * torque_scale(known["density"], radius, flow)

            def net(known):  # torque that accelerates the rotor, over a typical one
                torque = law.torque(known["rotor_speed"], gains)
                return (known["hydrodynamic_torque"] - torque) / unit(known)

            slowed = self._coefficients(x, share * ratio, share * own, ())
            for rows, at, least in ((equal, here, 0.0), (above, slowed, SAFE)):
                ((value, by),) = self._chained([net], *at)
                known = steady.known(at[0])
                by_gains = law.torque_by_gain(known["rotor_speed"], gains) / unit(known)
                by[:, x.size - gains.size : x.size] -= by_gains.T
                rows.append((value - least, by))
        weights = steady.weights
        return float(weights @ rate), weights @ rate_by, *_stacked(equal), *_stacked(above)

    def _chained(self, functions, values, slopes):
        """Return the values of functions of the known quantities, and their slopes.

        `values` and `slopes` are those of coefficients; the step between is complex.
        """
        steady, ones = self.steady, np.ones(self.steady.speeds.size)
        known = steady.known(values)
        found = [np.real(each(known)) * ones for each in functions]
        total = [0.0] * len(functions)
        for name, by in slopes.items():
            moved = steady.known(values | {name: values[name] + 1j * STEP})
            for place, each in enumerate(functions):
                total[place] += (np.imag(each(moved)) / STEP * ones)[:, None] * by
        return list(zip(found, total, strict=True))

    def _coefficients(self, x, ratio, own, names):
        """Return torque, named loads and what else quantities follow from at tip speed ratios.

        And their slopes by all unknowns; `own` has those of the ratios.
        """
        design, physics, blade = self.design, self.steady.physics, self.design.blade(x)
        none, density = np.zeros((1, blade.r.size)), physics.case.rotor.blade_material.density

        def by_all(by, by_ratio=0.0):  # by chord, twist, thickness and radius
            by = design.by_unknowns(*by)
            rest = np.zeros((len(by), own.shape[1] - by.shape[1]))
            return np.hstack((by, rest)) + np.reshape(by_ratio, (-1, 1)) * own

        mass = mass_and_inertia(blade, physics.section_area, density)
        values = {
            "ratio": ratio,
            "rotor_radius": blade.rotor_radius,
            "inertia": physics.mass_and_inertia(blade)[1],
        }
        by = mass.inertia_by_chord[None], none, mass.inertia_by_thickness[None]
        slopes = {
            "ratio": own,
            "rotor_radius": by_all((*3 * [none], np.ones(1)))[:1],
            "inertia": by_all((*by, np.array([3.0 * mass.inertia / blade.rotor_radius])))[:1],
        }
        found = bem.rotor_coefficients(blade, physics.polar, ratio, derivatives=True)
        values["torque"] = found.torque
        by = found.torque_by_chord, found.torque_by_twist, found.torque_by_thickness
        by = *by, found.torque_by_rotor_radius
        slopes["torque"] = by_all(by, found.torque_by_tip_speed_ratio)
        loads = physics.loads.coefficients(blade, ratio, True, names) if names else {}
        for name, load in loads.items():
            found = load.envelope(physics.loads.exponent)
            by = found.by_chord, found.by_twist, found.by_thickness, found.by_rotor_radius
            values[name] = found.values
            slopes[name] = by_all(by, found.by_tip_speed_ratio)
        return values, slopes


def _stacked(rows):
    """Return the values and the slopes of some rows of constraints, one after another."""
    values, slopes = zip(*rows, strict=True)
    return np.concatenate(values), np.vstack(slopes)


def _room(limit, known):
    """Return by how much a limit is kept, over its bound."""
    return 1.0 - limit.value_of(known) / limit.upper


def improve_schedule(joint: Joint, best: Schedule, rival: float = -np.inf) -> Schedule:
    """Improve a schedule by SLSQP within move limits, re-centred until nothing is gained.

    Limits that it exceeds by much are tightened in steps: each round begins near what it asks for.
    A schedule that remains far behind the objective of a rival is given up.
    """
    design = joint.design
    slack = best.excess if np.isfinite(best.excess) else 1.0
    for _ in range(ROUNDS):
        slack = TIGHTENED * slack if slack > LOOSE else 0.0
        center, units, low, high = joint.vector(best)
        reference = max(abs(best.objective), 1e-9)
        low, high = low / units, high / units
        z = _solve(joint, center / units, low, high, units, reference, slack) * units
        x, ratio, _ = joint.split(z)
        value, _, equal, _, above, _ = joint.values(z)
        excess = float(max(np.max(-above, initial=-np.inf), np.max(np.abs(equal), initial=-np.inf)))
        better = replace(
            best,
            blade=design.blade(x),
            gains=design.gains(x),
            ratio=ratio,
            objective=value,
            excess=excess,
        )
        kept, objective = best.worth
        if slack == 0.0 and better.worth <= (kept, objective + GAIN * abs(objective)):
            break
        gained, missing = better.objective - best.objective, rival - better.objective
        best = better
        if missing > max(BEHIND * abs(rival), LAST * gained):
            break
    return best


def _solve(joint, start, low, high, units, objective, slack):
    """Return the unknowns over their units with the largest objective that keeps the limits.

    The limits may be exceeded by the slack.
    """

    @lru_cache(maxsize=2)
    def at(z):
        return joint.values(np.array(z) * units)

    def of(place, slack=0.0):
        return {
            "fun": lambda z: at(tuple(z))[place] + slack,
            "jac": lambda z: at(tuple(z))[place + 1] * units,
        }

    scale = -100.0 / objective
    constraints = [{"type": "ineq"} | of(4, slack)]
    if joint.steady.physics.law is not None and not joint.steady.physics.states:
        constraints.append({"type": "eq"} | of(2))
    return minimize(
        lambda z: scale * at(tuple(z))[0],
        np.clip(start, low, high),
        jac=lambda z: scale * at(tuple(z))[1] * units,
        method="SLSQP",
        bounds=Bounds(low, high),
        constraints=constraints,
        options={"ftol": 1e-6, "maxiter": ROUGH if slack else MOST},
    ).x
