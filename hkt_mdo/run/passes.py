"""The passes of a run: optimize, integrate, and refine as long as the integration asks for it.

Each optimization is a `Pass`. What follows it is decided by `FOLLOW_UPS`, functions of a pass that
return the next `Task`, or None if they do not apply; the first that applies decides. Where none
does, `Pass.end` is the end of the run, measured by its start; if checks refuse it, `best_of` is the
best that the run has, and `none_found` says why.
"""

import time
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hkt_mdo.problem.build import assemble, make_driver, point_of
from hkt_mdo.problem.evaluation import excesses, in_motion
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.point import START_EXCESS, StartingPoint
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.quantities import RATES
from hkt_mdo.results.summary import CheckEntry, MemoryEntry, PassEntry
from hkt_mdo.run.checks import BELOW_START, MESH_ERROR, Checked, curve_errors, is_false, recovery
from hkt_mdo.run.memory import first_hub, stability_of, stable_hub
from hkt_mdo.run.optimization import collect, solve
from hkt_mdo.run.refine import Division, divided, division, excesses_at_nodes, lowered
from hkt_mdo.run.state import RunState
from hkt_mdo.run.verification import Optimized, Verification, verify

MAX_PASSES = 24
"""Optimizations from one start; runs that end well need at most ten."""
SETTLED = 0.05
"""Share of the rotor's inertia by which the lower bound of a designed hub may be too high."""
PARTS = "at_nodes", "between_nodes", "in_equilibrium", "bounds"  # of the checks of a limit


@dataclass(frozen=True, eq=False)
class Task:
    """The next optimization, and what the ones before it from the same start have reached.

    Attributes
    ----------
    start : StartingPoint
        The start of the series of passes to which it belongs.
    physics : Physics
        On the mesh that is optimized on.
    setup : Setup
    name, why : str
        What is done after the pass before, and the reason; empty for the first one.
    passes : int
        How many there were from this start.
    coarser : tuple of float
        Objectives after which the mesh was divided, J, the last one's at the end; of polynomials of
        one order.
    """

    start: StartingPoint
    physics: Physics
    setup: Setup
    name: str = ""
    why: str = ""
    passes: int = 0
    coarser: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class Pass(Task):
    """One optimization of a run: its task and its end.

    Attributes
    ----------
    state : RunState
    result : Optimized
    rough : tuple of Verification
        Its integrations by a spline of the torque; the others begin from them, by direct BEM.
    """

    state: RunState
    result: Optimized
    rough: tuple[Verification, ...] = ()

    @property
    def approximate(self) -> bool:
        """Whether the integrations have their torque by a spline, not by direct BEM.

        So they have between passes where the torque depends on the tip speed ratio alone.
        """
        physics = self.physics
        return not (self.rough or physics.remembers or physics.rotor.polar.follows_reynolds)

    @property
    def exactly(self) -> "Pass":
        """The same pass with integrations by direct BEM."""
        return replace(self, rough=self.verifications) if self.approximate else self

    @property
    def converged(self) -> bool:
        """Whether the optimizer converged."""
        return self.result.outcome.success

    @cached_property
    def memory(self) -> MemoryEntry | None:
        """Stability of an optimum's loop in a case with dynamic inflow."""
        return stability_of(self.result) if self.physics.remembers and self.converged else None

    @property
    def runs_away(self) -> bool:
        """Whether the loop is unstable, in a case with dynamic inflow."""
        return self.memory is not None and not self.memory.stable

    @cached_property
    def verifications(self) -> tuple[Verification, ...]:
        """The integration of the end in each scenario."""
        return verify(self.result, self.approximate, self.rough)

    @cached_property
    def division(self) -> Division:
        """Error of the mesh, and the segments to divide."""
        return division(self.result, self.verifications, self.coarser)

    def next(self, why: str, *, physics: Physics | None = None, **changes) -> Task:
        """Return the next optimization, with changes of the setup, or on another mesh."""
        setup, passes, coarser = replace(self.setup, **changes), self.passes + 1, self.coarser
        if physics is not None:
            meshes = [each.scenarios[0].mesh for each in (self.physics, physics)]
            # objectives of polynomials of different orders are no series
            coarser = (*coarser, self.result.objective) if meshes[0] == meshes[1] else ()
        physics = physics or self.physics
        return Task(self.start, physics, setup, why=why, passes=passes, coarser=coarser)

    def entry(self, seconds: float, following: Task | None) -> PassEntry:
        """Return the report of this optimization, which took some seconds, and of what follows."""
        return PassEntry(
            number=len(self.state.passes) + 1,
            converged=self.converged,
            objective_J=self.result.objective,
            iterations=self.result.outcome.iterations,
            seconds=seconds,
            remedy=following.name if following else "",
            why=following.why if following else "",
        )

    @cached_property
    def end(self) -> Checked:
        """The result of the run if nothing follows, with its checks, by exact integrations."""
        error = self.division.error if self.converged else 0.0
        start, result = self.start, replace(self.result, mesh_error=error)
        if result.objective < (1.0 - BELOW_START) * start.reference:
            moving = _moving_reference(self.state.first, start, result)
            start = replace(start, reference=min(start.reference, moving))
        return Checked(start, result, self.verifications)


def heavier_hub(pass_: Pass) -> Task | None:
    """Bound a designed hub from below by the inertia from which the loop with memory is stable.

    The optimization does not see an instability whose growth is faster than its segments. A bound
    that is too high is lowered again. No mesh helps, and the integration runs away: nothing else
    follows an instability.
    """
    point, bound = pass_.result.point, pass_.setup.least_hub
    hub = stable_hub(pass_.physics, point.blade, pass_.memory)
    if hub is None or not (pass_.runs_away or hub < bound - SETTLED * pass_.result.inertia):
        return None
    why = f"the loop with memory is stable from {hub:.4g} kg m^2 besides the blades"
    heavier = replace(point.blade, hub_inertia=max(hub, point.blade.hub_inertia))
    start, nodes = replace(point, blade=heavier), curve_nodes(pass_.physics, point)
    return pass_.next(why, start=start, nodes=nodes, least_hub=hub)


def refine(pass_: Pass) -> Task | None:
    """Refine what the integration of an optimum shows to be too coarse.

    That are the torque curve, segments of the mesh, and limits exceeded between the nodes: these
    are held between them, or lowered at the nodes of segments that are not divided.
    """
    if not pass_.converged or pass_.runs_away:
        return None
    physics, setup, finer, reasons = pass_.physics, pass_.setup, None, []
    most, nodes = physics.case.hydrodynamics.tolerance, setup.nodes
    error = float(np.max(curve_errors(pass_.result)[1], initial=0.0))  # 0 without a curve
    if error > most and (finest := _finer_curve(pass_.result, error)) is not None:
        nodes = finest
        reasons.append(f"error of the torque curve {error:.2g}, allowed {most:.2g}")
    # an open loop whose wake has memory would pulse faster on a finer mesh
    divides = not physics.may_pulse and pass_.division.allowed(physics.case.driver.optimizer)
    shares = setup.shares
    # where a finer mesh still changes the operation, limits would be lowered in vain
    settled = pass_.division.error <= MESH_ERROR and not is_false(pass_.verifications)
    if settled or not divides:
        shares, worst = lowered(setup, pass_.verifications)
        if worst:
            reasons.append(f"a limit is exceeded between the nodes by {100.0 * worst:.2g} %")
    excess = excesses_at_nodes(setup, pass_.verifications)
    if divides:
        reasons.append(pass_.division.why)
        finer, shares, excess = divided(physics, pass_.division, shares, excess)
    if not reasons:
        return None
    start = point_of(finer or physics, pass_.result.problem)
    return pass_.next(
        "; ".join(reasons), physics=finer, start=start, nodes=nodes, shares=shares, excess=excess
    )


def _finer_curve(result: Optimized, error: float) -> np.ndarray | None:
    """Return the nodes of a finer torque curve of an optimum; None where they would not help.

    That is where the error of the same blade falls by less than a tenth: where its torque jumps, as
    none of a spline does.
    """
    physics, point = result.physics, result.point
    nodes = curve_nodes(physics, point)
    nodes = np.sort(np.r_[nodes, 0.5 * (nodes[1:] + nodes[:-1])])
    curve = physics.rotor.coefficients(point.blade, nodes).torque
    finer = replace(result, setup=replace(result.setup, nodes=nodes), curve=curve)
    return nodes if np.max(curve_errors(finer)[1]) < 0.9 * error else None


FOLLOW_UPS = heavier_hub, refine


def next_task(pass_: Pass) -> Task | None:
    """Return the next optimization by the first of `FOLLOW_UPS` that applies and is allowed."""
    for follow in FOLLOW_UPS:
        task = follow(pass_)
        if task is not None and task.passes < MAX_PASSES:
            return replace(task, name=follow.__name__.replace("_", " "))
    return None


def optimize(state: RunState, start: StartingPoint) -> Checked:
    """Optimize from a start, and as long as something follows.

    Parameters
    ----------
    state
        The state of the run, which records every pass.
    start
        Where the first optimization begins.

    Returns
    -------
    Checked
        The end, on its mesh.
    """
    physics, hub = state.first, first_hub(state.first, start)  # by which the loop is stable
    setup = Setup(in_motion(physics, start), curve_nodes(physics, start), least_hub=hub)
    task = Task(start, physics, setup)
    while True:
        state.go_on_from(task.physics, task.setup.start, start)
        began = time.perf_counter()
        driver = make_driver(task.physics, state, refined=task.name == "refine")
        result = solve(state, task.physics, task.setup, driver)
        pass_ = Pass(**vars(task), state=state, result=result)
        following = next_task(pass_)
        if following is None and pass_.approximate:
            pass_ = pass_.exactly
            following = next_task(pass_)
        state.note_pass(pass_.entry(time.perf_counter() - began, following))
        if following is None:
            return pass_.end
        task = following


def measured(physics: Physics, start: StartingPoint) -> StartingPoint:
    """Return a start with its objective as the measure of the optimum, where it is one.

    A start that breaks a limit may be better than the best design that keeps it.

    Parameters
    ----------
    physics
        On the mesh of the start.
    start
        Found by quasi-steady co-design.
    """
    # a start may maximize another quantity; it operates in the case's own water and condition
    alike = physics.start_objective is physics.objective and len(physics.rotors) == 1
    keeps = start.operation.running and start.excess <= START_EXCESS
    if not alike or not keeps or np.isnan(start.objective):
        return start
    return replace(start, reference=start.objective - physics.price_of(start.blade))


def _moving_reference(physics, start, result) -> float:
    """Return the objective of a start with the rotor's inertia, J; 0 if it breaks a limit.

    A quasi-steady start follows every gust at once, which a rotor with inertia cannot; nor may that
    come nearer to stall than a law may.
    """
    stands = as_it_stands(physics, start, result)
    verifications = verify(stands)
    stops = any(run.simulation.stopped_at is not None for run in verifications)
    near = recovery(physics, verifications) if physics.law.is_feedback else ()
    # a law with states has other states over time than in equilibrium
    pairs = [(run, series) for run in verifications for series in (run.at_nodes, run.simulated)]
    over = [np.max(x.excess(series)) for run, series in pairs for x in run.scenario.limits]
    if stops or max(over) > START_EXCESS or any(value > most for _, value, most, _ in near):
        return 0.0
    return Checked(start, stands, verifications).objective


def as_it_stands(physics: Physics, point: StartingPoint, ended: Optimized) -> Optimized:
    """Return a point as the result of an optimization without success.

    Parameters
    ----------
    physics, point
        A start or an iterate, and the physics on its mesh.
    ended
        The optimization whose outcome it takes.
    """
    message = "its result was refused" if ended.outcome.success else ended.outcome.message
    outcome = replace(ended.outcome, success=False, message=message)
    setup = Setup(point, curve_nodes(physics, point))
    problem = assemble(physics, setup)
    problem.run_model()
    return collect(physics, setup, problem, outcome)


def best_of(state: RunState, end: Checked) -> tuple[Checked, str]:
    """Return the best of a failed run's end, its best iterate and its start, each checked.

    Parameters
    ----------
    state
        What the run knows.
    end
        What its last optimization ended with.

    Returns
    -------
    tuple of Checked and str
        The best one, on its own mesh, and its description; empty for the end.
    """
    best, held = end, ""
    others = [(*state.best, "the best iterate")] if state.best else []
    if end.start.operation.running:
        others.append((state.first, end.start, "the start"))
    for physics, point, words in others:
        stands = as_it_stands(physics, point, end.result)
        checked = Pass(end.start, physics, stands.setup, state=state, result=stands).exactly.end
        if checked.rank > best.rank:
            best, held = checked, words
    return best, held


def none_found(physics: Physics, start: StartingPoint, checks: list[CheckEntry]) -> str:
    """Return why a run that failed may have no solution; empty where that is not known.

    That the rotor does not turn, or that no design keeps the limits: if neither start nor end keep
    them. `physics` is on the mesh of the start; `checks` are those of the end.
    """
    tried = max(len(start.starts), 1)
    starts, shape, design = f"{tried} start{'s' * (tried != 1)}", physics.shape, physics.case.design
    bounded = shape.bounds or shape.radius_bounds or physics.designs_hub or design.gain_bounds
    wider = ", or wider design bounds" if bounded else ""
    if not start.operation.running:
        return (
            "no blade and gain were found on which the rotor runs unstalled throughout this flow, "
            f"from {starts}: the problem may have no solution (try a larger control.torque_limit, "
            f"or another control.law{wider})"
        )
    rates = {limit.name for limit in physics.all_limits if limit.is_of(RATES)}
    exceeded = excesses(physics, start)
    over = {name: share for name, (share, _) in exceeded.items()}
    if not np.isnan(start.objective):  # optimized at some speeds; between these it exceeds more
        over = {x: y if x in rates else min(y, start.excess) for x, y in over.items()}
    begun = max((share, name) for name, share in over.items())
    refused = [(each.value, each.name.partition(" (")[0]) for each in checks if not each.passed]
    broken = [(x, n) for x, check in refused for n in over if check.removeprefix(f"{n}_") in PARTS]
    ended = max(broken, default=(0.0, ""))
    if begun[0] <= START_EXCESS or ended[0] <= 0.0:
        return ""
    flow = exceeded[begun[1]][1]
    in_flow = "any flow" if flow is None else f"a flow of {flow:.4g} m/s"
    at_start = f"by the best of them, in {in_flow}"
    share, name, where = min((*begun, at_start), (*ended, "at the end of the optimization"))
    key = next(limit.key for limit in physics.all_limits if limit.name == name)
    law = "control.law: curve, which can keep more limits, or " * (len(physics.law.gain_units) == 1)
    law += "start.method: blade, with low gain, or " * (name in rates and physics.law.is_feedback)
    return (
        f"no design that keeps the limits was found from {starts}: the smallest violation was "
        f"{100.0 * share:.3g} % of {key}, {where}; this does not prove that there is none (try "
        f"{law}a looser {key}{wider})"
    )
