"""Files read and written whole, columns of numbers, and the reader of all CSV tables."""

import csv
import io
import math
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError, did_you_mean

MAX_TEXT_BYTES, MAX_RECORD_BYTES = 16 * 1024**2, 256 * 1024**2
"""Largest text file that is read where nothing else is said, and largest record, in bytes."""

LONGEST_NAME = 100
"""Most characters of a column's name or a key that a message repeats."""

_LONGEST_NUMBER = 64  # characters; a double needs 24
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?", re.ASCII)

Row = tuple[int, Sequence[str]]
"""A row of a table: number of its line in the file, and its cells."""


def read_bytes(path: Path, largest: int, what: str) -> bytes:
    """Return the content of a regular file.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    largest : int
        Largest size, bytes.
    what : str
        What the file holds, for messages.

    Returns
    -------
    bytes
        All of it.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or it is too large.
    """
    try:
        if not path.is_file():
            problem = "is not a file" if path.exists() else "does not exist"
            inside = f", such as {path / 'case.yaml'}" * (path / "case.yaml").is_file()
            raise InputError(problem, f"give the path of a {what}{inside}", file=path)
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
    """Return the text of a regular file.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    what : str
        What the file holds, for messages.
    largest : int
        Largest size, bytes.

    Returns
    -------
    str
        Its text, line ends as they are, without a byte order mark.

    Raises
    ------
    InputError
        As of `read_bytes`, and, with the line, if it is no UTF-8 text.
    """  # noqa: DOC501 - `line_error` returns an InputError
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


def file_state(path: str | Path) -> tuple[int, int] | None:
    """Return what changes when a file is written anew.

    Parameters
    ----------
    path : str or pathlib.Path
        The file.

    Returns
    -------
    tuple of int or None
        Its time, ns, and size; None if it cannot be read.
    """
    with suppress(OSError):
        state = Path(path).stat()
        return state.st_mtime_ns, state.st_size
    return None


def write_files(contents: Mapping[Path, str | bytes]) -> None:
    """Replace files atomically: a reader never sees an incomplete one.

    Their folder must be there: one that was taken away during a run must not come back with half a
    result in it.

    Parameters
    ----------
    contents : mapping of pathlib.Path to str or bytes
        What each file is to hold; a text in UTF-8.

    Raises
    ------
    InputError
        If one cannot be written.
    """
    parts = {file: file.with_name(f"{file.name}.part") for file in contents}
    try:
        for file, content in contents.items():
            parts[file].write_bytes(content if isinstance(content, bytes) else content.encode())
        for file, part in parts.items():
            part.replace(file)
    except OSError as error:
        problem = f"cannot be written ({error.strerror})"
        raise InputError(problem, "make room or choose another folder", file=file) from error
    finally:
        for part in parts.values():
            with suppress(OSError):  # such as for a folder that has been deleted
                part.unlink(missing_ok=True)


def refuse_existing(files: Iterable[Path], force: bool) -> None:
    """Refuse to write files that are there, unless they are to be replaced.

    Parameters
    ----------
    files : iterable of pathlib.Path
        The files.
    force : bool
        Whether they may be replaced.

    Raises
    ------
    InputError
        If one of them is a folder, or is there and is not to be replaced.
    """
    for file in files:
        if file.is_dir():
            raise InputError("is a folder", "choose another name or folder", file=file)
        if os.path.lexists(file) and not force:
            remedy = "give --force to replace it, or choose another name or folder"
            raise InputError("is there already", remedy, file=file)


def write_new(contents: Mapping[Path, str | bytes], force: bool = False) -> list[Path]:
    """Write files and the folders that they need; nothing if one of them must not be replaced.

    Parameters
    ----------
    contents : mapping of pathlib.Path to str or bytes
        What each file is to hold; a text in UTF-8.
    force : bool
        Whether files that are there may be replaced.

    Returns
    -------
    list of pathlib.Path
        The files.

    Raises
    ------
    InputError
        As of `refuse_existing`, or if a folder or a file cannot be written.
    """
    refuse_existing(contents, force)
    for folder in dict.fromkeys(file.parent for file in contents):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            problem = f"cannot be made a folder ({error.strerror})"
            raise InputError(problem, "choose another one", file=folder) from error
    write_files(contents)
    return list(contents)


def csv_text(names: Iterable[str], rows: Iterable[Iterable], remarks: Iterable[str] = ()) -> str:
    """Return rows below a header as CSV.

    Parameters
    ----------
    names : iterable of str
        Names of the columns.
    rows : iterable of iterable
        The cells of each row; None is an empty cell.
    remarks : iterable of str
        Lines above the header, which begin with #.

    Returns
    -------
    str
        The text of the file.
    """
    text = io.StringIO(newline="")
    text.writelines(f"# {line}".rstrip() + "\n" for line in remarks)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return text.getvalue()


def numbered_lines(text: str) -> list[tuple[int, str]]:
    r"""Return the lines of a text with their numbers.

    Parameters
    ----------
    text : str
        A text whose lines end with \n, \r\n or \r.

    Returns
    -------
    list of (int, str)
        Number of each line, from 1, and the line without its end.
    """
    return list(enumerate(re.split(r"\r\n|\r|\n", text), start=1))


def line_error(
    file: object, line: int, problem: str, remedy: str, what: str = "", **value: object
) -> InputError:
    """Return the error of a line of a file.

    Parameters
    ----------
    file : object
        The file.
    line : int
        Number of the line, from 1.
    problem, remedy : str
        As of `InputError`.
    what : str
        The column or the key in the line; empty for the whole line.
    **value
        `value` of the error, where there is one.

    Returns
    -------
    InputError
        To be raised.
    """
    key = f"line {line}, {what[:LONGEST_NAME]}" if what else f"line {line}"
    return InputError(problem, remedy, file=file, key=key, **value)


def parse_number(text: str) -> float | None:
    """Return the finite number that a text is.

    Parameters
    ----------
    text : str
        Digits with or without a decimal point and an exponent, without spaces; the exponent may
        begin with Fortran's d, as in 1.0D+00.

    Returns
    -------
    float or None
        The number; None for all else.
    """
    if len(text) > _LONGEST_NUMBER or not _NUMBER.fullmatch(text):
        return None
    number = float(text.lower().replace("d", "e"))
    return number if math.isfinite(number) else None


@dataclass(frozen=True, eq=False)
class Column:
    """Numbers of a file, and how a message names each of them."""

    name: str
    values: np.ndarray
    """The numbers, shape (n_rows,)."""
    keys: Sequence[str]
    """Where each number stands in the file, such as ``line 3, column cl``."""
    shown: Sequence[object]
    """Each number as it is written in the file."""
    file: object

    def refuse(self, wrong: np.ndarray, problem: str, remedy: str) -> None:
        """Refuse the first of the wrong values, if any.

        Parameters
        ----------
        wrong : numpy.ndarray of bool, shape (n_rows,)
            Which values are wrong; fewer than `n_rows` stand for the first ones.
        problem, remedy : str
            As of `InputError`.

        Raises
        ------
        InputError
            If any value is wrong.
        """
        for row in np.flatnonzero(wrong)[:1]:
            key, value = self.keys[row], self.shown[row]
            raise InputError(problem, remedy, file=self.file, key=key, value=value)

    def at(self, rows: np.ndarray) -> "Column":
        """Return the column of some rows.

        Parameters
        ----------
        rows : numpy.ndarray
            Their indices, in the order that they are to have.

        Returns
        -------
        Column
            The column.
        """
        keys, shown = ([texts[row] for row in rows] for texts in (self.keys, self.shown))
        return Column(self.name, self.values[rows], keys, shown, self.file)

    def check_rising(self, what: str, values: np.ndarray | None = None) -> None:
        """Refuse the first value that does not exceed the one before.

        Parameters
        ----------
        what : str
            What the values are, for the message.
        values : numpy.ndarray, shape (n_rows,), optional
            Numbers made of the column's, which count in their place.

        Raises
        ------
        InputError
            If the values do not increase strictly.
        """
        steps = np.diff(self.values if values is None else values, prepend=-np.inf)
        problem = f"does not exceed the value before: {what} must increase strictly"
        self.refuse(steps <= 0.0, problem, "sort them and remove duplicates")


def number_columns(
    rows: Sequence[Row],
    names: Sequence[str],
    file: object,
    wanted: Collection[str],
    where: str = "",
    remedy: str = "complete the row, or correct the number of rows if the file states one",
    parse: Callable[[str], float | None] = parse_number,
) -> dict[str, Column]:
    """Return columns of numbers of a text's rows.

    Parameters
    ----------
    rows : sequence of (int, sequence of str)
        Line number and cells of each row.
    names : sequence of str
        Names of all columns, from the first on.
    file : object
        The file, for messages.
    wanted : collection of str
        Names of the columns to return; those that `names` lacks are left out.
    where : str
        Words that identify these rows among others in the file.
    remedy : str
        What to do where a row has more or fewer cells than `names`.
    parse : callable
        Returns the number that a cell is, or None.

    Returns
    -------
    dict of str to Column
        The columns by name, in the order of `wanted`.

    Raises
    ------
    InputError
        If a row has more or fewer cells than `names`, or a cell is no number.
    """  # noqa: DOC501 - `line_error` returns an InputError
    for line, cells in rows:
        if len(cells) != len(names):
            problem = f"has {len(cells)} numbers where the table has {len(names)} columns"
            raise line_error(file, line, problem, remedy, value=" ".join(cells))
    columns = {}
    for name in wanted:
        if name in names:
            shown = [cells[names.index(name)].strip() for _, cells in rows]
            title = f"{where}, " if where else ""
            keys = [f"{title}line {line}, column {name}" for line, _ in rows]
            numbers = [parse(cell) for cell in shown]
            wrong = np.array([number is None for number in numbers], dtype=bool)
            values = np.array(numbers, dtype=float)
            columns[name] = Column(f"{title}{name}", values, keys, shown, file)
            plain = "write it with a decimal point, without a unit"
            columns[name].refuse(wrong, "must be a finite number", plain)
    return columns


def array_columns(file: object = "", where: str = "", **arrays: np.ndarray) -> dict[str, Column]:
    """Return arrays as columns, so that messages tell their numbers by rows.

    Parameters
    ----------
    file : object
        Where they come from, for messages.
    where : str
        Words that identify them among others there.
    **arrays : numpy.ndarray, shape (n_rows,)
        The arrays by the names of the columns.

    Returns
    -------
    dict of str to Column
        The columns by name.

    Raises
    ------
    InputError
        If a number is not finite.
    """
    columns, title = {}, f"{where}, " if where else ""
    for name, values in arrays.items():
        keys = [f"{title}row {row}, column {name}" for row in range(1, len(values) + 1)]
        column = Column(f"{title}{name}", np.asarray(values, float), keys, values.tolist(), file)
        column.refuse(~np.isfinite(column.values), "must be a finite number", "correct the row")
        columns[name] = column
    return columns


class Csv:
    """A CSV file (RFC 4180): its header, and its rows as (line number, cells) on iteration.

    Lines that are empty or begin with ``#`` or ``%`` are ignored.

    Parameters
    ----------
    text : str
        The content of the file.
    file : pathlib.Path
        The file, for messages.
    expected : str
        The header that is expected, for messages.
    known : collection of str
        Names of columns that are recognized in capital or small letters, and are there once.

    Raises
    ------
    InputError
        If the file is empty, its first line is no header, or it has a known column twice; on
        iteration, with the line, if a row has more or fewer cells than the header or is no CSV.
    """

    def __init__(self, text: str, file: Path, expected: str, known: Collection[str] = ()) -> None:
        self.file = file
        self.header: list[str] = []
        stream = io.TextIOWrapper(io.BytesIO(text.encode()), encoding="utf-8", newline="")
        self._rows = self._read(csv.reader(stream, strict=True))
        self.header_line, cells = next(self._rows, (1, []))
        names = {name.lower(): name for name in known}
        self.header = [names.get(cell.strip().lower(), cell.strip()) for cell in cells]
        begin = f"its first line is {expected}"
        if not cells:
            raise line_error(file, 1, "is empty", begin)
        if len(cells) == 1 and re.search("[;\t|]", cells[0]):
            remedy = "separate cells by commas and write decimals with a point"
            raise self.refuse("is not separated by commas", remedy)
        if any(_NUMBER.fullmatch(name) for name in self.header):
            raise self.refuse("has a number where the columns' names are expected", begin)
        for name in known:
            if self.header.count(name) > 1:
                problem, remedy = "appears twice in the header", "name each column once"
                raise line_error(file, self.header_line, problem, remedy, f"column {name}")

    def _read(self, reader) -> Iterator[Row]:
        """Yield the rows that are neither empty nor remarks."""
        try:
            for cells in reader:
                if not any(map(str.strip, cells)) or cells[0].lstrip()[:1] in ("#", "%"):
                    continue
                if self.header and len(cells) != len(self.header):
                    line, shown = reader.line_num, ",".join(cells)
                    problem = f"has {len(cells)} cells where the header has {len(self.header)}"
                    remedy = "give every column one cell and write decimals with a point"
                    raise line_error(self.file, line, problem, remedy, value=shown)
                yield reader.line_num, cells
        except csv.Error as error:
            problem = f"is not CSV ({error})"
            raise line_error(self.file, reader.line_num, problem, "correct the line") from None

    def __iter__(self) -> Iterator[Row]:
        return self._rows

    def refuse(self, problem: str, remedy: str) -> InputError:
        """Return the error of the header.

        Parameters
        ----------
        problem, remedy : str
            As of `InputError`.

        Returns
        -------
        InputError
            To be raised.
        """
        return line_error(self.file, self.header_line, problem, remedy, value=",".join(self.header))

    @cached_property
    def rows(self) -> list[Row]:
        """All rows, one at least.

        Returns
        -------
        list of (int, list of str)
            Line number and cells of each row.

        Raises
        ------
        InputError
            If there are none.
        """
        rows = list(self)
        if not rows:
            raise InputError("has a header but no rows", "add rows of numbers", file=self.file)
        return rows

    def one_of(self, names: Collection[str], quantity: str, needed: bool = True) -> str:
        """Return the one column that holds a quantity, whose unit its name has.

        Parameters
        ----------
        names : collection of str
            The names that it may have.
        quantity : str
            What it holds, for messages.
        needed : bool
            Whether it must be there.

        Returns
        -------
        str
            Its name; empty if there is none.

        Raises
        ------
        InputError
            If there are two, or none that is needed.
        """
        matches = [name for name in dict.fromkeys(self.header) if name in names]
        if len(matches) > 1:
            problem = f"has two columns for the {quantity}: {matches[0]} and {matches[1]}"
            raise self.refuse(problem, "keep one of them")
        if needed and not matches:
            remedy = f"name it {' or '.join(names)}, by its unit"
            raise self.refuse(f"lacks a column of the {quantity}", remedy)
        return matches[0] if matches else ""

    def check(self, names: Sequence[str], what: str) -> None:
        """Refuse a header that lacks a column.

        Parameters
        ----------
        names : sequence of str
            Columns that must be there.
        what : str
            What the table is, for messages.

        Raises
        ------
        InputError
            If a column is missing.
        """
        for name in names:
            if name not in self.header:
                remedy = did_you_mean(name, self.header)
                remedy += f"the {what} has the columns {','.join(names)}"
                raise self.refuse(f"lacks the column {name}", remedy)

    def columns(self, names: Sequence[str], what: str) -> dict[str, Column]:
        """Return columns of numbers.

        Parameters
        ----------
        names : sequence of str
            Columns that must be there.
        what : str
            What the table is, for messages.

        Returns
        -------
        dict of str to Column
            The columns by name.

        Raises
        ------
        InputError
            As of `check`, and if there are no rows, or a cell is no number.
        """
        self.check(names, what)
        return number_columns(self.rows, self.header, self.file, names)
