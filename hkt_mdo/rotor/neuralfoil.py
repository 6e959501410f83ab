"""Polars of an outline by NeuralFoil, networks that were trained on XFOIL (Sharpe 2024)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hkt_mdo.errors import InputError
from hkt_mdo.files.polar_table import REYNOLDS_RANGE, PolarTable, polar_table
from hkt_mdo.rotor.airfoil import Outline

__all__ = ["MODELS", "N_CRIT_RANGE", "ComputedPolar", "compute_polars"]

MODELS = "xxsmall", "xsmall", "small", "medium", "large", "xlarge", "xxlarge", "xxxlarge"
N_CRIT_RANGE = 1.0, 18.0


@dataclass(frozen=True, eq=False)
class ComputedPolar:
    """A polar and how far it is to be trusted.

    Parameters
    ----------
    table : PolarTable
    confidence : ndarray, shape (n_rows,)
        NeuralFoil's ``analysis_confidence``, 0 to 1: low where the flow is hard to predict (stall)
        or the section is unlike those of the training.
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
    """Compute lift, drag and moment of an outline.

    The angle of attack counts from the outline's x axis, its chord line.

    Parameters
    ----------
    outline : Outline
        Leading edge at the origin, unit chord.
    reynolds : sequence of float
        Reynolds numbers by the chord, increasing.
    alpha : array, shape (n_rows,), rad
        Angles of attack, increasing.
    n_crit : float
        Exponent of the disturbances' amplification at transition: 9 in an average wind tunnel,
        less in more turbulent water.
    model : str
        Size of the network, one of `MODELS`.
    name : str
        What messages call the outline.

    Returns
    -------
    tuple of ComputedPolar
        One for each Reynolds number.

    Raises
    ------
    InputError
        If NeuralFoil is not installed, an argument is out of range, or the result is no polar that
        can be used.
    """
    low, high = N_CRIT_RANGE
    if not low <= n_crit <= high:
        raise InputError(
            f"is not between {low:g} and {high:g}",
            "9 is usual, less in turbulent water",
            key="n_crit",
            value=n_crit,
        )
    if model not in MODELS:
        raise InputError("is no model of NeuralFoil", ", ".join(MODELS), key="model", value=model)
    low, high = REYNOLDS_RANGE
    for number in reynolds:
        if not low <= number <= high:
            raise InputError(
                f"is not between {low:g} and {high:g}",
                "give Reynolds numbers by the chord, such as 2e5",
                key="reynolds",
                value=number,
            )
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
        table = polar_table(degrees, lift, drag, moment, number, file=name)
        polars.append(ComputedPolar(table, confidence))
    return tuple(polars)
