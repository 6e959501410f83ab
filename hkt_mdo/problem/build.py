"""Physics and a start as an OpenMDAO problem.

`BladeGroup` (shape, inertia, tables by BEM) feeds `OperationGroup` (phases, limits, integrals);
here both are put together, and design variables and objective are declared.
"""

from dataclasses import replace
from itertools import count

import numpy as np
import openmdao.api as om
from scipy.interpolate import CubicSpline

from hkt_mdo.dynamics.rotor_ode import WAKE_STATES
from hkt_mdo.errors import InputError
from hkt_mdo.problem.evaluation import epigraph, objective_at, on_start
from hkt_mdo.problem.model import Physics, numbered
from hkt_mdo.problem.operation_group import OperationGroup
from hkt_mdo.problem.point import Operation, StartingPoint
from hkt_mdo.problem.scenario import Scenario
from hkt_mdo.problem.setup import THICKNESS_UNIT, TWIST_UNIT, Setup
from hkt_mdo.quantities import meta_of
from hkt_mdo.rotor.band import ALONG
from hkt_mdo.rotor.components import BladeGroup, rotor_inputs
from hkt_mdo.solve import drivers
from hkt_mdo.solve.driver_base import ReportingDriver
from hkt_mdo.solve.totals import Substitution

WAKE_SHARE = 0.3  # typical axial induction
# IPOPT's barrier is a sum over the bounds and so over the segments; the objective is not. Where it
# is larger than the possible gain over the start, the iterates first move towards the middle of all
# bounds, and most iterations are needed to return.
BARRIER = 6e-3
# Largest barrier of an open loop on a finer mesh, over the mean product of multiplier and distance
# from a bound: a larger one drives the iterates from the optimum again (`river25` with open loop
# takes 127 s for 73). On the way to a first optimum it may lead to a better one (0.5 % of
# rm1_turbulent_limits).
LARGEST_BARRIER = 1.0
# Every step from which the Hessian is approximated costs time over all segments in each iteration.
# Under a law the number of degrees of freedom is that of the design variables, however many
# segments there are: few steps suffice. They also suffice an open loop on its way to the optimum of
# a first mesh, but not for the last digits on a finer one.
FEW_STEPS, LATER_STEPS, MANY_SEGMENTS = 15, 30, 500
# Steps of negative curvature, which do not change the approximated Hessian, after which IPOPT
# forgets it under feedback. After two, its default, it creeps by steepest descent: turbine 14 of
# `make verify PART=turbines` with `quadratic` takes 1084 iterations, here 312, and where it never
# forgets 921. With an open loop turbine 16 takes 803 for 271. In the search for a start turbine 18
# with `quadratic` ends 0.33 % lower.
MOST_SKIPPED = 10
_NUMBERS = count(1)


def assemble(physics: Physics, setup: Setup, driver: ReportingDriver | None = None) -> om.Problem:
    """Return the problem of some physics at a setup.

    Parameters
    ----------
    physics : Physics
    setup : Setup
        Where the optimization begins, and how far it may go.
    driver : ReportingDriver, optional
        By default the case's own.

    Returns
    -------
    om.Problem
        Set up, at its start.
    """
    # by its setup OpenMDAO deletes the reports of a problem of the same name in the current folder
    name = f"hkt_mdo_{next(_NUMBERS)}"
    problem = om.Problem(driver=driver or make_driver(physics), name=name, reports=False)
    problem.model.linear_solver = Substitution()
    add_turbine(problem.model, physics, setup, alone=True)
    ref = -physics.objective.sign * _objective_reference(physics, setup)
    problem.model.add_objective("objective", ref=ref, units=physics.objective.unit)
    problem.driver.declare_coloring(show_summary=False, show_sparsity=False)
    problem.setup()
    return problem


def add_turbine(group: om.Group, physics: Physics, setup: Setup, alone: bool = False) -> None:
    """Add rotor and operation to a group, with its design variables and limits.

    Parameters
    ----------
    group : om.Group
        The model, or a group in its setup.
    physics : Physics
    setup : Setup
        Where the optimization begins, and how far it may go.
    alone : bool
        Whether quantities that are not designed are set to constants, or are inputs of the group.
    """
    band = setup.band(physics)
    designed, constants = _declare_design(group, physics, setup)
    designed |= _unknowns(group, physics, setup)
    if outputs := designed | (constants if alone else {}):
        design = group.add_subsystem("design", om.IndepVarComp(), promotes=["*"])
        for name, options in outputs.items():
            design.add_output(name, **options)
    for name in constants.keys() - outputs.keys():
        group.set_input_defaults(name, constants[name]["val"], units=constants[name]["units"])
    _add_rotors(group, physics, setup, band)
    operation = OperationGroup(physics, setup, _references(physics, setup), band)
    group.add_subsystem("operation", operation, promotes=["*"])


def _add_rotors(group, physics, setup, band):
    """Add shape, inertia and tables of the rotor; these once more for another turbine or water."""
    names = ["torque_coefficient"] * physics.has_curve + [*physics.load_names]
    tables = [f"{name}_table" for name in (ALONG if band else names)]
    tables += [f"{name}_band" for name in names if band]
    weight = physics.asks_for("weight_stress")
    outputs = ["inertia", *tables, *["weight_stress"] * weight]
    for number, model in enumerate(physics.rotors.values()):
        rotor = BladeGroup(
            rotor=replace(model, solver=physics.case.hydrodynamics.bem),
            blade=setup.start.blade,
            shape=None if number else physics.shape,
            nodes=np.asarray(setup.nodes, dtype=float),
            names=names,
            band=band,
            weight=weight,
        )
        renamed = [(name, numbered(name, number)) for name in outputs]
        promotes = {"promotes_inputs": ["*"], "promotes_outputs": renamed if number else ["*"]}
        group.add_subsystem(numbered("rotor", number), rotor, **promotes)


def make_driver(physics: Physics, progress=None, refined=False) -> ReportingDriver:
    """Return the driver of a problem; `refined`: from the optimum on a coarser mesh."""
    settings, law = physics.case.driver, physics.law
    segments = sum(scenario.segments for scenario in physics.scenarios)
    refined = refined and not law.is_feedback
    skipped = {"limited_memory_max_skipping": MOST_SKIPPED} if law.is_feedback else {}
    ipopt = drivers.near_start(BARRIER / segments) | skipped
    if refined:
        ipopt["sigma_max"] = LARGEST_BARRIER
    if segments > MANY_SEGMENTS:
        ipopt["limited_memory_max_history"] = LATER_STEPS if refined else FEW_STEPS
    options = settings.package, settings.optimizer, settings.tolerance, settings.max_iterations
    return drivers.make_driver(*options, ipopt=ipopt, progress=progress)


def _references(physics, setup) -> dict[str, float]:
    """Return the reference magnitudes of the phases, from the start, by their names in the model.

    A torque's over the inertia is that of the acceleration.
    """
    operation = setup.start.operation
    torque = float(np.max(np.abs(operation.hydrodynamic_torque)))
    _, inertia = physics.rotor.mass_and_inertia(setup.start.blade)
    refs = {"control_torque": torque, "rotor_acceleration": torque / inertia}
    refs["rotor_speed"] = float(np.mean(operation.rotor_speed))
    if physics.remembers:
        fastest = max(np.max(start["inflow_speed"]) for start in on_start(physics, setup.start))
        tau1 = physics.case.inflow_dynamics.tau1 or setup.start.blade.rotor_radius / fastest
        for name in WAKE_STATES:
            refs[name] = WAKE_SHARE * float(fastest)
            refs[f"{name}_rate"] = refs[name] / tau1
    return refs | _references_of_law(physics, setup.start)


def _references_of_law(physics, start) -> dict[str, float]:
    """Return those of the law's states and rates.

    That of a rate is its change if the speed and the states change by their magnitudes.
    """
    if not physics.law.states:
        return {}
    starts = on_start(physics, start)
    names = "rotor_speed", "inflow_speed", *physics.law.states
    speed, flow, *states = (np.concatenate([each[name] for each in starts]) for name in names)
    sizes = np.max(np.abs([speed, *states]), axis=1)
    sizes[sizes == 0.0] = 1.0  # SI unit; a state that is zero in equilibrium has no size there
    slopes = physics.law.slopes(speed, flow, start.gains, *states)[1:]
    rates = np.max(np.abs(slopes), axis=2) @ sizes
    for name in np.array([*physics.law.states])[rates == 0.0]:
        problem = f"has a rate of {name} that depends neither on the speed nor on a state"
        raise InputError(problem, "correct rates", key="control.law", value=physics.law.law)
    names = [*physics.law.states, *(f"{name}_rate" for name in physics.law.states)]
    return dict(zip(names, (*sizes[1:], *rates), strict=True))


def _declare_design(model, physics, setup) -> tuple[dict, dict]:
    """Declare the design variables; return them, and the quantities that are not designed."""
    start, bounds, designed, constants = setup.start, setup.bounds(physics), {}, {}
    blade, law = start.blade, physics.law
    control = physics.shape.within(blade)  # but for the last digit, they are
    refs = {"twist": TWIST_UNIT, "thickness": THICKNESS_UNIT}
    rows = [("rotor_radius", blade.rotor_radius, blade.rotor_radius)]
    rows += [(f"{name}_control", value, refs.get(name, value)) for name, value in control.items()]
    if physics.designs_hub:
        hub = np.clip(blade.hub_inertia, *bounds["hub_inertia"])
        rows.append(("hub_inertia", hub, physics.rotor.mass_and_inertia(blade)[1]))
    rows += zip(law.named_gains, start.gains, law.sizes(start.gains), strict=True)
    for name, value, ref in rows:
        units, text = law.named_gains.get(name) or meta_of(name.removesuffix("_control")).values()
        if name in bounds:
            low, high = bounds[name]
            model.add_design_var(name, lower=low, upper=high, ref=ref, units=units)
        text = f"design variables: {text}" if name.endswith("_control") else text
        options = {"val": value, "units": units, "desc": text}
        (designed if name in bounds else constants)[name] = options
    for number, rotor in enumerate(physics.rotors.values()):
        constants[numbered("density", number)] = meta_of("density") | {"val": rotor.water_density}
    if "thickness" not in control and physics.asks_for("thickness"):
        thickness = np.broadcast_to(physics.turbine.thickness, blade.r.shape)
        constants["thickness"] = meta_of("thickness") | {"val": thickness}
    return designed, constants


def _unknowns(model, physics, setup) -> dict[str, dict]:
    """Declare the unknowns of the aggregate, and that its rows are not negative."""
    objective = physics.objective
    if not objective.is_rate:
        return {}
    unknowns, n_rows = epigraph(physics, setup.start)
    scale = _objective_reference(physics, setup) / physics.case.phase.duration
    if n_rows:
        model.add_constraint("rows", lower=0.0, ref=scale)
    if not unknowns.size:
        return {}
    model.add_design_var("unknowns", ref=scale)
    meta = {"units": objective.function_unit, "desc": "of the aggregate"}
    return {"unknowns": {"val": unknowns} | meta}


def _objective_reference(physics, setup) -> float:
    """Return a reference magnitude of the objective, in its unit.

    Designs differ by parts in a thousand: a tenth of the objective makes those visible to the
    tolerance. A start that stalls may capture nothing.
    """
    if not physics.objective.is_energy:
        return 0.1 * abs(objective_at(physics, setup.start)) or 1.0
    speed, weights = physics.sampled_flow
    passing = float(weights @ speed**3) * physics.density * setup.start.blade.rotor_radius**2
    return 0.1 * max(setup.start.operation.energy, 0.05 * passing)


def point_of(physics: Physics, problem) -> StartingPoint:
    """Return the present design and trajectories of a problem as the start of another.

    Parameters
    ----------
    physics
        The physics at whose samples the trajectories are taken; of this or of a finer mesh.
    problem : openmdao.api.Problem
        The problem, its model run.
    """

    def sampled(scenario, name):
        values = series(problem, scenario, name)
        if scenario.steady:
            return values
        time, first = np.unique(series(problem, scenario, "time"), return_index=True)
        return CubicSpline(time, values[first])(scenario.samples)

    speed, torque, *states = (
        np.concatenate([sampled(scenario, name) for scenario in physics.scenarios])
        for name in ("rotor_speed", "hydrodynamic_torque", *physics.law.states)
    )
    gains = [problem.get_val(name)[0] for name in physics.law.named_gains]
    hub = problem.get_val("hub_inertia")[0] if physics.designs_hub else None
    blade = physics.sized(problem.get_val("rotor_radius")[0], hub)
    names = [name for name in rotor_inputs(blade) if name != "rotor_radius"]
    return StartingPoint(
        blade.with_shape(*map(problem.get_val, names)),
        np.array(gains, dtype=float),
        Operation(float(problem.get_val("energy")[0]), speed, torque, states=tuple(states)),
    )


def series(problem, scenario: Scenario, name: str) -> np.ndarray:
    """Return a quantity over time of a scenario in a problem, (n_nodes,)."""
    return problem.get_val(scenario.source(name)).ravel()
