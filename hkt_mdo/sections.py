"""Parts of every section of a case: quantities with units, and errors of bad values."""

import ast
import inspect
import math
import numbers
import operator
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from textwrap import indent
from typing import Annotated, Any, ClassVar, Self, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo, model_validator
from pydantic_core import CoreSchema, PydanticCustomError, core_schema


def refusal(problem: str, remedy: str, **context: Any) -> PydanticCustomError:
    """Return the error of a check of a case.

    Parameters
    ----------
    problem : str
        What is wrong.
    remedy : str
        What the user can do.
    **context
        `key` within the section and `value` that was given there, if there are any.

    Returns
    -------
    pydantic_core.PydanticCustomError
        To be raised by a validator.
    """
    return PydanticCustomError(
        "hkt_mdo", "{problem}; {remedy}", {"problem": problem, "remedy": remedy, **context}
    )


# Quantities ---------------------------------------------------------------------------------------

# OpenMDAO evaluates a unit as an expression: only products of powers of names may get that far, and
# a power has one digit. A space is a product up to the first "/": what a/b c means is not clear.
# Nm is written for N m everywhere, and can be nothing else: nanometres are nm, nautical miles NM.
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_EXPONENT = r"(?:(?:\*\*|\^)-?[0-9])?"
_POWER = rf"[A-Za-z][A-Za-z0-9]*{_EXPONENT}"
_TIMES = r"[*·⋅]"
_PRODUCT = rf"{_POWER}(?:(?:{_TIMES}| +){_POWER})*(?:(?:{_TIMES}|/){_POWER})*"
_FACTOR = rf"(?:{_POWER}|\({_PRODUCT}\){_EXPONENT})"
_QUANTITY_TEXT = re.compile(
    rf"({_NUMBER}) *({_FACTOR}(?:(?:{_TIMES}| +){_FACTOR})*(?:(?:{_TIMES}|/){_FACTOR})*)?"
)
_NEWTON_METRE = re.compile(r"\b([kM]?)Nm\b")
_COMMA = re.compile(r"[-+]?\d+,\d")
_PER_CENT = re.compile(rf"({_NUMBER}) *%")
_LONGEST_QUANTITY = 64  # characters, so that no text takes long to evaluate
BOUNDS = (
    ("gt", operator.gt, "greater than", "exclusiveMinimum"),
    ("ge", operator.ge, "at least", "minimum"),
    ("lt", operator.lt, "less than", "exclusiveMaximum"),
    ("le", operator.le, "at most", "maximum"),
)
"""By the field of a bound: its condition in words, and its key in a JSON schema."""


def is_unit(text: str) -> bool:
    """Tell whether OpenMDAO knows a unit.

    Parameters
    ----------
    text : str
        The unit, such as ``N*m``.

    Returns
    -------
    bool
        False for a text that cannot be evaluated as a unit, too.
    """
    from openmdao.utils import units

    try:
        return bool(units.valid_units(text))
    except Exception:  # the unit is evaluated: any error means that it is none
        return False


@dataclass(frozen=True)
class Quantity:
    """A physical quantity: its unit and range, as the annotation of a float.

    ``Annotated[float, Quantity("m", gt=0)]`` takes a finite number in metres, or a text such as
    ``1400 mm``, which OpenMDAO's table of units converts; without a unit, a number or ``12 %``.

    Parameters
    ----------
    unit : str or None
        Unit, written ``N*m``, ``N m`` or ``Nm``, ``m**2`` or ``m^2``; None for a plain number.
    gt, ge, lt, le : float or None
        Bounds in that unit: greater than, at least, less than, at most.
    word : str or None
        What may be given in place of a quantity, and is left as it is.
    """

    unit: str | None = None
    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None
    word: str | None = None

    def read(self, value: object) -> Any:
        """Return what a case gives as a number in the quantity's unit.

        Parameters
        ----------
        value : object
            A number, or a text of a number and a unit.

        Returns
        -------
        float or str
            A finite number within the bounds, or the `word`.

        Raises
        ------
        pydantic_core.PydanticCustomError
            If it is not finite, the unit is unknown or of another kind, or a bound is broken.
        """
        if self.word is not None and value == self.word:
            return value
        if isinstance(value, bool) or not isinstance(value, str | numbers.Real):
            raise self._refuse("must be a number")
        try:
            number = self._convert(value) if isinstance(value, str) else float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self._refuse("must be a finite number")
        for name, holds, words, _ in BOUNDS:
            bound = getattr(self, name)
            if bound is not None and not holds(number, bound):
                unit = f" {self.unit}" if self.unit else ""
                raise self._refuse(f"must be {words} {bound:g}{unit}")
        return number

    def _convert(self, text: str) -> float:
        """Return the number that a text says, in the quantity's unit."""
        text = text.strip() if len(text) <= _LONGEST_QUANTITY else ""
        if self.unit is None and (share := _PER_CENT.fullmatch(text)):
            return float(share[1]) / 100.0
        match = _QUANTITY_TEXT.fullmatch(text)
        if match is None or self.unit is None:
            plain = "a plain number or per cent, no text and no unit"
            wanted = "a number, or a number and a unit" if self.unit else plain
            if _COMMA.match(text):
                wanted += ", decimals with a point"
            raise self._refuse(f"must be {wanted}")
        if match[2] is None:
            raise self._refuse(f"is a text without a unit; this key is in {self.unit}")
        number, unit = float(match[1]), re.sub(rf" +|{_TIMES}", "*", match[2].replace("^", "**"))
        unit = re.sub(r"\bdays?\b", "d", _NEWTON_METRE.sub(r"\1N*m", unit))
        if not is_unit(unit):
            meant = re.sub(r"([A-Za-z])([2-9])", r"\1**\2", unit.replace("kgm", "kg*m"))
            guess = f" (did you mean {meant}?)" if is_unit(meant) else ""
            raise self._refuse(f"has the unknown unit {unit}{guess}; this key is in {self.unit}")

        from openmdao.utils import units  # type: ignore[import-untyped]

        try:
            return float(units.convert_units(number, unit, self.unit))
        except TypeError:
            problem = f"has the unit {unit}, which does not convert to {self.unit}"
            raise self._refuse(problem) from None

    @property
    def form(self) -> str:
        """What may be given, in words."""
        of_unit = f"a number in {self.unit}, or a text with a unit of that kind"
        form = of_unit if self.unit else "a plain number, or per cent such as 12 %"
        return f"{form}, or {self.word}" if self.word else form

    def _refuse(self, problem: str) -> PydanticCustomError:
        """Return an error whose remedy says what form the quantity has."""
        return refusal(problem, f"give {self.form}", quantity=self.form)

    def __get_pydantic_core_schema__(self, _: Any, __: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, _: CoreSchema, __: Any) -> dict[str, Any]:
        # JSON schema applies a bound to numbers only, a pattern to texts only
        pattern = _QUANTITY_TEXT.pattern[:-1] if self.unit else _PER_CENT.pattern
        keys = {"unit": self.unit} | {word: getattr(self, name) for name, _, _, word in BOUNDS}
        stated = {word: value for word, value in keys.items() if value is not None}
        number = {"type": ["number", "string"], "pattern": f"^{pattern}$"} | stated
        return {"anyOf": [number, {"enum": [self.word]}]} if self.word else number


def ordered(bounds: tuple[float, float]) -> tuple[float, float]:
    """Return a pair of bounds as it is.

    Parameters
    ----------
    bounds : tuple of float
        Lower and upper bound.

    Returns
    -------
    tuple of float
        The same.

    Raises
    ------
    pydantic_core.PydanticCustomError
        If the lower bound is not below the upper.
    """
    if not bounds[0] < bounds[1]:
        raise refusal("has its lower bound at or above its upper", "write [lower, upper]")
    return bounds


_End = TypeVar("_End")
Pair = Annotated[tuple[_End, _End], AfterValidator(ordered)]
"""A lower and an upper bound of one kind, such as ``Pair[Annotated[float, Quantity("m")]]``."""


def find_file(
    value: str,
    info: ValidationInfo,
    problem: str = "is not a file in {folder}",
    remedy: str = "give the path of a file",
) -> str:
    """Return the absolute path of a file that a case names.

    Parameters
    ----------
    value : str
        The path, relative to the case's folder.
    info : pydantic.ValidationInfo
        Its context may have the `folder` and whether to `check_files`.
    problem, remedy : str
        What to say where there is no such file in the ``{folder}``.

    Returns
    -------
    str
        The absolute path.

    Raises
    ------
    pydantic_core.PydanticCustomError
        If `value` cannot be a path, or there is no such file and files are checked.
    """
    context = {"folder": ".", "check_files": True} | (info.context or {})
    try:
        path = (Path(context["folder"]) / value).resolve()
        accepted = path.is_file() or not context["check_files"]
    except (OSError, ValueError, RuntimeError):
        raise refusal("cannot be a path", remedy) from None
    if not accepted:
        raise refusal(problem.format(folder=Path(context["folder"]).absolute()), remedy)
    return str(path)


ExistingFile = Annotated[str, AfterValidator(find_file)]
"""A file that a case names, which must exist; an absolute path."""


@cache
def _texts(section: type) -> dict[str, str]:
    """Return the texts below the keys of a class; none where its source cannot be read."""
    try:
        source = indent(inspect.getsource(section), " ")
    except (OSError, TypeError):
        return {}
    whole: Any = ast.parse(f"if True:\n{source}").body[0]
    return {
        key.target.id: inspect.cleandoc(text.value.value)
        for key, text in pairwise(whole.body[0].body)
        if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name)
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
        if isinstance(text.value.value, str)
    }


Flaws = Iterator[tuple[str, str, str]]
"""Keys of a section, what is wrong there, and remedies."""


class Section(BaseModel):
    """A frozen part of a case: unknown keys, NaN and infinity are refused."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        hide_input_in_errors=True,
        serialize_by_alias=True,
    )
    bare: ClassVar[tuple[str, ...]] = ()
    """Names that a case may give in place of the section."""
    short: ClassVar[str] = ""
    """Key whose value a case may give in place of the section; empty: none."""
    named_by: ClassVar[str] = ""
    """Key, or attribute, that has the name of a kind; empty for what is no kind."""

    @classmethod
    def spelled_out(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Return what a case gives as the keys of the section: sections for their bare names.

        Parameters
        ----------
        data : dict
            Keys and values, not yet checked.

        Returns
        -------
        dict
            Keys and values.
        """
        for key, field in cls.model_fields.items():
            tag = field.discriminator or getattr(field.annotation, "short", "")
            if tag and isinstance(data.get(key), str):
                data = data | {key: {tag: data[key]}}
        return data

    @model_validator(mode="before")
    @classmethod
    def _spell_out(cls, data: Any) -> Any:
        if cls.short and data is not None and not isinstance(data, dict | Section):
            data = {cls.short: data}
        return cls.spelled_out(data) if isinstance(data, dict) else data

    def flaws(self) -> Flaws:
        """Yield what is wrong with values that are each valid alone.

        Returns
        -------
        iterator of (str, str, str)
            Key, empty for the whole section, problem and remedy of each flaw.
        """
        return iter(())

    @model_validator(mode="after")
    def _refuse_flaws(self) -> Self:
        for key, problem, remedy in self.flaws():
            value: Any = self.model_dump(mode="json")
            for part in re.findall(r"\w+", key):
                value = value[int(part)] if part.isdigit() else value.get(part)
            raise refusal(problem, remedy, key=key, value=value)
        return self

    @classmethod
    def description(cls, key: str) -> str:
        """Return what a key means: the text below it, of the class or of the nearest base.

        Pydantic's `use_attribute_docstrings` reads the source at import: half the time of that.

        Parameters
        ----------
        key : str
            A field of the section.

        Returns
        -------
        str
            Empty where there is no text.
        """
        texts = (_texts(base).get(key) for base in cls.__mro__ if issubclass(base, Section))
        return cls.model_fields[key].description or next(filter(None, texts), "")

    @classmethod
    def unit_of(cls, key: str) -> str:
        """Return the unit of a key.

        Parameters
        ----------
        key : str
            A field of the section.

        Returns
        -------
        str
            The first one in its annotation; empty where there is none.
        """
        parts = parts_of(cls.model_fields[key].rebuild_annotation())
        return next((x.unit for x in parts if isinstance(x, Quantity) and x.unit), "")

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> Any:
        whole = handler(schema)
        properties = handler.resolve_ref_schema(whole).get("properties", {})
        short = [properties[cls.short]] if cls.short in properties else []
        for key, field in cls.model_fields.items():
            name = field.alias if field.alias in properties else key
            if name in properties and (text := cls.description(key)):
                properties[name]["description"] = text
            if name in properties and (unit := cls.unit_of(key)):
                properties[name]["title"] = f"{name} [{unit}]"
        short += [{"enum": [*cls.bare]}] if cls.bare else []
        return {"anyOf": [*short, whole]} if short else whole


def kind_name(kind: Any) -> str:
    """Return the name by which a case calls a kind.

    Parameters
    ----------
    kind : type
        Any class.

    Returns
    -------
    str
        Empty for a class without such a name.
    """
    tag = getattr(kind, "named_by", "")
    field = kind.model_fields.get(tag) if tag else None
    attribute = getattr(kind, tag or "_", None)
    names = (*get_args(field.annotation), field.default) if field else (attribute,)
    return next((name for name in names if isinstance(name, str)), "")


def parts_of(annotation: Any) -> Iterator[Any]:
    """Yield the quantities and the sections in an annotation.

    Parameters
    ----------
    annotation : type
        Of a field.

    Yields
    ------
    Quantity or type
        A quantity, or the class of a section.
    """
    if isinstance(annotation, Quantity) or Section in getattr(annotation, "__mro__", ()):
        yield annotation
    for part in get_args(annotation):
        yield from parts_of(part)


def leaves(value: Any, key: str = "", unit: str = "") -> Iterator[tuple[str, Any, str]]:
    """Yield the values in a section, and in the sections and lists in it.

    Parameters
    ----------
    value : Section or Any
        A section, a list, or any other value.
    key, unit : str
        Its dotted key, and its unit.

    Yields
    ------
    key, value, unit : tuple of (str, Any, str)
        Dotted key, such as ``rotor.chord[2]``, value, and unit, empty where there is none.
    """
    if isinstance(value, Section):
        for name, field in type(value).model_fields.items():
            path = f"{key}.{field.alias or name}".lstrip(".")
            yield from leaves(getattr(value, name), path, type(value).unit_of(name))
    elif isinstance(value, list | tuple):
        for number, item in enumerate(value):
            yield from leaves(item, f"{key}[{number}]", unit)
    else:
        yield key, value, unit
