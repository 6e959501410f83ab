"""Compilation by numba, with a cache on the disk where one can be written."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import njit

SOURCES = sum(path.stat().st_mtime_ns for path in Path(__file__).parent.rglob("*.py"))
"""Changes with each file of the package: numba's own cache sees changes of a function's own file
only, not of functions and constants that it has compiled into it from others."""


def compiled(**options: Any) -> Callable[[Callable], Any]:
    """Return a decorator that compiles a function.

    Without the cache, each process compiles anew, which takes some seconds.

    Parameters
    ----------
    **options
        Options of `numba.njit`, such as `parallel`.

    Returns
    -------
    callable
        A decorator that returns numba's dispatcher of the function.
    """

    def decorate(function: Callable) -> Any:
        try:
            dispatcher = njit(function, cache=True, **options)
        except RuntimeError:  # neither the installation nor the user's home can be written
            return njit(function, **options)
        cache = dispatcher._cache
        cache._cache_file._source_stamp = cache._cache_file._source_stamp, SOURCES
        save = cache.save_overload

        def save_if_possible(*arguments: Any) -> None:
            with suppress(OSError):  # such as of a full disk
                save(*arguments)

        cache.save_overload = save_if_possible
        return dispatcher

    return decorate
