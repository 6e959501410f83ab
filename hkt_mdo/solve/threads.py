"""One BLAS thread while any run of this process is at work."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

from threadpoolctl import threadpool_limits

_lock = Lock()
_at_work: list[threadpool_limits] = []


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold BLAS to one thread: matrices are small, and threads cost more time than they save.

    The limit is the process's. The first of several runs sets it and the last one lifts it; if each
    run did both, one would lift it while others are at work, or leave it behind.
    """
    with _lock:
        _at_work.append(_at_work[0] if _at_work else threadpool_limits(1))
    try:
        yield
    finally:
        with _lock:
            limits = _at_work.pop()
            if not _at_work:
                limits.restore_original_limits()
