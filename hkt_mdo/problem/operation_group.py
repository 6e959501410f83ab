"""The operation of a rotor as an OpenMDAO group: phases, loads, limits and integrals."""

from __future__ import annotations

import numpy as np
import openmdao.api as om

from hkt_mdo.dynamics.limits import DistanceFromStall
from hkt_mdo.dynamics.objectives import INTEGRALS
from hkt_mdo.problem.components import (
    AggregateComp,
    FormulaComp,
    IntegralComp,
    LoadComp,
    TorqueRateComp,
)
from hkt_mdo.problem.constraints import (
    constraint_of,
    is_quantity,
    limited_nodes,
    near_stall,
    source_of,
)
from hkt_mdo.problem.equilibrium import equilibrium_group
from hkt_mdo.problem.evaluation import epigraph, on_start, split
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.scenario import Scales, add_phase, dm
from hkt_mdo.problem.setup import Setup
from hkt_mdo.problem.wake import along_start
from hkt_mdo.quantities import OVER_TIME, QUANTITIES, RATES
from hkt_mdo.rotor.band import Band
from hkt_mdo.rotor.model import SOLVERS
from hkt_mdo.rotor.torque_curve import TorqueSpline

PULSE = 0.002
"""How much farther from its wake an open loop may be than its start, relatively."""


def named(name: str, variant: str) -> str:
    """Return the name in the model of a quantity of scenarios' own; see `Physics.variant`."""
    own = name in ("density", "inertia", "weight_stress") or name.endswith(("_table", "_band"))
    return f"{name}{variant}" if own else name


class OperationGroup(om.Group):
    """The operation of a rotor over time, in every scenario.

    Inputs describe the rotor and its controller: rotor_radius (m), density (kg/m**3), inertia
    (kg*m**2), torque_coefficient_table[n_nodes] (or chord and twist[n_stations] with direct BEM),
    <load>_table[n_nodes] of each load that limits or objective need, gain_0, gain_1, … in the law's
    units; and what limits and objective take of the design. Where scenarios differ in water or
    turbine, there are density_1, inertia_1 and tables of these names for them (`Physics.variant`).
    Outputs: ``traj.<scenario>.timeseries``, the loads and rates that are needed,
    ``limit_<name>.value``, the `INTEGRALS` and objective.
    """

    def __init__(self, physics: Physics, setup: Setup, scales: Scales, band: Band | None):
        super().__init__()
        self._physics, self._start, self._scales, self._band = physics, setup, scales, band

    def setup(self):
        self._add_phases()
        self._add_loads()
        self._add_rates()
        weights = {x.name: x.weight * x.node_weights for x in self._physics.scenarios}
        self._add_integrals("integrals", INTEGRALS, weights)
        self._hold_limits()
        for scenario in self._physics.scenarios:
            if scenario.closed:
                self._close_cycle(scenario)
        self._add_objective()

    def _hold_limits(self):
        """Hold the limits, scenario by scenario, then those of the design.

        Under feedback with a torque curve also the distance from stall.
        """
        physics, setup = self._physics, self._start
        for number, scenario in enumerate(physics.scenarios):
            limits = [*physics.limits_in(scenario)]
            if physics.law.is_feedback and physics.has_curve:
                spline = TorqueSpline(setup.nodes)
                limits.append(DistanceFromStall(law=physics.law_in(scenario), spline=spline))
            for limit in limits:
                if limit.constrains(physics.law):
                    self._hold(limit, number)
        known = on_start(physics, setup.start)[0]
        for limit in physics.design_limits:
            if limit.constrains(physics.law):
                name = constraint_of(physics, limit)
                bounds = {"lower": limit.lower, "upper": limit.upper}
                self.add_constraint(name, **bounds, ref=limit.bounds_size or 1.0, units=limit.unit)
                self._add_formula(name, limit, np.size(limit.value_of(known)))

    def _hold(self, limit, number):
        """Hold a limit over time in the number-th scenario."""
        physics, setup = self._physics, self._start
        scenario, ref, less = physics.scenarios[number], None, 0.0
        nodes = limited_nodes(limit, scenario)
        if isinstance(limit, DistanceFromStall):
            nodes, ref = near_stall(physics, setup.start, limit, number), self._scales.torque
        elif limit.is_of(["control_torque"]) and limit.unit == "N*m":
            ref = self._scales.torque
        if np.isfinite(limit.upper):
            less = (1.0 - setup.share_at(limit, scenario, nodes)) * abs(limit.upper)
        bounds = {"lower": limit.lower + less, "upper": limit.upper - less}
        options = {"ref": ref or limit.bounds_size or 1.0, "units": limit.unit} | bounds
        name = constraint_of(physics, limit, number)
        if is_quantity(limit):
            self.add_constraint(name, indices=nodes, flat_indices=True, **options)
            return
        self.add_constraint(name, **options)
        self._add_formula(name, limit, nodes.size, variant=physics.variant(scenario))
        for each in limit.series:
            target = f"{name.removesuffix('.value')}.{each}"
            source = source_of(scenario, each)
            self.connect(source, target, src_indices=nodes, flat_src_indices=True)

    def _add_phases(self):
        """Add one phase a scenario, at its start, and promote what feeds them."""
        physics, setup = self._physics, self._start
        bounds = setup.bounds(physics)["rotor_speed"]
        trajectory, inputs = dm.Trajectory(), []
        operation = split(physics, setup.start.operation)
        for each, (speed, torque, *states) in zip(physics.scenarios, operation, strict=True):
            variant = physics.variant(each)
            hydrodynamics, parameters = self._hydrodynamics(each)
            generator = physics.case.generator
            options = {"hydrodynamics": hydrodynamics, "generator": generator}
            torque = torque - generator.friction(speed)
            begin = {"time": each.samples, "rotor_speed": speed, "control_torque": torque}
            begin |= zip(physics.law.states, states, strict=True)
            about = each, physics.law_in(each), options, self._scales, bounds, begin
            promoted = [(name, named(name, variant)) for name in parameters]
            if each.steady:
                group = equilibrium_group(*about)
                self.add_subsystem(f"steady_{each.name}", group, promotes_inputs=promoted)
                continue
            if physics.remembers:
                begin |= along_start(physics, setup.start.blade, self._band, each, speed)
            if physics.may_pulse:
                self._hold_wake(each, begin["wake_factor"])
            add_phase(trajectory, parameters, *about)
            inputs += [(f"{each.name}.parameters:{name}", own) for name, own in promoted]
        if inputs:
            self.add_subsystem("traj", trajectory)
            self.promotes("traj", inputs=inputs)

    def _hydrodynamics(self, scenario):
        """Return the hydrodynamics of `RotorODE` and the ODE's inputs, with units.

        In a steady scenario a wake with memory is in equilibrium.
        """
        physics, setup = self._physics, self._start
        names = ["density", "inertia", "rotor_radius"]
        remembers = physics.remembers and not scenario.steady
        if remembers:
            names += ["wake_induction_table", "place_induction_table", "torque_coefficient_band"]
            options = {"band": self._band, "tau1": physics.case.inflow_dynamics.tau1}
        elif physics.has_curve:
            names.append("torque_coefficient_table")
            options = {"spline": TorqueSpline(setup.nodes)}
        else:
            solver = SOLVERS[physics.case.hydrodynamics.bem]
            polar = physics.rotor_in(scenario).polar
            options = {"blade": setup.start.blade, "polar": polar, "coefficients": solver}
            names += ["chord", "twist"]
        units = {name: QUANTITIES[name].unit if name in QUANTITIES else None for name in names}
        return options, units | {name: x for name, (x, _) in physics.law.named_gains.items()}

    def _add_loads(self):
        """Add the loads that limits or objective need, at the nodes of every phase."""
        physics, setup = self._physics, self._start
        names, nodes = physics.load_names, np.asarray(setup.nodes, dtype=float)
        kind = "band" if physics.remembers else "table"
        fed = ["density", *(f"{name}_{kind}" for name in names)]
        for scenario in physics.scenarios if names else ():
            name, n = f"loads_{scenario.name}", scenario.node_times.size
            model = self._band if physics.remembers else TorqueSpline(nodes)
            component = LoadComp(n, names, model)
            variant = physics.variant(scenario)
            inputs = [(each, named(each, variant)) for each in fed]
            self.add_subsystem(name, component, promotes_inputs=inputs)
            for quantity in ("tip_speed_ratio", "inflow_speed"):
                self.connect(f"{scenario.path}.{quantity}", f"{name}.{quantity}")
            if physics.remembers:  # a wake in equilibrium is that of the rotor's own ratio
                quantity = "tip_speed_ratio" if scenario.steady else "wake_ratio"
                self.connect(f"{scenario.path}.{quantity}", f"{name}.wake_ratio")

    def _hold_wake(self, scenario, factor):
        """Hold the wake factor of an open loop to that of its start at the samples, (n_times,).

        A rotor that pulses, alternately faster and slower than its wake, would capture more than
        the best steady rotor, by a model that was not made for this.
        """
        nodes = scenario.distinct_nodes
        factor = np.interp(scenario.node_times[nodes], scenario.samples, factor)
        about = {"lower": factor - PULSE, "upper": factor + PULSE, "ref": PULSE}
        name = f"{scenario.path}.wake_factor"
        self.add_constraint(name, indices=nodes, flat_indices=True, **about)

    def _add_rates(self):
        """Add the rate of the generator torque, if it is asked for, at the nodes of every phase."""
        asked = any(map(self._physics.asks_for, RATES))
        for scenario in self._physics.scenarios if asked else ():
            name = f"rates_{scenario.name}"
            self.add_subsystem(name, TorqueRateComp(matrix=scenario.differentiation))
            self.connect(f"{scenario.path}.control_torque", f"{name}.control_torque")

    def _close_cycle(self, scenario):
        """Add the difference of a scenario's final and initial rotor speed, which must be zero."""
        name = f"{scenario.name}_gain_of_speed"
        change = om.ExecComp("change = final - initial", units="rad/s", has_diag_partials=True)
        self.add_subsystem(name, change)
        for end, index in (("initial", 0), ("final", -1)):
            source = f"{scenario.path}.rotor_speed"
            self.connect(source, f"{name}.{end}", src_indices=om.slicer[[index], 0])
        about = {"equals": 0.0, "ref": self._scales.rotor_speed, "units": "rad/s"}
        self.add_constraint(f"{name}.change", **about)

    def _add_formula(self, name, formula, size, outputs=(), variant=""):
        """Add a formula and connect its inputs but those over time; `variant` of the turbine.

        `name` may have the ending of its output.
        """
        name = name.removesuffix(".value")
        component = FormulaComp(formula, size)
        fixed = (each for each in formula.inputs if each not in formula.series)
        inputs = [(each, named(each, variant)) for each in fixed]
        self.add_subsystem(name, component, promotes_inputs=inputs, promotes_outputs=list(outputs))

    def _add_integrals(self, name, integrands, weights, **about):
        """Add the integrals of some rates over all scenarios."""
        component = IntegralComp(weights, integrands, **about)
        needed = {each for integrand in integrands.values() for each in integrand.inputs}
        fixed = sorted(each for each in needed if each not in OVER_TIME)
        self.add_subsystem(name, component, promotes_inputs=fixed, promotes_outputs=["*"])
        for scenario in self._physics.scenarios:
            for quantity in sorted(needed & {*OVER_TIME}):
                target = f"{name}.{scenario.name}:{quantity}"
                self.connect(source_of(scenario, quantity), target)

    def _add_objective(self):
        """Add the objective: an aggregate of scenarios' mean rates, or a value of the design."""
        physics, name = self._physics, "objective"
        if price := physics.case.design.hub_inertia_price:
            name = "objective_without_price"
            units = {"units": physics.objective.unit}
            priced = om.ExecComp(
                f"objective = {name} - {price!r} * hub_inertia",
                **{"objective": units, name: units, "hub_inertia": {"units": "kg*m**2"}},
            )
            self.add_subsystem("price", priced, promotes=["*"])
        if not physics.objective.is_rate:
            return self._add_formula("objective_value", physics.objective, 1, [("value", name)])
        groups, scenarios = list(physics.shares), physics.scenarios
        rows = {each.name: groups.index(each.group) for each in scenarios}
        factors = dict(zip(groups, physics.rate_factors, strict=True))
        weights = {
            each.name: each.node_weights * factors[each.group] / each.mesh.duration
            for each in scenarios
        }
        rate = {"mean_rate": physics.objective}
        self._add_integrals("mean_rates", rate, weights, rows=rows)
        component = AggregateComp(
            aggregate=physics.case.robustness,
            shares=np.array(list(physics.shares.values())),
            duration=physics.case.phase.duration,
            objective=physics.objective,
            n_unknowns=epigraph(physics, self._start.start)[0].size,
        )
        about = {"promotes_inputs": ["*"], "promotes_outputs": ["*", ("objective", name)]}
        self.add_subsystem("aggregate", component, **about)
        return None
