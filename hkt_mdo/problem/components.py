"""Limits and objectives as OpenMDAO components; the formulas are those of `hkt_mdo.dynamics`."""

import numpy as np
import openmdao.api as om

from hkt_mdo.dynamics.limits import STEP, Limit
from hkt_mdo.dynamics.rotor_ode import FIXED
from hkt_mdo.dynamics.trajectory import LOADS, QUANTITIES, RATES
from hkt_mdo.rotor.loads import COEFFICIENT_UNITS
from hkt_mdo.rotor.torque_curve import TorqueSpline

SCALARS = {name: FIXED[name] for name in ("rotor_radius", "density", "inertia")}
"""Unit and description of what limits and objectives may take from the design."""


class AboveComp(om.ExplicitComponent):
    """How far the tip speed ratio at the nodes of a phase is above a lowest one.

    Inputs tip_speed_ratio[num_nodes, 1], lowest_ratio; output room[num_nodes].
    """

    def initialize(self):
        self.options.declare("num_nodes", types=int)

    def setup(self):
        n = self.options["num_nodes"]
        self.add_input("tip_speed_ratio", shape=(n, 1), desc="w R / v")
        self.add_input("lowest_ratio", desc="below every w R / v of the trajectories")
        self.add_output("room", shape=(n,), desc="tip speed ratio above the lowest one")
        rows = np.arange(n)
        self.declare_partials("room", "tip_speed_ratio", rows=rows, cols=rows, val=1.0)
        self.declare_partials("room", "lowest_ratio", rows=rows, cols=0 * rows, val=-1.0)

    def compute(self, inputs, outputs):
        outputs["room"] = inputs["tip_speed_ratio"].ravel() - inputs["lowest_ratio"]


class LoadComp(om.ExplicitComponent):
    """Loads at the nodes of a phase, 0.5 rho v² c(w R / v), from the curves of a `LoadTable`.

    Inputs rotor_speed, inflow_speed[num_nodes, 1], density, rotor_radius and, for each of the
    names, <name>_table[n_nodes] over the spline's nodes; outputs by the names[num_nodes, 1].
    """

    def initialize(self):
        self.options.declare("num_nodes", types=int)
        self.options.declare("names", types=tuple, desc="names of the loads")
        self.options.declare("spline", types=TorqueSpline, recordable=False)

    def setup(self):
        n, nodes = self.options["num_nodes"], self.options["spline"].nodes
        for name in ("rotor_speed", "inflow_speed"):
            units, text = QUANTITIES[name]
            self.add_input(name, shape=(n, 1), units=units, desc=text)
        for name in ("rotor_radius", "density"):
            units, text = SCALARS[name]
            self.add_input(name, units=units, desc=text)
        rows = np.arange(n)
        for name in self.options["names"]:
            units, text = LOADS[name]
            table = f"{name}_table"
            unit = COEFFICIENT_UNITS[name]
            self.add_input(table, shape=nodes.shape, units=unit, desc=f"{name} over 0.5 rho v^2")
            self.add_output(name, shape=(n, 1), units=units, desc=text)
            for scalar in ("rotor_radius", "density", table):
                self.declare_partials(name, scalar)
            for each in ("rotor_speed", "inflow_speed"):
                self.declare_partials(name, each, rows=rows, cols=rows)

    def _ratio(self, inputs):
        speed, flow = (inputs[name][:, 0] for name in ("rotor_speed", "inflow_speed"))
        return speed * inputs["rotor_radius"] / flow, flow, 0.5 * inputs["density"] * flow**2

    def compute(self, inputs, outputs):
        ratio, _, pressure = self._ratio(inputs)
        for name in self.options["names"]:
            values, _ = self.options["spline"].values(inputs[f"{name}_table"], ratio)
            outputs[name][:, 0] = pressure * values

    def compute_partials(self, inputs, partials):
        ratio, flow, pressure = self._ratio(inputs)
        spline = self.options["spline"]
        basis = pressure[:, None] * spline.basis(ratio)
        for name in self.options["names"]:
            table = inputs[f"{name}_table"]
            values, slope = spline.values(table, ratio)
            by_ratio = pressure * slope
            partials[name, f"{name}_table"] = basis
            partials[name, "rotor_speed"] = by_ratio * inputs["rotor_radius"] / flow
            by_flow = 2.0 * pressure * values - by_ratio * ratio
            partials[name, "inflow_speed"] = by_flow / flow
            partials[name, "rotor_radius"] = (by_ratio * ratio / inputs["rotor_radius"])[:, None]
            partials[name, "density"] = (pressure * values / inputs["density"])[:, None]


class TorqueRateComp(om.ExplicitComponent):
    """Rate of the control torque at the nodes of a phase, by each segment's polynomial.

    Input control_torque, output torque_rate[num_nodes, 1]; `matrix` is
    `Scenario.differentiation`.
    """

    def initialize(self):
        self.options.declare("matrix", recordable=False, desc="rates of values at the nodes, 1/s")

    def setup(self):
        matrix = self.options["matrix"].tocoo()
        shape = matrix.shape[0], 1
        for add, known, name in (
            (self.add_input, QUANTITIES, "control_torque"),
            (self.add_output, RATES, "torque_rate"),
        ):
            units, text = known[name]
            add(name, shape=shape, units=units, desc=text)
        rows, cols = matrix.coords
        self.declare_partials("*", "*", rows=rows, cols=cols, val=matrix.data)

    def compute(self, inputs, outputs):
        outputs["torque_rate"] = self.options["matrix"] @ inputs["control_torque"]


class LimitComp(om.ExplicitComponent):
    """The value of a limit at some nodes of a phase.

    Inputs: what the limit names, its `series`[num_nodes, 1] and scalars of the
    design; torque_coefficient_table[n_nodes] and one scalar gain_0, gain_1, … where it asks for
    them; chord[num_nodes] of a limit along the span. Output value[num_nodes] in the limit's unit.
    """

    def initialize(self):
        self.options.declare("num_nodes", types=int)
        self.options.declare("limit", types=Limit, recordable=False)
        self.options.declare("table_nodes", default=0, desc="number of nodes of the torque curve")
        self.options.declare("gain_units", default=(), types=tuple)

    def setup(self):
        limit, n = self.options["limit"], self.options["num_nodes"]
        for name in limit.inputs:
            if name in limit.series:
                units, text = limit.series[name]
                self.add_input(name, shape=(n, 1), units=units, desc=text)
            elif name in SCALARS:
                units, text = SCALARS[name]
                self.add_input(name, units=units, desc=text)
            elif name == "chord":
                self.add_input(name, shape=(n,), units="m", desc=FIXED[name][1])
            elif name == "gains":
                for i, units in enumerate(self.options["gain_units"]):
                    self.add_input(f"gain_{i}", units=units, desc="feedback gain")
            else:
                size = self.options["table_nodes"]
                self.add_input(name, shape=(size,), desc="torque coefficient of the curve")
        self.add_output("value", shape=(n,), units=limit.unit, desc=type(limit).__doc__)

    def setup_partials(self):
        rows = np.arange(self.options["num_nodes"])
        for name in self.options["limit"].inputs:
            if name in self.options["limit"].series:
                self.declare_partials("value", name, rows=rows, cols=rows)
            else:
                self.declare_partials("value", "gain_*" if name == "gains" else name)

    def _quantities(self, inputs):
        """Return the limit's quantities: arrays over time, scalars, table and gains."""
        found = {}
        for name in self.options["limit"].inputs:
            if name == "gains":
                count = len(self.options["gain_units"])
                found[name] = np.array([inputs[f"gain_{i}"][0] for i in range(count)])
            elif name in self.options["limit"].series:
                found[name] = inputs[name][:, 0]
            else:
                found[name] = inputs[name][0] if name in SCALARS else inputs[name]
        return found

    def compute(self, inputs, outputs):
        outputs["value"] = self.options["limit"].value(**self._quantities(inputs))

    def compute_partials(self, inputs, partials):
        for name, by in self.options["limit"].partials(**self._quantities(inputs)).items():
            if name == "gains":
                for i, column in enumerate(by.T):
                    partials["value", f"gain_{i}"] = column[:, None]
            elif name in self.options["limit"].series:
                partials["value", name] = by
            else:
                partials["value", name] = by.reshape(self.options["num_nodes"], -1)


class IntegralComp(om.ExplicitComponent):
    """Integrals over all scenarios, by the quadrature of their transcriptions.

    The quadrature is exact for the polynomials of the transcription, so this weighted sum and a
    collocated state would be the same numbers. The sum needs no unknowns: the optimizer cannot
    trade energy against defects.

    Inputs: `scenario:quantity`[num_nodes, 1] for each quantity of the trajectory that an integrand
    names, and scalars of the design; outputs: the integral (J) of each integrand.
    """

    def initialize(self):
        self.options.declare("weights", types=dict, desc="quadrature weights (s) by scenario")
        self.options.declare(
            "integrands", types=dict, desc="`Objective` by output", recordable=False
        )

    def _places(self, integrand, scenario):
        """Return the input that holds each quantity of an integrand."""
        return {
            name: f"{scenario}:{name}" if name in QUANTITIES else name for name in integrand.inputs
        }

    def setup(self):
        declared = set()
        for output, integrand in self.options["integrands"].items():
            self.add_output(output, units="J", desc=type(integrand).__doc__)
            for scenario, weights in self.options["weights"].items():
                for name, place in self._places(integrand, scenario).items():
                    if place in declared:
                        continue
                    declared.add(place)
                    units, text = (QUANTITIES | SCALARS)[name]
                    shape = (weights.size, 1) if name in QUANTITIES else (1,)
                    self.add_input(place, shape=shape, units=units, desc=text)

    def setup_partials(self):
        for output, integrand in self.options["integrands"].items():
            for scenario in self.options["weights"]:
                self.declare_partials(output, list(self._places(integrand, scenario).values()))

    def compute(self, inputs, outputs):
        for output, integrand in self.options["integrands"].items():
            outputs[output] = sum(
                weights @ (integrand.rate(**values) * np.ones(weights.size))
                for _, weights, values in self._each(integrand, inputs)
            )

    def compute_partials(self, inputs, partials):
        for output, integrand in self.options["integrands"].items():
            for name in integrand.inputs:
                total = 0.0
                for places, weights, values in self._each(integrand, inputs):
                    moved = {**values, name: values[name] + 1j * STEP}
                    by = weights * np.imag(integrand.rate(**moved)) / STEP
                    total = total + by.sum() if name in SCALARS else by[None, :]
                    partials[output, places[name]] = total

    def _each(self, integrand, inputs):
        """Yield the inputs' names, the weights and the quantities of each scenario."""
        for scenario, weights in self.options["weights"].items():
            places = self._places(integrand, scenario)
            values = {
                name: inputs[place][:, 0] if name in QUANTITIES else inputs[place][0]
                for name, place in places.items()
            }
            yield places, weights, values
