"""What a wake with memory costs: a simulation and a co-design, with it and without."""

import pytest

from hkt_mdo.case import load_case
from hkt_mdo.results.solution import Solution
from hkt_mdo.run.run import run_case

CASES = {
    "quadratic": {"control": {"law": "quadratic"}},
    "linear": {"control": {"law": "linear"}},
    "quadratic, 700 N m, 30 kg m^2 more": {
        "control": {"law": "quadratic", "torque_limit": 700},
        "rotor": {"hub_inertia": 30},
    },
    "open loop, 700 N m": {"control": {"law": "open_loop", "torque_limit": 700}},
}
SMALL = ["phase={duration: 10, segments: 20}"]


@pytest.mark.parametrize("name", CASES)
def test_a_design_with_memory(name, full, in_turns, benchmark, tmp_path):
    """A law captures more by a model with memory; an open loop may not pulse, and captures less."""
    if not full and name != "quadratic":
        pytest.skip("one case is enough in small")
    data = {"inflow": "sine"} | CASES[name]

    def design(model):
        case = load_case(data, [f"inflow_dynamics={model}", *([] if full else SMALL)])
        out = tmp_path / model
        return run_case(case, out, force=True, figures=False, records=False)

    models = "quasi_steady", "oye"
    times = in_turns({each: lambda each=each: design(each) for each in models}, 3 if full else 1)
    solutions = in_turns.results
    benchmark.extra_info["times"] = times
    benchmark.extra_info["ratio"] = times["oye"] / times["quasi_steady"]
    assert all(each.success for each in solutions.values())
    if name != "open loop, 700 N m":
        assert solutions["oye"].summary.energy_J > solutions["quasi_steady"].summary.energy_J


def test_a_simulation_with_memory(full, in_turns, benchmark, tmp_path):
    """At most five times a simulation without, in a flow without high frequencies."""
    case = load_case({"inflow": "sine", "control": "quadratic"}, [] if full else SMALL)
    run_case(case, tmp_path / "run", figures=False, records=False)
    plain = Solution.load(tmp_path / "run").design()
    remembering = plain.with_memory()
    flow = plain.physics.inflow
    simulate = {
        "quasi_steady": lambda: plain.simulate(flow),
        "oye": lambda: remembering.simulate(flow),
    }
    times = in_turns(simulate, 7 if full else 1)
    benchmark.extra_info["times"] = times
    benchmark.extra_info["ratio"] = times["oye"] / times["quasi_steady"]
    results = in_turns.results
    assert results["oye"].energy == pytest.approx(results["quasi_steady"].energy, rel=1e-2)
    if full:
        assert benchmark.extra_info["ratio"] < 5.0
