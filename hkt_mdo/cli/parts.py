"""What the commands share: options, exit codes, messages and tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option, echo

if TYPE_CHECKING:
    from rich.console import Console

BAD_INPUT, NO_SUCCESS, INTERRUPTED, BUG = 2, 3, 130, 1

EXIT_CODES = (
    "Exit codes: 0 done; 1 an error of this program; 2 bad input, or a file that cannot be read or "
    "written; 3 the run is no success (everything is written all the same); 130 interrupted by "
    "Ctrl-C."
)

CASE_HELP = "Case file in YAML, such as cases/sine_quadratic.yaml; see hkt schema."

CaseFile = Annotated[Path, Argument(metavar="CASE", help=CASE_HELP)]
ResultFolder = Annotated[
    Path, Argument(metavar="RESULT", help="Result folder that hkt run has written.")
]
Overrides = Annotated[
    list[str] | None,
    Option(
        "--set",
        metavar="SECTION.KEY=VALUE",
        help="Override a key of the case; may be given several times. The value is YAML, units "
        "included: --set rotor.radius=2 --set 'inflow.mean=150 cm/s' --set control.gain=null.",
    ),
]
Extend = Annotated[
    list[Path] | None,
    Option(
        metavar="FILE",
        help="Python file that adds control laws, flow profiles or limits, executed before the "
        "case is read; may be given several times.",
    ),
]
Force = Annotated[bool, Option("--force", help="Replace files that are there already.")]
CaseFolder = Annotated[
    Path, Option("--cases", metavar="DIR", help="Folder of the shipped case files.")
]
Jobs = Annotated[
    int | None, Option(min=1, max=256, help="Parallel processes.", show_default="one a core")
]


def extensions(files: Sequence[Path] | None) -> dict[str, Any]:
    """Return the keyword argument that passes the files of --extend on; none without them."""
    return {"extensions": list(files)} if files else {}


def complain(what: str, message: str) -> None:
    """Print one line to standard error, such as ``error: ...``."""
    line = "".join(letter if letter.isprintable() else " " for letter in message)
    echo(f"{what}: {line}", err=True)


def print_rows(console: Console, rows: Iterable[tuple[str, str]], title: str) -> None:
    """Print rows of a name and a text below a title; brackets in them are no markup."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=True, padding=(0, 1))
    for what, text in rows:
        table.add_row(Text(what, no_wrap=True), Text(text))
    console.print(Text(f"\n{title}", style="bold"))
    console.print(table)
