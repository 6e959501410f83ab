"""Common parts of the commands: options, reading, messages and tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text
from typer import Argument, BadParameter, Exit, Option, echo

if TYPE_CHECKING:
    from hkt_mdo.case import Case
    from hkt_mdo.results.solution import Solution
    from hkt_mdo.results.words import Row

_STYLES = {"warning": "yellow", "note": "dim", "failure": "red"}
BAD_INPUT, NO_SUCCESS, INTERRUPTED, BUG = 2, 3, 130, 1

EXIT_CODES = (
    "Exit codes: 0 done; 1 an error of this program; 2 bad input, or a file that cannot be read or "
    "written; 3 the run did not succeed, or with --strict a limit is broken (all files are still "
    "written); 130 interrupted by Ctrl-C."
)

_CASE = "Case file in YAML, such as cases/sine_quadratic.yaml; see hkt schema."
CaseFile = Annotated[Path, Argument(metavar="CASE", help=_CASE, show_default=False)]
_RESULT = "Result folder that hkt run has written."
ResultFolder = Annotated[Path, Argument(metavar="RESULT", help=_RESULT)]
_SET = (
    "Override a key of the case; may be given several times. The value is YAML, units included: "
    "--set rotor.radius=2 --set 'inflow.mean=150 cm/s' --set control.gain=null."
)
Overrides = Annotated[list[str] | None, Option("--set", metavar="SECTION.KEY=VALUE", help=_SET)]
Force = Annotated[bool, Option("--force", help="Replace existing files.")]
_FORM = "Print {}, in SI units, in place of the table; messages go to standard error."
Json = Annotated[bool, Option("--json", help=_FORM.format("JSON"))]
AsCsv = Annotated[bool, Option("--csv", help=_FORM.format("CSV"))]
_OUT = Option("--out", metavar="DIR", help="Folder to write to; created if needed.")
Folder = Annotated[Path, _OUT]
OutFolder = Annotated[Path | None, _OUT]
Jobs = Annotated[
    int | None, Option(min=1, max=256, help="Parallel processes.", show_default="one a core")
]

EXTENSIONS: ContextVar[tuple[Path, ...]] = ContextVar("extensions", default=())
"""The files of `hkt --extend`, of the command at work."""

SAVED: ContextVar[Callable[[], str]] = ContextVar("saved")
"""What is told of files if the command at work is interrupted."""


def read_case(file: Path, overrides: Iterable[str] | None) -> Case:
    """Return the case of a file, with its overrides."""
    from hkt_mdo.case import load_case

    return load_case(file, list(overrides or ()), extensions=EXTENSIONS.get())


def read_result(folder: Path) -> Solution:
    """Return the result in a folder."""
    from hkt_mdo.results.solution import Solution

    return Solution.load(folder, extensions=EXTENSIONS.get())


def complain(what: str, message: str) -> None:
    """Print one line to standard error, such as ``error: ...``."""
    line = "".join(letter if letter.isprintable() else " " for letter in message)
    echo(f"{what}: {line}", err=True)


def print_lines(lines: Iterable[object], err: bool = False) -> None:
    """Print files, or lines of text, each on a line of its own."""
    for line in lines:
        echo(str(line), err=err)


def failed(message: str) -> Exit:
    """Return the end of a command without success, after its message on standard error."""
    complain("error", message)
    return Exit(NO_SUCCESS)


def print_tables(tables: dict[str, list[Row]], as_json: bool = False, as_csv: bool = False) -> None:
    """Print rows below the titles of their tables, or as JSON or CSV with the title as `part`."""
    if one_form(as_json, as_csv):
        print_records(plain_rows(tables.items(), "part"), as_json)
        return
    console = Console(highlight=False)
    for title, rows in [table for table in tables.items() if table[1]]:
        cells = [(row.label or "-", row.text, _STYLES.get(row.severity, "")) for row in rows]
        if not console.is_terminal:  # a line each
            wide = max(len(label) for label, *_ in cells)
            echo("\n".join([f"\n{title}", *(f" {x:<{wide}}  {y}" for x, y, _ in cells)]))
            continue
        table = Table(box=None, show_header=False, pad_edge=True, padding=(0, 1))
        for label, text, style in cells:  # brackets in a text are no markup
            table.add_row(Text(label, style or "cyan", no_wrap=True), Text(text, style))
        console.print(Text(f"\n{title}", style="bold"))
        console.print(table)


def one_form(as_json: bool, as_csv: bool) -> bool:
    """Return whether --json or --csv is given; refuse both at once."""
    if as_json and as_csv:
        raise BadParameter("give one of --json and --csv")
    return as_json or as_csv


def plain_rows(tables: Iterable[tuple[str, list[Row]]], key: str) -> list[dict[str, Any]]:
    """Return rows as records of plain values, in their units; `key` is the table's name in each.

    Of several values, `value` is the smallest and `up_to` the largest; a text is a value as it is.
    """
    import numpy as np

    records = []
    for title, row in ((title, row) for title, rows in tables for row in rows):
        low = high = row.value
        if row.value is not None and not isinstance(row.value, str):
            low, high = float(np.min(row.value)), float(np.max(row.value))
        values = {"value": low, "up_to": None if low == high else high}
        where = {key: title, "quantity": row.label}
        records.append({**where, **values, "unit": row.unit, "note": row.note})
    return records


def print_records(records: list[dict[str, Any]], as_json: bool) -> None:
    """Print records of the same keys as JSON, else as CSV."""
    from hkt_mdo.files.table import csv_text
    from hkt_mdo.results.folder import to_json

    if as_json:
        echo(to_json(records))
    else:
        names = records[0] if records else ()
        echo(csv_text(names, (record.values() for record in records)), nl=False)
