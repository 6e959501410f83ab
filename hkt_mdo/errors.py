"""The one error that is the user's to mend, and the interrupts that compiled code hides."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["InputError", "interrupts_of_compiled_code", "show"]

LONGEST_VALUE = 60  # characters that a message repeats
_UNSET = object()


def show(value: object) -> str:
    """Return `value` as one short line, the way a message quotes it, cut in the middle if long."""
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


class InputError(Exception):
    """Bad input from the user: one line naming the file, the key, the value and the remedy.

    Such as ``cases/a.yaml: rotor.radius = -1.4: must be greater than 0 m; give the tip radius``.
    `key` is the place in the file: a dotted key of a case, a line and column of a table. `value` is
    what was found there; not given where nothing was found.
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
        place = f"{self.key} = {self._shown}" if self.key and self._shown else self.key
        place = place or self._shown
        advice = "; ".join(part for part in (self.problem, self.remedy) if part)
        line = ": ".join(part for part in (self.file, place, advice) if part)
        return "".join(
            letter if letter.isprintable() else f"\\x{ord(letter):02x}" for letter in line
        )


@contextmanager
def interrupts_of_compiled_code() -> Iterator[None]:
    """Raise KeyboardInterrupt for the SystemError that hides one.

    A handler of signals that raises while code compiled by numba runs makes Python report that the
    code returned a result with an exception set; the exception is then the cause of the error.
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
