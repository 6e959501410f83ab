"""Numbers with their units, and flows, as text."""

from datetime import timedelta
from pathlib import Path

import numpy as np

from hkt_mdo.case.document import unit_of
from hkt_mdo.results.words import number, plain_unit


def span(values, unit: str = "", digits: int = 4) -> str:
    """Return the range of values with its unit."""
    ends = (number(end, digits) for end in (np.min(values), np.max(values)))
    return f"{' to '.join(dict.fromkeys(ends))} {unit}".rstrip()


def powers(values) -> str:
    """Return the range of large numbers, such as 2e5 to 1.2e6."""
    ends = (f"{end:.1e}".split("e") for end in (np.min(values), np.max(values)))
    texts = (f"{digits.removesuffix('.0')}e{int(power)}" for digits, power in ends)
    return " to ".join(dict.fromkeys(texts))


def duration(seconds: float) -> str:
    """Return a time in s, and in hours, minutes and seconds where it is long."""
    clock = f" ({timedelta(seconds=round(seconds))})" if seconds >= 120.0 else ""
    return f"{seconds:g} s{clock}"


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
