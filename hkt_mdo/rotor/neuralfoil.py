"""Polars of an outline by NeuralFoil, networks that were trained on XFOIL (Sharpe 2024)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.polar_table import REYNOLDS_RANGE, SURFACES, PolarTable, Source, polar_table
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.potential_flow import potential_suction

__all__ = ["MODELS", "N_CRIT_RANGE", "ComputedPolar", "compute_polars"]

MODELS = "xxsmall", "xsmall", "small", "medium", "large", "xlarge", "xxlarge", "xxxlarge"
N_CRIT_RANGE = 1.0, 18.0


class ComputedPolar(NamedTuple):
    """A polar, and its confidence by row.

    That is NeuralFoil's ``analysis_confidence``, 0 to 1: low where the flow is hard to predict
    (stall) or the section is unlike those of the training.
    """

    table: PolarTable
    confidence: np.ndarray


def compute_polars(
    outline: Outline,
    reynolds: Sequence[float],
    alpha: np.ndarray,
    n_crit: float = 9.0,
    model: str = "xlarge",
    name: str = "",
) -> tuple[ComputedPolar, ...]:
    """Compute the polars of an outline, one for each Reynolds number by the chord.

    Lift, drag and moment are NeuralFoil's. The smallest pressure of each surface is that of the
    potential flow with this lift (`potential_suction`): NeuralFoil knows the velocity at 32 evenly
    spaced points of a surface, the first at 1/64 of the chord, and suction peaks lie before it.

    alpha[n_rows] (rad) increases; n_crit is the critical exponent of the e^n transition method, 9
    in an average wind tunnel, less in more turbulent water; model is the size of the network, one
    of `MODELS`; name is the outline's in messages. Raises InputError if NeuralFoil is not
    installed, an argument is out of range, or the result is not a valid polar.
    """
    if model not in MODELS:
        raise InputError("is no model of NeuralFoil", ", ".join(MODELS), key="model", value=model)
    _check("n_crit", n_crit, N_CRIT_RANGE, "9 is usual, less in turbulent water")
    for number in reynolds:
        _check("reynolds", number, REYNOLDS_RANGE, "they are by the chord, such as 2e5")
    try:
        from neuralfoil import get_aero_from_coordinates
    except ImportError as error:
        raise InputError(
            f"NeuralFoil, which computes polars, cannot be imported ({error})",
            "pip install 'hkt_mdo[neuralfoil]'",
        ) from None

    x, y = outline.x, outline.y
    clockwise = np.dot(x, np.roll(y, -1)) < np.dot(y, np.roll(x, -1))
    points = np.column_stack((x, y))[:: -1 if clockwise else 1]  # the upper side first
    degrees = np.rad2deg(alpha)
    polars = []
    for number in reynolds:
        result = get_aero_from_coordinates(
            points, alpha=degrees, Re=number, n_crit=n_crit, model_size=model
        )
        lift, drag, moment, confidence = (
            np.asarray(result[key], dtype=float)
            for key in ("CL", "CD", "CM", "analysis_confidence")
        )
        pressure = dict(zip(SURFACES, -potential_suction(outline, alpha, lift), strict=True))
        table = polar_table(degrees, lift, drag, moment, number, pressure, Source(name))
        polars.append(ComputedPolar(table, confidence))
    return tuple(polars)


def _check(key, value, bounds, remedy):
    """Raise an error where a value is not between its bounds."""
    low, high = bounds
    if not low <= value <= high:
        raise InputError(f"is not between {low:g} and {high:g}", remedy, key=key, value=value)
