"""The quantities that limits, objectives, tables and figures name, each described once.

A quantity is known over time, along the span, of the design, or of the whole result. Everything
that names one looks it up here: units, column headers, where it is in the OpenMDAO model, and what
a limit or an objective of one's own may take.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import yaml


@dataclass(frozen=True)
class Described:
    """A quantity: its name, unit, meaning, and what it is known over.

    Attributes
    ----------
    name
        Name in the model, and of the argument of `Limit.value` and `Objective.rate`.
    unit
        SI unit as OpenMDAO writes it; None for a plain number.
    text
        Meaning, in words.
    over
        ``time``: shape (n_times,); ``span``: (n_stations,); ``design`` and ``result``: a number.
    source
        What provides it: the ``trajectory`` (the rotor's ODE), ``loads`` and ``rates`` that follow
        from a trajectory, the ``rotor``, or the ``integrals`` over all scenarios.
    per_pressure
        Unit of a load over the dynamic pressure 0.5 rho v² of the flow.
    """

    name: str
    unit: str | None
    text: str
    over: Literal["time", "span", "design", "result"]
    source: Literal["trajectory", "loads", "rates", "rotor", "integrals"]
    per_pressure: str | None = None

    @property
    def column(self) -> str:
        """Header of its column in the tables of a result.

        Returns
        -------
        str
            Name and unit, such as ``rotor_speed_rad_s``.
        """
        return column_of(self.name, self.unit)


_NAMED, _OTHERS = yaml.safe_load_all(Path(__file__).with_suffix(".yaml").read_text("utf-8"))
QUANTITIES = {name: Described(name, **keys) for name, keys in _NAMED.items()}
"""Every quantity by its name, as ``quantities.yaml`` beside this module describes them."""


def meta_of(name: str) -> dict[str, str | None]:
    """Return units and description of a variable of the model, for OpenMDAO's `add_input`.

    Parameters
    ----------
    name : str
        A quantity, another variable that ``quantities.yaml`` describes, or the table or band of a
        load or a coefficient, such as ``thrust_table``.

    Returns
    -------
    dict
        With the keys units and desc.
    """
    if name in QUANTITIES:
        return {"units": QUANTITIES[name].unit, "desc": QUANTITIES[name].text}
    load = QUANTITIES.get(name.rpartition("_")[0])
    text = f"{name.replace('_', ' ')} of the blade"
    return _OTHERS.get(name) or {"units": load and load.per_pressure, "desc": text}


def names(over: str = "", source: str = "") -> tuple[str, ...]:
    """Return the names of quantities by what they are known over, or by what provides them.

    Parameters
    ----------
    over, source : str
        As in `Described`; empty for any.

    Returns
    -------
    tuple of str
        The names, in the order of the registry.
    """
    return tuple(
        entry.name
        for entry in QUANTITIES.values()
        if over in ("", entry.over) and source in ("", entry.source)
    )


OVER_TIME = names(over="time")
TRAJECTORY = names(source="trajectory")
LOADS = names(source="loads")
RATES = names(source="rates")
STEADY = frozenset((*TRAJECTORY, *LOADS, "rotor_radius", "density", "inertia", "weight_stress"))
"""Quantities of a rotor in steady operation, which the search for a start has."""


def column_of(name: str, unit: str | None) -> str:
    """Return the header of a quantity's column in the tables of a result.

    Parameters
    ----------
    name : str
        Name of the quantity.
    unit : str or None
        Unit as OpenMDAO writes it; empty or None for a plain number.

    Returns
    -------
    str
        Name and unit, such as ``rotor_speed_rad_s``.
    """
    return f"{name}_{unit.replace('*', '').replace('/', '_')}" if unit else name
