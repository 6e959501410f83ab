"""A case as an OpenMDAO problem: totals, feasible starts, two scenarios, the public problem."""

from dataclasses import replace

import numpy as np
import pytest
from openmdao.utils.assert_utils import assert_check_totals
from threadpoolctl import threadpool_limits

from hkt_mdo import build_problem, load_case
from hkt_mdo.case import Phase, read_case
from hkt_mdo.dynamics.flows import StepInflow
from hkt_mdo.problem.build import assemble
from hkt_mdo.problem.evaluation import on_start
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.rotor.bem import Table
from hkt_mdo.rotor.model import RotorModel
from hkt_mdo.start.find import find_start
from hkt_mdo.start.steady import without_time
from hkt_mdo.start.steady_flow import KNOTS
from tests.test_extension_faults import TwoStates

VARIANTS = {
    "quadratic": "control: {law: quadratic, torque_limit: 700}",
    "linear": "control: {law: linear}",
    "open loop in speed": "control: {law: open_loop, torque_limit: 700}",
    "open loop in torque": "control: {law: open_loop, torque_limit: 700, unknown: torque}",
}
NODES = np.linspace(2.5, 9.0, 27)


def coarse_physics(control, more="", segments=5, extensions=()):
    phase = f"phase: {{segments: {segments}, duration: 20}}\nstart: {{method: blade}}"
    return physics(read_case(f"inflow: sine\n{control}\n{phase}\n{more}", extensions=extensions))


def assembled(model, **options):
    """Return the problem of some physics at the start of its own blade, run once."""
    start = find_start(model, model.rotor.best_operation(model.blade))
    problem = assemble(model, Setup(start, NODES, **options))
    problem.run_model()
    return problem, start


@pytest.fixture(scope="module", autouse=True)
def _one_thread():
    """As in a run: the matrices are small."""
    with threadpool_limits(1):
        yield


def test_a_state_that_is_zero_in_equilibrium_is_scaled():
    problem, _ = assembled(coarse_physics("control: two", extensions=[TwoStates]))
    assert all(np.isfinite(x).all() for x in problem.driver.get_constraint_values().values())


def check_totals(problem):
    options = {"method": "fd", "form": "central", "step": 1e-6, "step_calc": "rel_avg"}
    data = problem.check_totals(**options, out_stream=None, driver_scaling=True)
    assert_check_totals(data, atol=2e-6, rtol=2e-5)


@pytest.mark.parametrize("torque", ["curve", "direct"])
@pytest.mark.parametrize("name", VARIANTS)
def test_totals_of_a_coarse_problem(name, torque):
    """Every total derivative that the optimizer sees, against central differences.

    Substitution in the sparse Jacobian gives what OpenMDAO's linear solves give.
    """
    model = coarse_physics(VARIANTS[name], f"hydrodynamics: {{torque: {torque}}}")
    problem, _ = assembled(model)
    check_totals(problem)
    assert_sparse_totals_are_openmdaos(problem)


def test_totals_with_a_designed_set_angle():
    more = "rotor: {set_angle: 5}\ndesign: {blade: fixed, set_angle_bounds: [0, 10]}"
    check_totals(assembled(coarse_physics(VARIANTS["linear"], more))[0])


def test_totals_with_a_designed_hub_at_a_price():
    more = "inflow_dynamics: oye\ndesign: {hub_inertia_bounds: [1, 9], hub_inertia_price: 2e3}"
    check_totals(assembled(coarse_physics(VARIANTS["linear"], more, segments=2))[0])


@pytest.mark.parametrize("name", VARIANTS)
def test_the_start_is_nearly_feasible(name):
    """At the shipped second a segment; from an infeasible start optimizers wander off."""
    smooth = VARIANTS[name].replace(", torque_limit: 700", "")  # a limit leaves a kink in the start
    problem, start = assembled(coarse_physics(smooth, segments=20))
    assert problem.get_val("energy")[0] == pytest.approx(start.operation.energy, rel=1e-3)
    violations = {
        key: np.max(np.abs(values))
        for key, values in problem.driver.get_constraint_values().items()
        if "control_torque" not in key
    }
    # a schedule ends at the speed of its flow, and a fitted gain may be too close to stall
    tolerances = {"phase_gain_of_speed.change": 0.15, "limit_distance_from_stall.value": 0.06}
    assert all(over < tolerances.get(key, 0.05) for key, over in violations.items()), violations


def assert_sparse_totals_are_openmdaos(problem):
    driver = problem.driver
    problem.final_setup()
    driver._coloring_info.deactivate()
    sparse = problem.model.linear_solver.totals(driver, [*driver._objs, *driver._cons])
    expected = driver._compute_totals(return_format="array")
    totals = sparse.compute().toarray()
    np.testing.assert_allclose(totals, expected, rtol=1e-10, atol=1e-12 * np.max(np.abs(expected)))


@pytest.mark.parametrize("name", ["open loop in speed", "open loop in torque"])
def test_values_of_a_control_are_scaled_by_the_root_of_the_time_they_stand_for(name):
    """So that the same function of time has the same size on any mesh; one scale on equal ones."""
    model = coarse_physics(VARIANTS[name])
    equal = replace(model.scenarios[0], edges=np.linspace(0.0, 20.0, 11))
    control = "rotor_speed" if "speed" in name else "control_torque"

    def scales(scenario):
        problem, _ = assembled(replace(model, scenarios=(scenario,)))
        problem.final_setup()
        values = problem.driver.get_design_var_values
        name = f"traj.phase.controls:{control}"
        return values(driver_scaling=True)[name] / values(driver_scaling=False)[name]

    unequal = equal.divided(np.array([1, 4, 1, 1, 2, 1, 1, 1, 1, 16]))
    factors = scales(unequal)
    lengths = np.diff(unequal.edges)
    middles, shared = factors[1::2], factors[2:-1:2]
    np.testing.assert_allclose(middles / middles[0], np.sqrt(lengths / lengths[0]), rtol=1e-10)
    means = 0.5 * (lengths[1:] + lengths[:-1])
    np.testing.assert_allclose(shared / middles[0], np.sqrt(means / lengths[0]), rtol=1e-10)
    alike = scales(equal)
    np.testing.assert_allclose(alike, alike[0], rtol=1e-10)


def test_a_limit_is_narrowed_at_both_ends_where_it_is_exceeded_between_nodes():
    model = coarse_physics(VARIANTS["open loop in speed"])
    kept = np.ones(model.scenarios[0].segments)
    kept[2] = 0.98
    shares = {("control_torque", model.scenarios[0].name): kept}
    problem, _ = assembled(model, shares=shares)
    problem.final_setup()
    constraints = problem.model.get_constraints().items()
    (bounds,) = (meta for name, meta in constraints if name.endswith("control_torque"))
    narrowed = np.zeros(2 * kept.size + 1)  # where segments meet, the limit is held once
    narrowed[4:7] = 14.0
    np.testing.assert_allclose(bounds["lower"].ravel(), narrowed)
    np.testing.assert_allclose(bounds["upper"].ravel(), 700.0 - narrowed)


def test_an_open_loop_keeps_a_limit_between_nodes_where_it_nearly_binds():
    model = coarse_physics(VARIANTS["open loop in speed"])
    scenario, key = model.scenarios[0], ("control_torque", model.scenarios[0].name)

    def held(last):
        excess = np.tile(np.append(np.full(scenario.segments - 1, -0.5), last), (2, 1)).T
        shares = {key: np.ones(scenario.segments)}
        problem, _ = assembled(model, excess={key: excess}, shares=shares)
        problem.run_model()
        values = problem.driver.get_constraint_values(driver_scaling=False)
        return problem, [each for name, each in values.items() if "torque" in name]

    problem, (_, between) = held(-0.005)
    torque = problem.get_val(scenario.source("control_torque")).ravel()[-3:]
    parabola = np.polyfit([-1.0, 0.0, 1.0], torque, 2)
    np.testing.assert_allclose(between, np.polyval(parabola, [-0.5, 0.5]))
    # far from it the limit is not held: at the nodes of the last segment and the one before alone
    assert [[x.size for x in held(at)[1]] for at in (-0.005, -0.05, -0.5)] == [[4, 2], [4], []]


def test_a_limit_is_narrowed_at_one_speed_of_a_steady_scenario():
    flow = {"profile": "histogram", "speeds": [1.0, 1.1, 1.2], "hours": [1, 1, 1]}
    model = physics(load_case({"resource": flow, "control": "quadratic"}))
    scenario, limit = model.scenarios[0], model.all_limits[0]
    kept = np.linspace(0.9, 1.0, scenario.segments)
    shares = Setup(None, None, shares={(limit.name, scenario.name): kept})
    assert list(shares.share_at(limit, scenario, scenario.distinct_nodes)) == list(kept)


# Two scenarios ------------------------------------------------------------------------------------


def two_flows(model, segments=6):
    """Return some physics in its own flow and in a step, of another duration and mesh."""
    step = StepInflow(before=1.2, after=1.5, time=6.0, width=1.5)
    mesh = Phase(segments=segments, duration=12.0)
    other = Scenario(step, mesh, weight=0.3, name="step", limits=model.scenarios[0].limits)
    return replace(model, scenarios=(replace(model.scenarios[0], weight=0.7), other))


@pytest.mark.parametrize("name", VARIANTS)
def test_energy_of_two_scenarios_is_the_weighted_sum_of_the_single_ones(name):
    model = two_flows(coarse_physics(VARIANTS[name]))
    both, _ = assembled(model)
    for output in ("energy", "generator_energy", "objective"):
        parts = []
        for scenario in model.scenarios:
            weights = scenario.node_weights
            quantity = "generator_power" if output == "generator_energy" else "hydrodynamic_power"
            parts.append(weights @ both.get_val(f"{scenario.path}.{quantity}").ravel())
        expected = 0.7 * parts[0] + 0.3 * parts[1]
        assert both.get_val(output)[0] == pytest.approx(expected, rel=1e-13), output
    energies = []
    for scenario in model.scenarios:
        single, _ = assembled(replace(model, scenarios=(replace(scenario, weight=1.0),)))
        for name in single.model.get_design_vars():
            single.set_val(name, both.get_val(name))
        single.run_model()
        energies.append(single.get_val("energy")[0])
    expected = 0.7 * energies[0] + 0.3 * energies[1]
    assert both.get_val("energy")[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", VARIANTS)
def test_totals_of_two_scenarios(name):
    problem, _ = assembled(two_flows(coarse_physics(VARIANTS[name])))
    check_totals(problem)
    assert_sparse_totals_are_openmdaos(problem)


def test_totals_with_a_designed_radius_and_distance_from_stall_in_both_scenarios():
    model = two_flows(coarse_physics(VARIANTS["quadratic"], "design: {radius_bounds: [1.2, 1.6]}"))
    problem, _ = assembled(model)
    names = {f"limit_distance_from_stall{suffix}.value" for suffix in ("", "_step")}
    assert names <= set(problem.driver.get_constraint_values())
    check_totals(problem)


def test_a_torque_curve_has_no_more_nodes_than_its_tolerance_needs():
    models = (
        coarse_physics(VARIANTS["linear"], f"hydrodynamics: {{tolerance: {least}}}")
        for least in (1e-5, 1e-3)
    )
    sizes = [curve_nodes(model, assembled(model)[1]).size for model in models]
    assert sizes[0] > 1.2 * sizes[1]


def test_a_torque_curve_has_more_nodes_where_the_torque_bends_but_none_at_a_jump(monkeypatch):
    model, sizes = coarse_physics(VARIANTS["linear"]), []
    start = assembled(model)[1]
    middle = np.mean(on_start(model, start)[0]["tip_speed_ratio"])
    for width in (10.0, 0.01, 1e-9):

        def step(_rotor, _blade, ratios, _names, width=width):
            return {"torque_coefficient": Table(1.0 + 0.01 * np.tanh((ratios - middle) / width))}

        monkeypatch.setattr(RotorModel, "tables", step)
        sizes.append(curve_nodes(model, start, 0.7).size)
    smooth, bent, jump = sizes
    assert smooth < jump < 0.9 * bent


def test_a_rotor_is_held_to_its_distance_from_stall_where_it_has_settled():
    """A heavy one never does but in its initial equilibrium, or without time."""
    sizes = []
    for hub, timeless in ((0.0, False), (1e5, False), (1e5, True)):
        model = coarse_physics(VARIANTS["quadratic"], f"rotor: {{hub_inertia: {hub}}}")
        problem, _ = assembled(without_time(model) if timeless else model)
        values = problem.driver.get_constraint_values()["limit_distance_from_stall.value"]
        sizes.append(values.size)
    assert sizes == [model.scenarios[0].node_times.size, 1, KNOTS]


# The public problem -------------------------------------------------------------------------------


def test_the_public_problem_is_optimized_as_it_stands():
    """Without a run of the model before; to the quasi-steady optimum, which is close."""
    case = {
        "inflow": {"profile": "sine"},
        "control": {"law": "open_loop", "torque_limit": 700},
        "phase": {"segments": 15, "duration": 15, "final_speed": "free"},
    }
    problem = build_problem(load_case(case))
    start = find_start(physics(load_case(case))).operation.energy
    problem.run_driver()
    assert problem.driver.outcome().success
    assert problem.get_val("energy")[0] == pytest.approx(start, rel=5e-4)
    assert problem.get_val("energy")[0] > start
