"""What `hkt check` and a result tell alike: rows of the rotor, and a flow in words."""

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

from hkt_mdo.results.words import Row, joined, measured, per_cent, plain_unit

BENT = 0.1  # deflection of a tip over the radius above which its loads do not hold
_IDLE = (
    *("start", "phase", "scale", "gaps", "spikes", "uneven"),
    *("turbulence_intensity", "reversal", "availability", "array_losses", "electrical_losses"),
    *("speed_uncertainty", "reversed_polar"),
)
"""Keys of a flow that are not shown if they have their defaults."""


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
            words.append(f"{name.replace('_', ' ')} {measured(value, '', 4)} {unit}".rstrip())
    return f"{section.profile}: {', '.join(words)}"


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
        share = f"{100.0 * deflection / radius:.3g} % of the radius" if radius else ""
        yield Row("largest tip deflection", deflection, "m", joined(share, "as a linear beam"), 4)
    if weight is not None:
        note = "edgewise, at the hub, reversing in every turn; in the stress only with weight: true"
        yield Row("weight in water", abs(weight), "N*m", note, 3)
