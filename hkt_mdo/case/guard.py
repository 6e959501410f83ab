"""The guard of extensions: an error in a user's class is reported as such, with its place.

An error in a method or property of an extension, or a result that no formula may have, is an
`InputError` that names the class, its file, the method and what is wrong.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cached_property, wraps
from inspect import getattr_static, signature
from traceback import extract_tb
from types import FunctionType
from typing import Any

import numpy as np

from hkt_mdo.dynamics.aggregates import Aggregate
from hkt_mdo.dynamics.formulas import STEP, Formula
from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.errors import InputError, show
from hkt_mdo.quantities import is_over_time

_FINITE: ContextVar[bool] = ContextVar("finite", default=True)
OPTIONAL = "length", "highest_frequency", "bound"
"""Properties that may be None."""
NUMBERS = *OPTIONAL, "mean_speed", "last_time"
ROWS = "features", "lower", "upper", "rows", "fit", "best_unknowns"
"""Methods and properties that may have results of any length."""
INFINITE = "lower", "upper", "features", "last_time"
COMPLEX = (
    "let it take complex numbers, for derivatives by complex step: np.abs, math, float() and .real "
    "drop the imaginary part; write np.sqrt(x * x) for np.abs(x), or take abs, norm and arctan2 of "
    "openmdao.utils.cs_safe"
)
DIFFERENTIATED = "demand", "rates", "speed_at", "rate", "rows", "value", "speed_at_rest"
CONSTANT = "shares", "inflow_speed"
"""Arguments of these by which no derivatives are taken."""
POINTS = 8  # calls of a method whose derivatives are compared with differences
MOVE, OFF, SMALL = 1e-6, 1e-3, 1e-10  # of an argument, of a difference and of the value, relatively


@contextmanager
def any_values() -> Iterator[None]:
    """Let values be NaN or infinite: an optimizer that meets them shortens its step."""
    token = _FINITE.set(False)
    try:
        yield
    finally:
        _FINITE.reset(token)


def guard(kind: Any, source: str) -> Any:
    """Guard the methods and properties of a kind that are an extension's own; return the kind.

    Parameters
    ----------
    kind : type
        The extension's class.
    source : str
        What messages call the extension, where the class has no file.
    """
    file = getattr(sys.modules.get(kind.__module__), "__file__", None) or source
    for name in dir(kind):
        method = value = getattr_static(kind, name)
        if isinstance(value, property):
            method = value.fget
        elif isinstance(value, cached_property):
            method = value.func
        own = isinstance(method, FunctionType) and not name.startswith("_")
        if not own or method.__module__.startswith(("hkt_mdo.", "pydantic.")):
            continue
        if hasattr(method, "__wrapped__"):  # guarded already, as a method of a base
            continue
        guarded = _guard(method, file, f"{kind.__name__}.{name}")
        made = guarded if method is value else type(value)(guarded)
        setattr(kind, name, made)
        if isinstance(made, cached_property):
            made.__set_name__(kind, name)
    return kind


def _guard(method: Callable, file: str, place: str) -> Callable:
    """Return a method of an extension whose errors and bad results are reported with its place."""
    left, name, parameters = [True] * POINTS, method.__name__, [*signature(method).parameters][1:]

    @wraps(method)
    def guarded(self: Any, *args: Any, **quantities: Any) -> Any:
        given = dict(zip(parameters, args, strict=False)) | quantities
        has_complex = any(map(np.iscomplexobj, given.values()))
        try:
            result = method(self, *args, **quantities)
        except InputError:
            raise
        except Exception as error:
            lines = [at.lineno for at in extract_tb(error.__traceback__) if at.filename == file]
            line = f" in line {lines[-1]}" if lines else ""
            remedy = COMPLEX if has_complex else "correct the method"
            problem = f"raises {one_line(error)}{line}"
            raise InputError(problem, remedy, file=file, key=place) from error
        problem, result = _checked(self, name, given, result)
        if problem:
            raise InputError(problem, "correct the method", file=file, key=place)
        if left and name in DIFFERENTIATED and not has_complex:
            left.pop()
            if problem := _wrong_slope(method, self, given):
                raise InputError(problem, COMPLEX, file=file, key=place)
        return result

    return guarded


def _checked(kind: Any, name: str, given: dict[str, Any], result: Any) -> tuple[str, Any]:
    """Return what is wrong with a result, empty if nothing, and the result in its shape.

    A formula has one value for each instant if it takes anything over time.
    """
    shape: tuple | None = None  # of any length
    if name in ("speed_at", "demand"):
        shape = np.shape(next(iter(given.values())))
    elif isinstance(kind, Formula) and name in ("value", "rate"):
        times = [np.shape(value) for each, value in given.items() if is_over_time(each)]
        shape = times[0] if times else None if isinstance(kind, Limit) else ()
    elif name in NUMBERS or (isinstance(kind, Aggregate) and name == "value"):
        shape = ()
    elif name not in ROWS:
        return "", result
    if result is None and name in OPTIONAL:
        return "", result
    try:
        found = np.asarray(result)
    except ValueError:  # rows of several lengths
        found = np.asarray(None)
    if found.dtype.kind not in "biufc":
        return f"returns {show(result)}, which is not a number or an array of numbers", result
    if name == "features" and found.size and found.shape[-1] != 3:
        return f"returns {show(result)} in place of rows of 3 numbers", result
    if shape is not None and found.shape != shape:
        if found.ndim:
            wanted = f"the shape {shape}" if shape else "one number"
            return f"returns an array of the shape {found.shape} in place of {wanted}", result
        result = found + np.zeros(shape)
    wrong = np.isnan(found.real) | (np.isinf(found.real) & (name not in INFINITE))
    finite = all(np.all(np.isfinite(np.real(value))) for value in given.values())
    if _FINITE.get() and np.any(wrong) and finite:
        return f"returns {found.real[wrong].flat[0]:g}", result
    return "", result


def _wrong_slope(method: Callable, kind: Any, given: dict[str, Any]) -> str:
    """Return by which argument a derivative by complex step is wrong; empty if by none.

    It lies between the differences to both sides, which are apart at a kink.
    """
    for name, value in given.items():
        size = np.abs(value)
        if name in CONSTANT or size.dtype.kind not in "iuf" or not size.size:
            continue
        step = MOVE * np.maximum(size, 1e-3 * np.max(size) or 1.0)
        moved = [value + by * step for by in (0.0, -1.0, 1.0, 1j * STEP)]
        try:
            found = [np.ravel(method(kind, **given | {name: each})) for each in moved]
        except Exception as error:
            return f"raises {one_line(error)} for a complex {name}"
        here, lower, upper, aside = found
        slope, sides = np.imag(aside) / STEP, np.stack((here - lower, upper - here))
        noise = OFF * np.max(np.abs(sides), axis=0) + SMALL * np.max(np.abs(here), initial=0.0)
        off = np.maximum(np.min(sides, axis=0) - slope, slope - np.max(sides, axis=0)) - noise
        for worst in np.flatnonzero(off > 0.0)[:1]:
            unit = np.resize(step, off.size)[worst]
            by_step, by_difference = slope[worst] / unit, np.mean(sides[:, worst]) / unit
            told = f"{by_step:.4g} by complex step and {by_difference:.4g} by differences"
            return f"has a derivative by {name} of {told}"
    return ""


def one_line(error: BaseException) -> str:
    """Return an error's class and text, on one line of limited length."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
