"""The command line, `hkt`: one module a family of commands.

What takes long to import waits inside the commands, so that help comes at once.
"""

import gc
import inspect
import io
import logging
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, get_args

import typer

from hkt_mdo.cli import case, parts, results, run
from hkt_mdo.errors import InputError, interrupts_of_compiled_code, program_version

__all__ = ["app", "main"]

app = typer.Typer(
    name="hkt",
    epilog=parts.EXIT_CODES,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="markdown",  # Rich's own markup would take [report] for a tag and leave it out
    invoke_without_command=True,
    pretty_exceptions_enable=False,
)
_PANELS = {
    "Write and check a case": (case.new, case.check, case.schema, case.n2),
    "Optimize": (run.run, run.sweep),
    "Look at results": (results.show, results.plot, results.report, results.compare),
    "Use a result": (results.simulate, results.export),
    "Data": (case.polar, case.resource),
}


def _documented(command: Callable[..., None]) -> str:
    """Return the help of a command, its docstring; the parameters there are that of its options."""
    text, _, parameters = inspect.cleandoc(command.__doc__ or "").partition("\n\nParameters\n")
    for name, meaning in re.findall(r"^(\w+)\n((?:    .*\n?)+)", parameters, re.MULTILINE):
        get_args(command.__annotations__[name])[1].help = " ".join(meaning.split())
    return re.sub(r"(?<!\n)\n(?!\n)", " ", text)  # a line end within a paragraph is a blank


for _panel, _commands in _PANELS.items():
    for _command in _commands:
        app.command(rich_help_panel=_panel, help=_documented(_command))(_command)


def _hkt(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version")] = False,
    extend: Annotated[list[Path] | None, typer.Option(metavar="FILE")] = None,
) -> None:
    """Control co-design of hydrokinetic turbines: blade and controller optimized together.

    A case is a short YAML file; a run of it writes a result folder; the other commands work on
    cases or results.

    Parameters
    ----------
    version
        Print the version and exit.
    extend
        Python file that adds control laws, flow profiles, limits or objectives, executed before the
        case is read; may be given several times.
    """
    parts.EXTENSIONS.set(tuple(extend or ()))
    if version:
        typer.echo(f"hkt_mdo {program_version()}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(Path(__file__).with_name("begin.txt").read_text(encoding="utf-8"), nl=False)


app.callback(help=_documented(_hkt))(_hkt)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code (`EXIT_CODES`); no error ends in a traceback.

    `arguments` is what follows ``hkt``, by default that of the process.
    """
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it prints where it keeps its cache
    gc.set_threshold(100_000, 50, 50)  # imported modules stay: to scan them often takes long
    # a path may hold what the terminal's encoding does not
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    rest, begin = [*(sys.argv[1:] if arguments is None else arguments)], []
    rest = [y for x in rest for y in (x.split("=", 1) if x.startswith("--extend=") else [x])]
    while "--extend" in rest[:-1]:  # wherever it stands it is an option of hkt
        at = rest.index("--extend")
        begin += rest[at : at + 2]
        del rest[at : at + 2]

    parts.SAVED.set(lambda: "nothing was saved")
    try:
        with warnings.catch_warnings(), interrupts_of_compiled_code():
            # those of libraries; OpenMDAO sets its own filters when it is imported
            warnings.showwarning = lambda *_, **__: None
            typer.main.get_command(app)(args=[*begin, *rest], prog_name="hkt")
        return 0
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        if code != parts.INTERRUPTED:
            return code
        text = parts.SAVED.get()()
    except KeyboardInterrupt:
        code, text = parts.INTERRUPTED, parts.SAVED.get()()
    except InputError as error:
        code, text = parts.BAD_INPUT, str(error)
    except OSError as error:
        file = f"{error.filename}: " if error.filename else ""
        reason = error.strerror or str(error) or type(error).__name__
        code, text = parts.BAD_INPUT, f"{file}cannot be read or written ({reason})"
    except MemoryError:
        code, text = parts.BAD_INPUT, "out of memory; give fewer phase.segments"
    except Exception as error:
        if os.environ.get("HKT_TRACEBACK"):
            raise
        what = f"{type(error).__name__}: {error}"
        code, text = parts.BUG, f"{what} (an error of this program; HKT_TRACEBACK=1 shows where)"
        if isinstance(error, ImportError) and "OPENMDAO_USE_MPI" in what:
            text = "the environment variable OPENMDAO_USE_MPI is set, and mpi4py cannot be imported"
            code, text = parts.BAD_INPUT, f"{text}; unset the variable, or install mpi4py"
    finally:
        if arguments is None:
            gc.freeze()  # the process ends: scanning all objects again takes most of a second
    parts.complain("interrupted" if code == parts.INTERRUPTED else "error", text)
    return code
