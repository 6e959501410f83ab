"""The operation of a rotor as an OpenMDAO group: phases, loads, limits and integrals."""

import numpy as np
import openmdao.api as om

from hkt_mdo.dynamics.limits import LEAST, TYPICAL, DistanceFromStall, Limit, settled
from hkt_mdo.dynamics.objectives import INTEGRALS
from hkt_mdo.dynamics.rotor_ode import WAKE_STATES
from hkt_mdo.dynamics.wake import AT_ONCE, slow_time
from hkt_mdo.problem.components import AggregateComp, FormulaComp, LinearComp, LoadComp
from hkt_mdo.problem.equilibrium import equilibrium_group
from hkt_mdo.problem.evaluation import on_start, split
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.scenario import Scenario, add_phase, dm
from hkt_mdo.problem.setup import Setup
from hkt_mdo.quantities import RATES, meta_of
from hkt_mdo.rotor.band import Band
from hkt_mdo.rotor.model import SOLVERS
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.torque_curve import TorqueSpline

WAKE_MOVES = 0.5, 1.6  # bounds of the wake's states, over the start's smallest and largest
PULSE = 0.002
"""How much farther from its wake an open loop may be than its start, relatively."""
NEAR = 0.2  # of a typical torque: the recovery below which a node is held to its distance
FEWEST_NEAR = 20  # nodes, at least as many of which are held to their distance from stall
BINDS = 1e-4
"""Relative distance from its bound within which a limit binds at a node."""
USED = 1e-2
"""The same within which a limit that an open loop has exceeded between nodes is held between them,
too, unless it binds at all nodes of a segment, where more rows would depend on the others. Lowered
at the nodes alone, it was exceeded elsewhere in each pass (`river25_record`)."""


class OperationGroup(om.Group):
    """The operation of a rotor over time, in every scenario.

    Inputs describe the rotor and its controller: rotor_radius (m), density (kg/m**3), inertia
    (kg*m**2), torque_coefficient_table[n_nodes] (or chord and twist[n_stations] with direct BEM),
    <load>_table[n_nodes] of each load that limits or objective need, gain_0, gain_1, … in the law's
    units; and what limits and objective take of the design. Where scenarios differ in water or
    turbine, there are density_1, inertia_1 and tables of these names for them (`Physics.named`).
    Outputs: ``traj.<scenario>.timeseries``, the loads and rates that are needed,
    ``limit_<name>.value``, the `INTEGRALS` and objective.
    """

    def __init__(self, physics: Physics, setup: Setup, refs: dict[str, float], band: Band | None):
        super().__init__()
        self._physics, self._start, self._refs, self._band = physics, setup, refs, band

    def setup(self):
        self._add_phases()
        self._add_loads()
        self._add_rates()
        for name, integrand in INTEGRALS.items():
            weights = {x.name: [x.weight * x.node_weights] for x in self._physics.scenarios}
            self._add_integral(f"integral_{name}", integrand, weights, name, meta_of(name))
        self._hold_limits()
        for scenario in self._physics.scenarios:
            if not (self._physics.case.ends_free or scenario.steady):
                self._close_cycle(scenario)
        self._add_objective()

    def _hold_limits(self):
        """Hold the limits, scenario by scenario, then those of the design.

        Under feedback with a torque curve also the distance from stall.
        """
        physics, setup = self._physics, self._start
        for number, scenario in enumerate(physics.scenarios):
            limits = [*scenario.limits]
            if physics.law.is_feedback and physics.has_curve:
                law, spline = physics.law_in(scenario), TorqueSpline(setup.nodes)
                limits += [DistanceFromStall(law=law, spline=spline, slowed=setup.slowed)]
            for limit in limits:
                if limit.constrains(physics.law):
                    self._hold(limit, number)
        quantities = on_start(physics, setup.start)[0]
        for limit in physics.design_limits:
            if limit.constrains(physics.law):
                name = constraint_of(physics, limit)
                bounds = {"lower": limit.lower, "upper": limit.upper}
                self.add_constraint(name, **bounds, ref=limit.bounds_size or 1.0, units=limit.unit)
                self._add_formula(name, limit, np.arange(np.size(limit.value_of(quantities))))

    def _hold(self, limit, number):
        """Hold a limit over time in the number-th scenario."""
        physics, setup = self._physics, self._start
        scenario, ref = physics.scenarios[number], None
        # one where two segments meet: a limit that is held there twice has no definite multipliers;
        # the rate of the torque alone may differ from one segment to the other
        every = np.arange(scenario.node_times.size)
        nodes = every if limit.is_of(RATES) else scenario.distinct_nodes
        nodes = nodes[np.repeat(setup.holds(limit, scenario), scenario.nodes_per_segment)[nodes]]
        if not nodes.size:
            return
        if isinstance(limit, DistanceFromStall):
            nodes, ref = self._near_stall(limit, number), self._refs["control_torque"]
        elif limit.is_of(["control_torque"]) and limit.unit == "N*m":
            ref = self._refs["control_torque"]
        options = {"ref": ref or limit.bounds_size or 1.0, "units": limit.unit}
        bounds = narrowed(limit, setup.share_at(limit, scenario, nodes))
        name = constraint_of(physics, limit, number)
        if is_quantity(limit):
            self.add_constraint(name, indices=nodes, flat_indices=True, **bounds, **options)
            largest, smallest = setup.excess_of(limit, scenario).T
            segments = (largest > -USED) & (smallest < -BINDS)
            if (limit.name, scenario.name) in setup.shares and np.any(segments):
                self._hold_between(limit, scenario, segments, options)
            return
        self.add_constraint(name, **bounds, **options)
        self._add_formula(name, limit, nodes, scenario)

    def _hold_between(self, limit, scenario, segments, options):
        """Hold a limit on a quantity midway between the nodes of some segments."""
        quantity, n = limit.inputs[0], scenario.nodes_per_segment - 1
        matrix = scenario.between[np.repeat(segments, n)]
        bounds = narrowed(limit, np.repeat(self._start.share(limit, scenario)[segments], n))
        name, meta = between_of(scenario, limit), {"units": limit.unit}
        self._add_linear(name, scenario, quantity, matrix, "value", meta)
        self.add_constraint(f"{name}.value", **bounds, **options)

    def _near_stall(self, limit, number):
        """Return the nodes of the number-th scenario where the start has settled and is near stall.

        Those that are nearest are at least `FEWEST_NEAR`.

        In a gust that is faster than the rotor, the integration shows whether it recovers: held to
        its distance there, a heavy rotor lost 0.7 % with `rated` (turbine 3 of seed 77 of `make
        verify PART=turbines`).
        """
        physics, start = self._physics, self._start.start
        scenario = physics.scenarios[number]
        table = physics.rotor_in(scenario).coefficients(start.blade, limit.spline.nodes)
        inputs = on_start(physics, start)[number] | {"torque_coefficient_table": table.torque}
        inputs |= zip(limit.named_numbers, start.gains, strict=True)
        unit = torque_scale(inputs["density"], inputs["rotor_radius"], inputs["inflow_speed"])
        margin = limit.value_of(inputs) / (TYPICAL * unit) + LEAST
        margin, still = (
            np.interp(scenario.node_times, scenario.samples, values)
            for values in (margin, settled(inputs))
        )
        places = np.flatnonzero(still == 1.0)  # the first node is one
        nearest = np.sort(margin[places])[: FEWEST_NEAR + 1]
        return places[margin[places] <= max(NEAR, nearest[-1])]

    def _add_phases(self):
        """Add one phase a scenario, at its start, and promote what feeds them."""
        physics, setup = self._physics, self._start
        trajectory, inputs, designed = dm.Trajectory(), [], setup.bounds(physics)
        operation = split(physics, setup.start.operation)
        for scenario, (speed, torque, *states) in zip(physics.scenarios, operation, strict=True):
            bounds = dict(designed)
            hydrodynamics, parameters = self._hydrodynamics(scenario)
            generator = physics.case.generator
            options = {"hydrodynamics": hydrodynamics, "generator": generator}
            torque = torque - generator.friction(speed)
            begin = {"time": scenario.samples, "rotor_speed": speed, "control_torque": torque}
            begin |= zip(physics.law.states, states, strict=True)
            arguments = scenario, physics.law_in(scenario), options, self._refs, bounds, begin
            promoted = [(name, physics.named(name, scenario)) for name in parameters]
            if scenario.steady:
                group = equilibrium_group(*arguments)
                self.add_subsystem(f"steady_{scenario.name}", group, promotes_inputs=promoted)
                continue
            if self._band:
                begin |= self._wake_at_start(scenario, speed)
                ends = {name: (np.min(begin[name]), np.max(begin[name])) for name in WAKE_STATES}
                bounds |= {name: np.multiply(WAKE_MOVES, x) for name, x in ends.items()}
            if physics.may_pulse:
                self._hold_wake(scenario, begin["wake_factor"])
            add_phase(trajectory, parameters, *arguments)
            inputs += [(f"{scenario.name}.parameters:{name}", source) for name, source in promoted]
        if inputs:
            self.add_subsystem("traj", trajectory)
            self.promotes("traj", inputs=inputs)

    def _hydrodynamics(self, scenario):
        """Return the hydrodynamics of `RotorODE`, and names of the ODE's inputs.

        In a steady scenario a wake with memory is in equilibrium.
        """
        physics, setup = self._physics, self._start
        names = ["density", "inertia", "rotor_radius"]
        if self._band and not scenario.steady:
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
        return options, [*names, *physics.law.named_gains]

    def _add_loads(self):
        """Add the loads that limits or objective need, at the nodes of every phase."""
        physics, curves = self._physics, self._band or TorqueSpline(self._start.nodes)
        names = physics.load_names
        for scenario in physics.scenarios if names else ():
            name = f"loads_{scenario.name}"
            component = LoadComp(scenario.node_times.size, names, curves)
            fed = "density", *component.tables.values()
            inputs = [(quantity, physics.named(quantity, scenario)) for quantity in fed]
            self.add_subsystem(name, component, promotes_inputs=inputs)
            for quantity in (*component.ratios, "inflow_speed"):
                self.connect(scenario.source(quantity), f"{name}.{quantity}")

    def _wake_at_start(self, scenario, speed):
        """Return the wake at the samples of a scenario: it follows a start by its two filters.

        The start's rotor speed is in rad/s, (n_times,). By name, (n_times,): reduced_velocity,
        induced_velocity (m/s), and wake_factor, the tip speed ratio over that of the wake.
        """
        physics, blade, band = self._physics, self._start.start.blade, self._band
        time, flow = scenario.samples, scenario.speeds
        ratio = speed * blade.rotor_radius / flow
        tables = band.solve(physics.rotor_in(scenario), blade, ["torque_coefficient"])
        table, at_place = (tables[f"{name}_induction_table"].values for name in ("wake", "place"))
        steady = flow * band.spline.curve(table)(ratio)
        tau1 = physics.case.inflow_dynamics.tau1
        induction = band.spline.curve(at_place)(ratio)
        slow = np.broadcast_to(slow_time(tau1, induction, blade.rotor_radius, flow), time.shape)
        reduced = _followed(time, (1.0 - AT_ONCE) * steady, slow)
        induced = _followed(time, reduced + AT_ONCE * steady, band.share * slow)
        wake_ratio, _ = band.wake_ratio(table, induced / flow)
        return {
            "reduced_velocity": reduced,
            "induced_velocity": induced,
            "wake_factor": ratio / wake_ratio,
        }

    def _hold_wake(self, scenario, factor):
        """Hold the wake factor of an open loop to that of its start at the samples, (n_times,).

        A rotor that pulses, alternately faster and slower than its wake, would capture more than
        the best steady rotor, by a model that was not made for this.
        """
        nodes = scenario.distinct_nodes
        factor = np.interp(scenario.node_times[nodes], scenario.samples, factor)
        bounds = {"lower": factor - PULSE, "upper": factor + PULSE, "ref": PULSE}
        name = scenario.source("wake_factor")
        self.add_constraint(name, indices=nodes, flat_indices=True, **bounds)

    def _add_rates(self):
        """Add the rate of the generator torque, if it is asked for, at the nodes of every phase."""
        asked, rate = any(map(self._physics.asks_for, RATES)), "torque_rate"
        for scenario in self._physics.scenarios if asked else ():
            name, matrix = f"rates_{scenario.name}", scenario.differentiation
            self._add_linear(name, scenario, "control_torque", matrix, rate, meta_of(rate))

    def _close_cycle(self, scenario):
        """Hold a scenario's final rotor speed to the initial one."""
        name, ends = f"{scenario.name}_gain_of_speed", np.zeros((1, scenario.node_times.size))
        ends[0, [0, -1]] = -1.0, 1.0
        self._add_linear(name, scenario, "rotor_speed", ends, "change", {"units": "rad/s"})
        self.add_constraint(f"{name}.change", equals=0.0, ref=self._refs["rotor_speed"])

    def _add_linear(self, name, scenario, quantity, matrix, result, meta):
        """Add a matrix times a quantity at the nodes of a scenario; `meta` is of the result."""
        units = meta_of(quantity)["units"]
        self.add_subsystem(name, LinearComp({quantity: matrix}, units, result, meta))
        self.connect(scenario.source(quantity), f"{name}.{quantity}")

    def _add_formula(self, name, formula, nodes, scenario=None):
        """Add a formula of the design, or at some nodes of a scenario, and connect its inputs.

        `name` may have the ending of its output.
        """
        name = name.removesuffix(".value")
        inputs = [quantity for quantity in formula.inputs if quantity not in formula.series]
        if scenario:
            inputs = [(quantity, self._physics.named(quantity, scenario)) for quantity in inputs]
        self.add_subsystem(name, FormulaComp(formula, nodes.size), promotes_inputs=inputs)
        for quantity in formula.series:
            at = {"src_indices": nodes, "flat_src_indices": True}
            self.connect(scenario.source(quantity), f"{name}.{quantity}", **at)

    def _add_integral(self, name, integrand, weights, result, meta):
        """Add sums over all scenarios of an objective's rate times weights, (n_rows, n_nodes)."""
        component = LinearComp(weights, integrand.function_unit, result, meta)
        self.add_subsystem(name, component, promotes_outputs=[result])
        for scenario in self._physics.scenarios:
            if integrand in INTEGRALS.values():  # the rate is a quantity over time as it is
                rate = scenario.source(integrand.inputs[0])
            else:
                rate = f"rate_{scenario.name}.value"
                self._add_formula(rate, integrand, np.arange(scenario.node_times.size), scenario)
            self.connect(rate, f"{name}.{scenario.name}")

    def _add_objective(self):
        """Add the objective: an aggregate of scenarios' mean rates, or a value of the design."""
        physics = self._physics
        if not physics.objective.is_rate:
            self._add_formula("objective_value", physics.objective, np.arange(1))
            return self.promotes("objective_value", outputs=[("value", "objective")])
        factors = dict(zip(physics.shares, np.diag(physics.rate_factors), strict=True))
        weights = {
            each.name: np.outer(factors[each.group], each.node_weights / each.mesh.duration)
            for each in physics.scenarios
        }
        units = {"units": physics.objective.function_unit}
        self._add_integral("mean_rates", physics.objective, weights, "mean_rate", units)
        component = AggregateComp(
            aggregate=physics.case.robustness,
            shares=np.array(list(physics.shares.values())),
            duration=physics.case.phase.duration,
            objective=physics.objective,
            price=physics.case.design.hub_inertia_price,
        )
        self.add_subsystem("aggregate", component, promotes=["*"])
        return None


def narrowed(limit: Limit, share: np.ndarray) -> dict[str, np.ndarray]:
    """Return the bounds of a limit with shares of its upper one; a lower one rises as much."""
    less = (1.0 - share) * (abs(limit.upper) if np.isfinite(limit.upper) else 0.0)
    return {"lower": limit.lower + less, "upper": limit.upper - less}


def is_quantity(limit: Limit) -> bool:
    """Tell whether a limit is one quantity over time as it is, which needs no component.

    One would add a quarter to the time for the derivatives of an open loop with three such limits.
    A limit of a user's own has one, for OpenMDAO takes one constraint of a quantity.
    """
    built_in = type(limit).__module__ == Limit.__module__
    plain = type(limit).value is Limit.value and len(limit.inputs) == 1 and limit.place == "time"
    return built_in and plain


def constraint_of(physics: Physics, limit: Limit, number: int = 0) -> str:
    """Return the name of the constraint that holds a limit of the design or the n-th scenario."""
    scenario = physics.scenarios[number]
    if is_quantity(limit):
        return scenario.source(limit.inputs[0])
    return f"limit_{limit.name}{f'_{scenario.name}' * (number > 0)}.value"


def between_of(scenario: Scenario, limit: Limit) -> str:
    """Return the name of the component that holds a limit in a scenario between the nodes."""
    return f"between_{limit.name}_{scenario.name}"


def _followed(time, goal, constant):
    """Return z of constant z' = goal - z, with a goal that is linear between the times.

    It begins in equilibrium.
    """
    step = np.diff(time) / (0.5 * (constant[1:] + constant[:-1]))
    decay, rate = np.exp(-step), np.diff(goal) / step
    response = np.array(goal)
    for i in range(step.size):
        off = response[i] - goal[i] + rate[i]
        response[i + 1] = goal[i + 1] - rate[i] + off * decay[i]
    return response
