"""Loads, limits and objectives as OpenMDAO components; formulas are those of the kinds."""

import numpy as np
import openmdao.api as om

from hkt_mdo.case.guard import any_values
from hkt_mdo.dynamics.aggregates import Aggregate
from hkt_mdo.dynamics.formulas import Formula, slope
from hkt_mdo.quantities import QUANTITIES, is_over_time
from hkt_mdo.rotor.band import Band
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.planform import area_weights
from hkt_mdo.rotor.torque_curve import TorqueSpline

_SPEEDS = "rotor_speed", "inflow_speed"


class LoadComp(om.ExplicitComponent):
    """Loads at the nodes of a phase, 0.5 rho v² c(w R / v), from the curves of a `TablesComp`.

    Where the wake has memory, `model` is a `Band`, whose tables are over the tip speed ratio of the
    wake, too. Inputs rotor_speed, inflow_speed and, with a band, wake_ratio[num_nodes, 1], density,
    rotor_radius and, for each of the names, <name>_table[n_nodes] over the spline's nodes, or
    <name>_band; outputs by the names[num_nodes, 1].
    """

    def initialize(self):
        self.options.declare("num_nodes", types=int)
        self.options.declare("names", types=tuple, desc="names of the loads")
        self.options.declare("model", types=(TorqueSpline, Band), recordable=False)

    def setup(self):
        n, names, model = (self.options[name] for name in ("num_nodes", "names", "model"))
        series, rows = {name: QUANTITIES[name].meta for name in _SPEEDS}, np.arange(n)
        if isinstance(model, Band):
            series["wake_ratio"] = {"desc": "tip speed ratio of the wake"}
            found = model.outputs(names)
            self._tables = {name: f"{name}_band" for name in names}
        else:
            found = {
                f"{name}_table": (model.nodes.shape, {"units": QUANTITIES[name].per_pressure})
                for name in names
            }
            self._tables = {name: f"{name}_table" for name in names}
        for name, about in series.items():
            self.add_input(name, shape=(n, 1), **about)
        for name in ("rotor_radius", "density"):
            self.add_input(name, **QUANTITIES[name].meta)
        for name, table in self._tables.items():
            shape, about = found[table]
            self.add_input(table, shape=shape, **about)
            self.add_output(name, shape=(n, 1), **QUANTITIES[name].meta)
            self.declare_partials(name, ("rotor_radius", "density", table))
            self.declare_partials(name, tuple(series), rows=rows, cols=rows)

    def _at(self, inputs):
        """Return where the model is evaluated, the flow speed and the pressure, each (n,)."""
        speed, flow = (inputs[name][:, 0] for name in _SPEEDS)
        wake = [inputs["wake_ratio"][:, 0]] if "wake_ratio" in inputs else []
        ratios = [speed * inputs["rotor_radius"] / flow, *wake]
        return ratios, flow, 0.5 * inputs["density"] * flow**2

    def compute(self, inputs, outputs):
        ratios, _, pressure = self._at(inputs)
        for name, table in self._tables.items():
            values, *_ = self.options["model"].values(inputs[table], *ratios)
            outputs[name][:, 0] = pressure * values

    def compute_partials(self, inputs, partials):
        ratios, flow, pressure = self._at(inputs)
        model, radius, ratio = self.options["model"], inputs["rotor_radius"], ratios[0]
        basis = pressure[:, None] * model.basis(*ratios)
        for name, table in self._tables.items():
            values, by_ratio, *by_wake = model.values(inputs[table], *ratios)
            by_ratio = pressure * by_ratio
            partials[name, table] = basis
            if by_wake:
                partials[name, "wake_ratio"] = pressure * by_wake[0]
            partials[name, "rotor_speed"] = by_ratio * radius / flow
            partials[name, "inflow_speed"] = (2.0 * pressure * values - by_ratio * ratio) / flow
            partials[name, "rotor_radius"] = (by_ratio * ratio / radius)[:, None]
            partials[name, "density"] = (pressure * values / inputs["density"])[:, None]


class TorqueRateComp(om.ExplicitComponent):
    """Rate of the generator torque at the nodes of a phase, by each segment's polynomial.

    Input control_torque, output torque_rate[num_nodes, 1]; `matrix` is
    `Scenario.differentiation`.
    """

    def initialize(self):
        self.options.declare("matrix", recordable=False, desc="rates of values at the nodes, 1/s")

    def setup(self):
        matrix = self.options["matrix"].tocoo()
        shape = matrix.shape[0], 1
        self.add_input("control_torque", shape=shape, **QUANTITIES["control_torque"].meta)
        self.add_output("torque_rate", shape=shape, **QUANTITIES["torque_rate"].meta)
        rows, cols = matrix.coords
        self.declare_partials("*", "*", rows=rows, cols=cols, val=matrix.data)

    def compute(self, inputs, outputs):
        outputs["torque_rate"] = self.options["matrix"] @ inputs["control_torque"]


class AreaComp(om.ExplicitComponent):
    """Planform area of all blades, see `planform_area`.

    Inputs chord[n_stations] (m), rotor_radius (m), with which the stations move; output
    blade_area (m**2).
    """

    def initialize(self):
        self.options.declare("blade", types=Blade, recordable=False, desc="the blade at the start")

    def setup(self):
        blade = self.options["blade"]
        self._weights = area_weights(blade) / blade.rotor_radius
        self.add_input("chord", shape=blade.r.shape, **QUANTITIES["chord"].meta)
        self.add_input("rotor_radius", **QUANTITIES["rotor_radius"].meta)
        self.add_output("blade_area", **QUANTITIES["blade_area"].meta)
        self.declare_partials("*", "*")

    def compute(self, inputs, outputs):
        outputs["blade_area"] = inputs["rotor_radius"] * (self._weights @ inputs["chord"])

    def compute_partials(self, inputs, partials):
        partials["blade_area", "chord"] = inputs["rotor_radius"] * self._weights
        partials["blade_area", "rotor_radius"] = self._weights @ inputs["chord"]


def _add_known(component, name, place, n_times, n_stations):
    """Add a quantity of the registry as a component's input."""
    shapes = {"time": (n_times, 1), "span": (n_stations,)}
    shape = shapes.get(QUANTITIES[name].over, (1,))
    component.add_input(place, shape=shape, **QUANTITIES[name].meta)


def _known(name, value):
    """Return an input as formulas take it: an array over time or span, a number else."""
    over = QUANTITIES[name].over
    return value[:, 0] if over == "time" else value if over == "span" else value[0]


class FormulaComp(om.ExplicitComponent):
    """The value of a limit at some nodes of a phase, or that of a limit or objective of the design.

    Inputs: what the formula names, its `series`[size, 1], quantities along the span
    [n_stations] and of the design; torque_coefficient_table[n_nodes] and one scalar gain_0,
    gain_1, … where it asks for them. Output value[size] in the formula's unit.
    """

    def initialize(self):
        declare = self.options.declare
        declare("formula", types=Formula, recordable=False)
        declare("size", default=1, types=int, desc="of the value")
        declare("n_stations", default=1, types=int)
        declare("n_table", default=0, types=int, desc="number of nodes of the torque curve")
        declare("gain_units", default=(), types=tuple)

    def setup(self):
        options, formula = self.options, self.options["formula"]
        for name in formula.inputs:
            if name == "gains":
                for i, units in enumerate(options["gain_units"]):
                    self.add_input(f"gain_{i}", units=units, desc="feedback gain")
            elif name == "torque_coefficient_table":
                text = "torque coefficient of the curve"
                self.add_input(name, shape=(options["n_table"],), desc=text)
            elif name in QUANTITIES:
                _add_known(self, name, name, options["size"], options["n_stations"])
            else:  # a state of the control law
                units, text = formula.series[name]
                self.add_input(name, shape=(options["size"], 1), units=units, desc=text)
        text = type(formula).__doc__
        self.add_output("value", shape=(options["size"],), units=formula.unit, desc=text)

    def setup_partials(self):
        rows = np.arange(self.options["size"])
        for name in self.options["formula"].inputs:
            if name in self.options["formula"].series:
                self.declare_partials("value", name, rows=rows, cols=rows)
            else:
                self.declare_partials("value", "gain_*" if name == "gains" else name)

    def _quantities(self, inputs):
        """Return what the formula takes: arrays over time and span, numbers, table and gains."""
        given = {}
        for name in self.options["formula"].inputs:
            if name == "gains":
                count = len(self.options["gain_units"])
                given[name] = np.array([inputs[f"gain_{i}"][0] for i in range(count)])
            elif name == "torque_coefficient_table":
                given[name] = inputs[name]
            else:
                given[name] = (
                    _known(name, inputs[name]) if name in QUANTITIES else inputs[name][:, 0]
                )
        return given

    def compute(self, inputs, outputs):
        outputs["value"] = self.options["formula"].value(**self._quantities(inputs))

    def compute_partials(self, inputs, partials):
        for name, by in self.options["formula"].partials(**self._quantities(inputs)).items():
            if name == "gains":
                for i, column in enumerate(by.T):
                    partials["value", f"gain_{i}"] = column[:, None]
            elif name in self.options["formula"].series:
                partials["value", name] = by
            else:
                partials["value", name] = by.reshape(self.options["size"], -1)


class IntegralComp(om.ExplicitComponent):
    """Integrals over all scenarios, by the quadrature of their transcriptions.

    The quadrature is exact for the polynomials of the transcription, so this weighted sum and a
    collocated state would be the same numbers. The sum needs no unknowns: the optimizer cannot
    trade energy against defects.

    Inputs: `scenario:quantity`[num_nodes, 1] for each quantity over time that an integrand names,
    others by their names; outputs: the integral of each integrand, in its unit, one for each row.
    """

    def initialize(self):
        declare = self.options.declare
        declare("weights", types=dict, desc="quadrature weights (s) by scenario")
        declare("integrands", types=dict, desc="`Objective` by output", recordable=False)
        declare("rows", default={}, types=dict, desc="row of each scenario; by default 0")
        declare("mean", default=False, desc="whether the weights are shares, and outputs are rates")
        declare("n_stations", default=1, types=int)

    def _places(self, integrand, scenario):
        """Return the input that holds each quantity of an integrand."""
        return {
            name: f"{scenario}:{name}" if is_over_time(name) else name for name in integrand.inputs
        }

    def setup(self):
        options, declared = self.options, set()
        size = 1 + max(options["rows"].values(), default=0)
        for output, integrand in options["integrands"].items():
            unit = integrand.unit
            if options["mean"]:
                unit = f"({unit})/s" if unit else "1/s"
            self.add_output(output, shape=(size,), units=unit, desc=type(integrand).__doc__)
            for scenario, weights in options["weights"].items():
                for name, place in self._places(integrand, scenario).items():
                    if place not in declared:
                        declared.add(place)
                        _add_known(self, name, place, weights.size, options["n_stations"])

    def setup_partials(self):
        rows = self.options["rows"]
        for output, integrand in self.options["integrands"].items():
            for scenario, weights in self.options["weights"].items():
                cols = np.arange(weights.size)
                at = {"rows": np.full(cols.size, rows.get(scenario, 0)), "cols": cols}
                for name, place in self._places(integrand, scenario).items():
                    self.declare_partials(output, place, **(at if is_over_time(name) else {}))

    def compute(self, inputs, outputs):
        rows = self.options["rows"]
        for output, integrand in self.options["integrands"].items():
            outputs[output] = 0.0
            for scenario, _, weights, values in self._each(integrand, inputs):
                rate = integrand.rate(**values) * np.ones(weights.size)
                outputs[output][rows.get(scenario, 0)] += weights @ rate

    def compute_partials(self, inputs, partials):
        rows = self.options["rows"]
        for output, integrand in self.options["integrands"].items():
            dense = {}
            for scenario, places, weights, values in self._each(integrand, inputs):
                for name, place in places.items():
                    if is_over_time(name):
                        by = slope(integrand.rate, values, name, diagonal=True)
                        partials[output, place] = weights * by
                        continue
                    by = slope(integrand.rate, values, name, diagonal=False)
                    total = np.zeros((self._var_rel2meta[output]["size"], by.shape[1]))
                    total[rows.get(scenario, 0)] = weights @ (by * np.ones((weights.size, 1)))
                    dense[place] = dense.get(place, 0.0) + total
            for place, by in dense.items():
                partials[output, place] = by

    def _each(self, integrand, inputs):
        """Yield each scenario, its inputs' names, its weights and its quantities."""
        for scenario, weights in self.options["weights"].items():
            places = self._places(integrand, scenario)
            values = {name: _known(name, inputs[place]) for name, place in places.items()}
            yield scenario, places, weights, values


class AggregateComp(om.ExplicitComponent):
    """The objective: a duration times the aggregate of the scenarios' mean rates.

    Inputs mean_rate[n_scenarios] as the aggregate takes them, unknowns[n_unknowns] where the
    aggregate has some; outputs objective and, where the aggregate has some, rows[n_rows], which
    must not be negative.
    """

    def initialize(self):
        declare = self.options.declare
        declare("aggregate", types=Aggregate, recordable=False)
        declare("shares", types=np.ndarray, desc="shares of time of the scenarios")
        declare("duration", types=float, desc="s")
        declare("unit", default=None, allow_none=True, desc="of the objective")
        declare("n_unknowns", default=0, types=int)
        declare("n_rows", default=0, types=int)

    def setup(self):
        options, unit = self.options, self.options["unit"]
        rate = f"({unit})/s" if unit else "1/s"
        self.add_input("mean_rate", shape=options["shares"].shape, units=rate)
        if options["n_unknowns"]:
            self.add_input("unknowns", shape=(options["n_unknowns"],), units=rate)
        self.add_output("objective", units=unit, desc="what is optimized")
        if options["n_rows"]:
            self.add_output("rows", shape=(options["n_rows"],), units=rate)

    def setup_partials(self):
        """Declare on which inputs each row depends: those that make it NaN when they are NaN."""
        self._places = {}
        sizes = {"mean_rate": self.options["shares"].size, "unknowns": self.options["n_unknowns"]}
        for output, function in self._functions().items():
            for name, size in sizes.items():
                depends = []
                for column in np.eye(size, dtype=bool):
                    given = {each: np.ones(n) for each, n in sizes.items()}
                    given[name] = np.where(column, np.nan, 1.0)
                    with any_values():
                        depends.append(np.isnan(np.atleast_1d(function(**given))))
                if size:
                    places = np.nonzero(np.transpose(depends))
                    self._places[output, name] = places
                    self.declare_partials(output, name, rows=places[0], cols=places[1])

    def _given(self, inputs):
        unknowns = inputs["unknowns"] if self.options["n_unknowns"] else np.empty(0)
        return {"mean_rate": inputs["mean_rate"], "unknowns": unknowns}

    def _functions(self):
        """Return the function that gives each output, of mean rates and unknowns."""
        aggregate, shares = self.options["aggregate"], self.options["shares"]
        duration = self.options["duration"]
        functions = {
            "objective": lambda mean_rate, unknowns: (
                duration * aggregate.value(mean_rate, shares, unknowns)
            )
        }
        if self.options["n_rows"]:
            functions["rows"] = lambda mean_rate, unknowns: aggregate.rows(
                mean_rate, shares, unknowns
            )
        return functions

    def compute(self, inputs, outputs):
        for name, function in self._functions().items():
            outputs[name] = function(**self._given(inputs))

    def compute_partials(self, inputs, partials):
        given = self._given(inputs)
        for output, function in self._functions().items():
            for name in given:
                if given[name].size:
                    by = slope(function, given, name, diagonal=False)
                    partials[output, name] = by[self._places[output, name]]
