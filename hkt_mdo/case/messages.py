"""pydantic's errors in the user's terms."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, cast, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from hkt_mdo.errors import InputError
from hkt_mdo.files.yaml_text import dotted
from hkt_mdo.sections import Section


@dataclass(frozen=True)
class _Place:
    """Where in the case an error lies: its dotted key, the section it is in, the field if known."""

    key: str
    section: type[BaseModel]
    field: FieldInfo | None


def _find(location: Iterable[int | str], root: type[BaseModel]) -> _Place:
    """Walk down the schema; pydantic's location has the tag of a union among the keys."""
    path: list[str] = []
    section = root
    field: FieldInfo | None = None
    union: dict[str, type[BaseModel]] = {}
    for part in location:
        if isinstance(part, int):
            path.append(f"[{part}]")
            item = _item(field)
            if item is not None:  # of a list of sections; a list of numbers is told by its own key
                union, field = _members(item), item
                section = section if union else cast(type[BaseModel], item.annotation)
        elif union:
            section, union, field = union[part], {}, None
        else:
            path.append(part)
            field = section.model_fields.get(part)
            union = _members(field)
            inner = _section(field)
            if inner is not None and not union:
                section, field = inner, None
    return _Place(dotted(path), section, field)


def _section(field: FieldInfo | None) -> type[BaseModel] | None:
    """Return the section that a field holds, if need be beside None."""
    kinds = (field.annotation, *get_args(field.annotation)) if field else ()
    return next((k for k in kinds if isinstance(k, type) and issubclass(k, Section)), None)


def _members(field: FieldInfo | None) -> dict[str, type[BaseModel]]:
    """Return the sections that a union chooses from, by tag; empty where there is no union."""
    if field is None or not isinstance(field.discriminator, str):
        return {}
    members = get_args(field.annotation)
    return {get_args(m.model_fields[field.discriminator].annotation)[0]: m for m in members}


def _item(field: FieldInfo | None) -> FieldInfo | None:
    """Return what a list holds, if that is sections of one class or of a union."""
    inner = get_args(field.annotation) if field else ()
    item = FieldInfo.from_annotation(inner[0]) if inner and inner[-1] is Ellipsis else None
    kind = item.annotation if item is not None else None
    if isinstance(kind, type) and issubclass(kind, Section):
        return item
    return item if item is not None and _members(item) else None


def translate(
    errors: list[ErrorDetails], root: type[BaseModel], file: str, overrides: dict[str, str]
) -> InputError:
    """Return the first of pydantic's errors in the user's terms.

    Parameters
    ----------
    errors : list of ErrorDetails
    root : type of BaseModel
        What was validated; the places of the errors are found in its schema.
    file : str
        What messages call the text.
    overrides : dict of str to str
        The overrides by their keys: an error in one of them is told as such.
    """
    # a list whose items are refused is not too short as well
    errors = [e for e in errors if e["type"] != "too_short" or len(e["input"]) < _least(e)]
    error = errors[0]
    context = error.get("ctx", {})
    place = _find(error["loc"], root)
    key, value = place.key, error["input"]
    missing = False
    match error["type"]:
        case "hkt_mdo":
            problem, remedy = context["problem"], context["remedy"]
            key = dotted(part for part in (key, context.get("key")) if part)
            value = context.get("value", value)
            if "quantity" in context and place.field and place.field.description:
                what = re.split(r"[.;,]( |\n|$)", place.field.description, maxsplit=1)[0]
                remedy = f"give the {what[0].lower()}{what[1:]} as {context['quantity']}"
        case "extra_forbidden":
            problem, remedy = (
                "unknown key",
                _suggest_key(key, str(error["loc"][-1]), place.section, root),
            )
        case "missing":
            missing, problem = True, "is missing"
            tags = ", ".join(_members(place.field))
            remedy = f"give it: {_first_line(place.field)}"
            if tags:
                remedy = f"give {key}: {{{_discriminator(place.field)}: ...}} with one of {tags}"
            elif isinstance(error["loc"][-1], int):
                remedy = "give two values, [lower, upper]"
        case "union_tag_not_found":
            tags = ", ".join(_members(place.field))
            missing, problem, remedy = True, "is missing", f"give one of {tags}"
            key = f"{key}.{_discriminator(place.field)}"
        case "union_tag_invalid":
            key = f"{key}.{_discriminator(place.field)}"
            value = cast(dict[str, Any], value).get(_discriminator(place.field))
            problem, remedy = "unknown", _suggest(value, tuple(_members(place.field)))
        case "literal_error":
            choices = _choices(place.field.annotation) if place.field else ()
            problem, remedy = "unknown", _suggest(value, choices)
        case "model_type" | "model_attributes_type" | "dict_type":
            problem = "must be a section of keys and values"
            remedy = "write keys below it, or leave it out where it has defaults"
        case "tuple_type":
            problem, remedy = "must be a list", "write [first, second, ...]"
        case "too_short" | "too_long":
            limit = context.get("min_length", context.get("max_length"))
            words = "at least" if error["type"] == "too_short" else "at most"
            problem = f"must have {words} {limit} values, and has {context['actual_length']}"
            remedy = "add some" if error["type"] == "too_short" else "take some out"
        case "int_type":
            problem, remedy = "must be a whole number", "write it without a point, a unit or quotes"
        case "greater_than_equal":
            problem, remedy = f"must be at least {context['ge']}", "give a larger number"
        case "less_than_equal":
            problem, remedy = f"must be at most {context['le']}", "give a smaller number"
        case "string_type":
            problem, remedy = "must be a text", "write it in quotes if it looks like a number"
        case "string_pattern_mismatch" | "string_too_long" | "string_too_short":
            problem = "must be up to 100 letters, digits, _ - . and begin with none of - ."
            remedy = "give such a name, or none: the case is then named after its file"
        case _:
            problem, remedy = error["msg"], _first_line(place.field)
    if len(errors) > 1:
        remedy = f"{remedy} (and {len(errors) - 1} more)"
    for overridden, text in overrides.items():
        if key == overridden or key.startswith((f"{overridden}.", f"{overridden}[")):
            file = f"{file}, override {text if len(text) <= 60 else text[:57] + '...'}"
            break
    if missing:
        return InputError(problem, remedy, file=file, key=key)
    return InputError(problem, remedy, file=file, key=key, value=value)


def _least(error: ErrorDetails) -> int:
    return cast(int, error["ctx"]["min_length"])


def _discriminator(field: FieldInfo | None) -> str:
    return str(field.discriminator) if field else ""


def _first_line(field: FieldInfo | None) -> str:
    return (field.description or "").partition("\n")[0] if field else ""


def _choices(annotation: Any) -> tuple[Any, ...]:
    """Return the texts that a Literal allows, also one beside None."""
    inner = get_args(annotation)
    return inner if type(None) not in inner else _choices(inner[0])


def _suggest(value: object, choices: Sequence[object]) -> str:
    words = [str(choice) for choice in choices]
    near = difflib.get_close_matches(value[:60], words, n=1) if isinstance(value, str) else []
    return f"{f'did you mean {near[0]}? ' if near else ''}give one of {', '.join(words)}"


def _suggest_key(place: str, key: str, section: type[BaseModel], root: type[BaseModel]) -> str:
    """Return the nearest key of the section, or the sections that do have the key."""
    known = list(section.model_fields)
    near = difflib.get_close_matches(key[:60], known, n=1)
    homes = [f"{name}.{key}" for name, field in root.model_fields.items() if key in _keys(field)]
    homes = [home for home in homes if home != place]
    guess = f"did you mean {' or '.join(near or homes)}? " if near or homes else ""
    return f"{guess}known here: {', '.join(known)}"


def _keys(field: FieldInfo) -> set[str]:
    """Return the keys of a section, or of all that a union chooses from."""
    members: list[Any] = list(_members(field).values()) or [field.annotation]
    return {key for member in members for key in getattr(member, "model_fields", ())}
