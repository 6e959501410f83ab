"""Writing a result folder: one run at a time, and every file appears complete or not at all."""

import re
import sqlite3
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import pydantic_core

from hkt_mdo.errors import InputError
from hkt_mdo.files.table import csv_text, write_files

MARKER = ".hkt_result"
"""The file by which a run marks a folder as its own; without it nothing there is replaced."""

_MARKED = "Written by a run of hkt_mdo. hkt run --force replaces the files of a run, and no others."
_WRITTEN = (
    r"((summary|iterate)\.json|case\.yaml|n2\.html|(solution|history(_\d+)?)\.db(-journal)?"
    r"|((trajectory|simulation|loads|year){0}|coefficients|power_curve|blade|convergence)\.csv"
    r"|figures/(blade|coefficients|(operation|limits|year){0}|power_curve|schedule|loads|convergence)"
    r"\.(png|pdf))(\.part)?"
)
"""Pattern of the files of a run, older ones too; in braces, the endings of those of a scenario."""


class InUseError(InputError):
    """Another run is using the folder."""


@contextmanager
def usable(out: Path):
    """Raise an InputError that says why a folder cannot be read or written."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        reason = getattr(error, "strerror", None) or error
        problem = f"--out {out}: cannot be written: {reason}; choose another folder"
        raise InputError(problem) from error


def check_folder(out: Path, force: bool) -> None:
    """Raise an InputError if a result folder must not be used; nothing is written."""
    with usable(out):
        names = {path.name for path in out.iterdir()} if out.exists() else set()
    # a run killed before it wrote its case leaves only these, which hold nothing of value
    if not names - {"lock", "lock-journal", MARKER, f"{MARKER}.part", "case.yaml.part"}:
        return
    if not force:
        remedy = "choose another one, give --force to replace it, or --resume to go on with it"
        raise InputError(f"--out {out}: folder exists; {remedy}")
    if MARKER not in names:
        problem = f"--out {out}: holds no earlier result that a run has marked by {MARKER}"
        remedy = "choose another folder, or delete this one yourself if it is an older result"
        raise InputError(f"{problem}, which --force replaces", remedy)


@contextmanager
def locked(out: Path):
    """Create a result folder if necessary, and lock it against other runs.

    The lock is SQLite's: it is released when the process ends for any reason, on every system. A
    folder that was made and has got no other file is taken away again.
    """
    lock, made = out / "lock", [path for path in (out, *out.parents) if not path.exists()]
    with usable(out):
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
        connection = sqlite3.connect(lock, timeout=0.0, isolation_level=None)
    try:
        connection.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        connection.close()
        problem = f"--out {out}: another run is using it ({error})"
        raise InUseError(problem, "wait until it ends or choose another folder") from error
    try:
        yield
    finally:
        with suppress(OSError):  # Windows does not delete an open file
            lock.unlink()
        connection.close()
        with suppress(OSError):
            for path in made:
                path.rmdir()


def claim(out: Path, scenarios: Sequence[str] = ()) -> None:
    """Mark a folder as a run's, and delete what an earlier run wrote; other files stay.

    `summary.json` goes first: interrupted at any point, this leaves no success, and still a folder
    that `--force` replaces.

    Parameters
    ----------
    out : Path
        The folder.
    scenarios : sequence of str
        Names in the files of a run with several scenarios. The mark keeps them, so that the next
        run knows which files are this one's.
    """
    figures, mark = out / "figures", out / MARKER
    with usable(out):
        before = mark.read_text("utf-8", errors="replace").splitlines()[1:] if mark.exists() else []
        names = [name for name in before if re.fullmatch(r"\w+", name)]
        write_files({mark: "\n".join([_MARKED, *dict.fromkeys([*names, *scenarios])]) + "\n"})
        written = re.compile(_WRITTEN.format(f"({''.join(f'|_{name}' for name in names)})"))
        # a link to a folder may lead to files that no run wrote
        folders = [out, figures] if figures.is_dir() and not figures.is_symlink() else [out]
        files = [path for folder in folders for path in folder.iterdir() if not path.is_dir()]
        for path in sorted(files, key=lambda path: path.name != "summary.json"):
            if written.fullmatch(path.relative_to(out).as_posix()):
                path.unlink()
        write_files({mark: "\n".join([_MARKED, *scenarios]) + "\n"})
        with suppress(OSError):  # it holds a file of the user
            figures.rmdir()


def write_json(path: Path, data) -> None:
    """Write data as JSON (`to_json`)."""
    write_files({path: to_json(data) + "\n"})


def to_json(data) -> str:
    """Return data as JSON: arrays as lists, null in place of NaN and infinity."""
    plain = {"inf_nan_mode": "null", "fallback": lambda value: value.tolist()}
    return pydantic_core.to_json(data, indent=2, **plain).decode()


def write_csv(path: Path, table: Mapping[str, Iterable[float]]) -> None:
    """Write columns of numbers, to ten digits, below their names."""
    rows = ([f"{float(value):.10g}" for value in row] for row in zip(*table.values(), strict=True))
    write_files({path: csv_text(table, rows)})
