"""The co-design problem without time, whose optimum is the start of that over time.

A rotor's time constant is a few hundredths of a second and a flow changes over many seconds, so the
rotor is nearly in equilibrium at every instant. What a case asks for is then a problem over the
speeds of its flow, a few for each scenario (`hkt_mdo.problem.equilibrium`), with the same turbine,
law, limits and objective. It takes a second where the problem over time takes many.
"""

from dataclasses import replace

import numpy as np

from hkt_mdo.case.design import InflowDynamics
from hkt_mdo.dynamics.laws import OpenLoop
from hkt_mdo.dynamics.limits import SLOWED
from hkt_mdo.dynamics.resource import DurationCurve
from hkt_mdo.problem.build import BARRIER, assemble, point_of
from hkt_mdo.problem.equilibrium import SteadyScenario
from hkt_mdo.problem.evaluation import broken_limits, split, torque_of
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import START_EXCESS, StartingPoint
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.solve import drivers
from hkt_mdo.start.steady_flow import in_speeds

ITERATIONS, TOLERANCE = 150, 1e-6  # of one optimization: a start need not be an exact optimum
TIE = 1e-5  # share of the objective by which optima without time may differ and tie
ROUNDS, CURVE_ERROR = 3, 1e-4  # optimizations until the torque curve is that of the blade
# iterations after which one that is behind a rival by a share ends: four fifths of the time of
# `two_flows`
PATIENCE, BEHIND = 40, 0.1
# share of a torque curve's error that finer nodes leave where they do not help: at a jump within
# the operation, whose nodes took a third of the time of `all_oloc`; beside it they help (IEA 3.4 MW
# with `quadratic`, `make verify PART=real`)
KEPT = 0.7
# barrier over that of an optimization over time, under an open loop, which is far from its optimum:
# half of the evaluations of `all_oloc`, three quarters of those of ten random turbines
FAR = 30.0
LEAST_SHARE = 1e-6  # of the time, of a speed at which only limits count


def without_time(physics: Physics) -> Physics:
    """Return the physics whose flows have no time, with the same power and the same ends.

    The objective is that of starts, wakes have no memory and a designed hub is held, since its
    inertia has no effect in equilibrium. BEM is the vectorized one.
    """
    law, case = physics.law, physics.case
    if law.chooses_torque:
        law = OpenLoop(torque_limit=law.largest_torque, cut_out=law.cut_out)
    design = case.design
    if physics.designs_hub:
        held = 2 * (physics.blade.hub_inertia,)
        design = design.model_copy(update={"hub_inertia_bounds": held, "hub_inertia_price": 0.0})
    hydrodynamics = case.hydrodynamics.model_copy(update={"bem": "vectorized"})
    update = {"inflow_dynamics": InflowDynamics(), "design": design, "hydrodynamics": hydrodynamics}
    return replace(
        physics,
        case=case.model_copy(update=update),
        scenarios=tuple(each if each.steady else _in_speeds(each) for each in physics.scenarios),
        law=law,
        objective=physics.start_objective,
    )


def _in_speeds(scenario) -> SteadyScenario:
    """Return a scenario as a few speeds of its flow, each for its share of the time."""
    speeds, times = in_speeds(scenario.speeds, scenario.sample_weights)
    times = np.maximum(times, LEAST_SHARE * np.sum(scenario.sample_weights))
    curve = DurationCurve(speeds=tuple(speeds), ends=(0.0, *np.cumsum(times)))
    names = "mesh", "weight", "name", "limits", "interval_of", "turbine"
    attributes = {name: getattr(scenario, name) for name in names}
    return SteadyScenario(curve, resource=curve, **attributes)


class _Hopeless(Exception):
    """An optimization that cannot become the best."""


def co_designed(
    steady: Physics, point: StartingPoint, rival=-np.inf, slowed=SLOWED
) -> StartingPoint:
    """Return the optimum without time that is reached from a point.

    Parameters
    ----------
    steady : Physics
        Without time.
    point : StartingPoint
        Blade, gains and operation at its speeds, which need not be in balance under its law.
    rival : float
        Objective of another optimum. What is far behind it after some iterations is given up.
    slowed : float
        Share of its speed that a rotor under feedback may lose and still recover from.

    Returns
    -------
    StartingPoint
        With objective and excess; it has the branch and the strategy of the point. An error of its
        torque curve is an excess only beyond `CURVE_ERROR`: it decided between blades that tie.
    """
    for _ in range(ROUNDS):
        point, given_up, stops = optimized(steady, point, rival, slowed)
        error = _curve_error(steady, point)
        done = not stops and error <= CURVE_ERROR and point.excess <= START_EXCESS
        if done or given_up:
            break
    return point if done else replace(point, excess=max(point.excess, error))


def optimized(
    physics: Physics, point: StartingPoint, rival=-np.inf, slowed=SLOWED, free=False
) -> tuple[StartingPoint, bool, bool]:
    """Return the end of one optimization by the point's torque curve.

    And whether it was given up, and whether it ended as far from the point as it may go, or, under
    an open loop, before an optimum: with a gap above `TIE` (1.6e-4 of turbine 9 of `make verify
    PART=turbines`). Not under feedback: turbine 26, whose blades tie with `rated`, lost 0.6 %.

    The parameters are those of `co_designed`; the physics may have time. `free` tells whether the
    optimization may go far from the point, for which it has twice the iterations: where `rated` had
    not ended, `curve`, which began there, ended 0.1 % below it (turbine 11 of `make verify
    PART=turbines`).
    """
    count, sign = sum(each.segments for each in physics.scenarios), physics.objective.sign

    def progress(iteration, objective, violation):
        if iteration >= PATIENCE and sign * objective < rival - BEHIND * abs(rival):
            raise _Hopeless

    open_loop, most = not physics.law.is_feedback, (2 if free else 1) * ITERATIONS
    ipopt = drivers.near_start(BARRIER * (FAR if open_loop else 1.0) / count)
    # without equations, corrections for their curvature only cost time
    ipopt |= {"max_soc": 0} if open_loop else {}
    driver = drivers.make_driver("casadi", "IPOPT", TOLERANCE, most, ipopt=ipopt, progress=progress)
    # a year does not pass a jump between its flows, and beside it nodes help
    share = KEPT if any(each.steady and each.bins is None for each in physics.scenarios) else np.inf
    setup = Setup(point, curve_nodes(physics, point, share), near=not free, slowed=slowed)
    problem = assemble(physics, setup, driver)
    given_up = False
    try:
        problem.run_model()
        problem.run_driver()
    except _Hopeless:
        given_up = True
    end, excess = point_of(physics, problem), driver.violation()
    exceeds = broken_limits(physics, end) or ["balance_of_torques"] * (excess > START_EXCESS)
    objective = sign * float(problem.get_val("objective")[0])
    end = replace(end, objective=objective, excess=excess, exceeds=tuple(exceeds))
    end = replace(end, strategy=point.strategy, branch=point.branch)
    return end, given_up, (open_loop and driver.gap > TIE) or setup.stops(physics, end)


def _curve_error(steady: Physics, end: StartingPoint) -> float:
    """Return the largest relative error of the torque at an end, which is that of a curve."""
    worst = 0.0
    operations = split(steady, end.operation) if steady.has_curve else ()
    for scenario, (speed, torque, *_) in zip(steady.scenarios, operations, strict=False):
        exact = torque_of(steady.rotor_in(scenario), end.blade, speed, scenario.speeds)
        worst = max(worst, float(np.max(np.abs(torque - exact)) / np.max(np.abs(exact))))
    return worst
