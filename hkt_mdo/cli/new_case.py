"""What `hkt new` writes: a commented case to begin from, and the sample file that it needs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from hkt_mdo.case import commented_case, read_case
from hkt_mdo.cli.parts import refuse_existing
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import data_path, shipped_rotor
from hkt_mdo.files.table import read_text
from hkt_mdo.results.folder import write_files

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

KINDS = {
    "paper": "the turbine and the sinusoidal flow of Amini et al. (ACC 2023)",
    "turbine": "a blade of your own from a CSV file",
    "river": "a small turbine in a measured flow of your own from a CSV file",
}
"""What each kind of a new case is about."""

_SAMPLE_BLADE = "river"


_BLADE_REMARK = """\
# A sample, the river turbine that comes with hkt: write your own rows, hub to tip.
# Radius, chord, twist from the rotor plane, thickness over chord; headers hold units.
"""


def _blade_text() -> str:
    """Return a blade as CSV: that of the shipped river turbine."""
    text = read_text(data_path(_SAMPLE_BLADE, "blade"), "blade")
    return _BLADE_REMARK + re.sub("^#.*\n", "", text, flags=re.MULTILINE)


def _record_text() -> str:
    """Return a record as CSV: five minutes of turbulence at 1 Hz, always the same."""
    flow = "{profile: turbulence, mean: 1.4, intensity: 0.1, duration: 300.0, cutoff: 0.4}"
    inflow = read_case(f"inflow: {flow}\ncontrol: {{law: open_loop}}").inflow
    remark = "# A sample, synthesized turbulence of 10 %: put your own record in its place."
    rows = (f"{time},{speed:.4f}" for time, speed in enumerate(inflow.speed_at(np.arange(301.0))))
    return "\n".join((remark, "time_s,speed_m_s", *rows, ""))


def write_new_case(path: str | Path, kind: str = "paper", *, force: bool = False) -> list[Path]:
    """Write a commented case that loads as it is, and beside it the sample file that it names.

    `path` is the case file, to which ``.yaml`` is added where it is not there. Returns the files,
    the case first. Raises InputError if `KINDS` lacks the kind, if a case cannot have the name of
    the file, or if a file is there already and `force` is not given.
    """
    if kind not in KINDS:
        raise InputError("unknown", f"give one of {', '.join(KINDS)}", key="--kind", value=kind)
    path = Path(path)
    if path.suffix not in (".yaml", ".yml"):
        path = path.parent / f"{path.name}.yaml"
    values: dict[str, dict[str, Any]] = {"inflow": {"profile": "sine"}}
    values["control"] = {"law": "quadratic"}
    samples = {}
    if kind == "turbine":
        blade = path.with_name(f"{path.stem}_blade.csv")
        values["rotor"] = shipped_rotor(_SAMPLE_BLADE) | {"blade": blade.name}
        samples[blade] = _blade_text()
    elif kind == "river":
        record = path.with_name(f"{path.stem}_record.csv")
        values["rotor"] = {"blade": _SAMPLE_BLADE}
        values["inflow"] = {"profile": "record", "file": record.name}
        samples[record] = _record_text()
    usual = {section: keys.split() for section, keys in _USUAL.items()}
    text = f"""\
# {path.stem}: {KINDS[kind]}.
#
# Change what differs in yours. A line such as "# radius: null" shows a key that is not given.
# More keys:  hkt schema --markdown
# Check it:   hkt check {path.name}
# Run it:     hkt run {path.name}

{commented_case(values, usual)}"""
    read_case(text, file=str(path), folder=path.parent, name=path.stem, check_files=False)
    texts = {path: text, **samples}
    refuse_existing(texts, force)
    write_files({file: content.encode() for file, content in texts.items()})
    return list(texts)
