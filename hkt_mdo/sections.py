"""What every section of a case is made of: quantities with units, and how a check complains."""

from __future__ import annotations

import math
import numbers
import operator
import re
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema


def refusal(problem: str, remedy: str, **context: Any) -> PydanticCustomError:
    """Return what a check found; context may hold the `key` inside the section and its `value`."""
    return PydanticCustomError(
        "hkt_mdo", "{problem}; {remedy}", {"problem": problem, "remedy": remedy, **context}
    )


# Quantities ---------------------------------------------------------------------------------------

# The unit is read by OpenMDAO, which evaluates it as an expression: only products of powers of
# names get that far, and a power has one digit.
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_EXPONENT = r"(?:\*\*-?[0-9])?"
_POWER = rf"[A-Za-z][A-Za-z0-9]*{_EXPONENT}"
_PRODUCT = rf"{_POWER}(?:[*/]{_POWER})*"
_FACTOR = rf"(?:{_POWER}|\({_PRODUCT}\){_EXPONENT})"
_QUANTITY_TEXT = re.compile(rf"({_NUMBER}) *({_FACTOR}(?:[*/]{_FACTOR})*)?")
_LONGEST_QUANTITY = 64
_LONGEST_UNIT = 24


@dataclass(frozen=True)
class Quantity:
    """What a physical quantity is: its unit and range, as the annotation of a float.

    ``Annotated[float, Quantity("m", gt=0)]`` takes a finite number in metres, or a text such as
    ``1400 mm``, which OpenMDAO's table of units converts.

    Parameters
    ----------
    unit : str or None
        Unit of the value, as OpenMDAO writes it; None for a plain number.
    gt, ge, lt, le : float, optional
        Bounds in that unit: greater than, at least, less than, at most.
    """

    unit: str | None = None
    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None

    def read(self, value: object) -> float:
        """Return the value as a float in the quantity's unit.

        Parameters
        ----------
        value : object
            A number, or a text of a number and a unit.

        Returns
        -------
        float
            Finite and within the bounds.

        Raises
        ------
        PydanticCustomError
            If it is not a number, the unit is unknown or of another kind, or a bound is broken.
        """
        if isinstance(value, str):
            number = self._convert(value)
        elif isinstance(value, numbers.Real) and not isinstance(value, bool):
            try:
                number = float(value)
            except OverflowError:
                number = math.inf
        else:
            raise self._refuse("must be a number")
        if not math.isfinite(number):
            raise self._refuse("must be a finite number")
        for bound, broken, words in (
            (self.gt, operator.le, "greater than"),
            (self.ge, operator.lt, "at least"),
            (self.lt, operator.ge, "less than"),
            (self.le, operator.gt, "at most"),
        ):
            if bound is not None and broken(number, bound):
                unit = f" {self.unit}" if self.unit else ""
                raise self._refuse(f"must be {words} {bound:g}{unit}")
        return number

    def _convert(self, text: str) -> float:
        text = text.strip() if len(text) <= _LONGEST_QUANTITY else ""
        match = _QUANTITY_TEXT.fullmatch(text)
        if match is None:
            wanted = "a number, or a number and a unit" if self.unit else "a number"
            raise self._refuse(f"must be {wanted}")
        number, unit = float(match[1]), match[2]
        if self.unit is None:
            raise self._refuse("must be a plain number, no text and no unit")
        if unit is None:
            raise self._refuse(f"is a text without a unit; this key is in {self.unit}")
        if len(unit) > _LONGEST_UNIT:
            raise self._refuse(f"has too long a unit; this key is in {self.unit}")

        from openmdao.utils.units import (  # type: ignore[import-untyped]
            convert_units,
            valid_units,
        )

        try:
            known = valid_units(unit)
        except Exception:  # the unit is evaluated: any error of that says that it is none
            known = False
        if not known:
            raise self._refuse(f"has the unknown unit {unit}; this key is in {self.unit}")
        try:
            return float(convert_units(number, unit, self.unit))
        except TypeError:
            raise self._refuse(
                f"has the unit {unit}, which does not convert to {self.unit}"
            ) from None
        except (ArithmeticError, ValueError):
            raise self._refuse(f"cannot be converted from {unit} to {self.unit}") from None

    def _refuse(self, problem: str) -> PydanticCustomError:
        form = "a plain number"
        if self.unit:
            form = f"a number in {self.unit}, or a text with a unit of that kind"
        return refusal(problem, f"give {form}", quantity=form)

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema of a value that `read` checks."""
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(
        self, _: CoreSchema, __: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the JSON schema: a number within the bounds, or a text, and the unit."""
        schema: dict[str, Any] = {"type": "number"}
        if self.unit:
            # a bound is read for numbers alone, a pattern for texts alone
            schema = {
                "type": ["number", "string"],
                "pattern": f"^{_QUANTITY_TEXT.pattern[:-1]}$",
                "unit": self.unit,
            }
        words = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum"}
        for name, word in {**words, "le": "maximum"}.items():
            if getattr(self, name) is not None:
                schema[word] = getattr(self, name)
        return schema


def ordered(bounds: tuple[float, float]) -> tuple[float, float]:
    """Return bounds whose lower one is below the upper; refuse others."""
    if not bounds[0] < bounds[1]:
        raise refusal("has its lower bound at or above its upper", "write [lower, upper]")
    return bounds


def upper(value: object) -> object:
    """Return a text in capitals, anything else as it is."""
    return value.upper() if isinstance(value, str) else value


class Section(BaseModel):
    """A frozen part of a case: unknown keys, NaN and infinity are refused."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
        hide_input_in_errors=True,
    )
