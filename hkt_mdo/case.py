"""The case: what one experiment is, read from a short YAML file and checked before all else.

A case knows no physics and physics knows no case. Every key has a default but `inflow` and
`control`; unknown keys are refused. A physical quantity is a number in the key's own unit, or a
text with a unit, such as ``1400 mm``, which is converted. Whatever is wrong with a file is told as
one `InputError`.
"""

from __future__ import annotations

import difflib
import math
import numbers
import operator
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, cast, get_args

import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails, PydanticCustomError, core_schema

from hkt_mdo.data import locate, read_bytes, shipped_names
from hkt_mdo.errors import InputError

__all__ = [
    "Case",
    "ConstantInflow",
    "Control",
    "Controller",
    "Design",
    "Driver",
    "Feedback",
    "Fluid",
    "Hydrodynamics",
    "Inflow",
    "LinearFeedback",
    "OpenLoop",
    "Phase",
    "QuadraticFeedback",
    "Quantity",
    "Rotor",
    "SineInflow",
    "Start",
    "StepInflow",
    "case_json_schema",
    "load_case",
    "read_case",
]

MAX_CASE_BYTES = 1024**2
"""Largest case file that is read, in bytes."""

MAX_DEPTH = 20
"""Deepest nesting of a case file."""


def _problem(problem: str, remedy: str, **context: Any) -> PydanticCustomError:
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
        return _problem(problem, f"give {form}", quantity=form)

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


def _ordered(bounds: tuple[float, float]) -> tuple[float, float]:
    if not bounds[0] < bounds[1]:
        raise _problem("has its lower bound at or above its upper", "write [lower, upper]")
    return bounds


def _upper(value: object) -> object:
    return value.upper() if isinstance(value, str) else value


# Sections -----------------------------------------------------------------------------------------


class Section(BaseModel):
    """A frozen part of a case: unknown keys, NaN and infinity are refused."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
        hide_input_in_errors=True,
    )


class Rotor(Section):
    """The turbine's rotor: its size, its blade at the start, its section and its inertia."""

    radius: Annotated[float, Quantity("m", gt=0)] = 1.4
    """Tip radius R."""

    hub_radius_fraction: Annotated[float, Quantity(gt=0, lt=1)] = 0.125
    """Hub radius over tip radius."""

    blade_count: Annotated[int, Strict(), Field(ge=1, le=10)] = 3
    """Number of blades; two to six are usual."""

    stations: Annotated[
        tuple[Annotated[float, Quantity(gt=0, lt=1)], ...], Field(min_length=3, max_length=200)
    ] = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.999)
    """Radial stations r/R at which chord and twist are given, rising from above the hub to below 1.

    The paper says that the blade has nine segments; that these are nine stations is our assumption.
    """

    blade: str = "bahaj2007"
    """Blade at the start: a shipped name, or the path of a CSV file `r_over_R,c_over_R,pitch_deg`.

    A relative path counts from the folder of the case file.
    """

    chord: tuple[Annotated[float, Quantity("m", gt=0)], ...] | None = None
    """Chord at each station; with `twist`, in place of the blade file."""

    twist: tuple[Annotated[float, Quantity("deg", ge=-180, le=180)], ...] | None = None
    """Twist from the rotor plane at each station, set angle included; with `chord`, in place of the
    blade file."""

    set_angle: Annotated[float, Quantity("deg", ge=-90, le=90)] = 5.0
    """Set angle, added to the pitch column of the blade file."""

    polar: str = "naca63815_Re2e5"
    """Section's lift and drag: a shipped name, or the path of a CSV file `alpha_deg,cl,cd` (and
    `cm`)."""

    outline: str = "naca63815"
    """Section's outline, for area and inertia: a shipped name, or the path of a CSV file
    `x_over_c,y_over_c`."""

    material_density: Annotated[float, Quantity("kg/m**3", gt=0)] = 2700.0
    """Density of the blade's material; the default is aluminium 6061, and the blade is solid."""

    hub_inertia: Annotated[float, Quantity("kg*m**2", ge=0)] = 0.0
    """Moment of inertia about the shaft of all that turns besides the blades."""

    @field_validator("blade", "polar", "outline")
    @classmethod
    def _find_file(cls, value: str, info: ValidationInfo) -> str:
        kind = str(info.field_name)
        if value in shipped_names(kind):
            return value
        context = info.context or {}
        try:
            path = (Path(context.get("folder", ".")) / value).resolve()
            if context.get("check_files", True):
                locate(path, kind)
        except (OSError, ValueError, RuntimeError):
            raise _problem("cannot be a path", _shipped(kind)) from None
        except InputError:
            near = difflib.get_close_matches(value[:100], shipped_names(kind), n=1)
            guess = f"did you mean {near[0]}? " if near else ""
            problem = f"is neither a shipped {kind} nor a file"
            raise _problem(problem, guess + _shipped(kind)) from None
        return str(path)

    @model_validator(mode="after")
    def _check_stations(self) -> Rotor:
        for index, (inner, outer) in enumerate(pairwise(self.stations)):
            if not inner < outer:
                raise _problem(
                    f"stands after {inner:g}: stations must rise",
                    "sort the stations from hub to tip, none twice",
                    key=f"stations[{index + 1}]",
                    value=outer,
                )
        if not self.stations[0] > self.hub_radius_fraction:
            raise _problem(
                f"lies on or within the hub, whose radius is {self.hub_radius_fraction:g} R",
                "move the first station outwards or lessen rotor.hub_radius_fraction",
                key="stations[0]",
                value=self.stations[0],
            )
        for name, other in (("chord", "twist"), ("twist", "chord")):
            column = getattr(self, name)
            if column is not None and getattr(self, other) is None:
                raise _problem(
                    f"is given without rotor.{other}",
                    f"give rotor.{other} too, or neither and name a blade",
                    key=name,
                    value=list(column),
                )
        for name in ("chord", "twist"):
            column = getattr(self, name)
            if column is not None and len(column) != len(self.stations):
                raise _problem(
                    f"has {len(column)} values for {len(self.stations)} stations",
                    "give one value for each of rotor.stations",
                    key=name,
                    value=list(column),
                )
        return self


def _shipped(kind: str) -> str:
    return f"shipped: {', '.join(shipped_names(kind))}; or give the path of a CSV file"


class Fluid(Section):
    """The water."""

    density: Annotated[float, Quantity("kg/m**3", gt=0)] = 1000.0
    """Density of the water; the paper gives none, its tables imply this one."""


class ConstantInflow(Section):
    """A steady flow."""

    profile: Literal["constant"] = "constant"
    """The kind of flow."""

    speed: Annotated[float, Quantity("m/s", gt=0)]
    """Inflow speed v."""


class StepInflow(Section):
    """A smoothed step (paper, eq. 9), v = before + (after - before)/(1 + e^(-(t - time)/width))."""

    profile: Literal["step"] = "step"
    """The kind of flow."""

    before: Annotated[float, Quantity("m/s", gt=0)] = 1.2
    """Inflow speed long before the step."""

    after: Annotated[float, Quantity("m/s", gt=0)] = 1.4
    """Inflow speed long after the step."""

    time: Annotated[float, Quantity("s")] = 30.0
    """Time of the middle of the step."""

    width: Annotated[float, Quantity("s", gt=0)] = 1.0
    """Time scale of the step; nine tenths of the change take about six widths."""


class SineInflow(Section):
    """A sinusoidal flow (paper, eq. 10), v = scale (mean + amplitude sin(w t + phase)).

    The uncertain flows of the paper's section V are this one with scale 1.1 (A), angular frequency
    0.225 rad/s (B) and phase 0.2 pi rad (C).
    """

    profile: Literal["sine"] = "sine"
    """The kind of flow."""

    mean: Annotated[float, Quantity("m/s", gt=0)] = 1.5
    """Mean inflow speed, before scaling."""

    amplitude: Annotated[float, Quantity("m/s", ge=0)] = 0.2
    """Amplitude of the inflow speed, before scaling; smaller than the mean."""

    angular_frequency: Annotated[float, Quantity("rad/s", gt=0)] = 0.25
    """Angular frequency of the inflow speed."""

    phase: Annotated[float, Quantity("rad")] = 0.0
    """Phase of the sine at t = 0."""

    scale: Annotated[float, Quantity(gt=0)] = 1.0
    """Factor on the whole flow."""

    @model_validator(mode="after")
    def _check_flow(self) -> SineInflow:
        if self.amplitude >= self.mean:
            raise _problem(
                f"lets the flow reach zero or turn back: its mean is {self.mean:g} m/s",
                "give an amplitude smaller than inflow.mean",
                key="amplitude",
                value=self.amplitude,
            )
        return self


Inflow = Annotated[ConstantInflow | StepInflow | SineInflow, Field(discriminator="profile")]
"""Inflow speed over time; `profile` says which kind."""


class Controller(Section):
    """What every control law has: its tag, and a limit on the control torque u."""

    law: str
    """The control law."""

    torque_limit: Annotated[float, Quantity("N*m", gt=0)] | None = None
    """Largest control torque u_max; null: no limit."""


class OpenLoop(Controller):
    """Open-loop optimal control: the torque over time is itself optimized, 0 <= u <= u_max."""

    law: Literal["open_loop"] = "open_loop"
    """The control law."""

    unknown: Literal["speed", "torque"] = "speed"
    """What the optimizer chooses over time: the rotor speed, from which the torque follows by
    inverse dynamics, or the torque itself, from which the speed follows by integration."""


class Feedback(Controller):
    """What every feedback law has: a gain that is optimized, and a smoothed saturation.

    With a torque limit g the torque is g/4 (2 + sqrt(nu + (2u/g)^2) - sqrt(nu + (2u/g - 2)^2))
    (paper, eq. 4), where u is the torque the law asks for.
    """

    smoothing: Annotated[float, Quantity(gt=0, le=1)] = 0.001
    """Smoothing nu of the saturation (paper, eq. 4); of no effect without a torque limit."""


class LinearFeedback(Feedback):
    """Linear feedback, u = K1 w (paper, eq. 1)."""

    law: Literal["linear"] = "linear"
    """The control law."""

    gain: Annotated[float, Quantity("N*m*s/rad", gt=0)] | None = None
    """Gain K1 at the start; null: chosen by the starting point."""


class QuadraticFeedback(Feedback):
    """Quadratic feedback, u = K2 w^2 (paper, eq. 2)."""

    law: Literal["quadratic"] = "quadratic"
    """The control law."""

    gain: Annotated[float, Quantity("N*m*s**2/rad**2", gt=0)] | None = None
    """Gain K2 at the start; null: chosen by the starting point."""


Control = Annotated[OpenLoop | LinearFeedback | QuadraticFeedback, Field(discriminator="law")]
"""Control law; `law` says which."""

_Chords = tuple[Annotated[float, Quantity("m", gt=0)], Annotated[float, Quantity("m", gt=0)]]
_Angles = tuple[
    Annotated[float, Quantity("deg", ge=-180, le=180)],
    Annotated[float, Quantity("deg", ge=-180, le=180)],
]
_Gains = tuple[Annotated[float, Quantity(ge=0)], Annotated[float, Quantity(gt=0)]]


class Design(Section):
    """What may be changed, and how far (paper, eq. 7)."""

    blade: Literal["optimized", "fixed"] = "optimized"
    """Whether chord and twist are optimized along with the control, or kept."""

    chord_bounds: Annotated[_Chords, AfterValidator(_ordered)] = (0.01, 1.0)
    """Bounds on the chord, [lower, upper]."""

    twist_bounds: Annotated[_Angles, AfterValidator(_ordered)] = (-30.0, 30.0)
    """Bounds on the twist, [lower, upper]."""

    gain_bounds: Annotated[_Gains, AfterValidator(_ordered)] | None = None
    """Bounds on the feedback gain, [lower, upper], plain numbers in the unit of `control.gain`;
    null: scaled from the gain at the start."""


class Phase(Section):
    """The time span and its discretization."""

    duration: Annotated[float, Quantity("s", gt=0)] = 60.0
    """Duration; the paper gives none, its tables imply this one."""

    segments: Annotated[int, Strict(), Field(ge=2, le=20000)] = 60
    """Number of collocation segments."""

    transcription: Literal["gauss-lobatto", "radau"] = "gauss-lobatto"
    """Collocation method."""

    order: Annotated[int, Strict(), Field(ge=3, le=9)] = 3
    """Order of the polynomials of a segment: 3, 5, 7 or 9."""

    initial_speed: Literal["auto", "free", "equilibrium"] = "auto"
    """Rotor speed at t = 0: `free` for the optimizer to choose, or in `equilibrium` (hydrodynamic
    and control torque balance); `auto`: free for open loop, equilibrium for feedback."""

    @field_validator("order")
    @classmethod
    def _check_odd(cls, value: int) -> int:
        if value % 2 == 0:
            raise _problem("must be odd", "give 3, 5, 7 or 9")
        return value


class Start(Section):
    """Where the optimization begins."""

    method: Literal["quasi_steady", "blade"] = "quasi_steady"
    """`quasi_steady` improves blade and gain by quasi-steady co-design before the dynamic
    optimization; `blade` starts from the blade as given."""


class Hydrodynamics(Section):
    """How the rotor's torque is computed."""

    bem: Literal["vectorized", "ccblade"] = "vectorized"
    """Blade element momentum solver of the optimization."""

    torque: Literal["curve", "direct"] = "curve"
    """`curve`: a torque coefficient over tip speed ratio, computed once a design; `direct`: the
    solver at every node of the trajectory."""

    tolerance: Annotated[float, Quantity(ge=1e-8, le=1e-2)] = 1e-4
    """Largest relative torque error of the curve along the trajectory; beyond it the curve is
    refined."""

    check: Literal["vectorized", "ccblade"] = "vectorized"
    """Blade element momentum solver of the independent simulation."""


_PROVIDES = {"casadi": "IPOPT", "scipy": "SLSQP"}


class Driver(Section):
    """The optimizer and the package that provides it."""

    package: Literal["auto", "pyoptsparse", "casadi", "scipy"] = "auto"
    """Package that provides the optimizer; `auto` takes the first that is installed and has it."""

    optimizer: Annotated[Literal["IPOPT", "SLSQP", "SNOPT"], BeforeValidator(_upper)] = "IPOPT"
    """Optimizer, in capitals or not."""

    tolerance: Annotated[float, Quantity(ge=1e-12, le=1e-2)] = 1e-7
    """Tolerance on optimality and feasibility of the scaled problem."""

    max_iterations: Annotated[int, Strict(), Field(ge=1, le=1_000_000)] = 1000
    """Largest number of major iterations."""

    @model_validator(mode="after")
    def _check_package(self) -> Driver:
        only = _PROVIDES.get(self.package, self.optimizer)
        if self.optimizer != only:
            raise _problem(
                f"is not provided by the package {self.package}, which provides {only}",
                f"give driver.optimizer: {only}, or driver.package: auto",
                key="optimizer",
                value=self.optimizer,
            )
        return self


class Case(Section):
    """One experiment: a turbine in a flow under a control law, and how it is optimized."""

    name: Annotated[
        str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$", min_length=1, max_length=100)
    ] = "case"
    """Name of the case and of its results: letters, digits, `_`, `-` and `.`; by default the case
    file's own name."""

    rotor: Rotor = Rotor()
    """The rotor."""

    fluid: Fluid = Fluid()
    """The water."""

    inflow: Inflow
    """Inflow speed over time; `profile` says which kind."""

    control: Control
    """Control law; `law` says which."""

    design: Design = Design()
    """What may be changed, and how far."""

    phase: Phase = Phase()
    """The time span and its discretization."""

    start: Start = Start()
    """Where the optimization begins."""

    hydrodynamics: Hydrodynamics = Hydrodynamics()
    """How the rotor's torque is computed."""

    driver: Driver = Driver()
    """The optimizer and the package that provides it."""

    @model_validator(mode="after")
    def _check_start(self) -> Case:
        """Hold the start to the bounds of the design."""
        bounds = self.design.gain_bounds
        if bounds is not None:
            if not isinstance(self.control, Feedback):
                raise _problem(
                    f"bounds a gain that the law {self.control.law} does not have",
                    "leave design.gain_bounds out, or choose a feedback law",
                    key="design.gain_bounds",
                    value=list(bounds),
                )
            gain = self.control.gain
            if gain is not None and not bounds[0] <= gain <= bounds[1]:
                raise _outside("control.gain", gain, "design.gain_bounds", bounds)
        if self.design.blade == "optimized":
            for name in ("chord", "twist"):
                limits = getattr(self.design, f"{name}_bounds")
                for index, value in enumerate(getattr(self.rotor, name) or ()):
                    if not limits[0] <= value <= limits[1]:
                        key = f"rotor.{name}[{index}]"
                        raise _outside(key, value, f"design.{name}_bounds", limits)
        return self

    def to_yaml(self) -> str:
        """Return the case as YAML with every default written out.

        Returns
        -------
        str
            The same text for equal cases; `read_case` makes an equal case of it.
        """
        return yaml.dump(
            self.model_dump(mode="json"),
            Dumper=_Dumper,
            sort_keys=False,
            allow_unicode=True,
            width=100,
        )

    def with_overrides(self, *overrides: str) -> Case:
        """Return a case in which some keys have other values.

        Parameters
        ----------
        *overrides : str
            Such as ``rotor.radius=2`` or ``control={law: linear}``; relative paths count from the
            current folder.

        Returns
        -------
        Case
            The changed case, checked as a file would be.

        Raises
        ------
        InputError
            If an override is malformed or makes the case invalid.
        """
        return read_case(self.to_yaml(), overrides, file=f"case {self.name}")


def _outside(
    key: str, value: float, bounds_key: str, bounds: tuple[float, float]
) -> PydanticCustomError:
    return _problem(
        f"lies outside {bounds_key} = [{bounds[0]:g}, {bounds[1]:g}]",
        "the start must lie within the bounds: change one or the other",
        key=key,
        value=value,
    )


def case_json_schema() -> dict[str, Any]:
    """Return the JSON schema of a case file.

    Returns
    -------
    dict
        Descriptions are the attribute docstrings; a physical quantity has its ``unit``.
    """
    return Case.model_json_schema()


# Reading ------------------------------------------------------------------------------------------


def load_case(path: str | Path, overrides: Sequence[str] = (), *, check_files: bool = True) -> Case:
    """Read a case file.

    Parameters
    ----------
    path : str or pathlib.Path
        A YAML file.
    overrides : sequence of str
        Such as ``rotor.radius=2``; what stands after the first ``=`` is YAML.
    check_files : bool
        Whether the CSV files that the case names must exist; a result is looked at without them.

    Returns
    -------
    Case
        Named after the file unless it gives a name; relative paths of blade, polar and outline
        count from the file's folder, in overrides too, and are absolute in the case.

    Raises
    ------
    InputError
        If the file cannot be read or anything in it, or in an override, is wrong. The message names
        file, key, value and remedy.
    """
    path = Path(path)
    content = read_bytes(path, MAX_CASE_BYTES, "case file in YAML")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(
            "is not UTF-8 text", "save it as UTF-8", file=path, key=f"line {line}"
        ) from None
    return read_case(
        text,
        overrides,
        file=str(path),
        folder=path.parent,
        name=path.stem,
        check_files=check_files,
    )


def read_case(
    text: str,
    overrides: Sequence[str] = (),
    *,
    file: str = "case",
    folder: str | Path = ".",
    name: str = "case",
    check_files: bool = True,
) -> Case:
    """Make a case of YAML text.

    Parameters
    ----------
    text : str
        The case in YAML.
    overrides : sequence of str
        Such as ``rotor.radius=2``; what stands after the first ``=`` is YAML.
    file : str
        What messages call the text.
    folder : str or pathlib.Path
        Where relative paths of blade, polar and outline count from.
    name : str
        Name of a case that gives none.
    check_files : bool
        Whether the CSV files that the case names must exist.

    Returns
    -------
    Case
        The case.

    Raises
    ------
    InputError
        If anything in the text or an override is wrong.
    """
    data = _parse(text, file)
    if data is None:
        raise InputError(
            "holds no case",
            "give at least inflow: {profile: ...} and control: {law: ...}",
            file=file,
        )
    if not isinstance(data, dict):
        raise InputError(
            "must hold keys and values at its top",
            "write inflow: ... and so on",
            file=file,
            value=data,
        )
    given = {}
    for override in (overrides,) if isinstance(overrides, str) else overrides:
        key, value = _split(override, file)
        _assign(data, key, value, file)
        given[key] = override
    data.setdefault("name", name)
    try:
        return Case.model_validate(data, context={"folder": folder, "check_files": check_files})
    except ValidationError as error:
        raise _translate(error.errors(include_url=False), file, given) from None


def _split(override: str, file: str) -> tuple[str, Any]:
    """Return the dotted key and the value of an override."""
    key, equals, text = override.partition("=")
    key = key.strip()
    if not equals or not text.strip() or not re.fullmatch(r"\w+(\.\w+)*", key, re.ASCII):
        raise InputError(
            "is no override",
            "write section.key=value, such as rotor.radius=2 (null for none)",
            file=file,
            key="override",
            value=override,
        )
    return key, _parse(text, f"{file}, override {key}", key)


def _assign(data: dict[str, Any], key: str, value: object, file: str) -> None:
    *sections, last = key.split(".")
    for depth, section in enumerate(sections):
        data = data.setdefault(section, {})
        if not isinstance(data, dict):
            raise InputError(
                f"has no keys, so the override {key} cannot be made",
                "override the whole of it, or only keys of sections",
                file=file,
                key=".".join(sections[: depth + 1]),
                value=data,
            )
    data[last] = value


# YAML ---------------------------------------------------------------------------------------------

_FLOAT = r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]+)?"


class _Loader(yaml.SafeLoader):
    """Plain YAML: no anchors, aliases or tags, limited depth, and the words of YAML 1.2.

    1e-4 is a number; yes, no, on, off, 010, 1:30 and 2020-01-01 are texts.
    """

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}  # type: ignore[misc]
    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            self._refuse("anchors (&) and aliases (*) are refused: write the value out", event)
        if getattr(event, "tag", None) is not None:
            self._refuse("tags (!) are refused: write the plain value", event)
        self.depth += 1
        if self.depth > MAX_DEPTH:
            self._refuse(f"nested deeper than {MAX_DEPTH} levels", event)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    @staticmethod
    def _refuse(problem: str, event: yaml.Event) -> None:
        raise yaml.MarkedYAMLError(problem=problem, problem_mark=cast(yaml.Mark, event.start_mark))


_BOOL = re.compile("true|True|TRUE|false|False|FALSE")
_NULL = re.compile("~|null|Null|NULL|")
_INT = re.compile("[-+]?(0|[1-9][0-9]*)")
_REAL = re.compile(rf"{_FLOAT}|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS = (("bool", _BOOL), ("null", _NULL), ("int", _INT), ("float", _REAL))


class _Dumper(yaml.SafeDumper):
    """Lists on one line; quotes round a text that YAML 1.1 or 1.2 would take for another type."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_flow_list(self, data: list[Any]) -> yaml.Node:
        return self.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=True)


_Dumper.add_representer(list, _Dumper.represent_flow_list)
for _word, _pattern in _WORDS:
    _whole = re.compile(rf"^(?:{_pattern.pattern})\Z")
    for _class in (_Loader, _Dumper):
        _class.add_implicit_resolver(f"tag:yaml.org,2002:{_word}", _whole, None)


def _parse(text: str, file: str, key: str = "") -> Any:
    """Return what a YAML text holds in dict (with text keys), list, str, float, int, bool, None."""
    try:
        loader = _Loader(text)
        try:
            node = loader.get_single_node()
        finally:
            loader.dispose()
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
        place = f"line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise InputError(
            f"cannot be read as YAML: {problem}", "mend it there", file=file, key=place or key
        ) from None
    return None if node is None else _plain(node, file, (key,) if key else ())


def _plain(node: yaml.Node, file: str, path: tuple[str, ...]) -> Any:
    """Return a node of YAML as Python's own types."""
    if isinstance(node, yaml.MappingNode):
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            line = f"line {key_node.start_mark.line + 1}"
            if not (isinstance(key_node, yaml.ScalarNode) and key_node.tag.endswith(":str")):
                raise InputError(
                    f"has a key that is not a word ({line})",
                    "write a word",
                    file=file,
                    key=_dotted(path),
                )
            key = _scalar(key_node, file, path)
            if key in data:
                raise InputError(
                    f"is given twice (again in {line})",
                    "keep one of them",
                    file=file,
                    key=_dotted((*path, key)),
                    value=_plain(value_node, file, (*path, key)),
                )
            data[key] = _plain(value_node, file, (*path, key))
        return data
    if isinstance(node, yaml.SequenceNode):
        return [_plain(item, file, (*path, f"[{i}]")) for i, item in enumerate(node.value)]
    return _scalar(cast(yaml.ScalarNode, node), file, path)


def _scalar(node: yaml.ScalarNode, file: str, path: tuple[str, ...]) -> Any:
    text: str = node.value
    match node.tag.rpartition(":")[2]:
        case "null":
            return None
        case "bool":
            return text.lower() == "true"
        case "int":
            # no key takes numbers as large as the ones that are left to float, which is quick
            return int(text) if len(text) < 19 else float(text)
        case "float":
            return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(
            "holds half a character",
            "write the text without \\u escapes",
            file=file,
            key=_dotted(path),
        ) from None
    return text


# Errors -------------------------------------------------------------------------------------------


def _dotted(path: Iterable[str]) -> str:
    """Return the dotted form of a path, such as rotor.stations[2], with overlong keys cut."""
    text = ""
    for part in path:
        part = part if len(part) <= 60 else f"{part[:57]}..."
        text += part if part.startswith("[") or not text else f".{part}"
    return text


@dataclass(frozen=True)
class _Place:
    """Where in the case an error lies: its dotted key, the section it is in, the field if known."""

    key: str
    section: type[BaseModel]
    field: FieldInfo | None


def _find(location: Iterable[int | str]) -> _Place:
    """Walk down the schema; pydantic's location has the tag of a union among the keys."""
    path: list[str] = []
    section: type[BaseModel] = Case
    field: FieldInfo | None = None
    union: dict[str, type[BaseModel]] = {}
    for part in location:
        if isinstance(part, int):
            path.append(f"[{part}]")
        elif union:
            section, union, field = union[part], {}, None
        else:
            path.append(part)
            field = section.model_fields.get(part)
            union = _members(field)
            if (
                field
                and isinstance(field.annotation, type)
                and issubclass(field.annotation, Section)
            ):
                section, field = field.annotation, None
    return _Place(_dotted(path), section, field)


def _members(field: FieldInfo | None) -> dict[str, type[BaseModel]]:
    """Return the sections that a union chooses from, by tag; empty where there is no union."""
    if field is None or not isinstance(field.discriminator, str):
        return {}
    members = get_args(field.annotation)
    return {get_args(m.model_fields[field.discriminator].annotation)[0]: m for m in members}


def _translate(errors: list[ErrorDetails], file: str, overrides: dict[str, str]) -> InputError:
    """Return the first of pydantic's errors in the user's terms."""
    error = errors[0]
    context = error.get("ctx", {})
    place = _find(error["loc"])
    key, value = place.key, error["input"]
    missing = False
    match error["type"]:
        case "hkt_mdo":
            problem, remedy = context["problem"], context["remedy"]
            key = _dotted(part for part in (key, context.get("key")) if part)
            value = context.get("value", value)
            if "quantity" in context and place.field and place.field.description:
                what = re.split(r"[.;,]( |\n|$)", place.field.description, maxsplit=1)[0]
                remedy = f"give the {what[0].lower()}{what[1:]} as {context['quantity']}"
        case "extra_forbidden":
            problem, remedy = "unknown key", _suggest_key(key, str(error["loc"][-1]), place.section)
        case "missing":
            missing, problem = True, "is missing"
            tags = ", ".join(_members(place.field))
            remedy = f"give it: {_first_line(place.field)}"
            if tags:
                remedy = f"give {key}: {{{_discriminator(place.field)}: ...}} with one of {tags}"
            elif isinstance(error["loc"][-1], int):
                remedy = "give two values, [lower, upper]"
        case "union_tag_not_found":
            tags = ", ".join(_members(place.field))
            missing, problem, remedy = True, "is missing", f"give one of {tags}"
            key = f"{key}.{_discriminator(place.field)}"
        case "union_tag_invalid":
            key = f"{key}.{_discriminator(place.field)}"
            value = cast(dict[str, Any], value).get(_discriminator(place.field))
            problem, remedy = "unknown", _suggest(value, tuple(_members(place.field)))
        case "literal_error":
            choices = get_args(place.field.annotation) if place.field else ()
            problem, remedy = "unknown", _suggest(value, choices)
        case "model_type" | "model_attributes_type" | "dict_type":
            problem = "must be a section of keys and values"
            remedy = "write keys below it, or leave it out where it has defaults"
        case "tuple_type":
            problem, remedy = "must be a list", "write [first, second, ...]"
        case "too_short" | "too_long":
            limit = context.get("min_length", context.get("max_length"))
            words = "at least" if error["type"] == "too_short" else "at most"
            problem = f"must have {words} {limit} values, and has {context['actual_length']}"
            remedy = "add some" if error["type"] == "too_short" else "take some out"
        case "int_type":
            problem, remedy = "must be a whole number", "write it without a point, a unit or quotes"
        case "greater_than_equal":
            problem, remedy = f"must be at least {context['ge']}", "give a larger number"
        case "less_than_equal":
            problem, remedy = f"must be at most {context['le']}", "give a smaller number"
        case "string_type":
            problem, remedy = "must be a text", "write it in quotes if it looks like a number"
        case "string_pattern_mismatch" | "string_too_long" | "string_too_short":
            problem = "must be up to 100 letters, digits, _ - . and begin with none of - ."
            remedy = "give such a name:; without one the case is named after its file"
        case _:
            problem, remedy = error["msg"], _first_line(place.field)
    if len(errors) > 1:
        remedy = f"{remedy} (and {len(errors) - 1} more)"
    for overridden, text in overrides.items():
        if key == overridden or key.startswith((f"{overridden}.", f"{overridden}[")):
            file = f"{file}, override {text if len(text) <= 60 else text[:57] + '...'}"
            break
    if missing:
        return InputError(problem, remedy, file=file, key=key)
    return InputError(problem, remedy, file=file, key=key, value=value)


def _discriminator(field: FieldInfo | None) -> str:
    return str(field.discriminator) if field else ""


def _first_line(field: FieldInfo | None) -> str:
    return (field.description or "").partition("\n")[0] if field else ""


def _suggest(value: object, choices: Sequence[object]) -> str:
    words = [str(choice) for choice in choices]
    near = difflib.get_close_matches(value[:60], words, n=1) if isinstance(value, str) else []
    return f"{f'did you mean {near[0]}? ' if near else ''}give one of {', '.join(words)}"


def _suggest_key(dotted: str, key: str, section: type[BaseModel]) -> str:
    """Return the nearest key of the section, or the sections that do have the key."""
    known = list(section.model_fields)
    near = difflib.get_close_matches(key[:60], known, n=1)
    homes = [f"{name}.{key}" for name, field in Case.model_fields.items() if key in _keys(field)]
    homes = [home for home in homes if home != dotted]
    guess = f"did you mean {' or '.join(near or homes)}? " if near or homes else ""
    return f"{guess}known here: {', '.join(known)}"


def _keys(field: FieldInfo) -> set[str]:
    """Return the keys of a section, or of all that a union chooses from."""
    members: list[Any] = list(_members(field).values()) or [field.annotation]
    return {key for member in members for key in getattr(member, "model_fields", ())}
