"""The control law in the files of ROSCO 2.10: DISCON.IN and the table of the rotor's coefficients.

ROSCO has no law as such but a torque mode and a schedule for fixed pitch: K w² with constant power
by overspeed (VS_FBP 1), a speed that follows the flow (2), or a speed that follows the torque (3),
which in equilibrium can be any law whose torque rises with the speed.
"""

import warnings
from typing import Annotated, Any, ClassVar, cast

import numpy as np

from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.laws import FeedbackLaw, QuadraticFeedback
from hkt_mdo.dynamics.simulation import FeedbackTorque
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.dynamics.wide_laws import RatedFeedback
from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Format, Source, filled
from hkt_mdo.results.design import Design
from hkt_mdo.rotor.hydrodynamics import Hydrodynamics
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.sections import Quantity

COLUMNS = 100  # of the schedule
BELOW, ABOVE = 0.6, 1.3  # flow speeds of the schedule, over the slowest and the fastest
LOWEST_RATIO, RATIO_STEP = 1.0, 0.1  # tip speed ratios of the table
PITCH = np.arange(-5.0, 6.0)  # deg, of the table
LAG = 0.1  # s, time constant with which the speed follows the inverse of a law
# rad/s; and by how much filter and sampling are faster than the loop
SLOWEST_FILTER, MARGIN = 60.0, 5.0
FAST = 100.0  # frequency of the reference's filter over that of its input
STEEP = 10.0  # torque by speed at the rated speed, over that of K w, which switches the schedule on
NEVER = 100.0  # over the largest of the schedule: a limit that is never reached


class Rosco(Format):
    """DISCON.IN and the table of power, thrust and torque coefficients."""

    name: ClassVar[str] = "rosco"

    speed_filter: Annotated[float, Quantity("rad/s", gt=0)] | None = None
    """Corner frequency of ROSCO's filter of the rotor speed; null: five times the frequency of the
    control loop, and at least 60 rad/s."""

    def files(self, source: Source) -> dict[str, bytes]:
        design = source.design
        world, blade = design.physics, design.blade
        mean = world.scenarios[0].mean_flow
        rotor = world.rotor.as_built(blade).at_flow(mean)
        highest = float(source.solution.table("coefficients")["tip_speed_ratio"][-1])
        ratios = np.arange(LOWEST_RATIO, highest + RATIO_STEP, RATIO_STEP)
        words = _law_words(design, rotor)
        provenance, loop = "; ".join(source.provenance), words.pop("loop")
        own_filter = max(SLOWEST_FILTER, float(f"{MARGIN * loop:.3g}"))
        words |= {
            "provenance": provenance,
            "speed_filter": own_filter if self.speed_filter is None else self.speed_filter,
            "step": f"{1.0 / (MARGIN * loop):.2g}",
            "best_ratio": source.solution.summary.tip_speed_ratio_at_power_coefficient_max,
            "design": design,
            "pitches": PITCH.size,
            "ratios": ratios.size,
        }
        words.setdefault("gain", _best_gain(design, words["best_ratio"], rotor))
        table = _table(design, rotor, ratios, mean, provenance)
        texts = {"DISCON.IN": filled("DISCON.IN", words), "Cp_Ct_Cq.txt": table}
        return {f"rosco/{name}": text.encode() for name, text in texts.items()}


def _law_words(design: Design, rotor: Hydrodynamics) -> dict[str, Any]:
    """Return the entries of DISCON.IN for the law: modes, gains, limits and schedule."""
    law, gains = design.law, design.gains
    if not isinstance(law, FeedbackLaw):
        problem = "cannot have an open loop, whose torque is a function of time"
        raise InputError(problem, "run the case with a feedback law", key="--to", value="rosco")
    if law.states and not isinstance(law, Tracking):
        problem = f"has no entries for the states of the law {law.law}"
        raise InputError(problem, "export controller or csv", key="--to", value="rosco")
    flows, speeds, torques = _schedule(design)
    limit = law.torque_limit
    largest = NEVER * float(np.max(torques)) if limit is None else limit
    rates = [each.upper for each in design.physics.all_limits if each.name == "torque_rate"]
    words = {
        "mode": 1,
        "schedule": 1,
        "estimator": 0,
        "flow_filter": 1.0,
        "reference_filter": FAST / LAG,
        "adaption": 0.0,
        "largest_torque": largest,
        "torque_mark": ": none in the case" if limit is None else ": control.torque_limit",
        "largest_rate": min(rates, default=1e3 * largest),
        "rate_mark": ": limits.torque_rate" if rates else ": none in the case FILL IN",
        "rated_power": NEVER * largest * float(np.max(speeds)),
        "power_mark": ": none, never reached",
        "gain_mark": "",
        "integral": 0.0,
        "count": flows.size,
        "flows": _numbers(flows),
        "speeds": _numbers(speeds),
        "torques": _numbers(torques),
    }
    if isinstance(law, QuadraticFeedback | RatedFeedback):
        steepest = float(np.max(law.torque_by_speed(speeds, gains)))
        words["loop"] = steepest / design.inertia
        return words | _overspeed(law, gains, largest, float(np.max(speeds)))
    slow = 1e-3 * float(np.min(speeds))  # so that the schedule always holds
    words |= {"rated_speed": repr(slow), "rated_torque": 0.0, "highest_part_torque": 0.0}
    words["gain_mark"] = " at the largest power coefficient, unused"
    if isinstance(law, Tracking):
        return words | _by_flow(law, design, rotor, (flows, speeds))
    if np.any(np.diff(torques) <= 0.0):
        problem = "finds the rotor speed from the torque, which has to increase with the speed"
        remedy = f"export controller, which has the law {law.law} itself"
        raise InputError(problem, remedy, key="--to", value="rosco")
    slope = float(np.max(np.gradient(torques, speeds)))
    about = f"{law.law} law as a speed that follows the torque within {LAG:g} s (VS_FBP 3)"
    own = {"mode": 4, "schedule": 3, "proportional": 0.0, "integral": repr(-slope / LAG)}
    return words | own | {"about": about, "loop": 1.0 / LAG}


def _overspeed(law, gains, largest, fastest) -> dict[str, Any]:
    """Return the words of K w², up to a torque limit or a rated power (VS_FBP 1)."""
    gain, about = float(gains[0]), "torque K w^2 up to the largest torque"
    words: dict[str, Any] = {}
    speed = min(np.sqrt(largest / gain), NEVER * fastest)
    if isinstance(law, RatedFeedback):
        power = float(gains[1] if law.power is None else law.power)
        speed = min(speed, np.cbrt(power / gain))
        about = "torque K w^2 up to a rated power, constant power by overspeed above it"
        words = {"rated_power": repr(power), "power_mark": ": rated power of the law"}
    torque = gain * speed**2
    return words | {
        "about": f"{law.law} law: {about} (VS_FBP 1)",
        "gain": gain,
        "rated_speed": float(speed),
        "rated_torque": float(min(torque, largest)),
        "highest_part_torque": float(2.0 * torque),
        "proportional": float(-STEEP * gain * speed),
    }


def _by_flow(law, design, rotor, schedule) -> dict[str, Any]:
    """Return the words of a speed that follows the sensed or the estimated flow (VS_FBP 2)."""
    blade, (flows, speeds) = design.blade, schedule
    words = {
        "about": "tracking law: the speed follows a schedule over the flow (VS_FBP 2)",
        "mode": 2,
        "schedule": 2,
        "flow_filter": 10.0 / law.lag,
        "reference_filter": FAST / law.lag,
        "proportional": -float(design.gains[-2]),
        "integral": -float(design.gains[-1]),
        "loop": float(design.gains[-2]) / design.inertia,
    }
    if law.estimates_flow:
        step = np.array([1.0 - 1e-4, 1.0 + 1e-4])
        middle = flows.size // 2
        flow, speed = flows[middle] * step, speeds[middle]
        ratio = speed * blade.rotor_radius / flow
        scale = torque_scale(design.physics.density, blade.rotor_radius, flow)
        slower, faster = scale * rotor.coefficients(blade, ratio).torque
        by_flow = (faster - slower) / (flow[1] - flow[0])
        words |= {"estimator": 1, "adaption": repr(float(design.inertia / (by_flow * law.lag)))}
    return words


def _schedule(design: Design) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return flow speeds, rotor speeds and torques in equilibrium, on the side of overspeed."""
    law = cast(FeedbackLaw, design.law)
    scenarios = design.physics.scenarios
    speed = np.concatenate([each.inflow.speed_at(each.samples) for each in scenarios])
    flows = np.linspace(BELOW * float(np.min(speed)), ABOVE * float(np.max(speed)), COLUMNS)
    speeds, running = equilibria(design.plant, FeedbackTorque(law, design.gains), flows)
    if isinstance(law, Tracking):
        torques = design.plant.generator_torque(speeds, flows)
        return flows, speeds, np.clip(torques, 0.0, law.torque_limit)
    flows, speeds = flows[running], speeds[running]
    if flows.size < 2:
        problem = "needs flows in which the rotor turns steadily under its law, but there are none"
        raise InputError(problem, "check the gains of the result", key="--to", value="rosco")
    return flows, speeds, law.torque(speeds, design.gains)


def _best_gain(design: Design, ratio: float, rotor: Hydrodynamics) -> float:
    """Return K at the largest power coefficient, N m s²/rad²."""
    radius = design.blade.rotor_radius
    torque = rotor.coefficients(design.blade, [ratio]).torque[0]
    scale = torque_scale(design.physics.density, radius, 1.0)
    return float(scale * torque * (radius / ratio) ** 2)


def _table(design, rotor, ratios, mean, provenance) -> str:
    """Return the table of coefficients over tip speed ratio and pitch."""
    blade, columns = design.blade, []
    with warnings.catch_warnings():
        # sections without a solution at unusual pitch
        warnings.simplefilter("ignore", RuntimeWarning)
        for pitch in np.deg2rad(PITCH):
            pitched = blade.with_shape(blade.chord, blade.twist + pitch)
            found = rotor.coefficients(pitched, ratios)
            columns.append((found.torque, found.power, found.thrust))
    known = zip(("torque", "power", "thrust"), np.array(columns).transpose(1, 2, 0), strict=True)
    words = {name: "\n".join(map(_numbers, values)) for name, values in known}
    vectors = {"pitch": _numbers(PITCH), "ratios": _numbers(ratios), "flow": _numbers([mean])}
    return filled("Cp_Ct_Cq.txt", words | vectors | {"provenance": provenance})


def _numbers(values) -> str:
    """Return numbers in a row, to nine digits."""
    return "  ".join(f"{value:.9g}" for value in values)
