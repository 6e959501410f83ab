"""The control law in the files of ROSCO 2.10: DISCON.IN and the table of the rotor's coefficients.

ROSCO has no law as such but a torque mode and a schedule for fixed pitch: K w² with constant power
by overspeed (VS_FBP 1), a speed that follows the flow (2), or a speed that follows the torque (3),
which in equilibrium can be any law whose torque rises with the speed.
"""

import warnings
from typing import Annotated, Any

import numpy as np

from hkt_mdo.dynamics.laws import QuadraticFeedback
from hkt_mdo.dynamics.tracking import Tracking
from hkt_mdo.dynamics.wide_laws import RatedFeedback
from hkt_mdo.errors import InputError
from hkt_mdo.exports.base import Format, filled
from hkt_mdo.results.design import Design
from hkt_mdo.rotor.model import RotorModel
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

    speed_filter: Annotated[float, Quantity("rad/s", gt=0)] | None = None
    """Corner frequency of ROSCO's filter of the rotor speed; null: five times the frequency of the
    control loop, and at least 60 rad/s."""

    def files(self, design: Design) -> dict[str, str]:
        solution, law = design.solution, design.law
        if not law.is_feedback or (law.states and not isinstance(law, Tracking)):
            problem = f"has no entries for {law.law}: neither for a torque over time nor for states"
            remedy = "export csv, or run the case with a feedback law without states"
            raise InputError(problem, remedy, key="--to", value="rosco")
        mean = design.physics.scenarios[0].mean_flow
        rotor = design.physics.rotor.at_flow(mean)
        highest = float(solution.table("coefficients")["tip_speed_ratio"][-1])
        ratios = np.arange(LOWEST_RATIO, highest + RATIO_STEP, RATIO_STEP)
        best, radius = rotor.best_operation(design.blade), design.blade.rotor_radius
        torque = torque_scale(design.physics.density, radius, 1.0) * best.power_coefficient
        words: dict[str, Any] = {
            "best": best,
            "gain": torque * radius**2 / best.tip_speed_ratio**3,  # where the law is not K w²
            "pitches": PITCH,
            "ratios": ratios,
            "mean_flow": mean,
        }
        words |= _law_words(design) | _coefficients(design, rotor, ratios)
        loop = words["loop"]
        own_filter = max(SLOWEST_FILTER, float(f"{MARGIN * loop:.3g}"))
        words["speed_filter"] = self.speed_filter or own_filter
        words["step"] = f"{1.0 / (MARGIN * loop):.2g}"
        names = "DISCON.IN", "Cp_Ct_Cq.txt"
        return {f"rosco/{name}": filled(name, design, words) for name in names}


def _law_words(design: Design) -> dict[str, Any]:
    """Return entries of DISCON.IN for the law, and the frequency `loop` of its loop (rad/s)."""
    law, gains = design.law, design.gains
    flows, speeds, torques = _schedule(design)
    largest, fastest = law.torque_limit or NEVER * float(np.max(torques)), float(np.max(speeds))
    rates = [limit.upper for limit in design.physics.all_limits if limit.name == "torque_rate"]
    words = {
        "reference_filter": FAST / LAG,
        "largest_torque": largest,
        "rates": rates,
        "largest_rate": min(rates, default=1e3 * largest),
        "rated_power": NEVER * largest * fastest,
        "rated_speed": 1e-3 * float(np.min(speeds)),  # so that the schedule always holds
        "flows": flows,
        "speeds": speeds,
        "torques": torques,
    }
    if isinstance(law, QuadraticFeedback | RatedFeedback):
        loop = float(np.max(law.slopes(speeds, flows, gains)[0, 0])) / design.inertia
        return words | {"loop": loop} | _overspeed(law, gains, largest, fastest)
    if isinstance(law, Tracking):
        return words | _by_flow(law, design, flows, speeds)
    if np.any(np.diff(torques) <= 0.0):
        problem = "finds the rotor speed from the torque, which has to increase with the speed"
        remedy = f"export controller, which has the law {law.law} itself"
        raise InputError(problem, remedy, key="--to", value="rosco")
    slope = float(np.max(np.gradient(torques, speeds)))
    comment = f"{law.law} law as a speed that follows the torque within {LAG:g} s (VS_FBP 3)"
    return words | {"about": comment, "schedule": 3, "integral": -slope / LAG, "loop": 1.0 / LAG}


def _overspeed(law, gains, largest, fastest) -> dict[str, Any]:
    """Return the words of K w², up to a torque limit or a rated power (VS_FBP 1)."""
    gain, comment = float(gains[0]), "torque K w^2 up to the largest torque"
    words: dict[str, Any] = {}
    speed = min(np.sqrt(largest / gain), NEVER * fastest)
    if isinstance(law, RatedFeedback):
        power = float(law.second_of(gains))
        speed = min(speed, np.cbrt(power / gain))
        comment = "torque K w^2 up to a rated power, constant power by overspeed above it"
        words = {"rated_power": power}
    torque = gain * speed**2
    return words | {
        "about": f"{law.law} law: {comment} (VS_FBP 1)",
        "schedule": 1,
        "gain": gain,
        "rated_speed": float(speed),
        "rated_torque": float(min(torque, largest)),
        "highest_part_torque": float(2.0 * torque),
        "proportional": float(-STEEP * gain * speed),
    }


def _by_flow(law, design, flows, speeds) -> dict[str, Any]:
    """Return the words of a speed that follows the sensed or the estimated flow (VS_FBP 2)."""
    kp, ki = (float(gain) for gain in design.gains[-2:])
    words = {
        "about": "tracking law: the speed follows a schedule over the flow (VS_FBP 2)",
        "schedule": 2,
        "flow_filter": 10.0 / law.lag,
        "reference_filter": FAST / law.lag,
        "proportional": -kp,
        "integral": -ki,
        "loop": kp / design.inertia,
    }
    if law.estimates_flow:
        middle, plant = flows.size // 2, design.plant
        flow = flows[middle] * np.array([1.0 - 1e-4, 1.0 + 1e-4])
        by_flow = np.diff(plant.torque(np.full(2, speeds[middle]), flow)) / np.diff(flow)
        words["adaption"] = float(plant.inertia / (by_flow[0] * law.lag))
    return words


def _schedule(design: Design) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return flow speeds, rotor speeds and torques in equilibrium, on the side of overspeed."""
    law: Any = design.law
    speed = np.concatenate([scenario.speeds for scenario in design.physics.scenarios])
    flows = np.linspace(BELOW * float(np.min(speed)), ABOVE * float(np.max(speed)), COLUMNS)
    if law.states:
        speeds = law.speed_at_rest(flows, design.gains)  # its schedule
        torques = design.plant.generator_torque(speeds, flows)
        return flows, speeds, np.clip(torques, 0.0, law.torque_limit)
    flows, speeds = design.steady(flows)
    if flows.size < 2:
        problem = "needs flows in which the rotor turns steadily under its law, but there are none"
        raise InputError(problem, "check the gains of the result", key="--to", value="rosco")
    return flows, speeds, law.torque(speeds, design.gains)


def _coefficients(design: Design, rotor: RotorModel, ratios: np.ndarray) -> dict[str, Any]:
    """Return the coefficients, each of shape (n_ratios, n_pitches)."""
    blade, columns = design.blade, []
    # sections without a solution at unusual pitch
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):
        for pitch in np.deg2rad(PITCH):
            pitched = blade.with_shape(blade.chord, blade.twist + pitch)
            columns.append(rotor.coefficients(pitched, ratios))
    names = ("torque", "power", "thrust")
    return {name: np.stack([getattr(x, name) for x in columns], axis=1) for name in names}
