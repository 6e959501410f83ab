"""What `hkt new` writes: a commented case to begin from, and the sample file that it needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hkt_mdo.case import commented_case, read_case
from hkt_mdo.cli.parts import refuse_existing, write_files
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import data_path, shipped_rotor
from hkt_mdo.files.table import read_text

__all__ = ["KINDS", "write_new_case"]

_USUAL = {
    "rotor": "blade radius hub_radius_fraction blade_count set_angle station_count polar outline "
    "reynolds material_density hub_inertia",
    "fluid": "density",
    "inflow": "mean amplitude angular_frequency file speed_column speed_unit start duration gaps "
    "spikes cutoff",
    "control": "torque_limit gain",
    "design": "blade chord_bounds twist_bounds chord_points twist_points radius_bounds",
    "phase": "duration segments initial_speed",
    "hydrodynamics": "torque tolerance",
    "driver": "optimizer tolerance max_iterations",
}
"""The keys of each section that most cases say something about."""

_SAMPLE_BLADE = "river"


@dataclass(frozen=True)
class _Kind:
    """What a new case is about, what it says besides the defaults, and its sample file.

    A value may name the sample file, as ``{sample}``.
    """

    about: str
    rotor: dict[str, Any] = field(default_factory=dict)
    inflow: dict[str, Any] = field(default_factory=lambda: {"profile": "sine"})
    suffix: str = ""
    sample: Callable[[], str] | None = None


def _blade_text() -> str:
    """Return a blade as CSV: that of the shipped river turbine."""
    lines = read_text(data_path(_SAMPLE_BLADE, "blade"), "blade").splitlines()
    remarks = (
        "# A sample, the river turbine that comes with hkt: write your own rows, hub to tip.",
        "# Radius, chord, twist from the rotor plane, thickness over chord; headers hold units.",
    )
    return "\n".join((*remarks, *(line for line in lines if not line.startswith("#")), ""))


def _record_text() -> str:
    """Return a record as CSV: five minutes of turbulence at 1 Hz, always the same."""
    import numpy as np

    flow = "{profile: turbulence, mean: 1.4, intensity: 0.1, duration: 300.0, cutoff: 0.4}"
    inflow = read_case(f"inflow: {flow}\ncontrol: {{law: open_loop}}").inflow
    time = np.arange(301.0)
    speed = inflow.speed_at(time)
    remark = "# A sample, synthesized turbulence of 10 %: put your own record in its place."
    rows = (f"{t:.0f},{v:.4f}" for t, v in zip(time, speed, strict=True))
    return "\n".join((remark, "time_s,speed_m_s", *rows, ""))


KINDS = {
    "paper": _Kind("the turbine and the sinusoidal flow of Amini et al. (ACC 2023)"),
    "turbine": _Kind(
        "a blade of your own from a CSV file",
        rotor=shipped_rotor(_SAMPLE_BLADE) | {"blade": "{sample}"},
        suffix="_blade.csv",
        sample=_blade_text,
    ),
    "river": _Kind(
        "a small turbine in a measured flow of your own from a CSV file",
        rotor={"blade": _SAMPLE_BLADE},
        inflow={"profile": "record", "file": "{sample}"},
        suffix="_record.csv",
        sample=_record_text,
    ),
}
"""Kinds of new cases by name."""


def write_new_case(path: str | Path, kind: str = "paper", *, force: bool = False) -> list[Path]:
    """Write a commented case that loads as it is, and beside it the sample file that it names.

    `path` is the case file, to which ``.yaml`` is added where it is not there; `kind` is one of
    `KINDS`. Returns the files, the case first. Raises `InputError` if there is no such kind, if a
    case cannot have the name of the file, or if a file is there already and `force` is not given.
    """
    if kind not in KINDS:
        raise InputError("unknown", f"give one of {', '.join(KINDS)}", key="--kind", value=kind)
    path, chosen = Path(path), KINDS[kind]
    if path.suffix not in (".yaml", ".yml"):
        path = path.parent / f"{path.name}.yaml"
    sample = path.parent / f"{path.stem}{chosen.suffix}"

    def named(values: dict[str, Any]) -> dict[str, Any]:
        return {key: sample.name if value == "{sample}" else value for key, value in values.items()}

    values = {
        "rotor": named(chosen.rotor),
        "inflow": named(chosen.inflow),
        "control": {"law": "quadratic"},
    }
    usual = {section: keys.split() for section, keys in _USUAL.items()}
    text = f"""\
# {path.stem}: {chosen.about}.
#
# Change what differs in yours. A line such as "# radius: null" shows a key that is not given.
# More keys:  hkt schema --markdown
# Check it:   hkt check {path.name}
# Run it:     hkt run {path.name}

{commented_case(values, usual)}"""
    read_case(text, file=str(path), folder=path.parent, name=path.stem, check_files=False)

    texts = {path: text}
    if chosen.sample is not None:
        texts[sample] = chosen.sample()
    refuse_existing(texts, force)
    write_files({file: text.encode() for file, text in texts.items()})
    return list(texts)
