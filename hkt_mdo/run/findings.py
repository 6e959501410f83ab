"""A case's starting blade in its flow, and the size of its optimization.

What is found needs no optimizer: blade element momentum theory, quasi-steady operation, and
problems of few segments that are built to be counted and timed.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from timeit import repeat

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.dynamics.flows import ConstantInflow
from hkt_mdo.dynamics.simulation import Plant
from hkt_mdo.problem.build import assemble
from hkt_mdo.problem.physics import BEM, Physics
from hkt_mdo.problem.setup import Setup, find_start
from hkt_mdo.problem.start import StartingPoint
from hkt_mdo.problem.turbine import Turbine, build_turbine
from hkt_mdo.rotor import bem
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.rotor.shape import spline_basis
from hkt_mdo.rotor.steady_optimum import SteadyOptimum, best_operation
from hkt_mdo.run.words import powers, span

MARGIN = 0.7, 1.3  # times the best tip speed ratio: where a rotor may come while it is designed
MOST_INSTANTS = 2**17  # at which the flow is looked at
MOST_START_SEGMENTS = 2000  # in which the starting blade's operation is looked at
TRIAL_SEGMENTS = 20, 200  # of the two problems that are built to count and to time


@dataclass(frozen=True)
class ProblemSize:
    """Size of an optimization: unknowns and constraints by their names in the OpenMDAO problem.

    `nodes` is where the rotor's equation is evaluated; `evaluation_seconds` is the time of the
    model and its total derivatives on this machine.
    """

    unknowns: dict[str, int]
    constraints: dict[str, int]
    nodes: int
    evaluation_seconds: float


@dataclass(frozen=True, eq=False)
class Findings:
    """A case's flow, and its starting blade in it, in SI units.

    `turbine` has the blade of the file, which splines may have left; `plant` is the rotor with the
    starting blade, as it would be simulated. `time` and `speed`, shape (n,), are even instants of
    the whole duration and the flow then. `best` is the largest power coefficient of the starting
    blade, `start` its quasi-steady operation over the flow under the control law, with the
    quantities `at_start` (`Physics.on_start`), and `steady` its operation in the mean flow.
    """

    physics: Physics
    turbine: Turbine
    plant: Plant
    mass: float
    time: np.ndarray
    speed: np.ndarray
    best: SteadyOptimum
    start: StartingPoint
    at_start: dict
    steady: StartingPoint

    @property
    def case(self) -> Case:
        """The case, complete."""
        return self.physics.case

    def average(self, values: np.ndarray) -> float:
        """Return the mean over time of values at the instants."""
        return float(np.trapezoid(values, self.time) / self.time[-1])

    def torque(self, rotor_speed: float, flow_speed: float) -> float:
        """Return the torque (N*m) of the starting blade at speeds in rad/s and m/s."""
        return float(self.plant.torque(np.array([rotor_speed]), np.array([flow_speed]))[0])

    def places(self, chosen=slice(None)) -> str:
        """Return in words where stations of the starting blade lie."""
        return f"r/R = {span(self.physics.blade.r[chosen] / self.physics.blade.tip_radius)}"

    @cached_property
    def mean(self) -> float:
        """Mean of the flow speed."""
        return self.average(self.speed)

    @property
    def deviation(self) -> float:
        """Standard deviation of the flow speed."""
        return float(np.sqrt(self.average((self.speed - self.mean) ** 2)))

    @property
    def cutoff(self) -> float:
        """Highest frequency that matters in the flow, Hz; 0 where it is steady."""
        return self.physics.inflow.highest_frequency or 0.0

    @cached_property
    def rated_speed(self) -> float | None:
        """Flow speed at which the torque limit is met at the best tip speed ratio.

        0.5 rho pi R³ Cq v² = torque, by iteration, for Cq depends on v where polars follow the
        Reynolds number. Infinite where the rotor has no torque; None without a limit.
        """
        limit, flow = self.physics.torque_limit, 1.0
        if limit is None:
            return None
        for _ in range(50):
            found = self.torque(
                self.best.tip_speed_ratio * flow / self.plant.blade.rotor_radius, flow
            )
            if found <= 0.0:
                return np.inf
            before, flow = flow, flow * float(np.sqrt(limit / found))
            if abs(flow - before) <= 1e-12 * flow:
                break
        return flow

    @property
    def above_rated(self) -> float:
        """Share of the time in which the flow is faster than the rated speed."""
        rated = np.inf if self.rated_speed is None else self.rated_speed
        return self.average(np.where(self.speed > rated, 1.0, 0.0))

    @property
    def captured(self) -> float:
        """Energy of the start over that at the largest power coefficient throughout."""
        density, radius = self.physics.density, self.physics.blade.rotor_radius
        passing = self.average(power_scale(density, radius, self.speed)) * self.time[-1]
        most = max(self.best.power_coefficient, 1e-9) * passing
        return float(self.start.operation.energy / most)

    @property
    def working(self) -> tuple[float, float]:
        """Tip speed ratios of the start; `MARGIN` round the best one if it does not turn."""
        if not self.start.operation.running:
            return tuple(side * self.best.tip_speed_ratio for side in MARGIN)
        ratios = self.at_start["tip_speed_ratio"]
        return float(ratios.min()), float(ratios.max())

    @property
    def steady_speed(self) -> float:
        """Rotor speed at which the law holds the mean flow, if the rotor turns there."""
        return float(self.steady.operation.rotor_speed[0])

    @property
    def time_constant(self) -> float | None:
        """Time constant in the mean flow; None if the rotor does not turn there."""
        if not self.steady.operation.running:
            return None
        law, speed, slope = self.physics.law, self.steady_speed, 0.0
        if law is not None:
            slope = float(law.torque_by_speed(np.array([speed]), self.steady.gains)[0])
        return self.relaxation(speed, self.mean, slope)

    def relaxation(self, rotor_speed: float, flow_speed: float, control_slope: float) -> float:
        """Return the time constant (s) near an equilibrium (rad/s, m/s).

        I dw/dt = Q(w, v) - u(w), linearized: I / (du/dw - dQ/dw), where `control_slope` is du/dw
        (N*m*s/rad), zero for a torque that does not follow the speed. Negative where the
        equilibrium is unstable.
        """
        step = 1e-4 * rotor_speed
        faster = self.torque(rotor_speed + step, flow_speed)
        slower = self.torque(rotor_speed - step, flow_speed)
        return self.plant.inertia / (control_slope - (faster - slower) / (2.0 * step))


def examine(physics: Physics) -> Findings:
    """Put the starting blade of a case into its flow, that of the first scenario."""
    case, blade, inflow = physics.case, physics.blade, physics.inflow
    duration, cutoff = case.phase.duration, inflow.highest_frequency or 0.0
    instants = int(np.clip(16.0 * duration * cutoff, 2048, MOST_INSTANTS)) + 1
    time = np.linspace(0.0, duration, instants)
    speed = np.asarray(inflow.speed_at(time))
    mean = float(np.trapezoid(speed, time) / duration)
    mass, inertia = physics.mass_and_inertia(blade)
    plant = Plant(blade, physics.polar, inertia, physics.density, BEM[case.hydrodynamics.check])
    best = best_operation(blade, physics.polar)
    coarse = _on_mesh(physics, segments=min(case.phase.segments, MOST_START_SEGMENTS))
    start = find_start(coarse, best, improve=False)
    steady_flow = replace(coarse.scenarios[0], inflow=ConstantInflow(speed=mean))
    law = physics.law and physics.law.model_copy(update={"gain": tuple(start.gains)})
    steady = find_start(replace(coarse, scenarios=(steady_flow,), law=law), best, improve=False)
    turbine = build_turbine(case.rotor, case.fluid, mean)
    (at_start,) = coarse.on_start(start)
    return Findings(physics, turbine, plant, mass, time, speed, best, start, at_start, steady)


def _on_mesh(physics: Physics, **mesh) -> Physics:
    """Return the physics with its first scenario alone, on another mesh."""
    scenario = physics.scenarios[0]
    return replace(
        physics, scenarios=(replace(scenario, mesh=scenario.mesh.model_copy(update=mesh)),)
    )


# What the stations meet ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Stations:
    """What the stations of the starting blade meet, beside the tables of their polars.

    Shape (2, n_stations), lowest and highest: angles of attack (rad) `met` in the blade's operation
    and those of the polars' tables, `table`; `reynolds` in the slowest and the fastest flow. Shape
    (n_stations,): `unsolved` where there is no solution; `share` of the torque, without signs, the
    largest over the operation.
    """

    met: np.ndarray
    table: np.ndarray
    reynolds: np.ndarray
    unsolved: np.ndarray
    share: np.ndarray


def meet(found: Findings) -> Stations:
    """Run the starting blade by BEM over its tip speed ratios."""
    blade, polar, cosine = (
        found.physics.blade,
        found.physics.polar,
        np.cos(found.physics.blade.cone),
    )
    working = bem.sections(blade, polar, np.linspace(*found.working, 31) / cosine)
    angles = working.angle_of_attack
    tables = [polars_at(polar, station) for station in range(blade.r.size)]
    lowest = [max(polar.alpha_min for polar in table) for table in tables]
    highest = [min(polar.alpha_max for polar in table) for table in tables]
    ratio = np.array(found.working)[:, None] / cosine * blade.r / blade.tip_radius
    flow = np.array([[found.speed.min()], [found.speed.max()]]) * cosine
    torque = np.abs(bem.torque_weights(blade) * working.tangential_load)
    return Stations(
        met=np.stack((angles.min(axis=0), angles.max(axis=0))),
        table=np.array((lowest, highest)),
        reynolds=blade.chord * flow * np.hypot(1.0, ratio) / found.case.fluid.kinematic_viscosity,
        unsolved=np.any(working.branch < 0, axis=0),
        share=np.max(torque / torque.sum(axis=1, keepdims=True), axis=0),
    )


def polars_at(polar, station: int) -> tuple[Polar, ...]:
    """Return the polars of a station, one a Reynolds number."""
    if isinstance(polar, bem.LocalReynolds):
        return polar.polars[station]
    return (bem.polar_at(polar, station),)


# Size ---------------------------------------------------------------------------------------------


def problem_size(physics: Physics, best: SteadyOptimum) -> ProblemSize:
    """Return the size of an optimization over the first scenario, and the time of one evaluation.

    Two problems of 20 and 200 segments are built, or of all where that is fewer, and carried on:
    unknowns, constraints and the time of an evaluation grow linearly in the segments; Dymos' set-up
    does not, and would take longest.
    """
    segments = physics.case.phase.segments
    few, many = (min(count, segments) for count in TRIAL_SEGMENTS)
    small, large = (_trial(physics, best, count) for count in (few, many))
    share = 0.0 if few == many else (segments - many) / (many - few)

    def carried(before, after):
        return {name: round(n + share * (n - before[name])) for name, n in after.items()}

    seconds = large[2] + share * max(large[2] - small[2], 0.0)
    nodes = physics.scenarios[0].nodes_per_segment * segments
    return ProblemSize(carried(small[0], large[0]), carried(small[1], large[1]), nodes, seconds)


def _trial(physics, best, segments) -> tuple[dict[str, int], dict[str, int], float]:
    """Return unknowns and constraints by name of a problem of fewer segments, and its time, s."""
    phase = physics.case.phase
    part = _on_mesh(physics, segments=segments, duration=phase.duration * segments / phase.segments)
    nodes = best.tip_speed_ratio * np.linspace(0.5, 1.6, 80)
    problem = assemble(part, Setup(find_start(part, best, improve=False), nodes))
    problem.final_setup()
    problem.run_model()
    driver = problem.driver
    unknowns, constraints = driver.get_design_var_values(), driver.get_constraint_values()
    responses = [*driver.get_objective_values(), *constraints]
    totals = problem.model.linear_solver.totals(driver, responses)
    totals.compute()
    seconds = min(repeat(lambda: (problem.run_model(), totals.compute()), number=1, repeat=3))
    problem.cleanup()
    sizes = ({name: x.size for name, x in each.items()} for each in (unknowns, constraints))
    return *sizes, seconds


# Data of the figures ------------------------------------------------------------------------------


def figure_data(found: Findings, met: Stations) -> dict[str, dict]:
    """Return what `hkt_mdo.results.check_plots.check_figures` draws, by the name of the figure."""
    ratios = np.linspace(0.2, 1.9, 171) * found.best.tip_speed_ratio
    power = bem.rotor_coefficients(found.physics.blade, found.physics.polar, ratios).power
    return {
        "blade": _blade_data(found),
        "polar": {
            "curves": list(_polar_curves(found)),
            "met_deg": np.rad2deg([met.met.min(), met.met.max()]),
        },
        "inflow": _inflow_data(found),
        "power_curve": {
            "tip_speed_ratio": ratios,
            "power_coefficient": power,
            "best": (found.best.tip_speed_ratio, found.best.power_coefficient),
            "working": found.working if found.start.operation.running else None,
        },
    }


def _blade_data(found: Findings) -> dict:
    """Return the starting blade, and control points beside the file's blade where there are any."""
    shape, blade, given = found.physics.shape, found.physics.blade, found.turbine.blade
    data = {
        "r_m": blade.r,
        "ends_m": (blade.hub_radius, blade.tip_radius),
        "chord_m": blade.chord,
        "twist_deg": np.rad2deg(blade.twist),
        "thickness_percent": 100.0 * np.broadcast_to(found.turbine.thickness, blade.r.shape),
    }
    chord, twist = shape.control(blade)
    for name, points, control, file in (
        ("chord_m", shape.points["chord"], chord, given.chord),
        ("twist_deg", shape.points["twist"], np.rad2deg(twist), np.rad2deg(given.twist)),
    ):
        if shape.designs_chord and points < blade.r.size:
            # they stand where their own spline is the radius itself
            dense = np.linspace(blade.hub_radius, blade.tip_radius, 8 * points)
            basis = spline_basis(points, dense, blade.hub_radius, blade.tip_radius)
            places = np.linalg.lstsq(basis, dense, rcond=None)[0]
            data |= {f"{name}_points": (places, control), f"{name}_file": file}
    return data


def _polar_curves(found: Findings):
    """Yield the different polars, root to tip."""
    blade, polar = found.physics.blade, found.physics.polar
    groups: dict[tuple[Polar, ...], list[int]] = {}
    for station in range(blade.r.size):
        groups.setdefault(polars_at(polar, station), []).append(station)
    alpha = np.linspace(-40.0, 50.0, 361)
    for tables, where in groups.items():
        label = "all stations" if len(groups) == 1 else found.places(where)
        for index, table in enumerate(tables):
            number = ""
            if isinstance(polar, bem.LocalReynolds):
                number = f", Re {powers(np.exp(polar.log_reynolds[index]))}"
            lift, drag = table.evaluate(np.deg2rad(alpha))
            yield {
                "label": label + number,
                "alpha_deg": alpha,
                "lift": lift,
                "drag": drag,
                "table_deg": np.rad2deg([table.alpha_min, table.alpha_max]),
            }


def _inflow_data(found: Findings) -> dict:
    """Return the flow, thinned for drawing, and its spectrum."""
    thin = -(-found.time.size // 20_000)
    data = {
        "time_s": found.time[::thin],
        "speed_m_s": found.speed[::thin],
        "mean_m_s": found.mean,
        "rated_m_s": found.rated_speed,
        "cutoff_hz": found.cutoff or None,
    }
    if found.deviation > 1e-9 * found.mean:
        data["spectrum"] = power_spectrum(found.speed, float(found.time[1]))
    return data


def power_spectrum(speed: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (Hz) and the one-sided power spectral density (m²/s² per Hz) of a flow.

    A periodogram of even samples (m/s), `step` (s) apart, under Hann's window after the mean is
    taken out, averaged over twelfths of an octave.
    """
    window = np.hanning(speed.size)
    rest = speed - window @ speed / window.sum()
    density = 2.0 * step * np.abs(np.fft.rfft(rest * window))[1:] ** 2 / np.sum(window**2)
    frequency = np.fft.rfftfreq(speed.size, step)[1:]
    band = np.floor(12.0 * np.log2(frequency / frequency[0]) + 1e-9).astype(int)
    _, band, count = np.unique(band, return_inverse=True, return_counts=True)
    return np.bincount(band, frequency) / count, np.bincount(band, density) / count
