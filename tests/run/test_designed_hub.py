"""The inertia of the shaft as a design variable, its price, and its part in stability."""

import numpy as np
import pytest

from hkt_mdo import load_case, run_case
from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.simulation import FeedbackTorque
from hkt_mdo.errors import InputError
from hkt_mdo.problem.physics import physics
from hkt_mdo.run.state import read_iterate
from hkt_mdo.run.verification import plant_of

GAIN, MOST = 6.0, 4.0
HELD = {"blade": "fixed", "gain_bounds": [(1 - 1e-6) * GAIN, (1 + 1e-6) * GAIN]}
RISING = {  # a flow that rises, and a gain with which the rotor turns too fast
    "inflow": "sine",
    "control": {"law": "quadratic", "gain": GAIN},
    "rotor": {"station_count": 9},
    "phase": {"duration": 6.0, "segments": 12},
    "start": {"method": "blade"},
}
SHORT = {
    "inflow": "sine",
    "control": {"law": "quadratic", "torque_limit": 700},
    "inflow_dynamics": "oye",
    "rotor": {  # as designed under that limit
        "chord": [0.104, 0.083, 0.065, 0.053, 0.045, 0.039, 0.033, 0.028, 0.02],
        "twist": [12.7, 7.5, 4.0, 1.8, 0.3, -1.0, -1.7, -2.4, -5.6],
    },
    "phase": {"duration": 20.0, "segments": 20},
    "start": {"method": "blade"},
}


def test_the_price_is_taken_in_the_unit_of_the_key_and_lowers_the_objective():
    design = {"hub_inertia_bounds": ["2e4 kg*cm**2", 400], "hub_inertia_price": "0.02 kJ/(kg m^2)"}
    model = physics(load_case(RISING | {"design": HELD | design}))
    assert model.blade.hub_inertia == 2.0  # the start is rotor.hub_inertia, or the nearer bound
    assert model.price_of(model.blade) == pytest.approx(40.0, rel=1e-12)


@pytest.mark.slow
def test_the_hub_ends_at_the_bound_that_theory_gives_for_its_price(tmp_path):
    """Q(w, v) - K w² = J w': a small inertia delays w by J w' / (2 K w - dQ/dw).

    Where the rotor turns too fast, in a flow that rises, this captures more. The energy of an
    inertia is then the integral of -d(Q w)/dw w' / (2 K w - dQ/dw), and so the price at which it
    is no longer worth having.
    """
    model = physics(load_case(RISING | {"design": HELD}))
    plant, time = plant_of(model, model.scenarios[0], model.blade), np.linspace(0.0, 6.0, 601)
    flow = model.inflow.speed_at(time)
    speed, *_ = equilibria(plant, FeedbackTorque(model.law, np.array([GAIN])), flow)
    torque, slope = plant.torque(speed, flow), plant.torque_slope(speed, flow)
    delay = np.gradient(speed, time) / (2.0 * GAIN * speed - slope)
    worth = -np.trapezoid((slope * speed + torque) * delay, time)
    for share, hub in ((0.9, MOST), (1.1, 0.0)):
        design = {"hub_inertia_bounds": [0.0, MOST], "hub_inertia_price": share * worth}
        case, out = load_case(RISING | {"design": HELD | design}), tmp_path / str(share)
        solution = run_case(case, out, figures=False, records=False)
        assert solution.success, solution.message
        summary = solution.summary
        assert summary.hub_inertia_kg_m2 == pytest.approx(hub, abs=1e-5)
        blades = model.rotor.mass_and_inertia(model.blade)[1]
        assert solution.design().inertia == pytest.approx(blades + hub, abs=1e-5)
        paid = summary.energy_J - summary.objective.value
        assert paid == pytest.approx(share * worth * hub, abs=1e-4)
        assert (summary.objective.price or 0.0) == pytest.approx(paid, abs=1e-4)


@pytest.mark.slow
def test_with_memory_the_hub_ends_at_the_inertia_that_the_run_needs(tmp_path):
    design = HELD | {"gain_bounds": None, "hub_inertia_bounds": [0, 200], "hub_inertia_price": 50}
    case = load_case(SHORT | {"design": design})
    solution = run_case(case, tmp_path / "run", figures=False, records=False)
    assert solution.success, solution.message
    summary, memory = solution.summary, solution.summary.memory
    assert memory.stable
    assert "heavier hub" in [each.remedy for each in summary.passes]
    assert 1.0 < summary.inertia_kg_m2 / memory.least_inertia_kg_m2 < 1.11
    _, start = read_iterate(tmp_path / "run", physics(case))
    assert start.blade.hub_inertia == pytest.approx(summary.hub_inertia_kg_m2, rel=1e-9)
    few = load_case(SHORT | {"design": design | {"hub_inertia_bounds": [0, 2]}})
    with pytest.raises(InputError, match=r"an upper bound in design\.hub_inertia_bounds"):
        run_case(few, tmp_path / "few", figures=False, records=False)
