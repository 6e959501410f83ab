"""Steady scenarios: speeds of the flow without time, at each of which the rotor is in equilibrium.

The rotor's equation of motion is that of the other scenarios at rest, Q = u: rotor speeds at the
flow speeds are design variables, and the balance of torques under a feedback law is a constraint.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
import openmdao.api as om

from hkt_mdo.case import Phase
from hkt_mdo.dynamics.flows import SLOWEST, ConstantInflow, Inflow
from hkt_mdo.dynamics.resource import AT_END, Resource, Speeds, in_bins
from hkt_mdo.dynamics.rotor_ode import RotorODE
from hkt_mdo.errors import InputError
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.quantities import QUANTITIES, RATES, TRAJECTORY

SLOW = 600.0  # s, length of a segment in which the rotor is always in equilibrium with the flow
CHANGED = 1e-3  # change of the flow in a segment, over its largest speed, which the rotor follows
WIDTH = 0.05  # m/s, width of the bins of a flow over time in a steady scenario


@dataclass(frozen=True, eq=False)
class SteadyScenario(Scenario):
    """Speeds of a flow, each for its share of the time: one segment and one node for each.

    `edges` (s) are the ends of each speed's share in the order of rising speeds, in the time of its
    `inflow`, a duration curve; the rest of the mesh's duration is standstill. `bins` has the speeds
    and their bins, None where they are samples of a flow over time; `resource` is the resource of
    the speeds, and `backwards` tells whether they are those of reversed flow, in which the rotor
    turns backwards. The first and the last speed are the ends of the flow's range, at which limits
    hold, and have no energy. There are no limits on rates.
    """

    resource: Inflow = None  # type: ignore[assignment]
    backwards: bool = False
    bins: Speeds = None  # type: ignore[assignment]
    steady: ClassVar[bool] = True

    @classmethod
    def of(cls, inflow: Inflow, mesh: Phase, **others) -> "SteadyScenario":
        """Return the scenario of a resource, or of the speeds of a flow over time."""
        if isinstance(inflow, Resource):
            speeds = inflow.reversed_speeds if others.get("backwards") else inflow.speeds
        else:
            speeds = _without_time(Scenario(inflow, mesh).resolved())
        return cls(speeds.curve(mesh.duration), mesh, resource=inflow, bins=speeds, **others)

    def __post_init__(self):
        object.__setattr__(self, "edges", np.array(self.inflow.ends))
        limits = tuple(x for x in self.limits if not x.series.keys() <= {*RATES})
        object.__setattr__(self, "limits", limits)

    @property
    def messages(self):
        without = f"taken without time: {self.bins.mean.size} speeds of the flow"
        return (*self.resource.messages, *[without] * (not isinstance(self.resource, Resource)))

    def below(self, cut_out: float | None) -> "SteadyScenario":
        """Return the scenario without the speeds above the cut-out speed, m/s."""
        if cut_out is None or self.speeds[-1] <= cut_out:
            return self
        bins = self.bins.between(0.0, cut_out)
        if np.sum(bins.share) < 3.0 * AT_END:
            if (cut_in := getattr(self.resource, "cut_in", 0.0)) >= cut_out:
                problem, key = f"reaches control.cut_out = {cut_out:g} m/s", "resource.cut_in"
                raise InputError(problem, "give a smaller one", key=key, value=cut_in)
            slowest = np.min(self.bins.speed[self.bins.share > AT_END])
            problem = f"leaves no time of operation: the flow has at least {slowest:.4g} m/s"
            remedy, key = "give a larger one, or null for none", "control.cut_out"
            raise InputError(problem, remedy, key=key, value=cut_out)
        bins = bins.with_ends(bins.speed[0], cut_out)
        return replace(self, inflow=bins.curve(self.mesh.duration), bins=bins)

    def when(self, time):
        return f"a flow of {float(self.inflow.speed_at(np.array(time))):.4g} m/s"

    def divided(self, parts=1):
        return self

    resolved = divided

    flow_missed = Scenario.flow_errors  # none

    @property
    def samples(self):
        return 0.5 * (self.edges[1:] + self.edges[:-1])

    @property
    def sample_weights(self):
        return np.diff(self.edges)

    @cached_property
    def _places(self):
        return np.zeros(1), np.full(1, 2.0)

    node_times, dense = samples, samples

    @cached_property
    def distinct_nodes(self):
        return np.arange(self.segments)

    @property
    def path(self):
        return f"steady_{self.name}.timeseries"

    def source(self, name):  # the wake is that of the rotor's own tip speed ratio
        return super().source("tip_speed_ratio" if name == "wake_ratio" else name)


def refuse_slow(scenarios: Iterable[Scenario], law) -> None:
    """Refuse a feedback law in a flow that changes within hours, before any optimization.

    The collocation of the rotor's speed converges to false solutions in such long segments. An open
    loop chooses the speed and has no such equation.
    """
    for scenario in scenarios:
        if scenario.steady or not law.is_feedback:
            continue
        ends = scenario.inflow.speed_at(scenario.edges)
        changes = np.abs(np.diff(ends)) > CHANGED * np.max(ends)
        longest = float(np.max(np.diff(scenario.edges)[changes], initial=0.0))
        if longest > SLOW:
            problem = "changes within hours and the rotor within a second: in segments of up to "
            problem += f"{longest:.3g} s a feedback law converges to false speeds"
            inflow = f"{{profile: {scenario.inflow.profile}, ...}}"
            remedy = f"take it without its time, scenarios: [{{inflow: {inflow}, steady: true}}], "
            remedy += "or give a resource (docs/year.md), or control: {law: open_loop}"
            key = "inflow" if scenario.name == "phase" else f"scenarios.{scenario.group}.inflow"
            raise InputError(problem, remedy, key=key, value=scenario.inflow.profile)


def _without_time(whole: Scenario) -> Speeds:
    """Return the speeds of a flow over time, in bins and with its ends unless it is constant."""
    finer = whole.inflow.speed_at(whole.node_times), whole.node_weights / np.sum(whole.node_weights)
    speed, share = in_bins(*finer, WIDTH)
    if isinstance(whole.inflow, ConstantInflow):
        speed, share, finer = finer[0][:1], np.ones(1), None
    dense = whole.inflow.speed_at(whole.dense)
    speeds = Speeds(speed, share, np.arange(speed.size), speed, share, finer=finer)
    return speeds.with_ends(max(float(np.min(dense)), SLOWEST), float(np.max(dense)))


def equilibrium_group(scenario, law, ode_options, refs, bounds, start) -> om.Group:
    """Return a rotor in equilibrium at the speeds of a steady scenario; arguments as `add_phase`.

    Unknowns are the rotor's speed, (n_speeds,), and the states of the law; under feedback the
    balance of torques and the states' rates are constraints. Inputs are those of `RotorODE` that do
    not change over time; outputs ``timeseries.<quantity>``[n_speeds].
    """
    group, (low, high) = om.Group(), bounds["rotor_speed"]
    unknowns = group.add_subsystem("unknowns", om.IndepVarComp(), promotes=["*"])
    unknowns.add_output("time", scenario.node_times, units="s")
    unknowns.add_output("rotor_speed", start["rotor_speed"], units="rad/s")
    ref = np.maximum(start["rotor_speed"], 1e-3 * refs["rotor_speed"])
    group.add_design_var("rotor_speed", lower=low, upper=high, ref=ref, units="rad/s")
    if law.chooses_speed:
        unknowns.add_output("rotor_acceleration", np.zeros(scenario.segments), units="rad/s**2")
    else:
        # each flow has a torque of its own size
        torque = np.maximum(np.abs(start["control_torque"]), 1e-3 * refs["control_torque"])
        ref = refs["rotor_acceleration"] * torque / refs["control_torque"]
        group.add_constraint("rotor_acceleration", equals=0.0, ref=ref, units="rad/s**2")
    for name, (unit, _) in law.states.items():
        unknowns.add_output(name, start[name], units=unit)
        group.add_design_var(name, ref=refs[name], units=unit)
        group.add_constraint(f"{name}_rate", equals=0.0, ref=refs[f"{name}_rate"])
    options = {"num_nodes": scenario.segments, "law": law, "inflow": scenario.inflow}
    group.add_subsystem("ode", RotorODE(**options, **ode_options), promotes=["*"])
    # as rows of their own, beside the unknowns: else the search of `river25` takes twice as long
    described = {x: (QUANTITIES[x].unit, QUANTITIES[x].text) for x in TRAJECTORY} | law.states
    same = om.ExecComp(shape=(scenario.segments,), has_diag_partials=True)
    for name, (unit, _) in described.items():
        same.add_expr(f"{name} = {name}_in", **{x: {"units": unit} for x in (name, f"{name}_in")})
        group.connect(name, f"timeseries.{name}_in")
    group.add_subsystem("timeseries", same)
    return group
