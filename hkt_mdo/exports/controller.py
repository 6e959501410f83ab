"""The control law of a result as code: a function in C99 and one in Python.

Expressions that are the same in C and Python, such as ``GAIN * w``, are written here once.
"""

from collections.abc import Callable
from inspect import cleandoc
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from hkt_mdo.dynamics.estimate import FlowEstimate
from hkt_mdo.dynamics.laws import LinearFeedback, QuadraticFeedback
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.dynamics.wide_laws import BEND, STILL, CurveFeedback, PowerLawFeedback, RatedFeedback
from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Format, Source, filled
from hkt_mdo.results.design import Design
from hkt_mdo.sections import Quantity

# sample time: share of the loop's time constant, and its largest value, s
QUICK, LONGEST = 0.2, 0.01
# sample time over that constant above which a torque held between samples is unstable
UNSTABLE = 2.0


class Code(NamedTuple):
    """A law as expressions that are valid in C and Python, in SI units; w is the rotor's speed.

    Attributes
    ----------
    constants : dict of (float, str)
        Value and meaning of each constant, by name.
    steps : tuple of (str, str)
        Names and expressions, one after the other; the last is the torque before saturation.
    curves : dict of PPoly
        Piecewise cubic curves by the name of their function, linear beyond their ends.
    """

    constants: dict[str, tuple[float, str]]
    steps: tuple[tuple[str, str], ...]
    curves: dict[str, PPoly]


class Controller(Format):
    """The control law: a C99 function with its header, and a Python function."""

    name: ClassVar[str] = "controller"

    sample_time: Annotated[float, Quantity("s", gt=0)] | None = None
    """Time step of a law with states; null: a fifth of the loop's time constant J / kp, and a
    hundredth of a second at most."""

    def files(self, source: Source) -> dict[str, bytes]:
        design = source.design
        law: Any = design.law
        writer = _WRITERS.get(type(law))
        if not law.is_feedback:
            problem = f"{law.law} is a torque over time and no law of the rotor's speed"
            remedy = "export csv, whose trajectory has it, or run the case with a feedback law"
            raise InputError(problem, remedy, key="--to", value=self.name)
        if writer is None:
            problem = f"{law.law} is a law of an extension, known as Python code only"
            remedy = "write its code yourself; csv has its gains and its steady operation"
            raise InputError(problem, remedy, key="--to", value=self.name)
        code = writer(design)
        steps = (*code.steps, ("torque", "demand"))
        if law.torque_limit is not None:
            code.constants["LIMIT"] = law.torque_limit, "largest torque, N m"
            code.constants["SMOOTHING"] = law.smoothing, "smoothing of the saturation"
            steps = (*code.steps, *_SATURATED)
        words = {
            # a backslash or a trigraph would continue the comment on the next line
            "head": [x.replace("\\", "/").replace("??", "? ?") for x in _head(source)],
            "constants": code.constants,
            "curves": {name: _rows(curve) for name, curve in code.curves.items()},
            "steps": steps,
            "sensed": _SENSED if "ratio_of" in code.curves else (),
            "sample_time": self._sample_time(design) if law.states else 0.0,
        }
        names = ("controller.h", "controller.c", "controller.py")
        return {name: filled(f"{name}.in", words).encode() for name in names}

    def _sample_time(self, design: Design) -> float:
        """Return the time between two steps; refuse one at which a held torque is unstable."""
        answers = design.inertia / float(design.gains[-2])
        if self.sample_time is None:
            wanted = min(QUICK * answers, LONGEST)
            unit = 10.0 ** np.floor(np.log10(wanted))
            return float(f"{np.floor(wanted / unit) * unit:.1g}")
        if self.sample_time >= UNSTABLE * answers:
            problem = "makes the loop unstable, because the torque is constant between two steps"
            remedy = f"give less than 2 J / kp = {UNSTABLE * answers:.3g} s, better a tenth of it"
            raise InputError(problem, remedy, key="controller.sample_time", value=self.sample_time)
        return self.sample_time


# Laws ---------------------------------------------------------------------------------------------


def _linear(design: Design) -> Code:
    gain = {"GAIN": (float(design.gains[0]), "N m s/rad")}
    return Code(gain, (("demand", "GAIN * w"),), {})


def _quadratic(design: Design) -> Code:
    gain = {"GAIN": (float(design.gains[0]), "N m s^2/rad^2")}
    return Code(gain, (("demand", "GAIN * w * w"),), {})


def _power_law(design: Design) -> Code:
    law: Any = design.law
    exponent = design.gains[1] if law.exponent is None else law.exponent
    constants = {
        "GAIN": (float(design.gains[0]), "torque at 1 rad/s, N m"),
        "EXPONENT": (float(exponent), "exponent"),
        "STILL": (STILL, "slowest speed that counts, rad/s"),
    }
    return Code(constants, (("demand", "GAIN * pow(fmax(w, STILL), EXPONENT)"),), {})


def _rated(design: Design) -> Code:
    law: Any = design.law
    constants = {
        "GAIN": (float(design.gains[0]), "N m s^2/rad^2"),
        "POWER": (float(design.gains[1] if law.power is None else law.power), "rated power, W"),
        "SMOOTHING": (law.smoothing, "smoothing of the corner and of the saturation"),
    }
    steps = (
        ("wanted", "GAIN * w * w * w"),
        ("apart", "wanted - POWER"),
        ("root", "sqrt(apart * apart + 0.25 * SMOOTHING * wanted * POWER)"),
        ("least", "(2.0 - 0.125 * SMOOTHING) * POWER / (wanted + POWER + root)"),
        ("demand", "least * GAIN * w * w"),
    )
    return Code(constants, steps, {})


def _curve(design: Design) -> Code:
    law: Any = design.law
    place, height = np.log(design.gains).reshape(2, -1)
    constants = {"STILL": (STILL, "slowest speed that counts, rad/s")}
    steps = (("demand", "exp(curve(log(fmax(w, STILL))))"),)
    curve = CubicSpline(place, height, bc_type="natural")
    # beyond each end a parabola over BEND, then a line
    (below, above), (less, more) = law.beyond(design.gains)
    at, slope = height[0] - (below + 0.5 * less) * BEND, below + less
    pieces = [[0.0, 0.0], [0.0, -0.5 * less / BEND], [slope, slope], [at - slope, at]]
    curve.extend(np.array(pieces), place[0] - BEND - np.array([1.0, 0.0]))
    at, slope = height[-1] + (above + 0.5 * more) * BEND, above + more
    pieces = [[0.0, 0.0], [0.5 * more / BEND, 0.0], [above, slope], [height[-1], at]]
    curve.extend(np.array(pieces), place[-1] + BEND + np.array([0.0, 1.0]))
    return Code(constants, steps, {"curve": curve})


def _tracking(design: Design) -> Code:
    law: Any = design.law
    kp, ki = design.gains[-2:]
    slowest, fastest = law.flow_range
    knots = np.linspace(slowest, fastest, law.knots)
    curves: dict[str, PPoly] = {
        "schedule": CubicSpline(knots, design.gains[: law.knots], bc_type="natural")
    }
    constants = {
        "PROPORTIONAL": (float(kp), "N m s/rad"),
        "INTEGRAL": (float(ki), "N m/rad"),
        "LAG": (law.lag, "with which the flow speed is followed, s; 0: at once"),
    }
    if law.estimates_flow:
        curves["ratio_of"] = found = FlowEstimate(design.plant).ratio_of
        constants |= {
            "SMALLEST": (float(found.x[0]), "driving torque over that of the tip speed, at least"),
            "LARGEST": (float(found.x[-1]), "and at most"),
            "RADIUS": (design.blade.rotor_radius, "radius of the rotor, m"),
            "DENSITY": (design.physics.density, "density of the water, kg/m^3"),
            "INERTIA": (design.inertia, "of the rotor, kg m^2"),
            "STILL": (STILL, "slowest speed that counts, rad/s"),
        }
    return Code(constants, (("demand", "PROPORTIONAL * (w - schedule(flow)) + integral"),), curves)


_WRITERS: dict[type, Callable[[Design], Code]] = {
    LinearFeedback: _linear,
    QuadraticFeedback: _quadratic,
    PowerLawFeedback: _power_law,
    RatedFeedback: _rated,
    CurveFeedback: _curve,
    Tracking: _tracking,
}


# Code ---------------------------------------------------------------------------------------------

_SATURATED = (
    ("ratio", "2.0 * demand / LIMIT"),
    ("rising", "sqrt(SMOOTHING + ratio * ratio)"),
    ("falling", "sqrt(SMOOTHING + (ratio - 2.0) * (ratio - 2.0))"),
    ("torque", "0.25 * LIMIT * (2.0 + rising - falling)"),
)
_SENSED = (
    ("tip", "fmax(w, STILL) * RADIUS"),
    ("volume", "3.141592653589793 * RADIUS * RADIUS * RADIUS"),
    ("unit", "0.5 * DENSITY * volume * tip * tip"),
    ("coefficient", "(torque + INERTIA * acceleration) / unit"),
    ("sensed", "tip / ratio_of(fmin(fmax(coefficient, SMALLEST), LARGEST))"),
)


def _rows(curve: PPoly) -> tuple[list[list[float]], float]:
    """Return the knots of a curve with the coefficients that begin there, and its end."""
    return np.column_stack((curve.x[:-1], curve.c[::-1].T)).tolist(), float(curve.x[-1])


def _head(source: Source) -> list[str]:
    """Return the lines of the comment at the top: where the code comes from, and its formula."""
    design, speeds = source.design, []
    for own in source.solution.tables.values():
        speeds += [np.min(own.trajectory["rotor_speed_rad_s"])]
        speeds += [np.max(own.trajectory["rotor_speed_rad_s"])]
    lines = [*source.provenance, "", *cleandoc(type(design.law).__doc__ or "").splitlines(), ""]
    ends = f"{min(speeds):.5g} to {max(speeds):.5g} rad/s"
    lines.append(f"rotor speeds in the operation of the result: {ends}")
    if design.law.cut_out is not None:
        lines.append(f"cut-out, not part of this code: a flow of {design.law.cut_out:g} m/s")
    names = [
        f"{each.name} {each.upper:g} {each.unit or ''}".rstrip()
        for each in design.physics.all_limits
        if each.caps_series and each.name != "control_torque"
    ]
    if names:
        lines.append(f"limits of the case that this code does not check: {'; '.join(names)}")
    return lines
