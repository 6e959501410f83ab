"""Numbers with their units, and flows, as text."""

from datetime import timedelta
from pathlib import Path

import numpy as np

from hkt_mdo.case.document import unit_of


def number(value: float, digits: int = 4) -> str:
    """Return a number with so many digits, without a power of ten where it can be avoided."""
    return f"{float(f'{value:.{digits}g}'):.10g}"


def span(values, unit: str = "", digits: int = 4) -> str:
    """Return the range of values with its unit."""
    ends = (number(end, digits) for end in (np.min(values), np.max(values)))
    return f"{' to '.join(dict.fromkeys(ends))} {unit}".rstrip()


def powers(values) -> str:
    """Return the range of large numbers, such as 2e5 to 1.2e6."""
    ends = (f"{end:.1e}".split("e") for end in (np.min(values), np.max(values)))
    texts = (f"{digits.removesuffix('.0')}e{int(power)}" for digits, power in ends)
    return " to ".join(dict.fromkeys(texts))


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a quantity in its unit, or in thousandths, thousands or millions of it."""
    size = abs(value)
    prefix = "M" if size >= 1e6 else "k" if size >= 1e3 else "" if size >= 0.1 else "m"
    scale = {"M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3}[prefix]
    return f"{value / scale:.{digits}g} {prefix}{unit}"


def duration(seconds: float) -> str:
    """Return a time in s, and in hours, minutes and seconds where it is long."""
    clock = f" ({timedelta(seconds=round(seconds))})" if seconds >= 120.0 else ""
    return f"{seconds:g} s{clock}"


def plain_unit(unit: str) -> str:
    """Return a unit as it is read: N m s^2/rad^2 for N*m*s**2/rad**2."""
    return unit.replace("**", "^").replace("*", " ")


_IDLE = "start", "phase", "scale", "gaps", "spikes", "uneven"
"""Keys of a flow that change nothing where they have their defaults."""


def flow_words(section) -> str:
    """Return the kind of a flow and the values that make it, without those that change nothing."""
    if section.profile == "sum":
        return " + ".join(flow_words(part) for part in section.parts)
    words, schema = [], type(section).model_json_schema()["properties"]
    for name, field in type(section).model_fields.items():
        value, usual = getattr(section, name), field.default
        if name == "file":
            words.insert(0, Path(value).name)
        elif name == "constituents":
            words += [each.name or duration(each.period) for each in value]
        elif name != "profile" and value is not None and (name not in _IDLE or value != usual):
            text = value if isinstance(value, str) else span(value)
            unit = plain_unit(unit_of(schema[name]))
            words.append(f"{name.replace('_', ' ')} {text} {unit}".rstrip())
    return f"{section.profile}: {', '.join(words)}"
