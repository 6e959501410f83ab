"""The commands that look at a case's problem or at results: n2, show, plot, compare."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option, echo

from hkt_mdo.cli.parts import CaseFile, Extend, Overrides, ResultFolder, extensions

if TYPE_CHECKING:
    from rich.console import Console

    from hkt_mdo.results.solution import Solution


def n2(
    case: CaseFile,
    out: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="HTML file to write, replaced if it exists.",
            show_default="<name of the case>_n2.html",
        ),
    ] = None,
    overrides: Overrides = None,
    extend: Extend = None,
) -> None:
    """Write the N2 diagram of a case.

    The diagram is an HTML page that shows which component of the case's OpenMDAO problem feeds
    which. Nothing is optimized.
    """
    from hkt_mdo.case import load_case

    loaded = load_case(case, overrides or (), **extensions(extend))
    path = Path(f"{loaded.name}_n2.html") if out is None else out

    from hkt_mdo.run.run import write_n2

    write_n2(loaded, path)
    echo(str(path))


def show(result: ResultFolder, extend: Extend = None) -> None:
    """Print the figures of merit of a result.

    Exits with 0 for a run without success too: showing it succeeded.
    """
    from rich.console import Console

    from hkt_mdo.results.solution import Solution

    print_solution(Console(highlight=False), Solution.load(result, **extensions(extend)))


def plot(
    result: ResultFolder,
    out: Annotated[
        Path | None,
        Option(
            metavar="DIR",
            help="Folder of the figures, made if need be.",
            show_default="RESULT/figures",
        ),
    ] = None,
    formats: Annotated[
        list[str] | None,
        Option(
            "--format",
            metavar="NAME",
            help="File format, such as png, pdf or svg; may be given several times.",
            show_default="png",
        ),
    ] = None,
    extend: Extend = None,
) -> None:
    """Draw the figures of a result.

    They are blade, power_curve, operation and convergence, as far as the run got to their data.
    Prints the files that it wrote; files of the same names are replaced.
    """
    from hkt_mdo.errors import InputError
    from hkt_mdo.results.solution import Solution

    solution = Solution.load(result, **extensions(extend))

    from hkt_mdo.results.plots import save_figures

    written = save_figures(solution, out or result / "figures", formats or ("png",))
    if not written:
        raise InputError("holds no data to draw", "let the run come to its end", file=result)
    for path in written:
        echo(str(path))


def compare(
    results: Annotated[
        list[Path], Argument(metavar="RESULT...", help="Result folders, two or more.")
    ],
    out: Annotated[
        Path | None,
        Option(metavar="DIR", help="Folder of the figures; none are drawn without it."),
    ] = None,
    extend: Extend = None,
) -> None:
    """Compare results in a table and in overlaid figures.

    The table has the figures of merit side by side, and each energy relative to the largest.
    """
    from rich.console import Console
    from rich.table import Table

    from hkt_mdo.results.solution import Solution, summary_table

    solutions = [Solution.load(result, **extensions(extend)) for result in results]
    columns = [dict(summary_table(solution)) for solution in solutions]
    energies = [solution.summary.get("simulated_energy_J") for solution in solutions]
    best = max(energy or 0.0 for energy in energies)
    if best > 0.0:
        for column, energy in zip(columns, energies, strict=True):
            share = "" if energy is None else f"{100.0 * (energy / best - 1.0):+.4f} %"
            column["energy, to the best"] = share
    names = [result.resolve().name for result in results]
    if len(set(names)) < len(names):
        names = [str(result) for result in results]
    table = Table("", *names, box=None)
    for name in dict.fromkeys(key for column in columns for key in column):
        table.add_row(name, *(column.get(name, "") for column in columns))
    Console(highlight=False).print(table)
    if out is not None:
        from hkt_mdo.results.plots import save_figures

        for path in save_figures(solutions, out):
            echo(str(path))


def print_solution(console: Console, solution: Solution) -> None:
    """Print a result's figures of merit and the checks that it did not pass."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from hkt_mdo.results.solution import summary_table

    table = Table(box=box.SIMPLE, show_header=False)
    for what, value in summary_table(solution):
        table.add_row(Text(what), Text(value))  # as text: what stands in brackets is no markup
    for check in solution.failed_checks:
        table.add_row(Text("check not passed", style="bold"), Text(check))
    console.print(table)
