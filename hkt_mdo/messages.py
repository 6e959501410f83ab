"""Errors of pydantic in words for the user: the key, the problem and the remedy."""

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from hkt_mdo.errors import InputError, did_you_mean
from hkt_mdo.files.yaml_text import dotted, parse
from hkt_mdo.sections import Section, kind_name, parts_of

_Model = TypeVar("_Model", bound=Section)

_SECTION = (
    "must be a section of keys and values",
    "write keys below it, or leave it out where it has defaults",
)
_PLAIN = {
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), _SECTION),
    "tuple_type": ("must be a list", "write [first, second, ...]"),
    "too_short": ("must have at least {min_length} values, and has {actual_length}", "add some"),
    "too_long": ("must have at most {max_length} values, and has {actual_length}", "remove some"),
    "int_type": ("must be a whole number", "write it without a point, a unit or quotes"),
    "greater_than_equal": ("must be at least {ge}", "give a larger number"),
    "less_than_equal": ("must be at most {le}", "give a smaller number"),
    "string_type": ("must be a text", "write it in quotes if it looks like a number"),
}
"""Problem and remedy by pydantic's type of error, with places for its context."""


def _find(
    location: Iterable[int | str], root: type[Section]
) -> tuple[str, type[Section], list[type[Section]], str]:
    """Return the key where an error lies, whose section has it, the sections it takes, and words.

    Pydantic's location has the tag of a chosen section among the keys; the words, what the key is,
    are the first clause of its documentation. An entry of a list is described with the list.
    """
    path, section, inside, text = [], root, [root], ""
    for part in location:
        if isinstance(part, int):
            path.append(f"[{part}]")
        elif len(inside) > 1:
            inside = [kind for kind in inside if kind_name(kind) == part]
        else:
            path.append(part)
            section = inside[0] if inside else section
            field = section.model_fields.get(part)
            text = section.description(part) if field else ""
            inside = _sections(field) if field else inside
    return dotted(path), section, inside, re.split(r"[.;,](?: |$)", " ".join(text.split()))[0]


def _sections(field: FieldInfo) -> list[type[Section]]:
    """Return the sections that a field takes: several where a tag chooses among them."""
    return [part for part in parts_of(field.annotation) if isinstance(part, type)]


def validated(
    root: type[_Model],
    data: Any,
    file: str,
    overrides: Iterable[str] = (),
    context: Mapping[str, Any] | None = None,
) -> _Model:
    """Return a section made of data; the first error is an `InputError` in words for the user.

    An error in one of the overrides is reported as such.

    Parameters
    ----------
    root : type
        Class of the section.
    data : dict
        What a file, or a user of Python, gives; the overrides change it.
    file : str
        What messages call the text.
    overrides : iterable of str
        As of `assign`.
    context : mapping, optional
        That of pydantic's validators.

    Returns
    -------
    root
        The section.

    Raises
    ------
    InputError
        If anything in the data is wrong.
    """
    applied = {assign(data, override, file, root): override for override in overrides}
    try:
        return root.model_validate(data, context=context)
    except ValidationError as error:
        details = error.errors(include_url=False)
    # a list whose items are refused is not too short as well
    errors = [
        e for e in details if e["type"] != "too_short" or len(e["input"]) < e["ctx"]["min_length"]
    ]
    errors.sort(key=lambda detail: detail["type"] != "extra_forbidden")  # often the cause of others
    (key, problem, remedy, value), *more = (_words(detail, root) for detail in errors)
    if more:
        others = "; ".join(f"{words[0]} {words[1]}" for words in more[:3])
        remedy = f"{remedy} (and {len(more)} more: {others})"
    section = key.rpartition(".")[0]
    if problem == "unknown key" and any(x != key and x.startswith(f"{section}.") for x in applied):
        remedy += f"; an override {section}={{...}} replaces the whole section"
    for overridden, text in reversed(applied.items()):
        if key == overridden or key.startswith((f"{overridden}.", f"{overridden}[")):
            file = f"{file}, override {text if len(text) <= 60 else text[:57] + '...'}"
            break
    raise InputError(problem, remedy, file=file, key=key, **value)


def assign(data: dict[str, Any], override: str, file: str, root: type[Section]) -> str:
    """Apply an override and return its dotted key; a bare name of a kind becomes a section first.

    Parameters
    ----------
    data : dict
        Is changed.
    override : str
        Such as ``rotor.radius=2``; the text after the first ``=`` is YAML.
    file : str
        What messages call the data.
    root : type
        Class of the section.

    Returns
    -------
    str
        The key.

    Raises
    ------
    InputError
        If the override is not valid.
    """
    key, equals, text = override.partition("=")
    key = key.strip()
    if not equals or not text.strip() or not re.fullmatch(r"\w+(\.\w+)*", key, re.ASCII):
        remedy = "write section.key=value, such as rotor.radius=2 (null for none)"
        raise InputError("is not an override", remedy, file=file, key="override", value=override)
    *sections, last = key.split(".")
    for depth, section in enumerate(sections):
        inner = data.setdefault(section, {})
        if isinstance(inner, str) and depth == 0:
            inner = data[section] = root.spelled_out({section: inner})[section]
        if not isinstance(inner, dict):
            problem = f"has no keys, so the override {key} cannot be applied"
            remedy = "override it as a whole, or only keys of sections"
            path = ".".join(sections[: depth + 1])
            raise InputError(problem, remedy, file=file, key=path, value=inner)
        data = inner
    data[last] = parse(text, f"{file}, override {key}", key)
    return key


def _words(error: ErrorDetails, root: type[Section]) -> tuple[str, str, str, dict[str, Any]]:
    """Return key, problem and remedy of an error, and the value as keyword if there is one."""
    (key, section, taken, what), value = _find(error["loc"], root), error["input"]
    context, keyword = error.get("ctx", {}), {"value": value}
    tag = taken[0].named_by if taken else ""
    kinds = [kind_name(kind) for kind in taken] if len(taken) > 1 else []
    problem, remedy = error["msg"], what
    if error["type"] in _PLAIN:
        problem, remedy = (words.format(**context) for words in _PLAIN[error["type"]])
    inside = what[:1].lower() + what[1:]
    match error["type"]:
        case "hkt_mdo":
            problem, remedy = context["problem"], context["remedy"]
            key = dotted(part for part in (key, context.get("key")) if part)
            keyword["value"] = context.get("value", value)
            if "quantity" in context and what:
                remedy = f"give the {inside} as {context['quantity']}"
        case "string_pattern_mismatch" | "string_too_long" | "string_too_short":
            problem, remedy = "cannot be its name", f"give the {inside}"
        case "extra_forbidden":
            problem, remedy = "unknown key", _suggest_key(key, str(error["loc"][-1]), section, root)
            if key.endswith("limits.torque"):  # its name in earlier versions
                problem, remedy = "has another name", "write control.torque_limit"
        case "missing":
            keyword, problem, remedy = {}, "is missing", f"give it: {what}".rstrip(": ")
            if kinds:
                remedy = f"give {key}: {{{tag}: ...}} with one of {', '.join(kinds)}"
            elif isinstance(error["loc"][-1], int):
                remedy = "give two values, [lower, upper]"
        case "union_tag_not_found" | "union_tag_invalid":
            named = value.get(tag) if isinstance(value, dict) else context.get("tag")
            keyword = {} if named is None else {"value": named}
            problem, key = "unknown" if keyword else "is missing", f"{key}.{tag}"
            remedy = _suggest(named, kinds)
        case "literal_error":
            choices = re.split(", | or ", context["expected"].replace("'", ""))
            problem, remedy = "unknown", _suggest(value, choices)
    if problem.startswith("unknown") and (kinds or "limits" in key.split(".")[-2:-1]):
        remedy += "; one of your own needs --extend FILE, in Python extensions=[FILE]"
    return key, problem, remedy, keyword


def _suggest(value: object, choices: Collection[str]) -> str:
    """Return the nearest choice and all of them."""
    guess = did_you_mean(value, choices) if isinstance(value, str) else ""
    return f"{guess}give one of {', '.join(choices)}"


def _suggest_key(path: str, key: str, section: type[Section], root: type[Section]) -> str:
    """Return the nearest key of the section, or the sections that do have the key."""
    keys = [field.alias or name for name, field in section.model_fields.items()]
    elsewhere = dict.fromkeys(
        f"{name}.{key}"
        for name, field in root.model_fields.items()
        for home in _sections(field)
        if key in home.model_fields and f"{name}.{key}" != path
    )
    guess = f"did you mean {' or '.join(elsewhere)}? " if elsewhere else ""
    return f"{did_you_mean(key, keys) or guess}known here: {', '.join(keys) or 'none'}"
