"""Polars of an outline by NeuralFoil, networks that were trained on XFOIL (Sharpe 2024)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hkt_mdo.errors import InputError, install, needed
from hkt_mdo.files.polar_table import REYNOLDS_RANGE, SURFACES, PolarTable, polar_table
from hkt_mdo.files.table import array_columns
from hkt_mdo.rotor.outline import Outline
from hkt_mdo.rotor.potential_flow import potential_suction

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

    The smallest pressure of each surface is that of the potential flow with NeuralFoil's lift
    (`potential_suction`): it has the velocity at 32 evenly spaced points of a surface, the first at
    1/64 of the chord, and suction peaks lie before it.

    Parameters
    ----------
    outline : Outline
        Outline of the section.
    reynolds : sequence of float
        Reynolds numbers by the chord.
    alpha : ndarray of shape (n_rows,)
        Angles of attack (rad), increasing.
    n_crit : float
        Exponent of the e^n transition method: 9 in a wind tunnel, less in turbulent water.
    model : str
        Size of the network, one of `MODELS`.
    name : str
        Name of the outline in messages.

    Returns
    -------
    tuple of ComputedPolar
        Polar and confidence, one for each Reynolds number.

    Raises
    ------
    InputError
        If NeuralFoil is not installed, an argument is out of range, or the result is no polar.
    """
    if model not in MODELS:
        raise InputError("is no model of NeuralFoil", ", ".join(MODELS), key="model", value=model)
    _check("n_crit", n_crit, N_CRIT_RANGE, "9 is usual, less in turbulent water")
    for number in reynolds:
        _check("reynolds", number, REYNOLDS_RANGE, "they are by the chord, such as 2e5")
    network = needed("neuralfoil", install("neuralfoil"), "computing polars ")
    analysis = network.get_aero_from_coordinates
    points = outline.upper_first
    degrees = np.rad2deg(alpha)

    def polar(number: float) -> ComputedPolar:
        result = analysis(points, alpha=degrees, Re=number, n_crit=n_crit, model_size=model)
        lift, drag, moment, confidence = (
            np.asarray(result[key], dtype=float)
            for key in ("CL", "CD", "CM", "analysis_confidence")
        )
        columns = {"alpha_deg": degrees, "cl": lift, "cd": drag, "cm": moment}
        columns |= zip(SURFACES, -potential_suction(outline, alpha, lift), strict=True)
        return ComputedPolar(polar_table(array_columns(name, **columns), number), confidence)

    return tuple(map(polar, reynolds))


def _check(key, value, bounds, remedy):
    """Raise an error where a value is not between its bounds."""
    low, high = bounds
    if not low <= value <= high:
        raise InputError(f"is not between {low:g} and {high:g}", remedy, key=key, value=value)
