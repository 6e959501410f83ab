"""JSON schema, reference page and commented case, made of the docstrings of a case's keys."""

import textwrap
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from hkt_mdo.case.kinds import Extension, known_kinds
from hkt_mdo.case.schema import case_class
from hkt_mdo.files.shipped import MATERIALS, POLAR_FAMILIES, shipped_names, shipped_rotor
from hkt_mdo.files.template import templates
from hkt_mdo.files.yaml_text import dump
from hkt_mdo.sections import BOUNDS, Quantity, parts_of


def case_json_schema(extensions: Iterable[Extension] = ()) -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a case file, as editors show and check it.

    Descriptions are the attribute docstrings, one line a paragraph; a physical quantity has its
    ``unit``, which its title shows; a section that a tag chooses requires the tag and has it as its
    title. `extensions` are those of `hkt_mdo.case.load_case`.
    """
    schema = case_class(known_kinds(extensions)).model_json_schema()
    for whole in (schema, *schema["$defs"].values()):
        section = whole.get("anyOf", [whole])[-1]  # a limit may be its bound alone
        for key, value in section["properties"].items():
            if "const" in value:
                section["required"] = [key, *section.get("required", ())]
                section["title"] = f"{key}: {value['const']}"
        for described in (section, *section["properties"].values()):
            if "description" in described:  # a paragraph on one line: editors keep line ends
                paragraphs = described["description"].split("\n\n")
                described["description"] = "\n\n".join(" ".join(p.split()) for p in paragraphs)
    schema["required"].remove("inflow")  # a scenario may have it
    schema["anyOf"] = [{"required": [key]} for key in ("inflow", "resource", "scenarios")]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def quantities(key: str, extensions: Iterable[Extension] = (), case: Any = None) -> Iterator[Any]:
    """Yield the quantities that a key may be, by its dotted name, first those of a `case`."""
    parts: list[Any] = [case_class(known_kinds(extensions))]
    for name in (*key.split("."), "bound"):  # a limit may be its bound alone
        parts.sort(key=lambda part: part is not type(case))
        tables = [part.model_fields.items() for part in parts if not isinstance(part, Quantity)]
        fields = [field for table in tables for key, field in table if name == (field.alias or key)]
        parts = [part for part in parts if isinstance(part, Quantity)]
        parts += [part for field in fields for part in parts_of(field.rebuild_annotation())]
        case = getattr(case, name, None)
    return (part for part in parts if isinstance(part, Quantity))


def _chapters(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Yield each key of a case, its schema without references, and the sections by their tag."""
    for key, value in _inlined(schema["properties"], schema["$defs"]).items():
        whole = value.get("anyOf", [value])[-1]  # a section may be a name alone
        value = whole if "properties" in whole else value
        sections = {"": value} if "properties" in value else {}
        for section in value.get("oneOf", ()):
            if "properties" in section:  # not a bare name
                sections[section["title"].partition(": ")[2]] = section
        yield key, value, sections


def _inlined(value: Any, sections: Mapping[str, Any]) -> Any:
    """Return a schema with sections in place of references, and without the constants of tags."""
    if isinstance(value, list):
        return [_inlined(item, sections) for item in value]
    if not isinstance(value, dict):
        return value
    if "$ref" in value:
        value = sections[value["$ref"].rpartition("/")[2]] | value
    return {
        key: _inlined(item, sections)
        for key, item in value.items()
        if key != "$ref" and not (isinstance(item, dict) and "const" in item)
    }


def case_markdown(extensions: Iterable[Extension] = ()) -> str:
    """Return the whole schema as one page in Markdown, by the template ``page.md``.

    It has a preface, every section with every key, and the shipped names. `extensions` are those of
    `hkt_mdo.case.load_case`.
    """
    schema = case_json_schema(extensions)
    filters: dict[str, Any] = {"kind": _kind, "yaml": _yaml, "code": _code}
    filters |= {"inner": _inner_sections, "apart": _without_repeated_keys}
    page = templates(Path(__file__).parent, **filters).get_template("page.md")
    brought = {name: shipped_rotor(name) for name in shipped_names("blade")}
    grouped = {name for polars in POLAR_FAMILIES.values() for name in polars}
    text = page.render(
        chapters=list(_chapters(schema)),
        case_keys=schema["properties"],
        blades=brought,
        blade_keys=dict.fromkeys(key for keys in brought.values() for key in keys),
        families=POLAR_FAMILIES,
        single_polars=[name for name in shipped_names("polar") if name not in grouped],
        outlines=shipped_names("outline"),
        materials=MATERIALS,
    )
    return str(text)


def _without_repeated_keys(
    sections: Mapping[str, Any],
) -> Iterator[tuple[str, dict[str, Any], dict[str, list[str]]]]:
    """Yield the sections of a chapter by their tags, without keys that an earlier one has alike.

    The third value has the names of these keys, by the title of the section that has them.
    """
    firsts: dict[tuple[str, str], str] = {}  # the first section that has a key with these words
    for tag, section in sections.items():
        again: dict[str, list[str]] = {}
        properties, title = {}, section.get("title", "")
        for key, value in section["properties"].items():
            first = firsts.setdefault((key, str(value)), title)
            if first == title:
                properties[key] = value
            else:
                again.setdefault(first, []).append(key)
        yield tag, section | {"properties": properties}, again


def _inner_sections(value: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """Return the sections that the value of a key is or has as entries, with words for these.

    A section whose only key is its bound is described with the key.
    """
    inner = [("An entry of ", value.get("items", {}))]
    inner += [("", x) for way in value.get("anyOf", [value]) for x in way.get("anyOf", [way])]
    return [(words, part) for words, part in inner if part.get("properties", {}).keys() - {"bound"}]


def _kind(value: Mapping[str, Any]) -> str:
    """Return in words what values a key takes: type, unit, range, choices."""
    if "anyOf" in value:
        return "; or ".join(_kind(option) for option in value["anyOf"])
    if "discriminator" in value:
        return f"section with its `{value['discriminator']['propertyName']}`"
    if "enum" in value:
        names = [str(choice) for choice in value["enum"]]
        # small letters are allowed too, which needs no mention
        names = [name for name in names if not (name.islower() and name.upper() in names)]
        return f"one of {_code(names)}"
    if value["type"] == "array":
        kinds = dict.fromkeys(map(_kind, value.get("prefixItems") or [value["items"]]))
        ends = dict.fromkeys((value.get("minItems", 0), value.get("maxItems", "any number")))
        length = " to ".join(map(str, ends)).replace("0 to any number", "any length")
        return f"list of {length}: {'; '.join(kinds)}"
    if value["type"] == "object":
        return f"section of {_code(value['properties'])}"
    unit = f" in {value['unit']}" if "unit" in value else ""
    words = {
        "null": "null",
        "string": "text",
        "integer": "whole number",
        "boolean": "true or false",
    }
    kind = f"number{unit}" if "number" in value["type"] else words[value["type"]]
    bounds = [f"{words} {_yaml(value[key])}" for _, _, words, key in BOUNDS if key in value]
    return ", ".join(filter(None, (kind, " and ".join(bounds))))


def _yaml(value: object) -> str:
    """Return a value as a case has it, on one line."""
    if isinstance(value, float):
        return f"{value:.7g}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_yaml, value))}]"
    if isinstance(value, dict):
        value = {key: item for key, item in value.items() if item is not None}
    return dump([value], width=float("inf"), default_flow_style=True).strip()[1:-1]


def _code(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def commented_case(values: Mapping[str, Mapping[str, Any]], usual: Collection[str]) -> str:
    """Return a case in YAML with comments: each key below its docstring, type and range.

    `values` is what differs from the defaults, by section and key, with the tags of `inflow` and
    `control`; besides them the keys that `usual` names are shown, in this order. A key that has
    neither a value nor a default stands as a comment.
    """
    blocks = []
    for name, part, sections in _chapters(case_json_schema()):
        entries, lines, text = values.get(name, {}), [], part.get("description", "")
        section = sections.get("", {"properties": {}})
        if "oneOf" in part:
            tag = part["discriminator"]["propertyName"]
            chosen = (part.get("default", {}) | entries)[tag]
            section, text = sections[chosen], f"{text} Choices: {', '.join(sections)}."
            lines = [f"{_comment(section['description'], '  ')}\n  {tag}: {chosen}"]
        for key in dict.fromkeys((*usual, *entries)):
            if key in section["properties"]:
                lines.append(_commented(key, section["properties"][key], entries))
        if lines:
            # a section without a key would be null
            empty = all(line.splitlines()[-1].lstrip().startswith("#") for line in lines)
            title = f"# {name}:" if empty else f"{name}:"
            blocks.append("\n".join((_comment(text), title, "\n\n".join(lines), "")))
    return "\n\n".join(blocks)


def _commented(key: str, value: Mapping[str, Any], entries: Mapping[str, Any]) -> str:
    """Return a key with its value or default, below its docstring; a comment if it has neither."""
    default = value.get("default")
    mark = "" if key in entries or default not in (None, []) else "# "
    kind = _kind(value).replace("`", "")
    remark = "" if kind.startswith("text") else f"  # {kind}"
    text = value["description"]
    if len(remark) > 100:  # too long for the key's line
        text, remark = f"{text}\n\n{kind[0].upper()}{kind[1:]}.", ""
    text = _comment(text, "  ")
    return f"{text}\n  {mark}{key}: {_yaml(entries.get(key, default))}{remark}"


def _comment(text: str, indent: str = "") -> str:
    """Return a text of paragraphs as a comment."""
    mark = f"{indent}# "
    lines = textwrap.TextWrapper(88, mark, mark, break_long_words=False, break_on_hyphens=False)
    return "\n".join(map(lines.fill, text.split("\n\n")))
