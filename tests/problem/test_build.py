"""The transcription's quadrature and the totals of a coarse problem."""

import dymos as dm
import numpy as np
import openmdao.api as om
import pytest
from openmdao.utils.assert_utils import assert_check_partials, assert_check_totals

from hkt_mdo.case import read_case
from hkt_mdo.problem.build import build_problem, find_start, physics
from hkt_mdo.problem.scenario import EnergyComp, GaussLobatto, Radau, node_weights
from hkt_mdo.rotor.steady_optimum import best_operation

VARIANTS = {
    "quadratic": "control: {law: quadratic, torque_limit: 700}",
    "linear": "control: {law: linear}",
    "open loop in speed": "control: {law: open_loop, torque_limit: 700}",
    "open loop in torque": "control: {law: open_loop, torque_limit: 700, unknown: torque}",
}


@pytest.mark.parametrize("transcription", ["gauss-lobatto", "radau"])
@pytest.mark.parametrize("order", [3, 5])
def test_weights_integrate_polynomials_exactly(transcription, order):
    """LGL of n points is exact to degree 2n - 3, LGR to 2n - 2."""
    from dymos.utils.lgl import lgl
    from dymos.utils.lgr import lgr

    segments, duration = 4, 10.0
    weights = node_weights(transcription, segments, order, duration)
    points = (
        lgl(order)[0] if transcription == "gauss-lobatto" else lgr(order, include_endpoint=True)[0]
    )
    starts = np.linspace(0.0, duration, segments + 1)[:-1, None]
    time = (starts + 0.5 * (points + 1.0) * duration / segments).ravel()
    degree = 2 * order - (3 if transcription == "gauss-lobatto" else 2)
    assert weights @ time**degree == pytest.approx(
        duration ** (degree + 1) / (degree + 1), rel=1e-12
    )


def test_energy_partials():
    problem = om.Problem(reports=False)
    problem.model.add_subsystem(
        "energy", EnergyComp(weights=node_weights("gauss-lobatto", 3, 3, 6.0))
    )
    problem.setup(force_alloc_complex=True)
    problem.run_model()
    data = problem.check_partials(method="cs", compact_print=True, out_stream=None)
    assert_check_partials(data, atol=1e-12, rtol=1e-12)


def coarse(control, more="", segments=5):
    case = read_case(
        f"inflow: {{profile: sine}}\n{control}\nphase: {{segments: {segments}, duration: 20}}\n"
        f"start: {{method: blade}}\n{more}"
    )
    world = physics(case)
    start = find_start(case, world, best_operation(world.blade, world.polar))
    problem = build_problem(case, world, start, np.linspace(2.5, 9.0, 27))
    problem.run_model()
    return problem, start


@pytest.mark.parametrize("direct", [False, True], ids=["curve", "direct"])
@pytest.mark.parametrize("name", VARIANTS)
def test_totals_of_a_coarse_problem(name, direct):
    """Every total derivative that the optimizer sees, against central differences."""
    problem, _ = coarse(VARIANTS[name], "hydrodynamics: {torque: direct}" if direct else "")
    data = problem.check_totals(
        method="fd",
        form="central",
        step=1e-6,
        step_calc="rel_avg",
        out_stream=None,
        driver_scaling=True,
    )
    assert_check_totals(data, atol=2e-6, rtol=2e-5)


@pytest.mark.parametrize("name", VARIANTS)
def test_the_start_is_nearly_feasible(name):
    """At the shipped second a segment; from an infeasible start optimizers wander off."""
    smooth = VARIANTS[name].replace(", torque_limit: 700", "")  # a limit leaves a kink in the start
    problem, start = coarse(smooth, segments=20)
    assert problem.get_val("energy")[0] == pytest.approx(start.operation.energy, rel=1e-3)
    violations = {
        key: np.max(np.abs(values))
        for key, values in problem.driver.get_constraint_values().items()
        if "control_torque" not in key
    }
    assert max(violations.values()) < 0.05, violations


@pytest.mark.parametrize("name", VARIANTS)
def test_sparse_totals_are_openmdaos_own(name):
    """Substitution in the sparse Jacobian gives what OpenMDAO's linear solves give."""
    problem, _ = coarse(VARIANTS[name])
    driver = problem.driver
    problem.final_setup()
    driver._coloring_info.deactivate()
    sparse = problem.model.linear_solver.totals(driver, [*driver._objs, *driver._cons])
    own = driver._compute_totals(return_format="array")
    found = sparse.compute().toarray()
    np.testing.assert_allclose(found, own, rtol=1e-10, atol=1e-12 * np.max(np.abs(own)))


@pytest.mark.parametrize("name", ["gauss-lobatto", "radau"])
def test_sparse_interpolation_matrices_are_those_of_dymos(name):
    ours, theirs = {
        "gauss-lobatto": (GaussLobatto, dm.GaussLobatto),
        "radau": (Radau, dm.Radau),
    }[name]
    grids = []
    for kind in (ours, theirs):
        transcription = kind(num_segments=7, order=3)
        transcription.init_grid()
        grids.append(transcription.grid_data)
    for method, given, wanted in (
        ("phase_lagrange_matrices", "control_disc", "all"),
        ("phase_lagrange_matrices", "state_disc", "col"),
        ("phase_hermite_matrices", "state_disc", "col"),
    ):
        for sparse in (True, False):
            mine, dymos = (getattr(grid, method)(given, wanted, sparse) for grid in grids)
            for one, other in zip(mine, dymos, strict=True):
                if sparse:
                    one, other = one.toarray(), other.toarray()
                np.testing.assert_array_equal(one, other)
