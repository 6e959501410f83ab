"""Each check refuses alone: results that are doctored in one place, where no other check looks."""

import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Annotated, ClassVar

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.dynamics.flows import GustInflow, SumInflow
from hkt_mdo.dynamics.limits import DesignBounds, Limit, TipSpeedLimit, TorqueRateLimit
from hkt_mdo.dynamics.simulation import FeedbackTorque, RecordedTorque
from hkt_mdo.dynamics.wide_laws import CurveFeedback, PowerLawFeedback
from hkt_mdo.problem.evaluation import broken_limits, on_start
from hkt_mdo.problem.physics import physics
from hkt_mdo.problem.point import StartRecord
from hkt_mdo.results.summary import CheckEntry
from hkt_mdo.results.words import Row
from hkt_mdo.run.checks import _behind_open_loop, explain, explain_all
from hkt_mdo.run.findings import Stations
from hkt_mdo.run.passes import Pass, _finer_curve, none_found
from hkt_mdo.run.summary import summarize, write_tables
from hkt_mdo.run.verification import SAMPLES, verify
from hkt_mdo.sections import Quantity
from tests.conftest import NINE
from tests.problem import test_build

SHORT = {"inflow": "sine", "phase": {"segments": 15, "duration": 15}}
SHORT |= {"rotor": {"stations": NINE}}  # with limits and without
# bounds that are active at the optimum: a step across them hardly changes the blade
DESIGNED = SHORT | {
    "control": {"law": "quadratic", "torque_limit": 700},
    "design": {
        "chord_bounds": [0.05, 0.18],
        "twist_bounds": [0, 12],
        "radius_bounds": [1.2, 1.45],
        "gain_bounds": [2, 20],
    },
}
TURNED = SHORT | {
    "control": {"law": "open_loop", "torque_limit": 700},
    "objective": "generator",
    "rotor": {"stations": NINE, "set_angle": 5},
    "design": {"blade": "fixed", "set_angle_bounds": [0, 5.5]},
}
INSTANT = 5.5  # s, of the middle node of a segment
two_flows = partial(test_build.two_flows, segments=20)


@pytest.fixture(scope="module")
def feedback(solve_physics):
    """Quadratic feedback with designed chord, twist, radius and gain."""
    return solve_physics(DESIGNED)


@pytest.fixture(scope="module")
def open_loop(solve_physics):
    """Open loop with a designed set angle, for the generator's energy."""
    return solve_physics(TURNED)


def with_flight(solved, **changes):
    """Return a result whose only verification is changed."""
    return replace(solved, verifications=(replace(solved.verification, **changes),))


def at_instant(solved):
    """Return the number of the node nearest to `INSTANT`."""
    return int(np.argmin(np.abs(solved.verification.trajectory["time"] - INSTANT)))


def with_node(solved, quantity, change):
    """Return a result with another value of a quantity at one node, in all that has it."""
    trajectory, index = solved.verification.trajectory, at_instant(solved)
    values = trajectory[quantity].copy()
    values[index] = change(values[index])
    return with_flight(solved, trajectory={**trajectory, quantity: values})


def with_limit(solved, limit):
    """Return what was solved, judged by one limit over time more."""
    scenario = solved.verification.scenario
    return with_flight(solved, scenario=replace(scenario, limits=(*scenario.limits, limit)))


def with_result(solved, **changes):
    """Return what was solved with another outcome of the optimization."""
    return replace(solved, result=replace(solved.result, **changes))


def with_point(solved, **changes):
    """Return a result with another blade, or other gains."""
    return with_result(solved, point=replace(solved.result.point, **changes))


def with_shape(solved, **changes):
    """Return a result whose blade has another chord or twist."""
    blade = solved.result.point.blade
    shape = {"chord": blade.chord, "twist": blade.twist} | changes
    return with_point(solved, blade=blade.with_shape(**shape))


def not_converged(solved):
    outcome = replace(solved.result.outcome, success=False, message="Restoration_Failed")
    return with_result(solved, outcome=outcome)


def stopped(solved):
    return with_flight(solved, simulation=replace(solved.verification.simulation, stopped_at=7.25))


def more_power_at_a_node(solved):
    weight = solved.verification.scenario.node_weights[at_instant(solved)]
    more = 1e-3 * solved.verification.simulation.energy / weight
    return with_node(solved, "hydrodynamic_power", lambda power: power + more)


def faster_at_a_node(solved):
    return with_node(solved, "rotor_speed", lambda speed: 1.02 * speed)


def backwards_at_a_node(solved):
    """Collocation and integration agree on a rotor that turns backwards."""
    doctored = with_node(solved, "rotor_speed", lambda speed: -0.5)
    speed = doctored.verification.trajectory["rotor_speed"]
    same = replace(doctored.verification.simulation, speed_at=lambda time: speed)
    return with_flight(doctored, simulation=same)


def torque_above_its_limit_at_a_node(solved):
    return with_node(solved, "control_torque", lambda torque: 700.07)


def generator_that_drives(solved):
    return with_node(solved, "control_torque", lambda torque: -0.07)


def more_torque_between(solved):
    trajectory = solved.verification.trajectory
    torque = trajectory["control_torque"].copy()
    torque[at_instant(solved)] += 60.0
    return with_flight(solved, controller=RecordedTorque(trajectory["time"], torque, 700.0))


def wrong_curve(solved):
    return with_result(solved, curve=1.002 * solved.result.curve)


def lower_bound_of_the_energy(solved):
    less = 0.9 * solved.optimum.power_coefficient
    doctored = replace(solved)
    vars(doctored)["optimum"] = solved.optimum._replace(power_coefficient=less)
    return doctored


def smaller_generator(solved):
    """The certificate takes the limit from the physics, all other checks from the limits."""
    law = solved.physics.law.model_copy(update={"torque_limit": 0.9 * 700.0})
    return with_result(solved, physics=replace(solved.physics, law=law))


def better_start(solved):
    start = replace(solved.start, reference=1.004 * solved.start.reference)
    return replace(solved, start=start)


def with_gust(solved, **gust):
    scenario = solved.verification.scenario
    hidden = SumInflow(parts=(scenario.inflow, GustInflow(**gust)))
    return with_flight(solved, scenario=replace(scenario, inflow=hidden))


def coarse_mesh(solved):
    """The flow has a small gust in one segment, whose quadrature has too much of it."""
    return with_gust(solved, time=3.0, width=1.0, amplitude=0.01)


def unseen_gust(solved):
    """The flow has a gust of little energy between the instants at which limits are checked."""
    return with_gust(solved, time=3.31, width=0.004, amplitude=0.3)


def other_mesh(solved):
    return with_result(solved, mesh_error=2e-5)


def wound_up(solved):
    """A heavy rotor whose last speed is so far from equilibrium that it stores two per cent."""
    simulated = solved.verification.simulation
    speed = simulated.rotor_speed.copy()
    inertia = 0.02 * simulated.energy / (0.01 * speed[-1] ** 2)
    speed[0] = speed[-1]
    speed[-1] *= 1.01
    plant = replace(solved.verification.plant, inertia=inertia)
    return with_flight(solved, simulation=replace(simulated, rotor_speed=speed), plant=plant)


def near_stall(solved):
    """A plant whose torque falls to that of the generator where the rotor is slowed."""
    speed, gains = solved.verification.simulation.rotor_speed, solved.result.point.gains

    class Stalls:
        generator = solved.physics.case.generator
        blade, inertia = solved.result.point.blade, solved.result.inertia
        wake = None

        def torque(self, slowed, flow):
            return solved.physics.law.torque(slowed, gains) + 1e-3 * (slowed < 0.99 * speed)

        generator_torque = torque

    return with_flight(solved, plant=Stalls())


def other_objective(solved):
    return with_result(solved, objective=1.0005 * solved.result.objective)


def thinner_station(solved):
    chord = solved.result.point.blade.chord.copy()
    chord[5] = 0.05 - 1e-4 * 0.18
    return with_shape(solved, chord=chord)


def twisted_station(solved):
    twist = solved.result.point.blade.twist.copy()
    twist[0] = np.deg2rad(12.0) * 1.0001
    return with_shape(solved, twist=twist)


def turned_blade(solved):
    turn = 1e-4 * np.deg2rad(5.5)
    return with_shape(solved, twist=solved.result.point.blade.twist + turn)


def larger_rotor(solved):
    return with_point(solved, blade=solved.result.point.blade.with_rotor_radius(1.45 * 1.0001))


def larger_gain(solved):
    return with_point(solved, gains=np.array([22.0]))


# name, whose result, how it is doctored, value, and the words of its explanation
REFUSALS = [
    ("optimizer", "feedback", not_converged, 1.0, ["did not converge", "Restoration_Failed"]),
    ("rotor_keeps_turning", "feedback", stopped, 1.0, ["after t = 7.25 s", "torque_limit"]),
    ("energy_error", "feedback", more_power_at_a_node, 1e-3, ["at t = 5.50 s", "phase.segments"]),
    ("max_speed_error", "feedback", faster_at_a_node, 0.0196, ["at t = 5.50 s", "phase.segments"]),
    ("flow_error", "feedback", coarse_mesh, 4e-4, ["between t = 3 and 4 s", "phase.segments"]),
    ("flow_missed", "feedback", unseen_gust, 0.3 / 1.68, ["t = 3 and 4 s", "phase.segments"]),
    ("mesh_error", "open_loop", other_mesh, 2e-5, ["finer mesh", "phase.segments"]),
    ("stored_energy", "feedback", wound_up, 0.02, ["beyond equilibrium", "objective=generator"]),
    ("distance_from_stall", "feedback", near_stall, 1.0, ["slowed rotor", "control.law"]),
    ("surrogate_error", "feedback", wrong_curve, 2e-3, ["at tip speed ratio", "hydrodynamics"]),
    ("energy_over_bound", "feedback", lower_bound_of_the_energy, 0.07, ["bound", "phase.segments"]),
    ("energy_over_certificate", "open_loop", smaller_generator, 0.0324, ["certificate"]),
    ("energy_below_start", "feedback", better_start, 4e-3, ["at the start", "phase.segments"]),
    ("energy_below_start", "open_loop", better_start, 3.9e-3, ["at the start", "phase.segments"]),
    ("chord_bounds", "feedback", thinner_station, 1e-4, ["r = 1.0", "driver.tolerance"]),
    ("twist_bounds", "feedback", twisted_station, 1e-4, ["r = 0.290 m", "driver.tolerance"]),
    ("radius_bounds", "feedback", larger_rotor, 1e-4, ["at the radius", "driver.tolerance"]),
    ("gain_bounds", "feedback", larger_gain, 0.1, ["at the gain", "driver.tolerance"]),
    ("set_angle_bounds", "open_loop", turned_blade, 1e-4, ["set angle", "driver.tolerance"]),
    ("forward_rotation_at_nodes", "feedback", backwards_at_a_node, 0.05, ["at t = 5.50 s"]),
    ("control_torque_at_nodes", "feedback", torque_above_its_limit_at_a_node, 1e-4, ["t = 5.50 s"]),
    ("control_torque_at_nodes", "open_loop", generator_that_drives, 1e-4, ["at t = 5.50 s"]),
    ("control_torque_between_nodes", "open_loop", more_torque_between, 0.0857, ["at t = 5."]),
    ("objective_error", "open_loop", other_objective, 5e-4, ["objective", "phase.segments"]),
]


@pytest.mark.parametrize(
    ("name", "whose", "doctor", "value", "words"),
    REFUSALS,
    ids=[f"{name}: {doctor.__name__}, {whose}" for name, whose, doctor, *_ in REFUSALS],
)
def test_one_check_refuses(request, name, whose, doctor, value, words):
    solved = request.getfixturevalue(whose)
    assert solved.failed() == []
    (refused,) = (check for check in doctor(solved).by_name.values() if not check.passed)
    assert refused.name == name
    assert refused.value == pytest.approx(value, rel=0.1)
    said = explain(refused, solved.physics)
    assert all(word in said for word in words), said
    assert "try " in said
    if name not in ("optimizer", "rotor_keeps_turning"):
        assert said.startswith(f"{name} = {refused.value:.3g} exceeds {refused.limit:g}, ")


@pytest.mark.parametrize("short", [0.0, 1.0])
def test_a_start_too_near_stall_is_no_measure(feedback, monkeypatch, short):
    monkeypatch.setattr("hkt_mdo.run.passes.recovery", lambda *_: [("", short, 0.2, "")])
    first, start = feedback.on_first_mesh, replace(feedback.start, reference=1e9)
    fields = {"state": SimpleNamespace(first=first), "result": feedback.result}
    reference = Pass(start, feedback.physics, feedback.result.setup, **fields).end.start.reference
    assert reference == pytest.approx(0.0 if short else feedback.start.reference, rel=2e-3)


def test_a_standstill_is_told_before_the_optimizers_failure(feedback):
    said = explain_all(faster_at_a_node(stopped(not_converged(feedback))).checks, feedback.physics)
    assert re.match(r"the rotor's motion .* after t = 7\.25 s .*; the optimizer did not", said)
    assert "also refused: max_speed_error" in said
    assert "too coarse" not in said


def test_a_finer_torque_curve_is_tried_only_where_it_helps(feedback):
    result = feedback.result
    assert _finer_curve(result, 1e-3).size > result.setup.nodes.size
    assert _finer_curve(result, 1e-15) is None


def test_a_refused_result_names_the_station_whose_flow_stalls_at_once(feedback, monkeypatch):
    monkeypatch.setattr("hkt_mdo.rotor.model.RotorModel.torque_jump", lambda *_: 1.204)
    for name, doctor in (("optimizer", not_converged), ("surrogate_error", wrong_curve)):
        assert "at r = 1.204 m stalls at once" in doctor(feedback).by_name[name].detail


def test_every_judge_is_asked(feedback, open_loop):
    assert {name for name, *_ in REFUSALS} == {*feedback.by_name, *open_loop.by_name}


def test_a_law_far_behind_the_open_loop_of_its_own_search_is_refused(feedback):
    """A law of many gains can follow its schedule; one that breaks a limit does not count."""
    energy = feedback.objective
    kept, broken = (
        StartRecord("blade as given", "", factor * energy, excess, (), law="open_loop")
        for factor, excess in ((1.5, 0.0), (3.0, 0.1))
    )
    kinds = CurveFeedback(torque_limit=700.0), PowerLawFeedback(torque_limit=700.0)
    models = [replace(feedback.physics, law=law) for law in kinds]
    curve, power = (with_result(feedback, physics=each) for each in models)

    def behind(solved, *starts):
        return [*_behind_open_loop(replace(solved, start=replace(solved.start, starts=starts)))]

    ((name, value, most, _),) = behind(curve, kept, broken)
    assert name == "behind_open_loop"
    assert value == pytest.approx(1.0 / 3.0)
    assert value > most
    assert behind(power, kept) == behind(curve, kept)
    assert behind(feedback, kept) == behind(curve, broken) == []  # of one gain; none kept


@pytest.mark.parametrize(
    ("name", "value"), [("two_filters_energy", 2e-3), ("two_filters_speed", 2e-2)]
)
def test_two_filters_that_are_not_those_of_all_stations_are_refused(feedback, name, value):
    """The collocation is held to the integration of its own model, which is as before."""
    verification, share = feedback.verification, 1.0 / (1.0 + value)
    run = verification.simulation
    other = {"energy": share * run.energy}
    if name == "two_filters_speed":
        other = {"speed_at": lambda time: share * run.speed_at(time)}
    whole = with_flight(feedback, two_filters=verification, simulation=replace(run, **other))
    (refused,) = (check for check in whole.by_name.values() if not check.passed)
    assert refused.name == name
    assert refused.value == pytest.approx(value, rel=1e-6)
    assert "more slowly" in explain(refused, feedback.physics)


@pytest.mark.parametrize(
    ("above", "below", "words"), [(1.1, 0.9, "has no solution after"), (5.0, 5.0, "rotor stops at")]
)
def test_a_motion_that_ends_is_refused(feedback, monkeypatch, above, below, words):
    """A torque that jumps with the speed has no solution that any step could follow."""
    jump = float(np.median(feedback.verification.simulation.rotor_speed))
    torque = FeedbackTorque.__call__

    def jumping(self, time, speed, *states):
        return torque(self, time, speed, *states) * np.where(speed < jump, below, above)

    monkeypatch.setattr(FeedbackTorque, "__call__", jumping)
    solved = replace(feedback, verifications=verify(feedback.result))
    simulated = solved.verification.simulation
    assert 0.0 < simulated.stopped_at < 15.0
    assert simulated.time[-1] == pytest.approx(simulated.stopped_at)
    refused = solved.by_name["rotor_keeps_turning"]
    assert not refused.passed
    assert f"{words} t = {simulated.stopped_at:.2f} s" in refused.detail


def test_a_limit_is_judged_at_and_between_the_nodes(feedback):
    fastest = np.max(feedback.verification.trajectory["rotor_speed"]) * 1.45
    slow = with_limit(feedback, TipSpeedLimit(bound=0.99 * fastest))
    assert slow.failed() == ["tip_speed_at_nodes", "tip_speed_between_nodes"]
    limited = with_limit(feedback, TipSpeedLimit(bound=1.01 * fastest))
    assert limited.failed() == []
    speed = feedback.verification.simulation.rotor_speed.copy()
    speed[107] *= 1.1  # a sample of the sixth segment, seven twentieths from its start
    faster = replace(feedback.verification.simulation, rotor_speed=speed)
    checks = with_flight(limited, simulation=faster).by_name.values()
    (refused,) = (check for check in checks if not check.passed)
    assert refused.name == "tip_speed_between_nodes"
    assert refused.detail.endswith("at t = 5.35 s")


@pytest.mark.parametrize("whose", ["feedback", "open_loop"])
def test_the_rate_of_the_torque_is_judged_at_and_between_the_nodes(request, whose):
    solved = request.getfixturevalue(whose)
    simulated = solved.verification.simulated
    largest = np.max(np.abs(simulated["torque_rate"]))
    slopes = np.gradient(simulated["control_torque"], simulated["time"])
    number, below = np.arange(slopes.size) % SAMPLES, simulated["control_torque"] < 699.9
    inside = below & (number > 1) & (number < SAMPLES - 1)  # of a segment
    assert np.sum(inside) > 100
    assert np.max(np.abs(simulated["torque_rate"] - slopes)[inside]) < 0.01 * largest
    ends = [largest, np.max(np.abs(solved.verification.at_nodes["torque_rate"]))]
    for bound, refused in ((1.01 * max(ends), []), (0.8 * min(ends), ["at", "between"])):
        limited = with_limit(solved, TorqueRateLimit(bound=bound))
        assert limited.failed() == [f"torque_rate_{kind}_nodes" for kind in refused]


def test_a_failed_run_claims_only_what_was_tried(open_loop):
    """Without a proof that no design keeps the limits: how many starts, and the least violation."""
    start = replace(open_loop.start, starts=open_loop.start.starts[:1] * 11)
    model = open_loop.on_first_mesh
    checks = list(open_loop.by_name.values())
    (steady,) = on_start(model, start)
    steepest = np.max(np.abs(steady["torque_rate"]))

    def claim(bound, at_end):
        scenario = replace(model.scenarios[0], limits=(TorqueRateLimit(bound=bound),))
        passed = at_end <= 1e-3
        ends = [
            CheckEntry(name=f"torque_rate_{kind}_nodes", value=at_end, limit=1e-3, passed=passed)
            for kind in ("at", "between")
        ]
        return none_found(replace(model, scenarios=(scenario,)), start, [*checks, *ends])

    assert claim(0.8 * steepest, 0.5).startswith(
        "no design that keeps the limits was found from 11 starts: the smallest violation was "
        "25 % of limits.torque_rate, by the best of them, in a flow of "
    )
    assert "; this does not prove that there is none (try a looser" in claim(0.8 * steepest, 0.5)
    assert "10 % of limits.torque_rate, at the end of the opt" in claim(0.8 * steepest, 0.1)
    assert claim(0.8 * steepest, 0.0) == ""  # the end keeps it
    assert claim(1.1 * steepest, 0.5) == ""  # the start does
    fixed = replace(model.shape, bounds={})
    for shape, wider in ((model.shape, True), (fixed, False)):
        model = replace(model, shape=shape)
        assert ("wider design bounds" in claim(0.8 * steepest, 0.5)) == wider


def test_stations_beyond_their_polars_are_a_warning_or_a_note(feedback, monkeypatch):
    """As in `hkt check`, by their share of the torque."""
    rows = [Row("", x, severity=y) for x, y in (("heavy", "warning"), ("light", "note"))]
    monkeypatch.setattr(Stations, "messages", lambda *_: rows)
    summary = summarize(feedback)
    assert (summary.doubts[-1], *map(summary.notes.count, ("light", "heavy"))) == ("heavy", 1, 0)


def test_a_thickness_that_is_not_designed_is_that_of_the_sections(feedback):
    thin = DesignBounds(quantity="thickness", bounds=(0.0, 0.1))
    judged = with_result(feedback, physics=replace(feedback.physics, design_limits=(thin,)))
    assert judged.failed() == ["thickness_bounds"]


def test_advice_is_what_the_case_can_follow():
    year = {"profile": "histogram", "speeds": [1.0, 1.2], "hours": [1, 1]}
    rotor = {"polar": "naca63815", "reynolds": "local"}
    model = physics(load_case({"resource": year, "rotor": rotor, "control": "quadratic"}))
    words = {"objective_error": "control.cut_out", "distance_from_stall": "reynolds=invariant"}
    for name, word in words.items():
        said = explain(CheckEntry(name=name, value=1.0, limit=0.1, passed=False, detail=""), model)
        assert word in said
        assert not any(key in said for key in ("phase.", "start.method", "torque=curve"))
    control = {"law": "quadratic", "torque_limit": 140}
    steady = {"control": control, "scenarios": [{"inflow": "sine", "steady": True}]}
    stops = CheckEntry(name="rotor_keeps_turning", passed=False)
    said = [explain(stops, each) for each in (model, physics(load_case(steady)))]
    assert [("cut_in" in text, "smoothing" in text) for text in said] == [(1, 0), (0, 1)]


class LargestInertia(Limit):
    """Largest moment of inertia of the rotor."""

    name: ClassVar[str] = "largest_inertia"
    unit: ClassVar[str | None] = "kg*m**2"
    inputs: ClassVar[tuple[str, ...]] = ("inertia",)
    bound: Annotated[float, Quantity("kg*m**2", gt=0)]

    def value(self, inertia):
        return inertia


@pytest.mark.slow
def test_a_limit_on_the_design_alone_is_held_and_judged(solve_physics):
    law = {"law": "open_loop", "torque_limit": 700}
    free = solve_physics(SHORT | {"control": law}, two_flows)
    bound = 0.9 * free.result.inertia
    case = SHORT | {"control": law, "limits": {"largest_inertia": bound}}
    held = solve_physics(case, two_flows, LargestInertia)
    assert held.failed() == []
    assert broken_limits(held.on_first_mesh, held.start) == []
    assert held.result.inertia == pytest.approx(bound, rel=1e-6)
    assert 0.99 * free.result.energy < held.result.energy < free.result.energy
    entry = summarize(held).limits["largest_inertia"]
    assert entry.value == pytest.approx(bound, rel=1e-6)
    assert entry.binding
    limits = (*held.physics.design_limits[:-1], LargestInertia(bound=0.99 * bound))
    tighter = with_result(held, physics=replace(held.physics, design_limits=limits))
    assert tighter.failed() == ["largest_inertia_bounds"]


# Two scenarios ------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ["quadratic", pytest.param("open_loop", marks=pytest.mark.slow)])
def test_one_design_for_two_scenarios_is_accepted(solve_physics, law, tmp_path):
    case = SHORT | {"control": {"law": law, "torque_limit": 700}}
    solved = solve_physics(case, two_flows)
    assert solved.failed() == []
    assert {"energy_error (phase)", "energy_error (step)"} <= set(solved.by_name)
    first, second = solved.verifications
    expected = 0.7 * first.simulation.energy + 0.3 * second.simulation.energy
    assert solved.result.energy == pytest.approx(expected, rel=2e-5)
    summary = summarize(solved)
    assert summary.success
    assert summary.simulated_energy_J == pytest.approx(expected, rel=1e-12)
    assert summary.energy_balance_error < 1e-4
    write_tables(tmp_path, solved)
    for name, scenario in (("phase", first), ("step", second)):
        columns = {"trajectory": scenario.trajectory, "simulation": scenario.integrated}
        for table, expected in columns.items():
            written = np.genfromtxt(tmp_path / f"{table}_{name}.csv", delimiter=",", names=True)
            speed = written["rotor_speed_rad_s"]
            np.testing.assert_allclose(speed, expected["rotor_speed"], rtol=1e-9)
    # each scenario has a check of its own
    nodes = second.trajectory["rotor_speed"].copy()
    nodes[4] *= 1.02
    doctored = replace(second, trajectory={**second.trajectory, "rotor_speed": nodes})
    refused = replace(solved, verifications=(first, doctored))
    assert refused.failed() == ["max_speed_error (step)"]
    assert "phase.segments" in explain(refused.by_name["max_speed_error (step)"], solved.physics)
