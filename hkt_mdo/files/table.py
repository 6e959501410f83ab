"""Files as text, and the one reader of CSV tables."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError

__all__ = ["Column", "Csv", "Source", "Table", "any_number", "parse_number", "parse_table"]
__all__ += ["read_bytes", "read_text"]

MAX_TEXT_BYTES = 16 * 1024**2
"""Largest text file that is read where nothing else is said, in bytes."""

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_LONGEST_NUMBER, _LONGEST_NAME = 64, 100
_PLAIN = re.compile(r"[-+.0-9eE \n]*")


def read_bytes(path: Path, largest: int, what: str) -> bytes:
    """Return the content of a regular file of at most `largest` bytes.

    `what` says what the file is to hold, for the message. Raises InputError if there is no such
    file, it cannot be read, or it is too large.
    """
    try:
        if not path.is_file():
            problem = "is not a file" if path.exists() else "does not exist"
            raise InputError(problem, f"give the path of a {what}", file=path)
        with path.open("rb") as stream:
            content = stream.read(largest + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"cannot be read ({reason})", f"give the path of a readable {what}", file=path
        ) from None
    if len(content) > largest:
        problem = f"is larger than {largest / 1024**2:g} MiB"
        raise InputError(problem, f"give a {what} of its usual size", file=path)
    return content


def read_text(path: Path, what: str, largest: int = MAX_TEXT_BYTES) -> str:
    """Return the text of a regular file, line ends as they are, without a byte order mark.

    `what` says what the file is to hold, for the message. Raises InputError if the file cannot be
    read, is larger than `largest` bytes, or is no UTF-8 text; the message names the line.
    """
    content = read_bytes(path, largest, what)
    wrong = None
    try:
        text = content.decode("utf-8-sig")
        if "\0" in text:
            wrong = content.index(b"\0")
    except UnicodeDecodeError as error:
        wrong = error.start
    if wrong is not None:
        line = content.count(b"\n", 0, wrong) + 1
        raise InputError("is not UTF-8 text", "save it as UTF-8", file=path, key=f"line {line}")
    return text


def lines_of(text: str) -> list[str]:
    """Return the lines of a text, whichever line ends it has."""
    return re.split(r"\r\n|\r|\n", text)


def parse_number(text: str) -> float | None:
    """Return a finite number written with a decimal point.

    None for anything else: words, nan, inf, thousands separators, digits of other scripts, and
    spaces round the number.
    """
    if len(text) > _LONGEST_NUMBER or not _NUMBER.fullmatch(text):
        return None
    number = float(text)
    return number if np.isfinite(number) else None


def fortran_number(text: str) -> float | None:
    """Return what `parse_number` does; an exponent may also be written with a d, as 1.0D+00."""
    return parse_number(re.sub("[dD]", "e", text))


def any_number(text: str) -> float | None:
    """Return what `parse_number` does; nan, inf and -inf are numbers, too."""
    return float(text) if text in {"nan", "inf", "-inf"} else parse_number(text)


def parse_numbers(
    cells: Sequence[str],
    parse: Callable[[str], float | None] = parse_number,
    missing: Collection[str] = (),
) -> tuple[np.ndarray, int | None]:
    """Return the numbers that cells write, and the index of the first cell that writes none.

    `parse` reads a cell without spaces round it. Cells that hold one of the words `missing` (in
    small letters) give NaN.
    """
    # One look at all cells together is quick; cells that are not plain are read one by one.
    if _PLAIN.fullmatch("\n".join(cells)):
        try:
            numbers = np.array([float(cell) for cell in cells])
        except ValueError:
            pass
        else:
            if np.all(np.isfinite(numbers)):
                return numbers, None
    numbers = np.full(len(cells), np.nan)
    for index, cell in enumerate(map(str.strip, cells)):
        number = np.nan if cell.lower() in missing else parse(cell)
        if number is None:
            return numbers, index
        numbers[index] = number
    return numbers, None


class Source:
    """A text file, and the errors in its lines."""

    def __init__(self, file: object) -> None:
        self.file = file

    def refuse(
        self, problem: str, remedy: str, line: int, what: str = "", **value: object
    ) -> InputError:
        """Return the error that lies in a line; `what` names the column or the key in it."""
        what = what[:_LONGEST_NAME]
        key = f"line {line}, {what}" if what else f"line {line}"
        return InputError(problem, remedy, file=self.file, key=key, **value)


@dataclass(frozen=True, eq=False)
class Column:
    """Numbers of a file, and how a message names each of them."""

    name: str
    values: np.ndarray
    """Numbers, shape (n_rows,), in any unit that the caller converts them to."""
    keys: Sequence[str]
    """The place of each in the file."""
    shown: Sequence[object]
    """Each as it is written in the file."""
    file: object

    def refuse(self, wrong: np.ndarray, problem: str, remedy: str) -> None:
        """Raise InputError for the first of the wrong values, if any."""
        rows = np.flatnonzero(wrong)
        if rows.size:
            row = int(rows[0])
            raise InputError(
                problem, remedy, file=self.file, key=self.keys[row], value=self.shown[row]
            )

    def check_rising(self, what: str, steps: np.ndarray | None = None) -> None:
        """Refuse the first value that does not exceed the one before it."""
        steps = np.diff(self.values, prepend=-np.inf) if steps is None else steps
        problem = f"does not exceed the value before: {what} must increase strictly"
        self.refuse(steps <= 0.0, problem, "sort them and remove duplicates")


def number_column(
    name: str,
    lines: Sequence[int],
    cells: Sequence[str],
    file: object,
    parse: Callable[[str], float | None] = parse_number,
) -> Column:
    """Return the numbers of a column; refuse the first cell that holds none."""
    numbers, wrong = parse_numbers(cells, parse)
    if wrong is not None:
        problem, remedy = "must be a finite number", "write it with a decimal point, without a unit"
        line, what = lines[wrong], f"column {name}"
        raise Source(file).refuse(problem, remedy, line, what, value=cells[wrong])
    return Column(name, numbers, [f"line {line}, column {name}" for line in lines], cells, file)


def text_columns(
    rows: Sequence[tuple[int, Sequence[str]]],
    names: Sequence[str],
    file: object,
    wanted: Collection[str],
    remedy: str = "complete the row, or correct the number of rows if the file states one",
) -> dict[str, Column]:
    """Return the wanted columns of a text's rows, (line number, cells) each."""
    for line, cells in rows:
        if len(cells) != len(names):
            problem = f"has {len(cells)} numbers where the table has {len(names)} columns"
            raise Source(file).refuse(problem, remedy, line, value=" ".join(cells))
    lines = [line for line, _ in rows]
    return {
        name: number_column(name, lines, [cells[place] for _, cells in rows], file, fortran_number)
        for place, name in enumerate(names)
        if name in wanted
    }


class Csv(Source):
    """A CSV file: its header, and its rows as (line number, cells) on iteration.

    Lines that are empty or begin with ``#`` are passed over. InputError names the line of a row
    that has more or fewer cells than the header. `expected` describes the header that is
    expected, for messages.
    """

    def __init__(self, text: str, file: Path, expected: str) -> None:
        super().__init__(file)
        self.header: list[str] = []
        stream = io.TextIOWrapper(io.BytesIO(text.encode()), encoding="utf-8", newline="")
        self._rows = self._read(csv.reader(stream, strict=True))
        self.header_line, cells = next(self._rows, (1, []))
        self.header = [cell.strip() for cell in cells]
        begin = f"its first line is {expected}"
        if not cells:
            raise self.refuse("is empty", begin, 1)
        shown = ",".join(self.header)
        if len(cells) == 1 and re.search("[;\t|]", cells[0]):
            remedy = "separate cells by commas and write decimals with a point"
            raise self.refuse("is not separated by commas", remedy, self.header_line, value=shown)
        if any(_NUMBER.fullmatch(name) for name in self.header):
            problem = "has a number where the columns' names are expected"
            raise self.refuse(problem, begin, self.header_line, value=shown)

    def _read(self, reader) -> Iterator[tuple[int, list[str]]]:
        try:
            for cells in reader:
                if not any(map(str.strip, cells)) or cells[0].lstrip()[:1] == "#":
                    continue
                if self.header and len(cells) != len(self.header):
                    problem = f"has {len(cells)} cells where the header has {len(self.header)}"
                    remedy = "give every column one cell and write decimals with a point"
                    raise self.refuse(problem, remedy, reader.line_num, value=",".join(cells))
                yield reader.line_num, cells
        except csv.Error as error:
            raise self.refuse(f"is not CSV ({error})", "mend the line", reader.line_num) from None

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        return self._rows

    def place(self, name: str) -> int:
        """Return the place of a column that the header has; refuse one that it has twice."""
        if self.header.count(name) > 1:
            problem = "appears twice in the header"
            raise self.refuse(problem, "name each column once", self.header_line, f"column {name}")
        return self.header.index(name)

    @cached_property
    def rows(self) -> list[tuple[int, list[str]]]:
        """All rows."""
        return list(self)

    @cached_property
    def lines(self) -> list[int]:
        """The number of each row's line in the file."""
        return [line for line, _ in self.rows]

    def cells(self, name: str) -> list[str]:
        """Return the cells of a column, without spaces round them."""
        place = self.place(name)
        return [cells[place].strip() for _, cells in self.rows]

    def numbers(self, name: str, parse: Callable[[str], float | None] = parse_number) -> Column:
        """Return a column of numbers."""
        return number_column(name, self.lines, self.cells(name), self.file, parse)


class Table(dict[str, np.ndarray]):
    """Columns of numbers by name; `lines` holds the number of each row's line in the file."""

    def __init__(self, columns: dict[str, np.ndarray], lines: Sequence[int]) -> None:
        super().__init__(columns)
        self.lines = tuple(lines)


def parse_table(
    text: str,
    path: Path,
    columns: Sequence[str],
    what: str,
    optional: Sequence[str] = (),
    *,
    parse: Callable[[str], float | None] = parse_number,
    fewest: int = 1,
) -> Table:
    """Read columns of numbers, column[n_rows], from the text of a CSV file.

    `columns` must be there; `optional` ones are read if they are there, and others are ignored.
    `path` and `what` name the file and its content in messages. `parse` reads a cell:
    `parse_number`, or `any_number` where nan and inf are allowed. Raises InputError if a column is
    missing or appears twice, there are less than `fewest` rows, a line has more or fewer cells than
    the header, or a cell is no number; the message names file, line, column and value.
    """
    table = Csv(text, path, ",".join(columns))
    wanted = [name for name in (*columns, *optional) if name in table.header]
    for name in wanted:
        table.place(name)
    for name in columns:
        if name not in wanted:
            raise table.refuse(
                f"lacks the column {name}",
                f"the {what} has the columns {','.join(columns)}",
                table.header_line,
                value=",".join(table.header),
            )
    if len(table.rows) < fewest:
        raise InputError("has a header but no numbers", f"add the rows of the {what}", file=path)
    return Table({name: table.numbers(name, parse).values for name in wanted}, table.lines)
