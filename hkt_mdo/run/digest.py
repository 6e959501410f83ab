"""One digest of everything but the case that decides a result: files and source code."""

import inspect
from collections.abc import Iterator
from functools import cache
from hashlib import file_digest, sha256
from pathlib import Path

from hkt_mdo.case import Case
from hkt_mdo.sections import leaves

_PACKAGE = Path(__file__).parents[1]


def digest(case: Case) -> str:
    """Return the digest of the package, and of the extensions and files that a case names.

    Its paths are absolute.
    """
    total = sha256(of_package())
    paths = (Path(value) for _, value, _ in leaves(case) if isinstance(value, str))
    files = sorted(path for path in paths if path.is_absolute() and path.is_file())
    for path in (*_extensions(case), *files):
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
    for entry in case.extensions:
        try:
            yield Path(entry if isinstance(entry, str | Path) else inspect.getfile(entry))
        except (OSError, TypeError):  # typed at a prompt
            continue
