"""The verifications of a result: independent integrations of the optimized design in each scenario.

The integration has the torque by direct BEM; it shares neither torque curve nor collocation with
the result.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import openmdao.api as om
from scipy.integrate import simpson, trapezoid

from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.limits import LEAST, SLOWED, TYPICAL, Limit, settled
from hkt_mdo.dynamics.simulation import (
    SLOWEST_RATIO,
    FeedbackTorque,
    IntegrationError,
    Plant,
    RecordedTorque,
    Simulation,
    simulate,
)
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.dynamics.trajectory import trajectory_of
from hkt_mdo.problem.evaluation import loads_along, scalars, steady_plant
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import StartingPoint
from hkt_mdo.problem.scenario import SAMPLES, Scenario
from hkt_mdo.problem.setup import Setup
from hkt_mdo.rotor.bem import Sections
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.model import RotorModel
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.run.loads import resolved
from hkt_mdo.solve.driver_base import Outcome

TABULATED = np.linspace(SLOWEST_RATIO, 25.0, 2500)
"""Tip speed ratios of a torque by a spline."""
SHORTER, LEAST_SHARE = 0.9, 1e-3  # of the time to where a motion ends, and of the whole, at least


@dataclass(frozen=True, eq=False)
class Optimized:
    """An optimization's end; `trajectories` has the quantities at the nodes of each scenario."""

    physics: Physics
    """What the case describes, on the mesh of this optimization."""
    problem: om.Problem
    outcome: Outcome
    setup: Setup
    point: StartingPoint
    trajectories: tuple[dict[str, np.ndarray], ...]
    energy: float
    objective: float
    inertia: float
    mass: float
    curve: np.ndarray
    mesh_error: float = 0.0
    """Relative change of the objective on a finer mesh, as far as it is known."""


@dataclass(frozen=True, eq=False)
class SimulatedDesign:
    """An integration of a design, and what is reported of it."""

    physics: Physics
    rotor: RotorModel
    """The rotor of the plant, one of those of the physics."""
    plant: Plant
    simulation: Simulation
    controller: RecordedTorque | FeedbackTorque

    @cached_property
    def scalars(self) -> dict[str, Any]:
        """The quantities of the design."""
        return scalars(self.physics, self.rotor, self.plant.blade) | {"inertia": self.plant.inertia}

    def loads(self, series: dict) -> dict[str, np.ndarray]:
        """Return all loads of the model, of a trajectory's quantities, by direct BEM."""
        return loads_along(self.rotor, self.plant.blade, series, self.rotor.load_names)

    @cached_property
    def simulated(self) -> dict[str, Any]:
        """What is reported of the integration: its quantities, all loads, rates and the scalars."""
        series = self.integrated
        return series | self.loads(series) | self.simulated_rates | self.scalars

    @property
    def simulated_rates(self) -> dict[str, np.ndarray]:
        """All rates, along the integration."""
        run = self.simulation
        friction = self.plant.generator.friction(run.rotor_speed)
        net = run.hydrodynamic_torque - run.control_torque - friction
        of_rotor = run.time, run.rotor_speed, net / self.plant.inertia
        return {"torque_rate": self.controller.rate(*of_rotor, run.inflow_speed, *run.states)}

    @cached_property
    def sections(self) -> Sections | None:
        """The flow at the sections along the integration, where the wake has memory."""
        run, wake = self.simulation, self.plant.wake
        if wake is None:
            return None
        return wake.sections(run.rotor_speed, run.inflow_speed, run.filters)

    @property
    def integrated(self) -> dict[str, np.ndarray]:
        """The quantities of the integration, by their names in a trajectory."""
        names = "time inflow_speed rotor_speed hydrodynamic_torque control_torque".split()
        simulated = (getattr(self.simulation, name) for name in names)
        series = trajectory_of(*simulated, self.scalars["rotor_radius"], self.plant.generator)
        series |= zip(self.physics.law.states, self.simulation.states, strict=True)
        return series if self.sections is None else series | {"sections": self.sections}


@dataclass(frozen=True, eq=False)
class Verification(SimulatedDesign):
    """A scenario of a result: its collocated trajectory and the independent integration."""

    scenario: Scenario
    trajectory: dict[str, np.ndarray]
    two_filters: "Verification | None" = None
    """If the wake has memory, the integration with the optimization's two filters (`MeanWake`)."""

    @property
    def of_model(self) -> "Verification":
        """The integration of the model that was optimized."""
        return self.two_filters or self

    @property
    def rates_at_nodes(self) -> dict[str, np.ndarray]:
        """All rates, at the nodes: those of each segment's polynomial."""
        return {"torque_rate": self.scenario.differentiation @ self.trajectory["control_torque"]}

    @cached_property
    def at_nodes(self) -> dict[str, Any]:
        """What is reported of the nodes: the trajectory, all loads, rates and the scalars.

        The loads are those in the wake of the optimization.
        """
        series, wake = self.trajectory, self.of_model.plant.wake
        if wake is not None:
            ratios = (series[name] for name in ("tip_speed_ratio", "wake_ratio", "inflow_speed"))
            series = series | {"sections": wake.behind(*ratios)}
        return self.trajectory | self.loads(series) | self.rates_at_nodes | self.scalars

    def excess_at_nodes(self, limit: Limit) -> np.ndarray:
        """Return how far a limit is exceeded at the nodes, relatively, (n_segments, n_nodes)."""
        return limit.excess(self.at_nodes).reshape(self.scenario.segments, -1)

    @cached_property
    def resolved(self) -> dict[str, Any] | None:
        """The integration at its largest loads, with those of a blade of many stations."""
        return resolved(self.physics, self.plant.blade, self.scenario, self.simulated)

    @property
    def constrained(self) -> list[Limit]:
        """The limits over time that the optimization constrains in the scenario."""
        return [limit for limit in self.scenario.limits if limit.constrains(self.physics.law)]

    @property
    def energy_error(self) -> float:
        """Relative difference of the collocated from the integrated energy of the same model."""
        collocated = self.scenario.node_weights @ self.trajectory["hydrodynamic_power"]
        simulated = self.of_model.simulation.energy
        return abs(float(collocated) / simulated - 1.0) if simulated > 0.0 else np.inf

    @property
    def speed_errors(self) -> np.ndarray:
        """Relative differences of the integrated from the collocated speed at the nodes.

        Both of the same model.
        """
        nodes = self.trajectory
        return np.abs(self.of_model.simulation.speed_at(nodes["time"]) / nodes["rotor_speed"] - 1.0)

    @cached_property
    def growth(self) -> np.ndarray:
        """Growth of a small change of speed and states under feedback, 1/s."""
        plant, run = replace(self.plant, wake=None), self.simulation
        loop = Loop.of(plant, self.controller, run.rotor_speed, run.inflow_speed, *run.states)
        return loop.frozen_growth

    @cached_property
    def net_torques(self) -> tuple[np.ndarray, np.ndarray]:
        """Net torque on a rotor under feedback, N*m, (n_times,), at its speed and slowed.

        Slowed is a loss of `SLOWED` of its speed; flow and states of the law are those of the
        integration.
        """
        run, law, gains = self.simulation, self.controller.law, self.controller.gains

        def net(speed):
            held = self.plant.generator_torque(speed, run.inflow_speed)
            return held - law.torque(speed, gains, *run.states)

        return net(run.rotor_speed), net((1.0 - SLOWED) * run.rotor_speed)

    @cached_property
    def short_of_recovery(self) -> np.ndarray:
        """How far the recovery torque of `DistanceFromStall` falls short of its least, (n_times,).

        By direct BEM at the times of the integration, as a share of the least: 1 where a slowed
        rotor does not recover, at most 0 where all is well. It is checked where the rotor is
        `settled`, else -inf: in a gust that is faster than the rotor, the integration shows whether
        it recovers.
        """
        flow, radius = self.simulation.inflow_speed, self.scalars["rotor_radius"]
        unit = TYPICAL * torque_scale(self.rotor.water_density, radius, flow)
        net, slowed = self.net_torques
        is_settled = settled(self.integrated | self.scalars)
        return np.where(is_settled, 1.0 - (slowed - net) / unit / LEAST, -np.inf)

    def integral(self, values: np.ndarray) -> float:
        """Return the integral of values along the integration."""
        return float(trapezoid(values, self.simulation.time))

    def objective(self, objective) -> float:
        """Return the integral of an objective's rate over the integration, in its unit."""
        return float(simpson(objective.rate_of(self.simulated), x=self.simulation.time))

    def between_nodes(self, limit: Limit) -> tuple[np.ndarray, np.ndarray]:
        """Return how far a limit is exceeded in each segment between its nodes, and when (s).

        The open loop's torque and its rate are those of the collocation's polynomials, before the
        torque is cut to the generator's range; all else is that of the integration.
        """
        scenario, simulated, recorded = self.scenario, self.simulated, self.controller
        dense, over = simulated["time"][1:], limit.excess(simulated)[1:]
        of_polynomial = limit.inputs in (("control_torque",), ("torque_rate",))
        if isinstance(recorded, RecordedTorque) and of_polynomial:
            dense = scenario.within((np.arange(SAMPLES) + 0.5) / SAMPLES)
            torque, rate = recorded.unlimited(dense), recorded.unlimited_rate(dense)
            polynomial = limit.excess({"control_torque": torque, "torque_rate": rate})
            # the feedback that holds the speed of an unstable rotor is added to the history
            over = np.maximum(polynomial, over) if recorded.stiffness else polynomial
        over = over.reshape(-1, SAMPLES)
        worst, rows = np.argmax(over, axis=1), np.arange(scenario.segments)
        return over[rows, worst], dense.reshape(-1, SAMPLES)[rows, worst]


@dataclass(frozen=True)
class HeldSpeeds:
    """The controller of an open loop in steady flows: the torque balances that of the flow.

    stiffness (N*m*s/rad) is that which its rotor needs where it is unstable (`RecordedTorque`).
    """

    stiffness: float


@dataclass(frozen=True, eq=False)
class SteadyVerification(Verification):
    """A steady scenario of a result: its equilibria by the optimization and by direct BEM."""

    simulated_rates = Verification.rates_at_nodes  # none

    @cached_property
    def scalars(self):
        return super().scalars | {"steady": True}

    def integral(self, values):
        return float(self.scenario.node_weights @ values)

    def objective(self, objective):
        return self.integral(objective.rate_of(self.simulated))

    def between_nodes(self, limit):
        return limit.excess(self.simulated), self.scenario.node_times


def in_equilibrium(physics: Physics, scenario, plant: Plant, gains, nodes) -> SteadyVerification:
    """Return the equilibria in a steady scenario by direct BEM.

    The wake of the plant is in equilibrium, as the rotor is. `nodes` has the trajectory of the
    optimization, empty for another flow under feedback.
    """
    plant, law = replace(plant, wake=None), physics.law_in(scenario)
    flow, time = scenario.speeds, scenario.node_times
    none = np.empty((flow.size, 0))
    if law.is_feedback:
        controller = FeedbackTorque(law, gains)
        speed, running, rest = equilibria(plant, controller, flow)
    else:
        speed, running, rest = nodes["rotor_speed"], np.ones(flow.size, bool), none.T
        controller = HeldSpeeds(2.0 * max(float(np.max(plant.torque_slope(speed, flow))), 0.0))
    driving, held = plant.torque(speed, flow), plant.generator_torque(speed, flow)
    control = law.torque(speed, gains, *rest) if law.is_feedback else held
    powers = plant.powers(speed, driving, control)
    energies = (float(scenario.node_weights @ power) for power in powers)
    stopped = None if np.all(running) else float(time[np.argmin(running)])
    series = time, flow, speed, driving, control
    run = Simulation(*series, *energies, 0.0, stopped, lambda _: speed, rest, none)
    rotor, nodes = physics.rotor_in(scenario), {"control_torque": control} | nodes
    return SteadyVerification(physics, rotor, plant, run, controller, scenario, nodes)


def verify(
    result: Optimized, tabulated: bool = False, rough: tuple[Verification, ...] = ()
) -> tuple[Verification, ...]:
    """Integrate the optimized design and controller with direct BEM, in each scenario.

    With the wake of the case; if it has memory, with filters at all stations, and again with the
    two of the optimization. `tabulated` replaces direct BEM by a spline through it, which is enough
    to choose a remedy; `rough` are the integrations by it, from whose motions these are found.
    """
    physics, verifications = result.physics, []
    guesses = [each.simulation.path for each in rough] or [None] * len(physics.scenarios)
    for scenario, nodes, guess in zip(physics.scenarios, result.trajectories, guesses, strict=True):
        rotor, mesh = physics.rotor_in(scenario), scenario.mesh
        plant = plant_of(physics, scenario, result.point.blade)
        plant = plant.tabulated(TABULATED) if tabulated else plant
        if scenario.steady:
            steady = in_equilibrium(physics, scenario, plant, result.point.gains, nodes)
            verifications.append(steady)
            continue
        options = {"scenario": scenario, "trajectory": nodes}
        controller = controller_of(physics, scenario, plant, result.point.gains, nodes)
        start = [nodes[name][0] for name in ("rotor_speed", *physics.law.states)]
        arguments = scenario, controller, start, mesh.duration / mesh.segments
        if plant.wake is not None:
            mean = plant.with_mean_wake(result.setup.band(physics))
            run = _simulated(mean, *arguments), controller
            options["two_filters"] = Verification(physics, rotor, mean, *run, **options)
        run = _simulated(plant, *arguments, guess=guess), controller
        verifications.append(Verification(physics, rotor, plant, *run, **options))
    return tuple(verifications)


def controller_of(physics: Physics, scenario: Scenario, plant: Plant, gains, nodes: dict):
    """Return the controller in a scenario; nodes has the trajectory that an open loop repeats."""
    law = physics.law_in(scenario)
    if law.is_feedback:
        return FeedbackTorque(law, gains)
    return RecordedTorque.of(plant, nodes, law.torque_limit)


def plant_of(physics: Physics, scenario: Scenario, blade: Blade) -> Plant:
    """Return the rotor in a scenario with direct BEM and the wake of the case."""
    dynamics = physics.case.inflow_dynamics
    plant = steady_plant(physics, physics.rotor_in(scenario), blade)
    return plant.with_memory(dynamics.tau1) if dynamics.remembers else plant


def start_against_friction(plant: Plant, scenarios) -> tuple[str, bool]:
    """Return how the standing rotor starts against its friction, as text, and whether it does.

    That is in the fastest flow of some scenarios; the text is empty where there is no friction.
    """
    least = plant.starting_flow
    if not least:
        return "", True
    fastest = max(float(np.max(each.inflow.speed_at(each.node_times))) for each in scenarios)
    if least <= fastest:
        return f"the standing rotor starts against its friction from {least:.3g} m/s", True
    return (
        "the standing rotor does not start by itself: against its friction it needs a flow of "
        f"{least:.3g} m/s, and the fastest here has {fastest:.3g} m/s"
    ), False


def _simulated(plant, scenario, controller, start, max_step, share=1.0, guess=None) -> Simulation:
    """Integrate a share of a scenario; without a solution to its end, up to where there is one.

    Then as if the rotor stopped there.
    """
    first = scenario.edges[0]
    time = first + share * (scenario.dense - first)
    try:
        return simulate(plant, scenario.inflow, controller, start, time, max_step, guess=guess)
    except IntegrationError as error:  # an infinite torque has no integral
        shorter = (error.time - first) / scenario.duration * (1.0 if share == 1.0 else SHORTER)
        if shorter < LEAST_SHARE:
            raise
        whole = _simulated(plant, scenario, controller, start, max_step, shorter)
        return replace(whole, stopped_at=whole.stopped_at or error.time, path=None)
