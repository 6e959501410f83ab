"""The control law of a result as code: a function in C99 and one in Python.

Expressions that are the same in C and Python, such as ``GAIN * w``, are in ``laws.yaml`` once.
"""

from inspect import cleandoc
from typing import Annotated, Any

import numpy as np
import yaml
from scipy.interpolate import CubicHermiteSpline, PPoly

from hkt_mdo.dynamics.estimate import FlowEstimate
from hkt_mdo.dynamics.wide_laws import STILL
from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import TEMPLATES, Format, beside_law, filled, provenance
from hkt_mdo.results.design import Design
from hkt_mdo.sections import Quantity

# sample time: share of the loop's time constant, and its largest value, s
QUICK, LONGEST = 0.2, 0.01
# sample time over that constant above which a torque held between samples is unstable
UNSTABLE = 2.0


LAWS: dict[str, dict[str, str]] = yaml.safe_load((TEMPLATES / "laws.yaml").read_text("utf-8"))
"""Expressions of each law by name, and, in capitals, constants with their meaning."""


class Controller(Format):
    """The control law: a C99 function with its header, and a Python function."""

    sample_time: Annotated[float, Quantity("s", gt=0)] | None = None
    """Time step of a law with states; null: a fifth of the loop's time constant J / kp, and a
    hundredth of a second at most."""

    def files(self, design: Design) -> dict[str, str]:
        law: Any = design.law
        if law.law not in LAWS:
            problem = f"has no code for {law.law}: an open loop is a torque over time, and a law "
            problem += "of an extension is known as Python code only"
            remedy = "export csv, or run the case with a feedback law of this program"
            raise InputError(problem, remedy, key="--to", value="controller")
        end = LAWS["unlimited" if law.torque_limit is None else "saturated"]
        torque, sensed = LAWS[law.law] | end, LAWS["sensed"] if law.estimates_flow else {}
        values, curves = _values(design)
        words = {
            # a backslash or a trigraph would continue the comment on the next line
            "head": [x.replace("\\", "/").replace("??", "? ?") for x in _head(design)],
            "constants": {x: (values[x], y) for x, y in (torque | sensed).items() if x.isupper()},
            "curves": {name: _rows(curve) for name, curve in curves.items()},
            "steps": {name: value for name, value in torque.items() if not name.isupper()},
            "sensed": {name: value for name, value in sensed.items() if not name.isupper()},
            "sample_time": self._sample_time(design) if law.states else 0.0,
        }
        names = ("controller.h", "controller.c", "controller.py")
        return {name: filled(f"{name}.in", design, words) for name in names}

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


def _values(design: Design) -> tuple[dict[str, Any], dict[str, PPoly]]:
    """Return constants by name, and piecewise cubic curves, linear beyond their ends."""
    law: Any = design.law
    gains, generator, curves = design.gains.tolist(), design.plant.generator, {}
    values = {
        "GAIN": gains[0],
        "STILL": STILL,
        "LIMIT": law.torque_limit,
        "SMOOTHING": law.smoothing,
        "RADIUS": design.blade.rotor_radius,
        "DENSITY": design.physics.density,
        "INERTIA": design.inertia,
        "FRICTION": generator.shaft_friction,
        "FRICTION_SLOPE": generator.shaft_friction_slope,
    }
    match law.law:
        case "power_law" | "rated":
            values[law.second.upper()] = law.second_of(gains)
        case "curve":
            curves["curve"] = CubicHermiteSpline(*law.curve(design.gains))
        case "tracking":
            *speeds, kp, ki = gains
            values |= {"PROPORTIONAL": kp, "INTEGRAL": ki, "LAG": law.lag}
            curves["schedule"] = law.spline.pieces(np.array(speeds))
    if law.estimates_flow:
        curves["ratio_of"] = curve = FlowEstimate(design.plant).ratio_of
        values |= {"SMALLEST": float(curve.x[0]), "LARGEST": float(curve.x[-1])}
    return values, curves


def _rows(curve: PPoly) -> tuple[list[list[float]], float]:
    """Return the knots of a curve with the coefficients that begin there, and its end."""
    return np.column_stack((curve.x[:-1], curve.c[::-1].T)).tolist(), float(curve.x[-1])


def _head(design: Design) -> list[str]:
    """Return the lines of the comment at the top: where the code comes from, and its formula."""
    solution, law = design.solution, design.law
    speeds = [part["trajectory"]["rotor_speed_rad_s"] for part in solution.tables.values()]
    ends = f"{min(map(np.min, speeds)):.5g} to {max(map(np.max, speeds)):.5g} rad/s"
    lines = [*provenance(solution), "", *cleandoc(type(law).__doc__ or "").splitlines(), ""]
    lines.append(f"for positive rotor speeds; those in operation of the result: {ends}")
    lines += [f"{x}, not part of the law: {y}" for x, y in beside_law(design).items()]
    names = [
        f"{limit.name} {limit.upper:g} {limit.unit or ''}".rstrip()
        for limit in design.physics.all_limits
        if limit.caps_series and limit.name != "control_torque"
    ]
    if names:
        lines.append(f"limits of the case that this code does not check: {'; '.join(names)}")
    return lines
