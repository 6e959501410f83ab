"""The report: what its page says, and what its charts show."""

import base64
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hkt_mdo
from hkt_mdo.case import load_case
from hkt_mdo.cli import main
from hkt_mdo.errors import install
from hkt_mdo.exports.solids import outline_volume
from hkt_mdo.pages import blade, page, panels
from hkt_mdo.results.charts import Labelled
from hkt_mdo.results.panel import Curve
from hkt_mdo.results.solution import Solution
from tests.conftest import edit_summary, make_result
from tests.exports.made import made
from tests.exports.test_solids import ROTORS, make_design, volume_of

TWO = """
name: two
inflow: {profile: sine}
control: {law: quadratic, torque_limit: 700}
scenarios:
  - {name: slow, weight: 3}
  - {name: fast, inflow: {profile: sine, mean: 1.6}, limits: {thrust: 6 kN}}
"""


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> list[Path]:
    """Two invented results, of which checks refused the second one, with a tag in its message."""
    base = tmp_path_factory.mktemp("report")
    results = [make_result(base / "one"), make_result(base / "two", "linear", None)]
    checks = json.loads((results[1] / "summary.json").read_text())["checks"]
    words = "<script>alert(1)</script> exceeds"
    check = {"name": "power", "value": 2.0, "limit": 1.0, "passed": False, "detail": words}
    memory = {"stable": False, "time_s": 4.9, "inflow_speed": 1.69, "tau1_s": 1.6}
    changes = {"success": False, "message": words, "checks": [*checks, check], "memory": memory}
    edit_summary(results[1], **changes)
    return results


@pytest.fixture(scope="module")
def texts(folders, tmp_path_factory) -> dict[str, str]:
    """The pages of one result and of both."""
    out = tmp_path_factory.mktemp("pages")
    solutions = [Solution.load(folder) for folder in folders]
    pages = {"one": solutions[:1], "both": solutions}
    pages = {name: page.write_report(some, out / f"{name}.html") for name, some in pages.items()}
    return {name: path.read_text("utf-8") for name, path in pages.items()}


def test_page_loads_nothing_and_tells_the_energy(texts):
    for text in texts.values():
        tags = re.sub("(<script[^>]*>).*?</script>", r"\1", text, flags=re.DOTALL)
        links = re.findall(r'\b(?:src|href)="([^"]*)"', tags)
        assert links
        assert all(link.startswith(("#", "data:image/png")) for link in links)
        assert "default-src 'none'" in text
    # energy over 60 s, in kW and in kWh a day
    assert f"{322240.5 / 60e3:.3f} kW" in texts["one"]
    assert f"{322240.5 / 60.0 * 24e-3:.4g} kWh" in texts["one"]


def test_a_limited_load_is_told_at_the_head_as_its_limit_counts_it(tmp_path):
    """Such as a stress with its weight, and the energy of a year without what is lost."""
    folder = make_result(tmp_path / "weighed")
    loads, limits = ({"stress": {"unit": "Pa", "value": value}} for value in (238e6, 250e6))
    year = {"energy_kWh": 2000.0, "net_energy_kWh": 1000.0, "kept": 0.5}
    edit_summary(folder, loads=loads, limits=limits, scenarios={"phase": {"year": year}})
    head = {x.label: page.measured(x.value, x.unit) for x in page._headline(Solution.load(folder))}
    assert head["largest stress"] == "250 MPa"
    assert (head["annual energy"], head["annual energy, net"]) == ("2000 kWh", "1000 kWh")
    assert "the blade would break" in head["verdict"]


def test_texts_are_escaped_and_instability_is_told_at_the_head(texts):
    assert "<script>alert" not in texts["both"]
    assert "&lt;script&gt;alert(1)" in texts["both"]
    assert panels.escaped("<b>a</b>\n&") == "&lt;b&gt;a&lt;/b&gt; &amp;"
    message = "sine_linear: with dynamic inflow, UNSTABLE from t = 4.90 s"
    assert message in texts["both"].partition("<nav>")[0]
    assert "UNSTABLE" not in texts["one"]


@pytest.mark.parametrize(
    ("changes", "words", "expected"),
    [
        ({}, "Cavitation is not known", True),
        ({"limits": {"cavitation": {"depth": "3 m"}}}, "Cavitation is not known", False),
        ({"inflow_dynamics": "quasi_steady"}, "The wake answers at once.", True),
        ({"inflow_dynamics": "oye"}, "The wake answers at once.", False),
    ],
)
def test_what_a_case_models_is_not_missing(changes, words, expected):
    case = load_case({"inflow": "sine", "control": "open_loop"} | changes)
    assert (words in " ".join(page.not_modelled(case))) == expected


def test_charts_hold_the_numbers_of_the_tables(texts, folders):
    scripts = re.findall(r'<script[^>]* id="data"[^>]*>(.*?)</script>', texts["one"], re.DOTALL)
    data = json.loads(scripts[0])
    (view,) = data["views"].values()
    table = Solution.load(folders[0]).simulation
    lines = {x["yaxis"]: x for x in view["time"]["data"]}
    speed, margin = lines["y3"], lines["y7"]
    np.testing.assert_allclose(speed["x"], table["time_s"], rtol=1e-6)
    rpm = table["rotor_speed_rad_s"] * 60.0 / (2.0 * np.pi)
    np.testing.assert_allclose(speed["y"], rpm, rtol=1e-4)
    left = 100.0 * (1.0 - table["control_torque_Nm"] / 700.0)
    np.testing.assert_allclose(margin["y"], left, atol=1e-3)
    shown = set(re.findall("#[0-9a-f]{6}", json.dumps(data["views"]) + json.dumps(data["charts"])))
    assert set() < shown <= data["dark"].keys()


@settings(max_examples=25)
@given(
    st.lists(st.floats(-1e3, 1e3) | st.just(np.nan), min_size=1, max_size=200), st.integers(4, 60)
)
def test_thinning_keeps_extremes_ends_and_gaps(values, most):
    values = np.array(values)
    x = np.arange(values.size)
    kept = panels.thinned(x, values, most)
    marked = Curve(x, values, "a front", "#123456", kind="marked", links=[*map(str, x)])
    assert list(panels._traces(marked, most)[0]["customdata"]) == list(map(str, x[kept]))
    gaps = np.flatnonzero(np.isnan(values))
    assert np.all(np.diff(kept) > 0)
    assert {0, values.size - 1, *gaps} <= set(kept)
    assert len(set(kept) - set(gaps)) <= most
    if gaps.size < values.size:
        assert np.nanmin(values[kept]) == np.nanmin(values)
        assert np.nanmax(values[kept]) == np.nanmax(values)


def test_solid_is_the_rotor(folders):
    """Three blades, which reach into the hub, by the integral of their outlines; normals outwards.

    A blade is along x, and the third part of a turn moves the rotor onto itself.
    """
    solution = Solution.load(folders[0])
    bodies, reasons = blade.bodies([Labelled(solution, "")])
    assert [each.name for each in bodies] + reasons == ["optimized blade", "blade at the start"]
    mesh = blade.solid(bodies[:1])["data"][0]

    def unpacked(key):
        return np.frombuffer(base64.b64decode(mesh[key]["bdata"]), f"<{mesh[key]['dtype']}")

    points = np.stack([unpacked(key) for key in "xyz"], axis=-1).astype(float)
    one, two, three = (points[unpacked(key)] for key in "ijk")
    volume = np.sum(one * np.cross(two, three)) / 6.0
    design, hub = solution.design(), 0.125 * 1.4
    begin, end, radius = blade.SOLIDS[0].cylinder(design)
    inside = hub - blade.SOLIDS[0].rooted(design)[0]
    root = design.turbine.outlines[0].area * design.blade.chord[0] ** 2
    expected = 3.0 * (outline_volume(design) + root * inside) + np.pi * radius**2 * (end - begin)
    assert volume == pytest.approx(expected, rel=0.01)  # of 48 points, a thicker trailing edge
    assert np.max(points[:, 0]) == pytest.approx(1.4)
    angle = np.rad2deg(np.arctan2(points[:, 1], points[:, 0])[np.hypot(*points.T[:2]) > 1.3])
    sectors = np.histogram(angle, [-180.0, -90.0, -30.0, 30.0, 90.0, 180.0])[0]
    assert sectors.tolist() == [sectors[2], 0, sectors[2], 0, sectors[2]]
    first, second = (np.mean(each.reshape(-1, 3), axis=0) for each in blade._beside(bodies))
    assert second[0] - first[0] > 2.0 * 1.4  # one beside the other


def test_the_blade_at_the_start_has_its_own_thickness_or_radius(tmp_path):
    design = make_design(tmp_path, ROTORS["designed thickness"])
    start = blade._start(design)
    assert outline_volume(start) == pytest.approx(volume_of(start), rel=1e-3)
    assert outline_volume(start) > 1.01 * outline_volume(design)
    solution = make_design(tmp_path / "1", "rotor: {radius: 1}", rotor_radius_m=1.2).solution
    bodies, _ = blade.bodies([Labelled(solution, "")])
    assert [each.name for each in bodies] == ["optimized blade", "blade at the start"]


def test_envelope_covers_every_scenario(tmp_path):
    solution = made(tmp_path / "two", TWO, [7.5])
    results = [Labelled(solution, "")]
    text = page.write_report([solution], tmp_path / "two.html").read_text("utf-8")
    assert "Of all scenarios together" in text
    views = panels.views(results)
    assert list(views) == ["all scenarios", "slow", "fast"]
    band = [x for x in views["all scenarios"]["time"]["data"] if x["yaxis"] == "y6"]  # thrust, kN
    low, high = (np.array(x["y"]) for x in band)
    thrust = [1e-3 * one.simulation["thrust_N"] for one in solution.by_scenario]
    assert np.min(low) == pytest.approx(np.min(thrust), rel=1e-4)
    assert np.max(high) == pytest.approx(np.max(thrust), rel=1e-4)
    assert np.all(low <= high)
    slow, fast = (views[name]["time"]["layout"]["annotations"] for name in ("slow", "fast"))
    assert "thrust limit 6 kN" in {x["text"] for x in fast} - {x["text"] for x in slow}
    assert "thrust limit 6 kN in fast" in str(views["all scenarios"]["time"]["layout"])


def test_an_unfinished_result_is_reported(folders, tmp_path):
    solution = Solution.load(folders[0])
    changes = dict.fromkeys(("checks", "chord_m", "optimizer", "iterations", "versions"))
    changes |= {"success": False, "message": "interrupted"}
    summary = solution.summary.model_copy(update=changes)
    tables = {name: {"trajectory": x["trajectory"]} for name, x in solution.tables.items()}
    half = replace(solution, summary=summary, tables=tables, coefficients={}, convergence={})
    text = hkt_mdo.report(half, tmp_path / "half.html").read_text("utf-8")
    assert "the run did not come to its end" in text
    assert "No solid of sine_quadratic" in text
    assert "No check has looked at it." in text
    assert text.count("not recorded") == 3  # optimizer, digest, versions


def test_command_writes_and_refuses(folders, tmp_path, capsys, monkeypatch):
    out = str(tmp_path / "new" / "report.html")
    assert main(["report", str(folders[0]), "--out", out]) == 0
    assert capsys.readouterr().out == f"{out}\n"
    assert main(["report", str(folders[0]), "--out", out]) == 2
    assert "is there already; give --force" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    assert main(["report", str(folders[0]), "--out", out, "--force"]) == 2
    text = f"needs the package plotly, which is not installed; install it with: {install('report')}"
    assert text in capsys.readouterr().err
