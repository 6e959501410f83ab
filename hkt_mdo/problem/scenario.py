"""Scenarios: a flow over a time span on a mesh; the only module that knows Dymos' phases."""

import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import ClassVar
from unittest.mock import patch

import numpy as np
from openmdao.utils.om_warnings import OMDeprecationWarning
from scipy.sparse import block_diag, csr_array, diags_array, eye_array, kron, lil_array

from hkt_mdo.case import Phase
from hkt_mdo.case.turbine import Condition
from hkt_mdo.dynamics.flows import UNKNOWN_PIECES, Inflow
from hkt_mdo.dynamics.limits import CavitationLimit, Limit
from hkt_mdo.dynamics.radau import divided
from hkt_mdo.dynamics.rotor_ode import WAKE_STATES, RotorODE
from hkt_mdo.errors import InputError
from hkt_mdo.quantities import QUANTITIES, TRAJECTORY

# Dymos uses deprecated names of OpenMDAO, which does not concern the user
with warnings.catch_warnings():
    warnings.simplefilter("ignore", OMDeprecationWarning)
    import dymos as dm
    from dymos.transcriptions import grid_data
    from dymos.transcriptions.common import continuity_comp, control_comp
    from dymos.utils.lagrange import lagrange_matrices
    from dymos.utils.lgl import lgl
    from dymos.utils.lgr import lgr

MOST_SEGMENTS = 20_000
RESOLVED = 5e-6  # sum of the errors of the segments' quadratures of v³, over the whole
SAMPLES = 20  # a segment, of the independent integration and between the nodes
# largest error of the flow between a segment's samples, over its largest speed there
FLOW_MISSED = 1e-4
MORE_SEGMENTS = 0.25  # of `MOST_SEGMENTS`, to resolve the flow's features where they are
SHORTEST = 1e-9  # segment that is divided for a feature, over the duration
OWN = (None, None, None)  # turbine of a scenario in the case's own water, condition and depth
MOST_INTERVALS = 200  # of operation: each is a phase of the problem and adds to the time of setup
LONG = 10.0  # s, length of a segment in which a rotor comes into balance with the flow


@dataclass(frozen=True, eq=False)
class Scenario:
    """A flow over a time span, on a mesh.

    `mesh` is that of a complete case: duration and segments are numbers. `edges` (s) are the ends
    of the segments, in the time of the flow; None: they are equal, from 0 to the duration. `weight`
    is that of the scenario's energies in those of the problem, `name` that of its Dymos phase.
    `limits` are those that hold in it over time. `turbine` has the density of the water (kg/m**3),
    the condition of the turbine and the limit on cavitation in it, None: the case's; scenarios with
    the same ones share one physics. Intervals of one scenario, between which the machine stands
    still, have one `group`.
    """

    inflow: Inflow
    mesh: Phase
    weight: float = 1.0
    name: str = "phase"
    edges: np.ndarray = None  # type: ignore[assignment]
    limits: tuple[Limit, ...] = ()
    interval_of: str = ""
    turbine: tuple[float | None, Condition | None, CavitationLimit | None] = OWN

    steady: ClassVar[bool] = False
    """Whether it has no time: speeds of the flow, at each of which the rotor is in equilibrium."""

    @property
    def group(self) -> str:
        """Name of the scenario, or of that of which it is an interval."""
        return self.interval_of or self.name

    def __post_init__(self):
        if self.edges is None:
            edges = np.linspace(0.0, self.mesh.duration, self.mesh.segments + 1)
            object.__setattr__(self, "edges", edges)

    @property
    def segments(self) -> int:
        """Number of segments."""
        return self.edges.size - 1

    @property
    def duration(self) -> float:
        """Time from the first to the last of the edges, s."""
        return float(self.edges[-1] - self.edges[0])

    def within(self, share: np.ndarray) -> np.ndarray:
        """Return times, s, at shares (0 to 1) of the length of every segment, one after another."""
        return (self.edges[:-1, None] + np.diff(self.edges)[:, None] * share).ravel()

    def when(self, time: float) -> str:
        """Return the words for a place in it, where `time` (s) is."""
        return f"t = {time:.2f} s"

    def divided(self, parts: np.ndarray) -> "Scenario":
        """Return this scenario with each segment divided into a number of equal parts."""
        return replace(self, edges=divided(self.edges, parts))

    def resolved(self) -> "Scenario":
        """Return this scenario with segments that are divided until they resolve the flow.

        That is: until `flow_errors` and `flow_missed` are small in all, or there are too many
        segments. The first weighs a gust by its energy; but a gust of seconds in a season has
        little energy and may still break a limit.
        """
        made = self
        while made.segments < MOST_SEGMENTS:
            coarse = too_large(made.flow_errors, RESOLVED)
            if not np.any(coarse):
                break
            made = made.divided(1 + coarse)
        while True:
            long = np.diff(made.edges) > SHORTEST * self.duration
            coarse = (made.flow_missed > FLOW_MISSED) & long
            most = (1.0 + MORE_SEGMENTS) * MOST_SEGMENTS
            if not np.any(coarse) or made.segments + np.sum(coarse) > most:
                return made
            made = made.divided(1 + coarse)

    @property
    def flow_errors(self) -> np.ndarray:
        """Errors of the mesh's quadrature of v³ in every segment, over the whole integral."""
        exact = self.inflow.cubes(self.edges)
        cubes = self.node_weights * self.inflow.speed_at(self.node_times) ** 3
        return np.abs(cubes.reshape(self.segments, -1).sum(axis=1) - exact) / np.sum(exact)

    @cached_property
    def flow_missed(self) -> np.ndarray:
        """Error of the flow between the times of `dense`, by segment, over its largest speed.

        The flow's largest distance from straight lines between its speeds at those times.
        """
        times = self.dense
        speed = np.abs(self.inflow.speed_at(times))
        largest = np.maximum(speed[:-1], speed[1:]).reshape(self.segments, -1).max(axis=1)
        off = self.inflow.off_lines(times).reshape(self.segments, -1).max(axis=1)
        return off / np.maximum(largest, off)

    @property
    def dense(self) -> np.ndarray:
        """Times at which the independent integration is sampled, s: `SAMPLES` a segment."""
        return np.append(self.within(np.arange(SAMPLES) / SAMPLES), self.edges[-1])

    @property
    def messages(self) -> tuple[str, ...]:
        """Messages about the flow, one line each."""
        if self.inflow.tells_features:
            return self.inflow.messages
        step = self.duration / UNKNOWN_PIECES
        return (
            *self.inflow.messages,
            f"the flow {self.inflow.profile} gives neither features nor a highest_frequency: it is "
            f"sampled several times every {step:.3g} s, and shorter features can be missed",
        )

    @property
    def mean_flow(self) -> float:
        """Mean speed of the flow at the samples, m/s."""
        return float(np.average(self.speeds, weights=self.sample_weights))

    @property
    def speeds(self) -> np.ndarray:
        """Speeds of the flow at the samples, m/s, (n_samples,); rising where it is steady."""
        return self.inflow.speed_at(self.samples)

    @property
    def samples(self) -> np.ndarray:
        """Times at which the quasi-steady start samples the flow, s: four a segment."""
        return np.append(self.within(0.25 * np.arange(4)), self.edges[-1])

    @property
    def sample_weights(self) -> np.ndarray:
        """Trapezoidal weights of `samples`, s, without the scenario's own weight."""
        step = np.diff(self.samples, prepend=self.edges[0], append=self.edges[-1])
        return 0.5 * (step[:-1] + step[1:])

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes of one segment on [-1, 1], and their quadrature weights."""
        order = self.mesh.order
        if self.mesh.transcription == "gauss-lobatto":
            return lgl(order)
        # order LGR points and the segment's end, which has no weight
        places, weights = lgr(order, include_endpoint=False)
        return np.append(places, 1.0), np.append(weights, 0.0)

    @property
    def nodes_per_segment(self) -> int:
        """Number of nodes of a segment."""
        return self._places[0].size

    @property
    def node_times(self) -> np.ndarray:
        """Times of the phase's nodes, s, in the order of its time series."""
        return self.within(0.5 * (self._places[0] + 1.0))

    @cached_property
    def distinct_nodes(self) -> np.ndarray:
        """Places of the nodes without the first of each segment that has one before it.

        That is at the same time as the last node of the segment before.
        """
        n = self.nodes_per_segment
        return np.delete(np.arange(n * self.segments), n * np.arange(1, self.segments))

    @property
    def node_weights(self) -> np.ndarray:
        """Quadrature weights of the phase's nodes, s, without the scenario's own weight."""
        return np.outer(0.5 * np.diff(self.edges), self._places[1]).ravel()

    @cached_property
    def differentiation(self) -> csr_array:
        """Matrix, 1/s: of values at the nodes, the rates there of each segment's polynomial."""
        places, _ = self._places
        _, by_place = lagrange_matrices(places, places)
        return csr_array(kron(diags_array(2.0 / np.diff(self.edges)), by_place, format="csr"))

    @cached_property
    def between(self) -> csr_array:
        """Matrix of values midway between the nodes, by each segment's polynomial through them."""
        places, _ = self._places
        values, _ = lagrange_matrices(places, 0.5 * (places[1:] + places[:-1]))
        return csr_array(kron(eye_array(self.segments), values, format="csr"))

    @property
    def path(self) -> str:
        """Where the phase's time series are in the model."""
        return f"traj.{self.name}.timeseries"

    def source(self, name: str) -> str:
        """Return where the values over time of a quantity, or of a state, are in the model."""
        by = QUANTITIES[name].source if name in QUANTITIES else "trajectory"
        return f"{self.path if by == 'trajectory' else f'{by}_{self.name}'}.{name}"


def too_large(errors: np.ndarray, most: float) -> np.ndarray:
    """Return which errors are to be made smaller: the sum of the others is at most `most`."""
    large, order = np.zeros(errors.size, dtype=bool), np.argsort(errors)
    large[order] = np.cumsum(errors[order]) > most
    return large


def _sparse(matrices):
    """Return a grid's method whose matrices are sparse from the start.

    Dymos assembles dense ones and then takes their nonzeros. Their memory grows with the square of
    the segments and reaches gigabytes for an hour.
    """

    def sparse_method(source, target, sparse=False):
        with patch.object(grid_data, "block_diag", lambda *parts: block_diag(parts, format="csr")):
            made = matrices(source, target, sparse=True)
        return made if sparse else tuple(matrix.toarray() for matrix in made)

    return sparse_method


def _zeros(shape, **options):
    """Return zeros, sparse in a matrix: one of Dymos' takes gigabytes for an hour."""
    return lil_array(shape) if np.size(shape) == 2 else np.zeros(shape, **options)


# with Kronecker products by the identity of one element, of scalar controls, as they are
_NUMPY = SimpleNamespace(**vars(np) | {"zeros": _zeros, "kron": lambda matrix, _: matrix})


class _Lean:
    """Allows phases of thousands of segments, of unequal ones, and phases without states.

    With rotor speed as a control there are no states to collocate. Dymos can set up such a phase
    except for a component of initial guesses, which must not be empty.

    States and controls have the initial values of `start`, a dict with time (s) and values by name,
    SI units, (n_times,): Dymos can set those only after the setup of the problem, which belongs to
    the user where the phase is part of another model.
    """

    def initialize(self):
        """Declare the start."""
        super().initialize()
        self.options.declare("start", types=dict, recordable=False)

    def _begin(self, phase, variables):
        """Give states or controls, by name with Dymos' options, their initial values."""
        start = self.options["start"]
        for name, options in variables.items():
            options["val"] = phase.interp(name, xs=start["time"], ys=start[name], kind="cubic")

    def init_grid(self):
        """Give the grid matrices that are sparse from the start."""
        super().init_grid()
        grid = self.grid_data
        grid.phase_lagrange_matrices = _sparse(grid.phase_lagrange_matrices)
        grid.phase_hermite_matrices = _sparse(grid.phase_hermite_matrices)

    def configure_controls(self, phase):
        """Scale a control's value at each node by the square root of the time it stands for.

        The effect of a value on an integral over time is proportional to that time, and so is the
        integral's second derivative. An optimizer's first approximation of the Hessian is a
        multiple of the identity: so scaled, it suits segments of any lengths. Dymos takes one
        reference for all nodes; where they are equally spaced, it is the one that holds.
        """
        self._begin(phase, phase.control_options)
        with patch.object(control_comp, "np", _NUMPY):
            super().configure_controls(phase)
        grid = self.grid_data
        spans = np.gradient(grid.node_ptau[grid.subset_node_indices["control_input"]])
        for name, options in phase.control_options.items():
            phase.control_comp.set_design_var_options(
                f"controls:{name}", ref=options["ref"] * np.sqrt(np.max(spans) / spans)
            )

    def configure_defects(self, phase):
        """Scale the defects of long segments by their lengths.

        Dymos multiplies the defect of a state's rate by half the length of its segment. In segments
        of hours the optimizer's tolerance would require a balance of torques to more digits than
        numbers have.
        """
        with patch.object(continuity_comp, "np", _NUMPY):
            super().configure_defects(phase)
        grid, long = self.grid_data, np.diff(self.options["segment_ends"]) / LONG
        factor = np.repeat(np.maximum(long, 1.0), grid.subset_num_nodes_per_segment["col"])
        for name, options in phase.state_options.items():
            phase.collocation_constraint.set_constraint_options(
                f"defects:{name}", ref=options["defect_ref"] * factor
            )

    def setup_states(self, phase):
        """Skip the component where there are no states."""
        if phase.state_options:
            super().setup_states(phase)

    def configure_states(self, phase):
        """Skip the component where there are no states."""
        if phase.state_options:
            self._begin(phase, phase.state_options)
            super().configure_states(phase)


class GaussLobatto(_Lean, dm.GaussLobatto):
    """Gauss-Lobatto transcription; see `_Lean`."""


class Radau(_Lean, dm.Radau):
    """Radau transcription; see `_Lean`."""


_TRANSCRIPTIONS = {"gauss-lobatto": GaussLobatto, "radau": Radau}


def add_phase(trajectory, parameters, scenario, law, ode_options, refs, bounds, start):
    """Add a scenario's phase to a trajectory.

    `ode_options` are those of `RotorODE` besides law and inflow; `parameters` the ODE inputs that
    the model feeds. `refs` has the reference magnitudes, also of the states'
    rates, and `bounds` those of speed, torque and wake, by name. `start` has time, rotor_speed,
    control_torque and the states of law and wake at samples, SI units, (n_times,).
    """
    mesh, time = scenario.mesh, start["time"]
    phase = dm.Phase(
        ode_class=RotorODE,
        ode_init_kwargs={"law": law, "inflow": scenario.inflow, **ode_options},
        transcription=_TRANSCRIPTIONS[mesh.transcription](
            num_segments=scenario.segments,
            order=mesh.order,
            segment_ends=scenario.edges,
            compressed=True,
            start=start,
        ),
    )  # fmt: skip
    trajectory.add_phase(scenario.name, phase)
    span = {"initial_val": float(time[0]), "duration_val": float(time[-1] - time[0])}
    phase.set_time_options(fix_initial=True, fix_duration=True, units="s", targets=["time"], **span)
    for name in parameters:
        phase.add_parameter(name, opt=False, static_targets=True)

    def unknown(name):
        lower, upper = bounds.get(name, (None, None))
        return {"targets": [name], "lower": lower, "upper": upper, "ref": refs[name]}

    def add_state(name, rate):
        phase.add_state(name, rate_source=rate, defect_ref=refs[rate], **unknown(name))

    def add_control(name, **options):
        # value and rate are continuous; with the Radau transcription the last value of a segment is
        # extrapolated, and Dymos has to make it equal to the first of the next one
        options |= unknown(name) | {"continuity": mesh.transcription == "radau"}
        phase.add_control(name, rate_continuity=True, rate_continuity_ref=refs[name], **options)

    rate = "rotor_acceleration"
    if law.chooses_speed:
        add_control("rotor_speed", rate_targets=[rate])
    else:
        add_state("rotor_speed", rate)
    remembers = WAKE_STATES[0] in start
    at_rest = {}
    for name in (*law.states, *WAKE_STATES * remembers):
        add_state(name, f"{name}_rate")
        at_rest[f"{name}_rate"] = refs[f"{name}_rate"]
    if law.chooses_torque:
        add_control("control_torque")
    begins = mesh.initial_speed
    if begins == "equilibrium" or (begins == "auto" and law.is_feedback):
        # where speed is the control, its acceleration is the control's rate
        at_rest["rotor_speed_rate" if law.chooses_speed else rate] = refs[rate]
    for name, ref in at_rest.items():
        phase.add_boundary_constraint(name, loc="initial", equals=0.0, ref=ref)
    for name in (*TRAJECTORY, *("wake_ratio", "wake_factor") * remembers):
        if name not in ("time", "rotor_speed"):
            phase.add_timeseries_output(name)


def in_operation(
    whole: Scenario, cut_out: float | None, diameter: float
) -> tuple[tuple[Scenario, ...], tuple[str, ...]]:
    """Return the scenarios of a flow in which a turbine operates, and messages about them.

    `whole` has the flow over the whole time. Above the speed `cut_out` (m/s) the machine stands
    still. Each interval in which the flow is slower is a scenario, of segments as long as those of
    the case. One that is shorter than a segment, or than the flow takes to pass the rotor's
    `diameter` (m), is standstill too: a rotor and its wake need that long to come into balance. A
    flow that is nowhere faster is left as it is. Raises InputError if no time of operation is left.
    """
    if cut_out is None or whole.steady:
        return (whole,), ()
    mesh, total = whole.mesh, whole.duration
    spans = whole.inflow.spans_below(cut_out, total)
    lengths, segment = np.diff(spans).ravel(), total / mesh.segments
    if np.sum(lengths) == total:
        return (whole,), (f"control.cut_out = {cut_out:g} m/s has no effect: no flow is faster",)
    shortest = max(segment, diameter / cut_out)
    long = lengths >= shortest
    count, longest = int(np.sum(long)), float(np.max(lengths, initial=0.0))
    entry = {"key": "control.cut_out", "value": cut_out}
    if not count:
        slowest = float(np.min(whole.speeds))
        problem = f"leaves no time for operation: the flow has at least {slowest:.4g} m/s, and is "
        problem += f"slower than this for {longest:.3g} s at a time, at most, while the rotor "
        problem += f"needs {shortest:.3g} s"
        raise InputError(problem, "give a larger one, or null for none", **entry)
    if count > MOST_INTERVALS:
        problem = f"divides the operation into {count} intervals, and {MOST_INTERVALS} are the most"
        remedy = "give another one, a lower cutoff of the flow or a shorter phase.duration"
        raise InputError(problem, remedy, **entry)
    prefix = "" if whole.name == "phase" else f"{whole.name}_"
    still = total - float(np.sum(lengths[long]))
    text = (
        f"control.cut_out = {cut_out:g} m/s: standstill for {still:.4g} s of {total:.6g} s "
        f"({100.0 * still / total:.3g} %), intervals of operation: {count}; "
        f"{long.size - count} more, of {np.sum(lengths[~long]):.3g} s together, are shorter than "
        f"the {shortest:.3g} s that the rotor needs"
    )
    scenarios = (
        replace(
            whole,
            name=f"{prefix}interval_{number}",
            interval_of=whole.name,
            edges=np.linspace(begin, end, max(int(np.ceil((end - begin) / segment - 1e-9)), 2) + 1),
        )
        for number, (begin, end) in enumerate(spans[long], start=1)
    )
    return tuple(scenario.resolved() for scenario in scenarios), (text,)
