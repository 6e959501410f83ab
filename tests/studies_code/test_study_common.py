"""What studies share."""

import pytest
from study_common import run_nested

from hkt_mdo.case import load_case
from hkt_mdo.results.nesting import dominated
from hkt_mdo.run.batch import run_batch
from tests.conftest import NINE


@pytest.mark.slow
def test_a_better_design_is_passed_on(tmp_path):
    """From the given blade alone a law ends far below what the search for a start finds."""
    short = ["phase.duration=15", "phase.segments=15", f"rotor.stations={NINE}"]
    searched = load_case("power_quadratic", [*short, "control.torque_limit=650"])
    local = searched.with_overrides("start.method=blade", "driver.max_iterations=30")
    cases = {tmp_path / "searched": searched, tmp_path / "local": local}
    first = run_batch(cases, 2, records=False)
    told = []
    second = run_nested(cases, 2, lambda folder, word: told.append(word))
    assert dominated(second.values()) == []
    for folder, each in second.items():
        before, after = (x.summary.objective.simulated for x in (first[folder], each))
        assert each.success
        assert after >= before or not first[folder].success
    if dominated(first.values()):
        assert "better from another's design" in told
    assert told.count("reused") == 2
    # what was begun from another's design is the case's result
    again = []
    run_batch(cases, 2, lambda folder, word: again.append(word), records=False)
    assert again == ["reused"] * 2
