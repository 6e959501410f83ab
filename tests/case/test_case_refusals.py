"""What is wrong with a case is told with file, key, value and remedy."""

import pickle

import pytest
import yaml

from hkt_mdo.case import load_case, read_case
from hkt_mdo.case.sweep import load_sweep
from hkt_mdo.errors import InputError, show
from hkt_mdo.problem.physics import physics
from tests.conftest import DATA

MINIMAL = "inflow: {profile: sine}\ncontrol: {law: quadratic}\n"
REFUSALS = yaml.safe_load((DATA / "refusals.yaml").read_text())
REFUSALS += [["read", "a: " + 5000 * "[" + 5000 * "]", ["line 1", "20 levels"]]]
TAKE = {
    "prepared": lambda file: physics(load_case(file)),
    "extended": lambda file: load_case(file, extensions=[DATA / "extension.py"]),
    "swept": load_sweep,
}


@pytest.mark.parametrize(("how", "text", "words"), REFUSALS)
def test_a_case_is_refused_with_file_key_value_and_remedy(how, text, words, tmp_path):
    """Every refusal of tests/data/refusals.yaml is one line of an error."""
    (tmp_path / "river.csv").write_text("time_s,speed_m_s\n0,1\n", encoding="utf-8")
    path = tmp_path / "a.yaml"
    path.write_text(MINIMAL + text if how == "added" else text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        TAKE.get(how, load_case)(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") or how == "prepared"
    assert message.removeprefix(f"{path}: ").startswith(words[0])
    assert message.removeprefix(f"{path}: ").startswith(str(caught.value.key or ""))
    assert [word for word in words if word not in message] == []
    assert message.isprintable()
    assert len(message) < len(str(path)) + 400
    assert "more)" not in message


def test_message_is_one_plain_line():
    with pytest.raises(InputError) as caught:
        read_case(MINIMAL + "rotor: {radius: -1.4}", file="cases/a.yaml")
    message = (
        "cases/a.yaml: rotor.radius = -1.4: must be greater than 0 m; give the tip radius R as a "
    )
    assert str(caught.value).startswith(message)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_further_errors_are_told():
    with pytest.raises(InputError, match=r"2 more: fluid.density must be .*; control is missing"):
        read_case("rotor: {radius: -1}\nfluid: {density: -1}\ninflow: {profile: sine}")


def test_long_values_are_cut():
    with pytest.raises(InputError) as caught:
        read_case(MINIMAL + f"rotor: {{radius: {'x' * 100_000}}}")
    assert len(str(caught.value)) < 300
    assert len(show(list(range(10**6)))) <= 60
    assert len(show(10**5000)) <= 60


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.yaml", None, r"none\.yaml: does not exist; give the path of a case file"),
        (".", None, "is not a file"),
        ("x" * 5000, None, "cannot be read"),
        ("latin.yaml", MINIMAL.encode() + b"# \xe9\n", "line 3: is not UTF-8"),
        ("large.yaml", MINIMAL.encode() + b"#" * 1024**2, "larger than 1 MiB"),
        ("a b.yaml", MINIMAL.encode(), r"name = 'a b'.*give the name of case"),
    ],
    ids=["none", "folder", "long name", "latin", "large", "blank"],
)
def test_what_is_no_readable_case_file_is_reported(name, content, message, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
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
        ("rotor={sections: [{polar: naca4415_Re2e5}], polar: cylinder}", "together with rotor.sec"),
        ("limits={cavitation: 0.5}", "limits.cavitation.margin = 0.5: must be at least 1"),
        ("limits={thrust: }", "limits.thrust: has no value .*; give one, or null for the default"),
    ],
)
def test_bad_overrides_are_reported_as_such(override, message):
    with pytest.raises(InputError, match=message.replace("[0]", r"\[0\]")):
        read_case(MINIMAL + "rotor: {blade: bahaj2007}", [override], file="a")
