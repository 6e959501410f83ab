"""Files as text, columns of numbers, and the one reader of CSV tables."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError

__all__ = ["Column", "Csv", "line_error", "parse_number", "read_bytes", "read_text"]

MAX_TEXT_BYTES = 16 * 1024**2
"""Largest text file that is read where nothing else is said, in bytes."""

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_LONGEST_NUMBER, _LONGEST_NAME = 64, 100


def read_bytes(path: Path, largest: int, what: str) -> bytes:
    """Return the content of a regular file of at most `largest` bytes; `what` says what it holds.

    Raises InputError if there is no such file, it cannot be read, or it is too large.
    """
    try:
        if not path.is_file():
            problem = "is not a file" if path.exists() else "does not exist"
            raise InputError(problem, f"give the path of a {what}", file=path)
        with path.open("rb") as stream:
            content = stream.read(largest + 1)
    except (OSError, ValueError) as error:
        problem = f"cannot be read ({getattr(error, 'strerror', None) or error})"
        raise InputError(problem, f"give the path of a readable {what}", file=path) from None
    if len(content) > largest:
        problem = f"is larger than {largest / 1024**2:g} MiB"
        raise InputError(problem, f"give a {what} of its usual size", file=path)
    return content


def read_text(path: Path, what: str, largest: int = MAX_TEXT_BYTES) -> str:
    """Return the text of a regular file, line ends as they are, without a byte order mark.

    Raises InputError as `read_bytes` does, and, with the line, if it is no UTF-8 text.
    """
    content = read_bytes(path, largest, what)
    try:
        text = content.decode("utf-8-sig")
        wrong = content.find(b"\0")
    except UnicodeDecodeError as error:
        wrong = error.start
    if wrong >= 0:
        line = content.count(b"\n", 0, wrong) + 1
        raise line_error(path, line, "is not UTF-8 text", "save it as UTF-8")
    return text


def lines_of(text: str) -> list[str]:
    """Return the lines of a text, whichever line ends it has."""
    return re.split(r"\r\n|\r|\n", text)


def line_error(
    file: object, line: int, problem: str, remedy: str, what: str = "", **value: object
) -> InputError:
    """Return the error that lies in a line; `what` names the column or the key in it."""
    key = f"line {line}, {what[:_LONGEST_NAME]}" if what else f"line {line}"
    return InputError(problem, remedy, file=file, key=key, **value)


def parse_number(text: str) -> float | None:
    """Return a finite number written with a decimal point, without spaces; None for all else."""
    if len(text) > _LONGEST_NUMBER or not _NUMBER.fullmatch(text):
        return None
    number = float(text)
    return number if math.isfinite(number) else None


def fortran_number(text: str) -> float | None:
    """Return what `parse_number` does; an exponent may also be written with a d, as 1.0D+00."""
    return parse_number(re.sub("[dD]", "e", text))


@dataclass(frozen=True, eq=False)
class Column:
    """Numbers of a file, and how a message names each of them."""

    name: str
    values: np.ndarray
    keys: Sequence[str]
    """The place of each in the file."""
    shown: Sequence[object]
    """Each as it is written in the file."""
    file: object

    def refuse(self, wrong: np.ndarray, problem: str, remedy: str) -> None:
        """Raise InputError for the first of the wrong values, if any."""
        for row in np.flatnonzero(wrong)[:1]:
            key, value = self.keys[row], self.shown[row]
            raise InputError(problem, remedy, file=self.file, key=key, value=value)

    def check_rising(self, what: str, values: np.ndarray | None = None) -> None:
        """Refuse the first of the column's values, or of others, that is not above the last."""
        steps = np.diff(self.values if values is None else values, prepend=-np.inf)
        problem = f"does not exceed the value before: {what} must increase strictly"
        self.refuse(steps <= 0.0, problem, "sort them and remove duplicates")


def number_columns(
    rows: Sequence[tuple[int, Sequence[str]]],
    names: Sequence[str],
    file: object,
    wanted: Collection[str],
    remedy: str = "complete the row, or correct the number of rows if the file states one",
    parse: Callable[[str], float | None] = fortran_number,
) -> dict[str, Column]:
    """Return the wanted columns of numbers in a text's rows, (line number, cells) each."""
    for line, cells in rows:
        if len(cells) != len(names):
            problem = f"has {len(cells)} numbers where the table has {len(names)} columns"
            raise line_error(file, line, problem, remedy, value=" ".join(cells))
    columns = {}
    for name in wanted:
        if name in names:
            shown = [cells[names.index(name)].strip() for _, cells in rows]
            keys = [f"line {line}, column {name}" for line, _ in rows]
            numbers = [parse(cell) for cell in shown]
            wrong = np.array([number is None for number in numbers], dtype=bool)
            values = np.array(numbers, dtype=float)
            column = columns[name] = Column(name, values, keys, shown, file)
            plain = "write it with a decimal point, without a unit"
            column.refuse(wrong, "must be a finite number", plain)
    return columns


class Csv:
    """A CSV file: its header, and its rows as (line number, cells) on iteration.

    Lines that are empty or begin with ``#`` are passed over. InputError names the line of a row
    that has more or fewer cells than the header. `expected` describes the header, for messages.
    """

    def __init__(self, text: str, file: Path, expected: str) -> None:
        self.file = file
        self.header: list[str] = []
        stream = io.TextIOWrapper(io.BytesIO(text.encode()), encoding="utf-8", newline="")
        self._rows = self._read(csv.reader(stream, strict=True))
        self.header_line, cells = next(self._rows, (1, []))
        self.header = [cell.strip() for cell in cells]
        begin = f"its first line is {expected}"
        if not cells:
            raise line_error(file, 1, "is empty", begin)
        if len(cells) == 1 and re.search("[;\t|]", cells[0]):
            remedy = "separate cells by commas and write decimals with a point"
            raise self.refuse("is not separated by commas", remedy)
        if any(_NUMBER.fullmatch(name) for name in self.header):
            raise self.refuse("has a number where the columns' names are expected", begin)

    def _read(self, reader) -> Iterator[tuple[int, list[str]]]:
        try:
            for cells in reader:
                if not any(map(str.strip, cells)) or cells[0].lstrip()[:1] == "#":
                    continue
                if self.header and len(cells) != len(self.header):
                    line, shown = reader.line_num, ",".join(cells)
                    problem = f"has {len(cells)} cells where the header has {len(self.header)}"
                    remedy = "give every column one cell and write decimals with a point"
                    raise line_error(self.file, line, problem, remedy, value=shown)
                yield reader.line_num, cells
        except csv.Error as error:
            problem = f"is not CSV ({error})"
            raise line_error(self.file, reader.line_num, problem, "mend the line") from None

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        return self._rows

    def refuse(self, problem: str, remedy: str, column: str = "") -> InputError:
        """Return the error that lies in the header, in one column of it or in all."""
        if column:
            return line_error(self.file, self.header_line, problem, remedy, f"column {column}")
        shown = ",".join(self.header)
        return line_error(self.file, self.header_line, problem, remedy, value=shown)

    def place(self, name: str) -> int:
        """Return the place of a column that the header has; refuse one that it has twice."""
        if self.header.count(name) > 1:
            raise self.refuse("appears twice in the header", "name each column once", name)
        return self.header.index(name)

    @cached_property
    def rows(self) -> list[tuple[int, list[str]]]:
        """All rows; refused if there are none."""
        rows = list(self)
        if not rows:
            raise InputError("has a header but no rows", "add rows of numbers", file=self.file)
        return rows

    def columns(
        self, names: Sequence[str], what: str, optional: Sequence[str] = ()
    ) -> dict[str, Column]:
        """Return columns of numbers: these, which must be there, and optional ones if there.

        Raises InputError if a column is missing or there twice, there are no rows, or a cell is no
        number; `what` names the table.
        """
        wanted = [name for name in (*names, *optional) if name in self.header]
        for name in wanted:
            self.place(name)
        for name in names:
            if name not in wanted:
                remedy = f"the {what} has the columns {','.join(names)}"
                raise self.refuse(f"lacks the column {name}", remedy)
        return number_columns(self.rows, self.header, self.file, wanted, parse=parse_number)
