"""The findings of a check, without an optimizer: starting blade, flows, size of the problem."""

from collections.abc import Iterator

import numpy as np
import openmdao.api as om

from hkt_mdo.dynamics.equilibrium import equilibria
from hkt_mdo.dynamics.simulation import FeedbackTorque
from hkt_mdo.dynamics.stability import Loop
from hkt_mdo.problem.build import assemble
from hkt_mdo.problem.evaluation import loads_along, on_start, steady_plant
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.setup import Setup
from hkt_mdo.quantities import OVER_TIME
from hkt_mdo.results.words import Row, measured, number, powers
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.run.checks import energy_bound
from hkt_mdo.run.verification import HeldSpeeds
from hkt_mdo.start.find import find_start
from hkt_mdo.start.result import GIVEN, given_designs

# range over the best tip speed ratio in which a rotor may operate during the design
MARGIN = 0.7, 1.3
MOST_INSTANTS = 2**17  # at which the flow is looked at
LIGHT = 0.02  # share of the torque below which stations outside their polars' tables are a note
BRAKING = 0.1  # of the driving torque, from which parts that brake are a warning: river25_short
# radius of the outer stations over that of the last one, and the factor by which their Reynolds
# number may differ from that of the polars
OUTER, FAR_REYNOLDS = 0.6, 3.0


class Stations:
    """Flow at a blade's stations between two tip speed ratios, `working`, by BEM.

    Attributes
    ----------
    blade : Blade
        The blade.
    working : tuple of float
        Lowest and highest tip speed ratio.
    polars : sequence of tuple of Polar
        Of each station, one a Reynolds number.
    met, table : ndarray, shape (2, n_stations)
        Lowest and highest angle of attack in operation, and of the polars' tables, rad.
    unsolved : ndarray, shape (n_stations,)
        Where BEM has no solution.
    torque : ndarray, shape (n, n_stations)
        Part of the torque coefficient at each tip speed ratio.
    reynolds : ndarray, shape (2, n_stations)
        Reynolds numbers at both ratios, in the slowest and the fastest flow.
    numbers, used, follows_reynolds
        Reynolds numbers of the polars' tables, those in use, and whether they follow the flow.
    """

    def __init__(self, physics: Physics, blade: Blade, working: tuple[float, float]):
        polar, turbine = physics.rotor.polar, physics.turbine
        numbers = {n for each in turbine.sections for n in each.polars.reynolds if np.isfinite(n)}
        self.numbers, self.used = numbers, turbine.reynolds_number or [*numbers] or np.nan
        self.follows_reynolds, polars = polar.follows_reynolds, polar.stations(blade)
        flow = np.quantile(physics.sampled_flow[0], ((0.0,), (1.0,))) * np.cos(blade.cone)
        ratio = np.array(working)[:, None] * blade.r / blade.rotor_radius
        passing = blade.chord * flow * np.hypot(1.0, ratio)
        self.reynolds = passing / physics.case.fluid.kinematic_viscosity
        sections = bem.sections(blade, polar, np.linspace(*working, 31))
        lowest = [max(table.alpha_min for table in tables) for tables in polars]
        highest = [min(table.alpha_max for table in tables) for tables in polars]
        self.torque = bem.torque_weights(blade) * sections.tangential_load
        self.blade, self.working, self.polars = blade, working, polars
        self.met = np.quantile(sections.angle_of_attack, (0.0, 1.0), axis=0)
        self.table = np.array((lowest, highest))
        self.unsolved = np.any(sections.branch < 0, axis=0)

    def places(self, chosen=slice(None)) -> str:
        """Return in words where some stations lie."""
        return f"r/R = {measured(self.blade.r[chosen] / self.blade.tip_radius, '', 4)}"

    def messages(self, of: str) -> Iterator[Row]:
        """Yield notes and warnings on stations of a blade, `of`: dense, or beyond polars."""
        if np.any(dense := self.blade.blade_count * self.blade.chord > 2.0 * np.pi * self.blade.r):
            text = f"the chords of all blades exceed the circumference at {self.places(dense)}"
            yield Row("rotor.blade", f"{text} of the {of}", severity="warning")
        if np.any(self.unsolved):
            text = f"blade element momentum theory has no solution at {self.places(self.unsolved)}"
            text += f" of the {of}: no load counts there"
            yield Row("rotor.polar", text, severity="warning")
        driving, braking = (np.maximum(x, 0.0).sum(axis=1) for x in (self.torque, -self.torque))
        share = braking / np.maximum(driving, 1e-12)
        if share[worst := int(np.argmax(share))] > BRAKING:
            text = f"{self.places(self.torque[worst] < 0.0)} of the {of} brakes the rotor, by up "
            text += f"to {number(100.0 * share[worst], 2)} % of the torque that drives it"
            yield Row("rotor.blade", text, severity="warning")
        below, above = self.table[0] - self.met[0], self.met[1] - self.table[1]
        over = np.maximum(above, below)
        outside = over > 1e-9
        if np.any(outside):
            torque, worst = np.abs(self.torque), int(np.argmax(over))
            share = float(np.max(torque[:, outside].sum(axis=1) / torque.sum(axis=1)))
            angle = np.rad2deg(self.met[int(above[worst] >= below[worst]), worst])
            table = measured(np.rad2deg(self.table[:, worst]), "deg", 4)
            text = f"{outside.sum()} of the stations of the {of}, at {self.places(outside)}, with "
            text += f"{number(100.0 * share, 2)} % of the torque, are outside the polar's table, "
            text += f"{table}, in Viterna's extension, with angles of attack up to {angle:.3g} deg,"
            text += f" at tip speed ratios of {measured(self.working, '', 3)}"
            yield Row("rotor.polar", text, severity="warning" if share > LIGHT else "note")
        outer = self.blade.r >= OUTER * self.blade.r[-1]
        used, usual = (np.exp(np.mean(np.log(x))) for x in (self.used, self.reynolds[:, outer]))
        if max(used / usual, usual / used) > FAR_REYNOLDS and not self.follows_reynolds:
            text = f"the polars are those of Re {powers(used)}, and the outer stations have "
            text += f"{powers(usual)}: drag and stall may differ"
            yield Row("rotor.polar", text, severity="note")


class Flow:
    """A scenario's flow over its whole duration.

    Attributes
    ----------
    name : str
        Name of the scenario.
    scenarios : sequence of Scenario
        Its intervals or directions; one where it has none.
    share : float
        Its share of time.
    inflow : Inflow
        The flow over time; of a steady scenario a duration curve.
    steady : bool
        Whether it has no time.
    kind : Inflow
        What the case gives.
    duration : float
        How long it lasts, s.
    time, speed, weights : ndarray, shape (n,)
        Even instants, s, the flow speed then, m/s, and its share of the time, but for a factor. Of
        a steady scenario the speeds in operation, those of reversed flow after the others, each in
        the middle of its time.
    range : ndarray, shape (2,)
        Lowest and highest speed, m/s, then and at the samples of the meshes.
    mean, deviation : float
        Mean and standard deviation of the speed, m/s.
    cutoff : float
        Highest frequency, Hz; 0 for a steady flow.
    """

    def __init__(self, physics: Physics, name: str):
        self.name, self.share = name, physics.shares[name]
        self.scenarios = scenarios = [physics.scenarios[i] for i in physics.groups[name]]
        first = scenarios[0]
        self.inflow, self.steady = first.inflow, first.steady
        self.kind = getattr(first, "resource", first.inflow)
        self.duration = first.mesh.duration
        self.cutoff = self.inflow.highest_frequency or 0.0
        speeds = np.concatenate([scenario.speeds for scenario in scenarios])
        if self.steady:
            self.weights = np.concatenate([scenario.sample_weights for scenario in scenarios])
            self.time, self.speed = np.cumsum(self.weights) - 0.5 * self.weights, speeds
        else:
            instants = int(np.clip(16.0 * self.duration * self.cutoff, 2048, MOST_INSTANTS)) + 1
            self.time = np.linspace(0.0, self.duration, instants)
            self.speed = np.asarray(self.inflow.speed_at(self.time))
            self.weights = np.pad(np.ones(instants - 2), 1, constant_values=0.5)
        self.range = np.quantile(np.append(self.speed, speeds), [0.0, 1.0])
        self.mean = self.average(self.speed)
        changes = np.any(self.speed != self.speed[0])  # else it would be that of the rounding
        self.deviation = changes * float(np.sqrt(self.average((self.speed - self.mean) ** 2)))

    def average(self, values: np.ndarray) -> float:
        """Return the mean over time of values at the instants."""
        return float(np.average(values, weights=self.weights))


class Findings:
    """A case's flows, and its starting blade in them, in SI units.

    - `flows`: a `Flow` for each scenario; `mean` and `cutoff` are the mean speed over time
      and the highest of their frequencies, the `fastest` speed in operation.
    - `begins`: the design with which the case begins, its own or that of `start.from`; `plant`: the
      rotor with its blade, as it would be simulated; `given`: the same, or the blade of the file,
      which splines may have left; `best`: its largest power coefficient.
    - `start`: its quasi-steady operation under the control law, if it is `running`; `at_start`: the
      quantities then (`on_start`) and all loads, by scenario; `working`: the tip speed
      ratios, `MARGIN` round the best one if it does not turn; `captured`: its energy over that at
      `best` throughout.
    - `rated_speed` and `above_rated`: flow speed at which the torque limit is met at the best tip
      speed ratio, and share of the time in which the flow is faster.
    - `steady_speed`, `time_constant`: in the mean flow; None if the rotor does not turn there.
    - `growth`: of the closed loop there, 1/s; 0 if the rotor does not turn.
    - `stations`: what the stations meet in `working`.
    """

    def __init__(self, physics: Physics):
        self.physics, self.case = physics, physics.case
        self.begins = given_designs(physics)[0][0]
        self.flows = [Flow(physics, name) for name in physics.groups]
        shares = [flow.share for flow in self.flows]
        self.mean = float(np.average([flow.mean for flow in self.flows], weights=shares))
        self.cutoff = max(flow.cutoff for flow in self.flows)
        fastest = max(float(flow.range[1]) for flow in self.flows)
        self.fastest = min(fastest, self.case.control.cut_out or np.inf)

        blade = self.begins.blade
        self.given = physics.turbine.blade if self.begins.strategy == GIVEN else blade
        self.plant = steady_plant(physics, physics.rotor, blade)
        self.best = physics.rotor.best_operation(blade)
        self.rated_speed = self.rated()
        above = [flow.average(1.0 * (flow.speed > self.rated_speed)) for flow in self.flows]
        self.above_rated = float(np.average(above, weights=shares))
        self._start()
        self._settle()

    def _start(self):
        """Set the quasi-steady operation of the starting blade."""
        physics = self.physics
        self.start = find_start(physics, self.best, improve=False)
        self.running = self.start.operation.running
        series = on_start(physics, self.start)
        if self.running:
            names = tuple(name for name in physics.rotor.load_names if name not in series[0])
            pairs = zip(map(physics.rotor_in, physics.scenarios), series, strict=True)
            series = [x | loads_along(rotor, self.start.blade, x, names) for rotor, x in pairs]
        self.at_start = {}
        for name, places in physics.groups.items():
            parts = [series[index] for index in places]
            over_time = parts[0].keys() & {*OVER_TIME}
            whole = {x: np.concatenate([part[x] for part in parts]) for x in over_time}
            self.at_start[name] = parts[0] | whole
        most = max(energy_bound(physics, self.best), 1e-9)
        self.captured = float(self.start.operation.energy / most)
        ratios = np.array(MARGIN) * self.best.tip_speed_ratio
        if self.running:
            ratios = np.concatenate([x["tip_speed_ratio"] for x in self.at_start.values()])
        self.working = float(ratios.min()), float(ratios.max())
        self.stations = Stations(physics, self.plant.blade, self.working)

    def _settle(self):
        """Set speed and time constant of the starting blade in the mean flow."""
        law, mean = self.physics.law, np.array([self.mean])
        if law.is_feedback:
            controller = FeedbackTorque(law, self.start.gains)
            speed, running, states = equilibria(self.plant, controller, mean)
        else:  # its schedule
            flow, _ = self.physics.sampled_flow
            order, controller = np.argsort(flow), HeldSpeeds(0.0)
            speed = np.interp(mean, flow[order], self.start.operation.rotor_speed[order])
            running, states = self.running, ()
        self.steady_speed, self.time_constant, self.growth = None, None, 0.0
        if np.all(running):
            loop = Loop.of(self.plant, controller, speed, mean, *states)
            self.steady_speed = float(speed[0])
            self.growth = float(loop.growth[0])
            self.time_constant = float(loop.time_constant[0])

    def at_best(self, flow_speed: float) -> tuple[float, float]:
        """Return speed (rad/s) and torque for the generator (N*m) at the best tip speed ratio."""
        speed = self.best.tip_speed_ratio * flow_speed / self.plant.blade.rotor_radius
        torque = self.plant.generator_torque(np.array([speed]), np.array([flow_speed]))
        return speed, float(torque[0])

    def rated(self) -> float:
        """Return the flow speed (m/s) at which the torque limit is met at the best tip speed ratio.

        0.5 rho pi R³ Cq v² = torque, by iteration, for Cq depends on v where polars follow the
        Reynolds number. Infinite without a limit, and where the rotor has no torque.
        """
        limit, flow = self.physics.law.largest_torque, 1.0
        for _ in range(50):
            _, torque = self.at_best(flow)
            if limit is None or torque <= 0.0:
                return np.inf
            flow *= float(np.sqrt(limit / torque))
        return flow


def evaluated_problem(findings: Findings) -> om.Problem:
    """Return the problem of a case at its start.

    The model and its derivatives are evaluated once, so that those of the user's own are checked.
    """
    physics, ratios = findings.physics, findings.best.tip_speed_ratio * np.linspace(0.5, 1.6, 80)
    problem = assemble(physics, Setup(findings.start, ratios))
    problem.run_model()
    driver = problem.driver
    responses = [*driver.get_objective_values(), *driver.get_constraint_values()]
    problem.model.linear_solver.totals(driver, responses).compute()
    return problem
