"""A result folder from the side of the run that writes it.

Files appear whole or not at all, and one run at a time holds a folder.
"""

import csv
import json
import shutil
import sqlite3
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from hkt_mdo.errors import InputError


def check_folder(out: Path, force: bool) -> None:
    """Refuse a result folder that must not be used; nothing is written."""
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out}: is a file; choose another folder")
    try:
        # what a run leaves that was killed before it wrote its case is nobody's loss
        names = {path.name for path in out.iterdir()} if out.is_dir() else set()
    except OSError as error:
        raise _unwritable(out, error) from error
    if not names - {"lock", "case.yaml.part"}:
        return
    if not force:
        raise InputError(
            f"--out {out}: folder exists; choose another one, give --force to replace it, or "
            "--resume to go on with it"
        )
    if "case.yaml" not in names:
        raise InputError(f"--out {out}: holds no earlier result; --force replaces only results")


@contextmanager
def locked(out: Path):
    """Hold a result folder, made if need be, against other runs.

    SQLite's lock vanishes with its process, however that ends, on every system.
    """
    lock = out / "lock"
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
        connection = sqlite3.connect(lock, timeout=0.0, isolation_level=None)
    except (OSError, sqlite3.Error) as error:
        raise _unwritable(out, error) from error
    try:
        connection.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        connection.close()
        raise InputError(
            f"--out {out}: another run is at work there ({error}); wait for its end or choose "
            "another folder"
        ) from error
    try:
        yield
    finally:
        with suppress(OSError):  # Windows keeps open files
            lock.unlink()
        connection.close()


def clear(out: Path) -> None:
    """Empty a folder of an earlier result: its verdict first, last what tells that it is one."""
    last = {"summary.json": 0, "case.yaml": 2}
    try:
        for path in sorted(out.iterdir(), key=lambda path: last.get(path.name, 1)):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            elif path.name != "lock":
                path.unlink()
    except OSError as error:
        raise _unwritable(out, error) from error


def _unwritable(out, error):
    reason = getattr(error, "strerror", None) or error
    return InputError(f"--out {out}: cannot be written: {reason}; choose another folder")


def write_text(path: Path, text: str) -> None:
    """Replace a file in one step, so that no reader ever sees half of it."""
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)


def write_json(path: Path, data) -> None:
    """Write data as JSON; what JSON cannot say (NaN, infinity) becomes null."""

    def plain(value):
        if isinstance(value, np.ndarray):
            return value.tolist()
        if isinstance(value, np.generic):
            return value.item()
        raise TypeError(type(value).__name__)

    write_text(path, json.dumps(_finite(data), indent=2, default=plain) + "\n")


def _finite(value):
    """Replace what JSON cannot say (NaN, infinity) by null."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float | np.floating) and not np.isfinite(value):
        return None
    return value


def write_csv(path: Path, header, rows) -> None:
    """Write rows of numbers, to ten digits, below a header."""
    part = path.with_name(path.name + ".part")
    with part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([[f"{float(value):.10g}" for value in row] for row in rows])
    part.replace(path)
