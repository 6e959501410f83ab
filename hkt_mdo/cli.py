"""The command line, `hkt`: run a case, look at a result.

What takes long to import waits inside the commands, so that help comes at once.
"""

from __future__ import annotations

import io
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from hkt_mdo.results import Solution

__all__ = ["app", "main"]

BAD_INPUT, NO_SUCCESS, INTERRUPTED, BUG = 2, 3, 130, 1

_EXIT_CODES = (
    "Exit codes: 0 done; 1 an error of this program; 2 bad input, or a file that cannot be read or "
    "written; 3 the run is no success (everything is written all the same); 130 interrupted by "
    "Ctrl-C."
)

_SECONDS_BETWEEN_LINES = 5.0

app = typer.Typer(
    name="hkt",
    help="Control co-design of hydrokinetic turbines: blade and controller optimized together.\n\n"
    "A case is a short YAML file; a run of it leaves a result folder; the other commands look at "
    f"either.\n\n{_EXIT_CODES}",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

_Case = Annotated[
    Path,
    typer.Argument(
        metavar="CASE", help="Case file in YAML, such as cases/sine_quadratic.yaml; see hkt schema."
    ),
]
_Result = Annotated[
    Path, typer.Argument(metavar="RESULT", help="Result folder that hkt run has written.")
]
_Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="SECTION.KEY=VALUE",
        help="Override a key of the case; may be given several times. The value is YAML, units "
        "included: --set rotor.radius=2 --set 'inflow.mean=150 cm/s' --set control.gain=null.",
    ),
]


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib import metadata

        try:
            number = metadata.version("hkt_mdo")
        except metadata.PackageNotFoundError:  # run from a source tree
            number = "(not installed)"
        typer.echo(f"hkt_mdo {number}")
        raise typer.Exit


@app.callback()
def _hkt(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            is_eager=True,
            callback=_print_version,
            help="Print the version and leave.",
        ),
    ] = False,
) -> None:
    pass


@app.command(
    short_help="Run a case and write a result folder.",
    help="Optimize a case, integrate the result independently, judge it and write a result folder."
    "\n\nThe folder gets case.yaml (every default written out), summary.json (figures of merit and "
    "checks), trajectory.csv, simulation.csv, power_curve.csv, convergence.csv, solution.db and "
    "history.db (OpenMDAO recorders), n2.html and figures/. Options override --set, --set "
    f"overrides the file.\n\n{_EXIT_CODES}",
)
def run(
    case: _Case,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Result folder, made anew.",
            show_default="results/<name of the case>",
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace an earlier result in the folder.")
    ] = False,
    optimizer: Annotated[
        str | None,
        typer.Option(
            "--optimizer",
            metavar="NAME",
            help="IPOPT, SLSQP or SNOPT: sets driver.optimizer.",
            show_default="as the case says, else IPOPT",
        ),
    ] = None,
    package: Annotated[
        str | None,
        typer.Option(
            "--package",
            metavar="NAME",
            help="What provides the optimizer; auto, pyoptsparse, casadi (IPOPT alone) or scipy "
            "(SLSQP alone): sets driver.package.",
            show_default="as the case says, else auto",
        ),
    ] = None,
    segments: Annotated[
        int | None,
        typer.Option(
            "--segments",
            metavar="N",
            help="Number of collocation segments: sets phase.segments.",
            show_default="as the case says, else 60",
        ),
    ] = None,
    overrides: _Set = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
    no_figures: Annotated[
        bool, typer.Option("--no-figures", help="Leave the figures out; hkt plot draws them.")
    ] = False,
) -> None:
    """Run a case; the help stands above, where the exit codes can be filled in."""
    from hkt_mdo.case import load_case

    given = {"driver.optimizer": optimizer, "driver.package": package, "phase.segments": segments}
    settings = [f"{key}={value}" for key, value in given.items() if value is not None]
    loaded = load_case(case, [*(overrides or ()), *settings])
    folder = Path("results") / loaded.name if out is None else out

    from rich.console import Console

    console = Console(quiet=quiet, highlight=False)
    before = _stamp(folder)
    try:
        with _progress(console, loaded.name) as progress:
            from hkt_mdo.run import run_case

            solution = run_case(
                loaded, folder, force=force, progress=progress, figures=not no_figures
            )
    except KeyboardInterrupt:
        _complain("interrupted", _saved(folder, before))
        raise typer.Exit(INTERRUPTED) from None
    _print_table(console, solution)
    console.print(f"Results: {folder}", markup=False, soft_wrap=True)
    if not solution.success:
        _complain("error", f"no success: {solution.message or 'the run gives no reason'}")
        if quiet:
            _complain("error", f"what was found is in {folder}")
        raise typer.Exit(NO_SUCCESS)


@app.command(
    short_help="Write the N2 diagram of a case.",
    help="Write the N2 diagram of a case's OpenMDAO problem: an HTML page that shows what feeds "
    f"what. Nothing is optimized.\n\n{_EXIT_CODES}",
)
def n2(
    case: _Case,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="HTML file to write, replaced if it exists.",
            show_default="<name of the case>_n2.html",
        ),
    ] = None,
    overrides: _Set = None,
) -> None:
    """Write the N2 diagram."""
    from hkt_mdo.case import load_case

    loaded = load_case(case, overrides or ())
    path = Path(f"{loaded.name}_n2.html") if out is None else out

    from hkt_mdo.run import write_n2

    write_n2(loaded, path)
    typer.echo(str(path))


@app.command(
    short_help="Draw the figures of a result.",
    help="Draw the figures of a result: blade, power_curve, operation and convergence, as far as "
    "the run got to their data. Prints the files that it wrote; files of the same names are "
    f"replaced.\n\n{_EXIT_CODES}",
)
def plot(
    result: _Result,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder of the figures, made if need be.",
            show_default="RESULT/figures",
        ),
    ] = None,
    formats: Annotated[
        list[str] | None,
        typer.Option(
            "--format",
            metavar="NAME",
            help="File format, such as png, pdf or svg; may be given several times.",
            show_default="png and pdf",
        ),
    ] = None,
) -> None:
    """Draw the figures of a result."""
    from hkt_mdo.errors import InputError
    from hkt_mdo.results import Solution

    solution = Solution.load(result)

    from hkt_mdo.plots import save_figures

    written = save_figures(solution, out or result / "figures", formats or ("png", "pdf"))
    if not written:
        raise InputError("holds no data to draw", "let the run come to its end", file=result)
    for path in written:
        typer.echo(str(path))


@app.command(
    short_help="Print the figures of merit of a result.",
    help="Print the figures of merit of a result again. Exits with 0 for a run without success "
    f"too: showing it succeeded.\n\n{_EXIT_CODES}",
)
def show(result: _Result) -> None:
    """Print the table of a result."""
    from rich.console import Console

    from hkt_mdo.results import Solution

    _print_table(Console(highlight=False), Solution.load(result))


@app.command(
    short_help="Print the JSON schema of a case file.",
    help="Print the JSON schema of a case file: every key with its meaning, default, unit and "
    "range. An editor that is given it checks and completes cases.",
)
def schema() -> None:
    """Print the JSON schema."""
    import json

    from hkt_mdo.case import case_json_schema

    typer.echo(json.dumps(case_json_schema(), indent=2))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; no error ends in a traceback.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows ``hkt``; by default the arguments of the process.

    Returns
    -------
    int
        0 done, 1 an error of this program, 2 bad input, 3 no success, 130 interrupted.
    """
    # matrices here are small: threads cost more than they give; read when NumPy is imported
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    os.environ.setdefault("OPENMDAO_REPORTS", "0")

    # a path may hold what the terminal's encoding does not
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")

    from hkt_mdo.errors import InputError

    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("default", category=UserWarning, module=r"hkt_mdo\b")
            warnings.showwarning = _show_warning
            typer.main.get_command(app)(args=arguments, prog_name="hkt")
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    except KeyboardInterrupt:
        _complain("interrupted", "nothing was saved")
        return INTERRUPTED
    except InputError as error:
        _complain("error", str(error))
        return BAD_INPUT
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        reason = error.strerror or str(error) or type(error).__name__
        _complain("error", f"{place}cannot be read or written ({reason})")
        return BAD_INPUT
    except MemoryError:
        _complain("error", "out of memory; give fewer phase.segments")
        return BAD_INPUT
    except Exception as error:
        if os.environ.get("HKT_TRACEBACK"):
            raise
        what = f"{type(error).__name__}: {error}"
        _complain("error", f"{what} (an error of this program; HKT_TRACEBACK=1 shows where)")
        return BUG
    return 0


# Parts --------------------------------------------------------------------------------------------


def _complain(what: str, message: str) -> None:
    line = "".join(letter if letter.isprintable() else " " for letter in message)
    typer.echo(f"{what}: {line}", err=True)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: object = None,
    line: str | None = None,
) -> None:
    """Print the warnings of this package; what the libraries warn of is not for its users.

    A filter would not last: OpenMDAO sets its own when it is imported.
    """
    ours = Path(filename).is_relative_to(Path(__file__).parent)
    library = category.__module__.partition(".")[0] in ("openmdao", "dymos", "numpy", "scipy")
    if ours and issubclass(category, UserWarning) and not library:
        _complain("warning", str(message))


@contextmanager
def _progress(console: Console, name: str) -> Iterator[Callable[[int, float, float], None] | None]:
    """Yield what a run reports to: a live line on a terminal, else a line every few seconds."""
    if console.quiet:
        yield None
        return
    if console.is_terminal:
        with console.status(f"{name}: preparing") as status:
            yield lambda *state: status.update(f"{name}: {_state(*state)}")
        return
    last = time.monotonic()

    def report(count: int, energy: float, infeasibility: float) -> None:
        nonlocal last
        if time.monotonic() - last >= _SECONDS_BETWEEN_LINES:
            last = time.monotonic()
            typer.echo(f"{name}: {_state(count, energy, infeasibility)}")

    yield report


def _state(count: int, energy: float, infeasibility: float) -> str:
    return f"evaluation {count}, energy {energy:.0f} J, infeasibility {infeasibility:.1e}"


def _print_table(console: Console, solution: Solution) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from hkt_mdo.results import summary_table

    table = Table(box=box.SIMPLE, show_header=False)
    for what, value in summary_table(solution):
        table.add_row(Text(what), Text(value))  # as text: what stands in brackets is no markup
    for check in solution.failed_checks:
        table.add_row(Text("check not passed", style="bold"), Text(check))
    console.print(table)


def _stamp(folder: Path) -> tuple[int, int] | None:
    """Return what tells one summary from another; None where there is none."""
    try:
        state = (folder / "summary.json").stat()
    except OSError:
        return None
    return state.st_mtime_ns, state.st_ino


def _saved(folder: Path, before: tuple[int, int] | None) -> str:
    """Return what an interrupted run saved, and where."""
    after = _stamp(folder)
    if after is None or after == before:
        return "nothing was saved"
    names = sorted(path.name for path in folder.iterdir())
    return f"what there was is saved in {folder}: {', '.join(names)}"
