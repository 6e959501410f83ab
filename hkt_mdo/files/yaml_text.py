"""The one reader of YAML: plain, of limited depth and size, with the words of YAML 1.2."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Column, fortran_number

__all__ = ["Dumper", "Node", "Place", "compose", "dotted", "parse"]

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
# libyaml is ten times as quick; Python's own parser says more precisely where a case is broken.
_LOADERS = {False: getattr(yaml, "CSafeLoader", yaml.SafeLoader), True: yaml.SafeLoader}


class Dumper(yaml.SafeDumper):
    """Lists on one line; quotes round a text that YAML 1.1 or 1.2 would take for another type."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write everything out."""
        return True

    def represent_flow_list(self, data: list[Any]) -> yaml.Node:
        """Write a list on one line."""
        return self.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=True)


Dumper.add_representer(list, Dumper.represent_flow_list)
for _word, _pattern in _WORDS.items():
    _whole = re.compile(rf"^(?:{_pattern.pattern})\Z")
    Dumper.add_implicit_resolver(f"tag:yaml.org,2002:{_word}", _whole, None)


@dataclass(slots=True, eq=False)
class Node:
    """A value of a YAML file and its line: a dict or a list of nodes, or the text of a scalar."""

    value: Any
    line: int
    quoted: bool = False

    @property
    def word(self) -> str:
        """What a scalar is by the words of YAML 1.2: bool, null, int, float or str."""
        if not self.quoted:
            for word, pattern in _WORDS.items():
                if pattern.fullmatch(self.value):
                    return word
        return "str"

    def plain(self) -> Any:
        """Return the value in dict, list, str, float, int, bool and None."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        text: str = self.value
        match self.word:
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


@dataclass(slots=True)
class _Open:
    """A list or mapping that is being read, its anchor, and the key whose value comes next."""

    node: Node
    anchor: str | None
    key: str | None = None
    again: int | None = None  # line of a key that the mapping has already

    @property
    def part(self) -> str:
        """The part of a dotted path that the next value adds."""
        if isinstance(self.node.value, list):
            return f"[{len(self.node.value)}]"
        return self.key or ""


class _Composer:
    """Builds the tree of a YAML text from the events of the parser.

    An alias is the very node that its anchor names, never a copy, so that no file grows while it is
    read. A case may hold neither aliases nor keys that are numbers.
    """

    def __init__(self, file: object, key: str, case: bool) -> None:
        self.file, self.key, self.case = file, key, case
        self.root: Node | None = None
        self.open: list[_Open] = []
        self.anchors: dict[str, Node] = {}
        self.count = self.documents = 0

    def refuse(self, problem: str, remedy: str, mark: Any = None) -> InputError:
        key = f"line {mark.line + 1}, column {mark.column + 1}" if mark else self.path()
        return InputError(problem, remedy, file=self.file, key=key)

    def path(self) -> str:
        """Return the dotted path of the value that comes next."""
        parts = [self.key, *(place.part for place in self.open)]
        return dotted(part for part in parts if part)

    def take(self, event: Any) -> None:
        """Take the next event of the parser."""
        mark = event.start_mark
        if isinstance(event, yaml.DocumentStartEvent):
            self.documents += 1
            if self.documents > 1:
                raise self.refuse("begins a second YAML document", "keep one in a file", mark)
        elif isinstance(event, yaml.CollectionEndEvent):
            done = self.open.pop()
            self.place(done.node, done.anchor, mark)
        elif isinstance(event, yaml.NodeEvent):
            self.begin(event, mark)

    def begin(self, event: Any, mark: Any) -> None:
        """Take an alias, a scalar, or the begin of a list or mapping."""
        tag = getattr(event, "tag", None)
        if self.case and event.anchor is not None:
            problem = "anchors (&) and aliases (*) are refused"
            raise self.refuse(problem, "write the value out", mark)
        if tag not in (None, "!"):
            remedy = "write the plain value; put an included file's content in its place"
            raise self.refuse(f"tags (!) are refused, here {tag}", remedy, mark)
        self.count += 1
        if self.count > MAX_NODES:
            raise self.refuse(f"holds more than {MAX_NODES} values", "give a smaller file", mark)
        line = mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self.anchors:
                problem = f"the alias *{event.anchor} stands before its anchor or within it"
                raise self.refuse(problem, "write the value out", mark)
            self.place(self.anchors[event.anchor], None, mark)
        elif isinstance(event, yaml.ScalarEvent):
            self.place(Node(event.value, line, bool(event.style)), event.anchor, mark)
        else:
            empty: Any = [] if isinstance(event, yaml.SequenceStartEvent) else {}
            self.open.append(_Open(Node(empty, line), event.anchor))
            depth = CASE_DEPTH if self.case else DEPTH
            if len(self.open) > depth:
                raise self.refuse(f"is nested deeper than {depth} levels", "unfold it", mark)

    def place(self, node: Node, anchor: str | None, mark: Any) -> None:
        """Put a node where it belongs: at the root, into a list, or as a mapping's key or value."""
        if anchor:
            self.anchors[anchor] = node
        if not self.open:
            self.root = node
            return
        parent = self.open[-1]
        if isinstance(parent.node.value, list):
            parent.node.value.append(node)
        elif parent.key is None:
            if not isinstance(node.value, str) or (self.case and node.word != "str"):
                raise self.refuse("has a key that is not a word", "write a word", mark)
            if node.value == "<<":
                raise self.refuse("merge keys (<<) are refused", "write the values out", mark)
            parent.key = node.value
            parent.again = node.line if node.value in parent.node.value else None
        elif parent.again is not None:
            raise InputError(
                f"is given twice (again in line {parent.again})",
                "keep one of them",
                file=self.file,
                key=self.path(),
                value=node.plain(),
            )
        else:
            if isinstance(node.value, str) and not node.value.isascii():
                self.check_characters(node.value)
            parent.node.value[parent.key] = node
            parent.key = None

    def check_characters(self, text: str) -> None:
        try:
            text.encode()
        except UnicodeEncodeError:
            remedy = "write the text without \\u escapes"
            raise self.refuse("holds half a character", remedy) from None


@dataclass(frozen=True)
class Place:
    """A value in a YAML file with its dotted key."""

    node: Node
    key: str
    file: object

    @property
    def shown(self) -> str:
        """What a message calls the place."""
        return f"{self.key} (line {self.node.line})"

    def refuse(self, problem: str, remedy: str) -> InputError:
        """Return the error that lies here."""
        value = {"value": self.node.value} if isinstance(self.node.value, str) else {}
        return InputError(problem, remedy, file=self.file, key=self.shown, **value)

    def _below(self, node: Node, name: str) -> Place:
        return Place(node, dotted(part for part in (self.key, name) if part), self.file)

    def _expect(self, kind: type, what: str) -> None:
        if not isinstance(self.node.value, kind):
            raise self.refuse(f"must be {what}", "see the schema of such files")

    def find(self, name: str) -> Place | None:
        """Return a member of a mapping; None where there is none or it is empty."""
        self._expect(dict, "a mapping")
        node = self.node.value.get(name)
        if node is None or (isinstance(node.value, str) and node.word == "null"):
            return None
        return self._below(node, name)

    def get(self, path: str, remedy: str = "add it") -> Place:
        """Return what a dotted key below this place names; it must be there."""
        here = self
        for name in path.split("."):
            found = here.find(name)
            if found is None:
                missing = here._below(Node({}, here.node.line), name)
                raise missing.refuse("is missing", remedy)
            here = found
        return here

    def items(self) -> list[Place]:
        """Return the members of a list, one at least."""
        self._expect(list, "a list")
        if not self.node.value:
            raise self.refuse("is empty", "give what belongs there")
        return [self._below(node, f"[{index}]") for index, node in enumerate(self.node.value)]

    def text(self) -> str:
        """Return a text without spaces round it."""
        self._expect(str, "a word")
        return self.node.value.strip()

    def finite(self) -> float:
        """Return a finite number."""
        self._expect(str, "a number")
        number = None if self.node.quoted else fortran_number(self.node.value)
        if number is None:
            raise self.refuse("must be a finite number", "write it plainly, without a unit")
        return number

    def number(self, low: float, high: float, remedy: str) -> float:
        """Return a number within (low, high]."""
        number = self.finite()
        if not low < number <= high:
            raise self.refuse(f"must be above {low:g} and at most {high:g}", remedy)
        return number

    def numbers(self) -> Column:
        """Return a list of numbers."""
        return places_column(self.key, self.items())


def places_column(name: str, places: list[Place]) -> Column:
    """Return the numbers at some places of a file."""
    values = np.array([place.finite() for place in places])
    shown = [place.node.value for place in places]
    return Column(name, values, [place.shown for place in places], shown, places[0].file)


def compose(text: str, file: object, key: str = "", *, case: bool = False) -> Node | None:
    """Return the tree of a YAML text; None if it holds nothing.

    A `case` is held to stricter rules: no anchors and aliases, keys that are words, 20 levels at
    most. `key` is the place of the whole text, for messages. Raises InputError with file, line and
    column where the text is no YAML, or YAML that is refused: tags, merge keys, a key that is given
    twice, a second document, too many values.
    """
    composer = _Composer(file, key, case)
    try:
        for event in yaml.parse(text, Loader=_LOADERS[case]):
            composer.take(event)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        place = f"line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        if not mark and hasattr(error, "position"):
            place = f"line {text.count(chr(10), 0, error.position) + 1}"
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
        raise InputError(
            f"cannot be read as YAML: {problem}", "mend it there", file=file, key=place or key
        ) from None
    return composer.root


def parse(text: str, file: str, key: str = "") -> Any:
    """Return what the YAML text of a case holds in dict, list, str, float, int, bool and None.

    1e-4 is a number; yes, no, on, off, 010, 1:30 and 2020-01-01 are texts. Raises InputError as
    `compose` does.
    """
    node = compose(text, file, key, case=True)
    return None if node is None else node.plain()


def dotted(path: Iterable[str]) -> str:
    """Return the dotted form of a path, such as rotor.stations[2], with overlong keys cut."""
    text = ""
    for part in path:
        part = part if len(part) <= 60 else f"{part[:57]}..."
        text += part if part.startswith("[") or not text else f".{part}"
    return text
