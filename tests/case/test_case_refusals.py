"""What is wrong with a case is told with file, key, value and remedy."""

import pickle

import pytest

from hkt_mdo.case import load_case, read_case
from hkt_mdo.errors import InputError, show

SINE, FEEDBACK = "inflow: {profile: sine}\n", "control: {law: quadratic}\n"
MINIMAL = SINE + FEEDBACK
M2 = "name: M2, amplitude: 0.5"

# a line or two of YAML, added to a case; then key, value and remedy
SECTIONS = [
    ("design: {set_angle_bounds: [-5, 5]}", "design.set_angle_bounds", "[-5.0, 5.0]", "fixed"),
    ("design: {blade: fixed, chord_points: 5}", "design.chord_points", "5", "blade: optimized"),
    ("design: {chord_bounds: [1, 0.1]}", "design.chord_bounds", "[1, 0.1]", "[lower, upper]"),
    ("design: {chord_bounds: [1]}", "design.chord_bounds[1]", "", "two values"),
    ("design: {radius_bounds: [2, 3]}", "rotor.radius", "1.4", "design.radius_bounds"),
    ("rotor: {radios: 2}", "rotor.radios", "2", "did you mean radius?"),
    ("gain: 7", "gain", "7", "did you mean control.gain?"),
    ("version: 1", "version", "1", "give design.chord_bounds: [0.01, 1]"),
    ("version: 3", "version", "3", "install a newer hkt_mdo"),
    ("rotor: {stations: [0.2, 0.5, 0.4]}", "rotor.stations[2]", "0.4", "sort the stations"),
    ("rotor: {stations: [0.2, 0.5]}", "rotor.stations", "[0.2, 0.5]", "at least 3 values"),
    ("rotor: {stations: [0.125, 0.5, 0.9]}", "rotor.stations[0]", "0.125", "hub_radius_fraction"),
    (
        "rotor: {stations: [0.3, 0.6, 0.9], station_count: 12}",
        "rotor.station_count",
        "12",
        "one of the two",
    ),
    ("rotor: {chord: [0.1]}", "rotor.chord", "[0.1]", "rotor.twist"),
    ("rotor: {chord: [0.1, 0.2], twist: [3, 4]}", "rotor.chord", "[0.1, 0.2]", "has 2 values for"),
    (
        "rotor: {stations: [0.2, 0.5, 0.9], chord: [0.1, 2, 0.1], twist: [3, 2, 1]}\n"
        "design: {chord_bounds: [0.01, 1]}",
        "rotor.chord[1]",
        "2",
        "design.chord_bounds",
    ),
    ("rotor: {blade: bahaj}", "rotor.blade", "bahaj", "did you mean bahaj2007?"),
    ("rotor: {sections: [{outline: naca4415}]}", "rotor.sections[0].polar", "", "is missing"),
    (
        "rotor: {polar: naca63815, reynolds: local}\nhydrodynamics: {bem: ccblade}",
        "hydrodynamics.bem",
        "ccblade",
        "vectorized",
    ),
    ("phase: {segments: true}", "phase.segments", "true", "whole number"),
    ("phase: {segments: 20001}", "phase.segments", "20001", "smaller"),
    ("phase: {order: 4}", "phase.order", "4", "give one of 3, 5, 7, 9"),
    ("name: 3", "name", "3", "quotes"),
    ("name: ../up", "name", "../up", "letters, digits"),
    ("rotor:", "rotor", "null", "leave it out"),
    ("driver: {optimizer: IPOP}", "driver.optimizer", "IPOP", "did you mean IPOPT?"),
    ("driver: {package: scipy}", "driver.optimizer", "IPOPT", "give driver.optimizer: SLSQP"),
    ("objective: capturd", "objective.kind", "capturd", "did you mean captured?"),
    ("limits: {noise: 90}", "limits.noise", "90", "needs --extend FILE"),
]
CONTROLS = [
    ("{law: quadratc}", "control.law", "quadratc", "did you mean quadratic?"),
    ("mixed", "control.law", "mixed", "quadratic, power_law, rated, curve, tracking; one of your"),
    ("{law: open_loop, gain: 3}", "control.gain", "3", "known here: law, torque_limit, cut_out"),
    (
        "open_loop\ndesign: {gain_bounds: [1, 2]}",
        "design.gain_bounds",
        "[1.0, 2.0]",
        "feedback law",
    ),
    (
        "{law: linear, gain: 3}\ndesign: {gain_bounds: [1, 2]}",
        "control.gain",
        "3",
        "within the bounds",
    ),
    (
        "power_law\ndesign: {gain_bounds: [1, 2]}",
        "design.gain_bounds",
        "[1.0, 2.0]",
        "bounds one gain, and the law power_law has 2; leave",
    ),
    ("rated", "control.power", "null", "give it or limits.power, or control.law: quadratic"),
    ("{law: rated, gain: 3}\nlimits: {power: 5e3}", "control.gain", "3", "control.power; give"),
    ("{law: power_law, gain: 30}", "control.gain", "30", "control.exponent; give both"),
    ("{law: curve, knots: 1}", "control.knots", "1", "at least 2"),
    ("{law: curve, knots: 2, knot_speeds: [3, 4]}", "control.knot_torques", "null", "or neither"),
    (
        "{law: curve, knots: 3, knot_speeds: [3, 4], knot_torques: [5, 6, 7]}",
        "control.knot_speeds",
        "[3.0, 4.0]",
        "has 2 numbers for 3 knots;",
    ),
    (
        "{law: curve, knots: 2, knot_speeds: [4, 3], knot_torques: [5, 6]}",
        "control.knot_speeds",
        "[4.0, 3.0]",
        "do not rise; give them",
    ),
    (
        "tracking\ndesign: {gain_bounds: [1, 2]}",
        "design.gain_bounds",
        "[1.0, 2.0]",
        "leave design.gain_bounds out",
    ),
    ("{law: tracking, schedule: [7, 8]}", "control.schedule", "[7.0, 8.0]", "give one per knot"),
    (
        "{law: tracking, integral_gain: 9, integral_bounds: [1, 2]}",
        "control.integral_gain",
        "9",
        "within the bounds",
    ),
]
FLOWS = [
    ("{mean: 1.5}", "inflow.profile", "", "is missing; give one of constant, step, sine"),
    ("tides", "inflow.profile", "tides", "did you mean tide?"),
    ("{profile: sine, amplitude: 1.5}", "inflow.amplitude", "1.5", "smaller than inflow.mean"),
    ("{profile: record}", "inflow.file", "", "is missing; give it: Path of the record"),
    ("{profile: record, file: a.csv}", "inflow.file", "a.csv", "relative to the case's folder"),
    (
        "{profile: record, file: river.csv, speed_unit: ft/sec}",
        "inflow.speed_unit",
        "ft/sec",
        "did you mean ft/s? give one of m/s, cm/s",
    ),
    ("{profile: turbulence, duration: 20}", "inflow.duration", "20", "length_scale/mean = 33.3333"),
    ("{profile: turbulence, cutoff: 1 MHz}", "inflow.cutoff", "", "between 4 and 1000000"),
    ("{profile: turbulence, seed: -1}", "inflow.seed", "-1", "at least 0"),
    ("{profile: tide, constituents: [M2]}", "inflow.constituents[0]", "M2", "must be a section"),
    (
        f"{{profile: tide, constituents: [{{{M2}, period: 1}}]}}",
        "inflow.constituents[0]",
        "",
        "has both a name and a period",
    ),
    (
        f"{{profile: tide, constituents: [{{{M2}}}, {{name: M3, amplitude: 1}}]}}",
        "inflow.constituents[1].name",
        "M3",
        "give one of M2, S2",
    ),
    (
        "{profile: sum, parts: [{profile: sine}, {profile: turbulence, mean: -1}]}",
        "inflow.parts[1].mean",
        "-1",
        "must be greater than 0 m/s; give the mean inflow speed V as",
    ),
    (
        "{profile: sum, parts: [{profile: sine}, {profile: turbulence, men: 1}]}",
        "inflow.parts[1].men",
        "1",
        "did you mean mean?",
    ),
    (
        "{profile: sum, parts: [{profile: sine}, {profile: sum, parts: []}]}",
        "inflow.parts[1].profile",
        "sum",
        "give one of constant, step, sine, tide, gust,",
    ),
    (
        "{profile: sum, parts: [{profile: sine}, {mean: 1}]}",
        "inflow.parts[1].profile",
        "",
        "is missing; give one of",
    ),
    (
        f"{{profile: sum, parts: [{{profile: gust}}, {{profile: tide, constituents: [{{{M2}, "
        "phase: 30 m}]}]}",
        "inflow.parts[1].constituents[0].phase",
        "30 m",
        "which does not convert to rad",
    ),
]
DOCUMENTS = [
    ("control: {law: linear}", "inflow", "", "with one of constant, step, sine"),
    ("inflow: {profile: sine", "line 1", "", "YAML"),
    (MINIMAL + 'rotor: {blade: "\\ud800"}', "rotor.blade", "", "incomplete Unicode"),
    (MINIMAL + 'rotor: {blade: "\\0"}', "rotor.blade", "\\x00", "shipped"),
    (MINIMAL + "rotor:\n  radius: 1\n  radius: 2", "rotor.radius", "2", "given twice (again in"),
    ("a: &a [x, x]\nb: &b [*a, *a]\n" + MINIMAL, "line 1", "", "write the value out"),
    ("a: !!python/object/apply:os.system [ls]", "line 1", "", "tags (!) are refused"),
    ("a: " + 5000 * "[" + 5000 * "]", "line 1", "", "20 levels"),
    ("1: 2", "", "", "not a word"),
    ("inflow: {profile: constant, speed: 1,5}", "inflow", "", "a decimal has a point, not a comma"),
    ("[1, 2]", "", "[1, 2]", "keys and values"),
    ("# nothing\n", "", "", "contains no case"),
]
BAD = (
    [(MINIMAL + text, *told) for text, *told in SECTIONS]
    + [(f"{SINE}control: {text}", *told) for text, *told in CONTROLS]
    + [(f"{FEEDBACK}inflow: {text}", *told) for text, *told in FLOWS]
    + DOCUMENTS
)


@pytest.mark.parametrize(("text", "key", "value", "remedy"), BAD)
def test_bad_input_is_reported_with_file_key_value_and_remedy(text, key, value, remedy, tmp_path):
    (tmp_path / "river.csv").write_text("time_s,speed_m_s\n0,1\n", encoding="utf-8")
    path = tmp_path / "a.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_case(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: {key}")
    assert value in message
    assert remedy in message
    assert message.isprintable()
    assert len(message) < len(str(path)) + 400
    assert "more)" not in message
    assert caught.value.key == key or key.startswith("line") or not key


def test_message_is_one_plain_line():
    with pytest.raises(InputError) as caught:
        read_case(MINIMAL + "rotor: {radius: -1.4}", file="cases/a.yaml")
    assert str(caught.value) == (
        "cases/a.yaml: rotor.radius = -1.4: must be greater than 0 m; give the tip radius R as a "
        "number in m, or a text with a unit of that kind"
    )
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_further_errors_are_counted():
    with pytest.raises(InputError, match=r"and 2 more"):
        read_case("rotor: {radius: -1}\nfluid: {density: -1}\ninflow: {profile: sine}")


def test_long_values_are_cut():
    with pytest.raises(InputError) as caught:
        read_case(MINIMAL + f"rotor: {{radius: {'x' * 100_000}}}")
    assert len(str(caught.value)) < 300
    assert len(show(list(range(10**6)))) <= 60
    assert len(show(10**5000)) <= 60


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("none.yaml", None, r"none\.yaml: does not exist; give the path of a case file"),
        (".", None, "is not a file"),
        ("x" * 5000, None, "cannot be read"),
        ("latin.yaml", MINIMAL.encode() + b"# \xe9\n", "line 3: is not UTF-8"),
        ("large.yaml", MINIMAL.encode() + b"#" * 1024**2, "larger than 1 MiB"),
        ("a b.yaml", MINIMAL.encode(), r"name = 'a b'.*give such a name"),
    ],
    ids=["none", "folder", "long name", "latin", "large", "blank"],
)
def test_what_is_no_readable_case_file_is_reported(name, content, told, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=told):
        load_case(tmp_path / name)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("rotor.radius", "override = 'rotor.radius': is not an override"),
        ("rotor.stations[0]=3", "is not an override"),
        ("rotor.radius=[", "a, override rotor.radius: line 1, column 2: cannot be read as YAML"),
        ("rotor.radius=-1", "a, override rotor.radius=-1: rotor.radius = -1: must be greater than"),
        ("rotor={radius: -1}", "a, override rotor={radius: -1}: rotor.radius = -1: must be"),
        ("rotor.blade.x=1", "rotor.blade = 'bahaj2007': .* rotor.blade.x cannot be applied"),
        ("rotr.radius=1", "rotr = .*did you mean rotor"),
        ("control.law=linar", "control.law = 'linar': unknown; did you mean linear"),
        ("limits={thrust: }", "limits.thrust: has no value .*; give one, or null for the default"),
    ],
)
def test_bad_overrides_are_reported_as_such(override, message):
    with pytest.raises(InputError, match=message.replace("[0]", r"\[0\]")):
        read_case(MINIMAL + "rotor: {blade: bahaj2007}", [override], file="a")
