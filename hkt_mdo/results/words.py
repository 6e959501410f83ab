"""Quantities as people read them: kilojoules, kilowatts, rpm beside rad/s."""

from math import pi

_PREFIXED = "W", "J", "N", "Pa", "N m"  # units that take k and M


def number(value: float, digits: int = 4) -> str:
    """Return a number with so many digits, without a power of ten where it can be avoided."""
    return f"{float(f'{value:.{digits}g}'):.10g}"


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a quantity in its unit, or in thousandths, thousands or millions of it."""
    size = abs(value)
    prefix = "M" if size >= 1e6 else "k" if size >= 1e3 else "" if size >= 0.1 or not size else "m"
    scale = {"M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3}[prefix]
    return f"{value / scale:.{digits}g} {prefix}{unit}"


def turning(speed: float, digits: int = 4) -> str:
    """Return an angular speed (rad/s) in rad/s and rpm."""
    return f"{speed:.{digits}g} rad/s ({speed * 30.0 / pi:.{digits}g} rpm)"


def plain_unit(unit: str) -> str:
    """Return a unit as it is read: N m s^2/rad^2 for N*m*s**2/rad**2."""
    return unit.replace("**", "^").replace("*", " ")


def measured(value: float | None, unit: str, digits: int = 5) -> str:
    """Return a quantity in a unit as OpenMDAO writes it; a dash for what is not known."""
    plain = plain_unit(unit)
    if value is None:
        return f"- {plain}".rstrip()
    if plain == "rad/s":
        return turning(value, digits)
    if plain in _PREFIXED and abs(value) >= 1e3:
        return quantity(value, plain, digits)
    return f"{value:.{digits}g} {plain}".rstrip()
