"""The design of a result as objects: blade, control law, turbine; and its simulation.

Nothing else in this package needs the rotor, its files or the optimization's modules.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.estimate import FlowEstimate
from hkt_mdo.dynamics.flows import Inflow
from hkt_mdo.dynamics.laws import Law
from hkt_mdo.dynamics.simulation import FeedbackTorque, Plant, RecordedTorque, Simulation, simulate
from hkt_mdo.errors import InputError
from hkt_mdo.problem.evaluation import steady_plant
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.physics import complete, physics
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.problem.turbine import Turbine
from hkt_mdo.quantities import QUANTITIES, TRAJECTORY
from hkt_mdo.results.sections import blade_of
from hkt_mdo.rotor.blade import Blade


@dataclass(frozen=True, eq=False)
class Design:
    """The design of a run, which can be simulated in any flow.

    Attributes
    ----------
    solution : Solution
        The result of the run.
    blade : Blade
        The blade, its twist with the set angle.
    gains : ndarray, shape (n_gains,)
        Gains of the law, in its `gain_units`; empty for open loop.
    inertia : float
        Inertia of the rotor, kg m^2.
    turbine : Turbine
        The turbine of the case (`hkt_mdo.problem.turbine`), with blade and polars of the result.
    physics : Physics
        The physics of the case, with the blade at the start.
    plant : Plant
        The rotor in the water with its generator, by direct BEM; may be replaced by another one.
    known : Plant
        The plant that the controller assumes.
    """

    solution: Any
    blade: Blade
    gains: np.ndarray
    inertia: float
    turbine: Turbine
    physics: Physics
    plant: Plant
    known: Plant

    @classmethod
    def of(cls, solution: Any) -> "Design":
        """Build the design of a result from its case and the files that this names.

        Parameters
        ----------
        solution : Solution
            The result, whose summary has a blade.

        Returns
        -------
        Design

        Raises
        ------
        InputError
            If a file of the case is gone or broken, or the case has other stations.
        """
        summary, physics_ = solution.summary, physics(solution.case.of_scenario())
        blade = replace(blade_of(solution, physics_.blade), hub_inertia=summary.hub_inertia_kg_m2)
        plant = steady_plant(physics_, physics_.rotor, blade)
        gains = np.atleast_1d([] if summary.gain is None else summary.gain).astype(float)
        turbine = physics_.turbine._replace(blade=blade, polar=plant.polar)
        return cls(solution, blade, gains, plant.inertia, turbine, physics_, plant, plant)

    @property
    def law(self) -> Law:
        """The control law with the torque that it demands; that of an open loop is in the table."""
        return self.physics.law.applied(1.0)

    @property
    def thickness(self) -> np.ndarray:
        """Largest thickness over chord at the stations, shape (n_stations,)."""
        return self.physics.rotor.thickness_of(self.blade)

    def with_memory(self, tau1: float | None = None) -> "Design":
        """Return the same design with a wake that has memory.

        Parameters
        ----------
        tau1 : float or None
            Time constant of the slow filters, s; None: by the induction.

        Returns
        -------
        Design
            The plant has filters; the controller has what it needs to replay an open loop with
            memory.
        """
        return replace(self, plant=self.plant.with_memory(tau1), known=self.known.with_memory(tau1))

    @cached_property
    def controller(self) -> FeedbackTorque | RecordedTorque:
        """The torque of the control law.

        Returns
        -------
        FeedbackTorque or RecordedTorque
            Of a feedback law, with the flow speed that it would have as built: an estimate, if the
            law has no sensor of it. Of an open loop, the history that the
            checks of the run replay, with a feedback that holds the speed of an unstable rotor.
        """
        law = self.physics.law
        if not law.is_feedback:
            table = self.solution.trajectory
            nodes = {name: table[QUANTITIES[name].column] for name in TRAJECTORY}
            return RecordedTorque.of(self.known, nodes, law.torque_limit)
        estimate = FlowEstimate(self.known) if law.estimates_flow else None
        return FeedbackTorque(law, self.gains, estimate)

    def steady(self, flow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the flows in which the rotor turns steadily under its feedback law, and how fast.

        Parameters
        ----------
        flow : numpy.ndarray, shape (n_flows,)
            Speeds of the flow, m/s.

        Returns
        -------
        flow, speed : numpy.ndarray, shape (n_running,)
            Those in which there is a balance of torques, m/s, and the rotor speeds, rad/s.
        """
        speed, running, _ = equilibria(self.plant, FeedbackTorque(self.law, self.gains), flow)
        return flow[running], speed[running]

    def initial_speed(self, inflow, time=0.0):
        """Return the rotor speed at which the design begins in another flow.

        It is that of the design's first tip speed ratio; of a design of steady flow under feedback,
        and under a law with states, that of the equilibrium, if there is one.

        Parameters
        ----------
        inflow : Inflow
            The flow.
        time : float or array
            Times, s, of any shape.

        Returns
        -------
        float or array
            Rotor speeds, rad/s, of the shape of the times.
        """
        ratio, flow = self.solution.trajectory["tip_speed_ratio"][0], inflow.speed_at(time)
        speed = ratio * flow / self.plant.blade.rotor_radius
        if self.law.states or (self.solution.steady and self.law.is_feedback):
            balanced, running, _ = equilibria(self.plant, self.controller, np.atleast_1d(flow))
            speed = np.where(running, balanced, speed).reshape(np.shape(flow))[()]
        return speed

    def refuse_standstill(self, inflow: Inflow) -> None:
        """Refuse a flow in which the machine does not operate throughout.

        Parameters
        ----------
        inflow : Inflow
            The flow.

        Raises
        ------
        InputError
            If this flow, or that over time of an open loop's design, exceeds the cut-out speed, or
            this one has no course over time. The cut-out of a year's design is one of mean speeds,
            through whose gusts the machine operates.
        """
        case = self.physics.case
        if inflow.steady and self.law.is_feedback:
            problem = "is a resource, which has no flow over time"
            remedy = "give another flow, such as --flow '{profile: sine}'"
            raise InputError(problem, remedy, key="inflow")
        if inflow.steady or (case.inflow.steady and not self.law.is_feedback):
            problem = "has no torque for other flows than those of the design"
            raise InputError(problem, "give a design under a feedback law", key="control.law")
        cut_out, duration = case.control.cut_out, in_flow(case, inflow).phase.duration
        if cut_out is None or case.inflow.steady:
            return
        flows = [inflow] if self.law.is_feedback else [inflow, self.physics.inflow]
        if any(np.sum(np.diff(x.spans_below(cut_out, duration))) < duration for x in flows):
            problem = "stops the machine in this flow, or an open loop's in the design's own flow; "
            problem += "a design is simulated through one interval of operation only"
            remedy = "give a flow that stays below it, or a design under a feedback law"
            raise InputError(problem, remedy, key="control.cut_out", value=cut_out)

    def simulate(self, inflow: Inflow, initial_speed=None, tolerance=1e-9, refined=1) -> Simulation:
        """Integrate the design in a flow with direct BEM and a perfect, unfiltered sensor.

        Parameters
        ----------
        inflow : Inflow
            The flow.
        initial_speed : float or None
            Rotor speed at t = 0, rad/s; None: `initial_speed`.
        tolerance : float
            As of `simulate`.
        refined : int
            Into how many steps a segment is divided at least.

        Returns
        -------
        Simulation
            The run over the time span of `in_flow`.
        """
        self.refuse_standstill(inflow)
        phase = in_flow(self.physics.case, inflow).phase
        time = Scenario(inflow, phase).resolved().dense
        step = phase.duration / phase.segments / refined
        start = self.start(inflow, initial_speed or self.initial_speed(inflow))
        return simulate(self.plant, inflow, self.controller, start, time, step, tolerance)

    def start(self, inflow, speed, time=0.0):
        """Return the values with which a simulation begins, the law's states in equilibrium.

        Parameters
        ----------
        inflow : Inflow
            The flow.
        speed : float
            Rotor speed, rad/s.
        time : float
            Time of the start, s.

        Returns
        -------
        ndarray, shape (1 + n_states,)
            Speed and states; an open loop has no states.
        """
        if not self.law.states:
            return np.array([speed])
        _, _, states = equilibria(self.plant, self.controller, inflow.speed_at(np.array([time])))
        return np.append(speed, states[:, 0])


def in_flow(case: Case, inflow: Inflow) -> Case:
    """Return the case of a design in another flow.

    Its time span is the flow's own where it has one, such as a record, and is not the design's; for
    a resource, and for the design of a year, always the flow's. An open loop replays the time span
    of the design.

    Parameters
    ----------
    case : Case
        The case of the design.
    inflow : Inflow
        The flow.

    Returns
    -------
    Case
        With numbers for duration and segments.
    """
    other = inflow.length and inflow.model_dump() != case.inflow.model_dump()
    if case.inflow.steady or (other and case.control.law != "open_loop"):
        phase = case.phase.model_copy(update={"duration": None, "segments": None})
        case = case.model_copy(update={"inflow": inflow, "phase": phase})
    return complete(case)
