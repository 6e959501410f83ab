"""Limits and loads of a finished design in other flows: theory first, then the run's own flow."""

import csv
import json
import re
import shutil
from dataclasses import replace
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

import hkt_mdo
from hkt_mdo.cli import main
from hkt_mdo.dynamics.flows import ConstantInflow, GustInflow, SineInflow
from hkt_mdo.dynamics.generator import Generator
from hkt_mdo.dynamics.limits import Limit, PowerLimit, ThrustLimit, TorqueLimit, TorqueRateLimit
from hkt_mdo.dynamics.simulation import RecordedTorque, simulate
from hkt_mdo.errors import InputError
from hkt_mdo.files.yaml_text import parse
from hkt_mdo.results.solution import Solution
from hkt_mdo.studies.other_flows import Extreme, Run, largest, runs_of
from hkt_mdo.studies.uncertainty import Sensor, flow_given
from tests.conftest import NINE

TURBULENCE = "{profile: turbulence, mean: 1.5, intensity: 0.1, cutoff: 0.3}"


class SlowestRotor(Limit):
    """A limit from below only, as an extension may give."""

    name: ClassVar[str] = "slowest_rotor"
    unit: ClassVar[str | None] = "rad/s"
    inputs: ClassVar[tuple[str, ...]] = ("rotor_speed",)
    least: float
    lower = property(lambda self: self.least)


@pytest.fixture(scope="module")
def free(solve):
    """A design under quadratic feedback without a torque limit."""
    return solve("sine_quadratic", "driver.optimizer=IPOPT").design()


def limited(design, *limits):
    scenario = replace(design.physics.scenarios[0], limits=limits)
    return replace(design, physics=replace(design.physics, scenarios=(scenario,)))


# Theory -------------------------------------------------------------------------------------------


def test_under_a_square_law_loads_grow_with_the_square_of_the_flow(free):
    """K w² has the same tip speed ratios in every steady flow: speeds ~ v, loads ~ v², power ~ v³.

    The distance travelled by the water takes the place of time, so the ratios are the same after
    the same distance.
    """
    slow, fast = (Run(free, ConstantInflow(speed=speed)).extremes for speed in (0.8, 1.6))
    powers = {"rotor_speed": 1, "tip_speed": 1, "thrust": 2, "root_moment": 2, "stress": 2}
    for name, power in (powers | {"control_torque": 2, "power": 3}).items():
        assert fast[name].value == pytest.approx(2.0**power * slow[name].value, rel=1e-6), name
        assert fast[name].limit is fast[name].kept is None


def test_a_limit_is_kept_up_to_its_bound(quadratic):
    flow = ConstantInflow(speed=1.5)
    thrust = Run(quadratic, flow).extremes["thrust"].value
    for share, kept in ((0.5, True), (0.9999, True), (1.001, False), (2.0, False)):
        entry = Run(limited(quadratic, ThrustLimit(bound=thrust / share)), flow).extremes["thrust"]
        assert (entry.value, entry.kept) == (pytest.approx(thrust, rel=1e-12), kept)
        assert entry.share == pytest.approx(share, rel=1e-12)
        text = entry.row("thrust").text
        assert f"{100.0 * share:.2f} %" in text
        assert ("kept" in text, "BROKEN" in text) == (kept, not kept)


def test_a_limit_from_below_and_one_of_both_signs(quadratic):
    flow = SineInflow()
    run = quadratic.simulate(flow)
    slowest, at = run.rotor_speed.min(), np.argmin(run.rotor_speed)
    for least, kept in ((0.5 * slowest, True), (1.1 * slowest, False)):
        entry = Run(limited(quadratic, SlowestRotor(least=least)), flow).extremes["slowest_rotor"]
        assert (entry.limit, entry.kept, entry.value) == (least, kept, pytest.approx(slowest))
        assert entry.time_s == run.time[at]
        assert entry.share == pytest.approx(2.0 - slowest / least)
    entry = Run(limited(quadratic, TorqueRateLimit(bound=1.0)), flow).extremes["torque_rate"]
    rate = np.gradient(run.control_torque, run.time)
    assert entry.value == pytest.approx(np.max(np.abs(rate)), rel=0.05)
    assert entry.share == pytest.approx(entry.value)
    assert not entry.kept


def test_time_above_the_cut_out_is_a_share_of_time(quadratic):
    law = quadratic.physics.law.model_copy(update={"cut_out": 1.5 + 1e-9})
    design = replace(quadratic, physics=replace(quadratic.physics, law=law))
    entry = Run(design, GustInflow(width=6.0)).extremes["flow above the cut-out"]
    assert float(entry.remark.split()[1]) == pytest.approx(10.0, abs=0.2)  # 6 s of 60 s


def test_a_torque_that_drives_the_rotor_is_reported(open_loop):
    """The generator's torque is never negative, whatever its largest value is."""
    for bound in (700.0, None):
        heavy = replace(open_loop, plant=replace(open_loop.plant, inertia=1e6))
        heavy = limited(heavy, TorqueLimit(bound=bound))
        heavy.__dict__["controller"] = _driving
        entry = Run(heavy, SineInflow()).extremes["control_torque"]
        assert (entry.value, entry.limit, entry.kept) == (-5.0, 0.0, False)


def _driving(_time, speed, *_):
    """Return a torque of -5 N m."""
    return -5.0 + 0.0 * speed


_driving.rate = lambda time, *_: 0.0 * time


def test_the_speed_of_an_unstable_rotor_is_held_as_in_the_run(open_loop):
    """Below the speed of the largest torque, a constant torque in a steady flow stops the rotor.

    What the checks of a run add holds the speed instead; a stable rotor needs nothing.
    """
    assert open_loop.controller.stiffness == 0.0
    plant, flow = open_loop.plant, ConstantInflow(speed=1.5)
    time = (np.arange(60.0)[:, None] + [0.0, 0.5, 1.0]).ravel()
    speeds = np.linspace(4.0, 9.0, 501)
    torques = plant.torque(speeds, np.full(501, 1.5))
    index = np.argmax(torques) - 30
    speed, torque = speeds[index], torques[index]
    assert torques[index + 10] > torque > torques[index - 10]
    table = dict.fromkeys(open_loop.solution.trajectory, np.ones(180)) | {"time_s": time}
    table |= {"inflow_speed_m_s": np.full(180, 1.5), "rotor_speed_rad_s": np.full(180, speed)}
    table |= {"control_torque_Nm": np.full(180, torque)}
    tables = {"phase": {"trajectory": table}}
    unstable = replace(open_loop.solution, tables=tables).design()
    held = unstable.simulate(flow, 0.99 * speed)
    assert unstable.controller.stiffness > 0.0
    assert held.stopped_at is None
    assert held.rotor_speed[-1] == pytest.approx(speed, rel=1e-6)
    alone = RecordedTorque(table["time_s"], table["control_torque_Nm"])
    assert simulate(plant, flow, alone, 0.99 * speed, held.time).stopped_at < 60.0


# The flow of the run ------------------------------------------------------------------------------


def test_in_the_flow_of_the_run_it_agrees_with_the_run(quadratic, open_loop):
    for design in (quadratic, open_loop):
        (run,), summary = hkt_mdo.simulate(design.solution), design.solution.summary
        loads = summary.loads
        assert run.energies["energy"] == pytest.approx(summary.simulated_energy_J, rel=1e-7)
        for name, entry in (loads | summary.limits).items():
            assert run.extremes[name].value == pytest.approx(entry.value, rel=2e-4), name
            assert run.extremes[name].r_m == (loads[name].r_m if name in loads else None)
        torque = run.extremes["control_torque"]
        assert (torque.limit, torque.kept) == (700.0, True)


# The command --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(quadratic, tmp_path_factory):
    """A result whose case has a limit of the thrust that its own flow keeps."""
    folder = tmp_path_factory.mktemp("other_flows") / "result"
    shutil.copytree(quadratic.solution.folder, folder)
    text = (folder / "case.yaml").read_text(encoding="utf-8")
    changed = text.replace("\n  thrust: null\n", "\n  thrust: 8 kN\n")
    assert changed != text
    changed = changed.replace("\n  stations: null\n", f"\n  stations: {NINE}\n")
    (folder / "case.yaml").write_text(changed, encoding="utf-8")
    return folder


def test_strict_ends_with_3_where_a_limit_is_broken(folder, open_loop, capsys):
    assert main(["simulate", str(folder), "--strict"]) == 0
    assert "limit 8 kN, " in capsys.readouterr().out
    fast = ["simulate", str(folder), "--flow", "{profile: constant, speed: 2}"]
    assert main(fast) == 0
    assert main([*fast, "--strict"]) == 3
    output = capsys.readouterr()
    assert re.search(r"thrust +1[\d.]+ kN, limit 8 kN, 1\d\d\.\d\d %,\s+BROKEN", output.out)
    assert output.err == "error: not kept: thrust\n"
    assert main(["simulate", str(open_loop.solution.folder), "--flow", "C", "--strict"]) == 3
    output = capsys.readouterr()
    stops = r"rotor stops from t = [\d.]+ s, generates no more: the simulation ends there"
    assert re.search(stops, " ".join(output.out.split()))
    assert output.err == "error: not kept: rotor stops\n"


def test_memory_of_the_wake_lets_the_papers_rotor_run_away(quadratic, tmp_path, capsys):
    """At the torque limit; in a slower flow, which the limit does not bend, the rotor is stable."""
    command = ["simulate", str(quadratic.solution.folder), "--inflow-dynamics", "oye"]
    assert main([*command, "--strict", "--out", str(tmp_path)]) == 3
    output = capsys.readouterr()
    words = " ".join(output.out.split())
    assert "with dynamic inflow (tau1 by the induction): 314.7" in words
    assert "without memory: 310.552 kJ captured" in words
    assert re.search(r"314\.7\d+ kJ .* rotor at [\d.]+ to 1[67][\d.]+ rad/s", words)
    assert re.search(r"rotor runs away from t = \d\.\d+ s, more than 20 % faster", words)
    assert output.err == "error: not kept: rotor runs away\n"
    rows = json.loads((tmp_path / "simulations.json").read_text())
    thrust = {row["quantity"]: row["value"] for row in rows}["thrust"]
    assert thrust == pytest.approx(16.24e3, rel=1e-3)
    calm = ["--tau1", "1.8", "--flow", "{profile: sine, scale: 0.85}", "--strict"]
    assert main([*command, *calm]) == 0
    printed = capsys.readouterr().out
    assert "(tau1 = 1.8 s)" in printed
    assert "runs away" not in printed


def test_loads_with_memory_are_those_of_the_sections_then(quadratic):
    """Thrust, of the torque and loads that the sections have in what the wake induces."""
    (run,) = runs_of(quadratic.solution, "design", None, True, 1.0)
    simulated, plant = run.simulation, run.design.plant
    operation = simulated.rotor_speed, simulated.inflow_speed, simulated.filters
    sections = plant.wake.sections(*operation)
    blade, pressure = plant.blade, 0.5 * plant.density * simulated.inflow_speed**2
    spans = 0.5 * blade.blade_count * (blade.edges[2:] - blade.edges[:-2])
    thrust = pressure * (sections.normal_load @ spans)
    assert run.extremes["thrust"].value == pytest.approx(np.max(thrust), rel=1e-12)
    assert run.extremes["thrust"].time_s == pytest.approx(simulated.time[np.argmax(thrust)])
    torque = pressure * (sections.tangential_load @ (spans * blade.r))
    np.testing.assert_allclose(simulated.hydrodynamic_torque, torque, rtol=1e-10)


@pytest.mark.parametrize(
    ("options", "key"),
    [
        (["--inflow-dynamics", "pitt_peters"], "inflow_dynamics.model"),
        (["--inflow-dynamics", "oye", "--start-up"], "--inflow-dynamics"),
        (["--inflow-dynamics", "oye", "--noise-snr", "20"], "--inflow-dynamics"),
        (["--inflow-dynamics", "oye", "--tau1", "0"], "inflow_dynamics.tau1"),
        (["--inflow-dynamics", "oye", "--tau1", "nan"], "inflow_dynamics.tau1"),
        (["--tau1", "2"], "inflow_dynamics.tau1"),
    ],
)
def test_what_does_not_go_with_memory_is_reported(quadratic, options, key, capsys):
    assert main(["simulate", str(quadratic.solution.folder), *options]) == 2
    error = capsys.readouterr().err
    assert re.match(rf"error: (case \S+, override .*: )?{re.escape(key)}\b", error), error
    assert error.count("\n") == 1


def test_seeds_are_simulated_one_by_one_and_written(folder, tmp_path, capsys):
    out = tmp_path / "made" / "tables"
    options = ["--flow", TURBULENCE, "--flow-seeds", "3,5..6"]
    assert main(["simulate", str(folder), *options, "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "Largest values of 3 simulations" in printed
    rows = json.loads((out / "simulations.json").read_text())
    with (out / "simulations.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["quantity"] for row in table] == [row["quantity"] for row in rows]
    assert {row["seed"] for row in rows} == {3, 5, 6}
    runs = {}
    for number, (text, row) in enumerate(zip(table, rows, strict=True)):
        assert list(text) == list(row), number
        assert float(text["value"]) == row["value"]
        runs.setdefault(row["seed"], {})[row["quantity"]] = row
    for seed, entries in runs.items():
        flow = TURBULENCE.replace("}", f", seed: {seed}" + "}")
        (alone,) = runs_of(Solution.load(folder), parse(flow, "flow"))
        assert entries["energy"]["value"] == pytest.approx(alone.energies["energy"], rel=1e-12)
        assert f"seed {seed}, without noise: {alone.outcome}; limits: {alone.verdicts}" in printed
        for name, entry in alone.extremes.items():
            assert entries[name]["value"] == pytest.approx(entry.value, rel=1e-12), name
    worst = max(runs, key=lambda seed: runs[seed]["thrust"]["share"])
    row = re.search("thrust  .*?root", printed, re.DOTALL)[0]
    assert f"in seed {worst}" in " ".join(row.split())


def test_an_efficiency_beyond_the_generators_table_is_told(quadratic, tmp_path):
    table, rows = tmp_path / "table.csv", "0,0,0.9\n0,200,0.9\n400,0,0.9\n400,200,0.9\n"
    table.write_text(f"torque_Nm,speed_rpm,efficiency\n{rows}")
    physics = quadratic.physics
    case = physics.case.model_copy(update={"generator": Generator(table=str(table))})
    run = Run(replace(quadratic, physics=replace(physics, case=case)), ConstantInflow(speed=1.6))
    assert "electrical (extrapolated, up to 59 % beyond generator.table)" in run.outcome


def test_of_several_runs_the_most_used_limit_is_reported(quadratic):
    """The largest value of the runs without the limit stands beside it."""
    slow = Run(limited(quadratic, ThrustLimit(bound=8e3)), ConstantInflow(speed=1.2), "slow")
    fast = Run(limited(quadratic), ConstantInflow(speed=1.6), "fast")
    for runs in ((slow, fast), (fast, slow)):
        worst = largest(runs)
        assert (worst["thrust"].scenario, worst["thrust"].limit) == ("slow", 8e3)
        assert worst["root_moment"].scenario == worst["thrust without limit"].scenario == "fast"
    tighter = replace(slow, design=limited(quadratic, ThrustLimit(bound=5e3)), scenario="tighter")
    assert largest([slow, tighter])["thrust"].scenario == "tighter"


def test_limits_with_noise_are_the_largest_of_all_samples(quadratic):
    run = Run(limited(quadratic, PowerLimit(bound=3e3)), SineInflow(), noise=(Sensor(), 2, 1))
    power, (_, _, speed, _, torque) = run.extremes["power with noise"].value, run.noisy.samples
    assert power == pytest.approx(np.max(speed * torque), rel=1e-12)


def test_of_several_runs_the_first_event_is_reported():
    at = {"late": 9.0, "early": 4.0}
    runs = [SimpleNamespace(name=x, extremes={"stops": Extreme(value=at[x], unit="s")}) for x in at]
    assert {largest(x)["stops"].scenario for x in (runs, runs[::-1])} == {"early"}


@pytest.mark.parametrize("seeds", ["", "1..", "3..1", "-1", "a", "1..20001", "1,,2", "1.5", "²"])
def test_what_is_no_list_of_seeds_is_refused(folder, capsys, seeds):
    assert main(["simulate", str(folder), "--flow", TURBULENCE, f"--flow-seeds={seeds}"]) == 2
    assert f"--flow-seeds = {seeds!r}: is no list of seeds" in capsys.readouterr().err


def test_a_flow_that_has_a_length_is_simulated_over_it(folder, capsys):
    assert main(["simulate", str(folder), "--flow", TURBULENCE[:-1] + ", duration: 75}"]) == 0
    assert "kJ generated in 75 s; rotor at" in " ".join(capsys.readouterr().out.split())


def test_a_flow_without_a_seed_has_no_seeds(folder, quadratic, capsys):
    assert main(["simulate", str(folder), "--flow-seeds", "1..3"]) == 2
    assert "--flow-seeds: the flow sine has no seed" in capsys.readouterr().err
    weak = "{profile: turbulence, mean: 1, intensity: 0.9, length_scale: 2}"
    with pytest.raises(InputError, match=r"seed 2'.*reverses"):
        flow_given(weak, quadratic.solution.case, 2)


def test_a_start_up_reports_the_limits_of_its_operation(folder, capsys):
    assert main(["simulate", str(folder), "--start-up"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert re.search(r"run-up: .* operation: .* Largest values .* thrust [\d.]+ kN, limit", printed)
