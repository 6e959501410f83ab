"""Many calls in worker processes: the one engine of batches, sweeps and studies, on `distributed`.

Workers are processes of this machine, or those of a scheduler elsewhere. Each has one thread, and
gets its next call when it is done with the last one, so that a worker that dies loses one call,
which another one makes again.
"""

import logging
import os
import platform
import re
import signal
import warnings
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from functools import cache
from importlib import metadata
from itertools import chain, islice
from pathlib import Path
from typing import Any

from hkt_mdo.errors import InputError, handling, program_version
from hkt_mdo.run.digest import of_package

SECONDS_BETWEEN_LOOKS = 10.0
"""After which it is looked for workers that are gone or new, where no task ends."""
PATIENCE = 5.0
"""Seconds in which a scheduler must answer."""
ALLOWED_FAILURES = 3
"""Deaths of its workers after which a call is given up: it may be what kills them."""


def in_processes(
    tasks: Iterable[tuple[Hashable, Callable[[], Any]]],
    jobs: int | None,
    ended: Callable[[Hashable, Any], None],
    scheduler: str | None = None,
    folder: Path | None = None,
) -> None:
    """Call tasks in `jobs` parallel processes, and ended(key, future) as each one ends.

    A task is taken from `tasks` when a worker is free for it, so that it may depend on what has
    ended. `scheduler`: address of a Dask scheduler, whose workers are used in place of `jobs`
    processes of this machine (None: one a core); `folder`: one that they have to see. An
    interruption (Ctrl-C or SIGTERM) drops the tasks that have not ended. Raises InputError if there
    is no scheduler, or a worker is not one of this program.
    """
    waiting = iter(tasks)
    first = list(islice(waiting, 1))  # without a task no worker is started
    if not first:
        return
    waiting = chain(first, waiting)
    interrupts = handling(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C does
    with interrupts, _client(jobs or os.cpu_count() or 1, scheduler) as client:
        from distributed import wait
        from distributed.protocol.pickle import dumps

        seen: set[str] = set()
        keys: dict[Any, Hashable] = {}
        while True:
            with _while_it_is_there(scheduler):
                threads = client.nthreads()
                if new := {*threads} - seen:
                    _check_workers(client, {name: threads[name] for name in new}, folder)
                    seen |= new
            for future in [future for future in keys if future.done()]:
                ended(keys.pop(future), future)
                future.release()
            if client.cluster is not None:  # one that died as it started has not come back
                client.cluster.scale(jobs or os.cpu_count() or 1)
            room = max(1, len(threads)) - len(keys)
            for key, task in islice(waiting, max(0, room)):
                keys[client.submit(_call, dumps(task), pure=False)] = key
            if not keys:
                return
            with _while_it_is_there(scheduler), suppress(TimeoutError):
                wait([*keys], timeout=SECONDS_BETWEEN_LOOKS, return_when="FIRST_COMPLETED")


@contextmanager
def _while_it_is_there(scheduler: str | None) -> Iterator[None]:
    """Tell as an InputError that a scheduler has gone."""
    try:
        yield
    except TimeoutError:
        raise
    except (CancelledError, OSError) as error:
        remedy = "start it again and give the same command: finished runs are kept"
        where = {"key": "scheduler", "value": scheduler}
        raise InputError("the scheduler went away", remedy, **where) from error


def outcome(future: Any) -> tuple[Any, str]:
    """Return what a task that has ended returned and no text, or None and why it failed."""
    try:
        return future.result(), ""
    except Exception as error:  # one that fails must not end the others
        return None, why_failed(error)


def why_failed(error: BaseException) -> str:
    """Return why a task failed, on one line: its error, or that its workers died."""
    if isinstance(error, InputError):
        return str(error)
    if type(error).__name__ == "KilledWorker":
        return f"its worker died {ALLOWED_FAILURES + 1} times: out of memory, or killed"
    return f"{type(error).__name__}: {error}"


@cache
def versions() -> dict[str, str]:
    """Return what a worker must have in common with its client."""
    source = f"{program_version()}, source {of_package().hex()[:12]}"
    packages = {name: metadata.version(name) for name in ("openmdao", "dymos", "numpy", "scipy")}
    return {"hkt_mdo": source, "Python": platform.python_version(), **packages}


def _call(task: bytes) -> Any:
    """Make a call in a worker; what cannot be unpickled there is an error of the call alone."""
    from distributed.protocol.pickle import loads

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return loads(task)()


def _check_workers(client: Any, threads: dict[str, int], folder: Path | None) -> None:
    """Refuse workers of another version, of several threads, or that do not see a folder."""
    introduced = client.run(_introduce, folder, workers=list(threads), on_error="return")
    ours, same = versions(), "start workers in the same environment as this program"
    for name, answer in introduced.items():
        if isinstance(answer, OSError):  # it has died meanwhile
            continue
        worker = f"the worker {name}"
        if isinstance(answer, BaseException):
            problem = f"{worker} has no such hkt_mdo ({why_failed(answer)})"
            raise InputError(problem, same, key="scheduler")
        theirs, sees = answer
        other = [f"{x} {theirs.get(x)} (here {ours[x]})" for x in ours if theirs.get(x) != ours[x]]
        if other:
            raise InputError(f"{worker} has {', '.join(other)}", same, key="scheduler")
        if not sees:
            remedy = "results are written by the workers: choose a folder that all of them share"
            raise InputError(f"{worker} does not see it", remedy, file=folder)
        if threads[name] > 1:
            problem = f"{worker} has {threads[name]} threads; a run needs its own process"
            raise InputError(problem, "start it with --nthreads 1", key="scheduler")


def _introduce(folder: Path | None) -> tuple[dict[str, str], bool]:
    """Return a worker's versions, and whether it sees a folder."""
    return versions(), folder is None or folder.is_dir()


@contextmanager
def _client(jobs: int, scheduler: str | None) -> Iterator[Any]:
    """Yield a client of a scheduler, by default of a new one with `jobs` workers here."""
    import dask
    from distributed import Client

    for name in ("distributed", "distributed.client"):  # what goes wrong is told as an InputError
        logging.getLogger(name).setLevel(logging.CRITICAL)
    where: dict[str, Any] = {"key": "scheduler", "value": scheduler}
    options: dict[str, Any] = {"address": scheduler, "timeout": PATIENCE}
    problem = "no scheduler answers"
    remedy = "start it (dask scheduler), or correct the address; tls:// needs certificates"
    if scheduler is None:
        where, problem = {"key": "workers"}, "cannot start"
        remedy = 'in a script, call under if __name__ == "__main__":; else give the command again'
        options = {
            "n_workers": jobs,
            "threads_per_worker": 1,
            "memory_limit": 0,  # a worker may take what there is, as a process may
            "dashboard_address": None,
            "silence_logs": logging.CRITICAL,
        }
    elif not re.match(r"(tcp|tls)://.", scheduler):
        raise InputError("is no address", "give tcp://HOST:PORT or tls://HOST:PORT", **where)
    settings = {
        "distributed.scheduler.allowed-failures": ALLOWED_FAILURES,
        "distributed.worker.profile.enabled": False,  # it stops a run every 10 ms
    }
    with dask.config.set(settings):
        try:
            client = Client(**options)
        except Exception as error:  # of sockets, certificates, names, a worker that is killed
            problem += f" ({type(error).__name__}: {error})"
            raise InputError(problem, remedy, **where) from error
        with client:
            yield client
