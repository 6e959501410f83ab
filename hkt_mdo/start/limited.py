"""The search under limits: blade, gains and the schedule of the rotor's speed together.

Objective and constraints are those of a `SteadyFlow`, with exact slopes by all unknowns.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from hkt_mdo.dynamics.laws import STEP
from hkt_mdo.dynamics.limits import TYPICAL
from hkt_mdo.problem.physics import START_EXCESS
from hkt_mdo.problem.point import KEPT_EXCESS, PRICE, StartingPoint
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.start.improve import WIDE, Round, Search, Settings, Values
from hkt_mdo.start.quasi_steady import SAFE
from hkt_mdo.start.steady_flow import SteadyFlow


class LimitedSearch(Search):
    """Objective and constraints over one vector: the design's unknowns, then the tip speed ratios.

    Under a law with states there are no ratios in it: they follow from its gains.

    Parameters
    ----------
    steady : SteadyFlow
        Speeds of the flow, limits and law.
    slowed : float
        Share of its speed that a rotor under feedback must be able to lose.
    """

    # rounds end early: with this many constraints most of the gain is in the first iterations
    settings = Settings(rounds=16, iterations=40, tolerance=1e-6, tightens=True)
    second = Settings(
        rounds=30, iterations=40, tolerance=1e-6, moves=WIDE, ratio=1.5, price=PRICE, gain=1e-6
    )

    def __init__(self, steady: SteadyFlow, slowed: float):
        super().__init__(steady.physics)
        self.steady, self.slowed = steady, slowed

    @staticmethod
    def rank(point: StartingPoint) -> tuple:
        """Return the rank of a point, `StartingPoint.merit`."""
        return point.merit

    @property
    def _balances(self):
        """Whether a law's balance of torques ties the ratios to the gains."""
        physics = self.physics
        return physics.law.is_static

    def around(self, point: StartingPoint, settings: Settings) -> Round:
        """Return the optimization round a point, within the moves of some settings."""
        x, units = self.vector(point)
        ratio = point.ratio[: 0 if self.physics.states else None]
        low, high = self.bounds(point, settings.moves)
        return Round(
            np.r_[x, ratio],
            np.r_[units, ratio],
            np.r_[low, ratio / settings.ratio],
            np.r_[high, ratio * settings.ratio],
            self.values,
            lambda _, point: point.worth_within(START_EXCESS),
        )

    def with_schedule_anew(self, point):
        return None if self.law.is_feedback else self.steady.on_branch(point, point.branch)

    def measured(self, point: StartingPoint) -> StartingPoint:
        """Return a point with its objective and with what it exceeds, on the schedule it has."""
        unknowns = np.r_[self.vector(point)[0], point.ratio]
        return self.point(unknowns, self.values(unknowns), point)

    def point(self, unknowns: np.ndarray, values: Values, origin: StartingPoint) -> StartingPoint:
        """Return the point of some unknowns, (n,), and of the values there."""
        x, ratio, ratio_by = self._split(unknowns)
        coefficients, _ = self._with_slopes(x, ratio, ratio_by, ())
        excess = -values.above, np.abs(values.equal)
        excess = float(max(np.max(part, initial=-np.inf) for part in excess))
        names = np.repeat([limit.name for limit in self.steady.limits], ratio.size)
        names = [*names, *["distance_from_stall"] * (values.above.size - names.size)]
        over = {name for name, room in zip(names, values.above, strict=True) if -room > KEPT_EXCESS}
        if np.any(np.abs(values.equal) > KEPT_EXCESS):
            over.add("balance_of_torques")
        blade, gains = self.blade(x), self.gains(x)
        return replace(
            origin,
            blade=blade,
            gains=gains,
            ratio=ratio,
            operation=self.steady.operation(self.steady.quantities(coefficients)),
            objective=values.objective,
            excess=excess,
            exceeds=tuple(sorted(over)),
        )

    def _split(self, z):
        """Return the design's unknowns, the ratios, and their slopes by all unknowns."""
        steady, law, n = self.steady, self.law, self.steady.speeds.size
        if not steady.physics.states:
            return z[:-n], z[-n:], np.eye(n, z.size, z.size - n)
        blade, gains = self.blade(z), self.gains(z)
        radius, speed = blade.rotor_radius, law.speed_at_rest(steady.speeds, gains)
        by = np.zeros((n, z.size))
        by[:, z.size - gains.size :] = law.speed_at_rest_by_gain(steady.speeds, gains).T
        stations = np.zeros((1, blade.r.size))
        by_radius = self.slopes(*3 * (stations,), np.ones(1))
        by[:, : z.size - gains.size] = speed[:, None] / radius * by_radius
        return z, speed * radius / steady.speeds, by * (radius / steady.speeds)[:, None]

    def values(self, z: np.ndarray) -> Values:
        """Return objective and constraints at some unknowns, (n,)."""
        steady, physics = self.steady, self.physics
        x, ratio, ratio_by = self._split(z)
        here = self._with_slopes(x, ratio, ratio_by, physics.load_names)
        rooms = [partial(_room, limit) for limit in steady.limits]
        (rate, rate_by), *above = self._chained([physics.start_objective.rate_of, *rooms], *here)
        none = np.empty(0), np.empty((0, z.size))
        equal, above = [none], [none, *above]
        if self._balances:
            share = 1.0 - self.slowed
            slowed = self._with_slopes(x, share * ratio, share * ratio_by, ())
            equal.append(self._net_torque(x, here))
            net, net_by = self._net_torque(x, slowed)
            above.append((net - SAFE, net_by))
        weights = steady.weights
        return Values(float(weights @ rate), weights @ rate_by, *_stacked(equal), *_stacked(above))

    def _net_torque(self, x, coefficients):
        """Return the torque that accelerates the rotor, over a typical one, and its slopes."""
        steady, law, gains = self.steady, self.law, self.gains(x)

        def unit(quantities):
            radius, flow = quantities["rotor_radius"], quantities["inflow_speed"]
            return TYPICAL * torque_scale(quantities["density"], radius, flow)

        def net(quantities):
            torque = law.torque(quantities["rotor_speed"], gains)
            return (quantities["control_torque"] - torque) / unit(quantities)

        ((value, by),) = self._chained([net], *coefficients)
        quantities = steady.quantities(coefficients[0])
        by_gains = law.torque_by_gain(quantities["rotor_speed"], gains) / unit(quantities)
        by[:, x.size - gains.size : x.size] -= by_gains.T
        return value, by

    def _chained(self, functions, values, slopes):
        """Return the values of functions of the steady quantities, and their slopes.

        `values` and `slopes` are those of coefficients; the step between is complex.
        """
        steady, ones = self.steady, np.ones(self.steady.speeds.size)
        quantities = steady.quantities(values)
        results = [np.real(function(quantities)) * ones for function in functions]
        total = [0.0] * len(functions)
        for name, by in slopes.items():
            moved = steady.quantities(values | {name: values[name] + 1j * STEP})
            for place, function in enumerate(functions):
                total[place] += (np.imag(function(moved)) / STEP * ones)[:, None] * by
        return list(zip(results, total, strict=True))

    def _with_slopes(self, x, ratio, ratio_by, names):
        """Return torque, named loads and other inputs of the quantities at tip speed ratios.

        And their slopes by all unknowns; `ratio_by` has those of the ratios.
        """
        physics, blade = self.physics, self.blade(x)
        none = np.zeros((1, blade.r.size))

        def by_all(by, by_ratio=0.0):  # by chord, twist, thickness and radius
            by = self.slopes(*by)
            rest = np.zeros((len(by), ratio_by.shape[1] - by.shape[1]))
            return np.hstack((by, rest)) + np.reshape(by_ratio, (-1, 1)) * ratio_by

        mass = physics.rotor.blades_alone(blade)
        values = {
            "ratio": ratio,
            "rotor_radius": blade.rotor_radius,
            "inertia": physics.mass_and_inertia(blade)[1],
            "weight_stress": 0.0,
        }
        by = mass.inertia_by_chord, mass.inertia_by_twist, mass.inertia_by_thickness
        by = tuple(each[None] for each in by)
        slopes = {
            "ratio": ratio_by,
            "rotor_radius": by_all((*3 * [none], np.ones(1)))[:1],
            "inertia": by_all((*by, np.array([3.0 * mass.inertia / blade.rotor_radius])))[:1],
        }
        if names and physics.asks_for("weight_stress"):
            weight = physics.loads.weight_stress(blade)
            by = weight.by_chord, weight.by_twist, weight.by_thickness, weight.by_rotor_radius
            values["weight_stress"], slopes["weight_stress"] = weight.values[0], by_all(by)[:1]
        flow = physics.rotor.sections(blade, ratio, True) if names else None
        rotor = physics.rotor.coefficients(blade, ratio, True, flow)
        values["torque"] = rotor.torque
        by = rotor.torque_by_chord, rotor.torque_by_twist, rotor.torque_by_thickness
        by = *by, rotor.torque_by_rotor_radius
        slopes["torque"] = by_all(by, rotor.torque_by_tip_speed_ratio)
        loads = physics.loads.coefficients(blade, ratio, True, names, flow) if names else {}
        for name, load in loads.items():
            largest = load.envelope(physics.loads.exponent)
            by = largest.by_chord, largest.by_twist, largest.by_thickness, largest.by_rotor_radius
            values[name] = largest.values
            slopes[name] = by_all(by, largest.by_tip_speed_ratio)
        return values, slopes


def _stacked(rows):
    """Return the values and the slopes of some rows of constraints, one after another."""
    values, slopes = zip(*rows, strict=True)
    return np.concatenate(values), np.vstack(slopes)


def _room(limit, quantities):
    """Return the distance of a value from its limit, over the bound."""
    return 1.0 - limit.value_of(quantities) / limit.upper
