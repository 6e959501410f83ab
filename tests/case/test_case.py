"""Cases: what is shipped loads, what is given comes back, and nothing else gets past the reader."""

import pickle
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from hkt_mdo.case import Case, load_case, read_case
from hkt_mdo.dynamics.flows import GustInflow, SineInflow, StepInflow, SumInflow
from hkt_mdo.dynamics.laws import FeedbackLaw, LinearFeedback, OpenLoop, QuadraticFeedback
from hkt_mdo.dynamics.objectives import CapturedEnergy
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import locate, shipped_names
from hkt_mdo.problem.physics import PAPER_CHORD_BOUNDS
from tests.conftest import NINE
from tests.properties import examples

CASES = Path(__file__).parents[2] / "cases"
LAWS = {"oloc": OpenLoop, "linear": LinearFeedback, "quadratic": QuadraticFeedback}
NAMES = [f"{flow}_{law}" for flow in ("step", "sine", "sine_limited") for law in LAWS]
NAMES.append("sine_baseline_oloc")
MINIMAL = "inflow: {profile: sine}\ncontrol: {law: quadratic}\n"
TIDE = "{profile: tide, mean: 2, constituents: [{name: M2, amplitude: 0.5, phase: 30 deg}]}"
FLOWS = {
    "record": "{profile: record, file: river.csv, longest_gap: 2 min, bins: [1, 250 cm]}",
    "turbulence": "{profile: turbulence, intensity: 0.15, cutoff: 0.5, seed: 7}",
    "tide": TIDE,
    "gust": "{profile: gust, shape: mexican_hat, amplitude: -20 cm/s, width: 1 min}",
    "sum": f"{{profile: sum, parts: [{TIDE}, {{profile: turbulence}}, {{profile: gust}}]}}",
}


def same(case: Case, other: Case) -> bool:
    """Tell whether two cases are equal, and in all that follows from it."""
    texts = case.to_yaml() == other.to_yaml()
    return case == other and hash(case) == hash(other) and texts and type(case) is type(other)


# What is shipped ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_shipped_case_says_what_its_name_says_and_comes_back_from_its_own_yaml(name, put):
    case = load_case(CASES / f"{name}.yaml")
    assert case.name == name
    assert isinstance(case.control, LAWS[name.rpartition("_")[2]])
    assert isinstance(case.inflow, StepInflow if name.startswith("step") else SineInflow)
    assert case.control.torque_limit == (700.0 if "limited" in name else None)
    assert case.design.blade == ("fixed" if "baseline" in name else "optimized")
    assert same(load_case(put("a.yaml", case.to_yaml())), case)


def test_defaults_are_the_numbers_of_the_paper():
    reported = yaml.safe_load(locate("amini2023", "reported").read_text(encoding="utf-8"))
    case = read_case(MINIMAL)
    assert 2 * case.rotor.radius == reported["turbine"]["diameter_m"]
    assert case.rotor.blade_count == reported["turbine"]["blades"]
    assert len(case.rotor.stations) == reported["turbine"]["blade_segments"]
    assert list(PAPER_CHORD_BOUNDS) == reported["bounds"]["chord_m"]
    assert list(case.design.twist_bounds) == reported["bounds"]["twist_deg"]
    assert isinstance(case.control, FeedbackLaw)
    assert case.control.smoothing == reported["saturation"]["nu"]
    limited = load_case(CASES / "sine_limited_oloc.yaml")
    assert limited.control.torque_limit == reported["sine_limited"]["u_max_Nm"]


# What is accepted ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("rotor.radius=1400 mm", 1.4),
        ("rotor.radius=2", 2.0),
        ("rotor.hub_inertia=20 kg m^2", 20.0),
        ("control.torque_limit=0.7 kN m", 700.0),
        ("control.gain=7.16 N*m/(rad/s)**2", 7.16),
        ("phase.duration=1 min", 60.0),
        ("driver.tolerance=1e-8", 1e-8),
        ("driver.optimizer=ipopt", "IPOPT"),
        ("design.chord_bounds=[5 mm, 0.4]", (0.005, 0.4)),
        ("design.twist_bounds=[-10, 0.5 rad]", (-10.0, np.degrees(0.5))),
    ],
)
def test_values_are_taken_in_the_unit_of_the_key(override, expected):
    section, name = override.partition("=")[0].split(".")
    value = getattr(getattr(read_case(MINIMAL, [override]), section), name)
    assert value == (expected if isinstance(expected, str) else pytest.approx(expected, rel=1e-12))


@pytest.mark.parametrize(
    "text",
    [
        "rotor: {stations: [0.2, 0.6, 0.99], chord: [0.2, 100 mm, 0.1], twist: [20, 10, 5]}",
        *(f"rotor: {{blade: {name}, radius: 3}}" for name in shipped_names("blade")),
        "rotor: {sections: [{polar: naca4415, thickness: 0.15}]}\ndesign: {chord_points: 5}",
        *(f"inflow: {flow}" for flow in FLOWS.values()),
    ],
)
def test_a_case_comes_back_from_its_own_yaml_and_from_a_pickle(text, put):
    folder = put("river.csv", "time_s,speed_m_s\n0,1\n").parent
    minimal = "control: linear\n" + ("" if "inflow" in text else "inflow: sine\n")
    case = read_case(minimal + text, file=f"{folder}/case.yaml")
    assert same(read_case(case.to_yaml()), case)
    assert same(pickle.loads(pickle.dumps(case)), case)


@pytest.mark.parametrize(
    "limits", ["limits: {power: 5 kW}", "scenarios: [{limits: {thrust: 6 kN}}]"]
)
def test_a_blade_under_limits_has_stations_that_resolve_it(limits):
    assert read_case(MINIMAL + limits).rotor.station_count == 40
    case = read_case(MINIMAL + limits + f"\nrotor: {{stations: {NINE}}}")
    assert case.rotor.station_count is None
    # stations that are given stay, though they are those of the shipped blade
    assert case.with_overrides("phase.duration=30").rotor.stations == tuple(NINE)
    assert read_case(MINIMAL + "limits: {power: null}").rotor.station_count is None


@pytest.mark.parametrize(
    ("text", "key", "name", "message"),
    [
        ("inflow: sine\nrotor: {blade: own/f.csv}", "rotor", "blade", "a shipped blade nor a file"),
        (
            "inflow: {profile: record, file: own/f.csv}",
            "inflow",
            "file",
            "is not a file in .*; give the path",
        ),
    ],
)
def test_paths_count_from_the_folder_of_the_case(text, key, name, message, put):
    file = put("own/f.csv", "r_over_R,c_over_R,pitch_deg\n0.2,0.1,10\n")
    path = put("a.yaml", f"control: linear\n{text}")
    case = load_case(path)
    assert getattr(getattr(case, key), name) == str(file.resolve())
    assert load_case(put("elsewhere/a.yaml", case.to_yaml())) == case
    file.unlink()
    with pytest.raises(InputError, match=message):
        load_case(path)
    assert load_case(path, check_files=False) == case


def test_a_name_that_looks_like_another_type_round_trips():
    for name in ("no", "null", "1e5", "1_000", "2020-01-01", "0x10", "1.", "12", "y"):
        case = Case(name=name, inflow=SineInflow(), control=OpenLoop())
        assert read_case(case.to_yaml()) == case
        assert yaml.safe_load(case.to_yaml())["name"] == name


def test_with_overrides_leaves_the_case_alone():
    case = read_case(MINIMAL)
    other = case.with_overrides("rotor.radius=2", "control={law: linear, gain: 70}")
    assert (case.rotor.radius, other.rotor.radius) == (1.4, 2.0)
    assert other.control == LinearFeedback(gain=70.0)
    assert case.with_overrides() == case
    with pytest.raises(InputError, match=r"^case case, override rotor.radius=-2: rotor.radius = "):
        case.with_overrides("rotor.radius=-2")


RM1 = "rotor: {blade: rm1, material_density: 861}"


@pytest.mark.parametrize("old", ["", RM1, "rotor: {radius: 2}", "rotor: {polar: naca4415_Re2e5}"])
@pytest.mark.parametrize("new", [*shipped_names("blade")])
def test_another_blade_brings_its_own(old, new):
    """Of the old blade nothing is left that the case has not given itself."""
    case, override = read_case(MINIMAL + old), f"rotor.blade={new}"
    text = case.to_yaml()
    wanted = read_case(MINIMAL + old, [override])
    assert read_case(text, [override]).rotor == wanted.rotor
    assert case.with_overrides(override).rotor == wanted.rotor


# Cases from Python, bare names --------------------------------------------------------------------


def test_a_case_from_a_dict_is_that_of_a_file(put, monkeypatch):
    data = {
        "inflow": {"profile": "sine", "mean": "150 cm/s"},
        "control": {"law": "linear"},
        "rotor": {"stations": (0.3, 0.6, np.float64(0.9)), "blade": "river"},
        "name": "a",
    }
    before = repr(data)
    case = load_case(data, ["rotor.radius=2", "control.gain=80"])
    assert repr(data) == before
    text = "inflow: {profile: sine, mean: 1.5}\ncontrol: {law: linear, gain: 80}\n"
    text += "rotor: {stations: [0.3, 0.6, 0.9], blade: river, radius: 2}"
    assert same(load_case(put("a.yaml", text)), case)
    file = put("own.csv", "")
    monkeypatch.chdir(file.parent)  # relative paths count from the current folder
    data["rotor"]["blade"] = "own.csv"
    assert load_case(data).rotor.blade == str(file.resolve())


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, r"case: inflow: is missing"),
        ({"inflow": "sine", "control": "linear", 1: 2}, "Keys should be strings"),
        ({"inflow": 3, "control": "linear"}, "inflow = .*must be a section"),
        ({"inflow": LinearFeedback(), "control": "linear"}, "inflow.profile: is missing"),
        ({"inflow": "sine", "control": "linear", "rotor": {"radius": -1}}, "radius = -1: must be"),
        ({"inflow": "sine", "control": "linear", "rotor": {"blade": Path("x")}}, "must be a text"),
    ],
)
def test_a_bad_dict_is_reported_as_a_file_is(data, message):
    with pytest.raises(InputError, match=message):
        load_case(data)


def test_a_kind_without_keys_is_given_by_its_bare_name():
    bare = read_case("inflow: sine\ncontrol: open_loop\nobjective: captured")
    spelled = "inflow: {profile: sine}\ncontrol: {law: open_loop}\nobjective: {kind: captured}"
    assert same(read_case(spelled), bare)
    assert same(Case(inflow="sine", control="open_loop", objective=CapturedEnergy()), bare)
    assert same(read_case(MINIMAL, ["inflow=sine", "control=open_loop"]), bare)
    # a bare name is a section whose keys can be overridden
    assert read_case("inflow: sine\ncontrol: linear", ["control.gain=80"]).control.gain == 80.0
    with pytest.raises(InputError, match=r"gain = 80: unknown key.* control={...} replaces the"):
        read_case("inflow: sine\ncontrol: {law: linear, gain: 80}", ["control.law=open_loop"])
    with pytest.raises(InputError, match=r"inflow.speed: is missing; give it: Inflow speed v"):
        read_case("inflow: constant\ncontrol: linear")


# Whatever is given --------------------------------------------------------------------------------

KEYS = [*Case.model_fields, "radius", "stations", "chord", "twist", "blade", "profile", "law", "<<"]
KEYS += "amplitude mean chord_bounds optimizer package torque_limit gain kind".split()
WORDS = ["sine", "step", "constant", "linear", "quadratic", "open_loop"]
WORDS += ["captured", "3 m", "2 rpm", "1 m^9", "1 kN m", "ipopt"]
LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(WORDS)
LEAVES |= st.text(max_size=20) | st.dates() | st.binary(max_size=4)


def nested(inner):
    """Return lists and sections of what is inside of them."""
    keys = st.sampled_from(KEYS) | st.text(max_size=5)
    return st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=5)


def kinds(key, names, other, values):
    """Return sections that name one of some kinds and may have another key."""
    return st.fixed_dictionaries({key: st.sampled_from(names)}, optional={other: values})


TREES = st.recursive(LEAVES, nested, max_leaves=15)
SECTIONS = st.fixed_dictionaries(
    {
        "inflow": st.sampled_from(WORDS[:3]) | kinds("profile", WORDS[:3], "mean", LEAVES),
        "control": st.sampled_from(WORDS[3:6]) | kinds("law", WORDS[3:6], "gain", LEAVES),
    },
    optional={name: TREES for name in Case.model_fields if name not in ("inflow", "control")},
)
FLOW = st.dictionaries(
    st.sampled_from(["parts", "constituents", "mean", "file", "bins", "cutoff", "name"]),
    TREES | st.lists(kinds("profile", list(FLOWS), "mean", TREES), max_size=3),
    max_size=4,
)
CASE_OF_FLOW = st.builds(
    lambda profile, keys: {"inflow": {"profile": profile, **keys}, "control": "linear"},
    st.sampled_from([*FLOWS, "sine"]),
    FLOW,
)
MANY = examples(300)


def read_or_refuse(text: str, overrides: tuple[str, ...] = ()) -> None:
    """Read a case that comes back from its own YAML, or meet one line of an InputError."""
    try:
        case = read_case(text, overrides)
    except InputError as error:
        message = str(error)
    else:
        assert read_case(case.to_yaml()) == case
        return
    assert message.isprintable()


@MANY
@given(TREES | SECTIONS | CASE_OF_FLOW)
def test_any_data_gives_a_case_or_an_input_error(data):
    read_or_refuse(yaml.safe_dump(data, allow_unicode=True))


@MANY
@given(st.text() | st.text(alphabet="{}[]:,-&*!|>'\"%@#?~ \n\\0x1e.m/^"))
def test_any_text_gives_a_case_or_an_input_error(text):
    read_or_refuse(text)
    read_or_refuse(MINIMAL + "rotor: {radius: 3 " + text + "}")
    read_or_refuse(MINIMAL, (text,))
    read_or_refuse(MINIMAL, (f"rotor.blade={text}", f"name={text}"))


def test_a_case_is_made_of_sections_too():
    gust = SumInflow(parts=(SineInflow(mean=2.0), GustInflow()))
    case = Case(inflow=gust, control=OpenLoop())
    assert case.inflow.parts == gust.parts
    assert same(load_case({"inflow": gust, "control": "open_loop"}), case)
    assert same(read_case(case.to_yaml()), case)
    assert "profile: sum" in case._repr_html_()
    assert repr(case).startswith("<Case ")
