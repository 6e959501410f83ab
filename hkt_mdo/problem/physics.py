"""Reading a case: its turbine, flow, control law, limits and objective as values."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from hkt_mdo.case import Case
from hkt_mdo.dynamics.limits import (
    CavitationLimit,
    DesignBounds,
    ForwardRotation,
    Limit,
    PowerLimit,
    TableEnd,
    TorqueLimit,
)
from hkt_mdo.errors import InputError
from hkt_mdo.files.shipped import shipped_rotor
from hkt_mdo.problem.contradictions import doubts, redundant_limits, refuse_contradictions
from hkt_mdo.problem.equilibrium import SteadyScenario, refuse_slow
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.scenario import MOST_SEGMENTS, OWN, Scenario, in_operation
from hkt_mdo.problem.turbine import Turbine, build_turbine
from hkt_mdo.quantities import LOADS, RATES
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.model import RotorModel
from hkt_mdo.rotor.scales import power_scale, torque_scale
from hkt_mdo.rotor.shape import Shape
from hkt_mdo.rotor.suction import require_suction

DURATION = 60.0  # s, of a flow that has no end of its own
SEGMENTS_PER_PERIOD = 8.0  # segments in a period of the highest lasting frequency
FEWEST_SEGMENTS = 60
MOST_PERIODS = 1_000_000  # most periods of the flow's highest frequency that can be sampled
MOST_TORQUE = 1.0  # torque coefficient that no rotor has; good ones have 0.06
PAPER_BLADE, PAPER_CHORD_BOUNDS = "bahaj2007", (0.01, 1.0)  # m
CHORD_FACTORS = 0.2, 3.0  # on the smallest and the largest chord: the default bounds
STATIONS = 120  # from which the loads of a blade change by less than a thousandth


def complete(case: Case) -> Case:
    """Return a case whose time spans and segments are numbers, taken from its flows if need be.

    Raises InputError for a flow that is none within its time span.
    """
    phase = case.phase
    span, year = phase.duration, case.inflow.length
    if span not in (None, year) and case.inflow.steady and not case.scenarios:
        raise InputError("is not 8766 h, a year", "leave it out", key="phase.duration", value=span)
    duration, segments = _span(case)
    if not case.scenarios:
        case.inflow.check(duration)
    fields = {"duration": duration, "segments": segments}
    scenarios = []
    for number, scenario in enumerate(case.scenarios):
        part = case.of_scenario(scenario.name)
        try:
            duration, segments = _span(part)
            part.inflow.check(duration)
        except InputError as error:
            error.key = f"scenarios[{number}].{error.key.removeprefix('phase.')}".rstrip(".")
            raise
        scenarios.append(scenario.model_copy(update={"duration": duration, "segments": segments}))
    update = {"phase": phase.model_copy(update=fields), "scenarios": tuple(scenarios)}
    return case.model_copy(update=update)


def _span(case: Case) -> tuple[float, int]:
    """Return the duration of a case's flow, s, and the number of segments, given or not."""
    inflow, segments = case.inflow, case.phase.segments
    duration = case.phase.duration or inflow.length or DURATION
    if segments is None:
        lasting = (span[2] for span in inflow.features if span[0] <= 0.0 and span[1] == np.inf)
        wanted = np.ceil(SEGMENTS_PER_PERIOD * duration / min(lasting, default=np.inf) - 1e-9)
        segments = int(np.clip(wanted, FEWEST_SEGMENTS, MOST_SEGMENTS))
    periods = sum(
        (min(end, duration) - max(begin, 0.0)) / period
        for begin, end, period in inflow.features
        if end > 0.0 and begin < duration
    )
    if periods > MOST_PERIODS:
        problem = f"has {periods:.3g} periods of the flow's highest frequency"
        remedy = f"give a shorter one or a slower flow: at most {MOST_PERIODS:.0e} periods"
        raise InputError(problem, remedy, key="phase.duration", value=duration)
    return duration, segments


def _whole_scenarios(case: Case) -> list[Scenario]:
    """Return the scenarios of a complete case, each over its whole time span."""
    if not case.scenarios:
        return _scenarios(case)
    scenarios, total = [], sum(entry.weight for entry in case.scenarios)
    for entry in case.scenarios:
        turbine = entry.density, entry.condition, entry.limits.cavitation
        weight = entry.weight / total * case.phase.duration / entry.duration
        options = {"name": entry.name, "turbine": turbine, "weight": weight}
        scenarios += _scenarios(case.of_scenario(entry.name), steady=entry.steady, **options)
    return scenarios


def _scenarios(case: Case, *, steady=False, **options) -> list[Scenario]:
    """Return the scenario of a case of one flow, on a mesh that resolves it.

    Without time where it is steady or of a resource; two if its rotor turns backwards in reversed
    flow, the second of the same group.
    """
    inflow, mesh = case.inflow, case.phase
    steady = steady or inflow.steady
    if steady and case.control.chooses_torque:
        problem = "has no torque over time in a steady scenario"
        raise InputError(problem, "give control.unknown: speed", key="control.unknown")
    if not steady:
        return [Scenario(inflow, mesh, **options).resolved()]
    scenarios = [SteadyScenario.of(inflow, mesh, **options)]
    if getattr(inflow, "reversed_speeds", None) is not None:
        condition = case.condition.model_copy(update={"polar": inflow.reversed_polar})
        options |= {"name": f"{scenarios[0].name}_backwards", "interval_of": scenarios[0].name}
        density, _, cavitation = scenarios[0].turbine
        options |= {"turbine": (density, condition, cavitation), "backwards": True}
        scenarios.append(SteadyScenario.of(inflow, mesh, **options))
    return [scenario.below(case.control.cut_out) for scenario in scenarios]


def physics(case: Case) -> Physics:
    """Read the files that a case names; InputError if one is broken or does not fit the others."""
    case = complete(case)
    control = case.control.applied(case.condition.torque_constant)
    whole = _whole_scenarios(case)
    speed = np.concatenate([scenario.speeds for scenario in whole])
    weights = np.concatenate([scenario.weight * scenario.sample_weights for scenario in whole])
    mean = float(weights @ speed / np.sum(weights))
    speed = np.minimum(speed, control.cut_out or np.inf)
    slowest, fastest = float(np.min(speed)), float(np.max(speed))
    control = control.in_flow(slowest, fastest)
    # the speed at which most energy passes; only local Reynolds numbers need it
    speed = float(weights @ speed**4 / (weights @ speed**3))
    turbine = build_turbine(case.rotor, case.fluid, speed, case.design)
    case.generator.check(turbine.blade.rotor_radius, slowest, fastest)
    case = _with_chord_bounds(case, turbine.blade)
    shape = _shape(case, turbine)
    scenarios, notes = [], [message for scenario in whole for message in scenario.messages]
    for scenario in whole:
        parts, messages = in_operation(scenario, control.cut_out, 2.0 * turbine.blade.rotor_radius)
        scenarios += parts
        notes += messages
    names = [scenario.name for scenario in scenarios]
    for name in names:
        if names.count(name) > 1:
            problem = "is the name of a scenario and of a part of another one"
            raise InputError(problem, "give the scenario another", key="scenarios", value=name)
    if any(scenario.steady for scenario in whole):
        text = "has no effect in a steady scenario: without time the torque has no rate"
        notes += [f"{limit.key} {text}" for limit in case.all_limits if limit.is_of(RATES)]
    refuse_slow(scenarios, control)
    refuse_contradictions(case, shape, mean, fastest)
    messages = (*turbine.messages, *dict.fromkeys(notes), *redundant_limits(case, shape))
    limit = control.torque_limit
    most = MOST_TORQUE * float(torque_scale(case.fluid.density, shape.radii[1], fastest))
    if limit is not None and limit > most:
        text = f"control.torque_limit = {limit:g} N m is out of reach of any blade in this flow"
        messages += (f"{text}, at most {most:.3g} N m: it counts as none",)
        control = control.model_copy(update={"torque_limit": None})
    limits = [_limits_over_time(case.of_scenario(x.group), shape, control) for x in scenarios]
    made = Physics(
        case,
        shape,
        _rotors(case, turbine, shape, scenarios),
        turbine,
        tuple(replace(x, limits=held) for x, held in zip(scenarios, limits, strict=True)),
        control,
        _design_limits(case, shape),
        case.objective,
        messages,
        (*turbine.doubts, *doubts(case, _derived(turbine, whole))),
    )
    return replace(made, ceilings=_ceilings(made)) if case.robustness.relative else made


@lru_cache(maxsize=1)  # a second on several sections, and the checks and the notes of a run ask
def with_many_stations(physics: Physics) -> Physics:
    """Return the physics of the same turbine with `STATIONS` stations, whatever the case gives."""
    case = physics.case
    rotor = case.rotor.model_copy(update={"station_count": STATIONS})
    turbine = build_turbine(rotor, case.fluid, 1.0, case.design)
    shape = replace(physics.shape, blade=turbine.blade)
    rotors = _rotors(case, turbine, shape, physics.scenarios)
    return replace(physics, shape=shape, rotors=rotors, turbine=turbine)


def _ceilings(physics: Physics) -> dict[str, float]:
    """Return an upper bound on the mean power of each scenario, W, by name.

    That of a rotor at the steady optimum of the case's own radius at every instant, or of the
    generator's limit where that is smaller.
    """
    ceilings, radius = dict.fromkeys(physics.shares, 0.0), physics.blade.rotor_radius
    best = {
        key: rotor.best_of_shape(physics.shape, physics.blade).power_coefficient
        * float(power_scale(rotor.water_density, radius, 1.0))
        for key, rotor in physics.rotors.items()
    }
    for scenario in physics.scenarios:
        most = [x.upper for x in scenario.limits if isinstance(x, PowerLimit)]
        flow = scenario.inflow.speed_at(scenario.node_times)
        power = np.minimum(best[scenario.turbine] * flow**3, min(most, default=np.inf))
        ceilings[scenario.group] += float(scenario.node_weights @ power) / scenario.mesh.duration
    return ceilings


def _rotors(
    case: Case, turbine: Turbine, shape: Shape, scenarios: Iterable[Scenario]
) -> dict[tuple, RotorModel]:
    """Return the rotor in the water and the condition of a case and of each of its scenarios."""
    keys = dict.fromkeys((OWN, *(scenario.turbine for scenario in scenarios)))
    return {key: _rotor_model(case.of_turbine(*key), turbine, shape) for key in keys}


def _rotor_model(case: Case, turbine: Turbine, shape: Shape) -> RotorModel:
    """Return the rotor of a case; refuse limits on loads that it cannot compute."""
    polar = _polar_in_condition(turbine, case)
    # the case's own limit comes last, and counts
    limited = {name: x for x in case.all_limits[::-1] for name in x.inputs if name in LOADS}
    direct = case.hydrodynamics.torque == "direct"
    optimized = case.objective.is_of(LOADS)
    if (limited or optimized) and (direct or polar.follows_reynolds):
        key = "objective" if optimized else f"limits.{next(iter(limited))}"
        problem = "uses a load, which needs a curve over the tip speed ratio"
        remedy = "give hydrodynamics.torque: curve and rotor.reynolds: invariant"
        raise InputError(problem, remedy, key=key)
    if polar.follows_thickness and (direct or case.hydrodynamics.bem != "vectorized"):
        problem = "takes hydrodynamics.torque: curve and hydrodynamics.bem: vectorized"
        raise InputError(problem, "give these", key="design.thickness_points")
    polars = {table for row in polar.tables for table in row}
    asked = limited.get("cavitation", CavitationLimit())
    depth = case.site.hub_depth if asked.depth is None else asked.depth
    if "cavitation" in limited:
        if depth is None:
            problem, remedy = "has no depth", "give limits.cavitation.depth or site.hub_depth"
            raise InputError(problem, remedy, key="limits.cavitation")
        require_suction(polars)
    key = "site.hub_depth" if asked.depth is None else "limits.cavitation.depth"
    if depth is not None and depth <= (tip := shape.radii[1]):
        problem = f"is within the blade's radius of {tip:.4g} m: the tip would leave the water"
        raise InputError(problem, "give a larger depth of the hub", key=key, value=depth)
    computable = not polar.follows_reynolds and all(table.suction is not None for table in polars)
    return RotorModel(
        polar=polar,
        hub_inertia=case.rotor.hub_inertia,
        water_density=case.fluid.density,
        structure=turbine.structure,
        depth=depth if computable else None,
        margin=asked.margin,
        inertia_factor=case.condition.inertia,
        added_inertia=case.rotor.added_inertia,
        thickness=turbine.thickness,
    )


def _polar_in_condition(turbine: Turbine, case: Case):
    """Return the polars that a turbine's sections have in the condition of a case."""
    condition, polar = case.condition, turbine.polar
    if not condition.fouls:
        return polar
    if condition.polar is not None:
        rotor = case.rotor.model_copy(update={"polar": condition.polar})
        polar = build_turbine(rotor, case.fluid, 1.0).polar
    return polar.scaled(condition.lift, condition.drag)


def _derived(turbine: Turbine, whole: list[Scenario]) -> dict[str, float]:
    """Return quantities that follow from a case and its files, by their names in `PLAUSIBLE`."""
    name = "mean flow speed"
    flows = {f"{name} of {x.name}" if len(whole) > 1 else name: x.mean_flow for x in whole}
    actual = [(x.area or 0.0, *(x.moments or (0.0, 0.0))[:2]) for x in turbine.sections]
    filled = [(x.outline.area, *x.outline.second_moments[:2]) for x in turbine.sections]
    names = "area of a section", "flapwise second moment", "edgewise second moment"
    flows.update(zip(names, np.max(np.divide(actual, filled), axis=0), strict=True))
    return flows | {
        "tip radius": turbine.blade.tip_radius,
        "outermost station or row": turbine.reach,
        "thickness of the thinnest section": float(np.min(turbine.thickness)),
    }


def _with_chord_bounds(case: Case, blade: Blade) -> Case:
    """Return a case with the bounds on the chord that follow from its blade, if it gives none."""
    if case.design.chord_bounds is not None or case.design.blade == "fixed":
        return case
    rotor = case.rotor
    is_paper = rotor.blade == PAPER_BLADE and rotor.chord is None
    is_paper = is_paper and np.isclose(rotor.radius, shipped_rotor(PAPER_BLADE)["radius"], 1e-9, 0)
    bounds: tuple[float, ...] = PAPER_CHORD_BOUNDS
    if not is_paper:
        ends = CHORD_FACTORS[0] * np.min(blade.chord), CHORD_FACTORS[1] * np.max(blade.chord)
        bounds = tuple(float(f"{end:.3g}") for end in ends)
    design = case.design.model_copy(update={"chord_bounds": bounds})
    return case.model_copy(update={"design": design})


def _shape(case: Case, turbine: Turbine) -> Shape:
    """Return the design variables of a case's blade."""
    design, blade = case.design, turbine.blade
    if design.hub_inertia_bounds is not None:
        hub = float(np.clip(case.rotor.hub_inertia, *design.hub_inertia_bounds))
        blade = replace(blade, hub_inertia=hub)
    radius_bounds = design.radius_bounds
    if radius_bounds is not None:
        radius_bounds = tuple(float(bound * np.cos(blade.cone)) for bound in radius_bounds)
    if design.blade == "fixed":
        angle, bounds = np.deg2rad(case.rotor.set_angle or 0.0), design.set_angle_bounds
        bounds = None if bounds is None else tuple(np.deg2rad(bounds))
        return Shape.fixed(blade, angle, bounds, radius_bounds)
    points = {"chord": design.chord_points, "twist": design.twist_points}
    bounds = {"chord": design.chord_bounds, "twist": tuple(np.deg2rad(design.twist_bounds))}
    if design.thickness_points:
        points["thickness"] = design.thickness_points
        bounds["thickness"] = turbine.polar.bounds
    return Shape.designed(blade, points, bounds, radius_bounds, turbine.polar.several)


def _limits(case: Case, shape: Shape) -> Iterator[Limit]:
    """Yield the limits that a case gives, for its blade and its material."""
    for limit in case.limits.given:
        yield limit.on(shape.blade, case.rotor.blade_material)


def _design_limits(case: Case, shape: Shape) -> tuple[Limit, ...]:
    """Return the limits on the design or the result: the bounds, and those that a case gives."""
    bounds = dict(shape.bounds)
    if shape.designs_set_angle:
        bounds = {"set_angle": shape.bounds["twist"]}
    bounds |= {"radius": shape.radius_bounds, "gain": case.design.gain_bounds}
    bounds["hub_inertia"] = case.design.hub_inertia_bounds
    held = (DesignBounds(quantity=name, bounds=ends) for name, ends in bounds.items() if ends)
    return *held, *(limit for limit in _limits(case, shape) if limit.place != "time")


def _limits_over_time(case: Case, shape: Shape, law) -> tuple[Limit, ...]:
    """Return the limits over time of a case: torque and rotation, and those that it gives.

    A generator whose table ends at a speed has a limit of the speed there.
    """
    limits = {limit.name: limit for limit in _limits(case, shape) if limit.place == "time"}
    speed, end = limits.get("rotor_speed"), case.generator.fastest
    if end < (np.inf if speed is None else speed.upper):
        limits["rotor_speed"] = TableEnd(bound=end)
    torque = TorqueLimit(bound=law.applied(case.condition.torque_constant).largest_torque)
    return torque, ForwardRotation(), *limits.values()
