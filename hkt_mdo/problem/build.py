"""A case as an OpenMDAO problem: the one place where case and physics meet.

design variables --> inertia ------------------.
   chord, twist  --> torque table (BEM) ------> phases: flow -> hydrodynamics -> controller -> shaft
   gains               ---------------------------'        '--> limits, energy, objective
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import openmdao.api as om
from dymos import Trajectory

from hkt_mdo.dynamics.limits import (
    SLOWED,
    TYPICAL,
    DistanceFromStall,
    FartherFromStall,
    Limit,
    TorqueLimit,
    settled,
)
from hkt_mdo.dynamics.objectives import CapturedEnergy, ElectricalEnergy, GeneratorEnergy
from hkt_mdo.dynamics.rotor_ode import HydrodynamicsComp
from hkt_mdo.problem.components import (
    AboveComp,
    AggregateComp,
    AreaComp,
    FormulaComp,
    IntegralComp,
    LoadComp,
    TorqueRateComp,
)
from hkt_mdo.problem.physics import BEM, Physics
from hkt_mdo.problem.scenario import Scales, Scenario, add_phase, set_start
from hkt_mdo.problem.setup import THICKNESS_UNIT, TWIST_UNIT, Setup
from hkt_mdo.quantities import QUANTITIES, RATES, is_over_time
from hkt_mdo.rotor.components import (
    AngleComp,
    InertiaComp,
    LoadTable,
    ShapeComp,
    TorqueTable,
    rotor_inputs,
)
from hkt_mdo.rotor.scales import torque_scale
from hkt_mdo.rotor.stall import SLOWER
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.solve import drivers
from hkt_mdo.solve.totals import Substitution

ANGLE_UNIT = np.deg2rad(5.0)  # typical change of an angle of attack
DESIGNED = {
    "rotor_radius": "radius of the swept disc",
    "chord_control": "what makes the chord: at the stations, or control points of a spline",
    "twist_control": "what makes the twist: at the stations, control points, or the set angle",
    "thickness_control": "what makes the thickness over chord: at the stations, or control points",
}
# IPOPT's barrier is a sum over the bounds and so over the segments; the objective is not. Where it
# outweighs what the optimum is better than the start, the iterates leave the start for the middle
# of all bounds, and most iterations lead back.
BARRIER = 6e-3
NEAR = 0.2  # of a typical torque: the recovery below which a node is held to its distance
FEWEST_NEAR = 20  # nodes, at least as many of which are held to their distance from stall


def assemble(
    physics: Physics, setup: Setup, driver: om.Driver | None = None, work_dir: str = ""
) -> om.Problem:
    """Return the problem of some physics at a setup.

    `driver` None: the case's own; `work_dir`: where OpenMDAO puts its own files.
    """
    options = {"work_dir": work_dir} if work_dir else {}
    driver = driver or make_driver(physics)
    problem = om.Problem(driver=driver, reports=False, **options)
    model, bounds = problem.model, setup.moves.bounds(physics, setup.start)
    model.linear_solver = Substitution()
    _add_design(model, physics, setup, bounds)
    hydrodynamics, parameters = _add_rotor(model, physics, setup)
    scales = _scales(physics, setup)
    phases = _add_phases(model, physics, hydrodynamics, parameters, scales, bounds["rotor_speed"])
    _add_loads(model, physics, setup)
    _add_rates(model, physics)
    _add_energies(model, physics)
    for limit in physics.design_limits:
        if limit.constrains(physics.law):
            _add_design_limit(model, physics, setup, limit)
    for number, scenario in enumerate(physics.scenarios):
        for limit in (*physics.limits_in(scenario), *_distance_from_stall(physics, setup)):
            if limit.constrains(physics.law):
                _add_limit(model, physics, setup, limit, number, scales)
        if scenario.mesh.final_speed == "initial":
            _close_cycle(model, scenario, scales)
    _add_attached(model, physics, setup)
    _add_objective(model, physics, setup)
    problem.driver.declare_coloring(show_summary=False, show_sparsity=False)
    problem.setup()
    for phase, scenario, (speed, torque) in zip(
        phases, physics.scenarios, physics.split(setup.start.operation), strict=True
    ):
        states = physics.states_at_rest(torque, scenario.inflow.speed_at(scenario.samples))
        set_start(phase, scenario.samples, speed, torque, states)
    return problem


def make_driver(physics: Physics, progress=None, most=None, near=True) -> om.Driver:
    """Return the driver of a problem, which gives up after `most` iterations if that is fewer.

    `near` tells that the start is near the optimum, so that an optimizer had better stay there.
    """
    settings, segments = physics.case.driver, sum(each.segments for each in physics.scenarios)
    return drivers.make_driver(
        settings.package,
        settings.optimizer,
        settings.tolerance,
        min(settings.max_iterations, most or settings.max_iterations),
        barrier=BARRIER / segments if near else None,
        cautious=physics.several_sections,
        progress=progress,
    )


def _scales(physics, setup):
    """Return the reference magnitudes of the phases, from the start."""
    operation = setup.start.operation
    torque = float(np.max(np.abs(operation.hydrodynamic_torque)))
    _, inertia = physics.mass_and_inertia(setup.start.blade)
    speed = float(np.mean(operation.rotor_speed))
    limit = physics.law.torque_limit
    if limit is not None:
        limit *= min(np.min(setup.share(TorqueLimit(), each)) for each in physics.scenarios)
    return Scales(speed, torque, torque / inertia, limit, _state_scales(physics, setup.start))


def _state_scales(physics, start):
    """Return the reference magnitudes of the law's states and rates, by name.

    A rate's is what it changes by if the speed and the states change by theirs.
    """
    if not physics.states:
        return {}
    found = physics.on_start(start)
    names = "rotor_speed", "inflow_speed", *physics.states
    speed, flow, *states = (np.concatenate([each[name] for each in found]) for name in names)
    sizes = np.max(np.abs([speed, *states]), axis=1)
    slopes = physics.law.slopes(speed, flow, start.gains, *states)[1:]
    rates = np.max(np.abs(slopes), axis=2) @ sizes
    return dict(zip(physics.states, zip(sizes[1:], rates, strict=True), strict=True))


def _add_design(model, physics, setup, bounds):
    """Add what is designed, or held: radius, control points of the shape, gains, water."""
    start = setup.start
    chord, twist, thickness = physics.shape.within(start.blade)  # but for the last digit, they are
    radius = start.blade.rotor_radius
    design = model.add_subsystem("design", om.IndepVarComp(), promotes=["*"])
    for name, value, units, ref in (
        ("rotor_radius", np.atleast_1d(radius), "m", radius),
        ("chord_control", chord, "m", chord),
        ("twist_control", twist, "rad", TWIST_UNIT),
        ("thickness_control", thickness, None, THICKNESS_UNIT),
    ):
        if not value.size:
            continue
        design.add_output(name, value, units=units, desc=DESIGNED[name])
        if name != "rotor_radius" or physics.shape.radius_bounds is not None:
            low, high = bounds[name]
            model.add_design_var(name, lower=low, upper=high, ref=ref, units=units)
    design.add_output("density", physics.density, **QUANTITIES["density"].meta)
    if not thickness.size and physics.asks_for("thickness"):
        given = np.broadcast_to(physics.thickness, start.blade.r.shape)
        design.add_output("thickness", given, **QUANTITIES["thickness"].meta)
    for i, units in enumerate(physics.gain_units):
        name, (low, high) = f"gain_{i}", bounds["gain"]
        design.add_output(name, start.gains[i], units=units, desc="feedback gain")
        if low[i] < high[i]:
            ref = physics.law.sizes(start.gains)[i]
            model.add_design_var(name, lower=low[i], upper=high[i], ref=ref)


def _add_rotor(model, physics, setup):
    """Add shape, inertia and torque curve.

    Returns the options of `HydrodynamicsComp` and the ODE inputs that the model feeds, with units.
    """
    case, blade = physics.case, setup.start.blade
    model.add_subsystem("shape", ShapeComp(shape=physics.shape), promotes=["*"])
    about = {"blade": blade, "rotor": physics.rotor}
    model.add_subsystem("inertia", InertiaComp(**about), promotes=["*"])
    if physics.asks_for("blade_area"):
        model.add_subsystem("planform", AreaComp(blade=blade), promotes=["*"])
    parameters = {"density": "kg/m**3", "inertia": "kg*m**2", "rotor_radius": "m"}
    if physics.has_curve:
        solver = {"rotor": replace(physics.rotor, solver=case.hydrodynamics.bem)}
        table = TorqueTable(nodes=np.asarray(setup.nodes, dtype=float), **about | solver)
        model.add_subsystem("torque_table", table, promotes=["*"])
        options = {"spline": TorqueSpline(setup.nodes)}
        parameters["torque_coefficient_table"] = None
    else:
        solver = BEM[case.hydrodynamics.bem]
        options = {"blade": blade, "polar": physics.polar, "coefficients": solver}
        parameters |= {"chord": "m", "twist": "rad"}
    parameters |= {f"gain_{i}": units for i, units in enumerate(physics.gain_units)}
    return options, parameters


def _add_phases(model, physics, hydrodynamics, parameters, scales, speed_bounds):
    """Add one phase a scenario, fed by the model."""
    trajectory = Trajectory()
    options = {"hydrodynamics": lambda nodes: HydrodynamicsComp(num_nodes=nodes, **hydrodynamics)}
    options["generator"] = physics.generator
    phases = [
        add_phase(trajectory, each, physics.law, options, parameters, scales, speed_bounds)
        for each in physics.scenarios
    ]
    model.add_subsystem("traj", trajectory)
    inputs = [
        (f"{each.name}.parameters:{name}", name)
        for each in physics.scenarios
        for name in parameters
    ]
    model.promotes("traj", inputs=inputs)
    return phases


def _close_cycle(model, scenario, scales):
    """Constrain a scenario's final rotor speed to its initial one."""
    name = f"{scenario.name}_gain_of_speed"
    change = om.ExecComp("change = final - initial", units="rad/s", has_diag_partials=True)
    model.add_subsystem(name, change)
    for place, index in (("initial", 0), ("final", -1)):
        source = f"{scenario.path}.rotor_speed"
        model.connect(source, f"{name}.{place}", src_indices=om.slicer[[index], 0])
    model.add_constraint(f"{name}.change", equals=0.0, ref=scales.rotor_speed, units="rad/s")


def _distance_from_stall(physics, setup):
    """Yield the distances from stall as limits, where the setup asks for them."""
    if setup.slowed and physics.has_curve:
        about = {"law": physics.law, "spline": TorqueSpline(setup.nodes)}
        yield DistanceFromStall(**about)
        if setup.slowed > SLOWED:
            yield FartherFromStall(**about, slowed=setup.slowed)


def _add_loads(model, physics, setup):
    """Add the loads that the case limits, at the nodes of every phase."""
    names, nodes = physics.load_names, np.asarray(setup.nodes, dtype=float)
    if not names:
        return
    about = {"blade": setup.start.blade, "rotor": physics.rotor, "nodes": nodes}
    model.add_subsystem("load_table", LoadTable(names=names, **about), promotes=["*"])
    inputs = ["rotor_radius", "density", *(f"{name}_table" for name in names)]
    for scenario in physics.scenarios:
        place, n = f"loads_{scenario.name}", scenario.node_times.size
        component = LoadComp(num_nodes=n, names=names, spline=TorqueSpline(nodes))
        model.add_subsystem(place, component, promotes_inputs=inputs)
        for name in ("rotor_speed", "inflow_speed"):
            model.connect(f"{scenario.path}.{name}", f"{place}.{name}")


def _add_rates(model, physics):
    """Add the rate of the control torque, if the case limits it, at the nodes of every phase."""
    if not any(map(physics.asks_for, RATES)):
        return
    for scenario in physics.scenarios:
        place = f"rates_{scenario.name}"
        model.add_subsystem(place, TorqueRateComp(matrix=scenario.differentiation))
        model.connect(f"{scenario.path}.control_torque", f"{place}.control_torque")


def _source(scenario, name) -> str:
    """Return where the values over time of a quantity, or of a law's state, are in the model."""
    source = QUANTITIES[name].source if name in QUANTITIES else "trajectory"
    home = scenario.path if source == "trajectory" else f"{source}_{scenario.name}"
    return f"{home}.{name}"


def constraint_of(limit: Limit, number: int, scenario: Scenario) -> str:
    """Return the name of the constraint that holds a limit over time in the number-th scenario."""
    if type(limit).value is Limit.value and len(limit.inputs) == 1:  # a quantity as it is
        return _source(scenario, limit.inputs[0])
    return f"limit_{limit.name}{f'_{scenario.name}' * (number > 0)}.value"


def limited_nodes(limit: Limit, scenario: Scenario) -> np.ndarray:
    """Return the nodes of a scenario at which a limit over time is held.

    One where two segments meet: a limit that is held there twice has no definite multipliers. The
    rate of the torque alone may differ from one segment to the other.
    """
    return np.arange(scenario.node_times.size) if limit.is_of(RATES) else scenario.distinct_nodes


def _add_limit(model, physics, setup, limit: Limit, number: int, scales: Scales) -> None:
    """Constrain a limit over time at the nodes of the phase of the number-th scenario."""
    scenario, ref = physics.scenarios[number], None
    nodes = limited_nodes(limit, scenario)
    if isinstance(limit, DistanceFromStall):
        nodes, ref = _near_stall(physics, setup, limit, number, scenario), scales.torque
    elif limit.is_of(["control_torque"]) and limit.unit == "N*m":
        ref = scales.torque
    bounds = {"lower": limit.lower if np.isfinite(limit.lower) else None, "upper": None}
    if np.isfinite(limit.upper):
        less = (1.0 - setup.share_at(limit, scenario, nodes)) * abs(limit.upper)
        bounds["upper"] = limit.upper - less
        if bounds["lower"] is not None:
            bounds["lower"] = limit.lower + less
    about = {"ref": ref or _size(limit), "units": limit.unit}
    constraint = constraint_of(limit, number, scenario)
    name = constraint.removesuffix(".value")
    if name == constraint:
        about |= {"indices": nodes, "flat_indices": True}
    else:
        _add_formula(model, physics, setup, name, limit, nodes.size, n_times=nodes.size)
        for quantity in limit.series:
            source = _source(scenario, quantity)
            model.connect(source, f"{name}.{quantity}", src_indices=om.slicer[nodes, :])
    model.add_constraint(constraint, **about, **bounds)


def _add_design_limit(model, physics, setup, limit: Limit) -> None:
    """Constrain a limit on what is known of the design or of the result."""
    name, size = f"limit_{limit.name}", np.size(limit.value_of(physics.on_start(setup.start)[0]))
    _add_formula(model, physics, setup, name, limit, size)
    ends = {"lower": limit.lower, "upper": limit.upper}
    bounds = {end: value if np.all(np.isfinite(value)) else None for end, value in ends.items()}
    model.add_constraint(f"{name}.value", ref=_size(limit), units=limit.unit, **bounds)


def _size(limit) -> float:
    """Return the magnitude of a limit's bounds; 1 where they are none."""
    ends = np.abs(np.hstack((limit.lower, limit.upper)))
    return float(np.max(ends[np.isfinite(ends)], initial=0.0)) or 1.0


def _add_formula(model, physics, setup, name, formula, size, outputs=(), **about) -> None:
    """Add a formula, fed by the model with all but what it takes over time."""
    component = FormulaComp(
        formula=formula,
        size=size,
        n_stations=physics.blade.r.size,
        n_table=setup.nodes.size,
        gain_units=physics.gain_units,
        **about,
    )
    gains = [f"gain_{i}" for i in range(len(physics.gain_units))] * ("gains" in formula.inputs)
    series = {*formula.series, "gains"}
    inputs = [each for each in formula.inputs if each not in series]
    model.add_subsystem(
        name, component, promotes_inputs=[*inputs, *gains], promotes_outputs=list(outputs)
    )


def _add_attached(model, physics, setup):
    """Hold the sections off stall at the lowest tip speed ratio, which is one more unknown."""
    blade = setup.start.blade
    ratios = [known["tip_speed_ratio"] for known in physics.on_start(setup.start)]
    lowest = float(min(map(np.min, ratios)))
    fence = physics.rotor.stall_fence(physics.shape, blade, lowest)
    if not fence.stations.size:
        return
    model.design.add_output("lowest_ratio", lowest, desc="below every w R / v of the trajectories")
    model.add_design_var("lowest_ratio", lower=0.5 * lowest, upper=2.0 * lowest, ref=lowest)
    about = {"blade": blade, "rotor": physics.rotor, "stations": fence.stations}
    component = AngleComp(**about, slowed=SLOWER)
    model.add_subsystem(
        "sections", component, promotes_inputs=[*rotor_inputs(blade), "lowest_ratio"]
    )
    model.add_constraint("sections.angle_of_attack", upper=fence.highest, ref=ANGLE_UNIT)
    for scenario in physics.scenarios:
        name, n = f"above_{scenario.name}", scenario.node_times.size
        model.add_subsystem(name, AboveComp(num_nodes=n), promotes_inputs=["lowest_ratio"])
        model.connect(f"{scenario.path}.tip_speed_ratio", f"{name}.tip_speed_ratio")
        model.add_constraint(f"{name}.room", lower=0.0, ref=lowest)


def _near_stall(physics, setup, limit, place, scenario):
    """Return the nodes at which the start is near stall, or at least the nearest ones."""
    start = setup.start
    table = physics.rotor.coefficients(start.blade, limit.spline.nodes)
    known = physics.on_start(start)[place]
    known |= {"torque_coefficient_table": table.torque, "gains": start.gains}
    unit = torque_scale(known["density"], known["rotor_radius"], known["inflow_speed"])
    margin = limit.value_of(known) / (TYPICAL * unit) + limit.least
    still = settled(known)
    if np.mean(still) > 0.5:  # a heavy rotor never settles
        margin = np.where(still, margin, np.inf)
    margin = np.interp(scenario.node_times, scenario.samples, margin)
    return np.flatnonzero(margin <= max(NEAR, np.sort(margin)[min(FEWEST_NEAR, margin.size - 1)]))


def _add_integrals(model, physics, name, integrands, weights, **about):
    """Add the integrals of some rates over all scenarios, fed by the model."""
    component = IntegralComp(
        weights=weights, integrands=integrands, n_stations=physics.blade.r.size, **about
    )
    needed = {each for integrand in integrands.values() for each in integrand.inputs}
    fixed = sorted(each for each in needed if not is_over_time(each))
    model.add_subsystem(name, component, promotes_inputs=fixed, promotes_outputs=["*"])
    for scenario in physics.scenarios:
        for quantity in sorted(filter(is_over_time, needed)):
            target = f"{name}.{scenario.name}:{quantity}"
            model.connect(_source(scenario, quantity), target)


def _add_energies(model, physics):
    """Add the energies of all scenarios together."""
    integrands = {
        "energy": CapturedEnergy(),
        "generator_energy": GeneratorEnergy(),
        "electrical_energy": ElectricalEnergy(),
    }
    weights = {each.name: each.weight * each.node_weights for each in physics.scenarios}
    _add_integrals(model, physics, "integrals", integrands, weights)


def _add_objective(model, physics, setup):
    """Add the objective: an aggregate of the scenarios' mean rates, or a value of the design."""
    objective, reference = physics.objective, _objective_reference(physics, setup)
    if objective.is_rate:
        groups = list(physics.shares)
        rows = {each.name: groups.index(each.group) for each in physics.scenarios}
        weights = {each.name: each.node_weights / each.mesh.duration for each in physics.scenarios}
        about = {"rows": rows, "mean": True}
        _add_integrals(model, physics, "rates", {"mean_rate": objective}, weights, **about)
        _add_aggregate(model, physics, setup, reference)
    else:
        outputs = [("value", "objective")]
        _add_formula(model, physics, setup, "design_value", objective, 1, outputs)
    model.add_objective("objective", ref=-objective.sign * reference, units=objective.unit)


def _objective_reference(physics, setup) -> float:
    """Return a reference magnitude of the objective, in its unit.

    Designs differ by parts in a thousand: a tenth of the objective makes those visible to the
    tolerance. A start that stalls may capture nothing.
    """
    if not physics.objective.is_energy:
        return 0.1 * abs(physics.objective_at(setup.start)) or 1.0
    passing = sum(
        each.weight * float(each.sample_weights @ each.inflow.speed_at(each.samples) ** 3)
        for each in physics.scenarios
    )
    passing *= physics.density * setup.start.blade.rotor_radius**2
    return 0.1 * max(setup.start.operation.energy, 0.05 * passing)


def _add_aggregate(model, physics, setup, reference):
    """Add what unites the scenarios, its unknowns and its rows."""
    aggregate, shares = physics.aggregate, np.array(list(physics.shares.values()))
    rates = physics.mean_rates(physics.on_start(setup.start))
    unknowns = aggregate.best_unknowns(rates, shares)
    n_rows = np.size(aggregate.rows(rates, shares, unknowns))
    component = AggregateComp(
        aggregate=aggregate,
        shares=shares,
        duration=physics.duration,
        unit=physics.objective.unit,
        n_rows=n_rows,
    )
    model.add_subsystem("aggregate", component, promotes=["*"])
    scale = reference / physics.duration
    if unknowns.size:
        model.design.add_output("unknowns", unknowns, desc="unknowns of the aggregate")
        model.add_design_var("unknowns", ref=scale)
    if n_rows:
        model.add_constraint("rows", lower=0.0, ref=scale)
