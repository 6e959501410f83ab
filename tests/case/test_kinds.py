"""Extensions: kinds of one's own from files, modules, classes and installed packages."""

import pickle
import sys
import types
from importlib import metadata
from pathlib import Path
from typing import ClassVar, Literal

import pytest
import yaml

from hkt_mdo import Case, FeedbackLaw, InputError, load_case
from hkt_mdo.case.kinds import ENTRY_POINTS, _installed, _load, known_kinds
from hkt_mdo.case.schema import case_class, read_case

FILE = Path(__file__).parents[1] / "data" / "extension.py"
MINIMAL = "inflow: sine\ncontrol: linear\n"
OWN = (
    "inflow: {profile: sum, parts: [{profile: ramp, rise: 30 cm/s}, {profile: gust}]}\n"
    "control: {law: mixed, torque_limit: 1 kN m}\n"
    "limits: {tip_acceleration: 160 m/s^2}\n"
    "objective: {kind: priced_torque, price: 1e-3}\n"
)


class Later:
    def sizes(self, gains):
        raise NotImplementedError("the law's own comes first")


class Plain(FeedbackLaw, Later):
    """A law that asks for no torque."""

    law: Literal["plain"] = "plain"
    """The control law."""
    gain_units: ClassVar[tuple[str, ...]] = ("N*m",)

    def demand(self, speed, gains):
        return 0.0 * speed


@pytest.fixture
def install(monkeypatch):
    """Return a function that installs an entry point for the time of a test."""

    def declare(value):
        entries = {ENTRY_POINTS: [metadata.EntryPoint("my_turbines", value, ENTRY_POINTS)]}
        monkeypatch.setattr(metadata, "entry_points", lambda group: entries.get(group, []))
        _installed.cache_clear()

    yield declare
    monkeypatch.undo()
    _installed.cache_clear()


@pytest.mark.parametrize("source", ["path", "text", "module"])
def test_a_case_names_kinds_of_an_extension(source):
    """Of a file by its path, as a path or a text, or of a module, as an import would give it."""
    extension = {"path": FILE, "text": str(FILE), "module": _load(FILE)}[source]
    case = read_case(OWN, extensions=[extension])
    assert isinstance(case, Case)
    assert case.inflow.parts[0].rise == 0.3
    assert case.control.torque_limit == 1000.0
    assert case.control.demand(2.0, [3.0, 4.0]) == 22.0
    assert [limit.upper for limit in case.limits.given] == [160.0]
    assert case.objective.price == 1e-3
    again = read_case(case.to_yaml(), extensions=case.extensions)
    for other in (again, case.with_overrides(), pickle.loads(pickle.dumps(case))):
        assert other.to_yaml() == case.to_yaml()
        if source != "module":  # where classes stand for the module
            assert (other == case, type(other)) == (True, type(case))
    assert case.with_overrides("limits.tip_acceleration=120").limits.tip_acceleration.bound == 120.0


def test_a_case_names_a_class():
    case = load_case({"inflow": "sine", "control": "plain"}, extensions=[Plain])
    assert (case.control, case.control.sizes(-2.0)) == (Plain(), 2.0)
    assert case.with_overrides("rotor.radius=2").control == case.control
    assert pickle.loads(pickle.dumps(case)) == case
    assert known_kinds([Plain, Plain, FILE, FILE]).extensions == (Plain, str(FILE.resolve()))


@pytest.mark.parametrize("value", ["my_package", "my_package:Ramp"])
def test_installed_packages_bring_their_kinds(install, monkeypatch, value):
    module = types.ModuleType("my_package")
    source = FILE.read_text(encoding="utf-8")
    monkeypatch.setitem(sys.modules, "my_package", module)
    exec(compile(source, str(FILE), "exec"), module.__dict__)
    install(value)
    case = load_case({"inflow": "ramp", "control": "linear"})
    assert case.inflow.speed_at(0.0) == 1.3
    assert case.extensions == ()
    assert case.with_overrides("inflow.before=2").inflow.before == 2.0


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("no_such_package", r"no_such_package: cannot be imported: ModuleNotFoundError: No module"),
        ("json:dumps", "is no file, module or class"),
        ("json", "json: defines no kind"),
    ],
)
def test_an_installed_package_that_is_broken_is_reported(install, value, message):
    install(value)
    with pytest.raises(InputError, match=message):
        read_case(MINIMAL)


ACCEL = "tip_acceleration"
HEAD = "from typing import Annotated, ClassVar, Literal\nfrom hkt_mdo import *\n"
FAULTS = yaml.safe_load((FILE.parent / "no_kinds.yaml").read_text(encoding="utf-8"))


@pytest.mark.parametrize(("text", "message"), FAULTS["files"])
def test_a_bad_extension_file_is_reported_with_its_line(text, message, tmp_path):
    (tmp_path / "e.py").write_text(text.replace("HEAD", HEAD), encoding="utf-8")
    before = set(sys.modules)
    with pytest.raises(InputError, match=f"e.py: .*{message}") as caught:
        read_case(MINIMAL, extensions=[tmp_path / "e.py"])
    assert str(caught.value).startswith(str(tmp_path))
    if "cannot be run" in message:
        assert not any(name.startswith("hkt_extension") for name in set(sys.modules) - before)


@pytest.mark.parametrize(
    ("extension", "message"),
    [
        ("none.py", r"none\.py: cannot be read \(No such file"),
        (".", r"cannot be read \(Is a directory"),
        ("e.txt", r"e\.txt: is no Python file; give --extend a file that ends in \.py"),
        (dict, "dict: dict: is not a law, profile, limit, objective or aggregate; derive it"),
        (types.ModuleType("empty"), "empty: defines no kind"),
        (3, "is no file, module or class"),
    ],
)
def test_what_is_no_extension_is_reported(extension, message, tmp_path):
    if isinstance(extension, str):
        (tmp_path / "e.txt").write_text("a case", encoding="utf-8")
        extension = tmp_path / extension
    with pytest.raises(InputError, match=message):
        known_kinds([extension])


@pytest.mark.parametrize(("base", "body", "message"), FAULTS["classes"])
def test_what_is_no_kind_is_reported(base, body, message):
    """Of a subclass with this body; limits and objectives with inputs have a name, too."""
    if "inputs" in body:
        body += f"; {'name' if base == 'Limit' else 'kind'}: ClassVar = 'a'"
    namespace = {}
    exec(f"{HEAD}class A({base}):\n    {body}\n", namespace)
    with pytest.raises(InputError, match=f"A: .*{message}"):
        known_kinds([namespace["A"]])


def test_nothing_is_left_of_an_extension():
    with_it = read_case(OWN, extensions=[FILE])
    for key, value, text in (
        ("inflow", "ramp", "profile = 'ramp': unknown; .*give one of constant, .*, sum; one"),
        ("control", "mixed", "law = 'mixed': unknown; give one of open_loop, linear, quad"),
        ("limits", {ACCEL: 160}, f"{ACCEL} = 160: unknown key; known here: torque_rate, power"),
        ("objective", "priced_torque", "kind = 'priced_torque': unknown; give one of capt"),
    ):
        with pytest.raises(InputError, match=rf"{key}\.{text}.* of your own needs --extend FILE"):
            load_case({"inflow": "sine", "control": "linear", key: value})
    assert case_class(known_kinds()) is Case
    assert read_case(MINIMAL) != read_case(MINIMAL, extensions=[FILE])
    assert with_it == read_case(OWN, extensions=[FILE])


def test_a_case_is_read_without_the_limits_that_it_does_not_use():
    text = read_case(MINIMAL, extensions=[FILE]).to_yaml()
    assert ACCEL not in text
    assert read_case(text).to_yaml() == text


def test_a_limit_is_its_bound_or_a_section():
    bare, spelled, plain = (
        read_case(MINIMAL + f"limits: {{tip_acceleration: {value}}}", extensions=[FILE])
        for value in ("160 m/s^2", "{bound: 160 m/s^2}", "160")
    )
    assert bare == spelled == plain
    assert bare.limits.tip_acceleration.bound == 160.0
    assert read_case(MINIMAL, extensions=[FILE]).limits.given == ()
