"""Loads of a blade on many stations: against that blade as a case of its own, and their check."""

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.problem.evaluation import loads_along
from hkt_mdo.problem.physics import physics
from hkt_mdo.run import loads
from tests.conftest import NINE

LIMITS = {"thrust": "6 kN", "stress": "100 MPa", "cavitation": {"depth": 3}}
CASE = {"inflow": "sine", "control": "quadratic", "limits": LIMITS}
SERIES = {
    "time": np.array([0.0, 1.0, 2.0]),
    "inflow_speed": np.array([1.4, 1.7, 1.6]),
    "tip_speed_ratio": np.array([7.0, 7.0, 6.0]),
    "rotor_radius": 1.4,
}


def of_case(**rotor):
    """Return the physics of a limited case and its blade."""
    made = physics(load_case(CASE | {"rotor": rotor}))
    return made, made.blade


def loads_of(made, blade, series=SERIES):
    return loads_along(made.rotor, blade, series, ("thrust", "stress", "cavitation"))


def resolved(made, blade, series):
    return loads.resolved(made, blade, made.scenarios[0], series)


def test_a_resolved_blade_is_that_of_a_case_with_its_stations():
    made, blade = of_case(stations=NINE)
    series = resolved(made, blade, SERIES | loads_of(made, blade))
    angle = np.pi * (np.arange(loads.STATIONS) + 0.5) / loads.STATIONS
    inner = blade.hub_radius / blade.tip_radius
    r = inner + (1.0 - inner) * 0.5 * (1.0 - np.cos(angle))
    chord, twist = (np.interp(r * 1.4, blade.r, each) for each in (blade.chord, blade.twist))
    shape = {"chord": chord.tolist(), "twist": np.rad2deg(twist).tolist()}
    rotor = {"stations": r.tolist(), "hub_radius_fraction": inner} | shape
    other = physics(load_case(CASE | {"rotor": rotor, "design": {"blade": "fixed"}}))
    worst = np.searchsorted(SERIES["time"], series["time"])
    for name, values in loads_of(other, other.blade).items():
        np.testing.assert_allclose(series[name], values[worst], rtol=1e-9)
    columns = {"chord": blade.chord.tolist(), "twist": np.rad2deg(blade.twist).tolist()}
    in_case = of_case(stations=NINE, hub_radius_fraction=inner, **columns)
    again = resolved(*in_case, SERIES | loads_of(*in_case))
    np.testing.assert_allclose(again["stress"], series["stress"], rtol=1e-6)
    # all loads are largest in the fastest flow
    assert series["time"] == pytest.approx([1.0])
    assert series["rotor_radius"] == 1.4
    # between nine stations a blade is more heavily loaded than at them
    assert np.max(series["thrust"]) > 1.005 * np.max(loads_of(made, blade)["thrust"])


def test_a_resolved_blade_changes_little_where_it_has_the_default_stations():
    made, blade = of_case()
    assert blade.r.size == 40
    base = loads_of(made, blade)
    series = resolved(made, blade, SERIES | base)
    for name, values in base.items():
        assert np.max(series[name]) == pytest.approx(np.max(values), rel=5e-3)


def test_a_designed_thickness_is_resolved_too():
    case = load_case("cases/examples/designed_thickness.yaml", ["rotor.stations=" + str(NINE)])
    made = physics(case)
    base = loads_along(made.rotor, made.blade, SERIES, ("stress",))
    assert np.max(resolved(made, made.blade, SERIES | base)["stress"]) > np.max(base["stress"])


def test_loads_that_nobody_asks_for_are_not_resolved():
    made = physics(load_case(CASE | {"limits": {"power": "5 kW"}}))
    assert made.blade.r.size == 40
    assert resolved(made, made.blade, SERIES) is None
