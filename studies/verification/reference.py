"""The part of the verification study that searches the best quasi-steady design globally."""

import json

import numpy as np
from scipy.optimize import differential_evolution

from hkt_mdo.files.table import write_files
from hkt_mdo.problem.physics import physics
from hkt_mdo.rotor.scales import power_scale
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.start.build import start_of_case
from hkt_mdo.start.steady_flow import SteadyFlow, in_speeds
from studies.study_common import case_file, markdown_table, percent

LIMITS = "power", "rotor_speed", "thrust", "stress", "cavitation", "all"
NODES = 100  # tip speed ratios at which BEM is evaluated for every blade
RATIOS = 100  # tip speed ratios among which a schedule is chosen
SPAN = 0.3, 1.9  # of those, over that of the best steady rotor
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
PRICE = 5.0  # of a limit exceeded by 100 %, over the power of the water
GENERATIONS, POPULATION = 300, 6  # most generations; members for each unknown


class Global:
    """The largest quasi-steady objective of an open loop, over blade and schedule.

    For a blade, the tip speed ratio at each of 32 speeds of the flow is the best of 100,
    and of those about it by golden section. Blades are
    those of the case's own control points, within its bounds. It shares BEM, limits and the flow's
    speeds with the program's search for a start, but no step of the search.
    """

    def __init__(self, case):
        self.physics = physics(case)
        shape = self.physics.shape
        best = self.physics.rotor.best_of_shape(shape, self.physics.blade)
        self.ratios = np.linspace(*SPAN, RATIOS) * best.tip_speed_ratio
        nodes = np.linspace(self.ratios[0], self.ratios[-1], NODES)
        self.steady = SteadyFlow.of(self.physics, TorqueSpline(nodes))
        _, self.weights = in_speeds(*self.physics.sampled_flow)
        self._grid = np.repeat(self.ratios[:, None], self.steady.speeds.size, axis=1)
        self.bounds = [shape.bounds["chord"]] * shape.points["chord"]
        self.bounds += [shape.bounds["twist"]] * shape.points["twist"]

    def __call__(self, unknowns):
        """Return the objective with its sign changed, MJ, of control points of chord and twist."""
        shape, steady = self.physics.shape, self.steady
        chord, twist = np.split(np.asarray(unknowns), [shape.points["chord"]])
        blade = shape.at({"chord": chord, "twist": twist})
        steady._curves.clear()
        price = power_scale(self.physics.density, blade.rotor_radius, steady.speeds) * PRICE

        def worth(ratio):
            """Return the rate less the price of what is exceeded, at ratios (n, n_speeds)."""
            series = steady.along(blade, ratio.ravel(), np.tile(steady.speeds, len(ratio)))
            rate, over = self.physics.start_objective.rate_of(series), steady.excess(series)
            over = np.maximum(over, 0.0).reshape(ratio.shape)
            return rate.reshape(ratio.shape) - price * over

        best = np.clip(np.argmax(worth(self._grid), axis=0), 1, RATIOS - 2)
        low, high = self.ratios[best - 1], self.ratios[best + 1]
        for _ in range(24):  # golden section
            ratio = np.array([high - GOLDEN * (high - low), low + GOLDEN * (high - low)])
            left, right = worth(ratio)
            low, high = np.where(left > right, [low, ratio[1]], [ratio[0], high])
        return -1e-6 * float(self.weights @ worth(0.5 * (low + high)[None])[0])


def reference(study) -> list[str]:
    """Search the best quasi-steady open loop of each set of limits by differential evolution.

    The blade's control points are unknowns within their bounds; at each speed of the flow the best
    tip speed ratio is taken (SciPy's `differential_evolution`, one run for each seed). Goal: the
    program's start is nowhere more than 0.1 % below. Not included is the energy that a rotor stores
    and returns, so an open loop that moves may capture more.
    """
    rows = []
    for name in LIMITS:
        case = case_file(None, f"limits/{name}_oloc")
        problem, ends = Global(case), []
        for seed in range(study.seed, study.seed + study.count):
            file = study.out / "reference" / f"{name}_{seed}.json"
            if not file.exists():
                optimum = differential_evolution(
                    problem,
                    problem.bounds,
                    rng=np.random.default_rng(seed),
                    maxiter=GENERATIONS,
                    popsize=POPULATION,
                    init="sobol",
                    tol=1e-5,
                    polish=False,
                )
                entry = {"objective_J": -1e6 * float(optimum.fun), "evaluations": int(optimum.nfev)}
                file.parent.mkdir(parents=True, exist_ok=True)
                write_files({file: json.dumps(entry | {"unknowns": optimum.x.tolist()}) + "\n"})
                study.done(file, "ok")
            ends.append(json.loads(file.read_text(encoding="utf-8")))
        _, setup = start_of_case(case)
        best = max(end["objective_J"] for end in ends)
        rows.append(
            [
                name,
                f"{1e-3 * best:.3f}",
                f"{1e-3 * setup.start.objective:.3f}",
                f"{percent(setup.start.objective, best):+.3f}",
                f"{sum(end['evaluations'] for end in ends)}",
            ]
        )
    header = "limit", "global search, kJ", "start, kJ", "start over it, %", "blades"
    return markdown_table(header, rows)
