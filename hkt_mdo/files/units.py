"""Units of time, speed and discharge, and the ways in which files write them."""

from __future__ import annotations

import re

__all__ = ["DISCHARGE_UNITS", "SPEED_UNITS", "TIME_UNITS", "named_unit"]

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0, "days": 86400.0}
"""Seconds in each unit of time."""

SPEED_UNITS = {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001, "km/h": 1 / 3.6, "ft/s": 0.3048}
SPEED_UNITS |= {"knot": 1852 / 3600, "mph": 0.44704}
"""m/s in each unit of speed."""

DISCHARGE_UNITS = {"m3/s": 1.0, "L/s": 0.001, "ft3/s": 0.3048**3}
"""m³/s in each unit of discharge."""

_TIME_WORDS = {
    "s": "s sec secs second seconds",
    "ms": "ms msec millisecond milliseconds",
    "min": "min mins minute minutes",
    "h": "h hr hrs hour hours",
    "days": "d day days",
}
_PER_SECOND = {
    "m/s": "m meter meters metre metres",
    "cm/s": "cm centimeter centimeters centimetre centimetres",
    "mm/s": "mm millimeter millimeters millimetre millimetres",
    "ft/s": "ft foot feet",
    "m3/s": "m3 cubic_meter cubic_meters cubic_metre cubic_metres",
    "L/s": "l liter liters litre litres",
    "ft3/s": "ft3 cubic_foot cubic_feet",
}
_OTHER_WORDS = {
    "m/s": "mps",
    "ft/s": "fps",
    "ft3/s": "cfs",
    "km/h": "km/h kmh kph km_h km_h-1 kilometers_per_hour kilometres_per_hour",
    "knot": "knot knots kn kt kts",
    "mph": "mph mi/h miles_per_hour",
}
_FORMS = ("{}/s", "{}/sec", "{}_s-1", "{}_s", "{}_per_s", "{}_per_second")

TIMES = {word: unit for unit, words in _TIME_WORDS.items() for word in words.split()}
"""The unit of time behind each spelling."""

SPEEDS = {word: unit for unit, words in _OTHER_WORDS.items() for word in words.split()} | {
    form.format(word): unit
    for unit, words in _PER_SECOND.items()
    for word in words.split()
    for form in _FORMS
}
"""The unit of speed or discharge behind each spelling, words joined by underscores."""


def named_unit(name: str, spellings: dict[str, str]) -> str | None:
    """Return the unit that a column's name or attribute ends with: `v [m/s]`, `v_m_s`, `v, ft/s`.

    None where there is none, or one that is not among the spellings.
    """
    text = re.sub(r"\*\*|\^", "", name.strip().lower().replace("³", "3"))
    bracket = re.search(r"[\[(]([^\[\]()]*)[\])]$", text)
    text = bracket[1] if bracket else text.rpartition(",")[2]
    words = re.split(r"[\s_.·]+", text.strip())
    for first in range(len(words)):  # the longest ending that is a unit: m_s, not s
        ending = "_".join(words[first:])
        if ending in SPEEDS or ending in TIMES:
            return spellings.get(ending)
    return None
