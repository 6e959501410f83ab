"""Rows of a report, and quantities as people read them: kilojoules, kilowatts, rpm beside rad/s."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from itertools import groupby, zip_longest
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

_LARGE = ("G", 1e9), ("M", 1e6), ("k", 1e3)
PREFIXED = "W", "J", "N", "Pa", "N m"
"""Units that take a prefix for thousands; `_SMALL` take one for thousandths."""
_SMALL = "m", "s"
_IDLE = (
    *("start", "phase", "scale", "gaps", "spikes", "uneven"),
    *("turbulence_intensity", "reversal", "availability", "array_losses", "electrical_losses"),
    *("speed_uncertainty", "reversed_polar"),
)
"""Keys of a flow that are not shown if they have their defaults."""


@dataclass(frozen=True)
class Row:
    """A quantity of a report: `label` and, as text, its value in people's units and a note.

    Attributes
    ----------
    label : str
        Name of the quantity, or the key of the case that it is about.
    value : float, array_like, str or None
        The quantity in `unit`; of several values, the range is shown; None: it is not known.
    unit : str
        Unit as OpenMDAO writes it, such as ``N*m``; empty for a plain number or a text.
    note : str
        Further information, such as when and where the value occurs.
    digits : int
        Significant digits of the value.
    severity : str
        ``"note"``, ``"warning"`` or ``"failure"``, of a finding that is shown apart from the
        quantities.
    """

    label: str
    value: Any = None
    unit: str = ""
    note: str = ""
    digits: int = 5
    severity: str = ""

    @property
    def text(self) -> str:
        """Value, unit and note, one printable line."""
        return printable(joined(measured(self.value, self.unit, self.digits), self.note))

    def __str__(self) -> str:
        return f"{self.label}: {self.text}" if self.label else self.text


def texts(rows: Iterable[Row]) -> dict[str, str]:
    """Return the texts of rows by their labels."""
    return {row.label: row.text for row in rows}


def aligned(columns: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[Any]]]:
    """Return cells by their labels as rows, one cell a column; "" where there is none."""
    names = dict.fromkeys(label for column in columns for label in column)
    return [(name, [column.get(name, "") for column in columns]) for name in names]


def joined(*texts: str) -> str:
    """Return the texts that are not empty, with commas between them."""
    return ", ".join(text for text in texts if text)


def printable(text: str) -> str:
    """Return untrusted text as one line without control characters, which a terminal would obey."""
    return "".join(c if c.isprintable() else " " for c in " ".join(text.split()))


def measured(value: Any, unit: str = "", digits: int = 5) -> str:
    """Return a quantity, or the range of several, in the unit that people read.

    Parameters
    ----------
    value : float, array_like, str or None
        In `unit`; a text is returned as it is, and a dash for None and for an empty text.
    unit : str
        Unit as OpenMDAO writes it. W, J, N, Pa and N*m take prefixes, rad/s stands with rpm.
    digits : int
        Significant digits; only those of an energy include zeros at the end.

    Returns
    -------
    str
        Such as ``1.2 kN m``, ``7 to 9 rad/s (66.845 to 85.944 rpm)`` or ``12.300 kJ``.
    """
    if value is None or isinstance(value, str):
        return value or "-"
    ends, plain = [float(np.min(value)), float(np.max(value))], plain_unit(unit)
    size, prefix, scale = max(map(abs, ends)), "", 1.0
    if plain in PREFIXED:
        prefix, scale = prefixed(size)
    elif plain in _SMALL and 0.0 < size < 0.1:
        prefix, scale = "m", 1e-3
    texts = [number(end / scale, digits, zeros=plain == "J") for end in ends]
    text = f"{' to '.join(dict.fromkeys(texts))} {prefix}{plain}".rstrip()
    if plain != "rad/s":
        return text
    return f"{text} ({measured(np.array(ends) * 30.0 / np.pi, 'rpm', digits)})"


def per_cent(part: float, whole: float, digits: int = 2, sign: str = "") -> str:
    """Return a part as a share of a whole; empty of a whole that is infinite or next to nothing."""
    if not 0.01 * abs(part) < abs(whole) < np.inf:
        return ""
    return f"{float(f'{100.0 * part / whole:.{digits}g}'):{sign}.10g} %"


def prefixed(size: float) -> tuple[str, float]:
    """Return the prefix of a unit, and its factor, for quantities of a size."""
    return next((each for each in _LARGE if size >= each[1]), ("", 1.0))


def limit_words(name: str) -> str:
    """Return the name of a limit, a load or a check as it is read."""
    return name.replace("_", " ").replace("control torque", "generator torque")


def number(value: float, digits: int = 4, zeros: bool = False) -> str:
    """Return a number with so many digits, without a power of ten where it can be avoided."""
    if zeros:
        return f"{value:#.{digits}g}".rstrip(".")
    return f"{float(f'{value:.{digits}g}'):.10g}"


def plain_unit(unit: str) -> str:
    """Return a unit as it is read: N m s^2/rad^2 for N*m*s**2/rad**2."""
    return unit.replace("**", "^").replace("*", " ")


def amounts(values: Any, units: Any, digits: int = 5) -> str:
    """Return numbers with their units, each unit once after the numbers that share it.

    A unit may be None or missing, for a plain number.
    """
    texts = []
    for unit, row in groupby(zip_longest(values, units), key=itemgetter(1)):
        numbers = [value for value, _ in row]
        text = ", ".join(number(value, digits) for value in numbers)
        text = f"{text} {plain_unit(unit or '')}".rstrip()
        texts.append(text if len(numbers) > 1 else measured(numbers[0], unit or "", digits))
    return "; ".join(texts)


def powers(values: Any) -> str:
    """Return the range of large numbers, such as 2e5 to 1.2e6."""
    ends = (f"{end:.1e}".split("e") for end in (np.min(values), np.max(values)))
    texts = (f"{digits.removesuffix('.0')}e{int(power)}" for digits, power in ends)
    return " to ".join(dict.fromkeys(texts))


def duration(seconds: float) -> str:
    """Return a time in s, and in hours, minutes and seconds where it is long."""
    clock = f" ({timedelta(seconds=round(seconds))})" if seconds >= 120.0 else ""
    return f"{seconds:g} s{clock}"


def flow_words(section: Any) -> str:
    """Return the kind of a flow and the values that make it, without those that change nothing."""
    if section.profile == "sum":
        return " + ".join(flow_words(part) for part in section.parts)
    words = []
    for name, field in type(section).model_fields.items():
        value, usual = getattr(section, name), field.default
        if name == "file" and value is not None:
            words.insert(0, Path(value).name)
        elif name == "constituents":
            words += [part.name or duration(part.period) for part in value]
        elif name != "profile" and value is not None and (name not in _IDLE or value != usual):
            unit = plain_unit(type(section).unit_of(name))
            text = str(value) if name == "seed" else measured(value, "", 4)
            words.append(f"{name.replace('_', ' ')} {text} {unit}".rstrip())
    return f"{section.profile}: {', '.join(words)}"
