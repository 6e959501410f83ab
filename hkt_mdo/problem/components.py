"""Loads, limits and objectives as OpenMDAO components; formulas are those of the kinds."""

import numpy as np
import openmdao.api as om
from scipy.sparse import csr_array

from hkt_mdo.case.guard import any_values
from hkt_mdo.dynamics.formulas import STEP, Formula, slope
from hkt_mdo.dynamics.rotor_ode import CurveComp
from hkt_mdo.quantities import OVER_TIME, QUANTITIES, names

_NONE = np.empty(0)
_NUMBERS = {*names(over="design"), *names(over="result")}


class LoadComp(CurveComp):
    """Loads at the nodes of a phase, 0.5 rho v² c(w R / v), from the curves of a `TablesComp`."""

    factors = "inflow_speed", "density"

    def formula(self, inflow_speed, density, **given):
        pressure = 0.5 * density * inflow_speed**2
        return {name: pressure * each for name, each in super().formula(**given).items()}

    def basis(self, inflow_speed, density, **given):
        return 0.5 * density * inflow_speed[:, None] ** 2 * super().basis(**given)


class LinearComp(om.ExplicitComponent):
    """A matrix times the values of a quantity at the nodes of a phase.

    Input `quantity`[num_nodes, 1], output `result`[n_rows, 1], in `unit`.
    """

    def __init__(self, matrix: csr_array, quantity: str, result: str, unit: str | None):
        super().__init__()
        self._matrix, self._quantity, self._result, self._unit = matrix, quantity, result, unit

    def setup(self):
        (n_rows, n_nodes), matrix = self._matrix.shape, self._matrix.tocoo()
        self.add_input(self._quantity, shape=(n_nodes, 1), **QUANTITIES[self._quantity].meta)
        self.add_output(self._result, shape=(n_rows, 1), units=self._unit)
        rows, cols = matrix.coords
        self.declare_partials("*", "*", rows=rows, cols=cols, val=matrix.data)

    def compute(self, inputs, outputs):
        outputs[self._result] = self._matrix @ inputs[self._quantity]


def _add_known(component, name, place, n_times):
    """Add a quantity as a component's input; along the span, or of a curve, it is the source's."""
    known = QUANTITIES.get(name)
    shape = {"shape": n_times} if name in OVER_TIME else {"shape_by_conn": name not in _NUMBERS}
    component.add_input(place, **shape, **(known.meta if known else {}))


def _known(inputs, places):
    """Return inputs, by quantity, as formulas take them: arrays, and numbers of a design."""
    return {x: inputs[place][0] if x in _NUMBERS else inputs[place] for x, place in places.items()}


class FormulaComp(om.ExplicitComponent):
    """The value of a limit at some nodes of a phase, or that of a limit or objective of the design.

    Inputs: what the formula names, its `series`[size], quantities along the span[n_stations],
    tables[n_nodes], and numbers. Output value[size] in the formula's unit.
    """

    def __init__(self, formula: Formula, size=1):
        super().__init__()
        self._formula, self._size = formula, size

    def setup(self):
        formula, size = self._formula, self._size
        own = formula.series | formula.named_numbers
        for name in formula.inputs:
            if name in own:
                units, text = own[name]
                shape = size if name in formula.series else 1
                self.add_input(name, shape=shape, units=units, desc=text)
            else:
                _add_known(self, name, name, size)
        self.add_output("value", shape=size, units=formula.unit, desc=type(formula).__doc__)

    def setup_partials(self):
        rows = np.arange(self._size)
        for name in self._formula.inputs:
            at = {"rows": rows, "cols": rows} if name in self._formula.series else {}
            self.declare_partials("value", name, **at)

    def _quantities(self, inputs):
        """Return what the formula takes: arrays over time and span, numbers, tables."""
        return _known(inputs, {name: name for name in self._formula.inputs})

    def compute(self, inputs, outputs):
        outputs["value"] = self._formula.value(**self._quantities(inputs))

    def compute_partials(self, inputs, partials):
        known = self._quantities(inputs)
        for name in known:
            partials["value", name] = self._formula.partial(name, known)


class IntegralComp(om.ExplicitComponent):
    """Integrals over all scenarios, by the quadrature of their transcriptions.

    The quadrature is exact for the polynomials of the transcription, so this weighted sum and a
    collocated state would be the same numbers. The sum needs no unknowns: the optimizer cannot
    trade energy against defects.

    Inputs: `scenario:quantity`[num_nodes] for each quantity over time that an integrand names,
    others by their names; outputs: the integral of each integrand, in its unit. `weights` (s) are
    those of the quadrature by scenario, `integrands` an `Objective` by output. With `rows`, by
    scenario, the weights are shares: outputs are mean rates, one for each row.
    """

    def __init__(self, weights, integrands, rows=None):
        super().__init__()
        self._weights, self._integrands, self._rows = weights, integrands, rows or {}

    def setup(self):
        self._terms, added = [], {}
        self._size = 1 + max(self._rows.values(), default=0)
        for output, integrand in self._integrands.items():
            unit = integrand.rate_unit if self._rows else integrand.unit
            self.add_output(output, shape=self._size, units=unit, desc=type(integrand).__doc__)
            for scenario, weights in self._weights.items():
                places = {
                    name: f"{scenario}:{name}" if name in OVER_TIME else name
                    for name in integrand.inputs
                }
                term = output, integrand.rate, self._rows.get(scenario, 0), weights, places
                self._terms.append(term)
                added |= {place: (name, weights.size) for name, place in places.items()}
        for place, (name, n_times) in added.items():
            _add_known(self, name, place, n_times)

    def setup_partials(self):
        for output, _, row, weights, places in self._terms:
            at = {"rows": np.full(weights.size, row), "cols": np.arange(weights.size)}
            for name, place in places.items():
                self.declare_partials(output, place, **(at if name in OVER_TIME else {}))

    def compute(self, inputs, outputs):
        outputs.set_val(0.0)
        for output, rate, row, weights, places in self._terms:
            rates = rate(**_known(inputs, places)) * np.ones(weights.size)
            outputs[output][row] += weights @ rates

    def compute_partials(self, inputs, partials):
        dense = {}
        for output, rate, row, weights, places in self._terms:
            values = _known(inputs, places)
            for name, place in places.items():
                over_time = name in OVER_TIME
                by = slope(rate, values, name, diagonal=over_time)
                if over_time:
                    partials[output, place] = weights * by
                else:
                    empty = np.zeros((self._size, by.shape[1]))
                    total = dense.setdefault((output, place), empty)
                    total[row] += weights @ (by * np.ones((weights.size, 1)))
        for pair, by in dense.items():
            partials[pair] = by


class AggregateComp(om.ExplicitComponent):
    """The objective: a duration times the aggregate of the scenarios' mean rates.

    Inputs mean_rate[n_scenarios] as the aggregate takes them, unknowns[n_unknowns] where the
    aggregate has some; outputs objective and, where the aggregate has some, rows[n_rows], which
    must not be negative. `shares` are the scenarios' of the time, `duration` is in s.
    """

    def __init__(self, aggregate, shares, duration, objective):
        super().__init__()
        self._aggregate, self._shares, self._duration = aggregate, shares, duration
        self._ones, self._objective = {"mean_rate": np.ones(shares.size)}, objective
        if size := np.size(aggregate.best_unknowns(*self._ones.values(), shares)):
            self._ones["unknowns"] = np.ones(size)

    def setup(self):
        objective = self._objective
        for name, ones in self._ones.items():
            self.add_input(name, val=ones, units=objective.rate_unit)
        units = {"objective": objective.unit, "rows": objective.rate_unit}
        for name, value in self._values(**self._ones).items():
            self.add_output(name, shape=value.shape, units=units[name])

    def setup_partials(self):
        """Declare on which inputs each row depends: those that make it NaN when they are NaN."""
        self._places = {}
        for name in self._ones:
            for output, moved in self._moved(self._ones, name, np.nan).items():
                rows, cols = self._places[output, name] = np.nonzero(np.isnan(moved))
                self.declare_partials(output, name, rows=rows, cols=cols)

    def _values(self, mean_rate, unknowns=_NONE):
        """Return the outputs of mean rates and unknowns."""
        value = self._aggregate.value(mean_rate, self._shares, unknowns)
        found = {"objective": self._duration * np.atleast_1d(value)}
        rows = np.atleast_1d(self._aggregate.rows(mean_rate, self._shares, unknowns))
        return found | ({"rows": rows} if rows.size else {})

    def _moved(self, given, name, step):
        """Return the outputs as columns, one with a step of each element of an input."""
        with any_values():
            found = [
                self._values(**given | {name: given[name] + each})
                for each in np.diag(np.full(given[name].size, step))
            ]
        return {output: np.stack([each[output] for each in found], axis=1) for output in found[0]}

    def compute(self, inputs, outputs):
        for name, value in self._values(**dict(inputs.items())).items():
            outputs[name] = value

    def compute_partials(self, inputs, partials):
        given = dict(inputs.items())
        for name in given:
            for output, moved in self._moved(given, name, 1j * STEP).items():
                partials[output, name] = np.imag(moved[self._places[output, name]]) / STEP
