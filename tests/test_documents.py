"""What the schema tells its readers: the page, the JSON schema of editors, and new cases."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from hkt_mdo.case import Case, load_case, read_case
from hkt_mdo.case.document import case_json_schema
from hkt_mdo.cli import main
from hkt_mdo.cli.new_case import KINDS, write_new_case
from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.errors import InputError
from hkt_mdo.files.blade import read_blade
from hkt_mdo.files.shipped import POLAR_FAMILIES, shipped_names
from hkt_mdo.files.yaml_text import parse
from hkt_mdo.problem.physics import physics
from hkt_mdo.quantities import QUANTITIES
from hkt_mdo.sections import parts_of

ROOT = Path(__file__).parent.parent
CASES = sorted((ROOT / "cases").glob("*.yaml"))
TAGS = "profile", "law", "kind", "measure", "model"
MINIMAL = "inflow: {profile: sine}\ncontrol: {law: quadratic}\n"


def sections(kind=Case):
    """Yield every class of a case but the limits, found from the case itself."""
    yield kind
    for field in kind.model_fields.values():
        for part in parts_of(field.rebuild_annotation()):
            if isinstance(part, type) and not issubclass(part, Limit):
                yield from sections(part)


def one_line(text):
    return " ".join(text.split())


# The page -----------------------------------------------------------------------------------------


def test_page_has_every_key_with_its_docstring_type_and_default(capsys):
    assert main(["schema", "--markdown"]) == 0
    text = capsys.readouterr().out
    committed = (ROOT / "docs" / "cases.md").read_text(encoding="utf-8")
    assert text == committed, "hkt schema --markdown > docs/cases.md"
    page = one_line(text)
    for section in sections():
        assert section is Case or one_line(section.__doc__) in page
        for name, field in section.model_fields.items():
            if section is Case and name != "name":
                assert f"`{name}`" in page
            elif name in ("profile", "law"):
                assert f"### `{name}: {field.default}`" in page
            elif name not in TAGS:
                assert f"- **`{field.alias or name}`**: " in page
                assert one_line(section.description(name)) in page
    polars = {name for family in POLAR_FAMILIES.values() for name in family}
    shipped = {name for kind in ("blade", "polar", "outline") for name in shipped_names(kind)}
    for name in {*shipped, *POLAR_FAMILIES, *polars}:
        assert f"`{name}`" in page
    named = (ROOT / "docs" / "shipped_cases.md").read_text(encoding="utf-8")
    shipped = [*(ROOT / "cases").glob("*.yaml"), *(ROOT / "cases").glob("*/*.yaml")]
    assert {case.stem for case in shipped} <= set(re.findall(r"`(\w+)(?:\.yaml)?`", named))


# The how-to ---------------------------------------------------------------------------------------

HOW_TO = "\n".join(
    (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    for page in ("own_turbine", "flows", "generator_limits")
)


def blocks(kind):
    return re.findall(rf"^```{kind}\n(.*?)^```$", HOW_TO, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("block", blocks("yaml"), ids=one_line)
def test_what_the_how_to_shows_is_a_case(block, validator):
    text = f"{block}\ncontrol: quadratic\n" + "inflow: sine\n" * ("inflow:" not in block)
    read_case(text, check_files=False)
    validator.validate(parse(text, "x"))


@pytest.mark.parametrize(("kind", "name"), [("csv", "blade.csv"), ("text", "blade.dat")])
def test_a_blade_of_the_how_to_is_read_as_it_stands(kind, name, tmp_path):
    (tmp_path / name).write_text(blocks(kind)[0], encoding="utf-8")
    case = next(each for each in blocks("yaml") if f"blade: {name}, " in each)
    text = f"{case}inflow: {{profile: sine}}\ncontrol: {{law: quadratic}}\n"
    assert physics(read_case(text, file=f"{tmp_path}/case.yaml")).blade.r.size == 20


ARCHITECTURE = (ROOT / "docs" / "dev" / "architecture.md").read_text(encoding="utf-8")
EXTENSION = ROOT / "tests" / "data" / "extension.py"


def test_architecture_names_every_quantity_with_its_unit():
    part = ARCHITECTURE.partition("## Quantities")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \| ([^|]*) \|$", part, re.MULTILINE)
    over = {"design": "the design", "result": "the whole result"}
    specs = [(e.name, e.unit or "-", over.get(e.over, e.over), e.text) for e in QUANTITIES.values()]
    assert [tuple(map(str.strip, row)) for row in rows] == specs


def test_extensions_of_the_architecture_are_those_that_are_tested():
    source, flags = EXTENSION.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    code, cases = (
        re.findall(rf"^```{kind}\n(.*?)^```$", ARCHITECTURE, flags) for kind in ("python", "yaml")
    )
    shown = [block.partition("\n\n\nclass ")[2] for block in code]
    assert sum(map(bool, shown)) == 3
    assert all(f"class {text}" in source for text in shown if text)
    for text in cases:
        load_case(parse(text, "architecture.md"), extensions=[EXTENSION])


@pytest.mark.slow
def test_python_of_the_readme_works(tmp_path, monkeypatch, capsys):
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    exec(compile(code, "README.md", "exec"), {})
    energy, gain = map(float, capsys.readouterr().out.split()[-2:])
    assert energy == pytest.approx(81488.0, abs=5.0)
    assert gain == pytest.approx(1.165, abs=0.001)


# The JSON schema ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def validator():
    from jsonschema import Draft202012Validator  # 3 s

    schema = json.loads(json.dumps(case_json_schema()))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_schema_takes_every_shipped_case_short_and_written_out(validator, path):
    validator.validate(parse(path.read_text(encoding="utf-8"), path.name))
    validator.validate(parse(load_case(path, check_files=False).to_yaml(), path.name))


BAD = parse((ROOT / "tests" / "data" / "schema_refusals.yaml").read_text(), "schema_refusals.yaml")


@pytest.mark.parametrize(("text", "path"), BAD)
def test_schema_refuses_what_a_case_refuses_at_the_same_place(validator, text, path):
    with pytest.raises(InputError):
        read_case(MINIMAL + text)
    (error,) = validator.iter_errors(parse(MINIMAL + text, "x"))
    assert list(error.absolute_path)[: len(path)] == path


# New cases ----------------------------------------------------------------------------------------

UNUSUAL = {"name", "resource", "scenarios", "robustness", "version"}
"""Keys that a new case does not show."""


@pytest.mark.parametrize("kind", KINDS)
def test_new_case_loads_and_explains_itself(tmp_path, validator, kind):
    path, *samples = write_new_case(tmp_path / "mine", kind)
    assert path == tmp_path / "mine.yaml"
    assert len(samples) == (kind != "paper")
    text = path.read_text(encoding="utf-8")
    case = load_case(path)
    assert case.name == "mine"
    validator.validate(parse(text, path.name))
    comments = " ".join(re.findall(r"^ *# (.*)$", text, re.MULTILINE))
    for name in Case.model_fields.keys() - UNUSUAL:
        section = type(getattr(case, name))
        assert one_line(section.__doc__) in comments
        part = re.split(rf"\n(?:# )?{name}:\n", text)[1].partition("\n\n\n")[0]
        for key in re.findall(r"^  (?:# )?(\w+): ", part, re.MULTILINE):
            is_field = key in section.model_fields and key not in TAGS
            assert not is_field or one_line(section.description(key)) in comments
    assert case.inflow.speed_at(0.0) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_new_case_passes_the_check(tmp_path, capsys, kind):
    path, *_ = write_new_case(tmp_path / "mine", kind)
    assert main(["check", str(path)]) == 0
    assert "mine can be run." in capsys.readouterr().out


def test_new_paper_case_is_the_default_case(tmp_path):
    (path,) = write_new_case(tmp_path / "mine")
    assert load_case(path) == read_case(MINIMAL, file="mine.yaml")
    with pytest.raises(InputError, match="--kind = 'boat': unknown; give one of paper, turbine"):
        write_new_case(tmp_path / "other", "boat")


def test_new_turbine_is_the_shipped_one_from_a_file_of_its_own(tmp_path):
    path, blade = write_new_case(tmp_path / "new" / "mine.yml", "turbine")
    assert (path.name, blade.name) == ("mine.yml", "mine_blade.csv")
    case, shipped = load_case(path), read_case(MINIMAL + "rotor: {blade: river}")
    assert case.rotor.blade == str(blade.resolve())
    assert case.rotor.model_copy(update={"blade": "river"}) == shipped.rotor
    for name in ("r", "chord", "twist", "thickness"):
        column, wanted = (getattr(read_blade(source), name) for source in (blade, "river"))
        np.testing.assert_array_equal(column, wanted)


def test_new_river_has_the_variance_of_its_spectrum_and_is_always_the_same(tmp_path):
    path, record = write_new_case(tmp_path / "mine", "river")
    header, *rows = record.read_text(encoding="utf-8").splitlines()[1:]
    assert header == "time_s,speed_m_s"
    time, speed = np.array([row.split(",") for row in rows], dtype=float).T
    np.testing.assert_array_equal(time, np.arange(301.0))
    # von Karman, L/V = 5/1.4 s, s = 0.14 m/s, in steps of 1/300 Hz up to 0.4 Hz: over one period
    # the sum of the waves' variances is exact, up to the record's four decimals
    frequency = np.arange(1, 121) / 300.0
    density = 4 * 0.14**2 * (5 / 1.4) / (1 + 70.8 * (frequency * 5 / 1.4) ** 2) ** (5 / 6)
    assert np.mean(speed[:-1]) == pytest.approx(1.4, abs=1e-4)
    assert np.var(speed[:-1]) == pytest.approx(np.sum(density) / 300.0, rel=0.01)
    flow = load_case(path).inflow
    assert flow.length == 300.0
    assert not any("spike" in line or "gap" in line for line in flow.messages)
    _, again = write_new_case(tmp_path / "again", "river")
    assert again.read_bytes() == record.read_bytes()


def test_new_case_replaces_nothing_unless_forced(tmp_path, capsys):
    sample, command = tmp_path / "mine_record.csv", ["new", str(tmp_path / "mine"), "--kind"]
    sample.write_text("mine", encoding="utf-8")
    assert main([*command, "river"]) == 2
    assert "mine_record.csv: is there already; give --force" in capsys.readouterr().err
    assert sample.read_text(encoding="utf-8") == "mine"
    assert not (tmp_path / "mine.yaml").exists()
    assert main([*command, "river", "--force"]) == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / "mine.yaml"), str(sample)]
