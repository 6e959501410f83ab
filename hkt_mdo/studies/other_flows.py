"""A finished design in other flows: its energies, and the largest value of every limit and load."""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.limits import BETWEEN, Limit
from hkt_mdo.dynamics.objectives import INTEGRALS
from hkt_mdo.dynamics.simulation import Simulation
from hkt_mdo.dynamics.trajectory import trajectory_of
from hkt_mdo.errors import InputError
from hkt_mdo.files.table import csv_text, write_new
from hkt_mdo.problem.physics import physics
from hkt_mdo.results.design import Design, in_flow
from hkt_mdo.results.folder import to_json
from hkt_mdo.results.solution import Solution
from hkt_mdo.results.summary import LoadEntry, unasked
from hkt_mdo.results.words import Row, joined, limit_words, measured
from hkt_mdo.run import year
from hkt_mdo.run.loads import of_limit, placed
from hkt_mdo.run.verification import SimulatedDesign, in_equilibrium, plant_of
from hkt_mdo.studies.start_stop import StartStop, start_and_stop
from hkt_mdo.studies.uncertainty import Ensemble, Sensor, flow_given, noisy_runs

FIELDS = "value", "unit", "limit", "share", "kept", "time_s", "r_m"
MOST_SEEDS = 10_000
STALLED = 0.5  # tip speed ratio over the least of the design, below which a rotor stalls
RUN_AWAY = 1.2  # speed over that without memory, above which the wake lets the rotor run away


class Extreme(LoadEntry):
    """The largest value of a limit, or of a load without one, in a simulation."""

    share: float | None = None
    """The value over the limit; of a lower limit, 1 where it is met and more where it is broken."""
    kept: bool | None = None
    """Whether the limit is kept as exactly as a run requires; None without a limit."""
    remark: str = "not limited"
    """A remark on a load without a limit."""

    def row(self, name: str) -> Row:
        """Return the entry as a row.

        Parameters
        ----------
        name : str
            That of the limit or the load.

        Returns
        -------
        Row
            With its limit, when and where.
        """
        note = self.remark
        if self.limit is not None:
            share = f"{100.0 * (self.share or 0.0):.2f} %, {'kept' if self.kept else 'BROKEN'}"
            note = joined(self.bound, share)
        value, unit = self.value, self.unit
        if unit == "s":  # an instant
            value, unit = f"from t = {measured(value, unit)}", ""
        return Row(limit_words(name), value, unit, joined(note, self.place))


def _extreme(limit: Limit, quantities: dict[str, Any]) -> Extreme:
    """Return the report of a limit, from the quantities of a trajectory."""
    share, over = np.max(limit.share(quantities)), np.max(limit.excess(quantities))
    verdict = {"share": float(share), "kept": bool(over <= limit.most_between)}
    return Extreme(**of_limit(limit, quantities).model_dump(exclude_unset=True), **verdict)


@dataclass(frozen=True, eq=False)
class Run:
    """A simulation of a design in a flow, made when its results are first asked for.

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
    without : Run or None
        The same without dynamic inflow, where the design has it.
    start : bool
        Whether the rotor starts from standstill.
    stop : float or None
        Time from which it is shut down after a start, s.
    noise : tuple of Sensor, int and int, or None
        A noisy sensor, the number of runs with it, and the seed of its noise.
    """

    design: Design
    inflow: Inflow
    scenario: str = ""
    seed: int | None = None
    without: "Run | None" = None
    start: bool = False
    stop: float | None = None
    noise: tuple[Sensor, int, int] | None = None

    @cached_property
    def simulation(self) -> Simulation:
        """The simulation of the design in the flow.

        Returns
        -------
        Simulation
            Sampled densely over the flow.
        """
        return (self.began.operation if self.start else None) or self.design.simulate(self.inflow)

    @cached_property
    def parts(self) -> tuple[SimulatedDesign, ...]:
        """The simulation with its loads; of a resource its equilibria, in each direction of it.

        Returns
        -------
        tuple of SimulatedDesign
            By direct BEM.

        Raises
        ------
        InputError
            If there is no equilibrium in a flow of a resource.
        """
        design, case = self.design, self.design.physics.case
        if not (self.inflow.steady and design.law.is_feedback):
            arguments = design.physics.rotor, design.plant, self.simulation, design.controller
            return (SimulatedDesign(design.physics, *arguments),)
        physics_ = replace(physics(in_flow(case, self.inflow)), law=design.physics.law)
        parts = []
        for scenario in physics_.scenarios:
            plant = plant_of(physics_, scenario, design.blade)
            parts.append(in_equilibrium(physics_, scenario, plant, design.gains, {}))
            if (stopped := parts[-1].simulation.stopped_at) is not None:
                problem = f"has no equilibrium of the rotor in {scenario.when(stopped)}"
                remedy = "give a larger cut_in, or a lower --cut-out"
                raise InputError(problem, remedy, key="--flow", value=self.inflow.profile)
        return tuple(parts)

    @cached_property
    def began(self) -> StartStop:
        """The start from standstill, the operation and the shut-down.

        Returns
        -------
        StartStop
            Parts that do not take place are None.
        """
        return start_and_stop(self.design, self.inflow, self.stop)

    def lines(self, with_limits: bool = False) -> list[str]:
        """Describe the simulation.

        Parameters
        ----------
        with_limits : bool
            Whether the limits are told, as where there are other simulations.

        Returns
        -------
        list of str
            Energies and speeds, the start from standstill, and what noise and memory change.
        """
        lines = [*self.began.lines()] if self.start else self._outcomes()
        lines[0] += f"; limits: {self.verdicts}" * (with_limits and not self.start)
        lines += self._with_noise(*self.noise) if self.noise else []
        return [joined(self.name, lines[0]), *lines[1:]]

    @cached_property
    def noisy(self) -> Ensemble | None:
        """The runs with the noisy sensor.

        Returns
        -------
        Ensemble
            None where there is no sensor, or an open loop, which reads none.
        """
        read = self.noise and self.design.law.is_feedback
        return noisy_runs(self.design, self.inflow, *self.noise) if read else None

    def _with_noise(self, sensor: Sensor, repeats: int, seed: int) -> list[str]:
        """Return the results of many runs with a noisy sensor, as lines of text."""
        if (noisy := self.noisy) is None:
            return ["open loop reads no sensor: the noise changes nothing"]
        quiet, behind, text = self.simulation, "none", "no run reached the end"
        if sensor.cutoff:
            behind = f"second-order Butterworth low-pass of {sensor.cutoff:g} Hz (--filter-cutoff)"
            if np.isnan(noisy.quiet_energy) and quiet.stopped_at is None:
                behind += ", whose delay stops the rotor without any noise"
        if energies := noisy.energies:
            texts = (f"{name} {measured(x, 'J', 6)}" for name, x in energies.items())
            text = f"captured energy of the others: {', '.join(texts)}"
            if quiet.stopped_at is None:
                ends = energies["mean"], noisy.quiet_energy
                lost = [f"{100.0 * (x / quiet.energy - 1.0):+.3f} %" for x in ends]
                alone = f", {lost[1]} by filter and samples alone" * (not np.isnan(ends[1]))
                text += f"; mean {lost[0]} from that without noise{alone}"
        return [
            f"sensor: {sensor.snr:g} dB of the {sensor.reference} speed, sigma = "
            f"{noisy.noise_deviation:.4f} rad/s, {sensor.rate:g} Hz, seed {seed}",
            f"filter behind it: {behind}",
            f"rotor stopped in {np.isfinite(noisy.stopped_at).sum()} of {repeats} runs",
            text,
        ]

    @property
    def name(self) -> str:
        """Scenario and seed, as far as there are several.

        Returns
        -------
        str
            Empty where there is one of each.
        """
        return joined(self.scenario, "" if self.seed is None else f"seed {self.seed}")

    @cached_property
    def extremes(self) -> dict[str, Extreme]:
        """Largest value of each limit over time by its name, then of the loads without a limit.

        Returns
        -------
        dict of Extreme
            Each has ``value`` and ``unit`` (SI), ``time_s`` and, along the blade, ``r_m``; of a
            limit ``limit``, ``share`` (the value over it) and ``kept``. Of a limit there is
            another entry, ``NAME with noise``, for all noisy runs. A rotor that stops, stalls or
            runs away is an entry with the instant as its value.
        """
        physics, case, extremes = self.design.physics, self.design.physics.case, {}
        operations = [(part.rotor, part.simulated) for part in self.parts]
        trajectories = [("", quantities) for _, quantities in operations]
        if noisy := self.noisy:  # the torque's rate has no limit there: it is held between samples
            series = trajectory_of(*noisy.samples, self.design.blade.rotor_radius, case.generator)
            series |= self.parts[0].loads(series) | self.parts[0].scalars
            trajectories.append((" with noise", series))
        for suffix, quantities in trajectories:
            for limit in self.parts[0].physics.scenarios[0].limits:
                applies = not limit.bounded and quantities.keys() >= set(limit.inputs)
                if applies and np.isfinite(limit.end_of(limit.reported(quantities))):
                    name, entry = f"{limit.name}{suffix}", _extreme(limit, quantities)
                    entries = entry, extremes.get(name, entry)
                    extremes[name] = max(entries, key=lambda x: x.share or 0.0)
        for name, load in placed(self.design.blade, operations).items():
            remark = unasked(name, load, case) or "not limited"
            entry = extremes.get(name, Extreme(**load.model_dump(), remark=remark))
            extremes[name] = entry.model_copy(update={"r_m": load.r_m})
        if self.inflow.steady:
            return extremes

        def add(event, value, remark, kept: bool | None = False):
            extremes[event] = Extreme(value=float(value), unit="s", kept=kept, remark=remark)

        if (stopped := self.simulation.stopped_at) is not None:
            add("rotor stops", stopped, "generates no more: the simulation ends there")
        if noisy and (count := np.isfinite(noisy.stopped_at).sum()):
            add("rotor stops with noise", np.nanmin(noisy.stopped_at), f"in {count} runs")
        quantities = operations[0][1]
        time, designed = quantities["time"], self.design.solution.summary.tip_speed_ratio
        slow = quantities["tip_speed_ratio"] < STALLED * ((designed and designed.min) or 0.0)
        if stopped is None and np.any(slow):
            remark = "below half of the least tip speed ratio of the design's own flow"
            add("rotor stalls", time[np.argmax(slow)], remark)
        fast = quantities["inflow_speed"] > (physics.law.cut_out or np.inf)
        if np.any(fast):
            share = 100.0 * np.trapezoid(1.0 * fast, time) / np.ptp(time)
            remark = f"for {share:.3g} % of the time: the simulation does not stop the machine"
            add("flow above the cut-out", time[np.argmax(fast)], remark, None)
        if (away := self.runs_away) is not None:
            add("rotor runs away", away, "more than 20 % faster than without memory until then")
        return extremes

    @cached_property
    def runs_away(self) -> float | None:
        """When the rotor is first much faster than it was without memory until then, s, if ever.

        Where the flow falls, a wake with memory keeps a rotor fast for a while, which is no danger.

        Returns
        -------
        float or None
            None too where the wake has no memory.
        """
        if self.without is None:
            return None
        quiet, time = self.without.simulation, self.simulation.time
        time = time[time <= quiet.time[-1]]
        most = np.maximum.accumulate(quiet.speed_at(time))
        fast = self.simulation.speed_at(time) > RUN_AWAY * most
        return float(time[np.argmax(fast)]) if np.any(fast) else None

    def _outcomes(self) -> list[str]:
        """Return the results of a year, or of a course over time with and without memory."""
        if self.inflow.steady:
            return [*map(str, year.entry(self.parts, {}).rows())]
        runs = {"without noise": self}
        if self.without is not None:
            tau1 = self.design.plant.wake.tau1
            how = "tau1 by the induction" if tau1 is None else f"tau1 = {tau1:g} s"
            runs = {f"with dynamic inflow ({how})": self, "without memory": self.without}
        return [f"{word}: {run.outcome}" for word, run in runs.items()]

    @property
    def energies(self) -> dict[str, float | None]:
        """Energies by their names, J; None where the rotor stops.

        Returns
        -------
        dict of float or None
            ``energy`` (captured), ``generator_energy`` and ``electrical_energy``.
        """
        runs = [part.simulation for part in self.parts]
        running = runs[0].stopped_at is None
        return {x: sum(getattr(y, x) for y in runs) if running else None for x in INTEGRALS}

    @property
    def outcome(self) -> str:
        """Energies, time span and the rotor's speeds as text, or when the rotor stops.

        Returns
        -------
        str
            One line.
        """
        if (stopped := self.simulation.stopped_at) is not None:
            return f"rotor stops at t = {stopped:.2f} s and generates no more; energy n/a"
        pairs = ("captured", "generated", "electrical"), self.energies.values()
        texts = [f"{measured(energy, 'J', 6)} {kind}" for kind, energy in zip(*pairs, strict=True)]
        generator, run = self.design.physics.case.generator, self.simulation
        if (off := generator.beyond_table(run.control_torque, run.rotor_speed)) > BETWEEN:
            texts[2] += f" (extrapolated, up to {100.0 * off:.2g} % beyond generator.table)"
        energies = joined(*texts[: 2 if generator.lossless else 3])
        return f"{energies} in {run.time[-1]:g} s; rotor at {measured(run.rotor_speed, 'rad/s', 4)}"

    @property
    def verdicts(self) -> str:
        """The verdicts on all limits, as text.

        Returns
        -------
        str
            One line.
        """
        rows = ((limit_words(name), x) for name, x in self.extremes.items() if x.share is not None)
        return joined(*(f"{n} {100.0 * x.share:.2f} %{' BROKEN' * (not x.kept)}" for n, x in rows))


def runs_of(
    solution: Solution,
    flow: str | Mapping[str, Any] = "design",
    seeds: str | None = None,
    memory: bool = False,
    tau1: float | None = None,
) -> list[Run]:
    """Return the simulations of each scenario of a result in a flow, and with each seed of it.

    Parameters
    ----------
    solution : Solution
        A finished result.
    flow : str or mapping
        ``design``: the result's own; ``A``, ``B`` or ``C`` of the paper; or an inflow section, as
        text or mapping, such as ``{profile: sine, mean: 1.4}``.
    seeds : str or None
        Seeds of the flow, such as ``1..20`` or ``3,5,9``; None: it keeps its own.
    memory : bool
        Whether the wake has memory (`hkt_mdo.dynamics.wake`).
    tau1 : float or None
        Its time constant, s; None: by the induction.

    Returns
    -------
    list of Run
        Each is simulated when its `simulation`, `extremes` or `energies` is first asked for.

    Raises
    ------
    InputError
        If there are seeds for a flow that has none, the run did not come to its end, or a flow is
        none for the turbine.
    """
    flow = flow if isinstance(flow, str) else json.dumps(dict(flow))
    named, numbers = len(solution.scenarios) > 1, (None,) if seeds is None else _seeds(seeds)
    runs = [
        Run(design, flow_given(flow, part.case, seed), part.scenarios[0] if named else "", seed)
        for part, design in [(part, part.design()) for part in solution.by_scenario]
        for seed in numbers
    ]
    if not memory:
        return runs
    return [replace(run, design=run.design.with_memory(tau1), without=run) for run in runs]


def simulations(
    solution: Solution,
    flow: str | Mapping[str, Any] = "design",
    seeds: str | None = None,
    condition: str | None = None,
    cut_out: float | None = None,
    dynamics: str | None = None,
    tau1: float | None = None,
    start: bool = False,
    stop: float | None = None,
    noise: tuple[Sensor, int, int] | None = None,
) -> list[Run]:
    """Return the simulations that the options of `hkt simulate` ask for.

    Parameters
    ----------
    solution : Solution
        A finished result.
    flow : str or mapping
        As of `runs_of`.
    seeds : str or None
        As of `runs_of`.
    condition : str or None
        Fouling in place of that of the case, as text.
    cut_out : float or None
        Flow speed (m/s) above which the machine stands still, in place of the law's.
    dynamics : str or None
        Model of the wake; None: that of the case.
    tau1 : float or None
        Its time constant, s; None: that of the case.
    start : bool
        As of `Run`.
    stop : float or None
        As of `Run`.
    noise : tuple of Sensor, int and int, or None
        As of `Run`.

    Returns
    -------
    list of Run
        One for each scenario and seed.

    Raises
    ------
    InputError
        As of `runs_of`, and if options contradict one another.
    """
    if (start or stop is not None) and (not start or noise):
        remedy = "leave --noise-snr out" if noise else "give --start-up with --shut-down"
        raise InputError("is for a start from standstill, without noise", remedy, key="--start-up")
    changes = {"condition": condition, "control.cut_out": cut_out}
    if asked := [f"{key}={value}" for key, value in changes.items() if value is not None]:
        solution = replace(solution, case=solution.case.with_overrides(*asked))
    wake, against = solution.case.inflow_dynamics, ""
    if dynamics is not None or tau1 is not None:
        model = json.dumps({"model": dynamics or wake.model, "tau1": tau1})
        wake = solution.case.with_overrides(f"inflow_dynamics={model}").inflow_dynamics
    if noise:
        against = "--noise-snr, whose runs take the torque from a table"
    if start:
        against = "--start-up, which begins where the model is not valid (docs/dynamic_inflow.md)"
    if wake.remembers and against and (dynamics or tau1):  # that of the case is left out
        problem, key = f"does not go with {against}", "--inflow-dynamics" if dynamics else "--tau1"
        raise InputError(problem, "leave one of them out", key=key, value=dynamics or tau1)
    runs = runs_of(solution, flow, seeds, wake.remembers and not against, wake.tau1)
    return [replace(run, start=start, stop=stop, noise=noise) for run in runs]


def _seeds(text: str) -> tuple[int | None, ...]:
    """Return the whole numbers and ranges of a text."""
    parts = [re.fullmatch(r" *(\d{1,9})(?:\.\.(\d{1,9}))? *", x) for x in text.split(",")]
    spans = [range(int(x[1]), int(x[2] or x[1]) + 1) for x in parts if x]
    if None in parts or not all(spans) or sum(map(len, spans)) > MOST_SEEDS:
        remedy = f"give 1..20 or 3,5,9 or the like, at most {MOST_SEEDS} seeds"
        raise InputError("is no list of seeds", remedy, key="--flow-seeds", value=text)
    return tuple(dict.fromkeys(seed for span in spans for seed in span))


def largest(runs: Sequence[Run]) -> dict[str, Extreme]:
    """Return the largest value of each limit and load over several runs.

    Parameters
    ----------
    runs : sequence of Run
        Simulations.

    Returns
    -------
    dict of Extreme
        By the names of limits and loads, of an event the earliest; of several runs, with the name
        of the run. Where a load is limited in some of them only, ``NAME without limit`` is that of
        the others.
    """
    entries: dict[str, Extreme] = {}
    limited = {name for run in runs for name, x in run.extremes.items() if x.limit is not None}
    for run in runs:
        for name, entry in run.extremes.items():
            key = f"{name} without limit" if name in limited and entry.limit is None else name
            pair = entry.model_copy(update={"scenario": run.name or None}), entries.get(key, entry)
            end = min if (entry.unit, entry.share) == ("s", None) else max  # of events the first
            entries[key] = end(pair, key=lambda x: (x.value if x.share is None else x.share) or 0.0)
    return entries


def records(runs: Iterable[Run]) -> list[dict[str, Any]]:
    """Return the results of simulations: a record for each energy, limit and load of each.

    Parameters
    ----------
    runs : iterable of Run
        The simulations.

    Returns
    -------
    list of dict
        With scenario, seed, quantity and `FIELDS`, in SI units.
    """
    rows = []
    for run in runs:
        noisy = run.noisy.energies if run.noisy else {}
        energies = run.energies | {f"energy with noise, {name}": x for name, x in noisy.items()}
        entries = {name: Extreme(value=x, unit="J") for name, x in energies.items()}
        for name, entry in (entries | run.extremes).items():
            where = {"scenario": run.scenario, "seed": run.seed, "quantity": name}
            rows.append(where | {field: getattr(entry, field) for field in FIELDS})
    return rows


def write(folder: Path, runs: Iterable[Run]) -> list[Path]:
    """Write the results of simulations as simulations.json and simulations.csv.

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
    entries, header = records(runs), ("scenario", "seed", "quantity", *FIELDS)
    table = csv_text(header, (record.values() for record in entries))
    data = f"{to_json(entries)}\n"
    return write_new({folder / "simulations.csv": table, folder / "simulations.json": data}, True)
