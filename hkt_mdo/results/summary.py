"""The summary of a run: the keys of `summary.json`, what is accepted there, and how it is printed.

A run writes a `Summary`, `Solution` reads it, and `hkt show` prints its fields one after the other:
the label, the format and the unit of a printed field stand beside the field.
"""

from __future__ import annotations

import string
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator
from pydantic_core import PydanticCustomError

from hkt_mdo.case import Case
from hkt_mdo.dynamics.limits import BETWEEN
from hkt_mdo.errors import InputError
from hkt_mdo.files.yaml_text import dotted
from hkt_mdo.results.words import amounts, bent, energy, measured

BLADE = (
    *("r_m", "chord_m", "twist_deg", "thickness_over_chord"),
    *("start_chord_m", "start_twist_deg"),
)
"""Fields that hold one value for each blade station; thickness where it is designed."""


def printable(text: str) -> str:
    """Return untrusted text as one line without control characters, which a terminal would obey."""
    return "".join(c if c.isprintable() else " " for c in " ".join(text.split()))


def _shown(
    label: str, text: str, when: Callable[[Case], bool] = lambda case: True, default: Any = None
) -> Any:
    """Return a field with its row of the table; in braces, fields and `Summary._computed`."""
    row: Any = {"label": label, "text": text, "when": when}
    return Field(default=default, json_schema_extra=row)


class _Formatter(string.Formatter):
    """Formats as `str.format` does, with a dash for a value that is not known."""

    def format_field(self, value: Any, format_spec: str) -> str:
        return "-" if value is None else super().format_field(value, format_spec)


_format = _Formatter().vformat


_Number = float | None
_Column = list[float] | None


class _Entry(BaseModel):
    """A part of the summary: values of the right type, finite numbers, unknown keys kept."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False, extra="allow", frozen=True)

    _text: ClassVar[str] = ""

    def __str__(self) -> str:
        return printable(_format(self._text, (), vars(self)))


class Span(_Entry):
    """The range of a quantity over time."""

    min: _Number = None
    max: _Number = None
    mean: _Number = None


class CheckEntry(_Entry):
    """One judge's word: a value, the limit that it must not exceed, and where it occurred."""

    name: str
    value: _Number = Field(default=None, allow_inf_nan=True)
    limit: _Number = None
    passed: bool
    detail: str | None = ""

    _text = "{name}: {value:.4g}, limit {limit:.4g}. {detail}"


class LimitEntry(_Entry):
    """A limit: the largest value that occurs, the limit, and whether it is reached.

    Of a limit over time: when the value is largest, in which share of the time the limit binds, and
    its worth, by how much the objective (J) would grow with a limit one per cent larger.
    """

    value: _Number = None
    limit: _Number = None
    unit: str = ""
    binding: bool | None = None
    time_s: _Number = None
    share_of_time: _Number = None
    worth: _Number = None

    def __str__(self) -> str:
        told = [measured(self.value, self.unit), f"limit {measured(self.limit, self.unit)}"]
        return printable(", ".join(told))

    @property
    def margin(self) -> str:
        """What is left up to the limit, in per cent, and what it costs; empty if not known."""
        if self.value is None or not self.limit:
            return ""
        left = 100.0 * (self.limit - self.value) / abs(self.limit)
        kept = left > -100.0 * BETWEEN
        word = f"margin {max(left, 0.0):.2f} %" if kept else f"exceeded by {-left:.2f} %"
        if not self.binding:
            return word
        told = [word, "binding"]
        if self.share_of_time is not None:
            told[-1] += f" {100.0 * self.share_of_time:.3g} % of the time"
        if self.worth is not None:
            told.append(f"1 % more would give {measured(self.worth, 'J', 3)}")
        return ", ".join(told)


class LoadEntry(_Entry):
    """The largest value of a load, a speed or a power along the integration, when and where."""

    value: _Number = None
    unit: str = ""
    time_s: _Number = None
    r_m: _Number = None
    """Where along the blade, if it has a place there."""

    @property
    def place(self) -> str:
        """When and where the largest value occurs, as text; empty if it is not known."""
        when = "" if self.time_s is None else f"at t = {self.time_s:.2f} s"
        return when if self.r_m is None else f"{when}, r = {self.r_m:.3f} m"

    def __str__(self) -> str:
        return f"{measured(self.value, self.unit)} {self.place}".rstrip()


class BranchEntry(_Entry):
    """A way to keep the limits, as quasi-steady co-design has it (`start.branch`)."""

    name: str
    objective_J: _Number = None
    taken: bool = False
    kept: bool = False
    """Whether it keeps all limits."""

    def __str__(self) -> str:
        told = f"{energy(self.objective_J or 0.0)} in quasi-steady operation"
        told += "" if self.kept else ", given up before it kept the limits"
        return f"{told}, taken" if self.taken else told


class StartEntry(_Entry):
    """A start that was tried: what proposed it, where it ended, which limits it exceeds there."""

    strategy: str
    branch: str = ""
    objective: _Number = None
    """Quasi-steady objective, J."""
    excess: _Number = None
    """Largest relative excess of a limit; None if there is none, or the rotor does not run."""
    exceeds: list[str] = []
    kept: bool = False
    """Whether the optimization began with it."""


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
    """What the remedy found."""

    _text = "{number}: {iterations} iterations, {seconds:.1f} s; {remedy}: {why}"


class ObjectiveEntry(_Entry):
    """What was maximized: by collocation, by the integration, and its upper bound."""

    kind: str
    value_J: _Number = None
    simulated_J: _Number = None
    bound_J: _Number = None

    def __str__(self) -> str:
        return "-" if self.simulated_J is None else energy(self.simulated_J)


class OperationEntry(_Entry):
    """When a machine with a cut-out speed operates: [begin, end] of each interval.

    Elsewhere it stands still, for `standstill_s` in all; `mean_power_W` is the objective over the
    whole time, standstill included. An interval begins with a rotor that turns: `run_up_J` is what
    the rotor's kinetic energy is then, over all intervals that follow a standstill.
    """

    intervals_s: list[tuple[float, float]]
    standstill_s: float
    mean_power_W: _Number = None
    run_up_J: _Number = None

    def told(self, duration: float | None) -> str:
        """Return the entry as text; the duration is that of the case, s."""
        count = len(self.intervals_s)
        share = "" if not duration else f" ({100.0 * self.standstill_s / duration:.3g} %)"
        text = f"in {count} interval{'s' * (count != 1)}, standstill for "
        text += measured(self.standstill_s, "s") + share
        if self.mean_power_W is not None:
            text += f"; on average over all of it {measured(self.mean_power_W, 'W')}"
        if self.run_up_J:
            text += f"; not counted: {measured(self.run_up_J, 'J', 3)} for running up again"
        return text


class Summary(_Entry, Mapping[str, Any]):
    """Figures of merit of a run; None for what is not known, as after an interruption.

    Fields are attributes. As a mapping, a summary has the keys of `summary.json`, with lists and
    dictionaries as JSON has them.
    """

    case: str | None = _shown("case", "{case}")
    success: bool = _shown("success", "{success}", default=...)
    """Whether the optimizer converged and every check passed."""
    message: str | None = _shown("message", "{message}")

    energy_J: _Number = _shown("energy", "{energy}")
    """Captured energy as the optimizer has it, by collocation."""
    simulated_energy_J: _Number = _shown(
        "energy, simulated",
        "{simulated_energy} ({difference:+.2g} %)",
    )
    """Captured energy of the independent integration."""
    generator_energy_J: _Number = _shown("energy of the generator", "{generator_energy}")
    """What the generator takes from the shaft in the integration; the rest is stored."""
    electrical_energy_J: _Number = _shown(
        "energy, electrical", "{electrical_energy}, losses {losses}"
    )
    """What the generator delivers of that, less its losses."""
    starting_energy_J: _Number = None
    start_breaks: list[str] | None = None
    """Limits that the start does not keep, the distance of its sections from stall among them: its
    energy is then no measure of the result."""
    energy_bound_J: _Number = _shown("share of quasi-steady bound", "{share:.3f} %")
    """Energy of a rotor that works at the steady optimum at every instant."""
    certified_gap: _Number = _shown("certificate", "within {gap:.2g} % of the best possible")
    """What the simulated energy lacks of an upper bound that knows the torque limit and the control
    law, over that bound (docs/theory.md)."""
    bound_power_coefficient: _Number = None
    bound_tip_speed_ratio: _Number = None
    energy_balance_error: _Number = None
    objective: ObjectiveEntry | None = None

    gain: float | list[float] | None = _shown(
        "gain, {law} feedback", "{gains}", lambda case: case.control.law != "open_loop"
    )
    gain_units: list[str | None] | None = None
    tip_speed_ratio: Span | None = _shown(
        "tip speed ratio",
        "{tip_speed_ratio.min:.3f} to {tip_speed_ratio.max:.3f}, mean {tip_speed_ratio.mean:.3f}",
    )
    power_coefficient_max: _Number = _shown(
        "largest power coefficient",
        "{power_coefficient_max:.4f} at tip speed ratio "
        "{tip_speed_ratio_at_power_coefficient_max:.3f}",
    )
    tip_speed_ratio_at_power_coefficient_max: _Number = None
    control_torque_max_Nm: _Number = _shown(
        "largest control torque", "{control_torque_max} ({torque_limit})"
    )
    operation: OperationEntry | None = None
    """Intervals of operation; None where the machine never stands still."""
    limits: dict[str, LimitEntry] | None = None
    loads: dict[str, LoadEntry] | None = None
    """Largest loads: thrust, root moment of one blade, stress in a blade, and, where the depth of
    the hub and the suction of the sections are known, cavitation; shaft power of the generator,
    rotor speed and tip speed."""
    tip_deflection_m: _Number = None
    """Largest deflection of a tip out of the rotor plane, of a linear beam."""
    branches: list[BranchEntry] | None = None
    """Overspeed and underspeed, where limits can be kept by both, the one that was taken first."""
    starts: list[StartEntry] | None = None
    """What became of the starts that were tried, in quasi-steady operation."""

    rotor_radius_m: _Number = None
    """Radius of the swept disc."""
    tip_radius_m: _Number = _shown(
        "tip radius", "{tip_radius_m:.4g} m", lambda case: case.design.radius_bounds is not None
    )
    """Distance of the blade's tip from the axis, along the blade."""
    set_angle_deg: _Number = _shown(
        "set angle", "{set_angle_deg:.4g} deg", lambda case: bool(case.design.set_angle_bounds)
    )
    inertia_kg_m2: _Number = _shown("inertia", "{inertia_kg_m2:.4g} kg m^2")
    mass_kg: _Number = _shown("mass", "{mass_kg:.4g} kg")
    r_m: _Column = None
    chord_m: _Column = None
    twist_deg: _Column = None
    thickness_over_chord: _Column = None
    start_chord_m: _Column = None
    start_twist_deg: _Column = None

    surrogate_error: _Number = _shown("torque curve, relative error", "{surrogate_error:.2g}")
    surrogate_nodes: int | None = None
    max_speed_error: _Number = _shown("rotor speed, relative error", "{max_speed_error:.2g}")
    """Largest relative difference of rotor speed between collocation and integration."""
    checks: list[CheckEntry] | None = None
    notes: list[str] | None = None
    """What was converted, repaired or left out of the case's files."""

    package: str | None = None
    optimizer: str | None = _shown(
        "optimizer", "{optimizer} ({package}), {iterations} iterations, {wall_seconds:.1f} s"
    )
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

    def __getitem__(self, key: str) -> Any:
        return self.model_dump(exclude_unset=True)[key]

    def __iter__(self) -> Iterator[str]:  # type: ignore[override]
        return iter(self.model_dump(exclude_unset=True))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @classmethod
    def parse(cls, text: str | bytes, file: Path | str = "summary.json") -> Summary:
        """Return the summary of a JSON text; InputError if it is no JSON or has a wrong value."""
        try:
            return cls.model_validate_json(text)
        except ValidationError as failure:
            error = failure.errors()[0]
        key = dotted(f"[{i}]" if isinstance(i, int) else i for i in error["loc"])
        problem = error["msg"].replace("Input should be", "must be")
        place = {"key": key, "value": error["input"]}
        if error["type"] == "missing":
            problem, place = "is missing", {"key": key}
        elif error["type"] == "json_invalid":
            problem, place = f"cannot be read as JSON ({error['ctx']['error']})", {}
        elif key.startswith("gain."):  # pydantic reports each type of the union
            problem, place["key"] = "must be a number or a list of numbers", "gain"
        raise InputError(problem, "run the case again", file=file, **place)

    def rows(self, case: Case) -> list[tuple[str, str]]:
        """Return label and text of each row of the printed table; ``-`` for what is not known."""
        values = {name: getattr(self, name) for name in type(self).model_fields}
        values |= self._computed(case)
        rows = []
        for name, field in type(self).model_fields.items():
            row: Any = field.json_schema_extra
            if row and row["when"](case):
                known = values[name] not in (None, "")
                text = _format(row["text"], (), values) if known else "-"
                rows.append((_format(row["label"], (), values), text))
        if self.objective is not None and self.objective.kind != "captured":
            rows.append((f"objective, {self.objective.kind}", str(self.objective)))
        if self.operation is not None:
            rows.append(("operation", self.operation.told(case.phase.duration)))
        limits, loads = self.limits or {}, self.loads or {}
        for name, entry in limits.items():
            if name != "control_torque":  # has a row of its own
                load = loads.get(name) or LoadEntry()
                told = ", ".join(text for text in (str(entry), entry.margin, load.place) if text)
                rows.append((_largest(name), told))
        rows += [(_largest(name), str(each)) for name, each in loads.items() if name not in limits]
        if self.tip_deflection_m is not None:
            told = bent(self.tip_deflection_m, self.tip_radius_m)
            rows.append(("largest tip deflection", told))
        rows += [(f"branch {each.name}", str(each)) for each in self.branches or ()]
        return [(printable(label), printable(text)) for label, text in rows]

    def _computed(self, case: Case) -> dict[str, Any]:
        """Return what rows show besides the fields."""
        found, simulated, bound = self.energy_J, self.simulated_energy_J, self.energy_bound_J
        best = found if simulated is None else simulated
        generated, electrical = self.generator_energy_J, self.electrical_energy_J
        gains = self.gain if isinstance(self.gain, list) else [self.gain]
        limit = case.control.torque_limit
        return {
            "case": case.name,
            "law": case.control.law,
            "gains": "-" if self.gain is None else amounts(gains, self.gain_units or ()),
            "control_torque_max": measured(self.control_torque_max_Nm, "N*m"),
            "torque_limit": "no limit" if limit is None else self._torque_limit(limit),
            "success": "yes" if self.success else "no",
            "energy": energy(found),
            "simulated_energy": energy(simulated),
            "generator_energy": energy(generated),
            "electrical_energy": energy(electrical),
            "losses": _losses(generated, electrical),
            "gap": None if self.certified_gap is None else max(100.0 * self.certified_gap, 0.0),
            "difference": 100.0 * (simulated / found - 1.0) if simulated and found else None,
            "share": 100.0 * best / bound if best is not None and bound else None,
        }

    def _torque_limit(self, limit: float) -> str:
        """Return the limit of the control torque (N*m), and what is left up to it."""
        entry = LimitEntry(value=self.control_torque_max_Nm, limit=limit)
        return ", ".join(text for text in (f"limit {measured(limit, 'N*m')}", entry.margin) if text)


def _largest(name: str) -> str:
    """Return the label of the largest value of a limit or a load."""
    return f"largest {name.replace('_', ' ')}"


def _losses(generated: float | None, electrical: float | None) -> str:
    """Return the energy that the generator loses, and its share, as text."""
    if generated is None or electrical is None:
        return "-"
    lost = generated - electrical
    if abs(lost) <= 1e-9 * abs(generated):
        return "none"
    return f"{energy(lost)} ({100.0 * lost / generated:.3g} %)"
