"""Loads, limits and objectives as OpenMDAO components; formulas are those of the kinds."""

import numpy as np
import openmdao.api as om
from scipy.sparse import csr_array

from hkt_mdo.case.guard import any_values
from hkt_mdo.dynamics.formulas import STEP, Formula
from hkt_mdo.dynamics.rotor_ode import CurveComp
from hkt_mdo.quantities import meta_of, names

_NONE = np.empty(0)
_NUMBERS = {*names(over="design"), *names(over="result")}


class LoadComp(CurveComp):
    """Loads at the nodes of a phase, 0.5 rho v² c(w R / v), from the curves of a `TablesComp`."""

    factors = "inflow_speed", "density"

    def formula(self, inflow_speed, density, **inputs):
        pressure = 0.5 * density * inflow_speed**2
        return {name: pressure * load for name, load in super().formula(**inputs).items()}

    def basis(self, inflow_speed, density, **inputs):
        return 0.5 * density * inflow_speed[:, None] ** 2 * super().basis(**inputs)


class LinearComp(om.ExplicitComponent):
    """A sum of matrices times values at the nodes of phases, such as an integral over them.

    An integral by the quadrature of the transcription, which is exact for its polynomials, and a
    collocated state would be the same numbers. The sum needs no unknowns: the optimizer cannot
    trade energy against defects.

    Inputs by their names in `matrices`[n_rows, num_nodes], each [num_nodes] in the unit `units`;
    output `result`[n_rows], of which `meta` has units and description.
    """

    def __init__(self, matrices, units, result, meta):
        super().__init__()
        self._matrices = {name: csr_array(matrix) for name, matrix in matrices.items()}
        self._units, self._result, self._meta = units, result, meta

    def setup(self):
        (n_rows, _), *_ = (matrix.shape for matrix in self._matrices.values())
        self.add_output(self._result, shape=n_rows, **self._meta)
        for name, matrix in self._matrices.items():
            self.add_input(name, shape=matrix.shape[1], units=self._units)
            rows, cols = matrix.tocoo().coords
            self.declare_partials("*", name, rows=rows, cols=cols, val=matrix.data)

    def compute(self, inputs, outputs):
        outputs[self._result] = sum(x @ inputs[name] for name, x in self._matrices.items())


class FormulaComp(om.ExplicitComponent):
    """A limit or the rate of an objective at some nodes of a phase, or one of these of the design.

    Inputs: what the formula names, its `series`[size], quantities along the span[n_stations],
    tables[n_nodes], and numbers. Output value[size], that of `Formula.function` in its unit.
    """

    def __init__(self, formula: Formula, size=1):
        super().__init__()
        self._formula, self._size = formula, size

    def setup(self):
        formula, size = self._formula, self._size
        described = formula.series | formula.named_numbers
        for name in formula.inputs:
            if name in described:
                units, text = described[name]
                shape = size if name in formula.series else 1
                self.add_input(name, shape=shape, units=units, desc=text)
            else:  # along the span, or of a curve, the shape is the source's
                self.add_input(name, shape_by_conn=name not in _NUMBERS, **meta_of(name))
        unit = formula.function_unit
        self.add_output("value", shape=size, units=unit, desc=type(formula).__doc__)

    def setup_partials(self):
        rows = np.arange(self._size)
        for name in self._formula.inputs:
            at = {"rows": rows, "cols": rows} if name in self._formula.series else {}
            self.declare_partials("value", name, **at)

    def _quantities(self, inputs):
        """Return what the formula takes: arrays over time and span, numbers, tables."""
        return {x: inputs[x][0] if x in _NUMBERS else inputs[x] for x in self._formula.inputs}

    def compute(self, inputs, outputs):
        outputs["value"] = self._formula.function(**self._quantities(inputs))

    def compute_partials(self, inputs, partials):
        quantities = self._quantities(inputs)
        for name in quantities:
            partials["value", name] = self._formula.partial(name, quantities)


class AggregateComp(om.ExplicitComponent):
    """The objective: a duration times the aggregate of the scenarios' mean rates, less a price.

    Inputs mean_rate[n_scenarios] as the aggregate takes them, unknowns[n_unknowns] where the
    aggregate has some, and hub_inertia (kg*m**2) where it has a price; outputs objective and, where
    the aggregate has some, rows[n_rows], which must not be negative. `shares` are the scenarios' of
    the time, `duration` is in s, `price` in J/(kg*m**2).
    """

    def __init__(self, aggregate, shares, duration, objective, price=0.0):
        super().__init__()
        self._aggregate, self._shares, self._duration = aggregate, shares, duration
        self._price = price
        self._ones, self._objective = {"mean_rate": np.ones(shares.size)}, objective
        if size := np.size(aggregate.best_unknowns(*self._ones.values(), shares)):
            self._ones["unknowns"] = np.ones(size)
        if price:
            self._ones["hub_inertia"] = np.ones(1)

    def setup(self):
        objective = self._objective
        for name, ones in self._ones.items():
            units = "kg*m**2" if name == "hub_inertia" else objective.function_unit
            self.add_input(name, val=ones, units=units)
        units = {"objective": objective.unit, "rows": objective.function_unit}
        for name, value in self._values(**self._ones).items():
            self.add_output(name, shape=value.shape, units=units[name])

    def setup_partials(self):
        """Declare on which inputs each row depends: those that make it NaN when they are NaN."""
        self._places = {}
        for name in self._ones:
            for output, moved in self._moved(self._ones, name, np.nan).items():
                rows, cols = self._places[output, name] = np.nonzero(np.isnan(moved))
                self.declare_partials(output, name, rows=rows, cols=cols)

    def _values(self, mean_rate, unknowns=_NONE, hub_inertia=0.0):
        """Return the outputs of mean rates, unknowns and an inertia that has a price."""
        value = self._aggregate.value(mean_rate, self._shares, unknowns)
        outputs = {"objective": self._duration * np.atleast_1d(value) - self._price * hub_inertia}
        rows = np.atleast_1d(self._aggregate.rows(mean_rate, self._shares, unknowns))
        return outputs | ({"rows": rows} if rows.size else {})

    def _moved(self, inputs, name, step):
        """Return the outputs as columns, one with a step of each element of an input."""
        with any_values():
            moved = [
                self._values(**inputs | {name: inputs[name] + move})
                for move in np.diag(np.full(inputs[name].size, step))
            ]
        return {output: np.stack([row[output] for row in moved], axis=1) for output in moved[0]}

    def compute(self, inputs, outputs):
        for name, value in self._values(**dict(inputs.items())).items():
            outputs[name] = value

    def compute_partials(self, inputs, partials):
        values = dict(inputs.items())
        for name in values:
            for output, moved in self._moved(values, name, 1j * STEP).items():
                partials[output, name] = np.imag(moved[self._places[output, name]]) / STEP
