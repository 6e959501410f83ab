"""The summary of a run: the keys of `summary.json`, their checks, and how it is printed.

A run writes a `Summary`, `Solution` reads it, and `hkt show` prints its rows one after the other.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator
from pydantic_core import PydanticCustomError

from hkt_mdo.case import Case
from hkt_mdo.dynamics.limits import BETWEEN, CavitationLimit
from hkt_mdo.errors import InputError
from hkt_mdo.files.yaml_text import dotted
from hkt_mdo.problem.point import StartRecord
from hkt_mdo.results import words as texts
from hkt_mdo.results.words import Row, amounts, joined, limit_words, measured, per_cent, printable

VERSION = 1
"""Version of `summary.json`; a summary without one is older, and is read too."""

SCENARIO = "^[A-Za-z0-9_]{1,100}$"
"""Pattern of a scenario's name, which is part of names of files."""

BLADE = "r_m chord_m twist_deg thickness_over_chord start_chord_m start_twist_deg".split()
"""Fields that hold one value for each blade station; thickness where it is designed."""

BETTER = 1e-3
"""Share by which a branch that was not taken has to be better without time for a warning, as in
`river25` with open loop (1.7 %)."""

STORED = 1e-3
"""Share of the captured energy above which that left in the rotor, or lost by friction, is told."""

ALWAYS = 0.999
"""Share of the time at its limit from which a torque is always there (`all_quadratic`)."""

CAPS = "control_torque", "power", "electrical_power"
"""Limits that decide a gain alone where they always bind."""

WHERE = "time_s", "flow_m_s", "r_m", "scenario"
"""Fields of an entry that tell when and where a value occurs."""

BENT = 0.1
"""Deflection of a tip over the radius above which its loads do not hold."""

FAST = 14.1
"""Speed (m/s) at which the dynamic pressure of water equals atmospheric less vapour pressure."""

_Number = float | None
_Column = list[float] | None


class _Entry(BaseModel):
    """A part of the summary: values of the right type, finite numbers, unknown keys kept."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False, extra="allow", frozen=True)


class Span(_Entry):
    """The range of a quantity over time."""

    min: _Number = None
    max: _Number = None
    mean: _Number = None

    @property
    def ends(self) -> tuple[float, float] | None:
        """Smallest and largest value; None if one of them is not known."""
        return None if self.min is None or self.max is None else (self.min, self.max)


class CheckEntry(_Entry):
    """One check of a result: a value, the limit that it must not exceed, what it is and where."""

    name: str
    value: _Number = Field(default=None, allow_inf_nan=True)
    limit: _Number = None
    passed: bool
    detail: str | None = ""

    def __str__(self) -> str:
        value, limit = measured(self.value, digits=4), measured(self.limit, digits=4)
        return printable(f"{self.name}: {value}, at most {limit}. {self.detail}")


class LoadEntry(_Entry):
    """The largest value of a load or of what a limit is on, when and where.

    Of a limit it is the value closest to the bound `limit`, the smallest of a `lower` one, with
    whether that is reached. Of a limit over time also in which share of the time it binds, and its
    shadow price, by how much the objective (J) would grow with a limit one per cent larger. Of the
    load `cavitation`, in which share of the time sections cavitate.
    """

    value: _Number = None
    unit: str = ""
    limit: _Number = None
    """None: there is no limit."""
    lower: bool = False
    binding: bool | None = None
    share_of_time: _Number = None
    shadow_price: _Number = None
    time_s: _Number = None
    r_m: _Number = None
    """Where along the blade, if it is a load along the blade."""
    scenario: str | None = None
    """In which scenario, where the case has several."""
    flow_m_s: _Number = None
    """In which flow, m/s, where a scenario has no time."""

    @property
    def place(self) -> str:
        """When and where the largest value occurs, as text; empty if it is not known."""
        return joined(
            "" if self.time_s is None else f"at t = {self.time_s:.2f} s",
            "" if self.flow_m_s is None else f"in a flow of {measured(self.flow_m_s, 'm/s', 4)}",
            "" if self.r_m is None else f"r = {self.r_m:.3f} m",
            "" if self.scenario is None else f"in {self.scenario}",
        )

    @property
    def left(self) -> float | None:
        """Distance from the limit, in per cent of it; None if it is not known."""
        if self.value is None or not self.limit:
            return None
        return 100.0 * (self.limit - self.value) / abs(self.limit) * (-1.0 if self.lower else 1.0)

    @property
    def bound(self) -> str:
        """The limit as text."""
        return f"{'at least' if self.lower else 'limit'} {measured(self.limit, self.unit)}"

    @property
    def margin(self) -> str:
        """Distance from the limit, in per cent, and what the limit costs; empty if not known."""
        if (left := self.left) is None:
            return ""
        within = left > -100.0 * BETWEEN
        word = f"margin {max(0.0, left):.2f} %" if within else f"exceeded by {-left:.2f} %"
        if not self.binding or (not within and self.share_of_time is None):
            return word
        share, price = self.share_of_time, self.shadow_price
        verb = "give" if (price or 0.0) >= 0.0 else "lose"
        return joined(
            word,
            "binding" + (f" {100.0 * share:.3g} % of the time" if share else ""),
            "" if price is None else f"1 % more would {verb} {measured(abs(price), 'J', 3)}",
        )

    def row(self, name: str) -> Row:
        """Return the entry as a row; `name` is that of the load or the limit."""
        note = joined("" if self.limit is None else self.bound, self.margin, self.place)
        label = f"{'smallest' if self.lower else 'largest'} {limit_words(name)}"
        return Row(label, self.value, self.unit, note)


class MemoryEntry(_Entry):
    """Stability of the loop of rotor and controller if the wake has memory.

    By its eigenvalues at instants along the integration, with Oye's filters at every station
    (docs/dynamic_inflow.md): `growth` (1/s) is the largest real part at any of them,
    `frozen_growth` that in an unchanged wake. `tau1_s` is the wake's time constant where the growth
    is largest.
    `share_of_instants` is the share of the time; in steady flows that for which each lasts.
    Time (null in steady flows) and flow are those of the first instant that is unstable, or of the
    least stable one.
    `least_inertia_kg_m2` is the inertia of the shaft from which the loop is stable at all of them;
    null: at none. `stiffness` (N m s/rad) is what a controller of the speed must add to the torque
    of an open loop, as a slope over the speed, to hold it in an unchanged wake.
    """

    stable: bool
    growth: _Number = None
    frozen_growth: _Number = None
    tau1_s: _Number = None
    time_s: _Number = None
    inflow_speed: _Number = None
    share_of_instants: _Number = None
    inertia_kg_m2: _Number = None
    least_inertia_kg_m2: _Number = None
    stiffness: _Number = None

    @property
    def text(self) -> str:
        """The verdict as one line of text."""
        if self.stable:
            word = "stable"
            if (self.frozen_growth or 0.0) > 0.0:
                word = "stable, although unstable in an unchanged wake"
            return f"{word}: the slowest change decays with {measured(-(self.growth or 0.0))} 1/s"
        least = self.least_inertia_kg_m2
        heavy = "unstable with any inertia of the shaft"
        if least is not None:
            rotor = f"the rotor has {measured(self.inertia_kg_m2, digits=3)}"
            heavy = f"stable from a shaft inertia of {measured(least, 'kg*m**2', 3)} ({rotor})"
        if self.stiffness is not None:
            held = f"{measured(self.stiffness, 'N*m*s/rad', 3)} times the difference of speed"
            heavy += f", or with a controller that adds more than {held}"
        share = f"{round(100.0 * (self.share_of_instants or 0.0))} % of the time"
        when = "" if self.time_s is None else f"from t = {self.time_s:.2f} s "
        return (
            f"UNSTABLE {when}at v = {self.inflow_speed or 0.0:.3g} m/s, at {share}: the rotor may "
            f"run away before its wake changes (tau1 = {measured(self.tau1_s, 's', 3)}); {heavy}"
        )


class BoundEntry(_Entry):
    """A design variable that ends at one of its bounds, in the unit of the case."""

    name: str
    end: Literal["lower", "upper"]
    bound: float
    unit: str = ""
    r_over_R: list[tuple[float, float]] = []
    """First and last station of each part of the span that is at the bound."""

    def row(self) -> Row:
        """Return the entry as a row."""
        spans = (("at" if a == b else "from", measured((a, b), digits=4)) for a, b in self.r_over_R)
        places = " and ".join(f"{word} r/R = {span}" for word, span in spans)
        label = f"{self.name.replace('_', ' ')} at its {self.end} bound"
        return Row(label, self.bound, self.unit, places)


class BranchEntry(_Entry):
    """One of the ways to keep the limits, by quasi-steady co-design (`start.branch`)."""

    name: str
    objective_J: _Number = None
    taken: bool = False
    kept: bool = False
    """Whether it keeps all limits."""

    def row(self) -> Row:
        """Return the entry as a row."""
        exceeds = "" if self.kept else "where a limit is exceeded"
        ends_here = "the branch of the result" if self.taken else ""
        note = joined("as the optimization begins", exceeds, ends_here)
        return Row(f"branch {self.name}", self.objective_J, "J", note)


class PassEntry(_Entry):
    """One optimization of a run, and the remedy that decided the next one."""

    number: int
    converged: bool
    objective_J: _Number = None
    iterations: int | None = None
    seconds: _Number = None
    remedy: str = ""
    """Name of the remedy; empty for the last optimization."""
    why: str = ""
    """The reason for the remedy."""


class ObjectiveEntry(_Entry):
    """What was optimized: by collocation, by the integration, and its upper bound."""

    kind: str
    unit: str = "J"
    value: _Number = None
    simulated: _Number = None
    bound: _Number = None
    price: _Number = None
    """What value and simulated are less for the price of the shaft's inertia, J."""
    measure: str | None = None
    """How the scenarios are combined; None: there is one scenario."""

    def rows(self, scenarios: dict[str, "ScenarioEntry"]) -> Iterator[Row]:
        """Yield the objective, unless it is the captured energy, and which scenarios decide it."""
        if self.kind != "captured" or self.price:
            price = measured(self.price or 0.0, "J")
            note = f"less {price} for the inertia besides the blades" if self.price else ""
            yield Row(f"objective, {self.kind}", self.simulated, self.unit, note)
        deciding = [name for name, entry in scenarios.items() if entry.decides]
        if deciding:
            named = f"decided by {', '.join(deciding)}"
            yield Row(f"objective, {self.measure}", self.simulated, self.unit, named)


class OperationEntry(_Entry):
    """When a machine with a cut-out speed operates: [begin, end] of each interval.

    Elsewhere it stands still, for `standstill_s` in all; `mean_power_W` is the objective over the
    whole time, standstill included. An interval begins with a rotor that turns: `run_up_J` is the
    sum of the rotor's kinetic energies at the begin of all intervals that follow a standstill.
    """

    intervals_s: list[tuple[float, float]]
    standstill_s: float
    mean_power_W: _Number = None
    run_up_J: _Number = None

    def row(self, duration: float | None) -> Row:
        """Return the entry as a row; the duration is that of the flow, s."""
        count = len(self.intervals_s)
        share = "" if not duration else f" ({100.0 * self.standstill_s / duration:.3g} %)"
        power, run_up = self.mean_power_W, self.run_up_J
        return Row(
            "operation",
            f"in {count} interval{'s' * (count != 1)}",
            note=joined(
                f"standstill for {measured(self.standstill_s, 's')}{share}",
                "" if power is None else f"on average over the whole time {measured(power, 'W')}",
                f"not counted: {measured(run_up, 'J', 3)} for running up again" if run_up else "",
            ),
        )


class YearEntry(_Entry):
    """Results of a resource in a year of 8766 h: electrical energy, and hours.

    `net_energy_kWh` is the energy after availability and losses, `kept` their factor. The capacity
    factor
    is the net energy over that of the largest electrical power all year. `limits_h` has the hours
    in which each limit binds. `uncertainty` is the standard uncertainty of the energy as a share of
    it, and `uncertainty_by` has its parts: the flow's `speed`, and the length of the `record`,
    null where the record is too short for it; the total is then not known.
    """

    energy_kWh: _Number = None
    net_energy_kWh: _Number = None
    uncertainty: _Number = None
    uncertainty_by: dict[str, _Number] = {}
    kept: _Number = None
    rated_power_W: _Number = None
    capacity_factor: _Number = None
    operation_h: _Number = None
    standstill_h: _Number = None
    rated_h: _Number = None
    limits_h: dict[str, _Number] = {}

    def rows(self) -> Iterator[Row]:
        """Yield the entry as rows."""
        words = {"speed": "by the flow's speed", "record": "by the length of the record"}
        parts = ((words.get(k, k), x) for k, x in self.uncertainty_by.items())
        by = (k + (": not known" if x is None else f" {100.0 * x:.2g} %") for k, x in parts)
        yield Row("annual energy", self.energy_kWh, "kWh", "electrical, of 8766 h", 6)
        if self.kept not in (None, 1.0):
            lost = f"times {self.kept:.4g} for what is lost"
            yield Row("annual energy, net", self.net_energy_kWh, "kWh", lost, 6)
        share = None if self.uncertainty is None else 100.0 * self.uncertainty
        yield Row("standard uncertainty of annual energy", share, "%", joined(*by), 2)
        most = f"of the largest electrical power, {measured(self.rated_power_W, 'W')}"
        edge = "at an end of the flow's range, which has no hours" if self.rated_h == 0.0 else ""
        yield Row("capacity factor", self.capacity_factor, note=joined(most, edge), digits=4)
        hours = {"standstill": self.standstill_h, "at the largest electrical power": self.rated_h}
        limits = {limit_words(name): time for name, time in self.limits_h.items() if time}
        hours |= {f"at the limit {words}": time for words, time in limits.items()}
        note = joined(*(f"{words} {measured(time, 'h', 4)}" for words, time in hours.items()))
        yield Row("hours of operation", self.operation_h, "h", note)


class Achieved(_Entry):
    """What a scenario has achieved, and in the same words the whole result."""

    energy_J: _Number = None
    """Captured energy of the optimization, by collocation."""
    simulated_energy_J: _Number = None
    """Captured energy of the independent integration."""
    generator_energy_J: _Number = None
    """Energy that the generator takes from the shaft in the integration."""
    stored_energy_J: _Number = None
    """Kinetic energy that the rotor has at the end of the integration beyond that at its begin."""
    electrical_energy_J: _Number = None
    """Energy that the generator delivers, after its losses."""
    tip_speed_ratio: Span | None = None
    operation: OperationEntry | None = None
    """Intervals of operation; None where the machine never stands still."""
    limits: dict[str, LoadEntry] | None = None
    loads: dict[str, LoadEntry] | None = None
    """Largest loads: thrust, root moment of one blade, stress in a blade, and, where the depth of
    the hub and the suction of the sections are known, cavitation; torque and shaft power of the
    generator, rotor speed and tip speed."""

    @property
    def used(self) -> dict[str, float]:
        """By how much each limit is used (%), by the words for it."""
        margins = ((limit_words(x), entry.left) for x, entry in (self.limits or {}).items())
        return {words: 100.0 - left for words, left in margins if left is not None}

    def at_limits(self, case: Case) -> dict[str, tuple[LoadEntry, str]]:
        """Return each limit and each load without one, with remarks (`unasked`), by words for them.

        A limit has the place of its load. A load whose largest value is that of another scenario
        than the limit's is an entry of its own.
        """
        limits, loads, remarked = self.limits or {}, self.loads or {}, {}
        for name in limits | loads:
            words, load = limit_words(name), loads.get(name)
            named = {words: limits.get(name, load)}
            if load and load.scenario != named[words].scenario:
                named[f"{words} of all"] = load
            elif load:
                named[words] = named[words].model_copy(update={x: getattr(load, x) for x in WHERE})
            remarked |= {key: (x, unasked(name, x, case)) for key, x in named.items()}
        return remarked


class ScenarioEntry(Achieved):
    """Results of one scenario: energies, flow, limits and loads.

    `share` is the scenario's share of time, the case's weight over the sum of all; its energies
    count in those of the whole result with `weight`, which is not that of the case but the share
    times the case's duration over `duration_s`. `mean_power_W` is that of the objective over
    `duration_s`. A flow with a cut-out speed is one scenario, its energies, speeds and ratios those
    of all its intervals of operation. Where the measure of `robustness` compares the mean power
    with an upper bound, that is `ceiling_W`; `decides` tells whether this scenario decides the
    measure, unless all do.
    """

    share: _Number = None
    weight: _Number = None
    duration_s: _Number = None
    mean_power_W: _Number = None
    ceiling_W: _Number = None
    decides: bool | None = None
    inflow_speed: Span | None = None
    steady: bool = False
    """Whether it has no time: its tables have a row for each speed of the flow."""
    year: YearEntry | None = None

    def rows(self, case: Case) -> Iterator[Row]:
        """Yield the entry as rows; the case gives the remarks on loads without a limit."""
        flow, ratio = self.inflow_speed or Span(), self.tip_speed_ratio or Span()
        time = f"{measured(self.duration_s, 's')}, share of time {measured(self.share)}"
        time = f"the operation in {time}" if self.year or case.control.cut_out else time
        yield Row("flow", flow.mean, "m/s", f"mean of {time}, at most {measured(flow.max, 'm/s')}")
        yield Row("energy", self.energy_J, "J")
        power = f"on average {measured(self.mean_power_W, 'W')}"
        yield Row("energy, simulated", self.simulated_energy_J, "J", power)
        if self.ceiling_W and self.mean_power_W is not None:
            most = f"of at most {measured(self.ceiling_W, 'W')}"
            note = joined(most, "decides the objective" if self.decides else "")
            share = 100.0 * self.mean_power_W / self.ceiling_W
            yield Row("mean power over its ceiling", share, "%", note)
        yield Row("tip speed ratio", ratio.ends, note=f"mean {measured(ratio.mean)}")
        yield from self.year.rows() if self.year else ()
        yield from in_operation(self, case, self.duration_s)


class Summary(Achieved):
    """Figures of merit of a run; None for what is not known, as after an interruption.

    Its attributes are the keys of `summary.json`.
    """

    version: int | None = Field(default=None, le=VERSION)
    case: str | None = None
    success: bool
    """Whether the optimizer converged and every check passed."""
    message: str | None = None

    starting_energy_J: _Number = None
    start_breaks: list[str] | None = None
    """Limits that the start does not keep; its energy is then no measure of the result."""
    energy_bound_J: _Number = None
    """Energy of a rotor that works at the steady optimum at every instant."""
    certified_gap: _Number = None
    """Relative difference between the simulated energy and an upper bound that includes the torque
    limit and the control law (docs/checks.md). It does not include a limit of the power."""
    energy_balance_error: _Number = None
    objective: ObjectiveEntry | None = None

    gain: float | list[float] | None = None
    gain_units: list[str | None] | None = None
    power_coefficient_max: _Number = None
    tip_speed_ratio_at_power_coefficient_max: _Number = None
    control_torque_max_Nm: _Number = None
    memory: MemoryEntry | None = None
    """Stability of the loop if the wake has memory, also if the case does not have it."""
    tip_deflection_m: _Number = None
    """Largest deflection of a tip out of the rotor plane, of a linear beam."""
    water_inertia_kg_m2: tuple[float, float] | None = None
    """Inertia of the water that the blades accelerate, as flat plates and as ellipses of the
    sections' thickness; it is part of the rotor's only as `rotor.added_inertia` says."""
    weight_stress_Pa: _Number = None
    """Largest stress by the weight of a blade, where a limit counts it."""
    weight_moment_Nm: _Number = None
    """Moment of a horizontal blade's weight, less its buoyancy, at the hub's radius, about the
    rotor's axis; it changes its sign in half a turn."""
    at_bounds: list[BoundEntry] | None = None
    """Design variables that end at a bound of the case: a wider one may give more."""
    scenarios: dict[Annotated[str, Field(pattern=SCENARIO)], ScenarioEntry] | None = None
    """Results of each scenario of the case."""
    branches: list[BranchEntry] | None = None
    """Overspeed and underspeed, where limits can be kept by both, the one that was taken first."""
    starts: list[StartRecord] | None = None
    """Outcomes of the starts that were tried, in quasi-steady operation."""

    rotor_radius_m: _Number = None
    """Radius of the swept disc."""
    tip_radius_m: _Number = None
    """Distance of the blade's tip from the axis, along the blade."""
    set_angle_deg: _Number = None
    inertia_kg_m2: _Number = None
    hub_inertia_kg_m2: _Number = None
    """The part of it that is not the blades', where that is designed."""
    mass_kg: _Number = None
    r_m: _Column = None
    chord_m: _Column = None
    twist_deg: _Column = None
    thickness_over_chord: _Column = None
    start_chord_m: _Column = None
    start_twist_deg: _Column = None

    surrogate_error: _Number = None
    bins_error: _Number = None
    """Relative error of the captured energy by the bins of steady scenarios."""
    max_speed_error: _Number = None
    """Largest relative difference of rotor speed between collocation and integration."""
    checks: list[CheckEntry] | None = None
    notes: list[str] | None = None
    """What was converted, repaired or left out of the case's files."""
    doubts: list[str] | None = None
    """Probable mistakes in the case, and polars that do not reach, as `hkt check` warns."""

    package: str | None = None
    optimizer: str | None = None
    iterations: int | None = None
    passes: list[PassEntry] | None = None
    """The optimizations, and which remedy followed each one and why."""
    wall_seconds: _Number = None
    versions: dict[str, Any] | None = None
    digest: str | None = None
    """Of the files and the source code that the result is made of."""

    @field_validator(*BLADE[1:])
    @classmethod
    def _one_value_a_station(cls, column: _Column, info: Any) -> _Column:
        if column is not None and len(column) != len(info.data.get("r_m") or ()):
            raise PydanticCustomError("length", "must have one value for each of r_m")
        return column

    @property
    def year(self) -> YearEntry | None:
        """The year of a result whose only scenario has one."""
        entries = [*(self.scenarios or {}).values()]
        return entries[0].year if len(entries) == 1 else None

    @property
    def largest(self) -> dict[str, LoadEntry]:
        """Largest loads and values of limits, of both the larger: a limit may count more."""
        entries = [*(self.loads or {}).items(), *(self.limits or {}).items()]
        return dict(sorted(entries, key=lambda pair: pair[1].value or 0.0))

    @classmethod
    def parse(cls, text: str | bytes, file: Path | str = "summary.json") -> "Summary":
        """Return the summary of a JSON text; InputError if it is no JSON or has a wrong value."""
        try:
            return cls.model_validate_json(text)
        except ValidationError as failure:
            # that of the version, if there is one, explains the others
            error = min(failure.errors(), key=lambda each: each["type"] != "less_than_equal")
        key = dotted(f"[{i}]" if isinstance(i, int) else i for i in error["loc"])
        problem = error["msg"].replace("Input should be", "must be")
        where, remedy = {"key": key, "value": error["input"]}, "run the case again"
        if error["type"] == "missing":
            problem, where = "is missing", {"key": key}
        elif error["type"] == "json_invalid":
            problem, where = f"cannot be read as JSON ({error['ctx']['error']})", {}
        elif error["type"] == "less_than_equal":
            problem = "was written by a newer hkt_mdo"
            remedy = f"update hkt_mdo, which reads version {VERSION}, or run the case again"
        elif key.startswith("gain."):  # pydantic reports each type of the union
            problem, where["key"] = "must be a number or a list of numbers", "gain"
        raise InputError(problem, remedy, file=file, **where)

    def rows(self, case: Case) -> list[Row]:
        """Return the rows of the printed table, those of each of several scenarios at the end.

        Parameters
        ----------
        case : Case
            The case that was run.

        Returns
        -------
        list of Row
        """
        return [row for rows in self.tables(case).values() for row in rows]

    def tables(self, case: Case) -> dict[str, list[Row]]:
        """Return the rows by the titles of their tables."""
        year = self.year.rows() if self.year else ()
        limits = in_operation(self, case, case.phase.duration)
        bent = bending(self.tip_deflection_m, self.tip_radius_m, self.weight_moment_Nm)
        tables = {
            "Result": [*self._outcome(case)],
            "Blade and controller": [*self._design(case)],
            "Operation, limits and loads": [*year, *limits, *bent],
            "Optimization": [*self._optimization()],
        }
        scenarios = self.scenarios or {}
        for name, entry in scenarios.items() if len(scenarios) > 1 else ():
            rows = entry.rows(case.of_scenario(name))
            tables[f"Scenario {name}"] = [replace(x, label=f"{name}: {x.label}") for x in rows]
        return tables

    def warnings(self, case: Case) -> list[str]:
        """Return what may be wrong beside the checks.

        A blade that would break or bends too far, an unstable loop, large unlimited loads, a torque
        that is always at its limit, a better branch without a verified result, and `doubts`.
        """
        # the stress is told by what breaks the blade
        loads = {name: x for name, x in (self.loads or {}).items() if name != "stress"}
        asked = [(x.row(name), unasked(name, x, case)) for name, x in loads.items()]
        large = [f"{row.label} {measured(row.value, row.unit, 4)}: {x}" for row, x in asked if x]
        stable = self.memory is None or self.memory.stable
        loop = [] if stable else [f"with dynamic inflow, {self.memory.text}"]
        full = "is always at its limit: the gain is arbitrary, slower flow may stall it"
        full = [
            f"the {name.removeprefix('control_').replace('_', ' ')} {full}"
            for name, entry in (self.limits or {}).items()
            if name in CAPS and self.gain is not None and (entry.share_of_time or 0.0) > ALWAYS
        ]
        breaks = self.breaks(case).values()
        return [*breaks, *loop, *large, *full, *self._better(), *(self.doubts or ())]

    def _better(self) -> Iterator[str]:
        """Yield that a branch which was not taken is better without time."""
        branches = sorted(self.branches or (), key=lambda way: not way.taken)
        for way in branches[1:]:
            base, best = branches[0].objective_J, way.objective_J
            if way.kept and base and best and best - base > BETTER * abs(base):
                text = f"without time, branch {way.name} is better by {per_cent(best - base, base)}"
                yield f"{text}, but has no verified result; start.branch={way.name} begins there"

    def breaks(self, case: Case) -> dict[str, str]:
        """Return that the stress would break the blade, or its loads do not hold, and why."""
        most, stress = case.rotor.blade_material.allowable_stress, self.largest.get("stress")
        reasons = {}
        if most and stress and (stress.value or 0.0) > (1.0 + BETWEEN) * most:
            largest, limit = measured(stress.value, "Pa", 4), measured(most, "Pa", 4)
            why = f"the largest stress in a blade, {largest}, is above its material's, {limit}"
            reasons["the blade would break"] = why
        for why in bends_far(self.tip_deflection_m, self.tip_radius_m):
            reasons["the blade bends too far for its loads to hold"] = why
        return reasons

    def verdict(self, case: Case) -> str:
        """Return whether the result is verified and its blade holds, and how many warnings."""
        count = len(self.warnings(case))
        word = "verified" if self.success else "not verified"
        if wrong := [*self.breaks(case)]:
            word += f", {'but' if self.success else 'and'} {wrong[0]}"
        return joined(word, f"{count} warning{'s' * (count != 1)}" if count else "")

    def _outcome(self, case: Case) -> Iterator[Row]:
        """Yield the rows of verdict and energy."""
        energy, simulated, bound = self.energy_J, self.simulated_energy_J, self.energy_bound_J
        best = energy if simulated is None else simulated
        share = 100.0 * best / bound if best is not None and bound else None
        off = per_cent(simulated - energy, energy, sign="+") if simulated and energy else ""
        yield Row("case", case.name)
        flows = joined(*(x.name for x in case.scenarios))
        yield Row("flow", flows or texts.flow_words(case.inflow))
        yield Row("verdict", self.verdict(case))
        yield Row("message", self.message)
        if self.memory is not None:
            yield Row("stability with dynamic inflow", self.memory.text)
        yield Row("energy", energy, "J")
        yield Row("energy, simulated", simulated, "J", off)
        withheld = joined(*self._withheld(best, case))
        yield Row("energy of the generator", self.generator_energy_J, "J", withheld)
        yield Row("energy, electrical", self.electrical_energy_J, "J", self._losses())
        yield Row("share of quasi-steady bound", share, "%")
        if self.objective is not None:
            yield from self.objective.rows(self.scenarios or {})
        captured = self.objective is None or self.objective.kind == "captured"
        if captured and not case.limits.given and (gap := self.certified_gap) is not None:
            yield Row("certificate", f"gap up to {max(100.0 * gap, 0.0):.2g} %")

    def _withheld(self, captured: float | None, case: Case) -> Iterator[str]:
        """Yield what the rotor stores and friction takes, as text, unless it is small."""
        stored, rest = self.stored_energy_J or 0.0, self.generator_energy_J
        lost = captured - rest - stored if case.generator.rubs and captured and rest else 0.0
        rotor = f"{'left in' if stored > 0.0 else 'taken from'} the turning rotor"
        for energy, word in ((abs(stored), rotor), (lost, "lost by friction of the shaft")):
            if captured and energy > STORED * abs(captured):
                share = f"{per_cent(energy, captured, 3)} of the energy"
                yield f"{measured(energy, 'J')} ({share}) {word}"

    def _losses(self) -> str:
        """Return the energy that the generator loses, and its share, as text."""
        generated, electrical = self.generator_energy_J, self.electrical_energy_J
        if generated is None or electrical is None:
            return ""
        lost = generated - electrical
        if abs(lost) <= 1e-9 * abs(generated):
            return "the generator loses nothing"
        return f"losses {measured(lost, 'J')} ({per_cent(lost, generated, 3) or '-'})"

    def _design(self, case: Case) -> Iterator[Row]:
        """Yield the rows of controller and blade."""
        if case.control.law != "open_loop":
            gain, units = self.gain, self.gain_units or [None]
            label, listed = f"gain, {case.control.law} feedback", isinstance(gain, list)
            yield Row(label, amounts(gain, units)) if listed else Row(label, gain, units[0] or "")
        ratio = self.tip_speed_ratio or Span()
        yield Row("tip speed ratio", ratio.ends, "", f"mean {measured(ratio.mean, digits=4)}", 4)
        at = f"at tip speed ratio {measured(self.tip_speed_ratio_at_power_coefficient_max, '', 4)}"
        yield Row("largest power coefficient", self.power_coefficient_max, "", at, 4)
        yield Row("stations", self.chord_m and len(self.chord_m))
        yield Row("tip radius", self.tip_radius_m, "m", digits=4)
        if case.design.set_angle_bounds:
            yield Row("set angle", self.set_angle_deg, "deg", digits=4)
        besides = f"of which {measured(self.hub_inertia_kg_m2)} kg m^2 designed besides the blades"
        besides = "" if self.hub_inertia_kg_m2 is None else besides
        yield Row("inertia", self.inertia_kg_m2, "kg*m**2", besides, 4)
        if self.water_inertia_kg_m2 is not None and self.inertia_kg_m2:
            model = case.rotor.added_inertia
            yield water_inertia(self.water_inertia_kg_m2, self.inertia_kg_m2, model)
        yield Row("mass", self.mass_kg, "kg", digits=4)
        yield from (entry.row() for entry in self.at_bounds or ())

    def _optimization(self) -> Iterator[Row]:
        """Yield the rows of the computation."""
        yield Row("torque curve, relative error", self.surrogate_error, digits=2)
        yield Row("rotor speed, relative error", self.max_speed_error, digits=2)
        if self.bins_error is not None:
            yield Row("energy by bins of the flow, relative error", self.bins_error, digits=2)
        time = measured(self.wall_seconds, "s", 3)
        work = f"{self.optimizer} ({self.package}), {measured(self.iterations)} iterations, {time}"
        yield Row("optimizer", work if self.optimizer else None)
        if self.passes:
            remedies = (f"{entry.remedy}: {entry.why}" for entry in self.passes if entry.remedy)
            yield Row("optimizations", len(self.passes), "", "; ".join(remedies).replace("_", " "))
        if self.starts:
            strategy = next((start.strategy for start in self.starts if start.kept), "none")
            yield Row("starts", f"{len(self.starts)} tried", "", f"began with: {strategy}")
        yield from (branch.row() for branch in self.branches or ())


def in_operation(of: Achieved, case: Case, duration: float | None = None) -> Iterator[Row]:
    """Yield the rows of standstill, limits and loads.

    Parameters
    ----------
    of : Achieved
        A result, or the starting blade.
    case : Case
        The case, which gives the remarks on loads without a limit.
    duration : float, optional
        Of the flow, s.

    Yields
    ------
    Row
    """
    if of.operation is not None:
        yield of.operation.row(duration)
    for words, (entry, remark) in of.at_limits(case).items():
        row = entry.row(words)
        yield replace(row, note=joined(row.note, remark))


def unasked(name: str, load: LoadEntry, case: Case) -> str:
    """Return a remark on a load that is large and has no limit where it occurs, or nothing.

    Parameters
    ----------
    name : str
        Name of the load, as in `Summary.loads`.
    load : LoadEntry
        The load, and the scenario in which it occurs.
    case : Case
        The case that was run.

    Returns
    -------
    str
        Such as ``cavitates: the case has no limits.cavitation``.
    """
    limits = case.of_scenario(load.scenario or "").limits
    by = ("tip_speed", "cavitation", "rotor_speed") if name == "tip_speed" else (name,)
    share = load.share_of_time
    lasts = "" if share is None else f" {100.0 * share:.3g} % of the time"
    most, word = {
        "cavitation": (CavitationLimit().margin, f"cavitates{lasts}"),
        "stress": (case.rotor.blade_material.allowable_stress, "more than the material allows"),
        "tip_speed": (FAST, "fast: near the surface a usual section cavitates"),
    }.get(name, (None, ""))
    key = "limits.cavitation or limits.tip_speed" if name == "tip_speed" else f"limits.{name}"
    large = most and (load.value or 0.0) > most and not any(getattr(limits, x, None) for x in by)
    return f"{word}: {load.scenario or 'the case'} has no {key}" if large else ""


def water_inertia(estimates: tuple[float, float], inertia: float, model: str) -> Row:
    """Return the row of the water's inertia, two estimates beside that of the rotor (kg m²)."""
    shares = measured(tuple(100.0 * each / inertia for each in estimates), "%", 3)
    counted = "not counted in it" if model == "none" else f"as {model} counted in it"
    note = f"as plates to ellipses, {shares} of the inertia, {counted}"
    return Row("inertia of water", estimates, "kg*m**2", note, 3)


def bends_far(deflection: float | None, radius: float | None) -> Iterator[str]:
    """Yield that a tip's deflection (m) is out of a beam's range, where it is."""
    if deflection and radius and deflection > BENT * radius:
        share = f"{per_cent(deflection, radius, 3) or 'over 10000 %'} of the radius"
        yield f"the largest deflection of a tip is {share}, above {100.0 * BENT:g} %"


def bending(deflection: float | None, radius: float | None, weight: float | None) -> Iterator[Row]:
    """Yield the rows of a tip's deflection and of a blade's weight in water, where they are known.

    Deflection and radius are in m, the moment of the weight at the hub's radius in N*m.
    """
    if deflection is not None:
        share = f"{per_cent(deflection, radius, 3)} of the radius" if radius else ""
        yield Row("largest tip deflection", deflection, "m", joined(share, "as a linear beam"), 4)
    if weight is not None:
        note = "edgewise, at the hub, reversing in every turn; in the stress only with weight: true"
        yield Row("weight in water", abs(weight), "N*m", note, 3)
