"""The guard of extensions: an error in a user's class is reported as such, with its place.

An error in a method or property of an extension, or a result that no formula may have, is an
`InputError` that names the class, its file, the method and what is wrong.
"""

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, cached_property, wraps
from inspect import getmembers_static, signature
from traceback import extract_tb
from types import FunctionType
from typing import Any

import numpy as np

from hkt_mdo.dynamics.aggregates import Aggregate
from hkt_mdo.dynamics.formulas import STEP, Formula
from hkt_mdo.dynamics.laws import FeedbackLaw
from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.errors import InputError, show
from hkt_mdo.quantities import OVER_TIME

_FINITE: ContextVar[bool] = ContextVar("finite", default=True)
MAY_BE_NONE = "length", "highest_frequency", "bound"
MAY_BE_INFINITE = "lower", "upper", "features", "last_time"
COMPLEX = (
    "derivatives are by complex step, and np.abs, math, float() and .real drop the imaginary part; "
    "write np.sqrt(x * x) for np.abs(x), or take abs or arctan2 of openmdao.utils.cs_safe"
)
CORRECT = "correct the method"
EACH = "compute the value at each instant from what is known at that instant, without sums or means"
SLOPES: dict[str, tuple[str, ...]] = {
    **{"demand": (), "rates": (), "speed_at": (), "rate": (), "rows": ("shares",)},
    **{"value": ("shares",), "speed_at_rest": ("inflow_speed",)},
}
"""Methods with derivatives by complex step, and the arguments by which none are taken."""
GAINS_AT = {"demand": 1, "rates": 2}  # place among the arguments; the others are over time
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


@cache
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
    for name, value in getmembers_static(kind):
        places = (base.__module__ for base in kind.__mro__ if name in vars(base))
        home = next(places, "builtins").partition(".")[0]  # none: an attribute of its metaclass
        if name.startswith("_") or home in ("hkt_mdo", "pydantic", "builtins", "typing"):
            continue
        if (made := _guarded(value, name, file, f"{kind.__name__}.{name}")) is not None:
            setattr(kind, name, made)
            if isinstance(made, cached_property):
                made.__set_name__(kind, name)
    return kind


def _guarded(value: Any, *origin: str) -> Any:
    """Return an attribute of a kind whose function is guarded; None of one without."""
    if isinstance(value, FunctionType):
        return _guard(value, *origin)
    if isinstance(value, property):
        return property(_guard(value.fget, *origin)) if value.fget else None
    if isinstance(value, cached_property):
        return cached_property(_guard(value.func, *origin))
    if origin[0] in SLOPES and callable(value):  # a static method, or what stands for a method
        return _guard(lambda _, *args, **named: value(*args, **named), *origin)
    return None


def _guard(method: Callable, name: str, file: str, key: str) -> Callable:
    """Return a method of an extension whose errors and bad results are reported with its place."""
    left = [True] * POINTS

    @wraps(method)
    def guarded(self, *args, **quantities):
        arguments = (*args, *quantities.values())
        try:
            result = method(self, *args, **quantities)
        except InputError:
            raise
        except (Exception, SystemExit) as error:
            remedy = _remedy(error) if any(map(np.iscomplexobj, arguments)) else CORRECT
            problem = " in ".join(filter(None, (f"raises {one_line(error)}", line_of(error, file))))
            raise InputError(problem, remedy, file=file, key=key) from error
        problem, remedy, shape = "", CORRECT, _shape(self, name, args, quantities)
        if shape is not None and not (result is None and name in MAY_BE_NONE):
            problem, result = _checked(result, shape, arguments, name in MAY_BE_INFINITE)
        if not problem and name in ("speed_at_rest", "sizes") and np.max(result) <= 0.0:
            problem = f"returns {np.max(result):.4g}, and must return something above zero"
        if not problem and left and name in SLOPES and not any(map(np.iscomplexobj, arguments)):
            left.pop()
            problem, remedy = _wrong_slope(method, name, self, args, quantities)
        if problem:
            raise InputError(problem, remedy, file=file, key=key)
        return result

    return guarded


def _wrong_slope(method: Callable, of: str, kind: Any, args: tuple, named: dict) -> tuple[str, str]:
    """Return by which argument a derivative is wrong, and the remedy; empty if by none.

    That by complex step lies between the differences to both sides, which are apart at a kink. By a
    quantity over time a formula has it at every instant by itself.
    """
    names, arguments = [*signature(method).parameters][1:] or [of], dict(enumerate(args)) | named

    def at(key: Any, value: Any) -> np.ndarray:
        moved = arguments | {key: value}
        first = [moved.pop(index) for index in range(len(args))]
        return np.ravel(method(kind, *first, **moved))

    for key, value in arguments.items():
        name = key if isinstance(key, str) else names[min(key, len(names) - 1)]
        size = np.abs(value)
        if name in SLOPES[of] or size.dtype.kind not in "iuf" or not size.size:
            continue
        step = MOVE * np.maximum(size, 1e-3 * np.max(size) or 1.0)
        try:
            here, lower, upper = (at(key, value + by * step) for by in (0.0, -1.0, 1.0))
            slope = np.imag(at(key, value + 1j * STEP * step)) / STEP
            timed = of in ("demand", "rates", "speed_at") and key not in ("gains", GAINS_AT.get(of))
            for odd in (0, 1) if timed or name in OVER_TIME else ():
                moved = np.arange(size.size).reshape(size.shape) % 2 == odd
                by = np.imag(at(key, value + 1j * STEP * step * moved)) * np.isfinite(here)
                rows = np.resize(by, (max(by.size // size.size, 1), *size.shape))
                if np.any(np.abs(rows[:, ~moved]) > 0.0):
                    return f"mixes instants: at one it depends on {name} at another", EACH
        except Exception as error:
            return f"raises {one_line(error)} for a complex {name}", _remedy(error)
        sides = np.stack((here - lower, upper - here))
        noise = OFF * np.max(np.abs(sides), axis=0) + SMALL * np.max(np.abs(here), initial=0.0)
        off = np.maximum(np.min(sides, axis=0) - slope, slope - np.max(sides, axis=0)) - noise
        if np.any(off > 0.0):
            worst = np.argmax(off)
            unit = np.resize(step, off.size)[worst]
            slopes = slope[worst] / unit, np.mean(sides[:, worst]) / unit
            text = "{:.4g} by complex step and {:.4g} by differences".format(*slopes)
            return f"has a derivative by {name} of {text}", COMPLEX
    return "", ""


def _remedy(error: Exception) -> str:
    """Return the remedy of an error of a method that was given complex numbers."""
    return COMPLEX if re.search("complex|ufunc|real", str(error)) else CORRECT


def one_line(error: BaseException) -> str:
    """Return an error's class and text, on one line of limited length."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def line_of(error: BaseException, file: str) -> str:
    """Return the last line of a file that led to an error, as messages have it; empty if none."""
    lines = [at.lineno for at in extract_tb(error.__traceback__) if at.filename == file]
    if not lines and isinstance(error, SyntaxError):  # the file itself is no Python
        lines = [error.lineno]
    return f"line {lines[-1]}" if lines else ""


def _shape(kind: Any, name: str, args: tuple, quantities: dict) -> tuple | None:
    """Return the shape that a method's result must have, ... for any length; None: any shape.

    A formula has one value for each instant if it takes anything over time.
    """
    if name in ("speed_at", "demand", "speed_at_rest"):
        return np.shape(args[0])
    if name in ("rates", "at_rest") and kind.states:
        return (len(kind.states), *np.shape(args[0]))
    if name in (*MAY_BE_NONE, "mean_speed", "last_time"):
        return ()
    if name in ("features", "lower", "upper"):
        return (..., 3) if name == "features" else (...,)
    if isinstance(kind, FeedbackLaw) and name in "fit follow sizes scaled_gains moves".split():
        return (*(2,) * (name == "moves"), len(kind.gain_units))
    if isinstance(kind, Aggregate):
        count = ... if kind.n_unknowns is None else kind.n_unknowns
        return {"value": (), "rows": (...,), "best_unknowns": (count,)}.get(name)
    if isinstance(kind, Formula) and name in ("value", "rate"):
        times = [np.shape(x) for key, x in quantities.items() if key in OVER_TIME]
        return times[0] if times else (...,) if isinstance(kind, Limit) else ()
    return None


def _checked(result: Any, shape: tuple, arguments: tuple, infinite: bool) -> tuple[str, Any]:
    """Return what is wrong with a result, empty if nothing, and the result in its shape."""
    try:
        array = np.asarray(result)
    except ValueError:  # rows of several lengths
        array = np.asarray(None)
    if array.dtype.kind not in "biufc":
        return f"returns {show(result)}, which is not a number or an array of numbers", result
    if shape[:1] == (...,):
        if array.size and array.ndim and shape[1:] not in ((), array.shape[-1:]):
            return f"returns {show(result)} in place of rows of {shape[1]} numbers", result
    elif array.ndim and array.shape != shape:
        wanted = f"the shape {shape}" if shape else "one number"
        return f"returns an array of the shape {array.shape} in place of {wanted}", result
    elif array.shape != shape or isinstance(result, list):
        result = array + np.zeros(shape)
    wrong = np.isnan(array.real) | (np.isinf(array.real) & (not infinite))
    if _FINITE.get() and np.any(wrong) and all(np.all(np.isfinite(np.real(x))) for x in arguments):
        return f"returns {array.real[wrong].flat[0]:g}", result
    return "", result
