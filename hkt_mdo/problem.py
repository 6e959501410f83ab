"""A case as an OpenMDAO problem: the one place where case and physics meet.

design variables --> inertia ------------------.
   chord, twist  --> torque table (BEM) ------> trajectory: flow -> hydrodynamics -> controller ->
   shaft gain          ------------------------------'      '--> energy, the objective
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import openmdao.api as om

from hkt_mdo import drivers
from hkt_mdo.case import Case
from hkt_mdo.dynamics import controllers, inflow
from hkt_mdo.dynamics.rotor_ode import HydrodynamicsComp
from hkt_mdo.rotor import bem, ccblade
from hkt_mdo.rotor.airfoil import Outline, Polar
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.inertia import InertiaComp
from hkt_mdo.rotor.torque_curve import TorqueSpline, TorqueTable
from hkt_mdo.starting_point import QuasiSteady, StartingPoint, starting_point
from hkt_mdo.trajectory import Scales, add_trajectory, set_speed

BEM = {"vectorized": bem.rotor_coefficients, "ccblade": ccblade.rotor_coefficients}
INFLOWS = {
    "constant": lambda s: inflow.ConstantInflow(s.speed),
    "step": lambda s: inflow.StepInflow(s.before, s.after, s.time, s.width),
    "sine": lambda s: inflow.SineInflow(s.mean, s.amplitude, s.angular_frequency, s.phase, s.scale),
}


@dataclass(frozen=True, eq=False)
class Physics:
    """What a case describes, as the objects that physics works with."""

    blade: Blade
    polar: Polar
    section_area: float
    inflow: inflow.Inflow
    law: controllers.FeedbackLaw | None
    torque_limit: float | None
    chord_bounds: tuple[float, float]
    twist_bounds: tuple[float, float]


def physics(case: Case) -> Physics:
    """Read the files that a case names and return its physics.

    Raises
    ------
    InputError
        If a blade, polar or outline file is broken.
    """
    rotor, control = case.rotor, case.control
    hub_radius = rotor.hub_radius_fraction * rotor.radius
    if rotor.chord is not None:
        blade = Blade(
            np.array(rotor.stations) * rotor.radius,
            np.array(rotor.chord),
            np.deg2rad(rotor.twist),
            hub_radius,
            rotor.radius,
            rotor.blade_count,
        )
    else:
        blade = Blade.from_csv(
            rotor.blade,
            rotor.stations,
            rotor.radius,
            hub_radius,
            rotor.blade_count,
            np.deg2rad(rotor.set_angle),
        )
    law = None
    if control.law in controllers.LAWS:
        law = controllers.LAWS[control.law](control.torque_limit, control.smoothing)
    return Physics(
        blade,
        Polar.from_csv(rotor.polar),
        Outline.from_csv(rotor.outline).area,
        INFLOWS[case.inflow.profile](case.inflow),
        law,
        control.torque_limit,
        case.design.chord_bounds,
        tuple(np.deg2rad(case.design.twist_bounds)),
    )


def find_start(case: Case, world: Physics, optimum) -> StartingPoint:
    """Return the start of a case's optimization: `hkt_mdo.starting_point` over the case's flow."""
    time, weights = quadrature(case)
    problem = QuasiSteady(
        world.inflow.speed(time),
        weights,
        case.fluid.density,
        case.rotor.radius,
        TorqueSpline(np.linspace(0.3, 2.6, 161) * optimum.tip_speed_ratio),
        world.law,
        world.torque_limit,
    )
    gain = getattr(case.control, "gain", None)
    return starting_point(
        problem,
        world.blade,
        None if gain is None else np.atleast_1d(gain),
        world.polar,
        world.chord_bounds,
        world.twist_bounds,
        optimum.tip_speed_ratio * np.geomspace(0.75, 2.0, 10),
        fixed_blade=case.design.blade == "fixed",
        improve=case.start.method == "quasi_steady",
    )


def quadrature(case: Case):
    """Return times and trapezoidal weights (s) that sample a flow four times a segment."""
    time = np.linspace(0.0, case.phase.duration, 4 * case.phase.segments + 1)
    weights = np.full(time.size, time[1])
    weights[[0, -1]] *= 0.5
    return time, weights


def build_problem(
    case: Case, world: Physics, start: StartingPoint, nodes, driver=None
) -> om.Problem:
    """Return the OpenMDAO problem of a case, set up at its start and ready to run.

    Parameters
    ----------
    case : Case
    world : Physics
    start : StartingPoint
    nodes : array, shape (n_nodes,)
        Tip speed ratios of the torque curve.
    driver : om.Driver or None
        None: the case's own.
    """
    blade, control = start.blade, case.control
    speed = start.operation.rotor_speed
    problem = om.Problem(driver=driver or make_driver(case), reports=False)
    model = problem.model

    design = model.add_subsystem("design", om.IndepVarComp(), promotes=["*"])
    design.add_output("chord", blade.chord, units="m", desc="chord at the stations")
    design.add_output(
        "twist", blade.twist, units="rad", desc="twist at the stations, set angle included"
    )
    design.add_output("density", case.fluid.density, units="kg/m**3", desc="density of the water")
    gain_units = world.law.gain_units if world.law else ()
    for i, units in enumerate(gain_units):
        design.add_output(f"gain_{i}", start.gains[i], units=units, desc="feedback gain")

    inertia = InertiaComp(
        blade=blade,
        section_area=world.section_area,
        density=case.rotor.material_density,
        hub_inertia=case.rotor.hub_inertia,
    )
    model.add_subsystem("inertia", inertia, promotes=["*"])

    solver = {"polar": world.polar, "coefficients": BEM[case.hydrodynamics.bem]}
    parameters = {"density": "kg/m**3", "inertia": "kg*m**2"}
    hydrodynamics = {"tip_radius": blade.tip_radius}
    if case.hydrodynamics.torque == "curve":
        nodes = np.asarray(nodes, dtype=float)
        model.add_subsystem(
            "torque_table", TorqueTable(blade=blade, nodes=nodes, **solver), promotes=["*"]
        )
        hydrodynamics["spline"] = TorqueSpline(nodes)
        parameters["torque_coefficient_table"] = None
    else:
        hydrodynamics |= {"blade": blade, **solver}
        parameters |= {"chord": "m", "twist": "rad"}
    parameters |= {f"gain_{i}": units for i, units in enumerate(gain_units)}

    torque = float(np.max(start.operation.hydrodynamic_torque))
    scales = Scales(float(np.mean(speed)), torque, torque / _inertia(inertia, blade))
    phase = add_trajectory(
        model,
        case.phase,
        world.law,
        getattr(control, "unknown", "speed"),
        {
            "inflow": world.inflow,
            "hydrodynamics": partial(_hydrodynamics, hydrodynamics),
        },
        parameters,
        scales,
        (0.6 * float(np.min(speed)), 1.5 * float(np.max(speed))),
        world.torque_limit,
    )

    if case.design.blade == "optimized":
        chord_low, chord_high = case.design.chord_bounds
        twist_low, twist_high = case.design.twist_bounds
        model.add_design_var("chord", lower=chord_low, upper=chord_high, ref=blade.chord, units="m")
        model.add_design_var("twist", lower=twist_low, upper=twist_high, ref=5.0, units="deg")
    for i in range(len(gain_units)):
        gain = start.gains[i]
        low, high = case.design.gain_bounds or sorted((0.2 * gain, 5.0 * gain))
        model.add_design_var(f"gain_{i}", lower=low, upper=high, ref=abs(gain))
    # designs differ by parts in a thousand: a tenth of the energy makes those visible to the
    # tolerance
    model.add_objective("energy", ref=-0.1 * start.operation.energy, units="J")
    problem.driver.declare_coloring(show_summary=False, show_sparsity=False)
    problem.setup()
    time, _ = quadrature(case)
    set_speed(phase, time, speed, start.operation.hydrodynamic_torque)
    return problem


def make_driver(case, progress=None):
    """Return the driver of a case."""
    settings = case.driver
    return drivers.make_driver(
        settings.package,
        settings.optimizer,
        settings.tolerance,
        settings.max_iterations,
        progress=progress,
    )


def _hydrodynamics(options, num_nodes):
    return HydrodynamicsComp(num_nodes=num_nodes, **options)


def _inertia(component, blade):
    return float(component._evaluate({"chord": blade.chord})[1])
