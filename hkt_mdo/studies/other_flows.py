"""A finished design in other flows: its energies, and the largest value of every limit and load."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.dynamics.simulation import Simulation
from hkt_mdo.errors import InputError
from hkt_mdo.results.folder import write_json, write_text
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.summary import LimitEntry, unasked
from hkt_mdo.results.words import Row, joined, measured
from hkt_mdo.run.flight import Flown
from hkt_mdo.run.judge import most_between
from hkt_mdo.run.loads import placed
from hkt_mdo.studies.uncertainty import Design, flow_given, seeds_of

ENERGIES = "energy", "generator_energy", "electrical_energy"
MOST_SEEDS = 10_000
FIELDS = "value", "unit", "limit", "share", "kept", "time_s", "r_m"
"""What is written of each limit and load."""


class Told(LimitEntry):
    """The largest value of a limit, or of a load without one, in a simulation."""

    excess: float | None = None
    """By how much the limit is exceeded, over its size."""
    kept: bool | None = None
    """Whether the limit is kept, as exactly as a run asks; None without a limit."""
    remark: str = "not limited"
    """What is said of a load without a limit."""

    @property
    def share(self) -> float | None:
        """The value over the limit; None without one, or where it is zero."""
        return self.value / self.limit if self.limit and self.value is not None else None

    def row(self, name: str, load: Any = None) -> Row:
        """Return the entry as a row; `name` is that of the limit or the load."""
        note = self.remark
        if self.limit is not None:
            limit = f"limit {measured(self.limit, self.unit)}"
            note = joined(limit, self.percent, "kept" if self.kept else "BROKEN")
        return Row(name.replace("_", " "), self.value, self.unit, joined(note, self.place))

    @property
    def percent(self) -> str:
        """The share as text; empty if there is none."""
        return "" if self.share is None else f"{100.0 * self.share:.1f} %"


@dataclass(frozen=True, eq=False)
class Run:
    """A simulation of a design in a flow.

    Attributes
    ----------
    design : Design
        The design, in the operation of one scenario.
    inflow : Inflow
        The flow.
    scenario : str
        Name of the scenario; empty if only one is simulated.
    seed : int or None
        Seed of the flow, where several were asked for.
    given : Simulation or None
        What the design does in the flow; None: it is simulated when it is asked for.
    """

    design: Design
    inflow: Inflow
    scenario: str = ""
    seed: int | None = None
    given: Simulation | None = None

    @cached_property
    def simulation(self) -> Simulation:
        """What the design does in the flow."""
        return self.given or self.design.fly(self.inflow)

    @property
    def name(self) -> str:
        """Scenario and seed, as far as there are several."""
        return joined(self.scenario, "" if self.seed is None else f"seed {self.seed}")

    @property
    def energies(self) -> dict[str, float | None]:
        """The energies (J) by their names; None where the rotor stops."""
        stopped = self.simulation.stopped_at is not None
        return {name: None if stopped else getattr(self.simulation, name) for name in ENERGIES}

    @cached_property
    def told(self) -> dict[str, Told]:
        """Largest value of each limit over time by its name, then of the loads without a limit."""
        physics, plant = self.design.physics, self.design.plant
        known = Flown.of(physics, plant, self.simulation, self.design.controller).told
        limits = physics.limits_in(physics.scenarios[0])
        found = {each.name: _told(each, known) for each in limits if not each.bounded}
        for name, load in placed(physics, plant.blade, [known]).items():
            remark = unasked(name, load.value, physics.case) or "not limited"
            own = found.get(name, Told(**load.model_dump(), remark=remark))
            found[name] = own.model_copy(update={"r_m": load.r_m})
        return found

    @property
    def broken(self) -> tuple[str, ...]:
        """Names of the limits that are not kept, and whether the rotor stops."""
        stops = () if self.simulation.stopped_at is None else ("rotor stops",)
        return (*(name for name, entry in self.told.items() if entry.kept is False), *stops)

    @property
    def outcome(self) -> str:
        """The energies as text, or when the rotor stops."""
        if (stopped := self.simulation.stopped_at) is not None:
            return f"rotor stops at t = {stopped:.2f} s, not generating; energy n/a"
        count = 2 if self.design.physics.generator.lossless else 3
        pairs = zip(self.energies.values(), ("captured", "generated", "electrical"), strict=True)
        return ", ".join(f"{energy / 1e3:.3f} kJ {word}" for energy, word in list(pairs)[:count])

    @property
    def verdicts(self) -> str:
        """The share of each limit as text, and whether it is broken."""
        told = ((name.replace("_", " "), x) for name, x in self.told.items() if x.kept is not None)
        return ", ".join(f"{name} {x.percent}{'' if x.kept else ' BROKEN'}" for name, x in told)


def runs_of(solution: Solution, flow: str, seeds: Iterable[int] = ()) -> list[Run]:
    """Return the simulations of each scenario of a result in a flow, and with each seed of it.

    Parameters
    ----------
    solution : Solution
        A finished result.
    flow : str
        As `flow_given` takes it.
    seeds : iterable of int
        Seeds of the flow; none: it keeps its own.

    Returns
    -------
    list of Run
        Nothing is simulated yet. A flow without a seed is simulated once.

    Raises
    ------
    InputError
        If there are seeds for a flow that has none, the run did not come to its end, or a flow is
        none for the turbine.
    """
    runs, several = [], len(solution.scenarios) > 1
    for part in solution.by_scenario:
        (name,), design = part.scenarios, Design.of(part)
        for seed in (seeds if seeds_of(flow_given(flow, part.case)) else ()) or (None,):
            inflow = flow_given(flow, part.case, seed)
            runs.append(Run(design, inflow, name if several else "", seed))
    if seeds and all(run.seed is None for run in runs):
        remedy = "give a turbulent --flow, or leave --flow-seeds out"
        raise InputError("asks for seeds of a flow that has none", remedy, key="--flow-seeds")
    return runs


def seeds_given(text: str) -> tuple[int, ...]:
    """Return seeds from a text such as ``1..20`` or ``3,5,9``.

    Parameters
    ----------
    text : str
        Whole numbers and ranges, with commas between them.

    Returns
    -------
    tuple of int
        Each seed once.

    Raises
    ------
    InputError
        If the text is no such list, or has too many seeds.
    """
    found: dict[int, None] = {}
    for part in text.split(","):
        if not (match := re.fullmatch(r"\s*(\d{1,18})(?:\.\.(\d{1,18}))?\s*", part, re.ASCII)):
            remedy = "give whole numbers and ranges, such as 1..20 or 3,5,9"
            raise InputError("is no list of seeds", remedy, key="--flow-seeds", value=text)
        first, last = int(match[1]), int(match[2] or match[1])
        if not 0 <= last - first < MOST_SEEDS - len(found):
            remedy = f"give rising ranges and at most {MOST_SEEDS} seeds"
            raise InputError("has too many seeds or none", remedy, key="--flow-seeds", value=text)
        found |= dict.fromkeys(range(first, last + 1))
    return tuple(found)


def _told(limit: Limit, known: dict[str, Any]) -> Told:
    """Return what is told of a limit, of the quantities of a trajectory."""
    value, over = limit.told(known), limit.excess(known)
    kept = bool(np.max(over) <= most_between(limit))
    # a torque that must not be negative and has no limit otherwise
    free = kept and not limit.caps_series and limit.lower <= 0.0
    at = int(np.argmax(value if free or (kept and limit.caps_series) else over))
    low = value[at] < limit.lower or not limit.caps_series
    found = Told(value=float(value[at]), unit=limit.unit or "", time_s=float(known["time"][at]))
    bound = {"limit": float(limit.lower if low else limit.upper), "excess": float(np.max(over))}
    return found if free else found.model_copy(update=bound | {"kept": kept})


def largest(runs: Iterable[Run]) -> dict[str, Told]:
    """Return what is told of each limit and load in the run that has the most of it.

    Parameters
    ----------
    runs : iterable of Run
        Simulations.

    Returns
    -------
    dict of Told
        By the names of limits and loads; of several runs, with the name of the run.
    """
    found: dict[str, Told] = {}
    for run in runs:
        for name, entry in run.told.items():
            before = found.get(name)
            if before is None or _size(entry) > _size(before):
                found[name] = entry.model_copy(update={"scenario": run.name or None})
    return found


def _size(entry: Told) -> tuple[bool, float]:
    """Return what ranks the entries of one limit or load; a limited one comes first."""
    limited = entry.excess is not None
    return limited, float((entry.excess if limited else entry.value) or 0.0)


def write(folder: Path, runs: Iterable[Run]) -> list[Path]:
    """Write what simulations told, as simulations.json and simulations.csv.

    Parameters
    ----------
    folder : Path
        Is made if need be; files of these names are replaced.
    runs : iterable of Run
        The simulations.

    Returns
    -------
    list of Path
        The files.
    """
    data, lines, runs = [], [",".join(("scenario", "seed", "quantity", *FIELDS))], list(runs)
    for run in runs:
        stopped = run.simulation.stopped_at
        told = {name: {x: getattr(entry, x) for x in FIELDS} for name, entry in run.told.items()}
        flow = run.inflow.model_dump(mode="json")
        own = {"scenario": run.scenario, "seed": run.seed, "flow": flow, "stopped_at_s": stopped}
        data.append(own | {f"{name}_J": x for name, x in run.energies.items()} | {"told": told})
        energies = {name: {"value": x, "unit": "J"} for name, x in run.energies.items()}
        for name, entry in (energies | told).items():
            cells = run.scenario, run.seed, name, *(entry.get(each) for each in FIELDS)
            lines.append(",".join("" if x is None else str(x) for x in cells))
    most = {
        name: {x: getattr(entry, x) for x in (*FIELDS, "scenario")}
        for name, entry in largest(runs).items()
    }
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / "simulations.json", folder / "simulations.csv"]
    write_json(paths[0], {"runs": data, "largest": most})
    write_text(paths[1], "\n".join([*lines, ""]))
    return paths
