"""Many cases: finished results are reused, anything else is run again."""

from dataclasses import replace
from pathlib import Path

import pytest

from hkt_mdo.case import load_case, read_case
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.nesting import allows, dominated
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.batch import begun, finished_result, run_batch
from hkt_mdo.run.digest import digest
from tests.conftest import edit_summary
from tests.exports.made import made

CASE = """
name: batch
inflow: {profile: sine}
control: {law: open_loop}
design: {blade: fixed}
phase: {segments: 10, duration: 10}
"""


EXTENSION = Path(__file__).parents[1] / "data" / "extension.py"


def case(*overrides, extensions=()):
    return read_case(CASE, overrides, extensions=extensions)


@pytest.fixture(scope="module")
def batch(tmp_path_factory):
    """Three cases that run and one whose record of the flow is broken; and what was reported."""
    folder = tmp_path_factory.mktemp("batch")
    (folder / "flow.csv").write_text("time_s,speed_m_s\n0,1\n1,fast\n", encoding="utf-8")
    cases = {
        folder / "first": case(),
        folder / "broken": case(f"inflow={{profile: record, file: {folder / 'flow.csv'}}}"),
        folder / "second": case("control.torque_limit=600"),
        folder / "own": case("limits={tip_acceleration: 100}", extensions=[EXTENSION]),
    }
    messages = {}
    return folder, cases, run_batch(cases, 1, messages.__setitem__, records=False), messages


def test_every_case_is_run_and_reported(batch):
    folder, cases, solutions, messages = batch
    assert list(solutions) == list(cases)
    assert solutions[folder / "broken"] is None
    assert "flow.csv" in messages.pop(folder / "broken")
    assert messages == {folder / name: "ok" for name in ("first", "second", "own")}
    for name in ("first", "second", "own"):
        assert solutions[folder / name].success
        assert solutions[folder / name].folder == folder / name
        assert not (folder / name / "history.db").exists()
    assert solutions[folder / "second"].case.control.torque_limit == 600.0


@pytest.mark.slow
def test_a_finished_result_is_reused_and_a_changed_case_is_run_again(batch):
    folder, cases, solutions, _ = batch
    first = (folder / "first" / "summary.json").read_bytes()
    changed = {
        folder / "first": cases[folder / "first"],
        folder / "own": cases[folder / "own"],
        folder / "second": case("control.torque_limit=500"),
    }
    messages = {}
    again = run_batch(changed, 1, messages.__setitem__, records=False)
    words = {"first": "reused", "own": "reused", "second": "ok"}
    assert messages == {folder / name: word for name, word in words.items()}
    assert again[folder / "own"].case.limits.tip_acceleration.bound == 100.0
    assert (folder / "first" / "summary.json").read_bytes() == first
    before, after = (each[folder / "second"].summary for each in (solutions, again))
    assert after.control_torque_max_Nm <= 500.0 * (1.0 + 1e-6)
    assert after.simulated_energy_J < before.simulated_energy_J


@pytest.fixture
def finished(batch, tmp_path):
    """A folder with the case and the summary of a finished result."""
    folder, *_ = batch
    for name in ("case.yaml", "summary.json"):
        (tmp_path / name).write_bytes((folder / "first" / name).read_bytes())
    return tmp_path


def test_an_equal_case_is_finished(finished):
    assert finished_result(finished, case())
    assert finished_result(finished, Solution.load(finished).case)
    assert not finished_result(finished, case("inflow.mean=1.4"))
    assert not finished_result(finished / "nowhere", case())
    (finished / "summary.json").write_text("{")
    assert not finished_result(finished, case())


@pytest.mark.parametrize(
    "change",
    [{"checks": None}, {"digest": "0"}, {"digest": None}],
    ids=["interrupted", "other code", "no digest"],
)
def test_another_summary_is_not_finished(finished, change):
    edit_summary(finished, **change)
    assert not finished_result(finished, case())


def test_bounds_that_a_run_takes_from_its_blade_are_no_change(tmp_path):
    """A run writes the bounds of the chord that a case does not give."""
    original = load_case({"rotor": {"blade": "river"}, "inflow": "sine", "control": "quadratic"})
    written = physics(original).case
    assert original.design.chord_bounds is None
    assert written.design.chord_bounds is not None
    (tmp_path / "case.yaml").write_text(written.to_yaml(), encoding="utf-8")
    assert begun(tmp_path, original)
    bounds = original.design.model_copy(update={"chord_bounds": (0.05, 0.3)})
    assert not begun(tmp_path, original.model_copy(update={"design": bounds}))


def test_a_changed_file_is_not_reused(tmp_path):
    """A polar, a record or an extension under the same name: its content decides."""
    times = "\n".join(f"{0.1 * i:.1f},{1.5 + 0.01 * (i % 20)}" for i in range(200))
    (tmp_path / "flow.csv").write_text(f"time_s,speed_m_s\n{times}\n", encoding="utf-8")
    (tmp_path / "own.py").write_bytes(EXTENSION.read_bytes())
    inflow = f"inflow={{profile: record, file: {tmp_path / 'flow.csv'}}}"
    one = case(inflow, extensions=[tmp_path / "own.py"])
    before = digest(one)
    assert digest(case(inflow, extensions=[tmp_path / "own.py"])) == before != digest(case(inflow))
    for name in ("flow.csv", "own.py"):
        with (tmp_path / name).open("a", encoding="utf-8") as file:
            file.write("# changed\n")
        assert digest(one) != before
        before = digest(one)


def test_the_digest_covers_the_package(monkeypatch, tmp_path):
    from hkt_mdo.run import digest as module

    (tmp_path / "bem.py").write_text("1")
    monkeypatch.setattr(module, "_PACKAGE", tmp_path)
    digests = []
    for content in ("1", "2"):
        (tmp_path / "bem.py").write_text(content)
        digests.append(module.of_package.__wrapped__())
    assert digests[0] != digests[1]


ENERGY = {"quadratic": 90.0, "power_law": 92.0, "open_loop": 95.0, "limited": 85.0}


@pytest.fixture(scope="module")
def nested(tmp_path_factory):
    """Laws of which one is a special case of another, stricter limits, a designed blade; invented.

    The power of all of them exceeds 4.5 kW.
    """
    folder = tmp_path_factory.mktemp("nested")
    flow, kept = "inflow: sine\nrotor: {station_count: 9}\n", "design: {blade: fixed}\n"
    open_loop = "control: {law: open_loop, torque_limit: 700}\n"
    cases = {
        "quadratic": f"{flow}{kept}control: {{law: quadratic, torque_limit: 700}}",
        "power_law": f"{flow}{kept}control: {{law: power_law, torque_limit: 700}}",
        "open_loop": f"{flow}{kept}{open_loop}",
        "limited": f"{flow}{kept}{open_loop}limits: {{power: 4.5 kW}}",
        "designed": f"{flow}{open_loop}",
        "other_flow": f"{flow.replace('sine', 'step')}{kept}{open_loop}",
    }
    solutions = {}
    for name, text in cases.items():
        energy = 1e3 * ENERGY.get(name, 96.0)
        objective = {"kind": "captured", "value": energy, "simulated": energy}
        more = {"objective": objective, "generator_energy_J": energy, "loads": {}}
        solutions[name] = made(folder / name, text, **more)
    return solutions


def test_a_case_allows_what_asks_more_of_its_turbine(nested):
    allowed = {
        name: {each for each in nested if each != name and allows(result, nested[each])}
        for name, result in nested.items()
    }
    assert {name: others for name, others in allowed.items() if others} == {
        "power_law": {"quadratic"},
        "open_loop": {"quadratic", "limited", "power_law"},
        "designed": {"quadratic", "limited", "power_law", "open_loop"},
    }
    changes = "control={law: quadratic, torque_limit: 700}", "design.gain_bounds=[1, 9]"
    bounded = nested["designed"].case.with_overrides(*changes)
    assert not allows(replace(nested["designed"], case=bounded), nested["quadratic"])


def test_no_result_is_beaten_unless_it_is_worse_or_refused(nested):
    assert dominated(nested.values()) == []
    best, other = nested["open_loop"], nested["quadratic"]
    simulated = 0.99 * other.summary.objective.simulated
    objective = best.summary.objective.model_copy(update={"simulated": simulated})
    worse = best.summary.model_copy(update={"objective": objective})
    (finding,) = dominated([replace(best, summary=worse), other])
    assert finding.by is other
    assert finding.gain == pytest.approx(0.01)
    refused = replace(best, summary=best.summary.model_copy(update={"success": False}))
    (finding,) = dominated([refused, other])
    assert "was refused" in str(finding)
    assert str(other.folder) in str(finding)
