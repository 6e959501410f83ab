"""A result of a long flow stays small: databases without what changes over time, fewer rows."""

import numpy as np
import openmdao.api as om
import pytest

from hkt_mdo.run.optimization import add_recorders
from hkt_mdo.run.summary import MOST_ROWS, _shown


@pytest.mark.parametrize("whole", [True, False])
def test_databases_of_a_long_flow_have_only_the_design(tmp_path, whole):
    problem = om.Problem()
    phase = problem.model.add_subsystem("traj", om.Group())
    phase.add_subsystem("timeseries", om.ExecComp("speed = 2 * x", shape=7))
    phase.add_subsystem("inner", om.ExecComp("defect = x - 1", shape=7))
    phase.add_design_var("timeseries.x")
    phase.add_constraint("inner.defect", equals=0.0)
    names = "chord = 2 * c", "twist = c", "energy = 3 * c", "inertia = c", "mass = c"
    problem.model.add_subsystem("rotor", om.ExecComp(names), promotes=["*"])
    problem.model.add_design_var("c")
    problem.model.add_objective("energy")
    problem.setup()
    add_recorders(problem, tmp_path, whole)
    problem.run_driver()
    problem.record("final")
    problem.cleanup()
    (last, *_) = om.CaseReader(str(tmp_path / "history.db")).get_cases("driver")
    final = om.CaseReader(str(tmp_path / "solution.db")).get_case("final")
    over_time = {"traj.timeseries.x"} if whole else set()
    assert {*last.get_design_vars()} == {"c"} | over_time
    assert bool(last.get_constraints()) == whole
    assert last.get_objectives()["energy"] == final["energy"] == 3.0
    assert final["traj.timeseries.speed"].shape == (7,)
    assert final["chord"] == 2.0


def test_a_long_table_keeps_the_extremes_of_each_column():
    size = 2 * MOST_ROWS + 3
    time = np.linspace(0.0, 3600.0, size)
    rows = np.stack([time, np.sin(time), np.zeros(size)], axis=-1)
    rows[777, 1], rows[4321, 2] = -5.0, 9.0
    kept = _shown(rows)
    assert kept.size <= MOST_ROWS + 7
    assert np.all(np.diff(kept) > 0)
    assert np.max(np.diff(kept)) == 3
    np.testing.assert_array_equal(np.ptp(rows[kept], axis=0), np.ptp(rows, axis=0))
    assert {0, size - 1} <= {*kept}
    np.testing.assert_array_equal(_shown(rows[:MOST_ROWS]), np.arange(MOST_ROWS))
