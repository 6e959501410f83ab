"""The rotor over time as a Dymos trajectory; the only module that knows Dymos' phase API."""

from dataclasses import dataclass

import dymos as dm
import numpy as np
import openmdao.api as om
from dymos.utils.hermite import hermite_matrices
from dymos.utils.lagrange import lagrange_matrices
from dymos.utils.lgl import lgl
from dymos.utils.lgr import lgr
from scipy.sparse import block_diag

from hkt_mdo.dynamics.rotor_ode import RotorODE
from hkt_mdo.solve.totals import Substitution


@dataclass(frozen=True)
class Scales:
    """Reference magnitudes of one problem, from its start: every `ref` of the trajectory.

    rotor_speed (rad/s), torque (N*m), acceleration (rad/s**2): a typical torque over the inertia.
    """

    rotor_speed: float
    torque: float
    acceleration: float


def _blocks(grid, given, wanted, matrices, sparse):
    """Return a grid's interpolation matrices: one block a segment.

    Dymos assembles them dense before it takes their nonzeros, in memory that grows with the square
    of the segments: gigabytes for an hour.
    """
    blocks = []
    for segment in range(grid.num_segments):
        nodes = []
        for name in (given, wanted):
            first, last = grid.subset_segment_indices[name][segment]
            nodes.append(grid.node_stau[grid.subset_node_indices[name][first:last]])
        blocks.append(matrices(*nodes))
    found = (block_diag(each, format="csr") for each in zip(*blocks, strict=True))
    return tuple(each if sparse else each.toarray() for each in found)


class _Lean:
    """Lets a phase of thousands of segments be set up, and one without states.

    With rotor speed as a control nothing needs collocation; Dymos sets such a phase up but for a
    component of initial guesses, which refuses to be empty.
    """

    def init_grid(self):
        """Give the grid matrices that are sparse from the start."""
        super().init_grid()
        grid = self.grid_data

        def lagrange(given, wanted, sparse=False):
            return _blocks(grid, given, wanted, lagrange_matrices, sparse)

        def hermite(given, wanted, sparse=False):
            return _blocks(grid, given, wanted, hermite_matrices, sparse)

        grid.phase_lagrange_matrices, grid.phase_hermite_matrices = lagrange, hermite

    def setup_states(self, phase):
        """Skip the component where there are no states."""
        if phase.state_options:
            super().setup_states(phase)

    def configure_states(self, phase):
        """Skip the component where there are no states."""
        if phase.state_options:
            super().configure_states(phase)


class GaussLobatto(_Lean, dm.GaussLobatto):
    """Gauss-Lobatto transcription; see `_Lean`."""


class Radau(_Lean, dm.Radau):
    """Radau transcription; see `_Lean`."""


class EnergyComp(om.ExplicitComponent):
    """Energy over the phase by the transcription's own quadrature, exact for its power polynomials.

    For a pure quadrature, collocation of a state and this weighted sum are the same numbers; the
    sum needs no unknowns, so the optimizer cannot trade energy against defects, and costs nothing
    to solve.

    Inputs hydrodynamic_power, generator_power[num_nodes, 1] (W); outputs energy, generator_energy
    (J).
    """

    def initialize(self):
        """Declare the options."""
        self.options.declare("weights", types=np.ndarray, desc="quadrature weights of the nodes, s")

    def setup(self):
        """Declare inputs and outputs."""
        n = self.options["weights"].size
        for name, total in self._pairs():
            self.add_input(
                name, shape=(n, 1), units="W", desc=f"{name.replace('_', ' ')} at the nodes"
            )
            self.add_output(total, units="J", desc=f"integral of {name} over the phase")

    def setup_partials(self):
        """Declare the constant partials: the weights."""
        for name, total in self._pairs():
            self.declare_partials(total, name, val=self.options["weights"][None, :])

    def compute(self, inputs, outputs):
        """Integrate."""
        for name, total in self._pairs():
            outputs[total] = self.options["weights"] @ inputs[name][:, 0]

    @staticmethod
    def _pairs():
        return ("hydrodynamic_power", "energy"), ("generator_power", "generator_energy")


def node_weights(transcription, segments, order, duration):
    """Return the quadrature weights of a phase's nodes, in the order of its time series.

    Parameters
    ----------
    transcription : {"gauss-lobatto", "radau"}
    segments, order : int
    duration : float, s

    Returns
    -------
    ndarray, shape (num_nodes,), s
    """
    if transcription == "radau":  # order LGR points and the segment's end, which has no weight
        weights = np.append(lgr(order, include_endpoint=False)[1], 0.0)
    else:
        weights = lgl(order)[1]
    return np.tile(0.5 * duration / segments * weights, segments)


def node_times(transcription, segments, order, duration):
    """Return the times of a phase's nodes, s, in the order of its time series.

    Parameters are those of `node_weights`.
    """
    if transcription == "radau":
        places = np.append(lgr(order, include_endpoint=False)[0], 1.0)
    else:
        places = lgl(order)[0]
    starts = np.arange(segments)[:, None]
    return ((starts + 0.5 * (places + 1.0)) * duration / segments).ravel()


def add_trajectory(
    model, case_phase, law, unknown, ode_options, parameters, scales, speed_bounds, torque_limit
):
    """Add the trajectory and its energy to a model.

    Parameters
    ----------
    model : om.Group
        Its promoted outputs named in `parameters` feed the phase; gets the outputs energy and
        generator_energy, and the group `traj` with the phase `phase`.
    case_phase : hkt_mdo.case.Phase
        Duration, segments, transcription, order, initial speed.
    law : FeedbackLaw or None
        None: open loop.
    unknown : {"speed", "torque"}
        What the open loop chooses.
    ode_options : dict
        Options of `RotorODE` besides law and unknown.
    parameters : dict of str to str or None
        ODE inputs fed by the model, with their units.
    scales : Scales
    speed_bounds : (float, float), rad/s
    torque_limit : float, array of shape (segments,), or None, N*m
        Of the open loop at the nodes, one or one a segment; a feedback law saturates itself.
    """
    transcription = {"gauss-lobatto": GaussLobatto, "radau": Radau}[case_phase.transcription]
    phase = dm.Phase(
        ode_class=RotorODE,
        ode_init_kwargs={"law": law, "unknown": unknown, **ode_options},
        transcription=transcription(
            num_segments=case_phase.segments, order=case_phase.order, compressed=True
        ),
    )
    trajectory = dm.Trajectory()
    trajectory.add_phase("phase", phase)
    model.add_subsystem("traj", trajectory)
    model.linear_solver = Substitution()
    phase.set_time_options(fix_initial=True, fix_duration=True, units="s", targets=["time"])
    for name, units in parameters.items():
        phase.add_parameter(name, opt=False, units=units, static_targets=True)
        model.promotes("traj", inputs=[(f"phase.parameters:{name}", name)])

    bounds = {
        "lower": speed_bounds[0],
        "upper": speed_bounds[1],
        "ref": scales.rotor_speed,
        "units": "rad/s",
    }
    if law is None and unknown == "speed":
        phase.add_control(
            "rotor_speed",
            targets=["rotor_speed"],
            rate_targets=["rotor_acceleration"],
            continuity=True,
            rate_continuity=True,
            rate_continuity_ref=scales.rotor_speed,
            **bounds,
        )
        # a path constraint of Dymos has one limit for all segments
        upper = None
        if torque_limit is not None:
            limits = np.broadcast_to(np.asarray(torque_limit, dtype=float), case_phase.segments)
            n_nodes = node_weights(case_phase.transcription, 1, case_phase.order, 1.0).size
            upper = np.repeat(limits, n_nodes)[:, None]
        model.add_constraint(
            "traj.phase.timeseries.control_torque",
            lower=0.0,
            upper=upper,
            ref=scales.torque,
            units="N*m",
        )
    else:
        phase.add_state(
            "rotor_speed",
            rate_source="rotor_acceleration",
            targets=["rotor_speed"],
            defect_ref=scales.acceleration,
            **bounds,
        )
        if law is None:
            phase.add_control(
                "control_torque",
                targets=["control_torque"],
                continuity=True,
                rate_continuity=True,
                rate_continuity_ref=scales.torque,
                lower=0.0,
                upper=None if torque_limit is None else float(np.min(torque_limit)),
                ref=scales.torque,
                units="N*m",
            )
    if case_phase.initial_speed == "equilibrium" or (
        case_phase.initial_speed == "auto" and law is not None
    ):
        # where speed is the control, its acceleration is the control's rate
        inverse = law is None and unknown == "speed"
        phase.add_boundary_constraint(
            "rotor_speed_rate" if inverse else "rotor_acceleration",
            loc="initial",
            equals=0.0,
            ref=scales.acceleration,
            units="rad/s**2",
        )
    for name in (
        "inflow_speed",
        "tip_speed_ratio",
        "hydrodynamic_torque",
        "control_torque",
        "hydrodynamic_power",
        "generator_power",
    ):
        phase.add_timeseries_output(name)

    weights = node_weights(
        case_phase.transcription, case_phase.segments, case_phase.order, case_phase.duration
    )
    model.add_subsystem(
        "energy", EnergyComp(weights=weights), promotes_outputs=["energy", "generator_energy"]
    )
    for name in ("hydrodynamic_power", "generator_power"):
        model.connect(f"traj.phase.timeseries.{name}", f"energy.{name}")
    return phase


def set_speed(phase, time, rotor_speed, torque):
    """Set the phase's time span and the start of its unknowns from a sampled trajectory.

    Parameters
    ----------
    phase : dm.Phase
    time, rotor_speed, torque : array, shape (n_times,), s, rad/s, N*m
    """
    phase.set_time_val(initial=time[0], duration=time[-1] - time[0], units="s")
    for names, setter in (
        (phase.control_options, phase.set_control_val),
        (phase.state_options, phase.set_state_val),
    ):
        for name, values in (("rotor_speed", rotor_speed), ("control_torque", torque)):
            if name in names:
                setter(name, values, time_vals=time, interpolation_kind="cubic")
