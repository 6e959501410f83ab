"""What a case describes, as the values that the optimization and the checks work with."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.laws import Law
from hkt_mdo.dynamics.limits import Limit
from hkt_mdo.dynamics.objectives import CapturedEnergy, ElectricalEnergy, Objective
from hkt_mdo.problem.scenario import OWN, Scenario
from hkt_mdo.problem.turbine import Turbine
from hkt_mdo.quantities import LOADS, STEADY
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.model import RotorModel
from hkt_mdo.rotor.shape import Shape


@dataclass(frozen=True, eq=False)
class Physics:
    """What a case describes, as the values that the optimization and the checks work with.

    `case` is complete: its time span and segments are numbers. `shape` has the blade as given and
    its design variables; `rotors` compute inertia, torque and loads of any such blade, in the water
    and the condition of each `Scenario.turbine`; `turbine` has the contents of the section `rotor`,
    not fouled. There is usually one scenario; with a cut-out speed, one for each interval of
    operation.
    `design_limits` are those on the design or the result.
    `messages` say what was converted, repaired or left out, `warnings` what is probably a mistake.
    `law` has no torque limit where the case gives one that no blade can reach in its flow.
    `ceilings` (W) are upper bounds on the mean power of each scenario, by name, where the aggregate
    compares with them; they do not change with the blade.
    """

    case: Case
    shape: Shape
    rotors: dict[tuple, RotorModel]
    turbine: Turbine
    scenarios: tuple[Scenario, ...]
    law: Law
    design_limits: tuple[Limit, ...]
    objective: Objective
    messages: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    ceilings: dict[str, float] = field(default_factory=dict)

    @property
    def rotor(self) -> RotorModel:
        """The rotor in the case's own water and condition."""
        return self.rotors[OWN]

    def rotor_in(self, scenario: Scenario) -> RotorModel:
        """Return the rotor in the water and the condition of a scenario."""
        return self.rotors[scenario.turbine]

    def law_in(self, scenario: Scenario) -> Law:
        """Return the control law with the torque constant that the generator has in a scenario."""
        _, condition, _ = scenario.turbine
        return self.law if condition is None else self.law.applied(condition.torque_constant)

    def named(self, name: str, scenario: Scenario) -> str:
        """Return the name in the model of a quantity in a scenario; of its own rotor's, numbered.

        These are density, inertia, stress by the weight, tables and bands.
        """
        own = name in ("density", "inertia", "weight_stress") or name.endswith(("_table", "_band"))
        return numbered(name, [*self.rotors].index(scenario.turbine)) if own else name

    @cached_property
    def sampled_flow(self) -> tuple[np.ndarray, np.ndarray]:
        """Speeds (m/s) of all scenarios' flows at their samples, and weights (s), (n_times,)."""
        speed = np.concatenate([scenario.speeds for scenario in self.scenarios])
        weights = [scenario.weight * scenario.sample_weights for scenario in self.scenarios]
        return speed, np.concatenate(weights)

    @cached_property
    def all_limits(self) -> tuple[Limit, ...]:
        """The limits of the design, and those over time of all scenarios, each once."""
        over_time = (limit for scenario in self.scenarios for limit in scenario.limits)
        return *dict.fromkeys(over_time), *self.design_limits

    def asks_for(self, name: str) -> bool:
        """Tell whether the objective or a limit takes a quantity."""
        return any(name in formula.inputs for formula in (*self.all_limits, self.objective))

    @property
    def load_names(self) -> tuple[str, ...]:
        """Names of the loads that limits and objective need."""
        return tuple(filter(self.asks_for, LOADS))

    @cached_property
    def groups(self) -> dict[str, list[int]]:
        """Places of the scenarios of each scenario of the case, by name: several are intervals."""
        groups: dict[str, list[int]] = {}
        for index, scenario in enumerate(self.scenarios):
            groups.setdefault(scenario.group, []).append(index)
        return groups

    @cached_property
    def shares(self) -> dict[str, float]:
        """Share of time of each scenario, by name; intervals of one scenario are one."""
        times = ((each.group, each.weight * each.mesh.duration) for each in self.scenarios)
        return {group: time / self.case.phase.duration for group, time in times}

    @cached_property
    def rate_factors(self) -> np.ndarray:
        """Factors on the scenarios' mean rates as the aggregate takes them, (n_scenarios,).

        1, or the mean of all ceilings over that of the scenario where it compares with these.
        """
        if not self.ceilings:
            return np.ones(len(self.shares))
        ceilings = np.array([self.ceilings[name] for name in self.shares])
        return float(np.array(list(self.shares.values())) @ ceilings) / ceilings

    @property
    def losses_count(self) -> bool:
        """Whether losses of the generator, or friction of the shaft, decide where the rotor works.

        A constant efficiency does not change the optimum, and losses have no effect on an objective
        that does not contain the electrical power. The shaft's friction has, on that of the shaft.
        """
        generator, inputs = self.case.generator, self.objective.inputs
        electrical = "electrical_power" in inputs
        rubs = generator.rubs and (electrical or "generator_power" in inputs)
        return rubs or (electrical and not generator.proportional)

    @property
    def blade(self) -> Blade:
        """The blade as given."""
        return self.shape.blade

    @property
    def inflow(self) -> Inflow:
        """The flow of the first scenario."""
        return self.scenarios[0].inflow

    @property
    def density(self) -> float:
        """Density of the water, kg/m**3."""
        return self.case.fluid.density

    @property
    def has_curve(self) -> bool:
        """Whether the optimization takes torque from a curve over the tip speed ratio.

        A local Reynolds number depends on the speed of the flow too, which the curve does not have.
        """
        return self.case.hydrodynamics.torque == "curve" and not self.rotor.polar.follows_reynolds

    @property
    def designs_hub(self) -> bool:
        """Whether the inertia of all that is not a blade is designed."""
        return self.blade.hub_inertia is not None

    def sized(self, radius: float, hub_inertia: float | None = None) -> Blade:
        """Return the blade as given with another disc radius, m, and `hub_inertia`, kg*m**2.

        As far as these are designed, and within their bounds.
        """
        blade = self.blade.with_rotor_radius(float(np.clip(radius, *self.shape.radii)))
        if not self.designs_hub or hub_inertia is None:
            return blade
        hub = float(np.clip(hub_inertia, *self.case.design.hub_inertia_bounds))
        return replace(blade, hub_inertia=hub)

    def bounded(self, gains: np.ndarray) -> np.ndarray:
        """Return feedback gains within the bounds that the case gives, if any, in their units."""
        return np.clip(gains, *(self.case.design.gain_bounds or (-np.inf, np.inf)))

    def price_of(self, blade: Blade) -> float:
        """Return the price of a designed `hub_inertia`, J, which lowers the objective."""
        return self.case.design.hub_inertia_price * (blade.hub_inertia or 0.0)

    @property
    def remembers(self) -> bool:
        """Whether the wake has memory."""
        return self.case.inflow_dynamics.remembers

    @property
    def may_pulse(self) -> bool:
        """Whether the optimizer could let the rotor pulse, now faster, now slower than its wake.

        That captures more in this model, the more so the finer the mesh (docs/studies/memory.md).
        """
        return self.remembers and not self.law.is_feedback

    @property
    def start_objective(self) -> Objective:
        """The quantity that the search for a start maximizes: the objective if that is an energy.

        Otherwise the captured energy, since minimizing a cost would stop the rotor. The same holds
        for an energy minus a cost of quantities that a schedule does not have.
        """
        simple = self.objective.is_energy and STEADY >= {*self.objective.inputs}
        return self.objective if simple else CapturedEnergy()

    def objective_bound(self, captured: float) -> float | None:
        """Return an upper bound on the objective, J, from one on the captured energy."""
        if isinstance(self.objective, ElectricalEnergy):
            captured *= self.case.generator.largest_efficiency
        return self.objective.bound(captured)


def numbered(name: str, number: int) -> str:
    """Return the name in the model of something of the rotor of a number; 0: the case's own."""
    return f"{name}_{number}" if number else name
