"""The shipped examples: every one is whole, the cheapest run, and their files are what they say."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from hkt_mdo.case import load_case
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import find_case
from hkt_mdo.problem.physics import complete, physics
from hkt_mdo.run.check import check_case
from hkt_mdo.run.run import run_case
from studies.verification.study import LIMITED

ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "cases" / "examples"
FILES = EXAMPLES / "files"
CASES = sorted(EXAMPLES.glob("*.yaml"))
RM1_INERTIA = 92169.0  # kg m2, rotor_inertia in ROSCO's RM1_MHK.yaml


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_example_is_whole_and_says_what_it_is(path):
    case = complete(load_case(path))
    assert case.name == path.stem
    assert case.phase.segments >= 60
    speed = physics(case).inflow.speed_at(np.linspace(0.0, case.phase.duration, 2001))
    assert np.all(speed > 0.0)
    for page in ("shipped_cases", "studies/examples"):
        assert f"{path.stem}.yaml" in (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")


LIMITED_CASES = sorted((ROOT / "cases" / "limits").glob("*.yaml"))


@pytest.mark.parametrize("path", LIMITED_CASES, ids=lambda path: path.stem)
def test_case_under_limits_has_those_of_its_name(path):
    case = load_case(path)
    names = {limit.name for limit in case.limits.given}
    assert names <= {limit.name for limit in physics(case).scenarios[0].limits}
    if path.stem.startswith("rm1"):
        assert names == {"power", "thrust", "cavitation"}
        return
    assert f"limits/{path.stem}" in LIMITED
    assert case.control.torque_limit == 700.0
    limit, _, law = path.stem.rpartition("_")
    assert case.control.law == {"oloc": "open_loop", "quadratic": "quadratic"}[law]
    several = {"power", "rotor_speed", "thrust", "stress", "cavitation"}
    assert names == (several if limit == "all" else {limit})


@pytest.mark.slow
def test_all_limits_hold_and_the_shadow_price_of_each_is_reported(solve):
    summary = solve("limits/all_oloc", "phase.segments=40", "phase.duration=20").summary
    assert summary.success, summary.message
    for entry in summary.limits.values():
        assert entry.value <= entry.limit * (1.0 + 1e-4)
        assert entry.binding or entry.shadow_price < 1.0
    assert {"power", "thrust"} <= {name for name, each in summary.limits.items() if each.binding}


def test_shipped_cases_go_by_their_names_unless_a_file_has_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find_case("sine_oloc") == ROOT / "cases" / "sine_oloc.yaml"
    assert find_case("river_gust.yaml") == EXAMPLES / "river_gust.yaml"
    assert find_case("limits/rm1_turbulent_limits") == find_case("rm1_turbulent_limits.yaml")
    assert find_case("cases/limits/all_oloc.yaml") == ROOT / "cases" / "limits" / "all_oloc.yaml"
    assert find_case("cases/river_gust.yaml") == Path("cases/river_gust.yaml")  # not its folder
    assert load_case("own_files").name == "own_files"
    (tmp_path / "river_gust").mkdir()  # of results, say
    assert find_case("river_gust") == EXAMPLES / "river_gust.yaml"
    (tmp_path / "sine_oloc").write_text("inflow: {profile: sine}\ncontrol: {law: linear}\n")
    assert load_case("sine_oloc").control.law == "linear"
    for name in ("sine", "mine/sine_oloc.yaml", "files", "../sine_oloc"):
        assert find_case(name) == Path(name)
    with pytest.raises(InputError, match=r"^sine: does not exist"):
        load_case("sine")


@pytest.mark.parametrize("name", ["rm1_turbulent", "rm1_set_angle"])
def test_rm1_has_its_published_inertia_and_torque(name):
    case = load_case(EXAMPLES / f"{name}.yaml", ["design={blade: fixed}"])
    model = physics(case)
    _, inertia = model.rotor.mass_and_inertia(model.blade)
    assert inertia == pytest.approx(RM1_INERTIA, rel=1e-4)
    rated = 500e3 / (11.5 * 2.0 * np.pi / 60.0)  # 500 kW at 11.5 rpm
    assert case.control.torque_limit == pytest.approx(rated, rel=1e-3)
    assert case.fluid.density == 1025.0


def test_own_files_are_what_the_script_makes():
    script = importlib.import_module("example_cases")
    for name, lines in script.files().items():
        text = (FILES / name).read_text(encoding="utf-8")
        assert text.splitlines() == lines
        assert "example_cases.py" in text


@pytest.mark.slow
def test_the_first_turbine_could_be_built(solve):
    """What a newcomer runs first is verified without a warning, strong, stiff and stable."""
    solution, case = solve("examples/first_turbine"), load_case("first_turbine")
    summary = solution.summary
    assert summary.verdict(case) == "verified"
    assert check_case(case).warnings == []
    assert summary.energy_J == pytest.approx(81488.0, rel=1e-4)
    assert summary.gain == pytest.approx(1.165, rel=1e-3)
    assert summary.loads["stress"].value <= case.rotor.blade_material.allowable_stress / 3.0
    assert summary.tip_deflection_m < 0.1 * summary.tip_radius_m
    assert summary.memory.stable
    assert min(summary.chord_m) >= 0.05


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("rm1_set_angle", ()),
        ("river_gust", ()),
        ("river_gust", ("design={blade: fixed}", "control.law=quadratic")),
        ("river_gust", ("design={blade: fixed}", "control.law=filtered_quadratic")),
    ],
)
def test_cheapest_examples_are_a_success(tmp_path, name, overrides):
    law = EXAMPLES / "files" / "filtered_quadratic.py"
    case = load_case(EXAMPLES / f"{name}.yaml", list(overrides), extensions=[law])
    solution = run_case(case, tmp_path / name, figures=False, records=False)
    assert solution.success, solution.message
    summary = solution.summary
    assert summary.simulated_energy_J <= summary.energy_bound_J
    assert summary.control_torque_max_Nm <= case.control.torque_limit * (1.0 + 1e-6)
