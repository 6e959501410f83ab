"""Formulas of named quantities, and their derivatives by complex step."""

from collections.abc import Callable, Collection, Mapping
from typing import Any, ClassVar

import numpy as np

from hkt_mdo.quantities import OVER_TIME, QUANTITIES
from hkt_mdo.sections import Section

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
    argument = np.asarray(quantities[name], dtype=float)

    def along(direction: Any) -> np.ndarray:
        return np.imag(function(**{**quantities, name: argument + 1j * STEP * direction})) / STEP

    if diagonal:
        return along(1.0) * np.ones(argument.shape)
    units = np.eye(argument.size).reshape(argument.size, *argument.shape)
    return np.stack([np.ravel(along(unit)) for unit in units], axis=1)


class Formula(Section):
    """What a limit and an objective are: a formula of the quantities that `inputs` names."""

    inputs: ClassVar[tuple[str, ...]] = ()
    unit: ClassVar[str | None] = None
    named_numbers: ClassVar[dict[str, tuple[str | None, str]]] = {}
    """Unit and description of its inputs that are numbers, and no quantities of the registry."""

    def value(self, **quantities: Any) -> Any:
        """Return the value of the formula, in `unit`; by default the input, or the inputs' sum."""
        return sum(quantities.values())

    @property
    def function(self) -> Callable[..., Any]:
        """What the model computes of it: its value, or the rate of an objective."""
        return self.value

    @property
    def function_unit(self) -> str | None:
        """Unit of that."""
        return self.unit

    @property
    def series(self) -> dict[str, tuple[str | None, str]]:
        """Unit and description of its inputs that change over time."""
        quantities = (QUANTITIES[name] for name in self.inputs if name in OVER_TIME)
        return {each.name: (each.unit, each.text) for each in quantities}

    def is_of(self, names: Collection[str]) -> bool:
        """Tell whether one of its inputs is among some quantities."""
        return bool(set(names) & set(self.inputs))

    def value_of(self, quantities: Any) -> Any:
        """Return what it computes from a mapping that has its inputs, maybe among others."""
        return self.function(**{name: quantities[name] for name in self.inputs})

    def partial(self, name: str, quantities: Mapping[str, Any]) -> np.ndarray:
        """Return the value's derivative by an input, by complex step.

        Parameters
        ----------
        name : str
            The input.
        quantities : mapping
            All inputs, by name, as `value` takes them.

        Returns
        -------
        array
            By an input over time, where the value at an instant follows from the input then, of
            shape (n_times,); by any other, (size of the value, size of the input).
        """
        return slope(self.function, quantities, name, name in self.series)
