"""Names of OpenMDAO and Dymos that the package uses and that are private, or as good as, there.

A release that renames one would slow an optimization down or break it: `pyproject.toml` caps the
versions, and a new cap begins with this test.
"""

import dymos as dm
import numpy as np
import openmdao.api as om
import pytest
from dymos.transcriptions.grid_data import GaussLobattoGrid
from openmdao.jacobians.jacobian import SplitJacobian

from hkt_mdo.case import load_case
from hkt_mdo.solve import totals
from hkt_mdo.start.build import build_problem

DRIVER = (
    "_autoscaler _check_for_invalid_desvar_values _check_for_missing_objective _coloring_info "
    "_compute_totals _cons _designvars _get_name _get_ordered_nl_responses _objs "
    "_problem _responses _run_solve_nonlinear _set_design_vars _setup_driver _total_jac "
    "_set_design_var _total_jac_linear _vectors"
)


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    """A small case, set up."""
    phase = {"segments": 2, "duration": 2}
    made = build_problem(load_case({"inflow": "sine", "control": "quadratic", "phase": phase}))
    made.final_setup()
    made.run_model()
    yield made
    made.cleanup()


def missing(thing, names):
    return [name for name in names.split() if not hasattr(thing, name)]


def test_drivers(problem):
    assert not missing(problem.driver, DRIVER)
    assert not missing(problem.driver._autoscaler, "_var_meta get_bounds_scaling")
    bounds = problem.driver._autoscaler.get_bounds_scaling("design_var")
    assert not missing(bounds["gain_0"], "lower upper equals")
    assert not missing(om.ScipyOptimizeDriver, "_objfunc _compute_totals")
    assert not missing(om.ScipyOptimizeDriver(), "_exc_info _reraise _scipy_optimize_result")
    assert not missing(om.pyOptSparseDriver, "_objfunc _gradfunc _signal_handler")


def test_models(problem):
    model = problem.model
    assert not missing(model, "_clear_iprint _outputs _owns_approx_jac _relevance")
    assert not missing(model._outputs, "get_range")
    assert not missing(model._relevance, "nonlinear_active")
    assert not missing(SplitJacobian, "_update get_dr_do_matrix")


def test_transcriptions():
    for transcription in (dm.GaussLobatto, dm.Radau):
        assert not missing(transcription, "init_grid setup_states configure_states")
    grid = GaussLobattoGrid(num_segments=2, nodes_per_seg=3)
    assert not missing(grid, "phase_lagrange_matrices phase_hermite_matrices")


def test_a_renamed_name_is_no_silent_loss_of_speed(problem, monkeypatch):
    """Without sparse totals a run would go on, many times slower."""
    monkeypatch.setattr(totals, "om_jacobian", object())
    with pytest.raises(AttributeError, match="SplitJacobian"):
        problem.driver._prepare_totals(list(problem.driver._responses))


def test_totals_are_sparse(problem):
    problem.driver._prepare_totals(list(problem.driver._responses))
    assert np.all(np.isfinite(problem.driver._compute_sparse().data))
