"""Numbers with their units, and flows, as text."""

from pathlib import Path

import numpy as np

from hkt_mdo.case.document import unit_of


def number(value: float, digits: int = 4) -> str:
    """Return a number with so many digits, without a power of ten where it can be avoided."""
    return f"{float(f'{value:.{digits}g}'):.10g}"


def span(values, unit: str = "", digits: int = 4) -> str:
    """Return the range of values with its unit."""
    low, high = (number(end, digits) for end in (np.min(values), np.max(values)))
    return f"{low if low == high else f'{low} to {high}'} {unit}".rstrip()


def powers(values) -> str:
    """Return the range of large numbers, such as 2e5 to 1.2e6."""
    texts = []
    for end in (np.min(values), np.max(values)):
        digits, _, power = f"{end:.1e}".partition("e")
        texts.append(f"{digits.removesuffix('.0')}e{int(power)}")
    return texts[0] if texts[0] == texts[1] else " to ".join(texts)


def count(many: int, what: str) -> str:
    """Return a number of things, such as 3 blades."""
    return f"{many} {what}{'s' if many != 1 else ''}"


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a quantity in its unit, or in thousandths, thousands or millions of it."""
    scales = {"M": 1e6, "k": 1e3, "": 0.1, "m": 0.0}
    prefix = next(prefix for prefix, least in scales.items() if abs(value) >= least)
    size = {"": 1.0, "m": 1e-3}.get(prefix, scales[prefix])
    return f"{value / size:.{digits}g} {prefix}{unit}"


def duration(seconds: float) -> str:
    """Return a time in s, and in minutes, hours or days where it is long."""
    for unit, size in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds:g} s ({seconds / size:.3g} {unit})"
    return f"{seconds:g} s"


def plain_unit(unit: str) -> str:
    """Return a unit as it is read: N m s^2/rad^2 for N*m*s**2/rad**2."""
    return unit.replace("**", "^").replace("*", " ")


_IDLE = {"start": 0.0, "phase": 0.0, "scale": 1.0} | dict.fromkeys(
    ("gaps", "spikes", "uneven"), "refuse"
)
"""Values of a flow's keys that change nothing."""


def flow_words(section) -> str:
    """Return the kind of a flow and the values that make it, without those that change nothing."""
    if section.profile == "sum":
        return " + ".join(flow_words(part) for part in section.parts)
    words = []
    properties = type(section).model_json_schema()["properties"]
    for name in type(section).model_fields:
        value = getattr(section, name)
        idle = value is None or _IDLE.get(name) == value
        if name == "file":
            words.insert(0, Path(value).name)
        elif name == "constituents":
            words += [each.name or duration(each.period) for each in value]
        elif name != "profile" and not idle:
            text = value if isinstance(value, str) else span(value)
            unit = plain_unit(unit_of(properties[name]))
            words.append(f"{name.replace('_', ' ')} {text} {unit}".rstrip())
    return f"{section.profile}: {', '.join(words)}"
