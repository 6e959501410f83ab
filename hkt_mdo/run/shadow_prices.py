"""The gain by one per cent more of a limit at an optimum, to first order."""

from dataclasses import replace

import numpy as np

from hkt_mdo.dynamics.rotor_ode import FeedbackComp
from hkt_mdo.problem.operation_group import between_of, constraint_of
from hkt_mdo.run.checks import Checked
from hkt_mdo.solve.multipliers import State, gain, multipliers

MORE = 1e-2  # share of the limit for which the shadow price is reported
STEP = 1e-5  # of the limit, by which it is changed: a law saturates steeply
FAR = 0.05  # relative distance from its bound beyond which the shadow price of a limit is zero


def shadow_prices(optimum: Checked) -> dict[str, float]:
    """Return by how much the objective (J) of an optimum grows with one per cent more of a limit.

    For each limit over time that has an upper bound, by name: from the multipliers of the optimum
    and the problem with a little more of the limit, at the same design. Empty where the optimizer
    did not converge.
    """
    physics, result = optimum.physics, optimum.result
    if not (physics.objective.is_energy and result.outcome.success):
        return {}
    pairs = [
        (limit, run.at_nodes)
        for run in optimum.verifications
        for limit in run.scenario.limits
        if limit.caps_series
    ]
    near = {limit.name for limit, series in pairs if np.any(limit.excess(series) >= -FAR)}
    limits = {limit.name: limit for limit, _ in pairs}
    if not near:
        return dict.fromkeys(limits, 0.0)
    state = State.of(result.problem.driver)
    multiplier = multipliers(result.problem.driver, state)

    def shadow_price(limit):
        if physics.law.is_feedback and not limit.constrains(physics.law):  # a law holds it
            changed = _with_other_saturation(result.problem)
        else:
            changed = _with_more(result, limit, state)
        return MORE / STEP * gain(state, multiplier, changed)

    return {name: shadow_price(limit) if name in near else 0.0 for name, limit in limits.items()}


def _with_more(result, limit, optimum) -> State:
    """Return an optimum's state with bounds that are a little wider for a limit."""
    physics = result.physics
    lower, upper = optimum.lower.copy(), optimum.upper.copy()
    for number, scenario in enumerate(physics.scenarios):
        if limit.name not in {each.name for each in scenario.limits}:
            continue
        names = constraint_of(physics, limit, number), f"{between_of(scenario, limit)}.value"
        if not limit.constrains(physics.law):  # the bounds of a control
            names = (f"traj.{scenario.name}.controls:control_torque",)
        for rows in (optimum.rows[name] for name in names if name in optimum.rows):
            more = STEP * np.max(np.abs(upper[rows]))  # where it is not lowered
            upper[rows] += more
            lower[rows] -= np.where(lower[rows] < 0.0, more, 0.0)  # of a range about zero
    return replace(optimum, lower=lower, upper=upper)


def _with_other_saturation(problem) -> State:
    """Return the state with a law that saturates at a little more torque; the model is restored."""
    components = list(problem.model.system_iter(typ=FeedbackComp))
    laws = [component.law for component in components]
    try:
        for component, law in zip(components, laws, strict=True):
            component.law = law.model_copy(update={"torque_limit": (1.0 + STEP) * law.torque_limit})
        problem.run_model()
        return State.of(problem.driver)
    finally:
        for component, law in zip(components, laws, strict=True):
            component.law = law
        problem.run_model()
