"""The mesh resolves every feature of a flow that a limit could meet, whatever its energy."""

from typing import Annotated, Literal

import numpy as np
import pytest

from hkt_mdo import Inflow, Quantity, load_case, run_case
from hkt_mdo.case import Phase
from hkt_mdo.dynamics.flows import (
    UNKNOWN_PIECES,
    ConstantInflow,
    GustInflow,
    SineInflow,
    StepInflow,
    SumInflow,
)
from hkt_mdo.dynamics.sampled import TurbulentInflow
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.scenario import FLOW_MISSED, Scenario
from hkt_mdo.run.check import check_case

SEASON = 90 * 86400.0
GUST = GustInflow(mean=1.4, amplitude=1.0, time=1_000_001.0, width=10.0)


def resolved(inflow, duration=60.0, segments=60):
    return Scenario(inflow, Phase(duration=duration, segments=segments)).resolved()


def test_a_gust_of_seconds_in_a_season_is_resolved():
    coarse = Scenario(GUST, Phase(duration=SEASON, segments=60))
    assert np.max(coarse.inflow.speed_at(coarse.dense)) < 1.401
    assert np.sum(coarse.flow_errors) < 5e-6
    assert np.max(coarse.flow_missed) > 0.3  # (2.4 - 1.4) / 2.4, seen through eight looks
    fine = coarse.resolved()
    assert np.max(fine.flow_missed) <= FLOW_MISSED
    for times in (fine.node_times, fine.samples, fine.dense):
        assert np.max(fine.inflow.speed_at(times)) == pytest.approx(2.4, rel=0.01)
    assert np.max(fine.inflow.speed_at(fine.dense)) == pytest.approx(2.4, rel=FLOW_MISSED)
    assert fine.segments < 2 * coarse.segments


@pytest.mark.parametrize("width", [0.1, 3.0, 100.0])
@pytest.mark.parametrize("amplitude", [-1.2, 0.002, 1.0])
def test_what_is_missed_is_what_samples_do_not_show(width, amplitude):
    """Against the flow on a grid of its own, a thousand points a width."""
    gust = GUST.model_copy(update={"width": width, "amplitude": amplitude})
    fine = resolved(gust, SEASON)
    time = gust.time + width * np.linspace(-0.5, 1.5, 2001)
    speed = np.interp(time, fine.dense, gust.speed_at(fine.dense))
    assert np.max(np.abs(speed - gust.speed_at(time))) <= 1.1 * FLOW_MISSED * 2.4


@pytest.mark.parametrize(
    "inflow",
    [SineInflow(), StepInflow(), ConstantInflow(speed=1.3), TurbulentInflow(cutoff=0.5)],
    ids=lambda inflow: inflow.profile,
)
def test_a_flow_that_the_mesh_resolves_leaves_it_as_it_is(inflow):
    segments = 240 if inflow.profile == "turbulence" else 60
    assert resolved(inflow, segments=segments).segments == segments


def test_each_of_many_gusts_is_resolved():
    random = np.random.default_rng(5)
    times, widths = random.uniform(0.0, SEASON, 19), 10.0 ** random.uniform(-1.0, 3.0, 19)
    gusts = [
        GustInflow(time=time, width=width, amplitude=0.5)
        for time, width in zip(times, widths, strict=True)
    ]
    fine = resolved(SumInflow(parts=(SineInflow(angular_frequency=1e-5), *gusts)), SEASON)
    for gust in gusts:
        peak = gust.time + 0.5 * gust.width
        near = np.interp(peak, fine.dense, fine.inflow.speed_at(fine.dense))
        assert near == pytest.approx(float(fine.inflow.speed_at(peak)), rel=2.0 * FLOW_MISSED)
    assert fine.segments < 600


class Silent(Inflow):
    """A flow that does not tell where it changes: a bump, or a jump."""

    profile: Literal["silent"] = "silent"
    width: Annotated[float, Quantity("s")] = 1.0
    jump: bool = False

    def speed_at(self, time):
        offset = (np.asarray(time) - 40.25) / self.width
        if self.jump:
            return 1.4 + 0.2 * (np.real(offset) > 0.0) + 0.0 * offset
        return 1.4 + 0.5 * np.exp(-(offset**2))


def silent(**flow):
    phase = {"duration": 1000, "segments": 10}
    data = {"inflow": {"profile": "silent", **flow}, "control": "linear", "phase": phase}
    return physics(load_case(data, extensions=[Silent]))


def test_a_flow_without_features_is_sampled_and_a_message_says_so():
    model = silent(width=0.3)
    (scenario,) = model.scenarios
    assert np.max(scenario.inflow.speed_at(scenario.dense)) == pytest.approx(1.9, rel=1e-4)
    assert scenario.inflow.pieces(1000.0).size == UNKNOWN_PIECES + 1
    text = "the flow silent gives neither features nor a highest_frequency: it is sampled several"
    assert any(message.startswith(f"{text} times every 1 s") for message in model.messages)
    (changes,) = (row for row in check_case(model.case).tables["Flow"] if row.label == "changes")
    assert changes.value == "not declared"
    assert not Silent().tells_features
    assert not SumInflow(parts=(SineInflow(), Silent())).tells_features
    assert SumInflow(parts=(SineInflow(), GUST, ConstantInflow(speed=1.0))).tells_features


def test_a_flow_that_no_mesh_resolves_is_left_to_the_checks():
    (scenario,) = silent(jump=True).scenarios
    assert np.max(scenario.flow_missed) > 0.05
    assert scenario.segments < 100


@pytest.mark.slow
def test_a_limit_is_kept_in_a_gust_of_seconds_in_a_season(tmp_path):
    """The blade is fixed, so that this is fast; its gain is designed for the gust."""
    fixed = {"control": "quadratic", "design": {"blade": "fixed"}, "limits": {"thrust": "12 kN"}}
    case = load_case({"inflow": GUST.model_dump(), "phase": {"duration": SEASON}} | fixed)
    solution = run_case(case, tmp_path / "out", figures=False, records=False)
    assert solution.success, solution.message
    thrust = solution.summary.limits["thrust"]
    assert thrust.value == pytest.approx(12e3, rel=1e-4)
    assert thrust.time_s == pytest.approx(GUST.time + 0.5 * GUST.width, abs=0.5)
    assert np.max(solution.simulation["inflow_speed_m_s"]) == pytest.approx(2.4, rel=1e-4)
