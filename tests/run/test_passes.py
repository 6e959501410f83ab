"""What follows an optimization, and what the log writes of it."""

import json
from types import SimpleNamespace

from hkt_mdo.case import load_case
from hkt_mdo.problem.point import StartRecord
from hkt_mdo.run.passes import FOLLOW_UPS
from hkt_mdo.run.run import run_case
from hkt_mdo.run.summary import _branches

# the baseline blade in sinusoidal flow, without a limit
OPEN_LOOP = {"inflow": "sine", "control": "open_loop", "design": {"blade": "fixed"}}
LIMITED = OPEN_LOOP | {"control": {"law": "open_loop", "torque_limit": 600}}
SHORT = {"phase": {"segments": 15, "duration": 15}}


def test_the_branch_that_is_taken_is_that_of_the_result():
    starts = [
        StartRecord("best blade", side, 1e5, 0.0, (), kept=side == "overspeed", side=side)
        for side in ("overspeed", "underspeed")
    ]
    branches = _branches(SimpleNamespace(branch="underspeed", starts=starts))
    pairs = [(each["name"], each["taken"]) for each in branches]
    assert pairs == [("underspeed", True), ("overspeed", False)]


def test_nothing_follows_an_optimizer_that_gives_up(solve_physics):
    (only,) = solve_physics(OPEN_LOOP | SHORT | {"driver": {"max_iterations": 5}}).passes
    assert (only.converged, only.iterations, only.remedy) == (False, 5, "")


def test_nothing_follows_a_feedback_law_that_holds(solve_physics):
    (only,) = solve_physics(OPEN_LOOP | SHORT | {"control": "quadratic"}).passes
    assert only.remedy == ""


def test_a_coarse_mesh_is_divided_and_passes_are_told_while_a_run_works(tmp_path):
    written, passes, starts = [], [], []

    def on_pass(entry):
        passes.append(entry)
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        written.append((summary["success"], len(summary["passes"])))

    how = {"on_pass": on_pass, "on_start": starts.append, "figures": False, "records": False}
    solution = run_case(load_case(LIMITED), tmp_path / "out", **how)
    assert written == [(False, count + 1) for count in range(len(passes))]
    assert solution.summary.passes == passes
    assert passes[0].remedy == "refine"
    assert "segments are too coarse" in passes[0].why
    assert [each.number for each in passes] == list(range(1, len(passes) + 1))
    assert passes[-1].remedy == passes[-1].why == ""
    assert all(each.converged for each in passes)
    names = {follow.__name__.replace("_", " ") for follow in FOLLOW_UPS}
    assert {each.remedy for each in passes} <= names | {""}
    assert [x.objective for x in starts] == [x.objective for x in solution.summary.starts]
