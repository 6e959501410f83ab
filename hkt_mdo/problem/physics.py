"""The physics of a case: its turbine, flow, control law, limits and objective as values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from scipy.interpolate import CubicSpline

from hkt_mdo.case import Case
from hkt_mdo.dynamics.aggregates import Aggregate
from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.generator import LOSSLESS, Generator
from hkt_mdo.dynamics.laws import FeedbackLaw, Law
from hkt_mdo.dynamics.limits import (
    CavitationLimit,
    DesignBounds,
    ForwardRotation,
    Limit,
    PowerLimit,
    RotorSpeedLimit,
    TorqueLimit,
)
from hkt_mdo.dynamics.objectives import (
    CapturedEnergy,
    ElectricalEnergy,
    GeneratorEnergy,
    Objective,
)
from hkt_mdo.dynamics.simulation import SLOWEST_RATIO
from hkt_mdo.dynamics.trajectory import trajectory_of
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import shipped_rotor
from hkt_mdo.problem.contradictions import redundant_limits, refuse_contradictions
from hkt_mdo.problem.equilibrium import SteadyScenario
from hkt_mdo.problem.operation import in_operation
from hkt_mdo.problem.plausible import doubts
from hkt_mdo.problem.scenario import MOST_SEGMENTS, Scenario
from hkt_mdo.problem.turbine import Turbine, build_turbine
from hkt_mdo.quantities import LOADS, RATES, STEADY, names
from hkt_mdo.rotor.band import Band
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.hydrodynamics import SOLVERS, Hydrodynamics
from hkt_mdo.rotor.loads import Cavitation, LoadModel
from hkt_mdo.rotor.model import RotorModel
from hkt_mdo.rotor.planform import planform_area
from hkt_mdo.rotor.scales import power_scale, torque_scale
from hkt_mdo.rotor.shape import Shape
from hkt_mdo.rotor.steady_optimum import SteadyOptimum
from hkt_mdo.rotor.suction import require_suction

BEM = SOLVERS
DURATION = 60.0  # s, of a flow that has no end of its own
SEGMENTS_PER_PERIOD = 8.0  # segments in a period of the highest lasting frequency
FEWEST_SEGMENTS = 60
MOST_PERIODS = 1_000_000  # most periods of the flow's highest frequency that can be sampled
MOST_TORQUE = 1.0  # torque coefficient that no rotor has; good ones have 0.06
RATIOS = 1001  # tip speed ratios at which loads are computed at most
PAPER_BLADE, PAPER_CHORD_BOUNDS = "bahaj2007", (0.01, 1.0)  # m
CHORD_FACTORS = 0.2, 3.0  # on the smallest and the largest chord: the default bounds
STATIONS = 120  # from which the loads of a blade change by less than a thousandth
START_EXCESS = 1e-3  # relative excess of a limit up to which a start counts as keeping it


@dataclass(frozen=True, eq=False)
class Physics:
    """What a case describes, as the values that the optimization and the checks work with.

    `case` is complete: its time span and segments are numbers. `shape` has the blade as given and
    its design variables; `rotor` computes inertia, torque and loads of any such blade; `turbine`
    has the contents of the section `rotor`. There is usually one scenario; with a cut-out speed,
    one for each interval of
    operation.
    `messages` say what was converted, repaired or left out, `warnings` what is probably a mistake.
    `law` has no torque limit where the case gives one that no blade can reach in its flow.
    `ceilings` (W) are upper bounds on the mean power of each scenario, by name, where the aggregate
    compares with them; they do not change with the blade.
    """

    case: Case
    shape: Shape
    rotor: RotorModel
    turbine: Turbine
    scenarios: tuple[Scenario, ...]
    law: Law
    limits: tuple[Limit, ...]
    objective: Objective
    messages: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    ceilings: dict[str, float] = field(default_factory=dict)

    @property
    def polar(self) -> Any:
        """The polars of the rotor's sections; see `Hydrodynamics.polar`."""
        return self.rotor.polar

    @property
    def section_area(self) -> float | np.ndarray | CubicSpline:
        """Area of the sections over chord squared; see `RotorModel.section_area`."""
        return self.rotor.section_area

    @property
    def loads(self) -> LoadModel:
        """The model of the loads of a blade."""
        return self.rotor.loads

    def built(self, blade: Blade) -> Any:
        """Return the polars of a blade, as `polar`, at its thickness where that is designed."""
        return self.rotor.as_built(blade).polar

    def of(self, scenario: Scenario) -> Physics:
        """Return the physics of a scenario, with its own water and condition of the turbine."""
        if scenario.turbine == (None, None):
            return self
        if scenario.turbine not in self._others:
            case = self.case.of_turbine(*scenario.turbine)
            turbine, law = self.turbine, self.law
            if case.condition.fouls or self.case.condition.fouls:
                clean = build_turbine(case.rotor, case.fluid, 1.0, case.design)
                turbine = _in_condition(turbine._replace(polar=clean.polar), case)
            if isinstance(law, FeedbackLaw):
                law = law.applied(case.condition.torque_constant)
            rotor = _rotor_model(case, turbine, self.shape)
            own = replace(self, case=case, rotor=rotor, turbine=turbine, law=law)
            self._others[scenario.turbine] = own
        return self._others[scenario.turbine]

    @cached_property
    def _others(self) -> dict[tuple, Physics]:
        return {}

    @cached_property
    def variants(self) -> dict[tuple, str]:
        """Endings of the names of quantities in the model, by `Scenario.turbine`."""
        others = dict.fromkeys(each.turbine for each in self.scenarios)
        others.pop((None, None), None)
        return {(None, None): ""} | {each: f"_{i}" for i, each in enumerate(others, start=1)}

    def limits_in(self, scenario: Scenario) -> tuple[Limit, ...]:
        """Return the limits over time that hold in a scenario."""
        if scenario.limits is not None:
            return scenario.limits
        return tuple(limit for limit in self.limits if limit.place == "time")

    @property
    def design_limits(self) -> tuple[Limit, ...]:
        """The limits on the design or the result."""
        return tuple(limit for limit in self.limits if limit.place != "time")

    @cached_property
    def all_limits(self) -> tuple[Limit, ...]:
        """The limits of the design, and those over time of all scenarios, each once."""
        over_time = (limit for each in self.scenarios for limit in self.limits_in(each))
        return *dict.fromkeys(over_time), *self.design_limits

    def asks_for(self, name: str) -> bool:
        """Tell whether the objective or a limit takes a quantity."""
        return any(name in each.inputs for each in (*self.all_limits, self.objective))

    @property
    def load_names(self) -> tuple[str, ...]:
        """Names of the loads that limits and objective need."""
        return tuple(filter(self.asks_for, LOADS))

    @property
    def aggregate(self) -> Aggregate:
        """How the scenarios are combined to one objective."""
        return self.case.robustness

    @cached_property
    def best(self) -> SteadyOptimum:
        """The steady optimum of the case's blades at their own radius."""
        return self.rotor.best_of_shape(self.shape, self.blade)

    @property
    def duration(self) -> float:
        """Time to which the objective refers, s: that of the case."""
        return self.case.phase.duration

    @cached_property
    def shares(self) -> dict[str, float]:
        """Share of time of each scenario, by name; intervals of one scenario are one."""
        times = ((each.group, each.weight * each.mesh.duration) for each in self.scenarios)
        return {group: time / self.duration for group, time in times}

    def united(self, integrals: Iterable[float]) -> float:
        """Return the objective that follows from its integrals over the scenarios, one for each.

        Those of `scenarios`, in their order, over the time of each.
        """
        shares = np.array(list(self.shares.values()))
        return self.duration * self.aggregate.of(self._means(integrals), shares)

    def _means(self, integrals: Iterable[float]) -> np.ndarray:
        """Return the rates that the aggregate takes, of integrals over the scenarios."""
        means = dict.fromkeys(self.shares, 0.0)
        for scenario, integral in zip(self.scenarios, integrals, strict=True):
            means[scenario.group] += float(integral) / scenario.mesh.duration
        return self.rate_factors * np.array(list(means.values()))

    @cached_property
    def rate_factors(self) -> np.ndarray:
        """Factors on the scenarios' mean rates as the aggregate takes them, (n_scenarios,).

        1, or the mean of all ceilings over that of the scenario where it compares with these.
        """
        if not self.ceilings:
            return np.ones(len(self.shares))
        own = np.array([self.ceilings[name] for name in self.shares])
        return float(np.array(list(self.shares.values())) @ own) / own

    def mean_rates(self, starts: list[dict]) -> np.ndarray:
        """Return the mean rate of the objective in each scenario, as the aggregate takes it.

        Parameters
        ----------
        starts : list of dict
            What `on_start` returns: quantities over the samples.

        Returns
        -------
        array
            (n_scenarios,), in the objective's unit a second.
        """
        pairs = zip(self.scenarios, starts, strict=True)
        return self._means(each.sample_weights @ self.objective.rate_of(x) for each, x in pairs)

    def epigraph(self, point) -> tuple[np.ndarray, int]:
        """Return the aggregate's unknowns at a starting point, and the number of its rows."""
        rates, shares = self.mean_rates(self.on_start(point)), np.array(list(self.shares.values()))
        unknowns = self.aggregate.best_unknowns(rates, shares)
        return unknowns, np.size(self.aggregate.rows(rates, shares, unknowns))

    @cached_property
    def resolved(self) -> Physics:
        """The same turbine with `STATIONS` stations, whatever the case gives."""
        case = self.case
        turbine = build_turbine(case.rotor, case.fluid, 1.0, case.design, STATIONS)
        turbine = _in_condition(turbine, case)
        shape = replace(self.shape, blade=turbine.blade)
        rotor = _rotor_model(case, turbine, shape)
        return replace(self, shape=shape, rotor=rotor, turbine=turbine)

    def loads_along(self, blade: Blade, known: dict, names: tuple[str, ...]) -> dict:
        """Return the largest loads along a blade at each time of a trajectory, SI units.

        By direct BEM at the trajectory's tip speed ratios, or at `RATIOS` of them if there are
        more, between which they are linear. known has the quantities of the trajectory, and the
        `sections` where the wake is not in equilibrium: the flow at each time.
        """
        ratio, flow = np.maximum(known["tip_speed_ratio"], SLOWEST_RATIO), known["inflow_speed"]
        if not names:
            return {}
        if "sections" in known:
            model, given = self.rotor.loads, {"names": names, "flow": known["sections"]}
            found = model.coefficients(blade, ratio, **given)
            largest = {name: load.largest for name, load in found.items()}
        elif self.rotor.follows_reynolds:  # the flow counts too: every instant by itself
            parts = np.array_split(np.arange(ratio.size), -(-ratio.size // RATIOS))
            found = [
                self.rotor.at_flow(flow[part]).loads.coefficients(blade, ratio[part], names=names)
                for part in parts
            ]
            largest = {
                name: np.concatenate([each[name].largest for each in found]) for name in names
            }
        else:
            at = ratio if ratio.size <= RATIOS else np.linspace(ratio.min(), ratio.max(), RATIOS)
            known_at = self.loads.coefficients(blade, at, names=names)
            largest = {name: load.largest for name, load in known_at.items()}
            if at is not ratio:
                largest = {name: np.interp(ratio, at, each) for name, each in largest.items()}
        return {name: 0.5 * self.density * flow**2 * each for name, each in largest.items()}

    @property
    def generator(self) -> Generator:
        """The generator, which gives the electrical power."""
        return self.case.generator

    @property
    def starting_generator(self) -> Generator | None:
        """The generator that decides where the rotor works best; None: the largest shaft power.

        A constant efficiency does not change the optimum, and losses have no effect on an objective
        that does not contain the electrical power. The shaft's friction has, on that of the shaft.
        """
        counts = "electrical_power" in self.objective.inputs
        if counts and not self.generator.proportional:
            return self.generator
        delivers = counts or "generator_power" in self.objective.inputs
        return LOSSLESS if delivers and self.generator.rubs else None

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
    def gain_units(self) -> tuple[str, ...]:
        """Units of the feedback gains; empty for open loop."""
        return self.law.gain_units

    @property
    def states(self) -> dict[str, tuple[str, str]]:
        """Unit and description of each state of the control law, by its name."""
        return self.law.states

    def states_at_rest(self, torque, inflow_speed) -> dict[str, np.ndarray]:
        """Return the states of the control law in equilibrium, by name; SI units."""
        return dict(zip(self.states, self.law.at_rest(torque, inflow_speed), strict=True))

    @property
    def several_sections(self) -> bool:
        """Whether the stations have different polars, whose sum is rougher than one polar."""
        return self.rotor.several_sections

    @property
    def has_curve(self) -> bool:
        """Whether the optimization takes torque from a curve over the tip speed ratio.

        A local Reynolds number depends on the speed of the flow too, which the curve does not have.
        """
        return self.case.hydrodynamics.torque == "curve" and not self.rotor.follows_reynolds

    @property
    def designs_hub(self) -> bool:
        """Whether the inertia of all that is not a blade is designed."""
        return self.blade.hub_inertia is not None

    def with_hub(self, blade: Blade, inertia: float) -> Blade:
        """Return a blade with a designed `hub_inertia`, kg*m**2, within its bounds."""
        inertia = float(np.clip(inertia, *self.case.design.hub_inertia_bounds))
        return replace(blade, hub_inertia=inertia)

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

    def band(self, setup) -> Band | None:
        """Return the tables of a wake with memory at a setup; None without memory.

        Its weights are those of the setup's blade at the mean of its tip speed ratios.
        """
        if not self.remembers:
            return None
        ratios = [known["tip_speed_ratio"] for known in self.on_start(setup.start)]
        mean = float(np.mean(np.concatenate(ratios)))
        return Band.of(self.rotor.as_built(setup.start.blade), setup.start.blade, mean, setup.nodes)

    def split(self, operation):
        """Return rotor speed and hydrodynamic torque of an operation, (2, n_times) a scenario."""
        ends = np.cumsum([each.samples.size for each in self.scenarios])[:-1]
        both = np.stack((operation.rotor_speed, operation.hydrodynamic_torque))
        return np.split(both, ends, axis=1)

    def on_start(self, point) -> list[dict]:
        """Return the quantities of a quasi-steady starting point, one dict a scenario.

        Those of `hkt_mdo.quantities.OVER_TIME`, of loads those that the case limits, and the
        scalars that limits and objectives may take; the generator torque balances the flow's, and
        states of the control law are in equilibrium.
        """
        if point not in self._starts:
            self._starts[point] = self._quantities(point)
        return [dict(each) for each in self._starts[point]]

    @cached_property
    def _starts(self) -> WeakKeyDictionary:
        """The result of `on_start`, cached since it is needed for every scenario."""
        return WeakKeyDictionary()

    def _quantities(self, point) -> list[dict]:
        """Compute the quantities of `on_start`."""
        found = []
        for scenario, (speed, torque) in zip(
            self.scenarios, self.split(point.operation), strict=True
        ):
            own, radius = self.of(scenario), point.blade.rotor_radius
            time, flow = scenario.samples, scenario.inflow.speed_at(scenario.samples)
            if own is not self:  # the operation is that of the case's own turbine
                ratio = np.maximum(speed * radius / flow, SLOWEST_RATIO)
                torque = own.rotor.coefficients(point.blade, ratio).torque
                torque = torque * torque_scale(own.density, radius, flow)
            held = torque - self.generator.friction(speed)
            known = trajectory_of(time, flow, speed, torque, held, radius, self.generator)
            known |= own.loads_along(point.blade, known, self.load_names)
            known["torque_rate"] = scenario.rate_of(held)
            scalars = own.scalars(point.blade, own.mass_and_inertia(point.blade)[1])
            known["steady"] = scenario.steady
            found.append(known | scalars | self.states_at_rest(held, flow))
        energies = self.energies([scenario.sample_weights for scenario in self.scenarios], found)
        return [known | energies for known in found]

    def energies(self, weights: Iterable[np.ndarray], known: Iterable[dict]) -> dict[str, float]:
        """Return the energies of the result, J, from the powers in each scenario.

        Parameters
        ----------
        weights : iterable of array
            Quadrature weights of each scenario, s.
        known : iterable of dict
            Quantities over time of each scenario, at the times of its weights.
        """
        kinds = CapturedEnergy(), GeneratorEnergy(), ElectricalEnergy()
        total = dict.fromkeys(names(over="result"), 0.0)
        for scenario, own, values in zip(self.scenarios, weights, known, strict=True):
            for name, kind in zip(total, kinds, strict=True):
                total[name] += scenario.weight * float(own @ kind.rate_of(values))
        return total

    def scalars(self, blade: Blade, inertia: float) -> dict[str, Any]:
        """Return the quantities of a design, along the span and as numbers, by name; SI units."""
        thickness = self.turbine.thickness if blade.thickness is None else blade.thickness
        return {
            "rotor_radius": blade.rotor_radius,
            "density": self.density,
            "inertia": inertia,
            "mass": self.mass_and_inertia(blade)[0],
            "blade_area": planform_area(blade),
            "weight_stress": self.weight_stress(blade),
            "chord": blade.chord,
            "twist": blade.twist,
            "thickness": np.broadcast_to(thickness, blade.r.shape),
        }

    def excesses(self, point) -> dict[str, float]:
        """Return by how much a starting point exceeds each limit, design bounds aside, by name.

        Relatively, at most 0 if it is kept.
        """
        starts = list(zip(self.scenarios, self.on_start(point), strict=True))
        found: dict[str, float] = {}
        for scenario, start in starts:
            for limit in (*self.limits_in(scenario), *self.design_limits):
                if not isinstance(limit, DesignBounds):
                    over = float(np.max(limit.excess(start)))
                    found[limit.name] = max(over, found.get(limit.name, -np.inf))
        return found

    def broken_limits(self, point) -> list[str]:
        """Return the names of the limits, design bounds aside, that a starting point exceeds."""
        return [name for name, over in self.excesses(point).items() if over > START_EXCESS]

    def objective_at(self, point) -> float:
        """Return the objective of a quasi-steady starting point, in its unit, less its price."""
        starts, price = self.on_start(point), self.price_of(point.blade)
        if not self.objective.is_rate:
            return float(self.objective.value_of(starts[0])) - price
        shares = np.array(list(self.shares.values()))
        return self.duration * self.aggregate.of(self.mean_rates(starts), shares) - price

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
            captured *= self.generator.largest_efficiency
        return self.objective.bound(captured)

    def weight_stress(self, blade: Blade) -> float:
        """Return the largest stress in a blade by its weight in water, Pa; 0 if it is not used."""
        if not self.asks_for("weight_stress"):
            return 0.0
        return float(self.loads.weight_stress(blade, derivatives=False).values[0])

    def water_inertias(self, blade: Blade) -> tuple[float, float]:
        """Return the inertia (kg*m**2) of the water that a blade accelerates, by both models."""
        models = "plate", "ellipse"
        plate, ellipse = (float(self.rotor.water_inertia(blade, x)) for x in models)
        return plate, ellipse

    def mass_and_inertia(self, blade: Blade) -> tuple[float, float]:
        """Return mass (kg) and inertia (kg*m**2) of the rotor with a blade."""
        mass, inertia = self.rotor.mass_and_inertia(blade)
        return float(mass), float(inertia)


def complete(case: Case) -> Case:
    """Return a case whose time spans and segments are numbers, taken from its flows if need be."""
    phase = case.phase
    done = None not in (phase.duration, phase.segments) and phase.final_speed != "auto"
    if done and not case.scenarios:
        return case
    duration, segments = _span(case.inflow, phase.duration, phase.segments)
    final = phase.final_speed
    if final == "auto":
        rates = any(limit.is_of(RATES) for limit in case.limits.given)
        final = "free" if rates or case.control.is_feedback else "initial"
    found = {"duration": duration, "segments": segments, "final_speed": final}
    scenarios = []
    for number, own in enumerate(case.scenarios):
        given = own.duration or phase.duration, own.segments or phase.segments
        with _in_scenario(number):
            duration, segments = _span(own.inflow or case.inflow, *given)
        scenarios.append(own.model_copy(update={"duration": duration, "segments": segments}))
    update = {"phase": phase.model_copy(update=found), "scenarios": tuple(scenarios)}
    return case.model_copy(update=update)


@contextmanager
def _in_scenario(number: int) -> Iterator[None]:
    """Add the key of the scenario to an error in its flow."""
    try:
        yield
    except InputError as error:
        key = error.key.removeprefix("phase.")
        error.key = f"scenarios[{number}].{key}" if key else f"scenarios[{number}]"
        raise


def _span(inflow: Inflow, duration: float | None, segments: int | None) -> tuple[float, int]:
    """Return the duration of a flow, s, and the number of segments, where they are not given."""
    if inflow.length is not None:
        inflow.check(inflow.length)
    duration = duration or inflow.length or DURATION
    if segments is None:
        lasting = (
            period for begin, end, period in inflow.features if begin <= 0.0 and end == np.inf
        )
        wanted = np.ceil(SEGMENTS_PER_PERIOD * duration / min(lasting, default=np.inf) - 1e-9)
        segments = int(np.clip(wanted, FEWEST_SEGMENTS, MOST_SEGMENTS))
    periods = sum(
        (min(end, duration) - max(begin, 0.0)) / period
        for begin, end, period in inflow.features
        if end > 0.0 and begin < duration
    )
    if periods > MOST_PERIODS:
        problem = f"has {periods:.3g} periods of the flow's highest frequency"
        remedy = f"give a shorter one or a slower flow: at most {MOST_PERIODS:.0e} periods"
        raise InputError(problem, remedy, key="phase.duration", value=duration)
    return duration, segments


def _whole_scenarios(case: Case) -> list[Scenario]:
    """Return the scenarios of a complete case, each over its whole time span."""
    if not case.scenarios:
        return _checked(case, _scenario(case, case.inflow, case.phase))
    found, total = [], sum(each.weight for each in case.scenarios)
    for number, own in enumerate(case.scenarios):
        mesh = {"duration": own.duration, "segments": own.segments}
        weight = own.weight / total * case.phase.duration / own.duration
        mesh, limits = case.phase.model_copy(update=mesh), own.limits.given
        with _in_scenario(number):
            scenario = _scenario(
                case,
                own.inflow or case.inflow,
                mesh,
                weight=weight,
                name=own.name,
                density=own.density,
                condition=own.condition,
                own_limits={limit.name: limit for limit in limits},
                steady=own.steady,
            )
            found += _checked(case, scenario)
    return found


def _scenario(case: Case, inflow: Inflow, mesh, *, steady: bool = False, **about) -> Scenario:
    """Return a scenario over its time, or without time where it is steady or of a resource."""
    if not (steady or inflow.steady):
        return Scenario(inflow, mesh, **about)
    if case.control.chooses_torque:
        problem = "has no torque over time in a steady scenario"
        raise InputError(problem, "give control.unknown: speed", key="control.unknown")
    inflow.check(mesh.duration)
    made = SteadyScenario.of(inflow, mesh, **({"weight": 1.0, "name": "phase"} | about))
    return made.below(case.control.cut_out)


def _checked(case: Case, scenario: Scenario) -> list[Scenario]:
    """Return a scenario on a mesh that resolves its flow; refuse a flow that is none.

    Two if its rotor turns backwards in reversed flow, the second of the same group.
    """
    inflow = scenario.inflow
    for duration in (inflow.length, scenario.mesh.duration):
        if duration is not None:
            inflow.check(duration)
    resource = getattr(scenario, "resource", None)
    if getattr(resource, "reversed_speeds", None) is None:
        return [scenario.resolved()]
    changed = {"polar": resource.reversed_polar}
    condition = (scenario.condition or case.condition).model_copy(update=changed)
    kept = ("mesh", "weight", "density", "own_limits")
    about = {name: getattr(scenario, name) for name in kept} | {"condition": condition}
    about |= {"name": f"{scenario.name}_backwards", "interval_of": scenario.name}
    back = SteadyScenario.of(resource, backwards=True, **about)
    return [scenario, back.below(case.control.cut_out)]


def physics(case: Case) -> Physics:
    """Read the files that a case names; InputError if one is broken or does not fit the others."""
    case = complete(case)
    control = case.control
    if isinstance(control, FeedbackLaw):
        control = control.applied(case.condition.torque_constant)
    whole = _whole_scenarios(case)
    speed = np.concatenate([each.inflow.speed_at(each.samples) for each in whole])
    weights = np.concatenate([each.weight * each.sample_weights for each in whole])
    fastest, mean = float(np.max(speed)), float(weights @ speed / np.sum(weights))
    if control.cut_out is not None:
        fastest = min(fastest, control.cut_out)
        speed = np.minimum(speed, control.cut_out)
    slowest = float(np.min(speed))
    control = control.in_flow(slowest, float(np.max(speed)))
    # the speed at which most energy passes; only local Reynolds numbers need it
    speed = float(weights @ speed**4 / (weights @ speed**3))
    turbine = build_turbine(case.rotor, case.fluid, speed, case.design)
    case.generator.check(turbine.blade.rotor_radius, slowest, fastest)
    turbine = _in_condition(turbine, case)
    case = _with_chord_bounds(case, turbine.blade)
    shape = build_shape(
        case,
        turbine.blade,
        several_sections=Hydrodynamics(turbine.polar).several_sections,
        thickness_bounds=Hydrodynamics(turbine.polar).thickness_bounds,
    )
    scenarios, notes = [], []
    for each in whole:
        found, messages = in_operation(each, control.cut_out, 2.0 * turbine.blade.rotor_radius)
        scenarios += found
        notes += messages
    refuse_contradictions(case, shape, mean, fastest)
    flows = {message: None for each in whole for message in each.messages}
    messages = (*turbine.messages, *flows, *dict.fromkeys(notes), *redundant_limits(case, shape))
    limit = control.torque_limit
    radius = max(shape.blade.rotor_radius, *(shape.radius_bounds or (0.0,)))
    most = MOST_TORQUE * float(torque_scale(case.fluid.density, radius, fastest))
    if limit is not None and limit > most:
        text = f"control.torque_limit = {limit:g} N m is out of reach of any blade in this flow"
        messages += (f"{text}, at most {most:.3g} N m: it counts as none",)
        control = control.with_torque_limit(None)
    limits = _limits(case, shape, control.torque_limit)
    made = Physics(
        case,
        shape,
        _rotor_model(case, turbine, shape),
        turbine,
        tuple(_with_limits(each, limits, case, shape) for each in scenarios),
        control,
        limits,
        case.objective,
        messages,
        tuple(doubts(case, _derived(turbine, whole))),
    )
    return replace(made, ceilings=_ceilings(made)) if case.robustness.relative else made


def _ceilings(physics: Physics) -> dict[str, float]:
    """Return an upper bound on the mean power of each scenario, W, by name.

    That of a rotor at the steady optimum of the case's own radius at every instant, or of the
    generator's limit where that is smaller.
    """
    found = dict.fromkeys(physics.shares, 0.0)
    for each in physics.scenarios:
        own = physics.of(each)
        best = own.best.power_coefficient
        best *= float(power_scale(own.density, own.blade.rotor_radius, 1.0))
        most = [x.upper for x in physics.limits_in(each) if isinstance(x, PowerLimit)]
        power = np.minimum(
            best * each.inflow.speed_at(each.node_times) ** 3, min(most, default=np.inf)
        )
        found[each.group] += float(each.node_weights @ power) / each.mesh.duration
    return found


def _with_limits(
    scenario: Scenario, limits: tuple[Limit, ...], case: Case, shape: Shape
) -> Scenario:
    """Return a scenario with its limits over time: its own in place of the case's."""
    constant = (scenario.condition or case.condition).torque_constant
    if not scenario.own_limits and constant == case.condition.torque_constant:
        return scenario
    own = {
        name: limit.on(shape.blade, case.rotor.blade_material)
        for name, limit in scenario.own_limits.items()
    }
    common = {limit.name: limit for limit in limits if limit.place == "time"}
    for limit in limits:
        # of the torque that the law demands
        if isinstance(limit, TorqueLimit) and limit.bound is not None:
            bound = limit.bound * constant / case.condition.torque_constant
            common[limit.name] = TorqueLimit(bound=bound)
    return replace(scenario, limits=tuple((common | own).values()), own_limits={})


def _rotor_model(case: Case, turbine: Turbine, shape: Shape) -> RotorModel:
    """Return the rotor of a case; refuse limits on loads that it cannot compute."""
    flow = Hydrodynamics(turbine.polar)
    given = [*case.limits.given, *(each for part in case.scenarios for each in part.limits.given)]
    limited = {name: each for each in given for name in each.inputs if name in LOADS}
    direct = case.hydrodynamics.torque == "direct"
    optimized = case.objective.is_of(LOADS)
    if (limited or optimized) and (direct or flow.follows_reynolds):
        key = "objective" if optimized else f"limits.{next(iter(limited))}"
        problem = "uses a load, which needs a curve over the tip speed ratio"
        remedy = "give hydrodynamics.torque: curve and rotor.reynolds: invariant"
        raise InputError(problem, remedy, key=key)
    if flow.follows_thickness and (direct or case.hydrodynamics.bem != "vectorized"):
        problem = "takes hydrodynamics.torque: curve and hydrodynamics.bem: vectorized"
        raise InputError(problem, "give these", key="design.thickness_points")
    polars = {polar for station in range(shape.blade.r.size) for polar in flow.polars_at(station)}
    asked = limited.get("cavitation", CavitationLimit())
    depth = case.site.hub_depth if asked.depth is None else asked.depth
    if "cavitation" in limited:
        if depth is None:
            problem, remedy = "has no depth", "give limits.cavitation.depth or site.hub_depth"
            raise InputError(problem, remedy, key="limits.cavitation")
        require_suction(polars)
    key = "site.hub_depth" if asked.depth is None else "limits.cavitation.depth"
    tip = max(shape.blade.rotor_radius, *(shape.radius_bounds or (0.0,)))
    if depth is not None and depth <= tip:
        problem = f"is within the blade's radius of {tip:.4g} m: the tip would leave the water"
        raise InputError(problem, "give a larger depth of the hub", key=key, value=depth)
    computable = not flow.follows_reynolds and all(each.suction is not None for each in polars)
    cavitation = None
    if depth is not None and computable:
        cavitation = Cavitation(flow.suction, depth, asked.margin)
    return RotorModel(
        polar=turbine.polar,
        section_area=turbine.section_area,
        material_density=case.rotor.blade_material.density,
        hub_inertia=case.rotor.hub_inertia,
        water_density=case.fluid.density,
        structure=turbine.structure,
        cavitation=cavitation,
        inertia_factor=case.condition.inertia,
        added_inertia=case.rotor.added_inertia,
        thickness=turbine.thickness,
    )


def _in_condition(turbine: Turbine, case: Case) -> Turbine:
    """Return a turbine with the polars that its sections have in the condition of a case."""
    condition, polar = case.condition, turbine.polar
    if not condition.fouls:
        return turbine
    if condition.polar is not None:
        rotor = case.rotor.model_copy(update={"polar": condition.polar})
        polar = build_turbine(rotor, case.fluid, 1.0).polar
    several = polar if isinstance(polar, tuple) else (polar,)
    fouled = tuple(each.scaled(condition.lift, condition.drag) for each in several)
    return turbine._replace(polar=fouled if isinstance(polar, tuple) else fouled[0])


def _derived(turbine: Turbine, whole: list[Scenario]) -> dict[str, float]:
    """Return quantities that follow from a case and its files, by their names in `PLAUSIBLE`."""
    flows = {
        f"mean flow speed of {x.name}" if len(whole) > 1 else "mean flow speed": x for x in whole
    }
    return {
        name: float(np.average(each.inflow.speed_at(each.samples), weights=each.sample_weights))
        for name, each in flows.items()
    } | {
        "tip radius": turbine.blade.tip_radius,
        "outermost station": float(turbine.blade.r[-1]) / turbine.blade.tip_radius,
        "thickness of the thinnest section": float(np.min(turbine.thickness)),
    }


def _with_chord_bounds(case: Case, blade: Blade) -> Case:
    """Return a case with the bounds on the chord that follow from its blade, if it gives none."""
    if case.design.chord_bounds is not None or case.design.blade == "fixed":
        return case
    rotor = case.rotor
    is_paper = rotor.blade == PAPER_BLADE and rotor.chord is None
    is_paper = is_paper and np.isclose(rotor.radius, shipped_rotor(PAPER_BLADE)["radius"], 1e-9, 0)
    bounds: tuple[float, ...] = PAPER_CHORD_BOUNDS
    if not is_paper:
        ends = CHORD_FACTORS[0] * np.min(blade.chord), CHORD_FACTORS[1] * np.max(blade.chord)
        bounds = tuple(float(f"{end:.3g}") for end in ends)
    design = case.design.model_copy(update={"chord_bounds": bounds})
    return case.model_copy(update={"design": design})


def build_shape(
    case: Case, blade: Blade, *, several_sections: bool = False, thickness_bounds=(0.0, 1.0)
) -> Shape:
    """Return the design variables of a case's blade."""
    design, cosine = case.design, np.cos(blade.cone)
    if design.hub_inertia_bounds is not None:
        hub = float(np.clip(case.rotor.hub_inertia, *design.hub_inertia_bounds))
        blade = replace(blade, hub_inertia=hub)
    radius_bounds = None
    if design.radius_bounds is not None:
        radius_bounds = tuple(float(bound * cosine) for bound in design.radius_bounds)
    if design.blade == "fixed":
        bounds = design.set_angle_bounds
        return Shape.fixed(
            blade,
            np.deg2rad(case.rotor.set_angle or 0.0),
            None if bounds is None else tuple(np.deg2rad(bounds)),
            radius_bounds,
        )
    return Shape.designed(
        blade,
        design.chord_points,
        design.twist_points,
        design.chord_bounds,
        tuple(np.deg2rad(design.twist_bounds)),
        radius_bounds,
        several_sections=several_sections,
        thickness_points=design.thickness_points,
        thickness_bounds=thickness_bounds,
    )


def _limits(case: Case, shape: Shape, torque_limit: float | None) -> tuple[Limit, ...]:
    """Return the limits of a case: torque and rotation, the design's bounds, and those it gives.

    A generator whose table ends at a speed has a limit of the speed there.
    """
    bounds = {}
    if case.design.blade == "optimized":
        bounds |= {"chord": shape.chord_bounds, "twist": shape.twist_bounds}
        if shape.designs_thickness:
            bounds["thickness"] = shape.thickness_bounds
    elif case.design.set_angle_bounds is not None:
        bounds["set_angle"] = shape.twist_bounds
    bounds |= {"radius": shape.radius_bounds, "gain": case.design.gain_bounds}
    bounds["hub_inertia"] = case.design.hub_inertia_bounds
    given = [limit.on(shape.blade, case.rotor.blade_material) for limit in case.limits.given]
    fastest = case.generator.fastest
    if fastest < min((x.upper for x in given if isinstance(x, RotorSpeedLimit)), default=np.inf):
        given = [x for x in given if not isinstance(x, RotorSpeedLimit)]
        given.append(RotorSpeedLimit(bound=fastest))
    return (
        TorqueLimit(bound=torque_limit and torque_limit * case.condition.torque_constant),
        ForwardRotation(),
        *(DesignBounds(quantity=name, bounds=ends) for name, ends in bounds.items() if ends),
        *given,
    )
