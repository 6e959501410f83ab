"""A case as an OpenMDAO problem at its start, and its turbine as a part of another model."""

import openmdao.api as om

from hkt_mdo.case import Case
from hkt_mdo.problem.build import add_turbine, assemble
from hkt_mdo.problem.evaluation import in_motion
from hkt_mdo.problem.model import Physics
from hkt_mdo.problem.physics import physics as make_physics
from hkt_mdo.problem.setup import Setup, curve_nodes
from hkt_mdo.solve.threads import one_thread
from hkt_mdo.start.find import find_start


def build_problem(case: Case, *, improve: bool | None = None) -> om.Problem:
    """Return the OpenMDAO problem of a case, set up at its start.

    `problem.run_model()`, `problem.check_partials()`, `om.n2(problem)` and `problem.run_driver()`
    work with it directly. `run_case` optimizes it repeatedly if necessary, and checks the result.

    Parameters
    ----------
    case : Case
    improve : bool, optional
        Whether the starting blade and gains are improved by co-design without time, or kept as
        given; None: as in the case's `start`.

    Returns
    -------
    om.Problem
        Its outputs are energy, generator_energy, electrical_energy and objective (J), mass (kg),
        inertia (kg*m**2); `traj.phase.timeseries` has the trajectory.

    Raises
    ------
    InputError
        If a file of the case is broken, or its optimizer is not installed.
    """
    return assemble(*start_of_case(case, improve))


def start_of_case(case: Case, improve: bool | None = None) -> tuple[Physics, Setup]:
    """Return the physics of a case and where its first optimization begins.

    Parameters
    ----------
    case : Case
    improve : bool, optional
        As that of `build_problem`.

    Returns
    -------
    Physics, Setup

    Raises
    ------
    InputError
        If a file of the case is broken.
    """
    physics = make_physics(case)
    with one_thread():
        start = find_start(physics, improve=improve)
    return physics, Setup(in_motion(physics, start), curve_nodes(physics, start))


class TurbineGroup(om.Group):
    """The rotor of a case with its controller in its flow over time.

    The model that `build_problem` optimizes, without optimizer and objective, which you choose.
    Quantities that the case designs are design variables of the group, with the case's bounds, and
    outputs; quantities that it keeps are inputs. The values of the trajectory at its nodes are
    design variables, too, and the equation of motion and the case's limits are constraints. So only
    at the end of an optimization do the outputs describe a possible operation of the rotor. The
    group begins at blade, gains and trajectory of a search that takes seconds in `setup`, where the
    equation of motion holds approximately. Partials are exact.

    Parameters
    ----------
    case : Case
        Rotor, design variables, flow, law and limits. Its objective only influences the search for
        a start; its optimizer is not used.
    improve : bool, optional
        As that of `build_problem`.

    Notes
    -----
    Inputs, or outputs as far as they are designed:

    - rotor_radius (m), of the swept disc
    - gain_0, gain_1, …, in the law's units; an open loop has none
    - density (kg/m**3), always an input

    Outputs:

    - chord_control[n_chord] (m), twist_control[n_twist] (rad), thickness_control[n_thickness], as
      far as they are designed
    - chord[n_stations] (m), twist[n_stations] (rad), set angle included
    - mass (kg) of the blades, inertia (kg*m**2) of the rotor
    - energy (J) captured in all scenarios together, over the case's duration, generator_energy (J)
      and electrical_energy (J); and objective, that of the case in its unit
    - ``traj.<scenario>.timeseries.<quantity>``[n_times, 1]: time, rotor_speed, control_torque, …;
      ``loads_<scenario>.<load>``[n_times] of each load that a limit of the case takes. The
      scenario of a case with one flow is ``phase``.
    """

    def __init__(self, case, **options):
        super().__init__(case=case, **options)

    def initialize(self):
        self.options.declare("case", types=Case, recordable=False, desc="what is asked")
        self.options.declare("improve", default=None, desc="whether the start is improved")

    def setup(self):
        add_turbine(self, *start_of_case(self.options["case"], self.options["improve"]))
