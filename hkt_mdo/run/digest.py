"""One digest of everything but the case that decides a result: files and source code."""

import inspect
from collections.abc import Iterator
from functools import cache
from hashlib import file_digest, sha256
from pathlib import Path

from hkt_mdo.case import Case

_PACKAGE = Path(__file__).parents[1]


def digest(case: Case) -> str:
    """Return the digest of the package, and of the extensions and files that a case names."""
    total = sha256(of_package())
    for path in (*_extensions(case), *sorted(_files(case.model_dump(mode="json")))):
        total.update(_of_file(path))
    return total.hexdigest()


@cache
def of_package() -> bytes:
    """Return the digest of source code and shipped data."""
    total = sha256()
    for path in sorted(_PACKAGE.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            total.update(path.relative_to(_PACKAGE).as_posix().encode() + _of_file(path))
    return total.digest()


def _of_file(path: Path) -> bytes:
    with path.open("rb") as file:
        return file_digest(file, "sha256").digest()


def _extensions(case: Case) -> Iterator[Path]:
    """Yield the source files of a case's extensions."""
    for each in case.extensions:
        try:
            yield Path(each if isinstance(each, str | Path) else inspect.getfile(each))
        except (OSError, TypeError):  # typed at a prompt
            continue


def _files(value: object) -> Iterator[Path]:
    """Yield the files that a case names: its paths are absolute."""
    if isinstance(value, dict | list):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _files(each)
    elif isinstance(value, str) and Path(value).is_absolute() and Path(value).is_file():
        yield Path(value)
