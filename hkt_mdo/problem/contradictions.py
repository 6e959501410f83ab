"""Limits that no design can keep or that have no effect, and values that are probably mistakes."""

import re
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.dynamics.limits import StressLimit, Taper
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import PLAUSIBLE
from hkt_mdo.quantities import RATES
from hkt_mdo.rotor.scales import power_scale, torque_scale
from hkt_mdo.rotor.shape import Shape
from hkt_mdo.sections import leaves

PER_CENT = 99.0, 101.0  # sum of weights in per cent
LEAST_EXCESS = 1e-6  # relative excess above rounding
# of power, thrust, and a shaft's or a blade's moment of a usual rotor, and its stress over the
# dynamic pressure; a share of what it then has in the mean flow, below which a limit is a mistake
USUAL, LEAST_SHARE = {"W": 0.4, "N": 0.8, "N*m": 0.05, "Pa": 1e4}, 0.01


def refuse_contradictions(case: Case, shape: Shape, mean: float, fastest: float) -> None:
    """Raise InputError for a limit that no design can keep, or only a rotor next to standstill.

    `mean` and `fastest` (m/s) are speeds of the flow: below the tip speed ratio `SLOWEST_RATIO` a
    rotor counts as standing, and is refused. A fixed blade that is scaled keeps its taper.
    """
    _refuse_next_to_zero(case, shape, mean)
    limits, standing = _bounds(case), SLOWEST_RATIO * fastest
    kinds = ("tip_speed", 1.0, "m/s"), ("rotor_speed", shape.radii[1], "rad/s")
    for name, reach, unit in kinds:
        bound = limits.get(name)
        if bound is not None and bound * reach <= standing:
            problem = f"stops the rotor: in the flow of {fastest:.4g} m/s a tip speed ratio of "
            problem += f"{SLOWEST_RATIO:g} or less counts as standstill"
            remedy = f"give more than {standing / reach:.4g} {unit}"
            raise InputError(problem, remedy, key=f"limits.{name}", value=bound)
    taper = next((limit for limit in case.limits.given if isinstance(limit, Taper)), None)
    if taper is not None and not shape.designs_chord:
        blade = shape.blade
        over = taper.on(blade).excess({"chord": blade.chord})
        worst = int(np.argmax(over))
        if over[worst] > LEAST_EXCESS:
            ratio = blade.r[worst] / blade.tip_radius
            problem = f"is broken by the fixed blade, whose chord grows towards r/R = {ratio:.3g}"
            remedy = "give design.blade: optimized, a place outboard of that, or another blade"
            raise InputError(problem, remedy, key="limits.taper_from", value=taper.bound)


def _refuse_next_to_zero(case: Case, shape: Shape, mean: float) -> None:
    """Refuse a limit of power, load or torque that is next to nothing of a usual rotor's."""
    density, radius = case.fluid.density, shape.radii[0]
    power = float(power_scale(density, radius, mean))
    scales = {"W": power, "N": power / mean, "N*m": float(torque_scale(density, radius, mean))}
    scales["Pa"] = 0.5 * density * mean**2
    sections = [("", case), *((f"scenarios[{i}].", x) for i, x in enumerate(case.scenarios))]
    limits = [
        (f"{of}limits.{x.name}", x.upper, x.unit)
        for of, y in sections
        for x in y.limits.given
        if x.unit != "Pa" or isinstance(x, StressLimit)
    ]
    limits.append(("control.torque_limit", case.control.torque_limit or np.inf, "N*m"))
    for key, bound, unit in limits:
        most = USUAL.get(unit, 1.0) * scales.get(unit, -np.inf)
        if not isinstance(bound, str) and np.max(bound) < LEAST_SHARE * most:  # not `allowable`
            plain = unit.replace("*", " ")
            problem = f"is less than a hundredth of a usual rotor's in the mean flow, {most:.3g}"
            larger = "MPa" if unit == "Pa" else f"{bound:g} k{plain}"
            remedy = f"check its unit, such as {larger}, and rotor.radius"
            raise InputError(f"{problem} {plain}", remedy, key=key, value=bound)


def redundant_limits(case: Case, shape: Shape) -> Iterator[str]:
    """Yield the limits without effect: whenever certain other limits hold, these hold too."""
    limits, generator = _bounds(case), case.generator
    names = "power", "electrical_power", "rotor_speed", "tip_speed"
    power, electrical, speed, tip = (limits.get(name, np.inf) for name in names)
    torque = case.control.applied(case.condition.torque_constant).largest_torque or np.inf
    smallest, largest = shape.radii
    share = generator.largest_efficiency
    implied = [
        ("electrical_power", share * power, electrical, "W", "limits.power"),
        ("power", torque * speed, power, "W", "limits.rotor_speed with control.torque_limit"),
        ("tip_speed", speed * largest, tip, "m/s", "limits.rotor_speed"),
        ("rotor_speed", tip / smallest, speed, "rad/s", "limits.tip_speed"),
        ("rotor_speed", generator.fastest, speed, "rad/s", "the end of generator.table"),
    ]
    if generator.proportional and share * power > electrical:
        implied.append(("power", electrical / share, power, "W", "limits.electrical_power"))
    for name, most, bound, unit, others in implied:
        if most <= bound < np.inf:
            yield (
                f"limits.{name} = {bound:g} {unit} has no effect: {others} allows "
                f"{most:.4g} {unit} at most"
            )


def _bounds(case: Case) -> dict[str, float]:
    """Return the upper bounds of the case's limits over time, in SI units, by name."""
    return {limit.name: limit.upper for limit in case.limits.given if limit.place == "time"}


def implausible(values: Mapping[str, float]) -> Iterator[str]:
    """Yield a warning for each value, by key or name, that is outside of its range in the table.

    Equal ones of several entries of a list, such as realizations, are told once.
    """
    once = {(re.sub(r"\[\d+\]", "", name), x): name for name, x in reversed(values.items())}
    for (key, value), name in once.items():
        for pattern, least, most, unit, hint in PLAUSIBLE:
            if fnmatchcase(key, pattern) and not least <= value <= most:
                text = f"{name} = {value:.4g} {unit}".rstrip()
                yield f"{text} is outside of the plausible range, {least:g} to {most:g}: {hint}"


def doubts(case: Case, derived: Mapping[str, float]) -> Iterator[str]:
    """Yield warnings of what is probably a mistake in a case, or a poor choice.

    Parameters
    ----------
    case : Case
        The case.
    derived : mapping of float
        Quantities that follow from it and its files, by their names in the table.

    Yields
    ------
    str
        A warning.
    """
    entries = [*leaves(case.model_copy(update={"inflow": None}))]
    if not case.scenarios or case.inflow != case.scenarios[0].inflow:  # else it is not given
        entries += leaves(case.inflow, "resource" if case.inflow.steady else "inflow")
    numbers = {key: value for key, value, _ in entries if isinstance(value, int | float)}
    yield from implausible(numbers | derived)
    weights = [scenario.weight for scenario in case.scenarios if scenario.weight]
    low, high = PER_CENT
    mixed = min(weights, default=1.0) < 1.0 < max(weights, default=1.0)
    if mixed and low <= sum(100.0 * x if x < 1.0 else x for x in weights) <= high:
        text = ", ".join(f"{weight:g}" for weight in weights)
        yield f"weights of the scenarios = {text} are shares and per cent: give all in one unit"
    rated = any(limit.is_of(RATES) for limit in case.all_limits)
    if rated and case.control.chooses_torque and case.design.blade == "optimized":
        yield (
            "control.unknown = torque may end several per cent below the best under "
            "limits.torque_rate: give control.unknown: speed"
        )
