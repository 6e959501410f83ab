"""How a case is optimized: sections `design`, `phase`, `start`, `hydrodynamics`, `driver`."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, Field, Strict, ValidationInfo

from hkt_mdo.sections import Flaws, Pair, Quantity, Section, find_file

_Lengths = Pair[Annotated[float, Quantity("m", gt=0, le=1000)]]
_Angles = Pair[Annotated[float, Quantity("deg", ge=-180, le=180)]]
_Points = Annotated[int, Strict(), Field(ge=2, le=200)]


def _find_result(value: str, info: ValidationInfo) -> str:
    """Return the folder of a result as an absolute path, from the case's folder."""
    for name in ("case.yaml", "summary.json"):
        problem = f"is no result folder: it lacks {name}"
        find_file(f"{value}/{name}", info, problem, "give the folder of a finished run")
    return str((Path((info.context or {}).get("folder", ".")) / value).resolve())


class Design(Section):
    """What is designed, and within which bounds (paper, eq. 7)."""

    blade: Literal["optimized", "fixed"] = "optimized"
    """Whether chord and twist are optimized with the control, or kept."""
    chord_bounds: _Lengths | None = None
    """Bounds on the chord, [lower, upper]; null: from a fifth of the starting blade's smallest
    chord to three times its largest, and [0.01, 1] for the paper's rotor."""
    twist_bounds: _Angles = (-30.0, 30.0)
    """Bounds on the twist, [lower, upper]."""
    chord_points: _Points | None = None
    """Number of control points of a cubic B-spline of the chord along the span. Null: the chord of
    each station for up to 20 stations of one section, else 8 points."""
    twist_points: _Points | None = None
    """Number of control points of the twist along the span, as `chord_points`."""
    thickness_points: _Points | None = None
    """Number of control points of the thickness over chord, as `chord_points`; null: it is not
    designed (docs/own_turbine.md)."""
    thickness_bounds: Pair[Annotated[float, Quantity(gt=0, le=1)]] | None = None
    """Bounds on the thickness over chord, [lower, upper]; null: from the thinnest to the thickest
    section."""
    set_angle_bounds: _Angles | None = None
    """Bounds on the set angle of a fixed blade, [lower, upper]; null: it is not designed."""
    radius_bounds: _Lengths | None = None
    """Bounds on the tip radius R, [lower, upper]; null: it is not designed. Stations and hub move
    with it."""
    hub_inertia_bounds: Pair[Annotated[float, Quantity("kg*m**2", ge=0)]] | None = None
    """Bounds on `rotor.hub_inertia`, [lower, upper]; null: it is not designed. With
    `inflow_dynamics: oye` the lower bound is at least the inertia from which the loop is stable."""
    hub_inertia_price: Annotated[float, Quantity("J/(kg*m**2)", ge=0)] = 0.0
    """Price of the designed `hub_inertia`, subtracted from the objective, an energy; the energies
    of a result are without it."""
    gain_bounds: Pair[Annotated[float, Quantity(ge=0)]] | None = None
    """Bounds on the gain of a law with one, [lower, upper], plain numbers in the unit of
    `control.gain`; null: none."""

    def flaws(self) -> Flaws:
        for name in ("chord_points", "twist_points", "thickness_points"):
            if self.blade == "fixed" and getattr(self, name):
                problem = "gives the control points of a blade that is fixed"
                yield name, problem, "give design.blade: optimized, or leave it out"
        if self.thickness_bounds is not None and self.thickness_points is None:
            problem, remedy = "bounds a thickness that is not designed", "give thickness_points"
            yield "thickness_bounds", problem, remedy
        if self.hub_inertia_price and self.hub_inertia_bounds is None:
            problem, remedy = "prices an inertia that is not designed", "give hub_inertia_bounds"
            yield "hub_inertia_price", problem, remedy
        if self.blade == "optimized" and self.set_angle_bounds is not None:
            problem = "bounds a set angle, which the designed twist includes already"
            remedy = "give design.blade: fixed, or widen design.twist_bounds instead"
            yield "set_angle_bounds", problem, remedy


class Phase(Section):
    """The time span and its discretization."""

    duration: Annotated[float, Quantity("s", gt=0, le=3.2e7)] | None = None
    """Duration; null: that of the flow's record, or 60 s, which the paper's tables imply."""
    segments: Annotated[int, Strict(), Field(ge=2, le=20000)] | None = None
    """Number of collocation segments; null: 60, or eight in each period of the flow's highest
    frequency, if more."""
    transcription: Literal["gauss-lobatto", "radau"] = "gauss-lobatto"
    """Collocation method: Gauss-Lobatto or Radau nodes in each segment."""
    order: Literal[3, 5, 7, 9] = 3
    """Order of the polynomials in each segment."""
    initial_speed: Literal["auto", "free", "equilibrium"] = "auto"
    """Rotor speed at t = 0: `free`, or in `equilibrium`; `auto`: `free` for open loop,
    `equilibrium` for feedback."""
    final_speed: Literal["auto", "free", "initial"] = "auto"
    """Rotor speed at the end: `free`, or, for open loop, `initial`, that of t = 0; `auto`:
    `initial` for open loop, `free` for feedback and with a limit on a rate. Stored energy is
    limited to 1 % (docs/checks.md)."""


class Start(Section):
    """Where the optimization starts."""

    method: Literal["quasi_steady", "blade"] = "quasi_steady"
    """`quasi_steady` improves blade and gain by quasi-steady co-design first; `blade` starts from
    the blade as given, and ends at a local optimum near it."""
    from_: Annotated[str, AfterValidator(_find_result)] | None = Field(default=None, alias="from")
    """Folder of an earlier result, whose design the search for a start tries as well; with `method:
    blade` the optimization begins there."""
    branch: Literal["best", "overspeed", "underspeed"] = "best"
    """Whether the start keeps limits by turning faster (`overspeed`) or slower (`underspeed`) than
    at the best tip speed ratio; `best`: by the larger objective."""


class Hydrodynamics(Section):
    """How the rotor's torque is computed."""

    bem: Literal["vectorized", "ccblade"] = "vectorized"
    """Blade element momentum solver of the optimization: the package's own, or WISDEM's, which is
    slower and needs `hkt_mdo[ccblade]`."""
    torque: Literal["curve", "direct"] = "curve"
    """`curve`: torque coefficient over tip speed ratio, computed once for each design; `direct`:
    the solver runs at every node."""
    tolerance: Annotated[float, Quantity(ge=1e-8, le=1e-2)] = 1e-4
    """Largest relative torque error of the curve; above it the curve is refined."""
    check: Literal["vectorized", "ccblade"] = "vectorized"
    """Solver of the independent simulation, as for `bem`."""


class InflowDynamics(Section):
    """How the induced velocity follows changes of rotor speed and flow speed.

    The name of the model may stand alone, `inflow_dynamics: oye`.
    """

    short: ClassVar[str] = "model"
    model: Literal["quasi_steady", "oye"] = "quasi_steady"
    """`quasi_steady`: without delay; `oye`: with the two filters of Oye (docs/dynamic_inflow.md).
    """
    tau1: Annotated[float, Quantity("s", ge=1e-3, le=1e4)] | None = None
    """Time constant of the slow filters of `oye`; null: by the induction at 0.7 R."""

    @property
    def remembers(self) -> bool:
        """Whether the wake has memory."""
        return self.model == "oye"

    def flaws(self) -> Flaws:
        if self.tau1 is not None and not self.remembers:
            problem = "has no effect on a wake without memory"
            yield "tau1", problem, "give model: oye, or leave it out"


_OPTIMIZERS = "IPOPT", "SLSQP", "SNOPT"
_PROVIDES = {"casadi": "IPOPT", "scipy": "SLSQP"}


class Driver(Section):
    """The optimizer and the package that provides it."""

    package: Literal["auto", "pyoptsparse", "casadi", "scipy"] = "auto"
    """`auto`: pyoptsparse if it is installed and has the optimizer, else casadi (IPOPT) or scipy
    (SLSQP). Only pyoptsparse has SNOPT."""
    optimizer: Annotated[
        Literal["IPOPT", "SLSQP", "SNOPT"],
        BeforeValidator(lambda value: value.upper() if isinstance(value, str) else value),
        Field(json_schema_extra={"enum": [*_OPTIMIZERS, *map(str.lower, _OPTIMIZERS)]}),
    ] = "IPOPT"
    """Optimizer, in capital or small letters."""
    tolerance: Annotated[float, Quantity(ge=1e-12, le=1e-2)] = 1e-7
    """Tolerance on optimality and feasibility of the scaled problem."""
    max_iterations: Annotated[int, Strict(), Field(ge=1, le=1_000_000)] = 1000
    """Largest number of major iterations."""

    def flaws(self) -> Flaws:
        only = _PROVIDES.get(self.package, self.optimizer)
        if self.optimizer != only:
            problem = f"is not provided by the package {self.package}, which provides {only}"
            yield "optimizer", problem, f"give driver.optimizer: {only}, or driver.package: auto"
