"""Values of a case that are probably mistakes: outside of their range, or in mixed units."""

import re
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase

from hkt_mdo.case import Case
from hkt_mdo.files.shipped import PLAUSIBLE
from hkt_mdo.quantities import RATES
from hkt_mdo.sections import leaves

PER_CENT = 99.0, 101.0  # sum of weights in per cent


def implausible(values: Mapping[str, float]) -> Iterator[str]:
    """Yield a warning for each value, by key or name, that is outside of its range in the table.

    Equal ones of several entries of a list, such as realizations, are told once.
    """
    once = {(re.sub(r"\[\d+\]", "", name), x): name for name, x in reversed(values.items())}
    for (key, value), name in once.items():
        for pattern, least, most, unit, hint in PLAUSIBLE:
            if fnmatchcase(key, pattern) and not least <= value <= most:
                told = f"{name} = {value:.4g} {unit}".rstrip()
                yield f"{told} is outside of the plausible range, {least:g} to {most:g}: {hint}"


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
    given = [*leaves(case.model_copy(update={"inflow": None}))]
    if not case.scenarios or case.inflow != case.scenarios[0].inflow:  # else it is not given
        given += leaves(case.inflow, "resource" if case.inflow.steady else "inflow")
    numbers = {key: value for key, value, _ in given if isinstance(value, int | float)}
    yield from implausible(numbers | derived)
    weights = [each.weight for each in case.scenarios if each.weight]
    low, high = PER_CENT
    mixed = min(weights, default=1.0) < 1.0 < max(weights, default=1.0)
    if mixed and low <= sum(100.0 * x if x < 1.0 else x for x in weights) <= high:
        told = ", ".join(f"{each:g}" for each in weights)
        yield f"weights of the scenarios = {told} are shares and per cent: give all in one unit"
    rated = any(limit.is_of(RATES) for limit in case.all_limits)
    if rated and case.control.chooses_torque and case.design.blade == "optimized":
        yield (
            "control.unknown = torque may end several per cent below the best under "
            "limits.torque_rate: give control.unknown: speed"
        )
