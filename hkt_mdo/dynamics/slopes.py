"""Derivatives by complex step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

STEP = 1e-40  # no difference is taken, so nothing cancels


def slope(
    function: Callable[..., Any], quantities: Mapping[str, Any], name: str, diagonal: bool
) -> np.ndarray:
    """Return the derivative of a function of named quantities by one of them.

    Parameters
    ----------
    function : callable
        Takes the quantities as keyword arguments, which may be complex.
    quantities : mapping
        Numbers or arrays, by name.
    name : str
        The quantity by which the derivative is taken.
    diagonal : bool
        Whether each entry of the value follows from the same entry of this quantity alone.

    Returns
    -------
    array
        Of the value's shape if diagonal, else (size of the value, size of the quantity).
    """
    given = np.asarray(quantities[name], dtype=float)
    if diagonal:
        value = function(**{**quantities, name: given + 1j * STEP})
        return np.imag(value) / STEP * np.ones(given.shape)
    units = np.eye(given.size).reshape(given.size, *given.shape)
    columns = [
        np.ravel(np.imag(function(**{**quantities, name: given + 1j * STEP * unit})) / STEP)
        for unit in units
    ]
    return np.stack(columns, axis=1)
