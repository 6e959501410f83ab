"""What `hkt new` writes: a commented case to begin from, and the sample file that it needs."""

from pathlib import Path
from typing import Any

from hkt_mdo.case import read_case
from hkt_mdo.case.document import commented_case
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import locate, shipped_rotor
from hkt_mdo.files.table import read_text, write_new
from hkt_mdo.files.template import templates

_USUAL = (
    "blade radius hub_radius_fraction blade_count set_angle station_count polar outline reynolds "
    "material wall hub_inertia density hub_depth mean amplitude angular_frequency file "
    "speed_column speed_unit start duration gaps spikes cutoff torque_limit gain power "
    "rotor_speed thrust stress efficiency chord_bounds twist_bounds chord_points twist_points "
    "radius_bounds segments initial_speed method torque tolerance model tau1 optimizer "
    "max_iterations"
).split()
"""The keys that most cases give."""

KINDS = {
    "paper": "the turbine and the sinusoidal flow of Amini et al. (ACC 2023)",
    "turbine": "a blade of your own from a CSV file",
    "river": "a small turbine in a measured flow of your own from a CSV file",
}
"""Kinds of new cases, and what they are about."""


def write_new_case(path: str | Path, kind: str = "paper", *, force: bool = False) -> list[Path]:
    """Write a commented case that can be run, and beside it the sample file that it names.

    `path` is the case file, to which ``.yaml`` is added where it is not there; `kind` is one of
    `KINDS`. Returns the files, the case first. Raises `InputError` if there is no such kind, if a
    case cannot have the name of the file, or if a file is there already and `force` is not given.
    """
    if kind not in KINDS:
        raise InputError("unknown", f"give one of {', '.join(KINDS)}", key="--kind", value=kind)
    path, texts = Path(path), {}
    if path.suffix not in (".yaml", ".yml"):
        path = path.parent / f"{path.name}.yaml"
    values: dict[str, Any] = {"inflow": {"profile": "sine"}, "control": {"law": "quadratic"}}
    if kind == "turbine":
        blade = path.with_name(f"{path.stem}_blade.csv")
        values["rotor"] = shipped_rotor("river") | {"blade": blade.name}
        remark = "# A sample: write your own rows, hub to tip; twist is from the rotor plane."
        texts[blade] = f"{remark}\n{read_text(locate('river', 'blade'), 'blade')}"
    if kind == "river":
        record = path.with_name(f"{path.stem}_record.csv")
        values["rotor"] = {"blade": "river"}
        values["inflow"] = {"profile": "record", "file": record.name}
        texts[record] = read_text(Path(__file__).with_name("sample_record.csv"), "record")
    fields = {"file": path, "about": KINDS[kind], "keys": commented_case(values, _USUAL)}
    text = templates(Path(__file__).parent).get_template("new_case.yaml").render(fields)
    read_case(text, file=str(path), check_files=False)
    return write_new({path: text} | texts, force)
