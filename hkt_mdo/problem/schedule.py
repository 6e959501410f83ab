"""The start under limits: blade, gains and operating schedule by quasi-steady co-design together.

A schedule is the tip speed ratio over the speed of the flow. Without limits, or with one of the
torque alone, an open loop's schedule follows from the blade (`hkt_mdo.dynamics.quasi_steady`).
Under other limits it has branches (`hkt_mdo.problem.steady_flow`). Each is a local optimum with a
blade of its own (`hkt_mdo.problem.joint`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hkt_mdo.dynamics.limits import SLOWED
from hkt_mdo.dynamics.quasi_steady import Operation, QuasiSteady
from hkt_mdo.problem.joint import VIOLATION, Joint, Schedule, improve_schedule
from hkt_mdo.problem.physics import START_EXCESS, Physics
from hkt_mdo.problem.start import CoDesign, StartingPoint, start_candidates
from hkt_mdo.problem.steady_flow import BRANCHES, SteadyFlow, has_branches
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.steady_optimum import SteadyOptimum, best_blade
from hkt_mdo.rotor.torque_curve import TorqueSpline

FINE = 400  # flow speeds of a schedule that is given
THINNED = 2  # nodes of the torque curve to one of the curves of loads
APART = 0.01  # relative difference between a ratio and that of the designed schedule
SOLID = 0.45  # of the optimum's tip speed ratio: that of the blade for a constant torque
JUMP = 2.0  # factor of the chord from one station to the next at which a solid part ends
LONGER = 1e-5  # relative gain of the objective that makes a longer one worthwhile
SATURATED = 10.0  # demand over the limit of the torque at which a law's torque is constant


def needed(physics: Physics) -> bool:
    """Tell whether a start needs a schedule: for limits but torque's, or a law that follows it."""
    follows = physics.law is not None and (physics.states or physics.law.coarser() is not None)
    return bool(follows) or has_branches(physics)


def quasi_steady(physics: Physics, optimum: SteadyOptimum, slowed: float = SLOWED) -> QuasiSteady:
    """Return the quasi-steady problem of a case over all its scenarios' flows."""
    scenarios = physics.scenarios
    return QuasiSteady(
        np.concatenate([each.inflow.speed_at(each.samples) for each in scenarios]),
        np.concatenate([each.weight * each.sample_weights for each in scenarios]),
        physics.density,
        physics.blade.rotor_radius,
        TorqueSpline(np.linspace(0.3, 2.6, 161) * optimum.tip_speed_ratio),
        physics.law,
        physics.torque_limit,
        slowed,
        physics.starting_generator,
    )


def schedules(
    physics: Physics, problem: QuasiSteady, optimum: SteadyOptimum, *, improve: bool
) -> tuple[Schedule, ...]:
    """Return the schedule of each branch, the best first.

    `problem` has the whole flow, `optimum` is that of the blades to choose from. Without `improve`,
    blade and gains are as given. A feedback law has the branches of the open loops that its gains
    are fitted to; a branch that leads to another's optimum is left out. Of a branch that is given
    up, far behind the other, the objective is what it had reached.
    """
    if physics.load_names:  # loads cost more than torque
        problem = replace(problem, spline=TorqueSpline(problem.spline.nodes[::THINNED]))
    steady = SteadyFlow.of(physics, problem.spline)
    few = replace(problem, inflow_speed=steady.speeds, weights=steady.weights)
    law, gains = physics.law, physics.law.starting_gains() if physics.law else None
    gain_bounds = physics.case.design.gain_bounds or (-np.inf, np.inf)
    free = replace(few, law=None, torque_limit=physics.torque_limit)
    open_loop = replace(steady, physics=replace(physics, law=None))

    def candidates(of, gains=None):
        found = start_candidates(of, physics.shape, gains, physics.polar, optimum, gain_bounds)
        return list(found) if improve else [next(found)]

    def improved(flow, of, best, others):
        design = CoDesign(of, physics.shape, physics.polar, gain_bounds)
        asked = physics.case.start.branch != "best"  # a branch that is asked for is not given up
        rivals = () if asked else others
        rival = max((each.objective for each in rivals if each.worth[0]), default=-np.inf)
        return improve_schedule(Joint(flow, design, of.slowed), best, rival) if improve else best

    coarser = law.coarser() if law is not None and improve and gains is None else None
    found, tried = [], 0
    if coarser is not None:
        simple = replace(physics, law=coarser), replace(problem, law=coarser)
        found = list(schedules(*simple, optimum, improve=True))
        tried = found[0].tried
    else:
        given, *chosen = candidates(free)
        others = []  # blades of other branches
        for branch in BRANCHES:
            ended = []
            for starts in filter(None, ([given], chosen, others)):  # each may have its own optimum
                best = max((_along(open_loop, start, branch) for start in starts), key=_worth)
                tried += len(starts)
                ended.append(improved(open_loop, free, best, (*found, *ended)))
            found.append(max(ended, key=_worth))
            others.append(StartingPoint(found[-1].blade, np.empty(0), given.operation))
    if law is not None:
        # what has several gains, or follows a schedule, is near the best where it is fitted
        alone = bool(physics.states) or (improve and gains is None and len(law.gain_units) > 1)
        own = [] if alone else [_along(steady, start, "") for start in candidates(few, gains)]
        running = [each for each in found if each.excess < np.inf] or found[:1]
        begun = [_begun(steady, few, each) for each in running] if improve or alone else []
        tried += len(own) + len(begun)
        begun = [*sorted(own, key=_worth)[-1:], *begun]
        if improve and not alone and law.torque_limit is not None and physics.shape.designs_chord:
            begun.insert(0, _along(steady, _at_constant_torque(steady, few, optimum), ""))
            tried += 1
        found = []
        for each in begun:
            found.append(_met(steady, few, improved(steady, few, each, found)))
        best = max(found, key=_worth)
        while improve and not alone and (longer := _longer_solid_part(steady, few, best)):
            again = _met(steady, few, improved(steady, few, longer, found))
            tried += 1
            kept, value = best.worth
            if again.worth <= (kept, value + LONGER * abs(value)):
                break
            found.append(best := again)
    found = [replace(each, branch=_side(steady, each), tried=tried) for each in found]
    found.sort(key=_worth, reverse=True)
    others = [each for each in found[1:] if each.branch != found[0].branch]
    others = [each for each in others[:1] if not each.same_as(found[0])]
    return (found[0], *others)


def _begun(steady, problem, schedule) -> Schedule:
    """Return a law's schedule with the blade of an open loop's, as near to that as it comes."""
    if steady.physics.states:
        return _following(steady, schedule)
    return _along(steady, _fitted(steady, problem, schedule), "")


def _following(steady, schedule) -> Schedule:
    """Return the schedule of a law with states whose gains follow that of an open loop."""
    law, curves, speeds = steady.physics.law, steady.curves(schedule.blade), steady.speeds
    gains, unit = law.starting_gains(), schedule.blade.rotor_radius / speeds
    if gains is None:
        known = steady.met(curves, schedule.ratio)
        slope = steady.spline.values(curves.values["torque"], schedule.ratio)[1] * unit
        slope *= torque_scale(known["density"], known["rotor_radius"], speeds)
        gains = law.follow(speeds, known["rotor_speed"], known["hydrodynamic_torque"], slope)
    ratio = law.speed_at_rest(speeds, gains) * unit
    rate, over = steady.at(curves, ratio)
    value, excess = float(steady.weights @ rate), float(np.max(over))
    return replace(schedule, gains=gains, ratio=ratio, objective=value, excess=excess)


def _met(steady, problem, schedule) -> Schedule:
    """Return a law's schedule, or that which the rotor meets where it is another.

    A law may have several equilibria in a flow: the rotor comes to the fastest, after a run-up.
    """
    if steady.physics.states:
        return schedule
    table = steady.curves(schedule.blade).values["torque"]
    problem = replace(problem, rotor_radius=schedule.blade.rotor_radius)
    operation = problem.operate(table, schedule.gains)
    real = _along(steady, StartingPoint(schedule.blade, schedule.gains, operation), "")
    same = operation.running and np.allclose(real.ratio, schedule.ratio, rtol=APART)
    return schedule if same else real


def _fitted(steady, problem, schedule) -> StartingPoint:
    """Return a law's starting point whose gains are fitted to the schedule of an open loop."""
    physics, curves = steady.physics, steady.curves(schedule.blade)
    known = steady.met(curves, schedule.ratio)
    gains = physics.law.fit(known["rotor_speed"], known["hydrodynamic_torque"])
    gains = np.clip(gains, *(physics.case.design.gain_bounds or (-np.inf, np.inf)))
    problem = replace(problem, rotor_radius=schedule.blade.rotor_radius)
    return StartingPoint(schedule.blade, gains, problem.operate(curves.values["torque"], gains))


def _at_constant_torque(steady, problem, optimum) -> StartingPoint:
    """Return a law's starting point at its torque limit, with a solid blade for a slow rotor.

    At a constant torque the power is proportional to the rotor speed, which varies little with the
    flow if the torque falls steeply with the tip speed ratio: that of solid, slow blades does.
    """
    physics, law = steady.physics, steady.physics.law
    shape, ratio = physics.shape, SOLID * optimum.tip_speed_ratio
    bounds = shape.chord_bounds, shape.twist_bounds
    blade = best_blade(shape.blade, physics.polar, ratio, *bounds, optimum.blade).blade
    blade = shape.nearest(blade)
    torque = steady.curves(blade).values["torque"]
    held = replace(problem, law=None, torque_limit=law.torque_limit).operate(torque)
    demand = np.full(held.rotor_speed.shape, SATURATED * law.torque_limit)
    gains = law.fit(held.rotor_speed, demand)
    gains = np.clip(gains, *(physics.case.design.gain_bounds or (-np.inf, np.inf)))
    return StartingPoint(blade, gains, problem.operate(torque, gains))


def _longer_solid_part(steady, problem, schedule) -> Schedule | None:
    """Return a law's schedule with the solid inner part of its blade a station longer, if any.

    A rotor at a constant torque is solid inboard and slender outboard. How many of its stations are
    solid is a choice between optima: none follows from another by small changes.
    """
    blade, shape = schedule.blade, steady.physics.shape
    chord, twist = blade.chord.copy(), blade.twist.copy()
    jump = chord[1:-2] / chord[2:-1]  # the last station may be as slender as its bounds allow
    if not shape.designs_chord or np.max(jump, initial=0.0) < JUMP:
        return None
    last = 1 + int(np.argmax(jump))
    chord[last + 1] = chord[last] ** 2 / chord[last - 1]
    twist[last + 1] = 2.0 * twist[last] - twist[last - 1]
    blade = shape.nearest(blade.with_shape(chord, twist, blade.thickness))
    problem = replace(problem, rotor_radius=blade.rotor_radius)
    operation = problem.operate(steady.curves(blade).values["torque"], schedule.gains)
    return _along(steady, StartingPoint(blade, schedule.gains, operation), "")


def _side(steady, schedule) -> str:
    """Return the branch of a schedule: where its blade works in the fastest flow."""
    nodes = steady.spline.nodes
    flow = replace(steady, speeds=steady.speeds[-1:], weights=steady.weights[-1:])
    rate, _ = flow.at_nodes(flow.curves(schedule.blade))
    best = nodes[np.argmax(rate)]
    return "overspeed" if schedule.ratio[-1] >= best else "underspeed"


def start_of(physics: Physics, problem: QuasiSteady, found: tuple[Schedule, ...]) -> StartingPoint:
    """Return the first of some schedules as a starting point over the whole flow."""
    best = found[0]
    steady = SteadyFlow.of(physics, problem.spline, FINE)
    curves, flow = steady.curves(best.blade), problem.inflow_speed
    if physics.law is not None:
        whole = replace(problem, rotor_radius=best.blade.rotor_radius)
        if physics.states:
            operation = whole.held(
                curves.values["torque"], physics.law.speed_at_rest(flow, best.gains)
            )
        else:
            operation = whole.operate(curves.values["torque"], best.gains)
    else:
        coarse = SteadyFlow.of(physics, problem.spline).speeds
        guide = np.interp(steady.speeds, coarse, best.ratio)
        sides = np.array([steady.ratios(curves, branch) for branch in BRANCHES])
        nearest = np.argmin(np.abs(sides - guide), axis=0)
        exact = sides[nearest, np.arange(guide.size)]
        # where limits leave a single ratio, the search on a grid does not meet it, or another one
        over, least = steady.at(curves, exact)[1], steady.at(curves, guide)[1]
        far = np.abs(exact / guide - 1.0) > APART
        closed = (over > np.maximum(least, VIOLATION)) | (far & (least <= START_EXCESS))
        ratio = np.interp(flow, steady.speeds, np.where(closed, guide, exact))
        known = steady.met(curves, ratio, flow)
        speed, torque = known["rotor_speed"], known["hydrodynamic_torque"]
        operation = Operation(float(problem.weights @ (torque * speed)), speed, torque)
    branches = found if has_branches(physics) else ()
    return StartingPoint(best.blade, best.gains, operation, branches, best.tried)


def _worth(schedule):
    return schedule.worth


def _along(steady: SteadyFlow, start: StartingPoint, branch: str) -> Schedule:
    """Return a starting point's blade and gains with the schedule of a branch, or of its law."""
    curves = steady.curves(start.blade)
    if branch:
        ratio = steady.ratios(curves, branch)
    else:
        ratio = start.operation.rotor_speed * start.blade.rotor_radius / steady.speeds
    rate, over = steady.at(curves, ratio)
    excess = float(np.max(over)) if start.operation.running else np.inf
    value = float(steady.weights @ rate)
    return Schedule(branch, start.blade, start.gains, ratio, value, excess)
