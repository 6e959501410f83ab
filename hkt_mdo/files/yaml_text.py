"""The one reader of YAML: plain, of limited depth and size, with the words of YAML 1.2."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sized
from dataclasses import dataclass
from functools import reduce
from typing import Any, ClassVar

import numpy as np
import yaml

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Column, fortran_number

__all__ = ["Dumper", "Place", "compose", "dotted", "parse"]

CASE_DEPTH, DEPTH = 20, 40
"""Deepest nesting of a case file and of other files."""

MAX_NODES = 1_000_000
"""Most values in a file; reference turbines have fifty thousand."""

_FLOAT = r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
_WORDS = {
    "bool": re.compile("true|True|TRUE|false|False|FALSE"),
    "null": re.compile("~|null|Null|NULL|"),
    "int": re.compile("[-+]?(0|[1-9][0-9]*)"),
    "float": re.compile(rf"{_FLOAT}|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"),
}


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
    """libyaml, which is ten times as quick, without YAML 1.1's words: `word` knows those of 1.2."""

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}


class Dumper(yaml.SafeDumper):
    """Lists on one line; quotes round a text that YAML 1.1 or 1.2 would take for another type."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_flow_list(self, data: list[Any]) -> yaml.Node:
        """Write a list on one line."""
        return self.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=True)


Dumper.add_representer(list, Dumper.represent_flow_list)
for _word, _pattern in _WORDS.items():
    _whole = re.compile(rf"^(?:{_pattern.pattern})\Z")
    Dumper.add_implicit_resolver(f"tag:yaml.org,2002:{_word}", _whole, None)


@dataclass(frozen=True)
class Place:
    """A value in a YAML file with its dotted key."""

    node: yaml.Node
    key: str
    file: object

    @property
    def shown(self) -> str:
        """What a message calls the place."""
        return f"{self.key} (line {self.node.start_mark.line + 1})"

    def refuse(self, problem: str, remedy: str) -> InputError:
        value = {"value": self.node.value} if isinstance(self.node, yaml.ScalarNode) else {}
        return InputError(problem, remedy, file=self.file, key=self.shown, **value)

    def below(self, node: yaml.Node, name: str) -> Place:
        return Place(node, joined(self.key, name), self.file)

    def _expect(self, kind: type, what: str) -> None:
        if not isinstance(self.node, kind):
            raise self.refuse(f"must be {what}", "see the schema of such files")

    def find(self, path: str, remedy: str = "") -> Place | None:
        """Return what a dotted key below this place names; None, or refused with the remedy."""
        here = self
        for name in path.split("."):
            here._expect(yaml.MappingNode, "a mapping")
            node = next((node for key, node in here.node.value if key.value == name), None)
            if node is None or (isinstance(node, yaml.ScalarNode) and word(node) == "null"):
                key = here.below(here.node, name).shown
                if remedy:
                    raise InputError("is missing", remedy, file=self.file, key=key)
                return None
            here = here.below(node, name)
        return here

    def get(self, path: str, remedy: str = "add it") -> Place:
        return self.find(path, remedy)  # type: ignore[return-value]

    def items(self) -> list[Place]:
        """Return the members of a list, one at least."""
        self._expect(yaml.SequenceNode, "a list")
        if not self.node.value:
            raise self.refuse("is empty", "give what belongs there")
        return [self.below(node, f"[{index}]") for index, node in enumerate(self.node.value)]

    def text(self) -> str:
        self._expect(yaml.ScalarNode, "a word")
        return self.node.value.strip()

    def number(self, low: float = -np.inf, high: float = np.inf, remedy: str = "") -> float:
        """Return a finite number within (low, high]."""
        self._expect(yaml.ScalarNode, "a number")
        number = None if self.node.style else fortran_number(self.node.value)
        if number is None:
            raise self.refuse("must be a finite number", "write it plainly, without a unit")
        if not low < number <= high:
            raise self.refuse(f"must be above {low:g} and at most {high:g}", remedy)
        return number

    def numbers(self) -> Column:
        return places_column(self.key, self.items())

    def pair(self, *names: str) -> list[Column]:
        """Return two members that are lists of as many numbers."""
        columns = {name: self.get(name).numbers() for name in names}
        self.check_sizes(**{name: column.values for name, column in columns.items()})
        return list(columns.values())

    def check_sizes(self, **lists: Sized) -> None:
        """Refuse two lists of this place that are not as long as each other."""
        (one, first), (other, second) = lists.items()
        if len(first) != len(second):
            problem = f"has {len(first)} values in {one} and {len(second)} in {other}"
            raise self.refuse(problem, "give as many in both")


def places_column(name: str, places: list[Place]) -> Column:
    """Return the numbers at some places of a file."""
    values = np.array([place.number() for place in places])
    shown = [place.node.value for place in places]
    return Column(name, values, [place.shown for place in places], shown, places[0].file)


def compose(text: str, file: object, key: str = "", *, case: bool = False) -> yaml.Node | None:
    """Return the tree of a YAML text; None if it holds nothing.

    An alias is the very node that its anchor names, never a copy, so that no file grows while it is
    read. A `case` is held to stricter rules: no anchors and aliases, keys that are words, 20 levels
    at most. `key` is the place of the whole text, for messages. Raises InputError with the place
    where the text is no YAML, or YAML that is refused: tags, merge keys, a key that is given twice,
    a second document, too many values.
    """
    # PyYAML's own parser, for cases, locates errors more precisely.
    loader = yaml.SafeLoader if case else _Loader
    try:
        _check_events(yaml.parse(text, Loader=loader), file, case)
        root = yaml.compose(text, Loader=loader)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        place = _shown(mark) if mark else key
        if not mark and hasattr(error, "position"):
            place = f"line {text.count(chr(10), 0, error.position) + 1}"
        reason = getattr(error, "problem", None) or getattr(error, "reason", None) or error
        problem = f"cannot be read as YAML: {reason}"
        raise InputError(problem, "mend it there", file=file, key=place) from None
    if root is not None:
        _check_keys(Place(root, key, file), case, set())
    return root


def _check_events(events: Iterable[Any], file: object, case: bool) -> None:
    """Refuse what a tree of nodes would no longer show, or would be too large for."""
    depth = count = documents = 0
    deepest = CASE_DEPTH if case else DEPTH
    for event in events:
        documents += isinstance(event, yaml.DocumentStartEvent)
        count += isinstance(event, yaml.NodeEvent)
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        tag = getattr(event, "tag", None)
        if documents > 1:
            problem, remedy = "begins a second YAML document", "keep one in a file"
        elif depth > deepest:
            problem, remedy = f"is nested deeper than {deepest} levels", "unfold it"
        elif count > MAX_NODES:
            problem, remedy = f"holds more than {MAX_NODES} values", "give a smaller file"
        elif case and getattr(event, "anchor", None) is not None:
            problem, remedy = "anchors (&) and aliases (*) are refused", "write the value out"
        elif tag not in (None, "!"):
            problem = f"tags (!) are refused, here {tag}"
            remedy = "write the plain value; put an included file's content in its place"
        else:
            continue
        raise InputError(problem, remedy, file=file, key=_shown(event.start_mark))


def _shown(mark: yaml.Mark) -> str:
    return f"line {mark.line + 1}, column {mark.column + 1}"


def _check_keys(place: Place, case: bool, seen: set[int]) -> None:
    """Refuse keys that are no words or stand twice in a mapping, each mapping once."""

    def refuse(problem: str, remedy: str, place: Place = place, **value: object) -> InputError:
        return InputError(problem, remedy, file=place.file, key=place.key, **value)

    node = place.node
    if id(node) in seen:
        return
    seen.add(id(node))
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            if case or not isinstance(item, yaml.ScalarNode):  # long lists of numbers hold no keys
                _check_keys(place.below(item, f"[{index}]"), case, seen)
    elif isinstance(node, yaml.MappingNode):
        known = set()
        for key, value in node.value:
            line = f"line {key.start_mark.line + 1}"
            if not isinstance(key, yaml.ScalarNode) or (case and word(key) != "str"):
                raise refuse(f"has a key that is not a word ({line})", "write a word")
            below = place.below(value, key.value)
            if key.value == "<<":
                raise refuse("merge keys (<<) are refused", "write the values out", below)
            if key.value in known:
                # A list may hold itself by aliases: only a scalar is shown.
                shown = {"value": plain(value)} if isinstance(value, yaml.ScalarNode) else {}
                raise refuse(f"is given twice (again in {line})", "keep one", below, **shown)
            known.add(key.value)
            _check_keys(below, case, seen)
    elif re.search("[\ud800-\udfff]", node.value):
        raise refuse("holds half a character", "write the text without \\u escapes")


def word(node: yaml.ScalarNode) -> str:
    """Return what a scalar is by the words of YAML 1.2: bool, null, int, float or str."""
    found = (name for name, pattern in _WORDS.items() if pattern.fullmatch(node.value))
    return "str" if node.style else next(found, "str")


def plain(node: yaml.Node) -> Any:
    """Return the value of a node in dict, list, str, float, int, bool and None."""
    if isinstance(node, yaml.MappingNode):
        return {key.value: plain(value) for key, value in node.value}
    if isinstance(node, yaml.SequenceNode):
        return [plain(item) for item in node.value]
    text: str = node.value
    match word(node):
        case "null":
            return None
        case "bool":
            return text.lower() == "true"
        case "int":
            # Reading thousands of digits as int is slow; no key takes numbers that large.
            return int(text) if len(text) < 19 else float(text)
        case "float":
            return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    return text


def parse(text: str, file: str, key: str = "") -> Any:
    """Return what the YAML text of a case holds in dict, list, str, float, int, bool and None.

    1e-4 is a number; yes, no, on, off, 010, 1:30 and 2020-01-01 are texts. Raises InputError as
    `compose` does.
    """
    node = compose(text, file, key, case=True)
    return None if node is None else plain(node)


def dotted(path: Iterable[str]) -> str:
    """Return the dotted form of a path, such as rotor.stations[2], with overlong keys cut."""
    return reduce(joined, path, "")


def joined(path: str, part: str) -> str:
    """Return a dotted path with one more part, cut if it is overlong."""
    part = part if len(part) <= 60 else f"{part[:57]}..."
    return path + part if part.startswith("[") or not path else f"{path}.{part}"
