"""How a case is optimized: sections `design`, `phase`, `start`, `hydrodynamics`, `driver`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    Strict,
    field_validator,
    model_validator,
)

from hkt_mdo.sections import Quantity, Section, ordered, refusal, upper

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

    chord_bounds: Annotated[_Chords, AfterValidator(ordered)] = (0.01, 1.0)
    """Bounds on the chord, [lower, upper]."""

    twist_bounds: Annotated[_Angles, AfterValidator(ordered)] = (-30.0, 30.0)
    """Bounds on the twist, [lower, upper]."""

    chord_points: Annotated[int, Strict(), Field(ge=2, le=200)] | None = None
    """Number of control points of a cubic B-spline that is the chord along the span; as many as
    there are stations, or more: the chord is designed at the stations. Null: at the stations if
    there are 20 or fewer, else 8."""

    twist_points: Annotated[int, Strict(), Field(ge=2, le=200)] | None = None
    """Number of control points of a cubic B-spline that is the twist along the span; as many as
    there are stations, or more: the twist is designed at the stations. Null: at the stations if
    there are 20 or fewer, else 8."""

    set_angle_bounds: Annotated[_Angles, AfterValidator(ordered)] | None = None
    """Bounds on the set angle of a fixed blade, [lower, upper]; null: it is not designed. A twist
    that is designed has the set angle in it."""

    radius_bounds: Annotated[_Chords, AfterValidator(ordered)] | None = None
    """Bounds on the tip radius R, [lower, upper]; null: it is not designed. Stations and hub move
    with it; a fixed blade is scaled as a whole."""

    gain_bounds: Annotated[_Gains, AfterValidator(ordered)] | None = None
    """Bounds on the feedback gain, [lower, upper], plain numbers in the unit of `control.gain`;
    null: scaled from the gain at the start."""

    @model_validator(mode="after")
    def _check_designed(self) -> Design:
        points = [name for name in ("chord_points", "twist_points") if getattr(self, name)]
        if self.blade == "fixed" and points:
            raise refusal(
                "shapes a blade that is fixed",
                "give design.blade: optimized, or leave it out",
                key=points[0],
                value=getattr(self, points[0]),
            )
        if self.blade == "optimized" and self.set_angle_bounds is not None:
            raise refusal(
                "bounds a set angle that a designed twist has in it already",
                "give design.blade: fixed, or widen design.twist_bounds instead",
                key="set_angle_bounds",
                value=list(self.set_angle_bounds),
            )
        return self


class Phase(Section):
    """The time span and its discretization."""

    duration: Annotated[float, Quantity("s", gt=0)] | None = None
    """Duration; null: that of the flow's record, or 60 s, which the paper's tables imply."""

    segments: Annotated[int, Strict(), Field(ge=2, le=20000)] | None = None
    """Number of collocation segments; null: 60, or as many as the flow's highest frequency asks
    for, eight a period."""

    transcription: Literal["gauss-lobatto", "radau"] = "gauss-lobatto"
    """Collocation method: Gauss-Lobatto's or Radau's nodes in each segment."""

    order: Annotated[int, Strict(), Field(ge=3, le=9, json_schema_extra={"enum": [3, 5, 7, 9]})] = 3
    """Order of the polynomials of a segment."""

    initial_speed: Literal["auto", "free", "equilibrium"] = "auto"
    """Rotor speed at t = 0: `free` for the optimizer to choose, or in `equilibrium` (hydrodynamic
    and control torque balance); `auto`: free for open loop, equilibrium for feedback."""

    @field_validator("order")
    @classmethod
    def _check_odd(cls, value: int) -> int:
        if value % 2 == 0:
            raise refusal("must be odd", "give 3, 5, 7 or 9")
        return value


class Start(Section):
    """Where the optimization begins."""

    method: Literal["quasi_steady", "blade"] = "quasi_steady"
    """`quasi_steady` improves blade and gain by quasi-steady co-design before the dynamic
    optimization; `blade` starts from the blade as given."""


class Hydrodynamics(Section):
    """How the rotor's torque is computed."""

    bem: Literal["vectorized", "ccblade"] = "vectorized"
    """Blade element momentum solver of the optimization: `vectorized`, the package's own, or
    `ccblade`, WISDEM's CCBlade, which is slower and needs `hkt_mdo[ccblade]`."""

    torque: Literal["curve", "direct"] = "curve"
    """`curve`: a torque coefficient over tip speed ratio, computed once a design; `direct`: the
    solver at every node of the trajectory."""

    tolerance: Annotated[float, Quantity(ge=1e-8, le=1e-2)] = 1e-4
    """Largest relative torque error of the curve along the trajectory; beyond it the curve is
    refined."""

    check: Literal["vectorized", "ccblade"] = "vectorized"
    """Blade element momentum solver of the independent simulation, as `bem`."""


_OPTIMIZERS = "IPOPT", "SLSQP", "SNOPT"
_PROVIDES = {"casadi": "IPOPT", "scipy": "SLSQP"}


class Driver(Section):
    """The optimizer and the package that provides it."""

    package: Literal["auto", "pyoptsparse", "casadi", "scipy"] = "auto"
    """Package that provides the optimizer; `auto` takes pyoptsparse where it is installed and has
    it, else casadi (IPOPT) or scipy (SLSQP). SNOPT comes with pyoptsparse alone."""

    optimizer: Annotated[
        Literal["IPOPT", "SLSQP", "SNOPT"],
        BeforeValidator(upper),
        Field(json_schema_extra={"enum": [*_OPTIMIZERS, *map(str.lower, _OPTIMIZERS)]}),
    ] = "IPOPT"
    """Optimizer, in capitals or not."""

    tolerance: Annotated[float, Quantity(ge=1e-12, le=1e-2)] = 1e-7
    """Tolerance on optimality and feasibility of the scaled problem."""

    max_iterations: Annotated[int, Strict(), Field(ge=1, le=1_000_000)] = 1000
    """Largest number of major iterations."""

    @model_validator(mode="after")
    def _check_package(self) -> Driver:
        only = _PROVIDES.get(self.package, self.optimizer)
        if self.optimizer != only:
            raise refusal(
                f"is not provided by the package {self.package}, which provides {only}",
                f"give driver.optimizer: {only}, or driver.package: auto",
                key="optimizer",
                value=self.optimizer,
            )
        return self
