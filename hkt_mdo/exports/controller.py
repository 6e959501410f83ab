"""The control law of a result as code: a function in C99 and one in Python.

Expressions that are the same in C and Python, such as ``GAIN * w``, are written here once.
"""

from inspect import cleandoc
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from hkt_mdo.dynamics.estimate import FlowEstimate
from hkt_mdo.dynamics.wide_laws import BEND, STILL
from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Format, filled, provenance
from hkt_mdo.exports.tables import cut_in
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
    steps : dict of str
        Expressions by name, one after the other; the last is the torque before saturation.
    curves : dict of PPoly
        Piecewise cubic curves by the name of their function, linear beyond their ends.
    """

    constants: dict[str, tuple[float, str]]
    steps: dict[str, str]
    curves: dict[str, PPoly]


class Controller(Format):
    """The control law: a C99 function with its header, and a Python function."""

    sample_time: Annotated[float, Quantity("s", gt=0)] | None = None
    """Time step of a law with states; null: a fifth of the loop's time constant J / kp, and a
    hundredth of a second at most."""

    def files(self, design: Design) -> dict[str, bytes]:
        law: Any = design.law
        if not law.is_feedback:
            problem = f"{law.law} is a torque over time and no law of the rotor's speed"
            remedy = "export csv, whose trajectory has it, or run the case with a feedback law"
            raise InputError(problem, remedy, key="--to", value="controller")
        code = _code(design)
        if code is None:
            problem = f"{law.law} is a law of an extension, known as Python code only"
            remedy = "write its code yourself; csv has its gains and its steady operation"
            raise InputError(problem, remedy, key="--to", value="controller")
        constants, steps = code.constants, code.steps | {"torque": "demand"}
        if law.torque_limit is not None:
            limit = law.torque_limit, "largest torque, N m"
            smoothing = law.smoothing, "smoothing of the saturation"
            constants = constants | {"LIMIT": limit, "SMOOTHING": smoothing}
            steps = code.steps | _SATURATED
        words = {
            # a backslash or a trigraph would continue the comment on the next line
            "head": [x.replace("\\", "/").replace("??", "? ?") for x in _head(design)],
            "constants": constants,
            "curves": {name: _rows(curve) for name, curve in code.curves.items()},
            "steps": steps,
            "sensed": _SENSED if law.estimates_flow else {},
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


def _code(design: Design) -> Code | None:
    """Return the law of a design as code; None for one that is known as Python code only."""
    law: Any = design.law
    gains = design.gains.tolist()
    match law.law:
        case "linear":
            return Code({"GAIN": (gains[0], "N m s/rad")}, {"demand": "GAIN * w"}, {})
        case "quadratic":
            return Code({"GAIN": (gains[0], "N m s^2/rad^2")}, {"demand": "GAIN * w * w"}, {})
        case "power_law":
            constants = {
                "GAIN": (gains[0], "torque at 1 rad/s, N m"),
                "EXPONENT": (gains[1] if law.exponent is None else law.exponent, "exponent"),
            }
            demand = "GAIN * pow(fmax(w, STILL), EXPONENT)"
            return Code(constants | _STILL, {"demand": demand}, {})
        case "rated":
            constants = {
                "GAIN": (gains[0], "N m s^2/rad^2"),
                "POWER": (gains[1] if law.power is None else law.power, "rated power, W"),
                "SMOOTHING": (law.smoothing, "smoothing of the corner and of the saturation"),
            }
            return Code(constants, _RATED, {})
        case "curve":
            demand = "exp(curve(log(fmax(w, STILL))))"
            return Code(_STILL, {"demand": demand}, {"curve": _curve(design)})
        case "tracking":
            return _tracking(design)
    return None


def _curve(design: Design) -> PPoly:
    """Return the logarithm of the torque of a curve over that of the speed."""
    law: Any = design.law
    place, height = np.log(design.gains).reshape(2, -1)
    curve = CubicSpline(place, height, bc_type="natural")
    # beyond each end a parabola over BEND, then a line
    (below, above), (less, more) = law.beyond(design.gains)
    at, slope = height[0] - (below + 0.5 * less) * BEND, below + less
    pieces = [[0.0, 0.0], [0.0, -0.5 * less / BEND], [slope, slope], [at - slope, at]]
    curve.extend(np.array(pieces), place[0] - BEND - np.array([1.0, 0.0]))
    at, slope = height[-1] + (above + 0.5 * more) * BEND, above + more
    pieces = [[0.0, 0.0], [0.5 * more / BEND, 0.0], [above, slope], [height[-1], at]]
    curve.extend(np.array(pieces), place[-1] + BEND + np.array([0.0, 1.0]))
    return curve


def _tracking(design: Design) -> Code:
    law: Any = design.law
    *speeds, kp, ki = design.gains.tolist()
    slowest, fastest = law.flow_range
    knots = np.linspace(slowest, fastest, law.knots)
    curves: dict[str, PPoly] = {"schedule": CubicSpline(knots, speeds, bc_type="natural")}
    constants = {
        "PROPORTIONAL": (kp, "N m s/rad"),
        "INTEGRAL": (ki, "N m/rad"),
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
            "FRICTION": (design.plant.generator.shaft_friction, "of the shaft, N m"),
            "FRICTION_SLOPE": (design.plant.generator.shaft_friction_slope, "by speed, N m s/rad"),
        }
        constants |= _STILL
    return Code(constants, {"demand": "PROPORTIONAL * (w - schedule(flow)) + integral"}, curves)


_STILL = {"STILL": (STILL, "slowest speed that counts, rad/s")}
_RATED = {
    "wanted": "GAIN * w * w * w",
    "apart": "wanted - POWER",
    "root": "sqrt(apart * apart + 0.25 * SMOOTHING * wanted * POWER)",
    "least": "(2.0 - 0.125 * SMOOTHING) * POWER / (wanted + POWER + root)",
    "demand": "least * GAIN * w * w",
}


# Code ---------------------------------------------------------------------------------------------

_SATURATED = {
    "ratio": "2.0 * demand / LIMIT",
    "rising": "sqrt(SMOOTHING + ratio * ratio)",
    "falling": "sqrt(SMOOTHING + (ratio - 2.0) * (ratio - 2.0))",
    "torque": "0.25 * LIMIT * (2.0 + rising - falling)",
}
_SENSED = {
    "tip": "fmax(w, STILL) * RADIUS",
    "volume": "3.141592653589793 * RADIUS * RADIUS * RADIUS",
    "unit": "0.5 * DENSITY * volume * tip * tip",
    "driving": "torque + FRICTION + FRICTION_SLOPE * w + INERTIA * acceleration",
    "coefficient": "driving / unit",
    "sensed": "tip / ratio_of(fmin(fmax(coefficient, SMALLEST), LARGEST))",
}


def _rows(curve: PPoly) -> tuple[list[list[float]], float]:
    """Return the knots of a curve with the coefficients that begin there, and its end."""
    return np.column_stack((curve.x[:-1], curve.c[::-1].T)).tolist(), float(curve.x[-1])


def _head(design: Design) -> list[str]:
    """Return the lines of the comment at the top: where the code comes from, and its formula."""
    solution, law = design.solution, design.law
    speeds = [own.trajectory["rotor_speed_rad_s"] for own in solution.tables.values()]
    ends = f"{min(map(np.min, speeds)):.5g} to {max(map(np.max, speeds)):.5g} rad/s"
    formula = cleandoc(type(law).__doc__ or "").splitlines()
    lines = [*provenance(solution), "", *formula, ""]
    lines.append(f"rotor speeds in the operation of the result: {ends}")
    for name, flow in (("cut-in", cut_in(design)), ("cut-out", law.cut_out)):
        if flow:
            lines.append(f"{name}, not part of this code: a flow of {flow:g} m/s")
    names = [
        f"{each.name} {each.upper:g} {each.unit or ''}".rstrip()
        for each in design.physics.all_limits
        if each.caps_series and each.name != "control_torque"
    ]
    if names:
        lines.append(f"limits of the case that this code does not check: {'; '.join(names)}")
    return lines
