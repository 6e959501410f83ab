"""Reader of YAML 1.2 for cases and turbine files: plain values, of limited depth and size."""

import re
from collections.abc import Iterable, Sized
from dataclasses import dataclass
from functools import reduce
from typing import Any, ClassVar

import numpy as np
import yaml

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import Column, parse_number

DEPTH = 20
"""Deepest nesting of a file; that of a reference turbine is 9."""

_TOO_DEEP = f"is nested deeper than {DEPTH} levels", "write fewer levels"

LONGEST_KEY = 60
"""Most characters of a key that a message repeats."""

LONGEST_INTEGER = 18
"""Most characters of an integer that is read as one: reading thousands of digits is slow."""

_TAG = "tag:yaml.org,2002:"
_FLOAT = r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
_WORDS = {
    "bool": "true|True|TRUE|false|False|FALSE",
    "null": "~|null|Null|NULL|",
    "int": rf"(?!.{{{LONGEST_INTEGER + 1}}})[-+]?(0|[1-9][0-9]*)",
    "float": rf"{_FLOAT}|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
}


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
    """libyaml, ten times as fast as PyYAML's own parser, with the scalars of YAML 1.2."""

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}


class _CaseLoader(yaml.SafeLoader):
    """PyYAML's own parser, which locates errors more precisely, with the scalars of YAML 1.2."""

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}


class _Dumper(yaml.SafeDumper):
    """Lists of numbers and texts on one line; quotes where YAML 1.1 or 1.2 has another type."""

    def ignore_aliases(self, data: Any) -> bool:
        """Return that every value is written out, also where it is there twice.

        Parameters
        ----------
        data : object
            The value.

        Returns
        -------
        bool
            True.
        """
        return True

    def represent_flow_list(self, data: list[Any]) -> yaml.Node:
        """Return the node of a list, which is written on one line unless it is one of sections.

        Parameters
        ----------
        data : list
            The list.

        Returns
        -------
        yaml.Node
            A sequence, in flow style where it holds no sections.
        """
        inline = None if data and isinstance(data[0], dict) else True
        return self.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=inline)


_Dumper.add_representer(list, _Dumper.represent_flow_list)
for _word, _pattern in _WORDS.items():
    for _class in (_Loader, _CaseLoader, _Dumper):
        _class.add_implicit_resolver(_TAG + _word, re.compile(rf"(?:{_pattern})\Z"), None)


def dump(data: Any, width: float = 100, **style: Any) -> str:
    """Return data as YAML that `parse` reads.

    Parameters
    ----------
    data : Any
        Dictionaries, lists and plain values.
    width : float
        Longest line in characters, where that is possible.
    **style
        As `yaml.dump` takes it.

    Returns
    -------
    str
        Keys in their order.
    """
    style |= {"Dumper": _Dumper, "sort_keys": False, "allow_unicode": True}
    return str(yaml.dump(data, width=width, **style))


@dataclass(frozen=True)
class Place:
    """A value in a YAML file with its dotted key.

    Attributes
    ----------
    node : yaml.Node
        The value.
    key : str
        Its dotted key, such as components.blade.
    file : object
        The file, for messages.
    """

    node: yaml.Node
    key: str
    file: object

    @property
    def shown(self) -> str:
        """The key with its line, as messages have it.

        Returns
        -------
        str
            Such as ``rotor.polar (line 7)``.
        """
        return f"{self.key} (line {self.node.start_mark.line + 1})"

    def refuse(self, problem: str, remedy: str) -> InputError:
        """Return the error of this value, to be raised.

        Parameters
        ----------
        problem, remedy : str
            As of `InputError`.

        Returns
        -------
        InputError
            With file, key and line, and with the value if it is a scalar.
        """
        value = {"value": self.node.value} if isinstance(self.node, yaml.ScalarNode) else {}
        return InputError(problem, remedy, file=self.file, key=self.shown, **value)

    def below(self, node: yaml.Node, name: str) -> "Place":
        """Return a member of this value.

        Parameters
        ----------
        node : yaml.Node
            The member.
        name : str
            Its key, or its index as ``[2]``.

        Returns
        -------
        Place
            The member with its dotted key.
        """
        return Place(node, joined(self.key, name), self.file)

    def _expect(self, kind: type, what: str) -> None:
        """Refuse a node that is not of this kind."""
        if not isinstance(self.node, kind):
            raise self.refuse(f"must be {what}", "see the schema of such files")

    def find(self, path: str, remedy: str = "") -> "Place | None":
        """Return the value of a key below this one.

        Parameters
        ----------
        path : str
            A key, or several joined by points.
        remedy : str
            What to do if the key is missing; empty if it may be.

        Returns
        -------
        Place or None
            The value; None if the key is missing or null.

        Raises
        ------
        InputError
            If the key is missing and there is a remedy, or a value above it is no mapping.
        """
        mapping = self
        for name in path.split("."):
            mapping._expect(yaml.MappingNode, "a mapping")
            node = next((node for key, node in mapping.node.value if key.value == name), None)
            if node is None or (isinstance(node, yaml.ScalarNode) and node.tag == f"{_TAG}null"):
                key = mapping.below(mapping.node, name).shown
                if remedy:
                    raise InputError("is missing", remedy, file=self.file, key=key)
                return None
            mapping = mapping.below(node, name)
        return mapping

    def get(self, path: str, remedy: str = "add it") -> "Place":
        """Return the value of a key that must be there.

        Parameters
        ----------
        path, remedy : str
            As of `find`.

        Returns
        -------
        Place
            The value.

        Raises
        ------
        InputError
            If the key is missing, or a value above it is no mapping.
        """
        return self.find(path, remedy)  # type: ignore[return-value]

    def items(self) -> list["Place"]:
        """Return the members of a list; raise InputError if it is no list or empty.

        Returns
        -------
        list of Place
            The members with their keys.
        """
        self._expect(yaml.SequenceNode, "a list")
        if not self.node.value:
            raise self.refuse("is empty", "give a value")
        return [self.below(node, f"[{index}]") for index, node in enumerate(self.node.value)]

    def text(self) -> str:
        """Return a scalar as text; raise InputError if it is none.

        Returns
        -------
        str
            The text without spaces round it.
        """
        self._expect(yaml.ScalarNode, "a word")
        return self.node.value.strip()

    def number(self, low: float = -np.inf, high: float = np.inf, remedy: str = "") -> float:
        """Return a finite number.

        Parameters
        ----------
        low, high : float
            The number must be above `low` and at most `high`.
        remedy : str
            What to do if it is not.

        Returns
        -------
        float
            The number, as the file gives it.

        Raises
        ------
        InputError
            If the value is no finite number, or out of range.
        """
        self._expect(yaml.ScalarNode, "a number")
        number = None if self.node.style else parse_number(self.node.value)
        if number is None:
            raise self.refuse("must be a finite number", "write it plainly, without a unit")
        if not low < number <= high:
            raise self.refuse(f"must be above {low:g} and at most {high:g}", remedy)
        return number

    def numbers(self) -> Column:
        """Return a list of numbers; raise InputError if it is none.

        Returns
        -------
        Column
            The numbers with the place of each.
        """
        return places_column(self.key, self.items())

    def pair(self, one: str, other: str) -> tuple[Column, Column]:
        """Return two lists of as many numbers.

        Parameters
        ----------
        one, other : str
            The keys of the lists below this value.

        Returns
        -------
        tuple of Column
            Their numbers.

        Raises
        ------
        InputError
            If either is missing or no list of numbers, or their lengths differ.
        """
        first, second = self.get(one).numbers(), self.get(other).numbers()
        self.check_sizes(**{one: first.values, other: second.values})
        return first, second

    def check_sizes(self, **lists: Sized) -> None:
        """Refuse two lists of different lengths.

        Parameters
        ----------
        **lists
            Two lists by their keys.

        Raises
        ------
        InputError
            If their lengths differ.
        """
        (one, first), (other, second) = lists.items()
        if len(first) != len(second):
            problem = f"has {len(first)} values in {one} and {len(second)} in {other}"
            raise self.refuse(problem, "give as many in both")


def places_column(name: str, places: list[Place]) -> Column:
    """Return several numbers of a file as a column.

    Parameters
    ----------
    name : str
        Name of the column, for messages.
    places : list of Place
        The numbers, one at least.

    Returns
    -------
    Column
        Their values, keys and texts.

    Raises
    ------
    InputError
        If one of them is no finite number.
    """
    values = np.array([place.number() for place in places])
    shown = [place.node.value for place in places]
    return Column(name, values, [place.shown for place in places], shown, places[0].file)


def compose(text: str, file: object, key: str = "", *, case: bool = False) -> yaml.Node | None:
    """Return the tree of nodes of a YAML 1.2 text (https://yaml.org/spec/1.2.2).

    An alias is the same node as its anchor, never a copy, so that aliases cannot multiply the size.

    Parameters
    ----------
    text : str
        The text.
    file : object
        The file, for messages.
    key : str
        Key of the whole text, for messages.
    case : bool
        Whether the stricter rules for cases hold: no anchors and aliases, keys that are words.

    Returns
    -------
    yaml.Node or None
        The root; None if the text holds nothing.

    Raises
    ------
    InputError
        If the text is no YAML, or YAML that is refused: tags, merge keys, a key that is given
        twice, a second document, deep nesting. The message says where.
    """
    loader = _CaseLoader if case else _Loader
    try:
        _check_events(yaml.parse(text, Loader=loader), file, case)
        root = yaml.compose(text, Loader=loader)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        where = _shown(mark) if mark else key
        if not mark and hasattr(error, "position"):
            where = f"line {text.count(chr(10), 0, error.position) + 1}"
        reason = getattr(error, "problem", None) or getattr(error, "reason", None) or error
        problem, remedy = f"cannot be read as YAML: {reason}", "correct it there"
        if "nesting depth" in problem:  # libyaml of PyYAML 6.0.4 looks ahead and has a limit too
            problem, remedy = _TOO_DEEP
        raise InputError(problem, remedy, file=file, key=where) from None
    if root is not None:
        _check_keys(Place(root, key, file), case, set())
    return root


def _check_events(events: Iterable[Any], file: object, case: bool) -> None:
    """Refuse tags, deep nesting and, in a case, anchors."""
    depth = 0
    for event in events:
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        tag = getattr(event, "tag", None)
        if depth > DEPTH:
            problem, remedy = _TOO_DEEP
        elif case and getattr(event, "anchor", None) is not None:
            problem, remedy = "anchors (&) and aliases (*) are refused", "write the value out"
        elif tag not in (None, "!"):
            problem = f"tags (!) are refused, here {tag}"
            remedy = "write the plain value; put an included file's content in its place"
        else:
            continue
        raise InputError(problem, remedy, file=file, key=_shown(event.start_mark))


def _shown(mark: yaml.Mark) -> str:
    """Return where a mark is, as messages have it."""
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
        names = set()
        for key, value in node.value:
            line = f"line {key.start_mark.line + 1}"
            if not isinstance(key, yaml.ScalarNode) or (case and key.tag != f"{_TAG}str"):
                remedy = "write a word"
                if key.tag == f"{_TAG}int":
                    remedy += "; a decimal has a point, not a comma, which begins the next key"
                raise refuse(f"has a key that is not a word ({line})", remedy)
            member = place.below(value, key.value)
            if key.value == "<<":
                raise refuse("merge keys (<<) are refused", "write the values out", member)
            if key.value in names:
                # A list may hold itself by aliases: only a scalar is shown.
                shown = {"value": plain(value)} if isinstance(value, yaml.ScalarNode) else {}
                raise refuse(f"is given twice (again in {line})", "keep one", member, **shown)
            names.add(key.value)
            # neither null nor quotes; of a section at the top all keys may be commented out
            empty = isinstance(value, yaml.ScalarNode) and not value.style and not value.value
            if case and place.key and empty:
                raise refuse(f"has no value ({line})", "give one, or null for the default", member)
            _check_keys(member, case, seen)
    elif re.search("[\ud800-\udfff]", node.value):
        raise refuse("has an incomplete Unicode character", "write the text without \\u escapes")


def plain(node: yaml.Node | None) -> Any:
    """Return the value of a node.

    Parameters
    ----------
    node : yaml.Node or None
        As `compose` returns it.

    Returns
    -------
    dict, list, str, float, int, bool or None
        The value; None also for no node.
    """
    return None if node is None else _Loader("").construct_document(node)


def parse(text: str, file: str, key: str = "") -> Any:
    """Return the content of the YAML text of a case.

    1e-4 is a number; yes, no, on, off, 010, 1:30 and 2020-01-01 are texts.

    Parameters
    ----------
    text : str
        The text.
    file : str
        The file, for messages.
    key : str
        Key of the whole text, for messages.

    Returns
    -------
    dict, list, str, float, int, bool or None
        The content.

    Raises
    ------
    InputError
        As of `compose`.
    """
    return plain(compose(text, file, key, case=True))


def dotted(path: Iterable[str]) -> str:
    """Return the dotted form of a path, such as rotor.stations[2].

    Parameters
    ----------
    path : iterable of str
        Keys and indices, these as ``[2]``.

    Returns
    -------
    str
        The path, with overlong keys cut.
    """
    return reduce(joined, path, "")


def joined(path: str, part: str) -> str:
    """Return a dotted path with one more key.

    Parameters
    ----------
    path : str
        The dotted path; may be empty.
    part : str
        A key, or an index as ``[2]``; cut if it is longer than `LONGEST_KEY`.

    Returns
    -------
    str
        The longer path.
    """
    part = part if len(part) <= LONGEST_KEY else f"{part[: LONGEST_KEY - 3]}..."
    return path + part if part.startswith("[") or not path else f"{path}.{part}"
