"""What a run tells of a wake with memory, and a run whose case asks for it."""

import pytest

from hkt_mdo import load_case, run_case
from hkt_mdo.errors import InputError
from hkt_mdo.results.summary import MemoryEntry

CASE = {"inflow": "sine", "control": "quadratic"}


def test_the_line_of_an_unstable_loop_cannot_be_overlooked():
    entry = MemoryEntry(
        stable=False, growth=8.4, time_s=4.9, inflow_speed=1.69, share_of_instants=0.19,
        inertia_kg_m2=1.14, least_inertia_kg_m2=10.8, tau1_s=1.6,
    )  # fmt: skip
    assert entry.text.startswith("UNSTABLE from t = 4.90 s at v = 1.69 m/s")
    assert entry.text.endswith("stable from a shaft inertia of 10.8 kg m^2 (the rotor has 1.14)")
    heavy = entry.model_copy(update={"least_inertia_kg_m2": None})
    assert heavy.text.endswith("unstable with any inertia of the shaft")
    assert MemoryEntry(stable=True, growth=-0.6, frozen_growth=-60.0).text.startswith("stable: ")


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ("foo", "inflow_dynamics.model"),
        ({"tau1": 1.0}, "inflow_dynamics.tau1"),
        ({"model": "oye", "tau1": 0.0}, "inflow_dynamics.tau1"),
    ],
)
def test_bad_inflow_dynamics_are_refused(given, key):
    with pytest.raises(InputError) as error:
        load_case(CASE | {"inflow_dynamics": given})
    assert error.value.key == key


@pytest.mark.parametrize(
    "other", [{"hydrodynamics": {"torque": "direct"}}, {"hydrodynamics": {"bem": "ccblade"}}]
)
def test_what_the_optimization_with_memory_cannot_do_is_refused(other):
    with pytest.raises(InputError, match="inflow_dynamics: oye"):
        load_case(CASE | other | {"inflow_dynamics": "oye"})


@pytest.mark.slow
def test_a_case_with_memory_is_optimized_and_judged_with_it(tmp_path):
    """The integration with the filters of all stations confirms the two of the optimization."""
    short = "phase.duration=20", "phase.segments=20", "inflow_dynamics=oye"
    solution = run_case(load_case(CASE, short), tmp_path / "oye", figures=False, records=False)
    assert solution.success, solution.message
    assert solution.summary.memory.stable
    names = {check.name for check in solution.summary.checks}
    assert "closed_loop_with_memory" in names
    assert "energy_over_bound" not in names
