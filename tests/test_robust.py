"""One design for many flows: measures of risk, realizations and what differs between scenarios.

The measures are held to their definitions: to linear programs by SciPy, to their limits, to equal
flows that count as one, and to designs that another measure has found.
"""

import numpy as np
import pytest
from scipy.optimize import linprog

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.aggregates import ConditionalValueAtRisk, Expected, Worst
from hkt_mdo.dynamics.objectives import CapturedEnergy
from hkt_mdo.problem.components import AggregateComp
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.words import texts
from hkt_mdo.run.run import run_case
from hkt_mdo.run.verification import plant_of
from tests.conftest import checked

RATES, SHARES = np.array([2.0, 5.0, 3.0, 1.0, 4.0]) * 1e3, np.array([0.3, 0.2, 0.1, 0.0, 0.4])
MEASURES = {"worst": Worst(), "cvar": ConditionalValueAtRisk(share=0.5)}
TURBULENCE = {"profile": "turbulence", "mean": 1.5, "seed": 7}


def case(*scenarios, law="quadratic", duration=8.0, segments=6, **sections):
    control = {"law": law, "torque_limit": 700.0}
    phase = {"duration": duration, "segments": segments}
    return {"control": control, "phase": phase, "scenarios": list(scenarios), **sections}


def run(out, data):
    return run_case(load_case(data), out, figures=False, records=False)


# Measures -----------------------------------------------------------------------------------------


def by_linear_program(aggregate, rates, shares):
    """Return the largest value over the unknowns within the rows, both of which are linear."""
    size = aggregate.best_unknowns(rates, shares).size
    if not size:
        return aggregate.value(rates, shares, np.empty(0))
    origin, units = np.zeros(size), np.eye(size)
    value = np.array([aggregate.value(rates, shares, unit) for unit in units])
    rows = aggregate.rows(rates, shares, origin)
    slopes = np.array([aggregate.rows(rates, shares, unit) - rows for unit in units]).T
    result = linprog(-value, -slopes, rows, bounds=(None, None))
    assert result.success
    return -result.fun


@pytest.mark.parametrize("share", [0.01, 0.3, 0.45, 0.8, 1.0])
def test_the_conditional_value_at_risk_is_that_of_a_linear_program(share):
    """And the mean over the worst share of time, which a sum over sorted rates has too."""
    cvar = ConditionalValueAtRisk(share=share)
    value = cvar.of(RATES, SHARES)
    assert value == pytest.approx(by_linear_program(cvar, RATES, SHARES), rel=1e-12)
    left, total = share, 0.0
    for rate, part in sorted(zip(RATES, SHARES, strict=True)):
        total, left = total + rate * min(part, left), left - min(part, left)
    assert value == pytest.approx(total / share, rel=1e-12)
    assert np.all(cvar.rows(RATES, SHARES, cvar.best_unknowns(RATES, SHARES)) >= 0.0)


def test_the_measures_meet_at_their_ends():
    """CVaR of all is the mean; of less than the worst's share, the worst, which has a share."""
    mean, worst = Expected().of(RATES, SHARES), MEASURES["worst"].of(RATES, SHARES)
    assert ConditionalValueAtRisk(share=1.0).of(RATES, SHARES) == pytest.approx(mean, rel=1e-14)
    assert ConditionalValueAtRisk(share=0.3).of(RATES, SHARES) == worst == 2e3
    assert worst == pytest.approx(by_linear_program(MEASURES["worst"], RATES, SHARES), rel=1e-12)
    for measure, deciding in (("worst", [0]), ("cvar", [0, 2, 4])):
        assert list(np.flatnonzero(MEASURES[measure].binding(RATES, SHARES))) == deciding


@pytest.mark.parametrize("measure", MEASURES)
def test_partials_of_the_measures_are_exact_and_sparse(measure):
    aggregate = MEASURES[measure]
    unknowns = aggregate.best_unknowns(RATES, SHARES)
    options = {"duration": 60.0, "objective": CapturedEnergy()}
    component = AggregateComp(aggregate=aggregate, shares=SHARES, **options)
    checked(component, 1e-12, 1e-12, mean_rate=RATES, unknowns=unknowns - 10.0)
    by_rate = component._subjacs_info["part.rows", "part.mean_rate"]
    assert by_rate["val"].size == 4  # each scenario with a share of time is in one row


# Realizations -------------------------------------------------------------------------------------


def test_realizations_are_scenarios_of_consecutive_seeds_that_share_a_weight():
    flows = {"name": "river", "inflow": TURBULENCE, "weight": 0.6, "realizations": 3}
    made = load_case(case(flows, {"inflow": "sine", "weight": 0.4}))
    assert [each.name for each in made.scenarios] == ["river_1", "river_2", "river_3", "flow_2"]
    assert [each.inflow.seed for each in made.scenarios[:3]] == [7, 8, 9]
    assert sum(each.weight for each in made.scenarios[:3]) == pytest.approx(0.6, rel=1e-15)
    written = [
        {"name": f"river_{i + 1}", "inflow": TURBULENCE | {"seed": 7 + i}, "weight": 0.6 / 3}
        for i in range(3)
    ]
    assert made == load_case(case(*written, {"name": "flow_2", "inflow": "sine", "weight": 0.4}))
    parts = {"profile": "sum", "parts": [{"profile": "constant", "speed": 1.0}, TURBULENCE]}
    made = load_case(case({"realizations": 2}, inflow=parts))
    assert [each.inflow.parts[1].seed for each in made.scenarios] == [7, 8]


# Designs ------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_ceilings_are_those_of_theory():
    """Of a constant flow: the steady optimum's power, or the limit where that is smaller."""
    flows = [{"inflow": {"profile": "constant", "speed": v}} for v in (1.2, 2.0)]
    data = case(*flows, robustness="worst", limits={"power": "5 kW"})
    del data["control"]["torque_limit"]
    made = physics(load_case(data))
    best = made.rotor.best_of_shape(made.shape, made.blade).power_coefficient
    power = 0.5 * made.density * np.pi * made.blade.rotor_radius**2 * best * 1.2**3
    assert made.ceilings == pytest.approx({"flow_1": power, "flow_2": 5e3}, rel=1e-9)
    mean = 0.5 * (power + 5e3)
    np.testing.assert_allclose(made.rate_factors, [mean / power, mean / 5e3], rtol=1e-9)


@pytest.mark.slow
def test_two_equal_flows_are_one_under_every_measure(tmp_path):
    tight, flow = {"driver": {"tolerance": 1e-10}}, {"inflow": "sine", "weight": 0.5}
    one = run(tmp_path / "one", case(flow, **tight))
    simulated = one.summary.simulated_energy_J
    for measure in ("worst", {"measure": "cvar", "share": 0.3}):
        solution = run(tmp_path / str(len(measure)), case(flow, flow, robustness=measure, **tight))
        assert solution.success, solution.message
        assert solution.energy == pytest.approx(one.energy, rel=1e-8)
        assert solution.summary.objective.simulated == pytest.approx(simulated, rel=1e-8)


@pytest.mark.slow
def test_the_worst_of_two_flows_is_larger_than_the_mean_s_design_has_it(tmp_path):
    """Under a torque limit, which a feedback law keeps by losing energy in one of the flows."""
    flows = [
        {"name": name, "inflow": {"profile": "sine", "mean": mean}, "weight": weight}
        for name, mean, weight in (("slow", 1.2, 0.8), ("fast", 1.8, 0.2), ("flood", 1.9, 0.0))
    ]
    data = case(*flows)
    data["control"]["torque_limit"] = 500.0

    def ratios(solution):
        parts = solution.summary.scenarios
        return {each: parts[each].mean_power_W / parts[each].ceiling_W for each in ("slow", "fast")}

    solutions = {}
    for name, measure in (("worst", "worst"), ("mean", {"measure": "cvar", "share": 1.0})):
        solutions[name] = run(tmp_path / name, data | {"robustness": measure})
        assert solutions[name].success, solutions[name].message
    worst, mean = ratios(solutions["worst"]), ratios(solutions["mean"])
    assert min(worst.values()) > min(mean.values()) * (1.0 + 1e-4)
    weigh = {"slow": 0.8, "fast": 0.2}
    averages = [sum(weigh[name] * each[name] for name in weigh) for each in (worst, mean)]
    assert averages[0] < averages[1]
    scenarios = solutions["worst"].summary.scenarios
    deciding = [name for name, each in scenarios.items() if each.decides]
    assert deciding == [name for name, x in worst.items() if x <= min(worst.values()) * (1 + 1e-4)]
    rows = texts(solutions["worst"].summary.rows(solutions["worst"].case))
    assert f"decided by {', '.join(deciding)}" in rows["objective, worst"]


# What differs between scenarios -------------------------------------------------------------------

WORN = {"lift": 0.95, "drag": 1.4, "inertia": 1.3, "torque_constant": 1.02}


@pytest.mark.slow
def test_a_scenario_of_its_own_turbine_is_that_of_the_case_with_it(tmp_path):
    """Water and condition of the one scenario, or of the whole case, are the same problem."""
    data = case({"inflow": "sine"}, limits={"thrust": "20 kN"}, design={"blade": "fixed"})
    data["control"]["torque_limit"] = 2e3
    ours = {"density": 1025.0, "condition": WORN}
    whole = {"fluid": {"density": 1025.0}, "condition": WORN}
    result = run(tmp_path / "own", data | {"scenarios": [{"inflow": "sine"} | ours]})
    expected = run(tmp_path / "case", data | whole)
    for solution in (result, expected):
        assert solution.success, solution.message
    assert result.gain == pytest.approx(expected.gain, rel=5e-3)  # flat, by curves of 1e-5
    assert result.energy == pytest.approx(expected.energy, rel=1e-5)
    scenario, whole_case = (each.summary.scenarios["flow_1"] for each in (result, expected))
    assert scenario.simulated_energy_J == pytest.approx(whole_case.simulated_energy_J, rel=1e-5)
    assert scenario.limits["control_torque"].limit == pytest.approx(1.02 * 2e3)
    models = physics(load_case(data)), physics(load_case(data | whole))
    nominal, heavier = (x.rotor.mass_and_inertia(models[0].blade)[1] for x in models)
    assert heavier == pytest.approx(1.3 * nominal, rel=1e-14)


def test_the_water_that_blades_move_is_that_of_the_scenario():
    """Its inertia, too: the integration had that of the case's own water."""
    rotor = {"blade": "bahaj2007", "added_inertia": "ellipse"}
    data = case({"inflow": "sine"}, {"inflow": "sine", "density": 2e3}, rotor=rotor)
    made = physics(load_case(data))
    river, sea = (plant_of(made, each, made.blade) for each in made.scenarios)
    water = made.rotor.water_inertias(made.blade)["ellipse"]
    assert sea.inertia - river.inertia == pytest.approx(water * (2e3 / made.density - 1.0))


def test_factors_on_lift_and_drag_are_those_of_a_polar_with_them(tmp_path):
    """A file whose columns are multiplied by hand says the same as the factors."""
    alpha = np.arange(-180.0, 181.0, 1.0)
    lift, drag = np.sin(np.deg2rad(2.0 * alpha)), 1.2 - np.cos(np.deg2rad(2.0 * alpha))
    files = {"clean": (lift, drag), "worn": (0.9 * lift, 1.5 * drag)}
    for name, columns in files.items():
        rows = "\n".join(f"{a},{x:.17g},{y:.17g}" for a, x, y in zip(alpha, *columns, strict=True))
        (tmp_path / f"{name}.csv").write_text(f"alpha_deg,cl,cd\n{rows}\n", encoding="utf-8")
    flows = [
        {"condition": {"lift": 0.9, "drag": 1.5}},
        {"condition": {"polar": str(tmp_path / "worn.csv")}},
        {},
    ]
    rotor = {"polar": str(tmp_path / "clean.csv")}
    made = physics(load_case(case(*flows, rotor=rotor, inflow="sine")))
    ratios = np.linspace(2.0, 9.0, 15)
    worn, file, clean = (
        made.rotor_in(each).coefficients(made.blade, ratios).torque for each in made.scenarios
    )
    np.testing.assert_allclose(worn, file, rtol=1e-9, atol=1e-12)
    assert np.all(worn < clean)


def test_realizations_of_a_turbine_are_draws_from_its_spread():
    """Mean, deviation and largest distance are those of a cut normal distribution."""
    spread = {"drag": 0.1, "inertia": 0.05, "density": 4.0, "torque_constant": 0.02}
    flows = {"inflow": "sine", "realizations": 200, "condition": {"drag": 1.4}, "spread": spread}
    made = load_case(case(flows)).scenarios
    for name, mean in (("drag", 1.4), ("inertia", 1.0), ("torque_constant", 1.0)):
        values = np.array([getattr(each.condition, name) for each in made])
        assert np.mean(values) == pytest.approx(mean, abs=4.0 * spread[name] / np.sqrt(200))
        assert np.std(values) == pytest.approx(spread[name], rel=0.2)
        assert np.max(np.abs(values - mean)) <= 3.0 * spread[name] * (1.0 + 1e-12)
    assert len({each.density for each in made}) == 200
    assert {each.condition.lift for each in made} == {1.0}
    assert load_case(case(flows)).scenarios == made
