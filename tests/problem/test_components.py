"""Limits and objectives as components: their formulas, and all partials by complex step."""

from typing import ClassVar

import numpy as np
import pytest

from hkt_mdo.dynamics.aggregates import Expected, Worst
from hkt_mdo.dynamics.flows import SineInflow
from hkt_mdo.dynamics.laws import LinearFeedback, QuadraticFeedback
from hkt_mdo.dynamics.limits import DistanceFromStall, Limit, TorqueLimit
from hkt_mdo.dynamics.objectives import INTEGRALS, CapturedEnergy, Objective
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.dynamics.wide_laws import PowerLawFeedback
from hkt_mdo.problem.components import AggregateComp, FormulaComp, LinearComp
from hkt_mdo.quantities import names
from hkt_mdo.rotor.torque_curve import TorqueSpline
from tests.conftest import checked

N, RADIUS, DENSITY = 6, 1.4, 998.0
NODES = np.linspace(2.0, 12.0, 41)
TABLE = 0.09 * np.exp(-((NODES - 6.0) ** 2) / 20.0)


class PowerPerInertia(Limit):
    """A limit on quantities over time and on every scalar of the design."""

    name: ClassVar[str] = "power_per_inertia"
    unit: ClassVar[str | None] = None
    inputs: ClassVar[tuple[str, ...]] = (
        "generator_power", "rotor_speed", "inertia", "rotor_radius", "density"
    )  # fmt: skip

    def value(self, generator_power, rotor_speed, inertia, rotor_radius, density):
        return generator_power / (inertia * rotor_speed**2) / (density * rotor_radius**3)


class PaidPower(Objective):
    """An objective of power, speed and the size of the rotor."""

    kind: str = "paid"
    inputs: ClassVar[tuple[str, ...]] = ("generator_power", "rotor_speed", "rotor_radius")

    def rate(self, generator_power, rotor_speed, rotor_radius):
        return generator_power - 2.0 * rotor_speed**2 * rotor_radius


def operation():
    """Return speeds of a rotor and a flow at tip speed ratios from 4 to 9."""
    flow = SineInflow().speed_at(np.linspace(0.0, 20.0, N))
    return np.linspace(4.0, 9.0, N) * flow / RADIUS, flow


@pytest.mark.parametrize("slowed", [0.02, 0.08])
@pytest.mark.parametrize(
    ("law", "gains"),
    [
        (QuadraticFeedback(torque_limit=700.0), [7.2]),
        (LinearFeedback(), [68.0]),
        (PowerLawFeedback(torque_limit=900.0), [20.0, 1.6]),
        (Tracking(knots=3, flow_range=(1.2, 1.8), torque_limit=700.0), [6, 7.5, 9, 150, 600]),
    ],
    ids=["quadratic, limited", "linear", "two gains", "states"],
)
def test_distance_from_stall(law, gains, slowed):
    """N(0.98 w) - N(w) less what is asked for, N = 0.5 rho pi R^3 v^2 Cq - u.

    While the states of a law stay as they are; N(0.92 w) in the search for a start.
    """
    (speed, flow), spline = operation(), TorqueSpline(NODES)
    limit = DistanceFromStall(law=law, spline=spline, slowed=slowed)
    rest = law.at_rest(np.linspace(300.0, 650.0, N), np.linspace(1.4, 1.6, N))
    problem = checked(
        FormulaComp(formula=limit, size=N),
        rotor_speed=speed,
        inflow_speed=flow,
        torque_coefficient_table=TABLE,
        density=DENSITY,
        rotor_radius=RADIUS,
        **{f"gain_{i}": gain for i, gain in enumerate(gains)},
        **dict(zip(law.states, rest, strict=True)),
    )
    unit = 0.5 * DENSITY * np.pi * RADIUS**3 * flow**2

    def braking(w):
        return law.torque(w, np.array(gains), *rest)

    def net(w):
        return unit * (spline.basis(w * RADIUS / flow) @ TABLE) - braking(w)

    expected = net((1.0 - slowed) * speed) - net(speed) - 5e-3 * 0.05 * unit
    # a difference of torques: its rounding is theirs
    rounding = 1e-14 * float(np.max(braking(speed)))
    np.testing.assert_allclose(problem.get_val("value"), expected, rtol=1e-12, atol=rounding)


def test_a_limit_of_time_and_design():
    speed, _ = operation()
    power = np.linspace(2e3, 5e3, N)
    problem = checked(
        FormulaComp(formula=PowerPerInertia(), size=N),
        generator_power=power,
        rotor_speed=speed,
        inertia=3.5,
        rotor_radius=RADIUS,
        density=DENSITY,
    )
    expected = power / (3.5 * speed**2) / (DENSITY * RADIUS**3)
    np.testing.assert_allclose(problem.get_val("value"), expected, rtol=1e-14)


def test_excess_is_counted_in_bounds():
    """Above the upper or below the lower bound, over the larger of the two."""
    limit = TorqueLimit(bound=500.0)
    torque = np.array([-50.0, 0.0, 250.0, 500.0, 600.0])
    over = limit.excess({"control_torque": torque})
    np.testing.assert_allclose(over, [0.1, 0.0, -0.5, 0.0, 0.2], atol=1e-15)


def test_every_quantity_of_the_whole_result_has_an_integrand():
    assert tuple(INTEGRALS) == names(over="result")


def test_integrals_are_weighted_sums_over_all_scenarios():
    weights = {"sine": np.array([0.5, 2.0, 1.5]), "step": np.array([1.0, 0.25])}
    rng = np.random.default_rng(3)
    values = {name: rng.uniform(1.0, 9.0, each.size) for name, each in weights.items()}
    rows = {name: [each] for name, each in weights.items()}
    problem = checked(LinearComp(rows, "W", "energy", {"units": "J"}), **values)
    expected = sum(weight @ values[name] for name, weight in weights.items())
    assert problem.get_val("energy")[0] == pytest.approx(expected, rel=1e-14)


def test_a_rate_of_power_speed_and_size():
    power, speed = np.random.default_rng(3).uniform(1.0, 9.0, (2, N))
    inputs = {"generator_power": power, "rotor_speed": speed, "rotor_radius": RADIUS}
    problem = checked(FormulaComp(formula=PaidPower(), size=N), **inputs)
    expected = power - 2.0 * RADIUS * speed**2
    np.testing.assert_allclose(problem.get_val("value", units="W"), expected, rtol=1e-14)


class ThrustPerArea(Objective):
    """A rate of a load and of the shape along the span."""

    kind: str = "thrust_per_area"
    unit: ClassVar[str] = "Pa*s"
    maximize: ClassVar[bool] = False
    inputs: ClassVar[tuple[str, ...]] = ("thrust", "chord", "blade_area")

    def rate(self, thrust, chord, blade_area):
        return thrust / blade_area * (1.0 + chord[0] * chord[-1])


def test_a_rate_of_loads_span_and_design_is_a_mean_of_each_scenario():
    weights = {"a_1": [[0.2, 0.3], [0, 0]], "b": [[0, 0], [0.6, 0.4]], "a_2": [[0.5], [0]]}
    chord, thrust = np.array([0.2, 0.15, 0.1]), {"a_1": [3.0, 4.0], "b": [5.0, 6.0], "a_2": [7.0]}
    rates = {}
    for name, values in thrust.items():
        component = FormulaComp(formula=ThrustPerArea(), size=len(values))
        problem = checked(component, thrust=values, chord=chord, blade_area=0.5)
        rates[name] = problem.get_val("value", units="Pa")
    problem = checked(LinearComp(weights, "Pa", "mean_rate", {"units": "Pa"}), **rates)
    means = [0.2 * 3.0 + 0.3 * 4.0 + 0.5 * 7.0, 0.6 * 5.0 + 0.4 * 6.0]
    expected = np.array(means) / 0.5 * (1.0 + 0.2 * 0.1)
    np.testing.assert_allclose(problem.get_val("mean_rate"), expected, rtol=1e-14)


class ShareAbove(Limit):
    """A limit on a load that depends on the blade's twist at every station."""

    name: ClassVar[str] = "share_above"
    unit: ClassVar[str] = "N"
    inputs: ClassVar[tuple[str, ...]] = ("thrust", "twist")

    def value(self, thrust, twist):
        return thrust * np.sum(twist**2)


class LargestMeanChord(Limit):
    """A limit whose one value follows from the chord at all stations."""

    name: ClassVar[str] = "mean_chord"
    unit: ClassVar[str] = "m"
    inputs: ClassVar[tuple[str, ...]] = ("chord",)

    def value(self, chord):
        return np.mean(chord)


def test_limits_along_the_span_and_over_time_with_it():
    twist, thrust = np.array([0.3, 0.2, 0.1]), np.linspace(1e3, 2e3, N)
    limit = ShareAbove()
    problem = checked(FormulaComp(formula=limit, size=N), thrust=thrust, twist=twist)
    np.testing.assert_allclose(problem.get_val("value"), thrust * 0.14, rtol=1e-14)
    mean = LargestMeanChord()
    assert (limit.place, mean.place) == ("time", "span")
    problem = checked(FormulaComp(formula=mean), chord=[0.3, 0.2, 0.4])
    np.testing.assert_allclose(problem.get_val("value"), [0.3], rtol=1e-15)


def test_aggregates_of_mean_rates():
    rates, shares = np.array([4e3, 2e3, 3e3]), np.array([0.5, 0.3, 0.2])
    options = {"shares": shares, "duration": 60.0, "objective": CapturedEnergy()}
    component = AggregateComp(aggregate=Expected(), **options)
    problem = checked(component, mean_rate=rates)
    expected = 60.0 * (0.5 * 4e3 + 0.3 * 2e3 + 0.2 * 3e3)
    np.testing.assert_allclose(problem.get_val("objective"), expected, rtol=1e-15)
    worst = Worst()
    component = AggregateComp(aggregate=worst, **options)
    problem = checked(component, mean_rate=rates, unknowns=[1.5e3])
    np.testing.assert_allclose(problem.get_val("objective"), 60.0 * 1.5e3)
    np.testing.assert_allclose(problem.get_val("rows"), [2.5e3, 0.5e3, 1.5e3])
    assert worst.of(rates, shares) == 2e3
