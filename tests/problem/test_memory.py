"""A wake with memory in the optimization: two filters of its mean velocity, tables in a band."""

import numpy as np
import pytest

from hkt_mdo import build_problem, load_case
from hkt_mdo.dynamics.formulas import slope
from hkt_mdo.dynamics.rotor_ode import CurveComp, FilterComp, WakeComp
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.problem.components import LoadComp
from hkt_mdo.rotor.band import FACTORS, Band
from hkt_mdo.rotor.components import TablesComp
from hkt_mdo.rotor.scales import torque_scale
from tests.dynamics.aerodyn_runs import design_of

SHORT = "phase.duration=10", "phase.segments=5", "rotor.station_count=6"


def band_of(design, ratio, *ends):
    """Return the band of a design about a tip speed ratio, and its tables."""
    rotor, blade = design.physics.rotor, design.blade
    band = Band.of(rotor.polar, blade, ratio, np.linspace(*ends))
    tables = band.solve(rotor, blade, ["torque_coefficient"])
    return band, {name: each.values for name, each in tables.items()}


@pytest.mark.slow
@pytest.mark.parametrize("tau1", [None, 1])
def test_partials_are_exact(tau1, monkeypatch):
    """By central differences; the tables' own follow from those of the sections."""
    monkeypatch.setenv("OPENMDAO_CHECK_ALL_PARTIALS", "1")
    case = {"inflow": "sine", "control": "quadratic", "limits": {"thrust": "9 kN"}}
    case["inflow_dynamics"] = {"model": "oye", "tau1": tau1}
    problem = build_problem(load_case(case, SHORT), improve=False)
    problem.run_model()
    kinds, checked = (CurveComp, FilterComp, WakeComp, TablesComp, LoadComp), set()
    for part in problem.model.system_iter(recurse=True):
        if not isinstance(part, kinds):
            continue
        checked.add(type(part))
        options = {"form": "central", "step": 1e-6, "step_calc": "rel_avg", "out_stream": None}
        options["includes"] = [part.pathname]
        (partials,) = problem.check_partials(method="fd", **options).values()
        for pair, entry in partials.items():
            if "J_fwd" in entry:
                size = max(np.max(np.abs(entry["J_fd"])), 1e-9)
                assert np.max(np.abs(entry["J_fwd"] - entry["J_fd"])) < 1e-5 * size, pair
    assert checked == set(kinds)


@pytest.mark.parametrize(("tau1", "power"), [(1.0, 0), (1.0, 1), (1.8, 1)])
def test_two_filters_have_the_stability_of_all_stations(tau1, power):
    """Least inertias are within 12 % of those of the filters of all stations: 8.6, 59 and 106."""
    design, flow = design_of("paper"), 1.5
    plant, blade, ratio = design.plant.with_memory(tau1), design.blade, np.array([8.06])
    band, tables = band_of(design, 8.06, 7.0, 9.0, 41)
    curve, at = band.curve(tables["torque_coefficient_band"]), {"ratio": ratio, "wake_ratio": ratio}
    value, of_band = curve(**at)[0], [slope(curve, at, name, True)[0] for name in at]
    speed, scale = ratio * flow / 1.4, torque_scale(1000.0, 1.4, flow)
    stiffness = -power * scale * value / speed[0]
    share = band.weights @ (0.39 - 0.26 * (blade.r / blade.tip_radius) ** 2)
    slow, slopes = np.array([[tau1]]), (scale * 1.4 / flow) * np.array(of_band)
    law = np.full((1, 1, 1), stiffness)
    companion = Loop(slopes[:1], slopes[None, 1:], slow, share * slow, law, plant.inertia)
    held = type("Held", (), {"stiffness": stiffness})()
    whole = Loop.of(plant, held, speed, np.array([flow]))
    assert companion.least_inertia[0] == pytest.approx(whole.least_inertia[0], rel=0.12)
    assert companion.frozen[0] == pytest.approx(whole.frozen[0], rel=5e-3)


def test_the_integrated_two_filters_are_those_of_the_tables():
    """Direct BEM out of equilibrium: torque and rates; in equilibrium, that without memory."""
    design, flow = design_of("paper"), np.array([1.5, 1.3])
    plant, radius = design.plant.with_memory(1.0), design.blade.rotor_radius
    band, tables = band_of(design, 8.06, 7.0, 9.0, 17)
    mean, wake_ratio = plant.with_mean_wake(band), np.array([7.5, 8.25])
    ratio = np.array([1.05, 0.95]) * wake_ratio  # both at nodes of the tables
    speed, behind = ratio * flow / radius, wake_ratio * flow / radius
    rest = mean.wake.at_rest(behind, flow)
    whole = mean.torque(behind, flow, rest)
    np.testing.assert_allclose(whole, plant.torque(behind, flow), rtol=3e-5)
    value = band.curve(tables["torque_coefficient_band"])(ratio, wake_ratio)
    torque = mean.torque(speed, flow, rest)
    np.testing.assert_allclose(torque, torque_scale(1000.0, radius, flow) * value, rtol=3e-5)
    steady = band.spline.curve(tables["wake_induction_table"])(ratio)
    velocity, share = rest[:, 1], band.share
    rates = 0.4 * flow * steady - rest[:, 0], (rest[:, 0] + 0.6 * flow * steady - velocity) / share
    of_wake = mean.wake.rates(rest, flow, mean.wake.balanced(speed, flow))
    np.testing.assert_allclose(of_wake, np.stack(rates, axis=1), atol=1e-4)  # m/s²


def test_the_wake_of_an_induction_beyond_its_table_is_near_the_table():
    band, tables = band_of(design_of("paper"), 8.0, 6.0, 10.0, 41)
    table = tables["wake_induction_table"]
    ratio, slope = band.wake_ratio(table, np.array([0.0, table[0], table[20], table[-1], 3.0]))
    np.testing.assert_allclose(ratio[1:4], [6.0, 8.0, 10.0], atol=1e-9)
    np.testing.assert_allclose(ratio[[0, -1]], [5.75, 10.25], atol=0.25)
    assert np.all(slope >= 0.0)
    assert tables["torque_coefficient_band"].size == 41 * FACTORS.size
    assert band.direction == 1.0


def test_a_mean_induction_that_falls_gives_the_tip_speed_ratio_of_the_wake():
    """As under the limits, where the inner stations of a broad blade have most of the torque."""
    nodes = np.linspace(6.0, 10.0, 41)
    one, table, move = np.ones(1), 0.6 - 0.03 * nodes, 1e-6
    band = Band(nodes, one, one, 0.2, -1.0)
    ratio, slope = band.wake_ratio(table, np.array([0.36, 0.33, 0.3 + move, 0.2]))
    np.testing.assert_allclose(ratio[:2], [8.0, 9.0], atol=1e-9)
    np.testing.assert_allclose(slope[:3], -1.0 / 0.03, rtol=1e-6)
    assert 10.0 < ratio[3] < 10.5
    # as of `river25_short` under `rated`, whose induction rises up to a ratio of 3.3
    both, induction = 0.27 - 0.01 * (nodes - 7.0) ** 2, np.array([0.26, 0.23])
    np.testing.assert_allclose(band.wake_ratio(both, induction)[0], [8.0, 9.0], rtol=1e-4)
