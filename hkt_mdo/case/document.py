"""The case schema for its readers: a JSON schema for editors, a page, and a commented new case.

All three are made of the attribute docstrings of the sections, so that nothing is said twice.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import yaml

from hkt_mdo.case.kinds import Extension, known_kinds
from hkt_mdo.case.schema import case_class
from hkt_mdo.files.cases import shipped_cases
from hkt_mdo.files.shipped import POLAR_FAMILIES, shipped_names, shipped_rotor
from hkt_mdo.files.table import read_text
from hkt_mdo.files.yaml_text import Dumper, parse

_COMMENT_WIDTH = 88
_EXACT_INTEGERS = 1e7


# For editors --------------------------------------------------------------------------------------


def case_json_schema(extensions: Iterable[Extension] = ()) -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a case file, as editors show and check it.

    Descriptions are the attribute docstrings, one line a paragraph; a physical quantity has its
    ``unit``, which its title shows; a section that a tag chooses requires the tag and has it as its
    title. `extensions` are those of `hkt_mdo.case.load_case`.
    """
    schema = case_class(known_kinds(extensions)).model_json_schema()
    for section in _sections(schema):
        for key, value in section["properties"].items():
            if unit := unit_of(value):
                value["title"] = f"{key} [{unit}]"
            if "const" in value:
                section["required"] = [key, *section.get("required", ())]
                section["title"] = f"{key}: {value['const']}"
        for described in (section, *section["properties"].values()):
            if "description" in described:
                described["description"] = _unwrap(described["description"])
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _sections(value: Any) -> Iterator[dict[str, Any]]:
    """Yield every schema within a schema that has properties."""
    if isinstance(value, dict):
        if "properties" in value and value.get("type") == "object":
            yield value
        value = list(value.values())
    if isinstance(value, list):
        for item in value:
            yield from _sections(item)


def _unwrap(docstring: str) -> str:
    """Return a docstring with each paragraph on one line: editors keep the line ends they get."""
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in docstring.split("\n\n"))


def unit_of(value: Any) -> str:
    """Return the first unit anywhere in the schema of a value; empty where there is none."""
    if isinstance(value, dict):
        return value.get("unit") or next(filter(None, map(unit_of, value.values())), "")
    return next(filter(None, map(unit_of, value)), "") if isinstance(value, list) else ""


# As a page ----------------------------------------------------------------------------------------

_PREFACE = """\
# The case file

<!-- Made by hkt schema --markdown > docs/cases.md: change the docstrings, not this page. -->

A case is one experiment: a turbine in a flow under a control law, and how it is optimized. It is a
YAML file of the sections below. Only `inflow` and `control` must be given, so this is a whole case:

```yaml
inflow: {profile: sine}
control: {law: quadratic, torque_limit: 700}
```

`hkt new NAME` writes a commented case to begin from; `hkt schema --markdown` prints this page.

- **YAML.** Plain YAML 1.2 in UTF-8, up to 1 MiB: `yes`, `on` and `2024-05-01` are texts, `1e-4` is
  a number. Refused are anchors, aliases and tags, unknown keys, and keys that are given twice.
- **Units.** A number is in the unit that its key has below. A text of a number and another unit of
  that kind is converted: `1400 mm`, `150 cm/s`, `0.7 kN*m`, `1.025 g/cm**3`, `0.1 rad`. Units are
  spelled as OpenMDAO spells them. A key without a unit takes a plain number.
- **null.** Where a key says "or null", null is a value, and the text says what it means. A section
  that is not needed is left out; it cannot be null.
- **Paths.** A relative path counts from the folder of the case file, also in `--set`. A shipped
  name goes before a file of that name.
- **Overrides.** `hkt run CASE --set rotor.radius=2 --set "inflow.mean=150 cm/s"`. What stands after
  the first `=` is YAML, so that a section can be replaced as a whole, such as
  `--set "control={law: linear}"`. An entry of a list cannot be overridden alone.

## In an editor

`hkt schema` prints the same as a JSON schema. Editors with yaml-language-server (VS Code with the
YAML extension, Neovim, Emacs, Helix and others) then complete keys and choices, show these texts,
and mark unknown keys, wrong types and values out of range. Write the schema once,

```
hkt schema > case.schema.json
```

and name it in the first line of a case, its path counted from the folder of the case:

```yaml
# yaml-language-server: $schema=case.schema.json
```

The schema sees each value by itself, and not whether files exist or values fit together: reading
the case checks that as well.
"""


def case_markdown(extensions: Iterable[Extension] = ()) -> str:
    """Return the whole schema as one page in Markdown.

    It has a preface, every section with every key, the shipped names, and, in a checkout, the case
    files of its folder ``cases`` and of the folders in it. `extensions` are those of
    `hkt_mdo.case.load_case`.
    """
    schema = case_json_schema(extensions)
    definitions = schema["$defs"]
    contents, blocks = ["## Sections", ""], []
    for key, value in schema["properties"].items():
        members = _members(value, definitions)
        if members:
            needed = ", required" if key in schema["required"] else ""
            contents.append(f"- [`{key}`](#{key}){needed}: {_first(value['description'])}")
            blocks += [f"## {key}", value["description"]]
            for section in members:
                blocks += [f"### `{section['title']}`", section["description"]]
                blocks += _keys(key, section, definitions)
        elif "$ref" in value:
            section = _resolve(value, definitions)
            contents.append(f"- [`{key}`](#{key}): {_first(section['description'])}")
            blocks += [f"## {key}", section["description"], *_keys(key, section, definitions)]
        else:
            contents.append(_bullet(key, value))
    parts = (_PREFACE.rstrip(), "\n".join(contents), *blocks, *_shipped(), *_cases())
    return "\n\n".join(parts) + "\n"


def _resolve(value: Mapping[str, Any], definitions: Mapping[str, Any]) -> dict[str, Any]:
    """Return the section that a reference names."""
    section: dict[str, Any] = definitions[value["$ref"].rpartition("/")[2]]
    return section


def _members(value: Mapping[str, Any], definitions: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the sections that a tag chooses from; a schema may take their bare names as well."""
    return [_resolve(member, definitions) for member in value.get("oneOf", ()) if "$ref" in member]


def _keys(path: str, section: dict[str, Any], definitions: Mapping[str, Any]) -> Iterator[str]:
    """Yield the list of a section's keys, then the entries of those keys that list sections."""
    free = {key: value for key, value in section["properties"].items() if "const" not in value}
    required = section.get("required", ())
    for value in free.values():
        if "anyOf" in value:  # a limit: its bound, or a section
            value["anyOf"] = [
                _resolve(option, definitions) if "$ref" in option else option
                for option in value["anyOf"]
            ]
    if free:
        yield "\n".join(_bullet(key, value, key in required) for key, value in free.items())
    for key, value in free.items():
        if "$ref" in value.get("items", {}):
            entry = _resolve(value["items"], definitions)
            yield f"### An entry of `{path}.{key}`"
            yield entry["description"]
            yield from _keys(f"{path}.{key}", entry, definitions)


def _bullet(key: str, value: dict[str, Any], required: bool = False) -> str:
    default = "Required" if required else f"Default: `{_yaml(value.get('default'))}`"
    text = value.get("description", "").replace("\n\n", "\n\n  ")
    kind = _kind(value)
    return f"- **`{key}`**: {kind}. {default}.\n  {text}"


def _kind(value: dict[str, Any]) -> str:
    """Return in words what values a key takes: type, unit, range, choices."""
    if "anyOf" in value:
        return "; or ".join(_kind(option) for option in value["anyOf"])
    if "enum" in value:
        names = [str(choice) for choice in value["enum"]]
        # the same in small letters is allowed, and goes without saying
        names = [name for name in names if not (name.islower() and name.upper() in names)]
        return f"one of {_code(names)}"
    if value["type"] == "array":
        return _list_kind(value)
    if value["type"] == "object":
        return f"section of {_code(value['properties'])}"
    unit = f" in {value['unit']}" if "unit" in value else ""
    words = {"null": "null", "string": "text", "integer": "whole number"}
    kind = f"number{unit}" if "number" in value["type"] else words[value["type"]]
    return ", ".join(filter(None, (kind, _range(value))))


def _list_kind(value: dict[str, Any]) -> str:
    if "prefixItems" in value:
        kinds = [_kind(item) for item in value["prefixItems"]]
        if len(set(kinds)) == 1:
            return f"list of {len(kinds)}, each a {kinds[0]}"
        return f"list of {len(kinds)}: {'; '.join(f'a {kind}' for kind in kinds)}"
    least, most = value.get("minItems", 0), value.get("maxItems")
    count = f"{least} to {most}" if least and most else f"up to {most}" if most else "any length"
    items = value["items"]
    if "discriminator" in items:
        return f"list of {count} sections, each with its `{items['discriminator']['propertyName']}`"
    if "$ref" in items:
        return f"list of {count} entries"
    return f"list of {count}, each a {_kind(items)}"


def _range(value: dict[str, Any]) -> str:
    low, above = value.get("minimum"), value.get("exclusiveMinimum")
    high, below = value.get("maximum"), value.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f"{_number(low)} to {_number(high)}"
    bounds = {"at least": low, "greater than": above, "at most": high, "less than": below}
    given = [f"{words} {_number(bound)}" for words, bound in bounds.items() if bound is not None]
    return " and ".join(given)


def _number(value: float) -> str:
    exact = value == int(value) and abs(value) < _EXACT_INTEGERS
    return str(int(value)) if exact else f"{value:g}"


def _yaml(value: object) -> str:
    """Return a value as a case has it, on one line."""
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, list):
        return f"[{', '.join(map(_yaml, value))}]"
    text: str = yaml.dump([value], Dumper=Dumper, default_flow_style=True, width=10_000)
    return text.strip()[1:-1]


def _first(text: str) -> str:
    return text.partition("\n\n")[0]


def _table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(str, cells))} |" for cells in lines)


def _code(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _shipped() -> Iterator[str]:
    """Yield what the page says about the names that need no file."""
    yield "## Shipped names"
    yield (
        "`rotor.blade`: a shipped blade fills in these keys of `rotor` where they are not given. "
        "Sources are in [hkt_mdo/files/data/README.md](../hkt_mdo/files/data/README.md)."
    )
    names = shipped_names("blade")
    brought = {name: shipped_rotor(name) for name in names}
    keys = list(dict.fromkeys(key for own in brought.values() for key in own))
    rows = (
        [f"`{name}`", *(_yaml(_plain(own[key])) if key in own else "" for key in keys)]
        for name, own in brought.items()
    )
    yield _table(["`blade`", *(f"`{key}`" for key in keys)], rows)
    yield (
        "`rotor.polar`: the name of a section stands for its polars at several Reynolds numbers, "
        "as `rotor.reynolds: local` needs them."
    )
    alone = [n for n in shipped_names("polar") if not any(n in p for p in POLAR_FAMILIES.values())]
    families = [(f"`{name}`", _code(polars)) for name, polars in POLAR_FAMILIES.items()]
    yield _table(["section", "its polars"], [*families, *((f"`{n}`", "all angles") for n in alone)])
    yield f"`rotor.outline`: {_code(shipped_names('outline'))}."


def _plain(value: object) -> object:
    """Return tuples as lists."""
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _cases() -> Iterator[str]:
    """Yield the table of the shipped case files, where they are there."""
    folder = shipped_cases()
    files = [*sorted(folder.glob("*.yaml")), *sorted(folder.glob("*/*.yaml"))]
    if not files:
        return
    yield "## Shipped cases"
    rows = []
    for file in files:
        text = read_text(file, "case file in YAML")
        data = parse(text, str(file))
        remarks = (line.lstrip("# ") for line in text.splitlines() if line.startswith("#"))
        first = next((line for line in remarks if not line.startswith("yaml-language-server")), "")
        rows.append(
            (
                f"[{file.stem}](../cases/{file.relative_to(folder).as_posix()})",
                data["inflow"]["profile"],
                data["control"]["law"],
                first.replace("|", "\\|"),
            )
        )
    yield _table(["case", "`inflow.profile`", "`control.law`", "what"], rows)


# As a case to begin from --------------------------------------------------------------------------


def commented_case(
    values: Mapping[str, Mapping[str, Any]], usual: Mapping[str, Sequence[str]]
) -> str:
    """Return a case in YAML that explains itself: each key below its docstring, type and range.

    `values` is what differs from the defaults, by section and key, with the tags of `inflow` and
    `control`; `usual` names the keys of each section that are shown, in this order, one with a
    default among them; of a section that it does not name, all are. A key that has neither a value
    nor a default stands as a comment.
    """
    schema = case_json_schema()
    blocks = []
    for name, part in schema["properties"].items():
        given, first, about = values.get(name, {}), [], part.get("description", "")
        if "oneOf" in part:
            tag = part["discriminator"]["propertyName"]
            members = _members(part, schema["$defs"])
            sections = {member["properties"][tag]["const"]: member for member in members}
            chosen = (part.get("default", {}) | given)[tag]
            section, about = sections[chosen], f"{about} Choices: {', '.join(sections)}."
            first = [f"{_comment(section['description'], '  ')}\n  {tag}: {chosen}"]
        elif "$ref" in part:
            section = _resolve(part, schema["$defs"])
            about = section["description"]
        else:
            continue  # the name is the file's
        keys = {key: value for key, value in section["properties"].items() if "const" not in value}
        wanted = dict.fromkeys((*usual.get(name, keys), *given))
        lines = [*first, *(_commented(key, keys[key], given) for key in wanted if key in keys)]
        if lines:
            blocks.append("\n".join((_comment(about), f"{name}:", "\n\n".join(lines), "")))
    return "\n\n".join(blocks)


def _commented(key: str, value: dict[str, Any], given: Mapping[str, Any]) -> str:
    """Return a key with its value or default, below its docstring; a comment if it has neither."""
    default = value.get("default")
    mark = "" if key in given or default not in (None, []) else "# "
    kind = _kind(value).replace("`", "")
    remark = "" if kind.startswith("text") else f"  # {kind}"
    about = _comment(value["description"], "  ")
    return f"{about}\n  {mark}{key}: {_yaml(given.get(key, default))}{remark}"


def _comment(text: str, indent: str = "") -> str:
    """Return a text of paragraphs as a comment."""
    mark = f"{indent}# "
    return "\n".join(
        textwrap.fill(
            paragraph,
            _COMMENT_WIDTH,
            initial_indent=mark,
            subsequent_indent=mark,
            break_long_words=False,
            break_on_hyphens=False,
        )
        for paragraph in text.split("\n\n")
    )
