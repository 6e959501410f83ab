"""The error of bad input, which the user can correct, and interrupts that compiled code hides."""

import difflib
import reprlib
import signal
import threading
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

LONGEST_VALUE = 60
"""Most characters of a value that a message repeats, so that it stays one line."""

LONGEST_GUESS = 100
"""Most characters of a name that are compared with others: the comparison is quadratic in them."""

_UNSET = object()


def show(value: object) -> str:
    """Return a value as one short line, the way a message quotes it.

    Parameters
    ----------
    value : object
        What was given.

    Returns
    -------
    str
        Its printed form, cut in the middle beyond `LONGEST_VALUE` characters.
    """
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    short = reprlib.Repr()
    short.maxstring = short.maxother = short.maxlong = LONGEST_VALUE
    short.maxlevel, short.maxdict, short.maxlist, short.maxtuple = 2, 4, 10, 10
    try:
        text = short.repr(value)
    except ValueError:  # an integer of thousands of digits has no decimal form
        text = f"a value of type {type(value).__name__}"
    if len(text) > LONGEST_VALUE:
        half = (LONGEST_VALUE - 3) // 2
        text = f"{text[:half]}...{text[-half:]}"
    return text


def did_you_mean(name: str, names: Collection[str]) -> str:
    """Return the beginning of a remedy that offers the nearest of the known names, or a longer one.

    Parameters
    ----------
    name : str
        An unknown name.
    names : collection of str
        The known names.

    Returns
    -------
    str
        A question and a space after it; empty if no known name is near.
    """
    longer = [key for key in names if key.startswith(f"{name}_")]
    near = longer or difflib.get_close_matches(name[:LONGEST_GUESS], names, n=1)
    return f"did you mean {near[0]}? " if near else ""


def needed(module: str, remedy: str, what: str = "", **location: Any) -> Any:
    """Return a module of a package that may not be installed.

    Parameters
    ----------
    module : str
        Its full name.
    remedy : str
        How to get it, or what to do without.
    what : str
        What needs it, and a space.
    **location : Any
        Where the need comes from, as `InputError` takes it.

    Returns
    -------
    module
        The module.

    Raises
    ------
    InputError
        If it cannot be imported.
    """
    try:
        return import_module(module)
    except ImportError:
        problem = f"{what}needs the package {module.partition('.')[0]}, which is not installed"
        raise InputError(problem, remedy, **location) from None


def install(extra: str) -> str:
    """Return the command that installs an extra of this package; in a checkout, from there.

    Parameters
    ----------
    extra : str
        Name of the extra in ``pyproject.toml``.

    Returns
    -------
    str
        A line for a shell.
    """
    root = Path(__file__).parents[1]
    checkout = (root / "pyproject.toml").is_file()
    return f"pip install -e '{root}[{extra}]'" if checkout else f"pip install 'hkt_mdo[{extra}]'"


def program_version() -> str:
    """Return the version of this program, as it is installed.

    Returns
    -------
    str
        Such as 0.2.0; "unknown" where it runs without being installed.
    """
    from importlib import metadata  # here, so that an error costs no import

    versions = (distribution.version for distribution in metadata.distributions(name="hkt_mdo"))
    return next(versions, "unknown")


class InputError(Exception):
    """Bad input from the user: one line naming the file, the key, the value and the remedy.

    Such as ``cases/a.yaml: rotor.radius = -1.4: must be greater than 0 m; give the tip radius``.

    Parameters
    ----------
    problem : str
        What is wrong.
    remedy : str
        What the user can do.
    file : object
        The file, if there is one.
    key : str
        Where in the file: a dotted key of a case, a line and column of a table.
    value : object
        What was given there; left out where nothing was given.
    """

    def __init__(
        self,
        problem: str,
        remedy: str = "",
        *,
        file: object = "",
        key: str = "",
        value: object = _UNSET,
    ) -> None:
        super().__init__(problem, remedy)
        self.problem = problem
        self.remedy = remedy
        self.file = "" if file is None else str(file)
        self.key = key
        self.value = None if value is _UNSET else value
        self._shown = "" if value is _UNSET else show(value)

    def __str__(self) -> str:
        """Return the message, one printable line."""
        entry = " = ".join(filter(None, (self.key, self._shown)))
        advice = "; ".join(filter(None, (self.problem, self.remedy)))
        line = ": ".join(filter(None, (self.file, entry, advice)))
        return "".join(x if x.isprintable() else f"\\x{ord(x):02x}" for x in line)


@contextmanager
def interrupts_of_compiled_code() -> Iterator[None]:
    """Raise KeyboardInterrupt for the SystemError that hides one.

    A handler of signals that raises while code compiled by numba runs makes Python report that the
    code returned a result with an exception set; the exception is then the cause of the error.

    Raises
    ------
    KeyboardInterrupt
        In place of a SystemError that an interrupt has caused; any other error passes through.
    """
    try:
        yield
    except SystemError as error:
        cause: BaseException | None = error
        while isinstance(cause, SystemError):
            cause = cause.__cause__ or cause.__context__
        if isinstance(cause, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise


@contextmanager
def handling(number: int, handler: Callable) -> Iterator[None]:
    """Give a signal another handler; in another thread than the main one nothing is changed.

    Parameters
    ----------
    number : int
        The signal, such as `signal.SIGTERM`.
    handler : callable
        Called with the signal and the frame.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.signal(number, before or signal.SIG_DFL)
