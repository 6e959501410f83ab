"""A case as an OpenMDAO problem: the one place where case and physics meet.

design variables --> inertia ------------------.
   chord, twist  --> torque table (BEM) ------> trajectory: flow -> hydrodynamics -> controller ->
   shaft gain          ------------------------------'      '--> energy, the objective
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import openmdao.api as om

from hkt_mdo.case import Case
from hkt_mdo.dynamics import controllers, inflow
from hkt_mdo.dynamics.quasi_steady import LEAST, SLOWED, TYPICAL, QuasiSteady
from hkt_mdo.dynamics.rotor_ode import HydrodynamicsComp
from hkt_mdo.problem.flow import build_inflow, check_flow, flow_messages, horizon
from hkt_mdo.problem.scenario import Scales, add_trajectory, node_times, set_speed
from hkt_mdo.problem.start import StartingPoint, starting_point
from hkt_mdo.problem.turbine import build_turbine
from hkt_mdo.rotor import bem, ccblade
from hkt_mdo.rotor.airfoil import Polar
from hkt_mdo.rotor.blade import Blade
from hkt_mdo.rotor.components import InertiaComp, ShapeComp, TorqueTable
from hkt_mdo.rotor.inertia import mass_and_inertia
from hkt_mdo.rotor.shape import Shape
from hkt_mdo.rotor.torque_curve import TorqueSpline
from hkt_mdo.solve import drivers

BEM = {"vectorized": bem.rotor_coefficients, "ccblade": ccblade.rotor_coefficients}
TWIST_UNIT = np.deg2rad(5.0)  # typical change of a twist
DESIGNED = {
    "rotor_radius": "radius of the swept disc",
    "chord_control": "what makes the chord: at the stations, or control points of a spline",
    "twist_control": "what makes the twist: at the stations, control points, or the set angle",
}
DURATION = 60.0  # s, of a flow that has no end of its own
SEGMENTS_PER_PERIOD = 8.0  # of the highest frequency in the flow
FEWEST_SEGMENTS, MOST_SEGMENTS = 60, 20_000
# IPOPT's barrier is a sum over the bounds and so over the segments; the objective is not. Where it
# outweighs the objective, the iterates leave the start for the middle of all bounds.
BARRIER = 0.06
NEAR = 0.2  # of a typical torque: the recovery below which a node is held to its distance


@dataclass(frozen=True, eq=False)
class Physics:
    """What a case describes, as the objects that physics works with.

    `messages` has what was converted, repaired or left out of its files.
    """

    shape: Shape
    polar: Polar | tuple[Polar, ...]
    section_area: float | np.ndarray
    thickness: float | np.ndarray
    inflow: inflow.Inflow
    law: controllers.FeedbackLaw | None
    torque_limit: float | None
    messages: tuple[str, ...] = ()

    @property
    def blade(self) -> Blade:
        """The blade as given."""
        return self.shape.blade


def complete(case: Case) -> Case:
    """Return a case whose time span and segments are numbers, taken from its flow if need be."""
    phase = case.phase
    if phase.duration is not None and phase.segments is not None:
        return case
    own, cutoff = horizon(build_inflow(case.inflow))
    duration, segments = phase.duration or own or DURATION, phase.segments
    if segments is None:
        wanted = np.ceil(SEGMENTS_PER_PERIOD * (cutoff or 0.0) * duration - 1e-9)
        segments = int(np.clip(wanted, FEWEST_SEGMENTS, MOST_SEGMENTS))
    whole = phase.model_copy(update={"duration": duration, "segments": segments})
    return case.model_copy(update={"phase": whole})


def physics(case: Case) -> Physics:
    """Read the files that a case names and return its physics.

    Raises
    ------
    InputError
        If a blade, polar, outline or inflow file is broken, or does not fit the others.
    """
    case, control = complete(case), case.control
    law = None
    if control.law in controllers.LAWS:
        law = controllers.LAWS[control.law](control.torque_limit, control.smoothing)
    flow = build_inflow(case.inflow)
    check_flow(flow, case.phase.duration)
    time, weights = quadrature(case)
    speed = flow.speed(time)
    # that at which most energy passes; only a local Reynolds number asks for it
    speed = float(weights @ speed**4 / (weights @ speed**3))
    turbine = build_turbine(case.rotor, case.fluid, speed)
    return Physics(
        build_shape(case, turbine.blade),
        turbine.polar,
        turbine.section_area,
        turbine.thickness,
        flow,
        law,
        control.torque_limit,
        (*turbine.messages, *flow_messages(flow)),
    )


def has_curve(case: Case, world: Physics) -> bool:
    """Tell whether the optimization takes torque from a curve over the tip speed ratio.

    A local Reynolds number depends on the flow's speed too, for which the curve has no room.
    """
    return case.hydrodynamics.torque == "curve" and not isinstance(world.polar, bem.LocalReynolds)


def build_shape(case: Case, blade: Blade) -> Shape:
    """Return what of a case's blade is designed."""
    design, cosine = case.design, np.cos(blade.cone)
    radius_bounds = None
    if design.radius_bounds is not None:
        radius_bounds = tuple(float(bound * cosine) for bound in design.radius_bounds)
    if design.blade == "fixed":
        bounds = design.set_angle_bounds
        return Shape.fixed(
            blade,
            np.deg2rad(case.rotor.set_angle or 0.0),
            None if bounds is None else tuple(np.deg2rad(bounds)),
            radius_bounds,
        )
    return Shape.designed(
        blade,
        design.chord_points,
        design.twist_points,
        design.chord_bounds,
        tuple(np.deg2rad(design.twist_bounds)),
        radius_bounds,
    )


def find_start(case: Case, world: Physics, optimum) -> StartingPoint:
    """Return the start of a case's optimization: `hkt_mdo.problem.start` over the case's flow."""
    time, weights = quadrature(case)
    problem = QuasiSteady(
        world.inflow.speed(time),
        weights,
        case.fluid.density,
        world.blade.rotor_radius,
        TorqueSpline(np.linspace(0.3, 2.6, 161) * optimum.tip_speed_ratio),
        world.law,
        world.torque_limit,
    )
    gain = getattr(case.control, "gain", None)
    return starting_point(
        problem,
        world.shape,
        None if gain is None else np.atleast_1d(gain),
        world.polar,
        optimum,
        improve=case.start.method == "quasi_steady",
    )


def quadrature(case: Case):
    """Return times and trapezoidal weights (s) that sample a flow four times a segment."""
    time = np.linspace(0.0, case.phase.duration, 4 * case.phase.segments + 1)
    weights = np.full(time.size, time[1])
    weights[[0, -1]] *= 0.5
    return time, weights


@dataclass(frozen=True)
class MoveLimits:
    """How far from its start an optimization may go before it has to start anew from there.

    Rotor speed between `slower` and `faster` times the start's range; chord, disc radius and gain
    by factors, twist by an angle (rad). Wherever the case's own bounds are tighter, they hold.
    """

    slower: float = 0.6
    faster: float = 1.5
    chord: float = np.inf
    twist: float = np.inf
    radius: float = 1.2
    gain: float = 5.0

    def bounds(self, case: Case, shape: Shape, start: StartingPoint) -> dict[str, tuple]:
        """Return (lower, upper) of what the optimizer changes, and of the rotor speed.

        rotor_speed (rad/s), chord_control (m), twist_control (rad), rotor_radius (m) and gain; what
        is not designed has no entries.
        """
        speed, gains = start.operation.rotor_speed, start.gains
        chord, twist = shape.control(start.blade)
        radius = np.full(int(shape.radius_bounds is not None), start.blade.rotor_radius)
        own = case.design.gain_bounds or (-np.inf, np.inf)
        return {
            "rotor_speed": (self.slower * np.min(speed), self.faster * np.max(speed)),
            "chord_control": _within(chord / self.chord, chord * self.chord, shape.chord_bounds),
            "twist_control": _within(twist - self.twist, twist + self.twist, shape.twist_bounds),
            "rotor_radius": _within(
                radius / self.radius, radius * self.radius, shape.radius_bounds or own
            ),
            "gain": _within(*np.sort((gains / self.gain, gains * self.gain), axis=0), own),
        }


def _within(low, high, bounds):
    return np.clip(low, *bounds), np.clip(high, *bounds)


class RecoveryComp(om.ExplicitComponent):
    """Torque that brings a rotor under feedback back after it was slowed a little.

    recovery = N((1 - slowed) w) - N(w), N = Q(w, v) - u(w): positive where the rotor keeps a
    distance from stall, where stable and unstable equilibrium meet. Collocation cannot tell one
    from the other, so an optimizer would go to that edge and beyond. N(w) = I dw/dt is what the
    flow's changes ask for, and no stall. What is asked for, LEAST of a typical torque, is
    subtracted: the nearer to stall, the slower a rotor returns, and the worse the problem is
    conditioned.

    Inputs rotor_speed, inflow_speed[num_nodes, 1] (rad/s, m/s), torque_coefficient_table[n_nodes],
    density (kg/m**3), rotor_radius (m) and one scalar gain_0, gain_1, …; output
    recovery[num_nodes] (N*m).
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare("num_nodes", types=int)
        self.options.declare("spline", types=TorqueSpline, recordable=False)
        self.options.declare("law", types=controllers.FeedbackLaw, recordable=False)
        self.options.declare("slowed", default=SLOWED, desc="share of its speed that it loses")

    def setup(self):
        """Declare inputs, output and partials."""
        n, rows = self.options["num_nodes"], np.arange(self.options["num_nodes"])
        self.add_input("rotor_speed", shape=(n, 1), units="rad/s", desc="rotor speed at the nodes")
        self.add_input("inflow_speed", shape=(n, 1), units="m/s", desc="flow speed at the nodes")
        self.add_input(
            "torque_coefficient_table",
            shape=self.options["spline"].nodes.shape,
            desc="torque coefficient over tip speed ratio",
        )
        self.add_input("density", units="kg/m**3", desc="density of the water")
        self.add_input("rotor_radius", units="m", desc="radius of the swept disc")
        for i, units in enumerate(self.options["law"].gain_units):
            self.add_input(f"gain_{i}", units=units, desc="feedback gain")
        self.add_output("recovery", shape=(n,), units="N*m", desc="torque on the slowed rotor")
        self.declare_partials("recovery", "rotor_speed", rows=rows, cols=rows)
        self.declare_partials("recovery", ["torque_coefficient_table", "rotor_radius", "gain_*"])

    def _gains(self, inputs):
        n_gains = len(self.options["law"].gain_units)
        return np.array([inputs[f"gain_{i}"][0] for i in range(n_gains)])

    def _net(self, inputs, share):
        """Return N at a share of the rotor's speed, shape (num_nodes,), and its derivatives.

        By name of the input; columns of shape (num_nodes, …).
        """
        v, radius = inputs["inflow_speed"][:, 0], inputs["rotor_radius"]
        spline, law, table = self.options["spline"], self.options["law"], "torque_coefficient_table"
        gains, speed = self._gains(inputs), share * inputs["rotor_speed"][:, 0]
        scale, ratio = 0.5 * np.pi * radius**3 * inputs["density"] * v**2, speed * radius / v
        basis = spline.basis(ratio)
        driving = scale * (basis @ inputs[table])
        sloped = scale * (spline.basis(ratio, 1) @ inputs[table]) * ratio
        by = {
            "rotor_speed": share * (sloped / speed - law.torque_by_speed(speed, gains)),
            table: scale[:, None] * basis,
            "rotor_radius": ((3.0 * driving + sloped) / radius)[:, None],
        }
        for i, column in enumerate(law.torque_by_gain(speed, gains)):
            by[f"gain_{i}"] = -column[:, None]
        return driving - law.torque(speed, gains), by

    def _least(self, inputs):
        """Return the recovery that is asked for, N*m."""
        return (
            LEAST
            * TYPICAL
            * 0.5
            * np.pi
            * inputs["rotor_radius"] ** 3
            * inputs["density"]
            * inputs["inflow_speed"][:, 0] ** 2
        )

    def compute(self, inputs, outputs):
        """Evaluate the torque."""
        slowed, _ = self._net(inputs, 1.0 - self.options["slowed"])
        outputs["recovery"] = slowed - self._net(inputs, 1.0)[0] - self._least(inputs)

    def compute_partials(self, inputs, partials):
        """Differentiate it."""
        _, slowed = self._net(inputs, 1.0 - self.options["slowed"])
        _, here = self._net(inputs, 1.0)
        for name, column in slowed.items():
            partials["recovery", name] = column - here[name]
        partials["recovery", "rotor_radius"] -= (
            3.0 * self._least(inputs) / inputs["rotor_radius"]
        )[:, None]


def build_problem(
    case: Case,
    world: Physics,
    start: StartingPoint,
    nodes,
    driver=None,
    moves: MoveLimits = MoveLimits(),
    slowed: float = 0.0,
    torque_limits=None,
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
    moves : MoveLimits
    slowed : float
        Share of its speed that a rotor under feedback must be able to lose; see `RecoveryComp`.
        Only with a torque curve; 0: nothing is asked.
    torque_limits : array, shape (segments,), or None, N*m
        Of the open loop at the nodes of each segment; None: the case's own.
    """
    blade, control = start.blade, case.control
    speed, bounds = start.operation.rotor_speed, moves.bounds(case, world.shape, start)
    problem = om.Problem(driver=driver or make_driver(case), reports=False)
    model = problem.model

    design = model.add_subsystem("design", om.IndepVarComp(), promotes=["*"])
    designed = [("rotor_radius", np.atleast_1d(blade.rotor_radius), "m", blade.rotor_radius)]
    shape = world.shape
    chord, twist = shape.control(blade)  # within the bounds, but for the last digit
    chord, twist = np.clip(chord, *shape.chord_bounds), np.clip(twist, *shape.twist_bounds)
    designed += [("chord_control", chord, "m", chord), ("twist_control", twist, "rad", TWIST_UNIT)]
    designed = [each for each in designed if each[1].size]
    for name, value, units, _ in designed:
        design.add_output(name, value, units=units, desc=DESIGNED[name])
    design.add_output("density", case.fluid.density, units="kg/m**3", desc="density of the water")
    gain_units = world.law.gain_units if world.law else ()
    for i, units in enumerate(gain_units):
        design.add_output(f"gain_{i}", start.gains[i], units=units, desc="feedback gain")

    model.add_subsystem("shape", ShapeComp(shape=world.shape), promotes=["*"])
    inertia = InertiaComp(
        blade=blade,
        section_area=world.section_area,
        density=case.rotor.material_density,
        hub_inertia=case.rotor.hub_inertia,
    )
    model.add_subsystem("inertia", inertia, promotes=["*"])

    solver = {"polar": world.polar, "coefficients": BEM[case.hydrodynamics.bem]}
    parameters = {"density": "kg/m**3", "inertia": "kg*m**2", "rotor_radius": "m"}
    hydrodynamics = {}
    if has_curve(case, world):
        nodes = np.asarray(nodes, dtype=float)
        model.add_subsystem(
            "torque_table", TorqueTable(blade=blade, nodes=nodes, **solver), promotes=["*"]
        )
        hydrodynamics["spline"] = TorqueSpline(nodes)
        parameters["torque_coefficient_table"] = None
    else:
        hydrodynamics = {"blade": blade, **solver}
        parameters |= {"chord": "m", "twist": "rad"}
    parameters |= {f"gain_{i}": units for i, units in enumerate(gain_units)}

    _, inertia_at_start, _, _ = mass_and_inertia(
        blade, world.section_area, case.rotor.material_density, case.rotor.hub_inertia
    )
    torque = float(np.max(np.abs(start.operation.hydrodynamic_torque)))
    scales = Scales(float(np.mean(speed)), torque, torque / inertia_at_start)
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
        bounds["rotor_speed"],
        world.torque_limit if torque_limits is None else torque_limits,
    )

    if slowed and world.law is not None and has_curve(case, world):
        _add_recovery(model, case, world, start, hydrodynamics["spline"], slowed, torque)
    for name, _, units, unit in designed:
        if name != "rotor_radius" or world.shape.radius_bounds is not None:
            low, high = bounds[name]
            model.add_design_var(name, lower=low, upper=high, ref=unit, units=units)
    for i in range(len(gain_units)):
        low, high = (float(side[i]) for side in bounds["gain"])
        model.add_design_var(f"gain_{i}", lower=low, upper=high, ref=abs(start.gains[i]))
    # designs differ by parts in a thousand: a tenth of the energy makes those visible to the
    # tolerance; a start that stalls may capture nothing
    time, weights = quadrature(case)
    passing = weights @ world.inflow.speed(time) ** 3 * case.fluid.density * blade.rotor_radius**2
    reference = 0.1 * max(start.operation.energy, 0.05 * float(passing))
    model.add_objective("energy", ref=-reference, units="J")
    problem.driver.declare_coloring(show_summary=False, show_sparsity=False)
    problem.setup()
    set_speed(phase, time, speed, start.operation.hydrodynamic_torque)
    return problem


def _add_recovery(model, case, world, start, spline, slowed, torque):
    """Constrain a feedback trajectory to keep its distance from stall, where it is near at all."""
    phase, sampled, v = case.phase, quadrature(case)[0], world.inflow.speed
    times = node_times(phase.transcription, phase.segments, phase.order, phase.duration)
    slow, flow = (1.0 - slowed) * start.operation.rotor_speed, v(sampled)
    radius = start.blade.rotor_radius
    table = bem.rotor_coefficients(start.blade, world.polar, spline.nodes).torque
    driving, _ = spline.values(table, slow * radius / flow)
    unit = 0.5 * np.pi * radius**3 * case.fluid.density * flow**2
    margin = (driving * unit - world.law.torque(slow, start.gains)) / (TYPICAL * unit)
    margin = np.interp(times, sampled, margin)
    near = np.flatnonzero(margin <= max(NEAR, np.sort(margin)[min(20, margin.size - 1)]))

    component = RecoveryComp(num_nodes=near.size, law=world.law, spline=spline, slowed=slowed)
    names = [f"gain_{i}" for i in range(len(world.law.gain_units))]
    model.add_subsystem(
        "recovery",
        component,
        promotes_inputs=["torque_coefficient_table", "density", "rotor_radius", *names],
        promotes_outputs=["recovery"],
    )
    for name in ("rotor_speed", "inflow_speed"):
        model.connect(
            f"traj.phase.timeseries.{name}", f"recovery.{name}", src_indices=om.slicer[near, :]
        )
    model.add_constraint("recovery", lower=0.0, ref=torque, units="N*m")


def make_driver(case, progress=None, most=None):
    """Return the driver of a case, which gives up after `most` iterations if that is fewer."""
    settings, segments = case.driver, complete(case).phase.segments
    barrier = {"mu_max": BARRIER / segments} if segments > 100 else None
    return drivers.make_driver(
        settings.package,
        settings.optimizer,
        settings.tolerance,
        min(settings.max_iterations, most or settings.max_iterations),
        ipopt_options=barrier if settings.optimizer == "IPOPT" else None,
        progress=progress,
    )


def _hydrodynamics(options, num_nodes):
    return HydrodynamicsComp(num_nodes=num_nodes, **options)
