"""Quantities as people read them: kilojoules, kilowatts, rpm beside rad/s."""

from itertools import groupby, zip_longest
from math import pi
from operator import itemgetter

_PREFIXED = "W", "J", "N", "Pa", "N m"  # units that take k, M and G


def number(value: float, digits: int = 4) -> str:
    """Return a number with so many digits, without a power of ten where it can be avoided."""
    return f"{float(f'{value:.{digits}g}'):.10g}"


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a quantity in its unit, or in thousandths, thousands, millions or billions of it."""
    scaled, prefix = _scaled(value)
    return f"{scaled:.{digits}g} {prefix}{unit}"


def energy(value: float | None, digits: int = 5) -> str:
    """Return an energy (J) in J, kJ, MJ or GJ with all its digits, zeros too; a dash for None."""
    if value is None:
        return "- kJ"
    scaled, prefix = _scaled(value)
    return f"{scaled:#.{digits}g} {prefix}J"


def _scaled(value: float) -> tuple[float, str]:
    """Return a value between 0.1 and 1000 as far as possible, and the prefix of its unit."""
    size = abs(value)
    for scale, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, "")):
        if size >= (scale if prefix else 0.1):
            return value / scale, prefix
    return (value / 1e-3, "m") if size > 0.0 else (value, "")


def bent(deflection: float, radius: float | None) -> str:
    """Return the deflection of a tip (m), and its share of the radius (m) where that is known."""
    share = f" ({100.0 * deflection / radius:.3g} % of the radius)" if radius else ""
    return f"{quantity(deflection, 'm')}{share}, as a linear beam"


def turning(speed: float, digits: int = 4) -> str:
    """Return an angular speed (rad/s) in rad/s and rpm."""
    return f"{speed:.{digits}g} rad/s ({speed * 30.0 / pi:.{digits}g} rpm)"


def plain_unit(unit: str) -> str:
    """Return a unit as it is read: N m s^2/rad^2 for N*m*s**2/rad**2."""
    return unit.replace("**", "^").replace("*", " ")


def amounts(values, units, digits: int = 5) -> str:
    """Return numbers with their units, each unit once after the numbers that share it.

    A unit may be None or missing, for a plain number.
    """
    shared = groupby(zip_longest(values, units), key=itemgetter(1))
    rows = ((", ".join(number(each, digits) for each, _ in row), unit) for unit, row in shared)
    return "; ".join(f"{row} {plain_unit(unit or '')}".rstrip() for row, unit in rows)


def measured(value: float | None, unit: str, digits: int = 5) -> str:
    """Return a quantity in a unit as OpenMDAO writes it; a dash for what is not known."""
    plain = plain_unit(unit)
    if value is None:
        return f"- {plain}".rstrip()
    if plain == "rad/s":
        return turning(value, digits)
    if plain in _PREFIXED and abs(value) >= 1e3:
        return quantity(value, plain, digits)
    return f"{number(value, digits)} {plain}".rstrip()
