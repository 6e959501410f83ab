"""YAML as a case file may use it: plain, of limited depth, with the words of YAML 1.2."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, ClassVar, cast

import yaml

from hkt_mdo.errors import InputError

MAX_DEPTH = 20
"""Deepest nesting of a file."""

_FLOAT = r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]+)?"


class Loader(yaml.SafeLoader):
    """Plain YAML: no anchors, aliases or tags, limited depth, and the words of YAML 1.2.

    1e-4 is a number; yes, no, on, off, 010, 1:30 and 2020-01-01 are texts.
    """

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}  # type: ignore[misc]
    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a node of limited depth, without anchor, alias or tag."""
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            self._refuse("anchors (&) and aliases (*) are refused: write the value out", event)
        if getattr(event, "tag", None) is not None:
            self._refuse("tags (!) are refused: write the plain value", event)
        self.depth += 1
        if self.depth > MAX_DEPTH:
            self._refuse(f"nested deeper than {MAX_DEPTH} levels", event)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    @staticmethod
    def _refuse(problem: str, event: yaml.Event) -> None:
        raise yaml.MarkedYAMLError(problem=problem, problem_mark=cast(yaml.Mark, event.start_mark))


_BOOL = re.compile("true|True|TRUE|false|False|FALSE")
_NULL = re.compile("~|null|Null|NULL|")
_INT = re.compile("[-+]?(0|[1-9][0-9]*)")
_REAL = re.compile(rf"{_FLOAT}|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS = (("bool", _BOOL), ("null", _NULL), ("int", _INT), ("float", _REAL))


class Dumper(yaml.SafeDumper):
    """Lists on one line; quotes round a text that YAML 1.1 or 1.2 would take for another type."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write everything out."""
        return True

    def represent_flow_list(self, data: list[Any]) -> yaml.Node:
        """Write a list on one line."""
        return self.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=True)


Dumper.add_representer(list, Dumper.represent_flow_list)
for _word, _pattern in _WORDS:
    _whole = re.compile(rf"^(?:{_pattern.pattern})\Z")
    for _class in (Loader, Dumper):
        _class.add_implicit_resolver(f"tag:yaml.org,2002:{_word}", _whole, None)


def parse(text: str, file: str, key: str = "") -> Any:
    """Return what a YAML text holds in dict (with text keys), list, str, float, int, bool, None."""
    try:
        loader = Loader(text)
        try:
            node = loader.get_single_node()
        finally:
            loader.dispose()
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
        place = f"line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise InputError(
            f"cannot be read as YAML: {problem}", "mend it there", file=file, key=place or key
        ) from None
    return None if node is None else _plain(node, file, (key,) if key else ())


def _plain(node: yaml.Node, file: str, path: tuple[str, ...]) -> Any:
    """Return a node of YAML as Python's own types."""
    if isinstance(node, yaml.MappingNode):
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            line = f"line {key_node.start_mark.line + 1}"
            if not (isinstance(key_node, yaml.ScalarNode) and key_node.tag.endswith(":str")):
                raise InputError(
                    f"has a key that is not a word ({line})",
                    "write a word",
                    file=file,
                    key=dotted(path),
                )
            key = _scalar(key_node, file, path)
            if key in data:
                raise InputError(
                    f"is given twice (again in {line})",
                    "keep one of them",
                    file=file,
                    key=dotted((*path, key)),
                    value=_plain(value_node, file, (*path, key)),
                )
            data[key] = _plain(value_node, file, (*path, key))
        return data
    if isinstance(node, yaml.SequenceNode):
        return [_plain(item, file, (*path, f"[{i}]")) for i, item in enumerate(node.value)]
    return _scalar(cast(yaml.ScalarNode, node), file, path)


def _scalar(node: yaml.ScalarNode, file: str, path: tuple[str, ...]) -> Any:
    text: str = node.value
    match node.tag.rpartition(":")[2]:
        case "null":
            return None
        case "bool":
            return text.lower() == "true"
        case "int":
            # no key takes numbers as large as the ones that are left to float, which is quick
            return int(text) if len(text) < 19 else float(text)
        case "float":
            return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(
            "holds half a character",
            "write the text without \\u escapes",
            file=file,
            key=dotted(path),
        ) from None
    return text


def dotted(path: Iterable[str]) -> str:
    """Return the dotted form of a path, such as rotor.stations[2], with overlong keys cut."""
    text = ""
    for part in path:
        part = part if len(part) <= 60 else f"{part[:57]}..."
        text += part if part.startswith("[") or not text else f".{part}"
    return text
