"""What figures and charts show of results: names, units, bounds, limits, scenarios; no drawing."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.results.sections import STACKING, sections
from hkt_mdo.results.solution import ScenarioTables, Solution
from hkt_mdo.results.words import joined, limit_words, measured, printable

Solutions = Solution | Sequence[Solution]
SHOWN = 0.25, 0.5, 0.75
"""Places of the sections that are shown, from hub to tip."""
AXIS = f"blade's axis, at {STACKING:g} of the chord"


def near_bounds(
    solutions: Sequence[Solution], column: str, values: np.ndarray
) -> dict[str, tuple[int, float]]:
    """Return the bounds of a column of the blade that all designs share and that are near.

    Parameters
    ----------
    solutions : sequence of Solution
        The results.
    column : str
        A column of the blade that is designed.
    values : numpy.ndarray, shape (n_values,)
        What is drawn; a bound far from these and from zero says nothing.

    Returns
    -------
    dict of (int, float)
        0 for the lower and 1 for the upper end, and the bound, by its words.
    """
    quantity, unit = column.split("_", 1)
    designs = [each.case.design for each in solutions if each.case.design.blade == "optimized"]
    given = {getattr(each, f"{quantity}_bounds") for each in designs}
    low, high = (1.5 * end(values, initial=0.0) for end in (np.min, np.max))
    return {
        f"{word} {quantity} {bound:.4g} {unit.replace('over_chord', '')}".rstrip(): (end, bound)
        for bounds in (given if len(given) == 1 else ())
        for end, (word, bound) in enumerate(
            zip(("smallest", "largest"), bounds or (), strict=False)
        )
        if low <= bound <= high
    }


def known_sections(solution: Solution, places: Sequence[float] = SHOWN) -> np.ndarray:
    """Return sections of a blade; none where its files or outlines are not known."""
    try:
        return sections(solution, places)
    except InputError:
        return np.empty((0, 0, 2))


WORDS = {
    "inflow_speed": ("inflow speed", "m/s", 1.0),
    "rotor_speed": ("rotor speed", "rpm", 30.0 / np.pi),
    "tip_speed_ratio": ("tip speed ratio", "-", 1.0),
    "control_torque": ("generator torque", "N m", 1.0),
    "hydrodynamic_torque": ("flow's torque", "N m", 1.0),
    "generator_power": ("generator power", "kW", 1e-3),
    "thrust": ("thrust", "kN", 1e-3),
    "root_moment": ("root moment", "kN m", 1e-3),
    "stress": ("stress", "MPa", 1e-6),
    "cavitation": ("suction, 1: cavitation", "-", 1.0),
}
"""Name, unit and scale of what is drawn over time and over the flow speed."""
LARGE_TORQUE = 1e3  # N m


def words_of(quantity: str, solutions: Iterable[Solution]) -> tuple[str, str, float]:
    """Return name, unit and scale of a quantity of `WORDS`, torques of large machines in kN m.

    Parameters
    ----------
    quantity : str
        One of `WORDS`.
    solutions : iterable of Solution
        What is drawn together.

    Returns
    -------
    tuple of (str, str, float)
        The scale is that of values in SI.
    """
    words, unit, scale = WORDS[quantity]
    most = max((each.summary.control_torque_max_Nm or 0.0 for each in solutions), default=0.0)
    large = unit == "N m" and most >= LARGE_TORQUE
    return (words, "kN m", 1e-3) if large else (words, unit, scale)


LIMITED_BY = {"generator_power": ("generator_power", "electrical_power")}
OVER_SPAN = {
    "stress_Pa": ("stress", "stress", "stress (MPa)", 1e-6),
    "flapwise_moment_Nm": ("stress", "root_moment", "flapwise moment (kN m)", 1e-3),
    "cavitation": ("cavitation", "cavitation", "suction, 1: cavitation (-)", 1.0),
}
"""Load at whose largest value each column is drawn, its quantity, the column's label and scale."""
YEAR = {
    "electrical_power_W": ("mean electrical\npower (kW)", 1e-3, "power"),
    "hours": ("hours a year (h)", 1.0, "inflow_speed"),
    "energy_kWh": ("electrical energy\na year (kWh)", 1.0, "power"),
}
"""Label, scale and quantity of the columns of a year."""


def levels_of(
    chosen: Sequence[tuple[Solution, str]], quantity: str, scale: float
) -> dict[str, float]:
    """Return the limits of a quantity, one for equal ones.

    Parameters
    ----------
    chosen : sequence of (Solution, str)
        Results of one scenario each, with their names.
    quantity : str
        The quantity over time.
    scale : float
        Of the values.

    Returns
    -------
    dict of float
        Levels by their words, which name the results where not all have the limit.
    """
    found: dict[tuple[str, float], list[str]] = {}
    chosen = [each for each in chosen if each[0].simulation or each[0].trajectory]
    for solution, name in chosen:
        levels: dict[str, float] = {}
        for each in LIMITED_BY.get(quantity, (quantity,)):
            levels |= solution.limit_levels(each)
        for limit in (each for each in solution.limits if each.name in levels):
            told = measured(float(limit.upper), limit.unit or "", 4)
            words = f"{limit_words(limit.name)} limit {told}"
            found.setdefault((words, levels[limit.name]), []).append(name)
    named = {}
    for (words, level), names in found.items():
        apart = [] if len(names) == len(chosen) else list(filter(None, dict.fromkeys(names)))
        named[words + (f" in {' and '.join(apart)}" if apart else "")] = scale * level
    return named


def of_scenario(solution: Solution, name: str) -> Solution:
    """Return a result of one scenario alone.

    Parameters
    ----------
    solution : Solution
        The result.
    name : str
        The scenario.

    Returns
    -------
    Solution
        Without tables where it has no such scenario: other results keep their colours beside it.
    """
    if name in solution.scenarios:
        return solution.scenario(name)
    return replace(solution, tables={name: ScenarioTables({}, {}, {})})


def labels(solutions: Sequence[Solution]) -> list[str]:
    """Return what results are called beside one another; "" for a single one.

    Parameters
    ----------
    solutions : sequence of Solution
        The results.

    Returns
    -------
    list of str
        Names of the cases, of the folders where those are equal, and numbers where these are, too.
    """
    if len(solutions) == 1:
        return [""]
    for name in (lambda each: each.name, lambda each: each.folder.resolve().name):
        names = [printable(name(each)) for each in solutions]
        if len(set(names)) == len(names):
            return names
    return [f"{index}: {name}" for index, name in enumerate(names, 1)]


def named(solutions: Solutions) -> list[tuple[Solution, str]]:
    """Return solutions and their names in a legend; a single solution needs no name."""
    several = [solutions] if isinstance(solutions, Solution) else list(solutions)
    # Matplotlib leaves labels that begin with an underscore out of legends
    names = [re.sub("^_", " _", label) for label in labels(several)]
    return list(zip(several, names, strict=True))


def named_scenarios(solutions: Solutions) -> list[tuple[Solution, str]]:
    """Return each scenario of solutions as one of its own, and their names in a legend."""
    found = []
    for solution, name in named(solutions):
        for one, scenario in zip(solution.by_scenario, solution.scenarios, strict=True):
            several = len(solution.scenarios) > 1
            label = re.sub("^_", " _", joined(name, scenario)) if several else name
            found.append((one, label))
    return found


def beside_start(
    chosen: Sequence[tuple[Solution, str]], source: str, x: str, y: str
) -> Iterator[tuple[int | None, np.ndarray, np.ndarray, str]]:
    """Yield a column over another of each result, and before it that of the blade at the start.

    Parameters
    ----------
    chosen : sequence of (Solution, str)
        Results with their names.
    source : str
        The table of a result.
    x, y : str
        Its columns.

    Yields
    ------
    index : int or None
        Place of the result; None: it is a start, which is there once if it is the same.
    x, y : numpy.ndarray, shape (n_rows,)
        The columns.
    label : str
        Name of the curve.
    """
    starts: list[np.ndarray] = []
    for index, (solution, name) in enumerate(chosen):
        table = getattr(solution, source)
        if y not in table:
            continue
        start = table.get(f"start_{y}")
        same = np.array_equal(start, table[y])  # the blade is not designed
        if (
            start is not None
            and not same
            and not any(np.array_equal(start, other) for other in starts)
        ):
            starts.append(start)
            yield None, table[x], start, "blade at the start"
        yield index, table[x], table[y], name or ("blade" if same else "optimized blade")


LEAST_SHOWN = 1e-10
"""Smallest value on the axes of the convergence."""


def convergence(solution: Solution) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how an optimization converged.

    Parameters
    ----------
    solution : Solution
        The result.

    Returns
    -------
    evaluation, distance, infeasibility : numpy.ndarray, shape (n_evaluations,)
        The distance of the energy from its last value over that value, and the largest scaled
        violation, neither below `LEAST_SHOWN`; empty where there are none.
    """
    if not (table := solution.convergence):
        return np.empty(0), np.empty(0), np.empty(0)
    energy = table["energy_J"]
    known = energy[np.isfinite(energy)]
    distance = np.abs(energy / (known[-1] if known.size and known[-1] else 1.0) - 1.0)
    values = (np.maximum(each, LEAST_SHOWN) for each in (distance, table["infeasibility"]))
    return table["evaluation"], *values
